//! Parses the text of a mission into a tree.
//!
//! The grammar is a part of that of rtamt 0.4.10, so that every text that is taken here means the same there. Its order,
//! from what binds tightest: `!`, `G` and `F` before their operand; `U`; `&`; `|`. What stands between two operands groups
//! from the left. So `G A & B` is `(G A) & B`, `!A U[0,5] B` is `(!A) U[0,5] B`, `A & B U[0,5] C` is `A & (B U[0,5] C)`, and
//! `G A U[0,5] B` is `(G A) U[0,5] B`.
//!
//! It is parsed by recursive descent, a function for each line of that order. Nesting is counted, so that no text overflows
//! the stack.

use std::fmt::Display;
use std::ops::Range;

use punctual_models::is_in_name;

use crate::configuration::ConfigurationError;

/// Longest mission, in bytes, and the longest text of its normal form.
pub(super) const MAX_LENGTH: usize = 16_384;

/// Most operators and parentheses within one another.
pub(super) const MAX_NESTING: usize = 64;

/// Most characters that an error quotes at once.
const LONGEST_QUOTE: usize = 80;

/// Milliseconds in a second.
const MILLISECONDS: f64 = 1000.0;

/// The first and the last time of an interval that contains both, in s.
pub(super) type Interval = [f64; 2];

/// A formula without its place in the text.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Node {
    Name(String),
    Not(Box<Tree>),
    And(Vec<Tree>),
    Or(Vec<Tree>),
    Always(Option<Interval>, Box<Tree>),
    Eventually(Option<Interval>, Box<Tree>),
    Until(Option<Interval>, Box<[Tree; 2]>),
}

/// A formula and its range of bytes in the text, with parentheses around it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Tree {
    pub(super) node: Node,
    pub(super) span: Range<usize>,
}

/// The refusal of a mission.
pub(super) fn error(message: impl Into<String>) -> ConfigurationError {
    ConfigurationError::new("mission", message)
}

/// A part of a text on one line, with its middle left out where it is long.
pub(super) fn shortened(part: &str) -> String {
    let part = part.split_ascii_whitespace().collect::<Vec<_>>().join(" ");
    let count = part.chars().count();
    if count <= LONGEST_QUOTE {
        return part;
    }
    let begin: String = part.chars().take(LONGEST_QUOTE / 2).collect();
    let end: String = part.chars().skip(count - LONGEST_QUOTE / 4).collect();
    format!("{} ... {}", begin.trim_end(), end.trim_start())
}

/// As [`shortened`], in quotation marks.
pub(super) fn quoted(part: &str) -> String {
    format!("{:?}", shortened(part))
}

/// Parses a mission.
///
/// # Errors
///
/// The first defect, with its position in the text, counted from 1, and what to write instead.
pub(super) fn parse(text: &str) -> Result<Tree, ConfigurationError> {
    if text.len() > MAX_LENGTH {
        return Err(error(format!("has {} bytes, must have at most {MAX_LENGTH}", text.len())));
    }
    if text.trim().is_empty() {
        return Err(error("is empty, must say what to do, such as F[0,10] A: to be in A within 10 s"));
    }
    let mut parser = Parser { text, at: 0, end: 0 };
    let tree = parser.either(0)?;
    let (token, span) = parser.peek();
    match token {
        Token::End => Ok(tree),
        _ => Err(parser.unexpected(token, &span, "&, |, U or the end")),
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Token<'a> {
    Not,
    And,
    Or,
    Always,
    Eventually,
    Until,
    Open,
    Close,
    OpenInterval,
    CloseInterval,
    Separator,
    Number(&'a str),
    Word(&'a str),
    /// A character that no formula has, or a symbol, with what to write instead.
    Other(&'static str),
    End,
}

/// Symbols, a longer one before those that it begins with.
const SYMBOLS: [(&str, Token<'static>); 42] = [
    ("<->", Token::Other(ALTERNATIVES)),
    ("!==", Token::Other(COMPARISON)),
    ("->", Token::Other(IMPLICATION)),
    ("=>", Token::Other(IMPLICATION)),
    ("<>", Token::Other("eventually is written F")),
    ("[]", Token::Other("always is written G, without an interval")),
    ("&&", Token::Other("both is written &")),
    ("||", Token::Other("either is written |")),
    ("/\\", Token::Other("both is written &")),
    ("\\/", Token::Other("either is written |")),
    ("//", Token::Other(COMMENT)),
    ("/*", Token::Other(COMMENT)),
    ("!=", Token::Other(COMPARISON)),
    ("==", Token::Other(COMPARISON)),
    ("<=", Token::Other(COMPARISON)),
    (">=", Token::Other(COMPARISON)),
    ("<", Token::Other(COMPARISON)),
    (">", Token::Other(COMPARISON)),
    ("=", Token::Other(COMPARISON)),
    ("+", Token::Other(ARITHMETIC)),
    ("-", Token::Other("times count from the start, or from the visit before, and are not negative")),
    ("*", Token::Other(ARITHMETIC)),
    ("/", Token::Other(ARITHMETIC)),
    ("~", Token::Other("not is written !")),
    ("\u{ac}", Token::Other("not is written !")),
    ("\u{2227}", Token::Other("both is written &")),
    ("\u{2228}", Token::Other("either is written |")),
    ("\u{25a1}", Token::Other("always is written G")),
    ("\u{25c7}", Token::Other("eventually is written F")),
    (";", Token::Other("a mission is one formula; join several by &")),
    (".", Token::Other("a name has letters, digits and underscores only")),
    ("{", Token::Other("only ( and ) group")),
    ("}", Token::Other("only ( and ) group")),
    ("!", Token::Not),
    ("&", Token::And),
    ("|", Token::Or),
    ("(", Token::Open),
    (")", Token::Close),
    ("[", Token::OpenInterval),
    ("]", Token::CloseInterval),
    (",", Token::Separator),
    (":", Token::Separator),
];

const WORDS: [(&str, Token<'static>); 9] = [
    ("not", Token::Not),
    ("and", Token::And),
    ("or", Token::Or),
    ("G", Token::Always),
    ("always", Token::Always),
    ("F", Token::Eventually),
    ("eventually", Token::Eventually),
    ("U", Token::Until),
    ("until", Token::Until),
];

const IMPLICATION: &str =
    "a mission does not depend on what happens; write the alternatives, such as G !A | G B";
const ALTERNATIVES: &str = "write the alternatives, such as F[0,10] A | F[0,10] B";
const COMPARISON: &str = "a name alone stands for h >= 0 of its region; give another set a name of its own";
const ARITHMETIC: &str = "nothing is computed in a mission; give another set a name of its own";
const COMMENT: &str = "a mission has no comments; write them where it is declared";
const PAST: &str =
    "a mission begins when the filter does and has no past; write what is to come with G, F and U";
const SAMPLES: &str = "times are in s and do not count samples; write such as F[0,0.1] A";
const CHANGE: &str = "a mission says where to be and not what to cross; write such as F[0,10] A";

/// Operators and constants of rtamt that no mission has, with what to write instead.
const REFUSED: [(&[&str], &str); 9] = [
    (&["implies"], IMPLICATION),
    (&["iff", "xor"], ALTERNATIVES),
    (&["once", "O", "historically", "H", "since", "S", "prev", "Y", "s_prev", "sY"], PAST),
    (&["next", "X", "s_next", "sX"], SAMPLES),
    (&["rise", "fall"], CHANGE),
    (&["unless", "W"], "it is written with G and U: G[0,10] A | A U[0,10] B"),
    (&["true", "TRUE", "false", "FALSE"], "it is no region; leave it out"),
    (&["abs", "sqrt", "exp", "pow", "log", "ln"], ARITHMETIC),
    (
        &[
            "s",
            "ms",
            "us",
            "ns",
            "ps",
            "topic",
            "import",
            "input",
            "output",
            "internal",
            "const",
            "real",
            "float",
            "long",
            "complex",
            "int",
            "bool",
            "assertion",
            "specification",
            "from",
        ],
        "the word has a meaning in the language of formulas; give the region another name",
    ),
];

/// Why a word cannot be the name of a region, and what to write instead.
fn refused(word: &str) -> Option<&'static str> {
    REFUSED.iter().find(|row| row.0.contains(&word)).map(|row| row.1)
}

/// How many bytes at the beginning of `text` are a number without a sign.
fn length_of_number(text: &str) -> usize {
    let digits = |from: usize| text.bytes().skip(from).take_while(u8::is_ascii_digit).count();
    let whole = digits(0);
    let mut end = whole;
    if text[end..].starts_with('.') {
        let decimals = digits(end + 1);
        if whole + decimals == 0 {
            return 0;
        }
        end += 1 + decimals;
    }
    if whole > 0 || end > 0 {
        let exponent =
            text[end..].strip_prefix(['e', 'E']).map(|rest| usize::from(rest.starts_with(['+', '-'])));
        if let Some(sign) = exponent {
            let power = digits(end + 1 + sign);
            end += if power > 0 { 1 + sign + power } else { 0 };
        }
    }
    end
}

struct Parser<'a> {
    text: &'a str,
    /// Where the next token begins, or white space before it.
    at: usize,
    /// Where the last token ended.
    end: usize,
}

impl<'a> Parser<'a> {
    /// The next token and its range of bytes.
    fn peek(&self) -> (Token<'a>, Range<usize>) {
        let rest = self.text[self.at..].trim_start_matches([' ', '\t', '\r', '\n', '\u{c}']);
        let start = self.text.len() - rest.len();
        let (token, length) = Self::first(rest);
        (token, start..start + length)
    }

    /// The token that `rest` begins with, and its length in bytes.
    fn first(rest: &'a str) -> (Token<'a>, usize) {
        let Some(character) = rest.chars().next() else { return (Token::End, 0) };
        let number = length_of_number(rest);
        if number > 0 {
            return (Token::Number(&rest[..number]), number);
        }
        let word = rest.find(|c| !is_in_name(c)).unwrap_or(rest.len());
        if word > 0 {
            let word = &rest[..word];
            let known = WORDS.iter().find(|known| known.0 == word);
            return (known.map_or(Token::Word(word), |known| known.1), word.len());
        }
        match SYMBOLS.iter().find(|symbol| rest.starts_with(symbol.0)) {
            Some((symbol, token)) => (*token, symbol.len()),
            None if character.is_alphabetic() => {
                (Token::Other("names have ASCII letters only"), character.len_utf8())
            }
            None => (Token::Other(""), character.len_utf8()),
        }
    }

    fn advance(&mut self, span: &Range<usize>) {
        (self.at, self.end) = (span.end, span.end);
    }

    /// Takes the next token if it is `wanted`.
    fn takes(&mut self, wanted: Token<'_>) -> bool {
        let (token, span) = self.peek();
        let is_wanted = token == wanted;
        if is_wanted {
            self.advance(&span);
        }
        is_wanted
    }

    fn expect(&mut self, wanted: Token<'_>, what: &str) -> Result<(), ConfigurationError> {
        let (token, span) = self.peek();
        if token != wanted {
            return Err(self.unexpected(token, &span, what));
        }
        self.advance(&span);
        Ok(())
    }

    /// The refusal of a token where `wanted` would have to be.
    fn unexpected(&self, token: Token<'_>, span: &Range<usize>, wanted: &str) -> ConfigurationError {
        let advice = match token {
            Token::Other(advice) => advice,
            Token::Word(word) => refused(word).unwrap_or("the operators are G, F, U, &, | and !"),
            Token::OpenInterval => "an interval stands behind G, F or U",
            Token::Until => "A U[0,10] B needs both: what is kept, and what is visited",
            Token::Close if wanted == CLOSE => "an interval contains both its ends",
            _ => "",
        };
        self.wrong(span, wanted, advice)
    }

    fn wrong(&self, span: &Range<usize>, wanted: &str, advice: &str) -> ConfigurationError {
        let position = self.text[..span.start].chars().count() + 1;
        let found = match &self.text[span.clone()] {
            "" => "its end".to_owned(),
            found => quoted(found),
        };
        let semicolon = if advice.is_empty() { "" } else { "; " };
        let text = quoted(self.text);
        error(format!("at character {position} of {text} is {found}, must be {wanted}{semicolon}{advice}"))
    }

    fn check_nesting(&self, depth: usize) -> Result<(), ConfigurationError> {
        if depth <= MAX_NESTING {
            return Ok(());
        }
        let position = self.text[..self.at].chars().count() + 1;
        Err(error(format!(
            "nests more than {MAX_NESTING} operators and parentheses at character {position}, must nest fewer; \
             a & b & c needs no parentheses"
        )))
    }

    /// Operands that `operator` stands between; one alone is itself.
    fn several(
        &mut self,
        operator: Token<'_>,
        operand: impl Fn(&mut Self) -> Result<Tree, ConfigurationError>,
        node: fn(Vec<Tree>) -> Node,
    ) -> Result<Tree, ConfigurationError> {
        let first = operand(self)?;
        let start = first.span.start;
        let mut all = vec![first];
        while self.takes(operator) {
            all.push(operand(self)?);
        }
        Ok(match all.len() {
            1 => all.remove(0),
            _ => Tree { node: node(all), span: start..self.end },
        })
    }

    fn either(&mut self, depth: usize) -> Result<Tree, ConfigurationError> {
        self.several(Token::Or, |parser| parser.both(depth), Node::Or)
    }

    fn both(&mut self, depth: usize) -> Result<Tree, ConfigurationError> {
        self.several(Token::And, |parser| parser.until(depth), Node::And)
    }

    fn until(&mut self, depth: usize) -> Result<Tree, ConfigurationError> {
        let mut tree = self.operand(depth)?;
        let mut nested = depth;
        while self.takes(Token::Until) {
            // The operand on the left is one level deeper each time.
            nested += 1;
            self.check_nesting(nested)?;
            let interval = self.interval()?;
            let right = self.operand(depth)?;
            let span = tree.span.start..right.span.end;
            tree = Tree { node: Node::Until(interval, Box::new([tree, right])), span };
        }
        Ok(tree)
    }

    fn operand(&mut self, depth: usize) -> Result<Tree, ConfigurationError> {
        self.check_nesting(depth)?;
        let (token, span) = self.peek();
        let start = span.start;
        let node = match token {
            Token::Not => {
                self.advance(&span);
                Node::Not(Box::new(self.operand(depth + 1)?))
            }
            Token::Always => {
                self.advance(&span);
                Node::Always(self.interval()?, Box::new(self.operand(depth + 1)?))
            }
            Token::Eventually => {
                self.advance(&span);
                Node::Eventually(self.interval()?, Box::new(self.operand(depth + 1)?))
            }
            Token::Open => {
                self.advance(&span);
                let inside = self.either(depth + 1)?;
                self.expect(Token::Close, "&, |, U or \")\"")?;
                inside.node
            }
            Token::Word(word) if refused(word).is_none() => {
                self.advance(&span);
                Node::Name(word.to_owned())
            }
            _ => return Err(self.unexpected(token, &span, "a name, G, F, ! or \"(\"")),
        };
        Ok(Tree { node, span: start..self.end })
    }

    /// The interval behind an operator, if there is one.
    fn interval(&mut self) -> Result<Option<Interval>, ConfigurationError> {
        let (_, open) = self.peek();
        if !self.takes(Token::OpenInterval) {
            return Ok(None);
        }
        let (first, is_in_ms) = self.time()?;
        let (token, span) = self.peek();
        if token != Token::Separator {
            return Err(self.unexpected_in_interval(token, &span, "a unit, \",\" or \":\""));
        }
        self.advance(&span);
        let (last, ends_in_ms) = self.time()?;
        let (token, span) = self.peek();
        if token != Token::CloseInterval {
            return Err(self.unexpected_in_interval(token, &span, CLOSE));
        }
        self.advance(&span);
        let part = &self.text[open.start..self.end];
        // As rtamt has it: a number without a unit has that of the last.
        let is_in_ms = match (is_in_ms, ends_in_ms) {
            (Some(_), None) => {
                let message = "has a unit at its first time only, must have one at both, or at the last";
                return Err(error(format!("{} {message}", quoted(part))));
            }
            (first, last) => [first.or(last), last].map(|unit| unit.unwrap_or(false)),
        };
        let in_seconds = |time: f64, in_ms: bool| if in_ms { time / MILLISECONDS } else { time };
        let interval = [in_seconds(first, is_in_ms[0]), in_seconds(last, is_in_ms[1])];
        check_interval(part, interval)?;
        Ok(Some(interval))
    }

    /// A number without a sign, and whether it is in ms, if it has a unit.
    fn time(&mut self) -> Result<(f64, Option<bool>), ConfigurationError> {
        let (token, span) = self.peek();
        let Token::Number(digits) = token else {
            return Err(self.unexpected_in_interval(token, &span, "a number in s"));
        };
        // rtamt would read two numbers.
        let is_whole = digits.bytes().all(|b| b.is_ascii_digit());
        if is_whole && digits.len() > 1 && digits.starts_with('0') {
            return Err(self.wrong(&span, "a number in s", "a whole number has no 0 before it"));
        }
        let value: f64 = digits.parse().map_err(|_| self.wrong(&span, "a number in s", ""))?;
        self.advance(&span);
        for (unit, is_in_ms) in [("s", false), ("ms", true)] {
            if self.takes(Token::Word(unit)) {
                return Ok((value, Some(is_in_ms)));
            }
        }
        Ok((value, None))
    }

    fn unexpected_in_interval(
        &self,
        token: Token<'_>,
        span: &Range<usize>,
        wanted: &str,
    ) -> ConfigurationError {
        match token {
            Token::Word(word) if ["inf", "infinity", "oo"].contains(&word.to_lowercase().as_str()) => {
                self.wrong(span, wanted, "for ever is written without an interval: G A, or F[0,10] G A")
            }
            Token::Word(_) => self.wrong(span, wanted, "a time is a decimal number, its unit s, ms or none"),
            _ => self.unexpected(token, span, wanted),
        }
    }
}

/// What ends an interval.
const CLOSE: &str = "a unit or \"]\"";

/// Refuses times that are infinite or in the wrong order, in the interval that `part` writes.
pub(super) fn check_interval(part: impl Display, [first, last]: Interval) -> Result<(), ConfigurationError> {
    let part = quoted(&part.to_string());
    if !first.is_finite() || !last.is_finite() {
        return Err(error(format!("{part} has a time that is too large, must have finite ones")));
    }
    if first > last {
        return Err(error(format!("{part} ends before it begins, must have the smaller time first")));
    }
    Ok(())
}
