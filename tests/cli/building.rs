//! `punctual build`: its output, its files, and that it is reproducible.

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
        ("unicycle-filter", "Fixed-time safety filter for a unicycle with 43 variables"),
        ("unicycle-plant", "Reference plant: unicycle with 11 variables"),
        ("escort-filter", "Fixed-time safety filter for a point mass in the plane with 68 variables"),
        ("escort-plant", "Reference plant: point mass in the plane with 11 variables"),
        ("tour-controller", "Nominal controller (waypoints) for a unicycle with 20 variables"),
    ] {
        let (toml, fmu) = (format!("{stem}.toml"), format!("{stem}.fmu"));
        workshop.write(&toml, fs::read(examples().join(&toml)).expect("an example"));
        let said = workshop.punctual(["build", &toml, "-o", &fmu]).success();
        assert_eq!(without_guids(&said), format!("{fmu}: {says}, guid {{GUID}}\n"));
    }
}

/// Beside the binary of `cargo build`, or in its `deps/` if only `cargo test` has run.
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
fn both_versions_of_fmi() {
    let workshop = workshop();
    let said = workshop.punctual(["build", "filter.toml", "-o", "x.fmu", "--fmi", "both"]).success();
    let says = "Fixed-time safety filter for a unicycle with";
    let wanted = format!(
        "x.fmu: {says} 43 variables, guid {{GUID}}\nx-fmi3.fmu: {says} 44 variables, guid {{GUID}}\n"
    );
    assert_eq!(without_guids(&said), wanted);
    // The one of 2.0 is the same as without the option.
    workshop.punctual(["build", "filter.toml", "-o", "y.fmu"]).success();
    assert!(workshop.bytes("x.fmu") == workshop.bytes("y.fmu"));
    workshop.punctual(["build", "filter.toml", "-o", "z.fmu", "--fmi", "3"]).success();
    assert!(workshop.bytes("z.fmu") == workshop.bytes("x-fmi3.fmu"), "the same file");
    // `validate` finds nothing in them.
    workshop.punctual(["validate", "x-fmi3.fmu"]).success();
    workshop.punctual(["build", "filter.toml", "-o", "s.fmu", "--fmi", "3", "--scalars"]).success();
    workshop.punctual(["validate", "s.fmu"]).success();
    assert!(workshop.punctual(["inspect", "s.fmu"]).success().contains("x.x_p "));
    let message = "--scalars: is for FMI 3.0, such as `--fmi 3`; FMI 2.0 has no arrays";
    workshop.punctual(["build", "filter.toml", "-o", "n.fmu", "--scalars"]).fails(2, message);
    let message = "--fmi: is for one FMU; an .ssp file takes the FMUs that the system names as they are";
    workshop.punctual(["build", "filter.toml", "-o", "n.ssp", "--fmi", "3"]).fails(2, message);
}

#[test]
fn the_option_goes_before_the_variable() {
    let workshop = workshop().with_variable("PUNCTUAL_FMU_LIBRARY", "nowhere.so");
    workshop.punctual(["build", "filter.toml", "-o", "x.fmu", "--library", "library"]).success();
    let done = workshop.punctual(["build", "filter.toml", "-o", "y.fmu"]);
    done.fails_like(2, "cannot read nowhere.so: ", &[]);
    // An empty variable counts as unset.
    let workshop = workshop.with_variable("PUNCTUAL_FMU_LIBRARY", "");
    workshop.punctual(["build", "filter.toml", "-o", "z.fmu"]).success();
}

#[test]
fn a_library_that_is_none_leaves_no_fmu_behind() {
    let workshop = workshop();
    let done = workshop.punctual(["build", "filter.toml", "-o", "x.fmu", "--library", "filter.toml"]);
    done.fails_like(2, "filter.toml: library: is not a shared library: ", &[]);
    assert_eq!(workshop.files(), ["filter.toml", "library"]);
}

/// The library of this build, marked as one for another processor: in the header of an ELF file, that is the
/// second 16-bit word after the 16 bytes of identification.
fn foreign() -> Vec<u8> {
    const AARCH64: u16 = 183;
    let mut bytes = fs::read(library()).expect("the library");
    bytes[18..20].copy_from_slice(&AARCH64.to_le_bytes());
    bytes
}

#[test]
#[cfg(all(target_os = "linux", target_arch = "x86_64"))]
fn one_fmu_for_several_platforms() {
    let workshop = workshop();
    workshop.write("arm.so", foreign());
    let both = ["build", "filter.toml", "-o", "both.fmu", "--library", "library", "--library", "arm.so"];
    workshop.punctual(both).success();
    assert!(workshop.punctual(["inspect", "both.fmu"]).success().contains("aarch64-linux, linux64"));
    workshop.punctual(["validate", "both.fmu"]).success();
    // The result of merging two is the same, apart from the order of the files.
    for (library, name) in [("library", "here.fmu"), ("arm.so", "there.fmu")] {
        let done = workshop.punctual(["build", "filter.toml", "-o", name, "--library", library]);
        assert_eq!(done.stderr.contains("not tried: "), name == "there.fmu", "{}", done.stderr);
        done.success();
    }
    workshop.punctual(["merge", "here.fmu", "there.fmu", "-o", "joined.fmu"]).success();
    assert!(workshop.bytes("both.fmu") == workshop.bytes("joined.fmu"), "built and joined differ");
}

#[test]
#[cfg(all(target_os = "linux", target_arch = "x86_64"))]
fn libraries_that_do_not_go_together() {
    let workshop = workshop();
    workshop.write("arm.so", foreign());
    workshop.write("again.so", foreign());
    let mut other = foreign();
    let mark = other.windows(9).position(|part| part == b"punctual ").expect("the mark");
    for place in mark..other.len() - 9 {
        if other[place..].starts_with(b"punctual ") {
            other[place + 9] = b'9';
        }
    }
    workshop.write("other.so", other);
    let with = |libraries: &[&str]| {
        let mut command = vec!["build", "filter.toml", "-o", "x.fmu"];
        for library in libraries {
            command.extend(["--library", library]);
        }
        workshop.punctual(command)
    };
    with(&["arm.so", "again.so"])
        .fails(2, "again.so: library: is for aarch64-linux, as one before it; give one for each platform");
    let version = env!("CARGO_PKG_VERSION");
    with(&["library", "other.so"]).fails(
        2,
        &format!("other.so: library: is not the library of \"punctual {version}\", which this program is"),
    );
    assert!(!workshop.files().iter().any(|file| file == "x.fmu"));
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
