//! Types of values, and the conversion of numbers between the doubles of a run and the type of a variable. A
//! number that the conversion would change is refused.

use std::fmt::Display;

pub use punctual_modeldescription::fmi3::DataType;

/// Families of types that can be connected with each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Family {
    /// Floats and doubles.
    Real,
    /// Whole numbers of every size.
    Integer,
    /// Enumerations.
    Enumeration,
    /// Booleans.
    Boolean,
    /// Types without numbers: texts, bytes, clocks.
    Other,
}

impl Family {
    /// The family of a type.
    pub fn of(data_type: DataType) -> Self {
        match data_type {
            DataType::Enumeration => Self::Enumeration,
            DataType::Boolean => Self::Boolean,
            of if of.is_float() => Self::Real,
            of if of.limits().is_some() => Self::Integer,
            _ => Self::Other,
        }
    }
}

/// The least and the greatest whole number that both the type and a run can represent; `None` for other
/// types.
pub fn whole_range(of: DataType) -> Option<(f64, f64)> {
    let (least, greatest) = of.limits()?;
    Some(((least as f64).max(-WHOLE), (greatest as f64).min(WHOLE)))
}

/// A run stores numbers as doubles, which represent every whole number from −2⁵³ to 2⁵³.
const WHOLE: f64 = 9_007_199_254_740_992.0;

/// A number type of FMUs.
pub(crate) trait Number: Copy + Default + Display {
    /// The least and the greatest value that a run can represent.
    const RANGE: (f64, f64);

    /// The same number as a double, if there is one.
    fn to_double(self) -> Option<f64>;

    /// `value` as a number of this type, if it is one; a float rounds to the nearest.
    fn of_double(value: f64) -> Option<Self>;
}

macro_rules! whole {
    ($($type:ty: $double:expr;)*) => {$(
        impl Number for $type {
            // For 64-bit types, the bound of doubles applies.
            const RANGE: (f64, f64) = (
                (<$type>::MIN as f64).max(-WHOLE),
                (<$type>::MAX as f64).min(WHOLE),
            );

            fn to_double(self) -> Option<f64> {
                let value = ($double)(self);
                let fits = (Self::RANGE.0..=Self::RANGE.1).contains(&value) && value as Self == self;
                fits.then_some(value)
            }

            fn of_double(value: f64) -> Option<Self> {
                let fits = (Self::RANGE.0..=Self::RANGE.1).contains(&value) && value.trunc() == value;
                fits.then_some(value as Self)
            }
        }
    )*};
}

whole! {
    i8: f64::from;
    u8: f64::from;
    i16: f64::from;
    u16: f64::from;
    i32: f64::from;
    u32: f64::from;
    // The nearest double, which is refused if it differs.
    i64: |number| number as f64;
    u64: |number| number as f64;
}

impl Number for f32 {
    const RANGE: (f64, f64) = (f32::MIN as f64, f32::MAX as f64);

    fn to_double(self) -> Option<f64> {
        Some(f64::from(self))
    }

    fn of_double(value: f64) -> Option<Self> {
        // NaN and infinities are preserved.
        let nearest = value as f32;
        (nearest.is_finite() || !value.is_finite()).then_some(nearest)
    }
}

/// A Boolean as libraries represent it: 0 is false, all other bit patterns are true.
#[derive(Clone, Copy, Debug, Default)]
#[repr(transparent)]
pub(crate) struct Truth<T>(pub(crate) T);

impl<T: Display> Display for Truth<T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.fmt(f)
    }
}

impl<T: Copy + Default + Display + PartialEq + From<bool>> Number for Truth<T> {
    const RANGE: (f64, f64) = (0.0, 1.0);

    fn to_double(self) -> Option<f64> {
        Some(f64::from(u8::from(self.0 != T::default())))
    }

    fn of_double(value: f64) -> Option<Self> {
        Some(Self(T::from(value != 0.0)))
    }
}

/// A number that cannot be converted.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Loss {
    /// Its position among the values.
    pub(crate) at: usize,
    /// The number.
    pub(crate) value: String,
    /// The least and the greatest number allowed.
    pub(crate) range: (f64, f64),
}

/// Makes room for `count` numbers in a buffer, which grows if it is too small.
pub(crate) fn room<T: Number>(buffer: &mut Vec<T>, count: usize) -> *mut T {
    buffer.clear();
    buffer.resize(count, T::default());
    buffer.as_mut_ptr()
}

/// Copies numbers out as doubles.
pub(crate) fn give<T: Number>(numbers: &[T], values: &mut [f64]) -> Result<(), Loss> {
    for (at, (number, value)) in numbers.iter().zip(values).enumerate() {
        let lost = || Loss { at, value: number.to_string(), range: T::RANGE };
        *value = number.to_double().ok_or_else(lost)?;
    }
    Ok(())
}

/// Fills a buffer with doubles converted to numbers, and returns its address.
pub(crate) fn take<T: Number>(buffer: &mut Vec<T>, values: &[f64]) -> Result<*const T, Loss> {
    buffer.clear();
    for (at, value) in values.iter().enumerate() {
        let lost = || Loss { at, value: value.to_string(), range: T::RANGE };
        buffer.push(T::of_double(*value).ok_or_else(lost)?);
    }
    Ok(buffer.as_ptr())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_numbers_beyond_a_type_or_a_double_are_refused() {
        assert_eq!(u8::of_double(255.0), Some(255));
        assert_eq!([256.0, -1.0, 0.5, f64::NAN].map(u8::of_double), [None; 4]);
        assert_eq!(i64::of_double(-WHOLE), Some(-9_007_199_254_740_992));
        assert_eq!(i64::of_double(-WHOLE - 2.0), None);
        assert_eq!(9_007_199_254_740_992_u64.to_double(), Some(WHOLE));
        assert_eq!((WHOLE as u64 + 2).to_double(), None);
        // Its double would be that of the number before it.
        assert_eq!((WHOLE as u64 + 1).to_double(), None);
        assert_eq!(u64::MAX.to_double(), None);
        assert_eq!(whole_range(DataType::Int16), Some(i16::RANGE));
        assert_eq!(whole_range(DataType::UInt64), Some(u64::RANGE));
        assert_eq!(whole_range(DataType::Float32), None);
    }

    #[test]
    fn floats_are_rounded_to_the_nearest_and_never_become_infinite() {
        assert_eq!(f32::of_double(0.1), Some(0.1_f32));
        assert_eq!(f32::of_double(1e39), None);
        assert_eq!(f32::of_double(f64::NEG_INFINITY), Some(f32::NEG_INFINITY));
        assert!(f32::of_double(f64::NAN).is_some_and(f32::is_nan));
    }

    #[test]
    fn the_first_number_lost_is_told() {
        let lost = take(&mut Vec::<i8>::new(), &[1.0, 128.0, 999.0]).unwrap_err();
        assert_eq!(lost, Loss { at: 1, value: "128".into(), range: (-128.0, 127.0) });
        let lost = give(&[7, i64::MAX], &mut [0.0; 2]).unwrap_err();
        assert_eq!((lost.at, lost.value.as_str()), (1, "9223372036854775807"));
    }
}
