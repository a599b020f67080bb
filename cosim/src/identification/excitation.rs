//! Recordings of an FMU: it is excited with inputs within their bounds, and its states are read at every step.
//!
//! Four forms of inputs share the time: steps, which show lags and gains; fast switching between the bounds, which shows delays; sums of
//! sines; and slow ramps, which show what depends on the size of an input. Each has a mean near 0, or near the middle of bounds that do not
//! contain 0. A form begins anew from the start where a state leaves the range for which the model is meant, with smaller inputs if that
//! came soon.

use std::path::Path;

use punctual_core::elementary::sin;
use punctual_fmu::configuration::{FilterConfiguration, VariableSection};
use punctual_fmu::units::Said;

use super::record::{Episode, Named, Record, converted, names};
use crate::coupling::{Model, Reader};
use crate::error::Error;
use crate::host::{Causality, DataType, Description, Participant};

/// Holds in all, if the duration does not say so.
const MOST: usize = 20_000;
/// An episode shorter than this makes inputs smaller.
const SHORT: usize = 25;
/// By how much.
const SMALLER: f64 = 0.7;

/// What was recorded of an FMU.
#[derive(Debug)]
pub struct Excited {
    /// The recording.
    pub record: Record,
    /// Episodes that ended because a state left its range, by state.
    pub ended: Vec<(String, usize)>,
}

/// A variable of the FMU that is a signal of the model.
struct Port {
    of: DataType,
    reference: u32,
    element: usize,
    count: usize,
    /// From its unit to that of the model.
    factor: f64,
    offset: f64,
}

/// Excites the plant in `path`, an FMU or the configuration of a plant, for `duration` s in steps of `step` s. Its variables are found by
/// the names of the model's signals, as `x.v` or `v` and `u.a` or `a`, or as `named`. It begins from the `x0` of `c` where it has
/// parameters `x0.<state>`, else from its own start.
///
/// # Errors
///
/// An FMU that cannot be used or fails; a signal that it does not have; an input without bounds; a step so long that there are too few.
pub fn excite(
    c: &FilterConfiguration,
    path: &Path,
    named: &[Named],
    (duration, step): (f64, f64),
    read: Reader,
) -> Result<Excited, Error> {
    super::proposal::check(c)?;
    Named::check(named, c)?;
    let model = Model::open(path, &[], read).map_err(|e| e.in_file(path))?;
    let description = model.description();
    let mut notes = Vec::new();
    let mut ports = |signals: &[VariableSection], is_input: bool| {
        let port = |signal| port(description, signal, is_input, named, &mut notes);
        signals.iter().map(port).collect::<Result<Vec<_>, _>>()
    };
    let (states, inputs) = (c.plant.states(), c.plant.inputs());
    let (outputs, acting) = (ports(&states, false)?, ports(&inputs, true)?);
    let bounds = inputs.iter().map(|input| {
        c.limits(&input.name).ok_or_else(|| {
            let message = "has no bounds, between which the plant could be excited; give [min, max]";
            Error::configuration(format!("bounds.{}", input.name), message)
        })
    });
    let bounds = bounds.collect::<Result<Vec<_>, _>>()?;
    let all = duration / step;
    if !(20.0..=MOST as f64).contains(&all) {
        let message = format!(
            "is {duration} s, which is {} steps of {step} s, must be 20 to {MOST} steps",
            punctual_fmu::text::number(all.floor())
        );
        return Err(Error::configuration("--duration", message));
    }
    let starts: Vec<(u32, f64)> = c
        .run
        .x0
        .iter()
        .filter_map(|(state, value)| {
            let own = &description.variables[description.index_of(&format!("x0.{state}"))?];
            (own.causality == Causality::Parameter && own.of == DataType::Float64 && own.count == 1)
                .then_some((own.value_reference, *value))
        })
        .collect();
    let mut plant = model.instance("plant").map_err(|e| e.in_file(path))?;
    let mut record = Record { states, inputs, episodes: Vec::new(), period: step, notes: Vec::new() };
    let (mut ended, mut used) = (vec![0; record.states.len()], false);
    let holds = (all.round() as usize).max(1);
    for (f, form) in Form::ALL.into_iter().enumerate() {
        let share = holds / Form::ALL.len() + usize::from(f < holds % Form::ALL.len());
        let (mut done, mut amplitude) = (0, 1.0);
        while done < share {
            if std::mem::replace(&mut used, true) {
                plant.reset()?;
            }
            plant.setup_experiment(0.0, duration, None)?;
            starts
                .iter()
                .try_for_each(|(reference, value)| plant.set(DataType::Float64, &[*reference], &[*value]))?;
            plant.enter_initialization_mode()?;
            let u = |k: usize| {
                let value =
                    |(j, bounds): (usize, &[f64; 2])| form.value(j, k, share, step, amplitude, *bounds);
                bounds.iter().enumerate().map(value).collect::<Vec<_>>()
            };
            write(&mut plant, &acting, &u(done))?;
            plant.exit_initialization_mode()?;
            let mut episode = Episode {
                times: Vec::new(),
                states: vec![Vec::new(); record.states.len()],
                inputs: vec![Vec::new(); record.inputs.len()],
            };
            let mut left = None;
            for k in 0.. {
                let x = self::read(&mut plant, &outputs)?;
                let outside = |(x, state): (&f64, &VariableSection)| !state.range().contains(*x);
                left = x.iter().zip(&record.states).position(outside);
                if left.is_some() {
                    break;
                }
                let asked = u(done + k);
                episode.times.push(step * k as f64);
                episode.states.iter_mut().zip(x).for_each(|(series, x)| series.push(x));
                episode.inputs.iter_mut().zip(&asked).for_each(|(series, u)| series.push(*u));
                if done + k >= share {
                    break;
                }
                write(&mut plant, &acting, &asked)?;
                plant.do_step(step * k as f64, step)?;
            }
            plant.terminate()?;
            if let Some(i) = left {
                ended[i] += 1;
                if episode.times.is_empty() {
                    let state = &record.states[i];
                    let message = format!("starts outside of its range, {}", state.range().describe());
                    return Err(Error::configuration(format!("plant.states.{}", state.name), message));
                }
                if episode.holds() < SHORT {
                    amplitude *= SMALLER;
                }
            }
            // Also where nothing was gained, so that it ends.
            done += episode.holds().max(1);
            if episode.holds() > 0 {
                record.episodes.push(episode);
            }
        }
    }
    record.notes = notes;
    let ended = record.states.iter().map(|state| state.name.clone()).zip(ended);
    let ended = ended.filter(|(_, count)| *count > 0).collect();
    // The plant may leave its range at once.
    Ok(Excited { record: record.completed()?, ended })
}

/// The variable of `signal`.
fn port(
    description: &Description,
    signal: &VariableSection,
    is_input: bool,
    named: &[Named],
    notes: &mut Vec<String>,
) -> Result<Port, Error> {
    let own = names(&signal.name, is_input);
    let given = named.iter().find(|named| named.signal == signal.name).map(|named| &named.column);
    let found = match given {
        Some(name) => description.index_of(name),
        None => own.iter().rev().find_map(|name| description.index_of(name)),
    };
    let Some(index) = found else {
        let wanted = if is_input { Causality::Input } else { Causality::Output };
        let known = description.variables.iter().filter(|v| v.causality == wanted).map(|v| v.name.as_str());
        let known = known.take(12).collect::<Vec<_>>().join(", ");
        let (field, sought) = match given {
            Some(name) => ("--column".to_owned(), format!("{name:?}")),
            None => (format!("variable {}", signal.name), format!("{:?} or {:?}", own[1], own[0])),
        };
        let message =
            format!("the FMU has no {sought}; it has {known}; name it by --column {}=VARIABLE", signal.name);
        return Err(Error::configuration(field, message));
    };
    let variable = &description.variables[index];
    if is_input != (variable.causality == Causality::Input) || !variable.of.is_float() {
        let wanted = if is_input { "a Real input" } else { "a Real output or local variable" };
        let message = format!("{} of the FMU must be {wanted}", variable.name);
        return Err(Error::configuration(format!("variable {}", signal.name), message));
    }
    let unit: Said<'_> = description.unit(index);
    let [factor, offset] = converted(&unit, &variable.name, signal, notes)?;
    Ok(Port {
        of: variable.of,
        reference: variable.value_reference,
        element: variable.element,
        count: variable.count,
        factor,
        offset,
    })
}

/// The states of the model, in its units.
fn read(plant: &mut Box<dyn Participant>, ports: &[Port]) -> Result<Vec<f64>, Error> {
    let value = |port: &Port| {
        let mut values = vec![0.0; port.count];
        plant.get(port.of, &[port.reference], &mut values)?;
        Ok(port.factor * values[port.element] + port.offset)
    };
    ports.iter().map(value).collect()
}

/// Sets the inputs, given in units of the model.
fn write(plant: &mut Box<dyn Participant>, ports: &[Port], values: &[f64]) -> Result<(), Error> {
    for (at, port) in ports.iter().enumerate() {
        // An array is written as a whole, at its first element.
        if ports[..at].iter().any(|other| other.reference == port.reference && other.of == port.of) {
            continue;
        }
        let mut own = vec![0.0; port.count];
        for (other, value) in ports.iter().zip(values) {
            if other.reference == port.reference && other.of == port.of {
                own[other.element] = (value - other.offset) / other.factor;
            }
        }
        plant.set(port.of, &[port.reference], &own)?;
    }
    Ok(())
}

/// A form of inputs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Form {
    Steps,
    Switching,
    Sines,
    Ramps,
}

impl Form {
    const ALL: [Self; 4] = [Self::Steps, Self::Switching, Self::Sines, Self::Ramps];

    /// Input `j` in hold `k` of `all`, between its `bounds`; `amplitude` is the part of them that is used.
    fn value(self, j: usize, k: usize, all: usize, step: f64, amplitude: f64, bounds: [f64; 2]) -> f64 {
        let [low, high] = bounds;
        let rest = if low <= 0.0 && high >= 0.0 { 0.0 } else { 0.5 * (low + high) };
        let (below, above) = (rest - low, high - rest);
        let t = k as f64 * step;
        // From -1 to 1.
        let part = match self {
            // Up and down for as long, each pair of another size and length.
            Self::Steps => {
                let (mut begin, mut pair) = (0, 0_u64);
                loop {
                    let draw = [uniform(pair, 2 * j as u64), uniform(pair, 2 * j as u64 + 1)];
                    let length = (((0.2 + 0.8 * draw[0]) / step).round() as usize).clamp(2, (all / 8).max(2));
                    if k < begin + 2 * length {
                        let sign = if (k - begin < length) == (pair % 2 == 0) { 1.0 } else { -1.0 };
                        break sign * (0.3 + 0.7 * draw[1]);
                    }
                    (begin, pair) = (begin + 2 * length, pair + 1);
                }
            }
            // Between the bounds, as fast as every other hold.
            Self::Switching => {
                let every = (0.04 / step).round().max(2.0) as usize;
                if uniform((k / every) as u64, 97 + j as u64) < 0.5 { -1.0 } else { 1.0 }
            }
            Self::Sines => {
                let sines = [0.3, 0.7, 1.3, 2.3, 4.1];
                let sine = |(i, f): (usize, f64)| {
                    sin(core::f64::consts::TAU * (f * t + uniform(i as u64, 131 + j as u64)))
                };
                sines.into_iter().enumerate().map(sine).sum::<f64>() / 3.0
            }
            Self::Ramps => {
                let period = 4.0 + 1.3 * j as f64;
                let phase = (t / period + 0.25).fract();
                if phase < 0.5 { 4.0 * phase - 1.0 } else { 3.0 - 4.0 * phase }
            }
        };
        let part = amplitude * part.clamp(-1.0, 1.0);
        if part < 0.0 { rest + part * below } else { rest + part * above }
    }
}

/// A number from 0 to 1 that depends only on `key` and `of`: one step of SplitMix64.
fn uniform(key: u64, of: u64) -> f64 {
    let mut z =
        key.wrapping_mul(0x2545_f491_4f6c_dd1d) ^ of.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inputs_use_their_bounds_and_stay_within() {
        for bounds in [[-4.0, 4.0], [-8.0, 3.0], [2.0, 6.0]] {
            for form in Form::ALL {
                let values: Vec<f64> = (0..500).map(|k| form.value(1, k, 500, 0.02, 1.0, bounds)).collect();
                let least = values.iter().copied().fold(f64::INFINITY, f64::min);
                let most = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                assert!(bounds[0] <= least && most <= bounds[1], "{form:?}: {least} to {most}");
                assert!(most - least > 0.7 * (bounds[1] - bounds[0]), "{form:?}: {least} to {most}");
            }
        }
    }
}
