//! Rules on the entries of the archive (FMI 2.0.4, section 2.3; FMI 3.0.2, section 2.5.1).

use super::companions::BUILD;
use super::finding::Findings;
use super::model::Model;
use crate::host::{Archive, Version};

/// Entries allowed at the top of the archive of FMI 2.0.
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

/// The same for FMI 3.0.
const TOP_OF_FMI3: [&str; 7] = [
    "modelDescription.xml",
    "documentation",
    "terminalsAndIcons",
    "sources",
    "binaries",
    "resources",
    "extra",
];

/// The file extension of libraries in a folder of `binaries/` in FMI 2.0, by the beginning of the folder's
/// name.
const ENDINGS: [(&str, &str); 5] = [
    ("win", ".dll"),
    ("aarch64-windows", ".dll"),
    ("linux", ".so"),
    ("aarch64-linux", ".so"),
    ("darwin", ".dylib"),
];

/// The same for FMI 3.0, by the system in the name.
const ENDINGS_OF_FMI3: [(&str, &str); 3] = [("windows", ".dll"), ("linux", ".so"), ("darwin", ".dylib")];

/// The processors in names of folders of FMI 3.0.
const ARCHITECTURES: [&str; 4] = ["aarch32", "aarch64", "x86", "x86_64"];

/// Companion files that entries of FMI 3.0 require: the rule, a path or a prefix of one, and the entries of
/// which one is required.
const COMPANIONS: [(&str, &str, &[&str]); 5] = [
    (
        "archive.companion",
        "documentation/licenses/",
        &[
            "documentation/licenses/license.txt",
            "documentation/licenses/license.html",
            "documentation/licenses/license.spdx",
        ],
    ),
    ("archive.companion", "documentation/diagram.svg", &["documentation/diagram.png"]),
    ("archive.companion", "terminalsAndIcons/icon.svg", &["terminalsAndIcons/icon.png"]),
    ("archive.index", "documentation/", &["documentation/index.html"]),
    // Tools put sources beside their libraries for reading, not for building.
    ("archive.index", "sources/", &[BUILD]),
];

/// The file extension of libraries for a platform, if the standard names the platform.
pub(crate) fn ending(version: Version, platform: &str) -> Option<&'static str> {
    match version {
        Version::Fmi2 => {
            ENDINGS.iter().find(|(head, _)| platform.starts_with(head)).map(|(_, ending)| *ending)
        }
        Version::Fmi3 => {
            let (architecture, system) = platform.split_once('-')?;
            let known = ENDINGS_OF_FMI3.iter().find(|(name, _)| *name == system);
            known.filter(|_| ARCHITECTURES.contains(&architecture)).map(|(_, ending)| *ending)
        }
    }
}

pub(super) fn check(archive: &Archive, model: &Model, findings: &mut Findings) {
    // Entries at the top.
    let version = model.version();
    let allowed: &[&str] = match version {
        Version::Fmi2 => &TOP,
        Version::Fmi3 => &TOP_OF_FMI3,
    };
    let mut odd: Vec<&str> = archive.entries().iter().filter_map(|entry| entry.split('/').next()).collect();
    odd.retain(|top| !allowed.contains(top));
    odd.sort_unstable();
    odd.dedup();
    for top in odd {
        let message = format!("{top:?} at the top of the archive; the standard has {}", allowed.join(", "));
        findings.archive("archive.top-folder", top, message);
    }
    if version == Version::Fmi3 {
        companions(archive, findings);
    }
    // The library of each platform.
    let identifiers = model.identifiers();
    let Some(first) = identifiers.first() else { return };
    let mut libraries = 0;
    for platform in archive.platforms() {
        let Some(ending) = ending(version, platform) else { continue };
        for identifier in &identifiers {
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
    }
    // At least one library or sources, and a library for this platform.
    let own = version.platform();
    let is_source = |entry: &String| match version {
        Version::Fmi2 => entry.starts_with("sources/") && !entry.ends_with('/'),
        Version::Fmi3 => entry == BUILD,
    };
    let sources = model.names_sources() || archive.entries().iter().any(is_source);
    if libraries == 0 && !sources && !findings.any("archive.binary") {
        let message = format!(
            "there is no library under binaries/ and no source code, so nothing can be run; expected for this platform: \
             binaries/{own}/{first}{}",
            std::env::consts::DLL_SUFFIX
        );
        findings.archive("archive.binary", "", message);
    } else if !archive.platforms().iter().any(|platform| platform == own) {
        let present =
            if archive.platforms().is_empty() { "none".into() } else { archive.platforms().join(", ") };
        let message = format!("there is no library for this platform, {own}; there is: {present}");
        findings.archive("archive.platform", "binaries/", message);
    }
}

/// Checks the companion files that other entries require.
fn companions(archive: &Archive, findings: &mut Findings) {
    let entries = archive.entries();
    for (rule, given, needed) in COMPANIONS {
        let is_given = |entry: &&String| {
            if given.ends_with('/') {
                entry.starts_with(given) && !entry.ends_with('/')
            } else {
                *entry == given
            }
        };
        let missing = !entries.iter().any(|entry| needed.contains(&entry.as_str()));
        if let Some(entry) = entries.iter().find(is_given).filter(|_| missing) {
            let message = format!("there is {entry}, but no {}", needed.join(" or "));
            findings.archive(rule, given, message);
        }
    }
}
