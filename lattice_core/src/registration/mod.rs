//! Registration of labelled point clouds: Semantic-ICP (Parkison et al.; Nakamura et al.) and what it
//! is measured against.

mod cloud;
mod labels;

pub use cloud::SemanticCloud;
pub use labels::{LabelDistribution, UNLABELED};
