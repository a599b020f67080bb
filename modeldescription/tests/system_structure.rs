//! SSP 1.0 and 2.0: the files of a small system, and one defect at a time.

use punctual_modeldescription::{
    Causality, Connector, EnumerationItem, ParameterSet, ParameterValue, Real, SimpleType, SspVersion,
    SystemComponent, SystemConnection, SystemStructure, VariableKind,
};

fn connector(name: &str, causality: Causality, kind: VariableKind) -> Connector {
    Connector { name: name.into(), causality, kind, dimensions: Vec::new() }
}

fn real() -> VariableKind {
    VariableKind::Real(Real::default())
}

fn system() -> SystemStructure {
    SystemStructure {
        name: "pair".into(),
        start_values: Some("resources/start.ssv".into()),
        components: vec![
            SystemComponent {
                name: "a".into(),
                source: "resources/a.fmu".into(),
                connectors: vec![
                    connector("y", Causality::Output, real()),
                    connector("s", Causality::Output, VariableKind::enumeration("Status")),
                ],
            },
            SystemComponent {
                name: "b & c".into(),
                source: "resources/b.fmu".into(),
                connectors: vec![connector("u", Causality::Input, real())],
            },
        ],
        connections: vec![SystemConnection {
            start: ("a".into(), "y".into()),
            end: ("b & c".into(), "u".into()),
            factor: -1.0,
            offset: 0.0,
        }],
        enumerations: vec![SimpleType::enumeration(
            "Status",
            "",
            vec![EnumerationItem { name: "good".into(), value: 1, description: String::new() }],
        )],
        ..SystemStructure::default()
    }
}

#[test]
fn a_system_in_full() {
    let wanted = r#"<?xml version="1.0" encoding="UTF-8"?>
<ssd:SystemStructureDescription xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription" xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon" version="1.0" name="pair">
  <ssd:System name="pair">
    <ssd:ParameterBindings>
      <ssd:ParameterBinding type="application/x-ssp-parameter-set" source="resources/start.ssv"/>
    </ssd:ParameterBindings>
    <ssd:Elements>
      <ssd:Component name="a" type="application/x-fmu-sharedlibrary" source="resources/a.fmu" implementation="CoSimulation">
        <ssd:Connectors>
          <ssd:Connector name="y" kind="output">
            <ssc:Real/>
          </ssd:Connector>
          <ssd:Connector name="s" kind="output">
            <ssc:Enumeration name="Status"/>
          </ssd:Connector>
        </ssd:Connectors>
      </ssd:Component>
      <ssd:Component name="b &amp; c" type="application/x-fmu-sharedlibrary" source="resources/b.fmu" implementation="CoSimulation">
        <ssd:Connectors>
          <ssd:Connector name="u" kind="input">
            <ssc:Real/>
          </ssd:Connector>
        </ssd:Connectors>
      </ssd:Component>
    </ssd:Elements>
    <ssd:Connections>
      <ssd:Connection startElement="a" startConnector="y" endElement="b &amp; c" endConnector="u" suppressUnitConversion="true">
        <ssc:LinearTransformation factor="-1.0" offset="0.0"/>
      </ssd:Connection>
    </ssd:Connections>
  </ssd:System>
  <ssd:Enumerations>
    <ssc:Enumeration name="Status">
      <ssc:Item name="good" value="1"/>
    </ssc:Enumeration>
  </ssd:Enumerations>
</ssd:SystemStructureDescription>
"#;
    let found = system().to_xml().expect("valid");
    assert!(found == wanted, "{found}");
}

#[test]
fn values_of_every_type() {
    let parameters = vec![
        ("a.x".to_owned(), ParameterValue::Real(0.1)),
        ("a.n".to_owned(), ParameterValue::Integer(-3)),
        ("a.on".to_owned(), ParameterValue::Boolean(true)),
        ("a.s".to_owned(), ParameterValue::Enumeration("good".into())),
    ];
    let text =
        ParameterSet { name: "start".into(), parameters, ..ParameterSet::default() }.to_xml().expect("valid");
    for part in [
        r#"<ssv:Real value="0.1"/>"#,
        r#"<ssv:Integer value="-3"/>"#,
        r#"<ssv:Boolean value="true"/>"#,
        r#"<ssv:Enumeration value="good"/>"#,
    ] {
        assert!(text.contains(part), "{text}");
    }
}

#[test]
fn each_defect_is_told_with_its_place() {
    let refused = |edit: fn(&mut SystemStructure)| {
        let mut system = system();
        edit(&mut system);
        system.to_xml().expect_err("a defect").to_string()
    };
    let output = r#"allowed: a connector that is an output"#;
    let input = r#"allowed: a connector that is an input"#;
    for (edit, message) in [
        ((|s| s.name.clear()) as fn(&mut SystemStructure), "name is \"\"; allowed: a non-empty text that XML can carry".to_owned()),
        (|s| s.components[1].name = "a".into(), "components[1].name is \"a\"; allowed: a name used once".into()),
        (|s| s.components[0].name = "\u{1}".into(), "components[0].name is \"\\u{1}\"; allowed: a non-empty text that XML can carry".into()),
        (|s| s.connections[0].start.1 = "z".into(), format!("connections[0].start is a.z; {output}")),
        (|s| s.connections[0].end = ("a".into(), "y".into()), format!("connections[0].end is a.y; {input}")),
        (|s| s.connections[0].factor = f64::NAN, "connections[0].factor is NaN; allowed: a finite number".into()),
        (|s| s.components[0].connectors[0].causality = Causality::Local,
            "components[0].connectors[\"y\"] is local; allowed: input, output, parameter or calculatedParameter".into()),
        (|s| s.enumerations.clear(), "components[0].connectors[\"s\"] is \"Status\"; allowed: an enumeration of the system".into()),
    ] {
        assert_eq!(refused(edit), message);
    }
    let set = |parameters| {
        ParameterSet { name: "start".into(), parameters, ..ParameterSet::default() }
            .to_xml()
            .expect_err("a defect")
    };
    let twice =
        vec![("a".to_owned(), ParameterValue::Integer(1)), ("a".to_owned(), ParameterValue::Integer(2))];
    assert_eq!(set(twice).to_string(), "parameters[\"a\"] is \"a\"; allowed: a name used once");
    let infinite = vec![("a".to_owned(), ParameterValue::Real(f64::INFINITY))];
    assert_eq!(set(infinite).to_string(), "parameters[\"a\"] is inf; allowed: a finite number");
}

#[test]
fn arrays_are_for_version_two() {
    let mut system = system();
    for (component, connector) in [(0, 0), (1, 0)] {
        system.components[component].connectors[connector].dimensions = vec![2, 3];
    }
    let refused =
        "components[0].connectors[\"y\"].dimensions is 2; allowed: none in SSP 1.0, at least 1 in SSP 2.0";
    assert_eq!(system.to_xml().expect_err("an array").to_string(), refused);
    system.version = SspVersion::Two;
    let text = system.to_xml().expect("valid");
    let connector = "<ssd:Connector name=\"y\" kind=\"output\">\n            <ssc:Real/>\n            \
                     <ssc:Dimension size=\"2\"/>\n            <ssc:Dimension size=\"3\"/>\n          </ssd:Connector>";
    assert!(text.contains("version=\"2.0\" name=\"pair\"") && text.contains(connector), "{text}");
    let parameters = vec![
        ("a.x".to_owned(), ParameterValue::Reals(vec![0.1, -2.0])),
        ("a.n".to_owned(), ParameterValue::Integers(vec![-3, 4])),
        ("a.on".to_owned(), ParameterValue::Booleans(vec![true, false])),
    ];
    let mut set = ParameterSet { name: "start".into(), parameters, ..ParameterSet::default() };
    let refused = "parameters[\"a.x\"] is an array of 2; allowed: one value in SSP 1.0; at least one element in SSP 2.0";
    assert_eq!(set.to_xml().expect_err("an array").to_string(), refused);
    set.version = SspVersion::Two;
    let text = set.to_xml().expect("valid");
    for part in [
        r#"version="2.0" name="start""#,
        r#"<ssv:Real value="0.1 -2.0"/>"#,
        r#"<ssv:Integer value="-3 4"/>"#,
        r#"<ssv:Boolean value="true false"/>"#,
    ] {
        assert!(text.contains(part), "{text}");
    }
}
