//! Summary of a campaign: how many runs succeed, and which are the worst.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use punctual_fmu::text::number;
use serde::Serialize;

use super::measures::{FATE, Fate, Measures};
use super::table::{Cell, Column, Kind, Reader};
use crate::error::Error;

/// The 0.975 quantile of the normal distribution, for a confidence of 95 %.
const Z: f64 = 1.959_963_984_540_054;

/// A fraction of all runs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Rate {
    /// Number of runs.
    pub count: u64,
    /// Their fraction of all runs.
    pub rate: f64,
    /// Interval for the fraction in infinitely many runs, at a confidence of 95 %: E. B. Wilson, J. Amer.
    /// Statist. Assoc. 22 (1927), doi 10.1080/01621459.1927.10502953. It assumes independent runs. For
    /// stratified sampling it is wider than necessary.
    pub interval: [f64; 2],
}

impl Rate {
    /// The rate of `count` runs out of `all` ≥ 1.
    pub fn of(count: u64, all: u64) -> Self {
        let (n, p) = (all as f64, count as f64 / all as f64);
        let middle = p + Z * Z / (2.0 * n);
        let half = Z * (p * (1.0 - p) / n + Z * Z / (4.0 * n * n)).sqrt();
        let scale = 1.0 + Z * Z / n;
        // At 0 and `all` the ends are exact up to round-off, so they are set.
        let low = if count == 0 { 0.0 } else { ((middle - half) / scale).max(0.0) };
        let high = if count == all { 1.0 } else { ((middle + half) / scale).min(1.0) };
        Self { count, rate: p, interval: [low, high] }
    }
}

/// The spread of the numbers in a column.
#[derive(Clone, Debug, Serialize)]
pub struct Spread {
    /// The column.
    pub column: String,
    /// Its unit.
    pub unit: String,
    /// Number of runs that have a number.
    pub count: u64,
    /// The least.
    pub min: f64,
    /// Their mean.
    pub mean: f64,
    /// The greatest.
    pub max: f64,
}

/// How many runs lack a property that every run should have.
#[derive(Clone, Debug, Serialize)]
pub struct Lack {
    /// The column that is false.
    pub column: String,
    /// The runs that lack it.
    #[serde(flatten)]
    pub rate: Rate,
}

/// A run to look at.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Case {
    /// Its number.
    pub run: u64,
    /// Whether it succeeded all the same.
    pub success: bool,
    /// Least h of all barriers from their deadlines on; `None` if some barrier has no such value.
    pub least_h: Option<f64>,
    /// The call that ended it.
    pub failure: Option<String>,
}

impl Case {
    /// Orders cases by how bad they are: failed runs greatest, then those without success, then by the least
    /// h.
    fn compare(&self, other: &Self) -> Ordering {
        let key = |case: &Self| (case.failure.is_some(), !case.success);
        let least = |case: &Self| case.least_h.unwrap_or(f64::NEG_INFINITY);
        let worse = key(self).cmp(&key(other)).then(least(other).total_cmp(&least(self)));
        worse.then(other.run.cmp(&self.run))
    }
}

/// A case, ordered so that the least bad one is at the top of the heap.
struct Kept(Case);

impl Ord for Kept {
    fn cmp(&self, other: &Self) -> Ordering {
        other.0.compare(&self.0)
    }
}

impl PartialOrd for Kept {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Eq for Kept {}

impl PartialEq for Kept {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

/// Result of a campaign.
#[derive(Debug, Serialize)]
pub struct Summary {
    /// Number of runs.
    #[serde(skip)]
    pub runs: u64,
    /// The successful runs.
    pub success: Rate,
    /// The others.
    pub failure: Rate,
    /// The columns that are false in some runs.
    pub lacks: Vec<Lack>,
    /// The spreads of the columns with numbers.
    pub spreads: Vec<Spread>,
    /// What became of the promise of each filter whose plant was drawn within what it declares.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub declared: Vec<Fates>,
    /// The worst runs, the worst first.
    pub worst: Vec<Case>,
}

/// How many runs had which outcome for the promise of a filter whose plant was drawn within what it declares.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Fates {
    /// The filter.
    pub filter: String,
    /// Runs in which a plan was found at the start, so that something was promised.
    pub promised: u64,
    /// Runs guaranteed at every sample, with h ≥ 0 at every instant at which that was required.
    pub kept: u64,
    /// Runs in which the guarantee was withdrawn, with h ≥ 0 as long as there was one.
    pub withdrawn: u64,
    /// Runs in which h < 0 although a plan guaranteed h ≥ 0. There should be none.
    pub broken: u64,
    /// The most that there may be in infinitely many runs, as a part of those promised, at a confidence of 95 %; `None` if
    /// nothing was promised.
    pub broken_at_most: Option<f64>,
}

impl Fates {
    fn of(filter: &str, counts: [u64; Fate::ALL.len()]) -> Self {
        let [_, kept, withdrawn, broken] = counts;
        let promised = kept + withdrawn + broken;
        let broken_at_most = (promised > 0).then(|| Rate::of(broken, promised).interval[1]);
        Self { filter: filter.to_owned(), promised, kept, withdrawn, broken, broken_at_most }
    }

    /// The counts as a sentence.
    pub fn text(&self) -> String {
        let Self { filter, promised, kept, withdrawn, broken, broken_at_most } = self;
        let most = broken_at_most.map(|most| {
            format!(" (of infinitely many at most {} %, with a confidence of 95 %)", number(100.0 * most))
        });
        format!(
            "{filter}: {promised} promised; with plants within what is declared {kept} kept, {withdrawn} withdrawn, {broken} broken{}",
            most.unwrap_or_default()
        )
    }
}

/// Reads the rows from `reader` once, and keeps the `worst` so many.
///
/// # Errors
///
/// A file that cannot be read or has no rows.
pub fn summary(reader: &Reader, measures: &Measures, worst: usize) -> Result<Summary, Error> {
    // Find the columns.
    let columns = measures.columns();
    let find = |name: &str| columns.iter().position(|column| column.name == name);
    let least: Vec<usize> =
        measures.barriers().filter_map(|barrier| find(&format!("{barrier}.least_h"))).collect();
    let of_kind = |kind: Kind| (0..columns.len()).filter(move |&c| columns[c].kind == kind);
    let flags: Vec<usize> = of_kind(Kind::Flag).filter(|&c| columns[c].name != "success").collect();
    let numbers: Vec<usize> = of_kind(Kind::Number).collect();
    let of_filter = |c: &usize| columns[*c].name.strip_suffix(FATE).and_then(|name| name.strip_suffix('.'));
    let fates: Vec<(usize, &str)> = of_kind(Kind::Text).filter_map(|c| Some((c, of_filter(&c)?))).collect();
    let mut counts = vec![[0_u64; Fate::ALL.len()]; fates.len()];
    let [Some(success), Some(failure)] = ["success", "failure"].map(find) else {
        return Err(Error::configuration("", "a campaign without its columns"));
    };
    // Go through the rows.
    let (mut runs, mut succeeded) = (0_u64, 0_u64);
    let mut lacking = vec![0_u64; flags.len()];
    let mut spreads: Vec<Spread> = numbers.iter().map(|&c| Spread::nothing(&columns[c])).collect();
    let mut heap: BinaryHeap<Kept> = BinaryHeap::new();
    for group in 0..reader.groups() {
        for row in reader.group(group, columns)? {
            let good = matches!(row[success], Cell::Flag(true));
            succeeded += u64::from(good);
            for (count, &c) in lacking.iter_mut().zip(&flags) {
                *count += u64::from(matches!(row[c], Cell::Flag(false)));
            }
            for (counts, (c, _)) in counts.iter_mut().zip(&fates) {
                let Cell::Text(Some(word)) = &row[*c] else { continue };
                if let Some(fate) = Fate::ALL.iter().position(|fate| fate.word() == word) {
                    counts[fate] += 1;
                }
            }
            for (spread, &c) in spreads.iter_mut().zip(&numbers) {
                if let Cell::Number(Some(value)) = row[c] {
                    spread.take(value);
                }
            }
            let h = |c: &usize| match row[*c] {
                Cell::Number(h) => h,
                _ => None,
            };
            // A barrier that was released before its deadline has no value and does not count.
            let least_h = least.iter().filter_map(h).reduce(f64::min);
            let failed = match &row[failure] {
                Cell::Text(text) => text.clone(),
                _ => None,
            };
            heap.push(Kept(Case { run: runs, success: good, least_h, failure: failed }));
            if heap.len() > worst {
                heap.pop();
            }
            runs += 1;
        }
    }
    // Turn counts into rates.
    if runs == 0 {
        return Err(Error::configuration("", "a campaign without runs"));
    }
    let lacks = flags.iter().zip(lacking);
    Ok(Summary {
        runs,
        success: Rate::of(succeeded, runs),
        failure: Rate::of(runs - succeeded, runs),
        lacks: lacks
            .map(|(&c, count)| Lack { column: columns[c].name.clone(), rate: Rate::of(count, runs) })
            .collect(),
        spreads: spreads.into_iter().map(Spread::finished).collect(),
        declared: fates.iter().zip(counts).map(|((_, filter), counts)| Fates::of(filter, counts)).collect(),
        worst: heap.into_sorted_vec().into_iter().map(|kept| kept.0).collect(),
    })
}

impl Spread {
    fn nothing(column: &Column) -> Self {
        let (column, unit) = (column.name.clone(), column.unit.clone());
        Self { column, unit, count: 0, min: f64::INFINITY, mean: 0.0, max: f64::NEG_INFINITY }
    }

    /// Adds a value. Until the spread is finished, `mean` holds the sum.
    fn take(&mut self, value: f64) {
        self.count += 1;
        self.min = self.min.min(value);
        self.mean += value;
        self.max = self.max.max(value);
    }

    fn finished(mut self) -> Self {
        self.mean /= self.count as f64;
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// R. G. Newcombe, Statist. Med. 17 (1998), table I, score method without correction: 81 of 263, 15 of
    /// 148, 0 of 20, 1 of 29, to the four digits printed there.
    #[test]
    fn intervals_are_those_of_the_tables() {
        let cases = [
            (81, 263, [0.2553, 0.3662]),
            (15, 148, [0.0624, 0.1605]),
            (0, 20, [0.0, 0.1611]),
            (1, 29, [0.0061, 0.1718]),
        ];
        for (count, all, interval) in cases {
            let found = Rate::of(count, all).interval;
            for (found, expected) in found.iter().zip(interval) {
                assert!((found - expected).abs() <= 5e-5, "{count} of {all}: {found}, wanted {expected}");
            }
        }
        assert_eq!(Rate::of(7, 7).interval[1], 1.0);
    }

    #[test]
    fn the_worst_come_first() {
        let case = |run, success, least_h, failure: bool| Case {
            run,
            success,
            least_h,
            failure: failure.then(String::new),
        };
        let order = [
            case(7, false, Some(1.0), true),
            case(3, false, None, false),
            case(1, false, Some(-1.0), false),
            case(2, false, Some(0.5), false),
            case(4, true, Some(0.1), false),
            case(5, true, Some(0.1), false),
        ];
        let mut heap: Vec<Kept> = order.iter().rev().cloned().map(Kept).collect();
        heap.sort();
        assert_eq!(heap.into_iter().map(|kept| kept.0).collect::<Vec<_>>(), order);
    }
}
