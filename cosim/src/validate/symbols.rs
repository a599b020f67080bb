//! Checks that libraries export the functions that the interfaces of FMI 2.0 need, or all functions of FMI
//! 3.0. It only reads their files and runs no code, so it can also check those of other platforms.

use std::collections::HashSet;

use object::read::NameOrOrdinal;
use object::{Architecture, BinaryFormat, Object, ObjectSymbol};
use punctual_fmu::{fmi2, fmi3};

use super::finding::Findings;
use super::layout::ending;
use super::model::Model;
use crate::host::Archive;

/// The greatest size of a library that is examined, in bytes.
const MAX_LIBRARY_BYTES: u64 = 512 << 20;

/// The processors of libraries for a platform.
const PROCESSORS: [(&str, &[Architecture]); 8] = [
    ("linux64", &[Architecture::X86_64]),
    ("linux32", &[Architecture::I386]),
    ("aarch64-linux", &[Architecture::Aarch64]),
    ("win64", &[Architecture::X86_64]),
    ("win32", &[Architecture::I386]),
    ("aarch64-windows", &[Architecture::Aarch64]),
    ("darwin64", &[Architecture::X86_64, Architecture::Aarch64]),
    ("darwin32", &[Architecture::I386]),
];

/// The same for the platform names that FMI 3.0 adds.
const PROCESSORS_OF_FMI3: [(&str, &[Architecture]); 7] = [
    ("x86_64-linux", &[Architecture::X86_64]),
    ("x86-linux", &[Architecture::I386]),
    ("aarch32-linux", &[Architecture::Arm]),
    ("x86_64-windows", &[Architecture::X86_64]),
    ("x86-windows", &[Architecture::I386]),
    ("x86_64-darwin", &[Architecture::X86_64]),
    ("aarch64-darwin", &[Architecture::Aarch64]),
];

/// Functions that a library must export, and the interface that they belong to.
type Wanted = (&'static [&'static str], &'static str);

/// The functions that model exchange adds in FMI 2.0.
const EXCHANGE: &[&str] = &[
    "fmi2EnterEventMode",
    "fmi2NewDiscreteStates",
    "fmi2EnterContinuousTimeMode",
    "fmi2CompletedIntegratorStep",
    "fmi2SetTime",
    "fmi2SetContinuousStates",
    "fmi2GetDerivatives",
    "fmi2GetEventIndicators",
    "fmi2GetContinuousStates",
    "fmi2GetNominalsOfContinuousStates",
];

/// The functions that the library of a model called `identifier` must export.
fn functions(model: &Model, identifier: &str) -> Vec<Wanted> {
    match model {
        Model::Fmi2(of) => {
            let exchange = of.description.model_exchange.as_ref();
            let exchange = exchange.is_some_and(|exchange| exchange.model_identifier == identifier);
            let exchange = exchange.then_some((EXCHANGE, "FMI 2.0 model exchange"));
            let stepped = of.model_identifier() == Some(identifier);
            let stepped = stepped.then_some((fmi2::FUNCTIONS, "FMI 2.0 co-simulation"));
            stepped.into_iter().chain(exchange).collect()
        }
        Model::Fmi3(_) => vec![(fmi3::FUNCTIONS, "FMI 3.0")],
    }
}

/// The library format of a platform, which may be one that the standard does not name.
fn format(platform: &str) -> BinaryFormat {
    match platform {
        p if p.starts_with("win") || p.ends_with("-windows") => BinaryFormat::Pe,
        p if is_darwin(p) => BinaryFormat::MachO,
        _ => BinaryFormat::Elf,
    }
}

fn is_darwin(platform: &str) -> bool {
    platform.starts_with("darwin") || platform.ends_with("-darwin")
}

pub(super) fn check(archive: &Archive, model: &Model, findings: &mut Findings) {
    let version = model.version();
    for platform in archive.platforms() {
        let Some(ending) = ending(version, platform) else { continue };
        for identifier in model.identifiers() {
            let entry = format!("binaries/{platform}/{identifier}{ending}");
            if archive.entries().contains(&entry) {
                library(archive, &functions(model, identifier), platform, &entry, findings);
            }
        }
    }
}

fn library(archive: &Archive, wanted: &[Wanted], platform: &str, entry: &str, findings: &mut Findings) {
    let path = archive.path(entry);
    let bytes = match std::fs::metadata(&path) {
        Ok(metadata) if metadata.len() > MAX_LIBRARY_BYTES => {
            let message =
                format!("has {} bytes; at most {MAX_LIBRARY_BYTES} are looked into", metadata.len());
            findings.archive("symbols.readable", entry, message);
            return;
        }
        Ok(_) => std::fs::read(&path),
        Err(error) => Err(error),
    };
    let reported = bytes.map_err(|e| e.to_string()).and_then(|bytes| exports(&bytes, platform));
    match reported {
        Err(message) => findings.archive("symbols.readable", entry, message),
        Ok(exported) => {
            for (functions, of) in wanted {
                let missing: Vec<&str> =
                    functions.iter().copied().filter(|function| !exported.contains(*function)).collect();
                if !missing.is_empty() {
                    let message = format!(
                        "does not export {} of the {} functions of {of}: {}",
                        missing.len(),
                        functions.len(),
                        missing.join(", ")
                    );
                    findings.archive("symbols.missing", entry, message);
                }
            }
        }
    }
}

/// The names that a library exports, if it is one for the platform; otherwise its defect.
fn exports(bytes: &[u8], platform: &str) -> Result<HashSet<String>, String> {
    if is_fat(bytes) && is_darwin(platform) {
        return fat_exports(bytes);
    }
    let file = parse(bytes)?;
    let format = format(platform);
    if file.format() != format {
        return Err(format!("has the format {:?}; {platform} has {format:?}", file.format()));
    }
    let found = file.architecture();
    let known = PROCESSORS.iter().chain(&PROCESSORS_OF_FMI3).find(|(name, _)| *name == platform);
    if let Some((_, wanted)) = known.filter(|(_, wanted)| !wanted.contains(&found)) {
        return Err(format!("is for the processor {found:?}; {platform} has {:?}", wanted[0]));
    }
    names(&file)
}

/// The platform of a shared library that exports every function of FMI 2.0 co-simulation. The file is read
/// and not run.
///
/// # Errors
///
/// What the file is instead.
pub(crate) fn platform(bytes: &[u8]) -> Result<&'static str, String> {
    let name = if is_fat(bytes) {
        "darwin64"
    } else {
        let file = parse(bytes)?;
        let (kind, processor) = (file.format(), file.architecture());
        let is_for =
            |name: &str, processors: &[Architecture]| format(name) == kind && processors.contains(&processor);
        let found = PROCESSORS.iter().find(|(name, processors)| is_for(name, processors));
        let (name, _) = found.ok_or_else(|| {
            let names = PROCESSORS.map(|(name, _)| name).join(", ");
            format!("is a {kind:?} file for the processor {processor:?}, none of {names}")
        })?;
        name
    };
    let exported = exports(bytes, name)?;
    match fmi2::FUNCTIONS.iter().find(|function| !exported.contains(**function)) {
        Some(missing) => Err(format!("does not export {missing}, so it is not the library of an FMU")),
        None => Ok(name),
    }
}

/// The folders of FMI 3.0 (3.0.2, section 2.5.1) for a library whose platform is `platform` in FMI 2.0. A
/// library for macOS has one folder for each of its processors.
pub(crate) fn tuples(platform: &'static str, bytes: &[u8]) -> Vec<&'static str> {
    const INTEL: &str = "x86_64-darwin";
    const ARM: &str = "aarch64-darwin";
    match platform {
        "linux64" => vec!["x86_64-linux"],
        "linux32" => vec!["x86-linux"],
        "win64" => vec!["x86_64-windows"],
        "win32" => vec!["x86-windows"],
        "darwin64" => match parse(bytes).map(|file| file.architecture()) {
            Ok(Architecture::Aarch64) => vec![ARM],
            Ok(_) => vec![INTEL],
            Err(_) => vec![INTEL, ARM],
        },
        same => vec![same],
    }
}

fn parse(bytes: &[u8]) -> Result<object::File<'_>, String> {
    object::File::parse(bytes).map_err(|e| format!("is not a shared library: {e}"))
}

fn names(file: &object::File<'_>) -> Result<HashSet<String>, String> {
    let text = |name: &[u8]| {
        let name = String::from_utf8_lossy(name).into_owned();
        // Mach-O puts an underscore before every C name.
        if file.format() == BinaryFormat::MachO { name.trim_start_matches('_').to_owned() } else { name }
    };
    if file.format() == BinaryFormat::Elf {
        // A loader only finds these.
        let defined = file.dynamic_symbols().filter(|symbol| symbol.is_definition() && symbol.is_global());
        return Ok(defined.filter_map(|symbol| symbol.name_bytes().ok().map(text)).collect());
    }
    let damaged = |e: object::Error| format!("its exports cannot be read: {e}");
    let exports = file.exports().map_err(damaged)?;
    let mut names = HashSet::new();
    for export in exports {
        // An export without a name cannot be looked up by name.
        if let NameOrOrdinal::Name(name) = export.map_err(damaged)?.name() {
            names.insert(text(name));
        }
    }
    Ok(names)
}

/// Whether one file contains a library for several processors, as on macOS.
fn is_fat(bytes: &[u8]) -> bool {
    bytes.starts_with(&[0xca, 0xfe, 0xba, 0xbe])
}

fn fat_exports(bytes: &[u8]) -> Result<HashSet<String>, String> {
    use object::read::macho::{FatArch, MachOFatFile32};
    let damaged = |e: object::Error| format!("is not a shared library: {e}");
    let fat = MachOFatFile32::parse(bytes).map_err(damaged)?;
    // Every part must export everything, so only common names count.
    let mut common: Option<HashSet<String>> = None;
    for part in fat.arches() {
        let data = part.data(bytes).map_err(damaged)?;
        let found = names(&object::File::parse(data).map_err(damaged)?)?;
        common = Some(match common {
            Some(before) => before.intersection(&found).cloned().collect(),
            None => found,
        });
    }
    common.ok_or_else(|| "is a universal library without parts".to_owned())
}
