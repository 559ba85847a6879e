//! Results of searches and of tracking.

use std::sync::Arc;

use lattice_core::registration::{Calibration, TrackUpdate, Verdict};
use lattice_msgs::geometry_msgs::TransformStamped;
use lattice_msgs::lattice::CalibrationResult;
use nalgebra::Isometry3;

use super::output::{CallId, End, Output, answer};
use super::search::Work;
use super::state::{CurrentCalibration, Running, SemanticIcpServer};
use crate::convert::calibration::{result_from, set_pose};
use crate::convert::geometry;

/// Smaller pose differences are not published, m and rad.
const SAME_POSE: (f64, f64) = (0.005, 0.002);
/// Larger pose differences mean another origin, m and rad.
const MOVED: (f64, f64) = (0.3, 0.1);
/// Time after an unconfirmed doubt without further ones, ns.
const DOUBT_AGAIN_NS: i64 = 10_000_000_000;
/// Period of republishing an unchanged tracked pose, ns.
const PUBLISH_AGAIN_NS: i64 = 5_000_000_000;

impl SemanticIcpServer {
    /// Repeats the transform for late joiners. To be called regularly.
    pub fn tick(&mut self, now_ns: i64) -> Option<Output> {
        let current = self.current.as_ref()?;
        Some(Output::Transform(self.transform(current, now_ns)))
    }

    fn transform(&self, current: &CurrentCalibration, now_ns: i64) -> TransformStamped {
        geometry::transform_stamped(
            &self.options.map_frame,
            &self.options.headset_frame,
            now_ns,
            &current.map_from_headset,
        )
    }

    /// Handles the end of a search.
    pub(super) fn searched(
        &mut self,
        running: &Running,
        found: &Calibration,
        now_ns: i64,
        out: &mut Vec<Output>,
    ) {
        if running.outdated || found.cancelled {
            self.counts.searches_ended_early += 1;
            self.answer_failed(running.caller, "ended early", out);
            return;
        }
        let mut result = result_from(found);
        self.describe(&mut result, running.stamp_ns);
        result.duration_s = now_ns.saturating_sub(running.begun_ns) as f64 * 1e-9;
        (result.gazes, result.points) = running.gazes_and_points();
        let counts = &mut self.counts;
        *match found.verdict {
            Verdict::Ok => &mut counts.searches_ok,
            Verdict::Ambiguous => &mut counts.searches_ambiguous,
            Verdict::Degenerate => &mut counts.searches_degenerate,
            Verdict::NoOverlap => &mut counts.searches_no_overlap,
            Verdict::RejectedInput => &mut counts.searches_rejected,
        } += 1;
        let rejected = found.verdict == Verdict::RejectedInput;
        if running.doubted.is_some() && !rejected {
            self.doubt_again_ns = now_ns.saturating_add(DOUBT_AGAIN_NS);
        }
        if let Some(update) = running.doubted
            && !rejected
            && found.verdict != Verdict::Ok
        {
            // The scan alone only shows that it fits.
            self.hold(running, update, now_ns, out);
            return;
        }
        let before = self
            .current
            .as_ref()
            .map(|current| current.map_from_headset);
        let moved =
            before.is_some_and(|before| !is_near(&before, &found.target_from_source, MOVED));
        if running.confirms {
            self.counts.confirmations += 1;
            self.counts.poses_withdrawn += u64::from(moved);
            match &mut self.current {
                // Together the scans fit best elsewhere, which contradicts the earlier single scan.
                _ if moved => self.current = None,
                // The search only shows that each scan fits.
                Some(current) if found.verdict != Verdict::Ok => {
                    current.looks = running.headset_scans.len();
                    self.answer_found(running.caller, found.verdict, &result, out);
                    return;
                }
                _ => {}
            }
        }
        match found.verdict {
            Verdict::Ok => {
                self.misses = 0;
                if moved {
                    // The headset's origin differs from that of the earlier scans.
                    self.headset_scans.clear();
                }
                self.headset_scans.remove(&running.headset_scans);
                for headset_scan in &running.headset_scans {
                    self.headset_scans
                        .add(Arc::clone(headset_scan), running.stamp_ns, now_ns);
                }
                let current = CurrentCalibration {
                    map_from_headset: found.target_from_source,
                    result: result.clone(),
                    looks: running.headset_scans.len(),
                };
                out.push(Output::Transform(self.transform(&current, now_ns)));
                self.current = Some(current);
            }
            // These scans would degrade the next search.
            Verdict::RejectedInput => self.headset_scans.remove(&running.headset_scans),
            Verdict::NoOverlap => {
                self.headset_scans.remove(&running.headset_scans);
                self.missed();
            }
            // A further scan may resolve it.
            Verdict::Ambiguous | Verdict::Degenerate => self.missed(),
        }
        self.answer_found(running.caller, found.verdict, &result, out);
        // A confirmation does not change the pose, and does not belong to the last cloud.
        if !running.confirms || moved {
            self.publish(result, now_ns, out);
        }
    }

    fn answer_found(
        &self,
        caller: Option<CallId>,
        verdict: Verdict,
        result: &CalibrationResult,
        out: &mut Vec<Output>,
    ) {
        if let Some(call) = caller {
            let end = match verdict {
                Verdict::Ok => End::Found,
                _ => End::Failed,
            };
            out.push(answer(call, end, result.clone()));
        }
    }

    fn missed(&mut self) {
        self.misses += 1;
        if self.misses >= self.options.lost_after && self.current.take().is_some() {
            self.counts.tracking_lost += 1;
        }
    }

    /// Handles an unusable map.
    pub(super) fn no_map(
        &mut self,
        running: &Running,
        why: &str,
        now_ns: i64,
        out: &mut Vec<Output>,
    ) {
        self.prepared = None;
        if running.outdated {
            return;
        }
        self.counts.searches_rejected += 1;
        let reason = format!("the map cannot be used: {why}");
        let result = self.result(CalibrationResult::REJECTED_INPUT, &reason);
        if let Some(call) = running.caller {
            out.push(answer(call, End::Failed, result.clone()));
        }
        self.publish(result, now_ns, out);
    }

    /// Handles the result of tracking.
    pub(super) fn tracked(
        &mut self,
        running: &Running,
        update: Option<TrackUpdate>,
        now_ns: i64,
        out: &mut Vec<Output>,
    ) {
        let Some(current) = self.current.as_ref().filter(|_| !running.outdated) else {
            return;
        };
        let inliers = current.result.inlier_fraction;
        let update = update.filter(|update| update.fits);
        // A mirrored cloud has the same floor and fits in part.
        let in_doubt = |u: &TrackUpdate| {
            let too_few = u.inlier_fraction < self.options.doubt_below * inliers;
            too_few && now_ns >= self.doubt_again_ns
        };
        if let Some(update) = update.filter(|u| !in_doubt(u)) {
            self.hold(running, update, now_ns, out);
            return;
        }
        self.counts.tracking_misses += u64::from(update.is_none());
        self.counts.tracking_doubts += u64::from(update.is_some());
        // The cloud may be mirrored, or the headset may have moved.
        let work = Work::Calibrate {
            headset_scans: running.headset_scans.clone(),
            start: None,
        };
        self.begin(work, None, running.stamp_ns, now_ns, out);
        if let Some(running) = &mut self.running {
            running.doubted = update;
        }
    }

    /// Handles a scan that fits and has refined the current pose.
    fn hold(&mut self, running: &Running, update: TrackUpdate, now_ns: i64, out: &mut Vec<Output>) {
        let Some(current) = &mut self.current else {
            return;
        };
        self.misses = 0;
        current.map_from_headset = update.target_from_source;
        let mut result = current.result.clone();
        let covariance = nalgebra::Matrix6::from_row_slice(&result.covariance);
        set_pose(&mut result, &update.target_from_source, &covariance);
        result.inlier_fraction = update.inlier_fraction;
        result.rmse_m = update.rmse_m;
        result.method = "tracking".into();
        result.reason = "the scan fits the current pose".into();
        (result.gazes, result.points) = running.gazes_and_points();
        result.duration_s = now_ns.saturating_sub(running.begun_ns) as f64 * 1e-9;
        self.describe(&mut result, running.stamp_ns);
        for headset_scan in &running.headset_scans {
            (self.headset_scans).push(Arc::clone(headset_scan), running.stamp_ns, now_ns);
        }
        let published = geometry::isometry_from_transform(&self.last.transform);
        let same =
            published.is_some_and(|last| is_near(&last, &update.target_from_source, SAME_POSE));
        let recent = now_ns.saturating_sub(self.published_ns) < PUBLISH_AGAIN_NS;
        if !(same && recent && self.last.verdict == CalibrationResult::OK) {
            self.publish(result, now_ns, out);
        }
        self.confirm(now_ns, out);
    }
}

/// True if two poses differ by less than a distance (m) and an angle (rad).
fn is_near(a: &Isometry3<f64>, b: &Isometry3<f64>, (distance_m, angle_rad): (f64, f64)) -> bool {
    let moved = a.inverse() * b;
    moved.translation.vector.norm() < distance_m && moved.rotation.angle() < angle_rad
}
