//! The kinds of files, known by a key that only they have.

use serde::Deserialize;
use serde::de::IgnoredAny;

use super::{ConfigurationError, read_toml};

/// The kinds of files that commands take.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileKind {
    /// A filter, plant or controller.
    One,
    /// Several, coupled.
    System,
    /// Many runs of a system.
    Campaign,
}

impl FileKind {
    /// The kind of the TOML text, if it is clear.
    pub fn of(text: &str) -> Option<Self> {
        #[derive(Deserialize)]
        struct Keys {
            kind: Option<IgnoredAny>,
            component: Option<IgnoredAny>,
            campaign: Option<IgnoredAny>,
        }
        let keys: Keys = read_toml(text).ok()?;
        match (keys.kind, keys.component, keys.campaign) {
            (Some(_), None, None) => Some(Self::One),
            (None, Some(_), None) => Some(Self::System),
            (None, None, Some(_)) => Some(Self::Campaign),
            _ => None,
        }
    }

    /// The refusal of a text that is of another kind where this one is wanted.
    pub fn instead(self, text: &str) -> Option<ConfigurationError> {
        let found = Self::of(text).filter(|found| *found != self)?;
        let what = match found {
            Self::One => {
                "this is the file of a filter, plant or controller, which `punctual check` and `punctual build` take; `punctual run` takes that of a filter"
            }
            Self::System => {
                "this is a system file, which `punctual run` takes, and `punctual build` with an output that ends in .ssp"
            }
            Self::Campaign => "this is a campaign file, which `punctual campaign` takes",
        };
        let key = match self {
            Self::One => "kind",
            Self::System => "component",
            Self::Campaign => "campaign",
        };
        Some(ConfigurationError::new(key, format!("missing: {what}")))
    }
}
