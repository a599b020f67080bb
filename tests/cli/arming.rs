//! Deadlines that count from zeros that a plant outputs before its first step, and filters that are armed
//! later.

use serde_json::Value;

use crate::misbehaving::{self, description};
use crate::table::Table;
use crate::workshop::Workshop;

/// A filter whose state another FMU measures; nothing moves the state.
const FILTER: &str = r#"
kind = "filter"
name = "filter"
bounds = { v = [-2.0, 2.0] }
assurance = "off"
[plant]
states = [{ name = "p", unit = "m" }]
inputs = [{ name = "v", unit = "m/s" }]
derivatives = { p = "v" }
[[barrier]]
name = "goal"
expression = "p - 39.0"
unit = "m"
deadline = 0.5
"#;

fn workshop(defect: &str, order: &str, filter: &str) -> Workshop {
    let workshop = Workshop::new();
    // Its output does not depend directly on an input, so the filter sees its value from before the first
    // step.
    let held = ("dependencies=\"2\" dependenciesKind=\"dependent\"", "dependencies=\"\"");
    misbehaving::write(&workshop, "plant.fmu", description(defect, &[held]), &misbehaving::library(&[]));
    workshop.write("filter.toml", format!("{filter}{FILTER}"));
    workshop.write(
        "system.toml",
        format!(
            "[experiment]\nstop_time = 1.0\nstep = 0.1\norder = \"{order}\"\n\
             [[component]]\nname = \"filter\"\nfmu = \"filter.toml\"\nstart = {{ \"u_ref.v\" = 9.0 }}\n\
             [[component]]\nname = \"plant\"\nfmu = \"plant.fmu\"\nstart = {{ u = 0.0 }}\n\
             [[connection]]\nfrom = \"plant.y\"\nto = \"filter.x.p\"\n"
        ),
    );
    workshop
}

fn run(workshop: &Workshop) -> Value {
    let done = workshop.punctual(["run", "system.toml", "--json", "--out", "out"]);
    serde_json::from_str(&done.stdout).unwrap_or_else(|e| panic!("{e}: {done:#?}"))
}

/// The notes of a run that mention zeros.
fn notes(report: &Value) -> Vec<String> {
    let notes = report["notes"].as_array().expect("notes").iter().filter_map(Value::as_str);
    notes.filter(|note| note.contains("all zero")).map(str::to_owned).collect()
}

#[test]
fn zeros_that_a_deadline_counts_from_are_noted() {
    for order in ["gauss-seidel", "jacobi"] {
        let report = run(&workshop("zeros-until-step", order, ""));
        let note = "filter: the state was all zero until t = 0 s, and jumped then, as where a plant gives zeros before its first step; \
                    the deadlines count from t = 0 s: with `arm_after = 0.1` in the filter, from the jump";
        assert_eq!(notes(&report), [note], "{order}: {report:#}");
    }
}

/// A state that begins at zero and moves on does not count, nor do zeros at which the filter was not armed.
#[test]
fn other_zeros_are_not() {
    for order in ["gauss-seidel", "jacobi"] {
        assert_eq!(notes(&run(&workshop("none", order, ""))), [""; 0], "0, 1, 2, ... in {order}");
        let report = run(&workshop("zeros-until-step", order, "arm_after = 0.1\n"));
        assert_eq!(notes(&report), [""; 0], "{order}: {report:#}");
    }
}

/// The deadline counts from the armed step, and the steps before do not count as failures.
#[test]
fn a_run_is_judged_from_the_armed_step_on() {
    let workshop = workshop("zeros-until-step", "gauss-seidel", "arm_after = 0.1\n");
    let report = run(&workshop);
    let promise = &report["promises"][0];
    assert_eq!((&promise["promise"], &promise["began_inside"]), (&"kept".into(), &true.into()), "{promise}");
    assert_eq!((&promise["constraint_met"], &promise["unmet"]), (&true.into(), &0.into()), "{promise}");
    let table = Table::parse(&workshop.text("out/system.csv"));
    assert_eq!(table.column("filter.status")[..2], [9.0, 1.0], "not_armed, then filtered");
    assert_eq!(table.column("filter.u.v")[0], 2.0, "u_ref within its bounds");
    // Without it, the promise begins outside, at a state that the plant never had.
    let report = run(&self::workshop("zeros-until-step", "gauss-seidel", ""));
    assert_eq!(report["promises"][0]["began_inside"], false, "{report:#}");
}

/// Arming after the end of the run leaves the promise open.
#[test]
fn one_that_is_never_armed_promises_nothing() {
    let workshop = workshop("zeros-until-step", "gauss-seidel", "arm_after = 5.0\n");
    let report = run(&workshop);
    assert_eq!(report["promises"][0]["promise"], "open", "{report:#}");
    let table = Table::parse(&workshop.text("out/system.csv"));
    assert!(table.column("filter.status").iter().all(|status| *status == 9.0));
    assert!(table.column("filter.goal.guaranteed").iter().all(|flag| *flag == 0.0));
}

/// The Integer twins of enumerations are recorded if they are named, and have the same numbers.
#[test]
fn twins_are_recorded_where_they_are_named() {
    let workshop = workshop("none", "gauss-seidel", "");
    run(&workshop);
    assert!(!workshop.text("out/system.csv").lines().next().expect("a header").contains("_code"));
    let system = workshop.text("system.toml");
    let named = ["status", "status_code", "goal.phase", "goal.phase_code"]
        .map(|n| format!("\"filter.{n}\""))
        .join(", ");
    workshop.write("system.toml", format!("{system}[record]\nsignals = [{named}]\n"));
    run(&workshop);
    let table = Table::parse(&workshop.text("out/system.csv"));
    assert_eq!(table.column("filter.status"), table.column("filter.status_code"));
    assert_eq!(table.column("filter.goal.phase"), table.column("filter.goal.phase_code"));
}

#[test]
fn check_says_what_it_leaves_open() {
    let workshop = workshop("none", "gauss-seidel", "arm_after = 0.25\n");
    let done = workshop.punctual(["check", "filter.toml", "--x0", "p=38.5"]);
    let warning = "warning: the filter is armed 0.25 s after its first step: until then nothing is promised; statements about a start \
                   refer to the state at that time";
    assert!(done.stdout.contains(warning), "{done:#?}");
    let late = self::workshop("none", "gauss-seidel", "arm_after = 25.0\n");
    let done = late.punctual(["check", "filter.toml"]);
    assert!(done.stdout.contains("warning: the experiment stops before the filter is armed"), "{done:#?}");
}
