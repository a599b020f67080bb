//! Variables of FMI 3.0: scalars and arrays of fifteen types (FMI 3.0.2, section 2.4.7).

use crate::words::words;
use crate::{Causality, Initial, InitialRule, Variability};

/// The types, with their names and those of the elements that declare a type.
macro_rules! data_types {
    ($($(#[$doc:meta])* $variant:ident),+) => {
        /// The type of a variable.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub enum DataType {
            $($(#[$doc])* $variant),+
        }

        impl DataType {
            /// All of them, in the order of the schema.
            pub const ALL: &'static [Self] = &[$(Self::$variant),+];

            /// The name of the element of a variable, such as `Float64`.
            pub const fn as_str(self) -> &'static str {
                match self { $(Self::$variant => stringify!($variant)),+ }
            }

            /// The name of the element of a declared type, such as `Float64Type`.
            pub const fn definition(self) -> &'static str {
                match self { $(Self::$variant => concat!(stringify!($variant), "Type")),+ }
            }
        }
    };
}

data_types! {
    /// A 32-bit floating-point number.
    Float32,
    /// A 64-bit floating-point number.
    Float64,
    /// An integer, -128 to 127.
    Int8,
    /// An integer, 0 to 255.
    UInt8,
    /// A 16-bit integer.
    Int16,
    /// An unsigned 16-bit integer.
    UInt16,
    /// A 32-bit integer.
    Int32,
    /// An unsigned 32-bit integer.
    UInt32,
    /// A 64-bit integer.
    Int64,
    /// An unsigned 64-bit integer, the type of array sizes.
    UInt64,
    /// A Boolean.
    Boolean,
    /// A text, UTF-8.
    String,
    /// Bytes.
    Binary,
    /// A 64-bit integer with named values.
    Enumeration,
    /// A clock, which ticks.
    Clock
}

impl DataType {
    /// Whether the type is a floating-point type.
    pub const fn is_float(self) -> bool {
        matches!(self, Self::Float32 | Self::Float64)
    }

    /// The least and the greatest value of an integer type or enumeration; `None` for other types.
    pub const fn limits(self) -> Option<(i128, i128)> {
        Some(match self {
            Self::Int8 => (i8::MIN as i128, i8::MAX as i128),
            Self::UInt8 => (0, u8::MAX as i128),
            Self::Int16 => (i16::MIN as i128, i16::MAX as i128),
            Self::UInt16 => (0, u16::MAX as i128),
            Self::Int32 => (i32::MIN as i128, i32::MAX as i128),
            Self::UInt32 => (0, u32::MAX as i128),
            Self::Int64 | Self::Enumeration => (i64::MIN as i128, i64::MAX as i128),
            Self::UInt64 => (0, u64::MAX as i128),
            _ => return None,
        })
    }
}

/// The attributes of a `Float32` or `Float64`. In a declared type, those specific to variables (`start`,
/// `derivative`, `reinit`) stay empty.
///
/// Numbers of a `Float32` are stored as doubles that a 32-bit number can represent.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Float {
    /// The physical quantity, for example `Acceleration`; one line.
    pub quantity: Option<String>,
    /// The name of one of [`ModelDescription::units`](super::ModelDescription::units).
    pub unit: Option<String>,
    /// The name of one of the display units of `unit`.
    pub display_unit: Option<String>,
    /// Whether unit offsets are ignored, as for differences of temperature; default false.
    pub relative_quantity: bool,
    /// Whether the value grows without bound, so that its magnitude says nothing about errors; default false.
    pub unbounded: bool,
    /// Smallest allowed value, in `unit`; not NaN and not `INF`; no limit if absent.
    pub min: Option<f64>,
    /// Largest allowed value, in `unit`; at least `min`, not NaN and not `-INF`; no limit if absent.
    pub max: Option<f64>,
    /// Typical magnitude, in `unit`; finite and greater than 0.
    pub nominal: Option<f64>,
    /// Start values or initial guesses, in `unit`; may be empty. A single value applies to all elements of an
    /// array.
    pub start: Vec<f64>,
    /// The value reference of the variable that this is the time derivative of.
    pub derivative: Option<u32>,
    /// Whether the FMU may set this continuous state at events; for model exchange, default false.
    pub reinit: bool,
}

/// The attributes of an integer type or an enumeration. In a declared type, `start` stays empty.
///
/// All values lie within [`DataType::limits`].
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Integer {
    /// The physical quantity; one line.
    pub quantity: Option<String>,
    /// Smallest allowed value, dimensionless; no limit if absent.
    pub min: Option<i128>,
    /// Largest allowed value, at least `min`; no limit if absent.
    pub max: Option<i128>,
    /// Start values or initial guesses; may be empty. A single value applies to all elements of an array.
    pub start: Vec<i128>,
}

/// The attributes of a `Boolean` or `String`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Plain<T> {
    /// Start values or initial guesses; may be empty. A single value applies to all elements of an array.
    pub start: Vec<T>,
}

/// The attributes of a `Binary`. In a declared type, `start` stays empty.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Binary {
    /// The media type of the bytes; `application/octet-stream` if absent.
    pub mime_type: Option<String>,
    /// The greatest length, in bytes; no limit if absent.
    pub max_size: Option<u64>,
    /// Start values; may be empty. A single value applies to all elements of an array.
    pub start: Vec<Vec<u8>>,
}

/// How the interval of a clock is determined.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum IntervalVariability {
    /// Given in the description.
    Constant,
    /// Given before initialization.
    Fixed,
    /// Can be changed by tunable parameters.
    Tunable,
    /// Given again at each tick.
    Changing,
    /// Given at some events as the time until the next tick.
    Countdown,
    /// Unknown until it ticks.
    Triggered,
}

words!(IntervalVariability: Constant "constant", Fixed "fixed", Tunable "tunable", Changing "changing",
    Countdown "countdown", Triggered "triggered");

/// The attributes of a `Clock`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Clock {
    /// Whether the importer may skip ticks; default false.
    pub can_be_deactivated: bool,
    /// The order among clocks of scheduled execution, 0 first.
    pub priority: Option<u32>,
    /// How its interval is determined; required.
    pub interval_variability: Option<IntervalVariability>,
    /// The interval, in seconds.
    pub interval_decimal: Option<f64>,
    /// The time of the first tick, in seconds; default 0.
    pub shift_decimal: f64,
    /// Whether the interval can be given as a fraction; default false.
    pub supports_fraction: bool,
    /// The denominator of fractions, in ticks per second.
    pub resolution: Option<u64>,
    /// The numerator of the interval, dimensionless.
    pub interval_counter: Option<u64>,
    /// The numerator of the time of the first tick, dimensionless; default 0.
    pub shift_counter: u64,
}

/// The type of a variable, or a declared type, with its type-specific attributes.
#[derive(Clone, Debug, PartialEq)]
pub enum VariableKind {
    /// A 32-bit floating-point number in its unit.
    Float32(Float),
    /// A 64-bit floating-point number in its unit.
    Float64(Float),
    /// An integer, -128 to 127.
    Int8(Integer),
    /// An integer, 0 to 255.
    UInt8(Integer),
    /// A 16-bit integer.
    Int16(Integer),
    /// An unsigned 16-bit integer.
    UInt16(Integer),
    /// A 32-bit integer.
    Int32(Integer),
    /// An unsigned 32-bit integer.
    UInt32(Integer),
    /// A 64-bit integer.
    Int64(Integer),
    /// An unsigned 64-bit integer.
    UInt64(Integer),
    /// A Boolean.
    Boolean(Plain<bool>),
    /// A text.
    String(Plain<String>),
    /// Bytes.
    Binary(Binary),
    /// One of the items of its declared type.
    Enumeration(Integer),
    /// A clock.
    Clock(Clock),
}

impl VariableKind {
    /// The type without its attributes.
    pub const fn data_type(&self) -> DataType {
        match self {
            Self::Float32(_) => DataType::Float32,
            Self::Float64(_) => DataType::Float64,
            Self::Int8(_) => DataType::Int8,
            Self::UInt8(_) => DataType::UInt8,
            Self::Int16(_) => DataType::Int16,
            Self::UInt16(_) => DataType::UInt16,
            Self::Int32(_) => DataType::Int32,
            Self::UInt32(_) => DataType::UInt32,
            Self::Int64(_) => DataType::Int64,
            Self::UInt64(_) => DataType::UInt64,
            Self::Boolean(_) => DataType::Boolean,
            Self::String(_) => DataType::String,
            Self::Binary(_) => DataType::Binary,
            Self::Enumeration(_) => DataType::Enumeration,
            Self::Clock(_) => DataType::Clock,
        }
    }

    /// The attributes of a floating-point number.
    pub const fn as_float(&self) -> Option<&Float> {
        match self {
            Self::Float32(of) | Self::Float64(of) => Some(of),
            _ => None,
        }
    }

    /// The attributes of a floating-point number, mutable.
    pub const fn as_float_mut(&mut self) -> Option<&mut Float> {
        match self {
            Self::Float32(of) | Self::Float64(of) => Some(of),
            _ => None,
        }
    }

    /// The attributes of an integer or enumeration.
    pub const fn as_integer(&self) -> Option<&Integer> {
        match self {
            Self::Int8(of)
            | Self::UInt8(of)
            | Self::Int16(of)
            | Self::UInt16(of)
            | Self::Int32(of)
            | Self::UInt32(of)
            | Self::Int64(of)
            | Self::UInt64(of)
            | Self::Enumeration(of) => Some(of),
            _ => None,
        }
    }

    /// The attributes of an integer or enumeration, mutable.
    pub const fn as_integer_mut(&mut self) -> Option<&mut Integer> {
        match self {
            Self::Int8(of)
            | Self::UInt8(of)
            | Self::Int16(of)
            | Self::UInt16(of)
            | Self::Int32(of)
            | Self::UInt32(of)
            | Self::Int64(of)
            | Self::UInt64(of)
            | Self::Enumeration(of) => Some(of),
            _ => None,
        }
    }

    /// The unit; only of a floating-point number.
    pub fn unit(&self) -> Option<&str> {
        self.as_float()?.unit.as_deref()
    }

    /// The display unit; only of a floating-point number.
    pub fn display_unit(&self) -> Option<&str> {
        self.as_float()?.display_unit.as_deref()
    }

    /// `min` and `max` as doubles, rounded for integers; `None` for other types.
    pub fn range(&self) -> (Option<f64>, Option<f64>) {
        match (self.as_float(), self.as_integer()) {
            (Some(of), _) => (of.min, of.max),
            (_, Some(of)) => (of.min.map(|x| x as f64), of.max.map(|x| x as f64)),
            _ => (None, None),
        }
    }

    /// The number of start values.
    pub fn starts(&self) -> usize {
        match self {
            Self::Boolean(of) => of.start.len(),
            Self::String(of) => of.start.len(),
            Self::Binary(of) => of.start.len(),
            _ => self.start_numbers().len(),
        }
    }

    /// The start values as doubles: 64-bit integers are rounded, Booleans are 0 or 1. Empty for other types.
    pub fn start_numbers(&self) -> Vec<f64> {
        match (self, self.as_float(), self.as_integer()) {
            (Self::Boolean(of), ..) => of.start.iter().map(|&start| f64::from(u8::from(start))).collect(),
            (_, Some(of), _) => of.start.clone(),
            (_, _, Some(of)) => of.start.iter().map(|&start| start as f64).collect(),
            _ => Vec::new(),
        }
    }
}

/// The size of one dimension of an array. Exactly one of the two fields must be given.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Dimension {
    /// The number of elements, at least 1.
    pub start: Option<u64>,
    /// The value reference of the structural parameter or constant that holds the number of elements.
    pub value_reference: Option<u32>,
}

impl Dimension {
    /// A dimension of this many elements.
    pub const fn fixed(elements: u64) -> Self {
        Self { start: Some(elements), value_reference: None }
    }

    /// A dimension whose size is the value of the variable with this value reference.
    pub const fn of(value_reference: u32) -> Self {
        Self { start: None, value_reference: Some(value_reference) }
    }
}

/// Another name of a variable.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Alias {
    /// The name; unique among all variables and aliases, not empty, one line.
    pub name: String,
    /// Its meaning, as a text for the reader; if empty, the attribute is omitted.
    pub description: String,
    /// The name of a display unit of the variable's unit; only for a floating-point number.
    pub display_unit: Option<String>,
}

/// One variable of the FMU, a scalar or an array.
#[derive(Clone, Debug, PartialEq)]
pub struct Variable {
    /// The name; not empty, unique, one line, and of the form that the description's
    /// [`NamingConvention`](crate::NamingConvention) requires.
    pub name: String,
    /// The handle of the variable in the C interface; unique among all variables.
    pub value_reference: u32,
    /// Its meaning, as a text for the reader; if empty, the attribute is omitted.
    pub description: String,
    /// The role of the variable.
    pub causality: Causality,
    /// When its value may change; the pair with `causality` must be legal, see [`InitialRule::of_fmi3`].
    pub variability: Variability,
    /// How its first value is determined; `None` means the default of [`InitialRule::of_fmi3`].
    pub initial: Option<Initial>,
    /// The name of the type that provides omitted attributes; required for an enumeration.
    pub declared_type: Option<String>,
    /// Type, start values and range.
    pub kind: VariableKind,
    /// The sizes of an array, with the last dimension varying fastest; empty for a scalar.
    pub dimensions: Vec<Dimension>,
    /// Alternative names.
    pub aliases: Vec<Alias>,
    /// The value references of the clocks that it belongs to; empty if it is not clocked.
    pub clocks: Vec<u32>,
    /// The value reference of the previous value of a clocked state.
    pub previous: Option<u32>,
    /// Whether it can be read and set between communication points; default false.
    pub intermediate_update: bool,
    /// Whether an input may be set more than once at one instant; true if absent.
    pub can_handle_multiple_set: Option<bool>,
}

impl Variable {
    /// A scalar with defaults for everything else.
    pub fn new(
        name: impl Into<String>,
        value_reference: u32,
        causality: Causality,
        variability: Variability,
        kind: VariableKind,
    ) -> Self {
        Self {
            name: name.into(),
            value_reference,
            description: String::new(),
            causality,
            variability,
            initial: None,
            declared_type: None,
            kind,
            dimensions: Vec::new(),
            aliases: Vec::new(),
            clocks: Vec::new(),
            previous: None,
            intermediate_update: false,
            can_handle_multiple_set: None,
        }
    }

    /// The variability of a variable that does not declare one.
    pub fn default_variability(causality: Causality, of: DataType) -> Variability {
        match causality {
            Causality::Parameter | Causality::StructuralParameter | Causality::CalculatedParameter => {
                Variability::Fixed
            }
            _ if of.is_float() => Variability::Continuous,
            _ => Variability::Discrete,
        }
    }

    /// How the first value is determined, with the default of the standard filled in. `None` for clocks, the
    /// independent variable and illegal pairs of causality and variability.
    pub fn effective_initial(&self) -> Option<Initial> {
        if self.kind.data_type() == DataType::Clock {
            return None;
        }
        self.initial.or_else(|| InitialRule::of_fmi3(self.causality, self.variability)?.default)
    }

    /// Whether a start value is required; otherwise it is forbidden.
    pub fn needs_start(&self) -> bool {
        matches!(self.effective_initial(), Some(Initial::Exact | Initial::Approx))
    }

    /// Whether the first value is computed during initialization.
    pub fn is_computed(&self) -> bool {
        matches!(self.effective_initial(), Some(Initial::Approx | Initial::Calculated))
    }

    /// Whether the variable is an initial unknown independently of the states: an output with initial approx
    /// or calculated that is not clocked, or a calculated parameter.
    pub fn is_initial_unknown(&self) -> bool {
        match self.causality {
            Causality::Output => self.is_computed() && self.clocks.is_empty(),
            Causality::CalculatedParameter => true,
            _ => false,
        }
    }

    /// The value reference of the state whose derivative this is.
    pub fn state(&self) -> Option<u32> {
        self.kind.as_float()?.derivative
    }

    /// The sizes of the dimensions; `find` gives the variables that hold sizes.
    pub(crate) fn shape<'a>(&self, find: impl Fn(u32) -> Option<&'a Self>) -> Option<Vec<u64>> {
        let size = |dimension: &Dimension| match (dimension.start, dimension.value_reference) {
            (Some(size), None) => Some(size),
            (None, Some(reference)) => {
                let start = &find(reference)?.kind.as_integer()?.start;
                u64::try_from(*start.first()?).ok()
            }
            _ => None,
        };
        self.dimensions.iter().map(size).collect()
    }
}
