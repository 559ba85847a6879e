//! The usual neighbour pass over cubic voxels, as a measure: 26 probes of a hash set each.

use lattice_core::voxels::VoxelStore;
use rustc_hash::FxHashSet;

/// Bits of one index in a row-major key.
const BITS: u32 = 21;
const MIDDLE: i64 = 1 << (BITS - 1);

/// Occupied cells of a cubic lattice as row-major keys, in which a neighbour is one addition away.
pub(super) struct Cubes {
    sorted: Vec<u64>,
    set: FxHashSet<u64>,
}

impl Cubes {
    pub(super) fn new(store: &dyn VoxelStore) -> Self {
        let mut sorted: Vec<u64> = store
            .sorted_keys()
            .into_iter()
            .map(|key| row_major(key.unpack().map(i64::from)))
            .collect();
        sorted.sort_unstable();
        let set = sorted.iter().copied().collect();
        Self { sorted, set }
    }

    /// Sum over all cells of the occupied ones among their 26 neighbours.
    pub(super) fn occupied_neighbors(&self) -> u64 {
        let zero = row_major([0; 3]);
        let mut deltas = [0u64; 26];
        let steps = (0..27i64).filter(|i| *i != 13);
        for (delta, i) in deltas.iter_mut().zip(steps) {
            let step = [i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1];
            *delta = row_major(step).wrapping_sub(zero);
        }
        let mut count = 0u64;
        for &key in &self.sorted {
            for delta in deltas {
                count += u64::from(self.set.contains(&key.wrapping_add(delta)));
            }
        }
        count
    }

    /// Memory of the set, bytes: a key and a control byte a slot.
    pub(super) fn bytes(&self) -> usize {
        self.set.capacity() * (size_of::<u64>() + 1)
    }
}

fn row_major(w: [i64; 3]) -> u64 {
    let [x, y, z] = w.map(|i| (i + MIDDLE) as u64);
    x | y << BITS | z << (2 * BITS)
}
