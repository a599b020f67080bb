//! Quadratic programs for the tests: short constructors and proptest strategies.

#![allow(dead_code, reason = "each test binary uses its part")]

pub(crate) mod random;

use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use punctual_core::MAX_INPUTS;
use punctual_core::qp::{Bounds, Row};

/// `cases` runs from a fixed seed, so that a failure repeats; `PROPTEST_RNG_SEED` takes another.
pub(crate) fn config(cases: u32) -> ProptestConfig {
    let default = ProptestConfig::default();
    let rng_seed = match default.rng_seed {
        RngSeed::Random => RngSeed::Fixed(2507),
        fixed => fixed,
    };
    let cases = if std::env::var_os("PROPTEST_CASES").is_some() { default.cases } else { cases };
    ProptestConfig { cases, rng_seed, failure_persistence: None, ..default }
}

/// aᵀu ≥ b.
pub(crate) fn row(normal: &[f64], floor: f64) -> Row {
    let mut row = Row { floor, ..Row::ZERO };
    row.normal[..normal.len()].copy_from_slice(normal);
    row
}

/// Bounds on the first components, none on the others.
pub(crate) fn bounds(min: &[f64], max: &[f64]) -> Bounds {
    let mut b = Bounds::NONE;
    b.min[..min.len()].copy_from_slice(min);
    b.max[..max.len()].copy_from_slice(max);
    b
}

/// The sum of the absolute values of what a slack is the difference of.
pub(crate) fn terms(row: &Row, u: &[f64]) -> f64 {
    row.normal.iter().zip(u).map(|(a, v)| (a * v).abs()).sum::<f64>() + row.floor.abs()
}

/// A component of a normal: often 0, else of either sign over six decades.
fn component() -> impl Strategy<Value = f64> {
    prop_oneof![
        1 => Just(0.0),
        6 => (-3.0..3.0, any::<bool>()).prop_map(|(e, s): (f64, bool)| if s { 10_f64.powf(e) } else { -10_f64.powf(e) }),
    ]
}

/// A pair of bounds, each of which may be missing; now and then they are equal.
pub(crate) fn interval() -> impl Strategy<Value = (f64, f64)> {
    (-10.0..10.0, prop_oneof![1 => Just(0.0), 6 => 0.0..10.0], 0..4).prop_map(|(low, width, kind)| match kind
    {
        0 => (f64::NEG_INFINITY, low + width),
        1 => (low, f64::INFINITY),
        _ => (low, low + width),
    })
}

fn box_of(intervals: &[(f64, f64)], present: bool) -> Bounds {
    let mut b = Bounds::NONE;
    if present {
        for (i, (low, high)) in intervals.iter().enumerate() {
            (b.min[i], b.max[i]) = (*low, *high);
        }
    }
    b
}

/// One row, maybe bounds, a reference that may lie outside them; up to `inputs` components.
pub(crate) fn one_row(inputs: usize) -> impl Strategy<Value = (Row, Bounds, Vec<f64>)> {
    let parts = prop::collection::vec((component(), interval(), -12.0..12.0), 1..=inputs);
    (parts, -50.0..50.0, prop::bool::weighted(0.7)).prop_map(|(parts, floor, bounded)| {
        let normal: Vec<f64> = parts.iter().map(|p| p.0).collect();
        let intervals: Vec<(f64, f64)> = parts.iter().map(|p| p.1).collect();
        (row(&normal, floor), box_of(&intervals, bounded), parts.iter().map(|p| p.2).collect())
    })
}

/// A finite number of any size up to 1e300 and either sign: zeros, subnormal, moderate, huge.
fn any_size() -> impl Strategy<Value = f64> {
    let exponent = prop_oneof![-323.0..300.0, -3.0..3.0, 150.0..300.0, -323.0..-290.0];
    prop_oneof![
        1 => Just(0.0),
        1 => Just(-0.0),
        12 => (exponent, any::<bool>()).prop_map(|(e, s): (f64, bool)| {
            let size = 10_f64.powf(e).min(1e300);
            if s { size } else { -size }
        }),
    ]
}

/// Rows (`count` of them or, with 0, two to four), bounds, reference and correction limit of any size.
pub(crate) fn extreme(count: usize) -> impl Strategy<Value = (Vec<Row>, Bounds, Vec<f64>, f64)> {
    let counts = if count == 0 { 2..=4 } else { count..=count };
    let interval = (any_size(), any_size(), 0..4).prop_map(|(a, b, kind)| match kind {
        0 => (f64::NEG_INFINITY, a),
        1 => (a, f64::INFINITY),
        _ => (a.min(b), a.max(b)),
    });
    let row_strategy = (prop::collection::vec(any_size(), MAX_INPUTS), any_size());
    (
        prop::collection::vec(row_strategy, counts),
        prop::collection::vec((interval, any_size()), 1..=4),
        prop::bool::weighted(0.6),
        prop_oneof![Just(1e6), Just(1e300), Just(1e-3)],
    )
        .prop_map(|(rows, parts, bounded, limit)| {
            let rows = rows.iter().map(|(normal, floor)| row(&normal[..parts.len()], *floor)).collect();
            let intervals: Vec<(f64, f64)> = parts.iter().map(|p| p.0).collect();
            (rows, box_of(&intervals, bounded), parts.iter().map(|p| p.1).collect(), limit)
        })
}
