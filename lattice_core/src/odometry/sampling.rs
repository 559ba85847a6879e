//! Sizes of cells, and samples of a scan: centroids for the map, fewer of them for registration.

use std::f64::consts::PI;

use nalgebra::Vector3;

use super::moment_map::MomentMap;
use crate::lattice::{Lattice, LatticeError, LatticeKind};

/// Cell size of the map in mean distances between returns: beams are two to four times as far apart, and a plane
/// needs returns of more than one.
const SIDE_SPACINGS: f64 = 8.0;
/// Bounds of the cell size, metres: below, range noise thickens planes; above, cells hold several surfaces. An upper
/// bound of 1.5 m instead of 1 m doubles the points of a street with moving cars on planes across it.
const SIDES_M: (f64, f64) = (0.3, 1.5);
/// Bounds of the number of centroids for the map: each cell of the map should get some from each scan.
const CENTROIDS: (usize, usize) = (3000, 8000);
/// Bounds of the number of points for registration.
const REGISTERED: (usize, usize) = (1000, 2500);
/// Ratio of consecutive sizes: 2^(1/4).
const STEP: f64 = 1.189_207_115;
const MAX_STEPS: u32 = 12;

/// Cell sizes of a scan and of its map, cube roots of volumes, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sizes {
    /// Cell size of the map.
    pub map_m: f64,
    /// Cell size of the centroids added to the map.
    pub centroids_m: f64,
    /// Cell size of the registered points.
    pub registered_m: f64,
}

/// Samples of a scan, in its own frame, metres.
pub(super) struct Sample {
    pub centroids_m: Vec<Vector3<f64>>,
    pub registered_m: Vec<Vector3<f64>>,
    /// RMS range of the registered points, metres.
    pub arm_m: f64,
}

impl Sizes {
    /// Cell sizes for scans like this one (sensor near the origin, metres). That of the map follows from the median
    /// range and the number of returns; the others are half and one and a half of it, or smaller so that enough
    /// points remain.
    pub fn of(points_m: &[Vector3<f64>], kind: LatticeKind) -> Result<Sizes, LatticeError> {
        let mut ranges: Vec<f64> = points_m.iter().map(Vector3::norm).collect();
        let middle = ranges.len() / 2;
        let median = match ranges.is_empty() {
            true => 0.0,
            false => *ranges.select_nth_unstable_by(middle, f64::total_cmp).1,
        };
        let spacing = median * (4.0 * PI / ranges.len().max(1) as f64).sqrt();
        let map_m = (SIDE_SPACINGS * spacing).clamp(SIDES_M.0, SIDES_M.1);
        let mut sizes = Sizes {
            map_m,
            centroids_m: map_m / 2.0,
            registered_m: map_m * 1.5,
        };
        for _ in 0..MAX_STEPS {
            let before = sizes;
            let sample = sizes.sample(points_m, kind)?;
            sizes.follow(&sample);
            if sizes == before {
                break;
            }
        }
        Ok(sizes)
    }

    /// Changes the sample sizes if a scan gave too few or too many points.
    pub(super) fn follow(&mut self, sample: &Sample) {
        let step = |size: f64, count: usize, (least, most): (usize, usize), bound: f64| {
            if count < least {
                (size / STEP).max(bound / MAX_STEPS as f64)
            } else if count > most {
                (size * STEP).min(bound)
            } else {
                size
            }
        };
        let (fine, coarse) = (self.map_m / 2.0, self.map_m * 3.0);
        self.centroids_m = step(self.centroids_m, sample.centroids_m.len(), CENTROIDS, fine);
        self.registered_m = step(
            self.registered_m,
            sample.registered_m.len(),
            REGISTERED,
            coarse,
        );
        self.registered_m = self.registered_m.max(self.centroids_m);
    }

    /// Centroids of the cells of a scan, and one of them per larger cell.
    pub(super) fn sample(
        &self,
        points_m: &[Vector3<f64>],
        kind: LatticeKind,
    ) -> Result<Sample, LatticeError> {
        let cells = |side_m: f64| -> Result<MomentMap, LatticeError> {
            Ok(MomentMap::new(
                Lattice::new(kind, side_m.powi(3))?,
                points_m.len(),
            ))
        };
        let mut fine = cells(self.centroids_m)?;
        fine.add(points_m);
        let centroids_m = fine.centroids_m();
        let mut coarse = cells(self.registered_m)?;
        let is_first = |point: &&Vector3<f64>| {
            let before = coarse.len();
            coarse.add(std::slice::from_ref(*point));
            coarse.len() > before
        };
        let registered_m: Vec<_> = centroids_m.iter().filter(is_first).copied().collect();
        let squares: f64 = registered_m.iter().map(Vector3::norm_squared).sum();
        Ok(Sample {
            arm_m: (squares / registered_m.len().max(1) as f64)
                .sqrt()
                .max(1e-3),
            centroids_m,
            registered_m,
        })
    }
}
