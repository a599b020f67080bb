//! States: snapshots in memory, and serialised. The six functions differ between the versions of FMI only in
//! their names and types.
//!
//! The importer holds a number, not an address. It is never dereferenced, each number is used once, and a
//! number that does not denote a live state is refused. Every instance of the FMU in the process can use a
//! state. A state ends with `fmi2FreeFMUstate` or `fmi3FreeFMUState`, or with the instance that made it.

use std::collections::BTreeMap;
use std::ffi::{c_char, c_void};
use std::ptr;
use std::sync::{Mutex, MutexGuard, PoisonError};

use super::guard::{Handle, guarded, slice, slice_mut};
use super::{fmi2, fmi3};
use crate::configuration::FmiVersion;
use crate::instance::{Failure, State};
use crate::state;

/// The live states of the process, by number. Only the functions of this file lock it, never a step.
static STATES: Mutex<States> = Mutex::new(States { last: 0, live: BTreeMap::new() });

struct States {
    /// The last number used.
    last: usize,
    live: BTreeMap<usize, Entry>,
}

struct Entry {
    state: Box<State>,
    /// The address of the instance that made it.
    owner: usize,
}

impl States {
    fn lock() -> MutexGuard<'static, Self> {
        STATES.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn insert(&mut self, owner: &Handle, state: State) -> *mut c_void {
        self.last += 1;
        self.live.insert(self.last, Entry { state: Box::new(state), owner: ptr::from_ref(owner).addr() });
        ptr::without_provenance_mut(self.last)
    }

    /// Finds a live state of the FMU of `handle`.
    fn find(&mut self, handle: &Handle, pointer: *mut c_void) -> Result<&mut State, Failure> {
        if pointer.is_null() {
            return Err("FMUstate is NULL".to_owned());
        }
        let entry = self.live.get_mut(&pointer.addr()).ok_or_else(|| {
            let functions = match handle.instance.fmi() {
                FmiVersion::Two => "fmi2GetFMUstate or fmi2DeSerializeFMUstate",
                FmiVersion::Three => "fmi3GetFMUState or fmi3DeserializeFMUState",
            };
            format!(
                "FMUstate was not returned by {functions}, or was freed, or the instance that made it was"
            )
        })?;
        let (found, wanted) = (&entry.state.guid, &handle.instance.product().guid);
        if found != wanted {
            return Err(format!("FMUstate belongs to the FMU with the GUID {found:?}, must be {wanted:?}"));
        }
        Ok(&mut entry.state)
    }
}

/// Frees the states that an instance has left.
pub(super) fn free_all(owner: &Handle) {
    let mut states = States::lock();
    let address = ptr::from_ref(owner).addr();
    states.live.retain(|_, entry| entry.owner != address);
    if states.live.is_empty() {
        // Replacing the empty map frees its memory, so that nothing stays allocated when the library is
        // unloaded.
        states.live = BTreeMap::new();
    }
}

/// Defines the six functions of a version: the types of its status and of its bytes, then the names.
macro_rules! states {
    ($status:ty, $byte:ty; $get:ident $set:ident $free:ident $size:ident $serialize:ident $deserialize:ident) => {
        /// Takes a snapshot in any mode: a new state if `*state` is NULL, else that state is overwritten.
        ///
        /// # Safety
        ///
        /// See the module above; `state` is NULL or points to a state pointer.
        #[unsafe(no_mangle)]
        pub(super) unsafe extern "C" fn $get(component: *mut c_void, state: *mut *mut c_void) -> $status {
            let body = |handle: &mut Handle| {
                // SAFETY: the caller's contract for `state`.
                let state = unsafe { slice_mut("FMUstate", state, 1) }?;
                if state[0].is_null() {
                    let snapshot = handle.instance.state();
                    state[0] = States::lock().insert(handle, snapshot);
                } else {
                    handle.instance.save(States::lock().find(handle, state[0])?);
                }
                Ok(<$status>::OK)
            };
            // SAFETY: the caller's contract for components.
            unsafe { guarded(component, stringify!($get), body) }
        }

        /// Restores an earlier or later snapshot, from any mode.
        ///
        /// # Safety
        ///
        /// See the module above.
        #[unsafe(no_mangle)]
        pub(super) unsafe extern "C" fn $set(component: *mut c_void, state: *mut c_void) -> $status {
            let body = |handle: &mut Handle| {
                let mut states = States::lock();
                let state = states.find(handle, state)?;
                handle.instance.restore(state).map(|()| <$status>::OK)
            };
            // SAFETY: the caller's contract for components.
            unsafe { guarded(component, stringify!($set), body) }
        }

        /// Frees a state and sets `*state` to NULL; NULL is allowed.
        ///
        /// # Safety
        ///
        /// See the module above; `state` is NULL or points to a state pointer.
        #[unsafe(no_mangle)]
        pub(super) unsafe extern "C" fn $free(component: *mut c_void, state: *mut *mut c_void) -> $status {
            let body = |handle: &mut Handle| {
                if state.is_null() {
                    return Ok(<$status>::OK);
                }
                // SAFETY: the caller's contract for `state`.
                let state = unsafe { slice_mut("FMUstate", state, 1) }?;
                if !state[0].is_null() {
                    let mut states = States::lock();
                    states.find(handle, state[0])?;
                    states.live.remove(&state[0].addr());
                    state[0] = ptr::null_mut();
                }
                Ok(<$status>::OK)
            };
            // SAFETY: the caller's contract for components.
            unsafe { guarded(component, stringify!($free), body) }
        }

        /// Returns the number of bytes of a state, which is the same for all states of an FMU that follows no
        /// plans.
        ///
        /// # Safety
        ///
        /// See the module above; `size` is NULL or writable.
        #[unsafe(no_mangle)]
        pub(super) unsafe extern "C" fn $size(
            component: *mut c_void,
            state: *mut c_void,
            size: *mut usize,
        ) -> $status {
            let body = |handle: &mut Handle| {
                let mut states = States::lock();
                let state = states.find(handle, state)?;
                // SAFETY: the caller's contract for `size`.
                let size = unsafe { slice_mut("size", size, 1) }?;
                size[0] = state::size(handle.instance.product(), state)?;
                Ok(<$status>::OK)
            };
            // SAFETY: the caller's contract for components.
            unsafe { guarded(component, stringify!($size), body) }
        }

        /// Writes a state to `size` bytes; extra bytes become 0.
        ///
        /// # Safety
        ///
        /// See the module above.
        #[unsafe(no_mangle)]
        pub(super) unsafe extern "C" fn $serialize(
            component: *mut c_void,
            state: *mut c_void,
            bytes: *mut $byte,
            size: usize,
        ) -> $status {
            let body = |handle: &mut Handle| {
                let mut states = States::lock();
                let state = states.find(handle, state)?;
                // SAFETY: the caller's contract for arrays.
                let bytes = unsafe { slice_mut("serializedState", bytes.cast::<u8>(), size) }?;
                state::write(handle.instance.product(), state, bytes).map(|()| <$status>::OK)
            };
            // SAFETY: the caller's contract for components.
            unsafe { guarded(component, stringify!($serialize), body) }
        }

        /// Makes a new state from bytes. The old value of `*state` is not read, since the standard does not
        /// define it.
        ///
        /// # Safety
        ///
        /// See the module above; `state` is NULL or writable.
        #[unsafe(no_mangle)]
        pub(super) unsafe extern "C" fn $deserialize(
            component: *mut c_void,
            bytes: *const $byte,
            size: usize,
            state: *mut *mut c_void,
        ) -> $status {
            let body = |handle: &mut Handle| {
                // SAFETY: the caller's contract for arrays.
                let bytes = unsafe { slice("serializedState", bytes.cast::<u8>(), size) }?;
                // SAFETY: the caller's contract for `state`.
                let state = unsafe { slice_mut("FMUstate", state, 1) }?;
                let read = state::read(handle.instance.product(), bytes)?;
                state[0] = States::lock().insert(handle, read);
                Ok(<$status>::OK)
            };
            // SAFETY: the caller's contract for components.
            unsafe { guarded(component, stringify!($deserialize), body) }
        }
    };
}

states!(
    fmi2::Status, c_char;
    fmi2GetFMUstate fmi2SetFMUstate fmi2FreeFMUstate fmi2SerializedFMUstateSize fmi2SerializeFMUstate
    fmi2DeSerializeFMUstate
);

states!(
    fmi3::Status, u8;
    fmi3GetFMUState fmi3SetFMUState fmi3FreeFMUState fmi3SerializedFMUStateSize fmi3SerializeFMUState
    fmi3DeserializeFMUState
);
