//! Queries to a filter between its samples. It remembers none of them.

use super::rows::Workspace;
use super::{Filter, Refusal};
use crate::error::{Error, length, non_negative, positive};
use crate::lie::Derivatives;
use crate::qp::{Problem, Residuals};
use crate::{MAX_INPUTS, reach};

impl Filter {
    /// A time in s before which no input within the bounds brings barrier number `index` to h ≥ 0 from the state `x` at `t`
    /// ([`reach::earliest_arrival`]), at most `horizon` (s, finite, > 0). `None` if that is not known (also with a
    /// disturbance) or if there is no such barrier.
    ///
    /// # Errors
    ///
    /// A slice of the wrong length; a horizon out of range.
    pub fn earliest_arrival(
        &self,
        index: usize,
        t: f64,
        x: &[f64],
        horizon: f64,
    ) -> Result<Option<f64>, Error> {
        length("x", x.len(), self.rows.state_dim)?;
        let horizon = positive("horizon", horizon)?;
        let slot = self.rows.slots.get(index).filter(|c| c.is_undisturbed());
        Ok(slot.and_then(|c| reach::earliest_arrival(&*c.source, (t, x), &self.rows.bounds, horizon)))
    }

    /// Whether it is certain that the input bounds do not allow h ≥ 0 of barrier number `index` at `after` s, finite, ≥ 0,
    /// after `t`, from the state `x`.
    ///
    /// # Errors
    ///
    /// A slice of the wrong length; a time out of range.
    pub fn is_ruled_out(&self, index: usize, t: f64, x: &[f64], after: f64) -> Result<bool, Error> {
        length("x", x.len(), self.rows.state_dim)?;
        let after = non_negative("after", after)?;
        Ok(self.rows.is_ruled_out(index, (t, x), after))
    }

    /// h of each barrier at time `t` (s) and state `x`, written to `h` in the order of the report: for instants between two
    /// samples. Remembers nothing.
    ///
    /// # Errors
    ///
    /// A slice of the wrong length.
    pub fn barrier_values(&self, t: f64, x: &[f64], h: &mut [f64]) -> Result<(), Error> {
        length("x", x.len(), self.rows.state_dim)?;
        length("h", h.len(), self.rows.slots.len())?;
        let mut derivatives = Derivatives::ZERO;
        for (slot, h) in self.rows.slots.iter().zip(h) {
            slot.source.evaluate(t, x, &mut derivatives);
            *h = derivatives.drift[0];
        }
        Ok(())
    }

    /// The residuals of `u`, the answer of the last [`Self::step`] or [`Self::peek`] to `u_ref`, in the optimality
    /// conditions of its QP. For a pointwise step they are small multiples of 1e-16. If the step looked over the period
    /// ([`Report::predicted`](super::Report::predicted)), they are those of the rows linearised at `u`, and as large as the 1e-9 at which the search
    /// stops. `None` if no QP was solved. Costs another solve: a check, not for every step.
    ///
    /// # Errors
    ///
    /// A slice of the wrong length.
    pub fn residuals(&mut self, u_ref: &[f64], u: &[f64]) -> Result<Option<Residuals>, Error> {
        length("u_ref", u_ref.len(), self.rows.input_dim)?;
        length("u", u.len(), self.rows.input_dim)?;
        let Workspace { rows, enforcement, requirements, report, qp, .. } = &mut self.rows.workspace;
        if report.status.is_abstention() || report.time.is_nan() {
            return Ok(None);
        }
        let count = requirements.len().max(self.rows.slots.len());
        let problem = Problem {
            enforcement: &enforcement[..count],
            ..Problem::new(&rows[..count], &self.rows.bounds, u_ref, self.rows.correction_limit)
        };
        qp.solve(&problem, &mut [0.0; MAX_INPUTS][..u.len()]);
        Ok(Some(qp.residuals(&problem, u)))
    }

    /// The names of the barriers, in the order of the report.
    pub fn barrier_names(&self) -> impl Iterator<Item = &str> {
        self.rows.slots.iter().map(|slot| slot.name.as_str())
    }

    /// Why barrier `index` has used another method than the configured one since its anchor ([`BarrierReport::fallback`](super::BarrierReport::fallback));
    /// `None` if it has not. Recomputed at every call: not for every step.
    pub fn refusal(&self, index: usize) -> Option<Refusal> {
        self.rows.slots.get(index)?.promise.refusal(self.rows.state.barriers.get(index)?)
    }

    /// The relative degree of each barrier, in the order of the report.
    pub fn relative_degrees(&self) -> impl Iterator<Item = usize> + '_ {
        self.rows.slots.iter().map(|slot| slot.source.relative_degree())
    }
}
