//! Cells of a plane, coloured by what was found there.

use super::axes::Axes;
use super::canvas::{Anchor, Canvas, INK, Pen, SAFE};
use super::legend::{self, Entry, Key};
use super::path::equal_axes;
use super::scale::Axis;
use super::{MapPlot, colour};

/// Size of the sheet in pixels.
pub(super) const WIDTH: f64 = 860.0;
/// See [`WIDTH`].
pub(super) const HEIGHT: f64 = 600.0;
/// Opacity of a cell over what lies beneath it.
const OPACITY: f64 = 0.5;
/// Palette positions of all kinds except the first, which has the colour of safe sets, the third.
const OTHERS: [usize; 5] = [1, 4, 3, 5, 6];

pub(super) fn draw(plot: &MapPlot, canvas: &mut Canvas) -> Result<(), String> {
    let rows = plot.cells.len() / plot.columns.max(1);
    if rows == 0 {
        return Err("there is no cell".to_owned());
    }
    let legend: Vec<Entry> = plot
        .kinds
        .iter()
        .enumerate()
        .filter(|(kind, _)| plot.cells.contains(kind))
        .map(|(kind, label)| (Key::Patch(shade(kind), OPACITY, Pen::solid(shade(kind), 1.0)), label.clone()))
        .collect();
    let area = [84.0, 48.0, canvas.width() - legend::width(&legend) - 34.0, canvas.height() - 62.0];
    let [x, y] = [plot.x, plot.y];
    let axes = match plot.equal {
        true => equal_axes([Some((x[0], x[1])), Some((y[0], y[1]))], area)?,
        false => Axes { area, x: Axis::linear(x[0], x[1], 8, false), y: Axis::linear(y[0], y[1], 8, false) },
    };
    axes.frame(canvas, &plot.x_label, &plot.y_label, true);
    canvas.text(&plot.title, ((area[0] + area[2]) / 2.0, 24.0), 16.0, Anchor::Middle, INK);
    let (width, height) = ((x[1] - x[0]) / plot.columns as f64, (y[1] - y[0]) / rows as f64);
    canvas.clipped(area, |canvas| {
        for (row, cells) in plot.cells.chunks(plot.columns).enumerate() {
            let mut column = 0;
            // Adjacent cells of one kind form one rectangle.
            for run in cells.chunk_by(|a, b| a == b) {
                let corner = |i: usize, j: usize| {
                    axes.place(x[0] + width * (column + i) as f64, y[0] + height * (row + j) as f64)
                };
                let end = run.len();
                canvas.polygon(
                    &[corner(0, 0), corner(end, 0), corner(end, 1), corner(0, 1)],
                    shade(run[0]),
                    OPACITY,
                );
                column += end;
            }
        }
    });
    axes.sets(canvas, &plot.discs, &[]);
    legend::draw(canvas, &legend, (area[2] + 18.0, area[1]));
    Ok(())
}

fn shade(kind: usize) -> [u8; 3] {
    match kind.checked_sub(1) {
        None => SAFE,
        Some(other) => colour(OTHERS[other % OTHERS.len()]),
    }
}
