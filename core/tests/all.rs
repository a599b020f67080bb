//! Every test of the core but those that replace the allocator, in one program: what is generic is compiled once and not
//! forty times. `cargo test -p punctual-core --test all plan::` runs one file.

// What they share.
mod draw;
mod enumeration;
mod interior_point;
mod quadratic;
mod scenario;
mod support;
mod uncertain;

mod arming;
mod brief;
mod chains;
mod convergence_lemma;
mod convergence_profile;
mod convergence_promise;
mod convergence_roots;
mod convergence_stay;
mod degree;
mod external;
mod filter;
mod follower;
mod following;
mod horizon;
mod infeasible;
mod judge;
mod lie;
mod measurement_errors;
mod missions;
mod moving;
mod moving_attack;
mod plan;
mod portability;
mod qp;
mod qp_bytes;
mod qp_enumeration;
mod qp_several_rows;
mod reach;
mod rearming;
mod robust;
mod sampling;
mod search;
mod sensitivity;
mod serialization;
mod settings;
mod several;
mod shared_plant;
