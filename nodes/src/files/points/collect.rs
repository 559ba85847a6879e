//! The points found so far.

use lattice_core::registration::UNLABELED;

use super::PointFileError;

/// Room that is made on the word of a header alone, points.
const TRUSTED: u64 = 1 << 16;

/// Takes points up to a limit, and leaves out those that are not finite.
pub(super) struct Collector {
    pub(super) points_m: Vec<[f64; 3]>,
    /// One for each point, or none at all.
    pub(super) labels: Vec<u16>,
    pub(super) skipped: usize,
    max_points: usize,
}

impl Collector {
    pub(super) fn new(max_points: usize) -> Collector {
        Collector {
            points_m: Vec::new(),
            labels: Vec::new(),
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

    /// The same for points beside those that were found.
    pub(super) fn promise_more(&mut self, points: u64) -> Result<(), PointFileError> {
        let found = self.points_m.len().saturating_add(self.skipped) as u64;
        self.promise(found.saturating_add(points))
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

    /// Takes a point with its label; all points of a file have one or none has.
    pub(super) fn push_labelled(
        &mut self,
        point_m: [f64; 3],
        label: u16,
    ) -> Result<(), PointFileError> {
        let known = self.points_m.len();
        self.push(point_m)?;
        if self.points_m.len() > known {
            self.labels.push(label);
        }
        Ok(())
    }

    /// Takes a point with the label that a file has for it, if it has labels; what is no class number is
    /// no label.
    pub(super) fn push_with(
        &mut self,
        point_m: [f64; 3],
        label: Option<f64>,
    ) -> Result<(), PointFileError> {
        match label {
            Some(label) => {
                let is_class = label.fract() == 0.0 && (0.0..65535.0).contains(&label);
                self.push_labelled(point_m, if is_class { label as u16 } else { UNLABELED })
            }
            None => self.push(point_m),
        }
    }
}
