//! Places on earth.

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

/// A place on earth, WGS 84.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GeoPoint {
    /// Latitude, degrees, north positive, in [-90, 90].
    pub latitude: f64,
    /// Longitude, degrees, east positive, in [-180, 180].
    pub longitude: f64,
    /// Height above the ellipsoid, m; NaN if unknown.
    pub altitude: f64,
}

/// A place on earth with its time.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GeoPointStamped {
    /// Time of the place.
    pub header: Header,
    /// The place.
    pub position: GeoPoint,
}

/// Place and orientation on earth.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GeoPose {
    /// The place.
    pub position: GeoPoint,
    /// Orientation in the east-north-up frame at that position.
    pub orientation: Quaternion,
}

/// Place and orientation on earth with their time.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GeoPoseStamped {
    /// Time of the pose.
    pub header: Header,
    /// The pose.
    pub pose: GeoPose,
}
