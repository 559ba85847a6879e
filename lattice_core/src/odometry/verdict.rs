//! Verdict on the pose of a scan.

use std::fmt;

use nalgebra::Vector6;

/// Minimum number of registered points.
const MIN_POINTS: usize = 100;
/// Inlier fraction below which a pose is lost: absolute, and relative to the usual fraction of the map.
const MIN_OVERLAP: f64 = 0.2;
const MIN_OF_USUAL: f64 = 0.65;
/// Inlier fraction, relative to the usual one, above which a lost scan is localized again in the same map.
const FOUND_OF_USUAL: f64 = 0.8;
/// Three standard deviations along weak directions above which a pose is lost, metres.
pub(super) const MAX_WEAK_M: f64 = 1.0;
/// Observed fraction of a motion below which its contrast is tested. In a tunnel without features, noise alone gives
/// up to 0.3 in the map of one scan.
const TRIED_PART: f64 = 0.3;
/// Number of weakest directions that are always tested.
const ALWAYS_TRIED: usize = 2;
/// Contrast below which a direction is weak, in standard deviations: 99 % of the scans of simulated corridors exceed
/// 24; in tunnels without features, the 95th percentile in a map of many scans is 16.
const LEAST_CONTRAST: f64 = 20.0;

/// Verdict on the pose of a scan.
#[derive(Clone, Debug, PartialEq)]
pub enum Verdict {
    /// The map constrains the pose in all directions.
    Ok,
    /// The map does not constrain the pose along these directions; there it is predicted. The map is not extended.
    Weak(Vec<WeakDirection>),
    /// The registration failed; the pose is predicted.
    Lost(LostCause),
}

/// Degenerate direction: a motion that the visible surfaces do not constrain, in the axes of the map about the base.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WeakDirection {
    /// Translation (m) and rotation (rad) of the motion.
    pub motion: Vector6<f64>,
    /// Observed fraction of the motion: squared displacement of the points normal to their planes, divided by all of
    /// it.
    pub part: f64,
}

impl WeakDirection {
    /// True if a direction is tested for its contrast, by its rank among all, weakest first.
    pub(super) fn is_tried(&self, place: usize) -> bool {
        place < ALWAYS_TRIED || self.part < TRIED_PART
    }
}

/// Reason why a pose is lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LostCause {
    /// The scan has too few points.
    FewPoints,
    /// The map does not explain the scan.
    NoOverlap,
    /// The motion along a weak direction is uncertain by more than `MAX_WEAK_M`.
    Unobservable,
    /// All scans of the map were taken at one position: points of the same beams agree there at any motion.
    OnePlace,
}

impl fmt::Display for LostCause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            LostCause::FewPoints => "too few points",
            LostCause::NoOverlap => "the map does not explain the scan",
            LostCause::Unobservable => "the surfaces in view do not show the motion",
            LostCause::OnePlace => "the machine has not moved since its map began",
        })
    }
}

/// Evidence for a verdict.
pub(super) struct Evidence {
    pub points: usize,
    pub overlap: f64,
    /// Mean inlier fraction of scans with verdict `OK` in this map.
    pub usual_overlap: f64,
    /// True if the previous scan was lost, or too long ago.
    pub was_lost: bool,
    /// True if the pose is at the only position of the scans in the map.
    pub is_one_place: bool,
    pub weak: Vec<WeakDirection>,
    /// Three standard deviations along weak directions, metres.
    pub weak_m: f64,
}

/// Determines the verdict.
pub(super) fn judge(evidence: Evidence) -> Verdict {
    let of_usual = match evidence.was_lost {
        true => FOUND_OF_USUAL,
        false => MIN_OF_USUAL,
    };
    if evidence.points < MIN_POINTS {
        return Verdict::Lost(LostCause::FewPoints);
    }
    if evidence.overlap < MIN_OVERLAP.max(of_usual * evidence.usual_overlap) {
        return Verdict::Lost(LostCause::NoOverlap);
    }
    if evidence.weak.is_empty() {
        return match evidence.is_one_place {
            true => Verdict::Lost(LostCause::OnePlace),
            false => Verdict::Ok,
        };
    }
    if evidence.was_lost || evidence.weak_m > MAX_WEAK_M {
        return Verdict::Lost(LostCause::Unobservable);
    }
    Verdict::Weak(evidence.weak)
}

/// Contrast below which a direction is weak; higher for a scan after a lost one.
pub(super) fn least_contrast(was_lost: bool) -> f64 {
    match was_lost {
        true => 1.5 * LEAST_CONTRAST,
        false => LEAST_CONTRAST,
    }
}

/// True if a scan can begin a map.
pub(super) fn can_begin(points: usize) -> bool {
    points >= MIN_POINTS
}
