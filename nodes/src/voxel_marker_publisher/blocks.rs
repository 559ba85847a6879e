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

#[derive(Default)]
struct Block {
    keys: BTreeSet<MortonKey>,
    ids: Vec<i32>,
}

/// Occupied voxels by block.
pub struct Blocks {
    shift: u32,
    blocks: BTreeMap<BlockId, Block>,
    next_id: i32,
    free_ids: Vec<i32>,
}

impl Blocks {
    /// Creates blocks of `2^bits` indices a side.
    pub fn new(bits: u32) -> Self {
        Self {
            shift: 3 * bits.min(20),
            blocks: BTreeMap::new(),
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
        self.blocks.keys().copied()
    }

    /// Voxels of a block, in order.
    pub fn keys(&self, block: BlockId) -> impl Iterator<Item = MortonKey> + '_ {
        let block = self.blocks.get(&block);
        block
            .into_iter()
            .flat_map(|block| block.keys.iter().copied())
    }

    /// True if a voxel is occupied.
    pub fn contains(&self, key: MortonKey) -> bool {
        let block = self.blocks.get(&self.id_of(key));
        block.is_some_and(|block| block.keys.contains(&key))
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
        let id = self.id_of(key);
        let block = self.blocks.entry(id).or_default();
        let changed = if occupied {
            block.keys.insert(key)
        } else {
            block.keys.remove(&key)
        };
        if !changed {
            return;
        }
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

    /// Assigns as many ids as markers to a block, reusing its earlier ones.
    pub fn assign_ids(&mut self, id: BlockId, markers: usize) -> Ids {
        let Some(block) = self.blocks.get_mut(&id) else {
            return Ids {
                current: Vec::new(),
                stale: Vec::new(),
            };
        };
        let stale = block.ids.split_off(markers.min(block.ids.len()));
        while block.ids.len() < markers {
            let id = self.free_ids.pop().unwrap_or_else(|| {
                self.next_id += 1;
                self.next_id
            });
            block.ids.push(id);
        }
        let current = block.ids.clone();
        if block.keys.is_empty() {
            self.blocks.remove(&id);
        }
        self.free_ids.extend(&stale);
        Ids { current, stale }
    }
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
