//! The repository's own rules: which crate and module may use which, where unsafe code and printing
//! stand, that examples parse and that documents agree with the program. Each rule is one test.

mod dependencies;
mod documents;
mod lexer;
mod places;
mod sources;
