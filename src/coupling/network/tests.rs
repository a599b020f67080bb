//! Resolution of system files against made-up descriptions, one defect each.

use punctual_modeldescription::{EnumerationItem, ModelDescription, Plain, Real, SimpleType};

use super::*;
use crate::host::{Variability, VariableKind};

fn real() -> VariableKind {
    VariableKind::Real(Real::default())
}

fn boolean() -> VariableKind {
    VariableKind::Boolean(Plain::default())
}

fn variable(name: &str, kind: VariableKind, causality: Causality) -> Variable {
    Variable {
        name: name.into(),
        value_reference: 0,
        kind,
        causality,
        variability: Variability::Discrete,
        initial: None,
        description: String::new(),
        dependencies: None,
        initial_dependencies: None,
    }
}

fn description(variables: Vec<Variable>, dependencies: &[(&str, Option<&[&str]>)]) -> Description {
    let index = |name: &str| variables.iter().position(|v| v.name == name).unwrap();
    let outputs = dependencies
        .iter()
        .map(|(name, list)| Output {
            variable: index(name),
            dependencies: list.map(|list| list.iter().map(|name| index(name)).collect()),
        })
        .collect();
    Description {
        starts: vec![None; variables.len()],
        model: ModelDescription { variables, ..ModelDescription::default() },
        outputs,
        problems: vec![],
    }
}

fn filter() -> Description {
    let time = Real { min: Some(0.0), unit: Some("s".into()), ..Real::default() };
    let deadline = variable("deadline", VariableKind::Real(time), Causality::Parameter);
    let mode = variable("mode", VariableKind::enumeration("Mode"), Causality::Parameter);
    let on = EnumerationItem { name: "on".into(), value: 1, description: String::new() };
    let mut filter = description(
        vec![
            variable("x", real(), Causality::Input),
            variable("u_ref", real(), Causality::Input),
            variable("rearm", boolean(), Causality::Input),
            variable("u", real(), Causality::Output),
            variable("arrived", boolean(), Causality::Output),
            deadline,
            mode,
        ],
        &[("u", None), ("arrived", None)],
    );
    filter.model.types = vec![SimpleType::enumeration("Mode", "", vec![on])];
    filter
}

fn plant() -> Description {
    description(
        vec![
            variable("u", real(), Causality::Input),
            variable("x", real(), Causality::Output),
            variable("text", VariableKind::String(Plain::default()), Causality::Output),
        ],
        &[("x", Some(&[])), ("text", Some(&[]))],
    )
}

/// A gain block.
fn gain() -> Description {
    description(
        vec![variable("i", real(), Causality::Input), variable("o", real(), Causality::Output)],
        &[("o", Some(&["i"]))],
    )
}

fn system(wiring: &str, start: &str) -> System {
    System::parse(&text(wiring, start)).unwrap()
}

fn text(wiring: &str, start: &str) -> String {
    format!(
        r#"
experiment = {{ stop_time = 1.0, step = 0.1 }}
component = [
  {{ name = "plant", fmu = "p" }},
  {{ name = "filter", fmu = "f", start = {{ {start} }} }},
  {{ name = "gain", fmu = "g" }},
]
{wiring}"#
    )
}

fn resolved(wiring: &str, start: &str) -> Result<Network, Error> {
    resolve(&system(wiring, start), &[&plant(), &filter(), &gain()])
}

const BY_NAME: &str = "connect_by_name = [{ components = [\"filter\", \"plant\"] }]\n";

#[test]
fn equal_names_connect_both_ways_and_explicit_connections_win() {
    let network = resolved(BY_NAME, "").unwrap();
    assert_eq!(network.links.len(), 2);
    assert_eq!((network.direct.as_slice(), network.delayed.as_slice()), (&[1, 2][..], &[0][..]));
    assert!(network.notes.is_empty(), "{:?}", network.notes);
    // plant.x, plant.u, filter.u, filter.arrived, filter.x, gain.o; the text is left out.
    assert_eq!(network.recorded.len(), 6);

    let wiring = format!("connection = [{{ from = \"gain.o\", to = \"plant.u\", factor = 2 }}]\n{BY_NAME}");
    let network = resolved(&wiring, "").unwrap();
    assert_eq!(network.links.len(), 2);
    assert_eq!((network.links[0].from.component, network.links[0].factor), (2, 2.0));
}

#[test]
fn a_feedthrough_chain_is_ordered_and_a_cycle_is_noted() {
    let chain = "connection = [{ from = \"gain.o\", to = \"filter.u_ref\" }, { from = \"plant.x\", to = \"gain.i\" }]\n";
    let network = resolved(&format!("{chain}{BY_NAME}"), "").unwrap();
    assert_eq!(network.direct, [2, 1]);
    assert!(network.notes.is_empty());

    let cycle =
        "connection = [{ from = \"gain.o\", to = \"filter.x\" }, { from = \"filter.u\", to = \"gain.i\" }]\n";
    let network = resolved(cycle, "").unwrap();
    assert_eq!(network.direct, [1, 2]);
    assert_eq!(network.notes.len(), 1);
    assert!(network.notes[0].starts_with("gain.o → filter.x closes a loop"), "{}", network.notes[0]);
}

#[test]
fn undeclared_dependencies_can_be_said_to_be_none() {
    let run = |name: &str| {
        let said = format!("name = \"{name}\", feedthrough = false");
        let text = text(BY_NAME, "").replace(&format!("name = \"{name}\""), &said);
        resolve(&System::parse(&text).unwrap(), &[&plant(), &filter(), &gain()]).unwrap()
    };
    let network = run("filter");
    assert_eq!((network.direct.as_slice(), network.delayed.as_slice()), (&[2][..], &[0, 1][..]));
    // The FMU's own declaration counts.
    assert_eq!(run("gain").direct, [1, 2]);
}

#[test]
fn each_wiring_defect_is_told_with_its_field() {
    let connection = |from: &str, to: &str| format!("connection = [{{ from = \"{from}\", to = \"{to}\" }}]");
    let defects = [
        (connection("robot.x", "filter.x"), "connection[0].from: no component \"robot\"; there are plant, filter, gain"),
        (connection("plant", "filter.x"), "connection[0].from: \"plant\" is not of the form component.variable"),
        (connection("plant.z", "filter.x"), "connection[0].from: plant (p) has no variable \"z\""),
        (connection("plant.y.x", "filter.x"), "has no variable \"y.x\"; did you mean x?"),
        (connection("plant.u", "filter.x"), "connection[0].from: plant.u has causality input; must be output"),
        (connection("plant.x", "filter.u"), "connection[0].to: filter.u has causality output; must be input"),
        (connection("plant.x", "filter.rearm"), "plant.x is Real, but filter.rearm is Boolean; types must be equal"),
        (
            "connection = [{ from = \"filter.arrived\", to = \"filter.rearm\", factor = 2 }]".into(),
            "connection[0]: factor and offset are for Real signals; filter.rearm is Boolean",
        ),
        (
            "connection = [{ from = \"plant.x\", to = \"gain.i\" }, { from = \"filter.u\", to = \"gain.i\" }]".into(),
            "connection[1].to: input gain.i is already connected by connection[0]",
        ),
        (
            "connect_by_name = [{ components = [\"filter\", \"filter\"] }]".into(),
            "connect_by_name[0].components: both are \"filter\"",
        ),
        (
            "connect_by_name = [{ components = [\"filter\", \"gain\"] }]".into(),
            "connect_by_name[0]: no output of filter or gain has an input of equal name in the other",
        ),
        (
            "connect_by_name = [{ components = [\"filter\", \"plant\"] }, { components = [\"plant\", \"filter\"] }]".into(),
            "connect_by_name[1]: input filter.x is already connected by name to plant.x",
        ),
        ("record = { signals = [\"gain.i\"] }".into(), "record.signals[0]: gain.i is neither an output nor"),
        ("record = { signals = [\"plant.text\"] }".into(), "record.signals[0]: plant.text is String"),
        ("plot = [{ kind = \"time\", signals = [\"filter.x\"] }]".into(), "plot[0].signals[0]: filter.x is not recorded"),
    ];
    for (wiring, expected) in defects {
        let message = resolved(&wiring, "").unwrap_err().to_string();
        assert!(message.contains(expected), "{wiring}: {message}");
    }
}

#[test]
fn each_start_value_defect_is_told_with_its_field() {
    assert_eq!(resolved("", "deadline = 5").unwrap().starts[1], [Start::Real(0, 5.0)]);
    let defects = [
        ("deadline = -1.0", "component[1].start.\"deadline\": is -1 s; must be ≥ 0 s"),
        ("deadline = true", "is of type Real; the value given is not"),
        ("mode = 2", "is 2; must be one of 1 (on)"),
        ("mode = 3000000000", "is 3000000000; must be from -2147483648 to 2147483647"),
        ("u = 1.0", "has causality output; only parameters and inputs"),
        ("nothing = 1.0", "filter (f) has no variable \"nothing\""),
    ];
    for (start, expected) in defects {
        let message = resolved("", start).unwrap_err().to_string();
        assert!(message.contains(expected), "{start}: {message}");
    }
}
