//! Serialised states with bytes changed.

use punctual_fmu::instance::Mode;

use crate::api::API;
use crate::bytes::Bytes;
use crate::campaign;
use crate::machine::{Machine, Pool};

/// CRC-32 as in Ethernet and zip, independent of the library's own.
fn crc32(bytes: &[u8]) -> u32 {
    let mut crc = u32::MAX;
    for byte in bytes {
        crc ^= u32::from(*byte);
        for _ in 0..8 {
            crc = if crc & 1 == 1 { (crc >> 1) ^ 0xedb8_8320 } else { crc >> 1 };
        }
    }
    !crc
}

/// Changed bytes are refused by their checksum. With a corrected checksum they are refused for their content,
/// or accepted. Then the instance continues, with inputs and states finite and within bounds.
#[test]
fn states_of_changed_bytes() {
    let mut pool = Pool::default();
    campaign::run("states", 500, "states read", |bytes| {
        let mut bytes = Bytes::new(bytes);
        let slots = vec![pool.slot(&mut bytes, false)];
        let mut machine = Machine::new(slots);
        machine.set_inputs(0, || bytes.moderate());
        if bytes.below(4) > 0 {
            machine.initialize(0, 0.0);
        }
        for step in 0..bytes.below(4) {
            machine.set_inputs(0, || bytes.moderate());
            machine.step(0, f64::from(step as u32) * 0.1, 0.1);
        }
        let mut read = 0;
        for _ in 0..1 + bytes.below(6) {
            read += usize::from(changed(&mut machine, &mut bytes));
        }
        pool.give_back(machine);
        read
    });
}

fn changed(machine: &mut Machine, bytes: &mut Bytes) -> bool {
    let original = machine.slots[0].instance.now();
    let mut state = original.clone();
    let content = state.len() - 4;
    for _ in 0..1 + bytes.below(5) {
        // Most changes are made behind the header, since every change in the header is refused.
        let header = if bytes.below(8) == 0 { 0 } else { 58 };
        let at = header + bytes.position(content - header);
        match bytes.below(4) {
            0 => state[at] = bytes.byte(),
            1 => state[at] ^= 1 << bytes.below(8),
            2 => state[at] = bytes.pick(&[0, 1, 2, 3, 4, 5, 255]),
            _ if at + 8 <= content => state[at..at + 8].copy_from_slice(&bytes.number().to_le_bytes()),
            _ => {}
        }
    }
    if state == original {
        return false;
    }
    assert!(!machine.read(0, &state, false), "the checksum does not tell");
    let crc = crc32(&state[..content]);
    state[content..].copy_from_slice(&crc.to_le_bytes());
    if !machine.read(0, &state, false) {
        return false;
    }
    machine.restore(0, machine.held.len() - 1);
    machine.look(0);
    if machine.slots[0].instance.mode == Mode::INSTANTIATED {
        machine.initialize(0, 0.0);
    }
    for _ in 0..3 {
        machine.set_inputs(0, || bytes.moderate());
        let t = machine.slots[0].instance.time();
        machine.step(0, t, 0.1);
        machine.look(0);
    }
    let c = machine.slots[0].instance.component;
    let status = (API.terminate)(c);
    machine.moved(0, punctual_fmu::instance::Call::Terminate, Mode::TERMINATED, true, status);
    let state = machine.held.len() - 1;
    machine.restore(0, state);
    true
}
