//! The variable table, the model description and the GUID of every kind of configuration.

use std::collections::{BTreeMap, BTreeSet};

use punctual_modeldescription::BaseUnit;

use super::*;

const BARRIER: &str = "[[barrier]]\nname = \"goal\"\ncentre = [45.0, 44.0]\nradius = 2.0\ndeadline = 10.0\n";

/// A filter that integrates the steering angle itself.
const STEERED: &str = "kind = \"filter\"\nplant.model = \"bicycle_kinematic\"\nintegrator.state = \"delta\"\n\
                       [[barrier]]\nname = \"goal\"\ncentre = [45.0, 44.0]\nradius = 2.0\ndeadline = 10.0\n";

fn product(text: &str) -> Product {
    let configuration = Configuration::parse(text).unwrap_or_else(|e| panic!("{e} in {text}"));
    Product::new(configuration).unwrap()
}

/// Every model, as a plant, and as a filter with either shape, method and feedthrough.
fn every_product() -> Vec<Product> {
    let mut products = Vec::new();
    for model in ["bicycle_small_slip", "bicycle_kinematic_angle", "bicycle_kinematic_slip"] {
        products.push(product(&format!("kind = \"plant\"\nplant.model = \"{model}\"")));
    }
    products.push(product(STEERED));
    products.push(product(include_str!("../../../examples/models/external-filter.toml")));
    for model in ["point_mass", "unicycle", "bicycle", "bicycle_small_slip_rate", "bicycle_kinematic"] {
        products.push(product(&format!("kind = \"plant\"\nplant.model = \"{model}\"")));
        for shape in ["disc", "quadratic_disc", "obstacle"] {
            for method in ["reference_profile", "repeated_root"] {
                for feedthrough in [true, false] {
                    products.push(product(&format!(
                        "kind = \"filter\"\ndirect_feedthrough = {feedthrough}\nplant.model = \"{model}\"\n\
                         {BARRIER}shape = \"{shape}\"\nmethod = \"{method}\"\n{}",
                        BARRIER.replace("goal", "other")
                    )));
                }
            }
        }
    }
    // One input, whose limits are named like bounds.
    for limits in ["", "integrator.min = -1\nintegrator.max = 2\n"] {
        products.push(product(&format!(
            "kind = \"filter\"\nintegrator.state = \"a\"\n{limits}[plant]\nderivatives = {{ p = \"v\", v = \"a\", a = \"j\" }}\n\
             states = [{{ name = \"p\" }}, {{ name = \"v\" }}, {{ name = \"a\" }}]\n\
             inputs = [{{ name = \"j\", min = -5, max = 5 }}]\n[[barrier]]\nname = \"hi\"\nexpression = \"2 - p\"\ndeadline = 3"
        )));
    }
    products.extend(controllers().iter().map(|text| product(text)));
    products
}

/// Every controller with every model that supports it.
fn controllers() -> Vec<String> {
    let mut texts = Vec::new();
    for model in ["point_mass", "unicycle", "bicycle", "bicycle_small_slip", "bicycle_kinematic_slip"] {
        for rest in [
            "controller = \"damping\"",
            "controller = \"heading\"\ngoal = [4.0, -3.0]",
            "controller = \"heading\"\ngoal = [4.0, -3.0]\ngoal_input = true",
            "controller = \"waypoints\"\npoints = [[1.0, 2.0], [3.0, 4.0]]",
            "controller = \"waypoints\"\npoints = [[1.0, 2.0]]\ndirect_feedthrough = false",
        ] {
            texts.push(format!("kind = \"controller\"\nplant.model = \"{model}\"\n{rest}\n"));
        }
    }
    for model in ["bicycle_small_slip_rate", "bicycle_kinematic", "bicycle_kinematic_angle"] {
        texts.push(format!("kind = \"controller\"\nplant.model = \"{model}\"\ncontroller = \"damping\"\n"));
    }
    texts
}

#[test]
fn every_product_has_a_valid_model_description() {
    for product in every_product() {
        let name = product.configuration.name();
        let xml = product.model_description().to_xml().unwrap_or_else(|e| panic!("{name}: {e}"));
        assert!(xml.contains(&product.guid), "{name}: {xml}");
        for (flag, there) in [
            ("canGetAndSetFMUstate", true),
            ("canSerializeFMUstate", true),
            ("providesDirectionalDerivative", true),
            ("canInterpolateInputs", false),
            ("canRunAsynchronuously", false),
        ] {
            assert_eq!(xml.contains(&format!("{flag}=\"true\"")), there, "{name}: {flag}");
        }
        assert!(!xml.contains("maxOutputDerivativeOrder"), "{name}: 0, its default");
    }
}

#[test]
fn every_unit_has_its_exponents() {
    let mut seen = BTreeSet::new();
    for product in every_product() {
        let units: BTreeMap<_, _> = units(product.variables.iter().filter_map(|v| v.kind.unit()))
            .into_iter()
            .map(|u| (u.name, u.base))
            .collect();
        for variable in &product.variables {
            if matches!(variable.kind, VariableKind::Real(_)) {
                let unit = variable.kind.unit().unwrap_or_else(|| panic!("{} has no unit", variable.name));
                assert!(units.contains_key(unit), "{} is in {unit}, which is not declared", variable.name);
                seen.insert(unit.to_owned());
            }
        }
        assert_eq!(product.model_description().units.len(), units.len());
    }
    let si = |m, s, rad| Some(BaseUnit { m, s, rad, ..BaseUnit::default() });
    let table = [
        ("1", si(0, 0, 0)),
        ("1/s", si(0, -1, 0)),
        ("1/s3", si(0, -3, 0)),
        ("m", si(1, 0, 0)),
        ("m/s", si(1, -1, 0)),
        ("m/s2", si(1, -2, 0)),
        ("m2", si(2, 0, 0)),
        ("m2/s2", si(2, -2, 0)),
        ("rad", si(0, 0, 1)),
        ("rad/s", si(0, -1, 1)),
        ("s", si(0, 1, 0)),
    ];
    assert_eq!(seen.iter().map(String::as_str).collect::<Vec<_>>(), table.map(|(name, _)| name));
    for (name, wanted) in table {
        assert_eq!(base_unit(name), wanted, "{name}");
    }
    for unknown in ["", "kilometre", "2", "m/", "m2x", "stone", "m/s/s", "m99999999999"] {
        assert_eq!(base_unit(unknown), None, "{unknown}");
    }
}

#[test]
fn value_references_are_indices_and_names_are_unique() {
    for product in every_product() {
        let names: BTreeSet<_> = product.variables.iter().map(|v| v.name.as_str()).collect();
        assert_eq!(names.len(), product.variables.len(), "{names:?}");
        for (i, variable) in product.variables.iter().enumerate() {
            assert_eq!(variable.value_reference as usize, i, "{}", variable.name);
        }
        let Layout { outputs, parameters, end, .. } = product.layout;
        assert_eq!(end + product.enumerated().count(), product.variables.len());
        assert_eq!(product.ranges.len(), end - parameters);
        for (i, variable) in product.variables.iter().enumerate() {
            let wanted = match i {
                i if i < outputs => Causality::Input,
                i if i < parameters || i >= end => Causality::Output,
                _ => Causality::Parameter,
            };
            assert_eq!(variable.causality, wanted, "{}", variable.name);
            assert!(!variable.description.is_empty(), "{}", variable.name);
        }
    }
}

#[test]
fn inputs_and_parameters_start_within_their_range() {
    for product in every_product() {
        for (i, variable) in product.variables.iter().enumerate() {
            let start = variable.kind.start_number();
            let output = variable.causality == Causality::Output;
            assert_eq!(start.is_none(), output, "{} starts at {start:?}", variable.name);
            if let (Some(start), Some(i)) = (start, i.checked_sub(product.layout.parameters)) {
                product.ranges[i].check(&variable.name, start).unwrap();
            }
        }
    }
}

#[test]
fn dependencies_say_whether_outputs_follow_inputs_at_once() {
    for product in every_product() {
        let all: Vec<u32> = (0..product.layout.outputs as u32).collect();
        let wanted = match &product.configuration {
            Configuration::Filter(c) if c.direct_feedthrough => all,
            // The parts are tested one by one below.
            Configuration::Controller(_) => continue,
            _ => Vec::new(),
        };
        for output in product.variables.iter().filter(|v| v.causality == Causality::Output) {
            assert_eq!(output.dependencies.as_ref(), Some(&wanted), "{}", output.name);
        }
    }
}

/// The declared dependencies of a controller's outputs are those found by changing one input at a time.
#[test]
fn dependencies_of_controllers_are_those_found() {
    for text in controllers() {
        let product = product(&text);
        let outputs = product.layout.outputs..product.layout.parameters;
        let mut block = crate::block::build(&product).unwrap();
        let mut values = crate::block::Values::zeros(product.variables.len());
        for (value, variable) in values.reals.iter_mut().zip(&product.variables) {
            if let VariableKind::Real(Real { start: Some(start), .. }) = variable.kind {
                *value = start;
            }
        }
        // With small speeds and a near goal, no limit is active.
        values.reals[..product.layout.states.min(4)].copy_from_slice(&[0.9, 2.1, 0.3, 0.2]);
        block.configure(&values).unwrap();
        let mut sampled = |values: &mut crate::block::Values| {
            block.output(0.0, values);
            outputs.clone().map(|i| (values.reals[i], values.integers[i])).collect::<Vec<_>>()
        };
        let before = sampled(&mut values.clone());
        let declared = |i: usize| product.variables[i].dependencies.as_deref().unwrap();
        for input in 0..product.layout.outputs {
            let mut moved = values.clone();
            moved.reals[input] += 0.01;
            for (at, (old, new)) in before.iter().zip(sampled(&mut moved)).enumerate() {
                let known = declared(outputs.start + at).contains(&(input as u32));
                assert!(
                    known || *old == new || text.contains("direct_feedthrough = false"),
                    "{text}: {input}"
                );
            }
        }
    }
}

#[test]
fn enumerations_cover_every_status_and_phase() {
    let values = |t: SimpleType| t.items.iter().map(|i| i.value).collect::<Vec<_>>();
    assert_eq!(values(status_type()), Status::ALL.map(|s| s as i32));
    assert_eq!(values(phase_type()), [0, 1, 2, 3, 4, 5]);
    let names = status_type().items.into_iter().map(|i| i.name).collect::<BTreeSet<_>>();
    assert_eq!(names.len(), Status::ALL.len(), "{names:?}");
}

/// Importers that drop enumerations find the same numbers as integers, after all other variables.
#[test]
fn every_enumeration_has_an_integer_twin() {
    let bounds = "bounds = { u_x = [-8, 8], u_y = [-8, 8] }\n";
    let text = format!("kind = \"filter\"\nplant.model = \"point_mass\"\n{bounds}{BARRIER}");
    let product = product(&text);
    let twins: Vec<_> = product.variables[product.layout.end..].iter().collect();
    let names: Vec<_> = twins.iter().map(|v| v.name.as_str()).collect();
    assert_eq!(names, ["status_code", "goal.phase_code", "assurance_code"]);
    assert!(twins.iter().all(|v| v.kind.base_type() == punctual_modeldescription::BaseType::Integer));
    assert!(twins.iter().all(|v| matches!(v.kind, VariableKind::Integer(_))));
}

/// One valid change per field gives a different GUID each, and no two of them are equal.
#[test]
fn the_guid_differs_when_any_field_differs() {
    let filter = format!("kind = \"filter\"\nplant.model = \"bicycle\"\n{BARRIER}");
    let plant = "kind = \"plant\"\nplant.model = \"bicycle\"\n";
    let mut texts = vec![filter.clone(), plant.to_owned()];
    for (from, to) in [
        ("\"goal\"", "\"gaol\""),
        ("45.0", "45.000000000000007"),
        ("44.0", "44.5"),
        ("radius = 2.0", "radius = 2.5"),
        ("deadline = 10.0", "deadline = 10.5"),
        ("radius", "shape = \"quadratic_disc\"\nradius"),
        ("radius", "smoothing = 1.0\nradius"),
        ("radius", "method = \"repeated_root\"\nradius"),
        ("radius", "rate = 3.0\nradius"),
        ("radius", "stay_rate = 3.0\nradius"),
        ("radius", "margin = 0.5\nradius"),
        ("radius", "velocity = [0.5, 0.0]\nradius"),
        ("radius", "velocity = [0.0, 0.5]\nradius"),
        ("radius", "shape = \"obstacle\"\nradius"),
        ("\"bicycle\"", "\"bicycle_kinematic\""),
        ("\"bicycle\"", "\"bicycle_kinematic\"\nplant.l_f = 11.0"),
        ("\"bicycle\"", "\"bicycle_small_slip_rate\""),
        ("\"bicycle\"", "\"bicycle\"\nplant.l_r = 11.0"),
        ("\"bicycle\"", "\"unicycle\""),
        ("\"bicycle\"", "\"bicycle\"\nname = \"other\""),
        ("\"bicycle\"", "\"bicycle\"\ndirect_feedthrough = false"),
        ("\"bicycle\"", "\"bicycle\"\ncorrection_limit = 5.0"),
        ("\"bicycle\"", "\"bicycle\"\nbounds.a = [-1.0, 1e30]"),
        ("\"bicycle\"", "\"bicycle\"\nbounds.beta = [-1e30, 1.0]"),
        ("\"bicycle\"", "\"bicycle\"\nexperiment.start_time = 1.0"),
        ("\"bicycle\"", "\"bicycle\"\nexperiment.stop_time = 11.0"),
        ("\"bicycle\"", "\"bicycle\"\nexperiment.step_size = 0.01"),
    ] {
        texts.push(filter.replacen(from, to, 1));
    }
    for line in [
        "x0.x_p = 1.0",
        "x0.y_p = 1.0",
        "x0.theta = 1.0",
        "x0.v = 1.0",
        "plant.l_r = 11.0",
        "integration.inner_step = 0.01",
        "name = \"other\"",
        "experiment.step_size = 0.01",
    ] {
        texts.push(format!("{plant}{line}"));
    }
    let mut seen = BTreeMap::new();
    for text in texts {
        let guid = product(&text).guid;
        assert!(guid.starts_with('{') && guid.ends_with('}') && guid.len() == 38, "{guid}");
        if let Some(other) = seen.insert(guid.clone(), text.clone()) {
            panic!("{guid} is the GUID of both\n{other}\nand\n{text}");
        }
    }
}

#[test]
fn the_guid_does_not_depend_on_the_spelling() {
    let short = product(&format!("kind = \"filter\"\nplant.model = \"bicycle\"\n{BARRIER}"));
    let stated = product(&short.configuration.canonical().unwrap());
    assert_eq!(short.guid, stated.guid);
}

/// Some importers add a variable of this name themselves.
#[test]
fn no_variable_is_called_time() {
    for product in every_product() {
        assert!(product.variables.iter().all(|v| !v.name.eq_ignore_ascii_case("time")));
    }
}

/// The integrated state is not an input, and takes the place of its rate.
#[test]
fn an_integrated_state_is_commanded_and_not_measured() {
    let product = product(STEERED);
    let names: Vec<_> = product.variables.iter().map(|v| v.name.as_str()).collect();
    let wanted =
        ["x.x_p", "x.y_p", "x.theta", "x.v", "u_ref.a", "u_ref.delta", "rearm", "u.a", "u.delta", "status"];
    assert_eq!(names[..wanted.len()], wanted);
    assert_eq!(names[product.layout.parameters - 1], "integrator.delta");
    let parameters = &names[product.layout.parameters..];
    for parameter in ["u_min.delta", "u_max.delta", "u_min.delta_rate", "u_max.delta_rate", "integrator.gain"]
    {
        assert!(parameters.contains(&parameter), "{parameter} in {parameters:?}");
    }
}

/// Every product for FMI 3.0, with arrays and without.
fn every_product_of_fmi3() -> impl Iterator<Item = (Product, Product)> {
    every_product().into_iter().flat_map(|old| {
        [true, false].map(|arrays| {
            let configuration = old.configuration.clone().for_fmi(FmiVersion::Three, arrays);
            (product(&old.configuration.canonical().unwrap()), Product::new(configuration).unwrap())
        })
    })
}

/// The description can be written, which checks it against the rules of the standard, and agrees with the
/// table.
#[test]
fn descriptions_of_fmi3() {
    for (old, new) in every_product_of_fmi3() {
        let name = new.configuration.name();
        assert_ne!(old.guid, new.guid, "{name}: a token of its own");
        let mut table = new.variables.clone();
        for (own, other) in table.iter_mut().zip(&old.variables) {
            if matches!(new.configuration, Configuration::Plant(_)) {
                own.initial_dependencies.clone_from(&other.initial_dependencies);
            }
        }
        assert_eq!(old.variables, table, "{name}: the same table");
        let description = new.model_description_of_fmi3();
        let xml = description.to_xml().unwrap_or_else(|e| panic!("{name}: {e}"));
        assert!(xml.contains("fmiVersion=\"3.0\""));
        if let Some(terminals) = Some(new.terminals()).filter(|t| !t.terminals.is_empty()) {
            terminals.to_xml(&description).unwrap_or_else(|e| panic!("{name}: {e}"));
        }
        // The variables cover the table in order, once, and the start values are those of the scalars.
        let mut next = 0;
        for (item, variable) in new.items.iter().zip(&description.variables) {
            assert_eq!((item.scalars.start, item.reference()), (next, variable.value_reference), "{name}");
            let elements: u64 = variable.dimensions.iter().filter_map(|d| d.start).product();
            assert_eq!(elements as usize, item.scalars.len(), "{name}: {}", item.name);
            next = item.scalars.end;
            let Some(scalars) = new.variables.get(item.scalars.clone()) else { continue };
            let starts: Vec<_> = scalars
                .iter()
                .filter_map(|v| match &v.kind {
                    VariableKind::Real(real) => real.start,
                    _ => None,
                })
                .collect();
            if let Some(float) = variable.kind.as_float() {
                assert_eq!(float.start, starts, "{name}: {}", item.name);
            }
        }
        assert_eq!(next, new.variables.len() + 1, "{name}");
    }
}

#[test]
fn units_and_ranges_that_all_elements_share() {
    use punctual_modeldescription::fmi3;
    let text = "kind = \"plant\"\nexperiment.fmi = 3\n[plant]\n\
                states = [{ name = \"a\", unit = \"m\", min = 0.0, max = 5.0 }, { name = \"b\", unit = \"m\", min = 0.0, max = 6.0 }]\n\
                inputs = [{ name = \"u\", unit = \"m/s\" }]\nderivatives = { a = \"u\", b = \"-u\" }\n";
    let description = product(text).model_description_of_fmi3();
    let of = |name: &str| -> fmi3::Float {
        description.by_name(name).and_then(|v| v.kind.as_float()).expect("a number").clone()
    };
    let x0 = of("x0");
    assert_eq!((x0.unit.as_deref(), x0.min, x0.max), (Some("m"), Some(0.0), None));
    assert_eq!(description.by_name("x").unwrap().description, "a in m: a; b in m: b");
    assert_eq!(of("u").unit.as_deref(), Some("m/s"));
}

/// A plant with an output besides its states.
const TANK: &str = "kind = \"plant\"\noutput = [{ name = \"twice\", expression = \"2*a\", unit = \"m\" }]\n[plant]\n\
                    states = [{ name = \"a\", unit = \"m\" }, { name = \"b\", unit = \"rad/s\" }]\n\
                    inputs = [{ name = \"u\", unit = \"m/s\" }]\nparameters = [{ name = \"w\", unit = \"1/s\", start = 2.0 }]\nderivatives = { a = \"u\", b = \"-w*b\" }\n";

#[test]
fn an_output_of_a_plant_depends_on_states_and_constants_at_the_start() {
    let three = product(TANK).configuration.for_fmi(FmiVersion::Three, true);
    let structure = Product::new(three).unwrap().model_description_of_fmi3().structure;
    let first = &structure.initial_unknowns[1];
    assert_eq!(
        (first.value_reference, &first.dependencies),
        (3, &Some(vec![4, 6, 7])),
        "on x0, w, inner_step"
    );
    assert_eq!(structure.outputs[1].dependencies, Some(Vec::new()), "and then on nothing until a step");
}

#[test]
fn the_version_of_fmi_and_its_arrays() {
    let text = format!("kind = \"filter\"\nplant.model = \"unicycle\"\nEXPERIMENT\n{BARRIER}");
    let parsed = |experiment: &str| Configuration::parse(&text.replace("EXPERIMENT", experiment));
    let default = parsed("").unwrap();
    assert_eq!(parsed("experiment.fmi = 2").unwrap(), default);
    assert!(!default.canonical().unwrap().contains("fmi"), "as before there was a choice");
    let three = parsed("experiment.fmi = 3").unwrap();
    assert_eq!(Configuration::parse(&three.canonical().unwrap()).unwrap(), three);
    assert_eq!(three.clone().for_fmi(FmiVersion::Two, true), default);
    let scalars = parsed("experiment = { fmi = 3, arrays = false }").unwrap();
    assert_eq!(three.for_fmi(FmiVersion::Three, false), scalars);
    assert_eq!(scalars.for_fmi(FmiVersion::Two, false), default);
    for (experiment, message) in [
        ("experiment.fmi = 4", "experiment.fmi: is 4, must be 2 or 3"),
        (
            "experiment.arrays = false",
            "experiment.arrays: is false, must be left out with `fmi = 2`: FMI 2.0 has no arrays",
        ),
    ] {
        let error = parsed(experiment).unwrap_err().to_string();
        assert!(error.contains(message), "{error}");
    }
    let named = "kind = \"plant\"\nexperiment.fmi = 3\n[plant]\nstates = [{ name = \"a\" }]\n\
                 inputs = [{ name = \"u\" }]\nparameters = [{ name = \"time\", start = 1.0 }]\n\
                 derivatives = { a = \"u*time\" }\n";
    let refused = Product::new(Configuration::parse(named).unwrap()).err().expect("a refusal").to_string();
    assert!(refused.contains("\"time\", which is the name of the time with `fmi = 3`"), "{refused}");
    assert!(Product::new(Configuration::parse(&named.replace("fmi = 3", "fmi = 2")).unwrap()).is_ok());
}
