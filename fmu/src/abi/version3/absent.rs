//! Functions of features that the model description excludes. Each gives the reason, and returns `fmi3OK`
//! only if nothing is requested.

use super::super::fmi3::{Binary, Boolean, Clock, Instance, IntervalQualifier, Status, Text, ValueReference};
use super::super::guard::{Handle, guarded, none, slice};

use crate::instance::Call;

/// Defines exports that read or write a type that no variable has.
macro_rules! types {
    ($($name:ident($call:ident, $type:literal, $($argument:ident: $pointer:ty),*);)*) => {$(
        /// Reads or writes a type that no variable has, so no variable can be given.
        ///
        /// # Safety
        ///
        /// See the module above.
        #[unsafe(no_mangle)]
        pub(super) unsafe extern "C" fn $name(
            instance: Instance,
            references: *const ValueReference,
            count: usize,
            $($argument: $pointer,)*
            value_count: usize,
        ) -> Status {
            let body = |handle: &mut Handle| {
                $(let _ = $argument;)*
                // SAFETY: the caller's contract for arrays.
                let references = unsafe { slice("valueReferences", references, count) }?;
                handle.instance.check_absent(Call::$call, $type, references, value_count).map(|()| Status::OK)
            };
            // SAFETY: the caller's contract for instances.
            unsafe { guarded(instance, stringify!($name), body) }
        }
    )*};
}

types! {
    fmi3GetFloat32(Get, "Float32", _values: *mut f32);
    fmi3GetInt8(Get, "Int8", _values: *mut i8);
    fmi3GetUInt8(Get, "UInt8", _values: *mut u8);
    fmi3GetInt16(Get, "Int16", _values: *mut i16);
    fmi3GetUInt16(Get, "UInt16", _values: *mut u16);
    fmi3GetUInt32(Get, "UInt32", _values: *mut u32);
    fmi3GetUInt64(Get, "UInt64", _values: *mut u64);
    fmi3GetString(Get, "String", _values: *mut Text);
    fmi3GetBinary(Get, "Binary", _sizes: *mut usize, _values: *mut Binary);
    fmi3SetFloat32(Set, "Float32", _values: *const f32);
    fmi3SetInt8(Set, "Int8", _values: *const i8);
    fmi3SetUInt8(Set, "UInt8", _values: *const u8);
    fmi3SetInt16(Set, "Int16", _values: *const i16);
    fmi3SetUInt16(Set, "UInt16", _values: *const u16);
    fmi3SetUInt32(Set, "UInt32", _values: *const u32);
    fmi3SetUInt64(Set, "UInt64", _values: *const u64);
    fmi3SetString(Set, "String", _values: *const Text);
    fmi3SetBinary(Set, "Binary", _sizes: *const usize, _values: *const Binary);
}

/// Defines exports that succeed if `count` is 0, and are otherwise refused for the reason `why`.
macro_rules! counted {
    ($($why:literal { $($name:ident($($before:ident: $first:ty),*; $($argument:ident: $type:ty),*);)* })*) => {$($(
        #[doc = concat!("Refused unless nothing is asked for: ", $why, ".")]
        ///
        /// # Safety
        ///
        /// See the module above.
        #[unsafe(no_mangle)]
        pub(super) unsafe extern "C" fn $name(
            instance: Instance,
            $($before: $first,)*
            count: usize,
            $($argument: $type,)*
        ) -> Status {
            // SAFETY: the caller's contract for instances.
            unsafe { guarded(instance, stringify!($name), |_| none($why, count)) }
        }
    )*)*};
}

counted! {
    "there are no clocks" {
        fmi3GetClock(_references: *const ValueReference; _values: *mut Clock);
        fmi3SetClock(_references: *const ValueReference; _values: *const Clock);
        fmi3GetIntervalDecimal(
            _references: *const ValueReference; _intervals: *mut f64, _qualifiers: *mut IntervalQualifier
        );
        fmi3GetIntervalFraction(
            _references: *const ValueReference;
            _counters: *mut u64, _resolutions: *mut u64, _qualifiers: *mut IntervalQualifier
        );
        fmi3GetShiftDecimal(_references: *const ValueReference; _shifts: *mut f64);
        fmi3GetShiftFraction(
            _references: *const ValueReference; _counters: *mut u64, _resolutions: *mut u64
        );
        fmi3SetIntervalDecimal(_references: *const ValueReference; _intervals: *const f64);
        fmi3SetIntervalFraction(
            _references: *const ValueReference; _counters: *const u64, _resolutions: *const u64
        );
        fmi3SetShiftDecimal(_references: *const ValueReference; _shifts: *const f64);
        fmi3SetShiftFraction(
            _references: *const ValueReference; _counters: *const u64, _resolutions: *const u64
        );
    }
    "maxOutputDerivativeOrder is 0" {
        fmi3GetOutputDerivatives(
            _references: *const ValueReference; _orders: *const i32, _values: *mut f64, _value_count: usize
        );
    }
}

/// Defines exports that are always refused.
macro_rules! refused {
    ($($why:literal { $($name:ident($($argument:ident: $type:ty),*);)* })*) => {$($(
        #[doc = concat!("Refused: ", $why, ".")]
        ///
        /// # Safety
        ///
        /// See the module above.
        #[unsafe(no_mangle)]
        pub(super) unsafe extern "C" fn $name(instance: Instance $(, $argument: $type)*) -> Status {
            let body = |_: &mut Handle| Err(concat!("not supported: ", $why).to_owned());
            // SAFETY: the caller's contract for instances.
            unsafe { guarded(instance, stringify!($name), body) }
        }
    )*)*};
}

refused! {
    "there are no structural parameters" {
        fmi3EnterConfigurationMode();
        fmi3ExitConfigurationMode();
    }
    "there are no clocks" {
        fmi3EvaluateDiscreteStates();
        fmi3ActivateModelPartition(_clock: ValueReference, _time: f64);
    }
    "hasEventMode is false" {
        fmi3EnterEventMode();
        fmi3UpdateDiscreteStates(
            _need_update: *mut Boolean, _terminate: *mut Boolean, _nominals_changed: *mut Boolean,
            _values_changed: *mut Boolean, _next_event_time_defined: *mut Boolean, _next_event_time: *mut f64
        );
        fmi3EnterStepMode();
    }
    "the FMU is one of co-simulation" {
        fmi3EnterContinuousTimeMode();
        fmi3CompletedIntegratorStep(
            _no_set_fmu_state_prior_to_current_point: Boolean, _enter_event_mode: *mut Boolean,
            _terminate: *mut Boolean
        );
        fmi3SetTime(_time: f64);
        fmi3SetContinuousStates(_states: *const f64, _count: usize);
        fmi3GetContinuousStateDerivatives(_derivatives: *mut f64, _count: usize);
        fmi3GetEventIndicators(_indicators: *mut f64, _count: usize);
        fmi3GetContinuousStates(_states: *mut f64, _count: usize);
        fmi3GetNominalsOfContinuousStates(_nominals: *mut f64, _count: usize);
        fmi3GetNumberOfEventIndicators(_count: *mut usize);
        fmi3GetNumberOfContinuousStates(_count: *mut usize);
    }
}
