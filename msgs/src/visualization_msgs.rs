//! Markers, in the layout of Humble and later.

use serde::{Deserialize, Serialize};
use serde_bytes::ByteBuf;

use crate::builtin_interfaces::Duration;
use crate::geometry_msgs::{Point, Pose, Vector3};
use crate::interface::messages;
use crate::sensor_msgs::CompressedImage;
use crate::std_msgs::{ColorRGBA, Header};

messages! {
    "visualization_msgs" in "../definitions/visualization_msgs/";
    UVCoordinate [];
    MeshFile [];
    Marker [Header, Pose, Vector3, ColorRGBA, Duration, Point, CompressedImage, UVCoordinate, MeshFile];
    MarkerArray [Marker];
}

/// Texture coordinates, each in [0, 1].
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct UVCoordinate {
    /// Horizontal coordinate.
    pub u: f32,
    /// Vertical coordinate.
    pub v: f32,
}

/// Mesh file embedded in a marker.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MeshFile {
    /// Name of the file; its suffix gives the format.
    pub filename: String,
    /// Bytes of the file.
    pub data: ByteBuf,
}

/// Marker; namespace and id identify it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Marker {
    /// Stamp, and frame of the pose.
    pub header: Header,
    /// Namespace of the id.
    pub ns: String,
    /// Number within the namespace.
    pub id: i32,
    /// Shape to draw.
    #[serde(rename = "type")]
    pub type_: i32,
    /// Action: ADD, DELETE or DELETEALL.
    pub action: i32,
    /// Pose of the marker in the frame of the header.
    pub pose: Pose,
    /// Size along each axis, m.
    pub scale: Vector3,
    /// Colour of the whole marker.
    pub color: ColorRGBA,
    /// Lifetime; 0 if it stays until deleted.
    pub lifetime: Duration,
    /// True if the marker moves with its frame after the stamp.
    pub frame_locked: bool,
    /// Vertices in the frame of the marker, m.
    pub points: Vec<Point>,
    /// Colours: none, or one per vertex.
    pub colors: Vec<ColorRGBA>,
    /// URI of the texture; `embedded://` refers to `texture`.
    pub texture_resource: String,
    /// The embedded texture.
    pub texture: CompressedImage,
    /// Texture coordinates of each vertex.
    pub uv_coordinates: Vec<UVCoordinate>,
    /// Text of TEXT_VIEW_FACING.
    pub text: String,
    /// URI of the mesh; `embedded://` refers to `mesh_file`.
    pub mesh_resource: String,
    /// The embedded mesh.
    pub mesh_file: MeshFile,
    /// True if the mesh is drawn in the colours of its own materials.
    pub mesh_use_embedded_materials: bool,
}

impl Marker {
    /// Arrow.
    pub const ARROW: i32 = 0;
    /// Box.
    pub const CUBE: i32 = 1;
    /// Ellipsoid.
    pub const SPHERE: i32 = 2;
    /// Cylinder.
    pub const CYLINDER: i32 = 3;
    /// Line through all points.
    pub const LINE_STRIP: i32 = 4;
    /// Lines between successive pairs of points.
    pub const LINE_LIST: i32 = 5;
    /// Box at each point.
    pub const CUBE_LIST: i32 = 6;
    /// Sphere at each point.
    pub const SPHERE_LIST: i32 = 7;
    /// Square at each point.
    pub const POINTS: i32 = 8;
    /// Text that faces the viewer.
    pub const TEXT_VIEW_FACING: i32 = 9;
    /// Mesh of a file.
    pub const MESH_RESOURCE: i32 = 10;
    /// Triangles of successive triples of points.
    pub const TRIANGLE_LIST: i32 = 11;
    /// Arrow strip: arrows from each point to the next.
    pub const ARROW_STRIP: i32 = 12;
    /// Adds or replaces the marker.
    pub const ADD: i32 = 0;
    /// Replaces the marker, as ADD does.
    pub const MODIFY: i32 = 0;
    /// Deletes the marker.
    pub const DELETE: i32 = 2;
    /// Deletes all markers, or those of the namespace if it is set.
    pub const DELETEALL: i32 = 3;
}

/// Markers to apply together.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MarkerArray {
    /// Markers in the order in which they apply.
    pub markers: Vec<Marker>,
}
