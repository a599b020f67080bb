//! Two feedback laws: one stops the plant, the other follows a reference.

use alloc::vec::Vec;

use nalgebra::{DMatrix, DVector};

use super::check::TOLERANCES;
use super::model::{Linear, Model, largest_eigenvalue};
use super::settings::SearchSettings;
use crate::elementary;
use crate::scalar::all_finite;

/// u = `input` + `gain` (x − `state`), clamped to the bounds: stops the plant, wherever it is.
///
/// The gain is that of the linear-quadratic regulator at the equilibrium, with the price ‖ẋ‖². So it does not ask for a
/// position, only that nothing moves: a vehicle is braked where it is, a pendulum is held upright.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct StoppingController {
    pub(super) state: Vec<f64>,
    pub(super) input: Vec<f64>,
    pub(super) gain: Gain,
    /// The length of a hold in s.
    pub(super) hold: f64,
    /// How many times a deviation from the equilibrium grows over a hold under `input` alone: the largest eigenvalue.
    growth: f64,
}

impl StoppingController {
    /// The law around the equilibrium near `x`, with inputs held for `hold` s. `None` if no equilibrium or no law is found.
    pub(super) fn around(model: &Model<'_>, x: &[f64], hold: f64) -> Option<Self> {
        let (state, input) = model.equilibrium(x)?;
        Self::at(model, state, input, hold)
    }

    /// The law around the equilibrium near `x` and the input `u`, as for [`Self::around`].
    pub(super) fn beside(model: &Model<'_>, x: &[f64], u: &[f64], hold: f64) -> Option<Self> {
        let (state, input) = model.equilibrium_from(x, u.to_vec())?;
        Self::at(model, state, input, hold)
    }

    /// The law that leads from `x` to the equilibrium at `state` under `input`. Like a reference, it asks for the position
    /// too.
    pub(super) fn to(
        model: &Model<'_>,
        x: &[f64],
        (state, input): (Vec<f64>, Vec<f64>),
        hold: f64,
    ) -> Option<Self> {
        let Linear { a, b } = model.linear(&state, &input, hold);
        let (growth, (q, r)) = (largest_eigenvalue(&a), prices(model, &[x, &state], &[&input]));
        let gain = regulator(&a, &b, &q, &r, model.settings.riccati)
            .filter(|gain| gain.iter().all(|v| v.is_finite()))?;
        growth.is_finite().then_some(Self { state, input, gain: Gain::from(&gain), hold, growth })
    }

    /// The same law with shorter holds, multiples of `period`, if the plant leaves the equilibrium sooner.
    pub(super) fn shorter(&self, model: &Model<'_>, period: f64) -> Option<Self> {
        let hold = (self.longest(model.settings.lost) / period) as u32;
        let hold = f64::from(hold.max(1)) * period;
        match self.stays() || hold >= self.hold {
            true => Some(self.clone()),
            false => Self::at(model, self.state.clone(), self.input.clone(), hold),
        }
    }

    /// Whether the equilibrium stays where it is under `input` alone: no eigenvalue leads away.
    pub(super) fn stays(&self) -> bool {
        self.growth <= TOLERANCES.stays
    }

    /// Whether the plant has other equilibria near this one under the same input: a vehicle does, a motor does not.
    pub(super) fn is_one_of_many(&self, model: &Model<'_>) -> bool {
        let Linear { a, .. } = model.linear(&self.state, &self.input, self.hold);
        let moved = &a - DMatrix::identity(a.nrows(), a.ncols());
        let sizes = moved.singular_values();
        sizes.min() <= model.settings.sole * sizes.max()
    }

    /// The time in s in which a deviation from the equilibrium grows by the factor `growth`; at most a hold.
    pub(super) fn longest(&self, growth: f64) -> f64 {
        self.hold * (elementary::ln(growth) / elementary::ln(self.growth.max(growth)))
    }

    fn at(model: &Model<'_>, state: Vec<f64>, input: Vec<f64>, hold: f64) -> Option<Self> {
        let SearchSettings { gentleness, lost, haste, still, riccati, .. } = *model.settings;
        let Linear { a, b } = model.linear(&state, &input, hold);
        let growth = largest_eigenvalue(&a);
        if !growth.is_finite() {
            return None;
        }
        let nx = a.nrows();
        // Round-off of a difference moves nothing.
        let moved = (&a - DMatrix::identity(nx, nx)).map(|v| if v.abs() > still { v } else { 0.0 });
        let rate = moved / hold;
        let q = rate.transpose() * rate;
        let gained = b.transpose() * &q * &b;
        // An input without an immediate effect, such as one behind an integrator, is priced like the others. If every state
        // is an equilibrium, as for a point moved by its velocity, nothing is gained, and nothing is braked.
        let reach = b.column_iter().fold(0.0, |m: f64, column| m.max(column.norm_squared()));
        let most = gained.diagonal().max().max(1e-12 * reach / square(hold)).max(f64::MIN_POSITIVE);
        let r = DMatrix::from_diagonal(&gained.diagonal().map(|g| gentleness * g.max(1e-3 * most)));
        // Whatever no input can speed up is left as it is.
        let sooner = match growth <= TOLERANCES.stays {
            true => 1.0,
            false => elementary::powf(growth.min(lost), haste),
        };
        let hastened = regulator(&(&a * sooner), &(&b * sooner), &q, &r, riccati);
        let gain = hastened.or_else(|| regulator(&a, &b, &q, &r, riccati))?;
        Some(Self { state, input, gain: Gain::from(&gain), hold, growth })
    }

    /// Whether it is a law for a plant with `states` states and `inputs` inputs.
    pub(super) fn fits(&self, states: usize, inputs: usize) -> bool {
        let Self { state, input, gain, hold, growth } = self;
        is_of(state, states)
            && is_of(input, inputs)
            && is_of(&gain.0, inputs * states)
            && *hold > 0.0
            && growth.is_finite()
    }

    /// Writes the input at `x`.
    pub(super) fn input(&self, model: &Model<'_>, x: &[f64], u: &mut [f64]) {
        self.gain.feedback(&self.input, |i| x[i] - self.state[i], u);
        model.clamp(u);
    }
}

/// Inputs and states on a grid of holds, with the gains of a feedback along it.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Reference {
    /// The beginning of every hold in s, and the end of the last.
    pub(super) times: Vec<f64>,
    /// One input for every hold.
    pub(super) inputs: Vec<Vec<f64>>,
    /// The state at the beginning of every hold, and at the end of the last.
    pub(super) states: Vec<Vec<f64>>,
    pub(super) gains: Vec<Gain>,
}

impl Reference {
    /// Whether it belongs to a plant with `states` states and `inputs` inputs.
    pub(super) fn fits(&self, states: usize, inputs: usize) -> bool {
        let Self { times, inputs: held, states: nodes, gains } = self;
        is_of(times, held.len() + 1)
            && times.is_sorted_by(|a, b| a < b)
            && held.iter().all(|u| is_of(u, inputs))
            && nodes.len() == times.len()
            && nodes.iter().all(|x| is_of(x, states))
            && gains.len() == held.len()
            && gains.iter().all(|gain| is_of(&gain.0, inputs * states))
    }

    /// The same reference, followed `by` s sooner.
    pub(super) fn sooner(&self, by: f64) -> Self {
        Self { times: self.times.iter().map(|t| t - by).collect(), ..self.clone() }
    }

    /// The time at which it comes nearest to `x`, with each state measured in units of its span.
    pub(super) fn nearest(&self, x: &[f64]) -> f64 {
        let span = |i: usize| {
            let (low, high) = self
                .states
                .iter()
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x[i]), high.max(x[i])));
            high - low
        };
        let spans: Vec<f64> = (0..x.len()).map(span).collect();
        let largest = spans.iter().fold(f64::MIN_POSITIVE, |m: f64, s| m.max(*s));
        let weights: Vec<f64> = spans.iter().map(|s| 1.0 / s.max(0.01 * largest)).collect();
        let mut best = (f64::INFINITY, self.times.first().copied().unwrap_or(0.0));
        for (ends, times) in self.states.windows(2).zip(self.times.windows(2)) {
            let (mut along, mut square) = (0.0, 0.0);
            for (i, w) in weights.iter().enumerate() {
                let (way, off) = ((ends[1][i] - ends[0][i]) * w, (x[i] - ends[0][i]) * w);
                along += way * off;
                square += way * way;
            }
            let part = if square > 0.0 { (along / square).clamp(0.0, 1.0) } else { 0.0 };
            let apart: f64 = weights
                .iter()
                .enumerate()
                .map(|(i, w)| {
                    let d = (x[i] - ends[0][i] - part * (ends[1][i] - ends[0][i])) * w;
                    d * d
                })
                .sum();
            if apart < best.0 {
                best = (apart, times[0] + part * (times[1] - times[0]));
            }
        }
        best.1
    }

    /// The number of the first hold that ends more than `slack` s after `t`, if one is left.
    pub(super) fn hold_at(&self, t: f64, slack: f64) -> Option<usize> {
        let ends = self.times.get(1..)?;
        ends.iter().position(|end| *end > t + slack)
    }

    /// Writes the input for the remainder of hold `k`, at time `t` and `x`.
    pub(super) fn input(&self, model: &Model<'_>, k: usize, t: f64, x: &[f64], u: &mut [f64]) {
        let (begin, end) = (self.times[k], self.times[k + 1]);
        let mut at = self.states[k].clone();
        // The chord of a long hold is far from its arc.
        if t > begin + 1e-6 * (end - begin) {
            model.flow(&mut at, &self.inputs[k], t.min(end) - begin);
        }
        self.gains[k].feedback(&self.inputs[k], |i| x[i] - at[i], u);
        model.clamp(u);
    }
}

/// A matrix, stored by rows: one row for each input.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Gain(Vec<f64>);

impl From<&DMatrix<f64>> for Gain {
    fn from(matrix: &DMatrix<f64>) -> Self {
        Self(matrix.transpose().iter().copied().collect())
    }
}

impl Gain {
    /// `u` = `input` + gain · `deviation`.
    pub(super) fn feedback(&self, input: &[f64], deviation: impl Fn(usize) -> f64, u: &mut [f64]) {
        let columns = self.0.len() / u.len();
        for ((u, input), row) in u.iter_mut().zip(input).zip(self.0.chunks_exact(columns)) {
            *u = row.iter().enumerate().fold(*input, |sum, (j, gain)| sum + gain * deviation(j));
        }
    }

    /// The gains of a feedback along `states` and `inputs`, near which the plant is `linear`: by the Riccati equation,
    /// backwards. `None` if there are none.
    pub(super) fn along(
        model: &Model<'_>,
        states: &[Vec<f64>],
        inputs: &[Vec<f64>],
        linear: &[Linear],
    ) -> Option<Vec<Self>> {
        let (q, r) = prices(model, states, &inputs[..linear.len()]);
        let mut p = &q * 10.0;
        let mut gains = Vec::with_capacity(linear.len());
        for Linear { a, b } in linear.iter().rev() {
            let (next, gain) = riccati(&p, a, b, &q, &r)?;
            p = next;
            gains.push(Self::from(&gain));
        }
        gains.reverse();
        gains.iter().all(|gain| all_finite(&gain.0)).then_some(gains)
    }
}

/// The prices of a deviation and of an input along `states` and `inputs`. A deviation is priced by how far its state moves
/// there, an input by its bounds.
fn prices(
    model: &Model<'_>,
    states: &[impl AsRef<[f64]>],
    inputs: &[impl AsRef<[f64]>],
) -> (DMatrix<f64>, DMatrix<f64>) {
    let (nx, nu) = (model.states(), model.inputs());
    let span = |i: usize| {
        let (low, high) = states.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| {
            let x = x.as_ref()[i];
            (low.min(x), high.max(x))
        });
        high - low
    };
    let largest = (0..nx).map(span).fold(0.0, f64::max);
    let size = |i: usize| if largest > 0.0 { span(i).max(0.01 * largest) } else { 1.0 };
    let q = DMatrix::from_diagonal(&DVector::from_fn(nx, |i, _| square(1.0 / size(i))));
    let reached = |i: usize| inputs.iter().fold(0.0, |m: f64, u| m.max(u.as_ref()[i].abs())).max(1e-3);
    let r =
        DMatrix::from_diagonal(&DVector::from_fn(nu, |i, _| 0.01 * square(1.0 / model.reach(i, reached(i)))));
    (q, r)
}

/// The gain of the infinite-horizon regulator, for which the Riccati equation settles within so many `steps`.
fn regulator(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    q: &DMatrix<f64>,
    r: &DMatrix<f64>,
    steps: u32,
) -> Option<DMatrix<f64>> {
    let mut p = q.clone();
    for _ in 0..steps {
        let (next, _) = riccati(&p, a, b, q, r)?;
        let change = (&next - &p).amax();
        p = next;
        if !p.iter().all(|v| v.is_finite()) {
            return None;
        }
        if change <= 1e-12 * p.amax() {
            break;
        }
    }
    riccati(&p, a, b, q, r).map(|(_, gain)| gain)
}

/// One step of the Riccati equation backwards: the price of the state before it, and the gain.
pub(super) fn riccati(
    p: &DMatrix<f64>,
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    q: &DMatrix<f64>,
    r: &DMatrix<f64>,
) -> Option<(DMatrix<f64>, DMatrix<f64>)> {
    let pb = p * b;
    let gain = -((r + b.transpose() * &pb).cholesky()?.solve(&(pb.transpose() * a)));
    let next = q + a.transpose() * p * (a + b * &gain);
    // Symmetric up to round-off, which would grow.
    let next = (&next + next.transpose()) * 0.5;
    Some((next, gain))
}

/// Whether these are `count` numbers, all finite.
fn is_of(numbers: &[f64], count: usize) -> bool {
    numbers.len() == count && all_finite(numbers)
}

fn square(x: f64) -> f64 {
    x * x
}
