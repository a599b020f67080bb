//! The pictures of `check`: the plan from the start, and the map of starts that have a plan.

use std::fmt::Write as _;
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use punctual_core::filter::{Filter, Planning};
use punctual_core::plan::{BackupPlan, Failure};
use punctual_cosim::error::Error;
use punctual_cosim::whole;
use punctual_fmu::configuration::{FilterConfiguration, Shape};
use punctual_pictures::plot::{self, Disc, MapPlot, Mark, PathPlot, Series, Style, TimePlot};
use punctual_pictures::tube::PlanTube;
use rayon::prelude::*;
use serde::Serialize;

use crate::output::{Progress, labelled};

/// About how many points of a plan are drawn.
const POINTS: f64 = 400.0;

/// The requested map of starts.
pub(super) struct Plane {
    /// The indices of the two states.
    states: [usize; 2],
    /// The ends of both ranges.
    ranges: [[f64; 2]; 2],
    /// Cells along each axis.
    cells: usize,
}

/// The map of starts that was drawn.
#[derive(Serialize)]
pub(super) struct MapReport {
    /// Number of starts with a plan.
    pub(super) promised: usize,
    /// Number of starts.
    pub(super) of: usize,
    /// The picture and the table.
    pub(super) files: Vec<String>,
}

impl Plane {
    /// Parses `x=0..10,y=-5..5`, with two of the filter's states.
    pub(super) fn parse(text: &str, cells: usize, c: &FilterConfiguration) -> Result<Self, Error> {
        let refuse = |message: String| Error::configuration("--map", message);
        let states = c.measured_states();
        let side = |part: &str| -> Result<(usize, [f64; 2]), Error> {
            let like = || refuse(format!("has {:?}, must be like \"x_p=-5..25\"", part.trim()));
            let (name, range) = part.split_once('=').ok_or_else(like)?;
            let (low, high) = range.split_once("..").ok_or_else(like)?;
            let number = |text: &str| text.trim().parse().ok().filter(|v: &f64| v.is_finite());
            let (Some(low), Some(high)) = (number(low), number(high)) else { return Err(like()) };
            if low >= high {
                return Err(refuse(format!("has {:?}, must go from less to more", part.trim())));
            }
            let name = name.trim();
            let names: Vec<_> = states.iter().map(|s| s.name.as_str()).collect();
            let state = names.iter().position(|n| *n == name);
            let state = state.ok_or_else(|| {
                refuse(format!("{name:?} is not a state, must be one of {}", names.join(", ")))
            })?;
            Ok((state, [low, high]))
        };
        let sides = text.split(',').map(side).collect::<Result<Vec<_>, _>>()?;
        match sides[..] {
            [(x, of_x), (y, of_y)] if x != y => Ok(Self { states: [x, y], ranges: [of_x, of_y], cells }),
            _ => Err(refuse(format!("is {text:?}, must be two states, like \"x_p=-5..25,y_p=-5..15\""))),
        }
    }
}

/// Draws to `folder` which starts have a plan. They are `x0`, as [measured](FilterConfiguration::measured),
/// with the two states of `plane` varied.
pub(super) fn starts(
    c: &FilterConfiguration,
    x0: &[f64],
    plane: &Plane,
    folder: &Path,
) -> Result<MapReport, Error> {
    let refuse = |reason: String| Error::configuration("--map", format!("needs plans: {reason}"));
    c.assured(c.build()?).map_err(refuse)?;
    let (t, side) = (c.experiment.start_time, plane.cells);
    let centre = |axis: usize, cell: usize| {
        let [low, high] = plane.ranges[axis];
        low + (high - low) * (cell as f64 + 0.5) / side as f64
    };
    let mut kinds = vec!["can be promised".to_owned()];
    kinds.extend(c.barrier.iter().map(|barrier| format!("no plan keeps {}", barrier.name)));
    kinds.extend(["no plan reaches an equilibrium", "nothing to promise"].map(str::to_owned));
    let others = c.barrier.len() + 1;
    let kind = |planning: Planning<'_>, x: &[f64]| {
        // Outside a set without a deadline, nothing can be promised for it.
        let lost = c
            .barrier
            .iter()
            .zip(planning.promised(t, x))
            .position(|(b, promised)| !promised && b.penalty.is_none());
        match (lost, planning.plan_from(t, x, 1.0)) {
            (Some(barrier), _)
            | (None, Err(Failure::Broken { barrier, .. } | Failure::Apart { barriers: [barrier, _], .. })) => {
                barrier + 1
            }
            (None, Ok(_)) => 0,
            (None, Err(Failure::Nothing)) => others + 1,
            (None, Err(_)) => others,
        }
    };
    // Each thread has its own filter, since a search is long and a filter cannot be shared.
    let (done, progress) = (AtomicUsize::new(0), Mutex::new(Progress::new("starts")));
    let cells: Vec<usize> = (0..side * side)
        .into_par_iter()
        .map_init(
            || c.build().map_err(Error::from).and_then(|filter| c.assured(filter).map_err(refuse)),
            |filter, cell| {
                let filter = filter.as_ref().map_err(|e| refuse(e.to_string()))?;
                let mut x = x0.to_vec();
                x[plane.states[0]] = centre(0, cell % side);
                x[plane.states[1]] = centre(1, cell / side);
                let planning = filter.planning().ok_or_else(|| refuse("there are none".to_owned()))?;
                let kind = kind(planning, &x);
                let done = done.fetch_add(1, Ordering::Relaxed) + 1;
                if let Ok(mut progress) = progress.lock() {
                    progress.show(done as f64 / (side * side) as f64);
                }
                Ok(kind)
            },
        )
        .collect::<Result<_, Error>>()?;
    // The picture and the table.
    let signals = c.measured_states();
    let label = |axis: usize| {
        let state = &signals[plane.states[axis]];
        labelled(&format!("{} at the start", state.name), &state.unit)
    };
    let in_plane = plane.states == [0, 1] && c.plant.model().is_some();
    let promised = cells.iter().filter(|kind| **kind == 0).count();
    let picture = MapPlot {
        title: format!("{}: starts from which every promise can be kept", c.name),
        x_label: label(0),
        y_label: label(1),
        x: plane.ranges[0],
        y: plane.ranges[1],
        columns: side,
        kinds: kinds.clone(),
        equal: signals[plane.states[0]].unit == signals[plane.states[1]].unit,
        discs: if in_plane { discs(c) } else { Vec::new() },
        cells: cells.clone(),
    };
    let mut table = format!("{},{},found\n", signals[plane.states[0]].name, signals[plane.states[1]].name);
    for (cell, kind) in cells.iter().enumerate() {
        // Writing to a string cannot fail.
        let _ = writeln!(table, "{},{},{}", centre(0, cell % side), centre(1, cell / side), kinds[*kind]);
    }
    let [drawn, listed] = ["svg", "csv"].map(|ending| folder.join(format!("{}-map.{ending}", c.name)));
    std::fs::create_dir_all(folder).map_err(|e| Error::io("create", folder, e))?;
    plot::map(&picture, &drawn)?;
    whole::write(&listed, table)?;
    Ok(MapReport { promised, of: cells.len(), files: [drawn, listed].iter().map(shown).collect() })
}

/// Draws `plan` from `x0` at `t` to `folder`: h, the inputs, and the path if there is a plane.
pub(super) fn plan(
    c: &FilterConfiguration,
    (filter, plan): (&Filter, &BackupPlan),
    (t, x0): (f64, &[f64]),
    folder: &Path,
) -> Result<Vec<String>, Error> {
    let end = plan.inputs.last().map_or(t, |(end, _)| *end);
    let way = filter.planning().map_or(Vec::new(), |own| own.trajectory(plan, t, x0, (end - t) / POINTS));
    let time: Vec<f64> = way.iter().map(|(t, ..)| *t).collect();
    let mut h = vec![vec![0.0; c.barrier.len()]; way.len()];
    for ((t, x, _), h) in way.iter().zip(&mut h) {
        filter.barrier_values(*t, x, h).map_err(Error::from)?;
    }
    let promised: Vec<bool> = filter.planning().map_or(Vec::new(), |own| own.promised(t, x0).collect());
    let tube = plan.tracking().map(|tracking| PlanTube::new(c, tracking));
    let mut panels = Vec::new();
    for (i, barrier) in c.barrier.iter().enumerate() {
        let is_promised = promised.get(i).copied().unwrap_or(false);
        let required = if is_promised { t + barrier.deadline.unwrap_or(0.0) } else { f64::INFINITY };
        let band = tube.as_ref().map(|tube| tube.around_h(filter, i, required)).transpose()?;
        let values = h.iter().map(|h| h[i]).collect();
        let series =
            Series { label: format!("{}.h", barrier.name), time: time.clone(), values, ..Series::default() };
        let deadline =
            barrier.deadline.map(|deadline| Mark { label: "deadline".to_owned(), at: t + deadline });
        panels.push(TimePlot {
            title: if i == 0 { format!("{}: the plan", c.name) } else { String::new() },
            y_label: labelled(&barrier.name, &barrier.unit(&c.plant)),
            series: vec![series],
            bands: band.into_iter().collect(),
            instants: deadline.filter(|mark| mark.at <= end).into_iter().collect(),
            bounds: vec![Mark { label: String::new(), at: 0.0 }],
            ..TimePlot::default()
        });
    }
    for (i, input) in c.plant.inputs().into_iter().enumerate() {
        let values = way.iter().map(|(.., u)| u[i]).collect();
        let series = Series {
            label: format!("u.{}", input.name),
            time: time.clone(),
            values,
            style: Style::Steps,
            ..Series::default()
        };
        let limits = c.bounds.get(&input.name).copied().unwrap_or_default();
        panels.push(TimePlot {
            y_label: labelled(&input.name, &input.unit),
            series: vec![series],
            bands: tube.iter().map(|tube| tube.around_input(i, limits)).collect(),
            bounds: limits.map(|at| Mark { label: String::new(), at }).into(),
            ..TimePlot::default()
        });
    }
    std::fs::create_dir_all(folder).map_err(|e| Error::io("create", folder, e))?;
    let file = |what: &str| folder.join(format!("{}-{what}.svg", c.name));
    let mut files = vec![file("plan")];
    plot::times(&panels, &files[0])?;
    // The named vehicles have their position first.
    let states = c.plant.states();
    if c.plant.model().is_some() && states.len() >= 2 && states[0].unit == "m" && states[1].unit == "m" {
        let along = |i: usize| way.iter().map(|(_, x, _)| x[i]).collect();
        let arrival = c
            .barrier
            .iter()
            .position(|b| b.deadline.is_some())
            .and_then(|i| h.iter().position(|h| h[i] >= 0.0));
        let path =
            plot::Path { label: "plan".to_owned(), x: along(0), y: along(1), arrival, style: Style::Solid };
        let label = |i: usize| labelled(&states[i].name, &states[i].unit);
        files.push(file("path"));
        let picture = PathPlot {
            title: format!("{}: the plan", c.name),
            x_label: label(0),
            y_label: label(1),
            paths: vec![path],
            discs: discs(c),
            tubes: tube.iter().map(PlanTube::around_path).collect(),
            ..PathPlot::default()
        };
        plot::path(&picture, &files[1])?;
    }
    Ok(files.iter().map(shown).collect())
}

/// The discs among the sets.
fn discs(c: &FilterConfiguration) -> Vec<Disc> {
    let disc = |label: &str, shape: &Shape| {
        let (centre, radius, obstacle) = match shape {
            Shape::Disc { at, radius, .. } | Shape::QuadraticDisc { at, radius } => {
                (at.centre, *radius, false)
            }
            Shape::Obstacle { at, radius, .. } => (at.centre, *radius, true),
            _ => return None,
        };
        Some(Disc { label: label.to_owned(), centre, radius, obstacle })
    };
    c.barrier.iter().filter_map(|b| disc(&b.name, &b.shape)).collect()
}

fn shown(file: impl AsRef<Path>) -> String {
    file.as_ref().display().to_string()
}
