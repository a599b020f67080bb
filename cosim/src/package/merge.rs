//! Merges FMUs of the same content that were built on different systems into one with the binaries of all.
//!
//! Each platform owns the folders `binaries/<platform>/` and, if present, `resources/<platform>/`, where
//! plug-ins lie. Everything else must agree in all FMUs: the bytes of each file, and the content of the model
//! description.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::time::Duration;

use punctual_fmu::configuration::RESOURCE;
use punctual_modeldescription as written;

use super::difference;
use crate::error::{Error, FmuProblem};
use crate::host::Archive;
use crate::validate::{self, Report, Severity};

/// The greatest unpacked size of the merged FMU, in bytes, since it is assembled in memory.
pub const MAX_MERGED_BYTES: u64 = 1 << 30;

const MODEL_DESCRIPTION: &str = "modelDescription.xml";

/// Result of a merge.
#[derive(Clone, Debug)]
pub struct Merged {
    /// The model's name.
    pub model_name: String,
    /// The GUID, which all share.
    pub guid: String,
    /// The platforms, sorted, each with the file that its binaries come from.
    pub platforms: Vec<(String, PathBuf)>,
    /// Folders without files, which the merged FMU does not contain.
    pub left_out: Vec<String>,
    /// Findings of `validate` on the merged FMU.
    pub report: Report,
}

/// One of the FMUs.
struct Part {
    archive: Archive,
    description: String,
    files: BTreeSet<String>,
}

/// `binaries/<platform>/` or `resources/<platform>/`.
type Group<'a> = (&'a str, &'a str);

impl Part {
    fn open(path: &Path) -> Result<Self, Error> {
        let archive = Archive::open(path)?;
        let description = archive.model_description().map_err(|e| Error::fmu(path, e))?;
        let files = archive.entries().iter().filter(|entry| !entry.ends_with('/')).cloned().collect();
        Ok(Self { archive, description, files })
    }

    fn path(&self) -> &Path {
        self.archive.source()
    }

    fn read(&self, entry: &str) -> Result<Vec<u8>, Error> {
        std::fs::read(self.archive.path(entry)).map_err(|e| Error::io("read", &self.archive.path(entry), e))
    }

    fn size(&self, entry: &str) -> Result<u64, Error> {
        let path = self.archive.path(entry);
        Ok(std::fs::metadata(&path).map_err(|e| Error::io("read", &path, e))?.len())
    }

    /// Whether this program built it with a plug-in.
    fn has_plugin(&self) -> bool {
        let text = self.read(&format!("resources/{RESOURCE}")).unwrap_or_default();
        String::from_utf8_lossy(&text).contains("\nplugin_digest = ")
    }
}

fn unfit(path: &Path, reason: impl Into<String>) -> Error {
    Error::fmu(path, FmuProblem::Unfit(reason.into()))
}

fn broken(path: &Path) -> impl Fn(written::Error) -> Error {
    |e| Error::fmu(path, FmuProblem::Archive(e.to_string()))
}

/// The platform's folder that contains an entry, if any.
fn group<'a>(entry: &'a str, platforms: &BTreeSet<&str>) -> Option<Group<'a>> {
    let (root, rest) = entry.split_once('/')?;
    let (platform, _) = rest.split_once('/')?;
    (["binaries", "resources"].contains(&root) && platforms.contains(platform)).then_some((root, platform))
}

/// Merges the FMUs at `paths` and writes the result to `file`, which may be one of them. It is then examined
/// as `validate` does. `limit` is the time limit of the trial, which takes place if this system's platform is
/// among those merged. `None` skips the trial, and no code of an FMU is run. The order of `paths` does not
/// affect the bytes of the result.
///
/// # Errors
///
/// A file that cannot be read or written; FMUs that differ in more than their platforms, or in a platform
/// that both have; a result that does not work. `file` is then unchanged.
pub fn merge(paths: &[PathBuf], file: &Path, limit: Option<Duration>) -> Result<Merged, Error> {
    // Open the FMUs.
    let parts = paths.iter().map(|path| Part::open(path)).collect::<Result<Vec<_>, _>>()?;
    let Some((first, others)) = parts.split_first() else {
        return Err(Error::configuration("files", "are none, must be at least one"));
    };
    let platforms: BTreeSet<&str> =
        parts.iter().flat_map(|part| part.archive.platforms()).map(String::as_str).collect();
    // Everything outside the platforms' folders agrees.
    let (model_name, guid) = compare_descriptions(first, others)?;
    if let Some(part) = parts.iter().find(|part| part.archive.platforms().is_empty()) {
        return Err(unfit(part.path(), "there is nothing in its binaries/"));
    }
    for other in others {
        let common = |entry: &str| entry != MODEL_DESCRIPTION && group(entry, &platforms).is_none();
        compare(first, other, "", common)?;
    }
    // Each platform's folders come from one FMU; all others that have them have the same ones.
    let mut owners: BTreeMap<Group<'_>, &Part> = BTreeMap::new();
    for part in &parts {
        let groups: BTreeSet<_> = part.files.iter().filter_map(|entry| group(entry, &platforms)).collect();
        for own in groups {
            let owner = *owners.entry(own).or_insert(part);
            let context = format!("both are for {}, but ", own.1);
            compare(owner, part, &context, |entry| group(entry, &platforms) == Some(own))?;
        }
    }
    // The descriptions may differ in form with the same meaning. The least text is taken, so that the order
    // does not matter.
    let descriptions =
        parts.iter().map(|part| part.read(MODEL_DESCRIPTION)).collect::<Result<Vec<_>, _>>()?;
    let description = descriptions.into_iter().min().unwrap_or_default();
    // Assemble the merged FMU, within the limit.
    let mut total = description.len() as u64;
    let mut product = written::Archive::new().with_timestamp(super::timestamp()?);
    product.add(MODEL_DESCRIPTION, description).map_err(broken(first.path()))?;
    for part in &parts {
        for entry in part.files.iter().filter(|entry| *entry != MODEL_DESCRIPTION) {
            let owner = group(entry, &platforms).and_then(|own| owners.get(&own).copied()).unwrap_or(first);
            if !std::ptr::eq(owner, part) {
                continue;
            }
            total = total.saturating_add(part.size(entry)?);
            if total > MAX_MERGED_BYTES {
                let what = "merged and unpacked, the archive would have";
                let problem =
                    FmuProblem::Limit { what, value: total, unit: "bytes", allowed: MAX_MERGED_BYTES };
                return Err(Error::fmu(part.path(), problem));
            }
            product.add(entry, part.read(entry)?).map_err(broken(part.path()))?;
        }
    }
    // Examine the result, and report the folders left out.
    let empty = |folder: &&String| {
        let all = parts.iter().flat_map(|part| &part.files);
        folder.ends_with('/') && !all.clone().any(|entry| entry.starts_with(folder.as_str()))
    };
    let folders = parts.iter().flat_map(|part| part.archive.entries()).filter(empty);
    let left_out: BTreeSet<String> = folders.cloned().collect();
    let report = write(&product, file, limit)?;
    let from = |platform: &str| owners.get(&("binaries", platform)).map(|part| part.path().to_owned());
    let platforms = platforms.iter().filter_map(|&platform| Some((platform.to_owned(), from(platform)?)));
    Ok(Merged {
        model_name,
        guid,
        platforms: platforms.collect(),
        left_out: left_out.into_iter().collect(),
        report,
    })
}

/// The common name and GUID of all descriptions, if their contents agree.
fn compare_descriptions(first: &Part, others: &[Part]) -> Result<(String, String), Error> {
    let problem = |part: &Part, text| Error::fmu(part.path(), FmuProblem::Description(text));
    let there = difference::parse(&first.description).map_err(|e| problem(first, e))?;
    for other in others {
        let here = difference::parse(&other.description).map_err(|e| problem(other, e))?;
        let Some(difference) = difference::of(&here, &there) else { continue };
        let plugins = difference.starts_with("guid ") && first.has_plugin() && other.has_plugin();
        let advice = if plugins {
            "; the GUID of an FMU with a plug-in is made from its library too: build with a plugin_digest for every \
             platform (docs/plugin.md)"
        } else {
            ""
        };
        let reason =
            format!("{MODEL_DESCRIPTION} differs from {}'s: {difference}{advice}", first.path().display());
        return Err(unfit(other.path(), reason));
    }
    let attribute = |name| there.root_element().attribute(name).unwrap_or_default().to_owned();
    Ok((attribute("modelName"), attribute("guid")))
}

/// Refuses `other` if one of the files that `belong` differs from that in `first`.
fn compare(first: &Part, other: &Part, context: &str, belong: impl Fn(&str) -> bool) -> Result<(), Error> {
    let name = first.path().display();
    let refuse = |text: String| Err(unfit(other.path(), format!("{context}{text}")));
    for entry in first.files.union(&other.files).filter(|entry| belong(entry)) {
        if !other.files.contains(entry) {
            return refuse(format!("there is no {entry}, which {name} has"));
        }
        if !first.files.contains(entry) {
            return refuse(format!("there is {entry}, which {name} has not"));
        }
        let (mine, theirs) = (other.read(entry)?, first.read(entry)?);
        if mine != theirs {
            let same = mine.iter().zip(&theirs).take_while(|(a, b)| a == b).count();
            return refuse(format!(
                "{entry} differs from {name}'s: {} bytes, there {}; byte {} is the first that differs",
                mine.len(),
                theirs.len(),
                same + 1
            ));
        }
    }
    Ok(())
}

/// Writes the merged FMU beside `file`, examines it there, and moves it to `file`.
fn write(product: &written::Archive, file: &Path, limit: Option<Duration>) -> Result<Report, Error> {
    let bytes = product.to_bytes().map_err(broken(file))?;
    let failed = |e| Error::io("write", file, e);
    let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let place = tempfile::Builder::new().prefix(".punctual-").tempdir_in(folder).map_err(failed)?;
    let draft = place.path().join("product.fmu");
    std::fs::write(&draft, bytes).map_err(failed)?;
    let mut report = validate::validate(&draft, limit)?;
    for finding in &mut report.findings {
        let (from, to) = (draft.display().to_string(), file.display().to_string());
        finding.message = finding.message.replace(&from, &to);
    }
    // Other errors were there before. Only these rules can be broken by merging, or by this system's library.
    let rules = ["archive.readable", "archive.name", "archive.limit", "trial."];
    let fatal = report.findings.iter().find(|finding| {
        finding.severity == Severity::Error && rules.iter().any(|rule| finding.rule.starts_with(rule))
    });
    if let Some(finding) = fatal {
        return Err(unfit(file, format!("the product does not work here: {}", finding.message)));
    }
    std::fs::rename(&draft, file).map_err(failed)?;
    Ok(report)
}
