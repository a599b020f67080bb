//! From a path or dict to the configuration of a filter and the names of its signals.

use std::fmt::Display;
use std::path::PathBuf;

use punctual_fmu::PluginFolder;
use punctual_fmu::configuration::{
    Configuration, ConfigurationError, FilterConfiguration, PlantConfiguration, VariableSection,
};
use pyo3::prelude::*;
use pyo3::types::PyDict;

pyo3::import_exception!(punctual._error, Error);

/// Warns, once for each filter that is made, of what its configuration has lost.
pub(crate) fn warn(py: Python<'_>, configuration: &FilterConfiguration) -> PyResult<()> {
    match configuration.warning() {
        Some(warning) => py.import("punctual._command")?.call_method1("warn", (warning,)).map(|_| ()),
        None => Ok(()),
    }
}

/// Makes `punctual.Error` of the words of `error`.
pub(crate) fn refused(error: &dyn Display) -> PyErr {
    Error::new_err(error.to_string())
}

/// Reads and completes the configuration of a filter: the path of a TOML file, or a dict with the same content. A
/// plug-in is loaded from the folder of the file, for a dict from the current folder.
pub(crate) fn configuration(argument: &Bound<'_, PyAny>) -> PyResult<FilterConfiguration> {
    let helper = argument.py().import("punctual._configuration")?;
    let (text, folder, file): (String, PathBuf, String) =
        helper.call_method1("text_folder_file", (argument,))?.extract()?;
    parse(&text, folder, &file).or_else(|error| {
        let reason = error.value(argument.py()).str()?;
        let reported =
            argument.py().import("punctual._trace")?.call_method1("with_function", (reason, argument))?;
        Err(refused(&reported))
    })
}

/// Reads and completes the TOML text of a filter, whose plug-in is in `folder`; errors begin with the name of the `file`,
/// if it has one.
pub(crate) fn parse(text: &str, folder: PathBuf, file: &str) -> PyResult<FilterConfiguration> {
    let refused = |error: ConfigurationError| match file {
        "" => refused(&error),
        file => refused(&format!("{file}: {error}")),
    };
    match Configuration::parse_with(text, &PluginFolder::new(folder)).map_err(refused)? {
        Configuration::Filter(filter) => Ok(filter),
        other => {
            let message = format!("is {:?}, must be \"filter\"", other.kind());
            Err(refused(ConfigurationError::new("kind", message)))
        }
    }
}

/// The names of the states and of the inputs of the vehicle called `model`, in order.
#[pyfunction]
pub(crate) fn vehicle(model: &str) -> PyResult<(Vec<String>, Vec<String>)> {
    let text = format!("kind = \"plant\"\nplant.model = {model:?}\n");
    match Configuration::parse(&text).map_err(|error| refused(&error))? {
        Configuration::Plant(PlantConfiguration { plant, .. }) => {
            let names = |variables: Vec<VariableSection>| variables.into_iter().map(|v| v.name).collect();
            Ok((names(plant.states()), names(plant.inputs())))
        }
        other => Err(refused(&format!("kind: is {:?}, must be \"plant\"", other.kind()))),
    }
}

/// Signals, each a name with its unit, in order.
pub(crate) struct Signals {
    /// The names.
    pub(crate) names: Vec<String>,
    units: Vec<String>,
}

impl Signals {
    pub(crate) fn new(signals: impl Iterator<Item = (String, String)>) -> Self {
        let (names, units) = signals.unzip();
        Self { names, units }
    }

    /// Those of a configuration.
    pub(crate) fn of(variables: Vec<VariableSection>) -> Self {
        Self::new(variables.into_iter().map(|variable| (variable.name, variable.unit)))
    }

    /// Number of signals.
    pub(crate) fn len(&self) -> usize {
        self.names.len()
    }

    /// Name to unit, in order.
    pub(crate) fn dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let dict = PyDict::new(py);
        for (name, unit) in self.names.iter().zip(&self.units) {
            dict.set_item(name, unit)?;
        }
        Ok(dict)
    }
}

/// The bounds of the inputs called `names`, in order: name to the least and the largest value. What has none is left out.
pub(crate) fn bounds<'py>(
    py: Python<'py>,
    configuration: &FilterConfiguration,
    names: &[String],
) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    for name in names {
        if let Some([low, high]) = configuration.bounds.get(name) {
            dict.set_item(name, (low, high))?;
        }
    }
    Ok(dict)
}

/// Inputs and outputs of a filter.
pub(crate) struct Interface {
    /// Measured inputs: the states of the plant but an integrated one, then the inputs of the barriers.
    pub(crate) states: Signals,
    /// Outputs: the inputs of the plant, an integrated state in the place of its rate.
    pub(crate) inputs: Signals,
    /// The barriers, each with the unit of h.
    pub(crate) barriers: Signals,
}

impl Interface {
    /// The interface of a filter with this configuration.
    pub(crate) fn of(configuration: &FilterConfiguration) -> Self {
        let measured = configuration.measured_states().into_iter().map(|s| (s.name, s.unit));
        let handed = configuration.barrier_inputs().into_iter().map(|s| (s.name, s.unit));
        let barriers = configuration.barrier.iter().map(|b| (b.name.clone(), b.unit(&configuration.plant)));
        Self {
            states: Signals::new(measured.chain(handed)),
            inputs: Signals::of(configuration.commanded()),
            barriers: Signals::new(barriers),
        }
    }
}
