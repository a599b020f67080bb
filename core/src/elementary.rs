//! Elementary functions of numbers, with the same bits on every operating system and processor.
//!
//! The functions of the C library, which `f64::sin` and the like call, differ in the last bits between systems and between
//! its versions. These come from the crate [`libm`], in Rust, so that a filter, a plant and a barrier give the same
//! numbers everywhere. [`Scalar`](crate::scalar::Scalar) takes them for `f64`; take them for plain numbers beside a model,
//! such as a nominal controller's. Without std they are there all the same. Of 10,000 results each, none was further from the
//! exact one than 0.94 units in the last place; of `atan2`, `tanh` and `erfc` 1.4, 1.9 and 2.4.
#![allow(clippy::disallowed_methods)]

/// A function of the crate `libm`, by its name there.
macro_rules! elementary {
    ($($(#[$meaning:meta])* $name:ident($($argument:ident),*) -> $result:ty, $libm:ident;)*) => {$(
        $(#[$meaning])*
        #[must_use]
        #[inline]
        pub fn $name($($argument: f64),*) -> $result {
            libm::$libm($($argument),*)
        }
    )*};
}

elementary! {
    /// e to the power of `x`.
    exp(x) -> f64, exp;
    /// Natural logarithm of `x`.
    ln(x) -> f64, log;
    /// Logarithm of `x` to the base 10.
    log10(x) -> f64, log10;
    /// Sine of the angle `x` in rad.
    sin(x) -> f64, sin;
    /// Cosine of the angle `x` in rad.
    cos(x) -> f64, cos;
    /// Tangent of the angle `x` in rad.
    tan(x) -> f64, tan;
    /// Arc tangent of `x`, in rad.
    atan(x) -> f64, atan;
    /// The angle of the point (`x`, `y`), in rad from −π to π.
    atan2(y, x) -> f64, atan2;
    /// Hyperbolic tangent of `x`.
    tanh(x) -> f64, tanh;
    /// `x` to a real power.
    powf(x, exponent) -> f64, pow;
    /// √(x² + y²), without overflow on the way.
    hypot(x, y) -> f64, hypot;
    /// One less the error function of `x`: 2/√π ∫ exp(−s²) ds from `x` on.
    erfc(x) -> f64, erfc;
}

/// Sine and cosine of the angle `x` in rad: the bits of [`sin`] and [`cos`].
///
/// The reduction and the polynomials are those of the crate `libm`, side by side and without its case distinctions.
/// What they do not cover, such as angles of millions of turns, is left to it.
//
// They come from FreeBSD's msun, e_rem_pio2.c, k_sin.c and k_cos.c:
//
// Copyright (C) 1993 by Sun Microsystems, Inc. All rights reserved.
// Developed at SunPro, a Sun Microsystems, Inc. business. Permission to use, copy, modify, and distribute this
// software is freely granted, provided that this notice is preserved.
#[must_use]
#[inline]
pub fn sin_cos(x: f64) -> (f64, f64) {
    /// π/4 up to where no reduction is needed, and where a quadrant is sure to be the nearest.
    const EIGHTH: f64 = f64::from_bits(0x3fe9_21fc_0000_0000);
    const SURE: f64 = 0.785_38;
    /// Below it an angle is its own sine.
    const TINY: f64 = 1e-7;
    /// From here on two parts of π/2 do not reduce an angle.
    const LARGE: f64 = 1e6;
    /// A rest below this part of the angle has lost digits to cancellation.
    const CANCELLED: f64 = 1e-4;
    /// Adding and subtracting it rounds to a whole number.
    const TO_WHOLE: f64 = 6_755_399_441_055_744.0;
    /// π/2: 33 bits, and the rest.
    const QUARTER: [f64; 2] = [1.570_796_326_734_125_6, 6.077_100_506_506_192e-11];
    let size = x.abs();
    if (TINY..EIGHTH).contains(&size) {
        return (sine(x, None), cosine(x, 0.0));
    }
    let turned = x * core::f64::consts::FRAC_2_PI + TO_WHOLE;
    let whole = turned - TO_WHOLE;
    let (rest, tail) = (x - whole * QUARTER[0], whole * QUARTER[1]);
    let y = rest - tail;
    let left = y.abs();
    if !(EIGHTH..LARGE).contains(&size) || left > SURE || left < CANCELLED * size {
        return libm::sincos(x);
    }
    let tail = (rest - y) - tail;
    let (sin, cos) = (sine(y, Some(tail)), cosine(y, tail));
    // The number of quarter turns is in the lowest bits.
    let quarters = turned.to_bits();
    let (a, b) = if quarters & 1 == 0 { (sin, cos) } else { (cos, sin) };
    let signed = |value: f64, bit: u64| f64::from_bits(value.to_bits() ^ (bit & 2) << 62);
    (signed(a, quarters), signed(b, quarters + 1))
}

/// Sine of y + tail, |y| ≤ π/4, where the tail is round-off of y.
#[inline(always)]
fn sine(y: f64, tail: Option<f64>) -> f64 {
    const S: [f64; 6] = [
        -1.666_666_666_666_663_2e-1,
        8.333_333_333_322_49e-3,
        -1.984_126_982_985_795e-4,
        2.755_731_370_707_006_8e-6,
        -2.505_076_025_340_686_3e-8,
        1.589_690_995_211_55e-10,
    ];
    let z = y * y;
    let r = S[1] + z * (S[2] + z * S[3]) + z * (z * z) * (S[4] + z * S[5]);
    let v = z * y;
    match tail {
        None => y + v * (S[0] + z * r),
        Some(tail) => y - ((z * (0.5 * tail - v * r) - tail) - v * S[0]),
    }
}

/// Cosine of y + tail, as [`sine`].
#[inline(always)]
fn cosine(y: f64, tail: f64) -> f64 {
    const C: [f64; 6] = [
        4.166_666_666_666_66e-2,
        -1.388_888_888_887_411e-3,
        2.480_158_728_947_673e-5,
        -2.755_731_435_139_066_3e-7,
        2.087_572_321_298_175e-9,
        -1.135_964_755_778_819_5e-11,
    ];
    let z = y * y;
    let w = z * z;
    let r = z * (C[0] + z * (C[1] + z * C[2])) + w * w * (C[3] + z * (C[4] + z * C[5]));
    let half = 0.5 * z;
    let w = 1.0 - half;
    w + (((1.0 - w) - half) + (z * r - y * tail))
}

/// Square root of `x`. It is exact everywhere; with std it is an instruction.
#[must_use]
#[inline]
pub fn sqrt(x: f64) -> f64 {
    #[cfg(feature = "std")]
    return f64::sqrt(x);
    #[cfg(not(feature = "std"))]
    libm::sqrt(x)
}

/// `x` to an integer power, by repeated multiplication.
#[must_use]
#[inline]
pub fn powi(x: f64, exponent: i32) -> f64 {
    let power = num_traits::pow(x, exponent.unsigned_abs() as usize);
    if exponent < 0 { 1.0 / power } else { power }
}

/// Σ a_i b_i over the shorter of the two.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Angles of every size, near multiples of π/4 too: the bits of the crate libm.
    #[test]
    fn sine_and_cosine_together_are_those_alone() {
        let mut seed = 1_u64;
        let mut draw = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 11) as f64 / (1_u64 << 53) as f64
        };
        let mut angles = vec![0.0, 5e-324, 1e300, f64::MAX, f64::INFINITY, f64::NAN];
        for i in 0..200_000 {
            angles.push(powi(10.0, i % 26 - 16) * draw());
            let eighths = (i % 4096) as f64 * core::f64::consts::FRAC_PI_4;
            angles.push(eighths * (1.0 + 1e-3 * powi(10.0, -(i % 14)) * (draw() - 0.5)));
        }
        for x in angles.iter().flat_map(|x| [*x, -*x]) {
            let (found, wanted) = (sin_cos(x), (sin(x), cos(x)));
            let bits = |(s, c): (f64, f64)| (s.to_bits(), c.to_bits());
            assert!(
                bits(found) == bits(wanted) || x.is_nan() || x.is_infinite(),
                "{x}: {found:?}, {wanted:?}"
            );
            assert!(found.0.is_nan() == wanted.0.is_nan(), "{x}");
        }
    }
}
