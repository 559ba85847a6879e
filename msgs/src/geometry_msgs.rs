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

/// A position, m.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// Along x.
    pub x: f64,
    /// Along y.
    pub y: f64,
    /// Along z.
    pub z: f64,
}

/// A position of single precision, m.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Point32 {
    /// Along x.
    pub x: f32,
    /// Along y.
    pub y: f32,
    /// Along z.
    pub z: f32,
}

/// A free vector; its unit is that of the field it stands in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Vector3 {
    /// Along x.
    pub x: f64,
    /// Along y.
    pub y: f64,
    /// Along z.
    pub z: f64,
}

/// A rotation as a unit quaternion.
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
    /// Unit quaternion.
    pub orientation: Quaternion,
}

/// A pose with its time and reference frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PoseStamped {
    /// Time, and frame that the pose is given in.
    pub header: Header,
    /// The pose.
    pub pose: Pose,
}

/// An uncertain pose.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PoseWithCovariance {
    /// Mean.
    pub pose: Pose,
    /// 6x6 row-major over x, y, z (m) and rotations about the fixed axes X, Y, Z (rad).
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

/// An uncertain pose with its time and reference frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PoseWithCovarianceStamped {
    /// Time, and frame that the pose is given in.
    pub header: Header,
    /// The pose.
    pub pose: PoseWithCovariance,
}

/// Velocity in free space.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Twist {
    /// Linear velocity, m/s.
    pub linear: Vector3,
    /// Angular velocity, rad/s.
    pub angular: Vector3,
}

/// An uncertain velocity.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TwistWithCovariance {
    /// Mean.
    pub twist: Twist,
    /// 6x6 row-major over linear (m/s) and angular (rad/s) velocity.
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

/// A rigid transform.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Transform {
    /// Translation, m.
    pub translation: Vector3,
    /// Unit quaternion.
    pub rotation: Quaternion,
}

/// Pose of the child frame in the frame of the header: header.frame_id from child_frame_id.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TransformStamped {
    /// Time, and parent frame.
    pub header: Header,
    /// Child frame.
    pub child_frame_id: String,
    /// Parent from child.
    pub transform: Transform,
}
