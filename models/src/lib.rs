//! Plants and barriers written as expressions, such as `v * cos(theta)`.
//!
//! A [`Model`] takes the names of states, inputs and parameters and one expression for the derivative of each
//! state, affine in the inputs. It gives a plant to simulate, and for any barrier `h(t, x)` its derivatives along
//! the plant, of any order, as the filter takes them.
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
//! Numbers, names, `+ - * / ^` and parentheses. `^` is done first and from the right, and then the sign, so that
//! `-x^2` is −(x²). The functions are those of [`FUNCTIONS`]; angles are in radians. `pi` is π, and `t`, in
//! barriers only, the time in s. `abs`, `min` and `max` have kinks, where the derivatives are those of the first
//! argument. A function outside its domain (`sqrt` of a negative number) is not a number. The filter reports that
//! as a status, and the plant as an error of the step.
//!
//! # How they are computed
//!
//! Trees become one tape on which each operation occurs once (`tape`). The tape gives Taylor coefficient after
//! Taylor coefficient of all its registers (`series`). So a step costs what its operations cost, and allocates
//! nothing.
//!
//! Layers, each using only those above it:
//!
//! | module | owns |
//! |---|---|
//! | `error` | the part that is wrong, and why |
//! | `names` | the name that was meant |
//! | `syntax` | text to tree |
//! | `affine` | whether inputs enter linearly |
//! | `units` | whether the units can be right |
//! | `tape` | trees to one tape: constants folded, equal operations merged |
//! | `series` | Taylor coefficients of a tape |
//! | `motion` | the motion of a plant, and the series of a barrier along it |
//! | `evaluated` | plants and barriers that somebody else's code computes |
//! | `functions` | values of expressions of state and time |
//! | `model` | plants and barriers of expressions |
#![forbid(unsafe_code)]
// Elementary functions are those of the core: clippy.toml.
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod affine;
mod error;
pub mod evaluated;
mod functions;
mod model;
mod motion;
mod names;
mod series;
mod syntax;
mod tape;
mod units;

pub use error::Error;
pub use functions::Functions;
pub use model::{Barrier, Model};
pub use names::nearest;
pub use syntax::{FUNCTIONS, MAX_LENGTH, MAX_NESTING, MAX_OPERATORS, is_in_name, is_reserved, mentions};
pub use units::{Unit, unit_of};

/// Most states of a model.
pub const MAX_STATES: usize = 64;

/// Most operations of a model with one barrier.
pub const MAX_OPERATIONS: usize = 4096;
