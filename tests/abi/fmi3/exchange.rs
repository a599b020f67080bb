//! Model exchange: the bits of co-simulation where the importer integrates as it does, modes, refusals, derivatives.

use std::ffi::{CString, c_int};
use std::ptr::null_mut;

use punctual_fmu::configuration::FmiVersion;
use punctual_fmu::instance::{Call, Mode};

use super::slave::{Log, Slave, log};
use crate::api::three::API;
use crate::api::{DISCARD, ERROR};
use crate::exchange::{PENDULUM, next};
use crate::fmu::{FILTER, Fmu, PLANT};

/// Step of the differences.
const STEP: f64 = 1e-5;

/// Tolerance of a derivative of size 1 by central differences of numbers of order 1 to 10.
const TOLERANCE: f64 = 1e-6;

/// An instance for model exchange, in mode Instantiated.
fn exchanged(fmu: &Fmu) -> Slave<'_> {
    let (token, path) = (CString::new(fmu.guid()).unwrap(), CString::new(fmu.path()).unwrap());
    let to = Box::<Log>::default();
    let instance = (API.instantiate_model_exchange)(
        c"exchanged".as_ptr(),
        token.as_ptr(),
        path.as_ptr(),
        0,
        0,
        to.environment(),
        Some(log),
    );
    assert!(!instance.is_null(), "{:?}", to.entries());
    Slave { instance, log: to, fmu }
}

/// Brings a new instance into `mode`.
fn into_mode(fmu: &Fmu, mode: Mode) -> Slave<'_> {
    let slave = exchanged(fmu);
    if mode == Mode::INSTANTIATED {
        return slave;
    }
    slave.ok((API.enter_initialization_mode)(slave.instance, 0, 0.0, 0.0, 0, 0.0));
    if mode == Mode::INITIALIZATION {
        return slave;
    }
    slave.ok((API.exit_initialization_mode)(slave.instance));
    if mode == Mode::CONTINUOUS || mode == Mode::TERMINATED {
        slave.ok(update(&slave));
        slave.ok((API.enter_continuous_time_mode)(slave.instance));
    }
    if mode == Mode::TERMINATED {
        slave.ok((API.terminate)(slave.instance));
    }
    slave
}

/// Updates the discrete states, of which there are none.
fn update(slave: &Slave) -> c_int {
    let (mut flags, mut time) = ([7; 5], 0.5);
    let [a, b, c, d, e] = &mut flags;
    let status = (API.update_discrete_states)(slave.instance, a, b, c, d, e, &raw mut time);
    assert_eq!(flags, [if status == ERROR { 7 } else { 0 }; 5]);
    status
}

/// An instance in continuous-time mode.
pub(crate) fn continuous(fmu: &Fmu) -> Slave<'_> {
    into_mode(fmu, Mode::CONTINUOUS)
}

/// The rates at a time and state.
pub(crate) fn rates(slave: &Slave, t: f64, x: &[f64]) -> Vec<f64> {
    let mut out = vec![f64::NAN; x.len()];
    slave.ok((API.set_time)(slave.instance, t));
    slave.ok((API.set_continuous_states)(slave.instance, x.as_ptr(), x.len()));
    slave.ok((API.get_continuous_state_derivatives)(slave.instance, out.as_mut_ptr(), out.len()));
    out
}

/// One step outside.
fn step(slave: &Slave, t: f64, x: &[f64], h: f64) -> Vec<f64> {
    let next = next(|t, x| rates(slave, t, x), t, x, h);
    slave.ok((API.set_time)(slave.instance, t + h));
    slave.ok((API.set_continuous_states)(slave.instance, next.as_ptr(), next.len()));
    let (mut event, mut end) = (7, 7);
    slave.ok((API.completed_integrator_step)(slave.instance, 0, &raw mut event, &raw mut end));
    assert_eq!((event, end), (0, 0));
    next
}

/// The step of both: times are exact, and shorter than any inner step.
const H: f64 = 0.000_976_562_5;

#[test]
fn the_same_method_outside_gives_the_same_bits() {
    for configuration in [PLANT, PENDULUM] {
        for arrays in [true, false] {
            let fmu = Fmu::of_fmi3(configuration, arrays);
            let inside = Slave::ready(&fmu);
            let outside = into_mode(&fmu, Mode::CONTINUOUS);
            let (mut n, mut indicators) = (0, 7);
            outside.ok((API.get_number_of_continuous_states)(outside.instance, &raw mut n));
            outside.ok((API.get_number_of_event_indicators)(outside.instance, &raw mut indicators));
            assert_eq!((n, indicators), (fmu.product.layout.states, 0));
            let mut x = vec![f64::NAN; n];
            outside.ok((API.get_continuous_states)(outside.instance, x.as_mut_ptr(), n));
            let count = fmu.product.layout.inputs;
            for k in 0..40 {
                let (t, h) = (f64::from(k) * H, H);
                let values: Vec<f64> = (0..count).map(|i| 0.3 * f64::from(k) - i as f64).collect();
                inside.set_inputs(&values);
                outside.set_inputs(&values);
                inside.step(t, h);
                x = step(&outside, t, &x, h);
                assert_eq!(outside.snapshot(), inside.snapshot(), "step {k} of {configuration}");
                if k == 20 {
                    // An event changes nothing.
                    outside.ok((API.enter_event_mode)(outside.instance));
                    outside.ok(update(&outside));
                    outside.ok((API.enter_continuous_time_mode)(outside.instance));
                }
            }
        }
    }
}

/// A function with its call in the table.
type Function = (&'static str, Call, fn(&Slave) -> c_int);

#[test]
fn every_function_in_every_mode() {
    let fmu = Fmu::of_fmi3(PLANT, true);
    let functions: [Function; 9] = [
        ("fmi3EnterEventMode", Call::EnterEventMode, |s| (API.enter_event_mode)(s.instance)),
        ("fmi3UpdateDiscreteStates", Call::UpdateDiscreteStates, update),
        ("fmi3EnterContinuousTimeMode", Call::EnterContinuousTimeMode, |s| {
            (API.enter_continuous_time_mode)(s.instance)
        }),
        ("fmi3CompletedIntegratorStep", Call::Integrate, |s| {
            (API.completed_integrator_step)(s.instance, 0, &mut 0, &mut 0)
        }),
        ("fmi3SetTime", Call::SetTime, |s| (API.set_time)(s.instance, 0.5)),
        ("fmi3SetContinuousStates", Call::Integrate, |s| {
            (API.set_continuous_states)(s.instance, [1.0; 4].as_ptr(), 4)
        }),
        ("fmi3GetContinuousStates", Call::GetContinuousStates, |s| {
            (API.get_continuous_states)(s.instance, [0.0; 4].as_mut_ptr(), 4)
        }),
        ("fmi3GetContinuousStateDerivatives", Call::GetContinuousStates, |s| {
            (API.get_continuous_state_derivatives)(s.instance, [0.0; 4].as_mut_ptr(), 4)
        }),
        ("fmi3GetEventIndicators", Call::GetContinuousStates, |s| {
            (API.get_event_indicators)(s.instance, null_mut(), 0)
        }),
    ];
    let modes = [Mode::INSTANTIATED, Mode::INITIALIZATION, Mode::EVENT, Mode::CONTINUOUS, Mode::TERMINATED];
    for mode in modes {
        for (name, call, function) in functions {
            let slave = into_mode(&fmu, mode);
            let found = function(&slave);
            if mode.is_in(call.modes(FmiVersion::Three)) {
                slave.ok(found);
            } else {
                let message = slave.refused(found);
                let wanted = format!("{name}: not allowed in the mode {:?}, only in", mode.name());
                assert!(message.starts_with(&wanted), "{message}");
            }
        }
        let slave = into_mode(&fmu, mode);
        let mut nominals = [0.0; 4];
        slave.ok((API.get_nominals_of_continuous_states)(slave.instance, nominals.as_mut_ptr(), 4));
        assert_eq!(nominals, [1.0; 4]);
        assert!(slave.refused(slave.try_step(0.0, 0.1)).contains("not allowed in the mode"));
    }
}

#[test]
fn who_has_no_model_exchange() {
    let noisy = format!("{PLANT}\n[disturbance]\nmeasurements = {{ v = 0.1 }}\n");
    for (configuration, why) in [
        (FILTER, "the FMU has no model exchange, which plants alone have"),
        (&noisy, "the FMU has no model exchange, since a plant with a disturbance has to be stepped"),
    ] {
        let fmu = Fmu::of_fmi3(configuration, true);
        assert!(fmu.product.model_description_of_fmi3().model_exchange.is_none());
        let (token, path) = (CString::new(fmu.guid()).unwrap(), CString::new(fmu.path()).unwrap());
        let to = Log::default();
        let instance = (API.instantiate_model_exchange)(
            c"a".as_ptr(),
            token.as_ptr(),
            path.as_ptr(),
            0,
            0,
            to.environment(),
            Some(log),
        );
        assert!(instance.is_null());
        assert_eq!(to.failure(), format!("fmi3InstantiateModelExchange: {why}"));
    }
}

#[test]
fn states_that_are_none() {
    let fmu = Fmu::of_fmi3(PLANT, true);
    let slave = into_mode(&fmu, Mode::CONTINUOUS);
    let before = slave.now();
    let set = |x: &[f64]| (API.set_continuous_states)(slave.instance, x.as_ptr(), x.len());
    assert_eq!(set(&[1.0, f64::NAN, 0.0, 0.0]), DISCARD, "the integrator may try others");
    assert!(slave.refused(set(&[1.0; 3])).contains("nContinuousStates is 3, must be 4"));
    assert!(slave.refused((API.set_time)(slave.instance, f64::NAN)).contains("time is NaN"));
    assert!(slave.now() == before);
    // States are also set by their value reference, between events alone.
    slave.ok(slave.set("x", &[1.0, 2.0, 0.5, 3.0]));
    let mut x = [0.0; 4];
    slave.ok((API.get_continuous_states)(slave.instance, x.as_mut_ptr(), 4));
    assert_eq!(x, [1.0, 2.0, 0.5, 3.0]);
    assert_eq!(slave.get("der(x)")[3], 0.0);
    let message = slave.refused(slave.set("x", &[1.0, f64::INFINITY, 0.5, 3.0]));
    assert_eq!(message, "fmi3SetFloat64: x.y_p is inf, must be finite");
    assert_eq!(slave.get("x"), [1.0, 2.0, 0.5, 3.0]);
    slave.ok((API.enter_event_mode)(slave.instance));
    assert!(slave.refused(slave.set("x", &[1.0; 4])).contains("x is of causality output"));
    // A state of model exchange is none of co-simulation.
    let bytes = slave.now();
    let stepped = Slave::ready(&fmu);
    let mut state = null_mut();
    stepped.ok((API.deserialize_state)(stepped.instance, bytes.as_ptr(), bytes.len(), &raw mut state));
    let message = stepped.refused((API.set_state)(stepped.instance, state));
    assert!(
        message.contains("the mode \"event\", which the interface of this instance does not have"),
        "{message}"
    );
    let other = exchanged(&fmu);
    slave.ok((API.deserialize_state)(other.instance, bytes.as_ptr(), bytes.len(), &raw mut state));
    other.ok((API.set_state)(other.instance, state));
    assert!(other.now() == bytes);
}

/// Rates and outputs by states and inputs, against differences.
#[test]
fn derivatives_of_the_rates() {
    let fmu = Fmu::of_fmi3(PENDULUM, true);
    let slave = into_mode(&fmu, Mode::CONTINUOUS);
    let at = [0.4, -1.2, 0.7];
    let observed = ["der(x)", "x", "y.height"];
    let look = |values: [f64; 3]| -> Vec<f64> {
        let x = &values[..2];
        slave.ok((API.set_continuous_states)(slave.instance, x.as_ptr(), 2));
        slave.ok(slave.set("u", &values[2..]));
        observed.iter().flat_map(|name| slave.get(name)).collect()
    };
    let unknowns = observed.map(|name| fmu.item(name).reference());
    let knowns = ["x", "u"].map(|name| fmu.item(name).reference());
    let (u, k) = (unknowns.as_ptr(), knowns.as_ptr());
    let mut jacobian = [[0.0; 3]; 5];
    for column in 0..3 {
        let moved = |by: f64| {
            let mut values = at;
            values[column] += by;
            look(values)
        };
        let (plus, minus) = (moved(STEP), moved(-STEP));
        look(at);
        let mut seed = [0.0; 3];
        seed[column] = 1.0;
        let mut found = [7.5; 5];
        let (s, f) = (seed.as_ptr(), found.as_mut_ptr());
        slave.ok((API.get_directional_derivative)(slave.instance, u, 3, k, 2, s, 3, f, 5));
        for row in 0..5 {
            let wanted = (plus[row] - minus[row]) / (2.0 * STEP);
            let close = (found[row] - wanted).abs() <= TOLERANCE * (1.0 + wanted.abs());
            assert!(close, "{row} by {column}: {} for {wanted}", found[row]);
            jacobian[row][column] = found[row];
        }
    }
    assert_eq!(jacobian[0], [0.0, 1.0, 0.0]);
    for (row, wanted) in jacobian.iter().enumerate() {
        let mut seed = [0.0; 5];
        seed[row] = 1.0;
        let mut found = [7.5; 3];
        let (s, f) = (seed.as_ptr(), found.as_mut_ptr());
        slave.ok((API.get_adjoint_derivative)(slave.instance, u, 3, k, 2, s, 5, f, 3));
        assert_eq!(found, *wanted);
    }
    // A seed that is no number is told by the name of the rate.
    let (s, mut found) = ([0.0, f64::NAN, 0.0, 0.0, 0.0], [7.5; 3]);
    let (s, f) = (s.as_ptr(), found.as_mut_ptr());
    let status = (API.get_adjoint_derivative)(slave.instance, u, 3, k, 2, s, 5, f, 3);
    assert!(slave.refused(status).contains("the seed of der(x) is NaN"));
    // At the start a state is the parameter it begins with.
    let slave = into_mode(&fmu, Mode::INITIALIZATION);
    let (x, x0) = (fmu.item("x").reference(), fmu.item("x0").reference());
    let mut found = [7.5; 2];
    let (s, f) = ([2.0, -3.0], found.as_mut_ptr());
    slave.ok((API.get_directional_derivative)(
        slave.instance,
        &raw const x,
        1,
        &raw const x0,
        1,
        s.as_ptr(),
        2,
        f,
        2,
    ));
    assert_eq!(found, [2.0, -3.0]);
}
