//! Makes the runs of a campaign on all cores and keeps their rows, so that it can be interrupted at any point and
//! resumed.
//!
//! Rows go to segments beside the output, in the folder `<output>.parts`. A segment holds the next runs in order.
//! It is written under another name, synchronised and renamed, so that it is there as a whole or not at all. When
//! all runs are there, the segments are joined. Their cuts do not show in the result.

use std::collections::BTreeMap;
use std::fs::{self, File, TryLockError};
use std::io::Write;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use rayon::iter::{IntoParallelIterator, ParallelIterator};
use rayon::{ThreadPool, ThreadPoolBuilder};

use super::arrow;
use super::file::{Campaign, Source};
use super::measures::Measures;
use super::table::{GROUP, Reader, Row, Writer};
use crate::coupling::{InProcess, Simulation};
use crate::error::Error;

/// Time that the runs of a segment take together: the most that is lost when the process is killed.
const SEGMENT: Duration = Duration::from_secs(3);
/// Largest growth of the number of runs from one segment to the next, as a factor.
const GROWTH: usize = 4;

/// Names of the texts in the metadata of a file.
pub(super) mod key {
    /// [`super::Source::fingerprint`].
    pub(crate) const FINGERPRINT: &str = "punctual.fingerprint";
    /// The version that made it.
    pub(crate) const VERSION: &str = "punctual.version";
    /// [`super::Source::file`].
    pub(crate) const FILE: &str = "punctual.campaign";
    /// [`super::Source::system`].
    pub(crate) const SYSTEM: &str = "punctual.system";
    /// [`super::Source::configurations`], each with its number after this.
    pub(crate) const CONFIGURATION: &str = "punctual.configuration.";
    /// Units and meanings of the columns, as JSON.
    pub(crate) const COLUMNS: &str = "punctual.columns";
}

/// Output and threads of a campaign.
#[derive(Clone, Debug)]
pub struct Options {
    /// The Parquet file.
    pub output: PathBuf,
    /// Number of runs made at once; default one for each core.
    pub threads: Option<NonZeroUsize>,
}

/// Progress of a campaign.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// Runs whose rows are kept.
    pub done: u64,
    /// Number of these runs that were there before.
    pub before: u64,
    /// Wall time of the others.
    pub wall_time: Duration,
}

/// The metadata of a campaign's files.
fn metadata(source: &Source, measures: &Measures) -> Vec<(String, String)> {
    let columns = serde_json::to_string(measures.columns()).unwrap_or_default();
    let mut texts = vec![
        (key::FINGERPRINT.to_owned(), source.fingerprint()),
        (key::VERSION.to_owned(), env!("CARGO_PKG_VERSION").to_owned()),
        (key::COLUMNS.to_owned(), columns),
        (key::FILE.to_owned(), source.file.clone()),
    ];
    texts.extend(source.system.iter().map(|text| (key::SYSTEM.to_owned(), text.clone())));
    let configurations = source.configurations.iter().enumerate();
    texts.extend(configurations.map(|(i, text)| (format!("{}{i}", key::CONFIGURATION), text.clone())));
    let schema = arrow::schema(measures.columns(), &texts);
    texts.push((arrow::KEY.to_owned(), schema));
    texts
}

/// The reader of the file at `path`, and the campaign that it belongs to.
///
/// # Errors
///
/// A file that cannot be read or is no campaign's.
pub fn recorded(path: &Path) -> Result<(Reader, Source), Error> {
    let reader = Reader::open(path)?;
    let Some(file) = reader.text(key::FILE) else {
        let message = format!("{} is not the result of a campaign", path.display());
        return Err(Error::configuration("", message));
    };
    let source = Source {
        file: file.to_owned(),
        system: reader.text(key::SYSTEM).map(str::to_owned),
        configurations: (0..)
            .map_while(|i| reader.text(&format!("{}{i}", key::CONFIGURATION)).map(str::to_owned))
            .collect(),
    };
    Ok((reader, source))
}

/// The version of this program that wrote the file.
pub fn version(reader: &Reader) -> &str {
    reader.text(key::VERSION).unwrap_or("unknown")
}

/// The folder of segments, which no other process uses.
struct Parts {
    folder: PathBuf,
    fingerprint: String,
    /// Held as long as this lives.
    _lock: File,
}

/// Segments by their first run, each with its number of runs and its path.
type Segments = BTreeMap<u64, (u64, PathBuf)>;

impl Parts {
    /// Opens the folder for `output`, which may exist from an earlier call.
    fn open(output: &Path, fingerprint: String) -> Result<Self, Error> {
        let mut name = output.as_os_str().to_owned();
        name.push(".parts");
        let folder = PathBuf::from(name);
        fs::create_dir_all(&folder).map_err(|e| Error::io("create", &folder, e))?;
        let lock_path = folder.join("lock");
        let lock = File::create(&lock_path).map_err(|e| Error::io("write", &lock_path, e))?;
        match lock.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                let message = format!("{} is in use by another campaign that is running", folder.display());
                return Err(Error::configuration("--output", message));
            }
            Err(TryLockError::Error(e)) => return Err(Error::io("lock", &lock_path, e)),
        }
        let parts = Self { folder, fingerprint, _lock: lock };
        let identity = parts.folder.join("fingerprint");
        match fs::read_to_string(&identity) {
            Ok(found) if found == parts.fingerprint => {}
            Ok(found) => return Err(other_campaign(&parts.folder, &found, &parts.fingerprint)),
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => {
                let new = parts.unfinished();
                let written = File::create(&new).and_then(|mut file| {
                    file.write_all(parts.fingerprint.as_bytes())?;
                    file.sync_all()
                });
                written.map_err(|e| Error::io("write", &new, e))?;
                parts.settle(&new, &identity)?;
            }
            Err(e) => return Err(Error::io("read", &identity, e)),
        }
        Ok(parts)
    }

    /// Path of a file that is not complete yet.
    fn unfinished(&self) -> PathBuf {
        self.folder.join("unfinished")
    }

    /// Renames a file that is complete on the disk.
    fn settle(&self, from: &Path, to: &Path) -> Result<(), Error> {
        fs::rename(from, to).map_err(|e| Error::io("write", to, e))?;
        let folder = to.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        // Not every system can synchronise a folder; a segment that is lost is made again.
        let _ = File::open(folder).and_then(|folder| folder.sync_all());
        Ok(())
    }

    /// The segments that are there, without a gap from run 0 on.
    fn segments(&self) -> Result<Segments, Error> {
        let problem = |e| Error::io("read", &self.folder, e);
        let mut found = Segments::new();
        for entry in fs::read_dir(&self.folder).map_err(problem)? {
            let path = entry.map_err(problem)?.path();
            let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
            let numbers = name.strip_prefix("runs-").and_then(|rest| rest.strip_suffix(".parquet"));
            let Some((first, next)) = numbers.and_then(|numbers| numbers.split_once('-')) else { continue };
            if let (Ok(first), Ok(next)) = (first.parse::<u64>(), next.parse::<u64>()) {
                found.insert(first, (next.saturating_sub(first), path));
            }
        }
        let mut done = 0;
        for (first, (count, path)) in &found {
            if *first != done {
                let message = format!("the runs {done} to {} are missing before it; remove it", first - 1);
                return Err(Error::io("use", path, std::io::Error::other(message)));
            }
            done += count;
        }
        Ok(found)
    }

    /// Removes the folder with all its files.
    fn remove(self) -> Result<(), Error> {
        // The last goes first, so that the rest of an interrupted removal has no gap.
        for (_, path) in self.segments()?.values().rev() {
            fs::remove_file(path).map_err(|e| Error::io("remove", path, e))?;
        }
        for name in ["unfinished", "fingerprint", "lock"] {
            let path = self.folder.join(name);
            match fs::remove_file(&path) {
                Err(e) if e.kind() != std::io::ErrorKind::NotFound => {
                    return Err(Error::io("remove", &path, e));
                }
                _ => {}
            }
        }
        fs::remove_dir(&self.folder).map_err(|e| Error::io("remove", &self.folder, e))
    }
}

fn other_campaign(path: &Path, found: &str, wanted: &str) -> Error {
    let message = format!(
        "{} is of another campaign (fingerprint {found}, must be {wanted}): its file, its components or the version \
         of this program differ. Remove it, or give another output",
        path.display()
    );
    Error::configuration("--output", message)
}

/// Whether `output` is the complete result of `campaign`.
///
/// # Errors
///
/// It is of another campaign, or cannot be read.
fn complete(campaign: &Campaign, output: &Path) -> Result<bool, Error> {
    if !output.exists() {
        return Ok(false);
    }
    let (reader, _) = recorded(output)?;
    let (found, wanted) = (reader.text(key::FINGERPRINT).unwrap_or("none"), campaign.source().fingerprint());
    if found == wanted { Ok(true) } else { Err(other_campaign(output, found, &wanted)) }
}

/// Makes the runs that are not there yet. Ends early once `stop` is set; then it keeps all complete runs with no
/// gap before them. `tell` gets the number of runs made so far.
///
/// # Errors
///
/// Files of another campaign in the way; a file that cannot be read or written.
pub fn run(
    campaign: &Campaign,
    options: &Options,
    stop: &AtomicBool,
    tell: &(dyn Fn(u64) + Sync),
) -> Result<Progress, Error> {
    let runs = campaign.runs();
    let fingerprint = campaign.source().fingerprint();
    if complete(campaign, &options.output)? {
        let mut folder = options.output.as_os_str().to_owned();
        folder.push(".parts");
        if Path::new(&folder).exists() {
            // The last process was killed between its last two steps.
            Parts::open(&options.output, fingerprint)?.remove()?;
        }
        return Ok(Progress { done: runs, before: runs, wall_time: Duration::ZERO });
    }
    let measures = Measures::new(campaign);
    let parts = Parts::open(&options.output, fingerprint)?;
    let mut segments = parts.segments()?;
    let before: u64 = segments.values().map(|(count, _)| count).sum();
    let begin = Instant::now();
    if before < runs {
        let crew = Crew::new(campaign, &measures, options.threads)?;
        crew.work(before, stop, tell, |first, rows| {
            let next = first + rows.len() as u64;
            let path = parts.folder.join(format!("runs-{first:016}-{next:016}.parquet"));
            let count = next - first;
            let mut writer = Writer::create(&parts.unfinished(), measures.columns(), &[])?;
            rows.into_iter().try_for_each(|row| writer.push(row))?;
            writer.finish()?;
            parts.settle(&parts.unfinished(), &path)?;
            segments.insert(first, (count, path));
            Ok(())
        })?;
    }
    let wall_time = begin.elapsed();
    let done: u64 = segments.values().map(|(count, _)| count).sum();
    if done == runs {
        join(campaign, &measures, &parts, &segments)?;
        parts.settle(&parts.unfinished(), &options.output)?;
        parts.remove()?;
    }
    Ok(Progress { done, before, wall_time })
}

/// The rows of an interrupted campaign that are kept beside `output`; `None` where there are none.
///
/// # Errors
///
/// Another process has gone on with it; a file that cannot be read or written.
pub fn kept(campaign: &Campaign, output: &Path) -> Result<Option<Reader>, Error> {
    let parts = Parts::open(output, campaign.source().fingerprint())?;
    let segments = parts.segments()?;
    if segments.is_empty() {
        return Ok(None);
    }
    join(campaign, &Measures::new(campaign), &parts, &segments)?;
    Reader::open(&parts.unfinished()).map(Some)
}

/// Writes all rows into one file, a group at a time.
fn join(campaign: &Campaign, measures: &Measures, parts: &Parts, segments: &Segments) -> Result<(), Error> {
    let metadata = metadata(campaign.source(), measures);
    let mut writer = Writer::create(&parts.unfinished(), measures.columns(), &metadata)?;
    for (count, path) in segments.values() {
        let reader = Reader::open(path)?;
        if reader.rows() != *count {
            let message = format!("it has {} rows, must have {count}; remove it", reader.rows());
            return Err(Error::io("use", path, std::io::Error::other(message)));
        }
        for group in 0..reader.groups() {
            reader.group(group, measures.columns())?.into_iter().try_for_each(|row| writer.push(row))?;
        }
    }
    writer.finish()
}

/// The threads and their simulations.
struct Crew<'a> {
    campaign: &'a Campaign,
    measures: &'a Measures,
    pool: ThreadPool,
    /// Simulations by thread; each is only ever used by its own.
    simulations: Vec<Mutex<Simulation<InProcess>>>,
}

impl<'a> Crew<'a> {
    fn new(
        campaign: &'a Campaign,
        measures: &'a Measures,
        threads: Option<NonZeroUsize>,
    ) -> Result<Self, Error> {
        let system = campaign.system().clone().recording(measures.signals());
        let pool = ThreadPoolBuilder::new()
            .num_threads(threads.map_or(0, NonZeroUsize::get))
            .build()
            .map_err(|e| Error::configuration("--threads", e.to_string()))?;
        let simulations = (0..pool.current_num_threads())
            .map(|_| campaign.simulation(&system).map(Mutex::new))
            .collect::<Result<_, _>>()?;
        Ok(Self { campaign, measures, pool, simulations })
    }

    /// Makes the runs from `first` on, and gives their rows to `keep` in order, some at a time.
    fn work(
        &self,
        first: u64,
        stop: &AtomicBool,
        tell: &(dyn Fn(u64) + Sync),
        mut keep: impl FnMut(u64, Vec<Row>) -> Result<(), Error>,
    ) -> Result<(), Error> {
        let done = AtomicU64::new(first);
        let mut next = first;
        let mut size = self.simulations.len();
        while next < self.campaign.runs() && !stop.load(Ordering::Relaxed) {
            let end = self.campaign.runs().min(next + size as u64);
            let begin = Instant::now();
            let make = |number: u64| {
                if stop.load(Ordering::Relaxed) {
                    return None;
                }
                let row = self.make(number);
                tell(done.fetch_add(1, Ordering::Relaxed) + 1);
                Some(row)
            };
            let rows: Vec<Option<Row>> =
                self.pool.install(|| (next..end).into_par_iter().map(make).collect());
            let rows: Vec<Row> = rows.into_iter().map_while(|row| row).collect();
            let ratio = SEGMENT.as_secs_f64() / begin.elapsed().as_secs_f64().max(1e-6);
            size = ((size as f64 * ratio) as usize).clamp(self.simulations.len(), size * GROWTH).min(GROUP);
            let first = next;
            next += rows.len() as u64;
            if next > first {
                keep(first, rows)?;
            }
        }
        Ok(())
    }

    fn make(&self, number: u64) -> Row {
        let thread = rayon::current_thread_index().unwrap_or(0) % self.simulations.len();
        // A run that panicked leaves nothing behind, since the next one begins with a reset.
        let mut simulation =
            self.simulations[thread].lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        self.measures.run(self.campaign, &mut simulation, number)
    }
}
