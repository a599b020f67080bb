//! A small valid description with every kind of variable, for the tests to look at or to break.

use punctual_modeldescription::{
    BaseUnit, Causality, CoSimulation, DefaultExperiment, EnumerationItem, Initial, Integer, LogCategory,
    ModelDescription, NamingConvention, Plain, Real, SimpleType, Unit, Variability, Variable, VariableKind,
};

/// A real kind with unit and start value only.
pub(crate) fn real(unit: &str, start: Option<f64>) -> VariableKind {
    VariableKind::Real(Real { start, unit: Some(unit.into()), ..Real::default() })
}

/// A Boolean or text with a start value.
pub(crate) fn plain<T>(start: T) -> Plain<T> {
    Plain { start: Some(start), declared_type: None }
}

/// A variable with initial and dependencies left out.
pub(crate) fn variable(
    name: &str,
    value_reference: u32,
    causality: Causality,
    variability: Variability,
    kind: VariableKind,
) -> Variable {
    Variable {
        name: name.into(),
        value_reference,
        description: String::new(),
        causality,
        variability,
        initial: None,
        kind,
        dependencies: None,
        initial_dependencies: None,
    }
}

/// A unit without display units.
pub(crate) fn unit(name: &str, base: BaseUnit) -> Unit {
    Unit { name: name.into(), base: Some(base), display_units: Vec::new() }
}

/// A valid description with every kind of variable and every element.
pub(crate) fn small() -> ModelDescription {
    use Causality::{CalculatedParameter, Input, Local, Output, Parameter};
    use Variability::{Continuous, Discrete, Fixed, Tunable};
    let length = VariableKind::Real(Real {
        start: Some(0.1),
        min: Some(0.0),
        max: Some(f64::INFINITY),
        nominal: Some(1e-7),
        quantity: Some("Length".into()),
        unit: Some("m".into()),
        relative_quantity: true,
        ..Real::default()
    });
    ModelDescription {
        model_name: "Small <model> & \"more\"".into(),
        guid: "{00000000-0000-5000-8000-000000000001}".into(),
        description: "Every kind of variable".into(),
        author: "A. U. Thor".into(),
        version: "1.2".into(),
        copyright: "None".into(),
        license: "MIT".into(),
        generation_tool: "by hand".into(),
        generation_date_and_time: None,
        variable_naming_convention: NamingConvention::Structured,
        model_exchange: None,
        co_simulation: CoSimulation {
            model_identifier: "small_1".into(),
            can_handle_variable_step: true,
            can_get_and_set_state: true,
            can_serialize_state: true,
            ..Default::default()
        },
        units: vec![
            unit("m", BaseUnit { m: 1, ..Default::default() }),
            unit("deg/s", BaseUnit { rad: 1, s: -1, factor: 0.017453292519943295, ..Default::default() }),
            unit("1", BaseUnit::default()),
        ],
        types: vec![SimpleType::enumeration(
            "Status",
            "How it went",
            vec![
                EnumerationItem { name: "good".into(), value: 0, description: "Well".into() },
                EnumerationItem { name: "bad".into(), value: 7, description: String::new() },
            ],
        )],
        log_categories: vec![LogCategory { name: "logAll".into(), description: "Everything".into() }],
        default_experiment: Some(DefaultExperiment {
            start_time: Some(0.0),
            stop_time: Some(10.0),
            step_size: Some(0.01),
            tolerance: None,
        }),
        variables: vec![
            Variable {
                description: "Of the rod".into(),
                ..variable("rod.length", 0, Parameter, Fixed, length)
            },
            variable("rod.half", 1, CalculatedParameter, Fixed, real("m", None)),
            variable("u[1]", 2, Input, Continuous, real("1", Some(0.0))),
            variable(
                "count",
                0,
                Parameter,
                Tunable,
                VariableKind::Integer(Integer {
                    start: Some(3),
                    min: Some(1),
                    max: Some(9),
                    ..Integer::default()
                }),
            ),
            variable("rearm", 0, Input, Discrete, VariableKind::Boolean(plain(false))),
            variable("label", 0, Parameter, Fixed, VariableKind::String(plain("a\n<b>".into()))),
            Variable {
                dependencies: Some(vec![2]),
                initial_dependencies: Some(vec![2, 0x10, 2]),
                ..variable("y", 3, Output, Continuous, real("deg/s", None))
            },
            Variable {
                dependencies: Some(vec![]),
                initial: Some(Initial::Exact),
                ..variable("der(y)", 4, Output, Continuous, real("1", Some(-0.5)))
            },
            variable("status", 1, Output, Discrete, VariableKind::enumeration("Status")),
            Variable {
                initial: Some(Initial::Approx),
                ..variable("guess", 5, Local, Continuous, real("1", Some(1e300)))
            },
            variable("gain", 16, Parameter, Tunable, real("1", Some(2.0))),
        ],
    }
}
