//! The points found so far.

use lattice_core::registration::UNLABELED;

use super::PointFileError;

/// Room that is made on the word of a header alone, points.
const TRUSTED: u64 = 1 << 16;

/// Most points of one place in a drawing: eight boxes meet in a corner, with three faces each.
const MAX_CORNER: usize = 24;

/// Takes points up to a limit, and leaves out those that are not finite.
pub(super) struct Collector {
    pub(super) points_m: Vec<[f64; 3]>,
    /// One for each point, or none at all.
    pub(super) labels: Vec<u16>,
    pub(super) skipped: usize,
    /// True if the points are rows and columns of a sensor.
    pub(super) is_organized: bool,
    /// Statement of the file about its points that is not applied.
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

    /// Leaves out points at 0 0 0, which drivers write for rays without return; their number. Some are kept where rows and
    /// columns of a sensor do not tell that they are none: they may be a corner of a drawing.
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

    /// Lines on what is left out or not applied.
    pub(super) fn notes(&self, no_returns: usize) -> impl Iterator<Item = String> + '_ {
        let of = self.points_m.len().saturating_add(no_returns);
        let left_out = (no_returns > 0).then(|| {
            format!("{no_returns} no returns left out: points at 0 0 0, of {of} finite ones")
        });
        left_out.into_iter().chain(self.remark.clone())
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
