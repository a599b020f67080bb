//! The files of the repository.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use crate::lexer::{Lexed, lex};

/// The root of the repository.
pub(crate) fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// A text file.
pub(crate) struct Text {
    /// Its path from the root, with forward slashes.
    pub(crate) path: String,
    pub(crate) text: String,
}

/// A Rust file, split by the lexer.
pub(crate) struct Source {
    pub(crate) path: String,
    pub(crate) lexed: Lexed,
}

impl Source {
    /// Whether it is compiled only for tests.
    pub(crate) fn is_test(&self) -> bool {
        self.path.contains("tests/") || self.path.ends_with("/tests.rs")
    }

    /// Its code and strings, without the test module at its end.
    pub(crate) fn without_tests(&self) -> Lexed {
        let code = self.lexed.code.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default().to_owned();
        let lines = code.lines().count();
        let strings = self.lexed.strings.iter().filter(|s| s.0 <= lines).cloned().collect();
        Lexed { code, strings }
    }
}

/// Every text file, except what is built or installed.
pub(crate) static TEXTS: LazyLock<Vec<Text>> = LazyLock::new(|| {
    let mut texts = Vec::new();
    walk(root(), &mut texts);
    texts.sort_by(|a, b| a.path.cmp(&b.path));
    assert!(
        texts.iter().any(|text| text.path == "core/src/lib.rs"),
        "the repository is not where it should be"
    );
    texts
});

/// Every Rust file.
pub(crate) static SOURCES: LazyLock<Vec<Source>> = LazyLock::new(|| {
    let rust = TEXTS.iter().filter(|text| text.path.ends_with(".rs"));
    rust.map(|text| Source { path: text.path.clone(), lexed: lex(&text.text) }).collect()
});

/// The Rust files of the crates themselves.
pub(crate) fn crates() -> impl Iterator<Item = &'static Source> {
    let folders = [
        "src/",
        "core/src/",
        "reference/src/",
        "modeldescription/src/",
        "models/src/",
        "embedded/src/",
        "fmu/src/",
        "cosim/src/",
        "pictures/src/",
        "study/src/",
        "python/src/",
    ];
    SOURCES.iter().filter(move |source| folders.iter().any(|folder| source.path.starts_with(folder)))
}

fn walk(folder: &Path, texts: &mut Vec<Text>) {
    for entry in fs::read_dir(folder).expect("a readable folder") {
        let path: PathBuf = entry.expect("a readable entry").path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        // Skipped: folders listed in .gitignore, and the repository's own data.
        let skipped =
            ["target", ".venv", ".venv-release", "_bin", "out", "__pycache__", ".pytest_cache", ".git"];
        if skipped.contains(&&*name) || path.is_symlink() {
            continue;
        }
        if path.is_dir() {
            walk(&path, texts);
        } else if let Ok(text) = fs::read_to_string(&path) {
            let path = path.strip_prefix(root()).expect("a path below the root");
            let parts: Vec<_> = path.iter().map(|part| part.to_string_lossy()).collect();
            texts.push(Text { path: parts.join("/"), text });
        }
    }
}
