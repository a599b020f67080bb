//! Model descriptions of FMI 2.0 co-simulation, with or without model exchange, and of FMI 3.0 ([`fmi3`]),
//! made from typed variables. Also SSP system structures, and reproducible `.fmu` and `.ssp` archives.
//!
//! This crate owns the file `modelDescription.xml`, the zip container around it and the C types. It does not
//! depend on what the slave computes, reads no file and no environment variable, and prints nothing.
//!
//! A [`ModelDescription`] is plain data with public fields: one model for code that writes a description,
//! reads one or looks for defects in one. [`ModelDescription::to_xml`] checks it against the rules of the
//! standard that an XML schema cannot express ([`RULES`]), then writes it. With the feature `read`, `Located`
//! reads it from a file, however broken, records the positions of its parts, and reports which of the same
//! rules it breaks. With the feature `archive` (on by default), `Archive` collects the files of an FMU and
//! writes them so that the same entries always give the same bytes.
//!
//! | module | owns |
//! |---|---|
//! | `variable` | variables, and the table of legal causality, variability and initial |
//! | `unit` | units in terms of SI base units |
//! | `description` | the whole description, its types, log categories and experiment |
//! | `structure` | outputs, initial unknowns and their dependencies as variable indices |
//! | `fmi3` | the same for FMI 3.0, and its terminals |
//! | `rules` | the rules of both standards beyond the schema, for descriptions written and read |
//! | `validate` | further conditions on a description that is to be written |
//! | `xml` | the file, written |
//! | `read`, `notes` | the file, read, with the positions of its parts |
//! | `names` | characters and forms of a text, a C identifier and a structured name |
//! | `xsd`, `calendar`, `words` | values of XML Schema, valid dates, the spellings of enums |
//! | `system_structure` | several FMUs as one SSP 1.0 or 2.0 system: its files, and their rules |
//! | `archive` | the zip file |
//!
//! # Example
//!
//! ```
//! use punctual_modeldescription::{
//!     Causality, CoSimulation, ModelDescription, Real, Variability, Variable, VariableKind,
//! };
//!
//! let gain = Variable {
//!     name: "gain".into(),
//!     value_reference: 0,
//!     description: "Factor from input to output".into(),
//!     causality: Causality::Parameter,
//!     variability: Variability::Fixed,
//!     initial: None,
//!     kind: VariableKind::Real(Real {
//!         start: Some(2.0),
//!         min: Some(0.0),
//!         max: Some(10.0),
//!         ..Default::default()
//!     }),
//!     dependencies: None,
//!     initial_dependencies: None,
//! };
//! let mut description = ModelDescription {
//!     model_name: "Amplifier".into(),
//!     guid: "{8c4e810f-3df3-4a00-8276-176fa3c9f013}".into(),
//!     co_simulation: CoSimulation { model_identifier: "amplifier".into(), ..Default::default() },
//!     variables: vec![gain],
//!     ..Default::default()
//! };
//! assert!(description.to_xml()?.contains(r#"<Real min="0.0" max="10.0" start="2.0"/>"#));
//!
//! description.guid.clear();
//! let error = description.to_xml().unwrap_err();
//! assert_eq!(error.to_string(), "description: guid is empty; must be a text that no other FMU has");
//! # Ok::<(), punctual_modeldescription::Error>(())
//! ```
//!
//! # References
//!
//! Functional Mock-up Interface for Model Exchange and Co-Simulation, version 2.0.4: section 2.2
//! (description schema), 2.2.7 (variables), 2.2.8 (model structure), 2.2.9 (names), 2.3 (archive), 3.3.1
//! (model exchange capabilities), 4.3.1 (co-simulation capabilities). The same, version 3.0.2: section 2.4 (description schema), 2.4.9
//! (terminals), 2.5 (archive), 3.4 and 4.4 (capabilities).
#![forbid(unsafe_code)]

#[cfg(feature = "archive")]
mod archive;
mod calendar;
mod description;
mod error;
pub mod fmi3;
mod names;
#[cfg(feature = "read")]
mod notes;
#[cfg(feature = "read")]
mod read;
mod rules;
mod structure;
mod system_structure;
mod unit;
mod validate;
mod variable;
mod words;
mod xml;
pub mod xsd;

#[cfg(feature = "archive")]
pub use archive::{Archive, Timestamp};
pub use description::{
    CoSimulation, DefaultExperiment, EnumerationItem, LogCategory, ModelDescription, ModelExchange,
    NamingConvention, SimpleType,
};
pub use error::Error;
pub use names::{PLATFORM, is_c_identifier, is_structured_name};
#[cfg(feature = "read")]
pub use read::Located;
pub use rules::{Place, RULES, Severity, UnknownList, Violation, brief};
pub use structure::{ModelStructure, Unknown};
pub use system_structure::{
    Connector, Parameter, ParameterSet, ParameterValue, SspVersion, SystemComponent, SystemConnection,
    SystemStructure,
};
pub use unit::{BaseUnit, DisplayUnit, Unit};
pub use variable::{
    BaseType, Causality, Initial, InitialRule, Integer, Plain, Real, ScalarType, Variability, Variable,
    VariableKind,
};
