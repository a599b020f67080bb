//! A filter that is handed the derivatives, against one that computes them: the same bits, and the same
//! derivative of a sample.

use std::sync::Arc;

use punctual_core::barriers::{DistanceDisc, NormBound};
use punctual_core::filter::{BarrierSettings, Filter, SampleDerivative, Sampling, Status};
use punctual_core::lie::{self, Ahead, DerivativeSource, Derivatives, Direction};
use punctual_core::plants::Unicycle;

/// Of numbers of order 1 to 10: two ways through the same dozen operations.
const ROUND_OFF: f64 = 1e-12;

const INPUTS: usize = 2;
const STEP: f64 = 0.01;
const DEADLINE: f64 = 4.0;

/// Sources that somebody else evaluates: the goal's derivatives (n = 2) and the speed limit's (n = 1).
fn sources() -> [Box<dyn DerivativeSource>; 2] {
    let goal = DistanceDisc::new([12.0, 5.0], 2.0, 2.0).expect("valid disc");
    let speed = NormBound::of_one(3, 6.0).expect("valid bound");
    [
        lie::along(Arc::new(Unicycle), goal, 2).expect("in range"),
        lie::along(Arc::new(Unicycle), speed, 1).expect("in range"),
    ]
}

fn filter(sources: [Box<dyn DerivativeSource>; 2]) -> Filter {
    let settings = BarrierSettings::within(DEADLINE).margin(0.1);
    let dims = sources.each_ref().map(|source| source.state_dim());
    let [goal, speed] = sources;
    Filter::from_sources(dims[0], INPUTS)
        .measured(dims[1] - dims[0])
        .source("goal", goal, settings)
        .and_then(|b| b.source("speed", speed, settings))
        .and_then(|b| b.bounds(&[-30.0; INPUTS], &[30.0; INPUTS]))
        .and_then(|b| b.sampling(Sampling::Pointwise))
        .and_then(|b| b.build())
        .expect("a filter")
}

/// The filter whose state is the stacks of both barriers.
fn external() -> Filter {
    let given = |n: usize, first: usize| lie::external(n, INPUTS, first).expect("in range");
    filter([given(2, 0), given(1, 5)])
}

/// The stacks at `x`.
fn stacks(t: f64, x: &[f64]) -> Vec<f64> {
    let mut all = Vec::new();
    for source in sources() {
        let mut out = Derivatives::ZERO;
        source.evaluate(t, x, &mut out);
        all.extend_from_slice(&out.drift[..=source.relative_degree()]);
        all.extend_from_slice(&out.row[..INPUTS]);
    }
    all
}

/// The derivative of that along `dx`.
fn stacks_directional(t: f64, x: &[f64], dx: &[f64]) -> Vec<f64> {
    let (mut all, zero) = (Vec::new(), [0.0; INPUTS]);
    for source in sources() {
        let n = source.relative_degree();
        let mut out = Ahead::ZERO;
        let directional = source.directional().expect("a model");
        directional.evaluate_directional(t, x, &zero, Direction { x: dx, u: &zero }, &mut out);
        all.extend_from_slice(&out.value[..=n]);
        all.extend_from_slice(&out.gradient[n][..INPUTS]);
    }
    all
}

#[test]
fn the_same_bits_in_a_closed_loop_and_the_same_derivative() {
    let (mut own, mut given) = (filter(sources()), external());
    let (mut x, mut filtered, mut known) = (vec![0.0, 0.0, 0.3, 1.0], 0, 0);
    for k in 0..(2.0 * DEADLINE / STEP) as usize {
        let (t, u_ref) = (k as f64 * STEP, [0.5, 0.4]);
        if k % 50 == 7 {
            let (dx, du_ref) = ([0.3, -0.2, 0.5, 1.0], [-0.25, 0.75]);
            let (mut wanted, mut found) = (SampleDerivative::default(), SampleDerivative::default());
            let unknown = own
                .differentiate(t, &x, &u_ref, Direction { x: &dx, u: &du_ref }, &mut wanted)
                .expect("lengths");
            let direction = Direction { x: &stacks_directional(t, &x, &dx), u: &du_ref };
            let also =
                given.differentiate(t, &stacks(t, &x), &u_ref, direction, &mut found).expect("lengths");
            assert_eq!(also, unknown);
            // Where bounds choose the rate there is none.
            known += usize::from(unknown.is_none());
            if unknown.is_some() {
                continue;
            }
            let numbers = |d: &SampleDerivative| {
                let barriers = d.barriers.iter().flat_map(|b| [b.h, b.profile, b.margin, b.slack]);
                d.u.into_iter().chain(barriers).collect::<Vec<_>>()
            };
            for (found, wanted) in numbers(&found).into_iter().zip(numbers(&wanted)) {
                assert!(
                    (found - wanted).abs() <= ROUND_OFF * (1.0 + wanted.abs()),
                    "{found} for {wanted} at {t}"
                );
            }
        }
        let (mut u, mut u_given) = ([0.0; INPUTS], [0.0; INPUTS]);
        let wanted = own.step(t, &x, &u_ref, &mut u).expect("lengths").clone();
        let found = given.step(t, &stacks(t, &x), &u_ref, &mut u_given).expect("lengths");
        assert_eq!(u.map(f64::to_bits), u_given.map(f64::to_bits), "at {t}");
        assert_eq!(*found, wanted, "at {t}");
        assert!(wanted.status.is_satisfied(), "{:?} at {t}", wanted.status);
        assert!(t < DEADLINE || wanted.barriers[0].h >= 0.0, "outside at {t}");
        filtered += usize::from(wanted.status == Status::Filtered);
        sources()[0].predict().expect("a model").flow(&mut x, &u, STEP);
    }
    assert!(filtered > 100 && known > 3, "{filtered} steps were filtered, {known} derivatives compared");
}

#[test]
fn without_a_prediction_a_step_is_pointwise_and_a_delay_refused() {
    let settings = BarrierSettings::within(DEADLINE).margin(0.1);
    let builder = || {
        let source = lie::external(1, 1, 0).expect("in range");
        Filter::from_sources(3, 1).source("h", source, settings).expect("valid settings")
    };
    let mut filter = builder().sampling(Sampling::Period(0.1)).and_then(|b| b.build()).expect("a filter");
    let mut u = [0.0];
    let report = filter.step(0.0, &[-1.0, 0.0, 2.0], &[0.0], &mut u).expect("lengths");
    assert_eq!((report.status, report.predicted), (Status::Filtered, false));
    let delayed = builder().actuation_delay(0.1).and_then(|b| b.build()).err().map(|e| e.to_string());
    let wanted = "h.actuation_delay: the barrier's source of derivatives cannot predict the state";
    assert_eq!(delayed.as_deref(), Some(wanted));
    // What is handed over wrongly shows, and the input is that nearest 0.
    for (x, status) in [
        ([f64::NAN, 0.0, 2.0], Status::InvalidInput),
        ([-1.0, 0.0, f64::INFINITY], Status::InvalidInput),
        ([-1.0, 0.0, 0.0], Status::NoAuthority),
    ] {
        assert_eq!(filter.step(0.1, &x, &[0.0], &mut u).expect("lengths").status, status);
        assert_eq!(u, [0.0]);
    }
}
