//! The hundred starts at 1, 10 and 50 ms with the sampled form of the constraint: 100/100/100 on time
//! and inside until 2T, for the given starts and for three hundred drawn here.

#![allow(clippy::print_stdout, reason = "the figures are read from the output")]

use punctual_core::filter::{BarrierSettings, Sampling};
use punctual_core::plants::{PointMass, Unicycle};
use punctual_reference::nominal::Heading;

use super::starts::{DEADLINE, assert_all_keep_the_deadline, drawn, quantile, starts};
use super::{Nominal, Run, Scheme, bicycle, damp_speed, damp_velocity, distance, run_as};

type Kinds = [Nominal; 3];

const DAMPING: Kinds = [damp_velocity, damp_speed, damp_speed];
const HEADING: Kinds = [
    |_, x| Heading::towards([45.0, 45.0]).point_mass(x),
    |_, x| Heading::towards([45.0, 45.0]).unicycle(x),
    |_, x| Heading::towards([45.0, 45.0]).bicycle(x, 10.0),
];

/// Asserts that point mass, unicycle and bicycle are all on time and inside; returns the median peaks.
fn all_keep_the_deadline(starts: &[[f64; 4]], nominal: Kinds, scheme: Scheme, step: f64) -> [f64; 3] {
    let settings = BarrierSettings::within(DEADLINE).rate(5.0).stay_rate(5.0).margin(0.02);
    let median = |name: &str, runs: Vec<Run>| {
        assert_all_keep_the_deadline(&format!("{name}, {scheme:?}, {step}"), &runs, starts);
        quantile(&runs, 0.5)
    };
    let each = |one: &dyn Fn([f64; 4]) -> Run| starts.iter().map(|x0| one(*x0)).collect();
    let [n0, n1, n2] = nominal;
    [
        median("point mass", each(&|x0| run_as(scheme, &PointMass, distance(), settings, n0, step, x0))),
        median("unicycle", each(&|x0| run_as(scheme, &Unicycle, distance(), settings, n1, step, x0))),
        median("bicycle", each(&|x0| run_as(scheme, &bicycle(), distance(), settings, n2, step, x0))),
    ]
}

/// A scheme without bounds, with a known period.
fn over(period: f64) -> Scheme {
    Scheme { sampling: Sampling::Period(period), ..Scheme::default() }
}

/// Median peaks as measured; the band covers the rounding of the figures.
#[track_caller]
fn assert_close(found: [f64; 3], wanted: [f64; 3]) {
    let close = found.iter().zip(wanted).all(|(f, w)| (f - w).abs() <= 0.3);
    assert!(close, "median peaks {found:?}, wanted {wanted:?}");
}

#[test]
fn the_hundred_starts_at_fifty_milliseconds() {
    assert_close(all_keep_the_deadline(&starts(), DAMPING, over(0.05), 0.05), [7.7, 9.5, 9.8]);
    let measured = Scheme { sampling: Sampling::Measured { first: None }, ..Scheme::default() };
    all_keep_the_deadline(&starts(), DAMPING, measured, 0.05);
}

#[test]
fn three_hundred_other_starts_at_fifty_milliseconds() {
    all_keep_the_deadline(&drawn(300), DAMPING, over(0.05), 0.05);
}

#[test]
fn the_hundred_starts_at_ten_milliseconds() {
    assert_close(all_keep_the_deadline(&starts(), DAMPING, over(0.01), 0.01), [7.8, 9.6, 10.0]);
}

/// All hundred were run at 1 ms for the documentation's table; a fifth of them here, to save time.
#[test]
fn twenty_starts_at_one_millisecond() {
    all_keep_the_deadline(&starts()[..20], DAMPING, over(0.001), 0.001);
}

/// A vehicle that drives through the centre meets a row that nearly vanishes there; the bounds keep the
/// resulting input small. Without bounds, 1 of these 200 bicycles leaves again after arriving.
#[test]
fn a_heading_controller_and_bounds_at_fifty_milliseconds() {
    let bounded = Scheme { bounds: [60.0, 20.0], ..over(0.05) };
    all_keep_the_deadline(&starts(), HEADING, bounded, 0.05);
    all_keep_the_deadline(&drawn(100), HEADING, bounded, 0.05);
}

/// Prints the documentation's table: for all hundred starts in `tests/nightly`, for three here.
#[test]
fn table_of_the_hundred_starts() {
    let all: bool = std::env::var_os("PUNCTUAL_TABLES").is_some();
    let starts = if all { starts() } else { starts()[..3].to_vec() };
    let each = |one: &dyn Fn([f64; 4]) -> Run| starts.iter().map(|x0| one(*x0)).collect::<Vec<_>>();
    let settings = BarrierSettings::within(DEADLINE).rate(5.0).stay_rate(5.0).margin(0.02);
    println!(
        "step, sampling: on time / inside until 2T / that with every step met / median peak / p95, per model"
    );
    for step in [0.001, 0.01, 0.05] {
        for sampling in [Sampling::default(), Sampling::Period(step), Sampling::Pointwise] {
            let scheme = Scheme { sampling, ..Scheme::default() };
            let all = [
                each(&|x0| run_as(scheme, &PointMass, distance(), settings, DAMPING[0], step, x0)),
                each(&|x0| run_as(scheme, &Unicycle, distance(), settings, DAMPING[1], step, x0)),
                each(&|x0| run_as(scheme, &bicycle(), distance(), settings, DAMPING[2], step, x0)),
            ];
            let cell = |runs: &Vec<Run>| {
                let on_time = runs.iter().filter(|r| r.on_time(DEADLINE)).count();
                let inside = runs.iter().filter(|r| r.least_after >= 0.0).count();
                let kept = |r: &&Run| r.on_time(DEADLINE) && r.least_after >= 0.0 && r.satisfied;
                let kept = runs.iter().filter(kept).count();
                let sampled = sampling != Sampling::Pointwise;
                assert!(
                    !sampled || [on_time, inside, kept] == [runs.len(); 3],
                    "{step} {sampling:?}, {kept} kept"
                );
                format!("{on_time}/{inside}/{kept}/{:.1}/{:.1}", quantile(runs, 0.5), quantile(runs, 0.95))
            };
            println!("{step} {sampling:?}: {}", all.each_ref().map(cell).join("  "));
        }
    }
}
