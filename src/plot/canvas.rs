//! A sheet to draw on, in pixels as doubles from the top left corner. Over plotters' SVG backend,
//! whose coordinates are whole numbers: the sheet is drawn ten times as large and shown in its size.

use std::path::Path;

use plotters::backend::{DrawingBackend, SVGBackend};
use plotters::prelude::{Color, FontTransform, IntoFont, RGBAColor, ShapeStyle, TextStyle};
use plotters::style::text_anchor::{HPos, Pos, VPos};

use crate::error::Error;

/// Units of the backend per pixel.
const FINE: f64 = 10.0;
/// Ratio by which plotters divides font sizes when writing SVG.
const FONT_RATIO: f64 = 1.24;
/// Families in order of preference; the viewer has one of them.
const FONT: &str = "Helvetica, Arial, 'Liberation Sans', 'DejaVu Sans', sans-serif";

/// Text colour.
pub(super) const INK: [u8; 3] = [38, 38, 38];
/// Colour of frames and ticks.
pub(super) const FRAME: [u8; 3] = [90, 90, 90];
/// Colour of grid lines.
pub(super) const GRID: [u8; 3] = [228, 228, 228];
/// Colour of lines that mark a deadline or a bound.
pub(super) const MARK: [u8; 3] = [110, 110, 110];

/// A point in pixels.
pub(super) type Point = (f64, f64);

/// Where a text stands relative to its point.
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

/// The pen of a line.
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

/// The sheet.
pub(super) struct Canvas {
    size: (f64, f64),
    svg: String,
    clip_paths: usize,
}

fn fine(value: f64) -> i32 {
    // Saturates; callers clip to the sheet, so nothing that is drawn is near the limits.
    (value * FINE).round() as i32
}

fn fine_size(value: f64) -> u32 {
    (value * FINE).round().max(1.0) as u32
}

impl Canvas {
    /// A white sheet of this size in pixels.
    pub(super) fn new(width: f64, height: f64) -> Self {
        let mut canvas = Self { size: (width, height), svg: String::new(), clip_paths: 0 };
        canvas.polygon(&[(0.0, 0.0), (width, 0.0), (width, height), (0.0, height)], [255; 3], 1.0);
        canvas
    }

    pub(super) fn height(&self) -> f64 {
        self.size.1
    }

    pub(super) fn width(&self) -> f64 {
        self.size.0
    }

    /// Lets plotters write one element and appends it.
    fn draw(&mut self, element: impl FnOnce(&mut SVGBackend<'_>)) {
        let mut buffer = String::new();
        {
            let mut backend =
                SVGBackend::with_string(&mut buffer, (fine_size(self.size.0), fine_size(self.size.1)));
            element(&mut backend);
            // Presenting writes the closing tag; into a string it cannot fail.
            let _ = backend.present();
        }
        // What stands between the opening and the closing tag.
        if let Some((_, rest)) = buffer.split_once('\n')
            && let Some((inner, _)) = rest.rsplit_once("</svg>")
        {
            self.svg.push_str(inner);
        }
    }

    /// A line through `points`.
    pub(super) fn line(&mut self, points: &[Point], pen: Pen) {
        let style =
            ShapeStyle { color: opaque(pen.colour), filled: false, stroke_width: fine_size(pen.width) };
        let pieces = match pen.dash {
            Some((on, off)) => dashes(points, on, off),
            None => vec![points.to_vec()],
        };
        for piece in pieces {
            self.draw(|backend| {
                // Into a string drawing cannot fail.
                let _ = backend.draw_path(piece.iter().map(|p| (fine(p.0), fine(p.1))), &style);
            });
        }
    }

    /// A filled polygon.
    pub(super) fn polygon(&mut self, points: &[Point], colour: [u8; 3], opacity: f64) {
        let style = ShapeStyle { color: opaque(colour).mix(opacity), filled: true, stroke_width: 0 };
        self.draw(|backend| {
            let _ = backend.fill_polygon(points.iter().map(|p| (fine(p.0), fine(p.1))), &style);
        });
    }

    /// A circle of this radius in pixels: filled, then drawn around.
    pub(super) fn circle(&mut self, centre: Point, radius: f64, fill: ([u8; 3], f64), pen: Pen) {
        let centre = (fine(centre.0), fine(centre.1));
        let radius = fine_size(radius);
        let inner = ShapeStyle { color: opaque(fill.0).mix(fill.1), filled: true, stroke_width: 0 };
        let rim = ShapeStyle { color: opaque(pen.colour), filled: false, stroke_width: fine_size(pen.width) };
        self.draw(|backend| {
            let _ = backend.draw_circle(centre, radius, &inner, true);
            let _ = backend.draw_circle(centre, radius, &rim, false);
        });
    }

    /// A text of this size in pixels.
    pub(super) fn text(&mut self, text: &str, at: Point, size: f64, anchor: Anchor, colour: [u8; 3]) {
        self.write(text, at, size, anchor, colour, FontTransform::None);
    }

    /// A text that runs upwards, its middle at `at`.
    pub(super) fn upward_text(&mut self, text: &str, at: Point, size: f64, colour: [u8; 3]) {
        self.write(text, at, size, Anchor::Middle, colour, FontTransform::Rotate270);
    }

    fn write(
        &mut self,
        text: &str,
        at: Point,
        size: f64,
        anchor: Anchor,
        colour: [u8; 3],
        turn: FontTransform,
    ) {
        let (horizontal, vertical) = match anchor {
            Anchor::Left => (HPos::Left, VPos::Center),
            Anchor::Right => (HPos::Right, VPos::Center),
            Anchor::Below => (HPos::Center, VPos::Top),
            Anchor::Middle => (HPos::Center, VPos::Center),
        };
        let font = (FONT, size * FONT_RATIO * FINE).into_font().transform(turn);
        let colour = opaque(colour);
        let style = TextStyle::from(font).color(&colour).pos(Pos::new(horizontal, vertical));
        self.draw(|backend| {
            let _ = backend.draw_text(text, &style, (fine(at.0), fine(at.1)));
        });
    }

    /// Draws with everything outside a rectangle (left, top, right, bottom) cut away.
    pub(super) fn clipped(&mut self, area: [f64; 4], draw: impl FnOnce(&mut Self)) {
        let id = self.clip_paths;
        self.clip_paths += 1;
        let [left, top, right, bottom] = area.map(|v| v * FINE);
        let (width, height) = (right - left, bottom - top);
        self.svg.push_str(&format!(
            "<clipPath id=\"clip{id}\"><rect x=\"{left}\" y=\"{top}\" width=\"{width}\" height=\"{height}\"/></clipPath>\n\
             <g clip-path=\"url(#clip{id})\">\n"
        ));
        draw(self);
        self.svg.push_str("</g>\n");
    }

    /// Writes the sheet to `file`.
    pub(super) fn save(&self, file: &Path) -> Result<(), Error> {
        std::fs::write(file, self.document()).map_err(|e| Error::io("write", file, e))
    }

    /// The SVG document.
    pub(super) fn document(&self) -> String {
        let (width, height) = self.size;
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
             viewBox=\"0 0 {} {}\" stroke-linejoin=\"round\">\n{}</svg>\n",
            fine_size(width),
            fine_size(height),
            self.svg,
        )
    }
}

fn opaque([r, g, b]: [u8; 3]) -> RGBAColor {
    RGBAColor(r, g, b, 1.0)
}

/// `points` cut into dashes of length `on` with gaps of length `off`, both > 0, in pixels.
fn dashes(points: &[Point], on: f64, off: f64) -> Vec<Vec<Point>> {
    let mut pieces = Vec::new();
    let mut piece: Vec<Point> = points.first().copied().into_iter().collect();
    let (mut drawing, mut left) = (true, on);
    for pair in points.windows(2) {
        let ((mut x, mut y), (to_x, to_y)) = (pair[0], pair[1]);
        let mut rest = (to_x - x).hypot(to_y - y);
        while rest > left {
            let part = left / rest;
            (x, y) = (x + part * (to_x - x), y + part * (to_y - y));
            rest -= left;
            if drawing {
                piece.push((x, y));
                pieces.push(std::mem::take(&mut piece));
            } else {
                piece = vec![(x, y)];
            }
            drawing = !drawing;
            left = if drawing { on } else { off };
        }
        left -= rest;
        if drawing {
            piece.push((to_x, to_y));
        }
    }
    if piece.len() > 1 {
        pieces.push(piece);
    }
    pieces
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dashes_cover_their_share_of_a_line() {
        let pieces = dashes(&[(0.0, 0.0), (6.0, 0.0), (10.0, 0.0)], 3.0, 2.0);
        assert_eq!(pieces, [vec![(0.0, 0.0), (3.0, 0.0)], vec![(5.0, 0.0), (6.0, 0.0), (8.0, 0.0)]]);
    }

    #[test]
    fn the_document_is_one_svg_element_with_escaped_text() {
        let mut canvas = Canvas::new(100.0, 50.0);
        canvas.text("a < b & c", (10.0, 10.0), 12.0, Anchor::Left, INK);
        let document = canvas.document();
        assert_eq!(document.matches("<svg").count(), 1);
        assert_eq!(document.matches("</svg>").count(), 1);
        assert!(document.contains("viewBox=\"0 0 1000 500\""), "{document}");
        assert!(document.contains("a &lt; b &amp; c"), "{document}");
    }
}
