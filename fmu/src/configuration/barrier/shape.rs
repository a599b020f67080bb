//! The shapes of barriers: the keys of each one, and the barrier that it adds to a filter.

use punctual_core::Error;
use punctual_core::barriers::{
    DistanceDisc, Ellipse, HalfPlane, NormBound, Outside, QuadraticDisc, Rectangle, StateBound,
};
use punctual_core::filter::{FilterBuilder, Motion};
use punctual_core::plants::Signal;
use serde::Serialize;

use super::super::adding::Adding;
use super::super::{ConfigurationError, PlantSection, external};
use super::Automatic;
use super::reader::Reader;

/// The set of a barrier, with its numbers.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "shape", rename_all = "snake_case")]
#[expect(missing_docs, reason = "KEYS has the keys, SHAPES what is meant")]
pub enum Shape {
    /// [`DistanceDisc`].
    Disc {
        #[serde(flatten)]
        at: Point,
        radius: f64,
        smoothing: Automatic,
    },
    /// [`QuadraticDisc`].
    QuadraticDisc {
        #[serde(flatten)]
        at: Point,
        radius: f64,
    },
    /// [`Outside`] of a [`DistanceDisc`].
    Obstacle {
        #[serde(flatten)]
        at: Point,
        radius: f64,
        smoothing: Automatic,
    },
    /// [`Ellipse`].
    Ellipse { centre: [f64; 2], half_axes: [f64; 2], angle: f64 },
    /// [`Outside`] of an [`Ellipse`].
    EllipticObstacle { centre: [f64; 2], half_axes: [f64; 2], angle: f64 },
    /// [`Rectangle`].
    Rectangle { centre: [f64; 2], half_sides: [f64; 2], angle: f64 },
    /// [`Outside`] of a [`Rectangle`] that contains the true one.
    RectangularObstacle { centre: [f64; 2], half_sides: [f64; 2], angle: f64 },
    /// [`HalfPlane`].
    HalfPlane { centre: [f64; 2], normal: [f64; 2] },
    /// [`StateBound`] from above.
    AtMost { state: String, bound: f64 },
    /// [`StateBound`] from below.
    AtLeast { state: String, bound: f64 },
    /// [`NormBound`] of the velocity.
    SpeedLimit { bound: f64 },
    /// An expression of states, parameters and time.
    Expression { expression: String, unit: String },
    /// A barrier of the plant's plug-in.
    Plugin { output: String, unit: String },
    /// A barrier whose derivatives are inputs of the FMU ([`punctual_core::lie::external`]).
    External { unit: String, relative_degree: usize },
}

/// The centre of a disc.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Point {
    /// Position at time 0 of the simulation, in m.
    pub centre: [f64; 2],
    /// Its velocity in m/s.
    pub velocity: [f64; 2],
    /// Whether both are inputs of the FMU that start with these values, rather than parameters.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub centre_input: bool,
    /// The bound on its acceleration in m/s², if plans are to predict a centre that is an input.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub acceleration: Option<f64>,
    /// How far that centre may be from its input, in m, and its velocity, in m/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub centre_error: Option<f64>,
    /// See [`Self::centre_error`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub velocity_error: Option<f64>,
}

impl Point {
    /// A point at rest at `centre` (m).
    pub const fn at(centre: [f64; 2]) -> Self {
        Self {
            centre,
            velocity: [0.0; 2],
            centre_input: false,
            acceleration: None,
            centre_error: None,
            velocity_error: None,
        }
    }
}

/// The keys of a centre that may be an input.
const MOVING: [&str; 6] =
    ["smoothing", "velocity", "centre_input", "acceleration", "centre_error", "velocity_error"];

/// A row of [`SHAPES`].
pub struct ShapeRow {
    /// Its name in a configuration.
    pub name: &'static str,
    /// Region where h >= 0, in Markdown.
    pub meaning: &'static str,
    /// The keys that it needs.
    pub required: &'static [&'static str],
    /// The keys that it may have besides.
    pub optional: &'static [&'static str],
    /// Reads the shape from the keys.
    pub(super) read: fn(&Reader<'_>) -> Result<Shape, ConfigurationError>,
}

/// The shapes by name.
pub static SHAPES: [ShapeRow; 14] = [
    ShapeRow {
        name: "disc",
        meaning: "inside a disc, distance-shaped: take this one",
        required: &["centre", "radius"],
        optional: &MOVING,
        read: |r| {
            Ok(Shape::Disc {
                at: r.point()?,
                radius: r.need("radius", r.raw.radius)?,
                smoothing: r.smoothing(),
            })
        },
    },
    ShapeRow {
        name: "quadratic_disc",
        meaning: "inside, the paper's R² − d²",
        required: &["centre", "radius"],
        optional: &["velocity", "centre_input"],
        read: |r| Ok(Shape::QuadraticDisc { at: r.point()?, radius: r.need("radius", r.raw.radius)? }),
    },
    ShapeRow {
        name: "obstacle",
        meaning: "outside of a disc",
        required: &["centre", "radius"],
        optional: &MOVING,
        read: |r| {
            Ok(Shape::Obstacle {
                at: r.point()?,
                radius: r.need("radius", r.raw.radius)?,
                smoothing: r.smoothing(),
            })
        },
    },
    ShapeRow {
        name: "ellipse",
        meaning: "inside",
        required: &["centre", "half_axes"],
        optional: &["angle"],
        read: |r| {
            let (centre, half_axes) = (r.centre()?, r.need("half_axes", r.raw.half_axes)?);
            Ok(Shape::Ellipse { centre, half_axes, angle: r.angle() })
        },
    },
    ShapeRow {
        name: "elliptic_obstacle",
        meaning: "outside of an ellipse",
        required: &["centre", "half_axes"],
        optional: &["angle"],
        read: |r| {
            let (centre, half_axes) = (r.centre()?, r.need("half_axes", r.raw.half_axes)?);
            Ok(Shape::EllipticObstacle { centre, half_axes, angle: r.angle() })
        },
    },
    ShapeRow {
        name: "rectangle",
        meaning: "inside, with corners rounded inwards",
        required: &["centre", "half_sides"],
        optional: &["angle"],
        read: |r| {
            let (centre, half_sides) = (r.centre()?, r.need("half_sides", r.raw.half_sides)?);
            Ok(Shape::Rectangle { centre, half_sides, angle: r.angle() })
        },
    },
    ShapeRow {
        name: "rectangular_obstacle",
        meaning: "outside of a rounded rectangle that contains it",
        required: &["centre", "half_sides"],
        optional: &["angle"],
        read: |r| {
            let (centre, half_sides) = (r.centre()?, r.need("half_sides", r.raw.half_sides)?);
            Ok(Shape::RectangularObstacle { centre, half_sides, angle: r.angle() })
        },
    },
    ShapeRow {
        name: "half_plane",
        meaning: "one side of a line; two of them are a corridor",
        required: &["centre", "normal"],
        optional: &[],
        read: |r| Ok(Shape::HalfPlane { centre: r.centre()?, normal: r.need("normal", r.raw.normal)? }),
    },
    ShapeRow {
        name: "at_most",
        meaning: "a state at most the bound",
        required: &["state", "bound"],
        optional: &[],
        read: |r| Ok(Shape::AtMost { bound: r.need("bound", r.raw.bound)?, state: r.state()? }),
    },
    ShapeRow {
        name: "at_least",
        meaning: "a state at least the bound",
        required: &["state", "bound"],
        optional: &[],
        read: |r| Ok(Shape::AtLeast { bound: r.need("bound", r.raw.bound)?, state: r.state()? }),
    },
    ShapeRow {
        name: "speed_limit",
        meaning: "|v| ≤ bound, in either direction",
        required: &["bound"],
        optional: &[],
        read: |r| Ok(Shape::SpeedLimit { bound: r.need("bound", r.raw.bound)? }),
    },
    ShapeRow {
        name: "expression",
        meaning: "an [expression](#expressions) ≥ 0",
        required: &["expression"],
        optional: &["unit"],
        read: |r| {
            let expression = r.need("expression", r.raw.expression.clone())?;
            let unit = r.unit("1")?;
            r.check_unit_of(&expression)?;
            Ok(Shape::Expression { expression, unit })
        },
    },
    ShapeRow {
        name: "plugin",
        meaning: "a barrier of the plant's [plug-in](plugin.md)",
        required: &[],
        optional: &["output", "unit"],
        read: |r| {
            let (output, unit) = r.output()?;
            Ok(Shape::Plugin { output, unit: r.unit(&unit)? })
        },
    },
    ShapeRow {
        name: "external",
        meaning: "known to your simulator only: [its derivatives are inputs](#derivatives-from-your-simulator)",
        required: &["relative_degree"],
        optional: &["unit"],
        read: |r| {
            let (unit, degree) = (r.unit("1")?, r.need("relative_degree", r.raw.relative_degree)?);
            external::check_degree(r.path, degree)?;
            Ok(Shape::External { unit, relative_degree: degree })
        },
    },
];

/// The names of [`SHAPES`].
pub(super) static NAMES: [&str; SHAPES.len()] = {
    let mut names = [""; SHAPES.len()];
    let mut i = 0;
    while i < names.len() {
        names[i] = SHAPES[i].name;
        i += 1;
    }
    names
};

impl Shape {
    /// Its name in a configuration.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Disc { .. } => "disc",
            Self::QuadraticDisc { .. } => "quadratic_disc",
            Self::Obstacle { .. } => "obstacle",
            Self::Ellipse { .. } => "ellipse",
            Self::EllipticObstacle { .. } => "elliptic_obstacle",
            Self::Rectangle { .. } => "rectangle",
            Self::RectangularObstacle { .. } => "rectangular_obstacle",
            Self::HalfPlane { .. } => "half_plane",
            Self::AtMost { .. } => "at_most",
            Self::AtLeast { .. } => "at_least",
            Self::SpeedLimit { .. } => "speed_limit",
            Self::Expression { .. } => "expression",
            Self::Plugin { .. } => "plugin",
            Self::External { .. } => "external",
        }
    }

    /// The unit of h on `plant`.
    pub(super) fn unit(&self, plant: &PlantSection) -> String {
        match self {
            Self::QuadraticDisc { .. } => "m2".to_owned(),
            Self::SpeedLimit { .. } => "m/s".to_owned(),
            Self::AtMost { state, .. } | Self::AtLeast { state, .. } => {
                let state = plant.states().into_iter().find(|s| s.name == *state);
                state.map_or_else(|| "1".to_owned(), |s| s.unit)
            }
            Self::Expression { unit, .. } | Self::Plugin { unit, .. } | Self::External { unit, .. } => {
                unit.clone()
            }
            _ => "m".to_owned(),
        }
    }

    /// The length in m of which the default margin is a part.
    pub(super) fn size(&self) -> Option<f64> {
        match *self {
            Self::Disc { radius, .. } | Self::Obstacle { radius, .. } => Some(radius),
            Self::Ellipse { half_axes: [a, b], .. }
            | Self::EllipticObstacle { half_axes: [a, b], .. }
            | Self::Rectangle { half_sides: [a, b], .. }
            | Self::RectangularObstacle { half_sides: [a, b], .. } => Some(a.min(b)),
            _ => None,
        }
    }

    /// The position in m at which h is largest, on a plant with a name; `None` where that is not known.
    pub(in super::super) fn inmost(&self) -> Option<[f64; 2]> {
        match *self {
            Self::Disc { at, .. } | Self::QuadraticDisc { at, .. } => Some(at.centre),
            Self::Ellipse { centre, .. } | Self::Rectangle { centre, .. } => Some(centre),
            // A speed limit is largest at rest, wherever that is.
            Self::SpeedLimit { .. } => Some([0.0; 2]),
            _ => None,
        }
    }

    /// The centre that it follows, if that is an input of the FMU.
    pub fn followed(&self) -> Option<&Point> {
        match self {
            Self::Disc { at, .. } | Self::QuadraticDisc { at, .. } | Self::Obstacle { at, .. } => {
                Some(at).filter(|at| at.centre_input)
            }
            _ => None,
        }
    }

    /// Adds the barrier of this shape to a filter.
    pub(in super::super) fn add(&self, to: Adding<'_>) -> Result<FilterBuilder, ConfigurationError> {
        let state = |on: &[Signal], name: &str| on.iter().position(|s| s.name == name);
        match self {
            Self::Disc { at, radius, smoothing } => to.along(|on| at.disc(*radius, *smoothing, on)),
            Self::Obstacle { at, radius, smoothing } => {
                to.along(|on| at.disc(*radius, *smoothing, on).map(Outside))
            }
            Self::QuadraticDisc { at, radius } => to.along(|on| {
                let disc = QuadraticDisc::new(at.centre, *radius)?.moving(at.velocity)?;
                Ok(if at.centre_input { disc.following(on.len()) } else { disc })
            }),
            Self::Ellipse { centre, half_axes, angle } => {
                to.along(|_| Ellipse::new(*centre, *half_axes, *angle))
            }
            Self::EllipticObstacle { centre, half_axes, angle } => {
                to.along(|_| Ellipse::new(*centre, *half_axes, *angle).map(Outside))
            }
            Self::Rectangle { centre, half_sides, angle } => {
                to.along(|_| Rectangle::new(*centre, *half_sides, *angle))
            }
            Self::RectangularObstacle { centre, half_sides, angle } => {
                to.along(|_| Ok(Outside(Rectangle::new(*centre, *half_sides, *angle)?.around())))
            }
            Self::HalfPlane { centre, normal } => to.along(|_| HalfPlane::new(*normal, *centre)),
            // Where the plant has no name, as the expression that it is.
            Self::AtMost { state, bound } if to.is_own() => to.expression(&format!("{bound:?} - {state}")),
            Self::AtLeast { state, bound } if to.is_own() => to.expression(&format!("{state} - ({bound:?})")),
            Self::AtMost { state: name, bound } => {
                to.along(|on| StateBound::at_most(state(on, name).unwrap_or(usize::MAX), *bound))
            }
            Self::AtLeast { state: name, bound } => {
                to.along(|on| StateBound::at_least(state(on, name).unwrap_or(usize::MAX), *bound))
            }
            Self::SpeedLimit { bound } => to.along(|on| match state(on, "v") {
                Some(speed) => NormBound::of_one(speed, *bound),
                None => NormBound::new(state(on, "v_x").unwrap_or(usize::MAX), *bound),
            }),
            Self::Expression { expression, .. } => to.expression(expression),
            Self::Plugin { output, .. } => to.plugin(output),
            Self::External { relative_degree, .. } => to.external(*relative_degree),
        }
    }
}

impl Point {
    /// How a centre that is an input moves, as plans know it; `None` if that is not declared.
    pub(in super::super) fn motion(&self) -> Option<Motion> {
        let [position_error, velocity_error] =
            [self.centre_error, self.velocity_error].map(Option::unwrap_or_default);
        self.acceleration.map(|acceleration| Motion { acceleration, position_error, velocity_error })
    }

    /// Whether it stays where it is.
    pub(in super::super) fn is_still(&self) -> bool {
        self.velocity == [0.0; 2] && !self.centre_input
    }

    /// A disc around the point, on a plant with the states `on`; a centre that is an input is a state behind
    /// these.
    fn disc(&self, radius: f64, smoothing: Automatic, on: &[Signal]) -> Result<DistanceDisc, Error> {
        let smoothing = smoothing.given().unwrap_or(radius);
        let disc = DistanceDisc::new(self.centre, radius, smoothing)?.moving(self.velocity)?;
        Ok(if self.centre_input { disc.following(on.len()) } else { disc })
    }
}

/// The numbers that are parameters of the FMU, where a shape has them.
impl Shape {
    pub(super) fn point(&mut self) -> Option<&mut Point> {
        self.disc().filter(|at| !at.centre_input)
    }

    /// The centre of a disc.
    pub(super) fn disc(&mut self) -> Option<&mut Point> {
        match self {
            Self::Disc { at, .. } | Self::QuadraticDisc { at, .. } | Self::Obstacle { at, .. } => Some(at),
            _ => None,
        }
    }

    pub(super) fn centre(&mut self) -> Option<&mut [f64; 2]> {
        match self {
            Self::Ellipse { centre, .. }
            | Self::EllipticObstacle { centre, .. }
            | Self::Rectangle { centre, .. }
            | Self::RectangularObstacle { centre, .. } => Some(centre),
            _ => self.point().map(|at| &mut at.centre),
        }
    }

    pub(super) fn line(&mut self) -> Option<(&mut [f64; 2], &mut [f64; 2])> {
        match self {
            Self::HalfPlane { centre, normal } => Some((centre, normal)),
            _ => None,
        }
    }

    pub(super) fn radius(&mut self) -> Option<&mut f64> {
        match self {
            Self::Disc { radius, .. }
            | Self::QuadraticDisc { radius, .. }
            | Self::Obstacle { radius, .. } => Some(radius),
            _ => None,
        }
    }

    pub(super) fn smoothing(&mut self) -> Option<&mut f64> {
        match self {
            Self::Disc { smoothing, .. } | Self::Obstacle { smoothing, .. } => Some(&mut smoothing.0),
            _ => None,
        }
    }

    pub(super) fn half_axes(&mut self) -> Option<&mut [f64; 2]> {
        match self {
            Self::Ellipse { half_axes, .. } | Self::EllipticObstacle { half_axes, .. } => Some(half_axes),
            _ => None,
        }
    }

    pub(super) fn half_sides(&mut self) -> Option<&mut [f64; 2]> {
        match self {
            Self::Rectangle { half_sides, .. } | Self::RectangularObstacle { half_sides, .. } => {
                Some(half_sides)
            }
            _ => None,
        }
    }

    pub(super) fn angle(&mut self) -> Option<&mut f64> {
        match self {
            Self::Ellipse { angle, .. }
            | Self::EllipticObstacle { angle, .. }
            | Self::Rectangle { angle, .. }
            | Self::RectangularObstacle { angle, .. } => Some(angle),
            _ => None,
        }
    }

    pub(super) fn bound(&mut self) -> Option<&mut f64> {
        match self {
            Self::AtMost { bound, .. } | Self::AtLeast { bound, .. } => Some(bound),
            _ => None,
        }
    }

    pub(super) fn speed(&mut self) -> Option<&mut f64> {
        match self {
            Self::SpeedLimit { bound } => Some(bound),
            _ => None,
        }
    }
}
