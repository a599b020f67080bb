//! Numbers that are known to lie between two others: what a function takes on a whole stretch of a path, not at instants.
//!
//! A plant or a barrier evaluated on [`Interval`]s gives one that holds every value it takes on any numbers within them. On
//! [`Taylor`](crate::jet::Taylor) series of intervals it gives such an interval for each coefficient. A function that compares
//! by [`Scalar::value`] and goes one of two ways shows one of them alone; [`Scalar::min`], [`Scalar::max`] and
//! [`Scalar::abs`] show both. A function is taken to be defined where it is asked: the square root of −1 to 4 is 0 to 2.
//!
//! Bounds are rounded outward, so they hold whatever the round-off. Negation, [`Scalar::abs`], [`Scalar::min`] and
//! [`Scalar::max`] have none, and nothing remains nothing: 0 + 0, 0 · x, and the functions that are 0 at 0. A factor or divisor
//! that is a plain number may itself be rounded, as 1/3 is. Left out is underflow: products and functions below 2⁻¹⁰²², where
//! numbers have fewer digits, may be off by a few times 2⁻¹⁰⁷⁴.
//!
//! Source: R. E. Moore, R. B. Kearfott and M. J. Cloud, *Introduction to Interval Analysis*, SIAM (2009), chapters 2 and 5.

use core::cmp::Ordering;
use core::f64::consts::{PI, TAU};
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
/// assert_eq!((x * 2.0).min(Interval::from(1.0)), Interval::new(-2.0, 1.0));
/// let square = x.squared();
/// assert!(square.low == 0.0 && square.contains(4.0) && !square.contains(4.0 + 1e-14));
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
        Self::around([a, b, c, d]).outward(ROUNDED)
    }

    /// Encloses what is off by the given part of each bound, as [`ROUNDED`] and others count it. All numbers where a bound has
    /// overflowed inward.
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn outward(self, part: f64) -> Self {
        let Self { low, high } = self.moved(part);
        Self::new(low, high)
    }

    /// The same, for finite bounds.
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn moved(self, part: f64) -> Self {
        Self { low: self.low - self.low.abs() * part, high: self.high + self.high.abs() * part }
    }

    /// Whether `number` is among them.
    pub fn contains(self, number: f64) -> bool {
        self.low <= number && number <= self.high
    }

    /// The values of a function that rises with its argument, and that is computed up to the given part of it.
    fn rising(self, part: f64, function: impl Fn(f64) -> f64) -> Self {
        Self { low: function(self.low), high: function(self.high) }.outward(part)
    }

    /// Those of its numbers that a sine can be.
    fn of_sine(self) -> Self {
        Self { low: largest(self.low, -1.0), high: least(self.high, 1.0) }
    }

    /// From the least to the largest of four numbers.
    #[inline]
    fn around(four: [f64; 4]) -> Self {
        let [a, b, c, d] = four;
        Self { low: least(least(a, b), least(c, d)), high: largest(largest(a, b), largest(c, d)) }
    }

    /// The same angle in turns, wider by more than its round-off and that of [`Self::passes`].
    fn turns(self) -> Self {
        // Of the number of turns, and of one more: 2⁻⁵³ for each of 2π, the quotient, its widening twice, and the difference
        // that follows. Eight of them are given.
        let Self { low, high } = Self { low: self.low / TAU, high: self.high / TAU }.moved(FUNCTION);
        Self { low: low - FUNCTION, high: high + FUNCTION }
    }

    /// Whether turns have a number `at` + k, 0 ≤ `at` < 1. If they have none but are within round-off of one, perhaps.
    fn passes(self, at: f64) -> bool {
        libm::ceil(self.low - at) <= self.high - at
    }
}

/// Part of itself by which a bound moves that was rounded once, to nearest.
///
/// A number was off by half a unit in the last place at most. This part of it is a unit or more, and the number one unit away
/// is one that can be represented. So the moved one, rounded to nearest, is there or beyond. Sums below 2⁻¹⁰²² are exact.
const ROUNDED: f64 = f64::EPSILON;

/// The same for a bound that was rounded twice: a product of which one factor is rounded.
///
/// Two roundings are up to 2 · 2⁻⁵³ of it. This part is 4 · 2⁻⁵³, and the rounding of what has moved takes 2⁻⁵³ back.
const ROUNDED_TWICE: f64 = 2.0 * f64::EPSILON;

/// The same for a value of a function of [`elementary`]: up to three units in the last place.
///
/// The tests of the crate libm bound the distance from the exact result, rounded: 2 units for tanh and atan2, 1 for the
/// others here. The rounding adds half a unit. This part is 8 · 2⁻⁵³ of the value, four units or more, of which the rounding of
/// what has moved takes half a unit back.
///
/// Source: `default_ulp` in libm-test/src/precision.rs of <https://github.com/rust-lang/compiler-builtins>, against MPFR.
const FUNCTION: f64 = 4.0 * f64::EPSILON;

/// Whether the product with it is exact, since it is 0 or a power of two.
#[cfg_attr(not(feature = "small"), inline(always))]
fn keeps_digits(factor: f64) -> bool {
    const SIGN_AND_EXPONENT: u32 = 64 - (f64::MANTISSA_DIGITS - 1);
    factor.to_bits() << SIGN_AND_EXPONENT == 0
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
        Self { low: self.low + other.low, high: self.high + other.high }.outward(ROUNDED)
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
        if ((a + b) + (c + d)).is_finite() {
            Self::around([a, b, c, d]).moved(ROUNDED)
        } else {
            self.product(other)
        }
    }
}

impl Div for Interval {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        if other.contains(0.0) {
            return Self::ALL;
        }
        // By a positive number: the smaller it is, the farther out.
        let (a, b) = if other.low > 0.0 { (self, other) } else { (-self, -other) };
        let low = a.low / if a.low < 0.0 { b.low } else { b.high };
        let high = a.high / if a.high < 0.0 { b.high } else { b.low };
        Self { low, high }.outward(ROUNDED)
    }
}

impl Add<f64> for Interval {
    type Output = Self;
    #[inline]
    fn add(self, other: f64) -> Self {
        Self { low: self.low + other, high: self.high + other }.outward(ROUNDED)
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
    #[inline]
    fn div(self, other: f64) -> Self {
        if other == 0.0 || !other.is_finite() {
            return self / Self::from(other);
        }
        let [a, b] = [self.low / other, self.high / other];
        let quotient = Self { low: least(a, b), high: largest(a, b) };
        if keeps_digits(other) && (a + b).is_finite() { quotient } else { quotient.outward(ROUNDED_TWICE) }
    }
}

impl Mul<f64> for Interval {
    type Output = Self;
    #[inline]
    fn mul(self, other: f64) -> Self {
        let [a, b] = [self.low * other, self.high * other];
        if (a + b).is_finite() {
            let product = Self { low: least(a, b), high: largest(a, b) };
            if keeps_digits(other) { product } else { product.moved(ROUNDED_TWICE) }
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
        self.max(Self::from(0.0)).rising(ROUNDED, elementary::sqrt)
    }

    fn exp(self) -> Self {
        self.rising(FUNCTION, elementary::exp)
    }

    fn ln(self) -> Self {
        self.max(Self::from(0.0)).rising(FUNCTION, elementary::ln)
    }

    fn sin_cos(self) -> (Self, Self) {
        let middle = self.value();
        // At least the distance of both ends, though their differences are rounded.
        let half = (self.high - middle).max(middle - self.low) * (1.0 + f64::EPSILON);
        if half <= NARROW {
            let (sin, cos) = elementary::sin_cos(middle);
            // With d = `half`: |v| cos d ± |slope| sin d at the ends, 1 − d²/2 ≤ cos d ≤ 1 − d²/2 + d⁴/24, sin d ≤ d, and the
            // largest value between them where |slope| ≤ |v| tan d. If round-off hides that it lies between them, it is the value
            // at the end all the same.
            let square = half * half;
            let around = |v: f64, slope: f64| {
                let (size, change) = (v.abs(), slope.abs() * half);
                let near = size * (1.0 - 0.5 * square);
                let turns = slope.abs() <= size * half * (1.0 + square);
                // `v` and `slope` are off by up to three units, and five roundings follow.
                let error = 2.0 * FUNCTION * (size + change);
                let far = if turns { 1.0 } else { near + size * square * square / 24.0 + change + error };
                let positive = Self { low: near - change - error, high: far }.of_sine();
                if v < 0.0 { -positive } else { positive }
            };
            return (around(sin, cos), around(cos, sin));
        }
        if self.high - self.low < TAU {
            let (low, high) = (elementary::sin_cos(self.low), elementary::sin_cos(self.high));
            let turns = self.turns();
            let wave = |a: f64, b: f64, top: f64, bottom: f64| {
                let Self { low, high } =
                    Self { low: least(a, b), high: largest(a, b) }.moved(FUNCTION).of_sine();
                Self {
                    low: if turns.passes(bottom) { -1.0 } else { low },
                    high: if turns.passes(top) { 1.0 } else { high },
                }
            };
            (wave(low.0, high.0, 0.25, 0.75), wave(low.1, high.1, 0.0, 0.5))
        } else {
            let any = Self { low: -1.0, high: 1.0 };
            (any, any)
        }
    }

    fn atan(self) -> Self {
        self.rising(FUNCTION, elementary::atan)
    }

    fn tanh(self) -> Self {
        self.rising(FUNCTION, elementary::tanh).of_sine()
    }

    fn powf(self, exponent: f64) -> Self {
        // Whole powers are those of negative numbers too.
        let base = match exponent % 2.0 {
            0.0 => self.abs(),
            part if part.abs() == 1.0 && (exponent > 0.0 || !self.contains(0.0)) => self,
            part if part.abs() == 1.0 => return Self::ALL,
            _ => self.max(Self::from(0.0)),
        };
        let power = |v: f64| elementary::powf(v, exponent);
        let Self { low, high } = Self::new(power(base.low), power(base.high));
        Self { low: low.min(high), high: low.max(high) }.outward(FUNCTION)
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
        let any = Self { low: -PI, high: PI }.moved(ROUNDED);
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
        if four.iter().any(|v| v.is_nan()) { any } else { Self::around(four).moved(FUNCTION) }
    }

    #[inline]
    fn squared(self) -> Self {
        let Self { low, high } = self.abs();
        Self { low: low * low, high: high * high }.outward(ROUNDED)
    }

    fn powi(self, exponent: i32) -> Self {
        let base = if exponent % 2 == 0 { self.abs() } else { self };
        // The n-th power by n − 1 roundings, in whatever order.
        let power = match exponent.unsigned_abs() {
            0 => Self::from(1.0),
            1 => base,
            n => base.rising(ROUNDED * f64::from(n), |v| elementary::powi(v, n as i32)),
        };
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
                let part = |from: f64, all: f64, k: u32| {
                    (from + all * f64::from(k) / f64::from(PARTS)).min(from + all)
                };
                for (k, value) in operations(part(a, wide, i), part(b, long, j)).into_iter().enumerate() {
                    assert!(found[k].contains(value), "{k}: {a} {wide} {b} {long} {value} {:?}", found[k]);
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

    /// A number of either sign whose exponent is up to `most`, one in four a power of two or beside it.
    fn draw_wide(seed: &mut u64, most: f64) -> f64 {
        let sign = if draw(seed) < 0.5 { -1.0 } else { 1.0 };
        let power = elementary::powi(2.0, ((2.0 * draw(seed) - 1.0) * most) as i32);
        let digits = match (draw(seed) * 16.0) as u32 {
            0 | 1 => 1.0,
            2 => 1.0 + f64::EPSILON,
            3 => 2.0 - f64::EPSILON,
            _ => 1.0 + draw(seed),
        };
        sign * power * digits
    }

    /// The exact results of + − · / and √ on numbers of all sizes lie within their bounds, and these are a few units in the
    /// last place apart.
    ///
    /// A fused product and sum is rounded once, so its sign is that of the exact one.
    #[test]
    fn exact_results_lie_within_the_bounds() {
        // Far from where a product, or what is left of it, has fewer digits.
        const MOST: f64 = 200.0;
        let mut seed = 11;
        let fused = libm::fma;
        for i in 0..100_000 {
            let a = draw_wide(&mut seed, MOST);
            // Sums of numbers that have no common digits say little.
            let b = if i % 2 == 0 { draw_wide(&mut seed, MOST) } else { a * draw_wide(&mut seed, 60.0) };
            let (x, y) = (Interval::from(a), Interval::from(b));
            let tight = |found: Interval, units: f64| {
                assert!(
                    found.high - found.low <= units * f64::EPSILON * found.high.abs(),
                    "{a:e} {b:e} {found:?}"
                );
            };
            for (b, y) in [(b, y), (-b, -y)] {
                // Knuth's sum of two numbers and its round-off, which together are exact.
                for found in [x + y, x + b, x - -y, x - -b] {
                    let sum = a + b;
                    let part = sum - a;
                    let left = (a - (sum - part)) + (b - part);
                    assert!(
                        (found.low - sum) - left <= 0.0 && (found.high - sum) - left >= 0.0,
                        "{a:e} + {b:e}"
                    );
                    tight(found, 4.0);
                }
                for (found, units) in [(x * y, 4.0), (x * b, 8.0)] {
                    let beyond = |bound: f64| fused(a, b, -bound);
                    assert!(beyond(found.low) >= 0.0 && beyond(found.high) <= 0.0, "{a:e} * {b:e}");
                    tight(found, units);
                }
                for (found, units) in [(x / y, 4.0), (x / b, 8.0)] {
                    let beyond = |bound: f64| fused(bound, b, -a) * b.signum();
                    assert!(beyond(found.low) <= 0.0 && beyond(found.high) >= 0.0, "{a:e} / {b:e}");
                    tight(found, units);
                }
                // Of a wider one: the end that takes it farthest.
                let (wide, middle) = (Interval { low: -a.abs(), high: 2.0 * a.abs() }, b.abs());
                let (product, quotient) = (wide * y, wide / y);
                let most = if b > 0.0 { product.high } else { -product.low };
                assert!(fused(2.0 * a.abs(), middle, -most) <= 0.0, "{a:e} * {b:e}");
                let most = if b > 0.0 { quotient.high } else { -quotient.low };
                assert!(fused(most, middle, -2.0 * a.abs()) >= 0.0, "{a:e} / {b:e}");
            }
            let square = x.squared();
            assert!(fused(a, a, -square.low) >= 0.0 && fused(a, a, -square.high) <= 0.0, "{a:e}²");
            tight(square, 4.0);
            let root = x.abs().sqrt();
            let beyond = |bound: f64| fused(bound, bound, -a.abs());
            assert!(beyond(root.low) <= 0.0 && beyond(root.high) >= 0.0, "√{a:e}");
            tight(root, 4.0);
        }
    }

    /// A factor or divisor that was rounded itself stands for what it was.
    #[test]
    fn a_third_is_a_third() {
        let mut seed = 3;
        for k in 1..1000 {
            let (x, k) = (draw_wide(&mut seed, 100.0), f64::from(k));
            for found in [Interval::from(x) * (1.0 / k), Interval::from(x) / k] {
                let beyond = |bound: f64| libm::fma(bound, k, -x);
                assert!(beyond(found.low) <= 0.0 && beyond(found.high) >= 0.0, "{x:e} / {k}");
            }
        }
    }

    /// Values at which the functions of [`elementary`] are farthest from the exact ones, of 20,000 or more each: these are in
    /// two parts, by Python's mpmath with 140 binary digits.
    #[test]
    fn functions_enclose_their_exact_values() {
        type Row = [f64; 4];
        let check = |function: fn(Interval, f64) -> Interval, rows: [Row; 3]| {
            for [x, y, value, rest] in rows {
                let found = function(Interval::from(x), y);
                assert!(found.low - value <= rest && rest <= found.high - value, "{x} {y}: {found:?}");
                assert!(found.high - found.low <= 18.0 * f64::EPSILON * value.abs(), "{x} {y}: {found:?}");
            }
        };
        check(
            |x, _| x.exp(),
            [
                [-5.882822790911398, 0.0, 0.0027869073047257277, 6.405860720933553e-20],
                [78.72133836897513, 0.0, 1.5425628278908997e+34, 4.0397766783180166e+17],
                [2.48212394949845, 0.0, 11.966654013985531, 4.0250094582507358e-16],
            ],
        );
        check(
            |x, _| x.ln(),
            [
                [1.2835196893325753, 0.0, 0.24960606155621526, 6.678718563901092e-18],
                [0.7031940864327002, 0.0, -0.3521223421563419, -1.5083094895119803e-17],
                [1.4071489553668532, 0.0, 0.34156563988253946, -1.516798463669672e-17],
            ],
        );
        check(
            |x, _| x.sin(),
            [
                [2006.6923066242225, 0.0, 0.7071073866520704, 2.8320964482001897e-17],
                [2069.52415891802, 0.0, 0.7071079367792975, 2.9029016146249506e-17],
                [-0.8467117479300408, 0.0, -0.7491061564613738, -2.99710717299062e-17],
            ],
        );
        check(
            |x, _| x.cos(),
            [
                [2647.577209237211, 0.0, -0.7071070812914811, -2.99317510077941e-17],
                [6697.129573019367, 0.0, 0.7344337015039213, 3.056604891555416e-17],
                [930.6968235958215, 0.0, 0.7071068025092041, -3.0599367805668055e-17],
            ],
        );
        check(
            |x, _| x.atan(),
            [
                [2.95224825391717, 0.0, 1.2442012346055205, -5.975808691513326e-17],
                [2.9350983811339946, 0.0, 1.242426831292878, -6.139419544308469e-17],
                [-3.9154919060635507, 0.0, -1.3207457915329168, 6.305610732350352e-17],
            ],
        );
        check(
            |x, _| x.tanh(),
            [
                [0.2553072194100833, 0.0, 0.24990100444371646, 2.080991327202675e-18],
                [0.2394387066283279, 0.0, 0.23496551448190678, -7.126337758472783e-19],
                [0.20945318495900006, 0.0, 0.20644304839484967, -3.7931181331072275e-19],
            ],
        );
        check(
            |x, y| x.atan2(Interval::from(y)),
            [
                [-0.24757688816840595, 0.9768343258989569, -0.24822137258568783, 9.94165762004277e-18],
                [-4.045302406752347, 7.918250612781104, -0.4723163337604444, -1.417485993305656e-17],
                [0.36486901107701786, 0.7116452451840158, 0.47376536391672447, 1.2632292208959089e-17],
            ],
        );
        check(
            |x, y| x.powf(y),
            [
                [37.396560374829235, 4.117379496724631, 2991884.502658889, -9.189726068187567e-11],
                [0.07530086658897606, -0.14459767491645942, 1.4534902142491688, -4.4227745131895484e-17],
                [0.3121069749306926, -0.9175435361242283, 2.9107075900222292, 1.0403849791032152e-16],
            ],
        );
    }

    /// Angles that end beside a turning point of sine or cosine, some of them after many turns: neither exceeds 1, and the one
    /// that turns reaches it.
    #[test]
    fn sines_that_turn_reach_one() {
        let many = (24..44).flat_map(|power| [-3, -2, -1, 1, 2, 3].map(|k| (1_i64 << power) + k));
        for k in (-40..=40).chain(many) {
            // Neighbours that enclose the turning point: behind it what rises with the angle is positive.
            let quarter = k as f64 * core::f64::consts::FRAC_PI_2;
            let (sin, cos) = elementary::sin_cos(quarter);
            let behind = [sin, -cos, -sin, cos][k.rem_euclid(4) as usize] >= 0.0;
            let first = if behind { quarter.next_down() } else { quarter };
            let last = first.next_up();
            for wide in [0.0, 1e-15, 1e-9, 1e-3, 0.09, 0.2, 1.0, 3.0, 6.0, 7.0] {
                for angle in [Interval::new(first - wide, last), Interval::new(first, last + wide)] {
                    let (sin, cos) = angle.sin_cos();
                    let turning = if k % 2 == 0 { cos } else { sin };
                    let extreme = if k.rem_euclid(4) < 2 { turning.high } else { -turning.low };
                    assert_eq!(extreme, 1.0, "{k} {wide}");
                    for found in [sin, cos] {
                        assert!(-1.0 <= found.low && found.high <= 1.0, "{k} {wide}");
                    }
                }
            }
        }
        let any = Interval::new(-1.0, 1.0);
        assert_eq!(Interval::new(1e300, 1e300_f64.next_up()).sin_cos(), (any, any));
        assert_eq!(Interval::ALL.sin_cos(), (any, any));
    }

    /// Nothing remains nothing, by which it is known what does not move, and twice a number is twice that number.
    #[test]
    fn what_has_no_round_off_is_exact() {
        let (nothing, x) = (Interval::from(0.0), Interval::new(0.1, 0.3));
        for found in [
            nothing + nothing,
            nothing - nothing,
            nothing + 0.0,
            nothing * x,
            x * nothing,
            x * 0.0,
            nothing * 0.3,
            nothing * Interval::ALL,
            Interval::ALL * 0.0,
            nothing / x,
            nothing / 0.3,
            nothing.squared(),
            nothing.powi(3),
            nothing.sqrt(),
            nothing.sin(),
            nothing.atan(),
            nothing.tanh(),
            nothing.powf(2.0),
            nothing.hypot(nothing),
            nothing.atan2(x),
            Interval::from(1.0).ln(),
        ] {
            assert_eq!(found, nothing);
        }
        assert_eq!((x * 2.0, x * -0.25), (Interval::new(0.2, 0.6), Interval::new(-0.075, -0.025)));
        assert_eq!((x / 2.0, x / -0.25), (Interval::new(0.05, 0.15), Interval::new(-1.2, -0.4)));
        assert_eq!((x.powi(0), x.powi(1)), (Interval::from(1.0), x));
    }

    /// What exceeds all numbers that can be represented is not known, and has no bound on that side.
    #[test]
    fn what_overflows_has_no_bound() {
        let large = Interval::from(f64::MAX);
        for found in [
            large / 0.25,
            large + large,
            large * large,
            large.squared(),
            large * 3.0,
            large / 0.3,
            large.exp(),
            large.powi(3),
        ] {
            assert_eq!(found, Interval::ALL);
        }
        assert_eq!((Interval::new(0.0, f64::MAX) * 3.0), Interval::new(0.0, f64::INFINITY));
        assert_eq!(Interval::from(1.0) / Interval::new(0.0, 1.0), Interval::ALL);
        assert_eq!(
            (Interval::from(1.0) / 0.0, Interval::from(1.0) / f64::NAN),
            (Interval::ALL, Interval::ALL)
        );
        assert_eq!(Interval::from(1.0) * f64::NAN, Interval::ALL);
        let positive = Interval::new(0.0, f64::INFINITY);
        assert_eq!((positive / 2.0, positive / -3.0, positive * 3.0), (positive, -positive, positive));
        for found in [Interval::ALL / f64::INFINITY, Interval::ALL / Interval::from(f64::INFINITY)] {
            assert_eq!(found, Interval::ALL);
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
                    assert!(found.contains(wanted), "{k} at {i}: {found:?} {wanted}");
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
