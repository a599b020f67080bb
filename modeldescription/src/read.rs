//! Reads a model description from its XML, tolerating defects.
//!
//! Nothing is refused here. A value that is missing or not of its type is absent or has its default in the
//! model. It is also noted, so that no rule mistakes it for a value of the file. Elements and attributes
//! without a field in the model are skipped, since a check against the schema finds them.

use crate::notes::{At, Notes, children, list};
use crate::rules::{Check, Place, UnknownList, Violation, fmi2};
use crate::xsd::{boolean, double, int, unsigned};
use crate::{
    Causality, CoSimulation, EnumerationItem, Initial, Integer, ModelDescription, ModelExchange,
    ModelStructure, NamingConvention, Plain, Real, ScalarType, SimpleType, Unknown, Variability, Variable,
    VariableKind,
};
use roxmltree::{Document, Node};

/// A model description, and the positions of its parts in the text.
///
/// The dependencies of variables stay `None`, since they are in the structure.
#[derive(Debug, Default)]
pub struct Located {
    /// The content. Without a co-simulation interface, `co_simulation` is empty.
    pub description: ModelDescription,
    /// Its `ModelStructure`.
    pub structure: ModelStructure,
    /// Number of co-simulation interfaces; the model contains the first.
    pub interfaces: usize,
    /// The start values of the variables as written.
    pub starts: Vec<Option<String>>,
    notes: Notes,
}

impl Located {
    /// Reads a document.
    pub fn read(document: &Document<'_>) -> Self {
        let mut read = Self::default();
        read.root(document.root_element());
        read
    }

    /// The offset of a part in the text, in bytes. If the part is missing, the
    /// offset of the part that should contain it.
    pub fn position(&self, place: Place) -> usize {
        self.notes.position(place)
    }

    /// Whether a required attribute is missing, or a present one is not a value of its type.
    pub fn is_unread(&self, place: Place, attribute: &'static str) -> bool {
        self.notes.is_unread(place, attribute)
    }

    /// The co-simulation interface, if any.
    pub fn co_simulation(&self) -> Option<&CoSimulation> {
        (self.interfaces > 0).then_some(&self.description.co_simulation)
    }

    /// The model identifier, if given.
    pub fn model_identifier(&self) -> Option<&str> {
        let given = !self.is_unread(Place::Interface(0), "modelIdentifier");
        given.then_some(&self.description.co_simulation.model_identifier)
    }

    /// Reports every broken rule of [`RULES`](crate::RULES), in their order.
    pub fn check(&self, report: &mut dyn FnMut(Violation)) {
        let add = |place, message: &str| Violation {
            rule: "interface.co-simulation",
            place,
            message: message.to_owned(),
        };
        if self.interfaces == 0 && self.description.model_exchange.is_none() {
            let message = "there is neither a CoSimulation nor a ModelExchange element";
            report(add(Place::Root, message));
        }
        for i in 1..self.interfaces {
            report(add(Place::Interface(i), "CoSimulation is there again; must be there once"));
        }
        let mut check = Check { unread: &self.notes.unread, report };
        fmi2::description(&self.description, &mut check);
        fmi2::structure(&self.description, &self.structure, &mut check);
    }

    fn root(&mut self, root: Node<'_, '_>) {
        // The attributes of the root.
        let mut at = self.notes.enter(Place::Root, root);
        let description = ModelDescription {
            model_name: at.text("modelName"),
            guid: at.required("guid", |text| Some(text.to_owned())),
            description: at.text("description"),
            author: at.text("author"),
            version: at.text("version"),
            copyright: at.text("copyright"),
            license: at.text("license"),
            generation_tool: at.text("generationTool"),
            generation_date_and_time: at.optional("generationDateAndTime"),
            variable_naming_convention: at
                .value("variableNamingConvention", NamingConvention::parse)
                .unwrap_or_default(),
            ..ModelDescription::default()
        };
        self.description = description;
        self.description.model_exchange =
            children(root, "ModelExchange").next().map(|node| self.exchange(node));
        // The co-simulation interfaces; the model contains the first.
        let interfaces: Vec<_> = children(root, "CoSimulation").collect();
        self.interfaces = interfaces.len();
        if interfaces.is_empty() {
            self.notes.miss(Place::Interface(0), "modelIdentifier");
        }
        for (i, node) in interfaces.into_iter().enumerate() {
            let place = Place::Interface(i);
            self.notes.interface(place, node);
            if i == 0 {
                self.description.co_simulation = self.interface(place, node);
            }
        }
        // The lists that variables refer to, and the experiment.
        self.description.units = self.notes.units(root);
        self.description.types = list(root, "TypeDefinitions", "SimpleType")
            .enumerate()
            .map(|(t, node)| self.simple_type(t, node))
            .collect();
        self.description.log_categories = self.notes.categories(root);
        self.description.default_experiment = self.notes.experiment(root);
        // The variables, and the structure over them.
        self.description.variables = list(root, "ModelVariables", "ScalarVariable")
            .enumerate()
            .map(|(v, node)| self.variable(v, node))
            .collect();
        let structure = children(root, "ModelStructure").next();
        self.structure = ModelStructure {
            outputs: self.unknowns(root, structure, UnknownList::Outputs),
            derivatives: self.unknowns(root, structure, UnknownList::Derivatives),
            initial_unknowns: self.unknowns(root, structure, UnknownList::InitialUnknowns),
        };
    }

    fn exchange(&mut self, node: Node<'_, '_>) -> ModelExchange {
        self.notes.interface(Place::ModelExchange, node);
        let mut at = self.notes.at(Place::ModelExchange, Some(node));
        ModelExchange {
            model_identifier: at.required("modelIdentifier", |text| Some(text.to_owned())),
            needs_execution_tool: at.flag("needsExecutionTool"),
            completed_integrator_step_not_needed: at.flag("completedIntegratorStepNotNeeded"),
            can_be_instantiated_only_once_per_process: at.flag("canBeInstantiatedOnlyOncePerProcess"),
            can_not_use_memory_management_functions: at.flag("canNotUseMemoryManagementFunctions"),
            can_get_and_set_state: at.flag("canGetAndSetFMUstate"),
            can_serialize_state: at.flag("canSerializeFMUstate"),
            provides_directional_derivative: at.flag("providesDirectionalDerivative"),
            source_files: source_files(node),
        }
    }

    fn interface(&mut self, place: Place, node: Node<'_, '_>) -> CoSimulation {
        let mut at = self.notes.at(place, Some(node));
        CoSimulation {
            model_identifier: at.required("modelIdentifier", |text| Some(text.to_owned())),
            needs_execution_tool: at.flag("needsExecutionTool"),
            can_handle_variable_step: at.flag("canHandleVariableCommunicationStepSize"),
            can_interpolate_inputs: at.flag("canInterpolateInputs"),
            max_output_derivative_order: at.value("maxOutputDerivativeOrder", unsigned).unwrap_or(0),
            can_run_asynchronously: at.flag("canRunAsynchronuously"),
            can_be_instantiated_only_once_per_process: at.flag("canBeInstantiatedOnlyOncePerProcess"),
            can_not_use_memory_management_functions: at.flag("canNotUseMemoryManagementFunctions"),
            can_get_and_set_state: at.flag("canGetAndSetFMUstate"),
            can_serialize_state: at.flag("canSerializeFMUstate"),
            provides_directional_derivative: at.flag("providesDirectionalDerivative"),
            source_files: source_files(node),
        }
    }

    fn simple_type(&mut self, t: usize, node: Node<'_, '_>) -> SimpleType {
        let place = Place::Type(t);
        let at = self.notes.enter(place, node);
        let (name, description) = (at.text("name"), at.text("description"));
        let (kind, of) = self.kind(place, node);
        if of.is_none() {
            self.notes.miss(place, "type");
        }
        // An item without a value is skipped.
        let valued = of.into_iter().flat_map(|of| children(of, "Item"));
        let valued = valued.filter_map(|n| Some((n, n.attribute("value").and_then(int)?)));
        let items = valued.enumerate().map(|(i, (node, value))| {
            let at = self.notes.enter(Place::Item(t, i), node);
            EnumerationItem { name: at.text("name"), value, description: at.text("description") }
        });
        let items = items.collect();
        SimpleType { name, description, kind, items }
    }

    /// The element with the type of a variable or declared type; without one, the type is Real.
    fn kind<'n, 'i>(&mut self, place: Place, node: Node<'n, 'i>) -> (VariableKind, Option<Node<'n, 'i>>) {
        let found = node.children().find_map(|n| {
            let of = ScalarType::ALL.iter().find(|of| n.has_tag_name(of.as_str()))?;
            Some((*of, n))
        });
        let (of, node) = found.map_or((ScalarType::Real, None), |(of, n)| (of, Some(n)));
        if let (Place::Variable(v), Some(attribute)) = (place, node.and_then(|n| n.attribute_node("start"))) {
            self.notes.mark(Place::Start(v), attribute.range().start);
        }
        let mut at = self.notes.at(place, node);
        let kind = match of {
            ScalarType::Real => VariableKind::Real(Real {
                declared_type: at.optional("declaredType"),
                quantity: at.optional("quantity"),
                unit: at.optional("unit"),
                display_unit: at.optional("displayUnit"),
                relative_quantity: at.flag("relativeQuantity"),
                min: at.value("min", double),
                max: at.value("max", double),
                nominal: at.value("nominal", double),
                start: at.start(double),
                derivative: at.value("derivative", unsigned),
            }),
            ScalarType::Integer => VariableKind::Integer(at.integer()),
            ScalarType::Enumeration => VariableKind::Enumeration(at.integer()),
            ScalarType::Boolean => VariableKind::Boolean(at.plain(boolean)),
            ScalarType::String => VariableKind::String(at.plain(|text| Some(text.to_owned()))),
        };
        (kind, node)
    }

    fn variable(&mut self, v: usize, node: Node<'_, '_>) -> Variable {
        let place = Place::Variable(v);
        let (kind, of) = self.kind(place, node);
        self.starts.push(of.and_then(|n| n.attribute("start")).map(str::to_owned));
        let mut at = self.notes.enter(place, node);
        Variable {
            name: at.required("name", |text| Some(text.to_owned())),
            value_reference: at.required("valueReference", unsigned),
            description: at.text("description"),
            causality: at.value("causality", causality).unwrap_or(Causality::Local),
            variability: at.value("variability", Variability::parse).unwrap_or(Variability::Continuous),
            initial: at.value("initial", Initial::parse),
            kind,
            dependencies: None,
            initial_dependencies: None,
        }
    }

    fn unknowns(
        &mut self,
        root: Node<'_, '_>,
        structure: Option<Node<'_, '_>>,
        list: UnknownList,
    ) -> Vec<Unknown> {
        let found = structure.and_then(|n| children(n, list.as_str()).next());
        self.notes.list_at(list, found, structure, root);
        let unknown = |(u, node)| {
            let (index, dependencies, dependency_kinds) =
                self.notes.unknown(Place::Unknown(list, u), node, "index");
            Unknown { index, dependencies, dependency_kinds }
        };
        found.into_iter().flat_map(|n| children(n, "Unknown")).enumerate().map(unknown).collect()
    }
}

/// The names of the source files of an interface.
fn source_files(node: Node<'_, '_>) -> Vec<String> {
    let files = node.descendants().filter(|n| n.has_tag_name("File"));
    files.map(|n| n.attribute("name").unwrap_or_default().to_owned()).collect()
}

/// A causality of FMI 2.0.
fn causality(word: &str) -> Option<Causality> {
    Causality::parse(word).filter(|_| Causality::WORDS_OF_FMI2.contains(&word))
}

impl At<'_, '_, '_> {
    /// Reads the start value of a variable. If it cannot be read, this is noted for the variable.
    fn start<T>(&mut self, parse: impl FnOnce(&str) -> Option<T>) -> Option<T> {
        let Place::Variable(v) = self.place else { return None };
        self.notes.at(Place::Start(v), self.node).value("start", parse)
    }

    fn integer(&mut self) -> Integer {
        Integer {
            declared_type: self.optional("declaredType"),
            quantity: self.optional("quantity"),
            min: self.value("min", int),
            max: self.value("max", int),
            start: self.start(int),
        }
    }

    fn plain<T>(&mut self, parse: impl FnOnce(&str) -> Option<T>) -> Plain<T> {
        Plain { declared_type: self.optional("declaredType"), start: self.start(parse) }
    }
}
