//! Numbers in files. JSON knows neither infinity nor NaN, and both are ordinary here: a deadline that there is not is
//! infinite. Formats for people get them as words, `"inf"`, `"-inf"` and `"NaN"`; others get the number.

use core::fmt;

use serde::de::{DeserializeOwned, Error, Unexpected, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

pub(crate) fn serialize<T: Real, S: Serializer>(value: &T, to: S) -> Result<S::Ok, S::Error> {
    value.to_file().serialize(to)
}

pub(crate) fn deserialize<'de, T: Real, D: Deserializer<'de>>(from: D) -> Result<T, D::Error> {
    Deserialize::deserialize(from).map(T::from_file)
}

/// One number, an optional one, or several.
pub(crate) trait Real {
    type File: Serialize + DeserializeOwned;

    fn to_file(&self) -> Self::File;
    fn from_file(file: Self::File) -> Self;
}

impl Real for f64 {
    type File = Number;

    fn to_file(&self) -> Number {
        Number(*self)
    }

    fn from_file(file: Number) -> Self {
        file.0
    }
}

impl<T: Real> Real for Option<T> {
    type File = Option<T::File>;

    fn to_file(&self) -> Self::File {
        self.as_ref().map(T::to_file)
    }

    fn from_file(file: Self::File) -> Self {
        file.map(T::from_file)
    }
}

impl<T: Real, const N: usize> Real for [T; N]
where
    [T::File; N]: Serialize + DeserializeOwned,
{
    type File = [T::File; N];

    fn to_file(&self) -> Self::File {
        self.each_ref().map(T::to_file)
    }

    fn from_file(file: Self::File) -> Self {
        file.map(T::from_file)
    }
}

pub(crate) struct Number(f64);

impl Serialize for Number {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        match self.0 {
            number if number.is_finite() || !to.is_human_readable() => to.serialize_f64(number),
            number => to.collect_str(&number),
        }
    }
}

impl<'de> Deserialize<'de> for Number {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        if from.is_human_readable() {
            from.deserialize_any(NumberOrWord)
        } else {
            f64::deserialize(from).map(Self)
        }
    }
}

struct NumberOrWord;

impl Visitor<'_> for NumberOrWord {
    type Value = Number;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a number, \"inf\", \"-inf\" or \"NaN\"")
    }

    fn visit_f64<E: Error>(self, number: f64) -> Result<Number, E> {
        Ok(Number(number))
    }

    fn visit_i64<E: Error>(self, number: i64) -> Result<Number, E> {
        Ok(Number(number as f64))
    }

    fn visit_u64<E: Error>(self, number: u64) -> Result<Number, E> {
        Ok(Number(number as f64))
    }

    fn visit_str<E: Error>(self, word: &str) -> Result<Number, E> {
        match word {
            "inf" => Ok(Number(f64::INFINITY)),
            "-inf" => Ok(Number(f64::NEG_INFINITY)),
            "NaN" => Ok(Number(f64::NAN)),
            _ => Err(E::invalid_value(Unexpected::Str(word), &self)),
        }
    }
}
