//! `fmi2Instantiate`: refusals with their messages, and names and paths of every kind.

use std::ffi::{CString, c_int};
use std::ptr::{null, null_mut};

use punctual_fmu::configuration::RESOURCE;

use crate::api::{API, Callbacks, Component, ERROR};
use crate::fmu::{FILTER, Fmu, PLANT};
use crate::slave::{Log, Slave};

/// Arguments of `fmi2Instantiate`; `None` is NULL.
struct Arguments {
    name: Option<CString>,
    kind: c_int,
    guid: Option<CString>,
    location: Option<CString>,
    logging: bool,
}

fn c(text: impl Into<Vec<u8>>) -> Option<CString> {
    Some(CString::new(text).unwrap())
}

impl Arguments {
    fn of(fmu: &Fmu) -> Self {
        let (guid, location) = (c(fmu.guid()), c(fmu.location()));
        Self { name: c("name"), kind: 1, guid, location, logging: false }
    }

    fn instantiate(&self, callbacks: *const Callbacks) -> Component {
        let text = |t: &Option<CString>| t.as_ref().map_or(null(), |t| t.as_ptr());
        let (name, guid, location) = (text(&self.name), text(&self.guid), text(&self.location));
        (API.instantiate)(name, self.kind, guid, location, callbacks, 0, c_int::from(self.logging))
    }

    /// Asserts NULL and returns the one message.
    fn refused(&self) -> String {
        let log = Log::default();
        let callbacks = log.callbacks();
        let component = self.instantiate(&raw const callbacks);
        assert!(component.is_null());
        // Without callbacks, or without a logger, there is nobody to tell, but it must not crash.
        assert!(self.instantiate(null()).is_null());
        let silent = Callbacks { logger: None, ..callbacks };
        assert!(self.instantiate(&raw const silent).is_null());
        let entries = log.entries();
        assert_eq!(entries.len(), 1, "{entries:?}");
        assert!(!entries[0].message.contains('%'), "{entries:?}");
        log.failure()
    }

    /// Asserts that there is an instance, frees it and returns the log.
    fn accepted(&self) -> Log {
        let log = Log::default();
        let callbacks = log.callbacks();
        let component = self.instantiate(&raw const callbacks);
        assert!(!component.is_null(), "{:?}", log.messages());
        (API.free_instance)(component);
        log
    }
}

#[test]
fn wrong_guid() {
    let fmu = Fmu::new(FILTER);
    let wrong = "{11111111-2222-3333-4444-555555555555}";
    let message = Arguments { guid: c(wrong), ..Arguments::of(&fmu) }.refused();
    let version = env!("CARGO_PKG_VERSION");
    let wanted = format!(
        "fmi2Instantiate: the GUID is \"{wrong}\", must be \"{}\" (library version {version}): the model \
         description and resources/configuration.toml do not belong together",
        fmu.guid()
    );
    assert_eq!(message, wanted);
    // The GUID of another FMU, without braces, with a blank, empty.
    let other = Fmu::new(PLANT);
    let bare = fmu.guid().trim_matches(['{', '}']);
    for guid in [other.guid(), bare, &format!("{} ", fmu.guid()), "", "%s%n"] {
        let message = Arguments { guid: c(guid), ..Arguments::of(&fmu) }.refused();
        assert!(message.contains("the GUID is") && message.contains(fmu.guid()), "{message}");
    }
}

#[test]
fn null_guid_and_null_location() {
    let fmu = Fmu::new(FILTER);
    let message = Arguments { guid: None, ..Arguments::of(&fmu) }.refused();
    assert_eq!(message, "fmi2Instantiate: fmuGUID is NULL");
    let message = Arguments { location: None, ..Arguments::of(&fmu) }.refused();
    assert_eq!(message, "fmi2Instantiate: fmuResourceLocation is NULL");
}

#[test]
fn model_exchange_and_unknown_types() {
    for configuration in [FILTER, PLANT] {
        let fmu = Fmu::new(configuration);
        for kind in [0, 2, -1] {
            let message = Arguments { kind, ..Arguments::of(&fmu) }.refused();
            let wanted = "must be 1 (fmi2CoSimulation): the FMU is one of co-simulation";
            assert_eq!(message, format!("fmi2Instantiate: fmuType is {kind}, {wanted}"));
        }
    }
}

#[test]
fn missing_resources() {
    let fmu = Fmu::new(FILTER);
    for location in ["file:///nonexistent/resources", "", "nonexistent", "file:", "file:///tmp/%00"] {
        let message = Arguments { location: c(location), ..Arguments::of(&fmu) }.refused();
        assert!(message.starts_with("fmi2Instantiate: cannot read "), "{location}: {message}");
        assert!(message.contains(RESOURCE), "{location}: {message}");
    }
    let message = Arguments { location: c("https://host/resources"), ..Arguments::of(&fmu) }.refused();
    let wanted = "fmi2Instantiate: the resource location is \"https://host/resources\", must be a file URI";
    assert_eq!(message, wanted);
}

#[test]
fn null_callbacks_and_null_logger_are_fine() {
    let fmu = Fmu::new(FILTER);
    let arguments = Arguments { logging: true, ..Arguments::of(&fmu) };
    let silent = Callbacks { logger: None, ..Log::default().callbacks() };
    let nobody = Callbacks { environment: null_mut(), ..silent };
    for callbacks in [null(), &raw const nobody] {
        let component = arguments.instantiate(callbacks);
        assert!(!component.is_null());
        // A failure without a logger.
        assert_eq!((API.do_step)(component, 0.0, 0.1, 0), ERROR);
        (API.free_instance)(component);
    }
}

/// The callbacks structure still belongs to the importer, who may free or overwrite it immediately.
#[test]
fn callbacks_are_copied() {
    let (fmu, log) = (Fmu::new(FILTER), Log::default());
    let mut callbacks = log.callbacks();
    let component = Arguments::of(&fmu).instantiate(&raw const callbacks);
    callbacks.logger = None;
    callbacks.environment = null_mut();
    std::hint::black_box(&callbacks);
    assert_eq!((API.do_step)(component, 0.0, 0.1, 0), ERROR);
    assert!(log.failure().contains("fmi2DoStep"));
    (API.free_instance)(component);
}

#[test]
fn instance_names_of_every_kind() {
    let fmu = Fmu::new(FILTER);
    for name in ["", "a b", "/tmp/a.fmu", "100%s%n", "\u{fc}ber", "same", "same", &"x".repeat(10_000)] {
        let log = Arguments { name: c(name), logging: true, ..Arguments::of(&fmu) }.accepted();
        assert!(!log.entries().is_empty(), "an event of {name:?}");
        assert!(log.entries().iter().all(|e| e.instance == name), "{:?}", log.entries());
    }
    let log = Arguments { name: None, logging: true, ..Arguments::of(&fmu) }.accepted();
    assert!(log.entries().iter().all(|e| e.instance.is_empty()), "{:?}", log.entries());
    // Bytes that are not UTF-8 are replaced.
    Arguments { name: c(*b"a\xffb"), logging: true, ..Arguments::of(&fmu) }.accepted();
}

/// The spellings of importers, for a folder with blanks, umlauts and percent signs.
#[test]
fn resource_locations_of_every_spelling() {
    for folder in ["plain", "with blank", "\u{fc}ml\u{e4}ut", "100%", "a%20b"] {
        let fmu = Fmu::below(folder, PLANT);
        let path = fmu.resources.to_str().unwrap();
        let encoded: String = path
            .bytes()
            .map(|b| match b {
                b'/' | b'.' | b'-' | b'_' => char::from(b).to_string(),
                b if b.is_ascii_alphanumeric() => char::from(b).to_string(),
                b => format!("%{b:02X}"),
            })
            .collect();
        for location in [
            format!("file://{encoded}"),
            format!("file://{encoded}/"),
            format!("file://{}", encoded.replace("%C3%BC", "%c3%bc")),
            format!("file:{encoded}"),
            format!("file:///{encoded}"),
            format!("file://localhost/{}", encoded.trim_start_matches('/')),
            format!("file://{path}"),
            format!("file://{path}/"),
            format!("file:///{path}"),
            path.to_owned(),
        ] {
            Arguments { location: c(location), ..Arguments::of(&fmu) }.accepted();
        }
    }
}

/// Defects of the configuration in the FMU; the messages themselves are tested in the crate.
#[test]
fn broken_configurations() {
    let fmu = Fmu::new(FILTER);
    let file = fmu.resources.join(RESOURCE);
    for (text, wanted) in [
        (
            FILTER.replace("deadline = 10.0", "deadline = -1.0"),
            "barrier[0].deadline: is -1, must be finite and >= 1e-9",
        ),
        (
            FILTER.replace("radius = 2.0", "radius = 0.0"),
            "barrier[0].radius: is 0, must be finite and >= 1e-9",
        ),
        (PLANT.replace("v = 2.0", "v = nan"), "x0.v: is NaN, must be finite"),
        (FILTER.replace("radius", "radus"), "barrier[0].radus: is an unknown key (did you mean radius?)"),
        (FILTER.replace("\"point_mass\"", "\"tank\""), "plant.model: is \"tank\", must be"),
        (FILTER.replace("kind", "knd"), "kind: missing, must be"),
        (FILTER.replace("2.0", "= 2.0"), "TOML parse error"),
        (FILTER.replace("name = \"goal\"", "name = \"100% %s %n\""), "barrier[0].name: is \"100? ?s ?n\""),
        (String::new(), "kind: missing, must be"),
    ] {
        std::fs::write(&file, &text).unwrap();
        let message = Arguments::of(&fmu).refused();
        assert!(message.contains(wanted), "{message} should contain {wanted}");
        assert!(message.contains(file.to_str().unwrap()), "{message} should name the file");
    }
    // A file that is not text, and a folder in its place.
    std::fs::write(&file, b"\xff\xfe\x00").unwrap();
    assert!(Arguments::of(&fmu).refused().contains("cannot read"));
    std::fs::remove_file(&file).unwrap();
    std::fs::create_dir(&file).unwrap();
    assert!(Arguments::of(&fmu).refused().contains("cannot read"));
}

/// The configuration was changed after the model description was written.
#[test]
fn an_edited_configuration_no_longer_fits_the_guid() {
    let fmu = Fmu::new(FILTER);
    let edited = FILTER.replace("radius = 2.0", "radius = 3.0");
    std::fs::write(fmu.resources.join(RESOURCE), edited).unwrap();
    assert!(Arguments::of(&fmu).refused().contains("do not belong together"));
}

/// Only `resources/configuration.toml` is read, once; the folder may then be removed.
#[test]
fn resources_are_not_needed_after_instantiation() {
    let fmu = Fmu::new(PLANT);
    let slave = Slave::new(&fmu);
    std::fs::remove_dir_all(&fmu.resources).unwrap();
    slave.initialize();
    slave.step(0.0, 0.1);
    slave.ok((API.reset)(slave.component));
    slave.initialize();
    slave.step(0.0, 0.1);
}

/// Only `resources/` and `binaries/` are certain to be extracted, and files beside them are not ours.
#[test]
fn the_model_description_beside_the_resources_is_never_read() {
    let fmu = Fmu::new(FILTER);
    let beside = fmu.resources.with_file_name("modelDescription.xml");
    assert!(!beside.exists());
    let wanted = Slave::ready(&fmu).snapshot();
    std::fs::write(&beside, "<fmiModelDescription guid='another'").unwrap();
    assert_eq!(Slave::ready(&fmu).snapshot(), wanted);
}
