//! Lie derivatives against a computer-algebra system, and degrees declared wrongly.
//!
//! The reference values are in `cas/values.csv`; `cas/generate.py` wrote them.

use crate::support;

use std::sync::Arc;

use punctual_core::ErrorKind;
use punctual_core::filter::{BarrierSettings, Filter, Status};
use punctual_core::lie::{self, Ahead, Derivatives};
use punctual_core::plants::{PointMass, Unicycle};
use support::{SpeedLimit, quadratic_disc, source};

const VALUES: &str = include_str!("cas/values.csv");

/// Allowed error, as a part of the size of the formula (the sum of its terms taken positive). A
/// derivative of order 8 is a sum of a few thousand products of up to ten factors, each rounded to
/// 1.1e-16 of itself; 1e-12 is that with every rounding going the same way. Seen: below 1e-15.
const ROUND_OFF: f64 = 1e-12;

struct Sample {
    case: &'static str,
    t: f64,
    x: Vec<f64>,
    drift: Vec<[f64; 2]>,
    input: Vec<[f64; 2]>,
}

fn samples() -> Vec<Sample> {
    let mut samples: Vec<Sample> = Vec::new();
    for line in VALUES.lines().filter(|l| !l.starts_with('#')) {
        let fields: Vec<&str> = line.split(',').collect();
        let number = |text: &str| text.parse::<f64>().unwrap_or_else(|e| panic!("{line}: {e}"));
        if fields[0] == "state" {
            let numbers: Vec<f64> = fields[3..].iter().map(|f| number(f)).collect();
            let (t, x) = (numbers[0], numbers[1..].to_vec());
            samples.push(Sample { case: fields[1], t, x, drift: Vec::new(), input: Vec::new() });
            continue;
        }
        let sample = samples.last_mut().expect("a state row first");
        assert_eq!(sample.case, fields[1], "{line}");
        let values = if fields[0] == "drift" { &mut sample.drift } else { &mut sample.input };
        assert_eq!(values.len().to_string(), fields[3], "{line}");
        values.push([number(fields[4]), number(fields[5])]);
    }
    samples
}

#[test]
fn derivatives_equal_the_algebra() {
    let samples = samples();
    assert_eq!(samples.len(), 44, "the number of samples in values.csv");
    for sample in &samples {
        let source = source(sample.case);
        assert_eq!(source.relative_degree() + 1, sample.drift.len(), "{}", sample.case);
        assert_eq!(source.input_dim(), sample.input.len(), "{}", sample.case);
        let mut found = Derivatives::ZERO;
        source.evaluate(sample.t, &sample.x, &mut found);
        let drift = sample.drift.iter().zip(&found.drift).map(|(w, f)| ("drift", w, f));
        let input = sample.input.iter().zip(&found.row).map(|(w, f)| ("input", w, f));
        for (k, (kind, &[wanted, size], &value)) in drift.chain(input).enumerate() {
            let error = (value - wanted).abs();
            assert!(
                error <= ROUND_OFF * size,
                "{} at {:?}, {kind} (entry {k}): {value:e}, wanted {wanted:e}, error {error:e} = {:e} of the size",
                sample.case,
                sample.x,
                error / size,
            );
        }
        assert!(found.lower_sensitivity <= ROUND_OFF, "{}: {}", sample.case, found.lower_sensitivity);
        assert_eq!(found.drift[sample.drift.len()..].iter().find(|v| **v != 0.0), None);
        assert_eq!(found.row[sample.input.len()..].iter().find(|v| **v != 0.0), None);
    }
}

#[test]
fn a_degree_declared_too_high_is_seen_and_refused_at_the_step() {
    let source = lie::along(Arc::new(Unicycle), SpeedLimit, 2).expect("in range");
    let x = [0.0, 0.0, 0.5, 3.0];
    let mut found = Derivatives::ZERO;
    source.evaluate(0.0, &x, &mut found);
    // h = 30 − v²/4, so ∂ḣ/∂a = −v/2.
    assert_eq!(found.lower_sensitivity, 1.5);

    let mut filter = Filter::from_sources(4, 2)
        .source("speed", source, BarrierSettings::within(5.0))
        .and_then(punctual_core::filter::FilterBuilder::build)
        .expect("valid filter");
    let mut u = [f64::NAN; 2];
    let report = filter.step(0.0, &x, &[7.0, 8.0], &mut u).expect("right dimensions");
    assert_eq!(report.status, Status::WrongRelativeDegree);
    assert_eq!(u, [0.0, 0.0]);
}

#[test]
fn a_degree_declared_too_low_has_no_row() {
    let source = lie::along(Arc::new(PointMass), quadratic_disc(), 1).expect("in range");
    let mut found = Derivatives::ZERO;
    source.evaluate(0.0, &[1.0, 2.0, 3.0, 4.0], &mut found);
    assert_eq!((found.row, found.lower_sensitivity), ([0.0; punctual_core::MAX_INPUTS], 0.0));
}

#[test]
fn degrees_out_of_range_are_refused() {
    for n in [0, 3, punctual_core::MAX_RELATIVE_DEGREE, usize::MAX] {
        let Err(error) = lie::along(Arc::new(PointMass), quadratic_disc(), n) else { panic!("{n} accepted") };
        assert_eq!(error.kind(), ErrorKind::RelativeDegree);
        assert_eq!(error.to_string(), format!("relative_degree: is {n}, must be 1 to 2"));
    }
}

/// What the search takes for a row, in place of all derivatives, is the same to the bit.
#[test]
fn what_a_row_takes_is_part_of_all_derivatives() {
    let (x, u) = ([1.0, -2.0, 0.8, 6.0], [0.7, -1.3]);
    for n in 1..=2 {
        let source = lie::along(Arc::new(Unicycle), quadratic_disc(), n).expect("in range");
        let model = source.predict().expect("a model");
        // One Runge-Kutta step and two.
        for duration in [0.0, 0.001, 0.5] {
            let (mut all, mut of_row) = (Ahead::ZERO, Ahead::ZERO);
            model.ahead(0.3, &x, &u, duration, &mut all);
            model.ahead_of_row(0.3, &x, &u, duration, &mut of_row);
            assert_eq!(of_row.value[..n], all.value[..n], "n {n}, {duration} s");
            assert_eq!(of_row.gradient[..n], all.gradient[..n], "n {n}, {duration} s");
            model.values_ahead(0.3, &x, &u, duration, &mut all.value);
            model.values_of_row(0.3, &x, &u, duration, &mut of_row.value);
            assert_eq!(of_row.value[..n], all.value[..n], "n {n}, {duration} s");
        }
    }
}
