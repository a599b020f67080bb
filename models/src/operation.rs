//! The operations of a tape.

use alloc::vec;
use alloc::vec::Vec;

/// The position of a value on the tape: a variable, or the result of an operation.
pub(crate) type Register = usize;

/// An operation on registers. A number is stored as its bits, so that operations can be compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) enum Operation {
    Constant(u64),
    Add(Register, Register),
    Subtract(Register, Register),
    Multiply(Register, Register),
    Divide(Register, Register),
    Negate(Register),
    Square(Register),
    /// Adds a number.
    Offset(Register, u64),
    /// Multiplies by a number.
    Scale(Register, u64),
    /// Divides by a number.
    Over(Register, u64),
    Sqrt(Register),
    Exp(Register),
    Ln(Register),
    /// Two results: sine and cosine.
    SinCos(Register),
    /// Two results: tanh a and its slope 1 − tanh² a.
    Tanh(Register),
    /// Arc tangent of a, with 1 + a².
    Atan(Register, Register),
    /// The angle of (x, y): the registers of y, of x and of x² + y².
    Atan2(Register, Register, Register),
    /// Raises to the power of a number that is not an integer.
    Power(Register, u64),
    Abs(Register),
    Minimum(Register, Register),
    Maximum(Register, Register),
}

impl Operation {
    /// The registers read; one may occur twice.
    pub(crate) fn reads(self) -> [Option<Register>; 3] {
        use Operation as O;
        match self {
            O::Constant(_) => [None; 3],
            O::Add(a, b)
            | O::Subtract(a, b)
            | O::Multiply(a, b)
            | O::Divide(a, b)
            | O::Atan(a, b)
            | O::Minimum(a, b)
            | O::Maximum(a, b) => [Some(a), Some(b), None],
            O::Atan2(a, b, c) => [Some(a), Some(b), Some(c)],
            O::Negate(a)
            | O::Square(a)
            | O::Offset(a, _)
            | O::Scale(a, _)
            | O::Over(a, _)
            | O::Sqrt(a)
            | O::Exp(a)
            | O::Ln(a)
            | O::SinCos(a)
            | O::Tanh(a)
            | O::Power(a, _)
            | O::Abs(a) => [Some(a), None, None],
        }
    }

    /// The same on other registers.
    #[cfg(feature = "expressions")]
    pub(crate) fn map(self, other: impl Fn(Register) -> Register) -> Self {
        use Operation as O;
        match self {
            O::Constant(number) => O::Constant(number),
            O::Add(a, b) => O::Add(other(a), other(b)),
            O::Subtract(a, b) => O::Subtract(other(a), other(b)),
            O::Multiply(a, b) => O::Multiply(other(a), other(b)),
            O::Divide(a, b) => O::Divide(other(a), other(b)),
            O::Negate(a) => O::Negate(other(a)),
            O::Square(a) => O::Square(other(a)),
            O::Offset(a, number) => O::Offset(other(a), number),
            O::Scale(a, number) => O::Scale(other(a), number),
            O::Over(a, number) => O::Over(other(a), number),
            O::Sqrt(a) => O::Sqrt(other(a)),
            O::Exp(a) => O::Exp(other(a)),
            O::Ln(a) => O::Ln(other(a)),
            O::SinCos(a) => O::SinCos(other(a)),
            O::Tanh(a) => O::Tanh(other(a)),
            O::Atan(a, slope) => O::Atan(other(a), other(slope)),
            O::Atan2(y, x, radius) => O::Atan2(other(y), other(x), other(radius)),
            O::Power(a, number) => O::Power(other(a), number),
            O::Abs(a) => O::Abs(other(a)),
            O::Minimum(a, b) => O::Minimum(other(a), other(b)),
            O::Maximum(a, b) => O::Maximum(other(a), other(b)),
        }
    }

    pub(crate) fn results(self) -> usize {
        if matches!(self, Self::SinCos(_) | Self::Tanh(_)) { 2 } else { 1 }
    }
}

/// An operation and the register of its first result; a second result follows it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Step {
    pub(crate) operation: Operation,
    pub(crate) to: Register,
}

/// The operations that the registers `wanted` depend on, in the order of the tape.
pub(crate) fn needed(
    steps: &[Step],
    wanted: impl IntoIterator<Item = Register>,
    registers: usize,
) -> Vec<Step> {
    let mut marked = vec![false; registers];
    for register in wanted {
        marked[register] = true;
    }
    let is_marked =
        |marked: &[bool], step: &Step| marked[step.to..][..step.operation.results()].contains(&true);
    let mut count = 0;
    for step in steps.iter().rev() {
        if is_marked(&marked, step) {
            count += 1;
            for read in step.operation.reads().into_iter().flatten() {
                marked[read] = true;
            }
        }
    }
    let mut kept = Vec::with_capacity(count);
    kept.extend(steps.iter().filter(|step| is_marked(&marked, step)));
    kept
}
