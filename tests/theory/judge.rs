//! An independent judge that looks for broken promises under the flag.
//!
//! Closed loops are drawn at random ([`families`]) and run with the filter. The judge moves the plant with
//! its own integrator and its own equations ([`motion`], [`model`]). h is checked at all instants ([`run`]):
//! at the ends of at least twenty parts of every hold, at the deadline itself, and at the minimum in between.
//! A promise is broken under the flag if h < 0 in a hold whose sample reported `on_course`, while the set was
//! inside at the anchor, the deadline had passed, or the phase was `Stay`. Promises that break in a hold
//! longer than the filter was told are counted separately.

#![allow(clippy::print_stdout, reason = "the figures are read from the output")]

pub(crate) mod case;
pub(crate) mod families;
pub(crate) mod model;
pub(crate) mod motion;
pub(crate) mod run;

use families::Family;
use run::{Break, run};

/// Number of cases drawn out of `all`: all of them in `tests/nightly`, a tenth here.
pub(crate) fn drawn(all: usize) -> usize {
    if std::env::var_os("PUNCTUAL_TABLES").is_some() { all } else { all / 10 }
}

/// Computes `one` for each number below `count`, on all cores.
pub(crate) fn on_every_core<T: Send>(count: u64, one: impl Fn(u64) -> T + Sync) -> Vec<T> {
    let cores = std::thread::available_parallelism().map_or(1, usize::from) as u64;
    let one = &one;
    let mut found: Vec<(u64, T)> = std::thread::scope(|scope| {
        let workers: Vec<_> = (0..cores)
            .map(|core| {
                scope.spawn(move || {
                    (core..count).step_by(cores as usize).map(|i| (i, one(i))).collect::<Vec<_>>()
                })
            })
            .collect();
        workers.into_iter().flat_map(|worker| worker.join().expect("no panic")).collect()
    });
    found.sort_by_key(|(i, _)| *i);
    found.into_iter().map(|(_, value)| value).collect()
}

/// Results of the runs of a family; all but the first and the last two count promises.
#[derive(Clone, Debug, Default)]
struct Tally {
    runs: usize,
    promises: usize,
    late: usize,
    left: usize,
    broken: usize,
    broken_longer: usize,
    needless: usize,
    flagged_first: usize,
    unmet: usize,
    samples: usize,
    ended: usize,
    /// Breaks under the flag: the break, the seed, the number of the set.
    worst: Vec<(Break, u64, usize)>,
}

impl Tally {
    /// Runs the cases of `family` with seeds from `first` on.
    fn of(family: Family, first: u64, count: u64) -> Self {
        let mut tally = Self::default();
        let runs = on_every_core(count, |i| run(&family.draw(first + i)));
        for (run, seed) in runs.iter().zip(first..) {
            tally.runs += 1;
            tally.samples += run.samples;
            tally.ended += usize::from(run.ended);
            for (i, promise) in run.promises.iter().enumerate() {
                tally.promises += 1;
                tally.late += usize::from(promise.late);
                tally.left += usize::from(promise.left.is_some());
                tally.broken += usize::from(promise.broken.is_some());
                tally.broken_longer += usize::from(promise.broken_longer.is_some());
                tally.needless += usize::from(promise.flag_lost_needlessly());
                tally.flagged_first += usize::from(promise.flagged_first);
                tally.unmet += promise.unmet;
                tally.worst.extend(promise.broken.map(|found| (found, seed, i)));
            }
        }
        tally.worst.sort_by(|a, b| b.0.size.total_cmp(&a.0.size));
        tally
    }

    fn row(&self, name: &str) -> String {
        let Self { runs, promises, late, left, broken, broken_longer, .. } = self;
        let Self { needless, flagged_first, unmet, samples, ended, .. } = self;
        format!(
            "| {name} | {runs} | {promises} | {late} | {left} | **{broken}** | {broken_longer} | {needless} | \
             {flagged_first} | {unmet} of {samples} | {ended} |"
        )
    }
}

const HEAD: &str = "| family | runs | promises | late | left | broken under the flag | in a hold longer than told | \
                    flag lost needlessly | flagged at the first sample | unmet samples | ended |\n\
                    |---|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|";

/// Families, a table of them and their worst cases.
fn table(count: u64, shown: usize) -> Vec<(Family, Tally)> {
    println!("{HEAD}");
    let mut all = Vec::new();
    for (i, family) in Family::ALL.into_iter().enumerate() {
        let count = if family == Family::Fifty { count.min(500) } else { count };
        let tally = Tally::of(family, (i as u64) << 32, count);
        println!("{}", tally.row(&format!("{family:?}")));
        all.push((family, tally));
    }
    for (family, tally) in &all {
        for (found, seed, set) in tally.worst.iter().take(shown) {
            println!("\n{family:?}.draw({seed}), set {set}: {found:?}\n{:?}", family.draw(*seed));
        }
    }
    let sum = |f: fn(&Tally) -> usize| all.iter().map(|(_, tally)| f(tally)).sum::<usize>();
    println!(
        "promises {}, broken under the flag {}, flag lost needlessly {}",
        sum(|t| t.promises),
        sum(|t| t.broken),
        sum(|t| t.needless)
    );
    all
}

/// Asserts that 0 promises were broken under the flag.
fn assert_none_broken(all: &[(Family, Tally)]) {
    for (family, tally) in all {
        assert!(tally.broken == 0, "{family:?}: {} broken, {:?}", tally.broken, tally.worst[0]);
    }
}

/// Asserts that at most 5 of 500 unicycles at 50 ms lose the flag although they would have kept the promise.
fn assert_flags_are_kept(all: &[(Family, Tally)]) {
    let (_, tally) = all.iter().find(|(family, _)| *family == Family::Fifty).expect("in the list");
    assert!(100 * tally.needless <= tally.promises, "{tally:?}");
}

/// Draws all 100,000 in `tests/nightly`; with `PUNCTUAL_JUDGE`, that many per family.
#[test]
fn table_of_promises() {
    let given = std::env::var("PUNCTUAL_JUDGE").ok().and_then(|n| n.parse().ok());
    let all = std::env::var_os("PUNCTUAL_TABLES").is_some();
    let count = given.unwrap_or(if all { 3500 } else { 60 });
    let found = table(count, if all || given.is_some() { 3 } else { 1 });
    assert_none_broken(&found);
    assert_flags_are_kept(&found);
}

/// A case can be run again from its seed alone.
#[test]
fn the_same_case_comes_to_the_same() {
    for family in Family::ALL {
        let case = family.draw(7);
        assert_eq!(format!("{case:?}"), format!("{:?}", family.draw(7)));
        let [first, again] = [run(&case), run(&case)];
        assert_eq!(format!("{first:?}"), format!("{again:?}"), "{family:?}");
    }
}
