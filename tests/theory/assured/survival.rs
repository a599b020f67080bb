//! Robustness of backup plans to what the filter does not know: a delay, a weaker input, a slow actuator.

use std::fmt;

use punctual_core::filter::AssuranceStatus;

use super::cases;
use crate::judge::case::{Case, Reference, Set};
use crate::judge::model::{Input, Plant, Shape, State};
use crate::judge::motion::advance;
use crate::judge::on_every_core;
use crate::starts::drawn;

/// Sampling period in s.
const STEP: f64 = 0.02;
/// Number of parts of a hold; the plant is checked at their ends.
const PARTS: usize = 10;
/// Deadline in s, and the end of a run.
const DEADLINE: f64 = 8.0;
const END: f64 = 12.0;
/// The configured margin, in m.
const MARGIN: f64 = 0.02;

/// A difference between the plant and the filter's model.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Difference {
    None,
    /// The input takes effect one sample later.
    Delay,
    /// This fraction of the input is missing.
    Weak(f64),
    /// The input follows the command with this time constant in s.
    Lag(f64),
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::None => write!(f, "none"),
            Self::Delay => write!(f, "one step of delay, {} ms", 1e3 * STEP),
            Self::Weak(part) => write!(f, "{} % less input", 100.0 * part),
            Self::Lag(time) => write!(f, "{} ms of first-order lag", 1e3 * time),
        }
    }
}

/// How an accepted run ended.
#[derive(Clone, Copy, Debug, PartialEq)]
enum End {
    /// Assured until the end, and kept.
    Kept,
    /// The guarantee was lost, as reported, at this time in s; the promise was then broken by this many m, or
    /// 0.
    Lost { at: f64, by: f64 },
    /// Broken by this many m while it was reported as assured.
    Broken { by: f64 },
}

/// A goal, and two obstacles on the way to it.
fn case(plant: Plant, bounds: Input, start: [f64; 4]) -> Case {
    let disc = |start, radius, outside| Shape::Disc {
        start,
        velocity: [0.0; 2],
        radius,
        smoothing: Some(radius),
        outside,
    };
    let goal = Set { margin: MARGIN, ..Set::within(disc([45.0; 2], 2.0, false), DEADLINE) };
    let clear = |centre| Set { margin: MARGIN, ..Set::keeping(disc(centre, 2.0, true), DEADLINE) };
    let case = Case::plain(plant, goal.clone(), &start, STEP);
    let sets = vec![goal, clear([27.0, 30.0]), clear([33.0, 26.0])];
    Case { sets, bounds, reference: Reference::Damping(1.0), ..case }
}

/// Runs `case`; `None` if the start is refused.
fn run(case: &Case, difference: Difference) -> Option<End> {
    let mut filter = case.assured();
    let (mut x, mut acting, mut before, mut said) = (case.start, [0.0; 2], [0.0; 2], true);
    let (mut worst_said, mut worst, mut lost) = (0.0_f64, 0.0_f64, f64::INFINITY);
    for k in 0..(END / STEP).round() as usize {
        let t = k as f64 * STEP;
        let (mut u, wanted) = ([0.0; 2], [-x[3], 0.0]);
        let assurance =
            filter.step(t, &x[..4], &wanted, &mut u).expect("right dimensions").assurance.expect("plans");
        match (k, assurance.status) {
            (0, AssuranceStatus::Refused) => return None,
            (_, AssuranceStatus::Assured) => {}
            _ if said => (said, lost) = (false, t),
            _ => {}
        }
        for part in 0..PARTS {
            let dt = STEP / PARTS as f64;
            let held = match difference {
                Difference::None => u,
                Difference::Delay => before,
                Difference::Weak(part) => u.map(|u| (1.0 - part) * u),
                Difference::Lag(time) => {
                    // The mean over the part, which is exact at its end.
                    let left = (-dt / time).exp();
                    let mean = [0, 1].map(|i| u[i] + (acting[i] - u[i]) * (1.0 - left) * time / dt);
                    acting = [0, 1].map(|i| u[i] + (acting[i] - u[i]) * left);
                    mean
                }
            };
            x = advance(&case.plant, &x, &held, dt);
            let below = outside(case, t + STEP * (part + 1) as f64 / PARTS as f64, &x);
            worst = worst.max(below);
            if said {
                worst_said = worst_said.max(below);
            }
        }
        before = u;
    }
    Some(match (worst_said > 0.0, said) {
        (true, _) => End::Broken { by: worst_said },
        (false, true) => End::Kept,
        (false, false) => End::Lost { at: lost, by: worst },
    })
}

/// How far a promised set is left, in its unit; 0 if none is.
fn outside(case: &Case, t: f64, x: &State) -> f64 {
    let is_asked = |set: &&Set| set.keeping || t >= set.deadline;
    let sets = case.sets.iter().filter(is_asked);
    sets.map(|set| -set.shape.value(t, x))
        .fold(0.0, |most, below| if below > most || below.is_nan() { below } else { most })
}

/// As documented in docs/guarantees.md.
#[test]
fn table_of_what_a_backup_plan_survives() {
    let count = cases(1, 200);
    // Speeds up to 5 m/s, headings over the full turn.
    let starts: Vec<[f64; 4]> = drawn(count as usize);
    let vehicles = [
        ("point mass", Plant::PointMass, [8.0; 2]),
        ("unicycle", Plant::Unicycle, [8.0, 2.0]),
        ("bicycle, l_r = 2.5 m", Plant::Bicycle { l_r: 2.5 }, [8.0, 0.8]),
    ];
    let differences = [Difference::None, Difference::Delay, Difference::Weak(0.1), Difference::Lag(0.05)];
    println!(
        "| vehicle | difference | accepted | kept | lost | of these kept all the same | by at most, median | \
         first lost | broken while assured | by at most |"
    );
    println!("|---|---|---:|---:|---:|---:|---:|---:|---:|---:|");
    let mut exact = Vec::new();
    for (name, plant, bounds) in vehicles {
        let start = |[x, y, a, b]: [f64; 4]| match plant {
            Plant::PointMass => [x, y, 0.5 * a, 0.5 * b],
            _ => [x, y, a / 10.0 * std::f64::consts::PI, 0.5 * b],
        };
        for difference in differences {
            let ends =
                on_every_core(count, |i| run(&case(plant, bounds, start(starts[i as usize])), difference));
            let ends: Vec<End> = ends.into_iter().flatten().collect();
            let kept = ends.iter().filter(|end| **end == End::Kept).count();
            let mut lost: Vec<[f64; 2]> = ends
                .iter()
                .filter_map(|end| if let End::Lost { at, by } = *end { Some([by, at]) } else { None })
                .collect();
            lost.sort_by(|a, b| a[0].total_cmp(&b[0]));
            let by = |k: usize| lost.get(k).map_or(0.0, |[by, _]| *by);
            let broken =
                ends.iter().filter_map(|end| if let End::Broken { by } = end { Some(*by) } else { None });
            println!(
                "| {name} | {difference} | {} of {count} | {kept} | {} | {} | {:.3} m, {:.3} m | {:.2} s | {} | {:.3} m |",
                ends.len(),
                lost.len(),
                lost.iter().filter(|[by, _]| *by == 0.0).count(),
                by(lost.len().saturating_sub(1)),
                by(lost.len() / 2),
                lost.iter().map(|[_, at]| *at).fold(f64::INFINITY, f64::min),
                ends.iter().filter(|end| matches!(end, End::Broken { .. })).count(),
                broken.fold(0.0, f64::max),
            );
            if difference == Difference::None {
                exact.push((name, ends.len(), kept));
            }
        }
    }
    for (name, accepted, kept) in exact {
        assert!(accepted == kept && 2 * accepted as u64 >= count, "{name}: {kept} of {accepted} of {count}");
    }
}
