//! Questions to a filter between its samples; it remembers none of them.

use super::SafetyFilter;
use crate::error::{Error, length, non_negative, positive};
use crate::lie::Derivatives;
use crate::reach;

impl SafetyFilter {
    /// A time in s before which no input within the bounds brings barrier number `index` to h ≥ 0 from the
    /// state `x` at `t` ([`reach::soonest`]), at most `horizon` (s, finite, > 0); `None` where that is not
    /// known (with a disturbance too) or there is no such barrier.
    ///
    /// # Errors
    ///
    /// A slice of the wrong length; a horizon out of range.
    pub fn soonest(&self, index: usize, t: f64, x: &[f64], horizon: f64) -> Result<Option<f64>, Error> {
        length("x", x.len(), self.state_dim)?;
        let horizon = positive("horizon", horizon)?;
        let slot = self.slots.get(index).filter(|c| c.is_undisturbed());
        Ok(slot.and_then(|c| reach::soonest(&*c.source, (t, x), &self.bounds, horizon)))
    }

    /// Whether the input bounds certainly do not allow h ≥ 0 of barrier number `index` at `after` s, finite, ≥ 0,
    /// after `t` and the state `x`.
    ///
    /// # Errors
    ///
    /// A slice of the wrong length; a time out of range.
    pub fn is_ruled_out(&self, index: usize, t: f64, x: &[f64], after: f64) -> Result<bool, Error> {
        length("x", x.len(), self.state_dim)?;
        let after = non_negative("after", after)?;
        let slot = self.slots.get(index).filter(|c| c.is_undisturbed());
        Ok(slot.is_some_and(|c| reach::ruled_out(&*c.source, (t, x), &self.bounds, after, 1.0)))
    }

    /// h of each barrier at time `t` (s) and the state `x`, written to `h` in the order of the report: for instants
    /// between two samples. Remembers nothing.
    ///
    /// # Errors
    ///
    /// A slice of the wrong length.
    pub fn barrier_values(&self, t: f64, x: &[f64], h: &mut [f64]) -> Result<(), Error> {
        length("x", x.len(), self.state_dim)?;
        length("h", h.len(), self.slots.len())?;
        let mut derivatives = Derivatives::ZERO;
        for (slot, h) in self.slots.iter().zip(h) {
            slot.source.evaluate(t, x, &mut derivatives);
            *h = derivatives.drift[0];
        }
        Ok(())
    }
}
