//! Chains of n integrators from rest: the reference profile for any order.

use std::sync::Arc;

use std::array::from_fn;

use punctual_core::barrier::Barrier;
use punctual_core::dynamics::ControlAffine;
use punctual_core::filter::{BarrierSettings, Filter, FilterBuilder};
use punctual_core::lie;
use punctual_core::scalar::Scalar;
use punctual_reference::simulation::{Schedule, closed_loop};

/// ẋ₁ = x₂, …, ẋ_N = u.
pub(super) struct Chain<const N: usize>;

impl<const N: usize> ControlAffine<N, 1> for Chain<N> {
    fn drift<S: Scalar>(&self, x: &[S; N]) -> [S; N] {
        from_fn(|i| if i + 1 < N { x[i + 1] } else { S::zero() })
    }

    fn input_map<S: Scalar>(&self, _x: &[S; N]) -> [[S; 1]; N] {
        from_fn(|i| from_fn(|_| if i + 1 == N { S::one() } else { S::zero() }))
    }
}

/// h = x₁.
struct NonNegative;

impl<const N: usize> Barrier<N> for NonNegative {
    fn value<S: Scalar>(&self, _t: S, x: &[S; N]) -> S {
        x[0]
    }
}

const DEADLINE: f64 = 5.0;
const MARGIN: f64 = 0.05;

/// The margin minus the cost of sampling at up to 50 ms: 0.05 − 0.004.
const LEAST_AFTER: f64 = 0.046;

/// Arrival and least h after the deadline, from x₁ = −1 at rest until 2T.
fn from_rest<const N: usize>(step: f64) -> (Option<f64>, f64) {
    let settings = BarrierSettings::within(DEADLINE).rate(3.0).stay_rate(3.0).margin(MARGIN);
    let mut filter = lie::along(Arc::new(Chain::<N>), NonNegative, N)
        .and_then(|source| Filter::from_sources(N, 1).source("line", source, settings))
        .and_then(FilterBuilder::build)
        .expect("valid filter");
    let mut x0 = [0.0; N];
    x0[0] = -1.0;
    let (mut arrival, mut least) = (None, f64::INFINITY);
    let schedule = Schedule { step, steps: (2.0 * DEADLINE / step).round() as usize, substeps: 1 };
    closed_loop(
        &mut filter,
        &Chain::<N>,
        x0,
        schedule,
        |_, _| [0.0],
        |t, _, _, report| {
            let b = &report.barriers[0];
            assert!(report.status.is_satisfied(), "n {N}, step {step}: {:?} at {t}", report.status);
            arrival = b.arrival_time;
            if t > DEADLINE - step / 2.0 {
                least = least.min(b.h);
            }
        },
    )
    .expect("valid schedule");
    (arrival, least)
}

fn check<const N: usize>() {
    for step in [0.001, 0.01, 0.05] {
        let (arrival, least) = from_rest::<N>(step);
        assert!(arrival.is_some_and(|t| t < DEADLINE), "n {N}, step {step}: arrival {arrival:?}");
        assert!(least >= LEAST_AFTER, "n {N}, step {step}: least h after the deadline {least}");
    }
}

#[test]
fn order_two() {
    check::<2>();
}

#[test]
fn order_three() {
    check::<3>();
}

#[test]
fn order_four() {
    check::<4>();
}

#[test]
fn order_five() {
    check::<5>();
}
