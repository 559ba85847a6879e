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

/// A place on a texture; each part in [0, 1].
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct UVCoordinate {
    /// Across.
    pub u: f32,
    /// Along.
    pub v: f32,
}

/// A mesh sent along with its marker.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MeshFile {
    /// Its name; the suffix gives the format.
    pub filename: String,
    /// The file as bytes.
    pub data: ByteBuf,
}

/// Something to draw; ns and id together are its identity.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Marker {
    /// Time, and frame of the pose.
    pub header: Header,
    /// Namespace of id.
    pub ns: String,
    /// Number within ns.
    pub id: i32,
    /// Shape to draw.
    #[serde(rename = "type")]
    pub type_: i32,
    /// ADD, DELETE or DELETEALL.
    pub action: i32,
    /// Header.frame_id from the marker.
    pub pose: Pose,
    /// Size along each axis, m.
    pub scale: Vector3,
    /// Colour of all.
    pub color: ColorRGBA,
    /// 0: until deleted.
    pub lifetime: Duration,
    /// True: follow the frame after the stamp.
    pub frame_locked: bool,
    /// Vertices in the frame of the marker, m.
    pub points: Vec<Point>,
    /// None, or one for each point.
    pub colors: Vec<ColorRGBA>,
    /// URI of the texture, embedded:// for the one below.
    pub texture_resource: String,
    /// The embedded texture.
    pub texture: CompressedImage,
    /// Place of each vertex on the texture.
    pub uv_coordinates: Vec<UVCoordinate>,
    /// Text of TEXT_VIEW_FACING.
    pub text: String,
    /// URI of the mesh, embedded:// for the one below.
    pub mesh_resource: String,
    /// The embedded mesh.
    pub mesh_file: MeshFile,
    /// True: colour the mesh by its own materials.
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
    /// A line through all points.
    pub const LINE_STRIP: i32 = 4;
    /// A line for every two points.
    pub const LINE_LIST: i32 = 5;
    /// A box at each point.
    pub const CUBE_LIST: i32 = 6;
    /// A sphere at each point.
    pub const SPHERE_LIST: i32 = 7;
    /// A square at each point.
    pub const POINTS: i32 = 8;
    /// Upright text.
    pub const TEXT_VIEW_FACING: i32 = 9;
    /// A mesh from a file.
    pub const MESH_RESOURCE: i32 = 10;
    /// A triangle for every three points.
    pub const TRIANGLE_LIST: i32 = 11;
    /// Arrows from point to point.
    pub const ARROW_STRIP: i32 = 12;
    /// Draw or replace.
    pub const ADD: i32 = 0;
    /// Same as ADD.
    pub const MODIFY: i32 = 0;
    /// Remove this one.
    pub const DELETE: i32 = 2;
    /// Remove all, or all of ns where it is set.
    pub const DELETEALL: i32 = 3;
}

/// Markers that take effect together.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MarkerArray {
    /// In the order of their effect.
    pub markers: Vec<Marker>,
}
