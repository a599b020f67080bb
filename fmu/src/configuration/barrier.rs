//! `[[barrier]]`: a safe set, the deadline for reaching it if it has one, and when that is in force.

use punctual_core::barrier::Barrier;
use punctual_core::barriers::{
    DistanceDisc, Ellipse, HalfPlane, NormBound, Outside, QuadraticDisc, Rectangle, StateBound,
};
use punctual_core::convergence::operator::Operator;
use punctual_core::filter::{BarrierSettings, Infeasible, Method, ProfileKind};
use serde::{Deserialize, Serialize};

use super::{
    BarrierInput, ConfigurationError, FilterConfiguration, Parameter, PlantSection, Range, ReferenceSection,
    check_identifier, check_unit, external, over_seconds,
};

/// Default margin as a part of the radius, or of the smaller half axis or side.
const MARGIN_OF_SIZE: f64 = 0.01;

/// How the deadline is met.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum MethodName {
    /// [`Method::ReferenceProfile`].
    #[default]
    ReferenceProfile,
    /// [`Method::RepeatedRoot`], the paper's.
    RepeatedRoot,
}

/// The profile that `reference_profile` follows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ProfileName {
    /// [`ProfileKind::Hermite`].
    #[default]
    Hermite,
    /// [`ProfileKind::LowPeak`]: of least peak.
    LowPeak,
}

/// What is done where the bounds certainly do not allow the deadline.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum InfeasibleName {
    /// [`Infeasible::Report`].
    #[default]
    Report,
    /// [`Infeasible::Soonest`].
    Soonest,
}

/// The shape of a barrier.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ShapeName {
    /// Not said: `plugin` where the plant is one, `external` where the plant is not known, `expression` where there is one, else `disc`. Not in a completed configuration.
    #[default]
    #[serde(skip)]
    Unstated,
    /// [`DistanceDisc`]: interior of a disc, smooth and distance-shaped. The one to use.
    Disc,
    /// [`QuadraticDisc`]: interior of a disc in the paper's form R² − d².
    QuadraticDisc,
    /// [`Outside`] of a [`DistanceDisc`]: to be kept clear of, or left by the deadline.
    Obstacle,
    /// [`Ellipse`]: its interior.
    Ellipse,
    /// [`Outside`] of an [`Ellipse`].
    EllipticObstacle,
    /// [`Rectangle`]: its interior, corners rounded inwards.
    Rectangle,
    /// [`Outside`] of a [`Rectangle`] that contains the true one.
    RectangularObstacle,
    /// [`HalfPlane`]: one side of a line.
    HalfPlane,
    /// [`StateBound`]: a state that is at most the bound.
    AtMost,
    /// [`StateBound`]: a state that is at least the bound.
    AtLeast,
    /// [`NormBound`]: the speed, in either direction.
    SpeedLimit,
    /// Where an expression of states and time is ≥ 0.
    Expression,
    /// Of the plant's plug-in.
    Plugin,
    /// Of which the derivatives are inputs of the FMU ([`punctual_core::lie::external`]).
    External,
}

/// A field that some shapes have and others not.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Field {
    Centre,
    Velocity,
    Radius,
    Smoothing,
    HalfAxes,
    HalfSides,
    Angle,
    Normal,
    State,
    Bound,
    Expression,
    Output,
    Unit,
    RelativeDegree,
}

impl Field {
    const ALL: [(Self, &'static str); 14] = [
        (Self::Centre, "centre"),
        (Self::Velocity, "velocity"),
        (Self::Radius, "radius"),
        (Self::Smoothing, "smoothing"),
        (Self::HalfAxes, "half_axes"),
        (Self::HalfSides, "half_sides"),
        (Self::Angle, "angle"),
        (Self::Normal, "normal"),
        (Self::State, "state"),
        (Self::Bound, "bound"),
        (Self::Expression, "expression"),
        (Self::Output, "output"),
        (Self::Unit, "unit"),
        (Self::RelativeDegree, "relative_degree"),
    ];
}

impl ShapeName {
    /// Its name in a configuration.
    pub fn name(self) -> &'static str {
        self.row().0
    }

    /// Name in a configuration, and fields: one row for each shape.
    fn row(self) -> (&'static str, &'static [Field]) {
        use Field::{Angle, Bound, Centre, HalfAxes, HalfSides, Normal, Radius, Smoothing, State, Velocity};
        const DISC: &[Field] = &[Centre, Velocity, Radius, Smoothing];
        match self {
            Self::Disc | Self::Unstated => ("disc", DISC),
            Self::QuadraticDisc => ("quadratic_disc", &[Centre, Velocity, Radius]),
            Self::Obstacle => ("obstacle", DISC),
            Self::Ellipse => ("ellipse", &[Centre, HalfAxes, Angle]),
            Self::EllipticObstacle => ("elliptic_obstacle", &[Centre, HalfAxes, Angle]),
            Self::Rectangle => ("rectangle", &[Centre, HalfSides, Angle]),
            Self::RectangularObstacle => ("rectangular_obstacle", &[Centre, HalfSides, Angle]),
            Self::HalfPlane => ("half_plane", &[Centre, Normal]),
            Self::AtMost => ("at_most", &[State, Bound]),
            Self::AtLeast => ("at_least", &[State, Bound]),
            Self::SpeedLimit => ("speed_limit", &[Bound]),
            Self::Expression => ("expression", &[Field::Expression, Field::Unit]),
            Self::Plugin => ("plugin", &[Field::Output, Field::Unit]),
            Self::External => ("external", &[Field::RelativeDegree, Field::Unit]),
        }
    }

    fn has(self, field: Field) -> bool {
        self.row().1.contains(&field)
    }
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

/// `[[barrier]]`: a safe set, to be reached by a deadline, or to be kept.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct BarrierSection {
    /// Its name, a C identifier, unique; prefix of its variables.
    pub name: String,
    /// The shape. Default `plugin` where the plant is one, `external` where the plant has inputs only, `expression` where there is one, else `disc`.
    #[serde(default)]
    pub shape: ShapeName,
    /// Discs, ellipses, rectangles: centre in m; of a moving disc where it is at time 0 of the simulation,
    /// whenever that starts. Half-plane: a point of its line.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub centre: Option<[f64; 2]>,
    /// Discs: velocity of the centre in m/s. Default 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub velocity: Option<[f64; 2]>,
    /// Discs: whether centre and velocity are inputs of the FMU, such as a measured obstacle's, that start
    /// with the values here, and not parameters. Default false.
    #[serde(default, skip_serializing_if = "is_default")]
    pub centre_input: bool,
    /// Discs: radius in m, > 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub radius: Option<f64>,
    /// `disc` and `obstacle`: ε in m, ≥ 0. Default 0: the radius.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub smoothing: Option<f64>,
    /// Ellipses: half axes in m, > 0, the first of them at `angle` from the x axis.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub half_axes: Option<[f64; 2]>,
    /// Rectangles: half sides in m, > 0, the first of them at `angle` from the x axis.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub half_sides: Option<[f64; 2]>,
    /// Ellipses and rectangles: in rad. Default 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub angle: Option<f64>,
    /// Half-plane: a vector that points into it, of any length but 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub normal: Option<[f64; 2]>,
    /// `at_most` and `at_least`: the name of the state.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub state: Option<String>,
    /// `at_most`, `at_least`: bound in the unit of the state; `speed_limit`: in m/s, > 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bound: Option<f64>,
    /// `expression`: h, of states, parameters of the plant, and the time `t` in s of the simulation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub expression: Option<String>,
    /// `plugin`: which of the plug-in's barriers. Default: the one that has its name.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub output: Option<String>,
    /// `expression` and `external`: the unit of h. Default `1`. `plugin`: that of the plug-in.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<String>,
    /// `external`: n, in 1 ..= 8: the order of the derivative of h that the inputs enter. Nobody checks it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub relative_degree: Option<usize>,
    /// Deadline T in s after the first step, > 0. Default: none, for a set that is only to be kept from a start
    /// inside it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub deadline: Option<f64>,
    /// How it is met. Default `reference_profile`.
    #[serde(default)]
    pub method: MethodName,
    /// The profile of `reference_profile`. Default `hermite`.
    #[serde(default, skip_serializing_if = "is_default")]
    pub profile: ProfileName,
    /// What is done where the bounds certainly do not allow the deadline. Default `report`.
    #[serde(default, skip_serializing_if = "is_default")]
    pub when_infeasible: InfeasibleName,
    /// Rate a of the profile method in 1/s, ≥ 0. Default 0: 20 / deadline, without a deadline what the bounds can
    /// brake; at most 0.5 / step.
    #[serde(default)]
    pub rate: f64,
    /// As many rates as the relative degree, in 1/s, > 0, in place of `rate`. Default: none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub rates: Vec<f64>,
    /// Rate of the stay constraint in 1/s, ≥ 0. Default 0: as `rate`, and
    /// as the default of that where there are `rates`.
    #[serde(default)]
    pub stay_rate: f64,
    /// Margin μ in the unit of h, ≥ 0; what held inputs are expected to cost is added. Default: a
    /// hundredth of the radius, half axis or half side (the smaller), none for the other shapes.
    #[serde(default)]
    pub margin: Option<f64>,
    /// Time in s to be inside again after leaving, ≥ 0. Default 0: leaving is reported only.
    #[serde(default)]
    pub recovery: f64,
    /// A bound on what the model does not know of h⁽ⁿ⁾ (a disturbance), in the unit of h per sⁿ, ≥ 0: the promise
    /// holds for all within it. Default 0.
    #[serde(default, skip_serializing_if = "is_default")]
    pub disturbance: f64,
    /// Where not all barriers can be met: those of smaller numbers go first, of equal ones the one above.
    /// Default: 0 for one whose set the start is in, 1 for the others.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub priority: Option<u32>,
    /// Makes it soft: it yields where it would cost more than this ‖u − u_ref‖, in units of u, > 0. Default 0:
    /// hard.
    #[serde(default, skip_serializing_if = "is_default")]
    pub penalty: f64,
    /// Time in s after the first step from which it is enforced, ≥ 0, < deadline if there is one. Default 0.
    #[serde(default, skip_serializing_if = "is_default")]
    pub begin: f64,
    /// The barrier, above in the file, whose arrival it waits for. Default: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub after: Option<String>,
    /// Time in s after the first step at which it is let go, > begin. Default 0: never.
    #[serde(default, skip_serializing_if = "is_default")]
    pub end: f64,
    /// Whether it is let go when it has been reached. Default false.
    #[serde(default, skip_serializing_if = "is_default")]
    pub until_arrival: bool,
}

/// Does something with the shape of a barrier.
pub(super) trait Visitor {
    type Output;
    fn shape<B>(self, barrier: B) -> Self::Output
    where
        B: Barrier<4> + Barrier<5> + Barrier<8> + Barrier<9> + Send + 'static;
}

impl BarrierSection {
    pub(super) fn complete(&mut self, path: &str, plant: &PlantSection) -> Result<(), ConfigurationError> {
        if self.shape == ShapeName::Unstated {
            self.shape = match self.expression {
                _ if plant.plugin.is_some() => ShapeName::Plugin,
                _ if plant.is_external() => ShapeName::External,
                Some(_) => ShapeName::Expression,
                None => ShapeName::Disc,
            };
        }
        check_identifier(&format!("{path}.name"), &self.name)?;
        let refuse =
            |field: &str, message: String| Err(ConfigurationError::new(format!("{path}.{field}"), message));
        let (shape, fields) = self.shape.row();
        if plant.is_external() && self.shape != ShapeName::External {
            let message =
                format!("is {shape:?}, which needs states; this plant has none, so it is \"external\"");
            return refuse("shape", message);
        }
        self.check_plugin(path, plant)?;
        let any = [ShapeName::Expression, ShapeName::External, ShapeName::Plugin];
        if plant.reference().is_none() && !any.contains(&self.shape) {
            return refuse(
                "shape",
                format!("is {shape:?}, which is for the plants that have a name; give an `expression`"),
            );
        }
        for (field, name) in Field::ALL {
            let given = match field {
                Field::Centre => self.centre.is_some(),
                Field::Velocity => self.velocity.is_some() || self.centre_input,
                Field::Radius => self.radius.is_some(),
                Field::Smoothing => self.smoothing.is_some(),
                Field::HalfAxes => self.half_axes.is_some(),
                Field::HalfSides => self.half_sides.is_some(),
                Field::Angle => self.angle.is_some(),
                Field::Normal => self.normal.is_some(),
                Field::State => self.state.is_some(),
                Field::Bound => self.bound.is_some(),
                Field::Expression => self.expression.is_some(),
                Field::Output => self.output.is_some(),
                Field::Unit => self.unit.is_some(),
                Field::RelativeDegree => self.relative_degree.is_some(),
            };
            let optional = matches!(
                field,
                Field::Velocity | Field::Smoothing | Field::Angle | Field::Output | Field::Unit
            );
            if given && !fields.contains(&field) {
                let name = if name == "velocity" && self.centre_input { "centre_input" } else { name };
                return refuse(name, format!("{shape} has none"));
            }
            if !given && !optional && fields.contains(&field) {
                return refuse(name, format!("missing, {shape} needs it"));
            }
        }
        if self.shape.has(Field::Velocity) {
            self.velocity.get_or_insert([0.0; 2]);
        }
        if self.shape.has(Field::Smoothing) {
            self.smoothing.get_or_insert(0.0);
        }
        if self.shape.has(Field::Angle) {
            self.angle.get_or_insert(0.0);
        }
        self.complete_output(path, plant)?;
        if self.shape.has(Field::Unit) {
            check_unit(&format!("{path}.unit"), self.unit.get_or_insert("1".to_owned()))?;
        }
        external::check_degree(path, self.relative_degree)?;
        let states = plant.states();
        if let Some(state) = &self.state
            && states.iter().all(|s| s.name != *state)
        {
            let names: Vec<_> = states.iter().map(|s| s.name.as_str()).collect();
            return refuse("state", format!("is {state:?}, must be one of {}", names.join(", ")));
        }
        let sides = self.half_axes.or(self.half_sides).map(|[a, b]| a.min(b));
        let size = match self.shape {
            ShapeName::QuadraticDisc => None,
            _ => self.radius.or(sides),
        };
        // A size out of range is refused by its own name.
        self.margin.get_or_insert(MARGIN_OF_SIZE * size.unwrap_or(0.0).max(0.0));
        Ok(())
    }

    /// The unit of h.
    pub fn unit(&self, plant: &PlantSection) -> String {
        let unit = match self.shape {
            ShapeName::QuadraticDisc => "m2",
            ShapeName::SpeedLimit => "m/s",
            ShapeName::AtMost | ShapeName::AtLeast => {
                let state = plant.states().into_iter().find(|s| Some(&s.name) == self.state.as_ref());
                return state.map_or_else(|| "1".to_owned(), |s| s.unit);
            }
            ShapeName::Expression | ShapeName::External | ShapeName::Plugin => {
                self.unit.as_deref().unwrap_or("1")
            }
            _ => "m",
        };
        unit.to_owned()
    }

    pub(super) fn parameters(
        &self,
        index: usize,
        plant: &PlantSection,
        degree: Option<usize>,
    ) -> Vec<Parameter<FilterConfiguration>> {
        let unit = &self.unit(plant)[..];
        let mut rows = Vec::new();
        let mut row =
            |field: &str, unit: &str, range, description: &str, access: fn(&mut Self) -> &mut f64| {
                // Configuration files count barriers from 0, as the error messages of serde do; the
                // components of a vector are counted from 1, as in FMI.
                let names = (format!("{}.{field}", self.name), format!("barrier[{index}].{field}"));
                rows.push(Parameter::new(
                    names,
                    unit.to_owned(),
                    range,
                    description,
                    move |c: &mut FilterConfiguration| access(&mut c.barrier[index]),
                ));
            };
        let (positive, non_negative, finite) = (Range::POSITIVE, Range::NON_NEGATIVE, Range::FINITE);
        if self.deadline.is_some() {
            row("deadline", "s", positive, "time from the first step to be inside and to stay so", |b| {
                b.deadline.get_or_insert(1.0)
            });
        }
        let meaning = match self.deadline {
            Some(_) => "decay rate of an error against the profile; 0: 20 / deadline, at most 0.5 / step",
            None => "how fast h may go to the margin; 0: what the bounds can brake, at most 0.5 / step",
        };
        row("rate", "1/s", non_negative, meaning, |b| &mut b.rate);
        let meaning = "rate of the constraint that keeps it inside; 0: as rate";
        row("stay_rate", "1/s", non_negative, meaning, |b| &mut b.stay_rate);
        row("margin", unit, non_negative, "h to arrive and stay above", |b| b.margin.get_or_insert(0.0));
        row("recovery", "s", non_negative, "deadline for coming back after leaving; 0: none", |b| {
            &mut b.recovery
        });
        if self.disturbance != 0.0 {
            let per_time = over_seconds(unit, degree.unwrap_or_default());
            let meaning = "bound on what the model does not know of the derivative of h with an input";
            row("disturbance", &per_time, non_negative, meaning, |b| &mut b.disturbance);
        }
        if self.penalty != 0.0 {
            row("penalty", "1", positive, "distance in u beyond which it yields", |b| &mut b.penalty);
        }
        if self.begin != 0.0 {
            row("begin", "s", non_negative, "time from the first step to be enforced from", |b| &mut b.begin);
        }
        if self.end != 0.0 {
            row("end", "s", non_negative, "time from the first step to be let go; 0: never", |b| &mut b.end);
        }
        if self.shape == ShapeName::HalfPlane {
            row("centre[1]", "m", finite, "x of a point of the line", |b| first(&mut b.centre));
            row("centre[2]", "m", finite, "y of a point of the line", |b| second(&mut b.centre));
        } else if self.shape.has(Field::Centre) && !self.centre_input {
            row("centre[1]", "m", finite, "centre along x, at time 0", |b| first(&mut b.centre));
            row("centre[2]", "m", finite, "centre along y, at time 0", |b| second(&mut b.centre));
        }
        if self.shape.has(Field::Velocity) && !self.centre_input {
            row("velocity[1]", "m/s", finite, "velocity of the centre along x", |b| first(&mut b.velocity));
            row("velocity[2]", "m/s", finite, "velocity of the centre along y", |b| second(&mut b.velocity));
        }
        if self.shape.has(Field::Radius) {
            row("radius", "m", positive, "radius of the disc", |b| b.radius.get_or_insert(0.0));
        }
        if self.shape.has(Field::Smoothing) {
            let meaning = "rounding of the distance at the centre; 0: the radius";
            row("smoothing", "m", non_negative, meaning, |b| b.smoothing.get_or_insert(0.0));
        }
        if self.shape.has(Field::HalfAxes) {
            row("half_axes[1]", "m", positive, "half axis at the angle", |b| first(&mut b.half_axes));
            row("half_axes[2]", "m", positive, "half axis across", |b| second(&mut b.half_axes));
        }
        if self.shape.has(Field::HalfSides) {
            row("half_sides[1]", "m", positive, "half side at the angle", |b| first(&mut b.half_sides));
            row("half_sides[2]", "m", positive, "half side across", |b| second(&mut b.half_sides));
        }
        if self.shape.has(Field::Angle) {
            row("angle", "rad", finite, "from the x axis", |b| b.angle.get_or_insert(0.0));
        }
        if self.shape.has(Field::Normal) {
            row("normal[1]", "1", finite, "x of a vector into the half-plane", |b| first(&mut b.normal));
            row("normal[2]", "1", finite, "y of a vector into the half-plane", |b| second(&mut b.normal));
        }
        if self.shape.has(Field::Bound) {
            let range = if self.shape == ShapeName::SpeedLimit { positive } else { finite };
            row("bound", unit, range, "the bound", |b| b.bound.get_or_insert(0.0));
        }
        rows
    }

    /// The settings of its promise; 0 means "as the others say".
    ///
    /// # Errors
    ///
    /// Rates out of range.
    pub fn settings(&self) -> Result<BarrierSettings, punctual_core::Error> {
        let given = |value: f64| (value != 0.0).then_some(value);
        let rates = match &self.rates[..] {
            [] => None,
            rates => Some(Operator::new(rates)?),
        };
        Ok(BarrierSettings {
            deadline: self.deadline,
            method: match self.method {
                MethodName::ReferenceProfile => Method::ReferenceProfile,
                MethodName::RepeatedRoot => Method::RepeatedRoot,
            },
            profile: match self.profile {
                ProfileName::Hermite => ProfileKind::Hermite,
                ProfileName::LowPeak => ProfileKind::LowPeak,
            },
            infeasible: match self.when_infeasible {
                InfeasibleName::Report => Infeasible::Report,
                InfeasibleName::Soonest => Infeasible::Soonest,
            },
            rate: given(self.rate),
            rates,
            stay_rate: given(self.stay_rate),
            margin: self.margin.unwrap_or(0.0),
            recovery: given(self.recovery),
            disturbance: self.disturbance,
        })
    }

    /// Its variables that are inputs: the point that it follows, or the derivatives that it is given.
    pub fn inputs(&self, plant: &PlantSection) -> Vec<BarrierInput> {
        if self.shape == ShapeName::External {
            return external::inputs(self, plant);
        }
        if !self.centre_input {
            return Vec::new();
        }
        let (centre, velocity) = (self.centre.unwrap_or_default(), self.velocity.unwrap_or_default());
        [
            ("centre[1]", "m", centre[0], "where the centre is, along x"),
            ("centre[2]", "m", centre[1], "where the centre is, along y"),
            ("velocity[1]", "m/s", velocity[0], "velocity of the centre along x"),
            ("velocity[2]", "m/s", velocity[1], "velocity of the centre along y"),
        ]
        .map(|(field, unit, start, description)| BarrierInput {
            name: format!("{}.{field}", self.name),
            unit: unit.to_owned(),
            start,
            description: description.to_owned(),
        })
        .into()
    }

    /// Hands the shape to `visitor`, along a reference plant; a centre that is an input is at the states behind
    /// the plant's. A barrier that is an expression, a plug-in's or external is no shape, and taken for a disc here.
    pub(super) fn visit<V: Visitor>(
        &self,
        plant: ReferenceSection,
        visitor: V,
    ) -> Result<V::Output, punctual_core::Error> {
        let (centre, velocity) = (self.centre.unwrap_or_default(), self.velocity.unwrap_or_default());
        let (radius, bound) = (self.radius.unwrap_or_default(), self.bound.unwrap_or_default());
        let angle = self.angle.unwrap_or_default();
        let signals = plant.model.states();
        let states = signals.len();
        let disc = || {
            let smoothing = self.smoothing.filter(|s| *s != 0.0).unwrap_or(radius);
            let disc = DistanceDisc::new(centre, radius, smoothing)?.moving(velocity)?;
            Ok::<_, punctual_core::Error>(if self.centre_input { disc.following(states) } else { disc })
        };
        let ellipse = || Ellipse::new(centre, self.half_axes.unwrap_or_default(), angle);
        let rectangle = || Rectangle::new(centre, self.half_sides.unwrap_or_default(), angle);
        let index = |name: &str| signals.iter().position(|s| s.name == name);
        let state = self.state.as_deref().and_then(index).unwrap_or(usize::MAX);
        Ok(match self.shape {
            ShapeName::Disc
            | ShapeName::Unstated
            | ShapeName::Expression
            | ShapeName::Plugin
            | ShapeName::External => visitor.shape(disc()?),
            ShapeName::Obstacle => visitor.shape(Outside(disc()?)),
            ShapeName::QuadraticDisc => {
                let disc = QuadraticDisc::new(centre, radius)?.moving(velocity)?;
                visitor.shape(if self.centre_input { disc.following(states) } else { disc })
            }
            ShapeName::Ellipse => visitor.shape(ellipse()?),
            ShapeName::EllipticObstacle => visitor.shape(Outside(ellipse()?)),
            ShapeName::Rectangle => visitor.shape(rectangle()?),
            ShapeName::RectangularObstacle => visitor.shape(Outside(rectangle()?.around())),
            ShapeName::HalfPlane => visitor.shape(HalfPlane::new(self.normal.unwrap_or_default(), centre)?),
            ShapeName::AtMost => visitor.shape(StateBound::at_most(state, bound)?),
            ShapeName::AtLeast => visitor.shape(StateBound::at_least(state, bound)?),
            ShapeName::SpeedLimit => match index("v") {
                Some(speed) => visitor.shape(NormBound::of_one(speed, bound)?),
                None => visitor.shape(NormBound::new(index("v_x").unwrap_or(usize::MAX), bound)?),
            },
        })
    }
}

fn first(pair: &mut Option<[f64; 2]>) -> &mut f64 {
    &mut pair.get_or_insert([0.0; 2])[0]
}

fn second(pair: &mut Option<[f64; 2]>) -> &mut f64 {
    &mut pair.get_or_insert([0.0; 2])[1]
}
