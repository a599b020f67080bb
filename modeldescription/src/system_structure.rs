//! System Structure and Parameterization 1.0 and 2.0: components, their connectors and connections as
//! `SystemStructure.ssd`, start values as an `.ssv` parameter set. Both versions have the same namespaces; 2.0 has arrays.

use crate::names::forbidden_character;
use crate::words::words;
use crate::xml::{container, text};
use crate::xsd::Number;
use crate::{Causality, DefaultExperiment, Error, SimpleType, VariableKind};
use serde::Serialize;

const SSD: &str = "http://ssp-standard.org/SSP1/SystemStructureDescription";
const SSC: &str = "http://ssp-standard.org/SSP1/SystemStructureCommon";
const SSV: &str = "http://ssp-standard.org/SSP1/SystemStructureParameterValues";

/// A version of SSP.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum SspVersion {
    /// 1.0: scalars only.
    #[default]
    One,
    /// 2.0: arrays too.
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
    /// Meaning for a human; empty: the attribute is absent.
    pub description: String,
    /// The tool that writes it; empty: the attribute is absent.
    pub generation_tool: String,
    /// The path in the archive of the parameter set that gives start values, if there is one. Names in it
    /// are `component.variable`.
    pub start_values: Option<String>,
    /// The components.
    pub components: Vec<SystemComponent>,
    /// The connections.
    pub connections: Vec<SystemConnection>,
    /// The enumerations that connectors refer to.
    pub enumerations: Vec<SimpleType>,
    /// Start time (0 if not given) and stop time; the step size has no place in the format.
    pub default_experiment: Option<DefaultExperiment>,
}

/// An FMU in a system.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SystemComponent {
    /// Its name, unique in the system; not empty.
    pub name: String,
    /// The path of its FMU in the archive; a relative URI.
    pub source: String,
    /// The variables that can be seen from outside.
    pub connectors: Vec<Connector>,
}

/// A variable of a component that can be connected or given a value.
#[derive(Clone, Debug, PartialEq)]
pub struct Connector {
    /// The name of the variable.
    pub name: String,
    /// Input, output, parameter or calculated parameter; others cannot be connectors.
    pub causality: Causality,
    /// Its type, an enumeration with the name of one of the system as its declared type. Start value, range and
    /// unit are not written.
    pub kind: VariableKind,
    /// The sizes of an array, each at least 1; empty: a scalar. In SSP 2.0 only.
    pub dimensions: Vec<u64>,
}

/// A signal from an output to an input: `end = factor · start + offset`, without conversion of units.
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
    /// Names, unique, and values.
    pub parameters: Vec<(String, ParameterValue)>,
}

/// A value of a [`ParameterSet`].
#[derive(Clone, Debug, PartialEq)]
pub enum ParameterValue {
    /// A finite double, in the unit of the variable.
    Real(f64),
    /// A 32-bit integer.
    Integer(i32),
    /// A truth value.
    Boolean(bool),
    /// A text.
    String(String),
    /// The name of an item of an enumeration.
    Enumeration(String),
    /// The finite doubles of an array, row by row; at least one. In SSP 2.0 only.
    Reals(Vec<f64>),
    /// The 32-bit integers of an array, row by row; at least one. In SSP 2.0 only.
    Integers(Vec<i32>),
    /// The truth values of an array, row by row; at least one. In SSP 2.0 only.
    Booleans(Vec<bool>),
}

impl SystemStructure {
    /// The content of `SystemStructure.ssd`: UTF-8 without byte order mark.
    ///
    /// # Errors
    ///
    /// Names that are empty, used twice or have characters that XML cannot carry; a connection from or to
    /// a connector that does not exist or is not an output or input; a factor that is not finite; a
    /// connector of another causality; an enumeration that is not declared.
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
                for size in &connector.dimensions {
                    if self.version == SspVersion::One || *size == 0 {
                        let allowed = "none in SSP 1.0, at least 1 in SSP 2.0";
                        return Err(Error::invalid(format!("{}.dimensions", path()), size, allowed));
                    }
                }
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
    /// Names that are empty, used twice or have characters that XML cannot carry; a number that is not
    /// finite.
    pub fn to_xml(&self) -> Result<String, Error> {
        named("name", &self.name)?;
        for (i, (name, value)) in self.parameters.iter().enumerate() {
            let path = format!("parameters[{name:?}]");
            named(&path, name)?;
            if self.parameters[..i].iter().any(|(other, _)| other == name) {
                return Err(Error::invalid(path, format!("{name:?}"), "a name used once"));
            }
            let elements = match value {
                ParameterValue::Reals(list) => Some(list.len()),
                ParameterValue::Integers(list) => Some(list.len()),
                ParameterValue::Booleans(list) => Some(list.len()),
                _ => None,
            };
            if let Some(elements) = elements.filter(|n| *n == 0 || self.version == SspVersion::One) {
                let allowed = "one value in SSP 1.0; at least one element in SSP 2.0";
                return Err(Error::invalid(path, format!("an array of {elements}"), allowed));
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
                parameters: self.parameters.iter().map(|(name, value)| Parameter::new(name, value)).collect(),
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

/// The kind of a connector, for the causalities that have one.
fn kind(causality: Causality) -> Option<&'static str> {
    match causality {
        Causality::Input | Causality::Output | Causality::Parameter | Causality::CalculatedParameter => {
            Some(causality.as_str())
        }
        _ => None,
    }
}

/// An element of a type, as both files have it; the empty ones have no attributes at all.
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

/// The type of a connector, or after it the size of a dimension.
#[derive(Serialize)]
enum TypeElement<'a> {
    #[serde(rename = "ssc:Real")]
    Real(Empty),
    #[serde(rename = "ssc:Integer")]
    Integer(Empty),
    #[serde(rename = "ssc:Boolean")]
    Boolean(Empty),
    #[serde(rename = "ssc:String")]
    String(Empty),
    #[serde(rename = "ssc:Enumeration")]
    Enumeration(Named<'a>),
    #[serde(rename = "ssc:Dimension")]
    Dimension(Size),
}

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

// Not the model's own item: the format gives it no description.
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
    parameters: Vec<Parameter<'a>>,
}

#[derive(Serialize)]
struct Parameter<'a> {
    #[serde(rename = "@name")]
    name: &'a str,
    #[serde(rename = "$value")]
    value: ValueElement<'a>,
}

#[derive(Serialize)]
enum ValueElement<'a> {
    #[serde(rename = "ssv:Real")]
    Real(Valued<Number>),
    #[serde(rename = "ssv:Integer")]
    Integer(Valued<i32>),
    #[serde(rename = "ssv:Boolean")]
    Boolean(Valued<bool>),
    #[serde(rename = "ssv:String")]
    String(Valued<&'a str>),
    #[serde(rename = "ssv:Enumeration")]
    Enumeration(Valued<&'a str>),
    #[serde(rename = "ssv:Real")]
    Reals(Valued<Vec<Number>>),
    #[serde(rename = "ssv:Integer")]
    Integers(Valued<&'a [i32]>),
    #[serde(rename = "ssv:Boolean")]
    Booleans(Valued<&'a [bool]>),
}

#[derive(Serialize)]
struct Valued<T> {
    #[serde(rename = "@value")]
    value: T,
}

impl<'a> Parameter<'a> {
    fn new(name: &'a str, value: &'a ParameterValue) -> Self {
        let value = match value {
            ParameterValue::Real(x) => ValueElement::Real(Valued { value: Number(*x) }),
            ParameterValue::Integer(i) => ValueElement::Integer(Valued { value: *i }),
            ParameterValue::Boolean(b) => ValueElement::Boolean(Valued { value: *b }),
            ParameterValue::String(text) => ValueElement::String(Valued { value: text }),
            ParameterValue::Reals(list) => {
                ValueElement::Reals(Valued { value: list.iter().map(|x| Number(*x)).collect() })
            }
            ParameterValue::Integers(list) => ValueElement::Integers(Valued { value: list }),
            ParameterValue::Booleans(list) => ValueElement::Booleans(Valued { value: list }),
            ParameterValue::Enumeration(item) => ValueElement::Enumeration(Valued { value: item }),
        };
        Self { name, value }
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
                VariableKind::Real(_) => TypeElement::Real(Empty {}),
                VariableKind::Integer(_) => TypeElement::Integer(Empty {}),
                VariableKind::Boolean(_) => TypeElement::Boolean(Empty {}),
                VariableKind::String(_) => TypeElement::String(Empty {}),
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
