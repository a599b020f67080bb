//! Units, defined by exponents of the SI base units.

/// A unit that Real variables can refer to by name.
///
/// A value `x` in this unit is `factor * x + offset` in the SI base units with the exponents of `base`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Unit {
    /// The name, as variables spell it, for example `m/s`. Not empty, unique among the units, one line.
    pub name: String,
    /// What the unit is in SI base units.
    pub base: BaseUnit,
}

/// A product of powers of the SI base units (and of the radian), with scale and offset.
///
/// The default is dimensionless with factor 1 and offset 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BaseUnit {
    /// Exponent of the kilogram, dimensionless.
    pub kg: i32,
    /// Exponent of the metre, dimensionless.
    pub m: i32,
    /// Exponent of the second, dimensionless.
    pub s: i32,
    /// Exponent of the ampere (symbol A), dimensionless.
    pub a: i32,
    /// Exponent of the kelvin (symbol K), dimensionless.
    pub k: i32,
    /// Exponent of the mole, dimensionless.
    pub mol: i32,
    /// Exponent of the candela, dimensionless.
    pub cd: i32,
    /// Exponent of the radian, dimensionless.
    pub rad: i32,
    /// Base units per unit; finite and greater than 0, default 1.
    pub factor: f64,
    /// Value in base units at 0 of this unit; finite, default 0.
    pub offset: f64,
}

impl Default for BaseUnit {
    fn default() -> Self {
        Self { kg: 0, m: 0, s: 0, a: 0, k: 0, mol: 0, cd: 0, rad: 0, factor: 1.0, offset: 0.0 }
    }
}
