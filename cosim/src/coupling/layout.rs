//! Assigns slots to signals, and records slots as rows.

use super::network::{self, Link, Port};
use super::ports::{Group, Source};
use super::starts::{Start, Values};
use super::system::System;
use crate::error::Error;
use crate::host::{Causality, Description, Variable};
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

    /// Assigns slots to the variables of a component that are connected or `read`. An array gets slots for
    /// all elements as soon as one is needed. The groups are outputs without feedthrough, outputs with
    /// feedthrough, connected inputs, and other variables that are read.
    pub(super) fn add(
        &mut self,
        system: &System,
        description: &Description,
        component: usize,
        links: &[Link],
        read: &[Port],
    ) -> [Group; 4] {
        let of_arrays = |ports: &mut dyn Iterator<Item = Port>| {
            let mut is_in = vec![false; description.variables.len()];
            for port in ports.filter(|port| port.component == component) {
                let variable = &description.variables[port.variable];
                let first = port.variable - variable.element;
                is_in[first..first + variable.count].fill(true);
            }
            is_in
        };
        let fed = of_arrays(&mut links.iter().map(|link| link.to));
        let wanted = of_arrays(&mut links.iter().map(|link| link.from).chain(read.iter().copied()));
        let mut parts: [Vec<(usize, &Variable)>; 4] = Default::default();
        let is_needed = |(v, _): &(usize, &Variable)| fed[*v] || wanted[*v];
        for (position, variable) in description.variables.iter().enumerate().filter(is_needed) {
            let part = match variable.causality {
                Causality::Output => {
                    let owner = &system.components()[component];
                    usize::from(network::has_feedthrough(owner, description, position))
                }
                _ if fed[position] => 2,
                _ => 3,
            };
            parts[part].push((position, variable));
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

    /// The slots of a component that no link feeds and that are not read before the run begins, each with its
    /// start value. They belong to inputs that are elements of an array of which only other elements are
    /// connected.
    pub(super) fn constants(
        &self,
        component: usize,
        description: &Description,
        links: &[Link],
        starts: &[Start],
    ) -> Vec<(usize, f64)> {
        let value = |variable: &Variable| {
            let given = starts.iter().find(|start| variable.is(start.of, start.reference));
            match given.map(|start| &start.values) {
                Some(Values::Numbers(values)) => values.get(variable.element).copied(),
                _ => variable.start,
            }
        };
        let slots = self.ports.iter().enumerate().filter(|(_, port)| port.component == component);
        let inputs = slots.map(|(slot, port)| (slot, port, &description.variables[port.variable]));
        inputs
            .filter(|(_, port, variable)| {
                variable.causality != Causality::Output && links.iter().all(|link| link.to != **port)
            })
            .map(|(slot, _, variable)| (slot, value(variable).unwrap_or(0.0)))
            .collect()
    }

    /// The enumeration inputs of a component whose source may have values other than their items.
    pub(super) fn choices(
        &self,
        component: usize,
        descriptions: &[&Description],
        links: &[Link],
    ) -> Vec<Choice> {
        let variable = |port: Port| &descriptions[port.component].variables[port.variable];
        let numbers = |port: Port| variable(port).items.iter().map(|(_, number)| *number as f64);
        let of_link = |link: &Link| {
            let items: Vec<f64> = numbers(link.to).collect();
            let may_differ = numbers(link.from).next().is_none()
                || numbers(link.from).any(|number| !items.contains(&number));
            let start = variable(link.to).start.or(items.first().copied()).filter(|_| may_differ)?;
            Some(Choice { slot: self.slot(link.to)?, items, start }).filter(|choice| !choice.items.is_empty())
        };
        links.iter().filter(|link| link.to.component == component).filter_map(of_link).collect()
    }

    /// The sources of the inputs of a component.
    pub(super) fn sources(&self, component: usize, links: &[Link]) -> Vec<Source> {
        let of_link = |link: &Link| {
            let (input, output) = (self.slot(link.to)?, self.slot(link.from)?);
            Some(Source::new(input, output, link.factor, link.offset))
        };
        links.iter().filter(|link| link.to.component == component).filter_map(of_link).collect()
    }
}

/// An enumeration input.
pub(super) struct Choice {
    pub(super) slot: usize,
    /// The numbers of its items; at least one.
    items: Vec<f64>,
    pub(super) start: f64,
}

impl Choice {
    /// Whether its value is an item.
    pub(super) fn has(&self, values: &[f64]) -> bool {
        self.items.contains(&values[self.slot])
    }

    /// The error for a value that is not an item.
    #[cold]
    pub(super) fn error(&self, names: &[String], values: &[f64]) -> Error {
        let (name, value) = (&names[self.slot], values[self.slot]);
        let items: Vec<_> = self.items.iter().map(f64::to_string).collect();
        let how = format!("is given {value}; must be an item of its enumeration, {}", items.join(", "));
        Error::broken(name, how)
    }
}

/// Records rows when they are due.
pub(super) struct Recorder<'a> {
    every: u64,
    last: u64,
    /// The last point reached, whether its row was recorded or skipped.
    pub(super) reached: u64,
    slots: Vec<usize>,
    row: Vec<f64>,
    pub(super) recording: Recording,
    keep: bool,
    observer: &'a mut dyn FnMut(f64, &[f64]),
}

impl<'a> Recorder<'a> {
    /// Records `slots` as `columns` at every `every`-th of `last` steps and at the last point. Rows are
    /// stored only if `keep` is set; `observer` sees all of them.
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

    /// Makes point `k` the last one of the run.
    pub(super) fn end_at(&mut self, k: u64) {
        self.last = k;
    }

    /// Records the row of point `k` at `time` (s), if one is due.
    pub(super) fn row(&mut self, k: u64, time: f64, values: &[f64]) {
        self.reached = k;
        // A division takes longer than a short row.
        if self.every != 1 && !k.is_multiple_of(self.every) && k != self.last {
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
