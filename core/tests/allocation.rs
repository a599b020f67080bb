//! The promise of `Filter::step`: it does not allocate.
//!
//! The allocator of this test binary counts, thread by thread.

mod scenario;

use punctual_core::convergence::repeated_root;
use punctual_core::filter::{BarrierSettings, Filter, Method, SampleDerivative, Sampling, Status};
use punctual_core::lie::Direction;
use punctual_core::plants::{Bicycle, PointMass, Unicycle};
use scenario::{distance_disc, one, quadratic_disc};

/// Number of allocations that `work` makes on this thread.
fn allocations(work: impl FnOnce()) -> u64 {
    allocation_counter::measure(work).count_total
}

#[test]
fn the_counter_counts() {
    assert_eq!(allocations(|| drop(std::hint::black_box(Box::new(1)))), 1);
    assert_eq!(allocations(|| drop(std::hint::black_box(vec![0_u8; 100]))), 1);
}

fn filters() -> Vec<(&'static str, Filter)> {
    let settings = BarrierSettings::within(5.0);
    let repeated = settings.method(Method::RepeatedRoot);
    let bounded = Filter::builder(PointMass)
        .barrier("goal", distance_disc(), settings)
        .and_then(|b| b.bounds(&[-50.0, -50.0], &[50.0, 50.0]))
        .and_then(punctual_core::filter::FilterBuilder::build)
        .expect("valid filter");
    let sampled = |sampling: Sampling| {
        Filter::builder(Unicycle)
            .barrier("goal", distance_disc(), settings)
            .and_then(|b| b.sampling(sampling))
            .and_then(punctual_core::filter::FilterBuilder::build)
            .expect("valid filter")
    };
    let several = |sampling: Sampling| {
        Filter::builder(PointMass)
            .barrier("goal", distance_disc(), settings)
            .and_then(|b| b.barrier("soon", distance_disc(), BarrierSettings::within(3.0)))
            .and_then(|b| b.barrier("near", quadratic_disc(), BarrierSettings::within(4.0)))
            .and_then(|b| b.bounds(&[-5.0, -5.0], &[5.0, 5.0]))
            .and_then(|b| b.sampling(sampling))
            .and_then(punctual_core::filter::FilterBuilder::build)
            .expect("valid filter")
    };
    let bicycle = Bicycle::new(10.0).expect("valid bicycle");
    vec![
        ("point mass", one(PointMass, distance_disc(), settings)),
        ("unicycle", one(Unicycle, distance_disc(), settings)),
        ("bicycle, repeated root", one(bicycle, quadratic_disc(), repeated)),
        ("point mass, bounded", bounded),
        ("three barriers", several(Sampling::Pointwise)),
        ("three barriers, sampled", several(Sampling::Period(0.005))),
        ("unicycle, sampled", sampled(Sampling::Period(0.005))),
        ("unicycle, measured period", sampled(Sampling::Measured { first: None })),
    ]
}

#[test]
fn roots_of_the_highest_order_allocate_nothing() {
    let e = [-7.0, 2.0, -1.5, 0.4, 3.0, -2.0, 0.1, 5.0];
    for n in 1..=e.len() {
        let found = allocations(|| {
            let _ = std::hint::black_box(repeated_root::rate(&e[..n], 3.0));
            let _ = std::hint::black_box(repeated_root::deadlines(&e[..n]));
        });
        assert_eq!(found, 0, "n = {n}");
    }
}

/// All that a barrier can go through: anchor, filtered and unchanged steps, infeasible rows,
/// invalid and singular samples, arrival, deadline, re-arming, peeking.
#[test]
fn a_step_allocates_nothing() {
    for (name, mut filter) in filters() {
        let (mut u, mut seen) = ([0.0; 2], [false; Status::ALL.len()]);
        let first = allocations(|| {
            filter.step(0.0, &[0.0; 4], &[0.0; 2], &mut u).expect("right dimensions");
        });
        assert_eq!(first, 0, "{name}: the first step");
        let mut derivative = SampleDerivative::default();
        let direction = Direction { x: &[0.1, -0.2, 0.3, -0.4], u: &[0.5, -0.6] };
        filter.differentiate(0.0, &[0.0; 4], &[0.0; 2], direction, &mut derivative).expect("lengths");
        let found = allocations(|| {
            for k in 1..2000 {
                let t = f64::from(k) * 0.005;
                let inside = t > 3.0;
                let mut x = if inside { [44.0, 45.2, 0.1, 0.2] } else { [8.0 * t, 7.0 * t, 0.3, 5.0] };
                match k % 50 {
                    10 => x[1] = f64::NAN,
                    20 => x[0] = 1e300,
                    30 => x[3] = -200.0,
                    // On the way out.
                    40 => x = [43.2, 45.0, -0.9, 0.1],
                    _ => {}
                }
                let u_ref = [0.1, -0.1];
                filter.peek(t, &x, &u_ref, &mut u).expect("right dimensions");
                filter.differentiate(t, &x, &u_ref, direction, &mut derivative).expect("lengths");
                let report = filter.step(t, &x, &u_ref, &mut u).expect("right dimensions");
                seen[report.status as usize] = true;
                if k == 1000 {
                    filter.rearm();
                }
            }
        });
        assert_eq!(found, 0, "{name}: 1999 steps");
        for status in [Status::Unchanged, Status::Filtered, Status::InvalidInput, Status::Singular] {
            assert!(seen[status as usize], "{name}: {status:?} was not exercised");
        }
    }
}
