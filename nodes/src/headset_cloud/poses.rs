//! Time-indexed camera poses.

use lattice_core::pose::{
    PoseBuffer, PoseBufferOptions, PoseMiss, PushOutcome, StampedPose, TfMiss, TransformBuffer,
    TransformBufferOptions,
};
use lattice_msgs::geometry_msgs::PoseStamped;
use lattice_msgs::tf2_msgs::TFMessage;
use nalgebra::Isometry3;

use super::options::{HeadsetOptions, PoseSource};
use super::refusal::shown;
use crate::convert::geometry;

/// Result of a pose query.
pub(super) enum PoseAt {
    /// `origin_from_camera`.
    Known(Isometry3<f64>),
    /// Later poses may cover the time.
    Later,
    /// No pose will cover the time.
    Never,
}

/// Poses of one camera, or transforms.
pub(super) enum Poses {
    Topic(PoseBuffer),
    Tf(TransformBuffer),
}

impl Poses {
    pub fn new(options: &HeadsetOptions) -> Self {
        match options.poses {
            PoseSource::Topic => Self::Topic(PoseBuffer::new(PoseBufferOptions {
                max_gap_s: options.max_pose_gap_s,
                ..PoseBufferOptions::default()
            })),
            PoseSource::Tf => {
                let mut transforms = TransformBuffer::new(TransformBufferOptions {
                    max_gap_s: options.max_pose_gap_s,
                    ..TransformBufferOptions::default()
                });
                transforms.keep(&options.mesh.headset_frame);
                Self::Tf(transforms)
            }
        }
    }

    /// Adds a camera pose, or returns reason and text of its rejection.
    pub fn on_pose(
        &mut self,
        message: &PoseStamped,
        headset_frame: &str,
    ) -> Result<(), (&'static str, String)> {
        let Self::Topic(poses) = self else {
            return Ok(());
        };
        let found = message.header.frame_id.trim_start_matches('/');
        if found != headset_frame {
            let found = shown(found);
            let problem = format!("pose in frame '{found}', expected '{headset_frame}'");
            return Err(("frame", problem));
        }
        let pose = geometry::isometry_from_pose(&message.pose);
        let malformed = || {
            (
                "malformed",
                "the pose is not finite or its rotation is zero".to_owned(),
            )
        };
        let outcome = poses.push(StampedPose {
            stamp_ns: message.header.stamp.to_ns(),
            map_from_base: pose.ok_or_else(malformed)?,
        });
        match outcome {
            PushOutcome::Accepted | PushOutcome::JumpedBack => Ok(()),
            PushOutcome::OutOfOrder => {
                let problem = "the pose is not newer than the last".to_owned();
                Err(("out_of_order", problem))
            }
            PushOutcome::NotFinite => Err(malformed()),
        }
    }

    /// Adds transforms; returns the number of rejected ones.
    pub fn on_tf(&mut self, message: &TFMessage, is_static: bool) -> u64 {
        let Self::Tf(transforms) = self else {
            return 0;
        };
        let mut refused = 0;
        for transform in &message.transforms {
            let (parent, child) = (&transform.header.frame_id, &transform.child_frame_id);
            let stamp_ns = transform.header.stamp.to_ns();
            let pose = geometry::isometry_from_transform(&transform.transform);
            let taken = pose.is_some_and(|pose| {
                let inserted = transforms.insert(parent, child, stamp_ns, pose, is_static);
                inserted.is_ok()
            });
            refused += u64::from(!taken);
        }
        refused
    }

    /// Pose of a camera at a time.
    pub fn at(&self, headset_frame: &str, camera: &str, stamp_ns: i64) -> PoseAt {
        match self {
            Self::Topic(poses) => match poses.at(stamp_ns) {
                Ok(pose) => PoseAt::Known(pose),
                Err(PoseMiss::Empty | PoseMiss::AfterEnd { .. }) => PoseAt::Later,
                Err(_) => PoseAt::Never,
            },
            Self::Tf(transforms) => match transforms.lookup(headset_frame, camera, stamp_ns) {
                Ok(pose) => PoseAt::Known(pose),
                Err(TfMiss::TooOld { .. } | TfMiss::Gap { .. }) => PoseAt::Never,
                Err(_) => PoseAt::Later,
            },
        }
    }

    /// Drops the poses of an ended session.
    pub fn clear(&mut self) {
        if let Self::Topic(poses) = self {
            poses.clear();
        }
    }
}
