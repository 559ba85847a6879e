//! Input of the headset: clouds, class names, sessions.

use std::sync::Arc;

use lattice_core::cloud::CloudError;
use lattice_core::registration::SourceCloud;
use lattice_msgs::lattice::CalibrationResult;
use lattice_msgs::sensor_msgs::PointCloud2;
use lattice_msgs::std_msgs::String as StringMessage;
use lattice_msgs::vision_msgs::LabelInfo;
use thiserror::Error;

use super::jobs::NO_MAP;
use super::output::Output;
use super::state::SemanticIcpServer;
use crate::convert::semantic::{SemanticError, headset_scan_from_message};

/// Reason for rejecting a cloud.
#[derive(Debug, Error)]
enum Refusal {
    #[error("cloud in frame '{found}', expected '{expected}'")]
    Frame { found: String, expected: String },
    #[error(transparent)]
    Cloud(#[from] SemanticError),
}

impl SemanticIcpServer {
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

    /// Handles a headset cloud. An invalid one is reported as a rejection with the reason.
    pub fn on_headset_cloud(&mut self, message: &PointCloud2, now_ns: i64) -> Vec<Output> {
        let mut out = Vec::new();
        self.counts.clouds_in += 1;
        let headset_scan = match self.read(message) {
            Ok(headset_scan) => Arc::new(headset_scan),
            Err(refusal) => {
                self.count(&refusal);
                let reason = refusal.to_string();
                let mut result = self.result(CalibrationResult::REJECTED_INPUT, &reason);
                result.header.stamp = message.header.stamp;
                self.publish(result, now_ns, &mut out);
                return out;
            }
        };
        let stamp_ns = message.header.stamp.to_ns();
        if !self.has_map() {
            self.counts.clouds_no_map += 1;
            self.headset_scans.push(headset_scan, stamp_ns, now_ns);
            let result = self.result(CalibrationResult::REJECTED_INPUT, NO_MAP);
            self.publish(result, now_ns, &mut out);
            return out;
        }
        if self.current.is_some() && self.options.track {
            self.look = Some((headset_scan, stamp_ns));
        } else {
            self.headset_scans.push(headset_scan, stamp_ns, now_ns);
            self.fresh_cloud = true;
        }
        self.go_on(now_ns, &mut out);
        let begun = out.iter().any(|output| matches!(output, Output::Job(_)));
        self.counts.clouds_kept += u64::from(!begun);
        out
    }

    fn read(&mut self, message: &PointCloud2) -> Result<SourceCloud, Refusal> {
        let found = message.header.frame_id.trim_start_matches('/');
        if found != self.options.headset_frame {
            return Err(Refusal::Frame {
                found: found.chars().take(64).collect(),
                expected: self.options.headset_frame.clone(),
            });
        }
        let (headset_scan, report) = headset_scan_from_message(message, &self.options.semantic)?;
        self.counts.points_not_finite += report.not_finite as u64;
        self.counts.points_too_far += report.too_far as u64;
        Ok(headset_scan)
    }

    fn count(&mut self, refusal: &Refusal) {
        let counts = &mut self.counts;
        let counter = match refusal {
            Refusal::Frame { .. } => &mut counts.clouds_wrong_frame,
            Refusal::Cloud(SemanticError::Empty) => &mut counts.clouds_empty,
            Refusal::Cloud(SemanticError::NoPlace { .. }) => &mut counts.clouds_no_place,
            Refusal::Cloud(
                SemanticError::NoLabels { .. } | SemanticError::AllUnlabelled { .. },
            ) => &mut counts.clouds_unlabelled,
            Refusal::Cloud(SemanticError::Cloud(CloudError::TooManyPoints { .. })) => {
                &mut counts.clouds_too_large
            }
            Refusal::Cloud(SemanticError::Cloud(_)) => &mut counts.clouds_malformed,
        };
        *counter += 1;
    }
}
