//! References in an FMU: inputs and the results that they give, by which a tool can check itself. They lie where the
//! FMI layered standard for references (`org.fmi-standard.fmi-ls-ref`, 1.0.0-alpha.1, for FMI 2.0 and 3.0) has them: a
//! manifest that names files and their roles, beside it the tables as CSV.
//!
//! A row of the inputs holds from its time until the next. A row of the results is what outputs are at its time; the
//! first one is read after the initialisation. Each further one is the end of a step from the row before. An array is
//! one column, its numbers with blanks between them.

use std::fmt::Write as _;
use std::rc::Rc;

use roxmltree::Document;

use crate::error::{Error, FmuProblem};
use crate::host::{Causality, DataType, Description, Fmu, Slave, Variable};
use crate::recording;

/// The folder in the archive.
const FOLDER: &str = "extra/org.fmi-standard.fmi-ls-ref";
/// The manifest in it.
const MANIFEST: &str = "fmi-ls-manifest.xml";
/// The tables that this program writes.
const INPUTS: &str = "inputs.csv";
const RESULTS: &str = "results.csv";
/// The name of an instance that runs.
const INSTANCE: &str = "references";
/// The greatest number of steps of an experiment.
const STEPS: u32 = 100;

/// A table of times and values, by the names of variables or arrays.
#[derive(Clone, Debug, Default, PartialEq)]
struct Table {
    names: Vec<String>,
    times: Vec<f64>,
    /// Row by row, for each name all values.
    rows: Vec<Vec<Vec<f64>>>,
}

/// The references that an FMU carries.
#[derive(Clone, Debug)]
pub struct References {
    inputs: Option<Table>,
    results: Table,
}

/// The greatest difference of an output from its reference.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    /// The output, with its place in an array.
    pub name: String,
    /// The time in s.
    pub time: f64,
    /// What the FMU gives.
    pub value: f64,
    /// What the reference says.
    pub reference: f64,
}

impl References {
    /// The references of `fmu`; `None` where it carries none.
    ///
    /// # Errors
    ///
    /// A manifest or table that cannot be read, or a manifest that names no results.
    pub fn of(fmu: &Fmu) -> Result<Option<Self>, Error> {
        let Some(manifest) = fmu.text(&format!("{FOLDER}/{MANIFEST}")) else { return Ok(None) };
        let problem = |text: String| Error::fmu(fmu.path(), FmuProblem::References(text));
        let document = Document::parse(&manifest).map_err(|e| problem(format!("{MANIFEST}: {e}")))?;
        let table = |role: &str| {
            let mut related = document.root_element().children().filter(|n| n.has_tag_name("Related"));
            let named = related
                .find(|n| n.attribute("role") == Some(role) && n.attribute("type") == Some("text/csv"));
            let Some(source) = named.and_then(|n| n.attribute("source")) else { return Ok(None) };
            let text = fmu.text(&format!("{FOLDER}/{source}"));
            let text =
                text.ok_or_else(|| problem(format!("{MANIFEST} names {source}, which is not there")))?;
            let table = Table::parse(&text, |name| is_number(fmu, name));
            table.map(Some).map_err(|e| problem(format!("{source}: {e}")))
        };
        let results =
            table("result")?.ok_or_else(|| problem(format!("{MANIFEST} names no results as text/csv")))?;
        Ok(Some(Self { inputs: table("testcase")?, results }))
    }

    /// Makes references: the suggested experiment of `fmu`, at most a hundred steps, with real inputs that move.
    ///
    /// # Errors
    ///
    /// The FMU fails.
    pub fn make(fmu: &Rc<Fmu>) -> Result<Self, Error> {
        let description = fmu.description();
        let suggested = description.default_experiment.unwrap_or_default();
        let start = suggested.start_time.unwrap_or(0.0);
        let step = suggested.step_size.unwrap_or(0.01);
        let stop = suggested.stop_time.unwrap_or(start + step * f64::from(STEPS));
        let steps = ((stop - start) / step).round().clamp(1.0, f64::from(STEPS)) as u32;
        let times: Vec<f64> = (0..=steps).map(|k| start + f64::from(k) * step).collect();
        let is_real = |v: &&Variable| v.of == DataType::Float64;
        let columns = |causality| {
            let all = description.variables.iter().filter(move |v| v.causality == causality && v.is_number());
            all.filter(|v| v.element == 0)
        };
        let moving: Vec<&Variable> = columns(Causality::Input).filter(is_real).collect();
        let mut inputs = Table { names: names(description, &moving), times: times.clone(), rows: Vec::new() };
        for k in 0..times.len() {
            let row = moving.iter().map(|first| moved(array(description, first), k)).collect();
            inputs.rows.push(row);
        }
        let outputs: Vec<&Variable> = columns(Causality::Output).collect();
        let mut results = Table { names: names(description, &outputs), times, rows: Vec::new() };
        run(fmu, Some(&inputs), &results.clone(), |row| results.rows.push(row))?;
        Ok(Self { inputs: (!moving.is_empty()).then_some(inputs), results })
    }

    /// The files for the archive, by their places.
    pub fn files(&self) -> Vec<(String, String)> {
        let mut related = String::new();
        let mut files = Vec::new();
        let tables = [(self.inputs.as_ref(), INPUTS, "testcase"), (Some(&self.results), RESULTS, "result")];
        for (table, source, role) in tables {
            let Some(table) = table else { continue };
            let what = match role {
                "result" => "Outputs of the default experiment, which any importer should find",
                _ => "Inputs of the default experiment, each row until the next",
            };
            // Writing to a text cannot fail.
            let _ = writeln!(
                related,
                "  <Related type=\"text/csv\" source=\"{source}\" role=\"{role}\" description=\"{what}\"/>"
            );
            files.push((format!("{FOLDER}/{source}"), table.text()));
        }
        let manifest = format!(
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
             <fmiReferences xmlns:fmi-ls=\"http://fmi-standard.org/fmi-ls-manifest\" \
             fmi-ls:fmi-ls-name=\"org.fmi-standard.fmi-ls-ref\" fmi-ls:fmi-ls-version=\"1.0.0-alpha.1\" \
             fmi-ls:fmi-ls-description=\"Layered Standard providing information on related files included in an FMU.\">\n\
             {related}</fmiReferences>\n"
        );
        files.push((format!("{FOLDER}/{MANIFEST}"), manifest));
        files
    }

    /// Runs `fmu` on the inputs, and compares with the results: the greatest difference of each output that differs by
    /// more than `tolerance` (dimensionless, of the largest number of its column; 0: not at all).
    ///
    /// # Errors
    ///
    /// The FMU fails, or a column is no variable of it.
    pub fn compare(&self, fmu: &Rc<Fmu>, tolerance: f64) -> Result<Vec<Difference>, Error> {
        let mut found: Vec<Vec<Vec<f64>>> = Vec::new();
        run(fmu, self.inputs.as_ref(), &self.results, |row| found.push(row))?;
        let mut differences = Vec::new();
        for (c, name) in self.results.names.iter().enumerate() {
            let count = self.results.rows.first().map_or(0, |row| row[c].len());
            for element in 0..count {
                let pairs = self.results.rows.iter().zip(&found).zip(&self.results.times);
                let pairs = pairs.map(|((want, got), time)| (*time, got[c][element], want[c][element]));
                let size = pairs.clone().map(|(_, _, want)| want.abs()).fold(0.0, f64::max);
                let distance = |value: f64, want: f64| match value.to_bits() == want.to_bits() {
                    true => 0.0,
                    false if value.is_nan() && want.is_nan() => 0.0,
                    false if value.is_nan() || want.is_nan() => f64::INFINITY,
                    false => (value - want).abs(),
                };
                let worst = pairs.max_by(|a, b| distance(a.1, a.2).total_cmp(&distance(b.1, b.2)));
                let Some((time, value, reference)) = worst else { continue };
                if distance(value, reference) > tolerance * size {
                    let name =
                        if count == 1 { name.clone() } else { format!("{name}, element {}", element + 1) };
                    differences.push(Difference { name, time, value, reference });
                }
            }
        }
        Ok(differences)
    }
}

/// The scalars of the array that begins with `first`.
fn array<'a>(description: &'a Description, first: &Variable) -> &'a [Variable] {
    let at = description.variables.iter().position(|v| v == first).unwrap_or(0);
    &description.variables[at..at + first.count]
}

/// The names of columns: of arrays their own, without the place of the first element.
fn names(description: &Description, columns: &[&Variable]) -> Vec<String> {
    let name = |first: &&Variable| {
        let at = description.variables.iter().position(|v| v == *first);
        let own = description.arrays.iter().find(|array| Some(array.first) == at);
        own.map_or_else(|| first.name.clone(), |array| array.name.clone())
    };
    columns.iter().map(name).collect()
}

/// The values of an input at step `k`: its start values, and up to a tenth more in steps of an eighth of that, within
/// the range.
fn moved(array: &[Variable], k: usize) -> Vec<f64> {
    let value = |v: &Variable| {
        let start = v.start.unwrap_or(0.0);
        let share = ((k + 3 * v.element) % 8) as f64 / 8.0;
        let value = start + 0.1 * start.abs().max(1.0) * share;
        value.max(v.range.0.unwrap_or(f64::NEG_INFINITY)).min(v.range.1.unwrap_or(f64::INFINITY))
    };
    array.iter().map(value).collect()
}

/// A column as the FMU has it: type, value reference and number of values.
type Column = (DataType, u32, usize);

/// Whether a column is, as far as the FMU knows it, one of numbers.
fn is_number(fmu: &Fmu, name: &str) -> bool {
    let description = fmu.description();
    let at = description.index_of(name).or_else(|| description.array(name).map(|array| array.first));
    at.and_then(|at| description.variables.get(at)).is_none_or(Variable::is_number)
}

/// The columns of a table, which must be as wide as the variables.
fn columns(fmu: &Fmu, table: &Table) -> Result<Vec<Column>, Error> {
    let description = fmu.description();
    let find = |(c, name): (usize, &String)| {
        let problem = |text: String| Error::fmu(fmu.path(), FmuProblem::References(text));
        let array = description.array(name).map(|array| array.first);
        let at = description.index_of(name).or(array).filter(|at| description.variables[*at].is_number());
        let Some(at) = at else {
            return Err(problem(format!("there is no variable {name:?} that is a number")));
        };
        let variable = &description.variables[at];
        let width = table.rows.first().map(|row| row[c].len());
        if width.is_some_and(|width| width != variable.count) {
            let width = width.unwrap_or_default();
            return Err(problem(format!(
                "{name} has {width} numbers in a row; must have {}",
                variable.count
            )));
        }
        Ok((variable.of, variable.value_reference, variable.count))
    };
    table.names.iter().enumerate().map(find).collect()
}

/// Runs the FMU over the times of `wanted`, with these inputs, and hands each row of its columns to `row`.
fn run(
    fmu: &Rc<Fmu>,
    inputs: Option<&Table>,
    wanted: &Table,
    mut row: impl FnMut(Vec<Vec<f64>>),
) -> Result<(), Error> {
    let outputs = columns(fmu, wanted)?;
    let given = inputs.map(|table| columns(fmu, table)).transpose()?.unwrap_or_default();
    let mut slave = fmu.instantiate(fmu.description(), INSTANCE)?;
    let (Some(&start), Some(&stop)) = (wanted.times.first(), wanted.times.last()) else { return Ok(()) };
    slave.setup_experiment(start, stop, None)?;
    slave.enter_initialization_mode()?;
    set(&mut *slave, &given, inputs, start)?;
    slave.exit_initialization_mode()?;
    row(read(&mut *slave, &outputs)?);
    for pair in wanted.times.windows(2) {
        set(&mut *slave, &given, inputs, pair[0])?;
        slave.do_step(pair[0], pair[1] - pair[0])?;
        row(read(&mut *slave, &outputs)?);
    }
    slave.terminate()
}

/// Sets the inputs of the last row at or before `time`.
fn set(slave: &mut dyn Slave, columns: &[Column], inputs: Option<&Table>, time: f64) -> Result<(), Error> {
    let Some(table) = inputs else { return Ok(()) };
    let at = table.times.partition_point(|t| *t <= time).saturating_sub(1);
    let Some(row) = table.rows.get(at) else { return Ok(()) };
    for ((of, reference, _), values) in columns.iter().zip(row) {
        slave.set(*of, &[*reference], values)?;
    }
    Ok(())
}

fn read(slave: &mut dyn Slave, columns: &[Column]) -> Result<Vec<Vec<f64>>, Error> {
    let mut row = Vec::with_capacity(columns.len());
    for (of, reference, count) in columns {
        let mut values = vec![f64::NAN; *count];
        slave.get(*of, &[*reference], &mut values)?;
        row.push(values);
    }
    Ok(row)
}

impl Table {
    fn text(&self) -> String {
        let mut text = "time".to_owned();
        for name in &self.names {
            text.push(',');
            text.push_str(&recording::quoted(name));
        }
        text.push('\n');
        for (time, row) in self.times.iter().zip(&self.rows) {
            // The shortest text that reads back to the same double.
            let _ = write!(text, "{time:?}");
            for values in row {
                let values: Vec<String> = values.iter().map(|value| format!("{value:?}")).collect();
                let _ = write!(text, ",{}", values.join(" "));
            }
            text.push('\n');
        }
        text
    }

    /// Reads a table. Columns that are no numbers, but texts or bytes, are left out.
    fn parse(text: &str, is_number: impl Fn(&str) -> bool) -> Result<Self, String> {
        let mut lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
        let head = fields(lines.next().ok_or("is empty")?.1);
        let width = head.len();
        let kept: Vec<bool> = head.iter().enumerate().map(|(c, name)| c == 0 || is_number(name)).collect();
        let names = head.into_iter().zip(&kept).skip(1).filter(|(_, kept)| **kept).map(|(name, _)| name);
        let mut table = Self { names: names.collect(), ..Self::default() };
        for (number, line) in lines {
            let number = number + 1;
            let cells = fields(line);
            if cells.len() != width {
                return Err(format!("line {number} has {} fields; must have {width}", cells.len()));
            }
            let mut numbers = Vec::new();
            for (cell, _) in cells.iter().zip(&kept).filter(|(_, kept)| **kept) {
                let values: Result<Vec<f64>, _> = cell.split_whitespace().map(value).collect();
                numbers.push(values.map_err(|word| format!("line {number}: {word:?} is no number"))?);
            }
            let time = numbers.remove(0);
            let [time] = time[..] else { return Err(format!("line {number} has no time")) };
            if !time.is_finite() {
                return Err(format!("line {number}: the time is {time}; must be finite"));
            }
            if table.times.last().is_some_and(|last| *last >= time) {
                return Err(format!("line {number}: the time {time} is not after the one before"));
            }
            let widths = |row: &Vec<Vec<f64>>| row.iter().map(Vec::len).collect::<Vec<_>>();
            if table.rows.first().is_some_and(|first| widths(first) != widths(&numbers)) {
                return Err(format!("line {number} has other numbers of values than the first"));
            }
            table.times.push(time);
            table.rows.push(numbers);
        }
        Ok(table)
    }
}

/// A number, or a truth value.
fn value(word: &str) -> Result<f64, String> {
    match word {
        "true" => Ok(1.0),
        "false" => Ok(0.0),
        word => word.parse().map_err(|_| word.to_owned()),
    }
}

/// The fields of a line of CSV.
fn fields(line: &str) -> Vec<String> {
    let mut fields = vec![String::new()];
    let (mut inside, mut chars) = (false, line.chars().peekable());
    while let Some(c) = chars.next() {
        let last = fields.len() - 1;
        match c {
            '"' if inside && chars.peek() == Some(&'"') => {
                chars.next();
                fields[last].push('"');
            }
            '"' => inside = !inside,
            ',' if !inside => fields.push(String::new()),
            c => fields[last].push(c),
        }
    }
    fields
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_reads_back_as_it_was_written() {
        let table = Table {
            names: vec!["u".into(), "a \"b\", c".into()],
            times: vec![0.0, 0.1],
            rows: vec![vec![vec![1.0, -0.0], vec![f64::INFINITY]], vec![vec![0.1 + 0.2, 1e-300], vec![5.0]]],
        };
        assert_eq!(Table::parse(&table.text(), |_| true).unwrap(), table);
        let without = Table::parse(&table.text(), |name| name == "u").unwrap();
        assert_eq!((without.names, without.rows[1].len()), (vec!["u".to_owned()], 1));
    }

    #[test]
    fn each_defect_of_a_table_is_told() {
        for (text, expected) in [
            ("", "is empty"),
            ("time,y\n0,1\n1", "line 3 has 1 fields; must have 2"),
            ("time,y\n0,one", "line 2: \"one\" is no number"),
            ("time,y\n0,1\n0,1", "line 3: the time 0 is not after the one before"),
            ("time,y\n,1", "line 2 has no time"),
            ("time,y\nnan,1", "line 2: the time is NaN; must be finite"),
            ("time,y\n0,1 2\n1,1", "line 3 has other numbers of values than the first"),
        ] {
            assert_eq!(Table::parse(text, |_| true).unwrap_err(), expected);
        }
    }
}
