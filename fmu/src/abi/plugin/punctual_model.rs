//! A Punctual plug-in with a plant and barriers in Rust: `punctual_model.h` for Rust, in one file to copy.
//!
//! Implement [`Model`] and name it in [`export!`]; `docs/plugin.md` and `examples/plugin/arm.rs` show how.
//! The header explains what numbers are, what functions must not do, and what is checked when a model is
//! loaded. If a function panics, its results become NaN.
//!
//! Requires Rust 1.85 and no crates: `rustc --edition 2024 -O --crate-type cdylib arm.rs`.

#![allow(dead_code)]

use std::ffi::{CStr, c_char, c_void};
use std::ops::{Add, Div, Mul, Neg, Sub};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::ptr::null;

/// The version of the interface.
pub const ABI: u32 = 1;
/// Most states.
const MAX_STATES: usize = 64;
/// The id that stands for the literal.
const LITERAL: u32 = u32::MAX;

/// The host's calculator, which performs the operations.
#[repr(C)]
pub struct Calculator {
    pub(super) host: *mut c_void,
    pub(super) apply: unsafe extern "C" fn(*mut c_void, u32, u32, u32, f64) -> u32,
    pub(super) value: unsafe extern "C" fn(*mut c_void, u32) -> f64,
}

/// A number in a computation of the host.
#[derive(Clone, Copy)]
pub struct Number<'c> {
    id: u32,
    calculator: &'c Calculator,
}

impl<'c> Number<'c> {
    fn apply(self, operation: u32, a: u32, b: u32, literal: f64) -> Self {
        // SAFETY: the host passes a calculator that is valid during the call, and no number outlives the
        // call.
        let id = unsafe { (self.calculator.apply)(self.calculator.host, operation, a, b, literal) };
        Self { id, ..self }
    }

    fn of(self, operation: u32) -> Self {
        self.apply(operation, self.id, self.id, 0.0)
    }

    fn with(self, operation: u32, other: Self) -> Self {
        self.apply(operation, self.id, other.id, 0.0)
    }

    /// A number that does not depend on x or t.
    pub fn constant(self, value: f64) -> Self {
        self.apply(0, LITERAL, LITERAL, value)
    }

    /// The plain value, for branching and table lookup. A number computed from it has no derivatives.
    pub fn value(self) -> f64 {
        // SAFETY: as in `apply`.
        unsafe { (self.calculator.value)(self.calculator.host, self.id) }
    }

    /// Raises to the power of a number that does not depend on x or t.
    pub fn powf(self, exponent: f64) -> Self {
        self.apply(5, self.id, LITERAL, exponent)
    }

    /// A function given by its value and derivatives, of orders 0, 1, …, at [`Self::value`]. A relative
    /// degree of n needs n + 3 of them, backup plans need ten. Between the instants that a plan evaluates,
    /// nothing is known of it.
    pub fn function(self, derivatives: &[f64]) -> Self {
        let away = self - self.value();
        let mut factorial: f64 = (1..derivatives.len()).map(|k| k as f64).product();
        let mut sum = self.constant(0.0);
        for (k, derivative) in derivatives.iter().enumerate().rev() {
            let term = derivative / factorial;
            sum = if k + 1 == derivatives.len() { self.constant(term) } else { sum * away + term };
            factorial /= k.max(1) as f64;
        }
        sum
    }
}

macro_rules! functions {
    ($($name:ident $operation:literal)*) => {impl<'c> Number<'c> {$(
        /// The function with this name.
        pub fn $name(self) -> Self {
            self.of($operation)
        }
    )*}};
}

functions! { sqrt 7 exp 8 ln 9 sin 10 cos 11 tan 12 atan 13 abs 15 tanh 16 }

macro_rules! functions_of_two {
    ($($name:ident $operation:literal)*) => {impl<'c> Number<'c> {$(
        /// The function with this name.
        pub fn $name(self, other: Self) -> Self {
            self.with($operation, other)
        }
    )*}};
}

functions_of_two! { atan2 14 min 17 max 18 }

macro_rules! operators {
    ($($trait:ident $method:ident $operation:literal)*) => {$(
        impl<'c> $trait for Number<'c> {
            type Output = Self;

            fn $method(self, other: Self) -> Self {
                self.with($operation, other)
            }
        }

        impl<'c> $trait<f64> for Number<'c> {
            type Output = Self;

            fn $method(self, literal: f64) -> Self {
                self.apply($operation, self.id, LITERAL, literal)
            }
        }

        impl<'c> $trait<Number<'c>> for f64 {
            type Output = Number<'c>;

            fn $method(self, other: Number<'c>) -> Number<'c> {
                other.apply($operation, LITERAL, other.id, self)
            }
        }
    )*};
}

operators! { Add add 1 Sub sub 2 Mul mul 3 Div div 4 }

impl Neg for Number<'_> {
    type Output = Self;

    fn neg(self) -> Self {
        self.of(6)
    }
}

/// The output of a function, initially zero.
pub struct Output<'a> {
    ids: &'a mut [u32],
    states: usize,
}

impl Output<'_> {
    /// Component `i` of f.
    pub fn set(&mut self, i: usize, value: Number<'_>) {
        self.ids[i] = value.id;
    }

    /// Row `i` (a state) and column `j` (an input) of g.
    pub fn set_at(&mut self, i: usize, j: usize, value: Number<'_>) {
        self.ids[i + j * self.states] = value.id;
    }
}

/// A state, input, parameter or barrier.
#[repr(C)]
pub struct Variable {
    pub(super) name: *const c_char,
    pub(super) unit: *const c_char,
    pub(super) description: *const c_char,
    pub(super) minimum: f64,
    pub(super) maximum: f64,
    pub(super) start: f64,
}

// SAFETY: the texts are constants.
unsafe impl Sync for Variable {}

impl Variable {
    /// A variable with a name, a C identifier, a unit such as `m/s2`, and a description.
    pub const fn new(name: &'static CStr, unit: &'static CStr, description: &'static CStr) -> Self {
        let (name, unit, description) = (name.as_ptr(), unit.as_ptr(), description.as_ptr());
        Self { name, unit, description, minimum: 0.0, maximum: 0.0, start: 0.0 }
    }

    /// Sets a range; an infinite end means no limit.
    #[must_use]
    pub const fn within(self, minimum: f64, maximum: f64) -> Self {
        Self { minimum, maximum, ..self }
    }

    /// Sets a default value, which makes it a parameter.
    #[must_use]
    pub const fn start(self, start: f64) -> Self {
        Self { start, ..self }
    }
}

/// A model `ẋ = f(x) + g(x) u` with barriers.
pub trait Model {
    /// The states, at most 64.
    const STATES: &'static [Variable];
    /// The inputs, at most 32.
    const INPUTS: &'static [Variable];
    /// The parameters, with their defaults. Default: none.
    const PARAMETERS: &'static [Variable] = &[];
    /// The barriers, in the order of the index of [`Self::barrier`]. Default: none.
    const BARRIERS: &'static [Variable] = &[];

    /// Prepares the model before anything else. It is called for every instance, possibly while others run.
    /// So work that must be done only once needs a `OnceLock` (`get_or_init`).
    ///
    /// # Errors
    ///
    /// The reason why the model cannot be used.
    fn initialize() -> Result<(), &'static CStr> {
        Ok(())
    }

    /// Writes f(x) and g(x).
    fn plant<'c>(parameters: &[f64], x: &[Number<'c>], f: &mut Output<'_>, g: &mut Output<'_>);

    /// Barrier `index` at time `t` and state `x`.
    fn barrier<'c>(index: usize, parameters: &[f64], t: Number<'c>, x: &[Number<'c>]) -> Number<'c>;
}

/// The function of a plant. Arguments: calculator, parameters, x, f, g.
pub(super) type PlantFunction =
    unsafe extern "C" fn(*const Calculator, *const f64, *const u32, *mut u32, *mut u32);
/// The function of the barriers. Arguments: calculator, index, parameters, t, x.
pub(super) type BarrierFunction =
    unsafe extern "C" fn(*const Calculator, u32, *const f64, u32, *const u32) -> u32;

/// The description that the host reads: `punctual_model_description`.
#[repr(C)]
pub struct Description {
    pub(super) abi: u32,
    pub(super) size: u32,
    pub(super) states: u32,
    pub(super) inputs: u32,
    pub(super) parameters: u32,
    pub(super) barriers: u32,
    pub(super) state: *const Variable,
    pub(super) input: *const Variable,
    pub(super) parameter: *const Variable,
    pub(super) barrier: *const Variable,
    pub(super) initialize: Option<unsafe extern "C" fn() -> *const c_char>,
    pub(super) plant: Option<PlantFunction>,
    pub(super) barrier_value: Option<BarrierFunction>,
}

// SAFETY: it points to constants only.
unsafe impl Sync for Description {}

impl Description {
    /// The description of `M`.
    pub const fn of<M: Model>() -> Self {
        Self {
            abi: ABI,
            size: size_of::<Self>() as u32,
            states: M::STATES.len() as u32,
            inputs: M::INPUTS.len() as u32,
            parameters: M::PARAMETERS.len() as u32,
            barriers: M::BARRIERS.len() as u32,
            state: M::STATES.as_ptr(),
            input: M::INPUTS.as_ptr(),
            parameter: M::PARAMETERS.as_ptr(),
            barrier: M::BARRIERS.as_ptr(),
            initialize: Some(initialize::<M>),
            plant: Some(plant::<M>),
            barrier_value: Some(barrier::<M>),
        }
    }
}

unsafe extern "C" fn initialize<M: Model>() -> *const c_char {
    match catch_unwind(M::initialize) {
        Ok(Ok(())) => null(),
        Ok(Err(reason)) => reason.as_ptr(),
        Err(_) => c"it panicked".as_ptr(),
    }
}

/// Passes the numbers `ids` to `body`.
fn numbers<'c, R>(calculator: &'c Calculator, ids: &[u32], body: impl FnOnce(&[Number<'c>]) -> R) -> R {
    let none = Number { id: LITERAL, calculator };
    let mut numbers = [none; MAX_STATES];
    for (number, &id) in numbers.iter_mut().zip(ids) {
        number.id = id;
    }
    body(&numbers[..ids.len()])
}

unsafe extern "C" fn plant<M: Model>(
    calculator: *const Calculator,
    parameters: *const f64,
    x: *const u32,
    f: *mut u32,
    g: *mut u32,
) {
    let (states, inputs) = (M::STATES.len(), M::INPUTS.len());
    // SAFETY: the host passes a calculator and arrays of these lengths, valid during the call.
    let (calculator, parameters, x, f, g) = unsafe {
        (
            &*calculator,
            std::slice::from_raw_parts(parameters, M::PARAMETERS.len()),
            std::slice::from_raw_parts(x, states),
            std::slice::from_raw_parts_mut(f, states),
            std::slice::from_raw_parts_mut(g, states * inputs),
        )
    };
    let done = catch_unwind(AssertUnwindSafe(|| {
        let (mut f, mut g) = (Output { ids: &mut *f, states }, Output { ids: &mut *g, states });
        numbers(calculator, x, |x| M::plant(parameters, x, &mut f, &mut g));
    }));
    if done.is_err() {
        f.fill(LITERAL);
    }
}

unsafe extern "C" fn barrier<M: Model>(
    calculator: *const Calculator,
    index: u32,
    parameters: *const f64,
    t: u32,
    x: *const u32,
) -> u32 {
    // SAFETY: as in `plant`.
    let (calculator, parameters, x) = unsafe {
        (
            &*calculator,
            std::slice::from_raw_parts(parameters, M::PARAMETERS.len()),
            std::slice::from_raw_parts(x, M::STATES.len()),
        )
    };
    let done = catch_unwind(AssertUnwindSafe(|| {
        let t = Number { id: t, calculator };
        numbers(calculator, x, |x| M::barrier(index as usize, parameters, t, x).id)
    }));
    done.unwrap_or(LITERAL)
}

/// `export!(MyModel);` makes the library a plug-in with this model.
#[macro_export]
macro_rules! export {
    ($model:ty) => {
        #[unsafe(no_mangle)]
        pub extern "C" fn punctual_model() -> *const $crate::punctual_model::Description {
            static DESCRIPTION: $crate::punctual_model::Description =
                $crate::punctual_model::Description::of::<$model>();
            &DESCRIPTION
        }
    };
}
