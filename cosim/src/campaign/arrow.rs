//! The Arrow schema of the rows, as Apache Arrow stores it in a Parquet file. Readers such as pyarrow take
//! from it what Parquet itself cannot hold: the unit and the meaning of each column. Only this file uses
//! flatbuffers and base64.
//!
//! The field numbers of the tables are those of `Schema.fbs` and `Message.fbs` of the format, version 5.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use flatbuffers::{FlatBufferBuilder, TableFinishedWIPOffset, VOffsetT, WIPOffset};

use super::table::{Column, Kind};

/// The key of the schema in the metadata of the file.
pub(super) const KEY: &str = "ARROW:schema";

/// The marker at the start of a message: the length follows.
const CONTINUATION: [u8; 4] = [0xff; 4];
/// `MetadataVersion.V5`.
const VERSION: i16 = 4;
/// `MessageHeader.Schema`.
const SCHEMA: u8 = 1;
/// `Precision.DOUBLE`.
const DOUBLE: i16 = 2;

/// An entry of a table: the `n`th field of its definition.
const fn slot(n: VOffsetT) -> VOffsetT {
    4 + 2 * n
}

/// The schema of `columns`, encoded for the metadata. Readers that find a schema also take the file's other
/// `texts` from it.
pub(super) fn schema(columns: &[Column], texts: &[(String, String)]) -> String {
    let mut to = FlatBufferBuilder::new();
    let texts: Vec<_> = texts.iter().map(|(key, text)| pair(&mut to, key, text)).collect();
    let texts = to.create_vector(&texts);
    let fields: Vec<_> = columns.iter().map(|column| field(&mut to, column)).collect();
    let fields = to.create_vector(&fields);
    let table = to.start_table();
    to.push_slot_always(slot(1), fields);
    to.push_slot_always(slot(2), texts);
    let schema = to.end_table(table);
    let table = to.start_table();
    // From the largest to the smallest, so that each is aligned to its size.
    to.push_slot_always(slot(3), 0_i64);
    to.push_slot_always(slot(2), schema);
    to.push_slot_always(slot(0), VERSION);
    to.push_slot_always(slot(1), SCHEMA);
    let message = to.end_table(table);
    to.finish(message, None);
    let mut message = to.finished_data().to_vec();
    message.resize(message.len().next_multiple_of(8), 0);
    // A schema is far from 2 GiB.
    let length = u32::try_from(message.len()).unwrap_or(u32::MAX);
    STANDARD.encode([&CONTINUATION, &length.to_le_bytes()[..], &message].concat())
}

/// A text with its name.
fn pair(to: &mut FlatBufferBuilder<'_>, key: &str, text: &str) -> WIPOffset<TableFinishedWIPOffset> {
    let (key, text) = (to.create_string(key), to.create_string(text));
    let table = to.start_table();
    to.push_slot_always(slot(0), key);
    to.push_slot_always(slot(1), text);
    to.end_table(table)
}

fn field(to: &mut FlatBufferBuilder<'_>, column: &Column) -> WIPOffset<TableFinishedWIPOffset> {
    let texts = [("unit", &column.unit), ("description", &column.description)];
    let texts: Vec<_> = texts
        .into_iter()
        .filter(|(_, text)| !text.is_empty())
        .map(|(key, text)| pair(to, key, text))
        .collect();
    let texts = to.create_vector(&texts);
    let name = to.create_string(&column.name);
    let children = to.create_vector::<WIPOffset<TableFinishedWIPOffset>>(&[]);
    let table = to.start_table();
    // The number of the type in the union `Type`, and whether a cell may be missing.
    let (number, optional) = match column.kind {
        Kind::Count => {
            // 64 bits, with a sign.
            to.push_slot_always(slot(0), 64_i32);
            to.push_slot_always(slot(1), true);
            (2_u8, false)
        }
        Kind::Number => {
            to.push_slot_always(slot(0), DOUBLE);
            (3, true)
        }
        Kind::Text => (5, true),
        Kind::Flag => (6, false),
    };
    let kind = to.end_table(table);
    let table = to.start_table();
    to.push_slot_always(slot(0), name);
    to.push_slot_always(slot(3), kind);
    to.push_slot_always(slot(5), children);
    to.push_slot_always(slot(6), texts);
    to.push_slot_always(slot(1), optional);
    to.push_slot_always(slot(2), number);
    to.end_table(table)
}
