//! The dependencies of each element of an output.

use super::slave::Slave;
use crate::api::three::API;
use crate::fmu::{FILTER, Fmu, PLANT};
use punctual_fmu::fmi3::DEPENDENT;

/// For each dependency: the element of the output, and the name and element of the variable it depends on.
fn dependencies(slave: &Slave, name: &str) -> Vec<(usize, String, usize)> {
    let (c, reference, mut n) = (slave.instance, slave.fmu.item(name).reference(), 0);
    slave.ok((API.get_number_of_variable_dependencies)(c, reference, &raw mut n));
    let (mut elements, mut independents, mut others, mut kinds) =
        (vec![9; n], vec![9; n], vec![9; n], vec![9; n]);
    let mut get = |n| {
        let (e, i) = (elements.as_mut_ptr(), independents.as_mut_ptr());
        let (o, k) = (others.as_mut_ptr(), kinds.as_mut_ptr());
        (API.get_variable_dependencies)(c, reference, e, i, o, k, n)
    };
    if n > 0 {
        assert!(slave.refused(get(n - 1)).contains(&format!("nDependencies is {}, must be {n}", n - 1)));
    }
    slave.ok(get(n));
    assert!(kinds.iter().all(|kind| *kind == DEPENDENT));
    let items = &slave.fmu.product.items;
    let named = |reference: &u32| items.iter().find(|i| i.reference() == *reference).unwrap().name.clone();
    let on = independents.iter().map(named).zip(&others);
    elements.iter().zip(on).map(|(element, (name, other))| (*element, name, *other)).collect()
}

#[test]
fn of_each_element() {
    let controller = "kind = \"controller\"\nplant.model = \"point_mass\"\ncontroller = \"damping\"\n";
    let fmu = Fmu::of_fmi3(controller, true);
    let slave = Slave::ready(&fmu);
    // Each input damps the velocity in its direction: the states are (x_p, y_p, v_x, v_y).
    assert_eq!(dependencies(&slave, "u_ref"), [(1, "x".to_owned(), 3), (2, "x".to_owned(), 4)]);

    let fmu = Fmu::of_fmi3(PLANT, true);
    let slave = Slave::new(&fmu);
    let first = (1..=4).map(|i| (i, "x0".to_owned(), i)).collect::<Vec<_>>();
    assert_eq!(dependencies(&slave, "x"), first, "at the start");
    slave.initialize();
    assert_eq!(dependencies(&slave, "x"), [], "an input moves it in a step only");
    let u = fmu.item("u").reference();
    let message = slave.refused((API.get_number_of_variable_dependencies)(slave.instance, u, &mut 0));
    assert_eq!(
        message,
        "fmi3GetNumberOfVariableDependencies: u is not an output, so its dependencies are not reported"
    );

    let fmu = Fmu::of_fmi3(FILTER, true);
    let slave = Slave::ready(&fmu);
    let h = dependencies(&slave, "goal.h");
    assert_eq!(h.len(), 7, "four states, two inputs and rearm: {h:?}");
    assert_eq!(h.last().unwrap(), &(0, "rearm".to_owned(), 0), "scalars have no element");
    assert_eq!(dependencies(&slave, "u").len(), 14);
}
