//! Geographic positions and poses.

use serde::{Deserialize, Serialize};

use crate::geometry_msgs::Quaternion;
use crate::interface::messages;
use crate::std_msgs::Header;

messages! {
    "geographic_msgs" in "../definitions/geographic_msgs/";
    GeoPoint [];
    GeoPointStamped [Header, GeoPoint];
    GeoPose [GeoPoint, Quaternion];
    GeoPoseStamped [Header, GeoPose];
}

/// Geographic position, WGS 84.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GeoPoint {
    /// Latitude, degrees, north positive, in [-90, 90].
    pub latitude: f64,
    /// Longitude, degrees, east positive, in [-180, 180].
    pub longitude: f64,
    /// Height above the ellipsoid, m; NaN if unknown.
    pub altitude: f64,
}

/// Geographic position with time and frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GeoPointStamped {
    /// Time of the position, and its frame.
    pub header: Header,
    /// Position.
    pub position: GeoPoint,
}

/// Geographic position and orientation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GeoPose {
    /// Position.
    pub position: GeoPoint,
    /// Orientation in the east-north-up frame at that position.
    pub orientation: Quaternion,
}

/// Geographic position and orientation with time and frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GeoPoseStamped {
    /// Time of the pose, and its frame.
    pub header: Header,
    /// Pose.
    pub pose: GeoPose,
}
