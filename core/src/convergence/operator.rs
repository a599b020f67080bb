//! The error dynamics Π (D + a_i) with n positive rates, equal or not.
//!
//! ```math
//! \prod_{i\le n} (D + a_i)\, e = \sum_{j\le n} \gamma_j\, e^{(j)}, \qquad \gamma_n = 1, \tag{O}
//! ```
//!
//! γ_j the elementary symmetric polynomial of degree n − j of the rates. With ψ_0 = e and ψ_i = (D + a_i) ψ_{i−1},
//! the constraint ψ_n ≥ 0 keeps e ≥ 0 for ever if ψ_i(0) ≥ 0 for all i < n (`docs/theory.md#rates-lemma`). That
//! condition depends on the order of the rates, the constraint does not: one order suffices. From a zero error, as on
//! a reference profile, it holds in any order. For equal rates ψ_i(0) = i! c_i, the coefficients of
//! [`comparison`](super::comparison).
//!
//! # References
//!
//! Q. Nguyen and K. Sreenath, *Exponential control barrier functions*, American Control Conference
//! (2016), doi 10.1109/ACC.2016.7524935, for the cascade with distinct rates.

#[cfg(feature = "serde")]
use alloc::vec::Vec;

use super::comparison::Stack;
use crate::MAX_RELATIVE_DEGREE;
use crate::error::{Error, ErrorKind, positive};

/// Π (D + a_i).
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(try_from = "Vec<f64>", into = "Vec<f64>"))]
pub struct Operator {
    n: usize,
    rates: Stack,
    /// The coefficient of e⁽ʲ⁾, γ_j in 1/s^{n−j}.
    coefficients: Stack,
}

/// The coefficients of Π (D + a_i) below its leading 1; zeros from there on.
fn lower_coefficients(rates: &[f64]) -> Stack {
    let mut c = [0.0; MAX_RELATIVE_DEGREE];
    for (i, &a) in rates.iter().enumerate() {
        // Multiply the operator of the first i rates, whose leading coefficient is 1, by D + a.
        c[i] = 1.0;
        for j in (0..=i).rev() {
            c[j] = a * c[j] + if j > 0 { c[j - 1] } else { 0.0 };
        }
    }
    c
}

/// Π (D + a_i) e = (D + `last`) Σ_k `weights[k]` e⁽ᵏ⁾.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Split {
    /// Coefficients for n − 1 rates, including the leading 1; zeros above.
    pub(super) weights: Stack,
    /// a_n in 1/s.
    pub(super) last: f64,
}

impl Operator {
    /// The operator with these rates: 1 to [`MAX_RELATIVE_DEGREE`] of them, each in 1/s, finite, > 0.
    ///
    /// # Errors
    ///
    /// Another number of rates, or a rate out of range.
    ///
    /// ```
    /// # use punctual_core::convergence::operator::Operator;
    /// // (D + 1)(D + 2)(D + 3) = D³ + 6 D² + 11 D + 6.
    /// let operator = Operator::new(&[1.0, 2.0, 3.0])?;
    /// assert_eq!(operator.coefficients(), [6.0, 11.0, 6.0]);
    /// assert!(Operator::new(&[1.0, 0.0]).is_err());
    /// # Ok::<(), punctual_core::Error>(())
    /// ```
    pub fn new(rates: &[f64]) -> Result<Self, Error> {
        let n = rates.len();
        if n == 0 || n > MAX_RELATIVE_DEGREE {
            let message = format!("has {n} components, must have 1 to {MAX_RELATIVE_DEGREE}");
            return Err(Error::new(ErrorKind::Dimension, "rates", message));
        }
        for (i, &a) in rates.iter().enumerate() {
            positive(&format!("rates[{}]", i + 1), a)?;
        }
        let mut kept = [0.0; MAX_RELATIVE_DEGREE];
        kept[..n].copy_from_slice(rates);
        Ok(Self { n, rates: kept, coefficients: lower_coefficients(rates) })
    }

    /// The number of rates, n.
    pub fn order(&self) -> usize {
        self.n
    }

    /// The coefficients of e⁽⁰⁾ … e⁽ⁿ⁻¹⁾: γ_0 … γ_{n−1}. That of e⁽ⁿ⁾ is 1.
    pub fn coefficients(&self) -> &[f64] {
        &self.coefficients[..self.n]
    }

    /// Π (D + a_i) e without e⁽ⁿ⁾, where `e` holds e⁽⁰⁾ … e⁽ⁿ⁻¹⁾.
    pub fn lower_terms(&self, e: &[f64]) -> f64 {
        self.coefficients().iter().zip(e).map(|(c, e)| c * e).sum()
    }

    /// The operator as (D + a_n) after that of the other n − 1 rates.
    pub(super) fn without_last(&self) -> Split {
        let others = &self.rates[..self.n - 1];
        let mut weights = lower_coefficients(others);
        weights[others.len()] = 1.0;
        let last = self.rates[others.len()];
        Split { weights, last }
    }

    /// Whether Π (D + a_i) e ≥ 0 keeps e ≥ 0 for ever from `e`: all ψ_i ≥ 0, i < n, with the rates in the order given.
    pub fn is_invariant(&self, e: &[f64]) -> bool {
        let mut cascade = [0.0; MAX_RELATIVE_DEGREE];
        cascade[..self.n].copy_from_slice(&e[..self.n]);
        for i in 0..self.n {
            // Not `< 0`: NaN fails as well.
            if !matches!(cascade[0].partial_cmp(&0.0), Some(o) if o.is_ge()) {
                return false;
            }
            for j in 0..self.n - 1 - i {
                cascade[j] = cascade[j + 1] + self.rates[i] * cascade[j];
            }
        }
        true
    }
}

impl Operator {
    /// The largest μ for which e − μ satisfies [`Self::is_invariant`] from `e`; negative if there is none ≥ 0.
    pub(super) fn affordable_margin(&self, e: &[f64]) -> f64 {
        let mut cascade = [0.0; MAX_RELATIVE_DEGREE];
        cascade[..self.n].copy_from_slice(&e[..self.n]);
        let (mut least, mut product) = (f64::INFINITY, 1.0);
        for i in 0..self.n {
            let margin = cascade[0] / product;
            // Not `f64::min`, which would drop NaN.
            if margin < least || margin.is_nan() {
                least = margin;
            }
            for j in 0..self.n - 1 - i {
                cascade[j] = cascade[j + 1] + self.rates[i] * cascade[j];
            }
            product *= self.rates[i];
        }
        least
    }
}

#[cfg(feature = "serde")]
impl TryFrom<Vec<f64>> for Operator {
    type Error = Error;

    /// [`Self::new`], for data read from a file.
    fn try_from(rates: Vec<f64>) -> Result<Self, Error> {
        Self::new(&rates)
    }
}

#[cfg(feature = "serde")]
impl From<Operator> for Vec<f64> {
    /// The rates.
    fn from(operator: Operator) -> Self {
        operator.rates[..operator.n].to_vec()
    }
}

#[cfg(test)]
mod tests {
    use super::super::{comparison, stay};
    use alloc::string::ToString;

    use super::*;

    #[test]
    fn equal_rates_are_the_repeated_ones() {
        let e = [-3.0, 2.0, 0.5, -1.0, 4.0, 1.0, -2.0, 0.25];
        for n in 1..=MAX_RELATIVE_DEGREE {
            let operator = Operator::new(&[0.75; MAX_RELATIVE_DEGREE][..n]).expect("valid rates");
            let (found, wanted) = (operator.lower_terms(&e[..n]), comparison::lower_terms(0.75, &e[..n]));
            // A few dozen operations on numbers below 100.
            assert!((found - wanted).abs() < 1e-12, "n = {n}: {found} for {wanted}");
            for first in [-1.0, 1.0, 3.0] {
                let mut e = e;
                e[0] = first;
                assert_eq!(operator.is_invariant(&e[..n]), stay::is_invariant(0.75, &e[..n]), "n = {n}");
            }
        }
    }

    #[test]
    fn the_order_matters_at_the_start_only() {
        // e = 1, ė = −2.5: (D + 3) e ≥ 0 but (D + 2) e < 0.
        let slow_first = Operator::new(&[2.0, 3.0]).expect("valid rates");
        let fast_first = Operator::new(&[3.0, 2.0]).expect("valid rates");
        assert_eq!(slow_first.coefficients(), fast_first.coefficients());
        assert!(fast_first.is_invariant(&[1.0, -2.5]) && !slow_first.is_invariant(&[1.0, -2.5]));
        assert!(!fast_first.is_invariant(&[f64::NAN, 1.0]));
    }

    #[test]
    fn rates_out_of_range_are_refused() {
        let message = |rates: &[f64]| Operator::new(rates).unwrap_err().to_string();
        assert_eq!(message(&[]), "rates: has 0 components, must have 1 to 8");
        assert_eq!(message(&[1.0; 9]), "rates: has 9 components, must have 1 to 8");
        assert_eq!(message(&[1.0, -2.0]), "rates[2]: is -2, must be finite and > 0");
        assert_eq!(message(&[f64::NAN]), "rates[1]: is NaN, must be finite and > 0");
    }
}
