//! Registration of labelled point clouds: Semantic-ICP (Parkison et al.; Nakamura et al.) and what it
//! is measured against.

mod calibrate;
mod cloud;
mod confusion;
mod downsample;
mod error;
mod labels;
mod likelihood;
mod named;
mod options;
mod pairs;
mod plane;
mod prepared;
pub mod search;
mod solver;
mod surface;
mod system;
#[cfg(test)]
mod testing;
mod tree;

pub use calibrate::{
    Calibration, CalibrationMap, CalibrationOptions, CalibrationRequest, ClassReliability,
    DirectionKind, HeadsetScan, Progress, Stage, TrackUpdate, Verdict, WeakDirection, calibrate,
    track,
};
pub use cloud::SemanticCloud;
pub use confusion::{Confusion, Lift};
pub use downsample::voxel_downsample;
pub use error::RegistrationError;
pub use labels::{LabelDistribution, UNLABELED};
pub use likelihood::{Fit, FitScale, Likelihood, Partners};
pub use named::NamedMethod;
pub use options::{LabelUse, MAX_CANDIDATES, Method, PairWeight, RegisterOptions, SemanticVariant};
pub use prepared::{MAX_COORDINATE_M, PrepareOptions, PreparedCloud};
pub use solver::{Registration, register};
pub use tree::{MAX_NEIGHBORS, Neighbors};
