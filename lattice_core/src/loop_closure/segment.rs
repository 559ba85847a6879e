//! Segments of a drive: the surfaces that some scans in a row have seen, in one frame.

use nalgebra::{Isometry3, Matrix3, Matrix6, Point3, Vector3};

use crate::lattice::{Lattice, LatticeError, LatticeKind};
use crate::odometry::{MomentMap, ScanResult, Verdict};

/// Length of a segment in RMS ranges of its points: neighbours see the same surfaces.
const LENGTH_ARMS: f64 = 0.5;
/// Limit of cells of a segment.
const MAX_CELLS: usize = 30_000;

/// Surfaces seen along a part of the path, in the frame of the base at its first scan (the anchor).
#[derive(Clone, Debug)]
pub struct Segment {
    /// Number of the submap of the odometry.
    pub(super) submap: u32,
    /// Time of the first point of the first scan, ns.
    pub(super) begin_ns: i64,
    /// Time of the pose of the first scan, ns.
    pub(super) first_ns: i64,
    /// Time of the pose of the last scan, ns.
    pub(super) end_ns: i64,
    /// Length of the path up to the first scan, m.
    pub(super) path_m: f64,
    /// Odometry pose of the first scan.
    pub(super) odom_from_anchor: Isometry3<f64>,
    /// Covariance of the twist of that pose in the odometry frame since the beginning of the submap.
    pub(super) drift: Matrix6<f64>,
    /// Centroids of cells, metres, in the frame of the anchor.
    pub(super) points_m: Vec<[f32; 3]>,
    /// RMS range of the points of its scans, m.
    pub(super) arm_m: f64,
    /// Side of the cells, m.
    pub(super) side_m: f64,
}

impl Segment {
    /// Points transformed by a pose of the anchor.
    pub(super) fn points_at<'a>(
        &'a self,
        pose: &'a Isometry3<f64>,
    ) -> impl Iterator<Item = Vector3<f64>> + 'a {
        let point = move |point: &[f32; 3]| (pose * Point3::from(point.map(f64::from))).coords;
        self.points_m.iter().map(point)
    }
}

/// Divides the scans of a drive into segments.
#[derive(Default)]
pub struct SegmentCutter {
    growing: Option<GrowingSegment>,
    path_m: f64,
    last: Option<(u32, Vector3<f64>)>,
}

impl SegmentCutter {
    /// Adds a scan with its centroids, metres in the frame of the base at its pose, of cells of `side_m`. Returns the
    /// segment that ends before it. Scans that are not `OK` are skipped.
    ///
    /// # Errors
    /// If `side_m` gives no lattice.
    pub fn add(
        &mut self,
        scan: &ScanResult,
        centroids_m: &[Vector3<f64>],
        side_m: f64,
    ) -> Result<Option<Segment>, LatticeError> {
        if scan.verdict != Verdict::Ok {
            return Ok(None);
        }
        let place_m = scan.odom_from_base.translation.vector;
        let last = self.last.replace((scan.submap, place_m));
        self.path_m += last
            .filter(|(submap, _)| *submap == scan.submap)
            .map_or(0.0, |(_, last_m)| (place_m - last_m).norm());
        if let Some(growing) = self.growing.as_mut().filter(|one| !one.is_ended_by(scan)) {
            growing.add(scan, centroids_m);
            return Ok(None);
        }
        let ended = self.finish();
        self.growing = Some(GrowingSegment::new(scan, centroids_m, side_m, self.path_m)?);
        Ok(ended)
    }

    /// Current segment so far.
    pub fn finish(&mut self) -> Option<Segment> {
        self.growing.take().map(GrowingSegment::finish)
    }
}

/// Segment under construction.
struct GrowingSegment {
    segment: Segment,
    cells: MomentMap,
}

impl GrowingSegment {
    /// Begins a segment with a scan. `centroids_m`: in the frame of the base at the pose of the scan.
    ///
    /// # Errors
    /// If `side_m` gives no lattice.
    fn new(
        scan: &ScanResult,
        centroids_m: &[Vector3<f64>],
        side_m: f64,
        path_m: f64,
    ) -> Result<GrowingSegment, LatticeError> {
        let squares: f64 = centroids_m.iter().map(Vector3::norm_squared).sum();
        let segment = Segment {
            submap: scan.submap,
            begin_ns: scan.first_ns,
            first_ns: scan.end_ns,
            end_ns: scan.end_ns,
            path_m,
            odom_from_anchor: scan.odom_from_base,
            drift: about_origin(&scan.drift, &scan.odom_from_base.translation.vector),
            points_m: Vec::new(),
            arm_m: (squares / centroids_m.len().max(1) as f64).sqrt(),
            side_m,
        };
        let lattice = Lattice::new(LatticeKind::Fcc, side_m.powi(3))?;
        let mut growing = GrowingSegment {
            segment,
            cells: MomentMap::new(lattice, MAX_CELLS),
        };
        growing.add(scan, centroids_m);
        Ok(growing)
    }

    /// True if a scan belongs to another submap or lies beyond the end of the segment.
    fn is_ended_by(&self, scan: &ScanResult) -> bool {
        let Segment {
            submap,
            odom_from_anchor,
            arm_m,
            ..
        } = &self.segment;
        let moved = odom_from_anchor.inverse() * scan.odom_from_base;
        // Half a turn in place shows nothing new to a lidar that sees all around, and half of it to others.
        let moved_m = moved.translation.vector.norm();
        scan.submap != *submap || moved_m > LENGTH_ARMS * arm_m
    }

    /// Adds the centroids of a scan, in the frame of the base at its pose.
    fn add(&mut self, scan: &ScanResult, centroids_m: &[Vector3<f64>]) {
        self.segment.end_ns = scan.end_ns;
        let anchor_from_base = self.segment.odom_from_anchor.inverse() * scan.odom_from_base;
        let place = |point: &Vector3<f64>| (anchor_from_base * Point3::from(*point)).coords;
        let placed: Vec<_> = centroids_m.iter().map(place).collect();
        self.cells.add(&placed);
    }

    /// Segment so far.
    fn finish(self) -> Segment {
        let point = |point: &Vector3<f64>| [point.x as f32, point.y as f32, point.z as f32];
        Segment {
            points_m: self.cells.centroids_m().iter().map(point).collect(),
            ..self.segment
        }
    }
}

/// Converts the covariance of a perturbation (translation, rotation) about a point to that of a twist about the
/// origin of the same axes.
pub(super) fn about_origin(covariance: &Matrix6<f64>, place_m: &Vector3<f64>) -> Matrix6<f64> {
    let mut to_origin = Matrix6::identity();
    let lever: Matrix3<f64> = place_m.cross_matrix();
    to_origin.fixed_view_mut::<3, 3>(0, 3).copy_from(&lever);
    to_origin * covariance * to_origin.transpose()
}
