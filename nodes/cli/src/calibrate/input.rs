//! Inputs of `lattice calibrate`: clouds, guesses, learned label confusions.

use std::fs;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::str::FromStr;

use lattice_core::pose::Axes;
use lattice_core::registration::{Confusion, SemanticCloud, SourceCloud, voxel_downsample};
use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion, Vector3};

use crate::CliResult;
use lattice_nodes::files::points::PointFileOptions;
use lattice_nodes::files::semantic::read_semantic;

/// Smallest default cell size of a point file map, metres.
const MIN_CELL_M: f64 = 0.05;
/// Default number of cells along the diagonal of a point file map.
const CELLS_A_DIAGONAL: f64 = 400.0;
/// Limit of cells per axis for thinning, at any position of the cloud.
const MOST_CELLS: f64 = 5e5;
/// Centroid distance from which clouds are registered about their centroid, m.
const FAR_M: f64 = 1000.0;
/// Largest confusion file, bytes.
const MAX_CONFUSION_BYTES: u64 = 1 << 20;

/// Typed `map_from_headset`.
#[derive(Clone, Debug)]
pub struct Guess(pub Isometry3<f64>);

/// Typed position, metres.
#[derive(Clone, Debug)]
pub struct Place(pub Point3<f64>);

impl FromStr for Guess {
    type Err = String;

    fn from_str(text: &str) -> Result<Guess, String> {
        let (place, rotation) = match numbers(text)?.as_slice() {
            &[x, y, z, yaw_deg] => {
                let yaw = Vector3::z() * yaw_deg.to_radians();
                ([x, y, z], UnitQuaternion::from_scaled_axis(yaw))
            }
            &[x, y, z, qx, qy, qz, qw] => {
                let quaternion = Quaternion::new(qw, qx, qy, qz);
                if (quaternion.norm() - 1.0).abs() > 0.01 {
                    return Err(format!("the quaternion has length {}", quaternion.norm()));
                }
                ([x, y, z], UnitQuaternion::from_quaternion(quaternion))
            }
            other => return Err(format!("{} numbers instead of 4 or 7", other.len())),
        };
        Ok(Guess(Isometry3::from_parts(
            Translation3::from(place),
            rotation,
        )))
    }
}

impl FromStr for Place {
    type Err = String;

    fn from_str(text: &str) -> Result<Place, String> {
        match numbers(text)?.as_slice() {
            &[x, y, z] => Ok(Place(Point3::new(x, y, z))),
            other => Err(format!("{} numbers instead of 3", other.len())),
        }
    }
}

fn numbers(text: &str) -> Result<Vec<f64>, String> {
    let words = text.split([' ', ',']).filter(|word| !word.is_empty());
    let number = |word: &str| {
        let value = word.parse::<f64>().ok().filter(|v| v.is_finite());
        value.ok_or_else(|| {
            format!(
                "{:?} is not a number",
                word.chars().take(40).collect::<String>()
            )
        })
    };
    words.map(number).collect()
}

/// Map and its cell size; point files are thinned to cells.
pub fn map(
    path: &Path,
    cell_side_m: Option<f64>,
    options: &PointFileOptions,
) -> CliResult<(SemanticCloud, f64)> {
    let file = read_semantic(path, options)?.with_points(path)?;
    if let (Some(side_m), None) = (file.cell_side_m, cell_side_m) {
        return Ok((file.cloud, side_m));
    }
    let size_m = size_m(&file.cloud);
    let side_m = cell_side_m.unwrap_or((size_m.norm() / CELLS_A_DIAGONAL).max(MIN_CELL_M));
    let least_m = size_m.max() / MOST_CELLS;
    if side_m < least_m {
        let here = path.display();
        let longest_m = size_m.max();
        return Err(format!(
            "cells of {side_m} m are too small for {here}, which is {longest_m:.1} m long: use {least_m:.1e} m or more \
             (`--cell`), or remove distant points"
        )
        .into());
    }
    Ok((voxel_downsample(&file.cloud, side_m), side_m))
}

/// Size of the bounding box of a cloud.
fn size_m(cloud: &SemanticCloud) -> Vector3<f64> {
    let mut low = Point3::from([f64::INFINITY; 3]);
    let mut high = Point3::from([f64::NEG_INFINITY; 3]);
    for point in &cloud.points_m {
        low = low.inf(point);
        high = high.sup(point);
    }
    high - low
}

/// Clouds relative to a point of their frame.
pub struct Scans {
    /// Points and sensors, relative to that point.
    pub scans: Vec<SourceCloud>,
    /// The point: the origin, or for distant clouds such as in UTM their centroid in whole metres.
    pub middle_m: Vector3<f64>,
}

/// Clouds in the axes of ROS.
pub fn headset_scans(
    paths: &[PathBuf],
    axes: Axes,
    sensor_m: Option<Point3<f64>>,
    options: &PointFileOptions,
) -> CliResult<Scans> {
    let read = |path: &PathBuf| -> CliResult<SourceCloud> {
        let mut cloud = read_semantic(path, options)?.with_points(path)?.cloud;
        for point in &mut cloud.points_m {
            *point = axes.point_to_ros(point);
        }
        Ok(SourceCloud { cloud, sensor_m })
    };
    let scans = paths.iter().map(read).collect::<CliResult<Vec<_>>>()?;
    Ok(Scans::about_middle(scans))
}

impl Scans {
    fn about_middle(mut scans: Vec<SourceCloud>) -> Self {
        let median = |axis: usize, _| {
            let points = scans.iter().flat_map(|scan| &scan.cloud.points_m);
            let mut values: Vec<f64> = points.filter_map(|p| p.coords.get(axis).copied()).collect();
            let middle = values.len() / 2;
            match values.get(middle) {
                None => 0.0,
                Some(_) => *values.select_nth_unstable_by(middle, f64::total_cmp).1,
            }
        };
        let mut middle_m = Vector3::from_fn(median).map(f64::round);
        if middle_m.norm() <= FAR_M {
            middle_m = Vector3::zeros();
        }
        for scan in &mut scans {
            for point in scan.cloud.points_m.iter_mut().chain(&mut scan.sensor_m) {
                *point -= middle_m;
            }
        }
        Self { scans, middle_m }
    }

    /// Pose of the clouds converted to a pose of their reference point.
    pub fn pose_of_middle(&self, map_from_cloud: &Isometry3<f64>) -> Isometry3<f64> {
        map_from_cloud * Translation3::from(self.middle_m)
    }
}

/// Label confusion learned by earlier calibrations, if the file exists.
pub fn confusion(path: &Path) -> CliResult<Option<Confusion>> {
    let here = |e: &dyn std::fmt::Display| format!("{}: {e}", path.display());
    let bytes = match fs::metadata(path) {
        Err(e) if e.kind() == ErrorKind::NotFound => return Ok(None),
        Err(e) => return Err(here(&e).into()),
        Ok(about) if about.len() > MAX_CONFUSION_BYTES => {
            return Err(here(&"too large for a learned confusion").into());
        }
        Ok(_) => fs::read(path).map_err(|e| here(&e))?,
    };
    let known: Confusion = serde_json::from_slice(&bytes).map_err(|e| here(&e))?;
    match known.is_valid() {
        true => Ok(Some(known)),
        false => Err(here(&"not a learned confusion").into()),
    }
}

/// Writes the learned confusion atomically.
pub fn keep_confusion(path: &Path, confusion: &Confusion) -> CliResult {
    let folder = path
        .parent()
        .filter(|folder| !folder.as_os_str().is_empty());
    let write = || -> CliResult {
        let mut file = tempfile::NamedTempFile::new_in(folder.unwrap_or(Path::new(".")))?;
        file.write_all(&serde_json::to_vec_pretty(confusion)?)?;
        file.persist(path)?;
        Ok(())
    };
    write().map_err(|e| format!("{}: {e}", path.display()).into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn guesses_are_a_heading_or_a_quaternion() {
        let a: Guess = "1 -2 0.5 90".parse().unwrap();
        let half = 0.5_f64.sqrt();
        let b: Guess = format!("1, -2, 0.5, 0, 0, {half}, {half}").parse().unwrap();
        assert!((a.0.to_homogeneous() - b.0.to_homogeneous()).norm() < 1e-12);
        assert!((a.0 * Point3::new(1.0, 0.0, 0.0) - Point3::new(1.0, -1.0, 0.5)).norm() < 1e-12);
        for (text, error) in [
            ("1 2 3", "3 numbers instead of 4 or 7"),
            ("1 2 3 x", "\"x\" is not a number"),
            ("1 2 3 inf", "\"inf\" is not a number"),
            ("0 0 0 0 0 0 2", "the quaternion has length 2"),
        ] {
            assert_eq!(text.parse::<Guess>().unwrap_err(), error);
        }
        assert_eq!(
            "1 2".parse::<Place>().unwrap_err(),
            "2 numbers instead of 3"
        );
    }

    #[test]
    fn clouds_that_are_far_away_are_taken_about_their_middle() {
        let cloud = |at: [f64; 3]| SourceCloud {
            cloud: SemanticCloud::unlabelled(vec![
                Point3::from(at) + Vector3::new(-3.0, 1.0, 0.25),
                Point3::from(at),
                Point3::from(at) + Vector3::new(5.0, -1.0, 0.5),
            ]),
            sensor_m: Some(Point3::from(at)),
        };
        let pose: Guess = "1 2 3 90".parse().unwrap();
        for (at, expected) in [
            ([999.0, 0.0, 0.0], [0.0; 3]),
            ([1001.0, 0.25, 0.0], [1001.0, 0.0, 0.0]),
            (
                [448_000.5, 5_411_000.25, 300.0],
                [448_001.0, 5_411_000.0, 300.0],
            ),
            ([-1e7, 0.0, 1e7], [-1e7, 0.0, 1e7]),
        ] {
            let before = cloud(at);
            let scans = Scans::about_middle(vec![before.clone()]);
            assert_eq!(scans.middle_m, Vector3::from(expected));
            let about = scans.pose_of_middle(&pose.0);
            let after = &scans.scans[0];
            let points = before.cloud.points_m.iter().zip(&after.cloud.points_m);
            for (old, new) in points.chain(before.sensor_m.iter().zip(&after.sensor_m)) {
                assert!((pose.0 * old - about * new).norm() < 1e-8);
            }
        }
        assert_eq!(Scans::about_middle(Vec::new()).middle_m, Vector3::zeros());
    }

    #[test]
    fn what_was_learned_is_kept_and_nonsense_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("learned.json");
        assert_eq!(confusion(&path).unwrap(), None);
        keep_confusion(&path, &Confusion::default()).unwrap();
        assert_eq!(confusion(&path).unwrap(), Some(Confusion::default()));
        for text in ["", "[]", "{\"pairs\":[[1,1,-5.0]]}"] {
            fs::write(&path, text).unwrap();
            let error = confusion(&path).unwrap_err().to_string();
            assert!(error.contains("learned.json"), "{error}");
        }
    }
}
