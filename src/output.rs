//! The only module that prints: results on stdout, messages and progress on stderr. A reader that went away
//! (a closed pipe) is not an error.

use std::io::{self, IsTerminal, Write};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};
pub use punctual_fmu::text::{labelled, number, number_above, number_below, quantity, shown_unit};
pub use punctual_pictures::columns::table;

/// Prints a result: `text` and a line break, on stdout.
pub fn result(text: &str) {
    let mut out = io::stdout().lock();
    // There is nobody left to report a failure to.
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

/// Prints a warning to the user on stderr; the command goes on.
pub fn warning(text: &str) {
    note(&format!("{} {text}", console::style("warning:").for_stderr().yellow().bold()));
}

/// Merges `notes` of the form "name: text" with the same text into one note, "name, name: text". Others are
/// unchanged.
pub fn grouped(notes: impl IntoIterator<Item = String>) -> Vec<String> {
    let mut groups: Vec<(Vec<String>, String)> = Vec::new();
    for note in notes {
        let parts = note.split_once(": ").filter(|(name, _)| !name.contains(' '));
        let (name, text) = parts.map_or((None, note.as_str()), |(name, text)| (Some(name.to_owned()), text));
        match groups.iter_mut().find(|(names, known)| known == text && names.is_empty() == name.is_none()) {
            Some((names, _)) => names.extend(name),
            None => groups.push((name.into_iter().collect(), text.to_owned())),
        }
    }
    let shown = |(names, text): (Vec<String>, String)| match &names[..] {
        [] => text,
        names => format!("{}: {text}", names.join(", ")),
    };
    groups.into_iter().map(shown).collect()
}

/// Prints an error, on stderr.
pub fn error(error: &dyn std::fmt::Display) {
    note(&format!("{} {error}", console::style("error:").for_stderr().red().bold()));
}

/// `words`, green if the news is `good`, else red. Uncoloured if stdout is not a terminal, and under
/// `NO_COLOR`.
pub fn verdict(words: &str, good: bool) -> String {
    let words = console::style(words);
    if good { words.green() } else { words.red() }.to_string()
}

/// A progress bar on stderr that appears after a second, and only on a terminal.
#[derive(Debug)]
pub struct Progress {
    message: String,
    begin: Instant,
    calls: u64,
    bar: Option<ProgressBar>,
    wanted: bool,
}

/// Calls of [`Progress::update`] between two checks of the clock.
const CALLS: u64 = 512;
/// Time before the bar appears.
const PATIENCE: Duration = Duration::from_secs(1);
/// Number of parts of the bar.
const PARTS: u64 = 1000;

impl Progress {
    /// A bar for work named `message`.
    pub fn new(message: impl Into<String>) -> Self {
        let wanted = io::stderr().is_terminal();
        Self { message: message.into(), begin: Instant::now(), calls: 0, bar: None, wanted }
    }

    /// Reports that `fraction` (0 to 1) is done. Cheap enough for every step.
    pub fn update(&mut self, fraction: f64) {
        self.calls += 1;
        if self.calls.is_multiple_of(CALLS) {
            self.show(fraction);
        }
    }

    /// Updates the bar at every call, for infrequent calls.
    pub fn show(&mut self, fraction: f64) {
        if !self.wanted {
            return;
        }
        if self.bar.is_none() && self.begin.elapsed() > PATIENCE {
            let bar =
                ProgressBar::new(PARTS).with_message(self.message.clone()).with_elapsed(self.begin.elapsed());
            // The template is a constant; if it were broken, the default style would remain.
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

/// A counter on stderr, with the rate and the time left; only on a terminal. Several threads may update it.
#[derive(Debug)]
pub struct Counter(ProgressBar);

impl Counter {
    /// Counts up to `all` of the things named `what`; `done` of them are done already.
    pub fn new(what: &str, done: u64, all: u64) -> Self {
        let bar = ProgressBar::new(all).with_message(what.to_owned());
        // As above: with a broken template, the default style would remain.
        if let Ok(style) = ProgressStyle::with_template(
            "{human_pos} of {human_len} {msg} {wide_bar} {per_sec}  {elapsed} gone, {eta} left",
        ) {
            bar.set_style(style);
        }
        bar.set_position(done);
        bar.reset_eta();
        Self(bar)
    }

    /// Reports that `done` are done.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_text_is_said_once() {
        let notes =
            ["goal: late", "the run ends", "rock: late", "the run ends", "rock: left"].map(str::to_owned);
        assert_eq!(grouped(notes), ["goal, rock: late", "the run ends", "rock: left"]);
    }
}
