//! Names that a configuration gives: their form, and those that are taken.

use std::collections::BTreeMap;

use punctual_modeldescription::is_c_identifier;
use punctual_models::nearest;

use super::{ConfigurationError, VariableSection};

/// Longest name that can be used in variable names and file names.
const LONGEST: usize = 64;

/// Refuses a name that is no C identifier of at most 64 characters, by the path of its field.
pub(super) fn check_identifier(field: &str, name: &str) -> Result<(), ConfigurationError> {
    if is_c_identifier(name) && name.len() <= LONGEST {
        return Ok(());
    }
    let message =
        format!("is {name:?}, must be letters, digits and underscores, not starting with a digit (1 to 64)");
    Err(ConfigurationError::new(field, message))
}

/// Things whose names must leave the FMU's own variables alone.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Named {
    /// A barrier, the first part of the names of its variables.
    Barrier,
    /// A parameter of a model.
    Parameter,
}

/// Names, and first parts of names, of the FMU's own variables.
const RESERVED: [(&str, &[Named]); 17] = {
    const BOTH: &[Named] = &[Named::Barrier, Named::Parameter];
    [
        ("x", BOTH),
        ("u", BOTH),
        ("u_ref", BOTH),
        ("u_min", BOTH),
        ("u_max", BOTH),
        ("status", BOTH),
        ("status_code", BOTH),
        ("arm_after", BOTH),
        ("actuation_delay", BOTH),
        ("rearm", BOTH),
        ("integrator", BOTH),
        ("measurement_error", BOTH),
        ("uncertainty", BOTH),
        // Parameters may have these names: models with parameters of their own have no such lengths.
        ("l_r", &[Named::Barrier]),
        ("l_f", &[Named::Barrier]),
        // A plant has no barriers.
        ("x0", &[Named::Parameter]),
        ("inner_step", &[Named::Parameter]),
    ]
};

/// Whether the FMU has a variable that forbids to call `who` by `name`.
pub(super) fn is_reserved(name: &str, who: Named) -> bool {
    RESERVED.iter().any(|(reserved, whose)| *reserved == name && whose.contains(&who))
}

/// Refuses the first of the `given` keys of `table` that names no `what` among the `known` variables.
pub(super) fn check_known<T>(
    table: &str,
    given: &BTreeMap<String, T>,
    what: &str,
    known: &[VariableSection],
) -> Result<(), ConfigurationError> {
    let names: Vec<_> = known.iter().map(|variable| variable.name.as_str()).collect();
    let Some(unknown) = given.keys().find(|key| !names.contains(&key.as_str())) else { return Ok(()) };
    let near = nearest(unknown, &names);
    let message = format!("unknown {what}{near}, must be one of {}", names.join(", "));
    Err(ConfigurationError::new(format!("{table}.{unknown}"), message))
}

/// The refusal of a name that is already taken, by the path of its field.
pub(super) fn taken(field: impl Into<String>, name: &str) -> ConfigurationError {
    ConfigurationError::new(field, format!("is {name:?}, which is already the name of something else"))
}
