//! Edited configurations and system files.

use std::time::{Duration, Instant};

use punctual_cosim::coupling::System;
use punctual_fmu::configuration::Configuration;
use punctual_fmu::instance::Instance;
use punctual_fmu::product::Product;
use punctual_modeldescription::{BaseType, Causality};

use crate::bytes::Bytes;
use crate::campaign;
use crate::fleet::CONFIGURATIONS;

const WORDS: &[&str] = &[
    "kind = \"filter\"\n",
    "kind = \"plant\"\n",
    "kind = \"controller\"\n",
    "[plant]\n",
    "[[barrier]]\n",
    "[bounds]\n",
    "[integrator]\n",
    "[experiment]\n",
    "point_mass",
    "unicycle",
    "bicycle",
    "bicycle_small_slip",
    "bicycle_small_slip_rate",
    "bicycle_kinematic",
    "bicycle_kinematic_angle",
    "bicycle_kinematic_slip",
    "disc",
    "quadratic_disc",
    "ellipse",
    "rectangle",
    "elliptic_obstacle",
    "rectangular_obstacle",
    "half_plane",
    "at_most",
    "at_least",
    "speed_limit",
    "l_r = 1.0\n",
    "l_f = 1.0\n",
    "state = \"v\"\n",
    "bound = 3.0\n",
    "normal = [1.0, 0.0]\n",
    "half_axes = [2.0, 1.0]\n",
    "half_sides = [2.0, 1.0]\n",
    "angle = 0.5\n",
    "after = \"goal\"\n",
    "begin = 1.0\n",
    "end = 2.0\n",
    "until_arrival = true\n",
    "priority = 1\n",
    "penalty = 5.0\n",
    "rate = 2.0\n",
    "margin = 0.1\n",
    "velocity = [1.0, -1.0]\n",
    "centre_input = true\n",
    "profile = \"low_peak\"\n",
    "method = \"repeated_root\"\n",
    "when_infeasible = \"earliest\"\n",
    "sampling = \"pointwise\"\n",
    "direct_feedthrough = false\n",
    "actuation_delay = 0.1\n",
    "stop_time",
    "step_size",
    "waypoints",
    "heading",
    "damping",
    "true",
    "inf",
    "nan",
    "[[[[[[",
    "{ a = { a = { a = 1 } } }",
    "\u{fc}\u{1F600}",
    "\u{202e}",
    "%s%n",
    "1_0",
    "0x10",
    "2026-01-01T00:00:00Z",
    "\"\"\"",
    "\\u0000",
];

/// The longest time for an unreasonable file on a loaded machine.
const PATIENCE: Duration = Duration::from_secs(60);

/// The most bytes of an error, which may quote a truncated line of the file.
const LONGEST_ERROR: usize = 4000;

/// A configuration is refused with a field, or gives an FMU whose inputs and states are finite.
#[test]
fn configurations_with_edits() {
    campaign::run("configurations", 3000, "accepted", |bytes| {
        let mut bytes = Bytes::new(bytes);
        let text = bytes.pick(&CONFIGURATIONS);
        let text = bytes.edited(text.as_bytes(), WORDS);
        let text = String::from_utf8_lossy(&text);
        match Configuration::parse(&text) {
            Ok(configuration) => {
                accepted(&configuration, &mut bytes);
                1
            }
            Err(error) => {
                named(&error.to_string());
                0
            }
        }
    });
}

/// An error says where and what, in readable lines.
fn named(message: &str) {
    let line = ["TOML parse error at line ", "at line "].iter().any(|head| message.starts_with(head));
    let placed = message.contains(": ") || line;
    assert!(placed && message.len() < LONGEST_ERROR, "{message:.4000?}");
}

fn accepted(configuration: &Configuration, bytes: &mut Bytes) {
    let canonical = configuration.canonical().expect("a canonical form");
    let again = Configuration::parse(&canonical).unwrap_or_else(|e| panic!("{e} in\n{canonical}"));
    assert_eq!(again.canonical().expect("a canonical form"), canonical, "the canonical form is its own");
    let product = Product::new(again).expect("a product");
    assert_eq!(Product::new(configuration.clone()).expect("a product").guid, product.guid);
    product.model_description().to_xml().unwrap_or_else(|e| panic!("{e} for\n{canonical}"));
    let instance = Instance::new(configuration.clone(), &product.guid);
    let mut instance = instance.unwrap_or_else(|e| panic!("{e} for\n{canonical}"));
    instance.setup_experiment(0.0, None).expect("a time");
    instance.enter_initialization_mode().expect("the mode");
    instance.exit_initialization_mode().unwrap_or_else(|e| panic!("{e} for\n{canonical}"));
    let real = |causality, prefix: &str| -> Vec<u32> {
        let variables = product.variables.iter().filter(|v| v.kind.base_type() == BaseType::Real);
        let named = variables.filter(|v| v.causality == causality && v.name.starts_with(prefix));
        named.map(|v| v.value_reference).collect()
    };
    let mut h = 0.1;
    if let [inner] = real(Causality::Parameter, "inner_step")[..] {
        let mut value = [0.0];
        instance.get_real(&[inner], &mut value).expect("a parameter");
        h = value[0].min(1e-4) * 1000.0;
    }
    let inputs = real(Causality::Input, "");
    let outputs = [real(Causality::Output, "u"), real(Causality::Output, "x.")].concat();
    for _ in 0..4 {
        let values: Vec<f64> = inputs.iter().map(|_| bytes.moderate()).collect();
        instance.set_real(&inputs, &values).expect("inputs");
        let done = instance.do_step(instance.time(), h);
        if let Err(refusal) = done {
            named(&refusal.replace(" becomes ", ": "));
        }
        let mut values = vec![f64::NAN; outputs.len()];
        instance.get_real(&outputs, &mut values).expect("outputs");
        assert!(values.iter().all(|v| v.is_finite()), "{values:?} of\n{canonical}");
    }
}

#[test]
fn system_files_with_edits() {
    const SYSTEMS: [&str; 3] = [
        include_str!("../../examples/vehicles/unicycle.toml"),
        include_str!("../../examples/vehicles/escort.toml"),
        include_str!("../../examples/vehicles/tour.toml"),
    ];
    campaign::run("systems", 3000, "accepted", |bytes| {
        let mut bytes = Bytes::new(bytes);
        let text = bytes.pick(&SYSTEMS);
        let text = bytes.edited(text.as_bytes(), WORDS);
        match System::parse(&String::from_utf8_lossy(&text)) {
            Ok(system) => {
                assert!(system.experiment().step > 0.0, "{:?}", system.experiment());
                1
            }
            Err(error) => {
                named(&error.to_string());
                0
            }
        }
    });
}

/// Nesting, lengths and counts that no person writes: refused or read, quickly and without a crash.
#[test]
fn deep_long_and_many() {
    let head = "kind = \"filter\"\nplant.model = \"point_mass\"\n";
    let disc = |k: usize| {
        format!("[[barrier]]\nname = \"b{k}\"\ncentre = [9.0, 9.0]\nradius = 1.0\ndeadline = 2.0\n")
    };
    let many: String = (0..20_000).map(disc).collect();
    for (text, wanted) in [
        (format!("{head}bounds = {}", "[".repeat(1_000_000)), "TOML parse error at line 3"),
        (format!("{head}bounds = {}", "{a=".repeat(1_000_000)), "TOML parse error at line 3"),
        (format!("{head}{} = 1", vec!["a"; 500_000].join(".")), ""),
        (format!("{head}[{}]", vec!["a"; 500_000].join(".")), ""),
        (format!("name = \"{}\"\n{head}{}", "n".repeat(5_000_000), disc(0)), "name"),
        (format!("{head}{many}"), "barrier: has 20000 entries, must have at most 128"),
    ] {
        let begin = Instant::now();
        let error = Configuration::parse(&text).map(|c| c.kind()).expect_err("it is refused").to_string();
        assert!(begin.elapsed() < PATIENCE, "{:?}: {error:.500}", begin.elapsed());
        assert!(error.contains(wanted) && error.len() < LONGEST_ERROR, "{} bytes: {error:.500}", error.len());
    }
    // The number of points is not limited: each is two parameters, and they are read in bounded time.
    let (count, begin) = (20_000, Instant::now());
    let points = "[1.0, 2.0],".repeat(count);
    let head = "kind = \"controller\"\ncontroller = \"waypoints\"\nplant.model = \"unicycle\"\n";
    let configuration = Configuration::parse(&format!("{head}points = [{points}]")).expect("points");
    assert!(Product::new(configuration).expect("a product").variables.len() > 2 * count);
    assert!(begin.elapsed() < PATIENCE, "{:?}", begin.elapsed());
}
