//! `punctual run` with FMUs that misbehave. The message names the component and what it did. The recorded
//! rows are kept, with `--isolate` even if an FMU ends its process.

use punctual_cosim::host::PLATFORM;

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
    run(&["VERSION=((char *)1)"])
        .fails(1, "bad (bad.fmu): fmi2GetVersion answered \"an address that cannot be read\", not FMI 2.0");
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

/// The component environment is compared, never dereferenced, and no text is read at an invalid address.
#[test]
fn what_a_logger_call_carries_is_not_trusted() {
    let fails = |defect: &str, log: &str| {
        run(defect).fails(1, &format!("fmi2DoStep of bad (bad.fmu) at t = 0.2 s returned fmi2Error{log}"));
    };
    let said = |texts: &[&str]| {
        texts.iter().map(|text| format!("\n  [fmi2OK, logAll] {text}")).collect::<Vec<_>>().concat()
    };
    fails(
        "logs-to-others",
        &said(&["to 1", "to the instance", "beside it", "to the end", "to NULL", "to what was released"]),
    );
    let texts = said(&["file:///a%20small%20shop is 100% sure", "%s, %5.1s, %-40s, 7"]);
    let formatted = "abc|  2.50|7   |00ff|z|3|-4|   é|%|1|0.2|(null)";
    let done = run("logs-nonsense");
    assert!(
        done.code == 1 && done.stderr.contains("\n  [fmi2OK] (a message at an address that cannot be read)"),
        "{done:#?}"
    );
    assert!(done.stderr.contains(&texts) && done.stderr.ends_with(&format!("{formatted}\n")), "{done:#?}");
    let threads: Vec<_> = (92..100).map(|k| format!("from a thread, {k}")).collect();
    if cfg!(unix) {
        fails("logs-from-a-thread", &said(&threads.iter().map(String::as_str).collect::<Vec<_>>()));
    }
    let both = workshop("logs-after-its-end", &[]);
    both.write("system.toml", SYSTEM.replace("good.fmu", "bad.fmu"));
    both.punctual(["run", "system.toml"]).success();
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
        // Both have feedthrough and step at 0.2 s before the row of 0.2 s is recorded.
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

/// A process that is killed has no time to remove what it unpacked.
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

/// The description of an FMU without numeric outputs: y is a local variable.
fn without_outputs(defect: &str) -> String {
    let unknown = "<Unknown index=\"1\" dependencies=\"2\" dependenciesKind=\"dependent\"/>";
    description(
        defect,
        &[
            ("valueReference=\"0\" causality=\"output\">", "valueReference=\"0\">"),
            (unknown, ""),
            (unknown, ""),
        ],
    )
}

const ALONE: &str = "[experiment]\nstop_time = 1.0\nstep = 0.1\n[[component]]\nname = \"one\"\nfmu = \"one.fmu\"\nstart = { u = 0.0 }\n";

/// Also for an FMU that refuses to be read before the run begins, which the standard allows.
#[test]
fn local_variables_are_recorded_and_connected() {
    let workshop = Workshop::new();
    let library = misbehaving::library(&[]);
    misbehaving::write(&workshop, "one.fmu", without_outputs("not-in-initialisation"), &library);
    misbehaving::write(&workshop, "two.fmu", description("none", &[]), &library);
    workshop.write("system.toml", ALONE);
    let done = workshop.punctual(["run", "system.toml", "--out", "out"]);
    let notes = "note: one has no outputs that are numbers: its local variable is recorded\n\
                 note: not recorded, since a row holds numbers: one.s (String)\n";
    assert_eq!((done.code, done.stderr.as_str()), (0, notes));
    let steps: Vec<f64> = (0..=10).map(f64::from).collect();
    assert_eq!(Table::parse(&workshop.text("out/system.csv")).column("one.y"), steps);

    let both = format!(
        "{ALONE}[[component]]\nname = \"two\"\nfmu = \"two.fmu\"\n[[connection]]\nfrom = \"one.y\"\nto = \"two.u\"\n\
         [record]\nsignals = [\"one.y\", \"two.u\", \"two.p\", \"one.u\"]\n"
    );
    for order in ["gauss-seidel", "jacobi"] {
        workshop.write(
            "system.toml",
            both.replacen("step = 0.1\n", &format!("step = 0.1\norder = \"{order}\"\n"), 1),
        );
        let done = workshop.punctual(["run", "system.toml", "--out", "out"]);
        let note =
            "note: one.y is not an output, so it is not read during the initialisation: two.u gets 0 there\n";
        assert!(done.code == 0 && done.stderr.contains(note), "{done:#?}");
        let table = Table::parse(&workshop.text("out/system.csv"));
        assert_eq!((table.column("one.y"), table.column("two.u")), (steps.clone(), steps.clone()), "{order}");
        assert_eq!((table.column("two.p"), table.column("one.u")), (vec![1.0; 11], vec![0.0; 11]));
    }
    workshop.punctual(["build", "system.toml", "-o", "x.ssp"]).fails(
        2,
        "system.toml: connection: one.y has causality local; an .ssp file connects outputs to inputs of the same type only, \
         though `punctual run` couples them",
    );
}

#[test]
fn a_tolerance_reaches_the_fmu() {
    let workshop = workshop("shows-tolerance", &[]);
    for (experiment, component, expected) in
        [("", "", 0.0), ("tolerance = 1e-5\n", "", 1e-5), ("tolerance = 1e-5\n", "tolerance = 1e-7\n", 1e-7)]
    {
        let text = SYSTEM.replacen("step = 0.1\n", &format!("step = 0.1\n{experiment}"), 1);
        workshop
            .write("system.toml", text.replacen("\"bad.fmu\"\n", &format!("\"bad.fmu\"\n{component}"), 1));
        workshop.punctual(["run", "system.toml", "--out", "out"]).success();
        assert_eq!(Table::parse(&workshop.text("out/system.csv")).column("bad.y")[10], expected);
    }
    workshop.write("system.toml", SYSTEM.replacen("step = 0.1\n", "step = 0.1\ntolerance = -1\n", 1));
    workshop
        .punctual(["run", "system.toml"])
        .fails(2, "system.toml: experiment.tolerance: is -1; must be finite and > 0, such as 1e-6");
}

/// A name that is no C identifier is a finding of `validate`, but the FMU runs.
#[test]
fn a_library_may_have_any_file_name() {
    let workshop = Workshop::new();
    workshop.write("system.toml", ALONE);
    let name = |name: &str| {
        description("none", &[("modelIdentifier=\"misbehaving\"", &format!("modelIdentifier=\"{name}\""))])
    };
    for odd in ["mis-behaving", "2 behaviours", "Ähnlich.1"] {
        misbehaving::write_at(&workshop, "one.fmu", name(odd), &format!("{PLATFORM}/{odd}"));
        workshop.punctual(["run", "system.toml"]).success();
        let done = workshop.punctual(["validate", "one.fmu"]);
        let is_told =
            done.stdout.contains("[interface.identifier]") && done.stdout.contains("1 error, no warnings");
        assert!(done.code == 1 && is_told && done.stderr.is_empty(), "{done:#?}");
    }
    for none in ["", " ", "../misbehaving", "a/b", "C:x"] {
        misbehaving::write(&workshop, "one.fmu", name(none), &misbehaving::library(&[]));
        let message = format!(
            "one (one.fmu): modelIdentifier is {none:?}, which names no file, so there is no library"
        );
        workshop.punctual(["run", "system.toml"]).fails(1, &message);
    }
    misbehaving::write_at(&workshop, "one.fmu", description("none", &[]), &format!("{PLATFORM}/other"));
    let suffix = std::env::consts::DLL_SUFFIX;
    let message = format!(
        "one (one.fmu): holds no binaries/{PLATFORM}/misbehaving{suffix}, the library that its modelIdentifier names; in that \
         folder is other{suffix}"
    );
    workshop.punctual(["run", "system.toml"]).fails(1, &message);
}

/// What is out of scope is reported as such; nothing is wrong with the file.
#[test]
fn other_interfaces_and_versions_are_out_of_scope() {
    let workshop = Workshop::new();
    workshop.write("system.toml", ALONE);
    let only = "it offers ModelExchange only, and this program runs co-simulation; export it for that";
    let interface =
        "<CoSimulation modelIdentifier=\"misbehaving\" canHandleVariableCommunicationStepSize=\"true\"/>";
    let exchange = description("none", &[(interface, "<ModelExchange modelIdentifier=\"misbehaving\"/>")]);
    misbehaving::write(&workshop, "one.fmu", exchange, &misbehaving::library(&[]));
    workshop.punctual(["run", "system.toml"]).fails(1, &format!("one (one.fmu): cannot be run here: {only}"));
    let done = workshop.punctual(["validate", "one.fmu"]);
    let expected =
        (0, "one.fmu: no errors, no warnings\n", format!("note: not examined: the trial: {only}\n"));
    assert_eq!((done.code, done.stdout.as_str(), done.stderr), expected);

    for version in ["1.0", "4.0"] {
        let other = description("none", &[("fmiVersion=\"2.0\"", &format!("fmiVersion=\"{version}\""))]);
        misbehaving::write(&workshop, "one.fmu", other, &misbehaving::library(&[]));
        let message = format!(
            "one.fmu: cannot be run here: it is of FMI {version}, and this program is for FMI 2.0 and 3.0; export it again as \
             one of these"
        );
        for command in ["validate", "inspect"] {
            workshop.punctual([command, "one.fmu"]).fails(1, &message);
        }
    }
    // A value that is no version is a mistake in the file.
    let other = description("none", &[("fmiVersion=\"2.0\"", "fmiVersion=\"one\"")]);
    misbehaving::write(&workshop, "one.fmu", other, &misbehaving::library(&[]));
    let done = workshop.punctual(["validate", "one.fmu"]);
    let finding = "fmiModelDescription: fmiVersion is \"one\"; must be \"2.0\"\n";
    assert!(done.code == 1 && done.stdout.contains(finding), "{done:#?}");
}

/// Tools and people archive the folder instead of its content.
#[test]
fn a_folder_around_everything_is_told() {
    let workshop = Workshop::new();
    let mut archive = punctual_modeldescription::Archive::new();
    archive.add("my model/modelDescription.xml", description("none", &[])).expect("an entry");
    archive.add("my model/resources/x.txt", "x").expect("an entry");
    workshop.write("one.fmu", archive.to_bytes().expect("an archive"));
    let message = "modelDescription.xml: is not at the top of the archive, but in my model/: an FMU holds what is in that \
                   folder, without the folder; archive it again from inside";
    workshop.punctual(["inspect", "one.fmu"]).fails(1, &format!("one.fmu: {message}"));
    let done = workshop.punctual(["validate", "one.fmu"]);
    assert!(done.code == 1 && done.stdout.contains(message), "{done:#?}");
}
