//! The operations a model may use, so that a plant or barrier is written once and evaluated on
//! numbers ([`f64`]), on first derivatives ([`Dual`](crate::jet::Dual)) and on Taylor series
//! ([`Taylor`](crate::jet::Taylor)).

use core::cmp::Ordering;
use core::fmt::Debug;
use core::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

use num_traits::{One, Zero};

use crate::elementary;

/// A number that plants and barriers compute with.
///
/// Arithmetic mixes with `f64` on the right (`x * 2.0`); a constant on the left is
/// `S::from(2.0) * x`. Functions follow their `f64` namesakes where those are smooth; outside the
/// domain (`sqrt` of a negative number) and at singular points (`sqrt` at 0) a result or one of its
/// derivatives is not finite, which the filter reports as a status.
pub trait Scalar:
    Copy
    + Debug
    + PartialEq
    + 'static
    + Zero
    + One
    + From<f64>
    + Neg<Output = Self>
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Add<f64, Output = Self>
    + Sub<f64, Output = Self>
    + Mul<f64, Output = Self>
    + Div<f64, Output = Self>
    + AddAssign
    + SubAssign
    + MulAssign
    + DivAssign
{
    /// The plain value, without derivatives.
    fn value(self) -> f64;
    /// Square root.
    #[must_use]
    fn sqrt(self) -> Self;
    /// e to the power of `self`.
    #[must_use]
    fn exp(self) -> Self;
    /// Natural logarithm.
    #[must_use]
    fn ln(self) -> Self;
    /// Sine and cosine; the angle is in radians.
    #[must_use]
    fn sin_cos(self) -> (Self, Self);
    /// Arc tangent, in radians.
    #[must_use]
    fn atan(self) -> Self;
    /// Hyperbolic tangent.
    #[must_use]
    fn tanh(self) -> Self;
    /// `self` to a real power; smooth for `self` > 0.
    #[must_use]
    fn powf(self, exponent: f64) -> Self;

    /// How its value compares with that of `other`. `None` where that is not known: one is not a number, or both are
    /// [enclosures](crate::interval::Interval) that overlap.
    #[inline]
    fn compare(self, other: Self) -> Option<Ordering> {
        self.value().partial_cmp(&other.value())
    }

    /// |`self`|, with the derivatives of `self` itself at the kink 0.
    #[must_use]
    #[inline]
    fn abs(self) -> Self {
        if self.value() < 0.0 { -self } else { self }
    }

    /// The smaller of two, with its derivatives: those of `self` where they are equal. Not a number if one is.
    #[must_use]
    #[inline]
    fn min(self, other: Self) -> Self {
        if other.value() < self.value() || other.value().is_nan() { other } else { self }
    }

    /// The larger of two, with its derivatives: those of `self` where they are equal. Not a number if one is.
    #[must_use]
    #[inline]
    fn max(self, other: Self) -> Self {
        if other.value() > self.value() || other.value().is_nan() { other } else { self }
    }

    /// Sine of an angle in radians.
    #[must_use]
    #[inline]
    fn sin(self) -> Self {
        self.sin_cos().0
    }

    /// Cosine of an angle in radians.
    #[must_use]
    #[inline]
    fn cos(self) -> Self {
        self.sin_cos().1
    }

    /// Tangent of an angle in radians.
    #[must_use]
    #[inline]
    fn tan(self) -> Self {
        let (sin, cos) = self.sin_cos();
        sin / cos
    }

    /// √(self² + other²); its derivatives are 0 where both are 0.
    #[must_use]
    #[inline]
    fn hypot(self, other: Self) -> Self {
        let is_nothing = |v: Self| v.compare(Self::zero()) == Some(Ordering::Equal);
        if is_nothing(self) && is_nothing(other) {
            return Self::zero();
        }
        (self.squared() + other.squared()).sqrt()
    }

    /// The angle in radians of the point (`x`, `self`), from −π to π; singular at the origin.
    #[must_use]
    #[inline]
    fn atan2(self, x: Self) -> Self {
        // Of the two quotients the one that does not exceed 1; the branch is that of the values.
        let angle =
            if self.value().abs() <= x.value().abs() { (self / x).atan() } else { -(x / self).atan() };
        angle - angle.value() + elementary::atan2(self.value(), x.value())
    }

    /// `self · self`.
    #[must_use]
    #[inline]
    fn squared(self) -> Self {
        self * self
    }

    /// `self` to an integer power, by repeated multiplication: exact at 0 and for negative `self`.
    #[must_use]
    #[inline]
    fn powi(self, exponent: i32) -> Self {
        let mut result = Self::one();
        let mut base = self;
        let mut left = exponent.unsigned_abs();
        while left > 0 {
            if left & 1 == 1 {
                result *= base;
            }
            left >>= 1;
            if left > 0 {
                base = base * base;
            }
        }
        if exponent < 0 { Self::one() / result } else { result }
    }
}

impl Scalar for f64 {
    #[inline]
    fn value(self) -> f64 {
        self
    }
    #[inline]
    fn sqrt(self) -> Self {
        elementary::sqrt(self)
    }
    #[inline]
    fn exp(self) -> Self {
        elementary::exp(self)
    }
    #[inline]
    fn ln(self) -> Self {
        elementary::ln(self)
    }
    #[inline]
    fn sin_cos(self) -> (Self, Self) {
        elementary::sin_cos(self)
    }
    #[inline]
    fn atan(self) -> Self {
        elementary::atan(self)
    }
    #[inline]
    fn hypot(self, other: Self) -> Self {
        elementary::hypot(self, other)
    }
    #[inline]
    fn atan2(self, x: Self) -> Self {
        elementary::atan2(self, x)
    }
    #[inline]
    fn tanh(self) -> Self {
        elementary::tanh(self)
    }
    #[inline]
    fn powf(self, exponent: f64) -> Self {
        elementary::powf(self, exponent)
    }
}

/// Whether all of `values` are finite, without a branch per number.
#[inline]
pub(crate) fn all_finite(values: &[f64]) -> bool {
    const EXPONENT: u64 = 0x7ff0_0000_0000_0000;
    const ONE: u64 = 1 << 52;
    // The largest exponent, that of infinities and NaN, carries into the sign.
    values.iter().fold(0, |carry, v| carry | ((v.to_bits() & EXPONENT) + ONE)) >> 63 == 0
}
