//! The points found so far.

use super::PointFileError;

/// Room that is made on the word of a header alone, points.
const TRUSTED: u64 = 1 << 16;

/// Takes points up to a limit, and leaves out those that are not finite.
pub(super) struct Collector {
    points_m: Vec<[f64; 3]>,
    skipped: usize,
    max_points: usize,
}

impl Collector {
    pub(super) fn new(max_points: usize) -> Collector {
        Collector {
            points_m: Vec::new(),
            skipped: 0,
            max_points,
        }
    }

    /// Fails early if a header promises more points than are allowed.
    pub(super) fn promise(&mut self, points: u64) -> Result<(), PointFileError> {
        if usize::try_from(points).is_ok_and(|points| points <= self.max_points) {
            self.points_m.reserve(points.min(TRUSTED) as usize);
            return Ok(());
        }
        let max_points = self.max_points;
        Err(PointFileError::TooManyPoints { points, max_points })
    }

    /// Takes a point, metres.
    pub(super) fn push(&mut self, point_m: [f64; 3]) -> Result<(), PointFileError> {
        let found = self.points_m.len().saturating_add(self.skipped);
        if found >= self.max_points {
            return Err(PointFileError::TooManyPoints {
                points: (found as u64).saturating_add(1),
                max_points: self.max_points,
            });
        }
        if point_m.iter().all(|c| c.is_finite()) {
            self.points_m.push(point_m);
        } else {
            self.skipped += 1;
        }
        Ok(())
    }

    pub(super) fn skipped_not_finite(&self) -> usize {
        self.skipped
    }

    pub(super) fn into_points(self) -> Vec<[f64; 3]> {
        self.points_m
    }
}
