//! `punctual run` with FMUs that misbehave. The message names the component and its deed. The recorded rows are
//! kept, with `--isolate` even when an FMU ends its process.

use crate::misbehaving::{self, description};
use crate::table::Table;
use crate::workshop::{Done, Workshop};

const SYSTEM: &str = "[experiment]\nstop_time = 1.0\nstep = 0.1\n[[component]]\nname = \"good\"\nfmu = \"good.fmu\"\nstart = { u = 0.0 }\n\
                      [[component]]\nname = \"bad\"\nfmu = \"bad.fmu\"\n[[connection]]\nfrom = \"good.y\"\nto = \"bad.u\"\n";

/// A sound FMU that feeds one with a defect.
fn workshop(defect: &str, macros: &[&str]) -> Workshop {
    let workshop = Workshop::new();
    misbehaving::write(&workshop, "good.fmu", description("none", &[]), &misbehaving::library(&[]));
    misbehaving::write(&workshop, "bad.fmu", description(defect, &[]), &misbehaving::library(macros));
    workshop.write("system.toml", SYSTEM);
    workshop
}

fn run(defect: &str) -> Done {
    workshop(defect, &[]).punctual(["run", "system.toml"])
}

#[test]
fn two_sound_fmus_run() {
    let workshop = workshop("none", &[]);
    workshop.punctual(["run", "system.toml", "--out", "a"]).success();
    workshop.punctual(["run", "system.toml", "--out", "b", "--isolate"]).success();
    assert_eq!(workshop.text("a/system.csv"), workshop.text("b/system.csv"));
    assert_eq!(Table::parse(&workshop.text("a/system.csv")).len(), 11);
}

#[test]
fn each_status_names_the_component() {
    for (defect, status) in [
        ("error-in-step", "fmi2Error; it logged nothing"),
        ("fatal-in-step", "fmi2Fatal; it logged nothing"),
        (
            "discard-in-step",
            "fmi2Discard: it refuses this step, and steps are not retried; it logged nothing",
        ),
        ("pending-in-step", "fmi2Pending: asynchronous steps are not supported; it logged nothing"),
        ("status-42-in-step", "unknown status 42; it logged nothing"),
        ("status-minus-1-in-step", "unknown status -1; it logged nothing"),
    ] {
        run(defect).fails(1, &format!("fmi2DoStep of bad (bad.fmu) at t = 0.2 s returned {status}"));
    }
    run("no-instance").fails(
        1,
        "fmi2Instantiate of bad (bad.fmu) returned no instance\n  [fmi2Error, logStatusError] no licence for bad",
    );
}

#[test]
fn a_missing_function_and_a_wrong_version_name_the_component() {
    let run = |macros: &[&str]| workshop("none", macros).punctual(["run", "system.toml"]);
    run(&["WITHOUT_RESET"]).fails(1, "bad (bad.fmu): its library does not export fmi2Reset");
    run(&["VERSION=\"1.0\""]).fails(1, "bad (bad.fmu): fmi2GetVersion answered \"1.0\", not FMI 2.0");
    run(&["PLATFORM=NULL"]).fails(1, "bad (bad.fmu): fmi2GetTypesPlatform answered \"\", not FMI 2.0");
    // A run does not use these functions.
    run(&["WITHOUT_STATE"]).success();
}

#[test]
fn what_is_not_finite_is_told_and_the_run_goes_on() {
    let head = ["good", "bad"]
        .map(|name| format!("note: not recorded, since a row holds numbers: {name}.s (String)\n"));
    for (defect, note) in [
        ("not-a-number", "bad.y is NaN at t = 0.2 s for the first time; the run goes on"),
        ("warning-in-step", "bad: 10 calls returned fmi2Warning"),
    ] {
        let done = run(defect);
        assert_eq!((done.code, done.stderr), (0, format!("{}note: {note}\n", head.concat())));
    }
}

#[test]
fn odd_logs_are_shown_harmlessly() {
    let done = run("odd-logs");
    assert_eq!(done.code, 1);
    assert!(
        done.stderr.starts_with(
            "warning: bad: bad has 0 steps\nerror: fmi2DoStep of bad (bad.fmu) at t = 0.2 s returned fmi2Error\n"
        ),
        "{done:#?}"
    );
    assert!(!done.stderr.contains('\u{1b}') && done.stderr.contains("not UTF-8: \u{fffd}"), "{done:#?}");
}

/// The isolated run keeps the row of each communication point before the crash.
#[test]
fn an_isolated_crash_is_told_and_the_rows_are_kept() {
    for (defect, how) in [
        ("crash-in-step", "crashed with signal 11 (invalid memory access)"),
        ("abort-in-step", "crashed with signal 6 (aborted)"),
        ("exit-in-step", "ended the whole process with exit code 0"),
    ] {
        let workshop = workshop(defect, &[]);
        let done = workshop.punctual(["run", "system.toml", "--isolate", "--out", "out"]);
        let note = "note: what was recorded until then is in out/system.csv\n";
        let error = format!("error: fmi2DoStep of bad (bad.fmu) at t = 0.2 s {how}\n");
        assert_eq!((done.code, done.stdout.as_str(), done.stderr), (1, "", format!("{note}{error}")));
        let table = Table::parse(&workshop.text("out/system.csv"));
        // Both have feedthrough and step at 0.2 s before the row of 0.2 s is taken.
        assert_eq!(table.column("time"), [0.0, 0.1]);
        assert_eq!(table.column("good.y"), [1.0, 2.0]);
    }
}

#[test]
fn an_isolated_crash_elsewhere() {
    for (defect, macros, message) in [
        (
            "crash-in-instantiate",
            &[][..],
            "fmi2Instantiate of bad (bad.fmu) crashed with signal 11 (invalid memory access)",
        ),
        (
            "crash-in-free",
            &[],
            "fmi2FreeInstance of bad (bad.fmu) at t = 1 s crashed with signal 11 (invalid memory access)",
        ),
        (
            "none",
            &["CRASH_IN_LOAD"],
            "bad.fmu: loading its library crashed with signal 11 (invalid memory access)",
        ),
    ] {
        let done = workshop(defect, macros).punctual(["run", "system.toml", "--isolate"]);
        assert!(
            done.code == 1 && done.stderr.ends_with(&format!("error: {message}\n")),
            "{defect}: {done:#?}"
        );
    }
}

#[test]
fn isolation_changes_neither_results_nor_other_errors() {
    let workshop = workshop("error-in-step", &[]);
    let [plain, isolated] = [&["run", "system.toml"][..], &["run", "system.toml", "--isolate"]]
        .map(|arguments| workshop.punctual(arguments));
    assert_eq!((plain.code, plain.stderr), (isolated.code, isolated.stderr));
    workshop.punctual(["run", "none.toml", "--isolate"]).fails_like(2, "cannot read none.toml: ", &[]);
    workshop.write("good.toml", SYSTEM.replace("bad.fmu", "good.fmu"));
    let done = workshop.punctual(["run", "good.toml", "--isolate", "--json"]);
    let report: serde_json::Value = serde_json::from_str(&done.success()).expect("JSON");
    assert_eq!(report["steps"], 10);
}

/// A process that is ended has no time to remove what it unpacked.
#[test]
fn nothing_is_left_behind() {
    let workshop = workshop("crash-in-step", &[]);
    std::fs::create_dir(workshop.path("tmp")).expect("a writable folder");
    let tmp = workshop.path("tmp").display().to_string();
    let workshop = workshop.with_variable("TMPDIR", tmp);
    assert_eq!(workshop.punctual(["run", "system.toml", "--isolate"]).code, 1);
    assert_eq!(workshop.punctual(["validate", "bad.fmu"]).code, 1);
    assert_eq!(std::fs::read_dir(workshop.path("tmp")).expect("a folder").count(), 0);
}
