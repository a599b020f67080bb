//! The filter of a file.

use alloc::vec::Vec;

use punctual_core::filter::{Filter, FilterBuilder};
use punctual_models::recorded::{PlantTape, Recording};

use crate::file::{BarrierFile, FileError, Settings, content};
use crate::memory::Size;

/// The filter in the bytes of a file, not yet anchored. What follows the end of the file is ignored.
///
/// # Errors
///
/// Bytes that are no such file; what its tapes or its numbers lack.
pub fn read(bytes: &[u8]) -> Result<Filter, FileError> {
    let size = Size::of(bytes)?;
    let damaged = |_: postcard::Error| FileError::Damaged;
    let (settings, rest): (Settings, _) = postcard::take_from_bytes(content(bytes)?).map_err(damaged)?;
    let (plant, rest): (PlantTape, _) = postcard::take_from_bytes(rest).map_err(damaged)?;
    let (count, mut rest): (usize, _) = postcard::take_from_bytes(rest).map_err(damaged)?;
    let mut builder = Filter::from_sources(plant.states(), plant.inputs()).room_for(count);
    let room = |_: punctual_models::Error| FileError::Room;
    let range = |_: punctual_core::Error| FileError::Range;
    let recording = Recording::new(plant, size.results(), size.degree()).map_err(room)?;
    for _ in 0..count {
        let barrier: BarrierFile;
        (barrier, rest) = postcard::take_from_bytes(rest).map_err(damaged)?;
        let n = usize::from(barrier.relative_degree);
        let source = recording.source(barrier.tape, n).map_err(room)?;
        let settings = barrier.promise.settings(n).map_err(range)?;
        builder = builder.source("", source, settings).map_err(range)?;
        builder = builder.window(barrier.begin, barrier.end).map_err(range)?;
        builder = builder.strictness(barrier.strictness).map_err(range)?;
    }
    let (min, max): (Vec<f64>, Vec<f64>) = settings.bounds.iter().map(|[min, max]| (*min, *max)).unzip();
    builder = builder.bounds(&min, &max).map_err(range)?;
    builder = builder.correction_limit(settings.correction_limit).map_err(range)?;
    builder = builder.actuation_delay(settings.actuation_delay).map_err(range)?;
    if settings.period_max != 0.0 {
        builder = builder.period_max(settings.period_max).map_err(range)?;
    }
    builder = builder.arm_after(settings.arm_after).map_err(range)?;
    builder.sampling(settings.sampling).and_then(FilterBuilder::build).map_err(range)
}
