//! Serialises a snapshot of an instance.
//!
//! | bytes | content |
//! |---|---|
//! | 8 | `PUNCTUAL` |
//! | 4 | version of this layout |
//! | 38 | the GUID of the FMU, as in its model description |
//! | 8 | total length |
//! | … | the fields of [`State`]: mode, time, flags, values in the order of the table, memory of the block |
//! | 8 + … | if plans are followed, or inputs may act late: length and content, in the format of the crate postcard, of the inputs on their way and the plan state |
//! | 4 | CRC-32 of everything before |
//!
//! Numbers are stored bitwise, in little-endian order. A field has the same offset in every state of an FMU;
//! absent optional fields keep their space. Only that has variable length, and it comes last. Damaged
//! bytes, and those of another FMU, are refused with the name of the field.

use punctual_core::convergence::{FixedTimeState, Phase, Unmet};
use punctual_core::filter::{Curvature, FilterState, PlanState, Sent};
use punctual_modeldescription::BaseType;

use crate::block::{BlockState, Values};
use crate::configuration::{Configuration, FmiVersion};
use crate::instance::{Failure, Mode, State};
use crate::product::Product;

const MAGIC: [u8; 8] = *b"PUNCTUAL";

/// Version of the layout, to be increased with every change of it. (The GUID changes with the version of the
/// library.)
const VERSION: u32 = 14;

const GUID: usize = 38;
const HEADER: usize = MAGIC.len() + u32::SIZE + GUID + u64::SIZE;
const CHECKSUM: usize = u32::SIZE;

/// The number of bytes of `state`, a state of `product`. Without a plan and a delay, it is the same for all of them.
///
/// # Errors
///
/// None in practice, since the memory of a filter is plain data.
pub fn size(product: &Product, state: &State) -> Result<usize, Failure> {
    let tail = if has_tail(product) { u64::SIZE + tail(product, state)?.len() } else { 0 };
    Ok(fixed_size(product) + tail)
}

/// Whether a state of `product` has a stop time; in FMI 2.0 it has none.
fn has_stop(product: &Product) -> bool {
    product.configuration.experiment().fmi == FmiVersion::Three
}

fn follows_plans(product: &Product) -> bool {
    matches!(&product.configuration, Configuration::Filter(c) if c.is_assured())
}

/// Whether states of `product` have a part of variable length.
fn has_tail(product: &Product) -> bool {
    follows_plans(product) || matches!(&product.configuration, Configuration::Filter(c) if c.may_be_late())
}

/// The inputs on their way, and the plan state.
type Tail = (Vec<Sent>, PlanState);

/// The bytes of these in `state`, a state of `product`; without plans, of the former alone.
fn tail(product: &Product, state: &State) -> Result<Vec<u8>, Failure> {
    match &state.block {
        BlockState::Filter { memory, .. } if follows_plans(product) => {
            postcard::to_stdvec(&(&memory.sent, &memory.plan))
        }
        BlockState::Filter { memory, .. } => postcard::to_stdvec(&memory.sent),
        _ => postcard::to_stdvec(&Tail::default()),
    }
    .map_err(|e| e.to_string())
}

/// The number of bytes of every state of `product`, without that part.
fn fixed_size(product: &Product) -> usize {
    let flags = Mode::SIZE + 2 * f64::SIZE + 3 * bool::SIZE;
    let value = |base| match base {
        BaseType::Real => f64::SIZE,
        BaseType::Boolean => bool::SIZE,
        BaseType::Integer => i32::SIZE,
        BaseType::String => 0,
    };
    let values: usize = product.variables.iter().map(|v| value(v.kind.base_type())).sum();
    let block = match &product.configuration {
        Configuration::Filter(c) => {
            bool::SIZE
                + c.barrier.len() * FixedTimeState::SIZE
                + 3 * <Option<f64>>::SIZE
                + Inputs::SIZE
                + Curvatures::SIZE
                + f64::SIZE
        }
        Configuration::Plant(_) => product.layout.states * f64::SIZE,
        Configuration::Controller(_) => u32::SIZE,
    };
    let stop = if has_stop(product) { f64::SIZE } else { 0 };
    HEADER + flags + stop + values + block + CHECKSUM
}

/// Writes a state of `product` to the first [`size`] bytes of `bytes` and zeros to the rest.
///
/// # Errors
///
/// Too few bytes; the state of another product. Nothing was written.
pub fn write(product: &Product, state: &State, bytes: &mut [u8]) -> Result<(), Failure> {
    let State { guid, mode, time, stop, stepped, last_step, fresh, configured, values, block } = state;
    let tail = has_tail(product).then(|| tail(product, state)).transpose()?;
    let size = fixed_size(product) + tail.as_ref().map_or(0, |tail| u64::SIZE + tail.len());
    if bytes.len() < size {
        return Err(format!("there is room for {} bytes, must be {size}", bytes.len()));
    }
    check_guid(product, guid.as_bytes())?;
    // The header.
    let mut out = Vec::with_capacity(size);
    out.extend_from_slice(&MAGIC);
    VERSION.write(&mut out);
    out.extend_from_slice(guid.as_bytes());
    (size as u64).write(&mut out);
    // The fields of the instance, and the values in the order of the table.
    mode.write(&mut out);
    time.write(&mut out);
    if has_stop(product) {
        stop.write(&mut out);
    }
    stepped.write(&mut out);
    last_step.write(&mut out);
    fresh.write(&mut out);
    configured.write(&mut out);
    for (i, variable) in product.variables.iter().enumerate() {
        match variable.kind.base_type() {
            BaseType::Real => values.reals[i].write(&mut out),
            BaseType::Boolean => values.booleans[i].write(&mut out),
            BaseType::Integer => values.integers[i].write(&mut out),
            BaseType::String => {}
        }
    }
    // The memory of the block.
    match block {
        BlockState::Filter { rearm_seen, memory } => {
            let FilterState {
                barriers,
                time,
                period,
                input,
                start,
                curvatures,
                integrated,
                sent: _,
                plan: _,
            } = &**memory;
            rearm_seen.write(&mut out);
            barriers.iter().for_each(|barrier| barrier.write(&mut out));
            time.write(&mut out);
            period.write(&mut out);
            input.write(&mut out);
            start.write(&mut out);
            curvatures.write(&mut out);
            integrated.write(&mut out);
            if let Some(tail) = tail {
                (tail.len() as u64).write(&mut out);
                out.extend_from_slice(&tail);
            }
        }
        BlockState::Plant { x } => x.iter().for_each(|x| x.write(&mut out)),
        BlockState::Controller { waypoint } => waypoint.write(&mut out),
    }
    // The checksum, and everything at once.
    let checksum = crc32(&out);
    checksum.write(&mut out);
    if out.len() != size {
        return Err(format!("the state has {} bytes, must have {size}", out.len()));
    }
    let (state, rest) = bytes.split_at_mut(size);
    state.copy_from_slice(&out);
    rest.fill(0);
    Ok(())
}

/// The state of `product` that [`write()`] wrote.
///
/// # Errors
///
/// Bytes that are not such a state; the message gives the field, the value found and those allowed.
pub fn read(product: &Product, bytes: &[u8]) -> Result<State, Failure> {
    // The header: does it belong to a state of this product, and is it complete?
    let fixed = fixed_size(product);
    let mut input = Reader { rest: bytes };
    if input.take("magic number", MAGIC.len())? != MAGIC {
        return Err("the bytes do not begin as a state does, with \"PUNCTUAL\"".to_owned());
    }
    let version: u32 = input.field("version")?;
    if version != VERSION {
        return Err(format!("the version of the layout is {version}, must be {VERSION}"));
    }
    check_guid(product, input.take("GUID", GUID)?)?;
    let length: u64 = input.field("length")?;
    let has_tail = has_tail(product);
    if !has_tail && length != fixed as u64 || length < fixed as u64 {
        let least = if has_tail { "at least " } else { "" };
        return Err(format!("the length is {length} bytes, must be {least}{fixed}"));
    }
    let size = usize::try_from(length).unwrap_or(usize::MAX);
    let (state, rest) = bytes
        .split_at_checked(size)
        .ok_or_else(|| format!("the state is cut off: there are {} bytes, must be {size}", bytes.len()))?;
    if let Some(at) = rest.iter().position(|byte| *byte != 0) {
        return Err(format!("byte {} after the state is {}, must be 0", size + at, rest[at]));
    }
    // The checksum.
    let (content, checksum) = state.split_at(size - CHECKSUM);
    let found: u32 = Reader { rest: checksum }.field("checksum")?;
    let wanted = crc32(content);
    if found != wanted {
        return Err(format!("the checksum is {found:08x}, must be {wanted:08x}: the bytes are damaged"));
    }

    // The fields of the instance, and the values in the order of the table.
    let mut input = Reader { rest: &content[HEADER..] };
    let mode: Mode = input.field("mode")?;
    let time = input.finite("time")?;
    let stop = if has_stop(product) { input.field("stop")? } else { f64::INFINITY };
    if stop.is_nan() {
        return Err(format!("stop is {stop}, must be a number"));
    }
    let stepped = input.field("stepped")?;
    let last_step = input.finite("last_step")?;
    let fresh = input.field("fresh")?;
    let configured: bool = input.field("configured")?;
    if !configured && !mode.is_in(Mode::INSTANTIATED.or(Mode::INITIALIZATION)) {
        return Err(format!("configured: is false, must be true in the mode {:?}", mode.name()));
    }
    let values = read_values(product, &mut input)?;
    // The memory of the block.
    let block = match &product.configuration {
        Configuration::Filter(c) => {
            let rearm_seen = input.field("rearm_seen")?;
            let barriers = c.barrier.iter().map(|b| input.field(&b.name)).collect::<Result<_, _>>()?;
            let mut memory = FilterState {
                barriers,
                time: input.field("filter time")?,
                period: input.field("period")?,
                input: input.field("input")?,
                start: input.field("start")?,
                curvatures: input.field("curvatures")?,
                integrated: input.finite("integrated")?,
                ..FilterState::default()
            };
            if has_tail {
                (memory.sent, memory.plan) = read_tail(product, &mut input)?;
            }
            BlockState::Filter { rearm_seen, memory: Box::new(memory) }
        }
        Configuration::Plant(_) => {
            let x = (0..product.layout.states).map(|_| input.finite("x")).collect::<Result<_, _>>()?;
            BlockState::Plant { x }
        }
        Configuration::Controller(c) => {
            let (waypoint, points) = (input.field("waypoint")?, c.points().len().max(1));
            if waypoint as usize >= points {
                return Err(format!("waypoint: is {waypoint}, must be < {points}"));
            }
            BlockState::Controller { waypoint }
        }
    };
    let guid = product.guid.clone();
    Ok(State { guid, mode, time, stop, stepped, last_step, fresh, configured, values, block })
}

/// What comes last. Whether it belongs to this filter is checked when it is restored.
fn read_tail(product: &Product, input: &mut Reader) -> Result<Tail, Failure> {
    let length: u64 = input.field("length of the plan")?;
    if length != input.rest.len() as u64 {
        return Err(format!("the length of the plan is {length} bytes, must be {}", input.rest.len()));
    }
    let read = match follows_plans(product) {
        true => postcard::take_from_bytes(input.rest),
        false => {
            postcard::take_from_bytes(input.rest).map(|(sent, rest)| ((sent, PlanState::default()), rest))
        }
    };
    match read {
        Ok((tail, [])) => Ok(tail),
        Ok((_, rest)) => Err(format!("the plan is followed by {} bytes, must be 0", rest.len())),
        Err(error) => Err(format!("the plan cannot be read: {error}")),
    }
}

fn read_values(product: &Product, input: &mut Reader) -> Result<Values, Failure> {
    let mut values = Values::zeros(product.variables.len());
    for (i, variable) in product.variables.iter().enumerate() {
        let name = &variable.name;
        match variable.kind.base_type() {
            BaseType::Real => values.reals[i] = input.field(name)?,
            BaseType::Boolean => values.booleans[i] = input.field(name)?,
            BaseType::Integer => values.integers[i] = input.field(name)?,
            BaseType::String => {}
        }
        if let Some(range) = i.checked_sub(product.layout.parameters).and_then(|p| product.ranges.get(p)) {
            range.check(name, values.reals[i]).map_err(|e| e.to_string())?;
        }
    }
    Ok(values)
}

fn check_guid(product: &Product, found: &[u8]) -> Result<(), Failure> {
    if found == product.guid.as_bytes() {
        return Ok(());
    }
    let found = String::from_utf8_lossy(found);
    Err(format!("the state belongs to the FMU with the GUID {found:?}, must be {:?}", product.guid))
}

/// CRC-32 as in Ethernet and zip.
fn crc32(bytes: &[u8]) -> u32 {
    const POLYNOMIAL: u32 = 0xedb8_8320;
    !bytes.iter().fold(!0, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| (crc >> 1) ^ (POLYNOMIAL * (crc & 1)))
    })
}

/// The bytes still to be read.
struct Reader<'a> {
    rest: &'a [u8],
}

impl<'a> Reader<'a> {
    fn take(&mut self, name: &str, len: usize) -> Result<&'a [u8], Failure> {
        let (taken, rest) = self.rest.split_at_checked(len).ok_or_else(|| {
            format!("the state is cut off in the {name}: {} bytes of {len}", self.rest.len())
        })?;
        self.rest = rest;
        Ok(taken)
    }

    fn field<T: Field>(&mut self, name: &str) -> Result<T, Failure> {
        T::read(self).map_err(|failure| format!("{name}: {failure}"))
    }

    fn finite(&mut self, name: &str) -> Result<f64, Failure> {
        let value: f64 = self.field(name)?;
        if value.is_finite() { Ok(value) } else { Err(format!("{name} is {value}, must be finite")) }
    }
}

/// A field of fixed size.
trait Field: Sized {
    const SIZE: usize;
    fn write(&self, out: &mut Vec<u8>);
    fn read(input: &mut Reader) -> Result<Self, Failure>;
}

macro_rules! numbers {
    ($($kind:ty),*) => {$(
        impl Field for $kind {
            const SIZE: usize = size_of::<Self>();

            fn write(&self, out: &mut Vec<u8>) {
                out.extend_from_slice(&self.to_le_bytes());
            }

            fn read(input: &mut Reader) -> Result<Self, Failure> {
                let mut bytes = [0; size_of::<Self>()];
                bytes.copy_from_slice(input.take("number", Self::SIZE)?);
                Ok(Self::from_le_bytes(bytes))
            }
        }
    )*};
}

numbers!(u8, i32, u32, u64, f64);

impl Field for bool {
    const SIZE: usize = 1;

    fn write(&self, out: &mut Vec<u8>) {
        out.push(u8::from(*self));
    }

    fn read(input: &mut Reader) -> Result<Self, Failure> {
        match u8::read(input)? {
            0 => Ok(false),
            1 => Ok(true),
            other => Err(format!("is {other}, must be 0 or 1")),
        }
    }
}

/// The number of a phase, as one byte.
impl Field for Phase {
    const SIZE: usize = 1;

    fn write(&self, out: &mut Vec<u8>) {
        out.push(*self as u8);
    }

    fn read(input: &mut Reader) -> Result<Self, Failure> {
        let number = u8::read(input)?;
        let known = Self::ALL.into_iter().find(|phase| *phase as u8 == number);
        known.ok_or_else(|| format!("is {number}, which is not a Phase"))
    }
}

impl Field for Mode {
    const SIZE: usize = 1;

    fn write(&self, out: &mut Vec<u8>) {
        // A number that is not a mode is refused when it is read.
        let index = Self::EACH.iter().position(|mode| mode == self).unwrap_or(Self::EACH.len());
        out.push(index as u8);
    }

    fn read(input: &mut Reader) -> Result<Self, Failure> {
        let index = u8::read(input)?;
        let mode = Self::EACH.get(usize::from(index));
        mode.copied().ok_or_else(|| format!("is {index}, must be < {}", Self::EACH.len()))
    }
}

impl<T: Field> Field for Option<T> {
    const SIZE: usize = bool::SIZE + T::SIZE;

    fn write(&self, out: &mut Vec<u8>) {
        self.is_some().write(out);
        match self {
            Some(value) => value.write(out),
            None => out.resize(out.len() + T::SIZE, 0),
        }
    }

    fn read(input: &mut Reader) -> Result<Self, Failure> {
        let there = bool::read(input)?;
        let mut value = Reader { rest: input.take("value", T::SIZE)? };
        there.then(|| T::read(&mut value)).transpose()
    }
}

impl<T: Field + Copy + Default, const N: usize> Field for [T; N] {
    const SIZE: usize = N * T::SIZE;

    fn write(&self, out: &mut Vec<u8>) {
        self.iter().for_each(|value| value.write(out));
    }

    fn read(input: &mut Reader) -> Result<Self, Failure> {
        let mut values = [T::default(); N];
        for value in &mut values {
            *value = T::read(input)?;
        }
        Ok(values)
    }
}

/// The type of `FilterState::input`.
type Inputs = [f64; punctual_core::MAX_INPUTS];

/// The type of `FilterState::curvatures`.
type Curvatures = [Option<Curvature>; 2];

/// Writes and reads structures field by field. A field that is missing here, or has another type, does not
/// compile.
macro_rules! structure {
    ($kind:ident { $($field:ident: $type:ty),* $(,)? }) => {
        impl Field for $kind {
            const SIZE: usize = 0 $(+ <$type>::SIZE)*;

            fn write(&self, out: &mut Vec<u8>) {
                let Self { $($field),* } = self;
                $(<$type>::write($field, out);)*
            }

            fn read(input: &mut Reader) -> Result<Self, Failure> {
                Ok(Self { $($field: input.field::<$type>(stringify!($field))?),* })
            }
        }
    };
}

structure!(Curvature { barrier: u32, hessian: [f64; 6], looked: u32, sideways: Option<u32> });

structure!(Unmet { steps: u32, since: f64, h: f64 });

structure!(FixedTimeState {
    phase: Phase,
    start_time: Option<f64>,
    anchor_time: f64,
    deadline: f64,
    recoveries: u32,
    anchor: [f64; punctual_core::MAX_RELATIVE_DEGREE],
    rate: f64,
    stay_rate: f64,
    stay_margin: f64,
    pull: f64,
    gain: f64,
    margin: f64,
    least_margin: f64,
    period: f64,
    fallback: bool,
    arrival: Option<f64>,
    since: Option<f64>,
    on_course: bool,
    unmet: Option<Unmet>,
    postponed: u32,
});
