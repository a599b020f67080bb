//! A loaded shared library and the FMI 2.0 functions the host uses, all resolved when loading.
//! This file trusts libraries to follow the signatures of the standard.

use std::path::Path;

use punctual_fmu::fmi2;

use super::archive::chain;
use super::logging::owned;
use crate::error::FmuProblem;

macro_rules! functions {
    ($($(#[$doc:meta])* $field:ident: $name:literal, $type:ty;)*) => {
        /// The functions used, by their standard names.
        pub(super) struct Functions { $($(#[$doc])* pub(super) $field: $type,)* }

        impl Functions {
            fn resolve(library: &libloading::Library) -> Result<Self, FmuProblem> {
                Ok(Self { $($field: {
                    // SAFETY: the type is the one the standard gives the function of this name.
                    let symbol = unsafe { library.get::<$type>($name) };
                    *symbol.map_err(|_| FmuProblem::MissingSymbol($name))?
                },)* })
            }
        }
    };
}

functions! {
    get_types_platform: "fmi2GetTypesPlatform", fmi2::GetTypesPlatform;
    get_version: "fmi2GetVersion", fmi2::GetVersion;
    instantiate: "fmi2Instantiate", fmi2::Instantiate;
    free_instance: "fmi2FreeInstance", fmi2::FreeInstance;
    setup_experiment: "fmi2SetupExperiment", fmi2::SetupExperiment;
    enter_initialization_mode: "fmi2EnterInitializationMode", fmi2::EnterInitializationMode;
    exit_initialization_mode: "fmi2ExitInitializationMode", fmi2::ExitInitializationMode;
    terminate: "fmi2Terminate", fmi2::Terminate;
    reset: "fmi2Reset", fmi2::Reset;
    get_real: "fmi2GetReal", fmi2::GetReal;
    get_integer: "fmi2GetInteger", fmi2::GetInteger;
    get_boolean: "fmi2GetBoolean", fmi2::GetBoolean;
    set_real: "fmi2SetReal", fmi2::SetReal;
    set_integer: "fmi2SetInteger", fmi2::SetInteger;
    set_boolean: "fmi2SetBoolean", fmi2::SetBoolean;
    do_step: "fmi2DoStep", fmi2::DoStep;
}

/// A loaded library. The functions are valid while it lives.
pub(super) struct Library {
    pub(super) functions: Functions,
    /// `fmi2GetString`, which couplings do without.
    pub(super) get_string: Option<fmi2::GetString>,
    /// The answer of `fmi2GetVersion`.
    pub(super) version: String,
    /// The answer of `fmi2GetTypesPlatform`.
    pub(super) types_platform: String,
    _library: libloading::Library,
}

impl std::fmt::Debug for Library {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Library")
    }
}

impl Library {
    /// Loads the library, resolves every function used and asks for its version. Its undefined symbols are
    /// resolved now, so that none is missed in mid-run. Its own symbols stay its own.
    pub(super) fn load(path: &Path) -> Result<Self, FmuProblem> {
        let library = open(path).map_err(|e| FmuProblem::Load(refused(path, &chain(&e))))?;
        let functions = Functions::resolve(&library)?;
        let asked = [
            ("fmi2GetVersion", functions.get_version, "2."),
            ("fmi2GetTypesPlatform", functions.get_types_platform, "default"),
        ];
        let mut answers = Vec::new();
        for (call, function, expected) in asked {
            // SAFETY: the function takes nothing and may be called at any time.
            let answer = unsafe { function() };
            // SAFETY: the standard has it return a zero-terminated text; NULL is allowed for.
            let answer = unsafe { owned(answer) };
            if !answer.starts_with(expected) {
                return Err(FmuProblem::Version { call, answer });
            }
            answers.push(answer);
        }
        let [version, types_platform] = <[String; 2]>::try_from(answers).unwrap_or_default();
        // SAFETY: the type is the one the standard gives the function of this name.
        let get_string = unsafe { library.get::<fmi2::GetString>("fmi2GetString") };
        let get_string = get_string.ok().map(|symbol| *symbol);
        Ok(Self { functions, get_string, version, types_platform, _library: library })
    }
}

/// The loader's words with the library's name, which those of Windows lack.
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
    // SAFETY: running the initialisers of the FMU is what the user asked for by naming it.
    let library = unsafe { Library::open(Some(path), RTLD_NOW | RTLD_LOCAL) }?;
    Ok(library.into())
}

#[cfg(windows)]
fn open(path: &Path) -> Result<libloading::Library, libloading::Error> {
    use libloading::os::windows::{LOAD_WITH_ALTERED_SEARCH_PATH, Library};
    use punctual_fmu::loadable;
    // Libraries that it needs lie beside it (section 2.3), where the system would not look otherwise.
    // SAFETY: running the initialisers of the FMU is what the user asked for by naming it.
    let library = unsafe { Library::load_with_flags(loadable(path), LOAD_WITH_ALTERED_SEARCH_PATH) }?;
    Ok(library.into())
}

/// Has a crash end this process at once. Windows would ask somebody first.
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
