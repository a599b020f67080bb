//! Limits the depth, width and length of an XML text before a parser builds a tree from it. A document type
//! is refused too, since its entities can expand without bound. The limits ignore meaning: a text that is not
//! XML passes here and fails in the parser.

use crate::error::FmuProblem;

/// The greatest depth of elements. A model description needs 6; tools' annotations may need more.
pub(super) const MAX_DEPTH: usize = 256;
/// The greatest number of attributes of an element. The widest in the schema has 13.
pub(super) const MAX_ATTRIBUTES: usize = 256;
/// The greatest number of elements: enough for a million variables with their types and dependencies.
pub(super) const MAX_ELEMENTS: usize = 4_000_000;

/// Scans the text once, without allocating.
pub(super) fn check(text: &str) -> Result<(), FmuProblem> {
    let bytes = text.as_bytes();
    let (mut at, mut depth, mut elements) = (0, 0_usize, 0_usize);
    while let Some(open) = find(bytes, at, b"<") {
        let rest = &bytes[open..];
        let (begin, end): (&[u8], &[u8]) = match rest {
            [b'<', b'!', b'-', b'-', ..] => (b"<!--", b"-->"),
            _ if rest.starts_with(b"<![CDATA[") => (b"<![CDATA[", b"]]>"),
            [b'<', b'?', ..] => (b"<?", b"?>"),
            [b'<', b'!', ..] => {
                let text = "has a document type, whose entities can expand without bound; FMI needs none";
                return refuse(bytes, open, text);
            }
            _ => (b"", b""),
        };
        if !end.is_empty() {
            let Some(close) = find(bytes, open + begin.len(), end) else { return Ok(()) };
            at = close + end.len();
            continue;
        }
        let Some((length, attributes)) = tag(rest) else { return Ok(()) };
        if attributes > MAX_ATTRIBUTES {
            let text = format!("has an element with {attributes} attributes; allowed are {MAX_ATTRIBUTES}");
            return refuse(bytes, open, &text);
        }
        if rest.starts_with(b"</") {
            depth = depth.saturating_sub(1);
        } else {
            elements += 1;
            if rest.get(length - 2) != Some(&b'/') {
                depth += 1;
            }
        }
        if depth > MAX_DEPTH {
            return refuse(bytes, open, &format!("has elements nested deeper than {MAX_DEPTH}"));
        }
        if elements > MAX_ELEMENTS {
            return refuse(bytes, open, &format!("has more than {MAX_ELEMENTS} elements"));
        }
        at = open + length;
    }
    Ok(())
}

/// The length of the tag at the start of `rest`, brackets included, and the number of its quoted values;
/// `None` if it does not end.
fn tag(rest: &[u8]) -> Option<(usize, usize)> {
    let (mut at, mut attributes) = (1, 0);
    loop {
        match *rest.get(at)? {
            b'>' => return Some((at + 1, attributes)),
            quote @ (b'"' | b'\'') => {
                at = find(rest, at + 1, &[quote])? + 1;
                attributes += 1;
            }
            _ => at += 1,
        }
    }
}

/// First position of `wanted` at or after `from`.
fn find(bytes: &[u8], from: usize, wanted: &[u8]) -> Option<usize> {
    let tail = bytes.get(from..)?;
    if let [one] = wanted {
        return tail.iter().position(|byte| byte == one).map(|at| from + at);
    }
    tail.windows(wanted.len()).position(|window| window == wanted).map(|at| from + at)
}

fn refuse(bytes: &[u8], at: usize, text: &str) -> Result<(), FmuProblem> {
    let line = 1 + bytes[..at].iter().filter(|byte| **byte == b'\n').count();
    Err(FmuProblem::Description(format!("line {line}: refused, because it {text}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(text: &str) -> String {
        check(text).expect_err("it is refused").to_string()
    }

    #[test]
    fn what_is_within_bounds_passes() {
        let good = "<?xml version=\"1.0\"?><!-- <!DOCTYPE> --><a x='>' y=\"'\"><b/><![CDATA[<!DOCTYPE]]></a>";
        assert!(check(good).is_ok());
        // Such texts pass here; the parser judges them.
        for text in ["", "<", "<a", "<!--", "</a></a>", "<a x=\"", "<?"] {
            assert!(check(text).is_ok(), "{text}");
        }
        let deep = "<a>".repeat(MAX_DEPTH) + &"</a>".repeat(MAX_DEPTH);
        assert!(check(&deep).is_ok());
        assert!(check(&format!("<r>{}</r>", "<a></a><b/>".repeat(1000))).is_ok());
    }

    #[test]
    fn each_bound_is_told_with_its_line() {
        let beyond = "<a>\n".repeat(MAX_DEPTH + 1);
        assert_eq!(
            message(&beyond),
            "modelDescription.xml: line 257: refused, because it has elements nested deeper than 256"
        );
        let wide = format!("<a {}/>", "x='1' ".repeat(MAX_ATTRIBUTES + 1));
        assert!(message(&wide).contains("an element with 257 attributes; allowed are 256"));
        let entity = "<?xml version='1.0'?>\n<!DOCTYPE a [<!ENTITY b 'c'>]>\n<a/>";
        assert!(
            message(entity)
                .starts_with("modelDescription.xml: line 2: refused, because it has a document type")
        );
    }
}
