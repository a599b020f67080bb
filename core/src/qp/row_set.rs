//! A set of rows, one bit each.

use core::ops::{BitAnd, BitOr, BitOrAssign, Sub};

use crate::MAX_ROWS;

#[cfg(not(feature = "small"))]
type Bits = u128;
#[cfg(feature = "small")]
type Bits = u64;

const _: () = assert!(MAX_ROWS == Bits::BITS as usize, "one bit per row");

/// Some of at most [`MAX_ROWS`] rows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RowSet(Bits);

impl RowSet {
    /// No row.
    pub const EMPTY: Self = Self(0);

    /// Every row.
    pub const ALL: Self = Self(Bits::MAX);

    /// Row `i` alone.
    pub const fn of(i: usize) -> Self {
        Self(1 << i)
    }

    /// The first `count` rows.
    pub const fn first(count: usize) -> Self {
        Self(match Bits::MAX.checked_shr((MAX_ROWS - count) as u32) {
            Some(bits) => bits,
            None => 0,
        })
    }

    /// Whether there is none.
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Their number.
    pub const fn len(self) -> u32 {
        self.0.count_ones()
    }

    /// Whether row `i` is one of them.
    #[cfg_attr(not(feature = "small"), inline(always))]
    pub const fn contains(self, i: usize) -> bool {
        i < MAX_ROWS && self.0 >> i & 1 == 1
    }

    /// Adds row `i`.
    #[cfg_attr(not(feature = "small"), inline(always))]
    pub fn insert(&mut self, i: usize) {
        self.0 |= 1 << i;
    }

    /// Takes row `i` out.
    #[cfg_attr(not(feature = "small"), inline(always))]
    pub fn remove(&mut self, i: usize) {
        self.0 &= !(1 << i);
    }

    /// The rows, in the order of their numbers.
    #[cfg_attr(not(feature = "small"), inline(always))]
    pub fn iter(self) -> impl Iterator<Item = usize> {
        let Self(mut bits) = self;
        core::iter::from_fn(move || {
            let i = bits.trailing_zeros() as usize;
            (bits != 0).then(|| {
                bits &= bits - 1;
                i
            })
        })
    }

    /// The rows of `0..count` for which `f` is true.
    #[cfg_attr(not(feature = "small"), inline(always))]
    pub fn with(count: usize, f: impl Fn(usize) -> bool) -> Self {
        (0..count).fold(Self::EMPTY, |Self(bits), i| Self(bits | Bits::from(f(i)) << i))
    }
}

impl BitOr for RowSet {
    type Output = Self;

    #[cfg_attr(not(feature = "small"), inline(always))]
    fn bitor(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}

impl BitOrAssign for RowSet {
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn bitor_assign(&mut self, other: Self) {
        self.0 |= other.0;
    }
}

impl BitAnd for RowSet {
    type Output = Self;

    #[cfg_attr(not(feature = "small"), inline(always))]
    fn bitand(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }
}

/// The rows of the first that are not in the second.
impl Sub for RowSet {
    type Output = Self;

    #[cfg_attr(not(feature = "small"), inline(always))]
    fn sub(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }
}
