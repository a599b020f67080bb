//! What a filter costs: the smallest number with which a closed loop works, such as an input bound or a
//! deadline, and profiles and rates compared by it.
//!
//! Both are found by running the closed loop, so they are facts about one start, one plant and one u_ref,
//! and upper bounds: another filter may do with less.

use crate::MAX_INPUTS;
use crate::dynamics::DynPlant;
use crate::error::{Error, positive};
use crate::filter::{BarrierSettings, ProfileKind, SafetyFilter};
use crate::simulation::Schedule;

/// What a closed loop came to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Run {
    /// Whether every barrier had h ≥ 0 at every sample from its deadline on. The run ends where one had not.
    pub kept: bool,
    /// Time in s of the last first arrival; `None` where a barrier has not arrived.
    pub arrival: Option<f64>,
    /// Largest |u_i| of each input; zeros above the number of inputs.
    pub peak: [f64; MAX_INPUTS],
    /// Steps that did not satisfy every constraint.
    pub unmet: usize,
}

/// Runs `filter` and `plant` in closed loop from time `t` (s) and the filter's state `x0`: the plant's states come
/// first in it, what follows stays as it is. `deadlines` (s from `t`) are those of the barriers.
/// `nominal(x, u_ref)` writes u_ref.
///
/// # Errors
///
/// A step that is not finite or ≤ 0, and misuse of the filter.
pub fn run(
    filter: &mut SafetyFilter,
    plant: &dyn DynPlant,
    (t, x0): (f64, &[f64]),
    schedule: Schedule,
    deadlines: &[f64],
    mut nominal: impl FnMut(&[f64], &mut [f64]),
) -> Result<Run, Error> {
    let step = positive("step", schedule.step)?;
    let substeps = schedule.substeps.max(1);
    let inputs = plant.input_dim();
    let mut x = x0.to_vec();
    let (mut u_ref, mut u) = (vec![0.0; inputs], vec![0.0; inputs]);
    let mut run = Run { kept: true, arrival: None, peak: [0.0; MAX_INPUTS], unmet: 0 };
    let mut arrivals = vec![None; deadlines.len()];
    for k in 0..=schedule.steps {
        let elapsed = k as f64 * step;
        nominal(&x, &mut u_ref);
        let report = filter.step(t + elapsed, &x, &u_ref, &mut u)?;
        run.unmet += usize::from(!report.status.is_satisfied());
        for ((b, deadline), arrival) in report.barriers.iter().zip(deadlines).zip(&mut arrivals) {
            // Round-off of the times must not bring a sample before its deadline.
            run.kept &= b.h >= 0.0 || elapsed < deadline * (1.0 - 1e-12);
            if b.h >= 0.0 && arrival.is_none() {
                *arrival = Some(elapsed);
            }
        }
        for (peak, u) in run.peak.iter_mut().zip(&u) {
            *peak = peak.max(u.abs());
        }
        if !run.kept {
            break;
        }
        if k < schedule.steps {
            for _ in 0..substeps {
                plant.rk4_step(&mut x[..plant.state_dim()], &u, step / substeps as f64)?;
            }
        }
    }
    run.arrival = arrivals.into_iter().try_fold(0.0, |last: f64, arrival| Some(last.max(arrival?)));
    Ok(run)
}

/// A number between `low` and `high` (0 < low ≤ high) with which `works` is true, at most `1 + tolerance`
/// times one with which it is not: the smallest where it works for all larger ones. By bisection of the
/// ratio. `None` where it does not work at `high`, or the limits are not numbers as above; `low` where it
/// works there.
///
/// ```
/// let found = punctual_core::effort::smallest([1.0, 100.0], 1e-3, |x| Ok::<_, ()>(x >= 7.0));
/// assert!(found.is_ok_and(|x| x.is_some_and(|x| (7.0..7.01).contains(&x))));
/// ```
///
/// # Errors
///
/// Those of `works`.
pub fn smallest<E>(
    [mut low, mut high]: [f64; 2],
    tolerance: f64,
    mut works: impl FnMut(f64) -> Result<bool, E>,
) -> Result<Option<f64>, E> {
    let valid = low > 0.0 && low <= high && high.is_finite();
    if !valid || !works(high)? {
        return Ok(None);
    }
    if works(low)? {
        return Ok(Some(low));
    }
    while high > low * (1.0 + tolerance) {
        let middle = low * (high / low).sqrt();
        if middle <= low || middle >= high {
            break;
        }
        if works(middle)? {
            high = middle;
        } else {
            low = middle;
        }
    }
    Ok(Some(high))
}

/// A profile and a rate to try.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    /// The profile.
    pub profile: ProfileKind,
    /// Rate times deadline.
    pub rate_times_deadline: f64,
}

/// What [`compare`] tries: both profiles with rates from slow to the default. Slower ones follow the profile
/// less tightly, so that an error costs less at once; faster ones ask for more input than the profile.
pub const CANDIDATES: [Candidate; 8] = {
    const fn of(profile: ProfileKind, rate_times_deadline: f64) -> Candidate {
        Candidate { profile, rate_times_deadline }
    }
    use ProfileKind::{Hermite, LowPeak};
    [
        of(Hermite, 20.0),
        of(Hermite, 10.0),
        of(Hermite, 5.0),
        of(Hermite, 2.5),
        of(LowPeak, 20.0),
        of(LowPeak, 10.0),
        of(LowPeak, 5.0),
        of(LowPeak, 2.5),
    ]
};

impl Candidate {
    /// `settings` with this profile and rate in place of theirs.
    pub fn applied(&self, settings: BarrierSettings) -> BarrierSettings {
        let rate = settings.deadline.map(|deadline| self.rate_times_deadline / deadline);
        BarrierSettings { profile: self.profile, rate, rates: None, ..settings }
    }
}

/// What a candidate needs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rating {
    /// Which.
    pub candidate: Candidate,
    /// Its peak input without a bound; `None` where its deadlines are not kept even then.
    pub peak: Option<f64>,
    /// The smallest bound on the input with which the deadlines are kept, to a hundredth.
    pub bound: Option<f64>,
}

/// Rates every one of `candidates`: `try_out(candidate, bound)` runs the closed loop with the input bounded to
/// ±`bound` (infinite: unbounded) and returns whether the deadlines are kept, and the peak input.
///
/// The bound is looked for between `1e-2` of the peak and the peak itself, with which the unbounded run is
/// its own proof. Best first: by bound, then by peak.
///
/// # Errors
///
/// Those of `try_out`.
pub fn compare<E>(
    candidates: &[Candidate],
    mut try_out: impl FnMut(&Candidate, f64) -> Result<(bool, f64), E>,
) -> Result<Vec<Rating>, E> {
    let mut ratings = Vec::with_capacity(candidates.len());
    for candidate in candidates {
        let (kept, peak) = try_out(candidate, f64::INFINITY)?;
        let mut rating = Rating { candidate: *candidate, peak: kept.then_some(peak), bound: None };
        if kept && peak > 0.0 {
            rating.bound = smallest([1e-2 * peak, peak], 1e-2, |bound| Ok(try_out(candidate, bound)?.0))?;
        }
        ratings.push(rating);
    }
    let key = |r: &Rating| (r.bound.unwrap_or(f64::INFINITY), r.peak.unwrap_or(f64::INFINITY));
    ratings.sort_by(|a, b| key(a).partial_cmp(&key(b)).unwrap_or(std::cmp::Ordering::Equal));
    Ok(ratings)
}
