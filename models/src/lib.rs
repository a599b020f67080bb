//! Plants and barriers written as expressions, such as `v * cos(theta)`.
//!
//! A [`Model`] takes the names of states, inputs and parameters, and for each state an expression of its
//! derivative, affine in the inputs. It gives a plant to simulate. For any barrier `h(t, x)`, it gives the
//! derivatives along the plant, of any order, which the filter needs.
//!
//! ```
//! use punctual_core::filter::{BarrierSettings, Filter};
//! use punctual_models::Model;
//!
//! // A car steered by its jerk, to be past the line at 100 m within 4 s.
//! let model = Model::new(&["p", "v", "acc"], &["jerk"], &[("d", 100.0)], &["v", "acc", "jerk"])?;
//! let barrier = model.barrier("p - d")?;
//! let n = barrier.relative_degree(&[[f64::NEG_INFINITY, f64::INFINITY]; 3]).uniform();
//! assert_eq!(n, Some(3));
//! let source = barrier.source(3)?;
//! let mut filter = Filter::from_sources(3, 1).source("past", source, BarrierSettings::within(4.0))?.build()?;
//! let mut u = [0.0];
//! filter.step(0.0, &[0.0, 10.0, 0.0], &[0.0], &mut u)?;
//! assert!(u[0] > 0.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Expressions
//!
//! Numbers, names, `+ - * / ^` and parentheses. `^` is evaluated first and from the right, then the sign, so
//! that `-x^2` is −(x²). The functions are those of [`FUNCTIONS`]; angles are in radians. `pi` is π. In
//! barriers, `t` is the time in s. `abs`, `min` and `max` have kinks, where they take the derivatives of the
//! first argument. A function outside its domain (`sqrt` of a negative number) gives NaN, which the filter
//! reports as a status, and the plant as an error of the step.
//!
//! # How they are computed
//!
//! Trees become one tape on which each operation occurs once (`tape`). The tape gives the Taylor coefficients
//! of all its registers, order by order (`series`). So the cost of a step is that of its operations, and it
//! does not allocate.
//!
//! Modules, each using only those above it:
//!
//! | module | owns |
//! |---|---|
//! | `error` | the part that is wrong, and why |
//! | `names` | suggestions for misspelled names |
//! | `syntax` | parsing text into trees |
//! | `affine` | whether inputs enter linearly |
//! | `units` | whether the units can be right |
//! | `operation` | the operations of a tape |
//! | `tape` | trees to one tape: constants folded, equal operations merged |
//! | `scale` | how large an expression is |
//! | `series` | Taylor coefficients of a tape |
//! | `motion` | the motion of a plant, and the series of a barrier along it |
//! | `recorded` | a plant and barriers as tapes alone, for rows: without expressions and std |
//! | `source` | all that filters and simulations take from them |
//! | `evaluated` | plants and barriers computed by foreign code |
//! | `functions` | values of expressions of state and time |
//! | `model` | plants and barriers given by expressions |
#![cfg_attr(not(feature = "expressions"), no_std)]
#![forbid(unsafe_code)]
// Elementary functions come from the core: see clippy.toml.
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

extern crate alloc;

mod error;
// Recorded tapes use a part of it.
#[cfg_attr(not(feature = "expressions"), allow(dead_code))]
mod motion;
mod operation;
pub mod recorded;
#[cfg_attr(not(feature = "expressions"), allow(dead_code))]
mod series;

#[cfg(feature = "expressions")]
mod affine;
#[cfg(feature = "expressions")]
pub mod evaluated;
#[cfg(feature = "expressions")]
mod functions;
#[cfg(feature = "expressions")]
mod model;
#[cfg(feature = "expressions")]
mod names;
#[cfg(feature = "expressions")]
mod scale;
#[cfg(feature = "expressions")]
mod source;
#[cfg(feature = "expressions")]
mod syntax;
#[cfg(feature = "expressions")]
mod tape;
#[cfg(feature = "expressions")]
mod units;

pub use error::Error;
#[cfg(feature = "expressions")]
pub use functions::Functions;
#[cfg(feature = "expressions")]
pub use model::{Barrier, Model};
#[cfg(feature = "expressions")]
pub use names::nearest;
#[cfg(feature = "expressions")]
pub use syntax::{FUNCTIONS, MAX_LENGTH, MAX_NESTING, MAX_OPERATORS, is_in_name, is_reserved, mentions};
#[cfg(feature = "expressions")]
pub use units::{Unit, unit_of};

/// Most states of a model.
pub const MAX_STATES: usize = 64;

/// Most operations of a model with one barrier.
pub const MAX_OPERATIONS: usize = 4096;
