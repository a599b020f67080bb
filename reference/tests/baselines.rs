//! The baselines in closed loop, against solutions in closed form.
//!
//! On a chain of n integrators with h = x₁ the least input is the floor itself. So the state follows the
//! constraint with equality, and held inputs of `STEP` seconds leave an error of first order in it.

use std::sync::Arc;

use std::array::from_fn;

use punctual_core::MAX_RELATIVE_DEGREE;
use punctual_core::barrier::Barrier;
use punctual_core::convergence::condition::{Abilities, Anchored, Anchoring, Bound, Rates};
use punctual_core::convergence::operator::Operator;
use punctual_core::dynamics::{ControlAffine, rk4_step};
use punctual_core::filter::{BarrierSettings, Filter, FilterBuilder, Method, Phase, Sampling, Status};
use punctual_core::lie;
use punctual_core::scalar::Scalar;
use punctual_reference::baselines::{
    Chain, ClassK, Condition, Exponent, Exponential, FirstOrderFixedTime, Sample, Tube,
};
use punctual_reference::simulation::{Schedule, closed_loop};

/// ẋ₁ = x₂, …, ẋ_N = u.
#[derive(Clone, Copy)]
struct Integrators<const N: usize>;

impl<const N: usize> ControlAffine<N, 1> for Integrators<N> {
    fn drift<S: Scalar>(&self, x: &[S; N]) -> [S; N] {
        from_fn(|i| if i + 1 < N { x[i + 1] } else { S::zero() })
    }

    fn input_map<S: Scalar>(&self, _x: &[S; N]) -> [[S; 1]; N] {
        from_fn(|i| from_fn(|_| if i + 1 == N { S::one() } else { S::zero() }))
    }
}

/// h = x₁.
struct First;

impl<const N: usize> Barrier<N> for First {
    fn value<S: Scalar>(&self, _t: S, x: &[S; N]) -> S {
        x[0]
    }
}

const STEP: f64 = 1e-4;
const DEADLINE: f64 = 2.0;

/// h at every sample until `end` s, the phase, and the time of the arrival. u_ref is far below every floor.
fn follow<const N: usize>(
    condition: impl Condition + Send + Sync + 'static,
    x0: [f64; N],
    end: f64,
) -> (Vec<f64>, Phase, Option<f64>) {
    let source = lie::along(Arc::new(Integrators::<N>), First, N).expect("a source");
    let mut filter = Filter::from_sources(N, 1)
        .source("line", source, BarrierSettings::within(DEADLINE))
        .and_then(|b| b.condition(condition))
        .and_then(|b| b.build())
        .expect("a filter");
    let (mut h, mut phase, mut arrival) = (Vec::new(), Phase::Waiting, None);
    let schedule = Schedule { step: STEP, steps: (end / STEP).round() as usize, substeps: 1 };
    closed_loop(
        &mut filter,
        &Integrators::<N>,
        x0,
        schedule,
        |_, _| [-1e5],
        |_, x, _, report| {
            assert!(report.status == Status::Filtered && !report.predicted, "{report:?}");
            assert!(!report.barriers[0].on_course);
            h.push(x[0]);
            (phase, arrival) = (report.barriers[0].phase, report.barriers[0].arrival_time);
        },
    )
    .expect("a run");
    (h, phase, arrival)
}

#[track_caller]
fn assert_follows(found: &[f64], wanted: impl Fn(f64) -> f64, tolerance: f64) {
    for (k, h) in found.iter().enumerate() {
        let wanted = wanted(k as f64 * STEP);
        assert!((h - wanted).abs() < tolerance, "{h} at {}, wanted {wanted}", k as f64 * STEP);
    }
}

/// (D + a)h = 0: h₀ e^{−at}; (D + 2)(D + 3)h = 0 from h₀, ḣ₀ = 0: h₀ (3 e^{−2t} − 2 e^{−3t}). Never there.
#[test]
fn exponential_conditions_decay_and_do_not_arrive() {
    let (h, phase, arrival) = follow(Exponential::repeated(1, 1.5).unwrap(), [-4.0], 4.0);
    assert_follows(&h, |t| -4.0 * (-1.5 * t).exp(), 10.0 * STEP);
    assert_eq!((phase, arrival), (Phase::Late, None));
    let rates = Operator::new(&[2.0, 3.0]).unwrap();
    let exact = |t: f64| -4.0 * (3.0 * (-2.0 * t).exp() - 2.0 * (-3.0 * t).exp());
    let (h, _, arrival) = follow(Exponential::new(rates), [-4.0, 0.0], 4.0);
    assert_follows(&h, exact, 10.0 * STEP);
    assert_eq!(arrival, None);
    // The chain of linear functions is the same constraint.
    let (h, _, _) = follow(Chain::linear(&[2.0, 3.0]).unwrap(), [-4.0, 0.0], 4.0);
    assert_follows(&h, exact, 10.0 * STEP);
}

/// ḣ = p |h|^{1/2}: h = −(√|h₀| − p t/2)², zero at the reach time 2√|h₀|/p.
#[test]
fn a_power_arrives_at_its_reach_time() {
    let chain = Chain::finite_time(&[2.0], &[0.5]).unwrap();
    let bound = chain.reach_time(&[-4.0]);
    assert_eq!(bound, 2.0);
    let (h, _, arrival) = follow(chain, [-4.0], 1.95);
    assert_follows(&h, |t| -(2.0 - t).powi(2), 10.0 * STEP);
    assert_eq!(arrival, None);
    // Within ten steps the input of one of them passes zero.
    let (_, _, arrival) = follow(chain, [-4.0], 2.1);
    assert!((arrival.unwrap() - bound).abs() < 10.0 * STEP, "{arrival:?}");
}

/// From rest, the first link is outside too. It arrives after |ψ_1|^{1/2}/(p/2), and h no later than after the
/// time that the first link alone then needs. h falls at no time from rest, so |h| ≤ |h₀| throughout.
#[test]
fn a_chain_of_powers_arrives_within_the_sum_of_its_reach_times() {
    for (p, q, h0) in [([2.0, 4.0], [0.5, 0.5], -4.0), ([3.0, 2.0], [0.75, 0.4], -9.0)] {
        let chain = Chain::finite_time(&p, &q).unwrap();
        let bound = chain.reach_time(&[h0, 0.0]);
        let (_, _, arrival) = follow(chain, [h0, 0.0], bound + 0.01);
        assert!(arrival.is_some_and(|t| t <= bound), "{arrival:?} for {bound}");
    }
}

/// With ψ_1(0) = 0 the first-order condition of any order arrives at T: h = −(1 − t/T)² for p = 1/2.
#[test]
fn the_first_order_condition_arrives_at_the_deadline() {
    let condition = FirstOrderFixedTime::new(1, Exponent::default(), 5.0).unwrap();
    let (_, _, arrival) = follow(condition, [-4.0], DEADLINE + 0.01);
    assert!((arrival.unwrap() - DEADLINE).abs() < 0.01, "{arrival:?}");
    let condition = FirstOrderFixedTime::new(2, Exponent::default(), 5.0).unwrap();
    let (h, _, _) = follow(condition, [-1.0, 2.0 / DEADLINE], DEADLINE - 0.1);
    assert_follows(&h, |t| -(1.0 - t / DEADLINE).powi(2), 20.0 * STEP);
    // From rest it is late: ψ_1(0) < 0.
    let (_, phase, arrival) = follow(condition, [-1.0, 0.0], DEADLINE);
    assert_eq!((phase, arrival), (Phase::Late, None));
}

/// h ≥ −s, and h = −s where the start is on it; at the deadline the tube is the set.
#[test]
fn a_tube_is_kept_until_it_is_the_set() {
    let (h, _, _) = follow(Tube::new(1, 1, 5.0).unwrap(), [-4.0], 3.0);
    assert_follows(&h, |t| -4.0 * (1.0 - t / DEADLINE).max(0.0), 10.0 * STEP);
    let tube = Tube::new(3, 3, 10.0).unwrap();
    let start = [-4.0, 0.0, 0.0];
    let (h, _, _) = follow(tube, start, 3.0);
    for (k, h) in h.iter().enumerate() {
        let bound = tube.bound(&Sample::new(&start, DEADLINE, k as f64 * STEP, &start)).lower;
        // The tolerance is the cost of held inputs.
        assert!(*h >= bound - STEP, "{h} below {bound} at {}", k as f64 * STEP);
    }
}

#[test]
fn settings_that_a_condition_would_replace_are_refused() {
    let build = |settings: BarrierSettings| {
        let source = lie::along(Arc::new(Integrators::<2>), First, 2).expect("a source");
        let builder = Filter::from_sources(2, 1).source("line", source, settings).expect("settings");
        builder.condition(Chain::new(&[ClassK::Linear(1.0)]).unwrap()).err().map(|e| e.to_string())
    };
    let settings = BarrierSettings::within(1.0);
    assert_eq!(build(settings), None);
    assert_eq!(
        build(settings.method(Method::RepeatedRoot)).unwrap(),
        "line.method: a custom constraint replaces method and profile"
    );
    assert_eq!(build(settings.recovery(1.0)).unwrap(), "line.recovery: a custom constraint has no recovery");
    let none = Filter::from_sources(1, 1).condition(Chain::linear(&[1.0]).unwrap()).err();
    assert_eq!(none.unwrap().to_string(), "condition: there is no barrier yet to have it");
}

/// (D + 2)² (h − μ − r) ≥ 0 with r = 0.2, as a user writes it who says all that the trait can say.
struct Complete;

const AIM: f64 = 0.2;

impl Condition for Complete {
    fn bound(&self, at: &Sample) -> Bound {
        Bound::floor(-4.0 * (at.e[0] - AIM + at.e[1]))
    }

    fn abilities(&self) -> Abilities {
        let mut abilities = Abilities::default();
        abilities.hands_over = true;
        abilities
    }

    fn anchor(&self, at: &Anchoring) -> Anchored {
        Anchored { margin: at.margin, rate: 2.0, fallback: false, applies: false }
    }

    fn rates(&self, at: &Sample) -> Option<Rates> {
        Some(Rates::Repeated(at.rate))
    }

    fn profile(&self, _at: &Sample, _elapsed: f64) -> [f64; MAX_RELATIVE_DEGREE + 1] {
        from_fn(|k| if k == 0 { AIM } else { 0.0 })
    }
}

/// A condition with rates is enforced over the period; one that switches over is followed by the stay constraint, with its
/// guarantee.
#[test]
fn a_condition_that_is_a_method() {
    let settings = BarrierSettings::within(DEADLINE).margin(0.1);
    let mut filter = Filter::from_sources(2, 1)
        .source("line", lie::along(Arc::new(Integrators::<2>), First, 2).expect("a source"), settings)
        .and_then(|b| b.condition(Complete))
        .and_then(|b| b.sampling(Sampling::Period(0.01)))
        .and_then(FilterBuilder::build)
        .expect("a valid filter");
    let (mut x, mut u) = ([-1.0, 0.0], [0.0]);
    for k in 0..500 {
        let report = filter.step(f64::from(k) * 0.01, &x, &[-1.0], &mut u).unwrap();
        assert!(report.predicted, "enforced over the period");
        assert_eq!(report.barriers[0].on_course, report.barriers[0].phase == Phase::Stay);
        x = rk4_step(&Integrators::<2>, &x, &u, 0.01);
    }
    let b = &filter.report().barriers[0];
    assert_eq!((b.phase, b.on_course), (Phase::Stay, true));
    assert!(b.h >= 0.05, "{}", b.h);
}
