//! `[[agent]]`: a team of vehicles of one model, as the joint model of all of them. Each table of the file that says something of
//! one vehicle becomes one for each, before anything else looks at it.

use std::collections::BTreeMap;

use punctual_models::is_in_name;
use serde::Deserialize;

use super::barrier::RawBarrier;
use super::filter::RawFilter;
use super::key::{
    Key, Section,
    Unit::Of,
    Value::{Name, NumberByName, TextByName},
};
use super::model::{OwnModel, RawModel};
use super::names::{check_identifier, check_known};
use super::{ConfigurationError, MAX_STATES, Range, VariableSection};

/// `[[agent]]` as written in a file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawAgent {
    name: String,
    #[serde(default)]
    parameters: BTreeMap<String, f64>,
    #[serde(default)]
    x0: BTreeMap<String, f64>,
    #[serde(default)]
    u_ref: BTreeMap<String, String>,
}

/// `[[agent]]`.
pub(super) static SECTION: Section = Section {
    name: "agent",
    keys: || {
        static KEYS: [Key; 4] = [
            Key::new(
                "name",
                Name,
                None,
                "unique; the first part of the names of its states, inputs and barriers",
            ),
            Key::new(
                "parameters",
                NumberByName(Of("in its unit"), Range::FINITE),
                Some("those of the model"),
                "constants of the model that are others for this agent, such as its mass or where it has to go",
            ),
            Key::new(
                "x0",
                NumberByName(Of("unit of the state"), Range::FINITE),
                Some("`[x0]` of the file"),
                "a run of this file: the start, by the names of the model",
            ),
            Key::new(
                "u_ref",
                TextByName,
                Some("`[u_ref]` of the file"),
                "a run of this file: what is wanted, by the names of the model",
            ),
        ];
        KEYS.iter().collect()
    },
};

fn refuse<T>(field: impl Into<String>, message: impl Into<String>) -> Result<T, ConfigurationError> {
    Err(ConfigurationError::new(field, message))
}

impl RawFilter {
    /// The filter with the joint model of its agents in place of theirs.
    ///
    /// # Errors
    ///
    /// A model that cannot be joined, names that are taken, too many agents; keys that a team does not have.
    pub(super) fn joined(mut self) -> Result<Self, ConfigurationError> {
        let agents = std::mem::take(&mut self.agent);
        if agents.is_empty() {
            if self.keep_apart.is_some() {
                return refuse("keep_apart", "is for a team: it needs `[[agent]]`");
            }
            return match self.barrier.iter().position(|barrier| barrier.agent.is_some()) {
                Some(i) => refuse(format!("barrier[{i}].agent"), "is for a team: it needs `[[agent]]`"),
                None => Ok(self),
            };
        }
        for (key, is_given) in [
            ("integrator", self.integrator.is_some()),
            ("simulated", self.simulated.is_some()),
            ("disturbance", self.disturbance.is_some()),
        ] {
            if is_given {
                return refuse(key, "stands beside `[[agent]]`, must be left out: a team has none");
            }
        }
        let team = Team { model: std::mem::take(&mut self.plant).own()?, agents };
        team.check()?;
        self.barrier = team.barriers(&self.barrier, self.keep_apart.take())?;
        self.plant = team.joint_model();
        team.spread(&mut self.bounds, |_, bounds| *bounds);
        team.spread(&mut self.measurement_errors, |_, error| *error);
        if let Some(uncertainty) = &mut self.uncertainty {
            team.spread(&mut uncertainty.rates, |_, rate| *rate);
            team.spread(&mut uncertainty.inputs, |_, input| *input);
        }
        if let Some(follower) = &mut self.follower {
            team.spread(&mut follower.start, |_, size| *size);
            if let Some(freedom) = &mut follower.freedom {
                team.spread(freedom, |_, size| *size);
            }
        }
        if let Some(policy) = &mut self.policy {
            team.spread(policy, |agent, text| team.renamed(agent, text));
        }
        team.spread(&mut self.x0, |_, start| *start);
        let mut wanted = self.u_ref.take().unwrap_or_default();
        team.spread(&mut wanted, |agent, text| team.renamed(agent, text));
        for agent in &team.agents {
            let starts = agent.x0.iter().map(|(state, start)| (joint(agent, state), *start));
            self.x0.extend(starts);
            let texts =
                agent.u_ref.iter().map(|(input, text)| (joint(agent, input), team.renamed(agent, text)));
            wanted.extend(texts);
        }
        self.u_ref = Some(wanted).filter(|wanted| !wanted.is_empty());
        Ok(self)
    }
}

/// The name of what is called `name` in the model of one, for `agent`.
fn joint(agent: &RawAgent, name: &str) -> String {
    format!("{}_{name}", agent.name)
}

struct Team {
    /// Of one.
    model: OwnModel,
    agents: Vec<RawAgent>,
}

impl Team {
    fn check(&self) -> Result<(), ConfigurationError> {
        for (i, agent) in self.agents.iter().enumerate() {
            let name = &agent.name;
            check_identifier(&format!("agent[{i}].name"), name)?;
            if self.agents[..i].iter().any(|other| other.name == *name) {
                return refuse(format!("agent[{i}].name"), format!("is {name:?}, which is another agent's"));
            }
            check_known(&format!("agent[{i}].x0"), &agent.x0, "state", &self.model.states)?;
            check_known(&format!("agent[{i}].u_ref"), &agent.u_ref, "input", &self.model.inputs)?;
            let known: Vec<&str> = self.model.parameters.iter().map(|p| p.name.as_str()).collect();
            if let Some(unknown) = agent.parameters.keys().find(|key| !known.contains(&key.as_str())) {
                let known = if known.is_empty() { "the model has none".into() } else { known.join(", ") };
                let message = format!("is no parameter of the model, must be one of them: {known}");
                return refuse(format!("agent[{i}].parameters.{unknown}"), message);
            }
        }
        for (what, each, most) in [
            ("states", self.model.states.len(), MAX_STATES),
            ("inputs", self.model.inputs.len(), punctual_core::MAX_INPUTS),
        ] {
            let count = self.agents.len();
            if count * each > most {
                let message = format!(
                    "has {count} entries with {each} {what} each, must have at most {most} {what} in all"
                );
                return refuse("agent", message);
            }
        }
        Ok(())
    }

    /// Whether each agent has a variable or a constant of its own that is called `name` in the model.
    fn is_own(&self, agent: &RawAgent, name: &str) -> bool {
        let is = |variables: &[VariableSection]| variables.iter().any(|variable| variable.name == name);
        is(&self.model.states) || is(&self.model.inputs) || agent.parameters.contains_key(name)
    }

    /// The expression `text` of the model, for `agent`.
    fn renamed(&self, agent: &RawAgent, text: &str) -> String {
        let mut renamed = String::new();
        let mut rest = text;
        while let Some(first) = rest.chars().next() {
            let is_word = is_in_name(first);
            let end = rest.find(|c| is_in_name(c) != is_word).unwrap_or(rest.len());
            let (part, after) = rest.split_at(end);
            renamed += &if self.is_own(agent, part) { joint(agent, part) } else { part.to_owned() };
            rest = after;
        }
        renamed
    }

    /// Replaces each entry for a variable of the model by one for each agent, unless there is one for that agent.
    fn spread<T>(&self, table: &mut BTreeMap<String, T>, mut of: impl FnMut(&RawAgent, &T) -> T) {
        let variables = self.model.states.iter().chain(&self.model.inputs);
        for (name, value) in variables.filter_map(|v| table.remove_entry(&v.name)).collect::<Vec<_>>() {
            for agent in &self.agents {
                let own = of(agent, &value);
                table.entry(joint(agent, &name)).or_insert(own);
            }
        }
    }

    fn joint_model(&self) -> RawModel {
        let mut all = OwnModel::default();
        all.parameters.clone_from(&self.model.parameters);
        for agent in &self.agents {
            let variables = |of: &[VariableSection]| -> Vec<VariableSection> {
                let named = |v: &VariableSection| {
                    let words = [agent.name.as_str(), &v.description].join(": ");
                    let description = words.trim_end_matches(": ").to_owned();
                    VariableSection { name: joint(agent, &v.name), description, ..v.clone() }
                };
                of.iter().map(named).collect()
            };
            all.states.extend(variables(&self.model.states));
            all.inputs.extend(variables(&self.model.inputs));
            let parameters = self.model.parameters.iter().filter_map(|p| {
                let start = *agent.parameters.get(&p.name)?;
                let words = [agent.name.as_str(), &p.description].join(": ");
                let description = words.trim_end_matches(": ").to_owned();
                let name = joint(agent, &p.name);
                Some(super::ParameterSection { name, start, description, ..p.clone() })
            });
            all.parameters.extend(parameters);
            let derivatives = self
                .model
                .derivatives
                .iter()
                .map(|(state, text)| (joint(agent, state), self.renamed(agent, text)));
            all.derivatives.extend(derivatives);
        }
        RawModel::from(all)
    }

    /// The barriers of all: each table for one agent or for all of them, or as it is where it is about several; and the distances.
    fn barriers(
        &self,
        tables: &[RawBarrier],
        keep_apart: Option<f64>,
    ) -> Result<Vec<RawBarrier>, ConfigurationError> {
        let mut barriers = Vec::new();
        for (i, table) in tables.iter().enumerate() {
            match &table.agent {
                Some(name) => {
                    let Some(agent) = self.agents.iter().find(|agent| agent.name == *name) else {
                        let names: Vec<&str> = self.agents.iter().map(|agent| agent.name.as_str()).collect();
                        let message = format!("is {name:?}, must be one of {}", names.join(", "));
                        return refuse(format!("barrier[{i}].agent"), message);
                    };
                    barriers.push(self.barrier(agent, table, tables, i)?);
                }
                None if self.is_joint(table) => barriers.push(table.clone()),
                None => {
                    for agent in &self.agents {
                        barriers.push(self.barrier(agent, table, tables, i)?);
                    }
                }
            }
        }
        if let Some(distance) = keep_apart {
            Range::POSITIVE.check("keep_apart", distance)?;
            let Some(position) = self.model.position() else {
                let names: Vec<&str> = self.model.states.iter().map(|state| state.name.as_str()).collect();
                let message = format!(
                    "needs to know where an agent is: call the states of its position x and y (and z), of {}",
                    names.join(", ")
                );
                return refuse("keep_apart", message);
            };
            for (i, first) in self.agents.iter().enumerate() {
                for second in &self.agents[i + 1..] {
                    let place = |agent| position.iter().map(|state| joint(agent, state)).collect();
                    let name = format!("apart_{}_{}", first.name, second.name);
                    barriers.push(RawBarrier::apart(name, [place(first), place(second)], distance));
                }
            }
        }
        Ok(barriers)
    }

    /// Whether a table names states of agents, and so is about them and not about each.
    fn is_joint(&self, table: &RawBarrier) -> bool {
        let names = self.agents.iter().flat_map(|agent| {
            self.model.states.iter().chain(&self.model.inputs).map(|variable| joint(agent, &variable.name))
        });
        names.into_iter().any(|name| table.mentions(&name))
    }

    /// Table `index` of `tables` for `agent`.
    fn barrier(
        &self,
        agent: &RawAgent,
        table: &RawBarrier,
        tables: &[RawBarrier],
        index: usize,
    ) -> Result<RawBarrier, ConfigurationError> {
        let mut barrier = table.clone();
        let is_for_all = barrier.agent.take().is_none();
        barrier.name = joint(agent, &table.name);
        // What each has is meant of the same agent.
        let is_each = |name: &str| {
            let is = |other: &RawBarrier| other.agent.as_ref().is_none_or(|of| *of == agent.name);
            tables.iter().any(|other| other.name == name && !self.is_joint(other) && is(other))
        };
        for name in [&mut barrier.after, &mut barrier.until].into_iter().flatten() {
            if is_each(name) {
                *name = joint(agent, name);
            }
        }
        if is_for_all && let Some(choice) = &mut barrier.choice {
            *choice = joint(agent, choice);
        }
        barrier.of_agent(&self.model, &format!("barrier[{index}]"), |text| self.renamed(agent, text))?;
        Ok(barrier)
    }
}

#[cfg(test)]
mod tests;
