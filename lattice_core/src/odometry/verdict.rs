//! Verdict on the pose of a scan.

use std::fmt;

use nalgebra::Vector6;

/// Fewest registered points of a pose.
const MIN_POINTS: usize = 100;
/// Part of the points that the map explains below which a pose is lost, absolute and of what is usual in the map.
const MIN_OVERLAP: f64 = 0.2;
const MIN_OF_USUAL: f64 = 0.65;
/// Part of the usual overlap after which a lost scan is found again in the same map.
const FOUND_OF_USUAL: f64 = 0.8;
/// Three standard deviations along weak directions beyond which a pose is lost, metres.
pub(super) const MAX_WEAK_M: f64 = 1.0;
/// Part of the displacements that a motion makes which planes show, below which the motion is tried for its contrast. In a
/// tunnel without features noise alone gives up to 0.3 in the map of one scan.
const TRIED_PART: f64 = 0.3;
/// The weakest directions are always tried.
const ALWAYS_TRIED: usize = 2;
/// Contrast below which a direction is weak, in standard deviations: 99 % of the scans of simulated corridors have more
/// than 24, in tunnels without features the 95th percentile in a map of many scans is 16.
const LEAST_CONTRAST: f64 = 20.0;

/// Verdict on the pose of a scan.
#[derive(Clone, Debug, PartialEq)]
pub enum Verdict {
    /// The map holds the pose in all directions.
    Ok,
    /// The map does not hold the pose along these directions, where it is predicted. The map does not grow.
    Weak(Vec<WeakDirection>),
    /// The pose is a prediction.
    Lost(LostCause),
}

/// A direction of motion that the surfaces in view do not show, in the axes of the map about the base.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WeakDirection {
    /// Translation (m) and rotation (rad) of a motion along it.
    pub motion: Vector6<f64>,
    /// Part of the displacement of points that planes show.
    pub part: f64,
}

impl WeakDirection {
    /// True if a direction is to be tried for its contrast, by its place among all, weakest first.
    pub(super) fn is_tried(&self, place: usize) -> bool {
        place < ALWAYS_TRIED || self.part < TRIED_PART
    }
}

/// Reason for which a pose is lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LostCause {
    /// The scan has too few points.
    FewPoints,
    /// The map does not explain the scan.
    NoOverlap,
    /// Motion along a weak direction is not known to `MAX_WEAK_M`.
    Unobservable,
    /// The map was seen from one place only: points of the same beams agree there whatever the motion is.
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
    /// Mean overlap of scans that were `OK` in this map.
    pub usual_overlap: f64,
    /// True if the scan before was lost, or long ago.
    pub was_lost: bool,
    /// True if the scan is where the whole map was seen from.
    pub is_one_place: bool,
    pub weak: Vec<WeakDirection>,
    /// Three standard deviations along weak directions, metres.
    pub weak_m: f64,
}

/// The verdict.
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

/// Contrast below which a direction is weak: larger before a lost scan is believed again.
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
