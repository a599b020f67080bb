//! Curves in a plane with axes of any kind, for pictures that the other kinds do not cover. A chart is data:
//! it is drawn as SVG here, and by a script in a page.

use serde::Serialize;

use super::axes::Axes;
use super::canvas::{Anchor, Canvas, INK, MARK, Pen, SAFE};
use super::decimate::decimate;
use super::legend::{self, Entry, Key};
use super::path::equal_axes;
use super::scale::{Axis, extent};
use super::{Disc, Mark, Style, colour};

/// Width of the sheet in pixels.
pub(super) const WIDTH: f64 = 860.0;
/// Height of the sheet in pixels, with equal axes and otherwise.
const HEIGHTS: [f64; 2] = [620.0, 440.0];
/// Height of one legend entry, in pixels.
const ROW: f64 = 21.0;

/// Curves over common axes.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Chart {
    /// Title; empty for none.
    pub title: String,
    /// The x axis.
    pub x: Scaling,
    /// The y axis.
    pub y: Scaling,
    /// Whether both axes have the same scale.
    pub equal: bool,
    /// The curves.
    pub curves: Vec<Curve>,
    /// Discs beneath them.
    pub discs: Vec<Disc>,
    /// Vertical lines.
    pub verticals: Vec<Mark>,
    /// Horizontal lines.
    pub horizontals: Vec<Mark>,
}

/// An axis.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Scaling {
    /// Label with the unit.
    pub label: String,
    /// Whether it is logarithmic, showing absolute values.
    pub logarithmic: bool,
    /// The range shown; by default everything.
    pub range: Option<[f64; 2]>,
}

impl Scaling {
    /// A linear axis that shows everything.
    pub fn linear(label: impl Into<String>) -> Self {
        Self { label: label.into(), ..Self::default() }
    }

    /// A logarithmic axis that shows everything.
    pub fn logarithmic(label: impl Into<String>) -> Self {
        Self { label: label.into(), logarithmic: true, ..Self::default() }
    }

    /// The same axis with this range.
    pub fn over(self, low: f64, high: f64) -> Self {
        Self { range: Some([low, high]), ..self }
    }

    fn axis(&self, values: impl Iterator<Item = f64>, ticks: usize) -> Result<Axis, String> {
        let shown = |v: f64| if self.logarithmic { v.abs() } else { v };
        let values = values.map(shown).filter(|v| !self.logarithmic || *v > 0.0);
        let found = self.range.map(|[low, high]| (low, high)).or_else(|| extent(values));
        let (low, high) = found.ok_or("there is no finite point")?;
        Ok(if self.logarithmic {
            Axis::logarithmic(low, high)
        } else {
            Axis::linear(low, high, ticks, self.range.is_none())
        })
    }
}

/// A curve.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Curve {
    /// Legend entry; empty for none.
    pub label: String,
    /// Points along x; a value that is not finite breaks the line.
    pub x: Vec<f64>,
    /// Points along y, as many as in `x`.
    pub y: Vec<f64>,
    /// Style of the line.
    pub style: Style,
    /// Position in [`PALETTE`](super::PALETTE).
    pub colour: usize,
    /// Whether each point is marked too.
    pub dots: bool,
    /// Points that get the start marker and the arrival marker.
    pub ends: [Option<[f64; 2]>; 2],
}

impl Curve {
    /// The same curve thinned to about `limit` points of seven digits; extremes are kept.
    pub fn thinned(mut self, limit: usize) -> Self {
        // Along an increasing x, such as time, only y has extremes.
        let rising = self.x.is_sorted();
        let kept = if rising { decimate(&[&self.y], limit) } else { decimate(&[&self.x, &self.y], limit) };
        let rounded = |values: &[f64]| kept.iter().map(|&k| seven_digits(values[k])).collect();
        (self.x, self.y) = (rounded(&self.x), rounded(&self.y));
        self
    }
}

/// `value` rounded to seven significant digits, far more than a picture shows.
pub fn seven_digits(value: f64) -> f64 {
    format!("{value:.6e}").parse().unwrap_or(value)
}

impl Chart {
    pub(super) fn height(&self) -> f64 {
        HEIGHTS[usize::from(!self.equal)] + self.entries().len() as f64 * ROW
    }

    fn entries(&self) -> Vec<Entry> {
        let labelled = self.curves.iter().filter(|curve| !curve.label.is_empty());
        let key = |curve: &Curve| match curve.style {
            Style::Points => Key::Dot(pen(curve)),
            Style::Crosses => Key::Cross(pen(curve)),
            _ => Key::Line(pen(curve)),
        };
        let mut entries: Vec<Entry> = labelled.map(|c| (key(c), c.label.clone())).collect();
        for (index, key, label) in [(0, Key::Start, "start"), (1, Key::Arrival, "arrival")] {
            if self.curves.iter().any(|curve| curve.ends[index].is_some()) {
                entries.push((key, label.to_owned()));
            }
        }
        for disc in self.discs.iter().filter(|disc| !disc.label.is_empty()) {
            entries.push((Key::Patch(SAFE, 0.18, Pen::solid(SAFE, 1.2)), disc.label.clone()));
        }
        entries
    }
}

fn pen(curve: &Curve) -> Pen {
    let dash = (curve.style == Style::Dashed).then_some((7.0, 4.0));
    let width = if curve.style == Style::Points { 4.6 } else { 1.9 };
    Pen { colour: colour(curve.colour), width, dash }
}

pub(super) fn draw(chart: &Chart, canvas: &mut Canvas) -> Result<(), String> {
    let title = if chart.title.is_empty() { 14.0 } else { 40.0 };
    let marked = chart.verticals.iter().any(|mark| !mark.label.is_empty());
    let top = title + if marked { 16.0 } else { 0.0 };
    let legend = chart.entries();
    let bottom = HEIGHTS[usize::from(!chart.equal)] - 62.0;
    let area = [96.0, top, canvas.width() - 24.0, bottom];
    let curves = || chart.curves.iter();
    let discs = |axis: usize| {
        chart.discs.iter().flat_map(move |d| [d.centre[axis] - d.radius, d.centre[axis] + d.radius])
    };
    let at = |mark: &Mark| mark.at;
    let x = curves().flat_map(|c| c.x.iter().copied()).chain(discs(0)).chain(chart.verticals.iter().map(at));
    let y =
        curves().flat_map(|c| c.y.iter().copied()).chain(discs(1)).chain(chart.horizontals.iter().map(at));
    let axes = if chart.equal {
        let range = |scaling: &Scaling, all| scaling.range.map(|[low, high]| (low, high)).or(all);
        equal_axes([range(&chart.x, extent(x)), range(&chart.y, extent(y))], area)?
    } else {
        Axes { area, x: chart.x.axis(x, 9)?, y: chart.y.axis(y, 7)? }
    };
    axes.frame(canvas, &chart.x.label, &chart.y.label, true);
    if !chart.title.is_empty() {
        canvas.text(&chart.title, ((area[0] + area[2]) / 2.0, 20.0), 16.0, Anchor::Middle, INK);
    }
    axes.sets(canvas, &chart.discs, &[]);
    marks(chart, &axes, canvas);
    for curve in curves() {
        let points = || curve.x.iter().copied().zip(curve.y.iter().copied());
        if matches!(curve.style, Style::Points | Style::Crosses) {
            let places = points().map(|(x, y)| axes.place(x, y)).filter(|at| inside(area, at));
            canvas.scattered(places, curve.style == Style::Crosses, pen(curve));
            continue;
        }
        axes.curve(canvas, points(), pen(curve), curve.style == Style::Steps);
        let place = |[x, y]: [f64; 2]| Some(axes.place(x, y)).filter(|at| inside(area, at));
        for point in points().filter(|_| curve.dots).filter_map(|(x, y)| place([x, y])) {
            canvas.circle(point, 3.2, (colour(curve.colour), 1.0), Pen::solid(colour(curve.colour), 1.0));
        }
        if let Some(point) = curve.ends[0].and_then(place) {
            legend::start_marker(canvas, point, colour(curve.colour));
        }
        if let Some(point) = curve.ends[1].and_then(place) {
            legend::arrival_marker(canvas, point, colour(curve.colour));
        }
    }
    legend::draw(canvas, &legend, (area[0], area[3] + 52.0));
    Ok(())
}

/// Whether a point lies in the rectangle, up to round-off.
fn inside(area: [f64; 4], (x, y): &(f64, f64)) -> bool {
    (area[0]..=area[2]).contains(x) && (area[1] - 1.0..=area[3] + 1.0).contains(y)
}

fn marks(chart: &Chart, axes: &Axes, canvas: &mut Canvas) {
    let [left, top, right, bottom] = axes.area;
    let dashed = Pen { colour: MARK, width: 1.4, dash: Some((3.0, 3.0)) };
    for mark in &chart.verticals {
        let (x, _) = axes.place(mark.at, axes.y.low);
        if (left..=right).contains(&x) {
            canvas.line(&[(x, top), (x, bottom)], dashed);
            canvas.text(&mark.label, (x, top - 8.0), 12.0, Anchor::Middle, MARK);
        }
    }
    for mark in &chart.horizontals {
        let (_, y) = axes.place(axes.x.low, mark.at);
        if (top..=bottom).contains(&y) {
            canvas.line(&[(left, y), (right, y)], dashed);
            canvas.text(&mark.label, (right - 6.0, y - 9.0), 12.0, Anchor::Right, MARK);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_chart_has_its_curves_marks_and_labels() {
        let curve = Curve {
            label: "c".into(),
            x: vec![1.0, 10.0],
            y: vec![1e-3, 1e2],
            dots: true,
            ..Curve::default()
        };
        let chart = Chart {
            title: "t < u".into(),
            x: Scaling::logarithmic("x (s)"),
            y: Scaling::logarithmic("y (m)"),
            curves: vec![curve],
            verticals: vec![Mark { label: "deadline".into(), at: 5.0 }],
            ..Chart::default()
        };
        let svg = crate::plot::chart(&chart, "test").expect("something to draw");
        for text in ["t &lt; u", "x (s)", "y (m)", "deadline", "10⁻³"] {
            assert!(svg.contains(text), "no {text} in {svg}");
        }
        assert_eq!(svg.matches("<circle").count(), 2);
        assert!(crate::plot::chart(&Chart::default(), "test").is_err());
    }

    #[test]
    fn points_without_a_line_are_one_element_without_what_is_not_finite() {
        let curve = |style, label: &str| Curve {
            label: label.into(),
            x: vec![0.0, 1.0, f64::NAN],
            y: vec![2.0, 3.0, 4.0],
            style,
            ..Curve::default()
        };
        let curves = vec![curve(Style::Points, "dots"), curve(Style::Crosses, "crosses")];
        let svg = crate::plot::chart(&Chart { curves, ..Chart::default() }, "test").expect("points");
        // Two on the curve, and one in the legend.
        assert_eq!((svg.matches("h0").count(), svg.matches("l6 6m0 -6l-6 6").count()), (3, 3), "{svg}");
        assert_eq!(svg.matches("<path").count(), 4);
        assert!(!svg.contains("NaN"), "{svg}");
    }

    #[test]
    fn thinning_keeps_extremes() {
        let mut y = vec![0.0; 10_000];
        y[1234] = 7.0;
        let curve = Curve { x: (0..y.len()).map(|k| k as f64).collect(), y, ..Curve::default() }.thinned(200);
        assert!(curve.x.len() <= 200 && curve.y.contains(&7.0));
    }
}
