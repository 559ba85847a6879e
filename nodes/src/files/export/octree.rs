//! Export of occupied space as OctoMap's binary tree.

use std::io::{BufWriter, Write};

use lattice_core::voxels::VoxelList;
use nalgebra::Vector3;

use super::ExportError;

/// Levels of the tree below its root.
const LEVELS: u32 = 16;
/// Voxels on each side of the tree's centre.
const HALF: i64 = 1 << (LEVELS - 1);

/// Size of a written tree.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct OctreeSummary {
    /// Voxel edge, metres.
    pub resolution_m: f64,
    /// Number of occupied voxels.
    pub voxels: usize,
}

/// Writes the occupied space as a binary tree (`.bt`) of OctoMap; all other space is unknown.
///
/// The voxel edge is half the cell size; a voxel is occupied if its centre lies in an
/// occupied cell. A cubic cell is exactly eight voxels: an octree has corners
/// where that lattice has centres, so voxels of the full cell size would not align.
pub fn write_octree(list: &VoxelList, writer: impl Write) -> Result<OctreeSummary, ExportError> {
    let resolution_m = list.lattice().cell_side_m() / 2.0;
    let codes = occupied(list, resolution_m)?;
    let mut tree = Tree::default();
    if !codes.is_empty() {
        tree.nodes = 1;
        tree.add(&codes, LEVELS);
    }
    let mut writer = BufWriter::new(writer);
    write!(
        writer,
        "# Octomap OcTree binary file\n# (feel free to add / change comments, but leave the first \
         line as it is!)\n# {}\nid OcTree\nsize {}\nres {resolution_m}\ndata\n",
        super::comment(list),
        tree.nodes,
    )?;
    writer.write_all(&tree.data)?;
    writer.flush()?;
    Ok(OctreeSummary {
        resolution_m,
        voxels: codes.len(),
    })
}

/// Occupied voxels in tree order: three bits per level.
fn occupied(list: &VoxelList, resolution_m: f64) -> Result<Vec<u64>, ExportError> {
    let lattice = list.lattice();
    // Half the extent of a cell on each axis.
    let reach_m = (lattice.cell().vertices.iter()).fold(Vector3::zeros(), |reach, vertex| {
        Vector3::sup(&reach, &vertex.abs())
    });
    let mut codes = Vec::new();
    for (key, _) in list.sorted() {
        let (index, center_m) = (key.unpack(), list.center_m(key));
        let range = |axis: usize| {
            let voxel = |m: f64| (m / resolution_m).floor();
            let (low, high) = (
                center_m[axis] - reach_m[axis],
                center_m[axis] + reach_m[axis],
            );
            (voxel(low), voxel(high))
        };
        let ranges = [range(0), range(1), range(2)];
        let fits = |(low, high): &(f64, f64)| *low >= -HALF as f64 && *high < HALF as f64;
        if !ranges.iter().all(fits) {
            let limit_m = HALF as f64 * resolution_m;
            return Err(ExportError::OutsideOctree {
                center_m: center_m.into(),
                limit_m,
            });
        }
        let [xs, ys, zs] = ranges.map(|(low, high)| low as i64..=high as i64);
        for z in zs {
            for y in ys.clone() {
                for x in xs.clone() {
                    let voxel = Vector3::new(x, y, z);
                    let middle_m = voxel.map(|i| (i as f64 + 0.5) * resolution_m);
                    if lattice.quantize(&(middle_m - list.datum_m())) == Some(index) {
                        codes.push(code([x, y, z].map(|i| (i + HALF) as u64)));
                    }
                }
            }
        }
    }
    codes.sort_unstable();
    Ok(codes)
}

/// Interleaved bits of x, y and z for each level, x lowest.
fn code(voxel: [u64; 3]) -> u64 {
    (0..LEVELS).fold(0, |code, level| {
        let [x, y, z] = voxel.map(|v| v >> level & 1);
        code | (x | y << 1 | z << 2) << (3 * level)
    })
}

#[derive(Default)]
struct Tree {
    nodes: u64,
    /// Two bytes per inner node, depth first.
    data: Vec<u8>,
}

impl Tree {
    /// Adds an inner node with `levels` below it, and its descendants, from its occupied voxels.
    fn add(&mut self, codes: &[u64], levels: u32) {
        let below = levels.saturating_sub(1);
        let child_of = |code: &u64| code >> (3 * below) & 7;
        let whole = 1_usize << (3 * below);
        let (mut bits, mut inner) = (0_u16, Vec::new());
        for child in codes.chunk_by(|a, b| child_of(a) == child_of(b)) {
            let number = child.first().map_or(0, child_of);
            self.nodes += 1;
            let is_full = child.len() == whole;
            bits |= if is_full { 0b10 } else { 0b11 } << (2 * number);
            if !is_full {
                inner.push(child);
            }
        }
        self.data.extend(bits.to_le_bytes());
        for child in inner {
            self.add(child, below);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use lattice_core::cloud::Cloud;
    use lattice_core::lattice::{Lattice, LatticeKind};

    use super::*;

    fn list(kind: LatticeKind, points_m: &[Vector3<f64>]) -> VoxelList {
        let lattice = Lattice::new(kind, 0.125).unwrap();
        let near_m = Vector3::new(100.0, -40.0, 3.0);
        let mut list = VoxelList::new(lattice, near_m, 10_000).unwrap();
        list.insert(&Cloud::from_points(0, near_m, points_m));
        list
    }

    fn wall() -> Vec<Vector3<f64>> {
        let point = |i: u32| {
            let (a, b) = (f64::from(i % 40), f64::from(i / 40));
            Vector3::new(100.0 + 0.2 * a, -40.0 - 0.07 * b, 0.21 * b)
        };
        (0..1200).map(point).collect()
    }

    /// Occupied leaves of a file as lowest voxel and edge in voxels, by the format as octomap describes it:
    /// bits of a node from the first child on, and the children that have children right behind.
    fn leaves(bytes: &[u8]) -> (Vec<([i64; 3], i64)>, u64, f64) {
        fn node(
            data: &mut std::slice::Iter<u8>,
            at: [i64; 3],
            side: i64,
        ) -> (Vec<([i64; 3], i64)>, u64) {
            let bytes: Vec<u8> = data.by_ref().take(2).copied().collect();
            let bit = |i: usize| bytes[i / 8] >> (i % 8) & 1 == 1;
            let half = side / 2;
            let (mut leaves, mut nodes, mut inner) = (Vec::new(), 1, Vec::new());
            for child in 0..8_usize {
                let shift = |axis: usize| at[axis] + if child >> axis & 1 == 1 { half } else { 0 };
                let at = [shift(0), shift(1), shift(2)];
                match (bit(2 * child), bit(2 * child + 1)) {
                    (false, false) => {}
                    (true, false) => nodes += 1,
                    (false, true) => {
                        nodes += 1;
                        leaves.push((at, half));
                    }
                    (true, true) => inner.push(at),
                }
            }
            for at in inner {
                let (more, of) = node(data, at, half);
                leaves.extend(more);
                nodes += of;
            }
            (leaves, nodes)
        }
        let end = bytes.windows(6).position(|w| w == b"\ndata\n").unwrap() + 6;
        let header = std::str::from_utf8(&bytes[..end]).unwrap();
        assert!(header.starts_with("# Octomap OcTree binary file\n"));
        assert!(header.contains("\nid OcTree\n"));
        let value = |key: &str| {
            let line = header.lines().find_map(|line| line.strip_prefix(key));
            line.unwrap().to_owned()
        };
        let (size, res) = (
            value("size ").parse().unwrap(),
            value("res ").parse().unwrap(),
        );
        if size == 0 {
            assert_eq!(bytes.len(), end);
            return (Vec::new(), 0, res);
        }
        let mut data = bytes[end..].iter();
        let (leaves, nodes) = node(&mut data, [-32768; 3], 65536);
        assert_eq!((data.len(), nodes), (0, size));
        (leaves, size, res)
    }

    #[test]
    fn a_cell_of_the_cubic_lattice_is_eight_voxels_exactly() {
        let list = list(LatticeKind::Cubic, &wall());
        let mut bytes = Vec::new();
        let summary = write_octree(&list, &mut bytes).unwrap();
        let (leaves, _, res) = leaves(&bytes);
        assert_eq!((summary.voxels, res), (8 * list.len(), 0.25));
        let mut voxels = BTreeSet::new();
        for (at, side) in leaves {
            for i in 0..side.pow(3) {
                let [x, y, z] = [i % side, i / side % side, i / side / side];
                voxels.insert([at[0] + x, at[1] + y, at[2] + z]);
            }
        }
        let mut expected = BTreeSet::new();
        for (key, _) in list.sorted() {
            let low = list.center_m(key).map(|m| (m / 0.25).round() as i64 - 1);
            for i in 0..8 {
                expected.insert([low.x + (i & 1), low.y + (i >> 1 & 1), low.z + (i >> 2)]);
            }
        }
        assert_eq!(voxels, expected);
    }

    #[test]
    fn other_lattices_keep_their_volume() {
        for kind in LatticeKind::PAPER {
            let list = list(kind, &wall());
            let summary = write_octree(&list, Vec::new()).unwrap();
            let volume = summary.voxels as f64 / 8.0 / list.len() as f64;
            assert!((0.95..1.05).contains(&volume), "{kind}: {volume}");
        }
    }

    #[test]
    fn full_nodes_are_leaves_and_no_voxel_is_no_node() {
        let dense = |i: i32| {
            Vector3::new(
                f64::from(i % 24),
                f64::from(i / 24 % 24),
                f64::from(i / 576),
            )
        };
        let block: Vec<_> = (0..24 * 24 * 24).map(|i| 0.5 * dense(i)).collect();
        let lattice = Lattice::new(LatticeKind::Cubic, 0.125).unwrap();
        let mut list = VoxelList::new(lattice, Vector3::zeros(), 100_000).unwrap();
        list.insert(&Cloud::from_points(0, Vector3::zeros(), &block));
        let mut bytes = Vec::new();
        let summary = write_octree(&list, &mut bytes).unwrap();
        let (found, ..) = leaves(&bytes);
        let largest = found.iter().map(|(_, side)| *side).max();
        assert_eq!(largest, Some(32));
        let volume: i64 = found.iter().map(|(_, side)| side.pow(3)).sum();
        assert_eq!(volume as usize, summary.voxels);
        list.clear();
        let mut bytes = Vec::new();
        write_octree(&list, &mut bytes).unwrap();
        assert_eq!(leaves(&bytes).1, 0);
    }

    #[test]
    fn a_map_beyond_the_tree_is_refused_with_its_place() {
        let list = list(LatticeKind::Cubic, &[Vector3::new(8191.9, 0.0, 0.0)]);
        let error = write_octree(&list, Vec::new()).unwrap_err().to_string();
        assert!(error.contains("8192"), "{error}");
    }
}
