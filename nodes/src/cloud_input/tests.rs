use lattice_core::cloud::{CloudLimits, NO_TIME_NS, TimeOptions, TimeReference, TimeUnit};
use lattice_msgs::builtin_interfaces::Time;
use lattice_msgs::geometry_msgs::Point32;
use lattice_msgs::livox_ros_driver2::{CustomMsg, CustomPoint};
use lattice_msgs::sensor_msgs::{
    ChannelFloat32, LaserEcho, LaserScan, MultiEchoLaserScan, PointCloud, PointCloud2,
};
use lattice_msgs::std_msgs::Header;
use lattice_msgs::{cdr, livox_interfaces};
use nalgebra::Vector3;
use proptest::prelude::*;

use super::*;
use crate::convert::cloud::layout_of;

const STAMP_NS: i64 = 1_700_000_000_000_000_000;

fn header() -> Header {
    Header {
        stamp: Time::from_ns(STAMP_NS),
        frame_id: "laser".to_owned(),
    }
}

fn scan(ranges: Vec<f32>) -> LaserScan {
    LaserScan {
        header: header(),
        angle_min: -0.5,
        angle_increment: 0.25,
        time_increment: 1e-3,
        range_min: 0.1,
        range_max: 30.0,
        ranges,
        ..LaserScan::default()
    }
}

/// Points, times and values of a field of a cloud.
struct Read {
    points_m: Vec<Vector3<f64>>,
    times_ns: Option<Vec<i64>>,
    intensities: Option<Vec<f64>>,
}

fn read(cloud: &PointCloud2, options: &TimeOptions) -> Read {
    let layout = layout_of(cloud);
    let view = layout.view(&cloud.data, &CloudLimits::default()).unwrap();
    let options = time_options(cloud, options);
    let times = view.point_times(STAMP_NS, &options).unwrap();
    let intensity = view.fields().iter().find(|field| field.name == "intensity");
    Read {
        points_m: (0..view.len()).map(|i| view.xyz(i)).collect(),
        times_ns: times.times_ns,
        intensities: intensity
            .map(|field| (0..view.len()).map(|i| view.scalar(field, i)).collect()),
    }
}

#[test]
fn a_ray_is_where_and_when_the_scanner_measured_it() {
    let mut message = scan(vec![2.0, 3.0, 4.0]);
    message.intensities = vec![7.0, 8.0, 9.0];
    let found = read(&cloud_of_scan(&message).unwrap(), &TimeOptions::default());
    for (i, point) in found.points_m.iter().enumerate() {
        let angle = -0.5 + 0.25 * i as f64;
        let expected = Vector3::new(angle.cos(), angle.sin(), 0.0) * (2.0 + i as f64);
        assert!((point - expected).norm() < 1e-6, "{point} {expected}");
    }
    let times_ns = [0, 1_000_000, 2_000_000].map(|ns| STAMP_NS + ns);
    assert_eq!(found.times_ns.unwrap(), times_ns);
    assert_eq!(found.intensities.unwrap(), [7.0, 8.0, 9.0]);
    // Of another number than the ranges.
    message.intensities.pop();
    let found = read(&cloud_of_scan(&message).unwrap(), &TimeOptions::default());
    assert_eq!(found.intensities, None);
}

#[test]
fn rays_without_a_valid_range_are_no_points() {
    let (inf, nan) = (f32::INFINITY, f32::NAN);
    let message = scan(vec![inf, -inf, nan, 0.0, 0.05, 31.0, 30.0, 0.1, -5.0]);
    let cloud = cloud_of_scan(&message).unwrap();
    assert!(!cloud.is_dense);
    let points = read(&cloud, &TimeOptions::default()).points_m;
    let is_point: Vec<bool> = points.iter().map(|p| p.x.is_finite()).collect();
    let expected = [false, false, false, false, false, false, true, true, false];
    assert_eq!(is_point, expected);
    // Limits that are not set.
    for (range_min, range_max) in [(0.0, 0.0), (nan, nan), (0.1, nan), (0.5, 0.1)] {
        let message = LaserScan {
            range_min,
            range_max,
            ..scan(vec![100.0, inf])
        };
        let points = read(&cloud_of_scan(&message).unwrap(), &TimeOptions::default()).points_m;
        assert!(
            points[0].x.is_finite() && points[1].x.is_nan(),
            "{range_max}"
        );
    }
}

#[test]
fn rays_measured_at_once_have_the_time_of_the_stamp() {
    // As of depth images and clouds that a node made scans of.
    let message = LaserScan {
        time_increment: 0.0,
        scan_time: 0.033,
        ..scan(vec![1.0; 5])
    };
    let found = read(&cloud_of_scan(&message).unwrap(), &TimeOptions::default());
    assert_eq!(found.times_ns, None);
}

#[test]
fn options_for_the_times_of_other_clouds_leave_those_of_scans() {
    let cloud = cloud_of_scan(&scan(vec![1.0; 3])).unwrap();
    let options = TimeOptions {
        field: Some("t".to_owned()),
        unit: Some(TimeUnit::Microseconds),
        reference: Some(TimeReference::Absolute),
        ..TimeOptions::default()
    };
    let times_ns = read(&cloud, &options).times_ns.unwrap();
    assert_eq!(times_ns[2], STAMP_NS + 2_000_000);
    let at_end = TimeOptions {
        reference: Some(TimeReference::StampEnd),
        ..TimeOptions::default()
    };
    let times_ns = read(&cloud, &at_end).times_ns.unwrap();
    assert_eq!((times_ns[0], times_ns[2]), (STAMP_NS - 2_000_000, STAMP_NS));
    let off = TimeOptions {
        field: Some(String::new()),
        ..TimeOptions::default()
    };
    assert_eq!(read(&cloud, &off).times_ns, None);
}

#[test]
fn angles_and_times_that_are_no_numbers_are_refused_by_name() {
    let of = |angle_min, angle_increment, time_increment| LaserScan {
        angle_min,
        angle_increment,
        time_increment,
        ..scan(vec![1.0])
    };
    let (inf, nan) = (f32::INFINITY, f32::NAN);
    for (text, message) in [
        ("`angle_min` is inf", of(inf, 0.1, 0.0)),
        ("`angle_increment` is NaN", of(0.0, nan, 0.0)),
        ("`time_increment` is -inf", of(0.0, 0.1, -inf)),
    ] {
        let error = cloud_of_scan(&message).unwrap_err().to_string();
        assert!(error.contains(text), "{error}");
    }
    let many = scan(vec![1.0; MAX_POINTS + 1]);
    let error = cloud_of_scan(&many).unwrap_err().to_string();
    assert!(error.contains("4000001 points"), "{error}");
}

#[test]
fn each_echo_of_a_ray_is_a_point_at_the_time_of_the_ray() {
    let echoes = |echoes: &[f32]| LaserEcho {
        echoes: echoes.to_vec(),
    };
    let mut message = MultiEchoLaserScan {
        header: header(),
        angle_increment: 0.5,
        time_increment: 1e-3,
        range_max: 30.0,
        ranges: vec![echoes(&[1.0, 2.0]), echoes(&[]), echoes(&[3.0])],
        intensities: vec![echoes(&[5.0, 6.0]), echoes(&[]), echoes(&[7.0])],
        ..MultiEchoLaserScan::default()
    };
    let found = read(&cloud_of_echoes(&message).unwrap(), &TimeOptions::default());
    let ranges: Vec<f64> = found.points_m.iter().map(|p| p.norm()).collect();
    assert!(
        ranges
            .iter()
            .zip([1.0, 2.0, 3.0])
            .all(|(a, b)| (a - b).abs() < 1e-6)
    );
    assert!((found.points_m[2].y - 3.0 * 1.0_f64.sin()).abs() < 1e-6);
    let times_ns = [0, 0, 2_000_000].map(|ns| STAMP_NS + ns);
    assert_eq!(found.times_ns.unwrap(), times_ns);
    assert_eq!(found.intensities.unwrap(), [5.0, 6.0, 7.0]);
    message.intensities[2].echoes.clear();
    let found = read(&cloud_of_echoes(&message).unwrap(), &TimeOptions::default());
    assert_eq!(found.intensities, None);
}

#[test]
fn points_of_livox_have_their_times_and_those_in_the_origin_are_none() {
    let point = |x, offset_time| CustomPoint {
        offset_time,
        x,
        reflectivity: 200,
        tag: 16,
        line: 3,
        ..CustomPoint::default()
    };
    let message = CustomMsg {
        header: header(),
        timebase: 99,
        points: vec![point(1.0, 0), point(0.0, 5), point(2.0, 90_000_000)],
        ..CustomMsg::default()
    };
    let cloud = cloud_of_livox(&message).unwrap();
    let names: Vec<&str> = cloud.fields.iter().map(|f| f.name.as_str()).collect();
    assert_eq!(
        names,
        ["x", "y", "z", "intensity", "tag", "line", TIME_FIELD]
    );
    let found = read(&cloud, &TimeOptions::default());
    assert_eq!(found.points_m, [Vector3::x(), Vector3::x() * 2.0]);
    assert_eq!(found.times_ns.unwrap(), [STAMP_NS, STAMP_NS + 90_000_000]);
    assert_eq!(found.intensities.unwrap(), [200.0; 2]);
}

#[test]
fn packages_of_livox_have_one_layout() {
    let message = livox_interfaces::CustomMsg {
        header: header(),
        point_num: 1,
        points: vec![livox_interfaces::CustomPoint {
            offset_time: 7,
            x: 1.0,
            y: 2.0,
            z: 3.0,
            reflectivity: 4,
            tag: 5,
            line: 6,
        }],
        ..livox_interfaces::CustomMsg::default()
    };
    let bytes = cdr::to_vec(&message).unwrap();
    let livox = CustomMsg::from(message);
    for of in [
        CloudType::LivoxDriver2,
        CloudType::LivoxDriver,
        CloudType::LivoxInterfaces,
    ] {
        assert_eq!(
            of.decode(&bytes).unwrap(),
            SensorCloud::Livox(livox.clone())
        );
    }
}

#[test]
fn channels_of_a_point_cloud_are_fields() {
    let channel = |name: &str, values: &[f32]| ChannelFloat32 {
        name: name.to_owned(),
        values: values.to_vec(),
    };
    let mut message = PointCloud {
        header: header(),
        points: [1.0, 2.0].map(|x| Point32 { x, y: 0.5, z: -1.0 }).into(),
        channels: vec![
            channel("intensity", &[3.0, 4.0]),
            channel("time", &[0.0, 0.25]),
        ],
    };
    let found = read(
        &cloud_of_channels(&message).unwrap(),
        &TimeOptions::default(),
    );
    assert_eq!(found.points_m[1], Vector3::new(2.0, 0.5, -1.0));
    assert_eq!(found.intensities.unwrap(), [3.0, 4.0]);
    assert_eq!(found.times_ns.unwrap()[1], STAMP_NS + 250_000_000);
    message.channels[1].values.pop();
    let error = cloud_of_channels(&message).unwrap_err().to_string();
    assert!(
        error.contains("'time' has 1 values for 2 points"),
        "{error}"
    );
}

#[test]
fn names_of_types_are_theirs_alone() {
    for of in CloudType::ALL {
        assert_eq!(CloudType::of(of.name()), Some(of));
    }
    assert_eq!(CloudType::of("sensor_msgs/msg/Imu"), None);
}

/// Any range, and those of REP 117.
fn range() -> impl Strategy<Value = f32> {
    prop_oneof![
        4 => 0.0..50.0_f32,
        1 => prop::sample::select(vec![f32::INFINITY, f32::NEG_INFINITY, f32::NAN, 0.0, -0.0, 31.0, f32::MAX]),
        1 => any::<f32>(),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn rays_of_any_scan_are_points_or_none(
        ranges in prop::collection::vec(range(), 0..60),
        angle_min in -7.0..7.0_f32,
        angle_increment in -0.2..0.2_f32,
        time_increment in prop_oneof![Just(0.0), -1e-2..1e-2_f32],
        range_min in 0.0..2.0_f32,
        range_max in 2.5..60.0_f32,
    ) {
        let message = LaserScan {
            header: header(),
            angle_min,
            angle_increment,
            time_increment,
            range_min,
            range_max,
            ranges: ranges.clone(),
            ..LaserScan::default()
        };
        let found = read(&cloud_of_scan(&message).unwrap(), &TimeOptions::default());
        prop_assert_eq!(found.points_m.len(), ranges.len());
        for (i, (range_m, point)) in ranges.iter().zip(&found.points_m).enumerate() {
            let is_valid = *range_m >= range_min && *range_m <= range_max;
            prop_assert_eq!(point.iter().all(|v| v.is_finite()), is_valid);
            if !is_valid {
                continue;
            }
            let (range_m, angle) = (f64::from(*range_m), f64::from(angle_min) + i as f64 * f64::from(angle_increment));
            prop_assert!((point.x - range_m * angle.cos()).abs() < 1e-5);
            prop_assert!((point.y - range_m * angle.sin()).abs() < 1e-5);
            prop_assert_eq!(point.z, 0.0);
            let since_ns = i as f64 * f64::from(time_increment) * 1e9;
            let time_ns = found.times_ns.as_ref().map_or(STAMP_NS, |times| times[i]);
            // A return in the origin is none, and has no time beside those of others.
            if time_ns != NO_TIME_NS {
                prop_assert!(((time_ns - STAMP_NS) as f64 - since_ns).abs() <= 1.0);
            } else {
                prop_assert_eq!(range_m, 0.0);
            }
        }
    }

    #[test]
    fn any_numbers_are_converted_or_refused(
        numbers in prop::array::uniform7(any::<f32>()),
        ranges in prop::collection::vec(any::<f32>(), 0..20),
        intensities in prop::collection::vec(any::<f32>(), 0..20),
    ) {
        let [angle_min, angle_max, angle_increment, time_increment, scan_time, range_min, range_max] = numbers;
        let message = LaserScan {
            header: header(),
            angle_min,
            angle_max,
            angle_increment,
            time_increment,
            scan_time,
            range_min,
            range_max,
            ranges,
            intensities,
        };
        let is_finite = [angle_min, angle_increment, time_increment].iter().all(|v| v.is_finite());
        let cloud = cloud_of_scan(&message);
        prop_assert_eq!(cloud.is_ok(), is_finite);
        if let Ok(cloud) = cloud {
            let layout = layout_of(&cloud);
            let view = layout.view(&cloud.data, &CloudLimits::default()).unwrap();
            let _ = view.point_times(STAMP_NS, &time_options(&cloud, &TimeOptions::default()));
        }
    }

    #[test]
    fn any_bytes_are_decoded_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        for of in CloudType::ALL {
            if let Ok(message) = of.decode(&bytes) {
                let _ = message.into_cloud();
            }
        }
    }
}
