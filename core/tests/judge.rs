//! The verdict on a promise, against known interpolations of h.

use punctual_core::judge::{Interpolation, Judge, Judgement, PromiseState, Verdict};

/// Judges `h(t)`, seen every `step` s until `end`.
fn judged(
    deadline: Option<f64>,
    interpolation: Interpolation,
    (step, end): (f64, f64),
    h: impl Fn(f64) -> f64,
) -> Judgement {
    let mut judge = Judge::new(deadline, interpolation);
    for k in 0..=(end / step).round() as usize {
        let t = k as f64 * step;
        judge.see(t, h(t), PromiseState::InForce, false);
    }
    judge.judgement()
}

fn near(found: Option<f64>, wanted: f64, tolerance: f64) -> bool {
    found.is_some_and(|found| (found - wanted).abs() <= tolerance)
}

/// A straight way that crosses zero at `zero`: late where that is after the deadline, however the samples lie.
#[test]
fn the_deadline_lies_between_two_samples() {
    for (deadline, step) in [(10.0, 0.3), (10.0, 0.03), (1.0, 0.3), (7.7, 0.25), (2.0, 0.5)] {
        for (zero, verdict) in [
            (deadline + 0.06 * step, Verdict::Broken),
            (deadline - 0.06 * step, Verdict::Kept),
            (deadline, Verdict::Kept),
        ] {
            let way = |t: f64| 6.0 * (t - zero);
            let seen = judged(Some(deadline), Interpolation::Straight, (step, deadline + 3.0 * step), way);
            assert_eq!(seen.verdict(), verdict, "T = {deadline}, step {step}, zero at {zero}: {seen:?}");
            assert!(near(seen.arrival, zero, 1e-9), "{seen:?}");
            assert!(near(seen.least, way(deadline), 1e-9), "{seen:?}");
            assert_eq!(seen.on_time(), verdict == Verdict::Kept);
            assert_eq!(seen.late, (verdict == Verdict::Broken).then_some(deadline));
        }
    }
}

/// A parabola is its own cubic; a straight line through two of its points would be late.
#[test]
fn a_smooth_interpolation_is_a_cubic() {
    for (curve, step) in [(-2.0, 0.3), (-0.5, 0.7), (1.5, 0.4)] {
        let zero = 5.0 - 0.01 * step;
        let way = |t: f64| 3.0 * (t - zero) + curve * (t - zero) * (t - zero) * 0.1;
        let seen = judged(Some(5.0), Interpolation::Smooth, (step, 6.0), way);
        assert!(seen.on_time(), "{seen:?}");
        assert!(near(seen.arrival, zero, 1e-9), "{seen:?}");
        assert!(near(seen.least, way(5.0), 1e-9), "{seen:?}");
    }
}

/// A barrier that began inside is broken by any h < 0, before its deadline too; round-off is none.
#[test]
fn what_began_inside_is_to_stay() {
    for deadline in [None, Some(3.0), Some(8.0)] {
        let dip = |depth: f64| move |t: f64| if t > 1.75 && t < 2.25 { -depth } else { 4.0 };
        let seen = judged(deadline, Interpolation::Straight, (0.5, 10.0), dip(0.01));
        assert_eq!((seen.verdict(), seen.began_inside), (Verdict::Broken, true), "{seen:?}");
        assert!(seen.left.is_some_and(|t| t > 1.5 && t <= 2.0), "{seen:?}");
        assert_eq!(seen.least, Some(-0.01));
        for round_off in [0.0, 5e-14, 3.9e-9] {
            let seen = judged(deadline, Interpolation::Straight, (0.5, 10.0), dip(round_off));
            assert_eq!(seen.verdict(), Verdict::Kept, "{seen:?}");
        }
    }
}

#[test]
fn nothing_is_promised_from_outside_without_a_deadline() {
    let seen = judged(None, Interpolation::Straight, (0.1, 2.0), |t| t - 1.0);
    assert_eq!((seen.verdict(), seen.on_time(), seen.inside()), (Verdict::Nothing, false, false));
}

/// An alternative that is not taken, and one that is, at first.
#[test]
fn what_is_let_go_before_it_begins_is_no_promise() {
    for (first, verdict) in [(PromiseState::Waiting, Verdict::LetGo), (PromiseState::InForce, Verdict::Open)]
    {
        let mut judge = Judge::new(Some(5.0), Interpolation::Straight);
        judge.see(0.0, -1.0, first, false);
        judge.see(0.1, -1.0, PromiseState::Released, false);
        judge.see(9.0, -1.0, PromiseState::Released, false);
        assert_eq!(judge.judgement().verdict(), verdict);
    }
}

/// What begins later and has a deadline may be left until then, wherever it begins.
#[test]
fn what_begins_later_counts_from_its_deadline() {
    let seen = |h: fn(f64) -> f64| {
        let mut judge = Judge::new(Some(5.0), Interpolation::Straight);
        for k in 0..=80_u32 {
            let t = 0.1 * f64::from(k);
            let state = if t < 1.95 { PromiseState::Waiting } else { PromiseState::InForce };
            judge.see(t, h(t), state, false);
        }
        judge.judgement()
    };
    let back = seen(|t| if (3.0..4.0).contains(&t) { -1.0 } else { 1.0 });
    assert_eq!((back.verdict(), back.began_inside), (Verdict::Kept, false));
    let left = seen(|t| if (6.0..7.0).contains(&t) { -1.0 } else { 1.0 });
    assert_eq!(left.verdict(), Verdict::Broken);
}

/// Before the deadline a barrier that began outside may be left again; what counts is from then on.
#[test]
fn arriving_and_leaving() {
    let early = |t: f64| if (2.0..3.0).contains(&t) || t >= 4.9 { 1.0 } else { -1.0 };
    assert_eq!(judged(Some(5.0), Interpolation::Straight, (0.1, 8.0), early).verdict(), Verdict::Kept);
    let gone = |t: f64| if (2.0..4.0).contains(&t) { 1.0 } else { -1.0 };
    let seen = judged(Some(5.0), Interpolation::Straight, (0.1, 8.0), gone);
    assert_eq!((seen.verdict(), seen.late, seen.on_time()), (Verdict::Broken, None, true));
    assert!(near(seen.left, 3.95, 0.06), "{seen:?}");
    let later = |t: f64| if (4.0..6.0).contains(&t) { 1.0 } else { -1.0 };
    let seen = judged(Some(5.0), Interpolation::Straight, (0.1, 8.0), later);
    assert!(seen.verdict() == Verdict::Broken && near(seen.left, 5.95, 0.06), "{seen:?}");
    assert_eq!(judged(Some(5.0), Interpolation::Straight, (0.1, 4.0), gone).verdict(), Verdict::Open);
    let lost =
        judged(Some(5.0), Interpolation::Straight, (0.1, 8.0), |t| if t > 6.95 { f64::NAN } else { 1.0 });
    assert_eq!(lost.verdict(), Verdict::Broken, "a number that is none is not inside");
}

/// Released on arrival, and enforced from later on.
#[test]
fn windows() {
    let mut judge = Judge::new(Some(5.0), Interpolation::Straight);
    for (t, h, promise_state) in [
        (0.0, -3.0, PromiseState::InForce),
        (1.0, 1.0, PromiseState::Released),
        (2.0, -9.0, PromiseState::Released),
        (6.0, -9.0, PromiseState::Released),
    ] {
        judge.see(t, h, promise_state, false);
    }
    let seen = judge.judgement();
    assert!(near(seen.arrival, 0.75, 1e-9) && seen.verdict() == Verdict::Kept, "{seen:?}");
    let mut judge = Judge::new(None, Interpolation::Straight);
    for (t, h) in [(0.0, -3.0), (1.0, -1.0), (2.0, 1.0), (3.0, 2.0)] {
        let promise_state = if t < 2.0 { PromiseState::Waiting } else { PromiseState::InForce };
        judge.see(t, h, promise_state, false);
    }
    let seen = judge.judgement();
    assert_eq!((seen.verdict(), seen.began, seen.least), (Verdict::Kept, Some(2.0), Some(1.0)), "{seen:?}");
}

/// A deadline certainly lost counts as missed until it comes; h has the last word.
#[test]
fn certainty_and_h() {
    for (end, last, verdict) in
        [(3.0, -1.0, Verdict::Broken), (5.0, -1.0, Verdict::Broken), (5.0, 1.0, Verdict::Kept)]
    {
        let mut judge = Judge::new(Some(4.0), Interpolation::Straight);
        for k in 0..=5 {
            let t = f64::from(k);
            if t <= end {
                judge.see(t, if t >= 4.0 { last } else { -1.0 }, PromiseState::InForce, k >= 2);
            }
        }
        let seen = judge.judgement();
        let late = (verdict == Verdict::Broken).then_some(2.0);
        assert_eq!((seen.verdict(), seen.late), (verdict, late), "{seen:?}");
    }
}
