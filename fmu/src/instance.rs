//! The state machine of FMI 2.0 and 3.0 in safe Rust: modes, time, values, lazy outputs.
//!
//! Everything here takes references and returns `Result`; the C interface only guards and converts. A failed
//! call leaves the instance unchanged.
//!
//! **Sample time.** An output read after inputs were set belongs to those inputs at the communication point
//! at which they were set. It is computed when read, and changes no state. A step computes the sample at its
//! start and remembers it. After the step, outputs stay at that sample (a filter) or show the new state (a
//! plant) until inputs change.
//!
//! **Steps taken back.** Importers that restore a state may forget to reset their own clock (MasterSim does).
//! So the first step after a restore may be given any time within the steps that were taken back, and starts
//! at the restored time. The instance knows the extent of these steps, but it is not part of a snapshot: a
//! restored state has the same bytes as before, and with correct times the extent has no effect.

mod access;
mod arrays;
mod derivative;
mod places;

use punctual_modeldescription::{BaseType, Causality, Integer, Plain, Real, Variability, VariableKind};

use crate::block::{self, Block, BlockState, Values};
use crate::configuration::{Configuration, ConfigurationError, FmiVersion};
use crate::product::{Access, Product};
pub use places::Place;

/// Times in s that differ by at most this plus [`TIME_ROUND_OFF`] are the same communication point, since
/// importers count time in nanoseconds.
const SAME_TIME: f64 = 1e-9;

/// Fraction of a time that counts as round-off, some hundred units in the last place, since importers
/// accumulate time by addition or multiplication. It is much less than any step, even if time is counted from
/// 1970.
const TIME_ROUND_OFF: f64 = 1e-13;

/// Fraction of the last step by which a plant's next step may start late, for importers that round times to
/// their own resolution.
const GAP: f64 = 1e-3;

/// The modes of an instance, as flags.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mode(u8);

impl Mode {
    /// After `fmi2Instantiate` or `fmi2Reset`.
    pub const INSTANTIATED: Self = Self(1);
    /// Between `fmi2EnterInitializationMode` and `fmi2ExitInitializationMode`.
    pub const INITIALIZATION: Self = Self(2);
    /// Between communication points.
    pub const STEP: Self = Self(4);
    /// After `fmi2Terminate`.
    pub const TERMINATED: Self = Self(8);
    /// All of them.
    pub const ANY: Self = Self(15);

    pub(crate) const fn or(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Each mode separately.
    pub const EACH: [Self; 4] = [Self::INSTANTIATED, Self::INITIALIZATION, Self::STEP, Self::TERMINATED];

    /// Whether `self` is one of `modes`.
    pub fn is_in(self, modes: Self) -> bool {
        self.0 & modes.0 != 0
    }

    /// The mode in words.
    pub fn name(self) -> &'static str {
        match self {
            Self::INSTANTIATED => "instantiated",
            Self::INITIALIZATION => "initialization",
            Self::STEP => "step",
            Self::TERMINATED => "terminated",
            _ => "several modes",
        }
    }
}

/// The calls whose legality depends on the mode. In FMI 3.0 their names differ only in the prefix.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Call {
    /// `fmi2SetupExperiment`.
    SetupExperiment,
    /// `fmi2EnterInitializationMode`; a preceding `fmi2SetupExperiment` is not required.
    EnterInitializationMode,
    /// `fmi2ExitInitializationMode`.
    ExitInitializationMode,
    /// `fmi2Terminate`.
    Terminate,
    /// `fmi2GetReal` and the other getters.
    Get,
    /// `fmi2SetReal` and the other setters.
    Set,
    /// `fmi2DoStep`.
    DoStep,
    /// `fmi2GetDirectionalDerivative`; also `fmi3GetAdjointDerivative`.
    GetDirectionalDerivative,
}

/// The modes in which each call is legal, in the order of [`Call`] (FMI 2.0.4, section 4.2.4, figure 11; FMI
/// 3.0.2, sections 2.3.2 to 2.3.8 and 4.2.1). They are wider than the standards where importers are: values
/// may be read in every mode. Calls that are not listed are legal in every mode.
pub const LEGAL: [(Call, Mode); 8] = {
    const SETTABLE: Mode = Mode::INSTANTIATED.or(Mode::INITIALIZATION).or(Mode::STEP);
    const KNOWN: Mode = Mode::INITIALIZATION.or(Mode::STEP).or(Mode::TERMINATED);
    [
        // FMI 3.0 has no such function, but in-process instances use it for both versions.
        (Call::SetupExperiment, Mode::INSTANTIATED),
        (Call::EnterInitializationMode, Mode::INSTANTIATED),
        (Call::ExitInitializationMode, Mode::INITIALIZATION),
        (Call::Terminate, Mode::STEP),
        (Call::Get, Mode::ANY),
        (Call::Set, SETTABLE),
        (Call::DoStep, Mode::STEP),
        (Call::GetDirectionalDerivative, KNOWN),
    ]
};

impl Call {
    /// The modes in which it is legal, from [`LEGAL`].
    #[inline]
    pub fn modes(self) -> Mode {
        let (_, modes) = LEGAL[self as usize];
        modes
    }
}

/// A series of steps without gaps, times in s.
#[derive(Clone, Copy, Debug)]
struct Unbroken {
    begin: f64,
    /// The current communication point. Between a restore and the next step, it may be later: the end of the
    /// steps that were taken back.
    end: f64,
    /// The largest delay of a step after the end of the one before, as occurs with a clock that rounds.
    rounding: f64,
}

impl Unbroken {
    /// A series without steps, at `time`.
    fn at(time: f64) -> Self {
        Self { begin: time, end: time, rounding: 0.0 }
    }
}

/// Whether a step was given a time within the steps taken back, for the log.
#[derive(Clone, Copy, Debug)]
enum Mistimed {
    /// Not in this run.
    Never,
    /// For the first time: `given` instead of `restored`, in s.
    First { given: f64, restored: f64 },
    /// Already reported.
    Reported,
}

/// The reason why a call failed, for the log: the value given and those allowed.
pub type Failure = String;

/// A snapshot of an instance: everything that influences its future.
#[derive(Debug, PartialEq)]
pub struct State {
    /// The GUID of the FMU it belongs to.
    pub guid: String,
    /// The mode.
    pub mode: Mode,
    /// The communication point in s.
    pub time: f64,
    /// The end of the run in s, beyond which FMI 3.0 allows no step; infinite if none was given, and with FMI
    /// 2.0.
    pub stop: f64,
    /// Whether a step was made since initialization.
    pub stepped: bool,
    /// The length of the last step in s.
    pub last_step: f64,
    /// Whether the outputs in `values` belong to the inputs in `values`.
    pub fresh: bool,
    /// Whether `block` belongs to the parameters in `values`.
    pub configured: bool,
    /// Inputs (including pending ones), outputs and parameters.
    pub values: Values,
    /// The state of the computation.
    pub block: BlockState,
}

/// One instance of an FMU, of either version of FMI.
pub struct Instance {
    product: Product,
    /// The version of FMI in `product`, which every call checks.
    fmi: FmiVersion,
    /// Type and causality by value reference; compact, since it is checked at every read and write.
    kinds: Vec<(BaseType, Causality, Variability)>,
    /// The same for FMI 3.0, with the lengths of arrays; empty for FMI 2.0.
    accesses: Vec<Access>,
    block: Box<dyn Block>,
    /// The state of a new block, which has no memory yet.
    start: BlockState,
    mode: Mode,
    /// The current communication point in s.
    time: f64,
    /// The end of the run in s, if a step beyond it is an error.
    stop: f64,
    values: Values,
    /// Whether a step was made since initialization.
    stepped: bool,
    /// The length of the last step in s.
    last_step: f64,
    /// Whether the outputs in `values` belong to the inputs in `values`.
    fresh: bool,
    /// Whether `block` has the parameters in `values`.
    configured: bool,
    unbroken: Unbroken,
    mistimed: Mistimed,
    /// Buffers: a direction and the derivative along it, at the indices of the variables; and the sum for an
    /// adjoint derivative.
    derivative: [Vec<f64>; 3],
}

impl Instance {
    /// An instance of `configuration`, which must be the one that `guid` belongs to.
    ///
    /// # Errors
    ///
    /// A GUID that is not the configuration's.
    pub fn new(configuration: Configuration, guid: &str) -> Result<Self, Failure> {
        let product = Product::new(configuration).map_err(|e| e.to_string())?;
        if guid != product.guid {
            return Err(format!(
                "the GUID is {guid:?}, must be {:?} (library version {}): the model description and \
                 resources/{} do not belong together",
                product.guid,
                env!("CARGO_PKG_VERSION"),
                crate::configuration::RESOURCE
            ));
        }
        let block = block::build(&product).map_err(|e| e.to_string())?;
        let len = product.variables.len();
        let values = Values::zeros(len);
        let mut start = BlockState::Plant { x: Vec::new() };
        block.save(&mut start);
        let kinds =
            product.variables.iter().map(|v| (v.kind.base_type(), v.causality, v.variability)).collect();
        let accesses = product.accesses();
        let mut instance = Self {
            fmi: product.configuration.experiment().fmi,
            product,
            kinds,
            accesses,
            block,
            start,
            mode: Mode::INSTANTIATED,
            time: 0.0,
            stop: f64::INFINITY,
            stepped: false,
            last_step: 0.0,
            values,
            fresh: false,
            configured: false,
            unbroken: Unbroken::at(0.0),
            mistimed: Mistimed::Never,
            derivative: std::array::from_fn(|_| vec![0.0; len]),
        };
        instance.start_values();
        Ok(instance)
    }

    /// The current mode.
    pub fn mode(&self) -> Mode {
        self.mode
    }

    /// The current communication point in s.
    pub fn time(&self) -> f64 {
        self.time
    }

    /// Configuration, variables and GUID.
    pub fn product(&self) -> &Product {
        &self.product
    }

    /// Its version of FMI.
    pub fn fmi(&self) -> FmiVersion {
        self.fmi
    }

    /// Whether initialization is over, so that fixed parameters cannot change.
    fn is_running(&self) -> bool {
        self.mode == Mode::STEP
    }

    /// Whether `call` is legal now.
    ///
    /// # Errors
    ///
    /// A call that [`LEGAL`] excludes in this mode.
    #[inline]
    pub fn check(&self, call: Call) -> Result<(), Failure> {
        let modes = call.modes();
        if self.mode.is_in(modes) { Ok(()) } else { Err(self.misplaced(modes)) }
    }

    /// The reason for refusing a call that is only legal in `modes`.
    #[cold]
    fn misplaced(&self, modes: Mode) -> Failure {
        let allowed: Vec<_> = Mode::EACH
            .into_iter()
            .filter(|m| m.is_in(modes))
            .map(|mode| format!("{:?}", mode.name()))
            .collect();
        format!("not allowed in the mode {:?}, only in {}", self.mode.name(), allowed.join(", "))
    }

    /// Sets the start time; tolerance and stop time are not used.
    ///
    /// # Errors
    ///
    /// The wrong mode; a time that is not finite; a stop time before the start time.
    pub fn setup_experiment(&mut self, start_time: f64, stop_time: Option<f64>) -> Result<(), Failure> {
        self.check(Call::SetupExperiment)?;
        Self::check_times(start_time, stop_time)?;
        self.time = start_time;
        Ok(())
    }

    /// Enters initialization mode as in FMI 3.0: with the start time, and the stop time beyond which no step
    /// may go.
    ///
    /// # Errors
    ///
    /// Those of [`Self::setup_experiment`].
    pub fn begin(&mut self, start_time: f64, stop_time: Option<f64>) -> Result<(), Failure> {
        self.check(Call::EnterInitializationMode)?;
        Self::check_times(start_time, stop_time)?;
        (self.time, self.stop) = (start_time, stop_time.unwrap_or(f64::INFINITY));
        self.enter_initialization_mode()
    }

    fn check_times(start_time: f64, stop_time: Option<f64>) -> Result<(), Failure> {
        if !start_time.is_finite() {
            return Err(format!("startTime is {start_time}, must be finite"));
        }
        if let Some(stop) = stop_time.filter(|stop| stop.is_nan() || *stop < start_time) {
            return Err(format!("stopTime is {stop}, must be >= startTime = {start_time}"));
        }
        Ok(())
    }

    /// Enters initialization mode.
    ///
    /// # Errors
    ///
    /// The wrong mode.
    pub fn enter_initialization_mode(&mut self) -> Result<(), Failure> {
        self.check(Call::EnterInitializationMode)?;
        self.mode = Mode::INITIALIZATION;
        self.fresh = false;
        Ok(())
    }

    /// Applies the parameters and enters step mode.
    ///
    /// # Errors
    ///
    /// The wrong mode; parameters that contradict each other (such as `u_min.a` above `u_max.a`).
    pub fn exit_initialization_mode(&mut self) -> Result<(), Failure> {
        self.check(Call::ExitInitializationMode)?;
        self.configure().map_err(|e| e.to_string())?;
        self.mode = Mode::STEP;
        (self.unbroken, self.mistimed) = (Unbroken::at(self.time), Mistimed::Never);
        self.block.output(self.time, &mut self.values);
        self.block.begin(&mut self.values);
        self.fresh = true;
        Ok(())
    }

    /// Ends the run; values can still be read.
    ///
    /// # Errors
    ///
    /// The wrong mode.
    pub fn terminate(&mut self) -> Result<(), Failure> {
        self.check(Call::Terminate)?;
        self.mode = Mode::TERMINATED;
        Ok(())
    }

    /// Returns to the state after `fmi2Instantiate`, start values included.
    pub fn reset(&mut self) {
        self.mode = Mode::INSTANTIATED;
        (self.time, self.stop) = (0.0, f64::INFINITY);
        self.stepped = false;
        self.last_step = 0.0;
        self.fresh = false;
        self.configured = false;
        self.unbroken = Unbroken::at(0.0);
        let len = self.product.variables.len();
        self.values = Values::zeros(len);
        self.start_values();
        // After this, a state saved now equals that of a new instance, bit for bit.
        let restored = self.block.restore(&self.start);
        debug_assert!(restored.is_ok(), "{restored:?}");
    }

    /// A snapshot of the instance, in any mode.
    pub fn state(&self) -> State {
        let mut state = State {
            guid: String::new(),
            mode: self.mode,
            time: 0.0,
            stop: f64::INFINITY,
            stepped: false,
            last_step: 0.0,
            fresh: false,
            configured: false,
            values: Values::default(),
            block: BlockState::Plant { x: Vec::new() },
        };
        self.save(&mut state);
        state
    }

    /// Overwrites `state` with a snapshot; does not allocate if that was one of this FMU.
    pub fn save(&self, state: &mut State) {
        // Without `..`, so that a new field does not compile until it is decided whether it belongs to the
        // state.
        let Self {
            product,
            fmi: _,
            kinds: _,
            accesses: _,
            block,
            start: _,
            mode,
            time,
            stop,
            values,
            stepped,
            last_step,
            fresh,
            configured,
            unbroken: _,
            mistimed: _,
            derivative: _,
        } = self;
        state.guid.clone_from(&product.guid);
        (state.mode, state.time, state.stop, state.last_step) = (*mode, *time, *stop, *last_step);
        (state.stepped, state.fresh, state.configured) = (*stepped, *fresh, *configured);
        state.values.clone_from(values);
        block.save(&mut state.block);
    }

    /// Restores an earlier or later snapshot of this or another instance of the same FMU, in any mode.
    /// Everything that follows is bitwise the same. Only allocates if the parameters differ.
    ///
    /// # Errors
    ///
    /// The state of another FMU.
    pub fn restore(&mut self, state: &State) -> Result<(), Failure> {
        let State { guid, mode, time, stop, stepped, last_step, fresh, configured, values, block } = state;
        if *guid != self.product.guid {
            return Err(format!(
                "the state belongs to the FMU with the GUID {guid:?}, must be {:?}",
                self.product.guid
            ));
        }
        let parameters = self.product.layout.parameters..self.product.layout.end;
        let bits = |(a, b): (&f64, &f64)| a.to_bits() == b.to_bits();
        let mut pairs = self.values.reals[parameters.clone()].iter().zip(&values.reals[parameters]);
        let mut own = None;
        if *configured && !(self.configured && pairs.all(bits)) {
            self.block.save(own.insert(BlockState::Plant { x: Vec::new() }));
            self.block.configure(values).map_err(|e| e.to_string())?;
        }
        if let Err(reason) = self.block.restore(block) {
            // With other parameters it may not fit them: back to its own.
            if let Some(own) = own {
                self.block.configure(&self.values).map_err(|e| e.to_string())?;
                self.block.restore(&own)?;
            }
            return Err(reason);
        }
        (self.mode, self.time, self.stop, self.last_step) = (*mode, *time, *stop, *last_step);
        (self.stepped, self.fresh, self.configured) = (*stepped, *fresh, *configured);
        self.values.clone_from(values);
        if !(self.unbroken.begin..=self.unbroken.end).contains(time) {
            self.unbroken = Unbroken::at(*time);
        }
        Ok(())
    }

    /// Makes the communication step from `t` by `h` seconds. The first one after a restore starts at the
    /// restored time wherever `t` lies within the steps that were taken back; [`Self::notice`] reports this.
    ///
    /// # Errors
    ///
    /// The wrong mode; a step size that is not finite or negative; a time that is not finite or before the
    /// current communication point, or for a plant also after it (part of its motion would be missing); a
    /// refusal by the block itself. Importers that ignore the error see it in the outputs of a filter:
    /// `status` is `invalid_input` and `u` is as close to 0 as its bounds allow, until an input is set or a
    /// step is made.
    #[inline]
    pub fn do_step(&mut self, t: f64, h: f64) -> Result<(), Failure> {
        self.check(Call::DoStep)?;
        self.step(t, h).map_err(|reason| self.refused_step(reason))
    }

    /// Shows in the outputs that a step was refused.
    #[cold]
    fn refused_step(&mut self, reason: Failure) -> Failure {
        self.block.show_refusal(&mut self.values);
        self.fresh = true;
        reason
    }

    /// A warning on the configuration, if there is one.
    pub fn warning(&self) -> Option<String> {
        self.product.configuration.warning()
    }

    /// A notice to the user on the last step, if there is one; given once.
    #[inline]
    pub fn notice(&mut self) -> Option<String> {
        match self.mistimed {
            Mistimed::First { given, restored } => Some(self.tell_mistimed(given, restored)),
            Mistimed::Never | Mistimed::Reported => self.block.notice(),
        }
    }

    #[cold]
    fn tell_mistimed(&mut self, given: f64, restored: f64) -> String {
        self.mistimed = Mistimed::Reported;
        format!(
            "currentCommunicationPoint is {given}, must be the restored one, {restored}: the step is made from there, \
             as every such step after a restore (reported once)"
        )
    }

    fn step(&mut self, t: f64, h: f64) -> Result<(), Failure> {
        let (end, same) = (t + h, SAME_TIME + TIME_ROUND_OFF * t.abs());
        // If the end is finite, so are the time and the step size.
        if t < self.time - same || end > self.stop + same || !(h >= 0.0 && end.is_finite()) {
            return Err(self.out_of_time(t, h, same));
        }
        if t - self.time <= same {
            self.make_step(self.time, h, end)
        } else {
            self.step_after_gap(t, h, same)
        }
    }

    /// The reason for refusing a step from `t` by `h` seconds.
    #[cold]
    fn out_of_time(&self, t: f64, h: f64, same: f64) -> Failure {
        let (time, end) = (self.time, t + h);
        if !t.is_finite() || t < time - same {
            format!("currentCommunicationPoint is {t}, must be finite and not before the present one, {time}")
        } else if !(h.is_finite() && h >= 0.0) {
            format!("communicationStepSize is {h} at t = {t}, must be finite and >= 0")
        } else if !end.is_finite() {
            format!("the step of {h} s at t = {t} ends at {end}, must be finite")
        } else {
            format!("the step of {h} s at t = {t} ends at {end}, must end by stopTime = {}", self.stop)
        }
    }

    /// Makes the step from `t`, which is more than `same` after the current time.
    #[cold]
    fn step_after_gap(&mut self, t: f64, h: f64, same: f64) -> Result<(), Failure> {
        let (start, mistimed, unbroken) = self.after_gap(t, same)?;
        self.make_step(start, h, start + h)?;
        if mistimed && matches!(self.mistimed, Mistimed::Never) {
            self.mistimed = Mistimed::First { given: t, restored: start };
        }
        self.unbroken = Unbroken { end: self.time, ..unbroken };
        Ok(())
    }

    /// Makes the step from `start` by `h` seconds, which ends at `end`.
    fn make_step(&mut self, start: f64, h: f64, end: f64) -> Result<(), Failure> {
        self.block.step(start, h, &mut self.values)?;
        // Not before `start`: a tiny step from a time that is early by round-off must not go back.
        self.time = end.max(start);
        self.unbroken.end = self.time;
        self.stepped = true;
        self.last_step = h;
        self.fresh = true;
        Ok(())
    }

    /// For a step given the time `t`, more than `same` after the current one: where it begins, whether that
    /// is a wrong time after a restore, and the unbroken steps before it.
    fn after_gap(&self, t: f64, same: f64) -> Result<(f64, bool, Unbroken), Failure> {
        let (gap, rounding, unbroken) = (t - self.time, GAP * self.last_step, self.unbroken);
        // A clock that rounds repeats its rounding when it goes back. Any other time within the steps taken
        // back is wrong.
        let is_taken_back = unbroken.end > self.time && t <= unbroken.end + same;
        if is_taken_back && gap > rounding.min(unbroken.rounding) {
            return Ok((self.time, true, unbroken));
        }
        if gap <= rounding {
            return Ok((t, false, Unbroken { rounding: unbroken.rounding.max(gap), ..unbroken }));
        }
        if self.stepped && !self.block.accepts_gaps() {
            return Err(format!(
                "currentCommunicationPoint is {t}, must be the present one, {}: the plant did not move in between",
                self.time
            ));
        }
        Ok((t, false, Unbroken::at(t)))
    }

    /// Reads reals, in the units of the variables.
    ///
    /// # Errors
    ///
    /// A value reference that is not that of a real.
    pub fn get_real(&mut self, references: &[u32], out: &mut [f64]) -> Result<(), Failure> {
        self.get(BaseType::Real, references, out, |values| &values.reals)
    }

    /// Reads integers and enumerations.
    ///
    /// # Errors
    ///
    /// A value reference that is not that of an integer or enumeration.
    pub fn get_integer(&mut self, references: &[u32], out: &mut [i32]) -> Result<(), Failure> {
        self.get(BaseType::Integer, references, out, |values| &values.integers)
    }

    /// Reads booleans, as 0 and 1.
    ///
    /// # Errors
    ///
    /// A value reference that is not that of a boolean.
    pub fn get_boolean(&mut self, references: &[u32], out: &mut [i32]) -> Result<(), Failure> {
        self.check_references(Call::Get, BaseType::Boolean, references)?;
        self.refresh();
        for (&reference, o) in references.iter().zip(out) {
            *o = i32::from(self.values.booleans[reference as usize]);
        }
        Ok(())
    }

    /// Reads or writes strings: there are none, so every reference is an error.
    ///
    /// # Errors
    ///
    /// Any reference at all.
    pub fn check_strings(&self, call: Call, references: &[u32]) -> Result<(), Failure> {
        self.check_references(call, BaseType::String, references)
    }

    /// Writes reals. Inputs may have any value; one that is not finite shows in `status`, or at the next step
    /// of a plant. Parameters must lie within their range.
    ///
    /// # Errors
    ///
    /// The wrong mode; a reference that is not that of a real input or parameter; a parameter outside its
    /// range or after initialization.
    pub fn set_real(&mut self, references: &[u32], values: &[f64]) -> Result<(), Failure> {
        self.check_settable(BaseType::Real, references)?;
        for (&reference, &value) in references.iter().zip(values) {
            self.check_range(reference as usize, value)?;
        }
        for (&reference, &value) in references.iter().zip(values) {
            self.values.reals[reference as usize] = value;
        }
        self.taken_over(references);
        Ok(())
    }

    /// Checks that the real number `index` may have this `value`. A parameter must lie within its range; an
    /// input, which comes before the outputs, may have any value.
    #[inline]
    fn check_range(&self, index: usize, value: f64) -> Result<(), Failure> {
        match index.checked_sub(self.product.layout.parameters) {
            None => Ok(()),
            Some(i) => self.check_range_of_parameter(i, value),
        }
    }

    fn check_range_of_parameter(&self, i: usize, value: f64) -> Result<(), Failure> {
        let name = &self.product.variables[self.product.layout.parameters + i].name;
        self.product.ranges[i].check(name, value).map_err(|e| e.to_string())
    }

    /// Notes that reals were set.
    fn taken_over(&mut self, references: &[u32]) {
        self.fresh &= references.is_empty();
        let tuned = references.iter().any(|&reference| reference as usize >= self.product.layout.parameters);
        if tuned && self.is_running() {
            // The block reads from the values what may change during a run, so a change takes effect
            // immediately.
            self.block.output(self.time, &mut self.values);
        } else if tuned {
            self.configured = false;
        }
    }

    /// Writes integers: there is no integer input or parameter.
    ///
    /// # Errors
    ///
    /// The wrong mode; any reference at all.
    pub fn set_integer(&mut self, references: &[u32], values: &[i32]) -> Result<(), Failure> {
        self.check_settable(BaseType::Integer, references)?;
        for (&reference, &value) in references.iter().zip(values) {
            self.values.integers[reference as usize] = value;
        }
        Ok(())
    }

    /// Writes booleans; every number but 0 is true.
    ///
    /// # Errors
    ///
    /// The wrong mode; a reference that is not that of a boolean input.
    pub fn set_boolean(&mut self, references: &[u32], values: &[i32]) -> Result<(), Failure> {
        self.check_settable(BaseType::Boolean, references)?;
        for (&reference, &value) in references.iter().zip(values) {
            self.values.booleans[reference as usize] = value != 0;
        }
        self.fresh &= references.is_empty();
        Ok(())
    }

    fn get<T: Copy>(
        &mut self,
        base: BaseType,
        references: &[u32],
        out: &mut [T],
        array: impl Fn(&Values) -> &Vec<T>,
    ) -> Result<(), Failure> {
        self.check_references(Call::Get, base, references)?;
        self.refresh();
        for (&reference, o) in references.iter().zip(out) {
            *o = array(&self.values)[reference as usize];
        }
        Ok(())
    }

    /// Computes the outputs if inputs have changed since the last time.
    #[inline]
    fn refresh(&mut self) {
        if !self.fresh {
            self.refresh_stale();
        }
    }

    #[inline(never)]
    fn refresh_stale(&mut self) {
        let lazy = match self.mode {
            Mode::INITIALIZATION => true,
            Mode::STEP => self.block.direct_feedthrough(),
            _ => false,
        };
        // Contradictory parameters are an error when initialization ends. Until then, the outputs stay as
        // they are.
        if lazy && (self.configured || self.configure().is_ok()) {
            self.block.output(self.time, &mut self.values);
            if self.mode == Mode::INITIALIZATION {
                self.block.begin(&mut self.values);
            }
            self.fresh = true;
        }
    }

    fn configure(&mut self) -> Result<(), ConfigurationError> {
        self.block.configure(&self.values)?;
        self.configured = true;
        Ok(())
    }

    fn start_values(&mut self) {
        for (i, variable) in self.product.variables.iter().enumerate() {
            match &variable.kind {
                VariableKind::Real(Real { start: Some(start), .. }) => self.values.reals[i] = *start,
                VariableKind::Boolean(Plain { start: Some(start), .. }) => self.values.booleans[i] = *start,
                VariableKind::Integer(Integer { start: Some(start), .. })
                | VariableKind::Enumeration(Integer { start: Some(start), .. }) => {
                    self.values.integers[i] = *start;
                }
                _ => {}
            }
        }
    }
}
