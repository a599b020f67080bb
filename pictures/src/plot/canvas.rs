//! A sheet to draw on, in pixels from the top left corner, written as SVG. Only this file uses the crate svg.

use std::path::Path;

use punctual_cosim::error::Error;
use punctual_cosim::whole;
use svg::node::element::{
    AnimateTransform, Circle, ClipPath, Definitions, Group, Path as Strokes, Polygon, Polyline, Rectangle,
    Text,
};
use svg::{Document, Node};

/// Font families in order of preference; the viewer uses the first that it has.
const FONT: &str = "Helvetica, Arial, 'Liberation Sans', 'DejaVu Sans', sans-serif";
/// Mean width of a character relative to the font size: a digit of Helvetica has 0.556, English words less.
const CHARACTER: f64 = 0.556;
/// Distance from the middle of a line of text down to its base line, relative to the font size: half a
/// capital of Helvetica.
const MIDDLE: &str = "0.36em";
/// The same from the top of a line.
const TOP: &str = "0.76em";

/// Text colour.
pub(super) const INK: [u8; 3] = [38, 38, 38];
/// Colour of frames and ticks.
pub(super) const FRAME: [u8; 3] = [90, 90, 90];
/// Colour of grid lines.
pub(super) const GRID: [u8; 3] = [228, 228, 228];
/// Colour of lines that mark a deadline or a bound.
pub(super) const MARK: [u8; 3] = [110, 110, 110];

/// Colour of safe sets and regions.
pub(super) const SAFE: [u8; 3] = [0, 158, 115];

/// A point in pixels.
pub(super) type Point = (f64, f64);

/// Position of a text relative to its point.
#[derive(Clone, Copy, Debug)]
pub(super) enum Anchor {
    /// The point is at the left end, half-way up.
    Left,
    /// The point is at the right end, half-way up.
    Right,
    /// The point is above the middle.
    Below,
    /// The point is in the middle.
    Middle,
}

/// How a line is drawn.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pen {
    pub(super) colour: [u8; 3],
    /// Width in pixels.
    pub(super) width: f64,
    /// Lengths of dash and gap in pixels.
    pub(super) dash: Option<(f64, f64)>,
}

impl Pen {
    pub(super) fn solid(colour: [u8; 3], width: f64) -> Self {
        Self { colour, width, dash: None }
    }
}

/// The approximate width of a text in pixels; the viewer chooses the font, so the exact width is unknown.
pub(super) fn text_width(text: &str, size: f64) -> f64 {
    text.chars().count() as f64 * size * CHARACTER
}

/// The sheet.
pub(super) struct Canvas {
    name: String,
    size: (f64, f64),
    content: Group,
    clips: Vec<[f64; 4]>,
}

impl Canvas {
    /// A white sheet of this size in pixels. `name` is the prefix of its ids, which must be unique on a page.
    pub(super) fn new(name: &str, width: f64, height: f64) -> Self {
        let mut canvas =
            Self { name: name.to_owned(), size: (width, height), content: Group::new(), clips: Vec::new() };
        canvas.polygon(&[(0.0, 0.0), (width, 0.0), (width, height), (0.0, height)], [255; 3], 1.0);
        canvas
    }

    pub(super) fn height(&self) -> f64 {
        self.size.1
    }

    pub(super) fn width(&self) -> f64 {
        self.size.0
    }

    fn add(&mut self, element: impl Node) {
        self.content.append(element);
    }

    /// A line through `points`.
    pub(super) fn line(&mut self, points: &[Point], pen: Pen) {
        let mut line = Polyline::new()
            .set("points", coordinates(points))
            .set("stroke", hex(pen.colour))
            .set("stroke-width", pen.width);
        if let Some(dash) = pen.dash {
            line = line.set("stroke-dasharray", dash);
        }
        self.add(line);
    }

    /// Dots or crosses sized by `pen`, as one element, since there may be thousands.
    pub(super) fn scattered(&mut self, points: impl Iterator<Item = Point>, crosses: bool, pen: Pen) {
        let mark = |(x, y): Point| match crosses {
            true => format!("M{} {}l6 6m0 -6l-6 6", rounded(x - 3.0), rounded(y - 3.0)),
            false => format!("M{} {}h0", rounded(x), rounded(y)),
        };
        let strokes = Strokes::new()
            .set("d", points.map(mark).collect::<String>())
            .set("stroke", hex(pen.colour))
            .set("stroke-width", pen.width)
            .set("stroke-linecap", "round");
        self.add(strokes);
    }

    /// A filled polygon.
    pub(super) fn polygon(&mut self, points: &[Point], colour: [u8; 3], opacity: f64) {
        self.add(filled(Polygon::new().set("points", coordinates(points)), colour, opacity));
    }

    /// A circle with this radius in pixels, filled and then outlined.
    pub(super) fn circle(&mut self, centre: Point, radius: f64, fill: ([u8; 3], f64), pen: Pen) {
        let circle =
            Circle::new().set("cx", rounded(centre.0)).set("cy", rounded(centre.1)).set("r", rounded(radius));
        let circle = circle.set("stroke", hex(pen.colour)).set("stroke-width", pen.width);
        self.add(filled(circle, fill.0, fill.1));
    }

    /// The union of the areas within closed lines, filled as one, so that they do not darken each other. Each line has to run
    /// in the same direction.
    pub(super) fn union(&mut self, rings: &[Vec<Point>], colour: [u8; 3], opacity: f64) {
        let ring = |points: &Vec<Point>| {
            let points: Vec<_> =
                points.iter().map(|(x, y)| format!("{} {}", rounded(*x), rounded(*y))).collect();
            format!("M{}Z", points.join("L"))
        };
        let strokes =
            Strokes::new().set("d", rings.iter().map(ring).collect::<String>()).set("fill-rule", "nonzero");
        self.add(filled(strokes, colour, opacity));
    }

    /// The area that an odd number of closed lines encloses, filled and then outlined.
    pub(super) fn area(
        &mut self,
        rings: impl Iterator<Item = impl Iterator<Item = Point>>,
        fill: ([u8; 3], f64),
        pen: Pen,
    ) {
        let ring = |points: &mut dyn Iterator<Item = Point>| {
            let points: Vec<_> = points.map(|(x, y)| format!("{} {}", rounded(x), rounded(y))).collect();
            format!("M{}Z", points.join("L"))
        };
        let strokes = Strokes::new()
            .set("d", rings.map(|mut points| ring(&mut points)).collect::<String>())
            .set("fill-rule", "evenodd")
            .set("stroke", hex(pen.colour))
            .set("stroke-width", pen.width);
        self.add(filled(strokes, fill.0, fill.1));
    }

    /// A filled polygon around (0, 0), which points along x and goes through `places` at the `parts` of `seconds`, 0 to 1,
    /// turned to the right by `turns` degrees each; over and over.
    pub(super) fn moving(
        &mut self,
        polygon: &[Point],
        fill: [u8; 3],
        (places, turns): (&[Point], &[f64]),
        (parts, seconds): (&[f64], f64),
    ) {
        let list = |words: &mut dyn Iterator<Item = String>| words.collect::<Vec<_>>().join(";");
        let animated = |kind: &str, values: String| {
            AnimateTransform::new()
                .set("attributeName", "transform")
                .set("type", kind)
                .set("values", values)
                .set("keyTimes", list(&mut parts.iter().map(|part| format!("{part:.4}"))))
                .set("dur", format!("{seconds}s"))
                .set("repeatCount", "indefinite")
        };
        let at = places.iter().map(|(x, y)| format!("{} {}", rounded(*x), rounded(*y)));
        let turned = turns.iter().map(|turn| rounded(*turn).to_string());
        let shape =
            filled(Polygon::new().set("points", coordinates(polygon)), fill, 1.0).set("stroke", "#ffffff");
        let group = Group::new()
            .add(animated("translate", list(&mut at.into_iter())))
            .add(Group::new().add(animated("rotate", list(&mut turned.into_iter()))).add(shape));
        self.add(group);
    }

    /// A text of this size in pixels.
    pub(super) fn text(&mut self, text: &str, at: Point, size: f64, anchor: Anchor, colour: [u8; 3]) {
        self.add(written(text, at, size, anchor, colour));
    }

    /// A text that runs upwards, centred at `at`.
    pub(super) fn upward_text(&mut self, text: &str, at: Point, size: f64, colour: [u8; 3]) {
        let turn = format!("rotate(-90 {} {})", rounded(at.0), rounded(at.1));
        self.add(written(text, at, size, Anchor::Middle, colour).set("transform", turn));
    }

    /// Draws with everything outside a rectangle (left, top, right, bottom) clipped.
    pub(super) fn clipped(&mut self, area: [f64; 4], draw: impl FnOnce(&mut Self)) {
        let known = self.clips.iter().position(|other| *other == area);
        let index = known.unwrap_or(self.clips.len());
        if known.is_none() {
            self.clips.push(area);
        }
        let clip = format!("url(#{})", self.clip_id(index));
        let outside = std::mem::replace(&mut self.content, Group::new().set("clip-path", clip));
        draw(self);
        let inside = std::mem::replace(&mut self.content, outside);
        self.add(inside);
    }

    fn clip_id(&self, index: usize) -> String {
        format!("{}-clip{index}", self.name)
    }

    /// Writes the sheet to `file`.
    pub(super) fn save(self, file: &Path) -> Result<(), Error> {
        whole::write(file, self.document())
    }

    /// The SVG document.
    pub(super) fn document(self) -> String {
        let mut definitions = Definitions::new();
        for (index, [left, top, right, bottom]) in self.clips.iter().enumerate() {
            let area = Rectangle::new()
                .set("x", rounded(*left))
                .set("y", rounded(*top))
                .set("width", rounded(right - left))
                .set("height", rounded(bottom - top));
            definitions = definitions.add(ClipPath::new().set("id", self.clip_id(index)).add(area));
        }
        let (width, height) = self.size;
        let document = Document::new()
            .set("width", width)
            .set("height", height)
            .set("viewBox", (0, 0, width, height))
            .set("font-family", FONT)
            .set("fill", "none")
            .set("stroke-linejoin", "round");
        format!("{}\n", document.add(definitions).add(self.content))
    }
}

fn written(text: &str, at: Point, size: f64, anchor: Anchor, colour: [u8; 3]) -> Text {
    let (across, down) = match anchor {
        Anchor::Left => ("start", MIDDLE),
        Anchor::Right => ("end", MIDDLE),
        Anchor::Below => ("middle", TOP),
        Anchor::Middle => ("middle", MIDDLE),
    };
    Text::new(text)
        .set("x", rounded(at.0))
        .set("y", rounded(at.1))
        .set("dy", down)
        .set("font-size", size)
        .set("text-anchor", across)
        .set("fill", hex(colour))
}

fn filled<E: Node>(mut element: E, colour: [u8; 3], opacity: f64) -> E {
    element.assign("fill", hex(colour));
    if opacity < 1.0 {
        element.assign("fill-opacity", opacity);
    }
    element
}

fn coordinates(points: &[Point]) -> Vec<(f64, f64)> {
    points.iter().map(|point| (rounded(point.0), rounded(point.1))).collect()
}

/// A length in pixels, rounded to two decimals. Adding 0 removes the sign of a zero.
fn rounded(length: f64) -> f64 {
    (length * 100.0).round() / 100.0 + 0.0
}

fn hex([r, g, b]: [u8; 3]) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_document_is_one_svg_element_with_escaped_text() {
        let mut canvas = Canvas::new("a", 100.0, 50.0);
        canvas.text("a < b & c", (10.0, 10.0), 12.0, Anchor::Left, INK);
        let document = canvas.document();
        assert_eq!(document.matches("<svg").count(), 1);
        assert_eq!(document.matches("</svg>").count(), 1);
        assert!(document.contains("viewBox=\"0 0 100 50\""), "{document}");
        assert!(document.contains("a &lt; b &amp; c"), "{document}");
    }

    #[test]
    fn what_is_cut_away_alike_shares_a_clip() {
        let mut canvas = Canvas::new("a", 100.0, 50.0);
        let pen = Pen { colour: MARK, width: 1.5, dash: Some((3.0, 2.0)) };
        for area in [[0.0, 0.0, 9.0, 9.0], [0.0, 0.0, 9.0, 9.0], [1.0, 0.0, 9.0, 9.0]] {
            canvas.clipped(area, |canvas| canvas.line(&[(0.0, 1.0 / 3.0), (9.0, -1e-9)], pen));
        }
        let document = canvas.document();
        assert_eq!(document.matches("<clipPath").count(), 2, "{document}");
        assert_eq!(document.matches("clip-path=\"url(#a-clip0)\"").count(), 2, "{document}");
        assert_eq!(document.matches("points=\"0 0.33 9 0\"").count(), 3, "{document}");
        assert_eq!(document.matches("stroke-dasharray=\"3 2\"").count(), 3, "{document}");
    }
}
