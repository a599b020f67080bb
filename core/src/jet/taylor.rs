//! Truncated Taylor series in time.
//!
//! A smooth `a(t₀ + τ) = Σ_k a_k τᵏ` is kept as its first `K` normalised coefficients
//! `a_k = a⁽ᵏ⁾(t₀)/k!`. Products are Cauchy products; each elementary function follows from the
//! differential equation it satisfies, such as `y = eᵃ` from `y' = a' y`:
//!
//! ```math
//! (a b)_k = \sum_{i=0}^{k} a_i\, b_{k-i}, \qquad k\, y_k = \sum_{i=1}^{k} i\, a_i\, y_{k-i}.
//! ```
//!
//! The coefficients may themselves be [`Dual`](super::Dual): the recurrences only use ring operations.
//!
//! # References
//!
//! A. Griewank and A. Walther, *Evaluating Derivatives*, 2nd ed., SIAM 2008, chapter 13
//! (doi:10.1137/1.9780898717761).

use core::array::from_fn;
use core::cmp::Ordering;
use core::ops::{Add, Div, Mul, Neg, Sub};

use super::derived_operators;
use crate::scalar::Scalar;

/// The first `K` ≥ 1 normalised Taylor coefficients of a function of time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Taylor<C, const K: usize> {
    /// `coefficients[k]` is the k-th derivative divided by k!.
    pub coefficients: [C; K],
}

impl<C: Scalar, const K: usize> Taylor<C, K> {
    /// A constant: all coefficients but the first are 0.
    #[inline]
    pub fn constant(value: C) -> Self {
        Self { coefficients: from_fn(|k| if k == 0 { value } else { C::zero() }) }
    }

    /// Time itself at `t`: `t + τ`.
    #[inline]
    pub fn time(t: f64) -> Self {
        Self {
            coefficients: from_fn(|k| match k {
                0 => C::from(t),
                1 => C::one(),
                _ => C::zero(),
            }),
        }
    }

    /// The same function with `J` ≤ `K` coefficients.
    #[inline]
    pub fn truncated<const J: usize>(&self) -> Taylor<C, J> {
        const { assert!(J <= K, "a series knows no more than its coefficients") };
        Taylor { coefficients: from_fn(|k| self.coefficients[k]) }
    }

    /// The k-th derivative at τ = 0, for k < `K`.
    ///
    /// # Panics
    ///
    /// If `k` ≥ `K`.
    #[inline]
    pub fn derivative(&self, k: usize) -> C {
        self.coefficients[k] * (1..=k).map(|i| i as f64).product::<f64>()
    }

    /// The value at a kink or a jump, of whose derivatives nothing is known.
    fn kinked(value: C) -> Self {
        Self { coefficients: from_fn(|k| if k == 0 { value } else { C::from(f64::NAN) }) }
    }

    /// `Σ_{i=1}^{k−1+last} i a_i b_{k−i}`, the sum in the recurrences of `y' = a' b`; with
    /// `last` = 0 the term i = k is left out.
    #[inline]
    fn derivative_product(a: &[C; K], b: &[C; K], k: usize, last: usize) -> C {
        let mut sum = C::zero();
        for i in 1..k + last {
            sum += a[i] * b[k - i] * i as f64;
        }
        sum
    }
}

impl<C: Scalar, const K: usize> From<f64> for Taylor<C, K> {
    #[inline]
    fn from(value: f64) -> Self {
        Self::constant(C::from(value))
    }
}

impl<C: Scalar, const K: usize> Neg for Taylor<C, K> {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        Self { coefficients: self.coefficients.map(|c| -c) }
    }
}

impl<C: Scalar, const K: usize> Add for Taylor<C, K> {
    type Output = Self;
    #[inline]
    fn add(self, other: Self) -> Self {
        Self { coefficients: from_fn(|k| self.coefficients[k] + other.coefficients[k]) }
    }
}

impl<C: Scalar, const K: usize> Sub for Taylor<C, K> {
    type Output = Self;
    #[inline]
    fn sub(self, other: Self) -> Self {
        Self { coefficients: from_fn(|k| self.coefficients[k] - other.coefficients[k]) }
    }
}

impl<C: Scalar, const K: usize> Mul for Taylor<C, K> {
    type Output = Self;
    #[inline]
    fn mul(self, other: Self) -> Self {
        let (a, b) = (&self.coefficients, &other.coefficients);
        Self {
            coefficients: from_fn(|k| {
                let mut sum = a[0] * b[k];
                for i in 1..=k {
                    sum += a[i] * b[k - i];
                }
                sum
            }),
        }
    }
}

impl<C: Scalar, const K: usize> Div for Taylor<C, K> {
    type Output = Self;
    #[inline]
    fn div(self, other: Self) -> Self {
        let (a, b) = (&self.coefficients, &other.coefficients);
        let mut q = [C::zero(); K];
        q[0] = a[0] / b[0];
        let reciprocal = C::one() / b[0];
        for k in 1..K {
            let mut rest = a[k];
            for i in 0..k {
                rest -= q[i] * b[k - i];
            }
            q[k] = rest * reciprocal;
        }
        Self { coefficients: q }
    }
}

impl<C: Scalar, const K: usize> Add<f64> for Taylor<C, K> {
    type Output = Self;
    #[inline]
    fn add(mut self, other: f64) -> Self {
        self.coefficients[0] = self.coefficients[0] + other;
        self
    }
}

impl<C: Scalar, const K: usize> Sub<f64> for Taylor<C, K> {
    type Output = Self;
    #[inline]
    fn sub(mut self, other: f64) -> Self {
        self.coefficients[0] = self.coefficients[0] - other;
        self
    }
}

impl<C: Scalar, const K: usize> Mul<f64> for Taylor<C, K> {
    type Output = Self;
    #[inline]
    fn mul(self, other: f64) -> Self {
        Self { coefficients: self.coefficients.map(|c| c * other) }
    }
}

impl<C: Scalar, const K: usize> Div<f64> for Taylor<C, K> {
    type Output = Self;
    #[inline]
    fn div(self, other: f64) -> Self {
        Self { coefficients: self.coefficients.map(|c| c / other) }
    }
}

derived_operators!([C: Scalar, const K: usize] Taylor<C, K>);

impl<C: Scalar, const K: usize> Scalar for Taylor<C, K> {
    #[inline]
    fn value(self) -> f64 {
        self.coefficients[0].value()
    }

    #[inline]
    fn compare(self, other: Self) -> Option<Ordering> {
        self.coefficients[0].compare(other.coefficients[0])
    }

    #[inline]
    fn abs(self) -> Self {
        match self.compare(Self::from(0.0)) {
            Some(Ordering::Less) => -self,
            Some(_) => self,
            None => Self::kinked(self.coefficients[0].abs()),
        }
    }

    #[inline]
    fn min(self, other: Self) -> Self {
        match other.compare(self) {
            Some(Ordering::Less) => other,
            Some(_) => self,
            None => Self::kinked(self.coefficients[0].min(other.coefficients[0])),
        }
    }

    #[inline]
    fn max(self, other: Self) -> Self {
        match other.compare(self) {
            Some(Ordering::Greater) => other,
            Some(_) => self,
            None => Self::kinked(self.coefficients[0].max(other.coefficients[0])),
        }
    }

    /// Of the two quotients the one that does not exceed 1.
    #[inline]
    fn atan2(self, x: Self) -> Self {
        // Across the negative half of the axis the angle jumps.
        let side = |s: Self| s.coefficients[0].compare(C::zero());
        if side(self).is_none() && side(x) != Some(Ordering::Greater) {
            return Self::kinked(self.coefficients[0].atan2(x.coefficients[0]));
        }
        let by_y = self.coefficients[0].abs().compare(x.coefficients[0].abs()) == Some(Ordering::Greater);
        let mut angle = if by_y { -(x / self).atan() } else { (self / x).atan() };
        angle.coefficients[0] = self.coefficients[0].atan2(x.coefficients[0]);
        angle
    }

    /// Each pair of a Cauchy product once.
    #[inline]
    fn squared(self) -> Self {
        let a = &self.coefficients;
        Self {
            coefficients: from_fn(|k| {
                if k == 0 {
                    return a[0].squared();
                }
                let mut sum = a[0] * a[k];
                for i in 1..k.div_ceil(2) {
                    sum += a[i] * a[k - i];
                }
                sum = sum * 2.0;
                if k % 2 == 0 { sum + a[k / 2].squared() } else { sum }
            }),
        }
    }

    /// From `y² = a`.
    #[inline]
    fn sqrt(self) -> Self {
        let a = &self.coefficients;
        let mut y = [C::zero(); K];
        y[0] = a[0].sqrt();
        let half = C::from(0.5) / y[0];
        for k in 1..K {
            let mut rest = a[k];
            for i in 1..k {
                rest -= y[i] * y[k - i];
            }
            y[k] = rest * half;
        }
        Self { coefficients: y }
    }

    /// From `y' = a' y`.
    #[inline]
    fn exp(self) -> Self {
        let a = &self.coefficients;
        let mut y = [C::zero(); K];
        y[0] = a[0].exp();
        for k in 1..K {
            y[k] = Self::derivative_product(a, &y, k, 1) * (1.0 / k as f64);
        }
        Self { coefficients: y }
    }

    /// From `a y' = a'`.
    #[inline]
    fn ln(self) -> Self {
        let a = &self.coefficients;
        let mut y = [C::zero(); K];
        y[0] = a[0].ln();
        let slope = C::one() / a[0];
        for k in 1..K {
            y[k] = (a[k] - Self::derivative_product(&y, a, k, 0) * (1.0 / k as f64)) * slope;
        }
        Self { coefficients: y }
    }

    /// From `s' = a' c`, `c' = −a' s`.
    #[inline]
    fn sin_cos(self) -> (Self, Self) {
        let a = &self.coefficients;
        let (mut s, mut c) = ([C::zero(); K], [C::zero(); K]);
        (s[0], c[0]) = a[0].sin_cos();
        for k in 1..K {
            s[k] = Self::derivative_product(a, &c, k, 1) * (1.0 / k as f64);
            c[k] = -Self::derivative_product(a, &s, k, 1) * (1.0 / k as f64);
        }
        (Self { coefficients: s }, Self { coefficients: c })
    }

    /// From `(1 + a²) y' = a'`.
    #[inline]
    fn atan(self) -> Self {
        let a = &self.coefficients;
        let d = (self * self + 1.0).coefficients;
        let mut y = [C::zero(); K];
        y[0] = a[0].atan();
        let slope = C::one() / d[0];
        for k in 1..K {
            y[k] = (a[k] - Self::derivative_product(&y, &d, k, 0) * (1.0 / k as f64)) * slope;
        }
        Self { coefficients: y }
    }

    /// From `y' = a' (1 − y²)`.
    #[inline]
    fn tanh(self) -> Self {
        let a = &self.coefficients;
        let (mut y, mut d) = ([C::zero(); K], [C::zero(); K]);
        y[0] = a[0].tanh();
        d[0] = -y[0].squared() + 1.0;
        for k in 1..K {
            y[k] = Self::derivative_product(a, &d, k, 1) * (1.0 / k as f64);
            for i in 0..=k {
                d[k] -= y[i] * y[k - i];
            }
        }
        Self { coefficients: y }
    }

    /// From `a y' = p a' y`.
    #[inline]
    fn powf(self, exponent: f64) -> Self {
        let a = &self.coefficients;
        let mut y = [C::zero(); K];
        y[0] = a[0].powf(exponent);
        let reciprocal = C::one() / a[0];
        let next = C::from(exponent) + 1.0;
        for k in 1..K {
            let mut sum = C::zero();
            for i in 1..=k {
                sum += a[i] * y[k - i] * (next * i as f64 - k as f64);
            }
            y[k] = sum * reciprocal * (1.0 / k as f64);
        }
        Self { coefficients: y }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::jet::Dual;

    type Jet = Taylor<Dual<1>, 6>;

    /// a(τ) = 0.7 + 0.3 τ − 0.2 τ² + …, its constant term also the direction of the dual part.
    fn sample() -> Jet {
        let mut a = Jet::constant(Dual::variable(0.7, 0));
        for (k, c) in [0.3, -0.2, 0.11, 0.05, -0.4].into_iter().enumerate() {
            a.coefficients[k + 1] = Dual::from(c);
        }
        a
    }

    /// Coefficients agree to a few units of round-off of their own size (here of order 1 to 10).
    #[track_caller]
    fn assert_close(left: Jet, right: Jet) {
        for k in 0..6 {
            let (l, r) = (left.coefficients[k], right.coefficients[k]);
            assert!((l.value - r.value).abs() < 1e-13, "value {k}: {l:?} {r:?}");
            assert!((l.gradient[0] - r.gradient[0]).abs() < 1e-12, "gradient {k}: {l:?} {r:?}");
        }
    }

    #[test]
    fn inverse_functions_cancel() {
        let a = sample();
        assert_close(a.sqrt().squared(), a);
        assert_close(a.exp().ln(), a);
        assert_close(a.tan().atan(), a);
        assert_close(a / a, Jet::from(1.0));
        assert_close(a.powf(2.5).powf(0.4), a);
        assert_close(a.powi(-3) * a.powi(3), Jet::from(1.0));
    }

    #[test]
    fn identities_hold() {
        let a = sample();
        let (s, c) = a.sin_cos();
        assert_close(s.squared() + c.squared(), Jet::from(1.0));
        assert_close((a * 2.0).sin(), s * c * 2.0);
        assert_close(a.powf(0.5), a.sqrt());
        assert_close(a.powi(5), a.powf(5.0));
        assert_close((a + a).exp(), a.exp().squared());
        let e = (a + a).exp();
        assert_close(a.tanh(), (e - 1.0) / (e + 1.0));
    }

    /// In each octant: tangent, and the value that plain numbers have.
    #[test]
    fn angles_of_points() {
        let a = sample();
        for (y, x) in [(a, a + 1.0), (a + 1.0, a), (a + 1.0, -a), (a, -a - 1.0)] {
            for (y, x) in [(y, x), (-y, x)] {
                let angle = y.atan2(x);
                assert_close(angle.tan(), y / x);
                // Two roundings of numbers up to π.
                assert!((angle.value() - y.value().atan2(x.value())).abs() < 1e-15);
            }
        }
        assert!(!Jet::from(0.0).atan2(Jet::from(0.0)).coefficients[1].gradient[0].is_finite());
    }

    #[test]
    fn kinks_take_the_first() {
        let a = sample();
        assert_eq!((-a).abs(), a);
        assert_eq!((a.abs(), a.min(a + 1.0), a.max(a - 1.0)), (a, a, a));
        assert_eq!(((a + 1.0).min(a), (a - 1.0).max(a)), (a, a));
        // A tie: `self`.
        let steeper = Jet::constant(a.coefficients[0]);
        assert_eq!((a.min(steeper), a.max(steeper), steeper.min(a)), (a, a, steeper));
        let t = Taylor::<f64, 3>::time(0.0);
        assert_eq!(t.abs(), t);
        let nan = Jet::from(f64::NAN);
        assert!(a.min(nan).value().is_nan() && nan.min(a).value().is_nan());
        assert!(a.max(nan).value().is_nan() && nan.max(a).value().is_nan());
    }

    #[test]
    fn time_polynomial_has_its_derivatives() {
        // t³ at t = 2: 8, 12, 12, 6, 0.
        let cube = Taylor::<f64, 5>::time(2.0).powi(3);
        assert_eq!([0, 1, 2, 3, 4].map(|k| cube.derivative(k)), [8.0, 12.0, 12.0, 6.0, 0.0]);
    }

    #[test]
    fn powers_at_zero_are_exact() {
        let square = Taylor::<f64, 4>::time(0.0).powi(2);
        assert_eq!(square.coefficients, [0.0, 0.0, 1.0, 0.0]);
        assert_eq!(Taylor::<f64, 4>::time(0.0).powi(0).coefficients, [1.0, 0.0, 0.0, 0.0]);
    }
}
