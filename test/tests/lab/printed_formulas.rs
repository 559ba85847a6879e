//! Formulas of the first paper as printed that its report does not check (`lattice paper voxels`;
//! the tests of the command want all of its checks to hold).

use lattice_core::lattice::{BatchQuantizer, BlockKey, Lattice, LatticeIndex, LatticeKind, Simd};
use lattice_lab::paper_values::{PaperQuantizer, Search27, off_by_one, printed_delta};
use lattice_test::random::Random;
use nalgebra::{Isometry3, Matrix3, Vector3};
use std::collections::BTreeSet;

pub fn unit(kind: LatticeKind) -> Lattice {
    Lattice::new(kind, 1.0).unwrap()
}

/// One random point in each of `n` x `n` x `n` equal parts of the cell that the basis spans.
fn stratified(generator: Matrix3<f64>, n: u32, mut visit: impl FnMut(Vector3<f64>)) {
    let mut random = Random(7);
    let g = generator / f64::from(n);
    for code in 0..n * n * n {
        let part = Vector3::new(code % n, code / n % n, code / (n * n)).cast::<f64>();
        visit(g * (part + Vector3::from_fn(|_, _| random.unit())));
    }
}

/// Share of space for which eq. (2) with these differences gives a point farther than the nearest.
fn share_wrong(generator: Matrix3<f64>, delta: &[LatticeIndex]) -> f64 {
    let printed = PaperQuantizer::new(generator, delta).unwrap();
    let exact = Lattice::from_basis(generator).unwrap();
    let mut wrong = 0;
    stratified(generator, 80, |p| {
        let square = |w| (p - exact.center(w)).norm_squared();
        let nearest = square(exact.quantize(&p).unwrap());
        wrong += u32::from(square(printed.nearest(&p)) > nearest + 1e-12);
    });
    f64::from(wrong) / 512_000.0
}

#[test]
fn the_printed_sets_lack_three_pairs_of_fcc_and_one_of_hex() {
    let set = |list: &[LatticeIndex]| list.iter().copied().collect::<BTreeSet<_>>();
    let pairs = |half: &[LatticeIndex]| {
        let both = half.iter().flat_map(|&w| [w, w.map(|i| -i)]);
        both.collect::<BTreeSet<_>>()
    };
    for (kind, missing) in [
        (LatticeKind::Cubic, pairs(&[])),
        (LatticeKind::Bcc, pairs(&[])),
        (
            LatticeKind::Fcc,
            pairs(&[[1, 0, 0], [1, -2, 0], [1, -2, -2]]),
        ),
        (LatticeKind::Mcc, pairs(&[])),
        (LatticeKind::Hex, pairs(&[[1, 1, 1]])),
    ] {
        let found = set(&printed_delta(kind));
        let touching = set(unit(kind).touching_neighbors());
        assert_eq!(&touching - &found, missing, "{kind}");
    }
    let fcc = unit(LatticeKind::Fcc);
    let printed = printed_delta(LatticeKind::Fcc);
    assert_eq!(set(fcc.face_neighbors()), set(&printed));
}

#[test]
fn the_search_of_27_is_not_exact_for_other_bases() {
    // Other bases of the same lattice: the columns added to each other a few times.
    let fcc = unit(LatticeKind::Fcc).generator();
    for (change, at_least) in [
        ([1.0, 1.0, 2.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0], 0.15),
        ([1.0, 2.0, 5.0, 0.0, 1.0, 2.0, 0.0, 0.0, 1.0], 0.35),
        ([1.0, 3.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0], 0.4),
    ] {
        let basis = fcc * Matrix3::from_row_slice(&change);
        let share = share_wrong(basis, &off_by_one());
        assert!(share > at_least, "{share}");
        // The batch form does what the formula does.
        let lattice = Lattice::from_basis(basis).unwrap();
        let mut points = Vec::new();
        stratified(basis, 40, |p| points.push(p.cast::<f32>().into()));
        let mut codes = vec![BlockKey::NONE; points.len()];
        Search27::new(&lattice, Simd::detect())
            .unwrap()
            .codes(&points, &mut codes);
        let mut exact = Vec::new();
        BatchQuantizer::new(&lattice, Isometry3::identity()).codes(&points, &mut exact);
        let others = codes.iter().zip(&exact).filter(|(a, b)| a != b).count();
        let batch = others as f64 / points.len() as f64;
        assert!((batch - share).abs() < 3e-3, "{batch}, not {share}");
    }
}
