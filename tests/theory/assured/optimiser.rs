//! Unicycles and bicycles with bounds, for an independent judge: `tests/oracle/optimise.py` uses an optimiser
//! with many initial guesses to find out whether a refused case is feasible.

use std::f64::consts::PI;
use std::fs;

use punctual_core::filter::Filter;
use serde_json::{Value, json};

use super::cases;
use crate::judge::case::{Case, Numbers, Set};
use crate::judge::model::{Plant, Shape};
use crate::judge::on_every_core;

/// Radius of the goal, around the origin, in m.
const RADIUS: f64 = 2.0;
/// Number of holds until the deadline for the optimiser. Each is a whole number of periods, so that a
/// solution is a plan.
const HOLDS: usize = 40;

/// A start outside, and a deadline close to the least time that a unicycle needs to turn, drive and stop.
fn draw(seed: u64, bicycle: bool) -> Case {
    let mut numbers = Numbers::new(seed);
    let a = numbers.scale(0.5, 10.0);
    let far = RADIUS * numbers.scale(1.2, 20.0);
    let [angle, heading] = [(); 2].map(|()| numbers.within(-PI, PI));
    let speed = numbers.within(-1.0, 1.0) * (a * far).sqrt();
    let start = [far * angle.cos(), far * angle.sin(), heading, speed];
    let (plant, turning) = match bicycle {
        // Turning circles of a tenth of the distance or more.
        true => (Plant::Bicycle { l_r: far * numbers.scale(0.05, 0.5) }, numbers.within(0.3, 1.2)),
        false => (Plant::Unicycle, numbers.scale(0.3, 4.0)),
    };
    let (turns, longest) = if bicycle { (1.0, 1.1) } else { (turning, 1.5) };
    let deadline = turn_and_drive(&start, [a, turns]) * numbers.within(0.3, longest);
    let period = deadline / (HOLDS * (1 + numbers.below(5))) as f64;
    let goal = Shape::Disc {
        start: [0.0; 2],
        velocity: [0.0; 2],
        radius: RADIUS,
        smoothing: Some(RADIUS),
        outside: false,
    };
    let case = Case::plain(plant, Set::within(goal, deadline), &start, period);
    Case { bounds: [a, turning], ..case }
}

/// The time in s in which a unicycle stops, turns towards the origin or away from it, drives there and stops,
/// with inputs at their bounds. This is certainly feasible.
fn turn_and_drive(start: &[f64; 4], [a, turning]: [f64; 2]) -> f64 {
    let [x, y, heading, v] = *start;
    let stopped = v.abs() * v / (2.0 * a);
    let [x, y] = [x + stopped * heading.cos(), y + stopped * heading.sin()];
    let away = (y.atan2(x) - heading).rem_euclid(PI);
    v.abs() / a + away.min(PI - away) / turning + 2.0 * (x.hypot(y) / a).sqrt()
}

fn described(case: &Case, accepted: bool) -> Value {
    let length = if let Plant::Bicycle { l_r } = case.plant { Some(l_r) } else { None };
    json!({
        "l_r": length, "start": case.start[..4], "radius": RADIUS, "deadline": case.sets[0].deadline,
        "period": case.step, "holds": HOLDS, "bounds": case.bounds, "accepted": accepted,
    })
}

/// Every unicycle that has time to stop, turn, drive and stop is accepted. With `PUNCTUAL_ORACLE`, all cases
/// are written to that file.
#[test]
fn table_of_what_a_manoeuvre_can_do() {
    /// Inputs change only at samples: up to one additional period for each of the four changes.
    const CHANGES: f64 = 4.0;
    let count = cases(24, 400);
    let found = on_every_core(count, |i| {
        let case = draw(0x0b5e_0000 + i, i % 2 == 1);
        let mut filter: Filter = case.assured();
        let assurance =
            filter.step(0.0, &case.start[..4], &[0.0; 2], &mut [0.0; 2]).expect("right dimensions");
        let assurance = assurance.assurance.expect("plans");
        (case, assurance)
    });
    let rows: Vec<Value> = found.iter().map(|(case, found)| described(case, found.is_assured())).collect();
    if let Some(path) = std::env::var_os("PUNCTUAL_ORACLE") {
        fs::write(path, serde_json::to_string(&rows).expect("serialises"))
            .expect("a file that can be written");
    }
    let certain = |case: &Case| {
        let start = [0, 1, 2, 3].map(|i| case.start[i]);
        let least = turn_and_drive(&start, case.bounds) + CHANGES * case.step;
        case.plant == Plant::Unicycle && least <= case.sets[0].deadline
    };
    let (mut sure, mut refused) = (0, Vec::new());
    for (case, found) in found.iter().filter(|(case, _)| certain(case)) {
        sure += 1;
        if !found.is_assured() {
            println!("refused, {:?}: {:?}", found.failure, described(case, false).to_string());
            refused.push(case);
        }
    }
    let accepted = found.iter().filter(|(_, found)| found.is_assured()).count();
    println!(
        "{count} starts: {accepted} accepted; {sure} unicycles that can turn, drive and stop, {} refused",
        refused.len()
    );
    assert!(10 * sure >= count as usize / 2, "{sure}: too few to show anything");
    assert!(refused.is_empty(), "{refused:?}");
}
