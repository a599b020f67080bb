//! The condition in force until the set is reached: one of the methods, or a custom one.

use alloc::borrow::ToOwned;
use alloc::sync::Arc;

use super::condition::{Abilities, Bound, Condition, Sample};
use super::reference_profile::ReferenceProfile;
use super::repeated_root::RepeatedRoot;
use super::settings::{FixedTimeSettings, Method};
use crate::error::{Error, ErrorKind};

/// A condition by its type, so that a step calls it directly.
#[derive(Clone)]
pub(super) enum Approach {
    /// [`Method::ReferenceProfile`].
    Profile(ReferenceProfile),
    /// [`Method::RepeatedRoot`].
    Root(RepeatedRoot),
    /// A custom condition.
    Own(Arc<dyn Condition + Send + Sync>),
}

/// Whether `method` exists for relative degree `n`.
pub(super) fn check(method: Method, n: usize) -> Result<(), Error> {
    let message = match method {
        Method::RepeatedRoot if n == 1 => {
            "the repeated root does not exist for relative degree 1; use the reference profile".to_owned()
        }
        _ => return Ok(()),
    };
    Err(Error::new(ErrorKind::Unsupported, "method", message))
}

impl Approach {
    /// The method of the settings.
    pub(super) fn new(settings: &FixedTimeSettings) -> Self {
        match settings.method {
            Method::ReferenceProfile => Self::Profile(ReferenceProfile::new(settings)),
            Method::RepeatedRoot => Self::Root(RepeatedRoot),
        }
    }

    /// The condition itself.
    #[cfg_attr(not(feature = "small"), inline(always))]
    pub(super) fn condition(&self) -> &dyn Condition {
        match self {
            Self::Profile(condition) => condition,
            Self::Root(condition) => condition,
            Self::Own(condition) => &**condition,
        }
    }

    /// [`Condition::bound`].
    #[cfg_attr(not(feature = "small"), inline(always))]
    pub(super) fn bound(&self, at: &Sample) -> Bound {
        match self {
            Self::Profile(condition) => condition.bound(at),
            Self::Root(condition) => condition.bound(at),
            Self::Own(condition) => condition.bound(at),
        }
    }

    /// [`Condition::abilities`].
    #[cfg_attr(not(feature = "small"), inline(always))]
    pub(super) fn abilities(&self) -> Abilities {
        match self {
            Self::Profile(condition) => condition.abilities(),
            Self::Root(condition) => condition.abilities(),
            Self::Own(condition) => condition.abilities(),
        }
    }

    /// Whether it is a custom condition.
    pub(super) fn is_own(&self) -> bool {
        matches!(self, Self::Own(_))
    }
}
