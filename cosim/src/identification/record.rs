//! What was recorded of a plant: its states at samples and its inputs, held in between. Columns are found by the names of
//! the model's signals.

use punctual_fmu::configuration::{FilterConfiguration, VariableSection, nearest};
use punctual_fmu::text::number;
use punctual_fmu::units::{self, Fit, Said};

use crate::error::Error;
use crate::recording::{Column, Recording};

/// The column whose change separates recordings: where it changes, the state may jump.
pub const EPISODE: &str = "episode";
/// Part of the median by which the time between two samples may differ from it.
const JITTER: f64 = 0.05;
/// The fewest holds from which anything is concluded.
const FEWEST: usize = 20;

/// A recording without a jump: states at samples, and inputs held in between.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Episode {
    /// The instants of the samples, in s, increasing.
    pub times: Vec<f64>,
    /// The states at the samples, by state and in its unit.
    pub states: Vec<Vec<f64>>,
    /// The inputs from each sample on, by input and in its unit; that of the last sample is not used.
    pub inputs: Vec<Vec<f64>>,
}

impl Episode {
    /// The number of holds: one less than of samples.
    pub fn holds(&self) -> usize {
        self.times.len().saturating_sub(1)
    }

    /// The state at sample `k`.
    pub(super) fn state(&self, k: usize) -> Vec<f64> {
        self.states.iter().map(|series| series[k]).collect()
    }
}

/// Recordings of one plant, checked.
#[derive(Clone, Debug, PartialEq)]
pub struct Record {
    /// The states of the model.
    pub states: Vec<VariableSection>,
    /// The inputs of the model.
    pub inputs: Vec<VariableSection>,
    /// What was recorded.
    pub episodes: Vec<Episode>,
    /// The median time between two samples, in s.
    pub period: f64,
    /// What the user should know of how it was read.
    pub notes: Vec<String>,
}

/// The column of a signal of the model that the user names: `v` is in `speed`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Named {
    /// The state or input.
    pub signal: String,
    /// The column, or the variable of an FMU.
    pub column: String,
}

impl Named {
    /// Reads `signal=column`.
    ///
    /// # Errors
    ///
    /// A text of another form.
    pub fn parse(text: &str) -> Result<Self, Error> {
        match text.split_once('=').map(|(signal, column)| (signal.trim(), column.trim())) {
            Some((signal, column)) if !signal.is_empty() && !column.is_empty() => {
                Ok(Self { signal: signal.to_owned(), column: column.to_owned() })
            }
            _ => Err(Error::configuration("--column", format!("is {text:?}, must be like \"v=speed\""))),
        }
    }

    /// Refuses names of signals that the model does not have.
    pub(super) fn check(all: &[Self], c: &FilterConfiguration) -> Result<(), Error> {
        let known: Vec<_> = c.plant.states().into_iter().chain(c.plant.inputs()).map(|s| s.name).collect();
        match all.iter().find(|named| !known.contains(&named.signal)) {
            None => Ok(()),
            Some(named) => {
                let message =
                    format!("{:?} is no state or input, must be one of {}", named.signal, known.join(", "));
                Err(Error::configuration("--column", message))
            }
        }
    }
}

/// The names under which a signal is looked for, the likeliest first: `v` and `x.v` for a state, `a` and `u.a` for an input.
pub(super) fn names(signal: &str, is_input: bool) -> [String; 2] {
    let kind = if is_input { "u" } else { "x" };
    [signal.to_owned(), format!("{kind}.{signal}")]
}

impl Record {
    /// The signals of the model of `c` in `recordings`. `named` are those whose columns have names of their own.
    ///
    /// A column is that of a state `v` if it is called `v`, `x.v`, or `<component>.x.v` as in the CSV files of `punctual run`:
    /// of a filter, if there is one, since it tells what was measured and asked. Inputs are `a`, `u.a`, `<component>.u.a`.
    ///
    /// # Errors
    ///
    /// A signal without a column, or with several; numbers that are not finite; times that do not increase or are not regular;
    /// too few rows.
    pub fn of(c: &FilterConfiguration, recordings: &[Recording], named: &[Named]) -> Result<Self, Error> {
        Named::check(named, c)?;
        let (states, inputs) = (c.plant.states(), c.plant.inputs());
        let mut record = Self { states, inputs, episodes: Vec::new(), period: 0.0, notes: Vec::new() };
        for recording in recordings {
            record.add(recording, named)?;
        }
        record.completed()
    }

    /// Adds a recording.
    fn add(&mut self, recording: &Recording, named: &[Named]) -> Result<(), Error> {
        let signals = [(&self.states, false), (&self.inputs, true)];
        let mut notes = Vec::new();
        let mut found: [Vec<Vec<f64>>; 2] = Default::default();
        for ((signals, is_input), found) in signals.into_iter().zip(&mut found) {
            for signal in signals {
                let column = column(recording, signal, is_input, named)?;
                let [factor, offset] = conversion(&recording.columns()[column], signal, &mut notes)?;
                let values: Vec<f64> =
                    recording.column(column).map(|value| factor * value + offset).collect();
                // The inputs of the last row act on nothing that was recorded.
                let used = values.len().saturating_sub(usize::from(is_input));
                if let Some(k) = values[..used].iter().position(|value| !value.is_finite()) {
                    let (name, t) = (&recording.columns()[column].name, number(recording.times()[k]));
                    let message =
                        format!("is {} at t = {t} s, must be finite; cut those rows off", values[k]);
                    return Err(Error::configuration(format!("column {name}"), message));
                }
                found.push(if !is_input && signal.unit == "rad" { unwrapped(values) } else { values });
            }
        }
        let times = recording.times();
        if let Some(k) = times.iter().position(|t| !t.is_finite()) {
            let message = format!("is {} in row {}, must be finite", times[k], k + 1);
            return Err(Error::configuration("column time", message));
        }
        let [states, inputs] = found;
        let marks = recording.series(EPISODE);
        let is_cut =
            |k: usize| marks.as_ref().is_some_and(|marks| marks[k].to_bits() != marks[k - 1].to_bits());
        let mut begin = 0;
        for end in 1..=times.len() {
            if end < times.len() && !is_cut(end) {
                if times[end] <= times[end - 1] {
                    let message = format!(
                        "is {} in row {} after {}, must increase; a column {EPISODE:?} separates recordings in one file",
                        number(times[end]),
                        end + 1,
                        number(times[end - 1])
                    );
                    return Err(Error::configuration("column time", message));
                }
                continue;
            }
            let part = |all: &[Vec<f64>]| all.iter().map(|series| series[begin..end].to_vec()).collect();
            let times = times[begin..end].to_vec();
            self.episodes.push(Episode { times, states: part(&states), inputs: part(&inputs) });
            begin = end;
        }
        self.notes.extend(notes);
        Ok(())
    }

    /// Checks the samples, and finds the period.
    pub(super) fn completed(mut self) -> Result<Self, Error> {
        let lengths = |e: &Episode| e.times.windows(2).map(|t| t[1] - t[0]).collect::<Vec<_>>();
        let mut all: Vec<f64> = self.episodes.iter().flat_map(lengths).collect();
        if all.len() < FEWEST {
            let message = format!("has {} holds between samples, must have at least {FEWEST}", all.len());
            return Err(Error::configuration("recording", message));
        }
        all.sort_by(f64::total_cmp);
        self.period = all[all.len() / 2];
        for episode in &mut self.episodes {
            // The last step of a run may be shorter.
            let lengths = lengths(episode);
            if lengths.last().is_some_and(|last| *last < self.period * (1.0 - JITTER)) {
                episode.times.pop();
                let rows = episode.times.len();
                episode.states.iter_mut().chain(&mut episode.inputs).for_each(|series| series.truncate(rows));
            }
        }
        for episode in &self.episodes {
            let irregular = |t: &&[f64]| ((t[1] - t[0]) / self.period - 1.0).abs() > JITTER;
            if let Some(t) = episode.times.windows(2).find(irregular) {
                let message = format!(
                    "goes from {} to {} s, must go on by {} s, the median, to within {} %: resample it, or give the parts as \
                     recordings of their own",
                    number(t[0]),
                    number(t[1]),
                    number(self.period),
                    100.0 * JITTER
                );
                return Err(Error::configuration("column time", message));
            }
        }
        self.episodes.retain(|episode| episode.holds() > 0);
        Ok(self)
    }

    /// The number of holds.
    pub fn holds(&self) -> usize {
        self.episodes.iter().map(Episode::holds).sum()
    }

    /// The recorded time, in s.
    pub fn duration(&self) -> f64 {
        let length =
            |e: &Episode| e.times.last().zip(e.times.first()).map_or(0.0, |(end, begin)| end - begin);
        self.episodes.iter().map(length).sum()
    }

    /// The least and the largest value of input `j`, in its unit.
    pub fn input_range(&self, j: usize) -> [f64; 2] {
        range(self.episodes.iter().flat_map(|e| &e.inputs[j][..e.holds()]))
    }

    /// The least and the largest value of state `i`, in its unit.
    pub fn state_range(&self, i: usize) -> [f64; 2] {
        range(self.episodes.iter().flat_map(|e| &e.states[i]))
    }

    /// A table of it, with a column of episodes, that reads back as the same.
    pub fn recording(&self) -> Recording {
        let named = |(signals, is_input): (&Vec<VariableSection>, bool)| {
            let column = move |s: &VariableSection| Column {
                name: names(&s.name, is_input)[1].clone(),
                unit: Some(s.unit.clone()),
            };
            signals.iter().map(column).collect::<Vec<_>>()
        };
        let mut columns = vec![Column { name: EPISODE.to_owned(), unit: None }];
        columns.extend([(&self.states, false), (&self.inputs, true)].into_iter().flat_map(named));
        let mut recording = Recording::new(columns);
        let mut begin = 0.0;
        for (i, episode) in self.episodes.iter().enumerate() {
            for (k, t) in episode.times.iter().enumerate() {
                let mut row = vec![i as f64];
                row.extend(episode.states.iter().chain(&episode.inputs).map(|series| series[k]));
                recording.push(begin + t - episode.times[0], &row);
            }
            begin = recording.times().last().copied().unwrap_or(0.0) + self.period;
        }
        recording
    }
}

/// The least and the largest of `values`.
fn range<'a>(values: impl Iterator<Item = &'a f64>) -> [f64; 2] {
    values.fold([f64::INFINITY, f64::NEG_INFINITY], |[min, max], v| [v.min(min), v.max(max)])
}

/// The position of the column of `signal`.
fn column(
    recording: &Recording,
    signal: &VariableSection,
    is_input: bool,
    named: &[Named],
) -> Result<usize, Error> {
    let name = &signal.name;
    let what = if is_input { "input" } else { "state" };
    if let Some(Named { column, .. }) = named.iter().find(|named| named.signal == *name) {
        return recording.index_of(column).ok_or_else(|| {
            let known: Vec<&str> = recording.columns().iter().map(|c| c.name.as_str()).collect();
            let message = format!("there is no column {column:?} for {name}{}", nearest(column, &known));
            Error::configuration("--column", message)
        });
    }
    let own = names(name, is_input);
    if let Some(exact) = own.iter().find_map(|own| recording.index_of(own)) {
        return Ok(exact);
    }
    // Those of components, where the signals of a filter are what was measured and asked.
    let suffix = format!(".{}", own[1]);
    let columns = recording.columns().iter().enumerate();
    let found: Vec<(usize, &str)> =
        columns.filter_map(|(i, c)| Some((i, c.name.strip_suffix(&suffix)?))).collect();
    let is_filter = |component: &str| recording.index_of(&format!("{component}.status")).is_some();
    let filters: Vec<_> = found.iter().filter(|(_, component)| is_filter(component)).collect();
    match (&filters[..], &found[..]) {
        ([(only, _)], _) | ([], [(only, _)]) => Ok(*only),
        ([], []) => {
            let known: Vec<_> = recording.columns().iter().take(12).map(|c| c.name.as_str()).collect();
            let message = format!(
                "is missing: the {what} {name} of the model is looked for as {:?}, {:?} or \"<component>{suffix}\" among {}; \
                 name its column by --column {name}=COLUMN",
                own[0],
                own[1],
                known.join(", ")
            );
            Err(Error::configuration(format!("column {name}"), message))
        }
        _ => {
            let all: Vec<_> = found.iter().map(|(i, _)| recording.columns()[*i].name.as_str()).collect();
            let message = format!("may be any of {}; name one by --column {name}={}", all.join(", "), all[0]);
            Err(Error::configuration(format!("column {name}"), message))
        }
    }
}

/// Factor and offset from the unit of a column to that of the model; a note where they are not 1 and 0.
fn conversion(column: &Column, signal: &VariableSection, notes: &mut Vec<String>) -> Result<[f64; 2], Error> {
    let Some(unit) = &column.unit else { return Ok([1.0, 0.0]) };
    converted(&Said { name: Some(unit), ..Said::default() }, &column.name, signal, notes)
}

/// The same for what is said of a unit.
pub(super) fn converted(
    from: &Said<'_>,
    name: &str,
    signal: &VariableSection,
    notes: &mut Vec<String>,
) -> Result<[f64; 2], Error> {
    let to = Said { name: Some(&signal.unit), ..Said::default() };
    match units::fit(from, &to) {
        Ok(Fit::Scaled { factor, offset }) => {
            let given = from.name.unwrap_or("its unit");
            notes.push(format!("{name}: converted from {given} to {}", signal.unit));
            Ok([factor, offset])
        }
        Ok(Fit::Same | Fit::Unknown) => Ok([1.0, 0.0]),
        Err(reason) => {
            let given = from.name.unwrap_or("another unit");
            let message =
                format!("is in {given}, but {} of the model is in {}, {reason}", signal.name, signal.unit);
            Err(Error::configuration(format!("column {name}"), message))
        }
    }
}

/// An angle in rad without the jumps of a full turn that a measurement between -pi and pi makes.
fn unwrapped(mut values: Vec<f64>) -> Vec<f64> {
    const TURN: f64 = core::f64::consts::TAU;
    for k in 1..values.len() {
        let turns = ((values[k] - values[k - 1]) / TURN).round();
        values[k] -= turns * TURN;
    }
    values
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turns_are_undone() {
        let found = unwrapped(vec![3.0, -3.2 + 0.1, 3.1, 3.2 - core::f64::consts::TAU]);
        let wanted = [3.0, -3.1 + core::f64::consts::TAU, 3.1, 3.2];
        assert!(found.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?}");
    }
}
