//! The trial of `punctual validate`: an FMU that misbehaves when it runs is a finding, whatever it does to its
//! process.

use crate::misbehaving::{self, description};
use crate::validating::listed;
use crate::workshop::Workshop;

fn tried_with(defect: &str, macros: &[&str], options: &[&str]) -> (i32, Vec<String>) {
    let workshop = Workshop::new();
    misbehaving::write(&workshop, "x.fmu", description(defect, &[]), &misbehaving::library(macros));
    listed(&workshop, options)
}

/// Asserts that the defect makes exactly this finding (its beginning).
#[track_caller]
fn one(defect: &str, expected: &str) {
    one_with(defect, &[], expected);
}

#[track_caller]
fn one_with(defect: &str, macros: &[&str], expected: &str) {
    let (_, found) = tried_with(defect, macros, &[]);
    assert!(found.len() == 1 && found[0].starts_with(expected), "{defect} {macros:?}: {found:#?}");
}

#[test]
fn a_sound_fmu_passes() {
    assert_eq!(tried_with("none", &[], &[]), (0, vec![]));
}

#[test]
fn crashes_are_told_with_the_function() {
    for (defect, place) in [
        ("crash-in-instantiate", "in fmi2Instantiate the FMU"),
        ("crash-in-setup", "in fmi2SetupExperiment at t = 0 s the FMU"),
        ("crash-in-enter", "in fmi2EnterInitializationMode at t = 0 s the FMU"),
        ("crash-in-exit", "in fmi2ExitInitializationMode at t = 0 s the FMU"),
        ("crash-in-step", "in fmi2DoStep at t = 0.2 s the FMU"),
        ("crash-in-terminate", "in fmi2Terminate at t = 1 s the FMU"),
        ("crash-in-reset", "in fmi2Reset the FMU"),
        ("crash-in-free", "in fmi2FreeInstance"),
    ] {
        let (code, found) = tried_with(defect, &[], &[]);
        let begins = format!("error trial.crash trial: {place}");
        assert!(code == 1 && found.len() == 1 && found[0].starts_with(&begins), "{defect}: {found:#?}");
        assert!(found[0].ends_with("crashed with signal 11 (invalid memory access)"), "{found:#?}");
    }
    let loading = "error trial.crash trial: loading its library: the FMU crashed with signal 11";
    one_with("none", &["CRASH_IN_LOAD"], loading);
    let unloading = "error trial.crash trial: unloading its library: the FMU crashed with signal 11";
    one_with("none", &["CRASH_IN_UNLOAD"], unloading);
    one(
        "abort-in-step",
        "error trial.crash trial: in fmi2DoStep at t = 0.2 s the FMU crashed with signal 6 (aborted)",
    );
}

#[test]
fn an_fmu_that_ends_the_process() {
    let ended = "the FMU ended the whole process with exit code 0";
    one("exit-in-step", &format!("error trial.crash trial: in fmi2DoStep at t = 0.2 s {ended}"));
    one("exit-in-instantiate", &format!("error trial.crash trial: in fmi2Instantiate {ended}"));
}

#[test]
fn an_fmu_that_hangs_is_stopped() {
    let (code, found) = tried_with("hang-in-step", &[], &["--time-limit", "1.5"]);
    let expected =
        "error trial.crash trial: in fmi2DoStep at t = 0.2 s the FMU did not come back within 1.5 s";
    assert_eq!((code, found), (1, vec![expected.to_owned()]));
}

#[test]
fn statuses() {
    let step = "trial: fmi2DoStep of trial (x.fmu) at t = 0.2 s returned";
    one("error-in-step", &format!("error trial.call {step} fmi2Error; it logged nothing"));
    one("fatal-in-step", &format!("error trial.call {step} fmi2Fatal"));
    one(
        "pending-in-step",
        &format!("error trial.call {step} fmi2Pending: asynchronous steps are not supported"),
    );
    one("status-42-in-step", &format!("error trial.call {step} unknown status 42"));
    one("status-minus-1-in-step", &format!("error trial.call {step} unknown status -1"));
    one("discard-in-step", &format!("warning trial.discard {step} fmi2Discard"));
    one("warning-in-step", "warning trial.warning trial: 20 calls returned fmi2Warning");
    one(
        "no-instance",
        "error trial.call trial: fmi2Instantiate of trial (x.fmu) returned no instance\n  [fmi2Error, logStatusError] no licence for trial",
    );
}

#[test]
fn answers_and_values() {
    one_with(
        "none",
        &["VERSION=\"2.1\""],
        "error trial.version trial: fmi2GetVersion answered \"2.1\"; must be \"2.0\"",
    );
    one_with(
        "none",
        &["VERSION=\"1.0\""],
        "error trial.load trial: x.fmu: fmi2GetVersion answered \"1.0\", not FMI 2.0",
    );
    one_with(
        "none",
        &["PLATFORM=NULL"],
        "error trial.load trial: x.fmu: fmi2GetTypesPlatform answered \"\", not FMI 2.0",
    );
    one("not-a-number", "warning trial.output trial y: the output is NaN; should be finite");
    one(
        "out-of-range",
        "warning trial.output trial y: the output is 1000000000; should be in [-inf, 1000], as",
    );
    one("null-string", "warning trial.text trial s: fmi2GetString gave NULL");
    one(
        "wrong-start",
        "warning trial.start trial p: is 7 after initialisation; the description says start = 1",
    );
    one(
        "no-reset",
        "warning trial.reset trial y: is 20 at the end of a second run after fmi2Reset, but was 10",
    );
    one("one-instance", "warning trial.instances trial: a second instance beside trial fails, but");
}

/// Texts that are no formats, a conversion that writes, NULL, other encodings, terminal codes, no end.
#[test]
fn odd_logs_do_no_harm() {
    let (_, found) = tried_with("odd-logs", &[], &[]);
    assert_eq!(found.len(), 1, "{found:#?}");
    for part in [
        "fmi2DoStep of trial (x.fmu) at t = 0.2 s returned fmi2Error\n",
        "[fmi2OK, logAll] a stray %n writes\n",
        "[unknown status 77] \n",
        "clears the screen: \u{fffd}[2J\n",
        "[fmi2Warning, logAll] trial has 3 steps",
    ] {
        assert!(found[0].contains(part), "{part:?} in {}", found[0]);
    }
    assert!(!found[0].contains('\u{1b}') && found[0].len() < 10_000);
}

#[test]
fn the_trial_can_be_left_out() {
    assert_eq!(tried_with("crash-in-step", &[], &["--no-trial"]), (0, vec![]));
}
