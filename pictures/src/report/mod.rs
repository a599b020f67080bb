//! A run as one HTML page: the verdict on each promise, the path as an animation, h and the inputs over time.
//! Also a [`campaign`] as a page.

pub mod campaign;
mod scene;

use std::fmt::Write;

use punctual_cosim::coupling::{self, Kept, Model, Outcome, Promise, System};
use punctual_cosim::recording::Recording;
use punctual_fmu::text::{labelled, number, quantity, shown_unit};
use serde::Serialize;

use crate::drawing::{self, Group, Part};
use crate::page::{Page, escape, json};
use crate::plot::{self, Chart, Curve, Mark, POINTS, Scaling, Style};
use scene::{Area, Outline, Solid, Strip, Vehicle};

const SCRIPT: &str = include_str!("run.js");
const STYLE: &str = include_str!("run.css");

/// Margin at each side of a plane, as a fraction of its x axis.
const MARGIN: f64 = 0.06;

/// The data that the script animates.
#[derive(Default, Serialize)]
struct Scene {
    /// First and last time in s.
    time: [f64; 2],
    vehicles: Vec<Vehicle>,
    outlines: Vec<Outline>,
    /// The sets in space, if something moves in it.
    solids: Vec<Solid>,
    /// The status of each filter, with the key of its place in the page.
    strips: Vec<(String, Strip)>,
    /// What lies beneath the curves of a chart, with its key.
    areas: Vec<(String, Vec<Area>)>,
    /// Barriers without an outline, because they read more than the position.
    #[serde(skip)]
    left_out: Vec<String>,
}

/// The tube of the first plan of a filter.
#[derive(Default)]
pub struct FirstTube {
    /// The name of the filter.
    pub component: String,
    /// Around the path, if there is a plane.
    pub path: Option<plot::Tube>,
    /// Around h of each barrier, by name.
    pub h: Vec<(String, plot::Band)>,
    /// Around each input, by name.
    pub inputs: Vec<(String, plot::Band)>,
}

/// A chart over time, and the parts of tubes beneath its curves.
type Layers = (Chart, Vec<Area>);

/// The page of a run of `system`, which is in `file`. Its components are made from `models`; `tubes` are those of their first plans.
pub fn document(
    file: &str,
    (system, models): (&System, &[Model]),
    outcome: &Outcome,
    tubes: &[FirstTube],
    notes: &[String],
) -> String {
    let recording = &outcome.recording;
    let parts = drawing::parts(system, models);
    let mut charts: Vec<(String, Chart)> = Vec::new();
    let times = recording.times();
    let time = [times.first(), times.last()].map(|t| t.copied().unwrap_or_default());
    let mut scene = Scene { time, ..Scene::default() };
    let mut drawn = String::new();
    let filters: Vec<&Part<'_>> = parts.iter().filter(|part| !part.barriers().is_empty()).collect();
    if let Some(chart) = plane(&parts, outcome, &mut scene) {
        let in_space = scene.vehicles.iter().any(|vehicle| !vehicle.z.is_empty());
        if in_space {
            scene.solids = parts.iter().flat_map(Solid::all).collect();
            drawn += "<h2>Space</h2>\n<div class=\"space\"></div>\n\
                      <p class=\"hint\">Drag to turn. Green: to be inside. Red: to stay out. What has no ends is drawn as far as the \
                      paths reach.</p>\n";
        }
        let title = if in_space { "Path, from above" } else { "Path" };
        let arrival = chart.curves.iter().any(|curve| curve.ends[1].is_some());
        let arrival = if arrival { " Diamond: arrival." } else { "" };
        let around = |(i, tube): (usize, &FirstTube)| Some(Area::new(tube.path.as_ref()?.rings(), i));
        let around_paths: Vec<Area> = tubes.iter().enumerate().filter_map(around).collect();
        let tube = if around_paths.is_empty() { "" } else { SHADED };
        let _ = writeln!(
            drawn,
            "<h2>{title}</h2>\n<div class=\"chart plane\" data-chart=\"path\"></div>\n\
             <p class=\"hint\">Circle: start.{arrival} Green: to be inside. Red: to stay out.{tube}{}</p>",
            match &scene.left_out[..] {
                [] => String::new(),
                names => format!(
                    " Without an outline, for more than the place is in them: {}.",
                    escape(&names.join(", "))
                ),
            }
        );
        charts.push(("path".to_owned(), chart));
        scene.areas.push(("path".to_owned(), around_paths));
    }
    for (f, part) in filters.iter().enumerate() {
        let title = if filters.len() > 1 { &part.component.name } else { "Over time" };
        let _ = writeln!(drawn, "<h2>{}</h2>", escape(title));
        if let Some(strip) = Strip::new(part, shown(&parts, &part.signal("status")), recording) {
            let key = format!("status-{f}");
            let _ = writeln!(drawn, "<div class=\"strip\" data-strip=\"{key}\"></div>");
            scene.strips.push((key, strip));
        }
        let tube = tubes.iter().find(|tube| tube.component == part.component.name);
        if tube.is_some() {
            let _ = writeln!(drawn, "<p class=\"hint\">{SHADED}</p>");
        }
        let over_time =
            barriers(&parts, part, outcome, tube).into_iter().chain(inputs(&parts, part, outcome, tube));
        for (c, (chart, areas)) in over_time.enumerate() {
            let key = format!("chart-{f}-{c}");
            scene.areas.push((key.clone(), areas));
            let _ = writeln!(drawn, "<div class=\"chart over-time\" data-chart=\"{key}\"></div>");
            charts.push((key, chart));
        }
    }
    let head = head(file, &parts, outcome, notes);
    let body = if charts.is_empty() {
        format!(
            "{head}<p>Nothing is drawn: no filter of this program and nothing that moves in a plane was recorded.</p>\n"
        )
    } else {
        format!("{head}{HINT}{drawn}{CONTROLS}")
    };
    let script = format!("const scene = {};\n{SCRIPT}", json(&scene));
    let title = format!("{file}: run");
    Page { title: &title, body: &body, charts, style: STYLE, script: &script }.document()
}

/// The meaning of a tube.
const SHADED: &str = " Shaded: the tube of the first plan, in which its law keeps every plant that was declared. Where the run is outside, it had another plan.";

/// Instructions for the reader.
const HINT: &str = "<p class=\"hint\">Play the run below, or click into a chart over time to go there. Point at a curve to read \
    it off; drag to zoom (two fingers on a phone), double-click to see all again.</p>\n";

/// The controls of the time.
const CONTROLS: &str = "<div class=\"controls\"><button type=\"button\" id=\"play\" aria-label=\"play\">\u{25b6}</button>\
    <input type=\"range\" id=\"time\" aria-label=\"time in s\" /><output id=\"clock\" for=\"time\"></output>\
    <div id=\"now\"></div></div>\n\
    <noscript><p>The charts need JavaScript. The pictures beside this page do not.</p></noscript>\n";

/// The heading: what ran, and how it ended.
fn head(file: &str, parts: &[Part<'_>], outcome: &Outcome, notes: &[String]) -> String {
    let promises = &outcome.promises;
    let mut html = format!("<h1>{}</h1>\n<p>", escape(file));
    let components = parts.iter().map(|part| {
        let (name, model) = (&part.component.name, &part.model.description().model_name);
        let of = if name == model { String::new() } else { format!(" ({})", escape(model)) };
        format!("<b>{}</b>{of}", escape(name))
    });
    html += &components.collect::<Vec<_>>().join(", ");
    let (first, statistics) =
        (outcome.recording.times().first().copied().unwrap_or_default(), &outcome.statistics);
    let _ = writeln!(
        html,
        ": {} steps from {} s to {} s.</p>",
        statistics.steps,
        number(first),
        number(statistics.final_time)
    );
    match coupling::verdict(promises) {
        None => {
            html += "<p>There is no filter of this program in it, so there is no promise to judge.</p>\n";
        }
        Some(verdict) => html += &verdicts(parts, outcome, verdict),
    }
    for of in &outcome.interference {
        let _ = writeln!(html, "<p>{}</p>", escape(&of.text()));
    }
    html += &peaks(parts, &outcome.recording);
    let notes: String = notes.iter().map(|note| format!("<li>{}</li>\n", escape(note))).collect();
    if !notes.is_empty() {
        let _ = writeln!(html, "<h3>Notes</h3>\n<ul class=\"notes\">\n{notes}</ul>");
    }
    html
}

/// The verdict on each promise.
fn verdicts(parts: &[Part<'_>], outcome: &Outcome, (worst, sentence): (Kept, String)) -> String {
    let promises = &outcome.promises;
    // Only a filter that follows backup plans guarantees anything.
    let guaranteed: Vec<Option<bool>> =
        promises.iter().map(|p| guaranteed(parts, p, &outcome.recording)).collect();
    let plans = guaranteed.iter().any(Option::is_some);
    let mut header = vec!["barrier", "promise"];
    header.extend(plans.then_some("at the start"));
    header.extend(["deadline (s)", "arrival (s)", "least h when promised", "samples not met"]);
    let cell = |value: Option<f64>| value.map_or_else(|| "–".to_owned(), number);
    let rows = promises.iter().zip(guaranteed).map(|(p, guaranteed)| {
        let verdict = format!("<span class=\"{}\">{}</span>", class(p.promise), p.promise.words());
        let mut row = vec![escape(shown(parts, &p.barrier)), verdict];
        row.extend(plans.then(|| {
            let word = guaranteed.map_or("–", |yes| if yes { "guaranteed" } else { "not guaranteed" });
            word.to_owned()
        }));
        let h = outcome.recording.index_of(&format!("{}.h", p.barrier));
        let unit = h.and_then(|h| outcome.recording.columns()[h].unit.as_deref()).unwrap_or_default();
        let least = p.least_h.map_or_else(|| "–".to_owned(), |h| escape(&quantity(h, unit)));
        row.extend([cell(p.deadline), cell(p.arrival), least, p.unmet.to_string()]);
        row
    });
    format!(
        "<p class=\"verdict\"><span class=\"{}\">{sentence}</span></p>\n{}",
        class(worst),
        table(&header, 2 + usize::from(plans), rows)
    )
}

/// The extremes of the inputs against their limits.
fn peaks(parts: &[Part<'_>], recording: &Recording) -> String {
    let filters = parts.iter().filter(|part| !part.barriers().is_empty());
    let all = filters.flat_map(|part| part.inputs().into_iter().map(move |input| (part, input)));
    let rows = all.filter_map(|(part, input)| {
        let signal = part.signal(&format!("u.{input}"));
        let unit = recording.columns()[recording.index_of(&signal)?].unit.clone().unwrap_or_default();
        let (low, high) = plot::extent(recording.series(&signal)?)?;
        let limits = part.limits(input);
        let share = |peak: f64, limit: Option<f64>| limit.map(|l| peak / l).filter(|s| s.is_finite());
        let used = [share(low, limits[0]), share(high, limits[1])].into_iter().flatten().reduce(f64::max);
        let limit = |value: Option<f64>| value.map_or_else(|| "none".to_owned(), number);
        Some(vec![
            escape(shown(parts, &part.signal(input))),
            escape(shown_unit(&unit)),
            number(low),
            number(high),
            limit(limits[0]),
            limit(limits[1]),
            used.map_or_else(|| "–".to_owned(), |used| format!("{:.0}\u{202f}%", 100.0 * used.max(0.0))),
        ])
    });
    let rows: Vec<_> = rows.collect();
    if rows.is_empty() {
        return String::new();
    }
    let header = ["input", "unit", "least", "greatest", "lower limit", "upper limit", "of its limit"];
    table(&header, 2, rows.into_iter())
}

/// A table whose columns from `numbers` on are numbers. The cells are HTML.
fn table(header: &[&str], numbers: usize, rows: impl Iterator<Item = Vec<String>>) -> String {
    let row = |tag: &str, cells: &[String]| {
        let cells = cells.iter().enumerate().map(|(c, cell)| {
            let class = if c >= numbers { " class=\"n\"" } else { "" };
            format!("<{tag}{class}>{cell}</{tag}>")
        });
        format!("<tr>{}</tr>\n", cells.collect::<String>())
    };
    let head = row("th", &header.iter().map(|&head| head.to_owned()).collect::<Vec<_>>());
    let body: String = rows.map(|cells| row("td", &cells)).collect();
    format!(
        "<div class=\"wide\" tabindex=\"0\"><table><thead>{head}</thead>\n<tbody>\n{body}</tbody></table></div>\n"
    )
}

/// The class of a verdict in the style.
fn class(kept: Kept) -> &'static str {
    match kept {
        Kept::Kept => "word good",
        Kept::Broken => "word bad",
        Kept::Open | Kept::LetGo => "word open",
        Kept::NothingPromised => "word nothing",
    }
}

/// `signal` without its component if the system has only one filter.
fn shown<'a>(parts: &[Part<'_>], signal: &'a str) -> &'a str {
    let filters = parts.iter().filter(|part| !part.barriers().is_empty()).count();
    signal.split_once('.').filter(|_| filters == 1).map_or(signal, |(_, variable)| variable)
}

/// Whether the promise was guaranteed at the first sample; `None` if its filter follows no plans or it was
/// not recorded.
fn guaranteed(parts: &[Part<'_>], promise: &Promise, recording: &Recording) -> Option<bool> {
    let (component, barrier) = promise.barrier.split_once('.')?;
    let part = parts.iter().find(|part| part.component.name == component)?;
    part.model.description().index_of("assurance")?;
    let index = recording.index_of(&part.signal(&format!("{barrier}.guaranteed")))?;
    recording.column(index).next().map(|flag| flag != 0.0)
}

/// The chart of the paths; adds the moving objects to `scene`.
fn plane(parts: &[Part<'_>], outcome: &Outcome, scene: &mut Scene) -> Option<Chart> {
    let recording = &outcome.recording;
    let vehicles: Vec<Vehicle> = parts.iter().flat_map(|part| Vehicle::all(part, recording)).collect();
    let [x, y] = &vehicles.first()?.place;
    let label = |signal: &String| {
        let unit = recording.index_of(signal).and_then(|i| recording.columns()[i].unit.as_deref());
        let name = signal.rsplit('.').next().unwrap_or(signal);
        labelled(name, unit.unwrap_or_default())
    };
    let labels = [label(x), label(y)];
    let all = |extents: Vec<[Option<(f64, f64)>; 2]>, axis: usize| {
        plot::extent(extents.iter().filter_map(|extent| extent[axis]).flat_map(|(low, high)| [low, high]))
    };
    let moved: Vec<_> = vehicles.iter().map(Vehicle::extent).collect();
    let size = [0, 1].into_iter().filter_map(|axis| all(moved.clone(), axis)).map(|(low, high)| high - low);
    let size = size.fold(1.0, f64::max);
    let mut outlines: Vec<Outline> =
        parts.iter().flat_map(|part| Outline::all(part, recording, size)).collect();
    let mut extents: Vec<_> = moved.into_iter().chain(outlines.iter().map(Outline::extent)).collect();
    if let (Some(x), Some(y)) = (all(extents.clone(), 0), all(extents.clone(), 1)) {
        for part in parts {
            let (expressions, left_out) = part.expressions([x, y]);
            extents.extend(
                expressions.iter().map(|outline| {
                    [0, 1].map(|axis| plot::extent(outline.points().map(|point| point[axis])))
                }),
            );
            outlines.extend(expressions.into_iter().map(Outline::still));
            scene.left_out.extend(left_out.iter().map(|name| shown(parts, &part.signal(name)).to_owned()));
        }
        // Unbounded sets are drawn first, beneath all others.
        outlines.sort_by_key(|outline| !outline.endless);
    }
    let [x, y] = [0, 1].map(|axis| {
        let (low, high) = all(extents.clone(), axis)?;
        let room = MARGIN * (high - low).max(1e-9 * size);
        Some([low - room, high + room])
    });
    // With several vehicles, it is unknown whose arrival it is.
    let arrival = outcome.promises.iter().find(|p| p.deadline.is_some()).and_then(|p| p.arrival);
    let arrival = arrival.filter(|_| vehicles.len() == 1);
    let curve = |(i, vehicle): (usize, &Vehicle)| {
        let (x, y) = (recording.series(&vehicle.place[0])?, recording.series(&vehicle.place[1])?);
        let start = [*x.first()?, *y.first()?];
        let label = vehicle.label.clone();
        let ends = [Some(start), arrival.and_then(|time| vehicle.at(time))];
        Some(Curve { label, x, y, colour: i, ends, ..Curve::default() }.thinned(POINTS))
    };
    let curves = vehicles.iter().enumerate().filter_map(curve).collect();
    let [x_label, y_label] = labels;
    (scene.vehicles, scene.outlines) = (vehicles, outlines);
    Some(Chart {
        x: Scaling { label: x_label, range: x, logarithmic: false },
        y: Scaling { label: y_label, range: y, logarithmic: false },
        equal: true,
        curves,
        ..Chart::default()
    })
}

/// A curve over time, thinned.
fn curve(recording: &Recording, signal: &str, label: &str, colour: usize, style: Style) -> Option<Curve> {
    let (x, y) = (recording.times().to_vec(), recording.series(signal)?);
    Some(Curve { label: label.to_owned(), x, y, colour, style, ..Curve::default() }.thinned(POINTS))
}

/// The time axis of all charts: the run, and the deadlines that are not long after it.
fn time_axis(outcome: &Outcome) -> Scaling {
    let axis = Scaling::linear("time (s)");
    let Some((first, last)) = plot::extent(outcome.recording.times().iter().copied()) else { return axis };
    let deadlines = outcome.promises.iter().filter_map(|p| p.deadline);
    let near = deadlines.filter(|at| (first..=2.0 * last - first).contains(at));
    let last = near.fold(last, f64::max);
    let room = 0.03 * (last - first);
    axis.over(first - room, last + room)
}

/// h of each barrier with its profile, a chart for each unit.
fn barriers(parts: &[Part<'_>], part: &Part<'_>, outcome: &Outcome, tube: Option<&FirstTube>) -> Vec<Layers> {
    let mut colour = 0;
    let chart = |Group { unit, barriers, .. }: Group| {
        let mut chart = Chart {
            title: "h of each barrier, its profile dashed".to_owned(),
            x: time_axis(outcome),
            y: Scaling::linear(labelled("h", &unit)),
            horizontals: vec![Mark { label: String::new(), at: 0.0 }],
            ..Chart::default()
        };
        let mut areas: Vec<Area> = Vec::new();
        for barrier in &barriers {
            let signal = |field: &str| part.signal(&format!("{barrier}.{field}"));
            let recording = &outcome.recording;
            let name = part.signal(barrier);
            let label = shown(parts, &name);
            let Some(h) = curve(recording, &signal("h"), label, colour, Style::Solid) else { continue };
            chart.curves.push(h);
            // It shares the legend entry of h.
            chart.curves.extend(curve(recording, &signal("profile"), "", colour, Style::Dashed));
            let band = tube.and_then(|tube| tube.h.iter().find(|(name, _)| name == barrier));
            areas.extend(band.map(|(_, band)| Area::new(vec![band.ring()], colour)));
            colour += 1;
            let promise = outcome.promises.iter().find(|p| p.barrier == name);
            let Some(at) = promise.and_then(|p| p.deadline) else { continue };
            match chart.verticals.iter_mut().find(|mark| mark.at == at) {
                Some(mark) => mark.label = format!("{}, {barrier}", mark.label),
                None => chart.verticals.push(Mark { label: barrier.clone(), at }),
            }
        }
        if let [only] = &mut chart.verticals[..] {
            only.label = "deadline".to_owned();
        }
        chart.y.range = with_areas(&chart, &areas);
        (!chart.curves.is_empty()).then_some((chart, areas))
    };
    part.barriers().into_iter().filter_map(chart).collect()
}

/// The range of the y axis that shows the curves and what is beneath them; `None` if there is nothing beneath.
fn with_areas(chart: &Chart, areas: &[Area]) -> Option<[f64; 2]> {
    let beneath: Vec<_> = areas.iter().filter_map(Area::extent).collect();
    if beneath.is_empty() {
        return None;
    }
    let ends = beneath.iter().flat_map(|(low, high)| [*low, *high]);
    let (low, high) = plot::extent(chart.curves.iter().flat_map(|c| c.y.iter().copied()).chain(ends))?;
    let room = 0.04 * (high - low);
    Some([low - room, high + room])
}

/// Each input with u_ref and its limits.
fn inputs(parts: &[Part<'_>], part: &Part<'_>, outcome: &Outcome, tube: Option<&FirstTube>) -> Vec<Layers> {
    let recording = &outcome.recording;
    let chart = |input: &str| {
        let signal = part.signal(&format!("u.{input}"));
        let unit = recording.columns()[recording.index_of(&signal)?].unit.clone().unwrap_or_default();
        let name = part.signal(input);
        let solid = curve(recording, &signal, shown(parts, &name), 0, Style::Steps)?;
        let dashed = curve(recording, &part.signal(&format!("u_ref.{input}")), "", 0, Style::Dashed);
        let limits = part.limits(input);
        // u_ref may be far beyond the limits; the axis is to show u itself.
        let range = match limits {
            [Some(low), Some(high)] if low < high => {
                let span = high - low;
                let wanted = dashed.iter().flat_map(|c| &c.y).map(|v| v.clamp(low - span, high + span));
                let shown = plot::extent(solid.y.iter().copied().chain(wanted).chain([low, high]));
                shown.map(|(from, to)| [from - 0.1 * span, to + 0.1 * span])
            }
            _ => None,
        };
        let wanted = if dashed.is_some() { ", u_ref dashed" } else { "" };
        let limit = |(side, at): (&str, Option<f64>)| at.map(|at| Mark { label: side.to_owned(), at });
        let band = tube.and_then(|tube| tube.inputs.iter().find(|(name, _)| name == input));
        let areas = band.map(|(_, band)| Area::new(vec![band.ring()], 0));
        let chart = Chart {
            title: format!("{input}{wanted}"),
            x: time_axis(outcome),
            y: Scaling { label: labelled(input, &unit), range, logarithmic: false },
            curves: std::iter::once(solid).chain(dashed).collect(),
            horizontals: ["lower limit", "upper limit"].into_iter().zip(limits).filter_map(limit).collect(),
            ..Chart::default()
        };
        Some((chart, areas.into_iter().collect()))
    };
    part.inputs().into_iter().filter_map(chart).collect()
}
