//! The pictures of the demonstration: for every model the paths, h with its profile, and the inputs.

use std::path::Path;

use super::Run;
use crate::error::Error;
use crate::plot::{self, Disc, Mark, PathPlot, Region, Scale, Series, Style, TimePlot};
use crate::recording::Recording;
use crate::reproduce::cases::{self, CENTRE, DEADLINE, RADIUS, Vehicle};

/// Draws all pictures of `vehicle` into `folder`.
pub(super) fn draw(vehicle: Vehicle, paper: &Run, ours: &Run, folder: &Path) -> Result<(), Error> {
    plot::path(&paths(vehicle, paper, ours)?, &folder.join(format!("{}-paths.svg", vehicle.key())))?;
    plot::times(&barriers(paper, ours)?, &folder.join(format!("{}-h.svg", vehicle.key())))?;
    for run in [paper, ours] {
        plot::times(&inputs(run)?, &folder.join(format!("{}-inputs.svg", run.case.stem())))?;
    }
    Ok(())
}

/// Number of samples shown: up to the arrival for a run of the paper's method, whose rest would hide everything
/// else, and the whole of another run.
fn shown(run: &Run) -> usize {
    let len = run.recording.len();
    let end = arrival(run).filter(|_| run.case.is_the_papers());
    end.map_or(len, |k| (k + 1).min(len))
}

fn arrival(run: &Run) -> Option<usize> {
    let at = run.summary.arrival?;
    run.recording.times().iter().position(|&t| t >= at)
}

fn series(recording: &Recording, name: &str) -> Result<Vec<f64>, Error> {
    recording.series(name).ok_or_else(|| Error::configuration(name, "is not in the recording"))
}

fn deadline() -> Vec<Mark> {
    vec![Mark { label: format!("deadline {DEADLINE} s"), at: DEADLINE }]
}

fn paths(vehicle: Vehicle, paper: &Run, ours: &Run) -> Result<PathPlot, Error> {
    let mut lines = Vec::new();
    for (run, style, suffix) in [(ours, Style::Solid, ""), (paper, Style::Dashed, ", to its arrival")] {
        let mut x = series(&run.recording, "plant.x.x_p")?;
        let mut y = series(&run.recording, "plant.x.y_p")?;
        x.truncate(shown(run));
        y.truncate(shown(run));
        let label = format!("{}{suffix}", run.case.title);
        lines.push(plot::Path { label, x, y, arrival: arrival(run), style });
    }
    Ok(PathPlot {
        title: format!("{}: from rest at the origin into the disc", vehicle.title()),
        x_label: "x_p (m)".into(),
        y_label: "y_p (m)".into(),
        paths: lines,
        discs: vec![Disc { label: "safe set".into(), centre: CENTRE, radius: RADIUS, obstacle: false }],
    })
}

/// h of each method with the bound it promises, then both as distances near the deadline.
fn barriers(paper: &Run, ours: &Run) -> Result<Vec<TimePlot>, Error> {
    let mut plots = Vec::new();
    // h with its bound, a panel for each method.
    for run in [ours, paper] {
        let time = run.recording.times()[..shown(run)].to_vec();
        let line = |label: &str, name: &str, style, colour| {
            let mut values = series(&run.recording, name)?;
            values.truncate(time.len());
            Ok::<_, Error>(Series {
                label: label.into(),
                time: time.clone(),
                values,
                style,
                colour: Some(colour),
            })
        };
        plots.push(TimePlot {
            title: format!("{}: {}", run.case.vehicle.title(), run.case.title),
            y_label: format!("h ({})", run.case.setup.shape.unit()),
            series: vec![
                line("h", "filter.goal.h", Style::Solid, 0)?,
                line("promised lower bound", "filter.goal.profile", Style::Dashed, 1)?,
            ],
            instants: deadline(),
            bounds: vec![Mark { label: String::new(), at: 0.0 }],
            ..TimePlot::default()
        });
    }
    // Both as distances.
    let mut lines = Vec::new();
    for (run, colour) in [(ours, 0), (paper, 1)] {
        let (x, y) = (series(&run.recording, "plant.x.x_p")?, series(&run.recording, "plant.x.y_p")?);
        let values = x.iter().zip(&y).map(|(x, y)| RADIUS - (x - CENTRE[0]).hypot(y - CENTRE[1])).collect();
        let time = run.recording.times().to_vec();
        lines.push(Series {
            label: run.case.title.into(),
            time,
            values,
            style: Style::Solid,
            colour: Some(colour),
        });
    }
    plots.push(TimePlot {
        title: "both as distances: how deep inside the disc".into(),
        y_label: "R − d (m)".into(),
        series: lines,
        instants: deadline(),
        bounds: vec![Mark { label: String::new(), at: 0.0 }],
        regions: vec![Region {
            label: "safe, on time".into(),
            time: [DEADLINE, f64::INFINITY],
            values: [0.0, f64::INFINITY],
        }],
        scale: Scale::Fixed(-4.0 * RADIUS, 1.2 * RADIUS),
    });
    Ok(plots)
}

/// The two inputs of a run, one panel each: their units differ.
fn inputs(run: &Run) -> Result<Vec<TimePlot>, Error> {
    let end = shown(run);
    let time = run.recording.times()[..end].to_vec();
    // The paper's inputs go from rest to tens of thousands: only a logarithm shows more than the last sample.
    let logarithmic = run.case.is_the_papers();
    let mut plots = Vec::new();
    for (i, signal) in run.case.vehicle.inputs().iter().enumerate() {
        let (name, unit) = (signal.name, cases::unit(signal));
        let mut lines = Vec::new();
        for (label, variable, style, colour) in
            [("safe input u", "u", Style::Steps, 0), ("nominal input", "u_ref", Style::Dashed, 1)]
        {
            // An unconnected reference is not recorded: it stays 0.
            let Some(mut values) = run.recording.series(&format!("filter.{variable}.{name}")) else {
                continue;
            };
            values.truncate(end);
            lines.push(Series {
                label: label.into(),
                time: time.clone(),
                values,
                style,
                colour: Some(colour),
            });
        }
        let to = if end < run.recording.len() { ", to its arrival" } else { "" };
        let title = format!("{}: inputs, {}{to}", run.case.vehicle.title(), run.case.title);
        plots.push(TimePlot {
            title: if i == 0 { title } else { String::new() },
            y_label: if logarithmic { format!("|{name}| ({unit})") } else { format!("{name} ({unit})") },
            series: lines,
            instants: deadline(),
            scale: if logarithmic { Scale::Logarithmic } else { Scale::Linear },
            ..TimePlot::default()
        });
    }
    Ok(plots)
}
