//! Cost of a filter step by the source of its derivatives: the same model built in, by expressions, by a plug-in,
//! and handed over: `cargo bench --bench sources`. Fails where a model of a user costs more than [`MOST`] times
//! the built-in one. Needs a C compiler.
//!
//! All run in turn in the same process; the figure of each is the median over batches.

#![allow(clippy::print_stdout, reason = "the figures are the result")]

use std::hint::black_box;
use std::time::Instant;

use punctual_core::dynamics::ControlAffine;
use punctual_core::filter::{Filter, FilterBuilder, Sampling, Status};
use punctual_core::plants::{Bicycle, PointMass, Unicycle};
use support::sources::{MODELS, derivatives, expressed, given, on_the_way, plugged};
use support::{T, X, anchored, goal};

mod support;

/// Largest cost of a step by expressions or by a plug-in, in steps of the built-in model.
const MOST: f64 = 5.0;
const BATCHES: usize = 301;
const STEPS: usize = 400;

/// Time in ns for each step of one batch.
fn batch(filter: &mut Filter, x: &[f64]) -> f64 {
    let mut u = [0.0; 2];
    let start = Instant::now();
    for _ in 0..STEPS {
        let report = filter.step(black_box(T), black_box(x), black_box(&[0.0; 2]), &mut u);
        assert_eq!(report.expect("the dimensions").status, Status::Filtered);
    }
    start.elapsed().as_secs_f64() * 1e9 / STEPS as f64
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Prints the figures; returns those that are too large.
fn compare<P>(model: usize, plant: P) -> Vec<String>
where
    P: ControlAffine<4, 2> + Copy + Send + Sync + 'static,
{
    let name = MODELS[model].0;
    let mut missed = Vec::new();
    for (sampling, words) in
        [(Sampling::Pointwise, "pointwise"), (Sampling::Period(0.001), "over the period")]
    {
        let with = |builder: FilterBuilder| anchored(builder.sampling(sampling).expect("valid sampling"));
        let own = [goal(plant), expressed(model), plugged(model)];
        let mut filters: Vec<_> = own.into_iter().map(|builder| (with(builder), X.to_vec())).collect();
        if sampling == Sampling::Pointwise {
            let mut filter = given().build().expect("valid filter");
            let start = derivatives(model, &[0.0; 4]);
            filter.step(0.0, &start, &[0.0; 2], &mut [0.0; 2]).expect("right dimensions");
            filters.push((filter, on_the_way(model).to_vec()));
        }
        let mut times = vec![Vec::new(); filters.len()];
        for _ in 0..BATCHES {
            for ((filter, x), times) in filters.iter_mut().zip(&mut times) {
                times.push(batch(filter, x));
            }
        }
        let times: Vec<f64> = times.into_iter().map(median).collect();
        let ratios = [times[1] / times[0], times[2] / times[0]];
        let given = times.get(3).map_or_else(String::new, |t| format!(", handed over {t:.0} ns"));
        println!(
            "{name}, {words}: built in {:.0} ns, expressions {:.0} ns ({:.2}), plug-in {:.0} ns ({:.2}){given}",
            times[0], times[1], ratios[0], times[2], ratios[1]
        );
        for (ratio, who) in ratios.into_iter().zip(["expressions", "plug-in"]) {
            if ratio > MOST {
                missed.push(format!("{name}, {words}: {who} {ratio:.2}"));
            }
        }
    }
    missed
}

fn main() {
    let bicycle = Bicycle::new(10.0).expect("valid bicycle");
    let missed = [compare(0, PointMass), compare(1, Unicycle), compare(2, bicycle)].concat();
    assert!(missed.is_empty(), "more than {MOST} times the built-in model: {missed:?}");
}
