//! A source of derivatives that knows some of the filter's states.

use alloc::boxed::Box;
use alloc::vec::Vec;

use super::{Ahead, DerivativeSource, Derivatives};
use crate::error::{Error, ErrorKind, length};

/// Most states that a picked source may have.
const MAX_PICKED: usize = 32;

struct Embedded {
    source: Box<dyn DerivativeSource>,
    state_dim: usize,
    picks: Vec<usize>,
}

impl Embedded {
    fn picked(&self, x: &[f64], buffer: &mut [f64; MAX_PICKED]) {
        for (slot, &pick) in buffer.iter_mut().zip(&self.picks) {
            *slot = x[pick];
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
        let mut own = [0.0; MAX_PICKED];
        self.picked(x, &mut own);
        self.source.evaluate(t, &own[..self.picks.len()], out);
    }

    fn predict(&self, x: &mut [f64], u: &[f64], duration: f64) -> bool {
        let mut own = [0.0; MAX_PICKED];
        self.picked(x, &mut own);
        let known = self.source.predict(&mut own[..self.picks.len()], u, duration);
        for (&pick, value) in self.picks.iter().zip(own) {
            x[pick] = value;
        }
        known
    }

    fn ahead(&self, t: f64, x: &[f64], u: &[f64], duration: f64, out: &mut Ahead) -> bool {
        let mut own = [0.0; MAX_PICKED];
        self.picked(x, &mut own);
        self.source.ahead(t, &own[..self.picks.len()], u, duration, out)
    }

    fn ahead_along(
        &self,
        t: f64,
        state: [&[f64]; 2],
        input: [&[f64]; 2],
        duration: f64,
        out: &mut Ahead,
    ) -> bool {
        let mut own = [[0.0; MAX_PICKED]; 2];
        for (own, all) in own.iter_mut().zip(state) {
            self.picked(all, own);
        }
        let own = own.each_ref().map(|own| &own[..self.picks.len()]);
        self.source.ahead_along(t, own, input, duration, out)
    }

    fn predict_along(&self, x: &mut [f64], dx: &mut [f64], u: &[f64], duration: f64) -> bool {
        let mut own = [[0.0; MAX_PICKED]; 2];
        for (own, all) in own.iter_mut().zip([&*x, &*dx]) {
            self.picked(all, own);
        }
        let [own_x, own_dx] = &mut own;
        let n = self.picks.len();
        let known = self.source.predict_along(&mut own_x[..n], &mut own_dx[..n], u, duration);
        for (i, &pick) in self.picks.iter().enumerate() {
            (x[pick], dx[pick]) = (own_x[i], own_dx[i]);
        }
        known
    }

    fn highest(&self, t: f64, x: &[f64], bounds: [&[f64]; 2], time: [f64; 2]) -> Option<f64> {
        let mut own = [0.0; MAX_PICKED];
        self.picked(x, &mut own);
        self.source.highest(t, &own[..self.picks.len()], bounds, time)
    }
}

/// `source` as one of a filter with `state_dim` states: its own states are those numbered `picks`, counted
/// from 0, in that order. For barriers that need different parts of a long state.
///
/// # Errors
///
/// Not as many picks as the source has states, more than 32 of them, one that is not a state.
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
    Ok(Box::new(Embedded { source, state_dim, picks: picks.to_vec() }))
}
