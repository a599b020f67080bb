//! Plans behind an integrator: the plant receives the mean of an integral over each period.

use crate::interval::Interval;
use crate::lie::{Ahead, EXPANSION_ORDERS, Expansion, ExpansionOver, Predict, RateOver, Second};

/// A state that is the integral of an input. The plant receives its mean over each period, held.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Integral {
    /// The number of the state.
    pub(crate) state: usize,
    /// The number of the input that is its derivative.
    pub(crate) input: usize,
}

/// A limit of a state as a barrier: h = `sign` (x − `limit`).
pub(crate) struct Limit<'a> {
    pub(crate) plant: &'a dyn Predict,
    pub(crate) state: usize,
    pub(crate) sign: f64,
    pub(crate) limit: f64,
}

impl Predict for Limit<'_> {
    fn flow(&self, x: &mut [f64], u: &[f64], duration: f64) {
        self.plant.flow(x, u, duration);
    }

    fn ahead(&self, _: f64, _: &[f64], _: &[f64], _: f64, out: &mut Ahead) {
        *out = Ahead::ZERO;
    }

    fn rate(&self, x: &[f64], u: &[f64], out: &mut [f64]) {
        self.plant.rate(x, u, out);
    }

    fn path(&self, x: &[f64], u: &[f64], out: &mut [Expansion]) {
        self.plant.path(x, u, out);
    }

    fn value(&self, _: f64, x: &[f64]) -> f64 {
        self.sign * (x[self.state] - self.limit)
    }

    fn value_along(&self, _: f64, path: &[Expansion], out: &mut Expansion) {
        *out = path[self.state].map(|c| self.sign * c);
        out[0] -= self.sign * self.limit;
    }

    fn rates_over(&self, path: &[ExpansionOver], u: &[f64], orders: usize, out: &mut [RateOver]) -> bool {
        self.plant.rates_over(path, u, orders, out)
    }

    fn value_over(&self, _: Interval, path: &[ExpansionOver]) -> Option<Interval> {
        Some((path[self.state][0] - self.limit) * self.sign)
    }

    fn second_rates(&self, x: &[Second], u: &[Second], out: &mut [Second]) -> bool {
        self.plant.second_rates(x, u, out)
    }

    fn second_value(&self, _: Interval, x: &[Second]) -> Option<Second> {
        Some((x[self.state] - self.limit) * self.sign)
    }

    fn is_still(&self, _: &[f64]) -> Option<bool> {
        Some(true)
    }

    fn last_over(&self, _: Interval, path: &[ExpansionOver]) -> Option<Interval> {
        Some(path[self.state][EXPANSION_ORDERS - 1] * self.sign)
    }
}
