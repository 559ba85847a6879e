//! Comparison of an Imu with the attitudes, once poses and mounts are known.

use std::sync::Arc;

use lattice_core::pose::{AttitudeConvention, InertialWindow, PoseMiss};
use lattice_msgs::sensor_msgs::Imu;
use nalgebra::Vector3;

use super::body_pose::Body;
use super::ins_options::InsSource;
use super::state::EnuTransformer;

/// Largest turn of a mount in a window, rad: its rate of 0.6 °/s is below what counts between Imu and attitudes.
const MAX_MOUNT_TURN_RAD: f64 = 0.01;

impl EnuTransformer {
    /// Compares a sample of an Imu with the attitudes; no pose is made of it.
    pub fn on_inertial(&mut self, topic: &str, imu: &Imu) {
        if self.inertial.frame().is_none() {
            self.mounts.keep(&imu.header.frame_id);
        }
        if self.inertial.on_imu(topic, imu) {
            self.settle_windows();
            self.warn_of_attitude();
        }
    }

    /// Compares the windows that poses and mounts cover by now.
    fn settle_windows(&mut self) {
        while let Some(window) = self.inertial.waiting.front() {
            let middle_ns = window.from_ns.midpoint(window.to_ns);
            let poses = [window.from_ns, middle_ns, window.to_ns].map(|at| self.map_from_base(at));
            let late = |pose: &Result<_, PoseMiss>| {
                matches!(pose, Err(PoseMiss::AfterEnd { .. } | PoseMiss::Empty))
            };
            if poses.iter().any(late) {
                return;
            }
            let of_machine = self.of_machine(window);
            if let ([Ok(from), Ok(middle), Ok(to)], Some(of_machine)) = (poses, of_machine) {
                let around = [from, middle, to];
                self.inertial.check.on_window(&of_machine, &around);
            }
            self.inertial.waiting.pop_front();
        }
    }

    /// A window in the axes of the machine; `None` if the mount is unknown, or moves as on a turntable.
    fn of_machine(&self, window: &InertialWindow) -> Option<InertialWindow> {
        let frame = self.inertial.frame()?;
        let options = &self.options.ins;
        let is_source = options.source == InsSource::NavsatfixImu;
        let body = Body::Ins(Arc::clone(frame));
        let mount = |at_ns| match is_source {
            true => self.base_from_ins(&body, at_ns).ok(),
            false if frame.is_empty() => None,
            false => Some(self.base_from_body(&body, at_ns).ok()?.rotation),
        };
        let base_from_imu = mount(window.to_ns)?;
        let middle_ns = window.from_ns.midpoint(window.to_ns);
        for at_ns in [window.from_ns, middle_ns] {
            if mount(at_ns)?.angle_to(&base_from_imu) > MAX_MOUNT_TURN_RAD {
                return None;
            }
        }
        if !is_source || options.orientation != AttitudeConvention::Ned {
            return Some(window.turned(|measured| base_from_imu * measured));
        }
        // The attitude is that of x forward, y left, z up by now; drivers convert the measurements or not.
        let is_down = window.force?.z < 0.0;
        Some(window.turned(|measured| {
            let sign = if is_down { -1.0 } else { 1.0 };
            base_from_imu * Vector3::new(measured.x, sign * measured.y, sign * measured.z)
        }))
    }
}
