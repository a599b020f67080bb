//! The plant of a plan, predicted in steps of bounded length.

use alloc::vec;
use alloc::vec::Vec;

use nalgebra::{DMatrix, DVector, Schur};

use super::Integral;
use super::check::TOLERANCES;
use super::settings::SearchSettings;
use crate::elementary;
use crate::lie::Predict;
use crate::qp::Bounds;

/// The plant, and the longest step in s of its prediction.
#[derive(Clone, Copy)]
pub(super) struct Model<'a> {
    pub(super) plant: &'a dyn Predict,
    /// Number of states, and of inputs.
    pub(super) dims: [usize; 2],
    pub(super) bounds: &'a Bounds,
    /// The integral whose mean the plant receives over each period.
    pub(super) integral: Option<Integral>,
    pub(super) settings: &'a SearchSettings,
    pub(super) step: f64,
}

/// x⁺ ≈ A δx + B δu near a state and an input.
pub(super) struct Linear {
    pub(super) a: DMatrix<f64>,
    pub(super) b: DMatrix<f64>,
}

impl Model<'_> {
    pub(super) fn states(&self) -> usize {
        self.dims[0]
    }

    pub(super) fn inputs(&self) -> usize {
        self.dims[1]
    }

    /// Number of equal steps of at most [`Self::step`] in `duration`.
    pub(super) fn steps(&self, duration: f64) -> usize {
        // Round-off of a sum of steps does not add a step.
        ((duration / self.step * (1.0 - 1e-9)) as usize).saturating_add(1)
    }

    /// Moves `x` by `duration` s under the held input `u`.
    pub(super) fn flow(&self, x: &mut [f64], u: &[f64], duration: f64) {
        let steps = self.steps(duration);
        for _ in 0..steps {
            self.plant.flow(x, u, duration / steps as f64);
        }
    }

    /// `u` moved into the bounds.
    pub(super) fn clamp(&self, u: &mut [f64]) {
        for (i, u) in u.iter_mut().enumerate() {
            *u = self.bounds.clamp(i, *u);
        }
    }

    /// Half the width of the bounds of input `i`, or `otherwise` if a bound is missing.
    pub(super) fn reach(&self, i: usize, otherwise: f64) -> f64 {
        let half = (self.bounds.max[i] - self.bounds.min[i]) / 2.0;
        if half.is_finite() { half } else { otherwise }
    }

    /// The linear model over `duration` s near `x` and `u`, by central differences.
    pub(super) fn linear(&self, x: &[f64], u: &[f64], duration: f64) -> Linear {
        let nx = x.len();
        let both = differences(&[x, u].concat(), TOLERANCES.difference, nx, |end| {
            let (x, u) = end.split_at_mut(nx);
            self.flow(x, u, duration);
        });
        Linear { a: both.columns(0, nx).into(), b: both.columns(nx, u.len()).into() }
    }

    /// The rate of the state under `u`: its mean over `duration` s.
    pub(super) fn rate(&self, x: &[f64], u: &[f64], duration: f64) -> DVector<f64> {
        let mut end = x.to_vec();
        self.flow(&mut end, u, duration);
        DVector::from_iterator(x.len(), end.iter().zip(x).map(|(e, x)| (e - x) / duration))
    }

    /// A state near `x`, and an input within the bounds that holds it there for a step, by Gauss-Newton steps of least
    /// change. `None` if none is found.
    pub(super) fn equilibrium(&self, x: &[f64]) -> Option<(Vec<f64>, Vec<f64>)> {
        let mut u = vec![0.0; self.inputs()];
        self.clamp(&mut u);
        self.equilibrium_from(x, u).or_else(|| {
            // Without an input a tank may run empty during the search.
            let middle = |i: usize| (self.bounds.min[i] + self.bounds.max[i]) / 2.0;
            let middle = (0..self.inputs()).map(middle).map(|u| if u.is_finite() { u } else { 0.0 });
            self.equilibrium_from(x, middle.collect())
        })
    }

    /// The same equilibrium, sought from the input `u`.
    pub(super) fn equilibrium_from(&self, x: &[f64], u: Vec<f64>) -> Option<(Vec<f64>, Vec<f64>)> {
        self.equilibrium_within(x, u, |_, _| {})
    }

    /// The same within sets. `missing` appends two numbers for each set that does not contain a state: by how much h falls
    /// short there, > 0, divided by the length of its gradient; and the unit gradient.
    pub(super) fn equilibrium_within(
        &self,
        x: &[f64],
        mut u: Vec<f64>,
        missing: impl Fn(&[f64], &mut Vec<(f64, Vec<f64>)>),
    ) -> Option<(Vec<f64>, Vec<f64>)> {
        let SearchSettings { equilibrium_steps, equilibrium_rate, rank, .. } = *self.settings;
        let (nx, nu) = (self.states(), self.inputs());
        let (mut at, mut outside, duration) = (x.to_vec(), Vec::new(), self.step);
        for _ in 0..equilibrium_steps {
            let rate = self.rate(&at, &u, duration);
            if !rate.iter().all(|r| r.is_finite()) {
                return None;
            }
            outside.clear();
            missing(&at, &mut outside);
            let still = |(x, r): (&f64, &f64)| {
                r.abs() <= equilibrium_rate + TOLERANCES.round_off * x.abs() / duration
            };
            if outside.is_empty() && at.iter().zip(rate.iter()).all(still) {
                return Some((at, u));
            }
            let Linear { a, b } = self.linear(&at, &u, duration);
            let mut jacobian = DMatrix::zeros(nx + outside.len(), nx + nu);
            jacobian.view_mut((0, 0), (nx, nx)).copy_from(&((a - DMatrix::identity(nx, nx)) / duration));
            jacobian.view_mut((0, nx), (nx, nu)).copy_from(&(b / duration));
            let lacking = outside.iter().map(|(lacks, _)| -lacks);
            let wanted = DVector::from_iterator(nx + outside.len(), rate.iter().copied().chain(lacking));
            for (i, (_, gradient)) in outside.iter().enumerate() {
                jacobian.view_mut((nx + i, 0), (1, nx)).copy_from_slice(gradient);
            }
            // A decomposition of NaN need not end.
            if !jacobian.iter().all(|v| v.is_finite()) {
                return None;
            }
            // If a bound stops an input, the state covers the rest.
            let mut stopped = vec![false; nu];
            let step = loop {
                let svd = jacobian.clone().svd(true, true);
                let step = svd.solve(&wanted, rank * svd.singular_values.max()).ok()?;
                let stops =
                    |i: usize| step[nx + i] != 0.0 && self.bounds.clamp(i, u[i] - step[nx + i]) == u[i];
                match (0..nu).find(|i| !stopped[*i] && stops(*i)) {
                    Some(i) => {
                        stopped[i] = true;
                        jacobian.fill_column(nx + i, 0.0);
                    }
                    None => break step,
                }
            };
            for i in 0..nx {
                at[i] -= step[i];
            }
            for i in 0..nu {
                u[i] -= step[nx + i];
            }
            self.clamp(&mut u);
        }
        None
    }
}

/// Writes the slope of h at `t` and `x` along each state, by central differences.
pub(crate) fn slopes(h: &dyn Predict, t: f64, x: &[f64], out: &mut [f64]) {
    let mut moved = x.to_vec();
    for (i, slope) in out.iter_mut().enumerate() {
        if !h.reads(i) {
            *slope = 0.0;
            continue;
        }
        let size = TOLERANCES.difference * (1.0 + x[i].abs());
        let [above, below] = [size, -size].map(|by| {
            moved[i] = x[i] + by;
            h.value(t, &moved)
        });
        moved[i] = x[i];
        *slope = (above - below) / (2.0 * size);
    }
}

/// The derivatives of the first `rows` numbers that `map` computes from `at`, one column for each number in `at`: by central
/// differences, each over `part` of its size.
pub(super) fn differences(
    at: &[f64],
    part: f64,
    rows: usize,
    mut map: impl FnMut(&mut [f64]),
) -> DMatrix<f64> {
    let (mut slopes, mut ends) = (DMatrix::zeros(rows, at.len()), [at.to_vec(), at.to_vec()]);
    for (j, number) in at.iter().enumerate() {
        let size = part * (1.0 + number.abs());
        for (end, by) in ends.iter_mut().zip([size, -size]) {
            end.copy_from_slice(at);
            end[j] += by;
            map(end);
        }
        for i in 0..rows {
            slopes[(i, j)] = (ends[0][i] - ends[1][i]) / (2.0 * size);
        }
    }
    slopes
}

/// The size of the largest eigenvalue; infinite if none is found.
pub(super) fn largest_eigenvalue(matrix: &DMatrix<f64>) -> f64 {
    // A decomposition of NaN need not end.
    let schur = match matrix.iter().all(|v| v.is_finite()) {
        true => Schur::try_new(matrix.clone(), f64::EPSILON, TOLERANCES.rotations),
        false => None,
    };
    schur.map_or(f64::INFINITY, |schur| {
        let squares = schur.complex_eigenvalues().map(|value| value.norm_sqr());
        elementary::sqrt(squares.max())
    })
}

/// The largest h found by climbing from `x` at `t`, up to `enough`, in so many steps, each with so many halvings.
pub(crate) fn highest(model: &dyn Predict, (t, x): (f64, &[f64]), enough: f64, steps: [u32; 2]) -> f64 {
    climb(model, t, &mut x.to_vec(), enough, steps)
}

/// The same; `x` is moved to where that is.
pub(crate) fn climb(
    model: &dyn Predict,
    t: f64,
    x: &mut [f64],
    enough: f64,
    [climbs, halvings]: [u32; 2],
) -> f64 {
    let (mut gradient, mut next) = (x.to_vec(), x.to_vec());
    let mut h = model.value(t, x);
    for _ in 0..climbs {
        slopes(model, t, x, &mut gradient);
        let steepness: f64 = gradient.iter().map(|g| g * g).sum();
        let mut length = (enough - h) / steepness;
        let climbs = (0..halvings).any(|_| {
            for (next, (x, g)) in next.iter_mut().zip(x.iter().zip(&gradient)) {
                *next = x + length * g;
            }
            length *= 0.5;
            model.value(t, &next) > h
        });
        // From NaN there is no way up.
        if h >= enough || !climbs {
            break;
        }
        x.copy_from_slice(&next);
        h = model.value(t, x);
    }
    h
}
