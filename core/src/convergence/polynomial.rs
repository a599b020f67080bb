//! All real roots of polynomials of small degree, to the accuracy that their data allow.
//!
//! Between two neighbouring real zeros of p' the polynomial is monotone, so every real zero of p lies
//! alone in one of the intervals that the zeros of p' cut out, or is one of those zeros (a multiple
//! root). Going up from the linear derivative, each zero is bracketed by a change of sign and found by
//! bisection to the last bit. Nothing diverges and none is missed, whatever the scales. All real zeros
//! of a polynomial of degree d lie within Fujiwara's bound
//!
//! ```math
//! |x| \le 2 \max_{1\le k\le d} \left|\frac{p_{d-k}}{p_d}\right|^{1/k}.
//! ```
//!
//! Bisection runs over the floating-point numbers in their order, not over the real line: at most 64
//! halvings from −10³⁰⁸ to 10³⁰⁸, with the same relative accuracy at every scale. For |x| > 1 the sign
//! of p(x) is taken from p(x)/|x|^d, which cannot overflow.
//!
//! # Requirements
//!
//! The *value* of p(x) is known to about ε Σ |p_i xⁱ|, ε the unit round-off; where |p| at a zero of p'
//! is below that, the data do not decide whether p touches zero, and the point counts as a root. A
//! simple root is found to that uncertainty divided by |p'|, a double one to its square root: this is
//! the conditioning limit, and no method that receives the same numbers does better.
//!
//! # References
//!
//! M. Fujiwara, *Über die obere Schranke des absoluten Betrages der Wurzeln einer algebraischen
//! Gleichung*, Tôhoku Math. J. 10 (1916) 167–171.

use crate::MAX_RELATIVE_DEGREE;
use crate::elementary;

/// Largest number of coefficients, one more than the largest degree.
const LEN: usize = MAX_RELATIVE_DEGREE;

/// Part of Σ |p_i xⁱ| below which a value is round-off: a few units for each of up to 8 terms.
const ROUND_OFF: f64 = 16.0 * f64::EPSILON;

/// Real roots in rising order, without repetition.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Roots {
    values: [f64; LEN],
    len: usize,
}

impl Roots {
    fn push(&mut self, root: f64) {
        // A multiple root may be seen from both sides.
        if self.len < LEN && self.as_slice().last() != Some(&root) {
            self.values[self.len] = root;
            self.len += 1;
        }
    }

    /// The roots in rising order.
    pub fn as_slice(&self) -> &[f64] {
        &self.values[..self.len]
    }

    /// The largest root.
    pub fn largest(&self) -> Option<f64> {
        self.as_slice().last().copied()
    }
}

/// p(x) and Σ |p_i xⁱ|, both divided by max(1, |x|)^d where d is the degree.
fn scaled(p: &[f64], x: f64) -> (f64, f64) {
    let horner = |(sum, size): (f64, f64), c: &f64, y: f64| (sum * y + c, size * y.abs() + c.abs());
    if x.abs() <= 1.0 {
        return p.iter().rev().fold((0.0, 0.0), |acc, c| horner(acc, c, x));
    }
    let (sum, size) = p.iter().fold((0.0, 0.0), |acc, c| horner(acc, c, 1.0 / x));
    let odd = p.len().is_multiple_of(2);
    (if x < 0.0 && odd { -sum } else { sum }, size)
}

/// The sign of p(x), 0 where its value is below the round-off of its terms.
fn sign(p: &[f64], x: f64) -> i8 {
    match scaled(p, x) {
        (sum, size) if sum.abs() <= ROUND_OFF * size => 0,
        (sum, _) if sum < 0.0 => -1,
        _ => 1,
    }
}

/// All real roots of the polynomial with the finite coefficients `p` (p₀ first, at most
/// [`MAX_RELATIVE_DEGREE`] of them, any unit); none
/// for a constant. Leading zeros are allowed; a coefficient 10³⁰⁸ times smaller than the largest is one.
pub fn real_roots(p: &[f64]) -> Roots {
    let mut roots = Roots::default();
    let largest = p.iter().fold(0.0, |m: f64, c| m.max(c.abs()));
    let Some(degree) = p.iter().rposition(|c| c.abs() / largest > 0.0) else { return roots };
    // The derivatives of p, from the linear one up to p itself.
    for order in (0..degree).rev() {
        let mut q = [0.0; LEN];
        let q = &mut q[..=degree - order];
        for (i, qi) in q.iter_mut().enumerate() {
            // d^order/dx^order of x^(i + order).
            *qi = p[i + order] / largest * (i + 1..=i + order).map(|f| f as f64).product::<f64>();
        }
        roots = between(q, &roots);
    }
    roots
}

/// The roots of `q`, whose derivative has the roots `turns`.
fn between(q: &[f64], turns: &Roots) -> Roots {
    let degree = q.len() - 1;
    let bound = (1..=degree)
        .map(|k| 2.0 * elementary::powf((q[degree - k] / q[degree]).abs(), 1.0 / k as f64))
        .fold(1.0, f64::max);
    // Half as much again, for the round-off of the bound itself; at least 1, where no power underflows.
    let bound = (1.5 * bound).min(f64::MAX);
    let mut roots = Roots::default();
    let mut low = -bound;
    for &high in turns.as_slice().iter().chain(&[bound]) {
        let high = elementary::clamp(high, low, bound);
        let (at_low, at_high) = (sign(q, low), sign(q, high));
        if at_low == 0 {
            roots.push(low);
        } else if at_low * at_high < 0 {
            roots.push(bisect(q, low, high, at_low < 0));
        }
        low = high;
    }
    if sign(q, low) == 0 {
        roots.push(low);
    }
    roots
}

/// The zero of `q` between `low` and `high`, where it changes sign once.
fn bisect(q: &[f64], low: f64, high: f64, rising: bool) -> f64 {
    if q[0] == 0.0 && low < 0.0 && high > 0.0 {
        // Below the smallest normal numbers q underflows, and bisection would miss 0 by one of them.
        return 0.0;
    }
    let high = first(low, high, |x| (scaled(q, x).0 < 0.0) != rising);
    // Neighbouring numbers: the one with the smaller value.
    let low = from_rank(rank(high) - 1).max(low);
    if scaled(q, low).0.abs() < scaled(q, high).0.abs() { low } else { high }
}

/// The least number above `low` at which `holds`, given that it holds at `high` > `low` and, once
/// true, stays true.
pub(super) fn first(low: f64, high: f64, holds: impl Fn(f64) -> bool) -> f64 {
    let (mut low, mut high) = (rank(low), rank(high));
    loop {
        let middle = low.midpoint(high);
        if middle == low || middle == high {
            return from_rank(high);
        }
        if holds(from_rank(middle)) {
            high = middle;
        } else {
            low = middle;
        }
    }
}

/// As [`first`], with few evaluations if that number is next to `guess`.
pub(super) fn first_near(guess: f64, low: f64, high: f64, holds: impl Fn(f64) -> bool) -> f64 {
    if !(low < guess && guess < high) {
        return first(low, high, holds);
    }
    let (mut low, mut high) = (low, high);
    // Away from the guess in growing steps, until one is on the other side.
    let (place, is_above) = (rank(guess), holds(guess));
    let (mut near, mut step) = (guess, 1_i64);
    loop {
        let far = from_rank(place.saturating_add(if is_above { -step } else { step }));
        *(if is_above { &mut high } else { &mut low }) = near;
        if !(low < far && far < high) {
            break;
        }
        if holds(far) != is_above {
            *(if is_above { &mut low } else { &mut high }) = far;
            break;
        }
        (near, step) = (far, step.saturating_mul(4));
    }
    first(low, high, holds)
}

/// The place of `x` among the floating-point numbers in rising order, 0 for both zeros.
fn rank(x: f64) -> i64 {
    let bits = x.to_bits().cast_signed();
    if bits < 0 { i64::MIN - bits } else { bits }
}

/// The number at a place.
fn from_rank(rank: i64) -> f64 {
    f64::from_bits(if rank < 0 { i64::MIN - rank } else { rank }.cast_unsigned())
}

#[cfg(test)]
mod tests {
    use alloc::vec::Vec;

    use super::*;

    /// The coefficients of Π (x − r), p₀ first.
    fn product(roots: &[f64]) -> Vec<f64> {
        roots.iter().fold(vec![1.0], |p, r| {
            (0..=p.len())
                .map(|i| if i == 0 { 0.0 } else { p[i - 1] } - r * p.get(i).unwrap_or(&0.0))
                .collect()
        })
    }

    #[test]
    fn ranks_are_in_order() {
        let rising = [f64::MIN, -1.0, -f64::MIN_POSITIVE, -5e-324, 0.0, 5e-324, 1e-8, 1.0, 2.0, f64::MAX];
        for pair in rising.windows(2) {
            assert!(rank(pair[0]) < rank(pair[1]), "{pair:?}");
            assert_eq!(from_rank(rank(pair[0])), pair[0]);
        }
        assert_eq!(rank(-0.0), 0);
    }

    #[test]
    fn a_guess_changes_no_bit_of_the_first_number() {
        let ranges = [(0.0, f64::MAX), (-1e-3, 7.0), (f64::MIN, f64::MAX), (2.0, 2.0 + 4.0 * f64::EPSILON)];
        let numbers =
            [-1e300, -4.0, -1e-9, 0.0, 5e-324, 1e-9, 0.3, 1.0, 2.0 + f64::EPSILON, 6.9, 1e10, f64::MAX];
        for (low, high) in ranges {
            for border in numbers.into_iter().filter(|b| low < *b && *b <= high) {
                let holds = |x: f64| x >= border;
                assert_eq!(first(low, high, holds), border);
                let beside = [-9, -1, 0, 1, 1000].map(|ranks| from_rank(rank(border).saturating_add(ranks)));
                for guess in numbers.into_iter().chain(beside).chain([f64::NAN, f64::INFINITY]) {
                    let looks = core::cell::Cell::new(0);
                    let counted = |x: f64| {
                        looks.set(looks.get() + 1);
                        holds(x)
                    };
                    assert_eq!(first_near(guess, low, high, counted), border, "{guess} in {low} to {high}");
                    // Next to it: the guess, two or three steps away, and the halvings between them.
                    let is_near = rank(border).abs_diff(rank(guess)) <= 9;
                    assert!(!is_near || looks.get() <= 8 || guess <= low || guess >= high, "{looks:?} looks");
                }
            }
        }
    }

    #[test]
    fn simple_roots_of_every_degree() {
        for n in 1..LEN {
            let wanted: Vec<f64> = (1..=n).map(|i| i as f64).collect();
            let found = real_roots(&product(&wanted));
            assert_eq!(found.as_slice().len(), n, "{found:?}");
            for (x, w) in found.as_slice().iter().zip(&wanted) {
                // Wilkinson's polynomial of degree 7: condition of a root up to 4·10⁴ units.
                assert!((x - w).abs() < 1e-10, "degree {n}: {x} for {w}");
            }
        }
    }

    #[test]
    fn roots_of_very_different_size() {
        let wanted = [-1e20, -3e-7, 0.0, 2e-13, 5.0, 7e18];
        let found = real_roots(&product(&wanted));
        assert_eq!(found.as_slice().len(), wanted.len(), "{found:?}");
        for (x, w) in found.as_slice().iter().zip(wanted) {
            // Well separated roots have a condition near 1: a few units of round-off.
            assert!((x - w).abs() <= 1e-14 * w.abs(), "{x} for {w}");
        }
        let far = real_roots(&[-1.0, 1e-300]).largest().expect("a root");
        assert!((far / 1e300 - 1.0).abs() <= 1e-15, "{far}");
        assert_eq!(real_roots(&[-1e300, 0.0, 0.0, 1e-7]).as_slice().len(), 1);
        assert_eq!(real_roots(&[-1e300, 0.0, 0.0, 1e-300]).largest(), None);
    }

    #[test]
    fn multiple_roots_count_once_and_complex_ones_not() {
        assert_eq!(real_roots(&product(&[2.0, 2.0])).as_slice(), [2.0]);
        assert_eq!(real_roots(&product(&[0.0; 7])).as_slice(), [0.0]);
        assert_eq!(real_roots(&product(&[-1.0, 3.0, 3.0])).as_slice(), [-1.0, 3.0]);
        assert_eq!(real_roots(&[1.0, 0.0, 1.0]).largest(), None);
        // E_6, the truncated exponential: positive everywhere.
        assert_eq!(real_roots(&[720.0, 720.0, 360.0, 120.0, 30.0, 6.0, 1.0]).largest(), None);
        for constant in [&[][..], &[0.0], &[0.0, 0.0], &[3.0], &[3.0, 0.0, 0.0]] {
            assert_eq!(real_roots(constant).largest(), None);
        }
        assert_eq!(real_roots(&[3.0, -1.5, 0.0]).largest(), Some(2.0));
    }
}
