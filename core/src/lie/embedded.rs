//! A source of derivatives that depends on some of the filter's states.

use alloc::boxed::Box;
use alloc::vec::Vec;

use super::{
    Ahead, DerivativeSource, Derivatives, Direction, Directional, EXPANSION_ORDERS, Expansion, ExpansionOver,
    Predict, PredictDirectional, RateOver,
};
use crate::MAX_RELATIVE_DEGREE;
use crate::error::{Error, ErrorKind, length};
use crate::interval::Interval;

/// Largest number of states of a picked source.
const MAX_PICKED: usize = 32;

struct Embedded {
    source: Box<dyn DerivativeSource>,
    state_dim: usize,
    picks: Vec<usize>,
}

impl Embedded {
    /// The source's own states, picked from all of them, followed by zeros.
    fn picked(&self, x: &[f64]) -> [f64; MAX_PICKED] {
        let mut own = [0.0; MAX_PICKED];
        for (slot, &pick) in own.iter_mut().zip(&self.picks) {
            *slot = x[pick];
        }
        own
    }

    /// The same for enclosures, followed by unbounded intervals.
    fn picked_over(&self, path: &[ExpansionOver]) -> [ExpansionOver; MAX_PICKED] {
        let mut own = [[Interval::ALL; EXPANSION_ORDERS]; MAX_PICKED];
        for (own, &pick) in own.iter_mut().zip(&self.picks) {
            *own = path[pick];
        }
        own
    }

    /// Writes the source's own states back into all.
    fn put_back(&self, own: &[f64; MAX_PICKED], x: &mut [f64]) {
        for (&pick, value) in self.picks.iter().zip(own) {
            x[pick] = *value;
        }
    }
}

impl DerivativeSource for Embedded {
    fn relative_degree(&self) -> usize {
        self.source.relative_degree()
    }

    fn state_dim(&self) -> usize {
        self.state_dim
    }

    fn input_dim(&self) -> usize {
        self.source.input_dim()
    }

    fn evaluate(&self, t: f64, x: &[f64], out: &mut Derivatives) {
        self.source.evaluate(t, &self.picked(x)[..self.picks.len()], out);
    }

    fn predict(&self) -> Option<&dyn Predict> {
        self.source.predict().map(|_| self as _)
    }

    fn directional(&self) -> Option<&dyn Directional> {
        self.source.directional().map(|_| self as _)
    }

    fn predict_directional(&self) -> Option<&dyn PredictDirectional> {
        self.source.predict_directional().map(|_| self as _)
    }

    fn highest(&self, t: f64, x: &[f64], bounds: [&[f64]; 2], time: [f64; 2]) -> Option<f64> {
        self.source.highest(t, &self.picked(x)[..self.picks.len()], bounds, time)
    }
}

impl Predict for Embedded {
    fn flow(&self, x: &mut [f64], u: &[f64], duration: f64) {
        let Some(source) = self.source.predict() else { return };
        let mut own = self.picked(x);
        source.flow(&mut own[..self.picks.len()], u, duration);
        self.put_back(&own, x);
    }

    fn ahead(&self, t: f64, x: &[f64], u: &[f64], duration: f64, out: &mut Ahead) {
        let Some(source) = self.source.predict() else { return };
        source.ahead(t, &self.picked(x)[..self.picks.len()], u, duration, out);
    }

    fn ahead_of_row(&self, t: f64, x: &[f64], u: &[f64], duration: f64, out: &mut Ahead) {
        let Some(source) = self.source.predict() else { return };
        source.ahead_of_row(t, &self.picked(x)[..self.picks.len()], u, duration, out);
    }

    fn values_ahead(
        &self,
        t: f64,
        x: &[f64],
        u: &[f64],
        duration: f64,
        out: &mut [f64; MAX_RELATIVE_DEGREE + 1],
    ) {
        let Some(source) = self.source.predict() else { return };
        source.values_ahead(t, &self.picked(x)[..self.picks.len()], u, duration, out);
    }

    fn values_of_row(
        &self,
        t: f64,
        x: &[f64],
        u: &[f64],
        duration: f64,
        out: &mut [f64; MAX_RELATIVE_DEGREE + 1],
    ) {
        let Some(source) = self.source.predict() else { return };
        source.values_of_row(t, &self.picked(x)[..self.picks.len()], u, duration, out);
    }

    fn rate(&self, x: &[f64], u: &[f64], out: &mut [f64]) {
        let Some(source) = self.source.predict() else { return };
        let mut own = [0.0; MAX_PICKED];
        source.rate(&self.picked(x)[..self.picks.len()], u, &mut own[..self.picks.len()]);
        out.fill(0.0);
        self.put_back(&own, out);
    }

    fn path(&self, x: &[f64], u: &[f64], out: &mut [Expansion]) {
        let Some(source) = self.source.predict() else { return };
        let mut own = [[0.0; EXPANSION_ORDERS]; MAX_PICKED];
        source.path(&self.picked(x)[..self.picks.len()], u, &mut own[..self.picks.len()]);
        for (out, &x) in out.iter_mut().zip(x) {
            *out = [0.0; EXPANSION_ORDERS];
            out[0] = x;
        }
        for (&pick, own) in self.picks.iter().zip(own) {
            out[pick] = own;
        }
    }

    fn rates_over(&self, path: &[ExpansionOver], u: &[f64], orders: usize, out: &mut [RateOver]) -> bool {
        let Some(source) = self.source.predict() else { return false };
        let mut own = [[Interval::ALL; EXPANSION_ORDERS - 1]; MAX_PICKED];
        let n = self.picks.len();
        let known = source.rates_over(&self.picked_over(path)[..n], u, orders, &mut own[..n]);
        out.fill([Interval::from(0.0); EXPANSION_ORDERS - 1]);
        for (&pick, own) in self.picks.iter().zip(own) {
            out[pick] = own;
        }
        known
    }

    fn value_over(&self, time: Interval, path: &[ExpansionOver]) -> Option<Interval> {
        self.source.predict()?.value_over(time, &self.picked_over(path)[..self.picks.len()])
    }

    fn last_over(&self, time: Interval, path: &[ExpansionOver]) -> Option<Interval> {
        self.source.predict()?.last_over(time, &self.picked_over(path)[..self.picks.len()])
    }

    fn lowest_held(&self, t: f64, x: &[f64], u: &[f64], duration: f64, wanted: f64) -> Option<f64> {
        let own = &self.picked(x)[..self.picks.len()];
        self.source.predict()?.lowest_held(t, own, u, duration, wanted)
    }

    fn is_still(&self, x: &[f64]) -> Option<bool> {
        self.source.predict()?.is_still(&self.picked(x)[..self.picks.len()])
    }

    fn lowest_from(&self, t: f64, x: &[f64]) -> Option<f64> {
        self.source.predict()?.lowest_from(t, &self.picked(x)[..self.picks.len()])
    }

    fn value(&self, t: f64, x: &[f64]) -> f64 {
        let Some(source) = self.source.predict() else { return f64::NAN };
        source.value(t, &self.picked(x)[..self.picks.len()])
    }

    fn value_along(&self, t: f64, path: &[Expansion], out: &mut Expansion) {
        let Some(source) = self.source.predict() else { return };
        let mut own = [[0.0; EXPANSION_ORDERS]; MAX_PICKED];
        for (own, &pick) in own.iter_mut().zip(&self.picks) {
            *own = path[pick];
        }
        source.value_along(t, &own[..self.picks.len()], out);
    }
}

impl Directional for Embedded {
    fn evaluate_directional(&self, t: f64, x: &[f64], u: &[f64], direction: Direction, out: &mut Ahead) {
        let Some(source) = self.source.directional() else { return };
        let (n, [x, dx]) = (self.picks.len(), [x, direction.x].map(|all| self.picked(all)));
        source.evaluate_directional(t, &x[..n], u, Direction { x: &dx[..n], ..direction }, out);
    }
}

impl PredictDirectional for Embedded {
    fn flow_directional(&self, x: &mut [f64], dx: &mut [f64], u: &[f64], duration: f64) {
        let Some(source) = self.source.predict_directional() else { return };
        let (n, [mut own, mut own_dx]) = (self.picks.len(), [&*x, &*dx].map(|all| self.picked(all)));
        source.flow_directional(&mut own[..n], &mut own_dx[..n], u, duration);
        self.put_back(&own, x);
        self.put_back(&own_dx, dx);
    }

    fn ahead_directional(
        &self,
        t: f64,
        x: &[f64],
        u: &[f64],
        direction: Direction,
        duration: f64,
        out: &mut Ahead,
    ) {
        let Some(source) = self.source.predict_directional() else { return };
        let (n, [x, dx]) = (self.picks.len(), [x, direction.x].map(|all| self.picked(all)));
        source.ahead_directional(t, &x[..n], u, Direction { x: &dx[..n], ..direction }, duration, out);
    }
}

/// `source` as one of a filter with `state_dim` states: its own states are those numbered `picks`, counted from 0, in that
/// order. For barriers that need different parts of a long state.
///
/// # Errors
///
/// The number of picks differs from the source's number of states; there are more than 32; or one is not a state.
pub fn embedded(
    source: Box<dyn DerivativeSource>,
    state_dim: usize,
    picks: &[usize],
) -> Result<Box<dyn DerivativeSource>, Error> {
    length("picks", picks.len(), source.state_dim())?;
    if picks.len() > MAX_PICKED {
        let message = format!("has {} components, must have at most {MAX_PICKED}", picks.len());
        return Err(Error::new(ErrorKind::Dimension, "picks", message));
    }
    if let Some(i) = picks.iter().position(|&pick| pick >= state_dim) {
        let message = format!("is {}, must be < {state_dim}, the number of states", picks[i]);
        return Err(Error::new(ErrorKind::Range, format!("picks[{}]", i + 1), message));
    }
    if picks.iter().copied().eq(0..state_dim) {
        // All states in order: nothing to pick.
        return Ok(source);
    }
    Ok(Box::new(Embedded { source, state_dim, picks: picks.to_vec() }))
}
