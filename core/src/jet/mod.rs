//! Forward-mode derivatives: first order in directions ([`Dual`]), any order in time ([`Taylor`]).
//!
//! `Taylor<Dual<M>, K>` holds the first `K` Taylor coefficients of a function of time, each with its
//! exact derivative along `M` directions (here: the inputs). `Response` is the same where the first
//! coefficient depends on none of them, at a fraction of the work; [`Tangent`] adds one direction to any of
//! them. No finite differences anywhere.

mod dual;
mod response;
mod tangent;
mod taylor;

pub use dual::Dual;
pub(crate) use response::Response;
pub use tangent::Tangent;
pub use taylor::Taylor;

/// The arithmetic that follows from `+ − × ÷` on two values and their `f64` mixtures.
macro_rules! derived_operators {
    ([$($generics:tt)*] $type:ty) => {
        impl<$($generics)*> core::ops::AddAssign for $type {
            #[inline]
            fn add_assign(&mut self, other: Self) { *self = *self + other; }
        }
        impl<$($generics)*> core::ops::SubAssign for $type {
            #[inline]
            fn sub_assign(&mut self, other: Self) { *self = *self - other; }
        }
        impl<$($generics)*> core::ops::MulAssign for $type {
            #[inline]
            fn mul_assign(&mut self, other: Self) { *self = *self * other; }
        }
        impl<$($generics)*> core::ops::DivAssign for $type {
            #[inline]
            fn div_assign(&mut self, other: Self) { *self = *self / other; }
        }
        impl<$($generics)*> num_traits::Zero for $type {
            #[inline]
            fn zero() -> Self { Self::from(0.0) }
            #[cfg_attr(not(feature = "small"), inline(always))]
            fn is_zero(&self) -> bool { *self == Self::from(0.0) }
        }
        impl<$($generics)*> num_traits::One for $type {
            #[inline]
            fn one() -> Self { Self::from(1.0) }
        }
    };
}
pub(crate) use derived_operators;
