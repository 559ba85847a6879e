//! Formulas of the first paper as printed, and its Fig. 4, against the exact lattices.

use std::collections::BTreeSet;

use lattice_core::lattice::{
    BatchQuantizer, BlockKey, Lattice, LatticeIndex, LatticeKind, Simd, VoronoiCell,
};
use lattice_lab::printed::{
    PaperQuantizer, Search27, off_by_one, printed_delta, printed_generator,
};
use lattice_test::random::Random;
use nalgebra::{Isometry3, Matrix3, Vector3};

const ZERO: LatticeIndex = [0; 3];

pub fn unit(kind: LatticeKind) -> Lattice {
    Lattice::new(kind, 1.0).unwrap()
}

/// One random point in each of `n` x `n` x `n` equal parts of the cell that the basis spans.
pub fn stratified(generator: Matrix3<f64>, n: u32, mut visit: impl FnMut(Vector3<f64>)) {
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

fn with_zero(kind: LatticeKind) -> Vec<LatticeIndex> {
    [printed_delta(kind), vec![ZERO]].concat()
}

#[test]
fn eq_1_is_wrong_as_often_as_the_theory_says_for_the_printed_bases() {
    for (kind, share) in [
        (LatticeKind::Cubic, 0.0),
        (LatticeKind::Bcc, 3.0 / 8.0),
        (LatticeKind::Fcc, 7.0 / 16.0),
        (LatticeKind::Mcc, 0.2830372),
        (LatticeKind::Hex, 1.0 / 6.0),
    ] {
        let measured = share_wrong(printed_generator(kind).unwrap(), &[]);
        assert!((measured - share).abs() < 6e-4, "{kind}: {measured}");
    }
}

#[test]
fn eq_2_with_the_printed_sets_never_keeps_a_point_that_eq_1_has_right() {
    // Without the column 0: wrong wherever rounding is right, and elsewhere as with it.
    for (kind, share) in [
        (LatticeKind::Bcc, 5.0 / 8.0),
        (LatticeKind::Fcc, 9.0 / 16.0 + 1.0 / 96.0),
        (LatticeKind::Mcc, 1.0 - 0.2830372),
        (LatticeKind::Hex, 5.0 / 6.0),
    ] {
        let measured = share_wrong(printed_generator(kind).unwrap(), &printed_delta(kind));
        assert!((measured - share).abs() < 6e-4, "{kind}: {measured}");
    }
}

#[test]
fn the_column_0_repairs_all_sets_but_that_of_fcc() {
    let share = |kind| share_wrong(printed_generator(kind).unwrap(), &with_zero(kind));
    for kind in [LatticeKind::Bcc, LatticeKind::Mcc, LatticeKind::Hex] {
        assert_eq!(share(kind), 0.0, "{kind}");
    }
    let fcc = share(LatticeKind::Fcc);
    assert!((fcc - 1.0 / 96.0).abs() < 3e-4, "{fcc}");
}

#[test]
fn the_printed_sets_lack_three_pairs_of_fcc_and_one_of_hex() {
    let set = |list: &[LatticeIndex]| list.iter().copied().collect::<BTreeSet<_>>();
    let pairs = |half: &[LatticeIndex]| {
        let both = half.iter().flat_map(|&w| [w, w.map(|i| -i)]);
        both.collect::<BTreeSet<_>>()
    };
    for (kind, printed, touching, missing) in [
        (LatticeKind::Cubic, 26, 26, pairs(&[])),
        (LatticeKind::Bcc, 14, 14, pairs(&[])),
        (
            LatticeKind::Fcc,
            12,
            18,
            pairs(&[[1, 0, 0], [1, -2, 0], [1, -2, -2]]),
        ),
        (LatticeKind::Mcc, 14, 14, pairs(&[])),
        (LatticeKind::Hex, 18, 20, pairs(&[[1, 1, 1]])),
    ] {
        let mut found = set(&printed_delta(kind));
        found.remove(&ZERO);
        // The exact neighbours once from the table, once by Voronoi's theorem for the printed basis.
        let lattice = unit(kind);
        let of_basis = Lattice::from_basis(lattice.generator()).unwrap();
        let all = set(lattice.touching_neighbors());
        assert_eq!(set(of_basis.touching_neighbors()), all, "{kind}");
        assert_eq!((found.len(), all.len()), (printed, touching), "{kind}");
        assert_eq!(
            all.difference(&found).copied().collect::<BTreeSet<_>>(),
            missing
        );
        assert!(found.is_subset(&all), "{kind}");
    }
    let fcc = unit(LatticeKind::Fcc);
    assert_eq!(
        set(fcc.face_neighbors()),
        set(&printed_delta(LatticeKind::Fcc))
    );
}

#[test]
fn the_search_of_27_is_exact_for_the_bases_of_the_paper_only() {
    for kind in LatticeKind::PAPER {
        let share = share_wrong(printed_generator(kind).unwrap(), &off_by_one());
        assert_eq!(share, 0.0, "{kind}");
    }
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

/// Mean, standard deviation and range of the distance from 0 over cells, as in Fig. 4.
struct Spread {
    std: f64,
    range: f64,
}

fn spread(kind: LatticeKind, cells: &[LatticeIndex]) -> Spread {
    let lattice = unit(kind);
    let (mut sum, mut squares) = (0.0, 0.0);
    stratified(lattice.generator(), 50, |p| {
        let in_cell = p - lattice.center(lattice.quantize(&p).unwrap());
        for &w in cells {
            let square = (in_cell + lattice.center(w)).norm_squared();
            sum += square.sqrt();
            squares += square;
        }
    });
    let n = 125_000.0 * cells.len() as f64;
    let VoronoiCell { vertices, .. } = lattice.cell();
    let far = |w: &LatticeIndex| {
        let corners = vertices.iter().map(|v| (v + lattice.center(*w)).norm());
        corners.fold(0.0, f64::max)
    };
    let farthest = cells.iter().map(far).fold(0.0, f64::max);
    Spread {
        std: (squares / n - (sum / n).powi(2)).sqrt(),
        // The nearest point is in the middle of a face.
        range: farthest - lattice.packing_radius_m(),
    }
}

#[test]
fn fig_4_holds_for_12_against_26_cells_and_is_smaller_on_equal_terms() {
    let cubic = unit(LatticeKind::Cubic);
    let of = |kind, faces: bool| {
        let lattice = unit(kind);
        match faces {
            true => spread(kind, lattice.face_neighbors()),
            false => spread(kind, lattice.touching_neighbors()),
        }
    };
    let all = of(LatticeKind::Cubic, false);
    assert_eq!(cubic.touching_neighbors().len(), 26);
    assert!((all.std - 0.3780).abs() < 2e-4 && (all.range - 2.0981).abs() < 1e-4);
    let faces = of(LatticeKind::Cubic, true);
    for (name, found, against, std, range) in [
        (
            "fcc 12, as the paper",
            of(LatticeKind::Fcc, true),
            &all,
            -0.284,
            -0.422,
        ),
        ("fcc 18", of(LatticeKind::Fcc, false), &all, -0.090, -0.133),
        ("bcc 14", of(LatticeKind::Bcc, false), &all, -0.252, -0.347),
        (
            "fcc faces",
            of(LatticeKind::Fcc, true),
            &faces,
            0.001,
            0.048,
        ),
    ] {
        let (by_std, by_range) = (
            found.std / against.std - 1.0,
            found.range / against.range - 1.0,
        );
        assert!((by_std - std).abs() < 1e-3, "{name}: std {by_std}");
        assert!((by_range - range).abs() < 6e-4, "{name}: range {by_range}");
    }
}
