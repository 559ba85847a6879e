//! Geodesy: round trips below a micrometre, and an independent library as the witness.

use lattice_core::geodesy::{
    EnuFrame, Geodetic, ecef_from_geodetic, enu_from_flu, geodetic_from_ecef,
    yaw_rad_from_azimuth_deg,
};
use map_3d::Ellipsoid;
use nalgebra::{Point3, Vector3};
use proptest::prelude::*;

const MICROMETRE: f64 = 1.0e-6;

fn place(heights: std::ops::Range<f64>) -> impl Strategy<Value = Geodetic> {
    let latitudes = prop_oneof![
        8 => -90.0..=90.0_f64,
        1 => -1.0e-9..=1.0e-9_f64,
        1 => (0.0..1.0e-7_f64).prop_map(|d| 90.0 - d),
        1 => (0.0..1.0e-7_f64).prop_map(|d| d - 90.0),
    ];
    (latitudes, -180.0..=180.0_f64, heights).prop_filter_map("a place", |(lat, lon, height)| {
        Geodetic::from_degrees(lat, lon, height).ok()
    })
}

fn offset(limit_m: f64) -> impl Strategy<Value = Vector3<f64>> {
    (-limit_m..limit_m, -limit_m..limit_m, -5_000.0..5_000.0_f64)
        .prop_map(|(e, n, u)| Vector3::new(e, n, u))
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(4096) })]

    #[test]
    fn ecef_round_trip_is_below_a_micrometre(p in place(-10_000.0..100_000.0)) {
        let ecef = ecef_from_geodetic(&p);
        let back = geodetic_from_ecef(&ecef).unwrap();
        prop_assert!((back.height_m - p.height_m).abs() < 1.0e-2 * MICROMETRE, "{p:?} {back:?}");
        prop_assert!((ecef_from_geodetic(&back) - ecef).norm() < 1.0e-2 * MICROMETRE, "{p:?} {back:?}");
    }

    #[test]
    fn the_whole_accepted_shell_round_trips(p in place(-99_000.0..9_900_000.0)) {
        let ecef = ecef_from_geodetic(&p);
        let back = geodetic_from_ecef(&ecef).unwrap();
        prop_assert!((ecef_from_geodetic(&back) - ecef).norm() < 0.1 * MICROMETRE, "{p:?} {back:?}");
    }

    #[test]
    fn enu_round_trip_within_100_km(origin in place(-500.0..9_000.0), enu in offset(70_000.0)) {
        let frame = EnuFrame::new(origin);
        let there = frame.geodetic_from_enu(&enu).unwrap();
        prop_assert!((frame.enu_from_geodetic(&there) - enu).norm() < 1.0e-2 * MICROMETRE);
    }

    #[test]
    fn ecef_agrees_with_an_independent_library(p in place(-10_000.0..100_000.0)) {
        let ours = ecef_from_geodetic(&p);
        let (x, y, z) = map_3d::geodetic2ecef(
            p.latitude_rad, p.longitude_rad, p.height_m, Ellipsoid::WGS84);
        prop_assert!((ours - Vector3::new(x, y, z)).norm() < 1.0e-2 * MICROMETRE);
    }

    #[test]
    fn enu_agrees_with_an_independent_library(origin in place(-500.0..9_000.0), enu in offset(70_000.0)) {
        let frame = EnuFrame::new(origin);
        let there = frame.geodetic_from_enu(&enu).unwrap();
        let (e, n, u) = map_3d::geodetic2enu(
            there.latitude_rad, there.longitude_rad, there.height_m,
            origin.latitude_rad, origin.longitude_rad, origin.height_m, Ellipsoid::WGS84);
        prop_assert!((frame.enu_from_geodetic(&there) - Vector3::new(e, n, u)).norm() < 1.0e-2 * MICROMETRE);
        prop_assert!((enu - Vector3::new(e, n, u)).norm() < MICROMETRE);
    }

    /// The witness takes a single step, which errs by 1.2 um at 100 km: up to 50 km it is
    /// below our bound.
    #[test]
    fn the_inverse_agrees_with_an_independent_library(
        lat in -89.0..89.0_f64, lon in -180.0..180.0_f64, height in -5_000.0..50_000.0_f64
    ) {
        let p = Geodetic::from_degrees(lat, lon, height).unwrap();
        let ecef = ecef_from_geodetic(&p);
        let ours = geodetic_from_ecef(&ecef).unwrap();
        let (lat_rad, lon_rad, height_m) =
            map_3d::ecef2geodetic(ecef.x, ecef.y, ecef.z, Ellipsoid::WGS84);
        let theirs = Geodetic { latitude_rad: lat_rad, longitude_rad: lon_rad, height_m };
        prop_assert!((ecef_from_geodetic(&theirs) - ecef_from_geodetic(&ours)).norm() < MICROMETRE,
            "{ours:?} {theirs:?}");
    }

    #[test]
    fn the_isometry_and_the_level_rotation_are_consistent(
        origin in place(-500.0..9_000.0), enu in offset(70_000.0)
    ) {
        let frame = EnuFrame::new(origin);
        let there = frame.geodetic_from_enu(&enu).unwrap();
        let local = EnuFrame::new(there);
        // Map from local level by way of the Earth equals the direct rotation.
        let by_earth = frame.ecef_from_enu().inverse() * local.ecef_from_enu();
        let direct = frame.enu_from_local_level(&there);
        let error = by_earth.rotation.to_rotation_matrix().matrix() - direct.to_rotation_matrix().matrix();
        prop_assert!(error.norm() < 1.0e-14, "{error}");
        let carried = by_earth * Point3::new(1.0, 2.0, 3.0);
        prop_assert!((carried.coords - (enu + direct * Vector3::new(1.0, 2.0, 3.0))).norm() < 1.0e-7);
        // Within 100 km the level turns by less than 100 km / 6 335 km about horizontal axes,
        // away from the poles where the meridians converge.
        if origin.latitude_rad.abs() < 1.2 {
            let up = direct * Vector3::z();
            prop_assert!(up.xy().norm() <= 100_000.0 / 6_335_000.0);
        }
    }

    #[test]
    fn garbage_is_refused_or_finite(x in any::<f64>(), y in any::<f64>(), z in any::<f64>(), scale in -1.0e7..1.0e7_f64) {
        for p in [Vector3::new(x, y, z), Vector3::new(x % 1.0, y % 1.0, z % 1.0) * scale] {
            if let Ok(found) = geodetic_from_ecef(&p) {
                prop_assert!(found.latitude_rad.is_finite() && found.longitude_rad.is_finite() && found.height_m.is_finite());
                prop_assert!((ecef_from_geodetic(&found) - p).norm() < MICROMETRE);
            }
        }
        if let Ok(found) = Geodetic::from_degrees(x, y, z) {
            prop_assert!(ecef_from_geodetic(&found).norm().is_finite());
        }
    }

    #[test]
    fn the_nose_points_along_azimuth_and_pitch(
        roll in -180.0..180.0_f64, pitch in -89.0..89.0_f64, azimuth in -720.0..720.0_f64
    ) {
        let nose = enu_from_flu(roll, pitch, azimuth) * Vector3::x();
        let (sin_a, cos_a) = azimuth.to_radians().sin_cos();
        let (sin_p, cos_p) = pitch.to_radians().sin_cos();
        let expected = Vector3::new(sin_a * cos_p, cos_a * cos_p, sin_p);
        prop_assert!((nose - expected).norm() < 1.0e-12);
        // The right side sinks with positive roll, however the nose points.
        let right = enu_from_flu(roll, pitch, azimuth) * -Vector3::y();
        prop_assert!((right.z + roll.to_radians().sin() * cos_p).abs() < 1.0e-12);
        let yaw = yaw_rad_from_azimuth_deg(azimuth);
        prop_assert!((yaw.cos() - sin_a).abs() < 1.0e-12 && (yaw.sin() - cos_a).abs() < 1.0e-12);
    }
}
