//! k-d tree over points in blocks of eight, stored by coordinate.
//!
//! Node [first, end) of blocks splits at its middle block, which identifies the node without pointers. Distances and
//! bounds are summed in one order, so that rounding never hides a nearer point. Results are exact; of equal distances
//! the lowest index comes first.

use nalgebra::Point3;

use crate::lattice::Simd;

pub(crate) const BLOCK: usize = 8;
/// Minimum number of points whose halves are built in parallel.
const PARALLEL: usize = 4096;

/// Coordinates of eight points; infinite in unused slots.
type Block = [[f64; BLOCK]; 3];

/// Point and its index in the cloud, during construction.
#[derive(Clone, Copy)]
pub(crate) struct Item {
    pub coords_m: [f64; 3],
    pub index: u32,
}

/// Split of a node: coordinates of the left part are at most `at_m`, of the right at least.
#[derive(Clone, Copy, Default)]
struct Split {
    at_m: f64,
    axis: u32,
}

/// Maximum depth: blocks are numbered by 32 bits.
const DEPTH: usize = 32;

/// Blocks [first, end) at distance `off_m` from the query along each axis.
#[derive(Clone, Copy)]
struct Node {
    first: u32,
    end: u32,
    off_m: [f64; 4],
}

/// k-d tree. Results are indices in the order of the sorted points.
pub(crate) struct Tree {
    blocks: Vec<Block>,
    splits: Vec<Split>,
}

/// Result set of a search.
pub(crate) trait Keep {
    /// Current squared search radius.
    fn reach(&self) -> f64;
    /// Offers a point within the search radius.
    fn offer(&mut self, index: u32, squared: f64);
}

impl Tree {
    /// Sorts finite points into the order of the tree and builds it; deterministic on any number of threads.
    pub(crate) fn build(items: &mut [Item]) -> Tree {
        let blocks = items.len().div_ceil(BLOCK);
        let mut splits = vec![Split::default(); blocks];
        sort(items, &mut splits);
        let blocks = items.chunks(BLOCK).map(|leaf| {
            let mut block = [[f64::INFINITY; BLOCK]; 3];
            for (lane, item) in leaf.iter().enumerate() {
                for (to, from) in block.iter_mut().zip(item.coords_m) {
                    to[lane] = from;
                }
            }
            block
        });
        Tree {
            blocks: blocks.collect(),
            splits,
        }
    }

    /// Offers every point within the search radius, nearer halves first.
    #[inline]
    pub(crate) fn search(&self, query: &Point3<f64>, keep: &mut impl Keep) {
        #[cfg(target_arch = "x86_64")]
        if Simd::detect() == Simd::Avx2 {
            // SAFETY: AVX2 was detected.
            #[allow(unsafe_code)]
            return unsafe { self.search_avx2(query, keep) };
        }
        self.search_portably(query, keep);
    }

    /// [`Tree::search_portably`] compiled for AVX2, without fused multiply-add, so that the results are
    /// bit-identical.
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn search_avx2(&self, query: &Point3<f64>, keep: &mut impl Keep) {
        self.search_portably(query, keep);
    }

    #[inline(always)]
    fn search_portably(&self, query: &Point3<f64>, keep: &mut impl Keep) {
        let q = [query.x, query.y, query.z, 0.0];
        let mut node = Node {
            first: 0,
            end: self.blocks.len() as u32,
            off_m: [0.0; 4],
        };
        if self.blocks.is_empty() {
            return;
        }
        let mut left = [node; DEPTH];
        let mut n = 0;
        loop {
            while node.end - node.first > 1 {
                let middle = node.first + (node.end - node.first) / 2;
                let Split { at_m, axis } = self.splits[middle as usize];
                let axis = (axis & 3) as usize;
                let beyond_m = q[axis] - at_m;
                let (near, far) = match beyond_m >= 0.0 {
                    true => ((middle, node.end), (node.first, middle)),
                    false => ((node.first, middle), (middle, node.end)),
                };
                let slot = &mut left[n & (DEPTH - 1)];
                (slot.first, slot.end, slot.off_m) = (far.0, far.1, node.off_m);
                slot.off_m[axis] = beyond_m;
                n += 1;
                (node.first, node.end) = near;
            }
            self.scan(node.first, &q, keep);
            loop {
                if n == 0 {
                    return;
                }
                n -= 1;
                let next = &left[n & (DEPTH - 1)];
                let [x, y, z, _] = next.off_m;
                if x * x + y * y + z * z <= keep.reach() {
                    node = *next;
                    break;
                }
            }
        }
    }

    #[inline(always)]
    fn scan(&self, block: u32, q: &[f64; 4], keep: &mut impl Keep) {
        let [xs, ys, zs] = &self.blocks[block as usize];
        let mut squared = [0.0; BLOCK];
        for lane in 0..BLOCK {
            let (x, y, z) = (q[0] - xs[lane], q[1] - ys[lane], q[2] - zs[lane]);
            squared[lane] = x * x + y * y + z * z;
        }
        for (lane, &squared) in squared.iter().enumerate() {
            if squared <= keep.reach() {
                keep.offer(block * BLOCK as u32 + lane as u32, squared);
            }
        }
    }
}

/// Sorts items so that each block is a leaf, and records one split per block.
fn sort(items: &mut [Item], splits: &mut [Split]) {
    if splits.len() < 2 {
        return;
    }
    let axis = widest_axis(items);
    let middle = splits.len() / 2;
    let by_axis = |a: &Item, b: &Item| {
        let order = a.coords_m[axis].partial_cmp(&b.coords_m[axis]);
        order.unwrap_or(std::cmp::Ordering::Equal)
    };
    let (_, pivot, _) = items.select_nth_unstable_by(middle * BLOCK, by_axis);
    splits[middle] = Split {
        at_m: pivot.coords_m[axis],
        axis: axis as u32,
    };
    let parallel = items.len() >= PARALLEL;
    let (left, right) = items.split_at_mut(middle * BLOCK);
    let (left_splits, right_splits) = splits.split_at_mut(middle);
    // The first of the right splits belongs to this node: its middle block is never its first.
    if parallel {
        rayon::join(|| sort(left, left_splits), || sort(right, right_splits));
    } else {
        sort(left, left_splits);
        sort(right, right_splits);
    }
}

fn widest_axis(items: &[Item]) -> usize {
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for item in items {
        for axis in 0..3 {
            low[axis] = f64::min(low[axis], item.coords_m[axis]);
            high[axis] = f64::max(high[axis], item.coords_m[axis]);
        }
    }
    let width = |axis: usize| high[axis] - low[axis];
    let wider = usize::from(width(1) > width(0));
    if width(2) > width(wider) { 2 } else { wider }
}

pub(crate) struct Nearest {
    pub index: u32,
    pub squared: f64,
}

impl Keep for Nearest {
    #[inline(always)]
    fn reach(&self) -> f64 {
        self.squared
    }

    #[inline(always)]
    fn offer(&mut self, index: u32, squared: f64) {
        if squared < self.squared || index < self.index {
            *self = Nearest { index, squared };
        }
    }
}

/// The `k` nearest points, nearest first; a buffer reused between searches.
#[derive(Clone, Debug)]
pub struct Neighbors {
    squared: [f64; MAX_NEIGHBORS],
    index: [u32; MAX_NEIGHBORS],
    len: usize,
    k: usize,
    reach: f64,
}

/// Maximum number of neighbours of a search.
pub const MAX_NEIGHBORS: usize = 64;

impl Default for Neighbors {
    fn default() -> Neighbors {
        Neighbors {
            squared: [f64::INFINITY; MAX_NEIGHBORS],
            index: [u32::MAX; MAX_NEIGHBORS],
            len: 0,
            k: 0,
            reach: 0.0,
        }
    }
}

impl Neighbors {
    /// Clears the buffer for `k` neighbours (at most [`MAX_NEIGHBORS`]) within a squared distance.
    pub(crate) fn start(&mut self, k: usize, squared: f64) {
        self.len = 0;
        self.k = k.min(MAX_NEIGHBORS);
        self.reach = if self.k == 0 {
            -1.0
        } else {
            squared.min(f64::MAX)
        };
    }

    /// Number of neighbours found.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Tests whether no neighbour was found.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Index and squared distance (m^2) of each neighbour, nearest first; of equal distances the lowest index first.
    pub fn iter(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        let found = self.index.iter().zip(&self.squared).take(self.len);
        found.map(|(&index, &squared)| (index as usize, squared))
    }

    /// Squared distance of the `k`-th neighbour, if there are `k`.
    pub(crate) fn farthest_of(&self, k: usize) -> Option<f64> {
        (self.len == k && k > 0).then(|| self.squared[k - 1])
    }

    pub(crate) fn indices(&self) -> &[u32] {
        &self.index[..self.len]
    }
}

impl Keep for Neighbors {
    #[inline(always)]
    fn reach(&self) -> f64 {
        self.reach
    }

    #[inline(always)]
    fn offer(&mut self, index: u32, squared: f64) {
        let after = |i: usize| (squared, index) < (self.squared[i], self.index[i]);
        let mut at = if self.len < self.k {
            self.len += 1;
            self.len - 1
        } else if after(self.k - 1) {
            self.k - 1
        } else {
            return;
        };
        while at > 0
            && at < MAX_NEIGHBORS
            && (squared, index) < (self.squared[at - 1], self.index[at - 1])
        {
            self.squared[at] = self.squared[at - 1];
            self.index[at] = self.index[at - 1];
            at -= 1;
        }
        self.squared[at] = squared;
        self.index[at] = index;
        if self.len == self.k {
            self.reach = self.squared[self.k - 1];
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn tree_of(points: &[[f64; 3]]) -> (Tree, Vec<Item>) {
        let mut items: Vec<Item> = (0..)
            .zip(points)
            .map(|(index, &coords_m)| Item { coords_m, index })
            .collect();
        (Tree::build(&mut items), items)
    }

    /// Half of the coordinates on a coarse grid, so that there are equal distances.
    fn coordinate() -> impl Strategy<Value = f64> {
        prop_oneof![-5.0..5.0, (-5i32..5).prop_map(f64::from)]
    }

    proptest! {
        #[test]
        fn the_nearest_are_those_of_a_full_search(
            points in prop::collection::vec(prop::array::uniform3(coordinate()), 1..400),
            query in prop::array::uniform3(coordinate()),
            k in 1usize..30,
            gate in 0.5f64..20.0,
        ) {
            let (tree, items) = tree_of(&points);
            let squared = |item: &Item| {
                let [x, y, z] = [0, 1, 2].map(|a| query[a] - item.coords_m[a]);
                x * x + y * y + z * z
            };
            let mut all: Vec<(f64, usize)> = items.iter().map(squared).zip(0..).collect();
            all.sort_by(|a, b| a.partial_cmp(b).unwrap());
            all.retain(|(squared, _)| *squared <= gate);
            all.truncate(k);

            let mut found = Neighbors::default();
            found.start(k, gate);
            tree.search(&Point3::from(query), &mut found);
            let found: Vec<(f64, usize)> = found.iter().map(|(i, s)| (s, i)).collect();
            prop_assert_eq!(&found, &all);

            let mut nearest = Nearest { index: u32::MAX, squared: gate };
            tree.search(&Point3::from(query), &mut nearest);
            let first = all.first().map_or(u32::MAX, |(_, i)| *i as u32);
            prop_assert_eq!(nearest.index, first);
        }
    }

    #[test]
    fn no_padding_is_ever_found() {
        let (tree, _) = tree_of(&[[1.0; 3], [1.0; 3], [2.0; 3]]);
        let mut found = Neighbors::default();
        found.start(20, f64::INFINITY);
        tree.search(&Point3::new(1e200, f64::MIN, 0.0), &mut found);
        assert!(found.is_empty());
        tree.search(&Point3::new(f64::NAN, 0.0, 0.0), &mut found);
        assert!(found.is_empty());
        tree.search(&Point3::new(1.0, 1.0, 1.0), &mut found);
        assert_eq!(
            found.iter().collect::<Vec<_>>(),
            [(0, 0.0), (1, 0.0), (2, 3.0)]
        );
    }
}
