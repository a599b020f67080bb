//! `punctual inspect`: the text, the JSON, and FMUs that violate the standard.

use serde_json::Value;

use crate::misbehaving;
use crate::workshop::{Workshop, assert_golden, without_guids};

#[test]
fn the_text_of_filter_and_plant() {
    let workshop = Workshop::with_fmus();
    for name in ["filter", "plant"] {
        let text = workshop.punctual(["inspect", &format!("{name}.fmu")]).success();
        // The test must not depend on the version and the platform.
        let text = text.replace(env!("CARGO_PKG_VERSION"), "VERSION");
        let text = text.replace(punctual_cosim::host::PLATFORM, "PLATFORM");
        assert_golden(&format!("inspect-{name}.txt"), &without_guids(&text));
    }
}

#[test]
fn a_filter_that_is_given_the_derivatives() {
    let workshop = Workshop::with_external();
    workshop.punctual(["build", "external.toml", "-o", "external.fmu"]).success();
    let text = workshop.punctual(["inspect", "external.fmu"]).success();
    let text = text.replace(env!("CARGO_PKG_VERSION"), "VERSION");
    let text = text.replace(punctual_cosim::host::PLATFORM, "PLATFORM");
    assert_golden("inspect-external.txt", &without_guids(&text));
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
    assert_eq!(variables.len(), 43);
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

#[test]
fn an_fmu_with_both_interfaces() {
    let workshop = Workshop::new();
    let exchange = "<ModelExchange modelIdentifier=\"misbehaving\" completedIntegratorStepNotNeeded=\"true\" \
                    providesDirectionalDerivative=\"true\"/><CoSimulation";
    let rate = "<ScalarVariable name=\"der(y)\" valueReference=\"3\"><Real derivative=\"1\"/></ScalarVariable></ModelVariables>";
    let edits = [
        ("<CoSimulation", exchange),
        ("</ModelVariables>", rate),
        ("</Outputs>", "</Outputs><Derivatives><Unknown index=\"5\"/></Derivatives>"),
        ("</InitialUnknowns>", "<Unknown index=\"5\"/></InitialUnknowns>"),
    ];
    misbehaving::write(&workshop, "x.fmu", misbehaving::description("none", &edits), &[]);
    let shown = workshop.punctual(["inspect", "x.fmu"]).success();
    for line in [
        "interfaces  model exchange, co-simulation\n",
        "states      y\n",
        "can         give directional derivatives (in model exchange)\n",
        "can         take steps of any length (in co-simulation)\n",
    ] {
        assert!(shown.contains(line), "{line} in {shown}");
    }
    let json = workshop.punctual(["inspect", "--json", "x.fmu"]).success();
    let report: Value = serde_json::from_str(&json).expect("JSON");
    assert_eq!(report["model_exchange"]["completed_integrator_step_not_needed"], true);
    assert_eq!(report["states"], serde_json::json!(["y"]));
}
