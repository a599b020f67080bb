//! What the last bits of a plan are made of is the same on every system.

use nalgebra::ComplexField;

/// The decompositions of nalgebra take the lengths of a pair from a crate, not from the C library of the system: these differ in
/// their last bits from version to version and from processor to processor, and so would plans. (That of glibc 2.36 differs for
/// every seventh pair.)
#[test]
fn lengths_in_decompositions_are_not_those_of_the_c_library() {
    let mut seed = 1_u64;
    let mut draw = || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 11) as f64 / (1_u64 << 53) as f64
    };
    for _ in 0..100_000 {
        let (x, y) = (draw(), draw());
        let wanted = libm::hypot(x, y);
        assert_eq!(ComplexField::hypot(x, y).to_bits(), wanted.to_bits(), "{x}, {y}");
    }
}
