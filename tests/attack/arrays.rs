//! The functions of FMI 3.0 in any order with any arguments, on one instance.
//!
//! The code shared with FMI 2.0 is tested in depth by `calls`. So this checks what every call must satisfy: a
//! known status, one message for a failure and none for a success, the table of legal modes, nothing changed
//! by a failure.

use std::cell::RefCell;
use std::ffi::{CStr, CString, c_int, c_void};
use std::ptr::{null, null_mut};
use std::sync::LazyLock;

use punctual_fmu::fmi3::Status;
use punctual_fmu::instance::{Call, Mode};

use crate::api::three::{API, Instance, State, Text};
use crate::api::{DISCARD, ERROR, OK};
use crate::bytes::Bytes;
use crate::campaign;
use crate::fleet::CONFIGURATIONS;
use crate::fmu::Fmu;

/// The fleet for FMI 3.0: arrays and scalars in turn.
pub(crate) static FLEET: LazyLock<Vec<Fmu>> = LazyLock::new(|| {
    let arrays = |(i, text): (usize, &&str)| Fmu::of_fmi3(text, i % 3 != 2);
    CONFIGURATIONS.iter().enumerate().map(arrays).collect()
});

/// Longest step in s, so that a case takes no time.
const LONGEST: f64 = 2.0;

/// Messages of failed calls since the last check, and the last message.
#[derive(Default)]
struct Log {
    failures: usize,
    last: String,
}

unsafe extern "C" fn log(environment: *mut c_void, status: Status, category: Text, message: Text) {
    // SAFETY: the environment is a log that outlives the instance.
    let log = unsafe { environment.cast::<RefCell<Log>>().as_ref() }.expect("the environment");
    // SAFETY: the library passes NUL-terminated strings.
    let [category, message] = [category, message].map(|text| unsafe { CStr::from_ptr(text) });
    let (category, message) = (category.to_str().expect("UTF-8"), message.to_str().expect("UTF-8"));
    let known = match status.0 {
        OK => category == "logEvents",
        ERROR => category == "logStatusError" && message.starts_with("fmi3"),
        _ => category == "logStatusWarning",
    };
    let sound = known && !message.is_empty() && !message.contains('%') && !message.contains("internal error");
    assert!(sound, "{} {category} {message}", status.0);
    let mut log = log.borrow_mut();
    log.failures += usize::from(matches!(status.0, ERROR | DISCARD));
    message.clone_into(&mut log.last);
}

struct Slave {
    fmu: &'static Fmu,
    instance: Instance,
    mode: Mode,
    log: Box<RefCell<Log>>,
    states: Vec<(State, Mode)>,
    calls: usize,
    digest: u64,
}

impl Drop for Slave {
    fn drop(&mut self) {
        (API.free_instance)(self.instance);
    }
}

impl Slave {
    /// An instance of the FMU that `bytes` select, with all messages enabled.
    fn new(bytes: &mut Bytes) -> Self {
        let fmu = &FLEET[bytes.below(FLEET.len())];
        let log_box = Box::<RefCell<Log>>::default();
        let environment = std::ptr::from_ref(&*log_box).cast_mut().cast();
        let (token, path) = (CString::new(fmu.guid()).unwrap(), CString::new(fmu.path()).unwrap());
        let (name, t, p) = (c"attacked".as_ptr(), token.as_ptr(), path.as_ptr());
        let instance =
            (API.instantiate_co_simulation)(name, t, p, 0, 1, 0, 1, null(), 0, environment, Some(log), None);
        assert!(!instance.is_null(), "{}", log_box.borrow().last);
        let (mode, states) = (Mode::INSTANTIATED, Vec::new());
        Self { fmu, instance, mode, log: log_box, states, calls: 0, digest: 0 }
    }

    /// Judges an answer; returns whether the call succeeded.
    fn answered(&mut self, name: &str, call: Option<Call>, status: c_int) -> bool {
        assert!(matches!(status, OK | ERROR | DISCARD), "{name} answers {status}");
        let failures = std::mem::take(&mut self.log.borrow_mut().failures);
        let last = &self.log.borrow().last;
        assert_eq!(failures, usize::from(status != OK), "{name} answers {status}, last: {last}");
        let legal = call.is_none_or(|call| self.mode.is_in(call.modes()));
        assert!(legal || status == ERROR, "{name} in the mode {:?}: {status}", self.mode);
        self.calls += 1;
        self.digest = (self.digest ^ status as u64).wrapping_mul(0x0100_0000_01B3).rotate_left(17);
        status == OK
    }

    /// The present state as bytes.
    fn now(&mut self) -> Vec<u8> {
        let (mut state, mut size) = (null_mut(), 0);
        let c = self.instance;
        assert_eq!((API.get_state)(c, &raw mut state), OK);
        assert_eq!((API.serialized_state_size)(c, state, &raw mut size), OK);
        let mut bytes = vec![0; size];
        assert_eq!((API.serialize_state)(c, state, bytes.as_mut_ptr(), size), OK);
        assert_eq!((API.free_state)(c, &raw mut state), OK);
        bytes
    }

    /// Makes a call that changes the mode if it succeeds.
    fn moved(&mut self, name: &str, call: Call, to: Mode, status: c_int) {
        if self.answered(name, Some(call), status) {
            self.mode = to;
        }
    }
}

#[test]
fn sequences_of_calls() {
    campaign::run("arrays", 2000, "calls", |case| {
        let (digest, calls) = sequence(case);
        assert_eq!(sequence(case), (digest, calls), "the same calls, other answers");
        2 * calls
    });
}

fn sequence(case: &[u8]) -> (u64, usize) {
    let mut bytes = Bytes::new(case);
    let mut slave = Slave::new(&mut bytes);
    if bytes.below(4) > 0 {
        initialize(&mut slave, &mut bytes);
    }
    while !bytes.is_empty() {
        call(&mut slave, &mut bytes);
    }
    let last = slave.now();
    let digest = last.iter().fold(slave.digest, |sum, byte| sum.rotate_left(5) ^ u64::from(*byte));
    (digest, slave.calls)
}

fn initialize(slave: &mut Slave, bytes: &mut Bytes) {
    let c = slave.instance;
    let start = bytes.pick(&[0.0, 0.0, 1e9, -5.0, f64::NAN]);
    let status =
        (API.enter_initialization_mode)(c, 0, 0.0, start, u8::from(bytes.below(4) == 0), start + 0.5);
    slave.moved("enter", Call::EnterInitializationMode, Mode::INITIALIZATION, status);
    let status = (API.exit_initialization_mode)(c);
    slave.moved("exit", Call::ExitInitializationMode, Mode::STEP, status);
}

fn call(slave: &mut Slave, bytes: &mut Bytes) {
    let c = slave.instance;
    match bytes.byte() % 32 {
        0..6 => step(slave, bytes),
        6..14 => values(slave, bytes),
        14..17 => derivatives(slave, bytes),
        17..20 => state(slave, bytes),
        20..25 => exchange(slave, bytes),
        25 => initialize(slave, bytes),
        26 => {
            let status = (API.reset)(c);
            assert!(slave.answered("reset", None, status));
            slave.mode = Mode::INSTANTIATED;
        }
        27 => {
            let status = (API.terminate)(c);
            slave.moved("terminate", Call::Terminate, Mode::TERMINATED, status);
        }
        28 => dependencies(slave, bytes),
        29 => {
            let names = [c"logEvents".as_ptr(), c"logStatusWarning".as_ptr(), c"none%n".as_ptr(), null()];
            let chosen: Vec<_> = (0..bytes.below(3)).map(|_| bytes.pick(&names)).collect();
            // Warnings stay enabled, so that every discarded call has its message.
            let on = u8::from(chosen.is_empty() || chosen.iter().any(|name| *name == names[1]));
            let status = (API.set_debug_logging)(c, on, chosen.len(), chosen.as_ptr());
            slave.answered("set_debug_logging", None, status);
        }
        _ => absent(slave, bytes),
    }
}

fn step(slave: &mut Slave, bytes: &mut Bytes) {
    let item = slave.fmu.item("time").reference();
    let mut time = 0.0;
    assert_eq!((API.get_float64)(slave.instance, &raw const item, 1, &raw mut time, 1), OK);
    let (t, h) = match bytes.below(8) {
        0 => (bytes.number(), bytes.number()),
        1 => (time + bytes.pick(&[-1.0, 1e-10, 0.1]), 0.1),
        _ => (time, bytes.pick(&[0.01, 0.1, 0.1, 0.001, 0.35, 1e-16, 0.0])),
    };
    let h = if h.is_finite() { h.min(LONGEST) } else { h };
    let (mut flags, mut last) = ([7; 3], 0.5);
    let [event, end, early] = &mut flags;
    let status = (API.do_step)(slave.instance, t, h, 1, event, end, early, &raw mut last);
    let done = slave.answered("do_step", Some(Call::DoStep), status);
    assert_eq!((flags, last == 0.5), if done { ([0; 3], last == 0.5) } else { ([7; 3], true) });
    assert!(!done || last.is_finite(), "{last}");
}

/// Some variables, known and unknown; and the number of their values, right or wrong.
fn references(slave: &Slave, bytes: &mut Bytes) -> (Vec<u32>, usize) {
    let items = &slave.fmu.product.items;
    let mut count = 0;
    let references = (0..bytes.below(4))
        .map(|_| {
            let item = &items[bytes.below(items.len())];
            // A plant would divide a step into more parts than a case has time for.
            if bytes.byte() == 255 || item.name == "inner_step" {
                return bytes.pick(&[u32::MAX, item.reference() + 1]);
            }
            count += item.scalars.len();
            item.reference()
        })
        .collect();
    let count = if bytes.byte().is_multiple_of(16) { count ^ 1 } else { count };
    (references, count)
}

fn values(slave: &mut Slave, bytes: &mut Bytes) {
    let (references, count) = references(slave, bytes);
    let (c, n) = (slave.instance, references.len());
    let r = if bytes.byte().is_multiple_of(32) { null() } else { references.as_ptr() };
    let mut floats: Vec<f64> =
        (0..count).map(|_| if bytes.below(4) == 0 { bytes.number() } else { bytes.moderate() }).collect();
    let (mut ints, mut longs, mut flags) = (vec![3; count], vec![3; count], vec![2; count]);
    let before = slave.now();
    let (call, status) = match bytes.below(12) {
        0..3 => (Call::Set, (API.set_float64)(c, r, n, floats.as_ptr(), count)),
        3..6 => (Call::Get, (API.get_float64)(c, r, n, floats.as_mut_ptr(), count)),
        6 => (Call::Get, (API.get_int32)(c, r, n, ints.as_mut_ptr(), count)),
        7 => (Call::Set, (API.set_int32)(c, r, n, ints.as_ptr(), count)),
        8 => (Call::Get, (API.get_int64)(c, r, n, longs.as_mut_ptr(), count)),
        9 => (Call::Set, (API.set_int64)(c, r, n, longs.as_ptr(), count)),
        10 => (Call::Get, (API.get_boolean)(c, r, n, flags.as_mut_ptr(), count)),
        _ => (Call::Set, (API.set_boolean)(c, r, n, flags.as_ptr(), count)),
    };
    let done = slave.answered("values", Some(call), status);
    assert!(done || slave.now() == before, "a failed call changed something");
}

fn derivatives(slave: &mut Slave, bytes: &mut Bytes) {
    let ((unknowns, m), (knowns, n)) = (references(slave, bytes), references(slave, bytes));
    let adjoint = bytes.below(2) == 0;
    let (seeds, results) = if adjoint { (m, n) } else { (n, m) };
    let seed: Vec<f64> = (0..seeds).map(|_| bytes.pick(&[1.0, -0.5, 0.0, 1e300, f64::NAN])).collect();
    let mut found = vec![0.5; results];
    let function = if adjoint { API.get_adjoint_derivative } else { API.get_directional_derivative };
    let status = function(
        slave.instance,
        unknowns.as_ptr(),
        unknowns.len(),
        knowns.as_ptr(),
        knowns.len(),
        seed.as_ptr(),
        seeds,
        found.as_mut_ptr(),
        results,
    );
    let done = slave.answered("derivative", Some(Call::GetDirectionalDerivative), status);
    assert!(done || found.iter().all(|v| *v == 0.5), "{found:?}");
}

fn state(slave: &mut Slave, bytes: &mut Bytes) {
    let c = slave.instance;
    match bytes.below(6) {
        0 | 1 => {
            let mut state = null_mut();
            let status = (API.get_state)(c, &raw mut state);
            assert!(slave.answered("get_state", None, status));
            slave.states.push((state, slave.mode));
        }
        2 | 3 if !slave.states.is_empty() => {
            let (state, mode) = bytes.pick(&slave.states);
            let status = (API.set_state)(c, state);
            assert!(slave.answered("set_state", None, status));
            slave.mode = mode;
        }
        4 if !slave.states.is_empty() => {
            let place = bytes.below(slave.states.len());
            let (mut state, _) = slave.states.swap_remove(place);
            let kept = state;
            let status = (API.free_state)(c, &raw mut state);
            assert!(slave.answered("free_state", None, status) && state.is_null());
            let status = (API.set_state)(c, kept);
            assert!(!slave.answered("set_state", None, status), "a state that was freed");
        }
        _ => {
            let mut now = slave.now();
            let damaged = bytes.below(2) == 0;
            if damaged {
                let at = bytes.position(now.len());
                now[at] ^= 1 << bytes.below(8);
            }
            let mut state = null_mut();
            let status = (API.deserialize_state)(c, now.as_ptr(), now.len(), &raw mut state);
            assert_eq!(slave.answered("deserialize", None, status), !damaged);
        }
    }
}

/// Calls of model exchange, which is not supported, with arbitrary arguments.
fn exchange(slave: &mut Slave, bytes: &mut Bytes) {
    let (c, n) = (slave.instance, bytes.below(5));
    let mut x: Vec<f64> = (0..n).map(|_| bytes.number()).collect();
    let p = if bytes.byte().is_multiple_of(16) { null_mut() } else { x.as_mut_ptr() };
    let (before, mut flag, mut count) = (x.clone(), 7, 7);
    let f = &raw mut flag;
    let status = match bytes.below(11) {
        0 => (API.set_time)(c, bytes.number()),
        1 => (API.set_continuous_states)(c, p, n),
        2 => (API.get_continuous_states)(c, p, n),
        3 => (API.get_continuous_state_derivatives)(c, p, n),
        4 => (API.completed_integrator_step)(c, 0, f, f),
        5 => (API.get_event_indicators)(c, p, n),
        6 => (API.get_nominals_of_continuous_states)(c, p, n),
        7 => (API.update_discrete_states)(c, f, f, f, f, f, null_mut()),
        8 => (API.get_number_of_continuous_states)(c, &raw mut count),
        9 => (API.enter_event_mode)(c),
        _ => (API.enter_continuous_time_mode)(c),
    };
    assert!(!slave.answered("model exchange", None, status));
    let same = x.iter().zip(&before).all(|(a, b)| a.to_bits() == b.to_bits());
    assert!(same && (flag, count) == (7, 7), "a refused call wrote something");
}

fn dependencies(slave: &mut Slave, bytes: &mut Bytes) {
    let (references, _) = references(slave, bytes);
    for reference in references {
        let mut n = usize::MAX;
        let status = (API.get_number_of_variable_dependencies)(slave.instance, reference, &raw mut n);
        if !slave.answered("number of dependencies", None, status) {
            continue;
        }
        let (mut a, mut b, mut o, mut k) = (vec![0; n], vec![0; n], vec![0; n], vec![0; n]);
        let (a, b, o, k) = (a.as_mut_ptr(), b.as_mut_ptr(), o.as_mut_ptr(), k.as_mut_ptr());
        let status = (API.get_variable_dependencies)(slave.instance, reference, a, b, o, k, n);
        assert!(slave.answered("dependencies", None, status));
    }
}

/// Functions of unsupported features.
fn absent(slave: &mut Slave, bytes: &mut Bytes) {
    let (c, reference, n) = (slave.instance, 0, bytes.below(2));
    let (r, mut long, mut text, mut binary) = (&raw const reference, 5, null(), null());
    let (call, status) = match bytes.below(12) {
        0 => (Some(Call::Get), (API.get_string)(c, r, n, &raw mut text, n)),
        1 => (Some(Call::Set), (API.set_string)(c, r, n, &raw const text, n)),
        2 => (Some(Call::Get), (API.get_binary)(c, r, n, &raw mut long, &raw mut binary, n)),
        3 => (Some(Call::Get), (API.get_float32)(c, r, n, null_mut(), n)),
        4 => (Some(Call::Set), (API.set_uint8)(c, r, n, null(), n)),
        5 => (None, (API.get_clock)(c, r, n, null_mut())),
        6 => (None, (API.set_interval_decimal)(c, r, n, null())),
        7 => (None, (API.get_output_derivatives)(c, r, n, null(), null_mut(), n)),
        8 => (None, if n == 0 { OK } else { (API.enter_configuration_mode)(c) }),
        9 => (None, if n == 0 { OK } else { (API.enter_step_mode)(c) }),
        10 => (None, if n == 0 { OK } else { (API.evaluate_discrete_states)(c) }),
        _ => (None, if n == 0 { OK } else { (API.activate_model_partition)(c, 0, 0.0) }),
    };
    let done = slave.answered("what there is not", call, status);
    assert!(!done || n == 0);
}
