//! FMUs of every kind: filters, plants and controllers, with few variables and many.

use std::sync::LazyLock;

use crate::fmu::{FILTER, Fmu, PLANT};

/// The configurations, which `configurations` also starts from.
pub(crate) const CONFIGURATIONS: [&str; 11] = [
    FILTER,
    PLANT,
    include_str!("../../examples/vehicles/unicycle-filter.toml"),
    include_str!("../../examples/vehicles/escort-filter.toml"),
    include_str!("../../examples/vehicles/escort-plant.toml"),
    include_str!("../../examples/vehicles/tour-controller.toml"),
    SEQUENCE,
    KINEMATIC,
    BICYCLE,
    DAMPING,
    HEADING,
];

/// A sequence of goals, an obstacle, a soft limit; outputs change only in steps.
const SEQUENCE: &str = r#"
kind = "filter"
direct_feedthrough = false
sampling = "pointwise"
plant.model = "unicycle"
bounds = { a = [-20.0, 20.0] }
[[barrier]]
name = "first"
shape = "rectangle"
centre = [10.0, 5.0]
half_sides = [2.0, 1.0]
angle = 0.3
deadline = 4.0
until_arrival = true
[[barrier]]
name = "second"
centre = [20.0, 10.0]
radius = 2.0
deadline = 5.0
after = "first"
profile = "low_peak"
when_infeasible = "earliest"
[[barrier]]
name = "rock"
shape = "obstacle"
centre = [15.0, 0.0]
radius = 1.0
deadline = 5.0
priority = 1
[[barrier]]
name = "slow"
shape = "speed_limit"
bound = 9.0
deadline = 5.0
penalty = 10.0
"#;

const KINEMATIC: &str = r#"
kind = "filter"
plant = { model = "bicycle_kinematic", l_r = 1.2, l_f = 1.3 }
bounds = { delta_rate = [-1.0, 1.0] }
actuation_delay = 0.01
[[barrier]]
name = "goal"
centre = [45.0, 45.0]
radius = 2.0
deadline = 10.0
"#;

const BICYCLE: &str = "kind = \"plant\"\nplant = { model = \"bicycle\", l_r = 1.5 }\n";
const DAMPING: &str =
    "kind = \"controller\"\ncontroller = \"damping\"\nplant.model = \"bicycle_kinematic\"\n";
const HEADING: &str = "kind = \"controller\"\ncontroller = \"heading\"\ngoal = [1.0, 2.0]\n\
                       goal_input = true\nplant.model = \"point_mass\"\n";

/// The FMUs that can be instantiated, extracted once.
pub(crate) static FLEET: LazyLock<Vec<Fmu>> =
    LazyLock::new(|| CONFIGURATIONS.iter().map(|text| Fmu::new(text)).collect());
