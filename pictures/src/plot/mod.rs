//! Draws series as SVG files: paths in a plane and signals over time. It needs no system font and knows no
//! FMU. Everything here takes plain numbers; labels state the units.

mod axes;
mod canvas;
mod chart;
mod decimate;
mod legend;
mod map;
mod path;
mod scale;
mod time;

use std::path::Path as File;

use punctual_cosim::error::Error;
use serde::Serialize;

use crate::outlines::Outline;
use canvas::Canvas;
pub use chart::{Chart, Curve, Scaling, seven_digits};
pub use decimate::decimate;
pub use scale::extent;

/// Colours that colour-blind readers can distinguish (Okabe and Ito 2008, without the yellow that vanishes on
/// white), in the order of the series.
pub const PALETTE: [[u8; 3]; 7] = [
    [0, 114, 178],   // blue
    [213, 94, 0],    // vermillion
    [0, 158, 115],   // green
    [204, 121, 167], // purple
    [230, 159, 0],   // orange
    [86, 180, 233],  // sky
    [60, 60, 60],    // grey
];

/// Name of a picture in a file of its own.
const ALONE: &str = "plot";

/// About how many points of a series are drawn; longer ones are thinned without losing extremes.
pub const POINTS: usize = 2000;

/// Paths in a plane, with equal axes.
#[derive(Clone, Debug, Default)]
pub struct PathPlot {
    /// Title; empty for none.
    pub title: String,
    /// Label of the x axis, with its unit.
    pub x_label: String,
    /// Label of the y axis, with its unit.
    pub y_label: String,
    /// The paths, each in the palette's next colour.
    pub paths: Vec<Path>,
    /// Discs beneath the paths.
    pub discs: Vec<Disc>,
    /// Other sets beneath the paths.
    pub outlines: Vec<Outline>,
    /// Tubes beneath the paths, above the sets.
    pub tubes: Vec<Tube>,
    /// The time of each point of the paths in s, ascending: an arrow then moves along each of them, over and over. Empty for a
    /// picture that stands still.
    pub clock: Vec<f64>,
}

/// What lies around a path: the boxes around its points, and everything between two of them.
#[derive(Clone, Debug, Default)]
pub struct Tube {
    /// Legend entry; empty for none.
    pub label: String,
    /// The middle of each box, in the units of the axes; one that is not finite breaks the tube.
    pub middles: Vec<[f64; 2]>,
    /// Half the width of each box along both axes, ≥ 0, as many as `middles`.
    pub halves: Vec<[f64; 2]>,
    /// Index into [`PALETTE`]: that of the path around which it lies.
    pub colour: usize,
}

impl Tube {
    /// Its outlines in the units of the axes, all in the same direction, which together bound it.
    pub fn rings(&self) -> Vec<Vec<[f64; 2]>> {
        let rings = path::around(self, |x, y| (x, y)).into_iter();
        rings.map(|ring| ring.into_iter().map(|(x, y)| [x, y]).collect()).collect()
    }
}

/// A path: a start marker, a line, and a marker where it arrives.
#[derive(Clone, Debug, Default)]
pub struct Path {
    /// Legend entry; empty for none.
    pub label: String,
    /// Points along x, in the unit of the axis; a value that is not finite breaks the line.
    pub x: Vec<f64>,
    /// Points along y, as many as in `x`.
    pub y: Vec<f64>,
    /// The point that gets the arrival marker.
    pub arrival: Option<usize>,
    /// Style of the line.
    pub style: Style,
}

/// A disc.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Disc {
    /// Legend entry; empty for none.
    pub label: String,
    /// Its centre, in the units of the axes, finite.
    pub centre: [f64; 2],
    /// Its radius, in the units of the axes, finite, > 0.
    pub radius: f64,
    /// Whether its outside is the safe set.
    pub obstacle: bool,
}

/// The colour of a set that must be avoided, or in which to stay.
fn set_colour(obstacle: bool) -> [u8; 3] {
    if obstacle { colour(1) } else { canvas::SAFE }
}

/// Cells of a plane, coloured by what was found there.
#[derive(Clone, Debug, Default)]
pub struct MapPlot {
    /// Title; empty for none.
    pub title: String,
    /// Label of the x axis, with its unit.
    pub x_label: String,
    /// Label of the y axis, with its unit.
    pub y_label: String,
    /// The ends along x, in the unit of the axis, finite.
    pub x: [f64; 2],
    /// The ends along y.
    pub y: [f64; 2],
    /// Number of cells along x.
    pub columns: usize,
    /// The kind of each cell, row by row from the bottom: an index into `kinds`.
    pub cells: Vec<usize>,
    /// The meanings of the kinds. The first has the colour of safe sets.
    pub kinds: Vec<String>,
    /// Whether a unit has the same length on both axes; discs need it.
    pub equal: bool,
    /// Discs over the cells.
    pub discs: Vec<Disc>,
}

/// Signals over time.
#[derive(Clone, Debug, Default)]
pub struct TimePlot {
    /// Title; empty for none.
    pub title: String,
    /// Label of the y axis, with its unit. Time is in seconds.
    pub y_label: String,
    /// The signals.
    pub series: Vec<Series>,
    /// Bands beneath the signals.
    pub bands: Vec<Band>,
    /// Vertical lines, such as a deadline.
    pub instants: Vec<Mark>,
    /// Horizontal lines, such as input bounds.
    pub bounds: Vec<Mark>,
    /// Shaded regions.
    pub regions: Vec<Region>,
    /// The y axis.
    pub scale: Scale,
}

/// A signal.
#[derive(Clone, Debug, Default)]
pub struct Series {
    /// Legend entry; empty for none.
    pub label: String,
    /// Times in seconds, increasing.
    pub time: Vec<f64>,
    /// Values in the unit of the axis, as many as times; a value that is not finite breaks the line.
    pub values: Vec<f64>,
    /// Style of the line.
    pub style: Style,
    /// Index into [`PALETTE`]; by default the index of the series. Give a reference and the signal that
    /// follows it the same colour.
    pub colour: Option<usize>,
}

/// The values between two signals.
#[derive(Clone, Debug, Default)]
pub struct Band {
    /// Legend entry; empty for none.
    pub label: String,
    /// Times in seconds, increasing.
    pub time: Vec<f64>,
    /// The lower end at each time, in the unit of the axis, finite.
    pub low: Vec<f64>,
    /// The upper end at each time, as many as in `low`.
    pub high: Vec<f64>,
    /// Whether each value is held until the next time.
    pub steps: bool,
    /// Index into [`PALETTE`]: that of the signal around which it lies.
    pub colour: usize,
}

impl Band {
    /// Its outline in the units of the axes.
    pub fn ring(&self) -> Vec<[f64; 2]> {
        let side = |values: &[f64]| -> Vec<[f64; 2]> {
            let mut points = Vec::new();
            for (k, (time, value)) in self.time.iter().zip(values).enumerate() {
                points.push([*time, *value]);
                if let Some(next) = self.time.get(k + 1).filter(|_| self.steps) {
                    points.push([*next, *value]);
                }
            }
            points
        };
        let (mut ring, high) = (side(&self.low), side(&self.high));
        ring.extend(high.into_iter().rev());
        ring
    }
}

/// Styles of a line. Styles without a line are only for charts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Style {
    /// Without gaps.
    #[default]
    Solid,
    /// In dashes: references, profiles.
    Dashed,
    /// Each value held until the next point: sampled inputs. In a path, the same as solid.
    Steps,
    /// No line: a dot at each point.
    Points,
    /// No line: a cross at each point.
    Crosses,
}

/// A straight line across the picture.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Mark {
    /// The text beside it; empty for none.
    pub label: String,
    /// Position: seconds for an instant, the unit of the axis for a bound. Finite.
    pub at: f64,
}

/// A shaded rectangle, which may be unbounded.
#[derive(Clone, Debug)]
pub struct Region {
    /// Legend entry; empty for none.
    pub label: String,
    /// Start and end in seconds; infinite for the whole picture.
    pub time: [f64; 2],
    /// Lower and upper end in the unit of the y axis; infinite for the whole picture.
    pub values: [f64; 2],
}

/// The y axis of a [`TimePlot`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Scale {
    /// Linear, over all values.
    #[default]
    Linear,
    /// Linear, between these two percentiles (0 to 100) of all values; the picture says so and gives the
    /// extremes.
    Percentiles(f64, f64),
    /// Linear, between these two values; the picture says so if values lie beyond.
    Fixed(f64, f64),
    /// The logarithm of absolute values; zeros break the line.
    Logarithmic,
}

/// Draws a [`PathPlot`] into the SVG file `file`.
///
/// # Errors
///
/// Nothing finite to draw, or the file cannot be written.
pub fn path(plot: &PathPlot, file: &File) -> Result<(), Error> {
    let mut canvas = Canvas::new(ALONE, path::WIDTH, path::HEIGHT);
    path::draw(plot, &mut canvas).map_err(|message| Error::plot(file, message))?;
    canvas.save(file)
}

/// Draws a [`MapPlot`] into the SVG file `file`.
///
/// # Errors
///
/// No cell, or the file cannot be written.
pub fn map(plot: &MapPlot, file: &File) -> Result<(), Error> {
    let mut canvas = Canvas::new(ALONE, map::WIDTH, map::HEIGHT);
    map::draw(plot, &mut canvas).map_err(|message| Error::plot(file, message))?;
    canvas.save(file)
}

/// Draws a [`TimePlot`] into the SVG file `file`.
///
/// # Errors
///
/// Nothing finite to draw, or the file cannot be written.
pub fn time(plot: &TimePlot, file: &File) -> Result<(), Error> {
    times(std::slice::from_ref(plot), file)
}

/// Draws several [`TimePlot`]s with a common time axis, one below the other, into the SVG file `file`.
///
/// # Errors
///
/// As for [`time`].
pub fn times(plots: &[TimePlot], file: &File) -> Result<(), Error> {
    let mut canvas = Canvas::new(ALONE, time::WIDTH, time::height(plots));
    time::draw(plots, &mut canvas).map_err(|message| Error::plot(file, message))?;
    canvas.save(file)
}

/// Draws a [`Chart`] as an SVG document. `name` (letters, digits, `-` and `_`) is the prefix of its ids, so
/// that a page can contain several charts. Messages use it too.
///
/// # Errors
///
/// Nothing finite to draw.
pub fn chart(chart: &Chart, name: &str) -> Result<String, Error> {
    let mut canvas = Canvas::new(name, chart::WIDTH, chart.height());
    chart::draw(chart, &mut canvas).map_err(|message| Error::plot(File::new(name), message))?;
    Ok(canvas.document())
}

/// Opacity of a tube and of a band.
const TUBE: f64 = 0.22;

/// The legend entry of a tube or band in the colour with this index.
fn tube_key(index: usize) -> legend::Key {
    legend::Key::Patch(colour(index), TUBE, canvas::Pen::solid(colour(index), 0.0))
}

fn colour(index: usize) -> [u8; 3] {
    PALETTE[index % PALETTE.len()]
}
