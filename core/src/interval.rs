//! Numbers that are known to lie between two others: what a function takes on a whole stretch of a path, not at instants.
//!
//! A plant or a barrier evaluated on [`Interval`]s gives one that holds every value it takes on any numbers within them. On
//! [`Taylor`](crate::jet::Taylor) series of intervals it gives such an interval for each coefficient. A function that compares
//! by [`Scalar::value`] and goes one of two ways shows one of them alone; [`Scalar::min`], [`Scalar::max`] and
//! [`Scalar::abs`] show both. A function is taken to be defined where it is asked: the square root of −1 to 4 is 0 to 2.
//!
//! Bounds are rounded to nearest, so they are off by round-off.
//!
//! Source: R. E. Moore, R. B. Kearfott and M. J. Cloud, *Introduction to Interval Analysis*, SIAM (2009), chapters 2 and 5.

use core::cmp::Ordering;
use core::f64::consts::{FRAC_PI_2, PI, TAU};
use core::ops::{Add, Div, Mul, Neg, Sub};

use crate::elementary;
use crate::jet::derived_operators;
use crate::scalar::Scalar;

/// All numbers from `low` to `high`; either may be infinite.
///
/// ```
/// use punctual_core::interval::Interval;
/// use punctual_core::scalar::Scalar;
///
/// let x = Interval::new(-1.0, 2.0);
/// assert_eq!(x.squared(), Interval::new(0.0, 4.0));
/// assert_eq!((x * 2.0).min(Interval::from(1.0)), Interval::new(-2.0, 1.0));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// The least one.
    pub low: f64,
    /// The largest one.
    pub high: f64,
}

impl Interval {
    /// All numbers.
    pub const ALL: Self = Self { low: f64::NEG_INFINITY, high: f64::INFINITY };

    /// From `low` to `high`; all numbers where one of them is not a number.
    #[must_use]
    #[inline]
    pub fn new(low: f64, high: f64) -> Self {
        if low.is_nan() || high.is_nan() { Self::unknown() } else { Self { low, high } }
    }

    /// All numbers, out of the way of what is common.
    #[cold]
    fn unknown() -> Self {
        Self::ALL
    }

    /// The product where a bound may be infinite. Nothing times anything is nothing, however large that may be.
    #[cold]
    fn product(self, other: Self) -> Self {
        let product = |a: f64, b: f64| if a == 0.0 || b == 0.0 { 0.0 } else { a * b };
        let all = |a: f64| [product(a, other.low), product(a, other.high)];
        let [[a, b], [c, d]] = [all(self.low), all(self.high)];
        Self::around([a, b, c, d])
    }

    /// Whether `number` is among them.
    pub fn contains(self, number: f64) -> bool {
        self.low <= number && number <= self.high
    }

    /// The values of a function that rises with its argument.
    fn rising(self, function: impl Fn(f64) -> f64) -> Self {
        Self::new(function(self.low), function(self.high))
    }

    /// From the least to the largest of four numbers.
    #[inline]
    fn around(four: [f64; 4]) -> Self {
        let [a, b, c, d] = four;
        Self { low: least(least(a, b), least(c, d)), high: largest(largest(a, b), largest(c, d)) }
    }

    /// Whether it has a number `at` + k · 2π.
    fn turns_through(self, at: f64) -> bool {
        libm::ceil((self.low - at) / TAU) * TAU + at <= self.high
    }
}

/// Half the width of an angle whose sine and cosine are enclosed by those of its middle: one evaluation in place of four.
const NARROW: f64 = 0.05;

/// The lesser of two numbers: one instruction, where one that looks for NaN has several.
#[inline]
fn least(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

/// The larger of two numbers.
#[inline]
fn largest(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

impl From<f64> for Interval {
    #[inline]
    fn from(value: f64) -> Self {
        Self::new(value, value)
    }
}

impl Neg for Interval {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        Self { low: -self.high, high: -self.low }
    }
}

impl Add for Interval {
    type Output = Self;
    #[inline]
    fn add(self, other: Self) -> Self {
        Self::new(self.low + other.low, self.high + other.high)
    }
}

impl Sub for Interval {
    type Output = Self;
    #[inline]
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Mul for Interval {
    type Output = Self;
    #[inline]
    fn mul(self, other: Self) -> Self {
        let [a, b] = [self.low * other.low, self.low * other.high];
        let [c, d] = [self.high * other.low, self.high * other.high];
        // Finite but where one of them is not, or near the largest numbers.
        if ((a + b) + (c + d)).is_finite() { Self::around([a, b, c, d]) } else { self.product(other) }
    }
}

impl Div for Interval {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        if other.contains(0.0) {
            return Self::ALL;
        }
        self * Self { low: 1.0 / other.high, high: 1.0 / other.low }
    }
}

impl Add<f64> for Interval {
    type Output = Self;
    #[inline]
    fn add(self, other: f64) -> Self {
        Self::new(self.low + other, self.high + other)
    }
}

impl Sub<f64> for Interval {
    type Output = Self;
    #[inline]
    fn sub(self, other: f64) -> Self {
        self + -other
    }
}

impl Div<f64> for Interval {
    type Output = Self;
    fn div(self, other: f64) -> Self {
        self / Self::from(other)
    }
}

impl Mul<f64> for Interval {
    type Output = Self;
    #[inline]
    fn mul(self, other: f64) -> Self {
        let [a, b] = [self.low * other, self.high * other];
        if (a + b).is_finite() {
            Self { low: least(a, b), high: largest(a, b) }
        } else {
            self.product(other.into())
        }
    }
}

derived_operators!([] Interval);

impl Scalar for Interval {
    /// The middle.
    fn value(self) -> f64 {
        0.5 * self.low + 0.5 * self.high
    }

    fn sqrt(self) -> Self {
        self.max(Self::from(0.0)).rising(elementary::sqrt)
    }

    fn exp(self) -> Self {
        self.rising(elementary::exp)
    }

    fn ln(self) -> Self {
        self.max(Self::from(0.0)).rising(elementary::ln)
    }

    fn sin_cos(self) -> (Self, Self) {
        let (middle, half) = (self.value(), 0.5 * (self.high - self.low));
        if half <= NARROW {
            let (sin, cos) = elementary::sin_cos(middle);
            // With d = `half`: |v| cos d ± |slope| sin d at the ends, 1 − d²/2 ≤ cos d ≤ 1 − d²/2 + d⁴/24, sin d ≤ d, and the
            // largest value between them where |slope| ≤ |v| tan d.
            let square = half * half;
            let around = |v: f64, slope: f64| {
                let (size, change) = (v.abs(), slope.abs() * half);
                let near = size * (1.0 - 0.5 * square);
                let turns = slope.abs() <= size * half * (1.0 + square);
                let far = if turns { 1.0 } else { near + size * square * square / 24.0 + change };
                let positive = Self { low: near - change, high: far };
                if v < 0.0 { -positive } else { positive }
            };
            return (around(sin, cos), around(cos, sin));
        }
        let wave = |function: fn(f64) -> f64, top: f64| {
            let (a, b) = (function(self.low), function(self.high));
            Self::new(
                if self.turns_through(top + PI) { -1.0 } else { a.min(b) },
                if self.turns_through(top) { 1.0 } else { a.max(b) },
            )
        };
        if self.high - self.low < TAU {
            (wave(elementary::sin, FRAC_PI_2), wave(elementary::cos, 0.0))
        } else {
            let any = Self { low: -1.0, high: 1.0 };
            (any, any)
        }
    }

    fn atan(self) -> Self {
        self.rising(elementary::atan)
    }

    fn tanh(self) -> Self {
        self.rising(elementary::tanh)
    }

    fn powf(self, exponent: f64) -> Self {
        // Whole powers are those of negative numbers too.
        let base = match exponent % 2.0 {
            0.0 => self.abs(),
            part if part.abs() == 1.0 && (exponent > 0.0 || !self.contains(0.0)) => self,
            part if part.abs() == 1.0 => return Self::ALL,
            _ => self.max(Self::from(0.0)),
        };
        let Self { low, high } = base.rising(|v| elementary::powf(v, exponent));
        Self { low: low.min(high), high: low.max(high) }
    }

    fn compare(self, other: Self) -> Option<Ordering> {
        match () {
            () if self.high < other.low => Some(Ordering::Less),
            () if self.low > other.high => Some(Ordering::Greater),
            () if self.low == self.high && self == other => Some(Ordering::Equal),
            () => None,
        }
    }

    #[inline]
    fn abs(self) -> Self {
        let far = self.high.max(-self.low);
        Self { low: self.low.max(-self.high).max(0.0), high: far }
    }

    fn min(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.min(other.high) }
    }

    fn max(self, other: Self) -> Self {
        Self { low: self.low.max(other.low), high: self.high.max(other.high) }
    }

    fn hypot(self, other: Self) -> Self {
        (self.squared() + other.squared()).sqrt()
    }

    fn atan2(self, x: Self) -> Self {
        let any = Self { low: -PI, high: PI };
        // Across the negative half of the axis the angle jumps.
        if self.contains(0.0) && x.low <= 0.0 {
            return any;
        }
        let angle = elementary::atan2;
        let four = [
            angle(self.low, x.low),
            angle(self.low, x.high),
            angle(self.high, x.low),
            angle(self.high, x.high),
        ];
        if four.iter().any(|v| v.is_nan()) { any } else { Self::around(four) }
    }

    #[inline]
    fn squared(self) -> Self {
        let Self { low, high } = self.abs();
        Self::new(low * low, high * high)
    }

    fn powi(self, exponent: i32) -> Self {
        let base = if exponent % 2 == 0 { self.abs() } else { self };
        let power = base.rising(|v| elementary::powi(v, exponent.unsigned_abs() as i32));
        if exponent < 0 { Self::from(1.0) / power } else { power }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::jet::Taylor;

    /// Operations on two numbers, `b` > 0.
    fn operations<S: Scalar>(a: S, b: S) -> [S; 23] {
        let (sin, cos) = a.sin_cos();
        [
            a + b,
            a - b * 2.0,
            a * b,
            a / b,
            a.squared(),
            a.powi(3),
            a.powi(-2),
            b.sqrt(),
            a.exp(),
            b.ln(),
            sin,
            cos,
            a.atan(),
            a.tanh(),
            b.powf(1.7),
            a.powf(4.0),
            a.powf(3.0),
            a.powf(-3.0),
            a.abs(),
            a.min(b),
            a.max(b),
            a.hypot(b),
            a.atan2(b),
        ]
    }

    fn draw(seed: &mut u64) -> f64 {
        *seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (*seed >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// What an operation gives on numbers lies in what it gives on intervals of them, and these are no larger than they
    /// must be: their bounds are values too, but for the operations that see one operand twice.
    #[test]
    fn operations_enclose_their_values_tightly() {
        let mut seed = 7;
        for _ in 0..2000 {
            let (a, b) = (8.0 * draw(&mut seed) - 4.0, 0.1 + 4.0 * draw(&mut seed));
            let (wide, long) = (3.0 * draw(&mut seed).powi(3), 3.0 * draw(&mut seed).powi(3));
            let found = operations(Interval::new(a, a + wide), Interval::new(b, b + long));
            let mut seen = [(f64::INFINITY, f64::NEG_INFINITY); 23];
            const PARTS: u32 = 24;
            for (i, j) in (0..=PARTS).flat_map(|i| (0..=PARTS).map(move |j| (i, j))) {
                let part = |from: f64, all: f64, k: u32| from + all * f64::from(k) / f64::from(PARTS);
                for (k, value) in operations(part(a, wide, i), part(b, long, j)).into_iter().enumerate() {
                    // One rounding of numbers up to e⁷.
                    let slack = 1e-12 * (1.0 + value.abs());
                    assert!(
                        found[k].low - slack <= value && value <= found[k].high + slack,
                        "{k}: {a} {wide}"
                    );
                    seen[k] = (seen[k].0.min(value), seen[k].1.max(value));
                }
            }
            for (k, (low, high)) in seen.into_iter().enumerate() {
                // a⁻² has no bound at 0, and a turning point lies between two parts: half a part's square at most.
                let slack = 1e-9 + 0.05 * (high - low);
                let bounded = ![6, 17].contains(&k) || a > 0.0 || a + wide < 0.0;
                let fits = found[k].low >= low - slack && found[k].high <= high + slack;
                assert!(!bounded || fits, "{k}: {:?} {low} {high}", found[k]);
            }
        }
    }

    /// The coefficients of a function along a path, from wherever on a stretch of it they begin, lie in those of the stretch.
    #[test]
    fn series_of_intervals_enclose_every_series() {
        fn h<S: Scalar>(x: S, y: S) -> S {
            let bump = (-(x - 1.0).squared()).exp();
            (x.squared() + y.squared() + 1.0).sqrt() - bump * y.sin() + x.atan2(y + 4.0).tanh()
        }
        // x = t, y = t²/2.
        let along = |t: f64| {
            let (x, y) = (
                Taylor { coefficients: [t, 1.0, 0.0, 0.0] },
                Taylor { coefficients: [t * t / 2.0, t, 0.5, 0.0] },
            );
            h(x, y).coefficients
        };
        for (from, to) in [(0.0, 0.5), (0.7, 0.9), (-1.0, 1.0), (2.0, 2.01)] {
            let t = Interval::new(from, to);
            let zero = Interval::from(0.0);
            let x = Taylor { coefficients: [t, Interval::from(1.0), zero, zero] };
            let y = Taylor { coefficients: [t.squared() * 0.5, t, Interval::from(0.5), zero] };
            let found = h(x, y).coefficients;
            for i in 0..=100 {
                let wanted = along(from + (to - from) * f64::from(i) / 100.0);
                for (k, (found, wanted)) in found.iter().zip(wanted).enumerate() {
                    assert!(
                        found.low <= wanted + 1e-12 && wanted <= found.high + 1e-12,
                        "{k} at {i}: {found:?}"
                    );
                }
            }
        }
    }

    /// Where it is not known which of two is the smaller, nothing is known of what comes after the value.
    #[test]
    fn kinks_are_not_known_to_be_smooth() {
        let at = |low: f64, high: f64| Taylor::<Interval, 2> {
            coefficients: [Interval::new(low, high), Interval::from(3.0)],
        };
        let lower = at(0.0, 1.0).min(at(0.5, 2.0));
        assert_eq!(lower.coefficients, [Interval::new(0.0, 1.0), Interval::ALL]);
        assert_eq!(at(0.0, 1.0).min(at(1.5, 2.0)), at(0.0, 1.0));
        assert_eq!(at(-2.0, 1.0).abs().coefficients, [Interval::new(0.0, 2.0), Interval::ALL]);
        assert_eq!(at(-2.0, -1.0).abs().coefficients, [Interval::new(1.0, 2.0), Interval::from(-3.0)]);
        assert_eq!(Interval::from(f64::NAN), Interval::ALL);
    }
}
