//! Every test of the core but those that replace the allocator, in one program: what is generic is compiled once and not
//! forty times. `cargo test -p punctual-core --test all plan::` runs one file. With its path a file finds what it shares beside it.

#[path = "arming.rs"]
mod arming;
#[path = "chains.rs"]
mod chains;
#[path = "convergence_lemma.rs"]
mod convergence_lemma;
#[path = "convergence_profile.rs"]
mod convergence_profile;
#[path = "convergence_promise.rs"]
mod convergence_promise;
#[path = "convergence_roots.rs"]
mod convergence_roots;
#[path = "convergence_stay.rs"]
mod convergence_stay;
#[path = "degree.rs"]
mod degree;
#[path = "external.rs"]
mod external;
#[path = "filter.rs"]
mod filter;
#[path = "following.rs"]
mod following;
#[path = "horizon.rs"]
mod horizon;
#[path = "infeasible.rs"]
mod infeasible;
#[path = "judge.rs"]
mod judge;
#[path = "lie.rs"]
mod lie;
#[path = "measurement_errors.rs"]
mod measurement_errors;
#[path = "missions.rs"]
mod missions;
#[path = "moving.rs"]
mod moving;
#[path = "moving_attack.rs"]
mod moving_attack;
#[path = "plan.rs"]
mod plan;
#[path = "portability.rs"]
mod portability;
#[path = "qp.rs"]
mod qp;
#[path = "qp_bytes.rs"]
mod qp_bytes;
#[path = "qp_enumeration.rs"]
mod qp_enumeration;
#[path = "qp_several_rows.rs"]
mod qp_several_rows;
#[path = "reach.rs"]
mod reach;
#[path = "rearming.rs"]
mod rearming;
#[path = "robust.rs"]
mod robust;
#[path = "sampling.rs"]
mod sampling;
#[path = "search.rs"]
mod search;
#[path = "sensitivity.rs"]
mod sensitivity;
#[path = "serialization.rs"]
mod serialization;
#[path = "settings.rs"]
mod settings;
#[path = "several.rs"]
mod several;
#[path = "shared_plant.rs"]
mod shared_plant;
