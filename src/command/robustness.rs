//! What the plan bears of a plant that is not the model: `check --robustness`.

use punctual_cosim::error::Error;
use punctual_fmu::configuration::{FilterConfiguration, over_seconds};
use serde::Serialize;

use crate::output::{self, number_below};

/// How much of each kind of uncertainty the plan from a start bears, each alone and beside what is declared.
#[derive(Serialize)]
pub(super) struct RobustnessReport {
    /// By state: what may be added to its rate, and the unit.
    rates: Vec<(String, f64, String)>,
    /// By state: how far it may be from its measured value, and the unit.
    measurement_errors: Vec<(String, f64, String)>,
    /// By input: the part that may be missing or too much.
    gains: Vec<(String, f64)>,
}

impl RobustnessReport {
    /// The finding for the start `x0`; `None` without a plan, or where plans do not account for uncertain plants.
    ///
    /// # Errors
    ///
    /// A configuration that cannot be built.
    pub(super) fn of(c: &FilterConfiguration, x0: &[f64]) -> Result<Option<Self>, Error> {
        let Ok(filter) = c.assured(c.build()?) else { return Ok(None) };
        let planning = filter.planning();
        let Some(bears) = planning.and_then(|own| own.bears(c.experiment.start_time, &c.measured(x0))) else {
            return Ok(None);
        };
        let by_state = |sizes: Vec<f64>, degree: usize| {
            let sized = c.plant.states().into_iter().zip(sizes);
            sized.map(|(state, size)| (state.name, size, over_seconds(&state.unit, degree))).collect()
        };
        Ok(Some(Self {
            rates: by_state(bears.rates, 1),
            measurement_errors: by_state(bears.errors, 0),
            gains: c.plant.inputs().into_iter().map(|input| input.name).zip(bears.gains).collect(),
        }))
    }

    pub(super) fn text(&self) -> String {
        let sizes = |sizes: &[(String, f64, String)]| {
            let each = sizes.iter().map(|(name, size, unit)| {
                let size: f64 = number_below(*size).parse().unwrap_or(*size);
                format!("{name} {}", output::quantity(size, unit))
            });
            each.collect::<Vec<_>>().join(", ")
        };
        let gains = self.gains.iter().map(|(name, part)| format!("{name} {} %", number_below(100.0 * part)));
        let gains = gains.collect::<Vec<_>>().join(", ");
        format!(
            "\nthe plan bears at least, each alone:\n  added to a rate    {}\n  measurement error  {}\n  too much or less   {gains}",
            sizes(&self.rates),
            sizes(&self.measurement_errors)
        )
    }
}
