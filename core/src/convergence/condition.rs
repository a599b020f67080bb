//! The seam for constraints that are not this project's: any floor under h⁽ⁿ⁾ that is known from h, …, h⁽ⁿ⁻¹⁾.
//!
//! [`FixedTime::with_condition`](super::FixedTime::with_condition) puts one in the place of the method of the settings, so that
//! everything else of a filter (derivatives, rows, program, report) stays as it is: what is compared
//! then is the constraint alone. [`baselines`](crate::baselines) has those of the literature.

/// A constraint h⁽ⁿ⁾ ≥ φ(e₀, τ, e) for a barrier of relative degree n = the length of `anchor`.
///
/// No state: whatever it depends on is in its arguments.
pub trait Condition {
    /// φ, `[h]`/sⁿ.
    ///
    /// - `anchor`: (h − μ)⁽ʲ⁾ at the anchor, j < n.
    /// - `deadline`: T in s, counted from the anchor; a condition without one does not look at it.
    /// - `elapsed`: τ ≥ 0 in s since then.
    /// - `e`: (h − μ)⁽ʲ⁾ now, j < n.
    ///
    /// What is not finite is reported as [`Status::Singular`](crate::filter::Status::Singular).
    fn floor(&self, anchor: &[f64], deadline: f64, elapsed: f64, e: &[f64]) -> f64;

    /// A lower bound on h − μ that the condition promises at `elapsed`, where the source has one; `None`, the
    /// default, where it has not.
    fn lower_bound(&self, _anchor: &[f64], _deadline: f64, _elapsed: f64) -> Option<f64> {
        None
    }
}
