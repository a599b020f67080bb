//! Whole runs are bitwise those of FMI 2.0, with arrays and with scalars.

use super::slave::Slave;
use crate::api::three::API;
use crate::api::{API as API2, OK};
use crate::fmu::{EXTERNAL, FILTER, Fmu, PLANT, STEERED};

const CONTROLLER: &str = "kind = \"controller\"\nplant.model = \"unicycle\"\ncontroller = \"waypoints\"\n\
                          points = [[1.0, 2.0], [3.0, 4.0]]\nacceptance_radius = 0.5\n";
/// Inputs that change at each step.
fn inputs(count: usize, k: usize) -> Vec<f64> {
    (0..count).map(|i| 20.0 * f64::sin(0.05 * k as f64 + i as f64) + 0.1 * i as f64).collect()
}

#[test]
fn whole_runs_are_equal_bit_for_bit() {
    // The same filter, following plans.
    let assured = FILTER.replace("assurance = \"off\"\n", "");
    for configuration in [FILTER, EXTERNAL, STEERED, PLANT, CONTROLLER, &assured] {
        let two = Fmu::new(configuration);
        let old = crate::slave::Slave::ready(&two);
        let reals: Vec<usize> = two
            .product
            .variables
            .iter()
            .take(two.product.layout.outputs)
            .filter(|v| v.kind.base_type() == punctual_modeldescription::BaseType::Real)
            .map(|v| v.value_reference as usize)
            .collect();
        let count = reals.len();
        for arrays in [true, false] {
            let three = Fmu::of_fmi3(configuration, arrays);
            let new = Slave::ready(&three);
            old.ok((API2.reset)(old.component));
            old.initialize();
            assert_eq!(new.snapshot(), old.snapshot());
            for k in 0..60 {
                let t = 0.05 * k as f64;
                let values = inputs(count, k);
                old.set_inputs(&values);
                new.set_inputs(&values);
                if k == 30 && configuration == FILTER {
                    old.set_flag("rearm", true);
                    new.set_flag("rearm", true);
                }
                // Outputs are compared before the step and after it.
                assert_eq!(new.snapshot(), old.snapshot(), "before step {k} of {configuration}");
                old.step(t, 0.05);
                new.step(t, 0.05);
                assert_eq!(new.snapshot(), old.snapshot(), "after step {k} of {configuration}");
                assert_eq!(new.get("time"), [old.time()]);
            }
            assert_eq!((API.terminate)(new.instance), OK);
        }
    }
}

/// The names of the arrays are those in docs/fmu.md.
#[test]
fn what_belongs_together_is_one_array() {
    let names = |configuration: &str, arrays| -> Vec<String> {
        let fmu = Fmu::of_fmi3(configuration, arrays);
        let of = |item: &punctual_fmu::product::Item| format!("{}{:?}", item.name, item.dimensions);
        fmu.product.items.iter().map(of).collect()
    };
    let filter = names(FILTER, true);
    for wanted in ["x[4]", "u_ref[2]", "u[2]", "u_min[2]", "u_max[2]", "goal.centre[2]", "goal.h[]", "time[]"]
    {
        assert!(filter.iter().any(|name| name == wanted), "{wanted} in {filter:?}");
    }
    assert!(names(EXTERNAL, true).contains(&"goal.lg[2]".to_owned()));
    assert!(names(CONTROLLER, true).contains(&"points[2, 2]".to_owned()));
    let plant = names(PLANT, true);
    assert_eq!(plant[..3], ["u[2]", "x[4]", "x0[4]"]);
    let scalars = names(PLANT, false);
    assert_eq!(scalars[..3], ["u.a[]", "u.omega[]", "x.x_p[]"]);
}
