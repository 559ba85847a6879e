//! Attitudes of a machine against the way it takes.
//!
//! A machine that drives moves along the x axis of its frame, forward or back, whatever its heading is. Attitudes in other
//! conventions contradict that in a way of their own: a heading that is counted clockwise turns against the course, one with a
//! constant error moves the machine sideways at a constant angle. Machines that move in any direction, and those that
//! stand, show neither.

use std::f64::consts::PI;

use nalgebra::{Isometry3, UnitQuaternion, Vector3};

use super::attitude_convention::AttitudeConvention;
use super::buffer::StampedPose;

/// Length of a step, m: at a receiver's noise of some centimetres its course is known to some degrees.
const STEP_M: f64 = 1.0;
/// Longest time of a step, s: a slower machine may turn on the spot in between.
const STEP_S: f64 = 5.0;
/// Steps after which an attitude is judged.
const LEAST_STEPS: f64 = 20.0;
/// Mean resultant of a direction that is constant. With normal angles of 18 degrees about the mean it is 0.82.
const CONSTANT: f64 = 0.8;
/// Mean resultant of the doubled headings up to which they differ enough: that of a turn by 64 degrees on the way. On a straight way all
/// conventions agree with the course, but for a constant angle.
const TURNS: f64 = 0.8;
/// Constant angle that is no error of a mount, rad: of a wheel loader's rear axle in a bend or a rough mount. The declination of
/// magnetic north exceeds it in many places.
const LEAST_OFFSET_RAD: f64 = 0.087;

/// Conventions in which the heading differs.
const OF_WAY: [AttitudeConvention; 3] = [
    AttitudeConvention::Enu,
    AttitudeConvention::Ned,
    AttitudeConvention::Compass,
];

/// Contradiction between attitudes and the way.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum AttitudeFinding {
    /// The heading turns against the course: attitudes have another convention.
    Mirrored {
        /// Convention that the way agrees with.
        convention: AttitudeConvention,
        /// Yaw to add after that, rad.
        yaw_offset_rad: f64,
    },
    /// The machine moves at a constant angle to its x axis.
    Sideways {
        /// Yaw to add, rad: the direction of motion in the frame of the machine.
        yaw_offset_rad: f64,
    },
    /// The machine drives backward nearly all of its way.
    Backward,
}

/// Sums of the directions of motion in the frame of the machine, of one convention.
#[derive(Clone, Copy, Debug, Default)]
struct Directions {
    steps: f64,
    /// Cosine and sine of the angles to the x axis.
    angles: [f64; 2],
    /// Sum over the doubled angles: driving back counts as driving forward.
    doubled: [f64; 2],
    /// Squared share of the motion along z.
    rise: f64,
}

impl Directions {
    fn add(&mut self, attitude: &UnitQuaternion<f64>, step_m: &Vector3<f64>) {
        let moved = attitude.inverse() * step_m;
        let angle = moved.y.atan2(moved.x);
        self.steps += 1.0;
        for (sums, angle) in [(&mut self.angles, angle), (&mut self.doubled, 2.0 * angle)] {
            sums[0] += angle.cos();
            sums[1] += angle.sin();
        }
        self.rise += (moved.z / step_m.norm()).powi(2);
    }

    /// Mean resultant of the doubled angles, 1 if all agree.
    fn resultant(&self) -> f64 {
        self.doubled[0].hypot(self.doubled[1]) / self.steps.max(1.0)
    }

    /// Mean angle of motion to the x axis, rad. Where the machine drives forward and back, that of the nearer end of the axis.
    fn angle_rad(&self) -> f64 {
        let [cos, sin] = self.angles;
        match cos.hypot(sin) > CONSTANT * self.steps {
            true => sin.atan2(cos),
            false => 0.5 * self.doubled[1].atan2(self.doubled[0]),
        }
    }
}

/// Compares the attitudes of a machine with the direction of its path.
#[derive(Clone, Debug, Default)]
pub struct AttitudeCheck {
    last: Option<StampedPose>,
    by_convention: [Directions; 3],
    /// Cosine and sine of the doubled headings.
    headings: [f64; 2],
}

impl AttitudeCheck {
    /// Adds the next pose of the machine, in order of time.
    pub fn on_pose(&mut self, pose: &StampedPose) {
        let Some(last) = self.last else {
            self.last = Some(*pose);
            return;
        };
        let span_s = (pose.stamp_ns as f64 - last.stamp_ns as f64) * 1e-9;
        let step_m = pose.map_from_base.translation.vector - last.map_from_base.translation.vector;
        let length_m = step_m.norm();
        if !(0.0..=STEP_S).contains(&span_s) || !length_m.is_finite() {
            self.last = Some(*pose);
            return;
        }
        if length_m < STEP_M {
            return;
        }
        self.last = Some(*pose);
        self.add(&last.map_from_base, &pose.map_from_base, &step_m);
    }

    fn add(&mut self, from: &Isometry3<f64>, to: &Isometry3<f64>, step_m: &Vector3<f64>) {
        // The chord of a bend has the direction of its middle.
        let Some(middle) = from.rotation.try_slerp(&to.rotation, 0.5, 1e-9) else {
            return;
        };
        let ahead = middle * Vector3::x();
        let (sin, cos) = (2.0 * ahead.y.atan2(ahead.x)).sin_cos();
        self.headings[0] += cos;
        self.headings[1] += sin;
        let conventions = OF_WAY.into_iter();
        for (directions, convention) in self.by_convention.iter_mut().zip(conventions) {
            directions.add(&convention.to_enu(&middle), step_m);
        }
    }

    /// Contradiction of the poses so far; `None` if they are few, if they agree, or if the machine moves in any direction.
    pub fn finding(&self) -> Option<AttitudeFinding> {
        let [enu, ned, compass] = &self.by_convention;
        if enu.steps < LEAST_STEPS {
            return None;
        }
        let turns = self.headings[0].hypot(self.headings[1]) / enu.steps < TURNS;
        if turns && ned.resultant() > CONSTANT && enu.resultant() < CONSTANT {
            // On level ground both agree with the way.
            let (convention, directions) = match compass.rise < 0.5 * ned.rise {
                true => (AttitudeConvention::Compass, compass),
                false => (AttitudeConvention::Ned, ned),
            };
            let angle_rad = directions.angle_rad();
            let is_offset = angle_rad.abs() > LEAST_OFFSET_RAD;
            return Some(AttitudeFinding::Mirrored {
                convention,
                yaw_offset_rad: if is_offset { angle_rad } else { 0.0 },
            });
        }
        if enu.resultant() < CONSTANT {
            return None;
        }
        let yaw_offset_rad = enu.angle_rad();
        if yaw_offset_rad.abs() > PI - LEAST_OFFSET_RAD {
            return Some(AttitudeFinding::Backward);
        }
        let is_sideways = yaw_offset_rad.abs() > LEAST_OFFSET_RAD;
        is_sideways.then_some(AttitudeFinding::Sideways { yaw_offset_rad })
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Poses of a machine that drives and turns, with a tilt that follows the slopes.
    struct Way {
        turn_rad: f64,
        is_reversing: bool,
        slope: f64,
        noise: f64,
    }

    impl Way {
        const LEVEL: Way = Way {
            turn_rad: 0.05,
            is_reversing: false,
            slope: 0.0,
            noise: 0.03,
        };

        /// The poses, with attitudes as a sensor of a convention gives them, its yaw off by an angle.
        fn poses(&self, of: AttitudeConvention, off_rad: f64) -> Vec<StampedPose> {
            let (mut place, mut yaw) = (Vector3::zeros(), 0.3);
            let mut poses = Vec::new();
            for number in 0..400_i64 {
                yaw += self.turn_rad * (0.05 * number as f64).sin().abs();
                let pitch = self.slope * (0.11 * number as f64).sin();
                let attitude = UnitQuaternion::from_euler_angles(0.02, pitch, yaw);
                let back = match self.is_reversing && number % 40 < 15 {
                    true => -0.3,
                    false => 0.3,
                };
                place += attitude * Vector3::new(back, 0.0, 0.0);
                let wobble = self.noise * (number as f64 * 12.9).sin();
                let off = UnitQuaternion::from_euler_angles(0.0, 0.0, -off_rad);
                let given = from_enu(of, &(off * attitude));
                poses.push(StampedPose {
                    stamp_ns: number * 200_000_000,
                    map_from_base: Isometry3::from_parts(
                        (place + Vector3::new(wobble, -wobble, 0.0)).into(),
                        given,
                    ),
                });
            }
            poses
        }
    }

    /// Inverse of [`AttitudeConvention::to_enu`]: each of them is its own inverse.
    fn from_enu(of: AttitudeConvention, attitude: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
        of.to_enu(attitude)
    }

    fn finding(poses: &[StampedPose]) -> Option<AttitudeFinding> {
        let mut check = AttitudeCheck::default();
        poses.iter().for_each(|pose| check.on_pose(pose));
        check.finding()
    }

    #[test]
    fn sound_attitudes_raise_no_alarm() {
        let reversing = Way {
            is_reversing: true,
            ..Way::LEVEL
        };
        let straight = Way {
            turn_rad: 0.0,
            ..Way::LEVEL
        };
        let hilly = Way {
            slope: 0.2,
            ..Way::LEVEL
        };
        for way in [Way::LEVEL, reversing, straight, hilly] {
            assert_eq!(finding(&way.poses(AttitudeConvention::Enu, 0.0)), None);
        }
    }

    #[test]
    fn machines_that_stand_or_move_in_any_direction_raise_no_alarm() {
        let mut standing = Way::LEVEL.poses(AttitudeConvention::Ned, 0.0);
        for pose in &mut standing {
            pose.map_from_base.translation.vector *= 1e-3;
        }
        assert_eq!(finding(&standing), None);
        let mut holonomic = Way::LEVEL.poses(AttitudeConvention::Enu, 0.0);
        for (number, pose) in holonomic.iter_mut().enumerate() {
            let yaw = number as f64 * 0.7;
            pose.map_from_base.rotation = UnitQuaternion::from_euler_angles(0.0, 0.0, yaw);
        }
        assert_eq!(finding(&holonomic), None);
        assert_eq!(finding(&[]), None);
    }

    #[test]
    fn other_conventions_are_named() {
        let hilly = Way {
            slope: 0.2,
            ..Way::LEVEL
        };
        for convention in [AttitudeConvention::Ned, AttitudeConvention::Compass] {
            let found = finding(&hilly.poses(convention, 0.0));
            let expected = AttitudeFinding::Mirrored {
                convention,
                yaw_offset_rad: 0.0,
            };
            assert_eq!(found, Some(expected));
            // Level: the yaw alone decides.
            let found = finding(&Way::LEVEL.poses(convention, 0.0));
            assert!(
                matches!(found, Some(AttitudeFinding::Mirrored { .. })),
                "{found:?}"
            );
        }
    }

    #[test]
    fn a_straight_way_does_not_tell_conventions_apart() {
        let straight = Way {
            turn_rad: 0.0,
            ..Way::LEVEL
        };
        let found = finding(&straight.poses(AttitudeConvention::Ned, 0.0));
        assert!(
            matches!(found, Some(AttitudeFinding::Sideways { .. })),
            "{found:?}"
        );
    }

    #[test]
    fn a_machine_that_always_drives_backward_is_noticed() {
        let found = finding(&Way::LEVEL.poses(AttitudeConvention::Enu, PI));
        assert_eq!(found, Some(AttitudeFinding::Backward));
    }

    proptest! {
        /// The angle that is found mends the yaw.
        #[test]
        fn a_constant_error_of_yaw_is_measured(off_deg in 8.0..172.0_f64, is_left in any::<bool>()) {
            let off_rad = if is_left { off_deg } else { -off_deg }.to_radians();
            let Some(AttitudeFinding::Sideways { yaw_offset_rad }) =
                finding(&Way::LEVEL.poses(AttitudeConvention::Enu, off_rad))
            else {
                panic!("no finding");
            };
            prop_assert!((yaw_offset_rad - off_rad).abs() < 0.03, "{yaw_offset_rad} {off_rad}");
        }
    }
}
