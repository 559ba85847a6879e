//! Registration of labelled point clouds: Semantic-ICP (Parkison et al.; Nakamura et al.), its baselines and a global
//! registration.

mod cloud;
mod confusion;
mod downsample;
mod error;
mod global;
mod labels;
mod likelihood;
pub mod mounts;
mod named;
mod prepared;
mod register_options;
mod search;
mod solver;

pub use crate::kd_tree::{MAX_NEIGHBORS, Neighbors};
pub use cloud::SemanticCloud;
pub use confusion::{Confusion, Lift};
pub use downsample::voxel_downsample;
pub use error::RegistrationError;
pub use global::{
    Calibration, CalibrationMap, CalibrationOptions, CalibrationRequest, ClassReliability,
    DirectionKind, FitDiagnostics, Margin, Profile, Progress, ScaleEstimate, SourceCloud, Stage,
    TrackUpdate, Unexplained, UnexplainedKind, Verdict, WeakDirection, describe_p_wrong,
    register_global, track,
};
pub use labels::{LabelDistribution, UNLABELED};
pub use named::NamedMethod;
pub use prepared::{MAX_COORDINATE_M, PrepareOptions, PreparedCloud};
pub use register_options::{LabelUse, MAX_CANDIDATES, Method, RegisterOptions, SemanticVariant};
pub use solver::{Registration, register};
