//! An HTML page with charts that can be zoomed and read off. It loads nothing from a network.

use serde::Serialize;

use crate::plot;

/// Draws the charts. The script is written by hand, so that a page needs no library.
const CHARTS: &str = include_str!("charts.js");
const STYLE: &str = include_str!("page.css");

/// The parts of a page.
pub struct Page<'a, C> {
    /// The title, as text.
    pub title: &'a str,
    /// The content, as HTML. An element with a chart's key as `data-chart` is the place of that chart.
    pub body: &'a str,
    /// The charts with their keys: a list of pairs.
    pub charts: C,
    /// Additional style for this page.
    pub style: &'a str,
    /// A script that runs after the charts are drawn; it finds them in `views`.
    pub script: &'a str,
}

impl<C: Serialize> Page<'_, C> {
    /// The page as HTML.
    pub fn document(&self) -> String {
        let Self { title, body, charts, style, script } = self;
        format!(
            "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
             <title>{}</title>\n<style>\n{STYLE}{style}</style>\n</head>\n<body>\n<main>\n{body}</main>\n\
             <script>\nconst palette = {};\nconst charts = {};\n{CHARTS}{script}</script>\n</body>\n</html>\n",
            escape(title),
            json(&plot::PALETTE),
            json(charts),
        )
    }
}

/// Escapes text for HTML.
pub fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// JSON for a script. Text in it can neither end the script nor open a comment, since `<` only occurs in
/// strings, where it is escaped.
pub fn json(value: &impl Serialize) -> String {
    serde_json::to_string(value).unwrap_or_else(|_| "null".to_owned()).replace('<', "\\u003c")
}
