//! The verdict on a barrier's promise, by h itself and not by what the filter says of it.
//!
//! A barrier that began inside is to have h ≥ 0 at all times; one that began outside, or that begins later and has a
//! deadline, from its deadline on.
//! [`Judge`] sees h at instants, and judges at the deadline itself where that lies between two of them. It goes
//! along a straight line where h has relative degree 1 (exact for an integrator and a linear h), else along the
//! cubic through the last four. Between two instants that are both inside it looks for nothing.

/// Round-off of h, as a part of the largest |h| seen.
pub const TOLERANCE: f64 = 1e-9;
/// Round-off of h, in its unit, where all that was seen is smaller.
const LEAST_TOLERANCE: f64 = 1e-12;
/// Round-off of a time that is a sum of steps, as a part of it.
const SAME_TIME: f64 = 1e-9;
/// Instants that a cubic goes through, besides the newest.
const BEFORE: usize = 3;

/// How h runs from one instant to the next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interpolation {
    /// Along a straight line: relative degree 1, or instants that are close.
    Straight,
    /// Along the cubic through this instant and the three before.
    Smooth,
}

/// The state of a barrier's promise at an instant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PromiseState {
    /// Not enforced yet.
    Waiting,
    /// Enforced.
    InForce,
    /// Let go: nothing is promised any more.
    Released,
}

/// The verdict on a promise.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
pub enum Verdict {
    /// On time, and inside from then on; always inside where it began inside.
    Kept,
    /// Late, or left.
    Broken,
    /// Not decided: the instants seen end before the deadline, or before it was enforced.
    #[default]
    Open,
    /// It began outside and has no deadline: there is no promise.
    Nothing,
    /// It was let go before it began: another alternative was taken, or what it waited for was there.
    LetGo,
}

/// The facts seen of a barrier, and the verdict that follows.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Judgement {
    /// Time in s at which it was enforced first.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub began: Option<f64>,
    /// Whether it is to be inside from then on: h ≥ 0 held then, and it began with the first instant or has no deadline.
    pub began_inside: bool,
    /// The instant of its deadline in s; `None` where it has none, or nothing was seen.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub deadline: Option<f64>,
    /// Time in s at which h ≥ 0 held first.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub arrival: Option<f64>,
    /// Time in s since which h ≥ 0 has held, where it does.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub since: Option<f64>,
    /// Time in s at which it was known that the deadline is missed.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub late: Option<f64>,
    /// Time in s at which it was left after it had been inside, and was to stay so.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub left: Option<f64>,
    /// Least h while it was to be inside: from the deadline on, from the start where it began inside.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub least: Option<f64>,
    /// Whether there was an instant at which it was to be inside.
    reached: bool,
    /// Whether it was outside at one of them.
    outside: bool,
    /// Whether it was let go before it began.
    let_go: bool,
}

impl Judgement {
    /// Whether h ≥ 0 held by the deadline; at the start, where there is none.
    pub fn on_time(&self) -> bool {
        let limit = if self.began_inside { self.began } else { self.deadline };
        let by = |limit: f64| self.arrival.is_some_and(|t| t <= limit + SAME_TIME * limit.abs().max(1.0));
        limit.is_some_and(by)
    }

    /// By how many seconds it arrived later than its deadline; infinite where it was late and has not arrived. `None` where it
    /// was not late.
    pub fn late_by(&self) -> Option<f64> {
        let (_, deadline) = (self.late?, self.deadline?);
        Some(self.arrival.map_or(f64::INFINITY, |arrival| arrival - deadline))
    }

    /// Whether h ≥ 0 held at all instants at which it was to be inside, and there was one.
    pub fn inside(&self) -> bool {
        self.reached && !self.outside
    }

    /// The verdict on the promise.
    pub fn verdict(&self) -> Verdict {
        match () {
            () if self.let_go => Verdict::LetGo,
            () if self.began.is_some() && !self.began_inside && self.deadline.is_none() => Verdict::Nothing,
            () if self.outside || self.late.is_some() => Verdict::Broken,
            () if self.on_time() && self.inside() && self.is_complete() => Verdict::Kept,
            () => Verdict::Open,
        }
    }

    /// Whether the deadline has been seen, or there is none.
    fn is_complete(&self) -> bool {
        self.began_inside || self.reached
    }
}

/// A judge of one barrier, by h at instants.
///
/// ```
/// use punctual_core::judge::{Interpolation, Judge, PromiseState, Verdict};
///
/// // It arrives at 10.2 s of 10 s: between two instants, of which the later one is inside.
/// let mut judge = Judge::new(Some(10.0), Interpolation::Straight);
/// for (t, h) in [(0.0, -60.0), (9.9, -0.57), (10.2, 0.0), (10.5, 0.0)] {
///     judge.see(t, h, PromiseState::InForce, false);
/// }
/// let seen = judge.judgement();
/// assert_eq!((seen.verdict(), seen.late), (Verdict::Broken, Some(10.0)));
/// assert!(seen.late_by().is_some_and(|late| (late - 0.2).abs() < 1e-9));
/// assert!(seen.least.is_some_and(|h| (h + 0.38).abs() < 1e-12));
/// ```
#[derive(Clone, Debug)]
pub struct Judge {
    /// T in s after the first instant.
    deadline: Option<f64>,
    interpolation: Interpolation,
    /// The last instants, the newest first.
    before: [(f64, f64); BEFORE],
    count: usize,
    /// Largest |h| seen.
    size: f64,
    /// Time in s at which it was left last before the deadline.
    left_before: Option<f64>,
    /// Time in s at which the filter knew first that the deadline is lost.
    certain: Option<f64>,
    /// Whether the deadline has been judged.
    due: bool,
    released: bool,
    seen: Judgement,
}

impl Judge {
    /// A judge for a deadline in s after the first instant (`None` or infinite: none).
    pub fn new(deadline: Option<f64>, interpolation: Interpolation) -> Self {
        Self {
            deadline: deadline.filter(|deadline| deadline.is_finite()),
            interpolation,
            before: [(0.0, 0.0); BEFORE],
            count: 0,
            size: 0.0,
            left_before: None,
            certain: None,
            due: false,
            released: false,
            seen: Judgement::default(),
        }
    }

    /// Takes h at `t` (s), later than all before. `lost`: the filter is certain that the deadline is missed.
    /// Deadlines count from the first call with a finite h.
    pub fn see(&mut self, t: f64, h: f64, promise_state: PromiseState, lost: bool) {
        if self.released || (self.count == 0 && !h.is_finite()) {
            return;
        }
        if self.count == 0 {
            self.seen.deadline = self.deadline.map(|deadline| t + deadline);
        }
        if h.is_finite() {
            self.size = self.size.max(h.abs());
        }
        if lost {
            self.certain.get_or_insert(t);
        }
        self.begin(t, h, promise_state);
        self.follow(t, h);
        self.judge_deadline(t, h);
        self.count_in(t, h, promise_state);
        self.released = promise_state == PromiseState::Released;
        self.seen.let_go = self.released && self.seen.began.is_none();
        // Released after it arrived: there is nothing more to reach.
        self.seen.reached |= self.released && self.seen.arrival.is_some();
        self.before.rotate_right(1);
        self.before[0] = (t, h);
        self.count += 1;
    }

    /// The judgement of the instants seen so far.
    pub fn judgement(&self) -> Judgement {
        let mut seen = self.seen;
        if !self.due && seen.late.is_none() && !seen.began_inside {
            seen.late = self.certain;
        }
        seen
    }

    /// Whether h counts as inside; NaN does not.
    fn is_inside(&self, h: f64) -> bool {
        h >= -(TOLERANCE * self.size).max(LEAST_TOLERANCE)
    }

    fn begin(&mut self, t: f64, h: f64, promise_state: PromiseState) {
        if promise_state == PromiseState::InForce && self.seen.began.is_none() {
            self.seen.began = Some(t);
            self.seen.began_inside = self.is_inside(h) && (self.count == 0 || self.deadline.is_none());
        }
    }

    /// The instant before, if there is one.
    fn last(&self) -> Option<(f64, f64)> {
        (self.count > 0).then_some(self.before[0])
    }

    /// Notes arrivals, and when the set is left before the deadline.
    fn follow(&mut self, t: f64, h: f64) {
        let inside = self.is_inside(h);
        let was_inside = self.last().map(|(_, h)| self.is_inside(h));
        if inside && self.seen.began.is_some() && self.seen.arrival.is_none() {
            let at = if was_inside == Some(false) { self.crossing(t, h) } else { t };
            self.seen.arrival = Some(at.max(self.seen.began.unwrap_or(at)));
        }
        if !inside {
            self.seen.since = None;
        } else if self.seen.since.is_none() {
            self.seen.since =
                self.seen.arrival.map(|_| if was_inside == Some(false) { self.crossing(t, h) } else { t });
        }
        if !inside && was_inside == Some(true) && self.seen.arrival.is_some() {
            let at = self.crossing(t, h);
            self.left_before = Some(at);
        }
    }

    /// Judges h at the deadline, where that has passed now.
    fn judge_deadline(&mut self, t: f64, h: f64) {
        let Some(deadline) = self.seen.deadline.filter(|_| !self.due) else { return };
        let same = SAME_TIME * deadline.abs().max(1.0);
        if t < deadline - same {
            return;
        }
        self.due = true;
        let now = match self.last() {
            Some((_, last)) if t > deadline + same => {
                if self.is_inside(last) && self.is_inside(h) {
                    last.min(h)
                } else {
                    self.between(deadline, t, h)
                }
            }
            _ => h,
        };
        self.weigh(now);
        if !self.is_inside(now) && !self.seen.began_inside {
            match self.seen.arrival.filter(|arrival| *arrival < deadline) {
                Some(_) => self.seen.left = self.left_before.or(Some(deadline)),
                None => self.seen.late = self.certain.or(Some(deadline)),
            }
        }
    }

    /// Counts the instant itself, where it is to be inside then.
    fn count_in(&mut self, t: f64, h: f64, promise_state: PromiseState) {
        let always = self.seen.began_inside && promise_state != PromiseState::Waiting;
        if promise_state == PromiseState::Released || !(always || self.due) {
            return;
        }
        self.weigh(h);
        if !self.is_inside(h) && self.seen.arrival.is_some() && self.seen.left.is_none() {
            self.seen.left =
                self.left_before.filter(|at| always || Some(*at) >= self.seen.deadline).or(Some(t));
        }
    }

    fn weigh(&mut self, h: f64) {
        self.seen.reached = true;
        self.seen.outside |= !self.is_inside(h);
        self.seen.least = Some(self.seen.least.map_or(h, |least| least.min(h)));
    }

    /// The time at which h changes its sign on the way to `h` at `t`.
    fn crossing(&self, t: f64, h: f64) -> f64 {
        let Some((mut from, first)) = self.last() else { return t };
        let (mut to, rising) = (t, h > first);
        if !(first.is_finite() && h.is_finite()) || (first < 0.0) == (h < 0.0) {
            return t;
        }
        // Bisection to the last bit.
        for _ in 0..64 {
            let middle = 0.5 * (from + to);
            if (self.between(middle, t, h) < 0.0) == rising {
                from = middle;
            } else {
                to = middle;
            }
        }
        to
    }

    /// h at `at`, between the instant before and `h` at `t`: Neville's scheme.
    fn between(&self, at: f64, t: f64, h: f64) -> f64 {
        let before = match self.interpolation {
            Interpolation::Straight => 1,
            Interpolation::Smooth => BEFORE,
        }
        .min(self.count);
        let mut points = [(t, h); BEFORE + 1];
        points[1..].copy_from_slice(&self.before);
        let mut values = points.map(|(_, h)| h);
        for width in 1..=before {
            for i in 0..=before - width {
                let ((a, _), (b, _)) = (points[i], points[i + width]);
                values[i] += (values[i + 1] - values[i]) * (at - a) / (b - a);
            }
        }
        values[0]
    }
}
