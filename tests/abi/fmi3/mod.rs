//! The functions of FMI 3.0, each through `dlopen`, compared with the same FMU under 2.0.
//!
//! | module | asks |
//! |---|---|
//! | `slave` | nothing: an instance with its log |
//! | `instantiate` | refusals with their messages, paths of every kind |
//! | `legality` | every function in every mode |
//! | `arguments` | NULL, counts and value references of arrays; that a failed call changes nothing |
//! | `sameness` | that whole runs have the bits of FMI 2.0, by arrays and by scalars |
//! | `states` | snapshots: rollback, bytes, refusals |
//! | `derivatives` | directional and adjoint derivatives against each other and against differences |
//! | `dependencies` | what each element of an output depends on |

mod arguments;
mod dependencies;
mod derivatives;
mod instantiate;
mod legality;
mod sameness;
mod slave;
mod states;
