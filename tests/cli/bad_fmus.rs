//! FMUs that cannot be used: the message names the file and its defect; the exit code is 1, since the usage
//! was right.

use punctual_cosim::host::PLATFORM;

use crate::running::system;
use crate::workshop::{Done, Workshop};

/// Runs the example with an edited plant.
fn run(edit: impl FnMut(&str, Vec<u8>) -> Option<Vec<u8>>) -> Done {
    let workshop = Workshop::with_fmus();
    workshop.edit_fmu("plant.fmu", edit);
    workshop.write("system.toml", system(&[]));
    workshop.punctual(["run", "system.toml"])
}

/// An edit of the model description.
fn description(from: &str, to: &str) -> impl FnMut(&str, Vec<u8>) -> Option<Vec<u8>> {
    move |entry, bytes| {
        if entry != "modelDescription.xml" {
            return Some(bytes);
        }
        let xml = String::from_utf8(bytes).expect("UTF-8");
        assert!(xml.contains(from), "{from:?} in {xml}");
        Some(xml.replacen(from, to, 1).into_bytes())
    }
}

#[test]
fn what_is_not_a_zip_archive() {
    let workshop = Workshop::with_fmus();
    workshop.write("plant.fmu", "not a zip archive");
    workshop.write("system.toml", system(&[]));
    for (arguments, who) in
        [(["inspect", "plant.fmu"], "plant.fmu"), (["run", "system.toml"], "plant (plant.fmu)")]
    {
        let begin = format!("{who}: not a readable FMU archive: ");
        workshop.punctual(arguments).fails_like(1, &begin, &["EOCD"]);
    }
}

#[test]
fn an_archive_that_was_cut_off() {
    let workshop = Workshop::with_fmus();
    let whole = workshop.bytes("plant.fmu");
    workshop.write("plant.fmu", &whole[..whole.len() / 2]);
    let done = workshop.punctual(["inspect", "plant.fmu"]);
    done.fails_like(1, "plant.fmu: not a readable FMU archive: ", &[]);
}

#[test]
fn an_archive_without_a_model_description() {
    run(|entry, bytes| (entry != "modelDescription.xml").then_some(bytes)).fails_like(
        1,
        "plant (plant.fmu): modelDescription.xml: cannot be read: ",
        &[],
    );
}

#[test]
fn a_guid_of_another_fmu() {
    let done = run(description("guid=\"{", "guid=\"{00000000-"));
    done.fails_like(
        1,
        "fmi2Instantiate of plant (plant.fmu) returned no instance\n  [fmi2Error, logStatusError] fmi2Instantiate: the GUID is \
         \"{00000000-",
        &["must be \"{", "the model description and resources/configuration.toml do not belong together"],
    );
}

#[test]
fn no_library_for_this_platform() {
    let mut moved = Vec::new();
    let done = run(|entry, bytes| {
        moved.push(entry.to_owned());
        (!entry.starts_with("binaries/")).then_some(bytes)
    });
    assert!(moved.iter().any(|entry| entry.starts_with(&format!("binaries/{PLATFORM}/"))), "{moved:?}");
    done.fails(1, &format!("plant (plant.fmu): holds no binary at all, so none for {PLATFORM}"));
}

#[test]
fn a_library_that_is_none() {
    let done =
        run(|entry, bytes| Some(if entry.starts_with("binaries/") { b"text".to_vec() } else { bytes }));
    // The loader's own message follows.
    done.fails_like(1, "plant (plant.fmu): its library cannot be loaded: ", &["unicycle"]);
}

#[test]
fn a_configuration_that_was_tampered_with() {
    let done = run(|entry, bytes| {
        let text = |bytes| String::from_utf8(bytes).expect("UTF-8");
        let touched = entry == "resources/configuration.toml";
        Some(if touched { text(bytes).replace("v = 0.0", "v = nan").into_bytes() } else { bytes })
    });
    done.fails_like(1, "fmi2Instantiate of plant (plant.fmu) returned no instance\n", &["x0.v: is NaN"]);
}

#[test]
fn another_version_of_fmi() {
    let done = run(description("fmiVersion=\"2.0\"", "fmiVersion=\"1.0\""));
    done.fails(
        1,
        "plant (plant.fmu): cannot be run here: it is of FMI 1.0, and this program is for FMI 2.0 and 3.0; export it again as \
         one of these",
    );
}
