//! `[vary]`: the distribution of one number, as a function from (0, 1) to its values.

use std::f64::consts::{FRAC_1_SQRT_2, TAU};
use std::fmt;

use punctual_core::elementary;
use punctual_fmu::configuration::{ConfigurationError, Range};
use serde::Deserialize;
use statrs::distribution::{ContinuousCDF, StudentsT};

/// `[vary."component.variable"]`. Only the keys of the chosen `distribution` are allowed.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VarySection {
    /// The distribution.
    distribution: DistributionName,
    /// Least value, in the unit of the variable.
    min: Option<f64>,
    /// Greatest value, in the same unit.
    max: Option<f64>,
    /// Mean of the normal distribution before it is truncated to [min, max], in the same unit.
    mean: Option<f64>,
    /// Standard deviation before truncation, in the same unit, > 0.
    deviation: Option<f64>,
    /// The values to choose from, all equally likely. A sequence takes them one after the other.
    values: Option<Vec<f64>>,
    /// Duration in s of each value of a sequence, > 0.
    period: Option<f64>,
}

/// The distributions, by their names in the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
enum DistributionName {
    Uniform,
    LogUniform,
    Normal,
    Choice,
    Sequence,
    Seed,
}

impl DistributionName {
    /// Its name, the keys it requires and the keys it allows.
    fn keys(self) -> (&'static str, &'static [&'static str], &'static [&'static str]) {
        match self {
            Self::Uniform => ("uniform", &["min", "max"], &[]),
            Self::LogUniform => ("log_uniform", &["min", "max"], &[]),
            Self::Normal => ("normal", &["mean", "deviation"], &["min", "max"]),
            Self::Choice => ("choice", &["values"], &[]),
            Self::Sequence => ("sequence", &["values", "period"], &[]),
            Self::Seed => ("seed", &[], &[]),
        }
    }
}

/// A checked distribution.
#[derive(Clone, Debug)]
pub enum Distribution {
    /// Uniform in [min, max].
    Uniform {
        /// Least value.
        min: f64,
        /// Greatest value.
        max: f64,
    },
    /// The logarithm is uniform between the logarithms of two positive numbers.
    LogUniform {
        /// Least value.
        min: f64,
        /// Greatest value.
        max: f64,
    },
    /// Normal, truncated to [min, max].
    Normal {
        /// Mean before truncation.
        mean: f64,
        /// Standard deviation before truncation, > 0.
        deviation: f64,
        /// Least value; may be −∞.
        min: f64,
        /// Greatest value; may be ∞.
        max: f64,
    },
    /// Picks one of these; all are equally likely.
    Choice(Vec<f64>),
    /// The same in every run: takes these values one after the other from the start, and keeps the last one.
    Sequence {
        /// The values, at least one.
        values: Vec<f64>,
        /// Duration of each value in s, > 0.
        period: f64,
    },
    /// The run's own seed.
    Seed,
}

impl VarySection {
    /// Checks the section for a variable with this range; errors name `field`.
    pub(super) fn checked(&self, field: &str, range: Range) -> Result<Distribution, ConfigurationError> {
        let wrong = |key: &str, message: String| ConfigurationError::new(format!("{field}.{key}"), message);
        // Only the keys of this distribution are allowed.
        let (name, needed, allowed) = self.distribution.keys();
        let numbers = [
            ("min", self.min),
            ("max", self.max),
            ("mean", self.mean),
            ("deviation", self.deviation),
            ("period", self.period),
        ];
        let present = numbers.iter().map(|(key, value)| (*key, value.is_some()));
        for (key, is_there) in present.chain([("values", self.values.is_some())]) {
            if needed.contains(&key) && !is_there {
                return Err(wrong(
                    key,
                    format!("missing; distribution = {name:?} needs {}", needed.join(", ")),
                ));
            }
            if is_there && !needed.contains(&key) && !allowed.contains(&key) {
                let keys: Vec<_> = needed.iter().chain(allowed).copied().collect();
                let keys = if keys.is_empty() { "no other key".to_owned() } else { keys.join(", ") };
                return Err(wrong(key, format!("is not a key of distribution = {name:?}, which has {keys}")));
            }
        }
        // Every number is finite, in order, and within the range of the variable.
        for (key, value) in numbers {
            if let Some(value) = value {
                Range::FINITE.check(&format!("{field}.{key}"), value)?;
            }
        }
        let number = |value: Option<f64>| value.unwrap_or_default();
        let within = |key: &str, value: f64| range.check(&format!("{field}.{key}"), value);
        let (min, max) = (number(self.min), number(self.max));
        if self.min.is_some() && self.max.is_some() && min > max {
            return Err(wrong("max", format!("is {max}, must be >= min = {min}")));
        }
        self.min.map_or(Ok(()), |min| within("min", min))?;
        self.max.map_or(Ok(()), |max| within("max", max))?;
        // Each distribution has conditions of its own.
        match self.distribution {
            DistributionName::Uniform => {
                Range::FINITE.check(&format!("{field}.max - min"), max - min)?;
                Ok(Distribution::Uniform { min, max })
            }
            DistributionName::LogUniform => {
                Range::POSITIVE.check(&format!("{field}.min"), min)?;
                Ok(Distribution::LogUniform { min, max })
            }
            DistributionName::Normal => self.normal(field, range),
            DistributionName::Choice | DistributionName::Sequence => {
                let values = self.values.clone().unwrap_or_default();
                if values.is_empty() {
                    return Err(wrong("values", "is empty, must have at least one value".to_owned()));
                }
                for (i, value) in values.iter().enumerate() {
                    within(&format!("values[{i}]"), *value)?;
                }
                match self.period {
                    None => Ok(Distribution::Choice(values)),
                    Some(period) => {
                        Range::POSITIVE.check(&format!("{field}.period"), period)?;
                        Ok(Distribution::Sequence { values, period })
                    }
                }
            }
            // The range of a seed is [0, 2^53), so a variable with another range is a mistake.
            DistributionName::Seed if range.contains(-1.0) || range.max.is_some() => {
                let message = "is \"seed\", which is for variables that may be any number >= 0".to_owned();
                Err(wrong("distribution", message))
            }
            DistributionName::Seed => Ok(Distribution::Seed),
        }
    }

    fn normal(&self, field: &str, range: Range) -> Result<Distribution, ConfigurationError> {
        let wrong = |key: &str, message: String| ConfigurationError::new(format!("{field}.{key}"), message);
        let (mean, deviation) = (self.mean.unwrap_or_default(), self.deviation.unwrap_or_default());
        Range::POSITIVE.check(&format!("{field}.deviation"), deviation)?;
        for (key, given, bound) in [("min", self.min, range.min), ("max", self.max, range.max)] {
            if let (None, Some(bound)) = (given, bound) {
                let message = format!("missing: the variable is {}, not beyond {bound}", range.describe());
                return Err(wrong(key, message));
            }
        }
        let (min, max) = (self.min.unwrap_or(f64::NEG_INFINITY), self.max.unwrap_or(f64::INFINITY));
        // With a smaller probability, round-off would dominate the interval.
        if below((max - mean) / deviation) - below((min - mean) / deviation) < LEAST_PART {
            let message =
                format!("is {mean}: less than {LEAST_PART} of the distribution is from {min} to {max}");
            return Err(wrong("mean", message));
        }
        Ok(Distribution::Normal { mean, deviation, min, max })
    }
}

/// The distribution as text, without its unit.
impl fmt::Display for Distribution {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Uniform { min, max } => write!(f, "uniform from {min} to {max}"),
            Self::LogUniform { min, max } => write!(f, "log-uniform from {min} to {max}"),
            Self::Normal { mean, deviation, min, max } => {
                write!(f, "normal, mean {mean}, deviation {deviation}")?;
                if min.is_finite() {
                    write!(f, ", from {min}")?;
                }
                if max.is_finite() {
                    write!(f, ", to {max}")?;
                }
                Ok(())
            }
            Self::Choice(values) => {
                let values: Vec<_> = values.iter().map(ToString::to_string).collect();
                write!(f, "one of {}", values.join(", "))
            }
            Self::Sequence { values, period } => {
                let count = values.len();
                write!(f, "a sequence of {count} values, each for {period} s, from {:?} on", values[0])
            }
            Self::Seed => f.write_str("the seed of the run"),
        }
    }
}

/// The least probability that the interval of a truncated normal distribution may have.
const LEAST_PART: f64 = 1e-9;

impl Distribution {
    /// The value at `u` in (0, 1), increasing in `u`, in a run whose own seed is `seed`.
    pub fn value(&self, u: f64, seed: u64) -> f64 {
        match self {
            Self::Uniform { min, max } => (min + u * (max - min)).clamp(*min, *max),
            Self::LogUniform { min, max } => {
                let ratio = max / min;
                let span = match ratio.is_finite() {
                    true => elementary::ln(ratio),
                    false => elementary::ln(*max) - elementary::ln(*min),
                };
                elementary::exp(elementary::ln(*min) + u * span).clamp(*min, *max)
            }
            Self::Normal { mean, deviation, min, max } => {
                let [low, high] = [min, max].map(|end| (end - mean) / deviation);
                // Far above the mean, probabilities below a point are too close to 1 to distinguish; those
                // above it are not.
                let z = match low > 1.0 {
                    true => -quantile(below(-low) + u * (below(-high) - below(-low))),
                    false => quantile(below(low) + u * (below(high) - below(low))),
                };
                (mean + deviation * z).clamp(*min, *max)
            }
            Self::Choice(values) => values[((u * values.len() as f64) as usize).min(values.len() - 1)],
            Self::Sequence { values, .. } => values[0],
            Self::Seed => seed as f64,
        }
    }
}

/// The standard normal distribution function at `z`.
pub(super) fn below(z: f64) -> f64 {
    elementary::erfc(-z * FRAC_1_SQRT_2) / 2.0
}

/// The quantile of the standard normal distribution at `p`.
fn quantile(p: f64) -> f64 {
    if p > 0.5 {
        return -quantile(1.0 - p);
    }
    if p <= 0.0 {
        return f64::NEG_INFINITY;
    }
    // The probability below −z is at most exp(−z²/2)/2, and its logarithm is concave. So Newton's method
    // decreases from this start to the solution, until round-off.
    let mut z = (-2.0 * elementary::ln(2.0 * p)).sqrt();
    loop {
        let part = below(-z);
        let density = elementary::exp(-z * z / 2.0) / TAU.sqrt();
        let next = z + part / density * (elementary::ln(part) - elementary::ln(p));
        if next.is_nan() || next >= z {
            return -z;
        }
        z = next;
    }
}

/// The 0.975 quantile of Student's distribution with `freedom` > 0 degrees of freedom, to nine decimals.
/// Beyond these the platforms' functions differ.
pub(super) fn student(freedom: f64) -> f64 {
    let quantile =
        StudentsT::new(0.0, 1.0, freedom).map_or(f64::INFINITY, |student| student.inverse_cdf(0.975));
    (quantile * 1e9).round() / 1e9
}

#[cfg(test)]
mod tests {
    use super::*;

    fn checked(text: &str, range: Range) -> Result<Distribution, String> {
        let section: VarySection = punctual_fmu::configuration::read_toml(text).map_err(|e| e.to_string())?;
        section.checked("vary.x", range).map_err(|e| e.to_string())
    }

    #[test]
    fn quantiles() {
        let at = |text: &str, u: f64| checked(text, Range::FINITE).unwrap().value(u, 7);
        assert_eq!(at("distribution = \"uniform\"\nmin = -1\nmax = 3", 0.25), 0.0);
        let decade = at("distribution = \"log_uniform\"\nmin = 0.01\nmax = 100", 0.5);
        assert!((decade - 1.0).abs() < 1e-14, "{decade}");
        let normal = "distribution = \"normal\"\nmean = 2\ndeviation = 3";
        // Φ⁻¹(0.975), tables of the normal distribution.
        assert!((at(normal, 0.975) - (2.0 + 3.0 * 1.959_963_984_540_054)).abs() < 1e-14);
        assert!((at(&format!("{normal}\nmin = 2"), 0.5) - (2.0 + 3.0 * 0.674_489_750_196_082)).abs() < 1e-14);
        assert_eq!(at("distribution = \"choice\"\nvalues = [1, 5]", 0.49), 1.0);
        assert_eq!(at("distribution = \"choice\"\nvalues = [1, 5]", 0.51), 5.0);
        assert_eq!(checked("distribution = \"seed\"", Range::NON_NEGATIVE).unwrap().value(0.5, 7), 7.0);
        let tail =
            at("distribution = \"normal\"\nmean = 0\ndeviation = 1\nmin = 5", 1.0 - f64::EPSILON / 2.0);
        assert!(tail > 5.0 && tail < 12.0, "the largest number drawn of a tail: {tail}");
        let wide = at("distribution = \"log_uniform\"\nmin = 1e-9\nmax = 1e300", 0.5);
        assert!((wide / 3.162_277_660_168_379_5e145 - 1.0).abs() < 1e-12, "{wide}");
        let least = at(normal, 0.5 / (1_u64 << 52) as f64);
        assert!(least.is_finite(), "the least number drawn: {least}");
    }

    #[test]
    fn each_defect_names_key_value_and_range() {
        let defects = [
            (
                "distribution = \"uniform\"\nmin = 1",
                "vary.x.max: missing; distribution = \"uniform\" needs min, max",
            ),
            ("distribution = \"uniform\"\nmin = 1\nmax = 0", "vary.x.max: is 0, must be >= min = 1"),
            ("distribution = \"uniform\"\nmin = nan\nmax = 0", "vary.x.min: is NaN, must be finite"),
            (
                "distribution = \"uniform\"\nmin = -2\nmax = 0",
                "vary.x.min: is -2, must be finite and >= -1 and <= 9",
            ),
            (
                "distribution = \"uniform\"\nmin = 0\nmax = 1\nmean = 0",
                "vary.x.mean: is not a key of distribution = \"uniform\", which has min, max",
            ),
            (
                "distribution = \"log_uniform\"\nmin = 0\nmax = 1",
                "vary.x.min: is 0, must be finite and >= 1e-9",
            ),
            (
                "distribution = \"normal\"\nmean = 0\ndeviation = 1\nmax = 9",
                "vary.x.min: missing: the variable is finite and >= -1 and <= 9, not beyond -1",
            ),
            (
                "distribution = \"normal\"\nmean = 90\ndeviation = 1\nmin = 0\nmax = 9",
                "vary.x.mean: is 90: less than 0.000000001 of the distribution is from 0 to 9",
            ),
            ("distribution = \"choice\"\nvalues = []", "vary.x.values: is empty"),
            (
                "distribution = \"choice\"\nvalues = [0, inf]",
                "vary.x.values[1]: is inf, must be finite and >= -1",
            ),
            ("distribution = \"seed\"", "vary.x.distribution: is \"seed\", which is for variables that"),
            ("distribution = \"cauchy\"", "is \"cauchy\", must be "),
            ("mean = 0", "distribution: missing, it must be given"),
        ];
        for (text, expected) in defects {
            let message = checked(text, Range { min: Some(-1.0), max: Some(9.0) }).unwrap_err();
            assert!(message.contains(expected), "{text}: {message}");
        }
    }
}
