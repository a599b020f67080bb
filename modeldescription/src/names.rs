//! The characters and forms allowed in texts, identifiers and structured variable names.

/// The first character that XML 1.0 cannot represent, not even escaped.
pub(crate) fn forbidden_character(text: &str) -> Option<char> {
    text.chars().find(|&c| match c {
        '\t' | '\n' | '\r' => false,
        '\u{FFFE}' | '\u{FFFF}' => true,
        c => c < ' ',
    })
}

/// Whether a text has no tab, line feed or carriage return, so that `xs:normalizedString` keeps it.
pub(crate) fn is_one_line(text: &str) -> bool {
    !text.contains(['\t', '\n', '\r'])
}

/// Whether a text is a C identifier in ASCII.
pub fn is_c_identifier(text: &str) -> bool {
    let mut bytes = text.bytes();
    bytes.next().is_some_and(is_nondigit) && bytes.all(is_word)
}

/// Whether a text is a name in the structured convention (FMI 2.0.4, section 2.2.9):
///
/// ```text
/// name            = identifier | "der(" identifier [ "," unsignedInteger ] ")"
/// identifier      = B-name [ arrayIndices ] { "." B-name [ arrayIndices ] }
/// B-name          = nondigit { digit | nondigit } | Q-name
/// Q-name          = "'" ( Q-char | escape ) { Q-char | escape } "'"
/// arrayIndices    = "[" unsignedInteger { "," unsignedInteger } "]"
/// ```
pub fn is_structured_name(text: &str) -> bool {
    let whole = |rest: Option<&[u8]>| rest.is_some_and(<[u8]>::is_empty);
    whole(identifier(text.as_bytes())) || whole(derivative(text.as_bytes()))
}

// Each of these consumes one production from the front and returns the rest, or `None` if it does not match.

fn derivative(text: &[u8]) -> Option<&[u8]> {
    let rest = identifier(text.strip_prefix(b"der(")?)?;
    let rest = match rest.strip_prefix(b",") {
        Some(rest) => unsigned_integer(rest)?,
        None => rest,
    };
    rest.strip_prefix(b")")
}

fn identifier(mut text: &[u8]) -> Option<&[u8]> {
    loop {
        text = array_indices(b_name(text)?)?;
        match text.strip_prefix(b".") {
            Some(rest) => text = rest,
            None => return Some(text),
        }
    }
}

fn b_name(text: &[u8]) -> Option<&[u8]> {
    match text {
        [b'\'', rest @ ..] => q_name(rest),
        [first, rest @ ..] if is_nondigit(*first) => {
            let length = rest.iter().take_while(|b| is_word(**b)).count();
            rest.get(length..)
        }
        _ => None,
    }
}

fn q_name(mut text: &[u8]) -> Option<&[u8]> {
    let mut empty = true;
    loop {
        text = match text {
            [b'\'', rest @ ..] => return (!empty).then_some(rest),
            [b'\\', escaped, rest @ ..] if b"'\"?\\abfnrtv".contains(escaped) => rest,
            [first, rest @ ..] if is_word(*first) || b"!#$%&()*+,-./:;<>=?@[]^{}|~ ".contains(first) => rest,
            _ => return None,
        };
        empty = false;
    }
}

/// Optional: a text that does not begin with a bracket is returned unchanged.
fn array_indices(text: &[u8]) -> Option<&[u8]> {
    let Some(mut text) = text.strip_prefix(b"[") else { return Some(text) };
    loop {
        text = match unsigned_integer(text)? {
            [b',', rest @ ..] => rest,
            [b']', rest @ ..] => return Some(rest),
            _ => return None,
        };
    }
}

fn unsigned_integer(text: &[u8]) -> Option<&[u8]> {
    let length = text.iter().take_while(|b| b.is_ascii_digit()).count();
    if length == 0 { None } else { text.get(length..) }
}

fn is_nondigit(byte: u8) -> bool {
    byte == b'_' || byte.is_ascii_alphabetic()
}

fn is_word(byte: u8) -> bool {
    is_nondigit(byte) || byte.is_ascii_digit()
}

/// The folder of this platform's binaries in an archive of FMI 2.0 (section 2.3), such as `linux64`.
pub const PLATFORM: &str = if cfg!(all(target_os = "windows", target_arch = "x86_64")) {
    "win64"
} else if cfg!(all(target_os = "windows", target_arch = "x86")) {
    "win32"
} else if cfg!(all(target_os = "windows", target_arch = "aarch64")) {
    "aarch64-windows"
} else if cfg!(target_os = "macos") {
    "darwin64"
} else if cfg!(all(target_os = "linux", target_arch = "x86_64")) {
    "linux64"
} else if cfg!(all(target_os = "linux", target_arch = "x86")) {
    "linux32"
} else if cfg!(all(target_os = "linux", target_arch = "aarch64")) {
    "aarch64-linux"
} else {
    "unknown"
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn structured_names() {
        let good = [
            "x",
            "_a1",
            "u_ref.omega",
            "goal.centre[1]",
            "a[1,22].b[3]",
            "der(x)",
            "der(der)",
            "der(x.v[2],2)",
            "'a b'.c",
            "'\\n'",
        ];
        for name in good {
            assert!(is_structured_name(name), "{name}");
        }
        let bad = [
            "", ".", "a.", ".a", "1a", "a b", "a[]", "a[1", "a[x]", "a[1,]", "a[1]b", "''", "'a", "'\\x'",
            "der(x", "der(x,)", "der()", "a-b", "\u{e4}", "'\u{e4}'", "a'b'", "a\n",
        ];
        for name in bad {
            assert!(!is_structured_name(name), "{name}");
        }
    }

    #[test]
    fn c_identifiers() {
        assert!(["a", "_", "Punctual_2"].into_iter().all(is_c_identifier));
        assert!(!["", "2a", "a.b", "a-b", "a b", "\u{e4}"].into_iter().any(is_c_identifier));
    }
}
