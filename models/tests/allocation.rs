//! A filter and a plant of expressions do not allocate in a step.

use punctual_core::filter::{BarrierSettings, Filter, Sampling, Status};
use punctual_models::Model;

/// Number of allocations that `work` makes on this thread.
fn allocations(work: impl FnOnce()) -> u64 {
    allocation_counter::measure(work).count_total
}

#[test]
fn a_step_allocates_nothing() {
    let expressions = ["v*cos(th) + tanh(v)", "v*sin(th)", "w", "a"];
    let model = Model::new(&["x", "y", "th", "v"], &["a", "w"], &[], &expressions).expect("a model");
    let barrier =
        model.barrier("5 - sqrt((x - 40)^2 + (y - 40)^2 + 1) + min(0, ln(x + 50))").expect("a barrier");
    for sampling in [Sampling::Pointwise, Sampling::Measured { first: None }] {
        let source = barrier.source(2).expect("in range");
        let mut filter = Filter::from_sources(4, 2)
            .source("goal", source, BarrierSettings::within(5.0))
            .and_then(|b| b.sampling(sampling))
            .and_then(punctual_core::filter::FilterBuilder::build)
            .expect("a filter");
        let (mut u, mut seen) = ([0.0; 2], [false; Status::ALL.len()]);
        let found = allocations(|| {
            for k in 0..500 {
                let t = f64::from(k) * 0.01;
                // Every fiftieth sample is outside the domain of the logarithm.
                let x = if k % 50 == 10 { -90.0 } else { 8.0 * t };
                let report = filter.step(t, &[x, 7.0 * t, 0.7, 9.0], &[0.0; 2], &mut u).expect("the lengths");
                seen[report.status as usize] = true;
            }
        });
        assert_eq!(found, 0);
        assert!(seen[Status::Filtered as usize] && seen[Status::Singular as usize], "{seen:?}");
    }
    let (plant, mut x) = (model.plant(), [0.0; 4]);
    let found = allocations(|| plant.rk4_step(&mut x, &[1.0, 0.1], 0.1).expect("the lengths"));
    assert_eq!(found, 0);
}
