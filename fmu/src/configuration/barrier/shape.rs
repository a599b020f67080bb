//! The shapes of barriers: the keys of each one, and the barrier that it adds to a filter.

use core::f64::consts::SQRT_2;

use punctual_core::barrier::Barrier;
use punctual_core::barriers::{
    DistanceDisc, Ellipse, HalfPlane, NormBound, QuadraticDisc, Rectangle, StateBound,
};
use punctual_core::dynamics;
use punctual_core::filter::{FilterBuilder, Motion};
use punctual_core::plants::Signal;
use punctual_core::scalar::Scalar;
use punctual_core::{Error, ErrorKind, elementary};
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
    /// What is [outside](punctual_core::barriers::Outside) of a [`DistanceDisc`].
    Obstacle {
        #[serde(flatten)]
        at: Point,
        radius: f64,
        smoothing: Automatic,
    },
    /// [`Ellipse`].
    Ellipse { centre: [f64; 2], half_axes: [f64; 2], angle: f64 },
    /// What is [outside](punctual_core::barriers::Outside) of an [`Ellipse`].
    EllipticObstacle { centre: [f64; 2], half_axes: [f64; 2], angle: f64 },
    /// [`Rectangle`].
    Rectangle { centre: [f64; 2], half_sides: [f64; 2], angle: f64 },
    /// What is [outside](punctual_core::barriers::Outside) of a [`Rectangle`] that contains the true one.
    RectangularObstacle { centre: [f64; 2], half_sides: [f64; 2], angle: f64 },
    /// A [`DistanceDisc`] in space.
    Sphere { centre: [f64; 3], radius: f64, smoothing: Automatic },
    /// What is outside of a [`Self::Sphere`].
    SphericalObstacle { centre: [f64; 3], radius: f64, smoothing: Automatic },
    /// A [`Rectangle`] in space, turned about the vertical.
    Box { centre: [f64; 3], half_sides: [f64; 3], angle: f64 },
    /// What is outside of a [`Self::Box`] that contains the true one.
    BoxObstacle { centre: [f64; 3], half_sides: [f64; 3], angle: f64 },
    /// The distance between two positions: what is outside of a [`DistanceDisc`] around the other one.
    Apart { from: Vec<String>, distance: f64 },
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

/// The set of a shape along a plant with a name. One type for all shapes: what a filter needs of a barrier is compiled once for each
/// plant.
#[derive(Clone, Copy)]
pub(in super::super) struct Region {
    form: Form,
    is_outside: bool,
}

#[derive(Clone, Copy)]
enum Form {
    Disc(DistanceDisc),
    QuadraticDisc(QuadraticDisc),
    Ellipse(Ellipse),
    Rectangle(Rectangle),
    HalfPlane(HalfPlane),
    State(StateBound),
    Norm(NormBound),
}

/// Calls a method of the barrier that `form` has.
macro_rules! of_form {
    ($form:expr, $barrier:ident => $call:expr) => {
        match $form {
            Form::Disc($barrier) => $call,
            Form::QuadraticDisc($barrier) => $call,
            Form::Ellipse($barrier) => $call,
            Form::Rectangle($barrier) => $call,
            Form::HalfPlane($barrier) => $call,
            Form::State($barrier) => $call,
            Form::Norm($barrier) => $call,
        }
    };
}

impl<const NX: usize> Barrier<NX> for Region {
    // All of them are.
    const ONE_SIDED_CURVATURE: bool = true;

    fn value<S: Scalar>(&self, t: S, x: &[S; NX]) -> S {
        let h = of_form!(&self.form, barrier => Barrier::<NX>::value(barrier, t, x));
        if self.is_outside { -h } else { h }
    }

    fn highest(&self, time: [f64; 2], region: &dynamics::Region) -> Option<f64> {
        if self.is_outside {
            return None;
        }
        of_form!(&self.form, barrier => Barrier::<NX>::highest(barrier, time, region))
    }

    fn steepness(&self) -> Option<f64> {
        of_form!(&self.form, barrier => Barrier::<NX>::steepness(barrier))
    }

    fn range_from(&self, t: f64, x: &[f64; NX]) -> Option<[f64; 2]> {
        let [least, largest] = of_form!(&self.form, barrier => Barrier::<NX>::range_from(barrier, t, x))?;
        Some(if self.is_outside { [-largest, -least] } else { [least, largest] })
    }
}

/// The keys of a centre that may be an input.
const MOVING: [&str; 7] =
    ["smoothing", "velocity", "centre_input", "acceleration", "centre_error", "velocity_error", "position"];

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
pub static SHAPES: [ShapeRow; 19] = [
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
        optional: &["velocity", "centre_input", "position"],
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
        optional: &["angle", "position"],
        read: |r| {
            let (centre, half_axes) = (r.centre()?, r.need("half_axes", r.raw.half_axes)?);
            Ok(Shape::Ellipse { centre, half_axes, angle: r.angle() })
        },
    },
    ShapeRow {
        name: "elliptic_obstacle",
        meaning: "outside of an ellipse",
        required: &["centre", "half_axes"],
        optional: &["angle", "position"],
        read: |r| {
            let (centre, half_axes) = (r.centre()?, r.need("half_axes", r.raw.half_axes)?);
            Ok(Shape::EllipticObstacle { centre, half_axes, angle: r.angle() })
        },
    },
    ShapeRow {
        name: "rectangle",
        meaning: "inside, with corners rounded inwards",
        required: &["centre", "half_sides"],
        optional: &["angle", "position"],
        read: |r| {
            let (centre, half_sides) = (r.centre()?, r.half_sides()?);
            Ok(Shape::Rectangle { centre, half_sides, angle: r.angle() })
        },
    },
    ShapeRow {
        name: "rectangular_obstacle",
        meaning: "outside of a rounded rectangle that contains it",
        required: &["centre", "half_sides"],
        optional: &["angle", "position"],
        read: |r| {
            let (centre, half_sides) = (r.centre()?, r.half_sides()?);
            Ok(Shape::RectangularObstacle { centre, half_sides, angle: r.angle() })
        },
    },
    ShapeRow {
        name: "sphere",
        meaning: "inside a sphere, in space",
        required: &["centre", "radius"],
        optional: &["position", "smoothing"],
        read: |r| {
            let (centre, radius) = (r.centre()?, r.need("radius", r.raw.radius)?);
            Ok(Shape::Sphere { centre, radius, smoothing: r.smoothing() })
        },
    },
    ShapeRow {
        name: "spherical_obstacle",
        meaning: "outside of a sphere",
        required: &["centre", "radius"],
        optional: &["position", "smoothing"],
        read: |r| {
            let (centre, radius) = (r.centre()?, r.need("radius", r.raw.radius)?);
            Ok(Shape::SphericalObstacle { centre, radius, smoothing: r.smoothing() })
        },
    },
    ShapeRow {
        name: "box",
        meaning: "inside a box, with edges rounded inwards, in space",
        required: &["centre", "half_sides"],
        optional: &["position", "angle"],
        read: |r| Ok(Shape::Box { centre: r.centre()?, half_sides: r.half_sides()?, angle: r.angle() }),
    },
    ShapeRow {
        name: "box_obstacle",
        meaning: "outside of a rounded box that contains it",
        required: &["centre", "half_sides"],
        optional: &["position", "angle"],
        read: |r| {
            Ok(Shape::BoxObstacle { centre: r.centre()?, half_sides: r.half_sides()?, angle: r.angle() })
        },
    },
    ShapeRow {
        name: "apart",
        meaning: "two positions at least `distance` apart",
        required: &["from", "distance"],
        optional: &["position"],
        read: |r| Ok(Shape::Apart { from: r.from()?, distance: r.need("distance", r.raw.distance)? }),
    },
    ShapeRow {
        name: "half_plane",
        meaning: "one side of a line; two of them are a corridor",
        required: &["centre", "normal"],
        optional: &["position"],
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
            Self::Sphere { .. } => "sphere",
            Self::SphericalObstacle { .. } => "spherical_obstacle",
            Self::Box { .. } => "box",
            Self::BoxObstacle { .. } => "box_obstacle",
            Self::Apart { .. } => "apart",
            Self::HalfPlane { .. } => "half_plane",
            Self::AtMost { .. } => "at_most",
            Self::AtLeast { .. } => "at_least",
            Self::SpeedLimit { .. } => "speed_limit",
            Self::Expression { .. } => "expression",
            Self::Plugin { .. } => "plugin",
            Self::External { .. } => "external",
        }
    }

    /// The axes of the position that it is of; `None` if it is of none.
    pub(super) fn axes(&self) -> Option<usize> {
        match self {
            Self::Disc { .. }
            | Self::QuadraticDisc { .. }
            | Self::Obstacle { .. }
            | Self::Ellipse { .. }
            | Self::EllipticObstacle { .. }
            | Self::Rectangle { .. }
            | Self::RectangularObstacle { .. }
            | Self::HalfPlane { .. } => Some(2),
            Self::Sphere { .. }
            | Self::SphericalObstacle { .. }
            | Self::Box { .. }
            | Self::BoxObstacle { .. } => Some(3),
            Self::Apart { from, .. } => Some(from.len()),
            Self::AtMost { .. }
            | Self::AtLeast { .. }
            | Self::SpeedLimit { .. }
            | Self::Expression { .. }
            | Self::Plugin { .. }
            | Self::External { .. } => None,
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
            Self::Sphere { radius, .. } | Self::SphericalObstacle { radius, .. } => Some(radius),
            Self::Box { half_sides: [a, b, c], .. } | Self::BoxObstacle { half_sides: [a, b, c], .. } => {
                Some(a.min(b).min(c))
            }
            Self::Apart { distance, .. } => Some(distance),
            _ => None,
        }
    }

    /// The position in m at which h is largest; `None` where that is not known.
    pub(in super::super) fn inmost(&self) -> Option<&[f64]> {
        match self {
            Self::Disc { at, .. } | Self::QuadraticDisc { at, .. } => Some(&at.centre),
            Self::Ellipse { centre, .. } | Self::Rectangle { centre, .. } => Some(centre),
            Self::Sphere { centre, .. } | Self::Box { centre, .. } => Some(centre),
            // A speed limit is largest at rest, wherever that is.
            Self::SpeedLimit { .. } => Some(&[0.0; 2]),
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
        // Where the plant has no name, as the expression that it is.
        if to.is_own()
            && let Some(expression) = self.expression(to.own_position(), &[])
        {
            return to.expression(&expression);
        }
        match self {
            Self::Expression { expression, .. } => to.expression(expression),
            Self::Plugin { output, .. } => to.plugin(output),
            Self::External { relative_degree, .. } => to.external(*relative_degree),
            _ => to.along(|on| self.region(on)),
        }
    }

    /// Its set along a plant with a name and these states.
    fn region(&self, on: &[Signal]) -> Result<Region, Error> {
        let state = |name: &str| on.iter().position(|s| s.name == name);
        let within = |form: Form| Region { form, is_outside: false };
        let outside = |form: Form| Region { form, is_outside: true };
        Ok(match self {
            Self::Disc { at, radius, smoothing } => within(Form::Disc(at.disc(*radius, *smoothing, on)?)),
            Self::Obstacle { at, radius, smoothing } => {
                outside(Form::Disc(at.disc(*radius, *smoothing, on)?))
            }
            Self::QuadraticDisc { at, radius } => {
                let disc = QuadraticDisc::new(at.centre, *radius)?.moving(at.velocity)?;
                within(Form::QuadraticDisc(if at.centre_input { disc.following(on.len()) } else { disc }))
            }
            Self::Ellipse { centre, half_axes, angle } => {
                within(Form::Ellipse(Ellipse::new(*centre, *half_axes, *angle)?))
            }
            Self::EllipticObstacle { centre, half_axes, angle } => {
                outside(Form::Ellipse(Ellipse::new(*centre, *half_axes, *angle)?))
            }
            Self::Rectangle { centre, half_sides, angle } => {
                within(Form::Rectangle(Rectangle::new(*centre, *half_sides, *angle)?))
            }
            Self::RectangularObstacle { centre, half_sides, angle } => {
                outside(Form::Rectangle(Rectangle::new(*centre, *half_sides, *angle)?.around()))
            }
            Self::HalfPlane { centre, normal } => within(Form::HalfPlane(HalfPlane::new(*normal, *centre)?)),
            Self::AtMost { state: name, bound } => {
                within(Form::State(StateBound::at_most(state(name).unwrap_or(usize::MAX), *bound)?))
            }
            Self::AtLeast { state: name, bound } => {
                within(Form::State(StateBound::at_least(state(name).unwrap_or(usize::MAX), *bound)?))
            }
            Self::SpeedLimit { bound } => within(Form::Norm(match state("v") {
                Some(speed) => NormBound::of_one(speed, *bound)?,
                None => NormBound::new(state("v_x").unwrap_or(usize::MAX), *bound)?,
            })),
            _ => {
                let message = format!("is {:?}, which is for models of your own", self.name());
                return Err(Error::new(ErrorKind::Range, "shape", message));
            }
        })
    }

    /// h as an expression where the states `position` are that, in the order of the axes, and `velocity` the speed or its
    /// parts; `None` of a shape that is none, or has no place. It equals what the core has for the vehicles with a name.
    pub(in super::super) fn expression(&self, position: &[String], velocity: &[&str]) -> Option<String> {
        let away = |centre: &[f64]| -> Vec<String> {
            position.iter().zip(centre).map(|(p, c)| format!("({p} - ({c:?}))")).collect()
        };
        let away_from = |at: &Point| -> Vec<String> {
            let moved = |(length, velocity): (String, f64)| match velocity {
                0.0 => length,
                _ => format!("({length} - ({velocity:?})*t)"),
            };
            away(&at.centre).into_iter().zip(at.velocity).map(moved).collect()
        };
        // Along the axes that are turned by an angle about the vertical.
        let turned = |centre: &[f64], angle: f64| -> Vec<String> {
            let (sin, cos) = elementary::sin_cos(angle);
            let mut axes = away(centre);
            if angle != 0.0
                && let [x, y, ..] = &mut axes[..]
            {
                let along = format!("({cos:?}*{x} + ({sin:?})*{y})");
                (*x, *y) = (along, format!("({cos:?}*{y} - ({sin:?})*{x})"));
            }
            axes
        };
        let squares = |lengths: &[String]| -> String {
            lengths.iter().map(|length| format!("{length}^2")).collect::<Vec<_>>().join(" + ")
        };
        // How far the length of `lengths` is below `radius`.
        let below = |lengths: &[String], radius: f64, smoothing: f64| {
            let level = elementary::hypot(radius, smoothing);
            format!("{level:?} - sqrt({} + {:?})", squares(lengths), smoothing * smoothing)
        };
        let round = |lengths: &[String], radius: f64, smoothing: Automatic| {
            below(lengths, radius, smoothing.given().unwrap_or(radius))
        };
        let scaled = |lengths: Vec<String>, sizes: &[f64]| -> Vec<String> {
            lengths.iter().zip(sizes).map(|(length, size)| format!("({length}/{size:?})")).collect()
        };
        let least = |sizes: &[f64]| sizes.iter().copied().fold(f64::INFINITY, f64::min);
        let ellipse = |centre: &[f64], sizes: &[f64], angle: f64| {
            let lengths = scaled(turned(centre, angle), sizes);
            format!("{:?}*({SQRT_2:?} - sqrt({} + 1.0))", least(sizes), squares(&lengths))
        };
        // Within the true one; `around` it the same with larger sides.
        let cuboid = |centre: &[f64], sizes: &[f64], angle: f64| {
            let lengths = scaled(turned(centre, angle), sizes);
            let powers = lengths.iter().map(|length| format!("{length}^4")).collect::<Vec<_>>().join(" + ");
            format!("{:?}*({:?} - sqrt(sqrt({powers} + 1.0)))", least(sizes), elementary::powf(2.0, 0.25))
        };
        // Until its corners, each at 1 along every axis, are on the edge.
        let around = |centre: &[f64], sizes: &[f64], angle: f64| {
            let factor = elementary::powf(sizes.len() as f64, 0.25);
            cuboid(centre, &sizes.iter().map(|size| size * factor).collect::<Vec<_>>(), angle)
        };
        let outside = |h: String| format!("-({h})");
        match self {
            Self::AtMost { state, bound } => return Some(format!("{bound:?} - {state}")),
            Self::AtLeast { state, bound } => return Some(format!("{state} - ({bound:?})")),
            Self::Expression { expression, .. } => return Some(expression.clone()),
            Self::SpeedLimit { bound } if !velocity.is_empty() => {
                let parts: Vec<_> = velocity.iter().map(|part| (*part).to_owned()).collect();
                return Some(below(&parts, *bound, *bound / 2.0));
            }
            _ if position.is_empty() => return None,
            _ => {}
        }
        Some(match self {
            Self::Disc { at, radius, smoothing } => round(&away_from(at), *radius, *smoothing),
            Self::Obstacle { at, radius, smoothing } => outside(round(&away_from(at), *radius, *smoothing)),
            Self::QuadraticDisc { at, radius } => {
                format!("{:?} - ({})", radius * radius, squares(&away_from(at)))
            }
            Self::Sphere { centre, radius, smoothing } => round(&away(centre), *radius, *smoothing),
            Self::SphericalObstacle { centre, radius, smoothing } => {
                outside(round(&away(centre), *radius, *smoothing))
            }
            Self::Ellipse { centre, half_axes, angle } => ellipse(centre, half_axes, *angle),
            Self::EllipticObstacle { centre, half_axes, angle } => {
                outside(ellipse(centre, half_axes, *angle))
            }
            Self::Rectangle { centre, half_sides, angle } => cuboid(centre, half_sides, *angle),
            Self::RectangularObstacle { centre, half_sides, angle } => {
                outside(around(centre, half_sides, *angle))
            }
            Self::Box { centre, half_sides, angle } => cuboid(centre, half_sides, *angle),
            Self::BoxObstacle { centre, half_sides, angle } => outside(around(centre, half_sides, *angle)),
            Self::HalfPlane { centre, normal } => {
                let length = elementary::hypot(normal[0], normal[1]);
                let parts = away(centre).into_iter().zip(normal);
                let parts = parts.map(|(length_along, part)| format!("({:?})*{length_along}", part / length));
                parts.collect::<Vec<_>>().join(" + ")
            }
            Self::Apart { from, distance } => {
                let lengths: Vec<_> =
                    position.iter().zip(from).map(|(p, other)| format!("({p} - {other})")).collect();
                outside(below(&lengths, *distance, *distance))
            }
            _ => return None,
        })
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

    pub(super) fn centre(&mut self) -> Option<&mut [f64]> {
        match self {
            Self::Sphere { centre, .. }
            | Self::SphericalObstacle { centre, .. }
            | Self::Box { centre, .. }
            | Self::BoxObstacle { centre, .. } => Some(centre),
            Self::Ellipse { centre, .. }
            | Self::EllipticObstacle { centre, .. }
            | Self::Rectangle { centre, .. }
            | Self::RectangularObstacle { centre, .. } => Some(centre),
            _ => self.point().map(|at| &mut at.centre[..]),
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
            | Self::Obstacle { radius, .. }
            | Self::Sphere { radius, .. }
            | Self::SphericalObstacle { radius, .. } => Some(radius),
            _ => None,
        }
    }

    pub(super) fn smoothing(&mut self) -> Option<&mut f64> {
        match self {
            Self::Disc { smoothing, .. }
            | Self::Obstacle { smoothing, .. }
            | Self::Sphere { smoothing, .. }
            | Self::SphericalObstacle { smoothing, .. } => Some(&mut smoothing.0),
            _ => None,
        }
    }

    pub(super) fn half_axes(&mut self) -> Option<&mut [f64; 2]> {
        match self {
            Self::Ellipse { half_axes, .. } | Self::EllipticObstacle { half_axes, .. } => Some(half_axes),
            _ => None,
        }
    }

    pub(super) fn half_sides(&mut self) -> Option<&mut [f64]> {
        match self {
            Self::Box { half_sides, .. } | Self::BoxObstacle { half_sides, .. } => Some(half_sides),
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
            | Self::RectangularObstacle { angle, .. }
            | Self::Box { angle, .. }
            | Self::BoxObstacle { angle, .. } => Some(angle),
            _ => None,
        }
    }

    pub(super) fn bound(&mut self) -> Option<&mut f64> {
        match self {
            Self::AtMost { bound, .. } | Self::AtLeast { bound, .. } => Some(bound),
            _ => None,
        }
    }

    pub(super) fn distance(&mut self) -> Option<&mut f64> {
        match self {
            Self::Apart { distance, .. } => Some(distance),
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
