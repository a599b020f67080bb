//! The relative degree that a barrier turned out to have: the finding that a refusal carries.

use alloc::borrow::ToOwned;
use alloc::string::{String, ToString};
use alloc::vec::Vec;
use core::fmt;

use crate::MAX_RELATIVE_DEGREE;

/// The relative degree of a barrier along a plant, as found on sample states.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum RelativeDegree {
    /// n: every input that reaches h enters h⁽ⁿ⁾ first. The only case that can be filtered.
    Uniform(usize),
    /// No input enters any derivative up to [`MAX_RELATIVE_DEGREE`] at any sample.
    Unreached,
    /// Inputs enter at different orders: for each input the first derivative it enters, if any.
    Mixed(Vec<Option<usize>>),
    /// The order of the input that enters first differs between samples: the orders found, ascending.
    Varying(Vec<usize>),
    /// Model or barrier is not finite at any sample.
    NotFinite,
}

impl RelativeDegree {
    /// n if it is uniform.
    pub fn uniform(&self) -> Option<usize> {
        match self {
            Self::Uniform(n) => Some(*n),
            _ => None,
        }
    }

    /// The order of the first derivative that an input enters, wherever that was found: n where it is uniform. A row on that
    /// derivative is right, but moves only the inputs that enter it.
    pub fn least(&self) -> Option<usize> {
        match self {
            Self::Uniform(n) => Some(*n),
            Self::Mixed(orders) => orders.iter().flatten().copied().min(),
            Self::Varying(orders) => orders.first().copied(),
            Self::Unreached | Self::NotFinite => None,
        }
    }

    /// The finding as a sentence without its subject ("is …"), input i (from 0) called `name(i)`.
    pub fn describe(&self, name: impl Fn(usize) -> String) -> String {
        match self {
            Self::Uniform(n) => format!("is {n}"),
            Self::Unreached => {
                format!("does not exist: no input enters a derivative of h up to order {MAX_RELATIVE_DEGREE}")
            }
            Self::Mixed(orders) => {
                let mut entered: Vec<_> =
                    orders.iter().enumerate().filter_map(|(i, n)| n.map(|n| (n, i))).collect();
                entered.sort_unstable();
                let parts: Vec<_> =
                    entered.iter().map(|&(n, i)| format!("{} enters derivative {n}", name(i))).collect();
                format!("is mixed: {} of h", parts.join(", "))
            }
            Self::Varying(orders) => {
                let orders: Vec<_> = orders.iter().map(usize::to_string).collect();
                format!(
                    "differs between sample states: the first derivative of h with an input is of order {}",
                    orders.join(" or ")
                )
            }
            Self::NotFinite => "is not known: model or barrier is not finite at any sample state".to_owned(),
        }
    }
}

impl fmt::Display for RelativeDegree {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.describe(|i| format!("u[{}]", i + 1)))
    }
}
