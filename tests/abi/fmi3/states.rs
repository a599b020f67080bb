//! Snapshots: restored and continued, serialised, and refused.

use std::ptr::null_mut;

use super::slave::Slave;
use crate::api::three::API;
use crate::fmu::{FILTER, Fmu, PLANT};

fn steps(slave: &Slave, from: usize, count: usize) -> Vec<String> {
    for k in from..from + count {
        slave.set_inputs(&[0.1 * k as f64, 0.5 - 0.2 * k as f64]);
        slave.step(0.1 * k as f64, 0.1);
    }
    slave.snapshot()
}

/// `PLANT` has two inputs; those of `FILTER` are the first two elements of an array.
fn fmus() -> [Fmu; 3] {
    [Fmu::of_fmi3(PLANT, true), Fmu::of_fmi3(PLANT, false), Fmu::of_fmi3(FILTER, false)]
}

#[test]
fn back_and_on_again_gives_the_same_bits() {
    for fmu in &fmus() {
        let slave = Slave::ready(fmu);
        steps(&slave, 0, 3);
        let state = slave.state();
        let bytes = slave.bytes(state);
        let wanted = steps(&slave, 3, 5);
        slave.ok((API.set_state)(slave.instance, state));
        assert_eq!(steps(&slave, 3, 5), wanted);
        // Into a new instance, which also takes over the mode.
        let other = Slave::new(fmu);
        let mut read = null_mut();
        other.ok((API.deserialize_state)(other.instance, bytes.as_ptr(), bytes.len(), &raw mut read));
        other.ok((API.set_state)(other.instance, read));
        assert_eq!(steps(&other, 3, 5), wanted);
        // Over an old state, and freed.
        let mut state = state;
        let kept = state;
        slave.ok((API.get_state)(slave.instance, &raw mut state));
        assert_eq!(state, kept);
        slave.ok((API.free_state)(slave.instance, &raw mut state));
        assert!(state.is_null());
        slave.ok((API.free_state)(slave.instance, &raw mut state));
        assert!(slave.refused((API.set_state)(slave.instance, kept)).contains("was freed"));
    }
}

#[test]
fn damaged_bytes_and_those_of_another_fmu_are_refused() {
    let [plant, scalars, _] = fmus();
    let slave = Slave::ready(&plant);
    let mut bytes = slave.now();
    let other = Slave::ready(&scalars);
    let mut read = null_mut();
    let message =
        other.refused((API.deserialize_state)(other.instance, bytes.as_ptr(), bytes.len(), &raw mut read));
    assert!(message.contains("belongs to the FMU with the GUID"), "{message}");
    for at in 0..bytes.len() {
        bytes[at] ^= 4;
        let status = (API.deserialize_state)(slave.instance, bytes.as_ptr(), bytes.len(), &raw mut read);
        slave.refused(status);
        bytes[at] ^= 4;
    }
    assert!(read.is_null());
}

/// The stop time is part of the state: no step goes beyond it (FMI 3.0.2, section 2.3.2).
#[test]
fn no_step_goes_past_the_stop_time() {
    let fmu = Fmu::of_fmi3(PLANT, true);
    let slave = Slave::new(&fmu);
    slave.ok((API.enter_initialization_mode)(slave.instance, 0, 0.0, 0.0, 1, 0.3));
    slave.ok((API.exit_initialization_mode)(slave.instance));
    slave.step(0.0, 0.1);
    slave.step(0.1, 0.1);
    let state = slave.state();
    let message = slave.refused(slave.try_step(0.2, 0.2));
    assert!(message.contains("must end by stopTime = 0.3"), "{message}");
    slave.step(0.2, 0.1);
    let other = Slave::ready(&fmu);
    other.ok((API.set_state)(other.instance, state));
    assert!(other.refused(other.try_step(0.2, 0.2)).contains("stopTime = 0.3"));
    other.ok((API.reset)(other.instance));
    other.initialize();
    other.step(0.0, 5.0);
    // A missing stop time.
    other.ok((API.reset)(other.instance));
    let message = other.refused((API.enter_initialization_mode)(other.instance, 0, 0.0, 2.0, 1, 1.0));
    assert_eq!(message, "fmi3EnterInitializationMode: stopTime is 1, must be >= startTime = 2");
}
