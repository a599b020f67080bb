//! The input of a sample: u_ref where a plan backs it, else as near to it as one does.

use super::planning::{AMPLE, Planning};
use super::{AssuranceStatus, Driver, Reason};
use crate::MAX_INPUTS;
use crate::filter::rows::Rows;
use crate::plan::{BackupPlan, Failure, Plan, Planner, SearchProgress};
use crate::scalar::all_finite;

/// Largest input of a plan that is comfortable where every set has been reached, as a part of its bounds.
const COMFORTABLE: f64 = 0.5;
/// The part of h that is left by a plan that comes nowhere near the edge of a set: it may be as hard as the bounds allow. Where
/// u_ref had the last input, and where it had not: who is back too soon is soon stopped again.
const FAR: [f64; 2] = [0.1, 0.9];
/// The same before, in units of what the first plan needs: who does nothing is not led later and later, and ever harder. No more
/// than the first plan needs, or this part of the bounds, so that some of them is left for who is led to it smoothly.
const EASE: f64 = 2.0;
const LEISURE: f64 = 0.7;
/// And in units of the largest u_ref so far.
const EAGER: f64 = 1.5;
/// The largest input of another plan for which the one that drives gives way to u_ref, in units of what is comfortable: with more
/// they would soon change places again. Or as large as u_ref has been: who drives hard has not to wait for a gentle one.
const GENTLER: f64 = 0.5;
/// The change of an input from one sample to the next that is no jump, as a part of the width of its bounds.
const SMOOTH: f64 = 0.15;
/// The part of the way to an input that is preferred that is tried first, and halvings of the rest where it is possible.
const FIRST: f64 = 0.125;
const BISECTIONS: u32 = 3;
/// The part of an input that goes back from the plan at each sample: all of it at once would have the plan take it again at the
/// next, and the input jump between the two. And that where another plan backs all of u_ref.
const GIVEN_BACK: f64 = 1.0 / 32.0;
const RETURNED: f64 = 8.0;
/// The samples after which the plan gives back, where it had to take more.
const HELD: u32 = 16;
/// How much more of the plan there is in an input than in the last one, in units of what goes back: the first that is possible.
const SHARES: [f64; 5] = [-1.0, 0.0, 1.0, 4.0, 12.0];
/// The least and the most samples after which it is tried again to find a plan behind u_ref, where none was found or the one that
/// was found was soon lost.
const PAUSES: [u32; 2] = [8, 128];

/// How u_ref has its way, from sample to sample.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct ChoiceMemory {
    /// The largest input of a plan that is comfortable, as a part of its bounds: by what the first one needs, and u_ref has had since.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    ease: f64,
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    eagerness: f64,
    /// The search for a plan behind u_ref, and the samples until it goes on.
    progress: SearchProgress,
    wait: u32,
    /// The samples of the last pause between trials, and those since that u_ref was let pass in a row.
    pause: u32,
    passed: u32,
    /// The samples until a part of the plan is given back again.
    held: u32,
    /// Whether the plan that drives gives way to u_ref, behind all of which another plan was found.
    returns: bool,
    /// Whether u_ref had the last sample, whole or in part.
    wished: bool,
    /// Why it has not its way.
    pub(super) reason: Option<Reason>,
}

impl ChoiceMemory {
    /// The first, beside the first plan.
    pub(super) fn beside(first: &BackupPlan) -> Self {
        Self { ease: (EASE * first.effort).min(first.effort.max(LEISURE)), wished: true, ..Self::default() }
    }

    /// Whether it is none that a filter had.
    pub(super) fn is_flawed(&self) -> bool {
        self.ease.is_nan() || self.eagerness.is_nan() || self.progress.is_flawed()
    }

    /// Notes that a plan was found, and whether another one drove.
    fn find(&mut self, drove: bool) {
        self.progress = SearchProgress::default();
        if drove {
            // The plan gives way in as many samples.
            (self.pause, self.wait) = (self.longer(), (1.0 / (RETURNED * GIVEN_BACK)) as u32);
            self.returns = true;
        }
    }

    /// Notes that the search came to its end and found none.
    fn give_up(&mut self) {
        self.progress = SearchProgress::default();
        self.pause = self.longer();
        self.wait = self.pause;
    }

    fn longer(&self) -> u32 {
        (2 * self.pause).clamp(PAUSES[0], PAUSES[1])
    }

    /// Notes that the plan's own input was the part `share` of the last sample's, and is that of this one's.
    pub(super) fn note(&mut self, share: [f64; 2], driver: Driver) {
        self.wished = matches!(driver, Driver::Reference | Driver::Eased);
        self.pass(share.map(|share| share <= GIVEN_BACK));
    }

    /// Notes who had the last sample, and who has this one.
    fn pass(&mut self, [before, now]: [bool; 2]) {
        self.wait = self.wait.saturating_sub(1);
        self.returns &= !now;
        match [before, now] {
            [true, true] => {
                self.passed = self.passed.saturating_add(1);
                if self.passed > PAUSES[1] {
                    self.pause = 0;
                }
            }
            // Given back too soon: the next time it takes longer.
            [true, false] => (self.wait, self.passed) = (self.wait.max(self.pause), 0),
            _ => self.passed = 0,
        }
    }
}

/// How an input moves with its sample, as long as the piece of the filter is the same: with `rows` times the answer of the rows
/// and `wish` times u_ref. The rest, that of a plan, is held, and so is each input that is `held`.
#[derive(Clone, Copy)]
pub(super) struct Piece {
    pub(super) rows: f64,
    pub(super) wish: f64,
    pub(super) held: [bool; MAX_INPUTS],
}

impl Piece {
    pub(super) const WISH: Self = Self::mixed(0.0, 1.0);
    pub(super) const ROWS: Self = Self::mixed(1.0, 0.0);
    pub(super) const PLAN: Self = Self::mixed(0.0, 0.0);

    const fn mixed(rows: f64, wish: f64) -> Self {
        Self { rows, wish, held: [false; MAX_INPUTS] }
    }
}

/// An input that was chosen, and what is behind it.
pub(super) struct Chosen {
    pub(super) driver: Driver,
    pub(super) piece: Piece,
    /// The part of it that is the plan's own.
    pub(super) share: f64,
    pub(super) backup_plan: BackupPlan,
    /// A new plan, whose backup plan that is.
    pub(super) plan: Option<Plan>,
}

/// What is wished at a sample.
#[derive(Clone, Copy)]
pub(super) struct Wish<'a> {
    /// u_ref, and that within its bounds.
    pub(super) wish: &'a [f64],
    pub(super) wanted: &'a [f64],
    /// The answer of the rows.
    pub(super) rows: &'a [f64],
    /// Whether every set has been reached.
    pub(super) reached: bool,
}

/// The candidates for the input of a sample, and what they are judged by.
struct Choice<'a, 'p> {
    planning: &'a Planning<'a>,
    planner: &'a Planner<'p>,
    t: f64,
    x: &'a [f64],
    wish: Wish<'a>,
    /// The current plan, and the part of the last input that was its own.
    plan: &'a Plan,
    share: f64,
    /// Whether u_ref is a number; whether the plan has no part in the input, so that u_ref passes where it may.
    is_wish: bool,
    passes: bool,
    /// The largest input of a plan that is comfortable, as a part of its bounds.
    comfort: f64,
    /// Whether u_ref had the last sample.
    wished: bool,
}

impl Planning<'_> {
    /// The input from `x` at `t`, the first of these that has a plan behind it: u_ref, with a comfortable plan; where every set has
    /// been reached the answer of the rows; else as far towards u_ref or the rows from the plan's own input as one goes.
    ///
    /// # Errors
    ///
    /// What the plan fails at, where it keeps the promises no more.
    pub(super) fn chosen(
        &self,
        planner: &Planner<'_>,
        (t, x): (f64, &[f64]),
        wish: Wish<'_>,
        memory: &mut ChoiceMemory,
    ) -> Result<Chosen, Failure> {
        let share = self.before().share;
        let (is_wish, passes) = (all_finite(wish.wish), share <= GIVEN_BACK);
        if is_wish && passes {
            memory.eagerness = memory.eagerness.max(self.bounds.part(wish.wanted));
        }
        let comfort = if wish.reached { COMFORTABLE } else { memory.ease.max(EAGER * memory.eagerness) };
        let (planning, plan, wished) = (self, &self.now().plan, memory.wished);
        let choice = Choice { planning, planner, t, x, wish, plan, share, is_wish, passes, comfort, wished };
        if let Some(chosen) = choice.u_ref(memory).or_else(|| choice.rows()) {
            return Ok(chosen);
        }
        match planner.tail(plan, t, x) {
            Ok(kept) => Ok(choice.from_plan(kept, memory)),
            // The plant is not where the plan was: whatever else there is keeps the promise.
            Err(failure) => choice.any_other().ok_or(failure),
        }
    }

    /// `chosen` as it is, or where its input jumps from the last one, one on the way between the two that has a plan behind it.
    pub(super) fn smoothed(
        &self,
        planner: &Planner<'_>,
        (t, x): (f64, &[f64]),
        chosen: Chosen,
        reached: bool,
    ) -> Chosen {
        let Chosen { driver, mut piece, ref backup_plan, .. } = chosen;
        let (mut u, last, inputs) = (backup_plan.inputs[0].1, &self.rows.state.input, self.rows.input_dim);
        for (i, (u, last)) in u.iter_mut().zip(last).enumerate().take(inputs) {
            let most = SMOOTH * (self.bounds.max[i] - self.bounds.min[i]);
            let smooth = u.max(last - most).min(last + most);
            (piece.held[i], *u) = (smooth != *u, smooth);
        }
        let is_smooth = !piece.held.contains(&true);
        // u_ref jumps where it wishes to, but not to it from another.
        let goes_on = driver == Driver::Reference && self.before().memory.wished;
        if goes_on || self.before().status != AssuranceStatus::Assured || is_smooth {
            return chosen;
        }
        let smooth = &u[..inputs];
        let plan = chosen.plan.as_ref().unwrap_or(&self.now().plan);
        let driver = Driver::Between;
        if let Ok(backup_plan) = planner.behind(plan, t, x, smooth) {
            return Chosen { driver, piece, backup_plan, ..chosen };
        }
        let renewed = || planner.renewed(plan, t, x, smooth, &mut SearchProgress::default()).ok();
        // Where u_ref has just passed, one behind it is sought first.
        let may_renew = !reached && self.before().share > GIVEN_BACK;
        match may_renew.then(renewed).flatten() {
            Some(plan) => {
                Chosen { driver, piece, backup_plan: plan.backup_plan.clone(), plan: Some(plan), ..chosen }
            }
            None => chosen,
        }
    }
}

impl Choice<'_, '_> {
    fn behind(&self, plan: &Plan, u: &[f64]) -> Option<BackupPlan> {
        self.planner.behind(plan, self.t, self.x, u).ok()
    }

    /// Who chose u_ref within its bounds.
    fn passed(&self) -> Driver {
        if self.wish.wanted == self.wish.wish { Driver::Reference } else { Driver::Eased }
    }

    /// Whether a plan is comfortable. Where every set has been reached: with the margin that the rows aim at and gently, as long as
    /// u_ref has its way; where the rows took over they let it pass, or it is far from every edge.
    fn is_comfortable(&self, backup_plan: &BackupPlan) -> bool {
        let is_gentle = backup_plan.effort <= self.comfort;
        let Some(at) = backup_plan.tightest.filter(|_| self.wish.reached) else {
            return is_gentle || self.wish.reached;
        };
        let Rows { slots, workspace, .. } = self.planning.rows;
        let kept = self.planning.now().promises[at.barrier].map_or(0.0, |promise| promise.margin);
        let margin = slots[at.barrier].promise.settings().margin.max((AMPLE - 1.0) * kept);
        let h = workspace.report.barriers[at.barrier].h;
        let least = match (self.wished, is_gentle) {
            (true, true) => 0.0,
            (true, false) => FAR[0] * h,
            (false, _) => FAR[1] * h,
        };
        at.slack >= least.max(margin)
    }

    /// u_ref as it is or within its bounds, with a comfortable plan behind it: the current one, that moved in time, or
    /// another. Notes why not.
    fn u_ref(&self, memory: &mut ChoiceMemory) -> Option<Chosen> {
        if !(self.is_wish && self.passes) {
            return None;
        }
        let (planner, plan, wanted) = (self.planner, self.plan, self.wish.wanted);
        let driver = self.passed();
        let chosen = |backup_plan, plan| Chosen { driver, piece: Piece::WISH, share: 0.0, backup_plan, plan };
        let near = planner.behind(plan, self.t, self.x, wanted);
        memory.reason = match &near {
            Ok(backup_plan) => backup_plan.tightest.map(|at| Reason { barrier: at.barrier, time: at.time }),
            Err(Failure::Broken { barrier, time, .. }) => Some(Reason { barrier: *barrier, time: *time }),
            Err(_) => None,
        };
        if let Ok(backup_plan) = near {
            let is_comfortable = self.is_comfortable(&backup_plan);
            memory.reason = memory.reason.filter(|_| !is_comfortable);
            return is_comfortable.then(|| chosen(backup_plan, None));
        }
        if self.wish.reached {
            return None;
        }
        let moved = planner.moved(plan, self.t, self.x, wanted).ok();
        let moved = moved.filter(|plan| self.is_comfortable(&plan.backup_plan));
        let plan = moved.or_else(|| self.continue_search(wanted, memory, self.comfort))?;
        Some(chosen(plan.backup_plan.clone(), Some(plan)))
    }

    /// The answer of the rows where every set has been reached, or as near to u_ref from it as is comfortable, so that the input does not
    /// jump between the two.
    fn rows(&self) -> Option<Chosen> {
        if !(self.wish.reached && self.passes) {
            return None;
        }
        let Wish { wish, wanted, rows, .. } = self.wish;
        let backup_plan = self.behind(self.plan, rows)?;
        let chosen = |driver, wish, backup_plan| Chosen {
            driver,
            piece: Piece::mixed(1.0 - wish, wish),
            share: 0.0,
            backup_plan,
            plan: None,
        };
        if !self.is_wish || wanted != wish || !self.is_comfortable(&backup_plan) || rows == wish {
            return Some(chosen(Driver::Rows, 0.0, backup_plan));
        }
        let comfortable =
            |u: &[f64]| self.behind(self.plan, u).filter(|backup_plan| self.is_comfortable(backup_plan));
        let (wish, backup_plan) = towards(rows, wish, backup_plan, comfortable);
        Some(chosen(if wish > 0.0 { Driver::Eased } else { Driver::Rows }, wish, backup_plan))
    }

    /// u_ref or the answer of the rows with any plan behind it.
    fn any_other(&self) -> Option<Chosen> {
        let wished = self.is_wish.then_some((self.passed(), Piece::WISH, self.wish.wanted));
        let mut others = wished.into_iter().chain([(Driver::Rows, Piece::ROWS, self.wish.rows)]);
        let (driver, piece, backup_plan) =
            others.find_map(|(driver, piece, u)| Some((driver, piece, self.behind(self.plan, u)?)))?;
        Some(Chosen { driver, piece, share: 0.0, backup_plan, plan: None })
    }

    /// From the plan's own input, that of `kept`, towards u_ref or the rows: as near as can be at first, then as near as last, or a little
    /// more or less.
    fn from_plan(&self, kept: BackupPlan, memory: &mut ChoiceMemory) -> Chosen {
        let to_rows = self.wish.reached || !self.is_wish;
        let (own, far) = (kept.inputs[0].1, if to_rows { self.wish.rows } else { self.wish.wanted });
        let mixed = |share: f64, backup_plan, plan| {
            let part = 1.0 - share;
            let piece = if to_rows { Piece::mixed(part, 0.0) } else { Piece::mixed(0.0, part) };
            let driver = match share {
                0.0 if to_rows => Driver::Rows,
                0.0 => self.passed(),
                1.0 => Driver::Plan,
                _ => Driver::Between,
            };
            Chosen { driver, piece, share, backup_plan, plan }
        };
        let most = kept.effort.max(self.comfort);
        let gentle = |backup_plan: &BackupPlan| backup_plan.effort <= most;
        if self.passes {
            let behind = |u: &[f64]| self.behind(self.plan, u).filter(gentle);
            let (part, backup_plan) = towards(&own[..far.len()], far, kept, behind);
            return mixed(1.0 - part, backup_plan, None);
        }
        let between = |share: f64| -> [f64; MAX_INPUTS] {
            // All of it is itself, to the last bit.
            let part =
                |i: usize| if share == 0.0 { far[i] } else { own[i] + (1.0 - share) * (far[i] - own[i]) };
            core::array::from_fn(|i| if i < far.len() { part(i) } else { 0.0 })
        };
        let returned = (self.share - RETURNED * GIVEN_BACK).max(0.0);
        let gentler = (GENTLER * self.comfort).max(memory.eagerness);
        if !to_rows && let Some(other) = self.continue_search(self.wish.wanted, memory, gentler) {
            // At once where the two plans lead apart.
            let gently = self.behind(&other, &between(returned)[..far.len()]);
            let (share, backup_plan) = gently
                .map_or_else(|| (0.0, other.backup_plan.clone()), |backup_plan| (returned, backup_plan));
            return mixed(share, backup_plan, Some(other));
        }
        let shares =
            SHARES.map(|more| self.share + more * GIVEN_BACK).into_iter().filter(|share| *share < 1.0);
        let first = memory.returns.then_some(returned);
        // On the way to a deadline the plan gives back to another one alone: u_ref leads off it.
        let shares = shares.skip(usize::from(!to_rows || memory.held > 0));
        let found = first.into_iter().chain(shares).find_map(|share| {
            let backup_plan = self.behind(self.plan, &between(share)[..far.len()]).filter(gentle)?;
            Some((share, backup_plan))
        });
        let (share, backup_plan) = found.unwrap_or((1.0, kept));
        memory.held = if share > self.share { HELD } else { memory.held.saturating_sub(1) };
        if first.is_some_and(|first| share > first) {
            (memory.returns, memory.wait) = (false, memory.wait.max(memory.pause));
        }
        mixed(share, backup_plan, None)
    }

    /// A plan behind `u` that needs no more than `comfort` where one is sought at this sample, and is found.
    fn continue_search(&self, u: &[f64], memory: &mut ChoiceMemory, comfort: f64) -> Option<Plan> {
        if memory.wait > 0 {
            return None;
        }
        match self.planner.renewed(self.plan, self.t, self.x, u, &mut memory.progress) {
            Ok(plan) if plan.backup_plan.effort <= comfort => {
                memory.find(self.share > GIVEN_BACK);
                Some(plan)
            }
            Ok(_) | Err(false) => {
                memory.give_up();
                None
            }
            Err(true) => None,
        }
    }
}

/// The part of the way `from` one input `to` another at the end of which there is the last one, of those tried, with a
/// backup plan, and that; 0 for `from`, whose backup plan is `kept`.
fn towards(
    from: &[f64],
    to: &[f64],
    mut kept: BackupPlan,
    behind: impl Fn(&[f64]) -> Option<BackupPlan>,
) -> (f64, BackupPlan) {
    let (mut low, mut high, mut part, mut input) = (0.0, 1.0, FIRST, [0.0; MAX_INPUTS]);
    for _ in 0..=BISECTIONS {
        for (input, (from, to)) in input.iter_mut().zip(from.iter().zip(to)) {
            *input = from + part * (to - from);
        }
        match behind(&input[..from.len()]) {
            Some(backup_plan) => (low, kept) = (part, backup_plan),
            None if low == 0.0 => break,
            None => high = part,
        }
        part = 0.5 * (low + high);
    }
    (low, kept)
}
