//! Messages of a house as the cameras and the headset in it send them.

use lattice_msgs::lattice::HeadsetMesh;
use lattice_msgs::sensor_msgs::Image;
use lattice_msgs::std_msgs::Header;
use lattice_msgs::vision_msgs::{LabelInfo, VisionClass};
use lattice_nodes::convert::geometry::pose_from;

use super::{HeadsetTrial, House, RoomImage};

impl House {
    /// Names of the classes.
    pub fn label_info(&self, header: Header) -> LabelInfo {
        let class = |(class, name): (&u16, &String)| VisionClass {
            class_id: *class,
            class_name: name.clone(),
        };
        LabelInfo {
            header,
            class_map: self.class_names().iter().map(class).collect(),
            threshold: 0.0,
        }
    }
}

impl HeadsetTrial {
    /// The headset's mesh in the axes of ROS, whole.
    pub fn mesh_message(&self, house: &House, header: Header, session: &str) -> HeadsetMesh {
        let headset_from_house = self.map_from_headset.inverse() * house.map_from_house();
        HeadsetMesh {
            header,
            session: session.to_owned(),
            surface: "room".to_owned(),
            removed: false,
            chunk: 0,
            chunks: 1,
            pose: pose_from(&headset_from_house),
            vertices: self.mesh.vertices_m().concat(),
            triangles: self.mesh.triangles().concat(),
            classes: Vec::new(),
        }
    }
}

impl RoomImage {
    /// The colours.
    pub fn colors_message(&self, header: Header) -> Image {
        self.message(header, "rgb8", self.rgb.clone())
    }

    /// The true classes.
    pub fn labels_message(&self, header: Header) -> Image {
        let data = self.labels.iter().flat_map(|label| label.to_le_bytes());
        self.message(header, "mono16", data.collect())
    }

    /// Distances along the optical axis of its pixels, as they were measured, m.
    pub fn depth_message(&self, header: Header, depth_m: &[f32]) -> Image {
        let data = depth_m.iter().flat_map(|depth_m| depth_m.to_le_bytes());
        self.message(header, "32FC1", data.collect())
    }

    fn message(&self, header: Header, encoding: &str, data: Vec<u8>) -> Image {
        Image {
            header,
            height: self.height as u32,
            width: self.width as u32,
            encoding: encoding.to_owned(),
            is_bigendian: 0,
            step: (data.len() / self.height.max(1)) as u32,
            data: data.into(),
        }
    }
}
