//! Pictures and numbers of docs/guide.md: made by the program, checked in, and compared by a test.

use std::path::Path;

use super::{Options, figures, tables, write};
use crate::error::Error;
use crate::plot;

/// What the guide's runs are: no random ones, and steps that a test has the time for.
const OPTIONS: Options = Options { finest: 1e-3, ..Options::QUICK };
/// The pictures of the guide.
const PICTURES: [&str; 9] = [
    "trajectories-unicycle",
    "depth-point_mass",
    "profile-point_mass",
    "inputs-unicycle-1",
    "inputs-unicycle-2",
    "phase-portrait",
    "lateness",
    "shortfall",
    "deadlines",
];

/// Makes the pictures in `folder`/guide anew, and the tables of `folder`/guide.md: each stands between a line
/// `<!-- table KEY -->` and a line `<!-- end -->`.
///
/// # Errors
///
/// No guide.md in the folder, or a table in it that there is not; a file that cannot be written.
pub fn update(folder: &Path) -> Result<(), Error> {
    let path = folder.join("guide.md");
    let text = std::fs::read_to_string(&path).map_err(|e| Error::io("read", &path, e))?;
    let (figures, steps) = figures::all(&OPTIONS)?;
    let tables = [tables::discretisation(&OPTIONS)?, steps];
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
        if let Some(key) = line.strip_prefix("<!-- table ").and_then(|rest| rest.strip_suffix(" -->")) {
            let table = tables.iter().find(|table| table.key == key);
            let missing = || Error::configuration(key, "is no table of the guide").in_file(&path);
            out += &format!("\n{}\n", table.ok_or_else(missing)?.markdown());
            inside = true;
        }
    }
    let pictures = folder.join("guide");
    std::fs::create_dir_all(&pictures).map_err(|e| Error::io("create", &pictures, e))?;
    for figure in figures.iter().filter(|figure| PICTURES.contains(&figure.key.as_str())) {
        let svg = plot::chart(&figure.chart, &figure.key)?;
        write(&pictures.join(format!("{}.svg", figure.key)), &svg)?;
    }
    write(&path, &out)
}
