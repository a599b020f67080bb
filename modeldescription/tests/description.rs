//! Known answers: the XML of a small model, and numbers that read back.

mod support;

use punctual_modeldescription::{Causality, Initial, VariableKind};
use support::small;

#[test]
fn small_model_gives_the_golden_file() {
    assert_eq!(small().to_xml().expect("valid"), include_str!("golden/small.xml"));
}

#[test]
fn empty_lists_give_no_elements() {
    let mut description = small();
    description.variables.retain(|v| v.name == "count");
    description.units.clear();
    description.types.clear();
    description.log_categories.clear();
    description.default_experiment = None;
    let xml = description.to_xml().expect("valid");
    for absent in [
        "UnitDefinitions",
        "TypeDefinitions",
        "LogCategories",
        "DefaultExperiment",
        "Outputs",
        "InitialUnknowns",
    ] {
        assert!(!xml.contains(absent), "{absent} in {xml}");
    }
    assert!(xml.ends_with("  <ModelStructure/>\n</fmiModelDescription>\n"), "{xml}");
}

#[test]
fn start_values_read_back_exactly() {
    for start in [1.0 / 3.0, -2.5e-7, 5e-324, f64::MAX, -0.0] {
        let mut description = small();
        let VariableKind::Real(input) = &mut description.variables[2].kind else {
            panic!("a real input is expected");
        };
        input.start = Some(start);
        let xml = description.to_xml().expect("valid");
        let line = xml.lines().skip_while(|line| !line.contains("u[1]")).nth(1).expect("the Real element");
        let text = line.split("start=\"").nth(1).and_then(|rest| rest.split('"').next()).expect("a start");
        assert_eq!(text.parse::<f64>().map(f64::to_bits), Ok(start.to_bits()), "{text}");
    }
}

#[test]
fn infinite_start_goes_with_an_infinite_bound() {
    let mut description = small();
    let VariableKind::Real(parameter) = &mut description.variables[0].kind else {
        panic!("a real parameter is expected");
    };
    parameter.start = Some(f64::INFINITY);
    assert!(description.to_xml().expect("valid").contains(r#"max="INF" nominal="1e-7" start="INF"/>"#));
}

#[test]
fn generation_date_is_written_if_given() {
    let mut description = small();
    description.generation_date_and_time = Some("2026-01-31T12:00:00Z".into());
    let xml = description.to_xml().expect("valid");
    assert!(xml.contains(r#" generationDateAndTime="2026-01-31T12:00:00Z" "#));
}

#[test]
fn defaults_of_initial_decide_start_and_initial_unknowns() {
    let description = small();
    let of = |name: &str| description.variables.iter().find(|v| v.name == name).expect("exists");
    assert_eq!(of("rod.length").effective_initial(), Some(Initial::Exact));
    assert_eq!(of("rod.half").effective_initial(), Some(Initial::Calculated));
    assert_eq!(of("u[1]").effective_initial(), None);
    assert_eq!(of("y").effective_initial(), Some(Initial::Calculated));
    assert!(of("u[1]").needs_start() && of("rod.length").needs_start() && of("guess").needs_start());
    assert!(!of("y").needs_start() && !of("status").needs_start());
    let unknowns: Vec<_> =
        description.variables.iter().filter(|v| v.is_initial_unknown()).map(|v| v.name.as_str()).collect();
    assert_eq!(unknowns, ["rod.half", "y", "status"]);
    assert_eq!(of("guess").causality, Causality::Local);
}
