//! `[[barrier]]`: a safe set, the deadline for reaching it if it has one, and when that is in force.
//!
//! A file may have every key of every shape ([`raw`]). After reading, a barrier has one [`Shape`] with the
//! numbers of that shape. The table in [`keys`] gives the meaning of the keys, and tells which are parameters of
//! the FMU.

mod keys;
mod mission;
mod raw;
mod reader;
mod shape;

pub use shape::{Point, SHAPES, Shape, ShapeRow};

pub(super) use keys::SECTION;
pub(super) use mission::of_mission;
pub(super) use raw::RawBarrier;
pub(super) use shape::Region;

use punctual_core::convergence::operator::Operator;
use punctual_core::filter::{BarrierSettings, Infeasible, Method, ProfileKind};
use serde::Serialize;

use super::names::check_identifier;
use super::words::words;
use super::{BarrierInput, ConfigurationError, PlantSection, external};

/// Default margin as a part of the radius, or of the smaller half axis or side.
const MARGIN_OF_SIZE: f64 = 0.01;
/// Part of the scale of an expression that is its default margin: one by this.
const PARTS_OF_SCALE: f64 = 1e4;
/// Largest default margin of an expression, in the unit of h: a millimetre where that is m. A constant term may tell more of
/// where the origin is than of the set, as in kelvin.
const MOST_OF_EXPRESSION: f64 = 1e-3;

words! {
    /// The method by which the deadline is met.
    #[derive(Default)]
    pub enum MethodName {
        /// [`Method::ReferenceProfile`].
        #[default]
        ReferenceProfile = "reference_profile",
        /// [`Method::RepeatedRoot`], the paper's.
        RepeatedRoot = "repeated_root",
    }
}

words! {
    /// The profile that `reference_profile` follows.
    #[derive(Default)]
    pub enum ProfileName {
        /// [`ProfileKind::Hermite`].
        #[default]
        Hermite = "hermite",
        /// [`ProfileKind::LowPeak`]: of least peak.
        LowPeak = "low_peak",
    }
}

words! {
    /// The reaction where the bounds certainly do not allow the deadline.
    #[derive(Default)]
    pub enum InfeasibleName {
        /// [`Infeasible::Report`].
        #[default]
        Report = "report",
        /// [`Infeasible::Earliest`].
        Earliest = "earliest",
    }
}

/// A number that is 0 where the filter chooses it or does without, since a parameter of an FMU cannot be left
/// out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
#[serde(transparent)]
pub struct Automatic(pub f64);

impl Automatic {
    /// The number, unless it is 0.
    pub fn given(self) -> Option<f64> {
        given(self.0)
    }
}

/// Whether a file states a number, which it is no other configuration without: all of these are equal.
#[derive(Clone, Copy, Debug)]
pub struct Given(pub bool);

impl PartialEq for Given {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

/// A number that a file leaves out or sets to 0.
fn given(value: f64) -> Option<f64> {
    (value != 0.0).then_some(value)
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

/// `[[barrier]]`: a safe set, to be reached by a deadline, or to be kept. docs/configuration.md has units, ranges
/// and defaults.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BarrierSection {
    /// Its name, a C identifier, unique; prefix of its variables.
    pub name: String,
    /// The set.
    #[serde(flatten)]
    pub shape: Shape,
    /// The states that are the position, where the plant has no name and the set has a place.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub position: Vec<String>,
    /// Deadline T in s after the first step; none for a set that is only to be kept from a start inside it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub deadline: Option<f64>,
    /// The method by which it is met.
    pub method: MethodName,
    /// The profile of `reference_profile`.
    #[serde(skip_serializing_if = "is_default")]
    pub profile: ProfileName,
    /// The reaction where the bounds certainly do not allow the deadline.
    #[serde(skip_serializing_if = "is_default")]
    pub when_infeasible: InfeasibleName,
    /// Rate a of the profile method in 1/s.
    pub rate: Automatic,
    /// Rates in 1/s, as many as the relative degree, in place of `rate`; else empty.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub rates: Vec<f64>,
    /// Rate of the stay constraint in 1/s. Where there are `rates`, its default is that of `rate`.
    pub stay_rate: Automatic,
    /// Margin μ in the unit of h; the expected cost of held inputs is added.
    pub margin: f64,
    /// Whether that is the file's own.
    #[serde(skip)]
    pub margin_given: Given,
    /// Time in s to be inside again after leaving; without it leaving is reported only.
    pub recovery: Automatic,
    /// Bound on the part of h⁽ⁿ⁾ that the model does not know (a disturbance), in the unit of h per sⁿ. The promise
    /// holds for all disturbances within it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub disturbance: Option<f64>,
    /// Rank where not all barriers can be met: smaller numbers go first, of equal ones the one above.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub priority: Option<u32>,
    /// Makes it soft: it is relaxed where it would cost more than this ‖u − u_ref‖, in units of u.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub penalty: Option<f64>,
    /// Time in s after the first step from which it is enforced.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub begin: Option<f64>,
    /// The barrier, above in the file, whose arrival it waits for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub after: Option<String>,
    /// Time in s after the first step at which it is released; none: never.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub end: Option<f64>,
    /// Whether it is released when it has been reached.
    #[serde(skip_serializing_if = "is_default")]
    pub until_arrival: bool,
    /// Time in s for which it is kept before it is released; none: no such end.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stay: Option<f64>,
    /// The barrier whose arrival releases it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub until: Option<String>,
    /// The choice of which it is an alternative, or a part of one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub choice: Option<String>,
    /// The alternative of which it is a part.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub alternative: Option<String>,
}

/// The margin of a set on `plant` where the file has none. What is out of range is refused under its own name.
fn default_margin(shape: &Shape, plant: &PlantSection) -> f64 {
    match shape {
        Shape::Expression { expression, .. } => {
            (plant.scale_of(expression) / PARTS_OF_SCALE).min(MOST_OF_EXPRESSION)
        }
        _ => MARGIN_OF_SIZE * shape.size().unwrap_or(0.0).max(0.0),
    }
}

impl BarrierSection {
    /// Parses and checks `raw`, a barrier of a filter for `plant`; `path` names it in errors.
    pub(super) fn parse(
        raw: RawBarrier,
        path: &str,
        plant: &PlantSection,
    ) -> Result<Self, ConfigurationError> {
        check_identifier(&format!("{path}.name"), &raw.name)?;
        let (shape, position) = Shape::parse(&raw, path, plant)?;
        let margin_given = Given(raw.margin.is_some());
        let margin = raw.margin.unwrap_or_else(|| default_margin(&shape, plant));
        Ok(Self {
            name: raw.name,
            shape,
            position,
            deadline: raw.deadline,
            method: raw.method,
            profile: raw.profile,
            when_infeasible: raw.when_infeasible,
            rate: Automatic(raw.rate),
            rates: raw.rates,
            stay_rate: Automatic(raw.stay_rate),
            margin,
            margin_given,
            recovery: Automatic(raw.recovery),
            disturbance: given(raw.disturbance),
            priority: raw.priority,
            penalty: given(raw.penalty),
            begin: given(raw.begin),
            after: raw.after,
            end: given(raw.end),
            until_arrival: raw.until_arrival,
            stay: given(raw.stay),
            until: raw.until,
            choice: raw.choice,
            alternative: raw.alternative,
        })
    }

    /// Its deadline in s, `factor` times as long, but not before it begins.
    pub fn deadline_times(&self, factor: f64) -> Option<f64> {
        self.deadline.map(|deadline| (factor * deadline).max(self.begin.unwrap_or(0.0)))
    }

    /// The unit of h.
    pub fn unit(&self, plant: &PlantSection) -> String {
        self.shape.unit(plant)
    }

    /// The settings of its promise.
    ///
    /// # Errors
    ///
    /// Rates out of range.
    pub fn settings(&self) -> Result<BarrierSettings, punctual_core::Error> {
        let rates = match &self.rates[..] {
            [] => None,
            rates => Some(Operator::new(rates)?),
        };
        let method = match self.method {
            MethodName::ReferenceProfile => Method::ReferenceProfile,
            MethodName::RepeatedRoot => Method::RepeatedRoot,
        };
        let profile = match self.profile {
            ProfileName::Hermite => ProfileKind::Hermite,
            ProfileName::LowPeak => ProfileKind::LowPeak,
        };
        let infeasible = match self.when_infeasible {
            InfeasibleName::Report => Infeasible::Report,
            InfeasibleName::Earliest => Infeasible::Earliest,
        };
        Ok(BarrierSettings::keeping()
            .deadline(self.deadline)
            .method(method)
            .profile(profile)
            .infeasible(infeasible)
            .rate(self.rate.given())
            .rates(rates)
            .stay_rate(self.stay_rate.given())
            .margin(self.margin)
            .recovery(self.recovery.given())
            .disturbance(self.disturbance.unwrap_or(0.0)))
    }

    /// Its variables that are inputs: the point that it follows, or the derivatives that it is given.
    pub fn inputs(&self, plant: &PlantSection) -> Vec<BarrierInput> {
        if let Shape::External { unit, relative_degree } = &self.shape {
            return external::inputs(&self.name, unit, *relative_degree, plant);
        }
        let Some(point) = self.shape.followed() else { return Vec::new() };
        [
            ("centre[1]", "m", point.centre[0], "where the centre is, along x"),
            ("centre[2]", "m", point.centre[1], "where the centre is, along y"),
            ("velocity[1]", "m/s", point.velocity[0], "velocity of the centre along x"),
            ("velocity[2]", "m/s", point.velocity[1], "velocity of the centre along y"),
        ]
        .map(|(field, unit, start, description)| BarrierInput {
            name: format!("{}.{field}", self.name),
            unit: unit.to_owned(),
            start,
            description: description.to_owned(),
        })
        .into()
    }
}
