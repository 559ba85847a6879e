//! Parameters of the node.

use super::{CloudOptions, LabelSource};
use crate::compute::ComputeLimits;
use crate::segmenter::{NETWORK, NetworkSettings, SegmenterOptions};
use crate::{options, report};
use lattice_runtime::about;
use lattice_runtime::params::{About, ParamError, Params};

const ABOUT: &[About] = about! {
    "labels": "Source of labels: image (labels/image, or model), none (clouds without labels), auto (image where somebody publishes labels/image, else none).";
    "queue_size": "Images of each topic queued for those of the same stamp; the oldest is dropped and counted.";
    "exact_sync": "Whether the stamps of depth and labels must be equal.";
    "max_stamp_difference_s": "Largest difference between the stamps of depth and labels without exact_sync.";
    "use_confidence" fixed(options::TOPIC): "Whether labels wait for labels/confidence of their stamp.";
    "use_color" fixed(options::TOPIC): "Whether points have the colours of rgb/image_rect_color, for which labels wait by stamp; always with model.";
    "compressed_depth" fixed(options::TOPIC): "Whether depth is taken from depth_registered/image_rect/compressedDepth (PNG).";
    "edge_jump": "Largest depth difference to the eight adjacent pixels, as a fraction: pixels beyond it are rejected, since labels bleed at edges; 0: none.";
    "threads" fixed("the pool is made with it"): "Threads of the network; 0: one less than the number of cores.";
};

/// Settings from the parameters of the node.
pub(crate) struct Settings {
    pub cloud: CloudOptions,
    /// Built-in network with its options.
    pub network: Option<(NetworkSettings, SegmenterOptions)>,
    pub compressed_color: bool,
    pub compressed_depth: bool,
    pub limits: ComputeLimits,
    pub report_file: String,
}

impl Settings {
    /// Reads the parameters of the node.
    pub(crate) fn from_params(params: &Params) -> Result<Self, ParamError> {
        params.describe(ABOUT);
        params.describe(NETWORK);
        params.describe(options::COMMON);
        let compressed_depth = params.bool("compressed_depth", false)?;
        if compressed_depth && !cfg!(feature = "compressed_depth") {
            let problem = "this program was built without the feature `compressed_depth`";
            return Err(params.invalid("compressed_depth", problem));
        }
        let mut cloud = CloudOptions::from_params(params)?;
        let with_soft = params.bool("label_probs", false)?;
        let of_network = SegmenterOptions::of_network(params, cloud.max_image_pixels, with_soft)?;
        let network = NetworkSettings::from_params(params)?;
        if network.is_some() {
            // They are delivered with the labels.
            (cloud.pair.with_confidence, cloud.pair.with_color) = (false, false);
            if cloud.labels == LabelSource::None {
                return Err(params.invalid("labels", "expected auto or image beside `model`"));
            }
            cloud.labels = LabelSource::Image;
        }
        let compressed_color = params.bool("compressed_color", false)?;
        if compressed_color && cloud.pair.with_color && !cfg!(feature = "onnx") {
            let problem = "this program was built without the feature `onnx`, which reads JPEG";
            return Err(params.invalid("compressed_color", problem));
        }
        Ok(Self {
            compressed_depth,
            compressed_color,
            cloud,
            network: network.map(|network| (network, of_network)),
            limits: options::compute_limits(params, 4096, 128 << 20, 1)?,
            report_file: report::file(params)?,
        })
    }
}

/// Declares all parameters of the node, as at its start.
pub fn declare(params: &Params) -> Result<(), ParamError> {
    Settings::from_params(params).map(drop)
}
