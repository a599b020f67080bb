//! Writes the file `modelDescription.xml`. The types of the model define how each element is written. The
//! rest is here: the root, the containers, and everything derived.
//!
//! Attributes at the schema's default are omitted, except causality, variability and initial, so that a
//! reader of the file need not know the table of defaults.

use crate::{
    DefaultExperiment, EnumerationItem, Error, LogCategory, ModelDescription, ModelStructure,
    NamingConvention, SimpleType, Unit, Unknown, Variable, VariableKind,
};
use serde::ser::SerializeStruct;
use serde::{Serialize, Serializer};

impl ModelDescription {
    /// The content of `modelDescription.xml`: UTF-8 without byte order mark, indented by two blanks.
    ///
    /// The same description always gives the same text.
    ///
    /// # Errors
    ///
    /// Those of [`validate`](Self::validate).
    pub fn to_xml(&self) -> Result<String, Error> {
        self.validate()?;
        text(&Root { description: self, structure: &self.structure()? })
    }

    pub(crate) fn header(&self) -> Header<'_> {
        Header {
            version: "2.0",
            model_name: &self.model_name,
            token: ("@guid", &self.guid),
            description: &self.description,
            author: &self.author,
            model_version: &self.version,
            copyright: &self.copyright,
            license: &self.license,
            generation_tool: &self.generation_tool,
            generation_date_and_time: self.generation_date_and_time.as_deref(),
            variable_naming_convention: self.variable_naming_convention,
        }
    }
}

/// A document with this root: UTF-8 without byte order mark, indented by two blanks.
pub(crate) fn text<T: Serialize>(root: &T) -> Result<String, Error> {
    let mut text = String::from("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n");
    let mut serializer = quick_xml::se::Serializer::new(&mut text);
    serializer.indent(' ', 2);
    root.serialize(serializer).map_err(Error::xml)?;
    text.push('\n');
    Ok(text)
}

/// A container with its children, or nothing if there are none, since the schemas forbid empty containers.
pub(crate) fn container<T, L: AsRef<[T]>, C>(children: L, container: impl FnOnce(L) -> C) -> Option<C> {
    (!children.as_ref().is_empty()).then(|| container(children))
}

/// The attributes of the root that both versions of the standard share.
pub(crate) struct Header<'a> {
    /// The value of `fmiVersion`.
    pub(crate) version: &'static str,
    pub(crate) model_name: &'a str,
    /// Name and value of the attribute that links description and library.
    pub(crate) token: (&'static str, &'a str),
    pub(crate) description: &'a str,
    pub(crate) author: &'a str,
    pub(crate) model_version: &'a str,
    pub(crate) copyright: &'a str,
    pub(crate) license: &'a str,
    pub(crate) generation_tool: &'a str,
    pub(crate) generation_date_and_time: Option<&'a str>,
    pub(crate) variable_naming_convention: NamingConvention,
}

impl Header<'_> {
    /// Writes the attributes.
    pub(crate) fn write<E: SerializeStruct>(&self, element: &mut E) -> Result<(), E::Error> {
        element.serialize_field("@fmiVersion", self.version)?;
        element.serialize_field("@modelName", self.model_name)?;
        element.serialize_field(self.token.0, self.token.1)?;
        for (name, value) in [
            ("@description", self.description),
            ("@author", self.author),
            ("@version", self.model_version),
            ("@copyright", self.copyright),
            ("@license", self.license),
            ("@generationTool", self.generation_tool),
        ] {
            unless_empty(element, name, value)?;
        }
        optional(element, "@generationDateAndTime", self.generation_date_and_time.as_ref())?;
        element.serialize_field("@variableNamingConvention", self.variable_naming_convention.as_str())
    }
}

/// Writes a field if it is present.
pub(crate) fn optional<E: SerializeStruct, T: Serialize>(
    element: &mut E,
    name: &'static str,
    value: Option<T>,
) -> Result<(), E::Error> {
    value.map_or(Ok(()), |value| element.serialize_field(name, &value))
}

/// Writes a text if it is not empty.
pub(crate) fn unless_empty<E: SerializeStruct>(
    element: &mut E,
    name: &'static str,
    value: &str,
) -> Result<(), E::Error> {
    optional(element, name, (!value.is_empty()).then_some(value))
}

/// Writes a flag or number unless it has its default.
pub(crate) fn unless_default<E: SerializeStruct, T: Serialize + Default + PartialEq>(
    element: &mut E,
    name: &'static str,
    value: T,
) -> Result<(), E::Error> {
    optional(element, name, (value != T::default()).then_some(value))
}

/// Writes the list of units, if there are any.
pub(crate) fn units<E: SerializeStruct>(element: &mut E, units: &[Unit]) -> Result<(), E::Error> {
    optional(element, "UnitDefinitions", container(units, |units| UnitDefinitions { units }))
}

/// Writes the list of log categories, if there are any, and the experiment.
pub(crate) fn categories_and_experiment<E: SerializeStruct>(
    element: &mut E,
    categories: &[LogCategory],
    experiment: Option<DefaultExperiment>,
) -> Result<(), E::Error> {
    let categories = container(categories, |categories| LogCategories { categories });
    optional(element, "LogCategories", categories)?;
    optional(element, "DefaultExperiment", experiment)
}

struct Root<'a> {
    description: &'a ModelDescription,
    structure: &'a ModelStructure,
}

impl Serialize for Root<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let d = self.description;
        let mut element = serializer.serialize_struct("fmiModelDescription", 20)?;
        d.header().write(&mut element)?;
        if let Some(exchange) = &d.model_exchange {
            element.serialize_field("@numberOfEventIndicators", &0)?;
            element.serialize_field("ModelExchange", exchange)?;
        }
        element.serialize_field("CoSimulation", &d.co_simulation)?;
        units(&mut element, &d.units)?;
        let types = container(d.types.as_slice(), |types| TypeDefinitions { types });
        optional(&mut element, "TypeDefinitions", types)?;
        categories_and_experiment(&mut element, &d.log_categories, d.default_experiment)?;
        element.serialize_field("ModelVariables", &ModelVariables { variables: &d.variables })?;
        element.serialize_field("ModelStructure", &Structure::new(self.structure))?;
        element.end()
    }
}

#[derive(Serialize)]
struct UnitDefinitions<'a> {
    #[serde(rename = "Unit")]
    units: &'a [Unit],
}

#[derive(Serialize)]
struct TypeDefinitions<'a> {
    #[serde(rename = "SimpleType")]
    types: &'a [SimpleType],
}

#[derive(Serialize)]
struct LogCategories<'a> {
    #[serde(rename = "Category")]
    categories: &'a [LogCategory],
}

#[derive(Serialize)]
struct ModelVariables<'a> {
    #[serde(rename = "ScalarVariable")]
    variables: &'a [Variable],
}

#[derive(Serialize)]
struct Structure<'a> {
    #[serde(rename = "Outputs", skip_serializing_if = "Option::is_none")]
    outputs: Option<Unknowns<'a>>,
    #[serde(rename = "Derivatives", skip_serializing_if = "Option::is_none")]
    derivatives: Option<Unknowns<'a>>,
    #[serde(rename = "InitialUnknowns", skip_serializing_if = "Option::is_none")]
    initial_unknowns: Option<Unknowns<'a>>,
}

#[derive(Serialize)]
struct Unknowns<'a> {
    #[serde(rename = "Unknown")]
    unknowns: &'a [Unknown],
}

impl<'a> Structure<'a> {
    fn new(structure: &'a ModelStructure) -> Self {
        let unknowns = |list: &'a Vec<Unknown>| container(list.as_slice(), |unknowns| Unknowns { unknowns });
        Self {
            outputs: unknowns(&structure.outputs),
            derivatives: unknowns(&structure.derivatives),
            initial_unknowns: unknowns(&structure.initial_unknowns),
        }
    }
}

/// Serialises the names of source files.
pub(crate) fn source_files<S: Serializer>(names: &[String], serializer: S) -> Result<S::Ok, S::Error> {
    #[derive(Serialize)]
    struct File<'a> {
        #[serde(rename = "@name")]
        name: &'a str,
    }
    let mut element = serializer.serialize_struct("SourceFiles", 1)?;
    let files: Vec<_> = names.iter().map(|name| File { name }).collect();
    element.serialize_field("File", &files)?;
    element.end()
}

impl Serialize for Variable {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut element = serializer.serialize_struct("ScalarVariable", 7)?;
        element.serialize_field("@name", &self.name)?;
        element.serialize_field("@valueReference", &self.value_reference)?;
        if !self.description.is_empty() {
            element.serialize_field("@description", &self.description)?;
        }
        element.serialize_field("@causality", self.causality.as_str())?;
        element.serialize_field("@variability", self.variability.as_str())?;
        if let Some(initial) = self.effective_initial() {
            element.serialize_field("@initial", initial.as_str())?;
        }
        element.serialize_field("$value", &self.kind)?;
        element.end()
    }
}

impl Serialize for SimpleType {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        struct Enumeration<'a> {
            #[serde(rename = "@quantity", skip_serializing_if = "Option::is_none")]
            quantity: Option<&'a str>,
            #[serde(rename = "Item")]
            items: &'a [EnumerationItem],
        }
        let mut element = serializer.serialize_struct("SimpleType", 3)?;
        element.serialize_field("@name", &self.name)?;
        if !self.description.is_empty() {
            element.serialize_field("@description", &self.description)?;
        }
        match &self.kind {
            VariableKind::Enumeration(of) => {
                let of = Enumeration { quantity: of.quantity.as_deref(), items: &self.items };
                element.serialize_field("Enumeration", &of)?;
            }
            kind => element.serialize_field("$value", kind)?,
        }
        element.end()
    }
}
