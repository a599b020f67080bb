//! The file `modelDescription.xml`. The model's own types say how each element is written. The rest stands here:
//! the root, the containers, and everything derived.
//!
//! Attributes at the default of the schema are left out, except causality, variability and initial: a reader of
//! the file should not have to know the table of defaults.

use crate::{
    CoSimulation, DefaultExperiment, EnumerationItem, Error, LogCategory, ModelDescription, ModelStructure,
    SimpleType, Unit, Unknown, Variable, VariableKind,
};
use serde::ser::SerializeStruct;
use serde::{Serialize, Serializer};

impl ModelDescription {
    /// The content of `modelDescription.xml`: UTF-8 without byte order mark, two blanks of indentation.
    ///
    /// The same description always gives the same text.
    ///
    /// # Errors
    ///
    /// Those of [`validate`](Self::validate).
    pub fn to_xml(&self) -> Result<String, Error> {
        self.validate()?;
        text(&Root::new(self, &self.structure()?))
    }
}

/// A document with this root: UTF-8 without byte order mark, two blanks of indentation.
pub(crate) fn text<T: Serialize>(root: &T) -> Result<String, Error> {
    let mut text = String::from("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n");
    let mut serializer = quick_xml::se::Serializer::new(&mut text);
    serializer.indent(' ', 2);
    root.serialize(serializer).map_err(Error::xml)?;
    text.push('\n');
    Ok(text)
}

/// A container with its children, or none at all, since the schemas allow no empty containers.
pub(crate) fn container<T, L: AsRef<[T]>, C>(children: L, container: impl FnOnce(L) -> C) -> Option<C> {
    (!children.as_ref().is_empty()).then(|| container(children))
}

#[derive(Serialize)]
#[serde(rename = "fmiModelDescription")]
struct Root<'a> {
    #[serde(rename = "@fmiVersion")]
    fmi_version: &'static str,
    #[serde(rename = "@modelName")]
    model_name: &'a str,
    #[serde(rename = "@guid")]
    guid: &'a str,
    #[serde(rename = "@description", skip_serializing_if = "str::is_empty")]
    description: &'a str,
    #[serde(rename = "@author", skip_serializing_if = "str::is_empty")]
    author: &'a str,
    #[serde(rename = "@version", skip_serializing_if = "str::is_empty")]
    version: &'a str,
    #[serde(rename = "@copyright", skip_serializing_if = "str::is_empty")]
    copyright: &'a str,
    #[serde(rename = "@license", skip_serializing_if = "str::is_empty")]
    license: &'a str,
    #[serde(rename = "@generationTool", skip_serializing_if = "str::is_empty")]
    generation_tool: &'a str,
    #[serde(rename = "@generationDateAndTime", skip_serializing_if = "Option::is_none")]
    generation_date_and_time: Option<&'a str>,
    #[serde(rename = "@variableNamingConvention")]
    variable_naming_convention: &'static str,
    #[serde(rename = "CoSimulation")]
    co_simulation: &'a CoSimulation,
    #[serde(rename = "UnitDefinitions", skip_serializing_if = "Option::is_none")]
    units: Option<UnitDefinitions<'a>>,
    #[serde(rename = "TypeDefinitions", skip_serializing_if = "Option::is_none")]
    types: Option<TypeDefinitions<'a>>,
    #[serde(rename = "LogCategories", skip_serializing_if = "Option::is_none")]
    log_categories: Option<LogCategories<'a>>,
    #[serde(rename = "DefaultExperiment", skip_serializing_if = "Option::is_none")]
    default_experiment: Option<DefaultExperiment>,
    #[serde(rename = "ModelVariables")]
    variables: ModelVariables<'a>,
    #[serde(rename = "ModelStructure")]
    structure: Structure<'a>,
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

impl<'a> Root<'a> {
    fn new(d: &'a ModelDescription, structure: &'a ModelStructure) -> Self {
        let unknowns = |list: &'a Vec<Unknown>| container(list.as_slice(), |unknowns| Unknowns { unknowns });
        Self {
            fmi_version: "2.0",
            model_name: &d.model_name,
            guid: &d.guid,
            description: &d.description,
            author: &d.author,
            version: &d.version,
            copyright: &d.copyright,
            license: &d.license,
            generation_tool: &d.generation_tool,
            generation_date_and_time: d.generation_date_and_time.as_deref(),
            variable_naming_convention: d.variable_naming_convention.as_str(),
            co_simulation: &d.co_simulation,
            units: container(d.units.as_slice(), |units| UnitDefinitions { units }),
            types: container(d.types.as_slice(), |types| TypeDefinitions { types }),
            log_categories: container(d.log_categories.as_slice(), |categories| LogCategories { categories }),
            default_experiment: d.default_experiment,
            variables: ModelVariables { variables: &d.variables },
            structure: Structure {
                outputs: unknowns(&structure.outputs),
                derivatives: unknowns(&structure.derivatives),
                initial_unknowns: unknowns(&structure.initial_unknowns),
            },
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
