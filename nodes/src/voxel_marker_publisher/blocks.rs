//! Voxel blocks, and the marker ids of each block.

use std::collections::{BTreeMap, BTreeSet};

use lattice_core::lattice::{LatticeIndex, MortonKey};

/// Cube of lattice indices: the leading bits of its voxels' keys.
pub type BlockId = u64;

/// Marker ids of a block after a change of its markers.
pub struct Ids {
    pub current: Vec<i32>,
    pub stale: Vec<i32>,
}

/// Bits of a key within a group.
const GROUP_BITS: u32 = 9;

/// Leading bits of the keys of 512 voxels.
type GroupId = u64;

/// Occupied voxels of a group, a bit each.
type Group = [u64; 8];

/// Occupied voxels by block.
pub struct Blocks {
    shift: u32,
    /// Groups with voxels.
    groups: BTreeMap<GroupId, Group>,
    /// Marker ids of all blocks with voxels or markers.
    ids: BTreeMap<BlockId, Vec<i32>>,
    next_id: i32,
    free_ids: Vec<i32>,
}

impl Blocks {
    /// Creates blocks of `2^bits` indices a side.
    pub fn new(bits: u32) -> Self {
        Self {
            shift: 3 * bits.min(20),
            groups: BTreeMap::new(),
            ids: BTreeMap::new(),
            next_id: 0,
            free_ids: Vec::new(),
        }
    }

    /// Block of a voxel.
    pub fn id_of(&self, key: MortonKey) -> BlockId {
        key.raw() >> self.shift
    }

    /// All blocks with voxels or markers.
    pub fn ids(&self) -> impl Iterator<Item = BlockId> + '_ {
        self.ids.keys().copied()
    }

    /// Voxels of a block, in order.
    pub fn keys(&self, block: BlockId) -> impl Iterator<Item = MortonKey> + '_ {
        let first = block << self.shift;
        let last = first | ((1 << self.shift) - 1);
        let groups = (self.groups).range(first >> GROUP_BITS..=last >> GROUP_BITS);
        let keys = groups.flat_map(|(group, words)| {
            (0..).zip(words).flat_map(move |(word, bits)| {
                let begin = group << GROUP_BITS | word << 6;
                bits_of(*bits).map(move |bit| begin | u64::from(bit))
            })
        });
        // A block may be less than a group.
        let keys = keys.filter(move |raw| (first..=last).contains(raw));
        keys.filter_map(MortonKey::from_raw)
    }

    /// True if a voxel is occupied.
    pub fn contains(&self, key: MortonKey) -> bool {
        let group = self.groups.get(&(key.raw() >> GROUP_BITS));
        let (word, bit) = place(key);
        group.is_some_and(|group| group.get(word).is_some_and(|bits| bits & bit != 0))
    }

    /// Sets the state of a voxel; on a change, the blocks with changed faces are
    /// added to `dirty`.
    pub fn set(
        &mut self,
        key: MortonKey,
        occupied: bool,
        neighbors: &[LatticeIndex],
        dirty: &mut BTreeSet<BlockId>,
    ) {
        if !self.put(key, occupied) {
            return;
        }
        let id = self.id_of(key);
        dirty.insert(id);
        for neighbor in neighbors {
            if let Some(near) = offset(key, neighbor) {
                let other = self.id_of(near);
                if other != id && self.contains(near) {
                    dirty.insert(other);
                }
            }
        }
    }

    /// Sets the state of a voxel; true on a change.
    fn put(&mut self, key: MortonKey, occupied: bool) -> bool {
        let id = key.raw() >> GROUP_BITS;
        let (word, bit) = place(key);
        let group = self.groups.entry(id).or_default();
        let Some(bits) = group.get_mut(word) else {
            return false;
        };
        let changed = (*bits & bit != 0) != occupied;
        if changed {
            *bits ^= bit;
        }
        if *group == Group::default() {
            self.groups.remove(&id);
        }
        if changed && occupied {
            self.ids.entry(key.raw() >> self.shift).or_default();
        }
        changed
    }

    /// Assigns as many ids as markers to a block, reusing its earlier ones.
    pub fn assign_ids(&mut self, id: BlockId, markers: usize) -> Ids {
        let is_empty = self.keys(id).next().is_none();
        let Some(ids) = self.ids.get_mut(&id) else {
            return Ids {
                current: Vec::new(),
                stale: Vec::new(),
            };
        };
        let stale = ids.split_off(markers.min(ids.len()));
        while ids.len() < markers {
            let id = self.free_ids.pop().unwrap_or_else(|| {
                self.next_id += 1;
                self.next_id
            });
            ids.push(id);
        }
        let current = ids.clone();
        if is_empty {
            self.ids.remove(&id);
        }
        self.free_ids.extend(&stale);
        Ids { current, stale }
    }
}

/// Word and bit of a voxel in its group.
fn place(key: MortonKey) -> (usize, u64) {
    let place = key.raw() & ((1 << GROUP_BITS) - 1);
    ((place >> 6) as usize, 1 << (place & 63))
}

/// Set bits of a word, lowest first.
fn bits_of(mut word: u64) -> impl Iterator<Item = u32> {
    std::iter::from_fn(move || {
        let bit = (word != 0).then(|| word.trailing_zeros())?;
        word &= word - 1;
        Some(bit)
    })
}

/// Key at an index offset; `None` beyond the range of keys.
pub fn offset(key: MortonKey, difference: &LatticeIndex) -> Option<MortonKey> {
    let w = key.unpack();
    MortonKey::pack([
        w[0] + difference[0],
        w[1] + difference[1],
        w[2] + difference[2],
    ])
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// Blocks hold what sets of keys hold, in their order, and keep the ids of what is drawn.
        #[test]
        fn blocks_are_sets_of_keys(
            bits in 0_u32..6,
            changes in prop::collection::vec((prop::array::uniform3(-9_i32..9), any::<bool>()), 1..300),
        ) {
            let mut blocks = Blocks::new(bits);
            let (mut keys, mut dirty) = (BTreeSet::new(), BTreeSet::new());
            for (index, occupied) in changes {
                let key = MortonKey::pack(index).unwrap();
                let changed = match occupied {
                    true => keys.insert(key),
                    false => keys.remove(&key),
                };
                dirty.clear();
                blocks.set(key, occupied, &[], &mut dirty);
                prop_assert_eq!(dirty.contains(&blocks.id_of(key)), changed);
                prop_assert_eq!(blocks.contains(key), occupied);
            }
            let ids: Vec<BlockId> = blocks.ids().collect();
            let found: Vec<MortonKey> = ids.iter().flat_map(|id| blocks.keys(*id)).collect();
            prop_assert_eq!(found, keys.iter().copied().collect::<Vec<_>>());
            for id in ids {
                let count = blocks.keys(id).count();
                prop_assert_eq!(blocks.assign_ids(id, count).current.len(), count);
            }
            let left: BTreeSet<BlockId> = keys.iter().map(|key| blocks.id_of(*key)).collect();
            prop_assert_eq!(blocks.ids().collect::<BTreeSet<_>>(), left);
        }
    }
}
