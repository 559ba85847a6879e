//! Filter of recently seen cells.

use crate::lattice::BlockKey;

const SLOTS_LOG2: u32 = 12;
const SLOTS: usize = 1 << SLOTS_LOG2;

/// Recently seen cells in a direct-mapped table of the size of the first-level cache.
///
/// Adjacent beams and successive scans see the same cells: nine points in ten end here.
#[derive(Clone, Default)]
pub(super) struct Recent {
    slots: Vec<BlockKey>,
}

impl Recent {
    pub(super) const BYTES: usize = SLOTS * size_of::<BlockKey>();

    pub(super) fn new() -> Recent {
        Recent {
            slots: vec![BlockKey::NONE; SLOTS],
        }
    }

    #[inline(always)]
    fn slot(code: BlockKey) -> usize {
        (code.raw().wrapping_mul(0x9e37_79b9_7f4a_7c15) >> (64 - SLOTS_LOG2)) as usize
    }

    /// Copies the codes that were not seen, in order, to the front of `fresh`; returns their number. They may include
    /// [`BlockKey::NONE`].
    #[inline]
    pub(super) fn sift<const N: usize>(
        &mut self,
        codes: &[BlockKey],
        fresh: &mut [BlockKey; N],
    ) -> usize {
        let mut count = 0;
        let Some(slots) = self.slots.first_chunk_mut::<SLOTS>() else {
            return 0;
        };
        for &code in codes {
            let slot = &mut slots[Self::slot(code)];
            fresh[count % N] = code;
            count += usize::from(*slot != code);
            *slot = code;
        }
        count
    }

    /// Removes a code.
    pub(super) fn forget(&mut self, code: BlockKey) {
        if let Some(slot) = self
            .slots
            .get_mut(Self::slot(code))
            .filter(|slot| **slot == code)
        {
            *slot = BlockKey::NONE;
        }
    }

    /// Removes all codes.
    pub(super) fn forget_all(&mut self) {
        self.slots.fill(BlockKey::NONE);
    }

    /// Validates that all codes are in the store.
    pub(super) fn validate(&self, has: impl Fn(BlockKey) -> bool) -> Result<(), String> {
        let known = |code: &BlockKey| *code == BlockKey::NONE || has(*code);
        match self.slots.iter().find(|code| !known(code)) {
            Some(code) => Err(format!(
                "cell {:?} was seen but is not there",
                code.unpack()
            )),
            None if self.slots.len() == SLOTS => Ok(()),
            None => Err("the filter of recent cells is missing".to_owned()),
        }
    }
}
