//! Forward-mode derivatives: first order in directions ([`Dual`]), any order in time ([`Taylor`]).
//!
//! `Taylor<Dual<M>, K>` holds the first `K` Taylor coefficients of a function of time, each with its
//! exact derivative along `M` directions (here: the inputs). No finite differences anywhere.

mod dual;
mod taylor;

pub use dual::Dual;
pub use taylor::Taylor;

/// The arithmetic that follows from `+ − × ÷` on two values and their `f64` mixtures.
macro_rules! derived_operators {
    ([$($generics:tt)*] $type:ty) => {
        impl<$($generics)*> std::ops::AddAssign for $type {
            fn add_assign(&mut self, other: Self) { *self = *self + other; }
        }
        impl<$($generics)*> std::ops::SubAssign for $type {
            fn sub_assign(&mut self, other: Self) { *self = *self - other; }
        }
        impl<$($generics)*> std::ops::MulAssign for $type {
            fn mul_assign(&mut self, other: Self) { *self = *self * other; }
        }
        impl<$($generics)*> std::ops::DivAssign for $type {
            fn div_assign(&mut self, other: Self) { *self = *self / other; }
        }
        impl<$($generics)*> num_traits::Zero for $type {
            fn zero() -> Self { Self::from(0.0) }
            fn is_zero(&self) -> bool { *self == Self::from(0.0) }
        }
        impl<$($generics)*> num_traits::One for $type {
            fn one() -> Self { Self::from(1.0) }
        }
    };
}
pub(crate) use derived_operators;
