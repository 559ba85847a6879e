//! Requests, and the results of the jobs that serve them.

use std::sync::atomic::Ordering::Relaxed;

use lattice_core::registration::Stage;
use lattice_msgs::lattice::{CalibrateFeedback, CalibrateGoal, CalibrationResult};
use nalgebra::Isometry3;

use super::jobs::NO_MAP;
use super::options::WhenBusy;
use super::output::{CallId, End, Output, answer};
use super::search::Done;
use super::state::{PendingRequest, SemanticIcpServer};
use crate::convert::geometry;

/// Upper bound of a guess's distance from the origin.
const MAX_GUESS_M: f64 = 1e6;

impl SemanticIcpServer {
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

    /// Cancels the search and answers every request as failed, at the end of the node.
    pub fn finish(&mut self) -> Vec<Output> {
        let mut out = Vec::new();
        let why = "the server ends";
        let pending = self.pending.take().and_then(|pending| pending.caller);
        self.answer_failed(pending, why, &mut out);
        self.end_running(why, &mut out);
        out
    }
}
