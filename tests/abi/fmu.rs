//! FMUs as extracted by an importer: a `resources` folder, a GUID, and names of variables.

use std::path::PathBuf;

use punctual_fmu::configuration::{Configuration, FilterConfiguration, FmiVersion, RESOURCE};
use punctual_fmu::product::{Item, Product};
use tempfile::TempDir;

/// A filter for the point mass with input bounds, which only uses its rows.
pub(crate) const FILTER: &str = r#"
kind = "filter"
assurance = "off"
plant.model = "point_mass"
bounds = { u_x = [-50.0, 50.0], u_y = [-40.0, 40.0] }
[[barrier]]
name = "goal"
centre = [45.0, 45.0]
radius = 2.0
deadline = 10.0
"#;

/// The same filter for an unknown plant: its derivatives are inputs.
pub(crate) const EXTERNAL: &str = r#"
kind = "filter"
bounds = { u_x = [-50.0, 50.0], u_y = [-40.0, 40.0] }
[plant]
inputs = [{ name = "u_x", unit = "m/s2" }, { name = "u_y", unit = "m/s2" }]
[[barrier]]
name = "goal"
relative_degree = 2
unit = "m"
deadline = 10.0
margin = 0.02
"#;

/// A filter that integrates the slip angle itself, with every setting of the integrator in use.
pub(crate) const STEERED: &str = r#"
kind = "filter"
plant = { model = "bicycle_small_slip_rate", l_r = 1.5 }
integrator = { state = "beta", gain = 4.0, min = -0.5, max = 0.5 }
bounds = { beta_rate = [-4.0, 4.0] }
[[barrier]]
name = "goal"
centre = [25.0, 10.0]
radius = 2.0
deadline = 10.0
"#;

/// A unicycle that integrates with inner steps of 2⁻¹⁰ s, so that its times are exact.
pub(crate) const PLANT: &str = r#"
kind = "plant"
plant.model = "unicycle"
x0 = { theta = 0.5, v = 2.0 }
integration.inner_step = 0.0009765625
"#;

/// An extracted FMU.
pub(crate) struct Fmu {
    pub(crate) product: Product,
    pub(crate) resources: PathBuf,
    _folder: TempDir,
}

impl Fmu {
    pub(crate) fn new(configuration: &str) -> Self {
        Self::below("extracted", configuration)
    }

    /// An FMU that was extracted to a folder called `name`.
    pub(crate) fn below(name: &str, configuration: &str) -> Self {
        Self::of(name, Configuration::parse(configuration).expect("a valid configuration"))
    }

    /// The FMU of FMI 3.0, with arrays or without.
    pub(crate) fn of_fmi3(configuration: &str, arrays: bool) -> Self {
        let configuration = Configuration::parse(configuration).expect("a valid configuration");
        Self::of("extracted", configuration.for_fmi(FmiVersion::Three, arrays))
    }

    fn of(name: &str, configuration: Configuration) -> Self {
        let folder = TempDir::new().expect("a temporary folder");
        let resources = folder.path().join(name).join("resources");
        std::fs::create_dir_all(&resources).unwrap();
        std::fs::write(resources.join(RESOURCE), configuration.canonical().unwrap()).unwrap();
        Self { product: Product::new(configuration).unwrap(), resources, _folder: folder }
    }

    pub(crate) fn guid(&self) -> &str {
        &self.product.guid
    }

    /// The resource location as most importers spell it.
    pub(crate) fn location(&self) -> String {
        format!("file://{}", self.resources.display())
    }

    /// The value reference of `name`.
    pub(crate) fn reference(&self, name: &str) -> u32 {
        let found = self.product.variables.iter().find(|v| v.name == name);
        found.unwrap_or_else(|| panic!("no variable {name}")).value_reference
    }

    /// The variable of FMI 3.0 called `name`.
    pub(crate) fn item(&self, name: &str) -> &Item {
        let found = self.product.items.iter().find(|item| item.name == name);
        found.unwrap_or_else(|| panic!("no variable {name}"))
    }

    /// The folder of the resources as importers of FMI 3.0 pass it.
    pub(crate) fn path(&self) -> String {
        self.resources.display().to_string()
    }

    /// The configuration of a filter.
    pub(crate) fn filter(&self) -> &FilterConfiguration {
        match &self.product.configuration {
            Configuration::Filter(c) => c,
            Configuration::Plant(_) | Configuration::Controller(_) => panic!("not a filter"),
        }
    }
}
