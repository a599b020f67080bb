//! The one place that prints: results on stdout, talk and progress on stderr. A reader that went away (a closed
//! pipe) is no error.

use std::io::{self, IsTerminal, Write};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};
use punctual_core::elementary;

/// Prints a result: `text` and a line break, on stdout.
pub fn result(text: &str) {
    let mut out = io::stdout().lock();
    // Nobody is left to tell of a failure.
    let _ = writeln!(out, "{text}").and_then(|()| out.flush());
}

/// Prints a result as JSON on stdout.
pub fn json(value: &impl serde::Serialize) {
    match serde_json::to_string_pretty(value) {
        Ok(text) => result(&text),
        Err(error) => note(&format!("cannot be written as JSON: {error}")),
    }
}

/// Prints something that is not a result, on stderr.
pub fn note(text: &str) {
    let _ = writeln!(io::stderr().lock(), "{text}");
}

/// Prints an error, on stderr.
pub fn error(error: &dyn std::fmt::Display) {
    note(&format!("{} {error}", console::style("error:").for_stderr().red().bold()));
}

/// `words`, green where they tell of something `good`, else red. Plain where stdout is no terminal, and under `NO_COLOR`.
pub fn verdict(words: &str, good: bool) -> String {
    let words = console::style(words);
    if good { words.green() } else { words.red() }.to_string()
}

/// A progress bar on stderr that shows after a second, and only on a terminal.
#[derive(Debug)]
pub struct Progress {
    message: String,
    begin: Instant,
    calls: u64,
    bar: Option<ProgressBar>,
    wanted: bool,
}

/// Calls of [`Progress::update`] between two looks at the clock.
const CALLS: u64 = 512;
/// Time that a run takes before the bar shows.
const PATIENCE: Duration = Duration::from_secs(1);
/// Parts the bar is divided into.
const PARTS: u64 = 1000;

impl Progress {
    /// A bar for work named `message`.
    pub fn new(message: impl Into<String>) -> Self {
        let wanted = io::stderr().is_terminal();
        Self { message: message.into(), begin: Instant::now(), calls: 0, bar: None, wanted }
    }

    /// Says that `fraction` (0 to 1) is done. Cheap enough for every step.
    pub fn update(&mut self, fraction: f64) {
        self.calls += 1;
        if self.calls.is_multiple_of(CALLS) {
            self.show(fraction);
        }
    }

    /// Updates the bar at every call, for calls that are far between.
    pub fn show(&mut self, fraction: f64) {
        if !self.wanted {
            return;
        }
        if self.bar.is_none() && self.begin.elapsed() > PATIENCE {
            let bar =
                ProgressBar::new(PARTS).with_message(self.message.clone()).with_elapsed(self.begin.elapsed());
            // The template is a constant; with a broken one the default style stays.
            if let Ok(style) = ProgressStyle::with_template("{msg} {wide_bar} {percent:>3} %  {eta} left") {
                bar.set_style(style);
            }
            self.bar = Some(bar);
        }
        if let Some(bar) = &self.bar {
            bar.set_position((fraction.clamp(0.0, 1.0) * PARTS as f64) as u64);
        }
    }
}

/// A counter of things done on stderr, with their rate and the time left; on a terminal only. Several threads
/// may tell it.
#[derive(Debug)]
pub struct Counter(ProgressBar);

impl Counter {
    /// Counts `all` of the things named `what`, `done` of which are done.
    pub fn new(what: &str, done: u64, all: u64) -> Self {
        let bar = ProgressBar::new(all).with_message(what.to_owned());
        // As above: with a broken template the default style stays.
        if let Ok(style) = ProgressStyle::with_template(
            "{human_pos} of {human_len} {msg} {wide_bar} {per_sec}  {elapsed} gone, {eta} left",
        ) {
            bar.set_style(style);
        }
        bar.set_position(done);
        bar.reset_eta();
        Self(bar)
    }

    /// Says that `done` are done.
    pub fn update(&self, done: u64) {
        self.0.set_position(done);
    }
}

impl Drop for Counter {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

/// Text columns lined up: the first row is the header; columns marked `true` in `right` are set to
/// the right.
pub fn table(rows: &[Vec<String>], right: &[bool]) -> String {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let width = |c: usize| rows.iter().filter_map(|row| row.get(c)).map(|s| shown(s)).max().unwrap_or(0);
    let widths: Vec<usize> = (0..columns).map(width).collect();
    let line = |row: &Vec<String>| {
        let cells = row.iter().enumerate().map(|(c, cell)| {
            let room = " ".repeat(widths[c] - shown(cell));
            if right.get(c) == Some(&true) { format!("{room}{cell}") } else { format!("{cell}{room}") }
        });
        cells.collect::<Vec<_>>().join("  ").trim_end().to_owned()
    };
    let mut lines: Vec<String> = rows.iter().map(line).collect();
    if lines.len() > 1 {
        let rule = widths.iter().map(|w| "─".repeat(*w)).collect::<Vec<_>>().join("  ");
        lines.insert(1, rule);
    }
    lines.join("\n")
}

/// Number of columns of a terminal that `cell` takes.
fn shown(cell: &str) -> usize {
    console::measure_text_width(cell)
}

/// A [`number`] with its unit, where it has one.
pub fn quantity(value: f64, unit: &str) -> String {
    match unit {
        "1" | "" => number(value),
        _ => format!("{} {unit}", number(value)),
    }
}

/// A number for people: six significant digits, powers of ten only where they help.
pub fn number(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    if !value.is_finite() {
        return value.to_string();
    }
    let size = value.abs();
    let text = if (1e-4..1e7).contains(&size) {
        let digits = (5 - elementary::log10(size).floor() as i32).clamp(0, 9) as usize;
        format!("{value:.digits$}")
    } else {
        let text = format!("{value:.5e}");
        let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
        return format!("{}e{exponent}", trimmed(mantissa));
    };
    trimmed(&text).to_owned()
}

fn trimmed(text: &str) -> &str {
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        let cases = [
            (0.0, "0"),
            (10.0, "10"),
            (-31949.7754, "-31949.8"),
            (0.001, "0.001"),
            (1.0 / 3.0, "0.333333"),
            (1.5e-9, "1.5e-9"),
            (123_456_789.0, "1.23457e8"),
            (f64::INFINITY, "inf"),
        ];
        for (value, text) in cases {
            assert_eq!(number(value), text);
        }
    }

    #[test]
    fn columns_line_up() {
        let rows = [vec!["name".into(), "n".into()], vec!["ä".into(), "10".into()]];
        assert_eq!(table(&rows, &[false, true]), "name   n\n────  ──\nä     10");
    }
}
