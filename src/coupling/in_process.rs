//! One of our own blocks as a participant, without an archive, a library or C. The state machine is the one that
//! the shared library runs, so the numbers are the same bit for bit.

use punctual_fmu::configuration::Configuration;
use punctual_fmu::instance::Instance;

use super::Participant;
use crate::error::Error;

/// An instance in this process.
pub struct InProcess {
    name: String,
    instance: Instance,
    /// What the user should know of the run.
    notice: Option<String>,
}

impl InProcess {
    /// An instance of `configuration`, whose GUID is `guid`.
    ///
    /// # Errors
    ///
    /// A GUID that is not the configuration's.
    pub fn new(name: &str, configuration: Configuration, guid: &str) -> Result<Self, Error> {
        let instance = Instance::new(configuration, guid).map_err(|e| Error::broken(name, e))?;
        Ok(Self { name: name.to_owned(), instance, notice: None })
    }

    /// The error of a refused call: the instance, the call and the time.
    #[cold]
    fn refused(&self, call: &str, reason: &str) -> Error {
        let time = crate::error::brief_time(self.instance.time());
        Error::broken(format!("{call} of {} at t = {time} s", self.name), format!("was refused: {reason}"))
    }
}

/// Passes calls on to the instance, which answers them under the same name.
macro_rules! calls {
    ($($method:ident($($argument:ident: $kind:ty),*) as $call:literal;)*) => {$(
        fn $method(&mut self, $($argument: $kind),*) -> Result<(), Error> {
            let done = self.instance.$method($($argument),*);
            done.map_err(|reason| self.refused($call, &reason))
        }
    )*};
}

impl Participant for InProcess {
    fn name(&self) -> &str {
        &self.name
    }

    fn reset(&mut self) -> Result<(), Error> {
        self.instance.reset();
        self.notice = None;
        Ok(())
    }

    fn setup_experiment(&mut self, start_time: f64, stop_time: f64) -> Result<(), Error> {
        let done = self.instance.setup_experiment(start_time, Some(stop_time));
        done.map_err(|reason| self.refused("fmi2SetupExperiment", &reason))
    }

    calls! {
        enter_initialization_mode() as "fmi2EnterInitializationMode";
        exit_initialization_mode() as "fmi2ExitInitializationMode";
        terminate() as "fmi2Terminate";
        get_real(references: &[u32], values: &mut [f64]) as "fmi2GetReal";
        get_integer(references: &[u32], values: &mut [i32]) as "fmi2GetInteger";
        get_boolean(references: &[u32], values: &mut [i32]) as "fmi2GetBoolean";
        set_real(references: &[u32], values: &[f64]) as "fmi2SetReal";
        set_integer(references: &[u32], values: &[i32]) as "fmi2SetInteger";
        set_boolean(references: &[u32], values: &[i32]) as "fmi2SetBoolean";
    }

    fn do_step(&mut self, time: f64, step: f64) -> Result<(), Error> {
        self.instance.do_step(time, step).map_err(|reason| self.refused("fmi2DoStep", &reason))?;
        if let Some(notice) = self.instance.notice() {
            self.notice = Some(notice);
        }
        Ok(())
    }

    fn remark(&self) -> Option<String> {
        self.notice.clone()
    }
}
