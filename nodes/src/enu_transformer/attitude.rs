//! Contradictions between attitudes, the way and an Imu, with the parameters that mend them.

use lattice_core::pose::{
    AttitudeCheck, AttitudeConvention, AttitudeFinding, InertialFinding, StampedPose,
};
use nalgebra::UnitQuaternion;
use serde::{Deserialize, Serialize};

use super::ins_options::InsSource;
use super::options::TransformerOptions;

/// Attitudes that contradict the way of the machine, gravity or turning rates.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct AttitudeReport {
    /// The contradiction, and the parameter to set.
    pub text: String,
    /// True if no machine moves so: the map is wrong.
    pub is_impossible: bool,
}

/// Convention to set where the attitudes of another are those of `found`.
fn mend(options: &TransformerOptions, found: AttitudeConvention) -> String {
    let has_none = matches!(
        options.ins.source,
        InsSource::Inspva | InsSource::Inspvax | InsSource::Tf
    );
    match options.ins.orientation.then(found) {
        Some(convention) if !has_none => {
            format!("set `ins.orientation: {}`", convention.name())
        }
        _ => "correct their driver, or take other poses (`ins.source`)".to_owned(),
    }
}

impl AttitudeReport {
    /// Of a contradiction to the way. An estimator of both positions and attitudes has a frame that points anywhere.
    fn of(finding: &AttitudeFinding, options: &TransformerOptions) -> Option<Self> {
        let base_frame = &options.base_frame;
        let is_forward = is_geodetic(options) && is_machine(base_frame);
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
                let mend = mend(options, *convention);
                let text = format!(
                    "the heading of the poses turns against the way of the machine, so it is not counterclockwise from \
                     east (REP 103): {mend}{more}"
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

    /// Of a contradiction to an Imu of a topic.
    fn of_imu(finding: &InertialFinding, imu: &str, options: &TransformerOptions) -> Option<Self> {
        let base_frame = &options.base_frame;
        let is_source = options.ins.source == InsSource::NavsatfixImu;
        let is_wrong = matches!(
            finding,
            InertialFinding::Attitude {
                is_certain: true,
                ..
            }
        );
        let text = match finding {
            InertialFinding::Attitude {
                convention,
                is_certain,
            } => {
                let fault = fault(*convention, imu);
                let mend = match convention {
                    Some(convention) => mend(options, *convention),
                    None => "correct the signs in their driver, or take other poses (`ins.source`)"
                        .to_owned(),
                };
                let unless = match (is_certain, convention) {
                    (true, _) => String::new(),
                    (false, Some(AttitudeConvention::Compass)) => format!(
                        " (`ned` if pitch is positive with the nose up), unless the axes of {imu} are wrong"
                    ),
                    (false, _) => format!(", unless the axes of {imu} are wrong"),
                };
                format!("{fault}: {mend}{unless}")
            }
            InertialFinding::Turned { turn, is_certain } => {
                let or_alike = if *is_certain { "" } else { " or alike" };
                let turn = angles(turn) + or_alike;
                match is_source {
                    true => format!(
                        "accelerations and turning rates of {imu} have other axes than its orientation, turned by {turn}: \
                         its driver converts one of them alone"
                    ),
                    false => format!(
                        "by gravity and turning rates {imu} is turned by {turn} from where its transform has it on \
                         {base_frame}: correct its mount on /tf_static, unless the poses are of turned axes or their frame is not level"
                    ),
                }
            }
            InertialFinding::LeftHanded => format!(
                "the axes of {imu} are left-handed by gravity and turning rates: correct the signs in its driver (x \
                 forward, y left, z up, REP 103)"
            ),
            InertialFinding::OppositeForce => format!(
                "accelerations of {imu} point down where the poses have up: at rest they are +9.81 m/s² upward (REP 145), \
                 correct the signs in its driver; if the poses are north-east-down, {}",
                mend(options, AttitudeConvention::Ned)
            ),
            InertialFinding::TiltedMap { level_from_map } => of_tilt(level_from_map, imu, options),
            InertialFinding::ForceAxes => format!(
                "accelerations of {imu} have other axes than its turning rates and the poses: correct its driver"
            ),
            InertialFinding::RateAxes => format!(
                "turning rates of {imu} have other axes or signs than its accelerations and the poses: correct its driver"
            ),
            InertialFinding::UpsideDown if is_source && is_machine(base_frame) => format!(
                "{base_frame} is upside down by the orientation and the accelerations of {imu}: publish the mount of the \
                 Imu on /tf_static, or set `ins.boresight_rpy_rad: [3.1416, 0.0, 0.0]`, unless z of {base_frame} points \
                 down"
            ),
            InertialFinding::ForceInG => format!(
                "accelerations of {imu} are in g, at rest 1.0: expected m/s² (REP 145), correct its driver"
            ),
            InertialFinding::RateInDegrees => format!(
                "turning rates of {imu} are in °/s: expected rad/s (REP 145), correct its driver"
            ),
            _ => return None,
        };
        Some(Self {
            text,
            is_impossible: is_wrong,
        })
    }
}

/// Fault of the attitudes that an Imu shows.
fn fault(convention: Option<AttitudeConvention>, imu: &str) -> String {
    let what = match convention {
        Some(AttitudeConvention::Compass | AttitudeConvention::Ned) => {
            return format!(
                "the heading of the poses turns against the gyroscope of {imu}, so it is not counterclockwise from east \
                 (REP 103)"
            );
        }
        Some(AttitudeConvention::PitchUp) => {
            "the pitch of the poses has the wrong sign, as it is positive with the nose down (REP 103)"
        }
        Some(AttitudeConvention::RollLeft) => {
            "the roll of the poses has the wrong sign, as it is positive with the right side down (REP 103)"
        }
        Some(AttitudeConvention::Swapped) => "roll and pitch of the poses are exchanged",
        _ => "roll and pitch of the poses have wrong signs or are exchanged",
    };
    format!("{what}, by gravity and turning rates of {imu}")
}

/// A frame of the poses that is not level by an Imu.
fn of_tilt(
    level_from_map: &UnitQuaternion<f64>,
    imu: &str,
    options: &TransformerOptions,
) -> String {
    let degrees = level_from_map.angle().to_degrees().round();
    let fault =
        format!("by gravity of {imu} the frame of the poses is tilted by {degrees} degrees");
    if is_geodetic(options) {
        return format!(
            "{fault}, and turning rates agree with the attitudes: take attitudes relative to east, north, up (REP 103)"
        );
    }
    let before = options.correction.map(|correction| correction.rotation);
    let (roll, pitch, yaw) = (level_from_map * before.unwrap_or_default()).euler_angles();
    // Not -0.
    let [roll, pitch, yaw] = [roll, pitch, yaw].map(|rad| (rad * 1e3).round() / 1e3 + 0.0);
    format!(
        "{fault}, so z of the map does not point up: set `correction.rpy_rad: [{roll:.3}, {pitch:.3}, {yaw:.3}]`"
    )
}

/// True if positions and attitudes are relative to east, north, up.
fn is_geodetic(options: &TransformerOptions) -> bool {
    matches!(
        options.ins.source,
        InsSource::NavsatfixImu | InsSource::Inspva | InsSource::Inspvax
    )
}

/// Roll, pitch and yaw of a rotation, in degrees.
fn angles(turn: &UnitQuaternion<f64>) -> String {
    let (roll, pitch, yaw) = turn.euler_angles();
    // Not -0.
    let [roll, pitch, yaw] = [roll, pitch, yaw].map(|rad| rad.to_degrees().round() + 0.0);
    format!("roll {roll}, pitch {pitch}, yaw {yaw} degrees")
}

/// True for the names of REP 105, of which x points forward and z up.
fn is_machine(base_frame: &str) -> bool {
    let name = base_frame.rsplit('/').next().unwrap_or_default();
    matches!(name, "base_link" | "base_footprint")
}

/// Attitudes of the poses so far, held against the way.
#[derive(Default)]
pub(super) struct Attitudes {
    check: AttitudeCheck,
    /// True once a contradiction has been logged.
    pub is_told: bool,
}

impl Attitudes {
    /// Checks the next pose.
    pub fn on_pose(&mut self, pose: &StampedPose) {
        self.check.on_pose(pose);
    }

    /// Contradiction to the way or to an Imu, the one that makes a map wrong first.
    pub fn report(
        &self,
        imu: Option<(InertialFinding, &str)>,
        options: &TransformerOptions,
    ) -> Option<AttitudeReport> {
        let way = self.check.finding().map(|way| match (way, &imu) {
            (AttitudeFinding::Mirrored { yaw_offset_rad, .. }, Some((finding, _))) => {
                let convention = heading(finding);
                let is_known = convention.map(|convention| AttitudeFinding::Mirrored {
                    convention,
                    yaw_offset_rad,
                });
                is_known.unwrap_or(way)
            }
            _ => way,
        });
        let of_way = way.and_then(|way| AttitudeReport::of(&way, options));
        let of_imu = imu.and_then(|(finding, imu)| AttitudeReport::of_imu(&finding, imu, options));
        match (of_way, of_imu) {
            (Some(way), _) if way.is_impossible => Some(way),
            (way, imu) => imu.or(way),
        }
    }
}

/// Convention of a heading that turns against the way, by roll and pitch.
fn heading(finding: &InertialFinding) -> Option<AttitudeConvention> {
    match finding {
        InertialFinding::OppositeForce => Some(AttitudeConvention::Ned),
        InertialFinding::Attitude {
            convention: Some(found @ (AttitudeConvention::Ned | AttitudeConvention::Compass)),
            ..
        } => Some(*found),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, PI};

    use super::*;

    fn options(source: InsSource, base_frame: &str) -> TransformerOptions {
        TransformerOptions {
            base_frame: base_frame.to_owned(),
            ..TransformerOptions::new(source)
        }
    }

    #[test]
    fn texts_name_the_parameter_that_mends() {
        let of = |finding: AttitudeFinding, base: &str| {
            AttitudeReport::of(&finding, &options(InsSource::NavsatfixImu, base))
        };
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
        let odometry = options(InsSource::Odometry, "base_link");
        assert_eq!(AttitudeReport::of(&sideways, &odometry), None);
    }

    #[test]
    fn a_convention_that_is_set_already_is_composed_with_the_one_found() {
        let mut options = options(InsSource::Odometry, "base_link");
        let pitch_up = InertialFinding::Attitude {
            convention: Some(AttitudeConvention::PitchUp),
            is_certain: true,
        };
        let text = |options: &TransformerOptions| {
            let found = AttitudeReport::of_imu(&pitch_up, "/imu", options).unwrap();
            assert!(found.is_impossible && found.text.contains("of /imu"));
            found.text
        };
        assert!(text(&options).ends_with("set `ins.orientation: pitch_up`"));
        options.ins.orientation = AttitudeConvention::PitchUp;
        assert!(text(&options).ends_with("set `ins.orientation: enu`"));
        options.ins.orientation = AttitudeConvention::Compass;
        assert!(text(&options).ends_with("set `ins.orientation: ned`"));
        // Sources that ignore the parameter.
        options.ins.source = InsSource::Inspvax;
        assert!(text(&options).ends_with("(`ins.source`)"));
    }

    #[test]
    fn an_imu_upside_down_is_named_where_it_gives_the_attitude_of_the_machine() {
        let of = |finding: InertialFinding, source, base| {
            AttitudeReport::of_imu(&finding, "/imu", &options(source, base))
        };
        let own = InsSource::NavsatfixImu;
        let found = of(InertialFinding::UpsideDown, own, "base_link").unwrap();
        assert!(!found.is_impossible && found.text.contains("ins.boresight_rpy_rad"));
        assert_eq!(of(InertialFinding::UpsideDown, own, "lidar"), None);
        let other = InsSource::Odometry;
        assert_eq!(of(InertialFinding::UpsideDown, other, "base_link"), None);
        let turn = UnitQuaternion::from_euler_angles(PI, 0.0, 0.0);
        let is_certain = true;
        let turned = InertialFinding::Turned { turn, is_certain };
        let found = of(turned, other, "base_link").unwrap();
        assert!(found.text.contains("roll 180, pitch 0, yaw 0 degrees") && !found.is_impossible);
    }

    #[test]
    fn a_frame_that_is_not_level_is_corrected_by_its_parameter() {
        let level_from_map = UnitQuaternion::from_euler_angles(FRAC_PI_2, 0.0, 0.0);
        let of = |options: &TransformerOptions| {
            let tilted = InertialFinding::TiltedMap { level_from_map };
            AttitudeReport::of_imu(&tilted, "/imu", options).unwrap()
        };
        let mut odometry = options(InsSource::Odometry, "base_link");
        let found = of(&odometry);
        let words = "tilted by 90 degrees, so z of the map does not point up: set `correction.rpy_rad: [1.571, 0.000, 0.000]`";
        assert!(
            !found.is_impossible && found.text.ends_with(words),
            "{}",
            found.text
        );
        // What is set already is turned further.
        odometry.correction = Some(nalgebra::Isometry3::from_parts(
            nalgebra::Translation3::identity(),
            level_from_map,
        ));
        assert!(
            of(&odometry).text.ends_with("[3.142, 0.000, 0.000]`"),
            "{}",
            of(&odometry).text
        );
        let found = of(&options(InsSource::NavsatfixImu, "base_link"));
        assert!(found.text.ends_with("(REP 103)"), "{}", found.text);
    }

    #[test]
    fn a_heading_that_turns_against_the_way_has_the_convention_of_its_roll_and_pitch() {
        for (found, expected) in [
            (
                InertialFinding::OppositeForce,
                Some(AttitudeConvention::Ned),
            ),
            (InertialFinding::ForceInG, None),
        ] {
            assert_eq!(heading(&found), expected);
        }
    }
}
