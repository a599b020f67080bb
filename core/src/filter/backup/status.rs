//! The report of a filter with plans on a step: whether its promises are kept, which source chose the input, and why.

use crate::plan::Failure;

/// The source of the input of a step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
#[non_exhaustive]
pub enum Driver {
    /// u_ref, with a comfortable plan behind it: the current one, the current one moved in time, or another.
    Reference,
    /// The rows of the filter, with a plan behind their answer; or the rows alone, if nothing is promised.
    #[default]
    Rows,
    /// The nearest input to u_ref that its bounds, or the rows and a comfortable plan, allow.
    Eased,
    /// A compromise with a plan behind it: between the plan's own input and u_ref, or the answer of the rows once every set
    /// has been reached; or an input that does not jump from the last one.
    Between,
    /// The plan: nothing else keeps the promise.
    Plan,
}

/// Status of the guarantee of a filter with [plans](super::Plans). The numbers are stable: they leave the library as the
/// FMU's `assurance`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
#[non_exhaustive]
#[repr(u8)]
pub enum AssuranceStatus {
    /// No sample yet.
    #[default]
    Undecided = 0,
    /// Every promise is kept: there is a backup plan.
    Assured = 1,
    /// Refused at the first sample: no plan was found. The filter continues by its rows, without a promise.
    Refused = 2,
    /// Was assured, and is not now: the plant is not where the model predicted. Until something promised is missed, the
    /// guarantee is regained at the first sample from which a plan keeps it.
    Lost = 3,
    /// Was assured, and is not now: a sample came later than the previous hold, or earlier without a plan from there. The
    /// guarantee is regained as after a loss; after a late sample, at the next one in time.
    Irregular = 4,
    /// Was assured until a time that has come: no plan was found beyond it. The guarantee is regained as after a loss.
    Expired = 5,
}

impl AssuranceStatus {
    /// Every status, in the order of its number.
    pub const ALL: [Self; 6] =
        [Self::Undecided, Self::Assured, Self::Refused, Self::Lost, Self::Irregular, Self::Expired];

    /// Its name, as in the FMU's enumeration.
    pub fn name(self) -> &'static str {
        self.words().0
    }

    /// Its meaning, in brief.
    pub fn meaning(self) -> &'static str {
        self.words().1
    }

    fn words(self) -> (&'static str, &'static str) {
        match self {
            Self::Undecided => ("undecided", "no step with a valid state yet, or not armed"),
            Self::Assured => ("assured", "a plan keeps every promise, whatever u_ref is"),
            Self::Refused => ("refused", "no plan was found at the start: nothing is promised"),
            Self::Lost => ("lost", "was assured: the plant is not where the model predicted"),
            Self::Irregular => {
                ("irregular", "was assured: a step came late, or early without a plan from there")
            }
            Self::Expired => ("expired", "was assured until now: no plan was found beyond"),
        }
    }
}

/// Why u_ref was changed. If it were held until the next sample, and the plan followed from then on, this barrier would be
/// broken; or, if that is merely uncomfortable, it would come nearest to its edge.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Reason {
    /// The number of the barrier.
    pub barrier: usize,
    /// When, in s.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub time: f64,
}

/// The report of a filter with plans on a step ([`Report::assurance`](crate::filter::Report::assurance)).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct Assurance {
    /// Status of the guarantee.
    pub status: AssuranceStatus,
    /// The source of the input.
    pub driver: Driver,
    /// Why there is no plan, if the promise was refused, or the guarantee was lost or has expired.
    pub failure: Option<Failure>,
    /// The time in s until which every promise is kept, infinite for ever; `None` if nothing is assured. Once given, it
    /// never moves back.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub until: Option<f64>,
    /// Why u_ref was changed, as determined when it last ceased to pass; `None` if it was not changed, or only by its
    /// bounds, or if nothing is assured.
    pub reason: Option<Reason>,
}

impl Assurance {
    /// Whether every promise is kept, whatever u_ref is.
    pub fn is_assured(&self) -> bool {
        self.status == AssuranceStatus::Assured
    }
}
