//! One defect per test in an otherwise valid description, and what is said of it.

mod support;

use punctual_modeldescription::{
    Causality, EnumerationItem, Initial, ModelDescription, NamingConvention, Unit, Variability, VariableKind,
};
use support::{real, small, variable};

/// Breaks the small model and compares the message.
fn refused(message: &str, break_it: impl FnOnce(&mut ModelDescription)) {
    let mut description = small();
    break_it(&mut description);
    let error = description.to_xml().expect_err("the description is broken");
    assert!(error.is_invalid() && !error.is_io());
    assert_eq!(error.to_string(), message);
    let parts = [error.path(), error.value(), error.allowed()].map(|part| part.expect("is invalid"));
    assert_eq!(message, format!("{} is {}; allowed: {}", parts[0], parts[1], parts[2]));
}

/// The same for one variable.
fn kind_refused(message: &str, position: usize, kind: VariableKind) {
    refused(message, |d| d.variables[position].kind = kind);
}

fn bounded(start: f64, min: f64, max: f64) -> VariableKind {
    VariableKind::Real {
        start: Some(start),
        min: Some(min),
        max: Some(max),
        nominal: None,
        quantity: None,
        unit: None,
    }
}

macro_rules! defects {
    ($($name:ident: $message:literal, $break_it:expr;)*) => {
        $(#[test] fn $name() { refused($message, $break_it); })*
    };
}

macro_rules! kind_defects {
    ($($name:ident: $message:literal, $position:literal, $kind:expr;)*) => {
        $(#[test] fn $name() { kind_refused($message, $position, $kind); })*
    };
}

// Rows: name of the test, message, defect.
defects! {
    no_model_name: r#"model_name is ""; allowed: a non-empty text"#, |d| d.model_name.clear();
    no_guid: r#"guid is ""; allowed: a non-empty text"#, |d| d.guid.clear();
    tab_in_guid: r#"guid is "a\tb"; allowed: one line without tabs"#, |d| d.guid = "a\tb".into();
    control_character: r#"description is "\u{1}"; allowed: characters of XML 1.0, not U+0001"#,
        |d| d.description = "\u{1}".into();
    line_break_in_version: r#"version is "1\n2"; allowed: one line without tabs"#, |d| d.version = "1\n2".into();
    local_date: r#"generation_date_and_time is "2026-01-31 12:00"; allowed: an instant in UTC as YYYY-MM-DDThh:mm:ssZ"#,
        |d| d.generation_date_and_time = Some("2026-01-31 12:00".into());
    identifier_with_dash:
        r#"co_simulation.model_identifier is "a-b"; allowed: a C identifier: ASCII letters, digits and underscores, no digit first"#,
        |d| d.co_simulation.model_identifier = "a-b".into();
    serialisable_but_not_readable:
        "co_simulation.can_serialize_state is true; allowed: false unless can_get_and_set_state is true",
        |d| d.co_simulation.can_get_and_set_state = false;

    same_unit_twice: r#"units[3].name is "m"; allowed: unique, but units[0] has the same"#,
        |d| d.units.push(Unit { name: "m".into(), ..Default::default() });
    unit_without_scale: r#"units["m"].base.factor is 0.0; allowed: finite and greater than 0"#,
        |d| d.units[0].base.factor = 0.0;
    unit_with_infinite_offset: r#"units["m"].base.offset is -INF; allowed: finite"#,
        |d| d.units[0].base.offset = f64::NEG_INFINITY;

    type_without_items: r#"enumerations["Status"].items is empty; allowed: at least one item"#,
        |d| d.enumerations[0].items.clear();
    same_item_value: r#"enumerations["Status"].items["worse"].value is 7; allowed: not the one of "bad""#,
        |d| d.enumerations[0].items.push(EnumerationItem { name: "worse".into(), value: 7, ..Default::default() });
    same_item_name: r#"enumerations["Status"].items[2].name is "bad"; allowed: unique, but enumerations["Status"].items[1] has the same"#,
        |d| d.enumerations[0].items.push(EnumerationItem { name: "bad".into(), value: 8, ..Default::default() });
    log_category_without_name: r#"log_categories[0].name is ""; allowed: a non-empty text"#,
        |d| d.log_categories[0].name.clear();

    start_of_experiment: "default_experiment.start_time is NaN; allowed: finite",
        |d| d.default_experiment.as_mut().unwrap().start_time = f64::NAN;
    stop_before_start: "default_experiment.stop_time is 0.0; allowed: finite and greater than 0.0",
        |d| d.default_experiment.as_mut().unwrap().stop_time = Some(0.0);
    step_backwards: "default_experiment.step_size is -0.1; allowed: finite and greater than 0",
        |d| d.default_experiment.as_mut().unwrap().step_size = Some(-0.1);
    no_tolerance: "default_experiment.tolerance is 0.0; allowed: finite and greater than 0",
        |d| d.default_experiment.as_mut().unwrap().tolerance = Some(0.0);

    no_variables: "variables is empty; allowed: at least one variable", |d| d.variables.clear();
    variable_without_name: r#"variables[2].name is ""; allowed: a non-empty text"#, |d| d.variables[2].name.clear();
    same_name: r#"variables[4].name is "u[1]"; allowed: unique, but variables[2] has the same"#,
        |d| d.variables[4].name = "u[1]".into();
    named_like_a_type: r#"variables[4].name is "Status"; allowed: not the name of a type"#,
        |d| d.variables[4].name = "Status".into();
    unstructured_name: r#"variables[4].name is "a b"; allowed: a structured name such as a, a.b[1] or der(a)"#,
        |d| d.variables[4].name = "a b".into();
    line_break_in_flat_name: r#"variables[4].name is "a\nb"; allowed: one line without tabs"#, |d| {
        d.variable_naming_convention = NamingConvention::Flat;
        d.variables[4].name = "a\nb".into();
    };
    same_value_reference: r#"variables["u[1]"].value_reference is 1 (Real); allowed: not the one of "rod.half""#,
        |d| d.variables[2].value_reference = 1;
    enumerations_share_value_references_with_integers:
        r#"variables["status"].value_reference is 0 (Integer); allowed: not the one of "count""#,
        |d| d.variables[8].value_reference = 0;

    continuous_parameter: r#"variables["rod.length"].variability is continuous; allowed: fixed or tunable for causality parameter"#,
        |d| d.variables[0].variability = Variability::Continuous;
    initial_of_input: r#"variables["u[1]"].initial is exact; allowed: nothing for continuous input"#,
        |d| d.variables[2].initial = Some(Initial::Exact);
    calculated_parameter_is_not_exact:
        r#"variables["rod.half"].initial is exact; allowed: calculated or approx for fixed calculatedParameter"#,
        |d| d.variables[1].initial = Some(Initial::Exact);
    continuous_boolean: r#"variables["rearm"].variability is continuous; allowed: not continuous, as the variable is not Real"#,
        |d| d.variables[4].variability = Variability::Continuous;
    two_independent_variables:
        r#"variables["t2"].causality is independent; allowed: not independent, as "t1" already is"#, |d| {
        for (name, value_reference) in [("t1", 100), ("t2", 101)] {
            let (causality, variability) = (Causality::Independent, Variability::Continuous);
            d.variables.push(variable(name, value_reference, causality, variability, real("1", None)));
        }
    };
    independent_variable_with_start: r#"variables["t"].start is given; allowed: nothing, as causality is independent"#,
        |d| {
            let (causality, variability) = (Causality::Independent, Variability::Continuous);
            d.variables.push(variable("t", 100, causality, variability, real("1", Some(0.0))));
        };
    exact_output_without_start: r#"variables["y"].start is missing; allowed: a value, as initial is exact"#,
        |d| d.variables[6].initial = Some(Initial::Exact);

    dependency_on_nothing_known:
        r#"variables["y"].dependencies is 99; allowed: value references of inputs, parameters or the independent variable"#,
        |d| d.variables[6].dependencies = Some(vec![2, 99]);
    dependency_on_an_exact_output:
        r#"variables["y"].dependencies is 4; allowed: value references of inputs, parameters or the independent variable"#,
        |d| d.variables[6].dependencies = Some(vec![4]);
    initial_dependency_on_an_output:
        r#"variables["y"].initial_dependencies is 3; allowed: value references of inputs, parameters, the independent variable or variables with initial exact"#,
        |d| d.variables[6].initial_dependencies = Some(vec![4, 3]);
    ambiguous_dependency:
        r#"variables["y"].dependencies is 0, which stands for "rod.length" and "count" and "rearm" and "label"; allowed: value references that stand for one variable"#,
        |d| d.variables[6].dependencies = Some(vec![0]);
    dependencies_of_an_input: r#"variables["u[1]"].dependencies is given; allowed: nothing, as this is not an output"#,
        |d| d.variables[2].dependencies = Some(vec![]);
    initial_dependencies_of_an_exact_output:
        r#"variables["der(y)"].initial_dependencies is given; allowed: nothing, as this is neither an output with initial approx or calculated nor a calculated parameter"#,
        |d| d.variables[7].initial_dependencies = Some(vec![]);
}

// Rows: name of the test, message, position of the variable, its broken kind.
kind_defects! {
    input_without_start: r#"variables["u[1]"].start is missing; allowed: a value, as causality is input"#, 2,
        real("1", None);
    calculated_with_start: r#"variables["y"].start is given; allowed: nothing, as initial is calculated"#, 6,
        real("1", Some(0.0));
    start_below_min: r#"variables["u[1]"].start is -1.5; allowed: -1.0 to 1.0"#, 2, bounded(-1.5, -1.0, 1.0);
    start_above_infinite_min: r#"variables["u[1]"].start is 2.0; allowed: -INF to 1.0"#, 2,
        bounded(2.0, f64::NEG_INFINITY, 1.0);
    start_not_a_number: r#"variables["u[1]"].start is NaN; allowed: -1.0 to 1.0"#, 2, bounded(f64::NAN, -1.0, 1.0);
    start_not_a_number_unbounded:
        r#"variables["u[1]"].start is NaN; allowed: finite, or infinite where the bound on that side is"#, 2,
        real("1", Some(f64::NAN));
    start_infinite:
        r#"variables["u[1]"].start is -INF; allowed: finite, or infinite where the bound on that side is"#, 2,
        real("1", Some(f64::NEG_INFINITY));
    max_below_min: r#"variables["u[1]"].max is 1.0; allowed: at least 2.0, the min"#, 2, bounded(1.0, 2.0, 1.0);
    min_not_a_number: r#"variables["u[1]"].min is NaN; allowed: finite or -INF"#, 2, bounded(1.0, f64::NAN, 1.0);
    max_infinitely_small: r#"variables["u[1]"].max is -INF; allowed: finite or INF"#, 2,
        bounded(1.0, 0.0, f64::NEG_INFINITY);
    nominal_of_zero: r#"variables["u[1]"].nominal is 0.0; allowed: finite and greater than 0"#, 2,
        VariableKind::Real { start: Some(0.0), min: None, max: None, nominal: Some(0.0), quantity: None, unit: None };
    unknown_unit: r#"variables["u[1]"].unit is "furlong"; allowed: the name of one of the description's units"#, 2,
        real("furlong", Some(0.0));
    integer_above_max: r#"variables["count"].start is 10; allowed: 1 to 9"#, 3,
        VariableKind::Integer { start: Some(10), min: Some(1), max: Some(9) };
    integer_below_min: r#"variables["count"].start is 0; allowed: at least 1"#, 3,
        VariableKind::Integer { start: Some(0), min: Some(1), max: None };
    integer_above_only_bound: r#"variables["count"].start is 0; allowed: at most -1"#, 3,
        VariableKind::Integer { start: Some(0), min: None, max: Some(-1) };
    text_with_control_character:
        r#"variables["label"].start is "\0"; allowed: characters of XML 1.0, not U+0000"#, 5,
        VariableKind::String { start: Some("\0".into()) };
    unknown_type:
        r#"variables["status"].declared_type is "State"; allowed: the name of one of the description's enumerations"#, 8,
        VariableKind::Enumeration { declared_type: "State".into(), start: None };
}

#[test]
fn start_that_is_no_item() {
    refused(r#"variables["status"].start is 1; allowed: one of 0, 7 (items of "Status")"#, |d| {
        d.variables[8].initial = Some(Initial::Exact);
        d.variables[8].kind = VariableKind::Enumeration { declared_type: "Status".into(), start: Some(1) };
    });
}
