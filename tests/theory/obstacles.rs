//! Reach–avoid: unicycle and bicycle through ten obstacles to the goal by a deadline, with bounded inputs.

#![allow(clippy::print_stdout, reason = "the figures are read from the output")]

use punctual_core::barriers::{DistanceDisc, Outside};
use punctual_core::dynamics::{ControlAffine, rk4_step};
use punctual_core::filter::{BarrierSettings, Filter, FilterBuilder, Status};
use punctual_core::plants::{Bicycle, Unicycle};
use punctual_reference::nominal::Heading;

use super::starts::drawn;

pub(crate) const GOAL: ([f64; 2], f64) = ([45.0, 45.0], 2.0);
pub(crate) const DEADLINE: f64 = 20.0;
pub(crate) const STEP: f64 = 0.01;

/// Centres and radii in m, between the starts (20 m by 20 m at the origin) and the goal.
pub(crate) const OBSTACLES: [([f64; 2], f64); 10] = [
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

/// Result of a run.
#[derive(Clone, Copy, Debug)]
struct Run {
    start: [f64; 4],
    /// Smallest distance from the edge of an obstacle, m; < 0 in collision.
    clearance: f64,
    arrival: Option<f64>,
    /// Whether it was inside from the deadline until twice the deadline.
    kept: bool,
    /// Steps that were infeasible, and among them those in which an obstacle's constraint was not met.
    infeasible: [usize; 2],
    /// Steps in which no input moves a barrier that it should move, as at the centre of the goal.
    no_authority: usize,
    /// Whether a deadlock was reported.
    deadlocked: bool,
}

pub(crate) type Nominal = fn(Heading, &[f64; 4]) -> [f64; 2];

/// A filter for goal and obstacles.
pub(crate) fn filter<P>(plant: &P, bounds: [f64; 2]) -> Filter
where
    P: ControlAffine<4, 2> + Clone + Send + Sync + 'static,
{
    let goal = DistanceDisc::new(GOAL.0, GOAL.1, GOAL.1).expect("valid disc");
    let reach = BarrierSettings::within(DEADLINE).margin(0.02);
    // A slow rate brakes early enough for the bounded inputs.
    let avoid = BarrierSettings::within(DEADLINE).rate(1.0).stay_rate(1.0).margin(0.1);
    let mut builder = Filter::builder(plant.clone())
        .barrier("goal", goal, reach)
        .and_then(|b| b.bounds(&bounds.map(|v| -v), &bounds))
        .expect("valid goal");
    for (centre, radius) in OBSTACLES {
        let disc = DistanceDisc::new(centre, radius, radius).expect("valid disc");
        builder = builder.barrier("obstacle", Outside(disc), avoid).expect("valid obstacle");
    }
    FilterBuilder::build(builder).expect("valid filter")
}

pub(crate) fn bicycle(l_r: f64) -> Bicycle {
    Bicycle::new(l_r).expect("valid bicycle")
}

fn run<P>(plant: &P, bounds: [f64; 2], nominal: Nominal, start: [f64; 4]) -> Run
where
    P: ControlAffine<4, 2> + Clone + Send + Sync + 'static,
{
    let mut filter = filter(plant, bounds);
    let heading = Heading { speed_limit: 6.0, ..Heading::towards(GOAL.0) };
    let mut x = start;
    let mut run = Run {
        start,
        clearance: f64::INFINITY,
        arrival: None,
        kept: true,
        infeasible: [0; 2],
        no_authority: 0,
        deadlocked: false,
    };
    for k in 0..=(2.0 * DEADLINE / STEP).round() as usize {
        let t = k as f64 * STEP;
        let waypoint = heading.around([x[0], x[1]], &OBSTACLES, 1.0);
        let u_ref = nominal(waypoint, &x);
        let mut u = [0.0; 2];
        let report = filter.step(t, &x, &u_ref, &mut u).expect("right dimensions");
        assert!(u.iter().zip(bounds).all(|(v, b)| v.abs() <= b), "{u:?} at {t}");
        for (centre, radius) in OBSTACLES {
            let edge = (x[0] - centre[0]).hypot(x[1] - centre[1]) - radius;
            run.clearance = run.clearance.min(edge);
        }
        let infeasible = report.status == Status::Infeasible;
        run.infeasible[0] += usize::from(infeasible);
        run.infeasible[1] += usize::from(infeasible && report.unmet().any(|i| i > 0));
        run.no_authority += usize::from(report.status == Status::NoAuthority);
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

/// Starts from which it is possible to avoid the obstacles: at the initial speed, none is too close.
pub(crate) fn feasible_starts(count: usize) -> Vec<[f64; 4]> {
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

/// One run from each start, on every core.
fn runs<P>(plant: &P, bounds: [f64; 2], nominal: Nominal, starts: &[[f64; 4]]) -> Vec<Run>
where
    P: ControlAffine<4, 2> + Clone + Send + Sync + 'static,
{
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let parts = starts.chunks(starts.len().div_ceil(cores));
    std::thread::scope(|scope| {
        let workers: Vec<_> = parts
            .map(|part| {
                scope
                    .spawn(move || part.iter().map(|x0| run(plant, bounds, nominal, *x0)).collect::<Vec<_>>())
            })
            .collect();
        workers.into_iter().flat_map(|worker| worker.join().expect("no panic")).collect()
    })
}

/// No collision, and the deadline kept by all vehicles that can turn between the obstacles. The long bicycle,
/// whose turning circle is five times as wide as an obstacle, gets stuck in front of one, which is reported.
fn table(count: usize) {
    let starts = feasible_starts(count);
    let rows = [
        ("unicycle", runs(&Unicycle, [8.0, 3.0], |h, x| h.unicycle(x), &starts)),
        ("bicycle, l_r = 2.5 m", runs(&bicycle(2.5), [8.0, 1.2], |h, x| h.bicycle(x, 2.5), &starts)),
        ("bicycle, l_r = 10 m", runs(&bicycle(10.0), [8.0, 1.2], |h, x| h.bicycle(x, 10.0), &starts)),
    ];
    println!(
        "| vehicle | starts | collisions | least clearance | on time | inside from T to 2T | infeasible steps \
         (an obstacle's) | steps without authority | deadlocks reported |"
    );
    println!("|---|---:|---:|---:|---:|---:|---:|---:|---:|");
    for (name, runs) in &rows {
        let count = |f: fn(&Run) -> bool| runs.iter().filter(|r| f(r)).count();
        let sum = |f: fn(&Run) -> usize| runs.iter().map(f).sum::<usize>();
        println!(
            "| {name} | {} | {} | {:.2} m | {} | {} | {} ({}) | {} | {} |",
            runs.len(),
            count(|r| r.clearance < 0.0),
            runs.iter().map(|r| r.clearance).fold(f64::INFINITY, f64::min),
            count(|r| r.arrival.is_some_and(|t| t <= DEADLINE)),
            count(|r| r.kept),
            sum(|r| r.infeasible[0]),
            sum(|r| r.infeasible[1]),
            sum(|r| r.no_authority),
            count(|r| r.deadlocked),
        );
    }
    for (name, runs) in &rows {
        let collision = runs.iter().find(|r| r.clearance < 0.0);
        let from = collision.map(|r| r.start);
        assert!(collision.is_none(), "{name}, from {from:?}: {collision:?}");
        let silent = runs.iter().find(|r| !r.kept && r.infeasible[0] + r.no_authority == 0);
        assert!(silent.is_none(), "{name}, late without a word: {silent:?}");
        let late = runs.iter().find(|r| !r.kept);
        assert!(late.is_none() || name.ends_with("10 m"), "{name}: {late:?}");
    }
}

/// Runs all thousand in `tests/nightly`.
#[test]
fn table_of_ways_through_obstacles() {
    table(if std::env::var_os("PUNCTUAL_TABLES").is_some() { 1000 } else { 10 });
}
