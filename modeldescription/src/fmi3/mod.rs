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

mod description;
#[cfg(feature = "read")]
mod read;
mod structure;
mod validate;
mod variable;
mod xml;

pub use description::{CoSimulation, Interface, ModelDescription, ModelExchange, TypeDefinition};
#[cfg(feature = "read")]
pub use read::Located;
pub use structure::{ModelStructure, Unknown};
pub use variable::{
    Alias, Binary, Clock, DataType, Dimension, Float, Integer, IntervalVariability, Plain, Variable,
    VariableKind,
};

/// One value of an enumeration type, of 64 bits.
pub type EnumerationItem = crate::EnumerationItem<i64>;
