//! A filter: samples its inputs, remembers its promises.

use punctual_core::filter::{FilterState, SafetyFilter, Status};

use super::{Block, BlockState, Values};
use crate::configuration::{ConfigurationError, FilterConfiguration, Parameter, updated};
use crate::product::{BARRIER_OUTPUTS, Layout};

pub(super) struct FilterBlock {
    configuration: FilterConfiguration,
    parameters: Vec<Parameter<FilterConfiguration>>,
    layout: Layout,
    filter: SafetyFilter,
    /// `rearm` at the last step: a rising edge re-arms.
    rearm_seen: bool,
    /// Scratch: what to go back to after looking ahead over a re-arming.
    kept: FilterState,
    /// Scratch: the safe input.
    u: Vec<f64>,
}

impl FilterBlock {
    pub(super) fn new(
        configuration: FilterConfiguration,
        layout: Layout,
    ) -> Result<Self, ConfigurationError> {
        let (parameters, filter) = (configuration.parameters(), configuration.build()?);
        let (kept, u) = (filter.state().clone(), vec![0.0; layout.inputs]);
        Ok(Self { configuration, parameters, layout, filter, rearm_seen: false, kept, u })
    }

    fn rearm_index(&self) -> usize {
        self.layout.states + self.layout.inputs
    }

    /// One sample at `t`: with `commit` it is remembered, else only looked at.
    fn sample(&mut self, t: f64, commit: bool, values: &mut Values) -> Result<(), String> {
        let rearm = values.booleans[self.rearm_index()];
        let rising = rearm && !self.rearm_seen;
        if rising {
            self.kept.clone_from(self.filter.state());
            self.filter.rearm();
        }
        let (x, rest) = values.reals.split_at(self.layout.states);
        let u_ref = &rest[..self.layout.inputs];
        let done = if commit {
            self.rearm_seen = rearm;
            self.filter.step(t, x, u_ref, &mut self.u).map(|_| ())
        } else {
            let looked = self.filter.peek(t, x, u_ref, &mut self.u).map(|_| ());
            if rising {
                self.filter.restore(&self.kept).map_err(|e| e.to_string())?;
            }
            looked
        };
        done.map_err(|e| e.to_string())?;
        self.write(values);
        Ok(())
    }

    /// Writes the last sample to the outputs, in the order of the variable table.
    fn write(&self, values: &mut Values) {
        let report = self.filter.report();
        let mut at = self.layout.outputs;
        values.reals[at..][..self.u.len()].copy_from_slice(&self.u);
        at += self.u.len();
        values.integers[at] = report.status as i32;
        at += 1;
        for b in &report.barriers {
            let reals = [b.h, b.profile, b.time_left, b.slack, b.margin, b.sampling_loss];
            values.reals[at..][..6].copy_from_slice(&reals);
            for (i, count) in [b.unmet_steps, b.postponed].into_iter().enumerate() {
                values.integers[at + 6 + i] = i32::try_from(count).unwrap_or(i32::MAX);
            }
            let flags = [b.arrived, b.guaranteed, b.late_certain, b.deadlocked];
            values.booleans[at + 8..][..4].copy_from_slice(&flags);
            values.integers[at + 12] = b.phase as i32;
            at += BARRIER_OUTPUTS;
        }
    }
}

impl Block for FilterBlock {
    fn configure(&mut self, values: &Values) -> Result<(), ConfigurationError> {
        let numbers = &values.reals[self.layout.parameters..self.layout.end];
        let configuration = updated(&self.configuration, &self.parameters, numbers)?;
        self.filter = configuration.build()?;
        self.configuration = configuration;
        self.rearm_seen = false;
        self.kept.clone_from(self.filter.state());
        Ok(())
    }

    fn output(&mut self, t: f64, values: &mut Values) {
        // The lengths are those of the filter by construction: the table was built from it.
        let sampled = self.sample(t, false, values);
        debug_assert!(sampled.is_ok(), "{sampled:?}");
    }

    fn step(&mut self, t: f64, _h: f64, values: &mut Values) -> Result<(), String> {
        self.sample(t, true, values)
    }

    fn save(&self, state: &mut BlockState) {
        // Without `..`: whoever adds a field decides here whether it belongs to the state.
        let Self {
            rearm_seen: now,
            filter: memory,
            configuration: _,
            parameters: _,
            layout: _,
            kept: _,
            u: _,
        } = self;
        match state {
            BlockState::Filter { rearm_seen, filter } => {
                *rearm_seen = *now;
                filter.clone_from(memory.state());
            }
            _ => {
                *state = BlockState::Filter { rearm_seen: *now, filter: memory.state().clone() };
            }
        }
    }

    fn restore(&mut self, state: &BlockState) -> Result<(), String> {
        let BlockState::Filter { rearm_seen, filter } = state else {
            return Err(state.mismatch("filter"));
        };
        self.filter.restore(filter).map_err(|e| e.to_string())?;
        self.rearm_seen = *rearm_seen;
        Ok(())
    }

    fn direct_feedthrough(&self) -> bool {
        self.configuration.direct_feedthrough
    }

    fn accepts_gaps(&self) -> bool {
        true
    }

    fn show_refusal(&self, values: &mut Values) {
        let (outputs, inputs) = (self.layout.outputs, self.layout.inputs);
        let names = self.configuration.plant.model.inputs();
        for (i, input) in names.iter().enumerate() {
            let [min, max] = self.configuration.bounds.get(input.name).copied().unwrap_or_default();
            // Not `clamp`, which panics where the bounds contradict each other.
            values.reals[outputs + i] = 0.0_f64.max(min).min(max);
        }
        values.integers[outputs + inputs] = Status::InvalidInput as i32;
    }
}
