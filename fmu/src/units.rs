//! Compares the units of two connected variables: whether they are the same, how to convert between them, or
//! why that is impossible. A definition in base units takes precedence. If there is none, the name is read as
//! tools write it.

pub use punctual_modeldescription::BaseUnit;

use crate::configuration::{multiply, symbol_of};

/// What a model description says about the unit of a variable.
#[derive(Clone, Copy, Debug, Default)]
pub struct Said<'a> {
    /// Its name, if given.
    pub name: Option<&'a str>,
    /// Its definition in base units, if there is one.
    pub base: Option<BaseUnit>,
    /// Whether offsets are ignored, as for differences of temperature (`relativeQuantity`).
    pub is_difference: bool,
}

/// How a value converts to another unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fit {
    /// It is unchanged.
    Same,
    /// It becomes `factor · value + offset`.
    Scaled {
        /// Target units per source unit, > 0.
        factor: f64,
        /// In the target unit.
        offset: f64,
    },
    /// At least one of the units is not comparable.
    Unknown,
}

/// Relative round-off of definitions: `0.0174533` is a degree.
const ROUND_OFF: f64 = 1e-6;

/// The same for two units with the same name.
const NAMESAKES: f64 = 1e-3;

/// How a value of a variable in one unit converts to that of a variable in the other.
///
/// # Errors
///
/// Units of different quantities; a frequency converted to a unit with radians, which may mean revolutions; a
/// difference of temperature converted to a temperature. The error gives the reason.
pub fn fit(from: &Said<'_>, to: &Said<'_>) -> Result<Fit, &'static str> {
    let name = |said: &Said<'_>| {
        said.name.map(str::trim).filter(|name| !["", "-"].contains(name)).map(str::to_owned)
    };
    let names = [name(from), name(to)];
    let [a, b] = [from, to].map(known);
    let (Some(a), Some(b)) = (a, b) else {
        // Two units that are unspecified or dimensionless, or have the same unknown name.
        let is_plain = |base: Option<BaseUnit>, name: &Option<String>| base.map_or(name.is_none(), is_plain);
        let same = names[0] == names[1] || is_plain(a, &names[0]) && is_plain(b, &names[1]);
        return Ok(if same { Fit::Same } else { Fit::Unknown });
    };
    if dimension(&a) != dimension(&b) {
        // `1` may just mean that no unit is given.
        let unsaid = is_plain(a) || is_plain(b);
        return if unsaid { Ok(Fit::Unknown) } else { Err("which measures another quantity") };
    }
    let turns = |base: &BaseUnit, name: &Option<String>| {
        let hertz = name.as_deref().is_some_and(|name| name.contains("Hz"));
        base.s == -1 && base.rad == 0 && (hertz || base.factor != 1.0)
    };
    if a.rad != b.rad && (turns(&a, &names[0]) || turns(&b, &names[1])) {
        return Err("and a frequency may count turns or radians");
    }
    let has_offset = a.offset != 0.0 || b.offset != 0.0;
    if from.is_difference != to.is_difference && has_offset {
        return Err("and only one of them is a difference (relativeQuantity)");
    }
    let factor = a.factor / b.factor;
    let offset = if from.is_difference { 0.0 } else { (a.offset - b.offset) / b.factor };
    let tolerance = if names[0] == names[1] { NAMESAKES } else { ROUND_OFF };
    let is_same = (factor - 1.0).abs() <= tolerance && offset.abs() <= tolerance;
    Ok(if is_same { Fit::Same } else { Fit::Scaled { factor, offset } })
}

/// The definition of a unit, either its own or that of its name.
fn known(said: &Said<'_>) -> Option<BaseUnit> {
    let own =
        said.base.filter(|base| base.factor.is_finite() && base.factor > 0.0 && base.offset.is_finite());
    own.or_else(|| named(said.name?))
}

/// Whether it is just the number 1.
fn is_plain(base: BaseUnit) -> bool {
    base == BaseUnit::default()
}

/// The exponents without that of the radian, which is 1 in FMI.
fn dimension(base: &BaseUnit) -> [i32; 7] {
    [base.kg, base.m, base.s, base.a, base.k, base.mol, base.cd]
}

/// Temperature units, with the factor and offset that convert to kelvins. In a product they are differences.
const TEMPERATURES: [(&str, f64, f64); 2] = [("degC", 1.0, 273.15), ("degF", 5.0 / 9.0, 459.67 * 5.0 / 9.0)];

/// Notations that tools use for a sign, in the order in which they are replaced.
const SIGNS: [(&str, &str); 23] = [
    ("**", "^"),
    ("\u{25}", "percent"),
    ("\u{b2}", "2"),
    ("\u{b3}", "3"),
    ("\u{b9}", "1"),
    ("\u{207b}", "-"),
    ("\u{2212}", "-"),
    ("\u{b7}", "."),
    ("\u{22c5}", "."),
    ("\u{d7}", "."),
    ("*", "."),
    ("\u{b5}", "u"),
    ("\u{3bc}", "u"),
    ("\u{3a9}", "Ohm"),
    ("\u{2126}", "Ohm"),
    ("\u{b0} ", "deg"),
    ("\u{b0}", "deg"),
    (" per ", "/"),
    ("deg C", "degC"),
    ("deg F", "degF"),
    (" / ", "/"),
    (" . ", "."),
    (" ", "."),
];

/// Notations that tools use for a unit.
const WORDS: [(&str, &str); 39] = [
    ("sec", "s"),
    ("second", "s"),
    ("seconds", "s"),
    ("minute", "min"),
    ("minutes", "min"),
    ("hr", "h"),
    ("hour", "h"),
    ("hours", "h"),
    ("day", "d"),
    ("days", "d"),
    ("meter", "m"),
    ("meters", "m"),
    ("metre", "m"),
    ("metres", "m"),
    ("Deg", "deg"),
    ("degree", "deg"),
    ("degrees", "deg"),
    ("Rad", "rad"),
    ("radian", "rad"),
    ("radians", "rad"),
    ("r", "rev"),
    ("turn", "rev"),
    ("RPM", "rpm"),
    ("pct", "percent"),
    ("kelvin", "K"),
    ("Kelvin", "K"),
    ("celsius", "degC"),
    ("Celsius", "degC"),
    ("fahrenheit", "degF"),
    ("Fahrenheit", "degF"),
    ("ohm", "Ohm"),
    ("kohm", "kOhm"),
    ("kph", "km/h"),
    ("kmh", "km/h"),
    ("knot", "kn"),
    ("mile", "mi"),
    ("lbm", "lb"),
    ("Nm", "N.m"),
    ("kNm", "kN.m"),
];

/// The definition of a unit by its name as any tool may write it: `m/s2`, `m/s^2`, `m.s-2`, `kg*m²/(s²·A)`,
/// `°C`. `None` if the name is unknown, or if tools disagree on its meaning, as for `kg/m.s`.
pub fn named(name: &str) -> Option<BaseUnit> {
    /// Longest name.
    const LENGTH: usize = 64;
    let name = name.trim();
    if name.len() > LENGTH {
        return None;
    }
    let text = SIGNS.iter().fold(name.to_owned(), |text, (sign, ours)| text.replace(sign, ours));
    let word = WORDS.iter().find(|word| word.0 == text).map_or(text.as_str(), |word| word.1);
    if let Some(&(_, factor, offset)) = TEMPERATURES.iter().find(|of| of.0 == word) {
        return Some(BaseUnit { k: 1, factor, offset, ..BaseUnit::default() });
    }
    let mut reader = Reader { rest: &text };
    let base = reader.product()?;
    (reader.rest.is_empty() && base.factor.is_finite() && base.factor > 0.0).then_some(base)
}

/// Parses a name from the left.
struct Reader<'a> {
    rest: &'a str,
}

impl Reader<'_> {
    /// Whether `sign` follows; if so, it is consumed.
    fn passes(&mut self, sign: char) -> bool {
        let rest = self.rest.strip_prefix(sign);
        self.rest = rest.unwrap_or(self.rest);
        rest.is_some()
    }

    fn product(&mut self) -> Option<BaseUnit> {
        let mut product = self.power()?;
        let mut is_divided = false;
        loop {
            let sign = match () {
                () if self.passes('/') => -1,
                () if self.passes('.') => 1,
                () => return Some(product),
            };
            // Whether the dot binds more tightly than the slash depends on the tool.
            if is_divided && sign == 1 {
                return None;
            }
            is_divided |= sign == -1;
            multiply(&mut product, &self.power()?, sign);
        }
    }

    fn power(&mut self) -> Option<BaseUnit> {
        let base =
            if self.passes('(') { self.product().filter(|_| self.passes(')'))? } else { self.symbol()? };
        let mut power = BaseUnit::default();
        multiply(&mut power, &base, self.exponent()?);
        Some(power)
    }

    fn symbol(&mut self) -> Option<BaseUnit> {
        let end = self.rest.find(|c: char| !c.is_ascii_alphabetic()).unwrap_or(self.rest.len());
        let (symbol, rest) = self.rest.split_at(end);
        self.rest = rest;
        if symbol.is_empty() {
            // As in `1/s`.
            return self.passes('1').then(BaseUnit::default);
        }
        let temperature = || {
            let (_, factor, _) = TEMPERATURES.iter().find(|of| of.0 == symbol)?;
            Some(BaseUnit { k: 1, factor: *factor, ..BaseUnit::default() })
        };
        let word = || {
            let (_, of) = WORDS.iter().find(|word| word.0 == symbol)?;
            Reader { rest: of }.product()
        };
        symbol_of(symbol).or_else(temperature).or_else(word)
    }

    /// The exponent that follows; 1 if there is none.
    fn exponent(&mut self) -> Option<i32> {
        /// Largest exponent; a larger one would be a mistake.
        const LARGEST: i32 = 99;
        let is_marked = self.passes('^');
        let is_closed = is_marked && self.passes('(');
        let sign = if self.passes('-') { -1 } else { 1 };
        let end = self.rest.find(|c: char| !c.is_ascii_digit()).unwrap_or(self.rest.len());
        let (digits, rest) = self.rest.split_at(end);
        self.rest = rest;
        if is_closed && !self.passes(')') {
            return None;
        }
        match digits {
            "" if !is_marked && sign == 1 => Some(1),
            digits => digits.parse().ok().filter(|n| (1..=LARGEST).contains(n)).map(|n: i32| sign * n),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn said(name: &str) -> Said<'_> {
        Said { name: Some(name), ..Said::default() }
    }

    /// The value 7, converted between two units.
    fn seven(from: &str, to: &str) -> f64 {
        match fit(&said(from), &said(to)).unwrap_or_else(|why| panic!("{from}, {to}: {why}")) {
            Fit::Same => 7.0,
            Fit::Scaled { factor, offset } => 7.0 * factor + offset,
            Fit::Unknown => panic!("{from}, {to}"),
        }
    }

    #[test]
    fn units_are_converted_as_pint_converts_them() {
        // 7 of the first unit in the second, according to pint 0.25.3.
        for (from, to, wanted) in [
            ("cm", "m", 0.07),
            ("deg", "rad", 0.122_173_047_639_603_07),
            ("km/h", "m/s", 1.944_444_444_444_444_6),
            ("rpm", "rad/s", 0.733_038_285_837_618_3),
            ("rpm", "deg/s", 42.0),
            ("degC", "K", 280.15),
            ("K", "degC", -266.15),
            ("degF", "degC", -13.888_888_888_888_857),
            ("degC", "degF", 44.599_999_999_999_94),
            ("bar", "Pa", 700_000.0),
            ("psi", "kPa", 48.263_301_052_178_54),
            ("atm", "mbar", 7_092.750_000_000_001),
            ("mmHg", "Pa", 933.256_711_905_000_1),
            ("g", "kg", 0.007),
            ("lb", "g", 3_175.146_590_000_000_3),
            ("lbf", "N", 31.137_551_306_823_504),
            ("%", "1", 0.07),
            ("ppm", "%", 0.000_699_999_999_999_999_9),
            ("l/min", "m3/s", 0.000_116_666_666_666_666_69),
            ("kWh", "MJ", 25.199_999_999_999_996),
            ("Ah", "C", 25_200.0),
            ("kcal", "J", 29_288.0),
            ("hp", "kW", 5.219_899_101_075_891),
            ("kn", "km/h", 12.964),
            ("mph", "m/s", 3.129_28),
            ("nmi", "mi", 8.055_456_136_164_798),
            ("yd", "ft", 21.0),
            ("in", "mm", 177.799_999_999_999_98),
            ("t", "lb", 15_432.358_352_941_428),
            ("d", "min", 10_080.0),
            ("rev", "deg", 2520.0),
            ("mOhm", "uOhm", 7000.0),
            ("uF", "nF", 6_999.999_999_999_999),
            ("mT", "T", 0.007),
            ("GHz", "kHz", 7_000_000.0),
            ("W/(m2.K)", "kW/(cm2.K)", 7.000000000000001e-07),
            ("g/cm3", "kg/m3", 6_999.999_999_999_999),
            ("N.mm", "N.m", 0.007),
            ("deg/s2", "rad/s2", 0.122_173_047_639_603_07),
            ("ft.lbf", "J", 9.490_725_638_319_802),
            ("kN/mm", "N/m", 7_000_000.0),
            ("degF/min", "K/s", 0.064_814_814_814_814_81),
        ] {
            let found = seven(from, to);
            assert!((found - wanted).abs() <= 1e-12 * wanted.abs(), "{from}, {to}: {found}, {wanted}");
        }
    }

    #[test]
    fn spellings_of_one_unit_are_the_same() {
        for of in [
            &[
                "m/s2",
                "m/s^2",
                "m/s**2",
                "m.s-2",
                "m s^-2",
                "m*s^(-2)",
                "m/s/s",
                "m/(s.s)",
                "m\u{b7}s\u{207b}\u{b2}",
                "m/sec^2",
                "m / s2",
            ][..],
            &["N.m", "N*m", "Nm", "N m", "J", "kg.m2/s2", "kg*m^2/s^2", "W.s", "N.m/rad"],
            &["deg", "\u{b0}", "degree", "Deg"],
            &["degC", "\u{b0}C", "\u{b0} C", "deg C", "Celsius"],
            &["rpm", "RPM", "rev/min", "r/min"],
            &["km/h", "kph", "km/hr", "km per hour"],
            &["um", "\u{b5}m", "\u{3bc}m"],
            &["V/A", "Ohm", "ohm", "\u{3a9}", "1/S"],
            &["W/(m2.K)", "W/m2/K", "W/m^2/degC", "W.m-2.K-1"],
            &["1", "m/m", "rad"],
        ] {
            for (a, b) in of.iter().flat_map(|a| of.iter().map(move |b| (a, b))) {
                assert_eq!(fit(&said(a), &said(b)), Ok(Fit::Same), "{a}, {b}");
            }
        }
    }

    #[test]
    fn what_cannot_be_compared_stays_and_what_does_not_fit_is_refused() {
        for (a, b) in [
            ("m", "furlong"),
            ("m", "1"),
            ("", "m"),
            ("-", "rad"),
            ("kg/m.s", "Pa.s"),
            ("m^0.5", "m"),
            ("(m", "m"),
        ] {
            assert_eq!(fit(&said(a), &said(b)), Ok(Fit::Unknown), "{a}, {b}");
            assert_eq!(fit(&said(b), &said(a)), Ok(Fit::Unknown), "{b}, {a}");
        }
        for (a, b) in [("furlong", "furlong"), ("", "1"), ("-", ""), ("1", "rad"), ("1/s", "rad/s")] {
            assert_eq!(fit(&said(a), &said(b)), Ok(Fit::Same), "{a}, {b}");
        }
        assert_eq!(fit(&Said::default(), &Said::default()), Ok(Fit::Same));
        assert_eq!(fit(&Said::default(), &said("m")), Ok(Fit::Unknown));
        for (a, b) in [
            ("kg", "Pa"),
            ("m", "rad"),
            ("%", "m"),
            ("m/s", "m"),
            ("K", "J"),
            ("Hz", "rad/s"),
            ("1/min", "rad/s"),
            ("Hz", "rpm"),
        ] {
            assert!(fit(&said(a), &said(b)).is_err() && fit(&said(b), &said(a)).is_err(), "{a}, {b}");
        }
    }

    #[test]
    fn a_definition_counts_more_than_a_name() {
        let of = |name, factor| Said {
            name: Some(name),
            base: Some(BaseUnit { m: 1, factor, ..BaseUnit::default() }),
            is_difference: false,
        };
        assert_eq!(fit(&of("smoot", 1.7), &said("m")), Ok(Fit::Scaled { factor: 1.7, offset: 0.0 }));
        assert_eq!(fit(&of("gal", 2.0), &of("gal", 1.0)), Ok(Fit::Scaled { factor: 2.0, offset: 0.0 }));
        // A rounded factor is not a different unit.
        assert_eq!(fit(&of("ft", 0.3048), &of("ft", 0.305)), Ok(Fit::Same));
        assert_eq!(fit(&of("foot", 0.304_800_1), &of("ft", 0.3048)), Ok(Fit::Same));
        // An invalid definition is ignored.
        assert_eq!(fit(&of("cm", 0.0), &said("m")), Ok(Fit::Scaled { factor: 0.01, offset: 0.0 }));
        assert_eq!(fit(&of("cm", f64::NAN), &said("cm")), Ok(Fit::Same));
    }

    #[test]
    fn differences_of_temperature_have_no_offset() {
        let difference = |name| Said { is_difference: true, ..said(name) };
        assert_eq!(fit(&said("degC"), &said("K")), Ok(Fit::Scaled { factor: 1.0, offset: 273.15 }));
        assert_eq!(fit(&difference("degC"), &difference("K")), Ok(Fit::Same));
        assert_eq!(
            fit(&difference("degF"), &difference("K")),
            Ok(Fit::Scaled { factor: 5.0 / 9.0, offset: 0.0 })
        );
        assert!(fit(&difference("degC"), &said("K")).is_err());
        assert_eq!(fit(&difference("m"), &said("m")), Ok(Fit::Same));
    }
}
