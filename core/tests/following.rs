//! Sources that depend on quantities measured beside the plant, after its states in x.

use std::sync::Arc;

use punctual_core::barriers::{DistanceDisc, Outside};
use punctual_core::dynamics::WithPoint;
use punctual_core::filter::{BarrierSettings, Filter, FilterBuilder, SampleDerivative, Sampling};
use punctual_core::lie::{
    Ahead, DerivativeSource, Derivatives, Direction, EXPANSION_ORDERS, along, external, following,
};
use punctual_core::plants::{PointMass, Unicycle};

/// The states of a point mass, a point that another barrier follows, and this one's.
const X: [f64; 12] = [1.0, 2.0, 0.3, 0.4, 90.0, 91.0, 92.0, 93.0, 5.0, 4.0, -0.2, 0.7];
const OWN: [f64; 8] = [1.0, 2.0, 0.3, 0.4, 5.0, 4.0, -0.2, 0.7];
const U: [f64; 2] = [1.0, -1.0];

fn disc() -> DistanceDisc {
    DistanceDisc::new([4.0, 5.0], 2.0, 2.0).expect("valid disc").following(4)
}

/// A source on [`OWN`], and the same on [`X`].
fn sources() -> [Box<dyn DerivativeSource>; 2] {
    let beside = Arc::new(WithPoint::<_, 4>(PointMass));
    let alone = along::<_, _, 8, 2>(beside, disc(), 2).expect("in range");
    [alone, following::<_, _, 4, 8, 2>(Arc::new(PointMass), disc(), 2, 8).expect("in range")]
}

/// Those components of `all` that are the second source's own.
fn own<T: Copy>(all: &[T]) -> Vec<T> {
    [&all[..4], &all[8..]].concat()
}

#[test]
fn a_source_reads_and_moves_its_own_components() {
    let [alone, placed] = sources();
    assert_eq!([alone.state_dim(), placed.state_dim()], [8, 12]);
    let (mut found, mut wanted) = (Derivatives::ZERO, Derivatives::ZERO);
    placed.evaluate(0.0, &X, &mut found);
    alone.evaluate(0.0, &OWN, &mut wanted);
    assert_eq!(found, wanted);
    let [alone, placed] = [&alone, &placed].map(|source| source.predict().expect("a model"));
    let (mut moved, mut expected) = (X, OWN);
    placed.flow(&mut moved, &U, 0.1);
    alone.flow(&mut expected, &U, 0.1);
    assert_eq!((own(&moved), &moved[4..8]), (expected.to_vec(), &X[4..8]));
    let (mut found, mut wanted) = (Ahead::ZERO, Ahead::ZERO);
    placed.ahead(0.0, &X, &U, 0.1, &mut found);
    alone.ahead(0.0, &OWN, &U, 0.1, &mut wanted);
    assert_eq!(found, wanted);
    placed.values_of_row(0.0, &X, &U, 0.1, &mut found.value);
    assert_eq!(found.value[..2], wanted.value[..2]);
    assert_eq!(placed.value(0.0, &X), alone.value(0.0, &OWN));
    assert_eq!(placed.lowest_held(0.0, &X, &U, 0.1, 0.0), alone.lowest_held(0.0, &OWN, &U, 0.1, 0.0));
}

/// What it does not move stays where it is, in expansions too.
#[test]
fn expansions_of_other_components_are_constant() {
    let [alone, placed] = sources().map(|source| source);
    let [alone, placed] = [&alone, &placed].map(|source| source.predict().expect("a model"));
    let (mut rate, mut wanted_rate) = ([7.0; 12], [7.0; 8]);
    placed.rate(&X, &U, &mut rate);
    alone.rate(&OWN, &U, &mut wanted_rate);
    assert_eq!((own(&rate), &rate[4..8]), (wanted_rate.to_vec(), &[0.0; 4][..]));
    let (mut path, mut wanted) = ([[7.0; EXPANSION_ORDERS]; 12], [[7.0; EXPANSION_ORDERS]; 8]);
    placed.path(&X, &U, &mut path);
    alone.path(&OWN, &U, &mut wanted);
    assert_eq!(own(&path), wanted);
    for (expansion, x) in path[4..8].iter().zip(&X[4..]) {
        assert_eq!((expansion[0], &expansion[1..]), (*x, &[0.0; EXPANSION_ORDERS - 1][..]));
    }
    let (mut h, mut wanted_h) = ([0.0; EXPANSION_ORDERS], [0.0; EXPANSION_ORDERS]);
    placed.value_along(0.0, &path, &mut h);
    alone.value_along(0.0, &wanted, &mut wanted_h);
    assert_eq!(h, wanted_h);
}

#[test]
fn directions_are_its_own_too() {
    let [alone, placed] = sources();
    let dx: [f64; 12] = core::array::from_fn(|i| 0.3 - 0.07 * i as f64);
    let (own_dx, du) = (own(&dx), [0.5, 0.25]);
    let [of_all, of_own] = [&dx[..], &own_dx].map(|x| Direction { x, u: &du });
    let (mut found, mut wanted) = (Ahead::ZERO, Ahead::ZERO);
    let instants = [&placed, &alone].map(|source| source.directional().expect("a model"));
    instants[0].evaluate_directional(0.0, &X, &U, of_all, &mut found);
    instants[1].evaluate_directional(0.0, &OWN, &U, of_own, &mut wanted);
    assert_eq!(found, wanted);
    let [all, one] = [&placed, &alone].map(|source| source.predict_directional().expect("a model"));
    all.ahead_directional(0.0, &X, &U, of_all, 0.1, &mut found);
    one.ahead_directional(0.0, &OWN, &U, of_own, 0.1, &mut wanted);
    assert_eq!(found, wanted);
    let (mut x, mut moving, mut expected, mut expected_moving) = (X, dx, OWN, own_dx.clone());
    all.flow_directional(&mut x, &mut moving, &U, 0.1);
    one.flow_directional(&mut expected, &mut expected_moving, &U, 0.1);
    assert_eq!((own(&x), own(&moving)), (expected.to_vec(), expected_moving));
    assert_eq!((&x[4..8], &moving[4..8]), (&X[4..8], &dx[4..8]));
}

/// Two barriers, each behind a point of its own, and a goal of the plant: the bits of filters with each alone, and the
/// derivative of a sample that differences say.
#[test]
fn each_barrier_follows_its_own_point() {
    // Beside points in two places one object is two plants.
    let plant = Arc::new(Unicycle);
    let clear = |first: usize| {
        let disc = Outside(DistanceDisc::new([0.0, 0.0], 1.0, 1.0).expect("valid disc").following(4));
        following::<_, _, 4, 8, 2>(Arc::clone(&plant), disc, 2, first).expect("in range")
    };
    let goal = DistanceDisc::new([12.0, 5.0], 2.0, 2.0).expect("valid disc");
    let both = || {
        Filter::builder(Unicycle)
            .measured(8)
            .barrier("goal", goal, BarrierSettings::within(5.0))
            .and_then(|b| b.source("one", clear(4), BarrierSettings::keeping()))
            .and_then(|b| b.source("two", clear(8), BarrierSettings::keeping()))
            .and_then(|b| b.sampling(Sampling::Pointwise))
            .and_then(FilterBuilder::build)
            .expect("a filter")
    };
    let alone = |first: usize| {
        Filter::from_sources(4, 2)
            .measured(first)
            .source("it", clear(first), BarrierSettings::keeping())
            .and_then(|b| b.sampling(Sampling::Pointwise))
            .and_then(FilterBuilder::build)
            .expect("a filter")
    };
    let x = [0.0, 0.0, 0.3, 2.0, 5.0, 1.5, -1.0, 0.2, 4.0, 4.0, 0.3, -0.6];
    let (mut filter, mut u) = (both(), [0.0; 2]);
    let report = filter.step(0.0, &x, &[1.0, 0.0], &mut u).expect("the lengths").clone();
    for (barrier, first) in [(1, 4), (2, 8)] {
        let mut own = alone(first);
        let part = [&x[..4], &vec![0.0; first - 4], &x[first..first + 4]].concat();
        let wanted = own.step(0.0, &part, &[1.0, 0.0], &mut [0.0; 2]).expect("the lengths");
        assert_eq!(report.barriers[barrier].h, wanted.barriers[0].h);
        assert_eq!(report.barriers[barrier].row, wanted.barriers[0].row);
    }
    // Along the position of the second point.
    let mut dx = [0.0; 12];
    dx[8] = 1.0;
    let (mut filter, mut derivative) = (both(), SampleDerivative::default());
    let direction = Direction { x: &dx, u: &[0.0; 2] };
    let unknown = filter.differentiate(0.0, &x, &[1.0, 0.0], direction, &mut derivative);
    assert_eq!(unknown.expect("the lengths"), None);
    let h = |by: f64| {
        let mut x = x;
        x[8] += by;
        both().step(0.0, &x, &[1.0, 0.0], &mut [0.0; 2]).expect("the lengths").barriers[2].h
    };
    // Central differences over 1e-5 of a smooth function of order 1.
    assert!((derivative.barriers[2].h - (h(1e-5) - h(-1e-5)) / 2e-5).abs() < 1e-8);
    assert_eq!(derivative.barriers[0].h, 0.0);
}

#[test]
fn derivatives_from_elsewhere_predict_nothing() {
    let source = external(1, 1, 4).expect("in range");
    assert_eq!(source.state_dim(), 7);
    assert!(source.directional().is_some());
    assert!(source.predict().is_none() && source.predict_directional().is_none());
}

#[test]
fn a_point_does_not_lie_among_the_states() {
    let refused = following::<_, _, 4, 8, 2>(Arc::new(PointMass), disc(), 2, 3);
    let message = "first: is 3, must be >= 4, the number of states of the plant";
    assert_eq!(refused.err().map(|e| e.to_string()).as_deref(), Some(message));
}

#[test]
fn what_is_not_measured_is_refused() {
    let refused = |measured: usize| {
        let settings = BarrierSettings::keeping();
        let [_, placed] = sources();
        let builder = Filter::builder(PointMass).measured(measured).source("point", placed, settings);
        builder.err().map(|e| e.to_string())
    };
    assert_eq!(refused(8), None);
    assert_eq!(refused(4).as_deref(), Some("point.x: has 12 components, must have 8"));
    // A source of a smaller plant is not one of this plant.
    let smaller = along(Arc::new(PointMass), disc(), 2);
    let builder = Filter::from_sources(5, 2).measured(4);
    let message = builder.source("it", smaller.expect("in range"), BarrierSettings::keeping()).err();
    assert_eq!(message.map(|e| e.to_string()).as_deref(), Some("it.x: has 4 components, must have 5"));
}
