//! Model descriptions and terminals of FMI 3.0.2, beside those of 2.0.
//!
//! | module | owns |
//! |---|---|
//! | `variable` | variables of fifteen types, scalars and arrays, with aliases |
//! | `description` | the whole description, its interfaces and types |
//! | `structure` | outputs, derivatives and initial unknowns, by value reference |
//! | `validate` | conditions on a description to be written |
//! | `xml` | the file `modelDescription.xml`, written |
//! | `read` | the same file, read |
//! | `terminals` | the file `terminalsAndIcons.xml`, written and read |
//!
//! # Example
//!
//! ```
//! use punctual_modeldescription::fmi3::{
//!     CoSimulation, Dimension, Float, Interface, ModelDescription, ModelStructure, Variable, VariableKind,
//! };
//! use punctual_modeldescription::{Causality, Variability};
//!
//! let float = |start: &[f64]| VariableKind::Float64(Float { start: start.to_vec(), ..Float::default() });
//! let variables = vec![
//!     Variable::new("time", 0, Causality::Independent, Variability::Continuous, float(&[])),
//!     Variable {
//!         dimensions: vec![Dimension::fixed(2)],
//!         ..Variable::new("u", 1, Causality::Input, Variability::Continuous, float(&[0.0, 1.0]))
//!     },
//!     Variable::new("y", 2, Causality::Output, Variability::Continuous, float(&[])),
//! ];
//! let mut structure = ModelStructure::of(&variables);
//! structure.outputs[0].dependencies = Some(vec![1]);
//! let interface = Interface { model_identifier: "sum".into(), ..Interface::default() };
//! let mut description = ModelDescription {
//!     model_name: "Sum".into(),
//!     instantiation_token: "{8c4e810f-3df3-4a00-8276-176fa3c9f013}".into(),
//!     co_simulation: Some(CoSimulation { interface, ..CoSimulation::default() }),
//!     variables,
//!     structure,
//!     ..ModelDescription::default()
//! };
//! let xml = description.to_xml()?;
//! assert!(xml.contains(r#"<Output valueReference="2" dependencies="1"/>"#));
//! assert!(xml.contains(r#"<InitialUnknown valueReference="2"/>"#));
//!
//! description.variables[1].dimensions = vec![Dimension::fixed(3)];
//! let error = description.to_xml().unwrap_err();
//! assert_eq!(
//!     error.to_string(),
//!     r#"variables["u"].start: has 2 start values; must have 1 or 3, as the dimensions say: 3"#
//! );
//! # Ok::<(), punctual_modeldescription::Error>(())
//! ```

mod description;
#[cfg(feature = "read")]
mod read;
mod structure;
mod terminals;
mod validate;
mod variable;
mod xml;

pub use description::{CoSimulation, Interface, ModelDescription, ModelExchange, TypeDefinition};
#[cfg(feature = "read")]
pub use read::Located;
pub use structure::{ModelStructure, Unknown};
#[cfg(feature = "read")]
pub use terminals::LocatedTerminals;
pub use terminals::{StreamMember, TERMINALS, Terminal, TerminalMember, Terminals};
pub use variable::{
    Alias, Binary, Clock, DataType, Dimension, Float, Integer, IntervalVariability, Plain, Variable,
    VariableKind,
};

/// One value of an enumeration type, of 64 bits.
pub type EnumerationItem = crate::EnumerationItem<i64>;

/// Denotes a dimension of a variable among the attributes that cannot be read.
pub(crate) const DIMENSION: &str = "Dimension";
/// Denotes an empty list of clocks there.
pub(crate) const NO_CLOCK: &str = "clocks: empty";

/// The folder of this platform's binaries in an archive of FMI 3.0 (section 2.5.1.4.2), such as
/// `x86_64-linux`.
pub const PLATFORM: &str = if cfg!(all(target_os = "windows", target_arch = "x86_64")) {
    "x86_64-windows"
} else if cfg!(all(target_os = "windows", target_arch = "x86")) {
    "x86-windows"
} else if cfg!(all(target_os = "windows", target_arch = "aarch64")) {
    "aarch64-windows"
} else if cfg!(all(target_os = "macos", target_arch = "x86_64")) {
    "x86_64-darwin"
} else if cfg!(all(target_os = "macos", target_arch = "aarch64")) {
    "aarch64-darwin"
} else if cfg!(all(target_os = "linux", target_arch = "x86_64")) {
    "x86_64-linux"
} else if cfg!(all(target_os = "linux", target_arch = "x86")) {
    "x86-linux"
} else if cfg!(all(target_os = "linux", target_arch = "aarch64")) {
    "aarch64-linux"
} else {
    "unknown"
};
