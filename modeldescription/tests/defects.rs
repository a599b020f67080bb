//! Defects of an otherwise valid description, one per test, each with its message.

mod support;

use punctual_modeldescription::{
    Causality, DisplayUnit, EnumerationItem, Initial, Integer, ModelDescription, NamingConvention, Real,
    Variability, VariableKind,
};
use support::{plain, real, small, unit, variable};

/// Breaks the small model and compares the message.
fn refused(message: &str, break_it: impl FnOnce(&mut ModelDescription)) {
    let mut description = small();
    break_it(&mut description);
    let error = description.to_xml().expect_err("the description is broken");
    assert!(error.is_invalid() && !error.is_io());
    assert_eq!(error.to_string(), message);
    let path = error.path().expect("is invalid");
    if let Some(rule) = error.broken_rule() {
        assert!(punctual_modeldescription::RULES.iter().any(|row| row.0 == rule), "{rule}");
        assert!(message.starts_with(&format!("{path}: ")), "{message}");
        return;
    }
    let [value, allowed] = [error.value(), error.allowed()].map(|part| part.expect("is invalid"));
    assert_eq!(message, format!("{path} is {value}; allowed: {allowed}"));
}

/// The same for one variable.
fn kind_refused(message: &str, position: usize, kind: VariableKind) {
    refused(message, |d| d.variables[position].kind = kind);
}

fn bounded(start: f64, min: f64, max: f64) -> VariableKind {
    VariableKind::Real(Real { start: Some(start), min: Some(min), max: Some(max), ..Real::default() })
}

fn status(start: i32) -> VariableKind {
    let declared_type = Some("Status".into());
    VariableKind::Enumeration(Integer { start: Some(start), declared_type, ..Integer::default() })
}

fn integer(start: i32, min: Option<i32>, max: Option<i32>) -> VariableKind {
    VariableKind::Integer(Integer { start: Some(start), min, max, ..Integer::default() })
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
    no_guid: "description: guid is empty; must be a text that no other FMU has", |d| d.guid.clear();
    tab_in_guid: r#"guid is "a\tb"; allowed: one line without tabs"#, |d| d.guid = "a\tb".into();
    control_character: r#"description is "\u{1}"; allowed: characters of XML 1.0, not U+0001"#,
        |d| d.description = "\u{1}".into();
    line_break_in_version: r#"version is "1\n2"; allowed: one line without tabs"#, |d| d.version = "1\n2".into();
    local_date: r#"generation_date_and_time is "2026-01-31 12:00"; allowed: an instant in UTC as YYYY-MM-DDThh:mm:ssZ"#,
        |d| d.generation_date_and_time = Some("2026-01-31 12:00".into());
    identifier_with_dash:
        r#"co_simulation: modelIdentifier is "a-b"; must be a C identifier (letters, digits, underscores, no digit first), since it names the library"#,
        |d| d.co_simulation.model_identifier = "a-b".into();
    serialisable_but_not_readable:
        "co_simulation: canSerializeFMUstate is true, so canGetAndSetFMUstate must be true; it is false",
        |d| d.co_simulation.can_get_and_set_state = false;

    same_unit_twice: r#"units["m"]: the unit "m" is defined twice"#,
        |d| d.units.push(unit("m", Default::default()));
    display_unit_without_scale: r#"units["m"].display_units[0]: the unit "km" has the factor 0; must be finite and not 0"#,
        |d| d.units[0].display_units.push(DisplayUnit { name: "km".into(), factor: 0.0, offset: 0.0, inverse: false });
    unit_without_scale: r#"units["m"]: the unit "m" has the factor 0; must be finite and not 0"#,
        |d| d.units[0].base.as_mut().unwrap().factor = 0.0;
    unit_turned_around: r#"units["m"].base.factor is -2.0; allowed: finite and greater than 0"#,
        |d| d.units[0].base.as_mut().unwrap().factor = -2.0;
    unit_with_infinite_offset: r#"units["m"].base.offset is -INF; allowed: finite"#,
        |d| d.units[0].base.as_mut().unwrap().offset = f64::NEG_INFINITY;

    type_with_a_start_value:
        r#"types["Status"].kind is that of a variable; allowed: no declared type, no start value"#,
        |d| d.types[0].kind = status(7);
    items_of_no_enumeration: r#"types["Status"].items is given; allowed: nothing, as this is no enumeration"#,
        |d| {
            d.types[0].kind = VariableKind::Integer(Integer::default());
            d.variables.remove(8);
        };
    type_without_items: r#"types["Status"].items is empty; allowed: at least one item"#,
        |d| d.types[0].items.clear();
    same_item_value: r#"types["Status"].items[2]: the items "bad" and "worse" of "Status" have the same value 7"#,
        |d| d.types[0].items.push(EnumerationItem { name: "worse".into(), value: 7, ..Default::default() });
    same_item_name: r#"types["Status"].items[2]: the type "Status" has the item "bad" twice"#,
        |d| d.types[0].items.push(EnumerationItem { name: "bad".into(), value: 8, ..Default::default() });
    log_category_without_name: r#"log_categories[0].name is ""; allowed: a non-empty text"#,
        |d| d.log_categories[0].name.clear();
    log_category_twice: r#"log_categories[1]: the log category "logAll" is defined twice"#,
        |d| d.log_categories = vec![d.log_categories[0].clone(), d.log_categories[0].clone()];

    start_of_experiment: "default_experiment: startTime is NaN; must be finite",
        |d| d.default_experiment.as_mut().unwrap().start_time = Some(f64::NAN);
    stop_before_start: "default_experiment: stopTime is 0; must be greater than startTime = 0",
        |d| d.default_experiment.as_mut().unwrap().stop_time = Some(0.0);
    step_backwards: "default_experiment: stepSize is -0.1; must be finite and > 0",
        |d| d.default_experiment.as_mut().unwrap().step_size = Some(-0.1);
    no_tolerance: "default_experiment: tolerance is 0; must be finite and > 0",
        |d| d.default_experiment.as_mut().unwrap().tolerance = Some(0.0);

    no_variables: "variables is empty; allowed: at least one variable", |d| d.variables.clear();
    variable_without_name: r#"variables[""]: the name "" is empty"#, |d| d.variables[2].name.clear();
    same_name: r#"variables["u[1]"]: the name "u[1]" is also that of variable 3 (from 1)"#,
        |d| d.variables[4].name = "u[1]".into();
    named_like_a_type: r#"types["Status"]: the type "Status" has the name of a variable; names must differ"#,
        |d| d.variables[4].name = "Status".into();
    unstructured_name: r#"variables["a b"]: the name "a b" does not follow variableNamingConvention = structured: identifiers such as a.b[1,2].'c d' or der(x)"#,
        |d| d.variables[4].name = "a b".into();
    line_break_in_flat_name: r#"variables["a\nb"]: the name "a\nb" holds a tab or a line break"#, |d| {
        d.variable_naming_convention = NamingConvention::Flat;
        d.variables[4].name = "a\nb".into();
    };
    same_value_reference: r#"variables["u[1]"].value_reference is 1 (Real); allowed: not the one of "rod.half""#,
        |d| d.variables[2].value_reference = 1;
    enumerations_share_value_references_with_integers:
        r#"variables["status"].value_reference is 0 (Integer); allowed: not the one of "count""#,
        |d| d.variables[8].value_reference = 0;

    continuous_parameter: r#"variables["rod.length"]: causality = parameter with variability = continuous is not allowed; allowed variability: fixed, tunable"#,
        |d| d.variables[0].variability = Variability::Continuous;
    initial_of_input: r#"variables["u[1]"]: causality = input with variability = continuous does not go with initial = exact; allowed: none"#,
        |d| d.variables[2].initial = Some(Initial::Exact);
    calculated_parameter_is_not_exact:
        r#"variables["rod.half"]: causality = calculatedParameter with variability = fixed does not go with initial = exact; allowed: calculated, approx"#,
        |d| d.variables[1].initial = Some(Initial::Exact);
    continuous_boolean: r#"variables["rearm"]: Boolean variables cannot have variability = continuous (which is the default)"#,
        |d| d.variables[4].variability = Variability::Continuous;
    two_independent_variables:
        r#"variables["t2"]: "t1" is independent too; at most one variable may be"#, |d| {
        for (name, value_reference) in [("t1", 100), ("t2", 101)] {
            let (causality, variability) = (Causality::Independent, Variability::Continuous);
            d.variables.push(variable(name, value_reference, causality, variability, real("1", None)));
        }
    };
    independent_variable_with_start: r#"variables["t"].start: has a start value; must have none, because it is the independent variable"#,
        |d| {
            let (causality, variability) = (Causality::Independent, Variability::Continuous);
            d.variables.push(variable("t", 100, causality, variability, real("1", Some(0.0))));
        };
    exact_output_without_start: r#"variables["y"]: has no start value; must have one, because initial = exact"#,
        |d| d.variables[6].initial = Some(Initial::Exact);

    dependency_on_nothing_known:
        r#"variables["y"].dependencies is 99; allowed: value references of inputs, parameters, the independent variable or, with model exchange, states"#,
        |d| d.variables[6].dependencies = Some(vec![2, 99]);
    dependency_on_an_exact_output:
        r#"variables["y"].dependencies is 4; allowed: value references of inputs, parameters, the independent variable or, with model exchange, states"#,
        |d| d.variables[6].dependencies = Some(vec![4]);
    initial_dependency_on_an_output:
        r#"variables["y"].initial_dependencies is 3; allowed: value references of inputs, parameters, the independent variable or variables with initial exact"#,
        |d| d.variables[6].initial_dependencies = Some(vec![4, 3]);
    ambiguous_dependency:
        r#"variables["y"].dependencies is 0, which is that of "rod.length" and "count" and "rearm" and "label"; allowed: value references of exactly one variable"#,
        |d| d.variables[6].dependencies = Some(vec![0]);
    dependencies_of_an_input: r#"variables["u[1]"].dependencies is given; allowed: nothing, as this is neither an output nor, with model exchange, the derivative of a state"#,
        |d| d.variables[2].dependencies = Some(vec![]);
    initial_dependencies_of_an_exact_output:
        r#"variables["der(y)"].initial_dependencies is given; allowed: nothing, as this is neither an output with initial approx or calculated, nor a calculated parameter, nor with model exchange a derivative or state computed then"#,
        |d| d.variables[7].initial_dependencies = Some(vec![]);
}

// Rows: name of the test, message, position of the variable, its broken kind.
kind_defects! {
    input_without_start: r#"variables["u[1]"]: has no start value; must have one, because it is an input"#, 2,
        real("1", None);
    calculated_with_start: r#"variables["y"].start: has a start value; must have none, because initial = calculated"#, 6,
        real("1", Some(0.0));
    start_below_min: r#"variables["u[1]"].start: start is -1.5; must be in [-1, 1]"#, 2, bounded(-1.5, -1.0, 1.0);
    start_above_infinite_min: r#"variables["u[1]"].start: start is 2; must be in [-inf, 1]"#, 2,
        bounded(2.0, f64::NEG_INFINITY, 1.0);
    start_not_a_number: r#"variables["u[1]"].start: start is NaN; must be in [-1, 1]"#, 2, bounded(f64::NAN, -1.0, 1.0);
    start_not_a_number_unbounded:
        r#"variables["u[1]"].start: start is NaN; must be in [-inf, inf]"#, 2,
        real("1", Some(f64::NAN));
    start_infinite:
        r#"variables["u[1]"].start is -INF; allowed: finite, or infinite where the bound on that side is"#, 2,
        real("1", Some(f64::NEG_INFINITY));
    max_below_min: r#"variables["u[1]"]: has min = 2 and max = 1; must be min <= max"#, 2, bounded(1.0, 2.0, 1.0);
    min_not_a_number: r#"variables["u[1]"]: has min = NaN and max = 1; must be min <= max"#, 2, bounded(1.0, f64::NAN, 1.0);
    max_infinitely_small: r#"variables["u[1]"].max is -INF; allowed: finite or INF"#, 2,
        bounded(f64::NEG_INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY);
    nominal_of_zero: r#"variables["u[1]"].nominal is 0.0; allowed: finite and greater than 0"#, 2,
        VariableKind::Real(Real { start: Some(0.0), nominal: Some(0.0), ..Real::default() });
    unknown_unit: r#"variables["u[1]"]: the unit "furlong" is not among UnitDefinitions"#, 2,
        real("furlong", Some(0.0));
    integer_above_max: r#"variables["count"].start: start is 10; must be in [1, 9]"#, 3,
        integer(10, Some(1), Some(9));
    integer_below_min: r#"variables["count"].start: start is 0; must be in [1, inf]"#, 3,
        integer(0, Some(1), None);
    integer_above_only_bound: r#"variables["count"].start: start is 0; must be in [-inf, -1]"#, 3,
        integer(0, None, Some(-1));
    text_with_control_character:
        r#"variables["label"].start is "\0"; allowed: characters of XML 1.0, not U+0000"#, 5,
        VariableKind::String(plain("\0".into()));
    unknown_type:
        r#"variables["status"]: declaredType "State" is not among TypeDefinitions"#, 8,
        VariableKind::enumeration("State");
    enumeration_without_a_type:
        r#"variables["status"].declared_type is missing; allowed: the name of one of the description's types"#, 8,
        VariableKind::Enumeration(Integer::default());
}

#[test]
fn start_that_is_no_item() {
    refused(r#"variables["status"].start: start is 1; must be a value of Status: 0 good, 7 bad"#, |d| {
        d.variables[8].initial = Some(Initial::Exact);
        d.variables[8].kind = status(1);
    });
}
