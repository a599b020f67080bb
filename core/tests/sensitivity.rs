//! The derivative of a sample against central differences of the sample itself.

use proptest::prelude::*;
use proptest::strategy::ValueTree;
use punctual_core::MAX_RELATIVE_DEGREE;
use punctual_core::barriers::{DistanceDisc, HalfPlane, NormBound, Outside, QuadraticDisc, StateBound};
use punctual_core::convergence::stay::Means;
use punctual_core::convergence::{FixedTime, FixedTimeState};
use punctual_core::dynamics::{ControlAffine, WithPoint};
use punctual_core::filter::{
    BarrierSettings, Filter, FilterBuilder, Infeasible, Method, NoDerivative, Phase, ProfileKind,
    SampleDerivative, Sampling, Status, Strictness,
};
use punctual_core::lie::{DerivativeSource, Derivatives, Direction};
use punctual_core::plants::{Bicycle, KinematicBicycle, PointMass, SmallSlipBicycle, Unicycle};

/// Step of the differences, in units of x and u of order 1 to 10.
const STEP: f64 = 1e-4;

/// Of a derivative of size 1. Newton's method on the rows stops at 1e-9 of their terms, some 10 to 100, and
/// STEP divides that; the remainder of the differences is of order STEP².
const TOLERANCE: f64 = 1e-3;

/// One-sided differences that differ by more than this part of their size show a kink in between: curvature
/// of order 10 makes STEP times that.
const KINK: f64 = 0.02;

/// A sample: time, state, reference.
#[derive(Clone, Debug)]
struct Sample {
    t: f64,
    x: Vec<f64>,
    u_ref: Vec<f64>,
}

/// The numbers compared: u, then five per barrier.
fn outputs(filter: &mut Filter, sample: &Sample) -> (Status, Vec<Phase>, Vec<f64>) {
    let mut values = vec![0.0; sample.u_ref.len()];
    let report = filter.peek(sample.t, &sample.x, &sample.u_ref, &mut values).expect("right lengths");
    let phases = report.barriers.iter().map(|b| b.phase).collect();
    let status = report.status;
    for b in &report.barriers {
        values.extend([b.h, b.profile, b.margin, b.slack, b.sampling_loss]);
    }
    (status, phases, values)
}

/// The derivative along `direction` of state and reference, laid out as [`outputs`].
fn derivative(filter: &mut Filter, at: &Sample, direction: &Sample) -> Result<Vec<f64>, NoDerivative> {
    let mut out = SampleDerivative::default();
    let unknown = filter
        .differentiate(at.t, &at.x, &at.u_ref, Direction { x: &direction.x, u: &direction.u_ref }, &mut out)
        .expect("right lengths");
    let mut values = out.u[..at.u_ref.len()].to_vec();
    for b in &out.barriers {
        values.extend([b.h, b.profile, b.margin, b.slack, b.sampling_loss]);
    }
    unknown.map_or(Ok(values), Err)
}

/// The result of a comparison.
enum Compared {
    Agrees(Status),
    /// A kink is within a step.
    Kink,
    Differs(String),
}

/// Compares at `at` along `direction`.
fn compare(filter: &mut Filter, at: &Sample, direction: &Sample) -> Compared {
    let moved = |by: f64| {
        let along = |v: &[f64], d: &[f64]| v.iter().zip(d).map(|(v, d)| v + by * d).collect();
        Sample { t: at.t, x: along(&at.x, &direction.x), u_ref: along(&at.u_ref, &direction.u_ref) }
    };
    let (status, phases, here) = outputs(filter, at);
    let (plus, minus) = (outputs(filter, &moved(STEP)), outputs(filter, &moved(-STEP)));
    if (plus.0, &plus.1) != (status, &phases) || (minus.0, &minus.1) != (status, &phases) {
        return Compared::Kink;
    }
    let place = || format!("{status:?} {phases:?} at {at:?} along {direction:?}");
    let found = match derivative(filter, at, direction) {
        Err(e) => return Compared::Differs(format!("{e}: {}", place())),
        Ok(found) => found,
    };
    let differences = || plus.2.iter().zip(&minus.2).zip(&here);
    let smooth = differences().all(|((p, m), h)| {
        let (forward, backward) = ((p - h) / STEP, (h - m) / STEP);
        (forward - backward).abs() <= KINK * (1.0 + forward.abs().max(backward.abs()))
    });
    if !smooth {
        return Compared::Kink;
    }
    for (k, ((p, m), _)) in differences().enumerate() {
        let wanted = (p - m) / (2.0 * STEP);
        let error = (found[k] - wanted).abs() / (1.0 + wanted.abs());
        if error.is_nan() || error > TOLERANCE {
            return Compared::Differs(format!("output {k}: {} for {wanted}: {}", found[k], place()));
        }
    }
    Compared::Agrees(status)
}

/// The form of the row.
#[derive(Clone, Copy, Debug)]
enum Form {
    Pointwise,
    Measured,
    Period,
    Delayed,
}

const FORMS: [Form; 4] = [Form::Pointwise, Form::Measured, Form::Period, Form::Delayed];

fn formed(builder: FilterBuilder, form: Form) -> Filter {
    match form {
        Form::Pointwise => builder.sampling(Sampling::Pointwise),
        Form::Measured => builder.sampling(Sampling::Measured { first: None }),
        Form::Period => builder.sampling(Sampling::Period(0.05)),
        Form::Delayed => builder.sampling(Sampling::Period(0.05)).and_then(|b| b.actuation_delay(0.13)),
    }
    .and_then(FilterBuilder::build)
    .expect("valid filter")
}

fn goal() -> DistanceDisc {
    DistanceDisc::new([12.0, 4.0], 2.0, 1.0).expect("valid disc")
}

/// A goal, an obstacle on the way and a speed limit, with bounds.
fn vehicle<P>(plant: P, speed: StateBound, form: Form) -> Filter
where
    P: ControlAffine<4, 2> + Copy + Send + Sync + 'static,
{
    let obstacle = Outside(DistanceDisc::new([6.0, 3.0], 1.0, 0.5).expect("valid disc"));
    let builder = Filter::builder(plant)
        .barrier("goal", goal(), BarrierSettings::within(5.0))
        .and_then(|b| b.barrier("clear", obstacle, BarrierSettings::within(2.0)))
        .and_then(|b| b.barrier("speed", speed, BarrierSettings::within(1.0)))
        .and_then(|b| b.bounds(&[-6.0, -2.0], &[6.0, 2.0]))
        .expect("valid barriers");
    formed(builder.erased(), form)
}

/// A goal and a wall, for the bicycles that have their steering as a state.
fn walled<P>(plant: P, form: Form) -> Filter
where
    P: ControlAffine<5, 2> + Copy + Send + Sync + 'static,
{
    let wall = HalfPlane::new([-1.0, 0.2], [14.0, 0.0]).expect("valid half-plane");
    let builder = Filter::builder(plant)
        .barrier("goal", goal(), BarrierSettings::within(5.0))
        .and_then(|b| b.barrier("wall", wall, BarrierSettings::within(2.0)))
        .and_then(|b| b.bounds(&[-6.0, -4.0], &[6.0, 4.0]))
        .expect("valid barriers");
    formed(builder.erased(), form)
}

/// One barrier by each method, without bounds; `RepeatedRoot` and profiles start from the anchor.
fn by_method(settings: BarrierSettings, form: Form) -> Filter {
    let builder = Filter::builder(Unicycle).barrier("goal", goal(), settings).expect("valid barrier");
    formed(builder.erased(), form)
}

/// The filters that are tried, by number; the number of states and what u_ref is about.
fn filters(which: usize, form: Form) -> (Filter, usize) {
    let speed = || StateBound::at_most(3, 4.0).expect("valid bound");
    let soft =
        |b: FilterBuilder<PointMass, 4, 2>| b.strictness(Strictness::Soft(1.5)).expect("valid strictness");
    match which {
        0 => (vehicle(PointMass, speed(), form), 4),
        1 => (vehicle(Unicycle, speed(), form), 4),
        2 => (vehicle(Bicycle::new(2.0).expect("valid"), speed(), form), 4),
        3 => (walled(KinematicBicycle::new(1.0, 1.5).expect("valid"), form), 5),
        4 => (walled(SmallSlipBicycle::new(2.0).expect("valid").with_rate(), form), 5),
        5 => {
            let follow = Outside(goal().following(4));
            let builder = Filter::builder::<_, 8, 2>(WithPoint::<_, 4>(Unicycle))
                .barrier("clear", follow, BarrierSettings::within(3.0))
                .expect("valid barrier");
            (formed(builder.erased(), form), 8)
        }
        6 => {
            let builder = Filter::builder(PointMass)
                .barrier("goal", goal(), BarrierSettings::within(5.0))
                .map(soft)
                .and_then(|b| b.barrier("speed", NormBound::new(2, 3.0)?, BarrierSettings::within(1.0)))
                .expect("valid barriers");
            (formed(builder.erased(), form), 4)
        }
        7 => {
            // Its rate changes with the anchor, and so does what a disturbance asks for over a period.
            let settings = BarrierSettings::within(4.0).method(Method::RepeatedRoot).disturbance(3.0);
            (by_method(settings, form), 4)
        }
        8 => (by_method(BarrierSettings::within(4.0).profile(ProfileKind::LowPeak), form), 4),
        9 => {
            let builder = Filter::builder(PointMass)
                .barrier("speed", NormBound::new(2, 1.5).expect("valid"), BarrierSettings::within(2.0))
                .expect("valid barrier");
            (formed(builder.erased(), form), 4)
        }
        10 => {
            let quadratic = QuadraticDisc::new([12.0, 4.0], 2.0).expect("valid disc");
            let settings = BarrierSettings::within(5.0).margin(0.3).recovery(2.0);
            let builder = Filter::builder(Unicycle).barrier("goal", quadratic, settings).expect("valid");
            (formed(builder.erased(), form), 4)
        }
        _ => unreachable!("eleven filters"),
    }
}

const FILTERS: usize = 11;

fn sample() -> impl Strategy<Value = Sample> {
    let state = prop::collection::vec(-1.0..1.0, 8);
    (state, prop::collection::vec(-3.0..3.0, 2)).prop_map(|(x, u_ref)| {
        // Around the place where goal, obstacle and limits meet.
        let (centre, size) =
            ([6.0, 2.0, 0.3, 3.0, 8.0, 3.0, 0.5, -0.5], [6.0, 4.0, 1.5, 2.5, 4.0, 4.0, 1.0, 1.0]);
        let x = (0..8).map(|i| centre[i] + size[i] * x[i]).collect();
        Sample { t: 0.0, x, u_ref }
    })
}

fn direction() -> impl Strategy<Value = Sample> {
    (prop::collection::vec(-1.0..1.0, 8), prop::collection::vec(-1.0..1.0, 2)).prop_map(|(x, u_ref)| Sample {
        t: 0.0,
        x,
        u_ref,
    })
}

/// Every filter in every form at its anchor and later; the statuses met, and how often a kink was close.
#[test]
fn derivatives_are_those_of_the_sample() {
    let (mut met, mut kinks) = (Vec::<Status>::new(), 0);
    let mut wrong = Vec::new();
    let mut runner = proptest::test_runner::TestRunner::deterministic();
    for which in 0..FILTERS {
        for form in FORMS {
            for _ in 0..40 {
                let mut draw = || {
                    let strategy = (sample(), direction(), sample());
                    strategy.new_tree(&mut runner).expect("a value").current()
                };
                let (mut first, mut along, mut later) = draw();
                let (mut filter, states) = filters(which, form);
                for s in [&mut first, &mut along, &mut later] {
                    s.x.truncate(states);
                    if states == 5 {
                        // The steering.
                        s.x[4] *= 0.05;
                    }
                }
                let mut count = |compared| match compared {
                    Compared::Agrees(status) => met.push(status),
                    Compared::Kink => kinks += 1,
                    Compared::Differs(how) => wrong.push(format!("filter {which}, {form:?}: {how}")),
                };
                count(compare(&mut filter, &first, &along));
                let mut u = [0.0; 2];
                for i in 0..3 {
                    let sample = Sample { t: 0.05 * f64::from(i), ..first.clone() };
                    filter.step(sample.t, &sample.x, &sample.u_ref, &mut u).expect("right lengths");
                }
                // Near where it was, and elsewhere.
                for part in [0.02, 1.0] {
                    let between = |a: &[f64], b: &[f64]| {
                        a.iter().zip(b).map(|(a, b)| a + part * (b - a)).collect::<Vec<f64>>()
                    };
                    let x = between(&first.x, &later.x);
                    let at = Sample { t: 0.15, x, u_ref: later.u_ref.clone() };
                    count(compare(&mut filter, &at, &along));
                }
            }
        }
    }
    // Where the search ended beside the nearest input, a sample may be smooth along a direction and not along each axis.
    let few = wrong.len() * 1000 < met.len();
    assert!(few, "{} wrong\n{}", wrong.len(), wrong[..wrong.len().min(30)].join("\n"));
    let share = |status| met.iter().filter(|s| **s == status).count() as f64 / met.len() as f64;
    let all = met.len() + kinks;
    assert!(kinks * 200 < all, "{kinks} kinks of {all}");
    for (status, least) in [(Status::Filtered, 0.3), (Status::Infeasible, 0.02), (Status::Unchanged, 0.05)] {
        assert!(share(status) > least, "{status:?}: {}", share(status));
    }
}

/// A source that knows h = 1 − x₁ along ẋ₁ = u and nothing of directions.
struct Mute;

impl DerivativeSource for Mute {
    fn relative_degree(&self) -> usize {
        1
    }
    fn state_dim(&self) -> usize {
        1
    }
    fn input_dim(&self) -> usize {
        1
    }
    fn evaluate(&self, _t: f64, x: &[f64], out: &mut Derivatives) {
        *out = Derivatives::ZERO;
        (out.drift[0], out.row[0]) = (1.0 - x[0], -1.0);
    }
}

#[test]
fn what_is_not_known_is_said() {
    let mut filter = Filter::from_sources(1, 1)
        .source("mute", Box::new(Mute), BarrierSettings::within(1.0))
        .and_then(FilterBuilder::build)
        .expect("valid filter");
    let mut out = SampleDerivative::default();
    let mut differentiate = |x: &[f64], dx: &[f64], du_ref: &[f64]| {
        filter.differentiate(0.0, x, &[0.0], Direction { x: dx, u: du_ref }, &mut out)
    };
    let unknown = differentiate(&[3.0], &[1.0], &[0.0]).expect("lengths");
    assert_eq!(unknown, Some(NoDerivative::Source(0)));
    let error = differentiate(&[3.0], &[1.0], &[f64::NAN]).unwrap_err();
    assert_eq!(error.to_string(), "du_ref[1]: is NaN, must be finite");
    let error = differentiate(&[3.0], &[], &[0.0]).unwrap_err();
    assert_eq!(error.to_string(), "dx: has 0 components, must have 1");
    // Where the input is a constant nothing needs to be known.
    let unknown = differentiate(&[f64::NAN], &[1.0], &[1.0]);
    assert_eq!((unknown.expect("lengths"), out.u[0]), (None, 0.0));
}

/// A deadline that the bounds do not allow is given up for one that a search finds: the derivative is that of a filter which had
/// this one from the beginning.
#[test]
fn a_later_deadline_is_held() {
    let with = |deadline: f64, infeasible| {
        Filter::builder(PointMass)
            .barrier("goal", goal(), BarrierSettings::within(deadline).infeasible(infeasible))
            .and_then(|b| b.bounds(&[-1.0; 2], &[1.0; 2])?.sampling(Sampling::Period(0.01)))
            .and_then(FilterBuilder::build)
            .expect("valid filter")
    };
    let (x, dx) = ([0.0, 0.0, 0.1, 0.2], [0.3, -0.7, 0.5, 1.0]);
    let direction = Direction { x: &dx, u: &[1.0, 0.5] };
    let differentiate = |mut filter: Filter| {
        let mut out = SampleDerivative::default();
        let unknown = filter.differentiate(0.0, &x, &[0.0; 2], direction, &mut out).expect("lengths");
        assert_eq!(unknown, None);
        (filter.report().barriers[0].time_left, filter.report().barriers[0].postponed, out)
    };
    let (later, postponed, found) = differentiate(with(0.5, Infeasible::Earliest));
    assert!(postponed == 1 && later > 2.0, "{later}");
    let (_, postponed, wanted) = differentiate(with(later, Infeasible::Report));
    assert_eq!((postponed, found), (0, wanted));
}

/// Where a sample anchors a set that is to be kept, only round-off goes with h into the margin; on the way to one, what
/// held inputs cost along the profile.
#[test]
fn the_margin_of_an_anchor() {
    let promise = FixedTime::new(2, BarrierSettings::within(5.0)).expect("valid settings");
    for h in [[3.0, 0.5], [-3.0, 0.5]] {
        let anchored = |h: [f64; 2]| {
            let mut state = FixedTimeState::default();
            promise.anchor(&mut state, 0.0, &h, 5.0, 0.1);
            promise.advance(&mut state, 0.0, &h);
            state
        };
        let dh = [1.0, -0.7];
        let exact = (&[0.0; MAX_RELATIVE_DEGREE], [&Means::UNKNOWN; 2]);
        let moved = |by: f64| anchored([h[0] + by * dh[0], h[1] + by * dh[1]]).margin;
        let wanted = (moved(1e-3) - moved(-1e-3)) / 2e-3;
        let found =
            promise.differentiate(&anchored(h), true, 0.0, [&h, &dh], exact, Some(0.1)).expect("known");
        // The margin is linear where one piece of it is in force; what is left is the round-off of the difference.
        assert!(
            (found.margin - wanted).abs() <= 1e-9 * wanted.abs().max(1e-3),
            "{} for {wanted}",
            found.margin
        );
    }
}
