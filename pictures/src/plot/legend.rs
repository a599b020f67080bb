//! The legend, a column to the right of the axes, so that it never covers data.

use super::canvas::{Anchor, Canvas, INK, Pen, Point, text_width};

/// Text size in pixels.
const SIZE: f64 = 12.0;
/// Height of an entry in pixels.
const ROW: f64 = 21.0;
/// Width of the symbol in pixels.
const KEY: f64 = 26.0;

/// The symbol before the text of an entry.
#[derive(Clone, Copy, Debug)]
pub(super) enum Key {
    Line(Pen),
    /// A dot.
    Dot(Pen),
    /// A cross.
    Cross(Pen),
    /// Fill colour, its opacity, and the outline.
    Patch([u8; 3], f64, Pen),
    Start,
    Arrival,
}

/// An entry.
pub(super) type Entry = (Key, String);

/// The approximate width in pixels of a column with these entries; 0 if there are none.
pub(super) fn width(entries: &[Entry]) -> f64 {
    entries.iter().map(|(_, text)| KEY + 8.0 + text_width(text, SIZE)).fold(0.0, f64::max)
}

/// The height of that column in pixels.
pub(super) fn height(entries: &[Entry]) -> f64 {
    entries.len() as f64 * ROW
}

/// Draws the entries downwards from `at`.
pub(super) fn draw(canvas: &mut Canvas, entries: &[Entry], at: Point) {
    for (i, (key, text)) in entries.iter().enumerate() {
        let y = at.1 + (i as f64 + 0.5) * ROW;
        let (left, right) = (at.0, at.0 + KEY);
        let middle = ((left + right) / 2.0, y);
        match *key {
            Key::Line(pen) => canvas.line(&[(left, y), (right, y)], pen),
            Key::Dot(pen) => canvas.scattered([middle].into_iter(), false, pen),
            Key::Cross(pen) => canvas.scattered([middle].into_iter(), true, pen),
            Key::Patch(colour, opacity, pen) => {
                let corners = [(left, y - 6.0), (right, y - 6.0), (right, y + 6.0), (left, y + 6.0)];
                canvas.polygon(&corners, colour, opacity);
                canvas.line(&[corners[0], corners[1], corners[2], corners[3], corners[0]], pen);
            }
            Key::Start => start_marker(canvas, middle, INK),
            Key::Arrival => arrival_marker(canvas, middle, INK),
        }
        canvas.text(text, (right + 8.0, y), SIZE, Anchor::Left, INK);
    }
}

/// Draws a ring.
pub(super) fn start_marker(canvas: &mut Canvas, at: Point, colour: [u8; 3]) {
    canvas.circle(at, 4.5, ([255; 3], 1.0), Pen::solid(colour, 1.8));
}

/// Draws a diamond with a white rim.
pub(super) fn arrival_marker(canvas: &mut Canvas, at: Point, colour: [u8; 3]) {
    let diamond = |r: f64| [(at.0, at.1 - r), (at.0 + r, at.1), (at.0, at.1 + r), (at.0 - r, at.1)];
    canvas.polygon(&diamond(8.0), [255; 3], 1.0);
    canvas.polygon(&diamond(6.0), colour, 1.0);
}
