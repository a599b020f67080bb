//! `assurance = "on"` in a file: its requirements, how `check` and `run` report it, and its columns in a
//! campaign.

use punctual_cosim::campaign::Cell;
use serde_json::Value;

use crate::campaigns::rows;
use crate::workshop::Workshop;

const PLANT: &str = "kind = \"plant\"\nplant.model = \"unicycle\"\nx0 = { theta = 1.0 }\n";
const SYSTEM: &str = r#"
[experiment]
stop_time = 10.0
step = 0.05
[[component]]
name = "filter"
fmu = "filter.fmu"
start = { "u_ref.a" = 4.0, "u_ref.omega" = -1.0 }
[[component]]
name = "plant"
fmu = "plant.fmu"
[[connect_by_name]]
components = ["filter", "plant"]
"#;

fn filter(assurance: &str, deadline: f64, more: &str) -> String {
    format!(
        "kind = \"filter\"\nassurance = \"{assurance}\"\n{more}\nplant.model = \"unicycle\"\n\
         bounds = {{ a = [-4.0, 4.0], omega = [-2.0, 2.0] }}\nexperiment = {{ step_size = 0.05, stop_time = 10.0 }}\n\
         [[barrier]]\nname = \"goal\"\ncentre = [20.0, 10.0]\nradius = 2.0\ndeadline = {deadline:?}\n\
         [[barrier]]\nname = \"tree\"\nshape = \"obstacle\"\ncentre = [10.0, 5.0]\nradius = 2.0\n"
    )
}

fn workshop(assurance: &str, deadline: f64) -> Workshop {
    let workshop = Workshop::with_library();
    workshop.write("filter.toml", filter(assurance, deadline, ""));
    workshop.write("plant.toml", PLANT);
    workshop.write("system.toml", SYSTEM);
    for name in ["filter", "plant"] {
        workshop.punctual(["build", &format!("{name}.toml"), "-o", &format!("{name}.fmu")]).success();
    }
    workshop
}

/// u_ref drives at the obstacle and past the goal. With plans the promise is kept, and every tool reports so.
#[test]
fn a_promise_is_kept_whatever_is_wanted() {
    let workshop = workshop("on", 8.0);
    let check = ["check", "filter.toml", "--plant", "plant.toml", "--json"];
    let report: Value = serde_json::from_str(&workshop.punctual(check).success()).expect("JSON");
    for barrier in report["barriers"].as_array().expect("a list") {
        assert_eq!(
            (&barrier["start"]["guaranteed"], &barrier["start"]["promised"]),
            (&true.into(), &true.into())
        );
    }
    assert_eq!(
        (&report["backup_plan"]["found"], &report["closed_loop"]["kept"]),
        (&true.into(), &true.into())
    );
    let text = workshop.punctual(&check[..4]).success();
    assert!(text.contains("; guaranteed, whatever u_ref is\n"), "{text}");
    let run =
        workshop.punctual(["run", "system.toml", "--out", "out", "--require", "kept", "--json"]).success();
    let run: Value = serde_json::from_str(&run).expect("JSON");
    assert!(
        run["promises"].as_array().is_some_and(|all| all.iter().all(|p| p["promise"] == "kept")),
        "{run}"
    );
    // Without plans the promise is not kept.
    let without = self::workshop("off", 8.0);
    let run = without.punctual(["run", "system.toml", "--out", "out", "--require", "kept"]);
    assert_eq!(run.code, 1, "{run:#?}");
}

#[test]
fn what_cannot_be_promised_is_refused() {
    let workshop = workshop("on", 2.5);
    let done = workshop.punctual(["check", "filter.toml", "--plant", "plant.toml"]);
    assert_eq!(done.code, 1, "{done:#?}");
    assert!(
        done.stdout.contains("backup plan: NONE was found: in the closest attempt, goal is not met at 2.5"),
        "{}",
        done.stdout
    );
    assert!(done.stdout.contains("earliest deadline with a plan: goal 3."), "{}", done.stdout);
    let run = workshop.punctual(["run", "system.toml", "--out", "out"]);
    let printed = format!("{}{}", run.stdout, run.stderr);
    assert!(
        printed.contains("the guarantee is refused") && printed.contains("goal is not met at 2.5"),
        "{printed}"
    );
}

/// Anything that plans do not support is an error that names it.
#[test]
fn what_no_plan_accounts_for_is_an_error() {
    let workshop = Workshop::new();
    let told = |text: String, wanted: &str| {
        workshop.write("filter.toml", text);
        let message = format!("filter.toml: assurance: is \"on\", must be \"off\": {wanted}");
        workshop.punctual(["check", "filter.toml"]).fails(2, &message);
    };
    told(
        declared("on", "", "disturbance = 0.2"),
        "tree.disturbance is 0.2, must be 0 for a plan; plans account for `rates` of [uncertainty] in its place",
    );
    let followed = filter("on", 8.0, "").replace("name = \"tree\"", "name = \"tree\"\ncentre_input = true");
    workshop.write("filter.toml", followed);
    workshop.punctual(["check", "filter.toml"]).fails_like(
        2,
        "filter.toml: assurance: is \"on\", must be \"off\": tree follows a centre that is moved from outside",
        &["no plan can predict it without its `acceleration`"],
    );
}

/// By default a filter follows plans if every input has bounds and plans support everything in the file.
#[test]
fn plans_are_followed_where_that_is_possible() {
    let workshop = Workshop::new();
    let line = |text: &str| {
        workshop.write("filter.toml", text);
        let text = workshop.punctual(["check", "filter.toml"]).success();
        text.lines().nth(1).unwrap_or_default().to_owned()
    };
    let left = |more: &str| filter("auto", 8.0, more).replace("assurance = \"auto\"\n", "");
    let followed = "plans: followed, so that what is promised is kept whatever u_ref is";
    assert_eq!(line(&left("")), followed);
    assert_eq!(line(&filter("auto", 8.0, "")), followed);
    assert_eq!(line(&filter("off", 8.0, "")), "plans: none, since assurance is \"off\"");
    let unbounded = left("").replace(", omega = [-2.0, 2.0]", "");
    assert_eq!(line(&unbounded), "plans: none, since omega has no bounds");
    let later = left("").replace("name = \"tree\"", "name = \"tree\"\nbegin = 1.0\ndeadline = 9.0");
    assert_eq!(line(&later), followed);
    for delay in ["0.01", "0.1", "0.13"] {
        assert_eq!(line(&left(&format!("actuation_delay = {delay}"))), followed);
    }
    let late = left("actuation_delay = 0.1\nuncertainty.jitter = 0.1");
    workshop.write("filter.toml", late);
    let message = "filter.toml: uncertainty: only plans account for it, and none are followed: actuation_delay is 0.1, must be <= \
                   period = 0.05 for a plan, where samples come late. Change that, or leave `[uncertainty]` out";
    workshop.punctual(["check", "filter.toml"]).fails(2, message);
    let moving = left("").replace("name = \"tree\"", "name = \"tree\"\ncentre_input = true");
    assert!(
        line(&moving).starts_with(
            "plans: none, since tree follows a centre that is moved from outside, and no plan can"
        ),
        "{}",
        line(&moving)
    );
}

/// What a file declares of the plant is covered by its plans, and `check` says so; without plans it is refused.
#[test]
fn an_uncertain_plant_is_promised_with_plans_alone() {
    let workshop = Workshop::new();
    let uncertain = "uncertainty = { rates = { theta = 0.02, v = 0.1 }, inputs = { a = { gain = [0.95, 1.0] } } }\n\
                     measurement_errors = { x_p = 0.02, v = 0.01 }";
    let third = |text: &str| text.lines().nth(2).unwrap_or_default().to_owned();
    workshop.write("filter.toml", filter("auto", 8.0, uncertain));
    let done = workshop.punctual(["check", "filter.toml", "--x0", "v=1.0"]);
    assert_eq!((done.code, &done.stderr[..]), (0, ""), "{done:#?}");
    let covers = "covers: rates theta 0.02 rad/s, v 0.1 m/s2; measurement errors x_p 0.02 m, v 0.01 m/s; gain of a 0.95 to 1";
    assert_eq!(third(&done.stdout), covers);
    assert!(done.stdout.contains("; guaranteed until "), "{}", done.stdout);
    assert!(done.stdout.contains(" s, with every plant that it covers; a "), "{}", done.stdout);
    workshop.write("filter.toml", filter("off", 8.0, uncertain));
    workshop.punctual(["check", "filter.toml"]).fails(
        2,
        "filter.toml: uncertainty: only plans account for it, and none are followed: assurance is \"off\". Change that, or leave \
         `[uncertainty]` out",
    );
    // Errors of the measurement are accounted for by the rows as well.
    let errors = "measurement_errors = { x_p = 0.02, v = 0.01 }";
    workshop.write("filter.toml", filter("off", 8.0, errors));
    let text = workshop.punctual(["check", "filter.toml"]).success();
    assert!(!text.contains("covers: ") && !text.contains("assumes: "), "{text}");
    // Nothing declared is an assumption.
    workshop.write("filter.toml", filter("auto", 8.0, ""));
    let text = workshop.punctual(["check", "filter.toml"]).success();
    assert!(third(&text).starts_with("assumes: the plant is the model, measured exactly, "), "{text}");
}

/// More than the bounds can counter is refused, with the name of what is missing.
#[test]
fn more_uncertainty_than_the_bounds_can_counter_is_refused() {
    let workshop = Workshop::new();
    workshop.write("filter.toml", filter("auto", 8.0, "uncertainty.rates = { v = 5.0 }"));
    let done = workshop.punctual(["check", "filter.toml", "--x0", "v=1.0"]);
    assert_eq!(done.code, 1, "{done:#?}");
    assert!(done.stdout.contains("backup plan: NONE was found: "), "{}", done.stdout);
}

/// A campaign counts how the guarantee held, and each of its rows equals `punctual run`'s.
#[test]
fn a_campaign_counts_where_promises_stood() {
    let workshop = Workshop::new();
    workshop.write("filter.toml", filter("on", 8.0, ""));
    workshop.write("plant.toml", PLANT);
    workshop.write("system.toml", SYSTEM.replace(".fmu", ".toml"));
    let campaign = "system = \"system.toml\"\n[campaign]\nruns = 4\n\
                    [vary.\"filter.goal.deadline\"]\ndistribution = \"choice\"\nvalues = [2.5, 8.0]\n";
    workshop.write("c.toml", campaign);
    workshop.punctual(["campaign", "c.toml"]).success();
    let (names, rows) = rows(&workshop.path("c.parquet"));
    for (number, row) in rows.iter().enumerate() {
        let cell = |name: &str| {
            &row[names.iter().position(|n| n == name).unwrap_or_else(|| panic!("{name}: {names:?}"))]
        };
        let count = |name: &str| match cell(&format!("filter.assurance.{name}")) {
            Cell::Count(count) => *count,
            other => panic!("{name}: {other:?}"),
        };
        let possible =
            matches!(cell("filter.goal.deadline"), Cell::Number(Some(deadline)) if *deadline == 8.0);
        assert_eq!((count("assured") > 0, count("refused") > 0), (possible, !possible), "{row:?}");
        assert_eq!(count("lost") + count("irregular"), 0, "{row:?}");
        assert!(!possible || matches!(cell("success"), Cell::Flag(true)), "{row:?}");
        let again = workshop.punctual(["replay", "c.parquet", "--run", &number.to_string()]).success();
        assert!(again.contains("the row is as recorded, bit for bit"), "{again}");
    }
}

/// Pictures of the plan, and of the starts that can be promised: those near the goal, but not those far from
/// it.
#[test]
fn starts_that_can_be_promised_are_drawn() {
    let workshop = Workshop::new();
    workshop.write("filter.toml", filter("off", 4.0, ""));
    let map =
        ["check", "filter.toml", "--x0", "theta=0.46", "--map", "x_p=-40..40,y_p=0..20", "--cells", "4"];
    let done = workshop.punctual(map);
    assert!(
        done.stdout.contains(" of 16 starts can be promised\nwritten: out/filter-map.svg\n"),
        "{done:#?}"
    );
    for file in ["out/filter-map.svg", "out/filter-plan.svg", "out/filter-path.svg"] {
        assert!(workshop.text(file).starts_with("<svg"), "{file}");
    }
    let table = workshop.text("out/filter-map.csv");
    let rows: Vec<Vec<&str>> = table.lines().map(|line| line.split(',').collect()).collect();
    assert_eq!((rows.len(), &rows[0][..]), (17, &["x_p", "y_p", "found"][..]));
    for row in &rows[1..] {
        let x: f64 = row[0].parse().expect("a number");
        // From 50 m away, no acceleration of 4 m/s2 arrives and stops within 4 s; the nearest start is 12 m
        // from the goal.
        let wanted = if x < 0.0 { "no plan keeps goal" } else { "can be promised" };
        assert_eq!(row[2], wanted, "{row:?}");
    }
    for (ranges, message) in [
        ("x_p=0..1", "is \"x_p=0..1\", must be two states, like \"x_p=-5..25,y_p=-5..15\""),
        ("x_p=0..1,z=0..1", "\"z\" is not a state, must be one of x_p, y_p, theta, v"),
        ("x_p=1..0,y_p=0..1", "has \"x_p=1..0\", must go from less to more"),
        ("x_p=0..nan,y_p=0..1", "has \"x_p=0..nan\", must be like \"x_p=-5..25\""),
    ] {
        workshop.punctual(["check", "filter.toml", "--map", ranges]).fails(2, &format!("--map: {message}"));
    }
}

/// The content of a file, and the keys that the warning must name because plans do not support them.
const DECLARED: [(&str, &str, &[&str]); 5] = [
    ("", "disturbance = 0.2", &["tree.disturbance is 0.2, "]),
    ("", "after = \"goal\"", &["tree begins with the arrival of goal, whose time is open", "`deadline`"]),
    ("", "centre_input = true", &["tree follows a centre that is moved from outside, "]),
    ("", "velocity = [1.0, 0.0]", &["goal moves with time, ", "(`plan_horizon`)"]),
    (
        "measurement_errors = { v = 0.1 }",
        "disturbance = 0.1\nafter = \"goal\"",
        &["tree.disturbance is 0.1, ", "tree begins with the arrival of goal, whose time is open"],
    ),
];

fn declared(assurance: &str, top: &str, barrier: &str) -> String {
    // The barrier to be reached moves forever; the one to avoid is left behind.
    let name = if barrier.starts_with("velocity") { "name = \"goal\"" } else { "name = \"tree\"" };
    filter(assurance, 8.0, top).replace(name, &format!("{name}\n{barrier}"))
}

/// Whatever disables plans although every input has bounds is named once when the file is read. With `on` it
/// is an error, and `off` accepts it.
#[test]
fn what_switches_plans_off_is_said() {
    let workshop = Workshop::with_library();
    workshop.write("plant.toml", PLANT);
    workshop.write("system.toml", SYSTEM.replace("plant.fmu", "plant.toml"));
    for (top, barrier, named) in DECLARED {
        let case = format!("{top} {barrier}");
        workshop.write("filter.toml", declared("auto", top, barrier));
        let build = ["build", "filter.toml", "-o", "filter.fmu"];
        for command in
            [&["check", "filter.toml"][..], &build, &["run", "filter.toml", "--require", "nothing"]]
        {
            let done = workshop.punctual(command);
            assert_eq!(done.code, 0, "{case}: {done:#?}");
            let warnings: Vec<_> = done.stderr.lines().filter(|line| line.starts_with("warning: ")).collect();
            let [warning] = warnings[..] else { panic!("{case}: {done:#?}") };
            let lost = "plans are off, and with them the guarantee of goal, tree: ";
            assert!(
                warning.contains(lost) && warning.contains("`assurance = \"on\"` makes this an error"),
                "{warning}"
            );
            assert!(named.iter().all(|key| warning.contains(key)), "{case}: {warning}");
            assert_eq!(done.stderr.matches("plans are off").count(), 1, "{case}: {}", done.stderr);
        }
        // An FMU logs it, and a run with the FMU reports it.
        let moved = ["centre[1]", "centre[2]", "velocity[1]", "velocity[2]"]
            .map(|of| format!(", \"tree.{of}\" = 9.0"));
        let inputs = if barrier == "centre_input = true" { moved.concat() } else { String::new() };
        let system = SYSTEM.replace("plant.fmu", "plant.toml");
        workshop.write("system.toml", system.replace("-1.0 }", &format!("-1.0{inputs} }}")));
        let done = workshop.punctual(["run", "system.toml", "--json", "--require", "nothing"]);
        assert!(done.stderr.starts_with("warning: filter: plans are off"), "{case}: {done:#?}");
        let report: Value = serde_json::from_str(&done.stdout).expect("JSON");
        let notes = report["notes"].as_array().expect("a list");
        let said =
            notes.iter().filter(|note| note.as_str().is_some_and(|n| n.contains("plans are off"))).count();
        assert_eq!(said, 1, "{case}: {notes:?}");

        workshop.write("filter.toml", declared("on", top, barrier));
        let refused = workshop.punctual(["check", "filter.toml"]);
        assert!(refused.code == 2 && named.iter().all(|key| refused.stderr.contains(key)), "{refused:#?}");
        workshop.write("filter.toml", declared("off", top, barrier));
        let meant = workshop.punctual(["run", "filter.toml", "--require", "nothing"]);
        assert!(meant.code == 0 && !meant.stderr.contains("warning: "), "{meant:#?}");
    }
    // No warning is needed if an input has no bounds, or if nothing prevents plans.
    for (from, to) in [(", omega = [-2.0, 2.0]", ""), ("", "")] {
        workshop.write("filter.toml", filter("auto", 8.0, "").replace(from, to));
        let done = workshop.punctual(["run", "filter.toml", "--require", "nothing"]);
        assert!(done.code == 0 && !done.stderr.contains("warning: "), "{done:#?}");
    }
}

/// A broken promise gives exit code 1 whether a plan guaranteed it or it was refused. One that was refused
/// but kept is a note.
#[test]
fn the_exit_code_tells_of_broken_promises() {
    let code = |workshop: &Workshop, start: &str, require: &str| {
        workshop.write("system.toml", SYSTEM.replace("\"u_ref.a\" = 4.0, \"u_ref.omega\" = -1.0", start));
        let words = ["run", "system.toml", "--require", require];
        workshop.punctual(if require.is_empty() { &words[..2] } else { &words })
    };
    let every = ["", "nothing", "unbroken", "on_time_and_inside", "kept", "guaranteed"];
    // And how the first of them ends.
    let codes = |workshop: &Workshop, start: &str| {
        let done = every.map(|require| code(workshop, start, require));
        let end = done[0].stdout.lines().last().unwrap_or_default().to_owned();
        (done.map(|done| done.code), end)
    };
    let wanted = "\"u_ref.a\" = 4.0, \"u_ref.omega\" = -1.0";
    let kept = workshop("on", 8.0);
    assert_eq!(codes(&kept, wanted), ([0, 0, 0, 0, 0, 0], "Every promise is kept.".to_owned()));
    // Refused, and missed.
    let missed = workshop("on", 2.5);
    assert_eq!(codes(&missed, wanted), ([1, 0, 1, 1, 1, 1], "1 of 2 promises are not kept.".to_owned()));
    // Without plans nothing is guaranteed.
    let (without, _) = codes(&workshop("off", 8.0), wanted);
    assert_eq!((without[1], without[5]), (0, 1), "{without:?}");
    // Refused, since it never comes to rest, but kept anyway.
    let lucky = Workshop::new();
    lucky.write(
        "drift.toml",
        "kind = \"filter\"\nbounds = { u = [-0.5, 0.5] }\nexperiment = { step_size = 0.05, stop_time = 6.0 }\n\
         [plant]\nstates = [{ name = \"p\", unit = \"m\" }]\ninputs = [{ name = \"u\", unit = \"m/s\" }]\n\
         parameters = [{ name = \"c\", unit = \"m/s\", start = 1.0 }, { name = \"d\", unit = \"m\", start = 1.0 }]\n\
         derivatives = { p = \"c + u\" }\n\
         [[barrier]]\nname = \"there\"\nexpression = \"p - d\"\ndeadline = 3.0\n",
    );
    let codes = every.map(|require| {
        let words = ["run", "drift.toml", "--require", require];
        let done = lucky.punctual(if require.is_empty() { &words[..2] } else { &words });
        let note = "note: filter.there: refused at the start, and kept in this run all the same";
        assert!(done.stderr.contains(note), "{done:#?}");
        done.code
    });
    assert_eq!(codes, [0, 0, 0, 0, 0, 1]);
}
