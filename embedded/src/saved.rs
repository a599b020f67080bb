//! What a filter remembers, as bytes: to continue after a restart. Neither way allocates.

use core::mem::size_of;

use punctual_core::MAX_INPUTS;
use punctual_core::convergence::FixedTimeState;
use punctual_core::filter::{Curvature, FilterState, MAX_SENT, Sent};
use punctual_core::follower::FollowerState;
use serde::{Deserialize, Serialize};

use crate::checksum::checksum;

/// The CRC-32 of what follows, little-endian.
const HEAD: usize = 4;

/// What is not a list.
#[derive(Serialize, Deserialize)]
struct Numbers {
    barriers: u8,
    sent: u16,
    time: Option<f64>,
    period: Option<f64>,
    input: [f64; MAX_INPUTS],
    start: Option<f64>,
    curvatures: [Option<Curvature>; 2],
    integrated: f64,
    follower: Option<FollowerState>,
}

/// The most bytes of a value with the size of `T`: numbers of 32 bits take up to 5.
const fn most<T>() -> usize {
    size_of::<T>() + size_of::<T>() / 4
}

/// The most bytes of a state with the lists of this one.
pub(crate) fn size(state: &FilterState) -> usize {
    HEAD + most::<Numbers>()
        + state.barriers.len() * most::<FixedTimeState>()
        + state.sent.capacity().min(MAX_SENT) * most::<Sent>()
}

/// Writes `state`, and that of the follower if there is one, to `buffer`. Returns the number of bytes, or nothing if there is
/// no room.
pub(crate) fn write(
    state: &FilterState,
    follower: Option<FollowerState>,
    buffer: &mut [u8],
) -> Option<usize> {
    let (head, content) = buffer.split_first_chunk_mut::<HEAD>()?;
    let numbers = Numbers {
        barriers: u8::try_from(state.barriers.len()).ok()?,
        sent: u16::try_from(state.sent.len()).ok()?,
        time: state.time,
        period: state.period,
        input: state.input,
        start: state.start,
        curvatures: state.curvatures,
        integrated: state.integrated,
        follower,
    };
    let mut length = postcard::to_slice(&numbers, content).ok()?.len();
    for promise in &state.barriers {
        length += postcard::to_slice(promise, content.get_mut(length..)?).ok()?.len();
    }
    for sent in &state.sent {
        length += postcard::to_slice(sent, content.get_mut(length..)?).ok()?.len();
    }
    *head = checksum(&content[..length]).to_le_bytes();
    Some(HEAD + length)
}

/// Reads what [`write`] wrote into a `state` with as many barriers. Returns that of the follower, if there is one; nothing if
/// the bytes are not whole.
pub(crate) fn read(bytes: &[u8], state: &mut FilterState) -> Option<Option<FollowerState>> {
    let (head, content) = bytes.split_first_chunk::<HEAD>()?;
    if u32::from_le_bytes(*head) != checksum(content) {
        return None;
    }
    let (numbers, mut rest): (Numbers, _) = postcard::take_from_bytes(content).ok()?;
    let sent = usize::from(numbers.sent);
    if usize::from(numbers.barriers) != state.barriers.len() || sent > state.sent.capacity() {
        return None;
    }
    for promise in &mut state.barriers {
        (*promise, rest) = postcard::take_from_bytes(rest).ok()?;
    }
    state.sent.clear();
    for _ in 0..sent {
        let one: Sent;
        (one, rest) = postcard::take_from_bytes(rest).ok()?;
        state.sent.push(one);
    }
    (state.time, state.period, state.input) = (numbers.time, numbers.period, numbers.input);
    (state.start, state.curvatures, state.integrated) =
        (numbers.start, numbers.curvatures, numbers.integrated);
    Some(numbers.follower)
}
