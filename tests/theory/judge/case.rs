//! One closed loop: plant, sets, bounds, reference input, samples, and everything else needed to repeat it.

use punctual_core::filter::{BarrierSettings, Filter, FilterBuilder, Sampling};
use punctual_study::starts;

use super::model::{Input, Plant, Shape, State};

/// Random numbers that only depend on a seed.
pub(crate) struct Numbers(Box<dyn FnMut() -> f64>);

impl Numbers {
    pub(crate) fn new(seed: u64) -> Self {
        Self(Box::new(starts::uniform(seed)))
    }

    /// Uniform.
    pub(crate) fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.0)()
    }

    /// Uniform in its logarithm.
    pub(crate) fn scale(&mut self, low: f64, high: f64) -> f64 {
        low * (high / low).powf((self.0)())
    }

    /// 0 … `count` − 1.
    pub(crate) fn below(&mut self, count: usize) -> usize {
        ((self.0)() * count as f64) as usize
    }

    /// True in this fraction of the cases.
    pub(crate) fn chance(&mut self, part: f64) -> bool {
        (self.0)() < part
    }
}

/// A set and the promise on it.
#[derive(Clone, Debug)]
pub(crate) struct Set {
    pub(crate) shape: Shape,
    /// Deadline T in s. For a set that is only kept, it is the deadline that the filter gets if it requires
    /// one.
    pub(crate) deadline: f64,
    /// Whether nothing has to be reached: only a start that is inside at the anchor must stay inside.
    pub(crate) keeping: bool,
    pub(crate) rate: Option<f64>,
    pub(crate) stay_rate: Option<f64>,
    pub(crate) margin: f64,
    pub(crate) recovery: Option<f64>,
}

impl Set {
    pub(crate) fn within(shape: Shape, deadline: f64) -> Self {
        Self { shape, deadline, keeping: false, rate: None, stay_rate: None, margin: 0.0, recovery: None }
    }

    pub(crate) fn keeping(shape: Shape, deadline: f64) -> Self {
        Self { keeping: true, ..Self::within(shape, deadline) }
    }

    fn settings(&self) -> BarrierSettings {
        let asked = if self.keeping { keeping() } else { BarrierSettings::within(self.deadline) };
        asked.rate(self.rate).stay_rate(self.stay_rate).margin(self.margin).recovery(self.recovery)
    }
}

/// A set that is only kept.
fn keeping() -> BarrierSettings {
    BarrierSettings::keeping()
}

/// Tells the filter the longest possible hold in s.
fn announce(builder: FilterBuilder, longest: f64) -> FilterBuilder {
    builder.period_max(longest).expect("a valid period")
}

/// How u_ref is chosen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Reference {
    Zero,
    /// Against the speed, with this gain.
    Damping(f64),
    /// Out of the first set, with this strength.
    Outwards(f64),
    /// Out of the set with the nearest edge, with this strength.
    Hostile(f64),
    /// Drawn again at random times, with this mean hold.
    Random {
        size: Input,
        held: f64,
    },
    /// The same, at one bound or the other.
    BangBang {
        size: Input,
        held: f64,
    },
}

/// When samples are taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Steps {
    Regular,
    /// Each 0.5 to 1 of the longest.
    Jittered,
    /// Each 0.05 to 1 of the longest, uniform in the logarithm.
    Scattered,
    /// 10 % of them three times as long.
    Missed,
    /// Some of them 1e-12, 1e-9 or 1e-6 s long.
    Tiny,
    /// Every tenth one has this many seconds.
    EveryTenth(f64),
    /// Only the fiftieth has this many seconds.
    Once(f64),
    /// Every other one has this many seconds.
    Alternating(f64),
}

#[derive(Clone, Debug)]
pub(crate) struct Case {
    pub(crate) plant: Plant,
    pub(crate) sets: Vec<Set>,
    /// Bounds on each |u_i|.
    pub(crate) bounds: Input,
    pub(crate) start_time: f64,
    pub(crate) start: State,
    pub(crate) reference: Reference,
    pub(crate) steps: Steps,
    /// The usual step in s, which the filter is given as the first.
    pub(crate) step: f64,
    /// Whether the filter is given the longest step.
    pub(crate) announced: bool,
    /// Length of the run in s from the anchor.
    pub(crate) horizon: f64,
    /// Seed of the numbers drawn during the run.
    pub(crate) seed: u64,
}

impl Case {
    /// One set, no bounds, no reference input, regular steps, until twice the deadline.
    pub(crate) fn plain(plant: Plant, set: Set, start: &[f64], step: f64) -> Self {
        let mut state = [0.0; 8];
        state[..start.len()].copy_from_slice(start);
        Self {
            plant,
            horizon: 2.0 * set.deadline,
            sets: vec![set],
            bounds: [f64::INFINITY; 2],
            start_time: 0.0,
            start: state,
            reference: Reference::Zero,
            steps: Steps::Regular,
            step,
            announced: true,
            seed: 1,
        }
    }

    /// The same with another step in s.
    pub(crate) fn at(&self, step: f64) -> Self {
        Self { step, ..self.clone() }
    }

    pub(crate) fn filter(&self) -> Filter {
        let inputs = self.plant.inputs();
        let mut builder = Filter::from_sources(self.plant.states(), inputs);
        let shapes: Vec<_> = self.sets.iter().map(|set| &set.shape).collect();
        for (set, source) in self.sets.iter().zip(self.plant.sources(&shapes)) {
            builder = builder.source("set", source, set.settings()).expect("valid settings");
        }
        let low = self.bounds.map(|bound| -bound);
        builder = builder.bounds(&low[..inputs], &self.bounds[..inputs]).expect("valid bounds");
        builder = builder.sampling(Sampling::Measured { first: Some(self.step) }).expect("a valid step");
        if self.announced {
            builder = announce(builder, self.longest());
        }
        builder.build().expect("a valid filter")
    }

    /// The same with a backup plan.
    pub(crate) fn assured(&self) -> Filter {
        self.filter().with_plans(self.step).expect("a filter that can be assured")
    }

    /// The longest hold of the case.
    pub(crate) fn longest(&self) -> f64 {
        if self.steps == Steps::Missed { 3.0 * self.step } else { self.step }
    }

    /// The longest hold that the filter has been told.
    pub(crate) fn longest_announced(&self) -> f64 {
        if self.announced { self.longest() } else { self.step }
    }

    /// The time of sample `k` + 1, if `t` is that of sample `k`.
    pub(crate) fn next_sample(&self, k: usize, t: f64, numbers: &mut Numbers) -> f64 {
        let step = self.step;
        t + match self.steps {
            // Computed like a clock, without accumulated round-off.
            Steps::Regular => return self.start_time + (k + 1) as f64 * step,
            Steps::Jittered => step * numbers.within(0.5, 1.0),
            Steps::Scattered => step * numbers.scale(0.05, 1.0),
            Steps::Missed if numbers.chance(0.1) => 3.0 * step,
            Steps::Tiny if numbers.chance(0.05) => [1e-12, 1e-9, 1e-6][numbers.below(3)],
            Steps::EveryTenth(short) if k % 10 == 9 => short,
            Steps::Once(short) if k == 50 => short,
            Steps::Alternating(short) if k % 2 == 1 => short,
            _ => step,
        }
    }

    /// The wanted input u_ref; `last` is the time of the last draw and its value, for [`Reference::Random`].
    pub(crate) fn wanted(&self, t: f64, x: &State, last: &mut (f64, Input), numbers: &mut Numbers) -> Input {
        match self.reference {
            Reference::Zero => [0.0; 2],
            Reference::Damping(gain) => match self.plant {
                Plant::PointMass => [-gain * x[2], -gain * x[3]],
                Plant::Unicycle | Plant::Bicycle { .. } => [-gain * x[3], 0.0],
                Plant::SmallSlip { .. } | Plant::Kinematic { .. } => [-gain * x[3], -2.0 * x[4]],
                Plant::Chain(1) | Plant::Written(1) => [-gain * x[0], 0.0],
                Plant::Chain(n) => [-gain * x[n - 1], 0.0],
                _ => [-gain * x[1], 0.0],
            },
            Reference::Outwards(size) => self.outwards(0, t, x, size),
            Reference::Hostile(size) => {
                let edge = |set: &Set| set.shape.value(t, x).abs();
                let nearest =
                    (0..self.sets.len()).min_by(|a, b| edge(&self.sets[*a]).total_cmp(&edge(&self.sets[*b])));
                self.outwards(nearest.unwrap_or(0), t, x, size)
            }
            Reference::Random { size, held } => {
                if t >= last.0 {
                    *last = (t + numbers.within(0.0, 2.0 * held), size.map(|s| numbers.within(-s, s)));
                }
                last.1
            }
            Reference::BangBang { size, held } => {
                if t >= last.0 {
                    let wanted = size.map(|s| if numbers.chance(0.5) { s } else { -s });
                    *last = (t + numbers.within(0.0, 2.0 * held), wanted);
                }
                last.1
            }
        }
    }

    /// Leads out of set `set`, in the direction of decreasing h.
    fn outwards(&self, set: usize, t: f64, x: &State, size: f64) -> Input {
        let shape = &self.sets[set].shape;
        let &Shape::Disc { start, velocity, outside, .. } = shape else {
            let falls = match *shape {
                Shape::Line { sign, .. } => -sign,
                Shape::Within { .. } => x[0].signum(),
                Shape::Slow { .. } | Shape::Headway { .. } => 1.0,
                _ => -1.0,
            };
            // The gap shrinks with the speed.
            let turned = matches!((self.plant, shape), (Plant::Cruise { .. }, Shape::Line { .. }));
            return [if turned { -falls } else { falls } * size, 0.0];
        };
        let sign = if outside { -1.0 } else { 1.0 };
        let away = [0, 1].map(|i| sign * (x[i] - start[i] - velocity[i] * t));
        let far = away[0].hypot(away[1]).max(1e-9);
        if self.plant == Plant::PointMass {
            return away.map(|d| size * d / far);
        }
        let (along, across) =
            (away[0] * x[2].cos() + away[1] * x[2].sin(), away[1] * x[2].cos() - away[0] * x[2].sin());
        [size * along.signum(), (2.0 * (across / far) * along.signum()).clamp(-1.0, 1.0)]
    }
}
