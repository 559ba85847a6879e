//! k-d tree of the centres of occupied cells, for many queries.

use std::collections::BinaryHeap;
use std::sync::Arc;

use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

use crate::kd_tree::{Item, Keep, Tree};
use crate::lattice::{Lattice, MortonKey};

/// Factor above the rounding of a root and its square.
const SLACK: f64 = 1.0 + 4.0 * f64::EPSILON;
/// Result size up to which cells are kept sorted, above it as a heap.
const FEW: usize = 128;

/// k-d tree of one state of a store, shared by the [`Query`](super::Query)s of this state; 32 bytes per cell.
#[derive(Clone)]
pub struct PreparedNearest(Arc<CenterTree>);

/// Centres relative to the datum, and their keys in the order of the tree.
struct CenterTree {
    tree: Tree,
    keys: Vec<MortonKey>,
}

/// Cell as the bits of its distance, which sort as the distance does, and its key.
pub(super) type Found = (u64, MortonKey);

impl PreparedNearest {
    /// Builds the tree; `None` if the cells exceed 32-bit indices.
    pub(super) fn new(lattice: &Lattice, keys: Vec<MortonKey>) -> Option<PreparedNearest> {
        u32::try_from(keys.len()).ok()?;
        let item = |(index, key): (usize, &MortonKey)| Item {
            coords_m: lattice.center(key.unpack()).into(),
            index: index as u32,
        };
        let mut items: Vec<Item> = keys.par_iter().enumerate().map(item).collect();
        let tree = Tree::build(&mut items);
        let key = |item: &Item| keys.get(item.index as usize).copied();
        let keys = items.iter().filter_map(key).collect();
        Some(PreparedNearest(Arc::new(CenterTree { tree, keys })))
    }

    /// The `k` cells nearest to a point (relative to the datum), nearest first.
    pub(super) fn nearest(&self, local_m: &Vector3<f64>, k: usize) -> Vec<Found> {
        let CenterTree { tree, keys } = &*self.0;
        let query = Point3::from(*local_m);
        let k = k.min(keys.len());
        let reach = f64::MAX;
        if k <= FEW {
            let found = Vec::with_capacity(k + 1);
            let mut few = Few {
                keys,
                k,
                found,
                reach,
            };
            tree.search(&query, &mut few);
            return few.found;
        }
        let found = BinaryHeap::with_capacity(k + 1);
        let mut many = Many {
            keys,
            k,
            found,
            reach,
        };
        tree.search(&query, &mut many);
        many.found.into_sorted_vec()
    }
}

/// Square of a distance, rounded up.
#[inline(always)]
fn reach_of((bits, _): Found) -> f64 {
    let distance_m = f64::from_bits(bits);
    (distance_m * distance_m * SLACK).min(f64::MAX)
}

#[inline(always)]
fn found(keys: &[MortonKey], index: u32, squared: f64) -> Option<Found> {
    let key = keys.get(index as usize)?;
    Some((squared.sqrt().to_bits(), *key))
}

/// Nearest cells, sorted.
struct Few<'a> {
    keys: &'a [MortonKey],
    k: usize,
    found: Vec<Found>,
    reach: f64,
}

impl Keep for Few<'_> {
    #[inline(always)]
    fn reach(&self) -> f64 {
        self.reach
    }

    #[inline(always)]
    fn offer(&mut self, index: u32, squared: f64) {
        let Some(candidate) = found(self.keys, index, squared) else {
            return;
        };
        let farther = self
            .found
            .iter()
            .rev()
            .take_while(|known| **known > candidate);
        let place = self.found.len() - farther.count();
        if place >= self.k {
            return;
        }
        self.found.insert(place, candidate);
        self.found.truncate(self.k);
        if let Some(last) = self.found.get(self.k - 1) {
            self.reach = reach_of(*last);
        }
    }
}

/// Nearest cells as a heap, the farthest on top.
struct Many<'a> {
    keys: &'a [MortonKey],
    k: usize,
    found: BinaryHeap<Found>,
    reach: f64,
}

impl Keep for Many<'_> {
    #[inline(always)]
    fn reach(&self) -> f64 {
        self.reach
    }

    #[inline(always)]
    fn offer(&mut self, index: u32, squared: f64) {
        self.found.extend(found(self.keys, index, squared));
        if self.found.len() > self.k {
            self.found.pop();
        }
        if self.found.len() == self.k
            && let Some(last) = self.found.peek()
        {
            self.reach = reach_of(*last);
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;
    use proptest::prelude::*;

    use crate::cloud::Cloud;
    use crate::lattice::{Lattice, LatticeKind};
    use crate::query::Query;
    use crate::voxels::VoxelList;

    proptest! {
        #[test]
        fn answers_are_those_of_the_other_searches(
            kind in 0..LatticeKind::ALL.len(),
            points in prop::collection::vec(prop::array::uniform3(-4.0..4.0_f64), 1..300),
            far in prop_oneof![Just(0.0), Just(1e5)],
            cell in prop::array::uniform3(-6..6_i32),
            off in prop::array::uniform3(prop_oneof![Just(0.0), -0.5..0.5_f64]),
            k in prop_oneof![1..40_usize, 120..300_usize],
        ) {
            let lattice = Lattice::new(LatticeKind::ALL[kind], 0.3).unwrap();
            let datum_m = Vector3::new(far, -far, 0.0);
            let mut list = VoxelList::new(lattice, datum_m, 1000).unwrap();
            let points: Vec<_> = points.into_iter().map(|p| datum_m + Vector3::from(p)).collect();
            list.insert(&Cloud::from_points(0, datum_m, &points));
            // From a lattice point many cells are equally far.
            let asked = list.datum_m() + list.lattice().center(cell) + Vector3::from(off);
            let questions = Query::new(&list);
            let expected = questions.nearest(&asked, k).unwrap();
            let prepared = Query::new(&list);
            prepared.prepare_nearest();
            prop_assert_eq!(prepared.nearest(&asked, k).unwrap(), expected);
        }
    }

    #[test]
    fn an_empty_store_has_no_nearest_cell() {
        let lattice = Lattice::new(LatticeKind::Fcc, 1.0).unwrap();
        let list = VoxelList::new(lattice, Vector3::zeros(), 1).unwrap();
        let questions = Query::new(&list);
        questions.prepare_nearest();
        assert!(questions.nearest(&Vector3::zeros(), 3).unwrap().is_empty());
    }
}
