//! A table of texts and numbers, for readers, spreadsheets and programs.

use punctual_pictures::columns;
use punctual_pictures::page::escape;
use serde::{Serialize, Serializer};

/// One cell.
#[derive(Clone, Debug, PartialEq)]
pub enum Cell {
    /// A word.
    Text(String),
    /// A number, and its decimals for display.
    Number(f64, usize),
    /// No number; the text displayed instead.
    Nothing(&'static str),
}

impl Cell {
    /// A count.
    pub fn count(n: usize) -> Self {
        Self::Number(n as f64, 0)
    }

    /// A number, or the text displayed instead.
    pub fn optional(value: Option<f64>, digits: usize, nothing: &'static str) -> Self {
        value.filter(|v| v.is_finite()).map_or(Self::Nothing(nothing), |v| Self::Number(v, digits))
    }

    /// The text for display.
    pub fn shown(&self) -> String {
        match self {
            Self::Text(text) => text.clone(),
            Self::Number(value, _) if value.abs() >= 1e7 => format!("{value:.2e}"),
            Self::Number(value, digits) => format!("{value:.digits$}"),
            Self::Nothing(text) => (*text).to_owned(),
        }
    }

    /// The text in a CSV file, with numbers in full.
    fn plain(&self) -> String {
        match self {
            Self::Text(text) if text.contains([',', '"', '\n']) => {
                format!("\"{}\"", text.replace('"', "\"\""))
            }
            Self::Text(text) => text.clone(),
            Self::Number(value, _) => value.to_string(),
            Self::Nothing(_) => String::new(),
        }
    }
}

/// A string, a number or null.
impl Serialize for Cell {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Text(text) => serializer.serialize_str(text),
            Self::Number(value, _) => serializer.serialize_f64(*value),
            Self::Nothing(_) => serializer.serialize_none(),
        }
    }
}

impl From<&str> for Cell {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

impl From<String> for Cell {
    fn from(text: String) -> Self {
        Self::Text(text)
    }
}

/// A table.
#[derive(Clone, Debug, Serialize)]
pub struct Table {
    /// Its name in files.
    pub key: &'static str,
    /// Its heading.
    pub title: String,
    /// Runs, seeds, steps, and what the numbers mean.
    pub notes: Vec<String>,
    /// The column headings, with units.
    pub header: Vec<String>,
    /// The rows, each as long as the header.
    pub rows: Vec<Vec<Cell>>,
}

impl Table {
    /// A table without rows.
    pub fn new(key: &'static str, title: &str, header: &[&str]) -> Self {
        let header = header.iter().map(|&head| head.to_owned()).collect();
        Self { key, title: title.to_owned(), notes: Vec::new(), header, rows: Vec::new() }
    }

    /// The same table with one more note.
    pub fn note(mut self, note: impl Into<String>) -> Self {
        self.notes.push(note.into());
        self
    }

    fn is_number(&self, column: usize) -> bool {
        self.rows.iter().any(|row| matches!(row.get(column), Some(Cell::Number(..))))
    }

    /// The table as text: aligned columns under the title and its notes.
    pub fn text(&self) -> String {
        let mut rows = vec![self.header.clone()];
        rows.extend(self.rows.iter().map(|row| row.iter().map(Cell::shown).collect()));
        let right: Vec<bool> = (0..self.header.len()).map(|c| self.is_number(c)).collect();
        let notes: String = self.notes.iter().map(|note| format!("{note}\n")).collect();
        format!("{}\n{notes}\n{}\n", self.title, columns::table(&rows, &right))
    }

    /// The table as CSV: a header and rows, with numbers in full.
    pub fn csv(&self) -> String {
        let header = self.header.iter().map(|head| Cell::Text(head.clone()).plain()).collect::<Vec<_>>();
        let rows = self.rows.iter().map(|row| row.iter().map(Cell::plain).collect::<Vec<_>>());
        std::iter::once(header).chain(rows).map(|row| row.join(",") + "\n").collect()
    }

    /// The table in Markdown.
    pub fn markdown(&self) -> String {
        let line = |cells: &[String]| format!("| {} |\n", cells.join(" | ").replace('\n', " "));
        let rule: Vec<String> = (0..self.header.len())
            .map(|c| if self.is_number(c) { "---:" } else { "---" }.to_owned())
            .collect();
        let escaped = |text: String| text.replace('|', "\\|");
        let mut text = line(&self.header.iter().cloned().map(escaped).collect::<Vec<_>>());
        text += &line(&rule);
        for row in &self.rows {
            text += &line(&row.iter().map(|cell| escaped(cell.shown())).collect::<Vec<_>>());
        }
        text
    }

    /// The table in HTML.
    pub fn html(&self) -> String {
        let cell = |tag: &str, column: usize, text: &str| {
            let class = if self.is_number(column) { " class=\"n\"" } else { "" };
            format!("<{tag}{class}>{}</{tag}>", escape(text))
        };
        let head: String = self.header.iter().enumerate().map(|(c, text)| cell("th", c, text)).collect();
        let row = |row: &Vec<Cell>| {
            let cells: String = row.iter().enumerate().map(|(c, v)| cell("td", c, &v.shown())).collect();
            format!("<tr>{cells}</tr>\n")
        };
        let body: String = self.rows.iter().map(row).collect();
        format!("<table><thead><tr>{head}</tr></thead>\n<tbody>\n{body}</tbody></table>\n")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_table_in_every_form() {
        let mut table = Table::new("t", "Title", &["what", "|u| (m)"]).note("Seed 1.");
        table.rows.push(vec!["a, <b>".into(), Cell::Number(1.25, 1)]);
        table.rows.push(vec!["c".into(), Cell::optional(Some(f64::INFINITY), 1, "never")]);
        assert_eq!(table.csv(), "what,|u| (m)\n\"a, <b>\",1.25\nc,\n");
        assert_eq!(
            table.markdown(),
            "| what | \\|u\\| (m) |\n| --- | ---: |\n| a, <b> | 1.2 |\n| c | never |\n"
        );
        assert!(table.html().contains("<td>a, &lt;b&gt;</td><td class=\"n\">1.2</td>"));
        assert!(table.text().starts_with("Title\nSeed 1.\n\nwhat    |u| (m)\n"), "{}", table.text());
        let json = serde_json::to_value(&table).expect("JSON");
        assert_eq!(json["rows"][0][1], 1.25);
        assert!(json["rows"][1][1].is_null());
    }
}
