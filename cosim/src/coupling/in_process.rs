//! Runs one of this program's blocks as a participant, without an archive, a library or C. The state machine
//! is the one that the shared library runs, so the numbers are the same bit for bit.

use punctual_fmu::configuration::Configuration;
use punctual_fmu::instance::{Instance, Place};
use punctual_modeldescription::BaseType;

use super::Participant;
use crate::error::Error;
use crate::host::{Causality, DataType};

/// An instance in this process.
pub struct InProcess {
    name: String,
    instance: Instance,
    /// A note to the user on the run.
    notice: Option<String>,
    /// Buffer for integers and Booleans.
    whole: Vec<i32>,
}

impl InProcess {
    /// An instance of `configuration`, whose GUID is `guid`.
    ///
    /// # Errors
    ///
    /// A GUID that is not the configuration's.
    pub fn new(name: &str, configuration: Configuration, guid: &str) -> Result<Self, Error> {
        let instance = Instance::new(configuration, guid).map_err(|e| Error::broken(name, e))?;
        let notice = instance.warning();
        Ok(Self { name: name.to_owned(), instance, notice, whole: Vec::new() })
    }

    /// The error for a refused call, with the instance, the call and the time.
    #[cold]
    fn refused(&self, call: &str, reason: &str) -> Error {
        let time = crate::error::brief_time(self.instance.time());
        Error::broken(format!("{call} of {} at t = {time} s", self.name), format!("was refused: {reason}"))
    }

    /// The error for a refused call on `places`. It names the call for the type of the first place: real,
    /// integer or boolean.
    #[cold]
    fn refused_at(&self, places: &[Place], [real, integer, boolean]: [&str; 3], reason: &str) -> Error {
        let call = match places.first() {
            Some(Place::Boolean(_)) => boolean,
            Some(Place::Integer(_)) => integer,
            _ => real,
        };
        self.refused(call, reason)
    }
}

/// Passes calls on to the instance's methods of the same name.
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
        self.notice = self.instance.warning();
        Ok(())
    }

    /// A block has no solver, so the tolerance is ignored.
    fn setup_experiment(
        &mut self,
        start_time: f64,
        stop_time: f64,
        _tolerance: Option<f64>,
    ) -> Result<(), Error> {
        let done = self.instance.setup_experiment(start_time, Some(stop_time));
        done.map_err(|reason| self.refused("fmi2SetupExperiment", &reason))
    }

    calls! {
        enter_initialization_mode() as "fmi2EnterInitializationMode";
        exit_initialization_mode() as "fmi2ExitInitializationMode";
        terminate() as "fmi2Terminate";
    }

    fn get(&mut self, of: DataType, references: &[u32], values: &mut [f64]) -> Result<(), Error> {
        if of == DataType::Float64 {
            let done = self.instance.get_real(references, values);
            return done.map_err(|reason| self.refused("fmi2GetReal", &reason));
        }
        if self.whole.len() < values.len() {
            self.whole.resize(values.len(), 0);
        }
        let whole = &mut self.whole[..values.len()];
        let (call, done) = match of {
            DataType::Boolean => ("fmi2GetBoolean", self.instance.get_boolean(references, whole)),
            _ => ("fmi2GetInteger", self.instance.get_integer(references, whole)),
        };
        done.map_err(|reason| self.refused(call, &reason))?;
        for (value, number) in values.iter_mut().zip(&self.whole) {
            *value = f64::from(*number);
        }
        Ok(())
    }

    fn set(&mut self, of: DataType, references: &[u32], values: &[f64]) -> Result<(), Error> {
        if of == DataType::Float64 {
            let done = self.instance.set_real(references, values);
            return done.map_err(|reason| self.refused("fmi2SetReal", &reason));
        }
        self.whole.clear();
        // A number beyond 32 bits is clamped to one that the variable refuses.
        self.whole.extend(values.iter().map(|value| *value as i32));
        let (call, done) = match of {
            DataType::Boolean => ("fmi2SetBoolean", self.instance.set_boolean(references, &self.whole)),
            _ => ("fmi2SetInteger", self.instance.set_integer(references, &self.whole)),
        };
        done.map_err(|reason| self.refused(call, &reason))
    }

    fn place(&self, causality: Causality, of: DataType, reference: u32) -> Option<Place> {
        let base = match of {
            DataType::Float64 => BaseType::Real,
            DataType::Boolean => BaseType::Boolean,
            _ => BaseType::Integer,
        };
        self.instance.place(causality, base, reference)
    }

    fn read(&mut self, places: &[Place], values: &mut [f64]) -> Result<(), Error> {
        let done = self.instance.read(places, values);
        done.map_err(|reason| {
            self.refused_at(places, ["fmi2GetReal", "fmi2GetInteger", "fmi2GetBoolean"], &reason)
        })
    }

    fn write(&mut self, places: &[Place], values: &[f64]) -> Result<(), Error> {
        let done = self.instance.write(places, values);
        done.map_err(|reason| {
            self.refused_at(places, ["fmi2SetReal", "fmi2SetInteger", "fmi2SetBoolean"], &reason)
        })
    }

    fn set_text(&mut self, _reference: u32, _texts: &[String]) -> Result<(), Error> {
        Err(self.refused("fmi2SetString", "there is no text among the variables"))
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
