//! Rules on `ModelStructure` that both versions of the standard share (FMI 2.0.4, section 2.2.8; FMI 3.0.2,
//! section 2.4.8). FMI 2.0 numbers variables by their index from 1, FMI 3.0 by their value reference.

use super::{Check, Place, UnknownList, brief};
use std::collections::{BTreeSet, HashSet};

/// The most names shown of a longer list.
const SHOWN: usize = 8;

/// A computed variable, by its number, and its dependencies.
pub(super) struct Listed<'a> {
    pub(super) number: u32,
    pub(super) dependencies: Option<&'a [u32]>,
    pub(super) kinds: Option<&'a [String]>,
}

/// How lists refer to variables by number.
pub(super) struct Numbering<'a> {
    /// The attribute that contains the number.
    pub(super) attribute: &'static str,
    /// The name of a list.
    pub(super) of_list: fn(UnknownList) -> &'static str,
    /// The word for the number.
    pub(super) word: &'static str,
    /// The numbers that are allowed.
    pub(super) wanted: String,
    /// The word for the number of a dependency, and what is allowed there.
    pub(super) dependency: &'static str,
    pub(super) wanted_dependency: String,
    /// The name of the variable with a number.
    pub(super) find: &'a dyn Fn(u32) -> Option<&'a str>,
}

impl Check<'_> {
    /// Checks that numbers refer to variables, and that dependencies are consistent.
    pub(super) fn numbers(&mut self, list: UnknownList, unknowns: &[Listed<'_>], numbering: &Numbering<'_>) {
        let (find, name) = (numbering.find, (numbering.of_list)(list));
        for (u, unknown) in unknowns.iter().enumerate() {
            let place = Place::Unknown(list, u);
            if !self.is_unread(place, numbering.attribute) && find(unknown.number).is_none() {
                let Numbering { attribute, wanted, .. } = numbering;
                let message = format!("{name}: {attribute} is {}; must be {wanted}", unknown.number);
                self.add("structure.index", place, message);
            }
            let readable = !self.is_unread(place, "dependencies");
            let dependencies = unknown.dependencies.unwrap_or_default();
            for number in dependencies.iter().filter(|number| readable && find(**number).is_none()) {
                let Numbering { dependency, wanted_dependency, .. } = numbering;
                let message =
                    format!("{name}: dependencies name {dependency} {number}; must be {wanted_dependency}");
                self.add("structure.dependencies", place, message);
            }
            match (unknown.dependencies, unknown.kinds) {
                (None, Some(_)) => {
                    let message = format!("{name}: there is dependenciesKind, but no dependencies");
                    self.add("structure.dependencies", place, message);
                }
                (Some(list), Some(kinds)) if list.len() != kinds.len() => {
                    let (n, k) = (list.len(), kinds.len());
                    let message = format!(
                        "{name}: {n} dependencies, but {k} words in dependenciesKind; must be as many"
                    );
                    self.add("structure.dependencies", place, message);
                }
                _ => {}
            }
            if list == UnknownList::InitialUnknowns {
                for kind in unknown.kinds.iter().copied().flatten() {
                    if !["dependent", "constant"].contains(&kind.as_str()) {
                        let message = format!(
                            "{name}: dependenciesKind {:?}; allowed here: dependent, constant",
                            brief(kind)
                        );
                        self.add("structure.dependencies", place, message);
                    }
                }
            }
        }
    }

    /// Checks that a list contains each wanted variable exactly once, and no others than those allowed.
    pub(super) fn complete(
        &mut self,
        rule: &'static str,
        list: UnknownList,
        unknowns: &[Listed<'_>],
        (wanted, allowed): (&BTreeSet<u32>, &BTreeSet<u32>),
        numbering: &Numbering<'_>,
    ) {
        let (find, name, word) = (numbering.find, (numbering.of_list)(list), numbering.word);
        let mut seen = HashSet::new();
        for (u, unknown) in unknowns.iter().enumerate() {
            let (number, place) = (unknown.number, Place::Unknown(list, u));
            let Some(variable) = find(number).map(brief) else { continue };
            if !seen.insert(number) {
                self.add(rule, place, format!("{name} lists {variable:?} ({word} {number}) twice"));
            } else if !allowed.contains(&number) {
                let message =
                    format!("{name} lists {variable:?} ({word} {number}), which does not belong there");
                self.add(rule, place, message);
            }
        }
        let missing: Vec<u32> = wanted.iter().copied().filter(|number| !seen.contains(number)).collect();
        if !missing.is_empty() {
            let names: Vec<_> = missing
                .iter()
                .take(SHOWN)
                .filter_map(|number| Some(format!("{:?} ({word} {number})", brief(find(*number)?))))
                .collect();
            let more = missing.len().saturating_sub(SHOWN);
            let more = if more > 0 { format!(" and {more} more") } else { String::new() };
            let message = format!("{name} does not list {}{more}", names.join(", "));
            self.add(rule, Place::Unknowns(list), message);
        }
    }

    /// Reports a variable in the list of derivatives that is not a derivative.
    pub(super) fn no_derivative(&mut self, u: usize, variable: &str, list: &str) {
        let message = format!("{list} lists {:?}, which has no attribute derivative", brief(variable));
        self.add("structure.derivatives", Place::Unknown(UnknownList::Derivatives, u), message);
    }

    /// Checks that outputs declare their dependencies if there are inputs.
    pub(super) fn unsaid(&mut self, name: &str, outputs: &[Listed<'_>], inputs: bool) {
        let unsaid = outputs.iter().filter(|unknown| unknown.dependencies.is_none()).count();
        if inputs && unsaid > 0 {
            let all = outputs.len();
            let message = format!(
                "{unsaid} of {all} {name} have no dependencies, which means that they depend on every input; importers \
                 then see algebraic loops (dependencies=\"\" says: on none)"
            );
            self.add("structure.unsaid", Place::Unknowns(UnknownList::Outputs), message);
        }
    }
}
