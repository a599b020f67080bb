//! Reference barriers.
//!
//! The two discs have the same safe set and very different behaviour. The quadratic one is the paper's: far
//! away its value grows with d², while its gradient at the boundary is only 2R, so a vehicle that follows a
//! profile of it arrives at enormous speed. The distance-shaped one has a gradient of length ≤ 1 everywhere;
//! it is the one to use, and the other shapes are made like it. [`Outside`] turns a goal into an obstacle.
//!
//! | barrier | safe set | relative degree on the point mass |
//! |---|---|---|
//! | [`DistanceDisc`], [`QuadraticDisc`] | a disc, which may move or follow a point | 2 |
//! | [`Ellipse`] | an ellipse | 2 |
//! | [`Rectangle`] | a rectangle with rounded corners, inside or around a true one | 2 |
//! | [`HalfPlane`] | one side of a line; two of them are a corridor | 2 |
//! | [`StateBound`] | a state above or below a bound | 1 for a speed, 2 for a position |
//! | [`NormBound`] | two states of bounded length, such as a speed limit | 1 for a velocity |

mod disc;
mod shapes;

pub use disc::{DistanceDisc, QuadraticDisc};
pub use shapes::{Ellipse, HalfPlane, NormBound, Rectangle, StateBound};

use crate::barrier::Barrier;
use crate::scalar::Scalar;

/// The outside of another barrier's set: h = −h of the inside.
///
/// `Outside(DistanceDisc::new(..)?)` is an obstacle: kept clear of if the start is outside, left by the
/// deadline if not. At the centre of the disc the gradient vanishes.
#[derive(Clone, Copy, Debug)]
pub struct Outside<B>(pub B);

impl<B: Barrier<NX>, const NX: usize> Barrier<NX> for Outside<B> {
    const ONE_SIDED_CURVATURE: bool = B::ONE_SIDED_CURVATURE;

    #[cfg_attr(not(feature = "small"), inline(always))]
    fn value<S: Scalar>(&self, t: S, x: &[S; NX]) -> S {
        -self.0.value(t, x)
    }

    fn steepness(&self) -> Option<f64> {
        self.0.steepness()
    }

    fn range_from(&self, t: f64, x: &[f64; NX]) -> Option<[f64; 2]> {
        self.0.range_from(t, x).map(|[least, largest]| [-largest, -least])
    }
}
