//! A rectangle with two axes: grid, frame, ticks, labels; and curves inside it.

use super::canvas::{Anchor, Canvas, FRAME, GRID, INK, Pen, Point, text_width};
use super::scale::Axis;
use super::{Disc, set_colour};
use crate::outlines::Outline;

/// Size of tick labels in pixels.
const TICK_SIZE: f64 = 12.0;
/// Size of axis labels in pixels.
const LABEL_SIZE: f64 = 13.5;
/// Length of tick marks in pixels.
const TICK: f64 = 5.0;

/// Axes over a rectangle of the sheet.
pub(super) struct Axes {
    /// Left, top, right, bottom, in pixels.
    pub(super) area: [f64; 4],
    pub(super) x: Axis,
    pub(super) y: Axis,
}

impl Axes {
    /// The position of a point on the sheet; NaN if it has none.
    pub(super) fn place(&self, x: f64, y: f64) -> Point {
        let [left, top, right, bottom] = self.area;
        (left + self.x.fraction(x) * (right - left), bottom - self.y.fraction(y) * (bottom - top))
    }

    /// Draws grid, frame, ticks and labels. An empty label is omitted, and without `x_ticks` the x axis has
    /// no numbers.
    pub(super) fn frame(&self, canvas: &mut Canvas, x_label: &str, y_label: &str, x_ticks: bool) {
        let [left, top, right, bottom] = self.area;
        let grid = Pen::solid(GRID, 0.8);
        let mark = Pen::solid(FRAME, 1.0);
        for (value, label) in &self.x.ticks {
            let (x, _) = self.place(*value, self.y.low);
            canvas.line(&[(x, top), (x, bottom)], grid);
            canvas.line(&[(x, bottom), (x, bottom + TICK)], mark);
            if x_ticks {
                canvas.text(label, (x, bottom + TICK + 4.0), TICK_SIZE, Anchor::Below, INK);
            }
        }
        for (value, label) in &self.y.ticks {
            let (_, y) = self.place(self.x.low, *value);
            canvas.line(&[(left, y), (right, y)], grid);
            canvas.line(&[(left - TICK, y), (left, y)], mark);
            canvas.text(label, (left - TICK - 4.0, y), TICK_SIZE, Anchor::Right, INK);
        }
        let corners = [(left, top), (right, top), (right, bottom), (left, bottom), (left, top)];
        canvas.line(&corners, mark);
        if !x_label.is_empty() {
            canvas.text(x_label, ((left + right) / 2.0, bottom + 30.0), LABEL_SIZE, Anchor::Below, INK);
        }
        if !y_label.is_empty() {
            let x = (left - self.tick_width() - 22.0).max(12.0);
            canvas.upward_text(y_label, (x, (top + bottom) / 2.0), LABEL_SIZE, INK);
        }
    }

    /// The approximate width of the widest y tick label, in pixels.
    fn tick_width(&self) -> f64 {
        self.y.ticks.iter().map(|(_, label)| text_width(label, TICK_SIZE)).fold(0.0, f64::max)
    }

    /// Draws sets, clipped to the rectangle. Discs require equal scales on both axes.
    pub(super) fn sets(&self, canvas: &mut Canvas, discs: &[Disc], outlines: &[Outline]) {
        if discs.is_empty() && outlines.is_empty() {
            return;
        }
        canvas.clipped(self.area, |canvas| {
            for outline in outlines {
                self.outline(canvas, outline, (set_colour(outline.obstacle), 0.18));
            }
            for disc in discs {
                self.disc(canvas, disc, (set_colour(disc.obstacle), 0.18));
            }
        });
    }

    /// Draws the sets to keep out of again, over everything that is there.
    pub(super) fn obstacles(&self, canvas: &mut Canvas, discs: &[Disc], outlines: &[Outline]) {
        canvas.clipped(self.area, |canvas| {
            for fill in [([255; 3], 1.0), (set_colour(true), 0.18)] {
                outlines.iter().filter(|of| of.obstacle).for_each(|of| self.outline(canvas, of, fill));
                discs.iter().filter(|of| of.obstacle).for_each(|of| self.disc(canvas, of, fill));
            }
        });
    }

    fn outline(&self, canvas: &mut Canvas, outline: &Outline, fill: ([u8; 3], f64)) {
        let rings = outline.rings.iter().map(|ring| ring.iter().map(|&[x, y]| self.place(x, y)));
        canvas.area(rings, fill, Pen::solid(set_colour(outline.obstacle), 1.2));
    }

    fn disc(&self, canvas: &mut Canvas, disc: &Disc, fill: ([u8; 3], f64)) {
        let pixels = (self.area[2] - self.area[0]) / (self.x.high - self.x.low);
        let centre = self.place(disc.centre[0], disc.centre[1]);
        canvas.circle(centre, disc.radius * pixels, fill, Pen::solid(set_colour(disc.obstacle), 1.2));
    }

    /// Draws a curve, clipped to the rectangle and broken where a point has no position. With `steps`, it
    /// runs right to the next point before it jumps.
    pub(super) fn curve(
        &self,
        canvas: &mut Canvas,
        points: impl Iterator<Item = (f64, f64)>,
        pen: Pen,
        steps: bool,
    ) {
        let [left, top, right, bottom] = self.area;
        // Distant points are moved closer, so that clipping keeps its precision.
        let far = 4.0 * (right - left).max(bottom - top);
        let mut pieces: Vec<Vec<Point>> = vec![Vec::new()];
        for (x, y) in points {
            let (x, y) = self.place(x, y);
            let Some(piece) = pieces.last_mut() else { continue };
            if !(x.is_finite() && y.is_finite()) {
                if !piece.is_empty() {
                    pieces.push(Vec::new());
                }
                continue;
            }
            let point = (x.clamp(left - far, right + far), y.clamp(top - far, bottom + far));
            if let (true, Some(last)) = (steps, piece.last()) {
                piece.push((point.0, last.1));
            }
            piece.push(point);
        }
        canvas.clipped([left, top - 1.0, right, bottom + 1.0], |canvas| {
            for piece in pieces.iter().filter(|piece| piece.len() > 1) {
                canvas.line(piece, pen);
            }
        });
    }
}
