//! The filter of a file, and the follower of its plan.

use alloc::vec::Vec;

use punctual_core::filter::{Filter, FilterBuilder, Status};
use punctual_core::follower::{Follower, Following, PlanTable};
use punctual_core::{Error, MAX_ROWS};
use punctual_models::recorded::{PlantTape, Recording};

use crate::file::{BarrierFile, FileError, Settings, content};
use crate::memory::Size;

/// A filter of a file. While its plan is followed, the plan decides, and the rows report alone; without a plan, or once that ends
/// or its guarantee is lost, the rows decide.
pub struct Loaded<'a> {
    /// The rows.
    pub filter: Filter,
    /// The follower of the plan, if there is one.
    pub follower: Option<Follower<'a>>,
    /// Of each barrier whether the plan keeps it.
    planned: [bool; MAX_ROWS],
}

/// What a step did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// What became of u_ref.
    pub status: Status,
    /// Rounds of the active-set method of the rows.
    pub iterations: u32,
    /// The period in s over which the rows hold, 0 if at the sample alone.
    pub period: f64,
}

impl Loaded<'_> {
    /// Writes to `u` the safe input nearest to `u_ref` at time `t` (s) and state `x`. Does not allocate.
    ///
    /// # Errors
    ///
    /// A slice of the wrong length.
    pub fn step(&mut self, t: f64, x: &[f64], u_ref: &[f64], u: &mut [f64]) -> Result<Step, Error> {
        if let Some(follower) = &mut self.follower
            && follower.step(t, x, u_ref, u)? == Following::Kept
        {
            let report = self.filter.observe(t, x, u)?;
            let status = if u == u_ref { Status::Unchanged } else { Status::Filtered };
            return Ok(Step { status, iterations: 0, period: report.period });
        }
        let report = self.filter.step(t, x, u_ref, u)?;
        Ok(Step { status: report.status, iterations: report.iterations, period: report.period })
    }

    /// Whether the promise of barrier number `i` is kept, whatever u_ref comes.
    pub fn is_guaranteed(&self, i: usize) -> bool {
        self.until().is_some() && self.planned.get(i) == Some(&true)
    }

    /// The time in s until which [these](Self::is_guaranteed) promises are kept; `None` if there are none.
    pub fn until(&self) -> Option<f64> {
        self.follower.as_ref()?.until()
    }

    /// Starts every deadline again at the next step, and the plan.
    pub fn rearm(&mut self) {
        self.filter.rearm();
        if let Some(follower) = &mut self.follower {
            follower.rearm();
        }
    }
}

/// The filter in the bytes of a file, not yet anchored. Its plan stays there. What follows the end of the file is ignored.
///
/// # Errors
///
/// Bytes that are no such file; what its tapes or its numbers lack.
pub fn read(bytes: &[u8]) -> Result<Loaded<'_>, FileError> {
    let size = Size::of(bytes)?;
    let damaged = |_: postcard::Error| FileError::Damaged;
    let (settings, rest): (Settings, _) = postcard::take_from_bytes(content(bytes)?).map_err(damaged)?;
    let (plant, rest): (PlantTape, _) = postcard::take_from_bytes(rest).map_err(damaged)?;
    let (count, mut rest): (usize, _) = postcard::take_from_bytes(rest).map_err(damaged)?;
    let mut builder = Filter::from_sources(plant.states(), plant.inputs()).room_for(count);
    let room = |_: punctual_models::Error| FileError::Room;
    let range = |_: Error| FileError::Range;
    let recording = Recording::new(plant, size.results(), size.degree()).map_err(room)?;
    let mut planned = [false; MAX_ROWS];
    for is_planned in planned.iter_mut().take(count) {
        let barrier: BarrierFile;
        (barrier, rest) = postcard::take_from_bytes(rest).map_err(damaged)?;
        *is_planned = barrier.is_planned;
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
    builder = builder.brief_search(settings.brief_search);
    if settings.period_max != 0.0 {
        builder = builder.period_max(settings.period_max).map_err(range)?;
    }
    builder = builder.arm_after(settings.arm_after).map_err(range)?;
    let (plan, _): (&[u8], _) = postcard::take_from_bytes(rest).map_err(damaged)?;
    let follower = match plan {
        [] => None,
        plan => Some(Follower::new(PlanTable::read(plan).map_err(range)?)),
    };
    // It is for this plant.
    let table = follower.as_ref().map(Follower::table);
    if table.is_some_and(|table| [table.states(), table.inputs()] != size.dimensions()) {
        return Err(FileError::Range);
    }
    let filter = builder.sampling(settings.sampling).and_then(FilterBuilder::build).map_err(range)?;
    Ok(Loaded { filter, follower, planned })
}
