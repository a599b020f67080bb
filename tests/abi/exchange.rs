//! Model exchange of FMI 2.0: the bits of co-simulation where the importer integrates as it does, and those of FMI 3.0;
//! refusals, derivatives. Which call is legal when is asked in `legality`.

use std::ptr::null_mut;

use punctual_fmu::fmi2::EventInfo;
use punctual_modeldescription::Causality;

use crate::api::exchange::API as EXCHANGED;
use crate::api::{API, DISCARD};
use crate::fmu::{Fmu, PLANT};
use crate::slave::Slave;

/// A pendulum by expressions, with an output that depends on time.
pub(crate) const PENDULUM: &str = r#"
kind = "plant"
x0 = { phi = 0.3, omega = -0.2 }
output = [{ name = "height", expression = "1 - cos(phi) + 0.1*t", unit = "1" }]
[plant]
states = [{ name = "phi", unit = "rad" }, { name = "omega", unit = "rad/s" }]
inputs = [{ name = "torque", unit = "rad/s2" }]
derivatives = { phi = "omega", omega = "torque - 9.81*sin(phi)" }
"#;

/// What has come of an event: nothing.
pub(crate) const NO_EVENT: EventInfo = EventInfo {
    new_discrete_states_needed: 0,
    terminate_simulation: 0,
    nominals_of_continuous_states_changed: 0,
    values_of_continuous_states_changed: 0,
    next_event_time_defined: 0,
    next_event_time: 0.0,
};

/// Step of the differences.
const STEP: f64 = 1e-5;

/// Tolerance of a derivative of size 1 by central differences of numbers of order 1 to 10.
const TOLERANCE: f64 = 1e-6;

/// A step whose times are exact, and shorter than any inner step.
const H: f64 = 0.000_976_562_5;

/// The state after one step of the classical Runge-Kutta method, in the order of additions of
/// `punctual_core::dynamics::rk4`.
pub(crate) fn next(rates: impl Fn(f64, &[f64]) -> Vec<f64>, t: f64, x: &[f64], h: f64) -> Vec<f64> {
    let moved = |k: &[f64], by: f64| -> Vec<f64> { x.iter().zip(k).map(|(x, k)| x + k * by).collect() };
    let k1 = rates(t, x);
    let k2 = rates(t + h / 2.0, &moved(&k1, h / 2.0));
    let k3 = rates(t + h / 2.0, &moved(&k2, h / 2.0));
    let k4 = rates(t + h, &moved(&k3, h));
    let sum = |i: usize| k1[i] + (k2[i] + k3[i]) * 2.0 + k4[i];
    (0..x.len()).map(|i| x[i] + sum(i) * (h / 6.0)).collect()
}

/// An instance in continuous-time mode.
fn continuous(fmu: &Fmu) -> Slave<'_> {
    let slave = Slave::exchanged(fmu);
    slave.initialize();
    ended(&slave);
    slave
}

/// Ends an event, at which nothing happens.
fn ended(slave: &Slave) {
    let mut info = EventInfo { next_event_time: 0.5, new_discrete_states_needed: 7, ..NO_EVENT };
    slave.ok((EXCHANGED.new_discrete_states)(slave.component, &raw mut info));
    assert_eq!(info, NO_EVENT);
    slave.ok((EXCHANGED.enter_continuous_time_mode)(slave.component));
}

fn set(slave: &Slave, t: f64, x: &[f64]) {
    slave.ok((EXCHANGED.set_time)(slave.component, t));
    slave.ok((EXCHANGED.set_continuous_states)(slave.component, x.as_ptr(), x.len()));
}

/// The rates at a time and state: as the function gives them, which are the values of the variables.
fn rates(slave: &Slave, t: f64, x: &[f64]) -> Vec<f64> {
    let mut out = vec![f64::NAN; x.len()];
    set(slave, t, x);
    slave.ok((EXCHANGED.get_derivatives)(slave.component, out.as_mut_ptr(), out.len()));
    let locals = slave.fmu.product.variables.iter().filter(|v| v.causality == Causality::Local);
    let values: Vec<_> = locals.map(|v| slave.real(&v.name).to_bits()).collect();
    assert_eq!(values, out.iter().map(|rate| rate.to_bits()).collect::<Vec<_>>());
    out
}

#[test]
fn the_same_method_outside_gives_the_same_bits() {
    for configuration in [PLANT, PENDULUM] {
        let fmu = Fmu::exchanged(configuration);
        let (inside, outside) = (Slave::ready(&fmu), continuous(&fmu));
        let n = fmu.product.layout.states;
        let mut x = vec![f64::NAN; n];
        outside.ok((EXCHANGED.get_continuous_states)(outside.component, x.as_mut_ptr(), n));
        for k in 0..40 {
            let t = f64::from(k) * H;
            let values: Vec<f64> =
                (0..fmu.product.layout.inputs).map(|i| 0.3 * f64::from(k) - i as f64).collect();
            inside.set_inputs(&values);
            outside.set_inputs(&values);
            inside.step(t, H);
            x = next(|t, x| rates(&outside, t, x), t, &x, H);
            set(&outside, t + H, &x);
            let (mut event, mut end) = (7, 7);
            let c = outside.component;
            outside.ok((EXCHANGED.completed_integrator_step)(c, 1, &raw mut event, &raw mut end));
            assert_eq!((event, end), (0, 0));
            assert_eq!(outside.snapshot(), inside.snapshot(), "step {k} of {configuration}");
            if k == 20 {
                // An event changes nothing; its time may be told in it.
                outside.ok((EXCHANGED.enter_event_mode)(c));
                outside.ok((EXCHANGED.enter_event_mode)(c));
                outside.ok((EXCHANGED.set_time)(c, t + H));
                ended(&outside);
            }
        }
    }
}

/// The rates of both versions, in both interfaces.
#[test]
fn rates_have_the_bits_of_fmi3() {
    for configuration in [PLANT, PENDULUM] {
        let (old, new) = (Fmu::exchanged(configuration), Fmu::of_fmi3(configuration, false));
        let (two, three) = (continuous(&old), crate::fmi3::exchange::continuous(&new));
        let stepped = Slave::ready(&old);
        for k in 0..50 {
            let of = |i: usize| (f64::from(k) * 0.37 + i as f64).sin() * 3.0;
            let x: Vec<f64> = (0..old.product.layout.states).map(of).collect();
            let u: Vec<f64> = (0..old.product.layout.inputs).map(|i| of(i + 7)).collect();
            two.set_inputs(&u);
            three.set_inputs(&u);
            let t = f64::from(k) * 0.1;
            let bits = |rates: Vec<f64>| rates.into_iter().map(f64::to_bits).collect::<Vec<_>>();
            let own = rates(&two, t, &x);
            assert_eq!(bits(own), bits(crate::fmi3::exchange::rates(&three, t, &x)));
            // In co-simulation the rates are those of the present state and input.
            stepped.set_inputs(&u);
            stepped.step(t, 0.1);
            let states = old.product.variables.iter().filter(|v| v.name.starts_with("x."));
            let now: Vec<f64> = states.map(|v| stepped.real(&v.name)).collect();
            let locals = old.product.variables.iter().filter(|v| v.causality == Causality::Local);
            let told: Vec<f64> = locals.map(|v| stepped.real(&v.name)).collect();
            assert_eq!(bits(told), bits(rates(&two, t, &now)));
        }
    }
}

#[test]
fn states_that_are_none() {
    let fmu = Fmu::exchanged(PLANT);
    let slave = continuous(&fmu);
    let (c, before) = (slave.component, slave.now());
    let set = |x: &[f64]| (EXCHANGED.set_continuous_states)(c, x.as_ptr(), x.len());
    assert_eq!(set(&[1.0, f64::NAN, 0.0, 0.0]), DISCARD, "the integrator may try others");
    let told = slave.log.messages().pop();
    assert_eq!(told.as_deref(), Some("fmi2SetContinuousStates: x.y_p is NaN, must be finite"));
    assert_eq!(slave.refused(set(&[1.0; 3])), "fmi2SetContinuousStates: nx is 3, must be 4");
    assert!(slave.refused((EXCHANGED.set_time)(c, f64::NAN)).contains("time is NaN"));
    let indicators = (EXCHANGED.get_event_indicators)(c, [0.0].as_mut_ptr(), 1);
    assert_eq!(slave.refused(indicators), "fmi2GetEventIndicators: ni is 1, must be 0: there are none");
    for status in [
        set_null(c),
        (EXCHANGED.get_derivatives)(c, null_mut(), 4),
        (EXCHANGED.new_discrete_states)(c, null_mut()),
        (EXCHANGED.completed_integrator_step)(c, 1, null_mut(), &mut 0),
    ] {
        slave.refused(status);
    }
    let message = slave.refused(slave.try_set("der(x.v)", 1.0));
    assert_eq!(message, "fmi2SetReal: der(x.v) is computed and cannot be set");
    assert!(slave.refused(slave.try_set("x.v", 1.0)).contains("x.v is an output and cannot be set"));
    assert!(slave.now() == before);
    // A rate that is no number.
    slave.set("u.a", f64::INFINITY);
    let mut found = [7.5; 4];
    assert_eq!((EXCHANGED.get_derivatives)(c, found.as_mut_ptr(), 4), DISCARD);
    assert_eq!(found, [7.5; 4]);
    slave.set("u.a", 0.0);
    let mut nominals = [0.0; 4];
    slave.ok((EXCHANGED.get_nominals_of_continuous_states)(c, nominals.as_mut_ptr(), 4));
    assert_eq!(nominals, [1.0; 4]);
    // A state of model exchange is none of co-simulation, and the other way round.
    let (exchanged, stepped) = (slave.now(), Slave::ready(&fmu));
    let message = stepped.refused((API.set_state)(stepped.component, stepped.read(&exchanged)));
    assert!(message.contains("the mode \"continuous time\", which the interface"), "{message}");
    let message = slave.refused((API.set_state)(c, slave.read(&stepped.now())));
    assert!(message.contains("the mode \"step\", which the interface"), "{message}");
    let other = Slave::exchanged(&fmu);
    other.restore(other.read(&exchanged));
    assert!(other.now() == exchanged);
}

fn set_null(c: crate::api::Component) -> std::ffi::c_int {
    (EXCHANGED.set_continuous_states)(c, std::ptr::null(), 4)
}

/// Rates and outputs by states and inputs, against differences.
#[test]
fn derivatives_of_the_rates() {
    let fmu = Fmu::exchanged(PENDULUM);
    let slave = continuous(&fmu);
    let (known, observed) = (
        ["x.phi", "x.omega", "u.torque"].map(|name| fmu.reference(name)),
        ["der(x.phi)", "der(x.omega)", "x.phi", "x.omega", "y.height"],
    );
    let unknown = observed.map(|name| fmu.reference(name));
    let at = [0.4, -1.2, 0.7];
    let look = |values: [f64; 3]| -> Vec<f64> {
        set(&slave, 0.0, &values[..2]);
        slave.set("u.torque", values[2]);
        observed.iter().map(|name| slave.real(name)).collect()
    };
    for column in 0..3 {
        let moved = |by: f64| {
            let mut values = at;
            values[column] += by;
            look(values)
        };
        let (plus, minus) = (moved(STEP), moved(-STEP));
        look(at);
        let (one, mut found) = (1.0, [7.5; 5]);
        slave.ok((API.directional_derivative)(
            slave.component,
            unknown.as_ptr(),
            5,
            &raw const known[column],
            1,
            &raw const one,
            found.as_mut_ptr(),
        ));
        for row in 0..5 {
            let wanted = (plus[row] - minus[row]) / (2.0 * STEP);
            let close = (found[row] - wanted).abs() <= TOLERANCE * (1.0 + wanted.abs());
            assert!(close, "{} by {column}: {} for {wanted}", observed[row], found[row]);
        }
    }
}
