//! Tests of `Lattice`; the million-point ones are in the test crate.

use proptest::prelude::*;

use super::*;

fn any_lattice() -> impl Strategy<Value = Lattice> {
    (0..5_usize, -9.0..9.0_f64)
        .prop_map(|(i, e)| Lattice::new(LatticeKind::ALL[i], 10_f64.powf(e)).unwrap())
}

#[test]
fn every_generator_is_upper_triangular() {
    for kind in LatticeKind::ALL {
        let g = Lattice::new(kind, 1.0).unwrap().generator();
        assert_eq!((g.m21, g.m31, g.m32), (0.0, 0.0, 0.0), "{kind}");
    }
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
                assert_eq!(
                    lattice.quantize_wide(&lattice.center(w)),
                    Some(wide),
                    "{kind}"
                );
            }
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
    fn the_centre_of_a_cell_is_in_it(lattice in any_lattice(), w in prop::array::uniform3(-1_000_000..1_000_000_i32)) {
        prop_assert_eq!(lattice.quantize(&lattice.center(w)), Some(w));
    }

    #[test]
    fn the_batch_equals_the_single_point(lattice in any_lattice(), points in prop::collection::vec(prop::array::uniform3(-1e3..1e3_f64), 0..50)) {
        let mut answers = Vec::new();
        lattice.quantize_each(points.iter().copied(), |p, w| answers.push((p, w)));
        let single: Vec<_> = points.iter().map(|&p| (p, lattice.quantize(&Vector3::from(p)))).collect();
        prop_assert_eq!(answers, single);
    }
}
