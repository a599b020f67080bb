//! What h does while an input is held: the instants between two samples.
//!
//! Let η(s) = h(t + s) along the model under the held input. Between two instants a < b at which η and η̇ are known, the
//! cubic through them is off by at most max|η⁗| (b − a)⁴/384, and most in the middle. So the interval is halved, and what
//! the cubic is off there bounds what the cubics of the halves, each off by a sixteenth of it, leave open. Where that is
//! not enough to decide, the halves are looked at in turn, down to 1/256 of the hold.
//!
//! The model is integrated anew up to each instant. What its own steps are off at the end of the hold is seen by going
//! there in twice as many, and counted too. That the fourth derivative of η does not change its size within a part is
//! assumed, so an η that swings many times within one 256th of the hold can be missed; one that swings within the hold shows
//! as slopes that do not fit its values.

use crate::lie::{Ahead, DerivativeSource};

/// Halvings of the hold.
const DEPTH: u32 = 8;

/// The part of h at an instant that η may lose on the way to the next before the interval is looked at more closely.
const CLEAR: f64 = 0.5;

/// How many times what twice as many steps change is taken for the error of the prediction: where an input turns the plant
/// by more than a radian within the hold, both are off.
const UNSURE: f64 = 10.0;

/// η and η̇ at an instant.
#[derive(Clone, Copy)]
struct Node {
    at: f64,
    h: f64,
    slope: f64,
}

/// Where h is lowest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Lowest {
    /// A lower bound on h there.
    pub(super) h: f64,
    /// Seconds after the sample.
    pub(super) at: f64,
}

impl Lowest {
    pub(super) fn or(self, other: Self) -> Self {
        // Not `<`: what is not a number counts as lowest.
        if self.h >= other.h { other } else { self }
    }
}

/// The path of h under one held input.
pub(super) struct Hold<'a> {
    pub(super) source: &'a dyn DerivativeSource,
    pub(super) t: f64,
    pub(super) x: &'a [f64],
    pub(super) u: &'a [f64],
}

impl Hold<'_> {
    /// A lower bound on h over `from` ≤ s ≤ `to` (s after the sample), and where; `scratch` has the length
    /// of the state. `None` where the source cannot predict.
    pub(super) fn lowest(&self, from: f64, to: f64, scratch: &mut [f64]) -> Option<Lowest> {
        let last = self.node(to)?;
        let found = match from < to {
            true => self.between(self.node(from)?, last, DEPTH)?,
            false => Lowest { h: last.h, at: to },
        };
        let error = UNSURE * self.integration_error(last, scratch)?;
        Some(Lowest { h: found.h - error, ..found })
    }

    /// h at an instant (s after the sample); `None` where the source cannot predict.
    pub(super) fn value(&self, at: f64) -> Option<f64> {
        self.node(at).map(|node| node.h)
    }

    fn node(&self, at: f64) -> Option<Node> {
        let mut ahead = Ahead::ZERO;
        let known = self.source.ahead(self.t, self.x, self.u, at, &mut ahead) && ahead.is_finite();
        known.then_some(Node { at, h: ahead.value[0], slope: ahead.value[1] })
    }

    /// What the prediction at the `last` node is off, of h and by its slope.
    fn integration_error(&self, last: Node, scratch: &mut [f64]) -> Option<f64> {
        let (to, half) = (last.at, last.at / 2.0);
        scratch.copy_from_slice(self.x);
        let mut ahead = Ahead::ZERO;
        let known = self.source.predict(scratch, self.u, half)
            && self.source.ahead(self.t + half, scratch, self.u, half, &mut ahead);
        known.then(|| (ahead.value[0] - last.h).abs() + to * (ahead.value[1] - last.slope).abs())
    }

    fn between(&self, a: Node, b: Node, depth: u32) -> Option<Lowest> {
        let ends = Lowest { h: a.h, at: a.at }.or(Lowest { h: b.h, at: b.at });
        // A cubic leaves its ends by at most 4/27 of the way that each slope alone would take it.
        let moved = (b.at - a.at) * (a.slope.abs() + b.slope.abs()) * (4.0 / 27.0);
        if ends.h < 0.0 || depth < DEPTH && moved <= CLEAR * ends.h {
            return Some(Lowest { h: ends.h - moved * f64::from(u8::from(ends.h >= 0.0)), ..ends });
        }
        let middle = self.node(0.5 * (a.at + b.at))?;
        let length = b.at - a.at;
        let foreseen = 0.5 * (a.h + b.h) + length * (a.slope - b.slope) / 8.0;
        let slope = 1.5 * (b.h - a.h) / length - 0.25 * (a.slope + b.slope);
        let off = (middle.h - foreseen).abs() + length / 4.0 * (middle.slope - slope).abs();
        let halves = dip(a, middle).or(dip(middle, b));
        let sure = halves.h - off / 16.0;
        // What is off must be small for the halves to be off by so much less; and once may be chance.
        if middle.h < 0.0 || depth < DEPTH && sure >= off {
            return Some(Lowest { h: if middle.h < 0.0 { halves.h } else { sure }, ..halves });
        }
        if depth == 0 {
            return Some(Lowest { h: halves.h - off, ..halves });
        }
        let (left, right) = (self.between(a, middle, depth - 1)?, self.between(middle, b, depth - 1)?);
        Some(left.or(right))
    }
}

/// The least value of the cubic through two nodes.
fn dip(a: Node, b: Node) -> Lowest {
    let length = b.at - a.at;
    let (rise, left, right) = (b.h - a.h, a.slope * length, b.slope * length);
    // a.h + left s + c s² + d s³ for s in [0, 1].
    let (c, d) = (3.0 * rise - 2.0 * left - right, left + right - 2.0 * rise);
    let mut lowest = Lowest { h: a.h, at: a.at }.or(Lowest { h: b.h, at: b.at });
    let root = (c * c - 3.0 * d * left).max(0.0).sqrt();
    // The two zeros of the slope, in the form that does not cancel.
    let sum = -(c + root.copysign(c));
    for s in [sum / (3.0 * d), left / sum] {
        if s > 0.0 && s < 1.0 {
            let h = a.h + s * (left + s * (c + s * d));
            lowest = lowest.or(Lowest { h, at: a.at + s * length });
        }
    }
    lowest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_dip_of_a_cubic() {
        // η = (s − 0.3)² − 0.01 on [0, 1].
        let node = |at: f64| Node { at, h: (at - 0.3).powi(2) - 0.01, slope: 2.0 * (at - 0.3) };
        let found = dip(node(0.0), node(1.0));
        assert!((found.h + 0.01).abs() < 1e-15 && (found.at - 0.3).abs() < 1e-12, "{found:?}");
        // Falling throughout: the end.
        let found = dip(node(-1.0), node(0.0));
        assert_eq!((found.h, found.at), (node(0.0).h, 0.0));
    }
}
