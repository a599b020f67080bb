//! Promises that were once broken, each as it was found and with numbers drawn around it.
//!
//! The judge checks them at all instants; it defines what a promise is.

#![allow(clippy::print_stdout, reason = "the figures are read from the output")]

use std::f64::consts::PI;

use punctual_core::filter::Status;

use super::judge::case::{Case, Numbers, Reference, Set, Steps};
use super::judge::model::{Plant, Shape};
use super::judge::run::{Run, run, run_seen};
use super::judge::{drawn, on_every_core};

fn disc(start: [f64; 2], radius: f64, outside: bool) -> Shape {
    Shape::Disc { start, velocity: [0.0; 2], radius, smoothing: Some(radius), outside }
}

fn line(sign: f64, at: f64) -> Shape {
    Shape::Line { sign, at }
}

/// Number of runs that broke a promise under the flag; prints the worst of them.
fn broken(name: &str, cases: &[Case]) -> usize {
    let runs = on_every_core(cases.len() as u64, |i| run(&cases[i as usize]));
    let size = |run: &Run| run.promises.iter().filter_map(|p| p.broken).map(|b| b.size).fold(0.0, f64::max);
    let broken = runs.iter().map(size).enumerate().filter(|(_, size)| *size > 0.0);
    let count = broken.clone().count();
    println!("{name}: {count} of {} broken under the flag", cases.len());
    if let Some((i, _)) = broken.max_by(|a, b| a.1.total_cmp(&b.1)) {
        println!("  {:?}\n  {:?}", runs[i].promises, cases[i]);
    }
    count
}

/// A point mass at the origin that must avoid a disc; u_ref = 0, 10 ms.
fn towards(velocity: [f64; 2], centre: [f64; 2], radius: f64) -> Case {
    let set = Set::keeping(disc(centre, radius, true), 5.0);
    Case::plain(Plant::PointMass, set, &[0.0, 0.0, velocity[0], velocity[1]], 0.01)
}

#[test]
fn an_obstacle_straight_ahead() {
    let mut count = broken("as found", &[towards([4.27, 0.0], [2.88, 0.0], 2.0)]);
    let mut numbers = Numbers::new(1);
    let cases: Vec<_> = (0..100)
        .map(|_| {
            let radius = numbers.within(0.5, 3.0);
            let far = radius + numbers.within(0.05, 3.0);
            towards([numbers.within(0.5, 3.0) * far, 0.0], [far, 0.0], radius)
        })
        .collect();
    count += broken("around it", &cases);
    assert_eq!(count, 0);
}

/// 536 of these starts collided.
#[test]
fn two_thousand_starts_outside_a_disc() {
    let mut numbers = Numbers::new(2);
    let cases: Vec<_> = (0..drawn(2000))
        .map(|_| {
            let (radius, angle) = (numbers.within(0.5, 5.0), numbers.within(-PI, PI));
            let far = radius + numbers.scale(0.1, 5.0);
            let velocity = [numbers.within(-10.0, 10.0), numbers.within(-10.0, 10.0)];
            towards(velocity, [far * angle.cos(), far * angle.sin()], radius)
        })
        .collect();
    assert_eq!(broken("random starts", &cases), 0);
}

/// p' = u, h = 10 − p, pushed against the wall; every row can be met, and is.
#[test]
fn a_wall_at_ten_metres() {
    let wall = |at: f64, push: f64, step: f64, deadline: f64| Case {
        reference: Reference::Outwards(push),
        horizon: 3.0 * at / push,
        ..Case::plain(Plant::Chain(1), Set::keeping(line(-1.0, at), deadline), &[0.0], step)
    };
    let mut cases = vec![wall(10.0, 1.0, 0.01, 10.0)];
    let mut numbers = Numbers::new(3);
    cases.extend((0..50).map(|_| {
        let (at, push) = (numbers.scale(0.1, 100.0), numbers.scale(0.1, 10.0));
        wall(at, push, numbers.scale(0.001, 0.1) * at / push, numbers.scale(0.2, 5.0) * at / push)
    }));
    for case in &cases {
        let found = run_seen(case, |t, x, _, report| {
            assert!(report.status.is_satisfied(), "{:?} at {t}, {x:?}: {case:?}", report.status);
        });
        let promise = found.promises[0];
        assert!(promise.left.is_none() && promise.unmet == 0, "{promise:?}: {case:?}");
        assert!(!promise.unflagged, "{case:?}");
    }
}

/// n = 1: −0.380 m, −0.020 m and −3.98 m at T itself, which falls between two samples.
#[test]
fn deadlines_between_samples() {
    let reach = |d: f64, deadline: f64, step: f64| {
        Case::plain(Plant::Chain(1), Set::within(line(1.0, d), deadline), &[0.0], step)
    };
    let mut cases = vec![reach(60.0, 10.0, 0.3), reach(60.0, 10.0, 0.03), reach(60.0, 1.0, 0.3)];
    let mut numbers = Numbers::new(4);
    cases.extend((0..100).map(|_| {
        let deadline = numbers.scale(0.3, 30.0);
        reach(numbers.scale(0.1, 100.0), deadline, deadline / numbers.scale(1.5, 300.0))
    }));
    let late = |case: &Case| run(case).promises[0].left;
    for case in &cases[..3] {
        println!("T = {}, step {}: {:?}", case.sets[0].deadline, case.step, late(case));
    }
    let count = cases.iter().filter(|case| late(case).is_some()).count();
    println!("{count} of {} late at T itself", cases.len());
    assert_eq!(count, 0);
}

/// Chains with derivatives of similar size in units of the deadline, starting outside.
fn chains(n: usize, count: usize, steps: Steps) -> Vec<Case> {
    let mut numbers = Numbers::new(50 + n as u64);
    let draw = |i: usize| {
        let deadline = numbers.scale(0.5, 20.0);
        let mut unit = 1.0;
        let mut start = Vec::new();
        for j in 0..n {
            start.push(numbers.within(-10.0, 10.0) * unit);
            unit *= (j + 1) as f64 / deadline;
        }
        start[0] = -start[0].abs();
        let step = deadline / numbers.scale(20.0, 500.0);
        let set = Set::within(line(1.0, 0.0), deadline);
        let (push, held) = (10.0 * unit * numbers.within(0.0, 2.0), deadline / numbers.scale(3.0, 100.0));
        let reference = match numbers.below(3) {
            0 => Reference::Zero,
            1 => Reference::Outwards(push),
            _ => Reference::Random { size: [push; 2], held },
        };
        Case { steps, reference, seed: i as u64, ..Case::plain(Plant::Chain(n), set, &start, step) }
    };
    (0..count).map(draw).collect()
}

/// 89, 16 and 6 of 2,000 were broken for n = 1, 2, 3.
#[test]
fn missed_steps() {
    let found =
        [1, 2, 3].map(|n| broken(&format!("n = {n}, missed"), &chains(n, drawn(2000), Steps::Missed)));
    assert_eq!(found, [0; 3]);
}

/// 148, 82 and 37 were broken.
#[test]
fn steps_of_every_length() {
    let found =
        [1, 2, 3].map(|n| broken(&format!("n = {n}, scattered"), &chains(n, drawn(2000), Steps::Scattered)));
    assert_eq!(found, [0; 3]);
}

/// One step of 1e-12 s disabled the filter, and it drove through a wall at 10 m.
#[test]
fn a_very_short_step() {
    let wall = |n: usize, push: f64, steps: Steps| Case {
        reference: Reference::Outwards(push),
        steps,
        horizon: 20.0,
        ..Case::plain(Plant::Chain(n), Set::keeping(line(-1.0, 10.0), 10.0), &[0.0; 8][..n], 0.01)
    };
    let mut left = 0;
    for n in 1..=3 {
        for short in [1e-12, 1e-9, 1e-6] {
            for steps in [Steps::Once(short), Steps::EveryTenth(short), Steps::Alternating(short)] {
                for push in [1.0, 3.0, 10.0] {
                    let promise = run(&wall(n, push, steps)).promises[0];
                    if let Some(found) = promise.left {
                        println!("n = {n}, push {push}, {steps:?}: {found:?}");
                        left += 1;
                    }
                }
            }
        }
    }
    println!("walls left: {left} of 81");
    let found =
        [1, 2, 3].map(|n| broken(&format!("n = {n}, short steps"), &chains(n, drawn(500), Steps::Tiny)));
    assert_eq!((found, left), ([0; 3], 0));
}

/// Few samples before a deadline: h dipped between two of them, though it was nonnegative at every sample.
#[test]
fn dips_between_samples() {
    let found = [Plant::PointMass, Plant::Unicycle, Plant::Bicycle { l_r: 2.0 }].map(|plant| {
        let mut numbers = Numbers::new(8);
        let mut draw = || {
            let start = [
                numbers.within(0.0, 20.0),
                numbers.within(0.0, 20.0),
                numbers.within(-10.0, 10.0),
                numbers.within(-10.0, 10.0),
            ];
            let margin = if numbers.chance(0.5) { 0.0 } else { 0.02 };
            let set = Set { margin, ..Set::within(disc([45.0, 45.0], 2.0, false), 5.0) };
            let references = [Reference::Zero, Reference::Damping(1.0), Reference::Outwards(5.0)];
            let reference = references[numbers.below(3)];
            Case { reference, ..Case::plain(plant, set, &start, 5.0 / numbers.within(10.0, 50.0).round()) }
        };
        let cases: Vec<_> = (0..drawn(1000)).map(|_| draw()).collect();
        broken(&format!("{plant:?}"), &cases)
    });
    assert_eq!(found, [0; 3]);
}

/// A barrier that was left starts again, and does not claim that it was kept.
#[test]
fn recovery_does_not_claim_what_was_lost() {
    let mut numbers = Numbers::new(11);
    let (mut claimed, mut recovered) = (0, 0);
    for i in 0..100 {
        // Steps longer than the filter was told carry the state out.
        let (n, at) = (1 + i % 2, numbers.scale(1.0, 20.0));
        let step = numbers.within(0.01, 0.1);
        let (rate, recovery) = (Some(1.0 / step), Some(numbers.within(1.0, 5.0)));
        let set = Set { rate, recovery, ..Set::within(line(-1.0, at), 5.0) };
        let push = at * numbers.within(1.0, 5.0);
        let case = Case {
            reference: Reference::Outwards(push),
            steps: Steps::Missed,
            announced: false,
            seed: i as u64,
            ..Case::plain(Plant::Chain(n), set, &[0.0; 2][..n], step)
        };
        let mut recoveries = 0;
        run_seen(&case, |_, _, _, report| {
            let b = &report.barriers[0];
            let anew = b.recoveries > recoveries;
            recovered += usize::from(anew);
            claimed += usize::from(anew && b.on_course && b.h < 0.0);
            recoveries = b.recoveries;
        });
    }
    println!("begun anew {recovered} times, {claimed} of them guaranteed with h < 0");
    assert!(claimed == 0 && recovered > 0);
}

/// A wall that swings by several radians between samples looks like one that swings slowly.
#[test]
fn a_wall_faster_than_the_samples() {
    let wall = |size: f64, angle: f64, n: usize| {
        let set = Set::within(Shape::Wave { size, rate: angle / 0.01 }, 2.0);
        Case::plain(Plant::Written(n), set, &[-1.0, 0.0][..n], 0.01)
    };
    let mut cases: Vec<_> = [2.0 * PI, 4.0 * PI, PI, 6.0, 20.0].map(|angle| wall(1.0, angle, 1)).to_vec();
    let mut numbers = Numbers::new(12);
    let mut draw = |i: usize| wall(numbers.scale(0.1, 5.0), numbers.scale(0.5, 50.0), 1 + i % 2);
    cases.extend((0..50).map(&mut draw));
    assert_eq!(broken("walls", &cases), 0);
}

/// A sample that does not meet its constraint says so.
#[test]
fn unmet_samples_say_so() {
    let case = Case { bounds: [0.1; 2], ..towards([4.27, 0.0], [2.88, 0.0], 2.0) };
    let mut infeasible = false;
    let found = run_seen(&case, |_, _, _, report| infeasible |= report.status == Status::Infeasible);
    assert!(infeasible && found.promises[0].unmet > 0, "{found:?}");
}
