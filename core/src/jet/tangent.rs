//! Numbers of any kind with their derivative along one direction.

use core::cmp::Ordering;
use core::ops::{Add, Div, Mul, Neg, Sub};

use super::derived_operators;
use crate::scalar::Scalar;

/// `v + d ε` with `ε² = 0` over any scalar. With a [`Dual`](super::Dual) inside it is the gradient and its
/// derivative along a further direction: second derivatives are made of these.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tangent<C> {
    /// The value.
    pub value: C,
    /// Its derivative along the direction.
    pub directional: C,
}

impl<C: Scalar> Tangent<C> {
    /// `φ(self)` from `φ`'s value and slope at `self.value` (the chain rule).
    #[inline]
    fn chain(self, value: C, slope: C) -> Self {
        Self { value, directional: self.directional * slope }
    }

    /// At a kink only the value is known.
    #[cold]
    fn kinked(value: C) -> Self {
        Self { value, directional: C::zero() / C::zero() }
    }
}

impl<C: Scalar> From<f64> for Tangent<C> {
    #[inline]
    fn from(value: f64) -> Self {
        Self { value: C::from(value), directional: C::zero() }
    }
}

impl<C: Scalar> Neg for Tangent<C> {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        Self { value: -self.value, directional: -self.directional }
    }
}

impl<C: Scalar> Add for Tangent<C> {
    type Output = Self;
    #[inline]
    fn add(self, other: Self) -> Self {
        Self { value: self.value + other.value, directional: self.directional + other.directional }
    }
}

impl<C: Scalar> Sub for Tangent<C> {
    type Output = Self;
    #[inline]
    fn sub(self, other: Self) -> Self {
        Self { value: self.value - other.value, directional: self.directional - other.directional }
    }
}

impl<C: Scalar> Mul for Tangent<C> {
    type Output = Self;
    #[inline]
    fn mul(self, other: Self) -> Self {
        Self {
            value: self.value * other.value,
            directional: self.directional * other.value + self.value * other.directional,
        }
    }
}

impl<C: Scalar> Div for Tangent<C> {
    type Output = Self;
    #[inline]
    fn div(self, other: Self) -> Self {
        let value = self.value / other.value;
        Self { value, directional: (self.directional - value * other.directional) / other.value }
    }
}

impl<C: Scalar> Add<f64> for Tangent<C> {
    type Output = Self;
    #[inline]
    fn add(self, other: f64) -> Self {
        Self { value: self.value + other, ..self }
    }
}

impl<C: Scalar> Sub<f64> for Tangent<C> {
    type Output = Self;
    #[inline]
    fn sub(self, other: f64) -> Self {
        Self { value: self.value - other, ..self }
    }
}

impl<C: Scalar> Mul<f64> for Tangent<C> {
    type Output = Self;
    #[inline]
    fn mul(self, other: f64) -> Self {
        Self { value: self.value * other, directional: self.directional * other }
    }
}

impl<C: Scalar> Div<f64> for Tangent<C> {
    type Output = Self;
    #[inline]
    fn div(self, other: f64) -> Self {
        Self { value: self.value / other, directional: self.directional / other }
    }
}

derived_operators!([C: Scalar] Tangent<C>);

impl<C: Scalar> Scalar for Tangent<C> {
    #[inline]
    fn value(self) -> f64 {
        self.value.value()
    }
    #[inline]
    fn sqrt(self) -> Self {
        let root = self.value.sqrt();
        self.chain(root, C::from(0.5) / root)
    }
    #[inline]
    fn exp(self) -> Self {
        let value = self.value.exp();
        self.chain(value, value)
    }
    #[inline]
    fn ln(self) -> Self {
        self.chain(self.value.ln(), C::one() / self.value)
    }
    #[inline]
    fn sin_cos(self) -> (Self, Self) {
        let (sin, cos) = self.value.sin_cos();
        (self.chain(sin, cos), self.chain(cos, -sin))
    }
    #[inline]
    fn atan(self) -> Self {
        self.chain(self.value.atan(), C::one() / (self.value.squared() + 1.0))
    }
    #[inline]
    fn tanh(self) -> Self {
        let value = self.value.tanh();
        self.chain(value, C::one() - value.squared())
    }
    #[inline]
    fn powf(self, exponent: f64) -> Self {
        self.chain(self.value.powf(exponent), self.value.powf(exponent - 1.0) * exponent)
    }

    #[inline]
    fn compare(self, other: Self) -> Option<Ordering> {
        self.value.compare(other.value)
    }

    #[inline]
    fn abs(self) -> Self {
        match self.compare(Self::from(0.0)) {
            Some(Ordering::Less) => -self,
            Some(_) => self,
            None => Self::kinked(self.value.abs()),
        }
    }

    #[inline]
    fn min(self, other: Self) -> Self {
        match other.compare(self) {
            Some(Ordering::Less) => other,
            Some(_) => self,
            None => Self::kinked(self.value.min(other.value)),
        }
    }

    #[inline]
    fn max(self, other: Self) -> Self {
        match other.compare(self) {
            Some(Ordering::Greater) => other,
            Some(_) => self,
            None => Self::kinked(self.value.max(other.value)),
        }
    }

    /// Of the two quotients the one that does not exceed 1.
    #[inline]
    fn atan2(self, x: Self) -> Self {
        // Across the negative half of the axis the angle jumps.
        let side = |s: C| s.compare(C::zero());
        let value = self.value.atan2(x.value);
        if side(self.value).is_none() && side(x.value) != Some(Ordering::Greater) {
            return Self::kinked(value);
        }
        let by_y = self.value.abs().compare(x.value.abs()) == Some(Ordering::Greater);
        let angle = if by_y { -(x / self).atan() } else { (self / x).atan() };
        Self { value, ..angle }
    }

    #[inline]
    fn squared(self) -> Self {
        self.chain(self.value.squared(), self.value * 2.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::jet::Dual;

    /// Every operation, at arguments where all are smooth.
    fn operations<S: Scalar>(a: S, b: S) -> [S; 12] {
        let (sin, cos) = a.sin_cos();
        [
            a * b - a / b,
            (-a) / 3.0 + 1.0,
            (b * 2.0 - 0.5).squared(),
            a.sqrt(),
            (a - b).exp(),
            b.ln(),
            sin * b,
            cos.atan(),
            a.powf(1.7),
            b.powi(-3),
            a.tanh(),
            (a - b).atan2(b),
        ]
    }

    /// On plain numbers it is a dual number of one direction; over dual numbers, second derivatives are
    /// symmetric.
    #[test]
    fn first_derivatives_agree_and_second_ones_are_symmetric() {
        let (a, b) = (0.7, 1.3);
        let plain = |value, directional| Tangent { value, directional };
        let dual = |value, along| Dual { value, gradient: [along] };
        let found = operations(plain(a, 0.4), plain(b, -0.2));
        let wanted = operations(dual(a, 0.4), dual(b, -0.2));
        for (i, (found, wanted)) in found.iter().zip(wanted).enumerate() {
            assert_eq!(found.value, wanted.value, "operation {i}");
            // Of order 1, computed in another order.
            assert!((found.directional - wanted.gradient[0]).abs() < 1e-14, "operation {i}");
        }
        // The directions p and q, each inside and outside.
        let (p, q) = ([0.4, -0.2], [0.1, 0.6]);
        let both = |inner: [f64; 2], outer: [f64; 2]| {
            let number = |v: f64, i: usize| Tangent {
                value: Dual { value: v, gradient: [inner[i]] },
                directional: Dual { value: outer[i], gradient: [0.0] },
            };
            operations(number(a, 0), number(b, 1)).map(|s| s.directional.gradient[0])
        };
        for (i, (pq, qp)) in both(p, q).into_iter().zip(both(q, p)).enumerate() {
            assert!((pq - qp).abs() < 1e-13 && pq.is_finite(), "operation {i}: {pq} {qp}");
        }
    }
}
