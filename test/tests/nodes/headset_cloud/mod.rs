//! Meshes and label images of a headset to labelled clouds.

mod hostile;
mod meshes;
mod network;
mod scene;
mod unity;

use std::collections::BTreeMap;
use std::sync::Arc;

use lattice_core::pose::Axes;
use lattice_lab::simulate::house::{HeadsetTrial, House, HouseScan, Scene};
use lattice_nodes::headset_cloud::{HeadsetCloud, HeadsetStream};
use nalgebra::{Isometry3, Point3};

use self::scene::{camera_info, chunks, image, options, points, pose, pose_in, viewpoint_m};

/// Pixel of a point, by its camera with x forward.
fn pixel(camera: &Isometry3<f64>, point_m: &Point3<f64>) -> usize {
    let [width, height] = HouseScan::PIXELS;
    let p = camera.inverse_transform_point(point_m);
    let at = |size: usize, side_m: f64| {
        let middle = (size as f64 - 1.0) / 2.0;
        (middle - side_m / p.x * HouseScan::focal_px()).round() as usize
    };
    at(height, p.z) * width + at(width, p.y)
}

#[test]
fn the_simulated_headsets_points_come_from_its_mesh_in_all_axes() {
    let house = House::generated(3).unwrap();
    let [width, height] = HouseScan::PIXELS;
    for (scene, seed) in [(Scene::ALL[0], 1), (Scene::ALL[2], 5)] {
        let trial = HeadsetTrial::new(&house, scene, 2, seed).unwrap();
        let headset_from_house = trial.map_from_headset.inverse() * house.map_from_house();
        for axes in Axes::ALL {
            let own = match axes {
                Axes::RosFlu => Axes::Optical,
                axes => axes,
            };
            let params = [
                ("headset_axes", axes.name()),
                ("stride", "1"),
                ("max_range_m", "4.2"),
            ];
            let mut machine = HeadsetCloud::new(options(&params));
            machine.on_camera_info(Arc::new(camera_info()));
            let mut all = chunks(&trial.mesh, &headset_from_house, axes, 4000);
            assert!(all.len() > 3);
            // Chunks may come in any order.
            all.reverse();
            all.iter().for_each(|chunk| drop(machine.on_mesh(chunk)));
            assert_eq!(
                machine.counts().surfaces_replaced,
                1,
                "{:?}",
                machine.problem()
            );
            for (scan, stamp_ns) in trial.headset_scans.iter().zip(10..) {
                let camera = &scan.headset_from_camera;
                let mut labels = vec![u16::MAX; width * height];
                let mut truth = BTreeMap::new();
                for (point_m, region) in scan.points_m.iter().zip(&scan.regions) {
                    let at = pixel(camera, point_m);
                    labels[at] = *region;
                    truth.insert(at, *point_m);
                }
                assert_eq!(truth.len(), scan.points_m.len());
                let there = pose_in(axes, own, camera);
                machine.on_pose(&pose(stamp_ns, there));
                let image = image(stamp_ns, width, &labels);
                let outputs = machine.on_image(HeadsetStream::Labels, image);
                let from_m = viewpoint_m(&outputs).unwrap();
                assert!((from_m - camera.translation.vector).norm() < 1e-5);
                let found = points(&outputs);
                let mut missed = truth.len().abs_diff(found.len());
                for (point_m, label) in &found {
                    let at = pixel(camera, point_m);
                    assert_eq!(*label, labels[at]);
                    // Rays past the very edge of a triangle may meet what is behind.
                    match truth.get(&at).map(|truth_m| (truth_m - point_m).norm()) {
                        Some(off_m) if off_m < 1e-4 => {}
                        _ => missed += 1,
                    }
                }
                assert!(found.len() > 2000, "{axes}: {}", found.len());
                assert!(missed < 5, "{axes}: {missed} of {}", found.len());
            }
            assert_eq!(machine.counts().dropped, BTreeMap::new());
        }
    }
}
