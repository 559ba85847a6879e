//! `semantic_cloud`: labelled clouds from a depth camera and a segmenter.
//!
//! [`SemanticCloud`] is a state machine without I/O; [`node`] connects it to DDS.

#[cfg_attr(
    not(feature = "compressed_depth"),
    expect(dead_code, reason = "errors of PNG files")
)]
mod compressed;
mod counts;
mod machine;
mod network;
pub mod node;
mod options;
mod parameters;
mod project;
mod waiting;

pub use crate::camera::{
    Camera, CameraError, Content, ImageError, ImageView, LabelSet, SHARES, Share, SoftLabels,
};
pub use counts::{CloudCounts, CloudReport, PointCounts};
pub use machine::{CloudOutput, SemanticCloud};
pub use options::{CloudOptions, LabelSource};
#[cfg(feature = "bags")]
pub(crate) use parameters::Settings;
pub use parameters::declare;
pub use project::PointOptions;
pub use waiting::{PairOptions, Stream};
