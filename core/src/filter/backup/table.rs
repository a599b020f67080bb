//! A plan for a set of first states as a table, for where nothing can be searched.

use alloc::format;
use alloc::vec::Vec;

use super::settings::DECISIONS;
use super::{Planning, moves};
use crate::error::{Error, ErrorKind, length, non_negative};
use crate::follower::PlanTable;
use crate::plan::{Failure, TOLERANCES, Uncertainty};

/// The parts of half the width of its bounds that are tried in turn as the freedom of every input.
const PARTS: [f64; 7] = [0.5, 0.35, 0.2, 0.1, 0.05, 0.02, 0.0];

/// A plan as a table, and what it keeps.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct TabledPlan {
    /// The bytes of a [`PlanTable`].
    pub bytes: Vec<u8>,
    /// Which barriers it keeps, in their order.
    pub promised: Vec<bool>,
    /// By how much each input may differ from its law, in its unit.
    pub freedom: Vec<f64>,
}

impl Planning<'_> {
    /// The plan for every first state that is measured within `start` of `x`, each in its unit, as a table for a
    /// [`Follower`](crate::follower::Follower). While it is followed each input may differ from the plan's law by as much as
    /// `freedom` says, in its unit; if `None`, by the largest parts of its bounds for which a plan is found among 50, 35, 20, 10, 5, 2
    /// and 0 % of half their widths: first the same for each, then each in turn. It keeps what a first sample at `t` would promise, for every plant within
    /// what is declared, until the [horizon](super::Plans::horizon) after the last deadline, by default 3 s. Where a set moves with
    /// time, the first step of the follower has to come at `t`. Remembers nothing.
    ///
    /// # Errors
    ///
    /// Outside: a slice of the wrong length, or a number out of range; a plant without derivatives on enclosures; what a table has not: a
    /// delay, an integrator, choices, late samples, points that barriers follow. Inside: why no plan was
    /// found.
    pub fn table(
        &self,
        t: f64,
        x: &[f64],
        start: &[f64],
        freedom: Option<&[f64]>,
    ) -> Result<Result<TabledPlan, Failure>, Error> {
        let dims @ [states, inputs] = [self.states, self.rows.input_dim];
        length("x", x.len(), states)?;
        length("start", start.len(), states)?;
        length("freedom", freedom.map_or(inputs, <[f64]>::len), inputs)?;
        for (i, size) in start.iter().enumerate() {
            non_negative(&format!("start[{}]", i + 1), *size)?;
        }
        for (i, size) in freedom.unwrap_or_default().iter().enumerate() {
            non_negative(&format!("freedom[{}]", i + 1), *size)?;
        }
        let declared = self.uncertainty.cloned().unwrap_or_else(|| Uncertainty::nothing(dims));
        for (field, is_there) in [
            ("actuation_delay", self.rows.delay > 0.0),
            ("integrator", self.integrator.is_some()),
            ("one_of", !self.plans.alternatives.is_empty()),
            ("jitter", declared.jitter > 0.0),
            ("motion", !self.plans.motions.is_empty()),
        ] {
            if is_there {
                let message = "is given, must not be for a plan as a table";
                return Err(Error::new(ErrorKind::Unsupported, field, message));
            }
        }
        let with = |freedom: Vec<f64>| {
            let of = Uncertainty { start: start.to_vec(), freedom, ..declared.clone() };
            Planning { uncertainty: Some(&of), ..*self }.tabled(t, x)
        };
        if let Some(freedom) = freedom {
            return Ok(with(freedom.to_vec()));
        }
        let of = |part: f64, i: usize| part * 0.5 * (self.bounds.max[i] - self.bounds.min[i]);
        let mut nearest = Failure::Nothing;
        for (k, part) in PARTS.iter().enumerate() {
            let mut table = match with((0..inputs).map(|i| of(*part, i)).collect()) {
                Ok(table) => table,
                Err(failure) => {
                    nearest = failure;
                    continue;
                }
            };
            for i in 0..inputs {
                let more = |part: &f64| {
                    let mut freedom = table.freedom.clone();
                    freedom[i] = of(*part, i);
                    with(freedom).ok()
                };
                table = PARTS[..k].iter().find_map(more).unwrap_or(table);
            }
            return Ok(Ok(table));
        }
        Ok(Err(nearest))
    }

    /// [`Self::table`] for what is declared.
    fn tabled(&self, t: f64, x: &[f64]) -> Result<TabledPlan, Failure> {
        let of = self.uncertainty.ok_or(Failure::Nothing)?;
        let promises = self.promises(t, x, |_| 1.0);
        let first = self.first(promises, (t, self.plans.period), x, &[], &DECISIONS.shorter)?;
        let promised = first.promises.iter().map(Option::is_some).collect();
        let plan = first.plan.backup_plan;
        let tracking = plan.tracking().ok_or(Failure::Nothing)?;
        let inputs = self.rows.input_dim;
        let slack = TOLERANCES.on_time * self.plans.period;
        let bounds = [&self.bounds.min[..inputs], &self.bounds.max[..inputs]];
        // A plan beside sets at rest may begin at any time.
        let is_timed = self.rows.slots.iter().any(|slot| moves(slot, self.states, |_, _| true));
        let origin = if is_timed { t } else { f64::INFINITY };
        let bytes = PlanTable::write(tracking, [plan.until, slack, origin], [&of.start, &of.freedom], bounds);
        Ok(TabledPlan { bytes, promised, freedom: of.freedom.clone() })
    }
}
