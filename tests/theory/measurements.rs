//! Bounded errors of the measured state, with and without settings that account for them.

use std::array::from_fn;

use punctual_core::barrier::Barrier;
use punctual_core::barriers::StateBound;
use punctual_core::dynamics::{ControlAffine, rk4_step};
use punctual_core::filter::{BarrierSettings, Filter, Sampling};
use punctual_core::plants::PointMass;

use super::distance;
use super::disturbances::{Failures, JerkCar};
use super::starts::{DEADLINE, drawn, uniform};

const STEP: f64 = 0.01;
const MARGIN: f64 = 0.02;

/// The kinds of measurement errors.
#[derive(Clone, Copy, Debug)]
enum Noise {
    /// Uniform within the bound, drawn again every so many samples.
    Uniform(usize),
    /// At the bound all the time, with a fixed sign for each state.
    Biased,
}

/// Failures of the runs from `starts` in which the filter sees x + error, |error_i| ≤ `errors[i]`, judged by
/// the true state. `seems(x)` gives the signs of the bias with which the state looks best.
fn failures<P, B, const NX: usize, const NU: usize>(
    (plant, barrier): (P, B),
    (errors, allowed): ([f64; NX], bool),
    noise: Noise,
    starts: &[[f64; NX]],
    seems: impl Fn(&[f64; NX]) -> [f64; NX],
    nominal: impl Fn(&[f64; NX]) -> [f64; NU],
) -> Failures
where
    P: ControlAffine<NX, NU> + Copy + Send + Sync + 'static,
    B: Barrier<NX> + Copy + Send + 'static,
{
    let settings = BarrierSettings::within(DEADLINE).rate(5.0).stay_rate(5.0).margin(MARGIN);
    let mut failures = Failures::default();
    let mut random = uniform();
    for start in starts {
        let mut filter = Filter::builder(plant)
            .barrier("goal", barrier, settings)
            .and_then(|b| b.measurement_errors(if allowed { &errors } else { &[0.0; NX] }))
            .and_then(|b| b.sampling(Sampling::Measured { first: Some(STEP) }))
            .and_then(|b| b.build())
            .expect("a valid filter");
        let (mut x, mut u) = (*start, [0.0; NU]);
        let (mut on_time, mut outside) = (false, false);
        let mut signs = [0.0; NX];
        for k in 0..=(2.0 * DEADLINE / STEP).round() as usize {
            let t = k as f64 * STEP;
            match noise {
                Noise::Uniform(samples) if k % samples == 0 => signs = signs.map(|_| 2.0 * random() - 1.0),
                Noise::Uniform(_) => {}
                Noise::Biased => signs = seems(&x),
            }
            let measured = from_fn::<f64, NX, _>(|i| x[i] + signs[i] * errors[i]);
            let u_ref = nominal(&measured);
            let report = filter.step(t, &measured, &u_ref, &mut u);
            failures.unmet += usize::from(!report.expect("a valid sample").status.is_satisfied());
            let h = barrier.value(t, &x);
            // Half a step, so that round-off in t cannot move the sample at the deadline.
            on_time |= h >= 0.0 && t < DEADLINE + STEP / 2.0;
            outside |= h < 0.0 && t > DEADLINE - STEP / 2.0;
            x = rk4_step(&plant, &x, &u, STEP);
        }
        failures.late += usize::from(!on_time);
        failures.outside += usize::from(outside);
    }
    failures
}

/// Point mass and jerk car, both with a u_ref that leads outwards.
fn table(count: usize, allowed: bool, noise: Noise) -> [Failures; 2] {
    let starts = drawn(count);
    let places: Vec<_> = starts.to_vec();
    let towards = |x: &[f64; 4]| {
        let [d_x, d_y] = [45.0 - x[0], 45.0 - x[1]].map(f64::signum);
        [d_x, d_y, d_x, d_y]
    };
    let away = |x: &[f64; 4]| [-x[2] - 10.0, -x[3] - 10.0];
    let errors = ([0.1, 0.1, 0.2, 0.2], allowed);
    let point_mass = failures((PointMass, distance()), errors, noise, &places, towards, away);
    let line = StateBound::at_least(0, 45.0).expect("a valid barrier");
    let places: Vec<_> = starts.iter().map(|x0| [x0[0], x0[2], x0[3] / 5.0]).collect();
    let (car, errors) = ((JerkCar(0.0), line), ([0.1, 0.2, 0.4], allowed));
    [point_mass, failures(car, errors, noise, &places, |_| [1.0; 3], |_| [-20.0])]
}

/// Steps that are not met in the thousand runs of the documentation: a known defect that must not grow.
const UNMET: usize = 43;

/// A row of the documentation: none late or outside if the settings account for the errors. The search does
/// not meet some rows of the point mass, at kinks of the bound: 43 steps of a thousand runs.
#[allow(clippy::print_stdout, reason = "the figures of the documentation")]
fn check(noise: Noise, least_lost: impl Fn(usize) -> usize) {
    let count = if std::env::var_os("PUNCTUAL_TABLES").is_some() { 1000 } else { 20 };
    let [allowed, plain] = [true, false].map(|allowed| table(count, allowed, noise));
    println!("of {count}, {noise:?}, point mass and jerk car: allowed for {allowed:?}, not {plain:?}");
    for kept in allowed {
        assert_eq!((kept.late, kept.outside), (0, 0), "{noise:?}, {kept:?} of {count}");
        let known = if count < 1000 { 0 } else { UNMET };
        assert!(kept.unmet <= known, "{noise:?}, {kept:?} of {count}");
    }
    for lost in plain {
        assert!(lost.outside >= least_lost(count), "{noise:?}, {lost:?} of {count}: the errors do nothing");
    }
}

/// These errors mostly cancel, and cost little in any case.
#[test]
fn errors_drawn_anew_at_every_sample() {
    check(Noise::Uniform(1), |_| 0);
}

/// These errors last for half a second each.
#[test]
fn errors_that_last() {
    check(Noise::Uniform(50), |count| count / 2);
}

#[test]
fn errors_at_their_worst() {
    check(Noise::Biased, |count| count / 2);
}
