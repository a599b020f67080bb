//! How the promise holds if the plant is another bicycle than the filter's.

use punctual_study::bicycles::{Model, Pairing, Remedy, Size};

use super::starts::starts;

/// For the car, the model does not matter. With the margin, the promise of a filter for the simplified
/// bicycle also holds on the more exact plants. So does that of filters for the exact models that integrate
/// the angle themselves.
#[test]
fn a_car_is_kept_by_whichever_model() {
    let starts = &starts()[..20];
    let runs = |filter: Model, plant: Model| {
        let pairing = Pairing { size: Size::CAR, filter, remedy: Remedy::NONE, plant, step: 0.01 };
        pairing.runs(starts).expect("a valid filter and plant")
    };
    for plant in Model::ALL {
        let found = runs(Model::Simplified, plant);
        assert!(found.kept() && found.least >= 0.0, "simplified on {plant:?}: {found:?}");
        if plant != Model::Simplified {
            let found = runs(Model::SmallSlip, plant);
            assert!(found.kept(), "small slip on {plant:?}: {found:?}");
        }
    }
    let found = runs(Model::Kinematic, Model::Kinematic);
    assert!(found.kept(), "kinematic on kinematic: {found:?}");
}
