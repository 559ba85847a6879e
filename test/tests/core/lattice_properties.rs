//! The closed-form quantizers against exhaustive search and against lattice theory.

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

/// One random point in each of 100 x 100 x 100 equal parts of the cell spanned by the basis.
fn stratified(lattice: &Lattice, mut visit: impl FnMut(Vector3<f64>)) {
    let mut random = Random(7);
    let g = lattice.generator() * 0.01;
    for code in 0..1_000_000 {
        let part = Vector3::new(code % 100, code / 100 % 100, code / 10_000).cast::<f64>();
        visit(g * (part + Vector3::from_fn(|_, _| random.unit())));
    }
}

#[test]
fn distortion_is_that_of_the_theory() {
    for (kind, mse_per_dimension, mean_distance, rms, covering_radius) in [
        (
            LatticeKind::Cubic,
            0.0833333,
            0.4802960,
            0.5000000,
            0.8660254,
        ),
        (LatticeKind::Bcc, 0.0785433, 0.4690885, 0.4854172, 0.7043173),
        (LatticeKind::Fcc, 0.0787451, 0.4694674, 0.4860403, 0.7937005),
        (LatticeKind::Mcc, 0.0786696, 0.4693437, 0.4858075, 0.7282377),
        (LatticeKind::Hex, 0.0834602, 0.4813262, 0.5003803, 0.7972334),
        (
            LatticeKind::HexOptimal,
            0.0812227,
            0.4753937,
            0.4936275,
            0.7959505,
        ),
    ] {
        let lattice = Lattice::new(kind, 1.0).unwrap();
        let (mut distances, mut squares, mut largest) = (0.0, 0.0, 0.0_f64);
        stratified(&lattice, |p| {
            let w = lattice.quantize(&p).expect("in range");
            let square = (p - lattice.center(w)).norm_squared();
            distances += square.sqrt();
            squares += square;
            largest = largest.max(square);
        });
        let close = |value: f64, theory: f64| (value / theory - 1.0).abs() < 2e-4;
        assert!(
            close(squares / 3e6, mse_per_dimension),
            "{kind}: MSE {}",
            squares / 3e6
        );
        assert!(
            close(distances / 1e6, mean_distance),
            "{kind}: mean {}",
            distances / 1e6
        );
        assert!(
            close((squares / 1e6).sqrt(), rms),
            "{kind}: RMS {}",
            (squares / 1e6).sqrt()
        );
        let radius = largest.sqrt();
        assert!(
            radius <= covering_radius + 1e-7 && radius > 0.98 * covering_radius,
            "{kind}: {radius}"
        );
    }
}

/// Share of points for which eq. (2) with these differences and zero misses the nearest point.
fn share_wrong(kind: LatticeKind, differences: &[LatticeIndex]) -> f64 {
    let lattice = Lattice::new(kind, 1.0).unwrap();
    let rounding = Rounding::new(&lattice);
    let mut wrong = 0;
    stratified(&lattice, |p| {
        let w = rounding.round(&p);
        let square = |w| (p - lattice.center(w)).norm_squared();
        let nearest = square(lattice.quantize(&p).expect("in range"));
        let found = differences
            .iter()
            .map(|&d| square(add(w, d)))
            .fold(square(w), f64::min);
        wrong += u32::from(found > nearest + 1e-12);
    });
    f64::from(wrong) / 1e6
}

#[test]
fn rounding_alone_fails_as_often_as_the_theory_says() {
    for (kind, share) in [
        (LatticeKind::Cubic, 0.0),
        (LatticeKind::Bcc, 3.0 / 8.0),
        (LatticeKind::Fcc, 7.0 / 16.0),
        (LatticeKind::Mcc, 0.2830372),
        (LatticeKind::Hex, 1.0 / 6.0),
    ] {
        let measured = share_wrong(kind, &[]);
        assert!(
            (measured - share).abs() < 5e-4,
            "{kind}: {measured} instead of {share}"
        );
    }
}

#[test]
fn the_printed_fcc_set_misses_one_point_in_96() {
    // Eq. (4) lists the twelve face neighbours; basis (10) needs +-(1,0,0) as well.
    let lattice = Lattice::new(LatticeKind::Fcc, 1.0).unwrap();
    let measured = share_wrong(LatticeKind::Fcc, lattice.face_neighbors());
    assert!((measured - 1.0 / 96.0).abs() < 3e-4, "{measured}");
    let repaired = [lattice.face_neighbors(), &[[1, 0, 0], [-1, 0, 0]]].concat();
    assert_eq!(share_wrong(LatticeKind::Fcc, &repaired), 0.0);
}

#[test]
fn the_other_printed_sets_with_zero_are_enough() {
    for kind in [LatticeKind::Bcc, LatticeKind::Mcc, LatticeKind::Hex] {
        let lattice = Lattice::new(kind, 1.0).unwrap();
        assert_eq!(share_wrong(kind, lattice.face_neighbors()), 0.0, "{kind}");
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
