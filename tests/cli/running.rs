//! `punctual run` on the example: its output and its recording, in both orders.

use std::fs;

use serde_json::Value;

use crate::table::Table;
use crate::workshop::{Workshop, assert_golden, examples};

/// The example's system file for the FMUs of [`Workshop::with_fmus`], with `edits`.
pub(crate) fn system(edits: &[(&str, &str)]) -> String {
    let mut text = fs::read_to_string(examples().join("unicycle.toml")).expect("the example");
    let names = [("unicycle-filter.fmu\"", "filter.fmu\""), ("unicycle-plant.fmu\"", "plant.fmu\"")];
    for (from, to) in names.iter().chain(edits) {
        assert!(text.contains(from), "{from:?} in {text}");
        text = text.replace(from, to);
    }
    text
}

/// Runs a system and returns its CSV.
pub(crate) fn recorded(edits: &[(&str, &str)], more: &str) -> Table {
    let workshop = Workshop::with_fmus();
    workshop.write("system.toml", system(edits) + more);
    workshop.punctual(["run", "system.toml", "--out", "out"]).success();
    Table::parse(&workshop.text("out/system.csv"))
}

/// The deadline and radius of the example, and the end of its run.
const DEADLINE: f64 = 10.0;

#[test]
fn the_example_keeps_its_promise() {
    let table = recorded(&[], "");
    assert_eq!(table.len(), 20_001);
    let (time, h) = (table.column("time"), table.column("filter.goal.h"));
    assert_eq!((time[0], time[20_000]), (0.0, 20.0));
    let arrival = h.iter().position(|h| *h >= 0.0).expect("it arrives");
    assert!(time[arrival] <= DEADLINE, "it arrives at {}", time[arrival]);
    // The sample at the deadline must already be inside.
    let after = time.iter().zip(&h).filter(|(t, _)| **t >= DEADLINE - 1e-9).map(|(_, h)| *h);
    assert!(after.fold(f64::INFINITY, f64::min) >= 0.0, "it leaves again");
    assert!(table.column("filter.status").iter().all(|s| *s <= 1.0), "a constraint was not satisfied");
    assert!(table.column("filter.goal.on_course").iter().all(|g| *g == 1.0));
    let arrived = table.column("filter.goal.arrived");
    assert!((0..arrived.len()).all(|k| (arrived[k] == 1.0) == (k >= arrival)), "arrived follows h");
}

#[test]
fn header_and_rows() {
    let table = recorded(&[("stop_time = 20.0", "stop_time = 0.01")], "");
    let outputs = ["u.a", "u.omega", "status", "goal.h", "goal.profile", "goal.time_left", "goal.slack"];
    let rest = ["margin_used", "sampling_loss", "unmet_steps", "postponed"];
    let flags = ["arrived", "guaranteed", "on_course", "deadline_unreachable", "deadlocked", "phase"];
    let rest: Vec<_> = rest.iter().chain(&flags).map(|field| format!("goal.{field}")).collect();
    let states = ["x.x_p", "x.y_p", "x.theta", "x.v"];
    let mut names = vec!["time".to_owned()];
    let outputs = outputs.into_iter().chain(rest.iter().map(String::as_str));
    let filter = outputs.chain(states).chain(["u_ref.a"]);
    names.extend(filter.map(|n| format!("filter.{n}")));
    names.extend(states.iter().chain(&["u.a", "u.omega"]).map(|n| format!("plant.{n}")));
    assert_eq!(table.header(), names);
    let times: Vec<_> = (0..=10).map(|k| if k == 10 { 0.01 } else { f64::from(k) * 0.001 }).collect();
    assert_eq!(table.column("time"), times);
}

#[test]
fn fewer_rows_and_chosen_signals() {
    let record = "[record]\nevery = 4\nsignals = [\"plant.x.v\"]\n";
    let table = recorded(&[("stop_time = 20.0", "stop_time = 0.01")], record);
    assert_eq!(table.header(), ["time", "plant.x.v"]);
    assert_eq!(table.column("time"), [0.0, 0.004, 0.008, 0.01], "the last point is always there");
}

/// The filter's outputs depend directly on its inputs. It is told nothing here (tests/cli/late.rs). In Gauss–Seidel order the sample of t_k acts from t_k on;
/// in Jacobi order from t_{k+1} on.
#[test]
fn jacobi_order_is_one_step_late() {
    let short = ("stop_time = 20.0", "stop_time = 0.05");
    let prompt = recorded(&[short], "");
    let untold = ("fmu = \"filter.fmu\"", "fmu = \"filter.fmu\"\nstart = { actuation_delay = 0.0 }");
    let late = recorded(&[short, ("step = 0.001", "order = \"jacobi\"\nstep = 0.001"), untold], "");
    for table in [&prompt, &late] {
        assert_eq!(table.column("filter.u.a"), table.column("plant.u.a"));
    }
    let (prompt, late) = (prompt.column("plant.u.omega"), late.column("plant.u.omega"));
    // The first samples see the same state; after that the turning rate grows by less than 0.03 per step.
    assert_eq!(late[0].to_bits(), prompt[0].to_bits());
    assert_eq!(late[1].to_bits(), prompt[0].to_bits(), "the sample of 0 s acts until 2 ms");
    assert!(prompt[1] > prompt[0]);
    for k in 1..late.len() {
        let (same, before) = ((late[k] - prompt[k]).abs(), (late[k] - prompt[k - 1]).abs());
        assert!(before < same, "row {k}: {} lies nearer to {} than to {}", late[k], prompt[k], prompt[k - 1]);
    }
}

#[test]
fn the_text_of_a_run() {
    let workshop = Workshop::with_fmus();
    let record = "[record]\nsignals = [\"filter.goal.h\", \"filter.goal.arrived\", \"plant.x.v\"]\n";
    workshop.write("system.toml", system(&[("stop_time = 20.0", "stop_time = 0.5")]) + record);
    let done = workshop.punctual(["run", "system.toml", "--out", "out"]);
    assert_eq!(done.stderr, "");
    // The wall time is in the middle of the line.
    let text = done.success();
    let timed = text.lines().find(|line| line.contains("steps/s")).expect("a line on the steps").to_owned();
    let (before, _) = timed.split_once(" s in ").expect("a wall time");
    assert_golden("run.txt", &text.replace(&timed, &format!("{before} s in TIME s (RATE steps/s)")));
}

#[test]
fn the_json_of_a_run() {
    let workshop = Workshop::with_fmus();
    workshop.write("system.toml", system(&[("stop_time = 20.0", "stop_time = 0.5")]));
    let text = workshop.punctual(["run", "system.toml", "--json"]).success();
    let report: Value = serde_json::from_str(&text).expect("JSON");
    assert_eq!((&report["steps"], &report["final_time"]), (&500.into(), &0.5.into()));
    assert_eq!(report["order"], "gauss-seidel");
    assert_eq!((&report["files"], &report["notes"]), (&Value::Array(vec![]), &Value::Array(vec![])));
    assert_eq!(report["components"][1]["model"], "unicycle");
    assert_eq!(
        (&report["promises"][0]["barrier"], &report["promises"][0]["unmet"]),
        (&"filter.goal".into(), &0.into())
    );
    let signals = report["signals"].as_array().expect("a list");
    assert_eq!(signals.len(), 28);
    let left = signals.iter().find(|s| s["name"] == "filter.goal.time_left").expect("the time left");
    assert_eq!((&left["unit"], &left["max"], &left["final"]), (&"s".into(), &10.0.into(), &9.5.into()));
    assert_eq!(
        workshop.files(),
        ["filter.fmu", "plant.fmu", "system.toml"],
        "without --out nothing is written"
    );
}

#[test]
fn pictures_are_written_beside_the_table() {
    let workshop = Workshop::with_fmus();
    let plots = "[[plot]]\nkind = \"time\"\nname = \"h\"\nsignals = [\"filter.goal.h\"]\ndeadline = 10.0\n\
                 [[plot]]\nkind = \"path\"\nx = \"plant.x.x_p\"\ny = \"plant.x.y_p\"\n";
    workshop.write("system.toml", system(&[("stop_time = 20.0", "stop_time = 0.5")]) + plots);
    workshop.punctual(["run", "system.toml", "--out", "out"]).success();
    for picture in ["out/system-h.svg", "out/system-2.svg"] {
        assert!(workshop.text(picture).trim_end().ends_with("</svg>"), "{picture}");
    }
}

/// The verdict on the promise is reported and, if required, determines the exit code.
#[test]
fn promises_that_are_required() {
    let promise = |bound: &str, require: bool, isolate: bool| {
        let workshop = Workshop::with_fmus();
        let start =
            format!("fmu = \"filter.fmu\"\nstart = {{ \"u_min.a\" = -{bound}, \"u_max.a\" = {bound} }}");
        let edits = [("fmu = \"filter.fmu\"", start.as_str()), ("step = 0.001", "step = 0.01")];
        workshop.write("system.toml", system(&edits));
        let mut words = vec!["run", "system.toml", "--json"];
        words.extend(require.then_some(["--require", "kept"]).into_iter().flatten());
        words.extend(isolate.then_some("--isolate"));
        let done = workshop.punctual(&words);
        let report: Value = serde_json::from_str(&done.stdout).expect("JSON");
        (done.code, report["promises"][0].clone())
    };
    let (code, kept) = promise("20.0", true, false);
    assert_eq!((code, &kept["barrier"], &kept["unmet"]), (0, &"filter.goal".into(), &0.into()), "{kept}");
    assert!(kept["arrival"].as_f64().is_some_and(|t| t <= DEADLINE) && kept["late"].is_null(), "{kept}");
    // 60.8 m with 1 m/s2 takes at least 11 s from rest, so lateness is certain before the deadline.
    let (code, late) = promise("1.0", false, false);
    assert_eq!(code, 1, "{late}");
    assert!(late["late"].as_f64().is_some_and(|t| t < DEADLINE), "{late}");
    let above = |field: &str| late[field].as_f64().is_some_and(|value| value > 0.0);
    assert!(above("unmet") && above("longest") && above("violation"), "{late}");
    assert_eq!(promise("1.0", true, false), (1, late.clone()));
    assert_eq!(promise("1.0", true, true), (1, late));
}
