//! Point cloud to be registered.

use nalgebra::Point3;

use crate::registration::SemanticCloud;

/// Point cloud to be registered, with the position of its sensor.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct SourceCloud {
    /// Points in the source frame, metres: forward, left, up, gravity along -z.
    pub cloud: SemanticCloud,
    /// Position of the sensor in the source frame, if known.
    pub sensor_m: Option<Point3<f64>>,
}
