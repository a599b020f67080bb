//! Sets that stay where they are and have no state in common, by their geometry: what needs both at once is in vain, and no
//! search need tell. Whatever is not certain is left out.

use punctual_core::elementary;
use punctual_core::plan::Failure;

use super::barrier::Shape;
use super::{BarrierSection, FilterConfiguration, UNBOUNDED};

/// By how much sets have to be apart, as a part of their size, to be so for certain.
const ROUND_OFF: f64 = 1e-9;

/// A set of the plane that contains a shape: all that is within `radius` of the convex hull of some points.
struct Hull {
    points: Vec<[f64; 2]>,
    radius: f64,
}

impl Hull {
    fn of(shape: &Shape) -> Option<Self> {
        let around = |centre: [f64; 2], radius: f64| Some(Self { points: vec![centre], radius });
        match *shape {
            Shape::Disc { at, radius, .. } | Shape::QuadraticDisc { at, radius } if at.is_still() => {
                around(at.centre, radius)
            }
            Shape::Ellipse { centre, half_axes: [a, b], .. } => around(centre, a.max(b)),
            Shape::Rectangle { centre, half_sides: [a, b], angle } => {
                let (sin, cos) = (elementary::sin(angle), elementary::cos(angle));
                let corner = |[i, j]: [f64; 2]| {
                    [centre[0] + i * a * cos - j * b * sin, centre[1] + i * a * sin + j * b * cos]
                };
                let points = [[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]].map(corner).to_vec();
                Some(Self { points, radius: 0.0 })
            }
            _ => None,
        }
    }

    /// The least of what `depth` says of a point and this radius; it is concave in the point.
    fn least(&self, depth: impl Fn([f64; 2], f64) -> f64) -> f64 {
        self.points.iter().map(|point| depth(*point, self.radius)).fold(f64::INFINITY, f64::min)
    }

    /// A disc around it.
    fn disc(&self) -> ([f64; 2], f64) {
        let count = self.points.len() as f64;
        let centre = [0, 1].map(|i| self.points.iter().map(|p| p[i]).sum::<f64>() / count);
        let far = self.points.iter().map(|p| distance(*p, centre)).fold(0.0, f64::max);
        (centre, far + self.radius)
    }
}

fn distance(p: [f64; 2], q: [f64; 2]) -> f64 {
    let [x, y] = [p[0] - q[0], p[1] - q[1]];
    elementary::sqrt(x * x + y * y)
}

/// Four digits of a number.
fn short(number: f64) -> f64 {
    format!("{number:.3e}").parse().unwrap_or(number)
}

/// How two sets lie that have no state in common, and by how much in m or the unit of the state.
enum Apart {
    /// All of the first lies in what the second keeps out of.
    Within(f64),
    /// They lie beside each other.
    Beside(f64),
}

/// How `first` and `second` are apart, if they certainly are.
fn apart(first: &Shape, second: &Shape) -> Option<Apart> {
    let is_sure = |by: &f64, size: f64| by.is_finite() && *by > ROUND_OFF * size.abs().max(1.0);
    if let (Shape::AtLeast { state, bound: least }, Shape::AtMost { state: other, bound: most }) =
        (first, second)
    {
        let by = Some(least - most).filter(|by| state == other && is_sure(by, *least));
        return by.map(Apart::Beside);
    }
    let hull = Hull::of(first)?;
    let (centre, size) = hull.disc();
    // The point in the axes of what is kept out of.
    let within = |p: [f64; 2], centre: [f64; 2], angle: f64| {
        let (sin, cos) = (elementary::sin(angle), elementary::cos(angle));
        let [x, y] = [p[0] - centre[0], p[1] - centre[1]];
        [cos * x + sin * y, cos * y - sin * x].map(f64::abs)
    };
    let found = match *second {
        Shape::Obstacle { at, radius, .. } if at.is_still() => {
            Apart::Within(hull.least(|p, r| radius - r - distance(p, at.centre)))
        }
        Shape::EllipticObstacle { centre, half_axes: [a, b], angle } => Apart::Within(hull.least(|p, r| {
            let [x, y] = within(p, centre, angle);
            a.min(b) * (1.0 - distance([x / a, y / b], [0.0; 2])) - r
        })),
        Shape::RectangularObstacle { centre, half_sides: [a, b], angle } => {
            Apart::Within(hull.least(|p, r| {
                let [x, y] = within(p, centre, angle);
                (a - x).min(b - y) - r
            }))
        }
        Shape::HalfPlane { centre, normal: [x, y] } => Apart::Beside(hull.least(|p, r| {
            let out = (x * (centre[0] - p[0]) + y * (centre[1] - p[1])) / distance([x, y], [0.0; 2]);
            out - r
        })),
        _ => {
            let (other, radius) = Hull::of(second)?.disc();
            Apart::Beside(distance(centre, other) - size - radius)
        }
    };
    let (Apart::Within(by) | Apart::Beside(by)) = found;
    is_sure(&by, size).then_some(found)
}

impl FilterConfiguration {
    /// The pairs of barriers, by their indices, whose sets certainly have no state in common.
    pub fn apart(&self) -> Vec<[usize; 2]> {
        let all = || 0..self.barrier.len();
        all()
            .flat_map(|a| (a + 1..self.barrier.len()).map(move |b| [a, b]))
            .filter(|pair| self.lies(*pair).is_some())
            .collect()
    }

    /// How two barriers are apart, with that first which lies within what the other keeps out of.
    fn lies(&self, [a, b]: [usize; 2]) -> Option<([&BarrierSection; 2], Apart)> {
        let pair = [self.barrier.get(a)?, self.barrier.get(b)?];
        if pair[0].position != pair[1].position {
            return None;
        }
        let turned = [pair[1], pair[0]];
        [pair, turned].into_iter().find_map(|[p, q]| Some(([p, q], apart(&p.shape, &q.shape)?)))
    }

    /// How two barriers are apart, in words.
    pub fn apart_in_words(&self, pair: [usize; 2]) -> Option<String> {
        let ([first, second], lies) = self.lies(pair)?;
        let (name, other, unit) = (&first.name, &second.name, first.unit(&self.plant));
        let unit = if matches!(first.shape, Shape::QuadraticDisc { .. }) { "m".to_owned() } else { unit };
        Some(match lies {
            Apart::Within(by) => {
                let by = short(by);
                format!(
                    "{name} lies wholly inside {other}, {by} {unit} from its edge: no state is in {name} and outside {other}"
                )
            }
            Apart::Beside(by) => {
                format!("{name} and {other} are {} {unit} apart: no state is in both", short(by))
            }
        })
    }

    /// Why a promise is refused at the start, in words: that no plan was found, or that there can be none.
    pub fn refusal(&self, failure: Failure) -> String {
        let found = match failure {
            Failure::Broken { .. } => format!("in the closest attempt, {}", self.failure(failure)),
            _ => self.failure(failure),
        };
        let inputs = self.commanded();
        let fixed: Vec<_> =
            inputs.iter().filter_map(|input| Some((input, self.fixed(&input.name)?))).collect();
        let named: Vec<_> = fixed.iter().map(|(input, at)| format!("{} = {at}", input.name)).collect();
        match fixed.len() {
            0 => found,
            all if all == inputs.len() => {
                format!(
                    "the bounds fix every input ({}), so that nothing can steer the plant; {found}",
                    named.join(", ")
                )
            }
            1 => format!("the bounds fix {}, so that it cannot steer the plant; {found}", named.join(", ")),
            _ => format!("the bounds fix {}, so that they cannot steer the plant; {found}", named.join(", ")),
        }
    }

    /// The only value of a signal that its bounds leave.
    fn fixed(&self, name: &str) -> Option<f64> {
        self.limits(name).filter(|[min, max]| min == max && min.abs() < UNBOUNDED).map(|[min, _]| min)
    }
}
