//! The loader's tour: a closed sequence of drives and turns on the spot.

use super::profile::SpeedProfile;
use super::spline::PlanarSpline;
use nalgebra::{Rotation2, Vector2};

/// Fastest speed over ground, m/s.
pub(super) const MAX_SPEED_MPS: f64 = 1.5;
const REVERSE_SPEED_MPS: f64 = 1.0;
const TURN_RATE_RADPS: f64 = 0.75;
const RAMP_S: f64 = 1.2;
const TURN_RAMP_S: f64 = 0.8;
/// The loader turns about a point this far behind the middle of its wheels, m.
const TURN_CENTER_X_M: f64 = -0.15;

/// Pose on the ground plan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PlanarPose {
    pub(super) position_m: Vector2<f64>,
    pub(super) yaw_rad: f64,
    /// Magnitude of motion, 0 at rest to 1 at full speed or turn rate.
    pub(super) effort: f64,
}

/// A closed sequence of movements, each starting and ending at rest.
#[derive(Clone, Debug)]
pub(super) struct Mission {
    legs: Vec<Leg>,
    duration_s: f64,
}

#[derive(Clone, Debug)]
struct Leg {
    start_s: f64,
    from: PlanarPose,
    movement: Movement,
}

#[derive(Clone, Debug)]
enum Movement {
    Wait {
        duration_s: f64,
    },
    Turn {
        profile: SpeedProfile,
        sign: f64,
    },
    Drive {
        spline: PlanarSpline,
        profile: SpeedProfile,
        max_derivative: f64,
        reverse: bool,
    },
}

impl Movement {
    fn duration_s(&self) -> f64 {
        match self {
            Self::Wait { duration_s } => *duration_s,
            Self::Turn { profile, .. } | Self::Drive { profile, .. } => profile.duration_s(),
        }
    }

    fn at(&self, from: &PlanarPose, time_s: f64) -> PlanarPose {
        match self {
            Self::Wait { .. } => *from,
            Self::Turn { profile, sign } => {
                let (angle_rad, rate_radps) = profile.at(time_s);
                let yaw_rad = from.yaw_rad + sign * angle_rad;
                let center = Vector2::new(TURN_CENTER_X_M, 0.0);
                let position_m = from.position_m + Rotation2::new(from.yaw_rad) * center
                    - Rotation2::new(yaw_rad) * center;
                PlanarPose {
                    position_m,
                    yaw_rad,
                    effort: rate_radps / TURN_RATE_RADPS,
                }
            }
            Self::Drive {
                spline,
                profile,
                max_derivative,
                reverse,
            } => {
                let (u, rate) = profile.at(time_s);
                let (position_m, tangent) = spline.at(u);
                let heading = if *reverse { -tangent } else { tangent };
                let effort = rate * max_derivative / MAX_SPEED_MPS;
                PlanarPose {
                    position_m,
                    yaw_rad: heading.y.atan2(heading.x),
                    effort,
                }
            }
        }
    }
}

impl Mission {
    /// Digging in the pit, tipping on the pile, twice, then a round of the site; ends where it starts.
    pub(super) fn earth_moving() -> Self {
        let start = PlanarPose {
            position_m: Vector2::new(-24.0, 20.0),
            yaw_rad: std::f64::consts::PI,
            effort: 0.0,
        };
        let mut mission = Self {
            legs: Vec::new(),
            duration_s: 0.0,
        };
        let mut at = start;
        for tip in [(1.2, 6.8, -35.0), (0.6, 1.5, 5.0)] {
            at = mission.work(at, tip);
        }
        at = mission.drive(at, &[(-15.0, 21.0)], -165.0, true);
        at = mission.turn(at, 172.0);
        at = mission.drive(at, &ROUND_EAST, 180.0, false);
        at = mission.turn(at, 95.0);
        at = mission.drive(at, &ROUND_SOUTH, 98.0, false);
        at = mission.turn(at, -100.0);
        let home = [(-34.0, 1.0), (-12.0, 6.0), (-6.5, 14.0), (-14.0, 20.0)];
        at = mission.drive(at, &home, 180.0, false);
        mission.drive(at, &[(-24.0, 20.0)], 180.0, false);
        mission
    }

    /// One load: dig, back out of the pit, tip, and drive back down the ramp.
    fn work(&mut self, at: PlanarPose, (x_m, y_m, heading_deg): (f64, f64, f64)) -> PlanarPose {
        let at = self.wait(at, 1.5);
        let at = self.drive(at, &[(-14.5, 20.5)], 180.0, true);
        let at = self.turn(at, 150.0);
        let at = self.drive(at, &[(x_m, y_m)], heading_deg, false);
        let at = self.wait(at, 1.5);
        let at = self.drive(at, &[(x_m - 6.5, y_m + 2.0)], heading_deg, true);
        let at = self.turn(at, 170.0);
        self.drive(at, &[(-16.0, 20.0), (-24.0, 20.0)], 180.0, false)
    }

    fn wait(&mut self, from: PlanarPose, duration_s: f64) -> PlanarPose {
        self.push(from, Movement::Wait { duration_s })
    }

    fn turn(&mut self, from: PlanarPose, angle_deg: f64) -> PlanarPose {
        let angle_rad = angle_deg.to_radians();
        let profile = SpeedProfile::new(angle_rad.abs(), TURN_RATE_RADPS, TURN_RAMP_S);
        let sign = angle_rad.signum();
        self.push(from, Movement::Turn { profile, sign })
    }

    /// Drives through waypoints (m) and arrives with a heading (deg, counter-clockwise from east).
    fn drive(
        &mut self,
        from: PlanarPose,
        waypoints_m: &[(f64, f64)],
        heading_deg: f64,
        reverse: bool,
    ) -> PlanarPose {
        let sign = if reverse { -1.0 } else { 1.0 };
        let along = |yaw_rad: f64| Vector2::new(yaw_rad.cos(), yaw_rad.sin()) * sign;
        let points = waypoints_m.iter().map(|&(x, y)| Vector2::new(x, y));
        let points = std::iter::once(from.position_m).chain(points).collect();
        let Some(spline) =
            PlanarSpline::new(points, along(from.yaw_rad), along(heading_deg.to_radians()))
        else {
            return from;
        };
        let max_derivative = spline.max_derivative();
        let speed_mps = [MAX_SPEED_MPS, REVERSE_SPEED_MPS][usize::from(reverse)];
        let profile = SpeedProfile::new(spline.length(), speed_mps / max_derivative, RAMP_S);
        let drive = Movement::Drive {
            spline,
            profile,
            max_derivative,
            reverse,
        };
        self.push(from, drive)
    }

    fn push(&mut self, from: PlanarPose, movement: Movement) -> PlanarPose {
        let duration_s = movement.duration_s();
        let to = movement.at(&from, duration_s);
        self.legs.push(Leg {
            start_s: self.duration_s,
            from,
            movement,
        });
        self.duration_s += duration_s;
        PlanarPose { effort: 0.0, ..to }
    }

    #[cfg(test)]
    /// Duration of one round, s.
    pub(super) fn duration_s(&self) -> f64 {
        self.duration_s
    }

    /// Pose at a time; rounds follow each other without a gap.
    pub(super) fn at(&self, time_s: f64) -> PlanarPose {
        let time_s = time_s.rem_euclid(self.duration_s);
        let next = self.legs.partition_point(|leg| leg.start_s <= time_s);
        let leg = &self.legs[next.saturating_sub(1)];
        leg.movement.at(&leg.from, time_s - leg.start_s)
    }
}

/// North of the pit, round the building and down the east side.
const ROUND_EAST: [(f64, f64); 12] = [
    (-6.0, 44.0),
    (4.0, 58.0),
    (22.0, 66.0),
    (40.0, 66.0),
    (56.0, 58.0),
    (59.0, 40.0),
    (54.0, 22.0),
    (36.0, 14.0),
    (30.0, 2.0),
    (36.0, -14.0),
    (40.0, -30.0),
    (26.0, -40.0),
];

/// Along the south and west, behind the berm's foot.
const ROUND_SOUTH: [(f64, f64); 6] = [
    (24.0, -58.0),
    (8.0, -64.0),
    (-14.0, -60.0),
    (-34.0, -50.0),
    (-46.0, -30.0),
    (-46.0, -4.0),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn position_and_yaw_are_smooth_and_no_faster_than_the_limits() {
        let mission = Mission::earth_moving();
        let h = 1e-3;
        let turn = |a: f64, b: f64| (b - a).sin().atan2((b - a).cos()) / h;
        let steps = (mission.duration_s() / h) as usize;
        let (mut before, mut velocity, mut rate) = (mission.at(0.0), Vector2::zeros(), 0.0);
        for i in 1..=steps + 10 {
            let now = mission.at(i as f64 * h);
            let v = (now.position_m - before.position_m) / h;
            let w = turn(before.yaw_rad, now.yaw_rad);
            assert!(v.norm() <= MAX_SPEED_MPS + 1e-3, "{v} m/s at {i} ms");
            assert!(w.abs() < 1.0, "{w} rad/s at {i} ms");
            assert!((v - velocity).norm() < 3.0 * h, "velocity jumps at {i} ms");
            assert!((w - rate).abs() < 4.0 * h, "turn rate jumps at {i} ms");
            assert!((-1e-9..=1.001).contains(&now.effort));
            (before, velocity, rate) = (now, v, w);
        }
    }

    #[test]
    fn a_round_takes_minutes_and_turns_on_the_spot() {
        let mission = Mission::earth_moving();
        let duration_s = mission.duration_s();
        assert!((300.0..700.0).contains(&duration_s), "{duration_s} s");
        let is_turn = |leg: &&Leg| matches!(leg.movement, Movement::Turn { .. });
        let turns = mission.legs.iter().filter(is_turn).count();
        assert!(turns >= 6);
    }
}
