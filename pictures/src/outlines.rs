//! The edges of safe sets in a plane: those of a shape from its numbers, those of an expression where h = 0.

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use punctual_core::elementary;
use punctual_core::filter::Filter;
use punctual_cosim::error::Error;
use punctual_fmu::configuration::{BarrierSection, FilterConfiguration, Shape, mentions};

/// Points of the outline of a round shape.
const CORNERS: usize = 96;
/// Length of the edge of a half-plane, as a multiple of the size of everything else in the plane.
const FAR: f64 = 1e3;
/// Cells along each side of the square that is searched for h = 0.
const CELLS: usize = 160;
/// How far that square extends from the centre of the picture, as multiples of the size of everything else in
/// it.
const REACHES: [f64; 3] = [1.0, 2.0, 4.0];

/// The edge of a set.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Outline {
    /// Legend entry; empty for none.
    pub label: String,
    /// Closed lines, without repeating their first point. A point is inside if an odd number of lines
    /// encloses it.
    pub rings: Vec<Vec<[f64; 2]>>,
    /// Whether it must be avoided.
    pub obstacle: bool,
    /// Whether it is unbounded.
    pub endless: bool,
}

impl Outline {
    /// The outline of the shape of `section`, relative to its centre; `number` gives its numbers. `None` if
    /// the shape is not in a plane. `size` is the size of everything else in the plane.
    pub fn of_shape(
        section: &BarrierSection,
        number: impl Fn(&str) -> Option<f64>,
        size: f64,
    ) -> Option<Self> {
        let pair = |field: &str| Some([number(&format!("{field}[1]"))?, number(&format!("{field}[2]"))?]);
        let (corners, obstacle) = match section.shape {
            Shape::Disc { .. } | Shape::QuadraticDisc { .. } => (round([number("radius")?; 2], 1.0), false),
            Shape::Obstacle { .. } => (round([number("radius")?; 2], 1.0), true),
            Shape::Ellipse { .. } => (round(pair("half_axes")?, 1.0), false),
            Shape::EllipticObstacle { .. } => (round(pair("half_axes")?, 1.0), true),
            // (x/A)⁴ + (y/B)⁴ = 1, inside the rectangle; an obstacle is enlarged until the curve encloses it.
            Shape::Rectangle { .. } => (round(pair("half_sides")?, 0.5), false),
            Shape::RectangularObstacle { .. } => {
                (round(pair("half_sides")?.map(|side| side * elementary::powf(2.0, 0.25)), 0.5), true)
            }
            // Of what is in space, as seen from above.
            Shape::Sphere { .. } => (round([number("radius")?; 2], 1.0), false),
            Shape::SphericalObstacle { .. } => (round([number("radius")?; 2], 1.0), true),
            Shape::Box { .. } => (round(pair("half_sides")?, 0.5), false),
            Shape::BoxObstacle { .. } => {
                (round(pair("half_sides")?.map(|side| side * elementary::powf(3.0, 0.25)), 0.5), true)
            }
            Shape::HalfPlane { .. } => (half_plane(pair("normal")?, FAR * size), false),
            Shape::Apart { .. }
            | Shape::AtMost { .. }
            | Shape::AtLeast { .. }
            | Shape::SpeedLimit { .. }
            | Shape::Expression { .. }
            | Shape::Plugin { .. }
            | Shape::External { .. } => return None,
        };
        let (sin, cos) = elementary::sin_cos(number("angle").unwrap_or(0.0));
        let corners = corners.into_iter().map(|[x, y]| [cos * x - sin * y, sin * x + cos * y]);
        Some(Self {
            label: section.name.clone(),
            rings: vec![corners.collect()],
            obstacle,
            endless: matches!(section.shape, Shape::HalfPlane { .. }),
        })
    }

    /// The same outline with its centre at `centre`.
    pub fn moved(mut self, [x, y]: [f64; 2]) -> Self {
        self.rings.iter_mut().flatten().for_each(|corner| *corner = [corner[0] + x, corner[1] + y]);
        self
    }

    /// The outline of barrier `index` of `filter`, an expression of only the position. The square around
    /// `ranges` is enlarged, at most by a factor of four, until it contains the whole outline. The position
    /// is the states `plane`; the others have the values of `x`, which do not matter. `None` if h = 0 does
    /// not occur there.
    ///
    /// # Errors
    ///
    /// A filter that cannot be built.
    pub fn of_expression(
        filter: &FilterConfiguration,
        index: usize,
        (plane, x): ([usize; 2], &[f64]),
        ranges: [(f64, f64); 2],
    ) -> Result<Option<Self>, Error> {
        let mut alone = filter.clone();
        alone.barrier = vec![filter.barrier[index].clone()];
        let built = alone.build()?;
        let size = ranges.map(|(low, high)| high - low).into_iter().fold(0.0, f64::max);
        let mut found = None;
        for reach in REACHES {
            found = Self::within(&built, (plane, x), filter.experiment.start_time, (ranges, reach * size))?
                .or(found);
            if found.as_ref().is_some_and(|outline| !outline.endless) {
                break;
            }
        }
        Ok(found.map(|outline| Self { label: filter.barrier[index].name.clone(), ..outline }))
    }

    /// The outline of the only barrier of `built`, in the square that extends by `reach` to each side from
    /// the centre of `ranges`.
    fn within(
        built: &Filter,
        (plane, x): ([usize; 2], &[f64]),
        t: f64,
        (ranges, reach): ([(f64, f64); 2], f64),
    ) -> Result<Option<Self>, Error> {
        let step = 2.0 * reach / CELLS as f64;
        let from = ranges.map(|(low, high)| low / 2.0 + high / 2.0 - reach);
        let (mut x, mut h) = (x.to_vec(), [0.0]);
        let mut values = Vec::with_capacity((CELLS + 1) * (CELLS + 1));
        for row in 0..=CELLS {
            for column in 0..=CELLS {
                x[plane[0]] = from[0] + step * column as f64;
                x[plane[1]] = from[1] + step * row as f64;
                built.barrier_values(t, &x, &mut h).map_err(Error::from)?;
                values.push(h[0]);
            }
        }
        if !values.iter().any(|h| *h >= 0.0) || !values.iter().any(|h| *h < 0.0) {
            return Ok(None);
        }
        let side = CELLS + 1;
        let is_edge = |k: usize| [0, CELLS].contains(&(k % side)) || [0, CELLS].contains(&(k / side));
        // If the whole border is safe, the set is the outside of an obstacle.
        let obstacle = values.iter().enumerate().all(|(k, h)| !is_edge(k) || *h >= 0.0);
        if obstacle {
            values.iter_mut().for_each(|h| *h = -*h);
        }
        let endless = values.iter().enumerate().any(|(k, h)| is_edge(k) && *h >= 0.0);
        let place = |[x, y]: [f64; 2]| [from[0] + step * x, from[1] + step * y];
        let rings: Vec<Vec<_>> =
            rings(&values, side).into_iter().map(|ring| ring.into_iter().map(place).collect()).collect();
        Ok(Some(Self { label: String::new(), rings, obstacle, endless }))
    }

    /// Its corners, unless it is unbounded.
    pub fn points(&self) -> impl Iterator<Item = &[f64; 2]> {
        self.rings.iter().filter(|_| !self.endless).flatten()
    }
}

/// What an expression reads of the plane.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reads {
    /// Neither coordinate.
    Nothing,
    /// The position, and no other state nor the time.
    Place,
    /// The position, and something else that changes.
    More,
}

/// What the barrier `section` of `filter` reads if it is an expression. The position is the states `plane`.
pub fn reads(filter: &FilterConfiguration, section: &BarrierSection, plane: [usize; 2]) -> Reads {
    let Shape::Expression { expression, .. } = &section.shape else { return Reads::Nothing };
    let states = filter.plant.states();
    let is_read = |(i, state): (usize, &String)| plane.contains(&i) && mentions(expression, state);
    let names: Vec<String> = states.into_iter().map(|state| state.name).collect();
    let is_more = |(i, state): (usize, &String)| !plane.contains(&i) && mentions(expression, state);
    match () {
        () if !names.iter().enumerate().any(is_read) => Reads::Nothing,
        () if names.iter().enumerate().any(is_more) || mentions(expression, "t") => Reads::More,
        () => Reads::Place,
    }
}

/// (x/a)^(2/p) + (y/b)^(2/p) = 1: an ellipse for p = 1, a rounded rectangle for p = 1/2.
fn round([a, b]: [f64; 2], power: f64) -> Vec<[f64; 2]> {
    let bent = |part: f64| part.signum() * elementary::powf(part.abs(), power);
    let corner = |k: usize| elementary::sin_cos(TAU * k as f64 / CORNERS as f64);
    (0..CORNERS).map(corner).map(|(sin, cos)| [a * bent(cos), b * bent(sin)]).collect()
}

/// The side of a line through 0 to which `normal` points, of length `far`.
fn half_plane(normal: [f64; 2], far: f64) -> Vec<[f64; 2]> {
    let length = elementary::hypot(normal[0], normal[1]);
    let [x, y] = normal.map(|part| part / length * far);
    vec![[-y, x], [y, -x], [y + x, -x + y], [-y + x, x + y]]
}

/// The closed lines around the points with values ≥ 0 of a square grid with `side` points per row, by
/// marching squares. One step outside the grid, all values count as negative, and so does NaN.
fn rings(values: &[f64], side: usize) -> Vec<Vec<[f64; 2]>> {
    let size =
        values.iter().copied().filter(|value| value.is_finite()).fold(1e-300, |a: f64, b| a.max(b.abs()));
    // Indices include the border.
    let value = |[i, j]: [usize; 2]| {
        let within = (1..=side).contains(&i) && (1..=side).contains(&j);
        let value = if within { values[(j - 1) * side + i - 1] } else { -size };
        if value.is_nan() { -size } else { value.clamp(-size, size) }
    };
    // Counter-clockwise around each cell, a line leads from where the boundary leaves the set to where it
    // next enters the set, so that the set is to its left. Each edge, named by its lower end, is left in one
    // cell and entered in the other.
    let mut next = BTreeMap::new();
    for j in 0..=side {
        for i in 0..=side {
            let corners = [[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1]];
            let inside = corners.map(|corner| value(corner) >= 0.0);
            let edge = |k: usize| {
                let (a, b) = (corners[k % 4], corners[(k + 1) % 4]);
                if a < b { [a, b] } else { [b, a] }
            };
            for leaves in (0..4).filter(|&k| inside[k] && !inside[(k + 1) % 4]) {
                let enters = (leaves + 1..leaves + 4).find(|&k| !inside[k % 4] && inside[(k + 1) % 4]);
                next.extend(enters.map(|enters| (edge(leaves), edge(enters))));
            }
        }
    }
    let point = |[a, b]: [[usize; 2]; 2]| {
        let (low, high) = (value(a), value(b));
        let part = low / (low - high);
        [0, 1].map(|axis| a[axis] as f64 - 1.0 + part * (b[axis] - a[axis]) as f64)
    };
    let mut rings = Vec::new();
    while let Some((first, mut at)) = next.pop_first() {
        let mut ring = vec![point(first)];
        while at != first {
            ring.push(point(at));
            let Some(after) = next.remove(&at) else { break };
            at = after;
        }
        rings.push(ring);
    }
    rings
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_half_plane_is_where_its_normal_shows() {
        let normal = [3.0, 4.0];
        let side = |[x, y]: [f64; 2]| (x * normal[0] + y * normal[1]) / 5.0;
        // Allows for round-off of products of 10.
        let near = |a: f64, b: f64| (a - b).abs() < 1e-12;
        let depths: Vec<f64> = half_plane(normal, 10.0).into_iter().map(side).collect();
        assert!(depths.iter().zip([0.0, 0.0, 10.0, 10.0]).all(|(a, b)| near(*a, b)), "{depths:?}");
    }

    /// The area enclosed by lines; clockwise lines count negatively.
    fn area(rings: &[Vec<[f64; 2]>]) -> f64 {
        let cross = |(a, b): (&[f64; 2], &[f64; 2])| (a[0] * b[1] - a[1] * b[0]) / 2.0;
        rings.iter().map(|ring| ring.iter().zip(ring.iter().cycle().skip(1)).map(cross).sum::<f64>()).sum()
    }

    #[test]
    fn lines_run_where_the_value_is_0_and_holes_stay_open() {
        let side = 101;
        let distance = |k: usize| ((k % side) as f64 - 50.0).hypot((k / side) as f64 - 47.0);
        let ring: Vec<f64> = (0..side * side).map(|k| 10.0 - (distance(k) - 30.0).abs()).collect();
        let found = rings(&ring, side);
        assert_eq!(found.len(), 2);
        for [x, y] in found.iter().flatten() {
            let off = ((x - 50.0).hypot(y - 47.0) - 30.0).abs() - 10.0;
            // The distance function has curvature 1/r over a cell.
            assert!(off.abs() < 1.0 / (8.0 * 20.0), "{x} {y}: {off}");
        }
        let exact = TAU / 2.0 * (40.0_f64.powi(2) - 20.0_f64.powi(2));
        assert!((area(&found) / exact - 1.0).abs() < 1e-3, "{} {exact}", area(&found));
    }

    #[test]
    fn lines_close_along_the_border_and_at_a_saddle() {
        // If everything is inside, one line runs around the grid, less than a step outside.
        let whole = rings(&[1.0; 9], 3);
        assert_eq!(whole.len(), 1);
        assert!((4.0..=16.0).contains(&area(&whole)), "{whole:?}");
        assert!(rings(&[-1.0; 9], 3).is_empty() && rings(&[f64::NAN; 9], 3).is_empty());
        // Two touching corners form one set or two; the lines are closed either way.
        let saddle = rings(&[1.0, -1.0, -1.0, 1.0], 2);
        assert!(area(&saddle) > 0.0 && saddle.iter().all(|ring| ring.len() >= 4), "{saddle:?}");
    }
}
