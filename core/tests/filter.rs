//! The filter as a whole: phases, anchoring, promises along runs, snapshots, statuses.

use crate::scenario;

use std::sync::Arc;

use proptest::prelude::*;
use punctual_core::barrier::Barrier;
use punctual_core::convergence::FixedTimeState;
use punctual_core::dynamics::ControlAffine;
use punctual_core::filter::{
    BarrierSettings, Filter, FilterBuilder, FilterState, Method, Phase, Sampling, Status,
};
use punctual_core::lie;
use punctual_core::plants::{PointMass, Unicycle};
use punctual_core::qp::Solver;
use punctual_reference::simulation::{Schedule, closed_loop};
use scenario::{Integrator, NonNegative, damping, distance_disc, goal, one, quadratic_disc, speed_damping};

/// One step; returns the input with the report's status.
fn step(filter: &mut Filter, t: f64, x: &[f64]) -> ([f64; 2], Status) {
    let mut u = [f64::NAN; 2];
    let status = filter.step(t, x, &[0.0; 2], &mut u).expect("right dimensions").status;
    (u, status)
}

/// A filter without regard to how long inputs are held.
fn pointwise<P, B>(plant: P, barrier: B, settings: BarrierSettings) -> Filter
where
    P: ControlAffine<4, 2> + Send + Sync + 'static,
    B: Barrier<4> + Send + 'static,
{
    Filter::builder(plant)
        .barrier("goal", barrier, settings)
        .and_then(|b| b.sampling(Sampling::Pointwise))
        .and_then(FilterBuilder::build)
        .expect("valid filter")
}

#[test]
fn phases_follow_one_another() {
    let mut filter = goal(BarrierSettings::within(5.0));
    assert_eq!(filter.state().barriers[0].phase, Phase::Waiting);
    let mut phases = vec![Phase::Waiting];
    let schedule = Schedule { step: 0.01, steps: 1000, substeps: 1 };
    let mut arrival = None;
    closed_loop(&mut filter, &PointMass, [40.0, 38.0, 0.0, 0.0], schedule, damping, |t, _, _, report| {
        let b = &report.barriers[0];
        if phases.last() != Some(&b.phase) {
            phases.push(b.phase);
        }
        if b.h >= 0.0 && arrival.is_none() {
            arrival = Some(t);
        }
        assert_eq!((b.arrived, b.arrival_time), (arrival.is_some(), arrival), "at {t}");
        assert_eq!(b.time_left, (5.0 - t).max(0.0), "at {t}");
        assert!(b.on_course, "at {t}");
    })
    .expect("valid schedule");
    assert_eq!(phases, [Phase::Waiting, Phase::Approach, Phase::Stay]);
}

/// A vehicle that cannot move as told: the deadline passes outside, then it is put inside, then outside.
#[test]
fn late_stay_left_and_back() {
    let mut filter = pointwise(PointMass, distance_disc(), BarrierSettings::within(1.0));
    let outside = [0.0, 0.0, 0.0, 0.0];
    let inside = [45.0, 44.5, 0.0, 0.0];
    let phase = |filter: &mut Filter, t: f64, x: &[f64; 4]| {
        step(filter, t, x);
        let b = filter.report().barriers[0];
        (b.phase, b.on_course, b.arrival_time)
    };
    assert_eq!(phase(&mut filter, 3.0, &outside), (Phase::Approach, true, None));
    // Where the profile asked it to be it is not, and no time is left to restart.
    assert_eq!(phase(&mut filter, 3.999, &outside), (Phase::Approach, false, None));
    assert_eq!(phase(&mut filter, 4.0, &outside), (Phase::Late, false, None));
    assert_eq!(phase(&mut filter, 4.5, &outside), (Phase::Late, false, None));
    assert_eq!(phase(&mut filter, 5.0, &inside), (Phase::Stay, true, Some(5.0)));
    assert_eq!(phase(&mut filter, 5.5, &outside), (Phase::Left, false, Some(5.0)));
    assert_eq!(phase(&mut filter, 6.0, &outside), (Phase::Left, false, Some(5.0)));
    assert_eq!(phase(&mut filter, 6.5, &inside), (Phase::Stay, true, Some(5.0)));
    filter.rearm();
    assert_eq!(filter.state().barriers[0].phase, Phase::Waiting);
    assert_eq!(phase(&mut filter, 7.0, &outside), (Phase::Approach, true, None));
    assert_eq!(filter.report().barriers[0].time_left, 1.0);
}

#[test]
fn a_start_inside_stays() {
    for settings in [BarrierSettings::within(5.0), BarrierSettings::within(5.0).method(Method::RepeatedRoot)]
    {
        let mut filter = goal(settings);
        let x0 = [44.0, 45.5, 0.25, 0.0];
        let schedule = Schedule { step: 0.01, steps: 800, substeps: 1 };
        closed_loop(&mut filter, &PointMass, x0, schedule, damping, |t, _, _, report| {
            let b = &report.barriers[0];
            assert_eq!((b.phase, b.arrival_time, b.on_course), (Phase::Stay, Some(0.0), true), "at {t}");
            assert!(b.h >= 0.0, "h = {} at {t}", b.h);
        })
        .expect("valid schedule");
    }
}

/// Just inside but leaving faster than samples can follow: to be kept, without a promise.
#[test]
fn a_start_inside_that_cannot_stay_is_not_promised() {
    let mut filter = goal(BarrierSettings::within(5.0));
    step(&mut filter, 0.0, &[43.01, 45.0, -30.0, 0.0]);
    let b = filter.report().barriers[0];
    assert_eq!((b.phase, b.arrived, b.on_course), (Phase::Stay, true, false));
}

#[test]
fn anchoring_waits_for_the_first_valid_sample() {
    let mut filter = Filter::builder(PointMass)
        .barrier("goal", distance_disc(), BarrierSettings::within(5.0))
        .and_then(|b| b.bounds(&[1.0, -60.0], &[60.0, 60.0]))
        .and_then(FilterBuilder::build)
        .expect("valid filter");
    let good = [0.0, 0.0, 1.0, 0.0];
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for place in 0..7 {
            let (mut t, mut x, mut u_ref) = (0.5, good, [0.0; 2]);
            match place {
                0 => t = bad,
                1..=4 => x[place - 1] = bad,
                _ => u_ref[place - 5] = bad,
            }
            let mut u = [f64::NAN; 2];
            let report = filter.step(t, &x, &u_ref, &mut u).expect("right dimensions");
            assert_eq!(report.status, Status::InvalidInput, "{bad} at {place}");
            assert_eq!(report.barriers[0].phase, Phase::Waiting);
            // The admissible input nearest 0.
            assert_eq!(u, [1.0, 0.0], "{bad} at {place}");
            assert_eq!(
                *filter.state(),
                FilterState { barriers: vec![Default::default()], ..Default::default() }
            );
        }
    }
    step(&mut filter, 17.0, &good);
    let state = filter.state().barriers[0];
    assert_eq!((state.phase, state.anchor_time), (Phase::Approach, 17.0));
    assert_eq!(filter.report().barriers[0].time_left, 5.0);
    // A sample that is lost later takes the guarantee with it and changes nothing else; a state above
    // the profile, from which the lemma starts again, brings it back.
    step(&mut filter, 17.1, &[f64::NAN; 4]);
    assert_eq!(filter.state().barriers[0], FixedTimeState { on_course: false, ..state });
    assert!(!filter.report().barriers[0].on_course);
    step(&mut filter, 17.2, &[20.0, 20.0, 1.0, 0.0]);
    assert!(filter.report().barriers[0].on_course);
}

#[test]
fn the_margin_is_reached_by_the_deadline_and_kept() {
    /// Mδ/a² for the default rate a = 4/s, δ = 1 ms and |d/dt (D + a)² e| ≤ M = 80 m/s³ near the disc.
    const SAMPLING: f64 = 80.0 * 1e-3 / (4.0 * 4.0);
    let margin = 0.25;
    let mut filter = goal(BarrierSettings::within(5.0).margin(margin));
    let schedule = Schedule { step: 1e-3, steps: 10_000, substeps: 1 };
    let x0 = [10.0, 20.0, 3.0, -2.0];
    closed_loop(&mut filter, &PointMass, x0, schedule, damping, |t, _, _, report| {
        let b = &report.barriers[0];
        if t >= 5.0 {
            assert!(b.h >= margin - SAMPLING, "h = {} at {t}", b.h);
            // The first step does not know the period yet and takes a hundredth of the deadline for it.
            // What rounding takes from the margin in force is given back by and by.
            assert!(
                (b.profile - b.margin).abs() < 1e-5 && (0.0..1e-3).contains(&(b.margin - margin)),
                "{b:?}"
            );
        }
    })
    .expect("valid schedule");
}

/// h ≥ profile − Mδ/a² (`docs/theory.md#pointwise`): (D + a)² e falls from ≥ 0 to at least −Mδ while the input
/// is held, and Mδ is seen at the next sample as the slack of its row at the input that was held.
fn follows_its_profile<P>(plant: &P, damping: fn(f64, &[f64; 4]) -> [f64; 2], step: f64, x0: [f64; 4])
where
    P: ControlAffine<4, 2> + Send + Sync + Clone + 'static,
{
    /// The slack is seen at the ends of the periods; within one it may dip a little lower.
    const WITHIN_THE_PERIOD: f64 = 1.1;
    let settings = BarrierSettings::within(5.0).rate(5.0).stay_rate(5.0);
    let mut filter = pointwise(plant.clone(), distance_disc(), settings);
    let (mut deficit, mut held, mut compared) = (0.0_f64, None, 0);
    let schedule = Schedule { step, steps: (5.0 / step) as usize, substeps: 4 };
    closed_loop(&mut filter, plant, x0, schedule, damping, |t, _, u, report| {
        let b = &report.barriers[0];
        assert!(report.status.is_satisfied(), "{:?} at {t}", report.status);
        if b.phase != Phase::Approach {
            held = None;
            return;
        }
        if let Some(held) = held {
            let held: [f64; 2] = held;
            deficit = deficit.max(-b.row.slack(&held));
            compared += 1;
        }
        let allowed = WITHIN_THE_PERIOD * deficit / (5.0 * 5.0) + 1e-12 * (b.h.abs() + 1.0);
        assert!(b.h >= b.profile - allowed, "t {t}: h {} profile {} allowed {allowed:e}", b.h, b.profile);
        held = Some(*u);
    })
    .expect("valid schedule");
    assert!(compared > 10, "the approach was not exercised");
}

#[test]
fn h_follows_its_profile_up_to_the_sampling_error() {
    for step in [1e-3, 1e-2] {
        follows_its_profile(&PointMass, damping, step, [0.0, 0.0, 0.0, 0.0]);
        follows_its_profile(&PointMass, damping, step, [12.0, 3.0, -9.0, 4.0]);
        follows_its_profile(&Unicycle, speed_damping, step, [0.0, 0.0, 0.5, 4.0]);
        follows_its_profile(&Unicycle, speed_damping, step, [18.0, 2.0, 0.75, -6.0]);
    }
}

#[test]
fn the_arrival_of_a_bounded_one_dimensional_run_is_on_time() {
    // ẋ₁ = x₂, ẋ₂ = u, h = x₁ from −1: n = 2 by hand, through `source`.
    let source = lie::along(Arc::new(Integrator::<2>), NonNegative, 2).expect("in range");
    let settings = BarrierSettings::within(5.0).margin(0.05).rate(3.0).stay_rate(3.0);
    let mut filter = Filter::from_sources(2, 1)
        .source("line", source, settings)
        .and_then(|b| b.bounds(&[-1.0], &[1.0]))
        .and_then(FilterBuilder::build)
        .expect("valid filter");
    let schedule = Schedule { step: 0.01, steps: 1000, substeps: 1 };
    closed_loop(
        &mut filter,
        &Integrator::<2>,
        [-1.0, 0.0],
        schedule,
        |_, _| [0.0],
        |t, _, u, r| {
            assert!(u[0].abs() <= 1.0 && r.status.is_satisfied(), "{u:?} {:?} at {t}", r.status);
            assert!(t < 5.0 || r.barriers[0].h >= 0.0, "h = {} at {t}", r.barriers[0].h);
        },
    )
    .expect("valid schedule");
}

#[test]
fn peek_answers_as_step_does_and_remembers_nothing() {
    let mut filter = goal(BarrierSettings::within(5.0));
    let (x, mut seen, mut done) = ([1.0, 2.0, 3.0, 4.0], [0.0; 2], [0.0; 2]);
    for t in [0.0, 0.1, 4.0, 6.0] {
        let before = filter.state().clone();
        let peeked = filter.peek(t, &x, &[0.5, 0.5], &mut seen).expect("right dimensions").clone();
        assert_eq!(*filter.state(), before, "peek at {t}");
        let stepped = filter.step(t, &x, &[0.5, 0.5], &mut done).expect("right dimensions").clone();
        assert_eq!((peeked, seen), (stepped, done), "at {t}");
        assert_ne!(*filter.state(), FilterState::default());
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(64) })]

    /// A filter built alike and given the state goes on with the same bits as one never interrupted.
    #[test]
    fn restored_equals_uninterrupted(
        interrupt in 0..40_usize,
        x0 in prop::array::uniform4(-20.0..40.0_f64),
        repeated_root in any::<bool>(),
    ) {
        let method = if repeated_root { Method::RepeatedRoot } else { Method::ReferenceProfile };
        let settings = BarrierSettings::within(1.0).method(method).margin(0.1);
        let build = || one(PointMass, quadratic_disc(), settings);
        let (mut whole, mut first, mut second) = (build(), build(), build());
        // Something else first: nothing of it may survive `restore`.
        step(&mut second, 0.7, &[45.0, 45.0, 1.0, 1.0]);
        let mut x = x0;
        for k in 0..80 {
            let t = k as f64 * 0.05;
            let (wanted, status) = step(&mut whole, t, &x);
            let other = if k < interrupt {
                &mut first
            } else {
                if k == interrupt {
                    second.restore(first.state()).expect("as many barriers");
                }
                &mut second
            };
            let (u, other_status) = step(other, t, &x);
            prop_assert_eq!(u.map(f64::to_bits), wanted.map(f64::to_bits), "at {}", t);
            prop_assert_eq!(status, other_status);
            prop_assert_eq!(whole.report(), other.report());
            x = punctual_core::dynamics::rk4_step(&PointMass, &x, &u, 0.05);
        }
    }

    /// Whatever finite state, time and reference come, u is finite and within bounds.
    #[test]
    fn the_output_is_always_finite_and_within_bounds(
        samples in prop::collection::vec((any::<f64>(), prop::array::uniform4(any::<f64>()), prop::array::uniform2(any::<f64>())), 1..6),
        bounded in any::<bool>(),
    ) {
        let mut builder = Filter::builder(Unicycle)
            .barrier("goal", distance_disc(), BarrierSettings::within(5.0)).expect("valid settings");
        let high = if bounded { [60.0, 20.0] } else { [f64::INFINITY; 2] };
        builder = builder.bounds(&high.map(|v| -v), &high).expect("valid bounds");
        let mut filter = builder.build().expect("valid filter");
        for (t, x, u_ref) in samples {
            let mut u = [f64::NAN; 2];
            let report = filter.step(t, &x, &u_ref, &mut u).expect("right dimensions");
            prop_assert!(u.iter().zip(high).all(|(v, m)| v.is_finite() && v.abs() <= m), "{u:?} {report:?}");
        }
    }
}

#[test]
fn two_barriers_are_both_met() {
    let mut filter = Filter::builder(PointMass)
        .barrier("goal", distance_disc(), BarrierSettings::within(5.0).margin(0.05))
        .and_then(|b| {
            b.source("line", lie::along(Arc::new(PointMass), NonNegative, 2)?, BarrierSettings::within(2.0))
        })
        .and_then(FilterBuilder::build)
        .expect("valid filter");
    assert_eq!(filter.barrier_names().collect::<Vec<_>>(), ["goal", "line"]);
    assert_eq!(filter.relative_degrees().collect::<Vec<_>>(), [2, 2]);
    let schedule = Schedule { step: 0.01, steps: 1000, substeps: 1 };
    let mut solved = 0;
    closed_loop(&mut filter, &PointMass, [-6.0, 20.0, 0.0, 0.0], schedule, damping, |t, _, _, report| {
        assert!(report.status.is_satisfied(), "{:?} at {t}", report.status);
        solved += u32::from(report.solver != Solver::Unchanged);
        assert_eq!(report.solver == Solver::DualActiveSet, report.iterations > 0, "at {t}");
        // The second barrier has no margin: it may be missed by the sampling error, below a centimetre.
        assert!(t < 2.0 || report.barriers[1].h >= -0.01, "line {} at {t}", report.barriers[1].h);
        assert!(t < 5.0 || report.barriers[0].h >= 0.0, "goal {} at {t}", report.barriers[0].h);
    })
    .expect("valid schedule");
    assert!(solved > 100, "{solved} steps");
}

#[test]
fn bounds_that_forbid_the_row_are_infeasible_and_void_the_guarantee() {
    let mut filter = Filter::builder(PointMass)
        .barrier("goal", distance_disc(), BarrierSettings::within(0.5))
        .and_then(|b| b.bounds(&[-1.0, -2.0], &[1.0, 2.0]))
        .and_then(FilterBuilder::build)
        .expect("valid filter");
    let (u, status) = step(&mut filter, 0.0, &[0.0; 4]);
    // Both components of the row are positive: the corner nearest the goal.
    assert_eq!((u, status), ([1.0, 2.0], Status::Infeasible));
    let b = filter.report().barriers[0];
    assert!(!b.on_course && b.slack < 0.0 && !status.is_satisfied());
    // A guarantee that is lost stays lost until the stay constraint gives another.
    let (_, status) = step(&mut filter, 0.01, &[44.9, 45.0, 0.0, 0.0]);
    assert!(status.is_satisfied());
    assert_eq!(
        (filter.report().barriers[0].phase, filter.report().barriers[0].on_course),
        (Phase::Stay, true)
    );
}

#[test]
fn the_centre_of_the_quadratic_disc_is_ill_conditioned() {
    // Moving through the centre: the row is exactly 0. So fast, staying asks for a positive ḧ.
    let mut filter = goal_quadratic(2.0);
    let (u, status) = step(&mut filter, 0.0, &[45.0, 45.0, 300.0, 0.0]);
    assert_eq!((u, status), ([0.0, 0.0], Status::NoAuthority));
    assert!(!filter.report().barriers[0].on_course);
    // Slower, nothing is about to be left, and nothing is asked for.
    let mut filter = goal_quadratic(2.0);
    let (u, status) = step(&mut filter, 0.0, &[45.0, 45.0, 10.0, 0.0]);
    assert_eq!((u, status), ([0.0, 0.0], Status::Unchanged));
    assert!(filter.report().barriers[0].on_course);
    // At rest there it asks for nothing.
    let mut filter = goal_quadratic(2.0);
    let (u, status) = step(&mut filter, 0.0, &[45.0, 45.0, 0.0, 0.0]);
    assert_eq!((u, status), ([0.0, 0.0], Status::Unchanged));
}

fn goal_quadratic(deadline: f64) -> Filter {
    pointwise(PointMass, quadratic_disc(), BarrierSettings::within(deadline))
}

/// One barrier without finite derivatives stops the step: no other barrier is anchored by it.
#[test]
fn a_singular_barrier_anchors_none() {
    let mut filter = Filter::builder(PointMass)
        .barrier("line", NonNegative, BarrierSettings::within(2.0))
        .and_then(|b| b.barrier("goal", distance_disc(), BarrierSettings::within(2.0)))
        .and_then(FilterBuilder::build)
        .expect("valid filter");
    let (_, status) = step(&mut filter, 0.0, &[1e200, 0.0, 0.0, 0.0]);
    assert_eq!(status, Status::Singular);
    assert_eq!(filter.report().barriers[0].phase, Phase::Waiting);
    assert!(filter.state().barriers.iter().all(|b| b.phase == Phase::Waiting));
    // The deadline has begun to count all the same: the state was valid.
    let (_, status) = step(&mut filter, 0.5, &[1.0, 0.0, 0.0, 0.0]);
    let goal = filter.report().barriers[1];
    assert_eq!((status.is_satisfied(), goal.phase, goal.time_left), (true, Phase::Approach, 1.5));
    // After its end nothing is promised.
    filter.rearm();
    let _ = step(&mut filter, 0.0, &[1e200, 0.0, 0.0, 0.0]);
    let _ = step(&mut filter, 2.5, &[1.0, 0.0, 0.0, 0.0]);
    let goal = filter.report().barriers[1];
    assert_eq!((goal.phase, goal.on_course), (Phase::Late, false));
    // It does not while a state is not a number, nor with a peek.
    filter.rearm();
    let _ = step(&mut filter, 0.0, &[f64::NAN, 0.0, 0.0, 0.0]);
    let _ = filter.peek(0.1, &[1e200, 0.0, 0.0, 0.0], &[0.0; 2], &mut [0.0; 2]);
    let _ = step(&mut filter, 1.0, &[1.0, 0.0, 0.0, 0.0]);
    assert_eq!(filter.report().barriers[1].time_left, 2.0);
}

#[test]
fn derivatives_that_are_not_finite_are_singular() {
    // (1e200)² overflows.
    let mut filter = goal(BarrierSettings::within(5.0));
    let (u, status) = step(&mut filter, 0.0, &[1e200, 0.0, 0.0, 0.0]);
    assert_eq!((u, status), ([0.0, 0.0], Status::Singular));
    assert_eq!(filter.state().barriers[0].phase, Phase::Waiting);
}

/// What is observed of the input that a step returned is what the step reports; of another one, what its rows say.
#[test]
fn a_sample_is_observed() {
    let filter = || pointwise(Unicycle, distance_disc(), BarrierSettings::within(12.0));
    let [mut stepped, mut observed] = [filter(), filter()];
    let mut x = [0.0, 0.0, 0.3, 1.0];
    for k in 0..1500 {
        let t = 0.01 * f64::from(k);
        let mut u = [0.0; 2];
        let report = stepped.step(t, &x, &[0.0; 2], &mut u).expect("the lengths").clone();
        let seen = observed.observe(t, &x, &u).expect("the lengths").clone();
        assert_eq!(report.barriers, seen.barriers, "at {t}");
        assert_eq!(
            (stepped.state().input, &stepped.state().barriers),
            (observed.state().input, &observed.state().barriers)
        );
        x = punctual_core::dynamics::rk4_step(&Unicycle, &x, &u, 0.01);
    }
    assert_eq!(observed.state().barriers[0].phase, Phase::Stay);
    let mut waiting = filter();
    let away = waiting.observe(0.0, &[0.0, 0.0, 3.1, 2.0], &[3.0, 0.0]).expect("the lengths").clone();
    assert_eq!((away.status, away.barriers[0].on_course), (Status::Infeasible, false));
    let invalid = waiting.observe(0.01, &[f64::NAN; 4], &[1.0, 2.0]).expect("the lengths").status;
    assert_eq!((invalid, waiting.state().input[..2].to_vec()), (Status::InvalidInput, vec![1.0, 2.0]));
}
