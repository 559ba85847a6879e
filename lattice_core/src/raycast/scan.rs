//! Scans: points with the position that they are seen from.

use nalgebra::Vector3;

use crate::cloud::Cloud;

/// Points seen from one position, in the map frame; a scan is one or more of these.
#[derive(Clone, Copy, Debug)]
pub struct RayBundle<'a> {
    /// Sensor position, map frame, metres.
    pub origin_m: Vector3<f64>,
    /// End points of the rays.
    pub ends: &'a Cloud,
}

/// Numbers of points, rays and cells of a scan.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct ScanReport {
    /// Number of points in the scan.
    pub points: u64,
    /// Points with a NaN or infinite coordinate; all points of a bundle if its origin has one.
    pub not_finite: u64,
    /// Points out of the range of keys; all points of a bundle if its origin is.
    pub out_of_range: u64,
    /// Points beyond the range limit, whose rays were followed up to it.
    pub beyond_max_range: u64,
    /// Cells that were hit.
    pub hits: u64,
    /// Rays that were followed: one per end cell.
    pub rays: u64,
    /// Cells traversed, counted for each ray.
    pub visits: u64,
    /// Cells traversed and not hit, each counted once.
    pub misses: u64,
    /// New blocks of 512 cells refused for lack of memory.
    pub blocks_refused: u64,
    /// Cells of rays and ends that lie in blocks without memory during the scan, counted for each ray.
    pub entries_refused: u64,
}

/// Range of the rays.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Reach {
    /// Range limit, metres: rays of farther points end there without a hit; `INFINITY` for no limit.
    pub max_range_m: f64,
    /// Last part of each ray that clears nothing, metres: rays that graze a surface traverse the cells before the one
    /// that they end in.
    pub keep_m: f64,
    /// Last part of each ray that clears nothing, as a fraction 0 to 1; the longer of the two applies.
    ///
    /// Ground seen at a grazing angle from a height is traversed, within its own cells, over a length that grows with
    /// the distance.
    pub keep_ratio: f64,
}

impl Default for Reach {
    fn default() -> Reach {
        Reach {
            max_range_m: f64::INFINITY,
            keep_m: 0.0,
            keep_ratio: 0.0,
        }
    }
}
