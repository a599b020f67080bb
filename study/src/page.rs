//! The report as one HTML page: tables, and pictures that can be zoomed and read off.

use punctual_cosim::error::Error;
use punctual_pictures::page::{Page, escape};
use punctual_pictures::plot;

use super::{Figure, Report, Table};

/// The page.
///
/// # Errors
///
/// A picture with nothing finite to draw.
pub fn document(report: &Report) -> Result<String, Error> {
    let tables: String = report.tables.iter().map(section).collect();
    let figures = report.figures.iter().map(figure).collect::<Result<String, Error>>()?;
    let contents: String = report
        .tables
        .iter()
        .map(|t| (t.key, t.title.as_str()))
        .chain(report.figures.iter().map(|f| (f.key.as_str(), f.chart.title.as_str())))
        .map(|(key, title)| format!("<li><a href=\"#{key}\">{}</a></li>\n", escape(title)))
        .collect();
    let body = format!(
        "<h1>The paper, reproduced</h1>\n\
         <p>Janani S K and S. Kolathaya, <em>Fixed time convergence guarantees for Higher Order Control Barrier \
         Functions</em>, arXiv:2507.13888: its tables and figures, our runs of its method, our method, and the \
         constraints of the literature. Disc of radius 2 m at (45, 45) m.</p>\n\
         <nav><ul>\n{contents}</ul></nav>\n<h2>Tables</h2>\n{tables}<h2>Figures</h2>\n\
         <p class=\"hint\">Point at a curve to read it off; drag to zoom (two fingers on a phone), double-click to see all again.</p>\n\
         {figures}"
    );
    let charts: Vec<_> = report.figures.iter().map(|f| (&f.key, &f.chart)).collect();
    let title = "Punctual: the paper, reproduced";
    Ok(Page { title, body: &body, charts, style: "", script: "" }.document())
}

fn section(table: &Table) -> String {
    let notes: String = table.notes.iter().map(|note| format!("<p>{}</p>\n", escape(note))).collect();
    format!(
        "<section id=\"{}\">\n<h3>{}</h3>\n{notes}<div class=\"wide\">{}</div>\n</section>\n",
        table.key,
        escape(&table.title),
        table.html()
    )
}

/// The picture as SVG, which the script replaces by an interactive one.
fn figure(figure: &Figure) -> Result<String, Error> {
    let svg = plot::chart(&figure.chart, &figure.key)?;
    Ok(format!(
        "<figure id=\"{0}\">\n<div class=\"chart\" data-chart=\"{0}\">{svg}</div>\n<figcaption>{1}</figcaption>\n</figure>\n",
        figure.key,
        escape(&figure.caption)
    ))
}
