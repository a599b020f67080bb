//! The CSV that `punctual run` writes, read back.

/// Columns by name.
pub(crate) struct Table {
    header: Vec<String>,
    rows: Vec<Vec<f64>>,
}

impl Table {
    pub(crate) fn parse(csv: &str) -> Self {
        let mut lines = csv.lines();
        let header: Vec<_> = lines.next().expect("a header").split(',').map(str::to_owned).collect();
        let row = |line: &str| -> Vec<f64> {
            let row: Vec<_> = line.split(',').map(|n| n.parse().expect("a number")).collect();
            assert_eq!(row.len(), header.len(), "{line}");
            row
        };
        let rows = lines.map(row).collect();
        Self { header, rows }
    }

    pub(crate) fn header(&self) -> &[String] {
        &self.header
    }

    pub(crate) fn len(&self) -> usize {
        self.rows.len()
    }

    /// The column of this name.
    pub(crate) fn column(&self, name: &str) -> Vec<f64> {
        let index = self.header.iter().position(|h| h == name).unwrap_or_else(|| panic!("no column {name}"));
        self.rows.iter().map(|row| row[index]).collect()
    }
}

/// Whether both are the same doubles, the sign of zero included.
#[track_caller]
pub(crate) fn assert_same_bits(name: &str, found: &[f64], wanted: &[f64]) {
    assert_eq!(found.len(), wanted.len(), "{name}");
    for (k, (a, b)) in found.iter().zip(wanted).enumerate() {
        assert!(a.to_bits() == b.to_bits(), "{name} in row {k}: {a:?}, wanted {b:?}");
    }
}
