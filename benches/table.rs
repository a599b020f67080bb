//! The cost of a step beside the same computation by hand: `cargo bench --bench table`. benches/python.py takes it into
//! its own table.
//!
//! Each line is a name and a time in ns, apart by a tab. Without plans it is the shortest mean of a round of fifty samples.
//! With them it is the median of the steps, each the shortest of some runs, and the 99th of a hundred. On a machine that
//! does other things too these change least.

#![allow(clippy::print_stdout, reason = "it is what a benchmark is for")]

use std::hint::black_box;
use std::time::Instant;

use punctual_core::dynamics::{ControlAffine, rk4_step};
use punctual_core::filter::{AssuranceStatus, Driver, FilterBuilder, Sampling};
use punctual_core::plants::{Bicycle, PointMass, Unicycle};
use support::{ByHand, Drive, T, X, obstructed};

mod support;

const ROUNDS: u32 = 400;
const OBSTACLES: [usize; 2] = [0, 10];

/// The shortest mean time of a call in ns, of rounds of so many `calls`.
fn fastest(calls: u32, mut call: impl FnMut()) -> f64 {
    let round = |_| {
        let begin = Instant::now();
        (0..calls).for_each(|_| call());
        begin.elapsed().as_secs_f64() * 1e9 / f64::from(calls)
    };
    (0..ROUNDS).map(round).fold(f64::INFINITY, f64::min)
}

fn line(name: &str, time: f64) {
    println!("{name}\t{time:.1}");
}

/// The steps of a closed loop, over and over.
fn rows<P>(plant: &P, builder: FilterBuilder, period: f64) -> f64
where
    P: ControlAffine<4, 2>,
{
    let mut drive = Drive::recorded(builder, plant, period);
    fastest(Drive::SAMPLES, || _ = black_box(drive.step()))
}

/// The times of the steps of a closed loop with plans behind them, in ns, sorted: those that give what the rows or u_ref
/// wanted or near it, those that the plan decides, and the first. `None` where that finds no plan. The shortest of some
/// runs of the same loop counts.
fn backed<P>(plant: &P, builder: impl Fn() -> FilterBuilder, bounds: [f64; 2]) -> Option<[Vec<f64>; 3]>
where
    P: ControlAffine<4, 2>,
{
    const PERIOD: f64 = 0.01;
    const STEPS: usize = 900;
    const RUNS: usize = 5;
    let (mut shortest, mut by_plan) = (vec![f64::INFINITY; STEPS], vec![false; STEPS]);
    for _ in 0..RUNS {
        let filter = builder().bounds(&bounds.map(|b| -b), &bounds).and_then(FilterBuilder::build);
        let filter = filter.expect("valid bounds").with_plans(PERIOD);
        let mut filter = filter.expect("a filter that can have plans");
        let (mut x, mut u) = ([0.0, 0.0, X[2], X[3]], [0.0; 2]);
        for k in 0..STEPS {
            let begin = Instant::now();
            let assurance = filter.step(PERIOD * k as f64, &x, &[0.0; 2], &mut u);
            shortest[k] = f64::min(shortest[k], begin.elapsed().as_secs_f64() * 1e9);
            let assurance = assurance.expect("right dimensions").assurance.expect("plans");
            if assurance.status != AssuranceStatus::Assured {
                return None;
            }
            by_plan[k] = assurance.driver == Driver::Plan;
            x = rk4_step(plant, &x, &u, PERIOD);
        }
    }
    let those = |plan: bool| {
        let mut times: Vec<_> = (1..STEPS).filter(|k| by_plan[*k] == plan).map(|k| shortest[k]).collect();
        times.sort_by(f64::total_cmp);
        times
    };
    Some([those(false), those(true), vec![shortest[0]]])
}

fn vehicle<P>(name: &str, plant: P, bounds: [f64; 2])
where
    P: ControlAffine<4, 2> + Copy + Send + Sync + 'static,
{
    for obstacles in OBSTACLES {
        line(
            &format!("{name}, {obstacles} obstacles, pointwise"),
            rows(&plant, obstructed(plant, obstacles), 0.01),
        );
        let held = || obstructed(plant, obstacles).sampling(Sampling::default()).expect("valid settings");
        for period in [1, 10, 50] {
            let time = rows(&plant, held(), 1e-3 * f64::from(period));
            line(&format!("{name}, {obstacles} obstacles, {period} ms"), time);
        }
        let row = format!("{name}, {obstacles} obstacles, backup plan");
        let Some(times) = backed(&plant, held, bounds) else {
            println!("{row}\trefused");
            continue;
        };
        for (which, times) in ["", ", by the plan", ", first"].iter().zip(&times) {
            if let (Some(median), Some(most)) =
                (times.get(times.len() / 2), times.get(times.len() * 99 / 100))
            {
                line(&format!("{row}{which}"), *median);
                line(&format!("{row}{which}, 99 %"), *most);
            }
        }
    }
}

fn main() {
    let by_hand = ByHand::anchored();
    line(
        "by hand",
        fastest(1000, || _ = black_box(by_hand.step(black_box(T), black_box(&X), black_box(&[0.0; 2])))),
    );
    vehicle("point mass", PointMass, [8.0, 8.0]);
    vehicle("unicycle", Unicycle, [8.0, 3.0]);
    vehicle("bicycle", Bicycle::new(10.0).expect("valid bicycle"), [8.0, 0.5]);
}
