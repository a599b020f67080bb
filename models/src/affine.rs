//! Checks by structure whether inputs enter an expression linearly.
//!
//! Each subexpression is free of inputs, affine in them, or neither. This module only considers how
//! subexpressions are combined, not their values. So it refuses `a * a / a`, although that equals `a`.

use crate::syntax::{Node, Operator, Tree};

/// A subexpression that is not affine in an input.
#[derive(Debug, PartialEq)]
pub(crate) struct NotAffine<'a> {
    /// The smallest such subexpression.
    pub(crate) part: &'a Tree,
    /// The input, or one of several.
    pub(crate) input: &'a str,
}

/// An input that `tree` is affine in, if there is one.
///
/// # Errors
///
/// The first subexpression that is not affine.
pub(crate) fn check<'a>(
    tree: &'a Tree,
    is_input: &dyn Fn(&str) -> bool,
) -> Result<Option<&'a str>, NotAffine<'a>> {
    let free_of_inputs = |parts: &'a [Tree]| {
        for part in parts {
            if let Some(input) = check(part, is_input)? {
                return Err(NotAffine { part: tree, input });
            }
        }
        Ok(None)
    };
    match &tree.node {
        Node::Number(_) => Ok(None),
        Node::Name(name) => Ok(is_input(name).then_some(name)),
        Node::Negate(a) => check(a, is_input),
        Node::Call(_, arguments) => free_of_inputs(arguments),
        Node::Binary(operator, pair) => {
            let found = [check(&pair[0], is_input)?, check(&pair[1], is_input)?];
            match (operator, found) {
                (_, [None, None]) => Ok(None),
                (Operator::Add | Operator::Subtract, [a, b]) => Ok(a.or(b)),
                (Operator::Multiply, [a, None]) | (Operator::Multiply, [None, a]) => Ok(a),
                (Operator::Divide, [a, None]) => Ok(a),
                (_, [a, b]) => Err(NotAffine { part: tree, input: a.or(b).unwrap_or_default() }),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::syntax::parse;

    #[test]
    fn inputs_enter_sums_and_one_factor_only() {
        let is_input = |name: &str| ["u", "w"].contains(&name);
        for text in ["u", "-u/l", "v*u + w*cos(x)", "2*(u - v)*(x+1)", "x^2 + sin(x)", "u*x - (w + 3)/x^2"] {
            let tree = parse(text).expect(text);
            assert!(check(&tree, &is_input).is_ok(), "{text}");
        }
        for (text, part, input) in [
            ("1 + u*u", "u*u", "u"),
            ("x*(u+1)*(w-x)", "x*(u+1)*(w-x)", "u"),
            ("x/u", "x/u", "u"),
            ("3 + sin(w*x)", "sin(w*x)", "w"),
            ("u^1", "u^1", "u"),
            ("max(0, -u)", "max(0, -u)", "u"),
            ("2^u", "2^u", "u"),
        ] {
            let tree = parse(text).expect(text);
            let found = check(&tree, &is_input).expect_err(text);
            assert_eq!((&text[found.part.span.clone()], found.input), (part, input));
        }
    }
}
