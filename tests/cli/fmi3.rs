//! `punctual inspect` and `punctual validate` on FMUs of FMI 3.0: a sound one with every kind of variable,
//! and one defect at a time. Nothing is run here; the verdicts are compared with FMPy's in
//! `tests/interop/test_verdicts3.py`.

use std::fs;
use std::path::Path;

use punctual_modeldescription::Archive;
use serde_json::Value;

use crate::validating::listed;
use crate::workshop::{Workshop, assert_golden};

const TERMINALS: &str = "terminalsAndIcons/terminalsAndIcons.xml";
const BUILD: &str = "sources/buildDescription.xml";
const BUILD_XML: &str = "<fmiBuildDescription fmiVersion=\"3.0\"><BuildConfiguration modelIdentifier=\"everything\">\
    <SourceFileSet><SourceFile name=\"all.c\"/></SourceFileSet></BuildConfiguration></fmiBuildDescription>";

fn fixture(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures").join(name);
    fs::read_to_string(path).expect("the fixture")
}

/// Writes `x.fmu` with the fixtures and source code, after replacing one text of one entry, which must occur.
fn write(workshop: &Workshop, entry: &str, from: &str, to: &str) {
    let mut archive = Archive::new();
    for (name, text) in [
        ("modelDescription.xml", fixture("description3.xml")),
        (TERMINALS, fixture("terminals3.xml")),
        (BUILD, BUILD_XML.to_owned()),
        ("sources/all.c", "int all;\n".to_owned()),
    ] {
        let edited = if name == entry { text.replacen(from, to, 1) } else { text.clone() };
        assert!(name != entry || from.is_empty() || edited != text, "{from:?} in {text}");
        archive.add(name, edited).expect("an entry");
    }
    workshop.write("x.fmu", archive.to_bytes().expect("an archive"));
}

/// The findings on the edited FMU, except the missing library.
fn findings(entry: &str, from: &str, to: &str) -> Vec<String> {
    let workshop = Workshop::new();
    write(&workshop, entry, from, to);
    let (_, found) = listed(&workshop, &["--no-trial"]);
    found.into_iter().filter(|finding| !finding.starts_with("warning archive.platform ")).collect()
}

#[test]
fn the_fixture_is_sound() {
    assert_eq!(findings("", "", ""), [""; 0]);
}

#[test]
fn each_defect_has_its_finding() {
    let description = "modelDescription.xml";
    // Entry, text, its replacement, and the beginning of the only finding.
    for (entry, from, to, expected) in [
        (
            description,
            "start=\"1 2 3\"",
            "start=\"1 2\"",
            "error variable.length modelDescription.xml:26 u: has 2 start values; must have 1 or 3, as the dimensions say: 3",
        ),
        (
            description,
            "start=\"-3\"",
            "start=\"-2147483649\"",
            "error schema.value modelDescription.xml:39 count: Int32: start is \"-2147483649\"; must be integers of 32 bits, with blanks between them",
        ),
        (
            description,
            "value=\"0fA0\"",
            "value=\"0fA\"",
            "error schema.value modelDescription.xml:44 blob: Start: value is \"0fA\"; must be bytes in hexadecimal digits, such as 0FA0",
        ),
        (
            description,
            "name=\"force\"",
            "name=\"x\"",
            "error variable.unique modelDescription.xml:34 x: the name \"x\" is also that of variable 3 (from 1)",
        ),
        (
            description,
            "valueReference=\"9\"",
            "valueReference=\"8\"",
            "error variable.reference modelDescription.xml:39 count: has the value reference 8, which is that of \"rearm\"; ",
        ),
        (
            description,
            "fmiVersion=\"3.0\"",
            "fmiVersion=\"3.00\"",
            "error schema.value modelDescription.xml:2: fmiModelDescription: fmiVersion is \"3.00\"; must be \"3.0\"",
        ),
        (
            description,
            "<InitialUnknown valueReference=\"6\"/>",
            "",
            "error structure.initial-unknowns modelDescription.xml:52: InitialUnknown does not list \"total\" (value reference 6)",
        ),
        (
            TERMINALS,
            "variableName=\"u\"",
            "variableName=\"v\"",
            "error terminal.member terminalsAndIcons/terminalsAndIcons.xml:5: the terminal \"vehicle\" names \"v\"; must name a variable",
        ),
        (
            TERMINALS,
            " matchingRule=\"bus\"",
            "",
            "error schema.attribute terminalsAndIcons/terminalsAndIcons.xml:4: Terminal has no attribute matchingRule, which it must have",
        ),
        (
            TERMINALS,
            "</Terminals>",
            "",
            "error xml.readable terminalsAndIcons/terminalsAndIcons.xml:9: is not well-formed XML: ",
        ),
        (
            BUILD,
            "name=\"all.c\"",
            "name=\"some.c\"",
            "error archive.companion sources/buildDescription.xml:1: there is no \"sources/some.c\", which it names",
        ),
        (
            BUILD,
            "modelIdentifier=\"everything\"",
            "modelIdentifier=\"other\"",
            "error archive.companion sources/buildDescription.xml:1: modelIdentifier is \"other\", which is that of no interface",
        ),
    ] {
        let found = findings(entry, from, to);
        assert!(found.len() == 1 && found[0].starts_with(expected), "wanted {expected:?}, found {found:#?}");
    }
}

#[test]
fn the_text_of_inspect() {
    let workshop = Workshop::new();
    write(&workshop, "", "", "");
    assert_golden("inspect-fmi3.txt", &workshop.punctual(["inspect", "x.fmu"]).success());
}

#[test]
fn the_json_of_inspect() {
    let workshop = Workshop::new();
    write(&workshop, "", "", "");
    let text = workshop.punctual(["inspect", "--json", "x.fmu"]).success();
    let report: Value = serde_json::from_str(&text).expect("JSON");
    assert_eq!(
        (&report["fmi_version"], &report["instantiation_token"]),
        (&"3.0".into(), &"{everything}".into())
    );
    assert_eq!(report["guid"], Value::Null);
    let interfaces = report["interfaces"].as_array().expect("a list");
    let kinds: Vec<&Value> = interfaces.iter().map(|interface| &interface["kind"]).collect();
    assert_eq!(kinds, ["ModelExchange", "CoSimulation"]);
    assert_eq!(interfaces[1]["can_handle_variable_communication_step_size"], true);
    let variable = |name: &str| {
        let variables = report["variables"].as_array().expect("a list");
        variables.iter().find(|v| v["name"] == name).unwrap_or_else(|| panic!("{name} in {text}")).clone()
    };
    assert_eq!(variable("u")["dimensions"], serde_json::json!(["size"]));
    assert_eq!(variable("gain")["dimensions"], serde_json::json!([2, 2]));
    assert_eq!(variable("u")["aliases"], serde_json::json!(["force"]));
    assert_eq!((&variable("x")["unit"], &variable("x")["min"]), (&"m".into(), &(-5.0).into()));
    assert_eq!(report["states"], serde_json::json!(["x"]));
    assert_eq!(report["dependencies"][1], serde_json::json!({"output": "mode", "on": ["u", "rearm"]}));
    assert_eq!(report["terminals"][0]["members"][1], serde_json::json!(["x", "x"]));
}

#[test]
fn what_breaks_the_standard_is_noted_and_model_exchange_alone_is_shown() {
    let workshop = Workshop::new();
    write(&workshop, "modelDescription.xml", "name=\"rearm\"", "name=\"x\"");
    let done = workshop.punctual(["inspect", "x.fmu"]);
    let note = "note: modelDescription.xml: the name \"x\" is also that of variable 5 (from 1)\n";
    assert_eq!((done.code, done.stderr.as_str()), (0, note));
    write(
        &workshop,
        "modelDescription.xml",
        "<CoSimulation modelIdentifier=\"everything\" canHandleVariableCommunicationStepSize=\"true\" canGetAndSetFMUState=\"true\" canSerializeFMUState=\"true\"/>",
        "",
    );
    let text = workshop.punctual(["inspect", "x.fmu"]).success();
    assert!(text.contains("interfaces  model exchange\n"), "{text}");
}
