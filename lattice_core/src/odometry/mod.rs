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
mod sweep;
mod verdict;

mod surface;
#[cfg(test)]
mod tests;

use nalgebra::{Isometry3, Matrix6, Vector3, Vector6};

pub use moment_map::MomentMap;
pub use moments::Moments;
pub use motion::Prior;
pub use sampling::Sizes;
pub use sweep::AngularRate;
pub use verdict::{LostCause, Verdict, WeakDirection};

use crate::cloud::NO_TIME_NS;
use crate::lattice::{Lattice, LatticeError, LatticeKind};
use align::{Alignment, Held, align, weak_directions};
use motion::{Motion, carried, seconds};
use sampling::Sample;
use sweep::Sweep;
use verdict::{Evidence, WEAK_PART, can_begin, judge};

/// Registrations of a scan, each deskewed by the velocity that the one before found.
const PASSES: usize = 2;
/// Cells of the map, at 400 bytes each.
const MAX_CELLS: usize = 500_000;
/// Distance to which the map is kept, in largest distances of points of a scan.
const KEPT_RANGES: f64 = 1.5;
/// Scans of a new map that are added wherever the base is.
const FIRST_SCANS: usize = 5;
/// Time between scans beyond which motion cannot be predicted, in seconds.
const MAX_GAP_S: f64 = 0.5;
/// Time for which a lost scan is looked for in the map before a new submap begins, in seconds.
const RESUME_S: f64 = 1.0;
/// Weight of the newest overlap in its mean.
const NEWEST: f64 = 0.1;
/// Factor from the inverse of the information to the covariance: points of a cell share its errors.
const CORRELATION: f64 = 25.0;

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

/// A scan in the frame of the base.
#[derive(Clone, Copy, Debug)]
pub struct Scan<'a> {
    /// Points, metres.
    pub points_m: &'a [Vector3<f64>],
    /// Time of each point, nanoseconds; `None`: all at the stamp.
    pub times_ns: Option<&'a [i64]>,
    /// Stamp, nanoseconds.
    pub stamp_ns: i64,
}

impl Scan<'_> {
    /// Times of the first and the last point; the stamp without times.
    pub fn span_ns(&self) -> (i64, i64) {
        let times = self.times_ns.into_iter().flatten().copied();
        let known = times.filter(|time| *time != NO_TIME_NS);
        let span = known.fold(None, |span: Option<(i64, i64)>, time| {
            let (first, last) = span.unwrap_or((time, time));
            Some((first.min(time), last.max(time)))
        });
        span.unwrap_or((self.stamp_ns, self.stamp_ns))
    }
}

/// The pose of a scan.
#[derive(Clone, Debug, PartialEq)]
pub struct ScanResult {
    /// Time of the first point, nanoseconds.
    pub first_ns: i64,
    /// Pose of the base at that time.
    pub odom_from_first: Isometry3<f64>,
    /// Time of the last point, nanoseconds.
    pub end_ns: i64,
    /// Pose of the base at that time.
    pub odom_from_base: Isometry3<f64>,
    /// Covariance of a perturbation (translation, rotation) in the axes of `odom` about the base since the beginning of
    /// the submap, m^2, m rad and rad^2.
    pub covariance: Matrix6<f64>,
    /// Verdict.
    pub verdict: Verdict,
    /// Number of the submap, from 0. Poses of two submaps are not known to each other.
    pub submap: u32,
    /// Part of the registered points that the map explains.
    pub overlap: f64,
    /// Points that were registered.
    pub points: usize,
    /// Part of the points whose planes hold the weakest direction.
    pub weakest: f64,
}

/// Odometry by scans.
#[derive(Clone)]
pub struct Odometry {
    options: OdometryOptions,
    submap: Option<Submap>,
    submaps: u32,
}

/// The map of the scans before and the motion in it.
#[derive(Clone)]
struct Submap {
    number: u32,
    map: MomentMap,
    sizes: Sizes,
    motion: Motion,
    end_ns: i64,
    odom_from_base: Isometry3<f64>,
    /// Without that of the last registration.
    covariance: Matrix6<f64>,
    usual_overlap: f64,
    scans: usize,
    /// Pose of the scan added last.
    added_at: Isometry3<f64>,
    lost_since_ns: Option<i64>,
    /// The first scan while it is the whole map.
    first: Option<FirstScan>,
}

/// A scan that was added before its velocity was known.
#[derive(Clone)]
struct FirstScan {
    points_m: Vec<Vector3<f64>>,
    times_ns: Vec<i64>,
    span_ns: (i64, i64),
}

impl Odometry {
    /// Odometry that has seen nothing.
    pub fn new(options: OdometryOptions) -> Odometry {
        Odometry {
            options,
            submap: None,
            submaps: 0,
        }
    }

    /// The pose of a scan. Scans come in the order of time.
    ///
    /// Fails if the options give no lattice.
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
        let mut velocity = submap.motion.velocity();
        let mut found = guess;
        for _ in 1..PASSES {
            let sweep = Sweep::new(first_ns, end_ns, &velocity, prior.rates);
            let points_m = sweep.deskew(scan.points_m, scan.times_ns);
            let sample = submap.sizes.sample(&points_m, kind)?;
            found = submap.align(&sample, &found, &Held::new()).map_from_base;
            velocity = submap.velocity_to(&found, end_ns);
            submap.deskew_first(&velocity, kind)?;
        }
        let sweep = Sweep::new(first_ns, end_ns, &velocity, prior.rates);
        let points_m = sweep.deskew(scan.points_m, scan.times_ns);
        let sample = submap.sizes.sample(&points_m, kind)?;
        let alignment = submap.align(&sample, &found, &Held::new());

        // Leave what the map does not show to the prediction.
        let weak = weak_directions(&alignment.geometry, WEAK_PART);
        let held: Held = weak.iter().map(|(_, direction)| *direction).collect();
        let alignment = match held.is_empty() {
            true => alignment,
            false => submap.align(&sample, &guess, &held),
        };

        // Judge, and grow the map by what is certain.
        let weak_m = match held.is_empty() {
            true => 0.0,
            false => submap.motion.add_weak(&predicted, prior),
        };
        let verdict = judge(Evidence {
            points: sample.registered_m.len(),
            overlap: alignment.overlap,
            usual_overlap: submap.usual_overlap,
            was_lost,
            weak: weak
                .iter()
                .map(|weak| direction(weak, sample.arm_m))
                .collect(),
            weak_m,
        });
        Ok(submap.follow((first_ns, end_ns), &sample, &alignment, &guess, verdict))
    }

    /// Begins a submap with a scan, where the motion of the one before leads.
    fn begin(&mut self, scan: &Scan, prior: &Prior) -> Result<ScanResult, LatticeError> {
        let kind = self.options.lattice;
        let (first_ns, end_ns) = scan.span_ns();
        let odom_from_base = self
            .submap
            .as_ref()
            .map_or_else(Isometry3::identity, |before| {
                before.odom_from_base * before.motion.predict(before.end_ns, end_ns, prior)
            });
        let sizes = Sizes::of(scan.points_m, kind)?;
        let sample = sizes.sample(scan.points_m, kind)?;
        let mut result = ScanResult {
            first_ns,
            odom_from_first: odom_from_base,
            end_ns,
            odom_from_base,
            covariance: Matrix6::zeros(),
            verdict: Verdict::Lost(LostCause::FewPoints),
            submap: self.submaps,
            overlap: 0.0,
            points: sample.registered_m.len(),
            weakest: 0.0,
        };
        if !can_begin(sample.registered_m.len()) {
            return Ok(result);
        }
        let lattice = Lattice::new(kind, sizes.map_m.powi(3))?;
        let mut submap = Submap {
            number: self.submaps,
            map: MomentMap::new(lattice, MAX_CELLS),
            sizes,
            motion: Motion::unknown(),
            end_ns,
            odom_from_base,
            covariance: Matrix6::zeros(),
            usual_overlap: 0.0,
            scans: 0,
            added_at: odom_from_base,
            lost_since_ns: None,
            first: scan.times_ns.map(|times_ns| FirstScan {
                points_m: scan.points_m.to_vec(),
                times_ns: times_ns.to_vec(),
                span_ns: (first_ns, end_ns),
            }),
        };
        submap.grow(&sample);
        self.submaps += 1;
        self.submap = Some(submap);
        (result.verdict, result.overlap, result.weakest) = (Verdict::Ok, 1.0, 1.0);
        Ok(result)
    }

    /// The map of the scans before.
    pub fn map(&self) -> Option<&MomentMap> {
        self.submap.as_ref().map(|submap| &submap.map)
    }

    /// Sizes of cells in use.
    pub fn sizes(&self) -> Option<Sizes> {
        self.submap.as_ref().map(|submap| submap.sizes)
    }
}

impl Submap {
    fn is_lost(&self, end_ns: i64) -> bool {
        self.lost_since_ns.is_some() || seconds(self.end_ns, end_ns) > MAX_GAP_S
    }

    fn is_given_up(&self, end_ns: i64) -> bool {
        let since = self.lost_since_ns;
        since.is_some_and(|since_ns| seconds(since_ns, end_ns) > RESUME_S)
    }

    fn velocity_to(&self, odom_from_base: &Isometry3<f64>, end_ns: i64) -> Vector6<f64> {
        let motion = self.odom_from_base.inverse() * odom_from_base;
        let seconds = seconds(self.end_ns, end_ns);
        match seconds > 0.0 {
            true => crate::pose::se3::log(&motion) / seconds,
            false => Vector6::zeros(),
        }
    }

    fn align(&self, sample: &Sample, guess: &Isometry3<f64>, held: &Held) -> Alignment {
        let (points, gate_m) = (&sample.registered_m, self.motion.gate_m());
        align(&self.map, points, guess, gate_m, sample.arm_m, held)
    }

    /// Makes the map anew from its only scan, deskewed by the velocity that the second one shows.
    fn deskew_first(
        &mut self,
        velocity: &Vector6<f64>,
        kind: LatticeKind,
    ) -> Result<(), LatticeError> {
        let Some(first) = &self.first else {
            return Ok(());
        };
        let sweep = Sweep::new(first.span_ns.0, first.span_ns.1, velocity, &[]);
        let points_m = sweep.deskew(&first.points_m, Some(&first.times_ns));
        let sample = self.sizes.sample(&points_m, kind)?;
        self.map = MomentMap::new(self.map.lattice().clone(), MAX_CELLS);
        self.scans = 0;
        self.grow(&sample);
        Ok(())
    }

    /// Takes a judged scan: pose, motion, covariance, and the map if it is certain.
    fn follow(
        &mut self,
        (first_ns, end_ns): (i64, i64),
        sample: &Sample,
        alignment: &Alignment,
        guess: &Isometry3<f64>,
        verdict: Verdict,
    ) -> ScanResult {
        let before = self.odom_from_base;
        let is_lost = matches!(verdict, Verdict::Lost(_));
        self.odom_from_base = match is_lost {
            true => *guess,
            false => alignment.map_from_base,
        };
        let displacement = self.odom_from_base.translation.vector - before.translation.vector;
        self.covariance = carried(&self.covariance, &displacement);
        let registration = covariance_of(alignment, self.motion.weak_m(), &verdict, sample.arm_m);
        let span_s = seconds(self.end_ns, end_ns);
        if is_lost {
            self.lost_since_ns.get_or_insert(end_ns);
        } else {
            let (found, predicted) = (
                before.inverse() * self.odom_from_base,
                before.inverse() * guess,
            );
            self.motion.update(&found, &predicted, span_s, sample.arm_m);
            self.lost_since_ns = None;
        }
        if verdict == Verdict::Ok {
            self.first = None;
            self.motion.end_weak();
            let newest = if self.usual_overlap > 0.0 {
                NEWEST
            } else {
                1.0
            };
            self.usual_overlap += newest * (alignment.overlap - self.usual_overlap);
            // As the base moves by the range of its points, the map is replaced, with the error of one registration.
            let replaced = (displacement.norm() / sample.arm_m).min(1.0);
            self.covariance += registration * replaced;
            if self.is_elsewhere(sample.arm_m) || self.scans < FIRST_SCANS {
                self.grow(sample);
            }
        }
        self.end_ns = end_ns;
        self.sizes.follow(sample);
        let weakest = nalgebra::SymmetricEigen::new(alignment.geometry)
            .eigenvalues
            .min();
        let sweep = Sweep::new(first_ns, end_ns, &self.motion.velocity(), &[]);
        ScanResult {
            first_ns,
            odom_from_first: self.odom_from_base * sweep.first(),
            end_ns,
            odom_from_base: self.odom_from_base,
            covariance: self.covariance + registration,
            verdict,
            submap: self.number,
            overlap: alignment.overlap,
            points: sample.registered_m.len(),
            weakest,
        }
    }

    /// True if points of the scan lie half a centroid's cell from where the last ones were added: an independent
    /// observation. A base at rest adds nothing, so that its map does not creep.
    fn is_elsewhere(&self, arm_m: f64) -> bool {
        let apart = self.added_at.inverse() * self.odom_from_base;
        let moved_m = apart.translation.vector.norm() + arm_m * apart.rotation.angle();
        moved_m > self.sizes.centroids_m / 2.0
    }

    fn grow(&mut self, sample: &Sample) {
        let pose = self.odom_from_base;
        let placed = sample.centroids_m.iter();
        let placed: Vec<_> = placed
            .map(|point| pose.rotation * point + pose.translation.vector)
            .collect();
        self.map.add(&placed);
        let ranges = sample.centroids_m.iter().map(Vector3::norm);
        let range_m = ranges.fold(0.0, f64::max);
        self.map
            .keep_within(&pose.translation.vector, KEPT_RANGES * range_m);
        self.added_at = pose;
        self.scans += 1;
    }
}

/// Covariance of one registration; along weak directions that of the prediction.
fn covariance_of(
    alignment: &Alignment,
    weak_m: f64,
    verdict: &Verdict,
    arm_m: f64,
) -> Matrix6<f64> {
    let unknown = Matrix6::identity() * verdict::MAX_WEAK_M.powi(2);
    let inverse = alignment.information.try_inverse();
    let mut covariance = inverse.map_or(unknown, |inverse| inverse * CORRELATION);
    match verdict {
        Verdict::Ok => {}
        Verdict::Weak(directions) => {
            for weak in directions {
                covariance += weak.motion * weak.motion.transpose() * (weak_m * weak_m);
            }
        }
        Verdict::Lost(_) => {
            let turn = (verdict::MAX_WEAK_M / arm_m).powi(2);
            let spread = Vector6::new(1.0, 1.0, 1.0, turn, turn, turn);
            covariance = Matrix6::from_diagonal(&spread);
        }
    }
    covariance
}

/// A weak direction in metres and radians.
fn direction((part, scaled): &(f64, Vector6<f64>), arm_m: f64) -> WeakDirection {
    let mut motion = *scaled;
    let mut turn = motion.fixed_rows_mut::<3>(3);
    turn /= arm_m;
    WeakDirection {
        motion,
        part: *part,
    }
}
