//! The pictures of the demonstration: for every model the paths, h with its profile, and the inputs.

use std::path::Path;

use punctual_core::elementary;
use punctual_cosim::error::Error;
use punctual_cosim::recording::Recording;
use punctual_pictures::plot::{self, Disc, Mark, PathPlot, Region, Scale, Series, Style, TimePlot};

use super::Run;
use crate::cases::{self, CENTRE, DEADLINE, RADIUS, Vehicle};

/// Draws all pictures of `vehicle` into `folder`.
pub(super) fn draw(vehicle: Vehicle, paper: &Run, ours: &Run, folder: &Path) -> Result<(), Error> {
    plot::path(&paths(vehicle, paper, ours)?, &folder.join(format!("{}-paths.svg", vehicle.key())))?;
    plot::times(&barriers(paper, ours)?, &folder.join(format!("{}-h.svg", vehicle.key())))?;
    for run in [paper, ours] {
        plot::times(&inputs(run)?, &folder.join(format!("{}-inputs.svg", run.case.stem())))?;
    }
    Ok(())
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
    for (run, style) in [(ours, Style::Solid), (paper, Style::Dashed)] {
        let x = series(&run.recording, "plant.x.x_p")?;
        let y = series(&run.recording, "plant.x.y_p")?;
        lines.push(plot::Path { label: run.case.title.into(), x, y, arrival: arrival(run), style });
    }
    Ok(PathPlot {
        title: format!("{}: from rest at the origin into the disc", vehicle.title()),
        x_label: "x_p (m)".into(),
        y_label: "y_p (m)".into(),
        paths: lines,
        discs: vec![Disc { label: "safe set".into(), centre: CENTRE, radius: RADIUS, obstacle: false }],
        ..PathPlot::default()
    })
}

/// h of each method with its promised bound, then both as distances near the deadline.
fn barriers(paper: &Run, ours: &Run) -> Result<Vec<TimePlot>, Error> {
    let mut plots = Vec::new();
    // h with its bound, a panel for each method.
    for run in [ours, paper] {
        let line = |label: &str, name: &str, style, colour| {
            let (time, values) = (run.recording.times().to_vec(), series(&run.recording, name)?);
            Ok::<_, Error>(Series { label: label.into(), time, values, style, colour: Some(colour) })
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
        let values =
            x.iter().zip(&y).map(|(x, y)| RADIUS - elementary::hypot(x - CENTRE[0], y - CENTRE[1])).collect();
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
        ..TimePlot::default()
    });
    Ok(plots)
}

/// The two inputs of a run, one panel each, since their units differ.
fn inputs(run: &Run) -> Result<Vec<TimePlot>, Error> {
    let time = run.recording.times();
    // The paper's inputs range from rest to tens of thousands, so a linear axis would only show the last
    // sample.
    let logarithmic = run.case.is_the_papers();
    let mut plots = Vec::new();
    for (i, signal) in run.case.vehicle.inputs().iter().enumerate() {
        let (name, unit) = (signal.name, cases::unit(signal));
        let mut lines = Vec::new();
        for (label, variable, style, colour) in
            [("safe input u", "u", Style::Steps, 0), ("nominal input", "u_ref", Style::Dashed, 1)]
        {
            // An unconnected reference is not recorded, since it stays 0.
            let Some(values) = run.recording.series(&format!("filter.{variable}.{name}")) else {
                continue;
            };
            lines.push(Series {
                label: label.into(),
                time: time.to_vec(),
                values,
                style,
                colour: Some(colour),
            });
        }
        let title = format!("{}: inputs, {}", run.case.vehicle.title(), run.case.title);
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
