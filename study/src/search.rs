//! Searches the best parameters of a method for one vehicle and one setting: on a grid, then again at its
//! best points.

use std::cmp::Ordering;

use punctual_cosim::error::Error;
use rayon::prelude::*;

use super::baseline::Baseline;
use super::starts::drawn;
use super::{Options, Setup, Vehicle, Watch, trial};

/// Seed of the starts for choosing parameters, which no table uses.
pub const SEED: u64 = 1000;
/// Sampling period in s of the first pass; the second has that of the tables.
pub const COARSE: f64 = 0.005;

/// Score of a candidate: first the runs that kept their deadline, then those on time, then the smaller median
/// peak.
#[derive(Clone, Copy, Debug)]
struct Score {
    kept: usize,
    on_time: usize,
    peak: f64,
}

impl Score {
    fn better(&self, other: &Self) -> Ordering {
        let counts = (other.kept, other.on_time).cmp(&(self.kept, self.on_time));
        counts.then(self.peak.total_cmp(&other.peak))
    }
}

fn score(vehicle: Vehicle, baseline: Baseline, setup: &Setup, starts: &[[f64; 4]]) -> Result<Score, Error> {
    let mut peaks = Vec::new();
    let (mut kept, mut on_time) = (0, 0);
    for x0 in starts {
        let outcome = trial::run(vehicle, baseline, setup, *x0)?;
        kept += usize::from(outcome.kept(setup.deadline));
        on_time += usize::from(outcome.by(setup.deadline));
        peaks.push(outcome.peak[0]);
    }
    peaks.sort_by(f64::total_cmp);
    Ok(Score { kept, on_time, peak: peaks[peaks.len() / 2] })
}

/// Number of closed loops that [`best`] runs, for the progress.
pub fn loops(method: Baseline, options: &Options) -> usize {
    let (coarse, fine, finalists) = options.search;
    method.candidates().len() * coarse + finalists * fine
}

/// The best parameters of `method`; the ones it has are not used.
///
/// # Errors
///
/// A parameter out of range.
pub fn best(
    method: Baseline,
    vehicle: Vehicle,
    setup: &Setup,
    options: &Options,
    watch: &Watch,
) -> Result<Baseline, Error> {
    let (coarse, fine, finalists) = options.search;
    let rank = |candidates: &[Baseline], setup: &Setup, count: usize| -> Result<Vec<Baseline>, Error> {
        let starts = drawn(SEED, count);
        let each = |&candidate: &Baseline| {
            let found = score(vehicle, candidate, setup, &starts).map(|score| (score, candidate));
            watch.done(count);
            found
        };
        let mut scores = candidates.par_iter().map(each).collect::<Result<Vec<_>, Error>>()?;
        scores.sort_by(|a, b| a.0.better(&b.0));
        Ok(scores.into_iter().map(|(_, candidate)| candidate).collect())
    };
    let all = method.candidates();
    let first = rank(&all, &Setup { step: COARSE, ..*setup }, coarse)?;
    let second = rank(&first[..finalists.min(first.len())], setup, fine)?;
    Ok(second.first().copied().unwrap_or(method))
}
