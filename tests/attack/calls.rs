//! The functions of FMI 2.0 in any order with any arguments, on one to three instances.

use std::ffi::{CString, c_int};
use std::ptr::{null, null_mut, without_provenance_mut};

use punctual_fmu::instance::{Call, Mode};
use punctual_modeldescription::Causality;

use crate::api::{API, Component, DISCARD, ERROR, OK};
use crate::bytes::Bytes;
use crate::campaign;
use crate::fleet::FLEET;
use crate::machine::{Machine, Pool};

/// Number of cases after which one is repeated with new instances.
const AGAIN: usize = 16;

#[test]
fn sequences_of_calls() {
    let (mut pool, mut case) = (Pool::default(), 0);
    campaign::run("calls", 2000, "calls", |bytes| {
        case += 1;
        let (digest, calls) = sequence(&mut pool, bytes, false);
        if case % AGAIN == 0 {
            assert_eq!(sequence(&mut pool, bytes, true), (digest, calls), "new instances, other answers");
        }
        calls
    });
}

/// Runs the sequence that `bytes` encode; returns a digest of all values read, and the number of calls.
fn sequence(pool: &mut Pool, bytes: &[u8], new: bool) -> (u64, usize) {
    let mut bytes = Bytes::new(bytes);
    let slots = (0..1 + bytes.below(3)).map(|_| pool.slot(&mut bytes, new)).collect();
    let mut machine = Machine::new(slots);
    for k in 0..machine.slots.len() {
        if bytes.below(4) > 0 {
            machine.set_inputs(k, || bytes.moderate());
            machine.initialize(k, 0.0);
        }
    }
    while !bytes.is_empty() {
        let k = bytes.below(machine.slots.len());
        call(&mut machine, k, &mut bytes);
        let mut ended = -1;
        let instance = &machine.slots[k].instance;
        instance.ok("get_boolean_status", (API.get_boolean_status)(instance.component, 3, &raw mut ended));
        assert_eq!(ended == 1, instance.mode == Mode::TERMINATED, "{:?}", instance.mode);
    }
    let result = (machine.digest, machine.calls);
    if new {
        // Freed in whatever mode they are, together with their states.
        drop(machine);
    } else {
        pool.give_back(machine);
    }
    result
}

fn call(machine: &mut Machine, k: usize, bytes: &mut Bytes) {
    let c = machine.slots[k].instance.component;
    match bytes.byte() % 40 {
        0..4 => machine.set_inputs(k, || bytes.moderate()),
        4..6 => machine.set_inputs(k, || bytes.number()),
        6..9 => values(machine, k, bytes),
        9..11 => parameter(machine, k, bytes),
        11..17 => {
            let t = machine.slots[k].instance.time();
            let h = bytes.pick(&[0.01, 0.1, 0.1, 0.001, 0.35, 1e-16, 0.0, 2.0]);
            machine.step(k, t, h);
        }
        17 => {
            let t = machine.slots[k].instance.time() + bytes.pick(&[-1.0, -1e-10, 1e-10, 0.1]);
            machine.step(k, t, 0.1);
        }
        18 => {
            let (t, h) = (bytes.number(), bytes.number());
            machine.step(k, t, h);
        }
        19 => {
            let (start, stop) = (bytes.number(), bytes.number());
            let status = (API.setup_experiment)(c, 1, bytes.number(), start, 1, stop);
            machine.moved(k, Call::SetupExperiment, Mode::INSTANTIATED, false, status);
        }
        20 => {
            let status = (API.enter_initialization_mode)(c);
            machine.moved(k, Call::EnterInitializationMode, Mode::INITIALIZATION, true, status);
        }
        21 => {
            let status = (API.exit_initialization_mode)(c);
            machine.moved(k, Call::ExitInitializationMode, Mode::STEP, false, status);
        }
        22 => machine.moved(k, Call::Terminate, Mode::TERMINATED, true, (API.terminate)(c)),
        23 => machine.reset(k),
        24 => machine.initialize(k, bytes.pick(&[0.0, 1e9, -5.0])),
        25..28 => machine.save(k, None),
        28..35 if !machine.held.is_empty() => state(machine, k, bytes),
        35 => logging(machine, k, bytes),
        36 if bytes.below(2) == 0 => derivatives(machine, k, bytes),
        36 => absent(machine, k, bytes),
        37 if bytes.below(16) == 0 => machine.renew(k),
        38 if bytes.below(16) == 0 => refused_instance(bytes),
        39 => null_component(bytes),
        _ => machine.look(k),
    }
}

/// Uses a state that exists, or existed, or a number that never was one.
fn state(machine: &mut Machine, k: usize, bytes: &mut Bytes) {
    let c = machine.slots[k].instance.component;
    let place = bytes.below(machine.held.len());
    match bytes.byte() % 10 {
        0..4 => machine.restore(k, place),
        4 => machine.save(k, Some(place)),
        5 => machine.free(k, place),
        6 => {
            let state = machine.slots[k].instance.now();
            machine.read(k, &state, true);
        }
        7 => {
            let mut state = machine.slots[k].instance.now();
            let at = bytes.position(state.len());
            state[at] ^= 1 << bytes.below(8);
            let done = machine.read(k, &state, false);
            assert!(!done, "byte {at} is damaged");
        }
        8 => {
            let state = machine.slots[k].instance.now();
            let length = bytes.position(state.len());
            assert!(!machine.read(k, &state[..length], false), "cut off after {length} bytes");
        }
        _ => {
            let none = without_provenance_mut(usize::MAX - usize::from(bytes.byte()));
            let (mut pointer, mut size, mut byte) = (none, 0, 0);
            let status = match bytes.below(5) {
                0 => (API.set_state)(c, none),
                1 => (API.free_state)(c, &raw mut pointer),
                2 => (API.get_state)(c, &raw mut pointer),
                3 => (API.serialized_size)(c, none, &raw mut size),
                _ => (API.serialize)(c, none, &raw mut byte, 1),
            };
            assert!(!machine.answered(k, "a state that is none", None, status));
            assert_eq!(pointer, none);
        }
    }
}

/// Reads or writes a few variables, known and unknown, with valid arrays or NULL. A failed call changes
/// nothing.
fn values(machine: &mut Machine, k: usize, bytes: &mut Bytes) {
    let instance = &machine.slots[k].instance;
    let (c, variables) = (instance.component, instance.fmu.product.variables.len());
    let count = bytes.below(5);
    let reference = |bytes: &mut Bytes| match bytes.byte() {
        255 => u32::MAX,
        n => u32::from(n) % (variables as u32 + 2),
    };
    let references: Vec<u32> = (0..count).map(|_| reference(bytes)).collect();
    let mut reals: Vec<f64> = (0..count).map(|_| bytes.number()).collect();
    let mut integers: Vec<c_int> = (0..count).map(|_| c_int::from(bytes.byte()) - 3).collect();
    let mut texts = vec![c"text".as_ptr(); count];
    let odd = bytes.byte() % 16;
    let refs = if odd == 0 { null() } else { references.as_ptr() };
    let length = if odd == 1 { usize::MAX - 7 } else { count };
    // NULL is passed only if the array is not read anyway.
    let (real, int, text) = if odd == 2 {
        (null_mut(), null_mut(), null_mut())
    } else {
        (reals.as_mut_ptr(), integers.as_mut_ptr(), texts.as_mut_ptr())
    };
    let before = instance.now();
    let (call, status) = match bytes.below(8) {
        0 => (Call::Get, (API.get_real)(c, refs, length, real)),
        1 => (Call::Get, (API.get_integer)(c, refs, length, int)),
        2 => (Call::Get, (API.get_boolean)(c, refs, length, int)),
        3 => (Call::Get, (API.get_string)(c, refs, length, text)),
        4 => (Call::Set, (API.set_real)(c, refs, length, real)),
        5 => (Call::Set, (API.set_integer)(c, refs, length, int)),
        6 => (Call::Set, (API.set_boolean)(c, refs, length, int)),
        _ => (Call::Set, (API.set_string)(c, refs, length, text)),
    };
    let done = machine.answered(k, "a few variables", Some(call), status);
    assert!(done || before == machine.slots[k].instance.now(), "a failed call changed something");
    assert!(!done || odd > 2 || (odd != 1 && count == 0), "NULL, or more than there can be, was taken");
}

/// Sets a parameter to any number.
fn parameter(machine: &mut Machine, k: usize, bytes: &mut Bytes) {
    let instance = &machine.slots[k].instance;
    let references = instance.references(Causality::Parameter, "");
    let (reference, value) = (bytes.pick(&references), bytes.number());
    let (c, before) = (instance.component, instance.now());
    let status = (API.set_real)(c, &raw const reference, 1, &raw const value);
    let done = machine.answered(k, "set_real", Some(Call::Set), status);
    let mode = machine.slots[k].instance.mode;
    assert!(!done || (mode != Mode::STEP && value.is_finite()), "{value} in the mode {mode:?}");
    assert!(done || before == machine.slots[k].instance.now(), "a refused parameter changed something");
}

fn logging(machine: &mut Machine, k: usize, bytes: &mut Bytes) {
    let texts = [c"logEvents".as_ptr(), c"logStatusError".as_ptr(), c"logAll%s%n".as_ptr(), null()];
    let names: Vec<_> = (0..bytes.below(4)).map(|_| bytes.pick(&texts)).collect();
    let usable = names.iter().all(|name| texts[..2].contains(name));
    let on = c_int::from(bytes.byte() % 2);
    let status = (API.set_debug_logging)(
        machine.slots[k].instance.component,
        on,
        names.len(),
        if names.is_empty() { null() } else { names.as_ptr() },
    );
    assert_eq!(machine.answered(k, "set_debug_logging", None, status), usable);
}

/// Requests derivatives of some outputs with respect to some inputs, or of variables without any. The state
/// is unchanged, and so are the numbers of a failed call.
fn derivatives(machine: &mut Machine, k: usize, bytes: &mut Bytes) {
    // Outputs are computed when they are read; then they are known.
    machine.look(k);
    let instance = &machine.slots[k].instance;
    let some = |causality, bytes: &mut Bytes| -> Vec<_> {
        let references = instance.references(causality, "");
        let odd = [0, 1, 9999];
        let count = bytes.below(4);
        let one = |_| {
            let from = if bytes.below(8) == 0 { &odd[..] } else { &references };
            bytes.pick(from)
        };
        (0..count).map(one).collect()
    };
    let (unknown, known) = (some(Causality::Output, bytes), some(Causality::Input, bytes));
    let seeds: Vec<_> = known.iter().map(|_| bytes.pick(&[1.0, -0.5, 0.0, 1e300, f64::NAN])).collect();
    let (mut found, before) = (vec![0.5; unknown.len()], instance.now());
    let status = (API.directional_derivative)(
        instance.component,
        unknown.as_ptr(),
        unknown.len(),
        known.as_ptr(),
        known.len(),
        seeds.as_ptr(),
        found.as_mut_ptr(),
    );
    let call = Some(Call::GetDirectionalDerivative);
    let done = machine.answered(k, "get_directional_derivative", call, status);
    assert!(done || found.iter().all(|v| *v == 0.5), "{found:?}");
    assert!(!done || seeds.iter().all(|v| v.is_finite()), "{seeds:?}");
    assert!(before == machine.slots[k].instance.now(), "a derivative changed the state");
}

/// Calls functions that are not supported: derivatives in time, asynchronous steps.
fn absent(machine: &mut Machine, k: usize, bytes: &mut Bytes) {
    let c = machine.slots[k].instance.component;
    let (reference, order, mut real, mut int, mut text) = (0, 1, 0.5, 7, null());
    let (refs, orders, kind) = (&raw const reference, &raw const order, c_int::from(bytes.byte() % 6) - 1);
    let count = bytes.below(2);
    let discarded = match bytes.below(5) {
        0 => (API.get_status)(c, kind, &raw mut int),
        1 => (API.get_integer_status)(c, kind, &raw mut int),
        2 => (API.get_string_status)(c, kind, &raw mut text),
        3 if kind != 2 => (API.get_real_status)(c, kind, &raw mut real),
        4 if kind != 3 => (API.get_boolean_status)(c, kind, &raw mut int),
        _ => DISCARD,
    };
    assert_eq!((discarded, int, real.to_bits(), text), (DISCARD, 7, 0.5_f64.to_bits(), null()));
    let (status, usable) = match bytes.below(3) {
        0 => ((API.cancel_step)(c), false),
        1 => ((API.set_input_derivatives)(c, refs, count, orders, &raw const real), count == 0),
        _ => ((API.get_output_derivatives)(c, refs, count, orders, &raw mut real), count == 0),
    };
    assert_eq!(machine.answered(k, "what there is not", None, status), usable);
}

/// Arguments of `fmi2Instantiate` that are refused, without a logger.
fn refused_instance(bytes: &mut Bytes) {
    let fmu = &FLEET[bytes.below(FLEET.len())];
    let (good, place) = (CString::new(fmu.guid()).unwrap(), CString::new(fmu.location()).unwrap());
    let text: Vec<u8> = (0..bytes.below(9)).map(|_| bytes.byte().max(1)).collect();
    let odd = CString::new(text).unwrap();
    let (good, place, odd) = (good.as_ptr(), place.as_ptr(), odd.as_ptr());
    let name = bytes.pick(&[null(), odd, c"%s%n".as_ptr()]);
    let (kind, guid, location) = bytes.pick(&[
        (0, good, place),
        (7, good, place),
        (1, odd, place),
        (1, good, null()),
        (1, null(), place),
    ]);
    let component = (API.instantiate)(name, kind, guid, location, null(), 0, 1);
    assert!(component.is_null());
    let component = (API.instantiate)(name, 1, good, place, null(), 1, 1);
    assert!(!component.is_null());
    (API.free_instance)(component);
}

fn null_component(bytes: &mut Bytes) {
    let (c, mut real, mut state): (Component, _, _) = (null_mut(), bytes.number(), null_mut());
    let reference = 0;
    let status = match bytes.below(8) {
        0 => (API.do_step)(c, real, real, 0),
        1 => (API.get_real)(c, &raw const reference, 1, &raw mut real),
        2 => (API.set_real)(c, &raw const reference, 1, &raw const real),
        3 => (API.get_state)(c, &raw mut state),
        4 => (API.free_state)(c, &raw mut state),
        5 => (API.reset)(c),
        6 => (API.deserialize)(c, null(), 5, &raw mut state),
        _ => {
            (API.free_instance)(c);
            assert!(!(API.get_version)().is_null() && !(API.get_types_platform)().is_null());
            ERROR
        }
    };
    assert_ne!(status, OK);
}
