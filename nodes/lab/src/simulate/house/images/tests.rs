use super::*;
use crate::pool;
use crate::simulate::house::{House, robot_views};
use nalgebra::Vector3;

fn small(camera: RoomCamera) -> RoomCamera {
    camera.sized(48, 36)
}

#[test]
fn depth_is_that_of_the_rays_and_labels_are_those_of_the_faces() {
    let house = House::generated(3).unwrap();
    let rooms = RoomImages::new(&house, 4);
    let views = robot_views(&house, 6, 5).unwrap();
    let poses = views.iter().map(|view| view.truth);
    let mut classes = std::collections::BTreeSet::new();
    for pose in poses.chain(look_views(&house, 6, 5).unwrap()) {
        let camera = small(RoomCamera::ROBOT);
        let image = rooms.take(&camera, &pose, 1);
        assert_eq!(image.rgb.len(), 3 * 48 * 36);
        let origin_m = Point3::from(pose.translation.vector);
        for (pixel, (depth_m, label)) in image.depth_m.iter().zip(&image.labels).enumerate() {
            // The pinhole model of the nodes, from the camera_info.
            let info = camera.camera_info("camera", 0);
            let nodes = lattice_nodes::semantic_cloud::Camera::new(&info, false).unwrap();
            let [x, y] = nodes.ray((pixel % 48) as f64, (pixel / 48) as f64).unwrap();
            let optical = Vector3::new(x, y, 1.0);
            let way = pose.rotation * (RoomCamera::camera_from_optical() * optical);
            match house.cast(&origin_m, &way, MAX_M) {
                Some(hit) => {
                    let along_m = hit.distance_m / optical.norm();
                    assert!((along_m - f64::from(*depth_m)).abs() < 1e-4 * along_m);
                    assert_eq!(*label, house.mesh().labels()[hit.triangle]);
                    classes.insert(*label);
                }
                None => assert!(*depth_m == f32::INFINITY && *label == UNLABELED),
            }
        }
    }
    assert!(classes.len() > 6, "{classes:?}");
}

#[test]
fn an_image_depends_on_seeds_and_pose_alone() {
    let house = House::generated(3).unwrap();
    let pose = look_views(&house, 3, 1).unwrap()[2];
    let camera = small(RoomCamera::HEADSET);
    let take = |threads: usize, look: u64, seed: u64| {
        let work = || RoomImages::new(&house, look).take(&camera, &pose, seed);
        pool(threads).unwrap().install(work)
    };
    let image = take(1, 7, 8);
    assert!(image == take(3, 7, 8));
    let (look, noise) = (take(1, 6, 8), take(1, 7, 9));
    assert_eq!(image.depth_m, look.depth_m);
    assert_eq!(image.labels, noise.labels);
    assert!(image.rgb != look.rgb && image.rgb != noise.rgb);
    assert_eq!(image.measured_depth_m(1), look.measured_depth_m(1));
    assert_ne!(image.measured_depth_m(1), image.measured_depth_m(2));
}

#[test]
fn a_lamp_casts_shadows_and_images_are_neither_black_nor_white() {
    let house = House::generated(3).unwrap();
    let views = robot_views(&house, 16, 2).unwrap();
    for (look, view) in (0..).zip(&views) {
        let rooms = RoomImages::new(&house, look);
        let image = rooms.take(&small(RoomCamera::ROBOT), &view.truth, look);
        let mean = image.rgb.iter().map(|v| f64::from(*v)).sum::<f64>() / image.rgb.len() as f64;
        assert!((50.0..210.0).contains(&mean), "{mean}");
        let low = image.rgb.iter().min().copied();
        let high = image.rgb.iter().max().copied();
        assert!(high.unwrap() - low.unwrap() > 60);
    }
    // Below a table lamps are hardly seen, in whatever look.
    let lit = |look: u64, z: f64| {
        let surface = lamps::Surface {
            place_m: Point3::new(11.0, 2.3, z),
            normal: Vector3::z(),
            way: -Vector3::z(),
            albedo: Light::repeat(1.0),
            gloss: 0.0,
        };
        let lamps = RoomImages::new(&house, look).lamps;
        lamps.lit(&house, &surface).sum() - lamps.unshaded(&surface).sum()
    };
    let [below, above] = [0.6, 0.9].map(|z| (0..12).map(|look| lit(look, z)).sum::<f32>());
    assert!(below < 0.5 * above, "{below} {above}");
}

#[test]
fn noise_of_depth_grows_with_it_and_ends_at_the_range() {
    let house = House::generated(3).unwrap();
    let rooms = RoomImages::new(&house, 1);
    let (mut near_m, mut far_m) = (Vec::new(), Vec::new());
    let views = robot_views(&house, 6, 2).unwrap();
    let pixels = views.iter().flat_map(|view| {
        let image = rooms.take(&small(RoomCamera::ROBOT), &view.truth, 1);
        let measured_m = image.measured_depth_m(3);
        image.depth_m.into_iter().zip(measured_m)
    });
    for (depth_m, measured_m) in pixels {
        let off_m: f32 = (depth_m - measured_m).abs();
        match depth_m {
            0.4..1.5 => near_m.push(off_m),
            1.5..2.5 => {}
            2.5..=4.5 => far_m.push(off_m),
            _ => assert_eq!(measured_m, 0.0),
        }
        assert!(measured_m == 0.0 || off_m < 0.2);
    }
    let mean_m = |all: &[f32]| all.iter().sum::<f32>() / all.len() as f32;
    let [near, far] = [near_m.len(), far_m.len()];
    assert!(near > 100 && far > 100, "{near} {far}");
    assert!(mean_m(&near_m) > 0.0 && mean_m(&far_m) > 2.0 * mean_m(&near_m));
}

#[test]
fn drawn_houses_differ_and_have_room_to_stand() {
    let mut sizes = std::collections::BTreeSet::new();
    for seed in 0..12 {
        let house = House::drawn(seed).unwrap();
        assert!(house.mesh() == House::drawn(seed).unwrap().mesh());
        sizes.insert(house.mesh().len());
        assert!(
            house.free.cells_m.len() > 300,
            "{}",
            house.free.cells_m.len()
        );
        assert_eq!(robot_views(&house, 8, seed).unwrap().len(), 8);
    }
    assert!(sizes.len() > 10);
}
