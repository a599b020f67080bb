//! System Structure and Parameterization 1.0 and 2.0. Components, their connectors and connections go to
//! `SystemStructure.ssd`, start values to an `.ssv` parameter set. Both versions have the same namespaces;
//! 2.0 has arrays and the number types of FMI 3.0.

use crate::fmi3::DataType;
use crate::names::forbidden_character;
use crate::words::words;
use crate::xml::{container, text};
use crate::xsd::Number;
use crate::{Causality, DefaultExperiment, Error, SimpleType, VariableKind};
use serde::{Serialize, Serializer};

const SSD: &str = "http://ssp-standard.org/SSP1/SystemStructureDescription";
const SSC: &str = "http://ssp-standard.org/SSP1/SystemStructureCommon";
const SSV: &str = "http://ssp-standard.org/SSP1/SystemStructureParameterValues";

/// A version of SSP.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum SspVersion {
    /// 1.0: scalars, with numbers that are doubles or 32-bit integers.
    #[default]
    One,
    /// 2.0: also arrays, and all number types of FMI 3.0.
    Two,
}

words!(SspVersion: One "1.0", Two "2.0");

/// A coupled system, as the file `SystemStructure.ssd` at the root of an `.ssp` archive.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SystemStructure {
    /// The version to write.
    pub version: SspVersion,
    /// The name of the system; not empty.
    pub name: String,
    /// Its meaning, as a text for the reader; if empty, the attribute is omitted.
    pub description: String,
    /// The tool that writes it; if empty, the attribute is omitted.
    pub generation_tool: String,
    /// The path in the archive of the parameter set with the start values, if there is one. Names in it are
    /// `component.variable`.
    pub start_values: Option<String>,
    /// The components.
    pub components: Vec<SystemComponent>,
    /// The connections.
    pub connections: Vec<SystemConnection>,
    /// The enumerations that connectors refer to.
    pub enumerations: Vec<SimpleType>,
    /// Start time (0 if omitted) and stop time. The format has no step size.
    pub default_experiment: Option<DefaultExperiment>,
}

/// An FMU in a system.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SystemComponent {
    /// Its name, unique in the system; not empty.
    pub name: String,
    /// The path of its FMU in the archive; a relative URI.
    pub source: String,
    /// The variables that are visible from outside.
    pub connectors: Vec<Connector>,
}

/// A variable of a component that can be connected or given a value.
#[derive(Clone, Debug, PartialEq)]
pub struct Connector {
    /// The name of the variable.
    pub name: String,
    /// Input, output, parameter or calculated parameter; others cannot be connectors.
    pub causality: Causality,
    /// Its type. An enumeration declares one of the system's enumerations by name. Start value, range and
    /// unit are not written.
    pub kind: VariableKind,
    /// The number type of FMI 3.0, if it is neither Real (a Float64) nor Integer (an Int32). Only in SSP 2.0.
    pub number: Option<DataType>,
    /// The sizes of an array, each at least 1; empty for a scalar. Only in SSP 2.0.
    pub dimensions: Vec<u64>,
}

/// A signal from an output to an input: `end = factor · start + offset`, without unit conversion.
#[derive(Clone, Debug, PartialEq)]
pub struct SystemConnection {
    /// Component and variable of the output.
    pub start: (String, String),
    /// Component and variable of the input.
    pub end: (String, String),
    /// Units of the input per unit of the output; finite.
    pub factor: f64,
    /// In the unit of the input; finite.
    pub offset: f64,
}

/// Values by name, as an `.ssv` file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ParameterSet {
    /// The version to write.
    pub version: SspVersion,
    /// The name of the set; not empty.
    pub name: String,
    /// The values.
    pub parameters: Vec<Parameter>,
}

/// A named value of a [`ParameterSet`].
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// Its name, unique in the set.
    pub name: String,
    /// Its value.
    pub value: ParameterValue,
    /// The type of a number, as in [`Connector::number`].
    pub number: Option<DataType>,
    /// The sizes of an array, each at least 1; empty for a scalar. Only in SSP 2.0.
    pub dimensions: Vec<u64>,
}

impl Parameter {
    /// A scalar; a number is a double or a 32-bit integer.
    pub fn scalar(name: impl Into<String>, value: ParameterValue) -> Self {
        Self { name: name.into(), value, number: None, dimensions: Vec::new() }
    }
}

/// A value of a [`Parameter`]. Lists hold arrays, row by row.
#[derive(Clone, Debug, PartialEq)]
pub enum ParameterValue {
    /// A finite double, in the unit of the variable.
    Real(f64),
    /// An integer, within the limits of its type.
    Integer(i64),
    /// A Boolean.
    Boolean(bool),
    /// A text.
    String(String),
    /// The name of an item of an enumeration.
    Enumeration(String),
    /// Finite doubles.
    Reals(Vec<f64>),
    /// Integers, each within the limits of its type.
    Integers(Vec<i64>),
    /// Booleans.
    Booleans(Vec<bool>),
}

impl ParameterValue {
    /// The number of elements, if it is a list.
    fn len(&self) -> Option<usize> {
        match self {
            Self::Reals(list) => Some(list.len()),
            Self::Integers(list) => Some(list.len()),
            Self::Booleans(list) => Some(list.len()),
            _ => None,
        }
    }

    /// The integers in it.
    fn integers(&self) -> &[i64] {
        match self {
            Self::Integer(value) => std::slice::from_ref(value),
            Self::Integers(list) => list,
            _ => &[],
        }
    }
}

impl SystemStructure {
    /// The content of `SystemStructure.ssd`: UTF-8 without byte order mark.
    ///
    /// # Errors
    ///
    /// Names that are empty, duplicated or have characters that XML cannot represent; a connection from or to
    /// a connector that does not exist or is not an output or input; a factor that is not finite; a connector
    /// of another causality; an undeclared enumeration.
    pub fn to_xml(&self) -> Result<String, Error> {
        self.validate()?;
        text(&SsdRoot::new(self))
    }

    fn validate(&self) -> Result<(), Error> {
        named("name", &self.name)?;
        for (i, component) in self.components.iter().enumerate() {
            let path = format!("components[{i}].name");
            named(&path, &component.name)?;
            if self.components[..i].iter().any(|other| other.name == component.name) {
                return Err(Error::invalid(path, format!("{:?}", component.name), "a name used once"));
            }
            for connector in &component.connectors {
                let path = || format!("components[{i}].connectors[{:?}]", connector.name);
                named(&path(), &connector.name)?;
                if kind(connector.causality).is_none() {
                    let allowed = "input, output, parameter or calculatedParameter";
                    return Err(Error::invalid(path(), connector.causality.as_str(), allowed));
                }
                sized(&path(), self.version, &connector.dimensions)?;
                let is_float = match connector.kind {
                    VariableKind::Real(_) => Some(true),
                    VariableKind::Integer(_) => Some(false),
                    _ => None,
                };
                typed(&path(), self.version, connector.number, is_float)?;
                if let VariableKind::Enumeration(of) = &connector.kind
                    && !self.enumerations.iter().any(|e| Some(&e.name) == of.declared_type.as_ref())
                {
                    let value = format!("{:?}", of.declared_type.as_deref().unwrap_or_default());
                    return Err(Error::invalid(path(), value, "an enumeration of the system"));
                }
            }
        }
        for (i, connection) in self.connections.iter().enumerate() {
            for (side, (component, variable), causality) in
                [("start", &connection.start, Causality::Output), ("end", &connection.end, Causality::Input)]
            {
                let mut connectors =
                    self.components.iter().filter(|c| c.name == *component).flat_map(|c| &c.connectors);
                if !connectors.any(|c| c.name == *variable && c.causality == causality) {
                    let value = format!("{component}.{variable}");
                    let allowed = format!("a connector that is an {}", causality.as_str());
                    return Err(Error::invalid(format!("connections[{i}].{side}"), value, allowed));
                }
            }
            for (field, value) in [("factor", connection.factor), ("offset", connection.offset)] {
                finite(&format!("connections[{i}].{field}"), value)?;
            }
        }
        Ok(())
    }
}

impl ParameterSet {
    /// The content of the `.ssv` file: UTF-8 without byte order mark.
    ///
    /// # Errors
    ///
    /// Names that are empty, duplicated or have characters that XML cannot represent; a number that is not
    /// finite.
    pub fn to_xml(&self) -> Result<String, Error> {
        named("name", &self.name)?;
        for (i, parameter) in self.parameters.iter().enumerate() {
            let Parameter { name, value, number, dimensions } = parameter;
            let path = format!("parameters[{name:?}]");
            named(&path, name)?;
            if self.parameters[..i].iter().any(|other| other.name == *name) {
                return Err(Error::invalid(path, format!("{name:?}"), "a name used once"));
            }
            sized(&path, self.version, dimensions)?;
            let elements = dimensions.iter().try_fold(1, |count: u64, size| count.checked_mul(*size));
            let wanted = if dimensions.is_empty() { None } else { elements };
            let found = value.len().map(|count| count as u64);
            if found != wanted || (elements.is_none() && !dimensions.is_empty()) {
                let found =
                    found.map_or_else(|| "one value".to_owned(), |count| format!("a list of {count}"));
                return Err(Error::invalid(path, found, "as many values as the dimensions say"));
            }
            let is_float = match value {
                ParameterValue::Real(_) | ParameterValue::Reals(_) => Some(true),
                ParameterValue::Integer(_) | ParameterValue::Integers(_) => Some(false),
                _ => None,
            };
            typed(&path, self.version, *number, is_float)?;
            let (least, greatest) = number.unwrap_or(DataType::Int32).limits().unwrap_or_default();
            let beyond = |value: &&i64| !(least..=greatest).contains(&i128::from(**value));
            if let Some(value) = value.integers().iter().find(beyond) {
                return Err(Error::invalid(path, value, format!("{least} to {greatest}")));
            }
            match value {
                ParameterValue::Real(value) => finite(&path, *value)?,
                ParameterValue::Reals(list) => list.iter().try_for_each(|value| finite(&path, *value))?,
                ParameterValue::Enumeration(item) => named(&path, item)?,
                ParameterValue::String(text) => carried(&path, text)?,
                _ => {}
            }
        }
        text(&SsvRoot {
            ssv: SSV,
            ssc: SSC,
            version: self.version.as_str(),
            name: &self.name,
            parameters: Parameters {
                parameters: self.parameters.iter().map(ParameterElement::new).collect(),
            },
        })
    }
}

fn named(path: &str, name: &str) -> Result<(), Error> {
    if name.is_empty() || forbidden_character(name).is_some() {
        return Err(Error::invalid(path, format!("{name:?}"), "a non-empty text that XML can carry"));
    }
    Ok(())
}

fn carried(path: &str, text: &str) -> Result<(), Error> {
    if forbidden_character(text).is_some() {
        return Err(Error::invalid(path, format!("{text:?}"), "a text that XML can carry"));
    }
    Ok(())
}

fn finite(path: &str, value: f64) -> Result<(), Error> {
    if value.is_finite() { Ok(()) } else { Err(Error::invalid(path, value, "a finite number")) }
}

/// The sizes of an array.
fn sized(path: &str, version: SspVersion, sizes: &[u64]) -> Result<(), Error> {
    match sizes.iter().find(|size| version == SspVersion::One || **size == 0) {
        Some(size) => {
            let allowed = "none in SSP 1.0, at least 1 in SSP 2.0";
            Err(Error::invalid(format!("{path}.dimensions"), size, allowed))
        }
        None => Ok(()),
    }
}

/// The type of a number: a float, an integer or neither.
fn typed(
    path: &str,
    version: SspVersion,
    number: Option<DataType>,
    is_float: Option<bool>,
) -> Result<(), Error> {
    let Some(number) = number else { return Ok(()) };
    let is_such = match is_float {
        Some(true) => number.is_float(),
        Some(false) => number.limits().is_some() && number != DataType::Enumeration,
        None => false,
    };
    if version == SspVersion::One || !is_such {
        let allowed = "none in SSP 1.0, in SSP 2.0 a float of a Real, an integer of an Integer";
        return Err(Error::invalid(format!("{path}.number"), number.as_str(), allowed));
    }
    Ok(())
}

/// The kind of a connector, for the causalities that have one.
fn kind(causality: Causality) -> Option<&'static str> {
    match causality {
        Causality::Input | Causality::Output | Causality::Parameter | Causality::CalculatedParameter => {
            Some(causality.as_str())
        }
        _ => None,
    }
}

/// The element of a type in both files. Elements without content have no attributes at all.
#[derive(Serialize)]
struct Empty {}

#[derive(Serialize)]
#[serde(rename = "ssd:SystemStructureDescription")]
struct SsdRoot<'a> {
    #[serde(rename = "@xmlns:ssd")]
    ssd: &'static str,
    #[serde(rename = "@xmlns:ssc")]
    ssc: &'static str,
    #[serde(rename = "@version")]
    version: &'static str,
    #[serde(rename = "@name")]
    name: &'a str,
    #[serde(rename = "@description", skip_serializing_if = "str::is_empty")]
    description: &'a str,
    #[serde(rename = "@generationTool", skip_serializing_if = "str::is_empty")]
    generation_tool: &'a str,
    #[serde(rename = "ssd:System")]
    system: SystemElement<'a>,
    #[serde(rename = "ssd:Enumerations", skip_serializing_if = "Option::is_none")]
    enumerations: Option<Enumerations<'a>>,
    #[serde(rename = "ssd:DefaultExperiment", skip_serializing_if = "Option::is_none")]
    default_experiment: Option<Experiment>,
}

#[derive(Serialize)]
struct SystemElement<'a> {
    #[serde(rename = "@name")]
    name: &'a str,
    #[serde(rename = "ssd:ParameterBindings", skip_serializing_if = "Option::is_none")]
    bindings: Option<Bindings<'a>>,
    #[serde(rename = "ssd:Elements", skip_serializing_if = "Option::is_none")]
    elements: Option<Elements<'a>>,
    #[serde(rename = "ssd:Connections", skip_serializing_if = "Option::is_none")]
    connections: Option<Connections<'a>>,
}

#[derive(Serialize)]
struct Bindings<'a> {
    #[serde(rename = "ssd:ParameterBinding")]
    binding: Binding<'a>,
}

#[derive(Serialize)]
struct Binding<'a> {
    #[serde(rename = "@type")]
    kind: &'static str,
    #[serde(rename = "@source")]
    source: &'a str,
}

#[derive(Serialize)]
struct Elements<'a> {
    #[serde(rename = "ssd:Component")]
    components: Vec<ComponentElement<'a>>,
}

#[derive(Serialize)]
struct ComponentElement<'a> {
    #[serde(rename = "@name")]
    name: &'a str,
    #[serde(rename = "@type")]
    kind: &'static str,
    #[serde(rename = "@source")]
    source: &'a str,
    #[serde(rename = "@implementation")]
    implementation: &'static str,
    #[serde(rename = "ssd:Connectors", skip_serializing_if = "Option::is_none")]
    connectors: Option<Connectors<'a>>,
}

#[derive(Serialize)]
struct Connectors<'a> {
    #[serde(rename = "ssd:Connector")]
    connectors: Vec<ConnectorElement<'a>>,
}

#[derive(Serialize)]
struct ConnectorElement<'a> {
    #[serde(rename = "@name")]
    name: &'a str,
    #[serde(rename = "@kind")]
    kind: &'static str,
    #[serde(rename = "$value")]
    content: Vec<TypeElement<'a>>,
}

/// The type of a connector, or following it the size of a dimension.
enum TypeElement<'a> {
    Plain(&'static str),
    Enumeration(Named<'a>),
    Dimension(Size),
}

impl Serialize for TypeElement<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Plain(tag) => element(serializer, tag, &Empty {}),
            Self::Enumeration(named) => element(serializer, TYPES.enumeration, named),
            Self::Dimension(size) => element(serializer, DIMENSION, size),
        }
    }
}

/// An element of this name.
fn element<S: Serializer>(
    serializer: S,
    tag: &'static str,
    content: &impl Serialize,
) -> Result<S::Ok, S::Error> {
    serializer.serialize_newtype_variant("Element", 0, tag, content)
}

/// The size of one dimension, in both files.
const DIMENSION: &str = "ssc:Dimension";

#[derive(Serialize)]
struct Size {
    #[serde(rename = "@size")]
    size: u64,
}

#[derive(Serialize)]
struct Named<'a> {
    #[serde(rename = "@name")]
    name: &'a str,
}

#[derive(Serialize)]
struct Connections<'a> {
    #[serde(rename = "ssd:Connection")]
    connections: Vec<ConnectionElement<'a>>,
}

#[derive(Serialize)]
struct ConnectionElement<'a> {
    #[serde(rename = "@startElement")]
    start_element: &'a str,
    #[serde(rename = "@startConnector")]
    start_connector: &'a str,
    #[serde(rename = "@endElement")]
    end_element: &'a str,
    #[serde(rename = "@endConnector")]
    end_connector: &'a str,
    #[serde(rename = "@suppressUnitConversion")]
    suppress_unit_conversion: bool,
    #[serde(rename = "ssc:LinearTransformation", skip_serializing_if = "Option::is_none")]
    transformation: Option<LinearTransformation>,
}

#[derive(Serialize)]
struct LinearTransformation {
    #[serde(rename = "@factor")]
    factor: Number,
    #[serde(rename = "@offset")]
    offset: Number,
}

#[derive(Serialize)]
struct Enumerations<'a> {
    #[serde(rename = "ssc:Enumeration")]
    enumerations: Vec<EnumerationElement<'a>>,
}

#[derive(Serialize)]
struct EnumerationElement<'a> {
    #[serde(rename = "@name")]
    name: &'a str,
    #[serde(rename = "ssc:Item")]
    items: Vec<ItemElement<'a>>,
}

// Differs from the model's own item, since the format has no description for it.
#[derive(Serialize)]
struct ItemElement<'a> {
    #[serde(rename = "@name")]
    name: &'a str,
    #[serde(rename = "@value")]
    value: i32,
}

#[derive(Serialize)]
struct Experiment {
    #[serde(rename = "@startTime")]
    start_time: Number,
    #[serde(rename = "@stopTime", skip_serializing_if = "Option::is_none")]
    stop_time: Option<Number>,
}

#[derive(Serialize)]
#[serde(rename = "ssv:ParameterSet")]
struct SsvRoot<'a> {
    #[serde(rename = "@xmlns:ssv")]
    ssv: &'static str,
    #[serde(rename = "@xmlns:ssc")]
    ssc: &'static str,
    #[serde(rename = "@version")]
    version: &'static str,
    #[serde(rename = "@name")]
    name: &'a str,
    #[serde(rename = "ssv:Parameters")]
    parameters: Parameters<'a>,
}

#[derive(Serialize)]
struct Parameters<'a> {
    #[serde(rename = "ssv:Parameter")]
    parameters: Vec<ParameterElement<'a>>,
}

#[derive(Serialize)]
struct ParameterElement<'a> {
    #[serde(rename = "@name")]
    name: &'a str,
    #[serde(rename = "$value")]
    content: Vec<ValueElement<'a>>,
}

/// The value of a parameter, or following it the size of a dimension.
enum ValueElement<'a> {
    Value(&'static str, &'a ParameterValue),
    Dimension(Size),
}

impl Serialize for ValueElement<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let (tag, value) = match self {
            Self::Value(tag, value) => (*tag, *value),
            Self::Dimension(size) => return element(serializer, DIMENSION, size),
        };
        match value {
            ParameterValue::Real(x) => element(serializer, tag, &Valued { value: Number(*x) }),
            ParameterValue::Integer(value) => element(serializer, tag, &Valued { value }),
            ParameterValue::Boolean(value) => element(serializer, tag, &Valued { value }),
            ParameterValue::String(value) | ParameterValue::Enumeration(value) => {
                element(serializer, tag, &Valued { value })
            }
            ParameterValue::Reals(list) => {
                let value: Vec<_> = list.iter().map(|x| Number(*x)).collect();
                element(serializer, tag, &Valued { value })
            }
            ParameterValue::Integers(value) => element(serializer, tag, &Valued { value }),
            ParameterValue::Booleans(value) => element(serializer, tag, &Valued { value }),
        }
    }
}

#[derive(Serialize)]
struct Valued<T> {
    #[serde(rename = "@value")]
    value: T,
}

impl<'a> ParameterElement<'a> {
    fn new(parameter: &'a Parameter) -> Self {
        let tags = &VALUES;
        let tag = match &parameter.value {
            ParameterValue::Real(_) | ParameterValue::Reals(_) => tags.number(parameter.number, tags.real),
            ParameterValue::Integer(_) | ParameterValue::Integers(_) => {
                tags.number(parameter.number, tags.integer)
            }
            ParameterValue::Boolean(_) | ParameterValue::Booleans(_) => tags.boolean,
            ParameterValue::String(_) => tags.string,
            ParameterValue::Enumeration(_) => tags.enumeration,
        };
        let sizes = parameter.dimensions.iter().map(|&size| ValueElement::Dimension(Size { size }));
        let value = ValueElement::Value(tag, &parameter.value);
        Self { name: &parameter.name, content: std::iter::once(value).chain(sizes).collect() }
    }
}

/// The names of the elements of types in a file.
struct Tags {
    real: &'static str,
    integer: &'static str,
    boolean: &'static str,
    string: &'static str,
    enumeration: &'static str,
    /// The number types of FMI 3.0.
    numbers: [(DataType, &'static str); 10],
}

macro_rules! tags {
    ($prefix:literal) => {
        Tags {
            real: concat!($prefix, ":Real"),
            integer: concat!($prefix, ":Integer"),
            boolean: concat!($prefix, ":Boolean"),
            string: concat!($prefix, ":String"),
            enumeration: concat!($prefix, ":Enumeration"),
            numbers: [
                (DataType::Float64, concat!($prefix, ":Float64")),
                (DataType::Float32, concat!($prefix, ":Float32")),
                (DataType::Int8, concat!($prefix, ":Int8")),
                (DataType::UInt8, concat!($prefix, ":UInt8")),
                (DataType::Int16, concat!($prefix, ":Int16")),
                (DataType::UInt16, concat!($prefix, ":UInt16")),
                (DataType::Int32, concat!($prefix, ":Int32")),
                (DataType::UInt32, concat!($prefix, ":UInt32")),
                (DataType::Int64, concat!($prefix, ":Int64")),
                (DataType::UInt64, concat!($prefix, ":UInt64")),
            ],
        }
    };
}

/// The elements for connectors.
const TYPES: Tags = tags!("ssc");
/// The elements for values.
const VALUES: Tags = tags!("ssv");

impl Tags {
    /// The element of this number type, or the plain one if there is none.
    fn number(&self, of: Option<DataType>, plain: &'static str) -> &'static str {
        let found = self.numbers.iter().find(|(number, _)| Some(*number) == of);
        found.map_or(plain, |(_, tag)| tag)
    }
}

impl<'a> SsdRoot<'a> {
    fn new(s: &'a SystemStructure) -> Self {
        let components = s.components.iter().map(ComponentElement::new).collect();
        let connections = s.connections.iter().map(ConnectionElement::new).collect();
        let enumeration = |e: &'a SimpleType| EnumerationElement {
            name: &e.name,
            items: e.items.iter().map(|i| ItemElement { name: &i.name, value: i.value }).collect(),
        };
        let binding = |source: &'a String| Bindings {
            binding: Binding { kind: "application/x-ssp-parameter-set", source },
        };
        Self {
            ssd: SSD,
            ssc: SSC,
            version: s.version.as_str(),
            name: &s.name,
            description: &s.description,
            generation_tool: &s.generation_tool,
            system: SystemElement {
                name: &s.name,
                bindings: s.start_values.as_ref().map(binding),
                elements: container(components, |components| Elements { components }),
                connections: container(connections, |connections| Connections { connections }),
            },
            enumerations: container(s.enumerations.iter().map(enumeration).collect(), |enumerations| {
                Enumerations { enumerations }
            }),
            default_experiment: s.default_experiment.map(|e| Experiment {
                start_time: Number(e.start_time.unwrap_or(0.0)),
                stop_time: e.stop_time.map(Number),
            }),
        }
    }
}

impl<'a> ComponentElement<'a> {
    fn new(component: &'a SystemComponent) -> Self {
        let content = |c: &'a Connector| {
            let of_type = match &c.kind {
                VariableKind::Real(_) => TypeElement::Plain(TYPES.number(c.number, TYPES.real)),
                VariableKind::Integer(_) => TypeElement::Plain(TYPES.number(c.number, TYPES.integer)),
                VariableKind::Boolean(_) => TypeElement::Plain(TYPES.boolean),
                VariableKind::String(_) => TypeElement::Plain(TYPES.string),
                VariableKind::Enumeration(of) => {
                    TypeElement::Enumeration(Named { name: of.declared_type.as_deref().unwrap_or_default() })
                }
            };
            let sizes = c.dimensions.iter().map(|&size| TypeElement::Dimension(Size { size }));
            std::iter::once(of_type).chain(sizes).collect()
        };
        let connector = |c: &'a Connector| ConnectorElement {
            name: &c.name,
            kind: kind(c.causality).unwrap_or_default(),
            content: content(c),
        };
        Self {
            name: &component.name,
            kind: "application/x-fmu-sharedlibrary",
            source: &component.source,
            implementation: "CoSimulation",
            connectors: container(component.connectors.iter().map(connector).collect(), |connectors| {
                Connectors { connectors }
            }),
        }
    }
}

impl<'a> ConnectionElement<'a> {
    fn new(c: &'a SystemConnection) -> Self {
        let plain = c.factor == 1.0 && c.offset == 0.0;
        Self {
            start_element: &c.start.0,
            start_connector: &c.start.1,
            end_element: &c.end.0,
            end_connector: &c.end.1,
            suppress_unit_conversion: true,
            transformation: (!plain)
                .then_some(LinearTransformation { factor: Number(c.factor), offset: Number(c.offset) }),
        }
    }
}
