//! Loop closure: places that a drive comes back to, found, verified, and used to correct all its poses.
//!
//! A drive is cut into segments. Where a new segment lies near an older one, the surfaces of both are registered without a
//! guess ([`register_global`](crate::registration::register_global)). A result that is `OK` and that the graph of poses
//! explains closes the loop, and [`PoseGraph`] moves all poses to the least squares of motions and loops. A loop that the
//! others contradict is withdrawn.

mod corrections;
mod history;
mod pose_graph;
mod segment;
mod stamps;
#[cfg(test)]
mod tests;
mod verify;

use std::collections::BTreeSet;

use nalgebra::{Isometry3, Matrix6, Vector6};

pub use corrections::{Anchor, Corrections};
pub use history::PlaceHistory;
pub use pose_graph::{LoopEdge, PoseGraph};
pub use segment::{Segment, SegmentCutter};

use crate::lattice::LatticeError;
use crate::pose::se3;
use crate::registration::Verdict as RegistrationVerdict;
pub use stamps::middle_ns;
use verify::register_segments;

/// Distance within which two segments share enough surfaces, in RMS ranges of their points.
const REACH_ARMS: f64 = 1.0;
/// Drift that a query of the history allows for, as a fraction of that distance.
const DRIFT_PART: f64 = 1.0;
/// Growth of the distance above which the history is rebuilt with a larger radius.
const WIDER: f64 = 1.5;
/// Minimum length of the path between two segments of a loop, in the same unit; the map of the odometry covers
/// shorter ones.
const LEAST_PATH_ARMS: f64 = 4.0;
/// Standard deviation of the position between two segments above which a loop closure reduces it, m: three times that
/// of closures in simulated drives.
const LEAST_SIGMA_M: f64 = 0.05;
/// Number of loops above which that deviation grows with their number. The number of loops is then proportional to
/// the cube root of the length of the drive, and the linear system of the graph stays small.
const MANY_LOOPS: usize = 200;
/// Number of segments before and after the nearest one that are added to the target cloud.
const AROUND: usize = 2;
/// Squared Mahalanobis distance up to which a loop agrees with the graph: 99.9 % quantile of 6 degrees of freedom.
const EXPLAINED: f64 = 22.5;
/// Standard deviations of the predicted motion between two submaps: of the translation, in RMS ranges of points, and
/// of the rotation, rad. In simulated streets, predictions err by up to 25 m after a car ahead misled the odometry. A
/// hall that is symmetric under a quarter or half turn has to stay beyond `EXPLAINED`.
const PREDICTED: (f64, f64) = (1.0, 0.3);

/// Attempted loop closure.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct LoopAttempt {
    /// Number of the earlier segment.
    pub from: usize,
    /// Number of the later segment.
    pub to: usize,
    /// Times of both poses, ns.
    pub stamps_ns: [i64; 2],
    /// Verdict of the registration.
    pub verdict: RegistrationVerdict,
    /// Reason for the verdict.
    pub reason: String,
    /// Squared Mahalanobis distance of the loop from the prediction of the graph.
    pub innovation: f64,
    /// True if the loop is closed: the verdict is `OK` and the loop agrees with the graph.
    pub is_closed: bool,
    /// Registered pose of the later segment in the frame of the earlier one.
    pub from_to: Isometry3<f64>,
}

/// Finds loops among the segments of a drive, and corrects its poses.
#[derive(Default)]
pub struct LoopCloser {
    segments: Vec<Segment>,
    graph: PoseGraph,
    history: Option<PlaceHistory>,
    attempts: Vec<LoopAttempt>,
    /// Single loops between submaps that are not joined yet: there is no motion to test them against, so a second
    /// loop has to agree.
    alone: Vec<LoopEdge>,
}

impl LoopCloser {
    /// Adds the next segment of a drive. Returns the attempted loop, if the segment lies near another.
    ///
    /// # Errors
    /// If the range of the segment gives no lattice for the positions.
    pub fn add(&mut self, segment: Segment) -> Result<Option<&LoopAttempt>, LatticeError> {
        match self.segments.last() {
            None => self.graph.push(segment.odom_from_anchor, Matrix6::zeros()),
            Some(before) => {
                let (motion, covariance) = motion_between(before, &segment);
                self.graph.push(motion, covariance);
            }
        }
        // A drive that leaves a house sees farther.
        let radius_m = REACH_ARMS * (1.0 + DRIFT_PART) * segment.arm_m;
        let is_enough = |history: &PlaceHistory| WIDER * history.radius_m() >= radius_m;
        self.segments.push(segment);
        if !self.history.as_ref().is_some_and(is_enough) {
            self.history = Some(PlaceHistory::new(radius_m)?);
            self.remember_all();
        }
        let to = self.segments.len() - 1;
        let found = self.candidate(to).and_then(|from| self.try_loop(from, to));
        let is_closed = found.as_ref().is_some_and(|attempt| attempt.is_closed);
        if is_closed {
            self.remember_all();
        }
        self.remember(to);
        self.attempts.extend(found.clone());
        Ok(found.and(self.attempts.last()))
    }

    /// Nearest older segment with which a loop would reduce the uncertainty.
    fn candidate(&mut self, to: usize) -> Option<usize> {
        let segment = self.segments.get(to)?;
        let (path_m, arm_m, submap) = (segment.path_m, segment.arm_m, segment.submap);
        let place_m = self.graph.poses().get(to)?.translation.vector;
        let near = self.history.as_ref()?.near(&place_m);
        for (number, distance_m) in near {
            let from = number as usize;
            let Some(older) = self.segments.get(from) else {
                continue;
            };
            let is_same = older.submap == submap;
            if is_same && path_m - older.path_m < LEAST_PATH_ARMS * arm_m {
                continue;
            }
            let (_, covariance) = self.graph.relative(from, to)?;
            let spread = covariance.fixed_view::<3, 3>(0, 0).into_owned();
            let sigma_m = spread.symmetric_eigenvalues().max().max(0.0).sqrt();
            if distance_m > REACH_ARMS * arm_m + 3.0 * sigma_m {
                return None;
            }
            let many = self.graph.loops().len() as f64 / MANY_LOOPS as f64;
            return (sigma_m > LEAST_SIGMA_M * many.max(1.0)).then_some(from);
        }
        None
    }

    fn try_loop(&mut self, from: usize, to: usize) -> Option<LoopAttempt> {
        let (_, covariance) = self.graph.relative(from, to)?;
        let turns = covariance.fixed_view::<3, 3>(3, 3).into_owned();
        let tilt_sigma_rad = turns.symmetric_eigenvalues().max().max(0.0).sqrt();
        let older_submap = self.segments.get(from)?.submap;
        let newer_submap = self.segments.get(to)?.submap;
        let around = (from.saturating_sub(AROUND)..=from + AROUND).filter(|number| *number != from);
        let target = self.placed(std::iter::once(from).chain(around), older_submap, to);
        let source = self.placed([to, to.saturating_sub(1)].into_iter(), newer_submap, to + 1);
        let found = register_segments(&target, &source, tilt_sigma_rad)?;
        let edge = LoopEdge {
            from,
            to,
            from_to: found.target_from_source,
            covariance: found.covariance,
        };
        let is_ok = found.verdict == RegistrationVerdict::Ok;
        let innovation = self.graph.innovation(&edge);
        if is_ok && innovation <= EXPLAINED {
            self.close(edge);
        }
        let is_closed = self.graph.loops().iter().any(|edge| edge.to == to);
        let stamp_ns = |number: usize| self.segments.get(number).map_or(0, |one| one.first_ns);
        Some(LoopAttempt {
            from,
            to,
            stamps_ns: [stamp_ns(from), stamp_ns(to)],
            verdict: found.verdict,
            reason: found.reason,
            innovation,
            is_closed,
            from_to: found.target_from_source,
        })
    }

    /// Closes a loop. The first loop between two submaps waits for a second one that agrees with it.
    fn close(&mut self, edge: LoopEdge) {
        let submap_of = |number: usize| self.segments.get(number).map_or(0, |one| one.submap);
        let ends = |edge: &LoopEdge| (submap_of(edge.from), submap_of(edge.to));
        let (older, newer) = ends(&edge);
        if self.joined_with(older).contains(&newer) {
            self.graph.close(edge);
            return self.settle();
        }
        // Sources of neighbours overlap.
        let is_other = |one: &&LoopEdge| ends(one) == (older, newer) && one.to + 1 < edge.to;
        let agreeing = self.alone.iter().filter(is_other).find(|one| {
            let mut graph = self.graph.clone();
            graph.close((*one).clone());
            graph.optimize() && graph.innovation(&edge) <= EXPLAINED
        });
        let Some(agreeing) = agreeing.cloned() else {
            return self.alone.push(edge);
        };
        self.alone.retain(|one| *one != agreeing);
        for attempt in self.attempts.iter_mut().filter(|one| one.to == agreeing.to) {
            attempt.is_closed = true;
        }
        self.graph.close(agreeing);
        self.graph.close(edge);
        self.settle();
    }

    /// Optimizes the graph without loops that contradict the others.
    fn settle(&mut self) {
        while !self.graph.loops().is_empty() {
            let worst = match self.graph.optimize() {
                true => {
                    let residuals = self.graph.residuals().into_iter().enumerate();
                    residuals
                        .max_by(|a, b| a.1.total_cmp(&b.1))
                        .filter(|(_, residual)| *residual > EXPLAINED)
                }
                false => Some((self.graph.loops().len() - 1, f64::INFINITY)),
            };
            let Some((number, _)) = worst else {
                break;
            };
            let to = self.graph.loops().get(number).map(|edge| edge.to);
            self.graph.retain(|edge| Some(edge.to) != to);
            for attempt in self
                .attempts
                .iter_mut()
                .filter(|attempt| Some(attempt.to) == to)
            {
                attempt.is_closed = false;
            }
        }
    }

    /// Submaps with a known pose relative to `submap`: those joined with it by loops.
    pub fn joined_with(&self, submap: u32) -> BTreeSet<u32> {
        let of = |number: usize| self.segments.get(number).map(|segment| segment.submap);
        let mut joined = BTreeSet::from([submap]);
        loop {
            let before = joined.len();
            for edge in self.graph.loops() {
                if let (Some(a), Some(b)) = (of(edge.from), of(edge.to))
                    && (joined.contains(&a) || joined.contains(&b))
                {
                    joined.extend([a, b]);
                }
            }
            if joined.len() == before {
                return joined;
            }
        }
    }

    /// Segments of a submap before one, with the poses of their anchors.
    fn placed(
        &self,
        numbers: impl Iterator<Item = usize>,
        submap: u32,
        before: usize,
    ) -> Vec<(&Segment, Isometry3<f64>)> {
        let of = |number: usize| {
            let segment = self.segments.get(number)?;
            Some((segment, *self.graph.poses().get(number)?))
        };
        let all = numbers.filter(|number| *number < before).filter_map(of);
        all.filter(|(segment, _)| segment.submap == submap)
            .collect()
    }

    fn remember(&mut self, number: usize) {
        let pose = self.graph.poses().get(number);
        if let (Some(history), Some(pose)) = (&mut self.history, pose) {
            history.add(number as u32, &pose.translation.vector);
        }
    }

    /// Rebuilds the history from all segments but the newest, after a change of poses or of the radius.
    fn remember_all(&mut self) {
        if let Some(history) = &mut self.history {
            history.clear();
        }
        let before_newest = 0..self.segments.len().saturating_sub(1);
        before_newest.for_each(|number| self.remember(number));
    }

    /// Attempted loop closures in order of time.
    pub fn attempts(&self) -> &[LoopAttempt] {
        &self.attempts
    }

    /// Corrected poses of the first scans of the segments in the map.
    pub fn map_from_anchors(&self) -> &[Isometry3<f64>] {
        self.graph.poses()
    }

    /// Current corrections of the odometry poses.
    pub fn corrections(&self) -> Corrections {
        let anchor = |stamp_ns: i64, (segment, pose): (&Segment, &Isometry3<f64>)| Anchor {
            stamp_ns,
            submap: segment.submap,
            map_from_odom: pose * segment.odom_from_anchor.inverse(),
        };
        let mut anchors: Vec<Anchor> = Vec::new();
        let mut end_ns = 0;
        for (segment, pose) in self.segments.iter().zip(self.graph.poses()) {
            let last = anchors.last().cloned();
            let follows = last
                .as_ref()
                .is_some_and(|one| one.submap == segment.submap);
            let stamp_ns = match (follows, &last) {
                (true, _) => segment.first_ns,
                (false, None) => segment.begin_ns,
                // Clouds whose stamps are not those of their points have room.
                (false, Some(_)) => middle_ns(end_ns, segment.begin_ns),
            };
            anchors.extend(last.filter(|_| !follows).map(|last| Anchor {
                stamp_ns: end_ns,
                ..last
            }));
            anchors.push(anchor(stamp_ns, (segment, pose)));
            end_ns = segment.end_ns;
        }
        Corrections::new(anchors)
    }
}

/// Motion between the anchors of two segments, with the covariance of its twist in the frame of the first one.
fn motion_between(before: &Segment, after: &Segment) -> (Isometry3<f64>, Matrix6<f64>) {
    let before_from_odom = before.odom_from_anchor.inverse();
    let motion = before_from_odom * after.odom_from_anchor;
    if before.submap != after.submap {
        let (m, rad) = ((PREDICTED.0 * before.arm_m).powi(2), PREDICTED.1.powi(2));
        let diagonal = Vector6::new(m, m, m, rad, rad, rad);
        return (motion, Matrix6::from_diagonal(&diagonal));
    }
    let adjoint = se3::adjoint(&before_from_odom);
    let grown = adjoint * (after.drift - before.drift) * adjoint.transpose();
    (motion, positive(grown))
}

/// Nearest matrix without negative eigenvalues, which rounding may produce.
fn positive(covariance: Matrix6<f64>) -> Matrix6<f64> {
    let mut eigen = (0.5 * (covariance + covariance.transpose())).symmetric_eigen();
    eigen.eigenvalues.apply(|value| *value = value.max(0.0));
    eigen.recompose()
}
