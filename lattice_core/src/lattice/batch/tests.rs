//! The batch against single points.

use nalgebra::{Translation3, UnitQuaternion};
use proptest::prelude::*;

use super::kernel::STEPS;
use super::*;
use crate::lattice::BlockKey;
use crate::lattice::Lattice;
use crate::lattice::LatticeKind;
use nalgebra::Isometry3;
use nalgebra::Vector3;

fn lattices() -> impl Strategy<Value = Lattice> {
    (0..LatticeKind::ALL.len(), -6.0..6.0_f64)
        .prop_map(|(i, e)| Lattice::new(LatticeKind::ALL[i], 10_f64.powf(e)).unwrap())
}

fn single(lattice: &Lattice, p: &Vector3<f64>) -> BlockKey {
    let w = lattice.quantize(p);
    w.and_then(BlockKey::pack).unwrap_or(BlockKey::NONE)
}

/// Points in units of the basis vectors, many of them near borders of cells.
fn points() -> impl Strategy<Value = Vec<[f32; 3]>> {
    let quarters = prop::array::uniform3(-300..300_i32);
    let near_borders =
        (quarters, prop::array::uniform3(-9..9_i32), 0..2_u8).prop_map(|(quarters, off, all)| {
            // In a direction of the lattice, or off in all of them.
            let off = if all == 0 { [off[0], 0, 0] } else { off };
            [0, 1, 2].map(|i| quarters[i] as f32 * 0.25 + off[i] as f32 * 3e-6)
        });
    let any = prop::array::uniform3(prop_oneof![-1e3..1e3_f32, -1e6..1e6_f32, any::<f32>()]);
    prop::collection::vec(prop_oneof![3 => near_borders, 1 => any], 0..600)
}

fn transforms() -> impl Strategy<Value = Isometry3<f64>> {
    let angle = prop_oneof![Just(0.0), -3.0..3.0_f64];
    let shift = prop_oneof![Just(0.0), -10.0..10.0_f64, -1e5..1e5_f64];
    (angle, prop::array::uniform3(shift)).prop_map(|(angle, shift)| {
        let axis = Vector3::new(0.3, -0.5, 1.0).normalize();
        let rotation = UnitQuaternion::from_scaled_axis(axis * angle);
        Isometry3::from_parts(Translation3::from(Vector3::from(shift)), rotation)
    })
}

proptest! {
    #[test]
    fn a_batch_gives_what_single_points_give(lattice in lattices(), points in points(), transform in transforms()) {
        let side = lattice.cell_volume_m3().cbrt();
        let basis = lattice.generator().cast::<f32>();
        let points: Vec<[f32; 3]> = points.iter().map(|p| (basis * Vector3::from(*p)).into()).collect();
        let mut transform = transform;
        transform.translation.vector *= side;
        let mut answers = Vec::new();
        for simd in [Simd::Portable, Simd::Avx2] {
            let batch = BatchQuantizer::with_simd(&lattice, transform, simd);
            let mut codes = Vec::new();
            batch.codes(&points, &mut codes);
            let single: Vec<_> = points.iter().map(|&p| single(&lattice, &batch.transform(p))).collect();
            prop_assert_eq!(&codes, &single);
            let mut indices = vec![[7; 3]; points.len()];
            let bad = batch.indices(&points, &mut indices);
            prop_assert_eq!(bad, single.iter().position(|&code| code == BlockKey::NONE));
            for (&index, &code) in indices.iter().zip(&single) {
                prop_assert!(code == BlockKey::NONE || index == code.unpack());
            }
            let (mut sums, mut one_by_one) = (BatchSums::default(), BatchSums::default());
            batch.for_blocks_with_sums(&points, |block| sums.add(block.sums));
            sums.far = false;
            for (&p, &code) in points.iter().zip(&codes) {
                if code != BlockKey::NONE {
                    one_by_one.add(&batch.sums_of(p));
                }
            }
            prop_assert_eq!(sums, one_by_one);
            answers.push((codes, sums));
        }
        prop_assert_eq!(&answers[0], &answers[1]);
    }
}

#[test]
fn few_points_need_double_precision() {
    for kind in LatticeKind::ALL {
        let lattice = Lattice::new(kind, 0.001).unwrap();
        let shift = Translation3::new(1234.5, -3000.25, 77.0);
        let batch = BatchQuantizer::new(&lattice, shift.into());
        let kernel = batch.kernel.as_ref().unwrap();
        let points: Vec<[f32; 3]> = (0..20_000_u32)
            .map(|i| {
                [7_u32, 13, 17].map(|m| {
                    (i.wrapping_mul(2_654_435_761).wrapping_mul(m) >> 8) as f32 * 1e-5 - 80.0
                })
            })
            .collect();
        let undecided = points
            .iter()
            .filter(|p| (kernel.one)(&kernel.constants, **p).decided == 0);
        let share = undecided.count() as f64 / points.len() as f64;
        assert!(share < 0.02, "{kind}: {share}");
    }
}

#[test]
fn distances_are_those_of_the_points() {
    for kind in LatticeKind::ALL {
        let lattice = Lattice::new(kind, 0.125).unwrap();
        let batch = BatchQuantizer::new(&lattice, Isometry3::identity());
        for p in [
            [0.1, 0.2, 0.3],
            [7.3, -2.25, 0.5],
            [0.0; 3],
            [33.3, 44.4, -55.5_f32],
        ] {
            let exact = Vector3::from(p.map(f64::from));
            let center = lattice.center(lattice.quantize(&exact).unwrap());
            let sides = (exact - center).norm() / 0.5;
            let sums = batch.sums_of(p);
            assert!(
                (sums.distances as f64 / f64::from(STEPS) - sides).abs() < 1e-4,
                "{kind}"
            );
            assert!(
                (sums.squares as f64 / f64::from(STEPS) - sides * sides).abs() < 1e-4,
                "{kind}"
            );
        }
    }
}
