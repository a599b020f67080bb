//! Plants and barriers computed by foreign code, such as a plug-in. The code gets opaque handles of numbers
//! and requests operations on them. The host performs these on Taylor coefficients.
//!
//! The code runs once for each state, which performs its operations on the coefficients of order 0. The
//! operations are recorded as a tape, which then gives the higher orders as the tape of an expression does.
//! The code may read values ([`Calculator::value`]), branch on them and look them up in tables, since each
//! state has only one order 0.

mod trial;

use std::cell::Cell;
use std::fmt;
use std::ops::Range;
use std::sync::Arc;

use punctual_core::dynamics::DynPlant;
use punctual_core::lie::{DerivativeSource, RelativeDegree};
use punctual_core::scalar::Scalar;
use punctual_core::{MAX_INPUTS, MAX_ROWS};

use crate::motion::Equations;
use crate::operation::{Operation, Register, Step};
use crate::series::Series;
use crate::source::{self, Identity};
use crate::syntax::{Function, Operator};
use crate::tape::{Record, Value};
use crate::{Error, MAX_OPERATIONS, MAX_STATES};

/// The handle of a number in a computation.
pub type Number = u32;

/// Stands for the literal number of the call, in place of a [`Number`].
pub const LITERAL: Number = Number::MAX;

/// Operations that code can request, each by its index in this list.
pub const OPERATIONS: [&str; 19] = [
    "constant", "add", "subtract", "multiply", "divide", "power", "negate", "sqrt", "exp", "ln", "sin",
    "cos", "tan", "atan", "atan2", "abs", "tanh", "min", "max",
];

/// Performs the operations that code requests.
pub trait Calculator {
    /// The result of operation number `operation` in [`OPERATIONS`] on `a`, and on `b` if it takes two
    /// operands. `literal` is the number that [`LITERAL`] stands for. The result of an operation that cannot
    /// be performed is NaN.
    fn apply(&mut self, operation: u32, a: Number, b: Number, literal: f64) -> Number;

    /// The value of `a`, for branching and table lookup. A number computed from it has no derivatives.
    fn value(&self, a: Number) -> f64;
}

/// The code of a model `ẋ = f(x) + g(x) u` with barriers. Its functions must be pure, and may be called on
/// any thread.
pub trait Code: Send + Sync {
    /// Writes f(x), one number for each state, and g(x), whose entry for state i and input j is at `j *
    /// states + i`. Both are initially zero.
    fn plant(
        &self,
        c: &mut dyn Calculator,
        parameters: &[f64],
        x: &[Number],
        f: &mut [Number],
        g: &mut [Number],
    );

    /// Barrier `index` at time `t` and state `x`.
    fn barrier(
        &self,
        index: usize,
        c: &mut dyn Calculator,
        parameters: &[f64],
        t: Number,
        x: &[Number],
    ) -> Number;
}

/// Numbers of states, inputs and barriers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Dimensions {
    /// Of x: 1 to [`MAX_STATES`].
    pub states: usize,
    /// Of u: 1 to [`MAX_INPUTS`].
    pub inputs: usize,
    /// At most [`MAX_ROWS`].
    pub barriers: usize,
}

impl Dimensions {
    /// Checks that they are in range.
    ///
    /// # Errors
    ///
    /// A dimension out of range.
    pub fn check(&self) -> Result<(), Error> {
        for (field, count, range) in [
            ("states", self.states, 1..=MAX_STATES),
            ("inputs", self.inputs, 1..=MAX_INPUTS),
            ("barriers", self.barriers, 0..=MAX_ROWS),
        ] {
            if !range.contains(&count) {
                let message = format!("is {count}, must be {} to {}", range.start(), range.end());
                return Err(Error::new(field, message));
            }
        }
        Ok(())
    }
}

/// A model computed by foreign code.
#[derive(Clone)]
pub struct CodeModel {
    equations: Evaluated,
    barriers: usize,
    /// Which plant it is; its clones are the same one.
    identity: Identity,
}

impl fmt::Debug for CodeModel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("CodeModel")
    }
}

impl CodeModel {
    /// The model that `code` computes with `parameters`. The code is tried at built-in samples of states
    /// within `ranges`, which shows how much memory it needs. Later steps may perform twice as many
    /// operations, plus 64.
    ///
    /// # Errors
    ///
    /// Dimensions out of range; a missing range; a derivative that contradicts the differences of the values
    /// at more than half of the samples. Code that uses a number it was not given, requests an unknown
    /// operation or more than [`MAX_OPERATIONS`] of them, or requests different operations when it is called
    /// again.
    pub fn new(
        code: Arc<dyn Code>,
        dimensions: Dimensions,
        parameters: Vec<f64>,
        ranges: &[[f64; 2]],
    ) -> Result<Self, Error> {
        dimensions.check()?;
        let Dimensions { states, inputs, barriers } = dimensions;
        if ranges.len() != states {
            return Err(Error::new("ranges", format!("has {} entries, must have {states}", ranges.len())));
        }
        let mut equations = Evaluated {
            code,
            parameters,
            states,
            inputs,
            barrier: 0,
            growing: true,
            registers: states + inputs + RESERVED,
            x: (0..states as Number).collect(),
            f: vec![0; states],
            g: vec![0; states * inputs],
            derivatives: vec![0; states],
            steps: Vec::new(),
            plant_steps: 0,
            next: 0,
            fault: None,
            reads_values: [false; 2],
        };
        trial::run(&mut equations, barriers, ranges)?;
        equations.growing = false;
        equations.registers =
            (2 * equations.registers + 64).min(2 * MAX_OPERATIONS + states + inputs + RESERVED);
        equations.steps = Vec::new();
        Ok(Self { equations, barriers, identity: Arc::new(()) })
    }

    /// The plant, for simulation.
    pub fn plant(&self) -> Box<dyn DynPlant> {
        source::simulated(&self.equations)
    }

    /// Barrier number `index` of the code.
    ///
    /// # Errors
    ///
    /// An `index` beyond the barriers of the code.
    pub fn barrier(&self, index: usize) -> Result<CodeBarrier, Error> {
        if index >= self.barriers {
            return Err(Error::new("barrier", format!("is {index}, must be < {}", self.barriers)));
        }
        let equations = Evaluated { barrier: index, ..self.equations.clone() };
        Ok(CodeBarrier { equations, identity: Arc::clone(&self.identity) })
    }
}

/// A barrier along the motion of a [`CodeModel`].
#[derive(Clone)]
pub struct CodeBarrier {
    equations: Evaluated,
    identity: Identity,
}

impl CodeBarrier {
    /// The relative degree, found at built-in samples of states within `ranges`.
    pub fn relative_degree(&self, ranges: &[[f64; 2]]) -> RelativeDegree {
        source::relative_degree(&self.equations, &self.equations, ranges, false)
    }

    /// The relative degree with nonzero inputs. It also sees an input that only multiplies another one, as a
    /// turn rate multiplies a speed or a thrust.
    pub fn driven_degree(&self, ranges: &[[f64; 2]]) -> RelativeDegree {
        source::relative_degree(&self.equations, &self.equations, ranges, true)
    }

    /// Its derivatives up to relative degree `n`, for a filter.
    ///
    /// # Errors
    ///
    /// `n` outside 1 to [`MAX_RELATIVE_DEGREE`](punctual_core::MAX_RELATIVE_DEGREE).
    pub fn source(&self, n: usize) -> Result<Box<dyn DerivativeSource>, Error> {
        source::source(&self.equations, &self.equations, n, &self.identity)
    }
}

/// Number of registers between the inputs and the first result: time, zero, one, NaN.
const RESERVED: usize = 4;

/// How far back on the tape, in operations, a cosine looks for the sine computed with it.
const RECENT: usize = 16;

/// Reasons why a requested operation could not be performed.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Fault {
    Number(Number),
    Operation(u32),
    TooMany,
    Different,
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number(number) => write!(f, "uses a number that it was not given ({number})"),
            Self::Operation(code) => {
                write!(f, "asks for operation {code}, must be 0 to {}", OPERATIONS.len() - 1)
            }
            Self::TooMany => write!(f, "asks for more than {MAX_OPERATIONS} operations"),
            Self::Different => {
                f.write_str("asks for other operations when it is called again at the same state")
            }
        }
    }
}

/// The tape of a model computed by code. Registers: states, inputs, [`RESERVED`], results.
struct Evaluated {
    code: Arc<dyn Code>,
    parameters: Vec<f64>,
    states: usize,
    inputs: usize,
    /// The index of the barrier.
    barrier: usize,
    /// Whether memory may grow, as it may only in the trial.
    growing: bool,
    registers: usize,
    x: Vec<Number>,
    f: Vec<Number>,
    g: Vec<Number>,
    derivatives: Vec<Register>,
    /// The operations that the code requested.
    steps: Vec<Step>,
    /// Number of the steps that belong to the plant.
    plant_steps: usize,
    /// The first free register after the steps.
    next: Register,
    fault: Option<Fault>,
    /// Whether the plant, and the barrier, read the single value of an interval.
    reads_values: [bool; 2],
}

impl Clone for Evaluated {
    /// Reserves capacity for as many steps as there are registers, so that a step does not allocate.
    fn clone(&self) -> Self {
        let mut steps = Vec::with_capacity(self.registers);
        steps.extend_from_slice(&self.steps);
        Self {
            code: Arc::clone(&self.code),
            parameters: self.parameters.clone(),
            x: self.x.clone(),
            f: self.f.clone(),
            g: self.g.clone(),
            derivatives: self.derivatives.clone(),
            steps,
            ..*self
        }
    }
}

impl Evaluated {
    fn time(&self) -> Register {
        self.states + self.inputs
    }

    /// The operations that the last call requested, and the numbers it returned.
    fn asked(&self) -> (Vec<Step>, Vec<Number>) {
        (self.steps.clone(), [&self.f[..], &self.g].concat())
    }
}

/// One call of the code.
struct Work<'a, C> {
    series: &'a mut Series<C>,
    steps: &'a mut Vec<Step>,
    /// Number of steps recorded by the call before.
    others: usize,
    next: Register,
    /// Registers that are hidden from the code: the inputs, and the results of the call before.
    hidden: [Range<Register>; 2],
    /// The first input.
    inputs: Register,
    /// The first of three reserved registers: zero, one, NaN.
    zero: Register,
    growing: bool,
    fault: Option<Fault>,
    /// Whether the code read the single value of an interval.
    reads_values: Cell<bool>,
}

impl<C: Scalar> Work<'_, C> {
    fn not_a_number(&self) -> Register {
        self.zero + 2
    }

    fn fail(&mut self, fault: Fault) -> Register {
        self.fault.get_or_insert(fault);
        self.not_a_number()
    }

    #[inline]
    fn is_given(&self, register: Register) -> bool {
        register < self.next && !self.hidden.iter().any(|range| range.contains(&register))
    }

    #[inline]
    fn checked(&mut self, number: Number) -> Register {
        let register = number as Register;
        if self.is_given(register) { register } else { self.fail(Fault::Number(number)) }
    }

    fn operand(&mut self, number: Number, literal: f64) -> Value {
        if number == LITERAL { Value::Number(literal) } else { Value::Register(self.checked(number)) }
    }

    fn constant(&mut self, number: f64) -> Register {
        // Compares bits, because −0 equals 0.
        if number.to_bits() == 0 {
            self.zero
        } else if number == 1.0 {
            self.zero + 1
        } else {
            self.done(Operation::Constant(number.to_bits()))
        }
    }

    /// Writes f + g u to `derivatives`.
    fn combine(&mut self, f: &[Number], g: &[Number], derivatives: &mut [Register]) {
        let states = f.len();
        for (i, derivative) in derivatives.iter_mut().enumerate() {
            let mut sum = self.checked(f[i]);
            for (j, column) in g.chunks_exact(states).enumerate() {
                let (factor, input) = (self.checked(column[i]), self.inputs + j);
                if factor == self.zero {
                    continue;
                }
                let product = match factor == self.zero + 1 {
                    true => input,
                    false => self.done(Operation::Multiply(factor.min(input), factor.max(input))),
                };
                let nothing = sum == self.zero;
                sum = if nothing { product } else { self.done(Operation::Add(sum, product)) };
            }
            *derivative = sum;
        }
    }
}

impl<C: Scalar> Record for Work<'_, C> {
    fn done(&mut self, operation: Operation) -> Register {
        if self.fault.is_some() {
            return self.not_a_number();
        }
        // Sine and cosine are computed together, and usually requested close together.
        if matches!(operation, Operation::SinCos(_)) {
            let recent = self.steps[self.others..].iter().rev().take(RECENT);
            if let Some(done) = recent.into_iter().find(|step| step.operation == operation) {
                return done.to;
            }
        }
        let (to, end) = (self.next, self.next + operation.results());
        if self.steps.len() >= MAX_OPERATIONS {
            return self.fail(Fault::TooMany);
        }
        if end > self.series.registers() {
            if !self.growing {
                return self.fail(Fault::TooMany);
            }
            self.series.grow(2 * end);
        }
        let step = Step { operation, to };
        self.steps.push(step);
        self.next = end;
        self.series.advance_one(&step, 0);
        to
    }
}

impl<C: Scalar> Calculator for Work<'_, C> {
    fn apply(&mut self, operation: u32, a: Number, b: Number, literal: f64) -> Number {
        let function = match operation {
            0 => return self.constant(literal) as Number,
            1..=5 => {
                use Operator::{Add, Divide, Multiply, Power, Subtract};
                let operator = [Add, Subtract, Multiply, Divide, Power][operation as usize - 1];
                let (a, b) = (self.operand(a, literal), self.operand(b, literal));
                let result = self.binary(operator, a, b);
                return self.register(result) as Number;
            }
            6 => {
                let a = self.operand(a, literal);
                let result = self.negate(a);
                return self.register(result) as Number;
            }
            7 => Function::Sqrt,
            8 => Function::Exp,
            9 => Function::Ln,
            10 => Function::Sin,
            11 => Function::Cos,
            12 => Function::Tan,
            13 => Function::Atan,
            14 => Function::Atan2,
            15 => Function::Abs,
            16 => Function::Tanh,
            17 => Function::Min,
            18 => Function::Max,
            other => return self.fail(Fault::Operation(other)) as Number,
        };
        let a = self.operand(a, literal);
        let two = matches!(function, Function::Atan2 | Function::Min | Function::Max);
        let b = if two { self.operand(b, literal) } else { a };
        let result = self.call(function, a, b);
        self.register(result) as Number
    }

    fn value(&self, a: Number) -> f64 {
        let register = a as Register;
        if !self.is_given(register) {
            return f64::NAN;
        }
        let value = self.series.get(register, 0);
        if value.compare(value).is_none() {
            self.reads_values.set(true);
        }
        value.value()
    }
}

impl Equations for Evaluated {
    fn states(&self) -> usize {
        self.states
    }

    fn inputs(&self) -> usize {
        self.inputs
    }

    fn series<C: Scalar>(&self, orders: usize) -> Series<C> {
        let mut series = Series::new(self.registers, orders);
        let zero = self.time() + 1;
        series.set(zero + 1, 0, C::from(1.0));
        for k in 0..orders {
            series.set(zero + 2, k, C::from(f64::NAN));
        }
        series
    }

    fn advance<C: Scalar>(&mut self, series: &mut Series<C>, k: usize) {
        if k > 0 {
            return series.advance(&self.steps, k);
        }
        let time = self.time();
        let zero = time as Number + 1;
        self.f.fill(zero);
        self.g.fill(zero);
        self.steps.clear();
        let mut work = Work {
            series,
            steps: &mut self.steps,
            others: 0,
            next: time + RESERVED,
            // Only barriers may use the time.
            hidden: [self.states..time + 1, 0..0],
            inputs: self.states,
            zero: time + 1,
            growing: self.growing,
            fault: None,
            reads_values: Cell::new(false),
        };
        self.code.plant(&mut work, &self.parameters, &self.x, &mut self.f, &mut self.g);
        work.combine(&self.f, &self.g, &mut self.derivatives);
        let nan = work.not_a_number();
        (self.next, self.fault, self.reads_values[0]) = (work.next, work.fault, work.reads_values.get());
        self.plant_steps = self.steps.len();
        if self.fault.is_some() {
            self.derivatives.fill(nan);
        }
    }

    fn derivative(&self, i: usize) -> Register {
        self.derivatives[i]
    }

    fn encloses(&self) -> [bool; 2] {
        self.reads_values.map(|reads_values| !reads_values)
    }

    fn finish<C: Scalar>(&mut self, series: &mut Series<C>, n: usize) -> Register {
        let time = self.time();
        self.steps.truncate(self.plant_steps);
        let mut work = Work {
            series,
            steps: &mut self.steps,
            others: self.plant_steps,
            next: self.next,
            // The results of the plant have no coefficient of order n.
            hidden: [self.states..time, time + RESERVED..self.next],
            inputs: self.states,
            zero: time + 1,
            growing: self.growing,
            fault: self.fault,
            reads_values: Cell::new(false),
        };
        let h = self.code.barrier(self.barrier, &mut work, &self.parameters, time as Number, &self.x);
        let h = work.checked(h);
        let (fault, nan, end) = (work.fault, work.not_a_number(), work.next);
        self.reads_values[1] = work.reads_values.get();
        for k in 1..=n {
            series.advance(&self.steps[self.plant_steps..], k);
        }
        self.fault = fault;
        if self.growing {
            self.registers = self.registers.max(end);
        }
        if fault.is_some() { nan } else { h }
    }
}
