//! Resolves a system file against the descriptions of its FMUs. Names become positions, and every error says
//! which field of the file it comes from. Runs nothing.

use super::graph::{self, Edge};
use super::system::{Component, Picture, StartValue, System};
use crate::error::Error;
use crate::host::{Causality, Description, Output, ScalarType, Variable};

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
    /// An input, of no other connection.
    pub to: Port,
    /// Units of the input per unit of the output.
    pub factor: f64,
    /// In the unit of the input.
    pub offset: f64,
}

/// A resolved start value: Reals as they are, others as integers (Booleans 0 or 1).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Start {
    Real(u32, f64),
    Integer(u32, i32),
    Boolean(u32, i32),
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
    /// Notes for the user, such as a signal read one step late.
    pub(super) notes: Vec<String>,
}

/// Resolves `system` against the descriptions of its components' FMUs, one for each, in order.
pub(super) fn resolve(system: &System, descriptions: &[&Description]) -> Result<Network, Error> {
    let resolver = Resolver { system, descriptions };
    let links = resolver.links()?;
    let starts = resolver.starts()?;
    let recorded = resolver.recorded(&links)?;
    resolver.check_pictures(&recorded)?;
    let (direct, delayed, notes) = resolver.order(&links);
    Ok(Network { links, starts, recorded, direct, delayed, notes })
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

/// Resolves `text`, `component.variable`, to a variable; `field` is its place in the file.
///
/// # Errors
///
/// A component or variable that does not exist, with those that do.
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

    fn scalar_type(&self, port: Port) -> ScalarType {
        self.variable(port).kind.scalar_type()
    }

    fn component_name(&self, component: usize) -> &'a str {
        &self.system.components()[component].name
    }

    /// `component.variable` of a port.
    fn name(&self, port: Port) -> String {
        format!("{}.{}", self.component_name(port.component), self.variable(port).name)
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
        let variable = self.descriptions[component].index_of(variable).ok_or_else(|| {
            Error::configuration(
                field,
                format!("{}{}", self.unknown(component, variable), self.similar(component, variable)),
            )
        })?;
        Ok(Port { component, variable })
    }

    fn unknown(&self, component: usize, variable: &str) -> String {
        let fmu = &self.system.components()[component].fmu;
        format!("{} ({fmu}) has no variable {variable:?}", self.component_name(component))
    }

    /// A hint at variables whose name ends alike or contains the name given.
    fn similar(&self, component: usize, wanted: &str) -> String {
        let tail = wanted.rsplit('.').next().unwrap_or(wanted);
        let found: Vec<_> = self.descriptions[component]
            .variables
            .iter()
            .map(|v| v.name.as_str())
            .filter(|name| !tail.is_empty() && name.rsplit('.').next() == Some(tail))
            .take(3)
            .collect();
        if found.is_empty() { String::new() } else { format!("; did you mean {}?", found.join(" or ")) }
    }

    fn expect_causality(&self, field: &str, port: Port, wanted: Causality) -> Result<(), Error> {
        let found = self.variable(port).causality;
        if found == wanted {
            return Ok(());
        }
        let (name, found, wanted) = (self.name(port), found.as_str(), wanted.as_str());
        Err(Error::configuration(field, format!("{name} has causality {found}; must be {wanted}")))
    }

    fn links(&self) -> Result<Vec<Link>, Error> {
        let mut links: Vec<Link> = Vec::new();
        for (i, connection) in self.system.connections().iter().enumerate() {
            let field = format!("connection[{i}]");
            let from = self.port(&format!("{field}.from"), &connection.from)?;
            let to = self.port(&format!("{field}.to"), &connection.to)?;
            self.expect_causality(&format!("{field}.from"), from, Causality::Output)?;
            self.expect_causality(&format!("{field}.to"), to, Causality::Input)?;
            let (factor, offset) = (connection.factor, connection.offset);
            self.check_types(&field, from, to)?;
            let of = self.scalar_type(to);
            if of != ScalarType::Real && (factor != 1.0 || offset != 0.0) {
                let kind = of.as_str();
                let message = format!("factor and offset are for Real signals; {} is {kind}", self.name(to));
                return Err(Error::configuration(field, message));
            }
            if let Some(other) = links.iter().position(|link| link.to == to) {
                let message = format!("input {} is already connected by connection[{other}]", self.name(to));
                return Err(Error::configuration(format!("{field}.to"), message));
            }
            links.push(Link { from, to, factor, offset });
        }
        let explicit = links.len();
        for (i, pair) in self.system.by_name().iter().enumerate() {
            self.connect_by_name(&format!("connect_by_name[{i}]"), &pair.components, explicit, &mut links)?;
        }
        Ok(links)
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
                self.check_types(field, from, to)?;
                links.push(Link { from, to, factor: 1.0, offset: 0.0 });
            }
        }
        if matches == 0 {
            let message =
                format!("no output of {} or {} has an input of equal name in the other", names[0], names[1]);
            return Err(Error::configuration(field, message));
        }
        Ok(())
    }

    fn check_types(&self, field: &str, from: Port, to: Port) -> Result<(), Error> {
        let (given, taken) = (self.scalar_type(from), self.scalar_type(to));
        if given != taken {
            let (from, to, given, taken) = (self.name(from), self.name(to), given.as_str(), taken.as_str());
            let message = format!("{from} is {given}, but {to} is {taken}; types must be equal");
            return Err(Error::configuration(field, message));
        }
        if given == ScalarType::String {
            let message = format!("{} is String; text cannot be connected", self.name(from));
            return Err(Error::configuration(field, message));
        }
        Ok(())
    }

    fn starts(&self) -> Result<Vec<Vec<Start>>, Error> {
        let of_component = |c: usize| {
            let starts = &self.system.components()[c].start;
            starts.iter().map(|(name, value)| self.start(c, name, *value)).collect::<Result<Vec<_>, _>>()
        };
        (0..self.descriptions.len()).map(of_component).collect()
    }

    fn start(&self, component: usize, name: &str, value: StartValue) -> Result<Start, Error> {
        let field = format!("component[{component}].start.{name:?}");
        let wrong = |message: String| Error::configuration(field.clone(), message);
        let position = self.descriptions[component].index_of(name).ok_or_else(|| {
            wrong(format!("{}{}", self.unknown(component, name), self.similar(component, name)))
        })?;
        let variable = &self.descriptions[component].variables[position];
        if !matches!(variable.causality, Causality::Parameter | Causality::Input) {
            let causality = variable.causality.as_str();
            return Err(wrong(format!(
                "has causality {causality}; only parameters and inputs can be given a start value"
            )));
        }
        let reference = variable.value_reference;
        let (start, number) = match (variable.kind.scalar_type(), value) {
            (ScalarType::Real, StartValue::Real(x)) => (Start::Real(reference, x), x),
            // Beyond 2⁵³ the nearest double is taken, as for any decimal number.
            (ScalarType::Real, StartValue::Integer(i)) => (Start::Real(reference, i as f64), i as f64),
            (ScalarType::Integer | ScalarType::Enumeration, StartValue::Integer(i)) => {
                let i = i32::try_from(i)
                    .map_err(|_| wrong(format!("is {i}; must be from {} to {}", i32::MIN, i32::MAX)))?;
                (Start::Integer(reference, i), f64::from(i))
            }
            (ScalarType::Boolean, StartValue::Boolean(b)) => {
                (Start::Boolean(reference, i32::from(b)), f64::from(u8::from(b)))
            }
            (of, _) => return Err(wrong(format!("is of type {}; the value given is not", of.as_str()))),
        };
        let (min, max) = variable.kind.range();
        let (min, max) = (min.unwrap_or(f64::NEG_INFINITY), max.unwrap_or(f64::INFINITY));
        if number < min || number > max {
            let unit = variable.kind.unit().map(|unit| format!(" {unit}")).unwrap_or_default();
            return Err(wrong(format!("is {number}{unit}; must be {}", range(min, max, &unit))));
        }
        let items = self.descriptions[component].items(variable);
        if !items.is_empty() && !items.iter().any(|item| f64::from(item.value) == number) {
            let items: Vec<_> = items.iter().map(|i| format!("{} ({})", i.value, i.name)).collect();
            return Err(wrong(format!("is {number}; must be one of {}", items.join(", "))));
        }
        Ok(start)
    }

    fn recorded(&self, links: &[Link]) -> Result<Vec<Port>, Error> {
        let Some(signals) = &self.system.record().signals else {
            return Ok((0..self.descriptions.len()).flat_map(|c| self.default_columns(c, links)).collect());
        };
        let mut ports = Vec::with_capacity(signals.len());
        for (i, signal) in signals.iter().enumerate() {
            let field = format!("record.signals[{i}]");
            let port = self.port(&field, signal)?;
            let variable = self.variable(port);
            if self.scalar_type(port) == ScalarType::String {
                return Err(Error::configuration(field, format!("{signal} is String; text is not recorded")));
            }
            if variable.causality != Causality::Output && !links.iter().any(|link| link.to == port) {
                let message = format!("{signal} is neither an output nor a connected input");
                return Err(Error::configuration(field, message));
            }
            if ports.contains(&port) {
                return Err(Error::configuration(field, format!("{signal} is named twice")));
            }
            ports.push(port);
        }
        Ok(ports)
    }

    /// All outputs but [twins](Description::is_twin), then all connected inputs of a component.
    fn default_columns(&self, component: usize, links: &[Link]) -> Vec<Port> {
        let ports = || {
            (0..self.descriptions[component].variables.len())
                .map(move |variable| Port { component, variable })
        };
        let outputs = ports().filter(|&p| {
            self.variable(p).causality == Causality::Output
                && self.scalar_type(p) != ScalarType::String
                && !self.descriptions[component].is_twin(p.variable)
        });
        let inputs = ports().filter(|p| links.iter().any(|link| link.to == *p));
        outputs.chain(inputs).collect()
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

/// "≥ a", "≤ b" or "from a to b".
fn range(min: f64, max: f64, unit: &str) -> String {
    let number = |value: f64| {
        let size = value.abs();
        if size == 0.0 || (1e-4..1e7).contains(&size) { value.to_string() } else { format!("{value:e}") }
    };
    let (low, high) = (min.is_finite(), max.is_finite());
    let (min, max) = (number(min), number(max));
    match (low, high) {
        (true, true) => format!("from {min} to {max}{unit}"),
        (true, false) => format!("≥ {min}{unit}"),
        _ => format!("≤ {max}{unit}"),
    }
}

#[cfg(test)]
mod tests;
