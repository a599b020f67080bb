//! From a mission to barriers: each task becomes one for each of its conditions, with the times of the task.

use super::super::ConfigurationError;
use super::super::mission::{Literal, Mission, Task};
use super::raw::RawBarrier;
use super::reader::Kind;

/// Shapes and those of what is outside of them.
const OUTSIDE: [(&str, &str); 6] = [
    ("disc", "obstacle"),
    ("sphere", "spherical_obstacle"),
    ("box", "box_obstacle"),
    ("rectangle", "rectangular_obstacle"),
    ("ellipse", "elliptic_obstacle"),
    ("at_most", "at_least"),
];
/// Shapes of places, where nobody is at all times by accident.
const PLACES: [&str; 6] = ["disc", "quadratic_disc", "ellipse", "rectangle", "sphere", "box"];
/// By how much a time is later that has to be after another, as a part of it.
const LATER: f64 = 1e-9;

/// The barriers of the mission `text` over `tables`, for steps of `step` s: those of its tasks, then the tables that it does not
/// name, as they are.
///
/// # Errors
///
/// A text that is no mission; a name without a table; a table with times of its own, or a place that has none and is not named;
/// what barriers do not express.
pub(in super::super) fn of_mission(
    text: &str,
    tables: Vec<RawBarrier>,
    step: f64,
) -> Result<Vec<RawBarrier>, ConfigurationError> {
    let mission = Mission::parse(text)?;
    let regions = mission.regions();
    for region in &regions {
        let Some(i) = tables.iter().position(|table| table.name == *region) else {
            let names: Vec<&str> = tables.iter().map(|table| table.name.as_str()).collect();
            return refuse(format!("has {region}, which is no barrier, must be one of {}", names.join(", ")));
        };
        if let Some((key, _)) = tables[i].of_time().iter().find(|(_, is_given)| *is_given) {
            let message = format!(
                "stands beside a mission that says when: leave it out, or {region} out of the mission"
            );
            return Err(ConfigurationError::new(format!("barrier[{i}].{key}"), message));
        }
    }
    for (i, table) in tables.iter().enumerate().filter(|(_, table)| !regions.contains(&table.name.as_str())) {
        let has_times = table.of_time().iter().any(|(_, is_given)| *is_given);
        if PLACES.contains(&shape(table)) && !has_times {
            let name = &table.name;
            let message = format!(
                "is {name:?}, which the mission does not name, so that it had to be kept at all times: name it (`G {name}`), give it \
                 times of its own, or leave it out"
            );
            return Err(ConfigurationError::new(format!("barrier[{i}].name"), message));
        }
    }
    let mut lowering =
        Lowering { mission: &mission, tables: &tables, step, barriers: Vec::new(), visits: Vec::new() };
    for (index, task) in mission.tasks.iter().enumerate() {
        lowering.add(index, task)?;
    }
    let mut barriers = lowering.barriers;
    barriers.extend(tables.into_iter().filter(|table| !regions.contains(&table.name.as_str())));
    Ok(barriers)
}

fn refuse<T>(message: String) -> Result<T, ConfigurationError> {
    Err(ConfigurationError::new("mission", message))
}

struct Lowering<'a> {
    mission: &'a Mission,
    tables: &'a [RawBarrier],
    step: f64,
    barriers: Vec<RawBarrier>,
    /// The name and the window in s of the barrier of each task that is a visit.
    visits: Vec<Option<(String, [f64; 2])>>,
}

impl Lowering<'_> {
    fn add(&mut self, index: usize, task: &Task) -> Result<(), ConfigurationError> {
        let mut visit = None;
        match task {
            Task::Keep { what, during } => {
                for literal in what {
                    let mut barrier = self.barrier(index, literal)?;
                    if let Some([first, last]) = *during {
                        // An instant is a time that hardly lasts.
                        (barrier.begin, barrier.end) = (first, last.max(first * (1.0 + LATER) + LATER));
                    }
                    self.barriers.push(barrier);
                }
            }
            Task::Visit { what, window, stay, after } => {
                let [literal] = &what[..] else {
                    let names: Vec<String> = what.iter().map(Literal::to_string).collect();
                    let both = names.join(" & ");
                    return refuse(format!(
                        "has a visit of {both} at the same time, must be of one: give a barrier that is all of them, such as an \
                         `expression` with min"
                    ));
                };
                let mut barrier = self.barrier(index, literal)?;
                let window = self.window(*window, *after)?;
                let [first, last] = window;
                if last <= 0.0 {
                    return refuse(format!(
                        "has a visit of {literal} at 0, must be later: `G[0,0] {literal}`"
                    ));
                }
                barrier.deadline = Some(last);
                barrier.begin = first.min(last * (1.0 - LATER));
                match *stay {
                    // Wherever it is at first, it may be left again before its deadline.
                    None => barrier.begin = barrier.begin.max(self.step.min(0.5 * last)),
                    Some(0.0) => barrier.until_arrival = true,
                    Some(stay) => barrier.stay = stay,
                }
                if let Some((name, _)) = after.and_then(|after| self.visits[after].clone())
                    && first <= 0.0
                {
                    (barrier.after, barrier.begin) = (Some(name), 0.0);
                }
                visit = Some((barrier.name.clone(), window));
                self.barriers.push(barrier);
            }
            Task::KeepUntil { what, visit } => {
                for literal in what {
                    let mut barrier = self.barrier(index, literal)?;
                    barrier.until = self.visits[*visit].as_ref().map(|(name, _)| name.clone());
                    self.barriers.push(barrier);
                }
            }
        }
        self.visits.push(visit);
        Ok(())
    }

    /// The window of a visit from the start on, which suits every time within its own of the visit `after`.
    fn window(&self, [first, last]: [f64; 2], after: Option<usize>) -> Result<[f64; 2], ConfigurationError> {
        let Some((name, [least, most])) = after.and_then(|after| self.visits[after].clone()) else {
            return Ok([first, last]);
        };
        // At once after the other, the order says it.
        let window = [if first > 0.0 { most + first } else { 0.0 }, least + last];
        if window[0] > window[1] || window[1] < least {
            return refuse(format!(
                "has a visit {first} to {last} s after that of {name}, which may be {least} to {most} s from the start: that leaves no \
                 time that suits all of them; make the window of {name} narrower, or this one longer"
            ));
        }
        Ok(window)
    }

    /// The barrier of `literal` in task `index`, without times.
    fn barrier(&self, index: usize, literal: &Literal) -> Result<RawBarrier, ConfigurationError> {
        let Some(table) = self.tables.iter().find(|table| table.name == literal.region) else {
            return refuse(format!("has {}, which is no barrier", literal.region));
        };
        let mut barrier = table.clone();
        if literal.negated {
            outside(&mut barrier)?;
        }
        let is_taken = |name: &str| {
            let is_table = name != literal.region && self.tables.iter().any(|table| table.name == name);
            is_table || self.barriers.iter().any(|barrier| barrier.name == name)
        };
        let names =
            core::iter::once(literal.region.clone()).chain((2..).map(|k| format!("{}_{k}", literal.region)));
        barrier.name = names.into_iter().find(|name| !is_taken(name)).unwrap_or_default();
        for (choice, group) in self.mission.groups.iter().enumerate() {
            if let Some(alternative) = group.iter().position(|tasks| tasks.contains(&index)) {
                barrier.choice = Some(format!("choice_{}", choice + 1));
                barrier.alternative = Some(format!("alternative_{}", alternative + 1));
            }
        }
        Ok(barrier)
    }
}

fn shape(barrier: &RawBarrier) -> &'static str {
    match barrier.shape {
        Some(kind) => kind.name(),
        None if barrier.expression.is_some() => "expression",
        None => "disc",
    }
}

/// Turns a barrier into that of what is outside of it.
fn outside(barrier: &mut RawBarrier) -> Result<(), ConfigurationError> {
    let name = shape(barrier);
    let other = OUTSIDE.iter().find_map(|&(inside, outside)| match name {
        _ if name == inside => Some(outside),
        _ if name == outside => Some(inside),
        _ => None,
    });
    match (name, other) {
        (_, Some(other)) => barrier.shape = Kind::named(other),
        ("half_plane", _) => barrier.normal = barrier.normal.map(|normal| normal.map(|part| -part)),
        ("expression", _) => barrier.expression = barrier.expression.take().map(|h| format!("-({h})")),
        _ => {
            let message = format!("has !{}, a {name}, of which there is no outside", barrier.name);
            return refuse(format!("{message}: give a barrier that is it"));
        }
    }
    Ok(())
}
