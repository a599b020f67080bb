//! States: their bytes, their lifetime, and bytes that are not a state.

use std::ffi::c_void;
use std::ptr::{null, null_mut};

use crate::api::API;
use crate::fmu::{FILTER, Fmu, PLANT};
use crate::slave::Slave;

/// Positions of the parts of a state, as in `fmu/src/state.rs`.
const VERSION: usize = 8;
const GUID: usize = 12;
pub(crate) const LENGTH: usize = 50;
const MODE: usize = 58;
const TIME: usize = 59;

fn crc32(bytes: &[u8]) -> u32 {
    let mut crc = u32::MAX;
    for byte in bytes {
        crc ^= u32::from(*byte);
        for _ in 0..8 {
            crc = if crc & 1 == 1 { crc >> 1 ^ 0xedb8_8320 } else { crc >> 1 };
        }
    }
    !crc
}

/// `bytes` with the right checksum.
pub(crate) fn sealed(mut bytes: Vec<u8>) -> Vec<u8> {
    let end = bytes.len() - 4;
    let checksum = crc32(&bytes[..end]).to_le_bytes();
    bytes[end..].copy_from_slice(&checksum);
    bytes
}

/// `bytes` with `part` written at `place`.
fn with(bytes: &[u8], place: usize, part: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    bytes[place..place + part.len()].copy_from_slice(part);
    bytes
}

fn stepped(fmu: &Fmu) -> Slave<'_> {
    let slave = Slave::ready(fmu);
    slave.set_inputs(&[1.0, 0.5]);
    slave.step(0.0, 0.25);
    slave.set_inputs(&[2.0, 0.75]);
    slave
}

#[test]
fn the_layout_is_what_is_documented() {
    assert_eq!(crc32(b"123456789"), 0xcbf4_3926, "the check value of CRC-32");
    for (configuration, size) in [(FILTER, 988), (PLANT, 202)] {
        let fmu = Fmu::new(configuration);
        let bytes = stepped(&fmu).now();
        assert_eq!(&bytes[..VERSION], b"PUNCTUAL");
        assert_eq!(bytes[VERSION..GUID], 14_u32.to_le_bytes());
        assert_eq!(&bytes[GUID..LENGTH], fmu.guid().as_bytes());
        assert_eq!(bytes[LENGTH..MODE], (bytes.len() as u64).to_le_bytes());
        assert_eq!(bytes[MODE], 2, "step mode");
        assert_eq!(bytes[TIME..TIME + 8], 0.25_f64.to_le_bytes());
        assert_eq!(sealed(bytes.clone()), bytes);
        assert_eq!(bytes.len(), size, "the layout has changed: raise its version, and this number");
    }
}

/// One flipped bit anywhere, and every wrong length.
#[test]
fn damaged_bytes_are_refused() {
    for configuration in [FILTER, PLANT] {
        let fmu = Fmu::new(configuration);
        let slave = stepped(&fmu);
        let (before, bytes) = (slave.snapshot(), slave.now());
        for bit in 0..8 * bytes.len() {
            let mut damaged = bytes.clone();
            damaged[bit / 8] ^= 1 << (bit % 8);
            let (status, state) = slave.try_read(&damaged);
            let message = slave.refused(status);
            assert!(
                state.is_null() && message.starts_with("fmi2DeSerializeFMUstate: "),
                "bit {bit}: {message}"
            );
        }
        for len in 0..bytes.len() {
            let (status, state) = slave.try_read(&bytes[..len]);
            let message = slave.refused(status);
            assert!(state.is_null() && message.contains("cut off"), "{len} bytes: {message}");
        }
        assert_eq!((slave.now(), slave.snapshot()), (bytes, before));
    }
}

#[test]
fn the_message_says_what_is_wrong() {
    let (filter, plant) = (Fmu::new(FILTER), Fmu::new(PLANT));
    let (slave, other) = (stepped(&filter), stepped(&plant));
    let bytes = slave.now();
    let size = bytes.len();
    let forged = |place, part: &[u8]| sealed(with(&bytes, place, part));
    let end = [&bytes[..], &[0, 7]].concat();
    for (bytes, wanted) in [
        (Vec::new(), "the state is cut off in the magic number: 0 bytes of 8".to_owned()),
        (with(&bytes, 0, b"p"), "the bytes do not begin as a state does, with \"PUNCTUAL\"".to_owned()),
        (forged(VERSION, &[1]), "the version of the layout is 1, must be 14".to_owned()),
        (
            other.now(),
            format!(
                "the state belongs to the FMU with the GUID {:?}, must be {:?}",
                plant.guid(),
                filter.guid()
            ),
        ),
        (
            forged(LENGTH, &[0xff; 8]),
            format!("the state is cut off: there are {size} bytes, must be {}", usize::MAX),
        ),
        // Of inputs on their way a filter without a delay has the number alone, after its length.
        (forged(LENGTH, &[0; 8]), format!("the length is 0 bytes, must be at least {}", size - 9)),
        (
            bytes[..size - 1].to_vec(),
            format!("the state is cut off: there are {} bytes, must be {size}", size - 1),
        ),
        (end, format!("byte {} after the state is 7, must be 0", size + 1)),
        (with(&bytes, TIME, &[1]), "the bytes are damaged".to_owned()),
        (forged(MODE, &[4]), "mode: is 4, must be < 4".to_owned()),
        (forged(TIME, &f64::NAN.to_le_bytes()), "time is NaN, must be finite".to_owned()),
        (forged(TIME + 8, &[9]), "stepped: is 9, must be 0 or 1".to_owned()),
    ] {
        let (status, state) = slave.try_read(&bytes);
        let message = slave.refused(status);
        assert!(state.is_null() && message.ends_with(&wanted), "{message} should end with {wanted}");
    }
    assert_eq!(slave.now(), bytes);
    // A larger buffer than needed.
    let state = slave.state();
    let mut room = vec![1_u8; size + 3];
    slave.ok((API.serialize)(slave.component, state, room.as_mut_ptr().cast(), size + 3));
    assert_eq!(room, [&bytes[..], &[0; 3]].concat());
    slave.restore(slave.read(&room));
    let message = slave.refused((API.serialize)(slave.component, state, room.as_mut_ptr().cast(), size - 1));
    assert!(message.ends_with(&format!("there is room for {} bytes, must be {size}", size - 1)), "{message}");
    assert_eq!(room[..size], bytes, "nothing was written");
}

#[test]
fn an_old_state_is_overwritten() {
    let fmu = Fmu::new(FILTER);
    let slave = Slave::ready(&fmu);
    let mut state = slave.state();
    let (first, start) = (state, slave.now());
    slave.set_inputs(&[1.0, 2.0]);
    slave.step(0.0, 0.5);
    slave.ok((API.get_state)(slave.component, &raw mut state));
    assert_eq!(state, first);
    assert_eq!(slave.bytes(state), slave.now());
    assert_ne!(slave.bytes(state), start);
}

#[test]
fn states_that_are_none() {
    let fmu = Fmu::new(FILTER);
    let slave = Slave::ready(&fmu);
    let c = slave.component;
    slave.ok((API.free_state)(c, null_mut()));
    let mut state = null_mut();
    slave.ok((API.free_state)(c, &raw mut state));

    let mut freed = slave.state();
    let copy = freed;
    slave.ok((API.free_state)(c, &raw mut freed));
    assert!(freed.is_null());
    let before = slave.now();
    let mut number = 1.5;
    let foreign: *mut c_void = (&raw mut number).cast();
    for bad in [copy, foreign, usize::MAX as *mut c_void] {
        let (mut kept, mut size, mut room) = (bad, 7, [0; 4096]);
        let none = |status| {
            let message = slave.refused(status);
            assert!(message.contains(": FMUstate was not returned by fmi2GetFMUstate"), "{message}");
        };
        none((API.get_state)(c, &raw mut kept));
        none((API.set_state)(c, bad));
        none((API.free_state)(c, &raw mut kept));
        none((API.serialized_size)(c, bad, &raw mut size));
        none((API.serialize)(c, bad, room.as_mut_ptr(), 4096));
        assert_eq!((kept, size, room), (bad, 7, [0; 4096]));
    }
    let refused = |status, wanted: &str| {
        let message = slave.refused(status);
        assert!(message.ends_with(wanted), "{message} should end with {wanted}");
    };
    refused((API.set_state)(c, null_mut()), "fmi2SetFMUstate: FMUstate is NULL");
    refused((API.serialized_size)(c, null_mut(), &mut 0), "fmi2SerializedFMUstateSize: FMUstate is NULL");
    refused((API.serialize)(c, null_mut(), null_mut(), 0), "fmi2SerializeFMUstate: FMUstate is NULL");
    let state = slave.state();
    refused((API.get_state)(c, null_mut()), "FMUstate is NULL with 1 elements");
    refused((API.serialized_size)(c, state, null_mut()), "size is NULL with 1 elements");
    refused((API.serialize)(c, state, null_mut(), 4096), "serializedState is NULL with 4096 elements");
    refused((API.deserialize)(c, null(), 8, &mut null_mut()), "serializedState is NULL with 8 elements");
    let bytes = before.as_ptr().cast();
    refused((API.deserialize)(c, bytes, before.len(), null_mut()), "FMUstate is NULL with 1 elements");
    assert_eq!(slave.now(), before);
}

/// A state works in every instance of its FMU, in none of another FMU, and ends with the instance that made
/// it.
#[test]
fn states_and_other_instances() {
    let (filter, plant) = (Fmu::new(FILTER), Fmu::new(PLANT));
    let (a, b, other) = (stepped(&filter), Slave::new(&filter), stepped(&plant));
    let mut state = a.state();
    b.restore(state);
    assert_eq!(b.now(), a.now());
    let foreign = |status| {
        let message = other.refused(status);
        assert!(message.contains(": FMUstate belongs to the FMU with the GUID"), "{message}");
    };
    foreign((API.set_state)(other.component, state));
    foreign((API.get_state)(other.component, &raw mut state));
    foreign((API.free_state)(other.component, &raw mut state));
    let second = a.state();
    b.ok((API.free_state)(b.component, &raw mut state));
    drop(a);
    let message = b.refused((API.set_state)(b.component, second));
    assert!(message.ends_with("or was freed, or the instance that made it was"), "{message}");
}
