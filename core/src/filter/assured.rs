//! A filter whose promise has a witness: decided at the first sample, kept within the bounds whatever u_ref is
//! (`docs/theory.md#witness`).

use alloc::format;
use alloc::vec::Vec;

use super::slot::BarrierSlot;
use super::{Begin, End, FilterState, Report, SafetyFilter, Strictness};
use crate::MAX_INPUTS;
use crate::elementary;
use crate::error::{Error, ErrorKind, length, positive};
use crate::lie::Derivatives;
use crate::plan::{Failure, Plan, Planner, Requirement, Witness};
use crate::scalar::all_finite;

/// Margin of a plan, as a part of the size of h at the first sample: for what the model leaves out between two samples.
const MARGIN: f64 = 1e-4;
/// Largest input behind which u_ref passes unchanged where every set has been reached, as a part of its bounds.
const COMFORTABLE: f64 = 0.5;
/// Halvings between the input of the plan and the one that is preferred.
const BISECTIONS: u32 = 4;
/// Difference of a sample from its time that counts as none, as a part of the period. Round-off of times is another.
const ON_TIME: f64 = 1e-6;
/// The largest round-off of a time, as a part of the period.
const ROUND_OFF: f64 = 1e-2;

/// Who chose the input of a step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Driver {
    /// u_ref, with a comfortable plan behind it.
    Reference,
    /// The rows of the filter inside, with a plan behind their answer; or the rows alone, where there is no promise.
    #[default]
    Rows,
    /// A compromise: the last input towards the rows' answer that has a plan behind it.
    Between,
    /// The plan: nothing else keeps the promise.
    Plan,
}

/// Where the promise stands.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub enum Standing {
    /// No sample yet.
    #[default]
    Undecided,
    /// Every promise is kept: there is a witness.
    Assured,
    /// Refused at the first sample: no plan was found. The filter goes on by its rows, without promise.
    Refused(Failure),
    /// Was assured, and is no more: the plant is not where the model led.
    Withdrawn(Failure),
    /// Was assured, and is no more: a sample came at another time than one period after the last.
    Irregular,
}

/// The report of a step of an [`AssuredFilter`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Assurance {
    /// Where the promise stands.
    pub standing: Standing,
    /// Who chose the input.
    pub driver: Driver,
}

impl Assurance {
    /// Whether every promise is kept, whatever u_ref is.
    pub fn is_assured(&self) -> bool {
        self.standing == Standing::Assured
    }
}

/// What is remembered between samples.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AssuredState {
    /// The memory of the filter inside.
    pub filter: FilterState,
    /// Where the promise stands.
    pub standing: Standing,
    /// One of each barrier; `None` where nothing is promised.
    promises: Vec<Option<Promise>>,
    plan: Plan,
    time: f64,
}

/// h ≥ 0 from one time in s until another, and the margin that plans keep.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Promise {
    from: f64,
    until: f64,
    margin: f64,
}

/// A [`SafetyFilter`] that promises only what a plan keeps.
///
/// At the first sample it searches for a plan from there, in the model and within the bounds. Found: every barrier that
/// [can be](Self::promised) is promised, for whatever u_ref comes. Not found: the promise is refused, and the filter goes on
/// by its rows. Once promised, every input has a verified plan behind it. It is u_ref, or the answer of the rows, or a
/// compromise, or where nothing else keeps the promise the next input of the plan itself.
///
/// Assumed: the plant is the model, its state is measured exactly, and samples are one period apart. A sample may be taken
/// again at the same time. Where x is not finite, the plan goes on as it is. A filter with bounds on disturbance or
/// measurement errors, a delay or windows that begin later cannot be assured yet, and is refused by [`Self::new`]. Sets must
/// not move: at a rest each is looked at at eight later times, up to a day, and no plan is found where it has. States
/// must be those of the plant, not of something that others move.
///
/// The search allocates, as do the plans.
///
/// ```
/// # use punctual_core::{barriers::DistanceDisc, filter::*};
/// # use punctual_reference::plants::Unicycle;
/// let goal = DistanceDisc::new([20.0, 10.0], 2.0, 1.0)?;
/// let filter = SafetyFilter::builder(4, 2)
///     .barrier("goal", Unicycle, goal, BarrierSettings::within(8.0))?
///     .bounds(&[-5.0, -2.0], &[5.0, 2.0])?
///     .sampling(Sampling::Period(0.02))?
///     .build()?;
/// let mut filter = AssuredFilter::new(filter, 0.02)?;
/// let (x, mut u) = ([0.0, 0.0, 1.0, 0.0], [0.0; 2]);
/// let assurance = filter.step(0.0, &x, &[-5.0, 0.0], &mut u)?;
/// assert!(assurance.is_assured());
/// # Ok::<(), punctual_core::Error>(())
/// ```
pub struct AssuredFilter {
    filter: SafetyFilter,
    period: f64,
    state: AssuredState,
    report: Assurance,
}

impl AssuredFilter {
    /// Puts plans behind `filter`, whose inputs are held for `period` s, finite, > 0.
    ///
    /// # Errors
    ///
    /// A period out of range. A filter that cannot be assured: a barrier without a model to run ahead, or with another plant
    /// than the first one; one that begins later; a bound on disturbance or measurement errors; a delay.
    pub fn new(filter: SafetyFilter, period: f64) -> Result<Self, Error> {
        positive("period", period)?;
        let refuse = |field: &str, message: &str| {
            Err(Error::new(
                ErrorKind::Unsupported,
                field,
                format!("{message}, which no plan accounts for yet"),
            ))
        };
        if filter.delay > 0.0 {
            return refuse("actuation_delay", "is not 0");
        }
        if !filter.errors.is_exact() {
            return refuse("measurement_errors", "are not 0");
        }
        for slot in &filter.slots {
            let named = |e: Error| e.within(&slot.name);
            let settings = slot.promise.settings();
            if settings.disturbance > 0.0 {
                return refuse("disturbance", "is not 0").map_err(named);
            }
            if slot.begin != Begin::AtOnce {
                return refuse("begin", "is later than the first sample").map_err(named);
            }
            if slot.source.predict().is_none() {
                let message = "has no model to run ahead";
                return Err(named(Error::new(ErrorKind::Unsupported, "source", message)));
            }
        }
        one_plant(&filter, period)?;
        let state = AssuredState { filter: filter.state().clone(), ..AssuredState::default() };
        Ok(Self { filter, period, state, report: Assurance::default() })
    }

    /// The filter inside: to look at.
    pub fn filter(&self) -> &SafetyFilter {
        &self.filter
    }

    /// The plan that is committed, where there is one.
    pub fn plan(&self) -> Option<&Witness> {
        (self.state.standing == Standing::Assured).then_some(&self.state.plan.witness)
    }

    /// The report of the last step.
    pub fn report(&self) -> &Assurance {
        &self.report
    }

    /// The memory between samples.
    pub fn state(&mut self) -> &AssuredState {
        self.state.filter.clone_from(self.filter.state());
        &self.state
    }

    /// Restores what [`Self::state`] returned: the filter goes on exactly as it would have then.
    ///
    /// # Errors
    ///
    /// A state with another number of barriers, or of a plant of other dimensions.
    pub fn restore(&mut self, state: &AssuredState) -> Result<(), Error> {
        if !state.promises.is_empty() {
            length("promises", state.promises.len(), self.filter.slots.len())?;
        }
        if !state.plan.fits(self.filter.state_dim, self.filter.input_dim) {
            let message = "is of a plant of other dimensions";
            return Err(Error::new(ErrorKind::Dimension, "plan", message));
        }
        self.filter.restore(&state.filter)?;
        self.state.clone_from(state);
        self.report = Assurance { standing: state.standing, driver: Driver::Rows };
        Ok(())
    }

    /// Forgets promise and plan: the next sample decides anew.
    pub fn rearm(&mut self) {
        self.filter.rearm();
        self.state = AssuredState { filter: self.filter.state().clone(), ..AssuredState::default() };
        self.report = Assurance::default();
    }

    /// Computes the safe input at time `t` in s and remembers the sample; arguments as for [`SafetyFilter::step`]. The
    /// report of the rows is that of [`Self::filter`].
    ///
    /// # Errors
    ///
    /// A slice of the wrong length.
    pub fn step(&mut self, t: f64, x: &[f64], u_ref: &[f64], u: &mut [f64]) -> Result<&Assurance, Error> {
        length("x", x.len(), self.filter.state_dim)?;
        self.filter.step(t, x, u_ref, u)?;
        let is_valid = t.is_finite() && all_finite(x);
        let since = t - self.state.time;
        let round_off = 2.0 * f64::EPSILON * t.abs();
        let tolerance = ON_TIME * self.period + round_off;
        let regular = round_off <= ROUND_OFF * self.period
            && (since == 0.0 || (since - self.period).abs() <= tolerance);
        match self.state.standing {
            Standing::Undecided if is_valid => self.decide(t, x, u),
            // Also where t is not a number.
            Standing::Assured if !regular => self.state.standing = Standing::Irregular,
            _ => {}
        }
        self.report.driver = Driver::Rows;
        if self.state.standing == Standing::Assured {
            self.report.driver = match is_valid {
                true => self.choose(t, x, u_ref, u),
                false => self.go_on(t, u),
            };
            self.filter.state.input[..u.len()].copy_from_slice(u);
            if self.report.driver != Driver::Rows {
                self.disown_rows();
            }
        }
        self.state.time = t;
        self.report.standing = self.state.standing;
        Ok(&self.report)
    }

    /// The report of the rows at the last step, about their own answer. No guarantee of theirs holds where another input
    /// was applied.
    pub fn rows(&self) -> &Report {
        self.filter.report()
    }

    /// Goes on with the plan as it is, where nobody knows where the plant is.
    fn go_on(&mut self, t: f64, u: &mut [f64]) -> Driver {
        let plan = &self.state.plan;
        let inputs = &plan.witness.inputs;
        let next = inputs.iter().find(|(end, _)| *end > t + 0.5 * self.period);
        if next.is_none() && !plan.stays() {
            // Only feedback holds it there.
            self.state.standing = Standing::Withdrawn(Failure::NoRest);
        }
        if let Some((_, input)) = next.or(inputs.last()) {
            for (i, u) in u.iter_mut().enumerate() {
                *u = self.filter.bounds.clamp(i, input[i]);
            }
        }
        Driver::Plan
    }

    /// Takes back what the rows say of their own answer, where another input is applied.
    fn disown_rows(&mut self) {
        self.filter.state.barriers.iter_mut().for_each(|promise| promise.guaranteed = false);
        self.filter.workspace.report.barriers.iter_mut().for_each(|barrier| barrier.guaranteed = false);
    }

    /// Whether each barrier is one that a first sample at `t` and `x` could promise: not a soft one, one that ends before its
    /// deadline, or one without a deadline whose set `x` is outside of.
    pub fn promised(&self, t: f64, x: &[f64]) -> impl Iterator<Item = bool> {
        self.promises(t, x, 1.0).into_iter().map(|promise| promise.is_some())
    }

    /// The promises from `x` at `t`, with every deadline `factor` times as long.
    fn promises(&self, t: f64, x: &[f64], factor: f64) -> Vec<Option<Promise>> {
        let promise = |slot: &BarrierSlot| {
            // Not that of the report, which has none where u_ref is no number.
            let mut derivatives = Derivatives::ZERO;
            slot.source.evaluate(t, x, &mut derivatives);
            let h = derivatives.drift[0];
            let from = match slot.promise.settings().deadline {
                // Not-a-number is asked for at once, and found by the check.
                _ if h.is_nan() || h >= 0.0 => t,
                // A little earlier, so that round-off of a time is no gap.
                Some(deadline) => t + factor * deadline - ON_TIME * self.period,
                None => return None,
            };
            let until = match slot.end {
                End::Never => f64::INFINITY,
                End::At(seconds) => t + seconds,
                End::OnArrival => from + self.period,
            };
            let soft = matches!(slot.strictness, Strictness::Soft(_));
            (!soft && until > from).then_some(Promise { from, until, margin: MARGIN * h.abs() })
        };
        self.filter.slots.iter().map(promise).collect()
    }

    /// The plan that a first sample at `t` and `x` would find, with every deadline `factor` times as long. Remembers
    /// nothing. `factor`: finite, > 0.
    ///
    /// # Errors
    ///
    /// What the nearest trial fails at.
    pub fn foresee(&self, t: f64, x: &[f64], factor: f64) -> Result<Witness, Failure> {
        let promises = self.promises(t, x, factor);
        self.planned(&promises, &[], |planner| planner.search(t, x)).map(|plan| plan.witness)
    }

    /// The least factor by which every deadline has to be multiplied for a plan from `x` at `t` to be found, to a
    /// twentieth, and that plan. None is looked for beyond `longest` times the deadlines.
    pub fn soonest(&self, t: f64, x: &[f64], longest: f64) -> Option<(f64, Witness)> {
        const FINE: f64 = 1.05;
        const MOST_LONGER: f64 = 1e6;
        // Twice as long until there is one, or half as long until there is none.
        let longest = longest.min(MOST_LONGER);
        let (mut low, mut high) = (1.0, 1.0);
        let mut found = self.foresee(t, x, high).ok();
        if found.is_some() {
            while let Some(witness) = self.foresee(t, x, 0.5 * high).ok().filter(|_| high > 1e-3) {
                (found, high) = (Some(witness), 0.5 * high);
            }
            low = 0.5 * high;
        }
        while found.is_none() && high < longest {
            (low, high) = (high, (2.0 * high).min(longest));
            found = self.foresee(t, x, high).ok();
        }
        let mut found = found?;
        while high > FINE * low {
            let middle = elementary::sqrt(low * high);
            match self.foresee(t, x, middle) {
                Ok(witness) => (found, high) = (witness, middle),
                Err(_) => low = middle,
            }
        }
        Some((high, found))
    }

    /// Decides at the first sample: what is promised, and whether a plan keeps it.
    fn decide(&mut self, t: f64, x: &[f64], u: &[f64]) {
        self.state.promises = self.promises(t, x, 1.0);
        let found = self.planned(&self.state.promises, u, |planner| planner.search(t, x));
        self.state.standing = match found {
            Ok(plan) => {
                self.state.plan = plan;
                Standing::Assured
            }
            Err(failure) => Standing::Refused(failure),
        };
    }

    /// Runs `f` with the planner of `promises`.
    fn planned<R>(
        &self,
        promises: &[Option<Promise>],
        u: &[f64],
        f: impl FnOnce(&Planner<'_>) -> Result<R, Failure>,
    ) -> Result<R, Failure> {
        let slots = self.filter.slots.iter().zip(promises).enumerate();
        let requirements: Vec<Requirement<'_>> = slots
            .filter_map(|(barrier, (slot, promise))| {
                let Promise { from, until, margin } = (*promise)?;
                Some(Requirement { barrier, source: &*slot.source, from, until, margin })
            })
            .collect();
        if requirements.is_empty() {
            return Err(Failure::Nothing);
        }
        let size = u.iter().fold(1.0, |m: f64, u| m.max(2.0 * u.abs()));
        let source = &*self.filter.slots[0].source;
        let planner = Planner::new(source, &self.filter.bounds, &requirements, self.period, size);
        f(&planner.ok_or(Failure::Singular)?)
    }

    /// Chooses the input: u_ref or the answer `u` of the rows where a plan stands behind it, else as far towards that as one
    /// does, else the plan's own.
    fn choose(&mut self, t: f64, x: &[f64], u_ref: &[f64], u: &mut [f64]) -> Driver {
        let reached = self.state.promises.iter().flatten().all(|promise| promise.from <= t);
        let mut wanted = [0.0; MAX_INPUTS];
        let wanted = &mut wanted[..u.len()];
        for (i, w) in wanted.iter_mut().enumerate() {
            *w = self.filter.bounds.clamp(i, u_ref[i]);
        }
        let plan = &self.state.plan;
        let found = self.planned(&self.state.promises, u, |planner| {
            if reached
                && wanted.iter().zip(u_ref).all(|(w, r)| w == r)
                && let Ok(witness) = planner.behind(plan, t, x, wanted)
                && witness.effort <= COMFORTABLE
            {
                return Ok((Driver::Reference, witness));
            }
            wanted.copy_from_slice(u);
            if let Ok(witness) = planner.behind(plan, t, x, wanted) {
                return Ok((Driver::Rows, witness));
            }
            // Towards the answer of the rows, from the plan's own input.
            let mut kept = planner.tail(plan, t, x)?;
            let own = kept.inputs[0].1;
            let (mut low, mut high, mut driver) = (0.0, 1.0, Driver::Plan);
            for _ in 0..BISECTIONS {
                let part = 0.5 * (low + high);
                for i in 0..u.len() {
                    wanted[i] = own[i] + part * (u[i] - own[i]);
                }
                match planner.behind(plan, t, x, wanted) {
                    Ok(witness) => (low, kept, driver) = (part, witness, Driver::Between),
                    Err(_) => high = part,
                }
            }
            Ok((driver, kept))
        });
        match found {
            Ok((driver, witness)) => {
                u.copy_from_slice(&witness.inputs[0].1[..u.len()]);
                self.state.plan.witness = witness;
                driver
            }
            Err(failure) => match self.planned(&self.state.promises, u, |planner| planner.search(t, x)) {
                Ok(plan) => {
                    u.copy_from_slice(&plan.witness.inputs[0].1[..u.len()]);
                    self.state.plan = plan;
                    Driver::Plan
                }
                Err(_) => {
                    self.state.standing = Standing::Withdrawn(failure);
                    Driver::Rows
                }
            },
        }
    }
}

/// Checks that every barrier runs the same plant ahead, at some states: a plan is one of all of them.
fn one_plant(filter: &SafetyFilter, period: f64) -> Result<(), Error> {
    const TRIALS: usize = 4;
    let (nx, nu) = (filter.state_dim, filter.input_dim);
    let moved = |slot: &BarrierSlot, trial: usize| {
        // Numbers that no model treats apart.
        let number = |i: usize| ((i * 37 + trial * 101 + 13) % 89) as f64 / 31.0 - 1.2;
        let mut x: Vec<f64> = (0..nx).map(number).collect();
        let u: Vec<f64> = (0..nu).map(|i| filter.bounds.clamp(i, number(i + nx))).collect();
        if let Some(plant) = slot.source.predict() {
            plant.flow(&mut x, &u, period);
        }
        x
    };
    for slot in &filter.slots[1..] {
        for trial in 0..TRIALS {
            let ends = [moved(&filter.slots[0], trial), moved(slot, trial)];
            let same =
                |(a, b): (&f64, &f64)| (a - b).abs() <= 1e-9 * (1.0 + a.abs()) || a.is_nan() && b.is_nan();
            if !ends[0].iter().zip(&ends[1]).all(same) {
                let message = format!(
                    "moves the state in another way than that of {}; a plan needs one plant for all barriers",
                    filter.slots[0].name
                );
                return Err(Error::new(ErrorKind::Unsupported, "source", message).within(&slot.name));
            }
        }
    }
    Ok(())
}
