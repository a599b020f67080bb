//! Plug-ins: shared libraries with a model, as described in `include/punctual_model.h`. Its types in Rust are
//! in `punctual_model.rs`, the file that plug-ins copy, and are used from there.

#[allow(
    clippy::all,
    clippy::missing_errors_doc,
    clippy::multiple_unsafe_ops_per_block,
    clippy::undocumented_unsafe_blocks,
    missing_docs,
    unreachable_pub,
    reason = "compiled into the plug-ins of others as it is"
)]
mod punctual_model;

use std::env::consts::{DLL_PREFIX, DLL_SUFFIX};
use std::ffi::{CStr, c_char, c_void};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use libloading::Library;
use punctual_models::evaluated::{Calculator, Code, Dimensions, Number};
use uuid::Uuid;

use punctual_model::{
    ABI, BarrierFunction, Calculator as RawCalculator, Description as RawModel, PlantFunction,
    Variable as RawVariable,
};

use super::guard::catch;
use crate::configuration::{ParameterSection, Plugin, PluginLoader, VariableSection};

/// Most parameters of a model.
const MAX_PARAMETERS: u32 = 256;
/// Longest text that is read.
const MAX_TEXT: usize = 4096;

/// The first two fields of every version of the description.
#[repr(C)]
#[derive(Clone, Copy)]
struct Head {
    abi: u32,
    size: u32,
}

type GetModel = unsafe extern "C" fn() -> *const RawModel;

/// The name of the export.
const SYMBOL: &str = "punctual_model";

/// The folder that is searched for plug-ins.
pub struct PluginFolder {
    folder: PathBuf,
    watch: fn(&Path, &str),
}

impl PluginFolder {
    /// Plug-ins in `folder`.
    pub fn new(folder: impl Into<PathBuf>) -> Self {
        Self { folder: folder.into(), watch: |_, _| {} }
    }

    /// Makes `watch` receive the file and the next action before it is performed, so that a process that
    /// watches this one knows where it ended.
    #[must_use]
    pub fn watched(self, watch: fn(&Path, &str)) -> Self {
        Self { watch, ..self }
    }

    /// The path of the plug-in `name`.
    pub fn file(&self, name: &str) -> PathBuf {
        self.folder.join(file_name(name))
    }
}

/// The file name of the plug-in `name` on this platform.
pub fn file_name(name: &str) -> String {
    format!("{DLL_PREFIX}{name}{DLL_SUFFIX}")
}

/// The path in the form with which Windows also finds libraries beside it: absolute, with backslashes, and if
/// it is long, in the form for long paths.
#[cfg(windows)]
pub fn loadable(path: &Path) -> PathBuf {
    /// The length from which Windows refuses other forms (MAX_PATH).
    const LONG: usize = 260;
    let path = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    if path.as_os_str().len() < LONG { path } else { path.canonicalize().unwrap_or(path) }
}

impl PluginLoader for PluginFolder {
    fn digest(&self, name: &str) -> Result<(String, String), String> {
        let path = self.file(name);
        let bytes = std::fs::read(&path)
            .map_err(|e| format!("is {name:?}, but {} cannot be read: {e}", path.display()))?;
        Ok((file_name(name), Uuid::new_v5(&Uuid::NAMESPACE_OID, &bytes).to_string()))
    }

    fn load(&self, name: &str) -> Result<Plugin, String> {
        let (file, digest) = self.digest(name)?;
        loaded(&self.file(name), &file, self.watch)
            .map(|plugin| Plugin { digest, file: file.clone(), ..plugin })
            .map_err(|problem| format!("{file}: {problem}"))
    }
}

fn open(path: &Path) -> Result<Library, libloading::Error> {
    // Without a folder, the system would search elsewhere.
    if path.parent() == Some(Path::new("")) { open_at(&Path::new(".").join(path)) } else { open_at(path) }
}

#[cfg(unix)]
fn open_at(path: &Path) -> Result<Library, libloading::Error> {
    use libloading::os::unix::{Library, RTLD_LOCAL, RTLD_NOW};
    // SAFETY: running the plug-in's initialisers is what the user asked for by naming it.
    let library = unsafe { Library::open(Some(path), RTLD_NOW | RTLD_LOCAL) }?;
    Ok(library.into())
}

#[cfg(windows)]
fn open_at(path: &Path) -> Result<Library, libloading::Error> {
    use libloading::os::windows::{LOAD_WITH_ALTERED_SEARCH_PATH, Library};
    // Libraries that it depends on lie beside it.
    // SAFETY: running the plug-in's initialisers is what the user asked for by naming it.
    let library = unsafe { Library::load_with_flags(loadable(path), LOAD_WITH_ALTERED_SEARCH_PATH) }?;
    Ok(library.into())
}

fn loaded(path: &Path, file: &str, watch: fn(&Path, &str)) -> Result<Plugin, String> {
    // Load the library, and call its one export.
    watch(path, "its loading");
    // The system's error text contains a path of this machine and gives the reason.
    let library = open(path).map_err(|e| format!("cannot be loaded: {}", chain(&e)))?;
    // SAFETY: in the header, the function of this name has this type.
    let symbol = unsafe { library.get::<GetModel>(SYMBOL) };
    let get = *symbol.map_err(|_| format!("exports no {SYMBOL}, the function that makes it a plug-in"))?;
    watch(path, SYMBOL);
    // SAFETY: the function takes nothing and may be called at any time.
    let model = unsafe { get() };
    if model.is_null() {
        return Err(format!("{SYMBOL} returned NULL"));
    }
    if !model.is_aligned() {
        return Err(format!(
            "{SYMBOL} returned an address that is not aligned to {} bytes",
            align_of::<RawModel>()
        ));
    }
    // Check that the description is of this version.
    // SAFETY: not NULL, aligned, and every version begins with these fields.
    let Head { abi, size } = unsafe { *model.cast::<Head>() };
    if abi != ABI {
        return Err(format!(
            "abi is {abi}, must be {ABI}: compile it with the punctual_model.h of this version"
        ));
    }
    if size as usize != size_of::<RawModel>() {
        return Err(format!(
            "size is {size}, must be {}, the size of punctual_model_description: compile it with the \
             punctual_model.h of this version, unchanged",
            size_of::<RawModel>()
        ));
    }
    // SAFETY: not NULL, aligned, version and size are those of this type, and the library stays loaded.
    let raw = unsafe { &*model };
    // Check dimensions and functions, and read the lists of variables.
    let dimensions = Dimensions {
        states: raw.states as usize,
        inputs: raw.inputs as usize,
        barriers: raw.barriers as usize,
    };
    dimensions.check().map_err(|e| e.to_string())?;
    if raw.parameters > MAX_PARAMETERS {
        return Err(format!("parameters is {}, must be 0 to {MAX_PARAMETERS}", raw.parameters));
    }
    let plant = raw.plant.ok_or("plant is NULL")?;
    if raw.barriers > 0 && raw.barrier_value.is_none() {
        return Err(format!("barrier_value is NULL with barriers = {}", raw.barriers));
    }
    let states = variables("state", "states", raw.state, raw.states)?;
    let inputs = variables("input", "inputs", raw.input, raw.inputs)?;
    let parameters = variables("parameter", "parameters", raw.parameter, raw.parameters)?;
    let barriers = variables("barrier", "barriers", raw.barrier, raw.barriers)?;
    // Let the model prepare itself.
    if let Some(initialize) = raw.initialize {
        watch(path, "initialize");
        // SAFETY: the header allows a call at any time after loading.
        let refusal = unsafe { initialize() };
        if let Some(refusal) = text("what initialize returned", refusal)? {
            return Err(format!("initialize refused: {refusal}"));
        }
    }
    watch(path, "plant or barrier_value");
    let code = LoadedCode {
        plant,
        barrier: raw.barrier_value,
        dimensions,
        parameters: parameters.len(),
        _library: library,
    };
    Ok(Plugin {
        file: file.to_owned(),
        path: path.to_owned(),
        digest: String::new(),
        states: states.into_iter().map(|v| v.0).collect(),
        inputs: inputs.into_iter().map(|v| v.0).collect(),
        parameters: parameters.into_iter().map(parameter).collect(),
        barriers: barriers.into_iter().map(|v| VariableSection { min: None, max: None, ..v.0 }).collect(),
        code: Arc::new(code),
    })
}

/// `error` with its causes.
fn chain(error: &dyn std::error::Error) -> String {
    let mut words = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        words += &format!(": {error}");
        cause = error.source();
    }
    words
}

fn parameter((v, start): (VariableSection, f64)) -> ParameterSection {
    let VariableSection { name, unit, description, min, max } = v;
    ParameterSection { name, start, unit, description, min, max }
}

/// The `count` variables at `first`, each with its start value; `field` is the name of the list.
fn variables(
    field: &str,
    counter: &str,
    first: *const RawVariable,
    count: u32,
) -> Result<Vec<(VariableSection, f64)>, String> {
    if count == 0 {
        return Ok(Vec::new());
    }
    if first.is_null() {
        return Err(format!("{field} is NULL with {counter} = {count}"));
    }
    if !first.is_aligned() {
        return Err(format!("{field} is not aligned to {} bytes", align_of::<RawVariable>()));
    }
    // SAFETY: not NULL, aligned, and the header requires as many as are counted, which are few.
    let list = unsafe { std::slice::from_raw_parts(first, count as usize) };
    let row = |(i, raw): (usize, &RawVariable)| {
        let path = |part: &str| format!("{field}[{i}].{part}");
        let name = text(&path("name"), raw.name)?.ok_or_else(|| format!("{} is NULL", path("name")))?;
        let unit = text(&path("unit"), raw.unit)?.unwrap_or_else(|| "1".to_owned());
        let description = text(&path("description"), raw.description)?.unwrap_or_default();
        let none = raw.minimum == 0.0 && raw.maximum == 0.0;
        let end = |value: f64, infinite: f64| (!none && value != infinite).then_some(value);
        let (min, max) = (end(raw.minimum, f64::NEG_INFINITY), end(raw.maximum, f64::INFINITY));
        Ok((VariableSection { name, unit, description, min, max }, raw.start))
    };
    list.iter().enumerate().map(row).collect()
}

/// The text at `pointer`; `None` for NULL.
fn text(field: &str, pointer: *const c_char) -> Result<Option<String>, String> {
    if pointer.is_null() {
        return Ok(None);
    }
    // SAFETY: not NULL, and the header requires a NUL-terminated text.
    let bytes = unsafe { CStr::from_ptr(pointer) };
    let text = bytes.to_str().map_err(|_| format!("{field} is not UTF-8"))?;
    match text.len() {
        0..=MAX_TEXT => Ok(Some(text.to_owned())),
        len => Err(format!("{field} has {len} bytes, must have at most {MAX_TEXT}")),
    }
}

/// The functions of a plug-in, which is unloaded with its last user.
struct LoadedCode {
    plant: PlantFunction,
    barrier: Option<BarrierFunction>,
    dimensions: Dimensions,
    parameters: usize,
    _library: Library,
}

/// A number that no code was given, and different from `LITERAL`, so that code which uses it is detected.
const UNKNOWN: Number = Number::MAX - 1;

/// Performs an operation for the code behind `host`.
extern "C" fn apply(host: *mut c_void, operation: u32, a: Number, b: Number, literal: f64) -> Number {
    let result = catch(|| {
        // SAFETY: `called` made `host` of such a reference, which lives during the call.
        let calculator = unsafe { &mut *host.cast::<&mut dyn Calculator>() };
        calculator.apply(operation, a, b, literal)
    });
    result.unwrap_or(UNKNOWN)
}

/// Reads a value for the code behind `host`.
extern "C" fn value(host: *mut c_void, a: Number) -> f64 {
    let result = catch(|| {
        // SAFETY: as in `apply`.
        let calculator = unsafe { &*host.cast::<&mut dyn Calculator>() };
        calculator.value(a)
    });
    result.unwrap_or(f64::NAN)
}

/// Passes `calculator` to `body` in the form that the code expects.
fn called<R>(mut calculator: &mut dyn Calculator, body: impl FnOnce(*const RawCalculator) -> R) -> R {
    let raw = RawCalculator { host: (&raw mut calculator).cast(), apply, value };
    body(&raw const raw)
}

impl Code for LoadedCode {
    fn plant(
        &self,
        c: &mut dyn Calculator,
        parameters: &[f64],
        x: &[Number],
        f: &mut [Number],
        g: &mut [Number],
    ) {
        let Dimensions { states, inputs, .. } = self.dimensions;
        assert!(x.len() == states && f.len() == states && g.len() == states * inputs);
        assert!(parameters.len() == self.parameters);
        // SAFETY: the arrays have the lengths that the header promises; what the code does with them is its
        // own responsibility.
        called(c, |raw| unsafe {
            (self.plant)(raw, parameters.as_ptr(), x.as_ptr(), f.as_mut_ptr(), g.as_mut_ptr());
        });
    }

    fn barrier(
        &self,
        index: usize,
        c: &mut dyn Calculator,
        parameters: &[f64],
        t: Number,
        x: &[Number],
    ) -> Number {
        let Some(barrier) = self.barrier else { return UNKNOWN };
        let Dimensions { states, barriers, .. } = self.dimensions;
        assert!(x.len() == states && index < barriers && parameters.len() == self.parameters);
        // SAFETY: as above.
        called(c, |raw| unsafe { barrier(raw, index as u32, parameters.as_ptr(), t, x.as_ptr()) })
    }
}
