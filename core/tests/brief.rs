//! A brief search: no step takes more predictions and quadratic programs than its documentation says, and little is lost.
//!
//! A source that counts stands before each barrier. More steps: `PUNCTUAL_BRIEF=1000000`.

#![allow(clippy::print_stdout, reason = "the figures are wanted")]

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use crate::uncertain::Draws;

use punctual_core::MAX_RELATIVE_DEGREE;
use punctual_core::barrier::Barrier;
use punctual_core::barriers::{DistanceDisc, Outside};
use punctual_core::dynamics::{ControlAffine, rk4_step};
use punctual_core::filter::{BarrierSettings, Filter, Sampling};
use punctual_core::lie::{self, Ahead, DerivativeSource, Derivatives, Predict};
use punctual_core::plants::{PointMass, Unicycle};

/// Predictions of a barrier in a step at most, by the documentation: up to three solutions, each with 83 of them (from u_ref, along the
/// curved row, by twelve corrections of which each may judge all rows, from two guesses with four steps of three trials, and judged),
/// and three looks at what is between the samples, each with walks of 4, 8 and 16 parts, and enclosures of as many.
const PREDICTIONS: u32 = 700;
const ROWS: usize = 7;

/// Counts the predictions of `of`.
struct Counted {
    of: Box<dyn DerivativeSource>,
    count: Arc<AtomicU32>,
}

impl DerivativeSource for Counted {
    fn relative_degree(&self) -> usize {
        self.of.relative_degree()
    }
    fn state_dim(&self) -> usize {
        self.of.state_dim()
    }
    fn input_dim(&self) -> usize {
        self.of.input_dim()
    }
    fn evaluate(&self, t: f64, x: &[f64], out: &mut Derivatives) {
        self.of.evaluate(t, x, out);
    }
    fn predict(&self) -> Option<&dyn Predict> {
        Some(self)
    }
}

impl Counted {
    fn inner(&self) -> &dyn Predict {
        self.count.fetch_add(1, Ordering::Relaxed);
        self.of.predict().expect("a model")
    }
}

impl Predict for Counted {
    fn flow(&self, x: &mut [f64], u: &[f64], duration: f64) {
        self.inner().flow(x, u, duration);
    }
    fn ahead(&self, t: f64, x: &[f64], u: &[f64], duration: f64, out: &mut Ahead) {
        self.inner().ahead(t, x, u, duration, out);
    }
    fn ahead_of_row(&self, t: f64, x: &[f64], u: &[f64], duration: f64, out: &mut Ahead) {
        self.inner().ahead_of_row(t, x, u, duration, out);
    }
    fn values_of_row(
        &self,
        t: f64,
        x: &[f64],
        u: &[f64],
        duration: f64,
        out: &mut [f64; MAX_RELATIVE_DEGREE + 1],
    ) {
        self.inner().values_of_row(t, x, u, duration, out);
    }
    fn rate(&self, x: &[f64], u: &[f64], out: &mut [f64]) {
        self.inner().rate(x, u, out);
    }
    fn value(&self, t: f64, x: &[f64]) -> f64 {
        self.of.predict().expect("a model").value(t, x)
    }
}

/// A goal and rocks, with or without a brief search, and the predictions of each row.
fn with_rocks<P>(plant: &P, bounds: [f64; 2], is_brief: bool, seed: u64) -> (Filter, Vec<Arc<AtomicU32>>)
where
    P: ControlAffine<4, 2> + Clone + Send + Sync + 'static,
{
    let (mut draws, plant) = (Draws(seed), Arc::new(plant.clone()));
    let mut counts = Vec::new();
    fn source<P, B>(plant: &Arc<P>, barrier: B, counts: &mut Vec<Arc<AtomicU32>>) -> Box<dyn DerivativeSource>
    where
        P: ControlAffine<4, 2> + Send + Sync + 'static,
        B: Barrier<4> + Send + 'static,
    {
        let count = Arc::new(AtomicU32::new(0));
        counts.push(count.clone());
        Box::new(Counted { of: lie::along(plant.clone(), barrier, 2).expect("in range"), count })
    }
    let goal = DistanceDisc::new([18.0, 4.0], 2.0, 1.0).expect("in range");
    let mut builder = Filter::from_sources(4, 2)
        .source("goal", source(&plant, goal, &mut counts), BarrierSettings::within(15.0))
        .expect("in range");
    for _ in 1..ROWS {
        let at = [draws.within(2.0, 16.0), draws.within(-4.0, 8.0)];
        let rock = Outside(DistanceDisc::new(at, 0.8, 1.0).expect("in range"));
        builder = builder
            .source("rock", source(&plant, rock, &mut counts), BarrierSettings::keeping())
            .expect("in range");
    }
    let low = bounds.map(|bound| -bound);
    let builder = builder.bounds(&low, &bounds).and_then(|b| b.sampling(Sampling::Measured { first: None }));
    let filter = builder.expect("in range").brief_search(is_brief).build().expect("a filter");
    (filter, counts)
}

/// The largest number of predictions of a row in a step, and the parts of the steps that were met.
fn attacked<P>(plant: &P, bounds: [f64; 2], is_brief: bool, steps: u32) -> (u32, f64)
where
    P: ControlAffine<4, 2> + Clone + Send + Sync + 'static,
{
    let (mut most, mut met) = (0, 0);
    let mut draws = Draws(3);
    let (mut filter, mut counts) = with_rocks(plant, bounds, is_brief, 0);
    let (mut t, mut x, mut wanted) = (0.0, [0.0; 4], [0.0; 2]);
    for step in 0..steps {
        if step % 400 == 0 {
            (filter, counts) = with_rocks(plant, bounds, is_brief, u64::from(step));
            x = core::array::from_fn(|i| {
                draws.within(-0.5, 0.5) + if i > 1 { draws.within(-2.0, 2.0) } else { 0.0 }
            });
        }
        if step % 20 == 0 {
            let hostile = draws.part() < 0.5;
            wanted = bounds
                .map(|bound| if hostile { 3.0 * bound * draws.sign() } else { draws.within(-bound, bound) });
        }
        let hold = draws.within(0.005, 0.15);
        let before: Vec<u32> = counts.iter().map(|count| count.load(Ordering::Relaxed)).collect();
        let mut u = [0.0; 2];
        let report = filter.step(t, &x, &wanted, &mut u).expect("the lengths");
        met += u32::from(report.status.is_satisfied());
        let rows = before.iter().zip(&counts).map(|(before, count)| count.load(Ordering::Relaxed) - before);
        most = most.max(rows.max().unwrap_or(0));
        x = rk4_step(plant, &x, &u, hold);
        t += hold;
    }
    (most, f64::from(met) / f64::from(steps))
}

#[test]
fn a_brief_search_is_as_long_as_it_is_said_to_be() {
    let steps = std::env::var("PUNCTUAL_BRIEF").map_or(8_000, |steps| steps.parse().expect("a number"));
    for (name, brief, full) in [
        (
            "unicycle",
            attacked(&Unicycle, [4.0, 1.5], true, steps),
            attacked(&Unicycle, [4.0, 1.5], false, steps.min(20_000)),
        ),
        (
            "point mass",
            attacked(&PointMass, [4.0; 2], true, steps),
            attacked(&PointMass, [4.0; 2], false, steps.min(20_000)),
        ),
    ] {
        println!(
            "{name}: at most {} predictions of a row, {:.4} of the steps met; full search {} and {:.4}",
            brief.0, brief.1, full.0, full.1
        );
        assert!(brief.0 <= PREDICTIONS, "{name}: {}", brief.0);
        // What only a wide search finds: 0.03 of the steps of this attack.
        assert!(brief.1 >= full.1 - 0.04, "{name}: {} and {}", brief.1, full.1);
    }
}
