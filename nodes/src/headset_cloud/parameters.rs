//! Parameters of the node.

use super::{HeadsetOptions, LabelsFrom};
use crate::compute::ComputeLimits;
use crate::segmenter::{NETWORK, NetworkSettings, SegmenterOptions};
use crate::{options, report};
use lattice_runtime::about;
use lattice_runtime::params::{About, ParamError, Params};

const ABOUT: &[About] = about! {
    "headset_frame" fixed(options::FRAME): "Frame that meshes and poses must be in, and of the clouds: the origin of the headset.";
    "headset_axes" fixed(options::FRAME): "Axes of the headset's meshes and poses: ros_flu (forward, left, up), unity_ruf (right, up, forward; left-handed), winrt_rub (right, up, backward) or optical (right, down, forward). Clouds are in those of ROS.";
    "camera_axes" fixed(options::FRAME): "Axes of the camera's own frame: as headset_axes, or auto: the same, and optical where poses are in those of ROS.";
    "pose_source" fixed(options::TOPIC): "Where the pose of the camera is taken from: topic (headset/pose) or tf (transforms from headset_frame to the frame of the images).";
    "max_pose_gap_s" fixed("poses are kept with it"): "Longest time between two poses that is interpolated over.";
    "mesh_file" fixed("it is read at the start"): "Mesh in headset_frame and headset_axes that is there from the start, PLY, OBJ or glTF (.glb, .gltf), whose axes become those; empty: none.";
    "labels_from" fixed(options::TOPIC): "Where classes are taken from: image (points are what the pixels of label images see) or mesh (points all over the mesh have the classes of its triangles).";
    "spacing_m": "Distance of points that are taken all over the mesh.";
    "max_points": "Most points of such a cloud; those of a larger mesh are farther apart.";
    "max_triangles": "Surfaces with which the mesh had more triangles are refused.";
    "max_surfaces": "Surfaces beyond so many are refused.";
    "queue_size": "Label images that wait for pose, mesh and confidence; the oldest goes and is counted.";
    "use_confidence" fixed(options::TOPIC): "Whether labels wait for headset/labels/confidence of their stamp.";
    "rectified": "Whether the images are rectified: then p of camera_info holds, otherwise k and the distortion.";
    "max_image_pixels": "Images of more pixels are refused.";
    "stride": "Only every so many rows and columns become points.";
    "min_range_m": "Points nearer to the sensor are left out.";
    "max_range_m": "Points farther from the sensor are left out.";
    "check_winding": "Whether images are refused that see most of the mesh from behind: it is mirrored, or its triangles go the wrong way round.";
    "threads" fixed("the pool is made with it"): "Threads of the network; 0: one less than the machine has.";
    "group_labels": "Classes that count as others: class, group, class, group and so on.";
};

/// Settings from the parameters of the node.
pub(super) struct Settings {
    pub headset: HeadsetOptions,
    /// Built-in network with its options.
    pub network: Option<(NetworkSettings, SegmenterOptions)>,
    pub compressed_color: bool,
    pub mesh_file: String,
    pub limits: ComputeLimits,
    pub report_file: String,
}

impl Settings {
    /// Reads the parameters of the node.
    pub(super) fn from_params(params: &Params) -> Result<Self, ParamError> {
        params.describe(ABOUT);
        params.describe(NETWORK);
        params.describe(options::COMMON);
        let mut headset = HeadsetOptions::from_params(params)?;
        let with_soft = params.bool("label_probs", true)?;
        let max = headset.max_image_pixels;
        let of_network = SegmenterOptions::of_network(params, max, with_soft)?;
        let network = NetworkSettings::from_params(params)?;
        if network.is_some() {
            if headset.labels_from == LabelsFrom::Mesh {
                let problem = "`labels_from: mesh` does not use label images";
                return Err(params.invalid("model", problem));
            }
            // They are delivered with the labels.
            headset.use_confidence = false;
        }
        Ok(Self {
            headset,
            network: network.map(|network| (network, of_network)),
            compressed_color: params.bool("compressed_color", false)?,
            mesh_file: params.string("mesh_file", "")?,
            limits: ComputeLimits {
                events: options::inbox_events(params, 4096)?,
                bytes: options::inbox_bytes(params, 128 << 20)?,
                threads: 1,
            },
            report_file: report::file(params)?,
        })
    }
}

/// Declares all parameters of the node, as at its start.
pub fn declare(params: &Params) -> Result<(), ParamError> {
    Settings::from_params(params).map(drop)
}
