//! Plans for uncertain plants: what is promised is kept by every plant within what was declared.
//!
//! The plant is run by an integrator of its own, with disturbances, errors and gains at their limits, chosen at random or
//! against the promise. Every promise is judged at many instants between samples.

use punctual_core::barriers::{DistanceDisc, Outside};
use punctual_core::dynamics::ControlAffine;
use punctual_core::filter::*;
use punctual_core::plants::{Bicycle, PointMass, Unicycle};

/// Draws from 0 to 1.
struct Draws(u64);

impl Draws {
    fn part(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.part()
    }

    /// −1 or 1.
    fn sign(&mut self) -> f64 {
        if self.part() < 0.5 { -1.0 } else { 1.0 }
    }
}

/// Who chooses disturbances, errors and gains.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Adversary {
    /// Anything, at every sample.
    Random,
    /// A corner, changed now and then.
    Corners,
    /// One corner for ever.
    Constant,
}

/// What u_ref asks for.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Asks {
    Zero,
    Damping,
    Hostile,
}

#[derive(Clone, Debug)]
struct Declared {
    rates: Vec<f64>,
    errors: Vec<f64>,
    gains: Vec<[f64; 2]>,
}

#[derive(Clone, Debug)]
struct Case {
    x: Vec<f64>,
    goal: [f64; 2],
    rocks: Vec<([f64; 2], f64)>,
    bounds: [f64; 2],
}

const PERIOD: f64 = 0.02;
const RADIUS: f64 = 2.0;
const DEADLINE: f64 = 8.0;

impl Case {
    /// A goal up to 25 m away past two rocks.
    fn draw(draws: &mut Draws, name: &str) -> Self {
        let is_point = name == "point mass";
        let (distance, angle) = (draws.within(10.0, 25.0), draws.within(-0.8, 0.8));
        let goal = [distance * angle.cos(), distance * angle.sin()];
        let mut rocks = Vec::new();
        for _ in 0..2 {
            let (part, aside) = (draws.within(0.3, 0.75), draws.within(-3.0, 3.0));
            let radius = draws.within(0.8, 1.8);
            let at = [part * goal[0] - aside * angle.sin(), part * goal[1] + aside * angle.cos()];
            let apart = |c: [f64; 2], least: f64| (at[0] - c[0]).hypot(at[1] - c[1]) > least;
            if apart([0.0, 0.0], radius + 2.5) && apart(goal, radius + 3.0) {
                rocks.push((at, radius));
            }
        }
        let speed = draws.within(0.0, 2.0);
        let x = if is_point {
            vec![0.0, 0.0, speed, draws.within(-1.0, 1.0)]
        } else {
            vec![0.0, 0.0, draws.within(-0.5, 0.5), speed]
        };
        Self {
            x,
            goal,
            rocks,
            bounds: [
                4.0,
                if is_point {
                    4.0
                } else if name == "bicycle" {
                    0.6
                } else {
                    1.5
                },
            ],
        }
    }

    fn filter<P>(&self, plant: P, declared: Option<&Declared>) -> Filter
    where
        P: ControlAffine<4, 2> + Send + Sync + 'static,
    {
        let mut builder = Filter::builder(plant)
            .barrier(
                "goal",
                DistanceDisc::new(self.goal, RADIUS, 1.0).unwrap(),
                BarrierSettings::within(DEADLINE),
            )
            .unwrap();
        for (i, (at, radius)) in self.rocks.iter().enumerate() {
            let rock = Outside(DistanceDisc::new(*at, *radius, 1.0).unwrap());
            builder = builder.barrier(&format!("rock{i}"), rock, BarrierSettings::keeping()).unwrap();
        }
        let low = self.bounds.map(|b| -b);
        let mut builder =
            builder.bounds(&low, &self.bounds).unwrap().sampling(Sampling::Period(PERIOD)).unwrap();
        let mut plans = Plans::every(PERIOD);
        if let Some(declared) = declared {
            if declared.errors.iter().any(|e| *e > 0.0) {
                builder = builder.measurement_errors(&declared.errors).unwrap();
            }
            plans = plans.uncertain_rates(&declared.rates).uncertain_gains(&declared.gains);
        }
        builder.build().unwrap().with_plans(plans).unwrap()
    }

    fn h(&self, x: &[f64]) -> Vec<f64> {
        let apart = |c: [f64; 2]| (x[0] - c[0]).hypot(x[1] - c[1]);
        core::iter::once(RADIUS - apart(self.goal))
            .chain(self.rocks.iter().map(|(c, r)| apart(*c) - r))
            .collect()
    }
}

/// What happened in a run.
#[derive(Debug, Default)]
struct Outcome {
    accepted: bool,
    /// The least h while it was promised, over all barriers.
    least: f64,
    /// Samples without the flag after acceptance, and with which status.
    withdrawn: usize,
    reference: usize,
    steps: usize,
    micros: f64,
    first_millis: f64,
    off: f64,
    failure: String,
}

fn run<P>(
    plant: P,
    case: &Case,
    declared: &Declared,
    adversary: Adversary,
    asks: Asks,
    seed: u64,
    time: f64,
) -> Outcome
where
    P: ControlAffine<4, 2> + Clone + Send + Sync + 'static,
{
    let mut draws = Draws(seed);
    let mut filter = case.filter(plant.clone(), Some(declared));
    let (mut x, mut t) = (case.x.clone(), 0.0);
    let mut corner: Vec<f64> = (0..16).map(|_| draws.sign()).collect();
    let mut outcome = Outcome { least: f64::INFINITY, ..Outcome::default() };
    let substeps = 4;
    while t < time - 1e-9 {
        match adversary {
            Adversary::Random => corner.iter_mut().for_each(|c| *c = draws.within(-1.0, 1.0)),
            Adversary::Corners if draws.part() < 0.05 => corner.iter_mut().for_each(|c| *c = draws.sign()),
            _ => {}
        }
        let measured: Vec<f64> = (0..4).map(|i| x[i] + declared.errors[i] * corner[i]).collect();
        let u_ref = match asks {
            Asks::Zero => [0.0; 2],
            Asks::Damping => [
                -measured[if case.bounds[1] == 4.0 { 2 } else { 3 }],
                if case.bounds[1] == 4.0 { -measured[3] } else { 0.0 },
            ],
            Asks::Hostile => {
                [case.bounds[0] * draws.sign(), case.bounds[1] * if draws.part() < 0.9 { 1.0 } else { -1.0 }]
            }
        };
        let mut u = [0.0; 2];
        let begun = std::time::Instant::now();
        let report = filter.step(t, &measured, &u_ref, &mut u).unwrap();
        let micros = begun.elapsed().as_secs_f64() * 1e6;
        let assurance = report.assurance.unwrap();
        if t == 0.0 {
            outcome.first_millis = micros / 1e3;
            outcome.accepted = assurance.is_assured();
            if !outcome.accepted {
                outcome.failure = assurance.failure.map(|f| f.to_string()).unwrap_or_default();
                return outcome;
            }
        } else {
            outcome.micros += micros;
        }
        outcome.steps += 1;
        outcome.withdrawn += usize::from(!assurance.is_assured());
        if !assurance.is_assured() && outcome.failure.is_empty() {
            outcome.failure = format!(
                "{t:.2} {:?} {}",
                assurance.status,
                assurance.failure.map(|f| f.to_string()).unwrap_or_default()
            );
        }
        outcome.reference += usize::from(matches!(assurance.driver, Driver::Reference | Driver::Eased));
        let guaranteed: Vec<bool> = report.barriers.iter().map(|b| b.guaranteed).collect();
        let gains: Vec<f64> = (0..2)
            .map(|i| {
                let [low, high] = declared.gains[i];
                0.5 * (low + high) + 0.5 * (high - low) * corner[8 + i]
            })
            .collect();
        let applied = [u[0] * gains[0], u[1] * gains[1]];
        let rate = |x: &[f64; 4]| {
            let mut rate = plant.derivative(x, &applied);
            for i in 0..4 {
                rate[i] += declared.rates[i] * corner[4 + i];
            }
            rate
        };
        for k in 0..substeps {
            let h = PERIOD / substeps as f64;
            let at: [f64; 4] = core::array::from_fn(|i| x[i]);
            let moved = |k: &[f64; 4], by: f64| core::array::from_fn::<f64, 4, _>(|i| at[i] + by * k[i]);
            let k1 = rate(&at);
            let k2 = rate(&moved(&k1, h / 2.0));
            let k3 = rate(&moved(&k2, h / 2.0));
            let k4 = rate(&moved(&k3, h));
            for i in 0..4 {
                x[i] = at[i] + h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]);
            }
            let now = t + h * f64::from(k + 1);
            for (j, (h, guaranteed)) in case.h(&x).into_iter().zip(&guaranteed).enumerate() {
                if *guaranteed && (j > 0 || now >= DEADLINE) {
                    outcome.least = outcome.least.min(h);
                }
            }
        }
        t += PERIOD;
    }
    outcome
}

fn declared(is_bicycle: bool, is_point: bool, scale: f64) -> Declared {
    let _ = is_bicycle;
    let rates = if is_point { vec![0.0, 0.0, 0.1, 0.1] } else { vec![0.0, 0.0, 0.02, 0.1] };
    let errors = if is_point { vec![0.02; 4] } else { vec![0.02, 0.02, 0.01, 0.02] };
    let gains = vec![[1.0 - 0.05 * scale, 1.0 + 0.05 * scale]; 2];
    Declared {
        rates: rates.into_iter().map(|r| r * scale).collect(),
        errors: errors.into_iter().map(|r| r * scale).collect(),
        gains,
    }
}

fn accepted<P>(name: &str, plant: P, is_point: bool, cases: usize)
where
    P: ControlAffine<4, 2> + Clone + Send + Sync + 'static,
{
    let mut draws = Draws(7);
    let (mut nominal, mut robust, mut time) = (0, 0, 0.0);
    for k in 0..cases {
        let case = Case::draw(&mut draws, name);
        let mut u = [0.0; 2];
        let assured = case
            .filter(plant.clone(), None)
            .step(0.0, &case.x, &[0.0; 2], &mut u)
            .unwrap()
            .assurance
            .unwrap()
            .is_assured();
        if !assured {
            continue;
        }
        nominal += 1;
        let declared = declared(name == "bicycle", is_point, 1.0);
        let outcome = run(
            plant.clone(),
            &case,
            &declared,
            Adversary::Corners,
            Asks::Hostile,
            k as u64,
            std::env::var("T").map_or(0.01, |t| t.parse().unwrap()),
        );
        robust += usize::from(outcome.accepted);
        time += outcome.first_millis;
        if !outcome.accepted || outcome.steps > 1 {
            println!("{name} {k}: {outcome:?} {:.1} {:?}", case.goal[0].hypot(case.goal[1]), case.rocks);
        }
    }
    println!("{name}: nominal {nominal}, robust {robust}, first {:.0} ms", time / nominal as f64);
}

#[test]
#[ignore]
fn experiment() {
    let cases = std::env::var("CASES").map_or(10, |c| c.parse().unwrap());
    accepted("point mass", PointMass, true, cases);
    accepted("unicycle", Unicycle, false, cases);
    accepted("bicycle", Bicycle::new(2.5).unwrap(), false, cases);
}
