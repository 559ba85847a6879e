//! Implicit octree of sorted Morton keys.

use nalgebra::Vector3;

use super::search::{Search, slack_m};
use crate::lattice::{Lattice, MortonKey};

/// Maximum size of a leaf.
const LEAF: usize = 8;

/// Sorted keys as an octree: a node of level l is a run of keys that agree except for 3 l bits. Its centres lie in a
/// parallelepiped of 2^l cells per side.
pub(super) struct Tree {
    lattice: Lattice,
    keys: Vec<MortonKey>,
    /// Half of the longest diagonal of the parallelepiped of the basis.
    half_diagonal_m: f64,
}

#[derive(Clone, Copy)]
struct Node<'a> {
    keys: &'a [MortonKey],
    level: u32,
    /// Lower bound of the distance of its centres from the query.
    bound_m: f64,
}

impl Tree {
    /// Keys in ascending order.
    pub(super) fn new(lattice: Lattice, keys: Vec<MortonKey>) -> Tree {
        let g = lattice.generator();
        let diagonal = |y: f64, z: f64| (g * Vector3::new(1.0, y, z)).norm();
        let signs = [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)];
        let longest = signs.into_iter().map(|(y, z)| diagonal(y, z));
        Tree {
            half_diagonal_m: 0.5 * longest.fold(0.0, f64::max),
            lattice,
            keys,
        }
    }

    /// Visits every cell within the reach of the search.
    pub(super) fn search(&self, search: &mut impl Search) {
        if let Some(root) = self.node(&self.keys, search) {
            self.descend(root, search);
        }
    }

    fn descend(&self, node: Node<'_>, search: &mut impl Search) {
        if node.keys.len() <= LEAF {
            for &key in node.keys {
                let center_m = self.lattice.center(key.unpack());
                search.visit(key, &center_m);
            }
            return;
        }
        let mut children: [Option<Node<'_>>; 8] = [None; 8];
        let mut rest = node.keys;
        // Runs of children: keys that agree in the three bits below the node's level.
        for child in &mut children {
            let Some(first) = rest.first() else { break };
            let code = |key: &MortonKey| key.raw() >> (3 * node.level.saturating_sub(1));
            let end = rest.partition_point(|key| code(key) == code(first));
            let (run, after) = rest.split_at(end);
            *child = self.node(run, search);
            rest = after;
        }
        children.sort_unstable_by(|a, b| {
            let bound = |n: &Option<Node<'_>>| n.map_or(f64::INFINITY, |n| n.bound_m);
            bound(a).total_cmp(&bound(b))
        });
        for child in children.into_iter().flatten() {
            if child.bound_m > search.reach_m() {
                break;
            }
            self.descend(child, search);
        }
    }

    /// Smallest node with these keys; `None` without keys or out of reach.
    fn node<'a>(&self, keys: &'a [MortonKey], search: &impl Search) -> Option<Node<'a>> {
        let (first, last) = (keys.first()?.raw(), keys.last()?.raw());
        let level = (u64::BITS - (first ^ last).leading_zeros()).div_ceil(3);
        let corner = MortonKey::from_raw(first >> (3 * level) << (3 * level))?;
        let half_side = 0.5 * ((1_u64 << level) - 1) as f64;
        let middle = corner.unpack().map(|w| f64::from(w) + half_side);
        let distance_m = search.distance_m(&(self.lattice.generator() * Vector3::from(middle)));
        let slack_m = slack_m(distance_m, self.lattice.covering_radius_m());
        let bound_m = distance_m - 2.0 * half_side * self.half_diagonal_m - slack_m;
        (bound_m <= search.reach_m()).then_some(Node {
            keys,
            level,
            bound_m,
        })
    }
}
