//! Plants that deviate from the model of their filter, as it declares: which one is whose, and whether it can.

use punctual_fmu::configuration::{Configuration, Deviation, DeviationKind, PlantConfiguration};

use super::delays::{self, Late};
use super::master::DrawnSteps;
use super::model::{Model, Own};
use super::network;
use super::promises::is_of;
use super::system::System;
use crate::error::Error;
use crate::host::Description;

/// A plant that deviates within what its filter declares.
pub struct Drawn {
    /// Position of the filter.
    pub filter: usize,
    /// Position of the plant.
    pub plant: usize,
    /// The plant, which deviates.
    pub configuration: PlantConfiguration,
    /// Whether the outputs of the filter are read a step late.
    pub late: bool,
    /// How many steps after its sample an input begins to act, a part of one counted as one.
    pub delayed: usize,
    /// That delay in s.
    pub delay: f64,
}

/// How steps are drawn, if a filter declares that their lengths vary; or in words why they are not.
pub type Steps = Result<Option<DrawnSteps>, String>;

/// The length of the shortest step that is drawn, as a part of the usual one. A filter that declares how late one may come allows any.
const SHORTEST: f64 = 0.2;

/// How the lengths of steps are drawn, for steps whose lengths filters declare; seed and kind are those of a run. `None` if none does.
///
/// # Errors
///
/// In words: why steps keep their length though a filter declares that they vary.
pub fn steps(
    system: &System,
    descriptions: &[&Description],
    configurations: &[Option<&Configuration>],
    found: &[Drawn],
) -> Steps {
    let filters = configurations.iter().enumerate().filter_map(|(c, configuration)| match configuration {
        Some(Configuration::Filter(filter)) => Some((&system.components()[c].name, filter)),
        _ => None,
    });
    let jitters: Vec<_> = filters.map(|(name, filter)| (name, filter.jitter())).collect();
    if jitters.iter().all(|(_, jitter)| *jitter == 0.0) {
        return Ok(None);
    }
    let keep = |why: String| Err(format!("steps are all of one length, so that no `jitter` is drawn: {why}"));
    if let Some((name, _)) = jitters.iter().find(|(_, jitter)| *jitter == 0.0) {
        return keep(format!("{name} declares none"));
    }
    if let Some(drawn) = found.iter().find(|drawn| drawn.late) {
        let name = &system.components()[drawn.filter].name;
        return keep(format!(
            "in this order the input of {name} acts a step late, and with it for another time"
        ));
    }
    if let Some(c) = descriptions.iter().position(|description| !description.any_step) {
        let name = &system.components()[c].name;
        return keep(format!("the FMU of {name} does not say that it can handle steps of different length"));
    }
    // Two inputs of a filter must not be on their way at once.
    let delays = found.iter().map(|drawn| drawn.delay / system.experiment().step);
    let least = delays.fold(SHORTEST, f64::max);
    let jitter = jitters.iter().map(|(_, jitter)| *jitter).fold(f64::INFINITY, f64::min);
    Ok(Some(DrawnSteps { seed: 0.0, kind: 0.0, jitter, least: least.min(1.0) }))
}

/// What a component is to another one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// It declares how a plant deviates.
    Filter,
    /// It deviates.
    Plant,
}

/// Whether a variable of a filter or plant may have another value than in its file while the plant is drawn within what the file
/// of the filter declares: neither the model nor a set nor what is declared changes with it.
pub fn may_differ(role: Role, variable: &str) -> bool {
    let (starts, ends): (&[&str], &[&str]) = match role {
        Role::Filter => {
            (&["u_ref.", "u_ref[", "arm_after"], &[".deadline", ".margin", ".rate", ".stay_rate"])
        }
        Role::Plant => (&["x0.", "inner_step"], &[]),
    };
    starts.iter().any(|start| variable.starts_with(start)) || ends.iter().any(|end| variable.ends_with(end))
}

/// Lets a filter's file run with its own model as the plant: without `simulated` and `disturbance`.
pub fn as_the_model(configuration: &mut Configuration) {
    if let Configuration::Filter(filter) = configuration {
        (filter.run.simulated, filter.run.disturbance) = (None, None);
    }
}

/// Lets the plants of `system` deviate at the ends of what their filters declare, as drawn by `seed`. Returns how the steps are drawn, or in
/// words why they are not.
///
/// # Errors
///
/// As for [`deviations`], in the words of the option `field`.
pub fn draw(system: &System, models: &mut [Model], seed: u64, field: &str) -> Result<Steps, Error> {
    let descriptions: Vec<_> = models.iter().map(Model::description).collect();
    let configurations: Vec<_> = models.iter().map(Model::configuration).collect();
    let found = deviations(system, &descriptions, &configurations);
    let found = found.map_err(|message| Error::configuration(field, message))?;
    let kind = f64::from(DeviationKind::Corners as u8);
    let drawn = steps(system, &descriptions, &configurations, &found);
    let drawn = drawn.map(|drawn| drawn.map(|drawn| DrawnSteps { seed: seed as f64, kind, ..drawn }));
    for Drawn { plant, mut configuration, .. } in found {
        if let Some(deviation) = &mut configuration.deviation {
            deviation.seed = seed as f64;
        }
        let path = models[plant].path().to_owned();
        models[plant] = Model::Own(Box::new(Own::new(Configuration::Plant(configuration))?), path);
    }
    Ok(drawn)
}

/// The plants of all filters of `system` that declare something. `configurations` are those of the components that have one.
///
/// # Errors
///
/// In words: no filter declares anything; a filter without plans; a plant that is not the filter's model alone, is not driven
/// by it, or not directly; a connection that does not fit.
pub fn deviations(
    system: &System,
    descriptions: &[&Description],
    configurations: &[Option<&Configuration>],
) -> Result<Vec<Drawn>, String> {
    let links = network::links(system, descriptions).map_err(|e| e.to_string())?;
    let late = delays::of(system, descriptions, &links);
    let step = system.experiment().step;
    let mut found: Vec<Drawn> = Vec::new();
    for (c, configuration) in configurations.iter().enumerate() {
        let Some(Configuration::Filter(filter)) = configuration else { continue };
        let owner = &system.components()[c];
        let mut filter = filter.clone();
        // What the coupling tells it of its delay counts as declared.
        if let Some((.., delay)) = late.starts.iter().find(|(component, ..)| *component == c) {
            filter.actuation_delay = *delay;
        }
        if filter.covered().is_empty() {
            continue;
        }
        let refuse =
            |why: String| Err(format!("has no plant to draw within what {} declares: {why}", owner.name));
        if !filter.is_assured() {
            return refuse(format!(
                "no plans are followed, which alone account for it: {}",
                filter.unassured()
            ));
        }
        if let Some(barrier) = filter.barrier.iter().find(|barrier| barrier.shape.followed().is_some()) {
            return refuse(format!(
                "{} follows a centre that moves by itself, and how that moves is not drawn yet",
                barrier.name
            ));
        }
        if let Some(key) = owner.start.keys().find(|key| !may_differ(Role::Filter, key)) {
            return refuse(format!(
                "the system gives {key} a value, which may not be that of the file; state it there"
            ));
        }
        let driven = links.iter().filter(|link| {
            link.from.component == c && is_of(&descriptions[c].variables[link.from.variable].name, "u")
        });
        let mut plants: Vec<_> = driven.map(|link| link.to.component).collect();
        plants.dedup();
        let (p, plant) = match plants[..] {
            [p] => match configurations[p] {
                Some(Configuration::Plant(plant)) => (p, plant),
                _ => {
                    return refuse(format!("{} is not a plant of this program", system.components()[p].name));
                }
            },
            _ => return refuse("its inputs do not all go to one plant".to_owned()),
        };
        let name = &system.components()[p].name;
        if plant.plant != filter.plant {
            return refuse(format!("{name} is not the model of the filter, from which it would be drawn"));
        }
        if let Some(key) = system.components()[p].start.keys().find(|key| !may_differ(Role::Plant, key)) {
            return refuse(format!(
                "the system gives {key} of {name} a value, which may not be that of the model"
            ));
        }
        if plant.disturbance.is_some() {
            return refuse(format!(
                "{name} has a [disturbance] already, which would add to what is declared; leave it out"
            ));
        }
        if found.iter().any(|other| other.plant == p) {
            return refuse(format!("{name} is the plant of another filter too"));
        }
        let acts = match delays::late(system, descriptions, &links, c) {
            Late::Never => 0.0,
            Late::OneStep => step,
            Late::Unknown(through) => {
                return refuse(format!("its input passes {through}, so it is not known when it acts"));
            }
        };
        if filter.actuation_delay < acts * (1.0 - 1e-9) {
            return refuse(format!(
                "its input acts a step of {acts} s late in this order, and its actuation_delay is {} s",
                filter.actuation_delay
            ));
        }
        found.push(Drawn {
            filter: c,
            plant: p,
            configuration: plant.clone().deviating(Deviation::of(&filter, step, acts)),
            late: acts > 0.0,
            delayed: (filter.actuation_delay / step * (1.0 - 1e-9)).ceil() as usize,
            delay: filter.actuation_delay,
        });
    }
    if found.is_empty() {
        return Err(
            "has no plant to draw: no filter of the system declares [uncertainty], [measurement_errors] or actuation_delay"
                .to_owned(),
        );
    }
    Ok(found)
}
