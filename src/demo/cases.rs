//! The cases of the demonstration, as the TOML files that a user would write.

/// Deadline T in s.
pub const DEADLINE: f64 = 10.0;
/// End of the runs in s: 2 T.
pub const STOP: f64 = 20.0;
/// Communication step in s.
pub(super) const STEP: f64 = 0.001;
/// Centre of the safe disc in m.
pub(super) const CENTRE: [f64; 2] = [45.0, 45.0];
/// Radius of the safe disc in m.
pub(super) const RADIUS: f64 = 2.0;

/// A plant of the demonstration. It starts at rest in the origin.
#[derive(Clone, Copy, Debug)]
pub struct Model {
    /// Its name in configurations and file names.
    pub key: &'static str,
    /// Its name in tables and pictures.
    pub title: &'static str,
    /// Its inputs with their units.
    pub inputs: [(&'static str, &'static str); 2],
    /// The nominal controller: damping, as pairs (state, input) with input = −state.
    damping: &'static [(&'static str, &'static str)],
}

/// The three plants of the paper.
pub const MODELS: [Model; 3] = [
    Model {
        key: "point_mass",
        title: "point mass",
        inputs: [("u_x", "m/s²"), ("u_y", "m/s²")],
        damping: &[("v_x", "u_x"), ("v_y", "u_y")],
    },
    Model {
        key: "unicycle",
        title: "unicycle",
        inputs: [("a", "m/s²"), ("omega", "rad/s")],
        damping: &[("v", "a")],
    },
    Model {
        key: "bicycle",
        title: "bicycle",
        inputs: [("a", "m/s²"), ("beta", "rad")],
        damping: &[("v", "a")],
    },
];

/// How the deadline is to be met.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// The paper's: repeated root, quadratic disc, no nominal controller.
    RepeatedRoot,
    /// Ours: reference profile, distance-shaped disc, damping as nominal controller.
    ReferenceProfile,
}

impl Method {
    /// Both, the paper's first.
    pub const ALL: [Self; 2] = [Self::RepeatedRoot, Self::ReferenceProfile];

    /// Its name in configurations and file names.
    pub fn key(self) -> &'static str {
        match self {
            Self::RepeatedRoot => "repeated_root",
            Self::ReferenceProfile => "reference_profile",
        }
    }

    /// Its name in tables and pictures.
    pub fn title(self) -> &'static str {
        match self {
            Self::RepeatedRoot => "repeated root (paper)",
            Self::ReferenceProfile => "reference profile",
        }
    }

    /// The unit of h.
    pub fn unit(self) -> &'static str {
        match self {
            Self::RepeatedRoot => "m²",
            Self::ReferenceProfile => "m",
        }
    }
}

/// The plant's configuration.
pub(super) fn plant(model: Model) -> String {
    format!(
        "# A {title} at rest in the origin.\nkind = \"plant\"\nname = \"{key}\"\n\n[plant]\nmodel = \"{key}\"\n\n\
         [experiment]\nstop_time = {STOP:?} # s\nstep_size = {STEP:?} # s\n",
        key = model.key,
        title = model.title,
    )
}

/// The filter's configuration.
pub(super) fn filter(model: Model, method: Method) -> String {
    let barrier = match method {
        Method::RepeatedRoot => "shape = \"quadratic_disc\" # h = R² − d²\nmethod = \"repeated_root\"\n",
        Method::ReferenceProfile => {
            "shape = \"disc\" # h = √(R² + ε²) − √(d² + ε²)\nmethod = \"reference_profile\"\n\
             margin = 0.02 # m\n"
        }
    };
    let sampling = match method {
        Method::RepeatedRoot => "sampling = \"pointwise\" # as in the paper\n",
        Method::ReferenceProfile => "",
    };
    format!(
        "# Brings a {title} into the disc within the deadline: {method}.\nkind = \"filter\"\nname = \"{key}_filter\"\n{sampling}\n\
         [plant]\nmodel = \"{key}\"\n\n[[barrier]]\nname = \"goal\"\ncentre = {CENTRE:?} # m\nradius = {RADIUS:?} # m\n\
         deadline = {DEADLINE:?} # s\n{barrier}\n[experiment]\nstop_time = {STOP:?} # s\nstep_size = {STEP:?} # s\n",
        title = model.title,
        method = method.title(),
        key = model.key,
    )
}

/// The system file that couples the two; their FMUs lie beside it.
pub(super) fn system(model: Model, method: Method) -> String {
    let mut text = format!(
        "# {title} and its filter: {method}.\n[experiment]\nstop_time = {STOP:?} # s\nstep = {STEP:?} # s\n\n\
         [[component]]\nname = \"filter\"\nfmu = \"{filter}.fmu\"\n\n[[component]]\nname = \"plant\"\nfmu = \"{plant}.fmu\"\n\n\
         # x.* of the plant to the filter, u.* of the filter to the plant.\n\
         [[connect_by_name]]\ncomponents = [\"filter\", \"plant\"]\n",
        title = model.title,
        method = method.title(),
        filter = filter_stem(model, method),
        plant = plant_stem(model),
    );
    if method == Method::ReferenceProfile {
        text += "\n# The nominal controller: damping.\n";
        for (state, input) in model.damping {
            text += &format!(
                "[[connection]]\nfrom = \"plant.x.{state}\"\nto = \"filter.u_ref.{input}\"\nfactor = -1.0\n"
            );
        }
    }
    text
}

/// The plant's files, without ending.
pub(super) fn plant_stem(model: Model) -> String {
    format!("{}-plant", model.key)
}

/// The filter's files, without ending.
pub(super) fn filter_stem(model: Model, method: Method) -> String {
    format!("{}-{}-filter", model.key, method.key())
}

/// The coupled run's files, without ending.
pub(super) fn run_stem(model: Model, method: Method) -> String {
    format!("{}-{}", model.key, method.key())
}
