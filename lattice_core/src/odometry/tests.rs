//! Loops through simulated rooms.

use std::f64::consts::TAU;

use nalgebra::Vector6;

use super::*;
use crate::pose::se3;

/// Boxes that a lidar sees from inside (the first) and from outside (the others): low and high corners, metres.
struct Scene(Vec<[Vector3<f64>; 2]>);

struct Lidar {
    beams: usize,
    shots: usize,
    noise_m: f64,
}

const VLP16: Lidar = Lidar {
    beams: 16,
    shots: 360,
    noise_m: 0.02,
};
const TURN_NS: i64 = 100_000_000;

fn room() -> Scene {
    let corners = |low: [f64; 3], high: [f64; 3]| [Vector3::from(low), Vector3::from(high)];
    let mut boxes = vec![corners([-10.0, -7.0, 0.0], [10.0, 7.0, 3.0])];
    for (x, y, size) in [
        (-5.0, -3.0, 1.0),
        (4.0, 2.5, 1.5),
        (1.0, -5.0, 0.8),
        (-2.0, 4.0, 0.6),
    ] {
        boxes.push(corners([x, y, 0.0], [x + size, y + size, 2.0]));
    }
    Scene(boxes)
}

/// A tunnel without features along x.
fn tunnel() -> Scene {
    let low = Vector3::new(-500.0, -4.0, 0.0);
    Scene(vec![[low, Vector3::new(500.0, 4.0, 5.0)]])
}

/// Reproducible noise of unit variance.
fn noise(state: &mut u64) -> f64 {
    let mut uniform = || {
        *state = state
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (*state >> 11) as f64 / (1_u64 << 53) as f64
    };
    (0..12).map(|_| uniform()).sum::<f64>() - 6.0
}

impl Scene {
    fn cast(&self, eye: &Vector3<f64>, way: &Vector3<f64>) -> f64 {
        let spans = self.0.iter().enumerate().map(|(i, corners)| {
            let (mut near, mut far) = (f64::NEG_INFINITY, f64::INFINITY);
            for axis in 0..3 {
                let [a, b] = corners.map(|corner| (corner[axis] - eye[axis]) / way[axis]);
                near = near.max(a.min(b));
                far = far.min(a.max(b));
            }
            match i {
                0 => far,
                _ if near > 0.0 && near < far => near,
                _ => f64::INFINITY,
            }
        });
        spans.fold(f64::INFINITY, f64::min)
    }

    /// Points in the frame of the moving base, and their times; the turn ends at `end_ns`.
    fn scan(
        &self,
        lidar: &Lidar,
        pose_at: impl Fn(f64) -> Isometry3<f64>,
        end_ns: i64,
        seed: u64,
    ) -> (Vec<Vector3<f64>>, Vec<i64>) {
        let mut state = seed.wrapping_mul(77) + 1;
        let (mut points, mut times) = (Vec::new(), Vec::new());
        for shot in 0..lidar.shots {
            let time_ns = end_ns - TURN_NS + TURN_NS * (shot as i64 + 1) / lidar.shots as i64;
            let pose = pose_at(time_ns as f64 * 1e-9);
            let azimuth = TAU * shot as f64 / lidar.shots as f64;
            for beam in 0..lidar.beams {
                let part = beam as f64 / (lidar.beams - 1) as f64;
                let elevation = (30.0 * part - 15.0).to_radians();
                let (c, s) = (elevation.cos(), elevation.sin());
                let way = Vector3::new(azimuth.cos() * c, azimuth.sin() * c, s);
                let range = self.cast(&pose.translation.vector, &(pose.rotation * way));
                let range = range + lidar.noise_m * noise(&mut state);
                if range < 80.0 {
                    points.push(way * range);
                    times.push(time_ns);
                }
            }
        }
        (points, times)
    }
}

/// Two turns of a loop of 4 m radius in the room, at 1.2 m/s.
fn loop_at(seconds: f64) -> Isometry3<f64> {
    let velocity = Vector6::new(1.2, 0.0, 0.0, 0.0, 0.0, 0.3);
    Isometry3::translation(0.0, -4.0, 1.2) * se3::exp(&(velocity * seconds))
}

/// Results with the true poses at their times, both since the first.
fn drive(
    scene: &Scene,
    pose_at: impl Fn(f64) -> Isometry3<f64> + Copy,
    scans: i64,
) -> Vec<(ScanResult, Isometry3<f64>)> {
    let mut odometry = Odometry::new(OdometryOptions::default());
    let start = pose_at(TURN_NS as f64 * 1e-9);
    let results = (1..=scans).map(|i| {
        let end_ns = i * TURN_NS;
        let (points, times) = scene.scan(&VLP16, pose_at, end_ns, i as u64);
        let scan = Scan {
            points_m: &points,
            times_ns: Some(&times),
            stamp_ns: end_ns,
        };
        let result = odometry.register(&scan, &Prior::default()).unwrap();
        (result, start.inverse() * pose_at(end_ns as f64 * 1e-9))
    });
    results.collect()
}

fn error_m((result, truth): &(ScanResult, Isometry3<f64>)) -> f64 {
    (result.odom_from_base.translation.vector - truth.translation.vector).norm()
}

#[test]
fn a_loop_in_a_room_closes_to_centimetres() {
    let results = drive(&room(), loop_at, 215);
    let worst = results.iter().map(error_m).fold(0.0, f64::max);
    // 1.2 m/s leave the first place in three scans.
    let verdicts = results.iter().map(|(result, _)| &result.verdict);
    let not_ok: Vec<_> = verdicts.filter(|v| **v != Verdict::Ok).collect();
    assert!(not_ok.len() <= 3, "{not_ok:?}");
    assert!(
        not_ok
            .iter()
            .all(|v| **v == Verdict::Lost(LostCause::OnePlace))
    );
    assert!(worst < 0.05, "{worst} m");
}

#[test]
fn a_tunnel_without_features_is_not_ok() {
    let along = |seconds: f64| Isometry3::translation(seconds * 8.0, 0.3, 1.7);
    let results = drive(&tunnel(), along, 60);
    for (result, _) in &results {
        assert!(result.verdict != Verdict::Ok, "{result:?}");
    }
}

#[test]
fn threads_change_no_bit() {
    let of = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.unwrap().install(|| drive(&room(), loop_at, 12))
    };
    assert_eq!(of(1), of(2));
}

#[test]
fn a_blank_sensor_is_lost_and_found_again_in_the_same_map() {
    let mut odometry = Odometry::new(OdometryOptions::default());
    let start = loop_at(TURN_NS as f64 * 1e-9);
    for i in 1..=40 {
        let end_ns = i * TURN_NS;
        let (mut points, mut times) = room().scan(&VLP16, loop_at, end_ns, i as u64);
        let is_blank = (20..24).contains(&i);
        if is_blank {
            (points, times) = (Vec::new(), Vec::new());
        }
        let scan = Scan {
            points_m: &points,
            times_ns: Some(&times),
            stamp_ns: end_ns,
        };
        let result = odometry.register(&scan, &Prior::default()).unwrap();
        if i <= 3 {
            continue;
        }
        let few = Verdict::Lost(LostCause::FewPoints);
        assert_eq!(result.verdict == few, is_blank, "{i}: {result:?}");
        assert!(is_blank || result.verdict == Verdict::Ok, "{i}: {result:?}");
        let truth = start.inverse() * loop_at(end_ns as f64 * 1e-9);
        assert!(is_blank || error_m(&(result, truth)) < 0.05, "{i}");
    }
}
