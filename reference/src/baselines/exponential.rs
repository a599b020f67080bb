//! The exponential control barrier function.

use super::{Bound, Condition, Sample, checked_order};
use punctual_core::MAX_RELATIVE_DEGREE;
use punctual_core::convergence::operator::Operator;
use punctual_core::error::Error;

/// Π (D + a_i) h ≥ 0 with n positive rates, equal or not. It has no deadline.
///
/// From outside, h ≥ h₀ e^{−at} P(t) tends to 0 but need not reach it. With a margin μ, h reaches 0 within a
/// time that grows with ln(|h₀|/μ)/a. Inside, it keeps h ≥ 0 if [`Operator::is_invariant`] holds at the
/// start.
///
/// # References
///
/// Q. Nguyen and K. Sreenath, *Exponential control barrier functions for enforcing high relative-degree
/// safety-critical constraints*, American Control Conference (2016), doi 10.1109/ACC.2016.7524935: poles −a_i < 0,
/// chosen so that h_i(0) ≥ 0 for their chain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exponential(Operator);

impl Exponential {
    /// A condition with the rates of `operator`, as many as the relative degree.
    pub fn new(operator: Operator) -> Self {
        Self(operator)
    }

    /// A condition with the same `rate` in 1/s, finite, > 0, `n` times.
    ///
    /// # Errors
    ///
    /// `n` or the rate out of range.
    pub fn repeated(n: usize, rate: f64) -> Result<Self, Error> {
        let n = checked_order("rates", n)?;
        Ok(Self(Operator::new(&[rate; MAX_RELATIVE_DEGREE][..n])?))
    }
}

impl Condition for Exponential {
    fn bound(&self, at: &Sample) -> Bound {
        Bound::floor(-self.0.lower_terms(at.e))
    }
}
