//! How often a filter changes the wanted input, and by how much.

use std::collections::BTreeMap;

use punctual_core::filter::Status;
use serde::Serialize;

use super::layout::Layout;
use super::network::{self, Link, Port};
use super::promises::is_filter;
use super::system::{Order, System};
use crate::host::{Causality, Description};

/// Difference from the wanted input that counts as no change, relative to 1 + its size. It allows for
/// round-off in unit conversions.
const SAME: f64 = 1e-9;
/// Magnitude of a bound from which the input counts as unbounded.
const UNBOUNDED: f64 = 1e29;

/// What a filter has changed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Interference {
    /// The component.
    pub filter: String,
    /// Samples with a valid input.
    pub samples: u64,
    /// Number of those at which an input differed from the wanted one.
    pub changed: u64,
    /// Mean change over these samples, relative to the width of the bounds. Each sample counts its
    /// most-changed input. `None` if no sample was changed or no input has both bounds.
    pub mean: Option<f64>,
    /// The largest such change.
    pub most: Option<f64>,
    /// For a filter that follows backup plans: the barriers for which inputs were changed, and at how many
    /// samples each.
    pub reasons: BTreeMap<String, u64>,
}

impl Interference {
    /// The findings as one sentence.
    pub fn text(&self) -> String {
        let Self { filter, samples, changed, .. } = self;
        if *changed == 0 {
            return format!("{filter} left u_ref as it is at all {samples} samples.");
        }
        let share = 100.0 * *changed as f64 / *samples as f64;
        let by = match (self.mean, self.most) {
            (Some(mean), Some(most)) => {
                format!(
                    ", by {:.1} % of the bounds in the mean and {:.1} % at most",
                    100.0 * mean,
                    100.0 * most
                )
            }
            _ => String::new(),
        };
        let mut reasons: Vec<(&String, &u64)> = self.reasons.iter().collect();
        reasons.sort_by_key(|(_, times)| std::cmp::Reverse(**times));
        let each: Vec<String> = reasons.iter().map(|(name, times)| format!("{name} at {times}")).collect();
        let why = if each.is_empty() { String::new() } else { format!("; for {}", each.join(", ")) };
        format!("{filter} changed u_ref at {changed} of {samples} samples ({share:.1} %){by}{why}.")
    }
}

/// An input of a filter: the wanted value, the given value, and the width of its bounds.
struct Pair<P> {
    wanted: P,
    given: P,
    width: Option<f64>,
}

/// The ports of a filter that show what it changes.
pub(super) struct Ports {
    component: usize,
    name: String,
    status: Port,
    reason: Option<Port>,
    barriers: Vec<String>,
    pairs: Vec<Pair<Port>>,
    prompt: bool,
}

impl Ports {
    pub(super) fn all(&self) -> impl Iterator<Item = Port> {
        self.pairs.iter().flat_map(|pair| [pair.wanted, pair.given]).chain([self.status]).chain(self.reason)
    }
}

/// A filter that is watched.
pub(super) struct Watched {
    name: String,
    status: usize,
    /// The slot with the number of the barrier that caused a change, and the names of all barriers.
    reason: Option<usize>,
    barriers: Vec<String>,
    pairs: Vec<Pair<usize>>,
    prompt: bool,
    /// The wanted inputs at the last point.
    last: Option<Vec<f64>>,
    samples: u64,
    changed: u64,
    total: f64,
    most: f64,
    reasons: BTreeMap<String, u64>,
}

/// The ports of all filters in `system`.
pub(super) fn ports(system: &System, descriptions: &[&Description], links: &[Link]) -> Vec<Ports> {
    let of = |(component, description): (usize, &&Description)| {
        let variable = |name: &str| description.index_of(name).map(|variable| Port { component, variable });
        let number = |name: &str| description.variables[description.index_of(name)?].start;
        let status = variable("status").filter(|_| is_filter(description))?;
        let given = description.variables.iter().filter(|v| v.causality == Causality::Output);
        let pairs: Vec<Pair<Port>> = given
            .filter_map(|v| {
                let rest = v.name.strip_prefix('u').filter(|rest| rest.starts_with(['.', '[']))?;
                let bounds = [number(&format!("u_min{rest}")), number(&format!("u_max{rest}"))];
                let width = match bounds {
                    [Some(min), Some(max)] if min > -UNBOUNDED && max < UNBOUNDED => Some(max - min),
                    _ => None,
                };
                let (wanted, given) = (variable(&format!("u_ref{rest}"))?, variable(&v.name)?);
                Some(Pair { wanted, given, width: width.filter(|width| *width > 0.0) })
            })
            .collect();
        let (owner, first) = (&system.components()[component], pairs.first()?.given.variable);
        let prompt = system.experiment().order == Order::GaussSeidel
            && network::has_feedthrough(owner, description, first);
        let barrier = |name: &str| name.strip_suffix(".guaranteed").map(str::to_owned);
        let barriers = description.variables.iter().filter_map(|v| barrier(&v.name)).collect();
        let (name, reason) = (owner.name.clone(), variable("reason"));
        Some(Ports { component, name, status, reason, barriers, pairs, prompt })
    };
    // A filter whose wanted inputs are neither connected nor set has no controller to interfere with.
    let is_wanted = |ports: &Ports| {
        let is_fed = |port: Port| links.iter().any(|link| link.to == port);
        let starts = &system.components()[ports.component].start;
        ports.pairs.iter().any(|pair| is_fed(pair.wanted))
            || starts.keys().any(|key| key.starts_with("u_ref"))
    };
    descriptions.iter().enumerate().filter_map(of).filter(is_wanted).collect()
}

impl Watched {
    /// `None` if a port has no slot.
    pub(super) fn new(layout: &Layout, ports: &Ports) -> Option<Self> {
        let pair = |pair: &Pair<Port>| {
            let Pair { wanted, given, width } = *pair;
            Some(Pair { wanted: layout.slot(wanted)?, given: layout.slot(given)?, width })
        };
        Some(Self {
            name: ports.name.clone(),
            status: layout.slot(ports.status)?,
            reason: ports.reason.and_then(|port| layout.slot(port)),
            barriers: ports.barriers.clone(),
            pairs: ports.pairs.iter().map(pair).collect::<Option<_>>()?,
            prompt: ports.prompt,
            last: None,
            samples: 0,
            changed: 0,
            total: 0.0,
            most: 0.0,
            reasons: BTreeMap::new(),
        })
    }

    /// Forgets the last run.
    pub(super) fn reset(&mut self) {
        (self.last, self.samples, self.changed, self.total, self.most) = (None, 0, 0, 0.0, 0.0);
        self.reasons.clear();
    }

    /// Evaluates the `values` of a communication point.
    pub(super) fn see(&mut self, values: &[f64]) {
        let now: Vec<f64> = self.pairs.iter().map(|pair| values[pair.wanted]).collect();
        let wanted = if self.prompt { Some(now.clone()) } else { self.last.take() };
        self.last = Some(now);
        let status = Status::from_number(values[self.status] as i32);
        let is_idle = status.is_some_and(|s| s.is_abstention() || s == Status::NotArmed);
        let Some(wanted) = wanted.filter(|_| !is_idle) else { return };
        self.samples += 1;
        let (mut far, mut is_changed) = (0.0_f64, false);
        for (pair, wanted) in self.pairs.iter().zip(&wanted) {
            let by = (values[pair.given] - wanted).abs();
            // NaN counts as a change.
            if by <= SAME * (1.0 + wanted.abs()) {
                continue;
            }
            is_changed = true;
            far = far.max(pair.width.map_or(0.0, |width| by / width));
        }
        if is_changed {
            self.changed += 1;
            self.total += far;
            self.most = self.most.max(far);
            let reason = self.reason.map_or(0, |reason| values[reason] as usize);
            if let Some(name) = reason.checked_sub(1).and_then(|barrier| self.barriers.get(barrier)) {
                *self.reasons.entry(name.clone()).or_default() += 1;
            }
        }
    }

    /// What the filter has changed until now.
    pub(super) fn interference(&self) -> Interference {
        let is_bounded = self.changed > 0 && self.pairs.iter().any(|pair| pair.width.is_some());
        Interference {
            filter: self.name.clone(),
            samples: self.samples,
            changed: self.changed,
            mean: is_bounded.then(|| self.total / self.changed as f64),
            most: is_bounded.then_some(self.most),
            reasons: self.reasons.clone(),
        }
    }
}
