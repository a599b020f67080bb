//! `punctual inspect`: the text, the JSON, and FMUs that break the standard.

use serde_json::Value;

use crate::workshop::{Workshop, assert_golden, examples, without_guids};

#[test]
fn the_text_of_filter_and_plant() {
    let workshop = Workshop::with_fmus();
    for name in ["filter", "plant"] {
        let text = workshop.punctual(["inspect", &format!("{name}.fmu")]).success();
        // The version and the platform are not what this is about.
        let text = text.replace(env!("CARGO_PKG_VERSION"), "VERSION");
        let text = text.replace(punctual::host::PLATFORM, "PLATFORM");
        assert_golden(&format!("inspect-{name}.txt"), &without_guids(&text));
    }
}

/// The folder of the examples with their own models.
fn external() -> Workshop {
    let workshop = Workshop::new();
    let example = examples().join("../models/external-filter.toml");
    workshop.write("external.toml", std::fs::read(example).expect("the example"));
    workshop
}

#[test]
fn a_filter_that_is_given_the_derivatives() {
    let workshop = external();
    workshop.punctual(["build", "external.toml", "-o", "external.fmu"]).success();
    let text = workshop.punctual(["inspect", "external.fmu"]).success();
    let text = text.replace(env!("CARGO_PKG_VERSION"), "VERSION");
    let text = text.replace(punctual::host::PLATFORM, "PLATFORM");
    assert_golden("inspect-external.txt", &without_guids(&text));
}

#[test]
fn the_check_of_a_filter_that_is_given_the_derivatives() {
    let workshop = external();
    let start = "goal.lf0=-10,goal.lf1=1,goal.lg.u_x=1,speed.lf0=6";
    let text = workshop.punctual(["check", "external.toml", "--x0", start]).success();
    assert_golden("check-external.txt", &text);
    workshop.write("plant.toml", "kind = \"plant\"\nplant.model = \"point_mass\"\n");
    for (arguments, message) in [
        (
            &["--plant", "plant.toml"][..],
            "--plant: is a start of the states, but barrier goal is external: give its derivatives, as --x0 \"goal.lf0=-1\"",
        ),
        (&["--x0", start, "--effort"], "--effort: simulates, but barrier goal is external: it has no model"),
        (
            &["--x0", "x_p=1"],
            "--x0: \"x_p\" is no state, must be one of goal.lf0, goal.lf1, goal.lf2, goal.lg.u_x, goal.lg.u_y, speed.lf0, speed.lf1, speed.lg.u_x, speed.lg.u_y",
        ),
    ] {
        workshop.punctual(["check", "external.toml"].iter().chain(arguments)).fails(2, message);
    }
}

#[test]
fn the_json_tells_the_same() {
    let workshop = Workshop::with_fmus();
    let text = workshop.punctual(["inspect", "--json", "filter.fmu"]).success();
    let report: Value = serde_json::from_str(&text).expect("JSON");
    assert_eq!(report["file"], "filter.fmu");
    assert_eq!(report["model_name"], "unicycle_filter");
    assert_eq!(report["default_experiment"]["step_size"], 0.001);
    assert_eq!(report["problems"], Value::Array(vec![]));
    let variables = report["variables"].as_array().expect("a list");
    assert_eq!(variables.len(), 38);
    let deadline = variables.iter().find(|v| v["name"] == "goal.deadline").expect("the deadline");
    assert_eq!((&deadline["unit"], &deadline["causality"]), (&"s".into(), &"parameter".into()));
    assert_eq!((&deadline["start"], &deadline["min"]), (&"10.0".into(), &1e-9.into()));
    let status = variables.iter().find(|v| v["name"] == "status").expect("the status");
    assert_eq!(status["items"][1], serde_json::json!(["filtered", 1]));
    let names = |v: &Value| v.as_array().expect("a list").len();
    let h = report["dependencies"].as_array().expect("a list").iter().find(|d| d["output"] == "goal.h");
    assert_eq!(h.map(|d| names(&d["on"])), Some(7), "every input");
}

#[test]
fn what_breaks_the_standard_is_noted_on_stderr() {
    let workshop = Workshop::with_fmus();
    workshop.edit_fmu("plant.fmu", |entry, bytes| {
        if entry != "modelDescription.xml" {
            return Some(bytes);
        }
        let xml = String::from_utf8(bytes).expect("UTF-8");
        Some(xml.replacen("name=\"u.omega\"", "name=\"u.a\"", 1).into_bytes())
    });
    let done = workshop.punctual(["inspect", "plant.fmu"]);
    assert_eq!(done.code, 0);
    assert!(
        done.stderr.starts_with("note: modelDescription.xml: ") && done.stderr.contains("u.a"),
        "{done:?}"
    );
}
