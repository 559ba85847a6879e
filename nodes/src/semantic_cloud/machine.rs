//! State machine of a depth camera, without I/O.

use std::sync::Arc;

use lattice_core::registration::UNLABELED;
use lattice_msgs::sensor_msgs::{CameraInfo, CompressedImage, Image, PointCloud2};
use lattice_msgs::vision_msgs::LabelInfo;

use super::compressed;
use super::counts::CloudCounts;
use super::options::{CloudOptions, LabelSource};
use super::project::Views;
use super::waiting::{Left, Set, Stream, Waiting};
use crate::camera::{Camera, Classes, Content, ImageView, LabelSet};
use crate::segmenter;

/// Output of the state machine.
#[derive(Clone, Debug, PartialEq)]
pub enum CloudOutput {
    /// Cloud for `points`, with frame and stamp of the depth image.
    Points(PointCloud2),
    /// Class names of `points`, for `label_info`.
    LabelInfo(LabelInfo),
}

/// Combines each depth image with the label image of its time into a labelled cloud.
///
/// Images are validated before they are queued, and headers do not determine allocations. The newest
/// `camera_info` applies to all images that match it.
pub struct SemanticCloud {
    options: CloudOptions,
    waiting: Waiting,
    info: Option<Arc<CameraInfo>>,
    camera: Option<Camera>,
    /// Camera rays, built with its first image.
    rays: Vec<[f32; 2]>,
    label_info: Option<Arc<LabelInfo>>,
    /// True if label images may come.
    has_label_source: bool,
    classes: Classes,
    counts: CloudCounts,
    problem: Option<String>,
}

impl SemanticCloud {
    /// Initial state.
    pub fn new(options: CloudOptions) -> Self {
        Self {
            waiting: Waiting::new(options.pair.clone()),
            classes: Classes::new(&options.classes),
            options,
            info: None,
            camera: None,
            rays: Vec::new(),
            label_info: None,
            has_label_source: true,
            counts: CloudCounts::default(),
            problem: None,
        }
    }

    /// Changes the options; class names are published again.
    pub fn set_options(&mut self, options: CloudOptions) -> Vec<CloudOutput> {
        self.waiting.set_options(options.pair.clone());
        self.classes.set_rules(&options.classes);
        self.options = options;
        if let Some(info) = self.info.take() {
            self.on_camera_info(info);
        }
        self.names().into_iter().collect()
    }

    /// Notes whether label images may come; initially they may.
    pub fn set_label_source(&mut self, has_label_source: bool) {
        self.has_label_source = has_label_source;
    }

    /// True if clouds are made without labels.
    pub fn is_unlabelled(&self) -> bool {
        match self.options.labels {
            LabelSource::Auto => !self.has_label_source && self.counts.labels_in == 0,
            LabelSource::Image => false,
            LabelSource::None => true,
        }
    }

    /// Handles an image.
    pub fn on_image(&mut self, stream: Stream, image: Arc<Image>) -> Vec<CloudOutput> {
        let (count, content) = match stream {
            Stream::Depth => (&mut self.counts.depth_in, Content::Depth),
            Stream::Labels => (&mut self.counts.labels_in, Content::Labels),
            Stream::Confidence => (&mut self.counts.confidence_in, Content::Confidence),
            Stream::Color => (&mut self.counts.color_in, Content::Colors),
        };
        *count += 1;
        let max = self.options.max_image_pixels;
        let image = match stream {
            Stream::Labels => self.options.classes.numbered(image, max),
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
        let unknown = (stream == Stream::Depth && self.is_unlabelled()).then(|| no_class(&image));
        let mut dropped = self.waiting.push(stream, image);
        if let Some(unknown) = unknown {
            dropped.extend(self.waiting.push(Stream::Labels, unknown));
        }
        for (stream, reason) in dropped {
            self.drop_image(stream, reason);
        }
        self.serve(false)
    }

    /// Handles a depth image of compressed_depth_image_transport.
    pub fn on_compressed_depth(&mut self, message: &CompressedImage) -> Vec<CloudOutput> {
        match compressed::depth_image(message, self.options.max_image_pixels) {
            Ok(image) => self.on_image(Stream::Depth, Arc::new(image)),
            Err(error) => {
                self.counts.depth_in += 1;
                self.refuse("depth", error.name(), &error.to_string());
                Vec::new()
            }
        }
    }

    /// Handles a JPEG colour image.
    pub fn on_compressed_color(&mut self, message: &CompressedImage) -> Vec<CloudOutput> {
        match segmenter::unpacked(message, self.options.max_image_pixels) {
            Ok(image) => self.on_image(Stream::Color, Arc::new(image)),
            Err((reason, problem)) => {
                self.counts.color_in += 1;
                self.refuse("color", reason, &problem);
                Vec::new()
            }
        }
    }

    /// Notes that a network has begun an image: the depth image of its stamp is kept until the labels arrive.
    pub fn on_begun(&mut self, stamp_ns: i64) -> Vec<CloudOutput> {
        for (stream, reason) in self.waiting.hold(stamp_ns) {
            self.drop_image(stream, reason);
        }
        self.serve(false)
    }

    /// Handles labels of the built-in network, with companion images.
    pub fn on_labelled(&mut self, labels: LabelSet) -> Vec<CloudOutput> {
        self.counts.labels_in += 1;
        if labels.reader(1, self.options.max_image_pixels).is_none() {
            let problem = "the output of the network is larger than `max_image_pixels`";
            self.refuse(Stream::Labels.name(), "too_large", problem);
            return Vec::new();
        }
        for (stream, reason) in self.waiting.push_labels(labels) {
            self.drop_image(stream, reason);
        }
        self.serve(false)
    }

    /// Handles the camera calibration. An invalid one removes the previous one.
    pub fn on_camera_info(&mut self, info: Arc<CameraInfo>) -> Vec<CloudOutput> {
        let is_known = self.info.as_ref().is_some_and(|old| {
            let header = info.header.clone();
            *info
                == CameraInfo {
                    header,
                    ..CameraInfo::clone(old)
                }
        });
        if is_known && self.camera.is_some() {
            return Vec::new();
        }
        match Camera::new(&info, self.options.rectified) {
            Ok(camera) => {
                if camera.is_distorted() && !is_known {
                    let model = &info.distortion_model;
                    log::info!("pixels are undistorted ({model}); set `rectified` if images are");
                }
                if self.camera.as_ref() != Some(&camera) {
                    self.rays = Vec::new();
                }
                self.camera = Some(camera);
            }
            Err(error) => {
                self.camera = None;
                self.rays = Vec::new();
                self.refuse("camera_info", error.name(), &error.to_string());
            }
        }
        self.info = Some(info);
        self.serve(false)
    }

    /// Handles the class names.
    pub fn on_label_info(&mut self, info: Arc<LabelInfo>) -> Vec<CloudOutput> {
        self.classes.set_threshold(info.threshold);
        self.label_info = Some(info);
        self.names().into_iter().collect()
    }

    /// Ends the input: matching images are processed, the rest is counted.
    pub fn finish(&mut self) -> Vec<CloudOutput> {
        let outputs = self.serve(true);
        for (stream, reason) in self.waiting.clear(Left::NoPartner) {
            self.drop_image(stream, reason);
        }
        outputs
    }

    /// Counters of images, pixels and points, by reason.
    pub fn counts(&self) -> &CloudCounts {
        &self.counts
    }

    /// Number of queued images.
    pub fn waiting(&self) -> usize {
        self.waiting.len()
    }

    /// True with a valid camera calibration.
    pub fn has_camera(&self) -> bool {
        self.camera.is_some()
    }

    /// Text of the last rejection.
    pub fn problem(&self) -> Option<&str> {
        self.problem.as_deref()
    }

    /// Clouds of all images with a match.
    fn serve(&mut self, is_end: bool) -> Vec<CloudOutput> {
        let mut outputs = Vec::new();
        while self.camera.is_some()
            && let Some(set) = self.waiting.take(is_end)
        {
            outputs.extend(self.cloud(&set).map(CloudOutput::Points));
        }
        outputs
    }

    fn cloud(&mut self, set: &Set) -> Option<PointCloud2> {
        let camera = self.camera.as_ref()?;
        let max = self.options.max_image_pixels;
        let depth = match ImageView::new(&set.depth, Content::Depth, max) {
            Ok(depth) => depth,
            Err(error) => {
                self.refuse("depth", error.name(), &error.to_string());
                return None;
            }
        };
        let (width, height) = (camera.width, camera.height);
        if (depth.width, depth.height) != (width as usize, height as usize) {
            let problem = format!(
                "{} x {} pixels, but camera_info is of {width} x {height}",
                depth.width, depth.height
            );
            self.refuse("depth", "size", &problem);
            return None;
        }
        if self.rays.is_empty() {
            self.rays = camera.rays();
        }
        let Some(pixels) = set.labels.reader(depth.width, max) else {
            // The limit may have been reduced since they arrived.
            let problem = "larger than `max_image_pixels`";
            self.refuse(Stream::Labels.name(), "too_large", problem);
            return None;
        };
        let mut views = Views {
            pixels,
            depth,
            rays: &self.rays,
        };
        let points = views.points(&self.options.points, &self.classes, &mut self.counts.points);
        self.counts.clouds_out += 1;
        let lost = set.labels.soft.is_some() && !points.has_probabilities();
        self.counts.clouds_without_probs += u64::from(lost);
        Some(points.cloud(set.depth.header.clone()))
    }

    /// Names of the classes that points may have.
    fn names(&self) -> Option<CloudOutput> {
        let info = self.options.classes.names(self.label_info.as_deref()?);
        Some(CloudOutput::LabelInfo(info))
    }

    fn drop_image(&mut self, stream: Stream, reason: Left) {
        if stream == Stream::Labels && self.is_unlabelled() {
            return;
        }
        let reason = match reason {
            Left::NoPartner if self.camera.is_none() => "no_camera_info",
            Left::NoPartner => "no_partner",
            Left::Repeated => "repeated",
            Left::TimeJump => "time_jump",
        };
        self.counts.drop_one(stream.name(), reason);
        if (stream, reason) == (Stream::Depth, "no_partner") && self.counts.clouds_out == 0 {
            let difference_s = self.options.pair.max_difference_ns as f64 * 1e-9;
            self.problem = Some(format!(
                "depth: no label image within {difference_s} s of its stamp (`max_stamp_difference_s`, `queue_size`); \
                 `labels: none` makes clouds without labels"
            ));
        }
    }

    fn refuse(&mut self, topic: &str, reason: &str, problem: &str) {
        self.counts.drop_one(topic, reason);
        self.problem = Some(format!("{topic}: {problem}"));
        log::debug!("{topic} rejected: {problem}");
    }
}

/// A label image of one pixel without a class, for a depth image.
fn no_class(depth: &Image) -> Arc<Image> {
    Arc::new(Image {
        header: depth.header.clone(),
        width: 1,
        height: 1,
        encoding: "mono16".into(),
        is_bigendian: 0,
        step: 2,
        data: UNLABELED.to_le_bytes().to_vec().into(),
    })
}
