//! A filter whose promise has a witness: decided at the first sample, kept within the bounds whatever u_ref is
//! (`docs/theory.md#witness`).

mod choice;

use alloc::boxed::Box;
use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;

use self::choice::{Chosen, Way, Wish};
use super::deviation::Deviation;
use super::integrator::insert;
use super::slot::BarrierSlot;
use super::{
    Begin, End, FilterState, Infeasible, IntegratedFilter, Integration, NoDerivative, Phase, Report,
    SafetyFilter, SampleDerivative, Status, Strictness, Workspace,
};
use crate::MAX_INPUTS;
use crate::convergence::FixedTimeState;
use crate::elementary;
use crate::error::{Error, ErrorKind, length, positive};
use crate::lie::{Direction, Predict};
use crate::plan::{
    Failure, Integral, Limit, ON_TIME, Plan, Planner, Policy, Requirement, Sought, Witness, slopes,
};
use crate::qp::Bounds;
use crate::scalar::all_finite;

/// Margin of a plan, as a part of the size of h at the first sample: for what the model leaves out between two samples. No
/// more than a part of the largest h there is: a small set that is far away has no room for it.
const MARGIN: f64 = 1e-4;
const ROOM: f64 = 0.05;
/// Its least size, as that of h where each state is moved so far, and by so much of itself: plans are no better resolved.
const RESOLVED: [f64; 2] = [1e-7, 64.0 * f64::EPSILON];
/// Margin of the rows behind which plans are, in units of theirs.
const AMPLE: f64 = 2.0;
/// Parts of the deadlines for which a plan is sought where none is found for the deadlines themselves: it keeps them too. Each
/// makes a refusal longer by as much as the first search.
const SHORTER: [f64; 1] = [0.8];
/// The most points of a plan's way at which it is looked for its arrival, about.
const MOST_POINTS: f64 = 4000.0;
/// How much later than a plan arrives the deadline is that it keeps.
const ARRIVED: [f64; 2] = [1.001, 1.02];
/// The part of the time until the end of a plan after which it is tried again to be prolonged, where it was not.
const SOONER: f64 = 0.25;
/// The largest round-off of a time, as a part of the period.
const ROUND_OFF: f64 = 1e-2;
/// By how much a clock that is measured may be late, as a part of a hold; what is kept in hand for the next time where it was not
/// exact; and how many intervals in a row that are so much shorter, alike to that part, are the new usual ones.
const JITTER: f64 = 0.05;
const HEADROOM: f64 = 0.02;
const QUICKER: f64 = 0.9;
const ALIKE: u32 = 8;
/// What a plant may do beside the model in the next hold, in units of what it was seen to do in those before.
const GUSTS: f64 = 1.5;
/// The shortest hold that plans tell from none, as a part of the period: one that is shorter is planned as that, since a plan may
/// go on where a sample comes sooner. Of an integral plans count every hold.
const SHORTEST: f64 = 1e-3;
const SHORTEST_INTEGRATED: f64 = 0.125;

/// Who chose the input of a step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Driver {
    /// u_ref, with a comfortable plan behind it: the one at hand, that moved in time, or another.
    Reference,
    /// The rows of the filter inside, with a plan behind their answer; or the rows alone, where there is no promise.
    #[default]
    Rows,
    /// As near to u_ref as its bounds, or the rows and a comfortable plan, allow.
    Eased,
    /// A compromise between the plan's own input and u_ref, or the answer of the rows where every set has been reached, or an input
    /// that does not jump from the last one; with a plan behind it.
    Between,
    /// The plan: nothing else keeps the promise.
    Plan,
}

/// Where the promise of an [`AssuredFilter`] stands. The numbers are stable: they leave the library as the FMU's
/// `assurance`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
#[non_exhaustive]
#[repr(u8)]
pub enum Standing {
    /// No sample yet.
    #[default]
    Undecided = 0,
    /// Every promise is kept: there is a witness.
    Assured = 1,
    /// Refused at the first sample: no plan was found. The filter goes on by its rows, without promise.
    Refused = 2,
    /// Was assured, and is not now: the plant is not where the model led. Until something promised is missed the promise is
    /// taken up again at the first sample from which a plan keeps it.
    Withdrawn = 3,
    /// Was assured, and is not now: a sample came later than the hold of the one before, or earlier and no plan was found
    /// from there. It is taken up again as one that is withdrawn, after a late sample at the next one in time.
    Irregular = 4,
    /// Was assured until a time, which has come: no plan was found beyond it. It is taken up again as one that is withdrawn.
    Expired = 5,
}

impl Standing {
    /// Every standing, in the order of its number.
    pub const ALL: [Self; 6] =
        [Self::Undecided, Self::Assured, Self::Refused, Self::Withdrawn, Self::Irregular, Self::Expired];

    /// Its name, as the FMU's enumeration has it.
    pub fn name(self) -> &'static str {
        self.words().0
    }

    /// Its meaning, in a few words.
    pub fn meaning(self) -> &'static str {
        self.words().1
    }

    fn words(self) -> (&'static str, &'static str) {
        match self {
            Self::Undecided => ("undecided", "no step with a valid state yet, or not armed"),
            Self::Assured => ("assured", "a plan keeps every promise, whatever u_ref is"),
            Self::Refused => ("refused", "no plan was found at the start: nothing is promised"),
            Self::Withdrawn => ("withdrawn", "was assured: the plant is not where the model led"),
            Self::Irregular => {
                ("irregular", "was assured: a step came late, or early without a plan from there")
            }
            Self::Expired => ("expired", "was assured until now: no plan was found beyond"),
        }
    }
}

/// Why u_ref was changed: with it held until the next sample, and the plan followed then, this barrier would be broken, or come
/// nearest to its edge where that is merely uncomfortable.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Reason {
    /// The number of the barrier.
    pub barrier: usize,
    /// When, in s.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub time: f64,
}

/// What an [`AssuredFilter`] says of a step beside its [`Report`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Assurance {
    /// Where the promise stands.
    pub standing: Standing,
    /// Who chose the input.
    pub driver: Driver,
    /// Why there is no plan, where the promise was refused, withdrawn, or has come to its end.
    pub failure: Option<Failure>,
    /// The time in s until which every promise is kept, infinite for ever; `None` where nothing is assured. Once given, it
    /// never goes back.
    pub until: Option<f64>,
    /// Why u_ref was changed, as seen when it last passed no more; `None` where it was not, or for its bounds alone, or where
    /// nothing is assured.
    pub reason: Option<Reason>,
}

impl Assurance {
    /// Whether every promise is kept, whatever u_ref is.
    pub fn is_assured(&self) -> bool {
        self.standing == Standing::Assured
    }
}

/// What an [`AssuredFilter`] remembers between samples beside the [`FilterState`] of its rows: the promises and the plan
/// that keeps them.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Commitment {
    /// Where the promise stands.
    pub standing: Standing,
    /// Why there is no plan, where the promise was refused or withdrawn.
    failure: Option<Failure>,
    /// One of each barrier; `None` where nothing is promised, or no more.
    promises: Vec<Option<Promise>>,
    /// The plan; while nothing is decided, one from before [`AssuredFilter::rearm`].
    plan: Plan,
    /// Where the plan was lost: when, in s, and when another one is next searched for.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    lost: Option<[f64; 2]>,
    /// The search for another one.
    regained: Sought,
    /// The part of the last input that was the plan's, beside the answer of the rows; 0 where no plan was needed.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    share: f64,
    /// What is comfortable, and when a plan is next sought behind u_ref.
    way: Way,
    /// The time in s at which a plan that ends is next tried to be prolonged.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    prolong_at: f64,
    /// Time of the last sample in s, and how long its input was to be held.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    sample: Option<[f64; 2]>,
    /// The time in s between the last two samples, and how many intervals in a row have been like it; 0 before there is one.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    interval: f64,
    alike: u32,
    /// What the plant was seen to do beside the model since the promise was given.
    deviation: Deviation,
}

impl Commitment {
    /// Whether the promise stands, or may be taken up again.
    fn is_followed(&self) -> bool {
        match self.standing {
            Standing::Assured => true,
            Standing::Undecided | Standing::Refused => false,
            Standing::Withdrawn | Standing::Irregular | Standing::Expired => {
                self.promises.iter().any(Option::is_some)
            }
        }
    }

    /// Notes a sample at `t`, whose input is to be held for `hold` s.
    fn note(&mut self, t: f64, hold: f64) {
        if let Some([last, _]) = self.sample
            && t > last
        {
            let interval = t - last;
            self.alike = if is_like(interval, self.interval) { self.alike.saturating_add(1) } else { 1 };
            self.interval = interval;
        }
        self.sample = Some([t, hold]);
    }

    /// Forgets what was promised. A plan that was followed for it is kept to go on with, and when the last sample was.
    fn rearm(&mut self) {
        let Self { standing, promises, plan, sample, interval, alike, .. } = core::mem::take(self);
        let is_over = |[t, _]: [f64; 2]| promises.iter().flatten().all(|promise| promise.until <= t);
        let is_followed = match standing {
            Standing::Assured => !sample.is_none_or(is_over),
            _ => standing == Standing::Undecided,
        };
        if is_followed {
            (self.plan, self.sample) = (plan, sample);
            (self.interval, self.alike) = (interval, alike);
        }
    }
}

/// h ≥ 0 from one time in s until another, and the margin that plans keep.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Promise {
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    from: f64,
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    until: f64,
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    margin: f64,
    /// From when in s it has to be there: what begins at the edge of its set has a period to leave it.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    firm: f64,
    /// What new plans keep, ≥ 0: a reserve where it is more than the margin.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    reserve: f64,
}

/// A sample that was looked at, its input, and that of the filter inside.
struct Looked {
    t: f64,
    hold: f64,
    x: Vec<f64>,
    u_ref: Vec<f64>,
    u: [f64; MAX_INPUTS],
    inside: [f64; MAX_INPUTS],
}

/// How often inputs change, and how far plans reach. A number is a period, with plans that end at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pace {
    /// The time in s for which an input is held, finite, > 0.
    pub period: f64,
    /// Where no plan ends at rest, the time in s, finite, > 0, that one has to reach past the last deadline and the sample;
    /// promises are then kept [until its end](Assurance::until). `None`: a plan has to end at rest. For plants without a
    /// rest, such as an aeroplane, and for sets that move for ever. It is tried to be prolonged before it ends.
    pub horizon: Option<f64>,
}

impl From<f64> for Pace {
    fn from(period: f64) -> Self {
        Self { period, horizon: None }
    }
}

/// A [`SafetyFilter`] that promises only what a plan keeps.
///
/// At the first sample it searches for a plan from there, in the model and within the bounds. Found: every barrier that
/// [can be](Self::promised) is promised, for whatever u_ref comes. Not found: the promise is refused, and the filter goes on
/// by its rows. Once promised, every input has a verified plan behind it. It is u_ref wherever a plan is found behind that; else a
/// compromise, once every set has been reached with the answer of the rows; or where nothing else keeps the promise the next input
/// of the plan itself.
///
/// Assumed: the plant is the model, its state is measured exactly, and samples are one period apart. Where the plant was seen to
/// differ, and by half as much again a set might be left before the next sample, the promise is withdrawn for that sample. A sample
/// may be taken again at the same time, come sooner, or come late by a twentieth of a hold. Where the time to the next sample changes and is [told](Self::expect_hold), a plan is sought for
/// the new one; none found ends the promise. A sample that comes later ends it until the next one. Where x is not finite, the
/// plan goes on as it is. A barrier without a deadline that [begins later](Begin::At) is promised from then on. A filter
/// with bounds on disturbance or measurement errors, a delay, or a deadline for what begins later cannot be assured yet, and
/// is refused by [`Self::new`]. Sets must not move, unless [it is known](crate::barrier::Barrier::range_from) how low h
/// gets: at a rest each is looked at at eight later times, up to a day, and no plan is found where it has. With a
/// [horizon](Pace::horizon) they may, and the plant needs no rest: the promise then has an [end](Assurance::until), which
/// is put off. States must be those of the plant, not of something that others move.
///
/// The search allocates, as do the plans.
///
/// ```
/// # use punctual_core::{barriers::DistanceDisc, filter::*};
/// # use punctual_core::plants::Unicycle;
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
/// assert!(filter.report().barriers[0].guaranteed);
/// # Ok::<(), punctual_core::Error>(())
/// ```
pub struct AssuredFilter {
    rows: Rows,
    /// The bounds of the inputs of the filter inside; for an integral those of a sample are tighter.
    bounds: Bounds,
    period: f64,
    horizon: Option<f64>,
    /// The most quadratic programs of a search at a sample after the first.
    programs: u32,
    policies: Vec<Policy>,
    /// Pairs of barriers whose sets have no state in common.
    apart: Vec<[usize; 2]>,
    /// The time in s for which the next input will be held, if somebody said so.
    expected: Option<f64>,
    commitment: Commitment,
    /// The sample that the reports are of, and the commitment after it.
    looked: Option<Looked>,
    next: Commitment,
    /// The integral after that sample; 0 where there is none.
    next_value: f64,
    /// How the input of that sample moves with it.
    piece: Piece,
    assurance: Assurance,
}

/// What a first sample is promised with.
struct First {
    promises: Vec<Option<Promise>>,
    plan: Plan,
    /// Whether the plan is one from before the filter was armed again.
    is_old: bool,
}

/// How an input moves with its sample, as long as the piece of the filter is the same: with `rows` times the answer of the rows
/// and `wish` times u_ref. The rest, that of a plan, is held, and so is each input that is `held`.
#[derive(Clone, Copy)]
struct Piece {
    rows: f64,
    wish: f64,
    held: [bool; MAX_INPUTS],
}

impl Piece {
    const WISH: Self = Self::mixed(0.0, 1.0);
    const ROWS: Self = Self::mixed(1.0, 0.0);
    const PLAN: Self = Self::mixed(0.0, 0.0);

    const fn mixed(rows: f64, wish: f64) -> Self {
        Self { rows, wish, held: [false; MAX_INPUTS] }
    }
}

/// The filter inside, whose rows are asked first.
enum Rows {
    Plain(SafetyFilter),
    Integrated(IntegratedFilter),
}

impl Rows {
    fn filter(&self) -> &SafetyFilter {
        match self {
            Self::Plain(filter) => filter,
            Self::Integrated(integrated) => &integrated.filter,
        }
    }

    fn filter_mut(&mut self) -> &mut SafetyFilter {
        match self {
            Self::Plain(filter) => filter,
            Self::Integrated(integrated) => &mut integrated.filter,
        }
    }

    /// Number of states and inputs of the plant outside.
    fn dims(&self) -> [usize; 2] {
        let SafetyFilter { state_dim, input_dim, .. } = self.filter();
        [state_dim - usize::from(matches!(self, Self::Integrated(_))), *input_dim]
    }

    /// Writes the answer of the rows, as one of the filter inside.
    fn peek(&mut self, t: f64, hold: f64, x: &[f64], u_ref: &[f64], u: &mut [f64]) -> Result<(), Error> {
        match self {
            Self::Plain(filter) => filter.peek(t, x, u_ref, u).map(|_| ()),
            Self::Integrated(own) => own.peek_rate(t, hold, x, u_ref, u),
        }
    }

    /// The state of the filter inside.
    fn state(&self, x: &[f64]) -> Vec<f64> {
        self.with(x, IntegratedFilter::value)
    }

    /// `x` with what `part` says of the integral in its place.
    fn with(&self, x: &[f64], part: impl Fn(&IntegratedFilter) -> f64) -> Vec<f64> {
        let mut inside = x.to_vec();
        if let Self::Integrated(own) = self {
            inside.push(0.0);
            insert(&mut inside, x, own.of.state, part(own));
        }
        inside
    }

    /// `u_ref` as a wish of the filter inside, and within its bounds.
    fn wanted(&self, hold: f64, u_ref: &[f64]) -> ([f64; MAX_INPUTS], [f64; MAX_INPUTS]) {
        let mut wish = [0.0; MAX_INPUTS];
        wish[..u_ref.len()].copy_from_slice(u_ref);
        if let Self::Integrated(own) = self {
            wish[own.of.input] = own.wanted(hold, u_ref[own.of.input]);
        }
        let bounds = &self.filter().bounds;
        let within = |i: usize| if i < u_ref.len() { bounds.clamp(i, wish[i]) } else { 0.0 };
        (wish, core::array::from_fn(within))
    }

    /// The direction of that state where the one measured moves along `dx`.
    fn direction(&self, dx: &[f64]) -> Vec<f64> {
        self.with(dx, |_| 0.0)
    }

    /// The direction of the wish of the filter inside where `u_ref` moves along `du_ref`.
    fn moves(&self, hold: f64, u_ref: &[f64], du_ref: &[f64]) -> [f64; MAX_INPUTS] {
        let mut moves = [0.0; MAX_INPUTS];
        moves[..du_ref.len()].copy_from_slice(du_ref);
        if let Self::Integrated(own) = self {
            moves[own.of.input] *= own.moves(hold, u_ref[own.of.input]);
        }
        // Beyond its bounds it moves nothing.
        let (wish, wanted) = self.wanted(hold, u_ref);
        for (moves, (wish, wanted)) in moves.iter_mut().zip(wish.iter().zip(&wanted)) {
            *moves = if wish == wanted { *moves } else { 0.0 };
        }
        moves
    }

    /// What the plant is given the mean of, if it is.
    fn integral(&self) -> Option<Integral> {
        match self {
            Self::Plain(_) => None,
            Self::Integrated(own) => Some(Integral { state: own.of.state, input: own.of.input }),
        }
    }

    /// Makes `u` of the filter inside one of the plant, for `hold` s; returns the integral after it.
    fn finish(&self, hold: f64, u: &mut [f64]) -> f64 {
        match self {
            Self::Plain(_) => 0.0,
            Self::Integrated(own) => own.finish(hold, u),
        }
    }
}

impl AssuredFilter {
    /// The longest deadlines looked for where a barrier takes a later one, in units of those configured.
    pub const LONGEST: f64 = 16.0;
    /// The default of [`Self::search_budget`].
    pub const PROGRAMS: u32 = 3;

    /// Puts plans behind `filter`, whose inputs are held for `period` s, finite, > 0; or [`Pace`] says more.
    ///
    /// # Errors
    ///
    /// A period or horizon out of range. A filter that cannot be assured: a barrier without a model to run ahead, or with
    /// another plant than the first one; one with a deadline that begins later, one that begins on another's arrival, or
    /// without a horizon one that moves for ever; a bound on disturbance or measurement errors; a delay.
    pub fn new(filter: SafetyFilter, pace: impl Into<Pace>) -> Result<Self, Error> {
        let bounds = filter.bounds;
        Self::around(Rows::Plain(filter), bounds, pace.into())
    }

    /// Puts plans behind `filter`, whose inputs are held for `period` s, finite, > 0; or [`Pace`] says more. Plans account
    /// for the mean that the plant is given over each period, and keep the limits of the integral. `x`, `u` and `u_ref` are
    /// those of [`IntegratedFilter::step`].
    ///
    /// # Errors
    ///
    /// As for [`Self::new`].
    pub fn integrated(filter: IntegratedFilter, pace: impl Into<Pace>) -> Result<Self, Error> {
        let mut bounds = filter.filter.bounds;
        let input = filter.of.input;
        [bounds.min[input], bounds.max[input]] = filter.rates;
        Self::around(Rows::Integrated(filter), bounds, pace.into())
    }

    fn around(rows: Rows, bounds: Bounds, Pace { period, horizon }: Pace) -> Result<Self, Error> {
        positive("period", period)?;
        horizon.map(|horizon| positive("horizon", horizon)).transpose()?;
        if let Some(obstacle) = Self::obstacles(rows.filter(), Pace { period, horizon }).into_iter().next() {
            return Err(obstacle);
        }
        Ok(Self {
            rows,
            bounds,
            period,
            horizon,
            programs: Self::PROGRAMS,
            policies: Vec::new(),
            apart: Vec::new(),
            expected: None,
            commitment: Commitment::default(),
            looked: None,
            next: Commitment::default(),
            next_value: 0.0,
            piece: Piece::ROWS,
            assurance: Assurance::default(),
        })
    }

    /// Everything about `filter` that keeps plans from being put behind it; nothing where [`Self::new`] does so. `pace` is in
    /// range.
    pub fn obstacles(filter: &SafetyFilter, pace: impl Into<Pace>) -> Vec<Error> {
        let Pace { period, horizon } = pace.into();
        let mut found = Vec::new();
        let refused = |field: &str, message: String| Error::new(ErrorKind::Unsupported, field, message);
        if filter.delay > 0.0 {
            found.push(refused("actuation_delay", format!("is {}, must be 0 for a plan", filter.delay)));
        }
        if !filter.errors.is_exact() {
            found.push(refused("measurement_errors", "are not 0, must be 0 for a plan".into()));
        }
        for slot in &filter.slots {
            let mut refuse =
                |field: &str, message: String| found.push(refused(field, message).within(&slot.name));
            let settings = slot.promise.settings();
            if settings.disturbance > 0.0 {
                refuse("disturbance", format!("is {}, must be 0 for a plan", settings.disturbance));
            }
            match (slot.begin, settings.deadline) {
                (Begin::AtOnce, _) | (Begin::At(_), None) => {}
                (Begin::At(begin), Some(_)) => {
                    let message = format!("is {begin}, must be 0 for a plan where there is a deadline");
                    refuse("begin", message);
                }
                (Begin::AfterArrival(_), _) => {
                    refuse("begin", "is the arrival of another barrier, which no plan foresees".into());
                }
            }
            if slot.source.predict().is_none() {
                refuse("source", "has no model to run ahead".into());
            } else if horizon.is_none() && slot.end == End::Never && leaves(slot, filter.state_dim) {
                let message = "moves with time, so that no plan ends; with a horizon one may end before";
                refuse("source", message.into());
            }
        }
        found.extend(one_plant(filter, period).err());
        found
    }

    /// Adds a policy with which a search for a plan begins: for promises that no search keeps by itself, such as a way
    /// through a gap. It writes the input at a time in s and a state, both those of the filter inside.
    #[must_use]
    pub fn policy(mut self, policy: impl Fn(f64, &[f64], &mut [f64]) + Send + 'static) -> Self {
        self.policies.push(Box::new(policy));
        self
    }

    /// Sets the most quadratic programs, > 0, of a search for a plan at one sample; it goes on at the next. A lost plan and one
    /// behind u_ref are sought so. The first sample's search goes on to its end, as that of a sample that comes at another time
    /// than was said, and that of a plan with a [horizon](Pace::horizon).
    ///
    /// # Errors
    ///
    /// No program at all.
    pub fn search_budget(self, programs: u32) -> Result<Self, Error> {
        match programs {
            0 => Err(Error::new(ErrorKind::Range, "search_budget", "is 0, must be at least 1")),
            _ => Ok(Self { programs, ..self }),
        }
    }

    /// Says that the sets of each pair of barriers, by their numbers, have no state in common at any time. What needs both at
    /// once is then refused without a search ([`Failure::Apart`]). Nothing else rests on it.
    #[must_use]
    pub fn apart(mut self, pairs: Vec<[usize; 2]>) -> Self {
        self.apart = pairs;
        self
    }

    /// The filter inside: to look at.
    pub fn filter(&self) -> &SafetyFilter {
        self.rows.filter()
    }

    /// The number of the input that is integrated, if one is.
    pub fn integrated_input(&self) -> Option<usize> {
        match &self.rows {
            Rows::Plain(_) => None,
            Rows::Integrated(integrated) => Some(integrated.of.input),
        }
    }

    /// The integral after the last step, as [`IntegratedFilter::value`]; 0 where there is none.
    pub fn value(&self) -> f64 {
        match &self.rows {
            Rows::Plain(_) => 0.0,
            Rows::Integrated(integrated) => integrated.value(),
        }
    }

    /// The integral that it would have after the sample of the last [`Self::peek`].
    pub fn next_value(&self) -> f64 {
        self.next_value
    }

    /// Puts back a [`Self::value`]; the nearest within the limits.
    pub fn set_value(&mut self, value: f64) {
        if let Rows::Integrated(integrated) = &mut self.rows {
            integrated.set_value(value);
            self.looked = None;
        }
    }

    /// The plan that is committed, where there is one.
    pub fn plan(&self) -> Option<&Witness> {
        (self.commitment.standing == Standing::Assured).then_some(&self.commitment.plan.witness)
    }

    /// The states of the filter inside on the way of `witness` from `x` at `t`, in steps of at most `step` s, finite, > 0:
    /// each with the input that is held from there until the next. The last is the rest, with the input that holds it.
    pub fn way(
        &self,
        witness: &Witness,
        t: f64,
        x: &[f64],
        step: f64,
    ) -> Vec<(f64, Vec<f64>, [f64; MAX_INPUTS])> {
        self.along(witness, t, &self.rows.state(x), step)
    }

    /// That from the state `x` of the filter inside.
    fn along(
        &self,
        witness: &Witness,
        t: f64,
        x: &[f64],
        step: f64,
    ) -> Vec<(f64, Vec<f64>, [f64; MAX_INPUTS])> {
        let (mut at, mut x, mut way) = (t, x.to_vec(), Vec::new());
        let Some(plant) = self.models().next() else { return way };
        for (end, u) in &witness.inputs {
            let (begin, steps) = (at, ((end - at) / step) as usize + 1);
            for k in 1..=steps {
                way.push((at, x.clone(), *u));
                let next = begin + (end - begin) * k as f64 / steps as f64;
                plant.flow(&mut x, &u[..self.rows.dims()[1]], next - at);
                at = next;
            }
        }
        way.extend(witness.inputs.last().map(|(_, u)| (at, x, *u)));
        way
    }

    /// The report of the last [`Self::step`] or [`Self::peek`], on the input that it returned.
    pub fn report(&self) -> &Report {
        self.filter().report()
    }

    /// Where the promise stands, and who chose the last input.
    pub fn assurance(&self) -> &Assurance {
        &self.assurance
    }

    /// The memory between samples, beside that of [`Self::filter`].
    pub fn commitment(&self) -> &Commitment {
        &self.commitment
    }

    /// For how long in s the input at `t` is held if samples go on as they came: for as long as the one before, and where the
    /// clock is not exact for a little longer than ever. A sample in between changes nothing, until eight in a row came as soon.
    /// At first, and after [`Self::rearm`] at another time than was said, for the period.
    pub fn usual_hold(&self, t: f64) -> f64 {
        let Commitment { standing, sample, alike, interval, .. } = self.commitment;
        let Some([last, held]) = sample else { return self.period };
        let passed = t - last;
        let is_same = (passed - held).abs() <= ON_TIME * held + 2.0 * f64::EPSILON * t.abs();
        let is_usual = passed < QUICKER * held && alike + 1 >= ALIKE && is_like(passed, interval);
        match standing {
            _ if is_same => held,
            Standing::Undecided => self.period,
            _ if is_like(passed, held) => held.max((1.0 + HEADROOM) * passed),
            _ if passed > held && passed.is_finite() || passed > 0.0 && is_usual => passed,
            _ => held,
        }
    }

    /// How long in s the input of the last sample was to be held, if there was one.
    pub fn last_hold(&self) -> Option<f64> {
        self.commitment.sample.map(|[_, hold]| hold)
    }

    /// Restores what [`SafetyFilter::state`] and [`Self::commitment`] returned: the filter goes on exactly as it would have
    /// then.
    ///
    /// # Errors
    ///
    /// A state or a commitment of another filter, or one that is damaged.
    pub fn restore(&mut self, state: &FilterState, commitment: &Commitment) -> Result<(), Error> {
        let Commitment {
            standing,
            promises,
            plan,
            lost,
            regained,
            share,
            way,
            prolong_at,
            sample,
            interval,
            ..
        } = commitment;
        let refuse = |field: &str, message: &str| Err(Error::new(ErrorKind::Dimension, field, message));
        if *standing != Standing::Undecided {
            length("promises", promises.len(), self.filter().slots.len())?;
        }
        if *standing == Standing::Undecided && state.time.is_some() {
            return refuse("standing", "is undecided, beside samples that were decided on");
        }
        if commitment.is_followed() || *standing == Standing::Undecided && !plan.is_empty() {
            if let Some(flaw) = plan.flaw([self.filter().state_dim, self.filter().input_dim]) {
                return refuse("plan", flaw);
            }
            if !(0.0..=1.0).contains(share) {
                return refuse("share", "is no part, must be 0 to 1");
            }
            if way.is_flawed() || regained.is_flawed() {
                return refuse("way", "is none of a filter, or not finite");
            }
            if prolong_at.is_nan() || plan.is_finite() && self.horizon.is_none() {
                return refuse("plan", "ends without a rest, which needs a horizon and a time to prolong it");
            }
            let is_promise = |p: &Promise| {
                let is_timed = p.from.is_finite() && p.firm.is_finite() && !p.until.is_nan();
                is_timed && p.margin >= 0.0 && p.reserve >= 0.0
            };
            if !promises.iter().flatten().all(is_promise) {
                return refuse("promises", "have a time or a margin that is no number");
            }
            if !sample.is_some_and(|[t, hold]| t.is_finite() && hold.is_finite() && hold > 0.0) {
                return refuse("sample", "has no time, must have one beside a plan");
            }
            if commitment.is_followed() && !commitment.deviation.fits(self.filter().state_dim) {
                return refuse("deviation", "is none of a plant with as many states");
            }
            if !interval.is_finite() {
                return refuse("interval", "is not finite");
            }
            if lost.iter().flatten().any(|t| !t.is_finite()) {
                return refuse("lost", "is at a time that is not finite");
            }
        }
        self.rows.filter_mut().restore(state)?;
        self.commitment.clone_from(commitment);
        self.looked = None;
        let Commitment { standing, failure, .. } = self.commitment;
        let until = self.plan().map(|witness| witness.until);
        self.assurance = Assurance { standing, driver: Driver::Rows, failure, until, reason: None };
        Ok(())
    }

    /// Forgets the promise: the next valid sample decides anew. Where it finds no other plan, the one at hand will do if it
    /// keeps what is promised then; and where x is not finite, that is followed until there is a valid sample. A set that x
    /// is inside of then is to be kept from there on, also one that was to be left once more before its deadline.
    pub fn rearm(&mut self) {
        self.rows.filter_mut().rearm();
        self.commitment.rearm();
        self.looked = None;
        self.assurance = Assurance::default();
    }

    /// Sets the time in s, finite, > 0, for which the input of the next sample will be held; `None` for the period. It is
    /// for whoever is told, such as a co-simulation slave by the size of its step.
    ///
    /// # Errors
    ///
    /// A time out of range.
    pub fn expect_hold(&mut self, hold: Option<f64>) -> Result<(), Error> {
        self.expected = hold.map(|hold| positive("hold", hold)).transpose()?;
        Ok(())
    }

    /// Computes the safe input at time `t` in s and remembers the sample; arguments as for [`SafetyFilter::step`].
    ///
    /// # Errors
    ///
    /// A slice of the wrong length.
    pub fn step(&mut self, t: f64, x: &[f64], u_ref: &[f64], u: &mut [f64]) -> Result<&Assurance, Error> {
        self.peek(t, x, u_ref, u)?;
        let SafetyFilter { state, workspace, .. } = self.rows.filter_mut();
        core::mem::swap(state, &mut workspace.next);
        core::mem::swap(&mut self.commitment, &mut self.next);
        if let Rows::Integrated(integrated) = &mut self.rows {
            integrated.set_value(self.next_value);
        }
        self.looked = None;
        Ok(&self.assurance)
    }

    /// Computes what [`Self::step`] would, without remembering the sample. The same step after it is free.
    ///
    /// # Errors
    ///
    /// As for [`Self::step`].
    pub fn peek(&mut self, t: f64, x: &[f64], u_ref: &[f64], u: &mut [f64]) -> Result<&Assurance, Error> {
        let [states, inputs] = self.rows.dims();
        length("x", x.len(), states)?;
        length("u_ref", u_ref.len(), inputs)?;
        length("u", u.len(), inputs)?;
        let hold = self.expected.unwrap_or(self.period);
        if let Some(looked) = &self.looked
            && looked.is_at(t, hold, x, u_ref)
        {
            u.copy_from_slice(&looked.u[..u.len()]);
            return Ok(&self.assurance);
        }
        self.looked = None;
        let planned = self.planned_hold(hold);
        self.rows.filter_mut().is_backed =
            self.commitment.is_followed() && self.commitment.lost.is_none() && self.in_time(t, planned);
        self.rows.peek(t, hold, x, u_ref, u)?;
        self.sample(t, planned, x, u_ref, u);
        let mut inside = [0.0; MAX_INPUTS];
        inside[..inputs].copy_from_slice(u);
        self.next_value = self.rows.finish(hold, u);
        let mut looked = Looked { t, hold, x: x.to_vec(), u_ref: u_ref.to_vec(), u: inside, inside };
        looked.u[..inputs].copy_from_slice(u);
        self.looked = Some(looked);
        Ok(&self.assurance)
    }

    /// The hold that plans count with where an input is held for `hold` s.
    fn planned_hold(&self, hold: f64) -> f64 {
        let shortest = if self.integrated_input().is_some() { SHORTEST_INTEGRATED } else { SHORTEST };
        hold.max(shortest * self.period)
    }

    /// As [`SafetyFilter::differentiate`], for the piece in force: u_ref, the rows' answer, a plan's own input or a
    /// compromise of these. The plan's own input is held: it was fixed at an earlier sample. Where the plan is new, or its
    /// input comes of feedback, that is the derivative as if it had been there.
    ///
    /// # Errors
    ///
    /// As for [`SafetyFilter::differentiate`].
    pub fn differentiate(
        &mut self,
        t: f64,
        x: &[f64],
        u_ref: &[f64],
        direction: Direction,
        out: &mut SampleDerivative,
    ) -> Result<Option<NoDerivative>, Error> {
        let mut given = [0.0; MAX_INPUTS];
        let inputs = self.rows.dims()[1];
        self.peek(t, x, u_ref, &mut given[..inputs])?;
        let hold = self.expected.unwrap_or(self.period);
        let u = self.looked.take().map_or(given, |looked| looked.inside);
        let unknown = match &mut self.rows {
            Rows::Plain(filter) => filter.differentiate(t, x, u_ref, direction, out),
            Rows::Integrated(own) => own.differentiate_rate(t, hold, x, u_ref, direction, out),
        }?;
        let Piece { rows, wish, held } = self.piece;
        if unknown.is_none() && (rows != 1.0 || held.contains(&true)) {
            let wished = self.rows.moves(hold, u_ref, direction.u);
            let du = core::array::from_fn(|i| if held[i] { 0.0 } else { rows * out.u[i] + wish * wished[i] });
            let x = &self.rows.state(x)[..];
            let dx = &self.rows.direction(direction.x)[..];
            if let Err(unknown) = self.rows.filter().carry(t, (x, dx), (&u[..inputs], du), out) {
                return Ok(Some(unknown));
            }
        }
        if let Rows::Integrated(own) = &self.rows {
            out.u[own.of.input] *= hold / 2.0;
        }
        Ok(unknown)
    }

    /// Goes on from the answer `u` of the rows at `t` and `x`, whose report and state are in the workspace, to that of the
    /// whole filter.
    fn sample(&mut self, t: f64, hold: f64, x: &[f64], u_ref: &[f64], u: &mut [f64]) {
        self.next.clone_from(&self.commitment);
        let filter = self.rows.filter();
        // Not by the status: u_ref may be no number.
        let is_armed = filter.workspace.next.is_armed(t, filter.arm_after);
        if self.next.standing == Standing::Undecided && !is_armed {
            (self.assurance, self.piece) = (Assurance::default(), Piece::ROWS);
            return;
        }
        let mut rows = [0.0; MAX_INPUTS];
        rows[..u.len()].copy_from_slice(u);
        let x = &self.rows.state(x)[..];
        let is_valid = t.is_finite() && all_finite(x);
        if t.is_finite() && (is_valid || self.next.sample.is_some()) {
            self.see(t, is_valid.then_some(x));
            self.next.note(t, hold);
        }
        let mut is_regular = self.is_regular(t, hold);
        if self.next.standing == Standing::Undecided && is_valid {
            // What is made at a sample is made for it.
            is_regular |= self.decide(t, hold, x, u);
        } else if self.commitment.is_followed() {
            // What came to its end was kept until then.
            let has_expired = self.commitment.standing == Standing::Expired;
            let lost = |standing| if has_expired { Standing::Expired } else { standing };
            match (self.in_time(t, hold), is_valid.then(|| self.missed(t, x)).flatten()) {
                (true, None) if is_valid => self.end(Standing::Assured, None),
                (true, None) => {}
                (false, None) => self.end(lost(Standing::Irregular), None),
                // For good.
                (_, failure) => {
                    self.end(lost(Standing::Withdrawn), failure);
                    self.next.promises.fill(None);
                }
            }
        }
        (self.assurance.driver, self.piece, self.assurance.reason) = (Driver::Rows, Piece::ROWS, None);
        // What is let go on arrival is promised no longer.
        let SafetyFilter { slots, workspace, .. } = self.rows.filter();
        let reports = &workspace.report.barriers;
        for ((promise, slot), b) in self.next.promises.iter_mut().zip(slots).zip(reports) {
            if slot.end == End::OnArrival && b.phase == Phase::Released {
                *promise = None;
            }
        }
        let is_over = self.next.promises.iter().flatten().all(|promise| promise.until <= t);
        if self.next.standing == Standing::Assured && !is_over {
            self.assurance.driver = match is_valid {
                true => self.choose(t, hold, x, u_ref, u, is_regular),
                false => self.go_on(t, hold, u),
            };
        } else if self.next.standing == Standing::Undecided && !self.next.plan.is_empty() {
            if self.in_time(t, hold) {
                self.assurance.driver = self.go_on(t, hold, u);
            } else {
                self.next.plan = Plan::default();
            }
        }
        if self.next.standing == Standing::Assured
            && is_valid
            && let Some(failure) = self.exposed(t, hold, x, u)
        {
            self.end(Standing::Withdrawn, Some(failure));
        }
        let Commitment { standing, failure, plan, .. } = &self.next;
        let is_assured = *standing == Standing::Assured;
        (self.assurance.standing, self.assurance.failure) = (*standing, *failure);
        self.assurance.until = is_assured.then_some(if is_over { f64::INFINITY } else { plan.witness.until });
        self.assurance.reason = self.assurance.reason.filter(|_| is_assured);
        if is_assured || u != &rows[..u.len()] {
            self.report_on(&rows[..u.len()], u);
        }
    }

    /// Sees at `t` how far the plant is from where the model has led since the last sample; `x` where it is measured.
    fn see(&mut self, t: f64, x: Option<&[f64]>) {
        let Some([last, _]) =
            self.commitment.sample.filter(|[last, _]| t > *last && self.commitment.is_followed())
        else {
            return;
        };
        let filter = self.rows.filter();
        let (u, mut led) = (&filter.state.input[..filter.input_dim], self.next.deviation.state.clone());
        let is_led = self.planned(&self.next.promises, (last, t - last), u, |planner| {
            planner.run(&mut led, u);
            Ok(())
        });
        // Of nothing that is promised nothing may be missed.
        if is_led.is_ok() {
            self.next.deviation.see(t, x, led, self.period);
        }
    }

    /// What may be missed in the `hold` s from `t` and `x` on, under `u`, where the plant goes on to differ from the model as it was
    /// seen to.
    fn exposed(&self, t: f64, hold: f64, x: &[f64], u: &[f64]) -> Option<Failure> {
        let mut promises = self.next.promises.clone();
        let differs = self.next.deviation.after(hold, x)?;
        let mut slope = x.to_vec();
        for (promise, model) in promises.iter_mut().zip(self.models()) {
            let Some(kept) = promise.as_mut().filter(|promise| promise.from < t + hold) else {
                *promise = None;
                continue;
            };
            slopes(model, t, x, &mut slope);
            let falls: f64 = slope.iter().zip(&differs).map(|(slope, differs)| slope.abs() * differs).sum();
            (kept.margin, kept.reserve, kept.firm) = (GUSTS * falls, 0.0, t);
        }
        match self.planned(&promises, (t, hold), u, |planner| planner.holds(t, x, u)) {
            Err(Failure::Broken { barrier, time, slack }) => Some(Failure::Drift { barrier, time, slack }),
            _ => None,
        }
    }

    /// What was or may have been missed until `t` since the last plan was followed, where the state is `x`: a set that is
    /// left, or a promise that began meanwhile.
    fn missed(&self, t: f64, x: &[f64]) -> Option<Failure> {
        let commitment = &self.commitment;
        let Commitment { standing, sample, .. } = commitment;
        let seen = sample.map_or(t, |[last, held]| match standing {
            Standing::Assured => last + held * (1.0 + JITTER),
            // There was a plan, but for a plant that differs.
            Standing::Withdrawn if commitment.lost.is_none() => last + held * (1.0 + JITTER),
            _ => last,
        });
        // A promise is about all times: what is measured again is not what was promised.
        if t <= seen + 2.0 * f64::EPSILON * t.abs() {
            return None;
        }
        self.next.promises.iter().zip(self.models()).enumerate().find_map(|(barrier, (promise, model))| {
            let Promise { from, until, .. } = (*promise)?;
            let h = model.value(t, x);
            // One that begins with this sample is seen at it.
            let begins = t - 2.0 * ON_TIME * self.period;
            match from <= t && t < until {
                // Not-a-number is outside too.
                true if h.is_nan() || h < 0.0 => Some(Failure::Broken { barrier, time: t, slack: h }),
                true if seen < from && from < begins => Some(Failure::Missed { barrier }),
                _ => None,
            }
        })
    }

    fn end(&mut self, standing: Standing, failure: Option<Failure>) {
        (self.next.standing, self.next.failure) = (standing, failure);
    }

    /// Whether a sample at `t` comes no later than the one before said, but for a clock that is measured, and times tell samples
    /// apart.
    fn in_time(&self, t: f64, hold: f64) -> bool {
        let Some([last, held]) = self.commitment.sample else { return false };
        let round_off = 2.0 * f64::EPSILON * t.abs();
        let late = JITTER * held + round_off;
        // Not-a-number is out of time.
        last <= t && t <= last + held + late && round_off <= ROUND_OFF * hold.min(held)
    }

    /// Whether the sample at `t` is one for which the plan was made.
    fn is_regular(&self, t: f64, hold: f64) -> bool {
        let Commitment { plan, sample, .. } = &self.commitment;
        sample.is_some_and(|[last, held]| {
            let tolerance = ON_TIME * held + 2.0 * f64::EPSILON * t.abs();
            plan.witness.is_even
                && (t == last || t >= last + held - tolerance)
                && (hold - held).abs() <= ON_TIME * held
        })
    }

    /// Makes the report and the state of the rows, whose answer is `rows`, those of the input `u`, which has a plan behind it
    /// where the promise stands.
    fn report_on(&mut self, rows: &[f64], u: &[f64]) {
        let (driver, is_assured) = (self.assurance.driver, self.assurance.is_assured());
        let Workspace { next, report, .. } = &mut self.rows.filter_mut().workspace;
        next.input[..u.len()].copy_from_slice(u);
        report.status = match (report.status, driver) {
            (Status::InvalidInput, _) => Status::InvalidInput,
            (status, _) if !is_assured => {
                if status.is_satisfied() {
                    Status::Infeasible
                } else {
                    status
                }
            }
            (_, Driver::Reference) => Status::Unchanged,
            (_, Driver::Eased) => Status::Filtered,
            (status, Driver::Rows) if status.is_satisfied() => status,
            _ => Status::Backup,
        };
        for ((b, state), promise) in
            report.barriers.iter_mut().zip(&mut next.barriers).zip(&self.next.promises)
        {
            if u != rows {
                (b.on_course, state.on_course) = (false, false);
                b.slack = b.row.slack(u);
            }
            // Plans count from the first state, rows from the first sample that is whole: a promise may end before its row.
            let stands = promise.as_ref().is_some_and(|promise| report.time < promise.until);
            if is_assured && stands && b.phase != Phase::Released {
                b.guaranteed = true;
                (b.unmet_steps, state.unmet) = (0, None);
                (b.blocked_by, b.deadlocked) = (None, false);
            }
        }
    }

    /// Goes on with the plan as it is, where nobody knows where the plant is.
    fn go_on(&mut self, t: f64, hold: f64, u: &mut [f64]) -> Driver {
        let plan = &self.next.plan;
        let inputs = &plan.witness.inputs;
        let next = inputs.iter().find(|(end, _)| *end > t + 0.5 * hold);
        // Past its end, a rest that only feedback holds is left.
        let is_over = next.is_none() && !plan.stays();
        if let Some((_, input)) = next.or(inputs.last()) {
            for (i, u) in u.iter_mut().enumerate() {
                *u = self.bounds.clamp(i, input[i]);
            }
        }
        let is_lost = is_over || !self.is_regular(t, hold);
        if is_lost && self.next.standing == Standing::Undecided {
            self.next.plan = Plan::default();
        } else if is_lost {
            self.end(if is_over { Standing::Withdrawn } else { Standing::Irregular }, None);
        }
        Driver::Plan
    }

    /// Whether each barrier is one that a first sample at `t` and `x` could promise: not a soft one, one that ends before its
    /// deadline, or one without a deadline that begins at once and whose set `x` is outside of.
    pub fn promised(&self, t: f64, x: &[f64]) -> impl Iterator<Item = bool> {
        self.promises(t, &self.rows.state(x), |_| 1.0).into_iter().map(|promise| promise.is_some())
    }

    /// The promises from `x` at `t`, each deadline multiplied by the factor of its barrier.
    fn promises(&self, t: f64, x: &[f64], factor: impl Fn(&BarrierSlot) -> f64) -> Vec<Option<Promise>> {
        let promise = |(slot, model): (&BarrierSlot, &dyn Predict)| {
            // Not that of the report, which has none where u_ref is no number.
            let h = model.value(t, x);
            // A little earlier, so that round-off of a time is no gap.
            let after = |seconds: f64| t + seconds - ON_TIME * self.period;
            let from = match (slot.begin, slot.promise.settings().deadline) {
                (Begin::At(begin), _) if begin > 0.0 => after(begin),
                // Not-a-number is asked for at once, and found by the check.
                _ if h.is_nan() || h >= 0.0 => t,
                (_, Some(deadline)) => after(factor(slot) * deadline),
                (_, None) => return None,
            };
            let until = match slot.end {
                End::Never => f64::INFINITY,
                End::At(seconds) => t + seconds,
                End::OnArrival => from + self.period,
            };
            let soft = matches!(slot.strictness, Strictness::Soft(_));
            let margin = margin(model, t, x, h);
            let firm = if from == t && h < AMPLE * margin { after(self.period) } else { t };
            // Half of the user's, so that a plan stands behind the rows, which aim at all of it.
            let reserve = slot.promise.settings().margin / AMPLE;
            // What is kept from now on may be nearer to its edge.
            let reserve = if from == t { reserve.min(h / AMPLE) } else { reserve };
            (!soft && until > from).then_some(Promise { from, until, margin, firm, reserve })
        };
        self.filter().slots.iter().zip(self.models()).map(promise).collect()
    }

    /// Every barrier along the plant, run ahead.
    fn models(&self) -> impl Iterator<Item = &dyn Predict> {
        self.filter().slots.iter().filter_map(|slot| slot.source.predict())
    }

    /// The plan that a first sample at `t` and `x` would find, with every deadline `factor` times as long. Remembers
    /// nothing. `factor`: finite, > 0.
    ///
    /// # Errors
    ///
    /// What the nearest trial fails at.
    pub fn foresee(&self, t: f64, x: &[f64], factor: f64) -> Result<Witness, Failure> {
        let x = &self.rows.state(x)[..];
        let promises = self.promises(t, x, |_| factor);
        self.first(promises, (t, self.period), x, &[], &SHORTER).map(|first| first.plan.witness)
    }

    /// The least factor by which every deadline has to be multiplied for a plan from `x` at `t` to be found, to a
    /// fiftieth or less where a plan arrives sooner than it has to, and that plan. None is looked for beyond `longest` times the
    /// deadlines, nor where one would come after the end of its barrier.
    pub fn soonest(&self, t: f64, x: &[f64], longest: f64) -> Option<(f64, Witness)> {
        self.appraise(t, x, longest).1
    }

    /// What [`Self::foresee`] says of the deadlines themselves, and [`Self::soonest`], with one search for both.
    pub fn appraise(
        &self,
        t: f64,
        x: &[f64],
        longest: f64,
    ) -> (Result<Witness, Failure>, Option<(f64, Witness)>) {
        let state = &self.rows.state(x)[..];
        let promises = self.promises(t, state, |_| 1.0);
        match self.first(promises, (t, self.period), state, &[], &SHORTER) {
            Ok(first) => (Ok(first.plan.witness.clone()), self.least(t, x, longest, Some(first))),
            Err(failure) => (Err(failure), self.least(t, x, longest, None)),
        }
    }

    /// The same where [none is found](Self::foresee) for the deadlines themselves, which is not tried again.
    pub fn soonest_later(&self, t: f64, x: &[f64], longest: f64) -> Option<(f64, Witness)> {
        self.least(t, x, longest, None)
    }

    /// [`Self::soonest`], where `first` was found for the deadlines themselves.
    fn least(&self, t: f64, x: &[f64], longest: f64, first: Option<First>) -> Option<(f64, Witness)> {
        let x = &self.rows.state(x)[..];
        let promised = |factor: f64| self.promises(t, x, |_| factor);
        let arrived = |factor: f64, First { promises, plan, .. }: First| {
            (factor * self.arrival(&promises, &plan, t, x), plan)
        };
        let find = |factor: f64| {
            let found = self.first(promised(factor), (t, self.period), x, &[], &[]).ok()?;
            Some(arrived(factor, found))
        };
        let sooner = |factor: f64, (before, plan): &(f64, Plan)| {
            let found =
                self.beside(promised(factor), (t, self.period), x, &[], plan, factor / before).ok()?;
            Some(arrived(factor, found))
        };
        let found = first.map(|first| arrived(1.0, first));
        let (factor, plan) = least_factor(self.longest(longest, |_| true), found, find, sooner)?;
        Some((factor, plan.witness))
    }

    /// `longest`, or the largest factor with which no deadline of those that `scales` picks comes after the end of its barrier.
    fn longest(&self, longest: f64, scales: impl Fn(&BarrierSlot) -> bool) -> f64 {
        let ends = self.filter().slots.iter().filter(|slot| scales(slot)).filter_map(|slot| {
            match (slot.end, slot.promise.settings().deadline) {
                (End::At(end), Some(deadline)) => Some(end / deadline),
                _ => None,
            }
        });
        ends.fold(longest, f64::min)
    }

    /// `promises`, whose deadlines are `part` of the time from `t` that they were; what begins by itself stays.
    fn sooner(&self, promises: &[Option<Promise>], t: f64, part: f64) -> Vec<Option<Promise>> {
        let sooner = |(promise, slot): (&Option<Promise>, &BarrierSlot)| {
            let mut promise = (*promise)?;
            if promise.from > t && slot.begin == Begin::AtOnce {
                promise.from = t + part * (promise.from - t);
                if slot.end == End::OnArrival {
                    promise.until = promise.from + self.period;
                }
            }
            Some(promise)
        };
        promises.iter().zip(&self.filter().slots).map(sooner).collect()
    }

    /// The part of the time until their deadlines that `plan`, which keeps `promises` from `x` at `t`, needs for them all, at most 1.
    fn arrival(&self, promises: &[Option<Promise>], plan: &Plan, t: f64, x: &[f64]) -> f64 {
        let end = plan.witness.inputs.last().map_or(t, |(end, _)| *end);
        let way = self.along(&plan.witness, t, x, self.period.max((end - t) / MOST_POINTS));
        let mut part = 0.0_f64;
        for ((promise, slot), model) in promises.iter().zip(&self.filter().slots).zip(self.models()) {
            let Some(promise) = promise.filter(|p| p.from > t && slot.begin == Begin::AtOnce) else {
                continue;
            };
            let least = promise.margin.max(promise.reserve);
            let before = way.iter().take_while(|(at, ..)| *at < promise.from);
            let outside = before.enumerate().filter(|(_, (at, x, _))| {
                let h = model.value(*at, x);
                h.is_nan() || h < least
            });
            let arrival = outside.last().and_then(|(k, _)| way.get(k + 1)).map_or(t, |(at, ..)| *at);
            part = part.max((arrival - t) / (promise.from - t));
        }
        let keeps = |part: f64| {
            let sooner = self.sooner(promises, t, part);
            let keeps = |planner: &Planner<'_>| match planner.keeps(plan, t, x) {
                true => Ok(()),
                false => Err(Failure::Nothing),
            };
            self.planned(&sooner, (t, self.period), &[], keeps).is_ok()
        };
        ARRIVED
            .into_iter()
            .map(|late| late * part)
            .find(|part| *part > 0.0 && *part < 1.0 && keeps(*part))
            .unwrap_or(1.0)
    }

    /// Decides at the first sample: what is promised, and whether a plan keeps it. Where none does, those barriers that are
    /// [to take a later deadline](Infeasible::Soonest) get the soonest for which there is one. Whether the plan was made here.
    fn decide(&mut self, t: f64, hold: f64, x: &[f64], u: &[f64]) -> bool {
        let search = |promises, shorter: &[f64]| self.first(promises, (t, hold), x, u, shorter);
        let promises = self.promises(t, x, |_| 1.0);
        let mut found = search(promises.clone(), &SHORTER).map(|first| (1.0, first));
        let yields = |slot: &BarrierSlot| slot.promise.settings().infeasible == Infeasible::Soonest;
        if found.is_err() && self.filter().slots.iter().any(yields) {
            let promised = |factor: f64| self.promises(t, x, |slot| if yields(slot) { factor } else { 1.0 });
            let later = |factor: f64| search(promised(factor), &[]).ok().map(|first| (factor, first));
            let sooner = |factor: f64, (before, first): &(f64, First)| {
                let (promises, plan) = (promised(factor), &first.plan);
                self.beside(promises, (t, hold), x, u, plan, factor / before)
                    .ok()
                    .map(|first| (factor, first))
            };
            let later = least_factor(self.longest(Self::LONGEST, yields), None, later, sooner);
            found = later.map_or(found, Ok);
        }
        match found {
            Ok((factor, First { promises, plan, is_old })) => {
                (self.next.promises, self.next.plan) = (promises, plan);
                self.next.deviation = Deviation::from(t, x);
                self.next.way = Way::beside(&self.next.plan.witness);
                self.next.prolong_at = self.next_prolonging(t, self.next.plan.witness.until);
                self.end(Standing::Assured, None);
                self.postpone(t, hold, factor);
                !is_old
            }
            Err(failure) => {
                (self.next.promises, self.next.plan) = (promises, Plan::default());
                self.end(Standing::Refused, Some(failure));
                true
            }
        }
    }

    /// The first plan for `promises`, with their reserve, else without, else for deadlines that are one of the parts `shorter`
    /// of theirs, else the one at hand.
    fn first(
        &self,
        mut promises: Vec<Option<Promise>>,
        at: (f64, f64),
        x: &[f64],
        u: &[f64],
        shorter: &[f64],
    ) -> Result<First, Failure> {
        if let Some(failure) = self.contradiction(&promises, at.0) {
            return Err(failure);
        }
        let search =
            |promises: &[Option<Promise>]| self.planned(promises, at, u, |planner| planner.search(at.0, x));
        let mut found = search(&promises);
        if found.is_err() && promises.iter().flatten().any(|promise| promise.reserve > promise.margin) {
            promises.iter_mut().flatten().for_each(|promise| promise.reserve = 0.0);
            found = search(&promises);
        }
        if let Err(Failure::Broken { .. } | Failure::Unsteady) = found
            && self.horizon.is_none()
            && !self.is_ruled_out(&promises, at.0, x)
        {
            // What keeps an earlier deadline keeps a later one, though another search may find it.
            let mut earlier =
                shorter.iter().filter_map(|part| search(&self.sooner(&promises, at.0, *part)).ok());
            found = earlier.next().map_or(found, Ok);
        }
        let Err(failure) = found else { return found.map(|plan| First { promises, plan, is_old: false }) };
        let old = &self.commitment.plan;
        if self.commitment.standing != Standing::Undecided || old.is_empty() {
            return Err(failure);
        }
        promises.iter_mut().flatten().for_each(|promise| promise.reserve = 0.0);
        let is_irregular = !self.is_regular(at.0, at.1);
        let tail = |planner: &Planner<'_>| planner.irregular(is_irregular).tail(old, at.0, x);
        match self.planned(&promises, at, u, tail) {
            // One that ends sooner reaches nothing.
            Ok(witness) if promises.iter().flatten().all(|promise| promise.from < witness.until) => {
                let mut plan = old.clone();
                plan.witness = witness;
                Ok(First { promises, plan, is_old: true })
            }
            _ => Err(failure),
        }
    }

    /// A plan for `promises` beside one for others, whose deadlines are these by `factor`; only near that one it is sought.
    fn beside(
        &self,
        mut promises: Vec<Option<Promise>>,
        at: (f64, f64),
        x: &[f64],
        u: &[f64],
        plan: &Plan,
        factor: f64,
    ) -> Result<First, Failure> {
        if self.is_ruled_out(&promises, at.0, x) {
            return Err(Failure::Nothing);
        }
        promises.iter_mut().flatten().for_each(|promise| promise.reserve = 0.0);
        let search = |planner: &Planner<'_>| planner.beside(plan, factor).search(at.0, x);
        let plan = self.planned(&promises, at, u, search)?;
        Ok(First { promises, plan, is_old: false })
    }

    /// Two promises that no state keeps at a time at which both are in force.
    fn contradiction(&self, promises: &[Option<Promise>], t: f64) -> Option<Failure> {
        let slots = &self.filter().slots;
        self.apart.iter().find_map(|&[a, b]| {
            let (p, q) = (promises.get(a).copied().flatten()?, promises.get(b).copied().flatten()?);
            // What is let go on arrival has to be reached at some time until its deadline, and nobody says when.
            let [of_p, of_q] = [(a, p), (b, q)].map(|(i, promise)| match slots[i].end {
                End::OnArrival => (t, promise.from + self.period),
                _ => (promise.from, promise.until),
            });
            let is_apart = match [a, b].map(|i| slots[i].end == End::OnArrival) {
                [true, true] => false,
                [true, false] => q.from <= t && q.until >= of_p.1,
                [false, true] => p.from <= t && p.until >= of_q.1,
                [false, false] => of_p.0.max(of_q.0) < of_p.1.min(of_q.1),
            };
            let contains = |i: usize, promise: Promise| {
                promise.from <= t && slots[i].promise.settings().deadline.is_some()
            };
            let [first, second] = if contains(b, q) && !contains(a, p) { [b, a] } else { [a, b] };
            let contained = contains(first, if first == a { p } else { q });
            is_apart.then_some(Failure::Apart { barriers: [first, second], contained })
        })
    }

    /// Whether it is certain that no input keeps one of the deadlines of `promises` from `x` at `t`.
    fn is_ruled_out(&self, promises: &[Option<Promise>], t: f64, x: &[f64]) -> bool {
        promises.iter().enumerate().any(|(i, promise)| {
            let after = promise.filter(|p| p.from > t && p.from.is_finite()).map(|p| p.from - t);
            after.is_some_and(|after| self.filter().is_ruled_out(i, t, x, after).unwrap_or(false))
        })
    }

    /// Starts the rows anew at the first sample, with deadlines `factor` times as long where they yield. They keep more margin
    /// than plans do, so that one stands behind their answer at the edge of a set too.
    fn postpone(&mut self, t: f64, hold: f64, factor: f64) {
        let SafetyFilter { slots, state, workspace, .. } = self.rows.filter_mut();
        let Workspace { next, report, .. } = workspace;
        let states = next.barriers.iter_mut().zip(&state.barriers).zip(&self.next.promises);
        for ((slot, ((state, before), promise)), b) in slots.iter().zip(states).zip(&mut report.barriers) {
            let settings = slot.promise.settings();
            let later = factor > 1.0 && settings.infeasible == Infeasible::Soonest && b.h < 0.0;
            state.least_margin = promise.map_or(0.0, |promise| AMPLE * promise.margin);
            if !slot.now.in_force || !(later || state.least_margin > settings.margin) {
                continue;
            }
            let FixedTimeState { deadline, arrival, on_course, gain, unmet, .. } = *state;
            let deadline = if later { factor * slot.promise.deadline() } else { deadline };
            slot.promise.anchor(state, t, &slot.now.derivatives.drift[..slot.degree()], deadline, hold);
            (state.arrival, state.gain, state.unmet) = (arrival, gain, unmet);
            if later {
                // Once, whatever the rows had made of it.
                state.postponed = before.postponed + 1;
                (b.time_left, b.deadline_unreachable) = (state.deadline, false);
            } else {
                state.on_course = on_course;
            }
            b.remember(state);
        }
    }

    /// Runs `f` with the planner of `promises`, for samples that are `period` s apart.
    fn planned<R>(
        &self,
        promises: &[Option<Promise>],
        (t, period): (f64, f64),
        u: &[f64],
        f: impl FnOnce(&Planner<'_>) -> Result<R, Failure>,
    ) -> Result<R, Failure> {
        let mut requirements: Vec<Requirement<'_>> = self
            .models()
            .zip(promises)
            .enumerate()
            .filter_map(|(barrier, (model, promise))| {
                let Promise { from, until, margin, firm, reserve } = (*promise)?;
                Some(Requirement { barrier, is_limit: false, model, from, until, margin, firm, reserve })
            })
            .collect();
        if requirements.is_empty() {
            return Err(Failure::Nothing);
        }
        let size = u.iter().fold(1.0, |m: f64, u| m.max(2.0 * u.abs()));
        let (plant, dims) = (requirements[0].model, [self.filter().state_dim, self.filter().input_dim]);
        let limits = self.limits(plant);
        requirements.extend(limits.iter().zip(promises.len()..).map(|(limit, barrier)| {
            let (from, until) = (t, f64::INFINITY);
            Requirement {
                barrier,
                is_limit: true,
                model: limit,
                from,
                until,
                // What is kept at a limit is not missed by what no number tells from it.
                margin: -0.25 * f64::EPSILON * limit.limit.abs(),
                firm: t,
                reserve: 0.0,
            }
        }));
        let mut planner =
            Planner::new(plant, dims, &self.bounds, &requirements, period, size).usually(self.period);
        if let Some(integral) = self.rows.integral() {
            planner = planner.integrated(integral);
        }
        f(&planner.led(&self.policies).until(self.horizon))
    }

    /// The limits of the integral as barriers along `plant`.
    fn limits<'a>(&self, plant: &'a dyn Predict) -> Vec<Limit<'a>> {
        let Rows::Integrated(own) = &self.rows else { return Vec::new() };
        let Integration { state, limits: [min, max], .. } = own.of;
        let sides = [(1.0, min), (-1.0, max)].into_iter().filter(|(_, limit)| limit.is_finite());
        sides.map(|(sign, limit)| Limit { plant, state, sign, limit }).collect()
    }

    /// The time in s at which a plan that ends at `until` is next tried to be prolonged, at `t`: when it has become as short
    /// as it may be, and then ever more often until its end.
    fn next_prolonging(&self, t: f64, until: f64) -> f64 {
        let Some(horizon) = self.horizon else { return f64::INFINITY };
        let last = self.next.promises.iter().flatten().map(|promise| promise.from).fold(t, f64::max);
        let is_last = self.next.promises.iter().flatten().all(|promise| promise.until <= until);
        match until - horizon {
            _ if is_last => f64::INFINITY,
            due if last < due => due,
            _ => t + SOONER * (until - t),
        }
    }

    /// Looks for a plan that ends later than the one at hand, where it is time to.
    fn prolong(&mut self, t: f64, hold: f64, x: &[f64], u: &[f64]) {
        if t < self.next.prolong_at {
            return;
        }
        let until = self.next.plan.witness.until;
        let longer = self.planned(&self.next.promises, (t, hold), u, |planner| {
            planner.beyond(&self.next.plan.witness).search(t, x)
        });
        let longer = longer.ok().filter(|longer| longer.witness.until > until);
        if let Some(plan) = longer {
            self.next.plan = plan;
        }
        self.next.prolong_at = self.next_prolonging(t, self.next.plan.witness.until);
    }

    /// Chooses the input, `u` of the rows at first, and remembers what is behind it. `is_regular` tells whether the plan is one for
    /// this sample.
    fn choose(
        &mut self,
        t: f64,
        hold: f64,
        x: &[f64],
        u_ref: &[f64],
        u: &mut [f64],
        is_regular: bool,
    ) -> Driver {
        self.prolong(t, hold, x, u);
        let (wish, wanted) = self.rows.wanted(hold, u_ref);
        let mut way = self.next.way.clone();
        let wish = Wish {
            wish: &wish[..u.len()],
            wanted: &wanted[..u.len()],
            rows: u,
            reached: self.next.promises.iter().flatten().all(|promise| promise.from <= t),
        };
        let found = self.planned(&self.next.promises, (t, hold), u, |planner| {
            let (planner, reached) = (planner.irregular(!is_regular).hurried(self.programs), wish.reached);
            let chosen = self.chosen(&planner, (t, x), wish, &mut way)?;
            Ok(self.smoothed(&planner, (t, x), chosen, reached))
        });
        let failure = match found {
            Ok(Chosen { driver, piece, share, witness, plan }) => {
                self.piece = piece;
                self.note(&mut way, share, driver);
                self.next.way = way;
                (self.next.share, self.next.lost, self.next.regained) = (share, None, Sought::default());
                u.copy_from_slice(&witness.inputs[0].1[..u.len()]);
                self.assurance.reason = self.next.way.reason.filter(|_| *u != wanted[..u.len()]);
                if let Some(plan) = plan {
                    self.next.plan = plan;
                }
                self.next.plan.witness = witness;
                return driver;
            }
            Err(failure) => failure,
        };
        // A plan that ends at rest is sought by a few steps a sample, where samples come as they are to.
        let is_spread = is_regular && !self.next.plan.is_finite();
        let (mut regained, mut goes_on) = (self.next.regained.clone(), false);
        let found = match self.commitment.lost {
            Some([_, next]) if t < next => Err(failure),
            _ => {
                // One that is lost is found again without its reserve.
                let mut promises = self.next.promises.clone();
                promises.iter_mut().flatten().for_each(|promise| promise.reserve = 0.0);
                self.planned(&promises, (t, hold), u, |planner| match is_spread {
                    true => planner
                        .hurried(self.programs)
                        .regained(&self.next.plan, t, x, &mut regained)
                        .map_err(|left| {
                            goes_on = left;
                            failure
                        }),
                    false => planner.beyond(&self.next.plan.witness).search(t, x),
                })
            }
        };
        self.next.regained = regained;
        match found {
            Ok(plan) => {
                u.copy_from_slice(&plan.witness.inputs[0].1[..u.len()]);
                self.next.prolong_at = self.next_prolonging(t, plan.witness.until);
                (self.next.plan, self.next.share) = (plan, 1.0);
                (self.next.lost, self.next.regained) = (None, Sought::default());
                self.piece = Piece::PLAN;
                Driver::Plan
            }
            Err(longer) => {
                // A plan that has come to its end was kept.
                let is_at_its_end = self.next.plan.witness.until <= t + 0.5 * hold;
                let Commitment { standing, lost, .. } = self.commitment;
                let (standing, failure) = match is_regular {
                    _ if lost.is_some() => (standing, failure),
                    _ if is_at_its_end => (Standing::Expired, longer),
                    true => (Standing::Withdrawn, failure),
                    false => (Standing::Irregular, failure),
                };
                self.end(standing, Some(failure));
                // Ever more seldom, since a search is long.
                if lost.is_none_or(|[_, next]| t >= next) {
                    let since = lost.map_or(t, |[since, _]| since);
                    let pause = if goes_on { 0.0 } else { (t - since).max(hold).max(self.period) };
                    self.next.lost = Some([since, t + pause]);
                }
                self.come_near(t, hold, x, u)
            }
        }
    }

    /// Where the promise is lost: the input of the plan's law, where that nearly keeps it from here; else the answer of the
    /// rows.
    fn come_near(&mut self, t: f64, hold: f64, x: &[f64], u: &mut [f64]) -> Driver {
        let nearly = |planner: &Planner<'_>| planner.nearly(&self.next.plan, t, x);
        match self.planned(&self.next.promises, (t, hold), u, nearly) {
            Ok(input) => {
                u.copy_from_slice(&input[..u.len()]);
                self.piece = Piece::PLAN;
                Driver::Plan
            }
            Err(_) => Driver::Rows,
        }
    }
}

impl Looked {
    /// Whether it is the sample with these arguments, bit for bit.
    fn is_at(&self, t: f64, hold: f64, x: &[f64], u_ref: &[f64]) -> bool {
        let same = |a: &[f64], b: &[f64]| a.iter().map(|v| v.to_bits()).eq(b.iter().map(|v| v.to_bits()));
        same(&[self.t, self.hold], &[t, hold]) && same(&self.x, x) && same(&self.u_ref, u_ref)
    }
}

/// The margin that plans keep of a barrier that has the value `h` at `t` and `x`.
fn margin(model: &dyn Predict, t: f64, x: &[f64], h: f64) -> f64 {
    let mut gradient = x.to_vec();
    slopes(model, t, x, &mut gradient);
    let resolved: f64 =
        x.iter().zip(&gradient).map(|(x, g)| g.abs() * (RESOLVED[0] + RESOLVED[1] * x.abs())).sum();
    // Not-a-number is no size.
    let wanted = (MARGIN * h.abs()).max(resolved);
    let highest = highest(model, t, x, wanted / ROOM);
    if highest > 0.0 { wanted.min(ROOM * highest) } else { wanted }
}

/// The largest h found uphill from `x` at `t`, up to `enough`.
fn highest(model: &dyn Predict, t: f64, x: &[f64], enough: f64) -> f64 {
    const STEPS: u32 = 60;
    const HALVINGS: u32 = 30;
    let (mut x, mut gradient, mut next) = (x.to_vec(), x.to_vec(), x.to_vec());
    let mut h = model.value(t, &x);
    for _ in 0..STEPS {
        slopes(model, t, &x, &mut gradient);
        let steepness: f64 = gradient.iter().map(|g| g * g).sum();
        let mut length = (enough - h) / steepness;
        let climbs = (0..HALVINGS).any(|_| {
            for (next, (x, g)) in next.iter_mut().zip(x.iter().zip(&gradient)) {
                *next = x + length * g;
            }
            length *= 0.5;
            model.value(t, &next) > h
        });
        // Not-a-number leads nowhere.
        if h >= enough || !climbs {
            break;
        }
        x.copy_from_slice(&next);
        h = model.value(t, &x);
    }
    h
}

/// The least factor for which `find` finds something, to a fiftieth, and that; `None` beyond `longest`. `found` is what it
/// finds with 1. What is found with a factor, or for a smaller one beside it, is taken to be found with every larger one. `sooner` finds
/// something beside what was found.
fn least_factor<T>(
    longest: f64,
    mut found: Option<(f64, T)>,
    find: impl Fn(f64) -> Option<(f64, T)>,
    sooner: impl Fn(f64, &(f64, T)) -> Option<(f64, T)>,
) -> Option<(f64, T)> {
    const FINE: f64 = 1.02;
    const LEAST: f64 = 1e-3;
    const MOST: f64 = 1e6;
    const SEARCHES: u32 = 3;
    const WIDE: f64 = 1.1;
    // Twice as long until there is one; then by half sooner, and by ever less where none is found beside it.
    let longest = longest.min(MOST);
    let (mut low, mut high) = (0.0, 1.0);
    while found.is_none() && high < longest {
        (low, high) = (high, (2.0 * high).min(longest));
        found = find(high);
    }
    let (mut found, mut part, mut searches) = (found?, 0.5, SEARCHES);
    loop {
        let between = elementary::sqrt(low * found.0);
        if FINE * part < 1.0 && found.0 > LEAST {
            let factor = part * found.0;
            match if factor > low { sooner(factor, &found) } else { None } {
                Some(nearer) => found = nearer,
                None => part = elementary::sqrt(part),
            }
        } else if searches > 0 && low > 0.0 && WIDE * low < found.0 {
            // What goes another way may arrive sooner than anything beside what was found.
            searches -= 1;
            match find(between) {
                Some(nearer) => (found, part) = (nearer, 0.5),
                None => low = between,
            }
        } else {
            break;
        }
    }
    Some(found)
}

/// Whether two intervals of a clock that is measured are meant to be the same.
fn is_like(interval: f64, other: f64) -> bool {
    (interval - other).abs() <= JITTER * other
}

/// A number that no model treats apart, for state `i` of a trial.
fn trial_state(i: usize, trial: usize) -> f64 {
    ((i * 37 + trial * 101 + 13) % 89) as f64 / 31.0 - 1.2
}

/// Whether h changes with time alone, at some states, and it is not known that it does so within limits. It is looked at at some
/// times in s, and at all at once where it has enclosures.
fn leaves(slot: &BarrierSlot, states: usize) -> bool {
    const TIMES: [f64; 4] = [0.0, 0.7, 31.0, 4e3];
    let Some(model) = slot.source.predict() else { return false };
    (0..4).any(|trial| {
        let x: Vec<f64> = (0..states).map(|i| trial_state(i, trial)).collect();
        let values = TIMES.map(|t| model.value(t, &x));
        let moves = values.iter().any(|h| (h - values[0]).abs() > 1e-9 * (1.0 + values[0].abs()))
            || model.is_still(&x) == Some(false);
        moves && model.lowest_from(0.0, &x).is_none_or(|least| least == f64::NEG_INFINITY)
    })
}

/// Checks that every barrier runs the same plant ahead, at some states: a plan is one of all of them.
fn one_plant(filter: &SafetyFilter, period: f64) -> Result<(), Error> {
    const TRIALS: usize = 4;
    let (nx, nu) = (filter.state_dim, filter.input_dim);
    let moved = |slot: &BarrierSlot, trial: usize| {
        let mut x: Vec<f64> = (0..nx).map(|i| trial_state(i, trial)).collect();
        let u: Vec<f64> = (0..nu).map(|i| filter.bounds.clamp(i, trial_state(i + nx, trial))).collect();
        if let Some(plant) = slot.source.predict() {
            plant.flow(&mut x, &u, period);
        }
        x
    };
    let mut modelled = filter.slots.iter().filter(|slot| slot.source.predict().is_some());
    let Some(first) = modelled.next() else { return Ok(()) };
    for slot in modelled {
        for trial in 0..TRIALS {
            let ends = [moved(first, trial), moved(slot, trial)];
            let same =
                |(a, b): (&f64, &f64)| (a - b).abs() <= 1e-9 * (1.0 + a.abs()) || a.is_nan() && b.is_nan();
            if !ends[0].iter().zip(&ends[1]).all(same) {
                let message = format!(
                    "moves the state in another way than that of {}; a plan needs one plant for all barriers",
                    first.name
                );
                return Err(Error::new(ErrorKind::Unsupported, "source", message).within(&slot.name));
            }
        }
    }
    Ok(())
}
