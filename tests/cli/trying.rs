//! The trial of `punctual validate`: if an FMU misbehaves when it runs, that is a finding, whatever happens
//! to its process.

use crate::misbehaving::{self, description};
use crate::validating::listed;
use crate::workshop::Workshop;

fn tried_with(defect: &str, macros: &[&str], options: &[&str]) -> (i32, Vec<String>) {
    let workshop = Workshop::new();
    misbehaving::write(&workshop, "x.fmu", description(defect, &[]), &misbehaving::library(macros));
    listed(&workshop, options)
}

/// Asserts that the defect gives exactly one finding, which begins with `expected`.
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
    let begin = "error trial.time trial: in fmi2DoStep at t = 0.2 s the FMU had been at work for 1.";
    let end = "s when the time limit of the trial, 1.5 s, had passed: it is slow, or it hangs; --time-limit SECONDS waits longer";
    assert!(
        code == 1 && found.len() == 1 && found[0].starts_with(begin) && found[0].ends_with(end),
        "{found:#?}"
    );
}

/// A slow FMU is no defect: fewer steps are tried.
#[test]
fn a_slow_fmu_is_tried_in_fewer_steps() {
    // All 21 steps would take 12.6 s.
    assert_eq!(tried_with("slow-in-step", &[], &["--time-limit", "6"]), (0, vec![]));
}

#[test]
fn what_the_logger_gets_is_looked_at() {
    for (defect, fault) in [
        ("logs-to-others", "the component environment was not the one given"),
        ("logs-nonsense", "the category was at an address that cannot be read"),
    ] {
        let (_, found) = tried_with(defect, &[], &[]);
        let expected = format!("warning trial.log trial: the FMU called the logger, and {fault}");
        assert!(found.contains(&expected), "{defect}: {found:#?}");
    }
    one("string-in-latin", "warning trial.text trial s: fmi2GetString gave what is not UTF-8");
    let call = "error trial.call trial: fmi2GetString of trial (x.fmu) at t = 0.1 s";
    one("string-at-1", &format!("{call} gave an address that cannot be read"));
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

/// Texts that are not formats, a conversion that writes, NULL, other encodings, terminal codes, no
/// terminator.
#[test]
fn odd_logs_do_no_harm() {
    let (_, found) = tried_with("odd-logs", &[], &[]);
    assert_eq!(found.len(), 2, "{found:#?}");
    assert_eq!(
        found[0],
        "warning trial.log trial: the FMU called the logger, and the status was none of the standard's: unknown status 77"
    );
    for part in [
        "fmi2DoStep of trial (x.fmu) at t = 0.2 s returned fmi2Error\n",
        "[fmi2OK, logAll] a stray %n writes\n",
        "[unknown status 77] \n",
        "clears the screen: \u{fffd}[2J\n",
        "[fmi2Warning, logAll] trial has 3 steps",
    ] {
        assert!(found[1].contains(part), "{part:?} in {}", found[1]);
    }
    assert!(!found[1].contains('\u{1b}') && found[1].len() < 10_000);
}

#[test]
fn the_trial_can_be_left_out() {
    assert_eq!(tried_with("crash-in-step", &[], &["--no-trial"]), (0, vec![]));
}
