//! High-order control barrier functions: a chain of class-K functions.

use super::{Bound, Condition, Sample, checked_order};
use punctual_core::MAX_RELATIVE_DEGREE;
use punctual_core::elementary;
use punctual_core::error::{Error, ErrorKind, length, positive};
use punctual_core::jet::Taylor;
use punctual_core::scalar::Scalar;

/// An extended class-K function α: increasing, with α(0) = 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ClassK {
    /// p s, p in 1/s, finite, > 0.
    Linear(f64),
    /// p |s|^q sign s with p finite, > 0, in `[s]`^(1−q)/s, and q finite, > 0. For q in (0, 1) it reaches
    /// zero in finite time, where its derivative is unbounded.
    Power {
        /// p.
        gain: f64,
        /// q, dimensionless.
        exponent: f64,
    },
}

impl ClassK {
    fn validated(self, field: &str) -> Result<Self, Error> {
        match self {
            Self::Linear(gain) => positive(field, gain)?,
            Self::Power { gain, exponent } => {
                positive(field, gain)?;
                positive("exponent", exponent).map_err(|e| e.within(field))?
            }
        };
        Ok(self)
    }

    /// α of a series.
    pub(super) fn of<const K: usize>(self, s: Taylor<f64, K>) -> Taylor<f64, K> {
        match self {
            Self::Linear(gain) => s * gain,
            Self::Power { gain, exponent } if s.value() < 0.0 => -(-s).powf(exponent) * gain,
            Self::Power { gain, exponent } => s.powf(exponent) * gain,
        }
    }
}

/// ψ_0 = h, ψ_i = ψ̇_{i−1} + α_i(ψ_{i−1}), and ψ_n ≥ 0, with class-K functions α_1 … α_n.
///
/// If ψ_i(t₀) ≥ 0 for all i < n, it keeps all of them nonnegative. From outside:
///
/// - Linear functions give Π (D + p_i) h ≥ 0, the constraint of [`Exponential`](super::Exponential), without
///   a deadline.
/// - Powers with q_i in (0, 1) bring ψ_{n−1}, then ψ_{n−2}, … and finally h to zero in finite time. Each
///   takes at most |ψ_{i−1}|^{1−q_i}/(p_i (1 − q_i)) after the one before has arrived. [`Self::reach_time`]
///   is the sum of these at the start. It bounds the arrival if no ψ_i, i < n, falls below its initial value.
///   A power is not Lipschitz at 0: near ψ_i = 0, the floor under h⁽ⁿ⁾ has the term p q |ψ|^{q−1} ψ̇.
///
/// # References
///
/// W. Xiao and C. Belta, *Control barrier functions for systems with high relative degree*, IEEE Conf. Decision
/// and Control (2019), and *High-order control barrier functions*, IEEE Trans. Automatic Control 67 (2022), doi
/// 10.1109/TAC.2021.3105491, for the chain. W. Xiao, C. A. Belta and C. G. Cassandras, *High order control
/// Lyapunov-barrier functions for temporal logic specifications*, American Control Conference (2021),
/// arXiv:2102.06787, for starts outside and powers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chain {
    n: usize,
    functions: [ClassK; MAX_RELATIVE_DEGREE],
}

impl Chain {
    /// A chain of these α_1 … α_n, as many as the relative degree.
    ///
    /// # Errors
    ///
    /// None or more than [`MAX_RELATIVE_DEGREE`], or a number out of range.
    pub fn new(functions: &[ClassK]) -> Result<Self, Error> {
        let n = checked_order("functions", functions.len())?;
        let mut kept = [ClassK::Linear(1.0); MAX_RELATIVE_DEGREE];
        for (i, function) in functions.iter().enumerate() {
            kept[i] = function.validated(&format!("functions[{}]", i + 1))?;
        }
        Ok(Self { n, functions: kept })
    }

    /// A chain of checked functions.
    pub(super) fn of(n: usize, functions: [ClassK; MAX_RELATIVE_DEGREE]) -> Self {
        Self { n, functions }
    }

    /// A chain of linear functions with these gains p_1 … p_n in 1/s.
    ///
    /// # Errors
    ///
    /// As for [`Self::new`].
    pub fn linear(gains: &[f64]) -> Result<Self, Error> {
        Self::new(&gains.iter().map(|&p| ClassK::Linear(p)).collect::<Vec<_>>())
    }

    /// A chain of powers with these gains p_i and exponents q_i in (0, 1).
    ///
    /// # Errors
    ///
    /// As for [`Self::new`]; different numbers of gains and exponents, or an exponent outside (0, 1).
    pub fn finite_time(gains: &[f64], exponents: &[f64]) -> Result<Self, Error> {
        length("exponents", exponents.len(), gains.len())?;
        for (i, &q) in exponents.iter().enumerate() {
            if !(q > 0.0 && q < 1.0) {
                let message = format!("is {q}, must be > 0 and < 1");
                return Err(Error::new(ErrorKind::Range, format!("exponents[{}]", i + 1), message));
            }
        }
        let power = |(&gain, &exponent): (&f64, &f64)| ClassK::Power { gain, exponent };
        Self::new(&gains.iter().zip(exponents).map(power).collect::<Vec<_>>())
    }

    /// ψ_0 … ψ_{n−1} computed from h⁽ʲ⁾, j < n; zeros beyond.
    pub fn psi(&self, h: &[f64]) -> [f64; MAX_RELATIVE_DEGREE] {
        let mut values = [0.0; MAX_RELATIVE_DEGREE];
        self.run(h, &mut values);
        values
    }

    /// Σ |ψ_{i−1}|^{1−q_i}/(p_i (1 − q_i)) in s over the links that start outside (ψ_{i−1} < 0) for h⁽ʲ⁾, j <
    /// n; infinite if one of them has q_i ≥ 1.
    pub fn reach_time(&self, h: &[f64]) -> f64 {
        let psi = self.psi(h);
        let outside = self.functions[..self.n].iter().zip(psi).filter(|(_, psi)| *psi < 0.0);
        let times = outside.map(|(function, psi)| match *function {
            ClassK::Power { gain, exponent: q } if q < 1.0 => {
                elementary::powf(psi.abs(), 1.0 - q) / (gain * (1.0 - q))
            }
            _ => f64::INFINITY,
        });
        times.sum()
    }

    /// ψ_n for h⁽ⁿ⁾ = 0; also writes ψ_0 … ψ_{n−1} to `values`.
    fn run(&self, h: &[f64], values: &mut [f64; MAX_RELATIVE_DEGREE]) -> f64 {
        // With n known at compile time, the short loops of the series unroll.
        match self.n {
            1 => self.rest::<2>(h, values),
            2 => self.rest::<3>(h, values),
            3 => self.rest::<4>(h, values),
            4 => self.rest::<5>(h, values),
            5 => self.rest::<6>(h, values),
            6 => self.rest::<7>(h, values),
            7 => self.rest::<8>(h, values),
            _ => self.rest::<9>(h, values),
        }
    }

    /// [`Self::run`] for n = `K` − 1. h⁽ⁿ⁾ enters ψ_i only through its own derivative of order n − i, with
    /// coefficient 1: α_i(ψ_{i−1}) is differentiated n − i times, which requires ψ_{i−1} up to that order.
    fn rest<const K: usize>(&self, h: &[f64], values: &mut [f64; MAX_RELATIVE_DEGREE]) -> f64 {
        let mut psi = Taylor::<f64, K>::constant(0.0);
        let mut factorial = 1.0;
        for k in 0..self.n {
            factorial *= k.max(1) as f64;
            psi.coefficients[k] = h[k] / factorial;
        }
        for i in 0..self.n {
            values[i] = psi.coefficients[0];
            let image = self.functions[i].of(psi);
            // Unknown coefficients belong to h⁽ⁿ⁾ = 0 or higher orders. Of these, only h⁽ⁿ⁾ = 0 itself
            // reaches the final value.
            for k in 0..K - 1 {
                psi.coefficients[k] = (k + 1) as f64 * psi.coefficients[k + 1] + image.coefficients[k];
            }
            psi.coefficients[K - 1] = 0.0;
        }
        psi.coefficients[0]
    }
}

impl Condition for Chain {
    fn bound(&self, at: &Sample) -> Bound {
        Bound::floor(-self.run(at.e, &mut [0.0; MAX_RELATIVE_DEGREE]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use punctual_core::convergence::operator::Operator;

    fn floor(chain: &Chain, e: &[f64]) -> f64 {
        chain.bound(&Sample::new(e, 1.0, 0.0, e)).floor
    }

    #[test]
    fn linear_functions_are_the_product_of_their_factors() {
        let gains = [0.5, 2.0, 1.25, 3.0, 0.75, 1.0, 4.0, 0.25];
        let e = [-3.0, 2.0, 0.5, -1.0, 4.0, 1.0, -2.0, 0.25];
        for n in 1..=MAX_RELATIVE_DEGREE {
            let chain = Chain::linear(&gains[..n]).expect("valid gains");
            let wanted = -Operator::new(&gains[..n]).expect("valid rates").lower_terms(&e[..n]);
            let found = floor(&chain, &e[..n]);
            // A few dozen operations on numbers below 1000.
            assert!((found - wanted).abs() < 1e-11 * wanted.abs().max(1.0), "n = {n}: {found} for {wanted}");
        }
    }

    /// n = 2 by hand: ψ_1 = ḣ + p|h|^q sign h, ψ_2 = ḧ + p q |h|^{q−1} ḣ + p₂|ψ_1|^{q₂} sign ψ_1, on both sides of
    /// zero.
    #[test]
    fn powers_of_order_two_are_the_chain_rule() {
        let (p, q) = ([1.5, 0.7], [0.5, 0.25]);
        let chain = Chain::finite_time(&p, &q).expect("valid");
        for (h, dh) in [(-4.0, 0.5), (-4.0, 9.0), (2.5, -1.0), (0.3, -2.0)] {
            let sign = |v: f64, q: f64| v.abs().powf(q) * v.signum();
            let psi = dh + p[0] * sign(h, q[0]);
            let wanted = -(p[0] * q[0] * f64::abs(h).powf(q[0] - 1.0) * dh + p[1] * sign(psi, q[1]));
            let found = floor(&chain, &[h, dh]);
            assert!((found - wanted).abs() < 1e-13 * (1.0 + wanted.abs()), "{found} for {wanted}");
            assert!((chain.psi(&[h, dh])[1] - psi).abs() < 1e-14 * (1.0 + psi.abs()));
        }
    }

    /// h(t) = −(1 − t)⁴ solves ψ_1 = 0 with p = 4, q = 3/4, and so satisfies any chain that continues it: its
    /// third derivative is the floor of order 3.
    #[test]
    fn a_solution_of_the_first_link_is_on_the_floor_of_order_three() {
        let functions = [
            ClassK::Power { gain: 4.0, exponent: 0.75 },
            ClassK::Linear(2.0),
            ClassK::Power { gain: 1.0, exponent: 2.0 },
        ];
        let chain = Chain::new(&functions).expect("valid");
        for t in [0.0, 0.25, 0.9] {
            let s: f64 = 1.0 - t;
            let h = [-s.powi(4), 4.0 * s.powi(3), -12.0 * s * s];
            let found = floor(&chain, &h);
            assert!((found - 24.0 * s).abs() < 1e-12, "{found} at {t}");
            // 1^{1/4}/(4 · 1/4) = 1 s from the start, which is exact for the first link alone.
            let first = Chain::new(&functions[..1]).expect("valid");
            assert!((first.reach_time(&h[..1]) - s).abs() < 1e-15);
        }
    }

    #[test]
    fn at_zero_a_power_below_one_has_no_derivative() {
        let chain = Chain::finite_time(&[1.0, 1.0], &[0.5, 0.5]).expect("valid");
        assert!(!floor(&chain, &[0.0, 1.0]).is_finite());
        assert!(chain.reach_time(&[1.0, 1.0]) == 0.0);
        assert!(Chain::linear(&[1.0]).expect("valid").reach_time(&[-1.0]).is_infinite());
    }

    #[test]
    fn numbers_out_of_range_are_named() {
        let message = |chain: Result<Chain, Error>| chain.unwrap_err().to_string();
        assert_eq!(message(Chain::linear(&[])), "functions: has 0 components, must have 1 to 8");
        assert_eq!(message(Chain::linear(&[1.0, -1.0])), "functions[2]: is -1, must be finite and > 0");
        assert_eq!(message(Chain::finite_time(&[1.0], &[1.0])), "exponents[1]: is 1, must be > 0 and < 1");
        assert_eq!(message(Chain::finite_time(&[1.0], &[])), "exponents: has 0 components, must have 1");
        let power = ClassK::Power { gain: 1.0, exponent: f64::NAN };
        assert_eq!(message(Chain::new(&[power])), "functions[1].exponent: is NaN, must be finite and > 0");
    }
}
