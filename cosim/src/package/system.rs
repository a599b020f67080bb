//! Turns a system file into an `.ssp` package for other masters: its FMUs, connections and start values in
//! System Structure and Parameterization 1.0 or 2.0. Only 2.0 has arrays, which are connected and set as a
//! whole, and numbers of types other than double and 32-bit integer. Nothing is run; the same files give the
//! same bytes.

use std::collections::BTreeMap;
use std::path::Path;
use std::rc::Rc;

use punctual_modeldescription::{
    Archive, Causality, Connector, DefaultExperiment, EnumerationItem, Integer, Parameter, ParameterSet,
    ParameterValue, Plain, Real, SimpleType, SspVersion, SystemComponent, SystemConnection, SystemStructure,
    VariableKind,
};

use crate::coupling::{self, Link, Order, Port, StartValue, System};
use crate::error::Error;
use crate::host::{Array, DataType, Description, Family, Fmu, Variable};
use crate::text;
use crate::whole;

/// The parameter set with the start values, in the archive.
const START_VALUES: &str = "resources/start_values.ssv";

/// Counts and notes for a package.
#[derive(Clone, Debug)]
pub struct Packed {
    /// Number of components.
    pub components: usize,
    /// Number of FMU files; components can share one.
    pub fmus: usize,
    /// Number of connections, including those by name.
    pub connections: usize,
    /// Number of start values.
    pub start_values: usize,
    /// Warnings on configurations that were built, by file.
    pub warnings: Vec<String>,
    /// Notes on the units of connections.
    pub notes: Vec<String>,
}

/// Packs the system at `path` into `file`, in this version of SSP. The package is for a master of this order; by default for that
/// of the system. It gives each filter that is then a step late the start value of its `actuation_delay`.
///
/// # Errors
///
/// A system file that cannot be used, an FMU that is missing or cannot be used, an array that the version
/// cannot represent, a file that cannot be written.
pub fn pack(path: &Path, file: &Path, version: SspVersion, order: Option<Order>) -> Result<Packed, Error> {
    let system = System::read(path)?;
    let order = order.unwrap_or(system.experiment().order);
    let system = system.ordered(order);
    let base = path.parent().unwrap_or(Path::new(""));
    let name = path.file_stem().map_or_else(|| "system".into(), |stem| stem.to_string_lossy());
    let (archive, packed) = archive(&system, &name, base, version).map_err(|e| e.in_file(path))?;
    let bytes = archive.to_bytes().map_err(|e| super::broken(&e))?;
    whole::write(file, bytes)?;
    Ok(packed)
}

/// An FMU and the bytes of its file.
type Opened = (Rc<Fmu>, Vec<u8>);

/// The FMU at `path`, or the one built from the configuration there, and its bytes; also a warning on the
/// configuration.
fn fmu(path: &Path) -> Result<(Opened, Option<String>), Error> {
    let read = |file: &Path| std::fs::read(file).map_err(|e| Error::io("read", file, e));
    if !text::is_toml(path) {
        return Ok(((Rc::new(Fmu::open(path)?), read(path)?), None));
    }
    let configuration = super::read_configuration(path)?;
    let warning = configuration.warning().map(|warning| format!("{}: {warning}", path.display()));
    let folder = tempfile::tempdir().map_err(|e| Error::io("make a folder in", &std::env::temp_dir(), e))?;
    let file = folder.path().join("made.fmu");
    Ok(((super::build(configuration, &[], &file)?, read(&file)?), warning))
}

/// The FMUs of a system, each file once.
struct Store {
    /// The FMUs, each with its path in the archive and its bytes.
    fmus: Vec<(Rc<Fmu>, String, Vec<u8>)>,
    /// The index of the FMU of each component.
    of_component: Vec<usize>,
    /// Warnings on configurations, by file.
    warnings: Vec<String>,
}

impl Store {
    fn open(system: &System, base: &Path) -> Result<Self, Error> {
        let mut store = Self { fmus: Vec::new(), of_component: Vec::new(), warnings: Vec::new() };
        let mut known = BTreeMap::new();
        for (i, component) in system.components().iter().enumerate() {
            let path = base.join(&component.fmu);
            if let Some(&index) = known.get(&path) {
                store.of_component.push(index);
                continue;
            }
            if !path.is_file() {
                let source = Path::new(&component.fmu).with_extension("toml");
                let advice = if base.join(&source).is_file() {
                    format!("; make it with `punctual build {} -o {}`", source.display(), component.fmu)
                } else {
                    String::new()
                };
                let message = format!("there is no file {}{advice}", path.display());
                return Err(Error::configuration(format!("component[{i}].fmu"), message));
            }
            let ((fmu, bytes), warning) = fmu(&path).map_err(|e| e.in_component(&component.name))?;
            store.warnings.extend(warning);
            let place = store.place(&path);
            known.insert(path, store.fmus.len());
            store.of_component.push(store.fmus.len());
            store.fmus.push((fmu, place, bytes));
        }
        Ok(store)
    }

    /// A unique path in the archive, which is also a valid URI.
    fn place(&self, path: &Path) -> String {
        let stem = path.file_stem().map(|stem| stem.to_string_lossy()).unwrap_or_default();
        let plain = |c: char| if c.is_ascii_alphanumeric() || "._-".contains(c) { c } else { '_' };
        let stem: String = stem.chars().map(plain).collect();
        let mut place = format!("resources/{stem}.fmu");
        let mut number = 1;
        while self.fmus.iter().any(|(_, taken, _)| *taken == place) {
            number += 1;
            place = format!("resources/{stem}-{number}.fmu");
        }
        place
    }

    fn of(&self, component: usize) -> &(Rc<Fmu>, String, Vec<u8>) {
        &self.fmus[self.of_component[component]]
    }
}

fn archive(
    system: &System,
    name: &str,
    base: &Path,
    version: SspVersion,
) -> Result<(Archive, Packed), Error> {
    // Read the FMUs, and resolve the connections.
    let store = Store::open(system, base)?;
    let sized = |(c, component)| coupling::Model::from(Rc::clone(&store.of(c).0)).sized(component);
    let models = system.components().iter().enumerate().map(sized).collect::<Result<Vec<_>, _>>()?;
    let descriptions: Vec<&Description> = models.iter().map(coupling::Model::description).collect();
    let links = coupling::links(system, &descriptions)?;
    refuse_others(system, &descriptions, &links)?;
    if version == SspVersion::One {
        refuse_arrays(system, &descriptions, &links)?;
    }
    let mut parameters = start_values(system, &descriptions, version)?;
    let late = coupling::delays(system, &descriptions, &links);
    for (component, reference, delay) in &late.starts {
        let variables = &descriptions[*component].variables;
        let told = variables.iter().find(|v| v.value_reference == *reference && v.of == DataType::Float64);
        parameters.extend(told.map(|variable| {
            let name = format!("{}.{}", system.components()[*component].name, variable.name);
            Parameter::scalar(name, ParameterValue::Real(*delay))
        }));
    }
    let connections = connections(system, &descriptions, &links)?;
    let starts = &parameters;
    let experiment = system.experiment();
    let mut enumerations = Enumerations::default();
    let components = system.components().iter().zip(&descriptions).enumerate();
    let components = components
        .map(|(c, (component, description))| {
            // An array is represented by its first element; SSP 1.0 has no arrays.
            let shown = |v: &usize| {
                let variable = &description.variables[*v];
                let array = array_of(description, *v);
                if array.is_some_and(|array| version == SspVersion::One || *v != array.first) {
                    return false;
                }
                // An input that is neither connected nor set keeps the start value of its FMU, so it gets no
                // connector. Some masters write zero to every input that has one.
                let name =
                    format!("{}.{}", component.name, array.map_or(&variable.name, |array| &array.name));
                let port = Port { component: c, variable: *v };
                variable.causality != Causality::Input
                    || starts.iter().any(|given| given.name == name)
                    || links.iter().any(|link| link.to == port)
            };
            let connectors = (0..description.variables.len()).filter(shown);
            let connectors = connectors
                .filter_map(|v| connector(&component.name, description, v, version, &mut enumerations));
            SystemComponent {
                name: component.name.clone(),
                source: store.of(c).1.clone(),
                connectors: connectors.collect(),
            }
        })
        .collect();
    // Write the structure.
    let structure = SystemStructure {
        version,
        name: name.to_owned(),
        description: described(system),
        generation_tool: concat!("Punctual ", env!("CARGO_PKG_VERSION")).to_owned(),
        start_values: (!parameters.is_empty()).then(|| START_VALUES.to_owned()),
        components,
        connections,
        enumerations: enumerations.0,
        default_experiment: Some(DefaultExperiment {
            start_time: Some(experiment.start_time),
            stop_time: Some(experiment.stop_time),
            ..DefaultExperiment::default()
        }),
    };
    let packed = Packed {
        components: structure.components.len(),
        fmus: store.fmus.len(),
        connections: structure.connections.len(),
        start_values: parameters.len(),
        warnings: store.warnings.iter().cloned().chain(late.warnings).collect(),
        notes: coupling::unit_notes(system, &descriptions, &links).into_iter().chain(late.notes).collect(),
    };
    // Pack.
    let broken = |e: punctual_modeldescription::Error| super::broken(&e);
    let mut archive = Archive::new().with_timestamp(super::timestamp()?);
    archive.add("SystemStructure.ssd", structure.to_xml().map_err(broken)?).map_err(broken)?;
    if !parameters.is_empty() {
        let set = ParameterSet { version, name: "start_values".to_owned(), parameters };
        archive.add(START_VALUES, set.to_xml().map_err(broken)?).map_err(broken)?;
    }
    for (_, place, bytes) in store.fmus {
        archive.add(&place, bytes).map_err(broken)?;
    }
    Ok((archive, packed))
}

/// How the system is coupled, in words. SSP has no element for it.
fn described(system: &System) -> String {
    let experiment = system.experiment();
    let mut text = format!("coupled with a communication step of {} s", experiment.step);
    if let Some(tolerance) = experiment.tolerance {
        text += &format!(", tolerance {tolerance:e}");
    }
    text + match experiment.order {
        Order::GaussSeidel => "",
        Order::Jacobi => ", by a master that exchanges all values before it steps (Jacobi)",
    }
}

/// The array that a scalar is an element of.
fn array_of(description: &Description, variable: usize) -> Option<&Array> {
    description.arrays.iter().find(|array| (array.first..array.first + array.count).contains(&variable))
}

/// Refuses other connections: SSP connects outputs only to inputs of the same type.
fn refuse_others(system: &System, descriptions: &[&Description], links: &[Link]) -> Result<(), Error> {
    for link in links {
        let variable = |port: Port| &descriptions[port.component].variables[port.variable];
        let (from, to) = (variable(link.from), variable(link.to));
        let name =
            |port: Port| format!("{}.{}", system.components()[port.component].name, variable(port).name);
        let what = if from.causality != Causality::Output {
            format!("{} has causality {}", name(link.from), from.causality.as_str())
        } else if from.family() != to.family() {
            format!("{} is {}, but {} is {}", name(link.from), from.type_name, name(link.to), to.type_name)
        } else {
            continue;
        };
        let message = format!(
            "{what}; an .ssp file connects outputs to inputs of the same type only, though `punctual run` couples them"
        );
        return Err(Error::configuration("connection", message));
    }
    Ok(())
}

/// Refuses arrays that are connected or set: SSP 1.0 has none.
fn refuse_arrays(system: &System, descriptions: &[&Description], links: &[Link]) -> Result<(), Error> {
    for (c, (component, description)) in system.components().iter().zip(descriptions).enumerate() {
        let given: Vec<usize> =
            component.start.keys().filter_map(|name| first_of(description, name)).collect();
        let used = |v: usize| {
            let port = Port { component: c, variable: v };
            links.iter().any(|link| link.from == port || link.to == port) || given.contains(&v)
        };
        let elements = |array: &Array| array.first..array.first + array.count;
        if let Some(array) = description.arrays.iter().find(|array| elements(array).any(used)) {
            let message = format!(
                "{} of {} ({}) is an array, for which SSP 1.0 has no place; `--ssp 2` has, and `punctual run` couples it",
                array.name, component.name, component.fmu
            );
            return Err(Error::configuration(format!("component[{c}]"), message));
        }
    }
    Ok(())
}

/// The connections, with arrays as a whole.
///
/// # Errors
///
/// An array that is connected only in part, or whose elements are connected in another order. SSP 2.0 has
/// indices for that (`startIndices`), which are not written.
fn connections(
    system: &System,
    descriptions: &[&Description],
    links: &[Link],
) -> Result<Vec<SystemConnection>, Error> {
    let array = |port: Port| array_of(descriptions[port.component], port.variable);
    let end = |port: Port| {
        let variable = &descriptions[port.component].variables[port.variable];
        let name = array(port).map_or(&variable.name, |array| &array.name);
        (system.components()[port.component].name.clone(), name.clone())
    };
    let mut connections = Vec::new();
    for link in links {
        let is_first = match (array(link.from), array(link.to)) {
            (None, None) => true,
            (Some(from), Some(to)) if from.sizes == to.sizes => {
                let is_alike = |i: usize| {
                    links.iter().any(|other| {
                        other.from == Port { component: link.from.component, variable: from.first + i }
                            && other.to == Port { component: link.to.component, variable: to.first + i }
                            && (other.factor, other.offset) == (link.factor, link.offset)
                    })
                };
                if !(0..to.count).all(is_alike) {
                    return Err(in_parts(&end(link.from), &end(link.to)));
                }
                link.to.variable == to.first
            }
            _ => return Err(in_parts(&end(link.from), &end(link.to))),
        };
        if is_first {
            let (start, end) = (end(link.from), end(link.to));
            connections.push(SystemConnection { start, end, factor: link.factor, offset: link.offset });
        }
    }
    Ok(connections)
}

fn in_parts(from: &(String, String), to: &(String, String)) -> Error {
    let message = format!(
        "{}.{} and {}.{} are connected in parts; in an .ssp file arrays of the same sizes are connected as a whole",
        from.0, from.1, to.0, to.1
    );
    Error::configuration("connect", message)
}

/// The enumerations of all components, each once. If two share a name but not the items, the later one gets
/// its component's name as well.
#[derive(Default)]
struct Enumerations(Vec<SimpleType>);

impl Enumerations {
    /// Declares the type of a variable, which has these items.
    fn declare(&mut self, component: &str, variable: &Variable, items: Vec<EnumerationItem>) -> String {
        let mut name = variable.declared_type.as_deref().unwrap_or(&variable.name).to_owned();
        while let Some(other) = self.0.iter().find(|e| e.name == name) {
            if other.items == items {
                return name;
            }
            name = format!("{component}.{name}");
        }
        self.0.push(SimpleType::enumeration(&name, "", items));
        name
    }
}

/// The connector of a variable, or of the array whose first element it is, if possible.
fn connector(
    component: &str,
    description: &Description,
    variable: usize,
    version: SspVersion,
    enumerations: &mut Enumerations,
) -> Option<Connector> {
    use Causality::{CalculatedParameter, Input, Output, Parameter};
    let array = array_of(description, variable);
    let variable = &description.variables[variable];
    if !matches!(variable.causality, Input | Output | Parameter | CalculatedParameter) {
        return None;
    }
    let kind = match variable.family() {
        Family::Real => VariableKind::Real(Real::default()),
        Family::Integer => VariableKind::Integer(Integer::default()),
        Family::Boolean => VariableKind::Boolean(Plain::default()),
        Family::Enumeration => match items(variable) {
            Some(items) => VariableKind::enumeration(enumerations.declare(component, variable, items)),
            None => VariableKind::Integer(Integer::default()),
        },
        Family::Other if variable.of == DataType::String => VariableKind::String(Plain::default()),
        Family::Other => return None,
    };
    let name = array.map_or(&variable.name, |array| &array.name).clone();
    let sizes = array.map(|array| array.sizes.as_slice()).unwrap_or_default();
    let dimensions = sizes.iter().filter_map(|&size| u64::try_from(size).ok()).collect();
    let number = match kind {
        VariableKind::Real(_) | VariableKind::Integer(_) => number(variable, version),
        _ => None,
    };
    Some(Connector { name, causality: variable.causality, kind, number, dimensions })
}

/// The type of a number if neither Real nor Integer represents it and the version has the type. An
/// enumeration whose items the format cannot represent keeps its type of FMI 3.0.
fn number(variable: &Variable, version: SspVersion) -> Option<DataType> {
    match (version, variable.of) {
        (SspVersion::One, _) | (_, DataType::Float64 | DataType::Int32) => None,
        (SspVersion::Two, DataType::Enumeration) => Some(DataType::Int64),
        (SspVersion::Two, of) => Some(of),
    }
}

/// The items of an enumeration, if the format can represent all of them. Their descriptions are lost.
fn items(variable: &Variable) -> Option<Vec<EnumerationItem>> {
    let item = |(name, value): &(String, i64)| {
        let value = i32::try_from(*value).ok()?;
        Some(EnumerationItem { name: name.clone(), value, description: String::new() })
    };
    let items: Option<Vec<_>> = variable.items.iter().map(item).collect();
    items.filter(|items| !items.is_empty())
}

/// The position of the variable, or of the first element of the array, with this name.
fn first_of(description: &Description, name: &str) -> Option<usize> {
    description.index_of(name).or_else(|| Some(description.array(name)?.first))
}

/// The start values by `component.variable`; `coupling` has checked names, types and ranges.
///
/// # Errors
///
/// A whole number that the version cannot represent, a single element of an array, an array of texts or
/// enumerations.
fn start_values(
    system: &System,
    descriptions: &[&Description],
    version: SspVersion,
) -> Result<Vec<Parameter>, Error> {
    let mut values = Vec::new();
    for (c, (component, description)) in system.components().iter().zip(descriptions).enumerate() {
        for (name, value) in &component.start {
            let Some(first) = first_of(description, name) else { continue };
            let refused =
                |message: String| Error::configuration(format!("component[{c}].start.{name:?}"), message);
            let mut of_name = Vec::new();
            for (variable, value) in description.variables[first..].iter().zip(value.flat()) {
                let value = parameter(variable, value, version);
                of_name.push(value.ok_or_else(|| {
                    refused(
                        "is a whole number beyond 32 bits, for which SSP 1.0 has no place; `--ssp 2` has"
                            .to_owned(),
                    )
                })?);
            }
            let named = |name: &str| format!("{}.{name}", component.name);
            let is_number =
                of_name.iter().all(|v| matches!(v, ParameterValue::Real(_) | ParameterValue::Integer(_)));
            let number = if is_number { number(&description.variables[first], version) } else { None };
            match array_of(description, first) {
                Some(array) if array.count == of_name.len() => {
                    let value = list(&of_name).ok_or_else(|| {
                        refused("is an array of neither numbers nor truth values, which has no start value in SSP".to_owned())
                    })?;
                    let dimensions =
                        array.sizes.iter().filter_map(|&size| u64::try_from(size).ok()).collect();
                    values.push(Parameter { name: named(&array.name), number, value, dimensions });
                }
                Some(array) => {
                    let message =
                        format!("is an element of {}; in SSP an array is given as a whole", array.name);
                    return Err(refused(message));
                }
                None => values.extend(of_name.into_iter().map(|value| Parameter {
                    number,
                    ..Parameter::scalar(named(&description.variables[first].name), value)
                })),
            }
        }
    }
    Ok(values)
}

/// The value of an array of numbers or Booleans.
fn list(values: &[ParameterValue]) -> Option<ParameterValue> {
    use ParameterValue::{Boolean, Booleans, Integer, Integers, Real, Reals};
    let reals = values.iter().map(|value| if let Real(x) = value { Some(*x) } else { None });
    let integers = values.iter().map(|value| if let Integer(i) = value { Some(*i) } else { None });
    let booleans = values.iter().map(|value| if let Boolean(b) = value { Some(*b) } else { None });
    (reals.collect::<Option<_>>().map(Reals))
        .or_else(|| integers.collect::<Option<_>>().map(Integers))
        .or_else(|| booleans.collect::<Option<_>>().map(Booleans))
}

/// The value of a variable in the format; `None` if it cannot represent it.
fn parameter(variable: &Variable, value: &StartValue, version: SspVersion) -> Option<ParameterValue> {
    Some(match value {
        StartValue::Real(x) => ParameterValue::Real(*x),
        StartValue::Boolean(b) => ParameterValue::Boolean(*b),
        StartValue::Text(text) => ParameterValue::String(text.clone()),
        StartValue::Integer(i) if variable.family() == Family::Real => ParameterValue::Real(*i as f64),
        StartValue::Integer(i) => match variable.items.iter().find(|(_, item)| item == i) {
            Some((name, _)) if items(variable).is_some() => ParameterValue::Enumeration(name.clone()),
            // Only SSP 2.0 has a type for a UInt32.
            _ if version == SspVersion::One && i32::try_from(*i).is_err() => return None,
            _ => ParameterValue::Integer(*i),
        },
        StartValue::List(_) => return None,
    })
}
