//! Lidar scans of a simulated street, some metres apart, registered without a start.

use lattice_core::registration::{CalibrationMap, Profile, SourceCloud, voxel_downsample};
use nalgebra::Point3;

use super::global_registration::register;
use super::many::Case;
use super::pairs::{by_name, columns, line, shared, trial};
use super::settings::Cell;
use super::trial::{Trial, WRONG};
use crate::AnyError;
use crate::report::{Report, Section};
use crate::simulate::town::{Lidar, Town, drive};

const CELL_SIDE_M: f64 = 0.3;
/// Distance within which the map has a point too, metres.
const SHARED_M: f64 = 0.5;
/// Share of common points that separates pairs of one place from others.
const OVERLAP: f64 = 0.3;
/// Distances of the scans, metres.
const APART_M: [f64; 4] = [5.0, 10.0, 20.0, 30.0];

/// Two scans of a town.
#[derive(Clone, Copy, Debug)]
pub struct Pair {
    lidar: (&'static str, Lidar),
    apart_m: f64,
    labelled: bool,
}

const LIDARS: [(&str, Lidar); 2] = [("64 beams", Lidar::HDL64), ("16 beams", Lidar::VLP16)];

impl Pair {
    /// Side of the cells that scans are thinned to, metres.
    pub const CELL_SIDE_M: f64 = CELL_SIDE_M;

    /// All pairs.
    pub fn all() -> Vec<Pair> {
        let of = |lidar| {
            let labels = move |apart_m| {
                [true, false].map(|labelled| Pair {
                    lidar,
                    apart_m,
                    labelled,
                })
            };
            APART_M.into_iter().flat_map(labels)
        };
        LIDARS.into_iter().flat_map(of).collect()
    }
}

impl Case for Pair {
    fn name(&self) -> String {
        let labels = if self.labelled { "labels" } else { "no labels" };
        format!("{}, {} m apart, {labels}", self.lidar.0, self.apart_m)
    }

    fn run(&self, cell: &Cell) -> Result<Trial, AnyError> {
        let town = Town::new(cell.seed);
        let [first, second] = drive(cell.seed, self.apart_m);
        let truth = first.inverse() * second;
        let scan = |pose, time| {
            let mut cloud = town.scan(pose, &self.lidar.1, time);
            if !self.labelled {
                cloud.labels.clear();
            }
            cloud
        };
        let map = voxel_downsample(&scan(&first, 0), CELL_SIDE_M);
        let map = CalibrationMap::new(map, CELL_SIDE_M)?;
        let cloud = scan(&second, 1);
        let thinned = voxel_downsample(&cloud, CELL_SIDE_M).points_m;
        let overlap = shared(&thinned, map.cloud(), &truth, SHARED_M);
        let cloud = SourceCloud {
            cloud,
            sensor_m: Some(Point3::origin()),
        };
        let found = register(&map, &[cloud], None, &Profile::Lidar.options());
        Ok(trial(cell, &found, &truth, &thinned, overlap))
    }
}

/// A table of the pairs by distance, and one by overlap.
pub fn town_report(trials: &[Trial]) -> Report {
    let mut scenes = by_name(trials.iter(), |trial| &trial.cell.scene);
    let of_overlap = |much: bool| {
        let is = |t: &&Trial| (t.overlap.unwrap_or(0.0) >= OVERLAP) == much;
        trials.iter().filter(is).collect::<Vec<_>>()
    };
    let percent = 100.0 * OVERLAP;
    let all = format!("all with {percent} % overlap");
    scenes.push((&all, of_overlap(true)));
    scenes.push(("all with less", of_overlap(false)));
    let rows = scenes.iter().map(|(name, of)| line(name, of));
    let title = "Lidar scans of a simulated street, without a start";
    let lead = format!(
        "Scans thinned to cells of {CELL_SIDE_M} m; right is within {} m and {} degrees; overlap is the share of points with \
         one of the other scan within {SHARED_M} m.",
        WRONG.m, WRONG.deg
    );
    let section = Section::of_table("town", title, &columns("pairs"), rows);
    Report::of_evaluation(title, lead, "town", vec![section])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_near_pair_is_found_and_told_as_right() {
        let pair = Pair {
            lidar: LIDARS[0],
            apart_m: 5.0,
            labelled: true,
        };
        let trial = pair.run(&pair.cell(0)).unwrap();
        assert!(trial.is_within(WRONG), "{trial:?}");
        assert!(trial.overlap.unwrap() > OVERLAP);
        let report = crate::report::markdown(&town_report(&[trial]));
        assert!(report.contains("all with 30 % overlap | 1 |"), "{report}");
    }
}
