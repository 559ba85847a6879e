//! Drives of a spinning lidar through simulated scenes, with motion during each scan and the true poses.
//!
//! Everything depends on a scene and a seed alone.

mod route;
mod scans;
mod scenes;

pub use scans::{Drive, DriveScan};
pub use scenes::DriveScene;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scan_hits_what_stands_there_at_the_time_of_each_point() {
        let drive = Drive::new(DriveScene::Corridor, 1);
        let number = drive.scans().nth(30).unwrap();
        let scan = drive.scan(number);
        assert!(scan.points_m.len() > 1000);
        for (point, time_ns) in scan.points_m.iter().zip(&scan.times_ns) {
            let pose = drive.pose(*time_ns);
            let place = pose.rotation * point + pose.translation.vector;
            assert!(
                place.z > -0.2 && place.z < 3.2 && place.y.abs() < 1.6,
                "{place}"
            );
        }
        assert_eq!(scan.points_m, drive.scan(number).points_m);
    }

    #[test]
    fn every_scene_has_scans() {
        for scene in DriveScene::ALL {
            let drive = Drive::new(scene, 2);
            let numbers: Vec<i64> = drive.scans().collect();
            assert!(numbers.len() > 100, "{}", scene.name());
            assert!(
                !drive.scan(numbers[0]).points_m.is_empty(),
                "{}",
                scene.name()
            );
        }
    }
}
