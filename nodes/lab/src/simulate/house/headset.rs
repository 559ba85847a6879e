//! The view of a headset on a scene, on its own mesh and in its own frame.

use super::camera::{Camera, Image, looking};
use super::headset_mesh::{DepthView, Volume};
use super::scenes::{self, Stand};
use super::warp::Warp;
use super::{House, Scene};
use crate::AnyError;
use crate::mesh::{LabelledMesh, MeshScene};
use crate::options::within;
use crate::simulate::random::{Purpose, Stream};
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

/// Depth views fused for each headset scan, their pixels, field of view and noise.
const DEPTH_VIEWS: usize = 8;
const DEPTH_PIXELS: [usize; 2] = [72, 56];
const DEPTH_HFOV_DEG: f64 = 75.0;
const DEPTH_NOISE_M: f64 = 0.005;
/// The wearer moved this far about the place before, metres.
const STROLL_M: f64 = 0.9;
/// The mesh reaches beyond the picture by this, metres.
const MARGIN_M: f64 = 0.25;

/// The camera of a HoloLens: pixels in a row, rows, horizontal field of view.
pub(super) const PIXELS: [usize; 2] = [144, 81];
pub(super) const HFOV_DEG: f64 = 48.0;
/// Height of the eyes above the floor, metres.
const EYE_HEIGHT_M: f64 = 1.62;
/// Greatest distance of the mesh, metres.
const MAX_RANGE_M: f64 = 4.2;
/// Most that the mesh is shifted along each axis, slowly over space, metres.
const WARP_M: f64 = 0.012;
/// Standard deviation of the scale of distances from the headset; never beyond 1 %.
const SCALE_SIGMA: f64 = 0.004;
/// Most that the headset's vertical is off, degrees.
const TILT_DEG: f64 = 0.5;
/// Wavering of the boundaries of labels in the image, pixels.
const BLEED_PX: f64 = 2.0;
/// Least and greatest turn of further headset scans, degrees; drawn by the seed.
const TURN_DEG: [f64; 2] = [60.0, 90.0];

/// The labelled points of one picture.
#[derive(Clone, PartialEq, Debug)]
pub struct HouseScan {
    /// Points on the headset's mesh: headset_origin, ROS axes (x forward at the start, z up), metres.
    pub points_m: Vec<Point3<f64>>,
    /// Region of each point as seen in the image, see [`House::regions`]; `NO_REGION` where the
    /// image shows nothing.
    pub regions: Vec<u16>,
    /// Position of the camera in headset_origin, metres.
    pub sensor_m: Point3<f64>,
    /// Pose of the camera: x forward, y left, z up, both in ROS axes.
    pub headset_from_camera: Isometry3<f64>,
}

impl HouseScan {
    /// Pixels in a row and rows of the camera; its axis is in the middle.
    pub const PIXELS: [usize; 2] = PIXELS;

    /// Focal length of the camera, pixels.
    pub fn focal_px() -> f64 {
        PIXELS[0] as f64 / 2.0 / (HFOV_DEG.to_radians() / 2.0).tan()
    }
}

/// A headset before a scene, with the truth.
#[derive(Clone, Debug)]
pub struct HeadsetTrial {
    /// Scene that is looked at.
    pub scene: Scene,
    /// Instance of the object in the house's mesh.
    pub instance: u16,
    /// One or several, all in the same frame.
    pub headset_scans: Vec<HouseScan>,
    /// True pose of the headset in the map.
    pub map_from_headset: Isometry3<f64>,
    /// Side of a voxel of the headset's mesh, metres.
    pub voxel_m: f64,
    /// The scale of distances from the headset, where 1 is right.
    pub scale: f64,
    /// The headset's mesh, house frame.
    pub mesh: LabelledMesh,
}

impl HeadsetTrial {
    /// Stands before the object of a scene and looks at it; single-threaded, by the seed alone.
    ///
    /// Of 1 to 6 headset scans the second is turned to one side, the third to the other.
    pub fn new(
        house: &House,
        scene: Scene,
        headset_scans: usize,
        seed: u64,
    ) -> Result<HeadsetTrial, AnyError> {
        within("headset_scans", headset_scans as f64, 1.0, 6.0)?;
        let stand = scenes::stand(house, scene, EYE_HEIGHT_M, seed)?;
        let lane = scene as u64;
        let mut stream = Stream::new(seed, Purpose::HeadsetFrame, 0, lane);
        let voxel_m = 0.06 + 0.03 * stream.uniform();
        let scale = 1.0 + (SCALE_SIGMA * stream.normal()).clamp(-0.01, 0.01);
        let house_from_headset = frame(house, &stand, &mut stream);
        let poses = poses(house, &stand, headset_scans, &mut stream);
        let eye_m = house.free.above_m(stand.cell_m, EYE_HEIGHT_M);
        let warp = Warp::new(WARP_M, scale, eye_m, &mut stream);
        let [width, height] = PIXELS;
        let camera = Camera::new(width, height, HFOV_DEG);

        let views = depth_views(house, &stand, &poses, seed, lane);
        let (low_m, high_m) = reach_m(house, &poses, &camera);
        let volume = Volume::new(low_m, high_m, voxel_m)?;
        let cameras: Vec<_> = poses.iter().map(Isometry3::inverse).collect();
        let wanted = |point_m: &Point3<f64>| {
            let mut cameras = cameras.iter();
            cameras.any(|c| near_picture(&camera, &(c * point_m)))
        };
        let mesh = volume.fuse(&views, wanted, &warp)?;
        let mesh_scene = MeshScene::new_fast(&mesh)?;
        let headset_from_house = house_from_headset.inverse();
        let headset_scan = |(number, pose): (usize, &Isometry3<f64>)| {
            let index = lane * 64 + number as u64;
            let mut stream = Stream::new(seed, Purpose::HeadsetScan, 0, index);
            let image = Image::take(house, pose, camera, 4.0 * MAX_RANGE_M);
            let regions = image.bled(BLEED_PX, &mut stream);
            look(&mesh_scene, pose, camera, &regions, &headset_from_house)
        };
        Ok(HeadsetTrial {
            scene,
            instance: stand.instance,
            headset_scans: poses.iter().enumerate().map(headset_scan).collect(),
            map_from_headset: house.map_from_house() * house_from_headset,
            voxel_m,
            scale,
            mesh,
        })
    }
}

/// Pose at which the app was started: some metres away at any heading, nearly upright.
fn frame(house: &House, stand: &Stand, stream: &mut Stream) -> Isometry3<f64> {
    let [x, y] = stand.cell_m;
    let far = |cell: &&[f64; 2]| (1.5..6.0).contains(&(cell[0] - x).hypot(cell[1] - y));
    let cells: Vec<[f64; 2]> = house.free.cells_m.iter().filter(far).copied().collect();
    let choice = (stream.uniform() * cells.len() as f64) as usize;
    let cell_m = cells.get(choice).copied().unwrap_or(stand.cell_m);
    let height_m = EYE_HEIGHT_M + 0.05 * (2.0 * stream.uniform() - 1.0);
    let yaw = std::f64::consts::TAU * stream.uniform();
    let axis = std::f64::consts::TAU * stream.uniform();
    let tilt = TILT_DEG.to_radians() * stream.uniform();
    let tilt = Vector3::new(axis.cos(), axis.sin(), 0.0) * tilt;
    let rotation = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw)
        * UnitQuaternion::from_scaled_axis(tilt);
    let origin_m = house.free.above_m(cell_m, height_m);
    Isometry3::from_parts(Translation3::from(origin_m.coords), rotation)
}

/// Poses of the camera, house frame: the first looks at the object, the others to its sides.
fn poses(
    house: &House,
    stand: &Stand,
    headset_scans: usize,
    stream: &mut Stream,
) -> Vec<Isometry3<f64>> {
    let eye_m = house.free.above_m(stand.cell_m, EYE_HEIGHT_M);
    let ray = stand.target_m - eye_m;
    let jitter =
        |stream: &mut Stream, degrees: f64| (degrees * (2.0 * stream.uniform() - 1.0)).to_radians();
    let yaw = ray.y.atan2(ray.x) + jitter(stream, 4.0);
    let pitch = ray.z.atan2(ray.x.hypot(ray.y)) + jitter(stream, 3.0);
    let mut poses = vec![looking(eye_m, yaw, pitch)];
    let side = if stream.uniform() < 0.5 { -1.0 } else { 1.0 };
    for number in 1..headset_scans {
        let [low, high] = TURN_DEG;
        let turn = (low + (high - low) * stream.uniform()).to_radians();
        let times = number.div_ceil(2) as f64;
        let side = if number % 2 == 1 { side } else { -side };
        let moved = Vector3::from_fn(|_, _| 0.06 * (2.0 * stream.uniform() - 1.0));
        let pitch = (-12.0_f64).to_radians() + jitter(stream, 6.0);
        poses.push(looking(eye_m + moved, yaw + side * times * turn, pitch));
    }
    poses
}

/// Depth views of the headset on a stroll about the place.
fn depth_views(
    house: &House,
    stand: &Stand,
    poses: &[Isometry3<f64>],
    seed: u64,
    lane: u64,
) -> Vec<DepthView> {
    let [x, y] = stand.cell_m;
    let near = |cell: &&[f64; 2]| (cell[0] - x).hypot(cell[1] - y) <= STROLL_M;
    let cells: Vec<[f64; 2]> = house.free.cells_m.iter().filter(near).copied().collect();
    let [width, height] = DEPTH_PIXELS;
    let camera = Camera::new(width, height, DEPTH_HFOV_DEG);
    let mut views = Vec::with_capacity(poses.len() * DEPTH_VIEWS);
    for number in 0..poses.len() * DEPTH_VIEWS {
        let mut stream = Stream::new(seed, Purpose::HeadsetView, 0, lane * 4096 + number as u64);
        let mut between = |low: f64, high: f64| low + (high - low) * stream.uniform();
        let Some(pose) = poses.get(number / DEPTH_VIEWS) else {
            continue;
        };
        let first = number % DEPTH_VIEWS == 0;
        let choice = (between(0.0, 1.0) * cells.len() as f64) as usize;
        let cell_m = cells.get(choice).copied().filter(|_| !first);
        let height_m = EYE_HEIGHT_M + between(-0.2, 0.1);
        let forward = pose.rotation * Vector3::x();
        let mut yaw = forward.y.atan2(forward.x);
        let mut pitch = forward.z.asin();
        if !first {
            yaw += between(-30.0, 30.0).to_radians();
            pitch += between(-15.0, 15.0).to_radians();
        }
        let place = cell_m.unwrap_or(stand.cell_m);
        let house_from_camera = looking(house.free.above_m(place, height_m), yaw, pitch);
        let depths_m = depths_m(house, &house_from_camera, camera, &mut stream);
        views.push(DepthView {
            house_from_camera,
            image: Image {
                camera,
                depths_m,
                regions: Vec::new(),
            },
        });
    }
    views
}

fn depths_m(
    house: &House,
    house_from_camera: &Isometry3<f64>,
    camera: Camera,
    stream: &mut Stream,
) -> Vec<f64> {
    let origin_m = Point3::from(house_from_camera.translation.vector);
    let depth = |pixel: usize| {
        let ray = camera.direction(pixel);
        let noise_m = DEPTH_NOISE_M * stream.normal();
        let direction = house_from_camera.rotation * ray;
        let hit_m = house.depth_m(&origin_m, &direction, MAX_RANGE_M + 0.5);
        hit_m.map_or(f64::INFINITY, |hit_m| hit_m / ray.norm() + noise_m)
    };
    (0..camera.pixels()).map(depth).collect()
}

/// The box about all pictures, cut to the house, with some margin, house frame, metres.
fn reach_m(house: &House, poses: &[Isometry3<f64>], camera: &Camera) -> (Point3<f64>, Point3<f64>) {
    let mut low_m = Point3::from([f64::INFINITY; 3]);
    let mut high_m = Point3::from([f64::NEG_INFINITY; 3]);
    let last = camera.pixels() - 1;
    let corners = [0, camera.width - 1, last + 1 - camera.width, last];
    for pose in poses {
        let rays = corners.map(|corner| camera.direction(corner) * MAX_RANGE_M);
        for end in rays.into_iter().chain([Vector3::zeros()]) {
            let end = pose * Point3::from(end);
            low_m = low_m.inf(&end);
            high_m = high_m.sup(&end);
        }
    }
    let things = &house.regions.things;
    for axis in 0..3 {
        let low = things.iter().map(|thing| thing.low_m[axis]);
        let high = things.iter().map(|thing| thing.high_m[axis]);
        low_m[axis] = low_m[axis].max(low.fold(f64::INFINITY, f64::min)) - MARGIN_M;
        high_m[axis] = high_m[axis].min(high.fold(f64::NEG_INFINITY, f64::max)) + MARGIN_M;
    }
    (low_m, high_m)
}

/// True of a point in the camera's frame that is in the picture or near its edge.
fn near_picture(camera: &Camera, in_camera: &Point3<f64>) -> bool {
    let depth_m = in_camera.x;
    let up = camera.tan_half * camera.height as f64 / camera.width as f64;
    depth_m > 0.0
        && depth_m < MAX_RANGE_M
        && in_camera.y.abs() < camera.tan_half * depth_m + MARGIN_M
        && in_camera.z.abs() < up * depth_m + MARGIN_M
}

/// Casts the pixels on the headset's mesh; the labels are those of the image.
fn look(
    mesh: &MeshScene,
    pose: &Isometry3<f64>,
    camera: Camera,
    regions: &[u16],
    headset_from_house: &Isometry3<f64>,
) -> HouseScan {
    let origin_m = Point3::from(pose.translation.vector);
    let mut headset_scan = HouseScan {
        points_m: Vec::with_capacity(camera.pixels()),
        regions: Vec::with_capacity(camera.pixels()),
        sensor_m: headset_from_house * origin_m,
        headset_from_camera: headset_from_house * pose,
    };
    for (pixel, region) in regions.iter().enumerate() {
        let direction = (pose.rotation * camera.direction(pixel)).normalize();
        if let Some(hit) = mesh.cast(&origin_m, &direction, MAX_RANGE_M) {
            let point_m = origin_m + direction * hit.distance_m;
            headset_scan.points_m.push(headset_from_house * point_m);
            headset_scan.regions.push(*region);
        }
    }
    headset_scan
}
