//! Filling a list with voxels from a file.

use crate::lattice::{BlockKey, MortonKey};
use crate::voxels::store::fixed_point::{offsets_in, reach};
use crate::voxels::store::payload_columns::{Columns, Details};
use crate::voxels::store::shard::{SHARDS, shard_of};
use crate::voxels::{ColorSum, LabelCount, Voxel, VoxelList, VoxelStore};

impl VoxelList {
    /// Adds new cells, with the optional columns that the list keeps, until it is full. Keys of one block should be
    /// consecutive.
    pub(crate) fn fill(
        &mut self,
        cells: impl Iterator<Item = (MortonKey, Voxel)>,
        columns: &Columns,
    ) {
        let room = self.max_voxels.saturating_sub(self.len());
        let now = self.sequence.max(1);
        self.sequence = now;
        let expected = cells.size_hint().0.min(room) / SHARDS;
        for shard in &mut self.shards {
            // Shards differ by a few blocks.
            shard.voxels.reserve(expected + expected / 16);
        }
        for (row, (key, voxel)) in cells.take(room).enumerate() {
            let code = BlockKey::from(key);
            let Some(shard) = self.shards.get_mut(shard_of(code)) else {
                continue;
            };
            let Some(number) = shard.find_or_add(code, usize::MAX, now) else {
                continue;
            };
            shard.add_offsets(number, &offsets_in(&voxel), now);
            if !self.payload.is_plain() {
                shard.columns.add(number as usize, &columns.get(row));
            }
        }
    }

    /// Replaces a voxel, its labels and its colour; a voxel without points removes it.
    ///
    /// A colour of more points than the voxel has, or with impossible sums, is left out. Returns false, without a change, if the cell is new and the list is full. The statistics stay.
    pub fn put(
        &mut self,
        key: MortonKey,
        voxel: &Voxel,
        labels: &[LabelCount],
        color: ColorSum,
    ) -> bool {
        if voxel.count == 0 {
            self.remove(key);
            return true;
        }
        if !self.contains(key) && self.len() >= self.max_voxels {
            return false;
        }
        self.remove(key);
        let reach = i64::from(voxel.count).saturating_mul(reach(&self.lattice) as i64);
        let voxel = Voxel {
            count: voxel.count,
            sum: voxel.sum.map(|sum| sum.clamp(-reach, reach)),
        };
        let now = self.advance();
        let code = BlockKey::from(key);
        let Some(shard) = self.shards.get_mut(shard_of(code)) else {
            return false;
        };
        let Some(number) = shard.find_or_add(code, usize::MAX, now) else {
            return false;
        };
        shard.add_offsets(number, &offsets_in(&voxel), now);
        if !self.payload.is_plain() {
            let details = Details {
                stamps: None,
                labels: labels.to_vec(),
                color: Some(color)
                    .filter(|color| color.contradiction(voxel.count).is_none())
                    .unwrap_or_default(),
            };
            shard.columns.add(number as usize, &details);
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::lattice::{Lattice, LatticeKind};
    use crate::voxels::{Changes, Payload};

    #[test]
    fn a_voxel_takes_the_place_of_another_and_changes_tell_of_it() {
        let lattice = Lattice::new(LatticeKind::Fcc, 1.0).unwrap();
        let labels = Payload {
            labels: true,
            color: true,
            ..Payload::default()
        };
        let mut list = VoxelList::new(lattice, Vector3::zeros(), 2)
            .unwrap()
            .with_payload(labels);
        let keys = [0, 1, 2].map(|i| MortonKey::pack([i, 0, 0]).unwrap());
        let voxel = |count| Voxel {
            count,
            sum: [i64::from(count), -5, 0],
        };
        let label = |count| [LabelCount { label: 7, count }];
        assert!(list.put(keys[0], &voxel(3), &label(2), ColorSum::default()));
        assert!(list.put(keys[1], &voxel(4_000_000_000), &[], ColorSum::default()));
        assert!(!list.put(keys[2], &voxel(1), &[], ColorSum::default()));
        assert_eq!(list.take_changes().changed, keys[..2]);
        assert!(list.put(keys[0], &voxel(9), &label(1), ColorSum::default()));
        assert_eq!(list.get(keys[0]), Some(voxel(9)));
        assert_eq!(list.labels(keys[0]), label(1));
        assert_eq!(list.get(keys[1]), Some(voxel(4_000_000_000)));
        let red = |count| ColorSum::of_points([255, 0, 0], count);
        assert!(list.put(keys[0], &voxel(9), &label(1), red(9)));
        assert_eq!(list.color(keys[0]), Some(red(9)));
        assert!(list.put(keys[0], &voxel(9), &label(1), red(10)));
        assert_eq!(list.color(keys[0]), Some(ColorSum::default()));
        let changes = |changed: &[_], removed: &[_]| Changes {
            changed: changed.to_vec(),
            removed: removed.to_vec(),
        };
        assert_eq!(list.take_changes(), changes(&keys[..1], &[]));
        assert!(list.put(keys[1], &Voxel::default(), &[], ColorSum::default()));
        assert!(list.put(keys[2], &voxel(1), &[], ColorSum::default()));
        assert_eq!(list.take_changes(), changes(&keys[2..], &keys[1..2]));
        // Sums that no points of the cell have are those of points at its border.
        list.put(
            keys[2],
            &Voxel {
                count: 2,
                sum: [i64::MAX, 0, 0],
            },
            &[],
            ColorSum::default(),
        );
        let reach = 2 * reach(list.lattice()) as i64;
        assert_eq!(list.get(keys[2]).unwrap().sum, [reach, 0, 0]);
    }
}
