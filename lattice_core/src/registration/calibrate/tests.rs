//! Calibrations in a flat of two rooms.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

use super::*;
use crate::registration::testing::{FURNITURE, Flat, Random, distance};
use crate::registration::{LabelDistribution, SemanticCloud};

fn map(flat: &Flat) -> CalibrationMap {
    CalibrationMap::new(flat.map(1), 0.05).unwrap()
}

/// A frame somewhere, upright up to half a degree.
fn truth(seed: u64) -> Isometry3<f64> {
    let mut random = Random::new(seed);
    let yaw = random.signed() * std::f64::consts::PI;
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw)
        * UnitQuaternion::from_scaled_axis(Vector3::new(0.006, -0.006, 0.0) * random.signed());
    let place = Vector3::new(
        4.0 + 3.0 * random.signed(),
        3.0 + 2.0 * random.signed(),
        1.5,
    );
    Isometry3::from_parts(Translation3::from(place), turn)
}

fn ask(
    map: &CalibrationMap,
    headset_scans: &[HeadsetScan],
    start: Option<Isometry3<f64>>,
) -> Calibration {
    let request = CalibrationRequest {
        headset_scans,
        start,
        confusion: None,
    };
    calibrate(map, &request, &CalibrationOptions::default(), &())
}

/// Places to look from, and headings.
const LOOKS: [([f64; 3], f64); 3] = [
    ([3.5, 3.8, 1.6], -2.2),
    ([1.0, 3.9, 1.6], -0.6),
    ([7.5, 3.0, 1.6], 2.2),
];

#[test]
fn every_place_is_found_without_a_start() {
    let flat = Flat::new();
    let map = map(&flat);
    for (seed, (eye, yaw)) in (1..).zip(LOOKS) {
        let truth = truth(seed);
        let headset_scan = flat.headset_scan(Point3::from(eye), yaw, &truth, seed);
        let found = ask(&map, &[headset_scan], None);
        let error = distance(&found.map_from_headset, &truth);
        assert_eq!(found.verdict, Verdict::Ok, "{}", found.reason);
        assert!(error.0 < 0.03 && error.1 < 0.006, "{error:?}");
    }
}

#[test]
fn wrong_labels_cost_nothing() {
    let flat = Flat::new();
    let map = map(&flat);
    let (eye, yaw) = LOOKS[0];
    let truth = truth(9);
    let mut headset_scan = flat.headset_scan(Point3::from(eye), yaw, &truth, 9);
    for label in &mut headset_scan.cloud.labels {
        // Every class is called by the name of another.
        let class = label.top().unwrap();
        let at = FURNITURE.iter().position(|c| *c == class);
        *label = LabelDistribution::hard(at.map_or(1 - class.min(1), |at| FURNITURE[(at + 1) % 5]));
    }
    let start = truth * Isometry3::new(Vector3::new(0.2, -0.2, 0.05), Vector3::z() * 0.15);
    for start in [None, Some(start)] {
        let found = ask(&map, std::slice::from_ref(&headset_scan), start);
        let error = distance(&found.map_from_headset, &truth);
        assert_eq!(found.verdict, Verdict::Ok, "{}", found.reason);
        assert!(error.0 < 0.02, "{error:?}");
        // It was learned what they are called here.
        assert!(found.class_reliability.iter().all(|c| c.agreement < 0.3));
    }
}

#[test]
fn what_cannot_be_used_is_refused_with_a_reason() {
    let flat = Flat::new();
    let map = map(&flat);
    let (eye, yaw) = LOOKS[0];
    let headset_scan = flat.headset_scan(Point3::from(eye), yaw, &truth(3), 3);
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
    assert!(unity.reason.contains("Unity"), "{}", unity.reason);
    let few_nans = changed(|cloud| {
        cloud
            .points_m
            .iter_mut()
            .step_by(9)
            .for_each(|p| p.z = f64::INFINITY)
    });
    assert_eq!(few_nans.verdict, Verdict::Ok, "{}", few_nans.reason);
}

#[test]
fn a_bare_wall_may_be_anywhere() {
    let flat = Flat::new();
    let map = map(&flat);
    let mut headset_scan = flat.headset_scan(Point3::new(3.5, 3.0, 1.6), 1.6, &truth(5), 5);
    let points = headset_scan
        .cloud
        .points_m
        .iter()
        .zip(&headset_scan.cloud.labels);
    let wall = points
        .filter(|(_, l)| l.top() == Some(0))
        .map(|(p, l)| (*p, *l));
    (headset_scan.cloud.points_m, headset_scan.cloud.labels) = wall.unzip();
    let found = ask(&map, &[headset_scan], None);
    assert_ne!(found.verdict, Verdict::Ok, "{}", found.reason);
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
    let flat = Flat::new();
    let headset_scan = flat.headset_scan(Point3::from(LOOKS[0].0), LOOKS[0].1, &truth(3), 3);
    let request = CalibrationRequest {
        headset_scans: &[headset_scan],
        start: None,
        confusion: None,
    };
    let found = calibrate(&map(&flat), &request, &CalibrationOptions::default(), &Stop);
    assert!(found.cancelled);
}

#[test]
fn a_tracked_pose_follows_and_breaks() {
    let flat = Flat::new();
    let map = map(&flat);
    let truth = truth(4);
    let off = truth * Isometry3::new(Vector3::new(0.03, -0.02, 0.01), Vector3::z() * 0.01);
    let headset_scan = flat.headset_scan(Point3::from(LOOKS[1].0), LOOKS[1].1, &truth, 4);
    let options = CalibrationOptions::default();
    let update = track(&map, &headset_scan, &off, &options);
    assert!(update.fits);
    assert!(distance(&update.map_from_headset, &truth).0 < 0.01);
    let elsewhere = flat.headset_scan(
        Point3::from(LOOKS[1].0),
        LOOKS[1].1,
        &Isometry3::translation(50.0, 0.0, 9.0),
        4,
    );
    let lost = track(&map, &elsewhere, &truth, &options);
    assert!(!lost.fits && lost.map_from_headset == truth);
    let unusable = track(&map, &HeadsetScan::default(), &truth, &options);
    assert!(!unusable.fits && unusable.map_from_headset == truth);
}
