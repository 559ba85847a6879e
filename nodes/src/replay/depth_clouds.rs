//! Clouds of the depth cameras of a log, by the state machine of `semantic_cloud`.

use std::sync::Arc;

use lattice_bag::BagReader;
use lattice_msgs::cdr::{self, CdrError};
use lattice_msgs::sensor_msgs::PointCloud2;
use lattice_runtime::Shutdown;
use lattice_runtime::params::{ParamError, Params};

use super::camera_input::CameraInput;
use super::camera_report::CameraReport;
use super::cameras::DepthCamera;
use super::topic_plan::TopicPlan;
use crate::camera::LabelSet;
use crate::segmenter::{Labelled, Segmenter};
use crate::semantic_cloud::{
    CloudOutput, CloudReport, LabelSource, SemanticCloud, Settings, Stream,
};

/// Images of each topic that wait for those of their stamp, unless `queue_size` is given: labels of a log may come
/// seconds after their depth images.
pub const QUEUE_SIZE: usize = 60;

/// A cloud of a depth camera, with the topic of its depth images.
pub(super) type DepthCloud = (Arc<str>, Arc<PointCloud2>);

/// State machines of the depth cameras of a replay.
pub struct DepthClouds(Vec<Machine>);

struct Machine {
    camera: DepthCamera,
    /// Topic of the depth images.
    topic: Arc<str>,
    machine: SemanticCloud,
    network: Option<Segmenter>,
}

impl DepthClouds {
    /// Machines that have seen nothing, with the parameters of `semantic_cloud`; the plan decides whether there are labels
    /// and colours.
    pub fn new(bag: &BagReader, plan: &TopicPlan, params: &Params) -> Result<Self, ParamError> {
        let machines = plan.cameras.iter().map(|camera| {
            let Settings {
                cloud: mut options,
                network,
                ..
            } = Settings::from_params(params)?;
            let network = match network {
                Some((network, of_network)) => {
                    let network = network.read(params, &Shutdown::default())?;
                    Some(Segmenter::new(of_network, network))
                }
                None => None,
            };
            if !params.is_given("queue_size") {
                options.pair.queue_size = QUEUE_SIZE;
            }
            options.labels = match network.is_some() || camera.is_labelled() {
                true => LabelSource::Image,
                false => LabelSource::None,
            };
            let topic = bag.topics().get(camera.depth);
            let mut machine = SemanticCloud::new(options);
            let names = network.as_ref().and_then(Segmenter::label_info);
            if let Some(names) = names {
                machine.on_label_info(Arc::new(names));
            }
            Ok(Machine {
                camera: camera.clone(),
                topic: topic.map_or("", |topic| &topic.name).into(),
                machine,
                network,
            })
        });
        machines.collect::<Result<_, _>>().map(Self)
    }

    /// Passes a message of a topic to the cameras that use it.
    pub(super) fn on_message(
        &mut self,
        topic: usize,
        data: &[u8],
    ) -> Result<Vec<DepthCloud>, CdrError> {
        let mut clouds = Vec::new();
        for camera in &mut self.0 {
            if let Some(input) = camera.camera.input(topic) {
                let outputs = camera.on_message(input, data)?;
                clouds.extend(camera.clouds(outputs));
            }
        }
        Ok(clouds)
    }

    /// Ends the input: the images that match become clouds, and the rest is counted.
    pub(super) fn finish(&mut self) -> Vec<DepthCloud> {
        let clouds = self.0.iter_mut().flat_map(|camera| {
            let outputs = camera.machine.finish();
            camera.clouds(outputs).collect::<Vec<_>>()
        });
        clouds.collect()
    }

    /// Reports, one for each camera.
    pub(super) fn reports(&self) -> Vec<CameraReport> {
        let reports = self.0.iter().map(|camera| CameraReport {
            topic: camera.topic.to_string(),
            problem: camera.machine.problem().map(str::to_owned),
            clouds: CloudReport {
                counts: camera.machine.counts().clone(),
                network: camera.network.as_ref().map(|n| n.counts().clone()),
                ..CloudReport::default()
            },
        });
        reports.collect()
    }
}

impl Machine {
    fn on_message(
        &mut self,
        input: CameraInput,
        data: &[u8],
    ) -> Result<Vec<CloudOutput>, CdrError> {
        let machine = &mut self.machine;
        Ok(match (input, &mut self.network) {
            (CameraInput::Depth, _) => {
                machine.on_image(Stream::Depth, Arc::new(cdr::from_slice(data)?))
            }
            (CameraInput::CompressedDepth, _) => {
                machine.on_compressed_depth(&cdr::from_slice(data)?)
            }
            (CameraInput::Info, _) => machine.on_camera_info(Arc::new(cdr::from_slice(data)?)),
            (CameraInput::Labels, _) => {
                machine.on_image(Stream::Labels, Arc::new(cdr::from_slice(data)?))
            }
            (CameraInput::Confidence, _) => {
                machine.on_image(Stream::Confidence, Arc::new(cdr::from_slice(data)?))
            }
            (CameraInput::LabelInfo, _) => machine.on_label_info(Arc::new(cdr::from_slice(data)?)),
            (CameraInput::Color, None) => {
                machine.on_image(Stream::Color, Arc::new(cdr::from_slice(data)?))
            }
            (CameraInput::CompressedColor, None) => {
                machine.on_compressed_color(&cdr::from_slice(data)?)
            }
            (CameraInput::Color | CameraInput::CompressedColor, Some(network)) => {
                let image = match input {
                    CameraInput::Color => Some(Arc::new(cdr::from_slice(data)?)),
                    _ => network.unpack(&cdr::from_slice(data)?),
                };
                let labelled = image.and_then(|image| Some((network.on_image(&image)?, image)));
                let Some((labelled, image)) = labelled else {
                    return Ok(Vec::new());
                };
                let Labelled {
                    labels,
                    confidence,
                    soft,
                } = labelled;
                machine.on_labelled(LabelSet {
                    labels: Arc::new(labels),
                    confidence: confidence.map(Arc::new),
                    colors: Some(image),
                    soft: soft.map(Arc::new),
                })
            }
        })
    }

    fn clouds(&self, outputs: Vec<CloudOutput>) -> impl Iterator<Item = DepthCloud> {
        let topic = Arc::clone(&self.topic);
        let clouds = outputs.into_iter().filter_map(|output| match output {
            CloudOutput::Points(points) => Some(Arc::new(points)),
            CloudOutput::LabelInfo(_) => None,
        });
        clouds.map(move |points| (Arc::clone(&topic), points))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::convert::geometry::header;
    use crate::segmenter::{Network, Scores, SegmenterOptions, Size, Values};
    use crate::semantic_cloud::CloudOptions;
    use lattice_msgs::sensor_msgs::{CameraInfo, Image};
    use serde::Serialize;

    /// A network of two pixels, of the classes 3 and 4.
    struct Two([String; 0]);

    const TWO: Size = Size {
        width: 2,
        height: 1,
    };

    impl Network for Two {
        fn input(&self) -> Size {
            TWO
        }

        fn names(&self) -> &[String] {
            &self.0
        }

        fn run(&self, _: Vec<f32>) -> Result<Scores, String> {
            Ok(Scores {
                size: TWO,
                values: Values::Classes(vec![3, 4]),
            })
        }
    }

    fn image(stamp_ns: i64, encoding: &str, data: &[u8]) -> Vec<u8> {
        let image = Image {
            header: header("camera", stamp_ns),
            width: 2,
            height: 1,
            encoding: encoding.to_owned(),
            step: data.len() as u32,
            data: data.to_vec().into(),
            ..Image::default()
        };
        bytes(&image)
    }

    fn bytes(message: &impl Serialize) -> Vec<u8> {
        cdr::to_vec(message).unwrap()
    }

    #[test]
    fn a_network_labels_each_image_of_colours() {
        let inputs = [CameraInput::Depth, CameraInput::Info, CameraInput::Color];
        let camera = DepthCamera {
            depth: 0,
            inputs: inputs.into_iter().enumerate().collect(),
        };
        let options = CloudOptions {
            labels: LabelSource::Image,
            ..CloudOptions::default()
        };
        let network = Segmenter::new(SegmenterOptions::default(), Box::new(Two([])));
        let mut cameras = DepthClouds(vec![Machine {
            camera,
            topic: "/depth".into(),
            machine: SemanticCloud::new(options),
            network: Some(network),
        }]);
        let info = CameraInfo {
            width: 2,
            height: 1,
            k: [1.0, 0.0, 0.5, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
            ..CameraInfo::default()
        };
        assert!(cameras.on_message(1, &bytes(&info)).unwrap().is_empty());
        let mut clouds = Vec::new();
        for stamp_ns in 1..=5 {
            let depth = image(stamp_ns, "16UC1", &[232, 3, 232, 3]);
            assert!(cameras.on_message(0, &depth).unwrap().is_empty());
            let color = image(stamp_ns, "rgb8", &[1, 2, 3, 4, 5, 6]);
            clouds.extend(cameras.on_message(2, &color).unwrap());
        }
        // Its colours are of no other time, and another topic is not of the camera.
        let late = image(9_000_000_000, "16UC1", &[232, 3, 232, 3]);
        assert!(cameras.on_message(0, &late).unwrap().is_empty());
        assert!(cameras.on_message(7, &late).unwrap().is_empty());
        assert!(cameras.on_message(0, &late[..20]).is_err());
        assert_eq!(clouds.len(), 5);
        for (topic, cloud) in &clouds {
            assert_eq!((&**topic, cloud.width, cloud.height), ("/depth", 2, 1));
            let fields: Vec<&str> = cloud.fields.iter().map(|f| f.name.as_str()).collect();
            assert!(
                fields.contains(&"label") && fields.contains(&"rgb"),
                "{fields:?}"
            );
        }
        assert!(cameras.finish().is_empty());
        let [report] = &cameras.reports()[..] else {
            panic!()
        };
        assert_eq!(
            (
                report.left_out(),
                report.clouds.counts.points.points_unlabelled
            ),
            (1, 0)
        );
        assert_eq!(report.clouds.counts.dropped["depth_no_partner"], 1);
        assert_eq!(report.clouds.network.as_ref().unwrap().labels_out, 5);
        assert!(report.cause_of_nothing().is_none());
    }
}
