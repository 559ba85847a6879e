//! Fields that types of ROS 2 have beyond those of ROS 1.

/// A field that ROS 2 (Jazzy) added to a type; its converted value is zero or empty.
pub(super) struct Added {
    /// Type, as in ROS 1.
    pub to: &'static str,
    /// Preceding field; `None`: the last one.
    pub after: Option<&'static str>,
    /// Definition of the field.
    pub line: &'static str,
}

const fn added(to: &'static str, after: Option<&'static str>, line: &'static str) -> Added {
    Added { to, after, line }
}

const MARKER: &str = "visualization_msgs/Marker";
const OEM7_HEADER: &str = "novatel_oem7_msgs/Oem7Header";

/// In the order of the fields of each type.
pub(super) const ADDED: &[Added] = &[
    added(MARKER, Some("colors"), "string texture_resource"),
    added(
        MARKER,
        Some("texture_resource"),
        "sensor_msgs/CompressedImage texture",
    ),
    added(MARKER, Some("texture"), "UVCoordinate[] uv_coordinates"),
    added(MARKER, Some("mesh_resource"), "MeshFile mesh_file"),
    added("sensor_msgs/Range", None, "float32 variance"),
    added(
        "shape_msgs/SolidPrimitive",
        None,
        "geometry_msgs/Polygon polygon",
    ),
    added(OEM7_HEADER, None, "uint32 receiver_status"),
    added(OEM7_HEADER, None, "float32 idle_time"),
];

/// Types of added fields, with their definitions.
pub(super) const NEEDED: &[(&str, &str)] = &[
    (
        "sensor_msgs/CompressedImage",
        "Header header\nstring format\nuint8[] data",
    ),
    ("visualization_msgs/UVCoordinate", "float32 u\nfloat32 v"),
    (
        "visualization_msgs/MeshFile",
        "string filename\nuint8[] data",
    ),
    ("geometry_msgs/Polygon", "Point32[] points"),
    ("geometry_msgs/Point32", "float32 x\nfloat32 y\nfloat32 z"),
];
