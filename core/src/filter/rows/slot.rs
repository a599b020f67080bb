//! One barrier of a filter: its derivatives, its promise, when the promise is in force, and the barrier's result of a
//! sample.

use alloc::borrow::ToOwned;
use alloc::boxed::Box;
use alloc::string::String;
use alloc::vec::Vec;

use super::errors::{ErrorSlopes, MeasurementErrors, Shortfall};
use super::hold::Lowest;
use super::outlook::Outlook;
use super::sample::Moment;
use super::shared::SharedPlants;
use super::{FilterState, FixedTimeState, Infeasible, Phase, SAME_PERIOD, SAME_TIME, Status};
use crate::convergence::comparison::Stack;
use crate::convergence::sampled::PeriodBound;
use crate::convergence::stay::Means;
use crate::convergence::{DerivativeBound, FixedTime};
use crate::elementary;
use crate::lie::{DerivativeSource, Derivatives};
use crate::qp::{Bounds, Enforcement, Row};
use crate::{MAX_RELATIVE_DEGREE, reach};

/// The time from which a barrier is enforced. Its deadline always counts from the filter's first sample: "be in A by 5 s,
/// then in B by 10 s" has the deadlines 5 s and 10 s.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
pub enum Begin {
    /// From the first sample.
    #[default]
    AtOnce,
    /// From this many seconds after the first sample, finite, ≥ 0, less than the deadline.
    At(f64),
    /// From the arrival of the barrier of this number, counted from 0 and added before.
    AfterArrival(usize),
}

/// The time until which a barrier is enforced ([`Phase::Released`] from then on).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
pub enum End {
    /// For ever.
    #[default]
    Never,
    /// Until this many seconds after the filter's first sample, finite, > 0.
    At(f64),
    /// Until h ≥ 0 has been reached.
    OnArrival,
    /// Until h ≥ 0 has held for this many seconds without a break, finite, > 0.
    AfterStay(f64),
    /// Until the arrival of the barrier of this number, counted from 0: "out of B until A has been reached".
    AfterArrival(usize),
}

impl End {
    /// How long in s a visit lasts that ends the promise, if one does; its time is open.
    #[cfg(feature = "plan")]
    pub(crate) fn visit(self) -> Option<f64> {
        match self {
            Self::OnArrival => Some(0.0),
            Self::AfterStay(seconds) => Some(seconds),
            Self::Never | Self::At(_) | Self::AfterArrival(_) => None,
        }
    }
}

/// How a barrier's constraint is treated if not all can be met within the input bounds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
pub enum Strictness {
    /// Hard, with priority 0 if h ≥ 0 held at the anchor and 1 if not: keeping safe sets comes before reaching promised
    /// ones.
    #[default]
    KeepFirst,
    /// Hard: met as far as the bounds and the barriers of smaller numbers allow. Among equal numbers the one added first
    /// comes first.
    Priority(u32),
    /// Soft, with an exact penalty: it yields, even to u_ref, if it would cost more than this distance ‖u − u_ref‖, in units
    /// of u, finite, > 0.
    Soft(f64),
}

/// One barrier of a filter.
pub(crate) struct BarrierSlot {
    pub(crate) name: String,
    pub(crate) source: Box<dyn DerivativeSource>,
    /// The number of its plant, if other barriers share it.
    pub(crate) plant: Option<usize>,
    pub(crate) promise: FixedTime,
    pub(crate) begin: Begin,
    pub(crate) end: End,
    pub(crate) strictness: Strictness,
    /// Whether the state is measured without errors.
    pub(crate) exact: bool,
    /// The result of the present sample.
    pub(crate) now: SlotSample,
}

/// A barrier's result of a sample: scratch memory that every sample rewrites.
pub(crate) struct SlotSample {
    /// Whether the barrier is in force; the other fields are meaningful only then.
    pub(crate) in_force: bool,
    /// The state from which the input acts.
    pub(crate) from: Vec<f64>,
    /// Derivatives of h there, along the plant.
    pub(crate) derivatives: Derivatives,
    /// Derivatives of h⁽⁰⁾ … h⁽ⁿ⁻¹⁾ along each measurement error.
    pub(crate) slopes: Vec<ErrorSlopes>,
    /// How far h may fall short of its prediction, if it may.
    pub(crate) shortfall: Option<Shortfall>,
    /// The least h⁽ⁿ⁾ that keeps the promise.
    pub(crate) bound: DerivativeBound,
    /// The row on u that follows from it.
    pub(crate) row: Row,
    pub(crate) enforcement: Enforcement,
    /// The bound on h⁽⁰⁾ … h⁽ⁿ⁻¹⁾ at the end of the period.
    pub(crate) period_bound: PeriodBound,
    /// The instant at which the held input breaks the promise before the next sample, if it does.
    pub(super) lowest: Option<Lowest>,
}

impl SlotSample {
    fn new() -> Self {
        Self {
            in_force: false,
            from: Vec::new(),
            derivatives: Derivatives::ZERO,
            slopes: Vec::new(),
            shortfall: None,
            bound: DerivativeBound::NONE,
            row: Row::ZERO,
            enforcement: Enforcement::Hard { priority: 0 },
            period_bound: PeriodBound::ZERO,
            lowest: None,
        }
    }

    /// Takes the barrier out of force, so that it requires nothing.
    fn idle(&mut self) {
        self.in_force = false;
        (self.row, self.period_bound, self.lowest) = (Row::ZERO, PeriodBound::ZERO, None);
    }
}

impl BarrierSlot {
    pub(crate) fn new(name: &str, source: Box<dyn DerivativeSource>, promise: FixedTime) -> Self {
        let (begin, end, strictness) = (Begin::default(), End::default(), Strictness::default());
        let now = SlotSample::new();
        let name = name.to_owned();
        Self { name, source, plant: None, promise, begin, end, strictness, exact: true, now }
    }

    /// n.
    #[inline]
    pub(crate) fn degree(&self) -> usize {
        self.promise.relative_degree()
    }

    /// Evaluates h and its derivatives along the plant where the input begins to act (docs/theory.md, sections 1 and 8).
    /// Returns h at the sample itself.
    #[inline]
    pub(crate) fn evaluate(
        &mut self,
        moment: &Moment,
        (state, bounds): (&FilterState, &Bounds),
        plants: &mut SharedPlants,
    ) -> f64 {
        let Self { source, plant, now, .. } = self;
        let mut h = None;
        now.from.copy_from_slice(moment.x);
        if moment.delay > 0.0 {
            source.evaluate(moment.t, moment.x, &mut now.derivatives);
            h = Some(now.derivatives.drift[0]);
            if let Some(source) = source.predict() {
                for (dt, u) in state.acting(bounds, moment.t, moment.delay) {
                    source.flow(&mut now.from, &u[..moment.u_ref.len()], dt);
                }
            }
        }
        plants.evaluate((&**source, *plant), moment.begin, &now.from, &mut now.derivatives);
        h.unwrap_or(now.derivatives.drift[0])
    }

    /// Moves the promise number `index` of `promises` to the sample, at which h is `h`: whether it is in force, its anchor,
    /// its phase, and the least h⁽ⁿ⁾ that keeps it (docs/theory.md, sections 6 and 8). Returns whether the deadline is
    /// unreachable.
    ///
    /// # Errors
    ///
    /// Derivatives that cannot carry a constraint.
    #[inline]
    pub(crate) fn advance(
        &mut self,
        promises: &mut [FixedTimeState],
        index: usize,
        h: f64,
        moment: &Moment,
        bounds: &Bounds,
        errors: &MeasurementErrors,
    ) -> Result<bool, Status> {
        self.now.in_force = self.in_force(promises, index, moment.t, h);
        if !self.now.in_force {
            self.now.idle();
            return Ok(false);
        }
        if let Some(status) = defect(&self.now.derivatives, self.degree(), moment.u_ref.len()) {
            return Err(status);
        }
        let (promise, n) = (&mut promises[index], self.degree());
        let unsure = self.unsure(moment, errors);
        let disturbance = self.promise.settings().disturbance;
        self.now.shortfall = Shortfall::new(&unsure[..n], disturbance, moment.delay);
        let drift = &self.now.derivatives.drift;
        let lowest: Stack = core::array::from_fn(|k| drift[k] - unsure[k]);
        let lowest = &lowest[..n];
        self.anchor(promise, moment, lowest);
        let means = self.means(promise, moment, bounds);
        let move_on =
            |promise: &mut _| self.promise.advance_by(promise, moment.begin, &drift[..n], &unsure, &means);
        let mut bound = move_on(promise);
        // A new anchor is a new promise, at this very sample.
        if self.promise.restart(promise, moment.begin, lowest, moment.covered()) {
            bound = move_on(promise);
        }
        let mut is_unreachable = self.is_unreachable(promise, moment, bounds, bound.time_left);
        if is_unreachable && self.postpone(promise, moment, bounds, lowest) {
            bound = move_on(promise);
            is_unreachable = false;
        }
        self.now.bound = bound;
        Ok(is_unreachable)
    }

    /// Forms the row of that floor, L_fⁿh + L_gL_fⁿ⁻¹h u ≥ floor (docs/theory.md, section 1), and (S) over the period
    /// (`docs/theory.md#sampled-form`). Returns whether there is one over the period.
    #[inline]
    pub(crate) fn form_row(&mut self, promise: &FixedTimeState, moment: &Moment) -> bool {
        let n = self.degree();
        self.now.enforcement = self.enforcement(promise);
        let Derivatives { row: normal, drift, .. } = &self.now.derivatives;
        let floor = self.now.bound.floor - drift[n];
        let bound = moment
            .period
            .and_then(|period| self.promise.over_period(promise, moment.begin, &drift[..n], period));
        self.now.row = Row { normal: *normal, floor };
        self.now.period_bound = bound.unwrap_or(PeriodBound::ZERO);
        bound.is_some()
    }

    /// (S) over another `duration` in s; `None` if the barrier is not in force or has none.
    pub(crate) fn over(
        &self,
        promise: &FixedTimeState,
        moment: &Moment,
        duration: f64,
    ) -> Option<PeriodBound> {
        let stack = &self.now.derivatives.drift[..self.degree()];
        self.now.in_force.then(|| self.promise.over_period(promise, moment.begin, stack, duration))?
    }

    /// The evolution of h until the next sample, as the derivatives predict it.
    pub(super) fn outlook(&self) -> Outlook<'_> {
        let SlotSample { derivatives, shortfall, .. } = &self.now;
        let (n, drift) = (self.degree(), &derivatives.drift);
        Outlook { n, drift, shortfall: shortfall.as_ref(), known: None }
    }

    /// Bounds on the errors of h⁽⁰⁾ … h⁽ⁿ⁻¹⁾.
    #[inline]
    fn unsure(&mut self, moment: &Moment, errors: &MeasurementErrors) -> Stack {
        if errors.is_exact() {
            return [0.0; MAX_RELATIVE_DEGREE];
        }
        errors.of_derivatives(&*self.source, moment.t, moment.x, moment.u_ref.len(), &mut self.now.slopes)
    }

    /// The influence of plant and inputs on h⁽ⁿ⁾. Records the largest ‖L_gL_fⁿ⁻¹h‖ so far in `promise`.
    #[inline]
    fn means(&self, promise: &mut FixedTimeState, moment: &Moment, bounds: &Bounds) -> Means {
        let Derivatives { drift, row, .. } = &self.now.derivatives;
        let (mut square, mut reach) = (0.0, 0.0);
        for i in 0..moment.u_ref.len() {
            let a = row[i];
            square += a * a;
            if a != 0.0 {
                reach += a * if a > 0.0 { bounds.max[i] } else { bounds.min[i] };
            }
        }
        let size = elementary::sqrt(square);
        promise.gain = promise.gain.max(size);
        let weight = if promise.gain > 0.0 { size / promise.gain } else { 1.0 };
        Means { drift: drift[self.degree()], reach, weight, hold: moment.hold }
    }

    /// The enforcement of its row.
    pub(crate) fn enforcement(&self, promise: &FixedTimeState) -> Enforcement {
        match self.strictness {
            Strictness::KeepFirst => Enforcement::Hard { priority: u32::from(!promise.was_inside()) },
            Strictness::Priority(priority) => Enforcement::Hard { priority },
            Strictness::Soft(penalty) => Enforcement::Soft { penalty },
        }
    }

    /// Whether the barrier at `index` of `barriers` is in force at time `t` with the value `h`. Releases it if it no longer
    /// is.
    #[inline]
    pub(crate) fn in_force(&self, barriers: &mut [FixedTimeState], index: usize, t: f64, h: f64) -> bool {
        match barriers[index].phase {
            Phase::Released => false,
            Phase::Waiting => self.is_due(barriers, index, t, h),
            _ => self.end == End::Never || self.is_due(barriers, index, t, h),
        }
    }

    fn is_due(&self, barriers: &mut [FixedTimeState], index: usize, t: f64, h: f64) -> bool {
        let start = *barriers[index].start_time.get_or_insert(t);
        let reached = |seconds: f64| t - start >= seconds - SAME_TIME * t.abs().max(seconds);
        let begun = barriers[index].phase != Phase::Waiting
            || match self.begin {
                Begin::AtOnce => true,
                Begin::At(seconds) => reached(seconds),
                Begin::AfterArrival(other) => barriers[other].arrival.is_some(),
            };
        let has_arrived = |other: usize| barriers.get(other).is_some_and(|b| b.arrival.is_some());
        let is_other_there = matches!(self.end, End::AfterArrival(other) if has_arrived(other));
        let promise = &mut barriers[index];
        let ended = match self.end {
            End::Never => false,
            End::At(seconds) => reached(seconds),
            End::OnArrival => begun && (h >= 0.0 || promise.arrival.is_some()),
            End::AfterStay(seconds) => {
                promise.since = if begun && h >= 0.0 { promise.since.or(Some(t)) } else { None };
                let slack = SAME_TIME * t.abs().max(seconds);
                promise.since.is_some_and(|since| t - since >= seconds - slack)
            }
            End::AfterArrival(_) => is_other_there,
        };
        if ended {
            promise.phase = Phase::Released;
            promise.unmet = None;
            if h >= 0.0 {
                promise.arrival.get_or_insert(t);
            }
        }
        begun && !ended
    }

    /// Anchors `promise` if it waits for that, from the least derivatives `h`. Adapts the margin if samples turn out to be
    /// farther apart than assumed at the anchor.
    #[inline]
    fn anchor(&self, promise: &mut FixedTimeState, moment: &Moment, h: &[f64]) {
        let covered = moment.covered();
        if promise.phase == Phase::Waiting {
            let sampled = moment.begin - moment.delay;
            let waited = sampled - promise.start_time.unwrap_or(sampled);
            let deadline = self.promise.deadline() - waited - moment.delay;
            self.promise.anchor(promise, moment.begin, h, deadline, covered);
        } else if moment.measures
            && promise.phase == Phase::Approach
            && covered > promise.period * (1.0 + SAME_PERIOD)
        {
            self.promise.resample(promise, covered);
        }
    }

    /// Whether model and measurement are exact. If not, nothing is ruled out: a disturbance may help.
    pub(crate) fn is_undisturbed(&self) -> bool {
        self.exact && self.promise.settings().disturbance == 0.0
    }

    /// Whether the deadline, in `time_left` s, certainly cannot be met: no input within `bounds` has h ≥ 0 then
    /// (`docs/theory.md#lost-deadline`), or it has passed with the state outside.
    fn is_unreachable(
        &self,
        promise: &FixedTimeState,
        moment: &Moment,
        bounds: &Bounds,
        time_left: f64,
    ) -> bool {
        match promise.phase {
            Phase::Late => true,
            Phase::Approach if moment.bounded && self.is_undisturbed() => {
                let size = promise.anchor[0].abs() + promise.margin;
                reach::ruled_out(&*self.source, (moment.begin, &self.now.from), bounds, time_left, size)
            }
            _ => false,
        }
    }

    /// Gives up a lost deadline, if the settings say so: restarts the promise with a later one ([`Infeasible::Earliest`]).
    /// Returns whether it did.
    fn postpone(&self, promise: &mut FixedTimeState, moment: &Moment, bounds: &Bounds, h: &[f64]) -> bool {
        /// New deadline, in units of the earliest time not ruled out: stopping in the set takes longer than getting there.
        const FACTOR: f64 = 2.0;
        /// Growth of that factor from each postponement to the next.
        const GROWTH: f64 = 1.5;
        /// The longest deadline tried, in units of the configured one.
        const HORIZON: f64 = 1e3;
        if self.promise.settings().infeasible != Infeasible::Earliest {
            return false;
        }
        let configured = self.promise.deadline();
        let now = (moment.begin, &*self.now.from);
        let earliest = reach::earliest_arrival(&*self.source, now, bounds, HORIZON * configured);
        let factor = FACTOR * elementary::powi(GROWTH, promise.postponed.min(16) as i32);
        // Near the set the earliest time tends to zero, so the deadline is never shorter than ten samples.
        let deadline = match earliest {
            Some(earliest) if earliest > 0.0 => (factor * earliest).max(10.0 * moment.period.unwrap_or(0.0)),
            _ => configured,
        };
        let postponed = promise.postponed.saturating_add(1);
        let unmet = promise.unmet;
        self.promise.anchor(promise, now.0, h, deadline, moment.period.unwrap_or(0.0));
        (promise.postponed, promise.unmet) = (postponed, unmet);
        true
    }
}

/// Why the derivatives cannot carry a constraint, if they cannot.
#[inline]
fn defect(derivatives: &Derivatives, n: usize, inputs: usize) -> Option<Status> {
    /// An input that enters below the declared degree by more than this part of the row is real.
    const OF_ROW: f64 = 1e-9;
    /// The same for this part of the derivatives themselves; round-off of cancelling terms stays below.
    const OF_DERIVATIVES: f64 = 1e-13;
    // A finite sum has finite terms.
    let sum = derivatives.drift[..=n].iter().chain(&derivatives.row[..inputs]).fold(0.0, |sum, v| sum + v);
    if !(sum + derivatives.lower_sensitivity).is_finite() && !derivatives.is_finite() {
        return Some(Status::Singular);
    }
    if derivatives.lower_sensitivity <= 0.0 {
        return None;
    }
    let size = derivatives.row.iter().fold(0.0, |s: f64, v| s.max(v.abs()));
    let terms = derivatives.drift.iter().fold(0.0, |s: f64, v| s.max(v.abs()));
    let is_real = derivatives.lower_sensitivity > (OF_ROW * size).max(OF_DERIVATIVES * terms);
    is_real.then_some(Status::WrongRelativeDegree)
}
