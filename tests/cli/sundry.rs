//! FMUs of FMI 3.0, alone and together with those of FMI 2.0: every type, arrays, structural parameters, and
//! all kinds of misbehaviour.

use crate::misbehaving::{self, description, sundry, write_sundry};
use crate::table::Table;
use crate::validating::listed;
use crate::workshop::{Done, Workshop};

/// One FMU of FMI 3.0 feeds another, which has this defect and was compiled with these macros.
fn workshop(defect: &str, macros: &[&str]) -> Workshop {
    let workshop = Workshop::new();
    write_sundry(&workshop, "a.fmu", sundry("none", &[]), &[]);
    write_sundry(&workshop, "b.fmu", sundry(defect, &[]), macros);
    workshop
}

/// The system of both with these start values and connections; everything else keeps the FMU's values.
fn system(a: &str, b: &str, wiring: &str) -> String {
    let component = |name: &str, start: &str| {
        format!(
            "[[component]]\nname = \"{name}\"\nfmu = \"{name}.fmu\"\nstart = {{ in_float32 = 0.5, {start} }}\n"
        )
    };
    let head = "[experiment]\nstop_time = 1.0\nstep = 0.1\n";
    format!("{head}{}{}{wiring}", component("a", a), component("b", b))
}

fn connection(from: &str, to: &str) -> String {
    format!("[[connection]]\nfrom = \"{from}\"\nto = \"{to}\"\n")
}

fn run(workshop: &Workshop, system: &str) -> Done {
    workshop.write("system.toml", system);
    workshop.punctual(["run", "system.toml", "--out", "out"])
}

fn rows(workshop: &Workshop) -> Table {
    Table::parse(&workshop.text("out/system.csv"))
}

const NOT_RECORDED: &str = "note: not recorded, since a row holds numbers: a.out_string (String), a.out_binary (Binary)\n\
                            note: not recorded, since a row holds numbers: b.out_string (String), b.out_binary (Binary)\n";

#[test]
fn a_value_of_every_type_goes_in_and_comes_out() {
    let workshop = workshop("none", &[]);
    let start = "u = [1, 2], in_float32 = 0.1, in_int8 = -128, in_uint8 = 255, in_int16 = -32768, in_uint16 = 65535, \
                 in_int32 = -2147483648, in_uint32 = 4294967295, in_int64 = -9007199254740992, \
                 in_uint64 = 9007199254740992, in_boolean = true, in_enumeration = 5000000000";
    let text = system("u = [0, 0]", start, "").replace("in_float32 = 0.5, u = [1, 2]", "u = [1, 2]");
    let done = run(&workshop, &text);
    assert_eq!((done.code, done.stderr.as_str()), (0, NOT_RECORDED));
    let rows = rows(&workshop);
    for (name, expected) in [
        ("float32", f64::from(0.1_f32)),
        ("int8", -128.0),
        ("uint8", 255.0),
        ("int16", -32768.0),
        ("uint16", 65535.0),
        ("int32", -2_147_483_648.0),
        ("uint32", 4_294_967_295.0),
        ("int64", -9_007_199_254_740_992.0),
        ("uint64", 9_007_199_254_740_992.0),
        ("boolean", 1.0),
        ("enumeration", 5e9),
    ] {
        assert_eq!(rows.column(&format!("b.out_{name}")), vec![expected; 11], "{name}");
    }
    // Euler steps of 0.1 s.
    let y: Vec<f64> = std::iter::successors(Some(0.0), |y| Some(y + 0.1 * 2.0)).take(11).collect();
    assert_eq!(rows.column("b.y[2]"), y);
}

#[test]
fn numbers_go_from_one_type_to_another_where_they_fit() {
    let workshop = workshop("none", &[]);
    let wiring = [
        connection("a.out_uint8", "b.in_int64"),
        connection("a.out_int64", "b.in_int8"),
        connection("a.z", "b.in_float32"),
        connection("a.out_float32", "b.u[1]"),
    ]
    .concat();
    let b = "\"u[2]\" = 7";
    let done = run(&workshop, &system("u = [0.25, 0.1], in_uint8 = 200, in_int64 = -7", b, &wiring));
    assert_eq!(done.code, 0, "{done:#?}");
    let table = rows(&workshop);
    let last = |name: &str| *table.column(name).last().expect("a row");
    assert_eq!(last("b.out_int64"), 200.0);
    assert_eq!(last("b.out_int8"), -7.0);
    assert_eq!(last("b.out_float32"), f64::from((0.25 + 0.1) as f32));
    // The other element of the array keeps its start value.
    assert_eq!(last("b.z"), 0.5 + 7.0);

    let message = |value: &str, wiring: &str| {
        run(&workshop, &system(&format!("u = [0, 0], {value}"), "u = [0, 0]", wiring))
    };
    message("in_uint8 = 200", &connection("a.out_uint8", "b.in_int8")).fails(
        1,
        "fmi3SetInt8 of b (b.fmu) at t = 0 s cannot carry in_int8 = 200: must be a number of its type, from -128 to 127",
    );
}

#[test]
fn a_whole_number_that_no_double_is_ends_the_run() {
    let workshop = workshop("large-number", &[]);
    let done = run(&workshop, &system("u = [0, 0]", "u = [0, 0]", ""));
    let error = "error: fmi3GetInt64 of b (b.fmu) at t = 0.3 s cannot carry out_int64 = 9007199254740993: must be a \
                 number of its type, from -9007199254740992 to 9007199254740992\n";
    assert!(done.code == 1 && done.stderr.ends_with(error), "{done:#?}");
}

#[test]
fn structural_parameters_size_arrays_before_the_initialisation() {
    let workshop = workshop("none", &[]);
    let wiring = connection("a.y", "b.u");
    let done = run(
        &workshop,
        &system("n = 3, drive = [1, 2, 3], \"m[2,3]\" = 10", "n = 3, m = [[1, 1, 1], [1, 1, 1]]", &wiring),
    );
    assert_eq!(done.code, 0, "{done:#?}");
    let table = rows(&workshop);
    let last = |name: &str| *table.column(name).last().expect("a row");
    assert_eq!((last("a.s"), last("b.s")), (25.0, 6.0));
    assert_eq!(table.column("b.u[3]"), table.column("a.y[3]"));

    let fails = |a: &str, wiring: &str, message: &str| {
        run(&workshop, &system(a, "n = 3", wiring)).fails(2, &format!("system.toml: {message}"));
    };
    fails(
        "u = [1, 2]",
        &wiring,
        "connection[0]: a.y is an array of [2], but b.u is an array of [3]; sizes must be equal",
    );
    fails("n = 9, u = [1, 2]", &wiring, "component[0].start.\"n\": is 9; must be ≤ 8");
    fails("u = [1, 2, 3]", &wiring, "component[0].start.\"u\": is a list of [3]; must be a list of [2]");
    let by_name = "[[connect_by_name]]\ncomponents = [\"a\", \"b\"]\n";
    fails(
        "u = [0, 0]",
        by_name,
        "connect_by_name[0]: no output of a or b has an input of equal name in the other",
    );
}

#[test]
fn texts_are_parameters_too() {
    let workshop = workshop("none", &[]);
    run(&workshop, &system("u = [0, 0]", "u = [0, 0], in_string = \"five!\"", "")).success();
    // The FMU outputs the length.
    assert_eq!(rows(&workshop).column("b.out_int8")[0], 5.0);
}

#[test]
fn both_versions_in_one_system() {
    let workshop = workshop("none", &[]);
    misbehaving::write(&workshop, "a.fmu", description("none", &[]), &misbehaving::library(&[]));
    let text = system("u = 1.0", "", &[connection("a.y", "b.u[1]"), connection("a.y", "b.u[2]")].concat());
    let text = text.replacen("in_float32 = 0.5, ", "", 1);
    let done = run(&workshop, &text);
    assert_eq!(done.code, 0, "{done:#?}");
    let table = rows(&workshop);
    // y of the first counts steps and adds u; the other sums its input.
    let y = table.column("a.y");
    assert_eq!(y[10], 11.0);
    let z = table.column("b.z");
    assert!(y.iter().zip(z).all(|(y, z)| z == 2.0 * y), "{y:?}");
    workshop.punctual(["run", "system.toml", "--out", "alone", "--isolate"]).success();
    assert_eq!(workshop.text("alone/system.csv"), workshop.text("out/system.csv"));
}

#[test]
fn an_fmu_can_end_the_run() {
    let workshop = workshop("none", &[]);
    let done = run(&workshop, &system("u = [0, 0], last = 4", "u = [0, 0]", ""));
    let note = "note: a asked to end the run at t = 0.4 s (terminateSimulation)\n";
    assert!(done.code == 0 && done.stderr.contains(note), "{done:#?}");
    assert_eq!(rows(&workshop).column("time"), [0.0, 0.1, 0.2, 0.30000000000000004, 0.4]);
    let text = system("u = [0, 0], last = 4", "u = [0, 0]", "")
        .replace("step = 0.1\n", "step = 0.1\norder = \"jacobi\"\n");
    run(&workshop, &text).success();
    assert_eq!(rows(&workshop).column("time").len(), 5);
}

#[test]
fn each_defect_of_a_step_names_the_component() {
    let still = system("u = [0, 0]", "u = [0, 0]", "");
    for (defect, message) in [
        ("error-in-step", "returned fmi3Error\n  [fmi3Error, logStatusError] 100% wrong"),
        (
            "odd-logs",
            "returned fmi3Error\n  [fmi3OK, logAll] to 1\n  [fmi3OK, logAll] to the instance\n  [fmi3OK] to NULL\n  [unknown status 77] ",
        ),
        (
            "discard-in-step",
            "returned fmi3Discard: it refuses this step, and steps are not retried; it logged nothing",
        ),
        ("fatal-in-step", "returned fmi3Fatal; it logged nothing"),
        ("status-42-in-step", "returned unknown status 42; it logged nothing"),
        ("early-in-step", "came back early, at t = 0.25 s, although early return was not allowed"),
        (
            "event-in-step",
            "asked for event mode, although it was told to handle events itself (eventModeUsed is false)",
        ),
    ] {
        let done = run(&workshop(defect, &[]), &still);
        let error = format!("error: fmi3DoStep of b (b.fmu) at t = 0.2 s {message}\n");
        let printed =
            done.stderr.ends_with(&error) || done.stderr.ends_with(&error.replace("0.2 s", "0.3 s"));
        assert!(done.code == 1 && printed, "{defect}: {done:#?}");
    }
    let done = run(&workshop("off-in-step", &[]), &still);
    let note = "note: b: its step to t = 0.3 s reached t = 0.29 s (lastSuccessfulTime), and others after it may too\n";
    assert!(done.code == 0 && done.stderr.contains(note), "{done:#?}");
    let done = run(&workshop("warning-in-step", &[]), &still);
    assert!(done.stderr.contains("note: b: 10 calls returned fmi3Warning\n"), "{done:#?}");
}

#[test]
fn an_isolated_crash_is_told_and_the_rows_are_kept() {
    for (defect, how) in [
        ("crash-in-step", "crashed with signal 11 (invalid memory access)"),
        ("exit-in-step", "ended the whole process with exit code 0"),
    ] {
        let workshop = workshop(defect, &[]);
        workshop.write("system.toml", system("u = [0, 0]", "u = [0, 0]", ""));
        let done = workshop.punctual(["run", "system.toml", "--isolate", "--out", "out"]);
        let error = format!("error: fmi3DoStep of b (b.fmu) at t = 0.2 s {how}\n");
        assert!(done.code == 1 && done.stderr.ends_with(&error), "{done:#?}");
        assert_eq!(rows(&workshop).column("time"), [0.0, 0.1]);
    }
}

#[test]
fn what_cannot_be_run_is_refused_in_plain_words() {
    let still = system("u = [0, 0]", "u = [0, 0]", "");
    run(&workshop("no-instance", &[]), &still).fails(
        1,
        "fmi3InstantiateCoSimulation of b (b.fmu) returned no instance\n  [fmi3Error, logStatusError] no licence",
    );
    // It is called again, with logging on.
    run(&workshop("no-instance-quiet", &[]), &still).fails(
        1,
        "fmi3InstantiateCoSimulation of b (b.fmu) returned no instance\n  [fmi3Error, logStatusError] no licence, said to who asks",
    );
    let run = |macros: &[&str]| run(&workshop("none", macros), &still);
    run(&["WITHOUT_RESET"]).fails(1, "b (b.fmu): its library does not export fmi3Reset");
    run(&["VERSION=\"2.0\""]).fails(1, "b (b.fmu): fmi3GetVersion answered \"2.0\", not FMI 3.0");

    let edited = |edits: &[(&str, &str)]| {
        let workshop = workshop("none", &[]);
        write_sundry(&workshop, "b.fmu", sundry("none", edits), &[]);
        workshop.write("system.toml", &still);
        workshop.punctual(["run", "system.toml"])
    };
    edited(&[("<CoSimulation ", "<ModelExchange ")]).fails(
        1,
        "b (b.fmu): cannot be run here: it offers ModelExchange only, and this program runs co-simulation; export it for that",
    );
    let clock =
        "<Clock name=\"tick\" valueReference=\"99\" causality=\"input\" intervalVariability=\"triggered\"/>";
    edited(&[("  </ModelVariables>", &format!("{clock}</ModelVariables>"))]).fails(
        1,
        "b (b.fmu): cannot be run here: it has clocks (tick), which need an importer with event mode; this program steps \
         without",
    );
    edited(&[("<Dimension start=\"2\"/>", "<Dimension start=\"2000000\"/>")]).fails(
        1,
        "b (b.fmu): refused: the elements of all variables are 6000007; allowed are at most 1000000",
    );
    edited(&[("<Output valueReference=\"4\"", "<Output valueReference=\"77\"")]).fails(
        1,
        "b (b.fmu): modelDescription.xml: ModelStructure names value reference 77, which no variable has",
    );
    edited(&[("<Dimension valueReference=\"1\"/>", "<Dimension valueReference=\"5\"/>")]).fails(
        1,
        "b (b.fmu): modelDescription.xml: the size of u is neither a number nor that of another variable",
    );
}

/// Both carry whole numbers. A number that is no item of the enumeration ends the run.
#[test]
fn whole_numbers_and_enumerations_are_connected() {
    let workshop = workshop("none", &[]);
    let wiring =
        [connection("a.out_int64", "b.in_enumeration"), connection("a.out_enumeration", "b.in_int64")]
            .concat();
    let run = |number: &str| {
        let a = format!("u = [0, 0], in_int64 = {number}, in_enumeration = 5000000000");
        run(&workshop, &system(&a, "u = [0, 0]", &wiring))
    };
    assert_eq!(run("5000000000").code, 0);
    let table = rows(&workshop);
    assert_eq!((table.column("b.out_enumeration")[10], table.column("b.out_int64")[10]), (5e9, 5e9));
    for number in ["0", "2", "-1", "4999999999"] {
        let done = run(number);
        let error = format!(
            "error: b.in_enumeration is given {number}; must be an item of its enumeration, 1, 5000000000\n"
        );
        assert!(done.code == 1 && done.stderr.ends_with(&error), "{done:#?}");
    }
    let other = |from: &str, to: &str, types: &str| {
        let done = self::run(&workshop, &system("u = [0, 0]", "u = [0, 0]", &connection(from, to)));
        done.fails(
            2,
            &format!(
                "system.toml: connection[0]: {types}; types must be equal, but for Integer and Enumeration, which are \
                 whole numbers both"
            ),
        );
    };
    other("a.out_boolean", "b.in_int8", "a.out_boolean is Boolean, but b.in_int8 is Int8");
    other("a.out_int8", "b.in_boolean", "a.out_int8 is Int8, but b.in_boolean is Boolean");
    other("a.z", "b.in_enumeration", "a.z is Float64, but b.in_enumeration is Enumeration");
    other(
        "a.out_enumeration",
        "b.in_float32",
        "a.out_enumeration is Enumeration, but b.in_float32 is Float32",
    );
    assert_eq!(run("5000000000").code, 0);
    workshop.punctual(["build", "system.toml", "-o", "x.ssp"]).fails(
        2,
        "system.toml: connection: a.out_int64 is Int64, but b.in_enumeration is Enumeration; an .ssp file connects outputs to \
         inputs of the same type only, though `punctual run` couples them",
    );
}

/// Parameters, unconnected inputs, and their elements are recorded if they are named.
#[test]
fn everything_that_is_a_number_can_be_recorded() {
    let workshop = workshop("none", &[]);
    let signals = "[record]\nsignals = [\"b.time\", \"b.in_int8\", \"b.n\", \"b.u\", \"b.last\"]\n";
    let start = "u = [0, 3], in_int8 = -7";
    let wiring = format!("{}{signals}", connection("a.z", "b.u[1]"));
    run(&workshop, &system("u = [1, 1]", start, &wiring)).success();
    let table = rows(&workshop);
    let last = |name: &str| *table.column(name).last().expect("a row");
    assert_eq!(["b.time", "b.in_int8", "b.n"].map(last), [1.0, -7.0, 2.0]);
    assert_eq!(["b.u[1]", "b.u[2]", "b.last"].map(last), [2.0, 3.0, 0.0]);
    let text = system("u = [1, 1]", "u = [1, 1]", "[record]\nsignals = [\"b.in_string\"]\n");
    run(&workshop, &text)
        .fails(2, "system.toml: record.signals[0]: b.in_string is String; text is not recorded");
}

/// `fmi3EnterInitializationMode` receives it.
#[test]
fn a_tolerance_reaches_the_fmu() {
    let workshop = workshop("shows-tolerance", &[]);
    let text = system("u = [0, 0]", "u = [0, 0]", "");
    for (edit, expected) in [("", 0.0), ("tolerance = 1e-5\n", 1e-5)] {
        run(&workshop, &text.replacen("step = 0.1\n", &format!("step = 0.1\n{edit}"), 1)).success();
        assert_eq!(rows(&workshop).column("b.s")[10], expected);
    }
}

/// The findings of `punctual validate` on the FMU with this defect.
fn tried(defect: &str, macros: &[&str], options: &[&str]) -> (i32, Vec<String>) {
    let workshop = Workshop::new();
    write_sundry(&workshop, "x.fmu", sundry(defect, &[]), macros);
    listed(&workshop, options)
}

#[test]
fn a_trial_finds_what_a_sound_fmu_does_not_do() {
    assert_eq!(tried("none", &[], &[]), (0, vec![]));
    let step = "trial: fmi3DoStep of trial (x.fmu) at t = 0.2 s";
    for (defect, expected) in [
        (
            "crash-in-step",
            "error trial.crash trial: in fmi3DoStep at t = 0.2 s the FMU crashed with signal 11",
        ),
        (
            "crash-in-exit",
            "error trial.crash trial: in fmi3ExitInitializationMode at t = 0 s the FMU crashed",
        ),
        (
            "exit-in-step",
            "error trial.crash trial: in fmi3DoStep at t = 0.2 s the FMU ended the whole process",
        ),
        (
            "error-in-step",
            &*format!("error trial.call {step} returned fmi3Error\n  [fmi3Error, logStatusError] 100% wrong"),
        ),
        ("fatal-in-step", &*format!("error trial.call {step} returned fmi3Fatal")),
        ("discard-in-step", &*format!("warning trial.discard {step} returned fmi3Discard")),
        ("early-in-step", "error trial.call trial: fmi3DoStep of trial (x.fmu) at t = 0.3 s came back early"),
        (
            "event-in-step",
            "error trial.call trial: fmi3DoStep of trial (x.fmu) at t = 0.3 s asked for event mode",
        ),
        ("warning-in-step", "warning trial.warning trial: 23 calls returned fmi3Warning"),
        (
            "no-instance",
            "error trial.call trial: fmi3InstantiateCoSimulation of trial (x.fmu) returned no instance",
        ),
        ("one-instance", "warning trial.instances trial: a second instance beside trial fails"),
        (
            "wrong-start",
            "warning trial.start trial m[1,1]: is 7 after initialisation; the description says start = 1",
        ),
        ("no-reset", "warning trial.reset trial y[1]: is 10 at the end of a second run after fmi3Reset"),
        ("null-string", "warning trial.text trial out_string: fmi3GetString gave NULL; must give a text"),
        (
            "string-at-1",
            "error trial.call trial: fmi3GetString of trial (x.fmu) at t = 0.1 s gave an address that cannot be read",
        ),
        ("wrong-derivative", "warning trial.derivative trial z: its directional derivative by u[1] is 2.5"),
        ("wrong-adjoint", "warning trial.derivative trial z: its adjoint derivative by u[1] gives"),
    ] {
        let (_, found) = tried(defect, &[], &[]);
        assert!(found.first().is_some_and(|first| first.starts_with(expected)), "{defect}: {found:#?}");
    }
    let (_, found) = tried("hang-in-step", &[], &["--time-limit", "1.5"]);
    let late = "error trial.time trial: in fmi3DoStep at t = 0.2 s the FMU had been at work for 1.";
    assert!(found.len() == 1 && found[0].starts_with(late), "{found:#?}");
    let (_, found) = tried("none", &["VERSION=\"3.9\""], &[]);
    assert_eq!(found, ["error trial.version trial: fmi3GetVersion answered \"3.9\"; must be \"3.0\""]);
}

/// An incompletely saved state shows when the inputs affect the missing part: in a step that is repeated.
#[test]
fn a_trial_takes_steps_back() {
    for (defect, expected) in
        [("state-forgets", "after it was set back"), ("bytes-forget", "after its state went through bytes")]
    {
        let workshop = Workshop::new();
        let moving = [("start=\"0 0\"", "start=\"1 1\"")];
        write_sundry(&workshop, "x.fmu", sundry(defect, &moving), &["MOVING"]);
        let (_, found) = listed(&workshop, &[]);
        let printed = found
            .iter()
            .any(|f| f.starts_with("warning trial.state trial y[1]: is ") && f.contains(expected));
        assert!(printed, "{defect}: {found:#?}");
    }
}

#[test]
fn a_trial_needs_what_it_can_run() {
    let workshop = Workshop::new();
    let clock =
        "<Clock name=\"tick\" valueReference=\"99\" causality=\"input\" intervalVariability=\"triggered\"/>";
    let edits = [
        ("  </ModelVariables>", &*format!("{clock}</ModelVariables>")),
        ("providesAdjointDerivatives=\"true\"", "providesAdjointDerivatives=\"true\" hasEventMode=\"true\""),
    ];
    write_sundry(&workshop, "x.fmu", sundry("none", &edits), &[]);
    let done = workshop.punctual(["validate", "x.fmu"]);
    let skipped =
        "note: not examined: the trial: it has clocks (tick), which need an importer with event mode";
    assert!(done.code == 0 && done.stderr.starts_with(skipped), "{done:#?}");
}
