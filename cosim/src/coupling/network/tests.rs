//! Resolves system files with one defect each against made-up descriptions.

use super::super::starts::Values;
use super::*;
use crate::host::DataType::Float64;
use crate::host::example::{description, variable, vector};

fn filter() -> Description {
    let deadline = Variable {
        range: (Some(0.0), None),
        unit: Some("s".into()),
        ..variable("deadline", Float64, Causality::Parameter)
    };
    let mode = Variable {
        items: vec![("on".into(), 1)],
        value_reference: 1,
        ..variable("mode", DataType::Enumeration, Causality::Parameter)
    };
    description(
        vec![
            variable("x", Float64, Causality::Input),
            variable("u_ref", Float64, Causality::Input),
            variable("rearm", DataType::Boolean, Causality::Input),
            variable("u", Float64, Causality::Output),
            variable("arrived", DataType::Boolean, Causality::Output),
            deadline,
            mode,
        ],
        &[("u", None), ("arrived", None)],
    )
}

fn plant() -> Description {
    description(
        vec![
            variable("u", Float64, Causality::Input),
            variable("x", Float64, Causality::Output),
            variable("text", DataType::String, Causality::Output),
        ],
        &[("x", Some(&[])), ("text", Some(&[]))],
    )
}

/// A gain block.
fn gain() -> Description {
    description(
        vec![variable("i", Float64, Causality::Input), variable("o", Float64, Causality::Output)],
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
    // plant.x, plant.u, filter.u, filter.arrived, filter.x, gain.o; the String output is omitted.
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
    // What the FMU itself declares takes precedence.
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
        (connection("plant.u", "filter.x"), "connection[0].from: plant.u has causality input; must be output or local or calculatedParameter"),
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
        (
            "record = { signals = [\"gain.i\", \"gain.i\"] }".into(),
            "record.signals[1]: gain.i is named twice",
        ),
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
    assert_eq!(resolved("", "deadline = 5").unwrap().starts[1], [Start::real(0, 5.0)]);
    let defects = [
        ("deadline = -1.0", "component[1].start.\"deadline\": is -1 s; must be ≥ 0 s"),
        ("deadline = true", "is of type Real; the value given is not"),
        ("mode = 2", "is 2; must be one of 1 (on)"),
        ("mode = 3000000000", "is 3000000000; must be one of 1 (on)"),
        ("deadline = [1.0]", "is a list of [1]; must be one value"),
        ("deadline = \"soon\"", "is of type Real; the value given is not"),
        ("u = 1.0", "has causality output; only parameters and inputs"),
        ("nothing = 1.0", "filter (f) has no variable \"nothing\""),
    ];
    for (start, expected) in defects {
        let message = resolved("", start).unwrap_err().to_string();
        assert!(message.contains(expected), "{start}: {message}");
    }
}

/// A block with an input vector `v`, an output vector `w`, and a parameter of each kind.
fn block(size: usize) -> Description {
    let mut variables = vector("v", size, Causality::Input);
    variables.extend(
        vector("w", size, Causality::Output).into_iter().map(|v| Variable { value_reference: 1, ..v }),
    );
    let parameter = |name: &str, of, value_reference| Variable {
        value_reference,
        ..variable(name, of, Causality::Parameter)
    };
    variables.push(parameter("small", DataType::UInt8, 2));
    variables.push(parameter("large", DataType::UInt64, 3));
    variables.push(parameter("text", DataType::String, 4));
    variables.push(parameter("bytes", DataType::Binary, 5));
    description(variables, &[("w[1]", Some(&[])), ("w[2]", Some(&[]))])
}

fn blocks(wiring: &str, start: &str) -> Result<Network, Error> {
    let text = format!(
        r#"
experiment = {{ stop_time = 1.0, step = 0.1 }}
component = [
  {{ name = "a", fmu = "a.fmu" }},
  {{ name = "b", fmu = "b.fmu", start = {{ {start} }} }},
  {{ name = "c", fmu = "c.fmu" }},
]
{wiring}"#
    );
    resolve(&System::parse(&text).unwrap(), &[&block(2), &block(2), &block(3)])
}

#[test]
fn arrays_connect_as_a_whole_and_by_elements() {
    let whole = blocks("connection = [{ from = \"a.w\", to = \"b.v\", factor = 2 }]", "").unwrap();
    let pairs: Vec<_> =
        whole.links.iter().map(|link| (link.from.variable, link.to.variable, link.factor)).collect();
    assert_eq!(pairs, [(2, 0, 2.0), (3, 1, 2.0)]);
    let one = blocks("connection = [{ from = \"a.w[2]\", to = \"c.v[3]\" }]", "").unwrap();
    assert_eq!((one.links[0].from.variable, one.links[0].to.variable), (3, 2));
    let record = blocks("record = { signals = [\"b.w\", \"a.w[1]\"] }", "").unwrap();
    assert_eq!(record.recorded.len(), 3);
}

#[test]
fn each_defect_of_arrays_is_told_with_its_field() {
    let connection = |from: &str, to: &str| format!("connection = [{{ from = \"{from}\", to = \"{to}\" }}]");
    let defects = [
        (
            connection("a.w", "c.v"),
            "connection[0]: a.w is an array of [2], but c.v is an array of [3]; sizes must be equal",
        ),
        (
            connection("a.w", "c.v[1]"),
            "connection[0]: a.w is an array of [2], but c.v[1] is a scalar; sizes must be equal",
        ),
        (connection("a.w[3]", "c.v[1]"), "connection[0].from: a (a.fmu) has no variable \"w[3]\""),
        (
            connection("a.w.x", "c.v[1]"),
            "connection[0].from: a (a.fmu) has no variable \"w.x\"; w is an array of [2], with elements such as \"w[1]\"",
        ),
        (
            "plot = [{ kind = \"time\", signals = [\"a.w\"] }]".into(),
            "\"w\" of a (a.fmu) is an array of [2]; name an element, such as \"w[1]\"",
        ),
    ];
    for (wiring, expected) in defects {
        let message = blocks(&wiring, "").unwrap_err().to_string();
        assert!(message.contains(expected), "{wiring}: {message}");
    }
}

#[test]
fn start_values_of_arrays_are_lists_or_elements() {
    let start = |text: &str| blocks("", text).map(|network| network.starts[1].clone());
    let numbers = |values: &[f64]| Values::Numbers(values.to_vec());
    assert_eq!(start("v = [1.0, 2]").unwrap()[0].values, numbers(&[1.0, 2.0]));
    // Elements override the whole array, and missing values come from the description.
    assert_eq!(start("\"v[2]\" = 3, v = [1, 2]").unwrap()[0].values, numbers(&[1.0, 3.0]));
    assert_eq!(start("\"v[2]\" = 3").unwrap()[0].values, numbers(&[0.0, 3.0]));
    assert_eq!(start("text = \"on\"").unwrap()[0].values, Values::Texts(vec!["on".into()]));
    let defects = [
        ("v = [1.0]", "component[1].start.\"v\": is a list of [1]; must be a list of [2]"),
        ("v = 1.0", "is one value; must be a list of [2]"),
        ("v = [[1], [2, 3]]", "is a list of lists of different length; must be a list of [2]"),
        ("small = 256", "is 256; must be from 0 to 255"),
        ("large = 9007199254740993", "is 9007199254740993; must be from 0 to 9007199254740992"),
        ("text = 1", "is of type String; the value given is not"),
        ("bytes = \"00\"", "is of type Binary, which cannot be given a value here"),
    ];
    for (text, expected) in defects {
        let message = start(text).unwrap_err().to_string();
        assert!(message.contains(expected), "{text}: {message}");
    }
}
