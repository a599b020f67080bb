//! The system file: parses TOML text into a checked [`System`]. Everything that can be checked without
//! opening an FMU is checked here; the rest is checked in `network`.

use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;

use punctual_fmu::configuration::{ConfigurationError, FileKind, read_toml};
use serde::Deserialize;
use serde::de::{Deserializer, Error as _, IgnoredAny, MapAccess, SeqAccess, Visitor};

use crate::error::Error;
use crate::text;

/// A coupled system, read from a system file. Only [`System::parse`] and [`System::read`] make it, so its
/// numbers are in range and its component names are unique.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct System {
    experiment: Experiment,
    component: Vec<Component>,
    #[serde(default)]
    connection: Vec<Connection>,
    #[serde(default)]
    connect_by_name: Vec<ByName>,
    #[serde(default)]
    record: Record,
    #[serde(default)]
    plot: Vec<Picture>,
}

/// Times, step and order of a run.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Experiment {
    /// Start time in seconds, finite; default 0.
    #[serde(default)]
    pub start_time: f64,
    /// Stop time in seconds, finite, after the start time.
    pub stop_time: f64,
    /// Communication step in seconds, finite, > 0.
    pub step: f64,
    /// Order of calls within a communication step; default Gauss–Seidel.
    #[serde(default)]
    pub order: Order,
    /// Relative tolerance for the solvers inside FMUs, finite, > 0; by default each uses its own.
    pub tolerance: Option<f64>,
}

/// Order of calls within a communication step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Order {
    /// Components with direct feedthrough first, in the order of the signals: no delay.
    #[default]
    GaussSeidel,
    /// All components at once, with the values of the last communication point. Feedthrough outputs act one
    /// step late.
    Jacobi,
}

/// An instance of an FMU.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Component {
    /// Its name: unique, not empty, without a dot.
    pub name: String,
    /// Its FMU, relative to the folder of the system file.
    pub fmu: String,
    /// Whether outputs with undeclared dependencies depend on the inputs at the same instant. Default true,
    /// as the standard says. False suits a plant whose outputs change only at steps.
    #[serde(default = "yes")]
    pub feedthrough: bool,
    /// Relative tolerance for the solver inside this FMU, finite, > 0; default that of the experiment.
    pub tolerance: Option<f64>,
    /// Start values of parameters and inputs, in the variable's unit.
    #[serde(default)]
    pub start: BTreeMap<String, StartValue>,
}

fn yes() -> bool {
    true
}

/// A start value.
#[derive(Clone, Debug, PartialEq)]
pub enum StartValue {
    /// For a Real variable.
    Real(f64),
    /// For an Integer, Enumeration or Real variable.
    Integer(i64),
    /// For a Boolean variable.
    Boolean(bool),
    /// For a String variable.
    Text(String),
    /// For an array; elements can be lists themselves.
    List(Vec<StartValue>),
}

impl StartValue {
    /// The value as a number, if it is one.
    pub fn number(&self) -> Option<f64> {
        match *self {
            Self::Real(value) => Some(value),
            Self::Integer(value) => Some(value as f64),
            Self::Boolean(_) | Self::Text(_) | Self::List(_) => None,
        }
    }

    /// The sizes of the list, the outermost first; empty for a plain value. `None` if it is ragged.
    pub fn sizes(&self) -> Option<Vec<usize>> {
        let Self::List(values) = self else { return Some(Vec::new()) };
        let mut inner = values.iter().map(Self::sizes);
        let first = inner.next().unwrap_or(Some(Vec::new()))?;
        let is_even = inner.all(|sizes| sizes.as_ref() == Some(&first));
        is_even.then(|| [vec![values.len()], first].concat())
    }

    /// The plain values in it, in order.
    pub fn flat(&self) -> Vec<&Self> {
        match self {
            Self::List(values) => values.iter().flat_map(Self::flat).collect(),
            plain => vec![plain],
        }
    }
}

impl<'de> Deserialize<'de> for StartValue {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Expected;
        impl<'de> Visitor<'de> for Expected {
            type Value = StartValue;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a number, true or false, a text, or a list of these")
            }
            fn visit_f64<E>(self, value: f64) -> Result<StartValue, E> {
                Ok(StartValue::Real(value))
            }
            fn visit_i64<E>(self, value: i64) -> Result<StartValue, E> {
                Ok(StartValue::Integer(value))
            }
            fn visit_bool<E>(self, value: bool) -> Result<StartValue, E> {
                Ok(StartValue::Boolean(value))
            }
            fn visit_str<E>(self, value: &str) -> Result<StartValue, E> {
                Ok(StartValue::Text(value.to_owned()))
            }
            fn visit_seq<A: SeqAccess<'de>>(self, mut values: A) -> Result<StartValue, A::Error> {
                let mut list = Vec::new();
                while let Some(value) = values.next_element()? {
                    list.push(value);
                }
                Ok(StartValue::List(list))
            }
            fn visit_map<A: MapAccess<'de>>(self, _: A) -> Result<StartValue, A::Error> {
                Err(serde::de::Error::custom(
                    "is a table, must be a number, true or false, a text, or a list of these; a name with dots needs quotes: \"x0.x_p\" = 1.0",
                ))
            }
        }
        deserializer.deserialize_any(Expected)
    }
}

/// One signal from an output to an input: `to = factor · from + offset`. Without a factor of its own, it
/// converts between the units if they differ.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Connection {
    /// `component.variable` of an output.
    pub from: String,
    /// `component.variable` of an input.
    pub to: String,
    /// Factor, finite, in units of the input per unit of the output; by default it converts the units. Real
    /// signals only.
    pub factor: Option<f64>,
    /// Offset, finite, in the unit of the input; default 0. Real signals only.
    #[serde(default)]
    pub offset: f64,
}

/// Connects every output of either component to the other's input of the same name. An explicit
/// [`Connection`] to the same input takes precedence.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ByName {
    /// The two components.
    pub components: [String; 2],
}

/// The recorded signals.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Record {
    /// Communication steps per row, ≥ 1; default 1. The last point is always recorded.
    #[serde(default = "one_step")]
    pub every: u64,
    /// The signals, as `component.variable`; default all outputs and all connected inputs.
    pub signals: Option<Vec<String>>,
}

impl Default for Record {
    fn default() -> Self {
        Self { every: 1, signals: None }
    }
}

/// A picture drawn from the recording after the run.
#[derive(Clone, Debug)]
pub enum Picture {
    /// Paths in a plane.
    Path(PathPicture),
    /// Signals over time.
    Time(TimePicture),
}

impl Picture {
    /// The name given for its file, if any.
    pub fn name(&self) -> Option<&str> {
        match self {
            Self::Path(picture) => picture.name.as_deref(),
            Self::Time(picture) => picture.name.as_deref(),
        }
    }
}

/// The kinds of a [`Picture`].
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum PictureKind {
    Path,
    Time,
}

/// The keys of both kinds, all optional.
#[derive(Default)]
struct RawPicture {
    kind: Option<PictureKind>,
    name: Option<String>,
    title: Option<String>,
    x: Option<String>,
    y: Option<String>,
    label: Option<String>,
    arrival: Option<String>,
    more: Vec<PathEntry>,
    discs: Vec<DiscEntry>,
    signals: Option<Vec<String>>,
    dashed: Vec<String>,
    ylabel: Option<String>,
    deadline: Option<f64>,
    bounds: Vec<f64>,
    scale: Variant,
}

/// Reads a [`Picture`] key by key. A tagged enum would lose the key of a refused value.
struct PictureVisitor;

impl<'de> Visitor<'de> for PictureVisitor {
    type Value = Picture;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a table")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Picture, A::Error> {
        const PATH: &[&str] = &["name", "title", "x", "y", "label", "arrival", "more", "discs"];
        const TIME: &[&str] =
            &["name", "title", "signals", "dashed", "ylabel", "deadline", "bounds", "scale"];
        let (mut raw, mut given) = (RawPicture::default(), Vec::new());
        while let Some(key) = map.next_key::<String>()? {
            match key.as_str() {
                "kind" => raw.kind = Some(map.next_value()?),
                "name" => raw.name = Some(map.next_value()?),
                "title" => raw.title = Some(map.next_value()?),
                "x" => raw.x = Some(map.next_value()?),
                "y" => raw.y = Some(map.next_value()?),
                "label" => raw.label = Some(map.next_value()?),
                "arrival" => raw.arrival = Some(map.next_value()?),
                "more" => raw.more = map.next_value()?,
                "discs" => raw.discs = map.next_value()?,
                "signals" => raw.signals = Some(map.next_value()?),
                "dashed" => raw.dashed = map.next_value()?,
                "ylabel" => raw.ylabel = Some(map.next_value()?),
                "deadline" => raw.deadline = Some(map.next_value()?),
                "bounds" => raw.bounds = map.next_value()?,
                "scale" => raw.scale = map.next_value()?,
                _ => {
                    map.next_value::<IgnoredAny>()?;
                }
            }
            given.push(key);
        }
        let kind = raw.kind.ok_or_else(|| A::Error::missing_field("kind"))?;
        let own = match kind {
            PictureKind::Path => PATH,
            PictureKind::Time => TIME,
        };
        if let Some(key) = given.iter().find(|key| *key != "kind" && !own.contains(&key.as_str())) {
            return Err(A::Error::unknown_field(key, own));
        }
        Ok(match kind {
            PictureKind::Path => Picture::Path(PathPicture {
                name: raw.name,
                title: raw.title,
                x: raw.x.ok_or_else(|| A::Error::missing_field("x"))?,
                y: raw.y.ok_or_else(|| A::Error::missing_field("y"))?,
                label: raw.label,
                arrival: raw.arrival,
                more: raw.more,
                discs: raw.discs,
            }),
            PictureKind::Time => Picture::Time(TimePicture {
                name: raw.name,
                title: raw.title,
                signals: raw.signals.ok_or_else(|| A::Error::missing_field("signals"))?,
                dashed: raw.dashed,
                ylabel: raw.ylabel,
                deadline: raw.deadline,
                bounds: raw.bounds,
                scale: raw.scale,
            }),
        })
    }
}

impl<'de> Deserialize<'de> for Picture {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(PictureVisitor)
    }
}

/// Paths in a plane, with equal axes.
#[derive(Clone, Debug)]
pub struct PathPicture {
    /// Its file is `<system>-<name>.svg`; default the number of the picture.
    pub name: Option<String>,
    /// Title; default none.
    pub title: Option<String>,
    /// The signal along x.
    pub x: String,
    /// The signal along y.
    pub y: String,
    /// The legend entry of this path; default the component's name.
    pub label: Option<String>,
    /// A signal; the path is marked where it first becomes true (not 0).
    pub arrival: Option<String>,
    /// Further paths.
    pub more: Vec<PathEntry>,
    /// Discs drawn beneath.
    pub discs: Vec<DiscEntry>,
}

/// A further path of a [`PathPicture`].
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PathEntry {
    /// The signal along x.
    pub x: String,
    /// The signal along y.
    pub y: String,
    /// The legend entry; default the component's name.
    pub label: Option<String>,
    /// A signal; the path is marked where it first becomes true (not 0).
    pub arrival: Option<String>,
}

/// A disc of a [`PathPicture`].
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DiscEntry {
    /// Its centre, in the units of the axes, finite.
    pub centre: [f64; 2],
    /// Its radius, in the units of the axes, finite, > 0.
    pub radius: f64,
    /// Its legend entry; default none.
    pub label: Option<String>,
    /// Whether it must be avoided; default false.
    #[serde(default)]
    pub obstacle: bool,
}

/// Signals over time.
#[derive(Clone, Debug)]
pub struct TimePicture {
    /// Its file is `<system>-<name>.svg`; default the number of the picture.
    pub name: Option<String>,
    /// Title; default none.
    pub title: Option<String>,
    /// The signals drawn as lines, as `component.variable`.
    pub signals: Vec<String>,
    /// Signals drawn as dashed lines.
    pub dashed: Vec<String>,
    /// The label of the y axis; default the unit, if all signals share one.
    pub ylabel: Option<String>,
    /// A vertical line at this time in seconds, finite.
    pub deadline: Option<f64>,
    /// Horizontal lines at these values, finite.
    pub bounds: Vec<f64>,
    /// Whether the y axis is linear, cut to the bulk of the values, or logarithmic; default linear.
    pub scale: Variant,
}

/// The y axis of a [`TimePicture`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Variant {
    /// All values, linear.
    #[default]
    Linear,
    /// Linear, without rare extremes; the picture says what is cut off.
    Clipped,
    /// Logarithm of the absolute values.
    Log,
}

fn one_step() -> u64 {
    1
}

impl System {
    /// Reads and checks the text of a system file.
    ///
    /// # Errors
    ///
    /// Text that is not TOML; unknown or missing keys; values of the wrong type or out of range; component
    /// names that are empty, contain a dot or are used twice. Each error names the field.
    pub fn parse(text: &str) -> Result<Self, Error> {
        let system: Self = read_toml(text).map_err(|e| FileKind::System.instead(text).unwrap_or(e))?;
        system.check()?;
        Ok(system)
    }

    /// Reads and checks the system file at `path`.
    ///
    /// # Errors
    ///
    /// A file that cannot be read, or as for [`System::parse`].
    pub fn read(path: &Path) -> Result<Self, Error> {
        Self::parse(&text::read(path)?).map_err(|e| e.in_file(path))
    }

    /// The same system, run until `stop_time` in steps of `step` (s), if given.
    ///
    /// # Errors
    ///
    /// Times that a system file may not have either.
    pub fn timed(mut self, stop_time: Option<f64>, step: Option<f64>) -> Result<Self, ConfigurationError> {
        self.experiment.stop_time = stop_time.unwrap_or(self.experiment.stop_time);
        self.experiment.step = step.unwrap_or(self.experiment.step);
        self.check()?;
        Ok(self)
    }

    /// The same system in this order.
    #[must_use]
    pub fn ordered(mut self, order: Order) -> Self {
        self.experiment.order = order;
        self
    }

    /// The same system with `signals` recorded at every step, and no pictures.
    #[must_use]
    pub fn recording(mut self, signals: Vec<String>) -> Self {
        self.record = Record { every: 1, signals: Some(signals) };
        self.plot.clear();
        self
    }

    /// Times, step and order of a run.
    pub fn experiment(&self) -> &Experiment {
        &self.experiment
    }

    /// The components, in the file's order.
    pub fn components(&self) -> &[Component] {
        &self.component
    }

    /// The explicit connections.
    pub fn connections(&self) -> &[Connection] {
        &self.connection
    }

    /// The pairs connected by name.
    pub fn by_name(&self) -> &[ByName] {
        &self.connect_by_name
    }

    /// The recorded signals.
    pub fn record(&self) -> &Record {
        &self.record
    }

    /// The pictures asked for.
    pub fn pictures(&self) -> &[Picture] {
        &self.plot
    }

    fn check(&self) -> Result<(), ConfigurationError> {
        let Experiment { start_time, stop_time, step, tolerance, .. } = self.experiment;
        check_tolerance("experiment.tolerance", tolerance)?;
        finite("experiment.start_time", start_time)?;
        finite("experiment.stop_time", stop_time)?;
        finite("experiment.step", step)?;
        ensure(stop_time > start_time, "experiment.stop_time", || {
            format!("is {stop_time} s; must be after start_time = {start_time} s")
        })?;
        ensure(step > 0.0, "experiment.step", || format!("is {step} s; must be > 0"))?;
        let steps = (stop_time - start_time) / step;
        ensure(steps <= super::grid::MAX_STEPS, "experiment.step", || {
            format!(
                "is {step:?} s, which makes {steps:.3e} steps up to stop_time = {stop_time:?} s; at most {:e} are allowed",
                super::grid::MAX_STEPS
            )
        })?;
        self.check_components()?;
        for (i, connection) in self.connection.iter().enumerate() {
            finite(&format!("connection[{i}].factor"), connection.factor.unwrap_or_default())?;
            finite(&format!("connection[{i}].offset"), connection.offset)?;
        }
        ensure(self.record.every >= 1, "record.every", || "is 0; must be ≥ 1".to_owned())?;
        self.plot.iter().enumerate().try_for_each(|(i, picture)| check_picture(i, picture))
    }

    fn check_components(&self) -> Result<(), ConfigurationError> {
        ensure(!self.component.is_empty(), "component", || "at least one component is needed".to_owned())?;
        for (i, Component { name, fmu, start, tolerance, .. }) in self.component.iter().enumerate() {
            check_tolerance(&format!("component[{i}].tolerance"), *tolerance)?;
            let field = format!("component[{i}].name");
            ensure(!name.is_empty(), &field, || "is empty; must be a name".to_owned())?;
            ensure(!name.contains(['.', '\0']), &field, || format!("is {name:?}; must not contain a dot"))?;
            let first = self.component.iter().position(|other| other.name == *name).unwrap_or(i);
            ensure(first == i, &field, || format!("{name:?} is also the name of component[{first}]"))?;
            ensure(!fmu.is_empty(), &format!("component[{i}].fmu"), || {
                "is empty; must be a file".to_owned()
            })?;
            for (variable, value) in start {
                for value in value.flat() {
                    if let StartValue::Real(value) = value {
                        finite(&format!("component[{i}].start.{variable:?}"), *value)?;
                    }
                }
            }
        }
        Ok(())
    }
}

fn check_picture(i: usize, picture: &Picture) -> Result<(), ConfigurationError> {
    if let Some(name) = picture.name() {
        ensure(!name.is_empty() && !name.contains(['/', '\\', '\0']), &format!("plot[{i}].name"), || {
            format!("is {name:?}; must be part of a file name")
        })?;
    }
    match picture {
        Picture::Path(path) => {
            for (j, disc) in path.discs.iter().enumerate() {
                finite(&format!("plot[{i}].discs[{j}].centre[0]"), disc.centre[0])?;
                finite(&format!("plot[{i}].discs[{j}].centre[1]"), disc.centre[1])?;
                let radius = format!("plot[{i}].discs[{j}].radius");
                finite(&radius, disc.radius)?;
                ensure(disc.radius > 0.0, &radius, || format!("is {}; must be > 0", disc.radius))?;
            }
        }
        Picture::Time(time) => {
            ensure(
                !time.signals.is_empty() || !time.dashed.is_empty(),
                &format!("plot[{i}].signals"),
                || "at least one signal is needed".to_owned(),
            )?;
            for (j, bound) in time.bounds.iter().enumerate() {
                finite(&format!("plot[{i}].bounds[{j}]"), *bound)?;
            }
            if let Some(deadline) = time.deadline {
                finite(&format!("plot[{i}].deadline"), deadline)?;
            }
        }
    }
    Ok(())
}

fn ensure(kept: bool, field: &str, message: impl FnOnce() -> String) -> Result<(), ConfigurationError> {
    if kept { Ok(()) } else { Err(ConfigurationError::new(field, message())) }
}

fn check_tolerance(field: &str, tolerance: Option<f64>) -> Result<(), ConfigurationError> {
    let Some(value) = tolerance else { return Ok(()) };
    ensure(value.is_finite() && value > 0.0, field, || {
        format!("is {value}; must be finite and > 0, such as 1e-6")
    })
}

fn finite(field: &str, value: f64) -> Result<(), ConfigurationError> {
    ensure(value.is_finite(), field, || format!("is {value}; must be finite"))
}

#[cfg(test)]
mod tests {
    use super::*;

    const VALID: &str = r#"
[experiment]
stop_time = 2.0
step = 0.5

[[component]]
name = "a"
fmu = "a.fmu"
start = { "goal.deadline" = 5.0, n = 3, on = true }

[[component]]
name = "b"
fmu = "b.fmu"

[[connection]]
from = "a.y"
to = "b.u"

[record]
every = 2

[[plot]]
kind = "path"
x = "a.x"
y = "a.y"
discs = [{ centre = [45, 45], radius = 2, label = "goal" }]

[[plot]]
kind = "time"
signals = ["a.y"]
"#;

    #[test]
    fn a_valid_file_is_read_with_its_defaults() {
        let system = System::parse(VALID).unwrap();
        assert_eq!(system.experiment().order, Order::GaussSeidel);
        assert_eq!(system.experiment().start_time, 0.0);
        assert_eq!(system.connections()[0].factor, None);
        assert_eq!(system.components()[0].start["goal.deadline"], StartValue::Real(5.0));
        assert_eq!(system.components()[0].start["n"], StartValue::Integer(3));
        assert_eq!(system.components()[0].start["on"], StartValue::Boolean(true));
        assert_eq!(system.pictures().len(), 2);
    }

    #[test]
    fn each_defect_is_told_with_its_field() {
        let defects = [
            (
                "stop_time = 2.0",
                "stop_time = 0.0",
                "experiment.stop_time: is 0 s; must be after start_time = 0 s",
            ),
            ("stop_time = 2.0", "stop_time = nan", "experiment.stop_time: is NaN; must be finite"),
            ("stop_time = 2.0", "", "experiment.stop_time: missing, it must be given"),
            ("step = 0.5", "step = -0.5", "experiment.step: is -0.5 s; must be > 0"),
            (
                "step = 0.5",
                "step = 0.5\ntolerance = 0",
                "experiment.tolerance: is 0; must be finite and > 0, such as 1e-6",
            ),
            (
                "name = \"b\"",
                "name = \"b\"\ntolerance = nan",
                "component[1].tolerance: is NaN; must be finite and > 0",
            ),
            ("step = 0.5", "step = 1e-30", "experiment.step: is 1e-30 s, which makes"),
            (
                "step = 0.5",
                "step = 0.5\nsteps = 1",
                "experiment.steps: is an unknown key (did you mean step?)",
            ),
            (
                "step = 0.5",
                "step = 0.5\norder = \"random\"",
                "experiment.order: is \"random\", must be \"gauss-seidel\" or \"jacobi\"",
            ),
            ("name = \"b\"", "name = \"a\"", "component[1].name: \"a\" is also the name of component[0]"),
            ("name = \"b\"", "name = \"\"", "component[1].name: is empty"),
            ("name = \"b\"", "name = \"b.c\"", "component[1].name: is \"b.c\"; must not contain a dot"),
            ("fmu = \"b.fmu\"", "fmu = \"\"", "component[1].fmu: is empty"),
            ("5.0", "inf", "component[0].start.\"goal.deadline\": is inf; must be finite"),
            ("\"goal.deadline\" = 5.0", "goal.deadline = 5.0", "a name with dots needs quotes"),
            ("on = true", "on = [nan]", "component[0].start.\"on\": is NaN; must be finite"),
            ("to = \"b.u\"", "to = \"b.u\"\nfactor = nan", "connection[0].factor: is NaN; must be finite"),
            ("every = 2", "every = 0", "record.every: is 0; must be ≥ 1"),
            ("radius = 2", "radius = 0", "plot[0].discs[0].radius: is 0; must be > 0"),
            ("signals = [\"a.y\"]", "signals = []", "plot[1].signals: at least one signal is needed"),
            (
                "signals = [\"a.y\"]",
                "signals = [\"a.y\"]\nname = \"../x\"",
                "plot[1].name: is \"../x\"; must be part",
            ),
            ("kind = \"time\"", "kind = \"pie\"", "is \"pie\", must be \"path\" or \"time\""),
        ];
        for (valid, broken, expected) in defects {
            assert!(VALID.contains(valid), "{valid}");
            let message = System::parse(&VALID.replacen(valid, broken, 1)).unwrap_err().to_string();
            assert!(message.contains(expected), "{broken}: {message}");
        }
    }
}
