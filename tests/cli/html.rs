//! Parses pages for a browser.

use serde_json::Value;

/// The JSON after `const <name> = ` in a page.
#[track_caller]
pub(crate) fn data(page: &str, name: &str) -> Value {
    let (_, rest) = page.split_once(&format!("const {name} = ")).unwrap_or_else(|| panic!("no {name}"));
    let line = rest.lines().next().and_then(|line| line.strip_suffix(';')).expect("a line of data");
    serde_json::from_str(line).unwrap_or_else(|e| panic!("{name}: {e}"))
}

/// The page without its scripts and styles, as a tree.
#[track_caller]
pub(crate) fn body(page: &str) -> roxmltree::Document<'_> {
    let (from, to) = (page.find("<main>").expect("a body"), page.find("</main>").expect("its end"));
    roxmltree::Document::parse(&page[from..to + "</main>".len()]).expect("well-formed HTML")
}

/// The texts of the cells of a table, row after row.
pub(crate) fn cells(tree: &roxmltree::Document<'_>) -> Vec<Vec<String>> {
    let rows = tree.descendants().filter(|node| node.has_tag_name("tr"));
    let text =
        |node: roxmltree::Node<'_, '_>| node.descendants().filter_map(|n| n.text()).next().map(str::to_owned);
    rows.map(|row| row.children().filter(|cell| cell.is_element()).filter_map(text).collect()).collect()
}
