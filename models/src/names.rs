//! Suggests names similar to a misspelled one.

/// The fewest characters of a prefix that suggests the whole name.
const BEGINNING: usize = 3;

/// " (did you mean x?)" if one of the `known` names is similar to `name`, else empty.
pub fn nearest(name: &str, known: &[&str]) -> String {
    let name = name.to_lowercase();
    let distance = |other: &str| {
        let other = other.to_lowercase();
        let begins = name.len() >= BEGINNING && other.starts_with(&name)
            || other.len() >= BEGINNING && name.starts_with(&other);
        if begins { 0 } else { strsim::damerau_levenshtein(&name, &other) }
    };
    let near = known.iter().map(|other| (distance(other), *other)).min();
    match near {
        Some((distance, other)) if distance <= name.chars().count() / 2 => {
            format!(" (did you mean {other}?)")
        }
        _ => String::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn near_names_are_found_and_others_are_not() {
        let known = ["margin", "centre", "step_size", "stop_time", "unit", "v"];
        for (name, wanted) in [
            ("margn", "margin"),
            ("center", "centre"),
            ("Margin", "margin"),
            ("step", "step_size"),
            ("stop", "stop_time"),
            ("units", "unit"),
            ("V", "v"),
            ("stop_time_s", "stop_time"),
        ] {
            assert_eq!(nearest(name, &known), format!(" (did you mean {wanted}?)"), "{name}");
        }
        for name in ["colour", "s", "w", ""] {
            assert_eq!(nearest(name, &known), "", "{name}");
        }
        assert_eq!(nearest("x", &[]), "");
    }
}
