//! A plant, which integrates its state under held inputs.

use punctual_core::dynamics::DynPlant;
use punctual_models::Functions;

use super::deviation::Deviating;
use super::disturbance::Disturbance;
use super::{Block, BlockState, Values, in_words};
use crate::configuration::{ConfigurationError, Parameter, PlantConfiguration, PlantSection, updated};
use crate::product::Layout;

/// The most Runge–Kutta steps in one communication step. A larger number is a mistake in the step sizes, and
/// would look like a hang.
const MOST_SUBSTEPS: f64 = 1e8;

pub(super) struct PlantBlock {
    configuration: PlantConfiguration,
    parameters: Vec<Parameter<PlantConfiguration>>,
    layout: Layout,
    plant: Box<dyn DynPlant>,
    /// Further outputs besides the states, if any.
    outputs: Option<Functions<f64>>,
    disturbance: Disturbance,
    /// How it deviates from the model, if it does.
    deviating: Option<Deviating>,
    /// Index of the disturbance's seed among the parameters, since it may change during a run.
    seed: Option<usize>,
    x: Vec<f64>,
    /// Buffer: the state after the current step.
    next: Vec<f64>,
    /// Buffer: the inputs with their disturbance.
    u: Vec<f64>,
    /// Buffer: what acts of the inputs of a plant that deviates.
    acting: Vec<f64>,
}

impl PlantBlock {
    pub(super) fn new(configuration: PlantConfiguration, layout: Layout) -> Result<Self, ConfigurationError> {
        let (parameters, plant) = (configuration.parameters(), configuration.build()?);
        let outputs = configuration.outputs()?;
        let (x, u) = (vec![0.0; layout.states], vec![0.0; layout.inputs]);
        let disturbance = Disturbance::new(&configuration);
        let deviating = configuration.deviation.as_deref().map(Deviating::new).transpose()?;
        let seed = parameters.iter().position(|parameter| parameter.tunable);
        Ok(Self {
            next: x.clone(),
            x,
            acting: u.clone(),
            u,
            configuration,
            parameters,
            layout,
            plant,
            outputs,
            disturbance,
            deviating,
            seed,
        })
    }

    fn seed(&self, values: &Values) -> f64 {
        self.seed.map_or(0.0, |place| values.reals[self.layout.parameters + place])
    }

    /// The reason for refusing a step from `t` (s) under the inputs `u`, one of which is not finite.
    #[cold]
    fn refused_input(&self, u: &[f64], t: f64) -> String {
        let i = not_finite(u);
        let name = self.configuration.plant.input_name(i);
        format!("u.{name} is {}, must be finite for a step from t = {t}", u[i])
    }

    /// The reason for refusing a step of `h` s, which would take this many inner steps.
    #[cold]
    fn too_many(&self, substeps: f64, h: f64) -> String {
        let inner = self.configuration.integration.inner_step;
        format!(
            "the step of {h} s needs {substeps} inner steps of {inner} s, must be at most {MOST_SUBSTEPS}"
        )
    }

    /// The reason why the step from `t` by `h` (s) fails, after which a state is not finite.
    #[cold]
    fn lost_state(&self, t: f64, h: f64) -> String {
        let i = not_finite(&self.next);
        let name = self.configuration.plant.state_name(i);
        let place = match &self.configuration.plant {
            PlantSection::Expressions(own) => own.derivatives.get(name),
            _ => None,
        };
        let from = place.map_or_else(String::new, |e| format!("; its derivative is {e:?}"));
        format!("x.{name} becomes {} in the step from t = {t} by {h} s{from}", self.next[i])
    }

    /// The first output that is not finite at time `t` (s) in the next state.
    #[inline]
    fn not_finite_output(&mut self, t: f64) -> Option<(usize, f64)> {
        let at = |outputs: &mut Functions<f64>| {
            outputs.at(t, |i| self.next[i]).enumerate().find(|(_, value)| !value.is_finite())
        };
        self.outputs.as_mut().and_then(at)
    }

    /// The reason why the step fails, after which the output `i` is not finite.
    #[cold]
    fn lost_output(&self, i: usize, value: f64, t: f64, h: f64) -> String {
        let output = &self.configuration.output[i];
        format!(
            "y.{} becomes {value} in the step from t = {t} by {h} s; it is {:?}",
            output.name, output.expression
        )
    }
}

/// The index of the first of `numbers` that is not finite; there must be one.
fn not_finite(numbers: &[f64]) -> usize {
    numbers.iter().position(|v| !v.is_finite()).unwrap_or(0)
}

impl Block for PlantBlock {
    fn configure(&mut self, values: &Values) -> Result<(), ConfigurationError> {
        let numbers = &values.reals[self.layout.parameters..self.layout.end];
        let configuration = updated(&self.configuration, &self.parameters, numbers)?;
        self.plant = configuration.build()?;
        self.outputs = configuration.outputs()?;
        self.disturbance = Disturbance::new(&configuration);
        self.deviating = configuration.deviation.as_deref().map(Deviating::new).transpose()?;
        self.configuration = configuration;
        // The first parameters are the initial state.
        self.x.copy_from_slice(&numbers[..self.layout.states]);
        if let Some(deviating) = &mut self.deviating {
            deviating.begin(self.configuration.experiment.start_time, &self.x);
        }
        Ok(())
    }

    fn output(&mut self, t: f64, values: &mut Values) {
        let seed = self.seed(values);
        let reported = &mut values.reals[self.layout.outputs..self.layout.parameters];
        let (measured, others) = reported.split_at_mut(self.layout.states);
        measured.copy_from_slice(&self.x);
        if self.disturbance.affects_measurements() {
            self.disturbance.add_noise(seed, t, measured);
        }
        if let Some(deviating) = &self.deviating {
            deviating.err(t, measured);
            let (_, least) = others.split_at_mut(others.len() - deviating.least().len());
            least.copy_from_slice(deviating.least());
        }
        if let Some(outputs) = &mut self.outputs {
            others.iter_mut().zip(outputs.at(t, |i| self.x[i])).for_each(|(to, value)| *to = value);
        }
    }

    /// Without a step, the state does not depend on the inputs.
    fn differentiate(
        &mut self,
        _t: f64,
        _values: &Values,
        _direction: &[f64],
        _derivative: &mut [f64],
    ) -> Result<(), String> {
        Ok(())
    }

    fn step(&mut self, t: f64, h: f64, values: &mut Values) -> Result<(), String> {
        let u = &values.reals[..self.layout.inputs];
        if !u.iter().all(|v| v.is_finite()) {
            return Err(self.refused_input(u, t));
        }
        let substeps = self.configuration.integration.substeps(h);
        if substeps > MOST_SUBSTEPS {
            return Err(self.too_many(substeps, h));
        }
        self.next.copy_from_slice(&self.x);
        let (inner, mut k) = (h / substeps, 0.0);
        if let Some(deviating) = &mut self.deviating {
            deviating.begin_step(t, &self.next);
        }
        while k < substeps {
            let held = if self.disturbance.affects_inputs() {
                self.u.copy_from_slice(u);
                self.disturbance.disturb(self.seed(values), t + k * inner, &mut self.u);
                &self.u
            } else {
                u
            };
            match &mut self.deviating {
                None => self.plant.rk4_step(&mut self.next, held, inner).map_err(|e| in_words(&e))?,
                Some(deviating) => {
                    let time = (t + k * inner, inner);
                    let advance = |x: &mut [f64], u: &[f64]| self.plant.rk4_step(x, u, inner);
                    let moved = deviating.advance(time, u, &mut self.next, &mut self.acting, advance);
                    moved.map_err(|e| in_words(&e))?;
                }
            }
            k += 1.0;
        }
        if !self.next.iter().all(|v| v.is_finite()) {
            return Err(self.lost_state(t, h));
        }
        if let Some((i, value)) = self.not_finite_output(t + h) {
            return Err(self.lost_output(i, value, t, h));
        }
        std::mem::swap(&mut self.x, &mut self.next);
        if let Some(deviating) = &mut self.deviating {
            deviating.end_step(&values.reals[..self.layout.inputs]);
        }
        self.output(t + h, values);
        Ok(())
    }

    fn save(&self, state: &mut BlockState) {
        // Without `..`, so that a new field does not compile until it is decided whether it belongs to the
        // state. A disturbance does not, since it is a function of time.
        let Self {
            x: now,
            configuration: _,
            parameters: _,
            layout: _,
            plant: _,
            outputs: _,
            disturbance: _,
            deviating,
            seed: _,
            next: _,
            u: _,
            acting: _,
        } = self;
        match state {
            BlockState::Plant { x } => x.clone_from(now),
            _ => *state = BlockState::Plant { x: now.clone() },
        }
        if let (BlockState::Plant { x }, Some(deviating)) = (state, deviating) {
            x.extend_from_slice(deviating.memory());
        }
    }

    fn restore(&mut self, state: &BlockState) -> Result<(), String> {
        let BlockState::Plant { x } = state else {
            return Err(state.mismatch("plant"));
        };
        let states = self.x.len();
        let length = states + self.deviating.as_ref().map_or(0, |deviating| deviating.memory().len());
        if x.len() != length {
            return Err(format!("the state has {} components, must have {length}", x.len()));
        }
        self.x.copy_from_slice(&x[..states]);
        if let Some(deviating) = &mut self.deviating {
            deviating.restore(&x[states..]);
        }
        Ok(())
    }

    fn direct_feedthrough(&self) -> bool {
        false
    }

    fn accepts_gaps(&self) -> bool {
        false
    }

    fn show_refusal(&self, _values: &mut Values) {
        // No value in the state of a plant shows a refusal. The next step is refused too, because the time
        // does not advance.
    }
}
