//! Things that are allowed in one place only, and things that are allowed nowhere.

use crate::sources::{SOURCES, TEXTS, crates};

#[test]
fn every_crate_root_speaks_on_unsafe_code() {
    let roots = [
        ("core/src/lib.rs", "forbid"),
        ("reference/src/lib.rs", "forbid"),
        ("modeldescription/src/lib.rs", "forbid"),
        ("models/src/lib.rs", "forbid"),
        ("embedded/src/lib.rs", "deny"),
        ("fmu/src/lib.rs", "deny"),
        ("python/src/lib.rs", "forbid"),
        ("cosim/src/lib.rs", "deny"),
        ("pictures/src/lib.rs", "forbid"),
        ("study/src/lib.rs", "forbid"),
        ("src/lib.rs", "forbid"),
        ("src/main.rs", "forbid"),
    ];
    for (path, word) in roots {
        let source = crates().find(|s| s.path == path).unwrap_or_else(|| panic!("no {path}"));
        let attribute = ["#", "!", "[", word, "(", "unsafe_code", ")", "]"];
        assert_eq!(source.lexed.lines_with(&attribute).len(), 1, "{path}: #![{word}(unsafe_code)]");
    }
}

#[test]
fn unsafe_code_stands_at_the_c_interface_only() {
    for source in SOURCES.iter().filter(|s| !s.is_test()) {
        let places = ["fmu/src/abi/", "embedded/src/abi.rs", "cosim/src/host/"];
        let place = places.iter().any(|folder| source.path.starts_with(folder));
        let lines = source.lexed.lines_with(&["unsafe"]);
        assert!(place || lines.is_empty(), "{}: unsafe in lines {lines:?}", source.path);
    }
}

#[test]
fn only_one_module_prints() {
    let words = [&["println", "!"][..], &["print", "!"], &["eprintln", "!"], &["eprint", "!"], &["dbg", "!"]];
    let streams = [&["stdout", "("][..], &["stderr", "("]];
    for source in crates().filter(|s| s.path != "src/output.rs") {
        for tokens in words.iter().chain(&streams) {
            let mut lines = source.lexed.lines_with(tokens);
            // Whether a child process may print is set by a method of its command.
            let methods = source.lexed.lines_with(&[&["."], *tokens].concat());
            lines.retain(|line| !methods.contains(line));
            assert!(lines.is_empty(), "{}: {} in lines {lines:?}", source.path, tokens[0]);
        }
    }
}

/// Importers print log texts with `printf`, some using the text as the format. Messages of the core reach the
/// log too.
#[test]
fn no_text_of_the_library_holds_a_percent_sign() {
    let folders = ["fmu/src/", "core/src/", "reference/src/", "models/src/"];
    for source in SOURCES.iter().filter(|s| folders.iter().any(|f| s.path.starts_with(f)) && !s.is_test()) {
        for (line, text) in source.without_tests().strings {
            assert!(!text.contains('%'), "{}:{line}: {text:?}", source.path);
        }
    }
}

#[test]
fn identifiers_are_ascii() {
    for source in &*SOURCES {
        for (number, line) in source.lexed.code.lines().enumerate() {
            assert!(line.is_ascii(), "{}:{}: {line}", source.path, number + 1);
        }
    }
}

/// A test may be left to another one that runs it in a separate process, and must say so.
#[test]
fn no_test_is_ignored() {
    for source in &*SOURCES {
        let lines = source.lexed.lines_with(&["#", "[", "ignore"]);
        let strings = &source.lexed.strings;
        for line in lines {
            let reason = strings.iter().find(|s| s.0 == line).and_then(|s| s.1.strip_prefix("started by "));
            let starter = reason.is_some_and(|test| !source.lexed.lines_with(&["fn", test]).is_empty());
            assert!(starter, "{}:{line}: an ignored test that no other test starts", source.path);
        }
    }
}

#[test]
fn nothing_is_left_undone() {
    for source in &*SOURCES {
        for tokens in [["todo", "!"], ["unimplemented", "!"]] {
            let lines = source.lexed.lines_with(&tokens);
            assert!(lines.is_empty(), "{}: {} in lines {lines:?}", source.path, tokens.concat());
        }
    }
    // Concatenated here, so that this file does not contain them.
    for word in [concat!("FIX", "ME"), concat!("TO", "DO"), concat!("XX", "X:")] {
        for text in &*TEXTS {
            assert!(!text.text.contains(word), "{} holds {word}", text.path);
        }
    }
}

#[test]
fn no_file_names_a_place_on_one_machine() {
    // Concatenated here, so that this file does not contain them.
    for place in [concat!("/ro", "ot/"), concat!("/wo", "rk/"), concat!("/ho", "me/")] {
        for text in &*TEXTS {
            let line = text.text.lines().position(|line| line.contains(place));
            assert!(line.is_none(), "{}:{}: {place}", text.path, line.unwrap_or_default() + 1);
        }
    }
}
