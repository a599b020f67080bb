//! What filters say of their promises in the course of a run, recorded or not. A filter is known by the names
//! of its outputs: `status`, and `<barrier>.unmet_steps` with the others of [`FIELDS`].

use punctual_core::filter::{Phase, Status};
use serde::Serialize;

use super::layout::Layout;
use super::network::Port;
use super::system::System;
use crate::host::{Causality, Description};

/// The outputs of a barrier that are looked at.
const FIELDS: [&str; 5] = ["unmet_steps", "slack", "arrived", "late_certain", "phase"];

/// What became of one barrier's promise.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Promise {
    /// `component.barrier`.
    pub barrier: String,
    /// The first communication point in s at which it had arrived.
    pub arrival: Option<f64>,
    /// The first one in s at which its deadline had passed outside, or was certain to.
    pub late: Option<f64>,
    /// The first one in s at which it had been left again.
    pub left: Option<f64>,
    /// Samples that did not meet its constraint, or had no valid input to meet it with.
    pub unmet: u64,
    /// The longest row of them.
    pub longest: u64,
    /// The largest violation of its constraint at one of them, in the unit of its slack; 0 without one.
    pub violation: f64,
}

impl Promise {
    /// Whether nothing was missed: every sample met, not late, not left.
    pub fn kept(&self) -> bool {
        self.late.is_none() && self.left.is_none() && self.unmet == 0
    }
}

/// A promise that is watched.
#[derive(Debug)]
pub(super) struct Watched {
    promise: Promise,
    status: usize,
    fields: [usize; FIELDS.len()],
    unmet_in_a_row: u64,
}

/// The outputs that tell of promises: for each barrier its name, `status` and the [`FIELDS`].
pub(super) fn ports(
    system: &System,
    descriptions: &[&Description],
) -> Vec<(String, Port, [Port; FIELDS.len()])> {
    let mut found = Vec::new();
    for (component, description) in descriptions.iter().enumerate() {
        let output = |name: &str| {
            let variable = description.index_of(name)?;
            let is_output = description.variables[variable].causality == Causality::Output;
            is_output.then_some(Port { component, variable })
        };
        let Some(status) = output("status") else { continue };
        for variable in &description.variables {
            let Some(barrier) = variable.name.strip_suffix(".unmet_steps") else { continue };
            let ports = FIELDS.map(|field| output(&format!("{barrier}.{field}")));
            if let [Some(a), Some(b), Some(c), Some(d), Some(e)] = ports {
                let name = format!("{}.{barrier}", system.components()[component].name);
                found.push((name, status, [a, b, c, d, e]));
            }
        }
    }
    found
}

impl Watched {
    /// `None` where a port has no slot.
    pub(super) fn new(
        layout: &Layout,
        (name, status, fields): &(String, Port, [Port; FIELDS.len()]),
    ) -> Option<Self> {
        let mut slots = [0; FIELDS.len()];
        for (slot, port) in slots.iter_mut().zip(fields) {
            *slot = layout.slot(*port)?;
        }
        let promise = Promise {
            barrier: name.clone(),
            arrival: None,
            late: None,
            left: None,
            unmet: 0,
            longest: 0,
            violation: 0.0,
        };
        Some(Self { promise, status: layout.slot(*status)?, fields: slots, unmet_in_a_row: 0 })
    }

    /// Forgets the run before.
    pub(super) fn reset(&mut self) {
        let barrier = std::mem::take(&mut self.promise.barrier);
        self.promise =
            Promise { barrier, arrival: None, late: None, left: None, unmet: 0, longest: 0, violation: 0.0 };
        self.unmet_in_a_row = 0;
    }

    /// Takes the `values` of the communication point at `time` (s).
    pub(super) fn see(&mut self, time: f64, values: &[f64]) {
        let [unmet, slack, arrived, late, phase] = self.fields.map(|slot| values[slot]);
        let is = |number: Phase| phase == f64::from(number as i32);
        let promise = &mut self.promise;
        if arrived != 0.0 {
            promise.arrival.get_or_insert(time);
        }
        if late != 0.0 || is(Phase::Late) {
            promise.late.get_or_insert(time);
        }
        if is(Phase::Left) {
            promise.left.get_or_insert(time);
        }
        let invalid = values[self.status] >= f64::from(Status::InvalidInput as i32);
        if unmet > 0.0 || invalid {
            promise.unmet += 1;
            self.unmet_in_a_row += 1;
            promise.longest = promise.longest.max(self.unmet_in_a_row);
            promise.violation = promise.violation.max(-slack);
        } else {
            self.unmet_in_a_row = 0;
        }
    }

    pub(super) fn promise(&self) -> &Promise {
        &self.promise
    }
}
