//! Expressions of state and time, such as a feedback law.

use punctual_core::scalar::Scalar;

use crate::operation::{Register, Step};
use crate::series::Series;

/// Evaluates expressions such as `-k * v`, made by [`Model::functions`](crate::Model::functions). With
/// [`Tangent`](punctual_core::jet::Tangent)s, it also gives their derivatives along a direction.
#[derive(Clone, Debug)]
pub struct Functions<C> {
    pub(crate) steps: Vec<Step>,
    pub(crate) results: Vec<Register>,
    pub(crate) states: usize,
    pub(crate) time: Register,
    pub(crate) series: Series<C>,
}

impl<C: Scalar> Functions<C> {
    /// Number of expressions.
    pub fn len(&self) -> usize {
        self.results.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.results.is_empty()
    }

    /// The value of each expression at time `t` in s, where state `i` is `x(i)`. NaN if a function is outside
    /// its domain.
    pub fn at(&mut self, t: f64, x: impl Fn(usize) -> C) -> impl Iterator<Item = C> {
        for i in 0..self.states {
            self.series.set(i, 0, x(i));
        }
        self.series.set(self.time, 0, C::from(t));
        self.series.advance(&self.steps, 0);
        self.results.iter().map(|&result| self.series.get(result, 0))
    }
}
