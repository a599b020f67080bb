//! The promise of one barrier along chains of integrators, for the methods and orders that have one.
//!
//! The loop is closed by hand: h⁽ⁿ⁾ is set to the floor, held over each step, and integrated exactly.

use punctual_core::convergence::comparison::factorial;
use punctual_core::convergence::repeated_root::{Deadlines, NoAdmissibleRate, Reason};
use punctual_core::convergence::{FixedTime, FixedTimeSettings, FixedTimeState, Method, Phase, Refusal};

/// The result of a run.
struct Run {
    /// Time of the first sample with h ≥ 0.
    arrival: f64,
    /// The least h at the samples after it.
    least_after: f64,
    on_course: bool,
}

/// Runs from `h` for twice the deadline; h⁽ⁿ⁾ is whatever the floor asks for, or 0 if that is more.
fn run(settings: FixedTimeSettings, mut h: Vec<f64>, step: f64) -> Run {
    let (n, deadline) = (h.len(), settings.deadline.expect("one"));
    let promise = FixedTime::new(n, settings).expect("valid settings");
    let mut state = FixedTimeState::default();
    let mut run = Run { arrival: f64::INFINITY, least_after: f64::INFINITY, on_course: true };
    for k in 0..=(2.0 * deadline / step) as usize {
        let t = k as f64 * step;
        let floor = promise.advance(&mut state, t, &h).floor;
        run.on_course &= state.on_course;
        if h[0] >= 0.0 {
            run.arrival = run.arrival.min(t);
        }
        if run.arrival < t {
            run.least_after = run.least_after.min(h[0]);
        }
        let top = floor.max(0.0);
        for j in 0..n {
            h[j] = (j..n).map(|i| h[i] * step.powi((i - j) as i32) / factorial(i - j)).sum::<f64>()
                + top * step.powi((n - j) as i32) / factorial(n - j);
        }
    }
    run
}

fn no_rate(promise: &FixedTime, state: &FixedTimeState) -> Option<NoAdmissibleRate> {
    match promise.refusal(state) {
        Some(Refusal::NoAdmissibleRate(none)) => Some(none),
        _ => None,
    }
}

fn settings(method: Method) -> FixedTimeSettings {
    FixedTimeSettings::within(5.0).method(method)
}

/// From rest the repeated root exists for even n and arrives a few samples late (theory: 5.001, 5.010,
/// 5.050 s for n = 2 and 5.002, 5.020, 5.100 s for n = 4).
#[test]
fn the_repeated_root_arrives_from_rest_for_even_orders() {
    for (n, step, wanted) in
        [(2, 0.001, 1), (2, 0.01, 1), (2, 0.05, 1), (4, 0.001, 2), (4, 0.01, 2), (4, 0.05, 2)]
    {
        let mut h = vec![0.0; n];
        h[0] = -10.0;
        let run = run(settings(Method::RepeatedRoot), h, step);
        let late = ((run.arrival - 5.0) / step).round();
        assert_eq!(late as i32, wanted, "n = {n}, step {step}: {}", run.arrival);
        assert!(run.least_after >= 0.0, "n = {n}, step {step}: {}", run.least_after);
    }
}

/// Without an admissible rate: no guarantee, the reason with the deadlines that have one, and a way in
/// that is finite.
#[test]
fn without_an_admissible_rate_nothing_is_promised() {
    let promise = FixedTime::new(3, settings(Method::RepeatedRoot)).expect("valid settings");
    let mut state = FixedTimeState::default();
    assert_eq!(promise.refusal(&state), None);
    let demand = promise.advance(&mut state, 0.0, &[-10.0, 0.0, 0.0]);
    let none = no_rate(&promise, &state).expect("none from rest");
    assert_eq!((none.reason, none.deadlines), (Reason::NoRealRoot, Deadlines::None));
    assert_eq!((state.phase, state.on_course, state.rate), (Phase::Approach, false, 4.0));
    // (D + 4)³ h ≥ 0: the stay rate 20/T takes the place of the root.
    assert_eq!(demand.floor, 640.0);

    let mut state = FixedTimeState::default();
    promise.advance(&mut state, 0.0, &[-10.0, 1.0, 0.0]);
    let none = no_rate(&promise, &state).expect("T = 5 is too short");
    assert_eq!(none.deadlines, Deadlines::From(10.0));
    assert!(!state.on_course);

    // With one, it is the rate of the state.
    let mut state = FixedTimeState::default();
    promise.advance(&mut state, 0.0, &[-10.0, 3.0, 0.0]);
    assert_eq!(promise.refusal(&state), None);
    assert!(state.on_course);
}

#[test]
fn odd_orders_arrive_where_a_rate_exists() {
    for h in [vec![-10.0, 3.0, 0.0], vec![-10.0, 0.0, 1.2], vec![-1.0, 2.0, -1.0, 0.5, 0.0]] {
        let run = run(settings(Method::RepeatedRoot), h.clone(), 0.001);
        assert!(run.arrival <= 5.0 + 0.002 * 1.5, "{h:?}: {}", run.arrival);
        assert!(run.least_after >= 0.0, "{h:?}: {}", run.least_after);
    }
}

#[test]
fn methods_are_refused_where_they_do_not_exist() {
    let message = |n, method| FixedTime::new(n, settings(method)).unwrap_err().to_string();
    assert_eq!(
        message(1, Method::RepeatedRoot),
        "method: the repeated root does not exist for relative degree 1; use the reference profile"
    );
}
