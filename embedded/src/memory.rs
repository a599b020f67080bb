//! How much memory the filter of a file takes, found without allocating.

use punctual_core::filter::{Begin, End, Filter, Strictness};
use punctual_core::{MAX_INPUTS, MAX_ROWS};
use punctual_models::MAX_STATES;
use punctual_models::recorded::{self, BarrierSize, PlantSize, Tallied, Tally};
use serde::Deserialize;

use crate::file::{FileError, Promise, Settings, content};

/// The size of a file: the same bytes as [`FilterFile`](crate::FilterFile).
#[derive(Deserialize)]
struct FileSize {
    settings: Settings<Tallied<Bounds>>,
    plant: PlantSize,
    barriers: Tallied<Barriers>,
}

#[derive(Deserialize)]
struct One {
    tape: BarrierSize,
    relative_degree: u8,
    _promise: Promise,
    _begin: Begin,
    _end: End,
    _strictness: Strictness,
    _is_planned: bool,
}

#[derive(Default)]
struct Barriers {
    count: usize,
    largest: BarrierSize,
    degree: usize,
}

impl Tally for Barriers {
    type Item = One;

    fn add(&mut self, one: One) {
        self.count += 1;
        self.largest = self.largest.max(one.tape);
        self.degree = self.degree.max(usize::from(one.relative_degree));
    }
}

#[derive(Default)]
struct Bounds(usize);

impl Tally for Bounds {
    type Item = [f64; 2];

    fn add(&mut self, _: [f64; 2]) {
        self.0 += 1;
    }
}

/// Room in bytes for the words of an error, of which the caller gets the kind alone.
const WORDS: usize = 1024;

/// The size of a file and of its filter, read without allocating.
pub struct Size(FileSize);

impl Size {
    /// The size of the file with these bytes.
    ///
    /// # Errors
    ///
    /// Bytes that are no such file; more than there is room for.
    pub fn of(file: &[u8]) -> Result<Self, FileError> {
        let size: FileSize = postcard::from_bytes(content(file)?).map_err(|_| FileError::Damaged)?;
        let (Tallied(barriers), plant) = (&size.barriers, &size.plant);
        let fits = barriers.count <= MAX_ROWS && plant.states() <= MAX_STATES && plant.inputs() <= MAX_INPUTS;
        if fits { Ok(Self(size)) } else { Err(FileError::Room) }
    }

    /// The most results of a barrier.
    pub fn results(&self) -> usize {
        self.0.barriers.0.largest.results()
    }

    /// The highest relative degree.
    pub fn degree(&self) -> usize {
        self.0.barriers.0.degree
    }

    /// The numbers of states and inputs.
    pub fn dimensions(&self) -> [usize; 2] {
        [self.0.plant.states(), self.0.plant.inputs()]
    }

    /// The most bytes that reading the file and making its filter take; `None` where that is no number.
    pub fn memory(&self) -> Option<usize> {
        let FileSize { settings, plant, barriers: Tallied(barriers) } = &self.0;
        let tapes = recorded::memory(plant, barriers.count, &barriers.largest, barriers.degree)?;
        let filter = Filter::memory(
            (barriers.count, plant.states()),
            (settings.actuation_delay, settings.sampling, settings.brief_search),
            settings.period_max > 0.0,
        );
        // The bounds are read, and handed on as two lists that grow.
        let bounds = settings.bounds.0.0.checked_mul(4 * size_of::<[f64; 2]>())?;
        tapes.checked_add(bounds)?.checked_add(filter)?.checked_add(WORDS)
    }
}
