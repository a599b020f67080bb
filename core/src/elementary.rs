//! Elementary functions of numbers, which exist in std only: std's, or those of the crate `libm`. And the dot product.
//!
//! With the feature `libm` results have the same bits on every operating system. A square root is exact either way, and
//! std's is an instruction.
#![allow(clippy::disallowed_methods)]

/// A function that std has as a method, and `libm` by the name given.
macro_rules! elementary {
    ($($name:ident($($argument:ident),*) -> $result:ty, $libm:ident;)*) => {$(
        #[inline(always)]
        pub(crate) fn $name($($argument: f64),*) -> $result {
            #[cfg(feature = "libm")]
            return libm::$libm($($argument),*);
            #[cfg(not(feature = "libm"))]
            f64::$name($($argument),*)
        }
    )*};
}

elementary! {
    exp(x) -> f64, exp;
    ln(x) -> f64, log;
    sin_cos(x) -> (f64, f64), sincos;
    atan(x) -> f64, atan;
    atan2(y, x) -> f64, atan2;
    tanh(x) -> f64, tanh;
    powf(x, exponent) -> f64, pow;
    hypot(x, y) -> f64, hypot;
}

#[inline(always)]
pub(crate) fn sqrt(x: f64) -> f64 {
    #[cfg(feature = "std")]
    return f64::sqrt(x);
    #[cfg(not(feature = "std"))]
    libm::sqrt(x)
}

/// `x` to an integer power, by repeated multiplication.
#[inline(always)]
pub(crate) fn powi(x: f64, exponent: i32) -> f64 {
    #[cfg(feature = "libm")]
    {
        let power = num_traits::pow(x, exponent.unsigned_abs() as usize);
        if exponent < 0 { 1.0 / power } else { power }
    }
    #[cfg(not(feature = "libm"))]
    f64::powi(x, exponent)
}

/// Σ a_i b_i over the shorter of the two.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}
