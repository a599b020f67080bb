//! The fixed-time constraint: from the derivatives of h at an anchor to a floor under h⁽ⁿ⁾.
//!
//! Nothing here knows a model. [`FixedTime`] receives h and its first n − 1 derivatives as plain numbers and returns the
//! least h⁽ⁿ⁾ that keeps the promise; the filter turns that into a row on u. The mathematics is one lemma ([`comparison`])
//! with a choice of error e and rate a, and for n = 1 also the classical fixed-time condition:
//!
//! | method | e | a | promise | when |
//! |---|---|---|---|---|
//! | [`repeated_root`], the paper's | h − μ | largest root of (R), negative from rest | h ≥ μ from T on | n even; n odd: T ≥ T_min, if any |
//! | [`hermite`], the default | h − μ − r | any a > 0 | h ≥ μ from T on | always |
//! | [`stay`] | h − μ | a ≥ [`stay::smallest_rate`], recomputed at every sample | h ≥ μ for ever | all c_k(a) ≥ 0 |
//!
//! A custom constraint can replace these as a [`condition`].
//!
//! The promises hold for the continuous-time constraint. An input that is held between samples breaks it by up to its change
//! over one period, which the margin μ has to absorb. [`sampled`] is the constraint for such an input, and loses far less.
//! `docs/theory.md` has the proofs: `docs/theory.md#comparison-lemma` for all methods, `docs/theory.md#held-inputs` for held
//! inputs.

mod approach;
pub mod comparison;
pub mod condition;
mod fixed_time;
pub mod hermite;
pub mod operator;
mod phase;
pub mod polynomial;
pub mod profile;
mod reference_profile;
pub mod repeated_root;
pub mod sampled;
mod sensitivity;
mod settings;
mod state;
pub mod stay;

pub use fixed_time::{DerivativeBound, FixedTime, Refusal};
pub use phase::Phase;
pub use sensitivity::BoundDerivative;
pub use settings::{FixedTimeSettings, Infeasible, Method, ProfileKind};
pub use state::{FixedTimeState, Unmet};
