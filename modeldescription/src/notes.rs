//! What reading records besides the model: the positions of its parts, and the values that could not be
//! read. The parts that both versions of the standard write alike are read here.

use crate::rules::{Place, UnknownList, Unread};
use crate::xsd::{boolean, double, int, unsigned, words};
use crate::{BaseUnit, DefaultExperiment, DisplayUnit, LogCategory, Unit};
use roxmltree::Node;
use std::collections::HashMap;

/// Positions of parts in the text, and attributes without a value of their type.
#[derive(Debug, Default)]
pub(crate) struct Notes {
    pub(crate) positions: HashMap<Place, usize>,
    pub(crate) unread: Unread,
}

impl Notes {
    /// The offset of a part in the text, in bytes. If the part is missing, the
    /// offset of the part that should contain it.
    pub(crate) fn position(&self, place: Place) -> usize {
        let outer = match place {
            Place::Start(v) => Place::Variable(v),
            _ => Place::Root,
        };
        [place, outer].iter().find_map(|place| self.positions.get(place)).copied().unwrap_or(0)
    }

    /// Whether a required attribute is missing, or a present one is not a value of its type.
    pub(crate) fn is_unread(&self, place: Place, attribute: &'static str) -> bool {
        self.unread.contains(&(place, attribute))
    }

    /// Notes that an attribute is missing or not a value of its type.
    pub(crate) fn miss(&mut self, place: Place, attribute: &'static str) {
        self.unread.insert((place, attribute));
    }

    /// Notes the position of a part.
    pub(crate) fn mark(&mut self, place: Place, position: usize) {
        self.positions.insert(place, position);
    }

    /// Reads the attributes of an element at a place.
    pub(crate) fn enter<'r, 'n, 'i>(&'r mut self, place: Place, node: Node<'n, 'i>) -> At<'r, 'n, 'i> {
        self.mark(place, node.range().start);
        self.at(place, Some(node))
    }

    /// The same for a place that already has a position, and an element that may be missing.
    pub(crate) fn at<'r, 'n, 'i>(&'r mut self, place: Place, node: Option<Node<'n, 'i>>) -> At<'r, 'n, 'i> {
        At { notes: self, place, node }
    }

    /// Notes the position of an interface, which is also that of its model identifier.
    pub(crate) fn interface(&mut self, place: Place, node: Node<'_, '_>) {
        let at = node.attribute_node("modelIdentifier").map_or(node.range().start, |a| a.range().start);
        self.mark(place, at);
    }

    /// Reads the units.
    pub(crate) fn units(&mut self, root: Node<'_, '_>) -> Vec<Unit> {
        list(root, "UnitDefinitions", "Unit").enumerate().map(|(u, node)| self.unit(u, node)).collect()
    }

    fn unit(&mut self, u: usize, node: Node<'_, '_>) -> Unit {
        let name = self.enter(Place::Unit(u), node).text("name");
        let base = children(node, "BaseUnit").next().map(|base| {
            let mut at = self.at(Place::Unit(u), Some(base));
            let mut exponent = |name| at.value(name, int).unwrap_or(0);
            let [kg, m, s, a, k, mol, cd, rad] =
                ["kg", "m", "s", "A", "K", "mol", "cd", "rad"].map(&mut exponent);
            let factor = at.value("factor", double).unwrap_or(1.0);
            BaseUnit {
                kg,
                m,
                s,
                a,
                k,
                mol,
                cd,
                rad,
                factor,
                offset: at.value("offset", double).unwrap_or(0.0),
            }
        });
        // Nothing can refer to a display unit without a name.
        let named = children(node, "DisplayUnit").filter(|n| n.has_attribute("name"));
        let display = named.enumerate().map(|(d, node)| {
            let mut at = self.enter(Place::DisplayUnit(u, d), node);
            DisplayUnit {
                name: at.text("name"),
                factor: at.value("factor", double).unwrap_or(1.0),
                offset: at.value("offset", double).unwrap_or(0.0),
                inverse: at.flag("inverse"),
            }
        });
        Unit { name, base, display_units: display.collect() }
    }

    /// Reads the log categories.
    pub(crate) fn categories(&mut self, root: Node<'_, '_>) -> Vec<LogCategory> {
        let category = |(c, node)| {
            let at = self.enter(Place::Category(c), node);
            LogCategory { name: at.text("name"), description: at.text("description") }
        };
        list(root, "LogCategories", "Category").enumerate().map(category).collect()
    }

    /// Reads the default experiment.
    pub(crate) fn experiment(&mut self, root: Node<'_, '_>) -> Option<DefaultExperiment> {
        let node = children(root, "DefaultExperiment").next()?;
        let mut at = self.enter(Place::Experiment, node);
        Some(DefaultExperiment {
            start_time: at.value("startTime", double),
            stop_time: at.value("stopTime", double),
            tolerance: at.value("tolerance", double),
            step_size: at.value("stepSize", double),
        })
    }

    /// Reads a computed variable: the number in the attribute `key`, its dependencies, and their kinds.
    pub(crate) fn unknown(
        &mut self,
        place: Place,
        node: Node<'_, '_>,
        key: &'static str,
    ) -> (u32, Option<Vec<u32>>, Option<Vec<String>>) {
        let number = self.enter(place, node).required(key, unsigned);
        // Each word counts, even if it is not a number.
        let dependencies = node.attribute("dependencies").map(|text| {
            let number = |word| {
                unsigned(word).unwrap_or_else(|| {
                    self.miss(place, "dependencies");
                    0
                })
            };
            words(text).map(number).collect()
        });
        let kinds = node.attribute("dependenciesKind");
        (number, dependencies, kinds.map(|text| words(text).map(str::to_owned).collect()))
    }

    /// Notes the position of a list of the structure: that of its first element, or of the part that should
    /// contain it.
    pub(crate) fn list_at(
        &mut self,
        list: UnknownList,
        found: Option<Node<'_, '_>>,
        structure: Option<Node<'_, '_>>,
        root: Node<'_, '_>,
    ) {
        self.mark(Place::Unknowns(list), found.or(structure).unwrap_or(root).range().start);
    }
}

/// The children with this name.
pub(crate) fn children<'n, 'i>(node: Node<'n, 'i>, name: &'static str) -> impl Iterator<Item = Node<'n, 'i>> {
    node.children().filter(move |n| n.has_tag_name(name))
}

/// The children with this name of the children with the outer name.
pub(crate) fn list<'n, 'i>(
    root: Node<'n, 'i>,
    outer: &'static str,
    inner: &'static str,
) -> impl Iterator<Item = Node<'n, 'i>> {
    children(root, outer).flat_map(move |n| children(n, inner))
}

/// The attributes of an element, if it exists.
pub(crate) struct At<'r, 'n, 'i> {
    pub(crate) notes: &'r mut Notes,
    pub(crate) place: Place,
    pub(crate) node: Option<Node<'n, 'i>>,
}

impl<'n> At<'_, 'n, '_> {
    pub(crate) fn attribute(&self, name: &str) -> Option<&'n str> {
        self.node?.attribute(name)
    }

    /// Reads a value; if it cannot be read, this is noted.
    pub(crate) fn value<T>(
        &mut self,
        name: &'static str,
        parse: impl FnOnce(&str) -> Option<T>,
    ) -> Option<T> {
        let text = self.attribute(name)?;
        let value = parse(text);
        if value.is_none() {
            self.notes.miss(self.place, name);
        }
        value
    }

    /// Reads a required value; if it is missing, this is noted too.
    pub(crate) fn required<T: Default>(
        &mut self,
        name: &'static str,
        parse: impl FnOnce(&str) -> Option<T>,
    ) -> T {
        if self.attribute(name).is_none() {
            self.notes.miss(self.place, name);
        }
        self.value(name, parse).unwrap_or_default()
    }

    pub(crate) fn flag(&mut self, name: &'static str) -> bool {
        self.value(name, boolean).unwrap_or(false)
    }

    pub(crate) fn text(&self, name: &str) -> String {
        self.optional(name).unwrap_or_default()
    }

    pub(crate) fn optional(&self, name: &str) -> Option<String> {
        self.attribute(name).map(str::to_owned)
    }
}
