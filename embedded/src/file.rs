//! The file of a filter.

use alloc::vec::Vec;
use core::fmt;

use punctual_core::convergence::operator::Operator;
use punctual_core::filter::{
    BarrierSettings, Begin, End, Infeasible, Method, ProfileKind, Sampling, Strictness,
};
use punctual_models::recorded::{BarrierTape, PlantTape};
use serde::{Deserialize, Serialize};

use crate::checksum::checksum;

/// The first bytes of a file: what it is, and the version of its format.
const MAGIC: [u8; 8] = *b"PUNCTL\x00\x02";
/// Of the head: the magic, the length of what follows and its CRC-32, both little-endian.
const HEAD: usize = 16;

/// The most rates of a promise: one for each order of the highest relative degree of any library.
const MOST_RATES: usize = 8;

/// A filter as data: a plant, its barriers, and what is promised of them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FilterFile {
    /// Bounds and times of the whole filter.
    pub settings: Settings,
    /// The plant.
    pub plant: PlantTape,
    /// The barriers, at least one.
    pub barriers: Vec<BarrierFile>,
    /// The bytes of a [`PlanTable`](punctual_core::follower::PlanTable); empty for rows alone.
    pub plan: Vec<u8>,
}

/// Bounds and times of a filter, as its [builder](punctual_core::filter::FilterBuilder) takes them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Settings<B = Vec<[f64; 2]>> {
    /// `[min, max]` of each input, infinite where there is none.
    pub bounds: B,
    /// How the filter accounts for inputs that are held.
    pub sampling: Sampling,
    /// The largest ‖u − u_ref‖ of a sample, in units of u.
    pub correction_limit: f64,
    /// Whether the search over the period is brief.
    pub brief_search: bool,
    /// The time in s until an input acts, ≥ 0.
    pub actuation_delay: f64,
    /// The longest time in s between two steps; 0 if it is not given.
    pub period_max: f64,
    /// The time in s from the first step until the filter is armed, ≥ 0.
    pub arm_after: f64,
}

/// A barrier of a [`FilterFile`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BarrierFile {
    /// Its operations.
    pub tape: BarrierTape,
    /// Its relative degree.
    pub relative_degree: u8,
    /// Its promise.
    pub promise: Promise,
    /// From when on it is enforced.
    pub begin: Begin,
    /// Until when it is enforced.
    pub end: End,
    /// What becomes of it where not all can be met.
    pub strictness: Strictness,
    /// Whether the plan keeps it.
    pub is_planned: bool,
}

/// The settings of a promise, as numbers that are read without allocating.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Promise {
    deadline: Option<f64>,
    method: Method,
    profile: ProfileKind,
    infeasible: Infeasible,
    rate: Option<f64>,
    /// As many as the relative degree, then zeros.
    rates: Option<[f64; MOST_RATES]>,
    stay_rate: Option<f64>,
    margin: f64,
    recovery: Option<f64>,
    disturbance: f64,
}

impl Promise {
    /// The promise with these settings.
    pub fn of(settings: &BarrierSettings) -> Self {
        let BarrierSettings {
            deadline, method, profile, infeasible, rate, stay_rate, margin, recovery, ..
        } = *settings;
        let rates = settings.rates.map(|rates| {
            let rates = Vec::from(rates);
            core::array::from_fn(|i| rates.get(i).copied().unwrap_or(0.0))
        });
        let disturbance = settings.disturbance;
        Self { deadline, method, profile, infeasible, rate, rates, stay_rate, margin, recovery, disturbance }
    }

    /// The settings for relative degree `n`, of 1 to [`MOST_RATES`].
    pub(crate) fn settings(self, n: usize) -> Result<BarrierSettings, punctual_core::Error> {
        let rates = self.rates.as_ref().and_then(|rates| rates.get(..n));
        let rates = rates.map(Operator::new).transpose()?;
        Ok(BarrierSettings::keeping()
            .deadline(self.deadline)
            .method(self.method)
            .profile(self.profile)
            .infeasible(self.infeasible)
            .rate(self.rate)
            .rates(rates)
            .stay_rate(self.stay_rate)
            .margin(self.margin)
            .recovery(self.recovery)
            .disturbance(self.disturbance))
    }
}

/// Why a file is no filter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum FileError {
    /// It is no file of this format and version.
    Format,
    /// Its end is missing, or its bytes are not those that were written.
    Damaged,
    /// It needs more inputs, a higher relative degree or more rows than this library has room for: build it without the
    /// feature `small`.
    Room,
    /// A number of it is out of its range.
    Range,
}

impl fmt::Display for FileError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Format => "is no filter of this version: write it again with `punctual build --embedded`",
            Self::Damaged => "is damaged: its checksum differs",
            Self::Room => "needs more room than this library has: build it without the feature `small`",
            Self::Range => "has a number out of its range",
        })
    }
}

impl core::error::Error for FileError {}

/// What is behind the head of a file.
pub(crate) fn content(bytes: &[u8]) -> Result<&[u8], FileError> {
    let (head, rest) = bytes.split_first_chunk::<HEAD>().ok_or(FileError::Format)?;
    let (magic, numbers) = head.split_first_chunk::<8>().ok_or(FileError::Format)?;
    if *magic != MAGIC {
        return Err(FileError::Format);
    }
    let number = |at: usize| u32::from_le_bytes(core::array::from_fn(|i| numbers[at + i]));
    let content = rest.get(..number(0) as usize).ok_or(FileError::Damaged)?;
    if checksum(content) == number(4) { Ok(content) } else { Err(FileError::Damaged) }
}

impl FilterFile {
    /// The bytes of the file.
    ///
    /// # Errors
    ///
    /// None in practice: it needs more than 4 GB.
    pub fn to_bytes(&self) -> Result<Vec<u8>, FileError> {
        let content = postcard::to_allocvec(self).map_err(|_| FileError::Range)?;
        let length = u32::try_from(content.len()).map_err(|_| FileError::Range)?;
        let mut bytes = MAGIC.to_vec();
        bytes.extend(length.to_le_bytes());
        bytes.extend(checksum(&content).to_le_bytes());
        bytes.extend(content);
        Ok(bytes)
    }
}
