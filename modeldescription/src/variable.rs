//! Variables and the legal combinations of their attributes (FMI 2.0.4, section 2.2.7).

use crate::words::words;
use crate::xsd;
use serde::Serialize;

/// The role of a variable.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Causality {
    /// Set by the importer before the simulation; if tunable, also during it.
    Parameter,
    /// Computed from parameters.
    CalculatedParameter,
    /// Set by the importer or by another slave.
    Input,
    /// Read by the importer or another slave.
    Output,
    /// Internal to the slave, but visible.
    Local,
    /// The independent variable, usually time. At most one, which is Real and has no start value.
    Independent,
    /// Set by the importer before initialization; can determine array sizes. Only in FMI 3.0.
    StructuralParameter,
}

words!(Causality: Parameter "parameter", CalculatedParameter "calculatedParameter", Input "input", Output "output",
    Local "local", Independent "independent", StructuralParameter "structuralParameter");

impl Causality {
    /// The names in FMI 2.0.
    pub const WORDS_OF_FMI2: &'static [&'static str] = Self::WORDS.split_at(6).0;
}

/// When the value of a variable may change.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Variability {
    /// Never.
    Constant,
    /// Not after initialization.
    Fixed,
    /// Between communication points, when the importer sets it.
    Tunable,
    /// Only at communication points and events.
    Discrete,
    /// At any time. Only Real variables.
    Continuous,
}

words!(Variability: Constant "constant", Fixed "fixed", Tunable "tunable", Discrete "discrete",
    Continuous "continuous");

/// How the first value of a variable is determined.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Initial {
    /// From its start value.
    Exact,
    /// Computed during initialization, with the start value as initial guess.
    Approx,
    /// Computed during initialization, without a start value.
    Calculated,
}

words!(Initial: Exact "exact", Approx "approx", Calculated "calculated");

/// The rule of the standard on [`Initial`] for a pair of causality and variability.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InitialRule {
    /// The meaning of an omitted `initial`; `None` if the attribute itself is forbidden.
    pub default: Option<Initial>,
    /// The values allowed; empty if the attribute itself is forbidden.
    pub allowed: &'static [Initial],
}

impl InitialRule {
    /// The rule for a pair, or `None` if the pair is not legal.
    ///
    /// | variability | parameter | calculatedParameter | input | output | local | independent |
    /// |---|---|---|---|---|---|---|
    /// | constant   | - | - | - | A | A | - |
    /// | fixed      | A | B | - | - | B | - |
    /// | tunable    | A | B | - | - | B | - |
    /// | discrete   | - | - | D | C | C | - |
    /// | continuous | - | - | D | C | C | E |
    ///
    /// A: exact. B: calculated (default) or approx. C: calculated (default), exact or approx. D and E: the
    /// attribute is forbidden. Inputs still have a start value; the independent variable has none.
    pub fn of(causality: Causality, variability: Variability) -> Option<Self> {
        use Causality as C;
        use Initial::{Approx, Calculated, Exact};
        use Variability as V;
        const A: InitialRule = InitialRule { default: Some(Exact), allowed: &[Exact] };
        const B: InitialRule = InitialRule { default: Some(Calculated), allowed: &[Calculated, Approx] };
        const C_: InitialRule =
            InitialRule { default: Some(Calculated), allowed: &[Calculated, Exact, Approx] };
        const D_E: InitialRule = InitialRule { default: None, allowed: &[] };
        match (variability, causality) {
            (V::Constant, C::Output | C::Local) => Some(A),
            (V::Fixed | V::Tunable, C::Parameter) => Some(A),
            (V::Fixed | V::Tunable, C::CalculatedParameter | C::Local) => Some(B),
            (V::Discrete | V::Continuous, C::Output | C::Local) => Some(C_),
            (V::Discrete | V::Continuous, C::Input) => Some(D_E),
            (V::Continuous, C::Independent) => Some(D_E),
            _ => None,
        }
    }

    /// The same for FMI 3.0, where structural parameters follow the rule of parameters, and inputs are exact.
    pub fn of_fmi3(causality: Causality, variability: Variability) -> Option<Self> {
        let exact = Self { default: Some(Initial::Exact), allowed: &[Initial::Exact] };
        match causality {
            Causality::StructuralParameter => Self::of(Causality::Parameter, variability),
            Causality::Input => Self::of(causality, variability).map(|_| exact),
            _ => Self::of(causality, variability),
        }
    }
}

/// The type of a variable.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ScalarType {
    /// A double.
    Real,
    /// A 32-bit integer.
    Integer,
    /// A Boolean.
    Boolean,
    /// A text, UTF-8.
    String,
    /// A 32-bit integer with named values.
    Enumeration,
}

words!(ScalarType: Real "Real", Integer "Integer", Boolean "Boolean", String "String",
    Enumeration "Enumeration");

impl ScalarType {
    /// The functions that read and write variables of this type.
    pub const fn base_type(self) -> BaseType {
        match self {
            Self::Real => BaseType::Real,
            Self::Integer | Self::Enumeration => BaseType::Integer,
            Self::Boolean => BaseType::Boolean,
            Self::String => BaseType::String,
        }
    }
}

/// The functions that read and write a variable: `fmi2GetReal`, `fmi2GetInteger`, ...
///
/// Value references are unique within one base type.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum BaseType {
    /// `fmi2Real`, a double.
    Real,
    /// `fmi2Integer`, 32 bits; also for enumerations.
    Integer,
    /// `fmi2Boolean`.
    Boolean,
    /// `fmi2String`, UTF-8.
    String,
}

/// The attributes of a Real. In a declared type, those specific to variables (`declared_type`, `start`,
/// `derivative`) stay `None`.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Real {
    /// The name of the type that provides omitted attributes, if any.
    #[serde(rename = "@declaredType", skip_serializing_if = "Option::is_none")]
    pub declared_type: Option<String>,
    /// The physical quantity, for example `Acceleration`; one line.
    #[serde(rename = "@quantity", skip_serializing_if = "Option::is_none")]
    pub quantity: Option<String>,
    /// The name of one of [`ModelDescription::units`](crate::ModelDescription::units).
    #[serde(rename = "@unit", skip_serializing_if = "Option::is_none")]
    pub unit: Option<String>,
    /// The name of one of the display units of `unit`.
    #[serde(rename = "@displayUnit", skip_serializing_if = "Option::is_none")]
    pub display_unit: Option<String>,
    /// Whether unit offsets are ignored, as for differences of temperature; default false.
    #[serde(rename = "@relativeQuantity", skip_serializing_if = "xsd::is_default")]
    pub relative_quantity: bool,
    /// Smallest allowed value, in `unit`; not NaN and not `INF`; no limit if absent.
    #[serde(rename = "@min", skip_serializing_if = "Option::is_none", serialize_with = "xsd::optional")]
    pub min: Option<f64>,
    /// Largest allowed value, in `unit`; at least `min`, not NaN and not `-INF`; no limit if absent.
    #[serde(rename = "@max", skip_serializing_if = "Option::is_none", serialize_with = "xsd::optional")]
    pub max: Option<f64>,
    /// Typical magnitude, in `unit`; finite and greater than 0.
    #[serde(rename = "@nominal", skip_serializing_if = "Option::is_none", serialize_with = "xsd::optional")]
    pub nominal: Option<f64>,
    /// Start value or initial guess, in `unit`; within `min` and `max`. Finite, unless the bound on that side
    /// is explicitly infinite.
    #[serde(rename = "@start", skip_serializing_if = "Option::is_none", serialize_with = "xsd::optional")]
    pub start: Option<f64>,
    /// The index, from 1, of the continuous variable that this is the time derivative of.
    #[serde(rename = "@derivative", skip_serializing_if = "Option::is_none")]
    pub derivative: Option<u32>,
}

/// The attributes of an Integer or an enumeration. In a declared type, those specific to variables
/// (`declared_type`, `start`) stay `None`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Integer {
    /// The name of the type that provides omitted attributes. Required for an enumeration, optional for an
    /// Integer.
    #[serde(rename = "@declaredType", skip_serializing_if = "Option::is_none")]
    pub declared_type: Option<String>,
    /// The physical quantity; one line.
    #[serde(rename = "@quantity", skip_serializing_if = "Option::is_none")]
    pub quantity: Option<String>,
    /// Smallest allowed value, dimensionless; no limit if absent.
    #[serde(rename = "@min", skip_serializing_if = "Option::is_none")]
    pub min: Option<i32>,
    /// Largest allowed value, at least `min`; no limit if absent.
    #[serde(rename = "@max", skip_serializing_if = "Option::is_none")]
    pub max: Option<i32>,
    /// Start value or initial guess; within `min` and `max`. For an enumeration, the value of one of its
    /// items.
    #[serde(rename = "@start", skip_serializing_if = "Option::is_none")]
    pub start: Option<i32>,
}

/// The attributes of a Boolean or a String. In a declared type, both stay `None`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Plain<T> {
    /// The name of the declared type, if any.
    #[serde(rename = "@declaredType", skip_serializing_if = "Option::is_none")]
    pub declared_type: Option<String>,
    /// Start value or initial guess; a text must consist of characters that XML 1.0 allows.
    #[serde(rename = "@start", skip_serializing_if = "Option::is_none")]
    pub start: Option<T>,
}

/// The type of a variable, or a declared type, with its type-specific attributes.
///
/// `start` is required for inputs and for initial exact or approx, and forbidden otherwise.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub enum VariableKind {
    /// A double in its unit.
    Real(Real),
    /// A 32-bit integer, dimensionless.
    Integer(Integer),
    /// A Boolean.
    Boolean(Plain<bool>),
    /// A text.
    String(Plain<String>),
    /// One of the items of its declared type.
    Enumeration(Integer),
}

impl VariableKind {
    /// An enumeration of this declared type, without start value.
    pub fn enumeration(declared_type: impl Into<String>) -> Self {
        Self::Enumeration(Integer { declared_type: Some(declared_type.into()), ..Integer::default() })
    }

    /// The type without its attributes.
    pub fn scalar_type(&self) -> ScalarType {
        match self {
            Self::Real(_) => ScalarType::Real,
            Self::Integer(_) => ScalarType::Integer,
            Self::Boolean(_) => ScalarType::Boolean,
            Self::String(_) => ScalarType::String,
            Self::Enumeration(_) => ScalarType::Enumeration,
        }
    }

    /// The functions that read and write variables of this kind.
    pub fn base_type(&self) -> BaseType {
        self.scalar_type().base_type()
    }

    /// The name of the declared type.
    pub fn declared_type(&self) -> Option<&str> {
        let (Self::Real(Real { declared_type, .. })
        | Self::Integer(Integer { declared_type, .. })
        | Self::Enumeration(Integer { declared_type, .. })
        | Self::Boolean(Plain { declared_type, .. })
        | Self::String(Plain { declared_type, .. })) = self;
        declared_type.as_deref()
    }

    /// The unit; only of a Real.
    pub fn unit(&self) -> Option<&str> {
        if let Self::Real(real) = self { real.unit.as_deref() } else { None }
    }

    /// The display unit; only of a Real.
    pub fn display_unit(&self) -> Option<&str> {
        if let Self::Real(real) = self { real.display_unit.as_deref() } else { None }
    }

    /// `min` and `max` as numbers; `None` for a Boolean or a String.
    pub fn range(&self) -> (Option<f64>, Option<f64>) {
        match self {
            Self::Real(real) => (real.min, real.max),
            Self::Integer(of) | Self::Enumeration(of) => (of.min.map(f64::from), of.max.map(f64::from)),
            Self::Boolean(_) | Self::String(_) => (None, None),
        }
    }

    /// Whether a start value is given.
    pub fn has_start(&self) -> bool {
        match self {
            Self::String(text) => text.start.is_some(),
            _ => self.start_number().is_some(),
        }
    }

    /// The start value as a number, 0 or 1 for a Boolean; `None` for a String.
    pub fn start_number(&self) -> Option<f64> {
        match self {
            Self::Real(real) => real.start,
            Self::Integer(of) | Self::Enumeration(of) => of.start.map(f64::from),
            Self::Boolean(of) => of.start.map(|start| f64::from(u8::from(start))),
            Self::String(_) => None,
        }
    }
}

/// One scalar variable of the slave.
#[derive(Clone, Debug, PartialEq)]
pub struct Variable {
    /// The name; not empty, unique, different from all enumeration types, one line, and of the form that the
    /// description's [`NamingConvention`](crate::NamingConvention) requires.
    pub name: String,
    /// The handle of the variable in the C interface; unique within its [`BaseType`].
    pub value_reference: u32,
    /// Its meaning, as a text for the reader; if empty, the attribute is omitted.
    pub description: String,
    /// The role of the variable.
    pub causality: Causality,
    /// When its value may change; the pair with `causality` must be legal, see [`InitialRule::of`].
    pub variability: Variability,
    /// How its first value is determined; `None` means the default of [`InitialRule::of`].
    pub initial: Option<Initial>,
    /// Type, start value and range.
    pub kind: VariableKind,
    /// For outputs, and with model exchange derivatives of states: value references of the inputs,
    /// parameters, independent variable and, with model exchange, states that this one depends on directly at
    /// communication points. `None` means unknown, and so all; empty means none. Order and repetition do not
    /// matter. A value reference shared by several of those variables (of different base types) is refused as
    /// ambiguous.
    pub dependencies: Option<Vec<u32>>,
    /// The same for initialization mode, where variables with initial exact count as well. Only for initial
    /// unknowns (see [`is_initial_unknown`](Self::is_initial_unknown)).
    pub initial_dependencies: Option<Vec<u32>>,
}

impl Variable {
    /// The index, from 1, of the variable whose time derivative this is.
    pub fn state(&self) -> Option<u32> {
        if let VariableKind::Real(Real { derivative, .. }) = self.kind { derivative } else { None }
    }

    /// Whether its first value is computed: `initial` is approx or calculated.
    pub fn is_computed(&self) -> bool {
        matches!(self.effective_initial(), Some(Initial::Approx | Initial::Calculated))
    }

    /// How the first value is determined, with the default of the standard filled in. `None` for inputs, the
    /// independent variable and illegal pairs of causality and variability.
    pub fn effective_initial(&self) -> Option<Initial> {
        self.initial.or_else(|| InitialRule::of(self.causality, self.variability)?.default)
    }

    /// Whether a start value is required; otherwise it is forbidden.
    pub fn needs_start(&self) -> bool {
        self.causality == Causality::Input
            || matches!(self.effective_initial(), Some(Initial::Exact | Initial::Approx))
    }

    /// Whether the variable belongs to `ModelStructure/InitialUnknowns`: outputs with initial approx
    /// or calculated, and calculated parameters.
    pub fn is_initial_unknown(&self) -> bool {
        match self.causality {
            Causality::Output => self.is_computed(),
            Causality::CalculatedParameter => true,
            _ => false,
        }
    }
}

/// The path of a field of a variable in an error.
pub(crate) fn variable_path(variable: &Variable, field: &str) -> String {
    format!("variables[{:?}].{field}", variable.name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn table_has_the_fifteen_legal_pairs() {
        use Causality as C;
        use Variability as V;
        let mut legal = 0;
        for &causality in C::ALL {
            for &variability in V::ALL {
                let Some(rule) = InitialRule::of(causality, variability) else { continue };
                legal += 1;
                assert_eq!(rule.default, rule.allowed.first().copied(), "{causality:?} {variability:?}");
            }
        }
        assert_eq!(legal, 15);
        assert_eq!(InitialRule::of(C::Parameter, V::Continuous), None);
        assert_eq!(InitialRule::of(C::Input, V::Fixed), None);
    }
}
