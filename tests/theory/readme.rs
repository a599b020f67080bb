//! The README's example with all its numbers drawn at random: a unicycle into a disc by a deadline, with
//! steps of 10 ms. The judge checks that it never leaves after arrival, and compares peak speed and input
//! with those of the least-peak profile, which from rest over D within T needs 4D/T² and reaches 2D/T.

#![allow(clippy::print_stdout, reason = "the figures are read from the output")]

use std::f64::consts::PI;

use punctual_core::plants::Unicycle;
use punctual_reference::simulation::{Schedule, closed_loop};

use super::judge::case::{Case, Numbers, Reference, Set};
use super::judge::model::{Plant, Shape};
use super::judge::on_every_core;
use super::judge::run::{Promise, run_seen};

const STEP: f64 = 0.01;

fn goal(centre: [f64; 2], radius: f64, deadline: f64) -> Set {
    let shape =
        Shape::Disc { start: centre, velocity: [0.0; 2], radius, smoothing: Some(radius), outside: false };
    Set { margin: 0.01 * radius, ..Set::within(shape, deadline) }
}

/// Findings of a run.
#[derive(Clone, Debug)]
struct Found {
    seed: u64,
    case: Case,
    promise: Promise,
    /// Peak speed and |a|, relative to those of the least-peak profile with the initial speed.
    peaks: [f64; 2],
    /// Peak speed in m/s, |a| in m/s² and |ω| in rad/s.
    largest: [f64; 3],
}

impl Found {
    fn of(seed: u64, case: Case) -> Self {
        let mut largest = [0.0_f64; 3];
        let run = run_seen(&case, |_, x, u, _| {
            for (most, value) in largest.iter_mut().zip([x[3], u[0], u[1]]) {
                *most = most.max(value.abs());
            }
        });
        let set = &case.sets[0];
        let Shape::Disc { start: centre, radius, .. } = set.shape else { panic!("{:?}", set.shape) };
        let way = (case.start[0] - centre[0]).hypot(case.start[1] - centre[1]) - radius;
        let (way, speed, deadline) = (way.max(0.0), case.start[3].abs(), set.deadline);
        let profile =
            [speed.max(2.0 * way / deadline), 4.0 * way / deadline / deadline + 2.0 * speed / deadline];
        let peaks = [largest[0] / profile[0], largest[1] / profile[1]];
        Self { seed, promise: run.promises[0], peaks, largest, case }
    }

    fn draw(seed: u64) -> Self {
        let mut numbers = Numbers::new(seed);
        let numbers = &mut numbers;
        let (radius, deadline) = (numbers.scale(0.3, 5.0), numbers.within(1.0, 30.0));
        let (far, angle) = (numbers.within(1.5 * radius, 300.0), numbers.within(-PI, PI));
        let start = [numbers.within(-10.0, 10.0), numbers.within(-10.0, 10.0)];
        let centre = [start[0] + far * angle.cos(), start[1] + far * angle.sin()];
        let rate = numbers.chance(0.5).then(|| numbers.scale(0.2, 20.0));
        let set = Set { rate, ..goal(centre, radius, deadline) };
        let x0 = [start[0], start[1], numbers.within(-PI, PI), numbers.within(-10.0, 10.0)];
        let unit = far / deadline / deadline;
        let bounds = if numbers.chance(0.5) {
            [f64::INFINITY; 2]
        } else {
            [numbers.within(4.0, 8.0) * unit + 20.0 / deadline, numbers.within(2.0, 20.0)]
        };
        let reference = match numbers.below(3) {
            0 => Reference::Zero,
            1 => Reference::Damping(1.0),
            _ => Reference::Outwards(numbers.within(0.1, 2.0) * unit),
        };
        let case = Case::plain(Plant::Unicycle, set, &x0, STEP);
        Self::of(seed, Case { bounds, reference, ..case })
    }
}

/// Median, 95 % and largest.
fn spread(mut values: Vec<f64>) -> String {
    values.sort_by(f64::total_cmp);
    let at = |part: f64| values[((values.len() - 1) as f64 * part).round() as usize];
    format!("{:.2} / {:.2} / {:.1}", at(0.5), at(0.95), at(1.0))
}

fn row(name: &str, found: &[&Found]) {
    let count = |f: fn(&Promise) -> bool| found.iter().filter(|f2| f(&f2.promise)).count();
    if found.is_empty() {
        return;
    }
    println!(
        "| {name} | {} | {} | {} | {} | {} | {} | {} | {} |",
        found.len(),
        count(|p| p.late),
        count(|p| p.out_after_arrival),
        count(|p| p.left.is_some()),
        count(|p| p.broken.is_some()),
        count(Promise::flag_lost_needlessly),
        spread(found.iter().map(|f| f.peaks[0]).collect()),
        spread(found.iter().map(|f| f.peaks[1]).collect()),
    );
}

/// All 10,000 in `tests/nightly`.
#[test]
fn table_of_the_readme_drawn_at_random() {
    let all = std::env::var_os("PUNCTUAL_TABLES").is_some();
    let found = on_every_core(if all { 10_000 } else { 100 }, Found::draw);
    println!(
        "| inputs, u_ref, rate | runs | late | out after arrival | promise not kept | broken under the flag | \
         flag lost needlessly | peak speed over the least-peak profile's: median / 95 % / most | peak input |"
    );
    println!("|---|---:|---:|---:|---:|---:|---:|---|---|");
    row("all", &found.iter().collect::<Vec<_>>());
    for bounded in [false, true] {
        for (name, of) in [("zero", Reference::Zero), ("damping", Reference::Damping(1.0))] {
            for given in [false, true] {
                let same = |f: &&Found| {
                    f.case.bounds[0].is_finite() == bounded
                        && f.case.reference == of
                        && f.case.sets[0].rate.is_some() == given
                };
                let name = format!(
                    "{}, {name}, {}",
                    ["free", "bounded"][usize::from(bounded)],
                    ["default", "given"][usize::from(given)]
                );
                row(&name, &found.iter().filter(same).collect::<Vec<_>>());
            }
        }
        let same = |f: &&Found| {
            f.case.bounds[0].is_finite() == bounded && matches!(f.case.reference, Reference::Outwards(_))
        };
        let name = format!("{}, outwards", ["free", "bounded"][usize::from(bounded)]);
        row(&name, &found.iter().filter(same).collect::<Vec<_>>());
    }
    let mut worst: Vec<&Found> = found.iter().filter(|f| f.promise.left.is_some()).collect();
    worst.sort_by(|a, b| a.promise.least.total_cmp(&b.promise.least));
    for found in worst.iter().take(3) {
        println!("\nFound::draw({}): {:?}\n{:?}\n{:?}", found.seed, found.promise, found.peaks, found.case);
    }
    let mut hardest: Vec<&Found> = found.iter().filter(|f| f.case.bounds[0].is_infinite()).collect();
    hardest.sort_by(|a, b| b.peaks[1].total_cmp(&a.peaks[1]));
    for found in hardest.iter().take(5) {
        println!(
            "\npeaks {:.1?}, {:.1?}: Found::draw({}), {:?}",
            found.peaks, found.largest, found.seed, found.case
        );
    }
    for found in &found {
        // The drawn bounds may not allow stopping inside, and then nothing may be promised.
        let stays = !found.promise.out_after_arrival || found.case.bounds[0].is_finite();
        assert!(found.promise.broken.is_none() && stays, "{found:?}");
    }
}

/// Peak speed, and the least h at a sample after the deadline, when the crate's own simulation moves the
/// vehicle: one Runge–Kutta step per period, which does not resolve a turn by several radians.
fn as_simulated(case: &Case) -> [f64; 2] {
    let (step, deadline, shape) = (case.step, case.sets[0].deadline, case.sets[0].shape);
    let gain = if let Reference::Damping(gain) = case.reference { gain } else { 0.0 };
    let [mut speed, mut least] = [0.0_f64, f64::INFINITY];
    let schedule = Schedule { step, steps: (case.horizon / step).round() as usize, substeps: 1 };
    let start = [case.start[0], case.start[1], case.start[2], case.start[3]];
    closed_loop(
        &mut case.filter(),
        &Unicycle,
        start,
        schedule,
        |_, x| [-gain * x[3], 0.0],
        |t, x, _, _| {
            speed = speed.max(x[3].abs());
            let h = shape.value(t, &[x[0], x[1], x[2], x[3], 0.0, 0.0, 0.0, 0.0]);
            least = if t >= deadline { least.min(h) } else { least };
        },
    )
    .expect("a valid schedule");
    [speed, least]
}

/// Starts from rest at the origin as in the README, with one number changed. They were thrown out of the set
/// after their arrival, at up to 553 m/s. That requires a plant that resolves turns by several radians as
/// coarsely as the filter's prediction. With the judge's own plant they are not thrown out, but get equally
/// extreme inputs.
#[test]
fn the_readme_with_one_number_changed() {
    let example = || goal([45.0, 45.0], 2.0, 10.0);
    let plain = |set: Set| Case {
        reference: Reference::Damping(1.0),
        ..Case::plain(Plant::Unicycle, Set { margin: 0.02, ..set }, &[0.0; 4], STEP)
    };
    let small = Set { margin: 0.005, ..goal([45.0, 45.0], 0.5, 10.0) };
    let cases = [
        ("as it is", plain(example())),
        ("radius 0.5 m", Case { sets: vec![small], ..plain(example()) }),
        ("centre (200, 200) m", plain(goal([200.0, 200.0], 2.0, 10.0))),
        ("deadline 2 s", plain(goal([45.0, 45.0], 2.0, 2.0))),
        ("rate 0.5/s", plain(Set { rate: Some(0.5), ..example() })),
        ("u_ref = 0", Case { reference: Reference::Zero, ..plain(example()) }),
    ];
    for (name, case) in cases {
        for step in [0.001, 0.01] {
            // The horizon is longer than twice the deadline, since some leave late.
            let horizon = case.horizon + 10.0;
            let found = Found::of(0, Case { horizon, ..case.at(step) });
            let Promise { late, out_after_arrival: out, broken, least, unmet, .. } = found.promise;
            let [speed, left] = as_simulated(&case.at(step));
            println!("{name}, {step} s, as simulated: peak speed {speed:.1}, least h after T {left:.3}");
            assert!(left >= 0.0 && speed < 100.0, "{name}, {step}: {speed} m/s, {left}");
            println!(
                "{name}, {step} s: late {late}, out after arrival {out}, least h {least:.3}, peaks {:.1?}, unmet \
                 {unmet}, broken under the flag {broken:?}",
                found.largest
            );
            assert!(!late && !out && broken.is_none(), "{name}, {step}: {found:?}");
            // A vehicle that coasts through the disc at 9 m/s has its radius of 2 m to stop: 20 m/s², 8 times
            // the profile's.
            let most = if case.reference == Reference::Zero { 20.0 } else { 4.0 };
            let [speed, input] = found.peaks;
            assert!(speed < 2.0 && input < most, "{name}, {step}: peaks {:?}", found.peaks);
        }
    }
}
