//! Odometry of a lidar: the pose of each scan by registration with a map of the scans before.
//!
//! The map is a voxel list whose cells keep integer moments of their points ([`MomentMap`]). A scan is deskewed by
//! constant velocity or a gyroscope, thinned to centroids, and moved by Gauss-Newton to the planes and points of its
//! cell and the neighbouring ones, within a gate that follows from the deviations of predictions (Vizzo et al. 2023,
//! KISS-ICP). Every pose has a [`Verdict`]. The same scans give the same bits on any number of threads.

mod align;
mod moment_map;
mod moments;
mod motion;
mod sampling;
mod scan;
mod scan_result;
mod submap;
mod surface;
mod sweep;
#[cfg(test)]
mod tests;
mod verdict;

use nalgebra::{Isometry3, Matrix6, Vector3};

pub use moment_map::MomentMap;
pub use moments::Moments;
pub use motion::Prior;
pub use sampling::Sizes;
pub use sweep::AngularRate;
pub use verdict::{LostCause, Verdict, WeakDirection};

use crate::lattice::{LatticeError, LatticeKind};
use align::Held;
pub use scan::Scan;
pub use scan_result::ScanResult;
use submap::Submap;
use sweep::Sweep;
use verdict::{Evidence, can_begin, judge, least_contrast};

/// Number of registrations of a scan, each deskewed by the velocity of the one before: usually, and if the inlier
/// fraction is low.
const PASSES: (usize, usize) = (2, 4);

/// Options of the odometry.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OdometryOptions {
    /// Lattice of the map.
    pub lattice: LatticeKind,
}

impl Default for OdometryOptions {
    fn default() -> OdometryOptions {
        OdometryOptions {
            lattice: LatticeKind::Fcc,
        }
    }
}

/// Lidar odometry: registers each scan against a map of the scans before.
#[derive(Clone)]
pub struct Odometry {
    options: OdometryOptions,
    submap: Option<Submap>,
    centroids_m: Vec<Vector3<f64>>,
}

impl Odometry {
    /// Creates an odometry without a map.
    pub fn new(options: OdometryOptions) -> Odometry {
        Odometry {
            options,
            submap: None,
            centroids_m: Vec::new(),
        }
    }

    /// Registers the next scan, in order of time.
    ///
    /// # Errors
    /// If the options give no lattice.
    pub fn register(&mut self, scan: &Scan, prior: &Prior) -> Result<ScanResult, LatticeError> {
        let kind = self.options.lattice;
        let (first_ns, end_ns) = scan.span_ns();
        let Some(submap) = self.submap.as_mut().filter(|map| !map.is_given_up(end_ns)) else {
            return self.begin(scan, prior);
        };

        // Predict the motion since the last scan.
        let predicted = submap.motion.predict(submap.end_ns, end_ns, prior);
        let guess = submap.odom_from_base * predicted;
        let was_lost = submap.is_lost(end_ns);

        // Register, deskewed by the predicted velocity, then by the one found.
        let mut velocity = match prior.motion {
            Some(_) => submap.velocity_to(&guess, end_ns),
            None => submap.motion.velocity(),
        };
        let mut found = guess;
        let mut pass = 1;
        let (sample, alignment) = loop {
            let sweep = Sweep::new(first_ns, end_ns, &velocity, prior.rates);
            let points_m = sweep.deskew(scan.points_m, scan.times_ns);
            let sample = submap.sizes.sample(&points_m, kind)?;
            let alignment = match pass {
                1 => submap.align_around(&sample, &found),
                _ => submap.align(&sample, &found, &Held::default()),
            };
            let is_usual = !submap.is_suspicious(&alignment);
            if pass >= if is_usual { PASSES.0 } else { PASSES.1 } {
                break (sample, alignment);
            }
            pass += 1;
            found = alignment.map_from_base;
            velocity = submap.velocity_to(&found, end_ns);
            submap.deskew_first(&velocity, kind)?;
        };

        // Leave what the map does not show to the prediction.
        let (weak, contrast) =
            submap.weak_directions(&sample, &alignment, least_contrast(was_lost));
        let alignment = match weak.is_empty() {
            true => alignment,
            false => submap.align(&sample, &guess, &alignment.geometry.hold(&weak)),
        };

        // Judge, and grow the map by what is certain.
        let weak_m = match weak.is_empty() {
            true => 0.0,
            false => submap.motion.add_weak(&predicted, prior),
        };
        let verdict = judge(Evidence {
            points: sample.registered_m.len(),
            overlap: alignment.overlap,
            usual_overlap: submap.usual_overlap,
            was_lost,
            is_one_place: submap.is_one_place(&alignment.map_from_base),
            weak,
            weak_m,
        });
        let result = submap.follow((first_ns, end_ns), &sample, &alignment, &guess, verdict);
        self.centroids_m = sample.centroids_m;
        Ok(ScanResult { contrast, ..result })
    }

    /// Begins a submap with a scan, at the pose predicted from the submap before.
    fn begin(&mut self, scan: &Scan, prior: &Prior) -> Result<ScanResult, LatticeError> {
        let kind = self.options.lattice;
        let (first_ns, end_ns) = scan.span_ns();
        let odom_from_base = self
            .submap
            .as_ref()
            .map_or_else(Isometry3::identity, |before| {
                before.odom_from_base * before.motion.predict(before.end_ns, end_ns, prior)
            });
        // A map of which no pose was certain is replaced.
        let number = match &self.submap {
            Some(before) if before.only_place_m.is_some() => before.number,
            Some(before) => before.number + 1,
            None => 0,
        };
        let sizes = Sizes::of(scan.points_m, kind)?;
        let sample = sizes.sample(scan.points_m, kind)?;
        let mut result = ScanResult {
            first_ns,
            odom_from_first: odom_from_base,
            end_ns,
            odom_from_base,
            covariance: Matrix6::zeros(),
            drift: Matrix6::zeros(),
            verdict: Verdict::Lost(LostCause::FewPoints),
            submap: number,
            overlap: 0.0,
            points: sample.registered_m.len(),
            contrast: 0.0,
        };
        if !can_begin(sample.registered_m.len()) {
            return Ok(result);
        }
        let mut submap = Submap::new(number, scan, sizes, kind, odom_from_base)?;
        submap.grow(&sample);
        self.submap = Some(submap);
        self.centroids_m = sample.centroids_m;
        result.verdict = Verdict::Lost(LostCause::OnePlace);
        (result.overlap, result.contrast) = (1.0, f64::INFINITY);
        Ok(result)
    }

    /// Map of the scans of the submap.
    pub fn map(&self) -> Option<&MomentMap> {
        self.submap.as_ref().map(|submap| &submap.map)
    }

    /// Centroids of the cells of the last scan, deskewed, metres, in the frame of the base at the end of the scan.
    pub fn centroids_m(&self) -> &[Vector3<f64>] {
        &self.centroids_m
    }

    /// Current cell sizes.
    pub fn sizes(&self) -> Option<Sizes> {
        self.submap.as_ref().map(|submap| submap.sizes)
    }
}
