//! External barriers: their variables, every defect with its message, and the canonical form.

use crate::configuration::{Configuration, FilterConfiguration, SamplingName};

const FILTER: &str = include_str!("../../../../examples/models/external-filter.toml");

/// A plant by name with one barrier of its own and one that is external.
const MIXED: &str = r#"
kind = "filter"
plant.model = "unicycle"
sampling = "pointwise"
[[barrier]]
name = "other"
centre = [1.0, 2.0]
centre_input = true
radius = 2.0
deadline = 3.0
[[barrier]]
name = "seen"
shape = "external"
relative_degree = 1
deadline = 1.0
"#;

fn filter(text: &str) -> FilterConfiguration {
    match Configuration::parse(text).unwrap_or_else(|e| panic!("{e} in {text}")) {
        Configuration::Filter(c) => c,
        other => panic!("{} is no filter", other.kind()),
    }
}

fn refusal(valid: &str, from: &str, to: &str) -> String {
    assert_eq!(valid.matches(from).count(), 1, "{from:?} in {valid}");
    filter(valid);
    match Configuration::parse(&valid.replace(from, to)) {
        Ok(configuration) => panic!("{to:?} was taken: {configuration:?}"),
        Err(error) => error.to_string(),
    }
}

#[test]
fn variables_are_named_with_their_units() {
    let rows = |c: &FilterConfiguration| {
        c.barrier_inputs().into_iter().map(|i| (i.name, i.unit)).collect::<Vec<_>>()
    };
    let named = |rows: &[(&str, &str)]| {
        rows.iter().map(|&(name, unit)| (name.to_owned(), unit.to_owned())).collect::<Vec<_>>()
    };
    let wanted = [
        ("goal.lf0", "m"),
        ("goal.lf1", "m/s"),
        ("goal.lf2", "m/s2"),
        ("goal.lg.u_x", "1"),
        ("goal.lg.u_y", "1"),
        ("speed.lf0", "m/s"),
        ("speed.lf1", "m/s2"),
        ("speed.lg.u_x", "1"),
        ("speed.lg.u_y", "1"),
    ];
    let c = filter(FILTER);
    assert_eq!(rows(&c), named(&wanted));
    assert_eq!(c.sampling, SamplingName::Pointwise, "where nothing can be predicted");
    assert_eq!(c.relative_degrees(), [2, 1]);
    let mixed = filter(MIXED);
    let wanted = [("seen.lf0", "1"), ("seen.lf1", "1/s"), ("seen.lg.a", "s/m"), ("seen.lg.omega", "1/rad")];
    assert_eq!(rows(&mixed)[4..], named(&wanted));
    assert_eq!(mixed.relative_degrees(), [2, 1]);
}

/// Each barrier reports the derivatives that stand at the places of its own inputs.
#[test]
fn each_barrier_reads_its_own() {
    let state = |own: usize, rest: [f64; 4]| {
        let mut x = vec![0.5; own];
        x.extend(rest);
        x
    };
    // Unicycle (4 states), point and velocity of the other (4), then what was seen.
    let mut built = filter(MIXED).build().unwrap();
    let mut u = [0.0; 2];
    let report = built.step(0.0, &state(8, [-3.5, 0.25, 2.0, 0.0]), &[0.0; 2], &mut u).unwrap();
    assert_eq!(report.barriers[1].h, -3.5);
    assert_eq!(report.barriers[1].row.normal[..2], [2.0, 0.0]);
    let mut built = filter(FILTER).build().unwrap();
    let report = built.step(0.0, &state(5, [7.5, 0.25, 2.0, 0.0]), &[0.0; 2], &mut u).unwrap();
    assert_eq!((report.barriers[0].h, report.barriers[1].h), (0.5, 7.5));
}

#[test]
fn the_canonical_form_is_the_same_configuration() {
    for text in [FILTER, MIXED] {
        let configuration = Configuration::parse(text).unwrap();
        let canonical = configuration.canonical().unwrap();
        assert!(canonical.contains("shape = \"external\"") && canonical.contains("sampling = \"pointwise\""));
        assert_eq!(Configuration::parse(&canonical).unwrap(), configuration, "{canonical}");
    }
}

#[test]
fn defects() {
    let external = "barrier goal is external, and what it is given cannot be predicted";
    let inputs: String = (0..33).map(|i| format!("{{ name = \"u{i}\" }},")).collect();
    for (from, to, wanted) in [
        ("relative_degree = 2\n", "", "barrier[0].relative_degree: missing, external needs it".to_owned()),
        ("degree = 2", "degree = 0", "barrier[0].relative_degree: is 0, must be 1 to 8".to_owned()),
        ("degree = 2", "degree = 9", "barrier[0].relative_degree: is 9, must be 1 to 8".to_owned()),
        ("degree = 2", "degree = 2\nradius = 1.0", "barrier[0].radius: external has none".to_owned()),
        (
            "degree = 2",
            "degree = 2\nexpression = \"1\"",
            "barrier[0].expression: external has none".to_owned(),
        ),
        (
            "degree = 2",
            "degree = 2\nshape = \"disc\"",
            "barrier[0].shape: is \"disc\", which needs states; this plant has none, so it is \"external\""
                .to_owned(),
        ),
        (
            "name = \"external_filter\"",
            "sampling = \"measured\"",
            format!("sampling: must be \"pointwise\": {external}"),
        ),
        (
            "name = \"external_filter\"",
            "actuation_delay = 0.01",
            format!("actuation_delay: is 0.01, must be 0: {external}"),
        ),
        (
            "name = \"u_y\"",
            "name = \"u_x\"",
            "plant.inputs[1].name: is \"u_x\", which is already the name of something else".to_owned(),
        ),
        (
            "inputs = [\n",
            &format!("inputs = [{inputs}\n"),
            "plant.inputs: has 35 entries, must have at most 32".to_owned(),
        ),
    ] {
        assert_eq!(refusal(FILTER, from, to), wanted, "{to}");
    }
    let unsaid = refusal(MIXED, "sampling = \"pointwise\"\n", "");
    assert_eq!(unsaid, format!("sampling: must be \"pointwise\": {}", external.replace("goal", "seen")));
    let disc = refusal(MIXED, "radius = 2.0", "radius = 2.0\nrelative_degree = 1");
    assert_eq!(disc, "barrier[0].relative_degree: disc has none");
    let plant = Configuration::parse("kind = \"plant\"\nplant.inputs = [{ name = \"w\" }]\n").unwrap_err();
    assert_eq!(plant.to_string(), "plant.states: has 0 entries, must have 1 to 64");
}
