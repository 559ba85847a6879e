//! Positions, rotations, poses, velocities and transforms.

use serde::{Deserialize, Serialize};
use serde_big_array::BigArray;

use crate::interface::messages;
use crate::std_msgs::Header;

messages! {
    "geometry_msgs" in "../definitions/geometry_msgs/";
    Point [];
    Point32 [];
    Vector3 [];
    Quaternion [];
    Pose [Point, Quaternion];
    PoseStamped [Header, Pose];
    PoseWithCovariance [Pose];
    PoseWithCovarianceStamped [Header, PoseWithCovariance];
    Twist [Vector3];
    TwistWithCovariance [Twist];
    Transform [Vector3, Quaternion];
    TransformStamped [Header, Transform];
}

/// Position, m.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// x coordinate, m.
    pub x: f64,
    /// y coordinate, m.
    pub y: f64,
    /// z coordinate, m.
    pub z: f64,
}

/// Position in single precision, m.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Point32 {
    /// x coordinate, m.
    pub x: f32,
    /// y coordinate, m.
    pub y: f32,
    /// z coordinate, m.
    pub z: f32,
}

/// Free vector, in the unit of its field.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Vector3 {
    /// x component.
    pub x: f64,
    /// y component.
    pub y: f64,
    /// z component.
    pub z: f64,
}

/// Rotation as a unit quaternion.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Quaternion {
    /// Imaginary part i.
    pub x: f64,
    /// Imaginary part j.
    pub y: f64,
    /// Imaginary part k.
    pub z: f64,
    /// Real part.
    pub w: f64,
}

impl Default for Quaternion {
    fn default() -> Self {
        Self {
            x: 0.0,
            y: 0.0,
            z: 0.0,
            w: 1.0,
        }
    }
}

/// Position and orientation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// Position, m.
    pub position: Point,
    /// Orientation as a unit quaternion.
    pub orientation: Quaternion,
}

/// Pose with time and reference frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PoseStamped {
    /// Time, and reference frame of the pose.
    pub header: Header,
    /// Pose in the reference frame.
    pub pose: Pose,
}

/// Pose with covariance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PoseWithCovariance {
    /// Mean pose.
    pub pose: Pose,
    /// Covariance, 6 x 6, row-major: x, y, z (m) and rotations about the fixed axes X, Y, Z (rad).
    #[serde(with = "BigArray")]
    pub covariance: [f64; 36],
}

impl Default for PoseWithCovariance {
    fn default() -> Self {
        Self {
            pose: Pose::default(),
            covariance: [0.0; 36],
        }
    }
}

/// Pose with covariance, time and reference frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PoseWithCovarianceStamped {
    /// Time, and reference frame of the pose.
    pub header: Header,
    /// Pose in the reference frame.
    pub pose: PoseWithCovariance,
}

/// Linear and angular velocity (twist).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Twist {
    /// Linear velocity, m/s.
    pub linear: Vector3,
    /// Angular velocity, rad/s.
    pub angular: Vector3,
}

/// Twist with covariance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TwistWithCovariance {
    /// Mean twist.
    pub twist: Twist,
    /// Covariance, 6 x 6, row-major: linear (m/s) and angular (rad/s) velocity.
    #[serde(with = "BigArray")]
    pub covariance: [f64; 36],
}

impl Default for TwistWithCovariance {
    fn default() -> Self {
        Self {
            twist: Twist::default(),
            covariance: [0.0; 36],
        }
    }
}

/// Rigid transform.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Transform {
    /// Translation, m.
    pub translation: Vector3,
    /// Rotation as a unit quaternion.
    pub rotation: Quaternion,
}

/// Transform from the child frame to the frame of the header, as on `/tf`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TransformStamped {
    /// Time, and parent frame.
    pub header: Header,
    /// Child frame.
    pub child_frame_id: String,
    /// `parent_from_child`.
    pub transform: Transform,
}
