//! `punctual reproduce`: its numbers, its files, and the guide that is made from them.

use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::workshop::Workshop;

fn table<'a>(report: &'a Value, key: &str) -> &'a Value {
    let tables = report["tables"].as_array().expect("a list");
    tables.iter().find(|table| table["key"] == key).unwrap_or_else(|| panic!("no table {key}"))
}

/// The cells under `head`, of the rows that hold all of `words`.
fn column<'a>(table: &'a Value, head: &str, words: &[&str]) -> Vec<&'a Value> {
    let heads = table["header"].as_array().expect("a list");
    let index =
        heads.iter().position(|h| h == head).unwrap_or_else(|| panic!("no column {head} in {heads:?}"));
    let rows = table["rows"].as_array().expect("a list").iter();
    let rows = rows.filter(|row| {
        words.iter().all(|word| row.as_array().expect("a row").iter().any(|cell| cell == word))
    });
    rows.map(|row| &row[index]).collect()
}

#[test]
fn the_study_in_a_few_runs() {
    let workshop = Workshop::new();
    let done = workshop.punctual(["reproduce", "--quick", "--untimed", "--json", "--out", "study"]);
    assert_eq!(done.stderr, "");
    let report: Value = serde_json::from_str(&done.success()).expect("JSON");
    let runs = report["options"]["runs"].as_f64().expect("a number");
    assert_eq!(report["kept"], true);

    // The paper's first table: 10.003, 10.087 and 10.256 s. Its method, whatever integrates it, is within the
    // 4 ms that the integrators differ by; ours is on time.
    let found = table(&report, "discretisation");
    for (vehicle, paper) in [("point mass", 10.003), ("unicycle", 10.087), ("bicycle", 10.256)] {
        assert_eq!(column(found, "paper (s)", &[vehicle])[0], paper);
        for head in ["repeated root, Euler (s)", "semi-implicit (s)", "RK4 (s)"] {
            let time = column(found, head, &[vehicle])[0].as_f64().expect("a time");
            assert!((time - paper).abs() < 4e-3, "{vehicle}, {head}: {time}");
        }
        assert!(column(found, "ours, RK4 (s)", &[vehicle])[0].as_f64().expect("a time") <= 10.0);
    }
    // The others on the same starts: ours keeps all of them in the setting we advise, one line per vehicle.
    let methods = table(&report, "methods");
    let ours = ["reference profile (ours)", "distance, damping"];
    assert_eq!(column(methods, "kept until 2T", &ours), [runs; 3]);
    assert_eq!(
        column(methods, "kept until 2T", &["constricting tube", "default", "distance, damping"]),
        [runs; 3]
    );
    // Without a deadline there is none to keep: a = 1 is not there by T.
    assert_eq!(column(methods, "on time", &["exponential CBF", "default", "distance, damping"]), [0.0; 3]);
    assert_eq!(column(methods, "on time", &["repeated root (the paper)", "quadratic, u_ref = 0"]), [0.0; 3]);
    assert_eq!(column(table(&report, "seeds"), "bicycle", &[]), vec![runs; 2]);

    // A file for each table and picture, and a page that asks nobody for anything.
    let folder = workshop.path("study");
    for table in report["tables"].as_array().expect("a list") {
        let text = fs::read_to_string(folder.join(format!("{}.csv", table["key"].as_str().expect("a name"))));
        let rows = table["rows"].as_array().expect("a list").len();
        assert_eq!(text.expect("a table").lines().count(), rows + 1);
    }
    let page = fs::read_to_string(folder.join("report.html")).expect("a page");
    let pictures = fs::read_dir(&folder).expect("a folder").filter(|entry| {
        entry.as_ref().is_ok_and(|entry| entry.path().extension().is_some_and(|end| end == "svg"))
    });
    let pictures = pictures.count();
    assert!(pictures >= 18, "{pictures} pictures");
    assert_eq!(page.matches("class=\"chart\"").count(), pictures);
    let addresses = page.split("://").skip(1).map(|rest| rest.split(['"', '/']).next().unwrap_or_default());
    for address in addresses {
        // The name of the SVG language, which nobody fetches.
        assert_eq!(address, "www.w3.org");
    }
    for loads in ["src=", "@import", "<link", "fetch("] {
        assert!(!page.contains(loads), "the page has {loads}");
    }
}

/// Numbers and the words between them: a number keeps its sign where it has one.
fn numbers(text: &str) -> (Vec<f64>, String) {
    let (mut numbers, mut words) = (Vec::new(), String::new());
    let mut rest = text;
    while let Some(from) = rest.find(|c: char| c.is_ascii_digit()) {
        let (before, number) = rest.split_at(from);
        let length = number.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(number.len());
        words.push_str(before);
        let (digits, after) = number.split_at(length);
        numbers.push(digits.trim_end_matches('.').parse().unwrap_or(f64::NAN));
        rest = after;
    }
    (numbers, words + rest)
}

/// What is checked in is what the program makes. Texts with their words exactly; numbers up to what another
/// platform's `sin` and `cos` change: a pixel in a picture (they are ten units of its file), a per cent or two
/// units of the last digit in a table. A curve may have other points where its extremes tie.
#[test]
fn the_guide_is_what_the_program_makes() {
    const PIXELS: f64 = 10.0;
    let workshop = Workshop::new();
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs");
    workshop.write("guide.md", fs::read(docs.join("guide.md")).expect("the guide"));
    workshop.punctual(["reproduce", "--guide", "."]).success();

    let (found, words) = numbers(&workshop.text("guide.md"));
    let (wanted, same) = numbers(&fs::read_to_string(docs.join("guide.md")).expect("the guide"));
    assert_eq!(words, same);
    for (found, wanted) in found.iter().zip(&wanted) {
        assert!((found - wanted).abs() <= 0.02 + 0.01 * wanted, "{found} for {wanted} in the guide");
    }

    let mut pictures = 0;
    for entry in fs::read_dir(docs.join("guide")).expect("pictures") {
        let path = entry.expect("an entry").path();
        let name = path.file_name().expect("a name").to_string_lossy().into_owned();
        let (wanted, found) =
            (fs::read_to_string(&path).expect("text"), workshop.text(&format!("guide/{name}")));
        pictures += 1;
        if wanted == found {
            continue;
        }
        let ((wanted, words), (found, same)) = (numbers(&wanted), numbers(&found));
        assert_eq!(words.len(), same.len(), "{name} has other curves");
        for (found, wanted) in found.iter().zip(&wanted) {
            assert!((found - wanted).abs() <= PIXELS, "{found} for {wanted} in {name}");
        }
    }
    assert!(pictures >= 9, "{pictures} pictures");
    // Nothing in the guide that is not there, and nothing there that is not in the guide.
    assert_eq!(workshop.text("guide.md").matches("](guide/").count(), pictures);
}

#[test]
fn a_guide_that_is_not_there_is_named() {
    let workshop = Workshop::new();
    let done = workshop.punctual(["reproduce", "--guide", "nowhere"]);
    done.fails_like(2, "cannot read nowhere/guide.md: ", &[]);
    workshop.write("guide.md", "<!-- table lunch -->\n<!-- end -->\n");
    workshop.punctual(["reproduce", "--guide", "."]).fails(2, "./guide.md: lunch: is no table of the guide");
}
