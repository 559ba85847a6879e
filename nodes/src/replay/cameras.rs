//! Depth cameras of a log: topics of depth images, with their calibrations, labels and colours.

use lattice_bag::BagReader;
use lattice_msgs::RosMessage;
use lattice_msgs::sensor_msgs::{CameraInfo, CompressedImage, Image};
use lattice_msgs::vision_msgs::LabelInfo;
use lattice_runtime::params::{ParamError, Params};

use super::camera_input::CameraInput;
use super::images::{self, Calibration, ImageTopic};
use super::survey;
use super::topics::{Role, TopicError};
use crate::semantic_cloud::{LabelSource, Settings};

/// Streams of a depth camera to use.
#[derive(Clone, Debug, Default)]
pub struct CameraWishes {
    /// True to leave label images out.
    pub no_labels: bool,
    /// True if depth images without labels are no clouds.
    pub needs_labels: bool,
    /// True if labels have confidences.
    pub with_confidence: bool,
    /// True for colours, of points or for a network.
    pub with_color: bool,
    /// True if label images may be masks of colours.
    pub has_palette: bool,
}

impl CameraWishes {
    /// Reads the parameters of `semantic_cloud`.
    pub fn from_params(params: &Params) -> Result<Self, ParamError> {
        let Settings { cloud, network, .. } = Settings::from_params(params)?;
        let has_network = network.is_some();
        Ok(Self {
            no_labels: has_network || cloud.labels == LabelSource::None,
            needs_labels: !has_network && cloud.labels == LabelSource::Image,
            with_confidence: cloud.pair.with_confidence,
            with_color: has_network || cloud.pair.with_color,
            has_palette: !cloud.classes.palette.is_empty(),
        })
    }
}

/// Topics of a depth camera, by their indices in the log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DepthCamera {
    /// Depth images.
    pub depth: usize,
    /// Inputs by topic; the first is that of the depth images.
    pub inputs: Vec<(usize, CameraInput)>,
}

impl DepthCamera {
    /// Topic of an input.
    pub fn topic(&self, input: CameraInput) -> Option<usize> {
        let mut inputs = self.inputs.iter();
        inputs.find(|(_, of)| *of == input).map(|(topic, _)| *topic)
    }

    /// Input of a topic.
    pub fn input(&self, topic: usize) -> Option<CameraInput> {
        let mut inputs = self.inputs.iter();
        inputs.find(|(of, _)| *of == topic).map(|(_, input)| *input)
    }

    /// True if its label images are used.
    pub fn is_labelled(&self) -> bool {
        self.topic(CameraInput::Labels).is_some()
    }

    /// Roles of its topics.
    pub(super) fn roles(&self) -> impl Iterator<Item = (usize, Role)> {
        let inputs = self.inputs.iter();
        inputs.map(|(topic, input)| (*topic, Role::Camera(*input)))
    }

    /// Topics in use, in a line.
    pub(super) fn line(&self, bag: &BagReader) -> String {
        let name = |input| {
            let topic = self.topic(input).and_then(|topic| bag.topics().get(topic));
            topic.map(|topic| topic.name.as_str())
        };
        let color = name(CameraInput::Color).or(name(CameraInput::CompressedColor));
        let labels = match name(CameraInput::Labels) {
            Some(labels) => format!("{labels} (`labels: none` leaves them out)"),
            None => "none".to_owned(),
        };
        format!(
            "depth camera {}: calibration {}, labels {labels}, colours {}",
            bag.topics().get(self.depth).map_or("", |t| &t.name),
            name(CameraInput::Info).unwrap_or_default(),
            color.unwrap_or("none (`use_color: true` and `model` take them)"),
        )
    }
}

/// A depth camera with its frame.
pub(super) struct CameraTopic {
    pub camera: DepthCamera,
    pub frame: String,
    /// Namespace of the sensor: its depth topics show the same.
    sensor: String,
    /// Stream that the parameters ask for and the log lacks.
    problem: Option<TopicError>,
    /// Order of preference among the topics of a sensor; the smallest comes first.
    rank: (bool, bool, bool, u64, usize),
}

/// Depth cameras of a log.
#[derive(Default)]
pub(super) struct Cameras {
    pub all: Vec<CameraTopic>,
    /// Reasons for which topics are not taken.
    pub lines: Vec<String>,
    /// Remedies for depth images that cannot be used, as the end of an error.
    pub remedy: String,
}

impl Cameras {
    /// Finds the depth topics of a log, each with its camera calibration, labels and colours.
    pub fn find(bag: &BagReader, wishes: &CameraWishes) -> Result<Self, TopicError> {
        let images = images::images(bag)?;
        let infos = images::calibrations(bag)?;
        let names: Vec<usize> = survey::topics_of(bag, LabelInfo::TYPE).collect();
        let is_named = |image: &&ImageTopic| image.is_depth_by_name();
        let mut depths: Vec<&ImageTopic> = images.iter().filter(|i| i.may_be_depth()).collect();
        if depths.iter().any(is_named) {
            depths.retain(is_named);
        }
        let mut cameras = Self::default();
        for depth in depths {
            let name = &depth.name;
            let Some(info) = depth.calibration(&infos) else {
                cameras.remedy += &format!(
                    "; {name} has depth images ({}), but no camera_info of their frame and size is in the log: \
                     record {} too",
                    depth.encoding,
                    depth.beside("camera_info")
                );
                continue;
            };
            let companions = Companions {
                bag,
                images: &images,
                names: &names,
                wishes,
            };
            let (camera, problem) = companions.of(depth, info);
            let count = bag.topics().get(depth.topic).map_or(0, |t| t.message_count);
            cameras.all.push(CameraTopic {
                frame: depth.frame.clone(),
                sensor: depth.sensor().to_owned(),
                rank: (
                    problem.is_some(),
                    !camera.is_labelled(),
                    depth.is_compressed,
                    u64::MAX - count,
                    depth.topic,
                ),
                problem,
                camera,
            });
        }
        let is_used = |topic| { cameras.all.iter() }.any(|c| c.camera.input(topic).is_some());
        let may_label = |image: &&ImageTopic| image.may_be_labels(wishes.has_palette);
        let unused = images.iter().filter(may_label);
        let unused = unused.filter(|_| !wishes.no_labels && !cameras.all.is_empty());
        for image in unused.filter(|image| !is_used(image.topic)) {
            cameras.lines.push(format!(
                "not taken: {} (labels in {}, which no depth image has: record depth that is registered to it)",
                image.name, image.frame
            ));
        }
        Ok(cameras)
    }

    /// Keeps one topic for each sensor.
    pub fn keep_one_per_sensor(&mut self, bag: &BagReader) {
        let name = |topic: usize| bag.topics().get(topic).map_or("", |t| t.name.as_str());
        let mut all = std::mem::take(&mut self.all);
        all.sort_by_key(|camera| camera.rank);
        for camera in all {
            let depth = camera.camera.depth;
            match { self.all.iter() }.find(|taken| taken.sensor == camera.sensor) {
                Some(taken) => self.lines.push(format!(
                    "not taken: {0} (of the sensor of {1}; --points {0} takes it)",
                    name(depth),
                    name(taken.camera.depth)
                )),
                None => self.all.push(camera),
            }
        }
    }

    /// Fails if a stream is missing that the parameters ask for.
    pub fn check(&mut self) -> Result<(), TopicError> {
        let mut problems = self.all.iter_mut().filter_map(|found| found.problem.take());
        problems.next().map_or(Ok(()), Err)
    }

    /// Leaves all out, as the log has clouds.
    pub fn leave_out(&mut self, bag: &BagReader) {
        let name = |topic: usize| bag.topics().get(topic).map_or("", |t| t.name.as_str());
        let lines = self.all.drain(..).map(|camera| {
            let name = name(camera.camera.depth);
            format!(
                "not taken: {name} (depth images, in a log with clouds; --points {name} takes it)"
            )
        });
        self.lines = lines.collect();
    }
}

/// Choice of the companions of depth images.
struct Companions<'a> {
    bag: &'a BagReader,
    images: &'a [ImageTopic],
    names: &'a [usize],
    wishes: &'a CameraWishes,
}

impl Companions<'_> {
    /// The camera of a depth topic, and the error if a companion topic is missing.
    fn of(&self, depth: &ImageTopic, info: &Calibration) -> (DepthCamera, Option<TopicError>) {
        let wishes = self.wishes;
        let mut missing = None;
        let input = match depth.is_compressed {
            true => CameraInput::CompressedDepth,
            false => CameraInput::Depth,
        };
        let mut inputs = vec![(depth.topic, input), (info.topic, CameraInput::Info)];
        let labels = self.images.iter().filter(|image| {
            image.topic != depth.topic
                && image.may_be_labels(wishes.has_palette)
                && image.is_of_frame(&depth.frame)
        });
        let labels = nearest(labels.filter(|_| !wishes.no_labels), depth);
        if let Some(labels) = labels {
            inputs.push((labels.topic, CameraInput::Labels));
            let named = |topic: &&usize| {
                let topic = self.bag.topics().get(**topic);
                topic.is_some_and(|topic| topic.name == labels.beside("label_info"))
            };
            let names = self.names.iter().find(named).copied();
            inputs.extend(names.map(|topic| (topic, CameraInput::LabelInfo)));
            if wishes.with_confidence {
                let mut images = self.images.iter();
                let name = labels.beside("confidence");
                match images.find(|image| image.name == name) {
                    Some(image) => inputs.push((image.topic, CameraInput::Confidence)),
                    None => missing = Some(("confidences", "use_confidence: false")),
                }
            }
        } else if wishes.needs_labels {
            missing = Some(("labels", "labels: none"));
        }
        if wishes.with_color {
            let colors = self.images.iter().filter(|image| {
                image.may_be_color()
                    && image.is_of_frame(&depth.frame)
                    && !image.may_be_labels(true)
            });
            let colors: Vec<&ImageTopic> = colors.collect();
            let plain = colors.iter().copied().filter(|image| !image.is_compressed);
            let color = nearest(plain, depth).or_else(|| nearest(colors.iter().copied(), depth));
            match color {
                Some(image) if image.is_compressed => {
                    inputs.push((image.topic, CameraInput::CompressedColor));
                }
                Some(image) => inputs.push((image.topic, CameraInput::Color)),
                None => missing = Some(("colours", "use_color: false` without `model")),
            }
        }
        let problem = missing.map(|(what, parameter)| TopicError::NoCompanion {
            depth: depth.name.clone(),
            frame: depth.frame.clone(),
            what,
            parameter,
        });
        let depth = depth.topic;
        (DepthCamera { depth, inputs }, problem)
    }
}

/// The images whose name has the most in common with that of the depth images; the first of equal ones.
fn nearest<'a>(
    images: impl Iterator<Item = &'a ImageTopic>,
    depth: &ImageTopic,
) -> Option<&'a ImageTopic> {
    images.min_by_key(|image| (usize::MAX - image.common(&depth.name), image.topic))
}

/// Types of the topics of a depth camera, for an error.
pub(super) fn type_names() -> String {
    let (image, packed) = (Image::TYPE, CompressedImage::TYPE);
    format!("{image} or {packed} of depth with {}", CameraInfo::TYPE)
}
