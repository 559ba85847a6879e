//! Where a headset's frame lies in a robot's map: what is asked and what is answered.

mod types;

pub use types::{
    Calibration, CalibrationOptions, CalibrationRequest, ClassReliability, DirectionKind, Gaze,
    Progress, Stage, Verdict, WeakDirection,
};
