//! The tables of docs/configuration.md and the schema for editors, generated from the tables that files are
//! read with. With `PUNCTUAL_UPDATE_GOLDEN=1` both are written; read the difference before committing it.

use std::collections::BTreeSet;
use std::fs;

use punctual_core::MAX_ROWS;
use punctual_fmu::configuration::{Key, Range, SECTIONS, SHAPES, Section, ShapeRow, UNBOUNDED, Unit, Value};
use serde_json::{Map, Value as Json, json};

use crate::sources::root;

const DOCUMENT: &str = "docs/configuration.md";
const SCHEMA: &str = "docs/punctual.schema.json";

/// Compares a file with its wanted content, or writes it.
fn assert_generated(path: &str, wanted: &str) {
    let file = root().join(path);
    if std::env::var_os("PUNCTUAL_UPDATE_GOLDEN").is_some() {
        fs::write(&file, wanted).expect("a writable file");
    }
    let found = fs::read_to_string(&file).unwrap_or_default();
    let lines = found.lines().zip(wanted.lines()).enumerate();
    let first = lines.into_iter().find(|(_, (found, wanted))| found != wanted);
    assert!(
        found == wanted,
        "{path} is not what the tables give; if that is meant, run again with PUNCTUAL_UPDATE_GOLDEN=1: {first:?}"
    );
}

/// The end of a range as text, if there is one.
fn ends(range: Range) -> Option<&'static str> {
    let bounded = |end: Option<f64>| end.is_some_and(|end| end.abs() < UNBOUNDED);
    match range {
        Range::POSITIVE => Some("> 0"),
        Range::NON_NEGATIVE => Some("≥ 0"),
        other if bounded(other.min) || bounded(other.max) => panic!("no words for {other:?}"),
        _ => None,
    }
}

/// The kind of a value, before its meaning.
fn kind(value: Value) -> String {
    let number = |unit: Unit, range: Range| {
        let unit = match unit {
            Unit::Is("1") => None,
            Unit::Is(unit) | Unit::Of(unit) => Some(unit),
            Unit::OfH => Some("unit of h"),
            Unit::OfHighestDerivative => Some("unit of h per sⁿ"),
        };
        unit.into_iter().chain(ends(range)).collect::<Vec<_>>().join(", ")
    };
    match value {
        Value::Number(unit, range)
        | Value::Pair(unit, range)
        | Value::Place(unit, range)
        | Value::Numbers(unit, range)
        | Value::Pairs(unit, range)
        | Value::NumberByName(unit, range) => number(unit, range),
        Value::PairByName(unit) => number(unit, Range::FINITE),
        Value::Count(from, to) if to >= u64::from(u32::MAX) => format!("a whole number ≥ {from}"),
        Value::Count(from, to) => format!("{from} to {to}"),
        Value::Name => "a C identifier".to_owned(),
        Value::Names => "C identifiers".to_owned(),
        Value::Word(&[only]) => format!("`\"{only}\"`"),
        _ => String::new(),
    }
}

fn cell(key: &Key) -> String {
    let parts = [kind(key.value), key.meaning.replace('|', "\\|")];
    parts.into_iter().filter(|part| !part.is_empty()).collect::<Vec<_>>().join("; ")
}

fn table_of(section: &Section) -> String {
    let row = |key: &Key| {
        let cells = [format!("`{}`", key.name), cell(key), key.default.unwrap_or_default().to_owned()];
        cells.map(|cell| if cell.is_empty() { cell } else { format!("{cell} ") }).join("| ")
    };
    let rows = (section.keys)().into_iter().map(|key| format!("| {}|\n", row(key)));
    format!("| key | | default |\n|---|---|---|\n{}", rows.collect::<String>())
}

fn table_of_shapes() -> String {
    let quoted = |keys: &[&str]| keys.iter().map(|key| format!("`{key}`")).collect::<Vec<_>>().join(", ");
    let rows = SHAPES.iter().map(|shape| {
        let keys = [shape.required, shape.optional].map(quoted);
        let keys = keys.into_iter().map(|keys| if keys.is_empty() { "–".to_owned() } else { keys });
        let keys = keys.collect::<Vec<_>>().join(" | ");
        format!("| `{}` | {} | {keys} |\n", shape.name, shape.meaning.replace('|', "\\|"))
    });
    format!("| shape | h ≥ 0 is | needs | may have |\n|---|---|---|---|\n{}", rows.collect::<String>())
}

/// `document` with the table of the sections below each `<!-- table: NAME -->`.
fn with_tables(document: &str) -> String {
    let mut parts = document.split("<!-- table: ");
    let mut text = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let (name, rest) = part.split_once(" -->\n\n").expect("a name, and an empty line");
        let table = match SECTIONS.iter().find(|section| section.name == name) {
            Some(section) => table_of(section),
            None if name == "shapes" => table_of_shapes(),
            None => panic!("{DOCUMENT}: no table {name}"),
        };
        let rest = rest.find("\n\n").map_or("\n", |end| &rest[end + 1..]);
        text += &format!("<!-- table: {name} -->\n\n{table}{rest}");
    }
    text
}

#[test]
fn the_tables_of_the_documentation_are_those_of_the_program() {
    let document = fs::read_to_string(root().join(DOCUMENT)).expect(DOCUMENT);
    assert_generated(DOCUMENT, &with_tables(&document));
    for section in &SECTIONS {
        let marker = format!("<!-- table: {} -->", section.name);
        assert_eq!(document.matches(&marker).count(), 1, "{DOCUMENT}: {marker}");
    }
}

/// Markdown without links and quotes.
fn plain(markdown: &str) -> String {
    let mut text = String::new();
    let mut rest = markdown;
    while let Some((before, link)) = rest.split_once('[') {
        let Some((words, target)) = link.split_once("](") else { break };
        text += &format!("{before}{words}");
        rest = target.split_once(')').map_or("", |(_, after)| after);
    }
    text + rest
}

fn number(range: Range) -> Json {
    let mut schema = json!({ "type": "number" });
    for (word, end) in [("minimum", range.min), ("maximum", range.max)] {
        if let Some(end) = end {
            schema[word] = json!(end);
        }
    }
    schema
}

fn definition(name: &str) -> Json {
    json!({ "$ref": format!("#/definitions/{name}") })
}

fn schema_of_value(value: Value) -> Json {
    let pair = |items: Json| json!({ "type": "array", "items": items, "minItems": 2, "maxItems": 2 });
    let many = |items: Json| json!({ "type": "array", "items": items });
    let by_name = |values: Json| json!({ "type": "object", "additionalProperties": values });
    let identifier = || json!({ "type": "string", "pattern": "^[A-Za-z_][A-Za-z0-9_]{0,63}$" });
    match value {
        Value::Number(_, range) => number(range),
        Value::Pair(_, range) => pair(number(range)),
        Value::Place(_, range) => {
            json!({ "type": "array", "items": number(range), "minItems": 2, "maxItems": 3 })
        }
        Value::Numbers(_, range) => many(number(range)),
        Value::Pairs(_, range) => many(pair(number(range))),
        Value::NumberByName(_, range) => by_name(number(range)),
        Value::PairByName(_) => by_name(pair(number(Range::FINITE))),
        Value::Count(from, to) => json!({ "type": "integer", "minimum": from, "maximum": to }),
        Value::Flag => json!({ "type": "boolean" }),
        Value::Text => json!({ "type": "string" }),
        Value::Name => identifier(),
        Value::Names => many(identifier()),
        Value::Word(words) => json!({ "type": "string", "enum": words }),
        Value::TextByName => by_name(json!({ "type": "string" })),
        Value::TextOrByName => {
            json!({ "type": ["string", "object"], "additionalProperties": { "type": "string" } })
        }
        Value::Table(section) => json!({ "allOf": [definition(section.name)] }),
        Value::TableByName(section) => by_name(definition(section.name)),
        Value::Tables(section) => many(definition(section.name)),
    }
}

/// The default as a value, if it is one.
fn default_value(key: &Key) -> Option<Json> {
    let text = key.default?.trim_matches('`');
    let value: Json = serde_json::from_str(text).unwrap_or_else(|_| json!(text));
    let fits = match key.value {
        Value::Number(..) | Value::Count(..) => value.is_number(),
        Value::Flag => value.is_boolean(),
        Value::Word(words) => value.as_str().is_some_and(|word| words.contains(&word)),
        _ => false,
    };
    fits.then_some(value)
}

fn schema_of_key(key: &Key) -> Json {
    let mut schema = schema_of_value(key.value);
    let mut words = plain(&cell(key));
    match (default_value(key), key.default) {
        (Some(value), _) => schema["default"] = value,
        (None, Some(default)) if !default.is_empty() => words += &format!(" (default: {})", plain(default)),
        _ => {}
    }
    schema["description"] = json!(words);
    schema
}

fn schema_of_section(section: &Section) -> Json {
    let keys = (section.keys)();
    let properties: Map<_, _> = keys.iter().map(|key| (key.name.to_owned(), schema_of_key(key))).collect();
    let required: Vec<_> = keys.iter().filter(|key| key.default.is_none()).map(|key| key.name).collect();
    json!({ "type": "object", "properties": properties, "required": required, "additionalProperties": false })
}

/// For each shape, the keys that it needs and those that it forbids.
fn conditions_of_shapes() -> Vec<Json> {
    let keys =
        |of: &dyn Fn(&ShapeRow) -> Vec<&'static str>| SHAPES.iter().flat_map(of).collect::<BTreeSet<_>>();
    let all = keys(&|shape| [shape.required, shape.optional].concat());
    let condition = |shape: &ShapeRow| {
        let has = [shape.required, shape.optional].concat();
        let others = all.iter().filter(|key| !has.contains(key));
        let never: Map<_, _> = others.map(|key| ((*key).to_owned(), json!(false))).collect();
        json!({
            "if": { "properties": { "shape": { "const": shape.name } }, "required": ["shape"] },
            "then": { "required": shape.required, "properties": never },
        })
    };
    SHAPES.iter().map(condition).collect()
}

fn schema() -> Json {
    let mut definitions: Map<_, _> =
        SECTIONS.iter().map(|section| (section.name.to_owned(), schema_of_section(section))).collect();
    definitions["barrier"]["allOf"] = json!(conditions_of_shapes());
    definitions["filter"]["properties"]["barrier"]["minItems"] = json!(1);
    definitions["filter"]["properties"]["barrier"]["maxItems"] = json!(MAX_ROWS);
    // A barrier along a named vehicle that gives neither is a disc.
    definitions["filter"]["allOf"] = json!([{
        "if": { "properties": { "plant": { "required": ["model"] } } },
        "then": { "properties": { "barrier": { "items": {
            "if": { "not": { "anyOf": [{ "required": ["shape"] }, { "required": ["expression"] }] } },
            "then": { "required": ["centre", "radius"] },
        } } } },
    }]);
    let kinds = ["filter", "plant", "controller"];
    let of_kind = |kind: &str| {
        json!({
            "if": { "properties": { "kind": { "const": kind } }, "required": ["kind"] },
            "then": definition(kind),
        })
    };
    // Editors complete along `anyOf`, whose last branch accepts every file; `allOf` finds the defects.
    let branches: Vec<_> = kinds.into_iter().map(definition).chain([json!({})]).collect();
    // Systems and campaigns, which have no kind, pass unchecked.
    let others = json!([{ "required": ["component"] }, { "required": ["campaign"] }]);
    json!({
        "$schema": "http://json-schema.org/draft-07/schema#",
        "title": "A configuration of Punctual: a filter, a plant or a controller",
        "type": "object",
        "properties": { "kind": { "enum": kinds } },
        "if": { "not": { "anyOf": others } },
        "then": { "required": ["kind"] },
        "anyOf": branches,
        "allOf": kinds.map(of_kind),
        "definitions": definitions,
    })
}

#[test]
fn the_schema_is_that_of_the_program() {
    let text = serde_json::to_string_pretty(&schema()).expect("JSON");
    assert_generated(SCHEMA, &(text + "\n"));
}
