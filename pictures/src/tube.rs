//! The tube of a plan for an uncertain plant: where its path, h and the inputs may be.

use punctual_core::filter::Filter;
use punctual_core::plan::Tracking;
use punctual_cosim::error::Error;
use punctual_fmu::configuration::FilterConfiguration;

use crate::plot::{self, Band};

/// About how many holds of a plan are drawn.
const POINTS: f64 = 400.0;

/// The name of a tube in a legend.
const TUBE: &str = "tube";

/// The numbers of the holds that are drawn, out of `count`, with the last.
fn thinned(count: usize) -> Vec<usize> {
    let every = (count as f64 / POINTS).ceil().max(1.0) as usize;
    (0..count).filter(|k| k % every == 0 || k + 1 == count).collect()
}

/// The tube of a plan, as boxes around the reference at every sample.
pub struct PlanTube<'a> {
    tracking: &'a Tracking,
    /// The samples that are drawn.
    times: Vec<usize>,
    /// How far the plant may be from the reference at every sample, by state.
    halves: Vec<Vec<f64>>,
}

impl<'a> PlanTube<'a> {
    /// The tube of the plan with the law `tracking`, of the filter `c`.
    pub fn new(c: &FilterConfiguration, tracking: &'a Tracking) -> Self {
        let error = |name: &str| c.measurement_errors.get(name).copied().unwrap_or(0.0);
        let errors: Vec<f64> = c.plant.states().iter().map(|state| error(&state.name)).collect();
        // The radii are those of measurements, each of which adds an error of its own to the state. The first one is the reference,
        // and the state is within its error.
        let half = |(k, radii): (usize, &Vec<f64>)| {
            let by = |(radius, error): (&f64, &f64)| if k == 0 { *radius } else { (radius - error).max(0.0) };
            radii.iter().zip(&errors).map(by).collect()
        };
        let halves = tracking.radii().iter().enumerate().map(half).collect();
        Self { tracking, times: thinned(tracking.inputs().len()), halves }
    }

    fn time(&self) -> Vec<f64> {
        self.times.iter().map(|k| self.tracking.times()[*k]).collect()
    }

    /// The tube around the path of the first two states.
    pub fn around_path(&self) -> plot::Tube {
        let of = |rows: &[Vec<f64>]| self.times.iter().map(|k| [rows[*k][0], rows[*k][1]]).collect();
        let middles = of(self.tracking.states());
        plot::Tube { label: TUBE.to_owned(), middles, halves: of(&self.halves), colour: 0 }
    }

    /// The inputs of the law in the tube: what it adds to the reference is |K| times the radii at most, and it was checked that
    /// it stays within the limits.
    pub fn around_input(&self, input: usize, [min, max]: [f64; 2]) -> Band {
        let reach = |k: usize| {
            let radii = &self.tracking.radii()[k];
            let row = self.tracking.gains()[k].chunks_exact(radii.len()).nth(input).unwrap_or_default();
            row.iter().zip(radii).map(|(gain, radius)| gain.abs() * radius).sum::<f64>()
        };
        let end = |side: f64| {
            let value = |k: &usize| self.tracking.inputs()[*k][input] + side * reach(*k);
            // Not `clamp`, which panics if the limits contradict each other.
            self.times.iter().map(|k| value(k).max(min).min(max)).collect()
        };
        let (low, high) = (end(-1.0), end(1.0));
        Band { label: TUBE.to_owned(), time: self.time(), low, high, steps: true, colour: 0 }
    }

    /// h of a barrier in the tube. Along a box, h lies between its values at the corners where it bends down, and above its
    /// tangent where it bends up; the other way round for the upper end. From `required` on it was checked that h ≥ 0.
    ///
    /// # Errors
    ///
    /// A state that does not fit the filter.
    pub fn around_h(&self, filter: &Filter, barrier: usize, required: f64) -> Result<Band, Error> {
        let count = filter.barrier_names().count();
        let (mut low, mut high) = (Vec::new(), Vec::new());
        for &k in &self.times {
            let (time, z, radii) = (self.tracking.times()[k], &self.tracking.states()[k], &self.halves[k]);
            let mut values = vec![0.0; count];
            let mut h = |x: &[f64]| -> Result<f64, Error> {
                filter.barrier_values(time, x, &mut values).map_err(Error::from)?;
                Ok(values[barrier])
            };
            let middle = h(z)?;
            // The tangent, by differences over a small part of the box.
            let (mut x, mut along, mut moving) = (z.clone(), 0.0, Vec::new());
            for i in 0..z.len() {
                let by = radii[i] * PART;
                let [more, less] = [by, -by].map(|by| {
                    x[i] = z[i] + by;
                    h(&x)
                });
                x[i] = z[i];
                let slope = (more? - less?).abs() / (2.0 * PART);
                if slope > 0.0 {
                    along += slope;
                    moving.push(i);
                }
            }
            // With so many states the corners would take too long; the tangent is close.
            moving.truncate(MOST_STATES);
            let (mut least, mut most) = (middle - along, middle + along);
            for corner in 0..1_usize << moving.len() {
                for (bit, i) in moving.iter().enumerate() {
                    x[*i] = z[*i] + if corner >> bit & 1 == 0 { -radii[*i] } else { radii[*i] };
                }
                let h = h(&x)?;
                (least, most) = (least.min(h), most.max(h));
            }
            let is_required = time >= required;
            low.push(if is_required { least.max(0.0).min(middle) } else { least });
            high.push(most);
        }
        Ok(Band { label: TUBE.to_owned(), time: self.time(), low, high, steps: false, colour: 0 })
    }
}

/// The part of a box over which h is differentiated.
const PART: f64 = 1e-3;
/// The most states whose corners are tried.
const MOST_STATES: usize = 8;
