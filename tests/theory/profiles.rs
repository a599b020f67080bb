//! Savings of the profile of least peak: peak inputs of the hundred starts, and the earliest deadline.

use punctual_core::barriers::DistanceDisc;
use punctual_core::dynamics::ControlAffine;
use punctual_core::filter::{BarrierSettings, ProfileKind};
use punctual_core::plants::{PointMass, Unicycle};

use super::starts::{DEADLINE, assert_all_keep_the_deadline, quantile, starts};
use super::{Nominal, Run, bicycle, damp_speed, damp_velocity, distance, run};

const STEP: f64 = 0.01;

/// Runs at 10 ms with rate 5, margin 0.02 and damping.
fn runs<P>(profile: ProfileKind, plant: &P, nominal: Nominal) -> Vec<Run>
where
    P: ControlAffine<4, 2> + Clone + Send + Sync + 'static,
{
    let settings = BarrierSettings::within(DEADLINE).profile(profile).rate(5.0).stay_rate(5.0).margin(0.02);
    let disc: DistanceDisc = distance();
    starts().iter().map(|x0| run(plant, disc, settings, nominal, STEP, *x0)).collect()
}

/// Median and 95th percentile of the peak |u₁|; every start is on time and inside with both profiles. The
/// tail of the bicycle gains nothing: in hard turns the row determines the input, not the profile.
#[test]
fn low_peaks_on_the_hundred_starts() {
    let starts = starts();
    let check = |name: &str, profile, runs: Vec<Run>, wanted: [f64; 2]| {
        assert_all_keep_the_deadline(name, &runs, &starts);
        let found = [quantile(&runs, 0.5), quantile(&runs, 0.95)];
        let close = (found[0] - wanted[0]).abs() < 0.2 && (found[1] / wanted[1] - 1.0).abs() < 0.1;
        assert!(close, "{name}, {profile:?}: median and p95 {found:?}, wanted {wanted:?}");
    };
    for (profile, [point_mass, unicycle, slow]) in [
        (ProfileKind::Hermite, [[7.9, 16.6], [9.7, 14.5], [10.1, 20.5]]),
        (ProfileKind::LowPeak, [[6.4, 12.5], [8.2, 14.0], [9.3, 23.0]]),
    ] {
        check("point mass", profile, runs(profile, &PointMass, damp_velocity), point_mass);
        check("unicycle", profile, runs(profile, &Unicycle, damp_speed), unicycle);
        check("bicycle", profile, runs(profile, &bicycle(), damp_speed), slow);
    }
}
