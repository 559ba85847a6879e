//! Counts of occupied cells against the theory of the cells, and the digest of keys.

use super::printed_formulas::unit;
use lattice_core::lattice::{BatchQuantizer, BlockKey, Lattice, LatticeKind, Simd};
use lattice_lab::bench::{self, QuantizeMethod, QuantizeOutput};
use lattice_lab::theory::{mean_width_m, surface_m2};
use lattice_test::random::Random;
use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use std::collections::HashSet;
use std::f64::consts::{PI, TAU};
use std::io::Write;

/// Cells that hold a point.
fn occupied(lattice: &Lattice, pose: Isometry3<f64>, points: &[[f32; 3]]) -> HashSet<BlockKey> {
    let mut codes = Vec::with_capacity(points.len());
    BatchQuantizer::new(lattice, pose).codes(points, &mut codes);
    codes.dedup();
    codes.into_iter().collect()
}

/// A disc, 30 cells across, of points `step` apart.
fn disc(step: f64) -> Vec<[f32; 3]> {
    let reach = (15.0 / step) as i32;
    let mut disc = Vec::new();
    for i in -reach..=reach {
        for j in -reach..=reach {
            let [x, y] = [i, j].map(|k| f64::from(k) * step);
            if x.hypot(y) < 15.0 {
                disc.push([x as f32, y as f32, 0.0]);
            }
        }
    }
    disc
}

/// Cells that such a disc occupies, the mean over normals that are spread evenly on a half sphere.
fn mean_count(kind: LatticeKind, disc: &[[f32; 3]]) -> f64 {
    const NORMALS: u32 = 200;
    let lattice = unit(kind);
    let mut random = Random(21);
    let mut cells = 0;
    for i in 0..NORMALS {
        let z = (f64::from(i) + 0.5) / f64::from(NORMALS);
        let (angle, flat) = (f64::from(i) * 2.399_963, (1.0 - z * z).sqrt());
        let normal = Vector3::new(flat * angle.cos(), flat * angle.sin(), z);
        let tilt = UnitQuaternion::rotation_between(&Vector3::z(), &normal).unwrap();
        let spin = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), TAU * random.unit());
        let pose = Isometry3::from_parts(random.point(20.0).into(), tilt * spin);
        cells += occupied(&lattice, pose, disc).len();
    }
    cells as f64 / f64::from(NORMALS)
}

#[test]
fn dense_planes_cut_as_many_cells_as_the_mean_width_says() {
    // Steiner's formula for a convex cell and a disc without gaps.
    let exact = |kind| {
        let lattice = unit(kind);
        let (radius, area) = (15.0, PI * 15.0 * 15.0);
        1.0 + surface_m2(&lattice) * PI * radius / 4.0 + mean_width_m(&lattice) * area
    };
    let (coarse, fine) = (disc(0.125), disc(0.0625));
    let cubic = mean_count(LatticeKind::Cubic, &fine);
    // Gaps miss corners, those of cubes most: the saving grows with the density, from that of 0.09
    // cells between points, which misses 3.7 % of the cubes, to that of the mean widths.
    for (kind, sampled, limit) in [
        (LatticeKind::Cubic, 0.0, 0.0),
        (LatticeKind::Bcc, -0.096, -0.1091),
        (LatticeKind::Fcc, -0.070, -0.0835),
        (LatticeKind::Mcc, -0.088, -0.1034),
    ] {
        let count = mean_count(kind, &fine);
        let missing = 1.0 - count / exact(kind);
        let missing_before = 1.0 - mean_count(kind, &coarse) / exact(kind);
        assert!((0.01..0.03).contains(&missing), "{kind}: {missing}");
        let less = missing / missing_before;
        assert!((0.4..0.65).contains(&less), "{kind}: {less}");
        // Means of 200 normals repeat to 0.2 %.
        let saving = count / cubic - 1.0;
        let between = limit - 0.002..sampled + 0.002;
        assert!(between.contains(&saving), "{kind}: {saving}");
    }
}

#[test]
fn the_key_stream_of_a_point_file_has_one_digest_on_every_machine() {
    let mut random = Random(5);
    let mut file = tempfile::NamedTempFile::new().unwrap();
    for i in 0..200_000 {
        let mut p = random.point(500.0).map(|x| x as f32);
        if i % 4 == 0 {
            // On borders of the cells, as sensors that report millimetres are.
            p = p.map(|x| (x * 100.0).round() / 100.0);
        }
        for value in [p.x, p.y, p.z, 0.0] {
            file.write_all(&value.to_le_bytes()).unwrap();
        }
    }
    file.flush().unwrap();
    let points = bench::read_points(file.path(), usize::MAX).unwrap();
    assert_eq!(points.len(), 200_000);
    let mut found = Vec::new();
    for kind in LatticeKind::ALL {
        let lattice = Lattice::new(kind, 0.008).unwrap();
        let keys = QuantizeOutput::Keys;
        let hash = |method| {
            bench::quantize(method, keys, &lattice, &points)
                .hash
                .unwrap()
        };
        let portable = hash(QuantizeMethod::Portable);
        assert_eq!(portable, hash(QuantizeMethod::Batch), "{kind}");
        assert_eq!(portable, hash(QuantizeMethod::Scalar), "{kind}");
        found.push(portable);
        // Turned, and from the frame of a sensor.
        let turned = lattice.oriented(UnitQuaternion::from_euler_angles(0.1, 0.2, 0.3));
        let pose = Isometry3::new(
            Vector3::new(300.0, -40.0, 5.0),
            Vector3::new(0.4, -0.2, 1.0),
        );
        let codes = |simd| {
            let mut codes = Vec::new();
            BatchQuantizer::with_simd(&turned, pose, simd).codes(&points, &mut codes);
            codes
        };
        assert_eq!(codes(Simd::Portable), codes(Simd::Avx2), "{kind}");
    }
    let recorded: [&str; 6] = [
        "c635e13a4b42c669",
        "2129c5076b3d905b",
        "daef51b4cecbb204",
        "67da4cbb21647658",
        "dbc09436cc8bf8d0",
        "9b5283dfb2ff78b9",
    ];
    assert_eq!(found, recorded);
}
