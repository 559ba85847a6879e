//! State machine of a segmenter, without I/O.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use lattice_msgs::sensor_msgs::{CompressedImage, Image};
use lattice_msgs::std_msgs::Header;
use lattice_msgs::vision_msgs::{LabelInfo, VisionClass};

use super::colors;
use super::compressed::unpacked;
use super::counts::SegmenterCounts;
use super::labels::{self, Labelled};
use super::network::{Interrupter, Network};
use super::options::SegmenterOptions;
use crate::camera::{Content, ImageView};

/// Labels images one by one.
pub struct Segmenter {
    options: SegmenterOptions,
    network: Box<dyn Network>,
    counts: SegmenterCounts,
    problem: Option<String>,
    interrupted: Arc<AtomicBool>,
}

impl Segmenter {
    /// Initial state.
    pub fn new(options: SegmenterOptions, network: Box<dyn Network>) -> Self {
        Self {
            options,
            network,
            counts: SegmenterCounts::default(),
            problem: None,
            interrupted: Arc::default(),
        }
    }

    /// Function that ends the inference in progress: its image and later ones are skipped.
    pub fn interrupter(&self) -> Interrupter {
        let (interrupted, network) = (Arc::clone(&self.interrupted), self.network.interrupter());
        Box::new(move || {
            interrupted.store(true, Ordering::Relaxed);
            network();
        })
    }

    /// Changes the options.
    pub fn set_options(&mut self, options: SegmenterOptions) {
        self.options = options;
    }

    /// Labels an image after validation.
    pub fn on_image(&mut self, image: &Image) -> Option<Labelled> {
        self.counts.images_in += 1;
        let view = match ImageView::new(image, Content::Colors, self.options.max_image_pixels) {
            Ok(view) => view,
            Err(error) => {
                self.refuse(error.name(), error.to_string());
                return None;
            }
        };
        let size = self.network.input();
        let planes = colors::planes(view, size, &self.options.normalisation);
        let names = Some(self.names().len()).filter(|names| *names > 0);
        let scores = self.network.run(planes);
        let found = scores.and_then(|scores| {
            let SegmenterOptions {
                meaning, with_soft, ..
            } = self.options;
            labels::labelled(&image.header, &scores, meaning, names, with_soft)
        });
        match found {
            Ok(labelled) => {
                self.counts.labels_out += 1;
                Some(labelled)
            }
            Err(problem) => {
                let interrupted = self.interrupted.load(Ordering::Relaxed);
                self.refuse(if interrupted { "skipped" } else { "network" }, problem);
                None
            }
        }
    }

    /// True if [`Segmenter::on_image`] would pass the image to the network.
    pub(crate) fn can_read(&self, image: &Image) -> bool {
        ImageView::new(image, Content::Colors, self.options.max_image_pixels).is_ok()
    }

    /// Labels a JPEG-compressed image.
    pub fn on_compressed(&mut self, message: &CompressedImage) -> Option<Labelled> {
        let image = self.unpack(message)?;
        self.on_image(&image)
    }

    /// Decodes a JPEG image; an invalid one is rejected.
    pub(crate) fn unpack(&mut self, message: &CompressedImage) -> Option<Arc<Image>> {
        match unpacked(message, self.options.max_image_pixels) {
            Ok(image) => Some(Arc::new(image)),
            Err((reason, problem)) => {
                self.counts.images_in += 1;
                self.refuse(reason, problem);
                None
            }
        }
    }

    /// Counts images skipped for newer ones while the network was busy.
    pub fn skip(&mut self, images: u64) {
        if images > 0 {
            self.counts.images_in += images;
            *self.counts.dropped.entry("skipped".to_owned()).or_default() += images;
        }
    }

    /// Class names: from parameters, or of the model; `None` if there are none.
    pub fn label_info(&self) -> Option<LabelInfo> {
        let numbered = self.names().iter().zip(0u16..);
        let classes = numbered.filter(|(name, _)| !name.is_empty());
        let class_map: Vec<VisionClass> = classes
            .map(|(name, class_id)| VisionClass {
                class_id,
                class_name: name.clone(),
            })
            .collect();
        (!class_map.is_empty()).then(|| LabelInfo {
            header: Header::default(),
            class_map,
            threshold: 0.0,
        })
    }

    fn names(&self) -> &[String] {
        match self.options.names.as_slice() {
            [] => self.network.names(),
            names => names,
        }
    }

    /// Counters of images, by reason.
    pub fn counts(&self) -> &SegmenterCounts {
        &self.counts
    }

    /// Text of the last rejection.
    pub fn problem(&self) -> Option<&str> {
        self.problem.as_deref()
    }

    fn refuse(&mut self, reason: &str, problem: String) {
        *self.counts.dropped.entry(reason.to_owned()).or_default() += 1;
        log::debug!("image rejected: {problem}");
        self.problem = Some(problem);
    }
}

#[cfg(test)]
mod tests {
    use crate::segmenter::{Meaning, Normalisation, Scores, Size, Values};

    use super::*;

    /// Says 0 where red is less than a half and 1 elsewhere; fails on black.
    struct Red;

    impl Network for Red {
        fn input(&self) -> Size {
            Size {
                width: 2,
                height: 1,
            }
        }

        fn names(&self) -> &[String] {
            &[]
        }

        fn run(&self, planes: Vec<f32>) -> Result<Scores, String> {
            if planes.iter().all(|v| *v == 0.0) {
                return Err("it is dark".to_owned());
            }
            let red = planes[..2].iter();
            let values = red.clone().map(|_| 0.5).chain(red.copied()).collect();
            Ok(Scores {
                size: self.input(),
                values: Values::Scores { classes: 2, values },
            })
        }
    }

    fn machine(names: &[&str]) -> Segmenter {
        let options = SegmenterOptions {
            normalisation: Normalisation {
                mean: [0.0; 3],
                deviation: [1.0; 3],
            },
            meaning: Meaning::Probabilities,
            names: names.iter().map(|name| name.to_string()).collect(),
            ..SegmenterOptions::default()
        };
        Segmenter::new(options, Box::new(Red))
    }

    fn image(encoding: &str, data: &[u8]) -> Image {
        Image {
            height: 1,
            width: 2,
            encoding: encoding.to_owned(),
            step: data.len() as u32,
            data: data.to_vec().into(),
            ..Image::default()
        }
    }

    #[test]
    fn each_image_becomes_labels_or_is_counted() {
        let mut machine = machine(&[]);
        let good = image("rgb8", &[255, 0, 0, 0, 0, 255]);
        let found = machine.on_image(&good).unwrap();
        assert_eq!(found.labels.data.to_vec(), [1, 0]);
        assert_eq!(found.confidence.unwrap().data.to_vec(), [255, 128]);

        let short = Image {
            step: 3,
            ..good.clone()
        };
        let huge = Image {
            width: 1 << 31,
            height: 1 << 31,
            step: u32::MAX,
            ..good.clone()
        };
        let dark = image("rgb8", &[0; 6]);
        let yuv = image("yuv422", &[0; 4]);
        for image in [&short, &huge, &dark, &yuv] {
            assert_eq!(machine.on_image(image), None);
        }
        machine.skip(3);
        assert!(machine.problem().unwrap().contains("yuv422"));
        let dropped = machine.counts().dropped.iter();
        let dropped: Vec<_> = dropped.map(|(reason, n)| (reason.as_str(), *n)).collect();
        let expected = [
            ("encoding", 1),
            ("malformed", 1),
            ("network", 1),
            ("skipped", 3),
            ("too_large", 1),
        ];
        assert_eq!(dropped, expected);
        assert!(machine.on_image(&good).is_some());
        assert_eq!(
            (machine.counts().images_in, machine.counts().labels_out),
            (9, 2)
        );
    }

    #[test]
    fn given_names_are_told_with_their_numbers() {
        assert_eq!(machine(&[]).label_info(), None);
        let info = machine(&["wall", "", "door"]).label_info().unwrap();
        let classes = info.class_map.iter();
        let classes: Vec<_> = classes
            .map(|class| (class.class_id, class.class_name.as_str()))
            .collect();
        assert_eq!(classes, [(0, "wall"), (2, "door")]);
    }
}
