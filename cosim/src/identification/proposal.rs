//! The proposal: what a filter's file should declare of a recorded plant.

use punctual_core::elementary::{log10, powi};
use punctual_fmu::configuration::{FilterConfiguration, over_seconds};
use serde::Serialize;

use super::arrival::Arrival;
use super::explanation::{Difference, difference};
use super::fit::Fitting;
use super::linear::Predictor;
use super::membership::{self, Bounds};
use super::record::Record;
use super::search::{DEVIATIONS, Spread, fit};
use super::sizes::{Program, Sizes, worst};
use super::windows::Windows;
use crate::error::Error;

/// Rates below this part of a state's own are left out: what they lead to in a second is nothing that a plan notices.
const RESOLUTION: f64 = 1e-5;
/// A gain below it is not proposed: the input does nothing, or the contrary.
const LEAST_GAIN: f64 = 0.05;

/// What a finding is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// `actuation_delay`.
    Delay,
    /// A lag of an input.
    Lag,
    /// A gain of an input.
    Gain,
    /// A rate of a state.
    Rate,
    /// An error of a measured state.
    Error,
}

/// One value to declare.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// What it is about.
    pub kind: Kind,
    /// The state or input; empty for the delay.
    pub name: String,
    /// The unit.
    pub unit: String,
    /// What to declare: both ends of an interval, or one size twice.
    pub declared: [f64; 2],
    /// What the recording shows, without a factor.
    pub found: [f64; 2],
    /// The same if the worst hold in a thousand is left out, where that makes a difference.
    pub without_worst: Option<[f64; 2]>,
    /// The instant in s that determined it, and the length of the window in s; `None` if the whole recording did.
    pub instant: Option<[f64; 2]>,
}

impl Finding {
    /// Its key in a filter's file, in dotted form.
    pub fn key(&self) -> String {
        let name = &self.name;
        match self.kind {
            Kind::Delay => "actuation_delay".to_owned(),
            Kind::Lag => format!("uncertainty.inputs.{name}.lag"),
            Kind::Gain => format!("uncertainty.inputs.{name}.gain"),
            Kind::Rate => format!("uncertainty.rates.{name}"),
            Kind::Error => format!("measurement_errors.{name}"),
        }
    }

    /// Whether it is an interval.
    pub fn is_interval(&self) -> bool {
        matches!(self.kind, Kind::Lag | Kind::Gain)
    }

    /// `values` as the file has them.
    pub fn shown(&self, values: [f64; 2]) -> String {
        let [least, most] = values;
        if self.is_interval() { format!("[{least:?}, {most:?}]") } else { format!("{most:?}") }
    }
}

/// What to declare of a plant.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Proposal {
    /// The values to declare; nothing if the plant is the model, as far as the recording shows.
    pub findings: Vec<Finding>,
    /// The factor by which what was found is widened.
    pub factor: f64,
    /// Holds between samples.
    pub holds: usize,
    /// Holds that what is declared explains.
    pub explained: usize,
    /// The recorded time in s.
    pub duration: f64,
    /// The time between two samples in s.
    pub period: f64,
    /// By state, what a rate has to exceed to be proposed, in the unit of the state per s.
    pub resolution: Vec<(String, f64, String)>,
    /// By state, its least and largest recorded value, and the unit: of what is beyond nothing is known.
    pub ranges: Vec<(String, [f64; 2], String)>,
    /// What the difference looks like.
    pub difference: Difference,
    /// By input, the part of its bounds that was used.
    pub excited: Vec<(String, f64)>,
    /// What the user should know of the recording.
    pub notes: Vec<String>,
}

/// Proposes what the file of `c` should declare of the plant in `record`. `factor` (≥ 1) widens what was found.
///
/// # Errors
///
/// A file without a model, or with an `[integrator]`, for which nothing can be declared; a model that does not hold where the
/// recording is.
pub fn identify(c: &FilterConfiguration, record: &Record, factor: f64) -> Result<Proposal, Error> {
    check(c)?;
    let plant = c.plant.build()?;
    let model = Predictor::new(&*plant, record.period, c.run.integration.inner_step);
    let mut notes = record.notes.clone();
    // Delay, lags and gains.
    let longest = super::longest(record, c.experiment.step_size);
    let (mut arrival, spread) = fit(&model, record, longest)?;
    for (input, gain) in record.inputs.iter().zip(&mut arrival.gains) {
        if *gain < LEAST_GAIN {
            notes.push(format!(
                "{} seems to act with the factor {}: is its sign or its column the right one?",
                input.name,
                punctual_fmu::text::number(*gain)
            ));
            *gain = 1.0;
        }
    }
    // What the intervals of lags do not cover is explained by errors, rates and widths of the gains: for all holds, and without the
    // worst.
    let fitting = Fitting::new(&model, record, &arrival, Some(1))?;
    let (linear, scales) = (&fitting.linear, &fitting.scales);
    let effects = linear.effects(&linear.arriving);
    let ends: Vec<[Ends; 2]> = (0..record.inputs.len()).map(|j| ends(&arrival, &spread, j, factor)).collect();
    let covered = covered(&fitting, &arrival, &ends);
    let windows = Windows::new(linear, &effects, &covered);
    let program = Program::new(&windows, linear, &effects, scales, RESOLUTION);
    let all = program.solve(&vec![false; linear.holds.len()]);
    let most = program.solve(&worst(linear, scales));
    // Declare it, and check that this contains the recording.
    let mut bounds = bounds(&arrival, &ends, &all, factor);
    let least: Vec<f64> = scales.iter().map(|scale| RESOLUTION * scale).collect();
    prune(&model, record, &mut bounds, scales)?;
    let mut checked = membership::check(&model, record, &bounds)?;
    const ROUNDS: usize = 3;
    for _ in 0..ROUNDS {
        let lacks: Vec<bool> =
            checked.missing.iter().zip(&least).map(|(missing, least)| missing > least).collect();
        if !lacks.contains(&true) {
            break;
        }
        for (i, rate) in bounds.rates.iter_mut().enumerate().filter(|(i, _)| lacks[*i]) {
            *rate = up(*rate + checked.missing[i]);
        }
        checked = membership::check(&model, record, &bounds)?;
    }
    // What lacks less than the resolution is explained.
    let within = checked.missing.iter().zip(&least).all(|(missing, least)| missing <= least);
    let explained = if within { record.holds() } else { checked.explained };
    let resolution = record.states.iter().zip(&least);
    let used = |(j, input): (usize, &punctual_fmu::configuration::VariableSection)| {
        let [min, max] = record.input_range(j);
        let width = c.limits(&input.name).map_or(max - min, |[low, high]| high - low);
        (input.name.clone(), if width > 0.0 { ((max - min) / width).clamp(0.0, 1.0) } else { 0.0 })
    };
    Ok(Proposal {
        findings: findings(record, &bounds, (&arrival, &spread), (&all, &most)),
        factor,
        holds: record.holds(),
        explained,
        duration: record.duration(),
        period: record.period,
        resolution: resolution.map(|(s, least)| (s.name.clone(), *least, over_seconds(&s.unit, 1))).collect(),
        ranges: record
            .states
            .iter()
            .enumerate()
            .map(|(i, s)| (s.name.clone(), record.state_range(i), s.unit.clone()))
            .collect(),
        difference: difference(c, record)?,
        excited: record.inputs.iter().enumerate().map(used).collect(),
        notes,
    })
}

/// Refuses a file for which nothing can be declared.
///
/// # Errors
///
/// One without a model, or with an `[integrator]`, behind which plans account for no uncertainty.
pub fn check(c: &FilterConfiguration) -> Result<(), Error> {
    if let Some(barrier) = c.external() {
        let message = format!(
            "has inputs alone, since {} is external: without a model nothing can be compared",
            barrier.name
        );
        return Err(Error::configuration("plant", message));
    }
    if c.integrator.is_some() {
        let message =
            "behind it nothing can be declared of the plant: plans do not account for [uncertainty] there";
        return Err(Error::configuration("integrator", message));
    }
    Ok(())
}

/// The ends of an interval.
type Ends = [f64; 2];

/// The lag and the gain of input `j`, as intervals: each keeps a distance of `factor` − 1 of itself, or of its difference from 1, and of what
/// noise hides.
fn ends(arrival: &Arrival, spread: &Spread, j: usize, factor: f64) -> [Ends; 2] {
    let (lag, gain) = (arrival.lags[j], arrival.gains[j]);
    let wide = (factor - 1.0) * lag + factor * DEVIATIONS * spread.lags[j];
    let half = (factor * DEVIATIONS * spread.gains[j]).max((factor - 1.0) * (gain - 1.0).abs());
    let lags = if lag == 0.0 { [0.0; 2] } else { [(lag - wide).max(0.0), lag + wide] };
    [lags, [(gain - half).max(LEAST_GAIN), gain + half]]
}

/// How much of each residual the intervals of lags in `ends` explain, by hold and state. Those of gains are left to explain what is not
/// known of gains, since a wind would hide in them wherever inputs are large.
fn covered(fitting: &Fitting<'_>, arrival: &Arrival, ends: &[[Ends; 2]]) -> Vec<f64> {
    let mut covered = vec![0.0; fitting.linear.holds.len() * fitting.linear.states];
    for (j, [lags, _]) in ends.iter().enumerate().filter(|(_, [lags, _])| lags[0] < lags[1]) {
        let [fast, slow] = lags.map(|lag| fitting.effect(j, arrival.delay, lag, arrival.before));
        let of_lag = fast.iter().zip(&slow).map(|(fast, slow)| 0.5 * arrival.gains[j] * (fast - slow).abs());
        covered.iter_mut().zip(of_lag).for_each(|(covered, part)| *covered += part);
    }
    covered
}

/// What is declared: what was found, times `factor`, rounded outward.
fn bounds(arrival: &Arrival, ends: &[[Ends; 2]], sizes: &Sizes, factor: f64) -> Bounds {
    let gain = |(j, [_, [least, most]]): (usize, &[Ends; 2])| {
        let more = (factor * sizes.gains[j] - 0.5 * (most - least)).max(0.0);
        if *least == 1.0 && *most == 1.0 && more == 0.0 {
            [1.0; 2]
        } else {
            [down((least - more).max(LEAST_GAIN)), up(most + more)]
        }
    };
    Bounds {
        // To a part of a step that no rate shows: there is no safe side to round it to.
        delay: rounded(arrival.delay, 4, f64::round),
        lags: ends.iter().map(|[[least, most], _]| [down(*least), up(*most)]).collect(),
        gains: ends.iter().enumerate().map(gain).collect(),
        rates: sizes.rates.iter().map(|rate| up(factor * rate)).collect(),
        errors: sizes.errors.iter().map(|error| up(factor * error)).collect(),
    }
}

/// Leaves out rates that the intervals of lags and gains cover.
fn prune(model: &Predictor<'_>, record: &Record, bounds: &mut Bounds, scales: &[f64]) -> Result<(), Error> {
    /// Only those below this part of the state's own rates, since membership looks at single holds.
    const SMALL: f64 = 0.01;
    let mut fewer = bounds.clone();
    for (rate, scale) in fewer.rates.iter_mut().zip(scales) {
        if *rate < SMALL * scale {
            *rate = 0.0;
        }
    }
    if fewer != *bounds && membership::check(model, record, &fewer)?.explained == record.holds() {
        *bounds = fewer;
    }
    Ok(())
}

/// The findings of what is declared, in the order in which they are read.
fn findings(
    record: &Record,
    bounds: &Bounds,
    (arrival, spread): (&Arrival, &Spread),
    (all, most): (&Sizes, &Sizes),
) -> Vec<Finding> {
    let (n, m) = (record.states.len(), record.inputs.len());
    let mut findings = Vec::new();
    let instant = |v: usize| all.instants[v].map(|(time, holds)| [time, holds as f64 * record.period]);
    let differs = |found: [f64; 2], without: [f64; 2]| {
        let [wide, narrow] =
            [found, without].map(|ends| if ends[0] == ends[1] { ends[1] } else { ends[1] - ends[0] });
        // Less is not seen in four digits.
        (wide - narrow > 1e-3 * wide).then_some(without)
    };
    if bounds.delay > 0.0 {
        findings.push(Finding {
            kind: Kind::Delay,
            name: String::new(),
            unit: "s".to_owned(),
            declared: [bounds.delay; 2],
            found: [arrival.delay; 2],
            without_worst: None,
            instant: None,
        });
    }
    for (j, input) in record.inputs.iter().enumerate() {
        if bounds.lags[j] != [0.0; 2] {
            let half = DEVIATIONS * spread.lags[j];
            findings.push(Finding {
                kind: Kind::Lag,
                name: input.name.clone(),
                unit: "s".to_owned(),
                declared: bounds.lags[j],
                found: [(arrival.lags[j] - half).max(0.0), arrival.lags[j] + half],
                without_worst: None,
                instant: None,
            });
        }
        if bounds.gains[j] != [1.0; 2] {
            let around = |width: f64| {
                let half = width.max(DEVIATIONS * spread.gains[j]);
                [arrival.gains[j] - half, arrival.gains[j] + half]
            };
            let found = around(all.gains[j]);
            findings.push(Finding {
                kind: Kind::Gain,
                name: input.name.clone(),
                unit: "1".to_owned(),
                declared: bounds.gains[j],
                found,
                without_worst: differs(found, around(most.gains[j])),
                instant: instant(2 * n + j),
            });
        }
    }
    debug_assert_eq!(all.instants.len(), 2 * n + m, "an instant for each size");
    for (i, state) in record.states.iter().enumerate() {
        let mut add = |kind: Kind, unit: String, declared: f64, found: [f64; 2], v: usize| {
            if declared > 0.0 {
                findings.push(Finding {
                    kind,
                    name: state.name.clone(),
                    unit,
                    declared: [declared; 2],
                    found: [found[0]; 2],
                    without_worst: differs([found[0]; 2], [found[1]; 2]),
                    instant: instant(v),
                });
            }
        };
        add(Kind::Rate, over_seconds(&state.unit, 1), bounds.rates[i], [all.rates[i], most.rates[i]], n + i);
        add(Kind::Error, state.unit.clone(), bounds.errors[i], [all.errors[i], most.errors[i]], i);
    }
    findings.sort_by_key(|finding| match finding.kind {
        Kind::Delay => 0,
        Kind::Lag | Kind::Gain => 1,
        Kind::Rate => 2,
        Kind::Error => 3,
    });
    findings
}

/// The number of three significant digits at or next above `value` ≥ 0.
fn up(value: f64) -> f64 {
    rounded(value, 2, |digits| (digits - 1e-6).ceil())
}

/// The same at or next below.
fn down(value: f64) -> f64 {
    rounded(value, 2, |digits| (digits + 1e-6).floor())
}

/// `value` with `more` digits after the first one.
fn rounded(value: f64, more: i32, round: impl Fn(f64) -> f64) -> f64 {
    if value <= 0.0 || !value.is_finite() {
        return value.max(0.0);
    }
    let exponent = log10(value).floor() as i32 - more;
    let digits = round(value * powi(10.0, -exponent));
    // The shortest text of it, rather than what the product is.
    format!("{digits}e{exponent}").parse().unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_rounded_outward() {
        for (value, below, above) in [
            (0.12345, 0.123, 0.124),
            (0.1, 0.1, 0.1),
            (0.9999, 0.999, 1.0),
            (1234.0, 1230.0, 1240.0),
            (0.0, 0.0, 0.0),
        ] {
            assert_eq!((down(value), up(value)), (below, above), "{value}");
        }
    }
}
