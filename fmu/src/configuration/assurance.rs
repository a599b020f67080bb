//! What stands behind the inputs of a filter: plans, or the rows alone. It is decided when the file is read.

use std::cell::RefCell;
use std::fmt;

use punctual_core::filter::{Filter, Plans};
use punctual_core::lie::RelativeDegree;
use punctual_core::plan::Failure;

use super::adding::MixedDegree;
use super::words::words;
use super::{ConfigurationError, FilterConfiguration};

words! {
    /// Whether the filter promises only what a plan keeps.
    pub enum AssuranceName {
        /// A plan behind every input, where all inputs have bounds and plans account for everything; else the rows alone, with a
        /// warning where only the latter fails.
        Auto = "auto",
        /// The rows alone ([`Filter`]).
        Off = "off",
        /// A plan behind every input ([`Filter`](punctual_core::filter::Filter)).
        On = "on",
    }
}

/// What was found out when the filter of a file was built.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Findings {
    backing: Backing,
    degrees: Vec<usize>,
    mixed_degree: Vec<(usize, RelativeDegree)>,
}

/// What stands behind the inputs of a filter.
#[derive(Clone, Debug, Default, PartialEq)]
enum Backing {
    #[default]
    Plans,
    RowsOnly(Reason),
}

/// Why a filter follows no plans. Shown as the end of a sentence.
#[derive(Clone, Debug, PartialEq)]
enum Reason {
    /// The file asks for it.
    Off,
    /// A signal that has not both bounds, in words.
    Unbounded(String),
    /// What the file declares and no plan accounts for, each with its key, in words.
    Unaccounted(String),
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Off => "assurance is \"off\"",
            Self::Unbounded(words) | Self::Unaccounted(words) => words,
        })
    }
}

/// What a file says.
impl FilterConfiguration {
    /// Builds the filter of a file that was just read, keeps what is found out, and hands the rows on.
    pub(super) fn examine(&mut self) -> Result<Filter, ConfigurationError> {
        let mut mixed_degree = Vec::new();
        let built = self.built(MixedDegree::Reported(&mut mixed_degree));
        self.findings.backing = self.backing(&built);
        let keys = [
            ("policy", self.policy.is_some()),
            ("plan_horizon", self.plan_horizon.is_some()),
            ("search_budget", self.search_budget.is_some()),
        ];
        if let (Backing::RowsOnly(reason), Some((key, _))) =
            (&self.findings.backing, keys.iter().find(|(_, is_given)| *is_given))
        {
            let message = format!("is for plans, of which there are none: {reason}");
            return Err(ConfigurationError::new(*key, message));
        }
        // Rows alone refuse some of what was taken here.
        let is_same = mixed_degree.is_empty() && !self.leaves_errors_to_plans();
        let is_certain = self.is_assured() || built.is_ok() && is_same;
        let filter = if is_certain { built } else { self.build() }?;
        if let (Backing::RowsOnly(reason), Some(i)) =
            (&self.findings.backing, self.barrier.iter().position(|b| b.choice.is_some()))
        {
            let message = format!(
                "only plans can choose, and none are followed: {reason}. Change that, or leave the choice out"
            );
            return Err(ConfigurationError::new(format!("barrier[{i}].choice"), message));
        }
        if let (Backing::RowsOnly(reason), Some(_)) = (&self.findings.backing, &self.uncertainty) {
            let message = format!(
                "only plans account for it, and none are followed: {reason}. Change that, or leave `[uncertainty]` out"
            );
            return Err(ConfigurationError::new("uncertainty", message));
        }
        self.findings.degrees = filter.relative_degrees().collect();
        self.findings.mixed_degree = mixed_degree;
        Ok(filter)
    }

    fn backing(&self, built: &Result<Filter, ConfigurationError>) -> Backing {
        let free = self.commanded().into_iter().find(|signal| self.limits(&signal.name).is_none());
        let reason = match (self.assurance, free) {
            (AssuranceName::Off, _) => Some(Reason::Off),
            (AssuranceName::On, _) => None,
            (AssuranceName::Auto, Some(signal)) => {
                Some(Reason::Unbounded(format!("{0} has {1}", signal.name, self.lacking(&signal.name))))
            }
            (AssuranceName::Auto, None) => match built {
                Ok(filter) => self.unaccounted(filter).map(Reason::Unaccounted),
                Err(error) => Some(Reason::Unaccounted(error.to_string())),
            },
        };
        reason.map_or(Backing::Plans, Backing::RowsOnly)
    }

    /// The relative degree of each barrier, with the numbers of the file.
    pub fn relative_degrees(&self) -> &[usize] {
        &self.findings.degrees
    }

    /// The barriers, by their index, whose inputs enter at different orders with the numbers of the file, with what was found:
    /// only plans move them all.
    pub fn mixed_degree(&self) -> &[(usize, RelativeDegree)] {
        &self.findings.mixed_degree
    }

    /// Whether the filter follows plans.
    pub fn is_assured(&self) -> bool {
        self.findings.backing == Backing::Plans
    }

    /// Whether its plans may end before the end of time, in motion or with an uncertain plant, so that it reports until when
    /// it promises.
    pub fn ends_plans(&self) -> bool {
        let follows = || self.barrier.iter().any(|barrier| barrier.shape.followed().is_some());
        self.is_assured() && (self.plan_horizon.is_some() || self.declares_uncertainty() || follows())
    }

    /// Why the filter follows no plans, in words; empty where it does.
    pub fn unassured(&self) -> String {
        match &self.findings.backing {
            Backing::Plans => String::new(),
            Backing::RowsOnly(reason) => reason.to_string(),
        }
    }

    /// What the user has to know of the file: that something in it switches plans off, though every input has bounds and
    /// nobody asked for that.
    pub fn warning(&self) -> Option<String> {
        let Backing::RowsOnly(reason @ Reason::Unaccounted(_)) = &self.findings.backing else { return None };
        let names: Vec<_> = self.barrier.iter().map(|barrier| barrier.name.as_str()).collect();
        Some(format!(
            "plans are off, and with them the guarantee of {}: {reason}. The rows act alone. `assurance = \"on\"` makes this an \
             error, `assurance = \"off\"` accepts it",
            names.join(", ")
        ))
    }
}

/// What is put behind the rows.
impl FilterConfiguration {
    /// The filter with its plans or its integrator, if it has them.
    ///
    /// # Errors
    ///
    /// A number out of range, or numbers that contradict each other.
    pub fn build_loop(&self) -> Result<Filter, ConfigurationError> {
        self.completed(self.build()?)
    }

    /// `rows`, built from this configuration, with its plans or its integrator.
    pub(super) fn completed(&self, rows: Filter) -> Result<Filter, ConfigurationError> {
        if !self.is_assured() {
            return self.integrated(rows);
        }
        match self.assured(rows) {
            Ok(filter) => Ok(filter),
            Err(reason) if self.assurance == AssuranceName::On => {
                let message = format!("is \"on\", must be \"off\": {reason}");
                Err(ConfigurationError::new("assurance", message))
            }
            // A number that was set since asks for what no plan accounts for.
            Err(_) => self.integrated(self.built(MixedDegree::Refused)?),
        }
    }

    /// `rows`, built from this configuration, with plans behind them, whether or not `assurance` asks for them.
    ///
    /// # Errors
    ///
    /// What no plan accounts for yet, in words.
    pub fn assured(&self, rows: Filter) -> Result<Filter, String> {
        if let Some(obstacles) = self.unaccounted(&rows) {
            return Err(obstacles);
        }
        let mut plans = self.plans();
        if let Some(policy) = &self.policy {
            let functions = self.plant.functions("policy", policy).map_err(|e| e.to_string())?;
            let functions = RefCell::new(functions);
            plans = plans.policy(move |t: f64, x: &[f64], u: &mut [f64]| {
                let values = &mut *functions.borrow_mut();
                u.iter_mut().zip(values.at(t, |i| x[i])).for_each(|(u, value)| *u = value);
            });
        }
        self.integrated(rows).map_err(|e| e.to_string())?.with_plans(plans).map_err(|e| e.to_string())
    }

    /// `filter` behind the integrator, if there is one.
    fn integrated(&self, filter: Filter) -> Result<Filter, ConfigurationError> {
        match &self.integrator {
            None => Ok(filter),
            Some(integrator) => integrator.put_before(&self.plant, filter),
        }
    }

    /// The choices: of each the alternatives, each the numbers of its barriers.
    fn choices(&self) -> Vec<Vec<Vec<usize>>> {
        let mut names: Vec<&str> = Vec::new();
        let mut choices: Vec<Vec<Vec<usize>>> = Vec::new();
        for (i, section) in self.barrier.iter().enumerate() {
            let Some(name) = &section.choice else { continue };
            let choice = names.iter().position(|other| other == name).unwrap_or_else(|| {
                names.push(name);
                choices.push(Vec::new());
                names.len() - 1
            });
            let is_beside = |alternative: &&mut Vec<usize>| {
                let other = alternative.first().and_then(|first| self.barrier[*first].alternative.as_ref());
                other.is_some() && other == section.alternative.as_ref()
            };
            match choices[choice].iter_mut().find(is_beside) {
                Some(alternative) => alternative.push(i),
                None => choices[choice].push(vec![i]),
            }
        }
        choices
    }

    /// How plans are made, but for a policy.
    fn plans(&self) -> Plans {
        let plans = Plans::every(self.experiment.step_size)
            .horizon(self.plan_horizon)
            .search_budget(self.search_budget.unwrap_or(Plans::SEARCH_BUDGET))
            .apart(self.apart());
        let plans = self.choices().iter().fold(plans, |plans, alternatives| {
            plans.one_of(&alternatives.iter().map(Vec::as_slice).collect::<Vec<_>>())
        });
        let plans = match self.leaves_errors_to_plans() {
            true => plans.measurement_errors(&self.errors()[..self.plant.states().len()]),
            false => plans,
        };
        let motions = self.barrier.iter().map(|barrier| barrier.shape.followed()?.motion()).enumerate();
        let plans = motions.fold(plans, |plans, (barrier, motion)| match motion {
            Some(motion) => plans.motion(barrier, motion),
            None => plans,
        });
        match &self.uncertainty {
            Some(uncertainty) => uncertainty.declared(&self.plant, plans),
            None => plans,
        }
    }

    /// What keeps plans from being put behind `filter`, built from this configuration: each with its key, in words.
    pub fn unaccounted(&self, filter: &Filter) -> Option<String> {
        if let Some(barrier) = self.external() {
            return Some(format!("barrier {} has no model to run ahead", barrier.name));
        }
        let mut found = Vec::new();
        let unknown =
            self.barrier.iter().find(|b| b.shape.followed().is_some_and(|at| at.motion().is_none()));
        if let Some(barrier) = unknown {
            found.push(format!(
                "{} follows a centre that is moved from outside, and no plan can predict it without its `acceleration`, by how \
                 much its velocity may change",
                barrier.name
            ));
        }
        // `filter` may be the rows alone, before the integrator is put behind them.
        if self.integrator.is_some() && !self.covered().is_empty() {
            let declared = self.declarations();
            found.push(format!("no plan accounts yet for {declared} behind an [integrator]"));
        }
        for error in filter.obstacles(&self.plans()) {
            let (field, message) = (error.field(), error.message());
            let of = |key: &str| {
                let name = field.strip_suffix(key)?.strip_suffix('.')?;
                self.barrier.iter().find(|barrier| barrier.name == name)
            };
            if ["integrator", "measured"].contains(&field) || of("motion").is_some() {
                // Named above.
            } else if of("disturbance").is_some() {
                found.push(format!(
                    "{field} {message}; plans account for `rates` of [uncertainty] in its place"
                ));
            } else if let Some((name, after)) = of("begin").and_then(|b| Some((&b.name, b.after.as_ref()?))) {
                found.push(format!(
                    "{name} begins with the arrival of {after}, whose time is open: give {name} a `deadline` too, or a `begin` \
                     in place of `after`"
                ));
            } else if let Some(barrier) = of("source") {
                // No key has this name. What moves wants the key of a horizon.
                let key = if message.starts_with("moves") { " (`plan_horizon`)" } else { "" };
                found.push(format!("{} {message}{key}", barrier.name));
            } else {
                found.push(format!("{field} {message}"));
            }
        }
        (!found.is_empty()).then(|| found.join("; "))
    }

    /// What keeps a plan from being one, in words.
    pub fn failure(&self, failure: Failure) -> String {
        match (failure, self.plan_horizon) {
            (Failure::NoRest, None) => format!("{failure}; with `plan_horizon` a plan may end in motion"),
            (Failure::NoRest, Some(_)) => "no plan reaches as far as plan_horizon".to_owned(),
            _ => failure.named(self).to_string(),
        }
    }
}
