//! How a scan is matched.

use std::f64::consts::PI;

use crate::options::{OutOfRange, within};

/// Most iterations of one climb.
const MOST_ITERATIONS: f64 = 1e5;
/// Most climbs by shorter and shorter steps.
const MOST_STAGES: f64 = 8.0;
/// Most points of a sample.
const MOST_SAMPLE: f64 = 1e7;
/// Most poses of a grid.
const MOST_POSES: f64 = 1e8;
/// Most poses kept of a level.
const MOST_KEPT: f64 = 1e4;
/// Largest spread of a search, metres.
const MOST_SPREAD_M: f64 = 1e5;

/// How [`align`](super::align) climbs; by default the numbers of the original, with a second fine stage.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct AlignOptions {
    /// Most points of the scan that are looked at, one of a cell.
    pub max_points: usize,
    /// Most steps on one level.
    pub level_iterations: usize,
    /// Last climbs, on the finest level, each by shorter steps than the one before; the original has one.
    pub fine_stages: usize,
    /// Most steps of each of the last climbs.
    pub fine_iterations: usize,
    /// Steps of the first of the last climbs over those of the finest level, and of each over those of
    /// the one before.
    pub fine_step: f64,
    /// Turn of one step on the finest level, radians; twice as much from one level to the next.
    pub step_rad: f64,
}

impl Default for AlignOptions {
    fn default() -> AlignOptions {
        AlignOptions {
            max_points: 2000,
            level_iterations: 20,
            fine_stages: 2,
            fine_iterations: 100,
            fine_step: 0.25,
            step_rad: 0.5_f64.to_radians(),
        }
    }
}

impl AlignOptions {
    pub(super) fn check(&self) -> Result<(), OutOfRange> {
        within("max_points", self.max_points as f64, 1.0, MOST_SAMPLE)?;
        let iterations = self.level_iterations as f64;
        within("level_iterations", iterations, 0.0, MOST_ITERATIONS)?;
        within("fine_stages", self.fine_stages as f64, 1.0, MOST_STAGES)?;
        let iterations = self.fine_iterations as f64;
        within("fine_iterations", iterations, 0.0, MOST_ITERATIONS)?;
        within("fine_step", self.fine_step, 1e-3, 1.0)?;
        within("step_rad", self.step_rad, 1e-6, PI)
    }
}

/// Half the widths of what is searched, about a pose; 0 keeps an axis as it is.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Spread {
    /// Along the axes of the map, metres.
    pub translation_m: [f64; 3],
    /// About the axes of the map through the datum of the scan, which should be where the scanner
    /// was (a rotation vector), radians, at most pi.
    pub rotation_rad: [f64; 3],
}

impl Spread {
    pub(super) fn check(&self) -> Result<(), OutOfRange> {
        for value in self.translation_m {
            within("translation_m", value, 0.0, MOST_SPREAD_M)?;
        }
        for value in self.rotation_rad {
            within("rotation_rad", value, 0.0, PI)?;
        }
        Ok(())
    }
}

/// How [`search`](super::search) goes through its grid; the numbers of the original by default.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct SearchOptions {
    /// Most points of the scan that are looked at, one of a cell.
    pub max_points: usize,
    /// Poses kept of a level, and given in the end.
    pub keep: usize,
    /// Where a turn moves a point as far as a shift does: distance of the features, metres.
    pub feature_range_m: f64,
    /// Most poses of the coarsest grid; it takes 8 bytes for each.
    pub max_poses: usize,
}

impl Default for SearchOptions {
    fn default() -> SearchOptions {
        SearchOptions {
            max_points: 2000,
            keep: 100,
            feature_range_m: 8.0,
            max_poses: 5_000_000,
        }
    }
}

impl SearchOptions {
    pub(super) fn check(&self) -> Result<(), OutOfRange> {
        within("max_points", self.max_points as f64, 1.0, MOST_SAMPLE)?;
        within("keep", self.keep as f64, 1.0, MOST_KEPT)?;
        within("feature_range_m", self.feature_range_m, 1e-3, 1e6)?;
        within("max_poses", self.max_poses as f64, 1.0, MOST_POSES)
    }
}
