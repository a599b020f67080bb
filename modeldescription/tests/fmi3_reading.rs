//! Descriptions of FMI 3.0 that are read: a written one comes back; a broken part is told, and takes nothing else along.

#[path = "support/fmi3.rs"]
mod support;

use punctual_modeldescription::fmi3::{
    Clock, Integer, Interface, IntervalVariability, Located, ModelDescription, Unknown, Variable,
    VariableKind,
};
use punctual_modeldescription::{Causality, Place, UnknownList, Variability};
use roxmltree::Document;
use support::small3;

fn read(xml: &str) -> Located {
    Located::read(&Document::parse(xml).expect("well-formed"))
}

/// The small model with every other kind of attribute.
fn full() -> ModelDescription {
    let mut description = small3();
    let clock = Clock {
        can_be_deactivated: true,
        priority: Some(3),
        interval_variability: Some(IntervalVariability::Changing),
        interval_decimal: Some(0.5),
        shift_decimal: 0.25,
        supports_fraction: true,
        resolution: Some(1000),
        interval_counter: Some(500),
        shift_counter: 250,
    };
    description.co_simulation.as_mut().expect("offered").has_event_mode = true;
    let kind = VariableKind::Clock(clock);
    description.variables.push(Variable::new("tick", 30, Causality::Input, Variability::Discrete, kind));
    let rearm = &mut description.variables[15];
    rearm.clocks = vec![30];
    rearm.can_handle_multiple_set = Some(false);
    description.variables[5].intermediate_update = true;
    // The status becomes a clocked state.
    let before = Variable {
        declared_type: Some("Status".into()),
        ..Variable::new(
            "before",
            31,
            Causality::Local,
            Variability::Discrete,
            VariableKind::Enumeration(Integer::default()),
        )
    };
    description.variables.push(before);
    let status = &mut description.variables[18];
    (status.previous, status.clocks) = (Some(31), vec![30]);
    description.structure.clocked_states = vec![Unknown::new(18)];
    description.structure.event_indicators = vec![Unknown::new(21)];
    description.variables[20].kind.as_float_mut().expect("a number").reinit = true;
    description.scheduled_execution = Some(Interface {
        model_identifier: "small_3".into(),
        needs_execution_tool: true,
        ..Interface::default()
    });
    description
}

#[test]
fn what_was_written_comes_back() {
    for description in [small3(), full()] {
        let located = read(&description.to_xml().expect("valid"));
        let mut wanted = description.clone();
        for variable in &mut wanted.variables {
            // The default of `initial` is written out.
            variable.initial = variable.effective_initial();
        }
        assert_eq!(located.description, wanted);
        assert_eq!(located.starts[2].as_deref(), Some("0.1 0.2 0.3"));
    }
}

#[test]
fn what_was_written_breaks_no_rule() {
    for description in [small3(), full()] {
        let mut rules = Vec::new();
        read(&description.to_xml().expect("valid")).check(&mut |violation| rules.push(violation.rule));
        assert_eq!(rules, ["structure.unsaid"], "one output says nothing");
    }
}

#[test]
fn defaults_are_those_of_the_standard() {
    let xml = small3().to_xml().expect("valid");
    for default in [
        " variability=\"continuous\"",
        " variability=\"fixed\"",
        " variability=\"discrete\"",
        " causality=\"local\"",
    ] {
        let short = xml.replace(default, "");
        assert_ne!(short, xml, "{default}");
        assert_eq!(read(&short).description, read(&xml).description, "{default}");
    }
}

#[test]
fn what_cannot_be_read_is_noted() {
    let xml = small3().to_xml().expect("valid");
    for (from, to, place, attribute) in [
        ("start=\"0.1 0.2 0.3\"", "start=\"0.1 x 0.3\"", Place::Start(2), "start"),
        ("start=\"-128\"", "start=\"-129\"", Place::Start(7), "start"),
        ("value=\"0FA0\"", "value=\"0FA\"", Place::Start(17), "start"),
        ("valueReference=\"2\"", "valueReference=\"-1\"", Place::Variable(2), "valueReference"),
        ("CoSimulation modelIdentifier=\"small_3\"", "CoSimulation", Place::Interface(1), "modelIdentifier"),
        (" instantiationToken=", " guid=", Place::Root, "instantiationToken"),
        (
            "dependencies=\"5 15\"",
            "dependencies=\"x\"",
            Place::Unknown(UnknownList::Outputs, 0),
            "dependencies",
        ),
        ("<Dimension start=\"2\"", "<Dimension start=\"two\"", Place::Variable(3), "Dimension"),
    ] {
        let broken = xml.replacen(from, to, 1);
        assert_ne!(broken, xml, "{from}");
        assert!(read(&broken).is_unread(place, attribute), "{to}");
        assert!(!read(&xml).is_unread(place, attribute), "{from}");
    }
}

#[test]
fn lists_that_are_there_but_empty_hold_nothing() {
    let xml = small3().to_xml().expect("valid");
    for (from, to, rule) in [
        ("<Start value=\"0FA0\"/>", "<Start/>", "variable.start"),
        ("start=\"255\"", "start=\" \"", ""),
        ("name=\"rearm\"", "name=\"rearm\" clocks=\"\"", "variable.clock"),
    ] {
        let mut rules = Vec::new();
        let broken = xml.replacen(from, to, 1);
        assert_ne!(broken, xml, "{from}");
        read(&broken).check(&mut |violation| rules.push(violation.rule));
        rules.retain(|rule| *rule != "structure.unsaid");
        assert_eq!(rules.concat(), rule, "{to}");
    }
}

#[test]
fn positions_are_those_of_the_text() {
    let xml = small3().to_xml().expect("valid");
    let located = read(&xml);
    for (place, text) in [
        (Place::Root, "<fmiModelDescription "),
        (Place::Interface(1), "modelIdentifier=\"small_3\" canGetAndSetFMUState=\"true\" canSerialize"),
        (Place::DisplayUnit(0, 0), "<DisplayUnit name=\"mm\""),
        (Place::Item(0, 1), "<Item name=\"bad\""),
        (Place::Type(1), "<Float64Type name=\"Length\""),
        (Place::Variable(5), "<Float64 name=\"u\""),
        (Place::Start(5), "start=\"0.0 -1.5\""),
        (Place::Start(17), "<Start value=\"0FA0\""),
        (Place::Alias(3, 1), "<Alias name=\"c[1]\""),
        (Place::Unknowns(UnknownList::Outputs), "<Output valueReference=\"18\""),
        (Place::Unknown(UnknownList::InitialUnknowns, 1), "<InitialUnknown valueReference=\"18\""),
        // A missing part is told at the place where it should be.
        (Place::Start(4), "<Float64 name=\"half\""),
        (Place::Unknowns(UnknownList::EventIndicators), "<ModelStructure>"),
    ] {
        assert!(xml[located.position(place)..].starts_with(text), "{place:?}");
    }
}

#[test]
fn arrays_have_the_sizes_of_their_structural_parameters() {
    let description = small3();
    let shape = |name: &str| description.shape(description.by_name(name).expect("exists"));
    assert_eq!(shape("time"), Some(vec![]));
    assert_eq!(shape("centres"), Some(vec![2, 3]));
    assert_eq!(shape("centre"), Some(vec![2, 3]), "an alias is the same");
    let mut broken = description.clone();
    broken.variables[1].kind.as_integer_mut().expect("a size").start.clear();
    assert_eq!(broken.shape(&broken.variables[2]), None);
}
