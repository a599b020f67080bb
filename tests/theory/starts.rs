//! Random initial conditions: the 100 of the documentation's tables, and others.

use punctual_core::dynamics::ControlAffine;
use punctual_core::filter::{BarrierSettings, Method};
use punctual_core::plants::{PointMass, Unicycle};
use punctual_study::starts::{self, hundred};

use super::{Nominal, Run, bicycle, coast, damp_speed, damp_velocity, distance, quadratic, run};

pub(super) const DEADLINE: f64 = 5.0;
const STEP: f64 = 1e-3;

pub(super) fn starts() -> Vec<[f64; 4]> {
    hundred(100)
}

/// Numbers in [0, 1), always the same.
pub(super) fn uniform() -> impl FnMut() -> f64 {
    starts::uniform(2507_13888)
}

/// Starts from the same box, drawn here, since the figures must not depend on one file.
pub(super) fn drawn(count: usize) -> Vec<[f64; 4]> {
    starts::drawn(2507_13888, count)
}

/// The method of the documentation's table: a = 5, ε = 2, μ = 0.02, nominal damping.
fn profile_runs<P>(plant: &P, nominal: Nominal, starts: &[[f64; 4]]) -> Vec<Run>
where
    P: ControlAffine<4, 2> + Clone + Send + Sync + 'static,
{
    let settings = BarrierSettings::within(DEADLINE).rate(5.0).stay_rate(5.0).margin(0.02);
    starts.iter().map(|x0| run(plant, distance(), settings, nominal, STEP, *x0)).collect()
}

/// The quantile `part` of the peaks.
pub(super) fn quantile(runs: &[Run], part: f64) -> f64 {
    let mut peaks: Vec<f64> = runs.iter().map(|r| r.peak).collect();
    peaks.sort_by(f64::total_cmp);
    peaks[((peaks.len() - 1) as f64 * part).round() as usize]
}

pub(super) fn assert_all_keep_the_deadline(name: &str, runs: &[Run], starts: &[[f64; 4]]) {
    let on_time = runs.iter().filter(|r| r.on_time(DEADLINE)).count();
    let inside = runs.iter().filter(|r| r.least_after >= 0.0).count();
    let lost = runs.iter().zip(starts).find(|(r, _)| !r.on_time(DEADLINE) || r.least_after < 0.0);
    assert_eq!((on_time, inside), (runs.len(), runs.len()), "{name}, first lost: {lost:?}");
}

/// 100/100/100 on time and inside until 2T, median peak |u₁| 7.9/9.7/10.1. The band of ±0.2 covers the
/// rounding of the figures and the definition of a median of 100.
#[test]
fn all_hundred_starts_keep_the_deadline_with_moderate_inputs() {
    let starts = starts();
    assert_eq!(starts.len(), 100);
    let check = |name: &str, runs: Vec<Run>, median: f64| {
        assert_all_keep_the_deadline(name, &runs, &starts);
        let found = quantile(&runs, 0.5);
        assert!((found - median).abs() <= 0.2, "{name}: median peak {found}, p95 {}", quantile(&runs, 0.95));
    };
    check("point mass", profile_runs(&PointMass, damp_velocity, &starts), 7.9);
    check("unicycle", profile_runs(&Unicycle, damp_speed, &starts), 9.7);
    check("bicycle", profile_runs(&bicycle(), damp_speed, &starts), 10.1);
}

/// Starts not in the file.
#[test]
fn other_starts_keep_the_deadline_too() {
    let starts = drawn(30);
    let runs = profile_runs(&PointMass, damp_velocity, &starts);
    assert_all_keep_the_deadline("point mass", &runs, &starts);
    let runs = profile_runs(&Unicycle, damp_speed, &starts);
    assert_all_keep_the_deadline("unicycle", &runs, &starts);
    let runs = profile_runs(&bicycle(), damp_speed, &starts);
    assert_all_keep_the_deadline("bicycle", &runs, &starts);
}

/// The paper's method on the same 100 starts: 23/3/3 by exactly 5.000 s, 100/100/100 by 7.5 s (the paper
/// itself: 100/100/99), every point mass by 5.015 s.
///
/// If a vehicle turns perpendicular to the line of sight, the row nearly vanishes, the held input overshoots,
/// and the run chatters. Round-off then decides whether the unicycle of start 97 ends inside or circling. So
/// up to two of a hundred are left to chance.
#[test]
fn the_repeated_root_on_the_hundred_starts() {
    const CHANCE: usize = 2;
    let settings = BarrierSettings::within(DEADLINE).method(Method::RepeatedRoot);
    let starts = starts();
    let arrivals =
        |runs: Vec<Run>| -> Vec<f64> { runs.iter().map(|r| r.arrival.unwrap_or(f64::INFINITY)).collect() };
    let by = |arrivals: &[f64], t: f64| arrivals.iter().filter(|a| **a <= t).count();
    let runs = starts.iter().map(|x0| run(&PointMass, quadratic(), settings, coast, STEP, *x0)).collect();
    let point_mass = arrivals(runs);
    let runs = starts.iter().map(|x0| run(&Unicycle, quadratic(), settings, coast, STEP, *x0)).collect();
    let unicycle = arrivals(runs);
    let runs = starts.iter().map(|x0| run(&bicycle(), quadratic(), settings, coast, STEP, *x0)).collect();
    let bicycle = arrivals(runs);
    let all = [&point_mass, &unicycle, &bicycle];
    let late = all.map(|a| by(a, 1.5 * DEADLINE));
    assert!(late[0] == 100 && late[1] + CHANCE >= 100 && late[2] + CHANCE >= 100, "{late:?} by 7.5 s");
    assert_eq!(by(&point_mass, 5.015), 100);
    for (found, wanted) in all.map(|a| by(a, DEADLINE)).into_iter().zip([23_usize, 3, 3]) {
        assert!(found.abs_diff(wanted) <= CHANCE, "{found} by the deadline, wanted {wanted}");
    }
}
