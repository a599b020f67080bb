//! Slots of signals, and the recording of slots as rows.

use super::network::{self, Link, Port};
use super::ports::{Group, Source};
use super::system::System;
use crate::host::{Causality, Description, ScalarType};
use crate::recording::{Column, Recording};

/// Rows reserved before a run; longer recordings grow while running.
const ROWS_RESERVED: usize = 1 << 17;

/// The slots of the ports.
#[derive(Default)]
pub(super) struct Layout {
    pub(super) ports: Vec<Port>,
    pub(super) names: Vec<String>,
}

impl Layout {
    pub(super) fn slot(&self, port: Port) -> Option<usize> {
        self.ports.iter().position(|other| *other == port)
    }

    /// Gives slots to the outputs of a component that are connected or `read`, and to its connected inputs. The
    /// groups are outputs without feedthrough, outputs with feedthrough, inputs.
    pub(super) fn add(
        &mut self,
        system: &System,
        description: &Description,
        component: usize,
        links: &[Link],
        read: &[Port],
    ) -> [Group; 3] {
        let mut parts: [Vec<(usize, u32, ScalarType)>; 3] = Default::default();
        for (position, variable) in description.variables.iter().enumerate() {
            let port = Port { component, variable: position };
            let entry = (position, variable.value_reference, variable.kind.scalar_type());
            if variable.causality == Causality::Output {
                if read.contains(&port) || links.iter().any(|link| link.from == port) {
                    parts[usize::from(network::has_feedthrough(
                        &system.components()[component],
                        description,
                        position,
                    ))]
                    .push(entry);
                }
            } else if links.iter().any(|link| link.to == port) {
                parts[2].push(entry);
            }
        }
        parts.map(|part| {
            let (group, positions) = Group::new(self.ports.len(), &part);
            for variable in positions {
                self.ports.push(Port { component, variable });
                let name = &description.variables[variable].name;
                self.names.push(format!("{}.{name}", system.components()[component].name));
            }
            group
        })
    }

    /// The sources of the inputs of a component.
    pub(super) fn sources(&self, component: usize, links: &[Link]) -> Vec<Source> {
        let of_link = |link: &Link| {
            let (input, output) = (self.slot(link.to)?, self.slot(link.from)?);
            Some(Source { input, output, factor: link.factor, offset: link.offset })
        };
        links.iter().filter(|link| link.to.component == component).filter_map(of_link).collect()
    }
}

/// Records a row where one is due.
pub(super) struct Recorder<'a> {
    every: u64,
    last: u64,
    /// The last point at which a row was due or passed over.
    pub(super) reached: u64,
    slots: Vec<usize>,
    row: Vec<f64>,
    pub(super) recording: Recording,
    keep: bool,
    observer: &'a mut dyn FnMut(f64, &[f64]),
}

impl<'a> Recorder<'a> {
    /// Records `slots` as `columns`, `every` so many of `last` steps and at the last point. They are stored with
    /// `keep` only; `observer` sees all of them.
    pub(super) fn new(
        columns: &[Column],
        slots: &[usize],
        (every, last): (u64, u64),
        keep: bool,
        observer: &'a mut dyn FnMut(f64, &[f64]),
    ) -> Self {
        let mut recording = Recording::new(columns.to_vec());
        let rows = usize::try_from(last / every).unwrap_or(usize::MAX).saturating_add(2);
        if keep {
            recording.reserve(rows.min(ROWS_RESERVED));
        }
        Self {
            every,
            last,
            reached: 0,
            row: vec![0.0; slots.len()],
            slots: slots.to_vec(),
            recording,
            keep,
            observer,
        }
    }

    /// Records the row of point `k` at `time` (s), if one is due.
    pub(super) fn row(&mut self, k: u64, time: f64, values: &[f64]) {
        self.reached = k;
        if !k.is_multiple_of(self.every) && k != self.last {
            return;
        }
        for (value, slot) in self.row.iter_mut().zip(&self.slots) {
            *value = values[*slot];
        }
        if self.keep {
            self.recording.push(time, &self.row);
        }
        (self.observer)(time, &self.row);
    }
}
