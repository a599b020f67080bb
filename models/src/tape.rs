//! Compiles trees to one tape: constants are folded, and equal operations occur once.

use std::collections::HashMap;

use punctual_core::elementary;
use punctual_core::scalar::Scalar;

use crate::MAX_OPERATIONS;
use crate::names::nearest;
use crate::operation::{Operation, Register, Step};
use crate::syntax::{FUNCTIONS, Function, Node, Operator, PI, TIME, Tree};

/// The meaning of a name: a register or a number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Value {
    Number(f64),
    Register(Register),
}

/// A tape under construction.
#[derive(Clone, Debug)]
pub(crate) struct Tape {
    pub(crate) steps: Vec<Step>,
    pub(crate) registers: usize,
    known: HashMap<Operation, Register>,
}

impl Tape {
    /// An empty tape, whose first `variables` registers are inputs.
    pub(crate) fn new(variables: usize) -> Self {
        Self { steps: Vec::new(), registers: variables, known: HashMap::new() }
    }

    /// Adds the operations of `tree`; `resolve` gives the meaning of a name.
    ///
    /// # Errors
    ///
    /// An unknown name or function, a wrong number of arguments, too many operations.
    pub(crate) fn add(
        &mut self,
        tree: &Tree,
        resolve: &dyn Fn(&str) -> Result<Value, String>,
    ) -> Result<Value, String> {
        if self.steps.len() >= MAX_OPERATIONS {
            return Err(format!("brings the model to more than {MAX_OPERATIONS} operations"));
        }
        match &tree.node {
            Node::Number(value) if value.is_finite() => Ok(Value::Number(*value)),
            Node::Number(_) => Err(format!("holds a number larger than {:e}", f64::MAX)),
            Node::Name(name) if name == PI => Ok(Value::Number(std::f64::consts::PI)),
            Node::Name(name) => resolve(name),
            Node::Negate(a) => {
                let a = self.add(a, resolve)?;
                Ok(self.negate(a))
            }
            Node::Binary(operator, pair) => {
                let a = self.add(&pair[0], resolve)?;
                let b = self.add(&pair[1], resolve)?;
                Ok(self.binary(*operator, a, b))
            }
            Node::Call(name, arguments) => {
                let (function, wanted) = function(name)?;
                if arguments.len() != wanted {
                    let plural = if wanted == 1 { "" } else { "s" };
                    let found = arguments.len();
                    return Err(format!("gives {found} to {name}, which takes {wanted} argument{plural}"));
                }
                let a = self.add(&arguments[0], resolve)?;
                let b = arguments.get(1).map(|b| self.add(b, resolve)).transpose()?;
                Ok(self.call(function, a, b.unwrap_or(a)))
            }
        }
    }
}

impl Record for Tape {
    fn done(&mut self, operation: Operation) -> Register {
        if let Some(&register) = self.known.get(&operation) {
            return register;
        }
        let to = self.registers;
        self.registers += operation.results();
        self.steps.push(Step { operation, to });
        self.known.insert(operation, to);
        to
    }
}

/// Records operations in sequence, and composes operators and functions from them.
pub(crate) trait Record {
    /// The register of the first result of `operation`.
    fn done(&mut self, operation: Operation) -> Register;

    /// The register that holds a value.
    fn register(&mut self, value: Value) -> Register {
        match value {
            Value::Register(register) => register,
            Value::Number(number) => self.done(Operation::Constant(number.to_bits())),
        }
    }

    fn of(&mut self, operation: Operation) -> Value {
        Value::Register(self.done(operation))
    }

    fn negate(&mut self, a: Value) -> Value {
        match a {
            Value::Number(a) => Value::Number(-a),
            Value::Register(a) => self.of(Operation::Negate(a)),
        }
    }

    fn offset(&mut self, a: Value, by: f64) -> Value {
        match a {
            Value::Number(a) => Value::Number(a + by),
            Value::Register(_) if by == 0.0 => a,
            Value::Register(a) => self.of(Operation::Offset(a, by.to_bits())),
        }
    }

    fn square(&mut self, a: Value) -> Value {
        match a {
            Value::Number(a) => Value::Number(a * a),
            Value::Register(a) => self.of(Operation::Square(a)),
        }
    }

    fn binary(&mut self, operator: Operator, a: Value, b: Value) -> Value {
        use Value::{Number, Register};
        match (operator, a, b) {
            (Operator::Power, a, Number(exponent)) => self.power(a, exponent),
            (Operator::Power, a, b) => {
                // e^(b ln a).
                let logarithm = self.call(Function::Ln, a, a);
                let product = self.binary(Operator::Multiply, b, logarithm);
                self.call(Function::Exp, product, product)
            }
            (Operator::Add, a, Number(b)) => self.offset(a, b),
            (Operator::Add, Number(a), b) => self.offset(b, a),
            (Operator::Subtract, a, Number(b)) => self.offset(a, -b),
            (Operator::Subtract, Number(a), b) => {
                let negated = self.negate(b);
                self.offset(negated, a)
            }
            (Operator::Multiply, Number(a), Number(b)) => Number(a * b),
            (Operator::Multiply, Register(a), Number(b)) | (Operator::Multiply, Number(b), Register(a)) => {
                if b == 1.0 {
                    Register(a)
                } else {
                    self.of(Operation::Scale(a, b.to_bits()))
                }
            }
            (Operator::Divide, Number(a), Number(b)) => Number(a / b),
            (Operator::Divide, Register(a), Number(b)) => {
                if b == 1.0 {
                    Register(a)
                } else {
                    self.of(Operation::Over(a, b.to_bits()))
                }
            }
            (Operator::Divide, a, Register(b)) => {
                let a = self.register(a);
                self.of(Operation::Divide(a, b))
            }
            (Operator::Add, Register(a), Register(b)) => self.of(Operation::Add(a.min(b), a.max(b))),
            (Operator::Subtract, Register(a), Register(b)) => self.of(Operation::Subtract(a, b)),
            (Operator::Multiply, Register(a), Register(b)) if a == b => self.of(Operation::Square(a)),
            (Operator::Multiply, Register(a), Register(b)) => {
                self.of(Operation::Multiply(a.min(b), a.max(b)))
            }
        }
    }

    /// Integer powers by repeated multiplication, so that they are exact at 0 and for negative `a`.
    fn power(&mut self, a: Value, exponent: f64) -> Value {
        /// The largest integer exponent that is expanded.
        const WHOLE: f64 = 64.0;
        if let Value::Number(a) = a {
            return Value::Number(elementary::powf(a, exponent));
        }
        if exponent == 0.5 {
            return self.call(Function::Sqrt, a, a);
        }
        if exponent.fract() != 0.0 || exponent.abs() > WHOLE {
            let a = self.register(a);
            return self.of(Operation::Power(a, exponent.to_bits()));
        }
        let (mut left, mut base, mut result) = (exponent.abs() as u32, a, Value::Number(1.0));
        while left > 0 {
            if left & 1 == 1 {
                result = self.binary(Operator::Multiply, result, base);
            }
            left >>= 1;
            if left > 0 {
                base = self.square(base);
            }
        }
        if exponent < 0.0 { self.binary(Operator::Divide, Value::Number(1.0), result) } else { result }
    }

    fn call(&mut self, function: Function, a: Value, b: Value) -> Value {
        if let (Value::Number(a), Value::Number(b)) = (a, b) {
            return Value::Number(number(function, a, b));
        }
        let (x, y) = (self.register(a), self.register(b));
        match function {
            Function::Sqrt => self.of(Operation::Sqrt(x)),
            Function::Exp => self.of(Operation::Exp(x)),
            Function::Ln => self.of(Operation::Ln(x)),
            Function::Sin => self.of(Operation::SinCos(x)),
            Function::Cos => Value::Register(self.done(Operation::SinCos(x)) + 1),
            Function::Tan => {
                let sine = self.done(Operation::SinCos(x));
                self.of(Operation::Divide(sine, sine + 1))
            }
            Function::Tanh => self.of(Operation::Tanh(x)),
            Function::Atan => {
                let square = self.square(a);
                let slope = self.offset(square, 1.0);
                let slope = self.register(slope);
                self.of(Operation::Atan(x, slope))
            }
            Function::Atan2 => {
                let squares = [a, b].map(|v| self.square(v));
                let radius = self.binary(Operator::Add, squares[0], squares[1]);
                let radius = self.register(radius);
                self.of(Operation::Atan2(x, y, radius))
            }
            Function::Abs => self.of(Operation::Abs(x)),
            Function::Min => self.of(Operation::Minimum(x, y)),
            Function::Max => self.of(Operation::Maximum(x, y)),
        }
    }
}

/// A function of numbers.
fn number(function: Function, a: f64, b: f64) -> f64 {
    match function {
        Function::Sqrt => a.sqrt(),
        Function::Exp => elementary::exp(a),
        Function::Ln => elementary::ln(a),
        Function::Sin => elementary::sin(a),
        Function::Cos => elementary::cos(a),
        Function::Tan => elementary::tan(a),
        Function::Atan => elementary::atan(a),
        Function::Atan2 => elementary::atan2(a, b),
        Function::Abs => a.abs(),
        Function::Tanh => elementary::tanh(a),
        // The minimum of [`Scalar`], since that of `f64` ignores a NaN.
        Function::Min => Scalar::min(a, b),
        Function::Max => Scalar::max(a, b),
    }
}

pub(crate) fn function(name: &str) -> Result<(Function, usize), String> {
    let found = FUNCTIONS.iter().find(|f| f.0 == name);
    found.map(|f| (f.1, f.2)).ok_or_else(|| {
        let names = FUNCTIONS.map(|f| f.0);
        let all = names.join(", ");
        format!("calls {name}, which is not a function{}; the functions are {all}", nearest(name, &names))
    })
}

/// The message on a name `name` where only `known` names, and possibly the time, are allowed.
pub(crate) fn unknown(name: &str, known: &[&str], allows_time: bool) -> String {
    if name == TIME && !allows_time {
        return "names t, the time, which a derivative does not depend on; a state with the derivative 1 does"
            .to_owned();
    }
    if FUNCTIONS.iter().any(|f| f.0 == name) {
        return format!("names {name}, a function, without arguments");
    }
    let listed = if known.is_empty() { "none".to_owned() } else { known.join(", ") };
    format!("names {name}, which is unknown{}; the names are {listed}", nearest(name, known))
}
