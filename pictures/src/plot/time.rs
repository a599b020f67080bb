//! Signals over time, in one panel or in several with a common time axis.

use punctual_core::elementary;

use super::axes::Axes;
use super::canvas::{Anchor, Canvas, INK, MARK, Pen, Point, SAFE};
use super::decimate::decimate;
use super::legend::{self, Entry, Key};
use super::scale::{Axis, extent, percentiles};
use super::{Band, POINTS, Scale, Series, Style, TUBE, TimePlot, colour, tube_key};

/// Width of the sheet in pixels.
pub(super) const WIDTH: f64 = 900.0;
/// Height of a single panel with its surroundings, in pixels.
const SINGLE: f64 = 460.0;
/// Height of each panel if there are several, in pixels.
const PANEL: f64 = 290.0;
/// Space below the last panel, in pixels.
const BOTTOM: f64 = 58.0;
/// The most decades shown on a logarithmic axis.
const DECADES: f64 = 12.0;

/// Height of the sheet for these panels.
pub(super) fn height(plots: &[TimePlot]) -> f64 {
    match plots {
        [plot] => SINGLE.max(with_legend(plot)),
        _ => plots.len() as f64 * panel(plots) + BOTTOM,
    }
}

/// Height of each of these panels. A single one does not grow with its legend.
fn panel(plots: &[TimePlot]) -> f64 {
    match plots {
        [_] => SINGLE - BOTTOM,
        _ => plots.iter().map(with_legend).fold(PANEL, f64::max),
    }
}

/// Height of a panel's legend, with what is above it.
fn with_legend(plot: &TimePlot) -> f64 {
    above(plot) + legend::height(&entries(plot)) + 8.0
}

/// Space for the title and the notes above a panel.
fn above(plot: &TimePlot) -> f64 {
    let title = if plot.title.is_empty() { 14.0 } else { 40.0 };
    let is_noted = plot.instants.iter().any(|mark| !mark.label.is_empty())
        || matches!(plot.scale, Scale::Percentiles(..) | Scale::Fixed(..));
    title + if is_noted { 16.0 } else { 0.0 }
}

pub(super) fn draw(plots: &[TimePlot], canvas: &mut Canvas) -> Result<(), String> {
    let times = plots.iter().flat_map(|p| &p.series).flat_map(|s| s.time.iter().copied());
    let (start, stop) = extent(times).ok_or("there is no series with a finite time")?;
    let legends: Vec<Vec<Entry>> = plots.iter().map(entries).collect();
    let widest = legends.iter().map(|l| legend::width(l)).fold(0.0, f64::max);
    let right = canvas.width() - if widest > 0.0 { widest + 34.0 } else { 24.0 };
    let panel = panel(plots);
    for (i, (plot, legend)) in plots.iter().zip(&legends).enumerate() {
        let last = i + 1 == plots.len();
        let top = i as f64 * panel + above(plot);
        let bottom = (i + 1) as f64 * panel - if last { 0.0 } else { 22.0 };
        let area = [92.0, top, right, bottom];
        let (y, note) = y_axis(plot, bottom - top)?;
        let x = Axis::linear(start, stop, ((right - area[0]) / 80.0) as usize, false);
        let axes = Axes { area, x, y };
        draw_panel(plot, &axes, canvas, last);
        if !plot.title.is_empty() {
            let at = ((area[0] + area[2]) / 2.0, i as f64 * panel + 20.0);
            canvas.text(&plot.title, at, 16.0, Anchor::Middle, INK);
        }
        legend::draw(canvas, legend, (right + 18.0, top));
        if let Some(note) = note {
            canvas.text(&note, (area[0], top - 8.0), 11.0, Anchor::Left, MARK);
        }
    }
    Ok(())
}

fn draw_panel(plot: &TimePlot, axes: &Axes, canvas: &mut Canvas, last: bool) {
    let [left, top, right, bottom] = axes.area;
    for region in &plot.regions {
        let clamp = |value: f64, axis: &Axis| value.clamp(axis.low, axis.high);
        let from = axes.place(clamp(region.time[0], &axes.x), clamp(region.values[0], &axes.y));
        let to = axes.place(clamp(region.time[1], &axes.x), clamp(region.values[1], &axes.y));
        canvas.polygon(&[from, (to.0, from.1), to, (from.0, to.1)], SAFE, 0.10);
    }
    axes.frame(canvas, if last { "time (s)" } else { "" }, &plot.y_label, last);
    let dashed = Pen { colour: MARK, width: 1.4, dash: Some((3.0, 3.0)) };
    for mark in &plot.instants {
        let (x, _) = axes.place(mark.at, axes.y.low);
        if (left..=right).contains(&x) {
            canvas.line(&[(x, top), (x, bottom)], dashed);
            canvas.text(&mark.label, (x, top - 8.0), 12.0, Anchor::Middle, MARK);
        }
    }
    for band in &plot.bands {
        let ring = ring(band, axes);
        canvas.clipped(axes.area, |canvas| canvas.polygon(&ring, colour(band.colour), TUBE));
    }
    for (i, series) in plot.series.iter().enumerate() {
        let length = series.time.len().min(series.values.len());
        let kept = decimate(&[&series.values[..length]], POINTS);
        let points = kept.into_iter().map(|k| (series.time[k], series.values[k]));
        axes.curve(canvas, points, pen(i, series), series.style == Style::Steps);
    }
    let mut labelled: Vec<f64> = Vec::new();
    for mark in &plot.bounds {
        let (_, y) = axes.place(axes.x.low, mark.at);
        if !(top..=bottom).contains(&y) {
            continue;
        }
        canvas.line(&[(left, y), (right, y)], dashed);
        // Only one label is drawn if several would overlap, such as those of both bounds on a logarithmic
        // axis.
        if labelled.iter().all(|other| (other - y).abs() > 14.0) {
            let above = if y - top > 18.0 { y - 9.0 } else { y + 10.0 };
            canvas.text(&mark.label, (right - 6.0, above), 12.0, Anchor::Right, MARK);
            labelled.push(y);
        }
    }
}

/// The outline of a band on the sheet: along its lower end, and back along the upper one.
fn ring(band: &Band, axes: &Axes) -> Vec<Point> {
    let length = band.time.len().min(band.low.len()).min(band.high.len());
    let side = |values: &[f64]| {
        let mut points: Vec<Point> = Vec::new();
        for (time, value) in band.time.iter().zip(values).take(length) {
            let point = axes.place(*time, *value);
            if let (true, Some(last)) = (band.steps, points.last()) {
                points.push((point.0, last.1));
            }
            points.push(point);
        }
        points
    };
    let (mut ring, back) = (side(&band.low), side(&band.high));
    ring.extend(back.into_iter().rev());
    ring
}

fn pen(i: usize, series: &Series) -> Pen {
    let dash = (series.style == Style::Dashed).then_some((7.0, 4.0));
    Pen { colour: colour(series.colour.unwrap_or(i)), width: if dash.is_some() { 1.6 } else { 1.9 }, dash }
}

fn entries(plot: &TimePlot) -> Vec<Entry> {
    let series = plot.series.iter().enumerate().filter(|(_, series)| !series.label.is_empty());
    let mut entries: Vec<Entry> =
        series.map(|(i, series)| (Key::Line(pen(i, series)), series.label.clone())).collect();
    for band in plot.bands.iter().filter(|band| !band.label.is_empty()) {
        entries.push((tube_key(band.colour), band.label.clone()));
    }
    for region in plot.regions.iter().filter(|region| !region.label.is_empty()) {
        entries.push((Key::Patch(SAFE, 0.10, Pen::solid(SAFE, 0.5)), region.label.clone()));
    }
    entries
}

/// The y axis, and a note if values lie beyond it.
fn y_axis(plot: &TimePlot, height: f64) -> Result<(Axis, Option<String>), String> {
    let bands = || plot.bands.iter().flat_map(|band| band.low.iter().chain(&band.high).copied());
    let values = || plot.series.iter().flat_map(|s| s.values.iter().copied()).chain(bands());
    let bounds = || plot.bounds.iter().map(|mark| mark.at);
    let (low, high) = extent(values()).ok_or("there is no finite value")?;
    let count = ((height / 45.0) as usize).max(2);
    // An axis for a range and the bounds. It ends at ticks, with a margin between the bounds and the frame.
    let linear = |(low, high): (f64, f64)| {
        let (from, to) = extent([low, high].into_iter().chain(bounds())).unwrap_or((low, high));
        let axis = Axis::linear(from, to, count, true);
        if bounds().all(|bound| bound != axis.low && bound != axis.high) {
            return axis;
        }
        let room = 0.04 * (to - from);
        Axis::linear(from - room, to + room, count, false)
    };
    let whole = || linear((low, high));
    let cut = |axis: Axis| {
        let beyond = low < axis.low || high > axis.high;
        let note = beyond.then(|| format!("axis cut: values reach from {} to {}", brief(low), brief(high)));
        (axis, note)
    };
    Ok(match plot.scale {
        Scale::Linear => (whole(), None),
        Scale::Percentiles(from, to) => {
            let bulk = percentiles(values(), from, to).unwrap_or((low, high));
            // Clipping less than a third of the range gains nothing.
            if bulk.1 - bulk.0 > (high - low) / 1.5 || bulk.0 >= bulk.1 {
                return Ok((whole(), None));
            }
            cut(linear(bulk))
        }
        Scale::Fixed(from, to) => cut(Axis::linear(from, to, count, false)),
        Scale::Logarithmic => {
            let sizes = || values().map(f64::abs).filter(|size| *size > 0.0);
            let high = extent(sizes().chain(bounds().map(f64::abs))).map_or(1.0, |range| range.1);
            // A signal that crosses zero must not stretch the axis without limit.
            let low = percentiles(sizes(), 1.0, 100.0).map_or(0.1, |range| range.0);
            (Axis::logarithmic(low.max(high * elementary::powf(10.0, -DECADES)), high), None)
        }
    })
}

/// A number with three digits and a true minus sign.
fn brief(value: f64) -> String {
    let size = value.abs();
    let text = if size == 0.0 || (0.01..1e5).contains(&size) {
        let digits = if size >= 100.0 || size == 0.0 { 0 } else { 2 };
        format!("{value:.digits$}")
    } else {
        format!("{value:.2e}")
    };
    text.replace('-', "−")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plot::Mark;

    fn plot(values: Vec<f64>, scale: Scale) -> TimePlot {
        let time = (0..values.len()).map(|i| i as f64).collect();
        TimePlot { series: vec![Series { time, values, ..Series::default() }], scale, ..TimePlot::default() }
    }

    #[test]
    fn rare_extremes_are_cut_off_and_told() {
        let mut values = vec![1.0; 1000];
        values[1] = 0.0;
        values[500] = 31_950.0;
        (2..100).for_each(|i| values[i] = i as f64 / 100.0);
        let (axis, note) = y_axis(&plot(values.clone(), Scale::Percentiles(1.0, 99.0)), 300.0).unwrap();
        assert!(axis.high < 3.0, "{}", axis.high);
        assert!(note.unwrap().contains("to 31950"));
        let (axis, note) = y_axis(&plot(values, Scale::Linear), 300.0).unwrap();
        assert!(axis.high > 31_000.0 && note.is_none());
    }

    /// However many signals there are, the picture has a legend entry for each, and no panel's legend reaches
    /// into the next panel.
    #[test]
    fn the_sheet_has_room_for_every_name() {
        let named = |count: usize| {
            let series = Series { label: "h".into(), ..plot(vec![0.0, 1.0], Scale::Linear).series.remove(0) };
            TimePlot { series: vec![series; count], ..TimePlot::default() }
        };
        for count in [1, 11, 22, 130] {
            let one = [named(count)];
            assert!(height(&one) >= above(&one[0]) + legend::height(&entries(&one[0])), "{count}");
            let two = [named(count), named(3)];
            assert!(panel(&two) >= above(&two[0]) + legend::height(&entries(&two[0])), "{count}");
            assert_eq!(height(&two), 2.0 * panel(&two) + BOTTOM);
        }
        assert_eq!((height(&[named(4)]), panel(&[named(130)])), (SINGLE, SINGLE - BOTTOM));
    }

    #[test]
    fn a_band_is_in_the_picture_and_has_its_legend() {
        let mut plot = plot(vec![0.0, 1.0], Scale::Linear);
        plot.bands = vec![Band {
            label: "tube".into(),
            time: vec![0.0, 1.0],
            low: vec![-3.0, 0.0],
            high: vec![1.0, 7.0],
            steps: true,
            colour: 0,
        }];
        let (axis, _) = y_axis(&plot, 300.0).unwrap();
        assert!(axis.low <= -3.0 && axis.high >= 7.0, "{} {}", axis.low, axis.high);
        let axes = Axes { area: [0.0, 0.0, 100.0, 100.0], x: Axis::linear(0.0, 1.0, 3, false), y: axis };
        // Held: down at the second time, and so on the way back.
        let ring = ring(&plot.bands[0], &axes);
        assert_eq!(ring.len(), 6, "{ring:?}");
        assert_eq!((ring[0].1, ring[1].0), (ring[1].1, ring[2].0));
        assert_eq!(entries(&plot).len(), 1);
    }

    #[test]
    fn bounds_are_always_in_the_picture() {
        let mut plot = plot(vec![0.0, 1.0], Scale::Linear);
        plot.bounds = vec![Mark { label: "max".into(), at: 60.0 }];
        assert!(y_axis(&plot, 300.0).unwrap().0.high > 60.0);
    }

    #[test]
    fn zeros_on_a_logarithmic_axis_are_left_out() {
        let (axis, _) = y_axis(&plot(vec![0.0, -5.0, 300.0], Scale::Logarithmic), 300.0).unwrap();
        assert_eq!((axis.low, axis.high), (1.0, 1000.0));
        assert!(y_axis(&plot(vec![f64::NAN], Scale::Linear), 300.0).is_err());
    }
}
