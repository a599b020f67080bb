//! Allowed dependencies: between crates according to their manifests, between modules according to the paths
//! in their code.

use std::collections::BTreeMap;

use punctual_fmu::configuration::read_toml;
use serde::Deserialize;
use serde::de::IgnoredAny;

use crate::lexer::Lexed;
use crate::sources::{SOURCES, TEXTS, crates};

#[derive(Deserialize)]
#[serde(rename_all = "kebab-case")]
struct Manifest {
    #[serde(default)]
    dependencies: BTreeMap<String, IgnoredAny>,
    #[serde(default)]
    dev_dependencies: BTreeMap<String, IgnoredAny>,
    #[serde(default)]
    build_dependencies: BTreeMap<String, IgnoredAny>,
}

fn manifest(path: &str) -> Manifest {
    let text = TEXTS.iter().find(|text| text.path == path).unwrap_or_else(|| panic!("no {path}"));
    read_toml(&text.text).unwrap_or_else(|e| panic!("{path}: {e}"))
}

#[test]
fn crates_depend_on_crates_below_them_only() {
    let edges = [
        // The core itself with a feature, and closed loops and baselines, for its tests.
        ("core/Cargo.toml", &["punctual-core", "punctual-reference"][..]),
        ("reference/Cargo.toml", &["punctual-core"]),
        ("modeldescription/Cargo.toml", &[]),
        ("models/Cargo.toml", &["punctual-core"]),
        ("embedded/Cargo.toml", &["punctual-core", "punctual-models"]),
        (
            "fmu/Cargo.toml",
            &[
                "punctual-core",
                "punctual-embedded",
                "punctual-modeldescription",
                "punctual-models",
                "punctual-reference",
            ],
        ),
        ("cosim/Cargo.toml", &["punctual-core", "punctual-fmu", "punctual-modeldescription"]),
        ("pictures/Cargo.toml", &["punctual-core", "punctual-cosim", "punctual-fmu"]),
        (
            "study/Cargo.toml",
            &["punctual-core", "punctual-cosim", "punctual-fmu", "punctual-pictures", "punctual-reference"],
        ),
        ("python/Cargo.toml", &["punctual-core", "punctual-fmu"]),
        (
            "Cargo.toml",
            &[
                "punctual-core",
                "punctual-cosim",
                "punctual-fmu",
                "punctual-modeldescription",
                "punctual-pictures",
                "punctual-reference",
                "punctual-study",
                // The files of the C library, for tests, and the models, for benchmarks.
                "punctual-embedded",
                "punctual-models",
            ],
        ),
    ];
    for (path, allowed) in edges {
        let manifest = manifest(path);
        let all = [&manifest.dependencies, &manifest.dev_dependencies, &manifest.build_dependencies];
        let mut ours: Vec<_> =
            all.iter().flat_map(|d| d.keys()).filter(|name| name.starts_with("punctual")).collect();
        ours.dedup();
        assert_eq!(ours, allowed, "{path}");
    }
}

#[test]
fn each_heavy_dependency_belongs_to_one_crate() {
    let owners = [
        // One crate searches for plans, the other for the smallest uncertainty.
        ("clarabel", &["core/Cargo.toml", "cosim/Cargo.toml"][..]),
        ("csv", &["cosim/Cargo.toml"]),
        ("quick-xml", &["modeldescription/Cargo.toml"]),
        // One crate writes archives, the other reads those of other tools.
        ("zip", &["modeldescription/Cargo.toml", "cosim/Cargo.toml"]),
        ("toml", &["fmu/Cargo.toml"]),
        ("winnow", &["models/Cargo.toml"]),
        ("clap", &["Cargo.toml"]),
        ("fmi-rs", &["cosim/Cargo.toml"]),
        ("object", &["cosim/Cargo.toml"]),
        ("pyo3", &["python/Cargo.toml"]),
        ("numpy", &["python/Cargo.toml"]),
        // One crate reads descriptions, one compares them and checks them against the schema, one shows their
        // notes.
        ("roxmltree", &["modeldescription/Cargo.toml", "cosim/Cargo.toml", "Cargo.toml"]),
    ];
    for path in [
        "Cargo.toml",
        "core/Cargo.toml",
        "reference/Cargo.toml",
        "modeldescription/Cargo.toml",
        "models/Cargo.toml",
        "embedded/Cargo.toml",
        "fmu/Cargo.toml",
        "cosim/Cargo.toml",
        "pictures/Cargo.toml",
        "study/Cargo.toml",
        "python/Cargo.toml",
    ] {
        let dependencies = manifest(path).dependencies;
        for (name, owners) in owners {
            assert_eq!(dependencies.contains_key(name), owners.contains(&path), "{name} in {path}");
        }
    }
}

/// This file is also compiled into plug-ins, whose paths it contains.
const FOR_PLUGINS: &str = "fmu/src/abi/plugin/punctual_model.rs";

/// A crate's modules: each line uses only the lines above it, and no other module of its own line.
struct Order {
    folder: &'static str,
    lines: Vec<Vec<String>>,
}

impl Order {
    fn rank(&self, module: &str) -> Option<usize> {
        self.lines.iter().position(|line| line.iter().any(|name| name == module))
    }

    fn check(&self) {
        let modules = |path: &str| path.starts_with(self.folder) && path != FOR_PLUGINS;
        for source in SOURCES.iter().filter(|s| modules(&s.path) && !s.is_test()) {
            let inside = source.path[self.folder.len()..].trim_end_matches(".rs");
            let (module, nested) =
                inside.split_once('/').map_or((inside, false), |(module, _)| (module, true));
            if module == "lib" || module == "main" {
                continue;
            }
            let rank =
                self.rank(module).unwrap_or_else(|| panic!("{} has no place in the order", source.path));
            for (line, used) in used_modules(&source.without_tests(), nested) {
                // Names with a capital and functions of the crate root are re-exports and constants.
                let Some(other) = self.rank(&used) else {
                    assert!(
                        used.starts_with(char::is_uppercase),
                        "{}:{line}: {used} has no place",
                        source.path
                    );
                    continue;
                };
                assert!(
                    used == module || other < rank,
                    "{}:{line}: {module} uses {used}, which is not above it",
                    source.path
                );
            }
        }
    }
}

/// The first names after `crate::` and, at the top level of the crate, after `super::`.
fn used_modules(code: &Lexed, nested: bool) -> Vec<(usize, String)> {
    let tokens = code.tokens();
    let mut used = Vec::new();
    for (i, &(line, token)) in tokens.iter().enumerate() {
        let path = tokens[i + 1..].iter().take(2).all(|t| t.1 == ":") && tokens.len() > i + 3;
        let starts = token == "crate" || (token == "super" && !nested);
        if !path || !starts {
            continue;
        }
        if tokens[i + 3].1 != "{" {
            used.push((line, tokens[i + 3].1.to_owned()));
            continue;
        }
        // A group: the names directly in it, after its brace or a comma.
        let mut depth = 0;
        for pair in tokens[i + 3..].windows(2) {
            match pair[0].1 {
                "{" => depth += 1,
                "}" => depth -= 1,
                _ => {}
            }
            if depth == 0 {
                break;
            }
            if depth == 1 && matches!(pair[0].1, "{" | ",") && pair[1].1 != "}" {
                used.push((pair[1].0, pair[1].1.to_owned()));
            }
        }
    }
    used
}

fn lines(lines: &[&[&str]]) -> Vec<Vec<String>> {
    lines.iter().map(|line| line.iter().map(|&name| name.to_owned()).collect()).collect()
}

/// The order of ARCHITECTURE.md and of the crate's own documentation.
#[test]
fn modules_of_the_core_use_modules_above_them() {
    let lines = lines(&[
        &["error", "real", "elementary"],
        &["scalar"],
        &["jet"],
        &["interval"],
        &["dynamics"],
        &["barrier"],
        &["lie"],
        &["convergence", "qp"],
        &["reach"],
        &["plan"],
        &["follower"],
        &["filter"],
        &["barriers", "plants"],
        &["judge"],
    ]);
    Order { folder: "core/src/", lines }.check();
}

/// The constraint sees derivatives as numbers, never a model; the quadratic program knows no barrier.
#[test]
fn constraints_and_programs_know_no_model() {
    for source in SOURCES.iter().filter(|s| !s.is_test()) {
        if ["core/src/convergence/", "core/src/qp/"].iter().any(|folder| source.path.starts_with(folder)) {
            for (line, used) in used_modules(&source.without_tests(), true) {
                let allowed = ["error", "elementary", "convergence", "qp"].contains(&&*used)
                    || used.starts_with("MAX_");
                assert!(allowed, "{}:{line}: uses {used}", source.path);
            }
        }
    }
}

/// The order of the table in fmu/src/lib.rs.
#[test]
fn modules_of_the_fmu_use_modules_above_them() {
    let documented = documented("fmu/src/lib.rs", |line| {
        let name = line.strip_prefix("//! | [`").or_else(|| line.strip_prefix("//! | `"))?;
        Some(name.split('`').next()?.to_owned())
    });
    Order { folder: "fmu/src/", lines: documented }.check();
}

/// The order of the table in models/src/lib.rs.
#[test]
fn modules_of_the_models_use_modules_above_them() {
    let documented = documented("models/src/lib.rs", |line| {
        Some(line.strip_prefix("//! | `")?.split('`').next()?.to_owned())
    });
    Order { folder: "models/src/", lines: documented }.check();
}

/// The order of the table in embedded/src/lib.rs.
#[test]
fn modules_of_the_c_library_use_modules_above_them() {
    let documented = documented("embedded/src/lib.rs", |line| {
        Some(line.strip_prefix("//! | `")?.split('`').next()?.to_owned())
    });
    Order { folder: "embedded/src/", lines: documented }.check();
}

/// The order of the table in python/src/lib.rs.
#[test]
fn modules_of_the_python_module_use_modules_above_them() {
    let documented = documented("python/src/lib.rs", |line| {
        Some(line.strip_prefix("//! | `")?.split('`').next()?.to_owned())
    });
    Order { folder: "python/src/", lines: documented }.check();
}

/// The orders of the lists in src/lib.rs and in those of the crates below the command line.
#[test]
fn modules_of_the_command_line_use_modules_above_them() {
    for folder in ["src/", "cosim/src/", "pictures/src/", "study/src/"] {
        let mut inside = false;
        let documented = documented(&format!("{folder}lib.rs"), |line| {
            let fence = line.starts_with("//! ```");
            inside ^= fence;
            let name = line.strip_prefix("//! ")?.split(' ').next()?;
            (inside && !fence).then(|| name.to_owned())
        });
        Order { folder, lines: documented }.check();
    }
}

/// The modules listed in a crate's documentation, one per line; the list must be complete and contain no
/// others.
fn documented(path: &str, module: impl FnMut(&str) -> Option<String>) -> Vec<Vec<String>> {
    let root = TEXTS.iter().find(|text| text.path == path).unwrap_or_else(|| panic!("no {path}"));
    let listed: Vec<String> = root.text.lines().filter_map(module).collect();
    let declared = |line: &str| {
        let name = line.strip_prefix("pub mod ").or_else(|| line.strip_prefix("mod "))?;
        Some(name.trim_end_matches(';').to_owned())
    };
    let mut declared: Vec<String> = root.text.lines().filter_map(declared).collect();
    let mut sorted = listed.clone();
    sorted.sort();
    declared.sort();
    assert_eq!(sorted, declared, "{path}: what is documented, and what there is");
    listed.into_iter().map(|name| vec![name]).collect()
}

#[test]
fn each_dependency_is_named_in_one_place() {
    let owners = [
        (&["clarabel", ":", ":"][..], &["core/src/plan/search.rs", "cosim/src/identification/sizes.rs"][..]),
        (&["csv", ":", ":"], &["cosim/src/recording/reader.rs"]),
        (&["quick_xml", ":", ":"], &["modeldescription/src/"]),
        (&["zip", ":", ":"], &["modeldescription/src/", "cosim/src/host/archive.rs"]),
        (&["toml", ":", ":"], &["fmu/src/configuration/"]),
        (&["winnow", ":", ":"], &["models/src/syntax.rs"]),
        (&["clap", ":", ":"], &["src/"]),
        (&["fmi_rs", ":", ":"], &["cosim/src/host/description/fmi2.rs"]),
        (&["libloading", ":", ":"], &["cosim/src/host/", "fmu/src/abi/"]),
        (&["object", ":", ":"], &["cosim/src/validate/symbols.rs"]),
        (
            &["roxmltree", ":", ":"],
            &[
                "modeldescription/src/read.rs",
                "modeldescription/src/notes.rs",
                "modeldescription/src/fmi3/",
                "cosim/src/validate/",
                "cosim/src/host/description/",
                "cosim/src/package/difference.rs",
                "src/command/inspect",
            ],
        ),
        (&["svg", ":", ":"], &["pictures/src/plot/canvas.rs"]),
        (&["indicatif", ":", ":"], &["src/output.rs"]),
        (&["parquet", ":", ":"], &["cosim/src/campaign/table.rs"]),
        (&["flatbuffers", ":", ":"], &["cosim/src/campaign/arrow.rs"]),
        (&["base64", ":", ":"], &["cosim/src/campaign/arrow.rs"]),
        (&["rand_chacha", ":", ":"], &["cosim/src/campaign/sampling.rs"]),
        (
            &["rayon", ":", ":"],
            &[
                "cosim/src/campaign/runner.rs",
                "cosim/src/campaign/splitting.rs",
                "src/command/map.rs",
                "study/src/",
                "python/src/pool.rs",
                "python/src/batch.rs",
            ],
        ),
        (&["pyo3", ":", ":"], &["python/src/"]),
        (
            &["numpy", ":", ":"],
            &["python/src/arrays.rs", "python/src/batch.rs", "python/src/plan.rs", "python/src/report.rs"],
        ),
        (&["statrs", ":", ":"], &["cosim/src/campaign/distribution.rs"]),
        (&["ctrlc", ":", ":"], &["src/command/mod.rs"]),
        (&["console", ":", ":"], &["src/output.rs", "pictures/src/columns.rs"]),
        (&["clap_complete", ":", ":"], &["src/command/shell.rs"]),
        (&["clap_mangen", ":", ":"], &["src/command/shell.rs"]),
    ];
    for (tokens, owners) in owners {
        let mut named = false;
        for source in crates() {
            let lines = source.lexed.lines_with(tokens);
            let place = owners.iter().any(|owner| source.path.starts_with(owner));
            named |= place && !lines.is_empty();
            let test = tokens[0] == "libloading" && source.is_test();
            assert!(place || test || lines.is_empty(), "{}: {lines:?} name {}", source.path, tokens[0]);
        }
        assert!(named, "{} is not named in {owners:?}: the rule is out of date", tokens[0]);
    }
}

#[test]
fn used_modules_are_found() {
    let code = "use crate::a::{B, c::d};\nuse crate::{e, f::{G, h}, I};\nlet x = crate::j::k(super::l());\n";
    let lexed = crate::lexer::lex(code);
    let names = |nested| used_modules(&lexed, nested).into_iter().map(|u| u.1).collect::<Vec<_>>();
    assert_eq!(names(true), ["a", "e", "f", "I", "j"]);
    assert_eq!(names(false), ["a", "e", "f", "I", "j", "l"]);
}
