//! How much a plan bears of a plant that is not the model, and with how much less declared a refused promise would be kept.

use punctual_core::filter::{Bears, Filter, Remedy, UncertaintyKind};
use punctual_fmu::configuration::{FilterConfiguration, over_seconds};
use serde::Serialize;

use crate::output::{self, number_below};

/// How much of each kind of uncertainty a plan from the start bears if it is declared, each alone.
#[derive(Serialize)]
pub(super) struct RobustnessReport {
    /// By state: what may be added to its rate, and the unit.
    rates: Vec<(String, f64, String)>,
    /// By state: how far it may be from its measured value, and the unit.
    measurement_errors: Vec<(String, f64, String)>,
    /// By input: the part that may be missing or too much.
    gains: Vec<(String, f64)>,
    /// By input: the time constant in s with which it may be followed.
    lags: Vec<(String, f64)>,
    /// The time in s by which inputs may be late, at most 16 steps; `null` if a delay is declared.
    delay: Option<f64>,
    /// The same in steps.
    #[serde(skip)]
    steps: f64,
}

impl RobustnessReport {
    /// The finding `bears` in the names and units of `c`.
    pub(super) fn new(c: &FilterConfiguration, bears: &Bears) -> Self {
        let by_state = |sizes: &[f64], degree: usize| {
            let sized = c.plant.states().into_iter().zip(sizes);
            sized.map(|(state, size)| (state.name, *size, over_seconds(&state.unit, degree))).collect()
        };
        let by_input = |sizes: &[f64]| {
            c.plant.inputs().into_iter().map(|input| input.name).zip(sizes.iter().copied()).collect()
        };
        Self {
            rates: by_state(&bears.rates, 1),
            measurement_errors: by_state(&bears.errors, 0),
            gains: by_input(&bears.gains),
            lags: by_input(&bears.lags),
            delay: bears.delay,
            steps: bears.delay.map_or(0.0, |delay| delay / c.experiment.step_size),
        }
    }

    pub(super) fn text(&self) -> String {
        let sizes = self.rates.iter().chain(&self.measurement_errors).map(|(_, size, _)| size);
        let parts = self.gains.iter().chain(&self.lags).map(|(_, part)| part);
        if sizes.chain(parts).all(|size| *size == 0.0) {
            return "the plan bears no plant that differs from the model, as far as a tube tells".to_owned();
        }
        let list = |each: Vec<String>| each.join(", ");
        let by_state = |sizes: &[(String, f64, String)]| {
            list(sizes.iter().map(|(name, size, unit)| format!("{name} {}", rounded(*size, unit))).collect())
        };
        let by_input = |sizes: &[(String, f64)], factor: f64, unit: &str| {
            list(
                sizes.iter().map(|(name, size)| format!("{name} {}", rounded(factor * size, unit))).collect(),
            )
        };
        let delay = self.delay.map(|delay| {
            let steps = match (self.steps + 1e-9) as u32 {
                0 => String::new(),
                1 => ", a step".to_owned(),
                steps => format!(", {steps} steps"),
            };
            format!("; delay {}{steps}", output::quantity(1e3 * delay, "ms"))
        });
        format!(
            "it bears at least, each alone and declared: rates {};\n  measurement errors {};\n  inputs {} too much or less; lags {}{}",
            by_state(&self.rates),
            by_state(&self.measurement_errors),
            by_input(&self.gains, 100.0, "%"),
            by_input(&self.lags, 1e3, "ms"),
            delay.unwrap_or_default()
        )
    }
}

/// `size` with two digits, rounded down, since it is no more exact.
fn rounded(size: f64, unit: &str) -> String {
    // Ten digits are more than are kept, so that round-off takes nothing away.
    let text = format!("{size:.9e}");
    let (digits, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    let two = (10.0 * digits.parse().unwrap_or(size)).floor() / 10.0;
    let down: f64 = format!("{two}e{exponent}").parse().unwrap_or(size);
    output::quantity(number_below(down).parse().unwrap_or(down), unit)
}

/// With how much less declared the promises from `x0` at `t` would be kept, in words.
pub(super) fn remedy(c: &FilterConfiguration, filter: &Filter, t: f64, x0: &[f64]) -> Option<String> {
    let Remedy { without, part, .. } = filter.planning()?.remedy(t, x0)?;
    let word = |kind: &UncertaintyKind| match kind {
        UncertaintyKind::Jitter => Some("jitter"),
        UncertaintyKind::Lags => Some("lags"),
        UncertaintyKind::Gains => Some("gains"),
        UncertaintyKind::Errors => Some("measurement_errors"),
        UncertaintyKind::Rates => Some("rates"),
        _ => None,
    };
    let kinds: Vec<_> = without.iter().filter_map(word).collect();
    let without = (!kinds.is_empty()).then(|| format!("without {}", kinds.join(", or without ")));
    let kinds = c.covered().len();
    let part = part.map(|part| match kinds {
        1 => format!("with {} % of what is declared", 100.0 * part),
        _ => format!("with {} % of all that is declared", 100.0 * part),
    });
    let ways: Vec<_> = without.into_iter().chain(part).collect();
    Some(format!("it would be kept {}", ways.join(", or ")))
}
