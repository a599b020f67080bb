//! Misuse: a valid filter first, then one defect at a time, and the message it gives.

use crate::scenario;

use std::sync::Arc;

use punctual_core::barriers::{DistanceDisc, QuadraticDisc};
use punctual_core::filter::{BarrierSettings, Filter, FilterState, Method};
use punctual_core::lie;
use punctual_core::plants::{Bicycle, PointMass};
use punctual_core::{Error, ErrorKind};
use punctual_reference::simulation::{Schedule, closed_loop};
use scenario::{Integrator, NonNegative, damping, distance_disc, goal};

/// A filter with these settings and bounds, valid if they are.
fn build(settings: BarrierSettings, bounds: [[f64; 2]; 2], limit: f64) -> Result<Filter, Error> {
    Filter::builder(PointMass)
        .barrier("goal", distance_disc(), settings)?
        .bounds(&bounds[0], &bounds[1])?
        .correction_limit(limit)?
        .build()
}

const BOUNDS: [[f64; 2]; 2] = [[-1.0, -1.0], [1.0, 1.0]];

#[track_caller]
fn refused<T>(result: Result<T, Error>, kind: ErrorKind, message: &str) {
    let Err(error) = result else { panic!("accepted, wanted: {message}") };
    assert_eq!((error.to_string().as_str(), error.kind()), (message, kind));
    assert_eq!(format!("{}: {}", error.field(), error.message()), message);
}

#[test]
fn settings_out_of_range_are_refused() {
    let good = BarrierSettings::within(5.0);
    assert!(build(good, BOUNDS, 1e6).is_ok());
    let bad = |settings, message: &str| refused(build(settings, BOUNDS, 1e6), ErrorKind::Range, message);

    for (value, shown) in [(-1.0, "-1"), (0.0, "0"), (f64::NAN, "NaN"), (f64::INFINITY, "inf")] {
        let message = |field: &str| format!("goal.{field}: is {shown}, must be finite and > 0");
        bad(good.deadline(value), &message("deadline"));
        bad(good.rate(value), &message("rate"));
        bad(good.stay_rate(value), &message("stay_rate"));
    }
    for (value, shown) in [(-1.0, "-1"), (f64::NAN, "NaN"), (f64::INFINITY, "inf")] {
        let message = format!("goal.margin: is {shown}, must be finite and >= 0");
        bad(good.margin(value), &message);
        let message = format!("goal.disturbance: is {shown}, must be finite and >= 0");
        bad(good.disturbance(value), &message);
    }
    assert!(build(good.margin(0.0), BOUNDS, 1e6).is_ok());
}

#[test]
fn a_deadline_out_of_range_is_named_even_through_its_default_rates() {
    for (value, shown) in [(-1.0, "-1"), (0.0, "0"), (f64::NAN, "NaN"), (f64::INFINITY, "inf")] {
        let message = format!("goal.deadline: is {shown}, must be finite and > 0");
        refused(build(BarrierSettings::within(value), BOUNDS, 1e6), ErrorKind::Range, &message);
    }
}

#[test]
fn bounds_out_of_range_are_refused() {
    let settings = BarrierSettings::within(5.0);
    let bad = |bounds, message: &str| refused(build(settings, bounds, 1e6), ErrorKind::Range, message);
    bad([[-1.0, 2.0], [1.0, 1.0]], "u_min[2]: is 2, must be <= u_max[2] = 1");
    bad([[f64::NAN, -1.0], [1.0, 1.0]], "u_min[1]: is NaN, must be a number or -infinity");
    bad([[f64::INFINITY, -1.0], [1.0, 1.0]], "u_min[1]: is inf, must be a number or -infinity");
    bad([[-1.0, -1.0], [1.0, f64::NAN]], "u_max[2]: is NaN, must be a number or +infinity");
    bad([[-1.0, -1.0], [1.0, f64::NEG_INFINITY]], "u_max[2]: is -inf, must be a number or +infinity");
    for limit in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let message = format!("correction_limit: is {limit}, must be finite and > 0");
        refused(build(settings, BOUNDS, limit), ErrorKind::Range, &message);
    }
    assert!(build(settings, [[f64::NEG_INFINITY, 1.0], [f64::INFINITY, 1.0]], 1e6).is_ok());
}

#[test]
fn shapes_and_models_out_of_range_are_refused() {
    for (value, shown) in [(0.0, "0"), (-2.0, "-2"), (f64::NAN, "NaN"), (f64::INFINITY, "inf")] {
        let message = |field: &str| format!("{field}: is {shown}, must be finite and > 0");
        refused(QuadraticDisc::new([0.0; 2], value), ErrorKind::Range, &message("radius"));
        refused(DistanceDisc::new([0.0; 2], value, 1.0), ErrorKind::Range, &message("radius"));
        refused(DistanceDisc::new([0.0; 2], 1.0, value), ErrorKind::Range, &message("smoothing"));
        refused(Bicycle::new(value), ErrorKind::Range, &message("l_r"));
    }
    refused(QuadraticDisc::new([0.0, f64::NAN], 1.0), ErrorKind::Range, "centre[2]: is NaN, must be finite");
    refused(
        DistanceDisc::new([f64::NEG_INFINITY, 0.0], 1.0, 1.0),
        ErrorKind::Range,
        "centre[1]: is -inf, must be finite",
    );
}

#[test]
fn the_repeated_root_needs_relative_degree_two_or_more() {
    let settings = BarrierSettings::within(5.0).method(Method::RepeatedRoot);
    let source = lie::along(Arc::new(Integrator::<1>), NonNegative, 1).expect("in range");
    refused(
        Filter::from_sources(1, 1).source("line", source, settings),
        ErrorKind::Unsupported,
        "line.method: the repeated root does not exist for relative degree 1; use the reference profile",
    );
    let source = lie::along(Arc::new(Integrator::<3>), NonNegative, 3).expect("in range");
    assert!(Filter::from_sources(3, 1).source("line", source, settings).is_ok());
    assert!(build(settings, BOUNDS, 1e6).is_ok());
}

#[test]
fn wrong_dimensions_are_refused_when_building() {
    let settings = BarrierSettings::within(5.0);
    let dimension = ErrorKind::Dimension;
    let source = || lie::along(Arc::new(PointMass), distance_disc(), 2).expect("in range");
    refused(
        Filter::from_sources(3, 2).source("goal", source(), settings),
        dimension,
        "goal.x: has 4 components, must have 3",
    );
    refused(
        Filter::from_sources(4, 1).source("goal", source(), settings),
        dimension,
        "goal.u: has 2 components, must have 1",
    );
    refused(
        Filter::from_sources(4, 2).bounds(&[0.0], &[1.0, 1.0]),
        dimension,
        "u_min: has 1 components, must have 2",
    );
    refused(
        Filter::from_sources(4, 2).bounds(&[0.0; 2], &[1.0; 3]),
        dimension,
        "u_max: has 3 components, must have 2",
    );
    refused(Filter::from_sources(4, 2).build(), dimension, "barriers: is empty, must have at least 1");
    // More inputs than the library carries: refused, not a panic, also through the bounds.
    let wide = Filter::from_sources(4, 33).bounds(&[0.0; 33], &[1.0; 33]).expect("bounds as many as inputs");
    refused(wide.source("goal", source(), settings), dimension, "goal.u: has 2 components, must have 33");
}

#[test]
fn wrong_dimensions_are_refused_at_the_step_and_leave_everything_as_it_was() {
    let mut filter = goal(BarrierSettings::within(5.0));
    let (x, r) = ([0.0; 4], [0.0; 2]);
    let mut u = [7.0; 3];
    let dimension = ErrorKind::Dimension;
    refused(
        filter.step(0.0, &x[..3], &r, &mut u[..2]).cloned(),
        dimension,
        "x: has 3 components, must have 4",
    );
    refused(
        filter.step(0.0, &x, &r[..1], &mut u[..2]).cloned(),
        dimension,
        "u_ref: has 1 components, must have 2",
    );
    refused(filter.peek(0.0, &x, &r, &mut u).cloned(), dimension, "u: has 3 components, must have 2");
    assert_eq!(u, [7.0; 3]);
    refused(
        filter.restore(&FilterState { barriers: vec![Default::default(); 2], ..Default::default() }),
        dimension,
        "barriers: has 2 components, must have 1",
    );
    assert_eq!(*filter.state(), FilterState { barriers: vec![Default::default()], ..Default::default() });
}

#[test]
fn a_run_needs_a_step() {
    let mut filter = goal(BarrierSettings::within(5.0));
    for step in [0.0, -1.0, f64::NAN] {
        let schedule = Schedule { step, steps: 1, substeps: 1 };
        let result = closed_loop(&mut filter, &PointMass, [0.0; 4], schedule, damping, |_, _, _, _| {});
        refused(result, ErrorKind::Range, &format!("step: is {step}, must be finite and > 0"));
    }
}
