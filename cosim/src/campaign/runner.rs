//! Makes the runs of a campaign on all cores and keeps their rows, so that it can be interrupted at any point and
//! resumed.
//!
//! Rows go to segments beside the output, in the folder `<output>.parts`. Each segment holds consecutive
//! runs. It is written under a temporary name, synchronised and renamed, so that it is there completely or
//! not at all. When all runs are there, the segments are joined. The result does not depend on where they
//! were cut. A part of the runs is made in the same way, and its file records which runs they are.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::fs::{self, File, TryLockError};
use std::io::Write;
use std::num::NonZeroUsize;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use rayon::iter::{IntoParallelIterator, ParallelIterator};
use rayon::{ThreadPool, ThreadPoolBuilder};

use super::arrow;
use super::file::{Campaign, Choice, Source};
use super::measures::Measures;
use super::table::{Cell, Checksum, GROUP, Reader, Row, Writer};
use crate::coupling::Simulation;
use crate::error::Error;

/// Time that the runs of one segment take together, and so the most work that is lost if the process is
/// killed.
const SEGMENT: Duration = Duration::from_secs(3);
/// The largest factor by which the number of runs grows from one segment to the next.
const GROWTH: usize = 4;

/// Keys of the texts in the metadata of a file.
pub(super) mod key {
    /// [`super::Source::fingerprint`].
    pub(crate) const FINGERPRINT: &str = "punctual.fingerprint";
    /// The version that made it.
    pub(crate) const VERSION: &str = "punctual.version";
    /// [`super::Source::file`].
    pub(crate) const FILE: &str = "punctual.campaign";
    /// [`super::Source::system`].
    pub(crate) const SYSTEM: &str = "punctual.system";
    /// [`super::Source::configurations`]; the number of each follows this prefix.
    pub(crate) const CONFIGURATION: &str = "punctual.configuration.";
    /// Units and meanings of the columns, as JSON.
    pub(crate) const COLUMNS: &str = "punctual.columns";
    /// In a part: its first run and the one after its last, `FIRST..NEXT`.
    pub(crate) const RUNS: &str = "punctual.runs";
}

/// Output, runs and threads of a campaign.
#[derive(Clone, Debug)]
pub struct Options {
    /// The Parquet file.
    pub output: PathBuf,
    /// The range of runs to make; `None` for all.
    pub runs: Option<Range<u64>>,
    /// Number of runs made at once; default one for each core.
    pub threads: Option<NonZeroUsize>,
}

/// Progress of a campaign.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// Runs whose rows are kept.
    pub done: u64,
    /// Number of these that an earlier call had made.
    pub before: u64,
    /// Number of runs that were repeated because the file with their rows was damaged.
    pub again: u64,
    /// Wall time of the runs made in this call.
    pub wall_time: Duration,
}

/// The metadata of a campaign's files; `runs` is the range of a part.
pub(super) fn metadata(
    source: &Source,
    measures: &Measures,
    runs: Option<&Range<u64>>,
) -> Vec<(String, String)> {
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
    texts.extend(runs.map(|runs| (key::RUNS.to_owned(), format!("{}..{}", runs.start, runs.end))));
    let schema = arrow::schema(measures.columns(), &texts);
    texts.push((arrow::KEY.to_owned(), schema));
    texts
}

/// The reader of the file at `path`, and the campaign that it belongs to.
///
/// # Errors
///
/// A file that cannot be read or belongs to no campaign.
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

/// Whether the file holds a part of a campaign.
pub(super) fn is_part(reader: &Reader) -> bool {
    reader.text(key::RUNS).is_some()
}

/// The numbers of the runs in a file: the range of a part, or all from 0 on.
pub fn runs(reader: &Reader) -> Range<u64> {
    let part = reader.text(key::RUNS).and_then(|text| text.split_once(".."));
    let first = part.and_then(|(first, _)| first.parse().ok()).unwrap_or(0);
    first..first.saturating_add(reader.rows())
}

/// The folder of segments, locked against other processes.
pub(super) struct Parts {
    folder: PathBuf,
    /// The fingerprint of the campaign; for a part, with its range of runs.
    identity: String,
    /// The runs that belong here.
    runs: Range<u64>,
    /// The lock, held as long as this value lives.
    lock: File,
}

/// Segments by their first run, each with its number of runs and its path.
type Segments = BTreeMap<u64, (u64, PathBuf)>;

impl Parts {
    /// Opens the folder for `output`, which may exist from an earlier call.
    pub(super) fn open(output: &Path, campaign: &Campaign, runs: Option<&Range<u64>>) -> Result<Self, Error> {
        let mut identity = campaign.source().fingerprint();
        if let Some(runs) = runs {
            identity += &format!(", runs {}..{}", runs.start, runs.end);
        }
        let folder = parts_folder(output);
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
        let runs = runs.cloned().unwrap_or(0..campaign.runs());
        let parts = Self { folder, identity, runs, lock };
        let identity = parts.folder.join("fingerprint");
        match fs::read_to_string(&identity) {
            Ok(found) if found == parts.identity => {}
            Ok(found) => return Err(other_campaign(&parts.folder, &found, &parts.identity)),
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => {
                let new = parts.unfinished();
                let written = File::create(&new).and_then(|mut file| {
                    file.write_all(parts.identity.as_bytes())?;
                    file.sync_all()
                });
                written.map_err(|e| Error::io("write", &new, e))?;
                parts.settle(&new, &identity)?;
            }
            Err(e) => return Err(Error::io("read", &identity, e)),
        }
        Ok(parts)
    }

    /// The fingerprint of the campaign; for a part, with its range of runs.
    pub(super) fn identity(&self) -> &str {
        &self.identity
    }

    /// Path of a file that is not complete yet.
    pub(super) fn unfinished(&self) -> PathBuf {
        self.folder.join("unfinished")
    }

    /// Path of another file in the folder.
    pub(super) fn file(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    /// Gives a file that is complete on the disk its final name.
    pub(super) fn settle(&self, from: &Path, to: &Path) -> Result<(), Error> {
        fs::rename(from, to).map_err(|e| Error::io("write", to, e))?;
        let folder = to.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        // Some systems cannot synchronise a folder. If a segment is lost, its runs are made again.
        let _ = File::open(folder).and_then(|folder| folder.sync_all());
        Ok(())
    }

    /// The segments in the folder, none of which overlap.
    fn segments(&self) -> Result<Segments, Error> {
        let problem = |e| Error::io("read", &self.folder, e);
        let mut found = Vec::new();
        for entry in fs::read_dir(&self.folder).map_err(problem)? {
            let path = entry.map_err(problem)?.path();
            let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
            let numbers = name.strip_prefix("runs-").and_then(|rest| rest.strip_suffix(".parquet"));
            let Some((first, next)) = numbers.and_then(|numbers| numbers.split_once('-')) else { continue };
            if let (Ok(first), Ok(next)) = (first.parse::<u64>(), next.parse::<u64>()) {
                found.push((first, next, path));
            }
        }
        found.sort();
        let mut due = self.runs.start;
        for (first, next, path) in &found {
            if *first < due || *first >= *next || *next > self.runs.end {
                let message =
                    format!("its runs {first}..{next} are there twice, or none of those to make; remove it");
                return Err(Error::io("use", path, std::io::Error::other(message)));
            }
            due = *next;
        }
        Ok(found.into_iter().map(|(first, next, path)| (first, (next - first, path))).collect())
    }

    /// The complete segments, and the number of runs in the damaged ones, which are removed.
    fn whole_segments(&self, measures: &Measures) -> Result<(Segments, u64), Error> {
        let (mut whole, mut damaged) = (Segments::new(), 0);
        for (first, (count, path)) in self.segments()? {
            // A segment that cannot be opened may still be complete, so it is not removed.
            File::open(&path).map_err(|e| Error::io("read", &path, e))?;
            let runs = first..first + count;
            let rows = Reader::open(&path).and_then(|r| each_row(&r, &path, &runs, measures, |_| Ok(())));
            if rows.is_ok() {
                whole.insert(first, (count, path));
            } else {
                fs::remove_file(&path).map_err(|e| Error::io("remove", &path, e))?;
                damaged += count;
            }
        }
        Ok((whole, damaged))
    }

    /// Removes the folder with all its files.
    pub(super) fn remove(self) -> Result<(), Error> {
        for (_, path) in self.segments()?.values() {
            fs::remove_file(path).map_err(|e| Error::io("remove", path, e))?;
        }
        // On Windows, a folder with an open file cannot be removed.
        drop(self.lock);
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

/// The folder of segments beside `output`.
pub(super) fn parts_folder(output: &Path) -> PathBuf {
    let mut name = output.as_os_str().to_owned();
    name.push(".parts");
    PathBuf::from(name)
}

pub(super) fn other_campaign(path: &Path, found: &str, wanted: &str) -> Error {
    let message = format!(
        "{} is of another campaign (fingerprint {found}, must be {wanted}): its file, its components or the version \
         of this program differ. Remove it, or give another output",
        path.display()
    );
    Error::configuration("--output", message)
}

/// Whether `output` is the complete result of `campaign`, or of these runs of it.
///
/// # Errors
///
/// It belongs to another campaign, has other runs of it, or cannot be read.
pub(super) fn complete(campaign: &Campaign, output: &Path, wanted_runs: &Range<u64>) -> Result<bool, Error> {
    if !output.exists() {
        return Ok(false);
    }
    let (reader, _) = recorded(output).map_err(|e| {
        let message = format!("{} already exists: {e}; remove it, or give another output", output.display());
        Error::configuration("--output", message)
    })?;
    let (found, wanted) = (fingerprint(&reader), campaign.source().fingerprint());
    if found != wanted {
        return Err(other_campaign(output, found, &wanted));
    }
    let found = runs(&reader);
    if found != *wanted_runs {
        let message = format!(
            "{} has the runs {}..{} of this campaign, must have {}..{}; remove it, or give another output",
            output.display(),
            found.start,
            found.end,
            wanted_runs.start,
            wanted_runs.end
        );
        return Err(Error::configuration("--output", message));
    }
    Ok(true)
}

/// The fingerprint recorded in a file.
pub(super) fn fingerprint(reader: &Reader) -> &str {
    reader.text(key::FINGERPRINT).unwrap_or("none")
}

/// Makes the runs that are missing. Ends early once `stop` is set, and then keeps the runs made so far up to
/// the first gap. `tell` gets the number of runs made so far.
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
    let runs = options.runs.clone().unwrap_or(0..campaign.runs());
    let all = runs.end - runs.start;
    if complete(campaign, &options.output, &runs)? {
        if parts_folder(&options.output).exists() {
            // The last process was killed after it wrote the result and before it removed the folder.
            Parts::open(&options.output, campaign, options.runs.as_ref())?.remove()?;
        }
        return Ok(Progress { done: all, before: all, again: 0, wall_time: Duration::ZERO });
    }
    let measures = Measures::new(campaign)?;
    let parts = Parts::open(&options.output, campaign, options.runs.as_ref())?;
    let (mut segments, again) = parts.whole_segments(&measures)?;
    let before: u64 = segments.values().map(|(count, _)| count).sum();
    let begin = Instant::now();
    if before < all {
        let crew = Crew::new(campaign, &measures, options.threads)?;
        let mut done = before;
        for gap in gaps(&segments, &runs) {
            let reported = |made| tell(done + made);
            let made = crew.work(gap, stop, &reported, |first, rows| {
                let next = first + rows.len() as u64;
                let path = parts.folder.join(format!("runs-{first:016}-{next:016}.parquet"));
                let mut writer = Writer::create(&parts.unfinished(), measures.columns(), &[])?;
                rows.into_iter().try_for_each(|row| writer.push(row))?;
                writer.finish()?;
                parts.settle(&parts.unfinished(), &path)?;
                segments.insert(first, (next - first, path));
                Ok(())
            })?;
            done += made;
        }
    }
    let wall_time = begin.elapsed();
    let done: u64 = segments.values().map(|(count, _)| count).sum();
    if done == all {
        gather(campaign, options.runs.as_ref(), &measures, &parts, &segments)?;
        parts.settle(&parts.unfinished(), &options.output)?;
        parts.remove()?;
    }
    Ok(Progress { done, before, again, wall_time })
}

/// The ranges of `runs` that no segment covers.
fn gaps(segments: &Segments, runs: &Range<u64>) -> Vec<Range<u64>> {
    let ends = segments.iter().map(|(first, (count, _))| (*first, first + count));
    let mut due = runs.start;
    let mut gaps = Vec::new();
    for (first, next) in ends.chain([(runs.end, runs.end)]) {
        if due < first {
            gaps.push(due..first);
        }
        due = next;
    }
    gaps
}

/// The rows of an interrupted campaign that are kept beside `output`; `None` if there are none.
///
/// # Errors
///
/// Another process has resumed it; a file that cannot be read or written.
pub fn kept(campaign: &Campaign, output: &Path) -> Result<Option<Reader>, Error> {
    let parts = Parts::open(output, campaign, None)?;
    let segments = parts.segments()?;
    if segments.is_empty() {
        return Ok(None);
    }
    gather(campaign, None, &Measures::new(campaign)?, &parts, &segments)?;
    Reader::open(&parts.unfinished()).map(Some)
}

/// Writes the rows of all `segments` of the campaign, or of its `runs`, into one file.
fn gather(
    campaign: &Campaign,
    runs: Option<&Range<u64>>,
    measures: &Measures,
    parts: &Parts,
    segments: &Segments,
) -> Result<(), Error> {
    let metadata = metadata(campaign.source(), measures, runs);
    let mut writer = Writer::create(&parts.unfinished(), measures.columns(), &metadata)?;
    for (first, (count, path)) in segments {
        each_row(&Reader::open(path)?, path, &(*first..first + count), measures, |row| writer.push(row))?;
    }
    writer.finish()
}

/// Passes the rows of the file at `path` to `take`, one group at a time. The rows must be those of `runs` and
/// have the checksum they were written with.
pub(super) fn each_row(
    reader: &Reader,
    path: &Path,
    runs: &Range<u64>,
    measures: &Measures,
    mut take: impl FnMut(Row) -> Result<(), Error>,
) -> Result<(), Error> {
    let wrong = |message: String| Error::io("use", path, std::io::Error::other(message));
    if reader.rows() != runs.end - runs.start {
        let message =
            format!("it has {} rows, must have {}; make it again", reader.rows(), runs.end - runs.start);
        return Err(wrong(message));
    }
    let (mut due, mut checksum) = (runs.start, Checksum::default());
    for group in 0..reader.groups() {
        for row in reader.group(group, measures.columns())? {
            match row.first() {
                Some(Cell::Count(run)) if *run == due => due += 1,
                _ => return Err(wrong(format!("run {due} is not in its place; make it again"))),
            }
            checksum.add(&row);
            take(row)?;
        }
    }
    match reader.is_whole(&checksum) {
        true => Ok(()),
        false => {
            Err(wrong("its rows are not those that were written, so it is damaged; make it again".to_owned()))
        }
    }
}

thread_local! {
    /// The simulation of this thread of the pool. With FMUs of other programs, it never leaves the thread
    /// that loaded them.
    static SIMULATION: RefCell<Option<Simulation>> = const { RefCell::new(None) };
}

/// The worker threads, each with a simulation of its own.
pub(super) struct Crew<'a> {
    campaign: &'a Campaign,
    measures: &'a Measures,
    pub(super) pool: ThreadPool,
}

impl Drop for Crew<'_> {
    fn drop(&mut self) {
        // The threads end some time after the pool is dropped. FMUs of other programs are unloaded, and their
        // files removed, before that.
        self.pool.broadcast(|_| drop(SIMULATION.take()));
    }
}

impl<'a> Crew<'a> {
    pub(super) fn new(
        campaign: &'a Campaign,
        measures: &'a Measures,
        threads: Option<NonZeroUsize>,
    ) -> Result<Self, Error> {
        let system = campaign.system().clone().recording(measures.signals());
        let one = campaign.models().iter().any(|part| part.description().only_once);
        let pool = ThreadPoolBuilder::new()
            .num_threads(if one { 1 } else { threads.map_or(0, NonZeroUsize::get) })
            .build()
            .map_err(|e| {
                let message =
                    format!("the system refuses so many threads: {e}; give fewer, such as --threads 1");
                Error::configuration("--threads", message)
            })?;
        let crew = Self { campaign, measures, pool };
        let made = crew.pool.broadcast(|_| {
            SIMULATION.set(Some(campaign.simulation(&system)?));
            Ok(())
        });
        made.into_iter().collect::<Result<(), Error>>()?;
        Ok(crew)
    }

    /// Makes `runs`, and passes their rows to `keep` in order, in batches. `tell` gets the number of runs
    /// made. Returns the number of rows kept.
    fn work(
        &self,
        runs: Range<u64>,
        stop: &AtomicBool,
        tell: &(dyn Fn(u64) + Sync),
        mut keep: impl FnMut(u64, Vec<Row>) -> Result<(), Error>,
    ) -> Result<u64, Error> {
        let done = AtomicU64::new(0);
        let mut next = runs.start;
        let threads = self.pool.current_num_threads();
        let mut size = threads;
        while next < runs.end && !stop.load(Ordering::Relaxed) {
            let end = runs.end.min(next + size as u64);
            let begin = Instant::now();
            let make = |number: u64| {
                if stop.load(Ordering::Relaxed) {
                    return None;
                }
                let row = self.make(number, &self.campaign.choice(number));
                tell(done.fetch_add(1, Ordering::Relaxed) + 1);
                Some(row)
            };
            let rows: Vec<Option<Row>> =
                self.pool.install(|| (next..end).into_par_iter().map(make).collect());
            let rows: Vec<Row> = rows.into_iter().map_while(|row| row).collect();
            let ratio = SEGMENT.as_secs_f64() / begin.elapsed().as_secs_f64().max(1e-6);
            size = ((size as f64 * ratio) as usize).clamp(threads, size * GROWTH).min(GROUP);
            let first = next;
            next += rows.len() as u64;
            if next > first {
                keep(first, rows)?;
            }
        }
        Ok(next - runs.start)
    }

    /// Makes run `number` from `choice`, on a thread of the pool.
    pub(super) fn make(&self, number: u64, choice: &Choice) -> Row {
        // A run that panicked has no effect on the next one, which begins with a reset.
        SIMULATION.with_borrow_mut(|simulation| match simulation {
            Some(simulation) => self.measures.run_from(self.campaign, simulation, number, choice),
            None => {
                self.measures.unmade(number, choice, &Error::broken("a run", "is on no thread of its crew"))
            }
        })
    }
}
