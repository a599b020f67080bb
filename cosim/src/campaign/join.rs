//! Joins the parts of a campaign that several machines made into the file that one machine would have made.

use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};

use super::file::{Campaign, Source};
use super::measures::Measures;
use super::runner::{self, Parts};
use super::table::{Reader, Writer};
use crate::error::Error;

/// A part: its runs and its file.
struct Part {
    runs: Range<u64>,
    path: PathBuf,
}

/// Joins the parts in `files` into `output`, byte for byte what one machine would have written. A folder
/// stands for all `.parquet` files in it, except complete results of this campaign. An `output` that is
/// already complete is kept.
///
/// # Errors
///
/// A part that is missing, duplicated, incomplete, or of another campaign; a file that cannot be read or
/// written.
pub fn join(campaign: &Campaign, files: &[PathBuf], output: &Path) -> Result<(), Error> {
    let measures = Measures::new(campaign)?;
    let mut parts = Vec::new();
    for path in listed(campaign, files)? {
        parts.push(checked(campaign, path)?);
    }
    parts.sort_by_key(|part| (part.runs.start, part.runs.end));
    let missing = |runs: Range<u64>| {
        let message = format!(
            "the runs {0}..{1} are in none of the {2} files; `--shard {0}..{1}` makes them",
            runs.start,
            runs.end,
            parts.len()
        );
        Error::configuration("--join", message)
    };
    let mut due = 0;
    for (i, part) in parts.iter().enumerate() {
        if part.runs.start > due {
            return Err(missing(due..part.runs.start));
        }
        if part.runs.start < due {
            let (one, other) = (&parts[i - 1].path, &part.path);
            let runs = part.runs.start..due.min(part.runs.end);
            let message = format!(
                "the runs {}..{} are both in {} and in {}; leave one out",
                runs.start,
                runs.end,
                one.display(),
                other.display()
            );
            return Err(Error::configuration("--join", message));
        }
        due = part.runs.end;
    }
    if due < campaign.runs() {
        return Err(missing(due..campaign.runs()));
    }
    if runner::complete(campaign, output, &(0..campaign.runs()))? {
        return Ok(());
    }
    let folder = Parts::open(output, campaign, None)?;
    let metadata = runner::metadata(campaign.source(), &measures, None);
    let written = || {
        let mut writer = Writer::create(&folder.unfinished(), measures.columns(), &metadata)?;
        for Part { runs, path } in &parts {
            runner::each_row(&Reader::open(path)?, path, runs, &measures, |row| writer.push(row))?;
        }
        writer.finish()
    };
    if let Err(error) = written() {
        folder.remove()?;
        return Err(error);
    }
    folder.settle(&folder.unfinished(), output)?;
    folder.remove()
}

/// The files that `files` stand for.
fn listed(campaign: &Campaign, files: &[PathBuf]) -> Result<Vec<PathBuf>, Error> {
    // A file that cannot be read counts as a part, and is reported as one.
    let is_result = |file: &Path| {
        runner::recorded(file).is_ok_and(|(reader, source)| {
            source == *campaign.source()
                && runner::runs(&reader) == (0..campaign.runs())
                && !runner::is_part(&reader)
        })
    };
    let mut all = Vec::new();
    for path in files {
        if !path.is_dir() {
            all.push(path.clone());
            continue;
        }
        let problem = |e| Error::io("read", path, e);
        for entry in fs::read_dir(path).map_err(problem)? {
            let file = entry.map_err(problem)?.path();
            if file.extension().is_some_and(|ending| ending == "parquet") && !is_result(&file) {
                all.push(file);
            }
        }
    }
    Ok(all)
}

/// The part in the file at `path`, if it belongs to `campaign`.
fn checked(campaign: &Campaign, path: PathBuf) -> Result<Part, Error> {
    let refused = |message: String| Error::configuration("--join", format!("{} {message}", path.display()));
    let unfinished = runner::parts_folder(&path);
    if !path.exists() && unfinished.exists() {
        let message = format!(
            "is not complete: what is there is in {}, and the same --shard goes on",
            unfinished.display()
        );
        return Err(refused(message));
    }
    if !path.exists() {
        return Err(refused("is not there".to_owned()));
    }
    let (reader, source) = runner::recorded(&path).map_err(|e| {
        refused(format!("is not part of a campaign, or is incomplete: {e}; make it again with --shard"))
    })?;
    let (theirs, ours) = (runner::version(&reader), env!("CARGO_PKG_VERSION"));
    if theirs != ours {
        return Err(refused(format!("was made by version {theirs} of this program, this is version {ours}")));
    }
    if source != *campaign.source() || runner::fingerprint(&reader) != source.fingerprint() {
        return Err(refused(format!(
            "is a part of another campaign: {}",
            difference(campaign, &source, &path)
        )));
    }
    let runs = runner::runs(&reader);
    if runs.end > campaign.runs() {
        let message =
            format!("has the runs {}..{}, must end at most at {}", runs.start, runs.end, campaign.runs());
        return Err(refused(message));
    }
    Ok(Part { runs, path })
}

/// What distinguishes the campaign of a part from this one.
fn difference(campaign: &Campaign, theirs: &Source, path: &Path) -> String {
    let ours = campaign.source();
    if theirs.file != ours.file {
        return match Campaign::of(theirs.clone(), path, path) {
            Ok(other) if other.seed() != campaign.seed() => {
                format!("its seed is {}, must be {}", other.seed(), campaign.seed())
            }
            Ok(other) if other.runs() != campaign.runs() => {
                format!("it is one of {} runs, must be of {}", other.runs(), campaign.runs())
            }
            _ => "its campaign file has another text".to_owned(),
        };
    }
    if theirs.system != ours.system {
        return "its system file has another text".to_owned();
    }
    let pairs = theirs.configurations.iter().zip(&ours.configurations).zip(campaign.system().components());
    let other = pairs.into_iter().find(|((theirs, ours), _)| theirs != ours);
    other.map_or_else(
        || "its fingerprint does not match its texts".to_owned(),
        |(_, component)| format!("its component {:?} has another configuration", component.name),
    )
}
