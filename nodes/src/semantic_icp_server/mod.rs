//! `semantic_icp_server`: registers labelled clouds of a headset with the robot's voxels.
//!
//! [`SemanticIcpServer`] is a state machine without I/O and heavy computation: expensive work is
//! a [`Job`] for another thread. [`node`] connects both to DDS.

mod counts;
mod diagnosis;
mod headset_scans;
mod intake;
mod map;
pub mod node;
mod options;
mod outputs;
mod parameters;
mod results;
mod search;
mod search_thread;
mod state;

pub use counts::{ServerCounts, ServerReport};
pub use options::{ByProfile, SearchWhen, ServerOptions, WhenBusy};
pub use parameters::declare;
pub use search::{Done, Job, LatticeSearch, MapCloud, Search, Work};

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

use lattice_core::registration::{Calibration, SourceCloud, Stage, TrackUpdate, Verdict};
use lattice_msgs::geometry_msgs::TransformStamped;
use lattice_msgs::lattice::{CalibrateFeedback, CalibrateGoal, CalibrateResult, CalibrationResult};
use lattice_msgs::std_msgs::String as StringMessage;
use lattice_msgs::vision_msgs::LabelInfo;
use nalgebra::Isometry3;

use self::headset_scans::HeadsetScans;
use self::state::{CurrentCalibration, PendingRequest, Running};
use crate::convert::calibration::{result_from, set_pose};
use crate::convert::geometry;
use crate::map_follower::MapFollower;

/// Request number assigned by the node.
pub type CallId = u64;

/// Outcome of a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// The headset was localized.
    Found,
    /// It was not, or the request was rejected.
    Failed,
    /// The client canceled the request.
    Canceled,
}

/// Output of the server.
#[derive(Clone, Debug)]
pub enum Output {
    /// For `calibration`.
    Result(Box<CalibrationResult>),
    /// For `/tf`.
    Transform(TransformStamped),
    /// For another thread; its result is passed to [`SemanticIcpServer::on_done`].
    Job(Job),
    /// Reply to a request.
    Answer(CallId, End, Box<CalibrateResult>),
    /// Progress of a request.
    Feedback(CallId, CalibrateFeedback),
    /// Map messages were lost: request a keyframe.
    NeedKeyframe,
}

/// Follows a map and a headset, and estimates the headset's pose.
pub struct SemanticIcpServer {
    options: ServerOptions,
    follower: MapFollower,
    session: String,
    headset_scans: HeadsetScans,
    /// Class names of the headset.
    names: BTreeMap<u16, String>,
    current: Option<CurrentCalibration>,
    /// Consecutive searches that did not confirm the current pose.
    misses: u32,
    /// Time until which a poor fit of a scan starts no search.
    doubt_again_ns: i64,
    running: Option<Running>,
    pending: Option<PendingRequest>,
    /// True if a cloud has arrived since the last search.
    fresh_cloud: bool,
    /// Newest cloud for tracking the current pose, and its stamp.
    look: Option<(Arc<SourceCloud>, i64)>,
    next_job: u64,
    /// Learned label confusions are of another session, segmenter or map.
    reset_label_confusion: bool,
    /// Map state last passed to the search: epoch, sequence, and time.
    prepared: Option<(u64, Option<u64>, i64)>,
    last: CalibrationResult,
    published_ns: i64,
    counts: ServerCounts,
}

impl SemanticIcpServer {
    /// Initial state.
    pub fn new(options: ServerOptions) -> Self {
        Self {
            follower: MapFollower::new(options.max_map_voxels),
            session: String::new(),
            headset_scans: HeadsetScans::new(
                options.max_headset_scans,
                options.headset_scan_period_ns,
            ),
            names: BTreeMap::new(),
            current: None,
            misses: 0,
            doubt_again_ns: 0,
            running: None,
            pending: None,
            fresh_cloud: false,
            look: None,
            next_job: 0,
            reset_label_confusion: false,
            prepared: None,
            last: CalibrationResult::default(),
            published_ns: 0,
            counts: ServerCounts::default(),
            options,
        }
    }

    /// Handles the class names of the headset. Other names mean another segmenter, whose label confusions
    /// are unknown.
    pub fn on_label_info(&mut self, message: &LabelInfo) {
        let classes = message.class_map.iter().take(usize::from(u16::MAX));
        let name = |name: &str| name.chars().take(64).collect();
        let names = classes
            .map(|class| (class.class_id, name(&class.class_name)))
            .collect();
        if self.names != names {
            self.names = names;
            self.reset_label_confusion = true;
        }
    }

    /// Handles the headset session: a new session has a new, unknown origin.
    pub fn on_session(&mut self, message: &StringMessage, now_ns: i64) -> Vec<Output> {
        let mut out = Vec::new();
        let session: String = message.data.chars().take(256).collect();
        if session != self.session {
            self.counts.sessions += 1;
            self.reset_label_confusion = true;
            self.session = session;
            self.headset_scans.clear();
            self.forget("the headset has begun a new session", now_ns, &mut out);
        }
        out
    }

    /// Drops the current pose and ends running work.
    fn forget(&mut self, why: &str, now_ns: i64, out: &mut Vec<Output>) {
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

    /// Handles a request; it is replied to at once or when its search ends.
    pub fn calibrate(&mut self, call: CallId, goal: &CalibrateGoal, now_ns: i64) -> Vec<Output> {
        let mut out = Vec::new();
        self.counts.requests_in += 1;
        let start = match self.start_of(goal) {
            Ok(start) => start,
            Err(reason) => {
                self.counts.requests_refused += 1;
                let result = self.result(CalibrationResult::REJECTED_INPUT, &reason);
                out.push(answer(call, End::Failed, result));
                return out;
            }
        };
        let caller = Some(call);
        let asked = self.running.as_ref().is_some_and(|r| r.caller.is_some());
        if asked || self.pending.is_some() {
            if self.options.when_busy == WhenBusy::Reject {
                self.counts.requests_busy += 1;
                let reason = "busy: an earlier calibration request is in progress";
                self.answer_failed(caller, reason, &mut out);
                return out;
            }
            let why = "superseded by another request";
            let pending = self.pending.take().and_then(|pending| pending.caller);
            self.answer_failed(pending, why, &mut out);
            self.end_running(why, &mut out);
        } else if let Some(running) = self.running.as_mut().filter(|r| !r.tracking) {
            if start.is_none() && !running.outdated {
                // The running search serves the request.
                running.caller = caller;
                return out;
            }
            self.end_running("superseded by a request", &mut out);
        }
        self.pending = Some(PendingRequest { caller, start });
        self.go_on(now_ns, &mut out);
        out
    }

    /// Start of a requested search, or the reason for its rejection.
    fn start_of(&self, goal: &CalibrateGoal) -> Result<Option<Isometry3<f64>>, String> {
        if !goal.session.is_empty() && goal.session != self.session {
            let asked: String = goal.session.chars().take(64).collect();
            return Err(format!(
                "the session of the headset is '{}', not '{asked}'",
                self.session
            ));
        }
        if !self.has_map() {
            return Err(NO_MAP.into());
        }
        if self.headset_scans.is_empty() {
            return Err("there is no cloud of the headset yet".into());
        }
        if !goal.has_guess {
            return Ok(None);
        }
        let guess = geometry::isometry_from_pose(&goal.guess);
        let guess = guess.filter(|guess| guess.translation.vector.norm() < MAX_GUESS_M);
        guess
            .map(Some)
            .ok_or_else(|| "the guess is not a pose: a number is not finite or too large".into())
    }

    /// Cancels a request.
    pub fn cancel(&mut self, call: CallId) -> Vec<Output> {
        let mut out = Vec::new();
        let mut was_asked = self.pending.take_if(|w| w.caller == Some(call)).is_some();
        let running = self.running.as_mut();
        if let Some(running) = running.filter(|r| r.caller == Some(call)) {
            running.canceled.store(true, Relaxed);
            running.outdated = true;
            running.caller = None;
            was_asked = true;
        }
        if was_asked {
            let result = self.result(CalibrationResult::NONE, "canceled");
            out.push(answer(call, End::Canceled, result));
        }
        out
    }

    /// Handles the progress of a job.
    pub fn on_progress(&self, job: u64, stage: Stage, fraction: f64) -> Option<Output> {
        let running = self.running.as_ref().filter(|r| r.job == job)?;
        let call = running.caller?;
        let stage = match stage {
            Stage::Prepare => "prepare",
            Stage::Search => "search",
            Stage::Refine => "refine",
            Stage::Judge => "judge",
        };
        let feedback = CalibrateFeedback {
            stage: stage.to_owned(),
            fraction: fraction as f32,
        };
        Some(Output::Feedback(call, feedback))
    }

    /// Handles the result of a job.
    pub fn on_done(&mut self, job: u64, done: Done, now_ns: i64) -> Vec<Output> {
        let mut out = Vec::new();
        let Some(running) = self.running.take_if(|r| r.job == job) else {
            return out;
        };
        match done {
            Done::NoMap(why) => self.no_map(&running, &why, now_ns, &mut out),
            Done::Calibrated(found) => self.searched(&running, &found, now_ns, &mut out),
            Done::Tracked(update) => self.tracked(&running, update, now_ns, &mut out),
        }
        self.go_on(now_ns, &mut out);
        out
    }

    /// Repeats the transform for late joiners. To be called regularly.
    pub fn tick(&mut self, now_ns: i64) -> Option<Output> {
        let current = self.current.as_ref()?;
        Some(Output::Transform(self.transform(current, now_ns)))
    }

    /// Ends all requests with a reply.
    pub fn finish(&mut self) -> Vec<Output> {
        let mut out = Vec::new();
        let why = "the server ends";
        let pending = self.pending.take().and_then(|pending| pending.caller);
        self.answer_failed(pending, why, &mut out);
        self.end_running(why, &mut out);
        out
    }

    /// Counters of clouds, requests and searches, by reason.
    pub fn counts(&self) -> &ServerCounts {
        &self.counts
    }

    /// `map_from_headset_origin`, if known.
    pub fn map_from_headset(&self) -> Option<Isometry3<f64>> {
        self.current
            .as_ref()
            .map(|current| current.map_from_headset)
    }

    /// The newest result.
    pub fn last_result(&self) -> &CalibrationResult {
        &self.last
    }

    /// Name of a class of the headset, if known.
    pub fn class_name(&self, class: u16) -> Option<&str> {
        self.names.get(&class).map(String::as_str)
    }

    fn transform(&self, current: &CurrentCalibration, now_ns: i64) -> TransformStamped {
        geometry::transform_stamped(
            &self.options.map_frame,
            &self.options.headset_frame,
            now_ns,
            &current.map_from_headset,
        )
    }
}

/// Upper bound of a guess's distance from the origin.
const MAX_GUESS_M: f64 = 1e6;

const NO_MAP: &str = "there is no map yet";

fn answer(call: CallId, end: End, result: CalibrationResult) -> Output {
    let answer = CalibrateResult {
        success: end == End::Found,
        message: result.reason.clone(),
        result,
    };
    Output::Answer(call, end, Box::new(answer))
}
