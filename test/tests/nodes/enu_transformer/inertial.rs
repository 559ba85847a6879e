//! Attitudes of an INS against the accelerations and turning rates of its Imu.

use std::f64::consts::PI;

use lattice_core::geodesy::{EnuFrame, Geodetic};
use lattice_core::pose::AttitudeConvention;
use lattice_msgs::geometry_msgs;
use lattice_msgs::sensor_msgs::{Imu, NavSatFix, NavSatStatus};
use lattice_nodes::enu_transformer::ins::{InsMessage, InsSource};
use lattice_nodes::enu_transformer::{AttitudeReport, TransformerOptions};
use lattice_test::clouds::{SECOND_NS, header, pose};
use nalgebra::{Isometry3, UnitQuaternion, Vector3};

use super::{Bench, START_NS};

/// Attitude of the machine: slopes and bends.
fn attitude(time_s: f64) -> UnitQuaternion<f64> {
    let wave = |size: f64, rad_per_s: f64| size * (rad_per_s * time_s).sin();
    UnitQuaternion::from_euler_angles(wave(0.08, 0.5), wave(0.1, 0.7), wave(0.7, 0.3))
}

/// An Imu: its mount, the convention of its orientation, and changes of its fields.
struct Sensor {
    base_from_imu: UnitQuaternion<f64>,
    orientation: AttitudeConvention,
    change: fn(&mut Imu),
}

impl Sensor {
    const SOUND: fn(&mut Imu) = |_| {};

    fn sample(&self, time_s: f64, stamp_ns: i64) -> Imu {
        let imu_from_base = self.base_from_imu.inverse();
        let [from, to] = [-0.001, 0.001].map(|step_s| attitude(time_s + step_s));
        let rate = imu_from_base * ((from.inverse() * to).scaled_axis() / 0.002);
        let at = attitude(time_s);
        let force = imu_from_base * (at.inverse() * Vector3::new(0.0, 0.0, 9.81));
        let vector = |v: Vector3<f64>| geometry_msgs::Vector3 {
            x: v.x,
            y: v.y,
            z: v.z,
        };
        let given = self.orientation.to_enu(&(at * self.base_from_imu));
        let mut imu = Imu {
            header: header("", stamp_ns),
            orientation: pose(&Isometry3::from_parts(Vector3::zeros().into(), given)).orientation,
            angular_velocity: vector(rate),
            linear_acceleration: vector(force),
            ..Imu::default()
        };
        (self.change)(&mut imu);
        imu
    }
}

/// The contradiction that is found in two minutes of fixes at 10 Hz and an Imu at 50 Hz.
fn report(sensor: &Sensor, set: impl Fn(&mut TransformerOptions)) -> Option<AttitudeReport> {
    let origin = Geodetic::from_degrees(48.0, 11.0, 500.0).unwrap();
    let frame = EnuFrame::new(origin);
    let mut options = TransformerOptions::new(InsSource::NavsatfixImu);
    options.ins.origin = Some(origin);
    options.ins.lever_arm_m = Some(Vector3::zeros());
    set(&mut options);
    let mut bench = Bench::new(options);
    let mut place = Vector3::zeros();
    for step in 0..6000_i64 {
        let (stamp_ns, time_s) = (START_NS + step * SECOND_NS / 50, step as f64 * 0.02);
        let ahead = attitude(time_s) * Vector3::x();
        place += Vector3::new(ahead.x, ahead.y, 0.0) * 0.04;
        bench.ins(InsMessage::Imu(&sensor.sample(time_s, stamp_ns)), stamp_ns);
        if step % 5 == 0 {
            let at = frame.geodetic_from_enu(&place).unwrap();
            let fix = NavSatFix {
                header: header("", stamp_ns),
                status: NavSatStatus {
                    status: NavSatStatus::STATUS_FIX,
                    ..NavSatStatus::default()
                },
                latitude: at.latitude_deg(),
                longitude: at.longitude_deg(),
                altitude: at.height_m,
                ..NavSatFix::default()
            };
            bench.ins(InsMessage::Fix(&fix), stamp_ns);
        }
    }
    assert!(bench.machine.counts().poses_in > 5000);
    bench.machine.attitude()
}

fn sensor(orientation: AttitudeConvention, change: fn(&mut Imu)) -> Sensor {
    Sensor {
        base_from_imu: UnitQuaternion::identity(),
        orientation,
        change,
    }
}

#[test]
fn orientations_that_accelerations_and_rates_contradict_are_named() {
    use AttitudeConvention::{Compass, Enu, Ned, PitchUp, RollLeft, Swapped};
    for convention in [Ned, Compass, PitchUp, RollLeft, Swapped] {
        let faulty = sensor(convention, Sensor::SOUND);
        let found = report(&faulty, |_| {}).unwrap();
        let remedy = format!("`ins.orientation: {}`", convention.name());
        let is_named = found.is_impossible && found.text.contains(&remedy);
        assert!(is_named, "{convention:?}: {}", found.text);
        let mended = report(&faulty, |options| options.ins.orientation = convention);
        assert_eq!(mended, None, "{convention:?}");
    }
    assert_eq!(report(&sensor(Enu, Sensor::SOUND), |_| {}), None);
}

#[test]
fn a_driver_with_all_axes_north_east_down_is_mended_by_the_convention() {
    let frd = |imu: &mut Imu| {
        for field in [&mut imu.linear_acceleration, &mut imu.angular_velocity] {
            (field.y, field.z) = (-field.y, -field.z);
        }
    };
    let driver = sensor(AttitudeConvention::Ned, frd);
    let found = report(&driver, |_| {}).unwrap();
    assert!(found.is_impossible && found.text.contains("`ins.orientation: ned`"));
    let set = |options: &mut TransformerOptions| options.ins.orientation = AttitudeConvention::Ned;
    assert_eq!(report(&driver, set), None);
}

#[test]
fn an_imu_upside_down_without_mount_is_named_and_mended_by_its_boresight() {
    let upside_down = Sensor {
        base_from_imu: UnitQuaternion::from_euler_angles(PI, 0.0, 0.0),
        ..sensor(AttitudeConvention::Enu, Sensor::SOUND)
    };
    let found = report(&upside_down, |_| {}).unwrap();
    assert!(!found.is_impossible);
    let words = "base_link is upside down by the orientation and the accelerations of ins";
    assert!(found.text.contains(words), "{}", found.text);
    let mount = upside_down.base_from_imu;
    let mended = report(&upside_down, |options| {
        options.ins.base_from_ins = Some(mount)
    });
    assert_eq!(mended, None);
}

#[test]
fn units_are_named_and_absent_fields_are_not_compared() {
    let of = |orientation, change| report(&sensor(orientation, change), |_| {});
    let in_g = of(AttitudeConvention::Enu, |imu| {
        for value in [
            &mut imu.linear_acceleration.x,
            &mut imu.linear_acceleration.y,
            &mut imu.linear_acceleration.z,
        ] {
            *value /= 9.81;
        }
    });
    let is_named = in_g.is_some_and(|found| !found.is_impossible && found.text.contains("in g"));
    assert!(is_named);
    // Pitch is wrong, and no field shows it.
    let absent = of(AttitudeConvention::PitchUp, |imu| {
        imu.angular_velocity_covariance[0] = -1.0;
        imu.linear_acceleration_covariance[0] = -1.0;
    });
    assert_eq!(absent, None);
    let zero = of(AttitudeConvention::PitchUp, |imu| {
        imu.angular_velocity = geometry_msgs::Vector3::default();
        imu.linear_acceleration = geometry_msgs::Vector3::default();
    });
    assert_eq!(zero, None);
    let hostile = of(AttitudeConvention::PitchUp, |imu| {
        imu.angular_velocity.x = f64::NAN;
        imu.linear_acceleration.y = f64::INFINITY;
    });
    assert_eq!(hostile, None);
}
