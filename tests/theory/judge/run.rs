//! Runs a case and judges it.

use punctual_core::filter::{AssuranceStatus, Driver, Phase, Report, Status};
use punctual_core::plan::Failure;

use super::case::{Case, Numbers};
use super::model::{Input, State};
use super::motion::advance;

/// The fewest parts of a hold; h is checked at their ends. There are more if plant or set turn.
const PARTS: f64 = 20.0;
/// The angle in rad by which plant or set may turn within a part.
const TURN: f64 = 0.3;
/// The most parts; a run that turns faster than they resolve ends there.
const MOST_PARTS: f64 = 2000.0;
/// Fraction of the problem's size below which h counts as outside. The filter meets its rows to 1e-9 of their
/// terms, so that a promise without margin can end that far below 0.
const TOLERANCE: f64 = 1e-9;

/// An observed break of a promise.
#[derive(Clone, Copy, Debug)]
#[allow(dead_code, reason = "all of it is printed, to run a case again")]
pub(crate) struct Break {
    /// Time of the break, and of the sample from which the input was held.
    pub(crate) time: f64,
    pub(crate) sample: f64,
    pub(crate) hold: f64,
    pub(crate) h: f64,
    /// h relative to the size that counts as outside.
    pub(crate) size: f64,
    pub(crate) phase: Phase,
}

/// Findings on the promise on one set.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Promise {
    /// Whether h ≥ 0 at the anchor.
    pub(crate) inside: bool,
    /// Whether h < 0 at T itself.
    pub(crate) late: bool,
    /// The first sample with h ≥ 0, and whether h < 0 at an instant from there on.
    pub(crate) arrival: Option<f64>,
    pub(crate) out_after_arrival: bool,
    /// The lowest h when h ≥ 0 was promised, flagged or not.
    pub(crate) left: Option<Break>,
    /// The same while the report said `on_course`, in holds up to the announced length and in longer ones.
    pub(crate) broken: Option<Break>,
    pub(crate) broken_longer: Option<Break>,
    pub(crate) flagged_first: bool,
    /// Whether some sample was not flagged.
    pub(crate) unflagged: bool,
    pub(crate) unmet: usize,
    /// The lowest h of all.
    pub(crate) least: f64,
}

impl Promise {
    pub(crate) fn flag_lost_needlessly(&self) -> bool {
        self.unflagged && self.left.is_none()
    }
}

/// Result of a run.
#[derive(Clone, Debug)]
pub(crate) struct Run {
    pub(crate) promises: Vec<Promise>,
    pub(crate) samples: usize,
    /// Whether the state went so far, or turned so fast, that the rest was not checked.
    pub(crate) ended: bool,
}

/// Runs `case`; `observe` sees every sample.
pub(crate) fn run_seen(case: &Case, mut observe: impl FnMut(f64, &State, &Input, &Report)) -> Run {
    let mut filter = case.filter();
    let (states, inputs) = (case.plant.states(), case.plant.inputs());
    let mut numbers = Numbers::new(case.seed);
    let mut drawn = (f64::NEG_INFINITY, [0.0; 2]);
    let (mut t, mut x) = (case.start_time, case.start);
    let mut judge = Judge::new(case);
    let mut run = Run { promises: Vec::new(), samples: 0, ended: false };
    while t < case.start_time + case.horizon {
        let mut u = [0.0; 2];
        let wanted = case.wanted(t, &x, &mut drawn, &mut numbers);
        let report =
            filter.step(t, &x[..states], &wanted[..inputs], &mut u[..inputs]).expect("right dimensions");
        observe(t, &x, &u, report);
        let next = case.next_sample(run.samples, t, &mut numbers);
        judge.sample(t, next - t, report);
        x = judge.hold(t, &x, &u, next - t);
        run.samples += 1;
        t = next;
        run.ended = judge.spins || !x.iter().all(|v| v.abs() < 1e12);
        if run.ended {
            break;
        }
    }
    run.promises = judge.promises;
    run
}

pub(crate) fn run(case: &Case) -> Run {
    run_seen(case, |_, _, _, _| {})
}

/// Result of a run with a backup plan. A promise counts as flagged while it is assured.
#[derive(Clone, Debug)]
pub(crate) struct AssuredRun {
    pub(crate) run: Run,
    /// Why the start was refused, if it was; then there is no run.
    pub(crate) refused: Option<Failure>,
    /// The status of the guarantee at the end.
    pub(crate) status: AssuranceStatus,
    /// Samples driven by the plan, and those that were infeasible while assured.
    pub(crate) driven: usize,
    pub(crate) infeasible: usize,
}

impl AssuredRun {
    /// The first set whose promise was broken while it was assured.
    pub(crate) fn broken(&self) -> Option<(usize, Break)> {
        self.run
            .promises
            .iter()
            .enumerate()
            .find_map(|(i, p)| p.broken.or(p.broken_longer).map(|found| (i, found)))
    }
}

/// Runs `case` with a backup plan, announcing every hold. A case refused at the start is not run.
pub(crate) fn run_assured(case: &Case) -> AssuredRun {
    let mut filter = case.assured();
    let (states, inputs) = (case.plant.states(), case.plant.inputs());
    let mut numbers = Numbers::new(case.seed);
    let mut drawn = (f64::NEG_INFINITY, [0.0; 2]);
    let (mut t, mut x) = (case.start_time, case.start);
    let mut judge = Judge::new(case);
    let promised: Vec<bool> = filter.planning().expect("plans").promised(t, &x[..states]).collect();
    let mut run = AssuredRun {
        run: Run { promises: Vec::new(), samples: 0, ended: false },
        refused: None,
        status: AssuranceStatus::Undecided,
        driven: 0,
        infeasible: 0,
    };
    while t < case.start_time + case.horizon {
        let mut u = [0.0; 2];
        let wanted = case.wanted(t, &x, &mut drawn, &mut numbers);
        let next = case.next_sample(run.run.samples, t, &mut numbers);
        filter.expect_hold(Some(next - t)).expect("a hold");
        let assurance =
            filter.step(t, &x[..states], &wanted[..inputs], &mut u[..inputs]).expect("right dimensions");
        let assurance = assurance.assurance.expect("plans");
        run.status = assurance.status;
        if run.status == AssuranceStatus::Refused {
            run.refused = assurance.failure;
            break;
        }
        let is_bounded = u[..inputs].iter().zip(case.bounds).all(|(u, bound)| u.abs() <= bound);
        assert!(is_bounded, "{u:?} at {t}, bounds {:?}", case.bounds);
        run.driven += usize::from(assurance.driver == Driver::Plan);
        let infeasible = filter.report().status == Status::Infeasible;
        run.infeasible += usize::from(assurance.is_assured() && infeasible);
        judge.sample_assured(t, next - t, filter.report(), |i| assurance.is_assured() && promised[i]);
        x = judge.hold(t, &x, &u, next - t);
        run.run.samples += 1;
        t = next;
        run.run.ended = judge.spins || !x.iter().all(|v| v.abs() < 1e12);
        if run.run.ended {
            break;
        }
    }
    run.run.promises = judge.promises;
    run
}

/// The last report on one set.
#[derive(Clone, Copy)]
struct Said {
    on_course: bool,
    phase: Phase,
    /// Time in s into the hold from which h ≥ 0 is promised; infinite if it is not.
    from: f64,
}

struct Judge<'a> {
    case: &'a Case,
    promises: Vec<Promise>,
    said: Vec<Said>,
    /// Values of h below which a set is outside.
    floors: Vec<f64>,
    /// The parts of a hold: their ends in s, and the states there.
    grid: Vec<f64>,
    states: Vec<State>,
    /// Whether the last hold turned faster than can be resolved.
    spins: bool,
}

impl<'a> Judge<'a> {
    fn new(case: &'a Case) -> Self {
        let starts: Vec<_> =
            case.sets.iter().map(|set| set.shape.value(case.start_time, &case.start)).collect();
        let promise = |h: &f64| Promise {
            inside: *h >= 0.0,
            arrival: (*h >= 0.0).then_some(case.start_time),
            least: *h,
            ..Promise::default()
        };
        let size = starts.iter().fold(1.0, |size: f64, h| size.max(h.abs()));
        Self {
            case,
            promises: starts.iter().map(promise).collect(),
            said: vec![Said { on_course: false, phase: Phase::Waiting, from: 0.0 }; starts.len()],
            floors: vec![-TOLERANCE * size; starts.len()],
            grid: Vec::new(),
            states: Vec::new(),
            spins: false,
        }
    }

    /// Notes the filter's report on each set at `t`.
    fn sample(&mut self, t: f64, hold: f64, report: &Report) {
        let first = t == self.case.start_time;
        for (i, set) in self.case.sets.iter().enumerate() {
            let (b, promise) = (&report.barriers[i], &mut self.promises[i]);
            promise.flagged_first |= first && b.on_course;
            promise.unflagged |= !b.on_course;
            promise.unmet += usize::from(b.unmet_steps > 0);
            if b.h >= 0.0 && promise.arrival.is_none() {
                promise.arrival = Some(t);
            }
            let to_deadline = self.case.start_time + set.deadline - t;
            let from = if promise.inside || b.phase == Phase::Stay {
                0.0
            } else if set.keeping || to_deadline > hold {
                f64::INFINITY
            } else {
                to_deadline.max(0.0)
            };
            self.said[i] = Said { on_course: b.on_course, phase: b.phase, from };
        }
    }

    /// The same for promises that a backup plan keeps, as given by `assured`; nothing is promised before the
    /// deadline.
    fn sample_assured(&mut self, t: f64, hold: f64, report: &Report, assured: impl Fn(usize) -> bool) {
        self.sample(t, hold, report);
        for (i, set) in self.case.sets.iter().enumerate() {
            let to_deadline = self.case.start_time + set.deadline - t;
            let said = &mut self.said[i];
            said.on_course = assured(i);
            said.from = match (self.promises[i].inside, set.keeping) {
                (true, _) => 0.0,
                (false, true) => f64::INFINITY,
                (false, false) if to_deadline > hold => f64::INFINITY,
                (false, false) => to_deadline.max(0.0),
            };
        }
    }

    /// Moves the plant over a hold and checks every set.
    fn hold(&mut self, t: f64, x: &State, u: &Input, hold: f64) -> State {
        self.part(t, x, u, hold);
        let mut state = *x;
        self.states.clear();
        for k in 0..self.grid.len() {
            if k > 0 {
                state = advance(&self.case.plant, &state, u, self.grid[k] - self.grid[k - 1]);
            }
            self.states.push(state);
        }
        for i in 0..self.case.sets.len() {
            self.watch(i, t, u, hold);
        }
        state
    }

    /// Divides a hold into even parts, and at every deadline within it.
    fn part(&mut self, t: f64, x: &State, u: &Input, hold: f64) {
        let mut turning = self.case.plant.turning(x, u, hold);
        for set in &self.case.sets {
            turning = turning.max(set.shape.turning());
        }
        let parts = turning * hold / TURN;
        self.spins = parts > MOST_PARTS;
        let parts = parts.clamp(PARTS, MOST_PARTS).ceil() as usize;
        self.grid.clear();
        self.grid.extend((0..parts).map(|k| hold * k as f64 / parts as f64));
        self.grid.push(hold);
        for set in &self.case.sets {
            let deadline = self.case.start_time + set.deadline - t;
            if deadline > 0.0 && deadline < hold {
                let at = self.grid.partition_point(|s| *s < deadline);
                self.grid.insert(at, deadline);
            }
        }
    }

    /// Finds the lowest h of set `i` over a hold, both where it is promised and where not.
    fn watch(&mut self, i: usize, t: f64, u: &Input, hold: f64) {
        let set = &self.case.sets[i];
        let (said, floor) = (self.said[i], self.floors[i]);
        let arrived = self.promises[i].arrival.is_some();
        let h: Vec<f64> =
            self.grid.iter().zip(&self.states).map(|(s, x)| set.shape.value(t + s, x)).collect();
        let (mut least, mut promised) = (f64::INFINITY, (f64::INFINITY, 0.0));
        let mut see = |s: f64, h: f64| {
            // NaN is not inside.
            let h = if h.is_nan() { f64::NEG_INFINITY } else { h };
            least = h.min(least);
            if s >= said.from && h < promised.0 {
                promised = (h, s);
            }
        };
        for k in 0..h.len() {
            see(self.grid[k], h[k]);
            if k > 0 && k + 1 < h.len() && h[k] <= h[k - 1] && h[k] <= h[k + 1] {
                let around = [k - 1, k, k + 1];
                let s = vertex(around.map(|j| self.grid[j]), around.map(|j| h[j]));
                let left = if s < self.grid[k] { k - 1 } else { k };
                let x = advance(&self.case.plant, &self.states[left], u, s - self.grid[left]);
                see(s, set.shape.value(t + s, &x));
            }
        }
        let promise = &mut self.promises[i];
        let end = self.case.start_time + set.deadline;
        if !set.keeping && end > t && end <= t + hold {
            let at = self.grid.partition_point(|s| *s < end - t).min(h.len() - 1);
            promise.late = h[at] < floor || h[at].is_nan();
        }
        promise.least = promise.least.min(least);
        promise.out_after_arrival |= arrived && least < floor;
        if promised.0 >= floor {
            return;
        }
        let (h, s) = promised;
        let found = Break { time: t + s, sample: t, hold, h, size: h / floor, phase: said.phase };
        // A relative difference of 1e-9 is round-off, since times are sums.
        let longer = hold > self.case.longest_announced() * (1.0 + 1e-9);
        keep_worst(&mut promise.left, found);
        if said.on_course {
            keep_worst(if longer { &mut promise.broken_longer } else { &mut promise.broken }, found);
        }
    }
}

fn keep_worst(kept: &mut Option<Break>, found: Break) {
    if kept.is_none_or(|k| found.h < k.h) {
        *kept = Some(found);
    }
}

/// The minimum of the parabola through three points of which the middle one is lowest; the middle point if
/// they are on a line.
fn vertex(s: [f64; 3], h: [f64; 3]) -> f64 {
    let (left, right) = ((h[1] - h[0]) / (s[1] - s[0]), (h[2] - h[1]) / (s[2] - s[1]));
    let bend = right - left;
    // The slope is `left` in the middle of the first part, `right` in the middle of the second.
    let found = (s[0] + s[1]) / 2.0 - left / bend * (s[2] - s[0]) / 2.0;
    if found.is_finite() { found.clamp(s[0], s[2]) } else { s[1] }
}
