//! The calls that a master makes in a co-simulation, independent of the version of FMI and of who answers
//! them. Also the calls that examine an FMU more closely.

use std::ffi::c_void;
use std::ptr::NonNull;
use std::rc::Rc;

use punctual_fmu::instance::Place;
use punctual_modeldescription::Causality;

use super::number::DataType;
use super::{Description, Fmu, LogMessage, Version};
use crate::error::Error;

/// An instance that a master steps: that of an FMU, or one of this program's own blocks in process.
///
/// Numbers are passed as doubles. A Boolean is 0 or 1. All elements of an array are read and written
/// together, in row-major order, with one value reference.
pub trait Participant {
    /// The instance name, which is that of its component.
    fn name(&self) -> &str;

    /// Returns to the state after instantiation.
    ///
    /// # Errors
    ///
    /// The call is refused. The same holds for every call below.
    fn reset(&mut self) -> Result<(), Error>;

    /// Begins to set structural parameters, which only FMI 3.0 has.
    ///
    /// # Errors
    ///
    /// As above.
    fn enter_configuration_mode(&mut self) -> Result<(), Error> {
        Ok(())
    }

    /// Ends the configuration mode.
    ///
    /// # Errors
    ///
    /// As above.
    fn exit_configuration_mode(&mut self) -> Result<(), Error> {
        Ok(())
    }

    /// Sets the start and stop time of the run, in s, and optionally the relative tolerance of the FMU's own
    /// solver.
    ///
    /// # Errors
    ///
    /// As above.
    fn setup_experiment(
        &mut self,
        start_time: f64,
        stop_time: f64,
        tolerance: Option<f64>,
    ) -> Result<(), Error>;

    /// Begins the initialisation.
    ///
    /// # Errors
    ///
    /// As above.
    fn enter_initialization_mode(&mut self) -> Result<(), Error>;

    /// Ends the initialisation.
    ///
    /// # Errors
    ///
    /// As above; also for parameters that contradict each other.
    fn exit_initialization_mode(&mut self) -> Result<(), Error>;

    /// Makes the step from `time` by `step` (s).
    ///
    /// # Errors
    ///
    /// As above.
    fn do_step(&mut self, time: f64, step: f64) -> Result<(), Error>;

    /// Whether the FMU asked to end the run in its last step.
    fn asks_to_end(&self) -> bool {
        false
    }

    /// Ends the run.
    ///
    /// # Errors
    ///
    /// As above.
    fn terminate(&mut self) -> Result<(), Error>;

    /// Reads variables of type `of` by their value references. Without references, nothing is called.
    ///
    /// # Errors
    ///
    /// As above; also for a number that no double represents, and for a type without numbers.
    fn get(&mut self, of: DataType, references: &[u32], values: &mut [f64]) -> Result<(), Error>;

    /// Writes variables of type `of`.
    ///
    /// # Errors
    ///
    /// As above; also for a number that the type cannot hold.
    fn set(&mut self, of: DataType, references: &[u32], values: &[f64]) -> Result<(), Error>;

    /// The storage place of an input or output, if the instance runs in this process. Then [`Self::read`] and
    /// [`Self::write`] are faster than [`Self::get`] and [`Self::set`].
    fn place(&self, _causality: Causality, _of: DataType, _reference: u32) -> Option<Place> {
        None
    }

    /// Reads the numbers at `places`, which [`Self::place`] returned.
    ///
    /// # Errors
    ///
    /// As above; also if the participant has no places.
    fn read(&mut self, _places: &[Place], _values: &mut [f64]) -> Result<(), Error> {
        Err(Error::broken(self.name(), "tells no places to read"))
    }

    /// Writes numbers to `places`, which [`Self::place`] returned for inputs.
    ///
    /// # Errors
    ///
    /// As above.
    fn write(&mut self, _places: &[Place], _values: &[f64]) -> Result<(), Error> {
        Err(Error::broken(self.name(), "tells no places to write"))
    }

    /// Writes a text, or all texts of an array.
    ///
    /// # Errors
    ///
    /// As above; also for texts that contain a zero byte.
    fn set_text(&mut self, reference: u32, texts: &[String]) -> Result<(), Error>;

    /// The instance's remark on a run that succeeded, if it has one.
    fn remark(&self) -> Option<String>;
}

/// A state of an instance, owned by its library. [`Slave::release`] frees its memory.
#[derive(Debug)]
pub struct Saved(pub(super) NonNull<c_void>);

/// An instance of an FMU.
pub trait Slave: Participant {
    /// Its version of FMI.
    fn version(&self) -> Version;

    /// Number of calls that returned a warning (they count as successful).
    fn warnings(&self) -> u64;

    /// Its last log messages, oldest first; at most eight.
    fn log(&self) -> Vec<LogMessage>;

    /// What was wrong with the first call of its log callback that violated the standard.
    fn log_fault(&self) -> Option<String>;

    /// Reads a text, or all `count` texts of an array; `None` for each that is NULL, and for all if the FMU
    /// lacks the function.
    ///
    /// # Errors
    ///
    /// As for a [`Participant`].
    fn get_text(&mut self, reference: u32, count: usize) -> Result<Option<Vec<Option<String>>>, Error>;

    /// Sets whether a later [`Slave::restore`] may go back to before a step; the FMU learns this with each
    /// step. It may not by default.
    fn may_go_back(&mut self, _may: bool) {}

    /// Saves its state; `None` if it does not offer the call. The same holds for the calls below.
    ///
    /// # Errors
    ///
    /// As for a [`Participant`]; so for the calls below.
    fn save(&mut self) -> Result<Option<Saved>, Error> {
        Ok(None)
    }

    /// Returns to a saved state of this FMU.
    ///
    /// # Errors
    ///
    /// As above.
    fn restore(&mut self, _state: &Saved) -> Result<(), Error> {
        Ok(())
    }

    /// Frees the memory of a state.
    ///
    /// # Errors
    ///
    /// As above.
    fn release(&mut self, _state: Saved) -> Result<(), Error> {
        Ok(())
    }

    /// Serialises a state.
    ///
    /// # Errors
    ///
    /// As above.
    fn to_bytes(&mut self, _state: &Saved) -> Result<Option<Vec<u8>>, Error> {
        Ok(None)
    }

    /// Deserialises a state.
    ///
    /// # Errors
    ///
    /// As above.
    fn of_bytes(&mut self, _bytes: &[u8]) -> Result<Option<Saved>, Error> {
        Ok(None)
    }

    /// Computes the derivative of the real variable `unknown` in the direction `seed` of the real variable
    /// `known`. If `adjoint`, computes that of `seed · unknown` with respect to each element of `known`. The
    /// result goes to `derivatives`. False if the FMU does not offer the call.
    ///
    /// # Errors
    ///
    /// As above.
    fn derivative(
        &mut self,
        _adjoint: bool,
        (_unknown, _known): (u32, u32),
        _seed: &[f64],
        _derivatives: &mut [f64],
    ) -> Result<bool, Error> {
        Ok(false)
    }
}

/// The remark of an instance on a successful run: how many calls returned `warning`, or a warning in its log.
pub(super) fn remark(warnings: u64, warning: &str, log: Vec<LogMessage>) -> Option<String> {
    if warnings > 0 {
        let last = log.last().map(|m| format!("; last: {m}")).unwrap_or_default();
        return Some(format!("{warnings} calls returned {warning}{last}"));
    }
    log.into_iter().rfind(|message| message.status.is_warning()).map(|message| message.text)
}

/// Passes calls on to the wrapped participant.
macro_rules! calls {
    ($($method:ident($($argument:ident: $kind:ty),*);)*) => {$(
        fn $method(&mut self, $($argument: $kind),*) -> Result<(), Error> {
            self.as_mut().$method($($argument),*)
        }
    )*};
}

/// All calls except `reset` and those that use places.
macro_rules! calls_of_a_run {
    () => {
        calls! {
            enter_configuration_mode();
            exit_configuration_mode();
            setup_experiment(start_time: f64, stop_time: f64, tolerance: Option<f64>);
            enter_initialization_mode();
            exit_initialization_mode();
            do_step(time: f64, step: f64);
            terminate();
            get(of: DataType, references: &[u32], values: &mut [f64]);
            set(of: DataType, references: &[u32], values: &[f64]);
            set_text(reference: u32, texts: &[String]);
        }
    };
}

impl Participant for Box<dyn Participant> {
    fn name(&self) -> &str {
        self.as_ref().name()
    }

    calls! {
        reset();
        read(places: &[Place], values: &mut [f64]);
        write(places: &[Place], values: &[f64]);
    }

    calls_of_a_run! {}

    fn place(&self, causality: Causality, of: DataType, reference: u32) -> Option<Place> {
        self.as_ref().place(causality, of, reference)
    }

    fn asks_to_end(&self) -> bool {
        self.as_ref().asks_to_end()
    }

    fn remark(&self) -> Option<String> {
        self.as_ref().remark()
    }
}

/// An instance of an FMU of another program, instantiated again for every run, since FMUs differ in what a
/// reset forgets.
pub struct Fresh {
    fmu: Rc<Fmu>,
    description: Rc<Description>,
    slave: Box<dyn Slave>,
}

impl Fresh {
    /// An instance of `fmu` called `name`.
    ///
    /// # Errors
    ///
    /// As for [`Fmu::instantiate`].
    pub fn new(fmu: Rc<Fmu>, description: Rc<Description>, name: &str) -> Result<Self, Error> {
        let slave = fmu.instantiate(&description, name)?;
        Ok(Self { fmu, description, slave })
    }

    fn as_mut(&mut self) -> &mut dyn Slave {
        self.slave.as_mut()
    }
}

impl Participant for Fresh {
    fn name(&self) -> &str {
        self.slave.name()
    }

    fn reset(&mut self) -> Result<(), Error> {
        self.slave = self.fmu.instantiate(&self.description, self.slave.name())?;
        Ok(())
    }

    calls_of_a_run! {}

    fn asks_to_end(&self) -> bool {
        self.slave.asks_to_end()
    }

    fn remark(&self) -> Option<String> {
        self.slave.remark()
    }
}
