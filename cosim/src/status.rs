//! The status of a call or a message, in the terms of its version of FMI; and messages.

use std::fmt;

use punctual_fmu::{fmi2, fmi3};

/// A status of FMI 2.0 or 3.0. A library may return any number, so this can hold any.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// `fmi2Status`.
    Fmi2(fmi2::Status),
    /// `fmi3Status`.
    Fmi3(fmi3::Status),
}

impl Status {
    /// Whether the call did everything that was asked.
    #[inline]
    pub fn is_ok(self) -> bool {
        matches!(self, Self::Fmi2(fmi2::Status::OK) | Self::Fmi3(fmi3::Status::OK))
    }

    /// Whether the call succeeded with a remark in the log.
    pub fn is_warning(self) -> bool {
        matches!(self, Self::Fmi2(fmi2::Status::WARNING) | Self::Fmi3(fmi3::Status::WARNING))
    }

    /// Whether the call was refused and the instance is unchanged.
    pub fn is_discard(self) -> bool {
        matches!(self, Self::Fmi2(fmi2::Status::DISCARD) | Self::Fmi3(fmi3::Status::DISCARD))
    }

    /// Whether the call continues in the background, which only FMI 2.0 has.
    pub fn is_pending(self) -> bool {
        self == Self::Fmi2(fmi2::Status::PENDING)
    }

    /// Whether the standard defines this number.
    pub fn is_known(self) -> bool {
        match self {
            Self::Fmi2(status) => status.is_known(),
            Self::Fmi3(status) => status.is_known(),
        }
    }

    /// Whether the standard forbids freeing the instance after this status, or does not define it.
    pub fn is_last(self) -> bool {
        match self {
            _ if !self.is_known() => true,
            Self::Fmi2(status) => status == fmi2::Status::FATAL || self.is_pending(),
            Self::Fmi3(status) => status == fmi3::Status::FATAL,
        }
    }
}

impl fmt::Display for Status {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Fmi2(status) => status.fmt(f),
            Self::Fmi3(status) => status.fmt(f),
        }
    }
}

impl From<fmi2::Status> for Status {
    fn from(status: fmi2::Status) -> Self {
        Self::Fmi2(status)
    }
}

impl From<fmi3::Status> for Status {
    fn from(status: fmi3::Status) -> Self {
        Self::Fmi3(status)
    }
}

/// A log message of an FMU.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LogMessage {
    /// The status the FMU gave with it.
    pub status: Status,
    /// The log category; empty if the FMU gave none.
    pub category: String,
    /// The formatted text, at most 2047 bytes of it.
    pub text: String,
}

impl fmt::Display for LogMessage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "[{}", self.status)?;
        if !self.category.is_empty() {
            write!(f, ", {}", self.category)?;
        }
        write!(f, "] {}", self.text)
    }
}
