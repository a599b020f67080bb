//! The communication points of a run: `t_k = start + k·h`, the last one exactly at the stop time.

/// The greatest number of steps of a run.
pub(super) const MAX_STEPS: f64 = 1e12;

/// Tolerance, in steps, within which the duration of an experiment counts as a whole number of steps. The
/// rounding error of (stop − start)/h is below it up to about 10⁹ steps.
const WHOLE: f64 = 1e-6;

/// Fixed communication points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    start: f64,
    stop: f64,
    step: f64,
    steps: u64,
    last: f64,
}

impl Grid {
    /// Points from `start` to `stop` (s, finite, `start < stop`) at intervals of `step` (s, > 0). The last
    /// step is shortened if `step` does not divide the duration.
    pub fn new(start: f64, stop: f64, step: f64) -> Self {
        let ratio = (stop - start) / step;
        let whole = ratio.round();
        if whole >= 1.0 && (ratio - whole).abs() <= WHOLE {
            return Self { start, stop, step, steps: whole as u64, last: step };
        }
        let steps = (ratio.ceil() as u64).max(1);
        Self { start, stop, step, steps, last: stop - (start + (steps - 1) as f64 * step) }
    }

    /// The number of steps, ≥ 1.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// The communication point `k`, in seconds; `k` from 0 to [`Grid::steps`].
    pub fn time(&self, k: u64) -> f64 {
        if k >= self.steps { self.stop } else { self.start + k as f64 * self.step }
    }

    /// The length of the step from point `k`, in seconds.
    pub fn step(&self, k: u64) -> f64 {
        if k + 1 < self.steps { self.step } else { self.last }
    }

    /// The last step, in seconds, if it is shorter than the others.
    pub fn shortened(&self) -> Option<f64> {
        (self.last != self.step).then_some(self.last)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_whole_number_of_steps_is_recognised_through_rounding() {
        let grid = Grid::new(0.0, 20.0, 0.001);
        assert_eq!((grid.steps(), grid.shortened()), (20_000, None));
        assert_eq!(grid.time(3), 3.0 * 0.001);
        assert_eq!(grid.time(20_000), 20.0);
        assert_eq!(grid.step(19_999), 0.001);
        assert_eq!(Grid::new(0.0, 0.3, 0.1).steps(), 3);
        assert_eq!(Grid::new(0.1, 100.1, 0.1).steps(), 1000);
    }

    #[test]
    fn the_last_step_is_shortened_to_the_stop_time() {
        let grid = Grid::new(1.0, 2.0, 0.3);
        assert_eq!((grid.steps(), grid.time(4)), (4, 2.0));
        assert!((grid.step(3) - 0.1).abs() < 1e-15, "{}", grid.step(3));
        assert_eq!(grid.step(2), 0.3);
        let one = Grid::new(0.0, 1.0, 3.0);
        assert_eq!((one.steps(), one.step(0), one.time(1)), (1, 1.0, 1.0));
    }
}
