//! Registers two clouds of a room by GICP.
//!
//! `cargo run --release -p lattice_core --example 3_register_two_clouds`

use std::error::Error;

use lattice_core::nalgebra::{Isometry3, Point3, Vector3};
use lattice_core::registration::{
    PrepareOptions, PreparedCloud, RegisterOptions, SemanticCloud, register,
};

/// A corner of a room with a box in it; `phase` chooses the points of the surfaces.
fn room(phase: f64) -> Vec<Point3<f64>> {
    let fraction = |i: u32, step: f64| (phase + f64::from(i) * step).fract();
    let point = |i| {
        let (u, v) = (fraction(i, 0.754_877_7), fraction(i, 0.569_840_3));
        match i % 5 {
            0 => Point3::new(4.0 * u, 3.0 * v, 0.0),
            1 => Point3::new(4.0 * u, 0.0, 2.5 * v),
            2 => Point3::new(0.0, 3.0 * u, 2.5 * v),
            3 => Point3::new(1.5 + 0.8 * u, 1.0 + 0.5 * v, 0.75),
            _ => Point3::new(1.5 + 0.8 * u, 1.0, 0.75 * v),
        }
    };
    (0..10_000).map(point).collect()
}

/// A cloud with its k-d tree and covariances.
fn prepare(points_m: Vec<Point3<f64>>) -> Result<PreparedCloud, Box<dyn Error>> {
    let cloud = SemanticCloud::unlabelled(points_m);
    Ok(PreparedCloud::new(cloud, &PrepareOptions::default())?)
}

fn main() -> Result<(), Box<dyn Error>> {
    // The source is the room seen from another pose, with other points of the same surfaces.
    let shift_m = Vector3::new(0.3, -0.2, 0.1);
    let target_from_source = Isometry3::new(shift_m, Vector3::new(0.02, -0.03, 0.1));
    let seen = room(0.37).into_iter();
    let seen = seen.map(|p| target_from_source.inverse() * p);
    let (source, target) = (prepare(seen.collect())?, prepare(room(0.0))?);

    let gate_m = 1.0;
    let options = RegisterOptions::gicp(gate_m);
    let found = register(&source, &target, &Isometry3::identity(), &options);

    let error = target_from_source.inverse() * found.target_from_source;
    let (error_m, error_rad) = (error.translation.vector.norm(), error.rotation.angle());
    println!(
        "{} iterations, {} inliers, errors {:.1} mm and {:.2} mrad",
        found.iterations,
        found.inliers,
        1e3 * error_m,
        1e3 * error_rad
    );
    assert!(found.converged && error_m < 0.01 && error_rad < 0.005);
    Ok(())
}
