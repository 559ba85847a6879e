//! Follows a lidar through a room by its scans alone.
//!
//! `cargo run --release -p lattice_core --example 4_odometry_of_scans`

use std::error::Error;
use std::f64::consts::TAU;

use lattice_core::nalgebra::{Isometry3, Vector3};
use lattice_core::odometry::{Odometry, OdometryOptions, Prior, Scan, Verdict};

const SCANS: u32 = 30;
const PERIOD_NS: i64 = 100_000_000;

/// Pose of the lidar at each scan: a curve of 3 m at 1 m/s.
fn map_from_lidar(scan: u32) -> Isometry3<f64> {
    let angle = 0.02 * f64::from(scan);
    let place_m = Vector3::new(5.0 * angle.sin() - 2.0, 5.0 * (1.0 - angle.cos()), 1.2);
    Isometry3::new(place_m, Vector3::z() * angle)
}

/// Points on the inside of a hall of 18 m x 12 m x 4 m, in the frame of the lidar.
fn scan_from(map_from_lidar: &Isometry3<f64>) -> Vec<Vector3<f64>> {
    let (low_m, high_m) = (Vector3::new(-8.0, -5.0, 0.0), Vector3::new(10.0, 7.0, 4.0));
    let eye_m = map_from_lidar.translation.vector;
    let ray = |azimuth: f64, elevation: f64| {
        let (s, c) = elevation.sin_cos();
        let direction = Vector3::new(c * azimuth.cos(), c * azimuth.sin(), s);
        let ahead = map_from_lidar.rotation * direction;
        let wall = |i: usize| {
            let plane_m = if ahead[i] < 0.0 { low_m[i] } else { high_m[i] };
            (plane_m - eye_m[i]) / ahead[i]
        };
        direction * (0..3).map(wall).fold(f64::INFINITY, f64::min)
    };
    let beams = (0..16).map(|beam| (2.0 * f64::from(beam) - 15.0).to_radians());
    let shots = |elevation| (0..360).map(move |i| ray(TAU * f64::from(i) / 360.0, elevation));
    beams.flat_map(shots).collect()
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut odometry = Odometry::new(OdometryOptions::default());
    let mut certain = 0;
    let mut error_m = f64::INFINITY;
    for i in 0..SCANS {
        let points_m = scan_from(&map_from_lidar(i));
        let scan = Scan {
            points_m: &points_m,
            times_ns: None,
            stamp_ns: i64::from(i) * PERIOD_NS,
        };
        let result = odometry.register(&scan, &Prior::default())?;
        certain += u32::from(result.verdict == Verdict::Ok);
        let truth = map_from_lidar(0).inverse() * map_from_lidar(i);
        let apart_m = result.odom_from_base.translation.vector - truth.translation.vector;
        error_m = apart_m.norm();
    }
    println!(
        "{certain} of {SCANS} poses are certain; the last is {:.1} cm off",
        100.0 * error_m
    );
    // The first scans are taken at one place, where no motion confirms the map.
    assert!(certain >= SCANS - 15, "{certain}");
    assert!(error_m < 0.05, "{error_m} m");
    Ok(())
}
