//! What arrives of an input: late by a delay, followed with a first-order lag, and a part of that.
//!
//! With the delay d, the time constant τ and the gain g, the input that acts is g a, where τ da/dt = u(t − d) − a, and a = u(t − d) if
//! τ = 0. Since u is piecewise constant, a is known exactly, and so is its mean over any part of a hold.

use punctual_core::elementary::exp;

use super::record::Episode;

/// The parts of a hold over which an input is averaged.
pub(super) const PARTS: usize = 8;

/// Where the parts of a hold begin and end, as fractions of it.
pub(super) type Parts = [f64; PARTS + 1];

/// Parts of which none has two inputs behind `delay` (s), in holds of `period` s.
pub(super) fn parts(delay: f64, period: f64) -> Parts {
    // Nearer to the beginning or the end of a hold it is round-off.
    const NEAR: f64 = 1e-6;
    let cut = (delay / period).fract();
    if !(NEAR..1.0 - NEAR).contains(&cut) {
        return std::array::from_fn(|s| s as f64 / PARTS as f64);
    }
    let first = ((cut * PARTS as f64).round() as usize).clamp(1, PARTS - 1);
    let place = |s: usize| {
        if s <= first {
            cut * s as f64 / first as f64
        } else {
            cut + (1.0 - cut) * (s - first) as f64 / (PARTS - first) as f64
        }
    };
    std::array::from_fn(place)
}

/// What was asked before a recording begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Before {
    /// 0, as before the first step of a filter.
    Nothing,
    /// What was asked first.
    First,
}

/// How the inputs of a plant arrive.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Arrival {
    /// In s, ≥ 0; of all inputs.
    pub(super) delay: f64,
    /// Time constants in s, ≥ 0; by input.
    pub(super) lags: Vec<f64>,
    /// The part that acts; by input.
    pub(super) gains: Vec<f64>,
    pub(super) before: Before,
}

impl Arrival {
    /// At once and all of it.
    pub(super) fn nominal(inputs: usize) -> Self {
        Self { delay: 0.0, lags: vec![0.0; inputs], gains: vec![1.0; inputs], before: Before::Nothing }
    }
}

/// A time during which one value is asked, within one part of a hold.
struct Piece {
    /// The part, counted from the first of the first hold.
    part: usize,
    /// What is asked, behind the delay.
    asked: f64,
    /// In s.
    length: f64,
}

/// What is asked of input `j` behind the delay, piece by piece.
fn pieces(episode: &Episode, j: usize, delay: f64, before: Before, parts: &Parts) -> Vec<Piece> {
    let (times, inputs) = (&episode.times, &episode.inputs[j]);
    let mut pieces = Vec::with_capacity(episode.holds() * PARTS);
    // The number of holds whose input was asked; that of the last of them is what is asked now.
    let mut asked = 0;
    for k in 0..episode.holds() {
        let (begin, length) = (times[k], times[k + 1] - times[k]);
        // Below it is round-off of the times.
        let least = 1e-9 * length;
        for s in 0..PARTS {
            let ends = [s, s + 1].map(|s| begin + length * parts[s]);
            let mut t = ends[0];
            while ends[1] - t > least {
                while asked < episode.holds() && times[asked] + delay <= t + least {
                    asked += 1;
                }
                let next = if asked < episode.holds() { times[asked] + delay } else { f64::INFINITY };
                let end = next.min(ends[1]);
                let value = if asked > 0 { inputs[asked - 1] } else { earlier(episode, j, before) };
                pieces.push(Piece { part: k * PARTS + s, asked: value, length: end - t });
                t = end;
            }
        }
    }
    pieces
}

/// What was asked before the recording.
fn earlier(episode: &Episode, j: usize, before: Before) -> f64 {
    match before {
        Before::Nothing => 0.0,
        Before::First => episode.inputs[j].first().copied().unwrap_or(0.0),
    }
}

/// The mean of a over each of the [`PARTS`] parts of each hold of `episode`, for input `j`.
pub(super) fn means(
    episode: &Episode,
    j: usize,
    (delay, lag): (f64, f64),
    before: Before,
    parts: &Parts,
) -> Vec<f64> {
    let all = episode.holds() * PARTS;
    let (mut integrals, mut lengths) = (vec![0.0; all], vec![0.0; all]);
    let mut a = earlier(episode, j, before);
    for Piece { part, asked: u, length } in pieces(episode, j, delay, before, parts) {
        if lag > 0.0 {
            let rest = exp(-length / lag);
            integrals[part] += u * length + (a - u) * lag * (1.0 - rest);
            a = u + (a - u) * rest;
        } else {
            integrals[part] += u * length;
        }
        lengths[part] += length;
    }
    integrals
        .iter()
        .zip(&lengths)
        .map(|(integral, length)| integral / length.max(f64::MIN_POSITIVE))
        .collect()
}

/// An interval for each part of each hold that contains a, whatever was asked before the recording and however the time
/// constant varies within `lag`.
pub(super) fn enclosures(
    episode: &Episode,
    j: usize,
    delay: f64,
    lag: [f64; 2],
    parts: &Parts,
) -> Vec<[f64; 2]> {
    let both = [Before::Nothing, Before::First].map(|before| earlier(episode, j, before));
    let mut a = [both[0].min(both[1]), both[0].max(both[1])];
    // A delay hides which of both was asked.
    let [nothing, first] =
        [Before::Nothing, Before::First].map(|before| pieces(episode, j, delay, before, parts));
    let mut all = vec![[f64::INFINITY, f64::NEG_INFINITY]; episode.holds() * PARTS];
    for (one, other) in nothing.iter().zip(&first) {
        let asked = [one.asked.min(other.asked), one.asked.max(other.asked)];
        // An end moves towards what is asked as fast as it may where that widens the interval, else as slowly as it may.
        let end = |a: f64, u: f64, outwards: bool| {
            let lag = if outwards { lag[0] } else { lag[1] };
            if lag > 0.0 { u + (a - u) * exp(-one.length / lag) } else { u }
        };
        let next = [end(a[0], asked[0], asked[0] < a[0]), end(a[1], asked[1], asked[1] > a[1])];
        let cell = &mut all[one.part];
        // If nothing lags, what is asked is what arrives.
        let begin = if lag[1] > 0.0 { a } else { next };
        *cell = [cell[0].min(begin[0]).min(next[0]), cell[1].max(begin[1]).max(next[1])];
        a = next;
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    const EQUAL: Parts = [0.0, 0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875, 1.0];

    fn episode(inputs: Vec<f64>) -> Episode {
        let times = (0..=inputs.len()).map(|k| 0.1 * k as f64).collect();
        let last = inputs.last().copied();
        Episode { times, states: Vec::new(), inputs: vec![inputs.into_iter().chain(last).collect()] }
    }

    #[test]
    fn no_part_has_two_inputs() {
        assert_eq!(parts(0.0, 0.1), EQUAL);
        assert_eq!(parts(0.2, 0.1), EQUAL);
        for delay in [0.013, 0.0999, 0.1001, 0.34] {
            let parts = parts(delay, 0.1);
            let cut = (delay / 0.1_f64).fract();
            assert!(parts.windows(2).all(|ends| ends[0] < ends[1]), "{parts:?}");
            assert!(parts.iter().any(|place| (place - cut).abs() < 1e-12), "{parts:?}");
        }
    }

    #[test]
    fn a_delay_shifts_and_a_lag_follows() {
        let step = episode(vec![0.0, 1.0, 1.0]);
        let late = means(&step, 0, (0.05, 0.0), Before::Nothing, &EQUAL);
        let wanted = |i: usize| if i < PARTS + PARTS / 2 { 0.0 } else { 1.0 };
        assert!(late.iter().enumerate().all(|(i, mean)| (mean - wanted(i)).abs() < 1e-9), "{late:?}");
        // The mean of 1 - exp(-t/tau) over the hold after the step.
        let lagged = means(&step, 0, (0.0, 0.2), Before::Nothing, &EQUAL);
        let hold = lagged[PARTS..2 * PARTS].iter().sum::<f64>() / PARTS as f64;
        assert!((hold - (1.0 - 2.0 * (1.0 - (-0.5_f64).exp()))).abs() < 1e-12, "{hold}");
    }

    #[test]
    fn enclosures_contain_every_constant_lag_and_both_beginnings() {
        let recorded = episode(vec![1.0, -1.0, 0.5, 0.5, -0.2, 2.0]);
        let within = enclosures(&recorded, 0, 0.03, [0.05, 0.15], &EQUAL);
        for lag in [0.05, 0.1, 0.15] {
            for before in [Before::Nothing, Before::First] {
                for (mean, [min, max]) in means(&recorded, 0, (0.03, lag), before, &EQUAL).iter().zip(&within)
                {
                    assert!((min - 1e-12..=max + 1e-12).contains(mean), "{lag}: {mean} in {min}..{max}");
                }
            }
        }
        let exact = enclosures(&episode(vec![1.0, 1.0, 3.0]), 0, 0.0, [0.0, 0.0], &EQUAL);
        assert!(exact[2 * PARTS..].iter().all(|cell| *cell == [3.0, 3.0]), "{exact:?}");
    }
}
