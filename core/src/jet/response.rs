//! A Taylor series in time and its response to inputs that act from the start of the series.
//!
//! Let a(τ; u) be a quantity along the trajectory that starts from a *given* state under the constant
//! input u. At τ = 0 it does not depend on u, so its derivative with respect to u at u = 0 starts at
//! order 1:
//!
//! ```text
//! a = Σ_{k≥0} a_k τᵏ,   ∂a/∂u = Σ_{k≥1} a'_k τᵏ,
//! (a b)' = a' b + a b',   (a / b)' = (a' − (a/b) b') / b,   φ(a)' = φ'(a) a'.
//! ```
//!
//! All products are Cauchy products whose second factor starts at order 1, so coefficient k of a
//! gradient needs the coefficients below k of the other series only. The same numbers as
//! `Taylor<Dual<M>, K>` with a constant first coefficient, without computing the zeros.

use core::array::from_fn;
use core::ops::{Add, Div, Mul, Neg, Sub};

use super::{Taylor, derived_operators};
use crate::scalar::Scalar;

/// `gradient[k][m]` = ∂a_k/∂u_m; never read at k = 0, where it is zero.
type Gradient<const M: usize, const K: usize> = [[f64; M]; K];

/// The first `K` ≥ 1 Taylor coefficients at u = 0, and their derivatives along `M` inputs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Response<const M: usize, const K: usize> {
    /// The series at u = 0.
    pub(crate) series: Taylor<f64, K>,
    gradient: Gradient<M, K>,
}

impl<const M: usize, const K: usize> Response<M, K> {
    /// A series that no input reaches.
    #[cfg_attr(not(feature = "small"), inline(always))]
    pub(crate) fn unforced(series: Taylor<f64, K>) -> Self {
        Self { series, gradient: [[0.0; M]; K] }
    }

    /// Time itself at `t`: `t + τ`.
    #[cfg_attr(not(feature = "small"), inline(always))]
    pub(crate) fn time(t: f64) -> Self {
        Self::unforced(Taylor::time(t))
    }

    /// Coefficient `k` and its derivatives along the inputs, which are zero for `k` = 0.
    ///
    /// # Panics
    ///
    /// If `k` ≥ `K`.
    #[cfg_attr(not(feature = "small"), inline(always))]
    pub(crate) fn coefficient(&self, k: usize) -> (f64, [f64; M]) {
        (self.series.coefficients[k], if k == 0 { [0.0; M] } else { self.gradient[k] })
    }

    /// Sets coefficient `k` ≥ 1 and its derivatives along the inputs.
    ///
    /// # Panics
    ///
    /// If `k` is 0 or ≥ `K`.
    #[cfg_attr(not(feature = "small"), inline(always))]
    pub(crate) fn set_coefficient(&mut self, k: usize, (value, gradient): (f64, [f64; M])) {
        assert!(k > 0, "the start does not depend on the inputs");
        self.series.coefficients[k] = value;
        self.gradient[k] = gradient;
    }

    /// The first `J` ≤ `K` coefficients.
    #[cfg_attr(not(feature = "small"), inline(always))]
    pub(crate) fn truncated<const J: usize>(&self) -> Response<M, J> {
        Response {
            series: Taylor { coefficients: from_fn(|k| self.series.coefficients[k]) },
            gradient: from_fn(|k| self.gradient[k]),
        }
    }

    /// A gradient from its coefficients k ≥ 1, of components m.
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn gradient(coefficient: impl Fn(usize, usize) -> f64) -> Gradient<M, K> {
        from_fn(|k| from_fn(|m| if k == 0 { 0.0 } else { coefficient(k, m) }))
    }

    /// Coefficient `k` ≥ 1 of a' b, component `m`.
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn product(gradient: &Gradient<M, K>, b: &Taylor<f64, K>, k: usize, m: usize) -> f64 {
        let mut sum = gradient[k][m] * b.coefficients[0];
        for i in 1..k {
            sum += gradient[i][m] * b.coefficients[k - i];
        }
        sum
    }

    /// φ(a) from the series of φ(a) and φ'(a); the last coefficient of the latter is not used.
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn chain(&self, series: Taylor<f64, K>, slope: Taylor<f64, K>) -> Self {
        Self { series, gradient: Self::gradient(|k, m| Self::product(&self.gradient, &slope, k, m)) }
    }
}

impl<const M: usize, const K: usize> From<f64> for Response<M, K> {
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn from(value: f64) -> Self {
        Self::unforced(Taylor::from(value))
    }
}

impl<const M: usize, const K: usize> Neg for Response<M, K> {
    type Output = Self;
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn neg(self) -> Self {
        Self { series: -self.series, gradient: Self::gradient(|k, m| -self.gradient[k][m]) }
    }
}

impl<const M: usize, const K: usize> Add for Response<M, K> {
    type Output = Self;
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn add(self, other: Self) -> Self {
        let gradient = Self::gradient(|k, m| self.gradient[k][m] + other.gradient[k][m]);
        Self { series: self.series + other.series, gradient }
    }
}

impl<const M: usize, const K: usize> Sub for Response<M, K> {
    type Output = Self;
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn sub(self, other: Self) -> Self {
        let gradient = Self::gradient(|k, m| self.gradient[k][m] - other.gradient[k][m]);
        Self { series: self.series - other.series, gradient }
    }
}

impl<const M: usize, const K: usize> Mul for Response<M, K> {
    type Output = Self;
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn mul(self, other: Self) -> Self {
        let gradient = Self::gradient(|k, m| {
            Self::product(&self.gradient, &other.series, k, m)
                + Self::product(&other.gradient, &self.series, k, m)
        });
        Self { series: self.series * other.series, gradient }
    }
}

impl<const M: usize, const K: usize> Div for Response<M, K> {
    type Output = Self;
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn div(self, other: Self) -> Self {
        let series = self.series / other.series;
        let rest = Self::gradient(|k, m| self.gradient[k][m] - Self::product(&other.gradient, &series, k, m));
        let reciprocal = Taylor::from(1.0) / other.series;
        Self { series, gradient: Self::gradient(|k, m| Self::product(&rest, &reciprocal, k, m)) }
    }
}

impl<const M: usize, const K: usize> Add<f64> for Response<M, K> {
    type Output = Self;
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn add(self, other: f64) -> Self {
        Self { series: self.series + other, ..self }
    }
}

impl<const M: usize, const K: usize> Sub<f64> for Response<M, K> {
    type Output = Self;
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn sub(self, other: f64) -> Self {
        Self { series: self.series - other, ..self }
    }
}

impl<const M: usize, const K: usize> Mul<f64> for Response<M, K> {
    type Output = Self;
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn mul(self, other: f64) -> Self {
        Self { series: self.series * other, gradient: Self::gradient(|k, m| self.gradient[k][m] * other) }
    }
}

impl<const M: usize, const K: usize> Div<f64> for Response<M, K> {
    type Output = Self;
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn div(self, other: f64) -> Self {
        Self { series: self.series / other, gradient: Self::gradient(|k, m| self.gradient[k][m] / other) }
    }
}

derived_operators!([const M: usize, const K: usize] Response<M, K>);

impl<const M: usize, const K: usize> Scalar for Response<M, K> {
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn value(self) -> f64 {
        self.series.value()
    }
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn sqrt(self) -> Self {
        let root = self.series.sqrt();
        self.chain(root, Taylor::from(0.5) / root)
    }
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn exp(self) -> Self {
        let value = self.series.exp();
        self.chain(value, value)
    }
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn ln(self) -> Self {
        self.chain(self.series.ln(), Taylor::from(1.0) / self.series)
    }
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn sin_cos(self) -> (Self, Self) {
        let (sin, cos) = self.series.sin_cos();
        (self.chain(sin, cos), self.chain(cos, -sin))
    }
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn atan(self) -> Self {
        self.chain(self.series.atan(), Taylor::from(1.0) / (self.series.squared() + 1.0))
    }
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn tanh(self) -> Self {
        let value = self.series.tanh();
        self.chain(value, -value.squared() + 1.0)
    }
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn powf(self, exponent: f64) -> Self {
        self.chain(self.series.powf(exponent), self.series.powf(exponent - 1.0) * exponent)
    }
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn squared(self) -> Self {
        let gradient = Self::gradient(|k, m| 2.0 * Self::product(&self.gradient, &self.series, k, m));
        Self { series: self.series.squared(), gradient }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::jet::Dual;

    const K: usize = 6;
    type Both = (Response<2, K>, Taylor<Dual<2>, K>);

    /// The same series both ways.
    fn sample(values: [f64; K]) -> Both {
        let mut response = Response::unforced(Taylor { coefficients: values });
        let mut taylor = Taylor { coefficients: values.map(Dual::from) };
        for k in 1..K {
            let gradient = [0.3 - 0.1 * k as f64, 0.2 * (k as f64).sqrt()];
            response.set_coefficient(k, (values[k], gradient));
            taylor.coefficients[k].gradient = gradient;
        }
        (response, taylor)
    }

    /// Every operation that a model may apply to a scalar.
    fn operations<S: Scalar>(a: S, b: S, t: S) -> [S; 18] {
        let (sin, cos) = a.sin_cos();
        [
            a + b * t,
            a * b - t,
            a / b,
            (-a) / 3.0 + 1.0,
            (b * 2.0 - 0.5).squared(),
            a.sqrt(),
            (a - b).exp(),
            b.ln(),
            sin * t,
            cos.atan(),
            a.powf(1.7),
            b.powi(-3),
            (a - b).tanh(),
            a.atan2(b),
            (-b).atan2(-a),
            (a - b).abs(),
            a.min(b * t),
            a.max(b * t),
        ]
    }

    #[test]
    fn agrees_with_taylor_series_of_dual_numbers() {
        let (a, b) = (sample([0.7, 0.3, -0.2, 0.11, 0.05, -0.4]), sample([1.3, -0.8, 0.1, 0.2, -0.6, 0.1]));
        let found = operations(a.0, b.0, Response::time(0.4));
        let wanted = operations(a.1, b.1, Taylor::time(0.4));
        for (i, (found, wanted)) in found.iter().zip(wanted).enumerate() {
            assert_eq!(found.value(), wanted.value(), "operation {i}");
            for k in 0..K {
                let ((value, gradient), wanted) = (found.coefficient(k), wanted.coefficients[k]);
                // Coefficients are of order 1 to 100; both ways round a few dozen times.
                assert!((value - wanted.value).abs() < 1e-12, "operation {i}, value {k}: {value}");
                for m in 0..2 {
                    let difference = gradient[m] - wanted.gradient[m];
                    assert!(difference.abs() < 1e-11, "operation {i}, gradient {k} {m}: {difference}");
                }
            }
        }
    }

    #[test]
    fn truncation_keeps_the_first_coefficients() {
        let a = sample([0.7, 0.3, -0.2, 0.11, 0.05, -0.4]).0;
        let short = a.truncated::<3>();
        assert_eq!([0, 1, 2].map(|k| short.coefficient(k)), [0, 1, 2].map(|k| a.coefficient(k)));
        assert_eq!(short.exp(), a.exp().truncated::<3>());
    }
}
