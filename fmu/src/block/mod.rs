//! The computation of an FMU on arrays of values: a filter, a plant or a controller. No FMI, no pointers.

mod controller;
mod deviation;
mod disturbance;
mod filter;
mod plant;

use crate::configuration::{Configuration, ConfigurationError};
use crate::product::Product;
use controller::ControllerBlock;
use filter::FilterBlock;
use plant::PlantBlock;
use punctual_core::filter::FilterState;

/// The values of all variables, each at the index of its value reference in the array of its type
/// (the other two entries stay unused).
#[derive(Debug, Default, PartialEq)]
pub struct Values {
    /// Reals, in their units.
    pub reals: Vec<f64>,
    /// Integers and enumerations.
    pub integers: Vec<i32>,
    /// Booleans.
    pub booleans: Vec<bool>,
}

impl Clone for Values {
    fn clone(&self) -> Self {
        let mut copy = Self::default();
        copy.clone_from(self);
        copy
    }

    /// Reuses the memory, which a derived `Clone` would not.
    fn clone_from(&mut self, source: &Self) {
        let Self { reals, integers, booleans } = source;
        self.reals.clone_from(reals);
        self.integers.clone_from(integers);
        self.booleans.clone_from(booleans);
    }
}

impl Values {
    /// Zeros and `false` for `len` variables.
    pub fn zeros(len: usize) -> Self {
        Self { reals: vec![0.0; len], integers: vec![0; len], booleans: vec![false; len] }
    }
}

/// Everything that a block remembers besides its parameters.
#[derive(Clone, Debug, PartialEq)]
pub enum BlockState {
    /// State of a filter.
    Filter {
        /// `rearm` at the last step.
        rearm_seen: bool,
        /// The memory of the filter.
        memory: Box<FilterState>,
    },
    /// State of a plant.
    Plant {
        /// The state, in the order and units of the model. In a plant that deviates, its inputs follow: as asked before, and what
        /// has arrived.
        x: Vec<f64>,
    },
    /// State of a controller.
    Controller {
        /// The current waypoint, counted from 0.
        waypoint: u32,
    },
}

impl BlockState {
    /// The message if a state of another kind is needed.
    fn mismatch(&self, wanted: &str) -> String {
        let found = match self {
            Self::Filter { .. } => "filter",
            Self::Plant { .. } => "plant",
            Self::Controller { .. } => "controller",
        };
        format!("the state is that of a {found}, must be that of a {wanted}")
    }
}

/// The computation behind an instance.
pub trait Block: Send {
    /// Applies the parameters in `values` and returns to the state before the first step. May allocate; the
    /// other functions must not.
    ///
    /// # Errors
    ///
    /// A parameter outside its range or parameters that contradict each other; nothing has changed.
    fn configure(&mut self, values: &Values) -> Result<(), ConfigurationError>;

    /// Writes the outputs for the inputs at time `t` (s), without remembering anything.
    fn output(&mut self, t: f64, values: &mut Values);

    /// Replaces in the outputs what acts before the first step and its inputs, where that is not what [`Self::output`] wrote.
    fn begin(&self, _values: &mut Values) {}

    /// Writes to `derivative` the change along `direction` of the real outputs that [`Self::output`] would
    /// write. `direction` has a number for every real input; both are indexed by variables. `derivative` is
    /// initially zero. Nothing is remembered.
    ///
    /// # Errors
    ///
    /// The reason why the derivative is not known.
    fn differentiate(
        &mut self,
        t: f64,
        values: &Values,
        direction: &[f64],
        derivative: &mut [f64],
    ) -> Result<(), String>;

    /// Makes the step from `t` to `t + h` (s; h ≥ 0, both finite) and writes the outputs after it.
    ///
    /// # Errors
    ///
    /// A step that cannot be made; nothing has changed.
    fn step(&mut self, t: f64, h: f64, values: &mut Values) -> Result<(), String>;

    /// A notice to the user on the last step, if there is one; given once.
    fn notice(&mut self) -> Option<String> {
        None
    }

    /// Writes everything that is remembered to `state`; only allocates if that was of another kind or size.
    fn save(&self, state: &mut BlockState);

    /// Returns to the state that [`Self::save`] wrote under the same parameters. Everything that follows is
    /// bitwise the same.
    ///
    /// # Errors
    ///
    /// The state of another product; nothing has changed.
    fn restore(&mut self, state: &BlockState) -> Result<(), String>;

    /// Whether outputs depend on inputs without a step in between.
    fn direct_feedthrough(&self) -> bool;

    /// Whether a step may start after the end of the previous one.
    fn accepts_gaps(&self) -> bool;

    /// Shows in the outputs that a step was refused, if they can show it.
    fn show_refusal(&self, values: &mut Values);
}

/// The reason why the core refuses a step. It is out of line, since this only happens on misuse.
#[cold]
fn in_words(error: &punctual_core::Error) -> String {
    error.to_string()
}

/// The block of a product, configured with its start values.
///
/// # Errors
///
/// A configuration that cannot be built.
pub fn build(product: &Product) -> Result<Box<dyn Block>, ConfigurationError> {
    Ok(match &product.configuration {
        Configuration::Filter(c) => Box::new(FilterBlock::new(c.clone(), product)?),
        Configuration::Plant(c) => Box::new(PlantBlock::new(c.clone(), product.layout)?),
        Configuration::Controller(c) => Box::new(ControllerBlock::new(c.clone(), product.layout)?),
    })
}
