//! Model descriptions and terminals of FMI 3.0.2, beside those of 2.0.
//!
//! | module | owns |
//! |---|---|
//! | `variable` | variables of fifteen types, scalars and arrays, with aliases |
//! | `description` | the whole description, its interfaces and types |
//! | `structure` | outputs, derivatives and initial unknowns, by value reference |
//! | `validate` | conditions on a description that is to be written |
//! | `xml` | the file `modelDescription.xml`, written |
//! | `read` | the same file, read |
//! | `terminals` | the file `terminalsAndIcons.xml`, written and read |

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

/// Stands for a dimension of a variable among the attributes that cannot be read.
pub(crate) const DIMENSION: &str = "Dimension";

/// The folder of this platform's binaries inside an archive of FMI 3.0 (section 2.5.1.4.2), such as `x86_64-linux`.
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
