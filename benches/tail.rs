//! The slowest of many steps: `cargo bench --bench tail [-- STEPS]`, ten million by default.
//!
//! Every step has a state and a reference input of its own, drawn again (seeded), so that branches and caches
//! cannot learn it. The filter restarts every thousand steps. The clock costs some 20 ns of each figure. The
//! largest figure is that of the operating system as much as of the filter. So run it on a quiet machine, on a
//! core of its own (`taskset`). The number of rounds of the solver, printed beside it, does not depend on the
//! machine.

#![allow(clippy::print_stdout, reason = "it is what a benchmark is for")]

use std::time::Instant;

use punctual_core::filter::{FilterBuilder, Sampling};
use punctual_core::plants::{PointMass, Unicycle};
use support::{goal, goal_and_obstacles};

mod support;

const STEPS: u64 = 10_000_000;
const PERIOD: f64 = 0.001;
/// Steps of one start.
const RUN: u64 = 1000;
/// Longest time in the histogram, in ns; longer ones count as this.
const LONGEST: usize = 1_000_000;

/// The generator xorshift64*: good enough to vary inputs, and the same everywhere.
struct Random(u64);

impl Random {
    fn within(&mut self, limit: f64) -> f64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        let part = (self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 11) as f64 / (1_u64 << 53) as f64;
        limit * (2.0 * part - 1.0)
    }
}

fn run(name: &str, builder: FilterBuilder, steps: u64) {
    let mut filter = builder.build().expect("valid filter");
    let (mut random, mut u) = (Random(1), [0.0; 2]);
    let mut counts = vec![0_u64; LONGEST + 1];
    let (mut rounds, mut unsatisfied) = (0, 0);
    for k in 0..steps {
        if k % RUN == 0 {
            filter.rearm();
        }
        let x = [random.within(60.0), random.within(60.0), random.within(8.0), random.within(8.0)];
        let u_ref = [random.within(20.0), random.within(20.0)];
        let t = (k % RUN) as f64 * PERIOD;
        let start = Instant::now();
        let report = filter.step(t, &x, &u_ref, &mut u).expect("right dimensions");
        let elapsed = start.elapsed().as_nanos() as usize;
        rounds = rounds.max(report.iterations);
        unsatisfied += u64::from(!report.status.is_satisfied());
        assert!(u.iter().all(|v| v.is_finite()), "{name}: {u:?} at {x:?}, {u_ref:?}");
        counts[elapsed.min(LONGEST)] += 1;
    }
    let quantile = |part: f64| {
        let mut left = (part * steps as f64) as u64;
        counts.iter().position(|&count| {
            let found = count > left;
            left = left.saturating_sub(count);
            found
        })
    };
    let largest = counts.iter().rposition(|&count| count > 0).unwrap_or(0);
    let [median, p99, p9999] = [0.5, 0.99, 0.9999].map(|part| quantile(part).unwrap_or(LONGEST));
    println!(
        "{name:<34} median {median:>6} ns, 99 % {p99:>6} ns, 99.99 % {p9999:>6} ns, largest {largest:>7} ns, \
         at most {rounds} rounds, {unsatisfied} of {steps} not satisfied"
    );
}

fn main() {
    // Cargo passes options of its own.
    let steps = std::env::args().skip(1).find_map(|a| a.parse().ok()).unwrap_or(STEPS);
    let boxed = |builder: FilterBuilder| builder.bounds(&[-60.0; 2], &[60.0; 2]).expect("valid bounds");
    let held = |builder: FilterBuilder| builder.sampling(Sampling::default()).expect("valid");
    run("goal", goal(PointMass), steps);
    run("goal, box", boxed(goal(PointMass)), steps);
    run("goal, 10 obstacles", goal_and_obstacles(10), steps);
    run("goal, 10 obstacles, box", boxed(goal_and_obstacles(10)), steps);
    run("unicycle, over the period, box", held(boxed(goal(Unicycle))), steps);
    run("10 obstacles, over the period, box", held(boxed(goal_and_obstacles(10))), steps);
}
