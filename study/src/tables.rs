//! The tables: the paper's three, the methods on the same starts, and other seeds.

use punctual_cosim::error::Error;
use rayon::prelude::*;

use super::baseline::Baseline;
use super::cases::{DEADLINE, Integrator, STEP, Setup, Vehicle};
use super::starts::{drawn, hundred};
use super::table::{Cell, Table};
use super::trial::{self, Outcome};
use super::{Options, Watch, always, search};

/// Deadline of the random starts in s.
const RANDOM: f64 = 5.0;
/// Sampling period of the runs with other seeds, in s.
const SEED_STEP: f64 = 0.01;

/// A method with its parameters in one setting, and the outcome of its runs.
struct Row {
    baseline: Baseline,
    origin: &'static str,
    setup: Setup,
    vehicle: Vehicle,
    outcomes: Vec<Outcome>,
    nanoseconds: Option<f64>,
}

impl Row {
    fn count(&self, kept: impl Fn(&Outcome) -> bool) -> usize {
        self.outcomes.iter().filter(|o| kept(o)).count()
    }

    fn by(&self, t: f64) -> usize {
        self.count(|o| o.by(t))
    }

    /// The quantile at `part` of the values.
    fn quantile(&self, part: f64, value: impl Fn(&Outcome) -> f64) -> f64 {
        let mut values: Vec<f64> = self.outcomes.iter().map(value).collect();
        values.sort_by(f64::total_cmp);
        values[((values.len() - 1) as f64 * part).round() as usize]
    }

    fn arrivals(&self) -> [Option<f64>; 2] {
        let all = || self.outcomes.iter().filter_map(|o| o.arrival);
        [all().reduce(f64::min), all().reduce(f64::max)]
    }
}

fn settings() -> [Setup; 2] {
    [Setup::paper(RANDOM, STEP), Setup::advised(RANDOM, STEP)]
}

/// The parameter-free methods of the main table, in one setting.
fn fixed(setup: &Setup) -> Vec<Baseline> {
    if setup.is_advised() {
        vec![Baseline::RepeatedRoot, Baseline::ProfilePointwise, Baseline::Profile]
    } else {
        vec![Baseline::RepeatedRoot, Baseline::ProfilePointwise]
    }
}

/// Number of closed loops that [`all`] runs.
pub(super) fn loops(options: &Options) -> usize {
    let mut loops = 0;
    for setup in settings() {
        let methods = Baseline::defaults(RANDOM);
        let searched: usize = methods.iter().map(|method| search::loops(*method, options)).sum();
        loops += Vehicle::ALL.len() * (searched + (fixed(&setup).len() + 2 * methods.len()) * options.runs);
    }
    loops + Vehicle::ALL.len() * options.seeds as usize * options.runs + always::loops(options)
}

/// All tables, and whether our method kept every deadline in them.
pub(super) fn all(options: &Options, watch: &Watch) -> Result<(Vec<Table>, bool), Error> {
    let rows = methods(options, watch)?;
    let ours = |row: &&Row| row.setup.is_advised() && row.baseline == Baseline::Profile;
    let kept = |row: &Row| row.outcomes.iter().all(|o| o.kept(RANDOM));
    let (seeds, seeds_kept) = seeds(options, watch)?;
    let (always, always_kept) = always::table(options, watch)?;
    let all_kept = seeds_kept && always_kept && rows.iter().filter(ours).all(kept);
    let tables = vec![
        discretisation(options)?,
        random_starts(&rows, options),
        comparison(&rows, options),
        every_method(&rows, options),
        seeds,
        cost(&rows, options),
        always,
    ];
    Ok((tables, all_kept))
}

fn methods(options: &Options, watch: &Watch) -> Result<Vec<Row>, Error> {
    let starts = hundred(options.runs);
    let mut rows = Vec::new();
    for setup in settings() {
        for vehicle in Vehicle::ALL {
            let mut baselines: Vec<_> = fixed(&setup).into_iter().map(|c| (c, "-")).collect();
            for method in Baseline::defaults(RANDOM) {
                baselines.push((method, "default"));
                baselines.push((search::best(method, vehicle, &setup, options, watch)?, "searched"));
            }
            for (baseline, origin) in baselines {
                let outcomes = together(vehicle, baseline, &setup, &starts, watch)?;
                rows.push(Row { baseline, origin, setup, vehicle, outcomes, nanoseconds: None });
            }
        }
    }
    // Times are measured after all parallel runs, so that this program has the machine to itself as far as it
    // can.
    if options.timed {
        for row in &mut rows {
            let x0 = starts.first().copied().unwrap_or_default();
            let seconds = trial::seconds_per_step(row.vehicle, row.baseline, &row.setup, x0)?;
            row.nanoseconds = Some(1e9 * seconds);
        }
    }
    Ok(rows)
}

fn together(
    vehicle: Vehicle,
    baseline: Baseline,
    setup: &Setup,
    starts: &[[f64; 4]],
    watch: &Watch,
) -> Result<Vec<Outcome>, Error> {
    let one = |x0: &[f64; 4]| {
        let outcome = trial::run(vehicle, baseline, setup, *x0);
        watch.done(1);
        outcome
    };
    starts.par_iter().map(one).collect()
}

/// The paper's table on discretisation: arrival (s) at 1 ms and 0.1 ms.
const PAPER_ARRIVALS: [[f64; 2]; 3] = [[10.003, 9.9995], [10.087, 10.021], [10.256, 10.1054]];

pub(super) fn discretisation(options: &Options) -> Result<Table, Error> {
    let mut table = Table::new(
        "discretisation",
        "Table I of the paper: time of arrival against the sampling period",
        &[
            "vehicle",
            "step (s)",
            "paper (s)",
            "repeated root, Euler (s)",
            "semi-implicit (s)",
            "RK4 (s)",
            "ours, RK4 (s)",
            "peak |u₁| paper's method (m/s²)",
            "peak |u₁| ours (m/s²)",
        ],
    )
    .note("One run each, from (0, 0, 0, 0), T = 10 s; arrival is the first sample with h ≥ 0, the peak is up to it.")
    .note("Paper's method: R² − d², u_ref = 0, pointwise. Ours: distance-shaped, damping, margin 0.02 m.")
    .note("The paper does not name its integrator. Not explained: its 9.9995 s, before T; none of the three gets there by T.");
    for (vehicle, paper) in Vehicle::ALL.into_iter().zip(PAPER_ARRIVALS) {
        for (step, paper) in [1e-3, 1e-4].into_iter().zip(paper) {
            if step < options.finest {
                continue;
            }
            let arrive = |baseline, setup| trial::run(vehicle, baseline, &setup, [0.0; 4]);
            let end = 1.05 * DEADLINE;
            let paper_setup = Setup { end, ..Setup::paper(DEADLINE, step) };
            let by = |integrator| arrive(Baseline::RepeatedRoot, Setup { integrator, ..paper_setup });
            let [euler, semi, rk4] = Integrator::ALL.map(by);
            let (rk4, ours) =
                (rk4?, arrive(Baseline::Profile, Setup { end, ..Setup::advised(DEADLINE, step) })?);
            let time = |o: &Outcome| Cell::optional(o.arrival, 4, "never");
            table.rows.push(vec![
                vehicle.title().into(),
                Cell::Number(step, 4),
                Cell::Number(paper, 4),
                time(&euler?),
                time(&semi?),
                time(&rk4),
                time(&ours),
                Cell::Number(rk4.peak[0], 0),
                Cell::Number(ours.peak[0], 2),
            ]);
        }
    }
    Ok(table)
}

/// Runs on time, and by 1.5 T, out of 100, in the paper.
const PAPER_COUNTS: [[usize; 2]; 3] = [[99, 100], [1, 100], [5, 99]];

/// The runs of a table, as text.
fn runs(options: &Options) -> String {
    format!(
        "{} starts (tests/data/starts100.csv), T = {RANDOM} s, step {STEP} s, RK4, to {} s.",
        options.runs,
        2.0 * RANDOM
    )
}

fn random_starts(rows: &[Row], options: &Options) -> Table {
    let mut table = Table::new(
        "random_starts",
        "Table II of the paper: random initial conditions",
        &[
            "vehicle",
            "paper, by 5 s",
            "paper, by 7.5 s",
            "its method, by 5 s",
            "by 5.015 s",
            "by 7.5 s",
            "latest (s)",
            "ours, by 5 s",
            "inside until 10 s",
            "latest (s)",
        ],
    )
    .note(runs(options))
    .note("Paper: of its own 100 starts. Its method: R² − d², u_ref = 0. Ours: distance-shaped, damping, margin 0.02 m.")
    .note("99 against our count of point masses by 5 s: most of them are late by a few steps, so that the paper's count must allow for some;")
    .note("how many it does not say. The counts of the vehicles are of other starts.");
    for (vehicle, paper) in Vehicle::ALL.into_iter().zip(PAPER_COUNTS) {
        let of = |baseline, advised| {
            rows.iter()
                .find(|r| r.vehicle == vehicle && r.baseline == baseline && r.setup.is_advised() == advised)
        };
        let (Some(its), Some(ours)) = (of(Baseline::RepeatedRoot, false), of(Baseline::Profile, true)) else {
            continue;
        };
        table.rows.push(vec![
            vehicle.title().into(),
            Cell::count(paper[0]),
            Cell::count(paper[1]),
            Cell::count(its.by(RANDOM)),
            Cell::count(its.by(1.003 * RANDOM)),
            Cell::count(its.by(1.5 * RANDOM)),
            Cell::optional(its.arrivals()[1], 3, "never"),
            Cell::count(ours.by(RANDOM)),
            Cell::count(ours.count(|o| o.kept(RANDOM))),
            Cell::optional(ours.arrivals()[1], 3, "never"),
        ]);
    }
    table
}

fn comparison(rows: &[Row], options: &Options) -> Table {
    let mut table = Table::new(
        "comparison",
        "Table III of the paper: existing and proposed method, point mass",
        &["", "setting", "parameters", "values", "reach by T (%)", "reach by 2T (%)", "time"],
    )
    .note(runs(options))
    .note("Paper: 100 runs in its own code, wall time of all of them. Here: time of one step of the same filter.")
    .note("The paper does not give the parameters of the existing method, so that its 1 % cannot be checked. Default: p = 1, 1, q = 1/2, ours.");
    for (name, count, reach, time) in [
        ("existing (Xiao), in the paper", 3, 1.0, "184.5 s"),
        ("proposed, in the paper", 0, 100.0, "96.46 s"),
    ] {
        table.rows.push(vec![
            name.into(),
            "quadratic, u_ref = 0".into(),
            Cell::count(count),
            Cell::Nothing("not given"),
            Cell::Number(reach, 0),
            Cell::Nothing("-"),
            time.into(),
        ]);
    }
    let listed =
        |c: Baseline| matches!(c, Baseline::FiniteTime(..) | Baseline::RepeatedRoot | Baseline::Profile);
    for row in rows.iter().filter(|r| r.vehicle == Vehicle::PointMass && listed(r.baseline)) {
        let percent = |count: usize| Cell::Number(100.0 * count as f64 / row.outcomes.len() as f64, 0);
        let time = row.nanoseconds.map_or(Cell::Nothing("-"), |ns| format!("{ns:.0} ns").into());
        table.rows.push(vec![
            match row.origin {
                "-" => row.baseline.title().into(),
                origin => format!("{}, {origin}", row.baseline.title()).into(),
            },
            row.setup.title().into(),
            Cell::count(row.baseline.parameter_count()),
            row.baseline.parameters().into(),
            percent(row.by(RANDOM)),
            percent(row.by(2.0 * RANDOM)),
            time,
        ]);
    }
    table
}

fn every_method(rows: &[Row], options: &Options) -> Table {
    // The header, and the conditions of the runs.
    let mut table = Table::new(
        "methods",
        "Every method on the same random starts",
        &[
            "setting",
            "method",
            "parameters",
            "chosen",
            "vehicle",
            "on time",
            "by 1.5 T",
            "kept until 2T",
            "earliest (s)",
            "latest (s)",
            "least R − d after T (m)",
            "median peak |u₁| (m/s²)",
            "largest peak |u₁|",
            "median ∫‖u‖²dt",
            "unmet steps",
        ],
    )
    .note(runs(options))
    .note("First-order fixed-time and the tube are run in our extension to order 2. Ours is also shown as it is by default, looking over the period; all others are enforced at the samples, as 'reference profile, pointwise' is.")
    .note("Peak and effort up to the arrival (to the end where there is none). Kept: on time, and h ≥ 0 from T to 2T.")
    .note(format!(
        "Searched: the best of a grid, for each vehicle and setting, by kept, on time, then median peak, on {} starts at \
         {} s, the best {} again on {} at {STEP} s; seed {}.",
        options.search.0,
        search::COARSE,
        options.search.2,
        options.search.1,
        search::SEED
    ));
    // A row for each method, vehicle and setting.
    for row in rows {
        let [earliest, latest] = row.arrivals();
        table.rows.push(vec![
            row.setup.title().into(),
            row.baseline.title().into(),
            row.baseline.parameters().into(),
            row.origin.into(),
            row.vehicle.title().into(),
            Cell::count(row.by(RANDOM)),
            Cell::count(row.by(1.5 * RANDOM)),
            Cell::count(row.count(|o| o.kept(RANDOM))),
            Cell::optional(earliest, 3, "never"),
            Cell::optional(latest, 3, "never"),
            Cell::optional(Some(row.quantile(0.0, |o| o.least_depth)), 3, "not a number"),
            Cell::optional(Some(row.quantile(0.5, |o| o.peak[0])), 1, "not a number"),
            Cell::optional(Some(row.quantile(1.0, |o| o.peak[0])), 1, "not a number"),
            Cell::optional(Some(row.quantile(0.5, |o| o.effort)), 0, "not a number"),
            Cell::count(row.outcomes.iter().map(|o| o.unmet).sum()),
        ]);
    }
    table
}

fn seeds(options: &Options, watch: &Watch) -> Result<(Table, bool), Error> {
    let mut table = Table::new(
        "seeds",
        "Ours on other starts: kept until 2T",
        &["seed", "point mass", "unicycle", "bicycle", "of", "latest (s)", "least R − d after T (m)"],
    )
    .note(format!(
        "Starts drawn by SplitMix64 from the seed, in the box of table II; T = {RANDOM} s, step {SEED_STEP} s, RK4, to {} s.",
        2.0 * RANDOM
    ));
    let setup = Setup::advised(RANDOM, SEED_STEP);
    let mut all = true;
    for seed in 1..=options.seeds {
        let starts = drawn(seed, options.runs);
        let mut cells = vec![Cell::count(seed as usize)];
        let (mut latest, mut depth) = (None, f64::INFINITY);
        for vehicle in Vehicle::ALL {
            let outcomes = together(vehicle, Baseline::Profile, &setup, &starts, watch)?;
            let row =
                Row { baseline: Baseline::Profile, origin: "-", setup, vehicle, outcomes, nanoseconds: None };
            let kept = row.count(|o| o.kept(RANDOM));
            all &= kept == starts.len();
            latest = row.arrivals()[1].into_iter().chain(latest).reduce(f64::max);
            depth = depth.min(row.quantile(0.0, |o| o.least_depth));
            cells.push(Cell::count(kept));
        }
        cells.extend([Cell::count(starts.len()), Cell::optional(latest, 3, "never"), Cell::Number(depth, 4)]);
        table.rows.push(cells);
    }
    Ok((table, all))
}

fn cost(rows: &[Row], options: &Options) -> Table {
    let mut table = Table::new(
        "cost",
        "Time of one step (ns): derivatives, constraint, quadratic program, report",
        &["setting", "method", "chosen", "point mass", "unicycle", "bicycle"],
    )
    .note("Along the states of one run at 1 ms until T, one thread, the least mean of 7 passes; on a shared machine.");
    if !options.timed {
        return table.note("Not measured.");
    }
    for row in rows.iter().filter(|row| row.vehicle == Vehicle::PointMass) {
        let same = |other: &&Row| {
            std::mem::discriminant(&other.baseline) == std::mem::discriminant(&row.baseline)
                && (other.origin, other.setup.shape) == (row.origin, row.setup.shape)
        };
        let mut cells = vec![row.setup.title().into(), row.baseline.title().into(), row.origin.into()];
        cells.extend(rows.iter().filter(same).map(|r| Cell::optional(r.nanoseconds, 0, "-")));
        table.rows.push(cells);
    }
    table
}
