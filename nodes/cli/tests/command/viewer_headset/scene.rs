//! A headset before a desk of a simulated house, as the messages that it sends.

use std::fs::File;
use std::path::Path;

use lattice_core::lattice::{Lattice, LatticeKind};
use lattice_core::registration::UNLABELED;
use lattice_core::voxels::file::write_map;
use lattice_lab::simulate::house::{
    HeadsetTrial, House, HouseScan, RegionLabels, Scene, Survey, SurveyOptions,
};
use lattice_msgs::geometry_msgs::{Pose, PoseStamped, Transform};
use lattice_msgs::headset::HeadsetMesh;
use lattice_msgs::sensor_msgs::{CameraInfo, Image};
use lattice_msgs::vision_msgs::{LabelInfo, VisionClass};
use lattice_msgs::{RosMessage, cdr, std_msgs};
use lattice_nodes::convert::geometry::header;
use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion, Vector3};
use serde_bytes::ByteBuf;
use serde_json::Value;

pub const FRAME: &str = "headset_origin";
pub const SECOND_NS: i64 = 1_000_000_000;

/// A message for a topic, as CDR and as JSON.
pub struct Told {
    pub topic: &'static str,
    pub type_name: &'static str,
    pub schema: String,
    pub cdr: Vec<u8>,
    pub json: Value,
}

pub fn told<M: RosMessage>(topic: &'static str, message: &M) -> Told {
    Told {
        topic,
        type_name: M::TYPE,
        schema: M::definition(),
        cdr: cdr::to_vec(message).unwrap(),
        json: serde_json::to_value(message).unwrap(),
    }
}

/// A headset before a desk of a simulated house, whose map is in the folder.
pub struct Headset {
    pub map_from_headset: Isometry3<f64>,
    /// Sent once.
    pub first: Vec<Told>,
    pub pose: Pose,
    pub labels: Vec<u16>,
}

pub fn pose(at: &Isometry3<f64>) -> Pose {
    let mut pose = Pose::default();
    [pose.position.x, pose.position.y, pose.position.z] = at.translation.vector.into();
    let turn = &mut pose.orientation;
    [turn.x, turn.y, turn.z, turn.w] = at.rotation.coords.into();
    pose
}

/// The optical frame in that of a camera that looks along x.
pub fn camera_from_optical() -> Isometry3<f64> {
    let turn = UnitQuaternion::from_quaternion(Quaternion::new(0.5, -0.5, 0.5, -0.5));
    assert!((turn * Vector3::z() - Vector3::x()).norm() < 1e-12);
    Isometry3::from_parts(Translation3::identity(), turn)
}

/// True classes of the pixels of the headset's camera.
pub fn labels(house: &House, house_from_camera: &Isometry3<f64>) -> Vec<u16> {
    let truth = RegionLabels::truth(house);
    let [width, height] = HouseScan::PIXELS;
    let middle = |size: usize| (size as f64 - 1.0) / 2.0;
    let pixel = |i: usize| {
        let y = (middle(width) - (i % width) as f64) / HouseScan::focal_px();
        let z = (middle(height) - (i / width) as f64) / HouseScan::focal_px();
        let way = house_from_camera.rotation * Vector3::new(1.0, y, z);
        let origin = Point3::from(house_from_camera.translation.vector);
        let hit = house.cast(&origin, &way, 20.0);
        hit.map_or(UNLABELED, |hit| truth.class(hit.region))
    };
    (0..width * height).map(pixel).collect()
}

impl Headset {
    pub fn new(folder: &Path) -> Self {
        let house = House::generated(3).unwrap();
        let place = Isometry3::new(Vector3::new(4.0, -7.0, 0.5), Vector3::z() * 0.7);
        let house = house.placed(place);
        let options = SurveyOptions {
            views: 200,
            ..SurveyOptions::default()
        };
        let survey = Survey::new(&house, &options, 1).unwrap();
        let lattice = Lattice::new(LatticeKind::Cubic, 0.000125).unwrap();
        let truth = RegionLabels::truth(&house);
        let list = survey.voxels(&lattice, &truth).unwrap();
        write_map(&list, File::create(folder.join("house.lattice")).unwrap()).unwrap();
        let trial = HeadsetTrial::new(&house, Scene::Desk, 1, 1).unwrap();
        let headset_from_house = trial.map_from_headset.inverse() * house.map_from_house();
        let camera = trial.headset_scans[0].headset_from_camera;
        let mesh = HeadsetMesh {
            header: header(FRAME, SECOND_NS),
            session: "this morning".to_owned(),
            surface: "room".to_owned(),
            chunks: 1,
            pose: pose(&headset_from_house),
            vertices: trial.mesh.vertices_m().concat(),
            triangles: trial.mesh.triangles().concat(),
            ..HeadsetMesh::default()
        };
        let class = |(class, name): (&u16, &String)| VisionClass {
            class_id: *class,
            class_name: name.clone(),
        };
        let names = LabelInfo {
            header: header("camera", SECOND_NS),
            class_map: house.class_names().iter().map(class).collect(),
            threshold: 0.0,
        };
        let data = "this morning".to_owned();
        Self {
            map_from_headset: trial.map_from_headset,
            first: vec![
                told("/headset/session", &std_msgs::String { data }),
                told("/headset/labels/label_info", &names),
                told("/headset/mesh", &mesh),
            ],
            pose: pose(&(camera * camera_from_optical())),
            labels: labels(&house, &(headset_from_house.inverse() * camera)),
        }
    }

    /// One look: camera, poses and labels of a time.
    pub fn look(&self, stamp_ns: i64) -> Vec<Told> {
        let [width, height] = HouseScan::PIXELS;
        let f = HouseScan::focal_px();
        let middle = |size: usize| (size as f64 - 1.0) / 2.0;
        let camera = CameraInfo {
            header: header("camera", stamp_ns),
            width: width as u32,
            height: height as u32,
            distortion_model: "plumb_bob".to_owned(),
            d: vec![0.0; 5],
            k: [f, 0.0, middle(width), 0.0, f, middle(height), 0.0, 0.0, 1.0],
            ..CameraInfo::default()
        };
        let pose = PoseStamped {
            header: header(FRAME, stamp_ns),
            pose: self.pose,
        };
        let data: Vec<u8> = self.labels.iter().flat_map(|l| l.to_le_bytes()).collect();
        let image = Image {
            header: header("camera", stamp_ns),
            width: width as u32,
            height: height as u32,
            encoding: "mono16".to_owned(),
            is_bigendian: 0,
            step: 2 * width as u32,
            data: ByteBuf::from(data),
        };
        vec![
            told("/headset/camera_info", &camera),
            told("/headset/pose", &pose),
            told("/headset/labels/image", &image),
        ]
    }

    /// Distance (m) and angle (degrees) of an answer from the truth.
    pub fn off(&self, found: &Transform) -> [f64; 2] {
        let at = [
            found.translation.x,
            found.translation.y,
            found.translation.z,
        ];
        let turn = found.rotation;
        let turn = Quaternion::new(turn.w, turn.x, turn.y, turn.z);
        let turn = UnitQuaternion::from_quaternion(turn);
        let found = Isometry3::from_parts(Translation3::from(at), turn);
        let error = self.map_from_headset.inverse() * found;
        [
            error.translation.vector.norm(),
            error.rotation.angle().to_degrees(),
        ]
    }
}
