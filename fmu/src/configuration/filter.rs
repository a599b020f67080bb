//! `kind = "filter"`: a safety filter for one of the plants.

use std::collections::BTreeMap;

use punctual_core::MAX_ROWS;
use punctual_core::barrier::Barrier;
use punctual_core::dynamics::{ControlAffine, WithPoint};
use punctual_core::filter::{Begin, End, FilterBuilder, SafetyFilter, Sampling, Strictness};
use punctual_core::lie::{self, DerivativeSource, RelativeDegree};
use punctual_reference::plants::{PointMass, Unicycle};
use serde::{Deserialize, Serialize};

use super::barrier::{BarrierSection, Visitor};
use super::{
    BarrierInput, ConfigurationError, ExperimentSection, IntegratorSection, ModelName, Parameter,
    PlantSection, PluginLoader, Range, ReferenceSection, ShapeName, VariableSection, check_identifier,
};

/// Input bounds of this size or more mean "no bound": a finite number that every importer can read.
pub const UNBOUNDED: f64 = 1e30;

/// What is done about inputs that are held between samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum SamplingName {
    /// Not said: `pointwise` where the plant is not known, else `measured`. Not in a completed configuration.
    #[default]
    #[serde(skip)]
    Unstated,
    /// [`Sampling::Pointwise`]: the margin has to cover it.
    Pointwise,
    /// [`Sampling::Measured`]: predicted over the period since the last step, at first the step size of
    /// `[experiment]`.
    Measured,
    /// [`Sampling::Period`] with the step size of `[experiment]`.
    StepSize,
}

/// A barrier of a configuration on its way into a filter.
struct Adding<'a> {
    configuration: &'a FilterConfiguration,
    plant: ReferenceSection,
    builder: FilterBuilder,
    index: usize,
    point: Option<usize>,
}

impl Visitor for Adding<'_> {
    type Output = Result<FilterBuilder, ConfigurationError>;

    fn shape<B>(self, barrier: B) -> Self::Output
    where
        B: Barrier<4> + Barrier<5> + Barrier<8> + Barrier<9> + Send + 'static,
    {
        let Self { configuration: c, plant: model, builder, index, point } = self;
        let at = Place { index, point };
        match model.model {
            ModelName::PointMass => c.add_along::<_, _, 4, 8>(builder, at, PointMass, barrier),
            ModelName::Unicycle => c.add_along::<_, _, 4, 8>(builder, at, Unicycle, barrier),
            ModelName::Bicycle => c.add_along::<_, _, 4, 8>(builder, at, model.bicycle()?, barrier),
            ModelName::BicycleSmallSlip => {
                c.add_along::<_, _, 4, 8>(builder, at, model.small_slip()?, barrier)
            }
            ModelName::BicycleSmallSlipRate => {
                c.add_along::<_, _, 5, 9>(builder, at, model.small_slip()?.with_rate(), barrier)
            }
            ModelName::BicycleKinematic => {
                c.add_along::<_, _, 5, 9>(builder, at, model.kinematic()?, barrier)
            }
            ModelName::BicycleKinematicAngle | ModelName::BicycleKinematicSlip => {
                Err(not_affine(model.model))
            }
        }
    }
}

/// The position in m at which h of `section` is largest, on a plant with a name; `None` where that is not known.
fn inmost(section: &BarrierSection) -> Option<[f64; 2]> {
    match section.shape {
        ShapeName::Disc | ShapeName::QuadraticDisc | ShapeName::Ellipse | ShapeName::Rectangle => {
            section.centre
        }
        // At rest, wherever that is.
        ShapeName::SpeedLimit => Some([0.0; 2]),
        _ => None,
    }
}

/// Why a filter cannot have `model`, which is not affine in its inputs.
fn not_affine(model: ModelName) -> ConfigurationError {
    let (angle, advice) = match model {
        ModelName::BicycleKinematicAngle => {
            ("delta", "take the model bicycle_kinematic with `[integrator] state = \"delta\"`")
        }
        _ => (
            "beta",
            "take bicycle, or bicycle_small_slip_rate with `[integrator] state = \"beta\"`, which nearly are it",
        ),
    };
    let message = format!(
        "is {:?}, which is a plant only: {angle} does not enter linearly, as a filter needs it; {advice}",
        model.name()
    );
    ConfigurationError::new("plant.model", message)
}

/// Which barrier, and the first of the filter's states that say where its point is, if it follows one.
#[derive(Clone, Copy)]
struct Place {
    index: usize,
    point: Option<usize>,
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
    /// What is done about inputs held between samples. Default `measured`; `pointwise` where the plant has
    /// inputs only. A barrier that is external needs the latter.
    #[serde(default)]
    pub sampling: SamplingName,
    /// Time in s until a computed input acts, ≥ 0, at most the step size: a communication step with a
    /// Jacobi master. The state is predicted over it. Default 0.
    #[serde(default)]
    pub actuation_delay: f64,
    /// The longest time in s between two steps, ≥ 0: the promises then hold for steps of any length up to it. Default 0:
    /// as long as the ones before were.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub period_max: f64,
    /// Largest ‖u − u_ref‖ of one sample, in units of u, > 0; a constraint that needs more is
    /// reported as `no_authority`. Default 1e6.
    #[serde(default = "correction_limit")]
    pub correction_limit: f64,
    /// The plant that the filter is for.
    pub plant: PlantSection,
    /// Which state of it the filter commands and integrates itself. Default: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub integrator: Option<IntegratorSection>,
    /// The safe sets, at least one.
    pub barrier: Vec<BarrierSection>,
    /// Input bounds by name, `[min, max]` in the unit of the input. Default: none (±1e30).
    #[serde(default)]
    pub bounds: BTreeMap<String, [f64; 2]>,
    /// Bounds on the errors of the measured states, by name, in their units; ≥ 0. The promises then hold for the true
    /// state, to first order in them. Default: none.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub measurement_errors: BTreeMap<String, f64>,
    /// The run it is meant for.
    #[serde(default)]
    pub experiment: ExperimentSection,
}

fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

fn yes() -> bool {
    true
}

fn correction_limit() -> f64 {
    FilterBuilder::DEFAULT_CORRECTION_LIMIT
}

impl FilterConfiguration {
    pub(super) fn completed(mut self, loader: &dyn PluginLoader) -> Result<Self, ConfigurationError> {
        if self.name.is_empty() {
            self.name = "filter".to_owned();
        }
        check_identifier("name", &self.name)?;
        self.plant.complete(loader)?;
        if let Some(model) = self.plant.model.filter(|model| !model.is_affine()) {
            return Err(not_affine(model));
        }
        if let Some(integrator) = &self.integrator {
            integrator.place(&self.plant)?;
        }
        if self.barrier.is_empty() {
            return Err(ConfigurationError::new("barrier", "is empty, must have at least 1"));
        }
        // Here already, before time is spent on each.
        if self.barrier.len() > MAX_ROWS {
            let message = format!("has {} entries, must have at most {MAX_ROWS}", self.barrier.len());
            return Err(ConfigurationError::new("barrier", message));
        }
        for i in 0..self.barrier.len() {
            self.barrier[i].complete(&format!("barrier[{i}]"), &self.plant)?;
            let name = self.barrier[i].name.clone();
            // A barrier's variables must not fall among the filter's own.
            let reserved = [
                "x",
                "u",
                "u_ref",
                "u_min",
                "u_max",
                "status",
                "rearm",
                "l_r",
                "l_f",
                "integrator",
                "measurement_error",
            ];
            let reserved = reserved.contains(&&*name);
            let reserved = reserved || self.plant.parameters.iter().any(|p| p.name == name);
            if reserved || self.barrier[..i].iter().any(|b| b.name == name) {
                let message = format!("is {name:?}, which is already the name of something else");
                return Err(ConfigurationError::new(format!("barrier[{i}].name"), message));
            }
        }
        self.complete_sampling()?;
        let inputs = self.plant.inputs();
        if let Some(unknown) = self.bounds.keys().find(|k| inputs.iter().all(|s| s.name != **k)) {
            let names: Vec<_> = inputs.iter().map(|s| s.name.as_str()).collect();
            let message = format!("unknown input, must be one of {}", names.join(", "));
            return Err(ConfigurationError::new(format!("bounds.{unknown}"), message));
        }
        for input in inputs {
            let own = [input.min.unwrap_or(-UNBOUNDED), input.max.unwrap_or(UNBOUNDED)];
            let [min, max] = self.bounds.entry(input.name).or_insert(own);
            // Not `f64::max`: not-a-number has to reach the check below.
            if *min < -UNBOUNDED {
                *min = -UNBOUNDED;
            }
            if *max > UNBOUNDED {
                *max = UNBOUNDED;
            }
        }
        let states = self.measured_states();
        if let Some(unknown) = self.measurement_errors.keys().find(|k| states.iter().all(|s| s.name != **k)) {
            let names: Vec<_> = states.iter().map(|s| s.name.as_str()).collect();
            let message = format!("unknown measured state, must be one of {}", names.join(", "));
            return Err(ConfigurationError::new(format!("measurement_errors.{unknown}"), message));
        }
        self.experiment.check()?;
        for parameter in self.parameters() {
            parameter.check(&mut self)?;
        }
        // Whatever the ranges of single numbers cannot say.
        let mut filter = self.build()?;
        self.build_integrator(&filter)?;
        self.check_margins(&mut filter)?;
        Ok(self)
    }

    /// Refuses a margin that h never has: of shapes whose largest h is known, at their centre or at rest.
    fn check_margins(&self, filter: &mut SafetyFilter) -> Result<(), ConfigurationError> {
        let states = self.plant.states().len();
        let mut x = vec![0.0; states];
        x.extend(self.barrier_inputs().iter().map(|input| input.start));
        let mut h = vec![0.0; self.barrier.len()];
        for (i, section) in self.barrier.iter().enumerate() {
            let Some(centre) = inmost(section) else { continue };
            x[..2].copy_from_slice(&centre);
            let named = |e: punctual_core::Error| ConfigurationError::new(e.field(), e.message());
            filter.barrier_values(0.0, &x, &mut h).map_err(named)?;
            let margin = section.margin.unwrap_or(0.0);
            if margin >= h[i] {
                let (unit, largest) = (section.unit(&self.plant), h[i]);
                let message = format!(
                    "is {margin} {unit}, must be < {largest:.6} {unit}, the largest that h ever is: h >= margin is aimed at"
                );
                return Err(ConfigurationError::new(format!("barrier[{i}].margin"), message));
            }
        }
        Ok(())
    }

    /// The numbers that are parameters of the FMU.
    pub fn parameters(&self) -> Vec<Parameter<Self>> {
        let range = Range { min: Some(-UNBOUNDED), max: Some(UNBOUNDED) };
        let mut rows = Vec::new();
        for (side, prefix, word) in [(0, "u_min", "smallest"), (1, "u_max", "largest")] {
            for input in self.plant.inputs() {
                let names = (format!("{prefix}.{}", input.name), format!("bounds.{}", input.name));
                let description = format!("{word} {} (no bound: {UNBOUNDED:e} in size)", input.description);
                rows.push(Parameter::new(names, input.unit, range, description, move |c: &mut Self| {
                    &mut c.bounds.entry(input.name.clone()).or_default()[side]
                }));
            }
        }
        let erroneous = |state: &VariableSection| self.measurement_errors.contains_key(&state.name);
        for state in self.measured_states().into_iter().filter(erroneous) {
            let names =
                (format!("measurement_error.{}", state.name), format!("measurement_errors.{}", state.name));
            let description = format!("largest error of the measured {}", state.description);
            rows.push(Parameter::new(
                names,
                state.unit,
                Range::NON_NEGATIVE,
                description,
                move |c: &mut Self| c.measurement_errors.entry(state.name.clone()).or_default(),
            ));
        }
        rows.extend(self.integrator.iter().flat_map(|i| i.parameters(&self.plant)));
        // Only a disturbance has a unit that depends on them.
        let disturbed = self.barrier.iter().any(|b| b.disturbance != 0.0);
        let degrees = if disturbed { self.relative_degrees() } else { Vec::new() };
        for (i, barrier) in self.barrier.iter().enumerate() {
            rows.extend(barrier.parameters(i, &self.plant, degrees.get(i).copied()));
        }
        rows.extend(self.plant.parameters(|c: &mut Self| &mut c.plant));
        rows
    }

    fn sampling(&self, step_size: f64) -> Sampling {
        match self.sampling {
            SamplingName::Pointwise => Sampling::Pointwise,
            SamplingName::Measured | SamplingName::Unstated => Sampling::Measured { first: Some(step_size) },
            SamplingName::StepSize => Sampling::Period(step_size),
        }
    }

    /// The filter, not yet anchored.
    ///
    /// # Errors
    ///
    /// A number outside its range, or a lower input bound above its upper bound.
    pub fn build(&self) -> Result<SafetyFilter, ConfigurationError> {
        let inputs = self.plant.inputs();
        let states = self.plant.states().len();
        let mut next_point = states;
        let mut builder = SafetyFilter::builder(states + self.barrier_inputs().len(), inputs.len());
        for (i, section) in self.barrier.iter().enumerate() {
            let first = next_point;
            let point = section.centre_input.then_some(first);
            next_point += section.inputs(&self.plant).len();
            let core = |e| self.refused(i, &punctual_core::Error::within(e, &section.name));
            let refused = |e: punctual_models::Error| {
                ConfigurationError::new(format!("barrier[{i}].{}", e.field()), e.message())
            };
            builder = match self.plant.reference() {
                _ if section.shape == ShapeName::External => self.add_external(builder, i, first)?,
                _ if section.shape == ShapeName::Plugin => {
                    let barrier = self.plant.code()?.barrier(section.output_index(&self.plant));
                    let barrier = barrier.map_err(refused)?;
                    let found = barrier.relative_degree(&self.plant.ranges());
                    self.add_model(builder, i, found, |n| barrier.source(n).map_err(refused))?
                }
                Some(plant) if section.shape != ShapeName::Expression => {
                    let adding = Adding { configuration: self, plant, builder, index: i, point };
                    section.visit(plant, adding).map_err(core)??
                }
                _ => {
                    let expression = section.expression.as_deref().unwrap_or_default();
                    let barrier = self.plant.expressions()?.barrier(expression).map_err(refused)?;
                    let found = barrier.relative_degree(&self.plant.ranges());
                    self.add_model(builder, i, found, |n| barrier.source(n).map_err(refused))?
                }
            };
            let (begin, end) = self.window(i)?;
            let strictness = match (section.penalty, section.priority) {
                (penalty, Some(_)) if penalty != 0.0 => {
                    let message = "belongs to hard barriers, this one has a penalty";
                    return Err(ConfigurationError::new(format!("barrier[{i}].priority"), message));
                }
                (penalty, _) if penalty != 0.0 => Strictness::Soft(penalty),
                (_, Some(priority)) => Strictness::Priority(priority),
                _ => Strictness::KeepFirst,
            };
            builder = builder
                .window(begin, end)
                .and_then(|b| b.strictness(strictness))
                .map_err(|e| self.refused(i, &e))?;
        }
        let (mut min, mut max) = (Vec::new(), Vec::new());
        for input in inputs {
            let [low, high] = self.bounds.get(&input.name).copied().unwrap_or([-UNBOUNDED, UNBOUNDED]);
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
        let mut errors = vec![0.0; states + self.barrier_inputs().len()];
        for (error, state) in errors.iter_mut().zip(self.plant.states()) {
            *error = self.measurement_errors.get(&state.name).copied().unwrap_or(0.0);
        }
        builder
            .bounds(&min, &max)
            .and_then(|b| b.correction_limit(self.correction_limit))
            .and_then(|b| b.actuation_delay(self.actuation_delay))
            .and_then(|b| if self.period_max == 0.0 { Ok(b) } else { b.period_max(self.period_max) })
            .and_then(|b| b.sampling(self.sampling(self.experiment.step_size)))
            .and_then(|b| b.measurement_errors(&errors))
            .and_then(FilterBuilder::build)
            .map_err(|e| ConfigurationError::new(e.field(), e.message()))
    }

    /// The relative degree of each barrier; none for a configuration that cannot be built.
    pub fn relative_degrees(&self) -> Vec<usize> {
        self.build().map(|filter| filter.relative_degrees().collect()).unwrap_or_default()
    }

    /// Whether an input has a bound.
    pub fn is_bounded(&self) -> bool {
        self.bounds.values().any(|[min, max]| *min > -UNBOUNDED || *max < UNBOUNDED)
    }

    /// The inputs that belong to barriers; they follow the states of the plant in the filter's.
    pub fn barrier_inputs(&self) -> Vec<BarrierInput> {
        self.barrier.iter().flat_map(|b| b.inputs(&self.plant)).collect()
    }

    /// When barrier `index` begins and ceases to be enforced.
    fn window(&self, index: usize) -> Result<(Begin, End), ConfigurationError> {
        let section = &self.barrier[index];
        let refuse = |field: &str, message: String| {
            Err(ConfigurationError::new(format!("barrier[{index}].{field}"), message))
        };
        let begin = match (&section.after, section.begin) {
            (Some(_), begin) if begin != 0.0 => {
                return refuse("begin", format!("is {begin}, must be 0 beside `after`"));
            }
            (Some(name), _) => match self.barrier[..index].iter().position(|b| b.name == *name) {
                Some(other) => Begin::AfterArrival(other),
                None => return refuse("after", format!("is {name:?}, must be the name of a barrier above")),
            },
            (None, begin) if begin > 0.0 => Begin::At(begin),
            (None, _) => Begin::AtOnce,
        };
        let end = match (section.until_arrival, section.end) {
            (true, end) if end != 0.0 => {
                return refuse("end", format!("is {end}, must be 0 beside `until_arrival`"));
            }
            (true, _) => End::OnArrival,
            (false, end) if end > 0.0 => End::At(end),
            (false, _) => End::Never,
        };
        Ok((begin, end))
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
        let dim = NX + self.barrier_inputs().len();
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

    /// Adds barrier `index`, whose derivatives are the filter's states from number `first` on.
    fn add_external(
        &self,
        builder: FilterBuilder,
        index: usize,
        first: usize,
    ) -> Result<FilterBuilder, ConfigurationError> {
        let section = &self.barrier[index];
        let dim = self.plant.states().len() + self.barrier_inputs().len();
        let own: Vec<usize> = (first..first + section.inputs(&self.plant).len()).collect();
        lie::external(section.relative_degree.unwrap_or(1), self.plant.inputs().len())
            .and_then(|source| lie::embedded(source, dim, &own))
            .and_then(|source| builder.source(&section.name, source, section.settings()?))
            .map_err(|e| self.refused(index, &e))
    }

    /// Adds barrier `index`, of the relative degree `found`; `source` makes its derivatives.
    fn add_model(
        &self,
        builder: FilterBuilder,
        index: usize,
        found: RelativeDegree,
        source: impl FnOnce(usize) -> Result<Box<dyn DerivativeSource>, ConfigurationError>,
    ) -> Result<FilterBuilder, ConfigurationError> {
        let section = &self.barrier[index];
        let named = |e: punctual_core::Error| self.refused(index, &e.within(&section.name));
        let n = found.require(None).map_err(named)?;
        let own: Vec<usize> = (0..self.plant.states().len()).collect();
        let dim = own.len() + self.barrier_inputs().len();
        let source = lie::embedded(source(n)?, dim, &own);
        let settings = section.settings().map_err(named)?;
        builder.source(&section.name, source.map_err(named)?, settings).map_err(|e| self.refused(index, &e))
    }

    /// The core's refusal of barrier `index` in the words of the configuration.
    fn refused(&self, index: usize, error: &punctual_core::Error) -> ConfigurationError {
        if let Some(found) = error.relative_degree() {
            let inputs = self.plant.inputs();
            let found_in_words = found.describe(|i| inputs.get(i).map_or("u", |s| &s.name).to_owned());
            let advice = match (self.plant.model, found) {
                (Some(ModelName::BicycleSmallSlip), _) => {
                    "; one constraint cannot use both, so take the model bicycle_small_slip_rate or bicycle_kinematic, with `[integrator]` where the plant is steered by the angle itself"
                }
                (None, RelativeDegree::Mixed(_)) => {
                    "; one constraint cannot use both, so make the input that enters first a state whose derivative is the new input"
                }
                (None, RelativeDegree::NotFinite) => "; give the states a range (`min`, `max`)",
                _ => "",
            };
            let message = format!("its relative degree along {} {found_in_words}{advice}", self.plant.name());
            return ConfigurationError::new(format!("barrier[{index}]"), message);
        }
        let field = error.field().split_once('.').map_or(error.field(), |(_, field)| field);
        ConfigurationError::new(format!("barrier[{index}].{field}"), error.message())
    }
}
