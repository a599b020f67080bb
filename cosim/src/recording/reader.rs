//! Reads CSV files of recordings: those of [`Recording::write_csv`], with or without units, and those of other
//! tools, whose columns may be separated by semicolons or tabs.

use std::path::Path;

use super::{Column, Recording};
use crate::error::Error;
use crate::text;

/// The names of the time column, in lower case.
const TIMES: [&str; 4] = ["time", "t", "time_s", "timestamp"];

impl Recording {
    /// Reads the CSV file at `path`. The first line names the columns, one of which is the time in s: `time` or `t`. A second
    /// line may state the units. An empty field, and each field of a column of texts, becomes NaN.
    ///
    /// # Errors
    ///
    /// A file that cannot be read, without a time column or rows; a line of another length than the first; a field that is no
    /// number in a column of numbers.
    pub fn read_csv(path: &Path) -> Result<Self, Error> {
        parse(&text::read(path)?).map_err(|e| e.in_file(path))
    }
}

/// Reads the text of a CSV file.
fn parse(text: &str) -> Result<Recording, Error> {
    let text = text.trim_start_matches('\u{feff}');
    let head = text.lines().next().unwrap_or_default();
    let separator =
        [b',', b';', b'\t'].into_iter().max_by_key(|s| (head.bytes().filter(|b| b == s).count(), *s == b','));
    let mut reader = csv::ReaderBuilder::new()
        .delimiter(separator.unwrap_or(b','))
        .trim(csv::Trim::All)
        .has_headers(false)
        .flexible(true)
        .from_reader(text.as_bytes());
    let mut lines = Vec::new();
    for record in reader.records() {
        let record = record.map_err(|e| Error::configuration("line", e.to_string()))?;
        let line = record.position().map_or(0, csv::Position::line);
        lines.push((line, record));
    }
    let mut lines = lines.into_iter().peekable();
    let Some((_, names)) = lines.next() else {
        return Err(Error::configuration("line 1", "is missing, must name the columns"));
    };
    let is_time = |name: &str| TIMES.contains(&name.to_lowercase().as_str());
    let Some(time) = names.iter().position(is_time) else {
        let found = names.iter().take(12).collect::<Vec<_>>().join(", ");
        let message = format!("no column \"time\" or \"t\" (in s) among {found}; name the time so");
        return Err(Error::configuration("line 1", message));
    };
    let is_number = |field: &str| field.parse::<f64>().is_ok();
    let units = lines.next_if(|(_, fields)| fields.get(time).is_some_and(|field| !is_number(field)));
    let unit = |i: usize| {
        let (_, units) = units.as_ref()?;
        units.get(i).filter(|unit| !unit.is_empty()).map(str::to_owned)
    };
    let columns = names.iter().enumerate().filter(|(i, _)| *i != time);
    let columns = columns.map(|(i, name)| Column { name: name.to_owned(), unit: unit(i) }).collect();
    // A column whose first field is a text has texts.
    let first = lines.peek().map(|(_, fields)| fields.clone());
    let is_text = |i: usize| {
        let field = first.as_ref().and_then(|fields| fields.get(i)).unwrap_or_default();
        i != time && !field.is_empty() && !is_number(field)
    };
    let texts: Vec<bool> = (0..names.len()).map(is_text).collect();
    let mut recording = Recording::new(columns);
    let mut row = Vec::with_capacity(names.len());
    for (line, fields) in lines {
        if fields.len() != names.len() {
            let message = format!("has {} fields, must have {} as line 1 has", fields.len(), names.len());
            return Err(Error::configuration(format!("line {line}"), message));
        }
        row.clear();
        for (i, field) in fields.iter().enumerate() {
            row.push(match field.parse() {
                Ok(number) => number,
                Err(_) if texts[i] || (field.is_empty() && i != time) => f64::NAN,
                Err(_) => {
                    let place = format!("line {line}, column {}", &names[i]);
                    let message = format!("is {field:?}, must be a number with a decimal point, such as 0.5");
                    return Err(Error::configuration(place, message));
                }
            });
        }
        let t = row.remove(time);
        recording.push(t, &row);
    }
    if recording.is_empty() {
        return Err(Error::configuration("line 2", "is missing, must be a row of numbers"));
    }
    Ok(recording)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_reads_back() {
        let column =
            |name: &str, unit: Option<&str>| Column { name: name.into(), unit: unit.map(Into::into) };
        let mut recording = Recording::new(vec![column("a.v", Some("m/s")), column("a.y[1,2]", None)]);
        recording.push(0.0, &[0.1 + 0.2, -0.0]);
        recording.push(1e-3, &[1.5e-300, f64::INFINITY]);
        for units in [false, true] {
            let mut text = Vec::new();
            recording.write_csv(&mut text, units).unwrap();
            let read = parse(&String::from_utf8(text).unwrap()).unwrap();
            assert_eq!(
                (read.times(), read.row(0), read.row(1)),
                (&[0.0, 1e-3][..], recording.row(0), recording.row(1))
            );
            assert_eq!(read.columns()[0].unit.is_some(), units);
            assert_eq!(read.columns()[1].name, "a.y[1,2]");
        }
    }

    #[test]
    fn other_tools_separate_otherwise_and_write_texts() {
        let read = parse("mode;t;v\nauto;0;1.5\nmanual;0.1;\n").unwrap();
        assert_eq!((read.times(), read.columns()[1].name.as_str()), (&[0.0, 0.1][..], "v"));
        assert!(read.row(0)[0].is_nan() && read.row(0)[1] == 1.5 && read.row(1)[1].is_nan());
    }

    #[test]
    fn each_defect_is_named() {
        for (text, message) in [
            ("", "line 1: is missing, must name the columns"),
            ("a,b\n1,2\n", "line 1: no column \"time\" or \"t\" (in s) among a, b; name the time so"),
            ("t,v\n", "line 2: is missing, must be a row of numbers"),
            ("t,v\n0,1\n1\n", "line 3: has 1 fields, must have 2 as line 1 has"),
            (
                "t;v\n0;1.0\n1;1,5\n",
                "line 3, column v: is \"1,5\", must be a number with a decimal point, such as 0.5",
            ),
        ] {
            assert_eq!(parse(text).unwrap_err().to_string(), message);
        }
    }
}
