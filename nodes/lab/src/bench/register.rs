//! Registering one cloud to another.

use super::timed;
use lattice_core::registration::{
    PrepareOptions, PreparedCloud, RegisterOptions, RegistrationError, SemanticCloud,
    register as run, voxel_downsample,
};
use nalgebra::Isometry3;
use serde::Serialize;

/// Options of a registration benchmark.
#[derive(Clone, Copy, Debug)]
pub struct RegisterSetup<'a> {
    /// Method with its tolerances.
    pub options: RegisterOptions<'a>,
    /// Preparation of the clouds.
    pub prepare: PrepareOptions,
    /// Side of the cells whose means are taken while the clock runs, m; `None` takes all points.
    pub cell_m: Option<f64>,
    /// Runs; one more goes before that is not counted.
    pub rounds: usize,
}

/// Times and result of a registration.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RegisterReport {
    /// System and variant.
    pub sys: String,
    /// Threads that it could use.
    pub threads: usize,
    /// Points that were registered, after thinning.
    pub source_points: usize,
    /// Points of the target, after thinning.
    pub target_points: usize,
    /// Wall time.
    pub wall: RegisterTimes,
    /// Processor time of all threads.
    pub cpu: RegisterTimes,
    /// 4 x 4 rows of the transform.
    pub target_from_source: [[f64; 4]; 4],
    /// True if it converged.
    pub converged: bool,
    /// Searches for pairs.
    pub iterations: usize,
    /// Source points with a pair.
    pub inliers: usize,
    /// Root mean square distance of the pairs, m.
    pub rmse_m: f64,
}

/// Times of each round, s.
#[derive(Clone, Debug, PartialEq, Default, Serialize)]
pub struct RegisterTimes {
    /// Thinning, trees and covariances of both clouds.
    pub prepare: Vec<f64>,
    /// The registration.
    pub register: Vec<f64>,
}

/// Prepares both clouds and registers them, again and again from the start.
pub fn register(
    name: &str,
    source: &SemanticCloud,
    target: &SemanticCloud,
    setup: &RegisterSetup,
) -> Result<RegisterReport, RegistrationError> {
    let thinned = |cloud: &SemanticCloud| match setup.cell_m {
        Some(cell_m) => voxel_downsample(cloud, cell_m),
        None => cloud.clone(),
    };
    let mut report = None;
    let (mut wall, mut cpu) = (RegisterTimes::default(), RegisterTimes::default());
    for round in 0..setup.rounds.max(1) + 1 {
        let (prepared, prepare) = timed(|| {
            let (source, target) = rayon::join(
                || PreparedCloud::new(thinned(source), &setup.prepare),
                || PreparedCloud::new(thinned(target), &setup.prepare),
            );
            Ok((source?, target?))
        });
        let (source, target) = prepared?;
        let start = Isometry3::identity();
        let (found, spent) = timed(|| run(&source, &target, &start, &setup.options));
        if round > 0 {
            wall.prepare.push(prepare.wall_s);
            wall.register.push(spent.wall_s);
            cpu.prepare.push(prepare.cpu_s);
            cpu.register.push(spent.cpu_s);
        }
        report = Some((found, source.len(), target.len()));
    }
    let (found, source_points, target_points) = report.ok_or(RegistrationError::TooFewPoints {
        points: 0,
        least: 1,
    })?;
    Ok(RegisterReport {
        sys: format!("lattice-{name}"),
        threads: rayon::current_num_threads(),
        source_points,
        target_points,
        wall,
        cpu,
        target_from_source: found.target_from_source.to_homogeneous().transpose().into(),
        converged: found.converged,
        iterations: found.iterations,
        inliers: found.inliers,
        rmse_m: found.rmse_m,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point3;

    #[test]
    fn a_report_tells_every_round_and_where_it_ended() {
        let place = |i: u32| {
            let (u, v) = (f64::from(i % 30) * 0.1, f64::from(i / 30 % 30) * 0.1);
            match i / 900 {
                0 => Point3::new(u, v, 0.0),
                1 => Point3::new(u, 0.0, v),
                _ => Point3::new(0.0, u, v),
            }
        };
        let target = SemanticCloud::unlabelled((0..2700).map(place).collect());
        let moved = |p: &Point3<f64>| p + nalgebra::Vector3::new(0.02, 0.0, 0.01);
        let source = SemanticCloud::unlabelled(target.points_m.iter().map(moved).collect());
        let setup = RegisterSetup {
            options: RegisterOptions::gicp(1.0),
            prepare: PrepareOptions::default(),
            cell_m: None,
            rounds: 3,
        };
        let report = register("gicp", &source, &target, &setup).unwrap();
        assert_eq!(report.wall.register.len(), 3);
        assert_eq!((report.source_points, report.target_points), (2700, 2700));
        assert!(report.converged);
        let [x, _, z] = [0, 1, 2].map(|row| report.target_from_source[row][3]);
        assert!((x + 0.02).abs().max((z + 0.01).abs()) < 1e-4, "{report:?}");
        let cell_m = Some(0.35);
        let setup = RegisterSetup { cell_m, ..setup };
        let report = register("gicp", &source, &target, &setup).unwrap();
        assert!(report.source_points < 500, "{report:?}");
    }
}
