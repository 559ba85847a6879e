//! Collection of points while reading.

use lattice_core::registration::UNLABELED;

use super::PointFileError;

/// Limit of memory reserved from the point count of a header, points.
const TRUSTED: u64 = 1 << 16;

/// Limit of equal points in a drawing: eight boxes meet in a corner, with three faces each.
const MAX_CORNER: usize = 24;

/// Collects points up to a limit, and skips those that are not finite.
pub(super) struct Collector {
    pub(super) points_m: Vec<[f64; 3]>,
    /// One per point, or empty.
    pub(super) labels: Vec<u16>,
    pub(super) skipped: usize,
    /// True for rows and columns of a sensor.
    pub(super) is_organized: bool,
    /// Warning about a property of the file that is not applied.
    pub(super) remark: Option<String>,
    max_points: usize,
}

impl Collector {
    pub(super) fn new(max_points: usize) -> Collector {
        Collector {
            points_m: Vec::new(),
            labels: Vec::new(),
            skipped: 0,
            is_organized: false,
            remark: None,
            max_points,
        }
    }

    /// Fails early if a header states more points than the limit.
    pub(super) fn promise(&mut self, points: u64) -> Result<(), PointFileError> {
        if usize::try_from(points).is_ok_and(|points| points <= self.max_points) {
            self.points_m.reserve(points.min(TRUSTED) as usize);
            return Ok(());
        }
        let max_points = self.max_points;
        Err(PointFileError::TooManyPoints { points, max_points })
    }

    /// Fails early if further points would exceed the limit.
    pub(super) fn promise_more(&mut self, points: u64) -> Result<(), PointFileError> {
        let found = self.points_m.len().saturating_add(self.skipped) as u64;
        self.promise(found.saturating_add(points))
    }

    /// Adds a point, metres.
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

    /// Removes points at 0 0 0, which drivers write for rays without return; returns their number. A few are kept in
    /// unorganised clouds: they may be a corner of a drawing.
    pub(super) fn leave_out_no_returns(&mut self) -> usize {
        let is_none = |point_m: &[f64; 3]| *point_m == [0.0; 3];
        let count = self
            .points_m
            .iter()
            .filter(|point_m| is_none(point_m))
            .count();
        if count <= MAX_CORNER && !self.is_organized {
            return 0;
        }
        let mut at = self.points_m.iter();
        self.labels
            .retain(|_| at.next().is_none_or(|point_m| !is_none(point_m)));
        self.points_m.retain(|point_m| !is_none(point_m));
        count
    }

    /// Warnings about removed points and properties not applied.
    pub(super) fn notes(&self, no_returns: usize) -> impl Iterator<Item = String> + '_ {
        let of = self.points_m.len().saturating_add(no_returns);
        let left_out = (no_returns > 0).then(|| {
            format!("{no_returns} no returns left out: points at 0 0 0, of {of} finite ones")
        });
        left_out.into_iter().chain(self.remark.clone())
    }

    /// Adds a labelled point; either all points of a file are labelled or none.
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

    /// Adds a point with its label if the file has labels; an invalid class number counts as
    /// unlabelled.
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
