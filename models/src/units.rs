//! Checks the units of expressions by structure. Only what is certainly wrong is refused.
//!
//! A number may stand for any quantity: `-2 * v` is an acceleration if the 2 is meant in 1/s. So a product
//! with a number has no known unit, and a sum with one has the unit of the other term. The value of a
//! function, such as `cos(theta)`, has no unit in a product. Alone it may stand for any quantity, such as a
//! speed whose factor of 1 m/s was not written.

use std::fmt;

use punctual_core::elementary;

use crate::syntax::{self, FUNCTIONS, Function, Node, Operator, PI, TIME, Tree};

/// The base units in the order of a [`Unit`]'s exponents; angles are dimensionless.
const BASE: [&str; 7] = ["kg", "m", "s", "A", "K", "mol", "cd"];

/// Relative round-off of a factor, and absolute of an exponent.
const ROUND_OFF: f64 = 1e-9;

/// A unit: powers of base units, times a factor.
#[derive(Clone, Debug, PartialEq)]
pub struct Unit {
    /// Exponents of kg, m, s, A, K, mol and cd.
    exponents: [f64; 7],
    /// Number of base units in one of it, > 0.
    factor: f64,
    /// The name it was written with, if any.
    name: Option<String>,
}

impl Unit {
    /// The unit called `name` with these exponents of kg, m, s, A, K, mol and cd. `factor` is the number of
    /// base units in one of it.
    pub fn new(name: &str, exponents: [i32; 7], factor: f64) -> Self {
        Self { exponents: exponents.map(f64::from), factor, name: Some(name.to_owned()) }
    }

    /// Whether both measure the same quantity, in any scale.
    pub fn is_like(&self, other: &Self) -> bool {
        self.exponents.iter().zip(other.exponents).all(|(a, b)| (a - b).abs() < ROUND_OFF)
    }

    /// How many of `other` one of this unit is.
    pub fn per(&self, other: &Self) -> f64 {
        self.factor / other.factor
    }

    /// Whether both are equal except for their names.
    pub fn is(&self, other: &Self) -> bool {
        self.is_like(other) && (self.per(other) - 1.0).abs() < ROUND_OFF
    }

    fn power(&self, exponent: f64) -> Self {
        let factor = elementary::powf(self.factor, exponent);
        Self { exponents: self.exponents.map(|e| e * exponent), factor, name: None }
    }

    fn times(&self, other: &Self) -> Self {
        let mut exponents = self.exponents;
        exponents.iter_mut().zip(other.exponents).for_each(|(own, more)| *own += more);
        Self { exponents, factor: self.factor * other.factor, name: None }
    }
}

impl fmt::Display for Unit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(name) = &self.name {
            return f.write_str(name);
        }
        let side = |sign: f64| {
            let powers = BASE.iter().zip(self.exponents).filter(|(_, e)| e * sign > ROUND_OFF);
            let powers = powers.map(|(unit, e)| match e.abs() {
                1.0 => (*unit).to_owned(),
                e => format!("{unit}{e}"),
            });
            powers.collect::<Vec<_>>().join(".")
        };
        if (self.factor - 1.0).abs() > ROUND_OFF {
            write!(f, "{:.6} ", self.factor)?;
        }
        match (side(1.0), side(-1.0)) {
            (above, below) if below.is_empty() => f.write_str(if above.is_empty() { "1" } else { &above }),
            (above, below) if above.is_empty() => write!(f, "1/{below}"),
            (above, below) => write!(f, "{above}/{below}"),
        }
    }
}

/// What is known about the unit of a subexpression.
#[derive(Clone, Debug)]
enum Known {
    /// Nothing.
    Nothing,
    /// It consists only of numbers, which may stand for any quantity.
    Number,
    /// It is the value of a function.
    Value,
    /// Its unit.
    Unit(Unit),
}

/// The unit of the expression `text` if it is known; `named` gives that of a name, if known. The time is in
/// s.
///
/// # Errors
///
/// Terms of different quantities or scales that are added or compared; a function of an argument with a unit.
pub fn unit_of(text: &str, named: &dyn Fn(&str) -> Option<Unit>) -> Result<Option<Unit>, String> {
    let tree = syntax::parse(text)?;
    match (Walk { text, named }).known(&tree)? {
        Known::Unit(unit) => Ok(Some(unit)),
        _ => Ok(None),
    }
}

struct Walk<'a> {
    text: &'a str,
    named: &'a dyn Fn(&str) -> Option<Unit>,
}

impl Walk<'_> {
    fn known(&self, tree: &Tree) -> Result<Known, String> {
        Ok(match &tree.node {
            Node::Number(_) => Known::Number,
            Node::Name(name) if name == PI => Known::Value,
            Node::Name(name) if name == TIME => Known::Unit(Unit::new("s", [0, 0, 1, 0, 0, 0, 0], 1.0)),
            Node::Name(name) => (self.named)(name).map_or(Known::Nothing, Known::Unit),
            Node::Negate(a) => self.known(a)?,
            Node::Binary(Operator::Power, pair) => {
                let [base, exponent] = [self.known(&pair[0])?, self.known(&pair[1])?];
                match (base, exponent, number(&pair[1])) {
                    (Known::Unit(unit), _, Some(exponent)) => Known::Unit(unit.power(exponent)),
                    (Known::Unit(_), ..) => Known::Nothing,
                    (base, ..) => base,
                }
            }
            Node::Binary(operator, pair) => {
                let parts = [self.known(&pair[0])?, self.known(&pair[1])?];
                match (operator, parts) {
                    (Operator::Add | Operator::Subtract, parts) => self.same(&pair[..], parts)?,
                    (_, [Known::Number, Known::Number | Known::Value] | [Known::Value, Known::Number]) => {
                        Known::Number
                    }
                    (_, [Known::Value, Known::Value]) => Known::Value,
                    (_, [Known::Unit(a), Known::Value]) => Known::Unit(a),
                    (Operator::Multiply, [Known::Value, Known::Unit(a)]) => Known::Unit(a),
                    (Operator::Multiply, [Known::Unit(a), Known::Unit(b)]) => Known::Unit(a.times(&b)),
                    (_, [Known::Unit(a), Known::Unit(b)]) => Known::Unit(a.times(&b.power(-1.0))),
                    _ => Known::Nothing,
                }
            }
            Node::Call(name, arguments) => self.call(name, arguments)?,
        })
    }

    fn call(&self, name: &str, arguments: &[Tree]) -> Result<Known, String> {
        let parts = arguments.iter().map(|a| self.known(a)).collect::<Result<Vec<_>, _>>()?;
        let function = FUNCTIONS.iter().find(|f| f.0 == name).map(|f| f.1);
        Ok(match (function, &parts[..]) {
            (Some(Function::Sqrt), [Known::Unit(unit)]) => Known::Unit(unit.power(0.5)),
            (Some(Function::Sqrt | Function::Abs), [part]) => part.clone(),
            (Some(Function::Min | Function::Max), [a, b]) => self.same(arguments, [a.clone(), b.clone()])?,
            (Some(Function::Atan2), [a, b]) => {
                self.same(arguments, [a.clone(), b.clone()])?;
                Known::Value
            }
            (Some(_), [Known::Unit(unit)]) => {
                if !unit.is(&Unit::new("1", [0; 7], 1.0)) {
                    let part = self.quoted(&arguments[0]);
                    return Err(format!(
                        "is {:?}, in which {name} takes {part}, which is in {unit}; it takes an angle in rad or a number \
                         without unit",
                        self.text
                    ));
                }
                Known::Value
            }
            (Some(_), [Known::Number]) => Known::Number,
            (Some(_), [_]) => Known::Value,
            // The tape reports unknown functions and wrong numbers of arguments.
            _ => Known::Nothing,
        })
    }

    /// The common unit of two terms that must have the same one.
    fn same(&self, trees: &[Tree], parts: [Known; 2]) -> Result<Known, String> {
        let [a, b] = match parts {
            [Known::Unit(a), Known::Unit(b)] => [a, b],
            [Known::Unit(a), _] | [_, Known::Unit(a)] => return Ok(Known::Unit(a)),
            [Known::Nothing, _] | [_, Known::Nothing] => return Ok(Known::Nothing),
            [Known::Value, Known::Value] => return Ok(Known::Value),
            _ => return Ok(Known::Number),
        };
        if a.is(&b) {
            return Ok(Known::Unit(a));
        }
        let [first, second] = [&trees[0], &trees[1]].map(|tree| self.quoted(tree));
        let why = if a.is_like(&b) {
            "numbers are taken as they are, so that both must be in one unit"
        } else {
            "what is added or compared must be in one unit; a factor between them may be a parameter with its unit"
        };
        Err(format!("is {:?}, in which {first} is in {a} and {second} in {b}; {why}", self.text))
    }

    fn quoted(&self, tree: &Tree) -> String {
        format!("{:?}", &self.text[tree.span.clone()])
    }
}

/// The value of an expression that consists of numbers.
fn number(tree: &Tree) -> Option<f64> {
    match &tree.node {
        Node::Number(value) => Some(*value),
        Node::Negate(a) => number(a).map(|a| -a),
        Node::Binary(operator, pair) => {
            let (a, b) = (number(&pair[0])?, number(&pair[1])?);
            Some(match operator {
                Operator::Add => a + b,
                Operator::Subtract => a - b,
                Operator::Multiply => a * b,
                Operator::Divide => a / b,
                Operator::Power => elementary::powf(a, b),
            })
        }
        Node::Name(_) | Node::Call(..) => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn named(name: &str) -> Option<Unit> {
        let unit = |name, m, s, factor| Some(Unit::new(name, [0, m, s, 0, 0, 0, 0], factor));
        match name {
            "x" | "y" | "l" => unit("m", 1, 0, 1.0),
            "v" => unit("m/s", 1, -1, 1.0),
            "a" => unit("m/s2", 1, -2, 1.0),
            "w" => unit("rad/s", 0, -1, 1.0),
            "th" => unit("rad", 0, 0, 1.0),
            "deg" => unit("deg", 0, 0, std::f64::consts::PI / 180.0),
            "km" => unit("km", 1, 0, 1e3),
            // q has no known unit.
            _ => None,
        }
    }

    #[test]
    fn units_are_found_where_they_are_certain() {
        for (text, wanted) in [
            ("x - l", Some("m")),
            ("x + 3", Some("m")),
            ("3 - q + x", Some("m")),
            ("v * t", Some("m")),
            ("v^2 / l", Some("m/s2")),
            ("sqrt(x^2 + y^2 + l^2)", Some("m")),
            ("(x^2)^(1/2)", Some("m")),
            ("v * cos(th)", Some("m/s")),
            ("cos(th) * v", Some("m/s")),
            ("v / l * tan(th)", Some("1/s")),
            ("min(x, l) + max(y, q)", Some("m")),
            ("abs(-v)", Some("m/s")),
            ("atan2(y, x)", None),
            ("pi * x", Some("m")),
            ("km * l", Some("1000.000000 m2")),
            // A number may have any unit.
            ("2 * x", None),
            ("x + 2 * v", Some("m")),
            ("x - v * 0.5", Some("m")),
            ("1 / x", None),
            ("cos(th)", None),
            ("x + cos(th)", Some("m")),
            ("cos(th) / l", None),
            ("v * (1 - cos(th))", None),
            ("deg * (pi / 180)", None),
            ("sin(deg * pi / 180)", None),
            ("x^q", None),
            ("q + q^2", None),
            ("2^q", None),
        ] {
            let found = unit_of(text, &named).unwrap_or_else(|e| panic!("{text}: {e}"));
            assert_eq!(found.map(|u| u.to_string()), wanted.map(str::to_owned), "{text}");
        }
    }

    #[test]
    fn what_cannot_be_is_told() {
        let sum = "what is added or compared must be in one unit; a factor between them may be a parameter with its unit";
        let scale = "numbers are taken as they are, so that both must be in one unit";
        for (text, wanted) in [
            ("x + v", format!("is \"x + v\", in which \"x\" is in m and \"v\" in m/s; {sum}")),
            ("l - (x + v * v)", format!("is \"l - (x + v * v)\", in which \"x\" is in m and \"v * v\" in m2/s2; {sum}")),
            ("x + km", format!("is \"x + km\", in which \"x\" is in m and \"km\" in km; {scale}")),
            ("max(th, w)", format!("is \"max(th, w)\", in which \"th\" is in rad and \"w\" in rad/s; {sum}")),
            ("atan2(y, v)", format!("is \"atan2(y, v)\", in which \"y\" is in m and \"v\" in m/s; {sum}")),
            ("x / l + x", format!("is \"x / l + x\", in which \"x / l\" is in 1 and \"x\" in m; {sum}")),
            (
                "v * sin(x)",
                "is \"v * sin(x)\", in which sin takes \"x\", which is in m; it takes an angle in rad or a number without unit"
                    .to_owned(),
            ),
            (
                "cos(deg)",
                "is \"cos(deg)\", in which cos takes \"deg\", which is in deg; it takes an angle in rad or a number without unit"
                    .to_owned(),
            ),
        ] {
            assert_eq!(unit_of(text, &named).expect_err(text), wanted);
        }
    }
}
