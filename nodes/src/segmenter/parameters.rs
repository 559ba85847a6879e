//! All parameters of the node.

use std::path::PathBuf;

use super::SegmenterOptions;
use super::network::Size;
use super::options::input_size;
use crate::compute::ComputeLimits;
use crate::{options, report};
use lattice_runtime::about;
use lattice_runtime::params::{About, ParamError, Params};

const MODEL: &str = "the network is made at the start";
const ABOUT: &[About] = about! {
    "model" fixed(MODEL): "The network, an ONNX file: one image in (1 x 3 x rows x columns), scores of classes or classes out.";
    "input_size" fixed(MODEL): "Width and height of the images that the network takes, where its file leaves them open.";
    "compressed" fixed(options::TOPIC): "Whether images are taken from rgb/image_rect_color/compressed (JPEG).";
    "mean": "Means of red, green and blue, for colours from 0 to 1, as the network was trained with.";
    "std": "Standard deviations of red, green and blue, likewise.";
    "scores": "Whether the scores of the network are logits or probabilities.";
    "names": "Names of the classes in the order of their numbers; none: those of the model.";
    "max_image_pixels": "Images of more pixels are refused.";
};

/// Settings of the node by its parameters.
pub(super) struct Settings {
    pub segmenter: SegmenterOptions,
    pub model: PathBuf,
    pub compressed: bool,
    pub input_size: Option<Size>,
    pub threads: usize,
    pub limits: ComputeLimits,
    pub report_file: String,
}

impl Settings {
    /// Reads the parameters of the node.
    pub(super) fn from_params(params: &Params) -> Result<Self, ParamError> {
        params.describe(ABOUT);
        params.describe(options::COMMON);
        Ok(Self {
            segmenter: SegmenterOptions::from_params(params)?,
            model: params.string("model", "")?.into(),
            compressed: params.bool("compressed", false)?,
            input_size: input_size(params)?,
            threads: options::threads(params, 0)?,
            limits: ComputeLimits {
                events: 16,
                // The image that waits is the newest; none other does.
                bytes: usize::MAX,
                threads: 1,
            },
            report_file: report::file(params)?,
        })
    }
}

/// Reads all parameters of the node, as its start does.
pub fn declare(params: &Params) -> Result<(), ParamError> {
    Settings::from_params(params).map(drop)
}
