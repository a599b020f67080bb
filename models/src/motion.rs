//! The motion of a plant, and the series of a barrier along it. A tape or foreign code performs the
//! operations.

use alloc::vec;
use alloc::vec::Vec;

use punctual_core::MAX_RELATIVE_DEGREE;
use punctual_core::internal::{self, SUBSTEPS};
use punctual_core::interval::Interval;
use punctual_core::jet::Dual;
use punctual_core::lie::{Ahead, Derivatives};
use punctual_core::scalar::Scalar;

use crate::operation::Register;
use crate::series::Series;

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

/// The motion of a plant: registers, and the stages of the Runge–Kutta method.
pub(crate) struct Flow<E, C> {
    pub(crate) equations: E,
    pub(crate) series: Series<C>,
    pub(crate) start: Vec<C>,
    stages: [Vec<C>; 4],
}

impl<E: Equations, C: Scalar> Flow<E, C> {
    pub(crate) fn new(equations: &E) -> Self {
        let zeros = || vec![C::zero(); equations.states()];
        Self {
            equations: equations.clone(),
            series: equations.series(1),
            start: zeros(),
            stages: [zeros(), zeros(), zeros(), zeros()],
        }
    }

    pub(crate) fn inputs(&self) -> core::ops::Range<Register> {
        let first = self.equations.states();
        first..first + self.equations.inputs()
    }

    pub(crate) fn set_state(&mut self, x: impl Iterator<Item = C>) {
        for (i, value) in x.enumerate() {
            self.series.set(i, 0, value);
        }
    }

    pub(crate) fn state(&self, i: usize) -> C {
        self.series.get(i, 0)
    }

    pub(crate) fn hold(&mut self, u: impl Iterator<Item = C>) {
        for (register, value) in self.inputs().zip(u) {
            self.series.set(register, 0, value);
        }
    }

    /// Moves the state as the predictions of [`lie`](punctual_core::lie) do: in one step if that suffices.
    pub(crate) fn predict(&mut self, duration: f64) {
        self.run(duration, 1);
        if !internal::is_even(self.stages.each_ref().map(Vec::as_slice)) {
            for (i, &start) in self.start.iter().enumerate() {
                self.series.set(i, 0, start);
            }
            self.run(duration, SUBSTEPS);
        }
    }

    /// Moves the state with the method of [`flow`](punctual_core::lie::flow), in the same order of additions.
    pub(crate) fn run(&mut self, duration: f64, steps: usize) {
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

pub(crate) fn moved<E: Equations>(
    flow: &mut Flow<E, f64>,
    x: &mut [f64],
    u: &[f64],
    duration: f64,
    steps: usize,
) {
    flow.set_state(x.iter().copied());
    flow.hold(u.iter().copied());
    flow.run(duration, steps);
    for (i, x) in x.iter_mut().enumerate() {
        *x = flow.state(i);
    }
}

/// Writes ẋ at `x` under `u`.
pub(crate) fn rates_at<E: Equations>(flow: &mut Flow<E, f64>, x: &[f64], u: &[f64], out: &mut [f64]) {
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
pub(crate) struct Along<E, C> {
    pub(crate) flow: Flow<E, C>,
    pub(crate) equations: E,
    pub(crate) series: Series<C>,
    pub(crate) h: Register,
    pub(crate) n: usize,
}

impl<E: Equations, C: Scalar> Along<E, C> {
    pub(crate) fn new(plant: &E, along: &E, n: usize) -> Self {
        let mut series = along.series(n + 1);
        // Time has slope 1; inputs are held.
        if n > 0 {
            series.set(along.states() + along.inputs(), 1, C::from(1.0));
        }
        Self { flow: Flow::new(plant), equations: along.clone(), series, h: 0, n }
    }

    /// Computes the coefficients of h up to `n` from the state and the inputs of `flow`, at time `t`.
    pub(crate) fn continue_from_flow(&mut self, t: f64, n: usize) {
        let (series, flow) = (&mut self.series, &self.flow);
        let time = flow.inputs().end;
        for register in 0..time {
            series.set(register, 0, flow.series.get(register, 0));
        }
        series.set(time, 0, C::from(t));
        for k in 0..n {
            self.equations.advance(series, k);
            for i in 0..self.equations.states() {
                let slope = series.get(self.equations.derivative(i), k);
                series.set(i, k + 1, slope * (1.0 / (k + 1) as f64));
            }
        }
        self.h = self.equations.finish(series, n);
    }

    /// h⁽ᵏ⁾.
    pub(crate) fn derivative(&self, k: usize) -> C {
        self.series.get(self.h, k) * (1..=k).map(|i| i as f64).product::<f64>()
    }

    /// Computes the coefficients of h from those of the states, at time `t`, and returns h.
    pub(crate) fn follow(&mut self, t: C, state: impl Fn(usize, usize) -> C) -> C {
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
    pub(crate) fn ahead(&mut self, t: f64, duration: f64) {
        self.flow.run(duration, SUBSTEPS);
        self.continue_from_flow(t + duration, self.n);
    }
}

/// With derivatives along `M` directions, at least as many as inputs.
impl<E: Equations, const M: usize> Along<E, Dual<M>> {
    pub(crate) fn hold(&mut self, u: impl Fn(usize) -> f64) {
        self.flow.hold((0..M).map(|i| Dual::variable(u(i), i)));
    }

    /// Moves from the state `x` under the held input `u`.
    pub(crate) fn arrive(&mut self, x: &[f64], u: &[f64], duration: f64) {
        self.flow.set_state(x.iter().map(|&v| Dual::from(v)));
        self.hold(|i| u.get(i).copied().unwrap_or_default());
        self.flow.predict(duration);
    }

    /// Computes the coefficients from the state `x` at time `t`, along the free motion.
    pub(crate) fn evaluate(&mut self, t: f64, x: &[f64]) {
        self.evaluate_at(t, x, |_| 0.0);
    }

    pub(crate) fn evaluate_at(&mut self, t: f64, x: &[f64], u: impl Fn(usize) -> f64) {
        self.flow.set_state(x.iter().map(|&v| Dual::from(v)));
        self.hold(u);
        self.continue_from_flow(t, self.n);
    }

    /// Writes what [`DerivativeSource::evaluate`](punctual_core::lie::DerivativeSource::evaluate) does.
    pub(crate) fn derivatives(&mut self, t: f64, x: &[f64], out: &mut Derivatives) {
        self.evaluate(t, x);
        write_derivatives(out, self.n, self.equations.inputs(), |k| self.derivative(k));
    }

    /// Writes what [`Predict::ahead`](punctual_core::lie::Predict::ahead) does for k ≤ `n`.
    pub(crate) fn ahead_held(
        &mut self,
        t: f64,
        [x, u]: [&[f64]; 2],
        duration: f64,
        n: usize,
        out: &mut Ahead,
    ) {
        self.arrive(x, u, duration);
        self.continue_from_flow(t + duration, n);
        write(out, n, self.equations.inputs(), |k| self.derivative(k));
    }

    /// Writes the states and inputs `duration` s after `x`, with their derivatives along the inputs.
    pub(crate) fn motion_ahead(&mut self, x: &[f64], u: &[f64], duration: f64, arrival: &mut [Dual<M>]) {
        self.arrive(x, u, duration);
        for (register, value) in arrival.iter_mut().enumerate() {
            *value = self.flow.series.get(register, 0);
        }
    }

    /// Writes what [`Self::ahead_held`] does for k < n, from the `arrival` at time `t`.
    pub(crate) fn ahead_along(&mut self, t: f64, arrival: &[Dual<M>], out: &mut Ahead) {
        self.flow.set_state(arrival.iter().copied());
        self.continue_from_flow(t, self.n - 1);
        write(out, self.n - 1, self.equations.inputs(), |k| self.derivative(k));
    }
}

impl<E: Equations> Along<E, f64> {
    /// Writes the values that [`Along::ahead_held`] does for k ≤ `n`, with the same bits.
    pub(crate) fn values_ahead(
        &mut self,
        t: f64,
        [x, u]: [&[f64]; 2],
        duration: f64,
        n: usize,
        out: &mut [f64; MAX_RELATIVE_DEGREE + 1],
    ) {
        self.flow.set_state(x.iter().copied());
        self.flow.hold(u.iter().copied());
        self.flow.predict(duration);
        self.continue_from_flow(t + duration, n);
        *out = core::array::from_fn(|k| if k <= n { self.derivative(k) } else { 0.0 });
    }
}

/// Writes the derivatives up to `n` of the free motion, and the row of the last.
pub(crate) fn write_derivatives<const M: usize>(
    out: &mut Derivatives,
    n: usize,
    inputs: usize,
    derivative: impl Fn(usize) -> Dual<M>,
) {
    *out = Derivatives::ZERO;
    for k in 0..=n {
        let Dual { value, gradient } = derivative(k);
        out.drift[k] = value;
        if k == n {
            out.row[..inputs].copy_from_slice(&gradient[..inputs]);
        } else {
            // A sum rather than a maximum, since `f64::max` would drop a NaN.
            out.lower_sensitivity += gradient.iter().map(|d| d.abs()).sum::<f64>();
        }
    }
}

/// Writes the derivatives up to `n`, each with its gradient along the inputs.
pub(crate) fn write<const M: usize>(
    out: &mut Ahead,
    n: usize,
    inputs: usize,
    derivative: impl Fn(usize) -> Dual<M>,
) {
    *out = Ahead::ZERO;
    for k in 0..=n {
        let Dual { value, gradient } = derivative(k);
        out.value[k] = value;
        out.gradient[k][..inputs].copy_from_slice(&gradient[..inputs]);
    }
}

/// A bound on h while an input is held.
pub(crate) struct Held<E> {
    pub(crate) value: Along<E, f64>,
    /// For enclosures of h, and of h with its rate.
    pub(crate) few_over: Along<E, Interval>,
    /// Enclosures of the states and their rates, and the rates at the start.
    states: Vec<[Interval; 2]>,
    rate: Vec<f64>,
}

impl<E: Equations> Held<E> {
    /// `of_value` has the operations of the barrier that its value takes.
    pub(crate) fn new(plant: &E, of_value: &E) -> Self {
        Self {
            value: Along::new(plant, of_value, 0),
            few_over: Along::new(plant, of_value, 1),
            states: vec![[Interval::ALL; 2]; plant.states()],
            rate: vec![0.0; plant.states()],
        }
    }

    /// What [`lowest_held`](punctual_core::lie::Predict::lowest_held) returns.
    pub(crate) fn lowest(&mut self, t: f64, x: &[f64], u: &[f64], duration: f64, wanted: f64) -> Option<f64> {
        let Self { value, few_over, states: held, rate } = self;
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
}
