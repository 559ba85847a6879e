//! The map of the scans before, and how it takes the next one.

use nalgebra::{Isometry3, Matrix6, Vector3, Vector6};

use super::align::{Alignment, Held, align, contrast};
use super::moment_map::MomentMap;
use super::motion::{Motion, carried, seconds};
use super::sampling::{Sample, Sizes};
use super::sweep::Sweep;
use super::verdict::{self, LostCause, Verdict, WeakDirection};
use super::{Scan, ScanResult};
use crate::lattice::{Lattice, LatticeError, LatticeKind};

/// Limit of cells of the map, at 400 bytes each.
const MAX_CELLS: usize = 500_000;
/// Distance within which the map is kept, in maximum ranges of a scan.
const KEPT_RANGES: f64 = 1.5;
/// Number of scans of a new map that are added at any distance.
const FIRST_SCANS: usize = 5;
/// Distance from the first pose of a map above which its verdicts count, metres: without observed motion, the first
/// poses agree within some centimetres.
const LEAVE_M: f64 = 0.3;
/// Time between scans above which motion cannot be predicted, s.
const MAX_GAP_S: f64 = 0.5;
/// Time for which a lost scan is searched in the map before a new submap begins, s.
const RESUME_S: f64 = 1.0;
/// Inlier fraction of the second scan in a map of one scan: its beams lie between those of the first.
const FIRST_OVERLAP: f64 = 0.7;
/// Inlier fraction, relative to the usual one, below which a registration is repeated from other guesses.
const SUSPICIOUS: f64 = 0.9;
/// Weight of the newest inlier fraction in the mean.
const NEWEST: f64 = 0.1;
/// Factor from the inverse of the information to the covariance: errors of points in a cell are correlated.
const CORRELATION: f64 = 100.0;
/// Common error of all surfaces of a map, metres, as measured in simulated drives.
const SURFACE_ERROR_M: f64 = 0.005;
/// Fraction of the deviation from constant velocity that remains in the pose of a scan, since it was deskewed by a
/// constant one.
const DESKEW_ERROR: f64 = 0.5;

/// Map of the previous scans, and the motion in it.
#[derive(Clone)]
pub(super) struct Submap {
    pub number: u32,
    pub map: MomentMap,
    pub sizes: Sizes,
    pub motion: Motion,
    pub end_ns: i64,
    pub odom_from_base: Isometry3<f64>,
    /// Covariance without that of the last registration.
    pub covariance: Matrix6<f64>,
    pub usual_overlap: f64,
    pub scans: usize,
    /// Pose of the scan added last.
    pub added_at: Isometry3<f64>,
    /// Position of the first scan until the machine has left it, metres.
    pub only_place_m: Option<Vector3<f64>>,
    pub lost_since_ns: Option<i64>,
    /// First scan, while it is the whole map.
    pub first: Option<FirstScan>,
}

/// Scan added before its velocity was known.
#[derive(Clone)]
pub(super) struct FirstScan {
    pub points_m: Vec<Vector3<f64>>,
    pub times_ns: Vec<i64>,
    pub span_ns: (i64, i64),
}

impl Submap {
    /// Begins a submap at a scan, without its points.
    ///
    /// # Errors
    /// If the sizes give no lattice.
    pub fn new(
        number: u32,
        scan: &Scan,
        sizes: Sizes,
        kind: LatticeKind,
        odom_from_base: Isometry3<f64>,
    ) -> Result<Submap, LatticeError> {
        let span_ns = scan.span_ns();
        let lattice = Lattice::new(kind, sizes.map_m.powi(3))?;
        Ok(Submap {
            number,
            map: MomentMap::new(lattice, MAX_CELLS),
            sizes,
            motion: Motion::unknown(),
            end_ns: span_ns.1,
            odom_from_base,
            covariance: Matrix6::zeros(),
            usual_overlap: FIRST_OVERLAP,
            scans: 0,
            added_at: odom_from_base,
            only_place_m: Some(odom_from_base.translation.vector),
            lost_since_ns: None,
            first: scan.times_ns.map(|times_ns| FirstScan {
                points_m: scan.points_m.to_vec(),
                times_ns: times_ns.to_vec(),
                span_ns,
            }),
        })
    }

    /// True if a pose is at the only position of the scans in the map.
    pub fn is_one_place(&self, pose: &Isometry3<f64>) -> bool {
        let is_near = |place: Vector3<f64>| (pose.translation.vector - place).norm() < LEAVE_M;
        self.only_place_m.is_some_and(is_near)
    }

    /// Weak directions: motions by a cell size after which the map explains a scan as well, weakest first; and the
    /// smallest contrast of the tested ones.
    pub fn weak_directions(
        &self,
        sample: &Sample,
        alignment: &Alignment,
        least: f64,
    ) -> (Vec<WeakDirection>, f64) {
        let shift = self.sizes.map_m * alignment.geometry.per_meter();
        let directions = alignment.geometry.directions().into_iter().enumerate();
        let tried = directions.filter(|(place, direction)| direction.is_tried(*place));
        let with_contrast = tried.map(|(_, direction)| {
            let (points, motion) = (&sample.registered_m, direction.motion * shift);
            let (pose, gate_m) = (&alignment.map_from_base, self.motion.gate_m());
            (
                contrast(&self.map, points, pose, &motion, gate_m),
                direction,
            )
        });
        let all: Vec<(f64, WeakDirection)> = with_contrast.collect();
        let smallest = all.iter().map(|(contrast, _)| *contrast);
        let smallest = smallest.fold(f64::INFINITY, f64::min);
        let weak = all.into_iter().filter(|(contrast, _)| *contrast < least);
        (weak.map(|(_, direction)| direction).collect(), smallest)
    }

    /// True if the previous scan was lost, or so long ago that motion cannot be predicted.
    pub fn is_lost(&self, end_ns: i64) -> bool {
        self.lost_since_ns.is_some() || seconds(self.end_ns, end_ns) > MAX_GAP_S
    }

    /// True if a lost scan is no longer searched in this map.
    pub fn is_given_up(&self, end_ns: i64) -> bool {
        let since = self.lost_since_ns;
        since.is_some_and(|since_ns| seconds(since_ns, end_ns) > RESUME_S)
    }

    /// Velocity that leads to a pose, in the frame of the base, m/s and rad/s.
    pub fn velocity_to(&self, odom_from_base: &Isometry3<f64>, end_ns: i64) -> Vector6<f64> {
        let motion = self.odom_from_base.inverse() * odom_from_base;
        let seconds = seconds(self.end_ns, end_ns);
        match seconds > 0.0 {
            true => crate::pose::se3::log(&motion) / seconds,
            false => Vector6::zeros(),
        }
    }

    /// True if the inlier fraction of a scan is lower than usual.
    pub fn is_suspicious(&self, alignment: &Alignment) -> bool {
        alignment.overlap < SUSPICIOUS * self.usual_overlap
    }

    /// Registers a scan, from other guesses too if the first result is suspicious: when a machine begins to turn, far
    /// points lie beyond the cells around their guess, and at the second scan the velocity is unknown.
    pub fn align_around(&self, sample: &Sample, guess: &Isometry3<f64>) -> Alignment {
        let free = Held::default();
        let mut best = self.align(sample, guess, &free);
        if !self.is_suspicious(&best) {
            return best;
        }
        // Points at the root mean square of distances move by one or two cells.
        let side_m = self.sizes.map_m;
        let turns = Vector3::z() * (side_m / sample.arm_m);
        let turned = |steps: f64| Isometry3::rotation(turns * steps);
        let mut others: Vec<Isometry3<f64>> = [-2.0, -1.0, 1.0, 2.0].map(turned).into();
        if self.motion.is_unknown() {
            for axis in [Vector3::x(), Vector3::y()] {
                let moved = |steps: f64| Isometry3::from(axis * (side_m * steps));
                others.extend([-2.0, -1.0, 1.0, 2.0].map(moved));
            }
        }
        for other in others {
            let other = self.align(sample, &(guess * other), &free);
            if other.overlap > best.overlap {
                best = other;
            }
        }
        best
    }

    /// Registers a scan from a guess.
    pub fn align(&self, sample: &Sample, guess: &Isometry3<f64>, held: &Held) -> Alignment {
        let (points, gate_m) = (&sample.registered_m, self.motion.gate_m());
        align(&self.map, points, guess, gate_m, held)
    }

    /// Rebuilds the map from its only scan, deskewed by the velocity found with the second one.
    pub fn deskew_first(
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

    /// Adds a judged scan: pose, motion, covariance, and the map if its pose is certain.
    pub fn follow(
        &mut self,
        (first_ns, end_ns): (i64, i64),
        sample: &Sample,
        alignment: &Alignment,
        guess: &Isometry3<f64>,
        verdict: Verdict,
    ) -> ScanResult {
        let before = self.odom_from_base;
        // At its first place a map is followed and filled, though nothing is said of its poses.
        let is_one_place = verdict == Verdict::Lost(LostCause::OnePlace);
        let is_lost = matches!(verdict, Verdict::Lost(_)) && !is_one_place;
        self.odom_from_base = match is_lost {
            true => *guess,
            false => alignment.map_from_base,
        };
        let displacement = self.odom_from_base.translation.vector - before.translation.vector;
        self.covariance = carried(&self.covariance, &displacement);
        let deviation = match self.motion.is_unknown() {
            true => Vector6::zeros(),
            false => between(guess, &alignment.map_from_base) * DESKEW_ERROR,
        };
        let mut registration =
            covariance_of(alignment, self.motion.weak_m(), &verdict, sample.arm_m);
        registration += deviation * deviation.transpose();
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
        if is_one_place {
            self.first = None;
        }
        if (is_one_place || verdict == Verdict::Ok)
            && (self.is_elsewhere(sample.arm_m) || self.scans < FIRST_SCANS)
        {
            self.grow(sample);
        }
        if verdict == Verdict::Ok {
            (self.first, self.only_place_m) = (None, None);
            self.motion.end_weak();
            self.usual_overlap += NEWEST * (alignment.overlap - self.usual_overlap);
            // As the base moves by the range of its points, the map is replaced, with the error of one registration.
            let replaced = (displacement.norm() / sample.arm_m).min(1.0);
            self.covariance += registration * replaced;
        }
        self.end_ns = end_ns;
        self.sizes.follow(sample);
        let sweep = Sweep::new(first_ns, end_ns, &self.motion.velocity(), &[]);
        ScanResult {
            first_ns,
            odom_from_first: self.odom_from_base * sweep.first(),
            end_ns,
            odom_from_base: self.odom_from_base,
            covariance: self.covariance + registration,
            drift: self.covariance,
            verdict,
            submap: self.number,
            overlap: alignment.overlap,
            points: sample.registered_m.len(),
            contrast: 0.0,
        }
    }

    /// True if the points of the scan lie half a centroid's cell from those added last, so that they are an
    /// independent observation. A base at rest adds nothing, so its map does not drift.
    pub fn is_elsewhere(&self, arm_m: f64) -> bool {
        let apart = self.added_at.inverse() * self.odom_from_base;
        let moved_m = apart.translation.vector.norm() + arm_m * apart.rotation.angle();
        moved_m > self.sizes.centroids_m / 2.0
    }

    /// Adds a scan at the pose.
    pub fn grow(&mut self, sample: &Sample) {
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
        self.map.renew_surfaces();
        self.added_at = pose;
        self.scans += 1;
    }
}

/// Motion (translation, rotation) from one pose to another, in the axes of the map about the base.
fn between(from: &Isometry3<f64>, to: &Isometry3<f64>) -> Vector6<f64> {
    let moved = to.translation.vector - from.translation.vector;
    let turned = (to.rotation * from.rotation.inverse()).scaled_axis();
    Vector6::new(moved.x, moved.y, moved.z, turned.x, turned.y, turned.z)
}

/// Covariance of one registration; along weak directions, that of the prediction.
fn covariance_of(
    alignment: &Alignment,
    weak_m: f64,
    verdict: &Verdict,
    arm_m: f64,
) -> Matrix6<f64> {
    let unknown = Matrix6::identity() * verdict::MAX_WEAK_M.powi(2);
    let inverse = alignment.information.try_inverse();
    let mut covariance = inverse.map_or(unknown, |inverse| inverse * CORRELATION);
    let turn = (SURFACE_ERROR_M / arm_m).powi(2);
    let floor = SURFACE_ERROR_M.powi(2);
    covariance += Matrix6::from_diagonal(&Vector6::new(floor, floor, floor, turn, turn, turn));
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
