//! Windows of an Imu to compare with the attitudes of the machine.

use std::collections::VecDeque;
use std::sync::Arc;

use lattice_core::pose::{
    InertialCheck, InertialFinding, InertialSample, InertialWindow, InertialWindows,
};
use lattice_msgs::geometry_msgs;
use lattice_msgs::sensor_msgs::Imu;
use nalgebra::Vector3;

/// Limit of windows that wait for poses.
const MAX_WAITING: usize = 32;

/// Windows of one Imu, and their comparison with attitudes.
#[derive(Default)]
pub(super) struct Inertial {
    /// Topic and frame of the Imu.
    imu: Option<(Arc<str>, Arc<str>)>,
    windows: InertialWindows,
    /// Windows that no poses cover yet.
    pub waiting: VecDeque<InertialWindow>,
    pub check: InertialCheck,
}

impl Inertial {
    /// Frame of the Imu.
    pub fn frame(&self) -> Option<&Arc<str>> {
        self.imu.as_ref().map(|(_, frame)| frame)
    }

    /// Adds a sample of the Imu that was first; true if it completes a window.
    pub fn on_imu(&mut self, topic: &str, imu: &Imu) -> bool {
        let frame = imu.header.frame_id.trim_start_matches('/');
        let known = self.imu.get_or_insert_with(|| (topic.into(), frame.into()));
        if (&*known.0, &*known.1) != (topic, frame) {
            return false;
        }
        let window = self.windows.on_sample(&InertialSample {
            stamp_ns: imu.header.stamp.to_ns(),
            force: measured(
                &imu.linear_acceleration,
                &imu.linear_acceleration_covariance,
            ),
            rate: measured(&imu.angular_velocity, &imu.angular_velocity_covariance),
        });
        let Some(window) = window else {
            return false;
        };
        if self.waiting.len() >= MAX_WAITING {
            self.waiting.pop_front();
        }
        self.waiting.push_back(window);
        true
    }

    /// Finding with the topic of the Imu.
    pub fn finding(&self) -> Option<(InertialFinding, &str)> {
        let (topic, _) = self.imu.as_ref()?;
        Some((self.check.finding()?, topic))
    }
}

/// A measurement of an Imu; `None` if its covariance says that there is none (REP 145).
fn measured(value: &geometry_msgs::Vector3, covariance: &[f64; 9]) -> Option<Vector3<f64>> {
    let is_absent = covariance.first() == Some(&-1.0);
    (!is_absent).then(|| Vector3::new(value.x, value.y, value.z))
}
