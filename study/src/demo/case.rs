//! The cases of the demonstration, as the TOML files that a user would write.

use punctual_core::filter::Sampling;

use crate::baseline::Baseline;
use crate::cases::{CENTRE, DEADLINE, Nominal, RADIUS, STEP, Setup, Shape, Vehicle};

/// Sampling period of the hindered vehicles, in s.
const HINDERED_STEP: f64 = 0.01;
/// End of their runs, in s.
const HINDERED_END: f64 = 15.0;
/// Centre of the rock in m, between start and disc.
const ROCK: [f64; 2] = [22.0, 24.0];
/// Its radius, in m.
const ROCK_RADIUS: f64 = 5.0;

/// A vehicle with a method and settings, starting from rest at the origin.
#[derive(Clone, Copy, Debug)]
pub struct Case {
    /// The plant.
    pub vehicle: Vehicle,
    /// The method that is to meet the deadline.
    pub baseline: Baseline,
    /// Barrier, nominal controller, margin and times.
    pub setup: Setup,
    /// The method's name in configurations and file names.
    pub method: &'static str,
    /// The method's name in tables and pictures.
    pub title: &'static str,
}

impl Case {
    /// The paper's method and ours for `vehicle`.
    pub fn of(vehicle: Vehicle) -> [Self; 2] {
        let paper = Self {
            vehicle,
            baseline: Baseline::RepeatedRoot,
            setup: Setup::paper(DEADLINE, STEP),
            method: "repeated_root",
            title: "repeated root (paper)",
        };
        let ours = Self {
            baseline: Baseline::Profile,
            setup: Setup::advised(DEADLINE, STEP),
            method: "reference_profile",
            title: "reference profile",
            ..paper
        };
        [paper, ours]
    }

    /// `vehicle` in realistic use: it starts in the wrong direction, its inputs are bounded, a rock is in its
    /// way, and u_ref only drives on. With bounds on all inputs, the filter follows backup plans.
    pub fn hindered(vehicle: Vehicle) -> Self {
        let setup =
            Setup { step: HINDERED_STEP, end: HINDERED_END, ..Setup::advised(DEADLINE, HINDERED_STEP) };
        let [_, ours] = Self::of(vehicle);
        Self { setup, method: "plans", title: "plans, bounded, past a rock", ..ours }
    }

    /// The file of a hindered vehicle, which also contains its plant, its start and its u_ref.
    pub(super) fn alone(&self) -> String {
        let (title, key) = (self.vehicle.title(), self.vehicle.key());
        let [first, second] = [0, 1].map(|i| self.vehicle.inputs()[i].name);
        let (start, bounds, wanted) = match self.vehicle {
            Vehicle::PointMass => ("v_x = -4.0, v_y = -2.0", [5.0, 5.0], ["-1", "-1"]),
            Vehicle::Unicycle => ("theta = -2.5, v = 4.0", [5.0, 1.5], ["1", "0"]),
            Vehicle::Bicycle => ("theta = 0.8, v = -4.0", [5.0, 0.5], ["-1", "0"]),
        };
        let Setup { deadline, end, step, .. } = self.setup;
        format!(
            r#"# A {title} that begins the wrong way, with bounds on its inputs and a rock before it: `punctual run` takes this file.
kind = "filter"
name = "{key}_among_bounds"
bounds = {{ {first} = [{low0:?}, {high0:?}], {second} = [{low1:?}, {high1:?}] }}
x0 = {{ {start} }}
u_ref = {{ {first} = "{wanted0}", {second} = "{wanted1}" }} # on and on
experiment = {{ stop_time = {end:?}, step_size = {step:?} }} # s

[plant]
model = "{key}"

[[barrier]]
name = "goal"
centre = {CENTRE:?} # m
radius = {RADIUS:?} # m
deadline = {deadline:?} # s

[[barrier]]
name = "rock"
shape = "obstacle"
centre = {ROCK:?} # m
radius = {ROCK_RADIUS:?} # m
"#,
            low0 = -bounds[0],
            high0 = bounds[0],
            low1 = -bounds[1],
            high1 = bounds[1],
            wanted0 = wanted[0],
            wanted1 = wanted[1],
        )
    }

    /// Whether the method is the paper's, which is expected to be late.
    pub fn is_the_papers(&self) -> bool {
        self.baseline == Baseline::RepeatedRoot
    }

    /// The plant's file name without extension.
    pub(super) fn plant_stem(&self) -> String {
        format!("{}-plant", self.vehicle.key())
    }

    /// The filter's file name without extension.
    pub(super) fn filter_stem(&self) -> String {
        format!("{}-filter", self.stem())
    }

    /// The file name of the coupled run without extension.
    pub(super) fn stem(&self) -> String {
        format!("{}-{}", self.vehicle.key(), self.method)
    }

    /// The plant's configuration.
    pub(super) fn plant(&self) -> String {
        let (title, key) = (self.vehicle.title(), self.vehicle.key());
        let Setup { end, step, .. } = self.setup;
        format!(
            r#"# A {title} at rest in the origin.
kind = "plant"
name = "{key}"

[plant]
model = "{key}"

[experiment]
stop_time = {end:?} # s
step_size = {step:?} # s
"#
        )
    }

    /// The filter's configuration.
    pub(super) fn filter(&self) -> String {
        let Self { method, title, .. } = self;
        let (vehicle, key) = (self.vehicle.title(), self.vehicle.key());
        let Setup { shape, margin, deadline, end, step, .. } = self.setup;
        let shape = match shape {
            Shape::Quadratic => r#""quadratic_disc" # h = R² − d²"#,
            Shape::Distance => r#""disc" # h = √(R² + ε²) − √(d² + ε²)"#,
        };
        let margin = if margin > 0.0 { format!("margin = {margin:?} # m\n") } else { String::new() };
        let sampling = match self.baseline.sampling(step) {
            Sampling::Pointwise => "sampling = \"pointwise\" # as in the paper\n",
            // The default.
            _ => "",
        };
        format!(
            r#"# Brings a {vehicle} into the disc within the deadline: {title}.
kind = "filter"
name = "{key}_filter"
{sampling}
[plant]
model = "{key}"

[[barrier]]
name = "goal"
centre = {CENTRE:?} # m
radius = {RADIUS:?} # m
deadline = {deadline:?} # s
shape = {shape}
method = "{method}"
{margin}
[experiment]
stop_time = {end:?} # s
step_size = {step:?} # s
"#
        )
    }

    /// The system file that couples the two; their FMUs are in the same folder.
    pub(super) fn system(&self) -> String {
        let (vehicle, title) = (self.vehicle.title(), self.title);
        let (filter, plant) = (self.filter_stem(), self.plant_stem());
        let Setup { nominal, end, step, .. } = self.setup;
        let mut text = format!(
            r#"# {vehicle} and its filter: {title}.
[experiment]
stop_time = {end:?} # s
step = {step:?} # s

[[component]]
name = "filter"
fmu = "{filter}.fmu"

[[component]]
name = "plant"
fmu = "{plant}.fmu"

# x.* of the plant to the filter, u.* of the filter to the plant.
[[connect_by_name]]
components = ["filter", "plant"]
"#
        );
        if nominal == Nominal::Damping {
            text += "\n# The nominal controller: damping.\n";
            let [states, inputs] = self.vehicle.signals();
            for (input, speed) in inputs.iter().zip(self.vehicle.damped()) {
                let Some(speed) = speed else { continue };
                let (speed, input) = (states[speed].name, input.name);
                text += &format!(
                    r#"[[connection]]
from = "plant.x.{speed}"
to = "filter.u_ref.{input}"
factor = -1.0
"#
                );
            }
        }
        text
    }
}
