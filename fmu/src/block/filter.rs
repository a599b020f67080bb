//! A filter, which samples its inputs and remembers its promises.

use punctual_core::filter::{
    Assurance, AssuranceStatus, BarrierReport, Filter, FilterState, NoDerivative, SampleDerivative, Status,
};
use punctual_core::lie::Direction;

use super::{Block, BlockState, Values, in_words};
use crate::configuration::{ConfigurationError, FilterConfiguration, Parameter, UNBOUNDED, updated};
use crate::product::{BARRIER_OUTPUTS, Layout, Product, Reading};

pub(super) struct FilterBlock {
    configuration: FilterConfiguration,
    parameters: Vec<Parameter<FilterConfiguration>>,
    layout: Layout,
    /// The outputs that are enumerations; their codes follow the parameters.
    enumerated: Vec<usize>,
    filter: Filter,
    /// The parameters that the filter was built with, and its state before the first step.
    built: (Vec<f64>, FilterState),
    /// `rearm` at the last step; a rising edge re-arms.
    rearm_seen: bool,
    /// The last status of the guarantee that was logged.
    noticed: Option<AssuranceStatus>,
    /// Buffer: the state to restore after looking ahead over a re-arming.
    kept: FilterState,
    /// Buffer: the derivative of a sample.
    change: SampleDerivative,
}

impl FilterBlock {
    pub(super) fn new(
        configuration: FilterConfiguration,
        product: &Product,
    ) -> Result<Self, ConfigurationError> {
        let (layout, enumerated) = (product.layout, product.enumerated().collect());
        let (parameters, filter) = (configuration.parameters(), configuration.build_loop()?);
        let mut numbered = configuration.clone();
        let numbers = parameters.iter().map(|row| row.get(&mut numbered)).collect();
        let kept = filter.state().clone();
        let built = (numbers, kept.clone());
        let change = SampleDerivative::default();
        let noticed = None;
        let rearm_seen = false;
        Ok(Self {
            configuration,
            parameters,
            layout,
            enumerated,
            filter,
            built,
            rearm_seen,
            noticed,
            kept,
            change,
        })
    }

    fn rearm_index(&self) -> usize {
        self.layout.states + self.layout.inputs
    }

    /// State and reference in an array of all reals.
    fn inputs<'a>(&self, reals: &'a [f64]) -> [&'a [f64]; 2] {
        let (x, rest) = reals.split_at(self.layout.states);
        [x, &rest[..self.layout.inputs]]
    }

    /// The same, and the slots of the safe input.
    fn inputs_and_u<'a>(&self, reals: &'a mut [f64]) -> ([&'a [f64]; 2], &'a mut [f64]) {
        let (inputs, outputs) = reals.split_at_mut(self.layout.outputs);
        (self.inputs(inputs), &mut outputs[..self.layout.inputs])
    }

    /// Re-arms if `values` has a rising edge; returns whether it did. The previous state is in `kept`.
    fn rearm(&mut self, values: &Values) -> bool {
        let rising = values.booleans[self.rearm_index()] && !self.rearm_seen;
        if rising {
            self.kept.clone_from(self.filter.state());
            self.filter.rearm();
        }
        rising
    }

    /// Expected hold period of the input in s, if no step determines it.
    fn hold(&self) -> f64 {
        self.filter.last_hold().unwrap_or(self.configuration.experiment.step_size)
    }

    /// Tells the filter for how long in s, > 0, the input of the next sample will be held, if the filter uses
    /// that.
    fn expect(&mut self, hold: f64) -> Result<(), punctual_core::Error> {
        if self.filter.counts_holds() { self.filter.expect_hold(Some(hold)) } else { Ok(()) }
    }

    /// Status of the guarantee, if plans are followed. They are not if a parameter has since been set to
    /// something that plans do not support.
    fn assurance_status(&self) -> Option<AssuranceStatus> {
        let of = |assurance: &Assurance| assurance.status;
        let status = self.filter.assurance().map_or(AssuranceStatus::Refused, of);
        self.configuration.is_assured().then_some(status)
    }

    /// The index of the output after those of the barriers.
    fn after_barriers(&self) -> usize {
        let barriers = self.configuration.barrier.len() * BARRIER_OUTPUTS.len();
        self.layout.outputs + self.layout.inputs + 1 + barriers
    }

    /// The index of the output with the integral, which follows the outputs on plans.
    fn integral(&self) -> usize {
        let of_plans = 2 * usize::from(self.configuration.is_assured());
        self.after_barriers() + of_plans + usize::from(self.configuration.ends_plans())
    }

    /// Writes the status of the guarantee, why u_ref was changed, and at `t` until when the guarantee holds.
    fn write_assurance_status(&self, status: AssuranceStatus, t: f64, values: &mut Values) {
        let at = self.after_barriers();
        values.integers[at] = status as i32;
        values.integers[at + 1] = self
            .filter
            .assurance()
            .and_then(|assurance| assurance.reason)
            .map_or(0, |reason| reason.barrier as i32 + 1);
        if self.configuration.ends_plans() {
            values.reals[at + 2] = self
                .filter
                .assurance()
                .and_then(|assurance| assurance.until)
                .map_or(t, |until| until.min(UNBOUNDED));
        }
    }

    /// Writes the admissible input nearest 0.
    fn write_rest(&self, values: &mut Values) {
        for i in 0..self.layout.inputs {
            let name = self.configuration.plant.input_name(i);
            let [min, max] = self.configuration.bounds.get(name).copied().unwrap_or_default();
            // Not `clamp`, which panics if the bounds contradict each other.
            values.reals[self.layout.outputs + i] = 0.0_f64.max(min).min(max);
        }
    }

    /// Writes the number of each enumeration to its code.
    fn write_codes(&self, values: &mut Values) {
        for (code, &of) in (self.layout.end..).zip(&self.enumerated) {
            values.integers[code] = values.integers[of];
        }
    }

    /// The reason why there is no derivative, with the barrier's name.
    fn named(&self, reason: NoDerivative) -> String {
        let barrier = match reason {
            NoDerivative::Source(i) | NoDerivative::Profile(i) => self.filter.barrier_names().nth(i),
            _ => None,
        };
        match barrier {
            Some(name) => format!("no derivative at this sample: {reason} ({name})"),
            None => format!("no derivative at this sample: {reason}"),
        }
    }

    /// Writes the last sample to the outputs after the safe input, in the order of the variable table.
    fn write(&self, t: f64, values: &mut Values, integrated: f64) {
        let report = self.filter.report();
        let at = self.layout.outputs + self.layout.inputs;
        values.integers[at] = report.status as i32;
        write_barriers(&report.barriers, at + 1, values);
        if let Some(status) = self.assurance_status() {
            self.write_assurance_status(status, t, values);
        }
        if self.filter.integrated_input().is_some() {
            values.reals[self.integral()] = integrated;
        }
        self.write_codes(values);
    }
}

impl Block for FilterBlock {
    fn configure(&mut self, values: &Values) -> Result<(), ConfigurationError> {
        let numbers = &values.reals[self.layout.parameters..self.layout.end];
        let (before, start) = &self.built;
        if numbers.iter().zip(before).all(|(a, b)| a.to_bits() == b.to_bits()) {
            let restored = self.filter.restore(start);
            debug_assert!(restored.is_ok(), "{restored:?}");
        } else {
            let configuration = updated(&self.configuration, &self.parameters, numbers)?;
            self.filter = configuration.build_loop()?;
            self.configuration = configuration;
            self.built = (numbers.to_vec(), self.filter.state().clone());
        }
        (self.rearm_seen, self.noticed) = (false, None);
        self.kept.clone_from(self.filter.state());
        Ok(())
    }

    fn output(&mut self, t: f64, values: &mut Values) {
        let rising = self.rearm(values);
        let hold = self.hold();
        let expected = self.expect(hold);
        let ([x, u_ref], u) = self.inputs_and_u(&mut values.reals);
        // The lengths match the filter by construction, since the table was built from it.
        let peeked = expected.and_then(|()| self.filter.peek(t, x, u_ref, u).map(drop));
        debug_assert!(peeked.is_ok(), "{peeked:?}");
        if peeked.is_ok() {
            self.write(t, values, self.filter.next_integrated());
        }
        if rising {
            let restored = self.filter.restore(&self.kept);
            debug_assert!(restored.is_ok(), "{restored:?}");
        }
    }

    /// A master that is a step late hands this on for the first step, so with a delay it has to be what the filter assumes to
    /// act until the input of its first sample does.
    fn begin(&self, values: &mut Values) {
        if self.configuration.actuation_delay > 0.0 {
            self.write_rest(values);
        }
    }

    fn differentiate(
        &mut self,
        t: f64,
        values: &Values,
        direction: &[f64],
        derivative: &mut [f64],
    ) -> Result<(), String> {
        let rising = self.rearm(values);
        let hold = self.hold();
        let expected = self.expect(hold);
        let ([x, u_ref], [dx, du_ref]) = (self.inputs(&values.reals), self.inputs(direction));
        let direction = Direction { x: dx, u: du_ref };
        let unknown =
            expected.and_then(|()| self.filter.differentiate(t, x, u_ref, direction, &mut self.change));
        if rising {
            self.filter.restore(&self.kept).map_err(|e| e.to_string())?;
        }
        if let Some(reason) = unknown.map_err(|e| e.to_string())? {
            return Err(self.named(reason));
        }
        let mut at = self.layout.outputs;
        let inputs = self.layout.inputs;
        derivative[at..][..inputs].copy_from_slice(&self.change.u[..inputs]);
        // The output `status` is in between.
        at += inputs + 1;
        for b in &self.change.barriers {
            for (i, output) in (at..).zip(&BARRIER_OUTPUTS) {
                if let Reading::Real(_, _, directional) = output.reading {
                    derivative[i] = directional(b);
                }
            }
            at += BARRIER_OUTPUTS.len();
        }
        if let Some(input) = self.filter.integrated_input() {
            derivative[self.integral()] = 2.0 * self.change.u[input];
        }
        Ok(())
    }

    fn step(&mut self, t: f64, h: f64, values: &mut Values) -> Result<(), String> {
        self.rearm(values);
        let hold = if h > 0.0 { h } else { self.hold() };
        let expected = self.expect(hold);
        let ([x, u_ref], u) = self.inputs_and_u(&mut values.reals);
        let before = self.filter.integrated();
        let stepped =
            expected.and_then(|()| self.filter.step(t, x, u_ref, u).map(drop)).map_err(|e| in_words(&e));
        if h == 0.0 {
            self.filter.set_integrated(before);
        }
        self.rearm_seen = values.booleans[self.rearm_index()];
        stepped?;
        self.write(t, values, self.filter.integrated());
        Ok(())
    }

    fn notice(&mut self) -> Option<String> {
        let status = self.assurance_status()?;
        let holds = |status| matches!(status, AssuranceStatus::Undecided | AssuranceStatus::Assured);
        let before = self.noticed.replace(status);
        if before == Some(status) {
            return None;
        }
        if status == AssuranceStatus::Assured && before.is_some_and(|before| !holds(before)) {
            return Some("the guarantee is regained: a plan keeps the promise from here".to_owned());
        }
        (!holds(status)).then(|| {
            let why = match self.filter.assurance().and_then(|assurance| assurance.failure) {
                Some(failure) if status == AssuranceStatus::Refused => {
                    Some(self.configuration.refusal(failure))
                }
                Some(failure) => Some(self.configuration.failure(failure)),
                None => self.configuration.unaccounted(&self.filter),
            };
            let why = why.map(|why| format!(": {why}")).unwrap_or_default();
            format!("the guarantee is {} ({}){why}", status.name(), status.meaning())
        })
    }

    fn save(&self, state: &mut BlockState) {
        // Without `..`, so that a new field does not compile until it is decided whether it belongs to the
        // state.
        let Self {
            rearm_seen: now,
            filter,
            configuration: _,
            parameters: _,
            layout: _,
            enumerated: _,
            built: _,
            noticed: _,
            kept: _,
            change: _,
        } = self;
        match state {
            BlockState::Filter { rearm_seen, memory } => {
                *rearm_seen = *now;
                (**memory).clone_from(filter.state());
            }
            _ => *state = BlockState::Filter { rearm_seen: *now, memory: Box::new(filter.state().clone()) },
        }
    }

    fn restore(&mut self, state: &BlockState) -> Result<(), String> {
        let BlockState::Filter { rearm_seen, memory } = state else {
            return Err(state.mismatch("filter"));
        };
        self.filter.restore(memory).map_err(|e| e.to_string())?;
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
        self.write_rest(values);
        if let Some(input) = self.filter.integrated_input() {
            values.reals[outputs + input] = self.filter.integrated();
        }
        let mut at = outputs + inputs;
        values.integers[at] = Status::InvalidInput as i32;
        // No plan contains the input 0, so no barrier is guaranteed.
        at += 1;
        for _ in &self.configuration.barrier {
            for (i, output) in (at..).zip(&BARRIER_OUTPUTS) {
                if output.name == "guaranteed" {
                    values.booleans[i] = false;
                }
            }
            at += BARRIER_OUTPUTS.len();
        }
        if let Some(status) = self.assurance_status() {
            let shown = if self.filter.assurance().is_some() { AssuranceStatus::Undecided } else { status };
            self.write_assurance_status(shown, 0.0, values);
        }
        self.write_codes(values);
    }
}

/// Writes the outputs of `reports`, one barrier after another from index `at` on.
fn write_barriers(reports: &[BarrierReport], at: usize, values: &mut Values) {
    const LEN: usize = BARRIER_OUTPUTS.len();
    for (i, b) in reports.iter().enumerate() {
        let at = at + i * LEN;
        let reals = values.reals[at..].first_chunk_mut();
        let integers = values.integers[at..].first_chunk_mut();
        let booleans = values.booleans[at..].first_chunk_mut();
        let (Some(reals), Some(integers), Some(booleans)) = (reals, integers, booleans) else { return };
        // Each row of the table is known at compile time, so that reading it costs nothing.
        macro_rules! write_rows {
            ($($row:literal)*) => {
                const { assert!([$($row),*].len() == LEN) };
                $(write::<$row, LEN>(&BARRIER_OUTPUTS[$row].reading, b, reals, integers, booleans);)*
            };
        }
        write_rows!(0 1 2 3 4 5 6 7 8 9 10 11 12 13);
    }
}

/// Writes a value as number `ROW` of those of its type.
#[inline(always)]
fn write<const ROW: usize, const LEN: usize>(
    reading: &Reading,
    b: &BarrierReport,
    reals: &mut [f64; LEN],
    integers: &mut [i32; LEN],
    booleans: &mut [bool; LEN],
) {
    match reading {
        Reading::Real(_, value, _) => reals[ROW] = value(b),
        Reading::Count(value) => integers[ROW] = i32::try_from(value(b)).unwrap_or(i32::MAX),
        Reading::Flag(value) => booleans[ROW] = value(b),
        Reading::Phase => integers[ROW] = b.phase as i32,
    }
}
