//! SSP 1.0 and 2.0: the files of a small system, and one defect at a time.

use punctual_modeldescription::fmi3::DataType;
use punctual_modeldescription::{
    Causality, Connector, EnumerationItem, Integer, Parameter, ParameterSet, ParameterValue, Real,
    SimpleType, SspVersion, SystemComponent, SystemConnection, SystemStructure, VariableKind,
};

fn connector(name: &str, causality: Causality, kind: VariableKind) -> Connector {
    Connector { name: name.into(), causality, kind, number: None, dimensions: Vec::new() }
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
        Parameter::scalar("a.x", ParameterValue::Real(0.1)),
        Parameter::scalar("a.n", ParameterValue::Integer(-3)),
        Parameter::scalar("a.on", ParameterValue::Boolean(true)),
        Parameter::scalar("a.s", ParameterValue::Enumeration("good".into())),
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
    let twice = vec![
        Parameter::scalar("a", ParameterValue::Integer(1)),
        Parameter::scalar("a", ParameterValue::Integer(2)),
    ];
    assert_eq!(set(twice).to_string(), "parameters[\"a\"] is \"a\"; allowed: a name used once");
    let infinite = vec![Parameter::scalar("a", ParameterValue::Real(f64::INFINITY))];
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
    let array = |name: &str, value, dimensions: &[u64]| Parameter {
        dimensions: dimensions.to_vec(),
        ..Parameter::scalar(name, value)
    };
    let parameters = vec![
        array("a.x", ParameterValue::Reals(vec![0.1, -2.0]), &[2]),
        array("a.n", ParameterValue::Integers(vec![-3, 4, 5, 6]), &[2, 2]),
        array("a.on", ParameterValue::Booleans(vec![true, false]), &[1, 2]),
    ];
    let mut set = ParameterSet { name: "start".into(), parameters, ..ParameterSet::default() };
    let refused = "parameters[\"a.x\"].dimensions is 2; allowed: none in SSP 1.0, at least 1 in SSP 2.0";
    assert_eq!(set.to_xml().expect_err("an array").to_string(), refused);
    set.version = SspVersion::Two;
    let text = set.to_xml().expect("valid");
    for part in [
        r#"version="2.0" name="start""#,
        "<ssv:Real value=\"0.1 -2.0\"/>\n      <ssc:Dimension size=\"2\"/>\n    </ssv:Parameter>",
        "<ssv:Integer value=\"-3 4 5 6\"/>\n      <ssc:Dimension size=\"2\"/>\n      <ssc:Dimension size=\"2\"/>\n",
        "<ssv:Boolean value=\"true false\"/>\n      <ssc:Dimension size=\"1\"/>\n      <ssc:Dimension size=\"2\"/>\n",
    ] {
        assert!(text.contains(part), "{text}");
    }
    // The last product is beyond 64 bits.
    for dimensions in [vec![], vec![3], vec![1 << 63, 4]] {
        set.parameters[0].dimensions = dimensions;
        let refused = "parameters[\"a.x\"] is a list of 2; allowed: as many values as the dimensions say";
        assert_eq!(set.to_xml().expect_err("another number of values").to_string(), refused);
    }
    set.parameters[0] = array("a.x", ParameterValue::Real(1.0), &[1]);
    let refused = "parameters[\"a.x\"] is one value; allowed: as many values as the dimensions say";
    assert_eq!(set.to_xml().expect_err("no list").to_string(), refused);
}

/// Each type of numbers that FMI 3.0 has, with the least and the greatest value.
#[test]
fn numbers_of_fmi_3_are_for_version_two() {
    let integer = || VariableKind::Integer(Integer::default());
    let numbers = DataType::ALL.iter().filter(|of| of.limits().is_some() && **of != DataType::Enumeration);
    let mut tried = 0;
    for &of in numbers {
        let mut system = system();
        system.version = SspVersion::Two;
        system.components[0].connectors[1].kind = integer();
        system.components[0].connectors[1].number = Some(of);
        let text = system.to_xml().expect("valid");
        assert!(text.contains(&format!("<ssc:{}/>", of.as_str())), "{text}");
        system.version = SspVersion::One;
        let refused = format!(
            "components[0].connectors[\"s\"].number is {}; allowed: none in SSP 1.0, in SSP 2.0 a float of a Real, an \
             integer of an Integer",
            of.as_str()
        );
        assert_eq!(system.to_xml().expect_err("a type of 2.0").to_string(), refused);
        let (least, greatest) = of.limits().expect("an integer");
        let set = |value: i128| {
            let value = ParameterValue::Integer(i64::try_from(value).ok()?);
            let parameters = vec![Parameter { number: Some(of), ..Parameter::scalar("a.n", value) }];
            Some(ParameterSet { version: SspVersion::Two, name: "start".into(), parameters }.to_xml())
        };
        for value in [least, greatest] {
            let Some(text) = set(value) else { continue };
            let text = text.expect("valid");
            assert!(text.contains(&format!("<ssv:{} value=\"{value}\"/>", of.as_str())), "{text}");
        }
        for value in [least - 1, greatest + 1] {
            let Some(refused) = set(value) else { continue };
            let refused = refused.expect_err("beyond the limits").to_string();
            assert_eq!(refused, format!("parameters[\"a.n\"] is {value}; allowed: {least} to {greatest}"));
            tried += 1;
        }
    }
    // Of the 64-bit types what is beyond is no number here, but for -1.
    assert_eq!(tried, 6 * 2 + 1);
    let mut float = system();
    float.version = SspVersion::Two;
    float.components[0].connectors[0].number = Some(DataType::Float32);
    assert!(float.to_xml().expect("valid").contains("<ssc:Float32/>"));
    float.components[0].connectors[0].number = Some(DataType::Int8);
    float.to_xml().expect_err("an integer of a Real");
    let beyond = vec![Parameter::scalar("a", ParameterValue::Integer(1 << 31))];
    let refused =
        ParameterSet { name: "start".into(), parameters: beyond, ..ParameterSet::default() }.to_xml();
    let wanted = "parameters[\"a\"] is 2147483648; allowed: -2147483648 to 2147483647";
    assert_eq!(refused.expect_err("beyond 32 bits").to_string(), wanted);
}
