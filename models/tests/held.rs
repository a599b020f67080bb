//! Features that are narrow between two samples, for plants and sets given by expressions.

use punctual_core::filter::{BarrierSettings, Filter, FilterBuilder, Sampling};
use punctual_models::Model;

/// Ditches with a width of a tenth to a thousandth of a hold, and equally narrow gusts that push a vehicle
/// into a ditch it was clear of. No sample whose hold crosses one is on course.
#[test]
fn what_is_on_course_crosses_nothing_narrow() {
    let ditch = "1 - 2 * exp(-((p - at) / w)^2)";
    let gust = "a - force * exp(-((p - at) / w)^2)";
    for (rate, h) in [("a", ditch), (gust, "v + 1")] {
        let [mut on_course, mut crossed] = [0_u32; 2];
        for case in 0..60_u32 {
            let part = |of: u32| f64::from(case * of % 61) / 61.0;
            let (period, speed) = (0.02 + 0.08 * part(31), 5.0 + 10.0 * part(45));
            let width = period * speed * 10.0_f64.powf(-1.0 - 2.0 * part(17));
            let at = (20.0 + part(59)) * period * speed;
            // The gust takes three times the energy that the vehicle has.
            let force =
                3.0 * speed * speed / (2.0 * width * std::f64::consts::PI.sqrt()) + 3.0 * speed / width;
            let parameters = [("at", at), ("w", width), ("force", force)];
            let model = Model::new(&["p", "v"], &["a"], &parameters, &["v", rate]).expect("a model");
            let degree = if h == ditch { 2 } else { 1 };
            let source = model.barrier(h).and_then(|b| b.source(degree)).expect("a barrier");
            let mut filter = Filter::from_sources(2, 1)
                .source("ditch", source, BarrierSettings::keeping())
                .and_then(|b| b.bounds(&[-0.5], &[0.5]))
                .and_then(|b| b.sampling(Sampling::Period(period)))
                .and_then(FilterBuilder::build)
                .expect("valid filter");
            for k in 0..40_u32 {
                let from = f64::from(k) * period * speed;
                let mut u = [0.0];
                filter.step(f64::from(k) * period, &[from, speed], &[0.0], &mut u).expect("dimensions");
                let crosses = from + width < at && at + width < from + period * speed;
                let speaks = filter.report().barriers[0].on_course;
                assert!(!speaks || !crosses, "{h}, case {case}: {width} at {at}");
                on_course += u32::from(speaks);
                crossed += u32::from(crosses);
            }
        }
        assert!(crossed > 55 && on_course > 60 * 37, "{h}: {on_course} {crossed}");
    }
}
