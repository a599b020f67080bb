//! A filter that is armed later than at its first sample: until then nothing is asked, and from then on it is, bit for bit, a
//! filter whose first sample came then.

use punctual_core::barriers::{DistanceDisc, Outside};
use punctual_core::filter::{
    AssuranceStatus, BarrierSettings, Filter, FilterBuilder, FilterState, Phase, Report, SampleDerivative,
    Sampling, Status,
};
use punctual_core::lie::Direction;
use punctual_core::plants::PointMass;

const BOUNDS: [f64; 2] = [8.0, 6.0];
const AFTER: f64 = 0.35;

/// A goal within 6 s and an obstacle on the way, armed `after` s.
fn filter(after: f64, sampling: Sampling, delay: f64) -> Filter {
    let disc = |centre, radius| DistanceDisc::new(centre, radius, 1.0).expect("valid disc");
    Filter::builder(PointMass)
        .barrier("goal", disc([20.0, 12.0], 2.0), BarrierSettings::within(6.0))
        .and_then(|b| b.barrier("rock", Outside(disc([10.0, 7.0], 2.0)), BarrierSettings::keeping()))
        .and_then(|b| b.bounds(&BOUNDS.map(|b| -b), &BOUNDS))
        .and_then(|b| b.sampling(sampling))
        .and_then(|b| b.actuation_delay(delay))
        .and_then(|b| b.arm_after(after))
        .and_then(FilterBuilder::build)
        .expect("valid filter")
}

/// Communication points that no master would choose.
fn irregular() -> impl Iterator<Item = f64> {
    let steps = [0.1, 0.07, 1e-9, 0.13, 0.02, 0.11, 0.0, 0.05];
    steps.into_iter().cycle().scan(3.0, |t, step| {
        let now = *t;
        *t += step;
        Some(now)
    })
}

/// A path of the state, and a wish that exceeds the bounds now and then.
fn at(t: f64) -> ([f64; 4], [f64; 2]) {
    let s = t - 3.0;
    ([1.0 + 2.0 * s, 0.5 + s, 2.0, 1.0], [12.0 * (3.0 * s).sin(), -5.0 * (2.0 * s).cos()])
}

fn step(filter: &mut Filter, t: f64) -> ([u64; 2], Report) {
    let ((x, u_ref), mut u) = (at(t), [f64::NAN; 2]);
    let report = filter.step(t, &x, &u_ref, &mut u).expect("right lengths").clone();
    (u.map(f64::to_bits), report)
}

fn assert_not_armed(t: f64, u: [u64; 2], report: &Report) {
    let (x, u_ref) = at(t);
    assert_eq!(report.status, Status::NotArmed, "at {t}");
    assert!(!report.status.is_satisfied() && report.status.is_abstention());
    for i in 0..2 {
        assert_eq!(u[i], u_ref[i].clamp(-BOUNDS[i], BOUNDS[i]).to_bits(), "u_ref within its bounds at {t}");
    }
    for b in &report.barriers {
        assert!(b.phase == Phase::Waiting && !b.guaranteed && !b.on_course && !b.arrived, "at {t}: {b:?}");
        assert_eq!((b.unmet_steps, b.time_left), (0, 0.0));
    }
    let distance = (x[0] - 20.0).hypot(x[1] - 12.0);
    let h = report.barriers[0].h;
    assert!((h < 0.0) == (distance > 2.0), "h is told all the same: {h} at {distance} m");
}

#[test]
fn from_then_on_it_is_a_filter_whose_first_sample_came_then() {
    for sampling in [Sampling::Pointwise, Sampling::Measured { first: Some(0.1) }, Sampling::Period(0.1)] {
        let (mut late, mut fresh) = (filter(AFTER, sampling, 0.0), filter(0.0, sampling, 0.0));
        let mut waited = 0;
        for t in irregular().take(60) {
            let (u, report) = step(&mut late, t);
            if t - 3.0 < AFTER {
                waited += 1;
                assert_not_armed(t, u, &report);
                continue;
            }
            assert_eq!((u, report), step(&mut fresh, t), "{sampling:?} at {t}");
            let start = late.state().start;
            assert_eq!(*late.state(), FilterState { start, ..fresh.state().clone() }, "at {t}");
        }
        assert!(waited > 3 && late.report().barriers[0].time_left < 6.0);
    }
}

/// Times that are added up or multiplied out reach it at the same sample, and a start far from 0 is none of its business.
#[test]
fn round_off_does_not_put_it_off() {
    for start in [0.0, -2.5, 1e3, 1e6] {
        for steps in [1_u32, 3, 7, 10, 1000] {
            let after = 0.1 * f64::from(steps);
            let mut added = start;
            let mut sums = vec![start];
            for _ in 0..steps {
                added += 0.1;
                sums.push(added);
            }
            let products: Vec<_> = (0..=steps).map(|k| start + 0.1 * f64::from(k)).collect();
            for times in [sums, products] {
                let mut filter = filter(after, Sampling::Pointwise, 0.0);
                let armed = times.iter().position(|t| step(&mut filter, *t).1.status != Status::NotArmed);
                assert_eq!(armed, Some(steps as usize), "{after} s from {start}: {:?}", times.last());
            }
        }
    }
}

#[test]
fn one_that_outlasts_the_run_never_asks_for_anything() {
    let mut filter = filter(1e9, Sampling::Measured { first: None }, 0.0);
    for t in irregular().take(200) {
        let (u, report) = step(&mut filter, t);
        assert_not_armed(t, u, &report);
    }
    assert_eq!((filter.state().time, filter.state().start), (None, Some(3.0)));
}

/// Deadlines are restarted by a re-arming; the time until the filter is armed is not.
#[test]
fn rearming_does_not_make_it_wait_again() {
    let mut filter = filter(AFTER, Sampling::Period(0.1), 0.0);
    step(&mut filter, 0.0);
    filter.rearm();
    assert_eq!(
        step(&mut filter, 0.3).1.status,
        Status::NotArmed,
        "before its time a re-arming changes nothing"
    );
    let (_, report) = step(&mut filter, 0.4);
    assert_eq!(report.barriers[0].time_left, 6.0, "counted from its first sample, not from the re-arming");
    step(&mut filter, 1.4);
    filter.rearm();
    let (_, report) = step(&mut filter, 2.4);
    assert_eq!((report.barriers[0].phase, report.barriers[0].time_left), (Phase::Approach, 6.0));
    // A run that begins earlier than all before is another one.
    filter.rearm();
    assert_eq!(step(&mut filter, -1.0).1.status, Status::NotArmed);
    assert_ne!(step(&mut filter, -1.0 + AFTER).1.status, Status::NotArmed);
}

#[test]
fn invalid_samples_begin_the_wait_and_do_not_end_it() {
    let mut filter = filter(AFTER, Sampling::Period(0.1), 0.0);
    let invalid = |filter: &mut Filter, t: f64| {
        let mut u = [f64::NAN; 2];
        filter.step(t, &[f64::NAN; 4], &[0.0; 2], &mut u).expect("right lengths").status
    };
    assert_eq!(invalid(&mut filter, 0.0), Status::InvalidInput);
    assert_eq!(filter.state().start, Some(0.0));
    assert_eq!(invalid(&mut filter, f64::NAN), Status::InvalidInput);
    assert_eq!(step(&mut filter, 0.2).1.status, Status::NotArmed);
    // Armed by now, but with nothing to anchor at.
    assert_eq!(invalid(&mut filter, 0.4), Status::InvalidInput);
    let (_, report) = step(&mut filter, 0.5);
    assert_eq!((report.barriers[0].phase, report.barriers[0].time_left), (Phase::Approach, 6.0));
}

#[test]
fn states_taken_on_either_side_lead_to_the_same() {
    let times: Vec<_> = irregular().take(30).collect();
    let mut filter = filter(AFTER, Sampling::Measured { first: Some(0.1) }, 0.0);
    let mut taken = Vec::new();
    for t in &times {
        taken.push(filter.state().clone());
        step(&mut filter, *t);
    }
    let after = filter.state().clone();
    for (k, state) in taken.iter().enumerate().rev() {
        filter.restore(state).expect("as many barriers");
        for t in &times[k..] {
            step(&mut filter, *t);
        }
        assert_eq!(*filter.state(), after, "from before sample {k}");
    }
    // Looking changes nothing.
    filter.restore(&taken[1]).expect("as many barriers");
    let ((x, u_ref), mut u) = (at(9.0), [0.0; 2]);
    assert_ne!(filter.peek(9.0, &x, &u_ref, &mut u).expect("right lengths").status, Status::NotArmed);
    assert_eq!(*filter.state(), taken[1]);
}

/// Where inputs act late, the one that acts at the arming is the one that was let pass.
#[test]
fn an_input_on_its_way_is_accounted_for() {
    let delay = 0.1;
    let answer = |u_ref: [f64; 2]| {
        let mut filter = filter(0.1, Sampling::Period(0.1), delay);
        let (x, mut u) = ([1.0, 0.5, 2.0, 1.0], [0.0; 2]);
        filter.step(0.0, &x, &u_ref, &mut u).expect("right lengths");
        assert_eq!(filter.report().status, Status::NotArmed);
        filter.step(0.1, &x, &[0.0; 2], &mut u).expect("right lengths");
        (u, filter.report().barriers[0].profile)
    };
    let (mut fresh, mut u) = (filter(0.0, Sampling::Period(0.1), delay), [0.0; 2]);
    fresh.step(0.1, &[1.0, 0.5, 2.0, 1.0], &[0.0; 2], &mut u).expect("right lengths");
    assert_eq!(answer([0.0; 2]), (u, fresh.report().barriers[0].profile), "nothing was on its way");
    assert_ne!(answer([5.0, 0.0]).1, fresh.report().barriers[0].profile);
    assert_eq!(answer([8.0, 0.0]), answer([80.0, 0.0]), "within its bounds");
}

#[test]
fn the_derivative_is_that_of_u_ref_and_h() {
    const STEP: f64 = 1e-6;
    let mut filter = filter(AFTER, Sampling::Period(0.1), 0.0);
    let (x, u_ref) = ([1.0, 0.5, 2.0, 1.0], [20.0, -3.0]);
    let (dx, du) = ([0.3, -0.4, 0.2, 0.1], [1.0, 0.5]);
    let mut out = SampleDerivative::default();
    let unknown = filter.differentiate(0.0, &x, &u_ref, Direction { x: &dx, u: &du }, &mut out);
    assert_eq!(unknown.expect("right lengths"), None);
    assert_eq!(out.u[..2], [0.0, 0.5], "the first is held by its bound");
    let mut h = |s: f64| {
        let moved: [f64; 4] = std::array::from_fn(|i| x[i] + s * dx[i]);
        let report = filter.peek(0.0, &moved, &u_ref, &mut [0.0; 2]).expect("right lengths");
        [report.barriers[0].h, report.barriers[1].h]
    };
    let (above, below) = (h(STEP), h(-STEP));
    for (i, b) in out.barriers.iter().enumerate() {
        let difference = (above[i] - below[i]) / (2.0 * STEP);
        assert!((b.h - difference).abs() < 1e-8, "{} {difference}", b.h);
        assert_eq!((b.slack, b.profile, b.margin, b.sampling_loss), (0.0, 0.0, 0.0, 0.0));
    }
}

/// Plans are decided on at the sample at which the filter is armed, from the state that is there then.
#[test]
fn plans_are_decided_on_when_it_is_armed() {
    let assured = |after| filter(after, Sampling::Period(0.1), 0.0).with_plans(0.1).expect("a filter");
    let (mut late, mut fresh) = (assured(0.5), assured(0.0));
    let mut moved = [1.0, 0.5, 2.0, 1.0];
    let hostile = [-20.0, 20.0];
    let mut derivative = SampleDerivative::default();
    for k in 0..80 {
        let (t, mut u) = (0.1 * f64::from(k), [0.0; 2]);
        let assurance =
            late.step(t, &moved, &hostile, &mut u).expect("right lengths").assurance.expect("plans");
        if k < 5 {
            assert_eq!((assurance.status, assurance.until), (AssuranceStatus::Undecided, None), "at {t}");
            assert_eq!((late.report().status, u), (Status::NotArmed, [-8.0, 6.0]));
            assert!(late.plan().is_none() && late.report().barriers.iter().all(|b| !b.guaranteed));
            // Nor is it decided on where u_ref is no number.
            let unwanted = late.peek(t, &moved, &[f64::NAN, 0.0], &mut [0.0; 2]);
            let unwanted = unwanted.expect("right lengths").assurance.expect("plans");
            assert_eq!(
                (unwanted.status, late.report().status),
                (AssuranceStatus::Undecided, Status::InvalidInput)
            );
            // Taken back and made again, in an instance of its own too.
            let state = late.state().clone();
            late.restore(&state).expect("its own");
            let mut other = assured(0.5);
            other.restore(&state).expect("that of an equal one");
            let mut ahead = [0.0; 2];
            let later = other.step(0.7, &moved, &hostile, &mut ahead).expect("right lengths");
            assert!(later.is_assured(), "decided when it is due, whatever was skipped");
            let direction = Direction { x: &[1.0, 0.0, 0.0, 0.0], u: &[1.0, 1.0] };
            let unknown = late.differentiate(t, &moved, &[1.0, -9.0], direction, &mut derivative);
            assert_eq!((unknown.expect("right lengths"), &derivative.u[..2]), (None, &[1.0, 0.0][..]));
        } else {
            let mut wanted = [0.0; 2];
            let other = fresh.step(t, &moved, &hostile, &mut wanted).expect("right lengths");
            let other = other.assurance.expect("plans");
            assert_eq!((assurance, u.map(f64::to_bits)), (other, wanted.map(f64::to_bits)), "at {t}");
            assert!(assurance.is_assured(), "at {t}: {assurance:?}");
        }
        let x = moved;
        moved = std::array::from_fn(|i| match i {
            0 | 1 => x[i] + 0.1 * x[i + 2] + 0.005 * u[i],
            _ => x[i] + 0.1 * u[i - 2],
        });
    }
    assert!(late.report().barriers[0].h >= 0.0, "6 s after the filter was armed it is there");
    // A re-arming forgets the plan, and decides again at once.
    late.rearm();
    assert_eq!(late.assurance().expect("plans").status, AssuranceStatus::Undecided);
    let mut u = [0.0; 2];
    assert!(late.step(8.0, &moved, &[0.0; 2], &mut u).expect("right lengths").is_assured());
}

#[test]
fn a_time_that_is_none_is_refused() {
    for bad in [-1e-9, f64::NAN, f64::INFINITY] {
        let error = Filter::from_sources(4, 2).arm_after(bad).err().expect("out of range").to_string();
        assert_eq!(error, format!("arm_after: is {bad}, must be finite and >= 0"));
    }
}
