//! `punctual build SYSTEM.toml -o X.ssp`: the package, and the refusals. `tests/interop` tests that other
//! tools read it.

use std::fs;

use crate::workshop::{Workshop, examples};

const SYSTEM: &str = r#"
[experiment]
start_time = 1.0
stop_time = 3.0
step = 0.5

[[component]]
name = "filter"
fmu = "filter.fmu"

[[component]]
name = "plant"
fmu = "plant.fmu"
start = { "x0.v" = 2, "x0.x_p" = -1.5 }

[[component]]
name = "other"
fmu = "plant.fmu"
start = { "u.a" = 0.25 }

[[connect_by_name]]
components = ["filter", "plant"]

[[connection]]
from = "plant.x.v"
to = "filter.u_ref.a"
factor = -2.5
offset = 0.125
"#;

/// The entry of an archive, as text.
fn entry(workshop: &Workshop, archive: &str, wanted: &str) -> String {
    let mut found = None;
    workshop.edit_fmu(archive, |name, bytes| {
        if name == wanted {
            found = Some(String::from_utf8(bytes.clone()).expect("UTF-8"));
        }
        Some(bytes)
    });
    found.unwrap_or_else(|| panic!("no {wanted} in {archive}"))
}

#[test]
fn a_system_is_packed_with_its_fmus() {
    let workshop = Workshop::with_fmus();
    workshop.write("my.toml", SYSTEM);
    let said = workshop.punctual(["build", "my.toml", "-o", "my.ssp"]).success();
    assert_eq!(said, "my.ssp: 3 components from 2 FMUs, 7 connections, 3 start values\n");
    let first = workshop.bytes("my.ssp");
    workshop.punctual(["build", "my.toml", "-o", "again.ssp"]).success();
    assert!(first == workshop.bytes("again.ssp"), "two builds differ");

    let mut entries = Vec::new();
    workshop.edit_fmu("my.ssp", |name, bytes| {
        if let Some(fmu) = name.strip_prefix("resources/").filter(|n| n.ends_with(".fmu")) {
            assert!(bytes == workshop.bytes(fmu), "{fmu} is another");
        }
        entries.push(name.to_owned());
        Some(bytes)
    });
    let wanted =
        ["SystemStructure.ssd", "resources/filter.fmu", "resources/plant.fmu", "resources/start_values.ssv"];
    assert_eq!(entries, wanted);

    let ssd = entry(&workshop, "my.ssp", "SystemStructure.ssd");
    for part in [
        r#"<ssd:Component name="other" type="application/x-fmu-sharedlibrary" source="resources/plant.fmu" implementation="CoSimulation">"#,
        r#"<ssd:ParameterBinding type="application/x-ssp-parameter-set" source="resources/start_values.ssv"/>"#,
        r#"<ssc:LinearTransformation factor="-2.5" offset="0.125"/>"#,
        r#"<ssc:Enumeration name="Status"/>"#,
        r#"<ssc:Item name="infeasible" value="2"/>"#,
        r#"<ssd:DefaultExperiment startTime="1.0" stopTime="3.0"/>"#,
        r#"description="coupled with a communication step of 0.5 s""#,
        r#"<ssd:Connector name="goal.deadline" kind="parameter">"#,
    ] {
        assert!(ssd.contains(part), "{part} is not in\n{ssd}");
    }
    assert_eq!(ssd.matches("<ssd:Connection ").count(), 7);
    assert_eq!(ssd.matches("LinearTransformation").count(), 1, "a plain connection has none");
    // An input that is neither connected nor set is not a connector.
    assert!(!ssd.contains("rearm") && !ssd.contains("u_ref.omega"));
    let ssv = entry(&workshop, "my.ssp", "resources/start_values.ssv");
    let order = ["other.u.a", "plant.x0.v", "plant.x0.x_p"];
    for (name, value) in order.iter().zip(["0.25", "2.0", "-1.5"]) {
        let begin = ssv.find(&format!("name=\"{name}\"")).unwrap_or_else(|| panic!("no {name} in {ssv}"));
        assert!(ssv[begin..].contains(&format!("<ssv:Real value=\"{value}\"/>")), "{name}: {ssv}");
    }
}

/// A configuration is packed as the FMU built from it.
#[test]
fn a_system_of_configurations_is_packed_as_one_of_fmus() {
    let workshop = Workshop::with_library();
    for name in ["filter", "plant"] {
        let file = examples().join(format!("unicycle-{name}.toml"));
        workshop.write(&format!("{name}.toml"), fs::read(file).expect("an example"));
        workshop.punctual(["build", &format!("{name}.toml"), "-o", &format!("{name}.fmu")]).success();
    }
    workshop.write("my.toml", SYSTEM);
    workshop.punctual(["build", "my.toml", "-o", "fmus.ssp"]).success();
    workshop.write("my.toml", SYSTEM.replace("plant.fmu", "plant.toml").replace("filter.fmu", "filter.toml"));
    let said = workshop.punctual(["build", "my.toml", "-o", "own.ssp"]).success();
    assert_eq!(said, "own.ssp: 3 components from 2 FMUs, 7 connections, 3 start values\n");
    assert!(workshop.bytes("own.ssp") == workshop.bytes("fmus.ssp"), "the packages differ");
    workshop.write("plant.toml", "kind = \"plant\"\nplant.model = \"unicicle\"\n");
    let done = workshop.punctual(["build", "my.toml", "-o", "own.ssp"]);
    done.fails_like(2, "plant.toml: plant.model: ", &["unicicle"]);
}

#[test]
fn fmus_of_the_same_name_get_places_of_their_own() {
    let workshop = Workshop::with_fmus();
    fs::create_dir(workshop.path("a b")).expect("a folder");
    fs::copy(workshop.path("plant.fmu"), workshop.path("a b/plant.fmu")).expect("a copy");
    workshop.write("my.toml", SYSTEM.replacen("fmu = \"plant.fmu\"", "fmu = \"a b/plant.fmu\"", 1));
    workshop.punctual(["build", "my.toml", "-o", "my.SSP"]).success();
    let ssd = entry(&workshop, "my.SSP", "SystemStructure.ssd");
    assert!(ssd.contains("\"resources/plant.fmu\"") && ssd.contains("\"resources/plant-2.fmu\""), "{ssd}");
}

#[test]
fn an_fmu_that_is_missing() {
    let workshop = Workshop::new();
    workshop.write("my.toml", SYSTEM);
    let done = workshop.punctual(["build", "my.toml", "-o", "my.ssp"]);
    done.fails(2, "my.toml: component[0].fmu: there is no file filter.fmu");
    workshop.write("filter.toml", fs::read(examples().join("unicycle-filter.toml")).expect("an example"));
    let done = workshop.punctual(["build", "my.toml", "-o", "my.ssp"]);
    done.fails(
        2,
        "my.toml: component[0].fmu: there is no file filter.fmu; make it with `punctual build filter.toml -o filter.fmu`",
    );
    assert_eq!(workshop.files(), ["filter.toml", "my.toml"]);
}

#[test]
fn what_is_no_system_of_fmus() {
    let workshop = Workshop::with_fmus();
    workshop.write("plant.toml", "kind = \"plant\"\nplant.model = \"unicycle\"\n");
    let done = workshop.punctual(["build", "plant.toml", "-o", "my.ssp"]);
    done.fails(2, "plant.toml: kind: is \"plant\"; an .ssp file is made from a system file");
    workshop.write("my.toml", SYSTEM.replace("plant.x.v", "plant.x.w"));
    let done = workshop.punctual(["build", "my.toml", "-o", "my.ssp"]);
    done.fails_like(2, "my.toml: connection[0].from: plant (plant.fmu) has no variable \"x.w\"", &[]);
    workshop.write("my.toml", SYSTEM);
    let done = workshop.punctual(["build", "my.toml", "-o", "my.ssp", "--library", "plant.fmu"]);
    done.fails(2, "--library: is for one FMU; an .ssp file takes the FMUs that the system names as they are");
    workshop.write("plant.fmu", "no archive");
    let done = workshop.punctual(["build", "my.toml", "-o", "my.ssp"]);
    done.fails_like(1, "plant (plant.fmu): not a readable FMU archive: ", &[]);
}

const ARRAYS: &str = r#"
[experiment]
stop_time = 1.0
step = 0.5

[[component]]
name = "filter"
fmu = "filter.fmu"
start = { u_ref = [0.5, 0.25] }

[[component]]
name = "plant"
fmu = "plant.fmu"

[[connection]]
from = "filter.u"
to = "plant.u"

[[connection]]
from = "plant.x"
to = "filter.x"
"#;

/// Only SSP 2.0 has arrays of FMI 3.0, and only as a whole.
#[test]
fn arrays_are_packed_by_version_two() {
    let workshop = Workshop::with_library();
    for name in ["filter", "plant"] {
        let file = examples().join(format!("unicycle-{name}.toml"));
        workshop.write(&format!("{name}.toml"), fs::read(file).expect("an example"));
        let (from, to) = (format!("{name}.toml"), format!("{name}.fmu"));
        workshop.punctual(["build", &from, "--fmi", "3", "-o", &to]).success();
    }
    workshop.write("my.toml", ARRAYS);
    let done = workshop.punctual(["build", "my.toml", "-o", "my.ssp"]);
    done.fails_like(
        2,
        "my.toml: component[0]: ",
        &["is an array, for which SSP 1.0 has no place", "`--ssp 2`"],
    );
    let said = workshop.punctual(["build", "my.toml", "-o", "my.ssp", "--ssp", "2"]).success();
    assert_eq!(said, "my.ssp: 2 components from 2 FMUs, 2 connections, 1 start values\n");
    let ssd = entry(&workshop, "my.ssp", "SystemStructure.ssd");
    for part in [
        r#"version="2.0" name="my""#,
        "<ssd:Connector name=\"u\" kind=\"output\">\n            <ssc:Real/>\n            <ssc:Dimension size=\"2\"/>",
        r#"startElement="filter" startConnector="u" endElement="plant" endConnector="u""#,
        r#"startElement="plant" startConnector="x" endElement="filter" endConnector="x""#,
    ] {
        assert!(ssd.contains(part), "{part} is not in\n{ssd}");
    }
    assert!(!ssd.contains("\"u[1]\""), "{ssd}");
    let ssv = entry(&workshop, "my.ssp", "resources/start_values.ssv");
    assert!(ssv.contains("<ssv:Real value=\"0.5 0.25\"/>\n      <ssc:Dimension size=\"2\"/>\n"), "{ssv}");
    // A single element cannot be represented.
    workshop.write("my.toml", ARRAYS.replace("u_ref = [0.5, 0.25]", "\"u_ref[1]\" = 0.5"));
    let done = workshop.punctual(["build", "my.toml", "-o", "my.ssp", "--ssp", "2"]);
    done.fails_like(2, "my.toml: component[0].start.\"u_ref[1]\": ", &["is an element of u_ref"]);
    let halves = ARRAYS.replace("filter.u\"", "filter.u[1]\"").replace("plant.u\"", "plant.u[1]\"");
    workshop.write("my.toml", halves);
    let done = workshop.punctual(["build", "my.toml", "-o", "my.ssp", "--ssp", "2"]);
    done.fails(2, "my.toml: connect: filter.u and plant.u are connected in parts; in an .ssp file arrays of the same sizes are connected as a whole");
    let done = workshop.punctual(["build", "filter.toml", "-o", "x.fmu", "--ssp", "2"]);
    done.fails(2, "--ssp: is for an .ssp file, which is made from a system file");
}
