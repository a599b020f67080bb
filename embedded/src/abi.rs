//! The functions of `punctual.h`. All `unsafe` code of the crate is here: pointers of the caller, and the memory from which
//! [`load`](punctual_load) allocates.
#![allow(unsafe_code)]
#![allow(unreachable_pub, reason = "cbindgen reads what is public; C calls it")]

use alloc::boxed::Box;
use core::alloc::{GlobalAlloc, Layout};
use core::cell::UnsafeCell;
use core::ffi::c_void;
use core::mem::MaybeUninit;
use core::ptr;
use core::slice;
use core::sync::atomic::{AtomicBool, Ordering};

use linked_list_allocator::Heap;
use punctual_core::filter::Phase;

use crate::memory::Size;
use crate::{FileError, Loaded, saved};

/// A filter. It lives in the memory that `punctual_load` was given, its plan in the file.
pub struct PunctualFilter {
    loaded: Loaded<'static>,
    states: usize,
    inputs: usize,
}

/// What a function returns: 0, or why it did nothing.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PunctualResult {
    /// Done.
    Ok = 0,
    /// A pointer is null, or memory is not aligned to 8 bytes.
    Pointer = 1,
    /// A length is not that of the filter; a time is negative or no number; there is no such barrier.
    Argument = 2,
    /// The memory is less than `punctual_size`; the buffer is less than `punctual_saved_size`.
    Memory = 3,
    /// The file is no filter of this version: write it again with `punctual build --embedded`.
    Format = 4,
    /// The file or the saved state is damaged.
    Damaged = 5,
    /// The filter needs more inputs, a higher relative degree or more rows than this library has room for: build the library
    /// without the feature `small`.
    Room = 6,
    /// The file has a number out of its range.
    Range = 7,
    /// Another filter is being loaded at this moment, by an interrupt or a thread: load again.
    Busy = 8,
}

impl From<FileError> for PunctualResult {
    fn from(error: FileError) -> Self {
        match error {
            FileError::Format => Self::Format,
            FileError::Damaged => Self::Damaged,
            FileError::Room => Self::Room,
            FileError::Range => Self::Range,
        }
    }
}

/// What a step did.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct PunctualReport {
    /// The status: `PUNCTUAL_UNCHANGED` and so on, numbered as in the FMU.
    pub status: i32,
    /// Rounds of the active-set method.
    pub iterations: u32,
    /// The period in s over which the rows hold, 0 if at the sample alone.
    pub period: f64,
    /// Whether a plan is followed, and why not: `PUNCTUAL_PLAN_KEPT` and so on.
    pub plan: i32,
    /// The time in s until which the promises of the plan are kept, whatever `u_ref` comes; 0 if none is followed.
    pub guaranteed_until: f64,
}

/// What a step found of one barrier.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct PunctualBarrier {
    /// h, in its unit; the set is h >= 0.
    pub h: f64,
    /// Time in s until the deadline; infinite if there is none.
    pub time_left: f64,
    /// By how much its row holds; negative where it does not.
    pub slack: f64,
    /// Time in s at which h >= 0 was reached, NaN before.
    pub arrival_time: f64,
    /// The phase: `PUNCTUAL_WAITING` and so on, numbered as in the FMU.
    pub phase: i32,
    /// Steps in a row that did not meet its row.
    pub unmet_steps: u32,
    /// Whether the theorem behind its promise applies from this step on.
    pub on_course: bool,
    /// Whether the input bounds rule out that its deadline is met.
    pub deadline_unreachable: bool,
    /// Whether other barriers keep it from its goal.
    pub deadlocked: bool,
    /// Whether the plan keeps its promise, whatever `u_ref` comes.
    pub guaranteed: bool,
}

/// The memory of the filter that is being loaded; nothing else allocates.
struct Memory {
    is_loading: AtomicBool,
    heap: UnsafeCell<Heap>,
}

// SAFETY: only who has set `is_loading` allocates.
unsafe impl Sync for Memory {}

#[global_allocator]
static MEMORY: Memory = Memory { is_loading: AtomicBool::new(false), heap: UnsafeCell::new(Heap::empty()) };

// SAFETY: the heap hands out parts of the caller's memory, each once, and nothing after that memory is used up.
unsafe impl GlobalAlloc for Memory {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: called while loading, by the one who loads.
        let heap = unsafe { &mut *self.heap.get() };
        heap.allocate_first_fit(layout).map_or(ptr::null_mut(), |found| found.as_ptr())
    }

    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        // SAFETY: as above.
        let heap = unsafe { &mut *self.heap.get() };
        if let Some(block) = ptr::NonNull::new(block) {
            // SAFETY: `block` is of this heap: nothing is freed after loading.
            unsafe { heap.deallocate(block, layout) };
        }
    }
}

/// Nothing panics with what the functions accept. If it does, the program stops here.
#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    #[cfg(not(target_os = "none"))]
    {
        unsafe extern "C" {
            fn abort() -> !;
        }
        // SAFETY: every C library has it.
        unsafe { abort() }
    }
    #[cfg(target_os = "none")]
    loop {
        core::hint::spin_loop();
    }
}

/// What the precompiled parts of Rust's library refer to on systems that unwind; nothing here unwinds.
#[cfg(not(target_os = "none"))]
#[unsafe(no_mangle)]
extern "C" fn rust_eh_personality() {}

/// The bytes at `data`.
///
/// # Safety
///
/// `data` is null or points to `length` values that nobody writes meanwhile.
unsafe fn given<'a, T>(data: *const T, length: usize) -> Option<&'a [T]> {
    // SAFETY: by the caller.
    (!data.is_null() && data.is_aligned()).then(|| unsafe { slice::from_raw_parts(data, length) })
}

/// The bytes that the filter of a file needs, and its numbers of states and inputs.
fn needed(file: &[u8]) -> Result<(usize, [usize; 2]), FileError> {
    let size = Size::of(file)?;
    let memory = size.memory().and_then(|memory| memory.checked_add(size_of::<PunctualFilter>()));
    memory.map(|memory| (memory, size.dimensions())).ok_or(FileError::Room)
}

/// The number of bytes that a filter needs, in `*size`.
///
/// # Safety
///
/// `file` is null or points to `file_size` bytes; `size` is null or valid.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn punctual_size(
    file: *const c_void,
    file_size: usize,
    size: *mut usize,
) -> PunctualResult {
    // SAFETY: by the caller.
    let (file, size) = (unsafe { given(file.cast::<u8>(), file_size) }, unsafe { size.as_mut() });
    let (Some(file), Some(size)) = (file, size) else { return PunctualResult::Pointer };
    match needed(file) {
        Ok((needed, _)) => {
            *size = needed;
            PunctualResult::Ok
        }
        Err(error) => error.into(),
    }
}

/// Makes the filter of `file` in `memory`, which it keeps. If the file has a plan, it is used where it is, in flash for example, and
/// has to stay as it is; otherwise it may go. The only function that allocates, and only in `memory`.
///
/// # Safety
///
/// `memory` and `file` are null or point to as many bytes, those of `memory` used by nothing else as long as the filter is, those of
/// `file` unchanged.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn punctual_load(
    memory: *mut c_void,
    memory_size: usize,
    file: *const c_void,
    file_size: usize,
    filter: *mut *mut PunctualFilter,
) -> PunctualResult {
    // SAFETY: by the caller.
    let (file, filter) = (unsafe { given(file.cast::<u8>(), file_size) }, unsafe { filter.as_mut() });
    let (Some(file), Some(filter)) = (file, filter) else { return PunctualResult::Pointer };
    *filter = ptr::null_mut();
    if memory.is_null() || !memory.cast::<u64>().is_aligned() {
        return PunctualResult::Pointer;
    }
    let [states, inputs] = match needed(file) {
        Ok((needed, _)) if memory_size < needed => return PunctualResult::Memory,
        Ok((_, dimensions)) => dimensions,
        Err(error) => return error.into(),
    };
    if MEMORY.is_loading.swap(true, Ordering::Acquire) {
        return PunctualResult::Busy;
    }
    // SAFETY: nobody else is loading.
    let heap = unsafe { &mut *MEMORY.heap.get() };
    // SAFETY: the memory is the filter's from now on, and a heap that is used up before is not asked again.
    let memory = unsafe { slice::from_raw_parts_mut(memory.cast::<MaybeUninit<u8>>(), memory_size) };
    *heap = Heap::empty();
    // SAFETY: it is valid as long as the filter is, and no block of the heap is freed later.
    unsafe { heap.init(memory.as_mut_ptr().cast(), memory.len()) };
    let made = crate::read(file).map(|loaded| Box::new(PunctualFilter { loaded, states, inputs }));
    let result = match made {
        Ok(made) => {
            *filter = Box::into_raw(made);
            PunctualResult::Ok
        }
        Err(error) => error.into(),
    };
    // SAFETY: still the only one who loads.
    unsafe { *MEMORY.heap.get() = Heap::empty() };
    MEMORY.is_loading.store(false, Ordering::Release);
    result
}

/// The numbers of states, inputs and barriers; 0 for null.
///
/// # Safety
///
/// `filter` is null or from `punctual_load`; the others are null or valid.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn punctual_dimensions(
    filter: *const PunctualFilter,
    states: *mut usize,
    inputs: *mut usize,
    barriers: *mut usize,
) -> PunctualResult {
    // SAFETY: by the caller.
    let Some(own) = (unsafe { filter.as_ref() }) else { return PunctualResult::Pointer };
    let numbers = [own.states, own.inputs, own.loaded.filter.report().barriers.len()];
    for (to, number) in [states, inputs, barriers].into_iter().zip(numbers) {
        // SAFETY: by the caller.
        if let Some(to) = unsafe { to.as_mut() } {
            *to = number;
        }
    }
    PunctualResult::Ok
}

/// The time in s, > 0, for which the input of the next step will be held, if the timer knows it; 0 if not.
///
/// # Safety
///
/// `filter` is null or from `punctual_load`, and used by nobody else meanwhile.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn punctual_expect_hold(filter: *mut PunctualFilter, seconds: f64) -> PunctualResult {
    // SAFETY: by the caller.
    let Some(own) = (unsafe { filter.as_mut() }) else { return PunctualResult::Pointer };
    match own.loaded.filter.expect_hold((seconds != 0.0).then_some(seconds)) {
        Ok(()) => PunctualResult::Ok,
        Err(_) => PunctualResult::Argument,
    }
}

/// Writes to `u` the safe input nearest to `u_ref` at time `t` (s) and state `x`: finite and within its bounds, whatever
/// `x` and `u_ref` are. Does not allocate.
///
/// # Safety
///
/// `filter` is null or from `punctual_load`, and used by nobody else meanwhile. `x`, `u_ref` and `u` are null or have as many
/// numbers as stated; `u` may be `u_ref`. `report` is null or valid.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn punctual_step(
    filter: *mut PunctualFilter,
    t: f64,
    x: *const f64,
    states: usize,
    u_ref: *const f64,
    u: *mut f64,
    inputs: usize,
    report: *mut PunctualReport,
) -> PunctualResult {
    // SAFETY: by the caller.
    let Some(own) = (unsafe { filter.as_mut() }) else { return PunctualResult::Pointer };
    if states != own.states || inputs != own.inputs {
        return PunctualResult::Argument;
    }
    // SAFETY: by the caller.
    let (x, wanted) = (unsafe { given(x, states) }, unsafe { given(u_ref, inputs) });
    let (Some(x), Some(wanted), false) = (x, wanted, u.is_null()) else { return PunctualResult::Pointer };
    let mut asked = [0.0; punctual_core::MAX_INPUTS];
    let mut safe = asked;
    asked[..inputs].copy_from_slice(wanted);
    let Ok(found) = own.loaded.step(t, x, &asked[..inputs], &mut safe[..inputs]) else {
        return PunctualResult::Argument;
    };
    // SAFETY: by the caller.
    unsafe { ptr::copy_nonoverlapping(safe.as_ptr(), u, inputs) };
    // SAFETY: by the caller.
    if let Some(report) = unsafe { report.as_mut() } {
        let follower = own.loaded.follower.as_ref();
        *report = PunctualReport {
            status: found.status as i32,
            iterations: found.iterations,
            period: found.period,
            plan: follower.map_or(0, |follower| follower.state().following as i32),
            guaranteed_until: own.loaded.until().unwrap_or(0.0),
        };
    }
    PunctualResult::Ok
}

/// What the last step found of barrier number `index`, from 0 in the order of the file.
///
/// # Safety
///
/// `filter` is null or from `punctual_load`, and used by nobody else meanwhile; `barrier` is null or valid.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn punctual_barrier(
    filter: *const PunctualFilter,
    index: usize,
    barrier: *mut PunctualBarrier,
) -> PunctualResult {
    // SAFETY: by the caller.
    let (own, barrier) = (unsafe { filter.as_ref() }, unsafe { barrier.as_mut() });
    let (Some(own), Some(barrier)) = (own, barrier) else { return PunctualResult::Pointer };
    let Some(found) = own.loaded.filter.report().barriers.get(index) else { return PunctualResult::Argument };
    *barrier = PunctualBarrier {
        h: found.h,
        time_left: found.time_left,
        slack: found.slack,
        arrival_time: found.arrival_time.unwrap_or(f64::NAN),
        phase: phase(found.phase),
        unmet_steps: found.unmet_steps,
        on_course: found.on_course,
        deadline_unreachable: found.deadline_unreachable,
        deadlocked: found.deadlocked,
        guaranteed: own.loaded.is_guaranteed(index),
    };
    PunctualResult::Ok
}

fn phase(phase: Phase) -> i32 {
    phase as i32
}

/// Forgets what was promised: the next step starts every deadline again, and the plan.
///
/// # Safety
///
/// `filter` is null or from `punctual_load`, and used by nobody else meanwhile.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn punctual_rearm(filter: *mut PunctualFilter) -> PunctualResult {
    // SAFETY: by the caller.
    let Some(own) = (unsafe { filter.as_mut() }) else { return PunctualResult::Pointer };
    own.loaded.rearm();
    PunctualResult::Ok
}

/// The most bytes that `punctual_save` writes; 0 for null.
///
/// # Safety
///
/// `filter` is null or from `punctual_load`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn punctual_saved_size(filter: *const PunctualFilter) -> usize {
    // SAFETY: by the caller.
    unsafe { filter.as_ref() }.map_or(0, |own| saved::size(own.loaded.filter.state()))
}

/// Writes what the filter remembers to `buffer`, and the number of bytes to `*written`.
///
/// # Safety
///
/// `filter` is null or from `punctual_load`, and used by nobody else meanwhile; `buffer` is null or has `size` bytes;
/// `written` is null or valid.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn punctual_save(
    filter: *const PunctualFilter,
    buffer: *mut c_void,
    size: usize,
    written: *mut usize,
) -> PunctualResult {
    // SAFETY: by the caller.
    let (own, written) = (unsafe { filter.as_ref() }, unsafe { written.as_mut() });
    let (Some(own), Some(written), false) = (own, written, buffer.is_null()) else {
        return PunctualResult::Pointer;
    };
    // SAFETY: by the caller.
    let buffer = unsafe { slice::from_raw_parts_mut(buffer.cast::<u8>(), size) };
    let follower = own.loaded.follower.as_ref().map(|follower| *follower.state());
    match saved::write(own.loaded.filter.state(), follower, buffer) {
        Some(length) => {
            *written = length;
            PunctualResult::Ok
        }
        None => PunctualResult::Memory,
    }
}

/// Continues from what `punctual_save` wrote, as if there had been no break. On another filter of the same file too.
///
/// # Safety
///
/// `filter` is null or from `punctual_load`, and used by nobody else meanwhile; `buffer` is null or has `size` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn punctual_restore(
    filter: *mut PunctualFilter,
    buffer: *const c_void,
    size: usize,
) -> PunctualResult {
    // SAFETY: by the caller.
    let (own, buffer) = (unsafe { filter.as_mut() }, unsafe { given(buffer.cast::<u8>(), size) });
    let (Some(own), Some(buffer)) = (own, buffer) else { return PunctualResult::Pointer };
    let Loaded { filter, follower, .. } = &mut own.loaded;
    let restored = filter.restore_by(|state| match (saved::read(buffer, state), follower) {
        (Some(None), None) => true,
        (Some(Some(state)), Some(follower)) => follower.restore(state),
        _ => false,
    });
    if restored { PunctualResult::Ok } else { PunctualResult::Damaged }
}
