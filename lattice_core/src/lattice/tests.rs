//! Tests of `Lattice`; the million-point ones are in the test crate.

use proptest::prelude::*;

use super::*;
use nalgebra::Matrix3;
use nalgebra::UnitQuaternion;
use nalgebra::Vector3;

fn any_lattice() -> impl Strategy<Value = Lattice> {
    (0..LatticeKind::ALL.len(), -9.0..9.0_f64)
        .prop_map(|(i, e)| Lattice::new(LatticeKind::ALL[i], 10_f64.powf(e)).unwrap())
}

#[test]
fn without_a_rotation_every_bit_is_that_of_the_triangular_product() {
    for kind in LatticeKind::ALL {
        let lattice = Lattice::new(kind, 0.3).unwrap();
        let turned = lattice
            .clone()
            .oriented(UnitQuaternion::from_euler_angles(1.0, 2.0, 3.0));
        assert_ne!(turned, lattice);
        let back = turned.oriented(UnitQuaternion::identity());
        assert_eq!(back, lattice);
        assert_eq!(
            (back.generator(), back.cell()),
            (lattice.generator(), lattice.cell())
        );
        let g = lattice.generator();
        for code in 0..729 {
            let w = [code % 9 - 4, code / 9 % 9 - 4, code / 81 - 4].map(|i| i * 12_345);
            let [x, y, z] = w.map(f64::from);
            let product = Vector3::new(
                g.m11 * x + g.m12 * y + g.m13 * z,
                g.m22 * y + g.m23 * z,
                g.m33 * z,
            );
            assert_eq!(lattice.center(w), product);
            assert_eq!(back.center(w), product);
        }
    }
}

#[test]
fn a_turned_lattice_is_the_lattice_seen_from_elsewhere() {
    let rotation = UnitQuaternion::from_euler_angles(0.4, -0.9, 2.2);
    let opposite = UnitQuaternion::new_unchecked(-rotation.into_inner());
    for kind in LatticeKind::ALL {
        let own = Lattice::new(kind, 0.125).unwrap();
        let turned = own.clone().oriented(rotation);
        assert_eq!(turned, own.clone().oriented(opposite));
        assert_eq!(turned, turned.clone().oriented(turned.orientation()));
        assert_eq!(turned.unoriented_generator(), own.generator());
        let expected = rotation.to_rotation_matrix() * own.generator();
        assert!((turned.generator() - expected).amax() < 1e-15);
        assert!((turned.cell().volume_m3() - 0.125).abs() < 1e-12);
        for (face, w) in turned.cell().faces.iter().zip(turned.face_neighbors()) {
            let normal = turned.center(*w);
            assert_eq!(face.neighbor, *w);
            for p in turned.cell().polygon(face) {
                assert!((normal.dot(&p) / normal.norm_squared() - 0.5).abs() < 1e-12);
            }
        }
        let mut points = Vec::new();
        for code in 0..1000 {
            let p = Vector3::new(code % 10, code / 10 % 10, code / 100).cast::<f64>() * 0.137;
            // Away from the borders.
            let p = p + Vector3::new(0.011, 0.023, 0.037);
            let found = turned.quantize(&(rotation * p));
            assert_eq!(found, own.quantize(&p), "{kind} {p}");
            points.push((rotation * p).into());
        }
        turned.quantize_each(points, |p, w| assert_eq!(w, turned.quantize(&p.into())));
    }
}

#[test]
fn rotations_that_are_none_give_no_cell() {
    for bad in [f64::NAN, f64::INFINITY, 0.0] {
        let rotation = UnitQuaternion::new_unchecked(nalgebra::Quaternion::new(bad, bad, 0.0, 0.0));
        let lattice = Lattice::new(LatticeKind::Fcc, 1.0)
            .unwrap()
            .oriented(rotation);
        assert_eq!(lattice.quantize(&Vector3::new(1.0, 2.0, 3.0)), None);
    }
}

#[test]
fn bases_that_span_no_sensible_cells_are_refused() {
    let refused = |entries: [f64; 9]| {
        let basis = nalgebra::Matrix3::from_column_slice(&entries);
        Lattice::from_basis(basis).unwrap_err().to_string()
    };
    let flat = refused([1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0]);
    assert!(flat.contains("cell volume 0 m^3"), "{flat}");
    let nearly = refused([1e5, 0.0, 0.0, 1e5, 1.0, 0.0, 1e5, 0.0, 1e-4]);
    assert!(nearly.contains("one plane"), "{nearly}");
    let skewed = refused([1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 5000.3, 0.2, 1.0]);
    assert!(skewed.contains("beyond 1000"), "{skewed}");
    let long = refused([1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 20.0]);
    assert!(long.contains("too long or flat"), "{long}");
    for bad in [f64::NAN, f64::INFINITY] {
        let error = refused([1.0, 0.0, 0.0, 0.0, bad, 0.0, 0.0, 0.0, 1.0]);
        assert!(error.contains("not finite"), "{error}");
    }
    let error = Lattice::new(LatticeKind::Custom, 1.0).unwrap_err();
    assert!(error.to_string().contains("from_basis"), "{error}");
}

#[test]
fn volumes_out_of_range_are_refused() {
    for volume in [0.0, -1.0, f64::NAN, f64::INFINITY, 0.99e-9, 1.01e9] {
        let error = Lattice::new(LatticeKind::Fcc, volume).unwrap_err();
        assert!(error.to_string().contains("m^3"), "{error}");
    }
}

#[test]
fn points_that_are_not_finite_have_no_cell() {
    for kind in LatticeKind::ALL {
        let lattice = Lattice::new(kind, 1.0).unwrap();
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, f64::MAX, 1e15] {
            for axis in 0..3 {
                let mut p = Vector3::new(0.1, 0.2, 0.3);
                p[axis] = bad;
                assert_eq!(lattice.quantize(&p), None, "{kind} {bad} {axis}");
            }
        }
    }
}

#[test]
fn the_index_range_ends_at_2_to_the_20() {
    for kind in LatticeKind::ALL {
        let lattice = Lattice::new(kind, 0.125).unwrap();
        for sign in [-1, 1] {
            for axis in 0..3 {
                let mut w = [0; 3];
                w[axis] = sign * ((1 << 20) - 1);
                assert_eq!(lattice.quantize(&lattice.center(w)), Some(w), "{kind}");
                w[axis] += sign;
                assert_eq!(lattice.quantize(&lattice.center(w)), None, "{kind}");
                let wide = w.map(i64::from);
                let found = lattice.quantize_wide(&lattice.center(w));
                assert_eq!(found, Some(wide), "{kind}");
            }
        }
    }
}

#[test]
fn a_scaled_lattice_keeps_kind_orientation_and_indices() {
    let turn = UnitQuaternion::from_euler_angles(0.4, -0.2, 1.0);
    let skew = Matrix3::new(0.5, 0.1, 0.0, 0.0, 0.4, 0.1, 0.2, 0.0, 0.6);
    let mut lattices = vec![Lattice::from_basis(skew).unwrap()];
    lattices.extend(LatticeKind::ALL.map(|kind| Lattice::new(kind, 0.3).unwrap()));
    for lattice in lattices.into_iter().map(|lattice| lattice.oriented(turn)) {
        let large = lattice.scaled(8.0).unwrap();
        assert_eq!(large.kind(), lattice.kind());
        assert_eq!(large.orientation(), lattice.orientation());
        for w in [[1, 2, 3], [-100, 7, 60], [99_999, -5, 1]] {
            assert_eq!(large.center(w), lattice.center(w) * 8.0, "{lattice:?}");
        }
        assert_eq!(large.scaled(0.125).unwrap(), lattice);
        for factor in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e4, 1e-4] {
            assert!(lattice.scaled(factor).is_err(), "{factor}");
        }
    }
}

#[test]
fn zero_and_its_mirror_image_share_a_cell() {
    for kind in LatticeKind::ALL {
        let lattice = Lattice::new(kind, 0.3).unwrap();
        assert_eq!(lattice.quantize(&Vector3::zeros()), Some([0; 3]));
        assert_eq!(lattice.quantize(&-Vector3::zeros()), Some([0; 3]));
    }
}

proptest! {
    #[test]
    fn the_batch_equals_the_single_point(lattice in any_lattice(), points in prop::collection::vec(prop::array::uniform3(-1e3..1e3_f64), 0..50)) {
        let mut answers = Vec::new();
        lattice.quantize_each(points.iter().copied(), |p, w| answers.push((p, w)));
        let single: Vec<_> = points.iter().map(|&p| (p, lattice.quantize(&Vector3::from(p)))).collect();
        prop_assert_eq!(answers, single);
    }
}
