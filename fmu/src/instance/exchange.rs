//! Model exchange: an importer sets time and continuous states, and reads their rates. There are no events of a
//! plant's own, so a visit to event mode changes nothing.

use super::{Call, Failure, Instance, Interface, Mode};
use crate::configuration::FmiVersion;

impl Instance {
    /// Checks that `call` is one of model exchange, and legal now.
    fn check_exchange(&self, call: Call) -> Result<(), Failure> {
        match self.interface {
            Interface::CoSimulation => Err("not supported: the instance is one of co-simulation".to_owned()),
            Interface::ModelExchange => self.check(call),
        }
    }

    /// Goes to event mode.
    ///
    /// # Errors
    ///
    /// The wrong mode, or an instance of co-simulation, which has no events; so of every function here.
    pub fn enter_event_mode(&mut self) -> Result<(), Failure> {
        if (self.interface, self.fmi()) == (Interface::CoSimulation, FmiVersion::Three) {
            return Err("not supported: hasEventMode is false".to_owned());
        }
        self.check_exchange(Call::EnterEventMode)?;
        self.mode = Mode::EVENT;
        Ok(())
    }

    /// Ends an event: nothing changes, and none is known to come.
    ///
    /// # Errors
    ///
    /// As above.
    pub fn update_discrete_states(&self) -> Result<(), Failure> {
        self.check_exchange(Call::UpdateDiscreteStates)
    }

    /// Goes to continuous-time mode.
    ///
    /// # Errors
    ///
    /// As above.
    pub fn enter_continuous_time_mode(&mut self) -> Result<(), Failure> {
        self.check_exchange(Call::EnterContinuousTimeMode)?;
        self.mode = Mode::CONTINUOUS;
        Ok(())
    }

    /// Takes over the time in s, which may also go back: nothing is remembered.
    ///
    /// # Errors
    ///
    /// As above; a time that is not finite.
    pub fn set_time(&mut self, time: f64) -> Result<(), Failure> {
        self.check_exchange(Call::SetTime)?;
        if !time.is_finite() {
            return Err(format!("time is {time}, must be finite"));
        }
        self.time = time;
        self.fresh = false;
        Ok(())
    }

    /// Whether an integrator's step may be completed here: always, since nothing depends on it.
    ///
    /// # Errors
    ///
    /// As above.
    pub fn completed_integrator_step(&self) -> Result<(), Failure> {
        self.check_exchange(Call::Integrate)
    }

    /// The number of continuous states.
    ///
    /// # Errors
    ///
    /// An instance of co-simulation.
    pub fn number_of_states(&self) -> Result<usize, Failure> {
        self.check_exchange(Call::Get)?;
        Ok(self.block.states().len())
    }

    /// The number of event indicators: 0.
    ///
    /// # Errors
    ///
    /// An instance of co-simulation.
    pub fn number_of_event_indicators(&self) -> Result<usize, Failure> {
        self.check_exchange(Call::Get).map(|()| 0)
    }

    /// Takes over the continuous states. The inner error: one is not finite, and the integrator may try others.
    ///
    /// # Errors
    ///
    /// As above; another number of states.
    pub fn set_continuous_states(&mut self, x: &[f64]) -> Result<Result<(), Failure>, Failure> {
        self.check_exchange(Call::Integrate)?;
        self.check_number(x.len())?;
        if let Some(i) = x.iter().position(|v| !v.is_finite()) {
            return Ok(Err(format!("{} is {}, must be finite", self.state_name(i), x[i])));
        }
        self.block.set_states(x);
        self.fresh = false;
        Ok(Ok(()))
    }

    /// Reads the continuous states.
    ///
    /// # Errors
    ///
    /// As above; another number of states.
    pub fn continuous_states(&mut self, out: &mut [f64]) -> Result<(), Failure> {
        self.check_exchange(Call::GetContinuousStates)?;
        self.check_number(out.len())?;
        self.refresh();
        out.copy_from_slice(self.block.states());
        Ok(())
    }

    /// Reads the rates of the continuous states, in the unit of each per second. The inner error: one is not finite.
    ///
    /// # Errors
    ///
    /// As above; another number of states.
    pub fn continuous_state_derivatives(&mut self, out: &mut [f64]) -> Result<Result<(), Failure>, Failure> {
        self.check_exchange(Call::GetContinuousStates)?;
        self.check_number(out.len())?;
        self.refresh();
        let rates = self.rates();
        if let Some(i) = rates.iter().position(|rate| !rate.value.is_finite()) {
            let value = rates[i].value;
            return Ok(Err(format!("the rate of {} is {value}, must be finite", self.state_name(i))));
        }
        rates.iter().zip(out).for_each(|(rate, o)| *o = rate.value);
        Ok(Ok(()))
    }

    /// Reads the sizes that the continuous states are expected to have: 1, since nothing is known.
    ///
    /// # Errors
    ///
    /// As above; another number of states.
    pub fn nominals(&self, out: &mut [f64]) -> Result<(), Failure> {
        self.check_exchange(Call::Get)?;
        self.check_number(out.len())?;
        out.fill(1.0);
        Ok(())
    }

    /// Reads event indicators, of which there are none.
    ///
    /// # Errors
    ///
    /// As above; any number of them.
    pub fn event_indicators(&self, count: usize) -> Result<(), Failure> {
        self.check_exchange(Call::GetContinuousStates)?;
        if count > 0 {
            let name = self.named("ni", "nEventIndicators");
            return Err(format!("{name} is {count}, must be 0: there are none"));
        }
        Ok(())
    }

    fn check_number(&self, found: usize) -> Result<(), Failure> {
        let wanted = self.block.states().len();
        if found == wanted {
            return Ok(());
        }
        Err(format!("{} is {found}, must be {wanted}", self.named("nx", "nContinuousStates")))
    }

    /// The name of an argument, which each version of FMI calls its own way.
    fn named(&self, two: &'static str, three: &'static str) -> &'static str {
        match self.fmi() {
            FmiVersion::Two => two,
            FmiVersion::Three => three,
        }
    }

    fn state_name(&self, i: usize) -> &str {
        &self.product.variables[self.product.layout.outputs + i].name
    }
}
