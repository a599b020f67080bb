//! Derivatives that are computed elsewhere, such as by a simulator: the state consists of the derivatives themselves.

use alloc::boxed::Box;

use super::{Ahead, DerivativeSource, Derivatives, Direction, Directional, checked_degree, checked_inputs};
use crate::elementary::dot;
use crate::error::Error;

/// The state is h, h', …, h⁽ⁿ⁻¹⁾, L_f^n h, L_g L_f^(n−1) h; the last has one number for each input.
struct External {
    n: usize,
    inputs: usize,
    /// The component of x at which they begin.
    first: usize,
}

impl External {
    /// The part of x that is its own.
    fn own<'a>(&self, x: &'a [f64]) -> &'a [f64] {
        &x[self.first..self.state_dim()]
    }
}

impl DerivativeSource for External {
    fn relative_degree(&self) -> usize {
        self.n
    }

    fn state_dim(&self) -> usize {
        self.first + self.n + 1 + self.inputs
    }

    fn input_dim(&self) -> usize {
        self.inputs
    }

    fn evaluate(&self, _t: f64, x: &[f64], out: &mut Derivatives) {
        let (drift, row) = self.own(x).split_at(self.n + 1);
        *out = Derivatives::ZERO;
        out.drift[..=self.n].copy_from_slice(drift);
        out.row[..self.inputs].copy_from_slice(row);
    }

    fn directional(&self) -> Option<&dyn Directional> {
        Some(self)
    }
}

impl Directional for External {
    /// h⁽ⁿ⁾ = L_f^n h + L_g L_f^(n−1) h u is bilinear, all else linear.
    fn evaluate_directional(&self, _t: f64, x: &[f64], u: &[f64], direction: Direction, out: &mut Ahead) {
        let (drift, row) = self.own(direction.x).split_at(self.n + 1);
        *out = Ahead::ZERO;
        out.value[..=self.n].copy_from_slice(drift);
        out.value[self.n] += dot(row, u);
        out.value[self.n] += dot(&self.own(x)[self.n + 1..], direction.u);
        out.gradient[self.n][..self.inputs].copy_from_slice(row);
    }
}

/// Derivatives of one barrier of relative degree `n` that are computed elsewhere and passed at every step in place of a
/// state. Its n + 1 + `input_dim` components are h, its derivatives of the orders 1 to n − 1, L_f^n h (the derivative of
/// order n if all inputs are 0), and L_g L_f^(n−1) h (what one unit of each input adds to that), in `[h]`/s^k and `[h]`/(s^n
/// · unit of u). For a time-varying h they are total derivatives.
///
/// They are used as they are: `n` is not checked. Nothing can be predicted, so steps are those of
/// [`Sampling::Pointwise`](crate::filter::Sampling::Pointwise), and the margin has to cover held inputs. For several
/// barriers x holds one such part after the other, each from its component `first` on.
///
/// # Errors
///
/// `n` outside 1 ..= [`MAX_RELATIVE_DEGREE`](crate::MAX_RELATIVE_DEGREE); `input_dim` above
/// [`MAX_INPUTS`](crate::MAX_INPUTS) or zero.
///
/// ```
/// # use punctual_core::{filter::*, lie};
/// // h = 3 - p for p'' = u, at p = 5, p' = 2: h' = -2, and h'' = 0 - u.
/// let settings = BarrierSettings::within(1.0).margin(0.01);
/// let mut filter = Filter::from_sources(4, 1)
///     .source("wall", lie::external(2, 1, 0)?, settings)?
///     .sampling(Sampling::Pointwise)?
///     .build()?;
/// let mut u = [0.0];
/// let report = filter.step(0.0, &[-2.0, -2.0, 0.0, -1.0], &[0.0], &mut u)?;
/// assert_eq!(report.status, Status::Filtered);
/// assert!(u[0] < 0.0);
/// # Ok::<(), punctual_core::Error>(())
/// ```
pub fn external(n: usize, input_dim: usize, first: usize) -> Result<Box<dyn DerivativeSource>, Error> {
    let inputs = checked_inputs(input_dim)?;
    Ok(Box::new(External { n: checked_degree(n)?, inputs, first }))
}

#[cfg(test)]
mod tests {
    use alloc::string::ToString;

    use super::*;
    use crate::MAX_INPUTS;

    /// n = 2 and two inputs.
    const X: [f64; 5] = [3.0, -2.0, 0.5, 4.0, -1.5];

    #[test]
    fn what_is_handed_over_comes_out() {
        let source = external(2, 2, 0).expect("in range");
        let mut out = Derivatives { lower_sensitivity: 1.0, ..Derivatives::ZERO };
        source.evaluate(7.0, &X, &mut out);
        assert_eq!((&out.drift[..4], &out.row[..3]), (&[3.0, -2.0, 0.5, 0.0][..], &[4.0, -1.5, 0.0][..]));
        assert_eq!(out.lower_sensitivity, 0.0);
    }

    #[test]
    fn nothing_is_foretold() {
        let source = external(2, 2, 0).expect("in range");
        assert!(source.predict().is_none() && source.predict_directional().is_none());
        assert!(source.highest(0.0, &X, [&[-1.0; 2], &[1.0; 2]], [0.0, 1.0]).is_none());
    }

    /// Central differences of a bilinear function are exact; the numbers are dyadic.
    #[test]
    fn the_change_along_a_direction() {
        let source = external(2, 2, 0).expect("in range");
        let (dx, u, du) = ([1.0, 0.5, -2.0, 0.25, 3.0], [1.0, 2.0], [-0.5, 4.0]);
        let at = |by: f64| {
            let x: [f64; 5] = core::array::from_fn(|i| X[i] + by * dx[i]);
            let u: [f64; 2] = core::array::from_fn(|i| u[i] + by * du[i]);
            let mut out = Derivatives::ZERO;
            source.evaluate(0.0, &x, &mut out);
            out.drift[2] += dot(&out.row, &u);
            out
        };
        let (plus, minus) = (at(0.5), at(-0.5));
        let mut found = Ahead::ZERO;
        let directional = source.directional().expect("it is known");
        directional.evaluate_directional(0.0, &X, &u, Direction { x: &dx, u: &du }, &mut found);
        for k in 0..3 {
            assert_eq!(found.value[k], plus.drift[k] - minus.drift[k], "order {k}");
        }
        for j in 0..2 {
            assert_eq!(found.gradient[2][j], plus.row[j] - minus.row[j], "{j}");
        }
        assert_eq!(found.gradient[..2], [[0.0; MAX_INPUTS]; 2]);
    }

    #[test]
    fn sizes_are_checked() {
        let refused = |n, inputs| external(n, inputs, 0).err().map(|e| e.to_string());
        assert_eq!(refused(0, 1).as_deref(), Some("relative_degree: is 0, must be 1 to 8"));
        assert_eq!(refused(9, 1).as_deref(), Some("relative_degree: is 9, must be 1 to 8"));
        assert_eq!(refused(1, 0).as_deref(), Some("u: has 0 components, must have 1 to 32"));
        assert_eq!(refused(1, 33).as_deref(), Some("u: has 33 components, must have 1 to 32"));
        assert!(external(8, 12, 0).is_ok());
    }
}
