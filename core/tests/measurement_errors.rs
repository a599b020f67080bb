//! Filters that allow for errors of the measured state.

use crate::support;

use std::sync::Arc;

use punctual_core::Error;
use punctual_core::barriers::StateBound;
use punctual_core::filter::{BarrierSettings, Filter, FilterBuilder, Method, SampleDerivative, Sampling};
use punctual_core::lie;
use punctual_core::plants::{PointMass, Unicycle};
use support::distance_disc;

const PERIOD: f64 = 0.01;

/// The deadline is 10 s, the rates 2/s.
fn settings() -> BarrierSettings {
    BarrierSettings::within(10.0).rate(2.0).stay_rate(2.0).margin(0.1)
}

fn unicycle(errors: &[f64]) -> Filter {
    Filter::builder(Unicycle)
        .barrier("goal", distance_disc(), settings())
        .and_then(|b| b.sampling(Sampling::Period(PERIOD)))
        .and_then(|b| b.measurement_errors(errors))
        .and_then(|b| b.build())
        .expect("a valid filter")
}

/// x_p − 30 ≥ 0 of a point mass: every derivative is linear in the state, so that the bounds are exact, and the input
/// is that of an exact filter at the worst of the states that may be measured as 0.
#[test]
fn with_linear_derivatives_it_is_the_filter_of_the_worst_state() {
    let line = || StateBound::at_least(0, 30.0).expect("a valid barrier");
    let filter = |errors: &[f64]| {
        Filter::builder(PointMass)
            .barrier("line", line(), settings())
            .and_then(|b| b.sampling(Sampling::Period(PERIOD)))
            .and_then(|b| b.measurement_errors(errors))
            .and_then(|b| b.build())
            .expect("a valid filter")
    };
    let (mut robust, mut exact) = (filter(&[0.3, 0.0, 0.2, 0.0]), filter(&[0.0; 4]));
    for (k, (x, v)) in
        [(0.0, 0.0), (0.01, 0.1), (-0.05, 0.2), (29.9, 0.5), (30.5, 0.1)].into_iter().enumerate()
    {
        let t = k as f64 * PERIOD;
        let [mut u, mut wanted] = [[0.0; 2]; 2];
        let report = robust.step(t, &[x, 0.0, v, 0.0], &[-5000.0, 0.0], &mut u).expect("a valid sample");
        assert!(report.barriers[0].on_course && !report.barriers[0].deadline_unreachable);
        exact.step(t, &[x - 0.3, 0.0, v - 0.2, 0.0], &[-5000.0, 0.0], &mut wanted).expect("a valid sample");
        // The same row, with other roundings.
        assert!((u[0] - wanted[0]).abs() <= 1e-9 * wanted[0].abs(), "{u:?} for {wanted:?}");
        assert_eq!(u[1], 0.0);
    }
}

/// Bit for bit that of a filter without.
#[test]
fn errors_of_zero_are_none() {
    let mut filters = [unicycle(&[0.0; 4]), {
        Filter::builder(Unicycle)
            .barrier("goal", distance_disc(), settings())
            .and_then(|b| b.sampling(Sampling::Period(PERIOD)))
            .and_then(|b| b.build())
            .expect("a valid filter")
    }];
    let mut x = [1.0, 2.0, 0.3, 4.0];
    for k in 0..50 {
        let t = f64::from(k) * PERIOD;
        let [a, b] = filters.each_mut().map(|filter| {
            let mut u = [0.0; 2];
            filter.step(t, &x, &[-1.0, 0.2], &mut u).expect("a valid sample");
            u.map(f64::to_bits)
        });
        assert_eq!(a, b);
        let u = a.map(f64::from_bits);
        let source = lie::along(Arc::new(Unicycle), distance_disc(), 2).expect("in range");
        source.predict().expect("a model").flow(&mut x, &u, PERIOD);
    }
}

/// The derivative with errors, at an anchor and later, against the differences of a step ten times as long.
#[test]
fn derivatives_with_errors_are_those_of_the_sample() {
    const STEP: f64 = 1e-4;
    const ALLOWED: f64 = 1e-3;
    let mut filter = unicycle(&[0.1, 0.1, 0.01, 0.05]);
    let (mut compared, mut kinks) = (0, 0);
    for k in 0..60 {
        let s = f64::from(k);
        let x = [10.0 + 0.3 * s, 5.0 * (0.3 * s).sin(), 0.3 * (0.7 * s).cos(), 3.0 + (0.2 * s).sin()];
        let (u_ref, t) = ([-2.0 + 0.1 * s, (0.9 * s).sin()], PERIOD * s);
        let (dx, du_ref) = ([(1.1 * s).sin(), (1.3 * s).cos(), 0.2, (1.7 * s).sin()], [0.5, (0.5 * s).cos()]);
        let mut derivative = SampleDerivative::default();
        let direction = lie::Direction { x: &dx, u: &du_ref };
        let unknown = filter.differentiate(t, &x, &u_ref, direction, &mut derivative).expect("right lengths");
        assert_eq!(unknown, None);
        let mut moved = |by: f64| {
            let (x, u_ref): ([f64; 4], [f64; 2]) = (
                std::array::from_fn(|i| x[i] + by * dx[i]),
                std::array::from_fn(|i| u_ref[i] + by * du_ref[i]),
            );
            let mut u = [0.0; 2];
            let report = filter.peek(t, &x, &u_ref, &mut u).expect("right lengths");
            let b = &report.barriers[0];
            [u[0], u[1], b.h, b.profile, b.margin, b.slack, b.sampling_loss]
        };
        let [less, here, more] = [-STEP, 0.0, STEP].map(&mut moved);
        let b = &derivative.barriers[0];
        let [a, o, ..] = derivative.u;
        let found = [a, o, b.h, b.profile, b.margin, b.slack, b.sampling_loss];
        let bends =
            |i: usize| (more[i] - 2.0 * here[i] + less[i]).abs() > 0.02 * STEP * (1.0 + found[i].abs());
        if (0..7).any(bends) {
            kinks += 1;
        } else {
            compared += 1;
            for i in 0..7 {
                let wanted = (more[i] - less[i]) / (2.0 * STEP);
                assert!(
                    (found[i] - wanted).abs() <= ALLOWED * (1.0 + wanted.abs()),
                    "{k} {i}: {} {wanted}",
                    found[i]
                );
            }
        }
        filter.step(t, &x, &u_ref, &mut [0.0; 2]).expect("right lengths");
    }
    assert!(compared > 50, "{compared}, {kinks} kinks");
}

#[test]
fn what_is_refused() {
    let builder = |settings| {
        Filter::builder(Unicycle).barrier("goal", distance_disc(), settings).expect("a valid barrier")
    };
    let refused = |message: &str, done: Result<Filter, Error>| {
        assert_eq!(done.err().map(|e| e.to_string()).as_deref(), Some(message));
    };
    let errors = [0.1, 0.0, 0.0, 0.0];
    let given = |errors: &[f64]| builder(settings()).measurement_errors(errors).and_then(|b| b.build());
    refused("measurement_errors: has 3 components, must have 4", given(&[0.1; 3]));
    refused("measurement_errors[2]: is -0.5, must be finite and >= 0", given(&[0.1, -0.5, 0.0, 0.0]));
    refused("measurement_errors[1]: is inf, must be finite and >= 0", given(&[f64::INFINITY, 0.0, 0.0, 0.0]));
    type Change = fn(FilterBuilder<Unicycle, 4, 2>) -> Result<FilterBuilder<Unicycle, 4, 2>, Error>;
    let with = |change: Change| {
        builder(settings()).measurement_errors(&errors).and_then(change).and_then(FilterBuilder::build)
    };
    refused(
        "measurement_errors: needs the prediction over the period, the sampling is pointwise",
        with(|b| b.sampling(Sampling::Pointwise)),
    );
    refused(
        "measurement_errors: needs an actuation_delay of 0, it is 0.01",
        with(|b| b.actuation_delay(0.01)),
    );
    let root = BarrierSettings::within(10.0).method(Method::RepeatedRoot);
    let done = builder(root).measurement_errors(&errors).and_then(|b| b.build());
    refused(
        "goal.measurement_errors: needs a method that allows for errors, such as the reference profile",
        done,
    );
    // h and the two parts of its row.
    let done = Filter::from_sources(4, 2)
        .source("goal", lie::external(1, 2, 0).expect("in range"), settings())
        .and_then(|b| b.measurement_errors(&errors))
        .and_then(FilterBuilder::build);
    refused("goal.measurement_errors: the barrier's source gives no derivatives along a direction", done);
}
