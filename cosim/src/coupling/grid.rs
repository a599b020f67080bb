//! The communication points of a run: `t_k = start + k·h`, the last one exactly at the stop time.

/// The greatest number of steps of a run.
pub(super) const MAX_STEPS: f64 = 1e12;

/// Tolerance, in steps, within which the duration of an experiment counts as a whole number of steps. The
/// rounding error of (stop − start)/h is below it up to about 10⁹ steps.
const WHOLE: f64 = 1e-6;

/// The communication points of a run, fixed or drawn.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    start: f64,
    stop: f64,
    step: f64,
    steps: u64,
    last: f64,
    /// The time of every point but the last, if the steps differ; else empty.
    times: Vec<f64>,
}

impl Grid {
    /// Points from `start` to `stop` (s, finite, `start < stop`) at intervals of `step` (s, > 0). The last
    /// step is shortened if `step` does not divide the duration.
    pub fn new(start: f64, stop: f64, step: f64) -> Self {
        let ratio = (stop - start) / step;
        let whole = ratio.round();
        if whole >= 1.0 && (ratio - whole).abs() <= WHOLE {
            return Self { start, stop, step, steps: whole as u64, last: step, times: Vec::new() };
        }
        let steps = (ratio.ceil() as u64).max(1);
        let last = stop - (start + (steps - 1) as f64 * step);
        Self { start, stop, step, steps, last, times: Vec::new() }
    }

    /// The same experiment with the lengths of its steps from `length`, each as a part of the usual one, > 0. The last one ends at the
    /// stop time.
    pub fn drawn(&self, length: impl Fn(u64) -> f64) -> Self {
        let (mut times, mut next) = (Vec::new(), self.start);
        while times.is_empty() || next < self.stop - WHOLE * self.step {
            next += self.step * length(times.len() as u64);
            times.push(next);
        }
        times.pop();
        times.insert(0, self.start);
        let (steps, last) = (times.len() as u64, self.stop - times[times.len() - 1]);
        Self { steps, last, times, ..*self }
    }

    /// The usual length of a step, in seconds.
    pub fn usual(&self) -> f64 {
        self.step.min(self.stop - self.start)
    }

    /// The number of steps, ≥ 1.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// The communication point `k`, in seconds; `k` from 0 to [`Grid::steps`].
    pub fn time(&self, k: u64) -> f64 {
        match self.times.get(k as usize) {
            Some(time) => *time,
            None if k >= self.steps => self.stop,
            None => self.start + k as f64 * self.step,
        }
    }

    /// The length of the step from point `k`, in seconds.
    pub fn step(&self, k: u64) -> f64 {
        match k + 1 < self.steps {
            true if self.times.is_empty() => self.step,
            true => self.time(k + 1) - self.time(k),
            false => self.last,
        }
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
    fn drawn_steps_have_their_lengths_and_end_at_the_stop_time() {
        let length = |k: u64| if k.is_multiple_of(2) { 1.5 } else { 0.5 };
        let grid = Grid::new(1.0, 2.0, 0.1).drawn(length);
        let times: Vec<f64> = (0..=grid.steps()).map(|k| grid.time(k)).collect();
        let wanted = [1.0, 1.15, 1.2, 1.35, 1.4, 1.55, 1.6, 1.75, 1.8, 1.95, 2.0];
        // Round-off of ten sums.
        assert!(times.iter().zip(wanted).all(|(time, wanted)| (time - wanted).abs() < 1e-14), "{times:?}");
        assert_eq!(times.len(), wanted.len());
        for k in 0..grid.steps() {
            assert!((grid.time(k) + grid.step(k) - grid.time(k + 1)).abs() < 1e-14, "{k}");
        }
        assert_eq!((grid.time(grid.steps()), grid.usual()), (2.0, 0.1));
        // One step that is longer than the experiment.
        let one = Grid::new(0.0, 0.1, 0.1).drawn(|_| 1.5);
        assert_eq!((one.steps(), one.time(0), one.time(1), one.step(0)), (1, 0.0, 0.1, 0.1));
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
