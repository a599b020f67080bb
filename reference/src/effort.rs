//! Cost of a filter: the smallest number with which a closed loop works, such as an input bound or a
//! deadline; profiles and rates compared by it.
//!
//! Both are found by running the closed loop, so they hold for one start, one plant and one u_ref. They are
//! also upper bounds: another filter may need less.

use std::collections::VecDeque;

use crate::simulation::Schedule;
use punctual_core::MAX_INPUTS;
use punctual_core::dynamics::DynPlant;
use punctual_core::error::{Error, non_negative, positive};
use punctual_core::filter::{BarrierSettings, Filter, Phase, ProfileKind, Report, Status};
use punctual_core::judge::{Interpolation, Judge, Judgement, PromiseState, Verdict};

/// A closed loop to run.
#[derive(Clone, Copy)]
pub struct Loop<'a> {
    /// The plant; its states are the first ones of the filter's state.
    pub plant: &'a dyn DynPlant,
    /// Time in s and the filter's state. Components beyond the plant's states do not change.
    pub start: (f64, &'a [f64]),
    /// Sampling and integration. h is evaluated after each substep, and at the deadlines themselves.
    pub schedule: Schedule,
    /// Deadlines of the barriers, in s from the start; infinite for a barrier without one.
    pub deadlines: &'a [f64],
    /// Time in s between the computation of an input and its effect, ≥ 0. Until then earlier inputs act, at first 0.
    pub delay: f64,
    /// Time in s after the start from which a broken promise ends the run.
    pub until: f64,
}

/// Result of a closed loop.
#[derive(Clone, Debug, PartialEq)]
pub struct Run {
    /// Whether no promise was broken, and each barrier had one.
    pub kept: bool,
    /// Time in s from the start until all barriers have first arrived; `None` if one has not.
    pub arrival: Option<f64>,
    /// Largest |u_i| of each input; zeros beyond the number of inputs.
    pub peak: [f64; MAX_INPUTS],
    /// Steps that did not meet every constraint.
    pub unmet: usize,
    /// Findings on each barrier.
    pub barriers: Vec<Seen>,
    /// Smallest and largest value of each of the plant's states; NaN if the state ever became NaN.
    pub states: Vec<[f64; 2]>,
    /// The last instant in s.
    pub end: f64,
}

/// Findings on a barrier.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Seen {
    /// The verdict on its promise, by h itself.
    pub judgement: Judgement,
    /// Steps that did not meet its constraint.
    pub unmet: usize,
    /// The first of these steps, in s.
    pub first_unmet: Option<f64>,
}

/// A closed loop while it runs.
struct Running<'a> {
    setting: &'a Loop<'a>,
    judges: Vec<Judge>,
    run: Run,
    /// Buffer for h of each barrier.
    h: Vec<f64>,
}

impl Running<'_> {
    /// Evaluates a sample.
    fn sample(&mut self, t: f64, x: &[f64], u: &[f64], report: &Report) {
        let run = &mut self.run;
        let is_armed = report.status != Status::NotArmed;
        run.unmet += usize::from(is_armed && !report.status.is_satisfied());
        for ((b, judge), seen) in report.barriers.iter().zip(&mut self.judges).zip(&mut run.barriers) {
            if is_armed {
                judge.see(t, b.h, promise_state(b.phase), b.deadline_unreachable);
            }
            let enforced = promise_state(b.phase) == PromiseState::InForce;
            if b.unmet_steps > 0 || enforced && report.status.is_abstention() {
                seen.unmet += 1;
                seen.first_unmet.get_or_insert(t);
            }
        }
        for (peak, u) in run.peak.iter_mut().zip(u) {
            *peak = peak.max(u.abs());
        }
        self.bound(x);
        self.run.end = t;
    }

    /// Evaluates an instant between two samples.
    fn instant(&mut self, filter: &Filter, t: f64, x: &[f64]) -> Result<(), Error> {
        if filter.report().status != Status::NotArmed {
            filter.barrier_values(t, x, &mut self.h)?;
            let barriers = &filter.report().barriers;
            for ((h, b), judge) in self.h.iter().zip(barriers).zip(&mut self.judges) {
                judge.see(t, *h, promise_state(b.phase), b.deadline_unreachable);
            }
        }
        self.bound(x);
        Ok(())
    }

    fn bound(&mut self, x: &[f64]) {
        for (ends, x) in self.run.states.iter_mut().zip(x) {
            // NaN persists.
            if x.is_nan() || *x < ends[0] {
                ends[0] = *x;
            }
            if x.is_nan() || *x > ends[1] {
                ends[1] = *x;
            }
        }
    }

    fn is_broken(&self) -> bool {
        let lost = |judge: &Judge| matches!(judge.judgement().verdict(), Verdict::Broken | Verdict::Nothing);
        self.judges.iter().any(lost)
    }

    /// Moves the plant over the period that begins at `t`, and the points that follow its states in `x` at their velocities;
    /// `sent` are the inputs that act one after another, each with the time in s at which it begins to.
    fn advance(
        &mut self,
        filter: &Filter,
        t: f64,
        x: &mut [f64],
        sent: &VecDeque<(f64, Vec<f64>)>,
    ) -> Result<(), Error> {
        let Loop { plant, schedule, deadlines, start, .. } = *self.setting;
        let (step, substeps) = (schedule.step, schedule.substeps.max(1));
        let (same, mut at) = (1e-9 * step, 0.0);
        for j in 1..=substeps {
            let end = step * (j as f64 / substeps as f64);
            while at < end {
                let cuts = deadlines.iter().map(|deadline| start.0 + deadline - t);
                let cuts = cuts.chain(sent.iter().map(|(begin, _)| begin - t));
                let to = cuts.filter(|cut| *cut > at + same && *cut < end - same).fold(end, f64::min);
                let acts = |(begin, _): &&(f64, Vec<f64>)| begin - t < to - same;
                let u = sent.iter().rfind(acts).map_or(&[][..], |(_, u)| u);
                let (states, points) = x.split_at_mut(plant.state_dim());
                plant.rk4_step(states, u, to - at)?;
                for point in points.chunks_exact_mut(4) {
                    point[0] += point[2] * (to - at);
                    point[1] += point[3] * (to - at);
                }
                at = to;
                if at < step {
                    self.instant(filter, t + at, x)?;
                }
            }
        }
        Ok(())
    }
}

fn promise_state(phase: Phase) -> PromiseState {
    match phase {
        Phase::Waiting => PromiseState::Waiting,
        Phase::Released => PromiseState::Released,
        _ => PromiseState::InForce,
    }
}

/// Runs `filter` in the closed loop that `setting` describes. `nominal(t, x, u_ref)` writes u_ref at time t in s.
///
/// # Errors
///
/// A step that is not finite or ≤ 0, and misuse of the filter.
pub fn run(
    filter: &mut Filter,
    setting: &Loop<'_>,
    mut nominal: impl FnMut(f64, &[f64], &mut [f64]),
) -> Result<Run, Error> {
    let step = positive("step", setting.schedule.step)?;
    non_negative("delay", setting.delay)?;
    let (states, inputs) = (setting.plant.state_dim(), setting.plant.input_dim());
    let (t0, x0) = setting.start;
    let mut x = x0.to_vec();
    let (mut u_ref, mut u) = (vec![0.0; inputs], vec![0.0; inputs]);
    let mut sent = VecDeque::from([(f64::NEG_INFINITY, u.clone())]);
    let count = setting.deadlines.len();
    let judge = |deadline: &f64| Judge::new(Some(*deadline), Interpolation::Straight);
    let run = Run {
        kept: false,
        arrival: None,
        peak: [0.0; MAX_INPUTS],
        unmet: 0,
        barriers: vec![Seen::default(); count],
        states: x0.iter().take(states).map(|x| [*x; 2]).collect(),
        end: t0,
    };
    let judges = setting.deadlines.iter().map(judge).collect();
    let mut running = Running { setting, judges, run, h: vec![0.0; count] };
    if filter.counts_holds() {
        filter.expect_hold(Some(step))?;
    }
    for k in 0..=setting.schedule.steps {
        let t = t0 + k as f64 * step;
        nominal(t, &x, &mut u_ref);
        let report = filter.step(t, &x, &u_ref, &mut u)?;
        running.sample(t, &x, &u, report);
        let lost = t - t0 >= setting.until && running.is_broken();
        if lost || k == setting.schedule.steps || !x.iter().all(|x| x.is_finite()) {
            break;
        }
        sent.push_back((t + setting.delay, u.clone()));
        while sent.get(1).is_some_and(|(begin, _)| *begin <= t + 1e-9 * step) {
            sent.pop_front();
        }
        running.advance(filter, t, &mut x, &sent)?;
    }
    let mut run = running.run;
    for (seen, judge) in run.barriers.iter_mut().zip(&running.judges) {
        seen.judgement = judge.judgement();
    }
    let lost = |seen: &Seen| matches!(seen.judgement.verdict(), Verdict::Broken | Verdict::Nothing);
    run.kept = !run.barriers.iter().any(lost) && run.states.iter().flatten().all(|x| x.is_finite());
    let arrivals = run.barriers.iter().map(|seen| seen.judgement.arrival);
    run.arrival = arrivals.into_iter().try_fold(0.0, |last: f64, arrival| Some(last.max(arrival? - t0)));
    Ok(run)
}

/// A number between `low` and `high` (0 < low ≤ high) for which `works` is true, at most `1 + tolerance`
/// times one for which it is false. If `works` also holds for all larger numbers, that is the smallest one up
/// to the tolerance. It is found by bisection of the ratio. `low` if it works; `None` if `high` does not
/// work, or the limits are invalid.
///
/// ```
/// let found = punctual_reference::effort::smallest([1.0, 100.0], 1e-3, |x| Ok::<_, ()>(x >= 7.0));
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

/// A combination of profile and rate to try.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    /// The profile.
    pub profile: ProfileKind,
    /// Rate times deadline.
    pub rate_times_deadline: f64,
}

/// Candidates of [`compare`]: both profiles, with rates from slow to the default. Slower rates follow the
/// profile less tightly, so that an error costs less immediately. Faster ones require more input than the
/// profile.
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
    /// `settings` with this profile and rate.
    pub fn applied(&self, settings: BarrierSettings) -> BarrierSettings {
        let rate = settings.deadline.map(|deadline| self.rate_times_deadline / deadline);
        settings.profile(self.profile).rate(rate).rates(None)
    }
}

/// The input that a candidate needs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rating {
    /// The candidate.
    pub candidate: Candidate,
    /// Its peak input without a bound; `None` if it misses its deadlines even then.
    pub peak: Option<f64>,
    /// The smallest bound on the input with which the deadlines are kept, to a hundredth.
    pub bound: Option<f64>,
}

/// Rates all `candidates`. `try_out(candidate, bound)` runs the closed loop with the input bounded to
/// ±`bound` (infinite: unbounded). It returns whether the deadlines are kept, and the peak input.
///
/// The bound is searched between `1e-2` of the peak and the peak itself, which the unbounded run has shown to
/// suffice. Best first: by bound, then by peak.
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
