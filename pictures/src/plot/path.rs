//! Paths in a plane, drawn with equal axes.

use punctual_core::elementary;

use super::axes::Axes;
use super::canvas::{Anchor, Canvas, INK, Pen, Point};
use super::decimate::decimate;
use super::legend::{self, Entry, Key};
use super::scale::{Axis, extent};
use super::{POINTS, PathPlot, Style, TUBE, Tube, colour, set_colour, tube_key};
use crate::outlines::Outline;

/// Size of the sheet in pixels.
pub(super) const WIDTH: f64 = 860.0;
/// See [`WIDTH`].
pub(super) const HEIGHT: f64 = 640.0;
/// Fraction of the range left free at each side.
const MARGIN: f64 = 0.06;

pub(super) fn draw(plot: &PathPlot, canvas: &mut Canvas) -> Result<(), String> {
    let legend = entries(plot);
    let legend_width = legend::width(&legend);
    let title = if plot.title.is_empty() { 0.0 } else { 30.0 };
    let space = if legend.is_empty() { 20.0 } else { legend_width + 34.0 };
    let area = [84.0, 18.0 + title, canvas.width() - space, canvas.height() - 62.0];
    let discs = |axis: usize| {
        plot.discs.iter().flat_map(move |d| [d.centre[axis] - d.radius, d.centre[axis] + d.radius])
    };
    let outlines = |axis: usize| plot.outlines.iter().flat_map(Outline::points).map(move |point| point[axis]);
    let tubes = |axis: usize| {
        let boxes = plot.tubes.iter().flat_map(|tube| tube.middles.iter().zip(&tube.halves));
        boxes.flat_map(move |(middle, half)| [middle[axis] - half[axis], middle[axis] + half[axis]])
    };
    let sets = |axis: usize| discs(axis).chain(outlines(axis)).chain(tubes(axis));
    let x = extent(plot.paths.iter().flat_map(|p| p.x.iter().copied()).chain(sets(0)));
    let y = extent(plot.paths.iter().flat_map(|p| p.y.iter().copied()).chain(sets(1)));
    let axes = equal_axes([x, y], area)?;
    axes.frame(canvas, &plot.x_label, &plot.y_label, true);
    if !plot.title.is_empty() {
        canvas.text(&plot.title, ((area[0] + area[2]) / 2.0, 24.0), 16.0, Anchor::Middle, INK);
    }
    axes.sets(canvas, &plot.discs, &plot.outlines);
    for tube in &plot.tubes {
        let rings = around(tube, |x, y| axes.place(x, y));
        canvas.clipped(area, |canvas| canvas.union(&rings, colour(tube.colour), TUBE));
    }
    // What has to be kept out of covers the corners of boxes that reach into it: the tube itself does not.
    if !plot.tubes.is_empty() {
        axes.obstacles(canvas, &plot.discs, &plot.outlines);
    }
    for (i, path) in plot.paths.iter().enumerate() {
        let pen = pen(i, path.style);
        let kept = decimate(&[&path.x, &path.y], POINTS);
        axes.curve(canvas, kept.into_iter().map(|k| (path.x[k], path.y[k])), pen, false);
    }
    for (i, path) in plot.paths.iter().enumerate() {
        let point = |k: usize| Some(axes.place(*path.x.get(k)?, *path.y.get(k)?));
        let shown = |&(x, y): &(f64, f64)| x.is_finite() && y.is_finite();
        if let Some(at) = point(0).filter(shown) {
            legend::start_marker(canvas, at, colour(i));
        }
        if let Some(at) = path.arrival.and_then(point).filter(shown) {
            legend::arrival_marker(canvas, at, colour(i));
        }
    }
    if plot.clock.len() > 1 {
        canvas.clipped(area, |canvas| {
            for (i, path) in plot.paths.iter().enumerate() {
                runner(canvas, &plot.clock, (&path.x, &path.y), |x, y| axes.place(x, y), colour(i));
            }
        });
    }
    legend::draw(canvas, &legend, (area[2] + 18.0, area[1]));
    Ok(())
}

/// The most places of an arrow that moves; between two of them it goes straight.
const PLACES: usize = 150;
/// The longest time in s that a run takes in a picture; a longer one is quicker there.
const LONGEST: f64 = 12.0;
/// The part of that for which it stays at the end.
const REST: f64 = 0.12;

/// An arrow that moves along a path as time goes on, and points where it goes.
fn runner(
    canvas: &mut Canvas,
    clock: &[f64],
    (x, y): (&[f64], &[f64]),
    place: impl Fn(f64, f64) -> Point,
    colour: [u8; 3],
) {
    let count = clock.len().min(x.len()).min(y.len());
    let every = count.div_ceil(PLACES).max(1);
    let kept = (0..count).filter(|k| k % every == 0 || k + 1 == count);
    let shown: Vec<(f64, Point)> = kept
        .map(|k| (clock[k], place(x[k], y[k])))
        .filter(|(_, (x, y))| x.is_finite() && y.is_finite())
        .collect();
    let ([(begin, _), .., (end, last)], true) = (&shown[..], shown.len() > 1) else { return };
    if end <= begin {
        return;
    }
    let run = 1.0 - REST;
    let mut parts: Vec<f64> = shown.iter().map(|(t, _)| run * (t - begin) / (end - begin)).collect();
    let mut places: Vec<Point> = shown.iter().map(|(_, at)| *at).collect();
    // At rest it points where it went. No turn is by more than half a circle.
    let mut turns: Vec<f64> = Vec::with_capacity(places.len() + 1);
    for k in 0..places.len() {
        let (from, to) = (places[k.saturating_sub(1)], places[(k + 1).min(places.len() - 1)]);
        let (dx, dy) = (to.0 - from.0, to.1 - from.1);
        let before = turns.last().copied();
        let turn = if elementary::hypot(dx, dy) > 0.5 {
            elementary::atan2(dy, dx).to_degrees()
        } else {
            before.unwrap_or(0.0)
        };
        let whole = before.map_or(0.0, |before| ((before - turn) / 360.0).round());
        turns.push(turn + 360.0 * whole);
    }
    parts.push(1.0);
    places.push(*last);
    turns.extend(turns.last().copied());
    let arrow = [(11.0, 0.0), (-8.0, -7.0), (-5.0, 0.0), (-8.0, 7.0)];
    let seconds = ((end - begin).min(LONGEST) / run * 10.0).round() / 10.0;
    canvas.moving(&arrow, colour, (&places, &turns), (&parts, seconds));
}

/// The most boxes of a tube that are drawn.
const BOXES: usize = 300;

/// The outlines of a tube, with its points at `place`: for each two boxes, one after the other, the least convex area that holds both.
pub(super) fn around(tube: &Tube, place: impl Fn(f64, f64) -> Point) -> Vec<Vec<Point>> {
    let boxes: Vec<_> = tube.middles.iter().zip(&tube.halves).collect();
    let every = boxes.len().div_ceil(BOXES).max(1);
    // A box that is left out lies between those around it, up to what a path bends over so few steps.
    let kept = (0..boxes.len()).filter(|k| k % every == 0 || k + 1 == boxes.len());
    let corners = |k: usize| {
        let (middle, half) = boxes[k];
        [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
            .map(|[x, y]| place(middle[0] + x * half[0], middle[1] + y * half[1]))
    };
    let kept: Vec<_> = kept
        .map(corners)
        .filter(|box_of| box_of.iter().all(|(x, y)| x.is_finite() && y.is_finite()))
        .collect();
    match &kept[..] {
        [one] => vec![hull(one.to_vec())],
        several => several.windows(2).map(|two| hull(two.concat())).collect(),
    }
}

/// The convex hull of `points`, always in the same direction: A. M. Andrew, Inf. Process. Lett. 9 (1979), doi
/// 10.1016/0020-0190(79)90072-3.
fn hull(mut points: Vec<Point>) -> Vec<Point> {
    points.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    points.dedup();
    let half = |points: &mut dyn Iterator<Item = Point>| {
        let mut side: Vec<Point> = Vec::new();
        for point in points {
            let turns = |side: &[Point]| {
                let [a, b] = [side[side.len() - 2], side[side.len() - 1]];
                (b.0 - a.0) * (point.1 - a.1) - (b.1 - a.1) * (point.0 - a.0)
            };
            while side.len() > 1 && turns(&side) <= 0.0 {
                side.pop();
            }
            side.push(point);
        }
        side.pop();
        side
    };
    let mut ring = half(&mut points.iter().copied());
    ring.extend(half(&mut points.iter().rev().copied()));
    ring
}

fn pen(i: usize, style: Style) -> Pen {
    let dash = (style == Style::Dashed).then_some((7.0, 5.0));
    Pen { colour: colour(i), width: 2.0, dash }
}

fn entries(plot: &PathPlot) -> Vec<Entry> {
    let mut entries: Vec<Entry> = Vec::new();
    for (i, path) in plot.paths.iter().enumerate().filter(|(_, path)| !path.label.is_empty()) {
        entries.push((Key::Line(pen(i, path.style)), path.label.clone()));
    }
    for tube in plot.tubes.iter().filter(|tube| !tube.label.is_empty()) {
        entries.push((tube_key(tube.colour), tube.label.clone()));
    }
    if !plot.paths.is_empty() {
        entries.push((Key::Start, "start".to_owned()));
    }
    if plot.paths.iter().any(|path| path.arrival.is_some()) {
        entries.push((Key::Arrival, "arrival".to_owned()));
    }
    let discs = plot.discs.iter().map(|disc| (&disc.label, disc.obstacle));
    let outlines = plot.outlines.iter().map(|outline| (&outline.label, outline.obstacle));
    for (label, obstacle) in discs.chain(outlines).filter(|(label, _)| !label.is_empty()) {
        if !entries.iter().any(|(_, text)| text == label) {
            let colour = set_colour(obstacle);
            entries.push((Key::Patch(colour, 0.18, Pen::solid(colour, 1.2)), label.clone()));
        }
    }
    entries
}

/// Axes that show these extents of x and y, with the same scale on both.
pub(super) fn equal_axes([x, y]: [Option<(f64, f64)>; 2], area: [f64; 4]) -> Result<Axes, String> {
    let (Some(x), Some(y)) = (x, y) else { return Err("there is no finite point".to_owned()) };
    let (width, height) = (area[2] - area[0], area[3] - area[1]);
    let share = 1.0 - 2.0 * MARGIN;
    let unit = ((x.1 - x.0) / (share * width)).max((y.1 - y.0) / (share * height));
    let unit = if unit > 0.0 && unit.is_finite() { unit } else { 1.0 / width };
    let around = |(low, high): (f64, f64), pixels: f64| {
        let middle = low / 2.0 + high / 2.0;
        (middle - unit * pixels / 2.0, middle + unit * pixels / 2.0)
    };
    let (x, y) = (around(x, width), around(y, height));
    let count = |pixels: f64| (pixels / 75.0) as usize;
    // Both axes have the same tick spacing, which the longer one determines.
    let step = Axis::linear(x.0, x.1, count(width), false);
    let spacing = if step.ticks.len() > 1 { step.ticks[1].0 - step.ticks[0].0 } else { x.1 - x.0 };
    let y_axis = Axis::linear(y.0, y.1, ((y.1 - y.0) / spacing * (1.0 + 1e-6)).ceil() as usize, false);
    Ok(Axes { area, x: step, y: y_axis })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_are_equal_and_hold_everything() {
        let axes = equal_axes([Some((0.0, 47.0)), Some((0.0, 7.0))], [0.0, 0.0, 600.0, 400.0]).unwrap();
        let (x, y) = (
            axes.place(1.0, 0.0).0 - axes.place(0.0, 0.0).0,
            axes.place(0.0, 0.0).1 - axes.place(0.0, 1.0).1,
        );
        assert!((x - y).abs() < 1e-9, "{x} {y}");
        assert!(axes.x.low < 0.0 && axes.x.high > 47.0);
    }

    #[test]
    fn a_tube_is_one_area_that_holds_every_box() {
        let axes = equal_axes([Some((0.0, 10.0)), Some((0.0, 10.0))], [0.0, 0.0, 500.0, 500.0]).unwrap();
        let middles: Vec<[f64; 2]> =
            (0..1000).map(|k| [0.01 * f64::from(k), 0.00001 * f64::from(k * k)]).collect();
        let halves = vec![[0.3, 0.2]; middles.len()];
        let tube = Tube { label: "tube".into(), middles, halves, colour: 0 };
        let rings = around(&tube, |x, y| axes.place(x, y));
        assert!(rings.len() <= BOXES + 1, "{}", rings.len());
        // Twice the signed area: all alike, so that they add up to one area.
        let size = |ring: &Vec<Point>| -> f64 {
            let next = ring.iter().cycle().skip(1);
            ring.iter().zip(next).map(|(a, b)| a.0 * b.1 - a.1 * b.0).sum()
        };
        assert!(rings.iter().all(|ring| size(ring) > 0.0));
        let inside = |ring: &Vec<Point>, at: Point| {
            let next = ring.iter().cycle().skip(1);
            ring.iter()
                .zip(next)
                .all(|(a, b)| (b.0 - a.0) * (at.1 - a.1) - (b.1 - a.1) * (at.0 - a.0) >= -1e-6)
        };
        for k in (0..1000).step_by(37) {
            let (middle, half) = (tube.middles[k], tube.halves[k]);
            // 1 % of the box: what the path bends between boxes that are drawn.
            let corner = axes.place(middle[0] + 0.99 * half[0], middle[1] - 0.99 * half[1]);
            assert!(rings.iter().any(|ring| inside(ring, corner)), "box {k}");
        }
        let plot = PathPlot { tubes: vec![tube], ..PathPlot::default() };
        let mut canvas = Canvas::new("test", WIDTH, HEIGHT);
        draw(&plot, &mut canvas).unwrap();
        let svg = canvas.document();
        assert_eq!(
            (svg.matches("fill-rule=\"nonzero\"").count(), svg.matches(">\ntube\n<").count()),
            (1, 1),
            "{svg}"
        );
    }

    #[test]
    fn an_arrow_moves_along_each_path() {
        let count = 1000;
        let along = |scale: f64| (0..count).map(|k| scale * f64::from(k)).collect::<Vec<f64>>();
        let path = |x: Vec<f64>, y: Vec<f64>| super::super::Path { x, y, ..Default::default() };
        let paths = vec![path(along(0.01), along(0.01)), path(along(-0.01), along(0.0))];
        let still = PathPlot { paths, ..PathPlot::default() };
        let drawn = |plot: &PathPlot| {
            let mut canvas = Canvas::new("test", WIDTH, HEIGHT);
            draw(plot, &mut canvas).unwrap();
            canvas.document()
        };
        assert!(!drawn(&still).contains("animateTransform"));
        let moving = drawn(&PathPlot { clock: along(0.1), ..still });
        assert_eq!(moving.matches("<animateTransform").count(), 4, "{moving}");
        // As many values as times; up to the right is −45 degrees where y grows downwards, and back is 180.
        for values in moving.split("values=\"").skip(1) {
            let count = |text: &str| text.split('"').next().unwrap().split(';').count();
            let times = values.split("keyTimes=\"").nth(1);
            assert!(times.is_none_or(|times| count(times) == count(values)), "{values}");
        }
        assert!(moving.contains("-45;-45;-45") && moving.contains("180;180;180"), "{moving}");
    }

    #[test]
    fn nothing_to_draw_is_an_error() {
        let mut canvas = Canvas::new("test", WIDTH, HEIGHT);
        assert!(draw(&PathPlot::default(), &mut canvas).unwrap_err().contains("no finite point"));
    }
}
