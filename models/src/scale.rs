//! The scale of an expression: how much it may be asked to exceed 0, up to a factor, without asking too much.
//!
//! It is the magnitude of the constant term, as 5 of `5 - z`, or the largest value where that is less. It is 0 where there is
//! no such term, or where the largest value is not seen. So some state has any value below the scale, at every time:
//!
//! - Operands that have no variable in common take all pairs of their values. So intervals give exactly the values of an
//!   expression in which each variable occurs once.
//! - A state that occurs again is held at the number of its range nearest to 0. Then there may be larger values, but no smaller
//!   largest one.
//! - Of a term with the time nothing is known. But its sum with all numbers is all numbers, whatever the time is.

use punctual_core::interval::Interval;
use punctual_core::scalar::Scalar;

use crate::syntax::{Function, Node, Operator, TIME, Tree};
use crate::tape::{self, Tape, Value};

/// Part of the constant term up to which a largest value counts as 0: bounds of intervals are rounded outward.
const ROUND_OFF: f64 = 1e-9;

/// The scale of `tree`, ≥ 0 and finite; `parameter` gives the value of a parameter, `state` the range of a state.
pub(crate) fn of(
    tree: &Tree,
    parameter: &dyn Fn(&str) -> Option<f64>,
    state: &dyn Fn(&str) -> Option<[f64; 2]>,
) -> f64 {
    let mut names = Vec::new();
    collect(tree, &mut names);
    let walk = Walk { names, parameter, state };
    let (term, largest) = (walk.term(tree).abs(), walk.values(tree).map_or(0.0, |values| values.high));
    if term.is_finite() && largest > ROUND_OFF * term { term.min(largest) } else { 0.0 }
}

/// The names in `tree`, as often as they occur.
fn collect<'a>(tree: &'a Tree, names: &mut Vec<&'a str>) {
    match &tree.node {
        Node::Number(_) => {}
        Node::Name(name) => names.push(name),
        Node::Negate(a) => collect(a, names),
        Node::Binary(_, pair) => pair.iter().for_each(|part| collect(part, names)),
        Node::Call(_, arguments) => arguments.iter().for_each(|part| collect(part, names)),
    }
}

struct Walk<'a> {
    names: Vec<&'a str>,
    parameter: &'a dyn Fn(&str) -> Option<f64>,
    state: &'a dyn Fn(&str) -> Option<[f64; 2]>,
}

impl Walk<'_> {
    /// The value of what has neither state nor time.
    fn number(&self, tree: &Tree) -> Option<f64> {
        let resolve = |name: &str| (self.parameter)(name).map(Value::Number).ok_or_else(String::new);
        match Tape::new(0).add(tree, &resolve) {
            Ok(Value::Number(number)) => Some(number),
            _ => None,
        }
    }

    /// The constant term.
    fn term(&self, tree: &Tree) -> f64 {
        if let Some(number) = self.number(tree) {
            return number;
        }
        match &tree.node {
            Node::Negate(a) => -self.term(a),
            Node::Binary(operator, pair) => {
                let [a, b] = &**pair;
                match (operator, self.number(a), self.number(b)) {
                    (Operator::Add, ..) => self.term(a) + self.term(b),
                    (Operator::Subtract, ..) => self.term(a) - self.term(b),
                    (Operator::Multiply, Some(factor), _) => factor * self.term(b),
                    (Operator::Multiply, _, Some(factor)) => factor * self.term(a),
                    (Operator::Divide, _, Some(divisor)) => self.term(a) / divisor,
                    _ => 0.0,
                }
            }
            _ => 0.0,
        }
    }

    /// The values that it takes at every time, with the states that occur again held; `None` where they are not known exactly.
    fn values(&self, tree: &Tree) -> Option<Interval> {
        if let Some(number) = self.number(tree) {
            return number.is_finite().then(|| Interval::from(number));
        }
        match &tree.node {
            Node::Number(_) => None,
            Node::Name(name) if name == TIME => None,
            Node::Name(name) => {
                let [low, high] = (self.state)(name)?;
                let occurs_again = self.names.iter().filter(|other| *other == name).count() > 1;
                Some(if occurs_again {
                    Interval::from(0.0_f64.min(high).max(low))
                } else {
                    Interval::new(low, high)
                })
            }
            Node::Negate(a) => Some(-self.values(a)?),
            Node::Binary(operator, pair) => {
                let [a, b] = [self.values(&pair[0]), self.values(&pair[1])];
                match operator {
                    Operator::Add | Operator::Subtract if [a, b].contains(&Some(Interval::ALL)) => {
                        Some(Interval::ALL)
                    }
                    Operator::Add => Some(a? + b?),
                    Operator::Subtract => Some(a? - b?),
                    Operator::Multiply => Some(a? * b?),
                    Operator::Divide => b.filter(|b| !b.contains(0.0)).zip(a).map(|(b, a)| a / b),
                    Operator::Power => {
                        let (base, exponent) = (a?, self.number(&pair[1])?);
                        (exponent > 0.0).then(|| base.powf(exponent))
                    }
                }
            }
            Node::Call(name, arguments) => {
                let a = self.values(arguments.first()?)?;
                match tape::function(name).ok()?.0 {
                    Function::Sqrt => Some(a.sqrt()),
                    Function::Exp => Some(a.exp()),
                    // Held at 0 it has no logarithm.
                    Function::Ln => (a.high > 0.0).then(|| a.ln()),
                    Function::Sin => Some(a.sin()),
                    Function::Cos => Some(a.cos()),
                    Function::Atan => Some(a.atan()),
                    Function::Tanh => Some(a.tanh()),
                    Function::Abs => Some(a.abs()),
                    Function::Min => Some(a.min(self.values(arguments.get(1)?)?)),
                    Function::Max => Some(a.max(self.values(arguments.get(1)?)?)),
                    Function::Tan | Function::Atan2 => None,
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::syntax::parse;
    use punctual_core::elementary::cos;

    /// The scale of `text`, whose names are the parameter `p` = 2 and, within `range`, any other.
    fn within(text: &str, range: [f64; 2]) -> f64 {
        let tree = parse(text).unwrap_or_else(|e| panic!("{text}: {e}"));
        of(&tree, &|name| (name == "p").then_some(2.0), &|name| (name != "p").then_some(range))
    }

    const ALL: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];

    #[test]
    fn it_is_the_constant_term() {
        for (text, wanted) in [
            ("5 - z", 5.0),
            ("z - 5", 5.0),
            ("-(z - 5)", 5.0),
            ("x + y - 3", 3.0),
            ("2 - x + y * t", 2.0),
            ("T - 293.15", 293.15),
            ("level - 0.01", 0.01),
            ("0.001 - x^2", 0.001),
            ("0.001 - x * x", 0.001),
            ("1 - (x - 5)^2", 1.0),
            ("(x - 10)^2 + (y - 0.1)^2 - 1", 1.0),
            ("0.3 - sqrt((x - 1)^2 + y^2)", 0.3),
            ("3 - (x^2 + 2 * x * y + 4 * y^2)", 3.0),
            ("x * y - 4", 4.0),
            ("v * cos(theta) - 1", 1.0),
            // Parameters count as their values.
            ("x - p", 2.0),
            ("p^2 / 100 - x^2", 0.04),
            // Only what remains of several constants counts, and it is scaled with the sum.
            ("1000 + (x - 999)", 1.0),
            ("2 * (3 - x) / 4", 1.5),
            // A centre may move.
            ("2 - sqrt((x - 10 - 15 * cos(0.15 * t))^2 + (y - 15 * sin(0.15 * t))^2)", 2.0),
        ] {
            assert_eq!(within(text, ALL), wanted, "{text}");
        }
    }

    #[test]
    fn it_is_no_more_than_the_largest_value() {
        for (text, range, wanted) in [
            ("1 - sqrt(x^2 + 0.9999^2)", ALL, 1.0 - 0.9999),
            ("sqrt(p^2 + p^2) - sqrt((x - 4)^2 + y^2 + p^2)", ALL, 8.0_f64.sqrt() - 2.0),
            ("cos(x) - cos(0.01)", ALL, 1.0 - cos(0.01)),
            ("p - exp(x) - 1.5", ALL, 0.5),
            ("min(x, 0.1) - 0.05", ALL, 0.05),
            ("level - 0.01", [0.0, 0.0101], 0.0001),
            ("x / (1 + y^2) - 1", [0.0, 1.5], 0.5),
        ] {
            let found = within(text, range);
            assert!((found - wanted).abs() < 1e-14, "{text}: {found}");
        }
    }

    #[test]
    fn it_is_0_where_there_is_no_term_or_no_largest_value_is_seen() {
        for text in [
            "x",
            "x * y",
            "x - y",
            "(x - 1) * (x + 1)",
            "min(5 - z, z - 0.5)",
            "3 - 3 + x",
            "0",
            // Never positive.
            "-1 - x^2",
            "1 - sqrt(x^2 + 1)",
            // Of two places of a state only one counts.
            "2 * x - x^2 - 0.99999",
            "0.500001 - (x - 1)^2 - x^2",
            // It shrinks.
            "exp(-t) - x^2",
            "1 - 0.99999 * tanh(t) - x^2",
            "1 - 1 / x^2",
            "1 - tan(x)",
            "ln(min(x, x)) - 4",
            // Not a number.
            "1 / 0 - x",
            "sqrt(-1) - x",
            "1e308 * 10 - x",
            "1 - f(x)",
            "1 - atan2(x)",
        ] {
            assert_eq!(within(text, ALL), 0.0, "{text}");
        }
    }
}
