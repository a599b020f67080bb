//! Recordings with planted delays, lags, gains, winds and noise: what is found contains them, and little more.

use punctual_fmu::configuration::{Configuration, FilterConfiguration};

use super::*;
use crate::recording::{Column, Recording};

/// The step of the recordings in s.
const STEP: f64 = 0.02;
/// The step of the integration that makes them, in s.
const INNER: f64 = 0.0005;
/// How much larger than planted a bound may be that was found: declared bounds have a factor of 1.2, and few of a thousand draws come near
/// the largest possible, so that winds and noise explain a little of each other.
const AT_MOST: f64 = 2.0;

/// A cart with drag: x = (place in m, speed in m/s), one input in N.
fn cart() -> FilterConfiguration {
    let text = "kind = \"filter\"\nexperiment = { step_size = 0.02 }\n\
                [plant]\nstates = [{ name = \"p\", unit = \"m\" }, { name = \"v\", unit = \"m/s\" }]\n\
                inputs = [{ name = \"F\", unit = \"N\", min = -8.0, max = 8.0 }]\n\
                parameters = [{ name = \"m\", start = 2.0, unit = \"kg\" }, { name = \"c\", start = 0.5, unit = \"kg/s\" }]\n\
                derivatives = { p = \"v\", v = \"(F - c * v) / m\" }\n\
                [[barrier]]\nname = \"wall\"\nexpression = \"100 - p\"\nunit = \"m\"\n";
    match Configuration::parse(text) {
        Ok(Configuration::Filter(filter)) => filter,
        other => panic!("{other:?}"),
    }
}

/// What is planted.
#[derive(Clone, Copy, Debug)]
struct Planted {
    delay: f64,
    lag: f64,
    gain: [f64; 2],
    /// On the speed, in m/s2: a constant part, and one drawn anew at every hold.
    wind: [f64; 2],
    /// Of the place and the speed.
    noise: [f64; 2],
    mass: f64,
    drag: f64,
}

const NOTHING: Planted = Planted {
    delay: 0.0,
    lag: 0.0,
    gain: [1.0, 1.0],
    wind: [0.0, 0.0],
    noise: [0.0, 0.0],
    mass: 2.0,
    drag: 0.5,
};

/// Random numbers from -1 to 1.
struct Random(u64);

impl Random {
    fn draw(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }
}

/// `holds` holds of the cart as `planted`. The force jumps every few holds, as steps and ramps.
fn recorded(planted: Planted, holds: usize, seed: u64) -> Recording {
    let mut random = Random(seed);
    let (mut forces, mut level) = (Vec::new(), 0.0);
    let mut rest: usize = 0;
    for k in 0..holds {
        if rest == 0 {
            level = if forces.iter().sum::<f64>() > 0.0 { -8.0 } else { 8.0 } * random.draw().abs();
            rest = 2 + (20.0 * random.draw().abs()) as usize;
        }
        rest -= 1;
        // The second half has ramps.
        forces.push(if 2 * k < holds { level } else { 0.5 * level + 4.0 * (0.02 * k as f64).sin() });
    }
    let column = |name: &str| Column { name: name.into(), unit: None };
    let mut recording = Recording::new(vec![column("p"), column("v"), column("F")]);
    let (mut x, mut arrived) = ([0.0_f64, 0.0], 0.0);
    let (inner, mut wind) = ((STEP / INNER).round() as usize, 0.0);
    let mut gain = planted.gain[0];
    for k in 0..holds {
        let noise = [random.draw(), random.draw()];
        let seen = [0, 1].map(|i| x[i] + planted.noise[i] * noise[i]);
        recording.push(STEP * k as f64, &[seen[0], seen[1], forces[k]]);
        wind = planted.wind[0] + planted.wind[1] * random.draw() + 0.0 * wind;
        if k % 15 == 0 {
            gain = 0.5 * (planted.gain[0] + planted.gain[1]) + 0.5 * (planted.gain[1] - planted.gain[0]) * random.draw();
        }
        for i in 0..inner {
            let t = STEP * k as f64 + INNER * i as f64 - planted.delay;
            let asked = if t < -1e-9 { 0.0 } else { forces[((t + 1e-9) / STEP) as usize] };
            let before = arrived;
            arrived = if planted.lag > 0.0 { asked + (arrived - asked) * (-INNER / planted.lag).exp() } else { asked };
            let mean = if planted.lag > 0.0 { 0.5 * (before + arrived) } else { asked };
            let rate = |v: f64| (gain * mean - planted.drag * v) / planted.mass + wind;
            let middle = x[1] + 0.5 * INNER * rate(x[1]);
            x = [x[0] + INNER * middle, x[1] + INNER * rate(middle)];
        }
    }
    recording
}

fn proposed(planted: Planted, holds: usize, seed: u64, factor: f64) -> Proposal {
    let c = cart();
    let record = Record::of(&c, &[recorded(planted, holds, seed)], &[]).unwrap();
    let proposal = identify(&c, &record, factor).unwrap();
    assert_eq!(proposal.explained, proposal.holds, "{planted:?}, {seed}: {proposal:#?}");
    proposal
}

fn declared(proposal: &Proposal, kind: Kind, name: &str) -> Option<[f64; 2]> {
    proposal.findings.iter().find(|f| f.kind == kind && f.name == name).map(|f| f.declared)
}

#[test]
fn show() {
    for (name, planted) in [
        ("nothing", NOTHING),
        ("delay", Planted { delay: 0.013, ..NOTHING }),
        ("lag", Planted { lag: 0.05, ..NOTHING }),
        ("gain", Planted { gain: [0.9, 0.9], ..NOTHING }),
        ("gains", Planted { gain: [0.85, 0.95], ..NOTHING }),
        ("wind", Planted { wind: [0.2, 0.0], ..NOTHING }),
        ("gusts", Planted { wind: [0.0, 0.2], ..NOTHING }),
        ("noise", Planted { noise: [0.01, 0.02], ..NOTHING }),
        ("all", Planted { delay: 0.02, lag: 0.05, gain: [0.9, 0.9], wind: [0.1, 0.05], noise: [0.01, 0.01], ..NOTHING }),
        ("mass", Planted { mass: 2.14, drag: 0.3, ..NOTHING }),
    ] {
        let begin = std::time::Instant::now();
        let proposal = proposed(planted, 1000, 7, 1.2);
        println!("== {name}: {:?}", begin.elapsed());
        for f in &proposal.findings {
            println!("{} = {} found {:?} without {:?} at {:?}", f.key(), f.shown(f.declared), f.found, f.without_worst, f.instant);
        }
        println!("{:?} {:?}", proposal.difference.size, proposal.difference.sentence());
    }
}
