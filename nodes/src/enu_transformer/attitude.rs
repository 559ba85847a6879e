//! Contradictions between attitudes and the way, with the parameters that mend them.

use lattice_core::pose::{AttitudeCheck, AttitudeFinding, StampedPose};
use serde::{Deserialize, Serialize};

use super::ins_options::InsSource;
use super::options::TransformerOptions;

/// Attitudes that contradict the way of the machine.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct AttitudeReport {
    /// The contradiction, and the parameter to set.
    pub text: String,
    /// True if no machine moves so: the map is wrong.
    pub is_impossible: bool,
}

impl AttitudeReport {
    /// `is_geodetic`: positions and attitudes come from an INS or of two sensors. An estimator of both has a frame that
    /// points anywhere.
    fn of(finding: &AttitudeFinding, base_frame: &str, is_geodetic: bool) -> Option<Self> {
        let name = base_frame.rsplit('/').next().unwrap_or_default();
        let is_forward = is_geodetic && matches!(name, "base_link" | "base_footprint");
        let degrees = |rad: &f64| rad.to_degrees().round();
        let (text, is_impossible) = match finding {
            AttitudeFinding::Mirrored {
                convention,
                yaw_offset_rad,
            } => {
                let more = match yaw_offset_rad.abs() > 0.0 {
                    true => format!(" and `ins.yaw_offset_deg: {}`", degrees(yaw_offset_rad)),
                    false => String::new(),
                };
                let name = convention.name();
                let text = format!(
                    "the heading of the poses turns against the way of the machine, so it is not counterclockwise from \
                     east (REP 103): set `ins.orientation: {name}`{more}"
                );
                (text, true)
            }
            _ if !is_forward => return None,
            AttitudeFinding::Sideways { yaw_offset_rad } => {
                let degrees = degrees(yaw_offset_rad);
                let text = format!(
                    "the machine moves at {degrees} degrees to the x axis of {base_frame}: set `ins.yaw_offset_deg: \
                     {degrees}`, unless x does not point forward"
                );
                (text, false)
            }
            AttitudeFinding::Backward => {
                let text = format!(
                    "the machine moves against the x axis of {base_frame} nearly all of its way: set \
                     `ins.yaw_offset_deg: 180`, unless it drives backward"
                );
                (text, false)
            }
            _ => return None,
        };
        Some(Self {
            text,
            is_impossible,
        })
    }
}

/// Attitudes of the poses so far, held against the way.
#[derive(Default)]
pub(super) struct Attitudes {
    check: AttitudeCheck,
    is_told: bool,
}

impl Attitudes {
    /// Checks the next pose; warns once of a contradiction.
    pub fn on_pose(&mut self, pose: &StampedPose, options: &TransformerOptions) {
        self.check.on_pose(pose);
        if self.is_told {
            return;
        }
        if let Some(report) = self.report(options) {
            self.is_told = true;
            log::warn!("{}", report.text);
        }
    }

    pub(super) fn report(&self, options: &TransformerOptions) -> Option<AttitudeReport> {
        let is_geodetic = matches!(
            options.ins.source,
            InsSource::NavsatfixImu | InsSource::Inspva | InsSource::Inspvax
        );
        AttitudeReport::of(&self.check.finding()?, &options.base_frame, is_geodetic)
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use lattice_core::pose::AttitudeConvention;

    use super::*;

    #[test]
    fn texts_name_the_parameter_that_mends() {
        let of = |finding: AttitudeFinding, base: &str| AttitudeReport::of(&finding, base, true);
        let mirrored = AttitudeFinding::Mirrored {
            convention: AttitudeConvention::Ned,
            yaw_offset_rad: 0.0,
        };
        let found = of(mirrored, "lidar").unwrap();
        assert!(found.is_impossible && found.text.ends_with("set `ins.orientation: ned`"));
        let sideways = AttitudeFinding::Sideways {
            yaw_offset_rad: -FRAC_PI_2,
        };
        let found = of(sideways, "robot/base_link").unwrap();
        assert!(!found.is_impossible && found.text.contains("`ins.yaw_offset_deg: -90`"));
        assert_eq!(of(sideways, "lidar"), None);
        assert!(of(AttitudeFinding::Backward, "base_footprint").is_some());
        assert_eq!(AttitudeReport::of(&sideways, "base_link", false), None);
    }
}
