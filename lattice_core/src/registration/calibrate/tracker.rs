//! Following a headset that is already calibrated.

use nalgebra::Isometry3;

use super::candidates::Workbench;
use super::input::Input;
use super::map::CalibrationMap;
use super::types::{CalibrationOptions, CalibrationRequest, Gaze};

/// Log-likelihood by which a refined pose must be better to replace the old one.
const BETTER: f64 = 2.0;

/// What a further look says of a pose.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct TrackUpdate {
    /// Whether the look fits; if not, a full search is due.
    pub holds: bool,
    /// `map_from_headset` after the look.
    pub map_from_headset: Isometry3<f64>,
    /// Share of the points on a surface of the map.
    pub inlier_fraction: f64,
    /// Root mean square distance of those from the surfaces, metres.
    pub rmse_m: f64,
}

/// Keeps a pose up to date by cheap local refinement while the headset looks on.
#[derive(Clone, Debug)]
pub struct Tracker {
    map_from_headset: Isometry3<f64>,
    misses: u32,
}

impl Tracker {
    /// Of a pose that a calibration found.
    pub fn new(map_from_headset: Isometry3<f64>) -> Tracker {
        Tracker {
            map_from_headset,
            misses: 0,
        }
    }

    /// The pose as it is now.
    pub fn map_from_headset(&self) -> Isometry3<f64> {
        self.map_from_headset
    }

    /// Refines the pose by a look. Three looks in a row that do not fit break it.
    pub fn update(
        &mut self,
        map: &CalibrationMap,
        gaze: &Gaze,
        options: &CalibrationOptions,
    ) -> TrackUpdate {
        let lost = TrackUpdate {
            holds: true,
            map_from_headset: self.map_from_headset,
            inlier_fraction: 0.0,
            rmse_m: 0.0,
        };
        let request = CalibrationRequest {
            gazes: std::slice::from_ref(gaze),
            start: None,
            confusion: None,
        };
        // A look that cannot be used says nothing about the pose.
        let Ok(input) = Input::new(&request, options, map.spacing_m) else {
            return lost;
        };
        let bench = Workbench::new(map, &input, options, None);
        let old = bench.judge(&bench.fit, self.map_from_headset, "tracking");
        let pose = bench.polish(&self.map_from_headset);
        let new = bench.judge(&bench.fit, pose, "tracking");
        let best = if new.total() > old.total() + BETTER {
            new
        } else {
            old
        };
        self.misses = match best.inlier_fraction < options.min_inliers {
            true => self.misses + 1,
            false => 0,
        };
        if self.misses == 0 {
            self.map_from_headset = best.map_from_headset;
        }
        TrackUpdate {
            holds: self.misses < 3,
            map_from_headset: self.map_from_headset,
            inlier_fraction: best.inlier_fraction,
            rmse_m: best.rmse_m,
        }
    }
}
