//! Disturbances of a plant: pseudorandom numbers that depend only on seed, signal and time. Nothing is
//! remembered between steps, so a restored state continues bit for bit.

use crate::configuration::PlantConfiguration;

/// Fraction of a period by which the time may fall short of its start, to allow for round-off in the
/// importer's time.
const ROUND_OFF: f64 = 1e-6;

/// Noise on the inputs and measurements of a plant.
#[derive(Default)]
pub(super) struct Disturbance {
    period: f64,
    /// By input; empty if there is no disturbance.
    inputs: Vec<f64>,
    /// By state; empty if there is no disturbance.
    measurements: Vec<f64>,
}

/// The two kinds of signals, which have different sequences.
#[derive(Clone, Copy)]
enum Kind {
    Input = 1,
    Measurement = 2,
}

impl Disturbance {
    pub(super) fn new(configuration: &PlantConfiguration) -> Self {
        let Some(given) = &configuration.disturbance else { return Self::default() };
        let bounds = |bounds: &std::collections::BTreeMap<String, f64>, signals: Vec<_>| {
            let bound =
                |s: &crate::configuration::VariableSection| bounds.get(&s.name).copied().unwrap_or(0.0);
            signals.iter().map(bound).collect()
        };
        Self {
            period: given.period,
            inputs: bounds(&given.inputs, configuration.plant.inputs()),
            measurements: bounds(&given.measurements, configuration.plant.states()),
        }
    }

    /// Whether it changes the inputs.
    pub(super) fn affects_inputs(&self) -> bool {
        !self.inputs.is_empty()
    }

    /// Adds to the inputs `u` the disturbance at time `t` (s) under `seed`.
    pub(super) fn disturb(&self, seed: f64, t: f64, u: &mut [f64]) {
        self.add(Kind::Input, &self.inputs, seed, t, u);
    }

    /// Whether it changes the measurements.
    pub(super) fn affects_measurements(&self) -> bool {
        !self.measurements.is_empty()
    }

    /// Adds to the measurements `x` the disturbance at time `t` (s) under `seed`.
    pub(super) fn add_noise(&self, seed: f64, t: f64, x: &mut [f64]) {
        self.add(Kind::Measurement, &self.measurements, seed, t, x);
    }

    fn add(&self, kind: Kind, bounds: &[f64], seed: f64, t: f64, signals: &mut [f64]) {
        for (i, (bound, signal)) in bounds.iter().zip(signals).enumerate() {
            if *bound != 0.0 {
                let interval = (t / self.period + ROUND_OFF).floor();
                *signal += bound * uniform([seed.to_bits(), kind as u64, i as u64, interval.to_bits()]);
            }
        }
    }
}

/// A number in [−1, 1) that depends only on `key`.
pub(super) fn uniform(key: [u64; 4]) -> f64 {
    let bits = key.into_iter().fold(0, |state, word| mixed(state ^ word));
    // 53 bits, as many as a double has.
    (bits >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
}

/// One step of SplitMix64: G. L. Steele, D. Lea and C. H. Flood, *Fast splittable pseudorandom number generators*,
/// OOPSLA (2014), doi 10.1145/2660193.2660195.
fn mixed(state: u64) -> u64 {
    let z = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn example() -> Disturbance {
        Disturbance { period: 0.1, inputs: vec![2.0, 0.0], measurements: vec![0.5] }
    }

    #[test]
    fn numbers_are_uniform_and_of_one_time_each() {
        let disturbance = example();
        let at = |t: f64| {
            let mut u = [1.0, 1.0];
            disturbance.disturb(3.0, t, &mut u);
            u
        };
        let all: Vec<f64> = (0..10_000).map(|k| at(0.1 * f64::from(k))[0] - 1.0).collect();
        assert!(all.iter().all(|w| w.abs() <= 2.0));
        let mean = all.iter().sum::<f64>() / 1e4;
        let square = all.iter().map(|w| w * w).sum::<f64>() / 1e4;
        // A uniform number up to 2 has mean 0 and mean square 4/3. The mean of 10,000 of them has a standard
        // deviation of 0.012. The tolerance is five of these.
        assert!(mean.abs() < 0.06 && (square - 4.0 / 3.0).abs() < 0.06, "{mean}, {square}");
        let follow = all.windows(2).map(|w| w[0] * w[1]).sum::<f64>() / 1e4;
        assert!(follow.abs() < 0.07, "one tells of the next: {follow}");
        // An input without a disturbance bound keeps its value, and a disturbance lasts for its period.
        assert_eq!((at(0.35)[1], at(0.35)), (1.0, at(0.3)));
        assert_ne!(at(0.3), at(0.4));
        assert_eq!(at(-0.05), at(-0.1));
    }

    #[test]
    fn seeds_and_kinds_have_their_own_sequences() {
        let drawn = |seed: f64, noisy: bool| {
            let mut x = [0.0];
            let disturbance = example();
            if noisy {
                disturbance.add_noise(seed, 1.0, &mut x);
            } else {
                disturbance.disturb(seed, 1.0, &mut x);
            }
            x[0]
        };
        assert_ne!(drawn(1.0, false), drawn(2.0, false));
        assert_ne!(drawn(1.0, false), 4.0 * drawn(1.0, true));
        assert_eq!(drawn(1.0, true), drawn(1.0, true));
    }
}
