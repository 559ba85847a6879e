//! Options of a [`super::SemanticCloud`].

use super::project::PointOptions;
use super::waiting::PairOptions;
use crate::camera::ClassRules;
use crate::options::one_of;
use lattice_runtime::params::{ParamError, Params};

/// Largest settable queue of images per topic.
const MAX_QUEUE: usize = 1000;

/// Source of the labels of clouds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LabelSource {
    /// Label images where a publisher of them is known, none otherwise.
    Auto,
    /// Label images, or a network: depth images wait for them.
    Image,
    /// Clouds without labels.
    None,
}

/// Values of `labels`; the first is the default.
const LABEL_SOURCES: [(&str, LabelSource); 3] = [
    ("auto", LabelSource::Auto),
    ("image", LabelSource::Image),
    ("none", LabelSource::None),
];

/// Options of a [`super::SemanticCloud`].
#[derive(Clone, Debug, PartialEq)]
pub struct CloudOptions {
    /// Source of the labels.
    pub labels: LabelSource,
    /// Matching rules of images.
    pub pair: PairOptions,
    /// Limit of pixels per image; larger images are rejected.
    pub max_image_pixels: usize,
    /// True for rectified images: `p` of the camera is used, without distortion.
    pub rectified: bool,
    /// Selection of the pixels that become points.
    pub points: PointOptions,
    /// Mapping of the classes.
    pub classes: ClassRules,
}

impl Default for CloudOptions {
    fn default() -> Self {
        Self {
            labels: LabelSource::Auto,
            pair: PairOptions {
                queue_size: 5,
                max_difference_ns: 20_000_000,
                with_confidence: false,
                with_color: false,
            },
            max_image_pixels: 4_000_000,
            rectified: false,
            points: PointOptions {
                stride: 1,
                min_range_m: 0.0,
                max_range_m: f64::INFINITY,
                edge_jump: 0.05,
            },
            classes: ClassRules::default(),
        }
    }
}

impl CloudOptions {
    /// Reads the parameters of the node.
    pub fn from_params(params: &Params) -> Result<Self, ParamError> {
        let defaults = Self::default();
        let difference_s = params.f64_in("max_stamp_difference_s", 0.02, 0.0..=3600.0)?;
        let max_difference_ns = match params.bool("exact_sync", false)? {
            true => 0,
            false => (difference_s * 1e9) as u64,
        };
        let (pair, points) = (&defaults.pair, &defaults.points);
        let min_range_m = params.f64_in("min_range_m", 0.0, 0.0..=f64::MAX)?;
        let max_range_m = match params.f64_in("max_range_m", 0.0, 0.0..=f64::MAX)? {
            0.0 => f64::INFINITY,
            max_range_m => max_range_m,
        };
        if min_range_m > max_range_m {
            let problem = format!("expected at most `max_range_m`, {max_range_m}");
            return Err(params.invalid("min_range_m", problem));
        }
        let edge_jump = params.f64_in("edge_jump", 0.05, 0.0..=1e9)?;
        Ok(Self {
            labels: one_of(params, "labels", &LABEL_SOURCES)?,
            pair: PairOptions {
                queue_size: params.usize_in("queue_size", pair.queue_size, 1..=MAX_QUEUE)?,
                max_difference_ns,
                with_confidence: params.bool("use_confidence", false)?,
                with_color: params.bool("use_color", false)?,
            },
            max_image_pixels: params.positive("max_image_pixels", defaults.max_image_pixels)?,
            rectified: params.bool("rectified", false)?,
            points: PointOptions {
                stride: params.positive("stride", points.stride)?,
                min_range_m,
                max_range_m,
                edge_jump: if edge_jump == 0.0 {
                    f32::INFINITY
                } else {
                    edge_jump as f32
                },
            },
            classes: ClassRules::from_params(params)?,
        })
    }
}
