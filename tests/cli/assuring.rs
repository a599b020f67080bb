//! `assurance = "on"` from a file: what it needs, what `check` and `run` tell of it, and its columns in a campaign.

use punctual::campaign::Cell;
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

/// A u_ref that drives at the obstacle and past the goal: with plans the promise is kept, and every tool says so.
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
    assert_eq!((&report["witness"]["found"], &report["closed_loop"]["kept"]), (&true.into(), &true.into()));
    let text = workshop.punctual(&check[..4]).success();
    assert!(text.contains("; guaranteed, whatever u_ref is\n"), "{text}");
    let run =
        workshop.punctual(["run", "system.toml", "--out", "out", "--require", "kept", "--json"]).success();
    let run: Value = serde_json::from_str(&run).expect("JSON");
    assert!(
        run["promises"].as_array().is_some_and(|all| all.iter().all(|p| p["promise"] == "kept")),
        "{run}"
    );
    // The same without plans is not.
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
        done.stdout.contains("witness: NONE was found: by the nearest way tried, goal is not met at 2.5"),
        "{}",
        done.stdout
    );
    assert!(done.stdout.contains("soonest deadline with a plan: goal 3."), "{}", done.stdout);
    let run = workshop.punctual(["run", "system.toml", "--out", "out"]);
    let told = format!("{}{}", run.stdout, run.stderr);
    assert!(told.contains("the promise is refused") && told.contains("goal is not met at 2.5"), "{told}");
}

/// What no plan accounts for is an error that names it.
#[test]
fn what_no_plan_accounts_for_is_an_error() {
    let workshop = Workshop::new();
    for (more, wanted) in [
        ("actuation_delay = 0.01", "actuation_delay: is not 0, which no plan accounts for yet"),
        (
            "sampling = \"measured\"\nmeasurement_errors = { v = 0.1 }",
            "measurement_errors: are not 0, which no plan accounts for yet",
        ),
    ] {
        workshop.write("filter.toml", filter("on", 8.0, more));
        let message = format!("filter.toml: assurance: is \"on\", must be \"off\": {wanted}");
        workshop.punctual(["check", "filter.toml"]).fails(2, &message);
    }
    let followed = filter("on", 8.0, "").replace("name = \"tree\"", "name = \"tree\"\ncentre_input = true");
    workshop.write("filter.toml", followed);
    workshop.punctual(["check", "filter.toml"]).fails_like(
        2,
        "filter.toml: assurance: is \"on\", must be \"off\": a barrier follows ",
        &["which others move and no plan foresees"],
    );
}

/// Left to itself, a filter follows plans where every input has bounds and plans account for everything.
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
    let delayed = left("actuation_delay = 0.01");
    assert_eq!(
        line(&delayed),
        "plans: none, since actuation_delay: is not 0, which no plan accounts for yet"
    );
    let moving = left("").replace("name = \"tree\"", "name = \"tree\"\ncentre_input = true");
    assert!(
        line(&moving).starts_with("plans: none, since a barrier follows tree.centre[1]"),
        "{}",
        line(&moving)
    );
}

/// A campaign tells how the promise stood, and each of its rows is `punctual run`'s.
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
        assert_eq!(count("withdrawn") + count("irregular"), 0, "{row:?}");
        assert!(!possible || matches!(cell("success"), Cell::Flag(true)), "{row:?}");
        let again = workshop.punctual(["replay", "c.parquet", "--run", &number.to_string()]).success();
        assert!(again.contains("the row is as recorded, bit for bit"), "{again}");
    }
}

/// Pictures of the plan, and of the starts that can be promised: those near the goal, not those far from it.
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
        // From 50 m away no acceleration of 4 m/s2 is there and stops in 4 s; the nearest start is 12 m from the goal.
        let wanted = if x < 0.0 { "no plan keeps goal" } else { "can be promised" };
        assert_eq!(row[2], wanted, "{row:?}");
    }
    for (ranges, message) in [
        ("x_p=0..1", "is \"x_p=0..1\", must be two states, like \"x_p=-5..25,y_p=-5..15\""),
        ("x_p=0..1,z=0..1", "\"z\" is no state, must be one of x_p, y_p, theta, v"),
        ("x_p=1..0,y_p=0..1", "has \"x_p=1..0\", must go from less to more"),
        ("x_p=0..nan,y_p=0..1", "has \"x_p=0..nan\", must be like \"x_p=-5..25\""),
    ] {
        workshop.punctual(["check", "filter.toml", "--map", ranges]).fails(2, &format!("--map: {message}"));
    }
}
