//! `[[barrier]]` as written in a file: the keys of all shapes.

use serde::Deserialize;

use super::reader::Kind;
use super::{InfeasibleName, MethodName, ProfileName};

/// The keys of a `[[barrier]]`; [`KEYS`](super::keys::KEYS) has their meanings.
#[derive(Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in super::super) struct RawBarrier {
    pub(super) name: String,
    pub(super) shape: Option<Kind>,
    pub(super) centre: Option<[f64; 2]>,
    pub(super) velocity: Option<[f64; 2]>,
    #[serde(default)]
    pub(super) centre_input: bool,
    pub(super) acceleration: Option<f64>,
    pub(super) centre_error: Option<f64>,
    pub(super) velocity_error: Option<f64>,
    pub(super) radius: Option<f64>,
    pub(super) smoothing: Option<f64>,
    pub(super) half_axes: Option<[f64; 2]>,
    pub(super) half_sides: Option<[f64; 2]>,
    pub(super) angle: Option<f64>,
    pub(super) normal: Option<[f64; 2]>,
    pub(super) state: Option<String>,
    pub(super) bound: Option<f64>,
    pub(super) expression: Option<String>,
    pub(super) output: Option<String>,
    pub(super) unit: Option<String>,
    pub(super) relative_degree: Option<usize>,
    pub(super) deadline: Option<f64>,
    #[serde(default)]
    pub(super) method: MethodName,
    #[serde(default)]
    pub(super) profile: ProfileName,
    #[serde(default)]
    pub(super) when_infeasible: InfeasibleName,
    #[serde(default)]
    pub(super) rate: f64,
    #[serde(default)]
    pub(super) rates: Vec<f64>,
    #[serde(default)]
    pub(super) stay_rate: f64,
    pub(super) margin: Option<f64>,
    #[serde(default)]
    pub(super) recovery: f64,
    #[serde(default)]
    pub(super) disturbance: f64,
    pub(super) priority: Option<u32>,
    #[serde(default)]
    pub(super) penalty: f64,
    #[serde(default)]
    pub(super) begin: f64,
    pub(super) after: Option<String>,
    #[serde(default)]
    pub(super) end: f64,
    #[serde(default)]
    pub(super) until_arrival: bool,
    #[serde(default)]
    pub(super) stay: f64,
    pub(super) until: Option<String>,
    pub(super) choice: Option<String>,
    pub(super) alternative: Option<String>,
}

impl RawBarrier {
    /// The keys that say when, and whether they are given.
    pub(super) fn of_time(&self) -> [(&'static str, bool); 9] {
        [
            ("deadline", self.deadline.is_some()),
            ("begin", self.begin != 0.0),
            ("after", self.after.is_some()),
            ("end", self.end != 0.0),
            ("until_arrival", self.until_arrival),
            ("stay", self.stay != 0.0),
            ("until", self.until.is_some()),
            ("choice", self.choice.is_some()),
            ("alternative", self.alternative.is_some()),
        ]
    }

    /// The keys that only some shapes have, and whether they are given; looked at in this order.
    pub(super) fn of_shape(&self) -> [(&'static str, bool); 18] {
        [
            ("centre", self.centre.is_some()),
            ("centre_input", self.centre_input),
            ("velocity", self.velocity.is_some()),
            ("acceleration", self.acceleration.is_some()),
            ("centre_error", self.centre_error.is_some()),
            ("velocity_error", self.velocity_error.is_some()),
            ("radius", self.radius.is_some()),
            ("smoothing", self.smoothing.is_some()),
            ("half_axes", self.half_axes.is_some()),
            ("half_sides", self.half_sides.is_some()),
            ("angle", self.angle.is_some()),
            ("normal", self.normal.is_some()),
            ("state", self.state.is_some()),
            ("bound", self.bound.is_some()),
            ("expression", self.expression.is_some()),
            ("output", self.output.is_some()),
            ("unit", self.unit.is_some()),
            ("relative_degree", self.relative_degree.is_some()),
        ]
    }
}
