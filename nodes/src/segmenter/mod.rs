//! `segmenter`: labels camera images with a neural network.
//!
//! [`Segmenter`] is a state machine without I/O; [`node`] connects it to DDS.

mod backends;
#[cfg(feature = "onnx")]
mod checks;
mod colors;
mod compressed;
mod counts;
#[cfg(feature = "onnx")]
mod file;
mod inside;
#[cfg(feature = "onnx")]
mod jpeg;
mod labels;
mod machine;
#[cfg(feature = "onnx")]
mod names;
mod network;
pub mod node;
#[cfg(feature = "ort")]
mod onnx_runtime;
mod options;
mod parameters;
#[cfg(feature = "onnx")]
mod sizes;
#[cfg(feature = "onnx")]
mod tract;
mod worker;

pub use backends::{read_network, read_network_by};
pub use colors::Normalisation;
pub(crate) use compressed::unpacked;
pub use counts::{SegmenterCounts, SegmenterReport};
pub(crate) use inside::{LoadedNetwork, NetworkView, hand_over};
pub use labels::{Labelled, Meaning};
pub use machine::Segmenter;
pub use network::{Backend, Interrupter, ModelError, Network, Scores, Size, Values};
pub use options::SegmenterOptions;
pub use parameters::declare;
pub(crate) use parameters::{NETWORK, NetworkSettings};
pub(crate) use worker::{NetworkEvent, Worker};
