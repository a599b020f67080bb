//! Connections between variables with different units: converted, refused or noted, and the same promise in
//! all units.

use crate::table::{Table, assert_same_bits};
use crate::workshop::{Done, Workshop};

const EXPERIMENT: &str = "[experiment]\nstop_time = 2.0\nstep_size = 0.05\n";

/// A cart that must be within half a metre of 1 m in 2 s. Its speed is recorded in degrees, for lack of
/// another angle.
const FILTER: &str = r#"
kind = "filter"
name = "f"
assurance = "off"
[plant]
states = [{ name = "p", unit = "m" }, { name = "v", unit = "m/s" }, { name = "w", unit = "rad" }]
inputs = [{ name = "a", unit = "m/s2", min = -3.0, max = 3.0 }]
derivatives = { p = "v", v = "a", w = "-0.5 * w" }
[[barrier]]
name = "goal"
expression = "0.5 - sqrt((p - 1)^2 + 0.01)"
unit = "m"
deadline = 1.5
"#;

/// The same cart in other units.
fn plant([p, v, w, a]: [&str; 4]) -> String {
    format!(
        "kind = \"plant\"\nname = \"p\"\n[plant]\nstates = [{{ name = \"p\", unit = \"{p}\" }}, {{ name = \"v\", unit = \"{v}\" }}, \
         {{ name = \"w\", unit = \"{w}\" }}]\ninputs = [{{ name = \"a\", unit = \"{a}\" }}]\n\
         derivatives = {{ p = \"v\", v = \"a\", w = \"-0.5 * w\" }}\n{EXPERIMENT}"
    )
}

const SI: [&str; 4] = ["m", "m/s", "rad", "m/s2"];
const CENTI: [&str; 4] = ["cm", "cm/s", "deg", "cm/s2"];

const BY_NAME: &str = "[[connect_by_name]]\ncomponents = [\"filter\", \"plant\"]\n";
const U_REF: &str = "\"u_ref.a\" = 0.0";

fn system(plant: &str, start: &str, order: &str, wiring: &str) -> String {
    format!(
        "[experiment]\nstop_time = 2.0\nstep = 0.05\norder = \"{order}\"\n\
         [[component]]\nname = \"filter\"\nfmu = \"filter.toml\"\nstart = {{ {U_REF} }}\n\
         [[component]]\nname = \"plant\"\nfmu = \"{plant}\"\nstart = {{ {start} }}\nfeedthrough = false\n{wiring}"
    )
}

fn workshop() -> Workshop {
    let workshop = Workshop::with_library();
    workshop.write("filter.toml", format!("{FILTER}{EXPERIMENT}"));
    workshop.write("si.toml", plant(SI));
    workshop.write("centi.toml", plant(CENTI));
    workshop
}

fn run(workshop: &Workshop, text: &str) -> Done {
    workshop.write("s.toml", text);
    workshop.punctual(["run", "s.toml", "--out", ".", "--require", "nothing"])
}

fn recorded(workshop: &Workshop, text: &str) -> (Table, String) {
    let done = run(workshop, text);
    // Without the notes on the verdict.
    let about = |line: &&str| ["units", "turn"].iter().any(|word| line.contains(word));
    let notes = done.stderr.lines().filter(about).map(|line| format!("{line}\n")).collect();
    done.success();
    (Table::parse(&workshop.text("s.csv")), notes)
}

/// A start of 0.2 m, 0.1 m/s and 30 degrees.
const START_SI: &str = "\"x0.p\" = 0.2, \"x0.v\" = 0.1, \"x0.w\" = 0.5235987755982988";
const START_CENTI: &str = "\"x0.p\" = 20.0, \"x0.v\" = 10.0, \"x0.w\" = 30.0";

const CONVERTED: &str = "note: units are converted: cm to m (times 0.01) of plant.x.p → filter.x.p; cm/s to m/s (times 0.01) of \
                         plant.x.v → filter.x.v; deg to rad (times 0.0174533) of plant.x.w → filter.x.w; m/s2 to cm/s2 (times \
                         100) of filter.u.a → plant.u.a\n";

#[test]
fn a_plant_in_other_units_is_the_same_plant() {
    let workshop = workshop();
    workshop.punctual(["build", "centi.toml", "-o", "centi.fmu"]).success();
    workshop.punctual(["build", "centi.toml", "--fmi", "3", "--scalars", "-o", "centi3.fmu"]).success();
    for order in ["gauss-seidel", "jacobi"] {
        let (si, notes) = recorded(&workshop, &system("si.toml", START_SI, order, BY_NAME));
        assert_eq!(notes, "");
        let (centi, notes) = recorded(&workshop, &system("centi.toml", START_CENTI, order, BY_NAME));
        assert_eq!(notes, CONVERTED, "{order}");
        // Each column is in the unit of its variable, from the first row on.
        for (name, factor) in [
            ("filter.goal.h", 1.0),
            ("filter.x.p", 1.0),
            ("filter.x.w", 1.0),
            ("filter.u.a", 1.0),
            ("plant.x.p", 100.0),
            ("plant.x.w", 180.0 / std::f64::consts::PI),
            ("plant.u.a", 100.0),
        ] {
            for (k, (a, b)) in si.column(name).iter().zip(centi.column(name)).enumerate() {
                // Up to round-off.
                assert!((a * factor - b).abs() <= 1e-6 * factor, "{order}, {name} in row {k}: {a}, {b}");
            }
        }
        for other in ["centi.fmu", "centi3.fmu"] {
            let (fmu, notes) = recorded(&workshop, &system(other, START_CENTI, order, BY_NAME));
            assert_eq!(notes, CONVERTED, "{other}");
            for name in centi.header() {
                assert_same_bits(name, &fmu.column(name), &centi.column(name));
            }
        }
    }
}

/// Wires the given connections with additional keys, and the rest by name.
fn wired(to: &str, more: &str) -> String {
    format!("[[connection]]\nfrom = \"plant.x.p\"\nto = \"{to}\"\n{more}\n{BY_NAME}")
}

#[test]
fn what_does_not_fit_is_refused_with_both_units() {
    let workshop = workshop();
    let why = "which measures another quantity; a [[connection]] of the two with a `factor`, in";
    for (units, what) in [
        (["kg", "m/s", "rad", "m/s2"], format!("plant.x.p is in kg, but filter.x.p in m, {why} m per kg")),
        (
            ["m", "bar", "rad", "m/s2"],
            format!("plant.x.v is in bar, but filter.x.v in m/s, {why} m/s per bar"),
        ),
        (["m", "m/s", "m", "m/s2"], format!("plant.x.w is in m, but filter.x.w in rad, {why} rad per m")),
        (["m", "m/s", "rad", "N"], format!("filter.u.a is in m/s2, but plant.u.a in N, {why} N per m/s2")),
    ] {
        workshop.write(
            "other.toml",
            plant(units)
                .replace("-0.5 * w", "0")
                .replace("\"v\", v", "\"0\", v")
                .replace("\"a\", w", "\"0\", w"),
        );
        run(&workshop, &system("other.toml", "", "jacobi", BY_NAME))
            .fails(2, &format!("s.toml: connect_by_name[0]: {what}, says how it is meant"));
        if what.starts_with("plant.x.p") {
            run(&workshop, &system("other.toml", "", "jacobi", &wired("filter.x.p", "")))
                .fails(2, &format!("s.toml: connection[0]: {what}, says how it is meant"));
            // The file says how to read the number.
            run(&workshop, &system("other.toml", "", "jacobi", &wired("filter.x.p", "factor = 2.0")))
                .success();
        }
    }
}

#[test]
fn a_factor_of_the_file_is_used_and_an_offset_comes_after_the_units() {
    let workshop = workshop();
    let first = |more: &str| {
        let text = system("centi.toml", START_CENTI, "gauss-seidel", &wired("filter.x.p", more));
        let (table, notes) = recorded(&workshop, &text);
        (table.column("filter.x.p")[0], notes)
    };
    let own = |more: &str| {
        let (value, notes) = first(more);
        (value, notes.contains("the factor of the file is used, although the units give another one: plant.x.p (cm) → filter.x.p (m) has"))
    };
    assert_eq!(own(""), (0.2, false));
    assert_eq!(own("offset = 0.5"), (0.7, false));
    assert_eq!(own("factor = 0.01"), (0.2, false));
    assert_eq!(own("factor = -0.01"), (-0.2, false));
    assert_eq!(own("factor = 1.0"), (20.0, true));
    assert_eq!(own("factor = -0.5"), (-10.0, true));
    assert!(first("factor = -0.5").1.contains("has -0.5, not 0.01\n"));
}

#[test]
fn units_that_cannot_be_compared_are_noted() {
    let workshop = workshop();
    workshop.write("other.toml", plant(["1", "m/s", "rad", "m/s2"]).replace("p = \"v\"", "p = \"0\""));
    let (table, notes) = recorded(&workshop, &system("other.toml", "\"x0.p\" = 0.2", "jacobi", BY_NAME));
    assert_eq!(table.column("filter.x.p")[0], 0.2);
    assert_eq!(
        notes,
        "note: units that cannot be compared, so numbers pass as they are: plant.x.p (1) → filter.x.p (m)\n"
    );
}

/// Gives p a unit in the model description, as another tool might.
fn declared(workshop: &Workshop, unit: &str, more: &str) {
    workshop.punctual(["build", "si.toml", "-o", "p.fmu"]).success();
    workshop.edit_fmu("p.fmu", |name, bytes| {
        let is_description = name == "modelDescription.xml";
        let text = || String::from_utf8(bytes.clone()).expect("UTF-8");
        let edited = || {
            let (before, after) = {
                let text = text();
                let (before, after) = text.split_once("<UnitDefinitions>").expect("units");
                (before.to_owned(), after.to_owned())
            };
            let at = after.find("name=\"x.p\"").expect("the output");
            let (head, tail) = after.split_at(at);
            let tail = tail.replacen("unit=\"m\"", &format!("unit=\"{unit}\" {more}"), 1);
            let base = if more.is_empty() { "" } else { "<BaseUnit m=\"1\" factor=\"2.5\" offset=\"7.0\"/>" };
            format!("{before}<UnitDefinitions><Unit name=\"{unit}\">{base}</Unit>{head}{tail}").into_bytes()
        };
        Some(if is_description { edited() } else { bytes.clone() })
    });
}

#[test]
fn units_of_other_tools_are_read_by_definition_or_by_name() {
    let workshop = workshop();
    let first = |unit: &str, more: &str| {
        declared(&workshop, unit, more);
        let (table, notes) = recorded(&workshop, &system("p.fmu", "\"x0.p\" = 4.0", "jacobi", BY_NAME));
        assert_eq!(table.column("plant.x.p")[0], 4.0);
        (table.column("filter.x.p")[0], notes)
    };
    assert_eq!(
        first("ft", ""),
        (
            4.0 * 0.3048,
            "note: units are converted: ft to m (times 0.3048) of plant.x.p → filter.x.p\n".to_owned()
        )
    );
    assert_eq!(first("metre", ""), (4.0, String::new()));
    // A definition takes precedence, and so does its offset if the value is not a difference.
    let defined = first("ell", "relativeQuantity=\"false\"");
    assert_eq!(
        defined,
        (
            4.0 * 2.5 + 7.0,
            "note: units are converted: ell to m (times 2.5 plus 7) of plant.x.p → filter.x.p\n".to_owned()
        )
    );
    run_refused(&workshop);
    let unknown = first("ell", "").1;
    assert_eq!(
        unknown,
        "note: units that cannot be compared, so numbers pass as they are: plant.x.p (ell) → filter.x.p (m)\n"
    );
}

/// A difference of a quantity with an offset does not connect to an absolute value.
fn run_refused(workshop: &Workshop) {
    declared(workshop, "ell", "relativeQuantity=\"true\"");
    let done = run(workshop, &system("p.fmu", "", "jacobi", BY_NAME));
    let wanted = "s.toml: connect_by_name[0]: plant.x.p is in ell, but filter.x.p in m, and only one of them is a difference";
    done.fails_like(2, wanted, &["(relativeQuantity)"]);
}

#[test]
fn packages_and_campaigns_convert_too() {
    let workshop = workshop();
    workshop.write("s.toml", system("centi.toml", START_CENTI, "jacobi", BY_NAME));
    let done = workshop.punctual(["build", "s.toml", "-o", "s.ssp"]);
    let told = "note: filter: u acts a step after its sample in Jacobi order; actuation_delay is set to 0.05 s, so the filter accounts \
                for it\n";
    assert_eq!(done.stderr, format!("{CONVERTED}{told}"));
    done.success();
    let entries =
        fmi_rs::zip::get_zip_contents(workshop.path("s.ssp").to_str().expect("UTF-8")).expect("an archive");
    assert!(entries.iter().any(|entry| entry == "SystemStructure.ssd"));
    let folder = workshop.path("ssp");
    fmi_rs::zip::extract_zip_archive(workshop.path("s.ssp"), &folder).expect("an archive");
    let ssd = workshop.text("ssp/SystemStructure.ssd");
    // SSP converts units unless told otherwise; the transformation is the whole conversion.
    assert_eq!(
        ssd.matches("suppressUnitConversion=\"true\"").count(),
        ssd.matches("<ssd:Connection ").count()
    );
    for factor in ["0.01", "0.017453292519943295", "100.0"] {
        assert!(
            ssd.contains(&format!("<ssc:LinearTransformation factor=\"{factor}\" offset=\"0.0\"/>")),
            "{factor}: {ssd}"
        );
    }

    let text = |system: &str, x0: [f64; 2]| {
        format!(
            "system = \"{system}\"\n[campaign]\nruns = 4\nseed = 1\n[vary.\"plant.x0.p\"]\ndistribution = \"uniform\"\nmin = {:?}\nmax = {:?}\n",
            x0[0], x0[1]
        )
    };
    workshop.write("si_s.toml", system("si.toml", START_SI, "jacobi", BY_NAME));
    workshop.write("c.toml", text("s.toml", [10.0, 30.0]));
    workshop.write("d.toml", text("si_s.toml", [0.1, 0.3]));
    let arrived = |name: &str| {
        let done = workshop.punctual(["campaign", name, "-o", "c.parquet"]);
        std::fs::remove_file(workshop.path("c.parquet")).expect("a file");
        (done.stderr.clone(), done.success())
    };
    let ((notes, centi), (none, si)) = (arrived("c.toml"), arrived("d.toml"));
    assert!(notes.contains(CONVERTED), "{notes}");
    assert!(!none.contains("units"), "{none}");
    let rate =
        |text: &str| text.lines().filter(|line| line.contains("goal")).map(str::to_owned).collect::<Vec<_>>();
    assert_eq!(rate(&centi), rate(&si));
}

#[test]
fn a_heading_of_more_than_a_turn_is_noted() {
    let workshop = workshop();
    let what = |value: &str| format!("{value} rad, more than a turn; is that meant in degrees?");
    let (_, notes) = recorded(&workshop, &system("si.toml", "\"x0.w\" = 90.0", "jacobi", BY_NAME));
    assert_eq!(notes, format!("note: plant.x0.w is {}\n", what("90")));
    let (_, notes) = recorded(&workshop, &system("centi.toml", "\"x0.w\" = 90.0", "jacobi", BY_NAME));
    assert_eq!(notes, CONVERTED);
    let (_, notes) = recorded(&workshop, &system("si.toml", "\"x0.w\" = -6.28", "jacobi", BY_NAME));
    assert_eq!(notes, "");

    let file = format!(
        "x0 = {{ p = 0.2, w = -45.0 }}\n{FILTER}[[barrier]]\nname = \"turn\"\nshape = \"at_most\"\nstate = \"w\"\nbound = 30.0\n{EXPERIMENT}"
    );
    let file = file.replace("-0.5 * w", "0.1 * a");
    workshop.write("one.toml", &file);
    let notes = [format!("x0.w is {}", what("-45")), format!("bound of turn is {}", what("30"))];
    let run = workshop.punctual(["run", "one.toml"]);
    let check = workshop.punctual(["check", "one.toml"]);
    let build = workshop.punctual(["build", "one.toml", "-o", "one.fmu"]);
    for note in &notes {
        assert_eq!(run.stderr.matches(note.as_str()).count(), 1, "{run:#?}");
        assert!(check.stdout.contains(&format!("warning: {note}\n")), "{check:#?}");
        assert!(build.stderr.contains(&format!("note: {note}\n")), "{build:#?}");
    }
}
