//! Turns the tree of a formula into tasks, and refuses what no mission has.
//!
//! Three laws of the logic are used, each exact. *Shift*: p at all times from s + c to s + d, for some s from a to b, is the
//! visit of p at some time from a + c to b + c that stays for d − c. *Distribution*: `a & (b | c)` is `a & b | a & c`, which
//! is written out within one choice only, so that choices that have to be made side by side stay apart. *Repetition*:
//! `a & a` is `a`.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use super::syntax::{Interval, Node, Tree, check_interval, error, quoted, shortened};
use super::{Literal, Mission, Task, interval};
use crate::configuration::ConfigurationError;

/// Most alternatives of one choice.
pub(super) const MAX_ALTERNATIVES: usize = 64;

/// Most tasks of a mission, twice as many as there may be barriers.
pub(super) const MAX_TASKS: usize = 256;

/// More alternatives are not counted.
const MOST_COUNTED: usize = 1_000_000;

/// Tasks that refer to one another, with indices among themselves.
type Errand = Vec<Task>;

/// What is to be done: errands by their indices, and how they are joined.
enum Goal {
    One(usize),
    All(Vec<Goal>),
    Any(Vec<Goal>),
}

/// The normal form of a formula.
///
/// # Errors
///
/// A part of it that no mission has; too many alternatives or tasks.
pub(super) fn mission(text: &str, tree: &Tree) -> Result<Mission, ConfigurationError> {
    let mut reader = Reader { text, errands: Vec::new() };
    let goal = reader.goal(tree)?;
    let mut parts = Vec::new();
    conjuncts(&goal, &mut parts);
    let (mut tasks, mut groups, mut required) = (Vec::new(), Vec::new(), BTreeMap::new());
    for part in parts {
        if let Goal::One(errand) = part {
            place(*errand, &reader.errands, &mut required, &mut tasks);
            continue;
        }
        let count = count(part);
        if count > MAX_ALTERNATIVES {
            let (more, count) = if count > MOST_COUNTED { ("more than ", MOST_COUNTED) } else { ("", count) };
            return Err(error(format!(
                "has a choice of {more}{count} alternatives, must have at most {MAX_ALTERNATIVES}; join choices that do not \
                 depend on each other by & outside of any |"
            )));
        }
        // Nothing is shared with other choices, nor with what is always to be done.
        let mut places = BTreeMap::new();
        let mut group = Vec::new();
        for errands in alternatives(part) {
            let mut alternative = Vec::new();
            let mut seen = BTreeSet::new();
            for errand in errands.into_iter().filter(|errand| seen.insert(*errand)) {
                alternative.extend(place(errand, &reader.errands, &mut places, &mut tasks));
            }
            group.push(alternative);
        }
        groups.push(group);
    }
    match tasks.len() {
        0..=MAX_TASKS => Ok(Mission { tasks, groups }),
        count => Err(too_many(count)),
    }
}

fn too_many(tasks: usize) -> ConfigurationError {
    error(format!("has {tasks} tasks, must have at most {MAX_TASKS}"))
}

/// The tasks of an errand by their indices, which are added if they have no place yet.
fn place(
    errand: usize,
    errands: &[Errand],
    places: &mut BTreeMap<usize, Range<usize>>,
    tasks: &mut Vec<Task>,
) -> Range<usize> {
    let first = tasks.len();
    let place = places.entry(errand).or_insert_with(|| {
        tasks.extend(errands[errand].iter().cloned().map(|mut task| {
            match &mut task {
                Task::Visit { after: Some(other), .. } | Task::KeepUntil { visit: other, .. } => {
                    *other += first;
                }
                Task::Keep { .. } | Task::Visit { .. } => {}
            }
            task
        }));
        first..tasks.len()
    });
    place.clone()
}

/// The parts of `goal` that are joined by `&` outside of any `|`.
fn conjuncts<'a>(goal: &'a Goal, parts: &mut Vec<&'a Goal>) {
    match goal {
        Goal::All(all) => all.iter().for_each(|goal| conjuncts(goal, parts)),
        Goal::One(_) | Goal::Any(_) => parts.push(goal),
    }
}

/// The number of alternatives of a choice that is written out, or a larger number than is counted.
fn count(goal: &Goal) -> usize {
    let counts = |all: &[Goal]| all.iter().map(count).collect::<Vec<_>>();
    let count = match goal {
        Goal::One(_) => 1,
        Goal::All(all) => counts(all).into_iter().fold(1, usize::saturating_mul),
        Goal::Any(all) => counts(all).into_iter().fold(0, usize::saturating_add),
    };
    count.min(MOST_COUNTED + 1)
}

/// The alternatives of a choice that is written out, each the errands that it consists of.
fn alternatives(goal: &Goal) -> Vec<Vec<usize>> {
    match goal {
        Goal::One(errand) => vec![vec![*errand]],
        Goal::Any(all) => all.iter().flat_map(alternatives).collect(),
        Goal::All(all) => all.iter().fold(vec![Vec::new()], |before, goal| {
            let next = alternatives(goal);
            let both = |first: &Vec<usize>| {
                let first = first.clone();
                next.iter().map(move |second| [&first[..], second].concat()).collect::<Vec<_>>()
            };
            before.iter().flat_map(both).collect()
        }),
    }
}

struct Reader<'a> {
    text: &'a str,
    /// The errands found so far, each once.
    errands: Vec<Errand>,
}

impl Reader<'_> {
    fn part(&self, tree: &Tree) -> &str {
        &self.text[tree.span.clone()]
    }

    /// A part of the text as an operand.
    fn grouped(&self, tree: &Tree) -> String {
        match &tree.node {
            // Without parentheses it begins where its first operand does.
            Node::And(all) | Node::Or(all) if all.iter().any(|one| one.span.start == tree.span.start) => {
                format!("({})", self.part(tree))
            }
            _ => self.part(tree).to_owned(),
        }
    }

    /// The operator of `tree` with its interval, as the text has it before the operand.
    fn head(&self, tree: &Tree, operand: &Tree) -> &str {
        self.text[tree.span.start..operand.span.start].trim_start_matches('(').trim()
    }

    /// The refusal of a part of the text.
    fn refuse(&self, tree: &Tree, message: impl AsRef<str>) -> ConfigurationError {
        error(format!("{} {}", quoted(self.part(tree)), message.as_ref()))
    }

    fn goal(&mut self, tree: &Tree) -> Result<Goal, ConfigurationError> {
        let errand = match &tree.node {
            Node::And(all) => return Ok(Goal::All(self.goals(all)?)),
            Node::Or(all) => return Ok(Goal::Any(self.goals(all)?)),
            Node::Always(during, operand) => {
                let what = self.conditions(tree, operand)?;
                vec![Task::Keep { what, during: *during }]
            }
            Node::Eventually(..) => {
                let mut errand = Vec::new();
                self.visit(tree, &mut errand)?;
                errand
            }
            Node::Until(window, operands) => self.until(tree, *window, operands)?,
            Node::Name(_) => return Err(self.alone(tree)),
            Node::Not(inner) if matches!(inner.node, Node::Name(_)) => return Err(self.alone(tree)),
            Node::Not(inner) => return Err(self.negation(tree, inner)),
        };
        let known = self.errands.iter().position(|other| *other == errand);
        let index = known.unwrap_or(self.errands.len());
        if known.is_none() {
            self.errands.push(errand);
        }
        let tasks = self.errands.iter().map(Vec::len).sum();
        if tasks > MAX_TASKS {
            return Err(too_many(tasks));
        }
        Ok(Goal::One(index))
    }

    fn goals(&mut self, all: &[Tree]) -> Result<Vec<Goal>, ConfigurationError> {
        all.iter().map(|tree| self.goal(tree)).collect()
    }

    /// The refusal of a condition that no operator stands before.
    fn alone(&self, tree: &Tree) -> ConfigurationError {
        let part = shortened(self.part(tree));
        self.refuse(
            tree,
            format!(
                "stands without G, F or U and so would hold at the start only, must be G {part} to be kept, or G[0,0] {part} \
                 if that is meant; G, F and ! bind more tightly than U, & and |, so G A & B is (G A) & B"
            ),
        )
    }

    /// The refusal of a negation of more than a name.
    fn negation(&self, tree: &Tree, inner: &Tree) -> ConfigurationError {
        let instead = match &inner.node {
            Node::Name(_) => "is a negation",
            Node::Not(_) => "negates twice, must be written without both",
            Node::And(_) => "negates more than a name, must have ! before names only; !(A & B) is !A | !B",
            Node::Or(_) => "negates more than a name, must have ! before names only; !(A | B) is !A & !B",
            Node::Eventually(..) => {
                "negates more than a name, must have ! before names only; !F[0,10] A is G[0,10] !A"
            }
            Node::Always(..) | Node::Until(..) => {
                "negates more than a name, must have ! before names only; write what is to be done instead"
            }
        };
        self.refuse(tree, instead)
    }

    /// Conditions that hold together, the `operand` of `operator`.
    fn conditions(&self, operator: &Tree, operand: &Tree) -> Result<Vec<Literal>, ConfigurationError> {
        let mut what = Vec::new();
        self.add_conditions(operator, operand, &mut what)?;
        Ok(what)
    }

    fn add_conditions(
        &self,
        operator: &Tree,
        operand: &Tree,
        what: &mut Vec<Literal>,
    ) -> Result<(), ConfigurationError> {
        let (region, negated) = match &operand.node {
            Node::Name(name) => (name, false),
            Node::Not(inner) => match &inner.node {
                Node::Name(name) => (name, true),
                _ => return Err(self.negation(operand, inner)),
            },
            Node::And(all) => {
                return all.iter().try_for_each(|part| self.add_conditions(operator, part, what));
            }
            _ => return Err(self.no_condition(operator, operand)),
        };
        let literal = Literal { region: region.clone(), negated };
        if !what.contains(&literal) {
            what.push(literal);
        }
        Ok(())
    }

    /// The refusal of an operand of `operator` that is no condition.
    fn no_condition(&self, operator: &Tree, operand: &Tree) -> ConfigurationError {
        if let Node::Or(all) = &operand.node {
            let instead = match &operator.node {
                Node::Eventually(_, whole) if whole.span == operand.span => {
                    let head = self.head(operator, whole);
                    let each: Vec<_> =
                        all.iter().map(|part| format!("{head} {}", self.grouped(part))).collect();
                    shortened(&each.join(" | "))
                }
                Node::Eventually(..) => "F[0,10] A | F[0,10] B".to_owned(),
                Node::Until(..) => "A U[0,10] C | B U[0,10] C".to_owned(),
                _ => "G A | G B, of which one is kept all the time".to_owned(),
            };
            let part = quoted(self.part(operand));
            let message = format!(
                "has the alternatives {part} within, must have | between tasks instead, such as {instead}"
            );
            return self.refuse(operator, message);
        }
        let message = match (&operator.node, &operand.node) {
            (Node::Always(..), Node::Eventually(..)) => {
                "asks for a visit again and again, must have an end; write each visit, such as F[0,10] A & F[10,20] A"
                    .to_owned()
            }
            (Node::Always(Some([a, b]), _), Node::Always(Some([c, d]), _)) => {
                format!("has G within G, must have one: G{}", interval([a + c, b + d]))
            }
            (Node::Always(..), Node::Always(..)) => "has G within G, must have one: G A".to_owned(),
            (Node::Always(..), _) => {
                "has U within G, must have names there; each U is a task that begins at 0".to_owned()
            }
            (Node::Until(..), _) => {
                "has an operator beside U, must have names there, such as A U[0,10] B; what else is to be done is joined by &"
                    .to_owned()
            }
            _ => "has an operator where conditions hold together, must have names there; join tasks by &".to_owned(),
        };
        self.refuse(operator, message)
    }

    /// Refuses a visit of nothing but the outside of regions.
    fn check_goal(&self, tree: &Tree, what: &[Literal], window: Interval) -> Result<(), ConfigurationError> {
        if what.iter().any(|literal| !literal.negated) {
            return Ok(());
        }
        let message = match what.first() {
            None => "names no region to be in, must name one, such as F[0,10] (A & F[0,10] B)".to_owned(),
            Some(out) => format!(
                "has only outsides to visit, must name a region to be in; to keep out of one is G{} {out}",
                interval(window)
            ),
        };
        Err(self.refuse(tree, message))
    }

    /// A deadline is needed, by `operator` with its example.
    fn window(
        &self,
        tree: &Tree,
        window: Option<Interval>,
        example: &str,
    ) -> Result<Interval, ConfigurationError> {
        window.ok_or_else(|| self.refuse(tree, format!("has no deadline, must have one, such as {example}")))
    }

    fn until(
        &self,
        tree: &Tree,
        window: Option<Interval>,
        [left, right]: &[Tree; 2],
    ) -> Result<Errand, ConfigurationError> {
        let window = self.window(tree, window, "A U[0,10] B")?;
        let kept = self.conditions(tree, left)?;
        let what = self.conditions(tree, right)?;
        self.check_goal(tree, &what, window)?;
        let visit = Task::Visit { what, window, stay: Some(0.0), after: None };
        Ok(vec![visit, Task::KeepUntil { what: kept, visit: 0 }])
    }

    /// Adds the visit of `F`, which follows the last of `errand`, and those that follow it.
    fn visit(&self, tree: &Tree, errand: &mut Errand) -> Result<(), ConfigurationError> {
        let Node::Eventually(window, operand) = &tree.node else { return Err(self.no_condition(tree, tree)) };
        let window = self.window(tree, *window, "F[0,10] A")?;
        let after = errand.len().checked_sub(1);
        let (what, window, stay, next) = match &operand.node {
            Node::Always(None, kept) => (self.conditions(operand, kept)?, window, None, None),
            Node::Always(Some([c, d]), kept) => {
                let window = window.map(|time| time + c);
                check_interval(self.part(tree), window)?;
                (self.conditions(operand, kept)?, window, Some(d - c), None)
            }
            Node::Eventually(Some([c, d]), _) => {
                let [a, b] = window;
                let message = format!("has F within F, must have one: F{}", interval([a + c, b + d]));
                return Err(self.refuse(tree, message));
            }
            Node::Eventually(None, _) => {
                return Err(self.refuse(operand, "has no deadline, must be one F with one"));
            }
            Node::Until(..) => {
                let message = "has U within F, must have names there; each U is a task that begins at 0";
                return Err(self.refuse(tree, message));
            }
            _ => {
                let (mut what, mut next) = (Vec::new(), None);
                self.stop(tree, operand, &mut what, &mut next)?;
                (what, window, Some(0.0), next)
            }
        };
        self.check_goal(tree, &what, window)?;
        errand.push(Task::Visit { what, window, stay, after });
        next.map_or(Ok(()), |next| self.visit(next, errand))
    }

    /// Splits what is within the F of `tree` into its conditions and the visit that follows.
    fn stop<'a>(
        &self,
        tree: &Tree,
        operand: &'a Tree,
        what: &mut Vec<Literal>,
        next: &mut Option<&'a Tree>,
    ) -> Result<(), ConfigurationError> {
        match &operand.node {
            Node::And(all) => all.iter().try_for_each(|part| self.stop(tree, part, what, next)),
            Node::Eventually(..) if next.is_none() => {
                *next = Some(operand);
                Ok(())
            }
            Node::Eventually(..) => {
                let message = "has two visits that follow the same, must have one after the other, such as \
                               F[0,10] (A & F[0,10] (B & F[0,10] C))";
                Err(self.refuse(tree, message))
            }
            Node::Always(..) => {
                let part = quoted(self.part(operand));
                let message = format!(
                    "has {part} beside other conditions within F, must have names and at most one F there; F[0,10] G[0,5] \
                     (A & B) visits both and stays, and G B is a task of its own"
                );
                Err(self.refuse(tree, message))
            }
            Node::Until(..) => {
                let message = "has U within F, must have names there; each U is a task that begins at 0";
                Err(self.refuse(tree, message))
            }
            _ => self.add_conditions(tree, operand, what),
        }
    }
}
