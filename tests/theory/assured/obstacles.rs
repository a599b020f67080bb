//! Ten obstacles with a backup plan: what is accepted is on time, kept and without collision, and never
//! infeasible.

use punctual_core::dynamics::{ControlAffine, rk4_step};
use punctual_core::filter::{Driver, Status};
use punctual_core::plan::Failure;
use punctual_core::plants::Unicycle;
use punctual_reference::nominal::Heading;

use super::cases;
use crate::judge::on_every_core;
use crate::obstacles::{DEADLINE, GOAL, Nominal, OBSTACLES, STEP, bicycle, feasible_starts, filter};

/// Number of parts of a hold; distances are checked at their ends.
const PARTS: usize = 5;

/// Every start is checked for acceptance, and one in this many is simulated; the others show no more.
const DRIVEN: u64 = 10;

/// Result of a run.
#[derive(Clone, Copy, Debug)]
struct Run {
    start: [f64; 4],
    /// Number of steps; 0 if only acceptance was checked.
    steps: usize,
    /// Why it was refused, if it was.
    refused: Option<Failure>,
    /// Smallest distance from the edge of an obstacle, m; < 0 in collision.
    clearance: f64,
    on_time: bool,
    /// Whether it was inside from the deadline until the end of the run.
    kept: bool,
    infeasible: usize,
    /// Steps driven by the plan, and steps that were not assured.
    driven: usize,
    unsaid: usize,
}

/// Runs from `start` until 1.5 times the deadline, if it is accepted and to be simulated.
fn run<P>(plant: &P, bounds: [f64; 2], nominal: Nominal, start: [f64; 4], driven: bool) -> Run
where
    P: ControlAffine<4, 2> + Clone + Send + Sync + 'static,
{
    let mut filter = filter(plant, bounds).with_plans(STEP).expect("a filter that can be assured");
    let heading = Heading { speed_limit: 6.0, ..Heading::towards(GOAL.0) };
    let mut x = start;
    let mut run = Run {
        start,
        steps: 0,
        refused: None,
        clearance: f64::INFINITY,
        on_time: false,
        kept: true,
        infeasible: 0,
        driven: 0,
        unsaid: 0,
    };
    for k in 0..(1.5 * DEADLINE / STEP).round() as usize {
        let t = k as f64 * STEP;
        let waypoint = heading.around([x[0], x[1]], &OBSTACLES, 1.0);
        let u_ref = nominal(waypoint, &x);
        let mut u = [0.0; 2];
        let assurance =
            filter.step(t, &x, &u_ref, &mut u).expect("right dimensions").assurance.expect("plans");
        if k == 0 && !assurance.is_assured() {
            return Run { refused: assurance.failure, ..run };
        }
        if !driven {
            break;
        }
        run.steps += 1;
        assert!(u.iter().zip(bounds).all(|(v, b)| v.abs() <= b), "{u:?} at {t}");
        run.infeasible += usize::from(filter.report().status == Status::Infeasible);
        run.driven += usize::from(assurance.driver == Driver::Plan);
        run.unsaid += usize::from(!assurance.is_assured());
        for part in 0..PARTS {
            let now = t + STEP * part as f64 / PARTS as f64;
            for (centre, radius) in OBSTACLES {
                run.clearance = run.clearance.min((x[0] - centre[0]).hypot(x[1] - centre[1]) - radius);
            }
            let inside = (x[0] - GOAL.0[0]).hypot(x[1] - GOAL.0[1]) <= GOAL.1;
            run.on_time |= inside && now <= DEADLINE;
            // A fraction of a step late, so that round-off in t does not require anything before the
            // deadline.
            run.kept &= inside || now < DEADLINE + 1e-6 * STEP;
            x = rk4_step(plant, &x, &u, STEP / PARTS as f64);
        }
    }
    run
}

fn runs<P>(plant: &P, bounds: [f64; 2], nominal: Nominal, starts: &[[f64; 4]]) -> Vec<Run>
where
    P: ControlAffine<4, 2> + Clone + Send + Sync + 'static,
{
    on_every_core(starts.len() as u64, |i| run(plant, bounds, nominal, starts[i as usize], i % DRIVEN == 0))
}

/// The row of the table.
fn row(name: &str, runs: &[Run]) {
    let accepted = runs.iter().filter(|r| r.refused.is_none()).count();
    let driven: Vec<&Run> = runs.iter().filter(|r| r.steps > 0).collect();
    let count = |f: fn(&Run) -> bool| driven.iter().filter(|r| f(r)).count();
    let sum = |f: fn(&Run) -> usize| driven.iter().map(|r| f(r)).sum::<usize>();
    println!(
        "| {name} | {} | {accepted} | {} | {} | {} | {} | {:.3} m | {} | {} | {} of {} |",
        runs.len(),
        driven.len(),
        count(|r| r.on_time),
        count(|r| r.kept),
        count(|r| r.clearance < 0.0),
        driven.iter().map(|r| r.clearance).fold(f64::INFINITY, f64::min),
        sum(|r| r.infeasible),
        sum(|r| r.unsaid),
        sum(|r| r.driven),
        sum(|r| r.steps),
    );
    for run in runs.iter().filter(|r| r.refused.is_some()) {
        println!("{name}, refused from {:?}: {:?}", run.start, run.refused);
    }
}

/// The same starts, bounds and obstacles as without plans.
#[test]
fn table_of_assured_ways_through_obstacles() {
    /// Fraction of the starts that must be accepted.
    const ACCEPTED: f64 = 0.99;
    let starts = feasible_starts(cases(2, 1000) as usize);
    println!(
        "| vehicle | starts | accepted | of these driven | on time | inside from T to 1.5T | collisions | \
         least clearance | infeasible steps | steps not assured | driven by the plan |"
    );
    println!("|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|");
    let unicycle = || runs(&Unicycle, [8.0, 3.0], |h, x| h.unicycle(x), &starts);
    let agile = || runs(&bicycle(2.5), [8.0, 1.2], |h, x| h.bicycle(x, 2.5), &starts);
    let long = || runs(&bicycle(10.0), [8.0, 1.2], |h, x| h.bicycle(x, 10.0), &starts);
    let rows: [(&str, &dyn Fn() -> Vec<Run>); 3] =
        [("bicycle, l_r = 10 m", &long), ("bicycle, l_r = 2.5 m", &agile), ("unicycle", &unicycle)];
    let mut refused = Vec::new();
    for (name, runs) in rows {
        let runs = runs();
        row(name, &runs);
        let lost = runs.iter().find(|r| {
            r.steps > 0 && (!r.on_time || !r.kept || r.clearance < 0.0 || r.infeasible + r.unsaid > 0)
        });
        assert!(lost.is_none(), "{name}: {lost:?}");
        let accepted = runs.iter().filter(|r| r.refused.is_none()).count();
        if (accepted as f64) < ACCEPTED * runs.len() as f64 {
            refused.push(format!("{name}: {accepted} of {}", runs.len()));
        }
    }
    assert!(refused.is_empty(), "{refused:?}");
}
