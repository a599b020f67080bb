//! The cost of a step with a backup plan: a distribution that is printed, but never asserted.

use std::time::Instant;

use punctual_core::filter::{AssuranceStatus, Driver};
use punctual_core::plants::Unicycle;

use super::cases;
use crate::judge::case::{Case, Numbers, Reference, Set};
use crate::judge::model::{Plant, Shape};
use crate::judge::motion::advance;
use crate::obstacles::{GOAL, feasible_starts, filter};

/// Sampling period in s, deadline and end of a run.
const STEP: f64 = 0.01;
const END: f64 = 15.0;

/// Unicycles from random starts, with this choice of u_ref; T = 10 s without obstacles, 20 s with ten.
fn times(obstacles: bool, steps: usize) -> (Vec<f64>, Vec<f64>, usize, usize) {
    let (mut all, mut first, mut searches, mut samples) = (Vec::new(), Vec::new(), 0, 0);
    let starts = feasible_starts(1000);
    for (number, start) in starts.iter().enumerate() {
        if all.len() >= steps {
            break;
        }
        let mut case = {
            let goal = Shape::Disc {
                start: GOAL.0,
                velocity: [0.0; 2],
                radius: GOAL.1,
                smoothing: Some(GOAL.1),
                outside: false,
            };
            Case::plain(Plant::Unicycle, Set::within(goal, 10.0), start, STEP)
        };
        let size = [4.0, 1.0];
        case.bounds = [8.0, 3.0];
        case.reference = [Reference::Damping(1.0), Reference::Random { size, held: 1.0 }][number % 2];
        let mut filter = match obstacles {
            true => filter(&Unicycle, case.bounds).with_plans(STEP).expect("a filter that can be assured"),
            false => case.assured(),
        };
        let end = if obstacles { 2.0 * END } else { END };
        let (mut x, mut numbers, mut drawn) =
            (case.start, Numbers::new(number as u64), (f64::NEG_INFINITY, [0.0; 2]));
        let mut plan = None;
        for k in 0..(end / STEP) as usize {
            let (t, mut u) = (k as f64 * STEP, [0.0; 2]);
            let wanted = case.wanted(t, &x, &mut drawn, &mut numbers);
            let clock = Instant::now();
            let assurance =
                filter.step(t, &x[..4], &wanted, &mut u).expect("right dimensions").assurance.expect("plans");
            let taken = clock.elapsed().as_secs_f64();
            if assurance.status != AssuranceStatus::Assured {
                searches += 1;
                first.extend((k == 0).then_some(taken));
                break;
            }
            // A search is recognised by a step that the plan drives with other laws than before.
            if k == 0 || assurance.driver == Driver::Plan {
                let laws =
                    serde_json::to_value(&filter.state().plan).expect("serialises")["plan"]["reference"]
                        .take();
                searches += usize::from(plan.as_ref() != Some(&laws) && (plan.is_some() || k == 0));
                plan = Some(laws);
            }
            if k == 0 {
                first.push(taken);
            } else {
                all.push(taken);
            }
            samples += 1;
            x = advance(&case.plant, &x, &u, STEP);
        }
    }
    (all, first, searches, samples)
}

/// A million steps of each in `tests/nightly`.
#[test]
fn the_cost_of_a_step() {
    let steps = cases(1000, 1_000_000) as usize;
    println!(
        "| unicycle, 10 ms | steps | median | 99 % | 99.99 % | largest | first steps: median | largest | searches |"
    );
    println!("|---|---:|---:|---:|---:|---:|---:|---:|---:|");
    for (name, obstacles) in [("a goal, T = 10 s", false), ("and ten obstacles, T = 20 s", true)] {
        let (mut all, mut first, searches, samples) = times(obstacles, steps);
        all.sort_by(f64::total_cmp);
        first.sort_by(f64::total_cmp);
        let quantile =
            |times: &[f64], part: f64| 1e3 * times[((times.len() - 1) as f64 * part).round() as usize];
        println!(
            "| {name} | {} | {:.3} ms | {:.3} ms | {:.3} ms | {:.3} ms | {:.0} ms | {:.0} ms | {searches} in {} runs |",
            all.len(),
            quantile(&all, 0.5),
            quantile(&all, 0.99),
            quantile(&all, 0.9999),
            quantile(&all, 1.0),
            quantile(&first, 0.5),
            quantile(&first, 1.0),
            first.len(),
        );
        assert!(samples >= steps, "{samples} steps of {steps}: the starts do not suffice");
    }
}
