//! The k occupied cells nearest to a point.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use nalgebra::Vector3;

use super::search::Search;
use super::{Query, QueryError};
use crate::lattice::MortonKey;
use crate::voxels::VoxelStore;

/// An occupied cell near a point.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Neighbor {
    /// The cell.
    pub key: MortonKey,
    /// Its centre, map frame, metres.
    pub center_m: Vector3<f64>,
    /// Distance of the centre from the point, metres.
    pub distance_m: f64,
}

impl<S: VoxelStore> Query<'_, S> {
    /// The `k` occupied cells whose centres are nearest to a point, nearest first; fewer if the
    /// store has fewer.
    pub fn nearest(&self, point_m: &Vector3<f64>, k: usize) -> Result<Vec<Neighbor>, QueryError> {
        let local = self.local(point_m)?;
        let found = self.nearest_to(local, k);
        let neighbor = |found: Found| Neighbor {
            key: found.key,
            center_m: self.store.center_m(found.key),
            distance_m: found.distance_m,
        };
        Ok(found.into_iter().map(neighbor).collect())
    }

    /// As [`Query::nearest`] in the frame of the datum.
    pub(super) fn nearest_to(&self, local_m: Vector3<f64>, k: usize) -> Vec<Found> {
        if k == 0 || self.store.is_empty() {
            return Vec::new();
        }
        let mut search = NearestSearch {
            local_m,
            k,
            max_m: f64::INFINITY,
            found: BinaryHeap::new(),
        };
        self.run(&mut search);
        search.found.into_sorted_vec()
    }
}

/// A cell and its distance, ordered by distance, then key.
#[derive(Clone, Copy, Debug)]
pub(super) struct Found {
    pub(super) distance_m: f64,
    pub(super) key: MortonKey,
}

impl Ord for Found {
    fn cmp(&self, other: &Found) -> Ordering {
        let by_distance = self.distance_m.total_cmp(&other.distance_m);
        by_distance.then(self.key.cmp(&other.key))
    }
}

impl PartialOrd for Found {
    fn partial_cmp(&self, other: &Found) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Found {
    fn eq(&self, other: &Found) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Found {}

struct NearestSearch {
    local_m: Vector3<f64>,
    k: usize,
    max_m: f64,
    /// At most k, the worst on top.
    found: BinaryHeap<Found>,
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
        worst.map_or(self.max_m, |worst| worst.distance_m)
    }

    fn visit(&mut self, key: MortonKey, center_m: &Vector3<f64>) {
        let distance_m = self.distance_m(center_m);
        if distance_m > self.max_m {
            return;
        }
        let candidate = Found { distance_m, key };
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
