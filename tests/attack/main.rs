//! Attacks: calls, states, configurations and archives made from arbitrary bytes, and a host in C under the
//! sanitizers and valgrind.
//!
//! A case is a few bytes, from a generator with a fixed seed or from a line of `corpus/`, which keeps every
//! case that ever failed. `PUNCTUAL_ATTACK` multiplies the number of cases (`tests/nightly`).
//!
//! | module | attacks |
//! |---|---|
//! | `campaign`, `bytes` | nothing: cases, their readings, the corpus |
//! | `instance` | nothing: an instance that watches its log |
//! | `fleet`, `machine` | nothing: FMUs of every kind, and the conditions after each call |
//! | `calls` | the functions of FMI 2.0 in any order with any arguments |
//! | `arrays` | the 75 functions of FMI 3.0 in the same way |
//! | `states` | serialised states with bytes changed, checksums right or wrong |
//! | `configurations` | configurations and system files |
//! | `archives` | archives, model descriptions and library files |
//! | `hosts` | sessions of a C program under AddressSanitizer, UBSan and valgrind |

#![allow(clippy::print_stdout, reason = "the figures are read from the output")]

#[allow(dead_code, reason = "shared with tests/abi")]
#[path = "../abi/api.rs"]
mod api;
mod archives;
mod arrays;
mod bytes;
mod calls;
mod campaign;
mod configurations;
mod fleet;
#[allow(dead_code, reason = "shared with tests/abi")]
#[path = "../abi/fmu.rs"]
mod fmu;
mod hosts;
mod instance;
mod machine;
#[allow(dead_code, reason = "shared with tests/cli")]
#[path = "../cli/misbehaving.rs"]
mod misbehaving;
mod states;
#[allow(dead_code, reason = "shared with tests/cli")]
#[path = "../cli/workshop.rs"]
mod workshop;
