//! Variables and the legal combinations of their attributes (FMI 2.0.4, section 2.2.7).

/// What a variable is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Causality {
    /// Set by the importer before the simulation, or also during it if tunable.
    Parameter,
    /// Computed from parameters.
    CalculatedParameter,
    /// Set by the importer or by another slave.
    Input,
    /// Given to the importer or to another slave.
    Output,
    /// Inside the slave, but visible.
    Local,
    /// The independent variable, usually time. At most one, Real and without start value.
    Independent,
}

impl Causality {
    /// The spelling in the XML file.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Parameter => "parameter",
            Self::CalculatedParameter => "calculatedParameter",
            Self::Input => "input",
            Self::Output => "output",
            Self::Local => "local",
            Self::Independent => "independent",
        }
    }
}

/// When a variable may change.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Variability {
    /// Never.
    Constant,
    /// Not after initialization.
    Fixed,
    /// Between communication points, when the importer sets it.
    Tunable,
    /// At communication points and events only.
    Discrete,
    /// At any time. Real variables only.
    Continuous,
}

impl Variability {
    /// The spelling in the XML file.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Constant => "constant",
            Self::Fixed => "fixed",
            Self::Tunable => "tunable",
            Self::Discrete => "discrete",
            Self::Continuous => "continuous",
        }
    }
}

/// How a variable gets its first value.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Initial {
    /// From its start value.
    Exact,
    /// Computed in initialization, with the start value as first guess.
    Approx,
    /// Computed in initialization; there is no start value.
    Calculated,
}

impl Initial {
    /// The spelling in the XML file.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Exact => "exact",
            Self::Approx => "approx",
            Self::Calculated => "calculated",
        }
    }
}

/// What the standard says of [`Initial`] for one pair of causality and variability.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InitialRule {
    /// The meaning of an absent `initial`; `None` where the attribute itself is forbidden.
    pub default: Option<Initial>,
    /// The values that may be written; empty where the attribute itself is forbidden.
    pub allowed: &'static [Initial],
}

impl InitialRule {
    /// The rule for a pair, or `None` if the pair is not a legal one.
    ///
    /// | variability | parameter | calculatedParameter | input | output | local | independent |
    /// |---|---|---|---|---|---|---|
    /// | constant   | - | - | - | A | A | - |
    /// | fixed      | A | B | - | - | B | - |
    /// | tunable    | A | B | - | - | B | - |
    /// | discrete   | - | - | D | C | C | - |
    /// | continuous | - | - | D | C | C | E |
    ///
    /// A: exact. B: calculated (default) or approx. C: calculated (default), exact or approx.
    /// D and E: the attribute is forbidden; inputs have a start value nevertheless, the independent
    /// variable has none.
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
}

/// The functions that read and write a variable: `fmi2GetReal`, `fmi2GetInteger`, ...
///
/// Value references are unique within one base type.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum BaseType {
    /// `fmi2Real`, a double.
    Real,
    /// `fmi2Integer`, 32 bits; also of enumerations.
    Integer,
    /// `fmi2Boolean`.
    Boolean,
    /// `fmi2String`, UTF-8.
    String,
}

/// The type of a variable, with the attributes that depend on it.
///
/// `start` is required for inputs and for initial exact or approx, and forbidden otherwise.
#[derive(Clone, Debug, PartialEq)]
pub enum VariableKind {
    /// A double in `unit`.
    Real {
        /// First value or first guess, in `unit`; within `min` and `max`. Finite, except that it may
        /// be infinite where the bound on that side is given as infinite.
        start: Option<f64>,
        /// Smallest allowed value, in `unit`; not NaN and not `INF`; absent: no limit.
        min: Option<f64>,
        /// Largest allowed value, in `unit`; at least `min`, not NaN and not `-INF`; absent: no limit.
        max: Option<f64>,
        /// Typical magnitude, in `unit`; finite and greater than 0.
        nominal: Option<f64>,
        /// The physical quantity, for example `Acceleration`; one line.
        quantity: Option<String>,
        /// The name of one of [`ModelDescription::units`](crate::ModelDescription::units).
        unit: Option<String>,
    },
    /// A 32-bit integer, dimensionless.
    Integer {
        /// First value or first guess; within `min` and `max`.
        start: Option<i32>,
        /// Smallest allowed value; absent: no limit.
        min: Option<i32>,
        /// Largest allowed value, at least `min`; absent: no limit.
        max: Option<i32>,
    },
    /// A truth value.
    Boolean {
        /// First value or first guess.
        start: Option<bool>,
    },
    /// A text.
    String {
        /// First value or first guess; characters that XML 1.0 allows.
        start: Option<String>,
    },
    /// One of the items of an enumeration type.
    Enumeration {
        /// The name of one of [`ModelDescription::enumerations`](crate::ModelDescription::enumerations).
        declared_type: String,
        /// First value or first guess: the value of one of the items.
        start: Option<i32>,
    },
}

impl VariableKind {
    /// The functions that read and write variables of this kind.
    pub fn base_type(&self) -> BaseType {
        match self {
            Self::Real { .. } => BaseType::Real,
            Self::Integer { .. } | Self::Enumeration { .. } => BaseType::Integer,
            Self::Boolean { .. } => BaseType::Boolean,
            Self::String { .. } => BaseType::String,
        }
    }

    /// Whether a start value is given.
    pub fn has_start(&self) -> bool {
        match self {
            Self::Real { start, .. } => start.is_some(),
            Self::Integer { start, .. } | Self::Enumeration { start, .. } => start.is_some(),
            Self::Boolean { start } => start.is_some(),
            Self::String { start } => start.is_some(),
        }
    }
}

/// One scalar variable of the slave.
#[derive(Clone, Debug, PartialEq)]
pub struct Variable {
    /// The name; not empty, unique, different from all enumeration types, one line, and of the form
    /// that the description's [`NamingConvention`](crate::NamingConvention) asks for.
    pub name: String,
    /// The handle of the variable in the C interface; unique within its [`BaseType`].
    pub value_reference: u32,
    /// Meaning for a human; empty: the attribute is absent.
    pub description: String,
    /// What the variable is for.
    pub causality: Causality,
    /// When it may change; the pair with `causality` must be legal, see [`InitialRule::of`].
    pub variability: Variability,
    /// How it gets its first value; `None`: the default of [`InitialRule::of`].
    pub initial: Option<Initial>,
    /// Type, start value and range.
    pub kind: VariableKind,
    /// Outputs only: value references of the inputs, parameters and independent variable that this
    /// output depends on directly at communication points. `None`: unknown, so on everything;
    /// empty: on nothing. Order and repetition do not matter. A value reference used by several of
    /// those variables (of different base types) is refused as ambiguous.
    pub dependencies: Option<Vec<u32>>,
    /// Initial unknowns only (see [`is_initial_unknown`](Self::is_initial_unknown)): the same for
    /// initialization mode, where variables with initial exact count as well.
    pub initial_dependencies: Option<Vec<u32>>,
}

impl Variable {
    /// How the variable gets its first value, with the default of the standard filled in; `None` for
    /// inputs, the independent variable and illegal pairs of causality and variability.
    pub fn effective_initial(&self) -> Option<Initial> {
        self.initial.or_else(|| InitialRule::of(self.causality, self.variability)?.default)
    }

    /// Whether a start value is required; where it is not, it is forbidden.
    pub fn needs_start(&self) -> bool {
        self.causality == Causality::Input
            || matches!(self.effective_initial(), Some(Initial::Exact | Initial::Approx))
    }

    /// Whether the variable belongs to `ModelStructure/InitialUnknowns`: outputs with initial approx
    /// or calculated, and calculated parameters.
    pub fn is_initial_unknown(&self) -> bool {
        match self.causality {
            Causality::Output => {
                matches!(self.effective_initial(), Some(Initial::Approx | Initial::Calculated))
            }
            Causality::CalculatedParameter => true,
            _ => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn table_has_the_fifteen_legal_pairs() {
        use Causality as C;
        use Variability as V;
        let causalities =
            [C::Parameter, C::CalculatedParameter, C::Input, C::Output, C::Local, C::Independent];
        let variabilities = [V::Constant, V::Fixed, V::Tunable, V::Discrete, V::Continuous];
        let mut legal = 0;
        for causality in causalities {
            for variability in variabilities {
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
