//! Sums of voxels with more points than fit a row.

use super::fixed_point::Offsets;
use super::growth;

/// Invalid index.
const NONE: u32 = u32::MAX;

/// Sums with reusable indices.
#[derive(Clone)]
pub(crate) struct WideSums {
    rows: Vec<Offsets>,
    /// Last released index; its row holds the previous one.
    free: u32,
}

impl WideSums {
    /// Maximum bytes per row.
    pub(crate) const ROW_BYTES: usize = growth::most_bytes::<Offsets>();
    /// Maximum bytes besides rows.
    pub(crate) const FIRST_BYTES: usize = growth::FIRST * size_of::<Offsets>();

    pub(crate) fn new() -> WideSums {
        WideSums {
            rows: Vec::new(),
            free: NONE,
        }
    }

    pub(crate) fn bytes(&self) -> usize {
        self.rows.capacity() * size_of::<Offsets>()
    }

    /// Stores sums and returns their index, below 2^32 - 1.
    pub(crate) fn put(&mut self, sums: Offsets) -> u32 {
        let number = self.free;
        if let Some(row) = self.rows.get_mut(number as usize) {
            self.free = row[0] as u32;
            *row = sums;
            number
        } else {
            growth::push(&mut self.rows, sums);
            (self.rows.len() - 1) as u32
        }
    }

    /// Sums of an index; zero for invalid ones.
    pub(crate) fn get(&self, number: u32) -> Offsets {
        self.rows.get(number as usize).copied().unwrap_or_default()
    }

    /// Adds to the sums of an index and returns the number of points; sums wrap.
    pub(crate) fn add(&mut self, number: u32, more: &Offsets) -> i64 {
        let Some(sums) = self.rows.get_mut(number as usize) else {
            return 0;
        };
        for (sum, term) in sums.iter_mut().zip(more) {
            *sum = sum.wrapping_add(*term);
        }
        sums[3]
    }

    /// Releases an index.
    pub(crate) fn free(&mut self, number: u32) {
        if let Some(row) = self.rows.get_mut(number as usize) {
            *row = [i64::from(self.free), 0, 0, 0];
            self.free = number;
        }
    }

    pub(crate) fn clear(&mut self) {
        *self = WideSums::new();
    }

    /// Number of used indices.
    pub(crate) fn used(&self) -> usize {
        let mut free = 0;
        let mut next = self.free;
        while let Some(row) = self.rows.get(next as usize) {
            free += 1;
            next = row[0] as u32;
        }
        self.rows.len() - free
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashMap;

    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn numbers_are_used_again(steps in prop::collection::vec((0..3_u8, any::<prop::sample::Index>()), 0..300)) {
            let mut sums = WideSums::new();
            let mut model: HashMap<u32, Offsets> = HashMap::new();
            let mut most = 0;
            for (i, (step, pick)) in steps.into_iter().enumerate() {
                let mut known: Vec<u32> = model.keys().copied().collect();
                known.sort_unstable();
                let value = [i as i64, -1, 2, 3];
                match step {
                    0 if !known.is_empty() => {
                        let number = *pick.get(&known);
                        sums.free(number);
                        model.remove(&number);
                    }
                    1 if !known.is_empty() => {
                        let number = *pick.get(&known);
                        let expected = model[&number].map(|x| 2 * x);
                        prop_assert_eq!(sums.add(number, &model[&number]), expected[3]);
                        model.insert(number, expected);
                    }
                    _ => {
                        prop_assert_eq!(model.insert(sums.put(value), value), None);
                    }
                }
                most = most.max(model.len());
                prop_assert_eq!(sums.used(), model.len());
                prop_assert!(model.iter().all(|(number, expected)| sums.get(*number) == *expected));
            }
            prop_assert!(sums.rows.len() <= most);
        }
    }
}
