//! How much memory the filter of a file takes, found without allocating.

use core::mem::size_of;

use punctual_core::filter::{BarrierSettings, Begin, End, Filter, Strictness};
use punctual_core::{MAX_INPUTS, MAX_ROWS};
use punctual_models::MAX_STATES;
use punctual_models::recorded::{self, BarrierSize, PlantSize, Tallied, Tally};
use serde::Deserialize;

use crate::file::{BarrierFile, FileError, Settings, content};

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
    _promise: BarrierSettings,
    _begin: Begin,
    _end: End,
    _strictness: Strictness,
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

/// The most bytes that reading the file and making its filter take.
///
/// # Errors
///
/// Bytes that are no such file; more than there is room for.
pub(crate) fn needed(file: &[u8]) -> Result<usize, FileError> {
    let FileSize { settings, plant, barriers: Tallied(barriers) } =
        postcard::from_bytes(content(file)?).map_err(|_| FileError::Damaged)?;
    if barriers.count > MAX_ROWS || plant.states() > MAX_STATES || plant.inputs() > MAX_INPUTS {
        return Err(FileError::Room);
    }
    let needed = || {
        let tapes = recorded::memory(&plant, barriers.count, &barriers.largest, barriers.degree)?;
        let promise = size_of::<BarrierFile>() + size_of::<One>();
        let lists = settings.bounds.0.0.checked_mul(2 * size_of::<[f64; 2]>())?;
        let filter = Filter::memory(
            (barriers.count, plant.states()),
            (settings.actuation_delay, settings.sampling),
            settings.period_max > 0.0,
        );
        tapes.checked_add(barriers.count * promise)?.checked_add(lists)?.checked_add(filter)
    };
    needed().ok_or(FileError::Room)
}
