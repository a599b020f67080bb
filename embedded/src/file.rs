//! The file of a filter.

use alloc::vec::Vec;
use core::fmt;

use punctual_core::MAX_ROWS;
use punctual_core::filter::{BarrierSettings, Begin, End, Filter, Sampling, Strictness};
use punctual_models::recorded::{self, BarrierTape, PlantTape};
use serde::{Deserialize, Serialize};

/// The first bytes of a file: what it is, and the version of its format.
const MAGIC: [u8; 8] = *b"PUNCTL\x00\x01";
/// Of the head: the magic, the length of what follows and its CRC-32, both little-endian.
const HEAD: usize = 16;

/// A filter as data: a plant, its barriers, and what is promised of them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FilterFile {
    /// Bounds and times of the whole filter.
    pub settings: Settings,
    /// The plant.
    pub plant: PlantTape,
    /// The barriers, at least one.
    pub barriers: Vec<BarrierFile>,
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
    pub settings: BarrierSettings,
    /// From when on it is enforced.
    pub begin: Begin,
    /// Until when it is enforced.
    pub end: End,
    /// What becomes of it where not all can be met.
    pub strictness: Strictness,
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
    if crate::checksum(content) == number(4) { Ok(content) } else { Err(FileError::Damaged) }
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
        bytes.extend(crate::checksum(&content).to_le_bytes());
        bytes.extend(content);
        Ok(bytes)
    }

    /// Reads the bytes of a file. What follows its end is ignored.
    ///
    /// # Errors
    ///
    /// Bytes that are no such file.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, FileError> {
        postcard::from_bytes(content(bytes)?).map_err(|_| FileError::Damaged)
    }

    /// The filter, not yet anchored.
    ///
    /// # Errors
    ///
    /// What the tapes or the numbers lack.
    pub fn into_filter(self) -> Result<Filter, FileError> {
        let Self { settings, plant, barriers } = self;
        if barriers.len() > MAX_ROWS {
            return Err(FileError::Room);
        }
        let (states, inputs) = (plant.states(), plant.inputs());
        let mut tapes = Vec::with_capacity(barriers.len());
        let mut promises = Vec::with_capacity(barriers.len());
        for barrier in barriers {
            tapes.push((barrier.tape, usize::from(barrier.relative_degree)));
            promises.push((barrier.settings, barrier.begin, barrier.end, barrier.strictness));
        }
        let sources = recorded::sources(plant, tapes).map_err(|_| FileError::Room)?;
        let mut builder = Filter::from_sources(states, inputs).room_for(sources.len());
        let range = |_: punctual_core::Error| FileError::Range;
        for (source, (promise, begin, end, strictness)) in sources.into_iter().zip(promises) {
            builder = builder.source("", source, promise).map_err(range)?;
            builder = builder.window(begin, end).and_then(|b| b.strictness(strictness)).map_err(range)?;
        }
        let bound = |side: usize| settings.bounds.iter().map(move |bounds| bounds[side]);
        let (min, max): (Vec<f64>, Vec<f64>) = (bound(0).collect(), bound(1).collect());
        builder = builder.bounds(&min, &max).map_err(range)?;
        builder = builder.correction_limit(settings.correction_limit).map_err(range)?;
        builder = builder.actuation_delay(settings.actuation_delay).map_err(range)?;
        if settings.period_max != 0.0 {
            builder = builder.period_max(settings.period_max).map_err(range)?;
        }
        builder = builder.arm_after(settings.arm_after).map_err(range)?;
        builder.sampling(settings.sampling).and_then(|b| b.build()).map_err(range)
    }
}
