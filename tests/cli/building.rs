//! `punctual build`: its output, its files, and that it writes the same again.

use std::fs;

use crate::workshop::{Workshop, examples, library, without_guids};

/// The filter of the example, as `filter.toml` in a folder with a library.
fn workshop() -> Workshop {
    let workshop = Workshop::with_library();
    workshop.write("filter.toml", fs::read(examples().join("unicycle-filter.toml")).expect("the example"));
    workshop
}

#[test]
fn every_example_configuration_is_built() {
    let workshop = Workshop::with_library();
    for (stem, says) in [
        ("unicycle-filter", "Fixed-time safety filter for a unicycle with 42 variables"),
        ("unicycle-plant", "Reference plant: unicycle with 11 variables"),
        ("escort-filter", "Fixed-time safety filter for a point mass in the plane with 67 variables"),
        ("escort-plant", "Reference plant: point mass in the plane with 11 variables"),
        ("tour-controller", "Nominal controller (waypoints) for a unicycle with 20 variables"),
    ] {
        let (toml, fmu) = (format!("{stem}.toml"), format!("{stem}.fmu"));
        workshop.write(&toml, fs::read(examples().join(&toml)).expect("an example"));
        let said = workshop.punctual(["build", &toml, "-o", &fmu]).success();
        assert_eq!(without_guids(&said), format!("{fmu}: {says}, guid {{GUID}}\n"));
    }
}

/// Beside the binary of `cargo build`, or in `deps/` beside it where only `cargo test` has run.
#[test]
fn the_library_beside_the_program_is_found() {
    let workshop = Workshop::new();
    workshop.write("filter.toml", fs::read(examples().join("unicycle-filter.toml")).expect("the example"));
    workshop.punctual(["build", "filter.toml", "-o", "x.fmu"]).success();
    let mut found = Vec::new();
    workshop.edit_fmu("x.fmu", |entry, bytes| {
        if entry.starts_with("binaries/") {
            found.clone_from(&bytes);
        }
        Some(bytes)
    });
    assert!(found == fs::read(library()).expect("the library"), "not the library of this build");
}

#[test]
fn the_option_goes_before_the_variable() {
    let workshop = workshop().with_variable("PUNCTUAL_FMU_LIBRARY", "nowhere.so");
    workshop.punctual(["build", "filter.toml", "-o", "x.fmu", "--library", "library"]).success();
    let done = workshop.punctual(["build", "filter.toml", "-o", "y.fmu"]);
    done.fails_like(2, "cannot read nowhere.so: ", &[]);
    // An empty variable is none.
    let workshop = workshop.with_variable("PUNCTUAL_FMU_LIBRARY", "");
    workshop.punctual(["build", "filter.toml", "-o", "z.fmu"]).success();
}

#[test]
fn a_library_that_is_none_leaves_no_fmu_behind() {
    let workshop = workshop();
    let done = workshop.punctual(["build", "filter.toml", "-o", "x.fmu", "--library", "filter.toml"]);
    // The loader's own words follow.
    done.fails_like(1, "x.fmu: its library cannot be loaded: ", &["unicycle_filter"]);
    assert_eq!(workshop.files(), ["filter.toml", "library"]);
}

#[test]
fn the_same_configuration_gives_the_same_bytes() {
    let workshop = workshop();
    let build = |workshop: &Workshop, name: &str| {
        workshop.punctual(["build", "filter.toml", "-o", name]).success();
        workshop.bytes(name)
    };
    let first = build(&workshop, "first.fmu");
    assert!(first == build(&workshop, "second.fmu"), "two builds differ");
    let earliest = workshop.with_variable("SOURCE_DATE_EPOCH", "315532800");
    assert!(first == build(&earliest, "third.fmu"), "the default is not 1980-01-01");
    let later = earliest.with_variable("SOURCE_DATE_EPOCH", "1767225600");
    let stamped = build(&later, "fourth.fmu");
    assert!(stamped == build(&later, "fifth.fmu"), "two builds of the same SOURCE_DATE_EPOCH differ");
    assert_eq!(first.len(), stamped.len());
    assert!(first != stamped, "SOURCE_DATE_EPOCH has no effect");
}

#[test]
fn a_time_that_no_archive_can_hold_is_refused() {
    for epoch in ["soon", "0", "4354819200"] {
        let workshop = workshop().with_variable("SOURCE_DATE_EPOCH", epoch);
        workshop.punctual(["build", "filter.toml", "-o", "x.fmu"]).fails(
            2,
            &format!(
                "SOURCE_DATE_EPOCH is {epoch:?}; allowed: seconds since 1970 in digits, 315532800 to 4354819199"
            ),
        );
        assert_eq!(workshop.files(), ["filter.toml", "library"]);
    }
}
