//! Verdicts of `run` and `check` on a promise, compared with h itself: late between two samples, left, kept
//! although some steps were not met, nothing promised, a start that only looks good.

use serde_json::Value;

use crate::table::Table;
use crate::workshop::Workshop;

/// A filter and a plant, coupled.
struct Case<'a> {
    /// Keys of the filter, before its tables.
    filter: &'a str,
    plant: &'a str,
    x0: &'a str,
    barriers: &'a str,
    /// Step and stop time in s.
    experiment: [f64; 2],
}

impl Case<'_> {
    /// A folder with its files.
    fn workshop(&self) -> Workshop {
        let workshop = Workshop::with_library();
        let Self { filter, plant, x0, barriers, experiment: [step, stop] } = self;
        let experiment = format!("[experiment]\nstop_time = {stop:?}\nstep_size = {step:?}\n");
        workshop
            .write("filter.toml", format!("kind = \"filter\"\n{filter}\n{plant}\n{barriers}\n{experiment}"));
        workshop.write("plant.toml", format!("kind = \"plant\"\n{plant}\n{x0}\n{experiment}"));
        let system = format!(
            "experiment = {{ stop_time = {stop:?}, step = {step:?} }}\n\
             [[component]]\nname = \"filter\"\nfmu = \"filter.fmu\"\n\
             [[component]]\nname = \"plant\"\nfmu = \"plant.fmu\"\n\
             [[connect_by_name]]\ncomponents = [\"filter\", \"plant\"]\n"
        );
        workshop.write("system.toml", system);
        workshop
    }

    /// A folder with the FMUs too.
    fn built(&self) -> Workshop {
        let workshop = self.workshop();
        for name in ["filter", "plant"] {
            let (toml, fmu) = (format!("{name}.toml"), format!("{name}.fmu"));
            workshop.punctual(["build", &toml, "-o", &fmu]).success();
        }
        workshop
    }
}

/// Exit code and report of `run --json` with a requirement.
fn run(workshop: &Workshop, require: &str) -> (i32, Value) {
    let words = ["run", "system.toml", "--out", "out", "--json", "--require", require];
    let done = workshop.punctual(words);
    (done.code, serde_json::from_str(&done.stdout).expect("JSON"))
}

/// Exit code and report of `check --json` from the start of the plant.
fn check(workshop: &Workshop, more: &[&str]) -> (i32, Value) {
    let words = ["check", "filter.toml", "--plant", "plant.toml", "--json"];
    let done = workshop.punctual(words.iter().chain(more));
    (done.code, serde_json::from_str(&done.stdout).unwrap_or_else(|e| panic!("{e}: {done:#?}")))
}

const INTEGRATOR: &str = "[plant]\nstates = [{ name = \"p\", unit = \"m\" }]\n\
                          inputs = [{ name = \"v\", unit = \"m/s\" }]\nderivatives = { p = \"v\" }";
const CART: &str = "[plant]\nstates = [{ name = \"p\", unit = \"m\" }, { name = \"v\", unit = \"m/s\" }]\n\
                    inputs = [{ name = \"a\", unit = \"m/s2\" }]\nderivatives = { p = \"v\", v = \"a\" }";

/// With held inputs an integrator moves along straight lines, so that its rows determine h at the deadline.
#[test]
fn a_deadline_between_two_samples_is_judged_by_h_there() {
    for (distance, deadline, step) in
        [(60.0, 10.0, 0.3), (60.0, 10.0, 0.03), (60.0, 1.0, 0.3), (7.0, 2.0, 0.7)]
    {
        for sampling in ["measured", "pointwise"] {
            let sampling = format!("sampling = \"{sampling}\"");
            let barriers = format!(
                "[[barrier]]\nname = \"goal\"\nexpression = \"p - {distance:?}\"\nunit = \"m\"\ndeadline = {deadline:?}"
            );
            let experiment = [step, 2.0 * deadline];
            let case = Case { filter: &sampling, plant: INTEGRATOR, x0: "", barriers: &barriers, experiment };
            let filter = case.built();
            let (code, report) = run(&filter, "on_time_and_inside");
            let table = Table::parse(&filter.text("out/system.csv"));
            let (time, h) = (table.column("time"), table.column("filter.goal.h"));
            let k = time.iter().position(|t| *t >= deadline - 1e-9).expect("a sample after the deadline");
            let part = (deadline - time[k - 1]) / (time[k] - time[k - 1]);
            let there = h[k - 1] + part * (h[k] - h[k - 1]);
            let least = h[k..].iter().copied().fold(there, f64::min);
            let promise = &report["promises"][0];
            let wanted = if least >= -1e-9 * distance { "kept" } else { "broken" };
            assert_eq!(
                promise["promise"], wanted,
                "{distance} m, {deadline} s, {step} s: {least}, {promise}"
            );
            assert_eq!(code, i32::from(wanted == "broken"), "{promise}");
        }
    }
}

/// The example's car follows at 80 m without a headway: no deadline determines when it brakes.
#[test]
fn an_obstacle_is_kept_without_a_deadline() {
    let plant = "[plant]\nstates = [{ name = \"gap\", unit = \"m\" }, { name = \"v\", unit = \"m/s\" }]\n\
                 inputs = [{ name = \"a\", unit = \"m/s2\", min = -4.0, max = 3.0 }]\n\
                 derivatives = { gap = \"20 - v\", v = \"a\" }";
    for (gap, v) in [(80.0, 35.0), (40.0, 35.0), (150.0, 45.0)] {
        let barriers = "[[barrier]]\nname = \"contact\"\nexpression = \"gap - 2\"\nunit = \"m\"";
        let x0 = format!("[x0]\ngap = {gap:?}\nv = {v:?}");
        let case = Case { filter: "", plant, x0: &x0, barriers, experiment: [0.01, 30.0] };
        let workshop = case.built();
        let (code, report) = run(&workshop, "on_time_and_inside");
        let promise = &report["promises"][0];
        assert_eq!(
            (code, &promise["promise"], &promise["deadline"]),
            (0, &"kept".into(), &Value::Null),
            "{promise}"
        );
        let (code, report) = check(&workshop, &[]);
        assert_eq!(
            (code, &report["barriers"][0]["deadline"], &report["barriers"][0]["start"]["guaranteed"]),
            (0, &Value::Null, &true.into()),
            "{report}"
        );
        let text = workshop.punctual(["check", "filter.toml"]).success();
        assert!(text.contains("deadline         none: kept at all times\n"), "{text}");
        let inspected = workshop.punctual(["inspect", "filter.fmu"]).success();
        assert!(!inspected.contains("contact.deadline "), "{inspected}");
    }
}

#[test]
fn outside_without_a_deadline_nothing_is_promised() {
    for (x0, place) in [("p = -1.0", "p - 0"), ("p = 3.0\nv = 1.0", "2 - p")] {
        let barriers = format!("[[barrier]]\nname = \"side\"\nexpression = \"{place}\"\nunit = \"m\"");
        let x0 = format!("[x0]\n{x0}");
        let case = Case { filter: "", plant: CART, x0: &x0, barriers: &barriers, experiment: [0.01, 3.0] };
        let workshop = case.built();
        let words =
            "side: outside at the start and without a deadline: nothing is promised; give it a deadline";
        let done = workshop.punctual(["check", "filter.toml", "--plant", "plant.toml"]);
        assert!(done.code == 1 && done.stdout.contains(&format!("warning: {words}")), "{done:#?}");
        let printed = words.replace("side:", "filter.side:");
        for (require, code) in [("kept", 1), ("on_time_and_inside", 1)] {
            let done = workshop.punctual(["run", "system.toml", "--require", require]);
            assert!(done.code == code && done.stderr.contains(&printed), "{done:#?}");
            assert!(done.stdout.contains("nothing promised"), "{done:#?}");
        }
    }
}

/// Brakes that are too weak: inside at the start, left, and so not kept. The constraint is reported
/// separately.
#[test]
fn what_began_inside_and_is_left_is_not_kept() {
    for (v, deadline) in [(5.0, ""), (3.0, ""), (5.0, "\ndeadline = 1.0")] {
        let bounds = "bounds = { a = [-0.5, 0.5] }";
        let barriers =
            format!("[[barrier]]\nname = \"wall\"\nexpression = \"2 - p\"\nunit = \"m\"{deadline}");
        let x0 = format!("[x0]\nv = {v:?}");
        let case =
            Case { filter: bounds, plant: CART, x0: &x0, barriers: &barriers, experiment: [0.01, 10.0] };
        let workshop = case.built();
        let (code, report) = run(&workshop, "on_time_and_inside");
        let promise = &report["promises"][0];
        assert_eq!((code, &promise["promise"]), (1, &"broken".into()), "{promise}");
        assert_eq!((&promise["began_inside"], &promise["constraint_met"]), (&true.into(), &false.into()));
        // 2 m at v − t/2.
        let left = 2.0 * (v - (v * v - 2.0_f64).sqrt());
        assert!(promise["left"].as_f64().is_some_and(|t| (t - left).abs() < 1e-3), "{left}: {promise}");
        let (code, report) = check(&workshop, &[]);
        assert_eq!(
            (code, &report["closed_loop"]["barriers"][0]["promise"]),
            (1, &"broken".into()),
            "{report}"
        );
        assert_eq!(report["barriers"][0]["start"]["promised"], false);
    }
}

/// On time and inside although some steps were not met: the promise is kept, the constraint is not.
#[test]
fn promise_and_constraint_are_told_apart() {
    // 20 m from rest in 5 s needs at least 0.8 d·4/T², and the profile has a peak of 6d/T².
    let filter = "assurance = \"off\"\nbounds = { a = [-4.0, 4.0] }";
    let barriers = "[[barrier]]\nname = \"goal\"\nexpression = \"p - 20\"\n\
                    unit = \"m\"\ndeadline = 5.0";
    let case = Case { filter, plant: CART, x0: "", barriers, experiment: [0.01, 10.0] };
    let workshop = case.built();
    let (code, report) = run(&workshop, "on_time_and_inside");
    let promise = &report["promises"][0];
    assert_eq!(
        (code, &promise["promise"], &promise["constraint_met"]),
        (0, &"kept".into(), &false.into()),
        "{promise}"
    );
    assert!(promise["unmet"].as_u64().is_some_and(|n| n > 0), "{promise}");
    assert_eq!(run(&workshop, "kept").0, 1);
    let text = workshop.punctual(["run", "system.toml"]).success();
    let head = text.lines().find(|line| line.starts_with("barrier")).expect("a heading");
    for word in ["promise", "constraint", "arrival s", "late by s", "left s"] {
        assert!(head.contains(word), "{head}");
    }
    let row = text.lines().find(|line| line.starts_with("filter.goal ")).expect("a row");
    assert!(row.contains(" kept ") && row.contains(" not met "), "{row}");
}

#[test]
fn a_margin_that_h_never_has_is_refused() {
    for (barrier, margin, unit, largest) in [
        ("centre = [20.0, 0.0]\nradius = 2.0", 5.0, "m", "0.828427"),
        ("centre = [20.0, 0.0]\nradius = 1.0\nsmoothing = 0.1", 0.91, "m", "0.904988"),
        ("shape = \"quadratic_disc\"\ncentre = [3.0, 4.0]\nradius = 2.0", 4.0, "m2", "4.000000"),
        ("shape = \"speed_limit\"\nbound = 3.0", 3.5, "m/s", "1.854102"),
    ] {
        let workshop = Workshop::new();
        let text = format!(
            "kind = \"filter\"\n[plant]\nmodel = \"point_mass\"\n[[barrier]]\nname = \"goal\"\ndeadline = 5.0\n{barrier}\n"
        );
        workshop.write("filter.toml", format!("{text}margin = {margin:?}\n"));
        workshop.punctual(["check", "filter.toml", "--x0", "x_p=1"]).fails(
            2,
            &format!(
                "filter.toml: barrier[0].margin: is {margin} {unit}, must be < {largest} {unit}, the largest that h \
                 ever is: h >= margin is aimed at"
            ),
        );
        let inside = 0.5 * largest.parse::<f64>().expect("a number");
        workshop.write("filter.toml", format!("{text}margin = {inside:?}\n"));
        workshop.punctual(["check", "filter.toml"]).success();
    }
}

/// The verdict of `check` on a start is that of `run` with the same u_ref: exit code 0 only if the promise is
/// kept.
#[test]
fn check_says_what_a_run_does() {
    let goal = |centre: [f64; 2], more: &str| {
        format!("[[barrier]]\nname = \"goal\"\ncentre = {centre:?}\nradius = 2.0\ndeadline = 5.0\n{more}")
    };
    for (bound, centre, v, more) in
        [(4.0, [-18.85, 4.33], [3.99, 1.36], "profile = \"low_peak\""), (20.0, [20.0, 0.0], [0.0, 3.0], "")]
    {
        let filter = format!("bounds = {{ u_x = [-{bound:?}, {bound:?}], u_y = [-{bound:?}, {bound:?}] }}");
        let plant = "[plant]\nmodel = \"point_mass\"";
        let (x0, barriers) = (format!("[x0]\nv_x = {:?}\nv_y = {:?}", v[0], v[1]), goal(centre, more));
        let case = Case { filter: &filter, plant, x0: &x0, barriers: &barriers, experiment: [0.05, 10.0] };
        let workshop = case.built();
        let (_, ran) = run(&workshop, "kept");
        let (code, checked) = check(&workshop, &[]);
        let (seen, promise) = (&checked["closed_loop"]["barriers"][0], &ran["promises"][0]);
        assert_eq!(seen["promise"], promise["promise"], "{checked} against {ran}");
        assert!(seen["promise"] != "kept" || seen["unmet"] == promise["unmet"], "{checked} against {ran}");
        let start = &checked["barriers"][0]["start"];
        let (said, kept) = (start["promised"] == true, seen["promise"] == "kept");
        assert!(!said || kept, "{checked}");
        assert!(code == 1 || said && kept, "{code}: {checked}");
        let can = start["reach"]["deadline"] == "can_be_met";
        assert!(!can || kept, "{checked}");
        let text = workshop.punctual(["check", "filter.toml", "--plant", "plant.toml"]).stdout;
        assert!(text.contains("closed loop with u_ref = 0 (--u-ref none)"), "{text}");
        assert!(kept || !text.contains("and the closed loop keeps it\n"), "{text}");
        let notes = ran["notes"].as_array().expect("a list");
        let printed =
            |note: &Value| note.as_str().is_some_and(|n| n.contains("nothing feeds u_ref.u_x, u_ref.u_y"));
        assert!(notes.iter().any(printed), "{ran}");
        let (_, damped) = check(&workshop, &["--u-ref", "damping"]);
        assert_eq!(damped["closed_loop"]["u_ref"], "damping as u_ref (--u-ref damping)");
    }
}

/// A pole on a cart: the cart must be at a place, the pole upright, and with one force the rows cannot do
/// both for long.
#[test]
fn what_runs_away_is_not_promised() {
    let plant = "[plant]\nstates = [{ name = \"p\", unit = \"m\" }, { name = \"v\", unit = \"m/s\" }, \
                 { name = \"theta\", unit = \"rad\", min = -1.0, max = 1.0 }, { name = \"w\", unit = \"rad/s\" }]\n\
                 inputs = [{ name = \"force\", unit = \"N\", min = -40.0, max = 40.0 }]\n\
                 [plant.derivatives]\np = \"v\"\ntheta = \"w\"\n\
                 v = \"(force + 0.1 * sin(theta) * (0.5 * w^2 - 9.81 * cos(theta))) / (1 + 0.1 * sin(theta)^2)\"\n\
                 w = \"(-force * cos(theta) - 0.05 * w^2 * sin(theta) * cos(theta) + 10.791 * sin(theta)) / (0.5 * (1 + 0.1 * sin(theta)^2))\"";
    let barriers = "[[barrier]]\nname = \"place\"\nexpression = \"0.04 - (p - 2)^2\"\nunit = \"m2\"\ndeadline = 3.0\n\
                    [[barrier]]\nname = \"left\"\nexpression = \"0.5 + theta\"\nunit = \"rad\"\n\
                    [[barrier]]\nname = \"right\"\nexpression = \"0.5 - theta\"\nunit = \"rad\"";
    let case = Case { filter: "assurance = \"off\"", plant, x0: "", barriers, experiment: [0.01, 10.0] };
    let workshop = case.built();
    let (code, checked) = check(&workshop, &[]);
    let (_, ran) = run(&workshop, "kept");
    let kept = |report: &Value, list: &str| -> Vec<String> {
        let all = report[list].as_array().expect("a list").iter();
        all.map(|b| b["promise"].as_str().expect("a word").to_owned()).collect()
    };
    assert_eq!(kept(&checked["closed_loop"], "barriers"), kept(&ran, "promises"), "{checked} against {ran}");
    assert_eq!(code, 1, "{checked}");
    let text = workshop.punctual(["check", "filter.toml", "--plant", "plant.toml"]).stdout;
    assert!(text.contains("NOT every promise is kept"), "{text}");
    // By plans.
    let workshop = Case { filter: "", ..case }.built();
    let ((code, checked), (ended, ran)) = (check(&workshop, &[]), run(&workshop, "kept"));
    assert_eq!((code, ended), (0, 0), "{checked} and {ran}");
}

/// Without bounds `check` reports the input needed. Constants can be a u_ref too; other texts are refused.
#[test]
fn the_wanted_input_of_a_check() {
    let barriers = "[[barrier]]\nname = \"goal\"\nexpression = \"p - 20\"\nunit = \"m\"\ndeadline = 5.0";
    let case = Case { filter: "", plant: CART, x0: "", barriers, experiment: [0.01, 10.0] };
    let workshop = case.workshop();
    let done = workshop.punctual(["check", "filter.toml", "--plant", "plant.toml", "--u-ref", "a=0.25"]);
    assert_eq!(done.code, 0, "{done:#?}");
    assert!(done.stdout.contains("closed loop with u_ref: a = 0.25"), "{done:#?}");
    assert!(done.stdout.contains("warning: the closed loop takes inputs without bounds: a "), "{done:#?}");
    for (words, message) in [
        ("damping", "is \"damping\", which is for the vehicles by name; give none, or values as \"a=0\""),
        ("w=1", "\"w\" is not an input, must be one of a"),
        ("a", "is \"a\", must be none, damping, or like \"a=0.5\""),
        ("a=nan", "is \"a=nan\", must be a finite number"),
    ] {
        let done = workshop.punctual(["check", "filter.toml", "--x0", "p=1", "--u-ref", words]);
        done.fails(2, &format!("--u-ref: {message}"));
    }
}
