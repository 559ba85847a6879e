//! Hash table of rows in insertion order.

use std::hash::{BuildHasher, RandomState};
use std::sync::LazyLock;

use super::growth;

/// Initial number of slots.
const FIRST_SLOTS: usize = 64;
/// Load factor n / d above which the slots are doubled.
const FULL: (usize, usize) = (3, 8);
/// Maximum bytes of slots per row: at least half the load factor, with the old slots beside them while doubling.
const SLOT_BYTES: usize = 3 * size_of::<u64>() * FULL.1 / FULL.0;
/// Empty slot.
const FREE: u64 = 0;
/// Half of a slot that holds the hash; the other is the index plus 1.
const TAG: u64 = 0xffff_ffff_0000_0000;
const MIX: u64 = 0x9e37_79b9_7f4a_7c15;

#[inline(always)]
fn number_in(slot: u64) -> u32 {
    (slot as u32).wrapping_sub(1)
}

/// Row of a table.
pub(crate) trait Row {
    /// Key of the row, which never changes.
    fn code(&self) -> u64;
}

/// Rows looked up by their codes; the index of a row is its insertion order.
///
/// Rows inserted together are adjacent in a vector of their own. A slot holds the index plus 1 and half of the hash,
/// so that a search rarely visits a wrong row. The hash is seeded per process against inputs with collisions.
#[derive(Clone)]
pub(crate) struct Table<R> {
    slots: Vec<u64>,
    rows: Vec<R>,
    shift: u32,
    seed: u64,
}

/// Index of a code's row.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Place {
    /// Existing row.
    Known(u32),
    /// Row just added, with the next index.
    New(u32),
}

impl<R: Row> Table<R> {
    /// Maximum bytes per row, including spare capacity and the table that it replaces.
    pub(crate) const ROW_BYTES: usize = growth::most_bytes::<R>() + SLOT_BYTES;
    /// Maximum bytes besides rows.
    pub(crate) const FIRST_BYTES: usize =
        FIRST_SLOTS * size_of::<u64>() + growth::FIRST * size_of::<R>();

    pub(crate) fn new() -> Table<R> {
        static SEED: LazyLock<u64> = LazyLock::new(|| RandomState::new().hash_one(0) | 1);
        Table {
            slots: vec![FREE; FIRST_SLOTS],
            rows: Vec::new(),
            shift: 64 - FIRST_SLOTS.trailing_zeros(),
            seed: *SEED,
        }
    }

    /// Number of rows.
    pub(crate) fn len(&self) -> usize {
        self.rows.len()
    }

    /// All rows by index.
    pub(crate) fn rows(&self) -> &[R] {
        &self.rows
    }

    /// Row of an index.
    #[inline(always)]
    pub(crate) fn row_mut(&mut self, number: u32) -> Option<&mut R> {
        self.rows.get_mut(number as usize)
    }

    pub(crate) fn bytes(&self) -> usize {
        size_of::<u64>() * self.slots.capacity() + size_of::<R>() * self.rows.capacity()
    }

    /// First slot of the search for a code, and the tag of its slot.
    #[inline(always)]
    fn home(&self, code: u64) -> (usize, u64) {
        let product = code.wrapping_mul(self.seed);
        let hash = (product ^ (product >> 32)).wrapping_mul(MIX);
        ((hash >> self.shift) as usize, hash << 32)
    }

    /// Row at the start of a search.
    #[inline(always)]
    pub(crate) fn likely(&self, code: u64) -> Option<&R> {
        let (at, _) = self.home(code);
        self.rows.get(number_in(self.slot(at)) as usize)
    }

    #[inline(always)]
    fn slot(&self, at: usize) -> u64 {
        self.slots.get(at).copied().unwrap_or(FREE)
    }

    #[inline(always)]
    fn code(&self, number: u32) -> u64 {
        self.rows.get(number as usize).map_or(u64::MAX, R::code)
    }

    fn put(&mut self, at: usize, slot: u64) {
        if let Some(to) = self.slots.get_mut(at) {
            *to = slot;
        }
    }

    /// First slot from the home of a code that is free or matches `wanted`.
    #[inline(always)]
    fn search(&self, code: u64, wanted: impl Fn(u64, u64) -> bool) -> (usize, u64) {
        let (mut at, tag) = self.home(code);
        let mask = self.slots.len().wrapping_sub(1);
        loop {
            let slot = self.slot(at & mask);
            if slot == FREE || wanted(slot, tag) {
                return (at & mask, slot);
            }
            at = at.wrapping_add(1);
        }
    }

    /// Slot of a code, or the free one where it belongs.
    #[inline(always)]
    fn slot_of(&self, code: u64) -> (usize, u64) {
        self.search(code, |slot, tag| {
            slot & TAG == tag && self.code(number_in(slot)) == code
        })
    }

    /// Index of a code.
    #[inline(always)]
    pub(crate) fn find(&self, code: u64) -> Option<u32> {
        let (_, slot) = self.slot_of(code);
        (slot != FREE).then(|| number_in(slot))
    }

    /// Index of a code; a row is added if it is new and there are fewer than `limit`.
    #[inline(always)]
    pub(crate) fn find_or_add(
        &mut self,
        code: u64,
        limit: usize,
        row: impl FnOnce() -> R,
    ) -> Option<Place> {
        let (at, slot) = self.slot_of(code);
        if slot == FREE {
            self.add(at, limit, row()).map(Place::New)
        } else {
            Some(Place::Known(number_in(slot)))
        }
    }

    #[inline(never)]
    fn add(&mut self, at: usize, limit: usize, row: R) -> Option<u32> {
        let number = self.rows.len();
        if number >= limit.min(u32::MAX as usize - 1) {
            return None;
        }
        self.put(at, self.home(row.code()).1 | (number as u64 + 1));
        growth::push(&mut self.rows, row);
        if self.rows.len() * FULL.1 > self.slots.len() * FULL.0 {
            self.rebuild(self.slots.len() * 2);
        }
        Some(number as u32)
    }

    /// Rebuilds the slots from the rows.
    fn rebuild(&mut self, slots: usize) {
        self.slots = vec![FREE; slots];
        self.shift = 64 - slots.trailing_zeros();
        for number in 0..self.rows.len() {
            let code = self.code(number as u32);
            let (at, _) = self.search(code, |_, _| false);
            self.put(at, self.home(code).1 | (number as u64 + 1));
        }
    }

    /// Removes a row, and returns its index, now that of the last row.
    pub(crate) fn remove(&mut self, code: u64) -> Option<(u32, R)> {
        let (at, slot) = self.slot_of(code);
        if slot == FREE {
            return None;
        }
        let number = number_in(slot);
        let last = self.rows.len() as u32 - 1;
        if number != last {
            let (moved, tagged) = self.slot_of(self.code(last));
            self.put(moved, (tagged & TAG) | (u64::from(number) + 1));
        }
        // Before the rows change: the search for later homes accesses them by index.
        self.free(at, number, last);
        Some((number, self.rows.swap_remove(number as usize)))
    }

    /// Empties a slot and moves back later slots of the run, so that no search ends too early.
    ///
    /// The last row is identified by its future index.
    fn free(&mut self, mut hole: usize, renamed: u32, last: u32) {
        let mask = self.slots.len() - 1;
        let mut at = hole;
        loop {
            at = (at + 1) & mask;
            let slot = self.slot(at);
            if slot == FREE {
                break;
            }
            let number = number_in(slot);
            let number = if number == renamed { last } else { number };
            let home = self.home(self.code(number)).0;
            // True if the hole is between its home and it.
            if at.wrapping_sub(home) & mask >= at.wrapping_sub(hole) & mask {
                self.put(hole, slot);
                hole = at;
            }
        }
        self.put(hole, FREE);
    }

    pub(crate) fn clear(&mut self) {
        *self = Table::new();
    }

    /// Validates that every row is found under its index and nothing else is in the slots.
    pub(crate) fn validate(&self) -> Result<(), String> {
        for (number, code) in self.rows.iter().map(R::code).enumerate() {
            if self.find(code) != Some(number as u32) {
                return Err(format!("code {code:#x} is not found under number {number}"));
            }
        }
        let used = self.slots.iter().filter(|slot| **slot != FREE).count();
        if used == self.rows.len() {
            Ok(())
        } else {
            Err(format!("{used} slots for {} rows", self.rows.len()))
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashMap;

    use proptest::prelude::*;

    use super::*;

    #[derive(Clone, PartialEq, Debug)]
    struct Plain(u64);

    impl Row for Plain {
        fn code(&self) -> u64 {
            self.0
        }
    }

    fn check(steps: &[(u64, u8)], scale: u32) -> Result<(), TestCaseError> {
        let mut table: Table<Plain> = Table::new();
        let mut model: HashMap<u64, u32> = HashMap::new();
        for &(code, step) in steps {
            let code = code << scale;
            let len = model.len() as u32;
            if step == 0 {
                let removed = table.remove(code);
                let number = model.remove(&code);
                prop_assert_eq!(&removed, &number.map(|number| (number, Plain(code))));
                if let Some(number) = number {
                    model
                        .values_mut()
                        .filter(|n| **n == len - 1)
                        .for_each(|n| *n = number);
                }
            } else {
                let known = model.get(&code).copied();
                let expected = known.map_or(Place::New(len), Place::Known);
                let expected = (known.is_some() || len < 60).then_some(expected);
                prop_assert_eq!(table.find_or_add(code, 60, || Plain(code)), expected);
                if expected == Some(Place::New(len)) {
                    model.insert(code, len);
                }
            }
            prop_assert_eq!(table.find(code), model.get(&code).copied());
        }
        prop_assert_eq!(table.len(), model.len());
        prop_assert_eq!(table.validate(), Ok(()));
        Ok(())
    }

    proptest! {
        #[test]
        fn it_is_a_map_to_dense_numbers(steps in prop::collection::vec((0_u64..90, 0..4_u8), 0..400), scale in 0..50_u32) {
            check(&steps, scale)?;
        }
    }
}
