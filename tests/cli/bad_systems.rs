//! `punctual run` with system files that cannot be used: the message names file, field, value and the allowed
//! values; the exit code is 2.

use crate::running::system;
use crate::workshop::{Done, Workshop};

/// Runs the example's system with one edit.
fn run(from: &str, to: &str) -> Done {
    let workshop = Workshop::with_fmus();
    workshop.write("system.toml", system(&[(from, to)]));
    workshop.punctual(["run", "system.toml", "--out", "out"])
}

#[test]
fn an_unknown_key() {
    let done = run("stop_time", "stop");
    done.fails(2, "system.toml: experiment.stop: is an unknown key (did you mean stop_time?) (line 7)");
}

/// Whatever is wrong with a picture, the message names the key and what is allowed.
#[test]
fn a_picture_with_a_wrong_value() {
    let cases = [
        ("", "kind: missing, it must be given"),
        ("kind = \"pie\"", "kind: is \"pie\", must be \"path\" or \"time\""),
        ("kind = 4", "kind: is 4, must be \"path\" or \"time\""),
        ("kind = \"time\"", "signals: missing, it must be given"),
        ("kind = \"time\"\nsignals = 3", "signals: is 3, must be a list"),
        ("kind = \"time\"\nsignals = [3]", "signals[0]: is 3, must be a text in quotes"),
        ("kind = \"time\"\nsignals = []\ndeadline = \"3\"", "deadline: is \"3\", must be a number"),
        (
            "kind = \"time\"\nsignals = []\nscale = \"lg\"",
            "scale: is \"lg\", must be \"linear\", \"clipped\" or \"log\"",
        ),
        (
            "kind = \"time\"\nsignals = []\nx = \"a.b\"",
            "x: is an unknown key; the keys are name, title, signals, ",
        ),
        ("kind = \"path\"\nx = \"a.b\"", "y: missing, it must be given"),
        ("kind = \"path\"\nx = \"a.b\"\ny = 1.5", "y: is 1.5, must be a text in quotes"),
        (
            "kind = \"path\"\nx = \"a.b\"\ny = \"a.c\"\ndiscs = [{ centre = [1.0], radius = 2.0 }]",
            "discs[0].centre: has 1 entry, must have 2",
        ),
    ];
    let workshop = Workshop::with_fmus();
    for (keys, message) in cases {
        workshop.write("system.toml", system(&[]) + &format!("\n[[plot]]\n{keys}\n"));
        let begins = format!("system.toml: plot[0].{message}");
        workshop.punctual(["run", "system.toml"]).fails_like(2, &begins, &["(line "]);
    }
}

#[test]
fn a_connection_from_an_unknown_variable() {
    run("plant.x.v", "plant.x.w").fails(
        2,
        "system.toml: connection[0].from: plant (plant.fmu) has no variable \"x.w\" (did you mean x.v?)",
    );
}

#[test]
fn a_connection_to_an_unknown_variable_with_one_like_it() {
    run("filter.u_ref.a", "filter.uref.a").fails(
        2,
        "system.toml: connection[0].to: filter (filter.fmu) has no variable \"uref.a\"; did you mean u_ref.a or \
         u.a or u_min.a?",
    );
}

#[test]
fn a_connection_to_an_unknown_component() {
    run("filter.u_ref.a", "controller.u_ref.a")
        .fails(2, "system.toml: connection[0].to: no component \"controller\"; there are filter, plant");
}

#[test]
fn a_connection_in_the_wrong_direction() {
    run("plant.x.v", "plant.u.a")
        .fails(2, "system.toml: connection[0].from: plant.u.a has causality input; must be output or local or calculatedParameter");
}

#[test]
fn a_start_value_out_of_range() {
    let start = "fmu = \"filter.fmu\"\nstart = { \"goal.deadline\" = -1.0 }";
    run("fmu = \"filter.fmu\"", start)
        .fails(2, "system.toml: component[0].start.\"goal.deadline\": is -1 s; must be ≥ 1e-9 s");
}

#[test]
fn a_start_value_that_is_not_a_number() {
    let start = "fmu = \"plant.fmu\"\nstart = { \"x0.v\" = nan }";
    run("fmu = \"plant.fmu\"", start)
        .fails(2, "system.toml: component[1].start.\"x0.v\": is NaN; must be finite");
}

/// The suggested header has the keys of the enclosing tables, without indices.
#[test]
fn start_values_as_a_list_of_tables() {
    run("fmu = \"filter.fmu\"", "fmu = \"filter.fmu\"\nstart = [{ \"goal.deadline\" = 9.0 }]").fails(
        2,
        "system.toml: component[0].start: is a list, must be a table; one table is written [component.start] (line 13)",
    );
}

#[test]
fn a_start_value_of_an_output() {
    let start = "fmu = \"plant.fmu\"\nstart = { \"x.v\" = 1.0 }";
    run("fmu = \"plant.fmu\"", start).fails(
        2,
        "system.toml: component[1].start.\"x.v\": has causality output; only parameters and inputs can be given a \
         start value",
    );
}

#[test]
fn bounds_that_contradict_each_other() {
    let start = "fmu = \"filter.fmu\"\nstart = { \"u_min.a\" = 2.0, \"u_max.a\" = 1.0 }";
    run("fmu = \"filter.fmu\"", start).fails_like(
        1,
        "fmi2ExitInitializationMode of filter (filter.fmu) at t = 0 s returned fmi2Error\n",
        &["[2, 1]", "min <= max"],
    );
}

#[test]
fn an_fmu_that_is_missing() {
    run("plant.fmu", "plants.fmu").fails(
        2,
        "system.toml: component[1].fmu: there is no file plants.fmu; it is an FMU, or the .toml file that `punctual build` makes one from",
    );
}

#[test]
fn a_configuration_instead_of_a_system_file() {
    let workshop = Workshop::new();
    workshop.write("my.toml", "kind = \"plant\"\n[plant]\nmodel = \"unicycle\"\n");
    workshop.punctual(["run", "my.toml"]).fails(
        2,
        "my.toml: kind: is \"plant\"; must be \"filter\", which runs with its own model, or a system file, which couples \
         components",
    );
}

#[test]
fn what_is_not_toml() {
    let workshop = Workshop::new();
    workshop.write("my.toml", "[experiment\n");
    workshop.punctual(["run", "my.toml"]).fails_like(
        2,
        "my.toml: TOML parse error at line 1",
        &["[experiment"],
    );
}

#[test]
fn a_file_that_is_missing() {
    Workshop::new().punctual(["run", "my.toml"]).fails_like(2, "cannot read my.toml: ", &[]);
}

/// The input of the plant overflows immediately; the FMU names the time.
const OVERFLOW: (&str, &str) = (
    "factor = -1.0",
    "factor = -1.0\n[[connection]]\nfrom = \"filter.u.a\"\nto = \"plant.u.a\"\nfactor = 1e308",
);

#[test]
fn a_run_that_fails_on_the_way() {
    let workshop = Workshop::with_fmus();
    workshop.write("system.toml", system(&[OVERFLOW]));
    workshop.punctual(["run", "system.toml"]).fails(
        1,
        "fmi2DoStep of plant (plant.fmu) at t = 0 s returned fmi2Error\n  [fmi2Error, logStatusError] fmi2DoStep: \
         u.a is inf, must be finite for a step from t = 0",
    );
    // The recorded rows are kept: the header and the row of t = 0.
    let done = workshop.punctual(["run", "system.toml", "--out", "out"]);
    assert_eq!(done.code, 1);
    assert!(done.stderr.contains("note: what was recorded until then is in out/system.csv"), "{done:?}");
    assert_eq!(workshop.text("out/system.csv").lines().count(), 2);
}

/// The failure is reported before the run, which may be long.
#[test]
fn an_output_folder_that_is_a_file() {
    let workshop = Workshop::with_fmus();
    workshop.write("system.toml", system(&[OVERFLOW]));
    workshop.write("out", "");
    workshop.punctual(["run", "system.toml", "--out", "out"]).fails_like(2, "cannot create out: ", &[]);
}
