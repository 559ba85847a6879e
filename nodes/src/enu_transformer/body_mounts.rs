//! Mounts of the bodies that poses are of.

use std::sync::Arc;

use lattice_core::pose::TfMiss;
use nalgebra::{Isometry3, UnitQuaternion, Vector3};

use super::body_pose::Body;
use super::state::EnuTransformer;

/// A missing transform of a pose.
pub(super) struct Missing {
    pub miss: TfMiss,
    pub of: MissingOf,
}

/// Frames that the missing transform connects.
pub(super) enum MissingOf {
    /// `base_frame` <- frame of the INS.
    Mount(Arc<str>),
    /// `map_frame` <- reference frame of the pose.
    Reference(Arc<str>),
}

impl EnuTransformer {
    /// Lever arm and boresight of the INS at a stamp; `None` where poses are those of the base.
    #[cfg(feature = "bags")]
    pub(super) fn ins_mount(
        &self,
        (position_of, attitude_of): &(Body, Body),
        stamp_ns: i64,
    ) -> Option<Isometry3<f64>> {
        if (position_of, attitude_of) == (&Body::Base, &Body::Base) {
            return None;
        }
        let lever_arm_m = self.lever_arm_m(position_of, stamp_ns).ok()?;
        let rotation = self.base_from_ins(attitude_of, stamp_ns).ok()?;
        Some(Isometry3::from_parts(lever_arm_m.into(), rotation))
    }

    /// Lever arm of a body at a stamp: from the parameter, else from tf.
    pub(super) fn lever_arm_m(&self, body: &Body, stamp_ns: i64) -> Result<Vector3<f64>, Missing> {
        match (body, &self.options.ins.lever_arm_m) {
            (Body::Ins(_), Some(lever_arm_m)) => Ok(*lever_arm_m),
            _ => Ok(self.base_from_body(body, stamp_ns)?.translation.vector),
        }
    }

    /// Rotation of a body on the machine at a stamp: from the parameter, else from tf.
    pub(super) fn base_from_ins(
        &self,
        body: &Body,
        stamp_ns: i64,
    ) -> Result<UnitQuaternion<f64>, Missing> {
        match (body, &self.options.ins.base_from_ins) {
            (Body::Ins(_), Some(base_from_ins)) => Ok(*base_from_ins),
            _ => Ok(self.base_from_body(body, stamp_ns)?.rotation),
        }
    }

    /// Mount of a body on tf at a stamp.
    pub(super) fn base_from_body(
        &self,
        body: &Body,
        stamp_ns: i64,
    ) -> Result<Isometry3<f64>, Missing> {
        let base = &self.options.base_frame;
        match body {
            Body::Ins(frame) if !frame.is_empty() && **frame != **base => {
                let found = self.mounts.lookup(base, frame, stamp_ns);
                found.map_err(|miss| Missing {
                    miss,
                    of: MissingOf::Mount(Arc::clone(frame)),
                })
            }
            _ => Ok(Isometry3::identity()),
        }
    }
}
