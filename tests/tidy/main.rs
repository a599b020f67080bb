//! The repository's own rules: which crate and module may use which, where unsafe code and printing are
//! allowed, that examples parse, that formulas can be rendered, that references resolve, that documents agree
//! with the program and versions with each other. Each rule is one test.

mod dependencies;
mod documents;
mod formulas;
mod lexer;
mod places;
mod references;
mod schema;
mod sources;
mod versions;
