//! Resolves a system file against the descriptions of its FMUs. Names become positions, and every error names
//! the field of the file that it comes from. Nothing is run.

use std::collections::BTreeMap;

use punctual_fmu::configuration::nearest;
use punctual_fmu::units::{self, Fit};

use super::graph::{self, Edge};
use super::starts::{self, Start, sizes};
use super::system::{Component, Picture, System};
use crate::error::Error;
use crate::host::{Array, Causality, DataType, Description, Family, Output, Variability, Variable};

/// A variable of a component.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Port {
    /// Position of the component in the system.
    pub component: usize,
    /// Position of the variable in its description.
    pub variable: usize,
}

/// A resolved connection: `to = factor · from + offset`.
#[derive(Clone, Debug, PartialEq)]
pub struct Link {
    /// An output.
    pub from: Port,
    /// An input that no other connection feeds.
    pub to: Port,
    /// Units of the input per unit of the output.
    pub factor: f64,
    /// In the unit of the input.
    pub offset: f64,
    /// How the units of its ends relate to the factor and offset.
    pub units: Units,
}

/// How the units of a connection's ends relate to its factor and offset.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Units {
    /// The units are the same, or the file says how to read the number.
    Same,
    /// The factor and offset convert between the units.
    Converted,
    /// The units cannot be compared.
    Unknown,
    /// The file gives another factor than this one, which would convert between the units.
    Overruled(f64),
}

/// The resolved system.
#[derive(Debug)]
pub(super) struct Network {
    pub(super) links: Vec<Link>,
    /// For each component its start values.
    pub(super) starts: Vec<Vec<Start>>,
    /// The signals recorded, in column order.
    pub(super) recorded: Vec<Port>,
    /// Components with direct feedthrough, in the order they run.
    pub(super) direct: Vec<usize>,
    /// Components without, in file order.
    pub(super) delayed: Vec<usize>,
    /// Notes for the user that hold in Gauss–Seidel order, such as a signal read one step late.
    pub(super) notes: Vec<String>,
    /// Notes for the user on what is recorded and on connections from variables that are not outputs.
    pub(super) remarks: Vec<String>,
}

/// The greatest number of local variables of a component that are recorded if the file names no signals.
const MAX_LOCALS: usize = 200;

/// Resolves `system` against the descriptions of its components' FMUs, one for each, in order.
pub(super) fn resolve(system: &System, descriptions: &[&Description]) -> Result<Network, Error> {
    let resolver = Resolver { system, descriptions };
    // Start values come first, since the sizes of arrays depend on them.
    let of_component = |c: usize| {
        let component = &system.components()[c];
        let unknown = |name: &str| resolver.missing(c, name);
        starts::resolve(c, component, descriptions[c], unknown)
    };
    let starts = (0..descriptions.len()).map(of_component).collect::<Result<_, _>>()?;
    let links = resolver.links()?;
    let (recorded, mut remarks) = resolver.recorded(&links)?;
    resolver.check_pictures(&recorded)?;
    remarks.extend(resolver.begins_with(&links));
    let (direct, delayed, notes) = resolver.order(&links);
    Ok(Network { links, starts, recorded, direct, delayed, notes, remarks })
}

/// Checks the connections of `system`, those by name included, against the descriptions of its components' FMUs,
/// one for each, in order. Start values, recordings and pictures are checked too.
///
/// # Errors
///
/// A name, type or value that does not fit, with the field of the system file.
pub fn links(system: &System, descriptions: &[&Description]) -> Result<Vec<Link>, Error> {
    resolve(system, descriptions).map(|network| network.links)
}

/// Notes on `links` whose units differ, or cannot be compared.
pub fn unit_notes(system: &System, descriptions: &[&Description], links: &[Link]) -> Vec<String> {
    /// The most connections named for each pair of units.
    const NAMED: usize = 8;
    let resolver = Resolver { system, descriptions };
    // Grouped by kind, and then by units.
    let mut notes: BTreeMap<&str, BTreeMap<String, Vec<String>>> = BTreeMap::new();
    for link in links {
        let ends = [link.from, link.to].map(|port| (resolver.name(port), resolver.unit(port)));
        let [(from, given), (to, taken)] = &ends;
        let (what, how, which) = match link.units {
            Units::Same => continue,
            Units::Converted => {
                let scale = match (brief(link.factor), brief(link.offset)) {
                    (factor, 0.0) => format!("times {factor}"),
                    (1.0, offset) => format!("plus {offset}"),
                    (factor, offset) => format!("times {factor} plus {offset}"),
                };
                ("units are converted", format!("{given} to {taken} ({scale}) of "), format!("{from} → {to}"))
            }
            Units::Unknown => (
                "units that cannot be compared, so numbers pass as they are",
                String::new(),
                format!("{from} ({given}) → {to} ({taken})"),
            ),
            Units::Overruled(by) => (
                "the factor of the file is used, although the units give another one",
                String::new(),
                format!("{from} ({given}) → {to} ({taken}) has {}, not {}", brief(link.factor), brief(by)),
            ),
        };
        notes.entry(what).or_default().entry(how).or_default().push(which);
    }
    let part = |(how, all): (String, Vec<String>)| {
        let named = all[..all.len().min(NAMED)].join(", ");
        match all.len().saturating_sub(NAMED) {
            0 => format!("{how}{named}"),
            more => format!("{how}{named} and {more} more"),
        }
    };
    let note = |(what, parts): (&str, BTreeMap<_, _>)| {
        format!("{what}: {}", parts.into_iter().map(part).collect::<Vec<_>>().join("; "))
    };
    notes.into_iter().map(note).collect()
}

/// The number rounded to six significant digits.
fn brief(number: f64) -> f64 {
    format!("{number:.5e}").parse().unwrap_or(number)
}

/// Resolves `text`, `component.variable`, to a variable; `field` is its place in the file.
///
/// # Errors
///
/// A component or variable that does not exist; the message lists those that do.
pub fn port(system: &System, descriptions: &[&Description], field: &str, text: &str) -> Result<Port, Error> {
    Resolver { system, descriptions }.port(field, text)
}

/// The inputs that `output` depends on at the same instant, as positions in the variables.
fn direct_inputs(component: &Component, description: &Description, output: &Output) -> Vec<usize> {
    match output.dependencies {
        None if !component.feedthrough => Vec::new(),
        _ => description.direct_inputs(output),
    }
}

/// Whether the output depends on any input at the same instant.
pub(super) fn has_feedthrough(component: &Component, description: &Description, variable: usize) -> bool {
    description
        .outputs
        .iter()
        .find(|output| output.variable == variable)
        .is_some_and(|output| !direct_inputs(component, description, output).is_empty())
}

struct Resolver<'a> {
    system: &'a System,
    descriptions: &'a [&'a Description],
}

impl<'a> Resolver<'a> {
    fn variable(&self, port: Port) -> &'a Variable {
        &self.descriptions[port.component].variables[port.variable]
    }

    fn family(&self, port: Port) -> Family {
        self.variable(port).family()
    }

    fn component_name(&self, component: usize) -> &'a str {
        &self.system.components()[component].name
    }

    /// `component.variable` of a port.
    fn name(&self, port: Port) -> String {
        format!("{}.{}", self.component_name(port.component), self.variable(port).name)
    }

    /// The name of the unit of a port.
    fn unit(&self, port: Port) -> &'a str {
        self.variable(port).unit.as_deref().unwrap_or("no unit")
    }

    fn component(&self, field: &str, name: &str) -> Result<usize, Error> {
        self.system.components().iter().position(|c| c.name == name).ok_or_else(|| {
            let known: Vec<_> = self.system.components().iter().map(|c| c.name.as_str()).collect();
            Error::configuration(field, format!("no component {name:?}; there are {}", known.join(", ")))
        })
    }

    fn port(&self, field: &str, text: &str) -> Result<Port, Error> {
        let Some((component, variable)) = text.split_once('.') else {
            return Err(Error::configuration(
                field,
                format!("{text:?} is not of the form component.variable"),
            ));
        };
        let component = self.component(field, component)?;
        let missing = || Error::configuration(field, self.missing(component, variable));
        let variable = self.descriptions[component].index_of(variable).ok_or_else(missing)?;
        Ok(Port { component, variable })
    }

    /// The array that `text` names as a whole, if any.
    fn array(&self, text: &str) -> Option<(usize, &'a Array)> {
        let (component, name) = text.split_once('.')?;
        let component = self.system.components().iter().position(|c| c.name == component)?;
        let description = self.descriptions[component];
        // A scalar of the same name takes precedence.
        let array = description.array(name).filter(|_| description.index_of(name).is_none())?;
        Some((component, array))
    }

    /// What `text` names: a scalar, or the elements of an array and its sizes.
    fn ports(&self, field: &str, text: &str) -> Result<(Vec<Port>, Option<&'a [usize]>), Error> {
        let Some((component, array)) = self.array(text) else {
            return Ok((vec![self.port(field, text)?], None));
        };
        let elements = array.first..array.first + array.count;
        Ok((elements.map(|variable| Port { component, variable }).collect(), Some(&array.sizes)))
    }

    /// The message if there is no scalar of this name.
    fn missing(&self, component: usize, name: &str) -> String {
        let (owner, description) = (&self.system.components()[component], self.descriptions[component]);
        if let Some(array) = description.array(name) {
            let example = description.variables.get(array.first).map(|v| format!(", such as {:?}", v.name));
            return format!(
                "{name:?} of {} ({}) is an array of {}; name an element{}",
                owner.name,
                owner.fmu,
                sizes(&array.sizes),
                example.unwrap_or_default()
            );
        }
        let unknown = format!("{} ({}) has no variable {name:?}", owner.name, owner.fmu);
        // The variables of the same FMU in FMI 2.0 have names of this form.
        let base = name.split_once('.').and_then(|(base, _)| description.array(base));
        match base.and_then(|array| Some((array, description.variables.get(array.first)?))) {
            Some((array, first)) => {
                let (base, sizes) = (&array.name, sizes(&array.sizes));
                format!("{unknown}; {base} is an array of {sizes}, with elements such as {:?}", first.name)
            }
            None => format!("{unknown}{}", self.similar(component, name)),
        }
    }

    /// A hint at variables whose names end in the same way or are similar.
    fn similar(&self, component: usize, wanted: &str) -> String {
        let tail = wanted.rsplit('.').next().unwrap_or(wanted);
        let found: Vec<_> = self.descriptions[component]
            .variables
            .iter()
            .map(|v| v.name.as_str())
            .filter(|name| !tail.is_empty() && name.rsplit('.').next() == Some(tail))
            .take(3)
            .collect();
        if found.is_empty() {
            let names: Vec<_> =
                self.descriptions[component].variables.iter().map(|v| v.name.as_str()).collect();
            return nearest(wanted, &names);
        }
        format!("; did you mean {}?", found.join(" or "))
    }

    fn expect_causality(&self, field: &str, port: Port, wanted: &[Causality]) -> Result<(), Error> {
        let found = self.variable(port).causality;
        if wanted.contains(&found) {
            return Ok(());
        }
        let (name, found) = (self.name(port), found.as_str());
        let wanted = wanted.iter().map(|wanted| wanted.as_str()).collect::<Vec<_>>().join(" or ");
        Err(Error::configuration(field, format!("{name} has causality {found}; must be {wanted}")))
    }

    fn links(&self) -> Result<Vec<Link>, Error> {
        let mut links: Vec<Link> = Vec::new();
        // The connection that each link comes from.
        let mut owners = Vec::new();
        for (i, connection) in self.system.connections().iter().enumerate() {
            let field = format!("connection[{i}]");
            let (from, of) = self.ports(&format!("{field}.from"), &connection.from)?;
            let (to, wanted) = self.ports(&format!("{field}.to"), &connection.to)?;
            if of != wanted {
                let shape = |sizes_of: Option<&[usize]>| {
                    sizes_of.map_or_else(|| "a scalar".to_owned(), |of| format!("an array of {}", sizes(of)))
                };
                let message = format!(
                    "{} is {}, but {} is {}; sizes must be equal",
                    connection.from,
                    shape(of),
                    connection.to,
                    shape(wanted)
                );
                return Err(Error::configuration(field, message));
            }
            for (from, to) in from.into_iter().zip(to) {
                if let Some(other) = links.iter().position(|link| link.to == to) {
                    let by = owners[other];
                    let message = format!("input {} is already connected by connection[{by}]", self.name(to));
                    return Err(Error::configuration(format!("{field}.to"), message));
                }
                use Causality::{CalculatedParameter, Input, Local, Output};
                let sources = [Output, Local, CalculatedParameter];
                self.expect_causality(&format!("{field}.from"), from, &sources)?;
                self.expect_causality(&format!("{field}.to"), to, &[Input])?;
                links.push(self.link(&field, [from, to], connection.factor, connection.offset)?);
                owners.push(i);
            }
        }
        let explicit = links.len();
        for (i, pair) in self.system.by_name().iter().enumerate() {
            self.connect_by_name(&format!("connect_by_name[{i}]"), &pair.components, explicit, &mut links)?;
        }
        Ok(links)
    }

    /// The link between two scalars, an output and an input, with the factor and offset of the file.
    fn link(&self, field: &str, [from, to]: [Port; 2], own: Option<f64>, offset: f64) -> Result<Link, Error> {
        /// Relative rounding error that a factor in a file may have.
        const ROUNDED: f64 = 1e-3;
        self.check_types(field, from, to)?;
        if self.family(to) != Family::Real && (own.is_some_and(|own| own != 1.0) || offset != 0.0) {
            let (to, kind) = (self.name(to), self.variable(to).type_name);
            let message = format!("factor and offset are for Real signals; {to} is {kind}");
            return Err(Error::configuration(field, message));
        }
        let [said, wanted] = [from, to].map(|port| self.descriptions[port.component].unit(port.variable));
        let link = |factor, offset, units| Ok(Link { from, to, factor, offset, units });
        match (units::fit(&said, &wanted), own) {
            (Ok(Fit::Scaled { factor, .. }), Some(own)) if (own.abs() / factor - 1.0).abs() > ROUNDED => {
                link(own, offset, Units::Overruled(factor))
            }
            (_, Some(own)) => link(own, offset, Units::Same),
            (Ok(Fit::Scaled { factor, offset: by }), None) => link(factor, by + offset, Units::Converted),
            (Ok(Fit::Same), None) => link(1.0, offset, Units::Same),
            (Ok(Fit::Unknown), None) => link(1.0, offset, Units::Unknown),
            (Err(why), None) => {
                let (given, taken) = (self.unit(from), self.unit(to));
                let message = format!(
                    "{} is in {given}, but {} in {taken}, {why}; a [[connection]] of the two with a `factor`, in \
                     {taken} per {given}, says how it is meant",
                    self.name(from),
                    self.name(to),
                );
                Err(Error::configuration(field, message))
            }
        }
    }

    fn connect_by_name(
        &self,
        field: &str,
        names: &[String; 2],
        explicit: usize,
        links: &mut Vec<Link>,
    ) -> Result<(), Error> {
        let a = self.component(&format!("{field}.components[0]"), &names[0])?;
        let b = self.component(&format!("{field}.components[1]"), &names[1])?;
        if a == b {
            let message = format!("both are {:?}; two different components are needed", names[0]);
            return Err(Error::configuration(format!("{field}.components"), message));
        }
        let mut matches = 0;
        for (giver, reader) in [(a, b), (b, a)] {
            self.check_sizes(field, giver, reader)?;
            for output in &self.descriptions[giver].outputs {
                let from = Port { component: giver, variable: output.variable };
                let Some(variable) = self.descriptions[reader].index_of(&self.variable(from).name) else {
                    continue;
                };
                let to = Port { component: reader, variable };
                if self.variable(to).causality != Causality::Input {
                    continue;
                }
                matches += 1;
                match links.iter().position(|link| link.to == to) {
                    Some(other) if other < explicit => continue,
                    Some(other) => {
                        let from = self.name(links[other].from);
                        let message =
                            format!("input {} is already connected by name to {from}", self.name(to));
                        return Err(Error::configuration(field, message));
                    }
                    None => {}
                }
                links.push(self.link(field, [from, to], None, 0.0)?);
            }
        }
        if matches == 0 {
            let message =
                format!("no output of {} or {} has an input of equal name in the other", names[0], names[1]);
            return Err(Error::configuration(field, message));
        }
        Ok(())
    }

    /// Refuses arrays of equal name, an output and an input, whose sizes differ.
    fn check_sizes(&self, field: &str, giver: usize, reader: usize) -> Result<(), Error> {
        let (given, taken) = (self.descriptions[giver], self.descriptions[reader]);
        for array in &given.arrays {
            let is = |of: &Description, array: &Array, causality| {
                of.variables.get(array.first).is_some_and(|v| v.causality == causality)
            };
            let other = taken
                .array(&array.name)
                .filter(|other| is(given, array, Causality::Output) && is(taken, other, Causality::Input));
            let Some(other) = other.filter(|other| other.sizes != array.sizes) else { continue };
            let message = format!(
                "{}.{} is an array of {}, but {}.{} is one of {}; sizes must be equal",
                self.component_name(giver),
                array.name,
                sizes(&array.sizes),
                self.component_name(reader),
                other.name,
                sizes(&other.sizes)
            );
            return Err(Error::configuration(field, message));
        }
        Ok(())
    }

    fn check_types(&self, field: &str, from: Port, to: Port) -> Result<(), Error> {
        let (given, taken) = (self.variable(from), self.variable(to));
        let types = (given.type_name, taken.type_name);
        // Both carry whole numbers. A number that is no item of the enumeration ends the run.
        let is_whole = |v: &Variable| matches!(v.family(), Family::Integer | Family::Enumeration);
        if given.family() != taken.family() && !(is_whole(given) && is_whole(taken)) {
            let (from, to, (given, taken)) = (self.name(from), self.name(to), types);
            let message = format!(
                "{from} is {given}, but {to} is {taken}; types must be equal, but for Integer and Enumeration, which are \
                 whole numbers both"
            );
            return Err(Error::configuration(field, message));
        }
        if !given.is_number() {
            let message = format!("{} is {}; {} cannot be connected", self.name(from), types.0, unfit(given));
            return Err(Error::configuration(field, message));
        }
        Ok(())
    }

    /// The recorded signals, and notes on them.
    fn recorded(&self, links: &[Link]) -> Result<(Vec<Port>, Vec<String>), Error> {
        let Some(signals) = &self.system.record().signals else {
            let (mut ports, mut notes) = (Vec::new(), Vec::new());
            for component in 0..self.descriptions.len() {
                let (columns, note) = self.default_columns(component, links);
                ports.extend(columns);
                notes.extend(note);
            }
            return Ok((ports, notes));
        };
        let mut ports = Vec::with_capacity(signals.len());
        for (i, signal) in signals.iter().enumerate() {
            let field = format!("record.signals[{i}]");
            for port in self.ports(&field, signal)?.0 {
                let (variable, name) = (self.variable(port), self.name(port));
                if !variable.is_number() {
                    let message =
                        format!("{name} is {}; {} is not recorded", variable.type_name, unfit(variable));
                    return Err(Error::configuration(field, message));
                }
                if ports.contains(&port) {
                    return Err(Error::configuration(field, format!("{name} is named twice")));
                }
                ports.push(port);
            }
        }
        Ok((ports, Vec::new()))
    }

    /// All outputs of a component except [twins](Description::is_twin), then all connected inputs. A
    /// component without numeric outputs contributes its local variables, with a note.
    fn default_columns(&self, component: usize, links: &[Link]) -> (Vec<Port>, Option<String>) {
        let ports = || {
            (0..self.descriptions[component].variables.len())
                .map(move |variable| Port { component, variable })
        };
        let outputs = ports().filter(|&p| {
            self.variable(p).causality == Causality::Output
                && self.variable(p).is_number()
                && !self.descriptions[component].is_twin(p.variable)
        });
        let outputs: Vec<_> = outputs.collect();
        let (locals, note) = if outputs.is_empty() { self.locals(component) } else { (Vec::new(), None) };
        let inputs = ports().filter(|p| links.iter().any(|link| link.to == *p));
        (outputs.into_iter().chain(locals).chain(inputs).collect(), note)
    }

    /// The local variables of a component without numeric outputs, and a note on them.
    fn locals(&self, component: usize) -> (Vec<Port>, Option<String>) {
        let description = self.descriptions[component];
        let is_moving = |v: &Variable| {
            let moves = matches!(v.variability, Variability::Continuous | Variability::Discrete);
            v.causality == Causality::Local && v.is_number() && moves
        };
        let all = description.variables.iter().enumerate().filter(|(_, v)| is_moving(v));
        let all: Vec<_> = all.map(|(variable, _)| Port { component, variable }).collect();
        let (name, count) = (self.component_name(component), all.len());
        let note = match count {
            0 => format!("{name} has neither outputs nor local variables that are numbers and change"),
            1 => format!("{name} has no outputs that are numbers: its local variable is recorded"),
            2..=MAX_LOCALS => {
                format!("{name} has no outputs that are numbers: its {count} local variables are recorded")
            }
            _ => format!(
                "{name} has no outputs that are numbers: the first {MAX_LOCALS} of its {count} local variables are \
                 recorded; record.signals can name any"
            ),
        };
        (all.into_iter().take(MAX_LOCALS).collect(), Some(note))
    }

    /// Notes on connections whose source must not be read before the run begins and has no start value.
    fn begins_with(&self, links: &[Link]) -> Vec<String> {
        let is_unknown = |v: &Variable| v.causality != Causality::Output && v.start.is_none();
        let unknown = links.iter().filter(|link| is_unknown(self.variable(link.from)));
        let note = |link: &Link| {
            let (from, to) = (self.name(link.from), self.name(link.to));
            format!("{from} is not an output, so it is not read during the initialisation: {to} gets 0 there")
        };
        unknown.map(note).collect()
    }

    fn check_pictures(&self, recorded: &[Port]) -> Result<(), Error> {
        let check = |field: String, signal: &str| {
            let port = self.port(&field, signal)?;
            if recorded.contains(&port) {
                return Ok(());
            }
            Err(Error::configuration(field, format!("{signal} is not recorded")))
        };
        for (i, picture) in self.system.pictures().iter().enumerate() {
            match picture {
                Picture::Path(path) => {
                    check(format!("plot[{i}].x"), &path.x)?;
                    check(format!("plot[{i}].y"), &path.y)?;
                    path.arrival.iter().try_for_each(|signal| check(format!("plot[{i}].arrival"), signal))?;
                    for (j, entry) in path.more.iter().enumerate() {
                        check(format!("plot[{i}].more[{j}].x"), &entry.x)?;
                        check(format!("plot[{i}].more[{j}].y"), &entry.y)?;
                        let field = || format!("plot[{i}].more[{j}].arrival");
                        entry.arrival.iter().try_for_each(|signal| check(field(), signal))?;
                    }
                }
                Picture::Time(time) => {
                    for (key, signals) in [("signals", &time.signals), ("dashed", &time.dashed)] {
                        for (j, signal) in signals.iter().enumerate() {
                            check(format!("plot[{i}].{key}[{j}]"), signal)?;
                        }
                    }
                }
            }
        }
        Ok(())
    }

    /// Components with and without direct feedthrough, in running order, and notes on late signals.
    fn order(&self, links: &[Link]) -> (Vec<usize>, Vec<usize>, Vec<String>) {
        let (components, descriptions) = (self.system.components(), self.descriptions);
        let feeds_through = |port: Port| {
            has_feedthrough(&components[port.component], descriptions[port.component], port.variable)
        };
        let direct_inputs_of = |c: usize| {
            let outputs = descriptions[c].outputs.iter();
            outputs.flat_map(move |output| direct_inputs(&components[c], descriptions[c], output))
        };
        let (direct, delayed): (Vec<usize>, Vec<usize>) =
            (0..descriptions.len()).partition(|&c| direct_inputs_of(c).next().is_some());
        let acts_directly =
            |port: Port| direct_inputs_of(port.component).any(|variable| variable == port.variable);
        let edges: Vec<Edge> = links
            .iter()
            .filter(|link| feeds_through(link.from))
            .map(|link| Edge {
                from: link.from.component,
                to: link.to.component,
                direct: acts_directly(link.to),
            })
            .collect();
        let direct = graph::order(&direct, &edges);
        let rank = |c: usize| direct.iter().position(|&other| other == c).unwrap_or(usize::MAX);
        let notes = links
            .iter()
            .filter(|link| feeds_through(link.from) && rank(link.to.component) <= rank(link.from.component))
            .map(|link| {
                format!(
                    "{} → {} closes a loop of direct feedthrough (or of outputs whose dependencies the FMU \
                     does not declare; feedthrough = false says there are none): it is read one step late",
                    self.name(link.from),
                    self.name(link.to),
                )
            })
            .collect();
        (direct, delayed, notes)
    }
}

/// What a variable that is not a number holds.
fn unfit(variable: &Variable) -> &'static str {
    match variable.of {
        DataType::Binary => "a value of bytes",
        DataType::Clock => "a clock",
        _ => "text",
    }
}

#[cfg(test)]
mod tests;
