//! Machine poses in the map from poses of message frames.

use std::sync::Arc;

use lattice_core::geodesy::InsMount;
use lattice_core::pose::{StampedPose, TfMiss};
use nalgebra::Isometry3;

use super::body_mounts::{Missing, MissingOf};
use super::body_pose::{Body, BodyPose};
use super::reference::{Reference, WaitingPose};
use super::state::{EnuOutput, EnuTransformer};

/// Limit of poses that wait for transforms.
const MAX_WAITING_POSES: usize = 4096;

impl EnuTransformer {
    /// Handles a pose of a frame; it is used once its transforms are known.
    pub(super) fn on_body_pose(
        &mut self,
        topic: &str,
        pose: BodyPose,
        now_ns: i64,
        out: &mut Vec<EnuOutput>,
    ) {
        #[cfg(feature = "bags")]
        if let Some(samples) = &mut self.samples {
            samples.note_bodies(&pose.position_of, &pose.attitude_of);
        }
        for frame in [&pose.position_of, &pose.attitude_of] {
            if let Body::Ins(frame) = frame
                && !frame.is_empty()
            {
                self.mounts.keep(frame);
            }
        }
        if let Some(frame) = &pose.reference
            && **frame != *self.options.map_frame
        {
            self.mounts.keep(frame);
            if self.pose_frame.as_ref() != Some(frame) {
                self.pose_frame = Some(Arc::clone(frame));
            }
        }
        if self.waiting_poses.len() >= MAX_WAITING_POSES
            && let Some(oldest) = self.waiting_poses.pop_front()
            && let Err(missing) = self.resolve(&oldest.pose)
        {
            self.refuse_pose(&oldest.topic, &missing);
        }
        self.waiting_poses.push_back(WaitingPose {
            topic: topic.into(),
            pose,
            arrived_ns: now_ns,
        });
        self.settle_poses(now_ns, out);
    }

    /// Handles waiting poses whose transforms are known by now, in the order of arrival.
    pub(super) fn settle_poses(&mut self, now_ns: i64, out: &mut Vec<EnuOutput>) {
        while let Some(waiting) = self.waiting_poses.front() {
            let waited_s = now_ns.saturating_sub(waiting.arrived_ns) as f64 * 1e-9;
            let is_due = waited_s > self.options.max_wait_s;
            match self.resolve(&waiting.pose) {
                Ok(pose) => {
                    if let Some(waiting) = self.waiting_poses.pop_front() {
                        if let Some(frame) = &waiting.pose.reference
                            && **frame != *self.options.map_frame
                            && self.reference == Reference::Unknown
                        {
                            self.reference = Reference::OnTf;
                        }
                        self.on_pose(&waiting.topic, pose, out);
                    }
                }
                Err(missing) if is_due && self.is_unconnected(&missing) => {
                    self.reference = Reference::IsMap;
                    if let MissingOf::Reference(frame) = &missing.of {
                        let map = &self.options.map_frame;
                        log::info!(
                            "poses are in {frame}, and no transform {map} <- {frame} is published: the map is {frame}"
                        );
                    }
                }
                Err(missing) if is_due || !may_come(&missing.miss) => {
                    if let Some(waiting) = self.waiting_poses.pop_front() {
                        self.refuse_pose(&waiting.topic, &missing);
                    }
                }
                Err(_) => return,
            }
        }
    }

    /// Rejects all waiting poses.
    pub(super) fn refuse_waiting_poses(&mut self) {
        while let Some(waiting) = self.waiting_poses.pop_front() {
            if let Err(missing) = self.resolve(&waiting.pose) {
                self.refuse_pose(&waiting.topic, &missing);
            }
        }
    }

    /// Warns once if the frame used as the map becomes connected with the map frame.
    pub(super) fn check_reference(&mut self) {
        let Some(frame) = &self.pose_frame else {
            return;
        };
        let map = &self.options.map_frame;
        if self.reference != Reference::IsMap || self.has_warned_reference {
            return;
        }
        let found = self.mounts.lookup(map, frame, 0);
        if !matches!(
            found,
            Err(TfMiss::UnknownFrame { .. } | TfMiss::Disconnected { .. })
        ) {
            self.has_warned_reference = true;
            log::warn!(
                "a transform {map} <- {frame} is published now; poses remain in {frame}: restart to map in {map}, or set map_frame: {frame}"
            );
        }
    }

    /// Pose of the machine in the map.
    fn resolve(&self, pose: &BodyPose) -> Result<StampedPose, Missing> {
        let stamp_ns = pose.stamp_ns;
        let map_from_reference = self.map_from_reference(pose)?;
        let of_base = (&pose.position_of, &pose.attitude_of) == (&Body::Base, &Body::Base);
        let reference_from_base = match of_base {
            true => pose.pose,
            false => {
                let mount = InsMount {
                    lever_arm_m: self.lever_arm_m(&pose.position_of, stamp_ns)?,
                    base_from_ins: self.base_from_ins(&pose.attitude_of, stamp_ns)?,
                };
                let (position, rotation) = (&pose.pose.translation, &pose.pose.rotation);
                mount.map_from_base(&position.vector, rotation)
            }
        };
        Ok(StampedPose {
            stamp_ns,
            map_from_base: match map_from_reference {
                Some(map_from_reference) => map_from_reference * reference_from_base,
                None => reference_from_base,
            },
        })
    }

    /// Pose of the reference frame in the map; `None` if it is the map frame.
    fn map_from_reference(&self, pose: &BodyPose) -> Result<Option<Isometry3<f64>>, Missing> {
        let map = &self.options.map_frame;
        let frame = match &pose.reference {
            Some(frame) if **frame != **map && self.reference != Reference::IsMap => frame,
            _ => return Ok(None),
        };
        let found = self.mounts.lookup(map, frame, pose.stamp_ns);
        found.map(Some).map_err(|miss| Missing {
            miss,
            of: MissingOf::Reference(Arc::clone(frame)),
        })
    }

    /// True if the poses' frame was never connected with a map frame that is not set by parameter.
    fn is_unconnected(&self, missing: &Missing) -> bool {
        let unconnected = matches!(
            missing.miss,
            TfMiss::UnknownFrame { .. } | TfMiss::Disconnected { .. }
        );
        let of_reference = matches!(missing.of, MissingOf::Reference(_));
        let may_be_map = !self.options.map_frame_is_given && self.reference == Reference::Unknown;
        unconnected && of_reference && may_be_map
    }

    fn refuse_pose(&mut self, topic: &str, missing: &Missing) {
        self.counts.poses_no_transform += 1;
        let text = || match &missing.of {
            MissingOf::Reference(frame) => {
                let map = &self.options.map_frame;
                format!(
                    "no transform {map} <- {frame}, the frame that its poses are in ({}): publish it, or set `map_frame: {frame}`",
                    missing.miss
                )
            }
            MissingOf::Mount(frame) => {
                let base = &self.options.base_frame;
                let why = match &missing.miss {
                    TfMiss::UnknownFrame { .. } | TfMiss::Disconnected { .. } => String::new(),
                    miss => format!(" ({miss})"),
                };
                format!(
                    "no transform {base} <- {frame}, the frame of its poses{why}: publish it on /tf_static, or set `ins.lever_arm_m` and `ins.boresight_rpy_rad` ([0.0, 0.0, 0.0] where the frames coincide), or `base_frame: {frame}` if sensors are mounted on that"
                )
            }
        };
        self.refusals.add(topic, "poses_no_transform", text);
    }
}

/// True if a later transform may cover the time.
fn may_come(miss: &TfMiss) -> bool {
    matches!(
        miss,
        TfMiss::UnknownFrame { .. } | TfMiss::Disconnected { .. } | TfMiss::TooNew { .. }
    )
}
