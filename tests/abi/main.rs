//! The shared library as an importer sees it: every function through `dlopen`, none through Rust.
//!
//! The oracle for numbers is `punctual-core` in process, compared bit for bit.
//!
//! | module | asks |
//! |---|---|
//! | `api`, `fmu`, `slave` | nothing: the library, an extracted FMU, an instance with its log |
//! | `exports` | which symbols there are, and the answer to a NULL component |
//! | `instantiate` | refusals with their messages, names and paths of every kind |
//! | `legality` | every function in every mode |
//! | `arguments` | NULL arrays, value references, ranges; that a failed call changes nothing |
//! | `logging` | categories, messages logged, flags that exclude functions |
//! | `outputs` | lazy outputs of a filter, anchors, re-arming |
//! | `times` | odd communication points and steps |
//! | `plant` | inner steps, initial states, refusals |
//! | `derivatives` | directional derivatives against differences, and refusals |
//! | `external` | derivatives that are inputs, against the filter that computes them |
//! | `assurance` | plans: bits, states, the log, derivatives |
//! | `arming` | filters that are armed later than at their first step |
//! | `states` | snapshots: layout, lifetime, refusals |
//! | `rollback` | that going back and on gives the same bits |
//! | `mistimed` | times that a restore took back, told at the next step |
//! | `fmi3` | the functions of FMI 3.0, beside those of 2.0 |
//! | `lifetime` | reset, several instances, threads, unloading |

mod api;
mod arguments;
mod arming;
mod assurance;
mod derivatives;
mod exports;
mod external;
mod fmi3;
mod fmu;
mod instantiate;
mod legality;
mod lifetime;
mod logging;
mod mistimed;
mod outputs;
mod plant;
mod rollback;
mod slave;
mod states;
mod times;
