//! Directional and adjoint derivatives compared with each other, with those of FMI 2.0 and with differences.

use std::ffi::c_int;
use std::ptr::null_mut;

use punctual_fmu::product::Item;
use punctual_modeldescription::{Causality, ScalarType};

use super::slave::Slave;
use crate::api::OK;
use crate::api::three::API;
use crate::derivatives::{STEP, TOLERANCE, TRAFFIC};
use crate::fmu::{EXTERNAL, FILTER, Fmu, STEERED};

/// Round-off of sums of a few dozen products, relative to their size.
const ROUND_OFF: f64 = 1e-11;

/// The references of all numbers of one causality, and the number of their elements.
fn numbers(fmu: &Fmu, causality: Causality) -> (Vec<u32>, usize) {
    let variables = &fmu.product.variables;
    let belongs = |item: &&Item| {
        variables
            .get(item.scalars.start)
            .is_some_and(|v| v.causality == causality && v.kind.scalar_type() == ScalarType::Real)
    };
    let items: Vec<_> = fmu.product.items.iter().filter(belongs).collect();
    let elements = items.iter().map(|item| item.scalars.len()).sum();
    (items.into_iter().map(Item::reference).collect(), elements)
}

type Derivative = extern "C" fn(
    *mut std::ffi::c_void,
    *const u32,
    usize,
    *const u32,
    usize,
    *const f64,
    usize,
    *mut f64,
    usize,
) -> c_int;

fn asked(
    slave: &Slave,
    function: Derivative,
    (unknowns, knowns): (&[u32], &[u32]),
    seed: &[f64],
    length: usize,
) -> (c_int, Vec<f64>) {
    let mut out = vec![7.5; length];
    let (u, n, k, m) = (unknowns.as_ptr(), unknowns.len(), knowns.as_ptr(), knowns.len());
    let status = function(slave.instance, u, n, k, m, seed.as_ptr(), seed.len(), out.as_mut_ptr(), length);
    (status, out)
}

fn read(slave: &Slave, (references, elements): &(Vec<u32>, usize)) -> Vec<f64> {
    let mut values = vec![f64::NAN; *elements];
    let (r, n) = (references.as_ptr(), references.len());
    slave.ok((API.get_float64)(slave.instance, r, n, values.as_mut_ptr(), values.len()));
    values
}

/// Compares all elements; returns whether the row of a barrier changed the input, so that some constraint is
/// active.
fn compare(slave: &Slave, values: &[f64], when: &str) {
    let inputs = numbers(slave.fmu, Causality::Input);
    let outputs = numbers(slave.fmu, Causality::Output);
    let sides = (&outputs.0[..], &inputs.0[..]);
    let set = |values: &[f64]| {
        let (r, n) = (inputs.0.as_ptr(), inputs.0.len());
        slave.ok((API.set_float64)(slave.instance, r, n, values.as_ptr(), values.len()));
    };
    set(values);
    // Outputs are computed when they are read; then they are known.
    read(slave, &outputs);
    let before = slave.now();
    // The Jacobian from directional derivatives, one column for each element of the inputs.
    let columns: Vec<Vec<f64>> = (0..inputs.1)
        .map(|k| {
            let mut seed = vec![0.0; inputs.1];
            seed[k] = 1.0;
            let (status, column) = asked(slave, API.get_directional_derivative, sides, &seed, outputs.1);
            assert_eq!(status, OK, "{when}: {:?}", slave.log.entries());
            column
        })
        .collect();
    // Its rows from adjoint derivatives: the same numbers, since one is computed from the other.
    for i in 0..outputs.1 {
        let mut seed = vec![0.0; outputs.1];
        seed[i] = 1.0;
        let (status, row) = asked(slave, API.get_adjoint_derivative, sides, &seed, inputs.1);
        assert_eq!(status, OK, "{when}: {:?}", slave.log.entries());
        for (k, found) in row.iter().enumerate() {
            assert_eq!(*found, columns[k][i], "output {i} by input {k} {when}");
        }
    }
    // wᵀ(J v) = (Jᵀ w)ᵀ v for arbitrary v and w.
    let v: Vec<f64> = (0..inputs.1).map(|k| 0.5 - 0.3 * k as f64).collect();
    let w: Vec<f64> = (0..outputs.1).map(|i| 1.0 - 0.2 * i as f64).collect();
    let (_, along) = asked(slave, API.get_directional_derivative, sides, &v, outputs.1);
    let (_, gathered) = asked(slave, API.get_adjoint_derivative, sides, &w, inputs.1);
    let dot = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
    let size = dot(
        &along.iter().map(|x| x.abs()).collect::<Vec<_>>(),
        &w.iter().map(|x| x.abs()).collect::<Vec<_>>(),
    );
    let [left, right] = [dot(&w, &along), dot(&gathered, &v)];
    assert!((left - right).abs() <= ROUND_OFF * (1.0 + size), "{left} for {right} {when}");
    assert!(slave.now() == before, "a derivative changed something {when}");
    // Central differences.
    for (k, column) in columns.iter().enumerate() {
        let at = |by: f64| {
            let mut moved = values.to_vec();
            moved[k] += by;
            set(&moved);
            read(slave, &outputs)
        };
        let (plus, minus) = (at(STEP), at(-STEP));
        for (i, (p, m)) in plus.iter().zip(&minus).enumerate() {
            let wanted = (p - m) / (2.0 * STEP);
            let close = (column[i] - wanted).abs() <= TOLERANCE * (1.0 + wanted.abs());
            assert!(close, "output {i} by input {k} {when}: {} for {wanted}", column[i]);
        }
    }
    set(values);
}

#[test]
fn the_three_agree_through_the_active_set() {
    for (configuration, values) in [
        (FILTER, vec![3.0, 4.0, 1.0, 2.0, 0.3, -0.7]),
        (TRAFFIC, vec![1.0, 2.0, 0.4, 3.0, 14.0, 5.0, -0.5, 0.2, 0.5, -0.1]),
        (EXTERNAL, vec![-20.0, 2.0, 0.1, 1.0, 0.5, 0.3, -0.4]),
        (STEERED, vec![1.0, 2.0, 0.3, 4.0, 0.05, 0.2, 0.1]),
    ] {
        for arrays in [true, false] {
            let fmu = Fmu::of_fmi3(configuration, arrays);
            let slave = Slave::ready(&fmu);
            let count = numbers(&fmu, Causality::Input).1;
            let values = &values[..count.min(values.len())];
            assert_eq!(values.len(), count, "{configuration}");
            slave.set_inputs(values);
            slave.step(0.0, 0.1);
            compare(&slave, values, &format!("after a step of {configuration}"));
            let moved: Vec<_> = values.iter().map(|v| v + 0.05).collect();
            slave.set_inputs(&moved);
            slave.step(0.1, 0.1);
            compare(&slave, &moved, &format!("after two steps of {configuration}"));
        }
    }
}

#[test]
fn wrong_lengths_and_wrong_variables() {
    let fmu = Fmu::of_fmi3(FILTER, true);
    let slave = Slave::ready(&fmu);
    let [x, u, status, rearm] = ["x", "u", "status", "rearm"].map(|name| fmu.item(name).reference());
    let refused = |function: Derivative, sides: (&[u32], &[u32]), seed: &[f64], length: usize| {
        let (status, out) = asked(&slave, function, sides, seed, length);
        assert!(out.iter().all(|v| *v == 7.5), "{out:?}");
        slave.refused(status)
    };
    let (directional, adjoint) = (API.get_directional_derivative, API.get_adjoint_derivative);
    let message = refused(directional, (&[u], &[x]), &[1.0; 3], 2);
    assert_eq!(message, "fmi3GetDirectionalDerivative: nSeed is 3, must be 4: the number of elements");
    let message = refused(directional, (&[u], &[x]), &[1.0; 4], 3);
    assert_eq!(message, "fmi3GetDirectionalDerivative: nSensitivity is 3, must be 2: the number of elements");
    let message = refused(adjoint, (&[u], &[x]), &[1.0; 4], 4);
    assert_eq!(message, "fmi3GetAdjointDerivative: nSeed is 4, must be 2: the number of elements");
    let message = refused(adjoint, (&[u], &[x]), &[1.0; 2], 2);
    assert_eq!(message, "fmi3GetAdjointDerivative: nSensitivity is 2, must be 4: the number of elements");
    let message = refused(directional, (&[x], &[x]), &[1.0; 4], 4);
    assert!(message.contains("x is of causality input: each unknown must be a real output"), "{message}");
    let message = refused(adjoint, (&[u], &[u]), &[1.0; 2], 2);
    assert!(message.contains("u is of causality output: each known must be a real input"), "{message}");
    let message = refused(directional, (&[status], &[x]), &[1.0; 4], 1);
    assert!(message.contains("is status of type Int64, not Float64"), "{message}");
    let message = refused(directional, (&[u], &[rearm]), &[1.0], 2);
    assert!(message.contains("is rearm of type Boolean, not Float64"), "{message}");
    let message = refused(directional, (&[u], &[x + 1]), &[1.0], 2);
    assert!(message.contains("is inside the array x"), "{message}");
    let message = refused(adjoint, (&[u], &[x]), &[1.0, f64::NAN], 4);
    assert!(message.contains("the seed of u.u_y is NaN, must be finite"), "{message}");
    let (u_ref, none) = (&raw const u, null_mut());
    let status =
        (API.get_directional_derivative)(slave.instance, u_ref, 1, &raw const x, 1, none, 4, none, 2);
    assert!(slave.refused(status).contains("NULL"));
}

/// If a derivative is not finite, the run may continue: discarded, not an error.
#[test]
fn no_finite_derivative() {
    let heading =
        "kind = \"controller\"\nplant.model = \"unicycle\"\ncontroller = \"heading\"\ngoal = [9.0, 4.0]\n";
    let fmu = Fmu::of_fmi3(heading, true);
    let slave = Slave::ready(&fmu);
    let [x, u] = ["x", "u_ref"].map(|name| fmu.item(name).reference());
    slave.ok((API.set_debug_logging)(slave.instance, 1, 0, std::ptr::null()));
    slave.set_inputs(&[f64::NAN, 0.0, 0.0, 0.0]);
    let both: [(Derivative, &[f64], usize); 2] =
        [(API.get_directional_derivative, &[1.0; 4], 2), (API.get_adjoint_derivative, &[1.0; 2], 4)];
    for (function, seed, length) in both {
        let (status, out) = asked(&slave, function, (&[u], &[x]), seed, length);
        assert_eq!(status, crate::api::DISCARD, "{:?}", slave.log.entries());
        assert!(out.iter().all(|v| *v == 7.5), "{out:?}");
        let (status, category, message) = slave.log.entries().pop().unwrap();
        assert_eq!((status, category.as_str()), (crate::api::DISCARD, "logStatusWarning"));
        assert!(message.contains("must be finite"), "{message}");
    }
    slave.step(0.0, 0.1);
}
