//! The motion of a plant that deviates from its model within what a filter declares. What is drawn is a function of seed,
//! signal and time alone, as of a disturbance.

use punctual_core::elementary;
use punctual_core::filter::Filter;

use super::disturbance::uniform;
use crate::configuration::{ConfigurationError, Deviation, DeviationKind, UNBOUNDED};

/// Part of an interval by which the time may fall short of its start, for round-off in the importer's time.
const ROUND_OFF: f64 = 1e-6;
/// The shortest step of a plant whose steps are drawn, as a part of the usual one; and the most inputs that it remembers.
const SHORTEST: f64 = 0.2;
const MOST_ASKED: f64 = 2000.0;
/// The longest time for which a deviation stays as it is, if it changes, in steps.
const LONGEST: f64 = 500.0;

/// What deviates. Each has its own sequence.
#[derive(Clone, Copy)]
enum Of {
    Rate = 11,
    Gain = 12,
    Lag = 13,
    Error = 14,
    Step = 15,
}

/// What is drawn once for each sequence.
#[derive(Clone, Copy)]
enum Facet {
    /// How it changes.
    Way = 1,
    /// How long a value lasts.
    Period = 2,
    /// Which values it has.
    Value = 3,
}

/// A deviating plant.
pub(super) struct Deviating {
    of: Deviation,
    /// Evaluates the barriers.
    filter: Filter,
    /// Bounds of the inputs.
    bounds: Vec<[f64; 2]>,
    /// What has arrived of each input; then the inputs that were asked, the oldest first, each after the time in s at which it
    /// begins to act.
    memory: Vec<f64>,
    /// Buffer: the same within the step.
    next: Vec<f64>,
    /// When the step began, in s.
    begun: f64,
    /// The least h of each barrier over the last step, its ends included; before the first step, h at the start.
    least: Vec<f64>,
    h: Vec<f64>,
}

impl Deviating {
    pub(super) fn new(of: &Deviation) -> Result<Self, ConfigurationError> {
        let filter = of.filter.build()?;
        let limits = |name: &str| of.filter.bounds.get(name).copied();
        let inputs = of.filter.plant.inputs();
        let bounds = inputs.iter().map(|i| limits(&i.name).unwrap_or([-UNBOUNDED, UNBOUNDED])).collect();
        let barriers = vec![0.0; of.filter.barrier.len()];
        let mut new = Self {
            of: of.clone(),
            filter,
            bounds,
            memory: Vec::new(),
            next: Vec::new(),
            begun: 0.0,
            least: barriers.clone(),
            h: barriers,
        };
        new.memory = new.rest();
        new.next.clone_from(&new.memory);
        Ok(new)
    }

    /// What acts before the first step: the admissible input nearest 0, asked and arrived.
    fn rest(&self) -> Vec<f64> {
        // Not `clamp`, which panics if the bounds contradict each other.
        let rest: Vec<f64> = self.bounds.iter().map(|[min, max]| 0.0_f64.max(*min).min(*max)).collect();
        let asked = (self.of.delay / (SHORTEST * self.of.step)).min(MOST_ASKED) as usize + 2;
        let always = core::iter::once(f64::MIN).chain(rest.iter().copied());
        let asked = core::iter::repeat_n(always, asked).flatten();
        rest.iter().copied().chain(asked).collect()
    }

    /// Returns to before the first step, in the state `x` at time `t` (s).
    pub(super) fn begin(&mut self, t: f64, x: &[f64]) {
        self.memory = self.rest();
        self.least.fill(f64::INFINITY);
        self.see(t, x);
    }

    /// What is remembered of the inputs.
    pub(super) fn memory(&self) -> &[f64] {
        &self.memory
    }

    pub(super) fn restore(&mut self, memory: &[f64]) {
        self.memory.copy_from_slice(memory);
    }

    /// The least h of each barrier over the last step.
    pub(super) fn least(&self) -> &[f64] {
        &self.least
    }

    /// Counts in h at the state `x` at time `t` (s).
    fn see(&mut self, t: f64, x: &[f64]) {
        // The lengths match by construction. What is no number is no h that is kept.
        if self.filter.barrier_values(t, x, &mut self.h).is_err() {
            self.h.fill(f64::NEG_INFINITY);
        }
        for (least, h) in self.least.iter_mut().zip(&self.h) {
            *least = if h.is_nan() { f64::NEG_INFINITY } else { least.min(*h) };
        }
    }

    /// Begins a step from the state `x` at time `t` (s).
    pub(super) fn begin_step(&mut self, t: f64, x: &[f64]) {
        self.next.copy_from_slice(&self.memory);
        self.begun = t;
        self.least.fill(f64::INFINITY);
        self.see(t, x);
    }

    /// Ends a step under the inputs `u` that were asked, and remembers it.
    pub(super) fn end_step(&mut self, u: &[f64]) {
        std::mem::swap(&mut self.memory, &mut self.next);
        let (_, asked) = self.memory.split_at_mut(u.len());
        asked.rotate_left(1 + u.len());
        let last = asked.len() - u.len();
        asked[last - 1] = self.begun + self.of.delay;
        asked[last..].copy_from_slice(u);
    }

    /// Moves the state `x` for `dt` s from the time `t` (s) under the inputs `u` that are asked in the step. `advance` is the
    /// motion of the model under an input.
    pub(super) fn advance(
        &mut self,
        (t, dt): (f64, f64),
        u: &[f64],
        x: &mut [f64],
        acting: &mut [f64],
        advance: impl FnOnce(&mut [f64], &[f64]) -> Result<(), punctual_core::Error>,
    ) -> Result<(), punctual_core::Error> {
        let (inputs, middle) = (u.len(), t + 0.5 * dt);
        let (_, asked) = self.memory.split_at(inputs);
        let before = asked.chunks_exact(1 + inputs).rfind(|asked| asked[0] <= middle);
        let is_late = middle < self.begun + self.of.delay;
        for i in 0..inputs {
            let asked = before.filter(|_| is_late).map_or(u[i], |asked| asked[1 + i]);
            let within = |[low, high]: [f64; 2], side: f64| 0.5 * (low + high) + 0.5 * (high - low) * side;
            let lag = within(self.of.lags[i], self.drawn(Of::Lag, i, middle));
            // What arrives follows for half of the time before the input in its middle, and for half after it.
            let follow = if lag > 0.0 { elementary::exp(-0.5 * dt / lag) } else { 0.0 };
            let arrived = asked + (self.next[i] - asked) * follow;
            self.next[i] = asked + (arrived - asked) * follow;
            acting[i] = within(self.of.gains[i], self.drawn(Of::Gain, i, middle)) * arrived;
        }
        // Half of what is added to the rates before the motion of the model, half after it.
        let push = |x: &mut [f64]| {
            for (i, x) in x.iter_mut().enumerate() {
                *x += 0.5 * dt * self.of.rates[i] * self.drawn(Of::Rate, i, middle);
            }
        };
        push(x);
        advance(x, acting)?;
        push(x);
        self.see(t + dt, x);
        Ok(())
    }

    /// Adds to the measurements `x` at time `t` (s) their errors.
    pub(super) fn err(&self, t: f64, x: &mut [f64]) {
        for (i, x) in x.iter_mut().enumerate() {
            if self.of.errors[i] != 0.0 {
                *x += self.of.errors[i] * self.drawn(Of::Error, i, t);
            }
        }
    }

    /// Where in what is declared the signal `i` is at time `t` (s), −1 to 1.
    fn drawn(&self, of: Of, i: usize, t: f64) -> f64 {
        drawn((self.of.seed, self.of.kind, self.of.step), (of, i), t)
    }
}

impl Deviation {
    /// How late step `k` of a run is within what is declared, as `seed` and `kind` draw it: 1 as late as it may be, −1 as early.
    pub fn lateness(seed: f64, kind: f64, k: u64) -> f64 {
        drawn((seed, kind, 1.0), (Of::Step, 0), k as f64)
    }
}

/// Where in what is declared a signal is at time `t` (s), −1 to 1, for a seed, a kind and a step (s).
fn drawn((seed, kind, step): (f64, f64, f64), (of, i): (Of, usize), t: f64) -> f64 {
    let number = |facet: Facet, interval: f64| {
        let signal = (of as u64) << 32 | i as u64;
        uniform([seed.to_bits(), signal, facet as u64, interval.to_bits()])
    };
    if kind == f64::from(DeviationKind::Constant as u8) {
        return number(Facet::Value, 0.0);
    }
    // The time that a value lasts, between a step and the longest, any order of magnitude alike.
    let part = 0.5 * (number(Facet::Period, 0.0) + 1.0);
    let lasts = step * elementary::powf(LONGEST, part);
    let way = number(Facet::Way, 0.0);
    let interval = |lasts: f64| (t / lasts + ROUND_OFF).floor();
    if kind == f64::from(DeviationKind::Changing as u8) {
        return number(Facet::Value, interval(lasts));
    }
    let sign = |value: f64| if value < 0.0 { -1.0 } else { 1.0 };
    match way {
        // Always at the same end.
        way if way < -0.4 => sign(number(Facet::Value, 0.0)),
        // In turn; the half of these from one sample to the next.
        way if way < 0.4 => {
            let lasts = if way < 0.0 { step } else { lasts };
            sign(number(Facet::Value, 0.0)) * if interval(lasts).rem_euclid(2.0) < 1.0 { 1.0 } else { -1.0 }
        }
        // By chance.
        _ => sign(number(Facet::Value, interval(lasts))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::configuration::{Configuration, FilterConfiguration};
    use crate::instance::Instance;
    use crate::product::Product;

    const FILTER: &str = r#"
kind = "filter"
plant.model = "point_mass"
bounds = { u_x = [-4.0, 4.0], u_y = [-4.0, 4.0] }
experiment.step_size = 0.1
MORE
[[barrier]]
name = "goal"
centre = [8.0, 3.0]
radius = 2.0
deadline = 6.0
"#;
    const STEP: f64 = 0.1;
    const INNER: f64 = 0.001;

    fn filter(more: &str) -> FilterConfiguration {
        match Configuration::parse(&FILTER.replace("MORE", more)).unwrap() {
            Configuration::Filter(filter) => filter,
            other => panic!("{}", other.kind()),
        }
    }

    fn deviation(more: &str, kind: DeviationKind, seed: f64, late: f64) -> Deviation {
        Deviation { kind: f64::from(kind as u8), seed, ..Deviation::of(&filter(more), STEP, late) }
    }

    const DECLARED: &str = "uncertainty = { rates = { x_p = 0.1, v_x = 0.3 }, inputs.u_x = { gain = [0.5, 0.9], lag = [0.0, 0.2] } }\n\
                            measurement_errors = { v_y = 0.25 }";

    /// The state after each of these steps under `u`, from rest at the origin.
    fn moved(of: &Deviation, u: [f64; 2], steps: usize) -> Vec<[f64; 4]> {
        let (mut deviating, plant) = (Deviating::new(of).unwrap(), of.filter.plant.build().unwrap());
        let (mut x, mut acting) = ([0.0; 4], [0.0; 2]);
        deviating.begin(0.0, &x);
        let one = |k: usize| {
            let t = STEP * k as f64;
            deviating.begin_step(t, &x);
            for part in 0..100 {
                let now = t + INNER * f64::from(part);
                let advance = |x: &mut [f64], u: &[f64]| plant.rk4_step(x, u, INNER);
                deviating.advance((now, INNER), &u, &mut x, &mut acting, advance).unwrap();
            }
            deviating.end_step(&u);
            x
        };
        (0..steps).map(one).collect()
    }

    #[test]
    fn what_is_drawn_stays_within_its_limits_and_reaches_them() {
        for kind in DeviationKind::ALL {
            let (mut least, mut most, mut changes) = (1.0_f64, -1.0_f64, 0);
            for seed in 0..40 {
                let of = Deviating::new(&deviation(DECLARED, kind, f64::from(seed), 0.0)).unwrap();
                let values: Vec<f64> = (0..300).map(|k| of.drawn(Of::Rate, 2, STEP * f64::from(k))).collect();
                assert!(values.iter().all(|value| (-1.0..=1.0).contains(value)), "{kind:?}, {seed}");
                if kind == DeviationKind::Corners {
                    assert!(values.iter().all(|value| value.abs() == 1.0), "{seed}: {values:?}");
                }
                least = values.iter().fold(least, |least, value| least.min(*value));
                most = values.iter().fold(most, |most, value| most.max(*value));
                changes += usize::from(values.windows(2).any(|two| two[0] != two[1]));
            }
            // Of 40 uniform numbers none is beyond 0.8 at one side in 1.5 % of all cases.
            assert!(least < -0.8 && most > 0.8, "{kind:?}: {least} to {most}");
            match kind {
                DeviationKind::Constant => assert_eq!(changes, 0),
                DeviationKind::Changing => assert!(changes > 30, "{changes}"),
                // Some are always at one end.
                DeviationKind::Corners => assert!((10..40).contains(&changes), "{changes}"),
            }
        }
    }

    /// A double integrator under a constant input, part and rates: v = (g u + w_v) t, p = w_p t + (g u + w_v) t²/2.
    #[test]
    fn gains_and_rates_move_the_plant() {
        let without_lag = DECLARED.replace(", lag = [0.0, 0.2]", "");
        let of = deviation(&without_lag, DeviationKind::Constant, 5.0, 0.0);
        let drawn = Deviating::new(&of).unwrap();
        let rate = |i: usize| of.rates[i] * drawn.drawn(Of::Rate, i, 0.0);
        let gain = 0.7 + 0.2 * drawn.drawn(Of::Gain, 0, 0.0);
        let (pushed, t) = (gain * 2.0 + rate(2), 10.0 * STEP);
        let x = moved(&of, [2.0, -1.0], 10)[9];
        let wanted = [rate(0) * t + pushed * t * t / 2.0, -t * t / 2.0, pushed * t, -t];
        for (found, wanted) in x.iter().zip(wanted) {
            // Round-off of a thousand steps.
            assert!((found - wanted).abs() < 1e-12, "{x:?}, wanted {wanted:?}");
        }
        assert!(rate(2).abs() > 0.01 && (gain - 0.7).abs() > 0.01, "the seed draws something: {wanted:?}");
    }

    /// v = ∫ u(1 − e^(−s/τ)) ds = u (t − τ (1 − e^(−t/τ))).
    #[test]
    fn a_lag_follows_what_is_asked_from_rest() {
        let of = deviation("uncertainty.inputs.u_x.lag = [0.15, 0.15]", DeviationKind::Corners, 1.0, 0.0);
        for (k, x) in moved(&of, [2.0, 0.0], 5).into_iter().enumerate() {
            let t = STEP * (k + 1) as f64;
            let wanted = 2.0 * (t - 0.15 * (1.0 - (-t / 0.15).exp()));
            // The input in the middle of each inner step stands for that step: h²/24 of the second derivative, 2/0.15².
            assert!((x[2] - wanted).abs() < 1e-5, "{x:?} at {t}, wanted {wanted}");
        }
    }

    /// Until the delay has passed, inputs of steps before act, at first 0. What the coupling takes is no delay of the plant.
    #[test]
    fn a_delay_holds_the_inputs_before() {
        let of = deviation("actuation_delay = 0.04", DeviationKind::Corners, 1.0, 0.0);
        let x = moved(&of, [2.0, 0.0], 2);
        assert!((x[0][2] - 2.0 * 0.06).abs() < 1e-12 && (x[1][2] - 2.0 * 0.16).abs() < 1e-12, "{x:?}");
        // Two steps and a half.
        let of = deviation("actuation_delay = 0.25", DeviationKind::Corners, 1.0, 0.0);
        let x = moved(&of, [2.0, 0.0], 5);
        for (x, acted) in x.iter().zip([0.0, 0.0, 0.05, 0.15, 0.25]) {
            assert!((x[2] - 2.0 * acted).abs() < 1e-12, "{x:?}");
        }
        assert_eq!(deviation("actuation_delay = 0.1", DeviationKind::Corners, 1.0, 0.1).delay, 0.0);
        assert_eq!(deviation("actuation_delay = 0.1", DeviationKind::Corners, 1.0, 0.0).delay, 0.1);
    }

    /// Only the measurement errs. The least h is of the plant as it is, and a restored state goes on bit for bit.
    #[test]
    fn an_instance_errs_and_goes_on_from_a_saved_state() {
        let plant = match Configuration::parse("kind = \"plant\"\nplant.model = \"point_mass\"").unwrap() {
            Configuration::Plant(plant) => {
                plant.deviating(deviation(DECLARED, DeviationKind::Corners, 9.0, 0.0))
            }
            other => panic!("{}", other.kind()),
        };
        let product = Product::new(Configuration::Plant(plant.clone())).unwrap();
        let reference = |name: &str| {
            let found = product.variables.iter().find(|v| v.name == name);
            found.unwrap_or_else(|| panic!("no {name}")).value_reference
        };
        let mut instance = Instance::new(Configuration::Plant(plant), &product.guid).unwrap();
        let names = ["x.x_p", "x.v_x", "x.v_y", "least_h.goal"].map(reference);
        let read = |instance: &mut Instance| {
            let mut values = [0.0; 4];
            instance.get_real(&names, &mut values).unwrap();
            values
        };
        instance.setup_experiment(0.0, None).unwrap();
        instance.enter_initialization_mode().unwrap();
        instance.exit_initialization_mode().unwrap();
        let start = read(&mut instance);
        assert_eq!((start[0], start[2].abs()), (0.0, 0.25));
        // √(R² + s²) − √(d² + s²), rounded by the radius.
        assert!((start[3] - (8.0_f64.sqrt() - 77.0_f64.sqrt())).abs() < 1e-12, "{start:?}");
        let go = |instance: &mut Instance, k: u32| {
            instance.set_real(&["u.u_x", "u.u_y"].map(reference), &[1.0, 0.0]).unwrap();
            instance.do_step(STEP * f64::from(k), STEP).unwrap();
            read(instance).map(f64::to_bits)
        };
        let before: Vec<_> = (0..3).map(|k| go(&mut instance, k)).collect();
        let saved = instance.state();
        let after: Vec<_> = (3..6).map(|k| go(&mut instance, k)).collect();
        instance.restore(&saved).unwrap();
        assert_eq!((3..6).map(|k| go(&mut instance, k)).collect::<Vec<_>>(), after);
        assert_ne!(before, after);
        let mut fresh = saved;
        fresh.block = crate::block::BlockState::Plant { x: vec![0.0; 4] };
        assert!(instance.restore(&fresh).unwrap_err().contains("4 components, must have 12"));
    }
}
