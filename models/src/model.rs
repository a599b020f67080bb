//! Plants and barriers given by expressions, in the form that the filter and the simulation need.

use std::any::Any;
use std::collections::BTreeSet;
use std::sync::Arc;

use punctual_core::MAX_INPUTS;
use punctual_core::dynamics::DynPlant;
use punctual_core::lie::{DerivativeSource, RelativeDegree};
use punctual_core::scalar::Scalar;

use crate::functions::Functions;
use crate::motion::Equations;
use crate::operation::{Register, Step, needed};
use crate::recorded::{BarrierTape, PlantTape};
use crate::series::Series;
use crate::source::{self, Identity};
use crate::syntax::{self, TIME, Tree};
use crate::tape::{Record, Tape, Value, unknown};
use crate::{Error, MAX_STATES, affine, scale};

/// A plant `ẋ = f(x) + g(x) u` with one expression for each component.
///
/// Registers: states, inputs, time, then results.
#[derive(Clone, Debug)]
pub struct Model {
    states: Vec<String>,
    inputs: Vec<String>,
    parameters: Vec<(String, f64)>,
    tape: Tape,
    /// Registers of the derivatives of the states.
    derivatives: Vec<Register>,
    /// Which plant it is; its clones are the same one.
    identity: Identity,
}

impl Model {
    /// A model with the names of its states and inputs, its parameters with their values, and the expression
    /// for the derivative of each state, in their order.
    ///
    /// # Errors
    ///
    /// No state or more than [`MAX_STATES`], no input or more than [`MAX_INPUTS`]; different numbers of
    /// derivatives and states; a parameter that is not finite. A name that is no identifier, occurs twice or
    /// is reserved. In an expression: a syntax error, an unknown name, the time, a wrong number of arguments,
    /// an input that does not enter linearly.
    pub fn new(
        states: &[&str],
        inputs: &[&str],
        parameters: &[(&str, f64)],
        derivatives: &[&str],
    ) -> Result<Self, Error> {
        for (field, count, most) in
            [("states", states.len(), MAX_STATES), ("inputs", inputs.len(), MAX_INPUTS)]
        {
            if count == 0 || count > most {
                return Err(Error::new(field, format!("has {count} entries, must have 1 to {most}")));
            }
        }
        if derivatives.len() != states.len() {
            let message = format!("has {} entries, must have {}", derivatives.len(), states.len());
            return Err(Error::new("derivatives", message));
        }
        let parameter_names: Vec<_> = parameters.iter().map(|p| p.0).collect();
        let mut seen = BTreeSet::new();
        for (group, names) in [("states", states), ("inputs", inputs), ("parameters", &parameter_names)] {
            for (i, name) in names.iter().enumerate() {
                check_name(name, &mut seen).map_err(|e| Error::new(format!("{group}[{i}]"), e))?;
            }
        }
        if let Some((i, p)) = parameters.iter().enumerate().find(|(_, p)| !p.1.is_finite()) {
            return Err(Error::new(format!("parameters[{i}]"), format!("is {}, must be finite", p.1)));
        }
        let owned = |names: &[&str]| names.iter().map(|&name| name.to_owned()).collect();
        let mut model = Self {
            states: owned(states),
            inputs: owned(inputs),
            parameters: parameters.iter().map(|&(name, value)| (name.to_owned(), value)).collect(),
            tape: Tape::new(states.len() + inputs.len() + 1),
            derivatives: Vec::new(),
            identity: Arc::new(()),
        };
        for (state, text) in states.iter().zip(derivatives) {
            let register = model.derivative(text);
            let register = register.map_err(|e| Error::new(format!("derivatives.{state}"), e))?;
            model.derivatives.push(register);
        }
        Ok(model)
    }

    fn derivative(&mut self, text: &str) -> Result<Register, String> {
        let tree = syntax::parse(text)?;
        let register = self.compile(&tree, true, false)?;
        affine::check(&tree, &|name| self.inputs.iter().any(|input| input == name)).map_err(|found| {
            let part = &text[found.part.span.clone()];
            let input = found.input;
            format!("is {text:?}, in which {part:?} is not affine in the input {input}; inputs may only be added and multiplied by what is free of inputs")
        })?;
        Ok(register)
    }

    /// The same model, as another form of `plant`: barriers along both are along one plant. That both have the same dynamics is
    /// the caller's promise.
    #[must_use]
    pub fn as_form_of(mut self, plant: Arc<dyn Any + Send + Sync>) -> Self {
        self.identity = plant;
        self
    }

    /// Evaluates expressions of states, parameters and the time `t`. Each is given with a name for messages.
    ///
    /// # Errors
    ///
    /// For the expression of this name: a syntax error, an unknown name or an input, a wrong number of
    /// arguments.
    pub fn functions<C: Scalar>(&self, expressions: &[(&str, &str)]) -> Result<Functions<C>, Error> {
        let mut model = self.clone();
        let mut results = Vec::with_capacity(expressions.len());
        for (name, text) in expressions {
            let result = syntax::parse(text).and_then(|tree| model.compile(&tree, false, true));
            results.push(result.map_err(|e| Error::new(*name, e))?);
        }
        let Tape { steps, registers, .. } = &model.tape;
        Ok(Functions {
            steps: needed(steps, results.iter().copied(), *registers),
            results,
            states: self.states.len(),
            time: self.states.len() + self.inputs.len(),
            series: Series::new(*registers, 1),
        })
    }

    fn compile(&mut self, tree: &Tree, inputs: bool, time: bool) -> Result<Register, String> {
        let (states, first_input) = (&self.states, self.states.len());
        let resolve = |name: &str| {
            let position = |names: &[String]| names.iter().position(|n| n == name);
            let parameter = self.parameters.iter().find(|p| p.0 == name);
            match (position(states), position(&self.inputs)) {
                (Some(i), _) => Ok(Value::Register(i)),
                (_, Some(i)) if inputs => Ok(Value::Register(first_input + i)),
                (_, Some(_)) => Err(format!("names {name}, an input, which it does not depend on")),
                _ if parameter.is_some() => Ok(Value::Number(parameter.map_or(0.0, |p| p.1))),
                _ if time && name == TIME => Ok(Value::Register(first_input + self.inputs.len())),
                _ => {
                    let given = if inputs { &self.inputs[..] } else { &[] };
                    let names = states.iter().chain(given).chain(self.parameters.iter().map(|p| &p.0));
                    Err(unknown(name, &names.map(String::as_str).collect::<Vec<_>>(), time))
                }
            }
        };
        let value = self.tape.add(tree, &resolve)?;
        Ok(self.tape.register(value))
    }

    /// The plant, for simulation.
    pub fn plant(&self) -> Box<dyn DynPlant> {
        source::simulated(&self.equations(None))
    }

    /// The barrier `h(t, x)` given by an expression.
    ///
    /// # Errors
    ///
    /// In the expression: a syntax error, an unknown name or an input, a wrong number of arguments.
    pub fn barrier(&self, expression: &str) -> Result<Barrier, Error> {
        let mut model = self.clone();
        let tree = syntax::parse(expression);
        let h = tree.and_then(|tree| model.compile(&tree, false, true));
        Ok(Barrier { h: h.map_err(|e| Error::new("expression", e))?, model })
    }

    /// The scale of an expression of states within `ranges`, parameters and the time, in its unit: finite and ≥ 0. It is the
    /// magnitude of the constant term, as 5 of `5 - z`, or the largest value where that is less; 0 where there is no such term,
    /// or the largest value is not seen from the text. At every time some state has any value below the scale.
    ///
    /// # Errors
    ///
    /// A syntax error.
    pub fn scale(&self, expression: &str, ranges: &[[f64; 2]]) -> Result<f64, Error> {
        let tree = syntax::parse(expression).map_err(|e| Error::new("expression", e))?;
        let parameter = |name: &str| self.parameters.iter().find(|p| p.0 == name).map(|p| p.1);
        let state = |name: &str| ranges.get(self.states.iter().position(|n| n == name)?).copied();
        Ok(scale::of(&tree, &parameter, &state))
    }
}

fn check_name<'a>(name: &'a str, seen: &mut BTreeSet<&'a str>) -> Result<(), String> {
    if !syntax::is_identifier(name) {
        return Err(format!(
            "is {name:?}, must be letters, digits and underscores, not starting with a digit"
        ));
    }
    if syntax::is_reserved(name) {
        return Err(format!("is {name:?}, which means something else in expressions"));
    }
    if !seen.insert(name) {
        return Err(format!("is {name:?}, which is already the name of something else"));
    }
    Ok(())
}

/// A barrier along the motion of a [`Model`].
#[derive(Clone, Debug)]
pub struct Barrier {
    model: Model,
    h: Register,
}

impl Barrier {
    /// The relative degree, found at built-in samples of states within `ranges`.
    pub fn relative_degree(&self, ranges: &[[f64; 2]]) -> RelativeDegree {
        source::relative_degree(
            &self.model.equations(None),
            &self.model.equations(Some(self.h)),
            ranges,
            false,
        )
    }

    /// The relative degree with nonzero inputs. It also sees an input that only multiplies another one, as a
    /// turn rate multiplies a speed or a thrust.
    pub fn driven_degree(&self, ranges: &[[f64; 2]]) -> RelativeDegree {
        source::relative_degree(
            &self.model.equations(None),
            &self.model.equations(Some(self.h)),
            ranges,
            true,
        )
    }

    /// Its derivatives up to relative degree `n`, for a filter.
    ///
    /// # Errors
    ///
    /// `n` outside 1 to [`MAX_RELATIVE_DEGREE`](punctual_core::MAX_RELATIVE_DEGREE).
    pub fn source(&self, n: usize) -> Result<Box<dyn DerivativeSource>, Error> {
        let Self { model, h } = self;
        source::source(&model.equations(None), &model.equations(Some(*h)), n, &model.identity)
    }
}

impl Barrier {
    /// The tapes of the plant and of the barrier. That of the plant is the same for all barriers along one model.
    pub fn recorded(&self) -> (PlantTape, BarrierTape) {
        let Self { model, h } = self;
        let Tape { steps, registers, .. } = &model.tape;
        let (states, inputs) = (model.states.len(), model.inputs.len());
        let of_plant = needed(steps, model.derivatives.iter().copied(), *registers);
        let mut of_barrier = needed(steps, [*h], *registers);
        of_barrier.retain(|step| !of_plant.contains(step));
        // The registers that are left get the next numbers.
        let mut next = states + inputs + 1;
        let mut numbers: Vec<Register> = (0..*registers).collect();
        let mut renumbered = |steps: &[Step]| {
            let mut moved = Vec::new();
            for step in steps {
                let operation = step.operation.map(|read| numbers[read]);
                for result in 0..operation.results() {
                    numbers[step.to + result] = next + result;
                }
                moved.push(Step { operation, to: next });
                next += operation.results();
            }
            moved
        };
        let (of_plant, of_barrier) = (renumbered(&of_plant), renumbered(&of_barrier));
        let derivatives = model.derivatives.iter().map(|d| numbers[*d]).collect();
        let plant = PlantTape { states, inputs, steps: of_plant, derivatives };
        (plant, BarrierTape { steps: of_barrier, h: numbers[*h] })
    }
}

/// The tape of a model, evaluated order by order: every operation at one order before the next order.
#[derive(Clone)]
struct Listed {
    states: usize,
    inputs: usize,
    registers: usize,
    /// Operations needed at every order except the last.
    steps: Vec<Step>,
    derivatives: Vec<Register>,
    /// Operations needed at the last order, which only the barrier requires.
    last: Vec<Step>,
    h: Option<Register>,
}

impl Model {
    /// The tape of the model, with the operations of the barrier whose result is `h`.
    fn equations(&self, h: Option<Register>) -> Listed {
        let Tape { steps, registers, .. } = &self.tape;
        let wanted: Vec<_> = self.derivatives.iter().copied().chain(h).collect();
        Listed {
            states: self.states.len(),
            inputs: self.inputs.len(),
            registers: *registers,
            steps: needed(steps, wanted, *registers),
            derivatives: self.derivatives.clone(),
            last: needed(steps, h, *registers),
            h,
        }
    }
}

impl Equations for Listed {
    fn states(&self) -> usize {
        self.states
    }

    fn inputs(&self) -> usize {
        self.inputs
    }

    fn series<C: Scalar>(&self, orders: usize) -> Series<C> {
        Series::new(self.registers, orders)
    }

    fn advance<C: Scalar>(&mut self, series: &mut Series<C>, k: usize) {
        series.advance(&self.steps, k);
    }

    fn derivative(&self, i: usize) -> Register {
        self.derivatives[i]
    }

    fn finish<C: Scalar>(&mut self, series: &mut Series<C>, n: usize) -> Register {
        series.advance(&self.last, n);
        self.h.unwrap_or_default()
    }

    fn of_motion(&self) -> Self {
        let steps = needed(&self.steps, self.derivatives.iter().copied(), self.registers);
        Self { steps, last: Vec::new(), ..self.clone() }
    }

    fn of_value(&self) -> Self {
        Self { steps: self.last.clone(), ..self.clone() }
    }

    fn reads(&self, i: usize) -> bool {
        let read = |step: &Step| step.operation.reads().contains(&Some(i));
        self.h == Some(i) || self.last.iter().any(read)
    }

    fn of_barrier(&self) -> Self {
        let mut wanted: Vec<Register> = self.h.into_iter().collect();
        let mut moving = vec![false; self.states];
        loop {
            let steps = needed(&self.steps, wanted.iter().copied(), self.registers);
            let read = steps.iter().flat_map(|step| step.operation.reads()).flatten();
            let read: Vec<Register> =
                read.chain(wanted.iter().copied()).filter(|r| *r < self.states).collect();
            let count = wanted.len();
            for state in read {
                if !std::mem::replace(&mut moving[state], true) {
                    wanted.push(self.derivatives[state]);
                }
            }
            if wanted.len() == count {
                return Self { steps, ..self.clone() };
            }
        }
    }
}
