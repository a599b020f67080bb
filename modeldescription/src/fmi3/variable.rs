//! Variables of FMI 3.0: scalars and arrays of fifteen types (FMI 3.0.2, section 2.4.7).

use crate::words::words;
use crate::{Causality, Initial, InitialRule, Variability};

/// The types, with their words and those of the elements that declare one.
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
    /// A number of 32 bits.
    Float32,
    /// A number of 64 bits.
    Float64,
    /// An integer, -128 to 127.
    Int8,
    /// An integer, 0 to 255.
    UInt8,
    /// An integer of 16 bits.
    Int16,
    /// An integer of 16 bits, not negative.
    UInt16,
    /// An integer of 32 bits.
    Int32,
    /// An integer of 32 bits, not negative.
    UInt32,
    /// An integer of 64 bits.
    Int64,
    /// An integer of 64 bits, not negative; the type of sizes of arrays.
    UInt64,
    /// A truth value.
    Boolean,
    /// A text, UTF-8.
    String,
    /// Bytes.
    Binary,
    /// An integer of 64 bits with named values.
    Enumeration,
    /// A clock, which ticks.
    Clock
}

impl DataType {
    /// Whether the type is one of floating-point numbers.
    pub const fn is_float(self) -> bool {
        matches!(self, Self::Float32 | Self::Float64)
    }

    /// The least and the greatest value of an integer type or enumeration; of other types none.
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

/// The attributes of a `Float32` or `Float64`. Of a declared type those of the variable alone (`start`,
/// `derivative`, `reinit`) stay empty.
///
/// Numbers of a `Float32` are held as doubles that a number of 32 bits can be.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Float {
    /// The physical quantity, for example `Acceleration`; one line.
    pub quantity: Option<String>,
    /// The name of one of [`ModelDescription::units`](super::ModelDescription::units).
    pub unit: Option<String>,
    /// The name of one of the display units of `unit`.
    pub display_unit: Option<String>,
    /// Offsets of units do not count, as in differences of temperature; default false.
    pub relative_quantity: bool,
    /// The value grows without bound, so its size says nothing about errors; default false.
    pub unbounded: bool,
    /// Smallest allowed value, in `unit`; not NaN and not `INF`; absent: no limit.
    pub min: Option<f64>,
    /// Largest allowed value, in `unit`; at least `min`, not NaN and not `-INF`; absent: no limit.
    pub max: Option<f64>,
    /// Typical magnitude, in `unit`; finite and greater than 0.
    pub nominal: Option<f64>,
    /// First values or first guesses, in `unit`; empty: none. One stands for all elements of an array.
    pub start: Vec<f64>,
    /// The value reference of the variable that this is the time derivative of.
    pub derivative: Option<u32>,
    /// A continuous state that its FMU may set at events; for model exchange, default false.
    pub reinit: bool,
}

/// The attributes of an integer type or an enumeration. Of a declared type `start` stays empty.
///
/// All values lie within [`DataType::limits`].
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Integer {
    /// The physical quantity; one line.
    pub quantity: Option<String>,
    /// Smallest allowed value, dimensionless; absent: no limit.
    pub min: Option<i128>,
    /// Largest allowed value, at least `min`; absent: no limit.
    pub max: Option<i128>,
    /// First values or first guesses; empty: none. One stands for all elements of an array.
    pub start: Vec<i128>,
}

/// The attributes of a `Boolean` or `String`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Plain<T> {
    /// First values or first guesses; empty: none. One stands for all elements of an array.
    pub start: Vec<T>,
}

/// The attributes of a `Binary`. Of a declared type `start` stays empty.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Binary {
    /// The media type of the bytes; absent: `application/octet-stream`.
    pub mime_type: Option<String>,
    /// The greatest length, in bytes; absent: no limit.
    pub max_size: Option<u64>,
    /// First values; empty: none. One stands for all elements of an array.
    pub start: Vec<Vec<u8>>,
}

/// The way that the interval of a clock is given.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum IntervalVariability {
    /// Given in the description.
    Constant,
    /// Given before initialization.
    Fixed,
    /// Changed by tunable parameters.
    Tunable,
    /// Given again at each tick.
    Changing,
    /// Given at some events, as the time to the next tick.
    Countdown,
    /// Not known before it ticks.
    Triggered,
}

words!(IntervalVariability: Constant "constant", Fixed "fixed", Tunable "tunable", Changing "changing",
    Countdown "countdown", Triggered "triggered");

/// The attributes of a `Clock`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Clock {
    /// The importer may leave out ticks; default false.
    pub can_be_deactivated: bool,
    /// The order among clocks of scheduled execution, 0 first.
    pub priority: Option<u32>,
    /// How its interval is given; must be there.
    pub interval_variability: Option<IntervalVariability>,
    /// The interval, in seconds.
    pub interval_decimal: Option<f64>,
    /// The time of the first tick, in seconds; default 0.
    pub shift_decimal: f64,
    /// The interval can be given as a fraction; default false.
    pub supports_fraction: bool,
    /// The denominator of fractions, in ticks per second.
    pub resolution: Option<u64>,
    /// The numerator of the interval, dimensionless.
    pub interval_counter: Option<u64>,
    /// The numerator of the time of the first tick, dimensionless; default 0.
    pub shift_counter: u64,
}

/// The type of a variable, or a declared type, with the attributes that depend on it.
#[derive(Clone, Debug, PartialEq)]
pub enum VariableKind {
    /// A number of 32 bits in its unit.
    Float32(Float),
    /// A number of 64 bits in its unit.
    Float64(Float),
    /// An integer, -128 to 127.
    Int8(Integer),
    /// An integer, 0 to 255.
    UInt8(Integer),
    /// An integer of 16 bits.
    Int16(Integer),
    /// An integer of 16 bits, not negative.
    UInt16(Integer),
    /// An integer of 32 bits.
    Int32(Integer),
    /// An integer of 32 bits, not negative.
    UInt32(Integer),
    /// An integer of 64 bits.
    Int64(Integer),
    /// An integer of 64 bits, not negative.
    UInt64(Integer),
    /// A truth value.
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
    /// The type alone.
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

    /// The attributes of a floating-point number, to change.
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

    /// The attributes of an integer or enumeration, to change.
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

    /// The unit; of a floating-point number only.
    pub fn unit(&self) -> Option<&str> {
        self.as_float()?.unit.as_deref()
    }

    /// The display unit; of a floating-point number only.
    pub fn display_unit(&self) -> Option<&str> {
        self.as_float()?.display_unit.as_deref()
    }

    /// `min` and `max` as doubles, those of integers rounded; of other types none.
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

    /// The start values as doubles, those of 64-bit integers rounded and of a Boolean 0 or 1; of other types none.
    pub fn start_numbers(&self) -> Vec<f64> {
        match (self, self.as_float(), self.as_integer()) {
            (Self::Boolean(of), ..) => of.start.iter().map(|&start| f64::from(u8::from(start))).collect(),
            (_, Some(of), _) => of.start.clone(),
            (_, _, Some(of)) => of.start.iter().map(|&start| start as f64).collect(),
            _ => Vec::new(),
        }
    }
}

/// The size of one dimension of an array: exactly one of both must be given.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Dimension {
    /// The number of elements, at least 1.
    pub start: Option<u64>,
    /// The value reference of the structural parameter or constant that has the number of elements.
    pub value_reference: Option<u32>,
}

impl Dimension {
    /// A dimension of this many elements.
    pub const fn fixed(elements: u64) -> Self {
        Self { start: Some(elements), value_reference: None }
    }

    /// A dimension with as many elements as the variable of this value reference says.
    pub const fn of(value_reference: u32) -> Self {
        Self { start: None, value_reference: Some(value_reference) }
    }
}

/// Another name of a variable.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Alias {
    /// The name; unique among all variables and aliases, not empty, one line.
    pub name: String,
    /// Meaning for a human; empty: the attribute is absent.
    pub description: String,
    /// The name of a display unit of the variable's unit; of a floating-point number only.
    pub display_unit: Option<String>,
}

/// One variable of the FMU, a scalar or an array.
#[derive(Clone, Debug, PartialEq)]
pub struct Variable {
    /// The name; not empty, unique, one line, and of the form that the description's
    /// [`NamingConvention`](crate::NamingConvention) asks for.
    pub name: String,
    /// The handle of the variable in the C interface; unique among all variables.
    pub value_reference: u32,
    /// Meaning for a human; empty: the attribute is absent.
    pub description: String,
    /// The role of the variable.
    pub causality: Causality,
    /// The instants at which it may change; the pair with `causality` must be legal, see [`InitialRule::of_fmi3`].
    pub variability: Variability,
    /// The origin of its first value; `None`: the default of [`InitialRule::of_fmi3`].
    pub initial: Option<Initial>,
    /// The name of the type that gives the attributes that are not given here; of an enumeration it must be there.
    pub declared_type: Option<String>,
    /// Type, start values and range.
    pub kind: VariableKind,
    /// The sizes of an array, the last one running fastest; empty: a scalar.
    pub dimensions: Vec<Dimension>,
    /// Other names of the same variable.
    pub aliases: Vec<Alias>,
    /// The value references of the clocks that it belongs to; empty: not clocked.
    pub clocks: Vec<u32>,
    /// The value reference of the previous value of a clocked state.
    pub previous: Option<u32>,
    /// It can be read and set between communication points; default false.
    pub intermediate_update: bool,
    /// An input that may be set more than once at one instant; absent: true.
    pub can_handle_multiple_set: Option<bool>,
}

impl Variable {
    /// A scalar with everything else left out.
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

    /// The variability of a variable that does not say its own.
    pub fn default_variability(causality: Causality, of: DataType) -> Variability {
        match causality {
            Causality::Parameter | Causality::StructuralParameter | Causality::CalculatedParameter => {
                Variability::Fixed
            }
            _ if of.is_float() => Variability::Continuous,
            _ => Variability::Discrete,
        }
    }

    /// The origin of the first value, with the default of the standard filled in. `None` for clocks, the independent
    /// variable and illegal pairs of causality and variability.
    pub fn effective_initial(&self) -> Option<Initial> {
        if self.kind.data_type() == DataType::Clock {
            return None;
        }
        self.initial.or_else(|| InitialRule::of_fmi3(self.causality, self.variability)?.default)
    }

    /// Whether a start value is required; where it is not, it is forbidden.
    pub fn needs_start(&self) -> bool {
        matches!(self.effective_initial(), Some(Initial::Exact | Initial::Approx))
    }

    /// Whether the first value is computed in initialization.
    pub fn is_computed(&self) -> bool {
        matches!(self.effective_initial(), Some(Initial::Approx | Initial::Calculated))
    }

    /// Whether the variable belongs to the initial unknowns whatever the states are: outputs with initial approx or
    /// calculated that are not clocked, and calculated parameters.
    pub fn is_initial_unknown(&self) -> bool {
        match self.causality {
            Causality::Output => self.is_computed() && self.clocks.is_empty(),
            Causality::CalculatedParameter => true,
            _ => false,
        }
    }

    /// The value reference of the state that this is the derivative of.
    pub fn state(&self) -> Option<u32> {
        self.kind.as_float()?.derivative
    }

    /// The sizes of the dimensions, with `find` for the variables that have them.
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
