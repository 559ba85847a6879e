//! The `k` occupied cells nearest to a point.

use std::collections::BinaryHeap;

use nalgebra::Vector3;

use super::center_tree::PreparedNearest;
use super::search::Search;
use super::{Query, QueryError};
use crate::lattice::MortonKey;
use crate::voxels::VoxelStore;

/// Occupied cell near a point.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Neighbor {
    /// Key of the cell.
    pub key: MortonKey,
    /// Centre of the cell, map frame, metres.
    pub center_m: Vector3<f64>,
    /// Distance of the centre from the point, metres.
    pub distance_m: f64,
}

impl<S: VoxelStore> Query<'_, S> {
    /// Builds a k-d tree of all centres for many nearest-cell queries; `None` if there are more than 2^32 cells.
    ///
    /// It takes the time of some queries per hundred cells. Results do not change.
    pub fn prepare_nearest(&self) -> Option<PreparedNearest> {
        let new = || PreparedNearest::new(self.store.lattice(), self.store.sorted_keys());
        self.prepared.get_or_init(new).clone()
    }

    /// The `k` occupied cells whose centres are nearest to a point, nearest first; fewer if the
    /// store has fewer.
    pub fn nearest(&self, point_m: &Vector3<f64>, k: usize) -> Result<Vec<Neighbor>, QueryError> {
        let local_m = self.local(point_m)?;
        if k == 0 || self.store.is_empty() {
            return Ok(Vec::new());
        }
        let neighbor = |(bits, key)| Neighbor {
            key,
            center_m: self.store.center_m(key),
            distance_m: f64::from_bits(bits),
        };
        if let Some(Some(prepared)) = self.prepared.get() {
            let found = prepared.nearest(&local_m, k).into_iter();
            return Ok(found.map(neighbor).collect());
        }
        let mut search = NearestSearch {
            local_m,
            k,
            max_m: f64::INFINITY,
            found: BinaryHeap::new(),
        };
        self.run(&mut search);
        Ok(search
            .found
            .into_sorted_vec()
            .into_iter()
            .map(neighbor)
            .collect())
    }
}

struct NearestSearch {
    local_m: Vector3<f64>,
    k: usize,
    max_m: f64,
    /// At most `k` cells, the farthest on top: the bits of the distance, which sort as the distance does, and the
    /// key.
    found: BinaryHeap<(u64, MortonKey)>,
}

impl Search for NearestSearch {
    fn ball(&self) -> (Vector3<f64>, f64) {
        (self.local_m, 0.0)
    }

    fn distance_m(&self, point_m: &Vector3<f64>) -> f64 {
        (point_m - self.local_m).norm()
    }

    fn reach_m(&self) -> f64 {
        let worst = self.found.peek().filter(|_| self.found.len() >= self.k);
        worst.map_or(self.max_m, |worst| f64::from_bits(worst.0))
    }

    fn visit(&mut self, key: MortonKey, center_m: &Vector3<f64>) {
        let distance_m = self.distance_m(center_m);
        if distance_m > self.max_m {
            return;
        }
        let candidate = (distance_m.to_bits(), key);
        if self.found.len() < self.k {
            self.found.push(candidate);
        } else if let Some(mut worst) = self.found.peek_mut()
            && candidate < *worst
        {
            *worst = candidate;
        }
    }

    fn restart(&mut self) {
        self.max_m = self.reach_m();
        self.found.clear();
    }
}
