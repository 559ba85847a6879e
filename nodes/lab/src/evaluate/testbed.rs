//! The testbed of the trials: the house, the robot's maps of it and the views of the headset.

use super::settings::{Pivot, Settings};
use super::statistics::quantile;
use crate::AnyError;
use crate::options::within;
use crate::random::seed_of;
use crate::simulate::house::{
    HeadsetTrial, House, HouseScan, LabelDraw, Scene, Survey, SurveyMap, SurveyOptions,
};
use lattice_core::lattice::{Lattice, LatticeKind};
use lattice_core::registration::{
    CalibrationMap, PrepareOptions, PreparedCloud, SemanticCloud, SourceCloud, voxel_downsample,
};
use nalgebra::{Isometry3, Point3, Vector3};
use std::sync::OnceLock;

/// Purposes of seeds.
const LABELS: u64 = 1;
const SURVEY: u64 = 2;
const VIEW: u64 = 3;

/// A house with the maps of several surveys, shared by all trials.
pub struct Testbed {
    house: House,
    settings: Settings,
    lattice: Lattice,
    surveys: Vec<OnceLock<Result<SurveyMap, String>>>,
}

pub struct View {
    scene: Scene,
    seed: u64,
    trial: HeadsetTrial,
}

/// A view and a map with the labels of one draw.
pub struct Scenario {
    /// Prepared map; also the target of single registrations.
    pub map: CalibrationMap,
    pub headset_scans: Vec<SourceCloud>,
    /// All points of the headset as one cloud.
    pub full: PreparedCloud,
    /// The cloud thinned to the cells of the map: the source of single registrations.
    pub source: PreparedCloud,
    /// Point at which starts are moved and turned, in the headset's frame.
    pub pivot_m: Point3<f64>,
    pub truth: Isometry3<f64>,
    /// Share of the view whose labels differ between map and headset.
    pub different_share: f64,
}

impl Testbed {
    /// A testbed in a house.
    pub fn new(house: House, settings: &Settings) -> Result<Testbed, AnyError> {
        within("maps", settings.map_seeds as f64, 1.0, 1000.0)?;
        within("view part", settings.view_part, 0.01, 1.0)?;
        let cell_volume_m3 = settings.cell_side_m.powi(3);
        Ok(Testbed {
            lattice: Lattice::new(LatticeKind::Cubic, cell_volume_m3)?,
            surveys: (0..settings.map_seeds).map(|_| OnceLock::new()).collect(),
            settings: settings.clone(),
            house,
        })
    }

    pub(crate) fn house(&self) -> &House {
        &self.house
    }

    pub(crate) fn view(&self, scene: Scene, seed: u64) -> Result<View, AnyError> {
        let scans = self.settings.headset_scans;
        let trial = HeadsetTrial::new(&self.house, scene, scans, seed_of(&[VIEW, seed]))?;
        Ok(View { scene, seed, trial })
    }

    /// The view and the map with a share `q` of the view labelled wrongly.
    pub(crate) fn scenario(&self, view: &View, q: f64) -> Result<Scenario, AnyError> {
        // The same for every q, so that the wrong regions of a small q are wrong at a larger one too.
        let seed = seed_of(&[LABELS, view.seed, view.scene as u64]);
        let draw = LabelDraw::new(&self.house, std::slice::from_ref(&view.trial), q, seed)?;
        let map = self.survey(view.seed)?.cloud(&draw.map);
        let scan = |scan: &HouseScan| SourceCloud {
            cloud: left_part(
                draw.headset.cloud(&scan.points_m, &scan.regions),
                &scan.sensor_m,
                self.settings.view_part,
            ),
            sensor_m: Some(scan.sensor_m),
        };
        let headset_scans: Vec<SourceCloud> = view.trial.headset_scans.iter().map(scan).collect();
        let mut all = SemanticCloud::default();
        for headset_scan in &headset_scans {
            all.points_m.extend_from_slice(&headset_scan.cloud.points_m);
            all.labels.extend_from_slice(&headset_scan.cloud.labels);
        }
        let middle = all.points_m.iter().map(|p| p.coords).sum::<Vector3<f64>>();
        let pivot_m = match self.settings.pivot {
            Pivot::View => Some((middle / all.len().max(1) as f64).into()),
            Pivot::Headset => view.trial.headset_scans.first().map(|scan| scan.sensor_m),
        };
        let thinned = voxel_downsample(&all, self.settings.cell_side_m);
        let map = CalibrationMap::new(map, self.settings.cell_side_m)?;
        Ok(Scenario {
            map,
            headset_scans,
            source: PreparedCloud::new(thinned, &PrepareOptions::default())?,
            full: PreparedCloud::new(all, &PrepareOptions::default())?,
            pivot_m: pivot_m.unwrap_or_default(),
            truth: view.trial.map_from_headset,
            different_share: draw.different_share,
        })
    }

    /// The robot's map for a seed, surveyed when it is first needed.
    fn survey(&self, seed: u64) -> Result<&SurveyMap, AnyError> {
        let number = seed % self.surveys.len() as u64;
        let make = || -> Result<SurveyMap, AnyError> {
            let options = SurveyOptions {
                views: self.settings.survey_views,
                ..SurveyOptions::default()
            };
            let survey = Survey::new(&self.house, &options, seed_of(&[SURVEY, number]))?;
            SurveyMap::new(&survey, &self.lattice)
        };
        let slot = self.surveys.get(number as usize);
        let slot = slot.ok_or("no map of that number")?;
        let made = slot.get_or_init(|| make().map_err(|error| error.to_string()));
        made.as_ref().map_err(|error| error.clone().into())
    }
}

/// The leftmost points of a picture taken from a place, a share of all.
fn left_part(mut cloud: SemanticCloud, sensor_m: &Point3<f64>, part: f64) -> SemanticCloud {
    if part >= 1.0 {
        return cloud;
    }
    let ahead: Vector3<f64> = cloud.points_m.iter().map(|p| p - sensor_m).sum();
    let to_right_rad = |p: &Point3<f64>| {
        let way = p - sensor_m;
        (way.x * ahead.y - way.y * ahead.x).atan2(way.dot(&ahead))
    };
    if let Some(most_rad) = quantile(cloud.points_m.iter().map(to_right_rad), part) {
        cloud.retain(|p| to_right_rad(p) < most_rad);
    }
    cloud
}

#[cfg(test)]
mod tests {
    use super::*;
    use lattice_core::registration::LabelDistribution;

    #[test]
    fn half_a_picture_is_its_left_half() {
        let sensor_m = Point3::new(1.0, 1.0, 0.0);
        let y = (-50..50).map(|i| 0.01 + 0.02 * f64::from(i));
        let points_m: Vec<Point3<f64>> = y.map(|y| Point3::new(3.0, 1.0 + y, 0.5)).collect();
        let labels = points_m
            .iter()
            .map(|p| LabelDistribution::hard(u16::from(p.y > 1.0)));
        let cloud = SemanticCloud {
            labels: labels.collect(),
            points_m,
        };
        assert_eq!(
            left_part(cloud.clone(), &sensor_m, 1.0).points_m,
            cloud.points_m
        );
        let left = left_part(cloud, &sensor_m, 0.5);
        // Looking along x, y is to the left.
        assert_eq!((left.len(), left.labels.len()), (50, 50));
        assert!(left.points_m.iter().all(|p| p.y > 1.0));
        assert!((0..50).all(|i| left.label(i).top() == Some(1)));
    }
}
