//! A source of derivatives on some states of a larger plant.

use punctual_core::barriers::DistanceDisc;
use punctual_core::lie::{Ahead, Derivatives, along, embedded};
use punctual_reference::plants::PointMass;

#[test]
fn the_picked_states_are_the_source_s_own() {
    let source = || {
        let disc = DistanceDisc::new([4.0, 5.0], 2.0, 2.0).expect("valid disc");
        along(PointMass, disc, 2).expect("in range")
    };
    let embedded = embedded(source(), 7, &[6, 1, 3, 2]).expect("valid picks");
    let (x, own) = ([9.0, 2.0, 0.4, 0.3, 9.0, 9.0, 1.0], [1.0, 2.0, 0.3, 0.4]);
    let (mut found, mut wanted) = (Derivatives::ZERO, Derivatives::ZERO);
    embedded.evaluate(0.0, &x, &mut found);
    source().evaluate(0.0, &own, &mut wanted);
    assert_eq!(found, wanted);
    let (mut moved, mut expected) = (x, own);
    assert!(embedded.predict(&mut moved, &[1.0, -1.0], 0.1));
    source().predict(&mut expected, &[1.0, -1.0], 0.1);
    assert_eq!([moved[6], moved[1], moved[3], moved[2]], expected);
    assert_eq!([moved[0], moved[4], moved[5]], [9.0; 3]);
    let (mut found, mut wanted) = (Ahead::ZERO, Ahead::ZERO);
    assert!(embedded.ahead(0.0, &x, &[1.0, -1.0], 0.1, &mut found));
    source().ahead(0.0, &own, &[1.0, -1.0], 0.1, &mut wanted);
    assert_eq!(found, wanted);
}

#[test]
fn picks_are_checked() {
    let refused = |picks: &[usize]| {
        let disc = DistanceDisc::new([4.0, 5.0], 2.0, 2.0).expect("valid disc");
        let source = along(PointMass, disc, 2).expect("in range");
        embedded(source, 5, picks).err().map(|e| e.to_string())
    };
    assert_eq!(refused(&[0, 1, 2]).as_deref(), Some("picks: has 3 components, must have 4"));
    let wanted = "picks[3]: is 5, must be < 5, the number of states";
    assert_eq!(refused(&[0, 1, 5, 2]).as_deref(), Some(wanted));
}
