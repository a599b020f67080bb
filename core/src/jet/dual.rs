//! Dual numbers: a value and its first derivatives along `M` directions.

use core::array::from_fn;
use core::ops::{Add, Div, Mul, Neg, Sub};

use super::derived_operators;
use crate::elementary;
use crate::scalar::Scalar;

/// `v + Σ d_m ε_m` with `ε_i ε_j = 0`: a value and its gradient.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dual<const M: usize> {
    /// The value.
    pub value: f64,
    /// The derivative along each of the `M` directions.
    pub gradient: [f64; M],
}

impl<const M: usize> Dual<M> {
    /// A variable: `value`, with derivative 1 along `direction` and 0 along the others.
    ///
    /// # Panics
    ///
    /// If `direction` ≥ `M`.
    #[inline]
    pub fn variable(value: f64, direction: usize) -> Self {
        let mut gradient = [0.0; M];
        gradient[direction] = 1.0;
        Self { value, gradient }
    }

    /// `φ(self)` from `φ`'s value and slope at `self.value` (the chain rule).
    #[inline]
    fn chain(self, value: f64, slope: f64) -> Self {
        Self { value, gradient: self.gradient.map(|d| d * slope) }
    }
}

impl<const M: usize> From<f64> for Dual<M> {
    #[inline]
    fn from(value: f64) -> Self {
        Self { value, gradient: [0.0; M] }
    }
}

impl<const M: usize> Neg for Dual<M> {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        self.chain(-self.value, -1.0)
    }
}

impl<const M: usize> Add for Dual<M> {
    type Output = Self;
    #[inline]
    fn add(self, other: Self) -> Self {
        Self { value: self.value + other.value, gradient: from_fn(|m| self.gradient[m] + other.gradient[m]) }
    }
}

impl<const M: usize> Sub for Dual<M> {
    type Output = Self;
    #[inline]
    fn sub(self, other: Self) -> Self {
        Self { value: self.value - other.value, gradient: from_fn(|m| self.gradient[m] - other.gradient[m]) }
    }
}

impl<const M: usize> Mul for Dual<M> {
    type Output = Self;
    #[inline]
    fn mul(self, other: Self) -> Self {
        Self {
            value: self.value * other.value,
            gradient: from_fn(|m| self.gradient[m] * other.value + self.value * other.gradient[m]),
        }
    }
}

impl<const M: usize> Div for Dual<M> {
    type Output = Self;
    #[inline]
    fn div(self, other: Self) -> Self {
        let value = self.value / other.value;
        Self { value, gradient: from_fn(|m| (self.gradient[m] - value * other.gradient[m]) / other.value) }
    }
}

impl<const M: usize> Add<f64> for Dual<M> {
    type Output = Self;
    #[inline]
    fn add(self, other: f64) -> Self {
        Self { value: self.value + other, ..self }
    }
}

impl<const M: usize> Sub<f64> for Dual<M> {
    type Output = Self;
    #[inline]
    fn sub(self, other: f64) -> Self {
        Self { value: self.value - other, ..self }
    }
}

impl<const M: usize> Mul<f64> for Dual<M> {
    type Output = Self;
    #[inline]
    fn mul(self, other: f64) -> Self {
        self.chain(self.value * other, other)
    }
}

impl<const M: usize> Div<f64> for Dual<M> {
    type Output = Self;
    #[inline]
    fn div(self, other: f64) -> Self {
        Self { value: self.value / other, gradient: self.gradient.map(|d| d / other) }
    }
}

derived_operators!([const M: usize] Dual<M>);

impl<const M: usize> Scalar for Dual<M> {
    #[inline]
    fn value(self) -> f64 {
        self.value
    }
    #[inline]
    fn sqrt(self) -> Self {
        let root = elementary::sqrt(self.value);
        self.chain(root, 0.5 / root)
    }
    #[inline]
    fn exp(self) -> Self {
        let value = elementary::exp(self.value);
        self.chain(value, value)
    }
    #[inline]
    fn ln(self) -> Self {
        self.chain(elementary::ln(self.value), 1.0 / self.value)
    }
    #[inline]
    fn sin_cos(self) -> (Self, Self) {
        let (sin, cos) = elementary::sin_cos(self.value);
        (self.chain(sin, cos), self.chain(cos, -sin))
    }
    #[inline]
    fn atan(self) -> Self {
        self.chain(elementary::atan(self.value), 1.0 / (1.0 + self.value * self.value))
    }
    #[inline]
    fn tanh(self) -> Self {
        let value = elementary::tanh(self.value);
        self.chain(value, 1.0 - value * value)
    }
    #[inline]
    fn powf(self, exponent: f64) -> Self {
        self.chain(
            elementary::powf(self.value, exponent),
            exponent * elementary::powf(self.value, exponent - 1.0),
        )
    }
}
