//! Bounded errors of the measured state: their effect on the derivatives of h and on a row over the period.
//!
//! Every quantity is a smooth function F of the state. To first order |F(x̂) − F(x)| ≤ Σ_i ε_i |∂F/∂x_i|, with the
//! derivatives at the measured state (`docs/theory.md#measured-state`). For a row over the period these depend on u, so the
//! row is no longer affine: they are linearised together with it.

use alloc::string::String;
use alloc::vec::Vec;

use super::Sampling;
use super::slot::BarrierSlot;
use crate::convergence::sampled::PeriodBound;
use crate::error::{Error, ErrorKind};
use crate::lie::{Ahead, DerivativeSource, Direction};
use crate::scalar::all_finite;
use crate::{MAX_INPUTS, MAX_RELATIVE_DEGREE};

/// The derivatives of h⁽⁰⁾ … h⁽ⁿ⁻¹⁾ along one error.
pub(crate) type ErrorSlopes = [f64; MAX_RELATIVE_DEGREE];

/// The largest errors as directions of the state.
pub(crate) struct MeasurementErrors {
    state_dim: usize,
    /// One after the other, ε_i along axis i; only those that are not 0.
    directions: Vec<f64>,
}

/// The largest error of a row, and its derivative by u.
pub(crate) struct Uncertainty {
    pub(crate) size: f64,
    pub(crate) gradient: [f64; MAX_INPUTS],
}

impl MeasurementErrors {
    pub(crate) fn new(errors: &[f64]) -> Self {
        let state_dim = errors.len().max(1);
        let mut directions = Vec::new();
        for (i, error) in errors.iter().enumerate().filter(|(_, error)| **error > 0.0) {
            directions.extend((0..state_dim).map(|k| if k == i { *error } else { 0.0 }));
        }
        Self { state_dim, directions }
    }

    /// Whether there are no errors.
    pub(crate) fn is_exact(&self) -> bool {
        self.directions.is_empty()
    }

    /// The largest error of each of the `states` states.
    #[cfg(feature = "plan")]
    pub(crate) fn sizes(&self, states: usize) -> Vec<f64> {
        let mut sizes = alloc::vec![0.0; states];
        for direction in self.directions.chunks_exact(self.state_dim) {
            for (size, error) in sizes.iter_mut().zip(direction) {
                *size += error;
            }
        }
        sizes
    }

    /// Number of states with an error.
    pub(crate) fn count(&self) -> usize {
        self.directions.len() / self.state_dim
    }

    /// Bounds on the errors of h⁽⁰⁾ … h⁽ⁿ⁻¹⁾ at `t` and `x`. Writes their parts along each error to `slopes`. Not finite if
    /// the derivatives are not.
    pub(crate) fn of_derivatives(
        &self,
        source: &dyn DerivativeSource,
        t: f64,
        x: &[f64],
        inputs: usize,
        slopes: &mut [ErrorSlopes],
    ) -> ErrorSlopes {
        let zeros = [0.0; MAX_INPUTS];
        let zeros = &zeros[..inputs];
        let (mut change, mut sum) = (Ahead::ZERO, [0.0; MAX_RELATIVE_DEGREE]);
        let known = source.directional();
        for (direction, slopes) in self.directions.chunks_exact(self.state_dim).zip(slopes) {
            // Derivatives of order below n do not depend on the input.
            if let Some(source) = known {
                source.evaluate_directional(t, x, zeros, Direction { x: direction, u: zeros }, &mut change);
            }
            for k in 0..source.relative_degree() {
                slopes[k] = if known.is_some() { change.value[k] } else { f64::INFINITY };
                sum[k] += slopes[k].abs();
            }
        }
        sum
    }

    /// The largest error of the row over the period of `bound`, divided by its divisor, from t, x, u and the time ahead.
    /// `None` if it is not finite.
    pub(crate) fn of_row(
        &self,
        source: &dyn DerivativeSource,
        (t, x, u, period): (f64, &[f64], &[f64], f64),
        (bound, divisor): (&PeriodBound, f64),
        slopes: &[ErrorSlopes],
    ) -> Option<Uncertainty> {
        let zeros = &[0.0; MAX_INPUTS][..u.len()];
        let directional = source.predict_directional()?;
        let mut change = Ahead::ZERO;
        let mut sum = Uncertainty { size: 0.0, gradient: [0.0; MAX_INPUTS] };
        for (direction, slopes) in self.directions.chunks_exact(self.state_dim).zip(slopes) {
            let direction = Direction { x: direction, u: zeros };
            directional.ahead_directional(t, x, u, direction, period, &mut change);
            let (mut error, mut gradient) = (0.0, [0.0; MAX_INPUTS]);
            for k in 0..source.relative_degree() {
                let weight = bound.weights[k] / divisor;
                error += weight * (change.value[k] - bound.decay * slopes[k]);
                for (g, d) in gradient.iter_mut().zip(&change.gradient[k]) {
                    *g += weight * d;
                }
            }
            sum.size += error.abs();
            for (s, g) in sum.gradient.iter_mut().zip(&gradient) {
                *s += error.signum() * g;
            }
        }
        (sum.size.is_finite() && all_finite(&sum.gradient)).then_some(sum)
    }
}

/// How far h may fall short of its prediction: errors η_j of h⁽ʲ⁾ at the sample, and a disturbance of h⁽ⁿ⁾ of up to W from
/// there on. After τ s it is Σ_{j<n} η_j τʲ/j! + W τⁿ/n!. This is exact if h is linear and the plant a chain of integrators
/// (`docs/theory.md#between-samples`).
#[derive(Clone, Copy)]
pub(crate) struct Shortfall {
    coefficients: [f64; MAX_RELATIVE_DEGREE + 1],
    /// The time in s between the sample and the instant from which the input acts.
    delay: f64,
}

impl Shortfall {
    /// `None` if there is neither an error nor a disturbance.
    #[inline]
    pub(crate) fn new(errors: &[f64], disturbance: f64, delay: f64) -> Option<Self> {
        if disturbance == 0.0 && errors.iter().all(|error| *error == 0.0) {
            return None;
        }
        let mut coefficients = [0.0; MAX_RELATIVE_DEGREE + 1];
        let mut factorial = 1.0;
        for (j, (c, off)) in coefficients.iter_mut().zip(errors.iter().chain([&disturbance])).enumerate() {
            factorial *= j.max(1) as f64;
            *c = off / factorial;
        }
        Some(Self { coefficients, delay })
    }

    /// The part that the disturbance of h⁽ⁿ⁾ contributes, `at` s after the input begins to act.
    pub(crate) fn of_disturbance(&self, n: usize, at: f64) -> f64 {
        (0..n).fold(self.coefficients[n], |product, _| product * (at + self.delay))
    }

    /// The shortfall and its slope, `at` s after the input begins to act.
    pub(crate) fn at(&self, at: f64) -> [f64; 2] {
        let after = at + self.delay;
        self.coefficients
            .iter()
            .rev()
            .fold([0.0; 2], |[value, slope], c| [value * after + c, slope * after + value])
    }
}

/// Whether `source` gives derivatives along a direction, including those of its predictions.
pub(crate) fn check(source: &dyn DerivativeSource) -> Result<(), Error> {
    if source.directional().is_some() && source.predict_directional().is_some() {
        return Ok(());
    }
    let message = "the barrier's source gives no derivatives along a direction";
    Err(Error::new(ErrorKind::Unsupported, "measurement_errors", message))
}

/// Whether a filter with these barriers can allow for errors. Sets this in the barriers.
pub(crate) fn check_all(slots: &mut [BarrierSlot], sampling: Sampling, delay: f64) -> Result<(), Error> {
    let refuse = |message: String| Err(Error::new(ErrorKind::Unsupported, "measurement_errors", message));
    if sampling == Sampling::Pointwise {
        return refuse("needs the prediction over the period, the sampling is pointwise".into());
    }
    if delay > 0.0 {
        return refuse(format!("needs an actuation_delay of 0, it is {delay}"));
    }
    for slot in slots {
        let named = |e: Error| e.within(&slot.name);
        if !slot.promise.allows_errors() {
            return refuse("needs a method that allows for errors, such as the reference profile".into())
                .map_err(named);
        }
        check(&*slot.source).map_err(named)?;
        slot.exact = false;
    }
    Ok(())
}
