//! Differences in meaning between two model descriptions. The form of the XML does not count: comments,
//! blanks between elements, the order of attributes, line ends. Neither does the time of generation,
//! `generationDateAndTime`.

use roxmltree::{Attribute, Document, Node};

/// The root element of a model description.
const ROOT: &str = "fmiModelDescription";
/// The attribute of the root in which two builds of the same model may differ.
const TIME: &str = "generationDateAndTime";
/// The most characters shown of a value.
const SHOWN: usize = 60;

/// A model description of FMI 2.0, parsed.
pub(super) fn parse(text: &str) -> Result<Document<'_>, String> {
    let document = Document::parse(text).map_err(|e| format!("is not well-formed: {e}"))?;
    let root = document.root_element();
    if root.tag_name().name() != ROOT {
        return Err(format!("is <{}>, must be <{ROOT}>", root.tag_name().name()));
    }
    match root.attribute("fmiVersion") {
        Some("2.0") => Ok(document),
        version => Err(format!("fmiVersion is {}, must be \"2.0\"", shown(version))),
    }
}

/// The differences of `here` from `there`: all differing attributes of the model, with the GUID first. If
/// none differ, the first difference in the content.
pub(super) fn of(here: &Document<'_>, there: &Document<'_>) -> Option<String> {
    let (here, there) = (here.root_element(), there.root_element());
    let mut reported = attributes(here, there);
    // If the GUID differs, the rest belongs to another model.
    reported.sort_by_key(|difference| !difference.starts_with("guid "));
    if reported.is_empty() { children(here, there) } else { Some(reported.join("; ")) }
}

/// A value as a message shows it.
fn shown(value: Option<&str>) -> String {
    match value {
        None => "not given".to_owned(),
        Some(text) if text.chars().count() <= SHOWN => format!("{text:?}"),
        Some(text) => format!("{:?}…", text.chars().take(SHOWN).collect::<String>()),
    }
}

/// The differing attributes, each with both values.
fn attributes(here: Node<'_, '_>, there: Node<'_, '_>) -> Vec<String> {
    let of = |node: Node<'_, '_>, other: Attribute<'_, '_>| {
        let same = |a: &Attribute<'_, '_>| (a.namespace(), a.name()) == (other.namespace(), other.name());
        node.attributes().find(same).map(|a| a.value().to_owned())
    };
    let all = |a: Attribute<'_, '_>, b: Attribute<'_, '_>| {
        (a.namespace(), a.name(), a.value()) == (b.namespace(), b.name(), b.value())
    };
    // Usually all attributes are equal and in the same order, so that no lookup is needed.
    if here.attributes().len() == there.attributes().len()
        && here.attributes().zip(there.attributes()).all(|(a, b)| all(a, b))
    {
        return Vec::new();
    }
    let missing = there.attributes().filter(|a| of(here, *a).is_none());
    let different = |a: Attribute<'_, '_>| {
        let (mine, theirs) = (of(here, a), of(there, a));
        let counts = mine != theirs && !(a.name() == TIME && here.tag_name().name() == ROOT);
        counts.then(|| {
            format!("{} is {}, there {}", a.name(), shown(mine.as_deref()), shown(theirs.as_deref()))
        })
    };
    here.attributes().chain(missing).filter_map(different).collect()
}

/// The first difference between two elements, or in their content.
fn element(here: Node<'_, '_>, there: Node<'_, '_>) -> Option<String> {
    let place = || {
        let line = here.document().text_pos_at(here.range().start).row;
        let name = here.attribute("name").map(|name| format!(" {}", shown(Some(name)))).unwrap_or_default();
        format!("line {line}: {}{name}", here.tag_name().name())
    };
    if here.tag_name() != there.tag_name() {
        return Some(format!("{}, there {}", place(), there.tag_name().name()));
    }
    if let Some(difference) = attributes(here, there).into_iter().next() {
        return Some(format!("{}: {difference}", place()));
    }
    let (mine, theirs) = (text(here), text(there));
    if mine != theirs {
        return Some(format!(
            "{}: the text is {}, there {}",
            place(),
            shown(Some(&mine)),
            shown(Some(&theirs))
        ));
    }
    children(here, there)
}

fn children(here: Node<'_, '_>, there: Node<'_, '_>) -> Option<String> {
    let elements = |node: Node<'_, '_>| node.children().filter(Node::is_element).count();
    let pairs = || here.children().filter(Node::is_element).zip(there.children().filter(Node::is_element));
    if let Some(difference) = pairs().find_map(|(here, there)| element(here, there)) {
        return Some(difference);
    }
    let (mine, theirs) = (elements(here), elements(there));
    let name = here.tag_name().name();
    (mine != theirs).then(|| format!("{name} has {mine} elements, there {theirs}"))
}

/// The text directly in the element, outside its child elements.
fn text(node: Node<'_, '_>) -> String {
    let parts = node.children().filter(Node::is_text).filter_map(|part| part.text());
    parts.map(str::trim).filter(|part| !part.is_empty()).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    const XML: &str = r#"<fmiModelDescription fmiVersion="2.0" guid="g" modelName="m" generationDateAndTime="2026-01-02T03:04:05Z">
  <VendorAnnotations><Tool name="t">some <b/> text</Tool></VendorAnnotations>
  <ModelVariables>
    <ScalarVariable name="x" valueReference="0"><Real start="1.0"/></ScalarVariable>
    <ScalarVariable name="y" valueReference="1"><Real/></ScalarVariable>
  </ModelVariables>
</fmiModelDescription>"#;

    fn difference(from: &str, to: &str) -> Option<String> {
        assert!(XML.contains(from), "{from}");
        let edited = XML.replacen(from, to, 1);
        of(&parse(&edited).expect("XML"), &parse(XML).expect("XML"))
    }

    #[test]
    fn how_and_when_it_is_written_does_not_count() {
        for (from, to) in [
            ("guid=\"g\" modelName=\"m\"", "modelName='m'   guid='g'"),
            ("\n", "\r\n"),
            ("    <Scalar", "<!-- a comment --><Scalar"),
            ("<Real/>", "<Real></Real>"),
            ("2026-01-02T03:04:05Z", "2027-01-02T03:04:05Z"),
            (" generationDateAndTime=\"2026-01-02T03:04:05Z\"", ""),
        ] {
            assert_eq!(difference(from, to), None, "{from}");
        }
    }

    #[test]
    fn what_it_says_counts() {
        let cases = [
            ("guid=\"g\"", "guid=\"h\"", r#"guid is "h", there "g""#),
            (
                "guid=\"g\" modelName=\"m\"",
                "author=\"a\" guid=\"h\"",
                r#"guid is "h", there "g"; author is "a", there not given; modelName is not given, there "m""#,
            ),
            ("start=\"1.0\"", "start=\"1\"", r#"line 4: Real: start is "1", there "1.0""#),
            ("name=\"y\"", "name=\"z\"", r#"line 5: ScalarVariable "z": name is "z", there "y""#),
            ("<Real/>", "<Integer/>", "line 5: Integer, there Real"),
            ("<Real/>", "<Real/><Annotations/>", "ScalarVariable has 2 elements, there 1"),
            ("some", "more", r#"line 2: Tool "t": the text is "more text", there "some text""#),
            (
                "  <ModelVariables>",
                "<ModelVariables x:name='1' xmlns:x='u'>",
                r#"line 3: ModelVariables "1": name is "1", there not given"#,
            ),
        ];
        for (from, to, expected) in cases {
            assert_eq!(difference(from, to).as_deref(), Some(expected), "{from}");
        }
        let long = "ä".repeat(1000);
        let reported = difference("guid=\"g\"", &format!("guid=\"{long}\"")).expect("a difference");
        assert_eq!(reported, format!("guid is \"{}\"…, there \"g\"", "ä".repeat(SHOWN)));
    }

    #[test]
    fn what_is_no_description_of_this_version_is_refused() {
        for (text, expected) in [
            ("<fmiModelDescription", "is not well-formed: "),
            ("<other/>", "is <other>, must be <fmiModelDescription>"),
            ("<fmiModelDescription fmiVersion=\"3.0\"/>", "fmiVersion is \"3.0\", must be \"2.0\""),
            ("<fmiModelDescription/>", "fmiVersion is not given, must be \"2.0\""),
        ] {
            let reported = parse(text).expect_err(text);
            assert!(reported.starts_with(expected), "{reported}");
        }
    }
}
