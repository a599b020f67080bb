//! A nominal controller: maps the state to the wanted input. Only waypoints have a memory: the current one.

use punctual_core::elementary;
use punctual_core::jet::Tangent;
use punctual_core::scalar::Scalar;
use punctual_models::Functions;
use punctual_reference::nominal::{Heading, damping};

use super::{Block, BlockState, Values};
use crate::configuration::{
    ConfigurationError, Controller, ControllerConfiguration, ModelName, Parameter, ReferenceSection, updated,
};
use crate::product::Layout;

/// Number of inputs of every vehicle.
const INPUTS: usize = 2;

/// Expressions for the inputs, and for their derivatives.
struct Expressions {
    functions: Functions<f64>,
    tangents: Functions<Tangent<f64>>,
}

impl Expressions {
    fn of(configuration: &ControllerConfiguration) -> Result<Option<Self>, ConfigurationError> {
        Ok(match (configuration.functions()?, configuration.functions()?) {
            (Some(functions), Some(tangents)) => Some(Self { functions, tangents }),
            _ => None,
        })
    }
}

pub(super) struct ControllerBlock {
    configuration: ControllerConfiguration,
    parameters: Vec<Parameter<ControllerConfiguration>>,
    layout: Layout,
    expressions: Option<Expressions>,
    /// The current point of `waypoints`, counted from 0, which is the whole memory of the block.
    waypoint: usize,
}

impl ControllerBlock {
    pub(super) fn new(
        configuration: ControllerConfiguration,
        layout: Layout,
    ) -> Result<Self, ConfigurationError> {
        let expressions = Expressions::of(&configuration)?;
        Ok(Self { parameters: configuration.parameters(), configuration, layout, expressions, waypoint: 0 })
    }

    /// The current point at the position of `x`: points that are reached are passed, except the last.
    fn present(&self, x: &[f64]) -> usize {
        let mut present = self.waypoint;
        if let Controller::Waypoints { points, acceptance_radius, .. } = &self.configuration.controller {
            while present + 1 < points.len()
                && elementary::hypot(points[present][0] - x[0], points[present][1] - x[1])
                    <= *acceptance_radius
            {
                present += 1;
            }
        }
        present
    }

    /// The wanted input for the inputs `x`: the state, followed by the goal if that is an input. An input
    /// that is not finite gives NaN, which a filter or plant refuses by name. The limits alone would turn it
    /// into a number.
    fn wanted<S: Scalar>(&self, x: impl Fn(usize) -> S, waypoint: usize) -> [S; INPUTS] {
        let c = &self.configuration;
        if (0..self.layout.states).any(|i| !x(i).value().is_finite()) {
            return [S::from(f64::NAN); INPUTS];
        }
        let states = c.plant.states().len();
        let (goal, drive) = match &c.controller {
            Controller::Damping { gain } => {
                let mut u = [S::zero(); INPUTS];
                for &(state, input) in c.damped() {
                    u[input] = damping(x(state), *gain);
                }
                return u;
            }
            Controller::Heading { drive, goal_input: true } => ([x(states), x(states + 1)], drive),
            Controller::Heading { drive, goal_input: false } => (drive.goal.map(S::from), drive),
            Controller::Waypoints { points, drive, .. } => (points[waypoint].map(S::from), drive),
            // Expressions are evaluated elsewhere.
            Controller::Expressions { .. } => return [S::from(f64::NAN); INPUTS],
        };
        // The state relative to the goal.
        let heading = Heading { goal: [0.0; 2], ..*drive };
        let x = &[x(0) - goal[0], x(1) - goal[1], x(2), x(3)];
        match (c.plant.model(), c.plant.reference().and_then(ReferenceSection::l_r)) {
            (Some(ModelName::PointMass), _) => heading.point_mass(x),
            (_, None) => heading.unicycle(x),
            (_, Some(l_r)) => heading.bicycle(x, l_r),
        }
    }

    fn write(&self, values: &mut Values, waypoint: usize, u: [f64; INPUTS]) {
        let at = self.layout.outputs;
        values.reals[at..][..INPUTS].copy_from_slice(&u);
        if let Controller::Waypoints { .. } = self.configuration.controller {
            values.integers[at + INPUTS] = i32::try_from(waypoint + 1).unwrap_or(i32::MAX);
        }
    }

    /// Computes one sample at time `t`; returns the index of its waypoint.
    fn sample(&mut self, t: f64, values: &mut Values) -> usize {
        let (inputs, outputs) = values.reals.split_at_mut(self.layout.outputs);
        if let Some(Expressions { functions, .. }) = &mut self.expressions {
            for (u, value) in outputs.iter_mut().zip(functions.at(t, |i| inputs[i])) {
                *u = value;
            }
            return 0;
        }
        let x = &values.reals[..self.layout.states];
        let waypoint = self.present(x);
        let u = self.wanted(|i| x[i], waypoint);
        self.write(values, waypoint, u);
        waypoint
    }
}

impl Block for ControllerBlock {
    fn configure(&mut self, values: &Values) -> Result<(), ConfigurationError> {
        let numbers = &values.reals[self.layout.parameters..self.layout.end];
        let configuration = updated(&self.configuration, &self.parameters, numbers)?;
        self.expressions = Expressions::of(&configuration)?;
        self.configuration = configuration;
        self.waypoint = 0;
        Ok(())
    }

    fn output(&mut self, t: f64, values: &mut Values) {
        self.sample(t, values);
    }

    fn differentiate(
        &mut self,
        t: f64,
        values: &Values,
        direction: &[f64],
        derivative: &mut [f64],
    ) -> Result<(), String> {
        let x = &values.reals[..self.layout.states];
        let moving = |i: usize| Tangent { value: x[i], directional: direction[i] };
        let slots = derivative[self.layout.outputs..].iter_mut();
        // An input without a value has no derivative either.
        let known = |u: Tangent<f64>| if u.value.is_finite() { u.directional } else { u.value };
        match &mut self.expressions {
            Some(Expressions { tangents, .. }) => {
                slots.zip(tangents.at(t, moving)).for_each(|(slot, u)| *slot = known(u));
            }
            None => {
                let wanted = self.wanted(moving, self.present(x));
                slots.zip(wanted).for_each(|(slot, u)| *slot = known(u));
            }
        }
        Ok(())
    }

    fn step(&mut self, t: f64, _h: f64, values: &mut Values) -> Result<(), String> {
        self.waypoint = self.sample(t, values);
        Ok(())
    }

    fn save(&self, state: &mut BlockState) {
        // Without `..`, so that a new field does not compile until it is decided whether it belongs to the
        // state.
        let Self { waypoint, configuration: _, parameters: _, layout: _, expressions: _ } = self;
        *state = BlockState::Controller { waypoint: u32::try_from(*waypoint).unwrap_or(u32::MAX) };
    }

    fn restore(&mut self, state: &BlockState) -> Result<(), String> {
        let BlockState::Controller { waypoint } = state else {
            return Err(state.mismatch("controller"));
        };
        self.waypoint = *waypoint as usize;
        Ok(())
    }

    fn direct_feedthrough(&self) -> bool {
        self.configuration.direct_feedthrough
    }

    fn accepts_gaps(&self) -> bool {
        true
    }

    fn show_refusal(&self, values: &mut Values) {
        if self.expressions.is_some() {
            values.reals[self.layout.outputs..self.layout.parameters].fill(f64::NAN);
        } else {
            self.write(values, self.waypoint, [f64::NAN; INPUTS]);
        }
    }
}

#[cfg(test)]
mod tests;
