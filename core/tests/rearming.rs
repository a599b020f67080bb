//! Promises after an arrival and at the edges of a deadline: leaving, recovering, a deadline that is past or
//! shorter than a step, an input that acts late.

use crate::scenario;

use std::sync::Arc;

use punctual_core::barriers::DistanceDisc;
use punctual_core::convergence::{FixedTime, FixedTimeState};
use punctual_core::dynamics::rk4_step;
use punctual_core::filter::{BarrierSettings, Filter, FilterBuilder, Method, Phase, Sampling};
use punctual_core::lie;
use punctual_core::plants::Unicycle;
use punctual_reference::simulation::{Schedule, closed_loop};
use scenario::{Integrator, NonNegative, distance_disc, goal, speed_damping};

/// A gust throws the vehicle out of the disc: with a recovery time it is back within that time, each
/// time; the guarantee is given again, and the count goes up.
#[test]
fn leaving_rearms_with_the_recovery_time() {
    let recovery = 1.5;
    let settings = BarrierSettings::within(3.0).recovery(recovery).margin(0.05);
    let mut filter = goal(settings);
    let mut x = [44.0, 45.0, 0.0, 0.0];
    let (mut u, step) = ([0.0; 2], 0.01);
    for k in 0..1000_u32 {
        let t = f64::from(k) * step;
        let gusts = k / 300;
        if k % 300 == 0 && k > 0 {
            x[0] -= 6.0;
        }
        let u_ref = [-x[2], -x[3]];
        let b = filter.step(t, &x, &u_ref, &mut u).expect("right dimensions").barriers[0];
        let since = t - f64::from(300 * gusts) * step;
        // The sample that shows it outside breaks the old promise; the new one is given at the next.
        assert_eq!((b.recoveries, b.on_course), (gusts, gusts == 0 || since > 0.0), "at {t}");
        if gusts > 0 && b.phase == Phase::Approach && !b.arrived {
            assert!((b.time_left - (recovery - since)).abs() < 1e-9, "at {t}");
        }
        assert!(gusts == 0 || since < recovery || b.h >= 0.0, "h = {} at {t}", b.h);
        x = rk4_step(&punctual_core::plants::PointMass, &x, &u, step);
    }
}

/// What is reached early, and left again, has still to be there by its first deadline, however short or long the recovery is.
#[test]
fn a_recovery_time_does_not_move_the_first_deadline() {
    for recovery in [0.2, 1.5, 20.0] {
        let settings = BarrierSettings::within(3.0).recovery(recovery);
        let mut filter = goal(settings);
        let mut u = [0.0; 2];
        let mut at = |t: f64, x: f64| {
            let report = filter.step(t, &[x, 45.0, 0.0, 0.0], &[0.0; 2], &mut u).expect("right dimensions");
            let b = report.barriers[0];
            (b.phase, b.recoveries, (1e6 * b.time_left).round() / 1e6)
        };
        assert_eq!(at(0.0, 40.0), (Phase::Approach, 0, 3.0));
        assert_eq!(at(1.0, 45.0), (Phase::Stay, 0, 2.0));
        assert_eq!(at(1.5, 42.0), (Phase::Approach, 0, 1.5));
        // Once more, and then from the deadline on.
        assert_eq!(at(2.0, 45.0), (Phase::Stay, 0, 1.0));
        assert_eq!(at(2.5, 42.0), (Phase::Approach, 0, 0.5));
        assert_eq!(at(2.9, 45.0), (Phase::Stay, 0, 0.1));
        assert_eq!(at(3.5, 42.0), (Phase::Approach, 1, recovery));
    }
}

#[test]
fn without_a_recovery_time_leaving_is_reported() {
    let mut filter = goal(BarrierSettings::within(3.0));
    let mut u = [0.0; 2];
    for (t, x, phase) in [(0.0, 45.0, Phase::Stay), (0.1, 40.0, Phase::Left), (0.2, 45.0, Phase::Stay)] {
        let report = filter.step(t, &[x, 45.0, 0.0, 0.0], &[0.0; 2], &mut u).expect("right dimensions");
        let b = report.barriers[0];
        assert_eq!((b.phase, b.on_course, b.recoveries), (phase, phase == Phase::Stay, 0), "at {t}");
    }
}

#[test]
fn a_recovery_time_must_be_positive() {
    for value in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let settings = BarrierSettings::within(3.0).recovery(value);
        let refused = FixedTime::new(2, settings).expect_err("refused");
        assert_eq!(refused.to_string(), format!("recovery: is {value}, must be finite and > 0"));
    }
}

/// A deadline that is past promises nothing, says so, and is still worked towards.
#[test]
fn a_deadline_in_the_past_is_late_at_once() {
    let promise = FixedTime::new(2, BarrierSettings::within(3.0)).expect("valid");
    for deadline in [0.0, -2.0] {
        let mut state = FixedTimeState::default();
        promise.anchor(&mut state, 7.0, &[-4.0, 1.0], deadline, 0.0);
        assert!(!state.on_course);
        let demand = promise.advance(&mut state, 7.0, &[-4.0, 1.0]);
        assert_eq!((state.phase, state.on_course), (Phase::Late, false));
        assert_eq!((demand.time_left, demand.profile), (0.0, 0.0));
        // (D + a)² h ≥ 0 with a = 20/3: the target is h = 0 at once.
        let a: f64 = 20.0 / 3.0;
        assert!((demand.floor - (4.0 * a * a - 2.0 * a)).abs() < 1e-9, "{}", demand.floor);
        // Inside, with a stay constraint that holds from there, all is well again.
        promise.advance(&mut state, 8.0, &[1.0, 0.0]);
        assert_eq!((state.phase, state.on_course), (Phase::Stay, true));
    }
}

/// A deadline shorter than a step: the sampled constraint has its end beyond the deadline, so that the
/// barrier arrives at the first sample after it, whatever its relative degree, and stays.
fn short_deadline<const N: usize>(step: f64, deadline: f64) {
    let mut filter = lie::along(Arc::new(Integrator::<N>), NonNegative, N)
        .and_then(|source| {
            Filter::from_sources(N, 1).source("line", source, BarrierSettings::within(deadline))
        })
        .and_then(|b| b.sampling(Sampling::Period(step)))
        .and_then(FilterBuilder::build)
        .expect("valid filter");
    let schedule = Schedule { step, steps: 100, substeps: 1 };
    let mut x0 = [0.0; N];
    x0[0] = -3.0;
    let (mut first, mut least) = (None, 0.0_f64);
    closed_loop(
        &mut filter,
        &Integrator::<N>,
        x0,
        schedule,
        |_, _| [0.0],
        |t, x, _, r| {
            assert!(r.status.is_satisfied(), "{N}: {r:?} at {t}");
            if x[0] >= 0.0 {
                first.get_or_insert(t);
            }
            if first.is_some() {
                least = least.min(x[0]);
            }
        },
    )
    .expect("valid schedule");
    // One held input reaches h = 0 in one step at order 1; for order n it takes n of them.
    assert!(first.is_some_and(|t| t <= (N as f64 + 0.5) * step), "{N}: first inside at {first:?}");
    assert!(least >= 0.0, "{N}: {least} after the arrival");
}

#[test]
fn a_deadline_shorter_than_a_step_is_met_as_soon_as_samples_allow() {
    for (step, deadline) in [(0.05, 0.01), (0.05, 0.049), (1.0, 1e-6)] {
        short_deadline::<1>(step, deadline);
    }
}

/// Well inside at the start: the stay constraint applies from the first sample, with its guarantee.
/// Inside, but leaving fast: kept all the same, with a larger rate. The first step takes a hundredth of the deadline for the
/// period, which is too long for that rate, so the promise is given at the second.
#[test]
fn a_start_inside() {
    for (x0, at_once) in [([1.0, -1.0], true), ([1.0, -40.0], false)] {
        let mut filter = Filter::builder(Integrator::<2>)
            .barrier("line", NonNegative, BarrierSettings::within(4.0))
            .and_then(FilterBuilder::build)
            .expect("valid filter");
        let schedule = Schedule { step: 0.01, steps: 1200, substeps: 1 };
        let mut least_late = f64::INFINITY;
        closed_loop(
            &mut filter,
            &Integrator::<2>,
            x0,
            schedule,
            |_, _| [-1.0],
            |t, x, _, r| {
                let b = r.barriers[0];
                assert_eq!((b.phase, b.arrival_time), (Phase::Stay, Some(0.0)), "at {t}: {b:?}");
                assert_eq!(b.on_course, at_once || t > 0.0, "at {t}: {b:?}");
                assert!(x[0] >= 0.0, "{} at {t}", x[0]);
                if t >= 4.0 {
                    least_late = least_late.min(x[0]);
                }
            },
        )
        .expect("valid schedule");
        assert!(least_late >= 0.0, "{x0:?}: {least_late}");
    }
}

/// Another deadline on the way: the promise restarts where the plant is, never without a guarantee,
/// and is kept.
#[test]
fn a_new_deadline_on_the_way() {
    for (changed_at, deadline) in [(2.0, 3.5), (2.0, 9.0), (4.9, 2.0)] {
        let mut filter = goal(BarrierSettings::within(5.0));
        let mut x = [0.0, 0.0, 1.0, 0.0];
        let (mut u, step) = ([0.0; 2], 0.01);
        let end = changed_at + deadline;
        for k in 0..1500_u32 {
            let t = f64::from(k) * step;
            if (t - changed_at).abs() < 1e-9 {
                filter.set_deadline(0, deadline).expect("a barrier and a deadline");
            }
            let u_ref = [-x[2], -x[3]];
            let b = filter.step(t, &x, &u_ref, &mut u).expect("right dimensions").barriers[0];
            assert!(b.on_course, "at {t}: {b:?}");
            if t >= changed_at && b.phase == Phase::Approach {
                assert!((b.time_left - (end - t)).abs() < 1e-9, "at {t}");
            }
            assert!(t < end || b.h >= 0.0, "{deadline}: h = {} at {t}", b.h);
            x = rk4_step(&punctual_core::plants::PointMass, &x, &u, step);
        }
    }
    let mut filter = goal(BarrierSettings::within(5.0));
    let refused = |r: Result<(), punctual_core::Error>| r.expect_err("refused").to_string();
    assert_eq!(refused(filter.set_deadline(1, 2.0)), "barrier: is 1, must be < 1, the number of barriers");
    assert_eq!(refused(filter.set_deadline(0, -2.0)), "goal.deadline: is -2, must be finite and > 0");
}

/// A goal that is moved: inside the new one within the deadline that counts from the move.
#[test]
fn a_moved_set_on_the_way() {
    let mut filter = goal(BarrierSettings::within(5.0).margin(0.02));
    let mut x = [0.0, 0.0, 1.0, 0.0];
    let (mut u, step, moved_at) = ([0.0; 2], 0.01, 6.0);
    for k in 0..1500_u32 {
        let t = f64::from(k) * step;
        if (t - moved_at).abs() < 1e-9 {
            let disc = DistanceDisc::new([20.0, 60.0], 2.0, 2.0).expect("valid disc");
            let source = lie::along(Arc::new(punctual_core::plants::PointMass), disc, 2).expect("in range");
            filter.set_source(0, source).expect("the same dimensions");
        }
        let u_ref = [-x[2], -x[3]];
        let b = filter.step(t, &x, &u_ref, &mut u).expect("right dimensions").barriers[0];
        assert!(b.on_course, "at {t}: {b:?}");
        let promised = (5.0..moved_at - 1e-9).contains(&t) || t >= moved_at + 5.0;
        assert!(!promised || b.h >= 0.0, "h = {} at {t}", b.h);
        x = rk4_step(&punctual_core::plants::PointMass, &x, &u, step);
    }
    let other = lie::along(Arc::new(Integrator::<2>), NonNegative, 2).expect("in range");
    let refused = filter.set_source(0, other).expect_err("refused");
    assert_eq!(refused.to_string(), "goal.x: has 2 components, must have 4");
    let other = lie::along(Arc::new(punctual_core::plants::PointMass), distance_disc(), 1).expect("in range");
    let refused = filter.set_source(0, other).expect_err("refused");
    assert_eq!(refused.to_string(), "goal.relative_degree: is 1, must stay 2");
}

/// The repeated root from rest at odd order: the report has the fallback, the filter the reason.
#[test]
fn a_method_that_fails_at_the_anchor_is_reported() {
    let settings = BarrierSettings::within(4.0).method(Method::RepeatedRoot);
    let mut filter = Filter::builder(Integrator::<3>)
        .barrier("line", NonNegative, settings)
        .and_then(FilterBuilder::build)
        .expect("valid filter");
    assert_eq!(filter.refusal(0), None);
    let report = filter.step(0.0, &[-3.0, 0.0, 0.0], &[0.0], &mut [0.0]).expect("right dimensions");
    assert!(report.barriers[0].fallback && !report.barriers[0].on_course);
    let reason = filter.refusal(0).expect("no rate from rest");
    let wanted = "no admissible rate: the polynomial of the repeated root has no real root for any deadline";
    assert_eq!(reason.to_string(), wanted);
    assert_eq!(filter.refusal(1), None);
}

/// Some steps of delay, one of them under a master that exchanges first: arrival and least h after the deadline, and the
/// number of steps whose constraint could not be met.
fn late(steps: f64, step: f64, x0: [f64; 4]) -> (Option<f64>, f64, usize) {
    let settings = BarrierSettings::within(5.0).rate(5.0).stay_rate(5.0).margin(0.02);
    let mut filter = Filter::builder(Unicycle)
        .barrier("goal", distance_disc(), settings)
        .and_then(|b| b.sampling(Sampling::Period(step)))
        .and_then(|b| b.actuation_delay(steps * step))
        .and_then(FilterBuilder::build)
        .expect("valid filter");
    // Inputs that wait, the next one last; the part of a step before another acts.
    let (mut x, mut waiting) = (x0, vec![[0.0; 2]; steps.ceil() as usize]);
    let part = steps - (steps - 1.0).ceil();
    let (mut arrival, mut least, mut unmet) = (None, f64::INFINITY, 0);
    for k in 0..=(10.0 / step).round() as usize {
        let t = k as f64 * step;
        let mut u = [0.0; 2];
        let u_ref = speed_damping(t, &x);
        let report = filter.step(t, &x, &u_ref, &mut u).expect("right dimensions");
        let h = report.barriers[0].h;
        if h >= 0.0 && arrival.is_none() {
            arrival = Some(t);
        }
        if t > 5.0 - step / 2.0 {
            least = least.min(h);
        }
        unmet += usize::from(!report.status.is_satisfied());
        waiting.insert(0, u);
        let acting = waiting.pop().expect("an input");
        x = rk4_step(&Unicycle, &x, &acting, part * step);
        x = rk4_step(&Unicycle, &x, waiting.last().expect("an input"), (1.0 - part) * step);
    }
    (arrival, least, unmet)
}

#[test]
fn a_delay_is_compensated() {
    for x0 in [[5.0, 5.0, 0.3, 2.0], [12.0, 3.0, -2.0, 6.0], [0.0, 18.0, 2.2, -7.0]] {
        for (steps, step) in [(1.0, 0.01), (1.0, 0.05), (0.4, 0.05), (2.0, 0.05), (7.3, 0.02)] {
            let (arrival, least, unmet) = late(steps, step, x0);
            assert!(arrival.is_some_and(|t| t <= 5.0), "{x0:?}, {steps}, {step}: {arrival:?}");
            assert!(least >= 0.0, "{x0:?}, {steps}, {step}: {least}");
            assert_eq!(unmet, 0, "{x0:?}, {steps}, {step}");
        }
    }
}

/// h is of now, the rest of the time at which the input acts; the deadline counts from the first sample.
#[test]
fn a_delayed_report_names_its_times() {
    let mut filter = Filter::from_sources(2, 1)
        .source(
            "line",
            lie::along(Arc::new(Integrator::<2>), NonNegative, 2).expect("in range"),
            BarrierSettings::within(4.0),
        )
        .and_then(|b| b.actuation_delay(0.5))
        .and_then(FilterBuilder::build)
        .expect("valid filter");
    let mut u = [0.0];
    let report = filter.step(1.0, &[-3.0, 2.0], &[0.0], &mut u).expect("right dimensions");
    let b = report.barriers[0];
    assert_eq!((b.h, b.time_left), (-3.0, 3.5));
    // Where it will be: −3 + 2 · 0.5.
    assert!((b.profile + 2.0).abs() < 1e-12, "{}", b.profile);
    assert_eq!(filter.state().barriers[0].anchor_time, 1.5);
}

#[test]
fn a_delay_is_checked() {
    let builder = || Filter::builder(Unicycle);
    let settings = BarrierSettings::within(4.0);
    for value in [-0.1, f64::NAN, f64::INFINITY] {
        let refused = builder().actuation_delay(value).err().expect("refused");
        assert_eq!(refused.to_string(), format!("actuation_delay: is {value}, must be finite and >= 0"));
    }
    let refused = builder()
        .barrier("goal", distance_disc(), settings)
        .and_then(|b| b.sampling(Sampling::Period(0.01)))
        .and_then(|b| b.actuation_delay(2.51))
        .and_then(FilterBuilder::build)
        .err()
        .expect("refused");
    assert_eq!(refused.to_string(), "actuation_delay: is 2.51, must be <= 250 times sampling_period = 0.01");
    // No input acts before the deadline.
    let mut filter = builder()
        .barrier("goal", distance_disc(), settings)
        .and_then(|b| b.actuation_delay(1.0))
        .and_then(FilterBuilder::build)
        .expect("valid filter");
    let refused = filter.set_deadline(0, 1.0).expect_err("refused");
    assert_eq!(
        refused.to_string(),
        "goal.deadline: is 1, must be > actuation_delay = 1: no input acts before"
    );
}
