//! A filter as a configuration describes it: plain, or with the integrator of an input.

use punctual_core::Error;
use punctual_core::filter::{
    FilterState, IntegratedFilter, NoDerivative, Report, SafetyFilter, SampleDerivative,
};
use punctual_core::lie::Direction;

/// The filter of a loop.
pub enum FilterLoop {
    /// Inputs are those of the plant.
    Plain(SafetyFilter),
    /// One input is integrated.
    Integrated(IntegratedFilter),
}

impl FilterLoop {
    /// The filter itself, on the rate of an integrated input.
    pub fn filter(&self) -> &SafetyFilter {
        match self {
            Self::Plain(filter) => filter,
            Self::Integrated(integrated) => integrated.filter(),
        }
    }

    /// The number of the input that is integrated, if one is.
    pub fn integrated_input(&self) -> Option<usize> {
        match self {
            Self::Plain(_) => None,
            Self::Integrated(integrated) => Some(integrated.input()),
        }
    }

    /// The integral of that input after the last step; 0 where there is none.
    pub fn integrated(&self) -> f64 {
        match self {
            Self::Plain(_) => 0.0,
            Self::Integrated(integrated) => integrated.value(),
        }
    }

    /// Puts back an [integral](Self::integrated).
    pub fn set_integrated(&mut self, value: f64) {
        match self {
            Self::Plain(_) => {}
            Self::Integrated(integrated) => integrated.set_value(value),
        }
    }

    /// [`SafetyFilter::step`]; an integrated input is held for `hold` seconds, > 0.
    ///
    /// # Errors
    ///
    /// A slice of the wrong length; a time to hold that is out of range.
    pub fn step(
        &mut self,
        t: f64,
        hold: f64,
        x: &[f64],
        u_ref: &[f64],
        u: &mut [f64],
    ) -> Result<&Report, Error> {
        match self {
            Self::Plain(filter) => filter.step(t, x, u_ref, u),
            Self::Integrated(integrated) => integrated.step(t, hold, x, u_ref, u),
        }
    }

    /// The input of [`Self::step`], and the integral after it, without remembering the sample.
    ///
    /// # Errors
    ///
    /// As for [`Self::step`].
    pub fn peek(&mut self, t: f64, hold: f64, x: &[f64], u_ref: &[f64], u: &mut [f64]) -> Result<f64, Error> {
        match self {
            Self::Plain(filter) => filter.peek(t, x, u_ref, u).map(|_| 0.0),
            Self::Integrated(integrated) => integrated.peek(t, hold, x, u_ref, u),
        }
    }

    /// [`SafetyFilter::differentiate`] of the result of [`Self::peek`].
    ///
    /// # Errors
    ///
    /// As for [`Self::step`]; a direction that is not finite.
    pub fn differentiate(
        &mut self,
        t: f64,
        hold: f64,
        x: &[f64],
        u_ref: &[f64],
        direction: Direction,
        out: &mut SampleDerivative,
    ) -> Result<Option<NoDerivative>, Error> {
        match self {
            Self::Plain(filter) => filter.differentiate(t, x, u_ref, direction, out),
            Self::Integrated(integrated) => integrated.differentiate(t, hold, x, u_ref, direction, out),
        }
    }

    /// Starts every deadline anew; the integral stays.
    pub fn rearm(&mut self) {
        match self {
            Self::Plain(filter) => filter.rearm(),
            Self::Integrated(integrated) => integrated.rearm(),
        }
    }

    /// Puts back the state of the [filter](Self::filter) and the [integral](Self::integrated).
    ///
    /// # Errors
    ///
    /// A state with another number of barriers.
    pub fn restore(&mut self, state: &FilterState, integrated: f64) -> Result<(), Error> {
        match self {
            Self::Plain(filter) => filter.restore(state),
            Self::Integrated(own) => own.restore(state, integrated),
        }
    }
}
