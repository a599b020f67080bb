//! Defects of an otherwise valid description of FMI 3.0, one at a time, each with its message.

#[path = "support/fmi3.rs"]
mod support;

use punctual_modeldescription::fmi3::{
    Alias, Clock, Dimension, Float, IntervalVariability, Located, ModelDescription, Plain, Unknown, Variable,
    VariableKind,
};
use punctual_modeldescription::{Causality, Initial, NamingConvention, RULES, Severity, Variability};
use roxmltree::Document;
use support::{float, integer, small3};

/// A message, and the defect that has it.
type Row = (&'static str, fn(&mut ModelDescription));

fn start(d: &mut ModelDescription, v: usize) -> &mut Vec<f64> {
    &mut d.variables[v].kind.as_float_mut().expect("a number").start
}

/// Defects that break a rule of the standard.
const OF_THE_STANDARD: &[Row] = &[
    ("description: instantiationToken is empty; must be a text that no other FMU has", |d| {
        d.instantiation_token.clear();
    }),
    (
        "description: there is neither ModelExchange nor CoSimulation nor ScheduledExecution; must have one",
        |d| {
            (d.model_exchange, d.co_simulation) = (None, None);
        },
    ),
    (
        "model_exchange: modelIdentifier is \"a-b\"; must be a C identifier (letters, digits, underscores, no digit first), since it names the library",
        |d| {
            d.model_exchange.as_mut().unwrap().interface.model_identifier = "a-b".into();
        },
    ),
    ("co_simulation: canSerializeFMUState is true, so canGetAndSetFMUState must be true; it is false", |d| {
        d.co_simulation.as_mut().unwrap().interface.can_get_and_set_state = false;
    }),
    (
        "co_simulation: canReturnEarlyAfterIntermediateUpdate is true, so providesIntermediateUpdate must be true; it is false",
        |d| {
            d.co_simulation.as_mut().unwrap().can_return_early_after_intermediate_update = true;
        },
    ),
    ("co_simulation: hasEventMode is false, though \"rearm\" is a Clock; must be true", |d| {
        let clock = Clock { interval_variability: Some(IntervalVariability::Triggered), ..Clock::default() };
        d.variables[15].kind = VariableKind::Clock(clock);
    }),
    ("co_simulation: fixedInternalStepSize is 0; must be finite and > 0", |d| {
        d.co_simulation.as_mut().unwrap().fixed_internal_step = Some(0.0);
    }),
    ("default_experiment: stopTime is -1; must be greater than startTime = 0", |d| {
        d.default_experiment.as_mut().unwrap().stop_time = Some(-1.0);
    }),
    (
        "units[\"s\"].display_units[0]: the display unit \"Hz\" is inverse and has the offset 1; must have none",
        |d| {
            d.units[1].display_units[0].offset = 1.0;
        },
    ),
    ("types[\"Status\"].items[1]: the items \"good\" and \"bad\" of \"Status\" have the same value 0", |d| {
        d.types[0].items[1].value = 0;
    }),
    ("variables[\"radius\"]: declaredType \"Status\" is a type of Enumeration; must be of Float64", |d| {
        d.variables[2].declared_type = Some("Status".into());
    }),
    ("variables[\"radius\"]: the unit \"ft\" is not among UnitDefinitions", |d| {
        d.variables[2].kind.as_float_mut().unwrap().unit = Some("ft".into());
    }),
    ("variables[\"half\"]: the name \"half\" is also that of variable 5 (from 1)", |d| {
        d.variables[5].name = "half".into();
    }),
    ("variables[\"u\"]: the name \"u\" is also that of variable 4 (from 1)", |d| {
        d.variables[3].aliases[1].name = "u".into();
    }),
    (
        "variables[\"centres\"].aliases[0]: the name \"a b\" does not follow variableNamingConvention = structured: identifiers such as a.b[1,2].'c d' or der(x)",
        |d| {
            d.variables[3].aliases[0].name = "a b".into();
        },
    ),
    ("variables[\"centres\"].aliases[0]: the unit \"m\" has no display unit \"ft\"", |d| {
        d.variables[3].aliases[0].display_unit = Some("ft".into());
    }),
    (
        "variables[\"u\"]: has the value reference 4, which is that of \"half\"; must be that of no other variable (another name of the same is an Alias)",
        |d| {
            d.variables[5].value_reference = 4;
        },
    ),
    (
        "variables[\"obstacles\"]: causality = structuralParameter with variability = constant is not allowed; allowed variability: fixed, tunable",
        |d| {
            d.variables[1].variability = Variability::Constant;
        },
    ),
    (
        "variables[\"u\"]: causality = input with variability = continuous does not go with initial = approx; allowed: exact",
        |d| {
            d.variables[5].initial = Some(Initial::Approx);
        },
    ),
    ("variables[\"rearm\"]: Boolean variables cannot have variability = continuous", |d| {
        d.variables[15].variability = Variability::Continuous;
    }),
    ("variables[\"u\"]: has no start value; must have one, because it is an input", |d| start(d, 5).clear()),
    ("variables[\"half\"].start: has a start value; must have none, because initial = calculated", |d| {
        start(d, 4).push(1.0);
    }),
    ("variables[\"radius\"].start: start is -0.2; must be in [0, inf]", |d| start(d, 2)[1] = -0.2),
    ("variables[\"radius\"].start: has 2 start values; must have 1 or 3, as the dimensions say: 3", |d| {
        start(d, 2).pop();
    }),
    ("variables[\"label\"].start: has 3 start values; must have 1 or 2, as the dimensions say: 2", |d| {
        d.variables[16].kind = VariableKind::String(Plain { start: vec![String::new(); 3] });
    }),
    ("variables[\"u8\"].start: has 2 start values; must have 1", |d| {
        d.variables[8].kind = VariableKind::UInt8(integer(&[1, 2]));
    }),
    ("variables[\"obstacles\"]: is a structural parameter and has a Dimension; must have none", |d| {
        d.variables[1].dimensions.push(Dimension::fixed(1));
    }),
    ("variables[\"u\"]: dimension 1 (from 1) has start = 0; must be at least 1", |d| {
        d.variables[5].dimensions = vec![Dimension::fixed(0)];
    }),
    ("variables[\"u\"]: dimension 1 (from 1) must have either start or valueReference", |d| {
        d.variables[5].dimensions = vec![Dimension::default()];
    }),
    ("variables[\"u\"]: dimension 1 (from 1) has valueReference = 99; must be that of a variable", |d| {
        d.variables[5].dimensions = vec![Dimension::of(99)];
    }),
    (
        "variables[\"u\"]: dimension 1 (from 1) has the size \"u8\", which must be a structural parameter or a constant of type UInt64",
        |d| {
            d.variables[5].dimensions = vec![Dimension::of(8)];
        },
    ),
    (
        "variables[\"radius\"]: dimension 1 (from 1) has the size \"obstacles\", which starts at 0; must start at 1 or more",
        |d| {
            d.variables[1].kind = VariableKind::UInt64(integer(&[0]));
        },
    ),
    ("description: no variable is independent; exactly one must be, usually time", |d| {
        d.variables.remove(0);
    }),
    ("variables[\"t\"]: \"time\" is independent too; at most one variable may be", |d| {
        let variable =
            Variable::new("t", 99, Causality::Independent, Variability::Continuous, float("s", &[]));
        d.variables.push(variable);
    }),
    ("variables[\"der(y)\"]: derivative is 99; must be the value reference of a variable", |d| {
        d.variables[21].kind.as_float_mut().unwrap().derivative = Some(99);
    }),
    ("variables[\"der(y)\"]: derivative names \"u8\", which is not a continuous number", |d| {
        d.variables[21].kind.as_float_mut().unwrap().derivative = Some(8);
    }),
    ("variables[\"der(y)\"]: derivative names the variable itself; must name another", |d| {
        d.variables[21].kind.as_float_mut().unwrap().derivative = Some(21);
    }),
    ("variables[\"der(y)\"]: derivative names \"y\", which has other dimensions", |d| {
        d.variables[21].dimensions = vec![Dimension::fixed(2)];
    }),
    ("variables[\"rearm\"]: clocks names 5, which is not the value reference of a Clock", |d| {
        d.variables[15].clocks = vec![5];
    }),
    ("variables[\"rearm\"]: has intermediateUpdate and variability = discrete; must be continuous", |d| {
        d.variables[15].intermediate_update = true;
    }),
    ("structure.Outputs: Output does not list \"y\" (value reference 20)", |d| {
        d.structure.outputs.pop();
    }),
    ("structure.Outputs[2]: Output lists \"u\" (value reference 5), which does not belong there", |d| {
        d.structure.outputs.push(Unknown::new(5));
    }),
    ("structure.Outputs[2]: Output lists \"y\" (value reference 20) twice", |d| {
        d.structure.outputs.push(Unknown::new(20));
    }),
    ("structure.Outputs[2]: Output: valueReference is 99; must be that of a variable", |d| {
        d.structure.outputs.push(Unknown::new(99));
    }),
    (
        "structure.Outputs[0]: Output: dependencies name the value reference 99; must be that of a variable",
        |d| {
            d.structure.outputs[0].dependencies = Some(vec![5, 99]);
        },
    ),
    (
        "structure.Derivatives[0]: ContinuousStateDerivative: 2 dependencies, but 1 words in dependenciesKind; must be as many",
        |d| {
            d.structure.derivatives[0].dependencies = Some(vec![5, 15]);
        },
    ),
    (
        "structure.InitialUnknowns[2]: InitialUnknown: dependenciesKind \"fixed\"; allowed here: dependent, constant",
        |d| {
            d.structure.initial_unknowns[2].dependencies = Some(vec![5]);
            d.structure.initial_unknowns[2].dependency_kinds = Some(vec!["fixed".into()]);
        },
    ),
    (
        "structure.Derivatives[1]: ContinuousStateDerivative lists \"y\", which has no attribute derivative",
        |d| {
            d.structure.derivatives.push(Unknown::new(20));
        },
    ),
    ("structure.InitialUnknowns: InitialUnknown does not list \"half\" (value reference 4)", |d| {
        d.structure.initial_unknowns.remove(0);
    }),
    (
        "structure.ClockedStates[0]: ClockedState lists \"y\" (value reference 20), which does not belong there",
        |d| {
            d.structure.clocked_states.push(Unknown::new(20));
        },
    ),
    (
        "structure.EventIndicators[0]: EventIndicator lists \"status\" (value reference 18), which does not belong there",
        |d| {
            d.structure.event_indicators.push(Unknown::new(18));
        },
    ),
];

/// Defects that the schema would find, or that are our own demands.
const OF_WRITING: &[Row] = &[
    ("model_name is \"\"; allowed: a non-empty text", |d| d.model_name.clear()),
    ("version is \"1\\n2\"; allowed: one line without tabs", |d| d.version = "1\n2".into()),
    ("units[\"m\"].base.factor is -2.0; allowed: finite and greater than 0", |d| {
        d.units[0].base.as_mut().unwrap().factor = -2.0;
    }),
    ("types[\"Status\"].items is empty; allowed: at least one item", |d| {
        d.types[0].items.clear();
    }),
    (
        "types[\"Length\"].kind is that of a variable; allowed: no start value, no derivative, no reinit",
        |d| {
            d.types[1].kind = float("m", &[1.0]);
        },
    ),
    ("log_categories[0].name is \"\"; allowed: a non-empty text", |d| d.log_categories[0].name.clear()),
    ("variables[\"u8\"].start is 256; allowed: a value of UInt8, 0 to 255", |d| {
        d.variables[8].kind = VariableKind::UInt8(integer(&[256]));
    }),
    ("variables[\"narrow\"].kind is 0.1; allowed: a number of 32 bits, such as 0.10000000149011612", |d| {
        d.variables[6].kind = VariableKind::Float32(Float { start: vec![0.1], ..Float::default() });
    }),
    ("variables[\"y\"].start is INF; allowed: finite, or infinite where the bound on that side is", |d| {
        start(d, 20)[0] = f64::INFINITY;
    }),
    ("variables[\"label\"].start is \"\\0\"; allowed: characters of XML 1.0, not U+0000", |d| {
        d.variables[16].kind = VariableKind::String(Plain { start: vec!["\0".into()] });
    }),
    (
        "variables[\"status\"].declared_type is missing; allowed: the name of one of the description's types",
        |d| {
            d.variables[18].declared_type = None;
        },
    ),
];

#[test]
fn each_defect_is_refused_in_its_words() {
    let mut differences = Vec::new();
    for (of_the_standard, rows) in [(true, OF_THE_STANDARD), (false, OF_WRITING)] {
        for (message, break_it) in rows {
            let mut description = small3();
            break_it(&mut description);
            let error = description.to_xml().expect_err(message);
            if error.to_string() != *message {
                differences.push(format!("wanted {message}\nfound  {error}"));
            }
            assert_eq!(error.broken_rule().is_some(), of_the_standard, "{error}");
            assert!(error.broken_rule().is_none_or(|rule| RULES.iter().any(|row| row.0 == rule)), "{error}");
        }
    }
    assert!(differences.is_empty(), "{}", differences.join("\n"));
}

#[test]
fn warnings_refuse_nothing() {
    let rows: [(&str, Row); 2] = [
        (
            "structure.states",
            ("ContinuousStateDerivative does not list \"der(y)\" (value reference 21)", |d| {
                d.structure.derivatives.clear();
                d.structure.initial_unknowns.retain(|unknown| unknown.value_reference != 21);
            }),
        ),
        (
            "structure.kinds",
            (
                "Output: dependenciesKind \"constant\" of \"status\", which is Enumeration; allowed here: dependent",
                |d| {
                    d.structure.outputs[0].dependency_kinds =
                        Some(vec!["constant".into(), "dependent".into()]);
                },
            ),
        ),
    ];
    for (rule, (message, break_it)) in rows {
        let mut description = small3();
        break_it(&mut description);
        let xml = description.to_xml().expect("a warning refuses nothing");
        let mut found = Vec::new();
        let document = Document::parse(&xml).expect("well-formed");
        Located::read(&document).check(&mut |v| found.push((v.rule, v.message)));
        assert!(found.contains(&(rule, message.to_owned())), "{found:?}");
        assert!(RULES.iter().any(|row| row.0 == rule && row.1 == Severity::Warning));
    }
}

#[test]
fn flat_names_may_be_any_text_on_one_line() {
    let mut description = small3();
    description.variable_naming_convention = NamingConvention::Flat;
    description.variables[5].name = "anything goes!".into();
    description.variables[5].aliases.push(Alias { name: "so does this".into(), ..Alias::default() });
    description.to_xml().expect("valid");
    description.variables[5].aliases[0].name = "a\tb".into();
    let error = description.to_xml().expect_err("a tab").to_string();
    assert_eq!(
        error,
        r#"variables["anything goes!"].aliases[0]: the name "a\tb" holds a tab or a line break"#
    );
}
