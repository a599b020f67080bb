//! Why there is no plan, and the message that says so.

use alloc::string::{String, ToString};
use core::fmt;

/// Why a list of inputs is not a backup plan.
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
        /// h there, less the least value that has to be kept, < 0.
        #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
        slack: f64,
    },
    /// The plant does not reach an equilibrium, or a set moves.
    NoRest,
    /// A deviation too small to measure grows along the plan until the plan is lost.
    Unsteady,
    /// There is no promise to keep.
    Nothing,
    /// The model is not finite along the plan.
    Singular,
    /// There are too many samples, or steps of the model, to check.
    TooLong,
    /// The plant was seen to deviate from the model. With 1.5 times that deviation, a requirement may not be met before the
    /// next sample.
    Drift {
        /// The number of its barrier.
        barrier: usize,
        /// Time in s.
        #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
        time: f64,
        /// h there in the model, less what it may fall by because of the deviation, < 0.
        #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
        slack: f64,
    },
    /// Two requirements are in force at the same time, and no state meets both: there can be no plan.
    Apart {
        /// The numbers of their barriers.
        barriers: [usize; 2],
        /// Whether the first one has a deadline still to come, but its set contained the state, so that it has to be kept
        /// from there on.
        contained: bool,
    },
    /// The bounds of an input leave too little for the feedback that holds an uncertain plant near the plan.
    NoReserve {
        /// The number of the input.
        input: usize,
        /// What it lacks, > 0, in its unit.
        #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
        missing: f64,
    },
    /// No bound was found on how far an uncertain plant may be from the plan: it grows without end.
    Spreads,
    /// The plant is farther from where the plan expected it than the declared uncertainty allows.
    Undeclared {
        /// The number of the state.
        state: usize,
        /// How much farther, > 0, in its unit.
        #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
        beyond: f64,
    },
    /// The point that a barrier follows is farther from where it was expected than its declared [`Motion`](crate::filter::Motion)
    /// allows.
    Strays {
        /// The number of the barrier.
        barrier: usize,
        /// How much farther, > 0, in m.
        #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
        beyond: f64,
    },
    /// The next sample comes before the input of this one acts, so that two inputs are on their way.
    Overtaken,
    /// A requirement began while no plan was followed, so it is not known whether it was met.
    Missed {
        /// The number of its barrier.
        barrier: usize,
    },
}

/// The names in the message of a [`Failure`], which itself knows barriers only by their numbers.
pub trait Names {
    /// The name of a barrier.
    fn barrier(&self, barrier: usize) -> String {
        format!("barrier {barrier}")
    }

    /// A difference of h of a barrier, with its unit.
    fn amount(&self, _barrier: usize, value: f64) -> String {
        value.to_string()
    }

    /// A time in s, without the unit.
    fn time(&self, time: f64) -> String {
        time.to_string()
    }

    /// The name of an input.
    fn input(&self, input: usize) -> String {
        format!("input {input}")
    }

    /// A difference of an input, with its unit.
    fn input_amount(&self, _input: usize, value: f64) -> String {
        value.to_string()
    }

    /// The name of a state.
    fn state(&self, state: usize) -> String {
        format!("state {state}")
    }

    /// A difference of a state, with its unit.
    fn state_amount(&self, _state: usize, value: f64) -> String {
        value.to_string()
    }

    /// The statement that no state meets two barriers.
    fn apart(&self, barriers: [usize; 2]) -> String {
        let [first, second] = barriers.map(|barrier| self.barrier(barrier));
        format!("no state is in both {first} and {second}")
    }
}

/// Barriers by their numbers, counted from 0 as everywhere in a filter.
struct Numbers;

impl Names for Numbers {}

impl Failure {
    /// The message, with the names from `names`.
    pub fn named(self, names: &dyn Names) -> impl fmt::Display {
        Named { failure: self, names }
    }
}

/// A failure with names for its contents.
struct Named<'a> {
    failure: Failure,
    names: &'a dyn Names,
}

impl fmt::Display for Named<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { failure, names } = *self;
        match failure {
            Failure::Broken { barrier, time, slack } => {
                let (name, missing) = (names.barrier(barrier), names.amount(barrier, -slack));
                write!(f, "{name} is not met at {} s, by {missing}", names.time(time))
            }
            Failure::Drift { barrier, time, slack } => {
                let (name, missing) = (names.barrier(barrier), names.amount(barrier, -slack));
                let at = names.time(time);
                write!(
                    f,
                    "the plant is not where the model predicted; with 1.5 times that deviation again, {name} would not be met at {at} s, by \
                     {missing}"
                )
            }
            Failure::Missed { barrier } => {
                write!(f, "{} came due while no plan was followed", names.barrier(barrier))
            }
            Failure::NoReserve { input, missing } => write!(
                f,
                "the bounds of {} leave too little to hold the uncertain plant near the plan, by {}",
                names.input(input),
                names.input_amount(input, missing)
            ),
            Failure::Spreads => {
                f.write_str("no feedback holds the uncertain plant near the plan: its deviation grows without end")
            }
            Failure::Undeclared { state, beyond } => write!(
                f,
                "{} is {} farther from the plan than the declared uncertainty allows",
                names.state(state),
                names.state_amount(state, beyond)
            ),
            Failure::Strays { barrier, beyond } => write!(
                f,
                "the point that {} follows is {beyond:.2e} m farther from its course than its declared acceleration and errors allow",
                names.barrier(barrier)
            ),
            Failure::Overtaken => f.write_str(
                "the next sample comes before the input of this one acts: steps must be at least as long as actuation_delay",
            ),
            Failure::NoRest => f.write_str("the plant does not reach an equilibrium, or a set moves"),
            Failure::Unsteady => f.write_str(
                "the plant is so unstable along the plan that a deviation too small to measure grows until the plan is lost; \
                 with wider bounds, or from a start farther from where they no longer suffice, it could be held",
            ),
            Failure::Apart { barriers, contained: true } => write!(
                f,
                "{}; and {} contains the start, so it must be kept from the first step on: did you mean `begin`?",
                names.apart(barriers),
                names.barrier(barriers[0])
            ),
            Failure::Apart { barriers, contained: false } => {
                write!(f, "{}, but both must hold at the same time", names.apart(barriers))
            }
            Failure::Nothing => f.write_str("nothing can be promised from there"),
            Failure::TooLong => {
                f.write_str("there are too many samples until the deadline, or too long a step")
            }
            Failure::Singular => f.write_str("the model is not finite, or no step resolves it"),
        }
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.named(&Numbers).fmt(f)
    }
}

impl core::error::Error for Failure {}

#[cfg(test)]
mod tests {
    use alloc::string::ToString;

    use super::*;

    struct GoalAndRock;

    impl Names for GoalAndRock {
        fn barrier(&self, barrier: usize) -> String {
            ["goal", "rock"][barrier].to_string()
        }

        fn amount(&self, _barrier: usize, value: f64) -> String {
            format!("{value} m")
        }
    }

    #[test]
    fn words_name_barriers_by_number_or_by_name() {
        let broken = Failure::Broken { barrier: 1, time: 2.5, slack: -0.25 };
        assert_eq!(broken.to_string(), "barrier 1 is not met at 2.5 s, by 0.25");
        assert_eq!(broken.named(&GoalAndRock).to_string(), "rock is not met at 2.5 s, by 0.25 m");
        let apart = Failure::Apart { barriers: [0, 1], contained: false };
        let wanted = "no state is in both goal and rock, but both must hold at the same time";
        assert_eq!(apart.named(&GoalAndRock).to_string(), wanted);
    }
}
