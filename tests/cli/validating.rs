//! `punctual validate` on files. A sound file passes; each defect of archive, description and library is
//! found by its rule, at its place, with the allowed values. Nothing is run here.

use serde_json::Value;

use crate::misbehaving::{self, description};
use crate::workshop::{Workshop, assert_golden};

/// The findings of the fixture with this description, as `severity rule position variable: message`.
pub(crate) fn findings(xml: impl Into<Vec<u8>>) -> Vec<String> {
    let workshop = Workshop::new();
    misbehaving::write(&workshop, "x.fmu", xml, &misbehaving::library(&[]));
    listed(&workshop, &["--no-trial"]).1
}

/// The exit code and findings of `x.fmu`.
pub(crate) fn listed(workshop: &Workshop, options: &[&str]) -> (i32, Vec<String>) {
    let arguments = ["validate", "x.fmu", "--json"].iter().chain(options);
    let done = workshop.punctual(arguments);
    let report: Value = serde_json::from_str(&done.stdout).unwrap_or_else(|e| panic!("{e}: {done:#?}"));
    let list = report["findings"].as_array().expect("a list");
    let errors = list.iter().filter(|f| f["severity"] == "error").count();
    assert_eq!(report["errors"], errors);
    assert_eq!(done.code, i32::from(errors > 0), "{done:#?}");
    let text = |value: &Value| value.as_str().unwrap_or_default().to_owned();
    let one = |f: &Value| {
        let place = &f["place"];
        let line = place["position"][0].as_u64().map(|line| format!(":{line}")).unwrap_or_default();
        let variable = place["variable"].as_str().map(|name| format!(" {name}")).unwrap_or_default();
        let (file, rule, message) = (text(&place["file"]), text(&f["rule"]), text(&f["message"]));
        format!("{} {rule} {file}{line}{variable}: {message}", text(&f["severity"]))
    };
    (done.code, list.iter().map(one).collect())
}

/// Asserts that the edit gives exactly one finding, which begins with `expected`.
#[track_caller]
fn one(from: &str, to: &str, expected: &str) {
    let found = findings(description("none", &[(from, to)]));
    let expected = expected.replacen("D:", "modelDescription.xml:", 1);
    assert!(found.len() == 1 && found[0].starts_with(&expected), "wanted {expected:?}, found {found:#?}");
}

/// Asserts that the edit gives a finding that begins with `expected`, among others that follow from it.
#[track_caller]
fn among(from: &str, to: &str, expected: &str) {
    let found = findings(description("none", &[(from, to)]));
    let expected = expected.replacen("D:", "modelDescription.xml:", 1);
    assert!(found.iter().any(|f| f.starts_with(&expected)), "wanted {expected:?}, found {found:#?}");
}

#[test]
fn the_fixture_is_sound() {
    assert_eq!(findings(description("none", &[])), [""; 0]);
}

#[test]
fn our_own_fmus_are_sound_and_run() {
    let workshop = Workshop::with_fmus();
    for name in ["filter.fmu", "plant.fmu"] {
        let done = workshop.punctual(["validate", name]);
        assert_eq!((done.stderr.as_str(), done.stdout), ("", format!("{name}: no errors, no warnings\n")));
    }
}

#[test]
fn the_text_of_a_report() {
    let workshop = Workshop::new();
    let edits = [
        ("max=\"100\"", "max=\"0.5\""),
        ("displayUnit=\"mm\"", "displayUnit=\"km\""),
        ("<String/>", "<Boolean/>"),
    ];
    misbehaving::write(
        &workshop,
        "x.fmu",
        description("none", &edits),
        &misbehaving::library(&["WITHOUT_RESET"]),
    );
    let done = workshop.punctual(["validate", "x.fmu", "--no-trial"]);
    assert_eq!((done.code, done.stderr.as_str()), (1, "note: not examined: the trial: it was not wanted\n"));
    assert_golden("validate.txt", &done.stdout);
}

#[test]
fn the_rules_are_listed() {
    assert_golden("validate-rules.txt", &Workshop::new().punctual(["validate", "--rules"]).success());
}

#[test]
fn wrong_usage() {
    let workshop = Workshop::new();
    workshop.punctual(["validate", "no.fmu"]).fails_like(2, "cannot read no.fmu: ", &[]);
    let done = workshop.punctual(["validate", "."]);
    assert!(
        done.code == 1 && done.stdout.contains("not a readable FMU archive: it is not a file"),
        "{done:#?}"
    );
    let done = workshop.punctual(["validate", "x.fmu", "--time-limit", "0"]);
    assert!(done.code == 2 && done.stderr.contains("must be seconds, 0.01 to 86400"), "{done:#?}");
}

#[test]
fn the_schema_on_elements() {
    among("<LogCategories>", "<LogCategories/><LogCategories>", "error schema.element D:11: ");
    among(
        "<ModelVariables>",
        "<Odd/><ModelVariables>",
        "error schema.element D:18: fmiModelDescription has an element Odd; allowed: ModelExchange, ",
    );
    one(
        "<Category name=\"logAll\"/>",
        "",
        "error schema.element D:11: LogCategories has no element Category, which it must have",
    );
    among(
        "<String/>",
        "",
        "error schema.element D:28 s: ScalarVariable has 0 of Real, Integer, Boolean, String, Enumeration; must have exactly one",
    );
    among("<String/>", "<String/><Integer/>", "error schema.element D:28 s: ScalarVariable has 2 of");
    among(
        "  <DefaultExperiment",
        "  <TypeDefinitions><SimpleType name=\"T\"><Boolean/></SimpleType></TypeDefinitions><DefaultExperiment",
        "error schema.element D:14: TypeDefinitions comes too late in fmiModelDescription; the order is ",
    );
    among("</ModelVariables>", "x</ModelVariables>", "error schema.text D:");
    among("fmiModelDescription fmi", "x:fmiModelDescription xmlns:x=\"urn:x\" fmi", "error xml.readable D:");
}

#[test]
fn the_schema_on_attributes_and_values() {
    one(
        " modelName=\"misbehaving\"",
        "",
        "error schema.attribute D:2: fmiModelDescription has no attribute modelName, which it must have",
    );
    one(
        "canHandle",
        "canHandel",
        "error schema.attribute D:3: CoSimulation has an attribute canHandelVariableCommunicationStepSize; allowed: modelIdentifier, ",
    );
    one(
        "StepSize=\"true\"",
        "StepSize=\"yes\"",
        "error schema.value D:3: CoSimulation: canHandleVariableCommunicationStepSize is \"yes\"; must be true, false, 1 or 0",
    );
    one(
        "2026-01-31T",
        "2026-02-31T",
        "error schema.value D:2: fmiModelDescription: generationDateAndTime is ",
    );
    among(
        "max=\"1000\"",
        "max=\"lots\"",
        "error schema.value D:20 y: Real: max is \"lots\"; must be a number such as 1.5e-3, INF, -INF or NaN",
    );
    among(
        "valueReference=\"1\"",
        "valueReference=\"-1\"",
        "error schema.value D:22 u: ScalarVariable: valueReference is \"-1\"; must be an integer, 0 to 4294967295",
    );
    among(
        "causality=\"input\"",
        "causality=\"inputs\"",
        "error schema.value D:22 u: ScalarVariable: causality is \"inputs\"; must be one of parameter, ",
    );
    among(
        "dependenciesKind=\"dependent\"",
        "dependenciesKind=\"free\"",
        "error schema.value D:34: Unknown: dependenciesKind is \"free\"; must be words out of ",
    );
    among(
        "fmiVersion=\"2.0\"",
        "fmiVersion=\"2.1\"",
        "error schema.value D:2: fmiModelDescription: fmiVersion is \"2.1\"; must be \"2.0\"",
    );
}

#[test]
fn rules_on_the_interface_and_the_experiment() {
    among(
        "modelIdentifier=\"misbehaving\"",
        "modelIdentifier=\"mis-behaving\"",
        "error interface.identifier D:3: modelIdentifier is \"mis-behaving\"; must be a C identifier",
    );
    one("guid=\"none\"", "guid=\" \"", "error interface.guid D:2: guid is empty");
    one(
        "canHandle",
        "canSerializeFMUstate=\"true\" canHandle",
        "warning interface.flags D:3: canSerializeFMUstate is true, so",
    );
    one(
        "stopTime=\"1\"",
        "stopTime=\"0\"",
        "error experiment.times D:14: stopTime is 0; must be greater than startTime = 0",
    );
    one(
        "stepSize=\"0.1\"",
        "stepSize=\"-0.1\"",
        "error experiment.times D:14: stepSize is -0.1; must be finite and > 0",
    );
    one(
        "stepSize=\"0.1\"",
        "stepSize=\"1.5\"",
        "warning experiment.step D:14: stepSize is 1.5; should be at most stopTime - startTime = 1, or no step fits",
    );
    one(
        "startTime=\"0\" stopTime=\"1\"",
        "startTime=\"0.95\" stopTime=\"1\"",
        "warning experiment.step D:14: stepSize is 0.1; should be at most stopTime - startTime = 0.05",
    );
    let exact = [("startTime=\"0\" stopTime=\"1\"", "startTime=\"0.2\" stopTime=\"0.3\"")];
    assert_eq!(findings(description("none", &exact)), [""; 0], "0.3 - 0.2 is a little less than 0.1");
    one(
        "<Category name=\"logAll\"/>",
        "<Category name=\"logAll\"/><Category name=\"logAll\" description=\"again\"/>",
        "error log.unique D:12: the log category \"logAll\" is defined twice",
    );
    one("tolerance=\"1e-4\"", "tolerance=\"NaN\"", "error experiment.times D:14: tolerance is NaN;");
    one(
        "<CoSimulation modelIdentifier=\"misbehaving\" canHandleVariableCommunicationStepSize=\"true\"/>",
        "",
        "error interface.co-simulation D:2: there is neither a CoSimulation nor a ModelExchange element",
    );
}

#[test]
fn rules_on_units_and_types() {
    one(
        "<Unit name=\"m\">",
        "<Unit name=\"m\"/><Unit name=\"m\">",
        "error unit.unique D:5: the unit \"m\" is defined twice",
    );
    one(
        "<Real unit=\"m\" max=\"1000\"/>",
        "<Real unit=\"s\"/>",
        "error unit.defined D:19 y: the unit \"s\" is not among UnitDefinitions",
    );
    one(
        "displayUnit=\"mm\"",
        "displayUnit=\"km\"",
        "error unit.defined D:22 u: the unit \"m\" has no display unit \"km\"",
    );
    one(
        "<String/>",
        "<String declaredType=\"T\"/>",
        "error type.defined D:28 s: declaredType \"T\" is not among TypeDefinitions",
    );
    one(
        "<String/>",
        "<String declaredType=\"Light\"/>",
        "error type.defined D:28 s: declaredType \"Light\" is a type of Enumeration; must be of String",
    );
    one("name=\"Light\"", "name=\"y\"", "error type.unique D:9: the type \"y\" has the name of a variable");
    among("name=\"Light\"", "name=\"Length\"", "error type.unique D:9: the type \"Length\" is defined twice");
    one(
        "value=\"2\"",
        "value=\"1\"",
        "error type.items D:9: the items \"red\" and \"green\" of \"Light\" have the same value 1",
    );
}

#[test]
fn units_with_factors_that_are_none() {
    for (factor, read) in [("0", "0"), ("0.0", "0"), ("NaN", "NaN"), ("INF", "inf"), ("-INF", "-inf")] {
        one(
            "<BaseUnit m=\"1\"/>",
            &format!("<BaseUnit m=\"1\" factor=\"{factor}\"/>"),
            &format!("error unit.factor D:5: the unit \"m\" has the factor {read}; must be finite and not 0"),
        );
        one(
            "factor=\"1000\"",
            &format!("factor=\"{factor}\""),
            &format!(
                "error unit.factor D:5: the unit \"mm\" has the factor {read}; must be finite and not 0"
            ),
        );
    }
}

/// Attributes for model exchange are refused without it, and ignored with it.
#[test]
fn attributes_of_model_exchange() {
    let reinit = ("<Real unit=\"m\" max=\"1000\"/>", "<Real unit=\"m\" max=\"1000\" reinit=\"true\"/>");
    let sets = ("causality=\"input\"", "causality=\"input\" canHandleMultipleSetPerTimeInstant=\"false\"");
    one(
        reinit.0,
        reinit.1,
        "error schema.exchange D:20 y: reinit is for model exchange, which this FMU does not",
    );
    one(
        sets.0,
        sets.1,
        "error schema.exchange D:22 u: canHandleMultipleSetPerTimeInstant is for model exchange",
    );
    let exchange = ("<CoSimulation", "<ModelExchange modelIdentifier=\"misbehaving\"/><CoSimulation");
    assert_eq!(findings(description("none", &[exchange, reinit, sets])), [""; 0]);
}

#[test]
fn rules_on_variables() {
    one(
        "name=\"u\"",
        "name=\"y\"",
        "error variable.unique D:22 y: the name \"y\" is also that of variable 1 (from 1)",
    );
    one(
        "name=\"u\"",
        "name=\"u[\"",
        "error variable.name D:22 u[: the name \"u[\" does not follow variableNamingConvention",
    );
    one(
        "causality=\"input\"",
        "causality=\"input\" variability=\"fixed\"",
        "error variable.combination D:22 u: causality = input with variability = fixed is not allowed; allowed variability: discrete, continuous",
    );
    one(
        "variability=\"fixed\"",
        "variability=\"fixed\" initial=\"calculated\"",
        "error variable.combination D:25 p: causality = parameter with variability = fixed does not go with initial = calculated; allowed: exact",
    );
    one(
        " variability=\"discrete\"",
        "",
        "error variable.continuous D:28 s: String variables cannot have variability = continuous",
    );
    one(
        "<Real start=\"0\" unit",
        "<Real unit",
        "error variable.start D:22 u: has no start value; must have one, because it is an input",
    );
    one(
        "<String/>",
        "<String start=\"x\"/>",
        "error variable.start D:29 s: has a start value; must have none, because initial = calculated",
    );
    one("start=\"1\"", "start=\"101\"", "error variable.range D:26 p: start is 101; must be in [0, 100]");
    one(
        "max=\"1000\"",
        "max=\"1\" min=\"2\"",
        "error variable.range D:19 y: has min = 2 and max = 1; must be min <= max",
    );
    one(
        "max=\"1000\"",
        "max=\"1000\" derivative=\"9\"",
        "error variable.derivative D:19 y: derivative is 9; must be the index of a variable, 1 to 4",
    );
    one("start=\"1\"", "start=\"NaN\"", "error variable.range D:26 p: start is NaN;");
}

#[test]
fn rules_on_aliases_and_enumerations() {
    let second = "<ScalarVariable name=\"q\" valueReference=\"2\" causality=\"parameter\" variability=\"fixed\"><Real start=\"2\"/></ScalarVariable></ModelVariables>";
    let found = findings(description("none", &[("</ModelVariables>", second)]));
    assert!(found[0].starts_with("error variable.alias-set modelDescription.xml:31 q: has the value reference 2 of \"p\", and both can be set"), "{found:#?}");
    assert!(
        found[1].ends_with(
            "q: has the value reference 2 of \"p\", so both are one, but starts at 2 and the other at 1"
        ),
        "{found:#?}"
    );
    let light = "<ScalarVariable name=\"q\" valueReference=\"7\" causality=\"parameter\" variability=\"fixed\"><Enumeration declaredType=\"Light\" start=\"3\"/></ScalarVariable></ModelVariables>";
    one(
        "</ModelVariables>",
        light,
        "error variable.enumeration D:31 q: start is 3; must be a value of Light: 1 red, 2 green",
    );
    let times = "<ScalarVariable name=\"t\" valueReference=\"8\" causality=\"independent\"><Real/></ScalarVariable><ScalarVariable name=\"w\" valueReference=\"9\" causality=\"independent\"><Real/></ScalarVariable></ModelVariables>";
    one("</ModelVariables>", times, "error variable.independent D:31 w: \"t\" is independent too");
}

#[test]
fn rules_on_the_structure() {
    let first = "<Unknown index=\"1\" dependencies=\"2\" dependenciesKind=\"dependent\"/>";
    one(first, "", "error structure.outputs D:33: Outputs does not list \"y\" (index 1)");
    one(first, &first.repeat(2), "error structure.outputs D:34: Outputs lists \"y\" (index 1) twice");
    one(
        first,
        &format!("{first}<Unknown index=\"3\" dependencies=\"\"/>"),
        "error structure.outputs D:34: Outputs lists \"p\" (index 3), which does not belong there",
    );
    one(
        first,
        &format!("{first}<Unknown index=\"5\" dependencies=\"\"/>"),
        "error structure.index D:34: Outputs: index is 5; must be that of a variable, 1 to 4",
    );
    one(
        "dependencies=\"2\"",
        "dependencies=\"9\"",
        "error structure.dependencies D:34: Outputs: dependencies name variable 9; must be 1 to 4",
    );
    one(
        "dependencies=\"2\"",
        "dependencies=\"2 3\"",
        "error structure.dependencies D:34: Outputs: 2 dependencies, but 1 words in dependenciesKind",
    );
    among(
        "dependencies=\"2\" ",
        "",
        "error structure.dependencies D:34: Outputs: there is dependenciesKind, but no dependencies",
    );
    one(
        " dependencies=\"2\" dependenciesKind=\"dependent\"",
        "",
        "warning structure.unsaid D:33: 1 of 2 Outputs have no dependencies",
    );
    let one_unknown =
        "<InitialUnknowns>\n      <Unknown index=\"1\" dependencies=\"2\" dependenciesKind=\"dependent\"/>";
    one(
        one_unknown,
        "<InitialUnknowns>",
        "error structure.initial-unknowns D:37: InitialUnknowns does not list \"y\" (index 1)",
    );
    let turned = "<InitialUnknowns><Unknown index=\"4\" dependencies=\"\"/><Unknown index=\"1\" dependencies=\"\"/></InitialUnknowns><!--";
    let found =
        findings(description("none", &[("<InitialUnknowns>", turned), ("</InitialUnknowns>\n", "-->")]));
    assert_eq!(
        found,
        [
            "error structure.order modelDescription.xml:37: InitialUnknowns has index 1 after 4; must be sorted by index"
        ]
    );
    let derivatives = "</Outputs><Derivatives><Unknown index=\"1\" dependencies=\"\"/></Derivatives>";
    one(
        "</Outputs>",
        derivatives,
        "error structure.derivatives D:36: Derivatives lists \"y\", which has no attribute derivative",
    );
}

#[test]
fn the_same_again_and_again_is_cut_short() {
    let many: String = (0..1000).map(|n| format!("<ScalarVariable name=\"v{n}\" valueReference=\"{n}\" causality=\"input\"><Integer start=\"0\"/></ScalarVariable>")).collect();
    let found = findings(description("none", &[("</ModelVariables>", &format!("{many}</ModelVariables>"))]));
    assert_eq!(found.len(), 20, "{found:#?}");
    assert!(found[19].ends_with("(and 980 more findings of this rule)"), "{found:#?}");
}

#[test]
fn libraries_that_are_none_or_lack_functions() {
    let with = |library: &[u8]| {
        let workshop = Workshop::new();
        misbehaving::write(&workshop, "x.fmu", description("none", &[]), library);
        let (code, found) = listed(&workshop, &[]);
        assert_eq!((code, found.len()), (1, 1), "{found:#?}");
        found[0].clone()
    };
    let lacks = with(&misbehaving::library(&["WITHOUT_STATE"]));
    assert!(lacks.starts_with("error symbols.missing binaries/"), "{lacks}");
    assert!(
        lacks.ends_with("does not export 1 of the 34 functions of FMI 2.0 co-simulation: fmi2GetFMUstate"),
        "{lacks}"
    );
    let exchange = "<ModelExchange modelIdentifier=\"misbehaving\"/><CoSimulation";
    let workshop = Workshop::new();
    let library = misbehaving::library(&["WITHOUT_EXCHANGE"]);
    misbehaving::write(&workshop, "x.fmu", description("none", &[("<CoSimulation", exchange)]), &library);
    let (_, found) = listed(&workshop, &[]);
    let wanted = "does not export 10 of the 10 functions of FMI 2.0 model exchange: fmi2EnterEventMode, ";
    assert!(found.len() == 1 && found[0].contains(wanted), "{found:#?}");
    let text = with(b"text");
    assert!(
        text.starts_with("error symbols.readable ") && text.contains("is not a shared library: "),
        "{text}"
    );
    let whole = misbehaving::library(&[]);
    let cut = with(&whole[..whole.len() / 3]);
    assert!(cut.starts_with("error symbols."), "{cut}");
}

/// The archive of the fixture, with the compression method of every entry changed to another.
#[test]
fn entries_compressed_in_other_ways() {
    for (method, name) in [
        (12_u16, "bzip2"),
        (14, "lzma"),
        (9, "deflate64"),
        (93, "zstd"),
        (95, "xz"),
        (1, "an unknown method, Unsupported(1)"),
    ] {
        let workshop = Workshop::new();
        misbehaving::write(&workshop, "x.fmu", description("none", &[]), &misbehaving::library(&[]));
        let mut bytes = std::fs::read(workshop.path("x.fmu")).expect("the archive");
        // The method is in the header of an entry, and in its record in the directory.
        for (head, at) in [(b"PK\x03\x04", 8), (b"PK\x01\x02", 10)] {
            let found = bytes.windows(4).position(|four| four == head).expect("an entry");
            bytes[found + at..][..2].copy_from_slice(&method.to_le_bytes());
        }
        workshop.write("x.fmu", bytes);
        let (code, found) = listed(&workshop, &[]);
        let entry = "the entry \"modelDescription.xml\" is compressed with";
        assert_eq!(
            (code, found),
            (1, vec![format!("error archive.compression : {entry} {name}; must be stored or deflated")])
        );
        let refused = workshop.punctual(["inspect", "x.fmu"]);
        assert!(refused.code == 1 && refused.stderr.contains(&format!("{entry} {name}")), "{refused:#?}");
    }
}

/// An archive with this platform's library and something else for another platform.
fn of_two_platforms(own: &[u8], other: &[u8], defect: &str) -> Workshop {
    let workshop = Workshop::new();
    let other_platform = if cfg!(windows) { "linux32/misbehaving.so" } else { "win32/misbehaving.dll" };
    let mut archive = punctual_modeldescription::Archive::new();
    archive.add("modelDescription.xml", description(defect, &[])).expect("an entry");
    let suffix = std::env::consts::DLL_SUFFIX;
    archive
        .add(&format!("binaries/{}/misbehaving{suffix}", punctual_cosim::host::PLATFORM), own)
        .expect("an entry");
    archive.add(&format!("binaries/{other_platform}"), other).expect("an entry");
    workshop.write("x.fmu", archive.to_bytes().expect("an archive"));
    workshop
}

/// A defect in the library of another platform does not prevent the trial of this one's.
#[test]
fn the_trial_runs_where_this_platforms_library_is_whole() {
    let (whole, broken) = (misbehaving::library(&[]), b"no library".as_slice());
    let workshop = of_two_platforms(&whole, broken, "error-in-step");
    let (_, found) = listed(&workshop, &[]);
    assert!(found.len() == 2 && found[0].starts_with("error symbols.readable binaries/"), "{found:#?}");
    assert!(found[1].starts_with("error trial.call trial: "), "it ran: {found:#?}");
    // A defective library for this platform is not run.
    for own in [broken.to_vec(), misbehaving::library(&["WITHOUT_STATE"])] {
        let workshop = of_two_platforms(&own, broken, "error-in-step");
        let done = workshop.punctual(["validate", "x.fmu"]);
        let wanted = format!(
            "note: not examined: the trial: the library is not complete for {}\n",
            punctual_cosim::host::PLATFORM
        );
        assert_eq!((done.code, done.stderr), (1, wanted));
    }
}

#[test]
fn libraries_at_the_wrong_place() {
    let workshop = Workshop::new();
    misbehaving::write(
        &workshop,
        "x.fmu",
        description("none", &[("modelIdentifier=\"misbehaving\"", "modelIdentifier=\"other\"")]),
        b"x",
    );
    let (_, found) = listed(&workshop, &[]);
    assert!(found.len() == 1 && found[0].starts_with("error archive.binary "), "{found:#?}");
    assert!(
        found[0].contains("which modelIdentifier = \"other\" asks for; there is binaries/"),
        "{found:#?}"
    );
}
