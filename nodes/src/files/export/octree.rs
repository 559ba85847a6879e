//! Export of occupied space as an octree of OctoMap.

use std::io::{BufWriter, Write};

use lattice_core::lattice::MortonKey;
use lattice_core::voxels::VoxelList;

use super::error::ExportError;
use super::ply_header::comment;
use crate::octree::{CLASS, LOG_ODDS_OCCUPIED, OctreeForm, OctreeVoxels, UNKNOWN};

/// Size of a written tree.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct OctreeSummary {
    /// Voxel edge, metres.
    pub resolution_m: f64,
    /// Number of occupied voxels.
    pub voxels: usize,
}

/// Writes the occupied space as a tree of OctoMap, binary (`.bt`) or with log-odds (`.ot`); all other space is unknown.
///
/// Voxels are those of [`OctreeVoxels`]. Log-odds are 3.5, as a map file has no evidence.
pub fn write_octree(
    list: &VoxelList,
    form: OctreeForm,
    writer: impl Write,
) -> Result<OctreeSummary, ExportError> {
    let mut voxels = OctreeVoxels::new(list.lattice(), list.datum_m());
    for (key, _) in list.sorted() {
        voxels.add(key.unpack())?;
    }
    let resolution_m = voxels.resolution_m();
    let tree = voxels.encode(form, LOG_ODDS_OCCUPIED, usize::MAX, |cell| {
        let is_occupied = MortonKey::pack(cell).is_some_and(|key| list.contains(key));
        if is_occupied {
            LOG_ODDS_OCCUPIED
        } else {
            UNKNOWN
        }
    })?;
    let kind = match form {
        OctreeForm::Binary => " binary",
        OctreeForm::Full => "",
    };
    let mut writer = BufWriter::new(writer);
    write!(
        writer,
        "# Octomap OcTree{kind} file\n# (feel free to add / change comments, but leave the first line as it is!)\n\
         # {}\nid {CLASS}\nsize {}\nres {resolution_m}\ndata\n",
        comment(list),
        tree.nodes,
    )?;
    writer.write_all(&tree.data)?;
    writer.flush()?;
    Ok(OctreeSummary {
        resolution_m,
        voxels: tree.occupied as usize,
    })
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use lattice_core::cloud::Cloud;
    use lattice_core::lattice::{Lattice, LatticeKind};
    use nalgebra::Vector3;

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
        let summary = write_octree(&list, OctreeForm::Binary, &mut bytes).unwrap();
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
            let summary = write_octree(&list, OctreeForm::Binary, Vec::new()).unwrap();
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
        let summary = write_octree(&list, OctreeForm::Binary, &mut bytes).unwrap();
        let (found, ..) = leaves(&bytes);
        let largest = found.iter().map(|(_, side)| *side).max();
        assert_eq!(largest, Some(32));
        let volume: i64 = found.iter().map(|(_, side)| side.pow(3)).sum();
        assert_eq!(volume as usize, summary.voxels);
        list.clear();
        let mut bytes = Vec::new();
        write_octree(&list, OctreeForm::Binary, &mut bytes).unwrap();
        assert_eq!(leaves(&bytes).1, 0);
    }

    #[test]
    fn a_map_beyond_the_tree_is_refused_with_its_place() {
        let list = list(LatticeKind::Cubic, &[Vector3::new(8191.9, 0.0, 0.0)]);
        let error = write_octree(&list, OctreeForm::Binary, Vec::new())
            .unwrap_err()
            .to_string();
        assert!(error.contains("8192"), "{error}");
    }
}
