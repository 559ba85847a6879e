//! Attitudes of a machine against gravity and the turning rate, as an Imu measures them.
//!
//! At rest an accelerometer measures the direction up, a gyroscope the change of the attitude at any time. Both are compared over
//! windows of a second, under every permutation of axes and signs ([`super::inertial_axes`]). On level ground up is
//! the same for many of them: slopes, rolls and turns distinguish them, and nothing is found without.

use nalgebra::{Isometry3, UnitQuaternion, Vector3};

use super::attitude_convention::AttitudeConvention;
use super::inertial_axes::{Fault, Hypothesis, VectorPairs, hypotheses};
use super::inertial_window::InertialWindow;

/// Standard gravity, m/s².
const GRAVITY: f64 = 9.80665;
/// Largest deviation of a mean specific force from gravity, m/s²: bias and scale of a cheap sensor are up to 3 %.
const GRAVITY_WITHIN: f64 = 0.3;
/// Largest deviation of a mean specific force in units of gravity. Nothing else has this size.
const UNIT_WITHIN: f64 = 0.02;
/// Largest acceleration of the positions in a window, m/s²: it tilts the specific force by 3 degrees.
const MAX_ACCELERATION: f64 = 0.5;
/// Largest turn in a window whose specific force is used, rad: the mean direction is `turn² / 24` = 1.5 degrees from that in the middle.
const MAX_TURN_RAD: f64 = 0.8;
/// Largest turn in half a window whose rate is used, rad. Beyond, it may have more than one axis.
const MAX_HALF_TURN_RAD: f64 = 1.2;
/// Least change of place or tilt to the last window of the slopes, m and rad: a machine that stands has one slope.
const NEW_PLACE: [f64; 2] = [0.3, 0.01];
/// Windows after which an Imu is judged.
const LEAST_WINDOWS: f64 = 20.0;
/// Most windows of the mean tilt: its error is of the mount, and no mean of many reduces it.
const MOST_MEAN: f64 = 200.0;
/// Windows from one judgement to the next.
const EVERY: u64 = 5;
/// Windows of one independent error: of accelerations, wandering attitudes, delays.
const CORRELATED: f64 = 4.0;
/// Errors of the direction up (rad) and of the rate (rad/s) per axis that mean nothing: 1.1 degrees of a mount and 0.6 °/s of bias.
const FLOORS: [f64; 2] = [0.02, 0.01];
/// Constant tilt between Imu and attitude that means nothing, rad: a rough mount, a frame that is not level.
const TILT_RAD: f64 = 0.5;
/// Deviation beyond which a tilt counts, rad.
const TILT_SCALE_RAD: f64 = 0.1;
/// Least mean of unit vectors that have one direction, and least component along an axis that they point to: 45 degrees.
const DIRECTED: f64 = 0.7;
/// Log-likelihood ratio above which a contradiction is accepted: with 151 hypotheses one of 1000 sound logs would exceed it.
const ACCEPTED: f64 = 12.0;
/// Log-likelihood ratio up to which hypotheses fit alike: 1 to 400.
const ALIKE: f64 = 6.0;
/// Least ratio of squared residuals of a contradiction: statistics of many windows alone prove nothing.
const LEAST_RATIO: f64 = 2.0;
/// Least ratio of windows in units of gravity to the others.
const MOSTLY: f64 = 10.0;
/// Least size of turning rates that show a unit, rad/s.
const LEAST_RATE: f64 = 0.03;
/// Ratios of measured to expected rates that degrees explain: 57.3 within a factor of 1.9.
const OF_DEGREES: std::ops::Range<f64> = 30.0..110.0;
/// Share of the squared rates that no axes explain, up to which they are turning rates.
const UNEXPLAINED: f64 = 0.3;

/// Contradiction between an Imu and attitudes.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum InertialFinding {
    /// Attitudes have another convention.
    Attitude {
        /// The convention; `None` if roll and pitch have signs that none has.
        convention: Option<AttitudeConvention>,
        /// True if gravity and rates agree on it, and no axes of the Imu explain both.
        is_certain: bool,
    },
    /// The Imu is turned on the machine.
    Turned {
        /// Rotation to add to the stated mount: `base_from_stated_base`.
        turn: UnitQuaternion<f64>,
        /// True if no other fault explains the windows alike.
        is_certain: bool,
    },
    /// The axes of the Imu are left-handed.
    LeftHanded,
    /// Accelerations have the sign of gravity, not of specific force.
    OppositeForce,
    /// Accelerations have other axes than rates and attitudes.
    ForceAxes,
    /// Rates have other axes than accelerations and attitudes.
    RateAxes,
    /// The frame of the poses is not level: turning rates agree with them, and up is constant in it.
    TiltedMap {
        /// Least rotation that makes it level: `level_from_map`.
        level_from_map: UnitQuaternion<f64>,
    },
    /// The machine is upside down by its attitude and by the Imu.
    UpsideDown,
    /// Accelerations are in units of gravity.
    ForceInG,
    /// Rates are in degrees per second.
    RateInDegrees,
}

/// Compares the measurements of an Imu with attitudes, in constant memory.
#[derive(Clone, Debug, Default)]
pub struct InertialCheck {
    /// Direction up by the Imu and by attitudes, of all windows at rest.
    rest: VectorPairs,
    /// The same at different places and tilts.
    slopes: VectorPairs,
    rates: VectorPairs,
    /// Sum of the directions up by the Imu in the frame of the poses, of all windows at rest.
    up_in_map: Vector3<f64>,
    last_slope: Option<(Vector3<f64>, Vector3<f64>)>,
    /// Windows at rest with accelerations in m/s² and in units of gravity.
    by_unit: [f64; 2],
    windows: u64,
    hypotheses: Vec<Hypothesis>,
    finding: Option<InertialFinding>,
}

impl InertialCheck {
    /// Adds a window, in the axes of the machine, with `map_from_base` at its begin, middle and end.
    pub fn on_window(&mut self, window: &InertialWindow, map_from_base: &[Isometry3<f64>; 3]) {
        let length_s = window.to_ns.saturating_sub(window.from_ns) as f64 * 1e-9;
        let [from, middle, to] = map_from_base;
        let halves = [(from, middle), (middle, to)]
            .map(|(from, to)| (from.rotation.inverse() * to.rotation).scaled_axis());
        if length_s <= 0.0 || !halves.iter().flatten().all(|value| value.is_finite()) {
            return;
        }
        let [first, second] = halves;
        let turn_rad = first.norm() + second.norm();
        let is_finite = |measured: &&Vector3<f64>| measured.iter().all(|value| value.is_finite());
        if let Some(rate) = window.rate.as_ref().filter(is_finite)
            && first.norm().max(second.norm()) < MAX_HALF_TURN_RAD
        {
            self.rates.add(rate, &((first + second) / length_s));
        }
        let [from_m, middle_m, to_m] = [from, middle, to].map(|pose| pose.translation.vector);
        let bend_m = (from_m + to_m - 2.0 * middle_m).norm();
        let is_steady = 4.0 * bend_m < MAX_ACCELERATION * length_s * length_s;
        if let Some(force) = window.force.as_ref().filter(is_finite)
            && turn_rad < MAX_TURN_RAD
            && is_steady
        {
            self.on_force(force, &middle.rotation, &middle_m);
        }
        self.windows += 1;
        if self.windows.is_multiple_of(EVERY) {
            self.finding = self.judge();
        }
    }

    fn on_force(
        &mut self,
        force: &Vector3<f64>,
        attitude: &UnitQuaternion<f64>,
        at_m: &Vector3<f64>,
    ) {
        let norm = force.norm();
        let is_in_g = (norm - 1.0).abs() < UNIT_WITHIN;
        if !is_in_g && (norm - GRAVITY).abs() > GRAVITY_WITHIN {
            return;
        }
        self.by_unit[usize::from(is_in_g)] += 1.0;
        let measured = force / norm;
        let expected = attitude.inverse() * Vector3::z();
        self.rest.add(&measured, &expected);
        self.up_in_map += attitude * measured;
        let [least_m, least_rad] = NEW_PLACE;
        let is_new = self.last_slope.is_none_or(|(last_m, last_up)| {
            (at_m - last_m).norm() > least_m || (expected - last_up).norm() > least_rad
        });
        if is_new {
            self.last_slope = Some((*at_m, expected));
            self.slopes.add(&measured, &expected);
        }
    }

    /// Contradiction of the windows so far; `None` if they are few, agree, or show too little.
    pub fn finding(&self) -> Option<InertialFinding> {
        self.finding
    }

    fn judge(&mut self) -> Option<InertialFinding> {
        let is_known = self.rest.count.max(self.rates.count) >= LEAST_WINDOWS;
        if !is_known {
            return None;
        }
        if self.hypotheses.is_empty() {
            self.hypotheses = hypotheses();
        }
        let (rates, is_in_degrees) = self.rates_in_radians();
        let evidence = Evidence {
            rest: &self.rest,
            slopes: self.slopes.centred(),
            rates,
        };
        let [meters, units] = self.by_unit;
        let is_upside_down = || {
            let [measured, expected] = self.rest.means();
            self.rest.count >= LEAST_WINDOWS && measured.z < -DIRECTED && expected.z < -DIRECTED
        };
        let of_units = || match () {
            () if is_upside_down() => Some(InertialFinding::UpsideDown),
            () if is_in_degrees => Some(InertialFinding::RateInDegrees),
            () if units >= LEAST_WINDOWS && units > MOSTLY * meters => {
                Some(InertialFinding::ForceInG)
            }
            () => None,
        };
        let found = evidence.best(&self.hypotheses);
        let is_of_force = found == Some(InertialFinding::ForceAxes);
        let tilted = is_of_force.then(|| self.tilted_map()).flatten();
        tilted.or(found).or_else(of_units)
    }

    /// Rotation of the frame of the poses, if it explains the accelerations better than axes of the Imu do.
    fn tilted_map(&self) -> Option<InertialFinding> {
        let level_from_map = UnitQuaternion::rotation_between(&self.up_in_map, &Vector3::z())?;
        let residual = 2.0 * (self.rest.count - self.up_in_map.norm());
        let axes = self.hypotheses.iter().map(|one| one.force);
        let is_better = { axes }.all(|axes| residual < self.rest.residual(&axes));
        let is_tilted = level_from_map.angle() > TILT_RAD;
        (is_better && is_tilted).then_some(InertialFinding::TiltedMap { level_from_map })
    }

    /// Turning rates in rad/s; true if they are in degrees.
    fn rates_in_radians(&self) -> (VectorPairs, bool) {
        let [measured, expected] = self.rates.sizes();
        let ratio = measured / expected.max(LEAST_RATE);
        if expected < LEAST_RATE || !OF_DEGREES.contains(&ratio) {
            return (self.rates, false);
        }
        let scaled = self.rates.scaled(1_f64.to_radians());
        let all = self.hypotheses.iter();
        let least = all.map(|one| scaled.residual(&one.rate));
        let least = least.fold(f64::INFINITY, f64::min);
        let is_explained = least < UNEXPLAINED * expected * expected * scaled.count;
        match is_explained && scaled.count >= LEAST_WINDOWS {
            true => (scaled, true),
            false => (self.rates, false),
        }
    }
}

/// Pairs of vectors to be explained.
struct Evidence<'a> {
    rest: &'a VectorPairs,
    slopes: VectorPairs,
    rates: VectorPairs,
}

/// Costs of a hypothesis.
#[derive(Clone, Copy)]
struct Cost {
    /// Negative log-likelihood.
    total: f64,
    /// Squared residuals of slopes and rates, with those that mean nothing.
    residuals: [f64; 2],
    /// Constant tilt beyond the one that means nothing, rad.
    tilt_rad: f64,
}

impl Evidence<'_> {
    fn cost(&self, hypothesis: &Hypothesis) -> Cost {
        let [tilt_floor, rate_floor] = FLOORS;
        let of = |pairs: &VectorPairs, axes, degrees: f64, floor: f64| {
            let residual = pairs.residual(axes) + degrees * floor * floor * pairs.count.max(1.0);
            (
                residual,
                0.5 * degrees * pairs.count / CORRELATED * residual.ln(),
            )
        };
        let (slopes, of_slopes) = of(&self.slopes, &hypothesis.force, 2.0, tilt_floor);
        let (rates, of_rates) = of(&self.rates, &hypothesis.rate, 3.0, rate_floor);
        let [measured, expected] = self.rest.means();
        let tilt_rad = measured.angle(&(hypothesis.force * expected));
        let is_constant = measured.norm().min(expected.norm()) > DIRECTED;
        let tilt_rad = match is_constant {
            true => (tilt_rad - TILT_RAD).max(0.0),
            false => 0.0,
        };
        let of_tilt = (tilt_rad / TILT_SCALE_RAD).powi(2).ln_1p();
        let weight = self.rest.count.min(MOST_MEAN) / CORRELATED;
        Cost {
            total: of_slopes + of_rates + weight * of_tilt,
            residuals: [slopes, rates],
            tilt_rad,
        }
    }

    fn best(&self, hypotheses: &[Hypothesis]) -> Option<InertialFinding> {
        let costs: Vec<Cost> = hypotheses.iter().map(|one| self.cost(one)).collect();
        let agreeing = *costs.first()?;
        let least = costs.iter().min_by(|a, b| a.total.total_cmp(&b.total))?;
        let is_clear = agreeing.tilt_rad - least.tilt_rad > TILT_RAD || {
            agreeing.residuals.iter().zip(&least.residuals)
        }
        .any(|(agreeing, least)| *agreeing > LEAST_RATIO * least);
        if !is_clear || agreeing.total - least.total < ACCEPTED {
            return None;
        }
        let all = hypotheses.iter().zip(&costs);
        let mut alike = all
            .filter(|(_, cost)| cost.total - least.total < ALIKE)
            .map(|(one, _)| one.fault);
        let first = alike.next()?;
        let is_attitude = |other| matches!(other, Fault::Attitude(_));
        let is_certain = alike.all(|other| is_attitude(first) && is_attitude(other));
        Some(match first {
            Fault::None => return None,
            Fault::Attitude(convention) => InertialFinding::Attitude {
                convention,
                is_certain,
            },
            Fault::Turned(turn) => InertialFinding::Turned { turn, is_certain },
            Fault::LeftHanded => InertialFinding::LeftHanded,
            Fault::Force { is_opposite: true } => InertialFinding::OppositeForce,
            Fault::Force { is_opposite: false } => InertialFinding::ForceAxes,
            Fault::Rate => InertialFinding::RateAxes,
        })
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::pose::{InertialSample, InertialWindows};

    proptest! {
        /// Any numbers leave the check without a panic.
        #[test]
        fn hostile_samples_are_survived(
            samples in prop::collection::vec((any::<i64>(), any::<f64>(), any::<f64>()), 0..200),
            steady in any::<bool>(),
        ) {
            let (mut windows, mut check) = (InertialWindows::default(), InertialCheck::default());
            for (number, (stamp_ns, force, rate)) in samples.into_iter().enumerate() {
                let stamp_ns = if steady { number as i64 * 200_000_000 } else { stamp_ns };
                let sample = InertialSample {
                    stamp_ns,
                    force: Some(Vector3::new(force, 0.0, 9.81)),
                    rate: Some(Vector3::new(rate, force, 0.0)),
                };
                if let Some(window) = windows.on_sample(&sample) {
                    let far = Isometry3::translation(force, rate, 0.0);
                    check.on_window(&window, &[Isometry3::identity(), far, Isometry3::identity()]);
                }
            }
            let _ = check.finding();
        }
    }
}
