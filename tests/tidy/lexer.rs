//! Splits Rust source as far as the rules need it: into code without comments and literals, and the string
//! literals.

/// One source file, split.
pub(crate) struct Lexed {
    /// The source with every comment removed and every string and character literal emptied; the line numbers
    /// are those of the file.
    pub(crate) code: String,
    /// The contents of the string literals as written, including escapes, each with its line.
    pub(crate) strings: Vec<(usize, String)>,
}

impl Lexed {
    /// The words (identifiers, keywords, numbers) and single other characters of the code, without blanks,
    /// each with its line.
    pub(crate) fn tokens(&self) -> Vec<(usize, &str)> {
        let mut tokens = Vec::new();
        for (number, line) in self.code.lines().enumerate() {
            let mut rest = line;
            while let Some(first) = rest.chars().next() {
                let word = |c: char| c.is_alphanumeric() || c == '_';
                let end = if word(first) {
                    rest.find(|c| !word(c)).unwrap_or(rest.len())
                } else {
                    first.len_utf8()
                };
                if !first.is_whitespace() {
                    tokens.push((number + 1, &rest[..end]));
                }
                rest = &rest[end..];
            }
        }
        tokens
    }

    /// The lines at which these tokens follow one another.
    pub(crate) fn lines_with(&self, wanted: &[&str]) -> Vec<usize> {
        let tokens = self.tokens();
        let found = tokens.windows(wanted.len()).filter(|w| w.iter().map(|t| t.1).eq(wanted.iter().copied()));
        found.map(|w| w[0].0).collect()
    }
}

/// Splits `source`.
pub(crate) fn lex(source: &str) -> Lexed {
    let bytes = source.as_bytes();
    let mut lexed = Lexed { code: String::with_capacity(source.len()), strings: Vec::new() };
    let mut at = 0;
    while let Some(&byte) = bytes.get(at) {
        let rest = &source[at..];
        let raw =
            raw_string(rest).filter(|_| !lexed.code.ends_with(|c: char| c.is_alphanumeric() || c == '_'));
        if rest.starts_with("//") {
            at += rest.find('\n').unwrap_or(rest.len());
        } else if rest.starts_with("/*") {
            at = keep_lines(&mut lexed.code, source, at, at + block_comment(rest));
        } else if let Some((open, content, length)) = raw {
            lexed.strings.push((line(&lexed.code), rest[open..open + content].to_owned()));
            lexed.code.push_str("\"\"");
            at = keep_lines(&mut lexed.code, source, at, at + length);
        } else if byte == b'"' {
            let length = 1 + literal(&bytes[at + 1..], b'"');
            lexed.strings.push((line(&lexed.code), rest[1..length].to_owned()));
            lexed.code.push_str("\"\"");
            at = keep_lines(&mut lexed.code, source, at, at + length + 1);
        } else if byte == b'\'' && is_character(rest) {
            lexed.code.push_str("' '");
            at += 2 + literal(&bytes[at + 1..], b'\'');
        } else {
            let character = rest.chars().next().unwrap_or_default();
            lexed.code.push(character);
            at += character.len_utf8();
        }
    }
    lexed
}

/// The number of the next line.
fn line(code: &str) -> usize {
    1 + code.bytes().filter(|b| *b == b'\n').count()
}

/// Advances from `from` to `to`, keeping the line breaks in between.
fn keep_lines(code: &mut String, source: &str, from: usize, to: usize) -> usize {
    let to = to.min(source.len());
    code.extend(source[from..to].chars().filter(|c| *c == '\n'));
    to
}

/// The length of the block comment at the start of `rest`; they nest.
fn block_comment(rest: &str) -> usize {
    let (mut depth, mut at) = (0_usize, 0);
    let bytes = rest.as_bytes();
    while at < bytes.len() {
        match &bytes[at..bytes.len().min(at + 2)] {
            b"/*" => (depth, at) = (depth + 1, at + 2),
            b"*/" => (depth, at) = (depth - 1, at + 2),
            _ => at += 1,
        }
        if depth == 0 {
            break;
        }
    }
    at
}

/// For a raw string at the start of `rest`: where its content begins, how long that is, and the
/// length of the whole.
fn raw_string(rest: &str) -> Option<(usize, usize, usize)> {
    let hashes = rest.strip_prefix("br").or_else(|| rest.strip_prefix("r"))?;
    let body = hashes.trim_start_matches('#');
    let content = body.strip_prefix('"')?;
    let end = format!("\"{}", "#".repeat(hashes.len() - body.len()));
    let length = content.find(&end)?;
    let open = rest.len() - content.len();
    Some((open, length, open + length + end.len()))
}

/// The length of a literal up to the closing `quote`, skipping escapes.
fn literal(bytes: &[u8], quote: u8) -> usize {
    let mut at = 0;
    while at < bytes.len() && bytes[at] != quote {
        at += if bytes[at] == b'\\' { 2 } else { 1 };
    }
    at
}

/// Whether the quote at the start of `rest` opens a character literal, not a lifetime.
fn is_character(rest: &str) -> bool {
    let mut chars = rest.chars().skip(1);
    match (chars.next(), chars.next()) {
        (Some('\\'), _) => true,
        (_, after) => after == Some('\''),
    }
}

#[test]
fn sources_are_taken_apart() {
    let source = "let a = \"x \\\" // y\"; // z \"\n/* \" /* ' */ */ let b = r#\"q\"\n\"# + 'c' + '\\'' + br\"d\";\nfn f<'a>(r: u8) {}\n";
    let lexed = lex(source);
    assert_eq!(lexed.code, "let a = \"\"; \n let b = \"\"\n + ' ' + ' ' + \"\";\nfn f<'a>(r: u8) {}\n");
    let strings: Vec<_> = lexed.strings.iter().map(|(line, text)| (*line, text.as_str())).collect();
    assert_eq!(strings, [(1, "x \\\" // y"), (2, "q\"\n"), (3, "d")]);
    assert_eq!(lexed.lines_with(&["fn", "f"]), [4]);
}
