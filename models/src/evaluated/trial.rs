//! Tries code at sample states before anything depends on it.

use punctual_core::internal::samples;

use super::{Evaluated, Fault};
use crate::Error;
use crate::motion::Equations;
use crate::series::Series;

/// Step of the differences, relative to a component and absolute. The error of a difference is of the order
/// of its square. This error and round-off are both far below [`APART`], unless a function changes over such
/// a distance.
const REACH: f64 = 1e-5;

/// Relative error that a difference may have. A derivative that is wrong is usually wrong by much more.
const APART: f64 = 0.05;

/// Round-off of a value in a difference, relative to the value.
const ROUND_OFF: f64 = 1e-10;

/// Values and slopes of f, g and all barriers at a sample.
type Outcome = Vec<[f64; 2]>;

/// Runs the code at samples within `ranges`, and compares derivatives with differences.
///
/// # Errors
///
/// Anything that the code must not do.
pub(super) fn run(equations: &mut Evaluated, barriers: usize, ranges: &[[f64; 2]]) -> Result<(), Error> {
    let mut found: Vec<Found> = Vec::new();
    for (k, (t, x)) in samples(ranges).into_iter().enumerate() {
        // Components move forwards and backwards alternately, and no two of them by the same fraction.
        let part = |i: usize| if (i + k).is_multiple_of(2) { 1.0 } else { -0.7 + 0.01 * i as f64 };
        let v: Vec<f64> = x.iter().enumerate().map(|(i, x)| (1.0 + x.abs()) * part(i)).collect();
        let at = |s: f64| x.iter().zip(&v).map(|(x, v)| x + s * v).collect::<Vec<_>>();
        let here = outcome(equations, barriers, t, &x, &v)?;
        let ahead = outcome(equations, barriers, t + REACH, &at(REACH), &v)?;
        let behind = outcome(equations, barriers, t - REACH, &at(-REACH), &v)?;
        found.resize(here.len(), Found::default());
        for (i, found) in found.iter_mut().enumerate() {
            if ![here[i], ahead[i], behind[i]].iter().flatten().all(|v| v.is_finite()) {
                continue;
            }
            found.samples += 1;
            let (slope, difference) = (here[i][1] * REACH, (ahead[i][0] - behind[i][0]) / 2.0);
            let size = slope.abs().max(difference.abs());
            if (slope - difference).abs() > APART * size + ROUND_OFF * here[i][0].abs() {
                found.wrong += 1;
                found.slopes = [slope, difference].map(|change| change / REACH);
            }
        }
    }
    let (states, inputs) = (equations.states(), equations.inputs());
    let place = |i: usize| match i.checked_sub(states) {
        None => format!("f[{i}]"),
        Some(i) if i < states * inputs => format!("g[{i}]"),
        Some(i) => format!("barrier[{}]", i - states * inputs),
    };
    for (i, Found { samples, wrong, slopes: [slope, difference] }) in found.into_iter().enumerate() {
        if samples == 0 {
            let message = "is not finite at any sample: give the states the ranges (min, max) for which the model is meant";
            return Err(Error::new(place(i), message));
        }
        // A few samples prove nothing, since a function may have kinks and jumps.
        if 2 * wrong > samples {
            let message = format!(
                "has a derivative along a direction of {slope:.6e}, but by its values {difference:.6e} at more than half of the samples: probably something was computed from plain values"
            );
            return Err(Error::new(place(i), message));
        }
    }
    Ok(())
}

/// Findings on one component over all samples.
#[derive(Clone, Copy, Default)]
struct Found {
    /// Samples at which the component and its difference are finite.
    samples: usize,
    /// Samples at which slope and difference differ.
    wrong: usize,
    /// Slope and difference at the last wrong sample.
    slopes: [f64; 2],
}

/// Values at `t` and `x`, and slopes along (1, `v`).
fn outcome(
    equations: &mut Evaluated,
    barriers: usize,
    t: f64,
    x: &[f64],
    v: &[f64],
) -> Result<Outcome, Error> {
    let refused = |field: String, fault: Option<Fault>| match fault {
        Some(fault) => Err(Error::new(field, fault.to_string())),
        None => Ok(()),
    };
    let mut series: Series<f64> = equations.series(2);
    for (i, (&x, &v)) in x.iter().zip(v).enumerate() {
        series.set(i, 0, x);
        series.set(i, 1, v);
    }
    series.set(equations.time(), 0, t);
    series.set(equations.time(), 1, 1.0);
    equations.advance(&mut series, 0);
    let asked = equations.asked();
    equations.advance(&mut series, 0);
    let again = (equations.asked() != asked).then_some(Fault::Different);
    refused("plant".to_owned(), equations.fault.or(again))?;
    equations.advance(&mut series, 1);
    let get = |series: &Series<f64>, register| [series.get(register, 0), series.get(register, 1)];
    let written = equations.f.iter().chain(&equations.g);
    let mut outcome: Outcome = written.map(|&number| get(&series, number as usize)).collect();
    equations.registers = equations.registers.max(equations.next);
    for index in 0..barriers {
        equations.barrier = index;
        let mut call = || (equations.finish(&mut series, 1), equations.asked().0);
        let (first, (h, asked)) = (call(), call());
        let again = (first != (h, asked)).then_some(Fault::Different);
        refused(format!("barrier[{index}]"), equations.fault.or(again))?;
        outcome.push(get(&series, h));
    }
    Ok(outcome)
}
