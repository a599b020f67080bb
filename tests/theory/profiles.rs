//! What the profile of least peak saves: peak inputs of the hundred starts, and the soonest deadline.

use punctual_core::barriers::DistanceDisc;
use punctual_core::dynamics::ControlAffine;
use punctual_core::filter::{BarrierSettings, ProfileKind};
use punctual_core::plants::{PointMass, Unicycle};

use super::starts::{DEADLINE, assert_all_keep_the_deadline, quantile, starts};
use super::{Nominal, Run, bicycle, damp_speed, damp_velocity, distance, run};

const STEP: f64 = 0.01;

/// At 10 ms with rate 5, margin 0.02 and damping.
fn runs<P>(profile: ProfileKind, plant: &P, nominal: Nominal) -> Vec<Run>
where
    P: ControlAffine<4, 2> + Clone + Send + 'static,
{
    let settings = BarrierSettings {
        profile,
        rate: Some(5.0),
        stay_rate: Some(5.0),
        margin: 0.02,
        ..BarrierSettings::within(DEADLINE)
    };
    let disc: DistanceDisc = distance();
    starts().iter().map(|x0| run(plant, disc, settings, nominal, STEP, *x0)).collect()
}

/// Median and 95th percentile of the peak |u₁|; every start on time and inside with both.
#[test]
fn low_peaks_on_the_hundred_starts() {
    let starts = starts();
    let mut figures = Vec::new();
    for profile in [ProfileKind::Hermite, ProfileKind::LowPeak] {
        let all = [
            ("point mass", runs(profile, &PointMass, damp_velocity)),
            ("unicycle", runs(profile, &Unicycle, damp_speed)),
            ("bicycle", runs(profile, &bicycle(), damp_speed)),
        ];
        for (name, runs) in all {
            assert_all_keep_the_deadline(name, &runs, &starts);
            figures.push([quantile(&runs, 0.5), quantile(&runs, 0.95)]);
        }
    }
    assert!(figures.is_empty(), "{figures:?}");
}
