//! Reach–avoid: unicycle and bicycle through ten obstacles into the goal by a deadline, inputs bounded.

#![allow(clippy::print_stdout, reason = "the figures are read from the output")]

use punctual_core::barriers::{DistanceDisc, Outside};
use punctual_core::dynamics::{ControlAffine, rk4_step};
use punctual_core::filter::{BarrierSettings, FilterBuilder, SafetyFilter};
use punctual_core::nalgebra::SVector;
use punctual_core::nominal::Heading;
use punctual_core::plants::Unicycle;

use super::bicycle;
use super::starts::drawn;

const GOAL: ([f64; 2], f64) = ([45.0, 45.0], 2.0);
const DEADLINE: f64 = 20.0;
const STEP: f64 = 0.01;

/// Centres and radii in m, between the starts (20 m by 20 m at the origin) and the goal.
const OBSTACLES: [([f64; 2], f64); 10] = [
    ([24.0, 22.0], 2.0),
    ([30.0, 16.0], 2.5),
    ([17.0, 28.0], 2.5),
    ([31.0, 29.0], 2.0),
    ([25.0, 36.0], 2.5),
    ([38.0, 24.0], 2.0),
    ([37.0, 36.0], 1.5),
    ([33.0, 42.0], 2.0),
    ([43.0, 33.0], 2.0),
    ([8.0, 24.0], 2.0),
];

/// What a run came to.
#[derive(Clone, Copy, Debug)]
struct Run {
    start: [f64; 4],
    /// Smallest distance from the edge of an obstacle, m; < 0 in collision.
    clearance: f64,
    arrival: Option<f64>,
    /// Whether it was inside from the deadline until 1.5 times it.
    kept: bool,
    /// Steps whose constraints could not all be met, and among them those that an obstacle's was.
    unmet: [usize; 2],
    /// Whether a deadlock was reported.
    deadlocked: bool,
}

type Nominal = fn(Heading, &[f64; 4]) -> [f64; 2];

fn run<P>(plant: &P, bounds: [f64; 2], nominal: Nominal, start: [f64; 4]) -> Run
where
    P: ControlAffine<4, 2> + Clone + Send + 'static,
{
    let goal = DistanceDisc::new(GOAL.0, GOAL.1, GOAL.1).expect("valid disc");
    let reach = BarrierSettings { margin: 0.02, ..BarrierSettings::within(DEADLINE) };
    // A slow rate brakes early enough for the bounded inputs.
    let avoid = BarrierSettings {
        rate: Some(1.0),
        stay_rate: Some(1.0),
        margin: 0.1,
        ..BarrierSettings::within(DEADLINE)
    };
    let mut builder = SafetyFilter::builder(4, 2)
        .barrier("goal", plant.clone(), goal, reach)
        .and_then(|b| b.bounds(&bounds.map(|v| -v), &bounds))
        .expect("valid goal");
    for (centre, radius) in OBSTACLES {
        let disc = DistanceDisc::new(centre, radius, radius).expect("valid disc");
        builder = builder.barrier("obstacle", plant.clone(), Outside(disc), avoid).expect("valid obstacle");
    }
    let mut filter = FilterBuilder::build(builder).expect("valid filter");
    let heading = Heading { speed_limit: 6.0, ..Heading::towards(GOAL.0) };
    let mut x = SVector::from(start);
    let mut run =
        Run { start, clearance: f64::INFINITY, arrival: None, kept: true, unmet: [0; 2], deadlocked: false };
    for k in 0..=(1.5 * DEADLINE / STEP).round() as usize {
        let t = k as f64 * STEP;
        let waypoint = heading.around([x[0], x[1]], &OBSTACLES, 1.0);
        let u_ref = nominal(waypoint, &x.into());
        let mut u = SVector::<f64, 2>::zeros();
        let report = filter.step(t, x.as_slice(), &u_ref, u.as_mut_slice()).expect("right dimensions");
        assert!(u.iter().zip(bounds).all(|(v, b)| v.abs() <= b), "{u:?} at {t}");
        for (centre, radius) in OBSTACLES {
            let edge = (x[0] - centre[0]).hypot(x[1] - centre[1]) - radius;
            run.clearance = run.clearance.min(edge);
        }
        run.unmet[0] += usize::from(report.unmet().next().is_some());
        run.unmet[1] += usize::from(report.unmet().any(|i| i > 0));
        run.deadlocked |= report.barriers[0].deadlocked;
        let inside = report.barriers[0].h >= 0.0;
        if inside && run.arrival.is_none() {
            run.arrival = Some(t);
        }
        run.kept &= inside || t < DEADLINE - STEP / 2.0;
        x = rk4_step(plant, &x, &u, STEP);
    }
    run
}

/// Starts from which an obstacle can be kept clear of: none within reach of the speed they have.
fn feasible_starts(count: usize) -> Vec<[f64; 4]> {
    let mut starts: Vec<[f64; 4]> = drawn(4 * count)
        .into_iter()
        // Headings over the full turn, speeds up to 3 m/s.
        .map(|[x, y, theta, v]| [x, y, theta / 10.0 * std::f64::consts::PI, 0.3 * v])
        .filter(|x| OBSTACLES.iter().all(|(c, r)| (x[0] - c[0]).hypot(x[1] - c[1]) - r > 0.5 + x[3].abs()))
        .collect();
    starts.truncate(count);
    assert_eq!(starts.len(), count);
    starts
}

/// No collision, and the deadline kept by all but a few that the other vehicles' way round is too long for.
fn table(count: usize) {
    let starts = feasible_starts(count);
    let unicycle: Vec<Run> =
        starts.iter().map(|x0| run(&Unicycle, [8.0, 3.0], |h, x| h.unicycle(x), *x0)).collect();
    let bicycle: Vec<Run> =
        starts.iter().map(|x0| run(&bicycle(), [8.0, 1.2], |h, x| h.bicycle(x, 10.0), *x0)).collect();
    for (name, runs) in
        [("unicycle, |a| <= 8, |omega| <= 3", unicycle), ("bicycle, |a| <= 8, |beta| <= 1.2", bicycle)]
    {
        let count = |f: fn(&Run) -> bool| runs.iter().filter(|r| f(r)).count();
        let collisions = count(|r| r.clearance < 0.0);
        let least = runs.iter().map(|r| r.clearance).fold(f64::INFINITY, f64::min);
        println!(
            "{name}: {} starts, collisions {collisions} (least clearance {least:.3} m), on time and kept {}, \
             arrived {}, steps not met {} (an obstacle's {}), runs with a deadlock reported {}",
            runs.len(),
            count(|r| r.kept),
            count(|r| r.arrival.is_some()),
            runs.iter().map(|r| r.unmet[0]).sum::<usize>(),
            runs.iter().map(|r| r.unmet[1]).sum::<usize>(),
            count(|r| r.deadlocked),
        );
        if let Some(lost) = runs.iter().find(|r| r.clearance < 0.0) {
            println!("  first collision, from {:?}: {lost:?}", lost.start);
        }
        if let Some(lost) = runs.iter().find(|r| !r.kept) {
            println!("  first late, from {:?}: {lost:?}", lost.start);
        }
        assert_eq!(collisions, 0, "{name}");
    }
}

/// All thousand in `tests/nightly`.
#[test]
fn table_of_ways_through_obstacles() {
    table(if std::env::var_os("PUNCTUAL_TABLES").is_some() { 1000 } else { 10 });
}
