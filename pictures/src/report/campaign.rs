//! A campaign as one HTML page: success over the varied quantities, arrivals against the deadline, the worst
//! runs and how to replay them.

use std::collections::BTreeMap;
use std::fmt::Write;

use punctual_core::elementary;
use punctual_cosim::campaign::{
    Campaign, Case, Cell, Distribution, Kind, Measures, Rate, Reader, Row, Sampling, Success, Summary,
};
use punctual_cosim::coupling::StartValue;
use punctual_cosim::error::Error;
use punctual_fmu::text::{labelled, number, shown_unit};
use serde::Serialize;

use super::table;
use crate::page::{Page, escape, json};
use crate::plot::{self, Chart, Curve, Mark, Scaling, Style, seven_digits};

const SCRIPT: &str = include_str!("campaign.js");
const STYLE: &str = include_str!("campaign.css");

/// About how many numbers a page stores for its points.
const NUMBERS: usize = 60_000;
/// The fewest runs that are drawn if there are more.
const FEWEST: usize = 500;
/// For this many of the first runs, one later run that did not succeed may be drawn as well.
const LATER: usize = 4;
/// About how many bars a histogram has.
const BARS: f64 = 30.0;
/// Number of groups of equal size whose success rates are compared.
const PARTS: usize = 5;
/// Margin beside the data, as a fraction of their extent.
const MARGIN: f64 = 0.04;

/// The output for a campaign.
pub struct Pages {
    /// The page, as HTML.
    pub page: String,
    /// Success over two quantities, as SVG; `None` if fewer than two differ from run to run.
    pub picture: Option<String>,
}

/// The data that the script draws.
#[derive(Serialize)]
struct Scene {
    axes: Vec<Axis>,
    /// The axes that are shown initially.
    shown: Option<[usize; 2]>,
    /// The numbers of the runs that are drawn.
    runs: Vec<u64>,
    /// Whether each of them succeeded.
    good: Vec<bool>,
    /// How many of them are the first runs of the campaign.
    first: usize,
    /// The command that replays a run: the text before its number and after it.
    again: [String; 2],
    arrivals: Vec<Arrivals>,
}

/// A quantity that differs from run to run.
#[derive(Serialize)]
struct Axis {
    label: String,
    logarithmic: bool,
    /// Its values for the runs that are drawn.
    values: Vec<f64>,
    #[serde(skip)]
    column: usize,
    #[serde(skip)]
    is_varied: bool,
}

/// The arrivals at one barrier.
#[derive(Serialize)]
struct Arrivals {
    barrier: String,
    said: String,
    chart: Option<Chart>,
}

/// Chooses the runs that are drawn: the first ones, and some later ones that did not succeed.
#[derive(Default)]
struct Sample {
    /// The number of first ones.
    budget: usize,
    runs: Vec<u64>,
    good: Vec<bool>,
}

impl Sample {
    /// Decides whether the next run, whose number is `run`, is drawn.
    fn take(&mut self, run: u64, succeeded: bool) -> bool {
        let room = if succeeded { self.budget } else { self.budget + self.budget / LATER };
        let is_drawn = self.runs.len() < room;
        if is_drawn {
            self.runs.push(run);
            self.good.push(succeeded);
        }
        is_drawn
    }

    /// How many of them are the first runs of the campaign.
    fn first(&self) -> usize {
        self.runs.len().min(self.budget)
    }
}

/// Makes the page of the campaign in `file`, whose rows are in `reader`; `results` is the path of the file
/// with the rows.
///
/// # Errors
///
/// A file that cannot be read.
pub fn pages(
    file: &str,
    results: &str,
    campaign: &Campaign,
    measures: &Measures,
    reader: &Reader,
    summary: &Summary,
) -> Result<Pages, Error> {
    let columns = measures.columns();
    let find = |name: &str| columns.iter().position(|column| column.name == name);
    let success = find("success");
    let mut axes = axes(campaign, measures, summary);
    let mut sample = Sample { budget: (NUMBERS / axes.len().max(1)).max(FEWEST), ..Sample::default() };
    let mut counts: Vec<Counts> =
        measures.barriers().filter_map(|barrier| Counts::new(barrier, campaign, &find, summary)).collect();
    // Read the rows once more.
    let mut run = 0;
    for group in 0..reader.groups() {
        for row in reader.group(group, columns)? {
            counts.iter_mut().for_each(|counts| counts.take(&row));
            let succeeded = success.is_some_and(|c| matches!(row[c], Cell::Flag(true)));
            if sample.take(run, succeeded) {
                for axis in &mut axes {
                    axis.values.push(value(&row, axis.column).map_or(f64::NAN, seven_digits));
                }
            }
            run += 1;
        }
    }
    let shown = shown(&axes, &sample.good[..sample.first()]);
    let picture = shown.map(|[x, y]| plot::chart(&scatter(&axes[x], &axes[y], &sample.good), "campaign"));
    let arrivals: Vec<Arrivals> = counts.into_iter().map(|counts| counts.drawn(summary.runs)).collect();
    let quoted =
        if results.contains(char::is_whitespace) { format!("{results:?}") } else { results.to_owned() };
    let again = [format!("punctual replay {quoted} --run "), " --out out".to_owned()];
    // Write the page.
    let mut body = head(file, campaign, summary);
    if shown.is_some() {
        body += &over_two(&axes, shown, summary, &sample);
    }
    if let Some(first) = arrivals.first() {
        let several = arrivals.len() > 1;
        let names = arrivals.iter().map(|arrivals| arrivals.barrier.as_str()).enumerate();
        let choose = if several { select("barrier", "barrier", names, 0) } else { String::new() };
        let _ = writeln!(
            body,
            "<h2>Arrivals</h2>\n{choose}<p id=\"arrived\">{}</p>\n<div class=\"chart bars\" data-chart=\"arrivals\"></div>",
            escape(&first.said)
        );
    }
    body += &worst(campaign, measures, &summary.worst, &again);
    body += &varied(campaign);
    body += &numbers(summary);
    body +=
        "<noscript><p>The charts need JavaScript. The picture beside this page does not.</p></noscript>\n";
    let first = sample.first();
    let Sample { runs, good, .. } = sample;
    let scene = Scene { axes, shown, runs, good, first, again, arrivals };
    let script = format!("const scene = {};\n{SCRIPT}", json(&scene));
    let title = format!("{file}: campaign");
    let charts: [(); 0] = [];
    let page = Page { title: &title, body: &body, charts, style: STYLE, script: &script }.document();
    Ok(Pages { page, picture: picture.transpose()? })
}

/// The quantities that differ from run to run, with the varied ones first. The magnitude of a seed means
/// nothing, so seeds are left out.
fn axes(campaign: &Campaign, measures: &Measures, summary: &Summary) -> Vec<Axis> {
    let differs = |name: &str| {
        summary
            .spreads
            .iter()
            .any(|spread| spread.column == name && spread.count > 0 && spread.min < spread.max)
    };
    let numbers = measures.columns().iter().enumerate().filter(|(_, column)| column.kind == Kind::Number);
    let axis = |(c, column): (usize, &punctual_cosim::campaign::Column)| {
        let varied = campaign.varied().iter().find(|varied| varied.name == column.name);
        if varied.is_some_and(|varied| matches!(varied.distribution, Distribution::Seed)) {
            return None;
        }
        Some(Axis {
            label: labelled(&column.name, &column.unit),
            logarithmic: varied.is_some_and(|v| matches!(v.distribution, Distribution::LogUniform { .. })),
            values: Vec::new(),
            column: c,
            is_varied: varied.is_some(),
        })
    };
    numbers.filter(|(_, column)| differs(&column.name)).filter_map(axis).collect()
}

/// The two axes shown initially: the varied quantities on which success depends most in the first runs.
fn shown(axes: &[Axis], good: &[bool]) -> Option<[usize; 2]> {
    let mut varied: Vec<(usize, f64)> = (0..axes.len())
        .filter(|&a| axes[a].is_varied)
        .map(|a| (a, dependence(&axes[a].values[..good.len()], good)))
        .collect();
    varied.sort_by(|a, b| b.1.total_cmp(&a.1));
    let others = (0..axes.len()).filter(|&a| !axes[a].is_varied);
    let mut order = varied.iter().map(|(a, _)| *a).chain(others);
    let mut pair = [order.next()?, order.next()?];
    pair.sort_unstable();
    Some(pair)
}

/// How much the success rate differs between groups of runs sorted by `values`: Pearson's chi-squared, up to
/// a common factor.
fn dependence(values: &[f64], good: &[bool]) -> f64 {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
    let rate = |runs: &[usize]| runs.iter().filter(|&&run| good[run]).count() as f64 / runs.len() as f64;
    let all = rate(&order);
    let parts = order.chunks(values.len().div_ceil(PARTS).max(1));
    parts.map(|part| part.len() as f64 * elementary::powi(rate(part) - all, 2)).sum()
}

/// Success over two axes.
fn scatter(x: &Axis, y: &Axis, good: &[bool]) -> Chart {
    let scaling =
        |axis: &Axis| Scaling { label: axis.label.clone(), logarithmic: axis.logarithmic, range: None };
    let curve = |label: &str, wanted: bool, style: Style| {
        let of = |axis: &Axis| {
            let values = axis.values.iter().zip(good).filter(|(_, good)| **good == wanted);
            values.map(|(value, _)| *value).collect()
        };
        Curve {
            label: label.to_owned(),
            x: of(x),
            y: of(y),
            style,
            colour: usize::from(!wanted),
            ..Curve::default()
        }
    };
    let curves = vec![curve("success", true, Style::Points), curve("failure", false, Style::Crosses)];
    Chart { x: scaling(x), y: scaling(y), curves, ..Chart::default() }
}

fn value(row: &Row, column: usize) -> Option<f64> {
    match row[column] {
        Cell::Number(number) => number,
        _ => None,
    }
}

/// Histogram of the arrivals at a barrier, with bars that begin and end at its deadline.
struct Counts {
    barrier: String,
    /// The deadline in s, or its column if it is varied.
    deadline: Result<f64, usize>,
    /// The start time of the runs in s, from which deadlines count.
    start: f64,
    arrival: usize,
    on_time: usize,
    /// The width of a bar in s.
    width: f64,
    /// Number of runs by bar, counted from the deadline: those on time, and the others.
    bars: [BTreeMap<i64, u64>; 2],
}

impl Counts {
    /// The histogram of `barrier`, if it has a deadline.
    fn new(
        barrier: &str,
        campaign: &Campaign,
        find: &dyn Fn(&str) -> Option<usize>,
        summary: &Summary,
    ) -> Option<Self> {
        let start = campaign.system().experiment().start_time;
        let column = |field: &str| find(&format!("{barrier}.{field}"));
        let spread = |field: &str| summary.spreads.iter().find(|s| s.column == format!("{barrier}.{field}"));
        let deadline = match column("deadline") {
            Some(column) => Err(column),
            None => Ok(deadline(barrier, campaign)?),
        };
        let arrived = spread("arrival").filter(|spread| spread.count > 0);
        let length = arrived.map_or(0.0, |spread| spread.max - spread.min);
        let varied = spread("deadline").map_or(0.0, |spread| spread.max - spread.min);
        let width = (length + varied) / BARS;
        let width = if width > 0.0 { width } else { 0.1 };
        let (arrival, on_time) = (column("arrival")?, column("on_time")?);
        let bars = Default::default();
        Some(Self {
            barrier: barrier.to_owned(),
            deadline,
            start,
            arrival,
            on_time,
            width: round(width),
            bars,
        })
    }

    fn take(&mut self, row: &Row) {
        let deadline = self.deadline.map_or_else(|column| value(row, column), Some);
        let (Some(arrival), Some(deadline)) = (value(row, self.arrival), deadline) else { return };
        let after = (arrival - self.start - deadline) / self.width;
        let is_late = !matches!(row[self.on_time], Cell::Flag(true));
        // A bar ends at the deadline, and an arrival then is on time. Round-off must not move it to the next
        // bar.
        let bar = if is_late { (after.ceil() as i64 - 1).max(0) } else { (after.ceil() as i64 - 1).min(-1) };
        *self.bars[usize::from(is_late)].entry(bar).or_default() += 1;
    }

    fn drawn(self, runs: u64) -> Arrivals {
        let [on_time, late] = self.bars.each_ref().map(|bars| bars.values().sum::<u64>());
        let never = runs - on_time - late;
        let said = format!(
            "{}: of {runs} runs {on_time} arrive by the deadline, {late} later, {never} not in their time.",
            self.barrier
        );
        let (at, label) = match self.deadline {
            Ok(deadline) => (self.start + deadline, "arrival (s)"),
            Err(_) => (0.0, "arrival, from the deadline on (s)"),
        };
        let all = || self.bars.iter().flat_map(BTreeMap::keys).copied();
        let ends = all().min().zip(all().max());
        let chart = ends.map(|(first, last)| {
            let place = |bar: i64| at + bar as f64 * self.width;
            let outline = |(bars, label, colour): (&BTreeMap<i64, u64>, &str, usize)| {
                let mut curve =
                    Curve { label: label.to_owned(), style: Style::Steps, colour, ..Curve::default() };
                let (first, last) = (*bars.keys().next()?, *bars.keys().next_back()?);
                // An outline begins and ends at zero.
                let heights = (first..=last).map(|bar| (bar, bars.get(&bar).copied().unwrap_or_default()));
                for (bar, height) in std::iter::once((first, 0)).chain(heights).chain([(last + 1, 0)]) {
                    curve.x.push(seven_digits(place(bar)));
                    curve.y.push(height as f64);
                }
                Some(curve)
            };
            let highest = self.bars.iter().flat_map(BTreeMap::values).max().copied().unwrap_or(1) as f64;
            let (low, high) = (place(first).min(at), place(last + 1).max(at));
            let room = MARGIN * (high - low);
            let words = [("on time", 0), ("late", 1)];
            Chart {
                x: Scaling::linear(label).over(low - room, high + room),
                y: Scaling::linear("runs").over(0.0, (1.0 + MARGIN) * highest),
                curves: self
                    .bars
                    .iter()
                    .zip(words)
                    .filter_map(|(bars, (l, c))| outline((bars, l, c)))
                    .collect(),
                verticals: vec![Mark { label: "deadline".to_owned(), at }],
                ..Chart::default()
            }
        });
        Arrivals { barrier: self.barrier, said, chart }
    }
}

/// The deadline of `barrier` in s, if it is the same for all runs.
fn deadline(barrier: &str, campaign: &Campaign) -> Option<f64> {
    let components = campaign.system().components().iter().zip(campaign.models());
    let find =
        |(component, part): (&punctual_cosim::coupling::Component, &punctual_cosim::campaign::Part)| {
            let variable = format!("{}.deadline", barrier.strip_prefix(&format!("{}.", component.name))?);
            let own = &part.description().variables[part.description().index_of(&variable)?];
            component.start.get(&variable).map_or(own.start, StartValue::number)
        };
    components.filter_map(find).next().filter(|deadline| deadline.is_finite())
}

/// The next number of the series 1, 2, 5, 10 and so on.
fn round(width: f64) -> f64 {
    let power = elementary::powf(10.0, elementary::log10(width).floor());
    [1.0, 2.0, 5.0].map(|factor| factor * power).into_iter().find(|w| *w >= width).unwrap_or(10.0 * power)
}

/// A fraction in percent. Only all of it is 100 %, and only none is 0 %.
fn percent(part: f64) -> String {
    let digits = (2..=9).find(|&digits| {
        let shown = format!("{:.digits$}", 100.0 * part);
        part <= 0.0 || part >= 1.0 || (shown.parse() != Ok(100.0) && shown.parse() != Ok(0.0))
    });
    let text = format!("{:.*}", digits.unwrap_or(9), 100.0 * part);
    format!("{}\u{202f}%", text.trim_end_matches('0').trim_end_matches('.'))
}

/// The heading: what was run, and how many runs succeeded.
fn head(file: &str, campaign: &Campaign, summary: &Summary) -> String {
    let components = campaign.system().components().iter().zip(campaign.models()).map(|(component, part)| {
        let (name, model) = (&component.name, &part.description().model_name);
        let of = if name == model { String::new() } else { format!(" ({})", escape(model)) };
        format!("<b>{}</b>{of}", escape(name))
    });
    let experiment = campaign.system().experiment();
    let wanted = match campaign.success() {
        _ if !campaign.declared().is_empty() => {
            "a plan guarantees every promise at every sample, and h >= 0 while it does"
        }
        Success::Kept => "every promise is kept and every sample meets its constraint",
        Success::OnTimeAndInside => "every barrier is reached by its deadline and not left from then on",
    };
    let Rate { count, rate, interval: [low, high] } = summary.success;
    let (class, sentence) = match summary.failure.count {
        0 => ("good", format!("All {} runs succeed.", summary.runs)),
        _ => ("bad", format!("{count} of {} runs succeed: {}.", summary.runs, percent(rate))),
    };
    let guide = match campaign.sampling() {
        Sampling::Random => "",
        _ => " That holds for independent runs; these are spread, so it is a rough guide.",
    };
    let unfinished = match campaign.runs() {
        runs if runs == summary.runs => String::new(),
        runs => format!(
            "<p class=\"verdict\"><span class=\"word open\">Interrupted: {} of {runs} runs are made.</span></p>\n<p>The same command \
             makes the others, and <code>replay</code> takes the results once all runs are made.</p>\n",
            summary.runs
        ),
    };
    let mut html = format!(
        "<h1>{}</h1>\n{unfinished}<p>{}: {} runs from {} s to {} s.</p>\n\
         <p class=\"verdict\"><span class=\"word {class}\">{sentence}</span></p>\n\
         <p>The rate of success is {} to {}, with a confidence of 95\u{202f}%.{guide} A run succeeds if {wanted}.</p>\n",
        escape(file),
        components.collect::<Vec<_>>().join(", "),
        summary.runs,
        number(experiment.start_time),
        number(experiment.stop_time),
        percent(low),
        percent(high),
    );
    for of in &summary.declared {
        html += &format!("<p>{}.</p>\n", escape(&of.text()));
    }
    let row = |name: String, rate: &Rate| {
        let [low, high] = rate.interval.map(percent);
        vec![escape(&name), rate.count.to_string(), percent(rate.rate), format!("{low} to {high}")]
    };
    let lacks = summary.lacks.iter().map(|lack| row(format!("not {}", lack.column), &lack.rate));
    let verdicts = [row("success".to_owned(), &summary.success), row("failure".to_owned(), &summary.failure)];
    html += &table(
        &["of all runs", "count", "part", "95\u{202f}% interval"],
        1,
        verdicts.into_iter().chain(lacks),
    );
    html
}

/// A selection among `names`.
fn select<'a>(id: &str, label: &str, names: impl Iterator<Item = (usize, &'a str)>, chosen: usize) -> String {
    let option = |(value, name): (usize, &str)| {
        let chosen = if value == chosen { " selected=\"\"" } else { "" };
        format!("<option value=\"{value}\"{chosen}>{}</option>", escape(name))
    };
    format!("<label>{label} <select id=\"{id}\">{}</select></label>\n", names.map(option).collect::<String>())
}

/// Success over two quantities that the reader selects.
fn over_two(axes: &[Axis], shown: Option<[usize; 2]>, summary: &Summary, sample: &Sample) -> String {
    let [x, y] = shown.unwrap_or_default();
    let choose = |id: &str, label: &str, chosen: usize| {
        select(id, label, axes.iter().map(|axis| axis.label.as_str()).enumerate(), chosen)
    };
    let (drawn, first) = (sample.runs.len(), sample.first());
    let left_out = if (drawn as u64) < summary.runs {
        let later = match drawn - first {
            0 => String::new(),
            later => format!(" and {later} later ones without success"),
        };
        format!(" Drawn are the first {first} of {} runs{later}.", summary.runs)
    } else {
        String::new()
    };
    format!(
        "<h2>Success over two quantities</h2>\n<p class=\"choose\">{}{}{}</p>\n\
         <div class=\"chart\" data-chart=\"runs\"></div>\n\
         <p class=\"hint\">A dot is a run with success, a cross one without.{left_out} Point at one to read it off; click on it for \
         the command that makes it again. Drag to zoom (two fingers on a phone), double-click to see all again. By cell: how many of \
         the first {first} runs in each part of the plane succeed. A rate of few runs says little.</p>\n\
         <p id=\"again\" class=\"command\" hidden=\"\"></p>\n",
        choose("across", "across", x),
        choose("up", "up", y),
        select("how", "shown", ["each run", "rate of success by cell"].into_iter().enumerate(), 0),
    )
}

/// The worst runs, and how to replay them.
fn worst(campaign: &Campaign, measures: &Measures, cases: &[Case], again: &[String; 2]) -> String {
    if cases.is_empty() {
        return String::new();
    }
    let column = |name: &str| measures.columns().iter().find(|column| column.name == name);
    let heads = campaign.varied().iter().map(|varied| {
        let unit = column(&varied.name).map_or("", |column| &column.unit);
        escape(&labelled(&varied.name, unit))
    });
    let heads: Vec<String> = ["run", "verdict", "again, with pictures", "least h"]
        .map(str::to_owned)
        .into_iter()
        .chain(heads)
        .collect();
    let rows = cases.iter().map(|case| {
        let (class, word) = if case.success { ("good", "success") } else { ("bad", "failure") };
        let why = case
            .failure
            .as_deref()
            .map_or_else(String::new, |why| format!("<div class=\"why\">{}</div>", escape(why)));
        let [before, after] = again;
        let mut row = vec![
            case.run.to_string(),
            format!("<span class=\"word {class}\">{word}</span>{why}"),
            format!("<code class=\"command\">{}{}{after}</code>", escape(before), case.run),
            case.least_h.map_or_else(|| "–".to_owned(), number),
        ];
        row.extend(campaign.choice(case.run).values.into_iter().map(number));
        row
    });
    let heads: Vec<&str> = heads.iter().map(String::as_str).collect();
    format!(
        "<h2>The worst runs</h2>\n<p>First those that ended early, then those without success, then by the least h of all \
         barriers from their deadlines on.</p>\n{}",
        table(&heads, 3, rows)
    )
}

/// What is varied, and how it was drawn.
fn varied(campaign: &Campaign) -> String {
    let sampling = match campaign.sampling() {
        Sampling::Random => "random",
        Sampling::LatinHypercube => "latin_hypercube",
        Sampling::Sobol => "sobol",
    };
    let mut html =
        format!("<h2>What was varied</h2>\n<p>Sampling {sampling}, seed {}.</p>\n", campaign.seed());
    if campaign.varied().is_empty() {
        return html + "<p>Nothing: all runs are alike but for their seeds.</p>\n";
    }
    let rows = campaign.varied().iter().map(|varied| {
        let unit = varied.unit.as_deref().unwrap_or_default();
        [&varied.name, &varied.distribution.to_string(), unit, &varied.description].map(escape).to_vec()
    });
    html += &table(&["quantity", "distribution", "unit", "meaning"], 4, rows);
    html
}

/// The numbers of all runs.
fn numbers(summary: &Summary) -> String {
    let spreads = summary.spreads.iter().filter(|spread| spread.count > 0);
    let rows = spreads.map(|s| {
        let texts = [&s.column, shown_unit(&s.unit)].map(escape);
        let numbers = [s.count.to_string(), number(s.min), number(s.mean), number(s.max)];
        texts.into_iter().chain(numbers).collect()
    });
    format!(
        "<h2>The numbers of all runs</h2>\n{}",
        table(&["number", "unit", "runs", "min", "mean", "max"], 2, rows)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn success_that_depends_on_a_value_is_found() {
        let count = 400_u32;
        let good: Vec<bool> = (0..count).map(|k| k % 20 < 10).collect();
        // Success depends on the first, with a threshold inside its range; the second is irrelevant.
        let decides: Vec<f64> =
            good.iter().enumerate().map(|(k, good)| if *good { k as f64 % 7.0 } else { -9.0 }).collect();
        let other: Vec<f64> = (0..count).map(|k| f64::from(k * 7919 % 401)).collect();
        assert!(dependence(&decides, &good) > 5.0 * dependence(&other, &good));
        assert_eq!(dependence(&other, &[true; 400]), 0.0);
        assert_eq!(dependence(&[], &[]), 0.0);
    }

    #[test]
    fn later_runs_without_success_are_drawn_too() {
        let mut sample = Sample { budget: 8, ..Sample::default() };
        // Every tenth run fails.
        let drawn: Vec<u64> = (0..100).filter(|&run| sample.take(run, run % 10 != 0)).collect();
        assert_eq!(drawn, [0, 1, 2, 3, 4, 5, 6, 7, 10, 20]);
        assert_eq!((sample.first(), &sample.runs), (8, &drawn));
        assert!(sample.good.iter().zip(&drawn).all(|(good, run)| *good == (run % 10 != 0)));
    }

    #[test]
    fn a_part_is_shown_as_all_or_nothing_only_if_it_is() {
        let shown = |part: f64| percent(part).trim_end_matches("\u{202f}%").to_owned();
        let cases = [
            (0.0, "0"),
            (1.0, "100"),
            (0.973, "97.3"),
            (0.999_996, "99.9996"),
            (4e-6, "0.0004"),
            (0.5, "50"),
        ];
        for (part, text) in cases {
            assert_eq!(shown(part), text);
        }
    }

    #[test]
    fn bars_have_round_widths() {
        for (width, wanted) in [(0.031, 0.05), (0.05, 0.05), (1.1, 2.0), (7.0, 10.0)] {
            assert!((round(width) - wanted).abs() < 1e-12 * wanted, "{width}: {}", round(width));
        }
    }
}
