//! The limits of bounded inputs: how high h can be at a time, whether a deadline is lost, and the earliest time at which
//! h ≥ 0 is not ruled out.
//!
//! A source bounds h over every state that bounded inputs reach between two times ([`DerivativeSource::highest`]).
//! Where that bound is negative at T, no input has h(T) ≥ 0. Where it is negative on each of the intervals that cover
//! [0, τ], none has h ≥ 0 before τ (`docs/theory.md#lost-deadline`). [`earliest_arrival`] covers by steps that double after a
//! success and halve after a failure.
//!
//! For a chain of n integrators per axis with bounds per axis, the reachable positions are exactly a box
//! (`docs/theory.md#reachable-box`). So for a disc, a half-plane, or a shape along the axes the answer for T is
//! exact: what is not ruled out can be had. For other plants the region is larger than what can be reached, and the
//! times found are bounds.

use crate::MAX_INPUTS;
use crate::lie::DerivativeSource;
use crate::qp::Bounds;

/// [`earliest_arrival`] stops where steps of this part of the time reached fail.
pub const TOLERANCE: f64 = 1e-9;

/// Round-off of a bound on h, as a part of the size of h that the caller gives.
const ROUND_OFF: f64 = 1e-9;

fn slices<'a>(bounds: &'a Bounds, source: &dyn DerivativeSource) -> [&'a [f64]; 2] {
    let inputs = source.input_dim().min(MAX_INPUTS);
    [&bounds.min[..inputs], &bounds.max[..inputs]]
}

/// Whether no input within `bounds` has h ≥ 0 at `after` ≥ 0 s after time `t` and state `x`. False where
/// it is possible or not known. `size` is that of h on the way: 1e-9 of it counts as round-off.
pub(crate) fn ruled_out(
    source: &dyn DerivativeSource,
    (t, x): (f64, &[f64]),
    bounds: &Bounds,
    after: f64,
    size: f64,
) -> bool {
    let highest = source.highest(t, x, slices(bounds, source), [after, after]);
    highest.is_some_and(|h| h < -ROUND_OFF * size)
}

/// A time in s after `t` before which no input within `bounds` brings h ≥ 0 from the state `x`: 0 inside,
/// `horizon` where it is not possible within that, which must be finite. `None` where the source knows no
/// bound.
///
/// ```
/// use std::sync::Arc;
///
/// use punctual_core::barriers::HalfPlane;
/// use punctual_core::plants::PointMass;
/// use punctual_core::{lie, qp::Bounds, reach};
///
/// // 9 m from rest with 2 m/s²: 3 s.
/// let source = lie::along(Arc::new(PointMass), HalfPlane::new([1.0, 0.0], [9.0, 0.0])?, 2)?;
/// let mut bounds = Bounds::NONE;
/// (bounds.min[..2].fill(-2.0), bounds.max[..2].fill(2.0));
/// let earliest = reach::earliest_arrival(&*source, (0.0, &[0.0; 4]), &bounds, 100.0).expect("known");
/// assert!((earliest - 3.0).abs() < 1e-6);
/// # Ok::<(), punctual_core::Error>(())
/// ```
pub fn earliest_arrival(
    source: &dyn DerivativeSource,
    (t, x): (f64, &[f64]),
    bounds: &Bounds,
    horizon: f64,
) -> Option<f64> {
    /// The first step, as a part of the horizon.
    const FIRST: f64 = 1e-3;
    /// Enough for any horizon and tolerance: each is a success that doubles or a failure that halves.
    const STEPS: usize = 10_000;
    let limits = slices(bounds, source);
    let (mut reached, mut step) = (0.0, FIRST * horizon);
    for _ in 0..STEPS {
        let next = f64::min(reached + step, horizon);
        if source.highest(t, x, limits, [reached, next])? < 0.0 {
            reached = next;
            step *= 2.0;
            if reached >= horizon {
                break;
            }
        } else {
            step /= 2.0;
            if step <= TOLERANCE * f64::max(reached, FIRST * horizon) {
                break;
            }
        }
    }
    Some(reached)
}
