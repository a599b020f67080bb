//! The first-order fixed-time condition, for relative degree 1.
//!
//! Let ė ≥ α |e|^p below zero, with p in (0, 1). Then
//!
//! ```math
//! \begin{aligned}
//! |e(\tau)|^{1-p} &\le |e(0)|^{1-p} - (1-p)\,\alpha\tau, \qquad \alpha = \frac{|e(0)|^{1-p}}{(1-p)\,T}, \\
//! e(\tau) &\ge e(0) \left(1 - \frac{\tau}{T}\right)^{1/(1-p)},
//! \end{aligned} \tag{F}
//! ```
//!
//! with equality if the condition is active throughout, so e reaches zero exactly at T
//! (`docs/theory.md#first-order-condition`). The condition is the reference profile r = e(0) (1 −
//! τ/T)^{1/(1−p)} written as feedback of e. With the rate a = 1/((1 − p) T) in 1/s, α |e|^p = a |e(0)|
//! (|e|/|e(0)|)^p.
//!
//! The two differ after a disturbance. The profile corrects a lost error at a rate of its own, so it still
//! arrives near T. (F) does not, and arrives late by (|e|^{1−p} − |r|^{1−p})/((1 − p) α).
//!
//! # Requirements
//!
//! Relative degree 1. The right-hand side is not Lipschitz at e = 0. Approached from below, a held input can
//! only overshoot into the set, by at most α |e|^p δ over a period δ. Within (αδ)^{1/(1−p)} of zero, where
//! that exceeds |e|, one step arrives. Above zero, the same condition (ė ≥ −α e^p) lets e reach zero in
//! finite time, and a held input then crosses it back and forth: chattering.
//!
//! # References
//!
//! A. Polyakov, *Nonlinear feedback design for fixed-time stabilization of linear control systems*,
//! IEEE Trans. Automatic Control 57 (2012), doi 10.1109/TAC.2011.2179869, for the notion of fixed time;
//! S. P. Bhat and D. S. Bernstein, *Finite-time stability of continuous autonomous systems*, SIAM J.
//! Control Optim. 38 (2000), doi 10.1137/S0363012997321358, for the comparison argument.

use punctual_core::elementary;
use punctual_core::error::{Error, ErrorKind};

/// The exponent p of (F), dimensionless, in (0, 1). Default 1/2.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exponent(f64);

/// Equality is an equivalence, as p is never NaN.
impl Eq for Exponent {}

impl Default for Exponent {
    fn default() -> Self {
        Self(0.5)
    }
}

impl Exponent {
    /// The exponent `p`. Near 0 the speed of approach is nearly constant. Near 1 the approach starts fast and
    /// ends gently: the initial rate |ė/e| is 1/((1 − p) T).
    ///
    /// # Errors
    ///
    /// `p` not in (0, 1).
    pub fn new(p: f64) -> Result<Self, Error> {
        if p > 0.0 && p < 1.0 {
            return Ok(Self(p));
        }
        let message = format!("is {p}, must be > 0 and < 1");
        Err(Error::new(ErrorKind::Range, "exponent", message))
    }

    /// p.
    pub fn get(self) -> f64 {
        self.0
    }

    /// a = 1/((1 − p) T) in 1/s for the deadline T > 0 in s.
    pub fn rate(self, deadline: f64) -> f64 {
        1.0 / ((1.0 - self.0) * deadline)
    }

    /// The least ė allowed at `e` < 0 after a start at `anchor` = e(0) < 0, in `[e]`/s; 0 for e ≥ 0.
    pub fn floor(self, anchor: f64, deadline: f64, e: f64) -> f64 {
        if e >= 0.0 {
            return 0.0;
        }
        -self.rate(deadline) * anchor * elementary::powf(e / anchor, self.0)
    }

    /// The lower bound (F) on e at `elapsed` = τ ≥ 0 after a start at `anchor` = e(0) < 0, in `[e]`; 0 from T
    /// on.
    pub fn lower_bound(self, anchor: f64, deadline: f64, elapsed: f64) -> f64 {
        anchor * elementary::powf((1.0 - elapsed / deadline).max(0.0), 1.0 / (1.0 - self.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bound_solves_the_condition() {
        for p in [0.1, 0.5, 0.75, 0.95] {
            let p = Exponent::new(p).expect("in range");
            let (anchor, deadline) = (-40.0, 3.0);
            assert!((p.floor(anchor, deadline, anchor) / anchor + p.rate(deadline)).abs() < 1e-15);
            for tau in [0.0, 0.4, 1.5, 2.9] {
                let e = p.lower_bound(anchor, deadline, tau);
                // Central difference with step 1e-5, whose error is the third derivative times 2e-11.
                let d = 1e-5;
                let slope = (p.lower_bound(anchor, deadline, tau + d)
                    - p.lower_bound(anchor, deadline, tau - d))
                    / (2.0 * d);
                assert!(
                    (slope - p.floor(anchor, deadline, e)).abs() < 1e-4 * slope.abs().max(1e-3),
                    "{p:?} {tau}"
                );
            }
            assert_eq!(p.lower_bound(anchor, deadline, deadline), 0.0);
            assert_eq!(p.floor(anchor, deadline, 0.0), 0.0);
        }
    }

    #[test]
    fn the_exponent_is_between_zero_and_one() {
        for bad in [0.0, 1.0, -0.5, 1.5, f64::NAN, f64::INFINITY] {
            let error = Exponent::new(bad).unwrap_err();
            assert_eq!(error.to_string(), format!("exponent: is {bad}, must be > 0 and < 1"));
        }
        assert_eq!(Exponent::default().get(), 0.5);
    }
}
