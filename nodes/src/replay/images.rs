//! Image topics of a log and their calibrations, from the first message of each.

use lattice_bag::BagReader;
use lattice_msgs::RosMessage;
use lattice_msgs::sensor_msgs::{CameraInfo, CompressedImage, Image};

use super::survey::{bare, first, topics_of};
use super::topics::TopicError;

/// Encodings of depth images.
const DEPTH: [&str; 2] = ["16UC1", "32FC1"];
/// Encodings of class numbers.
const NUMBERS: [&str; 5] = ["mono8", "8UC1", "mono16", "16UC1", "32SC1"];
/// Encodings of colours.
const COLORS: [&str; 6] = ["rgb8", "bgr8", "rgba8", "bgra8", "8UC3", "8UC4"];
/// Parts of the names of label images.
const LABEL_WORDS: [&str; 4] = ["label", "segment", "semantic", "class"];
/// Parts of the names of images with one number for each pixel that are neither depth nor labels.
const OTHER_WORDS: [&str; 6] = [
    "confidence",
    "disparity",
    "infra",
    "/ir/",
    "image_ir",
    "amplitude",
];
/// Suffix of compressed_depth_image_transport.
const COMPRESSED_DEPTH: &str = "/compressedDepth";
/// Suffix of compressed_image_transport.
const COMPRESSED: &str = "/compressed";
/// Bytes before width and height in a compressed depth image: header, signature, length and type of a chunk.
const PNG_SIZE_AT: usize = 12 + 8 + 8;

/// A topic of images, described by its first message.
pub(super) struct ImageTopic {
    pub topic: usize,
    pub name: String,
    pub frame: String,
    pub encoding: String,
    /// True for CompressedImage.
    pub is_compressed: bool,
    /// Width and height in pixels, where known.
    size: Option<[u32; 2]>,
}

/// A topic of calibrations, described by its first message.
pub(super) struct Calibration {
    pub topic: usize,
    name: String,
    frame: String,
    size: [u32; 2],
}

impl ImageTopic {
    /// Name without the suffix of a transport.
    fn base(&self) -> &str {
        let name = self.name.as_str();
        let base = name.strip_suffix(COMPRESSED_DEPTH);
        base.or(name.strip_suffix(COMPRESSED)).unwrap_or(name)
    }

    fn has(&self, words: &[&str]) -> bool {
        let name = self.name.to_lowercase();
        words.iter().any(|word| name.contains(word))
    }

    /// True for numbers that may be depth.
    pub fn may_be_depth(&self) -> bool {
        let is_coded = match self.is_compressed {
            true => self.name.ends_with(COMPRESSED_DEPTH),
            // Older drivers; it is refused with the encodings that are read.
            false => self.encoding == "mono16" && self.is_depth_by_name(),
        };
        let is_depth = is_coded || !self.is_compressed && DEPTH.contains(&self.encoding.as_str());
        is_depth && !self.has(&OTHER_WORDS) && !self.has(&LABEL_WORDS)
    }

    /// True if the name says depth.
    pub fn is_depth_by_name(&self) -> bool {
        self.has(&["depth"])
    }

    /// True for class numbers, or masks of colours if there is a palette for them.
    pub fn may_be_labels(&self, has_palette: bool) -> bool {
        let encoding = self.encoding.as_str();
        let is_coded = NUMBERS.contains(&encoding) || has_palette && COLORS.contains(&encoding);
        is_coded && !self.is_compressed && self.has(&LABEL_WORDS) && !self.has(&OTHER_WORDS)
    }

    /// True for colours.
    pub fn may_be_color(&self) -> bool {
        match self.is_compressed {
            true => self.encoding.contains("jpeg") || self.encoding.contains("jpg"),
            false => COLORS.contains(&self.encoding.as_str()),
        }
    }

    /// True if the pixels may be those of images of a frame.
    pub fn is_of_frame(&self, frame: &str) -> bool {
        self.frame == frame || self.frame.is_empty()
    }

    /// A topic in the same namespace.
    pub fn beside(&self, name: &str) -> String {
        let space = self.base().rsplit_once('/').map_or("", |(space, _)| space);
        format!("{space}/{name}")
    }

    /// Namespace of the sensor, above those of its streams.
    pub fn sensor(&self) -> &str {
        let space = self.base().rsplit_once('/').map_or("", |(space, _)| space);
        space.rsplit_once('/').map_or("", |(sensor, _)| sensor)
    }

    /// Number of name parts in common with another topic, from the left.
    pub fn common(&self, name: &str) -> usize {
        common(&self.name, name)
    }

    /// The calibration of these images: in their namespace, or of their frame and size.
    pub fn calibration<'a>(&self, all: &'a [Calibration]) -> Option<&'a Calibration> {
        let beside = [
            self.beside("camera_info"),
            format!("{}/camera_info", self.base()),
        ];
        let is_sized = |info: &Calibration| self.size.is_none_or(|size| size == info.size);
        let is_beside = |info: &Calibration| beside.contains(&info.name);
        let fits = |info: &&Calibration| {
            is_beside(info) || self.frame == info.frame && !self.frame.is_empty() && is_sized(info)
        };
        all.iter().filter(fits).max_by_key(|info| {
            (
                is_sized(info),
                is_beside(info),
                common(&info.name, &self.name),
                std::cmp::Reverse(info.topic),
            )
        })
    }
}

/// Number of equal parts of two names, from the left.
fn common(a: &str, b: &str) -> usize {
    let pairs = a.split('/').zip(b.split('/'));
    pairs.take_while(|(a, b)| a == b).count()
}

/// Image topics with messages.
pub(super) fn images(bag: &BagReader) -> Result<Vec<ImageTopic>, TopicError> {
    let mut found = Vec::new();
    for topic in topics_of(bag, Image::TYPE) {
        if let Some(image) = first::<Image>(bag, topic)? {
            found.push(ImageTopic {
                topic,
                name: name(bag, topic),
                frame: bare(&image.header.frame_id),
                encoding: image.encoding,
                is_compressed: false,
                size: Some([image.width, image.height]),
            });
        }
    }
    for topic in topics_of(bag, CompressedImage::TYPE) {
        if let Some(image) = first::<CompressedImage>(bag, topic)? {
            let name = name(bag, topic);
            let size = png_size(&image.data).filter(|_| name.ends_with(COMPRESSED_DEPTH));
            found.push(ImageTopic {
                topic,
                name,
                frame: bare(&image.header.frame_id),
                encoding: image.format,
                is_compressed: true,
                size,
            });
        }
    }
    found.sort_by_key(|image| image.topic);
    Ok(found)
}

/// Calibration topics with messages.
pub(super) fn calibrations(bag: &BagReader) -> Result<Vec<Calibration>, TopicError> {
    let mut found = Vec::new();
    for topic in topics_of(bag, CameraInfo::TYPE) {
        if let Some(info) = first::<CameraInfo>(bag, topic)? {
            found.push(Calibration {
                topic,
                name: name(bag, topic),
                frame: bare(&info.header.frame_id),
                size: [info.width, info.height],
            });
        }
    }
    Ok(found)
}

fn name(bag: &BagReader, topic: usize) -> String {
    let topic = bag.topics().get(topic);
    topic.map_or(String::new(), |topic| topic.name.clone())
}

/// Width and height of the PNG file in a compressed depth image.
fn png_size(data: &[u8]) -> Option<[u32; 2]> {
    let sizes = data.get(PNG_SIZE_AT..)?.first_chunk::<8>()?;
    let [a, b, c, d, e, f, g, h] = *sizes;
    Some([
        u32::from_be_bytes([a, b, c, d]),
        u32::from_be_bytes([e, f, g, h]),
    ])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(name: &str, encoding: &str) -> ImageTopic {
        ImageTopic {
            topic: 0,
            name: name.to_owned(),
            frame: "optical".to_owned(),
            encoding: encoding.to_owned(),
            is_compressed: name.contains("/compressed"),
            size: Some([640, 480]),
        }
    }

    #[test]
    fn streams_of_known_drivers_are_told_apart_by_name_and_encoding() {
        for (name, encoding) in [
            ("/camera/camera/depth/image_rect_raw", "16UC1"),
            ("/camera/aligned_depth_to_color/image_raw", "16UC1"),
            ("/zed/zed_node/depth/depth_registered", "32FC1"),
            ("/depth_to_rgb/image_raw", "16UC1"),
            ("/oak/stereo/image_raw", "16UC1"),
            (
                "/camera/depth/image_raw/compressedDepth",
                "16UC1; compressedDepth png",
            ),
            ("/camera/depth/image_raw", "mono16"),
        ] {
            let image = image(name, encoding);
            assert!(image.may_be_depth(), "{name}");
            assert!(
                !image.may_be_labels(true) && !image.may_be_color(),
                "{name}"
            );
        }
        for (name, encoding) in [
            ("/camera/infra1/image_rect_raw", "mono8"),
            ("/kinect2/sd/image_ir", "16UC1"),
            ("/ir/image_raw", "mono16"),
            ("/zed/zed_node/confidence/confidence_map", "32FC1"),
            ("/labels/image", "16UC1"),
            ("/camera/color/image_raw", "rgb8"),
        ] {
            assert!(!image(name, encoding).may_be_depth(), "{name}");
        }
        assert!(image("/segmentation/labels", "mono8").may_be_labels(false));
        assert!(!image("/segmentation/labels_color", "rgb8").may_be_labels(false));
        assert!(image("/segmentation/labels_color", "rgb8").may_be_labels(true));
        assert!(!image("/labels/confidence", "mono8").may_be_labels(true));
        assert!(
            image(
                "/camera/color/image_raw/compressed",
                "rgb8; jpeg compressed bgr8"
            )
            .may_be_color()
        );
    }

    #[test]
    fn a_calibration_is_beside_its_images_or_of_their_frame_and_size() {
        let info = |topic, name: &str, frame: &str, size| Calibration {
            topic,
            name: name.to_owned(),
            frame: frame.to_owned(),
            size,
        };
        let all = [
            info(0, "/camera/color/camera_info", "optical", [640, 480]),
            info(1, "/camera/depth/camera_info", "depth", [640, 480]),
            info(2, "/other/camera_info", "optical", [1280, 720]),
        ];
        let of = |name: &str| {
            image(name, "16UC1")
                .calibration(&all)
                .map(|info| info.topic)
        };
        assert_eq!(of("/camera/depth/image_raw"), Some(1));
        assert_eq!(of("/camera/depth/image_raw/compressedDepth"), Some(1));
        assert_eq!(of("/camera/aligned/image_raw"), Some(0));
        let mut lost = image("/x/image", "16UC1");
        lost.frame.clear();
        assert!(lost.calibration(&all).is_none());
        assert_eq!(lost.beside("camera_info"), "/x/camera_info");
        assert_eq!(image("/a/b/depth/image", "").sensor(), "/a/b");
        assert_eq!(image("/image", "").sensor(), "");
        assert_eq!(png_size(&[0; 35]), None);
    }
}
