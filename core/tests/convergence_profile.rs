//! Custom profiles: the check accepts right ones and names the defect of others. Distinct rates.

use punctual_core::convergence::comparison::factorial;
use punctual_core::convergence::operator::Operator;
use punctual_core::convergence::profile::{Derivatives, Hermite, LowPeak, Profile, ProfileError, check};
use punctual_core::convergence::{FixedTime, FixedTimeSettings, FixedTimeState, ProfileKind, Refusal};

/// The Hermite profile with one derivative changed from a time on.
struct Broken {
    order: usize,
    from: f64,
    by: f64,
}

impl Profile for Broken {
    fn evaluate(&self, anchor: &[f64], deadline: f64, elapsed: f64) -> Derivatives {
        let mut r = Hermite.evaluate(anchor, deadline, elapsed);
        if elapsed >= self.from {
            r[self.order] += self.by;
        }
        r
    }
}

/// r = A − (A − e₀) e^{−bτ}: leaves with ė₀ = b (A − e₀), reaches zero at ln((A − e₀)/A)/b.
struct Exponential {
    aim: f64,
    start: f64,
    rate: f64,
}

impl Profile for Exponential {
    fn evaluate(&self, _anchor: &[f64], _deadline: f64, elapsed: f64) -> Derivatives {
        let decay = (self.start - self.aim) * (-self.rate * elapsed).exp();
        let mut r: Derivatives = std::array::from_fn(|k| decay * (-self.rate).powi(k as i32));
        r[0] += self.aim;
        r
    }
}

const ANCHOR: [f64; 8] = [-7.0, 2.0, -1.5, 0.4, 3.0, -2.0, 0.1, 5.0];

#[test]
fn the_hermite_profile_passes_for_every_order_and_scale() {
    for n in 1..=8 {
        for (deadline, size) in [(1.0, 1.0), (1e-3, 1e9), (1e4, 1e-6), (20.0, 1.0)] {
            let anchor: Vec<f64> = ANCHOR[..n].iter().map(|v| v * size).collect();
            assert_eq!(check(&Hermite, &anchor, deadline), Ok(()), "n = {n}, T = {deadline}");
        }
    }
}

#[test]
fn each_defect_is_named() {
    let (n, deadline) = (3, 2.0);
    let anchor = &ANCHOR[..n];
    let broken = |order, from, by| check(&Broken { order, from, by }, anchor, deadline);
    assert_eq!(broken(0, 10.0, 1.0), Ok(()));
    assert_eq!(broken(1, 0.0, 0.5), Err(ProfileError::Anchor { order: 1, found: 2.5, wanted: 2.0 }));
    // A constant more in any derivative contradicts the one before it, in the highest at once.
    assert!(matches!(broken(3, 0.0, 0.01), Err(ProfileError::Inconsistent { order: 3, .. })));
    // A jump of r itself contradicts r' where it is, whatever it jumps to.
    assert!(
        matches!(broken(0, 1.0, 1e-3), Err(ProfileError::Inconsistent { order: 1, elapsed, .. }) if elapsed <= 1.0)
    );
    assert!(
        matches!(broken(2, 1.5, f64::NAN), Err(ProfileError::NotFinite { order: 2, elapsed }) if elapsed >= 1.5)
    );
    let late = Exponential { aim: 1.0, start: -20.0, rate: 1.0 };
    let found = check(&late, &[-20.0, 21.0], deadline).unwrap_err();
    assert!(matches!(found, ProfileError::BelowZero { elapsed: 2.0, value } if value < 0.0), "{found}");
    assert!(found.to_string().ends_with("at 2 s, must be >= 0 from the deadline on"), "{found}");
}

/// n distinct rates and an exponential profile that lands inside: h stays above it and arrives, with the
/// floor held over each step.
#[test]
fn distinct_rates_track_a_profile_of_ones_own() {
    const STEP: f64 = 1e-3;
    for rates in [&[2.0][..], &[1.0, 4.0], &[0.5, 2.0, 8.0], &[1.0, 2.0, 3.0, 4.0]] {
        let n = rates.len();
        let profile = Exponential { aim: 1.0, start: -20.0, rate: 1.0 };
        let mut h = profile.evaluate(&[], 4.0, 0.0)[..n].to_vec();
        let rates = Operator::new(rates).expect("valid rates");
        let settings = FixedTimeSettings::within(4.0).rates(rates).stay_rate(2.0);
        let promise = FixedTime::new(n, settings).and_then(|p| p.with_profile(profile)).expect("valid");
        let mut state = FixedTimeState::default();
        for k in 0..8000 {
            let t = f64::from(k) * STEP;
            let demand = promise.advance(&mut state, t, &h);
            assert_eq!((promise.refusal(&state), state.fallback), (None, false), "ln 21 < 4");
            // The held floor is taken at the left end of the step, wrong by its slope, at most Π a_i + 1
            // times 21, times the step, and divided by Π a_i in the steady state.
            let product = rates.coefficients()[0];
            let low = demand.profile - 21.0 * STEP * (1.0 + 1.0 / product);
            assert!(h[0] >= low, "n = {n} at {t}: {} under {low}", h[0]);
            assert!(t < 4.0 || h[0] >= 0.0, "n = {n} at {t}: {}", h[0]);
            for j in 0..n {
                h[j] = (j..n).map(|i| h[i] * STEP.powi((i - j) as i32) / factorial(i - j)).sum::<f64>()
                    + demand.floor * STEP.powi((n - j) as i32) / factorial(n - j);
            }
        }
    }
}

/// A profile that is none from the anchor is refused with the reason; the Hermite profile takes its
/// place, with its guarantee.
#[test]
fn a_wrong_profile_is_refused_and_replaced() {
    let promise = FixedTime::new(2, FixedTimeSettings::within(4.0)).expect("valid");
    let wrong = promise
        .clone()
        .with_profile(Exponential { aim: 1.0, start: -20.0, rate: 1.0 })
        .expect("follows a profile");
    let (mut state, mut plain) = (FixedTimeState::default(), FixedTimeState::default());
    for (t, h) in [(0.0, [-20.0, 0.0]), (0.5, [-19.0, 3.0])] {
        let demand = wrong.advance(&mut state, t, &h);
        assert_eq!(demand, promise.advance(&mut plain, t, &h), "at {t}");
        assert!(state.fallback && state.on_course && !plain.fallback, "at {t}");
    }
    let refusal = wrong.refusal(&state).expect("refused");
    assert_eq!(refusal, Refusal::Profile(ProfileError::Anchor { order: 1, found: 21.0, wanted: 0.0 }));
    assert_eq!(refusal.to_string(), "derivative 1 of the profile starts at 21, the anchor has 0");
}

#[test]
fn rates_have_to_fit_the_barrier() {
    let refused = |n, settings| FixedTime::new(n, settings).expect_err("refused").to_string();
    let rates = Some(Operator::new(&[1.0, 2.0]).expect("valid rates"));
    let settings = FixedTimeSettings::within(1.0).rates(rates);
    assert_eq!(refused(3, settings), "rates: has 2 components, must have 3, the relative degree");
    let both = settings.rate(1.0);
    assert_eq!(refused(2, both), "rates: given beside `rate`, which it replaces");
    let root = settings.method(punctual_core::convergence::Method::RepeatedRoot);
    assert_eq!(refused(2, root), "rates: belongs to the reference profile");
}

/// On the profile of the settings the floor is its own r⁽ⁿ⁾.
#[test]
fn the_low_peak_profile_is_followed_from_sample_to_sample() {
    let settings = FixedTimeSettings::within(2.0).profile(ProfileKind::LowPeak);
    let promise = FixedTime::new(2, settings).expect("valid");
    let (anchor, mut state) = ([-1.0, 0.25], FixedTimeState::default());
    promise.advance(&mut state, 0.0, &anchor);
    for elapsed in [0.5, 1.5] {
        let r = LowPeak.evaluate(&anchor, 2.0, elapsed);
        let demand = promise.advance(&mut state, elapsed, &r[..2]);
        assert_eq!((demand.profile, demand.floor), (r[0], r[2]), "{elapsed}");
        assert_ne!(r[2], Hermite.evaluate(&anchor, 2.0, elapsed)[2]);
    }
}
