//! The first-order fixed-time control barrier function.

use super::chain::{Chain, ClassK};
use super::{Bound, Condition, Exponent, Sample, checked_order};
use punctual_core::MAX_RELATIVE_DEGREE;
use punctual_core::elementary;
use punctual_core::error::{Error, positive};

/// ψ_1 = ḣ + α |h|^p sign h with α = |h₀|^{1−p}/((1 − p) T), so that h = 0 at T if ψ_1 = 0 throughout.
///
/// For n = 1 the constraint is ψ_1 ≥ 0, below and above zero. For n > 1 it is (D + k)ⁿ⁻¹ ψ_1 ≥ 0, which is
/// our extension. It keeps the deadline if ψ_1 and its first n − 2 derivatives start so that ψ_1 ≥ 0 from
/// then on. A start at rest outside has ψ_1 < 0, and arrives later than T.
///
/// # References
///
/// S. P. Bhat and D. S. Bernstein, *Finite-time stability of continuous autonomous systems*, SIAM J. Control Optim. 38
/// (2000), doi 10.1137/S0363012997321358, for the settling time; A. Li, L. Wang, P. Pierpaoli and M. Egerstedt,
/// *Formally correct composition of coordinated behaviors using control barrier certificates*, IEEE/RSJ Conf.
/// Intelligent Robots and Systems (2018), for its use as a barrier; gain by T as in [`Exponent`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FirstOrderFixedTime {
    n: usize,
    exponent: Exponent,
    rate: f64,
}

impl FirstOrderFixedTime {
    /// A condition for relative degree `n`, with `rate` = k in 1/s, finite, > 0, for the orders above the
    /// first.
    ///
    /// # Errors
    ///
    /// `n` or the rate out of range.
    pub fn new(n: usize, exponent: Exponent, rate: f64) -> Result<Self, Error> {
        Ok(Self { n: checked_order("n", n)?, exponent, rate: positive("rate", rate)? })
    }
}

impl Condition for FirstOrderFixedTime {
    fn bound(&self, at: &Sample) -> Bound {
        let (p, anchor) = (self.exponent.get(), at.anchor[0]);
        // On the boundary at the anchor, nothing has to be reached and any gain keeps it.
        let size = anchor.abs();
        let gain = if size > 0.0 {
            elementary::powf(size, 1.0 - p) * self.exponent.rate(at.deadline)
        } else {
            self.rate
        };
        let mut functions = [ClassK::Linear(self.rate); MAX_RELATIVE_DEGREE];
        functions[0] = ClassK::Power { gain, exponent: p };
        let bound = Chain::of(self.n, functions).bound(at);
        if self.n > 1 || anchor >= 0.0 {
            return bound;
        }
        Bound { lower: self.exponent.lower_bound(anchor, at.deadline, at.elapsed), ..bound }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn order_one_is_the_classical_condition() {
        let exponent = Exponent::new(0.5).expect("in range");
        let condition = FirstOrderFixedTime::new(1, exponent, 1.0).expect("valid");
        for e in [-40.0, -3.0, -1e-3] {
            let found = condition.bound(&Sample::new(&[-40.0], 3.0, 0.0, &[e])).floor;
            let wanted = exponent.floor(-40.0, 3.0, e);
            assert!((found - wanted).abs() < 1e-13 * wanted, "{found} for {wanted}");
        }
        assert_eq!(condition.bound(&Sample::new(&[-40.0], 3.0, 3.0, &[-1.0])).lower, 0.0);
    }

    /// h(t) = −(1 − t/T)² solves ψ_1 = 0 for p = 1/2, so its second derivative is on the floor.
    #[test]
    fn its_solution_is_on_the_floor_of_order_two() {
        let condition = FirstOrderFixedTime::new(2, Exponent::default(), 7.0).expect("valid");
        let deadline = 2.0;
        for t in [0.0, 0.5, 1.9] {
            let s: f64 = 1.0 - t / deadline;
            let e = [-s * s, 2.0 * s / deadline];
            let found = condition.bound(&Sample::new(&[-1.0, 1.0], deadline, t, &e)).floor;
            assert!((found + 2.0 / (deadline * deadline)).abs() < 1e-12, "{found} at {t}");
        }
        assert!(FirstOrderFixedTime::new(2, Exponent::default(), 0.0).is_err());
    }
}
