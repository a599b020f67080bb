//! One instance of an FMU of FMI 2.0, behind a safe interface. No call allocates unless it fails, except the
//! first one that reads or writes integers.

use std::rc::Rc;

use punctual_fmu::fmi2::{self, CO_SIMULATION, FALSE, TRUE};

use super::handle::{CTexts, Handle, c_text, get_through, plain_calls, set_through};
use super::library::functions;
use super::number::{self, DataType, Truth};
use super::participant::{Participant, Slave, remark};
use super::{Description, Fmu, LogMessage, Version};
use crate::error::{Error, FmuProblem};

functions! {
    needed {
        get_types_platform: "fmi2GetTypesPlatform", fmi2::GetTypesPlatform;
        get_version: "fmi2GetVersion", fmi2::GetVersion;
        instantiate: "fmi2Instantiate", fmi2::Instantiate;
        free_instance: "fmi2FreeInstance", fmi2::FreeInstance;
        setup_experiment: "fmi2SetupExperiment", fmi2::SetupExperiment;
        enter_initialization_mode: "fmi2EnterInitializationMode", fmi2::EnterInitializationMode;
        exit_initialization_mode: "fmi2ExitInitializationMode", fmi2::ExitInitializationMode;
        terminate: "fmi2Terminate", fmi2::Terminate;
        reset: "fmi2Reset", fmi2::Reset;
        get_real: "fmi2GetReal", fmi2::GetReal;
        get_integer: "fmi2GetInteger", fmi2::GetInteger;
        get_boolean: "fmi2GetBoolean", fmi2::GetBoolean;
        set_real: "fmi2SetReal", fmi2::SetReal;
        set_integer: "fmi2SetInteger", fmi2::SetInteger;
        set_boolean: "fmi2SetBoolean", fmi2::SetBoolean;
        do_step: "fmi2DoStep", fmi2::DoStep;
    }
    other {
        get_string: "fmi2GetString", fmi2::GetString;
        set_string: "fmi2SetString", fmi2::SetString;
    }
}

/// An instance, freed on drop if the standard allows it.
pub(super) struct Instance {
    handle: Handle,
    functions: Functions,
    whole: Vec<i32>,
    truths: Vec<Truth<i32>>,
}

impl Instance {
    /// Makes an instance. `functions` must be those of the loaded library of `of`.
    pub(super) fn new(
        of: (Rc<Fmu>, Rc<Description>),
        functions: Functions,
        name: &str,
    ) -> Result<Self, Error> {
        let instance_name = c_text("instance name", name)?;
        let guid = c_text("guid", &of.1.token)?;
        let resources = c_text("resource location", &of.0.archive.resource_location())?;
        let handle = Handle::instantiate("fmi2Instantiate", of, name, |logging, is_logged| {
            // SAFETY: the texts live through the call; the callbacks live as long as the instance.
            unsafe {
                (functions.instantiate)(
                    instance_name.as_ptr(),
                    CO_SIMULATION,
                    guid.as_ptr(),
                    resources.as_ptr(),
                    logging.callbacks(),
                    FALSE,
                    if is_logged { TRUE } else { FALSE },
                )
            }
        })?;
        Ok(Self { handle, functions, whole: Vec::new(), truths: Vec::new() })
    }

    /// Checks that there are as many values as references, since the FMU receives only one count. Returns
    /// false if there is nothing to do.
    fn fits(&self, references: &[u32], values: usize) -> Result<bool, Error> {
        if references.len() != values {
            return Err(self.handle.lengths_differ(references.len(), values));
        }
        Ok(values > 0)
    }
}

impl Participant for Instance {
    fn name(&self) -> &str {
        self.handle.name()
    }

    fn reset(&mut self) -> Result<(), Error> {
        self.handle.time = None;
        self.handle.entering("fmi2Reset");
        // SAFETY: the instance lives.
        let status = unsafe { (self.functions.reset)(self.handle.component()) };
        self.handle.check("fmi2Reset", status)
    }

    fn setup_experiment(
        &mut self,
        start_time: f64,
        stop_time: f64,
        tolerance: Option<f64>,
    ) -> Result<(), Error> {
        self.handle.time = Some(start_time);
        self.handle.entering("fmi2SetupExperiment");
        let (call, component) = (self.functions.setup_experiment, self.handle.component());
        let (defined, tolerance) = tolerance.map_or((FALSE, 0.0), |tolerance| (TRUE, tolerance));
        // SAFETY: the instance lives; the arguments are plain numbers.
        let status = unsafe { call(component, defined, tolerance, start_time, TRUE, stop_time) };
        self.handle.check("fmi2SetupExperiment", status)
    }

    plain_calls! {
        enter_initialization_mode "fmi2EnterInitializationMode";
        exit_initialization_mode "fmi2ExitInitializationMode";
        terminate "fmi2Terminate";
    }

    /// `fmi2DoStep`, without the option of going back to before `time`. Discard and Pending are errors too.
    fn do_step(&mut self, time: f64, step: f64) -> Result<(), Error> {
        self.handle.time = Some(time);
        self.handle.entering("fmi2DoStep");
        let (call, component) = (self.functions.do_step, self.handle.component());
        // SAFETY: the instance lives; the arguments are plain numbers.
        let status = unsafe { call(component, time, step, TRUE) };
        self.handle.check_step("fmi2DoStep", status, time + step)
    }

    fn get(&mut self, of: DataType, references: &[u32], values: &mut [f64]) -> Result<(), Error> {
        if !self.fits(references, values.len())? {
            return Ok(());
        }
        match of {
            DataType::Float64 => {
                self.handle.entering("fmi2GetReal");
                let (call, component) = (self.functions.get_real, self.handle.component());
                let (first, count, data) = (references.as_ptr(), references.len(), values.as_mut_ptr());
                // SAFETY: the instance lives; `count` elements can be read or written from both addresses.
                let status = unsafe { call(component, first, count, data) };
                self.handle.check("fmi2GetReal", status)
            }
            DataType::Int32 | DataType::Enumeration => {
                get_through!(self.get_integer "fmi2GetInteger" of (whole) references values)
            }
            DataType::Boolean => {
                get_through!(self.get_boolean "fmi2GetBoolean" of (truths) references values)
            }
            _ => Err(self.handle.has_no(of, "read")),
        }
    }

    fn set(&mut self, of: DataType, references: &[u32], values: &[f64]) -> Result<(), Error> {
        if !self.fits(references, values.len())? {
            return Ok(());
        }
        match of {
            DataType::Float64 => {
                self.handle.entering("fmi2SetReal");
                let (call, component) = (self.functions.set_real, self.handle.component());
                let (first, count, data) = (references.as_ptr(), references.len(), values.as_ptr());
                // SAFETY: the instance lives; `count` elements can be read from both addresses.
                let status = unsafe { call(component, first, count, data) };
                self.handle.check("fmi2SetReal", status)
            }
            DataType::Int32 | DataType::Enumeration => {
                set_through!(self.set_integer "fmi2SetInteger" of (whole) references values)
            }
            DataType::Boolean => {
                set_through!(self.set_boolean "fmi2SetBoolean" of (truths) references values)
            }
            _ => Err(self.handle.has_no(of, "written")),
        }
    }

    fn set_text(&mut self, reference: u32, texts: &[String]) -> Result<(), Error> {
        let Some(call) = self.functions.set_string.filter(|_| texts.len() == 1) else {
            return Err(self.handle.has_no(DataType::String, "written"));
        };
        let texts = CTexts::new(self.handle.name(), texts)?;
        self.handle.entering("fmi2SetString");
        // SAFETY: the instance lives; one reference and one text can be read, which lives through the call.
        let status = unsafe { call(self.handle.component(), &raw const reference, 1, texts.first()) };
        self.handle.check("fmi2SetString", status)
    }

    fn remark(&self) -> Option<String> {
        remark(self.handle.warnings(), "fmi2Warning", self.handle.log())
    }
}

impl Slave for Instance {
    fn version(&self) -> Version {
        Version::Fmi2
    }

    fn warnings(&self) -> u64 {
        self.handle.warnings()
    }

    fn log(&self) -> Vec<LogMessage> {
        self.handle.log()
    }

    fn log_fault(&self) -> Option<String> {
        self.handle.log_fault()
    }

    fn get_text(&mut self, reference: u32, count: usize) -> Result<Option<Vec<Option<String>>>, Error> {
        let Some(call) = self.functions.get_string.filter(|_| count == 1) else { return Ok(None) };
        self.handle.entering("fmi2GetString");
        let mut text = std::ptr::null();
        // SAFETY: the instance lives; one reference can be read and one address written.
        let status = unsafe { call(self.handle.component(), &raw const reference, 1, &raw mut text) };
        self.handle.check("fmi2GetString", status)?;
        self.handle.texts("fmi2GetString", &[text]).map(Some)
    }
}

impl Drop for Instance {
    fn drop(&mut self) {
        if self.handle.may_be_freed() {
            self.handle.entering("fmi2FreeInstance");
            // SAFETY: the instance lives and is not used after this.
            unsafe { (self.functions.free_instance)(self.handle.component()) }
        }
    }
}
