//! Maps the number of a run to its seed and its point in the unit cube. Both depend only on (seed, runs,
//! kind, dimensions, number), so any run can be drawn without those before it.
//!
//! All random numbers come from ChaCha8 keyed by the campaign's seed. Stream k belongs to run k. The streams
//! from [`SHARED`] on are shared by all runs.

use punctual_fmu::configuration::ConfigurationError;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use serde::Deserialize;

use super::sobol::{DIMENSIONS, Sobol};

/// Ways to spread points over the unit cube.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Sampling {
    /// Independently.
    #[default]
    Random,
    /// With one point in each of `runs` equal slices of each variable, in an order of its own: M. D. McKay,
    /// R. J. Beckman and W. J. Conover, Technometrics 21 (1979), doi 10.1307/1268522.
    LatinHypercube,
    /// The Sobol sequence with a random digital shift.
    Sobol,
}

/// The first stream of a [`Sequence`]; the streams of the runs are below it.
const SEQUENCES: u64 = 1 << 62;
/// The first stream that all runs share.
const SHARED: u64 = 1 << 63;
/// Streams that one dimension may use.
const PER_DIMENSION: u64 = 16;
/// Rounds of the permutation: four make a Feistel network a pseudorandom permutation (M. Luby and C. Rackoff,
/// SIAM J. Comput. 17, 1988).
const ROUNDS: u64 = 4;
/// The greatest number of runs. Up to it, doubles hold run numbers and seeds exactly.
pub(super) const MAX_RUNS: u64 = 1 << 53;
/// The greatest number of runs of a Sobol sequence.
const MAX_SOBOL_RUNS: u64 = 1 << 32;

/// Draws the points of a campaign.
#[derive(Clone, Debug)]
pub struct Sampler {
    rng: ChaCha8Rng,
    runs: u64,
    dimensions: Vec<Dimension>,
}

/// Ways to compute one coordinate.
#[derive(Clone, Debug)]
enum Dimension {
    Random,
    Slice { first_stream: u64 },
    Sobol { sobol: Sobol, shift: u32 },
}

impl Sampler {
    /// A sampler of `runs` points with `dimensions` coordinates.
    ///
    /// # Errors
    ///
    /// Too many runs or dimensions for the kind of sampling.
    pub fn new(kind: Sampling, seed: u64, runs: u64, dimensions: usize) -> Result<Self, ConfigurationError> {
        let most = if kind == Sampling::Sobol { MAX_SOBOL_RUNS } else { MAX_RUNS };
        if runs == 0 || runs > most {
            let message = format!("is {runs}, must be from 1 to {most}");
            return Err(ConfigurationError::new("campaign.runs", message));
        }
        if kind == Sampling::Sobol && dimensions > DIMENSIONS {
            let message = format!(
                "is \"sobol\" with {dimensions} variables to vary, must be at most {DIMENSIONS}; \
                 \"latin_hypercube\" and \"random\" take any number"
            );
            return Err(ConfigurationError::new("campaign.sampling", message));
        }
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let dimension = |d: usize| {
            let first_stream = SHARED + d as u64 * PER_DIMENSION;
            match kind {
                Sampling::Random => Dimension::Random,
                Sampling::LatinHypercube => Dimension::Slice { first_stream },
                Sampling::Sobol => {
                    rng.set_stream(first_stream);
                    rng.set_word_pos(0);
                    let shift = rng.next_u32();
                    Sobol::new(d).map_or(Dimension::Random, |sobol| Dimension::Sobol { sobol, shift })
                }
            }
        };
        let dimensions = (0..dimensions).map(dimension).collect();
        Ok(Self { rng, runs, dimensions })
    }

    /// The seed of run `number`, below 2⁵³, and its point, written to `point`: each coordinate in (0, 1).
    pub fn draw(&self, number: u64, point: &mut Vec<f64>) -> u64 {
        let mut rng = self.rng.clone();
        rng.set_stream(number);
        rng.set_word_pos(0);
        let seed = seed(rng.next_u64());
        point.clear();
        for dimension in &self.dimensions {
            let fine = unit(rng.next_u64());
            point.push(match dimension {
                Dimension::Random => fine,
                Dimension::Slice { first_stream } => {
                    let slice = self.permuted(number, *first_stream);
                    below_one((slice as f64 + fine) / self.runs as f64)
                }
                Dimension::Sobol { sobol, shift } => {
                    let place = sobol.coordinate(number) ^ shift;
                    below_one((f64::from(place) + fine) / MAX_SOBOL_RUNS as f64)
                }
            });
        }
        seed
    }

    /// The position of `number` in a random permutation of the runs. A Feistel network over the next even
    /// number of bits is iterated until the result is the number of a run.
    fn permuted(&self, number: u64, first_stream: u64) -> u64 {
        let bits = u64::BITS - (self.runs - 1).leading_zeros();
        let half = bits.div_ceil(2).max(1);
        let mask = (1_u64 << half) - 1;
        let mut rng = self.rng.clone();
        let mut place = number;
        loop {
            let (mut left, mut right) = (place >> half, place & mask);
            for round in 0..ROUNDS {
                rng.set_stream(first_stream + round);
                rng.set_word_pos(2 * u128::from(right));
                (left, right) = (right, left ^ (rng.next_u64() & mask));
            }
            place = left << half | right;
            if place < self.runs {
                return place;
            }
        }
    }
}

/// Random numbers that belong to no single run.
pub(super) struct Sequence(ChaCha8Rng);

impl Sequence {
    /// The sequence `number` < 2⁶² under `seed`.
    pub(super) fn new(seed: u64, number: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(SEQUENCES + number);
        Self(rng)
    }

    /// The next number in (0, 1).
    pub(super) fn unit(&mut self) -> f64 {
        unit(self.0.next_u64())
    }

    /// The next seed, below 2⁵³.
    pub(super) fn seed(&mut self) -> u64 {
        seed(self.0.next_u64())
    }
}

/// A seed of 53 bits, as many as a double holds exactly.
fn seed(bits: u64) -> u64 {
    bits >> 11
}

/// A number in (0, 1) from 52 bits; the ends are never drawn.
fn unit(bits: u64) -> f64 {
    ((bits >> 12) as f64 + 0.5) / (1_u64 << 52) as f64
}

/// Guards against rounding up to 1 at the end of the last slice.
fn below_one(u: f64) -> f64 {
    u.min(1.0 - f64::EPSILON / 2.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(kind: Sampling, seed: u64, runs: u64, dimensions: usize) -> Vec<(u64, Vec<f64>)> {
        let sampler = Sampler::new(kind, seed, runs, dimensions).unwrap();
        let point = |k| {
            let mut point = Vec::new();
            (sampler.draw(k, &mut point), point)
        };
        (0..runs).map(point).collect()
    }

    #[test]
    fn points_lie_in_the_open_cube_and_depend_on_the_seed() {
        for kind in [Sampling::Random, Sampling::LatinHypercube, Sampling::Sobol] {
            let all = points(kind, 1, 1000, 3);
            assert!(all.iter().all(|(seed, p)| *seed < MAX_RUNS && p.iter().all(|u| *u > 0.0 && *u < 1.0)));
            assert_eq!(all, points(kind, 1, 1000, 3));
            assert_ne!(all, points(kind, 2, 1000, 3));
            for d in 0..3 {
                // The standard deviation is 1/√(12·1000) = 0.009 for independent points; the bound is five of
                // these.
                let mean = all.iter().map(|(_, p)| p[d]).sum::<f64>() / 1000.0;
                assert!((mean - 0.5).abs() < 0.046, "{kind:?}, {d}: {mean}");
            }
            let product = all.iter().map(|(_, p)| (p[0] - 0.5) * (p[1] - 0.5)).sum::<f64>() / 1000.0;
            // The standard deviation is 1/(12·√1000) = 0.0026 for independent coordinates; the bound is five
            // of these.
            assert!(product.abs() < 0.013, "{kind:?}: coordinates depend on each other, {product}");
        }
    }

    #[test]
    fn a_latin_hypercube_has_one_point_in_each_slice() {
        for runs in [1, 2, 3, 100, 1023, 1025] {
            let all = points(Sampling::LatinHypercube, 5, runs, 2);
            for d in 0..2 {
                let mut slices: Vec<u64> = all.iter().map(|(_, p)| (p[d] * runs as f64) as u64).collect();
                slices.sort_unstable();
                assert_eq!(slices, (0..runs).collect::<Vec<_>>(), "{runs} runs, dimension {d}");
            }
        }
    }

    #[test]
    fn shifted_sobol_points_stay_stratified() {
        let all = points(Sampling::Sobol, 9, 1024, 2);
        let mut seen = vec![false; 1024];
        all.iter().for_each(|(_, p)| seen[(p[0] * 32.0) as usize * 32 + (p[1] * 32.0) as usize] = true);
        assert!(seen.iter().all(|s| *s));
    }

    /// Recorded campaigns are replayed from these numbers, so an update of a crate must not change them.
    #[test]
    fn the_streams_stay_what_they_are() {
        let mut point = Vec::new();
        let sampler = Sampler::new(Sampling::Random, 42, 10, 2).unwrap();
        assert_eq!(sampler.draw(3, &mut point), 3_257_826_660_146_123);
        assert_eq!(point, [0.592_416_697_583_587_7, 0.730_100_300_761_319_9]);
    }

    #[test]
    fn limits_are_told() {
        let message = |kind, runs, dimensions| {
            Sampler::new(kind, 0, runs, dimensions).map(|_| ()).unwrap_err().to_string()
        };
        assert_eq!(
            message(Sampling::Random, 0, 1),
            "campaign.runs: is 0, must be from 1 to 9007199254740992"
        );
        assert_eq!(
            message(Sampling::Sobol, MAX_SOBOL_RUNS + 1, 1),
            "campaign.runs: is 4294967297, must be from 1 to 4294967296"
        );
        assert!(message(Sampling::Sobol, 1, 22).contains("with 22 variables to vary, must be at most 21"));
    }
}
