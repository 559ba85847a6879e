//! Jobs of the server, and its replies to requests.

use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;

use lattice_msgs::lattice::CalibrationResult;

use super::options::SearchWhen;
use super::output::{CallId, End, Output, answer};
use super::search::{Job, MapCloud, Work};
use super::state::{PendingRequest, Running, SemanticIcpServer};
use crate::convert::geometry;

/// Reason of a rejection without a map.
pub(super) const NO_MAP: &str = "there is no map yet";

impl SemanticIcpServer {
    /// Starts pending work, unless a job is running.
    pub(super) fn go_on(&mut self, now_ns: i64, out: &mut Vec<Output>) {
        if self.running.is_some() {
            return;
        }
        if let Some(pending) = self.pending.take() {
            self.search_all(pending, now_ns, out);
            return;
        }
        if let Some((headset_scan, stamp_ns)) = self.look.take() {
            if let Some(current) = &self.current {
                self.counts.clouds_tracked += 1;
                let work = Work::Track {
                    headset_scan,
                    map_from_headset: current.map_from_headset,
                };
                self.begin(work, None, stamp_ns, now_ns, out);
                return;
            }
            self.headset_scans.push(headset_scan, stamp_ns, now_ns);
            self.fresh_cloud = true;
        }
        let due = self.fresh_cloud && self.current.is_none() && !self.headset_scans.is_empty();
        if due && self.options.search == SearchWhen::Lost && self.has_map() {
            self.counts.clouds_searched += 1;
            self.search_all(PendingRequest::default(), now_ns, out);
        }
    }

    /// Starts a confirming search if there are more scans than the current pose was found with: a single scan
    /// may fit elsewhere as well.
    pub(super) fn confirm(&mut self, now_ns: i64, out: &mut Vec<Output>) {
        let looks = self.headset_scans.len();
        let is_due = self
            .current
            .as_ref()
            .is_some_and(|current| looks > current.looks);
        let is_free = self.running.is_none() && self.pending.is_none();
        if !is_due || !is_free || self.options.search != SearchWhen::Lost {
            return;
        }
        self.search_all(PendingRequest::default(), now_ns, out);
        if let Some(running) = &mut self.running {
            running.confirms = true;
        }
    }

    /// Starts a search with all stored clouds.
    fn search_all(&mut self, pending: PendingRequest, now_ns: i64, out: &mut Vec<Output>) {
        self.fresh_cloud = false;
        let work = Work::Calibrate {
            headset_scans: self.headset_scans.all(),
            start: pending.start,
        };
        let stamp_ns = self.headset_scans.stamp_ns();
        self.begin(work, pending.caller, stamp_ns, now_ns, out);
    }

    /// Starts a job, with the map if the search has an outdated one.
    pub(super) fn begin(
        &mut self,
        work: Work,
        caller: Option<CallId>,
        stamp_ns: i64,
        now_ns: i64,
        out: &mut Vec<Output>,
    ) {
        let (headset_scans, map_age_ns) = match &work {
            Work::Calibrate { headset_scans, .. } => (headset_scans.clone(), 0),
            Work::Track { headset_scan, .. } => {
                (vec![Arc::clone(headset_scan)], self.options.map_refresh_ns)
            }
        };
        self.next_job += 1;
        let running = Running {
            job: self.next_job,
            caller,
            canceled: Arc::default(),
            outdated: false,
            begun_ns: now_ns,
            stamp_ns,
            headset_scans,
            tracking: matches!(work, Work::Track { .. }),
            doubted: None,
            confirms: false,
        };
        out.push(Output::Job(Job {
            id: self.next_job,
            reset_label_confusion: std::mem::take(&mut self.reset_label_confusion),
            map: self.map_to_prepare(now_ns, map_age_ns),
            work,
            canceled: Arc::clone(&running.canceled),
        }));
        self.running = Some(running);
    }

    /// The map, if it has changed and its last transfer was `age_ns` ago.
    fn map_to_prepare(&mut self, now_ns: i64, age_ns: i64) -> Option<MapCloud> {
        let map = self.follower.map()?;
        let (epoch, sequence) = (map.info.epoch, self.follower.sequence());
        if let Some((known_epoch, known_sequence, since_ns)) = self.prepared
            && known_epoch == epoch
            && (known_sequence == sequence || now_ns.saturating_sub(since_ns) < age_ns)
        {
            return None;
        }
        self.prepared = Some((epoch, sequence, now_ns));
        Some(MapCloud {
            cloud: map.semantic_cloud(),
            cell_side_m: map.lattice.cell_side_m(),
        })
    }

    /// Ends the running job; its caller receives the reason.
    pub(super) fn end_running(&mut self, why: &str, out: &mut Vec<Output>) {
        let Some(running) = &mut self.running else {
            return;
        };
        running.canceled.store(true, Relaxed);
        running.outdated = true;
        let caller = running.caller.take();
        self.answer_failed(caller, why, out);
    }

    pub(super) fn answer_failed(&self, caller: Option<CallId>, why: &str, out: &mut Vec<Output>) {
        if let Some(call) = caller {
            let result = self.result(CalibrationResult::NONE, why);
            out.push(answer(call, End::Failed, result));
        }
    }

    /// Result without a pose.
    pub(super) fn result(&self, verdict: u8, reason: &str) -> CalibrationResult {
        let mut result = CalibrationResult {
            verdict,
            reason: reason.to_owned(),
            ..CalibrationResult::default()
        };
        self.describe(&mut result, self.headset_scans.stamp_ns());
        result
    }

    pub(super) fn describe(&self, result: &mut CalibrationResult, stamp_ns: i64) {
        result.header = geometry::header(&self.options.map_frame, stamp_ns);
        result
            .child_frame_id
            .clone_from(&self.options.headset_frame);
        result.session.clone_from(&self.session);
    }

    pub(super) fn publish(
        &mut self,
        result: CalibrationResult,
        now_ns: i64,
        out: &mut Vec<Output>,
    ) {
        self.last = result.clone();
        self.published_ns = now_ns;
        out.push(Output::Result(Box::new(result)));
    }

    /// Drops the current pose and ends running work.
    pub(super) fn forget(&mut self, why: &str, now_ns: i64, out: &mut Vec<Output>) {
        self.current = None;
        self.misses = 0;
        self.doubt_again_ns = 0;
        self.fresh_cloud = false;
        self.look = None;
        if let Some(pending) = self.pending.take() {
            self.answer_failed(pending.caller, why, out);
        }
        self.end_running(why, out);
        let result = self.result(CalibrationResult::NONE, why);
        self.publish(result, now_ns, out);
    }
}
