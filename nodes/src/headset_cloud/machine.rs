//! State machine of a headset, without I/O.

use std::sync::Arc;

use lattice_msgs::geometry_msgs::PoseStamped;
use lattice_msgs::sensor_msgs::{CameraInfo, Image, PointCloud2};
use lattice_msgs::tf2_msgs::TFMessage;
use lattice_msgs::vision_msgs::LabelInfo;
use nalgebra::Isometry3;

use super::counts::HeadsetCounts;
use super::options::{HeadsetOptions, LabelsFrom};
use super::poses::{PoseAt, Poses};
use super::session::Session;
use super::surfaces::Surfaces;
use super::view::{LabelledView, RaycastMesh, placed};
use super::waiting::{HeadsetStream, Waiting};
use crate::camera::{Camera, Classes, Content, ImageView, LabelSet};
use crate::convert::geometry::header;

/// Output of the state machine.
#[derive(Clone, Debug, PartialEq)]
pub enum HeadsetOutput {
    /// For `headset/points`: in the headset's frame, with the axes of ROS.
    Points(PointCloud2),
    /// For `headset/label_info`: names of the classes in `headset/points`.
    LabelInfo(LabelInfo),
    /// For `headset/session`: a session announced by a mesh.
    Session(String),
}

/// Stores the surfaces of a headset's mesh, and casts the pixels of its label images onto them.
///
/// Input is validated before it is queued, and headers do not determine allocations. The newest
/// `camera_info` applies to all images of any size with the same view.
pub struct HeadsetCloud {
    options: HeadsetOptions,
    pub(super) surfaces: Surfaces,
    /// Mesh for ray casting, built with its first image; inner `None`: the mesh is unusable.
    pub(super) raycast_mesh: Option<Option<RaycastMesh>>,
    /// Stamp of the newest mesh change without a cloud.
    pub(super) changed_ns: Option<i64>,
    pub(super) session: Session,
    /// Arrival time of the next input, ns of the node's clock.
    pub(super) now_ns: i64,
    pub(super) poses: Poses,
    waiting: Waiting,
    info: Option<Arc<CameraInfo>>,
    camera: Option<Camera>,
    /// Camera rays, built with its first image.
    rays: Vec<[f32; 2]>,
    label_info: Option<Arc<LabelInfo>>,
    classes: Classes,
    pub(super) counts: HeadsetCounts,
    problem: Option<String>,
}

impl HeadsetCloud {
    /// Initial state.
    pub fn new(options: HeadsetOptions) -> Self {
        Self {
            surfaces: Surfaces::new(options.mesh.clone()),
            raycast_mesh: None,
            changed_ns: None,
            session: Session::default(),
            now_ns: 0,
            poses: Poses::new(&options),
            waiting: Waiting::default(),
            info: None,
            camera: None,
            rays: Vec::new(),
            label_info: None,
            classes: Classes::new(&options.classes),
            counts: HeadsetCounts::default(),
            problem: None,
            options,
        }
    }

    /// Changes the options; class names are published again.
    pub fn set_options(&mut self, options: HeadsetOptions) -> Vec<HeadsetOutput> {
        self.surfaces.set_options(options.mesh.clone());
        self.classes.set_rules(&options.classes);
        self.options = options;
        self.camera = None;
        let mut out: Vec<_> = self.names().into_iter().collect();
        if let Some(info) = self.info.take() {
            out.extend(self.on_camera_info(info));
        }
        out
    }

    /// Sets the arrival time of the next input, ns of a steady clock.
    pub fn at(&mut self, now_ns: i64) {
        self.now_ns = now_ns;
    }

    /// Handles an image.
    pub fn on_image(&mut self, stream: HeadsetStream, image: Arc<Image>) -> Vec<HeadsetOutput> {
        let (count, content) = match stream {
            HeadsetStream::Labels => (&mut self.counts.labels_in, Content::Labels),
            HeadsetStream::Confidence => (&mut self.counts.confidence_in, Content::Confidence),
        };
        *count += 1;
        let max = self.options.max_image_pixels;
        let image = match stream {
            HeadsetStream::Labels => self.options.classes.numbered(image, max),
            _ => Ok(image),
        };
        let checked = image.and_then(|image| {
            ImageView::new(&image, content, max)?;
            Ok(image)
        });
        let image = match checked {
            Ok(image) => image,
            Err(error) => {
                self.refuse(stream.name(), error.name(), &error.to_string());
                return Vec::new();
            }
        };
        let left = self.waiting.push(stream, image, self.options.queue_size);
        self.left(stream, left);
        self.serve()
    }

    /// Handles labels of the built-in network, with companion images.
    pub fn on_labelled(&mut self, labels: LabelSet) -> Vec<HeadsetOutput> {
        self.counts.labels_in += 1;
        if labels.reader(1, self.options.max_image_pixels).is_none() {
            let problem = "the output of the network is larger than `max_image_pixels`";
            self.refuse("labels", "too_large", problem);
            return Vec::new();
        }
        let left = self.waiting.push_labels(labels, self.options.queue_size);
        self.left(HeadsetStream::Labels, left);
        self.serve()
    }

    /// Counts dropped images: a duplicate stamp, and the oldest ones.
    fn left(&mut self, stream: HeadsetStream, [repeated, oldest]: [u64; 2]) {
        let reason = self.missing(stream);
        self.counts.drop_some(stream.name(), "repeated", repeated);
        self.counts.drop_some(stream.name(), reason, oldest);
    }

    /// Handles the camera calibration. An invalid one removes the previous one.
    pub fn on_camera_info(&mut self, info: Arc<CameraInfo>) -> Vec<HeadsetOutput> {
        let (width, height) = (info.width, info.height);
        let pixels = u64::from(width) * u64::from(height);
        let found = Camera::new(&info, self.options.rectified);
        let max = self.options.max_image_pixels;
        let refused = match &found {
            Err(error) => Some((error.name(), error.to_string())),
            Ok(_) if pixels == 0 || pixels > max as u64 => {
                let problem =
                    format!("{width} x {height} pixels, outside 1 to `max_image_pixels` {max}");
                Some(("size", problem))
            }
            Ok(_) => None,
        };
        let camera = found.ok().filter(|_| refused.is_none());
        if let Some((reason, problem)) = refused {
            self.refuse("camera_info", reason, &problem);
        }
        if self.camera != camera {
            self.rays = Vec::new();
            self.camera = camera;
        }
        self.info = Some(info);
        self.serve()
    }

    /// Handles the class names.
    pub fn on_label_info(&mut self, info: Arc<LabelInfo>) -> Vec<HeadsetOutput> {
        self.classes.set_threshold(info.threshold);
        self.label_info = Some(info);
        self.names().into_iter().collect()
    }

    /// Handles a camera pose in the headset's frame.
    pub fn on_pose(&mut self, pose: &PoseStamped) -> Vec<HeadsetOutput> {
        self.counts.poses_in += 1;
        let frame = &self.options.mesh.headset_frame;
        match self.poses.on_pose(pose, frame) {
            Ok(()) => self.serve(),
            Err((reason, problem)) => {
                self.refuse("pose", reason, &problem);
                Vec::new()
            }
        }
    }

    /// Handles transforms.
    pub fn on_tf(&mut self, message: &TFMessage, is_static: bool) -> Vec<HeadsetOutput> {
        self.counts.poses_in += message.transforms.len() as u64;
        let refused = self.poses.on_tf(message, is_static);
        self.counts.drop_some("transform", "refused", refused);
        self.serve()
    }

    /// Samples the mesh itself into a cloud, if configured and changed.
    pub fn tick(&mut self) -> Vec<HeadsetOutput> {
        if self.options.labels_from == LabelsFrom::Image {
            return Vec::new();
        }
        let Some(stamp_ns) = self.changed_ns.take() else {
            return Vec::new();
        };
        self.build_raycast_mesh();
        let Some(Some(raycast_mesh)) = &self.raycast_mesh else {
            return Vec::new();
        };
        let (spacing_m, max_points) = (self.options.spacing_m, self.options.max_points);
        let counts = &mut self.counts.look;
        let points = raycast_mesh.sampled(spacing_m, max_points, &self.classes, counts);
        if points.is_empty() {
            return Vec::new();
        }
        self.counts.clouds_out += 1;
        let header = header(&self.options.mesh.headset_frame, stamp_ns);
        vec![HeadsetOutput::Points(points.cloud(header))]
    }

    /// Ends the input: queued images are counted.
    pub fn finish(&mut self) -> Vec<HeadsetOutput> {
        let outputs = self.tick();
        self.drop_waiting(None);
        outputs
    }

    /// Counters of messages, surfaces, pixels and points, by reason.
    pub fn counts(&self) -> &HeadsetCounts {
        &self.counts
    }

    /// Number of queued images and of incomplete surfaces.
    pub fn waiting(&self) -> [usize; 2] {
        [self.waiting.len(), self.surfaces.waiting()]
    }

    /// Number of surfaces and of triangles.
    pub fn mesh_size(&self) -> [usize; 2] {
        [self.surfaces.len(), self.surfaces.triangles()]
    }

    /// True with a valid camera calibration.
    pub fn has_camera(&self) -> bool {
        self.camera.is_some()
    }

    /// Text of the last rejection.
    pub fn problem(&self) -> Option<&str> {
        self.problem.as_deref()
    }

    /// Clouds of all images whose pose is available.
    pub(super) fn serve(&mut self) -> Vec<HeadsetOutput> {
        let mut outputs = Vec::new();
        if self.camera.is_none() || self.surfaces.len() == 0 {
            return outputs;
        }
        for (stamp_ns, frame) in self.waiting.ready(self.options.use_confidence) {
            let origin = &self.options.mesh.headset_frame;
            let pose = match self.poses.at(origin, &frame, stamp_ns) {
                PoseAt::Later => continue,
                PoseAt::Known(pose) => Some(pose),
                PoseAt::Never => None,
            };
            let Some(set) = self.waiting.take(stamp_ns) else {
                continue;
            };
            match pose {
                Some(pose) => outputs.extend(self.cloud(&set, &pose).map(HeadsetOutput::Points)),
                None => {
                    let problem = "there is no pose at its stamp, only before and after it";
                    self.refuse("labels", "no_pose", problem);
                }
            }
        }
        outputs
    }

    fn cloud(&mut self, set: &LabelSet, pose: &Isometry3<f64>) -> Option<PointCloud2> {
        self.build_raycast_mesh();
        let camera = self.camera.as_ref()?;
        let Some(Some(raycast_mesh)) = &self.raycast_mesh else {
            self.counts.drop_some("labels", "no_mesh", 1);
            return None;
        };
        if self.rays.is_empty() {
            self.rays = camera.rays();
        }
        let width = camera.width as usize;
        let Some(pixels) = set.reader(width, self.options.max_image_pixels) else {
            // The limit may have been reduced since they arrived.
            self.refuse("labels", "too_large", "larger than `max_image_pixels`");
            return None;
        };
        let mut view = LabelledView {
            pixels,
            rays: &self.rays,
            width,
            camera: placed(pose, self.options.pose_axes(), self.options.camera_axes),
        };
        let counts = &mut self.counts.look;
        match raycast_mesh.see(&mut view, &self.options.look, &self.classes, counts) {
            Ok(points) if points.is_empty() => {
                let problem = "none of its rays meets the mesh";
                self.refuse("labels", "sees_no_mesh", problem);
                None
            }
            Ok(points) => {
                self.counts.clouds_out += 1;
                let lost = set.soft.is_some() && !points.has_probabilities();
                self.counts.clouds_without_probs += u64::from(lost);
                let stamp_ns = set.labels.header.stamp.to_ns();
                let header = header(&self.options.mesh.headset_frame, stamp_ns);
                Some(points.cloud(header))
            }
            Err([behind, hits]) => {
                let problem = format!(
                    "the mesh is inside out: {behind} of {hits} rays hit it from behind; check `headset_axes`, \
                     or reverse its triangles"
                );
                self.refuse("labels", "mesh_inside_out", &problem);
                None
            }
        }
    }

    /// Rebuilds the ray casting index after a change.
    fn build_raycast_mesh(&mut self) {
        if self.raycast_mesh.is_some() {
            return;
        }
        let raycast_mesh = self.surfaces.merged().and_then(RaycastMesh::new);
        if let Err(error) = &raycast_mesh {
            self.refuse("mesh", error.name(), &error.to_string());
        }
        self.raycast_mesh = Some(raycast_mesh.ok());
    }

    /// Names of the classes that points may have.
    fn names(&self) -> Option<HeadsetOutput> {
        let info = self.options.classes.names(self.label_info.as_deref()?);
        Some(HeadsetOutput::LabelInfo(info))
    }

    /// Reason why images are queued.
    fn missing(&self, stream: HeadsetStream) -> &'static str {
        match stream {
            HeadsetStream::Confidence => "no_labels",
            HeadsetStream::Labels if self.camera.is_none() => "no_camera_info",
            HeadsetStream::Labels if self.surfaces.len() == 0 => "no_mesh",
            HeadsetStream::Labels => "no_pose",
        }
    }

    pub(super) fn drop_waiting(&mut self, reason: Option<&'static str>) {
        let streams = [HeadsetStream::Labels, HeadsetStream::Confidence];
        let reasons = streams.map(|stream| reason.unwrap_or_else(|| self.missing(stream)));
        let numbers = self.waiting.clear();
        for ((stream, reason), number) in streams.into_iter().zip(reasons).zip(numbers) {
            self.counts.drop_some(stream.name(), reason, number);
        }
    }

    pub(super) fn refuse(&mut self, topic: &str, reason: &str, problem: &str) {
        self.counts.drop_some(topic, reason, 1);
        self.problem = Some(format!("{topic}: {problem}"));
        log::debug!("{topic} refused: {problem}");
    }
}
