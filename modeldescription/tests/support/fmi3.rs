//! A small valid description of FMI 3.0 with every type of variable, for the tests to look at or to break.

use punctual_modeldescription::fmi3::{
    Alias, Binary, CoSimulation, Dimension, EnumerationItem, Float, Integer, Interface, ModelDescription,
    ModelExchange, ModelStructure, Plain, TypeDefinition, Variable, VariableKind,
};
use punctual_modeldescription::{
    BaseUnit, Causality, DefaultExperiment, DisplayUnit, Initial, LogCategory, NamingConvention, Unit,
    Variability,
};

/// A number in a unit with these start values.
pub(crate) fn float(unit: &str, start: &[f64]) -> VariableKind {
    VariableKind::Float64(Float { start: start.to_vec(), unit: Some(unit.into()), ..Float::default() })
}

/// An integer with these start values.
pub(crate) fn integer(start: &[i128]) -> Integer {
    Integer { start: start.to_vec(), ..Integer::default() }
}

fn interface() -> Interface {
    Interface {
        model_identifier: "small_3".into(),
        can_get_and_set_state: true,
        can_serialize_state: true,
        provides_directional_derivatives: true,
        provides_adjoint_derivatives: true,
        ..Interface::default()
    }
}

/// A valid description with every kind of variable and every element but clocks.
pub(crate) fn small3() -> ModelDescription {
    use Causality::{CalculatedParameter, Independent, Input, Local, Output, Parameter, StructuralParameter};
    use Variability::{Constant, Continuous, Discrete, Fixed, Tunable};
    use VariableKind as K;
    let exact = |variable: Variable| Variable { initial: Some(Initial::Exact), ..variable };
    let size = Integer { min: Some(1), max: Some(8), ..integer(&[3]) };
    let radius = Float {
        quantity: Some("Length".into()),
        unit: Some("m".into()),
        display_unit: Some("mm".into()),
        min: Some(0.0),
        max: Some(f64::INFINITY),
        nominal: Some(1e-7),
        start: vec![0.1, 0.2, 0.3],
        ..Float::default()
    };
    let narrow = Float { start: vec![f64::from(0.1_f32)], unbounded: true, ..Float::default() };
    let rate = Float { derivative: Some(20), unit: Some("deg/s".into()), ..Float::default() };
    let variables = vec![
        Variable::new("time", 0, Independent, Continuous, float("s", &[])),
        Variable::new("obstacles", 1, StructuralParameter, Fixed, K::UInt64(size)),
        Variable {
            description: "Of the obstacles".into(),
            dimensions: vec![Dimension::of(1)],
            declared_type: Some("Length".into()),
            ..Variable::new("radius", 2, Parameter, Fixed, K::Float64(radius))
        },
        Variable {
            dimensions: vec![Dimension::fixed(2), Dimension::of(1)],
            aliases: vec![
                Alias {
                    name: "centre".into(),
                    description: "The same".into(),
                    display_unit: Some("mm".into()),
                },
                Alias { name: "c[1]".into(), ..Alias::default() },
            ],
            ..Variable::new("centres", 3, Parameter, Tunable, float("m", &[0.5]))
        },
        Variable::new("half", 4, CalculatedParameter, Fixed, float("m", &[])),
        Variable {
            dimensions: vec![Dimension::fixed(2)],
            ..Variable::new("u", 5, Input, Continuous, float("1", &[0.0, -1.5]))
        },
        Variable::new("narrow", 6, Input, Continuous, K::Float32(narrow)),
        Variable::new("i8", 7, Parameter, Fixed, K::Int8(integer(&[-128]))),
        Variable::new("u8", 8, Parameter, Fixed, K::UInt8(integer(&[255]))),
        Variable::new("i16", 9, Parameter, Fixed, K::Int16(integer(&[-32768]))),
        Variable::new("u16", 10, Parameter, Fixed, K::UInt16(integer(&[65535]))),
        Variable::new("i32", 11, Parameter, Tunable, K::Int32(integer(&[-2147483648]))),
        Variable::new("u32", 12, Parameter, Fixed, K::UInt32(integer(&[4294967295]))),
        Variable::new("i64", 13, Parameter, Fixed, K::Int64(integer(&[-9223372036854775808]))),
        Variable::new("u64", 14, Local, Constant, K::UInt64(integer(&[18446744073709551615]))),
        Variable {
            dimensions: vec![Dimension::fixed(2)],
            ..Variable::new("rearm", 15, Input, Discrete, K::Boolean(Plain { start: vec![false, true] }))
        },
        Variable {
            dimensions: vec![Dimension::fixed(2)],
            ..Variable::new(
                "label",
                16,
                Parameter,
                Fixed,
                K::String(Plain { start: vec!["a\n<b>".into(), String::new()] }),
            )
        },
        Variable::new(
            "blob",
            17,
            Parameter,
            Fixed,
            K::Binary(Binary {
                mime_type: Some("text/plain".into()),
                max_size: Some(9),
                start: vec![vec![0x0F, 0xA0]],
            }),
        ),
        Variable {
            declared_type: Some("Status".into()),
            ..Variable::new("status", 18, Output, Discrete, K::Enumeration(Integer::default()))
        },
        Variable {
            initial: Some(Initial::Approx),
            ..Variable::new("guess", 19, Local, Continuous, float("1", &[1e300]))
        },
        exact(Variable::new("y", 20, Output, Continuous, float("1", &[0.25]))),
        Variable::new("der(y)", 21, Local, Continuous, K::Float64(rate)),
    ];
    let mut structure = ModelStructure::of(&variables);
    for (list, reference, dependencies) in [
        (&mut structure.outputs, 18, vec![5, 15]),
        (&mut structure.derivatives, 21, vec![5]),
        (&mut structure.initial_unknowns, 21, vec![]),
    ] {
        let unknown =
            list.iter_mut().find(|unknown| unknown.value_reference == reference).expect("is listed");
        unknown.dependencies = Some(dependencies);
    }
    structure.derivatives[0].dependency_kinds = Some(vec!["constant".into()]);
    ModelDescription {
        model_name: "Small <model> & \"more\"".into(),
        instantiation_token: "{00000000-0000-5000-8000-000000000003}".into(),
        description: "Every type of variable".into(),
        author: "A. U. Thor".into(),
        version: "1.2".into(),
        copyright: "None".into(),
        license: "MIT".into(),
        generation_tool: "by hand".into(),
        variable_naming_convention: NamingConvention::Structured,
        model_exchange: Some(ModelExchange { interface: interface(), ..ModelExchange::default() }),
        co_simulation: Some(CoSimulation {
            interface: interface(),
            can_handle_variable_step: true,
            fixed_internal_step: Some(1e-3),
            ..CoSimulation::default()
        }),
        units: vec![
            Unit {
                name: "m".into(),
                base: Some(BaseUnit { m: 1, ..BaseUnit::default() }),
                display_units: vec![DisplayUnit {
                    name: "mm".into(),
                    factor: 1000.0,
                    offset: 0.0,
                    inverse: false,
                }],
            },
            Unit {
                name: "s".into(),
                base: Some(BaseUnit { s: 1, ..BaseUnit::default() }),
                display_units: vec![DisplayUnit {
                    name: "Hz".into(),
                    factor: 1.0,
                    offset: 0.0,
                    inverse: true,
                }],
            },
            Unit {
                name: "deg/s".into(),
                base: Some(BaseUnit { rad: 1, s: -1, factor: 0.017453292519943295, ..BaseUnit::default() }),
                display_units: Vec::new(),
            },
            Unit { name: "1".into(), base: Some(BaseUnit::default()), display_units: Vec::new() },
        ],
        types: vec![
            TypeDefinition {
                name: "Status".into(),
                description: "How it went".into(),
                kind: VariableKind::Enumeration(Integer::default()),
                items: vec![
                    EnumerationItem { name: "good".into(), value: 0, description: "Well".into() },
                    EnumerationItem { name: "bad".into(), value: 9_000_000_000, description: String::new() },
                ],
            },
            TypeDefinition {
                name: "Length".into(),
                description: String::new(),
                kind: VariableKind::Float64(Float { unit: Some("m".into()), ..Float::default() }),
                items: Vec::new(),
            },
        ],
        log_categories: vec![LogCategory { name: "logAll".into(), description: "Everything".into() }],
        default_experiment: Some(DefaultExperiment {
            start_time: Some(0.0),
            stop_time: Some(10.0),
            step_size: Some(0.01),
            tolerance: None,
        }),
        variables,
        structure,
        ..ModelDescription::default()
    }
}
