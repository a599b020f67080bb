//! A loaded shared library and the FMI functions that the host uses, all resolved at loading. This file
//! trusts libraries to use the signatures of the standard.

use std::ffi::c_char;
use std::path::Path;

use super::archive::chain;
use super::logging::{self, Copied};
use super::{Version, fmi2, fmi3};
use crate::error::FmuProblem;

/// Defines `Functions`: the functions that a run requires, each with the name and type of the standard, and
/// optional ones.
macro_rules! functions {
    (
        needed { $($field:ident: $name:literal, $type:ty;)* }
        other { $($other:ident: $other_name:literal, $other_type:ty;)* }
    ) => {
        /// The functions used, valid while the library is loaded.
        #[derive(Clone, Copy)]
        pub(super) struct Functions {
            $(#[doc = concat!("`", $name, "`.")] pub(super) $field: $type,)*
            $(#[doc = concat!("`", $other_name, "`, if there is one.")] pub(super) $other: Option<$other_type>,)*
        }

        impl Functions {
            /// Resolves all of them in a library.
            ///
            /// # Errors
            ///
            /// A required function is missing.
            pub(super) fn resolve(library: &libloading::Library) -> Result<Self, FmuProblem> {
                Ok(Self {
                    $($field: {
                        // SAFETY: the type is the one the standard gives the function of this name.
                        let symbol = unsafe { library.get::<$type>($name) };
                        *symbol.map_err(|_| FmuProblem::MissingSymbol($name))?
                    },)*
                    $($other: {
                        // SAFETY: the type is the one the standard gives the function of this name.
                        let symbol = unsafe { library.get::<$other_type>($other_name) };
                        symbol.ok().map(|symbol| *symbol)
                    },)*
                })
            }
        }
    };
}
pub(super) use functions;

/// The functions of one version.
#[derive(Clone, Copy)]
pub(super) enum Functions {
    Fmi2(fmi2::Functions),
    Fmi3(fmi3::Functions),
}

/// A query of the version: the function, and how its answer must begin.
type Question = (&'static str, unsafe extern "C" fn() -> *const c_char, &'static str);

impl Functions {
    fn questions(&self) -> Vec<Question> {
        match self {
            Self::Fmi2(functions) => vec![
                ("fmi2GetVersion", functions.get_version, "2."),
                ("fmi2GetTypesPlatform", functions.get_types_platform, "default"),
            ],
            Self::Fmi3(functions) => vec![("fmi3GetVersion", functions.get_version, "3.")],
        }
    }
}

/// A loaded library. The functions are valid while it lives.
pub(super) struct Library {
    pub(super) functions: Functions,
    /// Its answers to the queries of its version, by function.
    pub(super) answers: Vec<(&'static str, String)>,
    _library: libloading::Library,
}

impl std::fmt::Debug for Library {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Library")
    }
}

impl Library {
    /// Loads the library of an FMU of this `version`, resolves every function used and queries its version.
    /// Its undefined symbols are resolved now, so that none turns out to be missing during a run. Its own
    /// symbols stay local.
    pub(super) fn load(path: &Path, version: Version) -> Result<Self, FmuProblem> {
        let library = open(path).map_err(|e| FmuProblem::Load(refused(path, &chain(&e))))?;
        let functions = match version {
            Version::Fmi2 => Functions::Fmi2(fmi2::Functions::resolve(&library)?),
            Version::Fmi3 => Functions::Fmi3(fmi3::Functions::resolve(&library)?),
        };
        let mut answers = Vec::new();
        for (call, function, expected) in functions.questions() {
            // SAFETY: the function takes nothing and may be called at any time.
            let answer = unsafe { function() };
            let answer = match logging::value(answer) {
                Copied::Null => String::new(),
                answer => answer.text().unwrap_or_else(str::to_owned),
            };
            if !answer.starts_with(expected) {
                return Err(FmuProblem::Version { call, answer, wanted: version.as_str() });
            }
            answers.push((call, answer));
        }
        Ok(Self { functions, answers, _library: library })
    }
}

/// The loader's message with the library's name, which messages of Windows lack.
fn refused(path: &Path, words: &str) -> String {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    if words.contains(&*name) {
        words.to_owned()
    } else {
        format!("{name}, or a library that it needs: {words}")
    }
}

#[cfg(unix)]
fn open(path: &Path) -> Result<libloading::Library, libloading::Error> {
    use libloading::os::unix::{Library, RTLD_LOCAL, RTLD_NOW};
    // SAFETY: running the FMU's initialisers is what the user asked for by naming it.
    let library = unsafe { Library::open(Some(path), RTLD_NOW | RTLD_LOCAL) }?;
    Ok(library.into())
}

#[cfg(windows)]
fn open(path: &Path) -> Result<libloading::Library, libloading::Error> {
    use libloading::os::windows::{LOAD_WITH_ALTERED_SEARCH_PATH, Library};
    use punctual_fmu::loadable;
    // Libraries that it depends on lie beside it (section 2.3), where the system would not look by default.
    // SAFETY: running the FMU's initialisers is what the user asked for by naming it.
    let library = unsafe { Library::load_with_flags(loadable(path), LOAD_WITH_ALTERED_SEARCH_PATH) }?;
    Ok(library.into())
}

/// Makes a crash end this process at once. By default Windows would show a dialog first.
pub(crate) fn crash_at_once() {
    #[cfg(windows)]
    {
        #[link(name = "kernel32")]
        unsafe extern "system" {
            fn SetErrorMode(mode: u32) -> u32;
        }
        /// SEM_FAILCRITICALERRORS and SEM_NOGPFAULTERRORBOX.
        const NO_DIALOG: u32 = 1 | 2;
        // SAFETY: the function takes any number and may be called at any time.
        unsafe { SetErrorMode(NO_DIALOG) };
    }
}
