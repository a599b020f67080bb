//! The schemas of FMI as tables: the meaning of a row, and a table for each version.

mod fmi2;
mod fmi3;

use super::types::Value;

/// Number of times that an element occurs in its parent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::validate::schema) enum Times {
    /// Exactly once.
    One,
    /// At most once.
    Maybe,
    /// Once or more.
    Some,
    /// Any number of times.
    Many,
    /// Exactly one of all children marked so.
    Choice,
    /// One or more of all children marked so, in any mix.
    Mix,
}

impl Times {
    pub(in crate::validate::schema) fn most(self) -> usize {
        match self {
            Self::One | Self::Maybe => 1,
            // A second element of a choice is reported for the choice as a whole.
            Self::Some | Self::Many | Self::Choice | Self::Mix => usize::MAX,
        }
    }
}

/// Whether an attribute is required.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::validate::schema) enum Use {
    Required,
    Optional,
}

/// What an element may contain besides attributes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::validate::schema) enum Content {
    /// Only the children in the table.
    Elements,
    /// Any content that a tool puts there.
    Anything,
}

/// An attribute.
#[derive(Debug)]
pub(in crate::validate::schema) struct Attribute {
    pub(in crate::validate::schema) name: &'static str,
    pub(in crate::validate::schema) value: Value,
    pub(in crate::validate::schema) required: Use,
}

/// A child of an element. Children of a lower group come before those of a higher one.
#[derive(Debug)]
pub(in crate::validate::schema) struct Child {
    pub(in crate::validate::schema) name: &'static str,
    /// Its row in [`ELEMENTS`].
    pub(in crate::validate::schema) kind: &'static str,
    pub(in crate::validate::schema) times: Times,
    pub(in crate::validate::schema) group: u8,
}

/// An element, by the name of its type.
#[derive(Debug)]
pub(in crate::validate::schema) struct Element {
    pub(in crate::validate::schema) kind: &'static str,
    /// Its attributes, in groups that several elements can share.
    groups: &'static [&'static [Attribute]],
    /// Whether it may have any further attributes.
    pub(in crate::validate::schema) open: bool,
    pub(in crate::validate::schema) children: &'static [Child],
    pub(in crate::validate::schema) content: Content,
}

impl Element {
    /// Its attributes, without any further ones.
    pub(in crate::validate::schema) fn attributes(&self) -> impl Iterator<Item = &'static Attribute> {
        self.groups.iter().copied().flatten()
    }
}

/// The schema of a file.
#[derive(Debug)]
pub(in crate::validate) struct Schema {
    /// The root element, whose row has the same name.
    pub(in crate::validate::schema) root: &'static str,
    pub(in crate::validate::schema) elements: &'static [Element],
    /// Whether some attributes are only for model exchange.
    pub(in crate::validate::schema) of_exchange: bool,
}

/// The schema of `modelDescription.xml` of FMI 2.0.
pub(in crate::validate) const FMI2: Schema =
    Schema { root: "fmiModelDescription", elements: fmi2::ELEMENTS, of_exchange: true };
/// The schema of `modelDescription.xml` of FMI 3.0.
pub(in crate::validate) const FMI3: Schema =
    Schema { root: "fmiModelDescription", elements: fmi3::ELEMENTS, of_exchange: false };
/// The schema of `terminalsAndIcons.xml`.
pub(in crate::validate) const TERMINALS: Schema =
    Schema { root: "fmiTerminalsAndIcons", elements: fmi3::ELEMENTS, of_exchange: false };
/// The schema of `buildDescription.xml`.
pub(in crate::validate) const BUILD: Schema =
    Schema { root: "fmiBuildDescription", elements: fmi3::ELEMENTS, of_exchange: false };

const fn must(name: &'static str, value: Value) -> Attribute {
    Attribute { name, value, required: Use::Required }
}

const fn may(name: &'static str, value: Value) -> Attribute {
    Attribute { name, value, required: Use::Optional }
}

const fn child(group: u8, name: &'static str, kind: &'static str, times: Times) -> Child {
    Child { name, kind, times, group }
}

const fn groups(
    kind: &'static str,
    groups: &'static [&'static [Attribute]],
    children: &'static [Child],
) -> Element {
    Element { kind, groups, open: false, children, content: Content::Elements }
}

/// An element with any content that a tool puts there.
const fn anything(kind: &'static str, of: &'static [&'static [Attribute]]) -> Element {
    Element { content: Content::Anything, ..groups(kind, of, &[]) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_child_has_a_row_and_every_row_a_parent() {
        let roots = [FMI2, FMI3, TERMINALS, BUILD].map(|schema| schema.root);
        for elements in [fmi2::ELEMENTS, fmi3::ELEMENTS] {
            for element in elements {
                for child in element.children {
                    assert!(elements.iter().any(|row| row.kind == child.kind), "{}", child.kind);
                }
                assert!(element.children.is_sorted_by_key(|child| child.group), "{}", element.kind);
                let used =
                    elements.iter().flat_map(|row| row.children).any(|child| child.kind == element.kind);
                assert!(used || roots.contains(&element.kind), "{}", element.kind);
                let same = elements.iter().filter(|row| row.kind == element.kind).count();
                assert_eq!(same, 1, "{}", element.kind);
            }
        }
    }
}
