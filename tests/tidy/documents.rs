//! Examples parse, and the documents describe what the program does.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;

use punctual::codes::{CODES, FOUND_BY};
use punctual_cosim::coupling::System;
use punctual_fmu::configuration::Configuration;
use punctual_fmu::product::Product;
use punctual_modeldescription::Causality;

use crate::sources::{TEXTS, root};

#[test]
fn every_example_is_a_valid_configuration_or_system() {
    let mut seen = 0;
    for text in TEXTS.iter().filter(|t| t.path.starts_with("examples/") && t.path.ends_with(".toml")) {
        seen += 1;
        // Only keys before the first table count, since the plots of a system have a kind too.
        let mut top = text.text.lines().take_while(|line| !line.starts_with('['));
        let has_kind = top.any(|line| line.starts_with("kind"));
        // A plug-in must be compiled first, which tests/cli does.
        if has_kind && text.text.contains("\nplugin = ") {
            continue;
        }
        if has_kind {
            Configuration::parse(&text.text).unwrap_or_else(|e| panic!("{}: {e}", text.path));
            continue;
        }
        if text.text.contains("\n[campaign]\n") {
            // The file needs the FMUs; tests/cli/campaigns.rs checks its values.
            let system =
                text.text.lines().find_map(|line| line.strip_prefix("system = \"")?.strip_suffix('"'));
            let system = Path::new(&text.path).with_file_name(system.expect("a system file"));
            assert!(TEXTS.iter().any(|t| Path::new(&t.path) == system), "{}: no {system:?}", text.path);
            continue;
        }
        let system = System::parse(&text.text).unwrap_or_else(|e| panic!("{}: {e}", text.path));
        // Its FMUs are built from the configurations, or classes, of the same name in its folder.
        let folder = Path::new(&text.path).parent().expect("a folder");
        for component in system.components() {
            let sources = ["toml", "py"].map(|end| folder.join(&component.fmu).with_extension(end));
            let known = TEXTS.iter().any(|t| sources.iter().any(|source| Path::new(&t.path) == source));
            assert!(known, "{}: none of {sources:?}", text.path);
        }
    }
    assert!(seen >= 3, "{seen} examples found");
}

fn text(path: &str) -> &'static str {
    &TEXTS.iter().find(|t| t.path == path).unwrap_or_else(|| panic!("no {path}")).text
}

/// The code blocks of a language in a Markdown text.
fn blocks<'a>(markdown: &'a str, language: &str) -> Vec<&'a str> {
    let open = format!("```{language}\n");
    let parts = markdown.split(open.as_str()).skip(1);
    parts.filter_map(|part| part.split("\n```").next()).collect()
}

/// The quoted texts of the row of a Markdown table that begins with `| head |`.
fn quoted_in_row(markdown: &str, head: &str) -> BTreeSet<String> {
    let row = markdown.lines().find_map(|line| line.strip_prefix(&format!("| {head} |")));
    let row = row.unwrap_or_else(|| panic!("no row {head}"));
    row.split('`').skip(1).step_by(2).map(str::to_owned).collect()
}

#[test]
fn the_configurations_of_the_readme_are_valid() {
    let blocks = blocks(text("README.md"), "toml");
    assert!(!blocks.is_empty(), "README.md shows no configuration");
    for block in blocks {
        Configuration::parse(block).unwrap_or_else(|e| panic!("README.md: {e} in\n{block}"));
    }
}

fn filter() -> Product {
    let configuration = "kind = \"filter\"\nplant = { model = \"bicycle\" }\n[[barrier]]\nname = \"goal\"\n\
                         centre = [1, 2]\nradius = 1\ndeadline = 1\n";
    Configuration::parse(configuration).and_then(Product::new).expect("a filter")
}

/// The variables of a filter, with placeholders for states and inputs, and without the names of barriers.
fn variables(causality: Causality) -> BTreeSet<String> {
    let product = filter();
    let of_kind = product.variables.iter().filter(|v| v.causality == causality);
    let name = |name: &str| match name.split_once('.') {
        Some(("x", _)) => "x.<state>".to_owned(),
        Some(("goal", part)) => part.to_owned(),
        Some((group, _)) => format!("{group}.<input>"),
        None => name.to_owned(),
    };
    of_kind.map(|v| name(&v.name)).collect()
}

#[test]
fn the_variables_of_the_filter_are_listed() {
    let document = text("docs/fmu.md");
    for (head, causality) in
        [("inputs", Causality::Input), ("outputs", Causality::Output), ("parameters", Causality::Parameter)]
    {
        assert_eq!(quoted_in_row(document, head), variables(causality), "docs/fmu.md, {head}");
    }
    let items = filter().model_description().types.into_iter().flat_map(|e| e.items);
    let rows: Vec<_> = items.map(|i| format!("| {} `{}` | {} |", i.value, i.name, i.description)).collect();
    assert!(rows.len() > 10, "statuses and phases: {rows:?}");
    for row in rows {
        assert!(document.contains(&row), "docs/fmu.md has no row {row}");
    }
}

/// The keys of each table of a Markdown text that begins with `| key |`.
fn tables_of_keys(markdown: &str) -> Vec<BTreeSet<String>> {
    let keys = |row: &str| {
        let first = row.split('|').nth(1).unwrap_or_default();
        first.split('`').skip(1).step_by(2).map(str::to_owned).collect::<Vec<_>>()
    };
    let rows =
        |table: &str| table.lines().skip(2).take_while(|l| l.starts_with("| ")).flat_map(keys).collect();
    markdown.split("\n| key |").skip(1).map(rows).collect()
}

/// Beginnings of files up to an unknown key, in the order of the tables of docs/configuration.md.
const PLACES: [&str; 24] = [
    "kind = \"filter\"",
    "kind = \"filter\"\n[uncertainty]",
    "kind = \"filter\"\n[uncertainty.inputs.a]",
    "kind = \"filter\"\n[follower]",
    "kind = \"filter\"\n[[barrier]]",
    "kind = \"filter\"\n[[agent]]",
    "kind = \"filter\"\n[plant]",
    "kind = \"filter\"\n[[plant.states]]",
    "kind = \"filter\"\n[[plant.parameters]]",
    "kind = \"filter\"\n[integrator]",
    "kind = \"plant\"",
    "kind = \"plant\"\n[[output]]",
    "kind = \"plant\"\n[integration]",
    "kind = \"plant\"\n[disturbance]",
    "kind = \"controller\"",
    "kind = \"filter\"\n[experiment]",
    "",
    "[experiment]",
    "[[component]]",
    "[[connection]]",
    "[[connect_by_name]]",
    "[record]",
    "[[plot]]\nkind = \"path\"",
    "[[plot]]\nkind = \"time\"",
];

#[test]
fn every_key_of_every_file_is_listed() {
    let listed = tables_of_keys(text("docs/configuration.md"));
    assert_eq!(listed.len(), PLACES.len(), "the tables of docs/configuration.md");
    for (place, listed) in PLACES.iter().zip(listed) {
        let file = format!("{place}\nno_such_key = 1\n");
        let refused = match place.starts_with("kind") {
            true => Configuration::parse(&file).map(|_| ()).map_err(|e| e.to_string()),
            false => System::parse(&file).map(|_| ()).map_err(|e| e.to_string()),
        };
        let message = refused.expect_err("an unknown key");
        let (_, known) = message.split_once("the keys are ").unwrap_or_else(|| panic!("{place}: {message}"));
        let known = known.split(" (line").next().unwrap_or_default();
        let known: BTreeSet<_> = known.split(", ").map(str::to_owned).collect();
        assert_eq!(listed, known, "docs/configuration.md, keys after {place:?}");
    }
}

#[test]
fn links_between_documents_lead_somewhere() {
    for document in TEXTS.iter().filter(|t| t.path.ends_with(".md")) {
        let folder = root().join(&document.path).with_file_name("");
        for part in document.text.split("](").skip(1) {
            let target = part.split([')', '#']).next().unwrap_or_default();
            let elsewhere = target.is_empty() || target.contains("://");
            assert!(elsewhere || folder.join(target).exists(), "{}: no {target}", document.path);
        }
    }
}

#[test]
fn every_document_is_a_chapter_of_the_book() {
    let summary = text("docs/SUMMARY.md");
    for document in TEXTS.iter().filter(|t| t.path.starts_with("docs/") && t.path.ends_with(".md")) {
        let name = document.path.rsplit('/').next().unwrap_or_default();
        assert!(
            name == "SUMMARY.md" || summary.contains(&format!("]({name})")),
            "docs/SUMMARY.md: no {name}"
        );
    }
}

/// The subcommands that `punctual --help` shows.
fn subcommands() -> BTreeSet<String> {
    let help =
        Command::new(env!("CARGO_BIN_EXE_punctual")).arg("--help").output().expect("the program starts");
    let help = String::from_utf8(help.stdout).expect("UTF-8");
    let listed =
        help.lines().skip_while(|line| *line != "Commands:").skip(1).take_while(|line| !line.is_empty());
    let names = listed.filter(|line| line.starts_with("  ") && !line.starts_with("   "));
    let names = names.filter_map(|line| line.split_whitespace().next()).filter(|name| *name != "help");
    names.map(str::to_owned).collect()
}

/// The commands in the rows `| `punctual NAME …` | … |` of a Markdown table.
fn listed(markdown: &str) -> Vec<String> {
    let rows = markdown.lines().filter_map(|line| line.trim().strip_prefix("| `punctual "));
    rows.map(|row| row.split(|c: char| !c.is_ascii_lowercase()).next().unwrap_or_default().to_owned())
        .collect()
}

/// `tests/run` compiles the crate tests/no_std.
#[test]
fn the_loop_without_std_is_one_that_compiles() {
    let code =
        |line: &str| line.split("//").next().unwrap_or_default().trim().trim_start_matches("pub ").to_owned();
    let compiled: Vec<_> = text("tests/no_std/src/lib.rs").lines().map(code).collect();
    let blocks = blocks(text("docs/rust.md"), "rust");
    let embedded = blocks.iter().find(|block| block.contains("timer's interrupt")).expect("a loop");
    for line in embedded.lines().map(code).filter(|line| !line.is_empty()) {
        assert!(compiled.contains(&line), "not in tests/no_std: {line}");
    }
}

#[test]
fn the_readme_has_the_two_commands_and_is_short() {
    let readme = text("README.md");
    assert!(readme.lines().count() <= 120, "README.md has {} lines", readme.lines().count());
    for command in ["cargo run --release -- demo", "tests/run"] {
        assert!(readme.contains(command), "README.md does not say {command:?}");
    }
}

#[test]
fn every_subcommand_is_documented() {
    let listed = listed(text("docs/commands.md"));
    let unique: BTreeSet<_> = listed.iter().cloned().collect();
    assert_eq!(unique.len(), listed.len(), "docs/commands.md lists a command twice: {listed:?}");
    assert_eq!(unique, subcommands(), "the commands of docs/commands.md, and those of the program");
}

#[test]
fn the_exit_codes_are_listed() {
    let document = text("docs/commands.md");
    let (_, section) = document.split_once("\n## Exit codes\n").expect("a section on exit codes");
    let row = |(head, means): (String, &str)| format!("| {head} | {means} |\n");
    let all: String = CODES.iter().map(|(code, means)| row((code.to_string(), means))).collect();
    assert!(
        section.contains(&format!("| code | means |\n|---|---|\n{all}\n")),
        "docs/commands.md: not\n{all}"
    );
    let found = FOUND_BY.iter().filter(|(_, means)| !means.is_empty());
    let found: String = found.map(|(name, means)| row((format!("`{name}`"), means))).collect();
    assert!(section.contains(&format!("|---|---|\n{found}\n")), "docs/commands.md: not\n{found}");
    let known: BTreeSet<_> = FOUND_BY.iter().map(|(name, _)| (*name).to_owned()).collect();
    assert_eq!(known, subcommands(), "the commands of the table, and those of the program");
}

#[test]
fn commands_are_found_in_help_and_table() {
    assert!(subcommands().contains("build"), "{:?}", subcommands());
    let table = "| command | does |\n|---|---|\n| `punctual run SYSTEM [--out DIR]` | couples |\n| `punctual demo` | x |\n";
    assert_eq!(listed(table), ["run", "demo"]);
}

/// The last column of its tables names files and their tests: "`file`: `test`, `test`; `file`: `test`".
#[test]
fn every_trap_of_fmi_has_a_test_that_exists() {
    let mut rows = 0;
    for row in text("docs/fmi-traps.md").lines().filter(|line| line.starts_with("| ")).skip(1) {
        let tests = row.trim_end_matches(" |").rsplit(" | ").next().unwrap_or_default();
        if tests == "tests" {
            continue;
        }
        rows += 1;
        for group in tests.split("; ") {
            let names: Vec<&str> = group.split('`').skip(1).step_by(2).collect();
            let [file, names @ ..] = &names[..] else { panic!("no file in {row}") };
            assert!(!names.is_empty(), "no test in {row}");
            for name in names {
                let found = ["fn ", "def "].iter().any(|head| text(file).contains(&format!("{head}{name}(")));
                assert!(found, "docs/fmi-traps.md: no {name} in {file}");
            }
        }
    }
    assert!(rows > 40, "{rows} traps");
}
