//! Defects that tests plant in the check of a tube, to see whether they are found. Outside of tests there are none.

/// A defect of the check.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::plan) enum Fault {
    /// The tube is smaller by a fiftieth where requirements and bounds are checked.
    Small,
    /// Requirements are checked at samples, and not between them.
    Samples,
    /// The error of the first state's measurement is ignored.
    Error,
    /// The first input arrives as its mean gain says.
    Gain,
    /// The law's answer to errors of measurement is ignored.
    Noise,
    /// The freedom of the inputs is ignored.
    Freedom,
    /// What the first derivatives leave out is ignored.
    Remainder,
}

/// The part of the tube that [`Fault::Small`] leaves.
const SMALL: f64 = 0.98;

/// The part of the tube that is checked.
pub(super) fn part() -> f64 {
    if is_planted(Fault::Small) { SMALL } else { 1.0 }
}

#[cfg(not(test))]
pub(in crate::plan) const fn is_planted(_: Fault) -> bool {
    false
}

#[cfg(test)]
std::thread_local! {
    static PLANTED: core::cell::Cell<Option<Fault>> = const { core::cell::Cell::new(None) };
}

#[cfg(test)]
pub(in crate::plan) fn is_planted(fault: Fault) -> bool {
    PLANTED.get() == Some(fault)
}

/// Runs `f` with this fault planted, in this thread.
#[cfg(test)]
pub(in crate::plan) fn with<R>(fault: Option<Fault>, f: impl FnOnce() -> R) -> R {
    PLANTED.set(fault);
    let found = f();
    PLANTED.set(None);
    found
}
