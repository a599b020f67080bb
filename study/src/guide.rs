//! Pictures and numbers of docs/guide.md: made by the program, checked in, and compared by a test.

use std::path::Path;

use punctual_cosim::error::Error;
use punctual_cosim::whole;
use punctual_pictures::plot;

use super::{Options, Watch, always, figures, tables};

/// Options of the guide's runs: steps that a test has the time for, and random starts for the one table that has some.
const OPTIONS: Options = Options { runs: 20, finest: 1e-3, ..Options::QUICK };
/// The tables of the guide.
const TABLES: [&str; 3] = ["discretisation", "step_size", "always"];
/// The pictures of the guide.
const PICTURES: [&str; 11] = [
    "trajectories-unicycle",
    "depth-point_mass",
    "profile-point_mass",
    "inputs-unicycle-1",
    "inputs-unicycle-2",
    "phase-portrait",
    "lateness",
    "shortfall",
    "deadlines",
    "always-reach",
    "always-stay",
];

/// Makes the pictures in `folder`/guide again, and the tables of `folder`/guide.md. Each table is between a
/// line `<!-- table KEY -->` and a line `<!-- end -->`.
///
/// # Errors
///
/// No guide.md in the folder, or a table in it that does not exist; a file that cannot be written.
pub fn update(folder: &Path) -> Result<(), Error> {
    let path = folder.join("guide.md");
    let text = std::fs::read_to_string(&path).map_err(|e| Error::io("read", &path, e))?;
    let key = |line: &str| {
        let rest = line.strip_prefix("<!-- table ")?.strip_suffix(" -->")?;
        Some(rest.to_owned())
    };
    if let Some(key) = text.lines().filter_map(key).find(|key| !TABLES.contains(&key.as_str())) {
        let [others @ .., last] = TABLES;
        let message = format!("is no table of the guide, must be {} or {last}", others.join(", "));
        return Err(Error::configuration(key, message).in_file(&path));
    }
    let (figures, steps) = figures::all(&OPTIONS)?;
    let (always, _) = always::table(&OPTIONS, &Watch::new(always::loops(&OPTIONS), &|_| ()))?;
    let tables = [tables::discretisation(&OPTIONS)?, steps, always::beside(&always)];
    let mut out = String::new();
    let mut inside = false;
    for line in text.lines() {
        if line == "<!-- end -->" {
            inside = false;
        }
        if !inside {
            out += line;
            out.push('\n');
        }
        if let Some(table) = key(line).and_then(|key| tables.iter().find(|table| table.key == key)) {
            out += &format!("\n{}\n", table.markdown());
            inside = true;
        }
    }
    let pictures = folder.join("guide");
    std::fs::create_dir_all(&pictures).map_err(|e| Error::io("create", &pictures, e))?;
    for figure in figures.iter().filter(|figure| PICTURES.contains(&figure.key.as_str())) {
        let svg = plot::chart(&figure.chart, &figure.key)?;
        whole::write(&pictures.join(format!("{}.svg", figure.key)), &svg)?;
    }
    whole::write(&path, &out)
}
