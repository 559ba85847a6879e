//! Thirty logs with one fault each and a hundred sound ones, of a simulated machine on slopes.

mod logs;

use std::f64::consts::{FRAC_PI_2, PI};

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

use self::logs::{GRAVITY, Log, Motion};
use super::*;

/// Logs without a fault, by kind and seed.
fn sound_logs() -> Vec<(&'static str, Log)> {
    use Motion::{Drives, Hurries, Skids, Spins, Stands};
    let of = |kind, log: fn(u64) -> Log| (0..10).map(move |seed| (kind, log(seed)));
    let mut all: Vec<_> = of("driving", |seed| Log::new(seed, Drives)).collect();
    all.extend(of("level", |seed| Log::new(seed, Drives).on_slopes(0.005)));
    all.extend(of("standing", |seed| Log::new(seed, Stands)));
    all.extend(of("spinning", |seed| Log::new(seed, Spins)));
    all.extend(of("skidding", |seed| Log::new(seed, Skids).on_slopes(0.02)));
    all.extend(of("hurrying", |seed| {
        Log::new(seed, Hurries).on_slopes(0.01)
    }));
    all.extend(of("ramp of 20 degrees", |seed| Log {
        ramp_rad: 0.364,
        ..Log::new(seed, Drives)
    }));
    all.extend(of("vibrating", |seed| Log {
        vibration: 8.0,
        ..Log::new(seed, Drives)
    }));
    all.extend(of("late poses", |seed| Log {
        delay_s: 0.3 * seed as f64,
        ..Log::new(seed, Drives)
    }));
    all.extend(of("tilted frame and mount", |seed| Log {
        tilts_rad: [0.2, -0.15],
        ..Log::new(seed, Drives).on_slopes(0.03)
    }));
    all
}

#[test]
fn a_hundred_sound_logs_raise_no_alarm() {
    let logs = sound_logs();
    assert_eq!(logs.len(), 100);
    let alarms = logs
        .iter()
        .filter_map(|(kind, log)| Some((kind, log.seed, log.sound()?)));
    let alarms: Vec<_> = alarms.collect();
    assert!(alarms.is_empty(), "{alarms:?}");
}

#[test]
fn thirty_logs_with_one_fault_each_are_named() {
    use AttitudeConvention::{Compass, Enu, Ned, PitchUp, RollLeft, Swapped};
    let mut wrong = Vec::new();
    let mut hold = |what: String, found: Option<InertialFinding>, is_right: bool| {
        if !is_right {
            wrong.push((what, found));
        }
    };
    let mut count = 0;
    for seed in 100..103 {
        let drives = Log::new(seed, Motion::Drives);
        for convention in [Ned, PitchUp, RollLeft, Swapped, Compass] {
            let found = drives.of_convention(convention);
            let is_certain = convention != Compass;
            let named = InertialFinding::Attitude {
                convention: Some(convention),
                is_certain,
            };
            hold(format!("{convention:?}"), found, found == Some(named));
            count += 1;
        }
        let about = |roll, pitch, yaw| {
            UnitQuaternion::from_euler_angles(roll, pitch, yaw)
                .to_rotation_matrix()
                .into_inner()
        };
        let (upside_down, aside) = (about(PI, 0.0, 0.0), about(0.0, 0.0, FRAC_PI_2));
        for turn in [upside_down, aside] {
            let found = drives.of_imu(turn.map(f64::round));
            let is_right = matches!(found, Some(InertialFinding::Turned { turn: mend, is_certain: true })
                if (mend.to_rotation_matrix().into_inner() * turn - Matrix3::identity()).norm() < 1e-6);
            hold(format!("{turn}"), found, is_right);
            count += 1;
        }
        let found = drives.of_imu(Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, 1.0)));
        hold(
            "left-handed".into(),
            found,
            found == Some(InertialFinding::LeftHanded),
        );
        let found = drives.finding(
            |attitude| attitude,
            |sample| InertialSample {
                force: sample.force.map(|force| force / GRAVITY),
                ..sample
            },
        );
        hold("g".into(), found, found == Some(InertialFinding::ForceInG));
        let found = drives.finding(
            |attitude| attitude,
            |sample| InertialSample {
                rate: sample.rate.map(|rate| rate.map(f64::to_degrees)),
                ..sample
            },
        );
        hold(
            "degrees".into(),
            found,
            found == Some(InertialFinding::RateInDegrees),
        );
        count += 3;
    }
    assert_eq!(count, 30);
    assert!(wrong.is_empty(), "{wrong:?}");
    assert_eq!(Log::new(1, Motion::Drives).of_convention(Enu), None);
}

/// Faults with less to see: no finding is wrong, an attitude is called certain by two witnesses alone.
#[test]
fn what_a_log_does_not_show_is_not_certain() {
    let level = Log::new(7, Motion::Drives).on_slopes(0.003);
    for convention in [AttitudeConvention::PitchUp, AttitudeConvention::RollLeft] {
        assert_eq!(level.of_convention(convention), None);
    }
    // The gyroscope is the only witness of a heading.
    for motion in [Motion::Spins, Motion::Drives] {
        let found = Log::new(7, motion)
            .on_slopes(0.003)
            .of_convention(AttitudeConvention::Compass);
        let expected = InertialFinding::Attitude {
            convention: Some(AttitudeConvention::Compass),
            is_certain: false,
        };
        assert_eq!(found, Some(expected), "{motion:?}");
    }
    // Without gyroscope the pitch may be that of a turned Imu.
    let found = Log::new(7, Motion::Drives).finding(
        |attitude| AttitudeConvention::PitchUp.to_enu(&attitude),
        |sample| InertialSample {
            rate: None,
            ..sample
        },
    );
    let expected = InertialFinding::Attitude {
        convention: Some(AttitudeConvention::PitchUp),
        is_certain: false,
    };
    assert_eq!(found, Some(expected));
    let roof = UnitQuaternion::from_euler_angles(PI, 0.0, 0.0);
    let stands = Log::new(7, Motion::Stands);
    let found = stands.of_imu(Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, -1.0)));
    let Some(InertialFinding::Turned { turn, is_certain }) = found else {
        panic!("{found:?}");
    };
    assert!(!is_certain && turn.angle_to(&roof) < 1e-6, "{turn}");
    let found = Log::new(7, Motion::Drives).finding(
        |attitude| attitude,
        |sample| InertialSample {
            force: sample.force.map(|force| -force),
            ..sample
        },
    );
    assert_eq!(found, Some(InertialFinding::OppositeForce));
    let found = Log::new(7, Motion::Drives).finding(
        |attitude| attitude * roof,
        |sample| InertialSample {
            force: sample.force.map(|force| roof.inverse() * force),
            rate: sample.rate.map(|rate| roof.inverse() * rate),
            ..sample
        },
    );
    assert_eq!(found, Some(InertialFinding::UpsideDown));
}

#[test]
fn a_sensor_without_measurements_is_not_judged() {
    let none = |sample: InertialSample| InertialSample {
        force: None,
        rate: None,
        ..sample
    };
    let zero = |sample: InertialSample| InertialSample {
        force: Some(Vector3::zeros()),
        rate: Some(Vector3::zeros()),
        ..sample
    };
    for motion in [Motion::Drives, Motion::Spins, Motion::Stands] {
        for convention in [AttitudeConvention::Enu, AttitudeConvention::Ned] {
            let log = Log::new(3, motion);
            assert_eq!(log.finding(|given| convention.to_enu(&given), none), None);
            assert_eq!(log.finding(|given| convention.to_enu(&given), zero), None);
        }
    }
}

#[test]
fn poses_in_a_frame_that_is_not_level_are_named_as_such() {
    for seed in 0..4 {
        let drives = Log::new(seed, Motion::Drives);
        for axis in [Vector3::x_axis(), Vector3::y_axis()] {
            let frame = UnitQuaternion::from_axis_angle(&axis, FRAC_PI_2);
            let found = drives.finding(|attitude| frame * attitude, |sample| sample);
            let is_it = matches!(found, Some(InertialFinding::TiltedMap { level_from_map })
                if level_from_map.angle_to(&frame.inverse()) < 0.05);
            assert!(is_it, "{found:?}");
        }
        // Axes of accelerations that are fixed in the Imu are not.
        let about_y = Rotation3::from_axis_angle(&Vector3::y_axis(), FRAC_PI_2);
        let sample = |sample: InertialSample| InertialSample {
            force: sample.force.map(|force| about_y * force),
            ..sample
        };
        let found = drives.finding(|attitude| attitude, sample);
        assert_eq!(found, Some(InertialFinding::ForceAxes));
    }
}
