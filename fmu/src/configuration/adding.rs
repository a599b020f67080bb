//! A barrier on its way into a filter: its derivatives along the plant.

use std::cell::OnceCell;
use std::sync::Arc;

use punctual_core::Error;
use punctual_core::dynamics::{ControlAffine, WithPoint};
use punctual_core::filter::FilterBuilder;
use punctual_core::lie::{self, DerivativeSource, RelativeDegree};
use punctual_core::plants::{
    Bicycle, KinematicBicycle, PointMass, Signal, SmallSlipBicycle, SmallSlipBicycleWithRate, Unicycle,
};
use punctual_models::Model;
use punctual_models::evaluated::CodeModel;

use super::barrier::Region;
use super::parameter::UNBOUNDED;
use super::{
    BarrierSection, ConfigurationError, FilterConfiguration, ModelName, PlantSection, ReferenceSection,
};

/// The plant of a configuration, along which all its barriers are: each form that a barrier needs is made once.
#[derive(Default)]
pub(super) struct Forms {
    reference: OnceCell<Reference>,
    expressions: OnceCell<Model>,
    code: OnceCell<CodeModel>,
}

/// A plant that has a name.
#[derive(Clone)]
enum Reference {
    PointMass(Arc<PointMass>),
    Unicycle(Arc<Unicycle>),
    Bicycle(Arc<Bicycle>),
    SmallSlip(Arc<SmallSlipBicycle>),
    SmallSlipRate(Arc<SmallSlipBicycleWithRate>),
    Kinematic(Arc<KinematicBicycle>),
}

/// The content of `cell`, which `make` makes at first.
fn made<T>(
    cell: &OnceCell<T>,
    make: impl FnOnce() -> Result<T, ConfigurationError>,
) -> Result<&T, ConfigurationError> {
    match cell.get() {
        Some(content) => Ok(content),
        None => make().map(|content| cell.get_or_init(|| content)),
    }
}

impl Forms {
    /// The plant `section` as code of this crate.
    fn reference(&self, section: &ReferenceSection) -> Result<&Reference, ConfigurationError> {
        made(&self.reference, || {
            Ok(match section.model {
                ModelName::PointMass => Reference::PointMass(Arc::new(PointMass)),
                ModelName::Unicycle => Reference::Unicycle(Arc::new(Unicycle)),
                ModelName::Bicycle => Reference::Bicycle(Arc::new(section.bicycle()?)),
                ModelName::BicycleSmallSlip => Reference::SmallSlip(Arc::new(section.small_slip()?)),
                ModelName::BicycleSmallSlipRate => {
                    Reference::SmallSlipRate(Arc::new(section.small_slip()?.with_rate()))
                }
                ModelName::BicycleKinematic => Reference::Kinematic(Arc::new(section.kinematic()?)),
                ModelName::BicycleKinematicAngle | ModelName::BicycleKinematicSlip => {
                    return Err(not_affine(section.model));
                }
            })
        })
    }

    /// The plant as expressions.
    fn expressions(&self, plant: &PlantSection) -> Result<&Model, ConfigurationError> {
        made(&self.expressions, || {
            let model = plant.expressions()?;
            let Some(section) = plant.reference() else { return Ok(model) };
            Ok(model.as_form_of(match self.reference(section)?.clone() {
                Reference::PointMass(plant) => plant,
                Reference::Unicycle(plant) => plant,
                Reference::Bicycle(plant) => plant,
                Reference::SmallSlip(plant) => plant,
                Reference::SmallSlipRate(plant) => plant,
                Reference::Kinematic(plant) => plant,
            }))
        })
    }
}

/// A barrier of a configuration, and the filter that it goes into.
pub(super) struct Adding<'a> {
    pub(super) configuration: &'a FilterConfiguration,
    pub(super) plant: &'a Forms,
    pub(super) builder: FilterBuilder,
    /// The index of the barrier.
    pub(super) index: usize,
    /// The index of the first state of the filter that is an input of this barrier.
    pub(super) first: usize,
    /// What becomes of it where its inputs enter at different orders.
    pub(super) mixed_degree: MixedDegree<'a>,
}

/// What becomes of barriers whose inputs enter at different orders.
pub(super) enum MixedDegree<'a> {
    /// They are refused: one row cannot use every input.
    Refused,
    /// They are taken: plans use every input.
    Taken,
    /// They are taken, and reported by their index with what was found.
    Reported(&'a mut Vec<(usize, RelativeDegree)>),
}

impl MixedDegree<'_> {
    /// The same, for one barrier.
    pub(super) fn reborrow(&mut self) -> MixedDegree<'_> {
        match self {
            Self::Refused => MixedDegree::Refused,
            Self::Taken => MixedDegree::Taken,
            Self::Reported(list) => MixedDegree::Reported(list),
        }
    }
}

impl Adding<'_> {
    /// The states that are the position of the barrier, on a plant of expressions; empty of a barrier without one.
    pub(super) fn own_position(&self) -> &[String] {
        &self.section().position
    }

    /// Whether the plant is one of expressions.
    pub(super) fn is_own(&self) -> bool {
        matches!(self.configuration.plant, PlantSection::Expressions(_))
    }

    /// The order of the derivative that the row is on, for the relative degree `found`; `driven` is that with inputs that are
    /// not 0, where it is known.
    fn degree(
        &mut self,
        found: RelativeDegree,
        driven: impl FnOnce() -> Option<RelativeDegree>,
    ) -> Result<usize, Error> {
        // A plan moves every input, whatever the row moves.
        let n = match (&self.mixed_degree, found.least()) {
            (MixedDegree::Taken | MixedDegree::Reported(_), Some(n)) => n,
            _ => found.clone().require(None)?,
        };
        // The row is right, but other inputs may come in later.
        let later = || match found {
            RelativeDegree::Uniform(_) => driven().filter(|d| matches!(d, RelativeDegree::Mixed(_))),
            _ => Some(found),
        };
        match &mut self.mixed_degree {
            MixedDegree::Reported(list) => {
                list.extend(
                    later().filter(|later| later.least() == Some(n)).map(|later| (self.index, later)),
                );
            }
            // What no row limits has to be limited by bounds.
            MixedDegree::Refused if self.configuration.has_free_input() => {
                if let Some(later) = later().filter(|later| self.configuration.frees_later(later, n)) {
                    later.require(None)?;
                }
            }
            MixedDegree::Refused | MixedDegree::Taken => {}
        }
        Ok(n)
    }

    fn section(&self) -> &BarrierSection {
        &self.configuration.barrier[self.index]
    }

    /// The core's refusal, in the terms of the configuration.
    fn refused(&self, error: &Error) -> ConfigurationError {
        self.configuration.refused(self.index, error)
    }

    /// The same refusal for an error that does not name its barrier.
    fn named(&self, error: Error) -> ConfigurationError {
        self.refused(&error.within(&self.section().name))
    }

    /// Adds a region, which `barrier` makes for a plant with these states, along a reference plant.
    pub(super) fn along(
        self,
        barrier: impl FnOnce(&'static [Signal]) -> Result<Region, Error>,
    ) -> Result<FilterBuilder, ConfigurationError> {
        let Some(plant) = self.configuration.plant.reference() else {
            let field = format!("barrier[{}].shape", self.index);
            return Err(ConfigurationError::new(field, "is for the plants that have a name"));
        };
        let barrier = barrier(plant.model.states()).map_err(|e| self.named(e))?;
        match self.plant.reference(plant)?.clone() {
            Reference::PointMass(plant) => self.along_plant::<_, 4, 8>(plant, barrier),
            Reference::Unicycle(plant) => self.along_plant::<_, 4, 8>(plant, barrier),
            Reference::Bicycle(plant) => self.along_plant::<_, 4, 8>(plant, barrier),
            Reference::SmallSlip(plant) => self.along_plant::<_, 4, 8>(plant, barrier),
            Reference::SmallSlipRate(plant) => self.along_plant::<_, 5, 9>(plant, barrier),
            Reference::Kinematic(plant) => self.along_plant::<_, 5, 9>(plant, barrier),
        }
    }

    /// Adds it along a plant. `EXTENDED` = `NX` + 4 states where the barrier follows a point.
    fn along_plant<P, const NX: usize, const EXTENDED: usize>(
        mut self,
        plant: Arc<P>,
        barrier: Region,
    ) -> Result<FilterBuilder, ConfigurationError>
    where
        P: ControlAffine<NX, 2> + Copy + Send + Sync + 'static,
    {
        let source = if self.section().shape.followed().is_none() {
            self.degree(lie::detected::<_, _, NX, 2>(&*plant, &barrier), || None)
                .and_then(|n| lie::along(plant, barrier, n))
        } else {
            let (beside, first) = (WithPoint::<_, NX>(*plant), self.first);
            self.degree(lie::detected::<_, _, EXTENDED, 2>(&beside, &barrier), || None)
                .and_then(|n| lie::following::<_, _, NX, EXTENDED, 2>(plant, barrier, n, first))
        };
        self.source(source)
    }

    /// Adds an expression, along any plant.
    pub(super) fn expression(self, text: &str) -> Result<FilterBuilder, ConfigurationError> {
        let plant = &self.configuration.plant;
        let model = self.plant.expressions(plant)?;
        let barrier = model.barrier(text).map_err(|e| self.of_model(&e))?;
        let ranges = plant.ranges();
        let found = barrier.relative_degree(&ranges);
        self.model(found, || barrier.driven_degree(&ranges), |n| barrier.source(n))
    }

    /// Adds the barrier of the plant's plug-in that is called `output`.
    pub(super) fn plugin(self, output: &str) -> Result<FilterBuilder, ConfigurationError> {
        let plant = &self.configuration.plant;
        let Some(plugin) = plant.plugin() else {
            let field = format!("barrier[{}].shape", self.index);
            return Err(ConfigurationError::new(field, "is for the plants that are a plug-in"));
        };
        let position = plant.plugin_barriers().iter().position(|b| b.name == output);
        let model = made(&self.plant.code, || plugin.code())?;
        let barrier = model.barrier(position.unwrap_or(usize::MAX)).map_err(|e| self.of_model(&e))?;
        let ranges = plant.ranges();
        let found = barrier.relative_degree(&ranges);
        self.model(found, || barrier.driven_degree(&ranges), |n| barrier.source(n))
    }

    /// Adds a barrier whose derivatives are the filter's states from [`Self::first`] on.
    pub(super) fn external(self, degree: usize) -> Result<FilterBuilder, ConfigurationError> {
        let source = lie::external(degree, self.configuration.plant.inputs().len(), self.first);
        self.source(source)
    }

    /// Adds a barrier of the relative degree `found`, and `driven` with inputs; `source` makes its derivatives.
    fn model(
        mut self,
        found: RelativeDegree,
        driven: impl FnOnce() -> RelativeDegree,
        source: impl FnOnce(usize) -> Result<Box<dyn DerivativeSource>, punctual_models::Error>,
    ) -> Result<FilterBuilder, ConfigurationError> {
        let n = self.degree(found, || Some(driven())).map_err(|e| self.named(e))?;
        let source = source(n).map_err(|e| self.of_model(&e))?;
        self.source(Ok(source))
    }

    fn source(
        self,
        source: Result<Box<dyn DerivativeSource>, Error>,
    ) -> Result<FilterBuilder, ConfigurationError> {
        let (configuration, index) = (self.configuration, self.index);
        let settings = self.section().settings().map_err(|e| self.named(e))?;
        let source = source.map_err(|e| self.named(e))?;
        let added = self.builder.source(&configuration.barrier[index].name, source, settings);
        added.map_err(|e| configuration.refused(index, &e))
    }

    /// The refusal of a model or its barrier.
    fn of_model(&self, error: &punctual_models::Error) -> ConfigurationError {
        ConfigurationError::new(format!("barrier[{}].{}", self.index, error.field()), error.message())
    }
}

impl FilterConfiguration {
    /// Whether input `i` lacks a bound.
    fn is_free(&self, i: usize) -> bool {
        let name = self.plant.inputs().into_iter().nth(i).map(|input| input.name);
        let bounds = name.and_then(|name| self.bounds.get(&name).copied());
        bounds.is_none_or(|[min, max]| min <= -UNBOUNDED || max >= UNBOUNDED)
    }

    fn has_free_input(&self) -> bool {
        (0..self.plant.inputs().len()).any(|i| self.is_free(i))
    }

    /// Whether an input without bounds enters h later than the row's derivative `n`, by the finding `degree`.
    fn frees_later(&self, degree: &RelativeDegree, n: usize) -> bool {
        let RelativeDegree::Mixed(orders) = degree else { return false };
        degree.least() == Some(n)
            && orders
                .iter()
                .enumerate()
                .any(|(i, order)| order.is_some_and(|order| order > n) && self.is_free(i))
    }

    /// The core's refusal of barrier `index`, in the terms of the configuration.
    pub(super) fn refused(&self, index: usize, error: &Error) -> ConfigurationError {
        if let Some(found) = error.relative_degree() {
            let inputs = self.plant.inputs();
            let name = |i: usize| inputs.get(i).map_or("u", |s| &s.name).to_owned();
            let mixed_degree = |advice: &str| {
                format!(
                    "; one row cannot use them all. Plans can, but none are followed: {}. Mend that{advice}",
                    self.unassured()
                )
            };
            let advice = match (self.plant.model(), found) {
                (Some(ModelName::BicycleSmallSlip), _) => mixed_degree(
                    ", or take the model bicycle_small_slip_rate or bicycle_kinematic, with `[integrator]` where the plant is steered by the angle itself",
                ),
                (None, RelativeDegree::Mixed(orders)) => mixed_degree(&integrators(orders, name)),
                (None, RelativeDegree::Varying(_)) => mixed_degree(""),
                (None, RelativeDegree::NotFinite) => "; give the states a range (`min`, `max`)".to_owned(),
                (Some(_), RelativeDegree::NotFinite) => "; its numbers are too large".to_owned(),
                _ => String::new(),
            };
            let (plant, found) = (self.plant.name(), found.describe(name));
            let message = format!("its relative degree along {plant} {found}{advice}");
            return ConfigurationError::new(format!("barrier[{index}]"), message);
        }
        let field = error.field().split_once('.').map_or(error.field(), |(_, field)| field);
        ConfigurationError::new(format!("barrier[{index}].{field}"), error.message())
    }
}

/// The integrators after which each input enters the same derivative, as an advice; `orders` as in [`RelativeDegree::Mixed`].
fn integrators(orders: &[Option<usize>], name: impl Fn(usize) -> String) -> String {
    let last = orders.iter().flatten().copied().max().unwrap_or_default();
    let missing = orders.iter().enumerate().filter_map(|(i, n)| Some((i, last - (*n)?)));
    let before: Vec<_> = missing
        .filter(|(_, count)| *count > 0)
        .map(|(i, count)| {
            format!("{count} integrator{} before {}", if count > 1 { "s" } else { "" }, name(i))
        })
        .collect();
    format!(", or put {}: make it a state whose derivative is the new input", before.join(" and "))
}

/// The error that a filter cannot have `model`, which is not affine in its inputs.
pub(super) fn not_affine(model: ModelName) -> ConfigurationError {
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
