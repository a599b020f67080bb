//! A filter with a backup plan keeps what it has promised, whatever u_ref is; judged by an integrator of its own.

#![expect(clippy::print_stdout, reason = "the figures of tests/nightly")]

use crate::scenario;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use punctual_core::barrier::Barrier;
use punctual_core::barriers::{DistanceDisc, Outside, QuadraticDisc, StateBound};
use punctual_core::dynamics::{ControlAffine, rk4_step};
use punctual_core::filter::{
    AssuranceStatus, BarrierSettings, Begin, Driver, End, Filter, FilterBuilder, FilterState, Infeasible,
    Integration, Phase, Plans, SampleDerivative, Sampling, Status,
};
use punctual_core::lie::{Direction, along};
use punctual_core::plan::Failure;
use punctual_core::plants::{Bicycle, MovedPoint, PointMass, SmallSlipBicycle, Unicycle};
use punctual_core::scalar::Scalar;
use scenario::{Integrator, NonNegative};

const PERIOD: f64 = 0.02;
const GOAL: ([f64; 2], f64) = ([20.0, 12.0], 2.0);
const OBSTACLE: ([f64; 2], f64) = ([10.0, 7.5], 2.0);

/// How often something is drawn: `few` times, or `many` where there is time for tables.
fn draws(few: u64, many: u64) -> u64 {
    if std::env::var_os("PUNCTUAL_TABLES").is_some() { many } else { few }
}

/// Numbers that are the same on every machine.
struct Random(u64);

impl Random {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        low + (high - low) * (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Vehicle {
    PointMass,
    Unicycle,
}

impl Vehicle {
    fn rate(self, x: [f64; 4], u: [f64; 2]) -> [f64; 4] {
        match self {
            Self::PointMass => [x[2], x[3], u[0], u[1]],
            Self::Unicycle => [x[3] * x[2].cos(), x[3] * x[2].sin(), u[1], u[0]],
        }
    }

    fn move_by(self, x: [f64; 4], u: [f64; 2], dt: f64) -> [f64; 4] {
        let at = |k: [f64; 4], s: f64| std::array::from_fn(|i| x[i] + s * k[i]);
        let a = self.rate(x, u);
        let b = self.rate(at(a, dt / 2.0), u);
        let c = self.rate(at(b, dt / 2.0), u);
        let d = self.rate(at(c, dt), u);
        std::array::from_fn(|i| x[i] + dt / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]))
    }

    /// A filter in the making, with the set `goal`, and `clear` if it is there.
    fn sets(
        self,
        goal: (DistanceDisc, BarrierSettings),
        clear: Option<(Outside<DistanceDisc>, BarrierSettings)>,
    ) -> Result<FilterBuilder, punctual_core::Error> {
        macro_rules! along {
            ($plant:expr) => {{
                let builder = Filter::builder($plant).barrier("goal", goal.0, goal.1)?;
                Ok(match clear {
                    Some((clear, settings)) => builder.barrier("clear", clear, settings)?.erased(),
                    None => builder.erased(),
                })
            }};
        }
        match self {
            Self::PointMass => along!(PointMass),
            Self::Unicycle => along!(Unicycle),
        }
    }

    fn filter(self, deadline: f64, bounds: [f64; 2]) -> Filter {
        self.filter_of(deadline, bounds, (true, Sampling::Period(PERIOD)))
    }

    /// With the goal, and the obstacle if it `is_beside`.
    fn filter_of(self, deadline: f64, bounds: [f64; 2], (is_beside, sampling): (bool, Sampling)) -> Filter {
        let disc = |(centre, radius)| DistanceDisc::new(centre, radius, 1.0).expect("valid disc");
        let (goal, clear) = (disc(GOAL), Outside(disc(OBSTACLE)));
        // Without the obstacle the goal is kept with a rate that is not chosen on the way.
        let stay_rate = (!is_beside).then_some(1.0);
        let within = BarrierSettings::within(deadline).margin(0.01).stay_rate(stay_rate);
        let keeping = BarrierSettings::keeping().margin(0.01);
        self.sets((goal, within), is_beside.then_some((clear, keeping)))
            .and_then(|b| b.bounds(&bounds.map(|b| -b), &bounds))
            .and_then(|b| b.sampling(sampling))
            .and_then(FilterBuilder::build)
            .expect("valid filter")
    }

    fn assured(self, deadline: f64, bounds: [f64; 2]) -> Filter {
        self.filter(deadline, bounds).with_plans(PERIOD).expect("a filter that can be assured")
    }
}

/// The wanted input number `kind`: none, damping, outwards, to the obstacle, at random.
fn wanted(vehicle: Vehicle, kind: u64, x: [f64; 4], bounds: [f64; 2], random: &mut Random) -> [f64; 2] {
    let to = |c: [f64; 2]| [c[0] - x[0], c[1] - x[1]];
    match (kind, vehicle) {
        (0, _) => [0.0; 2],
        (1, Vehicle::PointMass) => [-x[2], -x[3]],
        (1, Vehicle::Unicycle) => [-x[3], 0.0],
        (2, Vehicle::PointMass) => to(GOAL.0).map(|d| -d),
        (2, Vehicle::Unicycle) => [3.0 * bounds[0], 0.3 * bounds[1]],
        (3, Vehicle::PointMass) => to(OBSTACLE.0),
        (3, Vehicle::Unicycle) => {
            let [dx, dy] = to(OBSTACLE.0);
            [bounds[0], 4.0 * (dy.atan2(dx) - x[2]).sin()]
        }
        _ => bounds.map(|b| random.between(-b, b)),
    }
}

#[test]
fn what_is_promised_is_kept_whatever_is_wanted() {
    let seeds = draws(40, 4000);
    let (mut accepted, mut plans) = ([0; 2], 0_u64);
    for seed in 1..=seeds {
        let random = &mut Random(0x9e37_79b9_7f4a_7c15_u64.wrapping_mul(seed));
        let vehicle = if seed % 2 == 0 { Vehicle::PointMass } else { Vehicle::Unicycle };
        let deadline = random.between(3.0, 9.0);
        let bounds = match vehicle {
            Vehicle::PointMass => [random.between(2.0, 12.0); 2],
            Vehicle::Unicycle => [random.between(2.0, 12.0), random.between(0.8, 3.0)],
        };
        let mut x = [random.between(-4.0, 4.0), random.between(-4.0, 4.0), 0.0, random.between(-4.0, 4.0)];
        x[2] = random.between(-3.0, 3.0);
        let mut filter = vehicle.assured(deadline, bounds);
        for k in 0..((deadline + 4.0) / PERIOD) as usize {
            let t = k as f64 * PERIOD;
            let u_ref = wanted(vehicle, seed % 5, x, bounds, random);
            let mut u = [0.0; 2];
            let assurance =
                filter.step(t, &x, &u_ref, &mut u).expect("right dimensions").assurance.expect("plans");
            if k == 0 {
                if !assurance.is_assured() {
                    assert!(
                        assurance.status == AssuranceStatus::Refused && assurance.failure.is_some(),
                        "{assurance:?}"
                    );
                    break;
                }
                accepted[(seed % 2) as usize] += 1;
            }
            assert!(assurance.is_assured(), "{seed} at {t}: {assurance:?}");
            assert!(u.iter().zip(bounds).all(|(u, b)| u.abs() <= b), "{seed} at {t}: {u:?}");
            plans += u64::from(assurance.driver == Driver::Plan);
            // Ten instants of the hold, each with the distances themselves.
            for part in 1..=10 {
                x = vehicle.move_by(x, u, PERIOD / 10.0);
                let t = t + PERIOD * f64::from(part) / 10.0;
                let distance = |c: [f64; 2]| (x[0] - c[0]).hypot(x[1] - c[1]);
                assert!(distance(OBSTACLE.0) >= OBSTACLE.1, "{seed} {vehicle:?} at {t}: collision");
                assert!(t < deadline || distance(GOAL.0) <= GOAL.1, "{seed} {vehicle:?} at {t}: not inside");
            }
        }
    }
    println!(
        "{seeds} starts: accepted {accepted:?} unicycles and point masses, the plan drove {plans} steps"
    );
    // Two of the first 40 are too tight for their deadline.
    assert!(accepted.iter().all(|&n| 3 * n >= seeds), "accepted: {accepted:?}");
    assert!(plans > 0, "the plan never had to drive: the cases are too easy");
}

/// A hold that was made known before plans were asked for is theirs; plans are given once, and after an integrator.
#[test]
fn plans_take_what_the_filter_knows() {
    let input = |hold_first: bool| {
        let mut filter = Vehicle::Unicycle.filter(8.0, [6.0, 2.0]);
        if hold_first {
            filter.expect_hold(Some(0.5 * PERIOD)).expect("a hold");
        }
        let mut filter = filter.with_plans(PERIOD).expect("plans");
        if !hold_first {
            filter.expect_hold(Some(0.5 * PERIOD)).expect("a hold");
        }
        let mut u = [0.0; 2];
        let report = filter.step(0.0, &[0.0, 0.0, -0.4, 1.0], &[6.0, 1.0], &mut u).expect("right dimensions");
        assert!(report.is_assured());
        (u.map(f64::to_bits), filter.last_hold())
    };
    assert_eq!(input(true), input(false));
    assert_eq!(input(true).1, Some(0.5 * PERIOD));
    let planned = || Vehicle::Unicycle.assured(8.0, [6.0, 2.0]);
    let twice = planned().with_plans(PERIOD).err().map(|e| e.to_string());
    assert_eq!(twice.as_deref(), Some("plans: are there already, must be given once"));
    let beta = Integration { state: 3, input: 0, limits: [-1.0, 1.0], gain: 1.0 };
    let late = planned().with_integrator(beta).err().map(|e| e.to_string());
    assert_eq!(late.as_deref(), Some("integrator: comes after the plans, must come before them"));
    let replaced = planned().set_deadline(0, 3.0).err().map(|e| e.to_string());
    assert!(replaced.is_some_and(|e| e.starts_with("deadline: cannot be replaced where plans are followed")));
}

#[test]
fn what_no_input_can_keep_is_refused() {
    // From rest 12 m/s² lead 17.3 m far along x in 1.7 s, and the goal begins at 18 m.
    let mut filter = Vehicle::PointMass.assured(1.7, [12.0; 2]);
    let mut u = [0.0; 2];
    let assurance =
        filter.step(0.0, &[0.0; 4], &[0.0; 2], &mut u).expect("right dimensions").assurance.expect("plans");
    assert!(assurance.status == AssuranceStatus::Refused && assurance.failure.is_some(), "{assurance:?}");
    assert!(filter.plan().is_none());
    // The rows go on.
    assert!(u != [0.0; 2]);
}

/// The least time in which a point mass gets from rest to rest over a distance d is 2√(d/a); inside earlier.
/// A deadline that cannot be kept is given up for the earliest that can, where the barrier allows it, and that one is kept.
#[test]
fn the_earliest_deadline_is_taken_and_kept() {
    for infeasible in [Infeasible::Report, Infeasible::Earliest] {
        let goal = DistanceDisc::new(GOAL.0, GOAL.1, 1.0).expect("valid disc");
        let settings = BarrierSettings::within(2.0).infeasible(infeasible);
        let filter = Filter::builder(PointMass)
            .barrier("goal", goal, settings)
            .and_then(|b| b.bounds(&[-4.0; 2], &[4.0; 2]))
            .and_then(|b| b.sampling(Sampling::Period(PERIOD)))
            .and_then(FilterBuilder::build)
            .expect("valid filter");
        let mut filter = filter.with_plans(PERIOD).expect("a filter that can be assured");
        let (mut x, mut u, mut deadline) = ([0.0, 0.0, -1.0, 2.0], [0.0; 2], 0.0);
        for k in 0..400 {
            let t = f64::from(k) * PERIOD;
            let assurance =
                filter.step(t, &x, &[-8.0, 8.0], &mut u).expect("right dimensions").assurance.expect("plans");
            if infeasible == Infeasible::Report {
                assert_eq!(assurance.status, AssuranceStatus::Refused);
                break;
            }
            let goal = &filter.report().barriers[0];
            assert!(assurance.is_assured() && goal.guaranteed && goal.postponed == 1, "{t}: {goal:?}");
            if k == 0 {
                // 20 m there and to a stop take 4.5 s at 4 m/s2; the disc's edge is nearer.
                deadline = goal.time_left;
                assert!((3.0..5.5).contains(&deadline), "{deadline}");
            }
            assert!((goal.time_left - (deadline - t).max(0.0)).abs() < 1e-9, "{t}: {goal:?}");
            x = Vehicle::PointMass.move_by(x, u, PERIOD);
            let distance = (x[0] - GOAL.0[0]).hypot(x[1] - GOAL.0[1]);
            assert!(t + PERIOD < deadline || distance <= GOAL.1, "{t}: {x:?}");
        }
    }
}

#[test]
fn the_earliest_deadline_is_near_what_physics_allows() {
    let goal = DistanceDisc::new([30.0, 0.0], 1.0, 1.0).expect("valid disc");
    for (deadline, bound) in [(2.0, 2.0), (20.0, 2.0), (5.0, 7.0)] {
        let filter = Filter::builder(PointMass)
            .barrier("goal", goal, BarrierSettings::within(deadline))
            .and_then(|b| b.bounds(&[-bound; 2], &[bound; 2]))
            .and_then(|b| b.sampling(Sampling::Period(PERIOD)))
            .and_then(FilterBuilder::build)
            .expect("valid filter");
        let filter = filter.with_plans(PERIOD).expect("a filter that can be assured");
        let (factor, backup_plan) = filter
            .planning()
            .expect("plans")
            .earliest_deadline(0.0, &[0.0; 4], 100.0)
            .expect("there is a deadline");
        // The edge at 29 m, with the speed from which 2 m are enough to stop: half a v² of 2 a d more.
        let (d, room) = (29.0, 2.0);
        let speed = f64::sqrt(bound * (d + room));
        let least = speed / bound + (speed - f64::sqrt(2.0 * bound * room)) / bound;
        let earliest = factor * deadline;
        assert!((0.99 * least..1.08 * least).contains(&earliest), "a <= {bound}: {earliest} s, {least} s");
        assert!(backup_plan.effort <= 1.0);
        // As promised, a little later can be assured, and much sooner cannot.
        assert!(filter.planning().expect("plans").plan_from(0.0, &[0.0; 4], 1.1 * factor).is_ok());
        assert!(
            filter.planning().expect("plans").plan_from(0.0, &[0.0; 4], 0.95 * least / deadline).is_err()
        );
    }
}

#[test]
fn a_restored_filter_goes_on_bit_for_bit() {
    let vehicle = Vehicle::Unicycle;
    let mut filter = vehicle.assured(8.0, [6.0, 2.0]);
    let mut x = [0.0, 0.0, -0.4, 1.0];
    let run = |filter: &mut Filter, x: &mut [f64; 4], steps: std::ops::Range<usize>| {
        let mut bits = Vec::new();
        for k in steps {
            let mut u = [0.0; 2];
            let u_ref = [6.0, -1.5];
            let assurance = filter
                .step(k as f64 * PERIOD, &*x, &u_ref, &mut u)
                .expect("right dimensions")
                .assurance
                .expect("plans");
            assert!(assurance.is_assured(), "{assurance:?}");
            bits.push(u.map(f64::to_bits));
            *x = vehicle.move_by(*x, u, PERIOD);
        }
        bits
    };
    run(&mut filter, &mut x, 0..150);
    // To a file and back: the numbers keep their bits.
    let text = serde_json::to_string(filter.state()).expect("serialises");
    let memory: FilterState = serde_json::from_str(&text).expect("what was written");
    assert_eq!(memory, *filter.state());
    let from = x;
    let uninterrupted = run(&mut filter, &mut x, 150..400);
    let mut other = vehicle.assured(8.0, [6.0, 2.0]);
    other.restore(&memory).expect("its own state");
    let mut x = from;
    assert_eq!(run(&mut other, &mut x, 150..400), uninterrupted);
}

/// Looking ahead changes nothing, and the report is that of the input.
#[test]
fn a_look_is_not_remembered() {
    let vehicle = Vehicle::Unicycle;
    let [mut looking, mut plain] = [(); 2].map(|()| vehicle.assured(8.0, [6.0, 2.0]));
    let mut x = [0.0, 0.0, -0.4, 1.0];
    for k in 0..300 {
        let (t, mut u, mut seen) = (f64::from(k) * PERIOD, [0.0; 2], [0.0; 2]);
        let u_ref = [6.0, if k % 70 < 35 { 1.5 } else { -1.5 }];
        looking.peek(t, &x, &[0.3, 0.1], &mut seen).expect("right dimensions");
        looking.peek(t, &x, &u_ref, &mut seen).expect("right dimensions");
        let looked = *looking.assurance().expect("plans");
        looking.step(t, &x, &u_ref, &mut seen).expect("right dimensions");
        let assurance =
            plain.step(t, &x, &u_ref, &mut u).expect("right dimensions").assurance.expect("plans");
        assert_eq!((seen.map(f64::to_bits), looked), (u.map(f64::to_bits), assurance), "{t}");
        let report = plain.report();
        // The solver's iterations alone depend on what was looked at before.
        let mut seen = looking.report().clone();
        seen.iterations = report.iterations;
        assert_eq!(seen, *report, "{t}");
        assert_eq!(report.status == Status::Unchanged, u == u_ref, "{t}: {report:?}");
        assert_eq!(
            report.status == Status::Backup,
            matches!(assurance.driver, Driver::Plan | Driver::Between)
        );
        assert!(
            report.status.is_satisfied() && report.barriers.iter().all(|b| b.guaranteed),
            "{t}: {report:?}"
        );
        x = vehicle.move_by(x, u, PERIOD);
    }
}

/// Steps of any length that are given: each is kept until a promise is ended explicitly.
#[test]
fn steps_of_other_lengths_keep_the_promise_or_end_it() {
    let (mut kept, mut ended) = (0, 0);
    for seed in 1..=12_u64 {
        let random = &mut Random(0x9e37_79b9_7f4a_7c15_u64.wrapping_mul(seed));
        let vehicle = if seed % 2 == 0 { Vehicle::PointMass } else { Vehicle::Unicycle };
        let (deadline, bounds) = (8.0, [6.0, 2.0]);
        let mut filter = vehicle.assured(deadline, if seed % 2 == 0 { [6.0; 2] } else { bounds });
        let (mut t, mut x) = (0.0, [0.0, 0.0, -0.4, 1.0]);
        // A third of the runs halve their step again and again, the others draw it.
        let mut hold = 4.0 * PERIOD;
        let mut step = 0;
        while t < deadline + 3.0 {
            step += 1;
            hold = match seed % 3 {
                0 if step % 100 == 0 => (0.5 * hold).max(0.25 * PERIOD),
                0 => hold,
                _ => random.between(0.2, 1.5) * PERIOD,
            };
            filter.expect_hold(Some(hold)).expect("a time");
            let (u_ref, mut u) = (wanted(vehicle, seed % 5, x, bounds, random), [0.0; 2]);
            let assurance =
                filter.step(t, &x, &u_ref, &mut u).expect("right dimensions").assurance.expect("plans");
            if !assurance.is_assured() {
                assert!(
                    seed % 3 != 0 && t > 0.0 && assurance.status == AssuranceStatus::Irregular,
                    "{assurance:?}"
                );
                ended += 1;
                break;
            }
            for part in 1..=10 {
                x = vehicle.move_by(x, u, hold / 10.0);
                let t = t + hold * f64::from(part) / 10.0;
                let distance = |c: [f64; 2]| (x[0] - c[0]).hypot(x[1] - c[1]);
                assert!(distance(OBSTACLE.0) >= OBSTACLE.1, "{seed} at {t}: collision");
                assert!(t < deadline || distance(GOAL.0) <= GOAL.1, "{seed} at {t}: not inside");
            }
            t += hold;
        }
        kept += usize::from(t >= deadline + 3.0);
    }
    println!("steps of other lengths: {kept} kept, {ended} ended");
    assert!(kept + ended == 12 && kept >= 6, "{kept} kept, {ended} ended");
}

/// A set that is let go on arrival is promised until then, and no longer.
#[test]
fn what_is_let_go_on_arrival_is_not_promised_after() {
    let disc = DistanceDisc::new(GOAL.0, GOAL.1, 1.0).expect("valid disc");
    let filter = Filter::builder(PointMass)
        .barrier("goal", disc, BarrierSettings::within(8.0))
        .and_then(|b| b.window(Begin::AtOnce, End::OnArrival))
        .and_then(|b| b.bounds(&[-4.0; 2], &[4.0; 2]))
        .and_then(|b| b.sampling(Sampling::Period(PERIOD)))
        .and_then(FilterBuilder::build)
        .expect("valid filter");
    let mut filter = filter.with_plans(PERIOD).expect("a filter that can be assured");
    let (mut x, mut u, mut released) = ([0.0; 4], [0.0; 2], false);
    for k in 0..500 {
        let t = f64::from(k) * PERIOD;
        let assurance =
            filter.step(t, &x, &[3.0, 1.8], &mut u).expect("right dimensions").assurance.expect("plans");
        let goal = &filter.report().barriers[0];
        released |= goal.phase == Phase::Released;
        assert!(assurance.is_assured() && goal.guaranteed != released, "{t}: {goal:?}");
        // Free to drive on.
        assert!(!released || u == [3.0, 1.8], "{t}: {u:?}");
        x = Vehicle::PointMass.move_by(x, u, PERIOD);
    }
    assert!(released);
}

/// Steps of any size end, and none takes long.
#[test]
fn tiny_and_huge_steps_are_answered() {
    for first in [1e-12, 1e-9, 1e-6, 1e-4, 0.02, 5.0, 1e5, 1e300] {
        let vehicle = Vehicle::Unicycle;
        let mut filter = vehicle.assured(8.0, [6.0, 2.0]);
        let (mut t, mut x) = (0.0, [0.0, 0.0, -0.4, 1.0]);
        for hold in [first, 0.02, 1e18, 1e-12] {
            filter.expect_hold(Some(hold)).expect("a time");
            let mut u = [0.0; 2];
            let assurance =
                filter.step(t, &x, &[6.0, 1.0], &mut u).expect("right dimensions").assurance.expect("plans");
            assert!(u[0].abs() <= 6.0 && u[1].abs() <= 2.0, "{first} s: {assurance:?}");
            assert!(first != 0.02 || t > 0.02 || assurance.is_assured(), "{assurance:?}");
            x = vehicle.move_by(x, u, hold.min(0.02));
            t += hold;
        }
    }
}

/// What a run is judged by: the length of each step in s, that the filter is told, and what the plant does beside the model.
struct Course<'a> {
    step: &'a mut dyn FnMut(&mut Random) -> f64,
    /// Whether the filter is told that length; else it takes the usual one.
    is_told: bool,
    wind: [f64; 2],
}

/// What became of a run: the samples with and without the promise, and what it was lost for first.
#[derive(Debug, Default)]
struct Outcome {
    assured: usize,
    lost: Vec<(f64, AssuranceStatus, Option<Failure>)>,
}

/// Runs to 10 s, or 2000 steps. At no instant is a set left that the sample before said was kept until the next.
fn judged(seed: u64, random: &mut Random, course: &mut Course<'_>) -> Outcome {
    let vehicle = if seed.is_multiple_of(2) { Vehicle::PointMass } else { Vehicle::Unicycle };
    let (deadline, bounds) = (7.0, [6.0, 2.5]);
    let mut filter = vehicle.assured(deadline, bounds);
    let (mut t, mut outcome) = (0.0, Outcome::default());
    let mut x = [random.between(-3.0, 3.0), random.between(-3.0, 3.0), 0.5, random.between(0.0, 2.0)];
    for _ in 0..2000 {
        if t > deadline + 3.0 {
            break;
        }
        let step = (course.step)(random);
        let told = if course.is_told { step } else { filter.usual_hold(t).expect("plans") };
        filter.expect_hold(Some(told)).expect("a time");
        let (u_ref, mut u) = (wanted(vehicle, seed % 5, x, bounds, random), [0.0; 2]);
        let assurance =
            filter.step(t, &x, &u_ref, &mut u).expect("right dimensions").assurance.expect("plans");
        match assurance.is_assured() {
            true => outcome.assured += 1,
            false => outcome.lost.push((t, assurance.status, assurance.failure)),
        }
        let flags: Vec<bool> = filter.report().barriers.iter().map(|b| b.guaranteed).collect();
        let parts = ((step / PERIOD * 20.0) as u32).max(1);
        let begin = t;
        for part in 1..=parts {
            let dt = step / f64::from(parts);
            x = vehicle.move_by(x, u, dt);
            x[0] += course.wind[0] * dt;
            x[1] += course.wind[1] * dt;
            let t = begin + dt * f64::from(part);
            let distance = |c: [f64; 2]| (x[0] - c[0]).hypot(x[1] - c[1]);
            assert!(!flags[1] || distance(OBSTACLE.0) >= OBSTACLE.1, "{seed} at {t}: collision");
            assert!(!flags[0] || t < deadline || distance(GOAL.0) <= GOAL.1, "{seed} at {t}: not inside");
        }
        t = begin + step;
    }
    outcome
}

/// Drives to the goal, beyond the bounds of the inputs where it is far.
fn eager(vehicle: Vehicle, x: [f64; 4], [gain, brake, fastest]: [f64; 3]) -> [f64; 2] {
    let [dx, dy] = [GOAL.0[0] - x[0], GOAL.0[1] - x[1]];
    let far = dx.hypot(dy);
    let speed = (gain * far).min(fastest);
    match vehicle {
        Vehicle::PointMass => {
            [brake * (speed * dx / far.max(1e-9) - x[2]), brake * (speed * dy / far.max(1e-9) - x[3])]
        }
        Vehicle::Unicycle => {
            let turn = dy.atan2(dx) - x[2];
            let turn = turn - (turn / std::f64::consts::TAU).round() * std::f64::consts::TAU;
            [brake * (speed * turn.cos().max(0.0) - x[3]), if far < 0.7 { 0.0 } else { 2.0 * turn }]
        }
    }
}

/// A controller that keeps every promise by itself is left alone, however much quicker than the first plan it is, and also where its
/// input is beyond the bounds. Until arrival no more than 4 % of the steps are changed, and it arrives within 2 % of its own time.
#[test]
fn a_controller_that_is_safe_by_itself_is_left_alone() {
    let (deadline, bounds, seconds) = (12.0, [3.0, 1.2], 13.0);
    let (mut runs, mut changed, mut before) = (0, 0, 0);
    for seed in 1..=24_u64 {
        let random = &mut seeded(seed);
        let vehicle = if seed.is_multiple_of(2) { Vehicle::PointMass } else { Vehicle::Unicycle };
        let start = [random.between(-3.0, 3.0), random.between(-9.0, 3.0), 0.5, random.between(0.0, 2.0)];
        let gains = [random.between(0.5, 1.2), random.between(1.2, 2.5), random.between(3.0, 8.0)];
        let drive = |filter: Option<&mut Filter>| {
            let (mut x, mut arrival, mut nearest, mut changes, mut filter) =
                (start, None, f64::INFINITY, 0, filter);
            for k in 0..(seconds / PERIOD) as u32 {
                let t = f64::from(k) * PERIOD;
                let u_ref = eager(vehicle, x, gains);
                let within = [0, 1].map(|i| u_ref[i].clamp(-bounds[i], bounds[i]));
                let mut u = within;
                if let Some(filter) = filter.as_deref_mut() {
                    let assurance = filter
                        .step(t, &x, &u_ref, &mut u)
                        .expect("right dimensions")
                        .assurance
                        .expect("plans");
                    assert!(assurance.is_assured(), "{seed} at {t}: {assurance:?}");
                }
                changes += u32::from(arrival.is_none() && u != within);
                for part in 1..=10 {
                    x = vehicle.move_by(x, u, PERIOD / 10.0);
                    let distance = |c: [f64; 2]| (x[0] - c[0]).hypot(x[1] - c[1]);
                    nearest = nearest.min(distance(OBSTACLE.0) - OBSTACLE.1);
                    let t = t + PERIOD / 10.0 * f64::from(part);
                    let inside = GOAL.1 - distance(GOAL.0);
                    arrival = if inside < 0.0 { None } else { arrival.or(Some(t)) };
                    nearest = if t < deadline { nearest } else { nearest.min(inside) };
                }
            }
            (arrival, nearest, changes)
        };
        let (Some(alone), 0.1.., _) = drive(None) else { continue };
        let (arrival, nearest, changes) = drive(Some(&mut vehicle.assured(deadline, bounds)));
        assert!(
            nearest >= 0.0 && arrival.is_some_and(|t| t <= 1.02 * alone),
            "{seed}: {alone} {arrival:?} {nearest}"
        );
        runs += 1;
        changed += changes;
        before += (alone / PERIOD) as u32;
    }
    println!("{runs} runs that are safe by themselves: {changed} of {before} steps until arrival changed");
    assert!(runs >= 8 && changed * 25 <= before, "{runs} runs, {changed} of {before} changed");
}

fn seeded(seed: u64) -> Random {
    Random(0x9e37_79b9_7f4a_7c15_u64.wrapping_mul(seed))
}

/// Steps of 1e-17 s to three periods, of all lengths or between regular ones, keep the promise while a plan is found, and the flag
/// tells the truth at all instants. A step that is far below the period never ends it.
#[test]
fn steps_of_any_length_go_on_with_the_plan() {
    let (mut assured, mut lost) = (0, 0);
    for seed in 1..=16_u64 {
        let random = &mut seeded(seed);
        let tiny = |random: &mut Random| 10.0_f64.powf(random.between(-17.0, -2.0));
        let step = &mut |random: &mut Random| match seed % 4 {
            0 => 10.0_f64.powf(random.between(-17.0, (3.0 * PERIOD).log10())),
            1 if random.between(0.0, 1.0) < 0.2 => tiny(random),
            1 => PERIOD,
            2 => random.between(0.01, 1.0) * PERIOD,
            _ if random.between(0.0, 1.0) < 0.5 => tiny(random),
            _ => random.between(0.0, 3.0) * PERIOD,
        };
        let outcome = judged(seed, random, &mut Course { step, is_told: true, wind: [0.0; 2] });
        assert!(seed % 4 > 1 || outcome.lost.is_empty(), "{seed}: {:?}", outcome.lost);
        (assured, lost) = (assured + outcome.assured, lost + outcome.lost.len());
    }
    println!("steps of any length: {assured} samples assured, {lost} not");
    assert!(100 * lost <= assured, "{lost} of {assured} samples without the promise");
}

/// A clock that is measured is no fault: jitter of up to four percent, and periods that are cut in half.
#[test]
fn a_measured_clock_keeps_the_promise() {
    for seed in 1..=12_u64 {
        let random = &mut seeded(seed);
        let jitter = [0.0, 1e-4, 1e-2, 4e-2][(seed % 4) as usize];
        let step = &mut |random: &mut Random| match random.between(0.0, 1.0) < 0.2 {
            true if seed % 3 == 0 => 0.5 * PERIOD,
            _ => PERIOD * (1.0 + random.between(-jitter, jitter)),
        };
        let outcome = judged(seed, random, &mut Course { step, is_told: false, wind: [0.0; 2] });
        assert!(outcome.lost.is_empty() && outcome.assured > 400, "{seed}, {jitter}: {outcome:?}");
    }
}

/// A clock that ticks more often than was said is taken as it is, once it has for a while.
#[test]
fn a_faster_clock_becomes_the_usual_one() {
    let (mut filter, mut x, mut u) = (Vehicle::PointMass.assured(8.0, [8.0; 2]), [0.0; 4], [0.0; 2]);
    for k in 0..40_u32 {
        let t = f64::from(k) * 0.5 * PERIOD;
        let hold = filter.usual_hold(t).expect("plans");
        assert!(k > 7 || hold == PERIOD, "{k}: {hold}");
        assert!(k < 10 || (hold - 0.5 * PERIOD).abs() < 1e-9, "{k}: {hold}");
        filter.expect_hold(Some(hold)).expect("a time");
        assert!(filter.step(t, &x, &[0.0; 2], &mut u).expect("right dimensions").is_assured(), "{k}");
        x = Vehicle::PointMass.move_by(x, u, 0.5 * PERIOD);
    }
}

/// A plant that drifts beside the model: what was seen of it bounds what the next hold can bring, so the flag falls before a set
/// is left and not after. Without wind it never falls for that.
#[test]
fn the_flag_falls_before_a_drift_leaves_a_set() {
    let mut fallen = 0;
    for seed in 1..=draws(12, 24) {
        let random = &mut seeded(seed);
        let (speed, angle) = (random.between(0.2, 0.6), random.between(0.0, std::f64::consts::TAU));
        for wind in [[0.0; 2], [speed * angle.cos(), speed * angle.sin()]] {
            let step = &mut |_: &mut Random| PERIOD;
            let outcome = judged(seed, &mut seeded(seed + 77), &mut Course { step, is_told: true, wind });
            let drifts = outcome.lost.iter().filter(|lost| matches!(lost.2, Some(Failure::Drift { .. })));
            let drifts = drifts.count();
            assert!(wind != [0.0; 2] || outcome.lost.is_empty(), "{seed}: {:?}", outcome.lost);
            fallen += drifts;
        }
    }
    println!("the flag fell for a drift at {fallen} samples");
    assert!(fallen > 0, "no wind ever led to the edge of a set");
}

/// What a step costs does not grow as it gets shorter: the model is asked no more often.
#[test]
fn the_cost_of_a_step_does_not_grow_as_it_gets_shorter() {
    static ASKED: AtomicU64 = AtomicU64::new(0);
    #[derive(Clone, Copy, Debug)]
    struct Counted;
    impl ControlAffine<4, 2> for Counted {
        fn drift<S: Scalar>(&self, x: &[S; 4]) -> [S; 4] {
            ASKED.fetch_add(1, Ordering::Relaxed);
            Unicycle.drift(x)
        }

        fn input_map<S: Scalar>(&self, x: &[S; 4]) -> [[S; 2]; 4] {
            Unicycle.input_map(x)
        }
    }
    let asked = |hold: f64, first: bool| {
        let goal = DistanceDisc::new(GOAL.0, GOAL.1, 1.0).expect("valid disc");
        let filter = Filter::builder(Counted)
            .barrier("goal", goal, BarrierSettings::within(8.0))
            .and_then(|b| b.bounds(&[-6.0, -2.5], &[6.0, 2.5]))
            .and_then(|b| b.sampling(Sampling::Period(PERIOD)))
            .and_then(FilterBuilder::build)
            .expect("valid filter");
        let mut filter = filter.with_plans(PERIOD).expect("a filter that can be assured");
        let (mut x, mut u, mut t, mut most) = ([0.0, 0.0, -0.4, 1.0], [0.0; 2], 0.0, 0);
        for k in 0..30 {
            let hold = if k < 10 && !first { PERIOD } else { hold };
            filter.expect_hold(Some(hold)).expect("a time");
            ASKED.store(0, Ordering::Relaxed);
            let assurance =
                filter.step(t, &x, &[6.0, 1.0], &mut u).expect("right dimensions").assurance.expect("plans");
            assert!(assurance.is_assured(), "{hold} s at {t}: {assurance:?}");
            if k > 10 || first && k == 0 {
                most = most.max(ASKED.load(Ordering::Relaxed));
            }
            x = Vehicle::Unicycle.move_by(x, u, hold);
            t += hold;
        }
        most
    };
    for first in [false, true] {
        let usual = asked(PERIOD, first);
        for exponent in [3, 5, 7, 9, 12, 17] {
            let short = asked(10.0_f64.powi(-exponent), first);
            assert!(short <= 10 * usual, "1e-{exponent} s: {short} for {usual}, first {first}");
        }
    }
}

/// A plan that is kept on its own ends through a change of the period is none of the new period: what ends it then is the
/// change.
#[test]
fn a_plan_of_another_period_ends_as_irregular() {
    let (mut seen, vehicle) = (0, Vehicle::Unicycle);
    let earliest = vehicle
        .assured(6.0, [6.0, 2.0])
        .planning()
        .expect("plans")
        .earliest_deadline(0.0, &[0.0, 0.0, -0.4, 1.0], 1.0)
        .expect("a plan")
        .0;
    for seed in 1..=48_u64 {
        // A few samples are enough.
        if seen >= draws(1, 5) {
            break;
        }
        let random = &mut Random(0x9e37_79b9_7f4a_7c15_u64.wrapping_mul(seed));
        // So tight that the plan drives.
        let deadline = 6.0 * earliest * random.between(1.0, 1.15);
        let mut filter = vehicle.assured(deadline, [6.0, 2.0]);
        let (mut t, mut x, mut u) = (0.0, [0.0, 0.0, -0.4, 1.0], [0.0; 2]);
        let other = random.between(0.3, 2.7) * PERIOD;
        let change = if seed % 2 == 0 { 10 } else { 25 };
        for step in 0..change + 20 {
            let hold = if step < change { PERIOD } else { other };
            filter.expect_hold(Some(hold)).expect("a time");
            let u_ref = wanted(vehicle, seed % 5, x, [6.0, 2.0], random);
            if !filter.step(t, &x, &u_ref, &mut u).expect("right dimensions").is_assured() {
                break;
            }
            x = vehicle.move_by(x, u, hold);
            t += hold;
            if step > change + 1 && format!("{:?}", filter.state().plan).contains("is_uniform: false") {
                seen += 1;
                let lost = |x: &[f64]| {
                    let mut copy = vehicle.assured(deadline, [6.0, 2.0]);
                    copy.restore(filter.state()).expect("its own");
                    copy.expect_hold(Some(other)).expect("a time");
                    copy.step(t, x, &[0.0; 2], &mut [0.0; 2])
                        .expect("right dimensions")
                        .assurance
                        .expect("plans")
                        .status
                };
                assert_eq!(lost(&[-400.0, 0.0, 0.0, 0.0]), AssuranceStatus::Irregular);
                // Its input changes within this hold.
                assert_eq!(lost(&[f64::NAN; 4]), AssuranceStatus::Irregular);
            }
        }
    }
    println!("kept through a change: {seen} samples");
    assert!(seen > 0, "no plan was kept through a change");
}

/// A small set seen from far away has no room for a margin in parts of the distance.
#[test]
fn small_sets_are_promised_from_far_away() {
    let quadratic = QuadraticDisc::new([150.0, 0.0], 1.0).expect("valid disc");
    let disc = DistanceDisc::new([2000.0, 0.0], 0.3, 0.3).expect("valid disc");
    let far = |builder: Result<FilterBuilder<PointMass, 4, 2>, punctual_core::Error>| {
        let filter = builder
            .and_then(|b| b.bounds(&[-8.0; 2], &[8.0; 2]))
            .and_then(|b| b.sampling(Sampling::Period(PERIOD)))
            .and_then(FilterBuilder::build)
            .expect("valid filter");
        let filter = filter.with_plans(PERIOD).expect("a filter that can be assured");
        filter.planning().expect("plans").plan_from(0.0, &[0.0; 4], 1.0)
    };
    let builder = || Filter::builder(PointMass);
    let small = far(builder().barrier("goal", quadratic, BarrierSettings::within(12.0)));
    assert!(small.is_ok(), "{small:?}");
    let distant = far(builder().barrier("goal", disc, BarrierSettings::within(60.0)));
    assert!(distant.is_ok(), "{distant:?}");
    // Not where nothing is left: too soon.
    let soon = far(builder().barrier("goal", quadratic, BarrierSettings::within(6.0)));
    assert!(matches!(soon, Err(Failure::Broken { .. })), "{soon:?}");
}

/// Pushed against the edge for ever: the margin is kept, the input settles, and the plan does not grow.
#[test]
fn a_vehicle_at_the_edge_comes_to_rest_there() {
    for margin in [0.02, 0.0] {
        let disc = DistanceDisc::new([0.0; 2], 2.0, 1.0).expect("valid disc");
        let settings = BarrierSettings::keeping().margin(margin);
        let filter = Filter::builder(PointMass)
            .barrier("room", disc, settings)
            .and_then(|b| b.bounds(&[-4.0; 2], &[4.0; 2]))
            .and_then(|b| b.sampling(Sampling::Period(PERIOD)))
            .and_then(FilterBuilder::build)
            .expect("valid filter");
        let mut filter = filter.with_plans(PERIOD).expect("a filter that can be assured");
        let (mut x, mut last, mut jump) = ([0.0; 4], [0.0; 2], 0.0_f64);
        for k in 0..3000 {
            let (t, mut u) = (f64::from(k) * PERIOD, [0.0; 2]);
            let assurance =
                filter.step(t, &x, &[2.0, 0.0], &mut u).expect("right dimensions").assurance.expect("plans");
            let holds = filter.plan().map_or(0, |plan| plan.inputs.len());
            assert!(assurance.is_assured() && holds < 300, "{t}: {assurance:?}, {holds} holds");
            x = Vehicle::PointMass.move_by(x, u, PERIOD);
            let h = 2.0 - x[0].hypot(x[1]);
            assert!(h > 0.9 * margin, "{t}: {h}");
            if t > 20.0 {
                jump = jump.max((u[0] - last[0]).abs());
            }
            last = u;
        }
        println!("at the edge: h = {}, jumps of {jump} m/s2", 2.0 - x[0].hypot(x[1]));
        // A fraction of what is pushed with.
        assert!(jump < 0.5, "{jump}");
    }
}

/// A wall without a deadline that the vehicle can stop before is promised whatever the period is, and kept: how long it takes
/// to stop has nothing to do with the period.
#[test]
fn a_wall_is_promised_at_every_period() {
    for seed in 1..=24_u64 {
        let random = &mut Random(0x9e37_79b9_7f4a_7c15_u64.wrapping_mul(seed));
        let period = [0.0005, 0.001, 0.002, 0.005, 0.02, 0.05][seed as usize % 6];
        let (bound, speed) = (random.between(2.0, 20.0), random.between(0.5, 8.0));
        let room = speed * speed / (2.0 * bound) * random.between(1.3, 10.0) + 2.0 * speed * period;
        let wall = StateBound::at_most(0, room).expect("valid bound");
        let filter = Filter::builder(PointMass)
            .barrier("wall", wall, BarrierSettings::keeping())
            .and_then(|b| b.bounds(&[-bound; 2], &[bound; 2]))
            .and_then(|b| b.sampling(Sampling::Period(period)))
            .and_then(FilterBuilder::build)
            .expect("valid filter");
        let mut filter = filter.with_plans(period).expect("a filter that can be assured");
        let mut x = [0.0, 0.0, speed, 0.0];
        for k in 0..(4.0 * room / speed / period).min(3000.0) as u32 {
            let (t, mut u) = (f64::from(k) * period, [0.0; 2]);
            let assurance = filter
                .step(t, &x, &[bound, 0.0], &mut u)
                .expect("right dimensions")
                .assurance
                .expect("plans");
            assert!(assurance.is_assured(), "{seed}, period {period}, at {t}: {assurance:?}");
            for _ in 0..4 {
                x = Vehicle::PointMass.move_by(x, u, period / 4.0);
                assert!(x[0] <= room, "{seed} at {t}: {x:?}");
            }
        }
    }
}

#[test]
fn a_sample_at_another_time_ends_the_promise() {
    let mut filter = Vehicle::PointMass.assured(8.0, [8.0; 2]);
    let mut u = [0.0; 2];
    assert!(filter.step(0.0, &[0.0; 4], &[0.0; 2], &mut u).expect("right dimensions").is_assured());
    // The same sample again is no other time.
    assert!(filter.step(0.0, &[0.0; 4], &[0.0; 2], &mut u).expect("right dimensions").is_assured());
    for (t, wrong) in [(10.0, 1.5), (1.7e9, 1.1), (5.0, -0.5), (-3.0, f64::NAN)] {
        filter.rearm();
        let mut x = [0.0; 4];
        for k in 0..3 {
            let t = t + PERIOD * f64::from(k);
            assert!(filter.step(t, &x, &[0.0; 2], &mut u).expect("right dimensions").is_assured(), "{t}");
            x = Vehicle::PointMass.move_by(x, u, PERIOD);
        }
        let late = t + PERIOD * (2.0 + wrong);
        if wrong > 1.0 {
            x = Vehicle::PointMass.move_by(x, u, PERIOD * (wrong - 1.0));
        }
        let other =
            filter.step(late, &x, &[0.0; 2], &mut u).expect("right dimensions").assurance.expect("plans");
        assert_eq!(other.status, AssuranceStatus::Irregular, "{t}");
        // In time again: the same promise, from where the plant has come to.
        if wrong > 1.0 {
            x = Vehicle::PointMass.move_by(x, u, PERIOD);
            let again = filter
                .step(late + PERIOD, &x, &[0.0; 2], &mut u)
                .expect("right dimensions")
                .assurance
                .expect("plans");
            assert!(again.is_assured(), "{t}: {again:?}");
            for k in 2..400 {
                x = Vehicle::PointMass.move_by(x, u, PERIOD);
                let now = late + PERIOD * f64::from(k);
                assert!(filter.step(now, &x, &[8.0, 0.0], &mut u).expect("right dimensions").is_assured());
            }
            assert!((x[0] - GOAL.0[0]).hypot(x[1] - GOAL.0[1]) <= GOAL.1, "{x:?}");
        }
    }
}

/// What was broken while no plan was followed is not promised again.
#[test]
fn what_was_missed_is_not_taken_up_again() {
    let step = |filter: &mut Filter, t: f64, x: [f64; 4]| {
        filter
            .step(t, &x, &[0.0; 2], &mut [0.0; 2])
            .expect("right dimensions")
            .assurance
            .expect("plans")
            .status
    };
    let begun = || {
        let mut filter = Vehicle::PointMass.assured(8.0, [8.0; 2]);
        assert_eq!(step(&mut filter, 0.0, [0.0; 4]), AssuranceStatus::Assured);
        filter
    };
    let inside = [GOAL.0[0], GOAL.0[1], 0.0, 0.0];
    // The obstacle is touched at the late sample.
    let mut filter = begun();
    assert_eq!(step(&mut filter, 1.0, [OBSTACLE.0[0], OBSTACLE.0[1], 0.0, 0.0]), AssuranceStatus::Lost);
    assert_eq!(step(&mut filter, 1.0 + PERIOD, inside), AssuranceStatus::Lost);
    // The deadline passes before the late sample, or after it: nobody saw.
    let mut filter = begun();
    assert_eq!(step(&mut filter, 9.0, inside), AssuranceStatus::Lost);
    let mut filter = begun();
    assert_eq!(step(&mut filter, 7.99, inside), AssuranceStatus::Irregular);
    assert_eq!(step(&mut filter, 7.99 + PERIOD, inside), AssuranceStatus::Lost);
    // Nothing was missed.
    let mut filter = begun();
    assert_eq!(step(&mut filter, 7.9, inside), AssuranceStatus::Irregular);
    assert_eq!(step(&mut filter, 7.9 + PERIOD, inside), AssuranceStatus::Assured);
}

/// A promise that is lost, since the plant is not the model, is given again where a plan keeps it; what was broken is not.
#[test]
fn a_lost_promise_is_taken_up_again() {
    let mut random = Random(5);
    for (run, hits) in [false, true, false, true, false].into_iter().enumerate() {
        let vehicle = [Vehicle::PointMass, Vehicle::Unicycle][run % 2];
        let bounds = [8.0, if run % 2 == 0 { 8.0 } else { 2.0 }];
        let (mut filter, mut u) = (vehicle.assured(8.0, bounds), [0.0; 2]);
        let mut x = [0.0, 0.0, random.between(-0.4, 0.4), random.between(-0.5, 0.5)];
        let gone = [vec![-300.0, 40.0, 0.0, 0.0], vec![OBSTACLE.0[0], OBSTACLE.0[1], 0.0, 0.0]];
        let (mut lost, mut again) = (0, 0);
        for k in 0..600_u32 {
            let t = f64::from(k) * PERIOD;
            // Somebody carries it away, and back.
            let is_away = (60..66).contains(&k);
            let seen: &[f64] = if is_away { &gone[usize::from(hits)] } else { &x };
            let wish = wanted(vehicle, u64::from(k) / 40 % 5, x, bounds, &mut random);
            let assurance =
                filter.step(t, seen, &wish, &mut u).expect("right dimensions").assurance.expect("plans");
            let [flag, backed] =
                [filter.report().barriers[0].guaranteed, filter.report().status == Status::Backup];
            assert_eq!(flag, assurance.is_assured(), "{run} {t}");
            match assurance.status {
                AssuranceStatus::Assured => assert!(k < 60 || !is_away && !hits, "{run} {t}"),
                AssuranceStatus::Lost => {
                    assert!(k >= 60 && assurance.failure.is_some() && !backed, "{run} {t}");
                    lost += 1;
                }
                other => panic!("{run} {t}: {other:?}"),
            }
            again += u32::from(k > 66 && assurance.is_assured());
            if !is_away {
                x = vehicle.move_by(x, u, PERIOD);
            }
            if assurance.is_assured() {
                let distance = |c: [f64; 2]| (x[0] - c[0]).hypot(x[1] - c[1]);
                assert!(distance(OBSTACLE.0) >= OBSTACLE.1, "{run} {t}: {x:?}");
                assert!(t + PERIOD < 8.0 || distance(GOAL.0) <= GOAL.1, "{run} {t}: {x:?}");
            }
        }
        // At the first sample back, or before the search, at 3 programs a sample, has left its first guess, which it follows for 15.
        let is_back = if hits { (lost, again) == (540, 0) } else { (6..=11).contains(&lost) && again >= 529 };
        assert!(is_back, "{run}: {lost}, {again}");
    }
}

/// Gusts that no model knows of: a promise is lost with one at most, and what is said to be assured between two is kept,
/// at ten instants of each step. What is given again is as good as what was given first.
#[test]
fn gusts_lose_promises_but_do_not_make_them_lie() {
    const LAST: u32 = 250;
    const INSTANTS: u32 = 10;
    let seeds = draws(24, 400);
    // Runs that were accepted, losses, promises given again, and runs that are assured at the end.
    let mut told = [0_u32; 4];
    for seed in 1..=seeds {
        let random = &mut Random(0xd1b5_4a32_d192_ed03_u64.wrapping_mul(seed));
        let vehicle = if seed % 2 == 0 { Vehicle::PointMass } else { Vehicle::Unicycle };
        let (deadline, size) = (random.between(4.0, 9.0), 10.0_f64.powf(random.between(-3.5, 0.9)));
        let often = random.between(0.01, 0.3);
        let bounds = match vehicle {
            Vehicle::PointMass => [random.between(3.0, 12.0); 2],
            Vehicle::Unicycle => [random.between(3.0, 12.0), random.between(1.0, 3.0)],
        };
        let mut filter = vehicle.assured(deadline, bounds);
        let (mut x, mut u) = ([random.between(-4.0, 4.0), random.between(-4.0, 4.0), 0.3, 0.0], [0.0; 2]);
        let mut before = AssuranceStatus::Undecided;
        for k in 0..600_u32 {
            let t = f64::from(k) * PERIOD;
            let blows = k > 0 && k < LAST && random.between(0.0, 1.0) < often;
            if blows {
                x[2] += size * random.between(-1.0, 1.0);
                x[3] += size * random.between(-1.0, 1.0);
            }
            let wish = wanted(vehicle, u64::from(k) / 35 % 5, x, bounds, random);
            let now =
                filter.step(t, &x, &wish, &mut u).expect("right dimensions").assurance.expect("plans").status;
            assert_eq!(filter.report().barriers[0].guaranteed, now == AssuranceStatus::Assured, "{seed} {t}");
            match (before, now) {
                (AssuranceStatus::Undecided, AssuranceStatus::Assured) => told[0] += 1,
                (AssuranceStatus::Undecided, AssuranceStatus::Refused) => break,
                (AssuranceStatus::Assured, AssuranceStatus::Lost) => {
                    assert!(blows, "{seed} {t}: lost without a gust");
                    told[1] += 1;
                }
                (AssuranceStatus::Lost, AssuranceStatus::Assured) => told[2] += 1,
                (a, b) => assert_eq!(a, b, "{seed} {t}"),
            }
            before = now;
            for part in 1..=INSTANTS {
                x = vehicle.move_by(x, u, PERIOD / f64::from(INSTANTS));
                let after = t + PERIOD * f64::from(part) / f64::from(INSTANTS);
                let distance = |c: [f64; 2]| (x[0] - c[0]).hypot(x[1] - c[1]);
                // The rows know nothing of a promise that is not there.
                if now == AssuranceStatus::Assured {
                    assert!(distance(OBSTACLE.0) >= OBSTACLE.1, "{seed} {after}: {x:?}");
                    assert!(after < deadline || distance(GOAL.0) <= GOAL.1, "{seed} {after}: {x:?}");
                }
            }
        }
        told[3] += u32::from(before == AssuranceStatus::Assured);
    }
    println!(
        "accepted {}, lost {}, given again {}, assured at the end {}",
        told[0], told[1], told[2], told[3]
    );
    assert!(told.iter().all(|n| *n > 0) && told[2] <= told[1], "{told:?}");
}

/// The derivative of each piece, beside central differences of it.
#[test]
fn derivatives_are_those_of_the_piece_in_force() {
    const STEP: f64 = 1e-6;
    // As near as a search of few steps comes to its answer, with a plan behind it.
    const ALLOWED: f64 = 2e-3;
    let mut random = Random(11);
    let (mut compared, mut elsewhere, mut held) = ([0; 5], 0, 0);
    for run in 0..6 {
        let vehicle = [Vehicle::Unicycle, Vehicle::PointMass][run % 2];
        let bounds = [4.0, if run % 2 == 0 { 2.0 } else { 4.0 }];
        let sampling = if run < 4 { Sampling::Pointwise } else { Sampling::Period(PERIOD) };
        let filter = vehicle.filter_of(9.0, bounds, (false, sampling));
        let mut filter = filter.with_plans(PERIOD).expect("a filter that can be assured");
        let (mut x, mut u) = ([0.0, 0.0, random.between(-0.3, 0.6), 0.0], [0.0; 2]);
        let mut derivative = SampleDerivative::default();
        for k in 0..800 {
            let t = f64::from(k) * PERIOD;
            let mut u_ref = wanted(vehicle, k as u64 / 60 % 5, x, bounds, &mut random);
            // Inside, what is possible and not comfortable.
            if k > 450 && k / 25 % 2 == 0 {
                u_ref = bounds.map(|b| if k / 50 % 2 == 0 { 0.9 * b } else { -0.9 * b });
            }
            if k % 3 == 0 {
                let (dx, du_ref): ([f64; 4], [f64; 2]) = (
                    core::array::from_fn(|_| random.between(-1.0, 1.0)),
                    core::array::from_fn(|_| random.between(-1.0, 1.0)),
                );
                let direction = Direction { x: &dx, u: &du_ref };
                let given = filter
                    .differentiate(t, &x, &u_ref, direction, &mut derivative)
                    .expect("right dimensions");
                let mut look = |by: f64| {
                    let (x, u_ref): ([f64; 4], [f64; 2]) = (
                        core::array::from_fn(|i| x[i] + by * dx[i]),
                        core::array::from_fn(|i| u_ref[i] + by * du_ref[i]),
                    );
                    let mut u = [0.0; 2];
                    let driver = filter
                        .peek(t, &x, &u_ref, &mut u)
                        .expect("right dimensions")
                        .assurance
                        .expect("plans")
                        .driver;
                    (driver, [u[0], u[1], filter.report().barriers[0].slack])
                };
                let [(before, low), (driver, here), (after, high)] = [-STEP, 0.0, STEP].map(&mut look);
                let found = [derivative.u[0], derivative.u[1], derivative.barriers[0].slack];
                let bend = (0..3).map(|i| (low[i] - 2.0 * here[i] + high[i]).abs()).fold(0.0, f64::max);
                assert_eq!(given, None, "{run} {t}");
                let is_near = |i: usize| {
                    let by = (high[i] - low[i]) / (2.0 * STEP);
                    (found[i] - by).abs() <= ALLOWED * (1.0 + by.abs())
                };
                let at_bound = u_ref.iter().zip(bounds).any(|(u, bound)| (u.abs() - bound).abs() <= STEP);
                if before != driver || after != driver || bend > 1e-3 * STEP || at_bound {
                    // Another piece begins within the step.
                    elsewhere += 1;
                } else if (0..3).all(is_near) {
                    compared[driver as usize] += 1;
                } else {
                    // A plan that is new, or by feedback.
                    assert!(
                        matches!(driver, Driver::Between | Driver::Plan),
                        "{run} {t} {driver:?}: {found:?}"
                    );
                    held += 1;
                }
            }
            assert!(filter.step(t, &x, &u_ref, &mut u).expect("right dimensions").is_assured(), "{run} {t}");
            x = vehicle.move_by(x, u, PERIOD);
        }
    }
    println!("compared by driver {compared:?}, another piece {elsewhere}, of a plan held {held}");
    let [reference, rows, _, between, plan] = compared;
    assert!([reference, rows, between, plan].iter().all(|n| *n >= 5), "{compared:?}");
    let all = compared.iter().sum::<u32>();
    assert!(2 * elsewhere < all && 10 * held < all, "{elsewhere} {held} of {all}");
}

/// Without a measurement for a while, or a wanted input that is a number, the plan brings the vehicle there.
#[test]
fn a_plan_goes_on_without_a_measurement() {
    let vehicle = Vehicle::Unicycle;
    let mut filter = vehicle.assured(8.0, [6.0, 2.0]);
    let (mut x, mut u) = ([0.0, 0.0, -0.4, 1.0], [0.0; 2]);
    for k in 0..600 {
        let t = f64::from(k) * PERIOD;
        let seen = if k > 20 && k % 50 != 0 { [f64::NAN; 4] } else { x };
        let wish = if k % 3 == 0 { [f64::NAN; 2] } else { [6.0, -1.0] };
        let assurance =
            filter.step(t, &seen, &wish, &mut u).expect("right dimensions").assurance.expect("plans");
        assert!(assurance.is_assured(), "{t}: {assurance:?}");
        x = vehicle.move_by(x, u, PERIOD);
        let distance = |c: [f64; 2]| (x[0] - c[0]).hypot(x[1] - c[1]);
        assert!(distance(OBSTACLE.0) >= OBSTACLE.1 && (t < 8.0 || distance(GOAL.0) <= GOAL.1), "{t}: {x:?}");
    }
}

#[test]
fn a_plant_that_is_not_the_model_ends_the_promise() {
    let mut filter = Vehicle::PointMass.assured(4.5, [8.0; 2]);
    let mut u = [0.0; 2];
    assert!(filter.step(0.0, &[0.0; 4], &[0.0; 2], &mut u).expect("right dimensions").is_assured());
    // Somebody has carried it away.
    let away = filter
        .step(PERIOD, &[-40.0, -40.0, 0.0, 0.0], &[0.0; 2], &mut u)
        .expect("right dimensions")
        .assurance
        .expect("plans");
    assert!(away.status == AssuranceStatus::Lost && away.failure.is_some(), "{away:?}");
}

#[test]
fn filters_that_plans_do_not_account_for_are_refused() {
    let disc = || DistanceDisc::new(GOAL.0, GOAL.1, 1.0).expect("valid disc");
    let refused = |settings: BarrierSettings, change: fn(FilterBuilder) -> FilterBuilder| {
        let builder = Filter::builder(PointMass).barrier("goal", disc(), settings).expect("valid");
        let filter = change(builder.erased()).build().expect("valid filter");
        filter.with_plans(PERIOD).err().map(|error| error.to_string()).unwrap_or_default()
    };
    let within = BarrierSettings::within(5.0);
    let delayed = refused(within, |b| b.actuation_delay(0.01).expect("a delay"));
    assert_eq!(delayed, "");
    let late = refused(BarrierSettings::within(6.0), |b| b.actuation_delay(5.01).expect("a delay"));
    assert_eq!(late, "actuation_delay: is 5.01, must be <= 250 times period = 0.02 for a plan");
    let erring = refused(within, |b| b.measurement_errors(&[0.1, 0.1, 0.0, 0.0]).expect("errors"));
    assert_eq!(erring, "");
    let disturbed = refused(within.disturbance(0.1), |b| b);
    assert_eq!(disturbed, "goal.disturbance: is 0.1, must be 0 for a plan");
    let later = refused(within, |b| b.window(Begin::At(1.0), End::Never).expect("a window"));
    assert_eq!(later, "");
    let after = |settings| {
        let builder = Filter::builder(PointMass).barrier("first", disc(), within).expect("valid");
        let builder = builder.barrier("goal", disc(), settings).expect("valid");
        let builder = builder.window(Begin::AfterArrival(0), End::Never).expect("a window");
        let plans = builder.build().expect("valid filter").with_plans(PERIOD);
        plans.err().map(|error| error.to_string()).unwrap_or_default()
    };
    assert_eq!(after(BarrierSettings::within(6.0)), "");
    let when = "goal.begin: is the arrival of another barrier, which needs a deadline for a plan: when it arrives is open";
    assert_eq!(after(BarrierSettings::keeping()), when);
    assert_eq!(
        refused(BarrierSettings::keeping(), |b| b.window(Begin::At(1.0), End::Never).expect("a window")),
        ""
    );
    assert_eq!(refused(within, |b| b), "");
    let moving =
        QuadraticDisc::new(GOAL.0, GOAL.1).expect("valid disc").moving([1.0, 0.0]).expect("a velocity");
    let filter = Filter::builder(PointMass)
        .barrier("goal", moving, within)
        .and_then(FilterBuilder::build)
        .expect("valid filter");
    let moves = filter.with_plans(PERIOD).err().map(|error| error.to_string());
    assert_eq!(
        moves.as_deref(),
        Some("goal.source: moves with time, so that no plan ends; with a horizon one may end earlier")
    );
}

/// Obstacles that cross the way at constant velocity, and one that comes by where the vehicle has come to rest.
#[test]
fn obstacles_that_move_are_kept_away_from() {
    let mut random = Random(31);
    let mut accepted = 0;
    for run in 0..30 {
        let vehicle = [Vehicle::PointMass, Vehicle::Unicycle][run % 2];
        let bounds = [random.between(2.0, 5.0), random.between(1.0, 3.0)];
        let deadline = random.between(6.0, 9.0);
        let radius = random.between(0.5, 2.0);
        // Where it is, and when: on the way, or beside the goal long after.
        let (part, when) = if run % 3 == 0 {
            (random.between(0.9, 1.2), random.between(deadline + 1.0, deadline + 6.0))
        } else {
            (random.between(0.3, 0.8), random.between(1.0, deadline - 1.0))
        };
        let velocity: [f64; 2] = core::array::from_fn(|_| random.between(-2.0, 2.0));
        let start: [f64; 2] = core::array::from_fn(|i| part * GOAL.0[i] - when * velocity[i]);
        let disc = DistanceDisc::new(start, radius, 1.0).and_then(|disc| disc.moving(velocity));
        let clear = Outside(disc.expect("valid disc"));
        let goal = DistanceDisc::new(GOAL.0, GOAL.1, 1.0).expect("valid disc");
        let (within, keeping) = (BarrierSettings::within(deadline), BarrierSettings::keeping());
        let filter = vehicle
            .sets((goal, within), Some((clear, keeping)))
            .and_then(|b| b.bounds(&bounds.map(|b| -b), &bounds))
            .and_then(|b| b.sampling(Sampling::Period(PERIOD)))
            .and_then(FilterBuilder::build)
            .expect("valid filter");
        let mut filter = filter.with_plans(PERIOD).expect("a filter that can be assured");
        let (mut x, mut u) = ([0.0, 0.0, random.between(-0.5, 0.5), random.between(0.0, 1.0)], [0.0; 2]);
        for k in 0..900 {
            let t = f64::from(k) * PERIOD;
            let to = [0, 1].map(|i| start[i] + t * velocity[i] - x[i]);
            let u_ref = match (k % 100 < 50, vehicle) {
                (true, Vehicle::PointMass) => to,
                (true, Vehicle::Unicycle) => [bounds[0], 4.0 * (to[1].atan2(to[0]) - x[2]).sin()],
                (false, _) => wanted(vehicle, run as u64 % 5, x, bounds, &mut random),
            };
            let assurance =
                filter.step(t, &x, &u_ref, &mut u).expect("right dimensions").assurance.expect("plans");
            if k == 0 && assurance.status == AssuranceStatus::Refused {
                println!("refused: {run} {:?}", assurance.failure);
                break;
            }
            accepted += i32::from(k == 0);
            assert!(assurance.is_assured(), "{run} {t}: {assurance:?}");
            for part in 1..=20 {
                let dt = PERIOD * f64::from(part) / 20.0;
                let (after, x) = (t + dt, vehicle.move_by(x, u, dt));
                let away = |i: usize| x[i] - start[i] - after * velocity[i];
                assert!(away(0).hypot(away(1)) >= radius - 1e-9, "{run} {after}: {x:?}");
                let from = (x[0] - GOAL.0[0]).hypot(x[1] - GOAL.0[1]);
                assert!(after < deadline || from <= GOAL.1 + 1e-9, "{run} {after}: {x:?}");
            }
            x = vehicle.move_by(x, u, PERIOD);
        }
    }
    println!("obstacles that move: {accepted} of 30 accepted");
    assert!(accepted >= 20, "{accepted}");
}

/// A place that is forbidden from some time on: it is left before, and not entered after, from inside, and past it.
#[test]
fn what_begins_later_is_kept_from_then_on() {
    let mut random = Random(23);
    let (mut accepted, mut began_in) = (0, 0);
    for run in 0..30 {
        let vehicle = [Vehicle::PointMass, Vehicle::Unicycle][run % 2];
        let bounds = [random.between(2.0, 5.0), random.between(1.0, 3.0)];
        let (begin, deadline) = (random.between(1.5, 6.0), random.between(6.0, 9.0));
        // Every third time the start is in it.
        let reach = if run % 3 == 0 { [0.3, 0.3] } else { [14.0, 9.0] };
        let place = reach.map(|most| random.between(-0.3, most));
        let radius = random.between(0.5, 2.5);
        let disc = |centre, radius| DistanceDisc::new(centre, radius, 1.0).expect("valid disc");
        let (goal, clear) = (disc(GOAL.0, GOAL.1), Outside(disc(place, radius)));
        let within = BarrierSettings::within(deadline);
        let filter = vehicle
            .sets((goal, within), Some((clear, BarrierSettings::keeping())))
            .and_then(|b| b.window(Begin::At(begin), End::Never))
            .and_then(|b| b.bounds(&bounds.map(|b| -b), &bounds))
            .and_then(|b| b.sampling(Sampling::Period(PERIOD)))
            .and_then(FilterBuilder::build)
            .expect("valid filter");
        let mut filter = filter.with_plans(PERIOD).expect("a filter that can be assured");
        let (mut x, mut u) = ([0.0, 0.0, random.between(-0.5, 0.5), random.between(0.0, 1.0)], [0.0; 2]);
        let away = |x: [f64; 4], c: [f64; 2]| (x[0] - c[0]).hypot(x[1] - c[1]);
        let is_in = away(x, place) < radius;
        for k in 0..600 {
            let t = f64::from(k) * PERIOD;
            let to = [place[0] - x[0], place[1] - x[1]];
            let u_ref = match (k % 100 < 50, vehicle) {
                (true, Vehicle::PointMass) => to,
                (true, Vehicle::Unicycle) => [bounds[0], 4.0 * (to[1].atan2(to[0]) - x[2]).sin()],
                (false, _) => wanted(vehicle, run as u64 % 5, x, bounds, &mut random),
            };
            let assurance =
                filter.step(t, &x, &u_ref, &mut u).expect("right dimensions").assurance.expect("plans");
            if k == 0 && assurance.status == AssuranceStatus::Refused {
                break;
            }
            accepted += i32::from(k == 0);
            began_in += i32::from(k == 0 && is_in);
            assert!(assurance.is_assured(), "{run} {t}: {assurance:?}");
            assert!(filter.report().barriers.iter().all(|b| b.guaranteed), "{run} {t}");
            for part in 1..=20 {
                let (after, x) = (
                    t + PERIOD * f64::from(part) / 20.0,
                    vehicle.move_by(x, u, PERIOD * f64::from(part) / 20.0),
                );
                assert!(after < begin || away(x, place) >= radius - 1e-9, "{run} {after}: {x:?}");
                assert!(after < deadline || away(x, GOAL.0) <= GOAL.1 + 1e-9, "{run} {after}: {x:?}");
            }
            x = vehicle.move_by(x, u, PERIOD);
        }
    }
    println!(
        "begins later: {accepted} of 30 accepted, {began_in} of them from inside what is forbidden then"
    );
    assert!(accepted >= 20 && began_in >= 2, "{accepted} {began_in}");
}

#[test]
fn one_plan_is_of_one_plant() {
    let disc = || DistanceDisc::new(GOAL.0, GOAL.1, 1.0).expect("valid disc");
    let (settings, plant) = (BarrierSettings::within(5.0), Arc::new(Unicycle));
    let refusal = |also| {
        let filter = Filter::from_sources(4, 2)
            .source("goal", along(Arc::clone(&plant), disc(), 2).expect("a source"), settings)
            .and_then(|b| b.source("also", also, settings))
            .and_then(FilterBuilder::build)
            .expect("valid filter");
        filter.with_plans(PERIOD).err().map(|e| e.to_string())
    };
    assert_eq!(refusal(along(Arc::clone(&plant), disc(), 2).expect("a source")), None);
    for other in [along(Arc::new(PointMass), disc(), 2), along(Arc::new(Unicycle), disc(), 2)] {
        let message =
            "also.source: is along another plant than that of goal; a plan needs one plant for all barriers";
        assert_eq!(refusal(other.expect("a source")).as_deref(), Some(message));
    }
}

/// Long holds and fast vehicles: an obstacle between two nodes is seen.
#[test]
fn a_plan_does_not_jump_over_an_obstacle() {
    let mut found = 0;
    for (deadline, radius) in [(60.0, 1.0), (40.0, 0.3), (30.0, 0.05)] {
        let disc = |centre, radius, b| DistanceDisc::new(centre, radius, b).expect("valid disc");
        let filter = Filter::builder(PointMass)
            .barrier("goal", disc([500.0, 0.0], 3.0, 1.0), BarrierSettings::within(deadline))
            .and_then(|b| {
                let clear = Outside(disc([251.3, 0.0], radius, radius));
                b.barrier("clear", clear, BarrierSettings::keeping())
            })
            .and_then(|b| b.bounds(&[-6.0; 2], &[6.0; 2]))
            .and_then(|b| b.sampling(Sampling::Period(PERIOD)))
            .and_then(FilterBuilder::build)
            .expect("valid filter");
        let filter = filter.with_plans(PERIOD).expect("a filter that can be assured");
        // Headed for its middle; where a plan is found, it goes around.
        let mut x = [0.0, 0.0, 20.0, 0.0];
        let Ok(backup_plan) = filter.planning().expect("plans").plan_from(0.0, &x, 1.0) else { continue };
        found += 1;
        let (mut t, mut nearest) = (0.0, f64::INFINITY);
        for (end, u) in &backup_plan.inputs {
            let steps = ((end - t) / 1e-3).round().max(1.0);
            for _ in 0..steps as usize {
                x = Vehicle::PointMass.move_by(x, [u[0], u[1]], (end - t) / steps);
                nearest = (x[0] - 251.3).hypot(x[1]).min(nearest);
            }
            t = *end;
        }
        assert!(nearest >= radius, "{deadline}: {nearest} m from the centre of {radius} m");
        assert!((x[0] - 500.0).hypot(x[1]) <= 3.0, "{deadline}: {x:?}");
    }
    assert!(found >= 2, "{found} plans: the cases show nothing");
}

/// Seconds since 1970 are no multiples of a period in binary.
#[test]
fn any_time_is_a_time_to_begin() {
    let vehicle = Vehicle::PointMass;
    for (begin, period) in [(1.7e9, 0.005), (-4.1e5, 0.05)] {
        let disc = DistanceDisc::new([6.0, 3.0], 1.0, 1.0).expect("valid disc");
        let filter = Filter::builder(PointMass)
            .barrier("goal", disc, BarrierSettings::within(4.0))
            .and_then(|b| b.bounds(&[-5.0; 2], &[5.0; 2]))
            .and_then(|b| b.sampling(Sampling::Period(period)))
            .and_then(FilterBuilder::build)
            .expect("valid filter");
        let mut filter = filter.with_plans(period).expect("a filter that can be assured");
        let (mut x, mut u) = ([0.0, 0.0, -1.0, 0.5], [0.0; 2]);
        for k in 0..(6.0 / period) as usize {
            let t = k as f64 * period;
            let assurance = filter
                .step(begin + t, &x, &[-50.0, -50.0], &mut u)
                .expect("right dimensions")
                .assurance
                .expect("plans");
            assert!(assurance.is_assured(), "{begin} + {t}: {assurance:?}");
            x = vehicle.move_by(x, u, period);
            let outside = (x[0] - 6.0).hypot(x[1] - 3.0) - 1.0;
            assert!(t + period < 4.0 || outside <= 0.0, "{begin} + {t}: {outside} m outside");
        }
    }
    // Where times cannot tell samples apart, nothing is promised.
    let mut filter = vehicle.assured(8.0, [8.0; 2]);
    let mut u = [0.0; 2];
    let first = filter.step(1e16, &[0.0; 4], &[0.0; 2], &mut u).map(|a| a.is_assured());
    let next = filter.step(1e16, &[0.0; 4], &[0.0; 2], &mut u).map(|a| a.is_assured());
    assert!(!(first.expect("right dimensions") && next.expect("right dimensions")));
}

#[test]
fn what_cannot_be_promised_is_not() {
    // Outside without a deadline nothing is promised, so nothing is assured.
    let filter = |settings| {
        let disc = DistanceDisc::new(GOAL.0, GOAL.1, 1.0).expect("valid disc");
        let filter = Filter::builder(PointMass)
            .barrier("goal", disc, settings)
            .and_then(|b| b.bounds(&[-8.0; 2], &[8.0; 2]))
            .and_then(FilterBuilder::build)
            .expect("valid filter");
        filter.with_plans(PERIOD).expect("a filter that can be assured")
    };
    let mut u = [0.0; 2];
    let mut keeping = filter(BarrierSettings::keeping());
    let assurance =
        keeping.step(0.0, &[0.0; 4], &[0.0; 2], &mut u).expect("right dimensions").assurance.expect("plans");
    assert_eq!((assurance.status, assurance.failure), (AssuranceStatus::Refused, Some(Failure::Nothing)));
    assert!(keeping.planning().expect("plans").promised(0.0, &[0.0; 4]).eq([false]));
    assert!(keeping.planning().expect("plans").promised(0.0, &[GOAL.0[0], GOAL.0[1], 0.0, 0.0]).eq([true]));
    // A search that has no end is ended, with or without something to find.
    assert_eq!(keeping.planning().expect("plans").earliest_deadline(0.0, &[0.0; 4], f64::INFINITY), None);
    let reached = filter(BarrierSettings::within(1e-3)).planning().expect("plans").earliest_deadline(
        0.0,
        &[0.0; 4],
        f64::INFINITY,
    );
    assert!(reached.is_some_and(|(factor, _)| (2.0e3..2.0e4).contains(&factor)));
    assert!(
        filter(BarrierSettings::within(1e30))
            .planning()
            .expect("plans")
            .plan_from(0.0, &[0.0; 4], 1.0)
            .is_err()
    );
    // A state of another plant, or with inputs of other bounds, is refused or kept within its own.
    let mut wide = Vehicle::PointMass.assured(8.0, [12.0; 2]);
    wide.step(0.0, &[0.0, 0.0, -3.0, 2.0], &[0.0; 2], &mut u).expect("right dimensions");
    let state = wide.state().clone();
    assert!(filter(BarrierSettings::within(5.0)).restore(&state).is_err());
    let mut narrow = Vehicle::PointMass.assured(8.0, [1.0; 2]);
    narrow.restore(&state).expect("as many barriers");
    for k in 1..200 {
        narrow.step(f64::from(k) * PERIOD, &[f64::NAN; 4], &[0.0; 2], &mut u).expect("right dimensions");
        assert!(u.iter().all(|u| u.abs() <= 1.0), "{u:?}");
    }
    // The report is that of what was restored, or of nothing.
    assert!(narrow.assurance().expect("plans").is_assured());
    narrow.rearm();
    assert!(!narrow.assurance().expect("plans").is_assured());
}

/// The paper's vehicle, whose angle is an integral: the plant is given its mean, within its limits and its rate.
#[test]
fn plans_stand_behind_an_integral_too() {
    const LENGTH: f64 = 10.0;
    const LIMITS: [f64; 2] = [-0.5, 0.5];
    let rate = |x: [f64; 4], u: [f64; 2]| {
        let (sin, cos) = x[2].sin_cos();
        [x[3] * (cos - sin * u[1]), x[3] * (sin + cos * u[1]), x[3] * u[1] / LENGTH, u[0]]
    };
    let (mut accepted, mut compared, deadline, period) = (0, [0; 2], 5.0, 0.05);
    let seeds = draws(4, 8);
    for seed in 1..=seeds {
        let random = &mut Random(0x9e37_79b9_7f4a_7c15_u64.wrapping_mul(seed));
        let goal = DistanceDisc::new([45.0, 45.0], 2.0, 2.0).expect("valid disc");
        let model = SmallSlipBicycle::new(LENGTH).expect("a length").with_rate();
        let filter = Filter::builder(model)
            .barrier("goal", goal, BarrierSettings::within(deadline).margin(0.02))
            .and_then(|b| b.bounds(&[-40.0, -4.0], &[40.0, 4.0]))
            .and_then(|b| b.sampling(Sampling::Period(period)))
            .and_then(FilterBuilder::build)
            .and_then(|filter| {
                filter.with_integrator(Integration { state: 4, input: 1, limits: LIMITS, gain: 10.0 })
            })
            .expect("valid filter");
        let mut filter = filter.with_plans(period).expect("a filter that can be assured");
        let [x, y] = [0, 1].map(|_| random.between(0.0, 90.0));
        let mut x = [x, y, random.between(-3.0, 3.0), random.between(0.0, 20.0)];
        let mut before = 0.0;
        for k in 0..(2.0 * deadline / period) as usize {
            let t = k as f64 * period;
            let u_ref = match seed % 3 {
                0 => [0.0; 2],
                1 => [40.0, 0.5],
                _ => [random.between(-40.0, 40.0), random.between(-0.5, 0.5)],
            };
            let mut u = [0.0; 2];
            // How the mean follows what is wanted of it, not at all beyond its limits.
            let mut look = |by: f64| {
                let u_ref = [u_ref[0], u_ref[1] + by];
                let driver = filter
                    .peek(t, &x, &u_ref, &mut u)
                    .expect("right dimensions")
                    .assurance
                    .expect("plans")
                    .driver;
                (driver, u[1])
            };
            let [(before_it, low), (driver, here), (after_it, high)] = [-1e-6, 0.0, 1e-6].map(&mut look);
            let direction = Direction { x: &[0.0; 4], u: &[0.0, 1.0] };
            let mut derivative = SampleDerivative::default();
            let given = filter.differentiate(t, &x, &u_ref, direction, &mut derivative);
            assert_eq!(given.expect("right dimensions"), None);
            if [before_it, after_it] == [driver; 2] && (low - 2.0 * here + high).abs() < 1e-9 {
                let by = (high - low) / 2e-6;
                assert!(
                    (derivative.u[1] - by).abs() < 1e-3,
                    "{seed} {t} {driver:?}: {} {by}",
                    derivative.u[1]
                );
                compared[usize::from(by == 0.0)] += 1;
            }
            let assurance =
                filter.step(t, &x, &u_ref, &mut u).expect("right dimensions").assurance.expect("plans");
            if k == 0 && !assurance.is_assured() {
                break;
            }
            accepted += u64::from(k == 0);
            assert!(assurance.is_assured(), "{seed} at {t}: {assurance:?}");
            // The angle is the mean over the period, of an integral with its limits and its rate.
            assert!((LIMITS[0]..=LIMITS[1]).contains(&filter.integrated()), "{}", filter.integrated());
            assert!((filter.integrated() - before).abs() <= 4.0 * period + 1e-12 && u[0].abs() <= 40.0);
            assert!((u[1] - 0.5 * (before + filter.integrated())).abs() < 1e-12, "{u:?}");
            before = filter.integrated();
            for part in 1..=20 {
                let at = |k: [f64; 4], s: f64| std::array::from_fn(|i| x[i] + s * k[i]);
                let dt = period / 20.0;
                let a = rate(x, u);
                let b = rate(at(a, dt / 2.0), u);
                let c = rate(at(b, dt / 2.0), u);
                let d = rate(at(c, dt), u);
                x = std::array::from_fn(|i| x[i] + dt / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]));
                let (t, away) = (t + dt * f64::from(part), (x[0] - 45.0).hypot(x[1] - 45.0));
                assert!(t < deadline || away <= 2.0, "{seed} at {t}: {away} m from the centre");
            }
        }
    }
    assert!(compared.iter().all(|n| *n >= 5), "{compared:?}");
    assert!(accepted + 1 >= seeds, "{accepted} of {seeds} accepted");
}

/// Every state of a plant without drift is a rest: there is nothing to brake.
#[test]
fn a_point_moved_by_its_velocity_is_promised_what_it_can_do() {
    let speed = 5.0;
    let filter = |deadline: f64| {
        let disc = DistanceDisc::new(GOAL.0, GOAL.1, 1.0).expect("valid disc");
        let filter = Filter::builder(MovedPoint)
            .barrier("goal", disc, BarrierSettings::within(deadline))
            .and_then(|b| b.bounds(&[-speed; 2], &[speed; 2]))
            .and_then(|b| b.sampling(Sampling::Period(PERIOD)))
            .and_then(FilterBuilder::build)
            .expect("valid filter");
        filter.with_plans(PERIOD).expect("a filter that can be assured")
    };
    // Not the origin: there a difference has no round-off.
    let (mut x, mut u) = ([1.0, -3.0], [0.0; 2]);
    // The nearest point of the disc along x is more than 17.5 m away, 3.5 s.
    assert!(!filter(3.4).step(0.0, &x, &[0.0; 2], &mut u).expect("right dimensions").is_assured());
    let mut filter = filter(5.0);
    let inside = |x: [f64; 2]| (x[0] - GOAL.0[0]).hypot(x[1] - GOAL.0[1]) <= GOAL.1;
    for k in 0..500 {
        let t = f64::from(k) * PERIOD;
        assert!(t < 5.0 - PERIOD / 2.0 || inside(x), "{x:?} at {t}");
        let assurance = filter
            .step(t, &x, &[-speed, -speed], &mut u)
            .expect("right dimensions")
            .assurance
            .expect("plans");
        assert!(assurance.is_assured() && u.iter().all(|u| u.abs() <= speed), "{assurance:?} at {t}");
        x = [0, 1].map(|i| x[i] + PERIOD * u[i]);
    }
}

/// A wall of discs, at x and of a radius in m, with its only near gap at y = 16.8; and the goal behind it, for a point mass.
const WALL: [f64; 2] = [8.0, 1.5];
const BEHIND: ([f64; 2], f64) = ([14.0, 0.0], 1.0);

fn wall() -> impl Iterator<Item = f64> {
    (-12..=12).map(|k| f64::from(k) * 2.4).filter(|y| (y - 16.8).abs() > 1.3)
}

fn behind_a_wall(plans: Plans) -> Filter {
    const BOUND: f64 = 4.0;
    let disc = |(centre, radius)| DistanceDisc::new(centre, radius, 1.0).expect("valid disc");
    let within = BarrierSettings::within(20.0).margin(0.01);
    let keeping = BarrierSettings::keeping().margin(0.01);
    let mut builder = Filter::builder(PointMass).barrier("goal", disc(BEHIND), within).expect("a goal");
    for (i, y) in wall().enumerate() {
        let clear = Outside(disc(([WALL[0], y], WALL[1])));
        builder = builder.barrier(&format!("wall_{i}"), clear, keeping).expect("an obstacle");
    }
    let builder =
        builder.bounds(&[-BOUND; 2], &[BOUND; 2]).and_then(|b| b.sampling(Sampling::Period(PERIOD)));
    builder.and_then(FilterBuilder::build).expect("valid").with_plans(plans).expect("plans")
}

/// To a point before the gap, to one behind it, to the goal: at a moderate speed, damped.
fn through_the_gap(x: &[f64], u: &mut [f64]) {
    let target = match (x[0], x[1]) {
        (px, py) if px < 5.5 && py < 14.8 => [2.0, 16.8],
        (px, _) if px < 10.0 => [11.5, 16.8],
        _ => BEHIND.0,
    };
    for i in 0..2 {
        u[i] = 1.5 * (target[i] - x[i]).clamp(-2.5, 2.5) - 1.5 * x[2 + i];
    }
}

fn is_clear_of_the_wall(x: [f64; 4]) -> bool {
    wall().all(|y| (x[0] - WALL[0]).hypot(x[1] - y) > WALL[1])
}

#[test]
fn a_policy_shows_the_way_through_a_gap() {
    let start = [0.0; 4];
    assert!(
        behind_a_wall(Plans::every(PERIOD)).planning().expect("plans").plan_from(0.0, &start, 1.0).is_err(),
        "the search finds the gap by itself, so this shows nothing"
    );
    let mut filter = behind_a_wall(Plans::every(PERIOD).policy(|_, x, u| through_the_gap(x, u)));
    let mut x = start;
    for k in 0..(24.0 / PERIOD) as usize {
        let (t, mut u) = (k as f64 * PERIOD, [0.0; 2]);
        let assurance =
            filter.step(t, &x, &[1.0, -1.0], &mut u).expect("right dimensions").assurance.expect("plans");
        assert!(assurance.is_assured(), "at {t}: {assurance:?}");
        x = Vehicle::PointMass.move_by(x, u, PERIOD);
        assert!(is_clear_of_the_wall(x), "at {t}: {x:?}");
        if t > 20.0 {
            assert!((x[0] - BEHIND.0[0]).hypot(x[1] - BEHIND.0[1]) < BEHIND.1, "at {t}: {x:?}");
        }
    }
}

/// The policy helps once. Armed again on the way, no search finds a plan, and the current one will do: also one that was
/// followed meanwhile because the state was unknown, and one that was put back.
#[test]
fn armed_again_it_goes_on_with_the_plan_at_hand() {
    // A minute: with the tables.
    if draws(0, 1) == 0 {
        return;
    }
    let helps = Arc::new(AtomicBool::new(true));
    let made = || {
        let helps = Arc::clone(&helps);
        let plans = Plans::every(PERIOD).search_budget(1);
        behind_a_wall(plans.policy(move |_, x, u| match helps.load(Ordering::Relaxed) {
            true => through_the_gap(x, u),
            false => u.fill(0.0),
        }))
    };
    for unknown in [0, 7] {
        helps.store(true, Ordering::Relaxed);
        let (mut filter, mut blind) = (made(), made());
        let (mut x, mut u, again) = ([0.0; 4], [0.0; 2], 40);
        let wish = [1.0, -1.0];
        for k in 0..(23.0 / PERIOD) as usize {
            let t = k as f64 * PERIOD;
            if k == again {
                helps.store(false, Ordering::Relaxed);
                // Whatever comes next, this far it is one run.
                let finds = || {
                    let searching = behind_a_wall(Plans::every(PERIOD));
                    searching.planning().expect("plans").plan_from(t, &x, 1.0).is_ok()
                };
                assert!(unknown > 0 || !finds(), "a search finds the gap from {x:?}");
                // What it would do were it not armed again.
                blind.restore(filter.state()).expect("a state of its own");
                filter.rearm();
                let state = filter.state().clone();
                filter = made();
                filter.restore(&state).expect("a state of its own");
            }
            let is_unknown = (again..again + unknown).contains(&k);
            let seen = if is_unknown { [f64::NAN; 4] } else { x };
            let assurance =
                filter.step(t, &seen, &wish, &mut u).expect("right dimensions").assurance.expect("plans");
            if is_unknown {
                let mut other = [0.0; 2];
                blind.step(t, &seen, &wish, &mut other).expect("right dimensions");
                assert_eq!((u, assurance.driver), (other, Driver::Plan), "at {t}");
                assert_eq!((assurance.status, assurance.until), (AssuranceStatus::Undecided, None), "at {t}");
                assert!(filter.report().barriers.iter().all(|b| !b.guaranteed), "at {t}");
            } else {
                assert!(assurance.is_assured(), "{unknown} unknown, at {t}: {assurance:?}");
            }
            x = Vehicle::PointMass.move_by(x, u, PERIOD);
            assert!(is_clear_of_the_wall(x), "at {t}: {x:?}");
            if t > 20.0 + (again + unknown) as f64 * PERIOD {
                assert!((x[0] - BEHIND.0[0]).hypot(x[1] - BEHIND.0[1]) < BEHIND.1, "at {t}: {x:?}");
            }
        }
    }
    // From where the plan keeps nothing it is of no use, and once refused it is gone.
    let (mut filter, mut u) = (made(), [0.0; 2]);
    let steps = [
        ([0.0; 4], AssuranceStatus::Assured),
        ([-200.0, 0.0, 0.0, 0.0], AssuranceStatus::Refused),
        ([0.0; 4], AssuranceStatus::Refused),
    ];
    for (k, (x, status)) in (0..).zip(steps) {
        helps.store(k == 0, Ordering::Relaxed);
        filter.rearm();
        let assurance = filter
            .step(f64::from(k) * PERIOD, &x, &[0.0; 2], &mut u)
            .expect("right dimensions")
            .assurance
            .expect("plans");
        assert_eq!(assurance.status, status, "{k}");
    }
}

/// The hold that a sample is told is that of the one before, whatever the period of the filter: so it is after it was armed
/// again, and the plan is followed for as long as nobody knows the state.
#[test]
fn armed_again_between_samples_of_another_period_it_follows_the_plan() {
    let (mut filter, mut x, mut u) = (Vehicle::PointMass.assured(8.0, [8.0; 2]), [0.0; 4], [0.0; 2]);
    for k in 0..60_u32 {
        let t = f64::from(k) * 0.8 * PERIOD;
        if k == 20 {
            filter.rearm();
        }
        let is_unknown = (20..26).contains(&k);
        let seen = if is_unknown { [f64::NAN; 4] } else { x };
        let hold = filter.usual_hold(t).expect("plans");
        filter.expect_hold(Some(hold)).expect("a time");
        let assurance =
            filter.step(t, &seen, &[-3.0, 1.0], &mut u).expect("right dimensions").assurance.expect("plans");
        match is_unknown {
            true => assert_eq!(
                (assurance.status, assurance.driver),
                (AssuranceStatus::Undecided, Driver::Plan),
                "at {k}"
            ),
            false => assert!(assurance.is_assured(), "at {k}: {assurance:?}"),
        }
        x = Vehicle::PointMass.move_by(x, u, 0.8 * PERIOD);
    }
    // At another time than was said, samples begin again.
    filter.rearm();
    assert_eq!(filter.usual_hold(100.0), Some(PERIOD));
}

/// A tank that runs out at a rate of `self.0` times the root of its level, in m and s.
#[derive(Clone, Copy, Debug)]
struct Tank(f64);

impl ControlAffine<1, 1> for Tank {
    fn drift<S: Scalar>(&self, x: &[S; 1]) -> [S; 1] {
        [x[0].sqrt() * -self.0]
    }

    fn input_map<S: Scalar>(&self, _x: &[S; 1]) -> [[S; 1]; 1] {
        [[S::one()]]
    }
}

/// A number that grows by `self.0` of itself in a second, or dies away.
#[derive(Clone, Copy, Debug)]
struct FirstOrder(f64);

impl ControlAffine<1, 1> for FirstOrder {
    fn drift<S: Scalar>(&self, x: &[S; 1]) -> [S; 1] {
        [x[0] * self.0]
    }

    fn input_map<S: Scalar>(&self, _x: &[S; 1]) -> [[S; 1]; 1] {
        [[S::one()]]
    }
}

/// A motor: its speed and its current die away at these rates, and drive each other.
#[derive(Clone, Copy, Debug)]
struct Motor([f64; 2]);

impl ControlAffine<2, 1> for Motor {
    fn drift<S: Scalar>(&self, x: &[S; 2]) -> [S; 2] {
        [x[1] - x[0] * self.0[0], -(x[1] * self.0[1]) - x[0]]
    }

    fn input_map<S: Scalar>(&self, _x: &[S; 2]) -> [[S; 1]; 2] {
        [[S::zero()], [S::one()]]
    }
}

/// The first state is within `self.1` of `self.0`.
#[derive(Clone, Copy, Debug)]
struct Band(f64, f64);

impl<const NX: usize> Barrier<NX> for Band {
    fn value<S: Scalar>(&self, _t: S, x: &[S; NX]) -> S {
        -(x[0] - self.0).squared() + self.1 * self.1
    }
}

/// A plant with one input, from `from` to `band` by its deadline and twice as long, with inputs from `low` to `high`, held for
/// that deadline over `steps`: it is promised, and kept at all instants, whatever is wanted.
fn kept<P, const NX: usize>(
    plant: P,
    from: [f64; NX],
    band: Band,
    [low, high]: [f64; 2],
    (deadline, steps): (f64, u32),
    wish: u32,
) where
    P: ControlAffine<NX, 1> + Copy + Send + Sync + core::fmt::Debug + 'static,
{
    let period = deadline / f64::from(steps);
    let filter = Filter::builder(plant)
        .barrier("band", band, BarrierSettings::within(deadline))
        .and_then(|b| b.bounds(&[low], &[high]))
        .and_then(|b| b.sampling(Sampling::Period(period)))
        .and_then(FilterBuilder::build)
        .expect("valid filter");
    let mut filter = filter.with_plans(period).expect("plans");
    let mut x = from;
    for k in 0..2 * steps {
        let (t, mut u) = (f64::from(k) * period, [0.0]);
        let wanted = match wish {
            0 => 0.0,
            1 => low,
            2 => high,
            _ => {
                if k / 20 % 2 == 0 {
                    low
                } else {
                    high
                }
            }
        };
        let assurance =
            filter.step(t, &x, &[wanted], &mut u).expect("right dimensions").assurance.expect("plans");
        assert!(
            assurance.is_assured(),
            "{plant:?} from {from:?} to {band:?}, wish {wish}, at {t}: {assurance:?}"
        );
        assert!((low..=high).contains(&u[0]), "{u:?}");
        for part in 1..=10_u32 {
            x = rk4_step(&plant, &x, &u, period / 10.0);
            let now = t + f64::from(part) * period / 10.0;
            let away = (x[0] - band.0).abs() - band.1;
            // An integrator of our own beside that of the plan.
            assert!(now < deadline + 1e-9 || away <= 1e-9, "{plant:?} from {from:?}, at {now}: {away}");
        }
    }
}

/// A plant that stands still at few places only ends its plan at one in the set, not at the one that it began near: a tank
/// that is filled or emptied, what grows or dies away, a motor.
#[test]
fn a_plant_that_rests_elsewhere_is_promised() {
    for (seed, wish) in (1..=16_u64).zip((0..4).cycle()) {
        let random = &mut Random(0x9e37_79b9_7f4a_7c15_u64.wrapping_mul(seed));
        // A level that two thirds of the pump hold, from a tenth to nearly twice of it.
        let (rate, pump) = (random.between(0.05, 0.3), random.between(0.05, 0.3));
        let level = (0.66 * pump / rate) * (0.66 * pump / rate);
        let band = Band(level, random.between(0.05, 0.2) * level);
        let from = random.between(0.1, 1.8) * level;
        kept(Tank(rate), [from], band, [0.0, pump], (8.0 * level / pump, 150), wish);
        // Inputs that hold the number at no more than its start.
        let rate = random.between(-2.0, 2.0);
        let hold = 2.0 * rate.abs().max(0.1);
        let band = Band(random.between(-1.0, 1.0), 0.2);
        kept(FirstOrder(rate), [random.between(-1.0, 1.0)], band, [-hold, hold], (10.0 / hold, 150), wish);
        let motor = Motor([random.between(0.05, 1.0), random.between(0.3, 5.0)]);
        let hold = 1.0 + motor.0[0] * motor.0[1];
        let band = Band(random.between(-0.6, 0.6), 0.1);
        kept(
            motor,
            [random.between(-0.6, 0.6), 0.0],
            band,
            [-hold, hold],
            (8.0 / motor.0[0].max(0.5), 150),
            wish,
        );
    }
}

/// A pendulum without friction: its angle in rad from where it hangs, and its rate. g = 9.81 m/s2 over 1 m.
#[derive(Clone, Copy, Debug)]
struct Pendulum;

impl ControlAffine<2, 1> for Pendulum {
    fn drift<S: Scalar>(&self, x: &[S; 2]) -> [S; 2] {
        [x[1], x[0].sin() * -9.81]
    }

    fn input_map<S: Scalar>(&self, _x: &[S; 2]) -> [[S; 1]; 2] {
        [[S::zero()], [S::one()]]
    }
}

/// A steel ball below a magnet: its distance in m and its rate. The input is the square of the current, in some unit.
#[derive(Clone, Copy, Debug)]
struct Magnet;

impl ControlAffine<2, 1> for Magnet {
    fn drift<S: Scalar>(&self, x: &[S; 2]) -> [S; 2] {
        [x[1], S::from(9.81)]
    }

    fn input_map<S: Scalar>(&self, x: &[S; 2]) -> [[S; 1]; 2] {
        [[S::zero()], [-(S::one() / x[0].squared())]]
    }
}

/// What grows by `self.0 - x` of itself in a second, and is taken away at the rate of the input.
#[derive(Clone, Copy, Debug)]
struct Harvest(f64);

impl ControlAffine<1, 1> for Harvest {
    fn drift<S: Scalar>(&self, x: &[S; 1]) -> [S; 1] {
        [x[0] * (-x[0] + self.0)]
    }

    fn input_map<S: Scalar>(&self, x: &[S; 1]) -> [[S; 1]; 1] {
        [[-x[0]]]
    }
}

/// A search begins with a rest within the set too, and a plan may end under the law that leads there: the rest near the start is
/// far away, falls by itself, or is lost within a hold, and no input to either side comes near.
#[test]
fn a_plan_leads_to_an_equilibrium_within_the_set() {
    for (seed, wish) in (1..=8_u64).zip((0..4).cycle()) {
        let random = &mut Random(0x9e37_79b9_7f4a_7c15_u64.wrapping_mul(seed));
        let mut about = |value: f64| random.between(0.95, 1.05) * value;
        kept(
            FirstOrder(-about(0.027)),
            [about(0.33)],
            Band(about(2.1), 0.064),
            [0.0, 0.45],
            (14.2, 10),
            wish,
        );
        kept(Pendulum, [about(2.45), 0.0], Band(2.55, about(0.25)), [-8.3, 8.3], (6.1, 50), wish);
        kept(Magnet, [about(0.76), about(0.14)], Band(0.8, about(0.08)), [0.0, 11.7], (3.1, 10), wish);
        kept(Harvest(about(1.8)), [about(0.37)], Band(0.27, about(0.04)), [0.0, 1.75], (15.0, 400), wish);
    }
}

/// A tank that nobody fills runs dry, and from there no course tells what comes: a plan stops before, and what is promised is
/// not lost. Judged by a plant that stays empty.
#[test]
fn no_plan_lets_a_tank_run_dry() {
    let random = &mut Random(41);
    for round in 0..12 {
        let (rate, pump) = (random.between(0.1, 0.4), random.between(0.2, 0.6));
        let (limit, period) = (random.between(0.5, 2.0), random.between(0.1, 2.0));
        let mut x = limit * random.between(0.3, 0.99);
        let filter = Filter::builder(Tank(rate))
            .barrier("level", StateBound::at_most(0, limit).expect("a bound"), BarrierSettings::keeping())
            .and_then(|b| b.bounds(&[0.0], &[pump]))
            .and_then(|b| b.sampling(Sampling::Period(period)))
            .and_then(FilterBuilder::build)
            .expect("valid filter");
        let mut filter = filter.with_plans(period).expect("plans");
        for k in 0..300 {
            let (t, mut u) = (f64::from(k) * period, [0.0]);
            let assurance =
                filter.step(t, &[x], &[0.0], &mut u).expect("dimensions").assurance.expect("plans");
            assert!(assurance.is_assured(), "{round}, at {t}, {x}: {assurance:?}");
            for _ in 0..200 {
                // NaN is empty.
                x = rk4_step(&Tank(rate), &[x], &u, period / 200.0)[0].max(0.0);
            }
            assert!(x <= limit, "{round}, at {t}: {x}");
        }
    }
}

/// What begins at the edge of its set, or hardly inside, is promised with a margin that a plan resolves, and not lost to round-off.
#[test]
fn a_start_at_the_edge_is_not_lost_to_round_off() {
    let random = &mut Random(43);
    let mut assured = [0; 6];
    for round in 0..120 {
        let inside = [0.0, 1e-12, 1e-10, 1e-8, 1e-6, 1e-4][round % 6];
        let (limit, period) = (random.between(0.2, 0.9), 10.0_f64.powf(random.between(-2.0, -0.5)));
        let speed = [0.0, -1e-3, -0.1][round / 6 % 3];
        let edge = StateBound::at_most(0, limit).expect("a bound");
        let filter = Filter::builder(PointMass)
            .barrier("edge", edge, BarrierSettings::keeping())
            .and_then(|b| b.bounds(&[-1.0; 2], &[1.0; 2]))
            .and_then(|b| b.sampling(Sampling::Period(period)))
            .and_then(FilterBuilder::build)
            .expect("valid filter");
        let mut filter = filter.with_plans(period).expect("plans");
        let mut x = [limit - inside, 0.0, speed, 0.0];
        for k in 0..200 {
            let wish = if round % 2 == 0 { 1.0 } else { random.between(-1.0, 1.0) };
            let (t, mut u) = (f64::from(k) * period, [0.0; 2]);
            let assurance =
                filter.step(t, &x, &[wish, 0.0], &mut u).expect("dimensions").assurance.expect("plans");
            if k == 0 && !assurance.is_assured() {
                break;
            }
            assured[round % 6] += u32::from(k == 0);
            assert!(assurance.is_assured(), "{round}, {inside} inside, at {t}: {assurance:?}");
            x = Vehicle::PointMass.move_by(x, u, period);
            assert!(x[0] <= limit + 1e-15, "{round}, at {t}: {x:?}");
        }
    }
    assert!(assured.iter().all(|count| *count > 18), "{assured:?}");
}

/// A chain of `N` integrators at rest at the edge of a set, or hardly inside, that is to go elsewhere. Judged at all instants.
/// Returns how many of them are promised.
fn leaves_the_edge<const N: usize>(random: &mut Random, draws: usize) -> u32 {
    let mut assured = 0;
    for round in 0..draws {
        let (period, most) =
            (10.0_f64.powf(random.between(-2.7, -1.0)), 10.0_f64.powf(random.between(-1.0, 1.0)));
        let (inside, deadline) = ([0.0, 1e-12, 1e-9, 1e-7, 1e-5][round % 5], random.between(3.0, 6.0));
        let place = most * (deadline / 6.0).powi(N as i32);
        let band = Band(place, 0.6 * place);
        let filter = Filter::builder(Integrator::<N>)
            .barrier("band", band, BarrierSettings::within(deadline))
            .and_then(|b| b.barrier("edge", NonNegative, BarrierSettings::keeping()))
            .and_then(|b| b.bounds(&[-most], &[most]))
            .and_then(|b| b.sampling(Sampling::Period(period)))
            .and_then(FilterBuilder::build)
            .expect("valid filter");
        let mut filter = filter.with_plans(period).expect("plans");
        let mut x = [0.0; N];
        x[0] = inside;
        for k in 0..40 {
            let wish = [0.0, -3.0 * most, random.between(-2.0, 2.0) * most][round % 3];
            let (t, mut u) = (f64::from(k) * period, [0.0]);
            let assurance =
                filter.step(t, &x, &[wish], &mut u).expect("dimensions").assurance.expect("plans");
            if k == 0 && !assurance.is_assured() {
                break;
            }
            assured += u32::from(k == 0);
            assert!(assurance.is_assured(), "{N}, {round}, {inside} inside, at {t}: {assurance:?}");
            for _ in 0..8 {
                x = rk4_step(&Integrator::<N>, &x, &u, period / 8.0);
                assert!(x[0] >= -1e-12, "{N}, {round}, at {t}: {x:?}");
            }
        }
    }
    assured
}

/// The margin is due a period after a start at the edge, even where one input is held for longer: what is promised at the first
/// sample stands at the next.
#[test]
fn what_leaves_the_edge_of_a_set_is_not_lost() {
    let random = &mut Random(47);
    let n = draws(20, 400);
    let assured = [leaves_the_edge::<1>, leaves_the_edge::<2>, leaves_the_edge::<3>]
        .map(|leaves| u64::from(leaves(random, n as usize)));
    // Three integrators at short periods gain less than the margin in one, and are refused.
    assert!(
        10 * assured[0] > 9 * n && 10 * assured[1] > 9 * n && 10 * assured[2] > 3 * n,
        "{assured:?} of {n}"
    );
}

#[test]
fn at_the_edge_the_input_does_not_chatter() {
    const BOUND: f64 = 5.0;
    // A small set without a margin of its own, and a wish that never lets go.
    let goal = QuadraticDisc::new([5.0, 0.0], 0.2).expect("valid disc");
    let filter = Filter::builder(PointMass)
        .barrier("goal", goal, BarrierSettings::within(4.0))
        .and_then(|b| b.bounds(&[-BOUND; 2], &[BOUND; 2]))
        .and_then(|b| b.sampling(Sampling::Period(PERIOD)))
        .and_then(FilterBuilder::build)
        .expect("valid filter");
    let mut filter = filter.with_plans(PERIOD).expect("plans");
    let (mut x, mut u, mut last, mut moved) = ([0.0, 0.0, -1.0, 0.0], [0.0; 2], [0.0; 2], 0.0);
    for k in 0..(10.0 / PERIOD) as usize {
        let t = k as f64 * PERIOD;
        let assurance =
            filter.step(t, &x, &[3.5, 0.0], &mut u).expect("right dimensions").assurance.expect("plans");
        assert!(assurance.is_assured(), "at {t}: {assurance:?}");
        if t > 5.0 {
            moved += (u[0] - last[0]).abs();
        }
        last = u;
        x = Vehicle::PointMass.move_by(x, u, PERIOD);
    }
    // It comes to rest, once; it moved 14 times as far while the wish was followed to the margin of plans.
    assert!(moved < 2.0 * BOUND, "{moved}");
}

/// Who looks the other way has to turn hard for most of the time. An optimum over held inputs, found by another program and rolled out,
/// arrives at 2.77 s; at 1.1 to 1.35 times that no plan was found while all guesses turned gently.
#[test]
fn a_hard_turn_is_found() {
    let plant = Bicycle::new(2.5).expect("a length");
    let (centre, radius) = ([1.5585, 9.6817], 1.8039);
    for factor in [1.1, 1.2, 1.35] {
        let deadline = factor * 2.7681;
        let goal = DistanceDisc::new(centre, radius, radius).expect("valid disc");
        let filter = Filter::builder(plant)
            .barrier("goal", goal, BarrierSettings::within(deadline))
            .and_then(|b| b.bounds(&[-3.0, -0.5], &[3.0, 0.5]))
            .and_then(|b| b.sampling(Sampling::Period(PERIOD)))
            .and_then(FilterBuilder::build)
            .expect("valid filter");
        let mut filter = filter.with_plans(PERIOD).expect("plans");
        let mut x = [0.0, 0.0, -3.0058, 3.4187];
        for k in 0..((deadline + 1.0) / PERIOD) as usize {
            let (t, mut u) = (k as f64 * PERIOD, [0.0; 2]);
            let assurance =
                filter.step(t, &x, &[0.0; 2], &mut u).expect("right dimensions").assurance.expect("plans");
            assert!(assurance.is_assured(), "{factor} at {t}: {assurance:?}");
            for part in 1..=10 {
                x = rk4_step(&plant, &x, &u, PERIOD / 10.0);
                let is_due = t + f64::from(part) * PERIOD / 10.0 >= deadline;
                assert!(
                    !is_due || (x[0] - centre[0]).hypot(x[1] - centre[1]) <= radius,
                    "{factor} at {t}: {x:?}"
                );
            }
        }
    }
}

/// On the way, a wish that never lets go is followed as far as a plan allows. The input slides there, and does not jump between
/// the wish and the plan: three times as often it did.
#[test]
fn on_the_way_the_input_does_not_jump_to_and_fro() {
    const PERIOD: f64 = 0.01;
    const BOUND: f64 = 4.0;
    let goal = DistanceDisc::new([25.0, 15.0], 2.0, 2.0).expect("valid disc");
    let rock = Outside(DistanceDisc::new([20.0, -1.0], 3.0, 3.0).expect("valid disc"));
    let forwards = StateBound::at_least(3, -0.2).expect("valid bound");
    let filter = Filter::builder(Unicycle)
        .barrier("goal", goal, BarrierSettings::within(10.0))
        .and_then(|b| b.barrier("rock", rock, BarrierSettings::keeping()))
        .and_then(|b| b.barrier("forwards", forwards, BarrierSettings::keeping()))
        .and_then(|b| b.bounds(&[-BOUND, -1.5], &[BOUND, 1.5]))
        .and_then(|b| b.sampling(Sampling::Period(PERIOD)))
        .and_then(FilterBuilder::build)
        .expect("valid filter");
    let mut filter = filter.with_plans(PERIOD).expect("plans");
    let (mut x, mut u, mut last, mut jumps) = ([0.0, 0.0, -2.0, 3.0], [0.0; 2], [0.0; 2], 0);
    for k in 0..(15.0 / PERIOD) as usize {
        let t = k as f64 * PERIOD;
        let wish = [0.5 * (6.0 - x[3]), 0.2];
        let assurance =
            filter.step(t, &x, &wish, &mut u).expect("right dimensions").assurance.expect("plans");
        assert!(assurance.is_assured(), "at {t}: {assurance:?}");
        jumps += u32::from((u[0] - last[0]).abs() > 0.3);
        last = u;
        x = Vehicle::Unicycle.move_by(x, u, PERIOD);
    }
    assert!(jumps < 50, "{jumps} jumps");
}

/// What is small beside the way of one hold: on a way 3 m to either side of the first axis, things at a place, so far beside it
/// and of a size, in m.
#[derive(Clone, Debug)]
struct Way {
    things: Vec<[f64; 3]>,
    kind: Thing,
}

#[derive(Clone, Copy, Debug)]
enum Thing {
    /// Discs, and h the lower of two.
    Rock,
    /// Bumps of one smooth function.
    Bump,
    /// All across the way, as a bump.
    Wall,
}

impl Barrier<4> for Way {
    fn value<S: Scalar>(&self, _t: S, x: &[S; 4]) -> S {
        let way = -(x[1].squared() + 0.01).sqrt() + 3.0;
        self.things.iter().fold(way, |h, &[at, beside, size]| {
            let along = (x[0] - at).squared();
            let square = along + (x[1] - beside).squared();
            let bump = |square: S| (square * (-1.0 / (size * size))).exp() * 5.0;
            match self.kind {
                Thing::Rock => h.min(square - size * size),
                Thing::Bump => h - bump(square),
                Thing::Wall => h - bump(along),
            }
        })
    }
}

impl Way {
    fn filter(&self, deadline: f64) -> Filter {
        let goal = DistanceDisc::new([300.0, 0.0], 3.0, 1.0).expect("valid disc");
        let filter = Filter::builder(PointMass)
            .barrier("goal", goal, BarrierSettings::within(deadline))
            .and_then(|b| b.barrier("way", self.clone(), BarrierSettings::keeping()))
            .and_then(|b| b.bounds(&[-4.0; 2], &[4.0; 2]))
            .and_then(|b| b.sampling(Sampling::Period(0.05)))
            .and_then(FilterBuilder::build)
            .expect("valid filter");
        filter.with_plans(0.05).expect("a filter that can be assured")
    }
}

#[test]
fn a_thin_wall_is_seen_wherever_it_stands() {
    let random = &mut Random(11);
    for _ in 0..draws(2, 100) {
        let wall = [random.between(10.0, 280.0), 0.0, random.between(0.1, 2.0)];
        let way = Way { things: vec![wall], kind: Thing::Wall };
        let x = [0.0, 0.0, random.between(0.0, 8.0), 0.0];
        let assurance = way
            .filter(random.between(25.0, 40.0))
            .step(0.0, &x, &[0.0; 2], &mut [0.0; 2])
            .expect("dimensions")
            .assurance
            .expect("plans");
        assert_eq!(assurance.status, AssuranceStatus::Refused, "{way:?}");
    }
}

/// A plan that is given drives around each of them, and the guarantee is not lost: the plant is the model.
#[test]
fn small_things_on_a_long_way_are_seen() {
    let seeds = draws(6, 400);
    let mut assured = 0;
    for seed in 1..=seeds {
        let random = &mut Random(0x9e37_79b9_7f4a_7c15_u64.wrapping_mul(seed));
        let things = (0..1 + seed % 3)
            .map(|_| [random.between(20.0, 260.0), random.between(-0.4, 0.4), random.between(0.2, 1.2)]);
        let kind = if seed % 2 == 0 { Thing::Bump } else { Thing::Rock };
        let way = Way { things: things.collect(), kind };
        let mut filter = way.filter(random.between(25.0, 40.0));
        let mut x = [0.0, 0.0, random.between(0.0, 8.0), 0.0];
        for k in 0..900 {
            let (mut u, u_ref) = ([0.0; 2], if seed % 4 < 2 { [0.0; 2] } else { [-x[2], -x[3]] });
            let t = 0.05 * f64::from(k);
            let status =
                filter.step(t, &x, &u_ref, &mut u).expect("dimensions").assurance.expect("plans").status;
            if k == 0 && status == AssuranceStatus::Refused {
                break;
            }
            assert_eq!(status, AssuranceStatus::Assured, "seed {seed} at {t} s: {way:?}");
            assured += u32::from(k == 0);
            let after = |s: f64, i: usize| x[i] + x[i + 2] * s + u[i] * s * s / 2.0;
            for part in 1..=100 {
                let s = 0.05 * f64::from(part) / 100.0;
                let h = way.value(0.0, &[after(s, 0), after(s, 1), 0.0, 0.0]);
                assert!(h >= 0.0, "seed {seed}, {s} s after {t} s: {h}, {way:?}");
            }
            x = [after(0.05, 0), after(0.05, 1), x[2] + u[0] * 0.05, x[3] + u[1] * 0.05];
        }
    }
    println!("{assured} of {seeds} ways have a plan");
    assert!(assured > 0);
}

/// A point on a line (m, m/s) that its input accelerates, with a wind that blows against it at a place, so far, and so hard:
/// in m, m and m/s².
#[derive(Clone, Copy, Debug)]
struct Windy([f64; 3]);

impl ControlAffine<2, 1> for Windy {
    fn drift<S: Scalar>(&self, x: &[S; 2]) -> [S; 2] {
        let Self([at, width, force]) = *self;
        [x[1], -((-((x[0] - at) / width).squared()).exp() * force)]
    }

    fn input_map<S: Scalar>(&self, _x: &[S; 2]) -> [[S; 1]; 2] {
        [[S::zero()], [S::one()]]
    }
}

/// A force on a stretch of the way that is short beside that of a hold is in the plan, wherever it is: no promise is given
/// that it breaks, and none that is given is lost, since the plant is the model.
#[test]
fn a_wind_on_a_short_stretch_is_seen_wherever_it_blows() {
    const PERIOD: f64 = 0.1;
    let seeds = draws(24, 300);
    let mut outcomes = [0; 2];
    for seed in 1..=seeds {
        let random = &mut Random(0x9e37_79b9_7f4a_7c15_u64.wrapping_mul(seed));
        let width = random.between(0.1, 2.0);
        // Some take more speed than there is, some little of it.
        let plant = Windy([random.between(60.0, 500.0), width, random.between(1.0, 60.0) / width]);
        let goal = StateBound::at_least(0, 550.0).expect("valid bound");
        let deadline = random.between(40.0, 60.0);
        let filter = Filter::builder(plant)
            .barrier("goal", goal, BarrierSettings::within(deadline))
            .and_then(|b| b.bounds(&[-0.5], &[0.5]))
            .and_then(|b| b.sampling(Sampling::Period(PERIOD)))
            .and_then(FilterBuilder::build)
            .expect("valid filter");
        let mut filter = filter.with_plans(PERIOD).expect("a filter that can be assured");
        let mut x = [0.0, random.between(8.0, 16.0)];
        let (mut k, mut refused) = (0, false);
        while PERIOD * f64::from(k) < deadline && !refused {
            let (t, u_ref) = (PERIOD * f64::from(k), [0.0, 0.3, -x[1]][seed as usize % 3]);
            let mut u = [0.0];
            let status =
                filter.step(t, &x, &[u_ref], &mut u).expect("dimensions").assurance.expect("plans").status;
            refused = k == 0 && status == AssuranceStatus::Refused;
            assert!(
                refused || status == AssuranceStatus::Assured,
                "seed {seed} at {t} s: {status:?}, {plant:?}"
            );
            // Some steps on the width of any wind.
            for _ in 0..200 {
                x = rk4_step(&plant, &x, &u, PERIOD / 200.0);
            }
            k += 1;
        }
        outcomes[usize::from(refused)] += 1;
        assert!(refused || x[0] >= 550.0 - 1e-6, "seed {seed}: {x:?}, {plant:?}");
    }
    println!("{outcomes:?} are assured and refused");
    assert!(outcomes.iter().all(|n| *n > 0), "{outcomes:?}");
}

/// Functions of a position with what series and enclosures easily miss: a jump, and powers of negative numbers.
#[derive(Clone, Copy, Debug)]
enum Odd {
    /// The angle of a point, less than −2 rad beyond its jump.
    Angle,
    /// To a power that is whole, up to 5 m from 0.
    Power(f64),
}

impl Barrier<2> for Odd {
    fn value<S: Scalar>(&self, _t: S, x: &[S; 2]) -> S {
        match *self {
            Self::Angle => x[0].atan2(S::from(-3.0)) + 2.0,
            Self::Power(exponent) => -(x[0] / 5.0).powf(exponent) + 1.0,
        }
    }
}

#[test]
fn jumps_and_powers_of_negative_numbers_are_seen() {
    const PERIOD: f64 = 0.2;
    let random = &mut Random(3);
    let mut assured = 0;
    for round in 0..40 {
        let exponent = [2.0, 4.0, 6.0, 66.0][round % 4];
        let (odd, edge) = if round < 16 { (Odd::Angle, 0.0) } else { (Odd::Power(exponent), -5.0) };
        let plant = Windy([0.0, 1.0, 0.0]);
        let filter = Filter::builder(plant)
            .barrier("odd", odd, BarrierSettings::keeping())
            .and_then(|b| b.bounds(&[-1.0], &[1.0]))
            .and_then(|b| b.sampling(Sampling::Period(PERIOD)))
            .and_then(FilterBuilder::build)
            .expect("valid filter");
        let mut filter = filter.with_plans(PERIOD).expect("a filter that can be assured");
        let mut x = [edge + random.between(0.1, 1.0), -random.between(0.1, 1.2)];
        if round < 6 {
            // From here the jump was between the instants that are looked at.
            x = [0.3, if round < 3 { -0.45 } else { -0.3 }];
        }
        for k in 0..40 {
            let (t, u_ref, mut u) = (PERIOD * f64::from(k), [0.0, -1.0, -x[1]][round % 3], [0.0]);
            let status =
                filter.step(t, &x, &[u_ref], &mut u).expect("dimensions").assurance.expect("plans").status;
            if k == 0 && status == AssuranceStatus::Refused {
                break;
            }
            assert_eq!(status, AssuranceStatus::Assured, "{odd:?} at {t} s: {x:?}");
            assured += u32::from(k == 0);
            for part in 1..=200 {
                let s = PERIOD * f64::from(part) / 200.0;
                let h = odd.value(0.0, &[x[0] + s * x[1] + s * s / 2.0 * u[0], 0.0]);
                assert!(h >= -1e-12, "{odd:?}, {s} s after {t} s: {h}");
            }
            x = [x[0] + PERIOD * x[1] + PERIOD * PERIOD / 2.0 * u[0], x[1] + PERIOD * u[0]];
        }
    }
    assert!(assured > 8, "{assured}");
}

/// A point whose inputs are its velocity, which something lifts by a centimetre where it passes the place.
#[derive(Clone, Copy, Debug)]
struct Lifted(f64);

impl ControlAffine<2, 2> for Lifted {
    fn drift<S: Scalar>(&self, x: &[S; 2]) -> [S; 2] {
        [S::zero(), (-((x[0] - self.0) / 0.002).squared()).exp() * 3.0]
    }

    fn input_map<S: Scalar>(&self, _x: &[S; 2]) -> [[S; 2]; 2] {
        [[S::one(), S::zero()], [S::zero(), S::one()]]
    }
}

/// What is small is seen far from the origin as near to it.
#[test]
fn small_things_are_seen_far_from_the_origin() {
    const PERIOD: f64 = 0.1;
    let mut assured = 0;
    for (round, far) in [0.0, 1e5, 1e6, 5e6].into_iter().enumerate() {
        let plant = Lifted(far + 1.2345);
        let ceiling = StateBound::at_most(1, far + 0.003).expect("valid bound");
        let goal = StateBound::at_least(0, far + 2.5).expect("valid bound");
        let builder = Filter::builder(plant);
        let on = builder.plant();
        let filter = builder
            .source("ceiling", along(on, ceiling, 1).expect("a degree"), BarrierSettings::keeping())
            .and_then(|b| b.barrier("goal", goal, BarrierSettings::within(4.0)))
            .and_then(|b| b.bounds(&[-1.0, -0.01], &[1.0, 0.01]))
            .and_then(|b| b.sampling(Sampling::Period(PERIOD)))
            .and_then(FilterBuilder::build)
            .expect("valid filter");
        let mut filter = filter.with_plans(PERIOD).expect("a filter that can be assured");
        let mut x = [far, far];
        for k in 0..50 {
            let (t, mut u) = (PERIOD * f64::from(k), [0.0; 2]);
            let u_ref = [[0.0; 2], [1.0, 0.01]][round % 2];
            let status =
                filter.step(t, &x, &u_ref, &mut u).expect("dimensions").assurance.expect("plans").status;
            if status == AssuranceStatus::Refused {
                break;
            }
            assert_eq!(status, AssuranceStatus::Assured, "{far} at {t} s: {x:?}");
            assured += 1;
            for _ in 0..400 {
                x = rk4_step(&plant, &x, &u, PERIOD / 400.0);
                // Round-off of the place, 400 times a period.
                assert!(x[1] <= far + 0.003 + 1e-6, "{far}, {t} s: {x:?}");
            }
        }
    }
    assert!(assured > 0);
}

/// A deadline by which no input arrives is not promised, however little it lies beside a sample.
#[test]
fn a_deadline_beside_a_sample_is_looked_at() {
    const PERIOD: f64 = 0.1;
    let random = &mut Random(5);
    for _ in 0..draws(6, 16) {
        let beside = random.between(-1.0, 1.0) * 10.0_f64.powf(random.between(-12.0, -6.0));
        let deadline = 2.0 + 1e-6 * PERIOD + beside;
        // From rest 20 m are all that 10 m/s² allow until then.
        let goal = StateBound::at_least(0, 20.5).expect("valid bound");
        let filter = Filter::builder(PointMass)
            .barrier("goal", goal, BarrierSettings::within(deadline))
            .and_then(|b| b.bounds(&[-10.0; 2], &[10.0; 2]))
            .and_then(|b| b.sampling(Sampling::Period(PERIOD)))
            .and_then(FilterBuilder::build)
            .expect("valid filter");
        let mut filter = filter.with_plans(PERIOD).expect("a filter that can be assured");
        let assurance = filter
            .step(0.0, &[0.0; 4], &[0.0; 2], &mut [0.0; 2])
            .expect("dimensions")
            .assurance
            .expect("plans");
        assert_eq!(assurance.status, AssuranceStatus::Refused, "{deadline}");
    }
}

/// Where the wanted input is no number at first, plans and rows count from different samples: what a plan no longer keeps is
/// not called guaranteed.
#[test]
fn what_has_ended_is_not_guaranteed() {
    let fence = StateBound::at_most(0, 5.0).expect("valid bound");
    let goal = StateBound::at_least(0, 9.0).expect("valid bound");
    let filter = Filter::builder(PointMass)
        .barrier("fence", fence, BarrierSettings::keeping())
        .and_then(|b| b.window(Begin::AtOnce, End::At(3.0)))
        .and_then(|b| b.barrier("goal", goal, BarrierSettings::within(3.9)))
        .and_then(|b| b.bounds(&[-6.0; 2], &[6.0; 2]))
        .and_then(|b| b.sampling(Sampling::Period(0.1)))
        .and_then(FilterBuilder::build)
        .expect("valid filter");
    let mut filter = filter.with_plans(0.1).expect("a filter that can be assured");
    let (mut x, mut guaranteed) = ([0.0_f64; 4], 0);
    for k in 0..45 {
        let (mut u, wanted) = ([0.0; 2], if k < 10 { f64::NAN } else { 6.0 });
        filter.step(0.1 * f64::from(k), &x, &[wanted, 0.0], &mut u).expect("dimensions");
        let [fence, goal] = [0, 1].map(|i| filter.report().barriers[i].guaranteed);
        guaranteed += u32::from(fence) + u32::from(goal);
        assert!(!fence || x[0] <= 5.0, "{k}: {x:?}");
        assert!(!goal || k < 40 || x[0] >= 9.0, "{k}: {x:?}");
        x[0] += 0.1 * x[2] + 0.005 * u[0];
        x[2] += 0.1 * u[0];
    }
    assert!(guaranteed > 50, "{guaranteed}");
}

/// A plan that has nothing to keep any more is not followed again by a filter that is armed again.
#[test]
fn armed_again_when_all_is_over_it_follows_no_plan() {
    for (samples, driver) in [(5, Driver::Plan), (12, Driver::Rows)] {
        let fence = StateBound::at_most(0, 5.0).expect("valid bound");
        let filter = Filter::builder(PointMass)
            .barrier("fence", fence, BarrierSettings::keeping())
            .and_then(|b| b.window(Begin::AtOnce, End::At(1.0)))
            .and_then(|b| b.bounds(&[-6.0; 2], &[6.0; 2]))
            .and_then(|b| b.sampling(Sampling::Period(0.1)))
            .and_then(FilterBuilder::build)
            .expect("valid filter");
        let mut filter = filter.with_plans(0.1).expect("a filter that can be assured");
        let (at, mut u) = (|k: u32| f64::from(k) * 0.1, [0.0; 2]);
        for k in 0..samples {
            filter.step(at(k), &[0.0; 4], &[0.0; 2], &mut u).expect("dimensions");
        }
        filter.rearm();
        let blind = filter
            .step(at(samples), &[f64::NAN; 4], &[0.0; 2], &mut u)
            .expect("dimensions")
            .assurance
            .expect("plans");
        assert_eq!((blind.status, blind.driver), (AssuranceStatus::Undecided, driver), "after {samples}");
    }
}

/// A speed (m/s) with drag, and a level (m) that rises with it and creeps towards 60 m, at a rate per second.
#[derive(Clone, Copy, Debug)]
struct Filling(f64);

impl ControlAffine<2, 1> for Filling {
    fn drift<S: Scalar>(&self, x: &[S; 2]) -> [S; 2] {
        [x[0] * -0.5, x[0].max(S::zero()) - (x[1] - 60.0) * self.0]
    }

    fn input_map<S: Scalar>(&self, _x: &[S; 2]) -> [[S; 1]; 2] {
        [[S::one()], [S::zero()]]
    }
}

/// Keeps the level of `plant`, its second state, below `limit`.
fn level_kept<P, const NX: usize>(plant: P, limit: f64) -> Filter
where
    P: ControlAffine<NX, 1> + Send + Sync + 'static,
{
    let level = StateBound::at_most(1, limit).expect("valid bound");
    let source = along(Arc::new(plant), level, 2).expect("a degree");
    let filter = Filter::from_sources(NX, 1)
        .source("level", source, BarrierSettings::keeping())
        .and_then(|b| b.bounds(&[-2.0], &[2.0]))
        .and_then(|b| b.sampling(Sampling::Period(0.1)))
        .and_then(FilterBuilder::build)
        .expect("valid filter");
    filter.with_plans(0.1).expect("a filter that can be assured")
}

/// What goes on to creep, however slowly, is no rest: no promise is given that is lost later. Without a creep there are some.
#[test]
fn what_creeps_on_is_no_equilibrium() {
    let random = &mut Random(5);
    let mut assured = [0; 2];
    for round in 0..60 {
        let creeps = round < 3 || round % 4 != 0;
        let mut plant = Filling(if creeps { 10.0_f64.powf(random.between(-8.0, -3.0)) } else { 0.0 });
        let mut limit = random.between(5.0, 80.0);
        let mut x = [random.between(0.0, 4.0), random.between(0.0, 60.0)];
        if round < 3 {
            // Lost after 116 s where a creep as slow as this counts as rest.
            (plant, limit) = (Filling(7.986_311_018_272_636e-8), 31.088_444_160_762_222);
            x = [3.071_511_322_579_002, 26.137_458_198_334_933];
        }
        let mut filter = level_kept(plant, limit);
        for k in 0..1300 {
            let (t, u_ref, mut u) = (0.1 * f64::from(k), [0.0, 2.0, -x[0]][round % 3], [0.0]);
            let status =
                filter.step(t, &x, &[u_ref], &mut u).expect("dimensions").assurance.expect("plans").status;
            if k == 0 && status == AssuranceStatus::Refused {
                break;
            }
            assured[usize::from(creeps)] += u32::from(k == 0);
            assert_eq!(status, AssuranceStatus::Assured, "{plant:?} at {t} s: {x:?}");
            x = rk4_step(&plant, &x, &u, 0.1);
        }
    }
    println!("{assured:?} are assured at rest and creeping");
    assert!(assured[0] > 5, "{assured:?}");
}

/// [`Filling`] with a constant creep of the level (m/s), beside a flow that follows the speed and dies away (per s).
#[derive(Clone, Copy, Debug)]
struct Hiding {
    creep: f64,
    decay: f64,
    part: f64,
}

impl ControlAffine<3, 1> for Hiding {
    fn drift<S: Scalar>(&self, x: &[S; 3]) -> [S; 3] {
        [x[0] * -0.5, x[0].max(S::zero()) + self.creep + x[2] * self.part, x[0] - x[2] * self.decay]
    }

    fn input_map<S: Scalar>(&self, _x: &[S; 3]) -> [[S; 1]; 3] {
        [[S::one()], [S::zero()], [S::zero()]]
    }
}

/// What is left at a rest may be a slow decay above a creep, whichever way each leads: what is promised there is kept.
#[test]
fn an_equilibrium_that_is_left_slowly_stays_one() {
    let random = &mut Random(11);
    // Lost after 135 and 127 s where neither is told from the other, and where a rest may not wait until less of it is left.
    let (creep, decay, part) = (3.425_637_085_106_273e-8, 0.039_269_752_309_004_22, 0.004_518_107_559_785_99);
    let slow = (Hiding { creep, decay, part }, 2.328_745_209_182_599_3, 1.604_044_303_882_070_4);
    let (decay, part) = (1.135_462_044_539_021_8, -0.522_124_499_741_339_5);
    let quick = (Hiding { creep: 0.0, decay, part }, 1.486_040_296_703_016_8, 0.664_776_774_779_223);
    let mut cases = vec![slow, quick];
    for round in 2..26 {
        let creep = if round % 4 != 0 { 10.0_f64.powf(random.between(-8.0, -5.3)) } else { 0.0 };
        let decay = 10.0_f64.powf(random.between(-2.0, 0.5));
        let plant = Hiding { creep, decay, part: decay * random.between(-0.5, 0.5) };
        cases.push((plant, random.between(0.0, 4.0), random.between(0.5, 8.0)));
    }
    let mut assured = 0;
    for (round, (plant, speed, limit)) in cases.into_iter().enumerate() {
        let mut x = [speed, 0.0, 0.0];
        let mut filter = level_kept(plant, limit);
        for k in 0..4000 {
            let (t, u_ref, mut u) = (0.1 * f64::from(k), [0.0, 2.0, -x[0]][round % 3], [0.0]);
            let status =
                filter.step(t, &x, &[u_ref], &mut u).expect("dimensions").assurance.expect("plans").status;
            if k == 0 && status == AssuranceStatus::Refused {
                break;
            }
            assured += u32::from(k == 0);
            assert_eq!(
                status,
                AssuranceStatus::Assured,
                "{plant:?} from {speed} m/s to {limit} m at {t} s: {x:?}"
            );
            x = rk4_step(&plant, &x, &u, 0.1);
            assert!(x[1] <= limit, "{plant:?} at {t} s: {x:?}");
        }
    }
    assert!(assured > 8, "{assured}");
}

/// A point on a line (m, m/s) that its input accelerates, and a temperature that has come up to 0 fast. From there it goes on
/// towards another, at a rate per second. Within 0.2 of 0.6 it pushes the point, by so many m/s² for each degree of that.
#[derive(Clone, Copy, Debug)]
struct Warming {
    towards: f64,
    rate: f64,
    push: f64,
}

impl ControlAffine<3, 1> for Warming {
    fn drift<S: Scalar>(&self, x: &[S; 3]) -> [S; 3] {
        let warms = (-x[2] + self.towards) * self.rate + (-x[2]).max(S::zero()) * 5.0;
        [x[1], (-(x[2] - 0.6).abs() + 0.2).max(S::zero()) * self.push, warms]
    }

    fn input_map<S: Scalar>(&self, _x: &[S; 3]) -> [[S; 1]; 3] {
        [[S::zero()], [S::one()], [S::zero()]]
    }
}

/// Near 2 m, and not too warm: h tells of a temperature only near the edge.
#[derive(Clone, Copy, Debug)]
struct Cool {
    edge: f64,
    is_smooth: bool,
}

impl Barrier<3> for Cool {
    fn value<S: Scalar>(&self, _t: S, x: &[S; 3]) -> S {
        let near = -((x[0] - 2.0).squared() + 1e-4).sqrt() + 0.2;
        match self.is_smooth {
            true => near - (((x[2] - self.edge) * 60.0).tanh() + 1.0) * 0.3,
            false => near.min(-x[2] + self.edge),
        }
    }
}

/// A point on a line (m, m/s) that its input accelerates, a flow that dies away, and a level that it fills. By itself the level
/// moves away from 0 at a rate per second, or towards it. Within 0.2 of 0.6 it pushes the point.
#[derive(Clone, Copy, Debug)]
struct Unstable {
    rate: f64,
}

impl ControlAffine<4, 1> for Unstable {
    fn drift<S: Scalar>(&self, x: &[S; 4]) -> [S; 4] {
        let push = (-(x[3] - 0.6).abs() + 0.2).max(S::zero()) * 20.0;
        [x[1], push, -x[2] * 5.0, x[3] * self.rate + x[2]]
    }

    fn input_map<S: Scalar>(&self, _x: &[S; 4]) -> [[S; 1]; 4] {
        [[S::zero()], [S::one()], [S::zero()], [S::zero()]]
    }
}

#[derive(Clone, Copy, Debug)]
struct Near;

impl Barrier<4> for Near {
    fn value<S: Scalar>(&self, _t: S, x: &[S; 4]) -> S {
        -((x[0] - 2.0).squared() + 1e-4).sqrt() + 0.2
    }
}

/// A level that comes to rest at 0, where it does not stay, is no rest: however near it comes, it leaves within the day. One that
/// is drawn there is.
#[test]
fn an_unstable_equilibrium_does_not_count() {
    let random = &mut Random(23);
    for round in 0..draws(24, 60) {
        let leads_out = round % 3 > 0;
        let rate = 10.0_f64.powf(random.between(-3.0, 0.5)) * if leads_out { 1.0 } else { -1.0 };
        let plant = Unstable { rate };
        let filter = Filter::builder(plant)
            .barrier("near", Near, BarrierSettings::within(8.0))
            .and_then(|b| b.bounds(&[-2.0], &[2.0]))
            .and_then(|b| b.sampling(Sampling::Period(0.05)))
            .and_then(FilterBuilder::build)
            .expect("valid filter");
        let mut filter = filter.with_plans(0.05).expect("a filter that can be assured");
        // On the way that leads to 0, but for very little.
        let beside = if round % 2 == 0 { 0.0 } else { 10.0_f64.powf(random.between(-14.0, -7.0)) };
        let start = [0.0, 0.0, 0.5, -0.5 / (5.0 + rate) + beside];
        let status = filter
            .step(0.0, &start, &[0.0], &mut [0.0])
            .expect("dimensions")
            .assurance
            .expect("plans")
            .status;
        assert_eq!(status == AssuranceStatus::Assured, !leads_out, "{plant:?} from {start:?}: {status:?}");
    }
}

/// A point on a line (m, m/s) that is driven from 0 at `stiffness` (1/s2) times its place, and accelerated by its input.
#[derive(Clone, Copy, Debug)]
struct Driven {
    stiffness: f64,
}

impl ControlAffine<2, 1> for Driven {
    fn drift<S: Scalar>(&self, x: &[S; 2]) -> [S; 2] {
        [x[1], x[0] * self.stiffness]
    }

    fn input_map<S: Scalar>(&self, _x: &[S; 2]) -> [[S; 1]; 2] {
        [[S::zero()], [S::one()]]
    }
}

#[derive(Clone, Copy, Debug)]
struct Within(f64);

impl Barrier<2> for Within {
    fn value<S: Scalar>(&self, _t: S, x: &[S; 2]) -> S {
        -x[0].abs() + self.0
    }
}

/// Where the bounds end before the set does, the plant is kept from the brink by more than what is rounded off: a plan from there
/// would be lost on the way. Judged by the exact solution.
#[test]
fn what_round_off_would_lose_is_not_followed() {
    const STEP: f64 = 0.04;
    let random = &mut Random(29);
    for round in 0..8 {
        let (stiffness, most) = (random.between(20.0, 40.0), random.between(1.0, 3.0));
        let brink = most / stiffness;
        let set = Within(brink * random.between(1.2, 2.0));
        let filter = Filter::builder(Driven { stiffness })
            .barrier("near", set, BarrierSettings::keeping())
            .and_then(|b| b.bounds(&[-most], &[most]))
            .and_then(|b| b.sampling(Sampling::Period(STEP)))
            .and_then(FilterBuilder::build)
            .expect("valid filter");
        let mut filter = filter.with_plans(STEP).expect("a filter that can be assured");
        let (lambda, mut u) = (stiffness.sqrt(), [0.0]);
        let (cosh, sinh) = ((lambda * STEP).cosh(), (lambda * STEP).sinh());
        let mut x = [brink * random.between(-0.7, 0.7), 0.0];
        let wanted = [0.0, -1e3, 1e3, 0.5 * most][round % 4];
        for k in 0..250 {
            let status = filter
                .step(f64::from(k) * STEP, &x, &[wanted], &mut u)
                .expect("dimensions")
                .assurance
                .expect("plans")
                .status;
            assert_eq!(status, AssuranceStatus::Assured, "round {round}, step {k}, {x:?}");
            let from = x[0] + u[0] / stiffness;
            x = [from * cosh + x[1] / lambda * sinh - u[0] / stiffness, from * lambda * sinh + x[1] * cosh];
            assert!(x[0].abs() < brink, "round {round}, step {k}, {x:?}");
        }
    }
}

/// A point on a line (m) whose speed (m/s) comes to its input with a lag (s).
#[derive(Clone, Copy, Debug)]
struct Lagging {
    lag: f64,
}

impl ControlAffine<2, 1> for Lagging {
    fn drift<S: Scalar>(&self, x: &[S; 2]) -> [S; 2] {
        [x[1], -x[1] / self.lag]
    }

    fn input_map<S: Scalar>(&self, _x: &[S; 2]) -> [[S; 1]; 2] {
        [[S::zero()], [S::from(1.0 / self.lag)]]
    }
}

/// What dies away a hundred times sooner than a hold ends is no reason to refuse. Judged by the exact solution, a hundred times a
/// hold.
#[test]
fn a_lag_far_shorter_than_a_hold_is_promised() {
    let random = &mut Random(31);
    for round in 0..24 {
        let step = random.between(0.01, 0.2);
        let lag = step / 10.0_f64.powf(random.between(-0.5, 2.0));
        let (set, most) = (Within(random.between(0.5, 1.5)), random.between(1.0, 3.0));
        let filter = Filter::builder(Lagging { lag })
            .barrier("near", set, BarrierSettings::within(3.0))
            .and_then(|b| b.bounds(&[-most], &[most]))
            .and_then(|b| b.sampling(Sampling::Period(step)))
            .and_then(FilterBuilder::build)
            .expect("valid filter");
        let mut filter = filter.with_plans(step).expect("a filter that can be assured");
        let (mut x, mut u) = ([set.0 + random.between(-1.0, 0.5) * most, 0.0], [0.0]);
        let wanted = [0.0, -1e3, 1e3, 0.7 * most][round % 4];
        for k in 0..100 {
            let t = f64::from(k) * step;
            let status =
                filter.step(t, &x, &[wanted], &mut u).expect("dimensions").assurance.expect("plans").status;
            assert_eq!(
                status,
                AssuranceStatus::Assured,
                "round {round}, step {k}: lag {lag}, {step} s, {x:?}"
            );
            let after = |dt: f64| {
                let gone = -(-dt / lag).exp_m1();
                [x[0] + u[0] * dt + (x[1] - u[0]) * lag * gone, x[1] + (u[0] - x[1]) * gone]
            };
            for part in 1..=100 {
                let dt = step * f64::from(part) / 100.0;
                let place = after(dt)[0];
                assert!(t + dt < 3.0 || place.abs() <= set.0, "round {round}, step {k}: {place} of {set:?}");
            }
            x = after(step);
        }
    }
}

/// What is promised near the origin is promised far from it.
#[test]
fn a_place_far_from_the_origin_is_no_other_place() {
    for far in [0.0, 1e5, 1e6, -2e7] {
        for vehicle in [Vehicle::PointMass, Vehicle::Unicycle] {
            let disc = DistanceDisc::new([far + 10.0, far - 5.0], 2.0, 1.0).expect("valid disc");
            let filter = vehicle
                .sets((disc, BarrierSettings::within(8.0)), None)
                .and_then(|b| b.bounds(&[-3.0; 2], &[3.0; 2]))
                .and_then(|b| b.sampling(Sampling::Period(PERIOD)))
                .and_then(FilterBuilder::build)
                .expect("valid filter");
            let mut filter = filter.with_plans(PERIOD).expect("a filter that can be assured");
            let status = filter
                .step(0.0, &[far, far, 1.0, 0.0], &[0.0; 2], &mut [0.0; 2])
                .expect("dimensions")
                .assurance
                .expect("plans")
                .status;
            assert_eq!(status, AssuranceStatus::Assured, "{vehicle:?} at {far}");
        }
    }
}

/// A state that creeps on where neither h nor the plant tells of it yet is no rest, if it leads out within the day. Where it
/// ends inside it may be one.
#[test]
fn what_creeps_on_unseen_is_no_equilibrium() {
    let random = &mut Random(17);
    let mut told = [0; 2];
    for round in 0..draws(60, 600) {
        let push = if round % 3 == 0 { 20.0 } else { 0.0 };
        let rate = 10.0_f64.powf(random.between(-6.0, -2.5));
        let plant = Warming { towards: random.between(0.3, 2.0), rate, push };
        // Pushed by more than its bound it is lost, whatever the temperature that is too warm.
        let edge = if push > 0.0 { 5.0 } else { random.between(0.1, 2.5) };
        let cool = Cool { edge, is_smooth: round % 2 == 0 };
        let lost = if push > 0.0 { 0.4 + 2.0 / push } else { edge };
        // After a day, or a little less.
        let warm = plant.towards * -(rate * -0.9e5).exp_m1();
        let leads_out = warm > lost + 0.05;
        if !leads_out && plant.towards > lost - 0.1 {
            continue;
        }
        let filter = Filter::builder(plant)
            .barrier("cool", cool, BarrierSettings::within(8.0))
            .and_then(|b| b.bounds(&[-2.0], &[2.0]))
            .and_then(|b| b.sampling(Sampling::Period(0.05)))
            .and_then(FilterBuilder::build)
            .expect("valid filter");
        let mut filter = filter.with_plans(0.05).expect("a filter that can be assured");
        let start = [0.0, 0.0, -(10.0_f64.powf(random.between(0.0, 3.0)))];
        let status = filter
            .step(0.0, &start, &[0.0], &mut [0.0])
            .expect("dimensions")
            .assurance
            .expect("plans")
            .status;
        let is_assured = status == AssuranceStatus::Assured;
        assert!(!(leads_out && is_assured), "{plant:?} from {start:?}, {cool:?}");
        // What is still fast beside the way before is no rest either.
        told[usize::from(leads_out)] += u32::from(leads_out || is_assured);
    }
    println!("{told:?} are assured, and lead out");
    assert!(told[0] > 5 && told[1] > 5, "{told:?}");
}
