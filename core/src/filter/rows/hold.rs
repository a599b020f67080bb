//! h between two samples, while an input is held (`docs/theory.md#between-samples`).
//!
//! Let η(σ) = h(t + σ) along the model under the held input, less what disturbances and errors may take off. The model walks
//! through the hold in parts, and η and η̇ are read between them. From instants σ_1 < σ_2 < σ_3 the cubic through the outer
//! two predicts η and η̇ at the middle one. Its error there bounds the error of the cubics of the two halves. That is less
//! than an eighth of it where η is smooth (their error is max|η⁗| σ⁴/384 on a length σ), and twice it at a kink. The walk is
//! repeated in twice as many parts. It ends when that bound, and the difference of two walks, decide whether h ≥ 0.
//!
//! A dip narrower than a part does not show in a walk. So η is also enclosed, if the source can do so: either far from 0 on
//! the whole hold, which makes a walk unnecessary ([`Hold::floor`]), or after the walk, part by part.
//!
//! The parts differ in length, so that no motion of the set, however fast, looks like standstill at all instants. If
//! [`MOST`] parts cannot decide, this counts as h < 0: for example under an input that turns the plant by a hundred radians
//! within the hold.

use super::errors::Shortfall;
use crate::MAX_RELATIVE_DEGREE;
use crate::elementary;
use crate::lie::Predict;

/// Number of parts of the first walk.
const FEWEST: usize = 4;

/// Number of parts of the last walk.
const MOST: usize = 64;

/// The same of a brief search.
const MOST_BRIEF: usize = 16;

/// Largest ratio of the error of a cubic anywhere to its error in the middle. If η has a fourth derivative, the ratio is
/// less than 1; at a kink, such as the path past a small disc, it is 2. The difference of two walks gets the same factor: if
/// they do not resolve a turn, both are off.
const UNSURE: f64 = 4.0;

/// Numbers of equal parts of a hold on which η is enclosed, tried in turn until one decides.
const SHARPER: [u32; 4] = [1, 4, 16, 64];

/// What an enclosure may leave open beside a walk, as a part of the variation of η on it. If η is smooth, and turns where it
/// is 0, four parts leave a quarter of it and sixteen a sixty-fourth.
const LEFT_OPEN: f64 = 0.125;

/// η and η̇ at an instant.
#[derive(Clone, Copy)]
struct Node {
    at: f64,
    h: f64,
    slope: f64,
}

impl Node {
    const ZERO: Self = Self { at: 0.0, h: 0.0, slope: 0.0 };
}

/// The instant at which h is lowest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Lowest {
    /// A lower bound on h there.
    pub(super) h: f64,
    /// Seconds after the sample.
    pub(super) at: f64,
}

impl Lowest {
    pub(super) fn or(self, other: Self) -> Self {
        // NaN counts as lowest.
        if self.h < other.h || self.h.is_nan() { self } else { other }
    }
}

/// The path of h under one held input.
pub(super) struct Hold<'a> {
    /// `None` if the source cannot predict.
    pub(super) source: Option<&'a dyn Predict>,
    pub(super) t: f64,
    pub(super) x: &'a [f64],
    pub(super) u: &'a [f64],
    /// What is subtracted from the predicted h.
    pub(super) shortfall: Option<&'a Shortfall>,
    /// Whether the search is brief.
    pub(super) is_brief: bool,
}

impl Hold<'_> {
    /// Number of parts of the last walk.
    fn most(&self) -> usize {
        if self.is_brief { MOST_BRIEF } else { MOST }
    }

    /// A lower bound on η until `to`, including narrow dips; as sharp as possible if it is negative. `None` if the source
    /// has no enclosures.
    pub(super) fn floor(&self, to: f64) -> Option<f64> {
        let short = self.short(to);
        self.source?.lowest_held(self.t, self.x, self.u, to, short).map(|h| h - short)
    }

    /// Where η may be negative between `from` and `to`, by a lower bound on it, although a walk found no negative value; it
    /// `varies` by this much over the walk. `None` if it is not negative, or if nothing bounds it.
    fn narrow(
        &self,
        source: &dyn Predict,
        [from, to]: [f64; 2],
        varies: f64,
        x: &mut [f64],
    ) -> Option<Lowest> {
        let mut lowest = LARGEST;
        for parts in SHARPER.into_iter().filter(|parts| *parts as usize <= self.most()) {
            lowest = LARGEST;
            x.copy_from_slice(self.x);
            source.flow(x, self.u, from);
            for k in 0..parts {
                let [at, next] = [k, k + 1].map(|k| from + (to - from) * f64::from(k) / f64::from(parts));
                let short = self.short(next);
                let h = source.lowest_held(self.t + at, x, self.u, next - at, short)? - short;
                lowest = lowest.or(Lowest { h, at: 0.5 * (at + next) });
                source.flow(x, self.u, next - at);
            }
            if lowest.h >= -LEFT_OPEN * varies {
                return None;
            }
        }
        lowest.h.is_finite().then_some(lowest)
    }

    /// What is subtracted from h at an instant.
    fn short(&self, at: f64) -> f64 {
        self.shortfall.map_or(0.0, |shortfall| shortfall.at(at)[0])
    }

    /// A lower bound on η over `from` ≤ σ ≤ `to` (seconds after the sample), and where; `scratch` has the length of the
    /// state. `None` if the source cannot predict.
    pub(super) fn lowest(&self, from: f64, to: f64, scratch: &mut [f64]) -> Option<Lowest> {
        let (mut coarse, mut fine) = ([Node::ZERO; MOST + 1], [Node::ZERO; MOST + 1]);
        let mut parts = FEWEST;
        let source = self.source?;
        self.walk(source, [from, to], scratch, &mut coarse[..=parts]);
        loop {
            self.walk(source, [from, to], scratch, &mut fine[..=2 * parts]);
            let mut differ = 0.0;
            for (a, b) in coarse[..=parts].iter().zip(fine.iter().step_by(2)) {
                // Not `max`, which would drop NaN.
                let by = (a.h - b.h).abs() + (to - from) / parts as f64 * (a.slope - b.slope).abs();
                differ = if by <= differ { differ } else { by };
            }
            let (mut seen, mut sure) = (LARGEST, LARGEST);
            for three in fine[..=2 * parts].windows(3).step_by(2) {
                let (found, off) = dips(&[three[0], three[1], three[2]]);
                let unsure = UNSURE * (differ + off);
                sure = sure.or(Lowest { h: found.h - unsure, ..found });
                seen = seen.or(Lowest { h: found.h + unsure, ..found });
            }
            parts *= 2;
            if sure.h >= 0.0 {
                let varies = fine[..=parts].windows(2).map(|two| (two[1].h - two[0].h).abs()).sum();
                return self.narrow(source, [from, to], varies, scratch).or(Some(sure));
            }
            if seen.h < 0.0 || parts == self.most() {
                return Some(sure);
            }
            core::mem::swap(&mut coarse, &mut fine);
        }
    }

    /// h⁽⁰⁾ … h⁽ⁿ⁾ at an instant (s after the sample); `None` if the source cannot predict.
    pub(super) fn derivatives(&self, at: f64) -> Option<[f64; MAX_RELATIVE_DEGREE + 1]> {
        self.source.map(|source| self.ahead(source, self.x, 0.0, at))
    }

    /// Reads η and η̇ at `from`, `to` and between them.
    fn walk(&self, source: &dyn Predict, [from, to]: [f64; 2], x: &mut [f64], nodes: &mut [Node]) {
        x.copy_from_slice(self.x);
        let parts = nodes.len() - 1;
        let mut at = 0.0;
        if from > 0.0 {
            for k in 1..=parts {
                let next = instant([0.0, from], k, parts);
                source.flow(x, self.u, next - at);
                at = next;
            }
        }
        nodes[0] = self.node(source, x, at);
        for (k, node) in nodes.iter_mut().enumerate().skip(1) {
            let next = instant([from, to], k, parts);
            source.flow(x, self.u, next - at);
            at = next;
            *node = self.node(source, x, at);
        }
    }

    /// η and η̇ at the instant `at`, at which the state is `x`.
    fn node(&self, source: &dyn Predict, x: &[f64], at: f64) -> Node {
        let ahead = self.ahead(source, x, at, 0.0);
        let [less, slope] = self.shortfall.map_or([0.0; 2], |shortfall| shortfall.at(at));
        Node { at, h: ahead[0] - less, slope: ahead[1] - slope }
    }

    /// Derivatives of h `later` s after the instant `at`, at which the state is `x`.
    fn ahead(&self, source: &dyn Predict, x: &[f64], at: f64, later: f64) -> [f64; MAX_RELATIVE_DEGREE + 1] {
        let mut ahead = [0.0; MAX_RELATIVE_DEGREE + 1];
        source.values_ahead(self.t + at, x, self.u, later, &mut ahead);
        ahead
    }
}

/// A value above every other.
const LARGEST: Lowest = Lowest { h: f64::INFINITY, at: 0.0 };

/// The end of part `k` of `parts`, whose lengths grow from 0.8 to 1.2 times the mean.
fn instant([from, to]: [f64; 2], k: usize, parts: usize) -> f64 {
    /// Difference of the first and the last part from the mean length, as a part of it.
    const UNEVEN: f64 = 0.2;
    let z = k as f64 / parts as f64;
    if k == parts { to } else { from + (to - from) * z * (1.0 - UNEVEN * (1.0 - z)) }
}

/// The least value of the cubics between three instants, and the error at the middle one of the cubic through the outer two.
fn dips(&[a, middle, b]: &[Node; 3]) -> (Lowest, f64) {
    let length = b.at - a.at;
    if length <= 0.0 {
        return (Lowest { h: middle.h, at: middle.at }, 0.0);
    }
    let z = (middle.at - a.at) / length;
    let (left, right, rise) = (a.slope * length, b.slope * length, b.h - a.h);
    // a.h + left z + c z² + d z³.
    let (c, d) = (3.0 * rise - 2.0 * left - right, left + right - 2.0 * rise);
    let forecast = a.h + z * (left + z * (c + z * d));
    let slope = (left + z * (2.0 * c + 3.0 * z * d)) / length;
    let off = (middle.h - forecast).abs() + length / 4.0 * (middle.slope - slope).abs();
    (dip(a, middle).or(dip(middle, b)), off)
}

/// The least value of the cubic through two nodes.
fn dip(a: Node, b: Node) -> Lowest {
    let length = b.at - a.at;
    let (rise, left, right) = (b.h - a.h, a.slope * length, b.slope * length);
    // a.h + left s + c s² + d s³ for s in [0, 1].
    let (c, d) = (3.0 * rise - 2.0 * left - right, left + right - 2.0 * rise);
    let mut lowest = Lowest { h: a.h, at: a.at }.or(Lowest { h: b.h, at: b.at });
    let root = elementary::sqrt((c * c - 3.0 * d * left).max(0.0));
    // The two zeros of the slope, in the form without cancellation.
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
