//! The input of a sample: u_ref if a plan backs it, otherwise the nearest input to it that a plan backs.
//!
//! The numbers here say which of these inputs is preferred. No guarantee depends on them, since a plan is behind each.

use super::planning::Planning;
use super::settings::DECISIONS;
use super::{AssuranceStatus, Driver, Reason};
use crate::MAX_INPUTS;
use crate::filter::rows::Rows;
use crate::plan::{BackupPlan, Failure, Plan, Planner, SearchProgress};
use crate::scalar::all_finite;

/// Largest input of a comfortable plan once every set has been reached, as a part of its bounds.
const COMFORTABLE: f64 = 0.5;
/// A plan counts as far from the edge of a set if it leaves this part of h; it may then use the bounds fully. The first is
/// used if u_ref had the last input, the second if not: u_ref that returns too soon is soon stopped again.
const FAR: [f64; 2] = [0.1, 0.9];
/// Largest input of a comfortable plan before every set has been reached, in units of the largest input of the first plan.
/// The limit prevents a passive u_ref from being led later and later, and with ever larger inputs.
const EASE: f64 = 2.0;
/// The largest value of that limit, as a part of the bounds, unless the first plan needs more: some of the bounds is left
/// for a smooth transition.
const LEISURE: f64 = 0.7;
/// The same limit in units of the largest u_ref so far.
const EAGER: f64 = 1.5;
/// Largest input of another plan for which the driving plan yields to u_ref, in units of what is comfortable: with a larger
/// one they would soon change places again. An input as large as u_ref has been is also allowed, so that an aggressive u_ref
/// need not wait for a gentle plan.
const GENTLER: f64 = 0.5;
/// The largest change of an input between samples that does not count as a jump, as a part of the width of its bounds.
const SMOOTH: f64 = 0.15;
/// The first part tried of the way to a preferred input.
const FIRST: f64 = 0.125;
/// Halvings of the remaining interval if that part is possible.
const BISECTIONS: u32 = 3;
/// The part of an input that the plan gives back at each sample. If it gave back all of it at once, the plan would take it
/// again at the next sample, and the input would jump between the two.
const GIVEN_BACK: f64 = 1.0 / 32.0;
/// The same in units of [`GIVEN_BACK`] if another plan backs all of u_ref.
const RETURNED: f64 = 8.0;
/// Number of samples after which the plan gives back again, if it had to take more.
const HELD: u32 = 16;
/// Candidate changes of the plan's share from the last input, in units of [`GIVEN_BACK`]. The first possible one is taken.
const SHARES: [f64; 5] = [-1.0, 0.0, 1.0, 4.0, 12.0];
/// The least and the most samples before another search for a plan behind u_ref, if none was found or the one found was soon
/// lost.
const PAUSES: [u32; 2] = [8, 128];

/// How much of u_ref passes, from sample to sample.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct ChoiceMemory {
    /// The largest input of a comfortable plan, as a part of its bounds: from the largest input of the first plan, and from
    /// the largest u_ref since then.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    ease: f64,
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    eagerness: f64,
    /// The search for a plan behind u_ref, and the number of samples until it continues.
    progress: SearchProgress,
    wait: u32,
    /// The number of samples of the last pause between trials, and the number of samples in a row since then that let u_ref
    /// pass.
    pause: u32,
    passed: u32,
    /// The number of samples until the plan gives back a part again.
    held: u32,
    /// Whether the driving plan yields to u_ref, because another plan was found behind all of it.
    returns: bool,
    /// Whether u_ref determined the last input, wholly or in part.
    wished: bool,
    /// Why u_ref does not pass.
    pub(super) reason: Option<Reason>,
}

impl ChoiceMemory {
    /// The initial memory, for the first plan.
    pub(super) fn beside(first: &BackupPlan) -> Self {
        Self { ease: (EASE * first.effort).min(first.effort.max(LEISURE)), wished: true, ..Self::default() }
    }

    /// Whether no filter could have had it.
    pub(super) fn is_flawed(&self) -> bool {
        self.ease.is_nan() || self.eagerness.is_nan() || self.progress.is_flawed()
    }

    /// Records that a plan was found, and whether another one drove.
    fn find(&mut self, drove: bool) {
        self.progress = SearchProgress::default();
        if drove {
            // The plan yields over as many samples.
            (self.pause, self.wait) = (self.longer(), (1.0 / (RETURNED * GIVEN_BACK)) as u32);
            self.returns = true;
        }
    }

    /// Records that the search ended without a plan.
    fn give_up(&mut self) {
        self.progress = SearchProgress::default();
        self.pause = self.longer();
        self.wait = self.pause;
    }

    fn longer(&self) -> u32 {
        (2 * self.pause).clamp(PAUSES[0], PAUSES[1])
    }

    /// Records the plan's share of the last input and of this one.
    pub(super) fn note(&mut self, share: [f64; 2], driver: Driver) {
        self.wished = matches!(driver, Driver::Reference | Driver::Eased);
        self.pass(share.map(|share| share <= GIVEN_BACK));
    }

    /// Records whether u_ref passed at the last sample, and whether it passes at this one.
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
            // Given back too soon: the next attempt waits longer.
            [true, false] => (self.wait, self.passed) = (self.wait.max(self.pause), 0),
            _ => self.passed = 0,
        }
    }
}

/// How an input varies with its sample, as long as the filter stays on the same piece: it contains `rows` times the answer
/// of the rows and `wish` times u_ref. The remainder, which is the plan's, is held constant, and so is each input that is
/// `held`.
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

/// A chosen input, and the plan behind it.
pub(super) struct Chosen {
    pub(super) driver: Driver,
    pub(super) piece: Piece,
    /// The plan's own share of it.
    pub(super) share: f64,
    pub(super) backup_plan: BackupPlan,
    /// A new plan, to which that backup plan belongs.
    pub(super) plan: Option<Plan>,
}

/// The inputs asked for at a sample.
#[derive(Clone, Copy)]
pub(super) struct Wish<'a> {
    /// u_ref, and u_ref within its bounds.
    pub(super) wish: &'a [f64],
    pub(super) wanted: &'a [f64],
    /// The answer of the rows.
    pub(super) rows: &'a [f64],
    /// Whether every set has been reached.
    pub(super) reached: bool,
}

/// The candidates for the input of a sample, and the criteria for choosing among them.
struct Choice<'a, 'p> {
    planning: &'a Planning<'a>,
    planner: &'a Planner<'p>,
    t: f64,
    x: &'a [f64],
    wish: Wish<'a>,
    /// The current plan, and its own share of the last input.
    plan: &'a Plan,
    share: f64,
    /// Whether u_ref is a number; whether the plan has hardly any share of the last input, so that u_ref passes where it
    /// may.
    is_wish: bool,
    passes: bool,
    /// The largest input of a comfortable plan, as a part of its bounds.
    comfort: f64,
    /// Whether u_ref determined the last input.
    wished: bool,
}

impl Planning<'_> {
    /// The input from `x` at `t`: the first of these that has a plan behind it. First u_ref, with a comfortable plan; then,
    /// once every set has been reached, the answer of the rows; then the plan's own input, moved towards u_ref or the rows
    /// as far as a plan allows.
    ///
    /// # Errors
    ///
    /// Why the plan fails, if it no longer keeps the promises.
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
            Ok(kept) => Ok(choice.beside_plan(planner.prolonged(plan, kept, t, x), memory)),
            // The plant is off the plan: anything else that keeps the promise is used.
            Err(failure) => choice.any_other().ok_or(failure),
        }
    }

    /// `chosen` as it is; or, if its input jumps from the last one, an input on the way between the two that has a plan
    /// behind it.
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
        // u_ref may jump by itself, but the input must not jump to it from another.
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
        // If u_ref has only just passed, a plan behind the smoothed input is sought first.
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

    /// The driver for u_ref within its bounds.
    fn passed(&self) -> Driver {
        if self.wish.wanted == self.wish.wish { Driver::Reference } else { Driver::Eased }
    }

    /// Whether a plan is comfortable. Once every set has been reached it has to keep the margin that the rows aim at. While
    /// u_ref drives it also has to be gentle or far from every edge; after the rows took over, it has to be far from every
    /// edge.
    fn is_comfortable(&self, backup_plan: &BackupPlan) -> bool {
        let is_gentle = backup_plan.effort <= self.comfort;
        let Some(at) = backup_plan.tightest.filter(|_| self.wish.reached) else {
            return is_gentle || self.wish.reached;
        };
        let Rows { slots, workspace, .. } = self.planning.rows;
        let kept = self.planning.now().promises[at.barrier].map_or(0.0, |promise| promise.margin);
        let margin = slots[at.barrier].promise.settings().margin.max((DECISIONS.ample - 1.0) * kept);
        let h = workspace.report.barriers[at.barrier].h;
        let least = match (self.wished, is_gentle) {
            (true, true) => 0.0,
            (true, false) => FAR[0] * h,
            (false, _) => FAR[1] * h,
        };
        at.slack >= least.max(margin)
    }

    /// u_ref as it is or within its bounds, with a comfortable plan behind it: the current one, the current one moved in
    /// time, or another. Otherwise records why not.
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

    /// The answer of the rows once every set has been reached, moved as near to u_ref as is comfortable, so that the input
    /// does not jump between the two.
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

    /// u_ref or the answer of the rows, with any plan behind it.
    fn any_other(&self) -> Option<Chosen> {
        let wished = self.is_wish.then_some((self.passed(), Piece::WISH, self.wish.wanted));
        let mut others = wished.into_iter().chain([(Driver::Rows, Piece::ROWS, self.wish.rows)]);
        let (driver, piece, backup_plan) =
            others.find_map(|(driver, piece, u)| Some((driver, piece, self.behind(self.plan, u)?)))?;
        Some(Chosen { driver, piece, share: 0.0, backup_plan, plan: None })
    }

    /// From the plan's own input, that of `kept`, towards u_ref or the rows: at first as near to these as possible, then
    /// about as near as at the last sample.
    fn beside_plan(&self, kept: BackupPlan, memory: &mut ChoiceMemory) -> Chosen {
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
            // All of it is `far` itself, to the last bit.
            let part =
                |i: usize| if share == 0.0 { far[i] } else { own[i] + (1.0 - share) * (far[i] - own[i]) };
            core::array::from_fn(|i| if i < far.len() { part(i) } else { 0.0 })
        };
        let returned = (self.share - RETURNED * GIVEN_BACK).max(0.0);
        let gentler = (GENTLER * self.comfort).max(memory.eagerness);
        if !to_rows && let Some(other) = self.continue_search(self.wish.wanted, memory, gentler) {
            // At once if the two plans lead apart.
            let gently = self.behind(&other, &between(returned)[..far.len()]);
            let (share, backup_plan) = gently
                .map_or_else(|| (0.0, other.backup_plan.clone()), |backup_plan| (returned, backup_plan));
            return mixed(share, backup_plan, Some(other));
        }
        let shares =
            SHARES.map(|more| self.share + more * GIVEN_BACK).into_iter().filter(|share| *share < 1.0);
        let first = memory.returns.then_some(returned);
        // On the way to a deadline the plan gives back only to another plan, since u_ref leads away from it.
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

    /// A plan behind `u` that needs no more than `comfort`, if one is sought at this sample and found.
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

/// Bisects the way `from` one input `to` another. Returns the farthest part tried that has a backup plan, and that plan; 0
/// for `from`, whose backup plan is `kept`.
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
