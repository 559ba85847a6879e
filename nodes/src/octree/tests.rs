//! Encoded trees against a decoder by the format's description.

use std::collections::BTreeMap;

use lattice_core::lattice::{Lattice, LatticeIndex, LatticeKind};
use nalgebra::Vector3;
use proptest::prelude::*;

use super::*;

/// Values of voxels by their index: log-odds, or -1 and 1 of a binary tree.
type Voxels = BTreeMap<[i64; 3], f32>;

struct Decoder<'a> {
    form: OctreeForm,
    data: std::slice::Iter<'a, u8>,
    voxels: Voxels,
    nodes: u64,
    largest: i64,
}

impl Decoder<'_> {
    fn bytes<const N: usize>(&mut self) -> [u8; N] {
        std::array::from_fn(|_| *self.data.next().unwrap())
    }

    fn leaf(&mut self, at: [i64; 3], side: i64, value: f32) {
        self.largest = self.largest.max(side);
        for i in 0..side.pow(3) {
            let [x, y, z] = [i % side, i / side % side, i / side / side];
            let voxel = [at[0] + x, at[1] + y, at[2] + z];
            assert!(self.voxels.insert(voxel, value).is_none());
        }
    }

    fn node(&mut self, at: [i64; 3], side: i64) -> f32 {
        self.nodes += 1;
        let half = side / 2;
        let child_at = |child: usize| {
            [0, 1, 2].map(|axis| at[axis] + if child >> axis & 1 == 1 { half } else { 0 })
        };
        if self.form == OctreeForm::Full {
            let value = f32::from_le_bytes(self.bytes());
            let [exist] = self.bytes();
            let children: Vec<usize> = (0..8).filter(|child| exist >> child & 1 == 1).collect();
            if children.is_empty() {
                self.leaf(at, side, value);
            } else {
                let values = children
                    .iter()
                    .map(|child| self.node(child_at(*child), half));
                assert_eq!(values.fold(f32::MIN, f32::max), value);
            }
            return value;
        }
        let pairs = u16::from_le_bytes(self.bytes());
        let mut inner = Vec::new();
        for child in 0..8 {
            match pairs >> (2 * child) & 3 {
                0 => {}
                3 => inner.push(child),
                kind => {
                    self.nodes += 1;
                    self.leaf(child_at(child), half, if kind == 2 { 1.0 } else { -1.0 });
                }
            }
        }
        for child in inner {
            self.node(child_at(child), half);
        }
        0.0
    }
}

fn decode(form: OctreeForm, tree: &EncodedTree) -> (Voxels, i64) {
    let mut decoder = Decoder {
        form,
        data: tree.data.iter(),
        voxels: Voxels::new(),
        nodes: 0,
        largest: 0,
    };
    if !tree.data.is_empty() {
        decoder.node([-HALF; 3], 2 * HALF);
    }
    assert_eq!((decoder.data.len(), decoder.nodes), (0, tree.nodes));
    (decoder.voxels, decoder.largest)
}

type Cells = BTreeMap<LatticeIndex, i8>;

fn encode(
    lattice: &Lattice,
    datum_m: Vector3<f64>,
    cells: &Cells,
    form: OctreeForm,
    max_bytes: usize,
) -> Result<EncodedTree, OctreeError> {
    let mut voxels = OctreeVoxels::new(lattice, datum_m);
    for cell in cells.keys() {
        voxels.add(*cell)?;
    }
    voxels.encode(form, 0, max_bytes, |cell| {
        cells.get(&cell).copied().unwrap_or(UNKNOWN)
    })
}

/// Each voxel has the value of the cell of its centre, and there are no others.
fn check(kind: LatticeKind, datum_cells: [i64; 3], cells: &Cells) {
    let lattice = Lattice::new(kind, 0.125).unwrap();
    let datum_m = lattice.center_wide(datum_cells);
    let mut expected = Voxels::new();
    let side_m = lattice.cell_side_m() / 2.0;
    for (cell, value) in cells {
        let center_m = datum_m + lattice.center(*cell);
        let low = center_m.map(|m| (m / side_m).floor() as i64 - 4);
        for i in 0..512 {
            let voxel = [low.x + i % 8, low.y + i / 8 % 8, low.z + i / 64];
            let middle_m = Vector3::from(voxel).map(|v| (v as f64 + 0.5) * side_m);
            if lattice.quantize(&(middle_m - datum_m)) == Some(*cell) {
                expected.insert(voxel, f32::from(*value) / 32.0);
            }
        }
    }
    if kind == LatticeKind::Cubic {
        assert_eq!(expected.len(), 8 * cells.len());
    }
    let full = encode(&lattice, datum_m, cells, OctreeForm::Full, usize::MAX).unwrap();
    assert_eq!(decode(OctreeForm::Full, &full).0, expected);
    let binary = encode(&lattice, datum_m, cells, OctreeForm::Binary, usize::MAX).unwrap();
    let occupied = expected.values().filter(|value| **value >= 0.0).count() as u64;
    assert_eq!([full.occupied, binary.occupied], [occupied; 2]);
    let signs = expected
        .into_iter()
        .map(|(at, v)| (at, if v < 0.0 { -1.0 } else { 1.0 }));
    assert_eq!(decode(OctreeForm::Binary, &binary).0, signs.collect());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]
    #[test]
    fn voxels_have_the_value_of_the_cell_of_their_centre(
        cells in prop::collection::btree_map(
            prop::array::uniform3(-9..9_i32),
            prop_oneof![Just(-64_i8), Just(112_i8), -64..112_i8],
            0..60,
        ),
        datum in prop::array::uniform3(-3000..3000_i64),
    ) {
        for kind in [LatticeKind::Cubic, LatticeKind::Bcc, LatticeKind::Fcc] {
            check(kind, datum, &cells);
        }
    }
}

/// A cube of free cells with one occupied cell.
fn block() -> Cells {
    let side = 0..40_i32;
    let plane = side.clone().flat_map(|x| (0..40).map(move |y| [x, y]));
    let all = plane.flat_map(|[x, y]| side.clone().map(move |z| [x, y, z]));
    let mut cells: Cells = all.map(|cell| (cell, -64)).collect();
    cells.insert([3, 4, 5], 27);
    cells
}

#[test]
fn equal_children_are_one_leaf() {
    let (lattice, cells) = (Lattice::new(LatticeKind::Cubic, 0.125).unwrap(), block());
    for form in [OctreeForm::Binary, OctreeForm::Full] {
        let tree = encode(&lattice, Vector3::zeros(), &cells, form, usize::MAX).unwrap();
        let (voxels, largest) = decode(form, &tree);
        assert_eq!((voxels.len(), tree.occupied), (8 * 40 * 40 * 40, 8));
        assert_eq!(largest, 32, "{form:?}");
        let nodes = tree.nodes as usize;
        assert!(nodes < voxels.len() / 8, "{form:?}: {nodes} nodes");
    }
}

#[test]
fn bytes_are_bounded_and_an_empty_map_has_none() {
    let (lattice, cells) = (Lattice::new(LatticeKind::Cubic, 0.125).unwrap(), block());
    let at = |cells: &Cells, form, most| encode(&lattice, Vector3::zeros(), cells, form, most);
    for form in [OctreeForm::Binary, OctreeForm::Full] {
        let bytes = at(&cells, form, usize::MAX).unwrap().data.len();
        assert_eq!(at(&cells, form, bytes).unwrap().data.len(), bytes);
        let error = at(&cells, form, 2000).unwrap_err().to_string();
        assert!(error.contains("more than 2000 bytes"), "{error}");
        assert_eq!(at(&Cells::new(), form, 0), Ok(EncodedTree::default()));
    }
}

#[test]
fn cells_beyond_the_keys_of_a_tree_are_refused() {
    let lattice = Lattice::new(LatticeKind::Cubic, 0.125).unwrap();
    let mut voxels = OctreeVoxels::new(&lattice, Vector3::zeros());
    // Cells are from 2 w - 1 to 2 w in voxels.
    for (w, fits) in [
        (16383, true),
        (16384, false),
        (-16383, true),
        (-16384, false),
    ] {
        assert_eq!(voxels.add([w, 0, 0]).is_ok(), fits, "{w}");
        assert_eq!(voxels.add([0, 0, w]).is_ok(), fits, "{w}");
    }
}
