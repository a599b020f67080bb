//! The motion of a plant, and the derivatives of a barrier along it, as filters and simulations take them.

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

use crate::Error;
use crate::motion::{Along, Equations, Flow, Held, moved, rates_at, write};

/// Which plant a model is: one object for all barriers along it.
pub(crate) type Identity = Arc<dyn Any + Send + Sync>;

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
            values: Along::new(plant, &of_barrier, n),
            flow: Flow::new(plant),
            along_tangent: Along::new(plant, &of_barrier, n),
            flow_tangent: Flow::new(plant),
            path: Along::new(plant, &of_motion, EXPANSION_ORDERS - 1),
            expansions: Along::new(plant, &of_value, EXPANSION_ORDERS - 1),
            held: Held::new(plant, &of_value),
            path_over: Along::new(plant, &of_motion, EXPANSION_ORDERS - 1),
            expansions_over: Along::new(plant, &of_value, EXPANSION_ORDERS - 1),
            second: Along::new(plant, &of_value, 1),
            reads: (0..plant.states()).map(|i| of_value.reads(i)).collect(),
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

impl<E: Equations, const M: usize> Along<E, Dual<M>> {
    fn coefficients(&mut self, t: f64, x: &[f64], u: impl Fn(usize) -> f64) -> Coefficients {
        self.evaluate_at(t, x, u);
        core::array::from_fn(|k| {
            let h = self.series.get(self.h, k);
            (h.value, core::array::from_fn(|i| h.gradient.get(i).copied().unwrap_or_default()))
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
    values: Along<E, f64>,
    flow: Flow<E, f64>,
    along_tangent: Along<E, Tangent<Dual<M>>>,
    flow_tangent: Flow<E, Tangent<f64>>,
    /// For the motion of the states, and of h along it.
    path: Along<E, f64>,
    expansions: Along<E, f64>,
    held: Held<E>,
    path_over: Along<E, Interval>,
    expansions_over: Along<E, Interval>,
    second: Along<E, Second>,
    /// Whether h reads each state.
    reads: Vec<bool>,
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
        self.work.borrow_mut().along.derivatives(t, &x[..self.states], out);
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
        self.work.borrow_mut().along.motion_ahead(&x[..self.states], u, duration, arrival);
    }

    fn ahead_of_row_along(&self, t: f64, motion: &dyn Any, out: &mut Ahead) {
        let arrival: &Vec<Dual<M>> = motion.downcast_ref().expect(FOREIGN_ROOM);
        self.work.borrow_mut().along.ahead_along(t, arrival, out);
    }
}

/// Panic message for a workspace of another plant.
const FOREIGN_ROOM: &str = "a room made by a source along the same plant";

impl<E: Equations, const M: usize> Predict for Source<E, M> {
    fn flow(&self, x: &mut [f64], u: &[f64], duration: f64) {
        moved(&mut self.work.borrow_mut().flow, &mut x[..self.states], u, duration, SUBSTEPS);
    }

    fn ahead(&self, t: f64, x: &[f64], u: &[f64], duration: f64, out: &mut Ahead) {
        self.work.borrow_mut().along.ahead_held(t, [&x[..self.states], u], duration, self.n, out);
    }

    fn ahead_of_row(&self, t: f64, x: &[f64], u: &[f64], duration: f64, out: &mut Ahead) {
        self.work.borrow_mut().along.ahead_held(t, [&x[..self.states], u], duration, self.n - 1, out);
    }

    fn values_ahead(
        &self,
        t: f64,
        x: &[f64],
        u: &[f64],
        duration: f64,
        out: &mut [f64; MAX_RELATIVE_DEGREE + 1],
    ) {
        self.work.borrow_mut().values.values_ahead(t, [&x[..self.states], u], duration, self.n, out);
    }

    fn values_of_row(
        &self,
        t: f64,
        x: &[f64],
        u: &[f64],
        duration: f64,
        out: &mut [f64; MAX_RELATIVE_DEGREE + 1],
    ) {
        self.work.borrow_mut().values.values_ahead(t, [&x[..self.states], u], duration, self.n - 1, out);
    }

    fn rate(&self, x: &[f64], u: &[f64], out: &mut [f64]) {
        let (own, others) = out.split_at_mut(self.states);
        rates_at(&mut self.work.borrow_mut().held.value.flow, &x[..self.states], u, own);
        others.fill(0.0);
    }

    fn path(&self, x: &[f64], u: &[f64], out: &mut [Expansion]) {
        let path = &mut self.work.borrow_mut().path;
        path.flow.set_state(x[..self.states].iter().copied());
        path.flow.hold(u.iter().copied());
        path.continue_from_flow(0.0, path.n);
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
        let expansions = &mut self.work.borrow_mut().held.value;
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
        let few_over = &mut self.work.borrow_mut().held.few_over;
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
        let few_over = &mut self.work.borrow_mut().held.few_over;
        let mut at = |time| few_over.follow(time, |i, _| Interval::from(x[i]));
        // If time is not used, both results have the same bits.
        let is_still = at(Interval::ALL) == at(Interval::from(0.0));
        few_over.equations.encloses()[1].then_some(is_still)
    }

    fn lowest_held(&self, t: f64, x: &[f64], u: &[f64], duration: f64, wanted: f64) -> Option<f64> {
        self.work.borrow_mut().held.lowest(t, &x[..self.states], u, duration, wanted)
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
        write(out, self.n, self.inputs, |k| along.derivative(k).directional);
    }
}
