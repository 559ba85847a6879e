//! Parameters of the node.

use super::{HeadsetOptions, LabelsFrom};
use crate::compute::ComputeLimits;
use crate::segmenter::{NETWORK, NetworkSettings, SegmenterOptions};
use crate::{options, report};
use lattice_runtime::about;
use lattice_runtime::params::{About, ParamError, Params};

const ABOUT: &[About] = about! {
    "headset_frame" fixed(options::FRAME): "Required frame of meshes and poses, and frame of the clouds: the origin of the headset.";
    "headset_axes" fixed(options::FRAME): "Axis convention of the headset's meshes and poses: ros_flu (forward, left, up), unity_ruf (right, up, forward; left-handed), winrt_rub (right, up, backward) or optical (right, down, forward). Clouds use the axes of ROS.";
    "camera_axes" fixed(options::FRAME): "Axis convention of the camera's own frame: as headset_axes, or auto: the same, and optical if poses use the axes of ROS.";
    "pose_source" fixed(options::TOPIC): "Source of camera poses: topic (headset/pose) or tf (transforms from headset_frame to the frame of the images).";
    "max_pose_gap_s" fixed("poses are kept with it"): "Longest gap between two poses for interpolation.";
    "mesh_file" fixed("it is read at the start"): "Initial mesh in headset_frame and headset_axes, PLY, OBJ or glTF (.glb, .gltf; its axes are converted); empty: none.";
    "labels_from" fixed(options::TOPIC): "Source of classes: image (points are the hits of label image pixels) or mesh (points sampled over the mesh have the classes of its triangles).";
    "spacing_m": "Spacing of points sampled over the mesh.";
    "max_points": "Limit of points of a sampled cloud; larger meshes are sampled with a larger spacing.";
    "max_triangles": "Limit of triangles of the whole mesh; further surfaces are rejected.";
    "max_surfaces": "Limit of surfaces; further ones are rejected.";
    "queue_size": "Label images queued for pose, mesh and confidence; the oldest is dropped and counted.";
    "use_confidence" fixed(options::TOPIC): "Whether labels wait for headset/labels/confidence of their stamp.";
    "max_range_m": "Points farther from the sensor are rejected.";
    "check_winding": "Whether images that see most of the mesh from behind are rejected: it is mirrored, or its triangles are reversed.";
    "threads" fixed("the pool is made with it"): "Threads of the network; 0: one less than the number of cores.";
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
            limits: options::compute_limits(params, 4096, 128 << 20, 1)?,
            report_file: report::file(params)?,
        })
    }
}

/// Declares all parameters of the node, as at its start.
pub fn declare(params: &Params) -> Result<(), ParamError> {
    Settings::from_params(params).map(drop)
}
