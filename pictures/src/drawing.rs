//! Draws pictures from the plots of a system file and a recording.

use std::path::Path;

use punctual_cosim::coupling::{
    Component, DiscEntry, Model, Outcome, PathEntry, PathPicture, Picture, StartValue, System, TimePicture,
    Variant,
};
use punctual_cosim::error::Error;
use punctual_cosim::host::Causality;
use punctual_cosim::recording::Recording;
use punctual_fmu::configuration::{
    BarrierSection, Configuration, FilterConfiguration, RESOURCE, Shape, UNBOUNDED,
};
use punctual_fmu::text::labelled;

use crate::outlines::{self, Outline, Reads};
use crate::plot::{self, Disc, Mark, PathPlot, Scale, Series, Style, TimePlot};

/// The percentiles between which [`Variant::Clipped`] shows values.
const BULK: (f64, f64) = (1.0, 99.0);

/// Names of pairs of states that are the axes of a plane.
const PLANES: [[&str; 2]; 4] = [["x_p", "y_p"], ["x", "y"], ["px", "py"], ["p_x", "p_y"]];

/// A picture, and sets drawn beneath it that a system file cannot specify.
#[derive(Clone, Debug)]
pub struct Drawing {
    /// The picture, in the form of a system file.
    pub picture: Picture,
    /// Sets drawn beneath the paths of a plane, besides its discs.
    pub outlines: Vec<Outline>,
}

impl From<Picture> for Drawing {
    fn from(picture: Picture) -> Self {
        Self { picture, outlines: Vec::new() }
    }
}

/// The default pictures of a system that asks for none: the paths if there is a plane, h with its lower bound
/// for every filter, and every input with its limits. Only recorded signals are drawn.
pub fn usual(system: &System, models: &[Model], outcome: &Outcome) -> Vec<Drawing> {
    let recorded = outcome.recording.columns();
    let components = parts(system, models);
    let is_recorded = |signal: &String| recorded.iter().any(|column| column.name == *signal);
    let mut pictures: Vec<Drawing> = plane(&components, &outcome.recording).into_iter().collect();
    let mut add = |picture: TimePicture| pictures.push(Picture::Time(picture).into());
    for part in &components {
        let all = |names: Vec<String>| Some(names).filter(|names| names.iter().all(is_recorded));
        for Group { name, unit, barriers } in part.barriers() {
            let signals =
                |field: &str| barriers.iter().map(|b| part.signal(&format!("{b}.{field}"))).collect();
            let (Some(signals), Some(dashed)) = (all(signals("h")), all(signals("profile"))) else {
                continue;
            };
            let promise = |b: &String| outcome.promises.iter().find(|p| p.barrier == part.signal(b));
            let mut deadlines = barriers.iter().filter_map(|b| promise(b)?.deadline);
            add(TimePicture {
                name: Some(name),
                title: None,
                signals,
                dashed,
                ylabel: Some(labelled("h, and its profile", &unit)),
                deadline: deadlines.next().filter(|_| deadlines.next().is_none()),
                bounds: vec![0.0],
                scale: Variant::Linear,
            });
        }
        for input in part.inputs() {
            let (u, wanted) = (part.signal(&format!("u.{input}")), part.signal(&format!("u_ref.{input}")));
            let Some(signals) = all(vec![u]) else { continue };
            add(TimePicture {
                name: Some(part.file(&format!("u-{input}"))),
                title: None,
                signals,
                dashed: all(vec![wanted]).unwrap_or_default(),
                ylabel: None,
                deadline: None,
                bounds: part.limits(input).into_iter().flatten().collect(),
                scale: Variant::Linear,
            });
        }
    }
    pictures
}

/// The name of a state that is a heading, in rad from the x axis.
const HEADING: &str = "theta";

/// The signals of a position in a plane.
#[derive(Clone)]
pub struct Position {
    /// The name of what moves.
    pub label: String,
    /// Along x and y.
    pub place: [String; 2],
    /// Along z, if there is such a state.
    pub height: Option<String>,
    /// Its heading, which may not be recorded.
    pub heading: String,
}

/// A component and its model.
pub struct Part<'a> {
    /// Its entry in the system file.
    pub component: &'a Component,
    /// The model it is made from.
    pub model: &'a Model,
}

/// The barriers of one filter whose h has the same unit.
pub struct Group {
    /// The name of their picture.
    pub name: String,
    /// The unit of h.
    pub unit: String,
    /// Their names.
    pub barriers: Vec<String>,
}

/// The parts of `system`, whose components are made of `models`.
pub fn parts<'a>(system: &'a System, models: &'a [Model]) -> Vec<Part<'a>> {
    system.components().iter().zip(models).map(|(component, model)| Part { component, model }).collect()
}

impl Part<'_> {
    /// The name of its `variable` in a recording.
    pub fn signal(&self, variable: &str) -> String {
        format!("{}.{variable}", self.component.name)
    }

    /// The name of a picture of only this component, which shows `what`.
    fn file(&self, what: &str) -> String {
        match self.component.name.as_str() {
            "filter" => what.to_owned(),
            name => format!("{}-{what}", name.replace(['/', '\\', '\0'], "_")),
        }
    }

    /// The start value of a Real variable.
    pub fn number(&self, variable: &str) -> Option<f64> {
        let description = self.model.description();
        let start = description.variables[description.index_of(variable)?].start;
        self.component.start.get(variable).map_or(start, StartValue::number)
    }

    /// The filter with the start values of its entry, if it is one of this program.
    pub fn filter(&self) -> Option<FilterConfiguration> {
        let mut filter = match self.model {
            Model::Own(own, _) => Some(own.configuration.clone()),
            Model::Fmu(fmu, _) => fmu.resource(RESOURCE).and_then(|text| Configuration::parse(&text).ok()),
        }
        .and_then(|configuration| match configuration {
            Configuration::Filter(filter) => Some(filter),
            _ => None,
        })?;
        for row in filter.parameters() {
            if let Some(value) = self.component.start.get(&row.name).and_then(StartValue::number) {
                row.set(&mut filter, value);
            }
        }
        Some(filter)
    }

    /// Its barriers, by the unit of h.
    pub fn barriers(&self) -> Vec<Group> {
        let mut groups: Vec<Group> = Vec::new();
        for variable in &self.model.description().variables {
            let Some(barrier) = variable.name.strip_suffix(".profile") else { continue };
            let unit = variable.unit.as_deref().unwrap_or("1");
            match groups.iter_mut().find(|group| group.unit == unit) {
                Some(group) => group.barriers.push(barrier.to_owned()),
                None => {
                    let number =
                        if groups.is_empty() { String::new() } else { format!("-{}", groups.len() + 1) };
                    groups.push(Group {
                        name: self.file(&format!("h{number}")),
                        unit: unit.to_owned(),
                        barriers: vec![barrier.to_owned()],
                    });
                }
            }
        }
        groups
    }

    /// The inputs that it outputs.
    pub fn inputs(&self) -> Vec<&str> {
        let outputs = self.model.description().variables.iter().filter(|v| v.causality == Causality::Output);
        outputs.filter_map(|v| v.name.strip_prefix("u.")).collect()
    }

    /// The lower and the upper limit of an input, if it has them.
    pub fn limits(&self, input: &str) -> [Option<f64>; 2] {
        ["u_min", "u_max"]
            .map(|side| self.number(&format!("{side}.{input}")).filter(|limit| limit.abs() < UNBOUNDED))
    }

    /// Its positions in a plane. There are several if it moves several things.
    pub fn places(&self) -> Vec<Position> {
        let variables = &self.model.description().variables;
        let outputs = variables.iter().filter(|v| v.causality == Causality::Output);
        let states: Vec<_> =
            outputs.filter_map(|v| Some((v.name.strip_prefix("x.")?, v.unit.as_deref()))).collect();
        let planes = planes(&states);
        let component = &self.component.name;
        let label = |x: &str| match mover(x) {
            _ if planes.len() == 1 => component.clone(),
            Some(mover) => mover.to_owned(),
            None => format!("{component} {x}"),
        };
        let signal = |axis: &str| self.signal(&format!("x.{axis}"));
        let position = |&[x, y]: &[usize; 2]| {
            let [x, y] = [states[x].0, states[y].0];
            let heading = mover(x).map_or_else(|| HEADING.to_owned(), |mover| format!("{mover}_{HEADING}"));
            // In space: the third axis, where the second is no height.
            let height =
                along(x, "z").into_iter().find(|z| z != y && states.iter().any(|(state, _)| state == z));
            Position {
                label: label(x),
                place: [signal(x), signal(y)],
                height: height.as_deref().map(signal),
                heading: signal(&heading),
            }
        };
        planes.iter().map(position).collect()
    }

    /// The outlines of its barriers that are expressions of only the position, if they come near `ranges` of
    /// the plane. Also the names of the barriers that read more than the position, and so have no outline.
    pub fn expressions(&self, ranges: [(f64, f64); 2]) -> (Vec<Outline>, Vec<String>) {
        let (mut outlines, mut left_out) = (Vec::new(), Vec::new());
        let Some(filter) = self.filter() else { return (outlines, left_out) };
        let states = filter.plant.states();
        let named: Vec<_> =
            states.iter().map(|state| (state.name.as_str(), Some(state.unit.as_str()))).collect();
        let (planes, rest) = (planes(&named), vec![0.0; states.len()]);
        for (index, section) in filter.barrier.iter().enumerate() {
            let all: Vec<_> = planes.iter().map(|plane| outlines::reads(&filter, section, *plane)).collect();
            let found =
                planes.iter().zip(&all).find(|(_, reads)| **reads == Reads::Place).map(|(plane, _)| plane);
            if let Some(plane) = found {
                // A filter that has run can be built.
                let outline = Outline::of_expression(&filter, index, (*plane, &rest), ranges);
                outlines.extend(outline.ok().flatten());
            } else if all.contains(&Reads::More) {
                left_out.push(section.name.clone());
            }
        }
        (outlines, left_out)
    }

    /// The outlines of its barriers that do not move and are not discs. `size` is the size of everything else
    /// in the plane.
    fn shapes(&self, size: f64) -> Vec<Outline> {
        let filter = self.filter();
        let shape = |section: &BarrierSection| {
            let number = |field: &str| self.number(&format!("{}.{field}", section.name));
            let centre = [number("centre[1]")?, number("centre[2]")?];
            let is_disc = matches!(
                section.shape,
                Shape::Disc { .. } | Shape::QuadraticDisc { .. } | Shape::Obstacle { .. }
            );
            Some(Outline::of_shape(section, number, size).filter(|_| !is_disc)?.moved(centre))
        };
        filter.iter().flat_map(|filter| &filter.barrier).filter_map(shape).collect()
    }

    /// The discs of its barriers that do not move.
    fn discs(&self) -> Vec<DiscEntry> {
        let filter = self.filter();
        let sections = filter.iter().flat_map(|filter| &filter.barrier);
        let disc = |section: &BarrierSection| {
            let number = |field: &str| self.number(&format!("{}.{field}", section.name));
            let still = ["velocity[1]", "velocity[2]"].iter().all(|v| number(v).unwrap_or(0.0) == 0.0);
            let obstacle = match section.shape {
                Shape::Disc { at, .. } | Shape::QuadraticDisc { at, .. } if !at.centre_input => false,
                Shape::Obstacle { at, .. } if !at.centre_input => true,
                _ => return None,
            };
            let label = Some(section.name.clone()).filter(|_| !obstacle);
            let (x, y, radius) = (number("centre[1]")?, number("centre[2]")?, number("radius")?);
            still.then_some(DiscEntry { centre: [x, y], radius, label, obstacle })
        };
        sections.filter_map(disc).collect()
    }

    /// The barrier with the earliest deadline.
    fn goal(&self) -> Option<String> {
        let variables = &self.model.description().variables;
        variables.iter().find_map(|v| v.name.strip_suffix(".deadline")).map(str::to_owned)
    }
}

/// The positions of pairs of signals, given by name and unit, that are the axes of a plane.
fn planes(signals: &[(&str, Option<&str>)]) -> Vec<[usize; 2]> {
    let beside = |(x, unit): (&str, Option<&str>)| {
        let named = PLANES.iter().find(|axes| axes[0] == x).map(|axes| axes[1].to_owned());
        // Such as xa and ya, or x and z: lengths whose names differ only in that letter, of which one may have several.
        let letters = ["y", "z"].into_iter().flat_map(|letter| along(x, letter));
        let lengths = letters.filter(|_| unit == Some("m"));
        named.into_iter().chain(lengths).find_map(|y| signals.iter().position(|other| *other == (&*y, unit)))
    };
    signals.iter().enumerate().filter_map(|(i, x)| Some([i, beside(*x)?])).collect()
}

/// What the signal `x` may be called along the axis `letter`: each of its letters x may be that of the axis, the last one first.
fn along(x: &str, letter: &str) -> Vec<String> {
    let places = x.rmatch_indices('x').map(|(at, _)| format!("{}{letter}{}", &x[..at], &x[at + 1..]));
    places.collect()
}

/// The name of what moves, where its position along x has it in front, as `red` in `red_x` and `red_x_p`.
fn mover(x: &str) -> Option<&str> {
    ["_x_p", "_p_x", "_px", "_x"].iter().find_map(|end| x.strip_suffix(end)).filter(|name| !name.is_empty())
}

/// The paths of all components that move in a plane, with the sets of all filters.
fn plane(parts: &[Part<'_>], recording: &Recording) -> Option<Drawing> {
    let is_recorded = |signal: &String| recording.index_of(signal).is_some();
    let arrival = parts.iter().find_map(|part| Some(part.signal(&format!("{}.arrived", part.goal()?))));
    let arrival = arrival.filter(is_recorded);
    let paths = parts.iter().flat_map(Part::places).map(|position| (position.label, position.place));
    let paths = paths.filter(|(_, place)| place.iter().all(is_recorded));
    let paths: Vec<_> = paths.collect();
    let seen =
        |axis: usize| paths.iter().filter_map(move |(_, place)| recording.series(&place[axis])).flatten();
    let ranges = [plot::extent(seen(0)), plot::extent(seen(1))];
    let mut paths = paths.iter().cloned();
    let (label, [x, y]) = paths.next()?;
    let entry =
        |(label, [x, y]): (String, [String; 2])| PathEntry { x, y, label: Some(label), arrival: None };
    let more: Vec<_> = paths.map(entry).collect();
    let mut discs: Vec<_> = parts.iter().flat_map(Part::discs).collect();
    let mut outlines = Vec::new();
    if let [Some(x), Some(y)] = ranges {
        let size = (x.1 - x.0).max(y.1 - y.0).max(1.0);
        outlines.extend(parts.iter().flat_map(|part| part.shapes(size)));
        let discs = discs.iter().map(|disc| (disc.centre, disc.radius));
        let reach = |axis: usize, (low, high): (f64, f64)| {
            let discs =
                discs.clone().flat_map(|(centre, radius)| [centre[axis] - radius, centre[axis] + radius]);
            let shapes = outlines.iter().flat_map(Outline::points).map(|point| point[axis]);
            plot::extent(discs.chain(shapes).chain([low, high])).unwrap_or((low, high))
        };
        let ranges = [reach(0, x), reach(1, y)];
        outlines.extend(parts.iter().flat_map(|part| part.expressions(ranges).0));
        // Unbounded sets are drawn first, beneath all others.
        outlines.sort_by_key(|outline| !outline.endless);
    }
    // All obstacles share one legend entry.
    let obstacles = outlines.iter_mut().filter(|outline| outline.obstacle).map(|outline| &mut outline.label);
    obstacles.for_each(String::clear);
    if let Some(first) = discs.iter_mut().find(|disc| disc.obstacle) {
        first.label = Some("obstacle".to_owned());
    } else if let Some(first) = outlines.iter_mut().find(|outline| outline.obstacle) {
        first.label = "obstacle".to_owned();
    }
    let picture = Picture::Path(PathPicture {
        name: Some("path".to_owned()),
        title: None,
        // With several vehicles, it is unknown whose arrival it is.
        arrival: arrival.filter(|_| more.is_empty()),
        x,
        y,
        label: Some(label),
        more,
        discs,
    });
    Some(Drawing { picture, outlines })
}

/// Draws `drawing` from `recording` into the SVG file `file`; if it `moves`, an arrow runs along each path.
///
/// # Errors
///
/// A signal that is not in the recording, nothing finite to draw, or a file that cannot be written.
pub fn draw(drawing: &Drawing, recording: &Recording, file: &Path, moves: bool) -> Result<(), Error> {
    match &drawing.picture {
        Picture::Path(picture) => {
            let clock = if moves { recording.times().to_vec() } else { Vec::new() };
            plot::path(&PathPlot { clock, ..path(picture, &drawing.outlines, recording)? }, file)
        }
        Picture::Time(picture) => plot::time(&time(picture, recording)?, file),
    }
}

fn path(picture: &PathPicture, outlines: &[Outline], recording: &Recording) -> Result<PathPlot, Error> {
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
    // Of several in one model, the axes are not those of the first.
    let axis = |signal: &'_ str| {
        let name = variable(signal);
        let of_one = picture
            .label
            .as_ref()
            .and_then(|label| name.strip_prefix("x.")?.strip_prefix(label)?.strip_prefix('_'));
        of_one.unwrap_or(name).to_owned()
    };
    Ok(PathPlot {
        title: picture.title.clone().unwrap_or_default(),
        x_label: axis_label(recording, &axis(&picture.x), &[&picture.x]),
        y_label: axis_label(recording, &axis(&picture.y), &[&picture.y]),
        paths,
        discs: picture
            .discs
            .iter()
            .map(|disc| Disc {
                label: disc.label.clone().unwrap_or_default(),
                centre: disc.centre,
                radius: disc.radius,
                obstacle: disc.obstacle,
            })
            .collect(),
        outlines: outlines.to_vec(),
        tubes: Vec::new(),
        clock: Vec::new(),
    })
}

fn time(picture: &TimePicture, recording: &Recording) -> Result<TimePlot, Error> {
    // Signals that belong together, such as a barrier's h and its profile, have the same colour.
    let stem = |signal: &str| signal.rsplit_once('.').map(|(stem, _)| stem.to_owned());
    let solid = picture.signals.iter().map(|signal| (signal, Style::Solid, None));
    let dashed = picture.dashed.iter().map(|signal| {
        let twin = picture.signals.iter().position(|other| stem(other) == stem(signal));
        let only = picture.signals.iter().filter(|other| stem(other) == stem(signal)).count() == 1;
        (signal, Style::Dashed, twin.filter(|_| only))
    });
    let lines = solid
        .chain(dashed)
        .map(|(signal, style, colour)| {
            let (time, values) = (recording.times().to_vec(), series(recording, signal)?);
            Ok(Series { label: signal.clone(), time, values, style, colour })
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
        bands: Vec::new(),
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

/// `name (unit)`, if all signals share a unit.
fn axis_label(recording: &Recording, name: &str, signals: &[&String]) -> String {
    let unit = |signal: &&String| {
        recording.index_of(signal).and_then(|i| recording.columns()[i].unit.clone()).unwrap_or_default()
    };
    let first = signals.first().map(unit).unwrap_or_default();
    let shared = signals.iter().all(|signal| unit(signal) == first);
    labelled(if name.is_empty() { "value" } else { name }, if shared { &first } else { "" })
}

fn component(signal: &str) -> &str {
    signal.split_once('.').map_or(signal, |(component, _)| component)
}

fn variable(signal: &str) -> &str {
    signal.split_once('.').map_or(signal, |(_, variable)| variable)
}
