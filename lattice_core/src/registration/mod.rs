//! Registration of labelled point clouds: Semantic-ICP (Parkison et al.; Nakamura et al.) and what it
//! is measured against.

mod calibrate;
mod cloud;
mod confusion;
mod error;
mod fit;
mod labels;
mod plane;
mod prepared;
pub mod search;
#[cfg(test)]
mod testing;
mod tree;

pub use calibrate::{
    Calibration, CalibrationOptions, CalibrationRequest, ClassReliability, DirectionKind, Gaze,
    Progress, Stage, Verdict, WeakDirection,
};
pub use cloud::SemanticCloud;
pub use confusion::{Confusion, Lift};
pub use error::RegistrationError;
pub use fit::{Fit, FitScale, Likelihood, Partners};
pub use labels::{LabelDistribution, UNLABELED};
pub use prepared::{MAX_COORDINATE_M, PrepareOptions, PreparedCloud};
pub use tree::{MAX_NEIGHBORS, Neighbors};
