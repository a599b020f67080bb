//! The recording of `punctual run`.

use std::collections::HashMap;
use std::path::Path;

/// A CSV file of numbers with a header.
pub(crate) struct Recording {
    columns: HashMap<String, usize>,
    rows: Vec<Vec<f64>>,
}

impl Recording {
    pub(crate) fn read(file: &Path) -> Self {
        let text = std::fs::read_to_string(file).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
        let mut lines = text.lines();
        let names = lines.next().expect("a header").split(',');
        let columns = names.enumerate().map(|(i, name)| (name.to_owned(), i)).collect();
        let number = |text: &str| text.parse().unwrap_or_else(|e| panic!("{text:?}: {e}"));
        Self { columns, rows: lines.map(|line| line.split(',').map(number).collect()).collect() }
    }

    pub(crate) fn rows(&self) -> usize {
        self.rows.len()
    }

    pub(crate) fn value(&self, row: usize, column: &str) -> f64 {
        self.rows[row][*self.columns.get(column).unwrap_or_else(|| panic!("no column {column}"))]
    }
}
