//! What the last bits of a plan are made of is the same on every system.

use nalgebra::ComplexField;
use proptest::prelude::*;

proptest! {
    /// The decompositions of nalgebra take the lengths of a pair from a crate, not from the C library of the system: these differ
    /// in their last bits from version to version and from processor to processor, and so would plans. (That of glibc 2.36
    /// differs for every seventh pair.)
    #[test]
    fn lengths_in_decompositions_are_not_those_of_the_c_library(x in 0.0..1.0_f64, y in 0.0..1.0_f64) {
        prop_assert_eq!(ComplexField::hypot(x, y).to_bits(), libm::hypot(x, y).to_bits());
    }
}
