//! Aligns text columns.

/// The rows as aligned text columns. The first row is the header; columns marked `true` in `right` are
/// right-aligned.
pub fn table(rows: &[Vec<String>], right: &[bool]) -> String {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let width = |c: usize| rows.iter().filter_map(|row| row.get(c)).map(|s| shown(s)).max().unwrap_or(0);
    let widths: Vec<usize> = (0..columns).map(width).collect();
    let line = |row: &Vec<String>| {
        let cells = row.iter().enumerate().map(|(c, cell)| {
            let room = " ".repeat(widths[c] - shown(cell));
            if right.get(c) == Some(&true) { format!("{room}{cell}") } else { format!("{cell}{room}") }
        });
        cells.collect::<Vec<_>>().join("  ").trim_end().to_owned()
    };
    let mut lines: Vec<String> = rows.iter().map(line).collect();
    if lines.len() > 1 {
        let rule = widths.iter().map(|w| "─".repeat(*w)).collect::<Vec<_>>().join("  ");
        lines.insert(1, rule);
    }
    lines.join("\n")
}

/// Number of terminal columns that `cell` occupies.
fn shown(cell: &str) -> usize {
    console::measure_text_width(cell)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_line_up() {
        let rows = [vec!["name".into(), "n".into()], vec!["ä".into(), "10".into()]];
        assert_eq!(table(&rows, &[false, true]), "name   n\n────  ──\nä     10");
    }
}
