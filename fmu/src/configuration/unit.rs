//! Units by name: products of powers of base units, as `m/s2` or `kg.m2/s`.

use std::f64::consts::{PI, TAU};

use punctual_core::elementary;
use punctual_modeldescription::BaseUnit;
use punctual_models::Unit;

use super::ConfigurationError;

/// The exponents of SI base units in a name; `None` where it cannot be read.
///
/// Factors are joined by a dot, those after the one `/` divide, a number behind a symbol is its exponent; `1` is
/// no unit.
pub fn base_unit(name: &str) -> Option<BaseUnit> {
    /// Largest exponent; a larger one would be a mistake, and overflow.
    const LARGEST: i32 = 99;
    let mut base = BaseUnit::default();
    for (part, sign) in name.splitn(2, '/').zip([1, -1]) {
        for factor in part.split('.') {
            let symbol = factor.trim_end_matches(|c: char| c.is_ascii_digit());
            let exponent = match &factor[symbol.len()..] {
                "" => 1,
                digits => digits.parse().ok().filter(|n| (1..=LARGEST).contains(n))?,
            };
            match symbol {
                "" if factor == "1" => {}
                _ => multiply(&mut base, &symbol_of(symbol)?, sign * exponent),
            }
        }
    }
    Some(base)
}

/// The unit with this symbol, which may have a prefix.
pub(crate) fn symbol_of(symbol: &str) -> Option<BaseUnit> {
    let find = |symbol: &str| SYMBOLS.iter().find(|s| s.0 == symbol);
    let prefixed = || {
        let prefix = PREFIXES.iter().find(|prefix| symbol.starts_with(prefix.0))?;
        let (_, factor, _, exponents) = find(&symbol[1..]).filter(|s| s.2)?;
        Some((prefix.1 * factor, exponents))
    };
    let (factor, exponents) = find(symbol).map(|s| (s.1, &s.3)).or_else(prefixed)?;
    let [kg, m, s, a, k, mol, cd, rad] = *exponents;
    Some(BaseUnit { kg, m, s, a, k, mol, cd, rad, factor, offset: 0.0 })
}

/// Multiplies `base` by a power of another unit, whose offset does not count.
pub(crate) fn multiply(base: &mut BaseUnit, other: &BaseUnit, exponent: i32) {
    base.factor *= elementary::powi(other.factor, exponent);
    for (own, power) in [
        (&mut base.kg, other.kg),
        (&mut base.m, other.m),
        (&mut base.s, other.s),
        (&mut base.a, other.a),
        (&mut base.k, other.k),
        (&mut base.mol, other.mol),
        (&mut base.cd, other.cd),
        (&mut base.rad, other.rad),
    ] {
        *own = own.saturating_add(power.saturating_mul(exponent));
    }
}

/// What the unit of a variable measures; `None` for `1`, which may be no more than unsaid.
pub(super) fn measured(name: &str) -> Option<Unit> {
    let base = base_unit(name).filter(|_| name != "1")?;
    let exponents = [base.kg, base.m, base.s, base.a, base.k, base.mol, base.cd];
    Some(Unit::new(name, exponents, base.factor))
}

/// The unit of a derivative of order `degree` ≥ 1: `m` over s², `m/s` over s.
pub fn over_seconds(unit: &str, degree: usize) -> String {
    unit_per(unit, &format!("s{degree}"))
}

/// The unit of a quotient, each symbol once: `m/s2` per `rad/s` is `m/s.rad`.
pub(super) fn unit_per(unit: &str, by: &str) -> String {
    let mut powers: Vec<(&str, i32)> = Vec::new();
    for (name, sign) in [(unit, 1), (by, -1)] {
        for (part, side) in name.splitn(2, '/').zip([sign, -sign]) {
            for factor in part.split('.') {
                let symbol = factor.trim_end_matches(|c: char| c.is_ascii_digit());
                // Only a symbol without a number leaves the exponent 1 unsaid.
                let power = side * factor[symbol.len()..].parse().unwrap_or(1);
                match powers.iter_mut().find(|p| p.0 == symbol) {
                    Some(known) => known.1 += power,
                    None if symbol.is_empty() => {}
                    None => powers.push((symbol, power)),
                }
            }
        }
    }
    let side = |sign: i32| {
        let factors = powers.iter().filter(|p| p.1 * sign > 0).map(|&(symbol, power)| match power.abs() {
            1 => symbol.to_owned(),
            power => format!("{symbol}{power}"),
        });
        factors.collect::<Vec<_>>().join(".")
    };
    match (side(1), side(-1)) {
        (above, below) if below.is_empty() => {
            if above.is_empty() {
                "1".to_owned()
            } else {
                above
            }
        }
        (above, below) if above.is_empty() => format!("1/{below}"),
        (above, below) => format!("{above}/{below}"),
    }
}

/// The physical quantity that a unit measures, in the words of the Modelica Standard Library.
pub fn quantity(unit: &str) -> Option<String> {
    let name = match unit {
        "s" => "Time",
        "m" => "Length",
        "m/s" => "Velocity",
        "m/s2" => "Acceleration",
        "rad" => "Angle",
        "rad/s" => "AngularVelocity",
        "rad/s2" => "AngularAcceleration",
        _ => return None,
    };
    Some(name.to_owned())
}

/// Symbols with the factor to base units, whether they take a prefix, and the exponents of kg, m, s, A, K, mol, cd and rad.
const SYMBOLS: [(&str, f64, bool, [i32; 8]); 52] = [
    ("kg", 1.0, false, [1, 0, 0, 0, 0, 0, 0, 0]),
    ("m", 1.0, true, [0, 1, 0, 0, 0, 0, 0, 0]),
    ("s", 1.0, true, [0, 0, 1, 0, 0, 0, 0, 0]),
    ("A", 1.0, true, [0, 0, 0, 1, 0, 0, 0, 0]),
    ("K", 1.0, true, [0, 0, 0, 0, 1, 0, 0, 0]),
    ("mol", 1.0, true, [0, 0, 0, 0, 0, 1, 0, 0]),
    ("cd", 1.0, false, [0, 0, 0, 0, 0, 0, 1, 0]),
    ("rad", 1.0, true, [0, 0, 0, 0, 0, 0, 0, 1]),
    ("Hz", 1.0, true, [0, 0, -1, 0, 0, 0, 0, 0]),
    ("N", 1.0, true, [1, 1, -2, 0, 0, 0, 0, 0]),
    ("Pa", 1.0, true, [1, -1, -2, 0, 0, 0, 0, 0]),
    ("J", 1.0, true, [1, 2, -2, 0, 0, 0, 0, 0]),
    ("W", 1.0, true, [1, 2, -3, 0, 0, 0, 0, 0]),
    ("C", 1.0, true, [0, 0, 1, 1, 0, 0, 0, 0]),
    ("V", 1.0, true, [1, 2, -3, -1, 0, 0, 0, 0]),
    ("Ohm", 1.0, true, [1, 2, -3, -2, 0, 0, 0, 0]),
    ("S", 1.0, true, [-1, -2, 3, 2, 0, 0, 0, 0]),
    ("F", 1.0, true, [-1, -2, 4, 2, 0, 0, 0, 0]),
    ("H", 1.0, true, [1, 2, -2, -2, 0, 0, 0, 0]),
    ("T", 1.0, true, [1, 0, -2, -1, 0, 0, 0, 0]),
    ("Wb", 1.0, true, [1, 2, -2, -1, 0, 0, 0, 0]),
    ("lm", 1.0, true, [0, 0, 0, 0, 0, 0, 1, 0]),
    ("lx", 1.0, true, [0, -2, 0, 0, 0, 0, 1, 0]),
    ("min", 60.0, false, [0, 0, 1, 0, 0, 0, 0, 0]),
    ("h", 3600.0, false, [0, 0, 1, 0, 0, 0, 0, 0]),
    ("d", 86_400.0, false, [0, 0, 1, 0, 0, 0, 0, 0]),
    ("deg", PI / 180.0, false, [0, 0, 0, 0, 0, 0, 0, 1]),
    ("rev", TAU, false, [0, 0, 0, 0, 0, 0, 0, 1]),
    ("rpm", TAU / 60.0, false, [0, 0, -1, 0, 0, 0, 0, 1]),
    ("percent", 1e-2, false, [0; 8]),
    ("ppm", 1e-6, false, [0; 8]),
    ("g", 1e-3, true, [1, 0, 0, 0, 0, 0, 0, 0]),
    ("t", 1e3, false, [1, 0, 0, 0, 0, 0, 0, 0]),
    ("l", 1e-3, true, [0, 3, 0, 0, 0, 0, 0, 0]),
    ("L", 1e-3, true, [0, 3, 0, 0, 0, 0, 0, 0]),
    ("bar", 1e5, true, [1, -1, -2, 0, 0, 0, 0, 0]),
    ("atm", 101_325.0, false, [1, -1, -2, 0, 0, 0, 0, 0]),
    ("mmHg", 133.322_387_415, false, [1, -1, -2, 0, 0, 0, 0, 0]),
    ("psi", 6_894.757_293_168_36, false, [1, -1, -2, 0, 0, 0, 0, 0]),
    ("Wh", 3600.0, true, [1, 2, -2, 0, 0, 0, 0, 0]),
    ("Ah", 3600.0, true, [0, 0, 1, 1, 0, 0, 0, 0]),
    ("cal", 4.184, true, [1, 2, -2, 0, 0, 0, 0, 0]),
    ("hp", 745.699_871_582_270_2, false, [1, 2, -3, 0, 0, 0, 0, 0]),
    ("kn", 1852.0 / 3600.0, false, [0, 1, -1, 0, 0, 0, 0, 0]),
    ("mph", 0.447_04, false, [0, 1, -1, 0, 0, 0, 0, 0]),
    ("nmi", 1852.0, false, [0, 1, 0, 0, 0, 0, 0, 0]),
    ("mi", 1_609.344, false, [0, 1, 0, 0, 0, 0, 0, 0]),
    ("yd", 0.914_4, false, [0, 1, 0, 0, 0, 0, 0, 0]),
    ("ft", 0.304_8, false, [0, 1, 0, 0, 0, 0, 0, 0]),
    ("in", 0.025_4, false, [0, 1, 0, 0, 0, 0, 0, 0]),
    ("lb", 0.453_592_37, false, [1, 0, 0, 0, 0, 0, 0, 0]),
    ("lbf", 4.448_221_615_260_5, false, [1, 1, -2, 0, 0, 0, 0, 0]),
];

/// The prefixes of SI that technical systems have.
const PREFIXES: [(char, f64); 11] = [
    ('T', 1e12),
    ('G', 1e9),
    ('M', 1e6),
    ('k', 1e3),
    ('h', 1e2),
    ('d', 1e-1),
    ('c', 1e-2),
    ('m', 1e-3),
    ('u', 1e-6),
    ('n', 1e-9),
    ('p', 1e-12),
];

/// Refuses a unit that cannot be read, by the path of its field.
pub(super) fn check_unit(field: &str, name: &str) -> Result<(), ConfigurationError> {
    /// Longest name.
    const LENGTH: usize = 64;
    if name.len() <= LENGTH && base_unit(name).is_some() {
        return Ok(());
    }
    let of = |prefixed: bool| {
        let symbols: Vec<_> = SYMBOLS.iter().filter(|s| s.2 == prefixed).map(|s| s.0).collect();
        symbols.join(", ")
    };
    let (alone, prefixed) = (of(false), of(true));
    let message = format!(
        "is {name:?}, must be like \"kg.m2/s\", made of {alone} and, also with a prefix as in km, of {prefixed}, or \"1\""
    );
    Err(ConfigurationError::new(field, message))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_of_derivatives() {
        for (unit, degree, wanted) in [
            ("m", 1, "m/s"),
            ("m/s", 2, "m/s3"),
            ("1", 2, "1/s2"),
            ("N.m/rad", 1, "N.m/rad.s"),
            ("V/A2.s", 3, "V/A2.s4"),
        ] {
            assert_eq!(over_seconds(unit, degree), wanted);
            assert!(base_unit(wanted).is_some(), "{wanted}");
        }
    }

    #[test]
    fn units_of_quotients() {
        for (unit, by, wanted) in [
            ("m/s2", "m/s2", "1"),
            ("m/s2", "rad/s", "m/s.rad"),
            ("1/s", "1", "1/s"),
            ("1", "N", "1/N"),
            ("m", "1/s", "m.s"),
            ("m.m", "m", "m"),
        ] {
            assert_eq!(unit_per(unit, by), wanted);
            let [found, above, below] = [wanted, unit, by].map(|u| base_unit(u).expect("a unit"));
            assert_eq!(
                (found.m, found.s, found.rad),
                (above.m - below.m, above.s - below.s, above.rad - below.rad)
            );
        }
    }

    #[test]
    fn units_of_other_scales_have_a_factor() {
        for (name, wanted) in [
            ("km/h", 1.0 / 3.6),
            ("deg/s2", 0.017_453_292_519_9),
            ("cm2", 1e-4),
            ("m/ms2", 1e6),
            ("N", 1.0),
            ("percent", 1e-2),
        ] {
            let base = base_unit(name).expect(name);
            assert!((base.factor / wanted - 1.0).abs() < 1e-9, "{name}: {}", base.factor);
        }
    }

    #[test]
    fn units_are_read() {
        let found = |name| base_unit(name).map(|b| [b.kg, b.m, b.s, b.a, b.k, b.mol, b.cd, b.rad]);
        for (name, wanted) in [
            ("1", [0; 8]),
            ("m/s2", [0, 1, -2, 0, 0, 0, 0, 0]),
            ("1/s", [0, 0, -1, 0, 0, 0, 0, 0]),
            ("kg.m2/s", [1, 2, -1, 0, 0, 0, 0, 0]),
            ("N.m/rad", [1, 2, -2, 0, 0, 0, 0, -1]),
            ("V/A2.s", [1, 2, -4, -3, 0, 0, 0, 0]),
        ] {
            assert_eq!(found(name), Some(wanted), "{name}");
        }
        for name in ["", "mile", "degC", "kmin", "ckg", "m/", "m/s/s", "m..s", "2", "m0", "m100", "m^2", " m"]
        {
            assert_eq!(found(name), None, "{name}");
        }
    }
}
