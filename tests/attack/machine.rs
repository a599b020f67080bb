//! One to three instances, their states, and the conditions that must hold after each call.

use std::ffi::c_int;
use std::ptr::null_mut;

use punctual_core::filter::Status;
use punctual_fmu::configuration::Configuration;
use punctual_fmu::instance::{Call, Mode};
use punctual_modeldescription::Causality;

use crate::api::{API, State};
use crate::bytes::Bytes;
use crate::fleet::FLEET;
use crate::instance::Instance;

/// The most inner steps requested of a plant in one step, so that a case takes no time.
const INNER_STEPS: f64 = 1000.0;

/// Size of inputs and parameters whose products overflow. A controller may then output NaN, which a filter
/// shows.
const HUGE: f64 = 1e150;

/// The parameter value of a missing bound.
const NO_BOUND: f64 = 1e30;

/// A state that exists or existed.
pub(crate) struct Held {
    pub(crate) pointer: State,
    fmu: usize,
    owner: usize,
    mode: Mode,
    /// Whether its values come from changed bytes.
    doubtful: bool,
    live: bool,
}

pub(crate) struct Slot {
    pub(crate) instance: Instance,
    /// Its place in the fleet.
    pub(crate) fmu: usize,
    /// Whether values came from changed bytes and no step was made since.
    pub(crate) doubtful: bool,
}

pub(crate) struct Machine {
    pub(crate) slots: Vec<Slot>,
    pub(crate) held: Vec<Held>,
    /// A digest of everything read, which is the same for the same case.
    pub(crate) digest: u64,
    pub(crate) calls: usize,
}

impl Machine {
    pub(crate) fn new(slots: Vec<Slot>) -> Self {
        Self { slots, held: Vec::new(), digest: 0, calls: 0 }
    }

    pub(crate) fn note(&mut self, bits: u64) {
        self.digest = (self.digest ^ bits).wrapping_mul(0x0100_0000_01B3).rotate_left(17);
    }

    /// Judges a call of slot `k`: its answer, and that it failed if it is illegal in this mode.
    #[track_caller]
    pub(crate) fn answered(&mut self, k: usize, name: &str, call: Option<Call>, status: c_int) -> bool {
        let done = self.slots[k].instance.answered(name, status);
        let legal = call.is_none_or(|call| self.slots[k].instance.mode.is_in(call.modes()));
        assert!(legal || !done, "{name} in the mode {:?}", self.slots[k].instance.mode);
        self.calls += 1;
        self.note(u64::from(done));
        done
    }

    /// Makes a call that changes the mode. `usable` says that its arguments are right, so that it must
    /// succeed if it is legal.
    #[track_caller]
    pub(crate) fn moved(&mut self, k: usize, call: Call, to: Mode, usable: bool, status: c_int) {
        let legal = self.slots[k].instance.mode.is_in(call.modes());
        let done = self.answered(k, &format!("{call:?}"), Some(call), status);
        assert!(done || !(legal && usable), "{call:?} in the mode {:?}", self.slots[k].instance.mode);
        if done {
            self.slots[k].instance.mode = to;
        }
    }

    /// Moves slot `k` from any mode to step mode, if its parameters allow.
    pub(crate) fn initialize(&mut self, k: usize, start: f64) {
        let c = self.slots[k].instance.component;
        let status = (API.setup_experiment)(c, 0, 0.0, start, 0, 0.0);
        self.moved(k, Call::SetupExperiment, Mode::INSTANTIATED, start.is_finite(), status);
        let status = (API.enter_initialization_mode)(c);
        self.moved(k, Call::EnterInitializationMode, Mode::INITIALIZATION, true, status);
        let status = (API.exit_initialization_mode)(c);
        self.moved(k, Call::ExitInitializationMode, Mode::STEP, false, status);
        if self.slots[k].instance.mode == Mode::STEP {
            self.slots[k].doubtful = false;
        }
    }

    /// Sets all real inputs to numbers from `value`.
    pub(crate) fn set_inputs(&mut self, k: usize, mut value: impl FnMut() -> f64) {
        let slot = &self.slots[k];
        let references = slot.instance.references(Causality::Input, "");
        let values: Vec<f64> = references.iter().map(|_| value()).collect();
        let c = slot.instance.component;
        let status = (API.set_real)(c, references.as_ptr(), values.len(), values.as_ptr());
        let legal = slot.instance.mode.is_in(Call::Set.modes());
        let done = self.answered(k, "set_real", Some(Call::Set), status);
        assert_eq!(done, legal, "inputs take any number");
    }

    /// Makes a step. Afterwards either time has advanced, or it has not and the refusal shows.
    pub(crate) fn step(&mut self, k: usize, t: f64, h: f64) {
        let slot = &self.slots[k];
        let h = match slot.instance.reals(Causality::Parameter, "inner_step")[..] {
            [inner] if (INNER_STEPS..1e9).contains(&(h / inner)) => inner,
            _ => h,
        };
        let (c, before) = (slot.instance.component, slot.instance.time());
        let inputs = slot.instance.reals(Causality::Input, "");
        let status = (API.do_step)(c, t, h, 1);
        let done = self.answered(k, "do_step", Some(Call::DoStep), status);
        let after = self.slots[k].instance.time();
        self.note(after.to_bits());
        if !done {
            assert_eq!(after.to_bits(), before.to_bits(), "a refused step moved the time");
            return;
        }
        assert!(after >= before && after.is_finite() && h >= 0.0, "from {before} by ({t}, {h}) to {after}");
        self.slots[k].doubtful = false;
        self.look(k);
        let invalid = inputs.iter().any(|v| !v.is_finite());
        let Slot { instance, .. } = &self.slots[k];
        match instance.fmu.product.configuration {
            Configuration::Filter(_) => {
                let status = instance.integer("status");
                assert!(!invalid || status == Status::InvalidInput as c_int, "{status} for {inputs:?}");
                self.note(status as u64);
            }
            Configuration::Plant(_) => assert!(!invalid, "a plant moved with {inputs:?}"),
            Configuration::Controller(_) => {
                let u = instance.reals(Causality::Output, "u_ref.");
                let finite = u.iter().all(|v| v.is_finite());
                let parameters = instance.reals(Causality::Parameter, "");
                let huge = inputs.iter().chain(&parameters).any(|v| v.abs() > HUGE);
                assert!(!invalid || u.iter().all(|v| v.is_nan()), "{u:?} from {inputs:?}");
                assert!(invalid || huge || finite, "{u:?} from {inputs:?}");
            }
        }
    }

    /// Reads the outputs: inputs to a plant are finite and within their bounds in step mode, its states
    /// finite.
    pub(crate) fn look(&mut self, k: usize) {
        let Slot { instance, doubtful, .. } = &self.slots[k];
        let outputs = instance.reals(Causality::Output, "");
        if instance.mode == Mode::STEP && !doubtful {
            let x = instance.reals(Causality::Output, "x.");
            assert!(x.iter().all(|v| v.is_finite()), "x = {x:?}");
            let variables = &instance.fmu.product.variables;
            for v in variables.iter().filter(|v| v.name.starts_with("u.") && v.causality == Causality::Output)
            {
                let name = &v.name[2..];
                let [u] = instance.reals(Causality::Output, &v.name)[..] else { panic!("{name} is one") };
                let bound = |prefix: &str| instance.reals(Causality::Parameter, &format!("{prefix}.{name}"));
                assert!(u.is_finite(), "u.{name} is {u}");
                let above = |min: &f64| *min <= -NO_BOUND || u >= *min;
                let below = |max: &f64| *max >= NO_BOUND || u <= *max;
                let (min, max) = (bound("u_min"), bound("u_max"));
                let within = min.iter().all(above) && max.iter().all(below);
                assert!(within, "u.{name} = {u:e}, must be from {min:?} to {max:?}");
            }
        }
        outputs.into_iter().for_each(|value| self.note(value.to_bits()));
    }

    /// Keeps a state that slot `k` made.
    pub(crate) fn hold(&mut self, k: usize, pointer: State, mode: Mode, doubtful: bool) {
        assert!(!pointer.is_null());
        let fmu = self.slots[k].fmu;
        self.held.push(Held { pointer, fmu, owner: k, mode, doubtful, live: true });
    }

    /// A snapshot of slot `k`: new, or over the one at `place` if there is one.
    pub(crate) fn save(&mut self, k: usize, place: Option<usize>) {
        let Slot { instance, fmu, doubtful } = &self.slots[k];
        let (mode, fmu, doubtful) = (instance.mode, *fmu, *doubtful);
        let mut pointer = place.map_or(null_mut(), |n| self.held[n].pointer);
        let kept = pointer;
        let status = (API.get_state)(instance.component, &raw mut pointer);
        let done = self.answered(k, "get_state", None, status);
        match place {
            None => {
                assert!(done);
                self.hold(k, pointer, mode, doubtful);
            }
            Some(n) => {
                let held = &mut self.held[n];
                assert_eq!((done, pointer), (held.live && held.fmu == fmu, kept));
                if done {
                    (held.mode, held.doubtful) = (mode, doubtful);
                }
            }
        }
    }

    /// Restores slot `k` to the state at `place`; one that was read from changed bytes may be refused.
    pub(crate) fn restore(&mut self, k: usize, place: usize) {
        let Held { pointer, fmu, mode, doubtful, live, .. } = self.held[place];
        let before = self.slots[k].instance.now();
        let status = (API.set_state)(self.slots[k].instance.component, pointer);
        let done = self.answered(k, "set_state", None, status);
        let fits = live && fmu == self.slots[k].fmu;
        assert!(if doubtful { !done || fits } else { done == fits }, "set_state: {done}, {fits}");
        if done {
            self.slots[k].instance.mode = mode;
            self.slots[k].doubtful = doubtful;
        } else {
            assert!(before == self.slots[k].instance.now(), "a refused state changed something");
        }
    }

    /// Frees the state at `place` through slot `k`.
    pub(crate) fn free(&mut self, k: usize, place: usize) {
        let Held { mut pointer, fmu, live, .. } = self.held[place];
        let status = (API.free_state)(self.slots[k].instance.component, &raw mut pointer);
        let done = self.answered(k, "free_state", None, status);
        assert_eq!(done, live && fmu == self.slots[k].fmu);
        assert_eq!(pointer.is_null(), done);
        self.held[place].live &= !done;
    }

    /// Reads a state from `bytes`; `intact` if they are those of a state of this FMU.
    pub(crate) fn read(&mut self, k: usize, bytes: &[u8], intact: bool) -> bool {
        /// Position of the mode: after magic number, version, GUID and length.
        const MODE: usize = 8 + 4 + 38 + 8;
        let (c, mut pointer) = (self.slots[k].instance.component, null_mut());
        let status = (API.deserialize)(c, bytes.as_ptr().cast(), bytes.len(), &raw mut pointer);
        let done = self.answered(k, "deserialize", None, status);
        assert!(done || !intact, "an intact state is refused");
        if done {
            self.hold(k, pointer, Mode::EACH[usize::from(bytes[MODE])], !intact);
            let again = self.slots[k].instance.bytes(pointer);
            assert!(!intact || again == bytes[..again.len()], "what was read is written as it was");
        }
        done
    }

    /// Frees the instance of slot `k`, and makes a new one.
    pub(crate) fn renew(&mut self, k: usize) {
        for held in self.held.iter_mut().filter(|held| held.owner == k) {
            held.live = false;
        }
        let slot = &mut self.slots[k];
        slot.instance = Instance::new(&FLEET[slot.fmu]);
        slot.doubtful = false;
    }

    pub(crate) fn reset(&mut self, k: usize) {
        self.slots[k].instance.reset();
        self.slots[k].doubtful = false;
        self.calls += 1;
    }
}

/// Instances for cases. They are reset after each case, which must make them like new.
#[derive(Default)]
pub(crate) struct Pool {
    free: Vec<Vec<Instance>>,
    fresh: Vec<Vec<u8>>,
}

impl Pool {
    /// An instance of a kind that `bytes` select; with `new` it has not been used before.
    pub(crate) fn slot(&mut self, bytes: &mut Bytes, new: bool) -> Slot {
        if self.fresh.is_empty() {
            self.fresh = FLEET.iter().map(|fmu| Instance::new(fmu).now()).collect();
            self.free.resize_with(FLEET.len(), Vec::new);
        }
        let fmu = bytes.below(FLEET.len());
        let used = if new { None } else { self.free[fmu].pop() };
        let instance = used.unwrap_or_else(|| Instance::new(&FLEET[fmu]));
        Slot { instance, fmu, doubtful: false }
    }

    /// Takes instances back, with the states that they made freed.
    pub(crate) fn give_back(&mut self, machine: Machine) {
        let Machine { slots, held, .. } = machine;
        for (k, Slot { mut instance, fmu, .. }) in slots.into_iter().enumerate() {
            for held in held.iter().filter(|held| held.live && held.owner == k) {
                let mut pointer = held.pointer;
                instance.ok("free_state", (API.free_state)(instance.component, &raw mut pointer));
            }
            instance.reset();
            assert!(instance.now() == self.fresh[fmu], "an instance that was reset is not as a new one");
            self.free[fmu].push(instance);
        }
    }
}
