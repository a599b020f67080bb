//! The backup of [`Gatekeeper`](super::Gatekeeper) and [`BackupBarrier`](super::BackupBarrier): a controller,
//! and the set that it keeps.

use std::array::from_fn;

use punctual_core::barrier::Barrier;
use punctual_core::dynamics::{ControlAffine, rk4};
use punctual_core::error::{Error, positive};
use punctual_core::qp::Bounds;
use punctual_core::scalar::Scalar;

/// A feedback law.
pub trait Law<const NX: usize, const NU: usize> {
    /// The input at `x`, within the bounds of the backup that uses it.
    fn input<S: Scalar>(&self, x: &[S; NX]) -> [S; NU];
}

/// A braking law: −gain · v on the first `M` inputs, with a norm of at most `limit`, and 0 on the others.
///
/// Input i < `M` must be the rate of the state `speeds[i]`. The path until rest is then at most
/// |v|/gain + |v|²/(2 limit), with v the vector of these states.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Brake<const M: usize> {
    /// The states that are speeds, in m/s, counted from 0.
    pub speeds: [usize; M],
    /// In 1/s, finite, > 0, and below the inverse of the hold period of an input.
    pub gain: f64,
    /// Largest norm of the input in m/s², finite, > 0.
    pub limit: f64,
}

impl<const M: usize> Brake<M> {
    /// A small speed in m/s that makes the norm of v differentiable at 0.
    const SMALL: f64 = 1e-3;

    /// An upper bound in m on the path until rest, differentiable everywhere.
    pub fn path<S: Scalar, const NX: usize>(&self, x: &[S; NX]) -> S {
        let square = self.square(x) + Self::SMALL * Self::SMALL;
        square.sqrt() / self.gain + square / (2.0 * self.limit)
    }

    fn square<S: Scalar, const NX: usize>(&self, x: &[S; NX]) -> S {
        self.speeds.iter().fold(S::zero(), |sum, k| sum + x[*k].squared())
    }
}

impl<const M: usize, const NX: usize, const NU: usize> Law<NX, NU> for Brake<M> {
    fn input<S: Scalar>(&self, x: &[S; NX]) -> [S; NU] {
        let square = self.square(x);
        let is_short = square.value() * self.gain * self.gain <= self.limit * self.limit;
        let factor = if is_short { S::from(self.gain) } else { S::from(self.limit) / square.sqrt() };
        from_fn(|i| self.speeds.get(i).map_or(S::zero(), |k| -x[*k] * factor))
    }
}

/// The part of `set` from which [`Brake`] comes to rest inside: h minus the path until rest. The norm of the
/// gradient of h along the position must be at most 1, as that of a distance is.
#[derive(Clone, Copy, Debug)]
pub struct Stoppable<B, const M: usize> {
    /// The set, h in m.
    pub set: B,
    /// The braking law.
    pub brake: Brake<M>,
}

impl<B: Barrier<NX>, const M: usize, const NX: usize> Barrier<NX> for Stoppable<B, M> {
    fn value<S: Scalar>(&self, t: S, x: &[S; NX]) -> S {
        self.set.value(t, x) - self.brake.path(x)
    }
}

/// A backup controller, the set that it keeps, and the model in which both are simulated.
///
/// A state is safe if h ≥ 0, for one set at rest. In the terminal set the law keeps h ≥ 0 forever; whoever
/// sets up both must ensure this, see [`Stoppable`]. Neither method supports a deadline or a set to be
/// reached.
#[derive(Clone, Copy, Debug)]
pub struct Backup<P, L, B, C> {
    /// The model.
    pub plant: P,
    /// The law used when the nominal controller cannot be followed.
    pub law: L,
    /// The set to keep.
    pub safe: B,
    /// The set in which the law keeps it forever.
    pub terminal: C,
    /// Bounds on the inputs, which the law must respect.
    pub bounds: Bounds,
    /// Hold period of an input, and time between two points of a trajectory, in s, finite, > 0.
    pub period: f64,
    /// Periods within which the law must reach the terminal set, ≥ 1.
    pub horizon: usize,
}

impl<P, L, B, C> Backup<P, L, B, C> {
    /// The same backup, with its numbers checked.
    ///
    /// # Errors
    ///
    /// A number outside the range its field states.
    pub fn validated(self) -> Result<Self, Error> {
        positive("period", self.period)?;
        positive("horizon", self.horizon as f64)?;
        Ok(self)
    }

    /// The state one period after `x` under the held input `u`.
    pub(super) fn moved<S: Scalar, const NX: usize, const NU: usize>(
        &self,
        x: &[S; NX],
        u: &[S; NU],
    ) -> [S; NX]
    where
        P: ControlAffine<NX, NU>,
    {
        rk4(|x| self.plant.derivative(x, u), x, self.period)
    }

    /// `u` clamped to the bounds.
    pub(super) fn bounded<const NU: usize>(&self, u: &[f64; NU]) -> [f64; NU] {
        from_fn(|i| self.bounds.clamp(i, u[i]))
    }

    /// Whether the law leads from `x` at `t` into the terminal set within the horizon, and is safe at every
    /// sample before. From there on it is safe by the choice of that set.
    pub fn saves<const NX: usize, const NU: usize>(&self, t: f64, x: &[f64; NX]) -> bool
    where
        P: ControlAffine<NX, NU>,
        L: Law<NX, NU>,
        B: Barrier<NX>,
        C: Barrier<NX>,
    {
        let mut x = *x;
        for k in 0..=self.horizon {
            let at = t + k as f64 * self.period;
            if self.safe.value(at, &x) < 0.0 {
                return false;
            }
            if self.terminal.value(at, &x) >= 0.0 {
                return true;
            }
            x = self.moved(&x, &self.law.input(&x));
        }
        false
    }
}
