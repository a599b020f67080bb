//! Descriptions that are read: a written one comes back; a broken part is told, and takes nothing else along.

mod support;

use punctual_modeldescription::{
    DisplayUnit, Integer, Located, ModelDescription, ModelExchange, Place, SimpleType, Unknown, UnknownList,
    VariableKind, Violation,
};
use roxmltree::Document;
use support::small;

fn read(xml: &str) -> Located {
    Located::read(&Document::parse(xml).expect("well-formed"))
}

fn violations(xml: &str) -> Vec<Violation> {
    let mut list = Vec::new();
    read(xml).check(&mut |violation| list.push(violation));
    list
}

/// The small model with every other kind of attribute that the model has.
fn full() -> ModelDescription {
    let mut description = small();
    description.co_simulation.source_files = vec!["all.c".into(), "more.c".into()];
    description.co_simulation.max_output_derivative_order = 2;
    description.units[0].display_units.push(DisplayUnit {
        name: "mm".into(),
        factor: 1000.0,
        offset: -0.5,
        inverse: false,
    });
    description.units[2].base = None;
    let VariableKind::Real(length) = description.variables[0].kind.clone() else { panic!("a Real") };
    let kind = punctual_modeldescription::Real { start: None, display_unit: Some("mm".into()), ..length };
    let kind = VariableKind::Real(kind);
    description.types.push(SimpleType {
        name: "Length".into(),
        description: String::new(),
        kind,
        items: Vec::new(),
    });
    let VariableKind::Real(half) = &mut description.variables[1].kind else { panic!("a Real") };
    half.declared_type = Some("Length".into());
    let VariableKind::Real(rate) = &mut description.variables[7].kind else { panic!("a Real") };
    rate.derivative = Some(7);
    description
}

/// The same with model exchange: `guess` is the derivative of the state `y`, on which it depends.
fn exchanged() -> ModelDescription {
    let mut description = full();
    description.model_exchange = Some(ModelExchange {
        model_identifier: "small_2".into(),
        completed_integrator_step_not_needed: true,
        can_not_use_memory_management_functions: true,
        source_files: vec!["rates.c".into()],
        ..ModelExchange::default()
    });
    let VariableKind::Real(rate) = &mut description.variables[7].kind else { panic!("a Real") };
    rate.derivative = None;
    let VariableKind::Real(rate) = &mut description.variables[9].kind else { panic!("a Real") };
    rate.derivative = Some(7);
    description.variables[6].dependencies = Some(vec![3]);
    description.variables[9].dependencies = Some(vec![2, 3]);
    description
}

#[test]
fn model_exchange_lists_derivatives() {
    let description = exchanged();
    let structure = description.structure().expect("valid");
    let unknown =
        |index, on: &[u32]| Unknown { index, dependencies: Some(on.into()), dependency_kinds: None };
    assert_eq!(structure.derivatives, [unknown(10, &[3, 7])]);
    assert_eq!(structure.outputs[0], unknown(7, &[7]));
    let unknowns: Vec<_> = structure.initial_unknowns.iter().map(|unknown| unknown.index).collect();
    assert_eq!(unknowns, [2, 7, 9, 10], "the derivative has a first guess alone");
    let xml = description.to_xml().expect("valid");
    assert!(
        xml.contains("numberOfEventIndicators=\"0\">\n  <ModelExchange modelIdentifier=\"small_2\""),
        "{xml}"
    );
    for (from, to, wanted) in [
        ("<Unknown index=\"10\" dependencies=\"3 7\"/>", "", "structure.states"),
        ("<Unknown index=\"10\" dependencies=\"3 7\"/>", "<Unknown index=\"8\"/>", "structure.derivatives"),
        ("      <Unknown index=\"10\"/>\n", "", "structure.initial-unknowns"),
        ("modelIdentifier=\"small_2\"", "modelIdentifier=\"small-2\"", "interface.identifier"),
    ] {
        let broken = xml.replacen(from, to, 1);
        assert_ne!(broken, xml, "{from}");
        let rules: Vec<_> = violations(&broken).into_iter().map(|v| v.rule).collect();
        assert!(rules.contains(&wanted), "{to}: {rules:?}");
    }
}

#[test]
fn what_was_written_comes_back() {
    for description in [small(), full(), exchanged()] {
        let located = read(&description.to_xml().expect("valid"));
        let mut wanted = description.clone();
        for variable in &mut wanted.variables {
            // These two are in the structure; the default of `initial` is written out.
            (variable.dependencies, variable.initial_dependencies) = (None, None);
            variable.initial = variable.effective_initial();
        }
        assert_eq!(located.description, wanted);
        assert_eq!(located.structure, description.structure().expect("valid"));
        assert_eq!(located.starts[0].as_deref(), Some("0.1"));
        assert_eq!(located.co_simulation(), Some(&description.co_simulation));
    }
}

#[test]
fn what_was_written_breaks_no_rule() {
    for description in [small(), full(), exchanged()] {
        let rules: Vec<_> =
            violations(&description.to_xml().expect("valid")).into_iter().map(|v| v.rule).collect();
        assert_eq!(rules, ["structure.unsaid"], "one output says nothing");
    }
}

#[test]
fn what_cannot_be_read_breaks_no_rule() {
    let xml = small().to_xml().expect("valid");
    for (from, to, place, attribute) in [
        ("start=\"3\"", "start=\"three\"", Place::Start(3), "start"),
        ("valueReference=\"2\"", "valueReference=\"-1\"", Place::Variable(2), "valueReference"),
        ("modelIdentifier=\"small_1\"", "", Place::Interface(0), "modelIdentifier"),
        (" guid=", " gid=", Place::Root, "guid"),
        ("dependencies=\"3\"", "dependencies=\"x\"", Place::Unknown(UnknownList::Outputs, 0), "dependencies"),
    ] {
        let broken = xml.replacen(from, to, 1);
        assert_ne!(broken, xml, "{from}");
        let located = read(&broken);
        assert!(located.is_unread(place, attribute), "{to}");
        let rules: Vec<_> = violations(&broken).into_iter().map(|v| v.rule).collect();
        assert_eq!(rules, ["structure.unsaid"], "{to}");
    }
}

#[test]
fn positions_are_those_of_the_text() {
    let xml = full().to_xml().expect("valid");
    let located = read(&xml);
    for (place, text) in [
        (Place::Root, "<fmiModelDescription "),
        (Place::Interface(0), "modelIdentifier="),
        (Place::Unit(0), "<Unit name=\"m\""),
        (Place::DisplayUnit(0, 0), "<DisplayUnit name=\"mm\""),
        (Place::Item(0, 1), "<Item name=\"bad\""),
        (Place::Variable(2), "<ScalarVariable name=\"u[1]\""),
        (Place::Start(2), "start=\"0.0\"/>"),
        (Place::Unknowns(UnknownList::Outputs), "<Outputs>"),
        (Place::Unknown(UnknownList::InitialUnknowns, 1), "<Unknown index=\"7\" dependencies=\"3 11\""),
        // A missing part is told at the place where it should be.
        (Place::Start(1), "<ScalarVariable name=\"rod.half\""),
        (Place::Unknowns(UnknownList::Derivatives), "<ModelStructure>"),
    ] {
        assert!(xml[located.position(place)..].starts_with(text), "{place:?}");
    }
}

#[test]
fn an_enumeration_has_the_items_of_its_type() {
    let description = small();
    let items = |name: &str| {
        description.items(description.variables.iter().find(|v| v.name == name).expect("exists")).len()
    };
    assert_eq!((items("status"), items("count")), (2, 0));
    let of_nothing = VariableKind::Enumeration(Integer::default());
    let unknown =
        punctual_modeldescription::Variable { kind: of_nothing, ..description.variables[0].clone() };
    assert!(description.items(&unknown).is_empty());
}
