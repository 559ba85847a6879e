//! Two lidar scans of a simulated street, with the truth.

use std::collections::BTreeMap;
use std::fmt;
use std::fs;
use std::path::PathBuf;

use lattice_nodes::files::atomic_write;
use serde::Serialize;

use super::house::{CLASSES_FILE, free_place};
use crate::labelled_ply::write_cloud;
use crate::simulate::town::{CLASSES, Lidar, Town, drive};
use crate::{AnyError, at};

/// Choices of a street.
#[derive(Clone, Debug)]
pub struct TownOptions {
    /// Folder of `map.ply`, `cloud.ply`, `map_from_cloud.txt` and `classes.yaml`.
    pub out: PathBuf,
    /// True if files that are there are replaced.
    pub overwrite: bool,
    /// The same seed gives the same bytes.
    pub seed: u64,
    /// Distance of the scans along the street, metres.
    pub apart_m: f64,
    /// The lidar of both scans.
    pub lidar: Lidar,
}

/// Summary of a written street.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TownSummary {
    /// The folder.
    pub out: PathBuf,
    /// Points of the two scans.
    pub points: [usize; 2],
}

impl fmt::Display for TownSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [map, cloud] = self.points;
        write!(
            f,
            "{}: map.ply {map} points, cloud.ply {cloud}",
            self.out.display()
        )
    }
}

/// Simulates a street and writes two scans of it, each in the frame of its sensor, and the pose of the second in
/// the first: 4 x 4 numbers, row by row.
pub fn write_town(options: &TownOptions) -> Result<TownSummary, AnyError> {
    fs::create_dir_all(&options.out).map_err(at(&options.out))?;
    let place = |name: &str| free_place(&options.out, name, options.overwrite);
    let town = Town::new(options.seed);
    let [first, second] = drive(options.seed, options.apart_m);
    let scans = [("map.ply", first, 0), ("cloud.ply", second, 1)];
    let mut points = [0; 2];
    for ((name, pose, time), points) in scans.into_iter().zip(&mut points) {
        let scan = town.scan(&pose, &options.lidar, time);
        *points = scan.len();
        let comment = "metres, sensor: x forward, y left, z up";
        write_cloud(&place(name)?, &scan.points_m, |i| scan.label(i), comment)?;
    }
    let truth = (first.inverse() * second).to_homogeneous();
    let row = |row: usize| {
        let numbers = [0, 1, 2, 3].map(|column| format!("{:.9}", truth[(row, column)]));
        numbers.join(" ") + "\n"
    };
    let text: String = [0, 1, 2, 3].map(row).concat();
    atomic_write::write_text(&place("map_from_cloud.txt")?, &text)?;
    let classes = BTreeMap::from([("classes", BTreeMap::from(CLASSES))]);
    let text = serde_yaml::to_string(&classes)?;
    atomic_write::write_text(&place(CLASSES_FILE)?, &text)?;
    let out = options.out.clone();
    Ok(TownSummary { out, points })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_street_is_written_once_and_the_same_each_time() {
        let folder = tempfile::tempdir().unwrap();
        let options = |name: &str| TownOptions {
            out: folder.path().join(name),
            overwrite: false,
            seed: 2,
            apart_m: 10.0,
            lidar: Lidar {
                shots: 60,
                ..Lidar::VLP16
            },
        };
        let (a, b) = (
            write_town(&options("a")).unwrap(),
            write_town(&options("b")).unwrap(),
        );
        assert_eq!(a.points, b.points);
        for name in ["map.ply", "cloud.ply", "map_from_cloud.txt", CLASSES_FILE] {
            let [a, b] = ["a", "b"].map(|of| fs::read(folder.path().join(of).join(name)).unwrap());
            assert!(!a.is_empty() && a == b, "{name}");
        }
        let again = write_town(&options("a")).unwrap_err().to_string();
        assert!(again.contains("map.ply"), "{again}");
    }
}
