//! `include/punctual.h` is what cbindgen makes of `src/abi.rs`. With `PUNCTUAL_UPDATE_GOLDEN=1` it is written.

use std::fmt::Write;

use cbindgen::{Builder, Config, DocumentationStyle, EnumConfig, Language, RenameRule, Style};
use punctual_core::filter::{Phase, Status};
use punctual_core::follower::Following;

const ABOUT: &str = "\
/* Punctual: fixed-time safety filters, without an operating system.

   docs/embedded.md of the project has a loop to begin with. `punctual build car.toml --embedded car.bin` writes the file of a
   filter. Rules: memory comes from the caller, aligned to 8 bytes; only punctual_load allocates, and only in that memory; nothing
   is global but a lock while a filter is loaded. One filter is used by one context at a time; two filters side by side do not
   know of each other. This file is made by cbindgen. */";

/// An enumeration of numbers that have a name and a meaning.
fn enumeration<'a>(name: &str, about: &str, values: impl Iterator<Item = (i32, &'a str, &'a str)>) -> String {
    let mut text = format!("/* {about} */\nenum punctual_{name} {{\n");
    for (number, word, meaning) in values {
        let word = word.to_uppercase();
        writeln!(text, "  /* {meaning} */\n  PUNCTUAL_{word} = {number},").expect("a string takes all");
    }
    text + "};\n"
}

fn made() -> String {
    let status = enumeration(
        "status",
        "What a step did; numbered as in the FMU.",
        Status::ALL.into_iter().map(|s| (s as i32, s.name(), s.meaning())),
    );
    let phase = enumeration(
        "phase",
        "Where the promise of a barrier is; numbered as in the FMU.",
        Phase::ALL.into_iter().map(|p| (p as i32, p.name(), p.meaning())),
    );
    let following = Following::ALL.map(|f| (f as i32, format!("plan_{}", f.name()), f.meaning()));
    let plan = enumeration(
        "plan",
        "Whether the plan of the file is followed.",
        following.iter().map(|(number, word, meaning)| (*number, word.as_str(), *meaning)),
    );
    let mut config = Config {
        language: Language::C,
        cpp_compat: true,
        include_guard: Some("PUNCTUAL_H".to_owned()),
        header: Some(ABOUT.to_owned()),
        after_includes: Some(format!("\n{status}\n{phase}\n{plan}")),
        documentation_style: DocumentationStyle::C99,
        style: Style::Both,
        no_includes: true,
        sys_includes: ["stdbool.h", "stddef.h", "stdint.h"].map(str::to_owned).into(),
        usize_is_size_t: true,
        line_length: 110,
        enumeration: EnumConfig {
            rename_variants: RenameRule::ScreamingSnakeCase,
            prefix_with_name: true,
            ..EnumConfig::default()
        },
        ..Config::default()
    };
    config.export.exclude = vec!["rust_eh_personality".to_owned()];
    for (from, to) in [
        ("PunctualFilter", "punctual_filter"),
        ("PunctualResult", "punctual_result"),
        ("PunctualReport", "punctual_report"),
        ("PunctualBarrier", "punctual_barrier_report"),
    ] {
        config.export.rename.insert(from.to_owned(), to.to_owned());
    }
    let bindings = Builder::new().with_src("src/abi.rs").with_config(config).generate().expect("a header");
    let mut bytes = Vec::new();
    bindings.write(&mut bytes);
    let text = String::from_utf8(bytes).expect("text");
    // What is said to Rust alone.
    let mut kept = String::new();
    let mut skips = false;
    for line in text.lines() {
        let comment = line.trim_start().strip_prefix("//").map(str::trim);
        match comment {
            Some("# Safety") => skips = true,
            Some(_) => {}
            None => skips = false,
        }
        if !skips {
            kept += line;
            kept.push('\n');
        }
    }
    kept.replace("//\n", "")
}

#[test]
fn the_header_is_that_of_the_functions() {
    let file = "include/punctual.h";
    let made = made();
    if std::env::var_os("PUNCTUAL_UPDATE_GOLDEN").is_some() {
        std::fs::write(file, &made).expect("written");
    }
    let found = std::fs::read_to_string(file).expect("a header");
    assert!(found == made, "{file} is not that of src/abi.rs: PUNCTUAL_UPDATE_GOLDEN=1 writes it");
}
