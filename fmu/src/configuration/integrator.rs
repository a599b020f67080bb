//! `[integrator]` of a filter: a state of its model that is commanded and not measured.

use punctual_core::filter::{Filter, Integration};
use punctual_models::mentions;
use serde::{Deserialize, Serialize};

use super::key::{
    Key, Section,
    Unit::{Is, Of},
    Value::{Name, Number},
};
use super::{ConfigurationError, Parameter, PlantSection, Range, UNBOUNDED};

/// `[integrator]`: dynamic extension inside the filter. The plant outside has this state of the filter's model for its
/// input; the filter solves for its rate and integrates that itself ([`Filter`]).
/// docs/configuration.md has ranges and defaults.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct IntegratorSection {
    /// The integrated state: one whose derivative is an input alone, such as `beta` of `bicycle_small_slip_rate`.
    /// Bounds of that input bound the rate.
    pub state: String,
    /// Rate in 1/s at which it follows `u_ref.<state>` where no constraint is in the way.
    #[serde(default = "gain")]
    pub gain: f64,
    /// Its smallest value, in its unit; none is -1e30.
    #[serde(default = "none_below")]
    pub min: f64,
    /// Its largest value; none is 1e30.
    #[serde(default = "none_above")]
    pub max: f64,
}

fn gain() -> f64 {
    2.0
}

fn none_below() -> f64 {
    -UNBOUNDED
}

fn none_above() -> f64 {
    UNBOUNDED
}

const GAIN: Range = Range::POSITIVE;
const LIMIT: Range = Range { min: Some(-UNBOUNDED), max: Some(UNBOUNDED) };

/// `[integrator]`.
pub(super) static SECTION: Section = Section {
    name: "integrator",
    keys: || {
        static KEYS: [Key; 4] = [
            Key::new("state", Name, None, "such as `delta` of `bicycle_kinematic`"),
            Key::new(
                "gain",
                Number(Is("1/s"), GAIN),
                Some("2"),
                "how fast it follows `u_ref.<state>` if no constraint interferes",
            ),
            Key::new("min", Number(Of("in its unit"), LIMIT), Some("none"), "its smallest value"),
            Key::new("max", Number(Of("in its unit"), LIMIT), Some("none"), "its largest value"),
        ];
        KEYS.iter().collect()
    },
};

impl IntegratorSection {
    /// Least and largest value of the state, infinite where there is none.
    pub(super) fn limits(&self) -> [f64; 2] {
        [self.min, self.max].map(|v| if v.abs() >= UNBOUNDED { v.signum() * f64::INFINITY } else { v })
    }

    /// The number of the state, and that of the input that is its rate.
    pub(super) fn place(&self, plant: &PlantSection) -> Result<(usize, usize), ConfigurationError> {
        let (states, inputs, derivatives) = (plant.states(), plant.inputs(), plant.derivatives());
        let rate = |i: usize| {
            let input = inputs.iter().position(|input| input.name == derivatives[i].trim())?;
            let name = &inputs[input].name;
            let alone = derivatives.iter().enumerate().all(|(k, text)| k == i || !mentions(text, name));
            alone.then_some(input)
        };
        let rates: Vec<_> = (0..derivatives.len()).filter_map(|i| Some((i, rate(i)?))).collect();
        if let Some(place) = rates.iter().find(|(i, _)| states[*i].name == self.state) {
            return Ok(*place);
        }
        let names: Vec<_> = rates.iter().map(|(i, _)| states[*i].name.as_str()).collect();
        let known = if names.is_empty() { "none here".to_owned() } else { names.join(", ") };
        let message = format!(
            "is {:?}, must be a state whose derivative is an input that moves nothing else: {known}",
            self.state
        );
        Err(ConfigurationError::new("integrator.state", message))
    }

    /// Puts it between `filter` and the plant outside.
    pub(super) fn put_before(
        &self,
        plant: &PlantSection,
        filter: Filter,
    ) -> Result<Filter, ConfigurationError> {
        let refused = |e: punctual_core::Error| {
            let field = match e.field() {
                "limits" => "integrator.min, integrator.max",
                "gain" => "integrator.gain",
                other => other,
            };
            ConfigurationError::new(field, e.message())
        };
        let (state, input) = self.place(plant)?;
        let of = Integration { state, input, limits: self.limits(), gain: self.gain };
        filter.with_integrator(of).map_err(refused)
    }

    /// Its numbers that are parameters of the FMU; `of` reaches it in a configuration.
    pub(super) fn parameters<C: 'static>(
        &self,
        plant: &PlantSection,
        of: fn(&mut C) -> Option<&mut Self>,
    ) -> Vec<Parameter<C>> {
        let state = plant.states().into_iter().find(|s| s.name == self.state);
        let (unit, description) = state.map_or_else(Default::default, |s| (s.unit, s.description));
        type Access = fn(&mut IntegratorSection) -> &mut f64;
        let row = |name: String, field: &str, unit: String, range, meaning: String, access: Access| {
            let names = (name, format!("integrator.{field}"));
            Parameter::new(names, unit, range, meaning, move |c: &mut C| of(c).map(access))
        };
        let (least, largest) = (format!("u_min.{}", self.state), format!("u_max.{}", self.state));
        let limit = |word: &str| format!("{word} {description} (no bound: {UNBOUNDED:e} in size)");
        let follows = format!("how fast the filter's {} follows what is wanted", self.state);
        vec![
            row(least, "min", unit.clone(), LIMIT, limit("smallest"), |i| &mut i.min),
            row(largest, "max", unit, LIMIT, limit("largest"), |i| &mut i.max),
            row("integrator.gain".into(), "gain", "1/s".into(), GAIN, follows, |i| &mut i.gain),
        ]
    }
}
