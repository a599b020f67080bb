//! A separate folder for each test, the binary under test, and the FMUs of the example.

use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::LazyLock;

use punctual_modeldescription::Archive;
use tempfile::TempDir;

/// The folder of the example that most tests use.
pub(crate) fn examples() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/vehicles")
}

/// Result of a command.
#[derive(Debug)]
pub(crate) struct Done {
    pub(crate) code: i32,
    pub(crate) stdout: String,
    pub(crate) stderr: String,
}

impl Done {
    /// Asserts success; returns stdout.
    #[track_caller]
    pub(crate) fn success(self) -> String {
        assert_eq!(self.code, 0, "{self:#?}");
        self.stdout
    }

    /// Asserts a failure with this exit code that prints nothing but `error: ` and `message`.
    #[track_caller]
    pub(crate) fn fails(self, code: i32, message: &str) {
        let expected = format!("error: {message}\n");
        assert_eq!((self.code, self.stdout.as_str(), self.stderr.as_str()), (code, "", expected.as_str()));
    }

    /// Asserts a failure with this exit code whose message starts with `begin` and contains `parts`: for
    /// messages whose text comes from the operating system or another crate.
    #[track_caller]
    pub(crate) fn fails_like(self, code: i32, begin: &str, parts: &[&str]) {
        let begin = format!("error: {begin}");
        let printed = self.stderr.starts_with(&begin) && parts.iter().all(|part| self.stderr.contains(part));
        assert!(
            self.code == code && self.stdout.is_empty() && printed,
            "wanted {begin}, {parts:?}: {self:#?}"
        );
    }
}

/// A temporary folder in which the command line is run, so that messages contain plain file names.
pub(crate) struct Workshop {
    folder: TempDir,
    environment: Vec<(&'static str, String)>,
}

impl Workshop {
    pub(crate) fn new() -> Self {
        Self { folder: tempfile::tempdir().expect("a temporary folder"), environment: Vec::new() }
    }

    /// A workshop with the FMUs `filter.fmu` and `plant.fmu` of the example.
    pub(crate) fn with_fmus() -> Self {
        let workshop = Self::new();
        for (name, bytes) in ["filter.fmu", "plant.fmu"].iter().zip(&*FMUS) {
            fs::write(workshop.path(name), bytes).expect("a writable folder");
        }
        workshop
    }

    /// A workshop with `external.toml`, the example of a filter whose barrier derivatives are inputs.
    pub(crate) fn with_external() -> Self {
        let workshop = Self::new();
        let example = examples().join("../models/external-filter.toml");
        workshop.write("external.toml", fs::read(example).expect("the example"));
        workshop
    }

    /// The same workshop, with an environment variable for every call.
    pub(crate) fn with_variable(mut self, name: &'static str, value: impl Into<String>) -> Self {
        self.environment.push((name, value.into()));
        self
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub(crate) fn write(&self, name: &str, text: impl AsRef<[u8]>) {
        fs::write(self.path(name), text).expect("a writable folder");
    }

    pub(crate) fn bytes(&self, name: &str) -> Vec<u8> {
        fs::read(self.path(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
    }

    pub(crate) fn text(&self, name: &str) -> String {
        String::from_utf8(self.bytes(name)).expect("UTF-8")
    }

    /// The names of the files in the folder, sorted.
    pub(crate) fn files(&self) -> Vec<String> {
        let entries = fs::read_dir(self.folder.path()).expect("a readable folder");
        let mut names: Vec<_> =
            entries.map(|e| e.expect("an entry").file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }

    /// Runs `punctual` with these arguments. Variables of the caller's environment that it reads are not
    /// passed on.
    pub(crate) fn punctual<S: AsRef<OsStr>>(&self, arguments: impl IntoIterator<Item = S>) -> Done {
        let mut command = Command::new(env!("CARGO_BIN_EXE_punctual"));
        command.args(arguments).current_dir(self.folder.path()).stdin(Stdio::null());
        for name in ["COLUMNS", "CLICOLOR_FORCE", "SOURCE_DATE_EPOCH", "PUNCTUAL_FMU_LIBRARY"] {
            command.env_remove(name);
        }
        command.envs(self.environment.iter().map(|(name, value)| (name, value)));
        let output = command.output().expect("the binary under test starts");
        Done {
            code: output.status.code().expect("it is not ended by a signal"),
            stdout: String::from_utf8(output.stdout).expect("UTF-8"),
            stderr: String::from_utf8(output.stderr).expect("UTF-8"),
        }
    }

    /// Rewrites the FMU `name`: `edit` gets each entry's path and bytes, and drops it by returning `None`.
    pub(crate) fn edit_fmu(&self, name: &str, mut edit: impl FnMut(&str, Vec<u8>) -> Option<Vec<u8>>) {
        let unpacked = tempfile::tempdir().expect("a temporary folder");
        let path = self.path(name);
        let entries = fmi_rs::zip::get_zip_contents(path.to_str().expect("UTF-8")).expect("an archive");
        fmi_rs::zip::extract_zip_archive(&path, unpacked.path()).expect("an archive");
        let mut archive = Archive::new();
        for entry in entries {
            let bytes = fs::read(unpacked.path().join(&entry)).expect("an unpacked entry");
            if let Some(bytes) = edit(&entry, bytes) {
                archive.add(&entry, bytes).expect("an entry of its own");
            }
        }
        self.write(name, archive.to_bytes().expect("an archive"));
    }
}

/// The shared library, without debug information if `strip` is available. Debug information makes it ten
/// times as large, and every FMU built or run is compressed or unpacked.
static LIBRARY: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let library = fs::read(library()).expect("the library beside the tests");
    let folder = tempfile::tempdir().expect("a temporary folder");
    let copy = folder.path().join("library");
    fs::write(&copy, &library).expect("a writable folder");
    let stripped = Command::new("strip").arg("--strip-debug").arg(&copy).stderr(Stdio::null()).status();
    match stripped {
        Ok(status) if status.success() => fs::read(&copy).expect("the stripped library"),
        _ => library,
    }
});

/// The FMUs of filter and plant, built once.
static FMUS: LazyLock<[Vec<u8>; 2]> = LazyLock::new(|| {
    let workshop = Workshop::with_library();
    ["unicycle-filter", "unicycle-plant"].map(|stem| {
        let configuration = examples().join(format!("{stem}.toml"));
        workshop.write("x.toml", fs::read(configuration).expect("an example"));
        workshop.punctual(["build", "x.toml", "-o", "x.fmu"]).success();
        workshop.bytes("x.fmu")
    })
});

/// The path where cargo puts the library that tests use.
pub(crate) fn library() -> PathBuf {
    let name = format!("{}punctual_fmu{}", std::env::consts::DLL_PREFIX, std::env::consts::DLL_SUFFIX);
    std::env::current_exe().expect("a running test").with_file_name(name)
}

impl Workshop {
    /// A workshop with a small copy of the shared library, for tests that build FMUs.
    pub(crate) fn with_library() -> Self {
        let workshop = Self::new();
        workshop.write("library", &*LIBRARY);
        let path = workshop.path("library").display().to_string();
        workshop.with_variable("PUNCTUAL_FMU_LIBRARY", path)
    }
}

/// Compares `text` with `golden/<name>`.
#[track_caller]
pub(crate) fn assert_golden(name: &str, text: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/cli/golden").join(name);
    if std::env::var_os("PUNCTUAL_UPDATE_GOLDEN").is_some() {
        fs::write(&path, text).expect("a writable golden file");
    }
    let expected = fs::read_to_string(&path).unwrap_or_default();
    assert!(
        text == expected,
        "differs from {}; if that is meant, run again with PUNCTUAL_UPDATE_GOLDEN=1\n--- expected\n{expected}\n\
         --- found\n{text}",
        path.display()
    );
}

/// `text` with every GUID replaced, since it changes with each version.
pub(crate) fn without_guids(text: &str) -> String {
    let mut parts = text.split('{');
    let mut result = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        result.push('{');
        let guid = part.get(..36).filter(|g| g.bytes().all(|b| b.is_ascii_hexdigit() || b == b'-'));
        result.push_str(&guid.map_or_else(|| part.to_owned(), |guid| part.replacen(guid, "GUID", 1)));
    }
    result
}
