//! `punctual check`: its findings on filters and plants, its warnings and its exit codes.

use std::fs;

use serde_json::Value;

use crate::workshop::{Workshop, assert_golden, examples};

/// Steps that are coarse enough for a closed loop in a test.
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
            "--x0: \"x_p\" is not a state, must be one of goal.lf0, goal.lf1, goal.lf2, goal.lg.u_x, goal.lg.u_y, speed.lf0, speed.lf1, speed.lg.u_x, speed.lg.u_y",
        ),
    ] {
        workshop.punctual(["check", "external.toml"].iter().chain(arguments)).fails(2, message);
    }
    let text = fs::read_to_string(workshop.path("external.toml")).expect("written above");
    workshop.write("zero.toml", text.replace("margin = 0.05", "margin = 0.0 "));
    let printed = workshop.punctual(["check", "zero.toml"]).success();
    let wanted =
        "warning: goal, speed: the margin is 0, so that an input held over 0.01 s can cost the deadline\n";
    assert!(printed.contains(wanted), "{printed}");
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
    // The default rates take the step into account; given rates are used unchanged.
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

/// Bounds too small for the start: the promise cannot be given, and the exit code shows it.
#[test]
fn a_start_without_a_guarantee_is_code_one() {
    let workshop = workshop(&[("[experiment]", "[bounds]\na = [-0.01, 0.01]\n[experiment]"), COARSE]);
    let done = workshop.punctual(["check", "filter.toml", "--plant", "plant.toml"]);
    assert_eq!(done.code, 1, "{done:#?}");
    assert!(done.stdout.contains("first step with u_ref = 0: infeasible"), "{done:#?}");
    assert!(done.stdout.contains("warning: goal: not to be relied on from this start\n"), "{done:#?}");
}

/// At rest, with the heading perpendicular to the line to the goal, no input moves h at that instant.
#[test]
fn a_start_without_authority_is_code_one() {
    let across = format!("theta={}", 0.75 * std::f64::consts::PI);
    let pointwise = ("[plant]", "sampling = \"pointwise\"\n[plant]");
    let done = workshop(&[COARSE, pointwise]).punctual(["check", "filter.toml", "--x0", &across]);
    assert_eq!(done.code, 1, "{done:#?}");
    assert!(done.stdout.contains("first step with u_ref = 0: no_authority\n"), "{done:#?}");
    assert!(done.stdout.contains("outside, h = -60.84 m; not on course\n"), "{done:#?}");
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
        ("w=1", "--x0: \"w\" is not a state, must be one of x_p, y_p, theta, v"),
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

/// From 60.8 m at 0.1 m/s², no input arrives within 10 s; with 20 m/s² the filter does.
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
    // At least √(2 · 61.64/0.1).
    let (least, most) = (lost["earliest_at_least"].as_f64(), lost["earliest_at_most"].as_f64());
    assert!(least.is_some_and(|t| (t - 35.11).abs() < 0.01) && most >= least, "{lost}");
    let (code, met) = with("20.0");
    assert_eq!((code, &met["deadline"]), (0, &"can_be_met".into()), "{met}");
    let most = met["earliest_at_most"].as_f64();
    assert!(most.is_some_and(|t| t < 10.0) && most >= met["earliest_at_least"].as_f64(), "{met}");
}

/// The table and the lines to paste. With these the deadline is kept, with smaller bounds it was not.
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
    // A file with another method gets the same table, and the method to paste.
    workshop.write(
        "filter.toml",
        filter.replace("deadline = 10.0", "method = \"repeated_root\"\ndeadline = 10.0"),
    );
    let other = workshop.punctual(words).stdout;
    let table = |text: &str| {
        let from = text.find("effort, simulated").expect("a table");
        text[from..].lines().take(11).map(str::to_owned).collect::<Vec<_>>()
    };
    assert_eq!(table(&other), table(&text));
    let pasted = "# in [[barrier]] goal\nmethod = \"reference_profile\"\nprofile = \"hermite\"\nrate = 0.5\n";
    assert!(other.contains(pasted), "{other}");
}

/// A plan is searched for if every input has bounds, and found if there is enough time.
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
        (report["backup_plan"].clone(), move || workshop.punctual(words).stdout)
    };
    // Ample bounds: there is a plan, even for an earlier deadline. It is at rest after the deadline, within
    // the bounds.
    let (backup_plan, text) = with("8.0", "");
    let text = text();
    assert!(
        text.contains("backup plan: found; within the bounds, it keeps every promise, whatever u_ref is\n"),
        "{text}"
    );
    assert_eq!(backup_plan["found"], true);
    let factor = |backup_plan: &Value| backup_plan["earliest_factor"].as_f64();
    assert!(factor(&backup_plan).is_some_and(|f| f < 1.0), "{backup_plan}");
    let plan = &backup_plan["plan"];
    assert!(plan["at_equilibrium_from"].as_f64() > Some(10.0), "{backup_plan}");
    assert!(plan["inputs"][0][1].as_f64().is_some_and(|peak| 0.0 < peak && peak <= 8.0), "{backup_plan}");
    // At 0.8 m/s² the edge, 61.6 m away, is passed after 12.4 s at the earliest. Stopping inside straight
    // ahead takes 14.95 s; turning inside is faster.
    let (backup_plan, _) = with("0.8", "");
    let reason = backup_plan["reason"].as_str().unwrap_or_default();
    assert!(reason.starts_with("in the closest attempt, goal is not met at "), "{backup_plan}");
    assert_eq!(backup_plan["found"], false);
    assert!(factor(&backup_plan).is_some_and(|f| (1.24..1.65).contains(&f)), "{backup_plan}");
    let earliest = backup_plan["earliest"][0][1].as_f64();
    assert!(
        earliest.zip(factor(&backup_plan)).is_some_and(|(s, f)| (s - 10.0 * f).abs() < 1e-9),
        "{backup_plan}"
    );
    // What plans do not support is reported, in the text as a reason of any kind.
    let (backup_plan, text) = with("8.0", "\ndisturbance = 0.1 #");
    let text = text();
    let reason = "goal.disturbance is 0.1, must be 0 for a plan; plans account for `rates` of [uncertainty] in its place";
    assert_eq!(
        (&backup_plan["found"], &backup_plan["reason"]),
        (&false.into(), &reason.into()),
        "{backup_plan}"
    );
    assert!(text.contains(&format!("backup plan: NONE was found: {reason}\n")), "{text}");
}

/// A filter that follows plans and finds none promises nothing, although its rows would keep the set from
/// there. The exit code shows it, and later deadlines, which nobody asked for, are not mentioned.
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
    // It accelerates forever, away from the floor.
    let done = written(0.5);
    assert_eq!(done.code, 1, "{done:#?}");
    assert!(
        done.stdout.contains("every promise is kept") && done.stdout.contains("backup plan: NONE was found"),
        "{done:#?}"
    );
    assert!(!done.stdout.contains("for deadlines up to"), "{done:#?}");
    let done = written(-0.5);
    assert_eq!(done.code, 0, "{done:#?}");
}

/// A filter for a point mass with these barriers, and `before` as the text before them.
fn point_mass(before: &str, barriers: &str) -> String {
    format!(
        r#"kind = "filter"
plant.model = "point_mass"
experiment = {{ stop_time = 12.0, step_size = 0.05 }}
{before}
{barriers}"#
    )
}

fn disc(name: &str, shape: &str, [x, y]: [f64; 2], radius: f64, more: &str) -> String {
    format!(
        "[[barrier]]\nname = \"{name}\"\nshape = \"{shape}\"\ncentre = [{x:?}, {y:?}]\nradius = {radius:?}\n{more}\n"
    )
}

const BOUNDS: &str = "bounds = { u_x = [-2.0, 2.0], u_y = [-2.0, 2.0] }\nx0 = { v_x = 0.0 }";

/// The deadlines tried lie within the time of their barrier: `check` judges whatever `run` accepts, and
/// invents no numbers.
#[test]
fn a_barrier_that_begins_later_or_ends_is_judged() {
    let workshop = Workshop::new();
    for (k, (begin, deadline, end)) in [
        (Some(19.0), 20.0, None),
        (Some(4.0), 4.5, Some(5.0)),
        (None, 5.0, Some(5.0)),
        (None, 3.0, Some(4.0)),
        (Some(0.5), 9.0, Some(9.0)),
    ]
    .into_iter()
    .enumerate()
    {
        let key =
            |name: &str, value: Option<f64>| value.map_or(String::new(), |v| format!("{name} = {v:?}\n"));
        let window = format!("deadline = {deadline:?}\n{}{}", key("begin", begin), key("end", end));
        let bounds = if k % 2 == 0 { BOUNDS } else { "bounds = { u_x = [-2.0, 2.0] }\nx0 = { v_x = 0.0 }" };
        workshop.write("filter.toml", point_mass(bounds, &disc("A", "disc", [10.0, 6.0], 1.0, &window)));
        let done = workshop.punctual(["check", "filter.toml", "--json"]);
        assert!(done.code < 2, "{window}: {done:#?}");
        let report: Value = serde_json::from_str(&done.stdout).expect("JSON");
        let barrier = &report["barriers"][0];
        assert_eq!(barrier["deadline"].as_f64(), Some(deadline));
        let lists =
            [&barrier["start"]["reach"]["earliest_at_most"], &report["backup_plan"]["earliest"][0][1]];
        for earliest in lists.iter().filter_map(|value| value.as_f64()) {
            let range = begin.unwrap_or(0.0)..=end.unwrap_or(f64::INFINITY);
            assert!(range.contains(&earliest), "{window}: {earliest}");
        }
    }
}

/// A gap of 90 m that does not affect the car yet: the rate shown is the one in force, and an earliest
/// deadline is no later than the arrival shown with it.
#[test]
fn what_check_says_is_what_acts() {
    let workshop = Workshop::new();
    let expressions = |x0: &str, step: f64, plant: &str, barriers: &str| {
        format!(
            "kind = \"filter\"\nx0 = {{ {x0} }}\nexperiment = {{ stop_time = 300.0, step_size = {step:?} }}\n[plant]\n{plant}\n{barriers}"
        )
    };
    let car = r#"states = [{ name = "v", unit = "m/s" }, { name = "z", unit = "m" }]
inputs = [{ name = "a", unit = "m/s2", min = -4.0, max = 4.0 }]
derivatives = { v = "a", z = "15 - v" }"#;
    let gap = "[[barrier]]\nname = \"gap\"\nexpression = \"z - 10\"\nunit = \"m\"";
    workshop.write("gap.toml", expressions("v = 20.0, z = 100.0", 0.1, car, gap).replace("300.0", "20.0"));
    let text = workshop.punctual(["check", "gap.toml"]).success();
    // Half of the 4 m/s2, divided by 90 m.
    let wanted = "  rate             0.1491 1/s at the start, chosen at every sample\n";
    assert!(text.contains(wanted), "{text}");
    let glucose = r#"states = [{ name = "G" }, { name = "X" }, { name = "I" }]
inputs = [{ name = "u", min = 0.0, max = 10.0 }]
derivatives = { G = "-0.0317*(G-81)-X*G", X = "-0.0123*X+0.00000492*(I-7)", I = "-0.2659*(I-7)+u" }"#;
    let range = "[[barrier]]\nname = \"range\"\nexpression = \"180 - G\"\ndeadline = 90.0\n[[barrier]]\nname = \"hypo\"\nexpression = \"G - 70\"";
    workshop.write("glucose.toml", expressions("G = 260.0, X = 0.0, I = 7.0", 1.0, glucose, range));
    let report = workshop.punctual(["check", "glucose.toml", "--json"]).success();
    let report: Value = serde_json::from_str(&report).expect("JSON");
    let arrival = report["closed_loop"]["barriers"][0]["arrival"].as_f64().expect("it arrives");
    let earliest =
        report["barriers"][0]["start"]["reach"]["earliest_at_most"].as_f64().expect("an earliest one");
    assert!((18.0..19.0).contains(&arrival) && earliest <= arrival + 1e-9, "{earliest} s, {arrival} s");
    assert!(report["backup_plan"]["earliest"][0][1].as_f64().is_some_and(|at| at <= arrival + 1e-9));
    assert_eq!(report["warnings"].as_array().map(Vec::len), Some(0), "{report}");
}

/// The plant to simulate and its u_ref are those of the file, or `check` says that they are not.
#[test]
fn a_plant_to_simulate_is_simulated_or_it_is_said() {
    let workshop = Workshop::new();
    let goal = disc("goal", "disc", [6.0, 0.0], 1.0, "deadline = 6.0");
    let before = format!("{BOUNDS}\nu_ref = {{ u_x = \"1\", u_y = \"0\" }}");
    let simulated = |plant: &str| format!("{}\n[simulated]\n{plant}", point_mass(&before, &goal));
    let alike = r#"states = [{ name = "x_p" }, { name = "y_p" }, { name = "v_x" }, { name = "v_y" }]
inputs = [{ name = "u_x" }, { name = "u_y" }]
derivatives = { x_p = "v_x", y_p = "v_y", v_x = "u_x - 0.5", v_y = "u_y" }"#;
    workshop.write("alike.toml", simulated(alike));
    let printed = workshop.punctual(["check", "alike.toml"]).stdout;
    assert!(printed.contains("closed loop with the u_ref of the file"), "{printed}");
    assert!(printed.contains("warning: the closed loop has the plant in `simulated`"), "{printed}");
    let lagged = alike
        .replace("{ name = \"v_y\" }", "{ name = \"v_y\" }, { name = \"w\" }")
        .replace("v_y = \"u_y\"", "v_y = \"w\", w = \"10*(u_y - w)\"");
    workshop.write("lagged.toml", simulated(&lagged));
    let printed = workshop.punctual(["check", "lagged.toml"]).stdout;
    assert!(
        printed.contains("since `simulated` has other states or inputs, and not the file's u_ref"),
        "{printed}"
    );
}

/// What geometry rules out is refused without a search, with the names and numbers of the sets; what is
/// possible is not refused.
#[test]
fn sets_that_are_apart_are_refused_by_name() {
    let workshop = Workshop::new();
    let reason = |before: &str, barriers: &[String]| {
        workshop.write("filter.toml", point_mass(before, &barriers.concat()));
        let report = workshop.punctual(["check", "filter.toml", "--json"]).stdout;
        let report: Value = serde_json::from_str(&report).expect("JSON");
        report["backup_plan"]["reason"].as_str().unwrap_or_default().to_owned()
    };
    let goal = |more: &str| disc("goal", "disc", [8.0, 2.0], 1.0, more);
    let rock = |radius: f64, more: &str| disc("rock", "obstacle", [8.5, 2.0], radius, more);
    let within = "goal lies wholly inside rock, 0.5 m from its edge: no state is in goal and outside rock, but both must hold at the same time";
    assert_eq!(reason(BOUNDS, &[goal("deadline = 8.0"), rock(2.0, "")]), within);
    workshop.punctual(["check", "filter.toml"]);
    let run = workshop.punctual(["run", "filter.toml"]);
    assert!(format!("{}{}", run.stdout, run.stderr).contains(within), "{run:#?}");
    // Part of the goal is free; the rock is released by then; it moves; or it is soft.
    for barriers in [
        [goal("deadline = 8.0"), rock(1.4, "")],
        [goal("deadline = 8.0"), rock(2.0, "end = 7.0")],
        [goal("deadline = 8.0"), rock(2.0, "penalty = 10.0")],
        [goal("deadline = 8.0"), rock(2.0, "velocity = [1.0, 0.0]")],
    ] {
        let said = reason(BOUNDS, &barriers);
        assert!(!said.contains("lies wholly inside"), "{barriers:?}: {said}");
    }
    // A home that contains the start must be kept from there on.
    let home = disc("home", "disc", [0.0, 0.0], 2.0, "deadline = 12.0");
    let said = reason(
        BOUNDS,
        &[disc("pickup", "disc", [8.0, 0.0], 1.0, "deadline = 6.0\nuntil_arrival = true"), home],
    );
    let wanted = "home and pickup are 5 m apart: no state is in both; and home contains the start, so it must be kept from the first step on: did you mean `begin`?";
    assert_eq!(said, wanted);
    // Bounds that fix the input.
    let fixed = "bounds = { u_x = [0.0, 0.0], u_y = [0.0, 0.0] }\nx0 = { v_x = 1.0 }";
    let said = reason(fixed, &[goal("deadline = 8.0")]);
    let wanted = "the bounds fix every input (u_x = 0, u_y = 0), so that nothing can steer the plant; in the closest attempt, goal is not met at ";
    assert!(said.starts_with(wanted), "{said}");
}

/// Whatever `check` knows about a filter, a run of its file reports too.
#[test]
fn a_run_says_what_check_knows() {
    let workshop = Workshop::new();
    let printed = |barriers: &str| {
        workshop.write("filter.toml", point_mass(BOUNDS, barriers));
        let done = workshop.punctual(["run", "filter.toml"]);
        format!("{}{}", done.stdout, done.stderr)
    };
    let soon = printed(&disc("goal", "disc", [30.0, 0.0], 1.0, "deadline = 4.0"));
    assert!(soon.contains("earliest deadline with a plan: goal "), "{soon}");
    let root = printed(&disc(
        "goal",
        "quadratic_disc",
        [10.0, 0.0],
        1.0,
        "deadline = 10.0\nmethod = \"repeated_root\"",
    ));
    let check = workshop.punctual(["check", "filter.toml"]).stdout;
    let warning = check.lines().find_map(|line| line.strip_prefix("warning: goal: ")).expect("a warning");
    assert!(root.contains(&format!("note: goal: {warning}")), "{warning}: {root}");
}

/// Turning changes the position only at nonzero speed. The row on the speed is right, but no row limits the
/// turn, so it needs bounds.
#[test]
fn an_input_that_enters_later_needs_bounds() {
    let workshop = Workshop::new();
    let checked = |bounds: &str| {
        let text = format!(
            r#"kind = "filter"
x0 = {{ x = 0.0 }}
u_ref = {{ v = "2", omega = "0" }}
{bounds}
experiment = {{ stop_time = 8.0, step_size = 0.05 }}
[plant]
states = [{{ name = "x" }}, {{ name = "y" }}, {{ name = "psi" }}]
inputs = [{{ name = "v" }}, {{ name = "omega" }}]
derivatives = {{ x = "v*cos(psi)", y = "v*sin(psi)", psi = "omega" }}
[[barrier]]
name = "post"
expression = "(x - 10)^2 + (y - 0.1)^2 - 1"
"#
        );
        workshop.write("turning.toml", text);
        workshop.punctual(["check", "turning.toml"])
    };
    let message = |free: &str| {
        format!(
            "turning.toml: barrier[0]: its relative degree along expressions is mixed: v enters derivative 1, omega enters derivative 2 \
             of h; one row cannot use them all. Plans can, but none are followed: {free} has no bounds. Mend that, or put 1 integrator \
             before v: make it a state whose derivative is the new input"
        )
    };
    checked("").fails(2, &message("v"));
    checked("bounds = { v = [-3.0, 3.0] }").fails(2, &message("omega"));
    let taken = checked("bounds = { omega = [-2.0, 2.0] }");
    let warning = "warning: post: inputs enter h at different orders, and without plans only the first is used: v has no bounds";
    assert!(taken.code == 0 && taken.stdout.contains(warning), "{taken:#?}");
    let planned = checked("bounds = { v = [-3.0, 3.0], omega = [-2.0, 2.0] }");
    assert!(planned.code == 0 && planned.stdout.contains("guaranteed"), "{planned:#?}");
}

/// Rocks: the position of each, and its radius.
const FOREST: [(f64, f64, f64); 25] = [
    (16.275, -9.524, 0.838),
    (12.059, -10.404, 0.841),
    (51.734, 7.211, 1.059),
    (15.54, 0.88, 0.766),
    (45.623, -7.358, 0.786),
    (36.603, 5.565, 1.113),
    (49.763, -9.919, 0.964),
    (38.928, 0.143, 0.707),
    (28.627, -9.856, 1.161),
    (49.005, 1.143, 0.78),
    (35.143, -1.655, 0.697),
    (19.866, 7.502, 0.626),
    (6.409, 3.032, 0.768),
    (55.859, -7.306, 0.848),
    (33.044, 9.704, 0.661),
    (7.204, -6.507, 1.059),
    (36.002, -6.302, 0.799),
    (40.259, 9.502, 1.173),
    (25.342, 10.639, 0.972),
    (22.862, -5.032, 0.658),
    (55.051, -1.825, 0.725),
    (10.358, 0.702, 1.064),
    (16.036, 8.873, 0.685),
    (6.666, 10.273, 0.939),
    (54.497, 11.083, 1.001),
];

/// A plan is found for each of the deadlines, since the search measures what is missing directly, and not by
/// what a long piece of the trajectory leaves undecided.
#[test]
fn a_forest_is_promised_at_later_deadlines_too() {
    let workshop = Workshop::new();
    let rocks: String =
        (0..).zip(FOREST).map(|(i, (x, y, r))| disc(&format!("o{i}"), "obstacle", [x, y], r, "")).collect();
    for deadline in [24.0, 25.0, 26.2] {
        let goal = disc("goal", "disc", [60.0, 0.0], 2.0, &format!("deadline = {deadline:?}"));
        let text = format!(
            "kind = \"filter\"\nplant.model = \"unicycle\"\nbounds = {{ a = [-3.0, 3.0], omega = [-1.5, 1.5] }}\nx0 = {{ v = 2.0 }}\n\
             experiment = {{ stop_time = 0.1, step_size = 0.02 }}\n{goal}{rocks}"
        );
        workshop.write("forest.toml", text);
        let run = workshop.punctual(["run", "forest.toml"]);
        assert!(!format!("{}{}", run.stdout, run.stderr).contains("refused"), "{deadline} s: {run:#?}");
    }
}

/// A plan with room bears more than nothing of each kind. Half of what is said of one, declared, is promised.
#[test]
fn what_a_plan_bears_is_said_and_can_be_declared() {
    let workshop = Workshop::new();
    let file = |declared: &str| {
        let sets = disc("goal", "disc", [15.0, 5.0], 2.0, "deadline = 8.0")
            + &disc("rock", "obstacle", [9.0, 2.0], 1.5, "");
        format!(
            "kind = \"filter\"\nplant.model = \"unicycle\"\nbounds = {{ a = [-4.0, 4.0], omega = [-1.5, 1.5] }}\nx0 = {{ v = 1.5 }}\n{declared}\n\
             experiment = {{ stop_time = 12.0, step_size = 0.02 }}\n{sets}"
        )
    };
    workshop.write("car.toml", file(""));
    let text = workshop.punctual(["check", "car.toml"]).success();
    assert!(text.contains("it bears at least, each alone and declared: rates x_p "), "{text}");
    assert!(text.contains(" steps"), "{text}");
    let report: Value =
        serde_json::from_str(&workshop.punctual(["check", "car.toml", "--json"]).success()).expect("JSON");
    let sizes = |kind: &str| -> Vec<f64> {
        let of = report["robustness"][kind].as_array().expect("a list");
        of.iter().map(|entry| entry[1].as_f64().expect("a number")).collect()
    };
    for kind in ["rates", "measurement_errors", "gains", "lags"] {
        assert!(sizes(kind).iter().all(|size| *size > 0.0), "{kind}: {report:#}");
    }
    // In whole steps, and more than one.
    let delay = report["robustness"]["delay"].as_f64().expect("a number");
    assert!(delay >= 2.0 * 0.02 && (delay / 0.02).fract() < 1e-9, "{report:#}");
    let [rate, gain, lag] = [sizes("rates")[3], sizes("gains")[0], sizes("lags")[1]].map(|size| 0.5 * size);
    for declared in [
        format!("uncertainty.rates.v = {rate}"),
        format!("uncertainty.inputs.a.gain = [{}, {}]", 1.0 - gain, 1.0 + gain),
        format!("uncertainty.inputs.omega.lag = [0.0, {lag}]"),
    ] {
        workshop.write("declared.toml", file(&declared));
        let text = workshop.punctual(["check", "declared.toml"]).success();
        assert!(text.contains("backup plan: found") && !text.contains("it bears"), "{declared}: {text}");
    }
    // All of the delay, since it is found by doubling.
    workshop.write("late.toml", file(&format!("actuation_delay = {delay}")));
    let text = workshop.punctual(["check", "late.toml"]).success();
    assert!(text.contains("backup plan: found") && text.contains("covers: delay"), "{text}");
}

/// A refusal of an uncertain plant names what it would be kept without.
#[test]
fn a_refusal_says_with_how_much_less_declared_it_would_be_kept() {
    let workshop = Workshop::new();
    let windy = fs::read_to_string(examples().join("windy.toml")).expect("the example");
    workshop.write("late.toml", windy.replace("[uncertainty]\n", "[uncertainty]\njitter = 0.05\n"));
    let done = workshop.punctual(["check", "late.toml"]);
    assert_eq!(done.code, 1, "{done:#?}");
    assert!(done.stdout.contains("it would be kept without jitter"), "{done:#?}");
}
