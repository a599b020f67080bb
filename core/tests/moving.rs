//! Plans beside points that are measured: however they move within what was declared, what is promised is kept.
//!
//! The judge moves plant and points by itself, in closed form or by an integrator of its own, and looks between samples too.
//! More cases: `PUNCTUAL_MOVING=100 cargo test --release -p punctual-core --test all -- --nocapture moving::`.

#![allow(clippy::print_stdout, reason = "the figures are wanted")]

use punctual_core::barriers::{DistanceDisc, Outside, QuadraticDisc};
use punctual_core::dynamics::ControlAffine;
use punctual_core::filter::*;
use punctual_core::plants::{PointMass, Unicycle};

const PERIOD: f64 = 0.02;
/// Parts of a period at which a run is judged.
const PARTS: u32 = 4;

struct Draws(u64);

impl Draws {
    fn part(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.part()
    }

    /// A vector of length `size` in any direction.
    fn direction(&mut self, size: f64) -> [f64; 2] {
        let angle = self.within(0.0, core::f64::consts::TAU);
        [size * angle.cos(), size * angle.sin()]
    }
}

/// How a point moves, within its acceleration.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Moves {
    Steadily,
    /// In one direction for ever.
    Away,
    /// In a direction drawn anew now and then.
    Wandering,
    /// Towards the vehicle.
    Chasing,
    /// Towards where the vehicle will be a second later.
    Intercepting,
}

const MOVES: [Moves; 5] =
    [Moves::Steadily, Moves::Away, Moves::Wandering, Moves::Chasing, Moves::Intercepting];

#[derive(Clone, Copy, Debug, PartialEq)]
enum Asks {
    Hostile,
    Zero,
    Damping,
}

const ASKS: [Asks; 3] = [Asks::Hostile, Asks::Zero, Asks::Damping];

/// A vehicle, a goal that may follow a point, and points to keep away from.
#[derive(Clone, Debug)]
struct Case {
    x: [f64; 4],
    goal: Option<[f64; 2]>,
    leader: Option<[f64; 4]>,
    others: Vec<[f64; 4]>,
    motion: Motion,
    deadline: f64,
    delay: f64,
    /// Declared of the plant too: rates and errors, as large as given.
    uncertain: f64,
}

const RADIUS: f64 = 2.0;
const CLEARANCE: f64 = 1.2;
const BOUNDS: [f64; 2] = [4.0, 1.5];

impl Case {
    fn points(&self) -> Vec<[f64; 4]> {
        self.leader.iter().chain(&self.others).copied().collect()
    }

    fn rates(&self, is_point: bool) -> [f64; 4] {
        let size = self.uncertain;
        if is_point { [0.0, 0.0, 0.1 * size, 0.1 * size] } else { [0.0, 0.0, 0.02 * size, 0.1 * size] }
    }

    fn errors(&self) -> [f64; 4] {
        [0.02, 0.02, 0.01, 0.02].map(|error| error * self.uncertain)
    }

    fn filter<P>(&self, plant: P, is_point: bool) -> Filter
    where
        P: ControlAffine<4, 2> + Send + Sync + 'static,
    {
        let point = |radius: f64| DistanceDisc::new([0.0; 2], radius, 1.0).unwrap().following(4);
        let mut builder = Filter::builder(plant);
        let mut plans = Plans::every(PERIOD);
        if let Some(goal) = self.goal {
            let goal = DistanceDisc::new(goal, RADIUS, 1.0).unwrap();
            builder = builder.barrier("goal", goal, BarrierSettings::within(self.deadline)).unwrap();
        }
        let mut barrier = usize::from(self.goal.is_some());
        if self.leader.is_some() {
            let settings = BarrierSettings::within(self.deadline);
            builder = builder.following::<_, 8>("leader", point(RADIUS), settings).unwrap();
            plans = plans.motion(barrier, self.motion);
            barrier += 1;
        }
        for i in 0..self.others.len() {
            let settings = BarrierSettings::keeping();
            builder =
                builder.following::<_, 8>(&format!("other{i}"), Outside(point(CLEARANCE)), settings).unwrap();
            plans = plans.motion(barrier, self.motion);
            barrier += 1;
        }
        builder = builder.bounds(&BOUNDS.map(|b| -b), &BOUNDS).unwrap();
        builder = builder.sampling(Sampling::Period(PERIOD)).unwrap().actuation_delay(self.delay).unwrap();
        if self.uncertain > 0.0 {
            plans = plans.uncertain_rates(&self.rates(is_point)).measurement_errors(&self.errors());
        }
        builder.build().unwrap().with_plans(plans).unwrap()
    }

    /// h in m of every barrier.
    fn h(&self, x: &[f64; 4], points: &[[f64; 4]]) -> Vec<f64> {
        let apart = |c: &[f64]| (x[0] - c[0]).hypot(x[1] - c[1]);
        let goal = self.goal.iter().map(|goal| RADIUS - apart(goal));
        let (leader, others) = points.split_at(usize::from(self.leader.is_some()));
        let leader = leader.iter().map(|point| RADIUS - apart(point));
        goal.chain(leader).chain(others.iter().map(|point| apart(point) - CLEARANCE)).collect()
    }
}

#[derive(Debug, Default)]
struct Outcome {
    accepted: bool,
    least: f64,
    /// Samples without the promise after it was given, other than at its reported end.
    withdrawn: usize,
    expired: usize,
    failure: String,
}

/// A run of `time` s in which points accelerate `worse` times as much as declared.
fn run<P>(plant: &P, case: &Case, (moves, asks, time): (Moves, Asks, f64), worse: f64, seed: u64) -> Outcome
where
    P: ControlAffine<4, 2> + Clone + Send + Sync + 'static,
{
    let is_point = core::any::type_name::<P>().contains("PointMass");
    let (mut draws, mut filter) = (Draws(seed), case.filter(plant.clone(), is_point));
    let (mut x, mut points, mut acting) = (case.x, case.points(), [0.0; 2]);
    let Motion { acceleration, position_error, velocity_error, .. } = case.motion;
    let mut pushes: Vec<[f64; 2]> = points.iter().map(|_| draws.direction(acceleration)).collect();
    let mut outcome = Outcome { least: f64::INFINITY, ..Outcome::default() };
    let velocity =
        |x: &[f64; 4]| if is_point { [x[2], x[3]] } else { [x[3] * x[2].cos(), x[3] * x[2].sin()] };
    for step in 0..(time / PERIOD) as u32 {
        let t = f64::from(step) * PERIOD;
        for (push, point) in pushes.iter_mut().zip(&points) {
            let towards = |at: [f64; 2]| {
                let (dx, dy) = (at[0] - point[0], at[1] - point[1]);
                let far = dx.hypot(dy).max(1e-9);
                [acceleration * dx / far, acceleration * dy / far]
            };
            let v = velocity(&x);
            *push = match moves {
                Moves::Steadily => [0.0; 2],
                Moves::Away => *push,
                Moves::Wandering if draws.part() < 0.03 => draws.direction(acceleration),
                Moves::Wandering => *push,
                Moves::Chasing => towards([x[0], x[1]]),
                Moves::Intercepting => towards([x[0] + v[0] - point[2], x[1] + v[1] - point[3]]),
            };
        }
        let errors = case.errors();
        let mut measured: Vec<f64> = (0..4).map(|i| x[i] + errors[i] * draws.within(-1.0, 1.0)).collect();
        for point in &points {
            let off = [draws.direction(position_error), draws.direction(velocity_error)];
            measured.extend([0, 1].map(|i| point[i] + off[0][i]));
            measured.extend([0, 1].map(|i| point[2 + i] + off[1][i]));
        }
        let u_ref = match asks {
            Asks::Zero => [0.0; 2],
            Asks::Damping if is_point => [-x[2], -x[3]],
            Asks::Damping => [-x[3], 0.0],
            Asks::Hostile => [
                BOUNDS[0] * if draws.part() < 0.5 { 1.0 } else { -1.0 },
                BOUNDS[1] * if draws.part() < 0.9 { 1.0 } else { -1.0 },
            ],
        };
        let mut u = [0.0; 2];
        let report = filter.step(t, &measured, &u_ref, &mut u).unwrap();
        let assurance = report.assurance.unwrap();
        if step == 0 {
            outcome.accepted = assurance.is_assured();
        }
        if !assurance.is_assured() {
            if outcome.failure.is_empty() {
                let why = assurance.failure.map(|failure| failure.to_string()).unwrap_or_default();
                outcome.failure = format!("at {t:.2} s {:?}: {why}", assurance.status);
            }
            if !outcome.accepted {
                return outcome;
            }
            match assurance.status {
                AssuranceStatus::Expired => outcome.expired += 1,
                _ => outcome.withdrawn += 1,
            }
        }
        let guaranteed: Vec<bool> = report.barriers.iter().map(|b| b.guaranteed).collect();
        let before = core::mem::replace(&mut acting, u);
        let side: [f64; 4] = core::array::from_fn(|_| draws.within(-1.0, 1.0).signum());
        let rates = case.rates(is_point);
        for part in 0..PARTS {
            let h = PERIOD / f64::from(PARTS);
            let u = if (f64::from(part) + 0.5) * h < case.delay { &before } else { &u };
            let rate = |x: &[f64; 4]| {
                let rate = plant.derivative(x, u);
                core::array::from_fn::<f64, 4, _>(|i| rate[i] + rates[i] * side[i])
            };
            // Kutta's rule of third order.
            let moved = |by: [(f64, &[f64; 4]); 2]| {
                core::array::from_fn::<f64, 4, _>(|i| {
                    x[i] + h * by.iter().map(|(b, k)| b * k[i]).sum::<f64>()
                })
            };
            let k1 = rate(&x);
            let k2 = rate(&moved([(0.5, &k1), (0.0, &k1)]));
            let k3 = rate(&moved([(-1.0, &k1), (2.0, &k2)]));
            x = core::array::from_fn(|i| x[i] + h / 6.0 * (k1[i] + 4.0 * k2[i] + k3[i]));
            for (point, push) in points.iter_mut().zip(&pushes) {
                for i in 0..2 {
                    let a = worse * push[i];
                    point[i] += h * point[2 + i] + 0.5 * h * h * a;
                    point[2 + i] += h * a;
                }
            }
            let now = t + h * f64::from(part + 1);
            let goals = usize::from(case.goal.is_some()) + usize::from(case.leader.is_some());
            for (j, (h, guaranteed)) in case.h(&x, &points).into_iter().zip(&guaranteed).enumerate() {
                if *guaranteed && (j >= goals || now >= case.deadline) {
                    outcome.least = outcome.least.min(h);
                }
            }
        }
    }
    outcome
}

#[derive(Debug, Default)]
struct Tally {
    cases: usize,
    accepted: usize,
    broken: usize,
    withdrawn: usize,
    expired: usize,
    least: f64,
}

fn tally<P>(name: &str, plant: &P, time: f64, seed: u64, draw: impl Fn(&mut Draws) -> Case) -> Tally
where
    P: ControlAffine<4, 2> + Clone + Send + Sync + 'static,
{
    let cases = std::env::var("PUNCTUAL_MOVING").map_or(3, |cases| cases.parse().unwrap());
    let (mut draws, mut tally) = (Draws(seed), Tally { least: f64::INFINITY, ..Tally::default() });
    for k in 0..cases {
        let case = draw(&mut draws);
        tally.cases += 1;
        let how = (MOVES[k % 5], ASKS[(k / 5 + k) % 3], time);
        let outcome = run(plant, &case, how, 1.0, k as u64);
        if !outcome.accepted {
            println!("{name} {k}: {}", outcome.failure);
            continue;
        }
        tally.accepted += 1;
        tally.least = tally.least.min(outcome.least);
        tally.broken += usize::from(outcome.least < 0.0);
        tally.withdrawn += usize::from(outcome.withdrawn > 0);
        tally.expired += usize::from(outcome.expired > 0);
        if outcome.least < 0.0 || outcome.withdrawn > 0 || outcome.expired > 0 {
            println!("{name} {k}, {how:?}: {outcome:?}");
        }
    }
    println!("{name}: {tally:?}");
    tally
}

/// A goal up to 20 m away, and two others that cross the way.
fn crossing(draws: &mut Draws, motion: Motion) -> Case {
    let (far, angle) = (draws.within(6.0, 14.0), draws.within(-0.5, 0.5));
    let goal = [far * angle.cos(), far * angle.sin()];
    let others = (0..2)
        .map(|side| {
            let (part, away) = (draws.within(0.3, 0.9), draws.within(6.0, 14.0));
            let sign = if side == 0 { 1.0 } else { -1.0 };
            let speed = draws.within(0.0, 1.5);
            let at = [part * goal[0], part * goal[1] + sign * away];
            [at[0], at[1], draws.within(-0.3, 0.3), -sign * speed]
        })
        .collect();
    let x = [0.0, 0.0, draws.within(-0.4, 0.4), draws.within(0.0, 2.0)];
    Case { x, goal: Some(goal), leader: None, others, motion, deadline: 5.0, delay: 0.0, uncertain: 0.0 }
}

fn as_point(mut case: Case) -> Case {
    case.x = [0.0, 0.0, case.x[3], case.x[2]];
    case
}

const GENTLE: Motion = Motion { acceleration: 0.15, position_error: 0.0, velocity_error: 0.0 };

fn is_kept(tally: &Tally) {
    assert_eq!((tally.broken, tally.withdrawn), (0, 0), "{tally:?}");
    assert!(tally.accepted > 0, "{tally:?}");
}

/// A leader that drives on, whose disc is to be joined.
fn joining(draws: &mut Draws, motion: Motion) -> Case {
    let (at, speed, heading) = (draws.direction(8.0), draws.within(0.5, 2.0), draws.within(-0.6, 0.6));
    let leader = [at[0].abs(), at[1], speed * heading.cos(), speed * heading.sin()];
    let x = [0.0, 0.0, draws.within(-0.4, 0.4), draws.within(0.0, 2.0)];
    let others = Vec::new();
    Case { x, goal: None, leader: Some(leader), others, motion, deadline: 6.0, delay: 0.0, uncertain: 0.0 }
}

/// Others all around, and nowhere to go: u_ref drives straight on.
fn among(draws: &mut Draws, motion: Motion) -> Case {
    let others = (0..3)
        .map(|_| {
            let ([x, y], [v_x, v_y]) = (draws.direction(1.0), draws.direction(1.0));
            let (far, speed) = (draws.within(5.0, 10.0), draws.within(0.0, 1.2));
            [far * x, far * y, speed * v_x, speed * v_y]
        })
        .collect();
    let x = [0.0, 0.0, draws.within(-0.4, 0.4), draws.within(0.0, 2.0)];
    Case { x, goal: None, leader: None, others, motion, deadline: 0.0, delay: 0.0, uncertain: 0.0 }
}

#[test]
fn a_vehicle_among_others_stays_clear_for_as_long_as_it_says() {
    is_kept(&tally("unicycle", &Unicycle, 8.0, 10, |draws| among(draws, GENTLE)));
    is_kept(&tally("point mass", &PointMass, 8.0, 11, |draws| as_point(among(draws, GENTLE))));
}

#[test]
fn others_that_accelerate_are_kept_clear_of() {
    is_kept(&tally("unicycle", &Unicycle, 9.0, 1, |draws| crossing(draws, GENTLE)));
    is_kept(&tally("point mass", &PointMass, 9.0, 2, |draws| as_point(crossing(draws, GENTLE))));
}

#[test]
fn a_leader_that_accelerates_is_joined() {
    // More would be more than the radius of its disc at the end of a plan.
    let motion = Motion { acceleration: 0.02, ..Motion::default() };
    is_kept(&tally("unicycle", &Unicycle, 9.0, 3, |draws| joining(draws, motion)));
    is_kept(&tally("point mass", &PointMass, 9.0, 4, |draws| as_point(joining(draws, motion))));
}

#[test]
fn points_that_are_measured_with_errors_cost_no_promise() {
    let motion = Motion { position_error: 0.05, velocity_error: 0.05, ..GENTLE };
    is_kept(&tally("unicycle", &Unicycle, 9.0, 5, |draws| crossing(draws, motion)));
    let motion = Motion { acceleration: 0.01, position_error: 0.05, velocity_error: 0.02 };
    is_kept(&tally("joining", &PointMass, 9.0, 6, |draws| as_point(joining(draws, motion))));
}

/// Everything at once: rates and errors of the plant, a step of delay, and what is not known of the points.
#[test]
fn an_uncertain_plant_keeps_clear_of_points_too() {
    let motion = Motion { position_error: 0.03, ..GENTLE };
    let draw = |draws: &mut Draws| Case { uncertain: 1.0, delay: PERIOD, ..crossing(draws, motion) };
    is_kept(&tally("unicycle", &Unicycle, 9.0, 7, draw));
    is_kept(&tally("point mass", &PointMass, 9.0, 8, |draws| as_point(draw(draws))));
}

/// A point that goes elsewhere than it was declared to: the flag falls, and what is reported as kept is kept.
#[test]
fn a_point_that_accelerates_more_is_noticed() {
    let (mut draws, mut noticed) = (Draws(9), 0);
    for seed in 0..6 {
        let case = crossing(&mut draws, Motion { acceleration: 0.1, ..Motion::default() });
        let outcome = run(&Unicycle, &case, (Moves::Intercepting, Asks::Zero, 7.0), 12.0, seed);
        if outcome.accepted {
            assert!(outcome.failure.contains("its declared acceleration and errors allow"), "{outcome:?}");
            // What a step does at 1.2 m/s² beyond what is declared: a(0.02 s)²/2.
            assert!(outcome.least > -3e-4, "{outcome:?}");
            noticed += 1;
        }
    }
    assert!(noticed > 1, "{noticed}");
}

#[test]
fn what_plans_do_not_know_of_a_point_is_refused() {
    let at = |disc: DistanceDisc| Outside(disc.following(4));
    let disc = DistanceDisc::new([0.0; 2], 1.0, 1.0).unwrap();
    let builder = |barrier| {
        let settings = BarrierSettings::keeping();
        let builder = Filter::builder(Unicycle).following::<_, 8>("other", barrier, settings).unwrap();
        builder.bounds(&[-4.0, -1.5], &[4.0, 1.5]).unwrap().build().unwrap()
    };
    let message = |filter: Filter, plans: Plans| filter.with_plans(plans).err().unwrap().to_string();
    let plans = || Plans::every(PERIOD);
    assert_eq!(
        message(builder(at(disc)), plans()),
        "other.motion: is not declared: how the point moves that it follows"
    );
    assert_eq!(
        message(builder(at(disc)), plans().motion(0, GENTLE).motion(1, GENTLE)),
        "motion: is of barrier 1, which follows no point"
    );
    let negative = Motion { acceleration: -1.0, ..GENTLE };
    assert_eq!(
        message(builder(at(disc)), plans().motion(0, negative)),
        "motion[1].acceleration: is -1, must be finite and >= 0"
    );
    let settings = BarrierSettings::keeping();
    let quadratic = QuadraticDisc::new([0.0; 2], 1.0).unwrap().following(4);
    let filter = Filter::builder(Unicycle).following::<_, 8>("other", Outside(quadratic), settings);
    let filter = filter.unwrap().bounds(&[-4.0, -1.5], &[4.0, 1.5]).unwrap().build().unwrap();
    assert_eq!(
        message(filter, plans().motion(0, GENTLE)),
        "other.motion: needs a set whose h changes by a bounded amount per m"
    );
}
