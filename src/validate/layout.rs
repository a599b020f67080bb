//! Rules on the entries of the archive (FMI 2.0.4, section 2.3).

use punctual_modeldescription::Located;

use super::finding::Findings;
use crate::host::{Archive, PLATFORM};

/// Entries allowed at the top of the archive.
const TOP: [&str; 8] = [
    "modelDescription.xml",
    "model.png",
    "documentation",
    "sources",
    "binaries",
    "resources",
    "extra",
    "licenses",
];

/// The ending of libraries in a folder of `binaries/`, by the beginning of its name.
pub(super) const ENDINGS: [(&str, &str); 5] = [
    ("win", ".dll"),
    ("aarch64-windows", ".dll"),
    ("linux", ".so"),
    ("aarch64-linux", ".so"),
    ("darwin", ".dylib"),
];

/// The ending of libraries for a platform, where it is one that the standard names.
pub(crate) fn ending(platform: &str) -> Option<&'static str> {
    ENDINGS.iter().find(|(head, _)| platform.starts_with(head)).map(|(_, ending)| *ending)
}

pub(super) fn check(archive: &Archive, model: &Located, findings: &mut Findings) {
    // Entries at the top.
    let mut odd: Vec<&str> = archive.entries().iter().filter_map(|entry| entry.split('/').next()).collect();
    odd.retain(|top| !TOP.contains(top));
    odd.sort_unstable();
    odd.dedup();
    for top in odd {
        let message = format!("{top:?} at the top of the archive; the standard has {}", TOP.join(", "));
        findings.archive("archive.top-folder", top, message);
    }
    // The library of each platform.
    let Some(identifier) = model.model_identifier() else { return };
    let mut libraries = 0;
    for platform in archive.platforms() {
        let Some(ending) = ending(platform) else { continue };
        let wanted = format!("binaries/{platform}/{identifier}{ending}");
        if archive.entries().contains(&wanted) {
            libraries += 1;
            continue;
        }
        let folder = format!("binaries/{platform}/");
        let present: Vec<_> = archive
            .entries()
            .iter()
            .filter(|e| e.starts_with(&folder) && !e.ends_with('/'))
            .take(8)
            .cloned()
            .collect();
        let message = format!(
            "there is no {wanted}, which modelIdentifier = {identifier:?} asks for; there is {}",
            present.join(", ")
        );
        findings.archive("archive.binary", &folder, message);
    }
    // Something to run, and a library for this platform.
    let sources = !model.description.co_simulation.source_files.is_empty()
        || archive.entries().iter().any(|entry| entry.starts_with("sources/") && !entry.ends_with('/'));
    if libraries == 0 && !sources && !findings.any("archive.binary") {
        let message = format!(
            "there is no library under binaries/ and no source code, so nothing can be run; expected for this platform: \
             binaries/{PLATFORM}/{identifier}{}",
            std::env::consts::DLL_SUFFIX
        );
        findings.archive("archive.binary", "", message);
    } else if !archive.platforms().iter().any(|platform| platform == PLATFORM) {
        let present =
            if archive.platforms().is_empty() { "none".into() } else { archive.platforms().join(", ") };
        let message = format!("there is no library for this platform, {PLATFORM}; there is: {present}");
        findings.archive("archive.platform", "binaries/", message);
    }
}
