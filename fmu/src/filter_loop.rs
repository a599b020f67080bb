//! A filter as a configuration describes it: plain, with plans, or with the integrator of an input.

use punctual_core::Error;
use punctual_core::filter::{
    AssuredFilter, Commitment, FilterState, IntegratedFilter, NoDerivative, Reason, Report, SafetyFilter,
    SampleDerivative, Standing,
};
use punctual_core::lie::Direction;
use punctual_core::plan::{Failure, Witness};
use punctual_reference::effort::InLoop;

/// The filter of a loop.
pub enum FilterLoop {
    /// Inputs are those of the plant.
    Plain(SafetyFilter),
    /// The same, with a plan behind every input.
    Assured(Box<AssuredFilter>),
    /// One input is integrated.
    Integrated(IntegratedFilter),
}

/// All that a loop remembers between samples.
#[derive(Debug, Default, PartialEq)]
pub struct LoopState {
    /// The states of the promises.
    pub filter: FilterState,
    /// The integrated input; 0 where there is none.
    pub integrated: f64,
    /// The plan, where one is followed.
    pub commitment: Option<Commitment>,
}

impl Clone for LoopState {
    fn clone(&self) -> Self {
        Self { filter: self.filter.clone(), integrated: self.integrated, commitment: self.commitment.clone() }
    }

    /// Reuses the memory, which a derived `Clone` would not.
    fn clone_from(&mut self, source: &Self) {
        self.filter.clone_from(&source.filter);
        self.integrated = source.integrated;
        self.commitment.clone_from(&source.commitment);
    }
}

impl FilterLoop {
    /// The filter itself, on the rate of an integrated input.
    pub fn filter(&self) -> &SafetyFilter {
        match self {
            Self::Plain(filter) => filter,
            Self::Assured(assured) => assured.filter(),
            Self::Integrated(integrated) => integrated.filter(),
        }
    }

    /// Status of the guarantee, and why there is no plan, where plans are followed.
    pub fn standing(&self) -> Option<(Standing, Option<Failure>)> {
        match self {
            Self::Assured(assured) => Some((assured.assurance().standing, assured.assurance().failure)),
            Self::Plain(_) | Self::Integrated(_) => None,
        }
    }

    /// The time in s until which the guarantee holds, infinite for ever, where it does.
    pub fn assured_until(&self) -> Option<f64> {
        match self {
            Self::Assured(assured) => assured.assurance().until,
            Self::Plain(_) | Self::Integrated(_) => None,
        }
    }

    /// Why u_ref was changed, where plans are followed and it was.
    pub fn reason(&self) -> Option<Reason> {
        match self {
            Self::Assured(assured) => assured.assurance().reason,
            Self::Plain(_) | Self::Integrated(_) => None,
        }
    }

    /// The plan that keeps the promise after the last step, where there is one.
    pub fn plan(&self) -> Option<&Witness> {
        match self {
            Self::Assured(assured) => assured.plan(),
            Self::Plain(_) | Self::Integrated(_) => None,
        }
    }

    /// How long in s the last input was held, as far as it is known.
    pub fn last_hold(&self) -> Option<f64> {
        match self {
            Self::Assured(assured) => assured.last_hold(),
            Self::Plain(_) | Self::Integrated(_) => self.filter().state().period,
        }
    }

    /// The number of the input that is integrated, if one is.
    pub fn integrated_input(&self) -> Option<usize> {
        match self {
            Self::Plain(_) => None,
            Self::Assured(assured) => assured.integrated_input(),
            Self::Integrated(integrated) => Some(integrated.input()),
        }
    }

    /// The integral of that input after the last step; 0 where there is none.
    pub fn integrated(&self) -> f64 {
        match self {
            Self::Plain(_) => 0.0,
            Self::Assured(assured) => assured.value(),
            Self::Integrated(integrated) => integrated.value(),
        }
    }

    /// Puts back an [integral](Self::integrated).
    pub fn set_integrated(&mut self, value: f64) {
        match self {
            Self::Plain(_) => {}
            Self::Assured(assured) => assured.set_value(value),
            Self::Integrated(integrated) => integrated.set_value(value),
        }
    }

    /// [`SafetyFilter::step`]; the input is held for `hold` seconds, > 0, where it is integrated or has a plan behind it.
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
            Self::Assured(assured) => {
                assured.expect_hold(Some(hold))?;
                assured.step(t, x, u_ref, u)?;
                Ok(assured.report())
            }
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
            Self::Assured(assured) => {
                assured.expect_hold(Some(hold))?;
                assured.peek(t, x, u_ref, u)?;
                Ok(assured.next_value())
            }
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
            Self::Assured(assured) => {
                assured.expect_hold(Some(hold))?;
                assured.differentiate(t, x, u_ref, direction, out)
            }
            Self::Integrated(integrated) => integrated.differentiate(t, hold, x, u_ref, direction, out),
        }
    }

    /// Restarts every deadline; the integral stays.
    pub fn rearm(&mut self) {
        match self {
            Self::Plain(filter) => filter.rearm(),
            Self::Assured(assured) => assured.rearm(),
            Self::Integrated(integrated) => integrated.rearm(),
        }
    }

    /// What is remembered.
    pub fn state(&self) -> LoopState {
        let mut state = LoopState::default();
        self.save(&mut state);
        state
    }

    /// Writes what is remembered to `state`; only a plan allocates.
    pub fn save(&self, state: &mut LoopState) {
        state.filter.clone_from(self.filter().state());
        state.integrated = self.integrated();
        match self {
            Self::Assured(assured) => match &mut state.commitment {
                Some(commitment) => commitment.clone_from(assured.commitment()),
                none => *none = Some(assured.commitment().clone()),
            },
            Self::Plain(_) | Self::Integrated(_) => state.commitment = None,
        }
    }

    /// Puts back what [`Self::save`] wrote.
    ///
    /// # Errors
    ///
    /// The state of another filter.
    pub fn restore(&mut self, state: &LoopState) -> Result<(), Error> {
        match self {
            Self::Plain(filter) => filter.restore(&state.filter),
            Self::Assured(assured) => {
                let blank = Commitment::default();
                assured.restore(&state.filter, state.commitment.as_ref().unwrap_or(&blank))?;
                assured.set_value(state.integrated);
                Ok(())
            }
            Self::Integrated(own) => own.restore(&state.filter, state.integrated),
        }
    }
}

impl InLoop for FilterLoop {
    fn sample(
        &mut self,
        t: f64,
        hold: f64,
        x: &[f64],
        u_ref: &[f64],
        u: &mut [f64],
    ) -> Result<&Report, Error> {
        self.step(t, hold, x, u_ref, u)
    }

    fn filter(&self) -> &SafetyFilter {
        Self::filter(self)
    }
}
