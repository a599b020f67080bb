//! A source of derivatives on some states of a larger plant.

use std::sync::Arc;

use punctual_core::barriers::DistanceDisc;
use punctual_core::lie::{Ahead, DerivativeSource, Derivatives, Direction, along, embedded, external};
use punctual_core::plants::PointMass;

const X: [f64; 7] = [9.0, 2.0, 0.4, 0.3, 9.0, 9.0, 1.0];
const OWN: [f64; 4] = [1.0, 2.0, 0.3, 0.4];

/// A source, and the same on the states of [`OWN`] in [`X`].
fn sources() -> (Box<dyn DerivativeSource>, Box<dyn DerivativeSource>) {
    let source = || {
        let disc = DistanceDisc::new([4.0, 5.0], 2.0, 2.0).expect("valid disc");
        along(Arc::new(PointMass), disc, 2).expect("in range")
    };
    (source(), embedded(source(), 7, &[6, 1, 3, 2]).expect("valid picks"))
}

#[test]
fn the_picked_states_are_the_source_s_own() {
    let (model, picked) = sources();
    let (mut found, mut wanted) = (Derivatives::ZERO, Derivatives::ZERO);
    picked.evaluate(0.0, &X, &mut found);
    model.evaluate(0.0, &OWN, &mut wanted);
    assert_eq!(found, wanted);
    let (mut moved, mut expected) = (X, OWN);
    let (model, picked) = (model.predict().expect("a model"), picked.predict().expect("a model"));
    picked.flow(&mut moved, &[1.0, -1.0], 0.1);
    model.flow(&mut expected, &[1.0, -1.0], 0.1);
    assert_eq!([moved[6], moved[1], moved[3], moved[2]], expected);
    assert_eq!([moved[0], moved[4], moved[5]], [9.0; 3]);
    let (mut found, mut wanted) = (Ahead::ZERO, Ahead::ZERO);
    picked.ahead(0.0, &X, &[1.0, -1.0], 0.1, &mut found);
    model.ahead(0.0, &OWN, &[1.0, -1.0], 0.1, &mut wanted);
    assert_eq!(found, wanted);
    picked.values_of_row(0.0, &X, &[1.0, -1.0], 0.1, &mut found.value);
    assert_eq!(found.value[..2], wanted.value[..2]);
}

#[test]
fn all_states_in_another_order_are_picked() {
    let (model, _) = sources();
    for (picks, x) in [([0, 1, 2, 3], OWN), ([2, 3, 0, 1], [OWN[2], OWN[3], OWN[0], OWN[1]])] {
        let picked = embedded(sources().0, 4, &picks).expect("valid picks");
        let (mut found, mut wanted) = (Derivatives::ZERO, Derivatives::ZERO);
        picked.evaluate(0.0, &x, &mut found);
        model.evaluate(0.0, &OWN, &mut wanted);
        assert_eq!(found, wanted, "{picks:?}");
    }
}

#[test]
fn directions_are_picked_too() {
    let (model, picked) = sources();
    let (dx, own_dx, u, du) =
        ([9.0, 0.2, -0.4, 0.3, 9.0, 9.0, 0.1], [0.1, 0.2, 0.3, -0.4], [1.0, -1.0], [0.5, 0.25]);
    let [of_all, of_own] = [&dx[..], &own_dx].map(|x| Direction { x, u: &du });
    let (mut found, mut wanted) = (Ahead::ZERO, Ahead::ZERO);
    let instants = [&picked, &model].map(|source| source.directional().expect("a model"));
    instants[0].evaluate_directional(0.0, &X, &u, of_all, &mut found);
    instants[1].evaluate_directional(0.0, &OWN, &u, of_own, &mut wanted);
    assert_eq!(found, wanted);
    let [all, own] = [&picked, &model].map(|source| source.predict_directional().expect("a model"));
    all.ahead_directional(0.0, &X, &u, of_all, 0.1, &mut found);
    own.ahead_directional(0.0, &OWN, &u, of_own, 0.1, &mut wanted);
    assert_eq!(found, wanted);
    let (mut x, mut moving, mut expected, mut expected_moving) = (X, dx, OWN, own_dx);
    all.flow_directional(&mut x, &mut moving, &u, 0.1);
    own.flow_directional(&mut expected, &mut expected_moving, &u, 0.1);
    assert_eq!([x[6], x[1], x[3], x[2]], expected);
    assert_eq!([moving[6], moving[1], moving[3], moving[2]], expected_moving);
    assert_eq!([x[0], moving[4]], [9.0; 2]);
}

#[test]
fn what_the_source_cannot_the_picked_one_cannot() {
    let picked = embedded(external(1, 1).expect("in range"), 4, &[3, 1, 0]).expect("valid picks");
    assert!(picked.directional().is_some());
    assert!(picked.predict().is_none() && picked.predict_directional().is_none());
}

#[test]
fn picks_are_checked() {
    let refused = |picks: &[usize]| {
        let disc = DistanceDisc::new([4.0, 5.0], 2.0, 2.0).expect("valid disc");
        let source = along(Arc::new(PointMass), disc, 2).expect("in range");
        embedded(source, 5, picks).err().map(|e| e.to_string())
    };
    assert_eq!(refused(&[0, 1, 2]).as_deref(), Some("picks: has 3 components, must have 4"));
    let wanted = "picks[3]: is 5, must be < 5, the number of states";
    assert_eq!(refused(&[0, 1, 5, 2]).as_deref(), Some(wanted));
}
