//! `punctual build` with configurations that cannot be used. The message names file, field, value and the
//! allowed values; the exit code is 2; nothing is written. (Every defect of every field is tested where
//! configurations are read; here each way to get there from the command line.)

use std::fs;

use crate::workshop::{Done, Workshop, examples};

/// Builds the example `stem` with one edit.
fn build(stem: &str, from: &str, to: &str) -> Done {
    let text = fs::read_to_string(examples().join(format!("{stem}.toml"))).expect("the example");
    assert_eq!(text.matches(from).count(), 1, "{from:?} in {text}");
    build_text(text.replace(from, to))
}

fn build_text(text: impl AsRef<[u8]>) -> Done {
    let workshop = Workshop::new();
    workshop.write("my.toml", text);
    let done = workshop.punctual(["build", "my.toml", "-o", "my.fmu"]);
    assert_eq!(workshop.files(), ["my.toml"]);
    done
}

#[test]
fn an_unknown_key() {
    build("unicycle-filter", "margin", "margn")
        .fails(2, "my.toml: barrier[0].margn: is an unknown key (did you mean margin?) (line 13)");
}

#[test]
fn a_negative_deadline() {
    build("unicycle-filter", "deadline = 10.0", "deadline = -1.0")
        .fails(2, "my.toml: barrier[0].deadline: is -1, must be finite and >= 1e-9");
}

#[test]
fn a_radius_of_zero() {
    build("unicycle-filter", "radius = 2.0", "radius = 0.0")
        .fails(2, "my.toml: barrier[0].radius: is 0, must be finite and >= 1e-9");
}

#[test]
fn a_start_value_that_is_not_a_number() {
    build("unicycle-plant", "x_p = 0.0", "x_p = nan").fails(2, "my.toml: x0.x_p: is NaN, must be finite");
}

#[test]
fn an_unknown_model() {
    build("unicycle-plant", "model = \"unicycle\"", "model = \"bike\"").fails(
        2,
        "my.toml: plant.model: is \"bike\", must be \"point_mass\", \"unicycle\", \"bicycle\", \"bicycle_small_slip\", \
         \"bicycle_small_slip_rate\", \"bicycle_kinematic\", \"bicycle_kinematic_angle\" or \
         \"bicycle_kinematic_slip\" (line 6)",
    );
}

#[test]
fn what_is_not_toml() {
    build_text("= what").fails_like(2, "my.toml: TOML parse error at line 1, column 1\n", &["= what"]);
}

#[test]
fn what_is_not_even_text() {
    build_text([0xff, 0xfe]).fails_like(2, "cannot read my.toml: ", &["UTF-8"]);
}

#[test]
fn a_system_file_instead_of_a_configuration() {
    let system = fs::read(examples().join("unicycle.toml")).expect("the example");
    build_text(system).fails(
        2,
        "my.toml: kind: missing: this is a system file, which `punctual run` takes, and `punctual build` with an \
         output that ends in .ssp",
    );
}

#[test]
fn a_file_that_is_missing() {
    let done = Workshop::new().punctual(["build", "my.toml", "-o", "my.fmu"]);
    done.fails_like(2, "cannot read my.toml: ", &[]);
}

#[test]
fn a_library_that_is_missing() {
    let workshop = Workshop::new();
    workshop.write("my.toml", fs::read(examples().join("unicycle-plant.toml")).expect("the example"));
    let done = workshop.punctual(["build", "my.toml", "-o", "my.fmu", "--library", "my.so"]);
    done.fails_like(2, "cannot read my.so: ", &[]);
}

#[test]
fn a_folder_that_is_missing() {
    let workshop = Workshop::with_library();
    workshop.write("my.toml", fs::read(examples().join("unicycle-plant.toml")).expect("the example"));
    let done = workshop.punctual(["build", "my.toml", "-o", "no/such/my.fmu"]);
    done.fails_like(2, "cannot write no/such/my.fmu: ", &[]);
}

/// A file in place of the folder, which is refused even to users who may write everywhere.
#[test]
fn a_demonstration_into_a_folder_that_cannot_be_made() {
    let workshop = Workshop::with_library();
    workshop.write("file", "");
    let done = workshop.punctual(["demo", "--out", "file/demo"]);
    done.fails_like(2, "cannot create file/demo: ", &[]);
}
