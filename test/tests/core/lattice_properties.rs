//! The closed-form quantizers against exhaustive search.

use lattice_core::lattice::{Lattice, LatticeIndex, LatticeKind, MortonKey};
use lattice_test::random::Random;
use nalgebra::Vector3;
use proptest::prelude::*;

/// The index that plain rounding of `G^-1 x` gives, eq. (1).
struct Rounding {
    lattice: Lattice,
    inverse: nalgebra::Matrix3<f64>,
}

impl Rounding {
    fn new(lattice: &Lattice) -> Rounding {
        let inverse = lattice.generator().try_inverse().expect("a basis");
        Rounding {
            lattice: lattice.clone(),
            inverse,
        }
    }

    fn round(&self, p: &Vector3<f64>) -> LatticeIndex {
        let w = self.inverse * p;
        [w.x.round() as i32, w.y.round() as i32, w.z.round() as i32]
    }
}

/// Nearest lattice point among 5 x 5 x 5 around the rounded one.
struct Exhaustive {
    start: Rounding,
    steps: Vec<(LatticeIndex, Vector3<f64>)>,
}

struct Nearest {
    w: LatticeIndex,
    square: f64,
    /// Squared distance of the second nearest minus that of the nearest.
    gap: f64,
}

impl Exhaustive {
    fn new(lattice: &Lattice) -> Exhaustive {
        let all = (0..125).map(|code| [code % 5 - 2, code / 5 % 5 - 2, code / 25 - 2]);
        let steps = all.map(|w| (w, lattice.center(w))).collect();
        Exhaustive {
            start: Rounding::new(lattice),
            steps,
        }
    }

    fn search(&self, p: &Vector3<f64>) -> Nearest {
        let w = self.start.round(p);
        let rest = p - self.start.lattice.center(w);
        let (mut best, mut second, mut step) = (f64::MAX, f64::MAX, [0; 3]);
        for (candidate, vector) in &self.steps {
            let square = (rest - vector).norm_squared();
            if square < best {
                (second, best, step) = (best, square, *candidate);
            } else if square < second {
                second = square;
            }
        }
        Nearest {
            w: add(w, step),
            square: best,
            gap: second - best,
        }
    }
}

fn add(a: LatticeIndex, b: LatticeIndex) -> LatticeIndex {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// A point on a face, an edge or a corner of the cell around `center`.
fn border_point(lattice: &Lattice, center: &Vector3<f64>, random: &mut Random) -> Vector3<f64> {
    let face = &lattice.cell().faces[random.below(lattice.cell().faces.len())];
    let corners: Vec<Vector3<f64>> = lattice.cell().polygon(face).collect();
    let i = random.below(corners.len());
    let (a, b, s) = (corners[i], corners[(i + 1) % corners.len()], random.unit());
    let on_cell = match random.below(4) {
        0 => a,
        1 => a + (b - a) * 0.5,
        2 => a + (b - a) * s,
        _ => a + (b - a) * s + (corners[(i + 2) % corners.len()] - a) * ((1.0 - s) * random.unit()),
    };
    center + on_cell
}

/// Rounding of squared distances at coordinates as large as those of `p`, metres^2.
fn tolerance(p: &Vector3<f64>) -> f64 {
    1e-14 + 4e-15 * p.amax()
}

fn check_against_search(lattice: &Lattice, search: &Exhaustive, p: &Vector3<f64>) -> Nearest {
    let found = lattice.quantize(p).expect("in range");
    let nearest = search.search(p);
    let square = (p - lattice.center(found)).norm_squared();
    let excess = square - nearest.square;
    assert!(
        excess <= tolerance(p),
        "{lattice:?} {p:?}: {found:?} is {excess} m^2 too far"
    );
    if nearest.gap > tolerance(p) {
        assert_eq!(found, nearest.w, "{lattice:?} {p:?}");
    }
    nearest
}

#[test]
fn each_quantizer_equals_exhaustive_search_on_a_million_points() {
    let mut random = Random(1);
    let mut ties = 0;
    for kind in LatticeKind::ALL {
        let lattice = Lattice::new(kind, 0.125).unwrap();
        let search = Exhaustive::new(&lattice);
        for i in 0..1_000_000 {
            let far = Vector3::new(1e5, -1e5, 1e3) * f64::from(i % 2);
            let near_far = far + random.point(20.0);
            if i % 4 < 2 {
                check_against_search(&lattice, &search, &near_far);
            } else {
                let center = lattice.center(lattice.quantize(&near_far).expect("in range"));
                let p = border_point(&lattice, &center, &mut random);
                let nearest = check_against_search(&lattice, &search, &p);
                ties += u32::from(nearest.gap <= tolerance(&p));
            }
        }
    }
    assert!(
        ties > 2_700_000,
        "only {ties} of 3 000 000 border points were on a border"
    );
}

#[test]
fn exact_ties_on_millimetre_grids_are_nearest_too() {
    // Sensors report millimetres, and cells of 2, 4 and 8 mm have their borders there.
    for kind in LatticeKind::ALL {
        for side in [0.002_f64, 0.004, 0.008] {
            let lattice = Lattice::new(kind, side.powi(3)).unwrap();
            let search = Exhaustive::new(&lattice);
            for code in 0..17 * 17 * 17 {
                let p = Vector3::new(code % 17 - 8, code / 17 % 17 - 8, code / 289 - 8);
                check_against_search(&lattice, &search, &(p.cast::<f64>() * 0.001));
            }
        }
    }
}

proptest! {
    #[test]
    fn a_lattice_vector_moves_the_answer_by_itself(
        kind in prop::sample::select(&LatticeKind::ALL[..]),
        exponent in -6.0..6.0_f64,
        u in prop::array::uniform3(-10.0..10.0_f64),
        w in prop::array::uniform3(-300_000..300_000_i32),
    ) {
        let lattice = Lattice::new(kind, 10_f64.powf(exponent)).unwrap();
        let side = lattice.cell_volume_m3().cbrt();
        let p = Vector3::from(u) * side;
        let moved = p + lattice.center(w);
        let gap = Exhaustive::new(&lattice).search(&p).gap / (side * side);
        prop_assume!(gap > 1e-9);
        let expected = add(lattice.quantize(&p).unwrap(), w);
        prop_assert_eq!(lattice.quantize(&moved), Some(expected));
    }

    #[test]
    fn no_point_is_farther_than_the_covering_radius_and_none_nearer_than_the_packing_radius_is_lost(
        kind in prop::sample::select(&LatticeKind::ALL[..]),
        exponent in -9.0..9.0_f64,
        u in prop::array::uniform3(-1000.0..1000.0_f64),
        direction in prop::array::uniform3(-1.0..1.0_f64),
    ) {
        let lattice = Lattice::new(kind, 10_f64.powf(exponent)).unwrap();
        let p = Vector3::from(u) * lattice.cell_volume_m3().cbrt();
        let w = lattice.quantize(&p).unwrap();
        let slack = 1.0 + 1e-10;
        prop_assert!((p - lattice.center(w)).norm() <= lattice.covering_radius_m() * slack);
        let direction = Vector3::from(direction);
        prop_assume!(direction.norm() > 1e-3);
        let inside = direction.normalize() * (lattice.packing_radius_m() / slack);
        prop_assert_eq!(lattice.quantize(&(lattice.center(w) + inside)), Some(w));
    }
}

#[test]
fn keys_are_the_same_bits_on_every_machine() {
    // FNV-1a over the keys of fixed points, a quarter of them on a millimetre grid.
    let expected = [
        0x4f54_f685_84d4_a32a_u64,
        0xf37c_1abf_01d0_a000,
        0xf41a_8675_48a1_429d,
        0x1396_45a3_ffee_b0b0,
        0xc8c0_36a3_9429_d185,
    ];
    let hashes = LatticeKind::PAPER.map(|kind| {
        let lattice = Lattice::new(kind, 0.001).unwrap();
        let mut random = Random(3);
        let mut hash = 0xcbf2_9ce4_8422_2325_u64;
        for i in 0..100_000 {
            let mut p = random.point(1000.0);
            if i % 4 == 0 {
                p = p.map(|x| (x * 1000.0).round() / 1000.0);
            }
            let key = lattice
                .quantize(&p)
                .and_then(MortonKey::pack)
                .expect("in range");
            for byte in key.raw().to_le_bytes() {
                hash = (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
            }
        }
        hash
    });
    assert_eq!(hashes, expected, "{hashes:#018x?}");
}
