//! The outputs of each barrier of a filter. A row has name, meaning, type and unit, value and derivative.

use punctual_core::filter::{BarrierDerivative, BarrierReport};

use crate::configuration::Unit::{self, Is, OfH, OfHighestDerivative};

/// An output of each barrier.
pub struct BarrierOutput {
    /// The variable's name after `<barrier>.`.
    pub name: &'static str,
    /// Meaning, as a text for the reader.
    pub description: &'static str,
    /// The type, and the source of the value.
    pub reading: Reading,
}

/// The type of an output, and how its value is read from a step's report.
pub enum Reading {
    /// A number, its unit, and its derivative along a direction of the inputs.
    Real(Unit, fn(&BarrierReport) -> f64, fn(&BarrierDerivative) -> f64),
    /// A count, from 0.
    Count(fn(&BarrierReport) -> u32),
    /// True or false.
    Flag(fn(&BarrierReport) -> bool),
    /// The number of its phase.
    Phase,
}

use Reading::{Count, Flag, Phase, Real};

/// The outputs of each barrier, in the order of the variables.
pub const BARRIER_OUTPUTS: [BarrierOutput; 14] = [
    BarrierOutput {
        name: "h",
        description: "barrier; the state is safe where it is >= 0",
        reading: Real(OfH, |b| b.h, |d| d.h),
    },
    BarrierOutput {
        name: "profile",
        description: "lower bound on h promised now",
        reading: Real(OfH, |b| b.profile, |d| d.profile),
    },
    BarrierOutput {
        name: "time_left",
        description: "time to the deadline, 0 from then on",
        // The time left does not depend on the inputs.
        reading: Real(Is("s"), |b| b.time_left, |_| 0.0),
    },
    BarrierOutput {
        name: "slack",
        description: "row times u minus its floor; < 0: the constraint is violated by that much",
        reading: Real(OfHighestDerivative, |b| b.slack, |d| d.slack),
    },
    BarrierOutput {
        name: "margin_used",
        description: "h to reach and to stay above: the parameter or what plans need, plus the expected loss from held inputs",
        reading: Real(OfH, |b| b.margin, |d| d.margin),
    },
    BarrierOutput {
        name: "sampling_loss",
        description: "how far below its promise h may fall within the step because u is held",
        reading: Real(OfH, |b| b.sampling_loss, |d| d.sampling_loss),
    },
    BarrierOutput {
        name: "unmet_steps",
        description: "steps in a row that did not meet the constraint, this one included",
        reading: Count(|b| b.unmet_steps),
    },
    BarrierOutput {
        name: "postponed",
        description: "how often a lost deadline was replaced by a later one",
        reading: Count(|b| b.postponed),
    },
    BarrierOutput { name: "arrived", description: "h >= 0 has been reached", reading: Flag(|b| b.arrived) },
    BarrierOutput {
        name: "guaranteed",
        description: "a backup plan keeps the promise, whatever u_ref is; only if the filter follows plans",
        reading: Flag(|b| b.guaranteed),
    },
    BarrierOutput {
        name: "on_course",
        description: "the theorem behind the phase applies so far: conditions met, every step since satisfied",
        reading: Flag(|b| b.on_course),
    },
    BarrierOutput {
        name: "deadline_unreachable",
        description: "no input within the bounds is inside at the deadline, or it passed outside",
        reading: Flag(|b| b.deadline_unreachable),
    },
    BarrierOutput {
        name: "deadlocked",
        description: "blocked by other barriers, and h does not rise: needs another u_ref",
        reading: Flag(|b| b.deadlocked),
    },
    BarrierOutput { name: "phase", description: "phase of the barrier's promise", reading: Phase },
];
