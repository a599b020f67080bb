//! Why there is no plan.

/// What keeps a list of inputs from being a witness.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum Failure {
    /// A requirement is not met.
    Broken {
        /// The number of its barrier.
        barrier: usize,
        /// Time in s.
        #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
        time: f64,
        /// h there, less what has to be kept of it, < 0.
        #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
        slack: f64,
    },
    /// The plant does not come to rest, or a set moves.
    NoRest,
    /// A deviation that nobody could measure grows on the way until the plan is lost.
    Unsteady,
    /// Nothing is promised that could be kept.
    Nothing,
    /// The model is not finite on the way.
    Singular,
    /// There are too many samples, or steps of the model, to look at.
    TooLong,
    /// The plant was seen to differ from the model, and by as much again a requirement may not be met before the next sample.
    Drift {
        /// The number of its barrier.
        barrier: usize,
        /// Time in s.
        #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
        time: f64,
        /// h there in the model, less what it may fall by beside it, < 0.
        #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
        slack: f64,
    },
    /// Two requirements are in force at the same time, and no state meets both: no plan can be there.
    Apart {
        /// The numbers of their barriers.
        barriers: [usize; 2],
        /// Whether the first one has a deadline that is still to come, but contained the state, so that it is kept from there on.
        contained: bool,
    },
    /// A requirement began while no plan was followed, so nobody saw whether it was met.
    Missed {
        /// The number of its barrier.
        barrier: usize,
    },
}
