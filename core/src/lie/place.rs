//! Where a source finds its own states among the components of a filter's x.

/// The first `split` own states are the first components of x, the others those from `first` on: measured quantities of this
/// barrier, which follow the states of the plant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Place {
    split: usize,
    first: usize,
}

impl Place {
    /// The first components.
    pub(super) const START: Self = Self { split: usize::MAX, first: 0 };

    pub(super) fn new(split: usize, first: usize) -> Self {
        if split == first { Self::START } else { Self { split, first } }
    }

    /// The component of own state `i`.
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn component(self, i: usize) -> usize {
        if i < self.split { i } else { self.first + (i - self.split) }
    }

    /// The number of components that hold `states` own states, and all before them.
    pub(super) fn components(self, states: usize) -> usize {
        (0..states).map(|i| self.component(i) + 1).max().unwrap_or(0)
    }

    /// The own states.
    #[cfg_attr(not(feature = "small"), inline(always))]
    pub(super) fn take<T: Copy, const N: usize>(self, x: &[T]) -> [T; N] {
        match self {
            Self::START => *x.first_chunk().expect("a number for each component"),
            _ => core::array::from_fn(|i| x[self.component(i)]),
        }
    }

    /// The own states if the last four are `point`, and the others those of the plant.
    #[cfg_attr(not(feature = "small"), inline(always))]
    pub(super) fn beside<T: Copy, const N: usize>(x: &[T], point: &[T; 4]) -> [T; N] {
        core::array::from_fn(|i| if i + 4 < N { x[i] } else { point[i + 4 - N] })
    }

    /// The result of `read` on the own states.
    #[cfg_attr(not(feature = "small"), inline(always))]
    pub(super) fn read<T: Copy, R, const N: usize>(self, x: &[T], read: impl Fn(&[T]) -> R) -> R {
        match self {
            Self::START => read(&x[..N]),
            _ => read(&self.take::<T, N>(x)),
        }
    }

    /// Writes the own states.
    #[cfg_attr(not(feature = "small"), inline(always))]
    pub(super) fn put<T: Copy, const N: usize>(self, own: &[T; N], x: &mut [T]) {
        match self {
            Self::START => x[..N].copy_from_slice(own),
            _ => own.iter().enumerate().for_each(|(i, own)| x[self.component(i)] = *own),
        }
    }
}
