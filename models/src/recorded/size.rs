//! The memory of recorded tapes, read from the bytes of a file without allocating.

use core::fmt;
use core::marker::PhantomData;
use core::mem::size_of;

use punctual_core::MAX_INPUTS;
use punctual_core::interval::Interval;
use punctual_core::jet::Dual;
use serde::de::{SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};

use super::{Own, PlantTape, Source};
use crate::operation::{Register, Step};

/// What is kept of a list that is read, instead of its elements.
pub trait Tally: Default {
    /// An element.
    type Item;

    /// Takes an element into account.
    fn add(&mut self, item: Self::Item);
}

/// Reads the bytes of a list, and keeps a [`Tally`] of it.
#[derive(Clone, Copy, Debug, Default)]
pub struct Tallied<T>(pub T);

impl<'de, T: Tally> Deserialize<'de> for Tallied<T>
where
    T::Item: Deserialize<'de>,
{
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        struct List<T>(PhantomData<T>);

        impl<'de, T: Tally> Visitor<'de> for List<T>
        where
            T::Item: Deserialize<'de>,
        {
            type Value = Tallied<T>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a list")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Tallied<T>, A::Error> {
                let mut tally = T::default();
                while let Some(item) = list.next_element()? {
                    tally.add(item);
                }
                Ok(Tallied(tally))
            }
        }

        from.deserialize_seq(List(PhantomData))
    }
}

/// The length of a list of operations.
#[derive(Clone, Copy, Debug, Default)]
struct Steps {
    steps: usize,
    registers: usize,
}

impl Tally for Steps {
    type Item = Step;

    fn add(&mut self, step: Step) {
        self.steps += 1;
        self.registers += step.operation.results();
    }
}

/// The length of a list of registers.
#[derive(Clone, Copy, Debug, Default)]
struct Registers(usize);

impl Tally for Registers {
    type Item = Register;

    fn add(&mut self, _: Register) {
        self.0 += 1;
    }
}

/// The size of a [`PlantTape`].
#[derive(Clone, Copy, Debug, Deserialize)]
pub struct PlantSize {
    states: usize,
    inputs: usize,
    steps: Tallied<Steps>,
    derivatives: Tallied<Registers>,
}

impl PlantSize {
    /// The number of states.
    pub fn states(&self) -> usize {
        self.states
    }

    /// The number of inputs.
    pub fn inputs(&self) -> usize {
        self.inputs
    }
}

/// The size of a [`BarrierTape`](super::BarrierTape), or the largest of several.
#[derive(Clone, Copy, Debug, Default, Deserialize)]
pub struct BarrierSize {
    steps: Tallied<Steps>,
    #[serde(rename = "h")]
    _h: Register,
}

impl BarrierSize {
    /// The number of its results.
    pub fn results(&self) -> usize {
        self.steps.0.registers
    }

    /// The larger of both.
    pub fn max(self, other: Self) -> Self {
        let (Tallied(a), Tallied(b)) = (self.steps, other.steps);
        let steps = Steps { steps: a.steps.max(b.steps), registers: a.registers.max(b.registers) };
        Self { steps: Tallied(steps), _h: 0 }
    }
}

/// What an allocation takes beyond its bytes.
const ROUNDING: usize = 2 * size_of::<usize>();

/// The most bytes that the tapes and their sources take, for `count` barriers no larger than `largest` and of no
/// higher relative degree than `degree`, that are read one by one; `None` where that is no number.
pub fn memory(plant: &PlantSize, count: usize, largest: &BarrierSize, degree: usize) -> Option<usize> {
    let PlantSize { states, inputs, steps: Tallied(of_plant), derivatives: Tallied(derivatives) } = plant;
    let (states, inputs, Tallied(own)) = (*states, *inputs, largest.steps);
    let of_list = |steps: usize| steps.checked_mul(size_of::<Step>())?.checked_add(ROUNDING);
    let before = states.checked_add(inputs)?.checked_add(1)?.checked_add(of_plant.registers)?;
    let registers = before.checked_add(own.registers)?;
    let orders = degree.checked_add(1)?;
    let of_plant_list = of_list(of_plant.steps)?;
    let plant = of_plant_list
        .checked_add(derivatives.0.checked_mul(size_of::<Register>())?)?
        .checked_add(size_of::<PlantTape>() + 4 * ROUNDING)?;
    let each = of_list(own.steps)?
        .checked_add(of_plant_list)?
        .checked_add(size_of::<Own>() + size_of::<Source<2>>() + 4 * ROUNDING)?;
    // The marks for one barrier at a time, and the rooms with which plants are compared.
    let temporary = before.checked_add(4 * (states + inputs) * size_of::<Dual<MAX_INPUTS>>())?;
    // The series, and the stages of the motion: of dual numbers, numbers and intervals.
    let dual =
        if inputs <= 2 && MAX_INPUTS > 4 { size_of::<Dual<2>>() } else { size_of::<Dual<MAX_INPUTS>>() };
    let stages = states.checked_mul(5)?.checked_add(before)?;
    let of_duals = registers.checked_mul(orders)?.checked_add(stages)?;
    let of_numbers = registers.checked_add(stages)?.checked_add(states)?;
    let of_intervals = registers.checked_mul(2)?.checked_add(stages)?.checked_add(2 * states)?;
    let series = of_duals
        .checked_mul(dual)?
        .checked_add(of_numbers.checked_mul(size_of::<f64>())?)?
        .checked_add(of_intervals.checked_mul(size_of::<Interval>())?)?
        .checked_add(size_of::<super::Scratch<2>>() + 24 * ROUNDING)?;
    count.checked_mul(each)?.checked_add(plant)?.checked_add(temporary)?.checked_add(series)
}
