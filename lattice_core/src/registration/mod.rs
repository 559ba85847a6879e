//! Registration of labelled point clouds: Semantic-ICP (Parkison et al.; Nakamura et al.) and what it
//! is measured against.

mod cloud;
mod error;
mod labels;
mod plane;
mod prepared;
mod tree;

pub use cloud::SemanticCloud;
pub use error::RegistrationError;
pub use labels::{LabelDistribution, UNLABELED};
pub use prepared::{MAX_COORDINATE_M, PrepareOptions, PreparedCloud};
pub use tree::{MAX_NEIGHBORS, Neighbors};
