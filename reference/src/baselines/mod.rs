//! Baselines: constraints of the literature, for comparison. Each is a [`Condition`] that
//! [`FilterBuilder::condition`](punctual_core::filter::FilterBuilder::condition) uses in place of this
//! project's methods.
//!
//! | condition | h⁽ⁿ⁾ ≥ φ such that | deadline | source |
//! |---|---|---|---|
//! | [`Exponential`] | Π (D + a_i) h ≥ 0 | none | Nguyen and Sreenath 2016 |
//! | [`Chain`], linear | ψ_n ≥ 0, ψ_i = ψ̇_{i−1} + p_i ψ_{i−1} | none | Xiao and Belta 2019, 2022 |
//! | [`Chain`], powers | ψ_n ≥ 0, ψ_i = ψ̇_{i−1} + p_i \|ψ_{i−1}\|^{q_i} sign ψ_{i−1} | a bound that depends on the start | Xiao, Belta and Cassandras 2021 |
//! | [`FirstOrderFixedTime`] | ḣ + α \|h\|^p sign h ≥ 0 | T, for n = 1 | Bhat and Bernstein 2000; order n ours |
//! | [`Tube`] | h + s(t) ≥ 0 kept, s shrinking to 0 | T | arXiv:2603.17003 for n = 1; order n ours |
//!
//! All but the tube are time-invariant. None accounts for the effect of a held input; the filter enforces
//! them at the samples. With a margin μ in the settings, all of them are conditions on h − μ.
//!
//! Two methods are filters of their own, which simulate a model with a [`Backup`]:
//!
//! | filter | changes u_ref | source |
//! |---|---|---|
//! | [`Gatekeeper`] | when no longer nominal trajectory has a backup | Agrawal, Chen and Panagou, arXiv:2211.14361 |
//! | [`BackupBarrier`] | as little as the rows along the backup require | Gurriet et al. 2018; Chen et al. 2021 |
//!
//! They keep a set that contains the start, forever and within the bounds. Neither has a deadline.

mod backup;
mod backup_barrier;
mod chain;
#[cfg(test)]
mod double_integrator;
mod exponent;
mod exponential;
mod first_order;
mod gatekeeper;
mod tube;

pub use backup::{Backup, Brake, Law, Stoppable};
pub use backup_barrier::{BackedUp, BackupBarrier};
pub use chain::{Chain, ClassK};
pub use exponent::Exponent;
pub use exponential::Exponential;
pub use first_order::FirstOrderFixedTime;
pub use gatekeeper::Gatekeeper;
pub use punctual_core::convergence::condition::{Bound, Condition, Sample};
pub use tube::Tube;

use punctual_core::MAX_RELATIVE_DEGREE;
use punctual_core::error::{Error, ErrorKind};

/// Checks that `n` is a valid number of links.
fn checked_order(field: &str, n: usize) -> Result<usize, Error> {
    if (1..=MAX_RELATIVE_DEGREE).contains(&n) {
        return Ok(n);
    }
    let message = format!("has {n} components, must have 1 to {MAX_RELATIVE_DEGREE}");
    Err(Error::new(ErrorKind::Dimension, field, message))
}
