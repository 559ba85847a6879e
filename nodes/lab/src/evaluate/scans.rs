//! Parts of a scan, calibrated in another scan of the same place: real data, whose truth is where the whole scan lies.

use lattice_core::registration::{
    Calibration, CalibrationMap, CalibrationOptions, SemanticCloud, SourceCloud, Verdict,
    voxel_downsample,
};
use nalgebra::{Isometry3, Point3};

use super::Settings;
use super::global_registration::register;
use super::many::{Case, settings_of};
use super::pairs::{columns, line, of_scenes_and_all, shared, trial};
use super::settings::Cell;
use super::trial::{Trial, WRONG};
use super::views::{any_pose, keep_sector};
use crate::AnyError;
use crate::options::within;
use crate::random::Stream;
use crate::report::{Report, Section};

/// Distance up to which a point has a counterpart in the map, in cells.
const SHARED_CELLS: f64 = 2.0;

/// Two scans of a place and the pose of one in the other.
pub struct Scans {
    map: CalibrationMap,
    cell_side_m: f64,
    scan: SourceCloud,
    map_from_scan: Isometry3<f64>,
    options: CalibrationOptions,
}

/// Partial scan: a sector of the full circle.
#[derive(Clone, Copy)]
pub struct Part<'a> {
    scans: &'a Scans,
    width_deg: f64,
}

impl Scans {
    /// Creates the pair with the given pose of the second scan, or with the result of a calibration of all its
    /// points.
    ///
    /// The sensor stands at the origin of the scan unless its place is given.
    ///
    /// # Errors
    /// If the map has no points, or no pose is given and the calibration is not OK.
    pub fn new(
        (map, cell_side_m): (SemanticCloud, f64),
        scan: SourceCloud,
        map_from_scan: Option<Isometry3<f64>>,
        options: CalibrationOptions,
    ) -> Result<Scans, AnyError> {
        let mut scans = Scans {
            map: CalibrationMap::new(map, cell_side_m)?,
            cell_side_m,
            scan: SourceCloud {
                sensor_m: scan.sensor_m.or(Some(Point3::origin())),
                ..scan
            },
            map_from_scan: Isometry3::identity(),
            options,
        };
        scans.map_from_scan = match map_from_scan {
            Some(pose) => pose,
            None => scans.of_all_points()?,
        };
        Ok(scans)
    }

    fn of_all_points(&self) -> Result<Isometry3<f64>, AnyError> {
        let found = self.find(&self.scan);
        match found.verdict {
            Verdict::Ok => Ok(found.target_from_source),
            verdict => Err(format!(
                "no pose of the whole scan, verdict {}: {}; give it by --truth FILE",
                verdict.name(),
                found.reason
            )
            .into()),
        }
    }

    /// Partial scans with the given sector angles, degrees.
    ///
    /// # Errors
    /// Sector angle outside 1..=360.
    pub fn parts(&self, widths_deg: &[f64]) -> Result<Vec<Part<'_>>, AnyError> {
        for width in widths_deg {
            within("widths", *width, 1.0, 360.0)?;
        }
        let part = |width_deg: &f64| Part {
            scans: self,
            width_deg: *width_deg,
        };
        Ok(widths_deg.iter().map(part).collect())
    }

    /// Settings that results are stored with: scans, poses and options.
    pub fn settings(&self) -> Settings {
        let mut hash = crc32fast::Hasher::new();
        for point in self
            .map
            .cloud()
            .points_m()
            .iter()
            .chain(&self.scan.cloud.points_m)
        {
            point.iter().for_each(|x| hash.update(&x.to_le_bytes()));
        }
        let of_map = (0..self.map.cloud().len()).map(|i| self.map.cloud().label(i));
        for label in of_map.chain(self.scan.cloud.labels.iter().cloned()) {
            hash.update(format!("{label:?}").as_bytes());
        }
        let (pose, sensor_m) = (&self.map_from_scan, &self.scan.sensor_m);
        hash.update(format!("{pose:?} {sensor_m:?} {:?}", self.options).as_bytes());
        Settings {
            scans_crc32: Some(hash.finalize()),
            ..settings_of(self.cell_side_m)
        }
    }

    fn find(&self, scan: &SourceCloud) -> Calibration {
        register(&self.map, std::slice::from_ref(scan), None, &self.options)
    }
}

impl Case for Part<'_> {
    fn name(&self) -> String {
        format!("{} degrees", self.width_deg)
    }

    fn run(&self, cell: &Cell) -> Result<Trial, AnyError> {
        let scans = self.scans;
        let number = u64::from(crc32fast::hash(cell.scene.as_bytes()));
        let random = &mut Stream::numbered(cell.seed, number);
        let look_from_scan = any_pose(random);
        let mut look = scans.scan.clone();
        keep_sector(&mut look, 0.5 * self.width_deg.to_radians(), random);
        let points = look.cloud.points_m.iter_mut().chain(&mut look.sensor_m);
        points.for_each(|p| *p = look_from_scan * *p);
        let truth = scans.map_from_scan * look_from_scan.inverse();
        let found = scans.find(&look);
        let thinned = voxel_downsample(&look.cloud, scans.cell_side_m).points_m;
        let shared_m = SHARED_CELLS * scans.cell_side_m;
        let overlap = shared(&thinned, scans.map.cloud(), &truth, shared_m);
        Ok(trial(cell, &found, &truth, &thinned, overlap))
    }
}

/// Table of results by sector angle.
pub fn scans_report(trials: &[Trial]) -> Report {
    let scenes = of_scenes_and_all(trials);
    let rows = scenes.iter().map(|(name, of)| line(name, of));
    let title = "Parts of a scan in another scan of the place, without a start";
    let lead = format!(
        "Each part is moved and turned at random first. Right is within {} m and {} degrees of where the whole scan lies; \
         overlap is the share of points with one of the other scan within {SHARED_CELLS} cells.",
        WRONG.m, WRONG.deg
    );
    let section = Section::of_table("scans", title, &columns("part of the circle"), rows);
    Report::of_evaluation(title, lead, "scans", vec![section])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::rooms::Flat;

    fn scans(map_from_scan: Option<Isometry3<f64>>) -> Result<Scans, AnyError> {
        let flat = Flat::room(5.0, 4.0).with_box([0.8, 0.3], [0.6, 1.2, 0.8]);
        let random = &mut Stream::numbered(1, 1);
        let uniform = &mut || random.uniform();
        let map = flat.noisy_map(uniform);
        let pose = Isometry3::translation(0.3, 0.2, 0.0);
        let mut scan = flat.all_around([-0.5, 0.2], &pose, uniform);
        scan.cloud.labels.clear();
        Scans::new(
            (map, 0.05),
            scan,
            map_from_scan,
            CalibrationOptions::default(),
        )
    }

    #[test]
    fn parts_are_found_where_the_whole_scan_lies() {
        let scans = scans(None).unwrap();
        assert!(scans.map_from_scan.translation.vector.xy().norm() < 0.4);
        let parts = scans.parts(&[360.0, 200.0]).unwrap();
        let trials: Vec<Trial> = parts.iter().map(|p| p.run(&p.cell(0)).unwrap()).collect();
        assert!(
            trials[0].is_accepted() && trials[0].is_within(WRONG),
            "{trials:?}"
        );
        assert_ne!(trials[0].judged, trials[1].judged);
        let report = crate::report::markdown(&scans_report(&trials));
        assert!(report.contains("360 degrees | 1 | 1, 100 %"), "{report}");
        assert!(scans.parts(&[0.0]).is_err());
    }

    #[test]
    fn results_of_other_poses_are_not_continued() {
        let [one, other] = [0.0, 0.1].map(|x| scans(Some(Isometry3::translation(x, 0.0, 0.0))));
        let [one, other] = [one, other].map(|scans| scans.unwrap().settings());
        assert_ne!(one, other);
    }
}
