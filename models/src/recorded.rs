//! A plant and its barriers as tapes alone, for the rows of a filter: what is left of a model where expressions were read
//! elsewhere. It takes no std, and barriers share the memory of their evaluation.
//!
//! The derivatives have the bits of [`Barrier::source`](../struct.Barrier.html#method.source). Plans and derivatives of the
//! filter ask for more than these sources give.

use alloc::boxed::Box;
use alloc::format;
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

use crate::motion::{Along, Equations, Held, moved, rates_at, write, write_derivatives};
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

/// A plant along which barriers become sources one by one.
pub struct Recording(Made);

/// With room for the derivatives along as many inputs.
enum Made {
    Two(Plant<2>),
    Most(Plant<MAX_INPUTS>),
}

impl Recording {
    /// Barriers along `plant` with tapes of at most `results` results and relative degrees of at most `degree`.
    ///
    /// # Errors
    ///
    /// A tape that is damaged or too long; more inputs or a higher relative degree than there is room for.
    pub fn new(plant: PlantTape, results: usize, degree: usize) -> Result<Self, Error> {
        plant.check()?;
        check_degree(degree)?;
        if results > 2 * MAX_OPERATIONS {
            return Err(Error::new(
                "results",
                format!("is {results}, must be at most {}", 2 * MAX_OPERATIONS),
            ));
        }
        Ok(Self(match plant.inputs {
            ..=2 if MAX_INPUTS > 4 => Made::Two(Plant::new(plant, results, degree)),
            _ => Made::Most(Plant::new(plant, results, degree)),
        }))
    }

    /// The derivatives of a barrier up to relative degree `n`.
    ///
    /// # Errors
    ///
    /// A tape that is damaged; more results or a higher relative degree than there is room for.
    pub fn source(&self, barrier: BarrierTape, n: usize) -> Result<Box<dyn DerivativeSource>, Error> {
        match &self.0 {
            Made::Two(plant) => plant.source(barrier, n),
            Made::Most(plant) => plant.source(barrier, n),
        }
    }
}

fn check_degree(n: usize) -> Result<(), Error> {
    if (1..=MAX_RELATIVE_DEGREE).contains(&n) {
        return Ok(());
    }
    Err(Error::new("relative_degree", format!("is {n}, must be 1 to {MAX_RELATIVE_DEGREE}")))
}

/// A plant, and the memory that all sources along it share.
struct Plant<const M: usize> {
    along: Recorded,
    degree: usize,
    scratch: Arc<Mutex<Scratch<M>>>,
}

impl<const M: usize> Plant<M> {
    fn new(plant: PlantTape, results: usize, degree: usize) -> Self {
        let start = plant.registers();
        let alone = Recorded { plant: Arc::new(plant), barrier: None, of_value: false, registers: start };
        let along = Recorded { registers: start + results, ..alone.clone() };
        let scratch = Scratch {
            along: Along::new(&alone, &along, degree),
            values: Along::new(&alone, &along, degree),
            held: Held::new(&alone, &along),
            motion: None,
            motions: 0,
        };
        Self { along, degree, scratch: Arc::new(Mutex::new(scratch)) }
    }

    fn source(&self, tape: BarrierTape, n: usize) -> Result<Box<dyn DerivativeSource>, Error> {
        let plant = &self.along.plant;
        let start = plant.registers();
        let mut known = start;
        check("barrier", &tape.steps, &mut known)?;
        if tape.h >= known || known > self.along.registers || n > self.degree {
            return Err(Error::new("barrier", "is damaged"));
        }
        check_degree(n)?;
        let read = tape.steps.iter().flat_map(|step| step.operation.reads()).flatten();
        let read = read.chain([tape.h]).filter(|register| *register < start);
        let before = needed(&plant.steps, read, start).into_boxed_slice();
        let own = Own { before, steps: tape.steps, h: tape.h };
        let equations = Recorded { barrier: Some(Arc::new(own)), ..self.along.clone() };
        Ok(Box::new(Source { scratch: Arc::clone(&self.scratch), equations, n, degree: self.degree }))
    }
}

/// The operations of a barrier.
struct Own {
    /// Those of the plant that its value takes.
    before: Box<[Step]>,
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
    values: Along<Recorded, f64>,
    held: Held<Recorded>,
    /// The motion whose coefficients the registers of the plant in `along` hold, if they hold one.
    motion: Option<u64>,
    /// Number of motions so far.
    motions: u64,
}

/// A motion of the plant: its number, and the states and inputs at its beginning.
struct Motion<const M: usize> {
    number: u64,
    begin: Vec<Dual<M>>,
}

impl<const M: usize> Scratch<M> {
    /// The number of another motion.
    fn number(&mut self) -> u64 {
        self.motions += 1;
        self.motions
    }

    /// Computes the coefficients of the states and of all results of the plant, unless they are there.
    fn follow(&mut self, motion: &Motion<M>, degree: usize) {
        let Self { along: Along { flow, series, .. }, .. } = self;
        if self.motion == Some(motion.number) {
            return;
        }
        for (register, value) in motion.begin.iter().enumerate() {
            series.set(register, 0, *value);
        }
        let equations = &mut flow.equations;
        for k in 0..=degree {
            equations.advance(series, k);
            if k < degree {
                for i in 0..equations.states() {
                    let slope = series.get(equations.derivative(i), k);
                    series.set(i, k + 1, slope * (1.0 / (k + 1) as f64));
                }
            }
        }
        self.motion = Some(motion.number);
    }
}

struct Source<const M: usize> {
    /// Only one filter has the sources of one memory, so that nobody ever waits for it.
    scratch: Arc<Mutex<Scratch<M>>>,
    equations: Recorded,
    n: usize,
    /// The highest relative degree of all.
    degree: usize,
}

impl<const M: usize> Source<M> {
    /// What `evaluate` does with the series of this barrier.
    fn along<T>(&self, evaluate: impl FnOnce(&mut Along<Recorded, Dual<M>>) -> T) -> T {
        let scratch = &mut *self.scratch.lock();
        scratch.motion = None;
        scratch.along.equations = self.equations.clone();
        scratch.along.n = self.n;
        evaluate(&mut scratch.along)
    }

    /// The same with its values alone.
    fn values<T>(&self, evaluate: impl FnOnce(&mut Along<Recorded, f64>) -> T) -> T {
        let values = &mut self.scratch.lock().values;
        values.equations = self.equations.clone();
        evaluate(values)
    }

    /// The coefficients of h up to `n` along a motion that begins at time `t`, as derivatives.
    fn along_motion<T>(
        &self,
        t: f64,
        motion: &Motion<M>,
        n: usize,
        write: impl FnOnce(&dyn Fn(usize) -> Dual<M>) -> T,
    ) -> T {
        let scratch = &mut *self.scratch.lock();
        scratch.follow(motion, self.degree);
        let along = &mut scratch.along;
        along.series.set(motion.begin.len(), 0, Dual::from(t));
        if let Some(own) = &self.equations.barrier {
            for k in 0..=n {
                along.series.advance(&own.steps, k);
            }
            along.h = own.h;
        }
        write(&|k| along.derivative(k))
    }

    /// The same with bounds on its values.
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
        let begin = || vec![Dual::<M>::from(0.0); self.state_dim() + self.input_dim()];
        let room = || Box::new(Motion { number: 0, begin: begin() });
        [room(), room()]
    }

    fn motion(&self, x: &[f64], room: &mut dyn Any) {
        let Some(Motion { number, begin }) = room.downcast_mut::<Motion<M>>() else { return };
        for (i, value) in begin.iter_mut().enumerate() {
            *value = match x.get(i) {
                Some(x) if i < self.state_dim() => Dual::from(*x),
                _ => Dual::variable(0.0, i - self.state_dim()),
            };
        }
        *number = self.scratch.lock().number();
    }

    fn evaluate_along(&self, t: f64, motion: &dyn Any, out: &mut Derivatives) {
        let Some(motion) = motion.downcast_ref::<Motion<M>>() else {
            // A room of other sources.
            out.drift[self.n] = f64::NAN;
            return;
        };
        self.along_motion(t, motion, self.n, |derivative| {
            write_derivatives(out, self.n, self.input_dim(), derivative);
        });
    }

    fn motion_ahead(&self, x: &[f64], u: &[f64], duration: f64, room: &mut dyn Any) {
        let Some(Motion { number, begin }) = room.downcast_mut::<Motion<M>>() else { return };
        let scratch = &mut *self.scratch.lock();
        scratch.along.motion_ahead(self.of_plant(x), u, duration, begin);
        *number = scratch.number();
    }

    fn ahead_of_row_along(&self, t: f64, motion: &dyn Any, out: &mut Ahead) {
        let Some(motion) = motion.downcast_ref::<Motion<M>>() else {
            out.value[0] = f64::NAN;
            return;
        };
        self.along_motion(t, motion, self.n - 1, |derivative| {
            write(out, self.n - 1, self.input_dim(), derivative);
        });
    }
}

impl<const M: usize> Predict for Source<M> {
    fn flow(&self, x: &mut [f64], u: &[f64], duration: f64) {
        let x = &mut x[..self.equations.states()];
        self.held(|held| moved(&mut held.value.flow, x, u, duration, SUBSTEPS));
    }

    fn ahead(&self, t: f64, x: &[f64], u: &[f64], duration: f64, out: &mut Ahead) {
        self.along(|along| along.ahead_held(t, [self.of_plant(x), u], duration, self.n, out));
    }

    fn ahead_of_row(&self, t: f64, x: &[f64], u: &[f64], duration: f64, out: &mut Ahead) {
        self.along(|along| along.ahead_held(t, [self.of_plant(x), u], duration, self.n - 1, out));
    }

    fn values_ahead(
        &self,
        t: f64,
        x: &[f64],
        u: &[f64],
        duration: f64,
        out: &mut [f64; MAX_RELATIVE_DEGREE + 1],
    ) {
        self.values(|values| values.values_ahead(t, [self.of_plant(x), u], duration, self.n, out));
    }

    fn values_of_row(
        &self,
        t: f64,
        x: &[f64],
        u: &[f64],
        duration: f64,
        out: &mut [f64; MAX_RELATIVE_DEGREE + 1],
    ) {
        self.values(|values| values.values_ahead(t, [self.of_plant(x), u], duration, self.n - 1, out));
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
