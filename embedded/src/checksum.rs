//! Whether bytes are those that were written.

/// The CRC-32 of `bytes`. Without a table: it would take more flash than the rest of the file's code.
pub(crate) fn checksum(bytes: &[u8]) -> u32 {
    crc::Crc::<u32, crc::NoTable>::new(&crc::CRC_32_ISO_HDLC).checksum(bytes)
}
