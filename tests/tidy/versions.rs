//! There is one version, that of the workspace, wherever a version of ours occurs.

use std::collections::BTreeMap;

use punctual_fmu::configuration::read_toml;
use serde::Deserialize;

use crate::sources::TEXTS;

/// The version of the workspace, which this test gets from its own manifest.
const VERSION: &str = env!("CARGO_PKG_VERSION");

#[derive(Deserialize)]
#[serde(untagged)]
enum Dependency {
    /// That of another package.
    Version(String),
    Table {
        path: Option<String>,
        version: Option<String>,
    },
}

#[derive(Deserialize)]
struct Package {
    version: String,
}

#[derive(Deserialize)]
struct Workspace {
    package: Package,
    dependencies: BTreeMap<String, Dependency>,
}

#[derive(Deserialize)]
struct Root {
    workspace: Workspace,
}

fn text(path: &str) -> &'static str {
    &TEXTS.iter().find(|t| t.path == path).unwrap_or_else(|| panic!("no {path}")).text
}

/// Publishing a crate requires the version of its dependencies, so the table repeats it.
#[test]
fn the_workspace_has_one_version() {
    let root: Root = read_toml(text("Cargo.toml")).expect("a manifest");
    assert_eq!(root.workspace.package.version, VERSION);
    let mut ours = 0;
    for (name, dependency) in root.workspace.dependencies {
        let (path, version) = match dependency {
            Dependency::Version(version) => (None, Some(version)),
            Dependency::Table { path, version } => (path, version),
        };
        if path.is_some() {
            ours += 1;
            assert_eq!(version.as_deref(), Some(VERSION), "Cargo.toml, [workspace.dependencies], {name}");
        }
    }
    assert!(ours >= 4, "{ours} crates of the workspace in its table");
}

/// A manifest either inherits the version of the workspace, or belongs to a tool of the tests.
#[test]
fn no_other_manifest_has_a_version_of_its_own() {
    let manifests = TEXTS.iter().filter(|t| {
        let name = t.path.rsplit('/').next().unwrap_or_default();
        ["Cargo.toml", "pyproject.toml"].contains(&name) && !t.path.starts_with("tests/")
    });
    let mut seen = 0;
    for manifest in manifests {
        seen += 1;
        let package =
            manifest.text.lines().skip_while(|line| !["[package]", "[project]"].contains(line)).skip(1);
        let mut package = package.take_while(|line| !line.starts_with('['));
        let given = package.any(|line| line.starts_with("version = "));
        assert!(
            !given,
            "{} has a version of its own; must be version.workspace = true, or dynamic",
            manifest.path
        );
    }
    assert!(seen >= 5, "{seen} manifests");
}

#[test]
fn the_lock_file_has_this_version() {
    let packages = text("Cargo.lock").split("[[package]]\n").skip(1);
    let mut ours = 0;
    for package in packages.filter(|package| !package.contains("\nsource = ")) {
        ours += 1;
        assert!(package.contains(&format!("\nversion = \"{VERSION}\"\n")), "Cargo.lock: {package}");
    }
    assert!(ours >= 5, "{ours} packages of the workspace");
}

#[test]
fn what_is_cited_has_this_version() {
    let cited = text("CITATION.cff").lines().filter_map(|line| line.strip_prefix("version: "));
    assert_eq!(cited.collect::<Vec<_>>(), [VERSION], "CITATION.cff");
    // With the date of its release, if it has one.
    let dated = text("CITATION.cff").lines().find_map(|line| line.strip_prefix("date-released: "));
    let newest = text("CHANGELOG.md").lines().find_map(|line| line.strip_prefix("## ")).expect("a version");
    let date = newest.split_once("] - ").map(|(_, date)| date).filter(|date| is_date(date));
    assert_eq!(dated.map(|date| date.trim_matches(['"', '\''])), date, "CITATION.cff: date-released");
}

/// `## [VERSION] - DATE`, or `unreleased` in place of the date.
#[test]
fn the_changelog_begins_with_this_version() {
    let headings: Vec<_> = text("CHANGELOG.md").lines().filter_map(|line| line.strip_prefix("## ")).collect();
    let newest = headings.first().expect("a version");
    let date = newest.strip_prefix(&format!("[{VERSION}] - "));
    let date = date.unwrap_or_else(|| panic!("CHANGELOG.md begins with {newest:?}, must be [{VERSION}]"));
    assert!(date == "unreleased" || is_date(date), "CHANGELOG.md: {date:?} is no date");
    for older in &headings[1..] {
        let dated = older.split_once("] - ").is_some_and(|(_, date)| is_date(date));
        assert!(dated, "CHANGELOG.md: {older:?}; only the newest version may be unreleased");
    }
}

/// `YYYY-MM-DD`.
fn is_date(text: &str) -> bool {
    let digits = |part: &str, count: usize| part.len() == count && part.bytes().all(|b| b.is_ascii_digit());
    let parts: Vec<_> = text.split('-').collect();
    matches!(parts[..], [year, month, day] if digits(year, 4) && digits(month, 2) && digits(day, 2))
}

#[test]
fn dates_are_told_from_other_words() {
    assert!(is_date("2026-01-31"));
    assert!(!["", "unreleased", "2026-1-31", "31-01-2026", "2026-01-31-"].into_iter().any(is_date));
}
