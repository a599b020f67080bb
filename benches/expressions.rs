//! Cost of a filter step with a model of expressions against the same model in Rust:
//! `cargo bench --bench expressions`. Fails where the ratio is above [`MOST`].
//!
//! Both run in turn in the same process; the figure of each is the median over batches.

#![allow(clippy::print_stdout, reason = "the figures are the result")]

use std::hint::black_box;
use std::time::Instant;

use punctual_core::dynamics::ControlAffine;
use punctual_core::filter::{BarrierSettings, FilterBuilder, SafetyFilter, Sampling, Status};
use punctual_core::plants::{Bicycle, PointMass, Unicycle};
use punctual_models::Model;
use support::{DEADLINE, T, X, anchored, goal};

mod support;

/// What a step may cost, in steps of the built-in model.
const MOST: f64 = 5.0;
const BATCHES: usize = 301;
const STEPS: usize = 400;

/// The goal of [`support`] along a plant of expressions.
fn expressed(derivatives: [&str; 4]) -> FilterBuilder {
    let model =
        Model::new(&["x", "y", "p", "q"], &["a", "b"], &[("l_r", 10.0)], &derivatives).expect("a model");
    let barrier = model.barrier("sqrt(8) - sqrt((x - 45)^2 + (y - 45)^2 + 4)").expect("a barrier");
    SafetyFilter::builder(4, 2)
        .source("goal", barrier.source(2).expect("in range"), BarrierSettings::within(DEADLINE))
        .and_then(|b| b.sampling(Sampling::Pointwise))
        .expect("valid settings")
}

/// Nanoseconds for each step of one batch.
fn batch(filter: &mut SafetyFilter) -> f64 {
    let mut u = [0.0; 2];
    let start = Instant::now();
    for _ in 0..STEPS {
        let report = filter.step(black_box(T), black_box(&X), black_box(&[0.0; 2]), &mut u);
        assert_eq!(report.expect("the dimensions").status, Status::Filtered);
    }
    start.elapsed().as_secs_f64() * 1e9 / STEPS as f64
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn compare<P>(name: &str, plant: P, derivatives: [&str; 4])
where
    P: ControlAffine<4, 2> + Copy + Send + 'static,
{
    for (sampling, words) in
        [(Sampling::Pointwise, "pointwise"), (Sampling::Period(0.001), "over the period")]
    {
        let with = |builder: FilterBuilder| anchored(builder.sampling(sampling).expect("valid sampling"));
        let (mut built_in, mut expressed) = (with(goal(plant)), with(expressed(derivatives)));
        let pairs: Vec<_> = (0..BATCHES).map(|_| (batch(&mut built_in), batch(&mut expressed))).collect();
        let (first, second) =
            (median(pairs.iter().map(|p| p.0).collect()), median(pairs.iter().map(|p| p.1).collect()));
        let ratio = second / first;
        println!("{name}, {words}: built in {first:.0} ns, expressions {second:.0} ns, ratio {ratio:.2}");
        assert!(ratio <= MOST, "{name}, {words}: {ratio}, must be at most {MOST}");
    }
}

fn main() {
    compare("point mass", PointMass, ["p", "q", "a", "b"]);
    compare("unicycle", Unicycle, ["q*cos(p)", "q*sin(p)", "b", "a"]);
    let bicycle = Bicycle::new(10.0).expect("valid bicycle");
    compare("bicycle", bicycle, ["q*cos(p)", "q*sin(p)", "q*b/l_r", "a"]);
}
