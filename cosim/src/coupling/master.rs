//! The master: its steps have one length, or [drawn](DrawnSteps) ones.
//!
//! At each communication point t_k, Gauss–Seidel order:
//!
//! 1. components with direct feedthrough, in the order of [`super::graph`]: inputs from the latest
//!    values, `doStep(t_k, h)`, feedthrough outputs read (the sample of t_k);
//! 2. the other components: inputs from the latest values; then the row of t_k is recorded;
//! 3. these components: `doStep(t_k, h)`; then all outputs without feedthrough are read (t_{k+1}).
//!
//! So the sample that a feedthrough component computes from the state at t_k acts over [t_k, t_k + h]. No
//! component sees a state at t_{k+1} before all have reached it.
//!
//! In Jacobi order, all inputs are set at t_k to the values read after the previous step. Then the row is
//! recorded, all components step, and all outputs are read.

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use punctual_fmu::configuration::{Configuration, Deviation};
use punctual_fmu::text::number;

use super::delays;
use super::grid::Grid;
use super::interference::{self, Interference};
use super::layout::{Choice, Layout, Recorder};
use super::model::{Model, Reader};
use super::network::{self, Network};
use super::ports::{Group, Source};
use super::promises::{self, Promise, Watched};
use super::starts::{self, Start, Values};
use super::system::{Order, System};
use crate::error::{Error, brief_time};
use crate::host::{Causality, DataType, Description, Participant};
use crate::recording::{Column, Recording};

/// A component while it runs.
struct Member<P> {
    participant: P,
    /// Relative tolerance for its own solver.
    tolerance: Option<f64>,
    starts: Vec<Start>,
    /// Outputs without feedthrough.
    states: Group,
    /// Outputs with feedthrough.
    direct: Group,
    inputs: Group,
    /// Variables other than outputs that are read, such as local ones. The standard does not allow reading
    /// them during initialisation.
    others: Group,
    sources: Vec<Source>,
    /// The enumeration inputs whose sources may have values other than their items.
    choices: Vec<Choice>,
    /// The slots and values of unconnected elements of connected arrays.
    constants: Vec<(usize, f64)>,
}

impl<P: Participant> Member<P> {
    /// Copies the sources into its inputs.
    fn set_inputs(&mut self, values: &mut [f64], names: &[String]) -> Result<(), Error> {
        for source in &self.sources {
            source.transfer(values);
        }
        if let Some(wrong) = self.choices.iter().find(|choice| !choice.has(values)) {
            return Err(wrong.error(names, values));
        }
        self.inputs.write(&mut self.participant, values)
    }

    /// Does the same during initialisation, when a source may have no value yet. An enumeration then keeps
    /// its start value.
    fn set_first_inputs(&mut self, values: &mut [f64]) -> Result<(), Error> {
        for source in &self.sources {
            source.transfer(values);
        }
        for choice in &self.choices {
            if !choice.has(values) {
                values[choice.slot] = choice.start;
            }
        }
        self.inputs.write(&mut self.participant, values)
    }

    /// Sets its start values: those of structural parameters if `structural`, else the others.
    fn set_starts(&mut self, structural: bool) -> Result<(), Error> {
        let participant = &mut self.participant;
        let mut starts = self.starts.iter().filter(|start| start.structural == structural).peekable();
        let configures = structural && starts.peek().is_some();
        if configures {
            participant.enter_configuration_mode()?;
        }
        for start in starts {
            match &start.values {
                Values::Numbers(values) => participant.set(start.of, &[start.reference], values)?,
                Values::Texts(texts) => participant.set_text(start.reference, texts)?,
            }
        }
        if configures { participant.exit_configuration_mode() } else { Ok(()) }
    }
}

/// A coupled system of FMUs or of other participants, ready to run.
pub struct Simulation<P = Box<dyn Participant>> {
    members: Vec<Member<P>>,
    /// Components with direct feedthrough, in running order.
    direct: Vec<usize>,
    delayed: Vec<usize>,
    order: Order,
    grid: Grid,
    start_time: f64,
    stop_time: f64,
    every: u64,
    columns: Vec<Column>,
    /// The slot of each column.
    slots: Vec<usize>,
    /// The value of each slot.
    values: Vec<f64>,
    /// The name of each slot.
    names: Vec<String>,
    promises: Vec<Watched>,
    /// Measures how much each filter changes the wanted inputs.
    interference: Vec<interference::Watched>,
    /// For each slot, whether it was already reported as not finite.
    reported: Vec<bool>,
    notes: Vec<String>,
    /// The number of notes, counted from the first, that are [`Self::warnings`].
    warnings: usize,
    /// The number of notes that hold for every run.
    standing_notes: usize,
    used: bool,
    /// Values that change in a run.
    sequences: Vec<Sequence>,
    /// A flag that another thread sets to end a run.
    stop: Option<Arc<AtomicBool>>,
}

/// A sequence of values that a Real input or tunable parameter takes during a run, each for the same number
/// of steps.
#[derive(Clone, Debug, PartialEq)]
pub struct Sequence {
    /// Position of the component.
    pub component: usize,
    /// Value reference.
    pub reference: u32,
    /// Number of steps that each value lasts, ≥ 1.
    pub steps: u64,
    /// The values. The first is the start value; the last stays until the end.
    pub values: Vec<f64>,
}

/// Steps of a run whose lengths are drawn, as late and as early as a filter declares.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DrawnSteps {
    /// The seed of what is drawn, a whole number.
    pub seed: f64,
    /// The number of a [`DeviationKind`](punctual_fmu::configuration::DeviationKind).
    pub kind: f64,
    /// The part of a step by which one may be longer.
    pub jitter: f64,
    /// The length of the shortest, as a part of the usual one, > 0.
    pub least: f64,
}

impl DrawnSteps {
    /// The length of step `k`, as a part of the usual one. The first is as usual, since a filter makes its first plan for steps like it.
    fn length(&self, k: u64) -> f64 {
        if k == 0 {
            return 1.0;
        }
        let late = Deviation::lateness(self.seed, self.kind, k);
        1.0 + if late > 0.0 { self.jitter * late } else { (1.0 - self.least) * late }
    }
}

/// Result of a run.
#[derive(Debug)]
pub struct Outcome {
    /// The rows recorded.
    pub recording: Recording,
    /// Numbers of the run.
    pub statistics: Statistics,
    /// The promises of the filters, in the order of the components.
    pub promises: Vec<Promise>,
    /// How much each filter changed the wanted inputs.
    pub interference: Vec<Interference>,
    /// Notes for the user: signals read late, values that are not finite, warnings.
    pub notes: Vec<String>,
    /// The FMI call that ended the run before its stop time, if any. The rows until then are kept.
    pub failure: Option<Error>,
}

/// Numbers of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Statistics {
    /// Communication steps done.
    pub steps: u64,
    /// The last communication point, in seconds.
    pub final_time: f64,
    /// Wall time of the steps, without loading and initialisation.
    pub wall_time: Duration,
}

/// The remark of `participant` on the run, with its name.
fn remark(participant: &impl Participant) -> Option<String> {
    participant.remark().map(|remark| format!("{}: {remark}", participant.name()))
}

impl Statistics {
    /// Communication steps of the whole system per second of wall time.
    pub fn steps_per_second(&self) -> f64 {
        self.steps as f64 / self.wall_time.as_secs_f64().max(1e-9)
    }
}

impl Simulation<Box<dyn Participant>> {
    /// Opens the FMUs of `system`, reads its configurations with `read`, and instantiates all of them. Paths
    /// are relative to the folder `base`. Also returns the models, in the order of the components.
    ///
    /// # Errors
    ///
    /// An FMU that cannot be opened, loaded or instantiated; a configuration that cannot be used; a connection, start value,
    /// recorded signal or picture that does not fit them (with the field of the system file); an input that nothing feeds.
    pub fn new(system: &System, base: &Path, read: Reader) -> Result<(Self, Vec<Model>), Error> {
        let mut models: Vec<Model> = Vec::new();
        for (i, component) in system.components().iter().enumerate() {
            let path = base.join(&component.fmu);
            if !path.exists() {
                let message = format!(
                    "there is no file {}; it is an FMU, or the .toml file that `punctual build` makes one from",
                    path.display()
                );
                return Err(Error::configuration(format!("component[{i}].fmu"), message));
            }
            let model = Model::open(&path, &models, read).and_then(|model| model.sized(component));
            models.push(model.map_err(|e| e.in_component(&component.name))?);
        }
        Ok((Self::of(system, &models)?, models))
    }

    /// Instantiates `models`, one for each component of `system`, in order. The paths in the system are not used.
    ///
    /// # Errors
    ///
    /// As for [`Simulation::new`], or if there is not one model for each component.
    pub fn of(system: &System, models: &[Model]) -> Result<Self, Error> {
        let descriptions: Vec<_> = models.iter().map(Model::description).collect();
        promises::check_fed(system, &descriptions, &network::links(system, &descriptions)?, &[])?;
        let mut simulation = Self::assembled(system, &descriptions, |c| {
            let name = &system.components()[c].name;
            models[c].instance(name).map_err(|e| e.in_component(name))
        })?;
        let notes = models.iter().filter_map(Model::configuration).flat_map(Configuration::in_degrees);
        // The start in a filter's file is also the start of its plant, so both give the same note.
        let notes: BTreeSet<_> = notes.collect();
        simulation.notes.extend(notes);
        simulation.standing_notes = simulation.notes.len();
        Ok(simulation)
    }
}

impl<P: Participant> Simulation<P> {
    /// Couples the participants that `participant` makes for each component of `system`, by position.
    /// `descriptions` are their model descriptions.
    ///
    /// # Errors
    ///
    /// As for [`Simulation::new`], or if there is not one description for each component.
    pub fn assembled(
        system: &System,
        descriptions: &[&Description],
        mut participant: impl FnMut(usize) -> Result<P, Error>,
    ) -> Result<Self, Error> {
        if descriptions.len() != system.components().len() {
            let message = format!("{} FMUs for {} components", descriptions.len(), system.components().len());
            return Err(Error::configuration("component", message));
        }
        let Network { links, mut starts, recorded, direct, delayed, notes, remarks } =
            network::resolve(system, descriptions)?;

        // Assign slots to all signals that are recorded, watched or connected.
        let watched = promises::ports(system, descriptions, &links);
        let mut read = recorded.clone();
        let of_plans = |ports: &promises::Ports| ports.plans.into_iter().flatten();
        read.extend(watched.iter().flat_map(|p| p.fields.into_iter().chain([p.status]).chain(of_plans(p))));
        let interference = interference::ports(system, descriptions, &links);
        read.extend(interference.iter().flat_map(interference::Ports::all));
        let mut layout = Layout::default();
        let mut groups = Vec::new();
        for (component, description) in descriptions.iter().enumerate() {
            groups.push(layout.add(system, description, component, &links, &read));
        }
        let slots = recorded.iter().filter_map(|port| layout.slot(*port)).collect();
        let columns = recorded
            .iter()
            .map(|port| {
                let variable = &descriptions[port.component].variables[port.variable];
                let component = &system.components()[port.component].name;
                Column { name: format!("{component}.{}", variable.name), unit: variable.unit.clone() }
            })
            .collect();
        // How late the inputs of filters act, which a filter may be told.
        let late = delays::of(system, descriptions, &links);
        for (component, reference, delay) in late.starts {
            starts[component].push(Start::real(reference, delay));
        }
        // Make the participants.
        let mut members = Vec::new();
        for (component, [mut states, mut direct, mut inputs, others]) in groups.into_iter().enumerate() {
            let starts = std::mem::take(&mut starts[component]);
            let participant = participant(component)?;
            states.place(&participant, Causality::Output);
            direct.place(&participant, Causality::Output);
            inputs.place(&participant, Causality::Input);
            members.push(Member {
                participant,
                tolerance: system.components()[component].tolerance.or(system.experiment().tolerance),
                constants: layout.constants(component, descriptions[component], &links, &starts),
                starts,
                states,
                direct,
                inputs,
                others,
                choices: layout.choices(component, descriptions, &links),
                sources: layout.sources(component, &links),
            });
        }
        // The simulation at its start, with the notes that hold for every run; those of the components come
        // first.
        let mut standing: Vec<String> =
            members.iter().filter_map(|member| remark(&member.participant)).collect();
        standing.extend(late.warnings);
        let warnings = standing.len();
        standing.extend(late.notes);
        if system.experiment().order == Order::GaussSeidel {
            standing.extend(notes);
        }
        let experiment = system.experiment();
        let mut simulation = Self {
            members,
            direct,
            delayed,
            order: experiment.order,
            grid: Grid::new(experiment.start_time, experiment.stop_time, experiment.step),
            start_time: experiment.start_time,
            stop_time: experiment.stop_time,
            every: system.record().every,
            columns,
            slots,
            values: vec![0.0; layout.ports.len()],
            reported: vec![false; layout.ports.len()],
            promises: watched.iter().filter_map(|ports| Watched::new(&layout, ports)).collect(),
            interference: interference
                .iter()
                .filter_map(|ports| interference::Watched::new(&layout, ports))
                .collect(),
            names: layout.names,
            notes: standing,
            warnings,
            standing_notes: 0,
            used: false,
            sequences: Vec::new(),
            stop: None,
        };
        simulation.notes.extend(remarks);
        simulation.note_shortened_step(descriptions);
        simulation.note_what_is_not_recorded(descriptions);
        simulation.notes.extend(network::unit_notes(system, descriptions, &links));
        simulation.notes.extend(starts::in_degrees(system.components(), descriptions));
        simulation.notes.extend(promises::unwanted(system, descriptions, &links));
        simulation.standing_notes = simulation.notes.len();
        Ok(simulation)
    }

    /// Remarks of the components before any run, each with the component's name. They are among the notes of
    /// every run.
    pub fn warnings(&self) -> &[String] {
        &self.notes[..self.warnings]
    }

    /// Changes the start value of a Real parameter or input, from the next run on.
    pub fn set_start(&mut self, component: usize, reference: u32, value: f64) {
        let starts = &mut self.members[component].starts;
        let start = Start::real(reference, value);
        match starts.iter_mut().find(|start| start.number(reference).is_some()) {
            Some(given) => *given = start,
            None => starts.push(start),
        }
    }

    /// Sets sequences of values for Real inputs and tunable parameters from the next run on. They replace all
    /// earlier sequences.
    pub fn set_sequences(&mut self, sequences: Vec<Sequence>) {
        for sequence in &sequences {
            if let Some(first) = sequence.values.first() {
                self.set_start(sequence.component, sequence.reference, *first);
            }
        }
        self.sequences = sequences;
    }

    /// Draws the lengths of the steps from the next run on; without, all are as long as the system says.
    pub fn set_steps(&mut self, drawn: Option<DrawnSteps>) {
        let grid = Grid::new(self.start_time, self.stop_time, self.grid.usual());
        self.grid = drawn.map_or_else(|| grid.clone(), |drawn| grid.drawn(|k| drawn.length(k)));
    }

    /// Adds a note to those of every run.
    pub fn note(&mut self, note: String) {
        self.notes.truncate(self.standing_notes);
        self.notes.push(note);
        self.standing_notes = self.notes.len();
    }

    /// Sets the values of the sequences that begin at point `k`.
    fn change(&mut self, k: u64) -> Result<(), Error> {
        for Sequence { component, reference, steps, values } in &self.sequences {
            let next = usize::try_from(k / steps).ok().filter(|_| k.is_multiple_of(*steps));
            if let Some(value) = next.and_then(|next| values.get(next)) {
                let participant = &mut self.members[*component].participant;
                participant.set(DataType::Float64, &[*reference], &[*value])?;
            }
        }
        Ok(())
    }

    /// Makes a run end at the next step once `stop` is set. The rows until then are kept.
    pub fn stop_by(&mut self, stop: Arc<AtomicBool>) {
        self.stop = Some(stop);
    }

    fn check_stop(&self, time: f64) -> Result<(), Error> {
        match &self.stop {
            Some(stop) if stop.load(Ordering::Relaxed) => Err(Error::interrupted(time)),
            _ => Ok(()),
        }
    }

    /// The columns of a row, in order.
    pub fn columns(&self) -> &[Column] {
        &self.columns
    }

    /// The communication points.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// Runs from start to stop and records. `observer` gets the time (s) and the values of each recorded row, in
    /// the order of [`Simulation::columns`]. A second call resets the instances first.
    ///
    /// # Errors
    ///
    /// An FMI call of the initialization that returns neither OK nor Warning. One of a later step ends
    /// the run: see [`Outcome::failure`].
    pub fn run(&mut self, mut observer: impl FnMut(f64, &[f64])) -> Result<Outcome, Error> {
        self.run_as(true, &mut observer)
    }

    /// Runs like [`Simulation::run`], for observers only: the recording stays empty.
    ///
    /// # Errors
    ///
    /// As above.
    pub fn run_unrecorded(&mut self, mut observer: impl FnMut(f64, &[f64])) -> Result<Outcome, Error> {
        self.run_as(false, &mut observer)
    }

    fn run_as(&mut self, keep: bool, observer: &mut dyn FnMut(f64, &[f64])) -> Result<Outcome, Error> {
        self.initialise()?;
        let rows = (self.every, self.grid.steps());
        let mut recorder = Recorder::new(&self.columns, &self.slots, rows, keep, observer);
        let begin = Instant::now();
        let mut ran = match self.order {
            Order::GaussSeidel => self.run_gauss_seidel(&mut recorder),
            Order::Jacobi => self.run_jacobi(&mut recorder),
        };
        let wall_time = begin.elapsed();
        let (steps, recording) = (recorder.reached, recorder.recording);
        for member in &mut self.members {
            if ran.is_ok() {
                ran = member.participant.terminate();
            }
            // A remark made before the run is already among the notes.
            let said = remark(&member.participant).filter(|remark| !self.notes.contains(remark));
            self.notes.extend(said);
        }
        self.notes.extend(self.promises.iter().filter_map(Watched::note));
        let statistics = Statistics { steps, final_time: self.grid.time(steps), wall_time };
        let promises = self.promises.iter().map(Watched::promise).collect();
        let interference = self.interference.iter().map(interference::Watched::interference).collect();
        Ok(Outcome {
            recording,
            statistics,
            promises,
            interference,
            notes: self.notes.clone(),
            failure: ran.err(),
        })
    }

    fn run_gauss_seidel(&mut self, recorder: &mut Recorder<'_>) -> Result<(), Error> {
        let (mut end, mut time) = (self.grid.steps(), self.grid.time(0));
        for k in 0..self.grid.steps() {
            let step = self.grid.step(k);
            self.check_stop(time)?;
            for i in 0..self.direct.len() {
                let c = self.direct[i];
                let member = &mut self.members[c];
                member.set_inputs(&mut self.values, &self.names)?;
                member.participant.do_step(time, step)?;
                self.read_direct(c, time)?;
            }
            for &c in &self.delayed {
                self.members[c].set_inputs(&mut self.values, &self.names)?;
            }
            self.take(recorder, k, time);
            for &c in &self.delayed {
                self.members[c].participant.do_step(time, step)?;
            }
            self.change(k + 1)?;
            time = self.grid.time(k + 1);
            for c in 0..self.members.len() {
                self.read_states(c, time)?;
            }
            if self.is_ended(k + 1) {
                end = k + 1;
                break;
            }
        }
        // Read the feedthrough outputs at the stop time, for FMUs that compute them when read.
        recorder.end_at(end);
        for i in 0..self.direct.len() {
            let c = self.direct[i];
            self.members[c].set_inputs(&mut self.values, &self.names)?;
            self.read_direct(c, time)?;
        }
        for &c in &self.delayed {
            self.members[c].set_inputs(&mut self.values, &self.names)?;
        }
        self.take(recorder, end, time);
        Ok(())
    }

    fn run_jacobi(&mut self, recorder: &mut Recorder<'_>) -> Result<(), Error> {
        for c in 0..self.members.len() {
            self.read_direct(c, self.start_time)?;
        }
        let mut end = self.grid.steps();
        for k in 0..self.grid.steps() {
            let (time, step) = (self.grid.time(k), self.grid.step(k));
            self.check_stop(time)?;
            for member in &mut self.members {
                member.set_inputs(&mut self.values, &self.names)?;
            }
            self.take(recorder, k, time);
            for member in &mut self.members {
                member.participant.do_step(time, step)?;
            }
            self.change(k + 1)?;
            for c in 0..self.members.len() {
                self.read_states(c, self.grid.time(k + 1))?;
                self.read_direct(c, self.grid.time(k + 1))?;
            }
            if self.is_ended(k + 1) {
                end = k + 1;
                break;
            }
        }
        for member in &mut self.members {
            member.set_inputs(&mut self.values, &self.names)?;
        }
        recorder.end_at(end);
        self.take(recorder, end, self.grid.time(end));
        Ok(())
    }

    /// Whether an FMU asked to end the run in the step to point `k`; if so, adds a note.
    fn is_ended(&mut self, k: u64) -> bool {
        let asking = self.members.iter().position(|member| member.participant.asks_to_end());
        asking.inspect(|c| self.note_end(*c, k)).is_some()
    }

    #[cold]
    fn note_end(&mut self, c: usize, k: u64) {
        let (name, time) = (self.members[c].participant.name(), brief_time(self.grid.time(k)));
        self.notes.push(format!("{name} asked to end the run at t = {time} s (terminateSimulation)"));
    }

    /// Sets start values and initialises. In initialization mode, outputs are passed to inputs until nothing
    /// changes, at most once for each component (enough if there is no loop).
    fn initialise(&mut self) -> Result<(), Error> {
        // Forget the last run. The deadlines may have start values.
        self.notes.truncate(self.standing_notes);
        self.reported.fill(false);
        for watched in &mut self.promises {
            let starts = &self.members[watched.component].starts;
            let deadline = watched.deadline.map(|(reference, own)| {
                starts.iter().find_map(|start| start.number(reference)).unwrap_or(own)
            });
            self.notes.extend(watched.reset(deadline, self.grid.usual()));
        }
        self.interference.iter_mut().for_each(interference::Watched::reset);
        // Set start values, and enter initialization mode.
        let used = std::mem::replace(&mut self.used, true);
        for member in &mut self.members {
            if used {
                member.participant.reset()?;
            }
            member.set_starts(true)?;
            member.participant.setup_experiment(self.start_time, self.stop_time, member.tolerance)?;
            member.set_starts(false)?;
            for (slot, value) in &member.constants {
                self.values[*slot] = *value;
            }
            member.participant.enter_initialization_mode()?;
        }
        // Pass outputs to inputs until nothing changes.
        let mut before: Vec<f64> = Vec::new();
        for _ in 0..=self.members.len() {
            for member in &mut self.members {
                member.states.read(&mut member.participant, &mut self.values)?;
            }
            for &c in &self.direct {
                let member = &mut self.members[c];
                member.set_first_inputs(&mut self.values)?;
                member.direct.read(&mut member.participant, &mut self.values)?;
            }
            for &c in &self.delayed {
                self.members[c].set_first_inputs(&mut self.values)?;
            }
            let unchanged = before.len() == self.values.len()
                && before.iter().zip(&self.values).all(|(a, b)| a.to_bits() == b.to_bits());
            if unchanged {
                break;
            }
            before.clone_from(&self.values);
        }
        // Enter step mode.
        for member in &mut self.members {
            member.participant.exit_initialization_mode()?;
        }
        for c in 0..self.members.len() {
            self.read_states(c, self.start_time)?;
        }
        Ok(())
    }

    /// Records point `k` at `time`, and evaluates the promises and the interference there.
    fn take(&mut self, recorder: &mut Recorder<'_>, k: u64, time: f64) {
        recorder.row(k, time, &self.values);
        self.promises.iter_mut().for_each(|watched| watched.see(time, &self.values));
        self.interference.iter_mut().for_each(|watched| watched.see(&self.values));
    }

    fn read_states(&mut self, c: usize, time: f64) -> Result<(), Error> {
        let member = &mut self.members[c];
        let reals = member.states.read(&mut member.participant, &mut self.values)?;
        if !reals.iter().all(|value| value.is_finite()) {
            let slots = member.states.real_slots();
            self.report_not_finite(slots, time);
        }
        let member = &mut self.members[c];
        let reals = member.others.read(&mut member.participant, &mut self.values)?;
        if !reals.iter().all(|value| value.is_finite()) {
            let slots = member.others.real_slots();
            self.report_not_finite(slots, time);
        }
        Ok(())
    }

    fn read_direct(&mut self, c: usize, time: f64) -> Result<(), Error> {
        let member = &mut self.members[c];
        let reals = member.direct.read(&mut member.participant, &mut self.values)?;
        if !reals.iter().all(|value| value.is_finite()) {
            let slots = member.direct.real_slots();
            self.report_not_finite(slots, time);
        }
        Ok(())
    }

    #[cold]
    fn report_not_finite(&mut self, slots: std::ops::Range<usize>, time: f64) {
        let mut found = Vec::new();
        for slot in slots {
            if !self.values[slot].is_finite() && !self.reported[slot] {
                self.reported[slot] = true;
                found.push(format!("{} is {}", self.names[slot], self.values[slot]));
            }
        }
        if !found.is_empty() {
            let (found, time) = (found.join(", "), brief_time(time));
            self.notes.push(format!("{found} at t = {time} s for the first time; the run goes on"));
        }
    }

    /// Adds a note on outputs that are not numbers, and so not recorded.
    fn note_what_is_not_recorded(&mut self, descriptions: &[&Description]) {
        for (member, description) in self.members.iter().zip(descriptions) {
            let outputs = description.outputs.iter().map(|output| &description.variables[output.variable]);
            let names: Vec<_> = outputs
                .filter(|v| !v.is_number())
                .map(|v| format!("{}.{} ({})", member.participant.name(), v.name, v.type_name))
                .collect();
            if !names.is_empty() {
                self.notes.push(format!("not recorded, since a row holds numbers: {}", names.join(", ")));
            }
        }
    }

    fn note_shortened_step(&mut self, descriptions: &[&Description]) {
        let Some(last) = self.grid.shortened() else { return };
        for (member, description) in self.members.iter().zip(descriptions) {
            if !description.any_step {
                let name = member.participant.name();
                self.notes.push(format!(
                    "the last step is {} s long, but the FMU of {name} does not say that it can handle steps \
                     of different length",
                    number(last)
                ));
            }
        }
    }
}
