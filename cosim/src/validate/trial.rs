//! Trial of an FMU. `run` starts this program again, and [`perform`] makes the trial there. The FMU runs only
//! there, so that its crash, hang or `exit()` is a finding.

use std::collections::HashSet;
use std::ffi::OsString;
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::time::{Duration, Instant};

use super::finding::{Finding, Findings, Place, severity};
use crate::error::Error;
use crate::host::{
    Archive, Causality, DataType, Description, Fmu, Slave, Status, Variability, Variable, Version, journal,
};
use crate::isolation::{self, Break, Child, End, Voice};

/// The name of the trial's instance.
const INSTANCE: &str = "trial";
/// The place that findings name.
const PLACE: &str = "trial";
/// The greatest number of steps of one pass.
const STEPS: u32 = 10;
/// The fraction of the time limit that the steps of one pass may take. A slow FMU makes fewer steps.
const SHARE_OF_PASS: f64 = 0.2;
/// The step in seconds if the FMU suggests none.
const STEP: f64 = 0.01;
/// Allowed relative difference of a real value from its start value, since decimals can be parsed
/// differently.
const CLOSE: f64 = 1e-12;

/// The greatest number of pairs of an output and an input whose derivatives are compared.
const PAIRS: usize = 50;
/// The change of inputs for difference quotients, relative to the size of the input.
const DIFFERENCE: f64 = 1e-6;
/// Allowed relative difference of a derivative from a difference quotient, which is no more accurate than
/// that.
const AGREE: f64 = 1e-4;
/// Allowed relative difference between the adjoint and the directional derivative; both are exact.
const ADJOINT: f64 = 1e-9;

/// The reason why an FMU of this `version` cannot be tried, if there is one. `needs_tool` says whether it
/// needs another program to run.
pub(super) fn reason_to_skip(
    archive: &Archive,
    version: Version,
    needs_tool: bool,
    findings: &Findings,
) -> Option<String> {
    for (head, reason) in [
        ("schema.", "the description breaks the schema"),
        ("interface.co-simulation", "there is no co-simulation"),
    ] {
        if findings.any(head) {
            return Some(reason.to_owned());
        }
    }
    // A defect of another platform's library does not prevent the trial.
    let own = version.platform();
    let folder = format!("binaries/{own}/");
    for (head, reason) in
        [("archive.binary", "there is no library"), ("symbols.", "the library is not complete")]
    {
        if findings.any_in(head, |file| file.is_empty() || file.starts_with(&folder)) {
            return Some(format!("{reason} for {own}"));
        }
    }
    if !archive.platforms().iter().any(|platform| platform == own) {
        return Some(format!("there is no library for {own}"));
    }
    needs_tool.then(|| "the FMU needs a tool that drives it (needsExecutionTool)".to_owned())
}

/// Tries the FMU in a child process, for at most `limit`.
pub(super) fn run(path: &Path, limit: Duration, findings: &mut Findings) -> Result<(), Error> {
    let child = Child::new()?;
    let words: Vec<OsString> = vec![
        "trial".into(),
        "--time-limit".into(),
        limit.as_secs_f64().to_string().into(),
        "--".into(),
        path.into(),
        child.folder().into(),
    ];
    let end = child.run(words, Voice::Silent, Some(limit))?;
    // The findings that the child wrote before it ended. A line cut off by a crash does not count.
    let reported = std::fs::read_to_string(findings_file(child.folder())).unwrap_or_default();
    for finding in reported.lines().filter_map(|line| serde_json::from_str(line).ok()) {
        findings.push(finding);
    }
    match end {
        End::Finished(0) => {}
        End::Finished(code) => {
            findings.archive(
                "trial.crash",
                PLACE,
                format!("the process of the trial ended with exit code {code}"),
            );
        }
        End::Broken { how, last } => {
            let what = match last {
                None => "outside of any call, the trial".to_owned(),
                Some(last) if last.instance.is_empty() => format!("{}: the FMU", last.call),
                Some(last) => match last.time {
                    Some(time) => {
                        format!("in {} at t = {} s the FMU", last.call, crate::error::brief_time(time))
                    }
                    None => format!("in {} the FMU", last.call),
                },
            };
            match how {
                Break::Late { limit, call } => {
                    let [limit, call] = [limit, call].map(|of| (of.as_secs_f64() * 10.0).round() / 10.0);
                    let text = format!(
                        "{what} had been at work for {call} s when the time limit of the trial, {limit} s, had passed: it \
                         is slow, or it hangs; --time-limit SECONDS waits longer"
                    );
                    findings.archive("trial.time", PLACE, text);
                }
                how => findings.archive("trial.crash", PLACE, format!("{what} {how}")),
            }
        }
    }
    Ok(())
}

fn findings_file(folder: &Path) -> PathBuf {
    folder.join("findings.jsonl")
}

/// Tries the FMU at `path` in this process within `limit`. Each finding is written to a file in `folder`
/// immediately.
///
/// # Errors
///
/// The folder cannot be written to.
pub fn perform(path: &Path, folder: &Path, limit: Duration) -> Result<(), Error> {
    isolation::settle(folder)?;
    let file = findings_file(folder);
    let file = File::create(&file).map_err(|e| Error::io("write", &file, e))?;
    let mut trial = Trial { file, limit, reported: HashSet::new() };
    match Fmu::open(path).map(Rc::new) {
        Ok(fmu) => trial.note(|trial| trial.all(&fmu)),
        Err(error) => trial.note(|_| Err(error)),
    }
    journal::finish();
    Ok(())
}

struct Trial {
    file: File,
    /// The time that the trial may take.
    limit: Duration,
    /// Rule and variable of the findings already reported: repeating one at every step adds nothing.
    reported: HashSet<(&'static str, Option<String>)>,
}

impl Trial {
    fn tell(&mut self, rule: &'static str, variable: Option<&str>, message: &str) {
        if !self.reported.insert((rule, variable.map(str::to_owned))) {
            return;
        }
        let severity = severity(rule);
        let place = Place { file: PLACE.to_owned(), position: None, variable: variable.map(str::to_owned) };
        let finding = Finding { severity, rule: rule.to_owned(), place, message: message.to_owned() };
        // If nothing can be written, the watching process reports that.
        let _ = serde_json::to_string(&finding).map(|line| self.file.write_all((line + "\n").as_bytes()));
    }

    /// Reports an error that ends a part of the trial early.
    fn note(&mut self, part: impl FnOnce(&mut Self) -> Result<(), Error>) {
        let Err(error) = part(self) else { return };
        let rule = match error.as_call() {
            _ if is_discarded(&error) => "trial.discard",
            Some(_) => "trial.call",
            None => "trial.load",
        };
        self.tell(rule, None, &error.to_string());
    }

    fn all(&mut self, fmu: &Rc<Fmu>) -> Result<(), Error> {
        let description = Rc::clone(fmu.description());
        let wanted: &[&str] = match description.version() {
            Version::Fmi2 => &["2.0", "default"],
            Version::Fmi3 => &["3.0"],
        };
        for ((call, answer), wanted) in fmu.answers()?.iter().zip(wanted) {
            if answer != wanted {
                self.tell("trial.version", None, &format!("{call} answered {answer:?}; must be {wanted:?}"));
            }
        }
        let mut slave = fmu.instantiate(&description, INSTANCE)?;
        let done = self.passes(fmu, &mut *slave, &description);
        if let Some(fault) = slave.log_fault() {
            self.tell("trial.log", None, &format!("the FMU called the logger, and {fault}"));
        }
        done
    }

    /// Makes two runs, the second after a reset and with start values set, and uses a second instance.
    fn passes(
        &mut self,
        fmu: &Rc<Fmu>,
        slave: &mut dyn Slave,
        description: &Description,
    ) -> Result<(), Error> {
        let mut plan = Plan::of(description);
        let first = self.pass(slave, description, &mut plan, false)?;
        slave.reset()?;
        let second = self.pass(slave, description, &mut plan, true)?;
        let fmi = description.version().prefix();
        let as_started = !self.reported.iter().any(|(rule, _)| *rule == "trial.start");
        for (name, a, b) in first.iter().zip(&second).map(|((name, a), (_, b))| (name, a, b)) {
            if as_started && a.to_bits() != b.to_bits() {
                let text = format!(
                    "is {b} at the end of a second run after {fmi}Reset, but was {a} at the end of the first"
                );
                self.tell("trial.reset", Some(name), &text);
            }
        }
        if slave.warnings() > 0 {
            let last = slave.log().last().map(|m| format!("; it last logged: {m}")).unwrap_or_default();
            self.tell(
                "trial.warning",
                None,
                &format!("{} calls returned {fmi}Warning{last}", slave.warnings()),
            );
        }
        if !description.only_once {
            self.two_instances(fmu, slave, plan);
        }
        Ok(())
    }

    /// Runs from initialisation to termination; returns the Real outputs at the end.
    fn pass(
        &mut self,
        slave: &mut dyn Slave,
        description: &Description,
        plan: &mut Plan,
        set: bool,
    ) -> Result<Vec<(String, f64)>, Error> {
        let variables = &description.variables;
        if set {
            variables.chunk_by(same).try_for_each(|array| set_start(slave, array))?;
        }
        slave.setup_experiment(plan.start, plan.stop, None)?;
        slave.enter_initialization_mode()?;
        slave.exit_initialization_mode()?;
        if !set {
            variables.chunk_by(same).try_for_each(|array| self.compare_start(slave, array))?;
        }
        let mut k = 0;
        while k < plan.steps {
            if !set && k == plan.steps / 2 && description.states[0] {
                self.go_back(slave, description, (plan.time(k), plan.step))?;
            }
            let begin = Instant::now();
            slave.do_step(plan.time(k), plan.step)?;
            if !set && k == 0 {
                plan.shorten(begin.elapsed(), self.limit);
            }
            k += 1;
            self.outputs(slave, variables)?;
            if slave.asks_to_end() {
                break;
            }
        }
        // Read before derivatives are compared with differences, since that sets inputs again at the present
        // time.
        let last = self.outputs(slave, variables)?;
        if !set {
            self.derivatives(slave, description)?;
        }
        slave.terminate()?;
        Ok(last)
    }

    /// Reads every output, and checks those that are numbers.
    fn outputs(
        &mut self,
        slave: &mut dyn Slave,
        variables: &[Variable],
    ) -> Result<Vec<(String, f64)>, Error> {
        let mut outputs = Vec::new();
        for array in variables.chunk_by(same).filter(|array| array[0].causality == Causality::Output) {
            let Some(values) = self.get(slave, array)? else { continue };
            for (v, value) in array.iter().zip(values) {
                if !value.is_finite() {
                    self.tell(
                        "trial.output",
                        Some(&v.name),
                        &format!("the output is {value}; should be finite"),
                    );
                }
                let (min, max) = v.range;
                let (min, max) = (min.unwrap_or(f64::NEG_INFINITY), max.unwrap_or(f64::INFINITY));
                if value < min || value > max {
                    let text = format!(
                        "the output is {value}; should be in [{min}, {max}], as the description says"
                    );
                    self.tell("trial.output", Some(&v.name), &text);
                }
                outputs.push((v.name.clone(), value));
            }
        }
        Ok(outputs)
    }

    /// The values as numbers; `None` if they are not numbers.
    fn get(&mut self, slave: &mut dyn Slave, array: &[Variable]) -> Result<Option<Vec<f64>>, Error> {
        let first = &array[0];
        if first.of == DataType::String {
            let texts = slave.get_text(first.value_reference, array.len())?;
            let call = format!("{}GetString", slave.version().prefix());
            let is_garbled = |text: &Option<String>| {
                text.as_ref().is_some_and(|text| text.contains(char::REPLACEMENT_CHARACTER))
            };
            let fault = match &texts {
                Some(texts) if texts.iter().any(is_garbled) => Some("gave what is not UTF-8"),
                Some(texts) if !texts.contains(&None) => None,
                _ => Some("gave NULL; must give a text"),
            };
            if let Some(fault) = fault {
                self.tell("trial.text", Some(&first.name), &format!("{call} {fault}"));
            }
            return Ok(None);
        }
        if !first.is_number() {
            return Ok(None);
        }
        let mut values = vec![f64::NAN; array.len()];
        slave.get(first.of, &[first.value_reference], &mut values)?;
        Ok(Some(values))
    }

    /// Compares parameters or inputs that were not set with their start values.
    fn compare_start(&mut self, slave: &mut dyn Slave, array: &[Variable]) -> Result<(), Error> {
        if !is_set_by_importers(&array[0]) || array.iter().all(|v| v.start.is_none()) {
            return Ok(());
        }
        let Some(values) = self.get(slave, array)? else { return Ok(()) };
        for (v, value) in array.iter().zip(values) {
            let Some(start) = v.start else { continue };
            // A 32-bit float differs from the decimal number in the description.
            let close = if v.of == DataType::Float32 { f64::from(f32::EPSILON) } else { CLOSE };
            if (value - start).abs() > close * start.abs() || value.is_nan() != start.is_nan() {
                let text = format!("is {value} after initialisation; the description says start = {start}");
                self.tell("trial.start", Some(&v.name), &text);
            }
        }
        Ok(())
    }

    /// Makes a step, goes back, and repeats it: first from the state, then from the state serialised in
    /// between.
    fn go_back(
        &mut self,
        slave: &mut dyn Slave,
        description: &Description,
        (time, step): (f64, f64),
    ) -> Result<(), Error> {
        let variables = &description.variables;
        let Some(before) = slave.save()? else { return Ok(()) };
        slave.may_go_back(true);
        slave.do_step(time, step)?;
        let first = self.outputs(slave, variables)?;
        slave.restore(&before)?;
        slave.do_step(time, step)?;
        let again = self.outputs(slave, variables)?;
        self.compare_states(&first, &again, "it was set back");
        let bytes = if description.states[1] { slave.to_bytes(&before)? } else { None };
        let state = bytes.map(|bytes| slave.of_bytes(&bytes)).transpose()?.flatten();
        if let Some(state) = state {
            slave.restore(&state)?;
            slave.do_step(time, step)?;
            let again = self.outputs(slave, variables)?;
            self.compare_states(&first, &again, "its state went through bytes");
            slave.release(state)?;
        }
        slave.restore(&before)?;
        slave.release(before)?;
        slave.may_go_back(false);
        Ok(())
    }

    fn compare_states(&mut self, first: &[(String, f64)], again: &[(String, f64)], after: &str) {
        for ((name, a), (_, b)) in first.iter().zip(again) {
            if a.to_bits() != b.to_bits() {
                let text = format!(
                    "is {b} after a step that was made again after {after}, but was {a} the first time"
                );
                self.tell("trial.state", Some(name), &text);
            }
        }
    }

    /// Compares derivatives of outputs with respect to inputs with differences, and adjoint ones with
    /// directional ones.
    fn derivatives(&mut self, slave: &mut dyn Slave, description: &Description) -> Result<(), Error> {
        if !description.derivatives[0] || slave.version() != Version::Fmi3 {
            return Ok(());
        }
        let real = |v: &Variable| v.of == DataType::Float64 && v.variability == Variability::Continuous;
        let array = |first: usize| &description.variables[first..first + description.variables[first].count];
        let mut pairs = Vec::new();
        for output in &description.outputs {
            let inputs = description.direct_inputs(output).into_iter();
            pairs.extend(inputs.map(|input| (output.variable, input)).filter(|(output, input)| {
                let (output, input) = (&description.variables[*output], &description.variables[*input]);
                real(output) && real(input) && output.element == 0 && input.element == 0
            }));
        }
        for (output, input) in pairs.into_iter().take(PAIRS) {
            match self.derivative(slave, array(output), array(input), description.derivatives[1]) {
                // There is no derivative at this point, such as at a kink, and so nothing to compare.
                Err(error) if is_discarded(&error) => {}
                other => other?,
            }
        }
        Ok(())
    }

    fn derivative(
        &mut self,
        slave: &mut dyn Slave,
        output: &[Variable],
        input: &[Variable],
        adjoint: bool,
    ) -> Result<(), Error> {
        let (unknown, known) = (output[0].value_reference, input[0].value_reference);
        let direction: Vec<f64> = (0..input.len()).map(|i| 1.0 / (1.0 + i as f64)).collect();
        let mut directional = vec![f64::NAN; output.len()];
        if !slave.derivative(false, (unknown, known), &direction, &mut directional)? {
            return Ok(());
        }
        // One-sided difference quotients in both directions. If they differ, there is a kink, and nothing to
        // compare with.
        let mut at = vec![0.0; input.len()];
        slave.get(DataType::Float64, &[known], &mut at)?;
        let size = at.iter().fold(1.0, |size: f64, x| size.max(x.abs()));
        let moved = |slave: &mut dyn Slave, by: f64| {
            let to: Vec<f64> = at.iter().zip(&direction).map(|(x, d)| x + by * d).collect();
            slave.set(DataType::Float64, &[known], &to)?;
            let mut values = vec![f64::NAN; output.len()];
            slave.get(DataType::Float64, &[unknown], &mut values)?;
            Ok::<_, Error>(values)
        };
        let by = DIFFERENCE * size;
        let (up, down, here) = (moved(slave, by)?, moved(slave, -by)?, moved(slave, 0.0)?);
        for (i, v) in output.iter().enumerate() {
            let [right, left] = [(up[i] - here[i]) / by, (here[i] - down[i]) / by];
            let allowed = AGREE * (1.0 + right.abs());
            let is_smooth = (right - left).abs() <= allowed;
            let is_right = (directional[i] - right).abs() <= allowed;
            if is_smooth && !is_right {
                let text = format!(
                    "its directional derivative by {} is {}, the quotient of differences {right}",
                    input[0].name, directional[i]
                );
                self.tell("trial.derivative", Some(&v.name), &text);
            }
        }
        if !adjoint {
            return Ok(());
        }
        let weights: Vec<f64> = (0..output.len()).map(|i| 1.0 / (2.0 + i as f64)).collect();
        let mut reverse = vec![f64::NAN; input.len()];
        if !slave.derivative(true, (unknown, known), &weights, &mut reverse)? {
            return Ok(());
        }
        let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let (forward, reverse) = (product(&weights, &directional), product(&reverse, &direction));
        let is_equal = (forward - reverse).abs() <= ADJOINT * (1.0 + forward.abs());
        if !is_equal {
            let text = format!(
                "its adjoint derivative by {} gives {reverse} where the directional one gives {forward}",
                input[0].name
            );
            self.tell("trial.derivative", Some(&output[0].name), &text);
        }
        Ok(())
    }

    fn two_instances(&mut self, fmu: &Rc<Fmu>, other: &dyn Slave, plan: Plan) {
        let made = fmu.instantiate(fmu.description(), "trial2").and_then(|mut slave| {
            slave.setup_experiment(plan.start, plan.stop, None)?;
            slave.enter_initialization_mode()?;
            slave.exit_initialization_mode()?;
            slave.do_step(plan.start, plan.step)
        });
        if let Err(error) = made {
            let text = format!(
                "a second instance beside {} fails, but canBeInstantiatedOnlyOncePerProcess is false: {error}",
                other.name()
            );
            self.tell("trial.instances", None, &text);
        }
    }
}

/// The experiment of the trial.
#[derive(Clone, Copy)]
struct Plan {
    start: f64,
    stop: f64,
    step: f64,
    steps: u32,
}

impl Plan {
    /// The time of step `k`.
    fn time(&self, k: u32) -> f64 {
        self.start + f64::from(k) * self.step
    }

    /// Makes fewer steps if one takes so long that a pass would exceed its fraction of the time limit.
    fn shorten(&mut self, step: Duration, limit: Duration) {
        let most = SHARE_OF_PASS * limit.as_secs_f64() / step.as_secs_f64().max(1e-9);
        self.steps = self.steps.min(most.clamp(1.0, f64::from(STEPS)) as u32);
    }

    /// The suggested experiment, shortened.
    fn of(description: &Description) -> Self {
        let suggested = description.default_experiment.unwrap_or_default();
        let finite = |value: Option<f64>| value.filter(|value| value.is_finite());
        let start = finite(suggested.start_time).unwrap_or(0.0);
        let stop = finite(suggested.stop_time).filter(|stop| *stop > start);
        let step = finite(suggested.step_size).filter(|step| *step > 0.0);
        let step = step.or_else(|| stop.map(|stop| (stop - start) / 100.0)).unwrap_or(STEP);
        let stop = stop.unwrap_or(start + step * f64::from(STEPS));
        let steps = ((stop - start) / step * (1.0 + 1e-9)).floor().clamp(1.0, f64::from(STEPS)) as u32;
        Self { start, stop: stop.max(start + step * f64::from(steps)), step, steps }
    }
}

/// Whether two adjacent scalars are elements of one array.
fn same(a: &Variable, b: &Variable) -> bool {
    b.element == a.element + 1
}

fn is_discarded(error: &Error) -> bool {
    error.as_call().and_then(|call| call.status).is_some_and(Status::is_discard)
}

fn is_set_by_importers(v: &Variable) -> bool {
    let settable = matches!(v.causality, Causality::Parameter | Causality::Input);
    settable && v.variability != Variability::Constant
}

fn set_start(slave: &mut dyn Slave, array: &[Variable]) -> Result<(), Error> {
    let first = &array[0];
    let values: Option<Vec<f64>> = array.iter().map(|v| v.start).collect();
    match values.filter(|_| is_set_by_importers(first)) {
        Some(values) => slave.set(first.of, &[first.value_reference], &values),
        None => Ok(()),
    }
}
