//! Voxels of a shard that changed since its changes were last taken.

/// Indices of the changed voxels, so that taking them costs as much as they are, not as much as the map.
///
/// Beyond an eighth of the voxels they are not listed: a walk over all costs no more than eight times as much then.
#[derive(Clone, Default)]
pub(crate) struct Touched {
    /// State at which the changes were last taken.
    since: u32,
    /// Each changed voxel at least once, and indices that others have by now.
    numbers: Vec<u32>,
    is_incomplete: bool,
}

impl Touched {
    /// Maximum bytes per voxel, with the growth of the list.
    pub(crate) const VOXEL_BYTES: usize = 2 * size_of::<u32>() / 8;
    /// Maximum bytes besides voxels.
    pub(crate) const FIRST_BYTES: usize = 2 * size_of::<u32>() * FIRST_NUMBERS;

    pub(crate) fn bytes(&self) -> usize {
        self.numbers.capacity() * size_of::<u32>()
    }

    /// Records a change of a voxel, whose last one was in state `before`, among `voxels` others.
    #[inline(always)]
    pub(crate) fn note(&mut self, number: u32, before: u32, voxels: usize) {
        if before <= self.since {
            self.list(number, voxels);
        }
    }

    /// Records a changed or new voxel, or the new index of one.
    #[inline]
    pub(crate) fn list(&mut self, number: u32, voxels: usize) {
        if self.is_incomplete {
            return;
        }
        if self.numbers.len() < voxels / 8 + FIRST_NUMBERS {
            self.numbers.push(number);
        } else {
            self.is_incomplete = true;
            self.numbers.clear();
        }
    }

    /// True for a voxel last changed in a state that is not taken yet.
    #[inline]
    pub(crate) fn is_new(&self, touched: u32) -> bool {
        touched > self.since
    }

    /// Indices that hold all changed voxels; `None` if these are not listed.
    pub(crate) fn numbers(&self) -> Option<&[u32]> {
        (!self.is_incomplete).then_some(&self.numbers)
    }

    /// Begins anew after the changes up to a state were taken.
    pub(crate) fn take(&mut self, state: u32) {
        self.since = state;
        self.numbers.clear();
        self.is_incomplete = false;
    }

    /// Renames the states: those that are taken are 0, the others 1.
    pub(crate) fn renumber(&mut self) {
        self.since = 0;
    }
}

/// Number of indices that are listed in any case.
const FIRST_NUMBERS: usize = 256;
