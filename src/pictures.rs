//! From the plots of a system file and a recording to pictures.

use std::path::Path;

use crate::coupling::{PathPicture, Picture, TimePicture, Variant};
use crate::error::Error;
use crate::plot::{self, Disc, Mark, PathPlot, Scale, Series, Style, TimePlot};
use crate::recording::Recording;

/// Percentiles between which [`Variant::Clipped`] shows values.
const BULK: (f64, f64) = (1.0, 99.0);

/// Draws `picture` from `recording` into the SVG file `file`.
///
/// # Errors
///
/// A signal that is not in the recording, nothing finite to draw, or a file that cannot be written.
pub fn draw(picture: &Picture, recording: &Recording, file: &Path) -> Result<(), Error> {
    match picture {
        Picture::Path(picture) => plot::path(&path(picture, recording)?, file),
        Picture::Time(picture) => plot::time(&time(picture, recording)?, file),
    }
}

fn path(picture: &PathPicture, recording: &Recording) -> Result<PathPlot, Error> {
    let first = (&picture.x, &picture.y, &picture.label, &picture.arrival);
    let more = picture.more.iter().map(|entry| (&entry.x, &entry.y, &entry.label, &entry.arrival));
    let paths = std::iter::once(first)
        .chain(more)
        .map(|(x, y, label, arrival)| {
            let arrival = match arrival {
                Some(signal) => series(recording, signal)?.iter().position(|&value| value != 0.0),
                None => None,
            };
            Ok(plot::Path {
                label: label.clone().unwrap_or_else(|| component(x).to_owned()),
                x: series(recording, x)?,
                y: series(recording, y)?,
                arrival,
                style: Style::Solid,
            })
        })
        .collect::<Result<_, Error>>()?;
    Ok(PathPlot {
        title: picture.title.clone().unwrap_or_default(),
        x_label: axis_label(recording, variable(&picture.x), &[&picture.x]),
        y_label: axis_label(recording, variable(&picture.y), &[&picture.y]),
        paths,
        discs: picture
            .discs
            .iter()
            .map(|disc| Disc {
                label: disc.label.clone().unwrap_or_default(),
                centre: disc.centre,
                radius: disc.radius,
                obstacle: false,
            })
            .collect(),
    })
}

fn time(picture: &TimePicture, recording: &Recording) -> Result<TimePlot, Error> {
    let solid = picture.signals.iter().map(|signal| (signal, Style::Solid));
    let dashed = picture.dashed.iter().map(|signal| (signal, Style::Dashed));
    let lines = solid
        .chain(dashed)
        .map(|(signal, style)| {
            let (time, values) = (recording.times().to_vec(), series(recording, signal)?);
            Ok(Series { label: signal.clone(), time, values, style, colour: None })
        })
        .collect::<Result<_, Error>>()?;
    let all: Vec<&String> = picture.signals.iter().chain(&picture.dashed).collect();
    let name = match all.as_slice() {
        [only] => variable(only),
        _ => "",
    };
    Ok(TimePlot {
        title: picture.title.clone().unwrap_or_default(),
        y_label: picture.ylabel.clone().unwrap_or_else(|| axis_label(recording, name, &all)),
        series: lines,
        instants: picture.deadline.iter().map(|&at| Mark { label: "deadline".to_owned(), at }).collect(),
        bounds: picture.bounds.iter().map(|&at| Mark { label: String::new(), at }).collect(),
        regions: Vec::new(),
        scale: match picture.scale {
            Variant::Linear => Scale::Linear,
            Variant::Clipped => Scale::Percentiles(BULK.0, BULK.1),
            Variant::Log => Scale::Logarithmic,
        },
    })
}

fn series(recording: &Recording, signal: &str) -> Result<Vec<f64>, Error> {
    recording
        .series(signal)
        .ok_or_else(|| Error::configuration("plot", format!("{signal} is not in the recording")))
}

/// `name (unit)`, where all signals share a unit.
fn axis_label(recording: &Recording, name: &str, signals: &[&String]) -> String {
    let unit = |signal: &&String| {
        recording.index_of(signal).and_then(|i| recording.columns()[i].unit.clone()).unwrap_or_default()
    };
    let first = signals.first().map(unit).unwrap_or_default();
    let shared = !first.is_empty() && signals.iter().all(|signal| unit(signal) == first);
    match (name.is_empty(), shared) {
        (false, true) => format!("{name} ({first})"),
        (false, false) => name.to_owned(),
        (true, true) => format!("value ({first})"),
        (true, false) => "value".to_owned(),
    }
}

fn component(signal: &str) -> &str {
    signal.split_once('.').map_or(signal, |(component, _)| component)
}

fn variable(signal: &str) -> &str {
    signal.split_once('.').map_or(signal, |(_, variable)| variable)
}
