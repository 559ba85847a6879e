//! Planes of cells, and the normal equations of the mount with the planes eliminated.

use nalgebra::{Isometry3, Matrix3, Point3, SMatrix, SVector, Vector3};
use rayon::prelude::*;
use rustc_hash::FxHashMap;

use super::{MountCorrection, MountSamples};
use crate::lattice::{Lattice, LatticeIndex, LatticeKind};

/// Minimum number of points of a flat cell.
const MIN_POINTS: usize = 8;
/// Largest ratio of the least and the middle variance of a flat cell.
const MAX_FLATNESS: f64 = 0.15;
/// Smallest standard deviation along a flat cell, of its size.
const MIN_EXTENT: f64 = 0.08;
/// Points of a cell above which it has no more weight.
const FULL_POINTS: f64 = 60.0;
/// Size of the blocks within which errors are correlated, cells.
const BLOCK_CELLS: f64 = 8.0;

/// Rows of the numbers of a mount.
pub(super) type Vector7 = SVector<f64, 7>;
/// Normal matrix of the numbers of a mount.
pub(super) type Matrix7 = SMatrix<f64, 7, 7>;

/// Derivatives of the gradient by position (m) and attitude (rad) errors of poses, in the map frame.
pub(super) type ByPose = SMatrix<f64, 7, 6>;

/// Longest segment of the log whose poses share an error, seconds.
const LONGEST_SEGMENT_S: f64 = 5.0;
/// Smallest number of segments.
const SEGMENTS: f64 = 12.0;

/// Segment of each pose.
pub(super) struct Segments(Vec<u16>);

impl Segments {
    /// Segments of equal length of the samples.
    pub(super) fn new(samples: &MountSamples) -> Segments {
        let stamps = || samples.poses.iter().map(|pose| pose.stamp_s);
        let first = stamps().fold(f64::INFINITY, f64::min);
        let last = stamps().fold(f64::NEG_INFINITY, f64::max);
        let length_s = ((last - first) / SEGMENTS).clamp(1e-3, LONGEST_SEGMENT_S);
        // Numbers of segments saturate.
        Segments(
            stamps()
                .map(|at| ((at - first) / length_s) as u16)
                .collect(),
        )
    }
}

/// Evidence of a flat cell, for weight 1.
pub(super) struct Plane {
    /// Block of the cell.
    pub block: [i32; 3],
    /// Normal matrix per square metre.
    pub normal: Matrix7,
    /// Gradient of half the sum of squared residuals.
    pub gradient: Vector7,
    /// Variance of the points across the plane, square metres.
    pub variance_m2: f64,
    /// Effective number of points over the number of points.
    pub share: f64,
    /// By segment, if asked for.
    pub by_pose: Vec<(u16, ByPose)>,
}

/// Flat cells of the samples with a correction: of two lattices, one moved by half a cell.
pub(super) fn planes(samples: &MountSamples, at: &MountCorrection, cell_m: f64) -> Vec<Plane> {
    planes_of_segments(samples, at, cell_m, None)
}

/// Flat cells, with derivatives by the errors of the poses of segments.
pub(super) fn planes_of_segments(
    samples: &MountSamples,
    at: &MountCorrection,
    cell_m: f64,
    segments: Option<&Segments>,
) -> Vec<Plane> {
    let Ok(lattice) = Lattice::new(LatticeKind::Fcc, cell_m.powi(3)) else {
        return Vec::new();
    };
    let placed = Placed::new(samples, at);
    let shifts = [Vector3::zeros(), Vector3::new(0.5, 0.27, 0.39) * cell_m];
    let of_shift = |shift_m: &Vector3<f64>| {
        let cells = placed.cells(&lattice, shift_m);
        let found: Vec<Option<Plane>> = cells
            .par_iter()
            .map(|cell| placed.plane(cell, cell_m, segments))
            .collect();
        found.into_iter().flatten()
    };
    shifts.iter().flat_map(of_shift).collect()
}

/// Samples in the map by a correction.
struct Placed<'a> {
    samples: &'a MountSamples,
    at: &'a MountCorrection,
    poses: Vec<Isometry3<f64>>,
    points_m: Vec<Vector3<f64>>,
}

impl<'a> Placed<'a> {
    fn new(samples: &'a MountSamples, at: &'a MountCorrection) -> Placed<'a> {
        let poses: Vec<Isometry3<f64>> = samples
            .poses
            .iter()
            .map(|pose| at.map_from_base(pose))
            .collect();
        let fix = at.base_from_stated();
        let points = samples.points.par_iter().map(|(pose, point)| {
            let pose = poses.get(*pose as usize).copied().unwrap_or_default();
            (pose * fix * Point3::from(*point)).coords
        });
        let points_m = points.collect();
        Placed {
            samples,
            at,
            poses,
            points_m,
        }
    }

    /// Points by cell, in the order of the first point of each.
    fn cells(&self, lattice: &Lattice, shift_m: &Vector3<f64>) -> Vec<Vec<u32>> {
        let mut places: FxHashMap<LatticeIndex, usize> = FxHashMap::default();
        let mut cells: Vec<Vec<u32>> = Vec::new();
        for (number, point_m) in (0_u32..).zip(&self.points_m) {
            let Some(index) = lattice.quantize(&(point_m + shift_m)) else {
                continue;
            };
            let place = *places.entry(index).or_insert(cells.len());
            match cells.get_mut(place) {
                Some(cell) => cell.push(number),
                None => cells.push(vec![number]),
            }
        }
        cells
    }

    fn point(&self, number: u32) -> Vector3<f64> {
        self.points_m
            .get(number as usize)
            .copied()
            .unwrap_or_default()
    }

    /// Evidence of a cell; `None` unless it is flat.
    fn plane(&self, cell: &[u32], cell_m: f64, segments: Option<&Segments>) -> Option<Plane> {
        if cell.len() < MIN_POINTS {
            return None;
        }
        let count = cell.len() as f64;
        let sum: Vector3<f64> = cell.iter().map(|number| self.point(*number)).sum();
        let mean_m = sum / count;
        let mut covariance = Matrix3::zeros();
        for number in cell {
            let off = self.point(*number) - mean_m;
            covariance += off * off.transpose();
        }
        let eigen = (covariance / count).symmetric_eigen();
        let mut order = [0, 1, 2];
        order.sort_by(|a, b| eigen.eigenvalues[*a].total_cmp(&eigen.eigenvalues[*b]));
        let [least, middle, most] = order.map(|i| eigen.eigenvalues[i].max(0.0));
        if least > MAX_FLATNESS * middle || middle < (MIN_EXTENT * cell_m).powi(2) {
            return None;
        }
        let [normal, across, along] = order.map(|i| eigen.eigenvectors.column(i).into_owned());
        let (mut jj, mut jr) = (Matrix7::zeros(), Vector7::zeros());
        let (mut j1, mut ju, mut jv) = (Vector7::zeros(), Vector7::zeros(), Vector7::zeros());
        for number in cell {
            let off = self.point(*number) - mean_m;
            let row = self.row(*number, &normal)?;
            jj.ger(1.0, &row, &row, 1.0);
            jr += row * normal.dot(&off);
            j1 += row;
            ju += row * across.dot(&off);
            jv += row * along.dot(&off);
        }
        // The offset and the two tilts of the plane are eliminated; their columns are orthogonal.
        jj.ger(-1.0 / count, &j1, &j1, 1.0);
        jj.ger(-1.0 / (count * middle), &ju, &ju, 1.0);
        jj.ger(-1.0 / (count * most), &jv, &jv, 1.0);
        let mut by_pose: Vec<(u16, ByPose)> = Vec::new();
        if let Some(segments) = segments {
            let mean = j1 / count;
            let (tilt_u, tilt_v) = (ju / (count * middle), jv / (count * most));
            for number in cell {
                let off = self.point(*number) - mean_m;
                let row = self.row(*number, &normal)?;
                let row = row - mean - tilt_u * across.dot(&off) - tilt_v * along.dot(&off);
                let (place, _) = self.samples.points.get(*number as usize)?;
                let pose = self.poses.get(*place as usize)?;
                let from_base = self.point(*number) - pose.translation.vector;
                let turn = from_base.cross(&normal);
                let n = normal;
                let of_pose = SVector::from([n.x, n.y, n.z, turn.x, turn.y, turn.z]);
                let segment = segments.0.get(*place as usize).copied()?;
                let sum = match by_pose.iter().position(|(one, _)| *one == segment) {
                    Some(known) => known,
                    None => {
                        by_pose.push((segment, ByPose::zeros()));
                        by_pose.len() - 1
                    }
                };
                if let Some((_, sum)) = by_pose.get_mut(sum) {
                    sum.ger(1.0, &row, &of_pose, 1.0);
                }
            }
        }
        let block_m = BLOCK_CELLS * cell_m;
        Some(Plane {
            block: [0, 1, 2].map(|i| (mean_m[i] / block_m).floor() as i32),
            normal: jj,
            gradient: jr,
            variance_m2: least,
            share: (FULL_POINTS / count).min(1.0),
            by_pose,
        })
    }

    /// Derivative of the distance of a point from a plane.
    fn row(&self, number: u32, normal: &Vector3<f64>) -> Option<Vector7> {
        let (place, _) = self.samples.points.get(number as usize)?;
        let pose = self.poses.get(*place as usize)?;
        let twist = self.samples.poses.get(*place as usize)?;
        let in_map = self.point(number) - pose.translation.vector;
        let in_base = pose.rotation.inverse_transform_vector(&in_map);
        let normal_in_base = pose.rotation.inverse_transform_vector(normal);
        let turn = (in_base - self.at.sensor_m()).cross(&normal_in_base);
        let speed = twist.velocity_m_per_s + twist.rate_rad_per_s.cross(&in_map);
        let n = normal_in_base;
        Some(Vector7::from([
            turn.x,
            turn.y,
            turn.z,
            n.x,
            n.y,
            n.z,
            normal.dot(&speed),
        ]))
    }
}
