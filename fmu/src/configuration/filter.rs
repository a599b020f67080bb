//! `kind = "filter"`: a safety filter for one of the plants.

use std::collections::BTreeMap;

use punctual_core::barrier::Barrier;
use punctual_core::barriers::{DistanceDisc, Outside, QuadraticDisc};
use punctual_core::convergence::operator::Operator;
use punctual_core::dynamics::{ControlAffine, WithPoint};
use punctual_core::filter::{
    BarrierSettings, FilterBuilder, Infeasible, Method, ProfileKind, SafetyFilter, Sampling,
};
use punctual_core::lie;
use punctual_core::plants::{PointMass, Unicycle};
use serde::{Deserialize, Serialize};

use super::{
    ConfigurationError, ExperimentSection, ModelName, Parameter, PlantSection, Range, check_identifier,
};

/// Input bounds of this size or more mean "no bound": a finite number that every importer can read.
pub const UNBOUNDED: f64 = 1e30;

/// Default margin of a `disc`, as a part of its radius.
const MARGIN_OF_RADIUS: f64 = 0.01;

/// The shape of a barrier.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ShapeName {
    /// [`DistanceDisc`]: interior of a disc, smooth and distance-shaped. The one to use.
    #[default]
    Disc,
    /// [`QuadraticDisc`]: interior of a disc in the paper's form R² − d².
    QuadraticDisc,
    /// [`Outside`] of a [`DistanceDisc`]: to be kept clear of, or left by the deadline.
    Obstacle,
}

impl ShapeName {
    /// Its name in a configuration.
    pub fn name(self) -> &'static str {
        match self {
            Self::Disc => "disc",
            Self::QuadraticDisc => "quadratic_disc",
            Self::Obstacle => "obstacle",
        }
    }

    fn is_distance_shaped(self) -> bool {
        self != Self::QuadraticDisc
    }
}

/// How the deadline is met.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum MethodName {
    /// [`Method::ReferenceProfile`].
    #[default]
    ReferenceProfile,
    /// [`Method::RepeatedRoot`], the paper's.
    RepeatedRoot,
}

/// The profile that `reference_profile` follows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ProfileName {
    /// [`ProfileKind::Hermite`].
    #[default]
    Hermite,
    /// [`ProfileKind::LowPeak`]: of least peak.
    LowPeak,
}

/// What is done where the bounds certainly do not allow the deadline.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum InfeasibleName {
    /// [`Infeasible::Report`].
    #[default]
    Report,
    /// [`Infeasible::Soonest`].
    Soonest,
}

/// Whether a setting is its default, and left out of the canonical form.
fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

/// What is done about inputs that are held between samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum SamplingName {
    /// [`Sampling::Pointwise`]: the margin has to cover it.
    Pointwise,
    /// [`Sampling::Measured`]: predicted over the period since the last step, at first the step size of
    /// `[experiment]`.
    #[default]
    Measured,
    /// [`Sampling::Period`] with the step size of `[experiment]`.
    StepSize,
}

/// Which barrier, and the first of the filter's states that say where its point is, if it follows one.
#[derive(Clone, Copy)]
struct Place {
    index: usize,
    point: Option<usize>,
}

/// `[[barrier]]`: a safe set and the deadline for reaching it.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct BarrierSection {
    /// Its name, a C identifier, unique; prefix of its variables.
    pub name: String,
    /// The shape. Default `disc`.
    #[serde(default)]
    pub shape: ShapeName,
    /// Centre in m; of a moving disc where it is at time 0 of the simulation, whenever that starts.
    pub centre: [f64; 2],
    /// Velocity of the centre in m/s. Default 0.
    #[serde(default)]
    pub velocity: [f64; 2],
    /// Whether centre and velocity are inputs of the FMU, such as a measured obstacle's, that start with the
    /// values here, and not parameters. Default false.
    #[serde(default)]
    pub centre_input: bool,
    /// Radius in m, > 0.
    pub radius: f64,
    /// `disc` and `obstacle` only: ε in m, ≥ 0. Default 0: the radius.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub smoothing: Option<f64>,
    /// Deadline T in s after the first step, > 0.
    pub deadline: f64,
    /// How it is met. Default `reference_profile`.
    #[serde(default)]
    pub method: MethodName,
    /// The profile of `reference_profile`. Default `hermite`.
    #[serde(default, skip_serializing_if = "is_default")]
    pub profile: ProfileName,
    /// What is done where the bounds certainly do not allow the deadline. Default `report`.
    #[serde(default, skip_serializing_if = "is_default")]
    pub when_infeasible: InfeasibleName,
    /// Rate a of the profile method in 1/s, ≥ 0. Default 0: 20 / deadline.
    #[serde(default)]
    pub rate: f64,
    /// As many rates as the relative degree, in 1/s, > 0, in place of `rate`. Default: none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub rates: Vec<f64>,
    /// Rate of the stay constraint in 1/s, ≥ 0. Default 0: as `rate`, 20 / deadline where there are `rates`.
    #[serde(default)]
    pub stay_rate: f64,
    /// Margin μ in the unit of h, ≥ 0; what held inputs are expected to cost is added. Default: a
    /// hundredth of the radius, none for `quadratic_disc`.
    #[serde(default)]
    pub margin: Option<f64>,
    /// Time in s to be inside again after leaving, ≥ 0. Default 0: leaving is reported only.
    #[serde(default)]
    pub recovery: f64,
}

impl BarrierSection {
    fn complete(&mut self, path: &str) -> Result<(), ConfigurationError> {
        check_identifier(&format!("{path}.name"), &self.name)?;
        match self.shape {
            ShapeName::Disc | ShapeName::Obstacle => {
                self.smoothing.get_or_insert(0.0);
                self.margin.get_or_insert(MARGIN_OF_RADIUS * self.radius);
            }
            ShapeName::QuadraticDisc if self.smoothing.is_some() => {
                let message = "belongs to the shapes disc and obstacle; quadratic_disc has none";
                return Err(ConfigurationError::new(format!("{path}.smoothing"), message));
            }
            ShapeName::QuadraticDisc => {
                self.margin.get_or_insert(0.0);
            }
        }
        Ok(())
    }

    /// The unit of h and that of its second derivative.
    pub fn units(&self) -> (&'static str, &'static str) {
        match self.shape {
            ShapeName::Disc | ShapeName::Obstacle => ("m", "m/s2"),
            ShapeName::QuadraticDisc => ("m2", "m2/s2"),
        }
    }

    fn parameters(&self, index: usize) -> Vec<Parameter<FilterConfiguration>> {
        let unit = self.units().0;
        let row = |field: &str, unit, range, description: &str, access: fn(&mut Self) -> &mut f64| {
            // Configuration files count barriers from 0, as the error messages of serde do; the
            // components of a vector are counted from 1, as in FMI.
            let names = (format!("{}.{field}", self.name), format!("barrier[{index}].{field}"));
            Parameter::new(names, unit, range, description, move |c: &mut FilterConfiguration| {
                access(&mut c.barrier[index])
            })
        };
        let mut rows = vec![
            row("deadline", "s", Range::POSITIVE, "time from the first step to be inside", |b| {
                &mut b.deadline
            }),
            row(
                "rate",
                "1/s",
                Range::NON_NEGATIVE,
                "decay rate of an error against the profile; 0: 20 / deadline",
                |b| &mut b.rate,
            ),
            row(
                "stay_rate",
                "1/s",
                Range::NON_NEGATIVE,
                "rate of the constraint that keeps it inside; 0: as rate",
                |b| &mut b.stay_rate,
            ),
            row("margin", unit, Range::NON_NEGATIVE, "h to arrive and stay above", |b| {
                b.margin.get_or_insert(0.0)
            }),
            row(
                "recovery",
                "s",
                Range::NON_NEGATIVE,
                "deadline for coming back after leaving; 0: none",
                |b| &mut b.recovery,
            ),
        ];
        if !self.centre_input {
            rows.push(row("centre[1]", "m", Range::FINITE, "centre along x, at time 0", |b| {
                &mut b.centre[0]
            }));
            rows.push(row("centre[2]", "m", Range::FINITE, "centre along y, at time 0", |b| {
                &mut b.centre[1]
            }));
            rows.push(row("velocity[1]", "m/s", Range::FINITE, "velocity of the centre along x", |b| {
                &mut b.velocity[0]
            }));
            rows.push(row("velocity[2]", "m/s", Range::FINITE, "velocity of the centre along y", |b| {
                &mut b.velocity[1]
            }));
        }
        rows.push(row("radius", "m", Range::POSITIVE, "radius of the disc", |b| &mut b.radius));
        if self.shape.is_distance_shaped() {
            rows.push(row(
                "smoothing",
                "m",
                Range::NON_NEGATIVE,
                "rounding of the distance at the centre; 0: the radius",
                |b| b.smoothing.get_or_insert(0.0),
            ));
        }
        rows
    }

    /// The settings of its promise; 0 means "as the others say".
    ///
    /// # Errors
    ///
    /// Rates out of range.
    pub fn settings(&self) -> Result<BarrierSettings, punctual_core::Error> {
        let given = |value: f64| (value != 0.0).then_some(value);
        let rates = match &self.rates[..] {
            [] => None,
            rates => Some(Operator::new(rates)?),
        };
        Ok(BarrierSettings {
            deadline: self.deadline,
            method: match self.method {
                MethodName::ReferenceProfile => Method::ReferenceProfile,
                MethodName::RepeatedRoot => Method::RepeatedRoot,
            },
            profile: match self.profile {
                ProfileName::Hermite => ProfileKind::Hermite,
                ProfileName::LowPeak => ProfileKind::LowPeak,
            },
            infeasible: match self.when_infeasible {
                InfeasibleName::Report => Infeasible::Report,
                InfeasibleName::Soonest => Infeasible::Soonest,
            },
            rate: given(self.rate),
            rates,
            stay_rate: given(self.stay_rate),
            margin: self.margin.unwrap_or(0.0),
            recovery: given(self.recovery),
        })
    }

    /// Its variables that are inputs, with their units, start values and meanings.
    pub fn inputs(&self) -> Vec<(String, &'static str, f64, &'static str)> {
        if !self.centre_input {
            return Vec::new();
        }
        let name = |field: &str| format!("{}.{field}", self.name);
        vec![
            (name("centre[1]"), "m", self.centre[0], "where the centre is, along x"),
            (name("centre[2]"), "m", self.centre[1], "where the centre is, along y"),
            (name("velocity[1]"), "m/s", self.velocity[0], "velocity of the centre along x"),
            (name("velocity[2]"), "m/s", self.velocity[1], "velocity of the centre along y"),
        ]
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum FilterKind {
    Filter,
}

/// A filter FMU.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct FilterConfiguration {
    pub(super) kind: FilterKind,
    /// The FMU's name, a C identifier. Default `filter`.
    #[serde(default)]
    pub name: String,
    /// Whether outputs follow inputs without a step between them. Default true; with false, outputs
    /// are computed in steps only, for the same result in every master.
    #[serde(default = "yes")]
    pub direct_feedthrough: bool,
    /// What is done about inputs held between samples. Default `measured`.
    #[serde(default)]
    pub sampling: SamplingName,
    /// Time in s until a computed input acts, ≥ 0, at most the step size: a communication step with a
    /// Jacobi master. The state is predicted over it. Default 0.
    #[serde(default)]
    pub actuation_delay: f64,
    /// Largest ‖u − u_ref‖ of one sample, in units of u, > 0; a constraint that needs more is
    /// reported as degenerate. Default 1e6.
    #[serde(default = "correction_limit")]
    pub correction_limit: f64,
    /// The plant that the filter is for.
    pub plant: PlantSection,
    /// The safe sets, at least one.
    pub barrier: Vec<BarrierSection>,
    /// Input bounds by name, `[min, max]` in the unit of the input. Default: none (±1e30).
    #[serde(default)]
    pub bounds: BTreeMap<String, [f64; 2]>,
    /// The run it is meant for.
    #[serde(default)]
    pub experiment: ExperimentSection,
}

fn yes() -> bool {
    true
}

fn correction_limit() -> f64 {
    FilterBuilder::DEFAULT_CORRECTION_LIMIT
}

impl FilterConfiguration {
    pub(super) fn completed(mut self) -> Result<Self, ConfigurationError> {
        if self.name.is_empty() {
            self.name = "filter".to_owned();
        }
        check_identifier("name", &self.name)?;
        self.plant.complete()?;
        if self.barrier.is_empty() {
            return Err(ConfigurationError::new("barrier", "is empty, must have at least 1"));
        }
        for i in 0..self.barrier.len() {
            self.barrier[i].complete(&format!("barrier[{i}]"))?;
            let name = self.barrier[i].name.clone();
            // A barrier's variables must not fall among the filter's own.
            let reserved =
                ["x", "u", "u_ref", "u_min", "u_max", "status", "rearm", "l_r", "l_f"].contains(&&*name);
            if reserved || self.barrier[..i].iter().any(|b| b.name == name) {
                let message = format!("is {name:?}, which is already the name of something else");
                return Err(ConfigurationError::new(format!("barrier[{i}].name"), message));
            }
        }
        let inputs = self.plant.model.inputs();
        if let Some(unknown) = self.bounds.keys().find(|k| inputs.iter().all(|s| s.name != **k)) {
            let names: Vec<_> = inputs.iter().map(|s| s.name).collect();
            let message = format!("unknown input, must be one of {}", names.join(", "));
            return Err(ConfigurationError::new(format!("bounds.{unknown}"), message));
        }
        for input in inputs {
            let [min, max] = self.bounds.entry(input.name.to_owned()).or_insert([-UNBOUNDED, UNBOUNDED]);
            // Not `f64::max`: not-a-number has to reach the check below.
            if *min < -UNBOUNDED {
                *min = -UNBOUNDED;
            }
            if *max > UNBOUNDED {
                *max = UNBOUNDED;
            }
        }
        self.experiment.check()?;
        for parameter in self.parameters() {
            parameter.check(&mut self)?;
        }
        // Whatever the ranges of single numbers cannot say.
        self.build()?;
        Ok(self)
    }

    /// The numbers that are parameters of the FMU.
    pub fn parameters(&self) -> Vec<Parameter<Self>> {
        let range = Range { min: Some(-UNBOUNDED), max: Some(UNBOUNDED) };
        let mut rows = Vec::new();
        for (side, prefix, word) in [(0, "u_min", "smallest"), (1, "u_max", "largest")] {
            for input in self.plant.model.inputs() {
                let names = (format!("{prefix}.{}", input.name), format!("bounds.{}", input.name));
                let description = format!("{word} {} (no bound: {UNBOUNDED:e} in size)", input.description);
                rows.push(Parameter::new(names, input.unit, range, description, move |c: &mut Self| {
                    &mut c.bounds.entry(input.name.to_owned()).or_default()[side]
                }));
            }
        }
        for (i, barrier) in self.barrier.iter().enumerate() {
            rows.extend(barrier.parameters(i));
        }
        rows.extend(self.plant.parameters(|c: &mut Self| &mut c.plant));
        rows
    }

    fn sampling(&self, step_size: f64) -> Sampling {
        match self.sampling {
            SamplingName::Pointwise => Sampling::Pointwise,
            SamplingName::Measured => Sampling::Measured { first: Some(step_size) },
            SamplingName::StepSize => Sampling::Period(step_size),
        }
    }

    /// The filter, not yet anchored.
    ///
    /// # Errors
    ///
    /// A number outside its range, or a lower input bound above its upper bound.
    pub fn build(&self) -> Result<SafetyFilter, ConfigurationError> {
        let inputs = self.plant.model.inputs();
        let states = self.plant.model.states().len();
        let mut next_point = states;
        let mut builder = SafetyFilter::builder(states + self.points().len(), inputs.len());
        for (i, section) in self.barrier.iter().enumerate() {
            let path = format!("barrier[{i}]");
            let core = |e: punctual_core::Error| {
                ConfigurationError::new(format!("{path}.{}", e.field()), e.message())
            };
            let point = section.centre_input.then_some(next_point);
            next_point += section.inputs().len();
            let smoothing = section.smoothing.filter(|s| *s != 0.0).unwrap_or(section.radius);
            let (centre, radius) = (section.centre, section.radius);
            let distance_disc = || {
                let disc = DistanceDisc::new(centre, radius, smoothing)?.moving(section.velocity)?;
                Ok(if point.is_some() { disc.following(states) } else { disc })
            };
            let quadratic_disc = || {
                let disc = QuadraticDisc::new(centre, radius)?.moving(section.velocity)?;
                Ok(if point.is_some() { disc.following(states) } else { disc })
            };
            builder = match section.shape {
                ShapeName::Disc => self.add(builder, i, point, distance_disc().map_err(core)?)?,
                ShapeName::Obstacle => {
                    self.add(builder, i, point, Outside(distance_disc().map_err(core)?))?
                }
                ShapeName::QuadraticDisc => self.add(builder, i, point, quadratic_disc().map_err(core)?)?,
            };
        }
        let (mut min, mut max) = (Vec::new(), Vec::new());
        for input in inputs {
            let [low, high] = self.bounds.get(input.name).copied().unwrap_or([-UNBOUNDED, UNBOUNDED]);
            if low > high {
                let message = format!(
                    "is [{low}, {high}], must be [min, max] with min <= max (in an FMU: u_min.{name}, u_max.{name})",
                    name = input.name
                );
                return Err(ConfigurationError::new(format!("bounds.{}", input.name), message));
            }
            min.push(if low <= -UNBOUNDED { f64::NEG_INFINITY } else { low });
            max.push(if high >= UNBOUNDED { f64::INFINITY } else { high });
        }
        builder
            .bounds(&min, &max)
            .and_then(|b| b.correction_limit(self.correction_limit))
            .and_then(|b| b.actuation_delay(self.actuation_delay))
            .and_then(|b| b.sampling(self.sampling(self.experiment.step_size)))
            .and_then(FilterBuilder::build)
            .map_err(|e| ConfigurationError::new(e.field(), e.message()))
    }

    /// Whether an input has a bound.
    pub fn is_bounded(&self) -> bool {
        self.bounds.values().any(|[min, max]| *min > -UNBOUNDED || *max < UNBOUNDED)
    }

    /// The start values of the points that are inputs; they follow the states of the plant in the filter's.
    pub fn points(&self) -> Vec<f64> {
        self.barrier.iter().flat_map(BarrierSection::inputs).map(|(_, _, start, _)| start).collect()
    }

    fn add<B>(
        &self,
        builder: FilterBuilder,
        index: usize,
        point: Option<usize>,
        barrier: B,
    ) -> Result<FilterBuilder, ConfigurationError>
    where
        B: Barrier<4> + Barrier<5> + Barrier<8> + Barrier<9> + Send + 'static,
    {
        let model = &self.plant;
        let at = Place { index, point };
        match model.model {
            ModelName::PointMass => self.add_along::<_, _, 4, 8>(builder, at, PointMass, barrier),
            ModelName::Unicycle => self.add_along::<_, _, 4, 8>(builder, at, Unicycle, barrier),
            ModelName::Bicycle => self.add_along::<_, _, 4, 8>(builder, at, model.bicycle()?, barrier),
            ModelName::BicycleSmallSlip => {
                self.add_along::<_, _, 4, 8>(builder, at, model.small_slip()?, barrier)
            }
            ModelName::BicycleSmallSlipRate => {
                self.add_along::<_, _, 5, 9>(builder, at, model.small_slip()?.with_rate(), barrier)
            }
            ModelName::BicycleKinematic => {
                self.add_along::<_, _, 5, 9>(builder, at, model.kinematic()?, barrier)
            }
        }
    }

    /// Adds `barrier` along `plant`; `EXTENDED` = `NX` + 4 states where it follows a point.
    fn add_along<P, B, const NX: usize, const EXTENDED: usize>(
        &self,
        builder: FilterBuilder,
        at: Place,
        plant: P,
        barrier: B,
    ) -> Result<FilterBuilder, ConfigurationError>
    where
        P: ControlAffine<NX, 2> + Send + 'static,
        B: Barrier<NX> + Barrier<EXTENDED> + Send + 'static,
    {
        let section = &self.barrier[at.index];
        let dim = NX + self.points().len();
        let named = |e: punctual_core::Error| self.refused(at.index, &e.within(&section.name));
        let source = match at.point {
            None => lie::detected(&plant, &barrier)
                .require(None)
                .and_then(|n| lie::along(plant, barrier, n))
                .and_then(|source| lie::embedded(source, dim, &std::array::from_fn::<_, NX, _>(|i| i))),
            Some(first) => {
                let plant = WithPoint::<_, NX>(plant);
                let picks =
                    std::array::from_fn::<_, EXTENDED, _>(|i| if i < NX { i } else { first + i - NX });
                lie::detected::<_, _, EXTENDED, 2>(&plant, &barrier)
                    .require(None)
                    .and_then(|n| lie::along::<_, _, EXTENDED, 2>(plant, barrier, n))
                    .and_then(|source| lie::embedded(source, dim, &picks))
            }
        };
        let settings = section.settings().map_err(named)?;
        builder
            .source(&section.name, source.map_err(named)?, settings)
            .map_err(|e| self.refused(at.index, &e))
    }

    /// The core's refusal of barrier `index` in the words of the configuration.
    fn refused(&self, index: usize, error: &punctual_core::Error) -> ConfigurationError {
        if let Some(found) = error.relative_degree() {
            let inputs = self.plant.model.inputs();
            let found = found.describe(|i| inputs.get(i).map_or("u", |s| s.name).to_owned());
            let advice = match self.plant.model {
                ModelName::BicycleSmallSlip => {
                    "; one constraint cannot use both, so take the model bicycle_small_slip_rate or bicycle_kinematic"
                }
                _ => "",
            };
            let model = self.plant.model.name();
            let message = format!("its relative degree along {model} {found}{advice}");
            return ConfigurationError::new(format!("barrier[{index}]"), message);
        }
        let field = error.field().split_once('.').map_or(error.field(), |(_, field)| field);
        ConfigurationError::new(format!("barrier[{index}].{field}"), error.message())
    }
}
