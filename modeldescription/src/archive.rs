//! The `.fmu` or `.ssp` file: a zip archive whose bytes depend only on its entries and one given instant.
//!
//! Reproducible means: sorted entries, one fixed time for all of them, fixed permissions and a fixed
//! compression level, on every operating system. Another version of the compression library may produce other
//! bytes.

use crate::Error;
use crate::calendar::days_in_month;
use std::collections::BTreeMap;
use std::io::{Cursor, Write};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, System, ZipWriter};

/// The entry that comes first, where readers want to find it.
const MODEL_DESCRIPTION: &str = "modelDescription.xml";

/// Deflate level: 6 is the usual balance of size and time. It is fixed, since it determines the bytes.
const LEVEL: i64 = 6;

/// The instant that every entry of an archive is stamped with.
///
/// The default is 1980-01-01 00:00:00, the earliest that a zip archive can hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timestamp {
    /// Seconds since 1970-01-01 00:00:00 UTC, within `FIRST..=LAST`.
    seconds: u64,
}

impl Timestamp {
    /// 1980-01-01 00:00:00 UTC.
    const FIRST: u64 = 315_532_800;
    /// 2107-12-31 23:59:59 UTC, the end of the range of a zip archive.
    const LAST: u64 = 4_354_819_199;

    /// Reads the value of `SOURCE_DATE_EPOCH`: seconds since 1970-01-01 00:00:00 UTC in decimal digits,
    /// 315532800 (1980-01-01) to 4354819199 (2107-12-31 23:59:59).
    ///
    /// The archive stores two-second steps and rounds down. This crate never reads the environment; the
    /// caller passes the text in.
    ///
    /// # Errors
    ///
    /// The text contains other characters than digits, or the number is out of range.
    pub fn from_source_date_epoch(text: &str) -> Result<Self, Error> {
        // `parse` alone would accept a leading plus.
        let digits = text.bytes().all(|b| b.is_ascii_digit());
        match text.parse() {
            Ok(seconds) if digits && (Self::FIRST..=Self::LAST).contains(&seconds) => Ok(Self { seconds }),
            _ => {
                let allowed = format!("seconds since 1970 in digits, {} to {}", Self::FIRST, Self::LAST);
                Err(Error::invalid("SOURCE_DATE_EPOCH", format!("{text:?}"), allowed))
            }
        }
    }

    /// Year, month, day, hour, minute, second in UTC.
    fn civil(self) -> (u64, u64, u64, u64, u64, u64) {
        let (mut days, second) = (self.seconds / 86_400, self.seconds % 86_400);
        let (mut year, mut month) = (1970, 1);
        while days >= days_in_month(year, month) {
            days -= days_in_month(year, month);
            (year, month) = if month == 12 { (year + 1, 1) } else { (year, month + 1) };
        }
        (year, month, days + 1, second / 3600, second / 60 % 60, second % 60)
    }

    fn to_zip(self) -> DateTime {
        let (year, month, day, hour, minute, second) = self.civil();
        // Every field fits its bits, since the range was checked: 7 bits of years, 5 of two-second steps.
        let date = ((year - 1980) << 9) | (month << 5) | day;
        let time = (hour << 11) | (minute << 5) | (second / 2);
        let words = u16::try_from(date).ok().zip(u16::try_from(time).ok());
        words.and_then(|(date, time)| DateTime::try_from_msdos(date, time).ok()).unwrap_or_default()
    }
}

impl Default for Timestamp {
    fn default() -> Self {
        Self { seconds: Self::FIRST }
    }
}

/// The files of an FMU, collected in memory.
///
/// ```
/// use punctual_modeldescription::Archive;
///
/// let mut archive = Archive::new();
/// archive.add("resources/model.toml", "kind = \"plant\"\n")?;
/// archive.add("modelDescription.xml", "<fmiModelDescription/>\n")?;
/// assert_eq!(archive.entries().next().unwrap().0, "modelDescription.xml");
/// assert_eq!(archive.to_bytes()?, archive.to_bytes()?);
///
/// let error = archive.add("../model.toml", "").unwrap_err();
/// assert!(error.to_string().starts_with(r#"archive path is "../model.toml"; allowed: "#));
/// # Ok::<(), punctual_modeldescription::Error>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct Archive {
    entries: BTreeMap<String, Vec<u8>>,
    timestamp: Timestamp,
}

impl Archive {
    /// An archive without entries, stamped with the default [`Timestamp`].
    pub fn new() -> Self {
        Self::default()
    }

    /// The same entries, stamped with another instant.
    pub fn with_timestamp(self, timestamp: Timestamp) -> Self {
        Self { timestamp, ..self }
    }

    /// Adds a file. `path` is relative to the root of the archive, with forward slashes.
    ///
    /// # Errors
    ///
    /// The archive is unchanged on an error.
    ///
    /// - `path` is empty, absolute, ends with a slash, has an empty, `.` or `..` component, a
    ///   backslash, a colon or a control character, or more than 65535 bytes.
    /// - There is already an entry with this path.
    /// - `path` uses an entry as a folder, or is the folder of an entry.
    pub fn add(&mut self, path: &str, bytes: impl Into<Vec<u8>>) -> Result<(), Error> {
        let refuse = |allowed: &str| Err(Error::invalid("archive path", format!("{path:?}"), allowed));
        if path.len() > usize::from(u16::MAX) {
            return refuse("at most 65535 bytes");
        }
        if path.contains(['\\', ':']) || path.contains(char::is_control) {
            return refuse("no backslash, colon or control character");
        }
        if path.split('/').any(|component| matches!(component, "" | "." | "..")) {
            return refuse("relative to the root, components non-empty and neither . nor ..");
        }
        if self.entries.contains_key(path) {
            return refuse("not the path of another entry");
        }
        let mut folders = path.match_indices('/').filter_map(|(end, _)| path.get(..end));
        if folders.any(|folder| self.entries.contains_key(folder)) {
            return refuse("not inside another entry");
        }
        let folder = format!("{path}/");
        let next = self.entries.range(folder.clone()..).next();
        if next.is_some_and(|(other, _)| other.starts_with(&folder)) {
            return refuse("not the folder of another entry");
        }
        self.entries.insert(path.to_owned(), bytes.into());
        Ok(())
    }

    /// Paths and contents in the order of the archive: `modelDescription.xml`, then by path in byte order.
    pub fn entries(&self) -> impl Iterator<Item = (&str, &[u8])> {
        let first = self.entries.get_key_value(MODEL_DESCRIPTION).into_iter();
        let others = self.entries.iter().filter(|(path, _)| *path != MODEL_DESCRIPTION);
        first.chain(others).map(|(path, bytes)| (path.as_str(), bytes.as_slice()))
    }

    /// Writes the zip archive that [`to_bytes`](Self::to_bytes) makes.
    ///
    /// # Errors
    ///
    /// - The archive is larger than its format allows. Then nothing is written.
    /// - The destination cannot be written. The bytes written so far are not a valid archive.
    pub fn write_to<W: Write>(&self, mut destination: W) -> Result<(), Error> {
        // The bytes are complete before they are written, since the zip crate prints to standard error if a
        // destination fails.
        let bytes = self.to_bytes()?;
        let written = destination.write_all(&bytes).and_then(|()| destination.flush());
        written.map_err(|error| Error::io("write the archive", error))
    }

    /// The zip archive in memory.
    ///
    /// Entries are deflated. Files below `binaries/` get the permissions 0755, all others 0644.
    ///
    /// # Errors
    ///
    /// The archive is larger than its format allows.
    pub fn to_bytes(&self) -> Result<Vec<u8>, Error> {
        let options = SimpleFileOptions::default()
            .compression_method(CompressionMethod::Deflated)
            .compression_level(Some(LEVEL))
            .last_modified_time(self.timestamp.to_zip())
            .system(System::Unix);
        let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
        for (path, bytes) in self.entries() {
            let permissions = if path.starts_with("binaries/") { 0o755 } else { 0o644 };
            let large = u32::try_from(bytes.len()).is_err();
            let doing = || format!("compress {path:?}");
            zip.start_file(path, options.unix_permissions(permissions).large_file(large))
                .map_err(|error| Error::io(doing(), error))?;
            zip.write_all(bytes).map_err(|error| Error::io(doing(), error))?;
        }
        let cursor = zip.finish().map_err(|error| Error::io("finish the archive", error))?;
        Ok(cursor.into_inner())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn civil_dates_are_those_of_the_calendar() {
        let civil = |text| Timestamp::from_source_date_epoch(text).map(Timestamp::civil).ok();
        assert_eq!(civil("315532800"), Some((1980, 1, 1, 0, 0, 0)));
        assert_eq!(civil("951782400"), Some((2000, 2, 29, 0, 0, 0)));
        assert_eq!(civil("1767225599"), Some((2025, 12, 31, 23, 59, 59)));
        assert_eq!(civil("4107542400"), Some((2100, 3, 1, 0, 0, 0)));
        assert_eq!(civil("4354819199"), Some((2107, 12, 31, 23, 59, 59)));
    }

    #[test]
    fn every_valid_instant_is_a_zip_instant() {
        for seconds in (Timestamp::FIRST..=Timestamp::LAST).step_by(86_399 * 7) {
            let stamp = Timestamp { seconds };
            let (year, month, day, hour, minute, second) = stamp.civil();
            let zip = stamp.to_zip();
            let got = [u64::from(zip.year()), zip.month().into(), zip.day().into(), zip.hour().into()];
            assert_eq!(got, [year, month, day, hour], "{seconds}");
            assert_eq!((zip.minute().into(), u64::from(zip.second())), (minute, second / 2 * 2), "{seconds}");
        }
    }

    #[test]
    fn source_date_epoch_must_be_digits_in_range() {
        for text in
            ["", "0", "315532799", "4354819200", "+315532800", "-1", " 315532800", "1e9", "315532800.0"]
        {
            let error = Timestamp::from_source_date_epoch(text).expect_err(text).to_string();
            let allowed = "allowed: seconds since 1970 in digits, 315532800 to 4354819199";
            assert_eq!(error, format!("SOURCE_DATE_EPOCH is {text:?}; {allowed}"));
        }
    }
}
