//! A tube that shrinks to the set by the deadline.

use super::{Bound, Condition, Sample, checked_order};
use punctual_core::MAX_RELATIVE_DEGREE;
use punctual_core::convergence::comparison::{binomial, lower_terms};
use punctual_core::elementary;
use punctual_core::error::{Error, ErrorKind, positive};

/// Keeps h + s(t) ≥ 0, with s(τ) = s₀ (1 − τ/T)ᵏ until T and 0 afterwards: (D + a)ⁿ (h + s) ≥ 0.
///
/// For n = 1 this is the source's constraint L_f h + L_g h u + ṡ ≥ −a (h + s) with s₀ = max(0, −h₀), so that
/// the tube contains the start. The schedule is ours (the source leaves it free, but bounded); k ≥ n makes
/// s⁽ⁿ⁾ bounded.
///
/// For n > 1, our extension, the tube must contain the start with its derivatives: (D + a)ⁱ(h + s) ≥ 0 at the
/// anchor for every i < n. Each of these is linear in s₀, and the least s₀ ≥ 0 that meets all of them is
/// taken. Then h ≥ −s throughout, and h ≥ 0 from T on. If (D + a)ⁱ(1 − τ/T)ᵏ ≤ 0 at the anchor (aT too small
/// for k), there may be no such s₀. That condition is then omitted, and nothing is guaranteed.
///
/// [`Self::least_deadline`] tests, only for n = 1, whether bounded inputs can follow the tube.
///
/// # References
///
/// D. Gadginmath, A. Allibhoy and F. Pasqualetti, *Constricting tubes for prescribed-time safe control*,
/// arXiv:2603.17003.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tube {
    n: usize,
    power: usize,
    rate: f64,
}

impl Tube {
    /// A tube for relative degree `n`, with k = `power` in n ..= 2 n and a = `rate` in 1/s, finite, > 0.
    ///
    /// # Errors
    ///
    /// A number out of range.
    pub fn new(n: usize, power: usize, rate: f64) -> Result<Self, Error> {
        let n = checked_order("n", n)?;
        if power < n || power > 2 * n {
            let message = format!("is {power}, must be {n} to {}", 2 * n);
            return Err(Error::new(ErrorKind::Range, "power", message));
        }
        Ok(Self { n, power, rate: positive("rate", rate)? })
    }

    /// The derivatives of (1 − τ/T)ᵏ at `elapsed`, orders 0 ..= n.
    fn shape(&self, deadline: f64, elapsed: f64) -> [f64; MAX_RELATIVE_DEGREE + 1] {
        let mut derivatives = [0.0; MAX_RELATIVE_DEGREE + 1];
        if elapsed < deadline {
            let left = 1.0 - elapsed / deadline;
            let mut factor = 1.0;
            for j in 0..=self.n {
                derivatives[j] = factor * elementary::powi(left, (self.power - j) as i32);
                factor *= -((self.power - j) as f64) / deadline;
            }
        }
        derivatives
    }

    /// s₀ in `[h]`.
    pub fn width(&self, anchor: &[f64], deadline: f64) -> f64 {
        let shape = self.shape(deadline, 0.0);
        let link = |e: &[f64], i: usize| -> f64 {
            (0..=i).map(|j| binomial(i, j) * elementary::powi(self.rate, (i - j) as i32) * e[j]).sum()
        };
        let needed = (0..self.n).filter_map(|i| {
            let per_width = link(&shape, i);
            (per_width > 0.0).then(|| -link(anchor, i) / per_width)
        });
        needed.fold(0.0, f64::max)
    }

    /// The shortest deadline in s for which bounded inputs can follow the tube of a start with h₀ = `anchor`,
    /// from every state in it. `authority` is the minimum, over these states, of the largest ḣ within the
    /// bounds, in `[h]`/s. `None` for n > 1, where the input does not determine the rate of h.
    ///
    /// The constraint is hardest on the edge of the tube, where it reads ḣ ≥ −ṡ. The largest −ṡ is k s₀/T, at
    /// the start. So T = k s₀/`authority`, infinite without authority. The source has one condition on the
    /// rate of the schedule, and a least time in closed form that follows from it. We know both only from its
    /// abstract, and derive them here from its constraint.
    pub fn least_deadline(&self, anchor: f64, authority: f64) -> Option<f64> {
        let width = (-anchor).max(0.0);
        match self.n {
            1 if width == 0.0 => Some(0.0),
            1 if authority > 0.0 => Some(self.power as f64 * width / authority),
            1 => Some(f64::INFINITY),
            _ => None,
        }
    }
}

impl Condition for Tube {
    fn bound(&self, at: &Sample) -> Bound {
        let (width, shape) = (self.width(at.anchor, at.deadline), self.shape(at.deadline, at.elapsed));
        let mut inside = [0.0; MAX_RELATIVE_DEGREE];
        for j in 0..self.n {
            inside[j] = at.e[j] + width * shape[j];
        }
        let floor = -lower_terms(self.rate, &inside[..self.n]) - width * shape[self.n];
        Bound { lower: -width * shape[0], ..Bound::floor(floor) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn order_one_is_the_shrinking_set() {
        let tube = Tube::new(1, 1, 2.0).expect("valid");
        // s = 4 (1 − τ/2), ṡ = −2: ḣ ≥ 2 − 2 (h + s).
        assert_eq!(tube.width(&[-4.0], 2.0), 4.0);
        let at = |elapsed: f64| tube.bound(&Sample::new(&[-4.0], 2.0, elapsed, &[-1.5]));
        assert_eq!(at(1.0), Bound { floor: 2.0 - 2.0 * 0.5, lower: -2.0, applies: false });
        assert_eq!(at(2.5).floor, 3.0);
        assert_eq!(tube.width(&[1.0], 2.0), 0.0);
    }

    /// ẋ = u with |u| ≤ 2 from h₀ = −4: two seconds at full speed along a linear tube, four along a quadratic
    /// one.
    #[test]
    fn the_least_deadline_is_that_of_full_speed() {
        let least = |n, power, anchor, authority| {
            Tube::new(n, power, 2.0).expect("valid").least_deadline(anchor, authority)
        };
        assert_eq!(least(1, 1, -4.0, 2.0), Some(2.0));
        assert_eq!(least(1, 2, -4.0, 2.0), Some(4.0));
        assert_eq!(least(1, 1, 1.0, 2.0), Some(0.0));
        assert_eq!(least(1, 1, -1.0, 0.0), Some(f64::INFINITY));
        assert_eq!(least(2, 2, -4.0, 2.0), None);
        // At that deadline, the floor at the start is the largest rate within the bounds.
        let tube = Tube::new(1, 1, 2.0).expect("valid");
        assert_eq!(tube.bound(&Sample::new(&[-4.0], 2.0, 0.0, &[-4.0])).floor, 2.0);
    }

    /// From rest, the tube of order 2 is wider than |h₀|, exactly so that (D + a)(h + s) = 0 there.
    #[test]
    fn the_start_is_in_the_tube_with_its_derivatives() {
        let tube = Tube::new(2, 2, 3.0).expect("valid");
        let width = tube.width(&[-1.0, 0.0], 2.0);
        // a (h₀ + s₀) − 2 s₀/T = 0: s₀ = a/(a − 2/T) = 3/2.
        assert!((width - 1.5).abs() < 1e-15, "{width}");
        for (n, anchor) in [(3, vec![-1.0, 0.0, 0.0]), (4, vec![-2.0, 1.0, -3.0, 0.5])] {
            let tube = Tube::new(n, n, 8.0).expect("valid");
            let (width, shape) = (tube.width(&anchor, 2.0), tube.shape(2.0, 0.0));
            let e: Vec<f64> = (0..n).map(|j| anchor[j] + width * shape[j]).collect();
            for i in 0..n {
                let link: f64 = (0..=i).map(|j| binomial(i, j) * 8_f64.powi((i - j) as i32) * e[j]).sum();
                assert!(link > -1e-9, "n = {n}, i = {i}: {link}");
            }
        }
    }

    #[test]
    fn powers_out_of_range_are_refused() {
        let message = |tube: Result<Tube, Error>| tube.unwrap_err().to_string();
        assert_eq!(message(Tube::new(2, 1, 1.0)), "power: is 1, must be 2 to 4");
        assert_eq!(message(Tube::new(2, 2, -1.0)), "rate: is -1, must be finite and > 0");
        assert_eq!(message(Tube::new(0, 0, 1.0)), "n: has 0 components, must have 1 to 8");
    }
}
