//! Work shared by barriers along one plant: the motion of the states at a sample, and the prediction for the last input
//! tried.

use alloc::boxed::Box;
use alloc::vec::Vec;
use core::any::{Any, TypeId};

use super::slot::BarrierSlot;
use crate::MAX_INPUTS;
use crate::lie::{Ahead, DerivativeSource, Derivatives, PlantId, SharedPlant};

/// The evaluations of one plant at the present sample.
struct Plant {
    /// The motion from the state at which the input begins to act.
    motion: Box<dyn Any + Send>,
    is_moving: bool,
    /// The prediction for the input held for the duration (s).
    ahead: Box<dyn Any + Send>,
    input: [f64; MAX_INPUTS],
    /// `None` before the first prediction.
    duration: Option<f64>,
}

impl Plant {
    fn new([motion, ahead]: Memories) -> Self {
        Self { motion, is_moving: false, ahead, input: [0.0; MAX_INPUTS], duration: None }
    }

    /// Whether `ahead` is that of the input `u` after `duration`, bit by bit: 0 and −0 are not the same.
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn is_ahead_of(&self, u: &[f64], duration: f64) -> bool {
        let mut same = self.duration.is_some_and(|known| known == duration);
        for (known, u) in self.input.iter().zip(u) {
            same &= known.to_bits() == u.to_bits();
        }
        same
    }
}

/// Two memories, for [`SharedPlant::motion`] and [`SharedPlant::motion_ahead`].
type Memories = [Box<dyn Any + Send>; 2];

/// What sources have in common that share memories.
#[derive(PartialEq)]
struct Key {
    plant: PlantId,
    relative_degree: usize,
    memories: [TypeId; 2],
}

/// The key of a source, and its memories.
fn key(source: &dyn DerivativeSource) -> Option<(Key, Memories)> {
    let shared = source.shared()?;
    let memories = shared.rooms();
    let types = memories.each_ref().map(|memory| (**memory).type_id());
    Some((
        Key { plant: shared.plant(), relative_degree: source.relative_degree(), memories: types },
        memories,
    ))
}

/// The source of a barrier, and the number of its plant.
type Source<'a> = (&'a dyn DerivativeSource, Option<usize>);

/// The plants along which there are several barriers of one relative degree.
pub(crate) struct SharedPlants(Vec<Plant>);

impl SharedPlants {
    /// The most bytes of the list for the barriers along one plant, as it grows: four plants, then eight.
    pub(crate) const MEMORY: usize = 12 * size_of::<Plant>();

    /// Finds the plants that the sources of `slots` share, and gives each source the number of its plant.
    pub(crate) fn of(slots: &mut [BarrierSlot]) -> Self {
        let mut plants = Vec::new();
        for i in 0..slots.len() {
            let (before, rest) = slots.split_at_mut(i);
            let slot = &mut rest[0];
            slot.plant = None;
            let Some((key, memories)) = key(&*slot.source) else { continue };
            let is_same =
                |other: &&mut BarrierSlot| self::key(&*other.source).is_some_and(|(other, _)| other == key);
            if let Some(other) = before.iter_mut().find(is_same) {
                let number = *other.plant.get_or_insert_with(|| {
                    plants.push(Plant::new(memories));
                    plants.len() - 1
                });
                slot.plant = Some(number);
            }
        }
        Self(plants)
    }

    /// Starts another sample.
    #[cfg_attr(not(feature = "small"), inline(always))]
    pub(crate) fn forget(&mut self) {
        for plant in &mut self.0 {
            (plant.is_moving, plant.duration) = (false, None);
        }
    }

    /// Writes the derivatives of the barrier of a source at time `t` (s) and the state `x`, at which the input of the sample
    /// begins to act.
    #[cfg_attr(not(feature = "small"), inline(always))]
    pub(crate) fn evaluate(&mut self, source: Source, t: f64, x: &[f64], out: &mut Derivatives) {
        let Some((plant, source)) = self.shared(source) else { return source.0.evaluate(t, x, out) };
        if !plant.is_moving {
            source.motion(x, &mut *plant.motion);
            plant.is_moving = true;
        }
        source.evaluate_along(t, &*plant.motion, out);
    }

    /// Writes what [`Predict::ahead_of_row`](crate::lie::Predict::ahead_of_row) does for the barrier of `slot`. `None` if
    /// there is no prediction.
    #[cfg_attr(not(feature = "small"), inline(always))]
    pub(crate) fn ahead_of_row(
        &mut self,
        slot: &BarrierSlot,
        t: f64,
        u: &[f64],
        duration: f64,
        out: &mut Ahead,
    ) -> Option<()> {
        let x = &slot.now.from;
        let Some((plant, source)) = self.shared((&*slot.source, slot.plant)) else {
            slot.source.predict()?.ahead_of_row(t, x, u, duration, out);
            return Some(());
        };
        if !plant.is_ahead_of(u, duration) {
            source.motion_ahead(x, u, duration, &mut *plant.ahead);
            plant.input[..u.len()].copy_from_slice(u);
            plant.duration = Some(duration);
        }
        source.ahead_of_row_along(t + duration, &*plant.ahead, out);
        Some(())
    }

    #[cfg_attr(not(feature = "small"), inline(always))]
    fn shared<'a>(&mut self, (source, plant): Source<'a>) -> Option<(&mut Plant, &'a dyn SharedPlant)> {
        Some((&mut self.0[plant?], source.shared()?))
    }
}
