//! Parses text into trees.
//!
//! The grammar is winnow's Pratt parser over four kinds of operands. Signs, operators and nesting, which
//! could make it recurse deeply, are counted before it runs. So no text overflows the stack.

use std::ops::Range;

use winnow::ascii::{digit0, digit1, multispace0};
use winnow::combinator::{Infix, Prefix, alt, cut_err, delimited, expression, opt, preceded, separated};
use winnow::error::{ContextError, ErrMode, StrContext, StrContextValue};
use winnow::prelude::*;
use winnow::stream::LocatingSlice;
use winnow::token::{one_of, take_while};

/// Longest expression, in bytes.
pub const MAX_LENGTH: usize = 4096;

/// Most operators and signs in an expression.
pub const MAX_OPERATORS: usize = 512;

/// Deepest nesting of parentheses; also the most `^` in an expression, and the most signs in a row.
pub const MAX_NESTING: usize = 32;

/// A function of expressions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Function {
    /// Square root.
    Sqrt,
    /// The exponential function.
    Exp,
    /// Natural logarithm.
    Ln,
    /// Sine.
    Sin,
    /// Cosine.
    Cos,
    /// Tangent.
    Tan,
    /// Arc tangent.
    Atan,
    /// `atan2(y, x)`: the angle of a point.
    Atan2,
    /// Hyperbolic tangent.
    Tanh,
    /// Absolute value.
    Abs,
    /// The smaller of two.
    Min,
    /// The larger of two.
    Max,
}

/// The functions by name, with their numbers of arguments.
pub const FUNCTIONS: [(&str, Function, usize); 12] = [
    ("sqrt", Function::Sqrt, 1),
    ("exp", Function::Exp, 1),
    ("ln", Function::Ln, 1),
    ("sin", Function::Sin, 1),
    ("cos", Function::Cos, 1),
    ("tan", Function::Tan, 1),
    ("atan", Function::Atan, 1),
    ("atan2", Function::Atan2, 2),
    ("abs", Function::Abs, 1),
    ("tanh", Function::Tanh, 1),
    ("min", Function::Min, 2),
    ("max", Function::Max, 2),
];

/// The time, which only barriers may use.
pub(crate) const TIME: &str = "t";
/// π.
pub(crate) const PI: &str = "pi";

/// Whether a name may begin with `character`.
fn is_first_in_name(character: char) -> bool {
    character.is_ascii_alphabetic() || character == '_'
}

/// Whether `character` may occur in a name.
pub fn is_in_name(character: char) -> bool {
    character.is_ascii_alphanumeric() || character == '_'
}

/// Whether `name` occurs in the text of an expression.
pub fn mentions(expression: &str, name: &str) -> bool {
    expression.split(|c| !is_in_name(c)).any(|word| word == name)
}

/// Whether `name` is a C identifier: ASCII letters, digits and underscores, not starting with a digit.
pub(crate) fn is_identifier(name: &str) -> bool {
    name.starts_with(is_first_in_name) && name.chars().all(is_in_name)
}

/// Whether `name` has a meaning in every expression and so cannot name a variable.
pub fn is_reserved(name: &str) -> bool {
    name == TIME || name == PI || FUNCTIONS.iter().any(|f| f.0 == name)
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Operator {
    Add,
    Subtract,
    Multiply,
    Divide,
    Power,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Node {
    Number(f64),
    Name(String),
    Negate(Box<Tree>),
    Binary(Operator, Box<[Tree; 2]>),
    Call(String, Vec<Tree>),
}

/// An expression and its range of bytes in the text.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Tree {
    pub(crate) node: Node,
    pub(crate) span: Range<usize>,
}

type Input<'a> = LocatingSlice<&'a str>;

/// Parses an expression.
///
/// # Errors
///
/// A message on the first defect, with its position in the text, counted from 1.
pub(crate) fn parse(text: &str) -> Result<Tree, String> {
    check_size(text)?;
    sum.parse(LocatingSlice::new(text)).map_err(|e| {
        let position = text[..e.offset().min(text.len())].chars().count() + 1;
        let found = match text[e.offset().min(text.len())..].chars().next() {
            Some(c) => format!("is {c:?}"),
            None => "is its end".to_owned(),
        };
        let wanted = e.inner().context().find_map(|context| match context {
            StrContext::Expected(StrContextValue::Description(what)) => Some(*what),
            _ => None,
        });
        let wanted = wanted.unwrap_or("an operator or the end");
        let hint = hint(&text[..e.offset().min(text.len())], &text[e.offset().min(text.len())..]);
        format!("at character {position} of {text:?} {found}, must be {wanted}{hint}")
    })
}

/// Notations of other languages, or with other characters, and what to write instead.
const HABITS: [(&str, &str); 16] = [
    ("=", "an expression has no =; a barrier is what is to be >= 0, a derivative the right-hand side alone"),
    ("<", "an expression has no comparison; a barrier is what is to be >= 0, as b - a for a <= b"),
    (">", "an expression has no comparison; a barrier is what is to be >= 0, as a - b for a >= b"),
    ("&", "both a >= 0 and b >= 0 is min(a, b), or two barriers"),
    ("|", "an absolute value is abs(x); a >= 0 or b >= 0 is max(a, b)"),
    ("'", "a derivative has no symbol; name the state that equals it"),
    (".", "a name has no dots: sqrt, not np.sqrt"),
    ("[", "only ( and ) group"),
    ("{", "only ( and ) group"),
    ("\u{2212}", "the minus sign is -"),
    ("\u{2013}", "the minus sign is -"),
    ("\u{b7}", "a product is written *"),
    ("\u{22c5}", "a product is written *"),
    ("\u{d7}", "a product is written *"),
    ("\u{b2}", "a square is written ^2"),
    ("\u{b3}", "a cube is written ^3"),
];

/// A hint on what to write instead if an expression continues with `rest` after `before`.
fn hint(before: &str, rest: &str) -> String {
    let (before, next) = (before.trim_end(), rest.chars().next());
    let is_digit = |c: Option<char>| c.is_some_and(|c| c.is_ascii_digit());
    let ends = before.chars().next_back();
    let advice = match next {
        Some('*') if ends == Some('*') => Some("a power is written ^"),
        Some(',') if is_digit(ends) && is_digit(rest.chars().nth(1)) => Some("a decimal point is ."),
        Some(c) if is_in_name(c) || c == '(' => {
            let product = ends.is_some_and(|c| is_in_name(c) || c == ')');
            product.then_some("a product is written with *")
        }
        _ => HABITS.iter().find(|habit| rest.starts_with(habit.0)).map(|habit| habit.1),
    };
    let is_letter = next.is_some_and(|c| c.is_alphabetic() && !c.is_ascii());
    let advice = advice.or(is_letter.then_some("names have ASCII letters only"));
    advice.map_or_else(String::new, |advice| format!("; {advice}"))
}

/// Refuses text that could make the parser, or a walk over its tree, recurse deeply.
fn check_size(text: &str) -> Result<(), String> {
    if text.len() > MAX_LENGTH {
        return Err(format!("has {} bytes, must have at most {MAX_LENGTH}", text.len()));
    }
    let operators = text.chars().filter(|c| "+-*/".contains(*c)).count();
    if operators > MAX_OPERATORS {
        return Err(format!("has {operators} operators, must have at most {MAX_OPERATORS}"));
    }
    let (mut depth, mut deepest, mut powers, mut signs, mut most_signs) = (0_usize, 0, 0, 0, 0);
    for c in text.chars().filter(|c| !c.is_whitespace()) {
        match c {
            '(' => depth += 1,
            ')' => depth = depth.saturating_sub(1),
            '^' => powers += 1,
            _ => {}
        }
        signs = if matches!(c, '+' | '-') { signs + 1 } else { 0 };
        (deepest, most_signs) = (depth.max(deepest), signs.max(most_signs));
    }
    for (count, what) in [
        (deepest, "parentheses within one another"),
        (powers, "powers"),
        (most_signs, "signs after one another"),
    ] {
        if count > MAX_NESTING {
            return Err(format!("has {count} {what}, must have at most {MAX_NESTING}"));
        }
    }
    Ok(())
}

fn expected(what: &'static str) -> StrContext {
    StrContext::Expected(StrContextValue::Description(what))
}

fn binary(operator: Operator, a: Tree, b: Tree) -> ModalResult<Tree> {
    let span = a.span.start..b.span.end;
    Ok(Tree { node: Node::Binary(operator, Box::new([a, b])), span })
}

/// Parses operands and operators; an operator with a higher power binds more tightly.
fn sum(input: &mut Input<'_>) -> ModalResult<Tree> {
    const PLUS: i64 = 10;
    const TIMES: i64 = 20;
    const SIGN: i64 = 30;
    const POWER: i64 = 40;
    type Operation<'a> = Infix<Input<'a>, Tree, ErrMode<ContextError>>;
    fn infix<'a>(input: &mut Input<'a>) -> ModalResult<Operation<'a>> {
        let operator = one_of(['+', '-', '*', '/', '^']).parse_next(input)?;
        Ok(match operator {
            '+' => Infix::Left(PLUS, |_, a, b| binary(Operator::Add, a, b)),
            '-' => Infix::Left(PLUS, |_, a, b| binary(Operator::Subtract, a, b)),
            '*' => Infix::Left(TIMES, |_, a, b| binary(Operator::Multiply, a, b)),
            '/' => Infix::Left(TIMES, |_, a, b| binary(Operator::Divide, a, b)),
            _ => Infix::Right(POWER, |_, a, b| binary(Operator::Power, a, b)),
        })
    }
    fn prefix<'a>(input: &mut Input<'a>) -> ModalResult<Prefix<Input<'a>, Tree, ErrMode<ContextError>>> {
        let wanted = expected("a number, a name, a sign or \"(\"");
        let sign = one_of(['-', '+']).context(wanted).parse_next(input)?;
        Ok(match sign {
            '-' => Prefix(SIGN, |_, a: Tree| {
                let span = a.span.clone();
                Ok(Tree { node: Node::Negate(Box::new(a)), span })
            }),
            _ => Prefix(SIGN, |_, a| Ok(a)),
        })
    }
    let operand = delimited(multispace0, operand, multispace0);
    expression(operand).prefix(preceded(multispace0, prefix)).infix(infix).parse_next(input)
}

fn operand(input: &mut Input<'_>) -> ModalResult<Tree> {
    let (node, span) = alt((number, named, grouped)).with_span().parse_next(input)?;
    Ok(Tree { node, span })
}

fn number(input: &mut Input<'_>) -> ModalResult<Node> {
    let digits = alt(((digit1, opt(('.', digit0))).void(), ('.', digit1).void()));
    let exponent = (one_of(['e', 'E']), opt(one_of(['+', '-'])), digit1);
    let value: f64 = (digits, opt(exponent)).take().parse_to().parse_next(input)?;
    Ok(Node::Number(value))
}

/// Parses a name or a function call.
fn named(input: &mut Input<'_>) -> ModalResult<Node> {
    let head = one_of(is_first_in_name);
    let tail = take_while(0.., is_in_name);
    let name: &str = (head, tail).take().parse_next(input)?;
    let open = opt(preceded(multispace0, '(')).parse_next(input)?;
    if open.is_none() {
        return Ok(Node::Name(name.to_owned()));
    }
    let close = ')'.context(expected("an operator, \",\" or \")\""));
    let mut arguments = cut_err((separated(1.., sum, ','), close)).map(|(arguments, _)| arguments);
    Ok(Node::Call(name.to_owned(), arguments.parse_next(input)?))
}

fn grouped(input: &mut Input<'_>) -> ModalResult<Node> {
    let close = ')'.context(expected("an operator or \")\""));
    let inside = preceded('(', cut_err((sum, close)));
    inside.map(|(tree, _)| tree.node).parse_next(input)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The tree as text, with every pair of operands in parentheses.
    fn shown(tree: &Tree) -> String {
        match &tree.node {
            Node::Number(value) => value.to_string(),
            Node::Name(name) => name.clone(),
            Node::Negate(a) => format!("(-{})", shown(a)),
            Node::Binary(operator, pair) => {
                let sign = match operator {
                    Operator::Add => '+',
                    Operator::Subtract => '-',
                    Operator::Multiply => '*',
                    Operator::Divide => '/',
                    Operator::Power => '^',
                };
                format!("({}{sign}{})", shown(&pair[0]), shown(&pair[1]))
            }
            Node::Call(name, arguments) => {
                format!("{name}({})", arguments.iter().map(shown).collect::<Vec<_>>().join(","))
            }
        }
    }

    #[test]
    fn operators_are_done_in_the_order_of_mathematics() {
        for (text, wanted) in [
            ("1-2-3", "((1-2)-3)"),
            ("a/b*c", "((a/b)*c)"),
            ("a+b*c^2", "(a+(b*(c^2)))"),
            ("-x^2", "(-(x^2))"),
            ("2^-x^2", "(2^(-(x^2)))"),
            ("2^3^2", "(2^(3^2))"),
            ("-a*b", "((-a)*b)"),
            ("a--b", "(a-(-b))"),
            ("a - + b", "(a-b)"),
            (" f ( a , (b) ) ", "f(a,b)"),
            ("1.5e-3 + .5 + 2.", "((0.0015+0.5)+2)"),
            ("e2", "e2"),
            ("(a+b)*(c-d)", "((a+b)*(c-d))"),
            ("max(1,2)^2", "(max(1,2)^2)"),
        ] {
            assert_eq!(shown(&parse(text).unwrap_or_else(|e| panic!("{text}: {e}"))), wanted, "{text}");
        }
    }

    #[test]
    fn defects_are_told_with_their_position() {
        for (text, wanted) in [
            (
                "v * * 2",
                "at character 5 of \"v * * 2\" is '*', must be a number, a name, a sign or \"(\"; a power is written ^",
            ),
            ("", "at character 1 of \"\" is its end, must be a number, a name, a sign or \"(\""),
            (
                "2 x",
                "at character 3 of \"2 x\" is 'x', must be an operator or the end; a product is written with *",
            ),
            (
                "2x",
                "at character 2 of \"2x\" is 'x', must be an operator or the end; a product is written with *",
            ),
            ("(a + b", "at character 7 of \"(a + b\" is its end, must be an operator or \")\""),
            ("a + b)", "at character 6 of \"a + b)\" is ')', must be an operator or the end"),
            (
                "sin(a b)",
                "at character 7 of \"sin(a b)\" is 'b', must be an operator, \",\" or \")\"; a product is written with *",
            ),
            ("sin()", "at character 5 of \"sin()\" is ')', must be a number, a name, a sign or \"(\""),
            (
                "a + (b *)",
                "at character 9 of \"a + (b *)\" is ')', must be a number, a name, a sign or \"(\"",
            ),
            ("a, b", "at character 2 of \"a, b\" is ',', must be an operator or the end"),
            (
                "\u{e4} + $",
                "at character 1 of \"\u{e4} + $\" is '\u{e4}', must be a number, a name, a sign or \"(\"; names have \
                 ASCII letters only",
            ),
            ("a $ b", "at character 3 of \"a $ b\" is '$', must be an operator or the end"),
        ] {
            assert_eq!(parse(text).expect_err(text), wanted);
        }
    }

    /// Notations of other languages, and of handwriting.
    #[test]
    fn habits_are_answered() {
        for (text, wanted) in [
            ("v**2", "; a power is written ^"),
            (
                "x = 3",
                "; an expression has no =; a barrier is what is to be >= 0, a derivative the right-hand side alone",
            ),
            (
                "x == 3",
                "; an expression has no =; a barrier is what is to be >= 0, a derivative the right-hand side alone",
            ),
            (
                "x <= 3",
                "; an expression has no comparison; a barrier is what is to be >= 0, as b - a for a <= b",
            ),
            (
                "x > 3",
                "; an expression has no comparison; a barrier is what is to be >= 0, as a - b for a >= b",
            ),
            ("x && y", "; both a >= 0 and b >= 0 is min(a, b), or two barriers"),
            ("|x|", "; an absolute value is abs(x); a >= 0 or b >= 0 is max(a, b)"),
            ("x' + 1", "; a derivative has no symbol; name the state that equals it"),
            ("np.sqrt(x)", "; a name has no dots: sqrt, not np.sqrt"),
            ("[x + 1]*2", "; only ( and ) group"),
            ("2x", "; a product is written with *"),
            ("(a + b)(c + d)", "; a product is written with *"),
            ("sin x", "; a product is written with *"),
            ("a \u{2212} b", "; the minus sign is -"),
            ("a\u{b7}b", "; a product is written *"),
            ("x\u{b2}", "; a square is written ^2"),
            ("0,5 * x", "; a decimal point is ."),
            ("\u{3b8} + 1", "; names have ASCII letters only"),
            ("x, y", ""),
            ("x #", ""),
        ] {
            let message = parse(text).expect_err(text);
            let hint = message.split_once("must be").expect("what is wanted").1.split_once(';');
            assert_eq!(
                hint.map_or_else(String::new, |(_, hint)| format!(";{hint}")),
                wanted,
                "{text}: {message}"
            );
        }
    }

    #[test]
    fn what_would_recurse_deeply_is_refused() {
        let deep = |n: usize| format!("{}x{}", "(".repeat(n), ")".repeat(n));
        assert!(parse(&deep(MAX_NESTING)).is_ok());
        let wanted = "has 33 parentheses within one another, must have at most 32";
        assert_eq!(parse(&deep(MAX_NESTING + 1)).expect_err("deep"), wanted);
        let wanted = "has 4000 parentheses within one another, must have at most 32";
        assert_eq!(parse(&"(".repeat(4000)).expect_err("deep"), wanted);
        assert_eq!(
            parse(&format!("{}x", "-".repeat(40))).expect_err("signs"),
            "has 40 signs after one another, must have at most 32"
        );
        assert_eq!(
            parse(&format!("{}x", "x^".repeat(40))).expect_err("powers"),
            "has 40 powers, must have at most 32"
        );
        assert_eq!(parse(&"x".repeat(5000)).expect_err("long"), "has 5000 bytes, must have at most 4096");
        let long = |n: usize| vec!["x"; n + 1].join("+");
        assert_eq!(parse(&long(MAX_OPERATORS)).expect("a long sum").span, 0..2 * MAX_OPERATORS + 1);
        assert_eq!(
            parse(&long(MAX_OPERATORS + 1)).expect_err("long"),
            "has 513 operators, must have at most 512"
        );
    }
}
