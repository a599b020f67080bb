//! Held inputs: predictions along the flow, the sampled form of the constraint, and its effect.

use crate::scenario;
use crate::support;

use std::sync::Arc;

use proptest::prelude::*;
use punctual_core::barrier::Barrier;
use punctual_core::barriers::{DistanceDisc, Outside, StateBound};
use punctual_core::convergence::comparison::binomial;
use punctual_core::dynamics::{ControlAffine, rk4_step};
use punctual_core::elementary::powf;
use punctual_core::filter::{BarrierSettings, Filter, FilterBuilder, Sampling, Status};
use punctual_core::lie::{self, Ahead, DerivativeSource, Derivatives};
use punctual_core::plants::{Bicycle, PointMass, Unicycle};
use punctual_core::scalar::Scalar;
use punctual_reference::simulation::{Schedule, closed_loop};
use scenario::{Integrator, NonNegative, damping, distance_disc, speed_damping};
use support::Reduced;

const DEADLINE: f64 = 5.0;

fn bicycle() -> Bicycle {
    Bicycle::new(10.0).expect("valid bicycle")
}

fn settings() -> BarrierSettings {
    BarrierSettings::within(DEADLINE).rate(5.0).stay_rate(5.0).margin(0.02)
}

fn filter<P>(plant: P, sampling: Sampling) -> Filter
where
    P: ControlAffine<4, 2> + Send + Sync + 'static,
{
    Filter::builder(plant)
        .barrier("goal", distance_disc(), settings())
        .and_then(|b| b.sampling(sampling))
        .and_then(FilterBuilder::build)
        .expect("valid filter")
}

/// Prediction against many small Runge-Kutta steps, its gradient against central differences.
#[test]
fn predictions_follow_the_flow() {
    let source = lie::along(Arc::new(bicycle()), distance_disc(), 2).expect("in range");
    let model = source.predict().expect("a model");
    let (x, u, period) = ([10.0, 20.0, 0.4, 6.0], [3.0, -0.7], 0.05);
    let mut ahead = Ahead::ZERO;
    model.ahead(1.0, &x, &u, period, &mut ahead);
    let mut exact = x;
    for _ in 0..100 {
        exact = rk4_step(&bicycle(), &exact, &u, period / 100.0);
    }
    let mut predicted = x;
    model.flow(&mut predicted, &u, period);
    // Two steps of a fourth-order method of 25 ms, rates of order 1/s: 2 · 0.025⁵ ≈ 2e-8 of 50 m.
    let off = (0..4).map(|i| (predicted[i] - exact[i]).powi(2)).sum::<f64>();
    assert!(off.sqrt() < 1e-6);
    let mut there = Derivatives::ZERO;
    source.evaluate(1.05, &predicted, &mut there);
    assert!((ahead.value[0] - there.drift[0]).abs() < 1e-12);
    assert!((ahead.value[1] - there.drift[1]).abs() < 1e-12);
    let at_u: f64 = there.drift[2] + there.row[0] * u[0] + there.row[1] * u[1];
    assert!((ahead.value[2] - at_u).abs() < 1e-11);
    for i in 0..2 {
        let step = 1e-4;
        let at = |d: f64| {
            let (mut moved, mut out) = (u, Ahead::ZERO);
            moved[i] += d;
            model.ahead(1.0, &x, &moved, period, &mut out);
            out.value
        };
        let (high, low) = (at(step), at(-step));
        for k in 0..=2 {
            let difference = (high[k] - low[k]) / (2.0 * step);
            // Central differences: step² and round-off 1e-14/step of values of order 10.
            assert!((ahead.gradient[k][i] - difference).abs() < 1e-7, "order {k}, input {i}");
        }
    }
}

/// ẋ = u − k x.
struct Decay(f64);

impl ControlAffine<1, 1> for Decay {
    fn drift<S: Scalar>(&self, x: &[S; 1]) -> [S; 1] {
        [-x[0] * self.0]
    }

    fn input_map<S: Scalar>(&self, _x: &[S; 1]) -> [[S; 1]; 1] {
        [[S::one()]]
    }
}

/// `bound` − x₁ after `duration` s, as a prediction of relative degree `n` has it.
fn predicted<P, const NX: usize, const NU: usize>(
    plant: P,
    n: usize,
    x: [f64; NX],
    u: [f64; NU],
    duration: f64,
) -> f64
where
    P: ControlAffine<NX, NU> + Send + Sync + 'static,
{
    let wall = StateBound::at_most(0, 0.0).expect("a bound");
    let source = lie::along(Arc::new(plant), wall, n).expect("in range");
    let mut ahead = Ahead::ZERO;
    source.predict().expect("a model").ahead(0.0, &x, &u, duration, &mut ahead);
    -ahead.value[0]
}

proptest! {
    /// Whether one Runge-Kutta step does or two are taken, what turns or decays is predicted to 1e-9 of the way, until two
    /// are off by that too. Each is allowed half as much again, and round-off.
    #[test]
    fn predictions_are_exact_to_a_part_of_the_way(
        turn in 1e-3..0.08_f64,
        heading in -3.0..3.0_f64,
        decay in 1e-3..0.04_f64,
        duration in 0.01..0.2_f64,
        speed in 1.0..20.0_f64,
    ) {
        // Along a circle; the way is that of the state that moves most.
        prop_assume!(turn / duration <= speed);
        let found = predicted(Unicycle, 2, [0.0, 0.0, heading, speed], [0.0, turn / duration], duration);
        let way = speed * duration;
        let exact = way * (f64::sin(heading + turn) - f64::sin(heading)) / turn;
        prop_assert!((found - exact).abs() <= 1.5e-9 * way + 1e-13 * way / turn.abs(), "{found} {exact}");
        // Towards rest.
        let found = predicted(Decay(decay / duration), 1, [speed], [0.0], duration);
        let exact = speed * f64::exp(-decay);
        prop_assert!((found - exact).abs() <= 1.5e-9 * (speed - exact) + 1e-15 * speed, "{found} {exact}");
    }
}

/// A chain of integrators is linear, so the sampled constraint is met to round-off at every sample,
/// whatever the period: ψ = (D + a)ⁿ⁻¹ e never falls below e^{−aδ} of itself.
fn psi_never_falls_faster<const N: usize>(period: f64) {
    let rate = 3.0;
    let settings = BarrierSettings::within(4.0).rate(rate).stay_rate(rate).margin(0.05);
    let mut filter = lie::along(Arc::new(Integrator::<N>), NonNegative, N)
        .and_then(|source| Filter::from_sources(N, 1).source("line", source, settings))
        .and_then(|b| b.sampling(Sampling::Period(period)))
        .and_then(FilterBuilder::build)
        .expect("valid filter");
    let mut x0 = [0.0; N];
    x0[0] = -1.0;
    let psi = |x: &[f64; N]| -> f64 {
        (0..N)
            .map(|k| {
                binomial(N - 1, k) * rate.powi((N - 1 - k) as i32) * (x[k] - if k == 0 { 0.05 } else { 0.0 })
            })
            .sum()
    };
    let mut last: Option<f64> = None;
    let mut least: f64 = f64::INFINITY;
    let schedule = Schedule { step: period, steps: (8.0 / period).ceil() as usize, substeps: 20 };
    closed_loop(
        &mut filter,
        &Integrator::<N>,
        x0,
        schedule,
        |_, _| [0.0],
        |t, x, _, report| {
            assert!(report.predicted && report.status.is_satisfied(), "n {N} at {t}: {:?}", report.status);
            if t >= 4.0 {
                // The profile is over: e is h − μ itself.
                if let Some(last) = last {
                    let floor = (-rate * period).exp() * last;
                    // The rows' tolerance and the predictor, exact for n ≤ 4, times the weights.
                    assert!(psi(x) >= floor - 1e-8, "n {N} at {t}: {} below {floor}", psi(x));
                }
                last = Some(psi(x));
                least = least.min(x[0]);
            }
        },
    )
    .expect("valid schedule");
    assert!(least >= 0.0, "n {N}, period {period}: least h after the deadline {least}");
}

#[test]
fn the_sampled_constraint_holds_at_every_sample() {
    for period in [0.01, 0.05, 0.2] {
        psi_never_falls_faster::<1>(period);
        psi_never_falls_faster::<2>(period);
        psi_never_falls_faster::<3>(period);
        psi_never_falls_faster::<4>(period);
    }
}

/// Arrival and least h after the deadline.
fn run<P>(
    plant: &P,
    nominal: fn(f64, &[f64; 4]) -> [f64; 2],
    sampling: Sampling,
    step: f64,
    x0: [f64; 4],
) -> (Option<f64>, f64)
where
    P: ControlAffine<4, 2> + Clone + Send + Sync + 'static,
{
    let mut filter = filter(plant.clone(), sampling);
    let (mut arrival, mut least) = (None, f64::INFINITY);
    let schedule = Schedule { step, steps: (2.0 * DEADLINE / step).round() as usize, substeps: 4 };
    closed_loop(&mut filter, plant, x0, schedule, nominal, |t, _, _, report| {
        arrival = report.barriers[0].arrival_time;
        if t > DEADLINE - step / 2.0 {
            least = least.min(report.barriers[0].h);
        }
    })
    .expect("valid schedule");
    (arrival, least)
}

/// Starts that the pointwise constraint loses at 50 ms: slow and across the line of sight, or reversing.
const HARD: [[f64; 4]; 4] =
    [[2.69, 16.95, 5.28, -4.90], [9.9, 9.0, 3.03, 5.77], [10.0, 10.0, 2.356, 0.01], [0.0, 20.0, -2.2, -9.0]];

#[test]
fn fifty_milliseconds_keep_the_deadline_and_the_margin() {
    for x0 in HARD {
        for sampling in [Sampling::Period(0.05), Sampling::Measured { first: None }] {
            for (name, (arrival, least)) in [
                ("point mass", run(&PointMass, damping, sampling, 0.05, x0)),
                ("unicycle", run(&Unicycle, speed_damping, sampling, 0.05, x0)),
                ("bicycle", run(&bicycle(), speed_damping, sampling, 0.05, x0)),
            ] {
                assert!(arrival.is_some_and(|t| t <= DEADLINE), "{name} {x0:?} {sampling:?}: {arrival:?}");
                assert!(least >= 0.0, "{name} {x0:?} {sampling:?}: {least}");
            }
        }
    }
}

/// The pointwise constraint at 50 ms throws this unicycle off its profile, and no longer claims what it
/// cannot keep; the sampled one keeps both.
#[test]
fn a_margin_that_is_used_up_is_no_guarantee() {
    let broken = |sampling: Sampling| {
        let mut filter = filter(Unicycle, sampling);
        let (mut claimed_below, mut lost) = (0, 0);
        let schedule = Schedule { step: 0.05, steps: 99, substeps: 4 };
        closed_loop(&mut filter, &Unicycle, HARD[0], schedule, speed_damping, |_, _, _, r| {
            let b = &r.barriers[0];
            // The profile is reported with the margin.
            let below = b.h < b.profile - 0.02 - 1e-9;
            claimed_below += usize::from(below && b.on_course);
            lost += usize::from(!b.on_course);
        })
        .expect("valid schedule");
        (claimed_below, lost)
    };
    let (claimed, lost) = broken(Sampling::Pointwise);
    assert!(claimed == 0 && lost > 0, "{claimed} {lost}");
    assert_eq!(broken(Sampling::Period(0.05)).0, 0);
}

/// The report names the period, and the loss is of second order in it.
#[test]
fn the_loss_shrinks_with_the_square_of_the_period() {
    let largest = |period: f64| {
        let mut filter = filter(PointMass, Sampling::Period(period));
        let mut loss: f64 = 0.0;
        let schedule = Schedule { step: period, steps: (4.0 / period) as usize, substeps: 1 };
        closed_loop(&mut filter, &PointMass, [5.0, 5.0, 1.0, -1.0], schedule, damping, |_, _, _, r| {
            assert_eq!((r.period, r.predicted), (period, true));
            loss = loss.max(r.barriers[0].sampling_loss);
        })
        .expect("valid schedule");
        loss
    };
    let (coarse, fine) = (largest(0.02), largest(0.01));
    assert!(fine > 0.0 && (3.0..5.0).contains(&(coarse / fine)), "{coarse} {fine}");
}

#[test]
fn a_reference_that_meets_the_sampled_rows_is_returned_bit_for_bit() {
    let mut filter = filter(PointMass, Sampling::Period(0.05));
    let (u_ref, mut u) = ([12.3, 11.7], [0.0; 2]);
    let report = filter.step(0.0, &[10.0, 10.0, 5.0, 5.0], &u_ref, &mut u).expect("right dimensions");
    assert_eq!((report.status, u), (Status::Unchanged, u_ref));
}

/// The measured period: a hundredth of the deadline at first or what is given, the step before then, at most
/// twice as much after a gap, and unchanged by a repeated or an earlier sample.
#[test]
fn the_period_is_measured() {
    let mut filter = filter(PointMass, Sampling::Measured { first: None });
    let mut u = [0.0; 2];
    let mut periods = Vec::new();
    for t in [0.0, 0.125, 0.25, 1.25, 1.25, 1.0, 1.125] {
        let report = filter.step(t, &[0.0; 4], &[0.0; 2], &mut u).expect("right dimensions");
        assert!(report.predicted);
        periods.push(report.period);
    }
    // The longest is forgotten by a hundredth of the time that passes.
    assert_eq!(periods, [0.01 * DEADLINE, 0.125, 0.125, 0.25, 0.25, 0.25, 0.25 - 0.01 * 0.125]);
    filter.rearm();
    let report = filter.step(2.0, &[0.0; 4], &[0.0; 2], &mut u).expect("right dimensions");
    assert_eq!(report.period, 0.01 * DEADLINE);
    let mut given = self::filter(PointMass, Sampling::Measured { first: Some(0.03) });
    let report = given.step(2.0, &[0.0; 4], &[0.0; 2], &mut u).expect("right dimensions");
    assert_eq!(report.period, 0.03);
}

#[test]
fn a_period_must_be_positive() {
    for value in [0.0, -0.01, f64::NAN, f64::INFINITY] {
        let refused = Filter::from_sources(4, 2).sampling(Sampling::Period(value)).err().expect("refused");
        assert_eq!(refused.to_string(), format!("sampling_period: is {value}, must be finite and > 0"));
    }
}

/// Without a model the constraint is pointwise, to the bit, and the report says so.
#[test]
fn without_a_prediction_the_constraint_is_pointwise() {
    let blind = Reduced::blind(lie::along(Arc::new(PointMass), distance_disc(), 2).expect("in range"));
    let mut blind = Filter::from_sources(4, 2)
        .source("goal", Box::new(blind), settings())
        .and_then(|b| b.sampling(Sampling::Period(0.05)))
        .and_then(FilterBuilder::build)
        .expect("valid filter");
    let first = [0.0, 3.0, 1.0, -4.0];
    let margin =
        blind.peek(0.0, &first, &[0.0; 2], &mut [0.0; 2]).expect("right dimensions").barriers[0].margin;
    assert!(margin > settings().margin);
    let mut pointwise = Filter::builder(PointMass)
        .barrier("goal", distance_disc(), settings().margin(margin))
        .and_then(|b| b.sampling(Sampling::Pointwise))
        .and_then(FilterBuilder::build)
        .expect("valid filter");
    for k in 0..20 {
        let (t, x) = (f64::from(k) * 0.05, [f64::from(k), 3.0, 1.0, -4.0]);
        let (mut u, mut wanted) = ([0.0; 2], [0.0; 2]);
        let report = blind.step(t, &x, &[0.0; 2], &mut u).expect("right dimensions").clone();
        let expected = pointwise.step(t, &x, &[0.0; 2], &mut wanted).expect("right dimensions");
        assert_eq!((u, report.predicted), (wanted, false));
        assert_eq!(report.barriers, expected.barriers);
    }
}

/// Samples further apart than was thought at the first one: the margin becomes what it would have been.
#[test]
fn the_margin_follows_the_measured_period() {
    let mut known = filter(PointMass, Sampling::Measured { first: Some(0.02) });
    let mut measured = filter(PointMass, Sampling::Measured { first: Some(0.0001) });
    let mut u = [0.0; 2];
    let mut margin = |filter: &mut Filter, t: f64| {
        let report = filter.step(t, &[2.0 * t, 0.0, 2.0, 0.0], &[0.0; 2], &mut u).expect("right dimensions");
        report.barriers[0].margin
    };
    let (wanted, first) = (margin(&mut known, 0.0), margin(&mut measured, 0.0));
    assert!(settings().margin < first && first < wanted, "{first} {wanted}");
    // Nearly: what has happened since the anchor may have started the profile again.
    let second = margin(&mut measured, 0.02);
    assert!((second - wanted).abs() < 1e-3 * wanted, "{second} for {wanted}");
    // Again where one is longer still, and never less.
    let third = margin(&mut measured, 0.06);
    let fourth = margin(&mut measured, 0.065);
    assert!(third > second && (fourth - third).abs() < 1e-3 * third, "{third} {fourth}");
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(32) })]

    /// A restored filter goes on with the same bits, and `peek` answers as `step` does.
    #[test]
    fn restored_equals_uninterrupted(interrupt in 0..30_usize, x0 in prop::array::uniform4(-10.0..20.0_f64)) {
        let build = || filter(bicycle(), Sampling::Measured { first: None });
        let (mut whole, mut second) = (build(), build());
        let mut u = [0.0; 2];
        second.step(0.7, &[45.0, 45.0, 1.0, 1.0], &[0.0; 2], &mut u).expect("right dimensions");
        let mut x = x0;
        for k in 0..60 {
            let t = k as f64 * 0.05;
            if k == interrupt {
                second.restore(whole.state()).expect("as many barriers");
            }
            let mut wanted = [0.0; 2];
            whole.step(t, &x, &[0.0; 2], &mut wanted).expect("right dimensions");
            if k >= interrupt {
                second.peek(t, &x, &[0.0; 2], &mut u).expect("right dimensions");
                prop_assert_eq!(u.map(f64::to_bits), wanted.map(f64::to_bits), "peek at {}", t);
                second.step(t, &x, &[0.0; 2], &mut u).expect("right dimensions");
                prop_assert_eq!(u.map(f64::to_bits), wanted.map(f64::to_bits), "at {}", t);
                prop_assert_eq!(whole.report(), second.report());
                prop_assert_eq!(whole.state(), second.state());
            }
            x = rk4_step(&bicycle(), &x, &wanted, 0.05);
        }
    }

    /// Whatever finite state, time and reference come, u is finite and within bounds.
    #[test]
    fn the_output_is_always_finite_and_within_bounds(
        samples in prop::collection::vec((any::<f64>(), prop::array::uniform4(any::<f64>()), prop::array::uniform2(any::<f64>())), 1..6),
        near in prop::collection::vec(prop::array::uniform4(-50.0..50.0_f64), 1..6),
        bounded in any::<bool>(),
        measured in any::<bool>(),
    ) {
        let high = if bounded { [60.0, 20.0] } else { [f64::INFINITY; 2] };
        let sampling = if measured { Sampling::Measured { first: None } } else { Sampling::Period(0.05) };
        let mut filter = Filter::builder(Unicycle)
            .barrier("goal", distance_disc(), settings())
            .and_then(|b| b.bounds(&high.map(|v| -v), &high))
            .and_then(|b| b.sampling(sampling))
            .and_then(FilterBuilder::build)
            .expect("valid filter");
        let near = near.iter().enumerate().map(|(k, x)| (k as f64 * 0.05, *x, [1.0, 1.0]));
        for (t, x, u_ref) in samples.into_iter().chain(near) {
            let mut u = [f64::NAN; 2];
            let report = filter.step(t, &x, &u_ref, &mut u).expect("right dimensions");
            prop_assert!(u.iter().zip(high).all(|(v, m)| v.is_finite() && v.abs() <= m), "{u:?} {report:?}");
        }
    }
}

/// The conditions of optimality at every step of a run with a goal, an obstacle and bounds: to round-off where the
/// constraint is pointwise, to where the search stops where it looks over the period.
#[test]
fn every_answer_is_optimal() {
    /// Where Newton's steps end, 1e-9 of u, times what a row's normal turns within a step of that length.
    const SEARCH: f64 = 1e-8;
    for (sampling, tolerance) in [(Sampling::Pointwise, 1e-13), (Sampling::Period(0.01), SEARCH)] {
        let obstacle = Outside(DistanceDisc::new([24.0, 23.0], 4.0, 4.0).expect("valid disc"));
        let mut filter = Filter::builder(PointMass)
            .barrier("goal", distance_disc(), settings())
            .and_then(|b| b.barrier("obstacle", obstacle, settings()))
            .and_then(|b| b.bounds(&[-60.0; 2], &[60.0; 2])?.sampling(sampling))
            .and_then(FilterBuilder::build)
            .expect("valid filter");
        assert_eq!(filter.residuals(&[0.0; 2], &[0.0; 2]), Ok(None), "nothing was solved yet");
        let (mut x, mut u) = ([0.0, 0.0, 1.0, 0.0], [0.0, 0.0]);
        let mut filtered = 0;
        for k in 0..1000 {
            let u_ref = [-x[2], -x[3]];
            let report = filter.step(f64::from(k) * 0.01, &x, &u_ref, &mut u);
            let status = report.expect("right dimensions").status;
            let residuals = filter.residuals(&u_ref, &u).expect("right dimensions");
            if status.is_satisfied() {
                let r = residuals.expect("a program was solved");
                let worst = r.stationarity.max(r.violation).max(r.negativity).max(r.complementarity);
                assert!(worst <= tolerance, "{sampling:?} at {k}: {r:?}");
                filtered += u32::from(status == Status::Filtered);
            }
            x = rk4_step(&PointMass, &x, &u, 0.01);
        }
        assert!(filtered > 300, "{sampling:?}: {filtered} steps filtered");
        filter.step(11.0, &[f64::NAN; 4], &[0.0; 2], &mut u).expect("right dimensions");
        assert_eq!(filter.residuals(&[0.0; 2], &u), Ok(None), "nothing was solved");
    }
}

/// A disturbance takes off h until the deadline too, where that lies within a hold: what is on course has h ≥ 0 under the
/// worst one, at every instant from the deadline on. q' = u + w, so the motion is a line.
#[test]
fn what_is_on_course_stands_a_disturbance_between_samples() {
    let mut on_course = 0;
    for case in 0..60_u32 {
        let part = |of: u32| f64::from(case * of % 61) / 61.0;
        let (push, period, deadline) = (0.2 + 2.0 * part(7), 0.02 + 0.18 * part(23), 1.0 + 3.0 * part(37));
        let settings = BarrierSettings::within(deadline).disturbance(push).margin(0.05 * part(11));
        let mut filter = Filter::builder(Integrator::<1>)
            .barrier("goal", NonNegative, settings)
            .and_then(|b| b.sampling(Sampling::Period(period)))
            .and_then(FilterBuilder::build)
            .expect("valid filter");
        let mut q = -1.0 - 8.0 * part(53);
        for k in 0..(2.0 * deadline / period) as u32 {
            let (t, mut u) = (f64::from(k) * period, [0.0]);
            filter.step(t, &[q], &[-5.0], &mut u).expect("right dimensions");
            let speaks = filter.report().barriers[0].on_course;
            on_course += u32::from(speaks);
            for i in 0..=40 {
                let s = period * f64::from(i) / 40.0;
                let h = q + (u[0] - push) * s;
                // Round-off of numbers up to 10, and rows that are met to 1e-9.
                assert!(!speaks || t + s < deadline || h > -1e-8, "case {case}, {s} s after {t} s: {h}");
            }
            q += (u[0] - push) * period;
        }
    }
    assert!(on_course > 1000, "{on_course}");
}

/// Safe but for a narrow ditch: h = 1 − 2 exp(−((q − at)/width)²), flat everywhere else.
struct Ditch {
    at: f64,
    width: f64,
}

impl<const N: usize> Barrier<N> for Ditch {
    fn value<S: Scalar>(&self, _t: S, x: &[S; N]) -> S {
        -(-((x[0] - self.at) / self.width).squared()).exp() * 2.0 + 1.0
    }
}

/// Drives at 4 to 20 m/s across ditches of a twentieth to a thousandth of a hold. Returns the samples on course, and those
/// that cross a ditch.
fn ditches_crossed<const N: usize>(source: impl Fn(Ditch) -> Box<dyn DerivativeSource>) -> [u32; 3] {
    let [mut on_course, mut crossed, mut samples] = [0; 3];
    for case in 0..120_u32 {
        let part = |of: u32| f64::from(case * of % 127) / 127.0;
        let (period, speed) = (0.01 + 0.09 * part(31), 4.0 + 16.0 * part(45));
        let at = 20.0 * period * speed + 3.0 * part(59);
        let width = period * speed * 0.05 * powf(0.02, part(71));
        let mut filter = Filter::from_sources(N, 1)
            .source("ditch", source(Ditch { at, width }), BarrierSettings::keeping())
            .and_then(|b| b.sampling(Sampling::Period(period)))
            .and_then(FilterBuilder::build)
            .expect("valid filter");
        let mut x = [0.0; N];
        x[N - 1] = if N == 1 { 0.0 } else { speed };
        for k in 0..100_u32 {
            let (wanted, mut u) = ([if N == 1 { speed } else { 0.0 }], [0.0]);
            filter.step(f64::from(k) * period, &x, &wanted, &mut u).expect("right dimensions");
            let speaks = filter.report().barriers[0].on_course;
            let from = x[0];
            x = rk4_step(&Integrator::<N>, &x, &u, period);
            let crosses = from < at && at < x[0];
            assert!(!speaks || !crosses, "case {case}: {from} to {}, {width} at {at}", x[0]);
            on_course += u32::from(speaks);
            crossed += u32::from(crosses);
            samples += 1;
        }
    }
    [on_course, crossed, samples]
}

#[test]
fn what_is_on_course_crosses_nothing_narrow() {
    let along = |ditch| lie::along(Arc::new(Integrator::<2>), ditch, 2).expect("in range");
    let [on_course, crossed, samples] = ditches_crossed::<2>(along);
    // One sample in a hundred or so is at a ditch.
    assert!(crossed > 60 && on_course * 100 > 95 * samples, "{on_course} {crossed} {samples}");
    let along = |ditch| lie::along(Arc::new(Integrator::<1>), ditch, 1).expect("in range");
    let [on_course, crossed, samples] = ditches_crossed::<1>(along);
    assert!(on_course * 100 > 95 * samples, "{on_course} {crossed} {samples}");
}

/// A double integrator with a gust on a narrow stretch: q' = u + strength exp(−((p − at)/width)²).
struct Gust {
    strength: f64,
    at: f64,
    width: f64,
}

impl ControlAffine<2, 1> for Gust {
    fn drift<S: Scalar>(&self, x: &[S; 2]) -> [S; 2] {
        let gust = (-((x[0] - self.at) / self.width).squared()).exp();
        [x[1], gust * self.strength]
    }

    fn input_map<S: Scalar>(&self, _x: &[S; 2]) -> [[S; 1]; 2] {
        [[S::zero()], [S::one()]]
    }
}

/// A gust that is narrow beside a step and drives a custom plant into a wall of ours is seen.
#[test]
fn what_is_on_course_is_not_blown_into_a_wall() {
    let [mut on_course, mut broken] = [0; 2];
    for case in 0..600_u32 {
        let part = |of: u32| f64::from(case * of % 601) / 601.0;
        let (period, speed) = (0.02 + 0.18 * part(29), 0.5 + 4.0 * part(131));
        let way = period * speed;
        let (at, width) = (way * (0.1 + 0.6 * part(57)), way * 0.1 * powf(0.05, part(211)));
        // It hurries the plant by several times its speed.
        let gust = Gust { strength: 10.0 * part(97) * speed * speed / width, at, width };
        let wall = way * (1.1 + 3.0 * part(313));
        let plant = Gust { ..gust };
        let mut filter = Filter::builder(gust)
            .barrier("wall", StateBound::at_most(0, wall).expect("valid"), BarrierSettings::keeping())
            .and_then(|b| b.sampling(Sampling::Period(period)))
            .and_then(FilterBuilder::build)
            .expect("valid filter");
        let mut u = [0.0];
        filter.step(0.0, &[0.0, speed], &[part(401) - 0.5], &mut u).expect("right dimensions");
        let (mut x, mut highest) = ([0.0, speed], 0.0_f64);
        for _ in 0..20_000 {
            x = rk4_step(&plant, &x, &u, period / 20_000.0);
            highest = highest.max(x[0]);
        }
        let speaks = filter.report().barriers[0].on_course;
        assert!(!speaks || highest <= wall + 1e-6 * way, "case {case}: {highest} of {wall}");
        on_course += u32::from(speaks);
        broken += u32::from(highest > wall);
    }
    assert!(on_course > 100 && broken > 100, "{on_course} {broken}");
}

/// A double integrator with a gust that lasts as long as a hold: q' = u − K (6.3 σ − 12 σ²) with σ the part of a hold that has
/// passed. It moves p by −K σ³ (1.05 − σ) holds², which is most before the end, and shows in no derivative at the begin.
struct Gusty {
    strength: f64,
    hold: f64,
}

impl ControlAffine<3, 1> for Gusty {
    // Said to, so that nothing narrow is looked for in between.
    const SLOW_CURVATURE: bool = true;

    fn drift<S: Scalar>(&self, x: &[S; 3]) -> [S; 3] {
        let part = x[2] / self.hold;
        [x[1], (part.squared() * 12.0 - part * 6.3) * self.strength, S::one()]
    }

    fn input_map<S: Scalar>(&self, _x: &[S; 3]) -> [[S; 1]; 3] {
        [[S::zero()], [S::one()], [S::zero()]]
    }
}

/// p ≥ 0.
struct Wall;

impl Barrier<3> for Wall {
    const ONE_SIDED_CURVATURE: bool = true;

    fn value<S: Scalar>(&self, _t: S, x: &[S; 3]) -> S {
        x[0]
    }
}

/// A gust within one hold shows where the hold ends, by what it has moved and hurried.
#[test]
fn what_a_gust_leaves_at_the_end_of_a_hold_is_looked_at() {
    let [mut on_course, mut broken] = [0; 2];
    for case in 0..500_u32 {
        let part = |of: u32| f64::from(case * of % 503) / 503.0;
        let (hold, h, speed) = (0.02 + 0.5 * part(29), 0.1 + 3.0 * part(131), part(57) - 0.5);
        let gust = Gusty { strength: 20.0 * part(211) * h / (hold * hold), hold };
        let strength = gust.strength;
        let mut filter = Filter::builder(gust)
            .barrier("wall", Wall, BarrierSettings::keeping())
            .and_then(|b| b.sampling(Sampling::Period(hold)))
            .and_then(FilterBuilder::build)
            .expect("valid filter");
        let (wanted, mut u) = (part(97) - 0.5, [0.0]);
        filter.step(0.0, &[h, speed, 0.0], &[wanted], &mut u).expect("right dimensions");
        let lowest = (0..=200)
            .map(|i| f64::from(i) / 200.0)
            .map(|part| {
                let s = part * hold;
                let moved = hold * hold * strength * part.powi(3) * (1.05 - part);
                h + s * (speed + s * u[0] / 2.0) - moved
            })
            .fold(f64::INFINITY, f64::min);
        let speaks = filter.report().barriers[0].on_course;
        // Round-off, and the error of the prediction at two steps to the hold.
        assert!(!speaks || lowest > -1e-3 * h, "case {case}: {lowest}");
        on_course += u32::from(speaks);
        broken += u32::from(lowest < 0.0);
    }
    assert!(on_course > 150 && broken > 200, "{on_course} {broken}");
}
