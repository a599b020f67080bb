//! Computes the Taylor coefficients of a tape, order by order.
//!
//! Coefficient k of a result needs the coefficients up to k of its operands. So a solution of ẋ = f(x) + g(x)
//! u can be extended order by order, with each operation performed once for each order. Evaluating a function
//! on whole series would repeat it for every order of the solution. The recurrences are those of
//! [`Taylor`](punctual_core::jet::Taylor), whose tests are the reference for this module. The coefficients
//! are numbers, or dual numbers along the inputs.
//!
//! # References
//!
//! A. Griewank and A. Walther, *Evaluating Derivatives*, 2nd ed., SIAM 2008, section 13.2
//! (doi:10.1137/1.9780898717761).

use alloc::vec;
use alloc::vec::Vec;
use core::cmp::Ordering;
use core::ops::Range;

use punctual_core::scalar::Scalar;

use crate::operation::{Operation, Register, Step};

/// The coefficients of every register.
#[derive(Clone, Debug)]
pub(crate) struct Series<C> {
    /// Coefficients of register r, from `r * orders` on.
    coefficients: Vec<C>,
    orders: usize,
}

impl<C: Scalar> Series<C> {
    /// Zeros, for orders 0 to `orders` − 1.
    pub(crate) fn new(registers: usize, orders: usize) -> Self {
        Self { coefficients: vec![C::zero(); registers * orders], orders }
    }

    /// Number of registers.
    pub(crate) fn registers(&self) -> usize {
        self.coefficients.len() / self.orders
    }

    /// Grows to `registers` registers, filled with zeros.
    pub(crate) fn grow(&mut self, registers: usize) {
        self.coefficients.resize(registers * self.orders, C::zero());
    }

    #[inline]
    pub(crate) fn get(&self, register: Register, k: usize) -> C {
        self.coefficients[register * self.orders + k]
    }

    #[inline]
    pub(crate) fn set(&mut self, register: Register, k: usize, value: C) {
        self.coefficients[register * self.orders + k] = value;
    }

    #[inline]
    fn of(&self, register: Register) -> &[C] {
        &self.coefficients[register * self.orders..][..self.orders]
    }

    /// Σ a_i b_{k−i} over `range`.
    #[inline]
    fn product(&self, a: Register, b: Register, k: usize, range: Range<usize>) -> C {
        let (a, b) = (self.of(a), self.of(b));
        let mut sum = C::zero();
        for i in range {
            sum += a[i] * b[k - i];
        }
        sum
    }

    /// Σ i a_i b_{k−i} / k over i from 1 to `last`, the sum in the recurrences of y' = a' b.
    #[inline]
    fn integral(&self, a: Register, b: Register, k: usize, last: usize) -> C {
        let (a, b) = (self.of(a), self.of(b));
        let mut sum = C::zero();
        for i in 1..=last {
            sum += a[i] * b[k - i] * i as f64;
        }
        sum * (1.0 / k as f64)
    }

    /// Performs `steps` for the coefficients of order `k`, after the lower ones.
    pub(crate) fn advance(&mut self, steps: &[Step], k: usize) {
        for step in steps {
            self.advance_one(step, k);
        }
    }

    /// Performs one step for the coefficient of order `k`.
    #[inline]
    pub(crate) fn advance_one(&mut self, &Step { operation, to }: &Step, k: usize) {
        let value = if k == 0 { self.first(operation, to) } else { self.next(operation, to, k) };
        self.set(to, k, value);
    }

    /// The coefficient of order 0.
    #[inline]
    fn first(&mut self, operation: Operation, to: Register) -> C {
        use Operation as O;
        let at = |register| self.get(register, 0);
        match operation {
            O::Constant(number) => C::from(f64::from_bits(number)),
            O::Add(a, b) => at(a) + at(b),
            O::Subtract(a, b) => at(a) - at(b),
            O::Multiply(a, b) => at(a) * at(b),
            O::Divide(a, b) => at(a) / at(b),
            O::Negate(a) => -at(a),
            O::Square(a) => at(a).squared(),
            O::Offset(a, number) => at(a) + f64::from_bits(number),
            O::Scale(a, number) => at(a) * f64::from_bits(number),
            O::Over(a, number) => at(a) / f64::from_bits(number),
            O::Sqrt(a) => at(a).sqrt(),
            O::Exp(a) => at(a).exp(),
            O::Ln(a) => at(a).ln(),
            O::SinCos(a) => {
                let (sin, cos) = at(a).sin_cos();
                self.set(to + 1, 0, cos);
                sin
            }
            O::Tanh(a) => {
                let value = at(a).tanh();
                self.set(to + 1, 0, -value.squared() + 1.0);
                value
            }
            O::Atan(a, _) => at(a).atan(),
            O::Atan2(y, x, _) => at(y).atan2(at(x)),
            O::Power(a, number) => at(a).powf(f64::from_bits(number)),
            O::Abs(a) => at(a).abs(),
            O::Minimum(a, b) => at(a).min(at(b)),
            O::Maximum(a, b) => at(a).max(at(b)),
        }
    }

    /// The coefficient of order `k` ≥ 1.
    #[inline]
    fn next(&mut self, operation: Operation, to: Register, k: usize) -> C {
        use Operation as O;
        let at = |register| self.get(register, k);
        let start = |register| self.get(register, 0);
        let unknown = C::from(f64::NAN);
        match operation {
            O::Constant(_) => C::zero(),
            O::Add(a, b) => at(a) + at(b),
            O::Subtract(a, b) => at(a) - at(b),
            O::Multiply(a, b) => self.product(a, b, k, 0..k + 1),
            O::Divide(a, b) => (at(a) - self.product(to, b, k, 0..k)) / start(b),
            O::Negate(a) => -at(a),
            O::Square(a) => {
                // Each pair of equal products is computed once.
                let sum = self.product(a, a, k, 0..k.div_ceil(2)) * 2.0;
                if k.is_multiple_of(2) { sum + self.get(a, k / 2).squared() } else { sum }
            }
            O::Offset(a, _) => at(a),
            O::Scale(a, number) => at(a) * f64::from_bits(number),
            O::Over(a, number) => at(a) / f64::from_bits(number),
            O::Sqrt(a) => (at(a) - self.product(to, to, k, 1..k)) / (start(to) * 2.0),
            O::Exp(a) => self.integral(a, to, k, k),
            O::Ln(a) => (at(a) - self.integral(to, a, k, k - 1)) / start(a),
            O::SinCos(a) => {
                let (sin, cos) = (self.integral(a, to + 1, k, k), -self.integral(a, to, k, k));
                self.set(to + 1, k, cos);
                sin
            }
            O::Tanh(a) => {
                let value = self.integral(a, to + 1, k, k);
                self.set(to, k, value);
                self.set(to + 1, k, -self.product(to, to, k, 0..k + 1));
                value
            }
            O::Atan(a, slope) => (at(a) - self.integral(to, slope, k, k - 1)) / start(slope),
            // The angle jumps across the negative half of the x axis.
            O::Atan2(y, x, _)
                if start(y).compare(C::zero()).is_none()
                    && start(x).compare(C::zero()) != Some(Ordering::Greater) =>
            {
                unknown
            }
            // (x² + y²) y' = x y' − y x'.
            O::Atan2(y, x, radius) => {
                let turned = self.integral(y, x, k, k) - self.integral(x, y, k, k);
                (turned - self.integral(to, radius, k, k - 1)) / start(radius)
            }
            // a y' = p a' y.
            O::Power(a, number) => {
                let (next, (base, own)) = (C::from(f64::from_bits(number)) + 1.0, (self.of(a), self.of(to)));
                let mut sum = C::zero();
                for i in 1..=k {
                    sum += base[i] * own[k - i] * (next * i as f64 - k as f64);
                }
                sum * (1.0 / k as f64) / base[0]
            }
            // Order 0 decides the branch.
            O::Abs(a) => match start(a).compare(C::zero()) {
                Some(Ordering::Less) => -at(a),
                Some(_) => at(a),
                None => unknown,
            },
            O::Minimum(a, b) => match start(b).compare(start(a)) {
                Some(Ordering::Less) => at(b),
                Some(_) => at(a),
                None => unknown,
            },
            O::Maximum(a, b) => match start(b).compare(start(a)) {
                Some(Ordering::Greater) => at(b),
                Some(_) => at(a),
                None => unknown,
            },
        }
    }
}
