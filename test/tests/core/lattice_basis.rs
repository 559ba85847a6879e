//! Lattices of any basis against exhaustive search.

use std::collections::BTreeSet;

use lattice_core::lattice::{BatchQuantizer, BlockKey, Lattice, LatticeIndex, LatticeKind};
use lattice_test::random::Random;
use nalgebra::{Isometry3, Matrix3, Vector3};

/// Random integer matrix of determinant +-1: a product of steps that add one column to another.
fn unimodular(random: &mut Random, steps: usize) -> Matrix3<f64> {
    let mut m = Matrix3::identity();
    for _ in 0..steps {
        let (i, j) = (random.below(3), random.below(3));
        if i != j {
            let sign = if random.below(2) == 0 { 1.0 } else { -1.0 };
            let added = m.column(i) + m.column(j) * sign;
            m.set_column(i, &added);
        }
    }
    if random.below(2) == 0 {
        m.swap_columns(0, 1);
    }
    m
}

/// A basis of random vectors whose cell is not too long for `Lattice::from_basis`.
fn random_lattice(random: &mut Random) -> Lattice {
    loop {
        let columns = [random.point(1.0), random.point(1.0), random.point(1.0)];
        if let Ok(lattice) = Lattice::from_basis(Matrix3::from_columns(&columns)) {
            return lattice;
        }
    }
}

/// Squared distance of the nearest lattice point, by a search that needs no reduction: all points
/// within the covering radius have coefficients bounded by the rows of the inverse basis.
struct Exhaustive {
    generator: Matrix3<f64>,
    inverse: Matrix3<f64>,
    steps: Vec<Vector3<f64>>,
}

impl Exhaustive {
    fn new(generator: Matrix3<f64>, covering_radius_m: f64) -> Exhaustive {
        let inverse = generator.try_inverse().unwrap();
        let reach = [0, 1, 2].map(|i| (covering_radius_m * inverse.row(i).norm() + 0.5) as i32);
        let mut steps = Vec::new();
        for x in -reach[0]..=reach[0] {
            for y in -reach[1]..=reach[1] {
                for z in -reach[2]..=reach[2] {
                    let step = generator * Vector3::new(x, y, z).cast::<f64>();
                    // From within the cell of the basis, of half diagonals up to its longest.
                    steps.push(step);
                }
            }
        }
        Exhaustive {
            generator,
            inverse,
            steps,
        }
    }

    fn square(&self, p: &Vector3<f64>) -> f64 {
        let rest = p - self.generator * (self.inverse * p).map(f64::round);
        let squares = self.steps.iter().map(|step| (rest - step).norm_squared());
        squares.fold(f64::MAX, f64::min)
    }
}

fn check_nearest(lattice: &Lattice, random: &mut Random) {
    let volume = lattice.cell().volume_m3() / lattice.cell_volume_m3() - 1.0;
    let generator = lattice.generator();
    assert!(volume.abs() < 1e-9, "{generator}: volume {volume}");
    let search = Exhaustive::new(lattice.generator(), lattice.covering_radius_m());
    let side = lattice.cell_volume_m3().cbrt();
    // The search is long where the basis is skewed.
    for _ in 0..(1_000_000 / search.steps.len()).clamp(30, 2000) {
        let p = random.point(3.0 * side);
        let w = lattice.quantize(&p).unwrap();
        let square = (p - lattice.center(w)).norm_squared();
        let nearest = search.square(&p);
        let excess = square - nearest;
        assert!(
            excess <= 1e-11 * side * side,
            "{generator} {p} {w:?}: {excess}"
        );
        assert!(square.sqrt() <= lattice.covering_radius_m() * (1.0 + 1e-12));
    }
}

#[test]
fn random_bases_quantize_to_the_nearest_point() {
    let mut random = Random(11);
    for _ in 0..141 {
        let lattice = random_lattice(&mut random);
        assert_eq!(lattice.kind(), LatticeKind::Custom);
        check_nearest(&lattice, &mut random);
    }
}

#[test]
fn other_bases_of_a_lattice_give_its_cells() {
    let mut random = Random(12);
    for kind in LatticeKind::ALL {
        let own = Lattice::new(kind, 0.125).unwrap();
        for _ in 0..100 {
            let change = unimodular(&mut random, 8);
            let other = Lattice::from_basis(own.generator() * change).unwrap();
            assert!((other.cell_volume_m3() - 0.125).abs() < 1e-12);
            let covering = other.covering_radius_m() - own.covering_radius_m();
            let packing = other.packing_radius_m() - own.packing_radius_m();
            assert!(covering.abs() < 1e-9 && packing.abs() < 1e-9, "{kind}");
            // Index of the own basis: change * w, exactly.
            let own_index = |w: &LatticeIndex| {
                let v = change * Vector3::from(w.map(f64::from));
                [v.x as i32, v.y as i32, v.z as i32]
            };
            for (other, own) in [
                (other.face_neighbors(), own.face_neighbors()),
                (other.touching_neighbors(), own.touching_neighbors()),
            ] {
                let moved: BTreeSet<_> = other.iter().map(own_index).collect();
                assert_eq!(moved, own.iter().copied().collect(), "{kind}");
            }
            for _ in 0..500 {
                let p = random.point(4.0);
                let (a, b) = (own.quantize(&p).unwrap(), other.quantize(&p).unwrap());
                // Random points are not on borders.
                assert_eq!(own_index(&b), a, "{kind}");
            }
        }
    }
}

#[test]
fn neighbours_are_symmetric_pairs_and_share_the_faces_of_the_cell() {
    let mut random = Random(13);
    for _ in 0..200 {
        let lattice = random_lattice(&mut random);
        // A random lattice is in general position.
        assert_eq!(lattice.face_neighbors().len(), 14);
        assert_eq!(lattice.touching_neighbors(), lattice.face_neighbors());
        for pair in lattice.touching_neighbors().chunks(2) {
            assert_eq!(pair[0].map(|i| -i), pair[1]);
        }
        assert_eq!(lattice.cell().vertices.len(), 24);
    }
}

#[test]
fn bases_near_a_symmetric_lattice_keep_their_volume() {
    let mut random = Random(14);
    for kind in LatticeKind::ALL {
        for exponent in 3..16 {
            let g = Lattice::new(kind, 1.0).unwrap().generator();
            let noise = 10_f64.powi(-exponent);
            let shaken = g.map(|entry| entry + noise * (random.unit() - 0.5));
            let lattice = Lattice::from_basis(shaken).unwrap();
            let error = lattice.cell().volume_m3() / lattice.cell_volume_m3() - 1.0;
            assert!(error.abs() < 1e-7, "{kind} 1e-{exponent}: {error}");
            assert!(lattice.touching_neighbors().len() >= 14);
        }
    }
}

#[test]
fn a_batch_in_any_lattice_and_orientation_gives_what_single_points_give() {
    let mut random = Random(15);
    let mut lattices = vec![random_lattice(&mut random)];
    lattices.extend(LatticeKind::ALL.map(|kind| Lattice::new(kind, 0.2).unwrap()));
    for lattice in lattices {
        let lattice = lattice.oriented(random.rotation());
        let pose = Isometry3::from_parts(random.point(50.0).into(), random.rotation());
        let batch = BatchQuantizer::new(&lattice, pose);
        let points: Vec<[f32; 3]> = (0..1000)
            .map(|_| random.point(30.0).cast::<f32>().into())
            .collect();
        let mut codes = Vec::new();
        batch.codes(&points, &mut codes);
        for (p, code) in points.iter().zip(codes) {
            let w = lattice.quantize(&batch.transform(*p));
            assert_eq!(Some(code), w.and_then(BlockKey::pack), "{lattice:?}");
        }
    }
}
