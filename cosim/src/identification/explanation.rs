//! What a difference between plant and model looks like: how much of it each single cause would explain.

use punctual_core::dynamics::DynPlant;
use punctual_core::elementary::sqrt;
use punctual_fmu::configuration::{FilterConfiguration, over_seconds, updated};
use punctual_fmu::text::{number, quantity};
use serde::Serialize;

use super::arrival::{Arrival, Before};
use super::fit::{Fitting, RESOLUTION};
use super::linear::{Linear, Predictor};
use super::record::Record;
use super::sizes::noise;
use crate::error::Error;

/// A single cause of a difference.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "cause", rename_all = "snake_case")]
pub enum Cause {
    /// A part of an input acts.
    Gain {
        /// The input.
        input: String,
        /// The part.
        gain: f64,
    },
    /// An input is followed with a first-order lag.
    Lag {
        /// The input.
        input: String,
        /// The time constant in s.
        lag: f64,
    },
    /// All inputs act late.
    Delay {
        /// In s.
        delay: f64,
    },
    /// Something constant is added to the rate of a state.
    Rate {
        /// The state.
        state: String,
        /// In its unit per s.
        rate: f64,
        /// That unit.
        unit: String,
    },
    /// A parameter of the model has another value.
    Parameter {
        /// Its name.
        parameter: String,
        /// The value that explains most.
        value: f64,
        /// The value in the file.
        start: f64,
        /// Its unit.
        unit: String,
    },
    /// The measurements are noisy.
    Noise,
}

impl Cause {
    /// In words, such as "0.2 s of lag on a".
    pub fn words(&self) -> String {
        match self {
            Self::Gain { input, gain } if *gain < 1.0 => {
                format!("{} % less of {input}", number(100.0 * (1.0 - gain)))
            }
            Self::Gain { input, gain } => format!("{} % more of {input}", number(100.0 * (gain - 1.0))),
            Self::Lag { input, lag } => format!("{} s of lag on {input}", number(*lag)),
            Self::Delay { delay } => format!("{} s of delay", number(*delay)),
            Self::Rate { state, rate, unit } => {
                format!("{} added to the rate of {state}", quantity(*rate, unit))
            }
            Self::Parameter { parameter, value, start, unit } => {
                format!("{parameter} = {} in place of {}", number(*value), quantity(*start, unit))
            }
            Self::Noise => "noise of the measurements".to_owned(),
        }
    }
}

/// A cause, and how much of a difference it would explain by itself.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Explanation {
    /// The cause.
    #[serde(flatten)]
    pub cause: Cause,
    /// The part of the mean square of the difference, from 0 to 1.
    pub share: f64,
}

/// A difference between a plant and its model.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Difference {
    /// The root of the mean square of the difference of the rates, as a part of the rates themselves.
    pub size: f64,
    /// What explains most of it comes first; nothing that explains less than a hundredth.
    pub explanations: Vec<Explanation>,
}

impl Difference {
    /// Whether it is more than round-off of numbers and integration.
    pub fn is_seen(&self) -> bool {
        /// What different integrations of the same model differ by.
        const SEEN: f64 = 1e-5;
        self.size > SEEN
    }

    /// A sentence on what it looks like; `None` if nothing is seen.
    pub fn sentence(&self) -> Option<String> {
        /// Explanations that are named, if they explain this part.
        const NAMED: (usize, f64) = (3, 0.05);
        let named = self.explanations.iter().filter(|e| e.share >= NAMED.1).take(NAMED.0);
        let named: Vec<_> = named
            .map(|e| format!("{} would explain {} %", e.cause.words(), (100.0 * e.share).floor()))
            .collect();
        self.is_seen().then(|| match &named[..] {
            [] => {
                "no lag, gain, delay, constant rate or parameter explains much of the difference".to_owned()
            }
            named => format!("{} of the difference", named.join(", ")),
        })
    }
}

/// What the difference between the plant in `record` and the model of `c` looks like.
///
/// # Errors
///
/// A model that cannot be simulated, or does not hold where the recording is.
pub fn difference(c: &FilterConfiguration, record: &Record) -> Result<Difference, Error> {
    let plant = c.plant.build()?;
    let inner_step = c.run.integration.inner_step;
    let model = Predictor::new(&*plant, record.period, inner_step);
    let nominal = Arrival::nominal(record.inputs.len());
    let mut seen = Seen::new(Fitting::new(&model, record, &nominal, None)?);
    let mut explanations = seen.gains();
    explanations.extend(seen.late(c.experiment.step_size));
    explanations.extend(seen.rates());
    explanations.extend(seen.noise());
    explanations.extend(parameters(c, record, &seen)?);
    /// Less is not worth a word.
    const LEAST: f64 = 0.01;
    explanations.retain(|explanation| explanation.share >= LEAST);
    explanations.sort_by(|a, b| b.share.total_cmp(&a.share));
    Ok(Difference { size: seen.size(), explanations })
}

/// The difference as it is seen over windows.
struct Seen<'a> {
    fitting: Fitting<'a>,
    /// By window and state.
    left: Vec<f64>,
    /// The weight of each state: rates count as parts of the state's own.
    weights: Vec<f64>,
    total: f64,
}

impl<'a> Seen<'a> {
    fn new(fitting: Fitting<'a>) -> Self {
        let left = fitting.windowed(&residuals(&fitting.linear), fitting.window);
        let reach = fitting.window as f64 * fitting.record.period;
        let weights = fitting.scales.iter().map(|scale| 1.0 / (scale * scale * reach * reach)).collect();
        let mut seen = Self { fitting, left, weights, total: 0.0 };
        seen.total = seen.product(&seen.left, &seen.left);
        seen
    }

    /// The weighted product of two series by window and state.
    fn product(&self, a: &[f64], b: &[f64]) -> f64 {
        let n = self.weights.len();
        a.iter().zip(b).enumerate().map(|(at, (a, b))| self.weights[at % n] * a * b).sum()
    }

    /// The root of the mean square over the windows, as a part of the rates.
    fn size(&self) -> f64 {
        let windows = self.left.len() as f64 / self.weights.len() as f64;
        sqrt(self.total / windows.max(1.0))
    }

    /// The factor of `series` that explains most, and the part of the difference that it explains.
    fn along(&self, series: &[f64]) -> (f64, f64) {
        let (own, with) = (self.product(series, series), self.product(series, &self.left));
        let floor = RESOLUTION * RESOLUTION * (1.0 + self.total);
        if own <= floor { (0.0, 0.0) } else { (with / own, with * with / (own * self.total.max(floor))) }
    }

    fn effect(&self, j: usize, delay: f64, lag: f64, before: Before) -> Vec<f64> {
        self.fitting.windowed(&self.fitting.effect(j, delay, lag, before), self.fitting.window)
    }

    /// By input.
    fn gains(&self) -> Vec<Explanation> {
        let gain = |(j, input): (usize, &punctual_fmu::configuration::VariableSection)| {
            let (change, share) = self.along(&self.effect(j, 0.0, 0.0, Before::Nothing));
            Explanation { cause: Cause::Gain { input: input.name.clone(), gain: 1.0 + change }, share }
        };
        self.fitting.record.inputs.iter().enumerate().map(gain).collect()
    }

    /// A delay, and lags by input.
    fn late(&mut self, step: f64) -> Vec<Explanation> {
        let (m, period) = (self.fitting.linear.inputs, self.fitting.record.period);
        let longest = super::longest(self.fitting.record, step);
        let at_once: Vec<_> = (0..m).map(|j| self.effect(j, 0.0, 0.0, Before::Nothing)).collect();
        // What is left if the inputs `which` are late.
        let share = |this: &Self, which: &[usize], delay: f64, lag: f64| {
            let with = |before: Before| {
                let mut left = this.left.clone();
                for j in which {
                    let late = this.effect(*j, delay, lag, before);
                    left.iter_mut()
                        .zip(at_once[*j].iter().zip(late))
                        .for_each(|(l, (now, late))| *l += now - late);
                }
                1.0 - this.product(&left, &left) / this.total.max(f64::MIN_POSITIVE)
            };
            with(Before::Nothing).max(with(Before::First))
        };
        let all: Vec<usize> = (0..m).collect();
        let delay = most(period, longest.delay, |by| share(self, &all, by, 0.0));
        let mut found = vec![Explanation { cause: Cause::Delay { delay: delay.0 }, share: delay.1 }];
        for j in 0..m {
            let (lag, share) = most(period, longest.lag, |by| share(self, &[j], 0.0, by));
            let input = self.fitting.record.inputs[j].name.clone();
            found.push(Explanation { cause: Cause::Lag { input, lag }, share });
        }
        found
    }

    /// A constant rate, by state.
    fn rates(&self) -> Vec<Explanation> {
        let (n, linear) = (self.weights.len(), &self.fitting.linear);
        let rate = |i: usize| {
            let mut series = vec![0.0; linear.holds.len() * n];
            for (k, hold) in linear.holds.iter().enumerate() {
                for r in 0..n {
                    let own = f64::from(u8::from(r == i));
                    series[k * n + r] = 0.5 * hold.length * (own + hold.jacobian[r * n + i]);
                }
            }
            let (rate, share) = self.along(&self.fitting.windowed(&series, self.fitting.window));
            let state = &self.fitting.record.states[i];
            let cause = Cause::Rate { state: state.name.clone(), rate, unit: over_seconds(&state.unit, 1) };
            Explanation { cause, share }
        };
        (0..n).map(rate).collect()
    }

    /// Noise, if consecutive residuals show any.
    fn noise(&self) -> Option<Explanation> {
        let linear = &self.fitting.linear;
        let (n, sigmas) = (linear.states, noise(linear));
        let windows = self.left.len() as f64 / n as f64;
        // Both ends of a window are off; what other states add over one hold is enough to compare.
        let of_state = |i: usize| {
            let hold = &linear.holds[linear.holds.len() / 2];
            let through = (0..n).map(|j| {
                let part = hold.jacobian[i * n + j] * sigmas[j];
                part * part
            });
            self.weights[i] * windows * (sigmas[i] * sigmas[i] + through.sum::<f64>())
        };
        let share = (0..n).map(of_state).sum::<f64>() / self.total.max(f64::MIN_POSITIVE);
        (share > 0.0).then(|| Explanation { cause: Cause::Noise, share: share.min(1.0) })
    }
}

/// The residuals by hold and state.
fn residuals(linear: &Linear) -> Vec<f64> {
    linear.holds.iter().flat_map(|hold| hold.residual.clone()).collect()
}

/// Where `share` is largest between 0 and `longest` s, and its value there: on a grid, then refined.
fn most(period: f64, longest: f64, share: impl Fn(f64) -> f64) -> (f64, f64) {
    let mut grid = vec![0.0];
    let mut by = 0.25 * period;
    while by < longest {
        grid.push(by);
        by *= 1.5;
    }
    grid.push(longest);
    let values: Vec<f64> = grid.iter().map(|by| share(*by)).collect();
    let best = (0..grid.len()).max_by(|a, b| values[*a].total_cmp(&values[*b])).unwrap_or(0);
    // Golden section between the neighbours.
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    const ROUNDS: usize = 18;
    let (mut low, mut high) = (grid[best.saturating_sub(1)], grid[(best + 1).min(grid.len() - 1)]);
    for _ in 0..ROUNDS {
        let inner = [high - GOLDEN * (high - low), low + GOLDEN * (high - low)];
        if share(inner[0]) > share(inner[1]) {
            high = inner[1];
        } else {
            low = inner[0];
        }
    }
    let refined = 0.5 * (low + high);
    let value = share(refined);
    if value > values[best] { (refined, value) } else { (grid[best], values[best]) }
}

/// Other values of the model's own parameters, one at a time.
fn parameters(c: &FilterConfiguration, record: &Record, seen: &Seen<'_>) -> Result<Vec<Explanation>, Error> {
    /// Relative change for difference quotients.
    const CHANGE: f64 = 1e-4;
    /// Newton's steps, each at most a half of the value.
    const ROUNDS: usize = 4;
    let mut own = c.clone();
    let rows: Vec<_> = c.parameters().into_iter().filter(|row| row.path.starts_with("plant.")).collect();
    let predicted = |value: f64, row: &punctual_fmu::configuration::Parameter<FilterConfiguration>| {
        let Ok(changed) = updated(c, std::slice::from_ref(row), &[value]) else { return Ok(None) };
        let Ok(plant) = changed.plant.build() else { return Ok(None) };
        let left = ahead(&*plant, c, record)?;
        let left = seen.fitting.windowed(&left, seen.fitting.window);
        Ok::<_, Error>(left.iter().all(|value| value.is_finite()).then_some(left))
    };
    let mut found = Vec::new();
    for row in &rows {
        let start = row.get(&mut own);
        let change = if start == 0.0 { CHANGE } else { CHANGE * start.abs() };
        let mut value = start;
        let mut best = (start, 0.0);
        for _ in 0..ROUNDS {
            let (Some(left), Some(moved)) = (predicted(value, row)?, predicted(value + change, row)?) else {
                break;
            };
            let share = 1.0 - seen.product(&left, &left) / seen.total.max(f64::MIN_POSITIVE);
            if share > best.1 {
                best = (value, share);
            }
            let slope: Vec<f64> = moved.iter().zip(&left).map(|(m, l)| (m - l) / change).collect();
            let own = seen.product(&slope, &slope);
            if own <= RESOLUTION * RESOLUTION {
                break;
            }
            let most = if start == 0.0 { f64::INFINITY } else { 0.5 * value.abs() };
            value -= (seen.product(&slope, &left) / own).clamp(-most, most);
        }
        let cause = Cause::Parameter {
            parameter: row.name.clone(),
            value: best.0,
            start,
            unit: row.unit.to_string(),
        };
        found.push(Explanation { cause, share: best.1 });
    }
    Ok(found)
}

/// The residuals of another plant, by hold and state.
fn ahead(plant: &dyn DynPlant, c: &FilterConfiguration, record: &Record) -> Result<Vec<f64>, Error> {
    let model = Predictor::new(plant, record.period, c.run.integration.inner_step);
    let mut left = Vec::with_capacity(record.holds() * record.states.len());
    for episode in &record.episodes {
        for k in 0..episode.holds() {
            let u: Vec<f64> = episode.inputs.iter().map(|series| series[k]).collect();
            let mut x = episode.state(k);
            model.held(&mut x, &u, episode.times[k + 1] - episode.times[k])?;
            left.extend(episode.state(k + 1).iter().zip(&x).map(|(next, x)| next - x));
        }
    }
    Ok(left)
}
