//! Barriers: the function h whose non-negative set is the safe set.

use crate::dynamics::Region;
use crate::scalar::Scalar;

/// A barrier `h(t, x)`; the safe set is `C(t) = {x : h(t, x) ≥ 0}`.
///
/// ```
/// use punctual_core::barrier::Barrier;
/// use punctual_core::scalar::Scalar;
///
/// /// Speed limit: h = v_max − v for a state (position, velocity).
/// struct SpeedLimit(f64);
///
/// impl Barrier<2> for SpeedLimit {
///     fn value<S: Scalar>(&self, _t: S, x: &[S; 2]) -> S {
///         -x[1] + self.0
///     }
/// }
/// ```
///
/// # Requirements
///
/// h is smooth along trajectories, but for kinks by [`Scalar::min`], [`Scalar::max`] and [`Scalar::abs`]. Plans and steps are
/// checked between instants too, and see those there, but not a branch that compares [`Scalar::value`]s ([`crate::interval`]). The
/// non-negative set of h is the one that is meant. The *shape* of h away from its zero level decides how much input the filter
/// needs (see [`crate::barriers`]).
pub trait Barrier<const NX: usize> {
    /// Whether h is concave in (t, x), or convex, as all [`barriers`](crate::barriers) of this crate are: then it
    /// hides nothing narrow between two samples of a plant that [bends slowly](crate::dynamics::ControlAffine::SLOW_CURVATURE), and
    /// with n > 1 a step does not look for it. With the default, `false`, it does.
    const ONE_SIDED_CURVATURE: bool = false;

    /// h at time `t` (in seconds, on the filter's time axis) and state `x`.
    fn value<S: Scalar>(&self, t: S, x: &[S; NX]) -> S;

    /// A number that h does not exceed while the time is between `time[0]` and `time[1]` and the position, the
    /// first two states, is in `region`, whatever the other states are. `None`, the default, where that is
    /// not known.
    fn highest(&self, _time: [f64; 2], _region: &Region) -> Option<f64> {
        None
    }

    /// The most by which h changes per metre by which its place is moved, such as the centre of a disc; `None`, the default,
    /// where that has no bound. A set can then not follow a point that is [known inexactly](crate::filter::Plans::motion).
    fn steepness(&self) -> Option<f64> {
        None
    }

    /// The least and the largest value of h from `t` (s) on while the state stays `x`, infinite where there is none. `None`,
    /// the default, where they are not known: then a set that moves is not [assured](crate::filter::Filter).
    fn range_from(&self, _t: f64, _x: &[f64; NX]) -> Option<[f64; 2]> {
        None
    }
}
