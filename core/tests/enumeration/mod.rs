//! The exact answer of small quadratic programs, by enumeration of active sets in double-double
//! arithmetic (about 32 digits).

#![allow(dead_code, reason = "each test binary uses its part")]

use std::ops::{Add, Div, Mul, Neg, Sub};

use punctual_core::qp::{Bounds, Row};

/// The unevaluated sum of two numbers, the second below the round-off of the first.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Twofold(f64, f64);

impl Twofold {
    pub(crate) const ZERO: Self = Self(0.0, 0.0);

    pub(crate) fn value(self) -> f64 {
        self.0 + self.1
    }

    fn of_sum(a: f64, b: f64) -> Self {
        let s = a + b;
        let t = s - a;
        Self(s, (a - (s - t)) + (b - t))
    }
}

impl From<f64> for Twofold {
    fn from(value: f64) -> Self {
        Self(value, 0.0)
    }
}

impl Neg for Twofold {
    type Output = Self;
    fn neg(self) -> Self {
        Self(-self.0, -self.1)
    }
}

impl Add for Twofold {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        let (high, low) = (Self::of_sum(self.0, other.0), Self::of_sum(self.1, other.1));
        let first = Self::of_sum(high.0, high.1 + low.0);
        Self::of_sum(first.0, first.1 + low.1)
    }
}

impl Sub for Twofold {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Mul for Twofold {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        let p = self.0 * other.0;
        let rest = self.0.mul_add(other.0, -p) + (self.0 * other.1 + self.1 * other.0);
        Self::of_sum(p, rest)
    }
}

impl Div for Twofold {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        let first = self.0 / other.0;
        let rest = self - other * Self::from(first);
        let second = rest.0 / other.0;
        let rest = rest - other * Self::from(second);
        Self::of_sum(first, second) + Self::from(rest.0 / other.0)
    }
}

/// aᵀu ≥ b in at most three inputs.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Exact {
    pub(crate) normal: [f64; 3],
    pub(crate) floor: Twofold,
}

/// The rows, then the finite bounds.
pub(crate) fn constraints(rows: &[Row], bounds: &Bounds, m: usize) -> Vec<Exact> {
    let exact = |normal: &[f64], floor: f64| Exact {
        normal: std::array::from_fn(|i| if i < m { normal[i] } else { 0.0 }),
        floor: floor.into(),
    };
    let mut list: Vec<Exact> = rows.iter().map(|row| exact(&row.normal, row.floor)).collect();
    for i in 0..m {
        let mut axis = [0.0; 3];
        axis[i] = 1.0;
        if bounds.min[i].is_finite() {
            list.push(exact(&axis, bounds.min[i]));
        }
        axis[i] = -1.0;
        if bounds.max[i].is_finite() {
            list.push(exact(&axis, -bounds.max[i]));
        }
    }
    list
}

pub(crate) type Point = [Twofold; 3];

impl Exact {
    pub(crate) fn slack(&self, u: &Point) -> Twofold {
        (0..3).fold(-self.floor, |s, i| s + Twofold::from(self.normal[i]) * u[i])
    }

    /// The size of what a slack at `u`, computed from the point `from`, is the difference of.
    fn terms(&self, u: &Point, from: &Point) -> f64 {
        let size = u.iter().chain(from).fold(0.0, |s: f64, v| s.max(v.0.abs()));
        self.normal.iter().fold(self.floor.0.abs(), |s, a| s + a.abs() * size)
    }

    fn holds(&self, u: &Point, from: &Point, tolerance: f64) -> bool {
        self.slack(u).0 >= -tolerance * self.terms(u, from)
    }
}

/// The numbers that a candidate is computed with.
trait Number:
    Copy + From<f64> + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    fn of(exact: Twofold) -> Self;
    fn rounded(self) -> f64;
}

impl Number for f64 {
    fn of(exact: Twofold) -> Self {
        exact.0
    }
    fn rounded(self) -> f64 {
        self
    }
}

impl Number for Twofold {
    fn of(exact: Twofold) -> Self {
        exact
    }
    fn rounded(self) -> f64 {
        self.0
    }
}

/// The point nearest to `from` at which the rows of a set are equalities.
struct Candidate<T> {
    u: [T; 3],
    multipliers: [T; 3],
    /// The least sine of the angle between a row and those before it.
    sine: f64,
}

/// `None` where the rows of `set` depend on each other.
fn on<T: Number>(list: &[Exact], set: &[usize], from: &Point) -> Option<Candidate<T>> {
    let k = set.len();
    let zero = T::from(0.0);
    let from = from.map(T::of);
    let mut gram = [[zero; 3]; 3];
    let mut y = [zero; 3];
    let mut size = [0.0; 3];
    let mut squared_sine: f64 = 1.0;
    for (i, &s) in set.iter().enumerate() {
        let a = list[s].normal.map(T::from);
        for (j, &t) in set.iter().enumerate() {
            gram[i][j] = a.iter().zip(list[t].normal).fold(zero, |s, (a, b)| s + *a * T::from(b));
        }
        size[i] = gram[i][i].rounded();
        y[i] = a.iter().zip(from).fold(T::of(list[s].floor), |s, (a, v)| s - *a * v);
    }
    for i in 0..k {
        squared_sine = squared_sine.min(gram[i][i].rounded() / size[i]);
        // Rows closer than 1e-13 in angle are the same for doubles.
        if squared_sine <= 1e-26 {
            return None;
        }
        for j in i + 1..k {
            let factor = gram[j][i] / gram[i][i];
            for l in i..k {
                gram[j][l] = gram[j][l] - factor * gram[i][l];
            }
            y[j] = y[j] - factor * y[i];
        }
    }
    for i in (0..k).rev() {
        for j in i + 1..k {
            y[i] = y[i] - gram[i][j] * y[j];
        }
        y[i] = y[i] / gram[i][i];
    }
    let mut u = from;
    for (i, &s) in set.iter().enumerate() {
        for (u, a) in u.iter_mut().zip(list[s].normal) {
            *u = *u + y[i] * T::from(a);
        }
    }
    Some(Candidate { u, multipliers: y, sine: squared_sine.sqrt() })
}

/// Whether plain numbers suffice to see that `set` is not the active set: most are discarded by it.
fn clearly_not(list: &[Exact], set: &[usize], from: &Point) -> bool {
    /// Far above the round-off of plain numbers at the least sine admitted.
    const CLEARLY: f64 = 1e-6;
    let Some(Candidate { u, multipliers, sine }) = on::<f64>(list, set, from) else { return false };
    if sine < 1e-3 {
        return false;
    }
    let largest = multipliers[..set.len()].iter().fold(0.0, |s: f64, l| s.max(l.abs()));
    if multipliers[..set.len()].iter().any(|l| *l < -CLEARLY * largest) && set.len() == 1 {
        return true;
    }
    let size = from.iter().fold(0.0, |s: f64, v| s.max(v.0.abs()));
    list.iter().enumerate().any(|(k, row)| {
        let value = row.normal.iter().zip(u).fold(-row.floor.0, |s, (a, v)| s + a * v);
        let terms =
            row.normal.iter().zip(u).fold(row.floor.0.abs(), |s, (a, v)| s + a.abs() * (v.abs() + size));
        !set.contains(&k) && value < -CLEARLY * terms
    })
}

/// Every set of at most `m` of `count` things, by size.
fn sets(count: usize, m: usize) -> impl Iterator<Item = Vec<usize>> {
    let of_size = move |size: usize| {
        let mut set: Vec<usize> = (0..size).collect();
        let mut more = size <= count;
        std::iter::from_fn(move || {
            let current = more.then(|| set.clone())?;
            more = false;
            for i in (0..size).rev() {
                if set[i] + size - i < count {
                    set[i] += 1;
                    for j in i + 1..size {
                        set[j] = set[j - 1] + 1;
                    }
                    more = true;
                    break;
                }
            }
            Some(current)
        })
    };
    (0..=m).flat_map(of_size)
}

/// The answer of [`minimiser`].
pub(crate) struct Found {
    pub(crate) u: Point,
    /// The active rows.
    pub(crate) set: Vec<usize>,
    pub(crate) multipliers: [Twofold; 3],
    /// The least sine of the angle between a row of the set and those before it.
    pub(crate) sine: f64,
}

/// The point of {rows of `list`} nearest to `from`: the set of active rows that satisfies the conditions
/// of optimality up to `tolerance`. `None`: no point satisfies all rows.
pub(crate) fn minimiser(list: &[Exact], m: usize, from: &Point, tolerance: f64) -> Option<Found> {
    sets(list.len(), m).find_map(|set| {
        if clearly_not(list, &set, from) {
            return None;
        }
        let Candidate { u, multipliers, sine } = on::<Twofold>(list, &set, from)?;
        let signs = multipliers[..set.len()].iter().all(|l| l.0 >= 0.0);
        let holds = signs
            && list.iter().enumerate().all(|(k, row)| set.contains(&k) || row.holds(&u, from, tolerance));
        holds.then_some(Found { u, set, multipliers, sine })
    })
}

/// The least violation in the order of the first `rows` rows of `list`, then nearest to `from`; the other
/// rows are bounds of every component. Returns the point, and which rows are relaxed.
pub(crate) fn least_violation(
    list: &[Exact],
    rows: usize,
    m: usize,
    from: &Point,
    tolerance: f64,
) -> (Point, Vec<bool>) {
    let mut accepted: Vec<Exact> = list[rows..].to_vec();
    let mut relaxed = Vec::new();
    for row in &list[..rows] {
        let mut row = *row;
        // The vertex that is best for this row.
        let vertices = sets(accepted.len(), m).filter(|set| set.len() == m);
        let vertices = vertices.filter_map(|set| on::<Twofold>(&accepted, &set, from).map(|c| c.u));
        let feasible = vertices.filter(|u| accepted.iter().all(|other| other.holds(u, from, tolerance)));
        let best = feasible.map(|u| row.slack(&u)).fold(None, |best: Option<Twofold>, s| match best {
            Some(b) if (b - s).0 >= 0.0 => best,
            _ => Some(s),
        });
        let best = best.expect("a bounded set has a vertex");
        relaxed.push(best.0 < -tolerance * row.terms(from, from));
        if best.0 < 0.0 {
            row.floor = row.floor + best;
        }
        accepted.push(row);
    }
    let found = minimiser(&accepted, m, from, tolerance).expect("the accepted rows can be met");
    (found.u, relaxed)
}

/// The minimiser where the first `caps.len()` rows of `list` are soft: their multipliers do not exceed the
/// caps. Every set of rows at their cap is tried.
pub(crate) fn softened(
    list: &[Exact],
    caps: &[f64],
    m: usize,
    from: &Point,
    tolerance: f64,
) -> Option<Point> {
    (0_u32..1 << caps.len()).find_map(|code| {
        let at_cap = |k: usize| k < caps.len() && code >> k & 1 == 1;
        let mut moved = *from;
        for k in (0..caps.len()).filter(|&k| at_cap(k)) {
            for (u, a) in moved.iter_mut().zip(list[k].normal) {
                *u = *u + Twofold::from(caps[k]) * Twofold::from(a);
            }
        }
        let others: Vec<usize> = (0..list.len()).filter(|&k| !at_cap(k)).collect();
        let rest: Vec<Exact> = others.iter().map(|&k| list[k]).collect();
        let Found { u, set, multipliers, .. } = minimiser(&rest, m, &moved, tolerance)?;
        let below = |(i, &s): (usize, &usize)| {
            let k = others[s];
            k >= caps.len() || multipliers[i].0 <= caps[k] * (1.0 + tolerance)
        };
        let fits = set.iter().enumerate().all(below);
        let short = (0..caps.len()).filter(|&k| at_cap(k));
        let fits =
            fits && short.into_iter().all(|k| list[k].slack(&u).0 <= tolerance * list[k].terms(&u, from));
        fits.then_some(u)
    })
}
