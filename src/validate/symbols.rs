//! Checks that libraries export the functions that FMI 2.0 co-simulation needs. It reads their files, so that
//! nothing of them runs, and those of other platforms can be checked too.

use std::collections::HashSet;

use object::read::NameOrOrdinal;
use object::{Architecture, BinaryFormat, Object, ObjectSymbol};
use punctual_fmu::fmi2::FUNCTIONS;
use punctual_modeldescription::Located;

use super::finding::Findings;
use super::layout::ending;
use crate::host::Archive;

/// The greatest library looked into, in bytes.
const MAX_LIBRARY_BYTES: u64 = 512 << 20;

pub(super) fn check(archive: &Archive, model: &Located, findings: &mut Findings) {
    let Some(identifier) = model.model_identifier() else { return };
    for platform in archive.platforms() {
        let Some(ending) = ending(platform) else { continue };
        let entry = format!("binaries/{platform}/{identifier}{ending}");
        if archive.entries().contains(&entry) {
            library(archive, platform, &entry, findings);
        }
    }
}

fn library(archive: &Archive, platform: &str, entry: &str, findings: &mut Findings) {
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
    let told = bytes.map_err(|e| e.to_string()).and_then(|bytes| exports(&bytes, platform));
    match told {
        Err(message) => findings.archive("symbols.readable", entry, message),
        Ok(exported) => {
            let missing: Vec<&str> =
                FUNCTIONS.iter().copied().filter(|function| !exported.contains(*function)).collect();
            if !missing.is_empty() {
                let message = format!(
                    "does not export {} of the {} functions of FMI 2.0 co-simulation: {}",
                    missing.len(),
                    FUNCTIONS.len(),
                    missing.join(", ")
                );
                findings.archive("symbols.missing", entry, message);
            }
        }
    }
}

/// The names that a library exports, if it is one for the platform; else its defect.
fn exports(bytes: &[u8], platform: &str) -> Result<HashSet<String>, String> {
    if is_fat(bytes) && platform.starts_with("darwin") {
        return fat_exports(bytes);
    }
    let file = object::File::parse(bytes).map_err(|e| format!("is not a shared library: {e}"))?;
    let format = match platform {
        p if p.starts_with("win") => BinaryFormat::Pe,
        p if p.starts_with("darwin") => BinaryFormat::MachO,
        _ => BinaryFormat::Elf,
    };
    if file.format() != format {
        return Err(format!("has the format {:?}; {platform} has {format:?}", file.format()));
    }
    let found = file.architecture();
    let wanted: &[Architecture] = match platform {
        "linux64" | "win64" => &[Architecture::X86_64],
        "darwin64" => &[Architecture::X86_64, Architecture::Aarch64],
        "linux32" | "win32" | "darwin32" => &[Architecture::I386],
        "aarch64-linux" => &[Architecture::Aarch64],
        _ => &[],
    };
    if !wanted.is_empty() && !wanted.contains(&found) {
        return Err(format!("is for the processor {found:?}; {platform} has {:?}", wanted[0]));
    }
    names(&file)
}

fn names(file: &object::File<'_>) -> Result<HashSet<String>, String> {
    let text = |name: &[u8]| {
        let name = String::from_utf8_lossy(name).into_owned();
        // Mach-O puts an underscore before every C name.
        if file.format() == BinaryFormat::MachO { name.trim_start_matches('_').to_owned() } else { name }
    };
    if file.format() == BinaryFormat::Elf {
        // A loader finds only these.
        let defined = file.dynamic_symbols().filter(|symbol| symbol.is_definition() && symbol.is_global());
        return Ok(defined.filter_map(|symbol| symbol.name_bytes().ok().map(text)).collect());
    }
    let damaged = |e: object::Error| format!("its exports cannot be read: {e}");
    let exports = file.exports().map_err(damaged)?;
    let mut names = HashSet::new();
    for export in exports {
        // An export without a name cannot be asked for by one.
        if let NameOrOrdinal::Name(name) = export.map_err(damaged)?.name() {
            names.insert(text(name));
        }
    }
    Ok(names)
}

/// A library for several processors in one file, as macOS has them.
fn is_fat(bytes: &[u8]) -> bool {
    bytes.starts_with(&[0xca, 0xfe, 0xba, 0xbe])
}

fn fat_exports(bytes: &[u8]) -> Result<HashSet<String>, String> {
    use object::read::macho::{FatArch, MachOFatFile32};
    let damaged = |e: object::Error| format!("is not a shared library: {e}");
    let fat = MachOFatFile32::parse(bytes).map_err(damaged)?;
    // Every part must export everything, so the common names count.
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
