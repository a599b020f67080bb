//! Units, defined by exponents of the SI base units.

use crate::xsd;
use serde::Serialize;

/// A unit that Real variables can refer to by name.
///
/// A value `x` in this unit is `factor * x + offset` in the SI base units with the exponents of `base`.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Unit {
    /// The name that variables use, for example `m/s`. Not empty, unique among the units, one line.
    #[serde(rename = "@name")]
    pub name: String,
    /// Its definition in SI base units, if given.
    #[serde(rename = "BaseUnit", skip_serializing_if = "Option::is_none")]
    pub base: Option<BaseUnit>,
    /// Units for display.
    #[serde(rename = "DisplayUnit", skip_serializing_if = "Vec::is_empty")]
    pub display_units: Vec<DisplayUnit>,
}

/// A unit for display: `x` of the unit is shown as `factor * x + offset`, or as `factor / x` if `inverse`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DisplayUnit {
    /// The name, for example `deg`; unique among the display units of the unit, not empty, one line.
    #[serde(rename = "@name")]
    pub name: String,
    /// Display units per unit; finite and not 0, default 1.
    #[serde(rename = "@factor", skip_serializing_if = "xsd::is_one", serialize_with = "xsd::number")]
    pub factor: f64,
    /// Value in display units at 0 of the unit; finite, default 0.
    #[serde(rename = "@offset", skip_serializing_if = "xsd::is_default", serialize_with = "xsd::number")]
    pub offset: f64,
    /// Whether the display unit is the inverse, such as litres per kilometre for kilometres per litre;
    /// without offset, default false. FMI 2.0 has no such units.
    #[serde(rename = "@inverse", skip_serializing_if = "xsd::is_default")]
    pub inverse: bool,
}

/// A product of powers of the SI base units (and of the radian), with scale and offset.
///
/// The default is dimensionless with factor 1 and offset 0.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct BaseUnit {
    /// Exponent of the kilogram, dimensionless.
    #[serde(rename = "@kg", skip_serializing_if = "xsd::is_default")]
    pub kg: i32,
    /// Exponent of the metre, dimensionless.
    #[serde(rename = "@m", skip_serializing_if = "xsd::is_default")]
    pub m: i32,
    /// Exponent of the second, dimensionless.
    #[serde(rename = "@s", skip_serializing_if = "xsd::is_default")]
    pub s: i32,
    /// Exponent of the ampere (symbol A), dimensionless.
    #[serde(rename = "@A", skip_serializing_if = "xsd::is_default")]
    pub a: i32,
    /// Exponent of the kelvin (symbol K), dimensionless.
    #[serde(rename = "@K", skip_serializing_if = "xsd::is_default")]
    pub k: i32,
    /// Exponent of the mole, dimensionless.
    #[serde(rename = "@mol", skip_serializing_if = "xsd::is_default")]
    pub mol: i32,
    /// Exponent of the candela, dimensionless.
    #[serde(rename = "@cd", skip_serializing_if = "xsd::is_default")]
    pub cd: i32,
    /// Exponent of the radian, dimensionless.
    #[serde(rename = "@rad", skip_serializing_if = "xsd::is_default")]
    pub rad: i32,
    /// Base units per unit; finite and greater than 0, default 1.
    #[serde(rename = "@factor", skip_serializing_if = "xsd::is_one", serialize_with = "xsd::number")]
    pub factor: f64,
    /// Value in base units at 0 of this unit; finite, default 0.
    #[serde(rename = "@offset", skip_serializing_if = "xsd::is_default", serialize_with = "xsd::number")]
    pub offset: f64,
}

impl Default for BaseUnit {
    fn default() -> Self {
        Self { kg: 0, m: 0, s: 0, a: 0, k: 0, mol: 0, cd: 0, rad: 0, factor: 1.0, offset: 0.0 }
    }
}
