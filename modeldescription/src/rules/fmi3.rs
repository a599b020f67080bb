//! Rules specific to FMI 3.0 (FMI 3.0.2, sections 2.4.7 and 2.4.8), and the properties of its variables that
//! the shared rules need.

use super::structure::{Listed, Numbering};
use super::variables::{AnyType, AnyVariable, Scope};
use super::{Check, Place, UnknownList, brief};
use crate::fmi3::{
    DataType, Dimension, ModelDescription, Terminals, TypeDefinition, Unknown, Variable, VariableKind,
};
use crate::{Causality, Initial, InitialRule, NamingConvention, Variability};
use std::collections::{BTreeSet, HashMap, HashSet};

impl AnyType for TypeDefinition {
    fn name(&self) -> &str {
        &self.name
    }

    fn type_name(&self) -> &'static str {
        self.kind.data_type().as_str()
    }

    fn unit(&self) -> Option<&str> {
        self.kind.unit()
    }

    fn display_unit(&self) -> Option<&str> {
        self.kind.display_unit()
    }

    fn range(&self) -> (Option<f64>, Option<f64>) {
        self.kind.range()
    }

    fn items(&self) -> Vec<(&str, i64)> {
        self.items.iter().map(|item| (item.name.as_str(), item.value)).collect()
    }
}

impl AnyVariable for Variable {
    const FLOATS: &'static str = "Float64 or Float32";
    const CONTINUOUS: &'static str = "";

    fn name(&self) -> &str {
        &self.name
    }

    fn causality(&self) -> Causality {
        self.causality
    }

    fn variability(&self) -> Variability {
        self.variability
    }

    fn initial(&self) -> Option<Initial> {
        self.initial
    }

    fn effective_initial(&self) -> Option<Initial> {
        Self::effective_initial(self)
    }

    fn legal(&self, causality: Causality, variability: Variability) -> Option<InitialRule> {
        let rule = InitialRule::of_fmi3(causality, variability)?;
        if self.kind.data_type() != DataType::Clock {
            return Some(rule);
        }
        let flows = matches!(causality, Causality::Input | Causality::Output | Causality::Local);
        // Clocks have no attribute `initial`.
        let none = InitialRule { default: None, allowed: &[] };
        (flows && variability == Variability::Discrete).then_some(none)
    }

    fn type_name(&self) -> &'static str {
        self.kind.data_type().as_str()
    }

    fn is_float(&self) -> bool {
        self.kind.data_type().is_float()
    }

    fn needs_start(&self) -> bool {
        Self::needs_start(self)
    }

    fn has_start(&self) -> bool {
        self.kind.starts() > 0
    }

    fn starts(&self) -> Vec<f64> {
        self.kind.start_numbers()
    }

    fn chosen(&self) -> Vec<i64> {
        match &self.kind {
            VariableKind::Enumeration(of) => of.start.iter().filter_map(|&x| i64::try_from(x).ok()).collect(),
            _ => Vec::new(),
        }
    }

    fn declared_type(&self) -> Option<&str> {
        self.declared_type.as_deref()
    }

    fn unit(&self) -> Option<&str> {
        self.kind.unit()
    }

    fn display_unit(&self) -> Option<&str> {
        self.kind.display_unit()
    }

    fn range(&self) -> (Option<f64>, Option<f64>) {
        self.kind.range()
    }
}

/// Variables by value reference; the first one if there are several.
type References<'a> = HashMap<u32, &'a Variable>;

/// Checks every rule on a description and its structure.
pub(crate) fn description(description: &ModelDescription, check: &mut Check<'_>) {
    check.token("interface.token", "instantiationToken", &description.instantiation_token);
    check.interfaces(description);
    check.experiment(description.default_experiment);
    check.categories(&description.log_categories);
    check.units(&description.units);
    let structured = description.variable_naming_convention == NamingConvention::Structured;
    let mut scope = Scope::new(&description.units, &description.types, structured);
    // In FMI 3.0, types and variables may share a name.
    check.types(&description.types, &scope.units, &HashSet::new());
    let references = check.references(&description.variables);
    let mut previous = HashMap::new();
    for (v, variable) in description.variables.iter().enumerate() {
        check.variable(v, variable, &mut scope);
        check.aliases_of(v, variable, &mut scope);
        check.dimensions(v, variable, &references);
        check.derivative_of(v, variable, &references);
        check.clocked(v, variable, &references, &mut previous);
    }
    if !scope.is_independent_known() {
        let message = "no variable is independent; exactly one must be, usually time";
        check.add("variable.independent", Place::Root, message);
    }
    check.structure_of(description, &references);
}

/// Checks every rule on terminals.
pub(crate) fn terminals(terminals: &Terminals, description: &ModelDescription, check: &mut Check<'_>) {
    let mut variables = HashMap::new();
    for variable in &description.variables {
        let aliases = variable.aliases.iter().map(|alias| alias.name.as_str());
        for name in aliases.chain([variable.name.as_str()]) {
            variables.entry(name).or_insert(variable);
        }
    }
    let mut levels = HashSet::new();
    for (t, terminal) in terminals.terminals.iter().enumerate() {
        let (name, place) = (brief(&terminal.name), Place::Terminal(t));
        if !levels.insert((terminal.inside, terminal.name.as_str())) {
            check.add("terminal.unique", place, format!("the terminal {name:?} is there twice on its level"));
        }
        // Names of members with their variables; streams have two.
        let members =
            terminal.members.iter().map(|m| vec![(m.member_name.as_str(), m.variable_name.as_str())]);
        let streams = terminal.streams.iter().map(|m| {
            let (inward, outward) = (m.in_member_name.as_str(), m.out_member_name.as_str());
            vec![(inward, m.in_variable_name.as_str()), (outward, m.out_variable_name.as_str())]
        });
        let by_name = matches!(terminal.matching_rule.as_str(), "plug" | "bus");
        let mut seen = HashSet::new();
        for (m, pairs) in members.chain(streams).enumerate() {
            let place = Place::Member(t, m);
            for (member, variable) in pairs {
                if member.is_empty() && by_name {
                    let rule = &terminal.matching_rule;
                    let message = format!(
                        "a member of the terminal {name:?} has no memberName; must have one, as matchingRule = {rule}"
                    );
                    check.add("terminal.name", place, message);
                } else if !member.is_empty() && !seen.insert(member) {
                    let message = format!("the terminal {name:?} has the member {:?} twice", brief(member));
                    check.add("terminal.unique", place, message);
                }
                check.member(place, &name, variable, variables.get(variable).copied());
            }
        }
    }
}

impl<'a> From<&'a Unknown> for Listed<'a> {
    fn from(unknown: &'a Unknown) -> Self {
        Self {
            number: unknown.value_reference,
            dependencies: unknown.dependencies.as_deref(),
            kinds: unknown.dependency_kinds.as_deref(),
        }
    }
}

impl Check<'_> {
    fn member(&mut self, place: Place, terminal: &str, name: &str, variable: Option<&Variable>) {
        use Causality::{CalculatedParameter, Input, Output, Parameter};
        let name = brief(name);
        let message = match variable {
            None => format!("the terminal {terminal:?} names {name:?}; must name a variable"),
            Some(of) if ![Input, Output, Parameter, CalculatedParameter].contains(&of.causality) => format!(
                "the terminal {terminal:?} names {name:?}, which has causality = {}; allowed: input, output, parameter, \
                 calculatedParameter",
                of.causality.as_str()
            ),
            Some(_) => return,
        };
        self.add("terminal.member", place, message);
    }

    fn interfaces(&mut self, description: &ModelDescription) {
        let exchange = description.model_exchange.as_ref().map(|of| &of.interface);
        let co_simulation = description.co_simulation.as_ref().map(|of| &of.interface);
        let interfaces = [exchange, co_simulation, description.scheduled_execution.as_ref()];
        if interfaces.iter().all(Option::is_none) {
            let message =
                "there is neither ModelExchange nor CoSimulation nor ScheduledExecution; must have one";
            self.add("interface.kind", Place::Root, message);
        }
        for (i, interface) in interfaces.into_iter().enumerate() {
            let (Some(interface), place) = (interface, Place::Interface(i)) else { continue };
            self.identifier(place, &interface.model_identifier);
            let (serialises, restores) = (interface.can_serialize_state, interface.can_get_and_set_state);
            self.flags(place, ("canSerializeFMUState", serialises), ("canGetAndSetFMUState", restores));
        }
        if let Some(of) = &description.co_simulation {
            let flag =
                ("canReturnEarlyAfterIntermediateUpdate", of.can_return_early_after_intermediate_update);
            self.flags(
                Place::Interface(1),
                flag,
                ("providesIntermediateUpdate", of.provides_intermediate_update),
            );
            if let Some(step) = of.fixed_internal_step.filter(|step| !step.is_finite() || *step <= 0.0) {
                let message = format!("fixedInternalStepSize is {step}; must be finite and > 0");
                self.add("experiment.times", Place::Interface(1), message);
            }
            // FMI 3.0.2, section 4.4.
            let clock = description.variables.iter().find(|v| v.kind.data_type() == DataType::Clock);
            if let Some(clock) = clock.filter(|_| !of.has_event_mode) {
                let message = format!(
                    "hasEventMode is false, though {:?} is a Clock; must be true",
                    brief(&clock.name)
                );
                self.add("interface.event-mode", Place::Interface(1), message);
            }
        }
    }

    fn references<'a>(&mut self, variables: &'a [Variable]) -> References<'a> {
        let mut references = References::new();
        for (v, variable) in variables.iter().enumerate() {
            if self.is_unread(Place::Variable(v), "valueReference") {
                continue;
            }
            let reference = variable.value_reference;
            if let Some(other) = references.get(&reference) {
                let message = format!(
                    "has the value reference {reference}, which is that of {:?}; must be that of no other variable (another \
                     name of the same is an Alias)",
                    brief(&other.name)
                );
                self.add("variable.reference", Place::Variable(v), message);
            } else {
                references.insert(reference, variable);
            }
        }
        references
    }

    fn aliases_of<'a>(&mut self, v: usize, variable: &'a Variable, scope: &mut Scope<'a, TypeDefinition>) {
        for (a, alias) in variable.aliases.iter().enumerate() {
            let place = Place::Alias(v, a);
            self.name(place, v, &alias.name, scope);
            if alias.display_unit.is_some() {
                let unit = scope.unit_of(variable);
                scope.units.check(unit, alias.display_unit.as_deref(), place, self);
            }
        }
    }

    fn dimensions(&mut self, v: usize, variable: &Variable, references: &References<'_>) {
        let place = Place::Variable(v);
        let structural = variable.causality == Causality::StructuralParameter;
        if structural && !variable.dimensions.is_empty() {
            let message = "is a structural parameter and has a Dimension; must have none";
            self.add("variable.dimension", place, message);
        }
        if self.is_unread(place, crate::fmi3::DIMENSION) {
            return;
        }
        let mut sized = true;
        for (d, dimension) in variable.dimensions.iter().enumerate() {
            if let Some(message) = size_defect(dimension, references) {
                self.add("variable.dimension", place, format!("dimension {} (from 1) {message}", d + 1));
                sized = false;
            }
        }
        let (starts, shape) = (variable.kind.starts(), variable.shape(|r| references.get(&r).copied()));
        let Some(shape) = shape.filter(|_| sized && starts > 0) else { return };
        let elements = shape.iter().try_fold(1_u64, |all, size| all.checked_mul(*size));
        let as_many = elements.is_some_and(|elements| usize::try_from(elements) == Ok(starts));
        if starts > 1 && !as_many {
            let sizes: Vec<_> = shape.iter().map(u64::to_string).collect();
            let wanted = match elements {
                Some(1) => "1".to_owned(),
                Some(elements) => format!("1 or {elements}, as the dimensions say: {}", sizes.join(" x ")),
                None => format!("1, or as many as the dimensions say: {}", sizes.join(" x ")),
            };
            let message = format!("has {starts} start values; must have {wanted}");
            self.add("variable.length", Place::Start(v), message);
        }
    }

    fn derivative_of(&mut self, v: usize, variable: &Variable, references: &References<'_>) {
        let Some(reference) = variable.state() else { return };
        let message = match references.get(&reference) {
            None => format!("derivative is {reference}; must be the value reference of a variable"),
            Some(state) if !is_continuous(state) => {
                format!("derivative names {:?}, which is not a continuous number", brief(&state.name))
            }
            Some(state) if state.value_reference == variable.value_reference => {
                "derivative names the variable itself; must name another".to_owned()
            }
            Some(state) => {
                let [own, other] = [variable, state].map(|v| v.shape(|r| references.get(&r).copied()));
                if own.is_none() || other.is_none() || own == other {
                    return;
                }
                format!("derivative names {:?}, which has other dimensions", brief(&state.name))
            }
        };
        self.add("variable.derivative", Place::Variable(v), message);
    }

    fn clocked(
        &mut self,
        v: usize,
        variable: &Variable,
        references: &References<'_>,
        previous: &mut HashMap<u32, String>,
    ) {
        let place = Place::Variable(v);
        let empty = self.is_unread(place, crate::fmi3::NO_CLOCK);
        let mut complain = |message: String| self.add("variable.clock", place, message);
        if empty {
            complain("clocks is empty; must name a Clock, or not be there".to_owned());
        }
        for reference in &variable.clocks {
            if !references.get(reference).is_some_and(|of| of.kind.data_type() == DataType::Clock) {
                complain(format!("clocks names {reference}, which is not the value reference of a Clock"));
            }
        }
        let slow = matches!(variable.variability, Variability::Discrete | Variability::Tunable);
        if !variable.clocks.is_empty() && !slow {
            let variability = variable.variability.as_str();
            complain(format!("has clocks and variability = {variability}; must be discrete or tunable"));
        }
        if variable.intermediate_update && variable.variability != Variability::Continuous {
            let variability = variable.variability.as_str();
            complain(format!("has intermediateUpdate and variability = {variability}; must be continuous"));
        }
        let Some(reference) = variable.previous else { return };
        if variable.clocks.is_empty() || variable.variability != Variability::Discrete {
            complain("has previous; must be discrete and have clocks".to_owned());
        }
        if let Some(other) = previous.insert(reference, variable.name.clone()) {
            complain(format!("previous is {reference}, as that of {:?}; must differ", brief(&other)));
        }
        let of_same_type = |of: &&Variable| {
            of.value_reference != variable.value_reference
                && of.kind.data_type() == variable.kind.data_type()
                && of.variability == Variability::Discrete
                && of.causality != Causality::Input
        };
        if references.get(&reference).copied().filter(of_same_type).is_none() {
            complain(format!(
                "previous is {reference}; must be the value reference of another discrete {} that is no input",
                variable.kind.data_type().as_str()
            ));
        }
    }

    fn structure_of(&mut self, description: &ModelDescription, references: &References<'_>) {
        use UnknownList::{ClockedStates, Derivatives, EventIndicators, InitialUnknowns, Outputs};
        let structure = &description.structure;
        let find = |reference| references.get(&reference).map(|variable| variable.name.as_str());
        let numbering = Numbering {
            attribute: "valueReference",
            of_list: UnknownList::element,
            word: "value reference",
            wanted: "that of a variable".to_owned(),
            dependency: "the value reference",
            wanted_dependency: "that of a variable".to_owned(),
            find: &find,
        };
        let listed = |list: UnknownList| structure.list(list).iter().map(Listed::from).collect::<Vec<_>>();
        for list in UnknownList::ALL {
            self.numbers(list, &listed(list), &numbering);
            self.kinds(list, structure.list(list), references);
        }
        // Outputs.
        let of = |is: &dyn Fn(&Variable) -> bool| -> BTreeSet<u32> {
            description.variables.iter().filter(|v| is(v)).map(|v| v.value_reference).collect()
        };
        let wanted = of(&|v| v.causality == Causality::Output);
        self.complete("structure.outputs", Outputs, &listed(Outputs), (&wanted, &wanted), &numbering);
        // Derivatives of continuous states.
        for (u, unknown) in structure.derivatives.iter().enumerate() {
            let Some(variable) = references.get(&unknown.value_reference) else { continue };
            if variable.state().is_none() {
                self.no_derivative(u, &variable.name, Derivatives.element());
            } else if !is_continuous(variable) {
                let message = format!(
                    "{} lists {:?}, which is not continuous",
                    Derivatives.element(),
                    brief(&variable.name)
                );
                self.add("structure.derivatives", Place::Unknown(Derivatives, u), message);
            }
        }
        if description.model_exchange.is_some() {
            let is_flow = |v: &Variable| v.causality == Causality::Input;
            let wanted = of(&|v| {
                let state = v.state().and_then(|state| references.get(&state));
                !is_flow(v) && state.is_some_and(|state| !is_flow(state))
            });
            let all = of(&|_| true);
            self.complete("structure.states", Derivatives, &listed(Derivatives), (&wanted, &all), &numbering);
        }
        // Clocked states and event indicators.
        let states = of(&|v| v.previous.is_some());
        let of_clocks = listed(ClockedStates);
        self.complete("structure.clocked-states", ClockedStates, &of_clocks, (&states, &states), &numbering);
        let numbers = of(&is_continuous);
        let indicators = listed(EventIndicators);
        let none = BTreeSet::new();
        self.complete(
            "structure.event-indicators",
            EventIndicators,
            &indicators,
            (&none, &numbers),
            &numbering,
        );
        // Initial unknowns. Clocked variables may be included, at the FMU's choice.
        let mut wanted = of(&Variable::is_initial_unknown);
        for derivative in &structure.derivatives {
            let variable = references.get(&derivative.value_reference);
            let state = variable.and_then(|v| v.state()).and_then(|state| references.get(&state));
            let computed = [variable, state].into_iter().flatten().filter(|v| v.is_computed());
            wanted.extend(computed.map(|v| v.value_reference));
        }
        let allowed = wanted.union(&of(&|v| !v.clocks.is_empty())).copied().collect();
        self.complete(
            "structure.initial-unknowns",
            InitialUnknowns,
            &listed(InitialUnknowns),
            (&wanted, &allowed),
            &numbering,
        );
        let inputs = description.variables.iter().any(|v| v.causality == Causality::Input);
        self.unsaid(Outputs.element(), &listed(Outputs), inputs);
    }

    /// Only floating-point numbers can have linear dependencies. This is a warning, since the Feedthrough of
    /// the Reference FMUs has others.
    fn kinds(&mut self, list: UnknownList, unknowns: &[Unknown], references: &References<'_>) {
        for (u, unknown) in unknowns.iter().enumerate() {
            let Some(variable) = references.get(&unknown.value_reference) else { continue };
            let kinds = unknown.dependency_kinds.iter().flatten();
            let factor = kinds.into_iter().find(|kind| kind.as_str() != "dependent");
            if let Some(kind) = factor.filter(|_| !variable.kind.data_type().is_float()) {
                let message = format!(
                    "{}: dependenciesKind {:?} of {:?}, which is {}; allowed here: dependent",
                    list.element(),
                    brief(kind),
                    brief(&variable.name),
                    variable.kind.data_type().as_str()
                );
                self.add("structure.kinds", Place::Unknown(list, u), message);
            }
        }
    }
}

fn is_continuous(variable: &Variable) -> bool {
    variable.kind.data_type().is_float() && variable.variability == Variability::Continuous
}

/// The defect in the size of a dimension, if any.
fn size_defect(dimension: &Dimension, references: &References<'_>) -> Option<String> {
    let reference = match (dimension.start, dimension.value_reference) {
        (Some(0), None) => return Some("has start = 0; must be at least 1".to_owned()),
        (Some(_), None) => return None,
        (None, Some(reference)) => reference,
        _ => return Some("must have either start or valueReference".to_owned()),
    };
    let Some(size) = references.get(&reference) else {
        return Some(format!("has valueReference = {reference}; must be that of a variable"));
    };
    let may = size.causality == Causality::StructuralParameter || size.variability == Variability::Constant;
    let name = brief(&size.name);
    match &size.kind {
        VariableKind::UInt64(of) if may => match of.start.first() {
            Some(0) => Some(format!("has the size {name:?}, which starts at 0; must start at 1 or more")),
            _ => None,
        },
        _ => Some(format!(
            "has the size {name:?}, which must be a structural parameter or a constant of type UInt64"
        )),
    }
}
