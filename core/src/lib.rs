//! Fixed-time safety filters for control-affine plants.
//!
//! Given a plant `ẋ = f(x) + g(x) u` and a barrier `h`, the crate turns "be in {x : h(x) ≥ 0} within
//! T seconds, and stay there" into one affine row on `u`, and solves
//! `min ½‖u − u_ref‖²` under such rows and input bounds.
//!
//! ```
//! use punctual_core::{barriers::DistanceDisc, filter::*, plants::PointMass};
//!
//! // Reach the disc of radius 2 m around (45, 45) within 10 s.
//! let goal = DistanceDisc::new([45.0, 45.0], 2.0, 2.0)?;
//! let mut filter = Filter::builder(PointMass)
//!     .barrier("goal", goal, BarrierSettings::within(10.0))?
//!     .build()?;
//! let mut u = [0.0; 2];
//! let report = filter.step(0.0, &[0.0; 4], &[0.0; 2], &mut u)?;
//! assert!(report.status.is_satisfied());
//! assert!(u[0] > 0.0 && u[1] > 0.0);
//! # Ok::<(), punctual_core::Error>(())
//! ```
//!
//! # What you need
//!
//! | for | use |
//! |---|---|
//! | the plant | [`ControlAffine`](dynamics::ControlAffine) over any [`Scalar`](scalar::Scalar), or a vehicle of [`plants`] |
//! | the sets | [`Barrier`](barrier::Barrier), or a shape of [`barriers`] |
//! | the filter | [`Filter`](filter::Filter), [`FilterBuilder`](filter::FilterBuilder), [`BarrierSettings`](filter::BarrierSettings); [`Begin`](filter::Begin), [`End`](filter::End), [`Strictness`](filter::Strictness), [`Sampling`](filter::Sampling); `Plans`, [`Integration`](filter::Integration) |
//! | its answers | [`Report`](filter::Report), [`BarrierReport`](filter::BarrierReport), [`Status`](filter::Status), `Assurance`, `BackupPlan`; [`Error`] |
//! | its memory | [`FilterState`](filter::FilterState) |
//!
//! The other types are for constraints, sources of derivatives and controllers of your own.
//!
//! # Notation
//!
//! | symbol | name in code | unit | shape |
//! |---|---|---|---|
//! | x | `x`, state | per component | `NX` |
//! | u, u_ref | `u`, `u_ref` | per component | `NU` ≤ [`MAX_INPUTS`] |
//! | f | [`ControlAffine::drift`](dynamics::ControlAffine::drift) | unit of x / s | `NX` |
//! | g | [`ControlAffine::input_map`](dynamics::ControlAffine::input_map) | unit of x / (s · unit of u) | `NX` × `NU` |
//! | h | [`Barrier::value`](barrier::Barrier::value) | the barrier's own, `[h]` | scalar |
//! | n | `relative_degree` | 1 | 1 ..= [`MAX_RELATIVE_DEGREE`] |
//! | L_f^k h | `drift[k]` | `[h]`/s^k | k = 0 ..= n |
//! | L_g L_f^(n-1) h | `row` | `[h]`/(s^n · unit of u) | `NU` |
//! | T | `deadline` | s | scalar > 0 |
//! | a | `rate` | 1/s | scalar |
//! | μ | `margin` | `[h]` | scalar ≥ 0 |
//! | W | `disturbance` | `[h]`/s^n | scalar ≥ 0 |
//! | ε_i | [`measurement_errors`](filter::FilterBuilder::measurement_errors) | per component of x | `NX` |
//! | e = h − μ − r | `error` | `[h]` | scalar |
//! | r | `profile` | `[h]` | scalar |
//! | τ = t − t₀ | `elapsed` | s | scalar ≥ 0 |
//! | ψ = (D + a_1) ⋯ (D + a_{n−1}) e | `weights` of a [`PeriodBound`](convergence::sampled::PeriodBound) | `[h]`/s^(n−1) | scalar |
//! | δ | `period`, `hold` | s | scalar ≥ 0 |
//!
//! # Layers
//!
//! Each module uses only those above it: [`scalar`], [`jet`], [`interval`]; [`dynamics`] and [`barrier`]; [`lie`];
//! [`convergence`] (plain numbers, no model); [`qp`] (linear algebra only); [`reach`] (what
//! bounded inputs can do); `plan` (backup plans of a promise, a feature); [`follower`] (a plan as a table); [`filter`]. Beside it, [`barriers`] are regions
//! and limits to use, [`plants`] are vehicles, and [`judge`] says what became of a promise. Nominal controllers and the
//! constraints of the literature are in the crate `punctual-reference`.
//!
//! # Dependencies in the interface
//!
//! Models are written with arrays and [`Scalar`](scalar::Scalar). Of another crate only the traits `Zero` and `One` of
//! `num-traits` are part of this interface, as those of a scalar.
//!
//! # Features
//!
//! | feature | gives |
//! |---|---|
//! | `std` (default) | Rust's standard library in the dependencies. Without it the crate needs `alloc` only. |
//! | `serde` | `Serialize` and `Deserialize` for states, reports, settings and derivatives. |
//! | `plan` | plans: `filter::Filter` promises only what a verified plan keeps. Needs `std`. |
//!
//! A filter gives the same bits on every operating system and processor: [`elementary`] functions (sin, exp, …) are those
//! of the crate [`libm`](https://docs.rs/libm), not the platform's, and nothing fuses a multiplication with an addition.
//!
//! # References
//!
//! Janani S K and S. Kolathaya, *Fixed time convergence guarantees for Higher Order Control Barrier
//! Functions*, arXiv:2507.13888 ("the paper" throughout). The comparison lemma for any order, the
//! reference profile and the stay constraint go beyond it. Their proofs are in `docs/theory.md`; formulas
//! have the same labels there and here.
#![no_std]
#![forbid(unsafe_code)]
#![warn(clippy::alloc_instead_of_core, clippy::std_instead_of_alloc, clippy::std_instead_of_core)]
// Elementary functions come from one module: core/clippy.toml.
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

#[macro_use]
extern crate alloc;
#[cfg(any(feature = "std", test))]
extern crate std;
// Tests in here and tests from outside share the judge of uncertain plants.
#[cfg(test)]
extern crate self as punctual_core;

pub mod barrier;
pub mod barriers;
pub mod convergence;
pub mod dynamics;
pub mod elementary;
pub mod error;
pub mod filter;
pub mod follower;
pub mod interval;
pub mod jet;
pub mod judge;
pub mod lie;
#[cfg(feature = "plan")]
pub mod plan;
pub mod plants;
pub mod qp;
pub mod reach;
#[cfg(feature = "serde")]
mod real;
pub mod scalar;

pub use error::{Error, ErrorKind};

/// What the crate `punctual-models` shares with this one. No part of the interface: it changes without notice.
#[doc(hidden)]
pub mod internal {
    pub use crate::lie::ahead::{SUBSTEPS, is_even};
    pub use crate::lie::degree::{Coefficients, relative_degree_of, samples};
    pub use crate::lie::enclosure::{enclose, sharper};
}

/// Largest relative degree n supported: the order of the highest derivative of h that is taken. With the feature `small`, 4.
pub const MAX_RELATIVE_DEGREE: usize = if cfg!(feature = "small") { 4 } else { 8 };

/// Largest number of inputs, dim u. With the feature `small`, 4; with `two-inputs`, 2.
pub const MAX_INPUTS: usize = if cfg!(feature = "two-inputs") {
    2
} else if cfg!(feature = "small") {
    4
} else {
    32
};

/// Largest number of rows of a quadratic program, and so of barriers. With the feature `small`, 64.
pub const MAX_ROWS: usize = if cfg!(feature = "small") { 64 } else { 128 };
