//! How tight a tube is, and whether defects that are planted in it are found.
//!
//! The worst run that is found is compared with the tube. For a plan with its law, a direction and a time, all that is unknown
//! is at its limits, with the signs of the adjoint along the run before; these are improved by reversing some. The integrator
//! is one of its own. For a linear plant the worst run is known exactly, and a tube that is too small by a fiftieth is found
//! for certain. More cases, and tables:
//! `PUNCTUAL_TIGHT=20 PUNCTUAL_TABLES=1 cargo test --release -p punctual-core --lib tight -- --nocapture`.

#[path = "../../../../tests/uncertain/mod.rs"]
mod uncertain;

use super::super::faults::{self, Fault};
use super::source;
use crate::MAX_INPUTS;
use crate::barriers::{DistanceDisc, Outside, StateBound};
use crate::dynamics::ControlAffine;
use crate::interval::Interval;
use crate::lie::{self, DerivativeSource, EXPANSION_ORDERS, Predict};
use crate::plan::check::{Grid, TOLERANCES, Walk};
use crate::plan::expansion;
use crate::plan::model::Model;
use crate::plan::settings::SETTINGS;
use crate::plan::tube::{Piece, Tracking, Tube, Uncertainty, zonotope};
use crate::plan::{Failure, Requirement};
use crate::plants::{Bicycle, PointMass, Unicycle};
use crate::qp::Bounds;
use alloc::boxed::Box;
use alloc::format;
use alloc::string::String;
use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;
use uncertain::{ASKS, Adversary, Case, Declared, Draws, PERIOD, Run, run, show};

const FAULTS: [Fault; 6] =
    [Fault::Small, Fault::Samples, Fault::Error, Fault::Gain, Fault::Noise, Fault::Remainder];

/// Parts of a hold in which disturbances and gains are constant.
const SLICES: usize = 4;
/// Passes of the adjoint.
const PASSES: u32 = 5;
/// The error of the judge's own integration.
const INTEGRATED: f64 = 1e-8;

/// How many cases, and how many reversals are tried for each direction and time.
fn effort() -> (usize, u32) {
    std::env::var("PUNCTUAL_TIGHT").map_or((1, 0), |cases| (cases.parse().expect("a number"), 200))
}

/// The side of its limits, −1 to 1, on which all that is unknown in a hold is.
#[derive(Clone, Copy)]
struct Signs {
    /// Of the measurement; for the first hold, which is not measured anew, of the start.
    errors: [f64; 4],
    rates: [[f64; 4]; SLICES],
    gains: [[f64; 2]; SLICES],
}

const NONE: Signs = Signs { errors: [0.0; 4], rates: [[0.0; 4]; SLICES], gains: [[0.0; 2]; SLICES] };

/// What a run passes: the states at every slice, and the inputs of every hold.
struct Passed {
    states: Vec<[f64; 4]>,
    inputs: Vec<[f64; 2]>,
}

/// A plant under the law of a plan.
struct Followed<'a, P> {
    plant: &'a P,
    declared: &'a Declared,
    law: &'a Tracking,
}

impl<P: ControlAffine<4, 2>> Followed<'_, P> {
    fn slice(&self, k: usize) -> f64 {
        (self.law.times[k + 1] - self.law.times[k]) / SLICES as f64
    }

    /// Moves `x` by `h` s; by the rule of Runge and Kutta.
    fn moved(&self, x: &[f64; 4], u: &[f64; 2], (rates, gains): (&[f64; 4], &[f64; 2]), h: f64) -> [f64; 4] {
        let arrives: [f64; 2] = core::array::from_fn(|i| {
            let [low, high] = self.declared.gains[i];
            u[i] * (0.5 * (low + high) + 0.5 * (high - low) * gains[i])
        });
        let rate = |x: &[f64; 4]| {
            let rate = self.plant.derivative(x, &arrives);
            core::array::from_fn::<f64, 4, _>(|i| rate[i] + self.declared.rates[i] * rates[i])
        };
        let along = |by: f64, k: &[f64; 4]| core::array::from_fn::<f64, 4, _>(|i| x[i] + by * k[i]);
        let k1 = rate(x);
        let k2 = rate(&along(0.5 * h, &k1));
        let k3 = rate(&along(0.5 * h, &k2));
        let k4 = rate(&along(h, &k3));
        core::array::from_fn(|i| x[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]))
    }

    fn run(&self, signs: &[Signs]) -> Passed {
        let Tracking { inputs, states, gains, .. } = self.law;
        let mut x: [f64; 4] =
            core::array::from_fn(|i| states[0][i] + self.declared.errors[i] * signs[0].errors[i]);
        let mut passed = Passed { states: vec![x], inputs: Vec::new() };
        for (k, signs) in signs.iter().enumerate() {
            let mut u = [inputs[k][0], inputs[k][1]];
            for (u, row) in u.iter_mut().zip(gains[k].chunks_exact(4)) {
                *u += (0..4)
                    .map(|j| row[j] * (x[j] + self.declared.errors[j] * signs.errors[j] - states[k][j]))
                    .sum::<f64>();
            }
            passed.inputs.push(u);
            for s in 0..SLICES {
                x = self.moved(&x, &u, (&signs.rates[s], &signs.gains[s]), self.slice(k));
                passed.states.push(x);
            }
        }
        passed
    }

    /// The signs that lead farthest in `direction` at the end of `passed`, to first order.
    fn adjoint(&self, passed: &Passed, signs: &[Signs], direction: [f64; 4]) -> Vec<Signs> {
        const STEP: f64 = 1e-6;
        let (mut along, mut found) = (direction, signs.to_vec());
        for k in (0..signs.len()).rev() {
            let (u, h, mut by_input) = (passed.inputs[k], self.slice(k), [0.0; 2]);
            for s in (0..SLICES).rev() {
                let (x, Signs { rates, gains, .. }) = (passed.states[k * SLICES + s], &signs[k]);
                let base = self.moved(&x, &u, (&rates[s], &gains[s]), h);
                let slope = |end: [f64; 4]| (0..4).map(|i| along[i] * (end[i] - base[i]) / STEP).sum::<f64>();
                let aside = |of: &[f64; 4], i: usize| {
                    core::array::from_fn::<f64, 4, _>(|j| of[j] + if i == j { STEP } else { 0.0 })
                };
                for i in 0..4 {
                    found[k].rates[s][i] =
                        slope(self.moved(&x, &u, (&aside(&rates[s], i), &gains[s]), h)).signum();
                }
                for i in 0..2 {
                    let more = core::array::from_fn(|j| u[j] + if i == j { STEP } else { 0.0 });
                    let by = slope(self.moved(&x, &more, (&rates[s], &gains[s]), h));
                    by_input[i] += by;
                    found[k].gains[s][i] = (by * u[i]).signum();
                }
                along =
                    core::array::from_fn(|i| slope(self.moved(&aside(&x, i), &u, (&rates[s], &gains[s]), h)));
            }
            for (row, by) in self.law.gains[k].chunks_exact(4).zip(by_input) {
                (0..4).for_each(|j| along[j] += by * row[j]);
            }
            found[k].errors = match self.law.gains[k].is_empty() {
                true => along.map(f64::signum),
                false => core::array::from_fn(|j| {
                    let rows = self.law.gains[k].chunks_exact(4).zip(by_input);
                    rows.map(|(row, by)| by * row[j]).sum::<f64>().signum()
                }),
            };
        }
        found
    }

    /// How far in `direction` the worst run that is found is from the reference after `holds`.
    fn worst(&self, holds: usize, direction: [f64; 4], draws: &mut Draws, tries: u32) -> (f64, Vec<Signs>) {
        let reached = |passed: &Passed| {
            let (x, z) = (passed.states[holds * SLICES], &self.law.states[holds]);
            (0..4).map(|i| direction[i] * (x[i] - z[i])).sum::<f64>()
        };
        let (mut signs, mut farthest) = (vec![NONE; holds], (f64::NEG_INFINITY, vec![NONE; holds]));
        for _ in 0..PASSES {
            let passed = self.run(&signs);
            if reached(&passed) > farthest.0 {
                farthest = (reached(&passed), signs.clone());
            }
            signs = self.adjoint(&passed, &signs, direction);
        }
        for _ in 0..tries {
            let mut signs = farthest.1.clone();
            let (from, length) = ((draws.part() * holds as f64) as usize, (draws.part() * 6.0) as usize + 1);
            let what = (draws.part() * 10.0) as usize;
            for signs in signs.iter_mut().skip(from).take(length) {
                match what {
                    i @ 0..4 => signs.errors[i] *= -1.0,
                    i @ 4..8 => signs.rates.iter_mut().for_each(|rates| rates[i - 4] *= -1.0),
                    i => signs.gains.iter_mut().for_each(|gains| gains[i - 8] *= -1.0),
                }
            }
            let passed = self.run(&signs);
            if reached(&passed) > farthest.0 {
                farthest = (reached(&passed), signs);
            }
        }
        farthest
    }
}

/// How far the tube along `law` reaches in each of these directions after so many holds, and the largest share of each input;
/// with a defect, if one is planted.
fn reaches<P>(
    plant: &P,
    declared: &Declared,
    law: &Tracking,
    asked: &[(usize, [f64; 4])],
    fault: Option<Fault>,
) -> (Vec<f64>, [f64; 2])
where
    P: ControlAffine<4, 2> + Clone + Send + Sync + 'static,
{
    let mut found = vec![0.0; asked.len()];
    let feedback = faults::with(fault, || {
        along(plant, declared, law, |k, set| {
            for (found, (_, direction)) in found.iter_mut().zip(asked).filter(|(_, (holds, _))| *holds == k) {
                *found = zonotope::dot(direction, &set.centre)
                    + faults::part() * set.half_width(direction, &mut Vec::new());
            }
        })
    });
    (found, feedback)
}

/// Looks at the tube along `law` before each of its holds. Returns the largest share of each input.
fn along<P>(
    plant: &P,
    declared: &Declared,
    law: &Tracking,
    mut look: impl FnMut(usize, &zonotope::Zonotope),
) -> [f64; 2]
where
    P: ControlAffine<4, 2> + Clone + Send + Sync + 'static,
{
    let own = source(plant.clone());
    let model = own.predict().expect("a model");
    let bounds = Bounds { min: [-1e9; MAX_INPUTS], max: [1e9; MAX_INPUTS] };
    let of = Uncertainty {
        rates: declared.rates.to_vec(),
        errors: declared.errors.to_vec(),
        gains: declared.gains.to_vec(),
        lags: declared.lags.to_vec(),
        ..Uncertainty::nothing([4, 2])
    };
    let tube = Tube::around(model, (&of, [0.0, PERIOD]), &bounds, [4, 2], &[]).expect("derivatives");
    let plant = Model {
        plant: model,
        dims: [4, 2],
        bounds: &bounds,
        integral: None,
        settings: &SETTINGS,
        step: PERIOD,
    };
    let grid = Grid { period: PERIOD, even: true };
    let mut walk = Walk::new(plant, &TOLERANCES, &[], 1.0, grid, (law.times[0], &law.states[0]))
        .and_then(|walk| walk.within(tube))
        .expect("no requirement");
    for k in 0..law.inputs.len() {
        look(k, &walk.tube().expect("a tube").set);
        let gain = Some(&law.gains[k][..]).filter(|gain| !gain.is_empty());
        walk.hold_in_tube(&law.inputs[k], gain, law.times[k + 1]).expect("within bounds");
    }
    let feedback = walk.tube().expect("a tube").lacks.feedback;
    [feedback[0], feedback[1]]
}

/// Ratios of the tube to the worst run that is found, and in how many cases each defect is found.
#[derive(Default)]
struct Tightness {
    cases: usize,
    /// Along positions, along all states, and of the inputs.
    positions: Vec<f64>,
    states: Vec<f64>,
    inputs: Vec<f64>,
    found: [usize; FAULTS.len()],
}

fn tightness<P>(plant: &P, bounds: [f64; 2], is_point: bool, seed: u64) -> Tightness
where
    P: ControlAffine<4, 2> + Clone + Send + Sync + 'static,
{
    let (cases, tries) = effort();
    let (mut draws, declared) = (Draws(seed), Declared::all(is_point));
    let mut found = Tightness::default();
    while found.cases < cases {
        let case = Case::draw(&mut draws, bounds, is_point);
        let filter = case.filter(plant.clone(), Some(&declared));
        let Ok(plan) = filter.planning().expect("plans").plan_from(0.0, &case.x, 1.0) else { continue };
        found.cases += 1;
        let law = plan.tracking().expect("a law");
        let last = law.inputs.len() - 1;
        let places = if tries > 0 { vec![last / 4, last / 2, 3 * last / 4, last] } else { vec![last / 2] };
        let slanted = core::f64::consts::FRAC_1_SQRT_2;
        let positions = [
            [1.0, 0.0, 0.0, 0.0],
            [0.0, 1.0, 0.0, 0.0],
            [slanted, slanted, 0.0, 0.0],
            [slanted, -slanted, 0.0, 0.0],
        ];
        let directions = || positions.into_iter().chain([[0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]]);
        let asked: Vec<(usize, [f64; 4])> =
            places.iter().flat_map(|k| directions().map(|direction| (*k, direction))).collect();
        let followed = Followed { plant, declared: &declared, law };
        let mut worst = |holds: usize, direction| followed.worst(holds, direction, &mut draws, tries).0;
        // The law's share of an input, of which the last error of measurement has a part.
        let mut shares = [0.0_f64; 2];
        for k in places.iter().copied().filter(|k| *k > 0) {
            for (share, row) in shares.iter_mut().zip(law.gains[k].chunks_exact(4)) {
                let row: [f64; 4] = core::array::from_fn(|j| row[j]);
                let at_sample: f64 =
                    row.iter().zip(declared.errors).map(|(gain, error)| gain.abs() * error).sum();
                *share = share.max(worst(k, row) + at_sample);
            }
        }
        let worst: Vec<f64> = asked.iter().map(|(holds, direction)| worst(*holds, *direction)).collect();
        let (reach, feedback) = reaches(plant, &declared, law, &asked, None);
        for (k, (reach, worst)) in reach.iter().zip(&worst).enumerate() {
            assert!(*worst <= reach + INTEGRATED, "{:?}: {worst} beyond {reach}", asked[k]);
            let of = if asked[k].1[2..] == [0.0; 2] { &mut found.positions } else { &mut found.states };
            of.push(reach / worst);
        }
        for (share, feedback) in shares.iter().zip(feedback) {
            assert!(*share <= feedback + INTEGRATED, "{share} beyond {feedback}");
            found.inputs.push(feedback / share);
        }
        for (fault, found) in FAULTS.iter().zip(&mut found.found) {
            let (reach, feedback) = reaches(plant, &declared, law, &asked, Some(*fault));
            let is_left = reach.iter().zip(&worst).any(|(reach, worst)| *worst > reach + INTEGRATED)
                || shares.iter().zip(feedback).any(|(share, feedback)| *share > feedback + INTEGRATED);
            *found += usize::from(is_left);
        }
    }
    found
}

/// The least, the median and the largest.
fn spread(of: &mut [f64]) -> String {
    of.sort_by(f64::total_cmp);
    format!("{:.2} / {:.2} / {:.2}", of[0], of[of.len() / 2], of[of.len() - 1])
}

/// The ratio that a tube may have to the worst run that is found, in the direction of a position: wanted of it at the median,
/// and largest anywhere.
const WANTED: f64 = 2.0;

/// A tube is not much larger than what the worst run that is found reaches, and no such run leaves it. Printed if
/// `PUNCTUAL_TABLES` is set.
#[test]
fn tubes_are_tight() {
    for (name, mut found) in [
        ("point mass", tightness(&PointMass, [4.0, 4.0], true, 31)),
        ("unicycle", tightness(&Unicycle, [4.0, 1.5], false, 32)),
        ("bicycle", tightness(&Bicycle::new(2.5).expect("a length"), [4.0, 0.6], false, 33)),
    ] {
        let (positions, states) = (spread(&mut found.positions), spread(&mut found.states));
        let inputs = spread(&mut found.inputs);
        show(&format!(
            "| {name} | {} | {positions} | {states} | {inputs} | {:?} of {FAULTS:?} |",
            found.cases, found.found
        ));
        let median = found.positions[found.positions.len() / 2];
        assert!(median <= WANTED, "{name}: {positions}");
    }
}

/// What is declared of a point mass for which the worst run is known: rates of all states, and errors. Rates are small, since
/// the check allows for half a hold of them between two samples, which a run cannot use.
const RATES: [f64; 4] = [0.001, 0.002, 0.01, 0.008];
const ERRORS: [f64; 4] = [0.02, 0.01, 0.03, 0.02];
/// Its law: gains of each axis by position and speed.
const GAINS: [[f64; 2]; 2] = [[-1.5, -2.0], [-0.8, -1.4]];

/// ∫ |a τ + b| dτ from 0 to h.
fn size_of_line(a: f64, b: f64, h: f64) -> f64 {
    let end = a * h + b;
    if b * end >= 0.0 { 0.5 * h * (b.abs() + end.abs()) } else { (b * b + end * end) / (2.0 * a.abs()) }
}

/// How far in `direction` errors and rates lead a point mass under its law in so many holds of `h` s, exactly: the
/// sum of what each does at the limit that helps.
fn farthest(direction: [f64; 4], holds: usize, h: f64) -> f64 {
    let (mut along, mut total) = (direction, 0.0);
    for _ in 0..holds {
        for axis in 0..2 {
            let (p, v) = (along[axis], along[axis + 2]);
            total += p.abs() * RATES[axis] * h + RATES[axis + 2] * size_of_line(p, v, h);
            let by_input = 0.5 * p * h * h + v * h;
            let [by_position, by_speed] = GAINS[axis].map(|gain| by_input * gain);
            total += by_position.abs() * ERRORS[axis] + by_speed.abs() * ERRORS[axis + 2];
            (along[axis], along[axis + 2]) = (p + by_position, v + h * p + by_speed);
        }
    }
    total + along.iter().zip(ERRORS).map(|(along, error)| along.abs() * error).sum::<f64>()
}

/// Of a point mass at rest under its law for so many holds: by how much each of the eight limits of a state falls, and the
/// share of each input; or what ends the check.
fn of_a_point_mass(holds: usize, h: f64, fault: Option<Fault>) -> ([f64; 8], [f64; 2]) {
    let limits: Vec<Box<dyn DerivativeSource>> = (0..8)
        .map(|k| {
            let limit = match k % 2 {
                0 => StateBound::at_most(k / 2, 1.0),
                _ => StateBound::at_least(k / 2, -1.0),
            };
            let limit = limit.expect("a limit");
            lie::along(Arc::new(PointMass), limit, if k < 4 { 2 } else { 1 }).expect("a source")
        })
        .collect();
    let models: Vec<&dyn Predict> = limits.iter().map(|limit| limit.predict().expect("a model")).collect();
    let requirements: Vec<Requirement<'_>> = models.iter().map(|model| always(*model)).collect();
    let (of, bounds) = (
        Uncertainty { rates: RATES.to_vec(), errors: ERRORS.to_vec(), ..Uncertainty::nothing([4, 2]) },
        Bounds { min: [-9.0; MAX_INPUTS], max: [9.0; MAX_INPUTS] },
    );
    let [[kp, kv], [lp, lv]] = GAINS;
    let gain = [kp, 0.0, kv, 0.0, 0.0, lp, 0.0, lv];
    faults::with(fault, || {
        let mut tube =
            Tube::around(models[0], (&of, [0.0, h]), &bounds, [4, 2], &requirements).expect("derivatives");
        let (mut path, mut falls) = (vec![[0.0; EXPANSION_ORDERS]; 4], [0.0; 8]);
        for k in 0..holds {
            tube.hold(&[0.0; 2], &[0.0; 4], Some(&gain)).expect("within bounds");
            models[0].path(&[0.0; 4], &[0.0; 2], &mut path);
            let over: Vec<_> = path.iter().map(|c| expansion::over(c, h)).collect();
            let piece = Piece { path: &path, over: &over, dt: h, u: &[0.0; 2] };
            tube.advance(models[0], piece, |_| 0.0).expect("a bound");
            if k + 1 == holds {
                falls =
                    core::array::from_fn(|i| tube.fall((i, &requirements[i]), Interval::from(0.0), &over)[0]);
            }
        }
        (falls, [tube.lacks.feedback[0], tube.lacks.feedback[1]])
    })
}

fn always(model: &dyn Predict) -> Requirement<'_> {
    let (from, until) = (0.0, f64::INFINITY);
    Requirement { barrier: 0, is_limit: false, model, from, until, margin: 0.0, firm: 0.0, reserve: 0.0 }
}

/// How much larger than the worst run a tube may be for a linear plant, as long as none of its generators is boxed: half as
/// much more as a planted defect takes away.
const SHARP: f64 = 1.01;
/// The number of holds in which a point mass has as many generators as a tube keeps.
const UNBOXED: usize = 11;

/// For a linear plant the worst run is known, and the check is sharp. So a tube that is too small by a fiftieth is too small
/// for that run, in every requirement and in every bound; and so is one that ignores an error or the answer to it.
#[test]
fn a_tube_that_is_too_small_by_a_fiftieth_is_found() {
    for h in [0.02, 0.05] {
        let holds = UNBOXED;
        let known: [f64; 8] = core::array::from_fn(|i| {
            let mut direction = [0.0; 4];
            direction[i / 2] = 1.0;
            farthest(direction, holds, h)
        });
        // Of the last measurement too; the first hold counts as the others do.
        let shares: [f64; 2] = core::array::from_fn(|axis| {
            let [p, v] = GAINS[axis];
            let mut direction = [0.0; 4];
            (direction[axis], direction[axis + 2]) = (p, v);
            let at_sample = p.abs() * ERRORS[axis] + v.abs() * ERRORS[axis + 2];
            (0..holds).map(|k| farthest(direction, k, h) + at_sample).fold(0.0, f64::max)
        });
        let (falls, feedback) = of_a_point_mass(holds, h, None);
        let are_sharp = |found: &[f64], known: &[f64]| {
            found.iter().zip(known).all(|(found, known)| (1.0..SHARP).contains(&(found / known)))
        };
        assert!(are_sharp(&falls, &known), "{h}: {falls:?} {known:?}");
        assert!(are_sharp(&feedback, &shares), "{h}: {feedback:?} {shares:?}");
        let (falls, feedback) = of_a_point_mass(holds, h, Some(Fault::Small));
        assert!(falls.iter().zip(&known).all(|(found, known)| found < known), "{h}: {falls:?} {known:?}");
        assert!(feedback.iter().zip(&shares).all(|(found, known)| found < known), "{h}: {feedback:?}");
        for fault in [Fault::Error, Fault::Noise] {
            let (falls, _) = of_a_point_mass(holds, h, Some(fault));
            assert!(falls.iter().zip(&known).any(|(found, known)| found < known), "{h} {fault:?}: {falls:?}");
        }
        // How much boxes add, in the long run.
        for holds in [50, 250] {
            let ratios: Vec<f64> = (0..4)
                .map(|i| {
                    let mut direction = [0.0; 4];
                    direction[i] = 1.0;
                    of_a_point_mass(holds, h, None).0[2 * i] / farthest(direction, holds, h)
                })
                .collect();
            show(&format!("point mass, {holds} holds of {h} s: {ratios:.4?} times what is possible"));
        }
    }
}

/// How far the tube of a plant reaches in each state, either side of its reference, after so many holds of `h` s without
/// feedback.
fn open_loop<P>(
    plant: P,
    of: &Uncertainty,
    (x, v): ([f64; 4], [f64; 2]),
    holds: u32,
    h: f64,
    fault: Option<Fault>,
) -> [[f64; 2]; 4]
where
    P: ControlAffine<4, 2> + Send + Sync + 'static,
{
    let own = source(plant);
    let model = own.predict().expect("a model");
    let bounds = Bounds { min: [-9.0; MAX_INPUTS], max: [9.0; MAX_INPUTS] };
    faults::with(fault, || {
        let mut tube = Tube::around(model, (of, [0.0, h]), &bounds, [4, 2], &[]).expect("derivatives");
        let (mut z, mut path) = (x, vec![[0.0; EXPANSION_ORDERS]; 4]);
        for _ in 0..holds {
            tube.hold(&v, &z, None).expect("within bounds");
            model.path(&z, &v, &mut path);
            let over: Vec<_> = path.iter().map(|c| expansion::over(c, h)).collect();
            tube.advance(model, Piece { path: &path, over: &over, dt: h, u: &v }, |_| 0.0).expect("a bound");
            z = core::array::from_fn(|i| expansion::at(&path[i], h));
        }
        core::array::from_fn(|i| {
            let mut direction = [0.0; 4];
            direction[i] = 1.0;
            let half = tube.set.half_width(&direction, &mut Vec::new());
            [tube.set.centre[i] - half, tube.set.centre[i] + half]
        })
    })
}

/// Nothing is uncertain of a plant with four states and two inputs.
fn exact() -> Uncertainty {
    Uncertainty::nothing([4, 2])
}

/// Part of a known deviation that counts as round-off.
const ROUNDED: f64 = 1e-9;

/// A point mass that receives more of its input than it is asked for is where a tube that ignores this is not.
#[test]
fn a_gain_that_is_ignored_is_found() {
    const ASKED: f64 = 2.0;
    let of = Uncertainty { gains: vec![[0.9, 1.1], [1.0, 1.0]], ..exact() };
    let reach = |fault| open_loop(PointMass, &of, ([0.0; 4], [ASKED, 0.0]), 20, 0.05, fault);
    for part in of.gains[0] {
        // After a second.
        let ahead = [0.5 * (part - 1.0) * ASKED, 0.0, (part - 1.0) * ASKED, 0.0];
        let is_in = |reach: [[f64; 2]; 4], i: usize| {
            let most = ahead[i].abs() * ROUNDED;
            (reach[i][0] - most..=reach[i][1] + most).contains(&ahead[i])
        };
        assert!((0..4).all(|i| is_in(reach(None), i)), "{ahead:?} {:?}", reach(None));
        assert!(!is_in(reach(Some(Fault::Gain)), 0) && !is_in(reach(Some(Fault::Gain)), 2));
    }
}

/// A point mass whose input uses all of its freedom, to one side or changing sides in the middle, is where a tube that ignores this
/// is not.
#[test]
fn a_freedom_that_is_ignored_is_found() {
    const FREE: f64 = 0.3;
    let of = Uncertainty { freedom: vec![FREE, 0.0], ..exact() };
    let reach = |fault| open_loop(PointMass, &of, ([0.0; 4], [2.0, 0.0]), 20, 0.05, fault);
    // After a second: the place and the speed.
    for ahead in [[0.5 * FREE, FREE], [-0.5 * FREE, -FREE], [0.25 * FREE, 0.0]] {
        let is_in = |reach: [[f64; 2]; 4], i: usize| {
            let most = FREE * ROUNDED;
            (reach[2 * i][0] - most..=reach[2 * i][1] + most).contains(&ahead[i])
        };
        assert!((0..2).all(|i| is_in(reach(None), i)), "{ahead:?} {:?}", reach(None));
        assert!(!is_in(reach(Some(Fault::Freedom)), 0));
    }
}

/// A unicycle with another heading is behind its reference, by v t (1 − cos e): what first derivatives do not see.
#[test]
fn what_first_derivatives_leave_out_is_found() {
    const SPEED: f64 = 2.0;
    const ERROR: f64 = 0.2;
    let of = Uncertainty { errors: vec![0.0, 0.0, ERROR, 0.0], ..exact() };
    let reach = |fault| open_loop(Unicycle, &of, ([0.0, 0.0, 0.0, SPEED], [0.0; 2]), 20, 0.05, fault);
    // After a second.
    let behind = SPEED * (ERROR.cos() - 1.0);
    let ([low, high], [faulty, _]) = (reach(None)[0], reach(Some(Fault::Remainder))[0]);
    assert!(low <= behind && high >= 0.0, "{low} {high}");
    assert!(behind < faulty, "{behind} {faulty}");
}

/// A rock that lies between two samples is hit between them: a check at samples alone does not see it, and the run does.
#[test]
fn a_check_at_samples_alone_is_found() {
    const SPEED: f64 = 10.0;
    const HOLD: f64 = 0.2;
    let rock = Outside(DistanceDisc::new([SPEED * HOLD * 2.5, 0.0], 0.5, 1.0).expect("a disc"));
    let own = lie::along(Arc::new(PointMass), rock, 2).expect("a source");
    let model = own.predict().expect("a model");
    let (of, bounds) = (
        Uncertainty {
            rates: vec![0.0, 0.0, 0.1, 0.1],
            errors: vec![0.02; 4],
            gains: vec![[0.95, 1.05]; 2],
            ..Uncertainty::nothing([4, 2])
        },
        Bounds { min: [-9.0; MAX_INPUTS], max: [9.0; MAX_INPUTS] },
    );
    let requirement = [always(model)];
    let checked = |fault| {
        faults::with(fault, || {
            let tube =
                Tube::around(model, (&of, [0.0, HOLD]), &bounds, [4, 2], &requirement).expect("derivatives");
            let plant = Model {
                plant: model,
                dims: [4, 2],
                bounds: &bounds,
                integral: None,
                settings: &SETTINGS,
                step: HOLD,
            };
            let grid = Grid { period: HOLD, even: true };
            let mut walk =
                Walk::new(plant, &TOLERANCES, &requirement, 1.0, grid, (0.0, &[0.0, 0.0, SPEED, 0.0]))?
                    .within(tube)?;
            (1..=5_u32).try_for_each(|k| walk.hold_in_tube(&[0.0; 2], None, HOLD * f64::from(k)))
        })
    };
    assert!(matches!(checked(None), Err(Failure::Broken { .. })), "{:?}", checked(None));
    assert_eq!(checked(Some(Fault::Samples)), Ok(()));
    // Nothing differs from the model in the run.
    let h = |t: f64| model.value(t, &[SPEED * t, 0.0, SPEED, 0.0]);
    let least = (0..100_u32).map(|k| h(HOLD * 5.0 * f64::from(k) / 100.0)).fold(f64::INFINITY, f64::min);
    assert!(least < 0.0 && (0..=5_u32).all(|k| h(HOLD * f64::from(k)) > 0.0), "{least}");
}

/// In how many of these runs each defect shows, as a broken promise and as one that is withdrawn: what an end-to-end test can
/// find. Printed if `PUNCTUAL_TABLES` is set.
#[test]
fn table_of_defects_end_to_end() {
    if std::env::var_os("PUNCTUAL_TABLES").is_none() {
        return;
    }
    let (cases, _) = effort();
    for fault in [None].into_iter().chain(FAULTS.map(Some)) {
        let [mut accepted, mut broken, mut withdrawn] = [0; 3];
        let mut least = f64::INFINITY;
        for k in 0..3 * cases as u64 {
            let is_point = k % 3 == 0;
            let bounds = [[4.0, 4.0], [4.0, 1.5], [4.0, 0.6]][k as usize % 3];
            let case = Case::draw(&mut Draws(900 + k), bounds, is_point);
            let how = Run {
                adversary: [Adversary::Worst, Adversary::Constant][k as usize / 3 % 2],
                asks: ASKS[k as usize % 2],
                seed: k,
                time: 10.0,
                worse: 1.0,
            };
            let declared = Declared::all(is_point);
            let outcome = faults::with(fault, || match k % 3 {
                0 => run(&PointMass, &case, &declared, &how),
                1 => run(&Unicycle, &case, &declared, &how),
                _ => run(&Bicycle::new(2.5).expect("a length"), &case, &declared, &how),
            });
            accepted += usize::from(outcome.accepted);
            broken += usize::from(outcome.accepted && outcome.least < 0.0);
            withdrawn += usize::from(outcome.accepted && outcome.withdrawn > 0);
            least = least.min(outcome.least);
        }
        show(&format!(
            "| {fault:?} | {accepted} | {broken} broken | {withdrawn} withdrawn | least {least:.4} m |"
        ));
        if fault.is_none() {
            assert_eq!((broken, withdrawn), (0, 0));
        }
    }
}

/// Writes ten plans, their tubes and runs that are among the worst to the file that `PUNCTUAL_PLANS` names, for
/// `tests/falsify/referee.py`.
#[test]
fn plans_for_a_referee() {
    let Some(file) = std::env::var_os("PUNCTUAL_PLANS") else { return };
    let mut plans = exported(&PointMass, "point mass", [4.0, 4.0], 2);
    plans.extend(exported(&Unicycle, "unicycle", [4.0, 1.5], 4));
    plans.extend(exported(&Bicycle::new(2.5).expect("a length"), "bicycle", [4.0, 0.6], 4));
    std::fs::write(file, serde_json::to_string(&plans).expect("JSON")).expect("a file to write");
}

fn exported<P>(plant: &P, name: &str, bounds: [f64; 2], count: usize) -> Vec<serde_json::Value>
where
    P: ControlAffine<4, 2> + Clone + Send + Sync + 'static,
{
    let is_point = name == "point mass";
    let (mut draws, declared, mut plans) = (Draws(41), Declared::all(is_point), Vec::new());
    while plans.len() < count {
        let case = Case::draw(&mut draws, bounds, is_point);
        let filter = case.filter(plant.clone(), Some(&declared));
        let Ok(plan) = filter.planning().expect("plans").plan_from(0.0, &case.x, 1.0) else { continue };
        let law = plan.tracking().expect("a law");
        let mut reach: Vec<Vec<f64>> = Vec::new();
        along(plant, &declared, law, |_, set| {
            let mut sizes = vec![0.0; set.centre.len()];
            set.reach(&mut sizes);
            reach.push(sizes[..4].to_vec());
        });
        let (followed, holds) = (Followed { plant, declared: &declared, law }, law.inputs.len() - 1);
        let run = |direction: [f64; 4], draws: &mut Draws| {
            let passed = followed.run(&followed.worst(holds, direction, draws, 0).1);
            let at = |k: usize| -> Vec<f64> {
                (0..4).map(|i| passed.states[k * SLICES][i] - law.states[k][i]).collect()
            };
            (0..=holds).map(at).collect::<Vec<_>>()
        };
        let directions = (0..8_u32).map(|k| {
            let (sin, cos) = (0.25 * core::f64::consts::PI * f64::from(k)).sin_cos();
            [cos, sin, 0.0, 0.0]
        });
        let runs: Vec<_> = directions.map(|direction| run(direction, &mut draws)).collect();
        plans.push(serde_json::json!({
            "plant": name, "rates": declared.rates, "errors": declared.errors, "gains": declared.gains,
            "times": law.times, "inputs": law.inputs, "states": law.states, "gain": law.gains,
            "reach": reach, "runs": runs,
        }));
    }
    plans
}
