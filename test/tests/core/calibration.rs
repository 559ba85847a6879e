//! Calibrations in a flat of two rooms.

use std::ops::ControlFlow;

use lattice_core::registration::{
    Calibration, CalibrationMap, CalibrationOptions, CalibrationRequest, LabelDistribution,
    Progress, SemanticCloud, SourceCloud, Stage, Verdict, register_global, track,
};
use lattice_lab::simulate::rooms::{Flat, LOOKS};
use lattice_test::random::Random;
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

fn map(flat: &Flat) -> CalibrationMap {
    CalibrationMap::new(flat.map(), 0.05).unwrap()
}

fn distance(a: &Isometry3<f64>, b: &Isometry3<f64>) -> (f64, f64) {
    let apart = (a.translation.vector - b.translation.vector).norm();
    (apart, a.rotation.angle_to(&b.rotation))
}

/// A scan from one of the places to look from.
fn scan(flat: &Flat, look: usize, map_from_headset: &Isometry3<f64>) -> SourceCloud {
    let (eye, yaw) = LOOKS[look];
    let eye = Point3::from(eye);
    SourceCloud {
        cloud: flat.look(eye, yaw, map_from_headset),
        sensor_m: Some(map_from_headset.inverse() * eye),
    }
}

/// A frame somewhere, upright up to half a degree.
fn truth(seed: u64) -> Isometry3<f64> {
    let mut random = Random(seed);
    let mut signed = || 2.0 * random.unit() - 1.0;
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), signed() * std::f64::consts::PI)
        * UnitQuaternion::from_scaled_axis(Vector3::new(0.006, -0.006, 0.0) * signed());
    let place = Vector3::new(4.0 + 3.0 * signed(), 3.0 + 2.0 * signed(), 1.5);
    Isometry3::from_parts(Translation3::from(place), turn)
}

fn ask(
    map: &CalibrationMap,
    headset_scans: &[SourceCloud],
    start: Option<Isometry3<f64>>,
) -> Calibration {
    let request = CalibrationRequest {
        source_clouds: headset_scans,
        start,
        confusion: None,
    };
    register_global(map, &request, &CalibrationOptions::default(), &())
}

#[test]
fn every_place_is_found_without_a_start() {
    let flat = Flat::default();
    let map = map(&flat);
    for look in 0..5 {
        let truth = truth(look as u64);
        let mut scan = scan(&flat, look, &truth);
        // The last one without the place of the sensor, which rules out some poses.
        scan.sensor_m = scan.sensor_m.filter(|_| look != 4);
        let found = ask(&map, &[scan], None);
        let error = distance(&found.target_from_source, &truth);
        assert_eq!(found.verdict, Verdict::Ok, "{}", found.reason);
        assert!(error.0 < 0.03 && error.1 < 0.006, "{error:?}");
    }
}

#[test]
fn wrong_labels_cost_nothing() {
    let flat = Flat::default();
    let map = map(&flat);
    let truth = truth(9);
    let mut headset_scan = scan(&flat, 0, &truth);
    for label in &mut headset_scan.cloud.labels {
        // Every class is called by the name of another.
        let others = [(1, 2), (2, 1), (4, 5), (5, 6), (6, 8), (8, 9), (9, 4)];
        let other = others.iter().find(|(class, _)| label.top() == Some(*class));
        *label = LabelDistribution::hard(other.unwrap().1);
    }
    let start = truth * Isometry3::new(Vector3::new(0.2, -0.2, 0.05), Vector3::z() * 0.15);
    for start in [None, Some(start)] {
        let found = ask(&map, std::slice::from_ref(&headset_scan), start);
        let error = distance(&found.target_from_source, &truth);
        assert_eq!(found.verdict, Verdict::Ok, "{}", found.reason);
        assert!(error.0 < 0.02, "{error:?}");
        // It was learned what they are called here.
        assert!(found.class_reliability.iter().all(|c| c.agreement < 0.3));
    }
}

#[test]
fn what_cannot_be_used_is_refused_with_a_reason() {
    let flat = Flat::default();
    let map = map(&flat);
    let headset_scan = scan(&flat, 0, &truth(3));
    let changed = |change: fn(&mut SemanticCloud)| {
        let mut headset_scan = headset_scan.clone();
        change(&mut headset_scan.cloud);
        ask(&map, &[headset_scan], None)
    };
    let rejected = [
        changed(|cloud| *cloud = SemanticCloud::default()),
        changed(|cloud| cloud.points_m.iter_mut().for_each(|p| p.x = f64::NAN)),
        changed(|cloud| cloud.labels.truncate(7)),
        changed(|cloud| cloud.points_m.iter_mut().for_each(|p| p.coords *= 0.0)),
        ask(&map, &[], None),
        ask(
            &map,
            std::slice::from_ref(&headset_scan),
            Some(Isometry3::translation(f64::NAN, 0.0, 0.0)),
        ),
    ];
    for found in rejected {
        assert_eq!(found.verdict, Verdict::RejectedInput, "{}", found.reason);
    }
    let mirrored = changed(|cloud| cloud.points_m.iter_mut().for_each(|p| p.y = -p.y));
    assert_ne!(mirrored.verdict, Verdict::Ok);
    let unity = changed(|cloud| {
        cloud
            .points_m
            .iter_mut()
            .for_each(|p| *p = Point3::new(-p.y, p.z, p.x));
    });
    assert_eq!(unity.verdict, Verdict::RejectedInput);
    assert!(
        unity.reason.contains("fits as unity_ruf"),
        "{}",
        unity.reason
    );
    let few_nans = changed(|cloud| {
        cloud
            .points_m
            .iter_mut()
            .step_by(9)
            .for_each(|p| p.z = f64::INFINITY)
    });
    assert_eq!(few_nans.verdict, Verdict::Ok, "{}", few_nans.reason);
}

/// The points of a scan that fulfil a condition.
fn seen(scan: SourceCloud, is_so: impl Fn(&Point3<f64>, Option<u16>) -> bool) -> SourceCloud {
    let SourceCloud { cloud, sensor_m } = scan;
    let all = cloud.points_m.into_iter().zip(cloud.labels);
    let (points_m, labels) = all.filter(|(p, l)| is_so(p, l.top())).unzip();
    let cloud = SemanticCloud { points_m, labels };
    SourceCloud { cloud, sensor_m }
}

#[test]
fn a_bare_wall_may_be_anywhere() {
    let flat = Flat::default();
    let bare = seen(scan(&flat, 5, &truth(5)), |_, label| label == Some(1));
    let found = ask(&map(&flat), &[bare], None);
    assert_ne!(found.verdict, Verdict::Ok, "{}", found.reason);
}

#[test]
fn looks_at_one_plane_do_not_drag_a_tracked_pose() {
    let flat = Flat::default();
    let (map, truth) = (map(&flat), truth(5));
    let look = scan(&flat, 1, &truth);
    let floor = seen(look.clone(), |p, _| (truth * p).z < 0.05);
    assert!(floor.cloud.len() > 100);
    let off = truth * Isometry3::new(Vector3::new(0.0, 0.0, 0.03), Vector3::z() * 0.005);
    let follow = |look| track(&map, look, &off, &CalibrationOptions::default());
    let update = follow(&floor);
    assert!(
        update.fits && update.target_from_source == off,
        "{update:?}"
    );
    // All of the look holds it.
    assert!(distance(&follow(&look).target_from_source, &truth).0 < 0.01);
}

#[test]
fn it_can_be_ended() {
    struct Stop;
    impl Progress for Stop {
        fn report(&self, stage: Stage, _: f64) -> ControlFlow<()> {
            match stage {
                Stage::Refine => ControlFlow::Break(()),
                _ => ControlFlow::Continue(()),
            }
        }
    }
    let flat = Flat::default();
    let request = CalibrationRequest {
        source_clouds: &[scan(&flat, 0, &truth(3))],
        start: None,
        confusion: None,
    };
    let found = register_global(&map(&flat), &request, &CalibrationOptions::default(), &Stop);
    assert!(found.cancelled);
}

#[test]
fn a_tracked_pose_follows_and_breaks() {
    let flat = Flat::default();
    let map = map(&flat);
    let truth = truth(4);
    let off = truth * Isometry3::new(Vector3::new(0.03, -0.02, 0.01), Vector3::z() * 0.01);
    let options = CalibrationOptions::default();
    let update = track(&map, &scan(&flat, 1, &truth), &off, &options);
    assert!(update.fits);
    assert!(distance(&update.target_from_source, &truth).0 < 0.01);
    let elsewhere = scan(&flat, 1, &Isometry3::translation(50.0, 0.0, 9.0));
    let lost = track(&map, &elsewhere, &truth, &options);
    assert!(!lost.fits && lost.target_from_source == truth);
    let unusable = track(&map, &SourceCloud::default(), &truth, &options);
    assert!(!unusable.fits && unusable.target_from_source == truth);
}
