//! Clouds in wrong axes, of a wrong scale or leaning: none has the verdict OK, and the reason names the cause.

use lattice_core::pose::Axes;
use lattice_core::registration::{
    Calibration, CalibrationMap, CalibrationOptions, CalibrationRequest, SourceCloud, Verdict,
    register_global,
};
use lattice_lab::simulate::rooms::{Flat, LOOKS};
use nalgebra::{Isometry3, Point3, Vector3};

struct Scene {
    map: CalibrationMap,
    scan: SourceCloud,
    truth: Isometry3<f64>,
}

impl Scene {
    fn new(look: usize, labelled: bool) -> Scene {
        let flat = Flat::default();
        let map = CalibrationMap::new(flat.map(), 0.05).unwrap();
        let truth = Isometry3::new(Vector3::new(2.0, 4.0, 1.5), Vector3::z() * 2.5);
        let (eye, yaw) = LOOKS[look];
        let eye = Point3::from(eye);
        let mut cloud = flat.look(eye, yaw, &truth);
        if !labelled {
            cloud.labels.clear();
        }
        let sensor_m = Some(truth.inverse() * eye);
        let scan = SourceCloud { cloud, sensor_m };
        Scene { map, scan, truth }
    }

    /// The answer to the scan with every point changed.
    fn ask(
        &self,
        options: &CalibrationOptions,
        change: impl Fn(Vector3<f64>) -> Vector3<f64>,
    ) -> Calibration {
        let mut scan = self.scan.clone();
        let points = scan.cloud.points_m.iter_mut().chain(&mut scan.sensor_m);
        points.for_each(|p| p.coords = change(p.coords));
        let request = CalibrationRequest {
            source_clouds: &[scan],
            start: None,
            confusion: None,
        };
        register_global(&self.map, &request, options, &())
    }

    fn off_m(&self, found: &Calibration) -> f64 {
        (found.target_from_source.translation.vector - self.truth.translation.vector).norm()
    }
}

#[test]
fn axes_that_are_declared_wrongly_are_named() {
    for look in 0..2 {
        let scene = Scene::new(look, look == 0);
        for declared in Axes::ALL {
            let options = CalibrationOptions {
                axes: declared,
                ..CalibrationOptions::default()
            };
            for right in Axes::ALL {
                // The view without labels: only what was converted twice.
                if look == 1 && right != Axes::RosFlu {
                    continue;
                }
                let read = |p| declared.to_ros(right.from_ros(p));
                let found = scene.ask(&options, read);
                let said = format!("look {look}, {right} as {declared}: {}", found.reason);
                if right == declared {
                    assert_eq!(found.verdict, Verdict::Ok, "{said}");
                    continue;
                }
                assert_eq!(found.verdict, Verdict::RejectedInput, "{said}");
                assert!(found.reason.contains(&format!("fits as {right}")), "{said}");
            }
        }
    }
}

#[test]
fn a_conversion_too_many_and_a_mirror_are_told() {
    let scene = Scene::new(0, true);
    let options = CalibrationOptions::default();
    // Converted by the sender, then by the reader.
    for axes in [Axes::UnityRuf, Axes::Optical] {
        let found = scene.ask(&options, |p| axes.to_ros(p));
        assert_eq!(found.verdict, Verdict::RejectedInput, "{}", found.reason);
        assert!(found.reason.contains("converted twice"), "{}", found.reason);
        let read = CalibrationOptions { axes, ..options };
        let found = scene.ask(&read, |p| axes.to_ros(p));
        assert!(
            found
                .reason
                .contains("fits as ros_flu: the cloud was converted twice")
        );
    }
    let found = scene.ask(&options, |p| Vector3::new(p.x, -p.y, p.z));
    assert_eq!(found.verdict, Verdict::RejectedInput, "{}", found.reason);
    assert!(found.reason.contains("mirrored"), "{}", found.reason);
}

#[test]
fn no_other_axes_are_tried_of_a_cloud_whose_axes_are_trusted() {
    let scene = Scene::new(0, true);
    let given = CalibrationOptions::default();
    let trusted = CalibrationOptions {
        trust_axes: true,
        ..given
    };
    let [checked, found] = [given, trusted].map(|options| scene.ask(&options, |p| p));
    assert_eq!(found.verdict, Verdict::Ok, "{}", found.reason);
    assert_eq!(found.target_from_source, checked.target_from_source);
    assert_eq!(found.axis_hypothesis_lead, None);
    let mirror = |p: Vector3<f64>| Vector3::new(p.x, -p.y, p.z);
    let found = scene.ask(&trusted, mirror);
    assert!(!found.reason.contains("mirrored"), "{}", found.reason);
    assert_ne!(found.verdict, Verdict::Ok, "{}", found.reason);
}

#[test]
fn a_cloud_that_leans_is_not_ok() {
    let scene = Scene::new(0, true);
    for deg in [4.0_f64, 12.0, 90.0] {
        let lean = Isometry3::rotation(Vector3::x() * deg.to_radians());
        let found = scene.ask(&CalibrationOptions::default(), |p| lean * p);
        assert_ne!(found.verdict, Verdict::Ok, "{deg}: {}", found.reason);
        if deg < 5.0 {
            assert!(found.reason.contains("leans by 4.0"), "{}", found.reason);
        }
    }
}

#[test]
fn a_wrong_scale_is_refused_and_estimated_on_request() {
    for (look, by) in [(0, 0.9), (1, 1.1)] {
        let scene = Scene::new(look, true);
        let options = CalibrationOptions::default();
        let found = scene.ask(&options, |p| p * by);
        assert_ne!(
            found.verdict,
            Verdict::Ok,
            "{by}: {:?} {}",
            found.scale,
            found.reason
        );
        let wanted = CalibrationOptions {
            estimate_scale: true,
            ..options
        };
        let found = scene.ask(&wanted, |p| p * by);
        let scale = found.scale.unwrap();
        let said = format!("{by}: {scale:?} {}", found.reason);
        assert_eq!(found.verdict, Verdict::Ok, "{said}");
        assert!((scale.scale * by - 1.0).abs() < 0.004, "{said}");
        assert!(scale.sigma > 0.0 && scale.sigma < 0.01, "{said}");
        assert!(scene.off_m(&found) < 0.03, "{said}");
    }
    let scene = Scene::new(0, true);
    let found = scene.ask(&CalibrationOptions::default(), |p| p * 0.95);
    assert_eq!(found.verdict, Verdict::RejectedInput, "{}", found.reason);
    assert!(
        found.reason.contains("multiplied by 1.05"),
        "{}",
        found.reason
    );
    let right = scene.ask(&CalibrationOptions::default(), |p| p);
    assert!((right.scale.unwrap().scale - 1.0).abs() < 0.004);
}
