//! The rows of a campaign as a Parquet file. The only module that uses the crate `parquet`.
//!
//! Rows are in the order of the runs, in groups of [`GROUP`]. The file depends only on the columns, metadata
//! and rows, so the same rows give the same bytes.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use parquet::basic::{Compression, ConvertedType, LogicalType, Repetition, Type as Physical};
use parquet::column::reader::get_typed_column_reader;
use parquet::column::writer::ColumnWriter;
use parquet::data_type::{BoolType, ByteArray, ByteArrayType, DataType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;

use crate::error::Error;

/// Rows of a row group, except the last one of a file; one group is held in memory at a time.
pub const GROUP: usize = 16_384;

/// The kinds of cells in a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Whole numbers from 0 on.
    Count,
    /// Doubles; may be missing.
    Number,
    /// True or false.
    Flag,
    /// Texts; may be missing.
    Text,
}

/// A column.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Column {
    /// Its name, unique.
    pub name: String,
    /// The unit of its numbers; empty if it has none.
    pub unit: String,
    /// Its meaning.
    pub description: String,
    /// The kind of its cells.
    #[serde(skip)]
    pub kind: Kind,
}

/// A cell, of the kind of its column.
#[derive(Clone, Debug)]
pub enum Cell {
    /// Of [`Kind::Count`], below 2⁶³.
    Count(u64),
    /// Of [`Kind::Number`].
    Number(Option<f64>),
    /// Of [`Kind::Flag`].
    Flag(bool),
    /// Of [`Kind::Text`].
    Text(Option<String>),
}

impl Cell {
    /// Whether two cells are bitwise equal.
    pub fn is(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Count(a), Self::Count(b)) => a == b,
            (Self::Number(a), Self::Number(b)) => a.map(f64::to_bits) == b.map(f64::to_bits),
            (Self::Flag(a), Self::Flag(b)) => a == b,
            (Self::Text(a), Self::Text(b)) => a == b,
            _ => false,
        }
    }
}

impl std::fmt::Display for Cell {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Count(count) => count.fmt(f),
            Self::Number(Some(number)) => number.fmt(f),
            Self::Flag(flag) => flag.fmt(f),
            Self::Text(Some(text)) => text.fmt(f),
            Self::Number(None) | Self::Text(None) => f.write_str("nothing"),
        }
    }
}

/// A run: one cell for each column.
pub type Row = Vec<Cell>;

/// The key of the checksum of all rows in the metadata.
const CHECKSUM: &str = "punctual.checksum";

/// A checksum of rows in their order, which reveals damage by a disk or a copy.
#[derive(Default)]
pub(super) struct Checksum(crc32fast::Hasher);

impl Checksum {
    pub(super) fn add(&mut self, row: &Row) {
        for cell in row {
            match cell {
                Cell::Count(count) => self.0.update(&count.to_le_bytes()),
                Cell::Number(Some(number)) => self.0.update(&number.to_bits().to_le_bytes()),
                Cell::Flag(flag) => self.0.update(&[u8::from(*flag)]),
                Cell::Text(Some(text)) => {
                    self.0.update(&(text.len() as u64).to_le_bytes());
                    self.0.update(text.as_bytes());
                }
                Cell::Number(None) | Cell::Text(None) => self.0.update(b"none"),
            }
        }
    }

    /// Its text form in the metadata.
    pub(super) fn text(&self) -> String {
        format!("{:08x}", self.0.clone().finalize())
    }
}

/// The error for a file that cannot be written or read as Parquet.
fn broken(action: &'static str, path: &Path) -> impl Fn(ParquetError) -> Error {
    move |e| Error::io(action, path, std::io::Error::other(e))
}

/// Writes a file.
pub(super) struct Writer {
    path: PathBuf,
    file: File,
    inner: SerializedFileWriter<File>,
    columns: Vec<Column>,
    waiting: Vec<Row>,
    checksum: Checksum,
}

impl Writer {
    /// Begins the file at `path`, with `texts` by name in its metadata.
    ///
    /// # Errors
    ///
    /// The file cannot be made.
    pub(super) fn create(
        path: &Path,
        columns: &[Column],
        metadata: &[(String, String)],
    ) -> Result<Self, Error> {
        let problem = broken("write", path);
        let field = |column: &Column| {
            let (physical, optional) = match column.kind {
                Kind::Count => (Physical::INT64, false),
                Kind::Number => (Physical::DOUBLE, true),
                Kind::Flag => (Physical::BOOLEAN, false),
                Kind::Text => (Physical::BYTE_ARRAY, true),
            };
            let repetition = if optional { Repetition::OPTIONAL } else { Repetition::REQUIRED };
            let logical = (column.kind == Kind::Text).then_some(LogicalType::String);
            Type::primitive_type_builder(&column.name, physical)
                .with_repetition(repetition)
                .with_logical_type(logical)
                .with_converted_type(ConvertedType::NONE)
                .build()
                .map(Arc::new)
        };
        let fields = columns.iter().map(field).collect::<Result<_, _>>().map_err(&problem)?;
        let schema = Type::group_type_builder("campaign").with_fields(fields).build().map_err(&problem)?;
        let texts = metadata.iter().map(|(key, text)| KeyValue::new(key.clone(), text.clone())).collect();
        let properties = WriterProperties::builder()
            .set_compression(Compression::SNAPPY)
            .set_max_row_group_row_count(Some(GROUP))
            .set_key_value_metadata(Some(texts))
            .build();
        let file = File::create(path).map_err(|e| Error::io("write", path, e))?;
        let copy = file.try_clone().map_err(|e| Error::io("write", path, e))?;
        let inner =
            SerializedFileWriter::new(copy, Arc::new(schema), Arc::new(properties)).map_err(&problem)?;
        Ok(Self {
            path: path.to_owned(),
            file,
            inner,
            columns: columns.to_vec(),
            waiting: Vec::new(),
            checksum: Checksum::default(),
        })
    }

    /// Adds a row.
    ///
    /// # Errors
    ///
    /// The file cannot be written.
    pub(super) fn push(&mut self, row: Row) -> Result<(), Error> {
        self.checksum.add(&row);
        self.waiting.push(row);
        if self.waiting.len() == GROUP { self.flush() } else { Ok(()) }
    }

    fn flush(&mut self) -> Result<(), Error> {
        write_group(&mut self.inner, &self.columns, &self.waiting).map_err(broken("write", &self.path))?;
        self.waiting.clear();
        Ok(())
    }

    /// Completes the file and waits until it is on the disk.
    ///
    /// # Errors
    ///
    /// The file cannot be written.
    pub(super) fn finish(mut self) -> Result<(), Error> {
        if !self.waiting.is_empty() {
            self.flush()?;
        }
        self.inner.append_key_value_metadata(KeyValue::new(CHECKSUM.to_owned(), self.checksum.text()));
        self.inner.close().map_err(broken("write", &self.path))?;
        self.file.sync_all().map_err(|e| Error::io("write", &self.path, e))
    }
}

/// Writes one row group.
fn write_group(
    file: &mut SerializedFileWriter<File>,
    columns: &[Column],
    rows: &[Row],
) -> Result<(), ParquetError> {
    let mut group = file.next_row_group()?;
    for c in 0..columns.len() {
        let Some(mut column) = group.next_column()? else { break };
        let cells = || rows.iter().map(|row| &row[c]);
        match column.untyped() {
            ColumnWriter::Int64ColumnWriter(writer) => {
                let whole = |cell: &Cell| match cell {
                    Cell::Count(count) => i64::try_from(*count).unwrap_or(i64::MAX),
                    _ => 0,
                };
                writer.write_batch(&cells().map(whole).collect::<Vec<_>>(), None, None)?;
            }
            ColumnWriter::BoolColumnWriter(writer) => {
                let flags: Vec<_> = cells().map(|cell| matches!(cell, Cell::Flag(true))).collect();
                writer.write_batch(&flags, None, None)?;
            }
            ColumnWriter::DoubleColumnWriter(writer) => {
                let number = |cell: &Cell| if let Cell::Number(number) = cell { *number } else { None };
                let levels: Vec<_> = cells().map(|cell| i16::from(number(cell).is_some())).collect();
                writer.write_batch(&cells().filter_map(number).collect::<Vec<_>>(), Some(&levels), None)?;
            }
            ColumnWriter::ByteArrayColumnWriter(writer) => {
                let text = |cell: &Cell| match cell {
                    Cell::Text(Some(text)) => Some(ByteArray::from(text.as_str())),
                    _ => None,
                };
                let levels: Vec<_> = cells().map(|cell| i16::from(text(cell).is_some())).collect();
                writer.write_batch(&cells().filter_map(text).collect::<Vec<_>>(), Some(&levels), None)?;
            }
            _ => return Err(ParquetError::General("a column of a kind that is never made".into())),
        }
        column.close()?;
    }
    group.close()?;
    Ok(())
}

/// Reads a file that `Writer` wrote.
pub struct Reader {
    path: PathBuf,
    inner: SerializedFileReader<File>,
}

impl Reader {
    /// Opens the file at `path`.
    ///
    /// # Errors
    ///
    /// The file cannot be read or is no Parquet file.
    pub fn open(path: &Path) -> Result<Self, Error> {
        let file = File::open(path).map_err(|e| Error::io("read", path, e))?;
        let inner = SerializedFileReader::new(file).map_err(|e| {
            let message = format!("it is not a Parquet file, or is incomplete ({e})");
            Error::io("read", path, std::io::Error::other(message))
        })?;
        Ok(Self { path: path.to_owned(), inner })
    }

    /// The text with this key in the metadata.
    pub fn text(&self, key: &str) -> Option<&str> {
        let texts = self.inner.metadata().file_metadata().key_value_metadata()?;
        texts.iter().find(|text| text.key == key)?.value.as_deref()
    }

    /// Whether `rows` is the checksum that was written with the rows.
    pub(super) fn is_whole(&self, rows: &Checksum) -> bool {
        self.text(CHECKSUM) == Some(&rows.text())
    }

    /// The number of rows.
    pub fn rows(&self) -> u64 {
        u64::try_from(self.inner.metadata().file_metadata().num_rows()).unwrap_or(0)
    }

    /// The number of row groups.
    pub fn groups(&self) -> usize {
        self.inner.metadata().num_row_groups()
    }

    /// These columns of the rows of one group.
    ///
    /// # Errors
    ///
    /// The file cannot be read, or has other columns.
    pub fn group(&self, group: usize, columns: &[Column]) -> Result<Vec<Row>, Error> {
        self.read_group(group, columns).map_err(broken("read", &self.path))
    }

    fn read_group(&self, group: usize, columns: &[Column]) -> Result<Vec<Row>, ParquetError> {
        let reader = self.inner.get_row_group(group)?;
        let found = reader.metadata().schema_descr().columns();
        let count = usize::try_from(reader.metadata().num_rows()).unwrap_or(0);
        let differs = || ParquetError::General("its columns are not those of the campaign in it".into());
        if found.len() != columns.len() {
            return Err(differs());
        }
        let mut rows: Vec<Row> = (0..count).map(|_| Vec::with_capacity(columns.len())).collect();
        for (c, column) in columns.iter().enumerate() {
            let physical = match column.kind {
                Kind::Count => Physical::INT64,
                Kind::Number => Physical::DOUBLE,
                Kind::Flag => Physical::BOOLEAN,
                Kind::Text => Physical::BYTE_ARRAY,
            };
            if found[c].name() != column.name || found[c].physical_type() != physical {
                return Err(differs());
            }
            let cells: Vec<Cell> = match column.kind {
                Kind::Count => cells::<Int64Type>(&*reader, c, count, |v| {
                    Cell::Count(v.map_or(0, |v| u64::try_from(v).unwrap_or(0)))
                })?,
                Kind::Number => cells::<DoubleType>(&*reader, c, count, Cell::Number)?,
                Kind::Flag => cells::<BoolType>(&*reader, c, count, |v| Cell::Flag(v == Some(true)))?,
                Kind::Text => cells::<ByteArrayType>(&*reader, c, count, |v| {
                    Cell::Text(v.map(|v| String::from_utf8_lossy(v.data()).into_owned()))
                })?,
            };
            if cells.len() != count {
                return Err(ParquetError::General(format!("column {} ends early", column.name)));
            }
            rows.iter_mut().zip(cells).for_each(|(row, cell)| row.push(cell));
        }
        Ok(rows)
    }
}

/// The cells of a column in a row group; `None` for a missing one.
fn cells<T: DataType>(
    group: &dyn parquet::file::reader::RowGroupReader,
    column: usize,
    count: usize,
    cell: impl Fn(Option<T::T>) -> Cell,
) -> Result<Vec<Cell>, ParquetError> {
    let optional = group.metadata().schema_descr().column(column).max_def_level() > 0;
    let mut reader = get_typed_column_reader::<T>(group.get_column_reader(column)?);
    let (mut values, mut levels) = (Vec::new(), Vec::new());
    let levels_wanted = optional.then_some(&mut levels);
    reader.read_records(count, levels_wanted, None, &mut values)?;
    let mut values = values.into_iter();
    if optional {
        Ok(levels.iter().map(|level| cell(if *level > 0 { values.next() } else { None })).collect())
    } else {
        Ok(values.map(|value| cell(Some(value))).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_come_back_bit_for_bit_and_bytes_depend_on_them_alone() {
        let folder = tempfile::tempdir().unwrap();
        let column = |name: &str, kind| Column {
            name: name.into(),
            unit: String::new(),
            description: String::new(),
            kind,
        };
        let columns = [
            column("run", Kind::Count),
            column("a.goal.centre[1]", Kind::Number),
            column("ok", Kind::Flag),
            column("why", Kind::Text),
        ];
        let row = |k: u64| {
            let number = match k % 4 {
                0 => None,
                1 => Some(-0.0),
                2 => Some(f64::from_bits(0x7ff8_0000_0000_0001)),
                _ => Some((k as f64).sqrt()),
            };
            let text = k.is_multiple_of(3).then(|| format!("r {k}"));
            vec![Cell::Count(k), Cell::Number(number), Cell::Flag(k.is_multiple_of(2)), Cell::Text(text)]
        };
        let count = GROUP as u64 + 100;
        let write = |name: &str| {
            let path = folder.path().join(name);
            let metadata = [("key".to_owned(), "a text\nof two lines".to_owned())];
            let mut writer = Writer::create(&path, &columns, &metadata).unwrap();
            (0..count).for_each(|k| writer.push(row(k)).unwrap());
            writer.finish().unwrap();
            path
        };
        let (a, b) = (write("a"), write("b"));
        assert!(std::fs::read(&a).unwrap() == std::fs::read(&b).unwrap());
        let reader = Reader::open(&a).unwrap();
        assert_eq!((reader.rows(), reader.groups()), (count, 2));
        assert_eq!((reader.text("key"), reader.text("none")), (Some("a text\nof two lines"), None));
        let mut k = 0;
        for group in 0..2 {
            for found in reader.group(group, &columns).unwrap() {
                assert!(found.iter().zip(&row(k)).all(|(a, b)| a.is(b)), "{found:?}");
                k += 1;
            }
        }
        assert_eq!(k, count);
        let message = reader.group(0, &columns[1..]).unwrap_err().to_string();
        assert!(message.contains("its columns are not those"), "{message}");
    }
}
