//! A plant and its barriers as tapes alone, for the rows of a filter: what is left of a model where expressions were read
//! elsewhere. It takes no std, and barriers share the memory of their evaluation.
//!
//! The derivatives have the bits of [`Barrier::source`](../struct.Barrier.html#method.source). Plans and derivatives of the
//! filter ask for more than these sources give.

use alloc::boxed::Box;
use alloc::format;
use alloc::string::String;
use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;
use core::any::Any;

use punctual_core::internal::SUBSTEPS;
use punctual_core::jet::Dual;
use punctual_core::lie::{Ahead, DerivativeSource, Derivatives, PlantId, Predict, SharedPlant};
use punctual_core::scalar::Scalar;
use punctual_core::{MAX_INPUTS, MAX_RELATIVE_DEGREE};
use spin::Mutex;

#[cfg(feature = "serde")]
mod size;
#[cfg(feature = "serde")]
pub use size::{BarrierSize, PlantSize, Tallied, Tally, memory};

use crate::motion::{Along, Equations, Held, moved, rates_at};
use crate::operation::{Register, Step, needed};
use crate::series::Series;
use crate::{Error, MAX_OPERATIONS, MAX_STATES};

/// The operations of a plant ẋ = f(x) + g(x) u. Registers: states, inputs, time, then results in their order.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PlantTape {
    pub(crate) states: usize,
    pub(crate) inputs: usize,
    pub(crate) steps: Vec<Step>,
    /// The registers of ẋ.
    pub(crate) derivatives: Vec<Register>,
}

/// The operations that a barrier adds to those of its plant. Registers: those of the plant, then results in their order.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct BarrierTape {
    pub(crate) steps: Vec<Step>,
    pub(crate) h: Register,
}

/// Checks that each of `steps` reads what is known before it, and writes the next register; `known` counts them.
///
/// # Errors
///
/// Another order, or too many.
fn check(field: &str, steps: &[Step], known: &mut Register) -> Result<(), Error> {
    if steps.len() > MAX_OPERATIONS {
        let message = format!("has {} operations, must have at most {MAX_OPERATIONS}", steps.len());
        return Err(Error::new(field, message));
    }
    for (i, step) in steps.iter().enumerate() {
        if step.to != *known || step.operation.reads().into_iter().flatten().any(|read| read >= *known) {
            return Err(Error::new(field, format!("is damaged at operation {i}")));
        }
        *known += step.operation.results();
    }
    Ok(())
}

impl PlantTape {
    /// The number of states.
    pub fn states(&self) -> usize {
        self.states
    }

    /// The number of inputs.
    pub fn inputs(&self) -> usize {
        self.inputs
    }

    fn registers(&self) -> usize {
        let results = self.steps.iter().map(|step| step.operation.results()).sum::<usize>();
        self.states + self.inputs + 1 + results
    }

    fn check(&self) -> Result<(), Error> {
        for (field, number, most) in
            [("states", self.states, MAX_STATES), ("inputs", self.inputs, MAX_INPUTS)]
        {
            if number == 0 || number > most {
                return Err(Error::new(field, format!("is {number}, must be 1 to {most}")));
            }
        }
        let mut known = self.states + self.inputs + 1;
        check("plant", &self.steps, &mut known)?;
        let is_whole = self.derivatives.len() == self.states && self.derivatives.iter().all(|d| *d < known);
        if is_whole { Ok(()) } else { Err(Error::new("plant", "is damaged in its derivatives")) }
    }
}

/// The sources of `barriers`, each with its relative degree, along `plant`.
///
/// # Errors
///
/// A tape that is damaged or too long; more inputs or a higher relative degree than there is room for.
pub fn sources(
    plant: PlantTape,
    barriers: Vec<(BarrierTape, usize)>,
) -> Result<Vec<Box<dyn DerivativeSource>>, Error> {
    plant.check()?;
    let (start, mut registers, mut highest) = (plant.registers(), 0, 1);
    for (i, (barrier, n)) in barriers.iter().enumerate() {
        let named = |message: String| Error::new(format!("barrier[{i}]"), message);
        let mut known = start;
        check("operations", &barrier.steps, &mut known).map_err(|e| named(format!("{e}")))?;
        if barrier.h >= known {
            return Err(named("is damaged in its result".into()));
        }
        if !(1..=MAX_RELATIVE_DEGREE).contains(n) {
            return Err(named(format!("has relative degree {n}, must have 1 to {MAX_RELATIVE_DEGREE}")));
        }
        (registers, highest) = (registers.max(known), highest.max(*n));
    }
    Ok(match plant.inputs {
        ..=2 if MAX_INPUTS > 4 => made::<2>(plant, barriers, registers, highest),
        _ => made::<MAX_INPUTS>(plant, barriers, registers, highest),
    })
}

fn made<const M: usize>(
    plant: PlantTape,
    barriers: Vec<(BarrierTape, usize)>,
    registers: usize,
    highest: usize,
) -> Vec<Box<dyn DerivativeSource>> {
    let start = plant.registers();
    let plant = Arc::new(plant);
    let alone = Recorded { plant: Arc::clone(&plant), barrier: None, of_value: false, registers: start };
    let along = Recorded { registers, ..alone.clone() };
    let scratch =
        Scratch::<M> { along: Along::new(&alone, &along, highest), held: Held::new(&alone, &along) };
    let scratch = Arc::new(Mutex::new(scratch));
    let barrier = |(tape, n): (BarrierTape, usize)| {
        let read = tape.steps.iter().flat_map(|step| step.operation.reads()).flatten();
        let read: Vec<_> = read.chain([tape.h]).filter(|register| *register < start).collect();
        let own = Own { before: needed(&plant.steps, &read, start), steps: tape.steps, h: tape.h };
        let barrier = Some(Arc::new(own));
        let equations = Recorded { barrier, ..along.clone() };
        Box::new(Source { scratch: Arc::clone(&scratch), equations, n }) as _
    };
    barriers.into_iter().map(barrier).collect()
}

/// The operations of a barrier.
struct Own {
    /// Those of the plant that its value takes.
    before: Vec<Step>,
    steps: Vec<Step>,
    h: Register,
}

/// A plant, and a barrier along it if there is one.
#[derive(Clone)]
struct Recorded {
    plant: Arc<PlantTape>,
    barrier: Option<Arc<Own>>,
    /// Whether only what its value takes is computed, where all states are given.
    of_value: bool,
    registers: usize,
}

impl Equations for Recorded {
    fn states(&self) -> usize {
        self.plant.states
    }

    fn inputs(&self) -> usize {
        self.plant.inputs
    }

    fn series<C: Scalar>(&self, orders: usize) -> Series<C> {
        Series::new(self.registers, orders)
    }

    fn advance<C: Scalar>(&mut self, series: &mut Series<C>, k: usize) {
        match &self.barrier {
            Some(own) if self.of_value => series.advance(&own.before, k),
            _ => series.advance(&self.plant.steps, k),
        }
        if let Some(own) = &self.barrier {
            series.advance(&own.steps, k);
        }
    }

    fn derivative(&self, i: usize) -> Register {
        self.plant.derivatives[i]
    }

    fn finish<C: Scalar>(&mut self, series: &mut Series<C>, n: usize) -> Register {
        let Some(own) = &self.barrier else { return 0 };
        series.advance(&own.before, n);
        series.advance(&own.steps, n);
        own.h
    }
}

/// Memory for evaluations, which the barriers of a filter share.
struct Scratch<const M: usize> {
    along: Along<Recorded, Dual<M>>,
    held: Held<Recorded>,
}

struct Source<const M: usize> {
    /// Only one filter has the sources of one memory, so that nobody ever waits for it.
    scratch: Arc<Mutex<Scratch<M>>>,
    equations: Recorded,
    n: usize,
}

impl<const M: usize> Source<M> {
    /// What `evaluate` does with the series of this barrier.
    fn along<T>(&self, evaluate: impl FnOnce(&mut Along<Recorded, Dual<M>>) -> T) -> T {
        let along = &mut self.scratch.lock().along;
        along.equations = self.equations.clone();
        along.n = self.n;
        evaluate(along)
    }

    /// The same with its values.
    fn held<T>(&self, evaluate: impl FnOnce(&mut Held<Recorded>) -> T) -> T {
        let held = &mut self.scratch.lock().held;
        let of_value = Recorded { of_value: true, ..self.equations.clone() };
        held.few_over.equations = of_value.clone();
        held.value.equations = of_value;
        evaluate(held)
    }

    fn of_plant<'a>(&self, x: &'a [f64]) -> &'a [f64] {
        &x[..self.equations.states()]
    }
}

impl<const M: usize> DerivativeSource for Source<M> {
    fn relative_degree(&self) -> usize {
        self.n
    }

    fn state_dim(&self) -> usize {
        self.equations.states()
    }

    fn input_dim(&self) -> usize {
        self.equations.inputs()
    }

    fn evaluate(&self, t: f64, x: &[f64], out: &mut Derivatives) {
        self.along(|along| along.derivatives(t, self.of_plant(x), out));
    }

    fn predict(&self) -> Option<&dyn Predict> {
        Some(self)
    }

    fn shared(&self) -> Option<&dyn SharedPlant> {
        Some(self)
    }
}

impl<const M: usize> SharedPlant for Source<M> {
    fn plant(&self) -> PlantId {
        PlantId::of(&self.scratch, [self.state_dim(), self.input_dim()])
    }

    fn rooms(&self) -> [Box<dyn Any + Send>; 2] {
        let arrival = vec![Dual::<M>::from(0.0); self.state_dim() + self.input_dim()];
        [Box::new(vec![0.0; self.state_dim()]), Box::new(arrival)]
    }

    fn motion(&self, x: &[f64], room: &mut dyn Any) {
        let Some(begin) = room.downcast_mut::<Vec<f64>>() else { return };
        begin.copy_from_slice(self.of_plant(x));
    }

    fn evaluate_along(&self, t: f64, motion: &dyn Any, out: &mut Derivatives) {
        match motion.downcast_ref::<Vec<f64>>() {
            Some(begin) => self.evaluate(t, begin, out),
            // A room of other sources.
            None => out.drift[self.n] = f64::NAN,
        }
    }

    fn motion_ahead(&self, x: &[f64], u: &[f64], duration: f64, room: &mut dyn Any) {
        let Some(arrival) = room.downcast_mut::<Vec<Dual<M>>>() else { return };
        self.along(|along| along.motion_ahead(self.of_plant(x), u, duration, arrival));
    }

    fn ahead_of_row_along(&self, t: f64, motion: &dyn Any, out: &mut Ahead) {
        match motion.downcast_ref::<Vec<Dual<M>>>() {
            Some(arrival) => self.along(|along| along.ahead_along(t, arrival, out)),
            None => out.value[self.n] = f64::NAN,
        }
    }
}

impl<const M: usize> Predict for Source<M> {
    fn flow(&self, x: &mut [f64], u: &[f64], duration: f64) {
        let x = &mut x[..self.equations.states()];
        self.held(|held| moved(&mut held.value.flow, x, u, duration, SUBSTEPS));
    }

    fn ahead(&self, t: f64, x: &[f64], u: &[f64], duration: f64, out: &mut Ahead) {
        self.along(|along| along.ahead_held(t, self.of_plant(x), u, duration, out));
    }

    fn rate(&self, x: &[f64], u: &[f64], out: &mut [f64]) {
        let (own, others) = out.split_at_mut(self.equations.states());
        self.held(|held| rates_at(&mut held.value.flow, self.of_plant(x), u, own));
        others.fill(0.0);
    }

    fn value(&self, t: f64, x: &[f64]) -> f64 {
        self.held(|held| held.value.follow(t, |i, _| x[i]))
    }

    fn lowest_held(&self, t: f64, x: &[f64], u: &[f64], duration: f64, wanted: f64) -> Option<f64> {
        self.held(|held| held.lowest(t, self.of_plant(x), u, duration, wanted))
    }
}
