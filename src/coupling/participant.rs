//! The calls of FMI 2.0 co-simulation that the master makes, whoever answers them.

use std::borrow::BorrowMut;

use punctual_fmu::fmi2::Status;

use crate::error::Error;
use crate::host::Slave;

/// An instance that the master steps: an FMU's, or one of this program's own blocks in process.
pub trait Participant {
    /// The instance name, which is that of its component.
    fn name(&self) -> &str;

    /// Goes back to the state after instantiation.
    ///
    /// # Errors
    ///
    /// The call is refused; so for every call below.
    fn reset(&mut self) -> Result<(), Error>;

    /// Sets start and stop time of the run, in s.
    ///
    /// # Errors
    ///
    /// As above.
    fn setup_experiment(&mut self, start_time: f64, stop_time: f64) -> Result<(), Error>;

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

    /// Ends the run.
    ///
    /// # Errors
    ///
    /// As above.
    fn terminate(&mut self) -> Result<(), Error>;

    /// Reads Real variables by their value references.
    ///
    /// # Errors
    ///
    /// As above.
    fn get_real(&mut self, references: &[u32], values: &mut [f64]) -> Result<(), Error>;

    /// Reads Integer and Enumeration variables.
    ///
    /// # Errors
    ///
    /// As above.
    fn get_integer(&mut self, references: &[u32], values: &mut [i32]) -> Result<(), Error>;

    /// Reads Boolean variables; 0 is false.
    ///
    /// # Errors
    ///
    /// As above.
    fn get_boolean(&mut self, references: &[u32], values: &mut [i32]) -> Result<(), Error>;

    /// Writes Real variables.
    ///
    /// # Errors
    ///
    /// As above.
    fn set_real(&mut self, references: &[u32], values: &[f64]) -> Result<(), Error>;

    /// Writes Integer and Enumeration variables.
    ///
    /// # Errors
    ///
    /// As above.
    fn set_integer(&mut self, references: &[u32], values: &[i32]) -> Result<(), Error>;

    /// Writes Boolean variables; 0 is false.
    ///
    /// # Errors
    ///
    /// As above.
    fn set_boolean(&mut self, references: &[u32], values: &[i32]) -> Result<(), Error>;

    /// The instance's remark on a run that succeeded, if it has one.
    fn remark(&self) -> Option<String>;
}

/// Passes calls on to what is inside, which answers them under the same name.
macro_rules! calls {
    ($inside:ty) => {
        calls! { $inside:
            reset();
            setup_experiment(start_time: f64, stop_time: f64);
            enter_initialization_mode();
            exit_initialization_mode();
            do_step(time: f64, step: f64);
            terminate();
            get_real(references: &[u32], values: &mut [f64]);
            get_integer(references: &[u32], values: &mut [i32]);
            get_boolean(references: &[u32], values: &mut [i32]);
            set_real(references: &[u32], values: &[f64]);
            set_integer(references: &[u32], values: &[i32]);
            set_boolean(references: &[u32], values: &[i32]);
        }
    };
    ($inside:ty: $($method:ident($($argument:ident: $kind:ty),*);)*) => {$(
        fn $method(&mut self, $($argument: $kind),*) -> Result<(), Error> {
            <$inside>::$method(BorrowMut::<$inside>::borrow_mut(self), $($argument),*)
        }
    )*};
}

impl Participant for Slave {
    fn name(&self) -> &str {
        Self::name(self)
    }

    calls! { Slave }

    fn remark(&self) -> Option<String> {
        let (count, log) = (self.warnings(), self.log());
        if count > 0 {
            let last = log.last().map(|m| format!("; last: {m}")).unwrap_or_default();
            return Some(format!("{count} calls returned fmi2Warning{last}"));
        }
        log.into_iter().rfind(|message| message.status == Status::WARNING).map(|message| message.text)
    }
}

impl Participant for Box<dyn Participant> {
    fn name(&self) -> &str {
        self.as_ref().name()
    }

    calls! { dyn Participant }

    fn remark(&self) -> Option<String> {
        self.as_ref().remark()
    }
}
