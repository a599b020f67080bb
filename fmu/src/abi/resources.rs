//! Reads the configuration from `fmuResourceLocation` or `resourcePath`.

use std::path::PathBuf;

use percent_encoding::percent_decode_str;
use punctual_modeldescription::PLATFORM;

use super::plugin::PluginFolder;
use crate::configuration::{Configuration, RESOURCE};

/// Reads the configuration below `location`, a `file:` URI (one to four slashes, with or without a
/// trailing one, percent-encoded or raw) or a plain path.
pub(super) fn configuration(location: &str) -> Result<Configuration, String> {
    let folder = folder(location)?;
    let path = folder.join(RESOURCE);
    let text = std::fs::read_to_string(&path)
        .map_err(|e| format!("cannot read {} (resources at {location:?}): {e}", path.display()))?;
    let plugins = PluginFolder::new(folder.join(PLATFORM));
    Configuration::parse_with(&text, &plugins).map_err(|e| format!("{}: {e}", path.display()))
}

fn folder(location: &str) -> Result<PathBuf, String> {
    let decode = |text: &str| {
        percent_decode_str(text)
            .decode_utf8()
            .map(|text| text.into_owned())
            .map_err(|_| format!("the resource location {location:?} is not UTF-8 after percent-decoding"))
    };
    let Some(rest) = location.strip_prefix("file:") else {
        if location.contains("://") {
            return Err(format!("the resource location is {location:?}, must be a file URI"));
        }
        return Ok(PathBuf::from(location));
    };
    // A raw path may contain blanks or a percent sign, so it is used unchanged if the decoded path does not
    // exist.
    let (raw, decoded) = (path(rest, cfg!(windows)), path(&decode(rest)?, cfg!(windows)));
    Ok(if !decoded.exists() && raw.exists() { raw } else { decoded })
}

/// The path after `file:`. On Windows, `shares` follow two or four slashes.
fn path(rest: &str, shares: bool) -> PathBuf {
    // file:/p, file:///p and file:////p mean the same, and so does file://localhost/p.
    let rest = rest.strip_prefix("//localhost/").unwrap_or(rest);
    let path = rest.trim_start_matches('/');
    // A drive letter needs no leading slash.
    let drive = path.as_bytes().get(1) == Some(&b':');
    let share = shares && matches!(rest.len() - path.len(), 2 | 4);
    PathBuf::from(if drive { path.to_owned() } else { format!("{}{path}", if share { "//" } else { "/" }) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_spelling_of_a_folder() {
        for (location, wanted) in [
            ("file:///tmp/a/resources", "/tmp/a/resources"),
            ("file:///tmp/a/resources/", "/tmp/a/resources/"),
            ("file:/tmp/a", "/tmp/a"),
            ("file://localhost/tmp/a", "/tmp/a"),
            ("file:///tmp/a%20b/%C3%BC", "/tmp/a b/\u{fc}"),
            ("file:///tmp/a b/\u{fc}", "/tmp/a b/\u{fc}"),
            ("file:///C:/a/resources", "C:/a/resources"),
            ("file:///C%3A/a/resources", "C:/a/resources"),
            ("file://localhost/C:/a", "C:/a"),
            ("/tmp/plain", "/tmp/plain"),
        ] {
            assert_eq!(folder(location), Ok(PathBuf::from(wanted)), "{location}");
        }
        for (rest, wanted) in [("////tmp/a", "/tmp/a"), ("//host/share", "/host/share")] {
            assert_eq!(path(rest, false), PathBuf::from(wanted), "{rest}");
        }
        for rest in ["//host/share/a", "////host/share/a"] {
            assert_eq!(path(rest, true), PathBuf::from("//host/share/a"), "{rest}");
        }
    }

    #[test]
    fn other_schemes_and_bad_text_are_refused() {
        assert!(folder("http://host/resources").unwrap_err().contains("must be a file URI"));
        assert!(folder("file:///%ff").unwrap_err().contains("not UTF-8"));
        assert!(configuration("file:///nonexistent").unwrap_err().contains("cannot read /nonexistent"));
    }
}
