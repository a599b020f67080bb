//! A robust plan as a table, and its follower: what keeps the promises of a plan where nothing can be searched.
//!
//! A [`PlanTable`] is made on a PC for a set of states at its beginning. It has a reference z, inputs v, gains K, the radii of
//! the tube, and the freedom d of each input. In hold k, from t_k on, the follower applies
//!
//! ```math
//! u = \min(\max(u_{\text{ref}}, p_k - d), p_k + d), \qquad p_k = v_k + K_k (\hat x(t_k) - z_k),
//! ```
//!
//! within the bounds. The tube was checked for every such u at every time of the hold, so that u_ref may do as it likes within
//! d. At the beginning of each hold the follower looks whether the state is where the tube says that it can be. If it is not,
//! the plant is not what was declared, and the guarantee is lost.
//!
//! Neither reading a table nor a step allocates, searches or solves anything. Source: `docs/theory.md#robust-plan`.

use crate::MAX_INPUTS;
use crate::error::{Error, ErrorKind, length};

/// Numbers before the holds: states, inputs, holds, slack, end and origin; then of each input its freedom, least and most.
const HEAD: usize = 6;
/// Bytes of a number.
const BYTES: usize = 8;

/// A plan for a set of states as a table of numbers, which stays where it is: in flash, for example.
///
/// `punctual_core::filter::Planning::table` makes the bytes (feature `plan`). Times count from the first step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanTable<'a> {
    numbers: &'a [u8],
    states: usize,
    inputs: usize,
    holds: usize,
}

impl<'a> PlanTable<'a> {
    /// The table in `bytes`, without copying it.
    ///
    /// # Errors
    ///
    /// Bytes that are no such table; more inputs than there is room for.
    pub fn read(bytes: &'a [u8]) -> Result<Self, Error> {
        let refused = |message: &'static str| Error::new(ErrorKind::Range, "plan", message);
        let damaged = || refused("is no plan, or is damaged, must be what `Planning::table` returned");
        let mut table = Self { numbers: bytes, states: 0, inputs: 0, holds: 0 };
        if bytes.len() < HEAD * BYTES || !bytes.len().is_multiple_of(BYTES) {
            return Err(damaged());
        }
        let count = |k: usize| {
            let number = table.number(k);
            let whole = number as u32;
            (whole >= 1 && f64::from(whole) == number).then_some(whole as usize)
        };
        let (Some(states), Some(inputs), Some(holds)) = (count(0), count(1), count(2)) else {
            return Err(damaged());
        };
        if inputs > MAX_INPUTS {
            return Err(refused("has more inputs than there is room for, must have fewer"));
        }
        (table.states, table.inputs, table.holds) = (states, inputs, holds);
        let numbers = table.row().and_then(|row| row.checked_mul(holds)?.checked_add(table.head() + 1));
        if numbers != Some(bytes.len() / BYTES) || !table.is_sound() {
            return Err(damaged());
        }
        Ok(table)
    }

    /// Whether every number is finite, and each within its range.
    fn is_sound(&self) -> bool {
        let all_finite = (0..self.numbers.len() / BYTES).all(|k| {
            // Bounds may be infinite, and so is an origin that does not matter.
            let is_bound = k == HEAD - 1 || k >= HEAD + self.inputs && k < self.head();
            let number = self.number(k);
            number.is_finite() || is_bound && !number.is_nan()
        });
        let inputs = (0..self.inputs).all(|i| {
            let [min, max] = self.bounds(i);
            self.freedom(i) >= 0.0 && min <= max
        });
        let holds = (0..self.holds)
            .all(|k| self.begin(k) < self.begin(k + 1) && (0..self.states).all(|i| self.radius(k, i) >= 0.0));
        all_finite && inputs && holds && self.slack() >= 0.0
    }

    fn number(&self, k: usize) -> f64 {
        let bytes = self.numbers.get(k * BYTES..).and_then(|rest| rest.first_chunk::<BYTES>());
        bytes.map_or(f64::NAN, |bytes| f64::from_le_bytes(*bytes))
    }

    fn head(&self) -> usize {
        HEAD + 3 * self.inputs
    }

    /// The numbers of a hold: its beginning, v, z, K and the radii.
    fn row(&self) -> Option<usize> {
        let gains = self.states.checked_mul(self.inputs)?;
        gains.checked_add(self.states.checked_mul(2)?)?.checked_add(self.inputs)?.checked_add(1)
    }

    /// Number `i` of hold `k`.
    fn of_hold(&self, k: usize, i: usize) -> f64 {
        self.number(self.head() + k * (1 + self.inputs + 2 * self.states + self.states * self.inputs) + i)
    }

    /// Number of states.
    pub fn states(&self) -> usize {
        self.states
    }

    /// Number of inputs.
    pub fn inputs(&self) -> usize {
        self.inputs
    }

    /// Number of holds.
    pub fn holds(&self) -> usize {
        self.holds
    }

    /// The time in s from the first step until which the promises are kept.
    pub fn until(&self) -> f64 {
        self.number(4)
    }

    /// The time in s at which the first step has to come, where a set moves with time; `None` if it may come at any time.
    pub fn origin(&self) -> Option<f64> {
        Some(self.number(5)).filter(|origin| origin.is_finite())
    }

    /// By how much input `i` may differ from the law, in its unit.
    pub fn freedom(&self, i: usize) -> f64 {
        self.number(HEAD + i)
    }

    /// How far state `i`, as it is measured, may be from the reference when hold `k` begins; for 0, the starts for which the plan
    /// was made.
    pub fn radius(&self, k: usize, i: usize) -> f64 {
        self.of_hold(k, 1 + self.inputs + self.states + self.states * self.inputs + i)
    }

    /// State `i` of the reference when hold `k` begins.
    pub fn state(&self, k: usize, i: usize) -> f64 {
        self.of_hold(k, 1 + self.inputs + i)
    }

    /// When hold `k` begins, in s from the first step; for the number of holds, the end of the last.
    pub fn begin(&self, k: usize) -> f64 {
        self.of_hold(k, 0)
    }

    /// By how much in s a step may miss the beginning of a hold.
    fn slack(&self) -> f64 {
        self.number(3)
    }

    fn bounds(&self, i: usize) -> [f64; 2] {
        [self.number(HEAD + self.inputs + i), self.number(HEAD + 2 * self.inputs + i)]
    }

    /// Input `i` of the law in hold `k` for the measured state `x` when it begins.
    fn law(&self, k: usize, i: usize, x: &[f64]) -> f64 {
        let gain = 1 + self.inputs + self.states + i * self.states;
        let feedback = x.iter().enumerate().map(|(j, x)| self.of_hold(k, gain + j) * (x - self.state(k, j)));
        let [min, max] = self.bounds(i);
        (self.of_hold(k, 1 + i) + feedback.sum::<f64>()).max(min).min(max)
    }

    /// The state that is farther from the reference when hold `k` begins than is possible, if there is one.
    fn escaped(&self, k: usize, x: &[f64]) -> Option<usize> {
        // NaN has escaped.
        let is_near = |(i, x): &(usize, &f64)| {
            let x: f64 = **x;
            (x - self.state(k, *i)).abs() <= self.radius(k, *i) + ROUND_OFF * (1.0 + x.abs())
        };
        x.iter().enumerate().find(|at| !is_near(at)).map(|(i, _)| i)
    }

    /// Writes a table.
    #[cfg(feature = "plan")]
    pub(crate) fn write(
        tracking: &crate::plan::Tracking,
        [until, slack, origin]: [f64; 3],
        [start, freedom]: [&[f64]; 2],
        [min, max]: [&[f64]; 2],
    ) -> alloc::vec::Vec<u8> {
        let ([states, inputs], times) = ([tracking.states()[0].len(), freedom.len()], tracking.times());
        let begin = times[0];
        let head =
            [states as f64, inputs as f64, tracking.inputs().len() as f64, slack, until - begin, origin];
        let mut numbers: alloc::vec::Vec<f64> = head.into();
        numbers.extend(freedom.iter().chain(min).chain(max));
        for (k, v) in tracking.inputs().iter().enumerate() {
            numbers.push(times[k] - begin);
            numbers.extend(v.iter().chain(&tracking.states()[k]));
            // A hold without feedback.
            let gain = &tracking.gains()[k];
            numbers.extend((0..states * inputs).map(|i| gain.get(i).copied().unwrap_or(0.0)));
            // Who is measured within the starts is where the tube begins, beside the error; any farther, and it is not known.
            numbers.extend(if k == 0 { start } else { &tracking.radii()[k] });
        }
        numbers.push(times[times.len() - 1] - begin);
        numbers.iter().flat_map(|number| number.to_le_bytes()).collect()
    }
}

/// Round-off of a measured state and of the reference, as a part of the state's size.
const ROUND_OFF: f64 = 1e-9;

/// What a [`Follower`] remembers between steps.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct FollowerState {
    /// The time of the first step in s.
    pub start: Option<f64>,
    /// The hold of the last step.
    pub hold: u32,
    /// The input of the law in that hold.
    pub law: [f64; MAX_INPUTS],
    /// How it is.
    pub following: Following,
}

/// Whether the guarantee of a [`PlanTable`] stands.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[repr(u8)]
#[non_exhaustive]
pub enum Following {
    /// There was no step yet.
    #[default]
    NotBegun = 0,
    /// Every promise is kept until the end of the plan.
    Kept = 1,
    /// The plan has ended.
    Ended = 2,
    /// The first state is outside the set for which the plan was made.
    OutOfStart = 3,
    /// A later state is where the declared plant cannot be.
    OutOfTube = 4,
    /// No step came when a hold began, or the first one did not come when a plan beside moving sets does.
    Late = 5,
}

impl Following {
    /// All of them, in the order of their numbers.
    pub const ALL: [Self; 6] =
        [Self::NotBegun, Self::Kept, Self::Ended, Self::OutOfStart, Self::OutOfTube, Self::Late];

    /// Its name.
    pub fn name(self) -> &'static str {
        self.words().0
    }

    /// What it means, in brief.
    pub fn meaning(self) -> &'static str {
        self.words().1
    }

    fn words(self) -> (&'static str, &'static str) {
        match self {
            Self::NotBegun => ("not_begun", "no step was taken, or there is no plan"),
            Self::Kept => ("kept", "the plan decides: its promises are kept, whatever u_ref comes"),
            Self::Ended => ("ended", "the plan has ended: the rows decide"),
            Self::OutOfStart => {
                ("out_of_start", "the first state is outside the starts of the plan: the rows decide")
            }
            Self::OutOfTube => {
                ("out_of_tube", "the state is where the declared plant cannot be: the rows decide")
            }
            Self::Late => ("late", "no step came when a hold of the plan began: the rows decide"),
        }
    }
}

/// Follows a [`PlanTable`]. One step takes some hundred operations.
#[derive(Clone, Debug, PartialEq)]
pub struct Follower<'a> {
    table: PlanTable<'a>,
    state: FollowerState,
}

impl<'a> Follower<'a> {
    /// The follower of `table`. The plan begins with its first step.
    pub fn new(table: PlanTable<'a>) -> Self {
        Self { table, state: FollowerState::default() }
    }

    /// The table.
    pub fn table(&self) -> &PlanTable<'a> {
        &self.table
    }

    /// What it remembers.
    pub fn state(&self) -> &FollowerState {
        &self.state
    }

    /// Continues from what it [remembered](Self::state); `false`, and nothing is done, if that is of no follower of this table.
    pub fn restore(&mut self, state: FollowerState) -> bool {
        let is_own = (state.hold as usize) < self.table.holds
            && state.law.iter().all(|u| u.is_finite())
            && state.start.is_none_or(f64::is_finite);
        if is_own {
            self.state = state;
        }
        is_own
    }

    /// Forgets what was: the plan begins again with the next step.
    pub fn rearm(&mut self) {
        self.state = FollowerState::default();
    }

    /// The time in s until which the promises are kept, if they are.
    pub fn until(&self) -> Option<f64> {
        let start = self.state.start.filter(|_| self.state.following == Following::Kept)?;
        Some(start + self.table.until())
    }

    /// Writes to `u` the input nearest to `u_ref` that the plan allows at time `t` (s) and the measured state `x`, as long as the
    /// result is [`Following::Kept`]; otherwise `u` stays as it is. A guarantee that was lost stays lost until
    /// [`Self::rearm`]. A `u_ref` that is no number is that of the law.
    ///
    /// # Errors
    ///
    /// A slice of the wrong length.
    pub fn step(&mut self, t: f64, x: &[f64], u_ref: &[f64], u: &mut [f64]) -> Result<Following, Error> {
        let table = self.table;
        length("x", x.len(), table.states)?;
        length("u_ref", u_ref.len(), table.inputs)?;
        length("u", u.len(), table.inputs)?;
        self.state.following = self.follow(t, x);
        if self.state.following == Following::Kept {
            for (i, u) in u.iter_mut().enumerate() {
                let (law, freedom, [min, max]) = (self.state.law[i], table.freedom(i), table.bounds(i));
                let wanted = if u_ref[i].is_nan() { law } else { u_ref[i] };
                *u = wanted.max((law - freedom).max(min)).min((law + freedom).min(max));
            }
        }
        Ok(self.state.following)
    }

    /// Comes to the hold at `t`, and computes its law.
    fn follow(&mut self, t: f64, x: &[f64]) -> Following {
        let (table, before) = (self.table, self.state.following);
        if !matches!(before, Following::NotBegun | Following::Kept) {
            return before;
        }
        if !t.is_finite() {
            return Following::Late;
        }
        let is_first = before == Following::NotBegun;
        if is_first && table.origin().is_some_and(|origin| (t - origin).abs() > table.slack()) {
            return Following::Late;
        }
        let since = t - *self.state.start.get_or_insert(t);
        let slack = table.slack();
        if since > table.until() - slack {
            return Following::Ended;
        }
        let mut hold = self.state.hold as usize;
        let next = table.begin(hold + 1);
        if !is_first {
            if since < next - slack {
                return before;
            }
            hold += 1;
        }
        // A hold is as long as the plan says: no step of the law is left out, and none is late.
        if hold >= table.holds || since - table.begin(hold) > slack {
            return Following::Late;
        }
        if table.escaped(hold, x).is_some() {
            return if is_first { Following::OutOfStart } else { Following::OutOfTube };
        }
        self.state.hold = hold as u32;
        for (i, law) in self.state.law.iter_mut().enumerate().take(table.inputs) {
            *law = table.law(hold, i, x);
        }
        Following::Kept
    }
}
