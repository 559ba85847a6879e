//! Options of a [`super::HeadsetCloud`].

use lattice_core::pose::Axes;

use super::surfaces::MeshOptions;
use super::view::ViewOptions;
use crate::camera::ClassRules;
use crate::options::{frame, one_of};
use lattice_runtime::params::{ParamError, Params};

/// Largest settable queue of images per topic.
const MAX_QUEUE: usize = 1000;
/// Largest settable number of triangles.
const MAX_TRIANGLES: usize = 20_000_000;

/// Source of the classes of points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LabelsFrom {
    /// The pixels of label images.
    Image,
    /// The triangles of the mesh.
    Mesh,
}

/// Source of the camera poses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PoseSource {
    /// PoseStamped messages, in the axes of the headset.
    Topic,
    /// Transforms, always in the axes of ROS.
    Tf,
}

/// Options of a [`super::HeadsetCloud`].
#[derive(Clone, Debug, PartialEq)]
pub struct HeadsetOptions {
    /// Bounds of the mesh.
    pub mesh: MeshOptions,
    /// Axis convention of the camera's frame.
    pub camera_axes: Axes,
    /// Source of the camera poses.
    pub poses: PoseSource,
    /// Longest gap between two poses for interpolation, s.
    pub max_pose_gap_s: f64,
    /// Source of the classes.
    pub labels_from: LabelsFrom,
    /// Spacing of points sampled over the mesh, m.
    pub spacing_m: f64,
    /// Limit of points of a sampled cloud.
    pub max_points: usize,
    /// Label images queued for their pose; the oldest is dropped.
    pub queue_size: usize,
    /// True if labels wait for confidences of their stamp.
    pub use_confidence: bool,
    /// Limit of pixels per image; larger images are rejected.
    pub max_image_pixels: usize,
    /// True for rectified images: `p` of the camera is used, without distortion.
    pub rectified: bool,
    /// Selection of the pixels that become points.
    pub look: ViewOptions,
    /// Mapping of the classes.
    pub classes: ClassRules,
}

impl HeadsetOptions {
    /// Reads the parameters of the node.
    pub fn from_params(params: &Params) -> Result<Self, ParamError> {
        let axes = Axes::ALL.map(|axes| (axes.name(), axes));
        let headset_axes = one_of(params, "headset_axes", &axes)?;
        let poses = [("topic", PoseSource::Topic), ("tf", PoseSource::Tf)];
        let poses = one_of(params, "pose_source", &poses)?;
        let of_poses = match poses {
            PoseSource::Topic => headset_axes,
            PoseSource::Tf => Axes::RosFlu,
        };
        let labels = [("image", LabelsFrom::Image), ("mesh", LabelsFrom::Mesh)];
        let min_range_m = params.f64_in("min_range_m", 0.0, 0.0..=1e4)?;
        let max_range_m = params.f64_in("max_range_m", 10.0, 1e-3..=1e4)?;
        if min_range_m > max_range_m {
            let problem = format!("expected at most `max_range_m`, {max_range_m}");
            return Err(params.invalid("min_range_m", problem));
        }
        Ok(Self {
            mesh: MeshOptions {
                headset_frame: frame(params, "headset_frame", "headset_origin")?,
                axes: headset_axes,
                max_triangles: params.usize_in("max_triangles", 1_000_000, 1..=MAX_TRIANGLES)?,
                max_surfaces: params.usize_in("max_surfaces", 1000, 1..=1_000_000)?,
            },
            camera_axes: camera_axes(params, of_poses)?,
            poses,
            max_pose_gap_s: params.f64_in("max_pose_gap_s", 0.25, 0.0..=3600.0)?,
            labels_from: one_of(params, "labels_from", &labels)?,
            spacing_m: params.f64_in("spacing_m", 0.05, 1e-3..=10.0)?,
            max_points: params.usize_in("max_points", 100_000, 1..=10_000_000)?,
            queue_size: params.usize_in("queue_size", 5, 1..=MAX_QUEUE)?,
            use_confidence: params.bool("use_confidence", false)?,
            max_image_pixels: params.positive("max_image_pixels", 4_000_000)?,
            rectified: params.bool("rectified", false)?,
            look: ViewOptions {
                stride: params.positive("stride", 4)?,
                min_range_m,
                max_range_m,
                check_winding: params.bool("check_winding", true)?,
            },
            classes: ClassRules::from_params(params)?,
        })
    }

    /// Axis convention of the camera poses.
    pub fn pose_axes(&self) -> Axes {
        match self.poses {
            PoseSource::Topic => self.mesh.axes,
            PoseSource::Tf => Axes::RosFlu,
        }
    }
}

/// Axis convention of the camera. It must have the handedness of its poses, since no rotation changes it.
fn camera_axes(params: &Params, of_poses: Axes) -> Result<Axes, ParamError> {
    let usual = match of_poses {
        Axes::RosFlu => Axes::Optical,
        same => same,
    };
    let words = Axes::ALL.map(|axes| (axes.name(), axes));
    let auto = [("auto", usual)];
    let words: Vec<_> = auto.into_iter().chain(words).collect();
    let found = one_of(params, "camera_axes", &words)?;
    let handedness = |axes: Axes| axes.matrix().determinant();
    if handedness(found) * handedness(of_poses) < 0.0 {
        let problem = format!("{found} and {of_poses}, the axes of its poses, are mirrored");
        return Err(params.invalid("camera_axes", problem));
    }
    Ok(found)
}
