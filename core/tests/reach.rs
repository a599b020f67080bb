//! The limits of bounded inputs, against known answers and against runs. Deadlines that are given up. Profiles of
//! least peak.

use crate::draw;

use std::sync::Arc;

use std::array::from_fn;

use punctual_core::barriers::{DistanceDisc, HalfPlane, Rectangle};
use punctual_core::dynamics::{ControlAffine, chain, rk4_step};
use punctual_core::filter::{BarrierSettings, Filter, FilterBuilder, Infeasible, Phase, ProfileKind};
use punctual_core::plants::{
    Bicycle, KinematicBicycle, PointMass, SmallSlipBicycle, SmallSlipBicycleWithRate, Unicycle,
};
use punctual_core::qp::Bounds;
use punctual_core::scalar::Scalar;
use punctual_core::{barrier::Barrier, lie, reach};
use punctual_reference::effort::smallest;
use punctual_reference::simulation::{Schedule, closed_loop};

/// A point whose velocity is the input.
#[derive(Clone, Copy)]
struct Kinematic;

impl ControlAffine<2, 2> for Kinematic {
    fn drift<S: Scalar>(&self, _x: &[S; 2]) -> [S; 2] {
        [S::zero(); 2]
    }
    fn input_map<S: Scalar>(&self, _x: &[S; 2]) -> [[S; 2]; 2] {
        [[S::one(), S::zero()], [S::zero(), S::one()]]
    }
    fn region(
        &self,
        x: &[f64; 2],
        bounds: [&[f64]; 2],
        time: [f64; 2],
    ) -> Option<punctual_core::dynamics::Region> {
        let side = |i: usize| chain(&[x[i]], [bounds[0][i], bounds[1][i]], time);
        Some(punctual_core::dynamics::Region { sides: [side(0), side(1)], radius: 0.0 })
    }
}

fn bounds(limit: f64) -> Bounds {
    let mut bounds = Bounds::NONE;
    bounds.min[..2].fill(-limit);
    bounds.max[..2].fill(limit);
    bounds
}

fn earliest<P, B, const NX: usize>(plant: P, barrier: B, n: usize, x: [f64; NX], limit: f64) -> f64
where
    P: ControlAffine<NX, 2> + Send + Sync + 'static,
    B: Barrier<NX> + Send + 'static,
{
    let source = lie::along(Arc::new(plant), barrier, n).expect("valid");
    reach::earliest_arrival(&*source, (0.0, &x), &bounds(limit), 1e3).expect("known")
}

#[test]
fn the_earliest_times_of_chains_are_the_known_ones() {
    let close = |found: f64, wanted: f64| {
        // From below: it is a bound.
        assert!(found <= wanted * (1.0 + 1e-12) && found > wanted * (1.0 - 1e-6), "{found} for {wanted}");
    };
    let disc = DistanceDisc::new([10.0, 0.0], 2.0, 2.0).expect("valid");
    close(earliest(Kinematic, disc, 1, [0.0; 2], 2.0), 4.0);
    close(earliest(PointMass, disc, 2, [0.0; 4], 4.0), 2.0);
    // Away at first: 8 = −4 τ + 2 τ².
    close(earliest(PointMass, disc, 2, [0.0, 0.0, -4.0, 0.0], 4.0), 1.0 + 5.0_f64.sqrt());
    let half = HalfPlane::new([0.0, 1.0], [0.0, 9.0]).expect("valid");
    close(earliest(PointMass, half, 2, [0.0; 4], 2.0), 3.0);
    // The corner nearest is that of one axis.
    let rectangle = Rectangle::new([10.0, 0.0], [2.0, 50.0], 0.0).expect("valid");
    close(earliest(PointMass, rectangle, 2, [0.0; 4], 4.0), 2.0);
    assert_eq!(earliest(PointMass, disc, 2, [9.0, 0.0, 0.0, 0.0], 4.0), 0.0);
    // Meeting a disc at 3 m/s: 10 − 2 = 2 τ²/… with the disc coming.
    let coming = disc.moving([-3.0, 0.0]).expect("valid");
    close(earliest(PointMass, coming, 2, [0.0; 4], 4.0), (-3.0 + (9.0_f64 + 64.0).sqrt()) / 4.0);
    // Nothing known without bounds.
    let source = lie::along(Arc::new(PointMass), disc, 2).expect("valid");
    assert_eq!(reach::earliest_arrival(&*source, (0.0, &[0.0; 4]), &Bounds::NONE, 1.0), None);
}

/// Inputs drawn within the bounds, held for random times: none arrives before the bound.
fn never_earlier<P, const NX: usize>(plant: P, limits: [f64; 2], seed: u64)
where
    P: ControlAffine<NX, 2> + Copy + Send + Sync + 'static,
{
    let mut draw = draw::Draw::new(seed);
    for _ in 0..40 {
        let x0 = from_fn::<f64, NX, _>(|i| draw.uniform(-1.0, 1.0) * [8.0, 8.0, 3.0, 3.0, 0.4][i]);
        let disc = DistanceDisc::new([draw.uniform(-9.0, 9.0), 3.0], 2.0, 2.0)
            .and_then(|d| d.moving([draw.uniform(-1.0, 1.0), 0.5]))
            .expect("valid");
        let source = lie::along(Arc::new(plant), disc, 2).expect("valid");
        let mut within = Bounds::NONE;
        for i in 0..2 {
            (within.min[i], within.max[i]) = (-limits[i], limits[i]);
        }
        let earliest = reach::earliest_arrival(&*source, (0.0, x0.as_slice()), &within, 20.0).expect("known");
        for _ in 0..20 {
            let (mut x, mut t) = (x0, 0.0);
            let mut u = [0.0; 2];
            while t < 10.0 {
                if draw.uniform(0.0, 1.0) < 0.1 {
                    u = from_fn(|i| limits[i] * draw.uniform(-2.0, 2.0).clamp(-1.0, 1.0));
                }
                if disc.value(t, &x) >= 0.0 {
                    assert!(t >= earliest, "{t} before {earliest} from {x0:?}");
                    break;
                }
                x = rk4_step(&plant, &x, &u, 0.05);
                t += 0.05;
            }
        }
    }
}

#[test]
fn no_bounded_run_arrives_before_the_earliest_time() {
    never_earlier(PointMass, [2.0, 3.0], 1);
    never_earlier(Unicycle, [2.0, 3.0], 2);
    never_earlier(Bicycle::new(2.0).expect("valid"), [2.0, 0.8], 3);
    let slip: SmallSlipBicycleWithRate = SmallSlipBicycle::new(2.0).expect("valid").with_rate();
    never_earlier(slip, [2.0, 0.5], 4);
    never_earlier(KinematicBicycle::new(1.0, 1.0).expect("valid"), [2.0, 0.1], 5);
}

fn filter(settings: BarrierSettings, limit: f64) -> Filter {
    let half = HalfPlane::new([1.0, 0.0], [9.0, 0.0]).expect("valid");
    Filter::builder(PointMass)
        .barrier("goal", half, settings)
        .and_then(|b| b.bounds(&[-limit; 2], &[limit; 2]))
        .and_then(FilterBuilder::build)
        .expect("valid filter")
}

/// 9 m in 3 s at 2 m/s² throughout, from rest: just possible, so never certainly late. Waiting makes it
/// certain as soon as theory says: coasting at rest, at the first sample after the start.
#[test]
fn late_is_certain_exactly_when_it_is() {
    let settings = BarrierSettings::within(3.0);
    let mut on_time = filter(settings, 2.0);
    let mut waiting = filter(settings, 2.0);
    let mut given_up = filter(settings, 2.5);
    let (mut u, mut first) = ([0.0; 2], None);
    for k in 0..=300 {
        let t = f64::from(k) / 100.0;
        // The state of the run at full input, exactly.
        let x = [t * t, 0.0, 2.0 * t, 0.0];
        let report = on_time.step(t, &x, &[0.0; 2], &mut u).expect("lengths");
        assert!(!report.barriers[0].deadline_unreachable, "at {t} s");
        let report = waiting.step(t, &[0.0; 4], &[0.0; 2], &mut u).expect("lengths");
        assert_eq!(report.barriers[0].deadline_unreachable, k > 0, "at {t} s");
        let report = given_up.step(t, &[0.0; 4], &[0.0; 2], &mut u).expect("lengths");
        if report.barriers[0].deadline_unreachable {
            first.get_or_insert(t);
        }
    }
    // With 2.5 m/s² the last moment is T − √(2 · 9/2.5) = 0.3167 s: 0.32 s is the first sample after it.
    assert_eq!(first, Some(0.32));
}

#[test]
fn a_deadline_out_of_reach_is_postponed_and_kept() {
    for profile in [ProfileKind::Hermite, ProfileKind::LowPeak] {
        let settings =
            BarrierSettings::within(1.0).infeasible(Infeasible::Earliest).profile(profile).margin(0.01);
        let mut filter = filter(settings, 2.0);
        let schedule = Schedule { step: 0.01, steps: 1500, substeps: 1 };
        let x0 = [0.0; 4];
        let mut arrival = None;
        let mut last = None;
        let coast = |_: f64, _: &[f64; 4]| [0.0; 2];
        closed_loop(&mut filter, &PointMass, x0, schedule, coast, |t, _, u, report| {
            let b = report.barriers[0];
            if t == 0.0 {
                // Twice the 3 s that no input can do without.
                assert!(b.postponed == 1 && (b.time_left - 6.0).abs() < 1e-5, "{b:?}");
            }
            assert!(u[0].abs() <= 2.0 && !b.deadline_unreachable);
            arrival = b.arrival_time;
            last = Some(b);
        })
        .expect("valid schedule");
        let last = last.expect("a sample");
        assert!(arrival.is_some_and(|t| (3.0..=6.0).contains(&t)), "{arrival:?}");
        assert!(last.phase == Phase::Stay && last.on_course && last.postponed == 1, "{last:?}");
    }
    // Reported only: the deadline stays.
    let mut reported = filter(BarrierSettings::within(1.0), 2.0);
    let report = reported.step(0.0, &[0.0; 4], &[0.0; 2], &mut [0.0; 2]).expect("lengths");
    let b = report.barriers[0];
    assert!(b.deadline_unreachable && b.postponed == 0 && b.time_left == 1.0, "{b:?}");
}

/// From rest the bound with which a profile is followed is its peak: 6 d/T² against 4 d/T².
#[test]
fn low_peaks_need_smaller_bounds() {
    let bound = |profile: ProfileKind| {
        let settings = BarrierSettings::within(3.0).profile(profile).rate(4.0);
        let works = |limit: f64| {
            let mut filter = filter(settings, limit);
            let schedule = Schedule { step: 0.01, steps: 600, substeps: 1 };
            let mut kept = true;
            let coast = |_: f64, _: &[f64; 4]| [0.0; 2];
            closed_loop(&mut filter, &PointMass, [0.0; 4], schedule, coast, |t, _, _, report| {
                kept &= t < 2.999 || report.barriers[0].h >= 0.0;
                kept &= report.status.is_satisfied();
            })?;
            Ok::<_, punctual_core::Error>(kept)
        };
        smallest([1.0, 100.0], 1e-3, works).expect("valid").expect("works at 100")
    };
    let (hermite, low) = (bound(ProfileKind::Hermite), bound(ProfileKind::LowPeak));
    assert!((hermite - 6.0).abs() < 0.4 && (low - 4.0).abs() < 0.4, "{hermite} {low}");
}

/// 20 m in 1 s from rest with 4 m/s² is ruled out; with a wind that nobody knows the size of within 60 m/s² it is not.
#[test]
fn what_a_disturbance_may_do_is_not_ruled_out() {
    let start = [0.0, 0.0, 0.0, 0.0];
    for disturbance in [0.0, 60.0] {
        let settings = BarrierSettings::within(1.0).disturbance(disturbance);
        let line = HalfPlane::new([1.0, 0.0], [20.0, 0.0]).expect("a valid barrier");
        let mut filter = Filter::builder(PointMass)
            .barrier("line", line, settings)
            .and_then(|b| b.bounds(&[-4.0; 2], &[4.0; 2]))
            .and_then(FilterBuilder::build)
            .expect("a valid filter");
        let known = disturbance == 0.0;
        assert_eq!(filter.is_ruled_out(0, 0.0, &start, 1.0).expect("valid"), known);
        assert_eq!(filter.earliest_arrival(0, 0.0, &start, 9.0).expect("valid").is_some(), known);
        let report = filter.step(0.0, &start, &[0.0; 2], &mut [0.0; 2]).expect("valid");
        assert_eq!(report.barriers[0].deadline_unreachable, known);
    }
}
