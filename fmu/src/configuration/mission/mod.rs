//! Missions: where to be and when, as a formula of signal temporal logic, and its normal form.
//!
//! A formula such as `F[0,10] A & G !C` is of names of regions and becomes tasks to be done: *visit A within 10 s*, *keep
//! out of C*. The text has the syntax of [rtamt](https://github.com/nickovic/rtamt), which monitors the same formula with
//! each name standing for h of its region. What regions are is not known here.
//!
//! [`syntax`] has the grammar, [`tasks`] what of it is a mission, and why the rest is not.

mod syntax;
mod tasks;
#[cfg(test)]
mod tests;

use std::fmt;

use super::ConfigurationError;

/// A mission: tasks, and which of them are alternatives to one another.
///
/// It is accomplished if every task is that no group names, and of every group all tasks of at least one alternative.
/// Times are in s and count from 0, when the filter takes its first step.
///
/// Tasks that refer to one another, by `after` or `visit`, are accomplished together: there has to be one choice of the
/// times of their visits that suits all of them. They follow one another in [`Self::tasks`], and an alternative has either
/// all of them or none.
#[derive(Clone, Debug, PartialEq)]
pub struct Mission {
    /// What is to be done, in the order of the text. A task refers to earlier ones only.
    pub tasks: Vec<Task>,
    /// The choices. Each has at least two alternatives and at most 64, and each of these is the indices of its tasks. No
    /// task is in two groups.
    pub groups: Vec<Vec<Vec<usize>>>,
}

/// A condition on the state: to be in a region, h ≥ 0, or not.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Literal {
    /// The name of the region, a C identifier.
    pub region: String,
    /// Whether the state has to be outside, h < 0.
    pub negated: bool,
}

/// One thing to be done. All conditions of its `what` hold at the same time.
#[derive(Clone, Debug, PartialEq)]
pub enum Task {
    /// `G[a,b] p`: conditions hold at all times of an interval.
    Keep {
        /// The conditions, at least one.
        what: Vec<Literal>,
        /// The first and the last time in s, 0 ≤ first ≤ last < ∞; `None`: from 0 for ever.
        during: Option<[f64; 2]>,
    },
    /// `F[a,b] p`: conditions hold at some time of an interval, and from then on for a while.
    Visit {
        /// The conditions, of which at least one is not negated.
        what: Vec<Literal>,
        /// The first and the last time at which it may begin, in s, 0 ≤ first ≤ last < ∞: after 0, or after the beginning
        /// of the visit `after`.
        window: [f64; 2],
        /// For how many s the conditions hold from then on, ≥ 0 and finite; `None`: for ever.
        stay: Option<f64>,
        /// The index of the visit that it follows, one of which `stay` is `Some(0.0)`. At most one follows each.
        after: Option<usize>,
    },
    /// `p U[a,b] q`: conditions hold at all times from 0 until a visit begins, and not necessarily when it does.
    KeepUntil {
        /// The conditions, at least one.
        what: Vec<Literal>,
        /// The index of the visit. It follows no other, and its `stay` is `Some(0.0)`.
        visit: usize,
    },
}

impl Task {
    /// The conditions.
    pub fn what(&self) -> &[Literal] {
        match self {
            Self::Keep { what, .. } | Self::Visit { what, .. } | Self::KeepUntil { what, .. } => what,
        }
    }
}

impl Mission {
    /// Reads a mission.
    ///
    /// # Errors
    ///
    /// Text that is empty, too long or no formula, with the position of the defect; a formula that is no mission, such as a
    /// visit without a deadline, with the part of the text and what to write instead; more than 64 alternatives of one
    /// choice, or more than 256 tasks.
    pub fn parse(text: &str) -> Result<Self, ConfigurationError> {
        let mission = tasks::mission(text, &syntax::parse(text)?)?;
        // So its own text can be read as well.
        let length = mission.to_string().len();
        if length > syntax::MAX_LENGTH {
            let most = syntax::MAX_LENGTH;
            return Err(syntax::error(format!(
                "has {length} bytes with its alternatives written out, must have at most {most}"
            )));
        }
        Ok(mission)
    }

    /// The names of the regions, each once, in the order in which the tasks use them first.
    pub fn regions(&self) -> Vec<&str> {
        let mut regions = Vec::new();
        for literal in self.tasks.iter().flat_map(Task::what) {
            if !regions.contains(&literal.region.as_str()) {
                regions.push(&literal.region);
            }
        }
        regions
    }

    /// The indices of the tasks that no group names, which are always to be done.
    pub fn required(&self) -> Vec<usize> {
        (0..self.tasks.len()).filter(|task| self.group_of(*task).is_none()).collect()
    }

    fn group_of(&self, task: usize) -> Option<usize> {
        self.groups.iter().position(|group| group.iter().any(|alternative| alternative.contains(&task)))
    }

    /// The formula of a task and of those that refer to it; none of one that refers to another.
    fn formula(&self, task: usize) -> Option<String> {
        let later = || self.tasks.iter().enumerate().skip(task + 1);
        match self.tasks.get(task)? {
            Task::Keep { what, during } => {
                Some(format!("G{} {}", during.map_or_else(String::new, interval), Conditions(what)))
            }
            Task::Visit { what, window, after: None, .. } => {
                let until = later().find_map(|(_, other)| match other {
                    Task::KeepUntil { what, visit } if *visit == task => Some(what),
                    _ => None,
                });
                Some(match until {
                    Some(kept) => format!("{} U{} {}", Conditions(kept), interval(*window), Conditions(what)),
                    None => self.visits(task),
                })
            }
            Task::Visit { .. } | Task::KeepUntil { .. } => None,
        }
    }

    /// The formula of a visit and of those that follow it.
    fn visits(&self, first: usize) -> String {
        let (mut text, mut open, mut next) = (String::new(), 0, Some(first));
        while let Some(visit) = next {
            let Some(Task::Visit { what, window, stay, .. }) = self.tasks.get(visit) else { break };
            let follows = |task: &Task| matches!(task, Task::Visit { after, .. } if *after == Some(visit));
            next = (visit + 1..self.tasks.len()).find(|other| follows(&self.tasks[*other]));
            text += &format!("F{} ", interval(*window));
            text += &match (next, *stay) {
                (Some(_), _) => {
                    open += 1;
                    let each: Vec<_> = what.iter().map(Literal::to_string).collect();
                    format!("({} & ", each.join(" & "))
                }
                (None, None) => format!("G {}", Conditions(what)),
                (None, Some(0.0)) => Conditions(what).to_string(),
                (None, Some(stay)) => format!("G{} {}", interval([0.0, stay]), Conditions(what)),
            };
        }
        text + &")".repeat(open)
    }

    /// The formula of all of these tasks.
    fn all(&self, tasks: &[usize]) -> String {
        tasks.iter().filter_map(|task| self.formula(*task)).collect::<Vec<_>>().join(" & ")
    }
}

impl fmt::Display for Mission {
    /// Writes a formula with this normal form.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut parts = Vec::new();
        let mut written = vec![false; self.groups.len()];
        for task in 0..self.tasks.len() {
            match self.group_of(task) {
                None => parts.extend(self.formula(task)),
                Some(group) if !written[group] => {
                    written[group] = true;
                    let each: Vec<_> = self.groups[group].iter().map(|tasks| self.all(tasks)).collect();
                    let is_alone = self.groups.len() == 1 && self.required().is_empty();
                    let text = each.join(" | ");
                    parts.push(if is_alone { text } else { format!("({text})") });
                }
                Some(_) => {}
            }
        }
        f.write_str(&parts.join(" & "))
    }
}

impl fmt::Display for Literal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let sign = if self.negated { "!" } else { "" };
        write!(f, "{sign}{}", self.region)
    }
}

/// Conditions as an operand: several of them in parentheses.
struct Conditions<'a>(&'a [Literal]);

impl fmt::Display for Conditions<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let each: Vec<_> = self.0.iter().map(Literal::to_string).collect();
        match &each[..] {
            [one] => f.write_str(one),
            several => write!(f, "({})", several.join(" & ")),
        }
    }
}

/// An interval as in a formula, such as `[0,2.5]`, with digits that are read as the same numbers.
fn interval([first, last]: [f64; 2]) -> String {
    /// The least whole number that Rust writes with an exponent if asked for the shortest text.
    const LONG: f64 = 1e16;
    let digits = |time: f64| match time.fract() == 0.0 && time < LONG {
        true => format!("{time}"),
        false => format!("{time:?}"),
    };
    format!("[{},{}]", digits(first), digits(last))
}
