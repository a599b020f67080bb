//! `punctual check`: its findings on filters and plants, its warnings and its codes.

use std::fs;

use serde_json::Value;

use crate::workshop::{Workshop, assert_golden, examples};

/// Steps that are long enough for a closed loop in a test.
const COARSE: (&str, &str) = ("step_size = 0.001", "step_size = 0.05");

/// The example's filter and plant, the filter with edits.
fn workshop(edits: &[(&str, &str)]) -> Workshop {
    let workshop = Workshop::new();
    let mut filter = fs::read_to_string(examples().join("unicycle-filter.toml")).expect("the example");
    for (from, to) in edits {
        assert_eq!(filter.matches(from).count(), 1, "{from:?} in {filter}");
        filter = filter.replace(from, to);
    }
    workshop.write("filter.toml", filter);
    workshop.write("plant.toml", fs::read(examples().join("unicycle-plant.toml")).expect("the example"));
    workshop
}

fn warnings(workshop: &Workshop, arguments: &[&str]) -> Vec<String> {
    let done = workshop.punctual(["check", "filter.toml", "--json"].iter().chain(arguments));
    let report: Value = serde_json::from_str(&done.stdout).expect("JSON");
    let warnings = report["warnings"].as_array().expect("a list").iter();
    warnings.map(|w| w.as_str().expect("text").to_owned()).collect()
}

#[test]
fn the_text_of_filter_and_plant() {
    let workshop = workshop(&[]);
    assert_golden("check-filter.txt", &workshop.punctual(["check", "filter.toml"]).success());
    assert_golden("check-plant.txt", &workshop.punctual(["check", "plant.toml"]).success());
    let workshop = self::workshop(&[COARSE]);
    let words = ["check", "filter.toml", "--plant", "plant.toml", "--u-ref", "damping"];
    assert_golden("check-start.txt", &workshop.punctual(words).success());
}

#[test]
fn the_repeated_root_from_a_start() {
    let root = ("margin = 0.02 ", "margin = 0.0\nmethod = \"repeated_root\"\nshape = \"quadratic_disc\"");
    let workshop = workshop(&[root, COARSE]);
    let text = workshop.punctual(["check", "filter.toml", "--x0", "theta=0.5"]).stdout;
    assert_golden("check-repeated-root.txt", &text);
}

#[test]
fn a_filter_that_is_given_the_derivatives() {
    let workshop = Workshop::with_external();
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
    let text = fs::read_to_string(workshop.path("external.toml")).expect("written above");
    workshop.write("zero.toml", text.replace("margin = 0.05", "margin = 0.0 "));
    let told = workshop.punctual(["check", "zero.toml"]).success();
    let wanted = "warning: goal: the margin is 0, so that an input held over 0.01 s can cost the deadline\n";
    assert!(told.contains(wanted), "{told}");
}

#[test]
fn the_json_tells_the_same() {
    let workshop = workshop(&[]);
    let text =
        workshop.punctual(["check", "filter.toml", "--json", "--x0", "x_p=44, y_p = 45,v=-0.5"]).success();
    let report: Value = serde_json::from_str(&text).expect("JSON");
    assert_eq!((&report["kind"], &report["model"]), (&"filter".into(), &"unicycle".into()));
    assert_eq!(
        report["start"],
        serde_json::json!([["x_p", 44.0], ["y_p", 45.0], ["theta", 0.0], ["v", -0.5]])
    );
    let warnings = report["warnings"].as_array().expect("a list");
    assert!(
        warnings.iter().all(|w| w.as_str().is_some_and(|w| w.contains("inputs without bounds"))),
        "{report}"
    );
    let barrier = &report["barriers"][0];
    assert_eq!((&barrier["relative_degree"], &barrier["rate_times_deadline"]), (&2.into(), &20.0.into()));
    assert_eq!((&barrier["start"]["inside"], &barrier["start"]["on_course"]), (&true.into(), &true.into()));

    let text = workshop.punctual(["check", "plant.toml", "--json"]).success();
    let report: Value = serde_json::from_str(&text).expect("JSON");
    assert_eq!((&report["kind"], &report["substeps"]), (&"plant".into(), &1.into()));
    assert_eq!((&report["states"][3]["name"], &report["states"][3]["unit"]), (&"v".into(), &"m/s".into()));
}

#[test]
fn warnings_name_what_does_not_fit_the_step() {
    let none: [String; 0] = [];
    assert_eq!(warnings(&workshop(&[]), &[]), none);
    let pointwise = ("[plant]", "sampling = \"pointwise\"\n[plant]");
    assert_eq!(warnings(&workshop(&[("margin = 0.02 ", "margin = 0.0")]), &[]), none);
    let zero = workshop(&[("margin = 0.02 ", "margin = 0.0"), pointwise]);
    assert_eq!(
        warnings(&zero, &[]),
        ["goal: the margin is 0, so that an input held over 0.001 s can cost the deadline"]
    );
    // The default rates heed the step; rates given are taken as they are.
    let long = [("step_size = 0.001", "step_size = 2.0"), ("deadline = 10.0", "deadline = 1.0")];
    assert_eq!(warnings(&workshop(&long), &[]), ["goal: the deadline is shorter than the step of 2 s"]);
    let given = ("margin = 0.02 ", "rate = 20.0\nmargin = 0.02 ");
    let long = workshop(&[long[0], long[1], given]);
    assert_eq!(
        warnings(&long, &[]),
        [
            "goal: rate times step is 40, more than 1: the error changes faster than the input",
            "goal: stay_rate times step is 40, more than 1: the error changes faster than the input",
            "goal: the deadline is shorter than the step of 2 s",
        ]
    );
    let short = workshop(&[("stop_time = 20.0", "stop_time = 9.0")]);
    assert_eq!(warnings(&short, &[]), ["goal: the experiment stops before the deadline"]);
}

/// Bounds that the start asks too much of: the promise cannot be given, and the code shows it.
#[test]
fn a_start_without_a_guarantee_is_code_one() {
    let workshop = workshop(&[("[experiment]", "[bounds]\na = [-0.01, 0.01]\n[experiment]"), COARSE]);
    let done = workshop.punctual(["check", "filter.toml", "--plant", "plant.toml"]);
    assert_eq!(done.code, 1, "{done:#?}");
    assert!(done.stdout.contains("first step with u_ref = 0: infeasible"), "{done:#?}");
    assert!(done.stdout.contains("warning: goal: not to be relied on from this start\n"), "{done:#?}");
}

/// Standing still and heading across the line to the goal: no input moves h at that instant.
#[test]
fn a_start_without_authority_is_code_one() {
    let across = format!("theta={}", 0.75 * std::f64::consts::PI);
    let pointwise = ("[plant]", "sampling = \"pointwise\"\n[plant]");
    let done = workshop(&[COARSE, pointwise]).punctual(["check", "filter.toml", "--x0", &across]);
    assert_eq!(done.code, 1, "{done:#?}");
    assert!(done.stdout.contains("first step with u_ref = 0: no_authority\n"), "{done:#?}");
    assert!(done.stdout.contains("outside, h = -60.8426 m; not on course\n"), "{done:#?}");
}

#[test]
fn a_mixed_relative_degree_is_refused() {
    let workshop = workshop(&[("model = \"unicycle\"", "model = \"bicycle_small_slip\"")]);
    workshop.punctual(["check", "filter.toml"]).fails(
        2,
        "filter.toml: barrier[0]: its relative degree along bicycle_small_slip is mixed: beta enters derivative 1, \
         a enters derivative 2 of h; one row cannot use them all. Plans can, but none are followed: a has no bounds. \
         Mend that, or take the model bicycle_small_slip_rate or bicycle_kinematic, with `[integrator]` where the plant is steered by the angle itself",
    );
}

#[test]
fn starts_that_cannot_be_used() {
    let workshop = workshop(&[]);
    for (x0, message) in [
        ("w=1", "--x0: \"w\" is no state, must be one of x_p, y_p, theta, v"),
        ("v", "--x0: is \"v\", must be like \"v=1.5\""),
        ("v=nan", "--x0: is \"v=nan\", must be a finite number"),
    ] {
        workshop.punctual(["check", "filter.toml", "--x0", x0]).fails(2, message);
    }
    workshop
        .punctual(["check", "filter.toml", "--plant", "filter.toml"])
        .fails(2, "filter.toml: kind: is \"filter\", must be \"plant\"");
    workshop
        .punctual(["check", "plant.toml", "--x0", "v=1"])
        .fails(2, "plant.toml: kind: is a plant; --plant and --x0 give a start to a filter");
    let point_mass = "kind = \"plant\"\nplant.model = \"point_mass\"\n";
    workshop.write("other.toml", point_mass);
    workshop
        .punctual(["check", "filter.toml", "--plant", "other.toml"])
        .fails(2, "other.toml: plant.model: has no state theta, which the filter measures");
}

/// From 60.8 m at 0.1 m/s² no input is there within 10 s; with 20 m/s² the filter is.
#[test]
fn bounds_decide_what_deadline_can_be_met() {
    let with = |limit: &str| {
        let bounds = format!("[bounds]\na = [-{limit}, {limit}]\n[experiment]");
        let workshop = workshop(&[("[experiment]", &bounds), ("step_size = 0.001", "step_size = 0.1")]);
        let done =
            workshop.punctual(["check", "filter.toml", "--x0", "theta=0.3", "--json", "--u-ref", "damping"]);
        let report: Value = serde_json::from_str(&done.stdout).expect("JSON");
        (done.code, report["barriers"][0]["start"]["reach"].clone())
    };
    let (code, lost) = with("0.1");
    assert_eq!((code, &lost["deadline"]), (1, &"cannot_be_met".into()), "{lost}");
    // √(2 · 61.64/0.1), and more.
    let (least, most) = (lost["soonest_at_least"].as_f64(), lost["soonest_at_most"].as_f64());
    assert!(least.is_some_and(|t| (t - 35.11).abs() < 0.01) && most >= least, "{lost}");
    let (code, met) = with("20.0");
    assert_eq!((code, &met["deadline"]), (0, &"can_be_met".into()), "{met}");
    let most = met["soonest_at_most"].as_f64();
    assert!(most.is_some_and(|t| t < 10.0) && most >= met["soonest_at_least"].as_f64(), "{met}");
}

/// The table and the lines to paste; with these the deadline is kept, with less it was not.
#[test]
fn the_least_effort_from_a_start() {
    let edits = [("step_size = 0.001", "step_size = 0.05")];
    let workshop = workshop(&edits);
    workshop
        .punctual(["check", "filter.toml", "--effort"])
        .fails(2, "--effort: needs a start: give --plant, --x0, or [x0] in the file");
    let words = ["check", "filter.toml", "--plant", "plant.toml", "--effort", "--u-ref", "damping"];
    let text = workshop.punctual(words).success();
    assert_golden("check-effort.txt", &text);
    let value = |key: &str| {
        let line = text.lines().rev().find(|line| line.starts_with(key)).expect("a line to paste");
        line.split_once(" = ").expect("an assignment").1.to_owned()
    };
    let filter = workshop.text("filter.toml");
    let pasted = format!("profile = {}\nrate = {}\n", value("profile"), value("rate"));
    let with = filter
        .replace("[experiment]", &format!("[bounds]\na = {}\n[experiment]", value("a")))
        .replace("deadline = 10.0", &format!("{pasted}deadline = 10.0"));
    workshop.write("least.toml", with);
    let checked = workshop.punctual(["check", "least.toml", "--plant", "plant.toml", "--u-ref", "damping"]);
    assert!(
        checked.stdout.contains("can be met (this filter does it with that u_ref, simulated)"),
        "{checked:#?}"
    );
}

/// A plan is searched for where every input has bounds, and found where there is time enough.
#[test]
fn a_plan_keeps_every_promise_or_is_not_found() {
    let with = |a: &str, more: &str| {
        let bounds = format!("[bounds]\na = [-{a}, {a}]\nomega = [-2.0, 2.0]\n[experiment]");
        let margin = format!("margin = 0.02 {more}");
        let edits = [
            ("[experiment]", &*bounds),
            ("step_size = 0.001", "step_size = 0.05"),
            ("margin = 0.02 ", &margin),
        ];
        let workshop = workshop(&edits);
        let words = ["check", "filter.toml", "--x0", "theta=0.3"];
        let report = workshop.punctual(words.iter().chain(&["--json"])).stdout;
        let report: Value = serde_json::from_str(&report).expect("JSON");
        (report["witness"].clone(), workshop.punctual(words).stdout)
    };
    // Ample bounds: a plan, and a sooner one. At rest past the deadline, within the bounds.
    let (witness, text) = with("8.0", "");
    assert!(
        text.contains("witness: a plan within the bounds keeps every promise, whatever u_ref is\n"),
        "{text}"
    );
    assert_eq!(witness["found"], true);
    let factor = |witness: &Value| witness["soonest_factor"].as_f64();
    assert!(factor(&witness).is_some_and(|f| f < 1.0), "{witness}");
    let plan = &witness["plan"];
    assert!(plan["rest"].as_f64() > Some(10.0), "{witness}");
    assert!(plan["inputs"][0][1].as_f64().is_some_and(|peak| 0.0 < peak && peak <= 8.0), "{witness}");
    // At 0.8 m/s² the edge, 61.6 m away, is passed after 14.95 s at the earliest by who can still stop inside.
    let (witness, text) = with("0.8", "");
    assert!(
        text.contains("witness: NONE was found: by the nearest way tried, goal is not met at "),
        "{text}"
    );
    assert_eq!(witness["found"], false);
    assert!(factor(&witness).is_some_and(|f| (1.49..1.65).contains(&f)), "{witness}");
    let soonest = witness["soonest"][0][1].as_f64();
    assert!(soonest.zip(factor(&witness)).is_some_and(|(s, f)| (s - 10.0 * f).abs() < 1e-9), "{witness}");
    // What no plan accounts for is said.
    let (witness, text) = with("8.0", "\ndisturbance = 0.1 #");
    let reason = "goal.disturbance: is not 0, which no plan accounts for yet";
    assert_eq!((&witness["found"], &witness["reason"]), (&false.into(), &reason.into()), "{witness}");
    assert!(text.contains(&format!("witness: NONE was found: {reason}\n")), "{text}");
}

/// A filter that follows plans and finds none promises nothing, although its rows keep the set from there: the code shows it,
/// and later deadlines that nobody has asked for are not spoken of.
#[test]
fn a_start_without_a_plan_is_code_one() {
    let workshop = Workshop::new();
    let written = |least: f64| {
        let text = format!(
            r#"
kind = "filter"
bounds = {{ u = [{least:?}, 2.0] }}
x0 = {{ v = 1.0 }}
experiment = {{ step_size = 0.05 }}

[plant]
states = [{{ name = "p", unit = "m" }}, {{ name = "v", unit = "m/s" }}]
inputs = [{{ name = "u", unit = "m/s2" }}]
derivatives = {{ p = "v", v = "u" }}

[[barrier]]
name = "floor"
expression = "p + 1"
"#
        );
        workshop.write("floor.toml", text);
        workshop.punctual(["check", "floor.toml"])
    };
    // It gathers speed for ever, away from the floor.
    let done = written(0.5);
    assert_eq!(done.code, 1, "{done:#?}");
    assert!(
        done.stdout.contains("every promise is kept") && done.stdout.contains("witness: NONE was found"),
        "{done:#?}"
    );
    assert!(!done.stdout.contains("for deadlines up to"), "{done:#?}");
    let done = written(-0.5);
    assert_eq!(done.code, 0, "{done:#?}");
}
