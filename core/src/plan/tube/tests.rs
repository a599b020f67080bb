//! Sets that enclose, and tubes that no plant within what was declared leaves.

mod tight;

use alloc::boxed::Box;
use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;

use super::*;
use crate::barriers::{DistanceDisc, Outside, StateBound};
use crate::dynamics::ControlAffine;
use crate::lie::{self, DerivativeSource, EXPANSION_ORDERS};
use crate::plan::expansion;
use crate::plants::{Bicycle, PointMass, Unicycle};

struct Draws(u64);

impl Draws {
    fn part(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn signed(&mut self) -> f64 {
        2.0 * self.part() - 1.0
    }
}

fn source<P>(plant: P) -> Box<dyn DerivativeSource>
where
    P: ControlAffine<4, 2> + Send + Sync + 'static,
{
    let rock = Outside(DistanceDisc::new([3.0, 1.0], 0.5, 1.0).expect("a disc"));
    lie::along(Arc::new(plant), rock, 2).expect("a source")
}

fn bends(model: &dyn Predict) -> Bends {
    let found = Bends::of(4, 6, |variables, out| {
        let (x, u) = variables.split_at(4);
        model.second_rates(x, u, out)
    });
    found.expect("derivatives")
}

#[test]
fn what_is_curved_is_found() {
    // v cos θ, v sin θ, ω, a: by θ twice, and by θ and v.
    let found = bends(source(Unicycle).predict().expect("a model"));
    assert_eq!((found.bent, found.pairs), (vec![2, 3], vec![[2, 2], [2, 3]]));
    // And v β/l_r.
    let found = bends(source(Bicycle::new(2.5).expect("a length")).predict().expect("a model"));
    assert_eq!((found.bent, found.pairs), (vec![2, 3, 5], vec![[2, 2], [2, 3], [3, 5]]));
    let found = bends(source(PointMass).predict().expect("a model"));
    assert_eq!((found.bent, found.pairs), (vec![], vec![]));
}

#[test]
fn a_reduced_zonotope_encloses_what_it_was() {
    let mut draws = Draws(3);
    for _ in 0..50 {
        let mut set = Zonotope::point(3);
        for k in 0..60 {
            set.push((0..3).map(|_| draws.signed() / f64::from(1 + k)));
        }
        let mut reduced = set.clone();
        reduced.reduce(20, 3, &[1.0, 0.5, 2.0], &mut Vec::new());
        assert!(reduced.len() <= 20);
        for _ in 0..200 {
            let direction: Vec<f64> = (0..3).map(|_| draws.signed()).collect();
            assert!(
                reduced.half_width(&direction, &mut Vec::new())
                    >= set.half_width(&direction, &mut Vec::new())
            );
        }
        // No wider than the box around it.
        let (mut reach, mut before) = ([0.0; 3], [0.0; 3]);
        reduced.reach(&mut reach);
        set.reach(&mut before);
        assert!(reach.iter().zip(before).all(|(reach, before)| *reach <= before * (1.0 + 1e-12)));
    }
}

#[test]
fn the_series_of_a_matrix_is_that_of_its_exponential() {
    // A rotation: e^A turns by the angle.
    let angle = 0.05_f64;
    let [flow, integral] = exponential(&[0.0, -angle, angle, 0.0], 2);
    assert!((flow[0] - angle.cos()).abs() < 1e-9 && (flow[2] - angle.sin()).abs() < 1e-8);
    assert!(
        (integral[0] - angle.sin() / angle).abs() < 1e-7
            && (integral[2] - (1.0 - angle.cos()) / angle).abs() < 1e-6
    );
}

/// A run of a plant beside a reference: `worse` times the declared uncertainty, drawn or kept at a corner.
struct Beside<'a, P> {
    plant: &'a P,
    of: &'a Uncertainty,
    worse: f64,
    corners: bool,
}

impl<P: ControlAffine<4, 2>> Beside<'_, P> {
    fn draw(&self, draws: &mut Draws, size: f64) -> f64 {
        let part = draws.signed();
        self.worse * size * if self.corners { part.signum() } else { part }
    }

    /// Moves `x` by `dt` under what arrives of `u`, with a disturbance of its own; by ten steps of Heun's method. What arrives
    /// is a part of `late`, which follows `u`.
    fn run(&self, draws: &mut Draws, x: &mut [f64; 4], late: &mut [f64; 2], u: [f64; 2], dt: f64) {
        let gains: [f64; 2] = core::array::from_fn(|i| {
            let [low, high] = self.of.gains[i];
            0.5 * (low + high) + self.draw(draws, 0.5 * (high - low))
        });
        let follows: [f64; 2] = core::array::from_fn(|i| {
            let [low, high] = self.of.lags[i];
            (-0.05 * dt / (0.5 * (low + high) + self.draw(draws, 0.5 * (high - low))).max(1e-9)).exp()
        });
        let w: [f64; 4] = core::array::from_fn(|i| self.draw(draws, self.of.rates[i]));
        let rate = |x: &[f64; 4], late: &[f64; 2]| {
            let rate = self.plant.derivative(x, &core::array::from_fn(|i| gains[i] * late[i]));
            core::array::from_fn::<f64, 4, _>(|i| rate[i] + w[i])
        };
        for _ in 0..10 {
            let follow = |late: &mut [f64; 2]| {
                for i in 0..2 {
                    late[i] = u[i] + follows[i] * (late[i] - u[i]);
                }
            };
            // The input in the middle of a step.
            follow(late);
            let (h, k1) = (dt / 10.0, rate(x, late));
            let k2 = rate(&core::array::from_fn(|i| x[i] + h * k1[i]), late);
            follow(late);
            for i in 0..4 {
                x[i] += 0.5 * h * (k1[i] + k2[i]);
            }
        }
    }
}

/// The parts of a hold in which a disturbance is constant, and before which a sample may come.
const SLICES: u32 = 10;
/// The error of the judge's own integration.
const INTEGRATED: f64 = 1e-6;

/// Follows a curved reference under a constant gain, with `runs` plants beside it. Returns how many left the tube, in a
/// direction or by h, at a sample or between.
fn escapes<P>(plant: &P, gain: &[f64], worse: f64, runs: usize, (dt, jitter): (f64, f64)) -> usize
where
    P: ControlAffine<4, 2> + Clone + Send + Sync + 'static,
{
    let own = source(plant.clone());
    let model = own.predict().expect("a model");
    let of = Uncertainty {
        rates: vec![0.02, 0.01, 0.02, 0.1],
        errors: vec![0.02, 0.02, 0.01, 0.02],
        gains: vec![[0.9, 1.05], [0.95, 1.1]],
        lags: if jitter > 0.0 { vec![[0.0; 2]; 2] } else { vec![[0.01, 0.06], [0.0, 0.04]] },
        jitter,
        ..Uncertainty::nothing([4, 2])
    };
    let bounds = Bounds { min: [-9.0; MAX_INPUTS], max: [9.0; MAX_INPUTS] };
    let requirement = Requirement {
        barrier: 0,
        is_limit: false,
        model,
        from: 0.0,
        until: f64::INFINITY,
        margin: 0.0,
        firm: 0.0,
        reserve: 0.0,
    };
    let tube =
        Tube::around(model, (&of, [0.0, 0.5 * dt]), &bounds, [4, 2], &[requirement]).expect("derivatives");
    let mut tube = tube.acted_on(&[[-0.2, 0.3], [0.0, 0.4]]);
    let mut draws = Draws(11);
    let mut z = [0.0, 0.0, 0.3, 1.0];
    let (mut beside, mut late) = (Vec::new(), Vec::new());
    let worlds: Vec<Beside<'_, P>> =
        (0..runs).map(|k| Beside { plant, of: &of, worse, corners: k % 2 == 0 }).collect();
    for world in &worlds {
        beside.push(core::array::from_fn(|i| z[i] + world.draw(&mut draws, of.errors[i])));
        late.push([0.05 + world.draw(&mut draws, 0.25), 0.2 + world.draw(&mut draws, 0.2)]);
    }
    let mut left = vec![false; runs];
    let mut inputs = vec![[0.0; 2]; runs];
    // When each was sampled last, in slices, and in which hold.
    let mut sampled = vec![(0.0, None); runs];
    // The same gain for all headings does not last.
    for k in 0..(3.0 / dt) as u32 {
        let v = [0.5 * (0.1 * f64::from(k)).sin(), 0.4 * (0.07 * f64::from(k)).cos()];
        let gain = Some(gain).filter(|_| k > 0 || jitter == 0.0);
        tube.hold(&v, &z, gain).expect("within bounds");
        let (mut path, mut over) = (vec![[0.0; EXPANSION_ORDERS]; 4], Vec::new());
        model.path(&z, &v, &mut path);
        over.extend(path.iter().map(|c| expansion::over(c, dt)));
        tube.advance(model, Piece { path: &path, over: &over, dt, u: &v }, |_| 1e-10).expect("a bound");
        let [fall, _] = tube.fall((0, &requirement), Interval::from(0.0), &over);
        for slice in 0..SLICES {
            let reference = |slice: u32| -> [f64; 4] {
                core::array::from_fn(|i| at(&path[i], dt / f64::from(SLICES) * f64::from(slice)))
            };
            let (before, reference) = (reference(slice), reference(slice + 1));
            let runs = worlds.iter().zip(beside.iter_mut().zip(&mut late));
            let asked = inputs.iter_mut().zip(&mut sampled).zip(&mut left);
            for ((world, (x, late)), ((input, since), left)) in runs.zip(asked) {
                // A sample here, which has to come if the next one would be too late. The first of a hold counts.
                let is_last =
                    f64::from(k * SLICES + slice + 1) - since.0 > 0.5 * (1.0 + jitter) * f64::from(SLICES);
                let comes = if jitter > 0.0 && k > 0 { is_last || draws.part() < 0.1 } else { slice == 0 };
                if comes {
                    let is_first = since.1 != Some(k);
                    *since = (f64::from(k * SLICES + slice), Some(k));
                    if is_first {
                        let seen: [f64; 4] =
                            core::array::from_fn(|i| x[i] + world.draw(&mut draws, of.errors[i]) - before[i]);
                        let gain = |i: usize| gain.map_or(&[][..], |gain| &gain[4 * i..4 * i + 4]);
                        *input = core::array::from_fn(|i| v[i] + zonotope::dot(gain(i), &seen));
                    }
                }
                world.run(&mut draws, x, late, *input, dt / f64::from(SLICES));
                *left |= model.value(0.0, x) < model.value(0.0, &reference) - fall;
                let e: [f64; 4] = core::array::from_fn(|i| x[i] - reference[i]);
                for _ in 0..if slice + 1 == SLICES { 20 } else { 0 } {
                    let direction: Vec<f64> = (0..4).map(|_| draws.signed()).collect();
                    let (along, centre) =
                        (zonotope::dot(&direction, &e), zonotope::dot(&direction, &tube.set.centre));
                    *left |= (along - centre).abs()
                        > tube.set.half_width(&direction, &mut Vec::new()) + INTEGRATED;
                }
            }
        }
        z = core::array::from_fn(|i| at(&path[i], dt));
    }
    left.iter().filter(|left| **left).count()
}

/// Gains that follow: the position by the heading and the speed.
const FOLLOWS: [f64; 8] = [-1.2, -0.4, 0.0, -1.8, 0.4, -1.2, -2.2, 0.0];

#[test]
fn no_plant_within_what_was_declared_leaves_its_tube() {
    // Frequent samples, rare ones, and frequent ones that come late.
    for how in [(0.02, 0.0), (0.1, 0.0), (0.04, 0.3)] {
        assert_eq!(escapes(&Unicycle, &FOLLOWS, 1.0, 60, how), 0);
        assert_eq!(escapes(&Bicycle::new(2.5).expect("a length"), &FOLLOWS, 1.0, 60, how), 0);
        let point = [-1.5, 0.0, -2.0, 0.0, 0.0, -1.5, 0.0, -2.0];
        assert_eq!(escapes(&PointMass, &point, 1.0, 60, how), 0);
    }
}

/// The judge can fail: plants that are much worse than declared leave.
#[test]
fn plants_beyond_what_was_declared_leave_their_tube() {
    assert!(escapes(&Unicycle, &FOLLOWS, 8.0, 60, (0.02, 0.0)) > 30);
    assert!(escapes(&PointMass, &[-1.5, 0.0, -2.0, 0.0, 0.0, -1.5, 0.0, -2.0], 8.0, 60, (0.02, 0.0)) > 30);
}

/// A cart that is pushed: (position, speed).
#[derive(Clone)]
struct Cart;

impl ControlAffine<2, 1> for Cart {
    fn drift<S: Scalar>(&self, x: &[S; 2]) -> [S; 2] {
        [x[1], S::zero()]
    }

    fn input_map<S: Scalar>(&self, _x: &[S; 2]) -> [[S; 1]; 2] {
        [[S::zero()], [S::one()]]
    }
}

/// For a linear cart with a constant lag the farthest that a disturbance leads is known: the sum of the responses to it. The
/// tube is nowhere nearer, also where its generators are boxed, and for what arrives late too.
#[test]
fn no_disturbance_of_a_linear_cart_leads_out_of_its_tube() {
    const PARTS: u32 = 8;
    let own = lie::along(Arc::new(Cart), StateBound::at_most(0, 1.0).expect("a bound"), 2).expect("a source");
    let model = own.predict().expect("a model");
    for (dt, lag, [k0, k1]) in [
        (0.02, 0.04, [1.0, 2.0]),
        (0.02, 0.02, [4.0, 4.0]),
        (0.1, 0.03, [1.0, 2.0]),
        (0.05, 0.05, [4.0, 4.0]),
    ] {
        let of = Uncertainty { rates: vec![0.0, 0.01], lags: vec![[lag; 2]], ..Uncertainty::nothing([2, 1]) };
        let bounds = Bounds { min: [-1e9; MAX_INPUTS], max: [1e9; MAX_INPUTS] };
        let tube = Tube::around(model, (&of, [0.0, dt]), &bounds, [2, 1], &[]).expect("derivatives");
        let (mut tube, gain) = (tube.acted_on(&[[0.0; 2]]), [-k0, -k1]);
        // Position, speed and what arrives, after a disturbance of its own for a part of a hold; and what is asked.
        let mut responses: Vec<([f64; 3], f64)> = Vec::new();
        for k in 0..100 {
            tube.hold(&[0.0], &[0.0; 2], Some(&gain)).expect("within bounds");
            responses.iter_mut().for_each(|(x, asked)| *asked = -k0 * x[0] - k1 * x[1]);
            let h = dt / f64::from(PARTS);
            let move_on = |x: &mut [f64; 3], asked: f64, w: f64| {
                let (left, late) = ((-h / lag).exp(), x[2] - asked);
                let by = asked + w;
                *x = [
                    x[0] + x[1] * h + 0.5 * by * h * h + late * lag * (h - lag * (1.0 - left)),
                    x[1] + by * h + late * lag * (1.0 - left),
                    asked + late * left,
                ];
            };
            for _ in 0..PARTS {
                responses.iter_mut().for_each(|(x, asked)| move_on(x, *asked, 0.0));
                let mut x = [0.0; 3];
                move_on(&mut x, 0.0, 0.01);
                responses.push((x, 0.0));
            }
            let (mut path, mut over) = (vec![[0.0; EXPANSION_ORDERS]; 2], Vec::new());
            model.path(&[0.0; 2], &[0.0], &mut path);
            over.extend(path.iter().map(|c| expansion::over(c, dt)));
            let piece = Piece { path: &path, over: &over, dt, u: &[0.0] };
            tube.advance(model, piece, |_| 0.0).expect("a bound");
            let mut reach = [0.0; 4];
            tube.set.reach(&mut reach);
            let reach = reach.map(|reach| reach.max(1e-9));
            for turn in 0..24 * 7_u32 {
                let (a, b) = (f64::from(turn % 24) * 0.2618, (f64::from(turn / 24) - 3.0) * 0.5);
                let d = [a.cos() * b.cos() / reach[0], a.sin() * b.cos() / reach[1], b.sin() / reach[2]];
                let response =
                    |(x, asked): &([f64; 3], f64)| d[0] * x[0] + d[1] * x[1] + d[2] * (x[2] - asked);
                let farthest: f64 = responses.iter().map(|found| response(found).abs()).sum();
                let half = tube.set.half_width(&d, &mut Vec::new());
                assert!(farthest <= half * (1.0 + 1e-9), "{dt} {lag} {k} {d:?}: {farthest} {half}");
            }
        }
    }
}
