//! The motion of a plant, and the series of a barrier along it. A tape or foreign code performs the
//! operations.

use std::any::Any;
use std::cell::RefCell;
use std::sync::Arc;

use punctual_core::MAX_RELATIVE_DEGREE;
use punctual_core::dynamics::DynPlant;
use punctual_core::internal::{self, Coefficients, SUBSTEPS};
use punctual_core::interval::Interval;
use punctual_core::jet::{Dual, Tangent};
use punctual_core::lie::{
    Ahead, DerivativeSource, Derivatives, Direction, Directional, EXPANSION_ORDERS, Expansion, ExpansionOver,
    PlantId, Predict, PredictDirectional, RateOver, RelativeDegree, Second, SharedPlant,
};
use punctual_core::scalar::Scalar;

use crate::Error;
use crate::series::Series;
use crate::tape::Register;

/// Which plant a model is: one object for all barriers along it.
pub(crate) type Identity = Arc<dyn Any + Send + Sync>;

/// The operations of a plant, or of a barrier along it. Registers: states, inputs, time, then results.
pub(crate) trait Equations: Clone + Send + 'static {
    /// Number of states.
    fn states(&self) -> usize;

    /// Number of inputs.
    fn inputs(&self) -> usize;

    /// Memory for `orders` coefficients of every register.
    fn series<C: Scalar>(&self, orders: usize) -> Series<C>;

    /// Computes coefficient `k` of the derivatives of the states, after all lower ones.
    fn advance<C: Scalar>(&mut self, series: &mut Series<C>, k: usize);

    /// The register of the derivative of state `i`, once [`Self::advance`] has run.
    fn derivative(&self, i: usize) -> Register;

    /// Whether the last coefficients of the plant, and of the barrier, enclose all values if they were
    /// computed with intervals.
    fn encloses(&self) -> [bool; 2] {
        [true; 2]
    }

    /// The same with the operations alone that the motion of the states takes.
    fn of_motion(&self) -> Self {
        self.clone()
    }

    /// The same barrier with the operations alone that its value takes, where all states are given.
    fn of_value(&self) -> Self {
        self.clone()
    }

    /// The same barrier with the operations alone that its derivatives take: of the states that ever move h. The derivatives of the
    /// others are 0.
    fn of_barrier(&self) -> Self {
        self.clone()
    }

    /// Whether the value of the barrier reads state `i`; false only if it certainly does not.
    fn reads(&self, i: usize) -> bool {
        let _ = i;
        true
    }

    /// Computes the coefficients of the barrier up to `n`, after those of the states, and returns their
    /// register.
    fn finish<C: Scalar>(&mut self, series: &mut Series<C>, n: usize) -> Register;
}

/// Calls `$function::<_, M>` with the least available number `M` of directions that suffices for `$inputs`. A
/// few zero directions are the price of fewer instantiations.
macro_rules! with_directions {
    ($inputs:expr, $function:ident($($argument:expr),*)) => {
        match $inputs {
            1 => $function::<_, 1>($($argument),*),
            2 => $function::<_, 2>($($argument),*),
            3 => $function::<_, 3>($($argument),*),
            4 => $function::<_, 4>($($argument),*),
            5..=6 => $function::<_, 6>($($argument),*),
            7..=8 => $function::<_, 8>($($argument),*),
            9..=12 => $function::<_, 12>($($argument),*),
            _ => $function::<_, { punctual_core::MAX_INPUTS }>($($argument),*),
        }
    };
}

/// The relative degree of the barrier `along` the plant, found at built-in samples of states within `ranges`.
/// Inputs are zero, or nonzero if `driven`, which also reveals an input that only multiplies another one.
pub(crate) fn relative_degree<E: Equations>(
    plant: &E,
    along: &E,
    ranges: &[[f64; 2]],
    driven: bool,
) -> RelativeDegree {
    fn found<E: Equations, const M: usize>(
        plant: &E,
        along: &E,
        ranges: &[[f64; 2]],
        driven: bool,
    ) -> RelativeDegree {
        let mut series = Along::<E, Dual<M>>::new(plant, along, MAX_RELATIVE_DEGREE);
        let samples = internal::samples(ranges);
        // Values that are special for no model.
        let u = |i: usize| if driven { 0.7 + 0.11 * i as f64 } else { 0.0 };
        internal::relative_degree_of(plant.inputs(), samples, |t, x| series.coefficients(t, x, u))
    }
    with_directions!(plant.inputs(), found(plant, along, ranges, driven))
}

/// The derivatives of the barrier `along` the plant up to relative degree `n`, for a filter. Sources of one `identity` are
/// along one plant.
///
/// # Errors
///
/// `n` outside 1 to [`MAX_RELATIVE_DEGREE`].
pub(crate) fn source<E: Equations>(
    plant: &E,
    along: &E,
    n: usize,
    identity: &Identity,
) -> Result<Box<dyn DerivativeSource>, Error> {
    fn made<E: Equations, const M: usize>(
        plant: &E,
        along: &E,
        n: usize,
        identity: &Identity,
    ) -> Box<dyn DerivativeSource> {
        let (of_motion, of_barrier, of_value) = (along.of_motion(), along.of_barrier(), along.of_value());
        let work = Work::<E, M> {
            along: Along::new(plant, &of_barrier, n),
            flow: Flow::new(plant),
            along_tangent: Along::new(plant, &of_barrier, n),
            flow_tangent: Flow::new(plant),
            path: Along::new(plant, &of_motion, EXPANSION_ORDERS - 1),
            expansions: Along::new(plant, &of_value, EXPANSION_ORDERS - 1),
            value: Along::new(plant, &of_value, 0),
            few_over: Along::new(plant, &of_value, 1),
            path_over: Along::new(plant, &of_motion, EXPANSION_ORDERS - 1),
            expansions_over: Along::new(plant, &of_value, EXPANSION_ORDERS - 1),
            second: Along::new(plant, &of_value, 1),
            reads: (0..plant.states()).map(|i| of_value.reads(i)).collect(),
            held: vec![[Interval::ALL; 2]; plant.states()],
            rate: vec![0.0; plant.states()],
        };
        let (states, inputs) = (plant.states(), plant.inputs());
        Box::new(Source { work: RefCell::new(work), identity: Arc::clone(identity), states, inputs, n })
    }
    if n == 0 || n > MAX_RELATIVE_DEGREE {
        let message = format!("is {n}, must be 1 to {MAX_RELATIVE_DEGREE}");
        return Err(Error::new("relative_degree", message));
    }
    Ok(with_directions!(plant.inputs(), made(plant, along, n, identity)))
}

/// The plant, for simulation.
pub(crate) fn simulated<E: Equations>(plant: &E) -> Box<dyn DynPlant> {
    Box::new(Simulated { work: RefCell::new(Flow::new(plant)), inputs: plant.inputs() })
}

/// The motion of a plant: registers, and the stages of the Runge–Kutta method.
struct Flow<E, C> {
    equations: E,
    series: Series<C>,
    start: Vec<C>,
    stages: [Vec<C>; 4],
}

impl<E: Equations, C: Scalar> Flow<E, C> {
    fn new(equations: &E) -> Self {
        let zeros = || vec![C::zero(); equations.states()];
        Self {
            equations: equations.clone(),
            series: equations.series(1),
            start: zeros(),
            stages: [zeros(), zeros(), zeros(), zeros()],
        }
    }

    fn inputs(&self) -> std::ops::Range<Register> {
        let first = self.equations.states();
        first..first + self.equations.inputs()
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
        for (register, value) in self.inputs().zip(u) {
            self.series.set(register, 0, value);
        }
    }

    /// Moves the state as the predictions of [`lie`](punctual_core::lie) do: in one step if that suffices.
    fn predict(&mut self, duration: f64) {
        self.run(duration, 1);
        if !internal::is_even(self.stages.each_ref().map(Vec::as_slice)) {
            for (i, &start) in self.start.iter().enumerate() {
                self.series.set(i, 0, start);
            }
            self.run(duration, SUBSTEPS);
        }
    }

    /// Moves the state with the method of [`flow`](punctual_core::lie::flow), in the same order of additions.
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
                self.equations.advance(&mut self.series, 0);
                for (i, slope) in self.stages[stage].iter_mut().enumerate() {
                    *slope = self.series.get(self.equations.derivative(i), 0);
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

/// A plant for simulation.
struct Simulated<E> {
    work: RefCell<Flow<E, f64>>,
    inputs: usize,
}

impl<E: Equations> DynPlant for Simulated<E> {
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

fn moved<E: Equations>(flow: &mut Flow<E, f64>, x: &mut [f64], u: &[f64], duration: f64, steps: usize) {
    flow.set_state(x.iter().copied());
    flow.hold(u.iter().copied());
    flow.run(duration, steps);
    for (i, x) in x.iter_mut().enumerate() {
        *x = flow.state(i);
    }
}

/// Writes ẋ at `x` under `u`.
fn rates_at<E: Equations>(flow: &mut Flow<E, f64>, x: &[f64], u: &[f64], out: &mut [f64]) {
    let Flow { equations, series, .. } = flow;
    for (register, &value) in x.iter().chain(u).enumerate() {
        series.set(register, 0, value);
    }
    equations.advance(series, 0);
    for (i, out) in out.iter_mut().enumerate() {
        *out = series.get(equations.derivative(i), 0);
    }
}

/// Series of h along the plant.
struct Along<E, C> {
    flow: Flow<E, C>,
    equations: E,
    series: Series<C>,
    h: Register,
    n: usize,
}

impl<E: Equations, C: Scalar> Along<E, C> {
    fn new(plant: &E, along: &E, n: usize) -> Self {
        let mut series = along.series(n + 1);
        // Time has slope 1; inputs are held.
        if n > 0 {
            series.set(along.states() + along.inputs(), 1, C::from(1.0));
        }
        Self { flow: Flow::new(plant), equations: along.clone(), series, h: 0, n }
    }

    /// Computes the coefficients of h from the state and the inputs of `flow`, at time `t`.
    fn continue_from_flow(&mut self, t: f64) {
        let (series, flow) = (&mut self.series, &self.flow);
        let time = flow.inputs().end;
        for register in 0..time {
            series.set(register, 0, flow.series.get(register, 0));
        }
        series.set(time, 0, C::from(t));
        for k in 0..self.n {
            self.equations.advance(series, k);
            for i in 0..self.equations.states() {
                let slope = series.get(self.equations.derivative(i), k);
                series.set(i, k + 1, slope * (1.0 / (k + 1) as f64));
            }
        }
        self.h = self.equations.finish(series, self.n);
    }

    /// h⁽ᵏ⁾.
    fn derivative(&self, k: usize) -> C {
        self.series.get(self.h, k) * (1..=k).map(|i| i as f64).product::<f64>()
    }

    /// Computes the coefficients of h from those of the states, at time `t`, and returns h.
    fn follow(&mut self, t: C, state: impl Fn(usize, usize) -> C) -> C {
        let Self { equations, series, n, .. } = self;
        let states = equations.states();
        series.set(states + equations.inputs(), 0, t);
        for k in 0..=*n {
            for i in 0..states {
                series.set(i, k, state(i, k));
            }
            if k < *n {
                equations.advance(series, k);
            }
        }
        self.h = equations.finish(series, *n);
        series.get(self.h, 0)
    }

    /// Computes the coefficients of h `duration` ahead, starting from the state and the inputs of `flow`.
    fn ahead(&mut self, t: f64, duration: f64) {
        self.flow.run(duration, SUBSTEPS);
        self.continue_from_flow(t + duration);
    }
}

/// With derivatives along `M` directions, at least as many as inputs.
impl<E: Equations, const M: usize> Along<E, Dual<M>> {
    fn hold(&mut self, u: impl Fn(usize) -> f64) {
        self.flow.hold((0..M).map(|i| Dual::variable(u(i), i)));
    }

    /// Moves from the state `x` under the held input `u`.
    fn arrive(&mut self, x: &[f64], u: &[f64], duration: f64) {
        self.flow.set_state(x.iter().map(|&v| Dual::from(v)));
        self.hold(|i| u.get(i).copied().unwrap_or_default());
        self.flow.predict(duration);
    }

    /// Computes the coefficients from the state `x` at time `t`, along the free motion.
    fn evaluate(&mut self, t: f64, x: &[f64]) {
        self.evaluate_at(t, x, |_| 0.0);
    }

    fn evaluate_at(&mut self, t: f64, x: &[f64], u: impl Fn(usize) -> f64) {
        self.flow.set_state(x.iter().map(|&v| Dual::from(v)));
        self.hold(u);
        self.continue_from_flow(t);
    }

    fn coefficients(&mut self, t: f64, x: &[f64], u: impl Fn(usize) -> f64) -> Coefficients {
        self.evaluate_at(t, x, u);
        std::array::from_fn(|k| {
            let h = self.series.get(self.h, k);
            (h.value, std::array::from_fn(|i| h.gradient.get(i).copied().unwrap_or_default()))
        })
    }
}

/// A barrier along a plant, in the form that the filter needs.
struct Source<E, const M: usize> {
    work: RefCell<Work<E, M>>,
    identity: Identity,
    states: usize,
    inputs: usize,
    n: usize,
}

/// Memory for evaluations at a sample and ahead of it.
struct Work<E, const M: usize> {
    along: Along<E, Dual<M>>,
    flow: Flow<E, f64>,
    along_tangent: Along<E, Tangent<Dual<M>>>,
    flow_tangent: Flow<E, Tangent<f64>>,
    /// For the motion of the states, and of h along it.
    path: Along<E, f64>,
    expansions: Along<E, f64>,
    value: Along<E, f64>,
    /// For enclosures of h, and of h with its rate.
    few_over: Along<E, Interval>,
    path_over: Along<E, Interval>,
    expansions_over: Along<E, Interval>,
    second: Along<E, Second>,
    /// Whether h reads each state.
    reads: Vec<bool>,
    /// Enclosures of the states and their rates while an input is held, and the rates at its start.
    held: Vec<[Interval; 2]>,
    rate: Vec<f64>,
}

impl<E, const M: usize> Source<E, M> {
    fn write(&self, out: &mut Ahead, derivative: impl Fn(usize) -> Dual<M>) {
        *out = Ahead::ZERO;
        for k in 0..=self.n {
            let Dual { value, gradient } = derivative(k);
            out.value[k] = value;
            out.gradient[k][..self.inputs].copy_from_slice(&gradient[..self.inputs]);
        }
    }
}

impl<E: Equations, const M: usize> DerivativeSource for Source<E, M> {
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
        along.evaluate(t, &x[..self.states]);
        *out = Derivatives::ZERO;
        for k in 0..=self.n {
            let Dual { value, gradient } = along.derivative(k);
            out.drift[k] = value;
            if k == self.n {
                out.row[..self.inputs].copy_from_slice(&gradient[..self.inputs]);
            } else {
                // A sum rather than a maximum, since `f64::max` would drop a NaN.
                out.lower_sensitivity += gradient.iter().map(|d| d.abs()).sum::<f64>();
            }
        }
    }

    fn predict(&self) -> Option<&dyn Predict> {
        Some(self)
    }

    fn directional(&self) -> Option<&dyn Directional> {
        Some(self)
    }

    fn predict_directional(&self) -> Option<&dyn PredictDirectional> {
        Some(self)
    }

    fn shared(&self) -> Option<&dyn SharedPlant> {
        Some(self)
    }
}

/// Barriers share the predicted motion. At a sample, plant and barrier are evaluated as one tape, so only the
/// initial state is shared.
impl<E: Equations, const M: usize> SharedPlant for Source<E, M> {
    fn plant(&self) -> PlantId {
        PlantId::of(&self.identity, [self.states, self.inputs])
    }

    fn rooms(&self) -> [Box<dyn Any + Send>; 2] {
        let arrival = vec![Dual::<M>::from(0.0); self.states + self.inputs];
        [Box::new(vec![0.0; self.states]), Box::new(arrival)]
    }

    fn motion(&self, x: &[f64], room: &mut dyn Any) {
        let begin: &mut Vec<f64> = room.downcast_mut().expect(FOREIGN_ROOM);
        begin.copy_from_slice(&x[..self.states]);
    }

    fn evaluate_along(&self, t: f64, motion: &dyn Any, out: &mut Derivatives) {
        let begin: &Vec<f64> = motion.downcast_ref().expect(FOREIGN_ROOM);
        self.evaluate(t, begin, out);
    }

    fn motion_ahead(&self, x: &[f64], u: &[f64], duration: f64, room: &mut dyn Any) {
        let arrival: &mut Vec<Dual<M>> = room.downcast_mut().expect(FOREIGN_ROOM);
        let along = &mut self.work.borrow_mut().along;
        along.arrive(&x[..self.states], u, duration);
        for (register, value) in arrival.iter_mut().enumerate() {
            *value = along.flow.series.get(register, 0);
        }
    }

    fn ahead_of_row_along(&self, t: f64, motion: &dyn Any, out: &mut Ahead) {
        let arrival: &Vec<Dual<M>> = motion.downcast_ref().expect(FOREIGN_ROOM);
        let along = &mut self.work.borrow_mut().along;
        along.flow.set_state(arrival.iter().copied());
        along.continue_from_flow(t);
        self.write(out, |k| along.derivative(k));
    }
}

/// Panic message for a workspace of another plant.
const FOREIGN_ROOM: &str = "a room made by a source along the same plant";

impl<E: Equations, const M: usize> Predict for Source<E, M> {
    fn flow(&self, x: &mut [f64], u: &[f64], duration: f64) {
        moved(&mut self.work.borrow_mut().flow, &mut x[..self.states], u, duration, SUBSTEPS);
    }

    fn ahead(&self, t: f64, x: &[f64], u: &[f64], duration: f64, out: &mut Ahead) {
        let along = &mut self.work.borrow_mut().along;
        along.arrive(&x[..self.states], u, duration);
        along.continue_from_flow(t + duration);
        self.write(out, |k| along.derivative(k));
    }

    fn rate(&self, x: &[f64], u: &[f64], out: &mut [f64]) {
        let (own, others) = out.split_at_mut(self.states);
        rates_at(&mut self.work.borrow_mut().value.flow, &x[..self.states], u, own);
        others.fill(0.0);
    }

    fn path(&self, x: &[f64], u: &[f64], out: &mut [Expansion]) {
        let path = &mut self.work.borrow_mut().path;
        path.flow.set_state(x[..self.states].iter().copied());
        path.flow.hold(u.iter().copied());
        path.continue_from_flow(0.0);
        let (own, others) = out.split_at_mut(self.states);
        for (i, out) in own.iter_mut().enumerate() {
            *out = std::array::from_fn(|k| path.series.get(i, k));
        }
        for (out, x) in others.iter_mut().zip(&x[self.states..]) {
            *out = [0.0; EXPANSION_ORDERS];
            out[0] = *x;
        }
    }

    fn reads(&self, state: usize) -> bool {
        // What follows the states is no part of h.
        self.work.borrow().reads.get(state).copied().unwrap_or(false)
    }

    fn value(&self, t: f64, x: &[f64]) -> f64 {
        let expansions = &mut self.work.borrow_mut().value;
        expansions.follow(t, |i, _| x[i])
    }

    fn value_along(&self, t: f64, path: &[Expansion], out: &mut Expansion) {
        let expansions = &mut self.work.borrow_mut().expansions;
        expansions.follow(t, |i, k| path[i][k]);
        *out = std::array::from_fn(|k| expansions.series.get(expansions.h, k));
    }

    fn rates_over(&self, path: &[ExpansionOver], u: &[f64], orders: usize, out: &mut [RateOver]) -> bool {
        let Along { equations, series, .. } = &mut self.work.borrow_mut().path_over;
        let (path, (out, others)) = (&path[..self.states], out.split_at_mut(self.states));
        others.fill([Interval::from(0.0); EXPANSION_ORDERS - 1]);
        for (register, &value) in (path.len()..).zip(u) {
            series.set(register, 0, Interval::from(value));
        }
        for k in 0..orders {
            for (i, expansion) in path.iter().enumerate() {
                series.set(i, k, expansion[k]);
            }
            equations.advance(series, k);
            for (i, out) in out.iter_mut().enumerate() {
                out[k] = series.get(equations.derivative(i), k);
            }
        }
        equations.encloses()[0]
    }

    fn value_over(&self, time: Interval, path: &[ExpansionOver]) -> Option<Interval> {
        let few_over = &mut self.work.borrow_mut().few_over;
        let h = few_over.follow(time, |i, _| path[i][0]);
        few_over.equations.encloses()[1].then_some(h)
    }

    fn second_rates(&self, x: &[Second], u: &[Second], out: &mut [Second]) -> bool {
        let Along { flow: Flow { equations, series, .. }, .. } = &mut self.work.borrow_mut().second;
        let (own, others) = out.split_at_mut(self.states);
        for (register, &value) in x[..self.states].iter().chain(u).enumerate() {
            series.set(register, 0, value);
        }
        equations.advance(series, 0);
        for (i, out) in own.iter_mut().enumerate() {
            *out = series.get(equations.derivative(i), 0);
        }
        others.fill(Second::from(0.0));
        equations.encloses()[0]
    }

    fn second_value(&self, time: Interval, x: &[Second]) -> Option<Second> {
        let second = &mut self.work.borrow_mut().second;
        let time = Second { value: Tangent { value: time, ..Tangent::from(0.0) }, ..Second::from(0.0) };
        let h = second.follow(time, |i, k| if k == 0 { x[i] } else { Second::from(0.0) });
        second.equations.encloses()[1].then_some(h)
    }

    fn is_still(&self, x: &[f64]) -> Option<bool> {
        let few_over = &mut self.work.borrow_mut().few_over;
        let mut at = |time| few_over.follow(time, |i, _| Interval::from(x[i]));
        // If time is not used, both results have the same bits.
        let is_still = at(Interval::ALL) == at(Interval::from(0.0));
        few_over.equations.encloses()[1].then_some(is_still)
    }

    fn lowest_held(&self, t: f64, x: &[f64], u: &[f64], duration: f64, wanted: f64) -> Option<f64> {
        let Work { value, few_over, held, rate, .. } = &mut *self.work.borrow_mut();
        let x = &x[..self.states];
        rates_at(&mut value.flow, x, u, rate);
        let Flow { equations, series, .. } = &mut few_over.flow;
        for (register, &value) in (x.len()..).zip(u) {
            series.set(register, 0, Interval::from(value));
        }
        let known = internal::enclose(x, duration, rate, held, |held| {
            for (i, [state, _]) in held.iter().enumerate() {
                series.set(i, 0, *state);
            }
            equations.advance(series, 0);
            for (i, [_, rate]) in held.iter_mut().enumerate() {
                *rate = series.get(equations.derivative(i), 0);
            }
        });
        if !equations.encloses()[0] {
            return None;
        }
        if !known {
            return Some(f64::NEG_INFINITY);
        }
        let low = few_over.follow(Interval::new(t, t + duration), |i, k| held[i][k]).low;
        if !few_over.equations.encloses()[1] {
            return None;
        }
        if low >= wanted {
            return Some(low);
        }
        let slope = few_over.series.get(few_over.h, 1);
        Some(internal::sharper(low, value.follow(t, |i, _| x[i]), slope, duration))
    }

    fn last_over(&self, time: Interval, path: &[ExpansionOver]) -> Option<Interval> {
        let expansions = &mut self.work.borrow_mut().expansions_over;
        expansions.follow(time, |i, k| path[i][k]);
        expansions.equations.encloses()[1].then(|| expansions.series.get(expansions.h, EXPANSION_ORDERS - 1))
    }
}

impl<E: Equations, const M: usize> Directional for Source<E, M> {
    fn evaluate_directional(&self, t: f64, x: &[f64], u: &[f64], direction: Direction, out: &mut Ahead) {
        self.ahead_directional(t, x, u, direction, 0.0, out);
    }
}

impl<E: Equations, const M: usize> PredictDirectional for Source<E, M> {
    fn flow_directional(&self, x: &mut [f64], dx: &mut [f64], u: &[f64], duration: f64) {
        let flow = &mut self.work.borrow_mut().flow_tangent;
        let (x, dx) = (&mut x[..self.states], &mut dx[..self.states]);
        flow.set_state(x.iter().zip(&*dx).map(|(&value, &directional)| Tangent { value, directional }));
        flow.hold(u.iter().map(|&value| Tangent { value, directional: 0.0 }));
        flow.run(duration, SUBSTEPS);
        for (i, (x, dx)) in x.iter_mut().zip(dx).enumerate() {
            Tangent { value: *x, directional: *dx } = flow.state(i);
        }
    }

    fn ahead_directional(
        &self,
        t: f64,
        x: &[f64],
        u: &[f64],
        direction: Direction,
        duration: f64,
        out: &mut Ahead,
    ) {
        let along = &mut self.work.borrow_mut().along_tangent;
        let state = x[..self.states].iter().zip(direction.x);
        along
            .flow
            .set_state(state.map(|(&v, &d)| Tangent { value: Dual::from(v), directional: Dual::from(d) }));
        let input = u.iter().zip(direction.u).enumerate();
        along.flow.hold(
            input.map(|(i, (&v, &d))| Tangent { value: Dual::variable(v, i), directional: Dual::from(d) }),
        );
        along.ahead(t, duration);
        self.write(out, |k| along.derivative(k).directional);
    }
}
