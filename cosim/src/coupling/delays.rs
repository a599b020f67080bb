//! How late the input of a filter acts in a coupling, and whether the filter knows.
//!
//! A filter assumes that the input of a sample acts at once, or `actuation_delay` later. In Jacobi order, and without direct
//! feedthrough, it acts exactly one step later, if the filter measures and drives its plant with nothing between. The delay of
//! a filter that can be told, and whose file says nothing, is then set to that step.

use punctual_fmu::text::number;

use super::network::{self, Link};
use super::promises::{is_filter, is_of};
use super::system::{Order, System};
use crate::host::{Causality, Description};

/// The parameter of a filter that says how late its input acts.
const DELAY: &str = "actuation_delay";
/// Part of a step by which two times may differ, for round-off.
const ROUND_OFF: f64 = 1e-9;

/// What is found of the filters of a system.
#[derive(Debug, Default)]
pub(crate) struct Delays {
    /// Start values of [`DELAY`] that the system gives beside those in its file: component, value reference, and s.
    pub(crate) starts: Vec<(usize, u32, f64)>,
    /// What was set.
    pub(crate) notes: Vec<String>,
    /// Which filter does not account for how late its input acts, and what to do.
    pub(crate) warnings: Vec<String>,
}

/// When the input of a filter acts, counted from its sample.
pub(super) enum Late {
    /// At once, or nothing takes it.
    Never,
    /// One step later.
    OneStep,
    /// Nobody knows: it passes through these components, or is measured through them.
    Unknown(String),
}

/// The delays of all filters in `system`.
pub(crate) fn of(system: &System, descriptions: &[&Description], links: &[Link]) -> Delays {
    let mut found = Delays::default();
    for (component, description) in descriptions.iter().enumerate().filter(|(_, d)| is_filter(d)) {
        let owner = &system.components()[component];
        let (name, step) = (&owner.name, system.experiment().step);
        let how = match system.experiment().order {
            Order::Jacobi => "in Jacobi order",
            Order::GaussSeidel => "without direct feedthrough",
        };
        let late = late(system, descriptions, links, component);
        if matches!(late, Late::Never) {
            continue;
        }
        let parameter = description.index_of(DELAY).map(|at| &description.variables[at]);
        let parameter = parameter.filter(|variable| variable.causality == Causality::Parameter);
        let stated = owner.start.get(DELAY).and_then(|value| value.number());
        let declared = stated.or(parameter.and_then(|variable| variable.start)).unwrap_or(0.0);
        let design = description.default_experiment.as_ref().and_then(|given| given.step_size);
        let warning = match late {
            Late::Never => continue,
            // What a system file says of the delay holds.
            Late::OneStep if stated == Some(0.0) || declared >= step * (1.0 - ROUND_OFF) => continue,
            Late::OneStep if declared > 0.0 => format!(
                "u acts a step of {} s after its sample {how}, but {DELAY} is {} s: give that step, or nothing",
                number(step),
                number(declared)
            ),
            Late::OneStep => match (parameter, design) {
                (None, _) => format!(
                    "u acts a step after its sample {how}, and there is no {DELAY} to tell it by (it accounts for no delay, or is an \
                     FMU of an older version), so its promises do not hold: build it anew, or let u act at once (order \
                     \"gauss-seidel\", direct feedthrough)"
                ),
                (Some(_), Some(design)) if step > design * (1.0 + ROUND_OFF) => format!(
                    "u acts a step of {} s after its sample {how}, and the filter is made for steps of {} s, so its promises do \
                     not hold: give it `experiment.step_size = {}`",
                    number(step),
                    number(design),
                    number(step)
                ),
                (Some(variable), _) => {
                    // No longer than the step that the filter is made for, not even by round-off.
                    let delay = design.map_or(step, |design| step.min(design));
                    found.starts.push((component, variable.value_reference, delay));
                    found.notes.push(format!(
                        "{name}: u acts a step after its sample {how}; {DELAY} is set to {} s, so the filter accounts for it",
                        number(delay)
                    ));
                    continue;
                }
            },
            Late::Unknown(_) if declared > 0.0 => continue,
            Late::Unknown(through) => format!(
                "u acts later than its sample {how}, by a time that is not known here, since it passes {through}; its promises do \
                 not hold unless {DELAY} says how late"
            ),
        };
        found.warnings.push(format!("{name}: {warning}"));
    }
    found
}

/// How late the input of the filter `component` acts.
pub(super) fn late(system: &System, descriptions: &[&Description], links: &[Link], component: usize) -> Late {
    let description = descriptions[component];
    let name = |variable: usize| description.variables[variable].name.as_str();
    let driven = |link: &&Link| link.from.component == component && is_of(name(link.from.variable), "u");
    let measured = |link: &&Link| link.to.component == component && is_of(name(link.to.variable), "x");
    let (mut to, mut from) = (Vec::new(), Vec::new());
    let mut is_prompt = system.experiment().order == Order::GaussSeidel;
    for link in links.iter().filter(driven) {
        to.push(link.to.component);
        is_prompt &=
            network::has_feedthrough(&system.components()[component], description, link.from.variable);
    }
    from.extend(links.iter().filter(measured).map(|link| link.from.component));
    if to.is_empty() || is_prompt {
        return Late::Never;
    }
    let has_feedthrough = |c: usize| {
        let outputs = &descriptions[c].outputs;
        outputs
            .iter()
            .any(|output| network::has_feedthrough(&system.components()[c], descriptions[c], output.variable))
    };
    // In Gauss-Seidel order what has direct feedthrough runs first, so the filter would see what it does next.
    let is_between = |c: usize| {
        !from.contains(&c) || system.experiment().order == Order::GaussSeidel && has_feedthrough(c)
    };
    let mut between: Vec<_> = to.into_iter().filter(|c| is_between(*c)).collect();
    between.sort_unstable();
    between.dedup();
    if between.is_empty() {
        return Late::OneStep;
    }
    let names: Vec<_> = between.iter().map(|c| system.components()[*c].name.as_str()).collect();
    Late::Unknown(names.join(", "))
}

#[cfg(test)]
mod tests {
    use punctual_fmu::configuration::Configuration;

    use super::*;
    use crate::coupling::Own;

    const FILTER: &str = r#"
kind = "filter"
plant.model = "point_mass"
bounds = { u_x = [-5.0, 5.0], u_y = [-5.0, 5.0] }
experiment.step_size = 0.02
[[barrier]]
name = "goal"
centre = [9.0, 3.0]
radius = 2.0
deadline = 8.0
"#;
    const PLANT: &str = "kind = \"plant\"\nplant.model = \"point_mass\"\n";

    const SYSTEM: &str = r#"
[experiment]
stop_time = 10.0
step = 0.02
order = "jacobi"
[[component]]
name = "filter"
fmu = "filter.toml"
[[component]]
name = "plant"
fmu = "plant.toml"
[[connect_by_name]]
components = ["filter", "plant"]
"#;

    /// The findings for a filter and its plant, with edits of the file of the filter and of that of the system.
    fn found(filter: &[(&str, &str)], system: &[(&str, &str)]) -> Delays {
        let edited = |text: &str, edits: &[(&str, &str)]| {
            edits.iter().fold(text.to_owned(), |text, (from, to)| {
                assert!(text.contains(from), "{from:?} in {text}");
                text.replacen(from, to, 1)
            })
        };
        let description = |text: &str| Own::new(Configuration::parse(text).unwrap()).unwrap().description;
        let system = System::parse(&edited(SYSTEM, system)).unwrap();
        let of = [description(&edited(FILTER, filter)), description(PLANT), description(PLANT)];
        let of: Vec<_> = of.iter().take(system.components().len()).collect();
        let links = network::links(&system, &of).unwrap();
        super::of(&system, &of, &links)
    }

    fn set(of: &Delays) -> Vec<f64> {
        of.starts
            .iter()
            .map(|(component, _, delay)| if *component == 0 { *delay } else { f64::NAN })
            .collect()
    }

    #[test]
    fn a_filter_that_is_a_step_late_is_told() {
        let jacobi = found(&[], &[]);
        assert_eq!((set(&jacobi), jacobi.warnings.len()), (vec![0.02], 0), "{jacobi:?}");
        assert_eq!(
            jacobi.notes,
            [
                "filter: u acts a step after its sample in Jacobi order; actuation_delay is set to 0.02 s, so the filter accounts for it"
            ]
        );
        let order = ("order = \"jacobi\"", "");
        let prompt = found(&[], &[order]);
        assert!(
            prompt.starts.is_empty() && prompt.notes.is_empty() && prompt.warnings.is_empty(),
            "{prompt:?}"
        );
        let stepwise = found(&[("kind", "direct_feedthrough = false\nkind")], &[order]);
        assert_eq!(set(&stepwise), [0.02], "{stepwise:?}");
        assert!(stepwise.notes[0].contains("without direct feedthrough"), "{stepwise:?}");
        // Steps shorter than those it is made for.
        assert_eq!(set(&found(&[], &[("step = 0.02", "step = 0.01")])), [0.01]);
    }

    #[test]
    fn what_is_declared_stays() {
        for delay in ["0.02", "0.03"] {
            let declared = found(&[("kind", &format!("actuation_delay = {delay}\nkind"))], &[]);
            assert!(declared.starts.is_empty() && declared.warnings.is_empty(), "{declared:?}");
        }
        let stated = |value: &str| {
            let start = format!("fmu = \"filter.toml\"\nstart = {{ actuation_delay = {value} }}");
            found(&[], &[("fmu = \"filter.toml\"", &start)])
        };
        for value in ["0.02", "0.0", "0"] {
            assert!(stated(value).starts.is_empty() && stated(value).warnings.is_empty(), "{value}");
        }
        let less = stated("0.01");
        assert!(less.starts.is_empty(), "{less:?}");
        assert_eq!(
            less.warnings,
            [
                "filter: u acts a step of 0.02 s after its sample in Jacobi order, but actuation_delay is 0.01 s: give that step, or nothing"
            ]
        );
    }

    #[test]
    fn what_cannot_be_told_is_warned_of() {
        let longer = found(&[], &[("step = 0.02", "step = 0.05")]);
        assert!(
            longer.starts.is_empty() && longer.warnings[0].contains("experiment.step_size = 0.05"),
            "{longer:?}"
        );
        let errors = ("kind", "assurance = \"off\"\nmeasurement_errors = { v_x = 0.1 }\nkind");
        let silent = found(&[errors], &[]);
        assert!(
            silent.starts.is_empty() && silent.warnings[0].contains("there is no actuation_delay"),
            "{silent:?}"
        );
        // The input reaches another component than the one that is measured.
        let through = found(
            &[],
            &[
                ("[[connect_by_name]]\ncomponents = [\"filter\", \"plant\"]", ""),
                (
                    "name = \"plant\"\nfmu = \"plant.toml\"\n",
                    "name = \"plant\"\nfmu = \"plant.toml\"\nstart = { \"u.u_x\" = 0.0, \"u.u_y\" = 0.0 }\n\
                     [[component]]\nname = \"actuator\"\nfmu = \"plant.toml\"\nstart = { \"u.u_y\" = 0.0 }\n\
                     [[connection]]\nfrom = \"filter.u.u_x\"\nto = \"actuator.u.u_x\"\n\
                     [[connect_by_name]]\ncomponents = [\"plant\", \"filter\"]\n",
                ),
            ],
        );
        let warning = through.warnings.first().map_or("", String::as_str);
        assert!(through.starts.is_empty() && warning.contains("since it passes actuator"), "{through:?}");
    }
}
