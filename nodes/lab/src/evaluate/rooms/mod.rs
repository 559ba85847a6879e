//! Rooms that a headset captured, mapped by a robot whose sensor is below or above their tables: what one of the two
//! sees from below the other sees from above.

mod capture;
mod report;
mod room;

pub use report::rooms_report;

use lattice_core::registration::{Calibration, CalibrationMap, CalibrationOptions, SemanticCloud};
use nalgebra::{Isometry3, Matrix3x6, Point3, Vector3};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::global_registration::register;
use super::many::Case;
use super::settings::{Cell, Settings};
use super::settings_of;
use super::trial::{OURS, Trial, rounded};
use super::views::any_pose;
use crate::AnyError;
use crate::mesh::LabelledMesh;
use crate::random::Stream;
use crate::simulate::house::Builder;
use room::{CELL_SIDE_M, Room};

/// Heights of the robot's sensor above the floor, metres.
const SENSORS: [(&str, Range<f64>); 2] = [("low", 0.4..0.6), ("high", 1.1..1.4)];

/// A room with a height of the robot's sensor.
pub struct RoomCase {
    room: Arc<Room>,
    sensor: (&'static str, Range<f64>),
}

impl RoomCase {
    /// Both sensors in each of the captured rooms, or in an office of our own without any; with the settings of their
    /// results.
    ///
    /// # Errors
    /// If a file is no capture.
    pub fn all(captures: &[PathBuf]) -> Result<(Vec<RoomCase>, Settings), AnyError> {
        let mut rooms = Vec::new();
        let mut settings = settings_of(CELL_SIDE_M);
        if captures.is_empty() {
            rooms.push(Room::new("office".to_owned(), &office()?)?);
        }
        let mut crc32 = crc32fast::Hasher::new();
        for path in captures {
            let (mesh, crc32_of_file) = capture::read_capture(path)?;
            let name = path.file_stem().unwrap_or(path.as_os_str());
            rooms.push(Room::new(name.to_string_lossy().into_owned(), &mesh)?);
            crc32.update(&crc32_of_file.to_le_bytes());
        }
        settings.mesh_crc32 = (!captures.is_empty()).then(|| crc32.finalize());
        let cases = rooms.into_iter().map(Arc::new).flat_map(|room| {
            SENSORS.map(|sensor| RoomCase {
                room: Arc::clone(&room),
                sensor,
            })
        });
        Ok((cases.collect(), settings))
    }
}

impl Case for RoomCase {
    fn name(&self) -> String {
        format!("{}, {} sensor", self.room.name, self.sensor.0)
    }

    fn run(&self, cell: &Cell) -> Result<Trial, AnyError> {
        let number = u64::from(crc32fast::hash(cell.scene.as_bytes()));
        let random = &mut Stream::numbered(cell.seed, number);
        let map = self.room.map(self.sensor.1.clone(), random)?;
        let map = CalibrationMap::new(map, CELL_SIDE_M)?;
        let truth = any_pose(random);
        let look = self.room.look(&truth, random)?;
        let seen_m = look.cloud.points_m.clone();
        let found = register(&map, &[look], None, &CalibrationOptions::default());
        Ok(Trial {
            middle: Some(middle(&found, &truth, &seen_m)),
            ..Trial::of_calibration(cell, OURS, &found, &truth, &seen_m)
        })
    }
}

/// Map of a robot in a captured room, in the frame of the capture with the axes of ROS; the robot's sensor is high.
///
/// # Errors
/// If the file is no capture, or the room has no place to stand.
pub fn map_of_capture(path: &Path, seed: u64) -> Result<SemanticCloud, AnyError> {
    let (mesh, _) = capture::read_capture(path)?;
    let name = path.display().to_string();
    let [_, (_, heights_m)] = SENSORS;
    Room::new(name, &mesh)?.map(heights_m, &mut Stream::numbered(seed, 0))
}

/// Distance of the middle of the seen points from the truth, metres, its stated standard deviation in that direction,
/// and the height of the middle above the truth.
fn middle(found: &Calibration, truth: &Isometry3<f64>, seen_m: &[Point3<f64>]) -> [f64; 3] {
    let sum: Vector3<f64> = seen_m.iter().map(|p| p.coords).sum();
    let middle = Point3::from(sum / seen_m.len().max(1) as f64);
    let pose = &found.target_from_source;
    let off = pose * middle - truth * middle;
    let arm = pose.rotation * middle.coords;
    let mut lever = Matrix3x6::zeros();
    lever.fixed_view_mut::<3, 3>(0, 0).fill_with_identity();
    lever
        .fixed_view_mut::<3, 3>(0, 3)
        .copy_from(&-arm.cross_matrix());
    let covariance = lever * found.covariance * lever.transpose();
    let along = off.try_normalize(1e-9).unwrap_or_else(Vector3::z);
    let sigma_m = along.dot(&(covariance * along)).max(0.0).sqrt();
    [off.norm(), sigma_m, off.z].map(rounded)
}

/// An office with a table whose board is as thick as a headset's mesh makes it: level surfaces are the board's, the
/// floor's and the ceiling's.
fn office() -> Result<LabelledMesh, AnyError> {
    let mut office = Builder::default();
    // Lowest and highest corners, metres. Walls are seen from inside.
    office
        .block([0.0; 3], [2.4, 2.5, 2.8])
        .block([0.0, 0.0, 0.62], [1.4, 0.7, 0.72])
        .block([0.05, 0.05, 0.0], [0.11, 0.65, 0.62])
        .block([1.3, 0.05, 0.0], [1.36, 0.65, 0.62])
        .block([2.1, 1.9, 0.0], [2.4, 2.5, 2.8]);
    office.build()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The first four were once OK and 0.08 to 0.10 m too low, with a stated deviation of 0.014 to 0.044 m.
    #[test]
    fn a_desk_that_two_see_from_opposite_sides_does_not_hold_the_height() {
        let (cases, settings) = RoomCase::all(&[]).unwrap();
        assert_eq!(settings.mesh_crc32, None);
        let [low, _] = &cases[..] else { panic!() };
        for seed in [0, 2, 9, 28] {
            let trial = low.run(&low.cell(seed)).unwrap();
            assert!(!trial.is_accepted(), "{trial:?}");
        }
        let trial = low.run(&low.cell(29)).unwrap();
        let [off_m, sigma_m, _] = trial.middle.unwrap();
        assert!(trial.is_accepted() && off_m < 0.02 && sigma_m < 0.02);
        let report = crate::report::markdown(&rooms_report(&[trial]));
        assert!(
            report.contains("office, low sensor | 1 | 1, 100 % | 0, 0 %"),
            "{report}"
        );
    }
}
