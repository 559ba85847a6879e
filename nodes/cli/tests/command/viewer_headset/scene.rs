//! A headset before a desk of a simulated house, as the messages that it sends.

use std::fs::File;
use std::path::Path;

use lattice_core::lattice::{Lattice, LatticeKind};
use lattice_core::voxels::file::write_map;
use lattice_lab::simulate::house::{
    HeadsetTrial, House, HouseScan, RegionLabels, RoomCamera, RoomImage, RoomImages, Scene, Survey,
    SurveyOptions,
};
use lattice_msgs::geometry_msgs::{Pose, PoseStamped, Transform};
use lattice_msgs::{RosMessage, cdr, std_msgs};
use lattice_nodes::convert::geometry::{header, isometry_from_transform, pose_from};
use nalgebra::{Isometry3, Vector3};
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
    pose: Pose,
    image: RoomImage,
}

/// The headset's camera, with the pixels of its pictures.
fn camera() -> RoomCamera {
    let [width, height] = HouseScan::PIXELS;
    RoomCamera::HEADSET.sized(width, height)
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
        let headset_from_camera = trial.headset_scans[0].headset_from_camera;
        let house_from_headset = house.map_from_house().inverse() * trial.map_from_headset;
        let house_from_camera = house_from_headset * headset_from_camera;
        let rooms = RoomImages::new(&house, 1);
        let session = "this morning";
        let mesh = trial.mesh_message(&house, header(FRAME, SECOND_NS), session);
        let names = house.label_info(header("camera", SECOND_NS));
        let data = session.to_owned();
        Self {
            map_from_headset: trial.map_from_headset,
            first: vec![
                told("/headset/session", &std_msgs::String { data }),
                told("/headset/labels/label_info", &names),
                told("/headset/mesh", &mesh),
            ],
            pose: pose_from(&(headset_from_camera * RoomCamera::camera_from_optical())),
            image: rooms.take(&camera(), &house_from_camera, 1),
        }
    }

    /// One look: camera, poses and labels of a time.
    pub fn look(&self, stamp_ns: i64) -> Vec<Told> {
        let pose = PoseStamped {
            header: header(FRAME, stamp_ns),
            pose: self.pose,
        };
        let labels = self.image.labels_message(header("camera", stamp_ns));
        vec![
            told(
                "/headset/camera_info",
                &camera().camera_info("camera", stamp_ns),
            ),
            told("/headset/pose", &pose),
            told("/headset/labels/image", &labels),
        ]
    }

    /// Distance (m) and angle (degrees) of an answer from the truth.
    pub fn off(&self, found: &Transform) -> [f64; 2] {
        let found = isometry_from_transform(found).unwrap();
        let error = self.map_from_headset.inverse() * found;
        [
            error.translation.vector.norm(),
            error.rotation.angle().to_degrees(),
        ]
    }
}
