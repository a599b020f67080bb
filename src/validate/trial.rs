//! Trial of an FMU: `run` starts this program again, and [`perform`] does the trial there. The FMU runs only
//! there, so that its crash, hang or `exit()` is a finding.

use std::collections::HashSet;
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::time::Duration;

use punctual_modeldescription::Located;

use super::finding::{Finding, Findings, Place, severity};
use crate::error::Error;
use crate::host::{
    Archive, Causality, Fmu, PLATFORM, ScalarType, Slave, Status, Variability, Variable, journal,
};
use crate::isolation::{self, Child, End, Voice};

/// The name of the trial's instance.
const INSTANCE: &str = "trial";
/// The file that findings name.
const PLACE: &str = "trial";
/// The greatest number of steps of one pass.
const STEPS: u32 = 10;
/// The step in seconds where the FMU suggests none.
const STEP: f64 = 0.01;
/// Relative difference of a real value from its start value that is allowed, since decimals can be read in other
/// ways.
const CLOSE: f64 = 1e-12;

/// The reason why there can be no trial, if there is one.
pub(super) fn reason_to_skip(archive: &Archive, model: &Located, findings: &Findings) -> Option<String> {
    for (head, reason) in [
        ("schema.", "the description breaks the schema"),
        ("interface.co-simulation", "there is no co-simulation"),
        ("interface.identifier", "modelIdentifier names no library"),
    ] {
        if findings.any(head) {
            return Some(reason.to_owned());
        }
    }
    // What is wrong with the library of another platform is no obstacle.
    let own = format!("binaries/{PLATFORM}/");
    for (head, reason) in
        [("archive.binary", "there is no library"), ("symbols.", "the library is not complete")]
    {
        if findings.any_in(head, |file| file.is_empty() || file.starts_with(&own)) {
            return Some(format!("{reason} for {PLATFORM}"));
        }
    }
    if !archive.platforms().iter().any(|platform| platform == PLATFORM) {
        return Some(format!("there is no library for {PLATFORM}"));
    }
    let needs_tool = model.description.co_simulation.needs_execution_tool;
    needs_tool.then(|| "the FMU needs a tool that drives it (needsExecutionTool)".to_owned())
}

/// Tries the FMU in a child process, at most for `limit`.
pub(super) fn run(path: &Path, limit: Duration, findings: &mut Findings) -> Result<(), Error> {
    let child = Child::new()?;
    let words = ["trial".into(), "--".into(), path.into(), child.folder().into()];
    let end = child.run(words, Voice::Silent, Some(limit))?;
    // Findings that the child wrote before its end. A line cut off by a crash is no finding.
    let told = std::fs::read_to_string(findings_file(child.folder())).unwrap_or_default();
    for finding in told.lines().filter_map(|line| serde_json::from_str(line).ok()) {
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
            findings.archive("trial.crash", PLACE, format!("{what} {how}"));
        }
    }
    Ok(())
}

fn findings_file(folder: &Path) -> PathBuf {
    folder.join("findings.jsonl")
}

/// Tries the FMU at `path` in this process. Its findings go into files in `folder`, at once.
///
/// # Errors
///
/// The folder cannot be written to.
pub fn perform(path: &Path, folder: &Path) -> Result<(), Error> {
    isolation::settle(folder)?;
    let file = findings_file(folder);
    let file = File::create(&file).map_err(|e| Error::io("write", &file, e))?;
    let mut trial = Trial { file, told: HashSet::new() };
    if let Err(error) = trial.all(path) {
        let rule = match error.as_call() {
            Some(call) if call.status == Some(Status::DISCARD) => "trial.discard",
            Some(_) => "trial.call",
            None => "trial.load",
        };
        trial.tell(rule, None, &error.to_string());
    }
    journal::finish();
    Ok(())
}

struct Trial {
    file: File,
    /// Rule and variable of the findings told: the same finding at every step teaches nothing.
    told: HashSet<(&'static str, Option<String>)>,
}

impl Trial {
    fn tell(&mut self, rule: &'static str, variable: Option<&str>, message: &str) {
        if !self.told.insert((rule, variable.map(str::to_owned))) {
            return;
        }
        let severity = severity(rule);
        let place = Place { file: PLACE.to_owned(), position: None, variable: variable.map(str::to_owned) };
        let finding = Finding { severity, rule: rule.to_owned(), place, message: message.to_owned() };
        // The watching process tells that this one left nothing, if so.
        let _ = serde_json::to_string(&finding).map(|line| self.file.write_all((line + "\n").as_bytes()));
    }

    fn all(&mut self, path: &Path) -> Result<(), Error> {
        let fmu = Rc::new(Fmu::open(path)?);
        for ((call, answer), wanted) in fmu.answers()?.into_iter().zip(["2.0", "default"]) {
            if answer != wanted {
                self.tell("trial.version", None, &format!("{call} answered {answer:?}; must be {wanted:?}"));
            }
        }
        let plan = Plan::of(&fmu);
        let mut slave = Slave::instantiate(Rc::clone(&fmu), INSTANCE)?;
        let first = self.pass(&mut slave, &fmu, plan, false)?;
        slave.reset()?;
        let second = self.pass(&mut slave, &fmu, plan, true)?;
        let as_started = !self.told.iter().any(|(rule, _)| *rule == "trial.start");
        for (name, a, b) in first.iter().zip(&second).map(|((name, a), (_, b))| (name, a, b)) {
            if as_started && a.to_bits() != b.to_bits() {
                let text = format!(
                    "is {b} at the end of a second run after fmi2Reset, but was {a} at the end of the first"
                );
                self.tell("trial.reset", Some(name), &text);
            }
        }
        if slave.warnings() > 0 {
            let last = slave.log().last().map(|m| format!("; it last logged: {m}")).unwrap_or_default();
            self.tell(
                "trial.warning",
                None,
                &format!("{} calls returned fmi2Warning{last}", slave.warnings()),
            );
        }
        if !fmu.description().co_simulation.can_be_instantiated_only_once_per_process {
            self.two_instances(&fmu, &slave, plan)?;
        }
        Ok(())
    }

    /// From initialisation to termination; returns the Real outputs at the end.
    fn pass(
        &mut self,
        slave: &mut Slave,
        fmu: &Fmu,
        plan: Plan,
        set: bool,
    ) -> Result<Vec<(String, f64)>, Error> {
        let variables = &fmu.description().variables;
        if set {
            variables.iter().try_for_each(|variable| set_start(slave, variable))?;
        }
        slave.setup_experiment(plan.start, plan.stop)?;
        slave.enter_initialization_mode()?;
        slave.exit_initialization_mode()?;
        if !set {
            variables.iter().try_for_each(|variable| self.compare_start(slave, variable))?;
        }
        for k in 0..plan.steps {
            slave.do_step(plan.start + f64::from(k) * plan.step, plan.step)?;
            self.outputs(slave, variables)?;
        }
        let last = self.outputs(slave, variables)?;
        slave.terminate()?;
        Ok(last)
    }

    /// Reads every output, and checks the Real ones.
    fn outputs(&mut self, slave: &mut Slave, variables: &[Variable]) -> Result<Vec<(String, f64)>, Error> {
        let mut values = Vec::new();
        for v in variables.iter().filter(|v| v.causality == Causality::Output) {
            let Some(value) = self.get(slave, v)? else { continue };
            if !value.is_finite() {
                self.tell("trial.output", Some(&v.name), &format!("the output is {value}; should be finite"));
            }
            let (min, max) = v.kind.range();
            let (min, max) = (min.unwrap_or(f64::NEG_INFINITY), max.unwrap_or(f64::INFINITY));
            if value < min || value > max {
                let text =
                    format!("the output is {value}; should be in [{min}, {max}], as the description says");
                self.tell("trial.output", Some(&v.name), &text);
            }
            values.push((v.name.clone(), value));
        }
        Ok(values)
    }

    /// The value as a number; `None` for texts.
    fn get(&mut self, slave: &mut Slave, v: &Variable) -> Result<Option<f64>, Error> {
        let reference = [v.value_reference];
        let (mut real, mut integer) = ([f64::NAN], [0]);
        Ok(match v.kind.scalar_type() {
            ScalarType::Real => {
                slave.get_real(&reference, &mut real)?;
                Some(real[0])
            }
            ScalarType::Integer | ScalarType::Enumeration => {
                slave.get_integer(&reference, &mut integer)?;
                Some(f64::from(integer[0]))
            }
            ScalarType::Boolean => {
                slave.get_boolean(&reference, &mut integer)?;
                Some(f64::from(u8::from(integer[0] != 0)))
            }
            ScalarType::String => {
                if slave.get_string(v.value_reference)?.is_none() {
                    self.tell("trial.text", Some(&v.name), "fmi2GetString gave NULL; must give a text");
                }
                None
            }
        })
    }

    /// Compares a parameter or input that was not set with its start value.
    fn compare_start(&mut self, slave: &mut Slave, v: &Variable) -> Result<(), Error> {
        if !is_set_by_importers(v) {
            return Ok(());
        }
        let Some(start) = v.kind.start_number() else { return Ok(()) };
        let Some(value) = self.get(slave, v)? else { return Ok(()) };
        if (value - start).abs() > CLOSE * start.abs() || value.is_nan() != start.is_nan() {
            let text = format!("is {value} after initialisation; the description says start = {start}");
            self.tell("trial.start", Some(&v.name), &text);
        }
        Ok(())
    }

    fn two_instances(&mut self, fmu: &Rc<Fmu>, other: &Slave, plan: Plan) -> Result<(), Error> {
        let made = Slave::instantiate(Rc::clone(fmu), "trial2").and_then(|mut slave| {
            slave.setup_experiment(plan.start, plan.stop)?;
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
        Ok(())
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
    /// The suggested experiment, cut short.
    fn of(fmu: &Fmu) -> Self {
        let suggested = fmu.description().default_experiment.unwrap_or_default();
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

fn is_set_by_importers(v: &Variable) -> bool {
    matches!(v.causality, Causality::Parameter | Causality::Input) && v.variability != Variability::Constant
}

fn set_start(slave: &mut Slave, v: &Variable) -> Result<(), Error> {
    let Some(value) = v.kind.start_number().filter(|_| is_set_by_importers(v)) else { return Ok(()) };
    let reference = [v.value_reference];
    match v.kind.scalar_type() {
        ScalarType::Real => slave.set_real(&reference, &[value]),
        ScalarType::Integer | ScalarType::Enumeration => slave.set_integer(&reference, &[value as i32]),
        ScalarType::Boolean => slave.set_boolean(&reference, &[value as i32]),
        ScalarType::String => Ok(()),
    }
}
