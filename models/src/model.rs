//! Plants and barriers of expressions, as the filter and the simulation take them.

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::ops::Range;

use punctual_core::dynamics::DynPlant;
use punctual_core::jet::{Dual, Tangent};
use punctual_core::lie::{
    self, Ahead, Coefficients, DerivativeSource, Derivatives, RelativeDegree, SUBSTEPS,
};
use punctual_core::scalar::Scalar;
use punctual_core::{MAX_INPUTS, MAX_RELATIVE_DEGREE};

use crate::affine;
use crate::programme::{Programme, Register, Step, Value, needed, unknown};
use crate::series::Series;
use crate::syntax::{self, TIME, Tree};
use crate::{Error, MAX_STATES};

/// A plant `ẋ = f(x) + g(x) u` given by an expression for each component.
///
/// Registers: states, inputs, time, then results.
#[derive(Clone, Debug)]
pub struct Model {
    states: Vec<String>,
    inputs: Vec<String>,
    parameters: Vec<(String, f64)>,
    programme: Programme,
    /// Where the derivative of each state is.
    derivatives: Vec<Register>,
}

impl Model {
    /// A model with the names of its states and inputs, its parameters with their values, and the expression for
    /// the derivative of each state, in their order.
    ///
    /// # Errors
    ///
    /// No state or more than [`MAX_STATES`], no input or more than [`MAX_INPUTS`], a name that is no identifier,
    /// stands twice or means something else; another number of derivatives than of states; a parameter that is
    /// not finite; in an expression: what cannot be read, an unknown name, time, a wrong number of arguments, an
    /// input that does not enter linearly.
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
            programme: Programme::new(states.len() + inputs.len() + 1),
            derivatives: Vec::new(),
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

    fn compile(&mut self, tree: &Tree, inputs: bool, time: bool) -> Result<Register, String> {
        let (states, first_input) = (&self.states, self.states.len());
        let resolve = |name: &str| {
            let position = |names: &[String]| names.iter().position(|n| n == name);
            let parameter = self.parameters.iter().find(|p| p.0 == name);
            match (position(states), position(&self.inputs)) {
                (Some(i), _) => Ok(Value::Register(i)),
                (_, Some(i)) if inputs => Ok(Value::Register(first_input + i)),
                (_, Some(_)) => Err(format!("names {name}, an input, which a barrier does not depend on")),
                _ if parameter.is_some() => Ok(Value::Number(parameter.map_or(0.0, |p| p.1))),
                _ if time && name == TIME => Ok(Value::Register(first_input + self.inputs.len())),
                _ => {
                    let given = if inputs { &self.inputs[..] } else { &[] };
                    let names = states.iter().chain(given).chain(self.parameters.iter().map(|p| &p.0));
                    Err(unknown(name, &names.map(String::as_str).collect::<Vec<_>>(), time))
                }
            }
        };
        let value = self.programme.add(tree, &resolve)?;
        Ok(self.programme.register(value))
    }

    /// The plant, to simulate.
    pub fn plant(&self) -> Box<dyn DynPlant> {
        let flow = Flow::new(self);
        Box::new(Simulated { work: RefCell::new(flow), inputs: self.inputs.len() })
    }

    /// The barrier `h(t, x)` given by an expression.
    ///
    /// # Errors
    ///
    /// In the expression: what cannot be read, an unknown name or an input, a wrong number of arguments.
    pub fn barrier(&self, expression: &str) -> Result<Barrier, Error> {
        let mut model = self.clone();
        let tree = syntax::parse(expression);
        let h = tree.and_then(|tree| model.compile(&tree, false, true));
        Ok(Barrier { h: h.map_err(|e| Error::new("expression", e))?, model })
    }
}

fn check_name<'a>(name: &'a str, seen: &mut BTreeSet<&'a str>) -> Result<(), String> {
    let mut chars = name.chars();
    let head = chars.next().is_some_and(|c| c.is_ascii_alphabetic() || c == '_');
    if !head || !chars.all(|c| c.is_ascii_alphanumeric() || c == '_') {
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

/// A barrier along a [`Model`].
#[derive(Clone, Debug)]
pub struct Barrier {
    model: Model,
    h: Register,
}

/// Calls `$function::<M>` with the least number `M` of directions that is enough for `$inputs`: fewer instances,
/// for a few zeros.
macro_rules! with_directions {
    ($inputs:expr, $function:ident($($argument:expr),*)) => {
        match $inputs {
            1 => $function::<1>($($argument),*),
            2 => $function::<2>($($argument),*),
            3 => $function::<3>($($argument),*),
            4 => $function::<4>($($argument),*),
            5..=6 => $function::<6>($($argument),*),
            7..=8 => $function::<8>($($argument),*),
            _ => $function::<MAX_INPUTS>($($argument),*),
        }
    };
}

impl Barrier {
    /// The relative degree, found on [`samples`](lie::samples) of states within `ranges`.
    pub fn relative_degree(&self, ranges: &[[f64; 2]]) -> RelativeDegree {
        fn coefficients<const M: usize>(barrier: &Barrier, samples: Vec<(f64, Vec<f64>)>) -> RelativeDegree {
            let mut along = Along::<Dual<M>>::new(barrier, MAX_RELATIVE_DEGREE);
            let inputs = barrier.model.inputs.len();
            lie::relative_degree_of(inputs, samples, |t, x| along.coefficients(t, x))
        }
        with_directions!(self.model.inputs.len(), coefficients(self, lie::samples(ranges)))
    }

    /// Its derivatives at relative degree `n`, for a filter.
    ///
    /// # Errors
    ///
    /// `n` outside 1 to [`MAX_RELATIVE_DEGREE`].
    pub fn source(&self, n: usize) -> Result<Box<dyn DerivativeSource>, Error> {
        fn source<const M: usize>(barrier: &Barrier, n: usize) -> Box<dyn DerivativeSource> {
            let model = &barrier.model;
            let work = Work::<M> {
                along: Along::new(barrier, n),
                flow: Flow::new(model),
                along_tangent: Along::new(barrier, n),
                flow_tangent: Flow::new(model),
            };
            let (states, inputs) = (model.states.len(), model.inputs.len());
            Box::new(Source { work: RefCell::new(work), states, inputs, n })
        }
        if n == 0 || n > MAX_RELATIVE_DEGREE {
            let message = format!("is {n}, must be 1 to {MAX_RELATIVE_DEGREE}");
            return Err(Error::new("relative_degree", message));
        }
        Ok(with_directions!(self.model.inputs.len(), source(self, n)))
    }
}

/// The motion of a plant: registers, and the stages of the Runge-Kutta method.
struct Flow<C> {
    steps: Vec<Step>,
    derivatives: Vec<Register>,
    inputs: Range<Register>,
    series: Series<C>,
    start: Vec<C>,
    stages: [Vec<C>; 4],
}

impl<C: Scalar> Flow<C> {
    fn new(model: &Model) -> Self {
        let (states, registers) = (model.states.len(), model.programme.registers);
        let zeros = || vec![C::zero(); states];
        Self {
            steps: needed(&model.programme.steps, &model.derivatives, registers),
            derivatives: model.derivatives.clone(),
            inputs: states..states + model.inputs.len(),
            series: Series::new(registers, 1),
            start: zeros(),
            stages: [zeros(), zeros(), zeros(), zeros()],
        }
    }

    fn set_state(&mut self, x: impl Iterator<Item = C>) {
        for (i, value) in x.enumerate() {
            self.series.set(i, 0, value);
        }
    }

    fn state(&self, i: usize) -> C {
        self.series.get(i, 0)
    }

    fn hold(&mut self, u: impl Iterator<Item = C>) {
        for (register, value) in self.inputs.clone().zip(u) {
            self.series.set(register, 0, value);
        }
    }

    /// Moves the state; the method and its order of additions are those of [`lie::flow`].
    fn run(&mut self, duration: f64, steps: usize) {
        let dt = duration / steps as f64;
        for _ in 0..steps {
            for (i, start) in self.start.iter_mut().enumerate() {
                *start = self.series.get(i, 0);
            }
            for stage in 0..4 {
                if stage > 0 {
                    let part = if stage == 3 { dt } else { dt / 2.0 };
                    for (i, (&start, &slope)) in self.start.iter().zip(&self.stages[stage - 1]).enumerate() {
                        self.series.set(i, 0, start + slope * part);
                    }
                }
                self.series.advance(&self.steps, 0);
                for (slope, &register) in self.stages[stage].iter_mut().zip(&self.derivatives) {
                    *slope = self.series.get(register, 0);
                }
            }
            let [k1, k2, k3, k4] = &self.stages;
            for (i, &start) in self.start.iter().enumerate() {
                let sum = k1[i] + (k2[i] + k3[i]) * 2.0 + k4[i];
                self.series.set(i, 0, start + sum * (dt / 6.0));
            }
        }
    }
}

/// A plant to simulate.
struct Simulated {
    work: RefCell<Flow<f64>>,
    inputs: usize,
}

impl DynPlant for Simulated {
    fn state_dim(&self) -> usize {
        self.work.borrow().start.len()
    }

    fn input_dim(&self) -> usize {
        self.inputs
    }

    fn rk4_step(&self, x: &mut [f64], u: &[f64], dt: f64) -> Result<(), punctual_core::Error> {
        punctual_core::dynamics::check_lengths((x, self.state_dim()), (u, self.inputs))?;
        moved(&mut self.work.borrow_mut(), x, u, dt, 1);
        Ok(())
    }
}

fn moved(flow: &mut Flow<f64>, x: &mut [f64], u: &[f64], duration: f64, steps: usize) {
    flow.set_state(x.iter().copied());
    flow.hold(u.iter().copied());
    flow.run(duration, steps);
    for (i, x) in x.iter_mut().enumerate() {
        *x = flow.state(i);
    }
}

/// Series of h along the plant.
struct Along<C> {
    flow: Flow<C>,
    series: Series<C>,
    /// What plant and barrier need.
    steps: Vec<Step>,
    /// What the barrier needs: at the last order nothing else is asked.
    last: Vec<Step>,
    h: Register,
    n: usize,
}

impl<C: Scalar> Along<C> {
    fn new(barrier: &Barrier, n: usize) -> Self {
        let Barrier { model, h } = barrier;
        let Programme { steps, registers, .. } = &model.programme;
        let wanted: Vec<_> = model.derivatives.iter().copied().chain([*h]).collect();
        let mut series = Series::new(*registers, n + 1);
        // Time goes on by itself; inputs are held.
        series.set(model.states.len() + model.inputs.len(), 1, C::from(1.0));
        Self {
            flow: Flow::new(model),
            series,
            steps: needed(steps, &wanted, *registers),
            last: needed(steps, &[*h], *registers),
            h: *h,
            n,
        }
    }

    /// The coefficients of h from the state and the inputs that `flow` has, at time `t`.
    fn continue_from_flow(&mut self, t: f64) {
        let (series, flow) = (&mut self.series, &self.flow);
        for register in 0..flow.inputs.end {
            series.set(register, 0, flow.series.get(register, 0));
        }
        series.set(flow.inputs.end, 0, C::from(t));
        for k in 0..self.n {
            series.advance(&self.steps, k);
            for (i, &register) in flow.derivatives.iter().enumerate() {
                let slope = series.get(register, k);
                series.set(i, k + 1, slope * (1.0 / (k + 1) as f64));
            }
        }
        series.advance(&self.last, self.n);
    }

    /// h⁽ᵏ⁾.
    fn derivative(&self, k: usize) -> C {
        self.series.get(self.h, k) * (1..=k).map(|i| i as f64).product::<f64>()
    }

    /// Its coefficients a moment ahead, from the state and the inputs that `flow` has.
    fn ahead(&mut self, t: f64, duration: f64) {
        self.flow.run(duration, SUBSTEPS);
        self.continue_from_flow(t + duration);
    }
}

/// With derivatives along `M` ≥ the number of inputs.
impl<const M: usize> Along<Dual<M>> {
    fn hold(&mut self, u: impl Fn(usize) -> f64) {
        self.flow.hold((0..M).map(|i| Dual::variable(u(i), i)));
    }

    /// From the state `x` at time `t`, along the free motion.
    fn evaluate(&mut self, t: f64, x: &[f64]) {
        self.flow.set_state(x.iter().map(|&v| Dual::from(v)));
        self.hold(|_| 0.0);
        self.continue_from_flow(t);
    }

    fn coefficients(&mut self, t: f64, x: &[f64]) -> Coefficients {
        self.evaluate(t, x);
        std::array::from_fn(|k| {
            let h = self.series.get(self.h, k);
            (h.value, std::array::from_fn(|i| h.gradient.get(i).copied().unwrap_or_default()))
        })
    }
}

/// A barrier along a plant, as the filter takes it.
struct Source<const M: usize> {
    work: RefCell<Work<M>>,
    states: usize,
    inputs: usize,
    n: usize,
}

/// Memory of the evaluations.
struct Work<const M: usize> {
    along: Along<Dual<M>>,
    flow: Flow<f64>,
    along_tangent: Along<Tangent<Dual<M>>>,
    flow_tangent: Flow<Tangent<f64>>,
}

impl<const M: usize> Source<M> {
    fn write(&self, out: &mut Ahead, derivative: impl Fn(usize) -> Dual<M>) {
        *out = Ahead::ZERO;
        for k in 0..=self.n {
            let Dual { value, gradient } = derivative(k);
            out.value[k] = value;
            out.gradient[k][..self.inputs].copy_from_slice(&gradient[..self.inputs]);
        }
    }
}

impl<const M: usize> DerivativeSource for Source<M> {
    fn relative_degree(&self) -> usize {
        self.n
    }

    fn state_dim(&self) -> usize {
        self.states
    }

    fn input_dim(&self) -> usize {
        self.inputs
    }

    fn evaluate(&self, t: f64, x: &[f64], out: &mut Derivatives) {
        let along = &mut self.work.borrow_mut().along;
        along.evaluate(t, x);
        *out = Derivatives::ZERO;
        for k in 0..=self.n {
            let Dual { value, gradient } = along.derivative(k);
            out.drift[k] = value;
            if k == self.n {
                out.row[..self.inputs].copy_from_slice(&gradient[..self.inputs]);
            } else {
                // A sum and not a maximum: `f64::max` would drop a NaN.
                out.lower_sensitivity += gradient.iter().map(|d| d.abs()).sum::<f64>();
            }
        }
    }

    fn predict(&self, x: &mut [f64], u: &[f64], duration: f64) -> bool {
        moved(&mut self.work.borrow_mut().flow, x, u, duration, SUBSTEPS);
        true
    }

    fn ahead(&self, t: f64, x: &[f64], u: &[f64], duration: f64, out: &mut Ahead) -> bool {
        let along = &mut self.work.borrow_mut().along;
        along.flow.set_state(x.iter().map(|&v| Dual::from(v)));
        along.hold(|i| u.get(i).copied().unwrap_or_default());
        along.ahead(t, duration);
        self.write(out, |k| along.derivative(k));
        true
    }

    fn ahead_along(
        &self,
        t: f64,
        [x, dx]: [&[f64]; 2],
        [u, du]: [&[f64]; 2],
        duration: f64,
        out: &mut Ahead,
    ) -> bool {
        let along = &mut self.work.borrow_mut().along_tangent;
        let state = x.iter().zip(dx).map(|(&v, &d)| Tangent { value: Dual::from(v), along: Dual::from(d) });
        along.flow.set_state(state);
        let input = u.iter().zip(du).enumerate();
        along
            .flow
            .hold(input.map(|(i, (&v, &d))| Tangent { value: Dual::variable(v, i), along: Dual::from(d) }));
        along.ahead(t, duration);
        self.write(out, |k| along.derivative(k).along);
        true
    }

    fn predict_along(&self, x: &mut [f64], dx: &mut [f64], u: &[f64], duration: f64) -> bool {
        let flow = &mut self.work.borrow_mut().flow_tangent;
        flow.set_state(x.iter().zip(&*dx).map(|(&value, &along)| Tangent { value, along }));
        flow.hold(u.iter().map(|&value| Tangent { value, along: 0.0 }));
        flow.run(duration, SUBSTEPS);
        for (i, (x, dx)) in x.iter_mut().zip(dx).enumerate() {
            let Tangent { value, along } = flow.state(i);
            (*x, *dx) = (value, along);
        }
        true
    }
}
