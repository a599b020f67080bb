//! Masters that hand an input on one step after its sample: `build --master jacobi`, and what `run` tells a filter by itself.

use serde_json::Value;

use crate::table::Table;
use crate::workshop::Workshop;

/// A unicycle past a rock into a disc, with a plan behind every input. What is declared leaves little room, so a delay that it does
/// not know is soon seen.
const FILTER: &str = r#"
kind = "filter"
assurance = "on"
plant.model = "unicycle"
bounds = { a = [-4.0, 4.0], omega = [-1.5, 1.5] }
uncertainty.rates = { v = 0.001 }
experiment = { step_size = 0.05, stop_time = 12.0 }
[[barrier]]
name = "goal"
centre = [15.0, 5.0]
radius = 2.0
deadline = 8.0
[[barrier]]
name = "rock"
shape = "obstacle"
centre = [9.0, 2.0]
radius = 1.5
"#;
const PLANT: &str = "kind = \"plant\"\nplant.model = \"unicycle\"\n";

/// The start, whether the filter is told nothing of its delay, and more of `[experiment]`.
fn system([x, y, theta, v]: [f64; 4], told: &str, more: &str) -> String {
    format!(
        "[experiment]\nstop_time = 12.0\nstep = 0.05\norder = \"jacobi\"\n{more}\
         [[component]]\nname = \"filter\"\nfmu = \"filter.toml\"\n\
         start = {{ \"u_ref.a\" = 2.0, \"u_ref.omega\" = 0.3{told} }}\n\
         [[component]]\nname = \"plant\"\nfmu = \"plant.toml\"\n\
         start = {{ \"x0.x_p\" = {x:?}, \"x0.y_p\" = {y:?}, \"x0.theta\" = {theta:?}, \"x0.v\" = {v:?} }}\n\
         [[connect_by_name]]\ncomponents = [\"filter\", \"plant\"]\n"
    )
}

const UNTOLD: &str = ", actuation_delay = 0.0";
const START: [f64; 4] = [0.0, 0.0, 0.1, 1.5];
const NOTE: &str = "note: filter: u acts a step after its sample in Jacobi order; actuation_delay is set to 0.05 s, so the filter \
                    accounts for it\n";

fn workshop() -> Workshop {
    let workshop = Workshop::with_library();
    workshop.write("filter.toml", FILTER);
    workshop.write("plant.toml", PLANT);
    workshop
}

/// Runs the system; returns the report, what was told, and how many samples were not assured.
fn run(workshop: &Workshop, text: &str) -> (Value, String, usize) {
    workshop.write("system.toml", text);
    let done = workshop.punctual(["run", "system.toml", "--out", "out", "--json", "--require", "nothing"]);
    assert_eq!(done.code, 0, "{done:#?}");
    let table = Table::parse(&workshop.text("out/system.csv"));
    // The first two rows show what was found before the first step.
    let lost = table.column("filter.assurance").iter().filter(|status| **status != 1.0).count();
    (serde_json::from_str(&done.stdout).expect("JSON"), done.stderr, lost)
}

fn kept(report: &Value, promise: &str) -> bool {
    let promises = report["promises"].as_array().expect("a list");
    promises.iter().all(|p| p["promise"] == "kept" && p["guaranteed"] == (promise == "guaranteed"))
}

/// Without a key, the promise is assured at every sample and kept. The same filter that is told nothing loses it.
#[test]
fn a_run_in_jacobi_order_keeps_its_promise() {
    let workshop = workshop();
    let (report, told, lost) = run(&workshop, &system(START, "", ""));
    assert!(told.contains(NOTE), "{told}");
    assert!(kept(&report, "guaranteed") && lost == 0, "{lost} samples, {report:#}");
    let arrival = report["promises"][0]["arrival"].as_f64().expect("a time");
    assert!(arrival <= 8.0, "{arrival}");
    let (report, told, lost) = run(&workshop, &system(START, UNTOLD, ""));
    assert!(!told.contains("actuation_delay is set"), "{told}");
    assert!(lost > 10 && !kept(&report, "guaranteed"), "{lost} samples, {report:#}");
    // In Gauss-Seidel order nothing is late, and nothing is said.
    let prompt = system(START, "", "").replace("order = \"jacobi\"\n", "");
    let (report, told, lost) = run(&workshop, &prompt);
    assert!(
        kept(&report, "guaranteed") && lost == 0 && !told.contains("actuation_delay"),
        "{told}, {report:#}"
    );
}

/// From any start from which a plan is found.
#[test]
fn random_starts_in_jacobi_order() {
    let workshop = workshop();
    let mut state = 7_u64;
    let mut draw = |low: f64, high: f64| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    let (mut promised, mut untold_lost) = (0, 0);
    for _ in 0..8 {
        let start = [draw(-2.0, 2.0), draw(-2.0, 2.0), draw(-0.5, 0.5), draw(0.0, 2.0)];
        let (report, told, lost) = run(&workshop, &system(start, "", ""));
        if report["promises"][0]["refused"] == true {
            continue;
        }
        promised += 1;
        assert!(
            kept(&report, "guaranteed") && lost == 0,
            "from {start:?}: {lost} samples, {told}, {report:#}"
        );
        untold_lost += usize::from(run(&workshop, &system(start, UNTOLD, "")).2 > 0);
    }
    assert!(promised >= 6 && untold_lost >= 4, "{promised} promised, {untold_lost} lost if untold");
}

/// An FMU built for such a master knows its delay, says so, and gives the same numbers as `run` by itself.
#[test]
fn an_fmu_for_a_jacobi_master() {
    let workshop = workshop();
    let (.., lost) = run(&workshop, &system(START, "", ""));
    let of_itself = workshop.text("out/system.csv");
    workshop.punctual(["build", "filter.toml", "-o", "filter.fmu", "--master", "jacobi"]).success();
    workshop.punctual(["build", "plant.toml", "-o", "plant.fmu"]).success();
    let shown = workshop.punctual(["inspect", "filter.fmu", "--json"]).success();
    let shown: Value = serde_json::from_str(&shown).expect("JSON");
    let variables = shown["variables"].as_array().expect("a list");
    let delay = variables.iter().find(|v| v["name"] == "actuation_delay").expect("the parameter");
    assert_eq!((&delay["start"], &delay["unit"]), (&"0.05".into(), &"s".into()), "{delay}");
    assert!(shown.to_string().contains("whose input acts 0.05 s after its sample"), "{shown}");
    let fmus = system(START, "", "").replace("filter.toml", "filter.fmu").replace("plant.toml", "plant.fmu");
    let (report, told, _) = run(&workshop, &fmus);
    assert!(kept(&report, "guaranteed") && !told.contains("actuation_delay"), "{told}, {report:#}");
    assert_eq!((workshop.text("out/system.csv"), lost), (of_itself, 0));
    // One that was built without the option is told by `run`.
    workshop.punctual(["build", "filter.toml", "-o", "filter.fmu"]).success();
    let (report, told, lost) = run(&workshop, &fmus);
    assert!(told.contains(NOTE) && kept(&report, "guaranteed") && lost == 0, "{told}, {report:#}");
}

#[test]
fn what_contradicts_a_jacobi_master_is_refused() {
    let workshop = workshop();
    let build = |text: &str| {
        workshop.write("f.toml", text);
        workshop.punctual(["build", "f.toml", "-o", "f.fmu", "--master", "jacobi"])
    };
    build(&FILTER.replace("kind", "actuation_delay = 0.02\nkind")).fails(
        2,
        "f.toml: actuation_delay: is 0.02 s, must be at least the step of 0.05 s for a Jacobi master, which hands an input on one \
         step after its sample; without the key it is that step",
    );
    build(&FILTER.replace("kind", "actuation_delay = 0.05\nkind")).success();
    let erring =
        FILTER.replace("\"on\"", "\"off\"\nmeasurement_errors = { v = 0.01 }").replace("uncertainty", "#");
    build(&erring).fails(
        2,
        "f.toml: actuation_delay: is 0, must be the step of 0.05 s for a Jacobi master, and this filter accounts for no delay: leave out \
         [measurement_errors], for which the rows alone account here, or use a master that lets the filter act at once (Gauss-Seidel)",
    );
    workshop
        .punctual(["build", "plant.toml", "-o", "p.fmu", "--master", "jacobi"])
        .fails(2, "--master: is for a filter, and plant.toml is a plant");
}

/// A package for another master gives the filter its delay as a start value.
#[test]
fn an_ssp_package_tells_the_filter() {
    let workshop = workshop();
    let values = |options: &[&str], text: &str| {
        workshop.write("system.toml", text);
        let told = workshop.punctual([&["build", "system.toml", "-o", "s.ssp"], options].concat());
        assert_eq!(told.code, 0, "{told:#?}");
        let mut found = String::new();
        workshop.edit_fmu("s.ssp", |path, bytes| {
            if path == "resources/start_values.ssv" || path == "SystemStructure.ssd" {
                found += &String::from_utf8(bytes.clone()).expect("UTF-8");
            }
            Some(bytes)
        });
        (found.contains("filter.actuation_delay"), found.contains("(Jacobi)"), told.stderr)
    };
    let jacobi = system(START, "", "");
    let prompt = jacobi.replace("order = \"jacobi\"\n", "");
    let (told, described, notes) = values(&[], &jacobi);
    assert!(told && described && notes.contains(NOTE), "{notes}");
    let (told, described, notes) = values(&[], &prompt);
    assert!(!told && !described && !notes.contains("actuation_delay"), "{notes}");
    assert!(values(&["--master", "jacobi"], &prompt).0);
    assert!(!values(&["--master", "gauss-seidel"], &jacobi).0);
}
