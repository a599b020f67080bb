//! The recording of a run: a table of doubles with named columns, and its CSV form.

mod reader;

use std::io::{self, Write};
use std::path::Path;

use crate::error::Error;
use crate::whole;

/// A recorded signal.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Column {
    /// `component.variable`.
    pub name: String,
    /// Its unit, such as `m/s`, if it has one.
    pub unit: Option<String>,
}

/// Rows of time (s) and values; integers, Booleans (0 or 1) and enumerations are numbers too.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Recording {
    columns: Vec<Column>,
    times: Vec<f64>,
    // Row after row, `columns.len()` values each.
    values: Vec<f64>,
}

impl Recording {
    /// An empty recording of `columns`.
    pub fn new(columns: Vec<Column>) -> Self {
        Self { columns, times: Vec::new(), values: Vec::new() }
    }

    /// Adds a row at `time` (s). `row` holds one value for each column, in order; extra values are dropped
    /// and missing ones become NaN.
    pub fn push(&mut self, time: f64, row: &[f64]) {
        self.times.push(time);
        let n = self.columns.len();
        self.values.extend_from_slice(&row[..row.len().min(n)]);
        self.values.resize(self.times.len() * n, f64::NAN);
    }

    /// Makes room for `rows` more rows.
    pub fn reserve(&mut self, rows: usize) {
        self.times.reserve(rows);
        self.values.reserve(rows.saturating_mul(self.columns.len()));
    }

    /// The columns, without the time.
    pub fn columns(&self) -> &[Column] {
        &self.columns
    }

    /// The number of rows.
    pub fn len(&self) -> usize {
        self.times.len()
    }

    /// Whether there is no row.
    pub fn is_empty(&self) -> bool {
        self.times.is_empty()
    }

    /// The times of the rows, in seconds, increasing.
    pub fn times(&self) -> &[f64] {
        &self.times
    }

    /// The row at `index`; empty if there is none.
    pub fn row(&self, index: usize) -> &[f64] {
        let n = self.columns.len();
        if index < self.len() { &self.values[index * n..(index + 1) * n] } else { &[] }
    }

    /// The position of the column of this name.
    pub fn index_of(&self, name: &str) -> Option<usize> {
        self.columns.iter().position(|column| column.name == name)
    }

    /// The values of the column of this name, one for each row.
    pub fn series(&self, name: &str) -> Option<Vec<f64>> {
        self.index_of(name).map(|column| self.column(column).collect())
    }

    /// The values of the column at `index`, one for each row; empty if there is no such column.
    pub fn column(&self, index: usize) -> impl Iterator<Item = f64> + '_ {
        let n = self.columns.len();
        let start = if index < n { index } else { self.values.len() };
        self.values[start.min(self.values.len())..].iter().copied().step_by(n.max(1))
    }

    /// Writes the table as CSV: a header with `time` and the column names, a line of units if `units`, then
    /// rows of numbers that read back as the same doubles.
    ///
    /// # Errors
    ///
    /// Those of the writer.
    pub fn write_csv(&self, mut out: impl Write, units: bool) -> io::Result<()> {
        write_header(&mut out, &self.columns, units)?;
        for (index, time) in self.times.iter().enumerate() {
            write_row(&mut out, *time, self.row(index))?;
        }
        out.flush()
    }

    /// Writes the table as a CSV file, as [`Recording::write_csv`] does.
    ///
    /// # Errors
    ///
    /// The file cannot be made or written.
    pub fn save_csv(&self, path: &Path, units: bool) -> Result<(), Error> {
        whole::write_with(path, |out| self.write_csv(out, units))
    }
}

/// Writes the header line of the CSV form, and with `units` a second line, in which a column without a unit
/// has an empty field.
///
/// # Errors
///
/// Those of the writer.
pub fn write_header(out: &mut impl Write, columns: &[Column], units: bool) -> io::Result<()> {
    write!(out, "time")?;
    for column in columns {
        write!(out, ",{}", quoted(&column.name))?;
    }
    writeln!(out)?;
    if units {
        write!(out, "s")?;
        for column in columns {
            write!(out, ",{}", quoted(column.unit.as_deref().unwrap_or_default()))?;
        }
        writeln!(out)?;
    }
    Ok(())
}

/// Writes one line of the CSV form.
///
/// # Errors
///
/// Those of the writer.
pub fn write_row(out: &mut impl Write, time: f64, row: &[f64]) -> io::Result<()> {
    write_number(out, time)?;
    for value in row {
        out.write_all(b",")?;
        write_number(out, *value)?;
    }
    writeln!(out)
}

/// The shortest text that reads back as `value`, in exponent notation if that is shorter.
fn write_number(out: &mut impl Write, value: f64) -> io::Result<()> {
    let size = value.abs();
    if size != 0.0 && !(1e-5..1e16).contains(&size) && value.is_finite() {
        write!(out, "{value:e}")
    } else {
        write!(out, "{value}")
    }
}

/// A CSV field, quoted if necessary.
pub fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn recording() -> Recording {
        let column = |name: &str| Column { name: name.into(), unit: None };
        let mut recording = Recording::new(vec![column("a.x"), column("a.y[1,2]")]);
        recording.push(0.0, &[0.1 + 0.2, -0.0]);
        recording.push(1e-3, &[1.5e-300, f64::INFINITY]);
        recording
    }

    #[test]
    fn csv_reads_back_to_the_same_doubles() {
        let mut text = Vec::new();
        recording().write_csv(&mut text, false).unwrap();
        let text = String::from_utf8(text).unwrap();
        assert_eq!(text, "time,a.x,\"a.y[1,2]\"\n0,0.30000000000000004,-0\n0.001,1.5e-300,inf\n");
        let line = text.lines().nth(1).unwrap();
        let numbers: Vec<f64> = line.split(',').map(|n| n.parse().unwrap()).collect();
        assert_eq!(numbers[1].to_bits(), (0.1_f64 + 0.2).to_bits());
        assert_eq!(numbers[2].to_bits(), (-0.0_f64).to_bits());
    }

    #[test]
    fn units_are_a_line_of_their_own() {
        let column =
            |name: &str, unit: Option<&str>| Column { name: name.into(), unit: unit.map(str::to_owned) };
        let mut recording =
            Recording::new(vec![column("a.v", Some("m/s")), column("a.n", None), column("a.x", Some("a,b"))]);
        recording.push(0.0, &[1.0, 2.0, 3.0]);
        let mut text = Vec::new();
        recording.write_csv(&mut text, true).unwrap();
        assert_eq!(String::from_utf8(text).unwrap(), "time,a.v,a.n,a.x\ns,m/s,,\"a,b\"\n0,1,2,3\n");
    }

    #[test]
    fn columns_and_rows_are_found() {
        let recording = recording();
        assert_eq!(recording.series("a.y[1,2]").unwrap(), [-0.0, f64::INFINITY]);
        assert_eq!(recording.series("a.z"), None);
        assert_eq!(recording.row(1), [1.5e-300, f64::INFINITY]);
        assert_eq!(recording.row(2), [0.0; 0]);
        assert_eq!(recording.column(9).count(), 0);
    }

    #[test]
    fn a_recording_without_columns_still_has_times() {
        let mut recording = Recording::new(vec![]);
        recording.push(0.0, &[]);
        let mut text = Vec::new();
        recording.write_csv(&mut text, false).unwrap();
        assert_eq!(text, b"time\n0\n");
    }
}
