//! Tables of plans: whatever u_ref asks for, every declared plant from every declared start keeps what was promised.
//!
//! The judge has an integrator of its own, and looks between samples too. More cases:
//! `PUNCTUAL_FOLLOWER=100 cargo test --release -p punctual-core --test all -- --nocapture follower::`.

#![allow(clippy::print_stdout, reason = "the figures are wanted")]

use crate::uncertain::*;

use punctual_core::dynamics::ControlAffine;
use punctual_core::filter::TabledPlan;
use punctual_core::follower::{Follower, FollowerState, Following, PlanTable};
use punctual_core::plants::{Bicycle, PointMass, Unicycle};

const START: [f64; 4] = [0.1, 0.1, 0.03, 0.05];
/// Steps of the follower in a period of its plan.
const STEPS: u32 = 4;

/// What runs came to.
#[derive(Debug)]
struct Tally {
    accepted: usize,
    runs: usize,
    least: f64,
    /// Of all inputs those that passed, and the parts of half the widths of the bounds that are free.
    passed: f64,
    freedom: f64,
}

fn table<P>(plant: &P, case: &Case, declared: &Declared) -> Option<TabledPlan>
where
    P: ControlAffine<4, 2> + Clone + Send + Sync + 'static,
{
    let filter = case.filter(plant.clone(), Some(declared));
    let planning = filter.planning().unwrap();
    match planning.table(0.0, &case.x, &START, None).unwrap() {
        Ok(table) => Some(table),
        Err(failure) => {
            println!("{failure}");
            None
        }
    }
}

/// Runs a plant that is measured at a corner of the start set. Returns the least h, and the part of inputs that passed.
fn attacked<P>(plant: &P, case: &Case, declared: &Declared, table: &PlanTable<'_>, seed: u64) -> [f64; 2]
where
    P: ControlAffine<4, 2>,
{
    let mut draws = Draws(seed);
    let mut follower = Follower::new(*table);
    let corner: [f64; 4] = core::array::from_fn(|i| case.x[i] + START[i] * draws.sign());
    let (adversary, asks) = (ADVERSARIES[seed as usize % 3], ASKS[seed as usize / 3 % 3]);
    let mut sides = Sides::of(|| draws.sign());
    let mut x: [f64; 4] = core::array::from_fn(|i| corner[i] - declared.errors[i] * sides.errors[i]);
    let (mut wanted, mut least, mut passed) = ([0.0; 2], f64::INFINITY, 0);
    let dt = PERIOD / f64::from(STEPS);
    let steps = (table.until() / dt - 0.5) as u32;
    for step in 0..steps {
        let t = 7.0 + f64::from(step) * dt;
        match adversary {
            Adversary::Random if step > 0 => sides = Sides::of(|| draws.within(-1.0, 1.0)),
            Adversary::Corners if step > 0 && draws.part() < 0.02 => sides = Sides::of(|| draws.sign()),
            _ => {}
        }
        let measured: [f64; 4] = core::array::from_fn(|i| x[i] + declared.errors[i] * sides.errors[i]);
        wanted = match asks {
            Asks::Zero => [0.0; 2],
            Asks::Damping => [-measured[2], -measured[3]],
            // For a while each.
            Asks::Hostile if draws.part() < 0.02 => case.bounds.map(|bound| bound * draws.sign()),
            Asks::Hostile => wanted,
        };
        let mut u = [0.0; 2];
        let following = follower.step(t, &measured, &wanted, &mut u).unwrap();
        assert_eq!(following, Following::Kept, "{case:?} {seed} at {t}");
        assert!(u.iter().zip(case.bounds).all(|(u, bound)| u.abs() <= bound), "{u:?}");
        passed += usize::from(u == wanted);
        let rate = |x: &[f64; 4]| {
            let arrives = core::array::from_fn(|i| {
                let [low, high] = declared.gains[i];
                u[i] * (0.5 * (low + high) + 0.5 * (high - low) * sides.gains[i])
            });
            let rate = plant.derivative(x, &arrives);
            core::array::from_fn::<f64, 4, _>(|i| rate[i] + declared.rates[i] * sides.rates[i])
        };
        // The classical rule of fourth order, in two parts of a step.
        for part in 1..=2 {
            let h = 0.5 * dt;
            let moved = |by: f64, k: &[f64; 4]| core::array::from_fn::<f64, 4, _>(|i| x[i] + by * h * k[i]);
            let k1 = rate(&x);
            let k2 = rate(&moved(0.5, &k1));
            let k3 = rate(&moved(0.5, &k2));
            let k4 = rate(&moved(1.0, &k3));
            x = core::array::from_fn(|i| x[i] + h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]));
            let now = t - 7.0 + 0.5 * f64::from(part) * dt;
            for (j, h) in case.h(&x).into_iter().enumerate() {
                if j > 0 || now >= DEADLINE {
                    least = least.min(h);
                }
            }
        }
    }
    [least, passed as f64 / f64::from(steps)]
}

fn tally<P>(name: &str, plant: &P, bounds: [f64; 2], declared: &Declared, seed: u64) -> Tally
where
    P: ControlAffine<4, 2> + Clone + Send + Sync + 'static,
{
    let cases = std::env::var("PUNCTUAL_FOLLOWER").map_or(1, |cases| cases.parse().unwrap());
    let mut draws = Draws(seed);
    let mut tally = Tally { accepted: 0, runs: 0, least: f64::INFINITY, passed: 0.0, freedom: 0.0 };
    for k in 0..cases {
        let case = Case::draw(&mut draws, bounds, name == "point mass");
        let Some(made) = table(plant, &case, declared) else { continue };
        assert!(made.promised.iter().all(|promised| *promised));
        tally.accepted += 1;
        let table = PlanTable::read(&made.bytes).unwrap();
        tally.freedom += made.freedom[0] / bounds[0];
        for run in 0..30 {
            let [least, passed] = attacked(plant, &case, declared, &table, 31 * k + run);
            tally.runs += 1;
            tally.least = tally.least.min(least);
            tally.passed += passed;
        }
    }
    tally.passed /= tally.runs as f64;
    tally.freedom /= tally.accepted as f64;
    println!("{name}: {tally:?} of {cases}");
    tally
}

#[test]
fn every_start_and_every_wish_is_kept() {
    let [nothing, all] = [Declared::nothing(), Declared::all(false)];
    let bicycle = Bicycle::new(2.5).unwrap();
    let mut found = vec![
        tally("unicycle", &Unicycle, [4.0, 1.5], &nothing, 1),
        tally("point mass", &PointMass, [4.0; 2], &all, 2),
        tally("bicycle", &bicycle, [4.0, 0.6], &all, 2),
    ];
    if std::env::var("PUNCTUAL_FOLLOWER").is_ok() {
        found.push(tally("unicycle", &Unicycle, [4.0, 1.5], &all, 2));
        found.push(tally("point mass", &PointMass, [4.0; 2], &nothing, 1));
        found.push(tally("bicycle", &bicycle, [4.0, 0.6], &nothing, 1));
    }
    assert!(found.iter().all(|tally| tally.runs == 0 || tally.least >= 0.0), "{found:?}");
    assert!(found.iter().map(|tally| tally.accepted).sum::<usize>() >= 2, "{found:?}");
}

/// A goal, and nothing on the way.
fn empty() -> Case {
    Case {
        x: [0.0, 0.0, 0.0, 1.0],
        goal: [12.0, 2.0],
        rocks: Vec::new(),
        bounds: [4.0, 1.5],
        is_point: false,
    }
}

/// A case, and its plan.
fn planned() -> (Case, TabledPlan) {
    let case = empty();
    let made = table(&Unicycle, &case, &Declared::all(false)).expect("a plan");
    (case, made)
}

#[test]
fn what_is_no_plan_is_refused() {
    let (_, TabledPlan { bytes, .. }) = planned();
    let is_table = |bytes: &[u8]| PlanTable::read(bytes).is_ok();
    assert!(is_table(&bytes));
    assert!((0..bytes.len()).all(|length| !is_table(&bytes[..length])));
    // One number at a time is none.
    let count = bytes.len() / 8;
    for k in (0..count).filter(|k| ![5, 8, 9, 10, 11].contains(k)) {
        let mut damaged = bytes.clone();
        damaged[8 * k..8 * (k + 1)].copy_from_slice(&f64::NAN.to_le_bytes());
        assert!(!is_table(&damaged), "number {k}");
    }
    // Numbers that are too large to be counts, or no whole ones.
    for number in [0.5, -1.0, 1e300, f64::INFINITY] {
        for k in 0..3 {
            let mut damaged = bytes.clone();
            damaged[8 * k..8 * (k + 1)].copy_from_slice(&number.to_le_bytes());
            assert!(!is_table(&damaged), "{number} at {k}");
        }
    }
}

#[test]
fn a_guarantee_is_lost_where_it_has_to_be() {
    let (case, made) = planned();
    let table = PlanTable::read(&made.bytes).expect("a table");
    let mut u = [0.0; 2];
    let reference = |k: usize| -> [f64; 4] { core::array::from_fn(|i| table.state(k, i)) };
    let mut step = |follower: &mut Follower<'_>, t: f64, x: &[f64; 4]| {
        follower.step(t, x, &[f64::NAN, 100.0], &mut u).expect("the lengths")
    };
    // A start at the edge, and one beyond it.
    for (by, wanted) in [(0.999, Following::Kept), (1.001, Following::OutOfStart)] {
        let mut follower = Follower::new(table);
        let mut x = case.x;
        x[1] += by * table.radius(0, 1);
        assert_eq!(step(&mut follower, 3.0, &x), wanted);
        assert_eq!(follower.until().is_some(), wanted == Following::Kept);
    }
    // Along the reference, to the end; u_ref that is no number is the law, and one that is too large is limited.
    let mut follower = Follower::new(table);
    for k in 0..table.holds() {
        let t = 3.0 + table.begin(k);
        let is_over = table.begin(k) >= table.until() - 1e-6;
        let wanted = if is_over { Following::Ended } else { Following::Kept };
        assert_eq!(step(&mut follower, t, &reference(k)), wanted, "{k}");
        if !is_over {
            let law = follower.state().law[1];
            let mut found = [0.0; 2];
            // The same step again changes nothing.
            follower.step(t, &[f64::NAN; 4], &[f64::NAN, 100.0], &mut found).expect("the lengths");
            assert_eq!(found[0], follower.state().law[0]);
            assert_eq!(found[1], (law + table.freedom(1)).min(case.bounds[1]));
        }
    }
    assert_eq!(step(&mut follower, 3.0 + table.until(), &reference(0)), Following::Ended);
    // A step that misses the beginning of a hold; what is lost stays lost until it is armed again.
    let mut follower = Follower::new(table);
    assert_eq!(step(&mut follower, 0.0, &reference(0)), Following::Kept);
    assert_eq!(step(&mut follower, table.begin(1) + 0.003, &reference(1)), Following::Late);
    assert_eq!(step(&mut follower, table.begin(2), &reference(2)), Following::Late);
    follower.rearm();
    assert_eq!(step(&mut follower, 9.0, &reference(0)), Following::Kept);
    // A plant that is where it cannot be, and one that cannot be measured.
    let saved = *follower.state();
    for (i, off) in [(0, 1.0), (3, f64::NAN)] {
        let mut x = reference(1);
        x[i] += off;
        assert_eq!(step(&mut follower, 9.0 + table.begin(1), &x), Following::OutOfTube);
        assert!(follower.restore(saved));
    }
    assert_eq!(step(&mut follower, 9.0 + table.begin(1), &reference(1)), Following::Kept);
    let flawed = FollowerState { hold: 100_000, ..saved };
    assert!(!follower.restore(flawed));
}

#[test]
fn what_a_table_has_not_is_refused() {
    let case = empty();
    for (declared, field) in [
        (Declared { delay: PERIOD, ..Declared::nothing() }, "actuation_delay"),
        (Declared { jitter: 0.5, ..Declared::nothing() }, "jitter"),
    ] {
        let filter = case.filter(Unicycle, Some(&declared));
        let error = filter.planning().unwrap().table(0.0, &case.x, &START, None).unwrap_err();
        assert_eq!(error.field(), field);
    }
    let mut filter = case.filter(Unicycle, None);
    // Plans decide themselves.
    assert_eq!(filter.observe(0.0, &case.x, &[0.0; 2]).unwrap_err().field(), "u");
    let error = filter.planning().unwrap().table(0.0, &case.x, &[-1.0, 0.0, 0.0, 0.0], None).unwrap_err();
    assert_eq!(error.field(), "start[1]");
    // Starts that no plan can serve.
    let refused = filter.planning().unwrap().table(0.0, &case.x, &[9.0, 9.0, 3.0, 1.0], None).unwrap();
    assert!(refused.is_err());
}
