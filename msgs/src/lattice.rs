//! Messages of Lattice; `msg/LatticeMap.msg` defines the encoding of the keys.

use serde::{Deserialize, Serialize};
use serde_bytes::ByteBuf;

use crate::geographic_msgs::GeoPoint;
use crate::geometry_msgs::{Point, Pose};
use crate::interface::{messages, services};
use crate::std_msgs::Header;

messages! {
    "lattice_msgs" in "../msg/";
    LatticeInfo [Pose, GeoPoint];
    LatticeMap [Header, LatticeInfo];
    LatticeMapUpdate [Header, LatticeInfo];
}

services! {
    "lattice_msgs" in "../srv/";
    SaveMap: SaveMapRequest [], SaveMapResponse [];
    LoadMap: LoadMapRequest [], LoadMapResponse [];
    ClearBox: ClearBoxRequest [Point], ClearBoxResponse [];
    QueryMap: QueryMapRequest [Point], QueryMapResponse [Point];
    PlanPath: PlanPathRequest [Point], PlanPathResponse [Point];
}

/// Lattice of a map, and its pose in the map frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LatticeInfo {
    /// Name of the lattice: cubic, bcc, fcc, mcc, hex, hexopt or custom.
    pub lattice: String,
    /// Volume of one cell, m³.
    pub cell_volume_m3: f64,
    /// Generator matrix, 3 x 3, row-major, m; its columns are the basis vectors.
    pub generator: [f64; 9],
    /// Pose of the lattice in the map frame; its position is the datum of the keys, m.
    pub map_from_lattice: Pose,
    /// Geodetic origin of the map frame (east-north-up).
    pub origin: GeoPoint,
    /// True if the origin is known.
    pub has_origin: bool,
    /// Epoch, which changes when the map is reset; sequences count within an epoch.
    pub epoch: u64,
}

/// Keyframe: the whole voxel map at one sequence number, or one chunk of it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LatticeMap {
    /// Stamp of the last point, and frame of the map.
    pub header: Header,
    /// Lattice of the map.
    pub info: LatticeInfo,
    /// Sequence number of the state, the same in all chunks.
    pub sequence: u64,
    /// Number of the chunk, from 0.
    pub chunk: u32,
    /// Number of chunks of this state.
    pub chunks: u32,
    /// Number of voxels in all chunks.
    pub voxels_total: u64,
    /// Encoding of the keys, such as `KEY_ENCODING_MORTON21`.
    pub key_encoding: String,
    /// Number of voxels in this chunk.
    pub voxels: u32,
    /// Lattice indices of the voxels: Morton keys, ascending, as LEB128 differences, the first absolute.
    pub keys: ByteBuf,
    /// Number of points in each voxel; empty if not kept.
    pub counts: Vec<u32>,
    /// Unit of `mean_offsets`, m.
    pub offset_unit_m: f64,
    /// Mean of the points minus cell centre (x, y, z) of each voxel, in `offset_unit_m`; empty if not kept.
    pub mean_offsets: Vec<i16>,
    /// Most frequent label of each voxel, 65535 if none; empty if not kept.
    pub labels: Vec<u16>,
    /// Number of points with that label in each voxel; empty if not kept.
    pub label_counts: Vec<u32>,
    /// Checksum of all updates of the epoch up to the sequence, as the text of LatticeMapUpdate defines it.
    pub history_checksum: u64,
}

impl LatticeMap {
    /// Encoding of the full form: ascending Morton keys as LEB128 differences. The thin form of `viewer_server` has
    /// another.
    pub const KEY_ENCODING_MORTON21: &'static str = "morton21_delta_leb128";
}

/// Update (delta): the voxels that differ between two states of a map, or one chunk of them.
///
/// A listed voxel replaces that of the map.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LatticeMapUpdate {
    /// Stamp of the last point, and frame of the map.
    pub header: Header,
    /// Lattice of the map.
    pub info: LatticeInfo,
    /// Sequence number of the state to which the update applies.
    pub previous_sequence: u64,
    /// Sequence number after all chunks are applied.
    pub sequence: u64,
    /// Number of the chunk, from 0.
    pub chunk: u32,
    /// Number of chunks of this update.
    pub chunks: u32,
    /// Encoding of the keys, such as `KEY_ENCODING_MORTON21`.
    pub key_encoding: String,
    /// Number of changed voxels in this chunk.
    pub voxels: u32,
    /// Lattice indices of the changed voxels: Morton keys, ascending, as LEB128 differences, the first absolute.
    pub keys: ByteBuf,
    /// Number of points in each voxel; empty if not kept.
    pub counts: Vec<u32>,
    /// Unit of `mean_offsets`, m.
    pub offset_unit_m: f64,
    /// Mean of the points minus cell centre (x, y, z) of each voxel, in `offset_unit_m`; empty if not kept.
    pub mean_offsets: Vec<i16>,
    /// Most frequent label of each voxel, 65535 if none; empty if not kept.
    pub labels: Vec<u16>,
    /// Number of points with that label in each voxel; empty if not kept.
    pub label_counts: Vec<u32>,
    /// Number of removed voxels.
    pub removed: u32,
    /// Lattice indices of the removed voxels, encoded as `keys`.
    pub removed_keys: ByteBuf,
    /// Number of voxels of the map after all chunks are applied.
    pub voxels_total: u64,
    /// Checksum of all updates of the epoch, this one included.
    pub history_checksum: u64,
}

impl LatticeMapUpdate {
    /// Encoding of the full form: ascending Morton keys as LEB128 differences. The thin form of `viewer_server` has
    /// another.
    pub const KEY_ENCODING_MORTON21: &'static str = "morton21_delta_leb128";
}

/// Writes the map to a file below the folder `map_dir` of the node.
#[derive(Clone, Copy, Debug)]
pub struct SaveMap;

/// Request of [`SaveMap`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SaveMapRequest {
    /// File name below `map_dir`; an existing map is replaced once the new one is complete.
    pub path: String,
}

/// Response of [`SaveMap`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SaveMapResponse {
    /// True if the call succeeded.
    pub success: bool,
    /// Explanation of the result.
    pub message: String,
    /// Number of voxels in the file.
    pub voxels: u64,
}

/// Replaces the map by that of a file, which must be of the same lattice.
#[derive(Clone, Copy, Debug)]
pub struct LoadMap;

/// Request of [`LoadMap`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LoadMapRequest {
    /// Name of a map file below `map_dir`.
    pub path: String,
}

/// Response of [`LoadMap`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LoadMapResponse {
    /// True if the map was loaded; otherwise it is unchanged.
    pub success: bool,
    /// Explanation of the result.
    pub message: String,
    /// Number of voxels of the loaded map.
    pub voxels: u64,
}

/// Removes the voxels whose centres lie in a box along the axes of the map frame.
#[derive(Clone, Copy, Debug)]
pub struct ClearBox;

/// Request of [`ClearBox`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ClearBoxRequest {
    /// Lower corner in the map frame, m.
    pub min: Point,
    /// Upper corner in the map frame, m.
    pub max: Point,
}

/// Response of [`ClearBox`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ClearBoxResponse {
    /// True if the call succeeded.
    pub success: bool,
    /// Explanation of the result.
    pub message: String,
    /// Number of removed voxels.
    pub removed: u64,
}

/// Query of the occupied cells around a point.
#[derive(Clone, Copy, Debug)]
pub struct QueryMap;

/// Request of [`QueryMap`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct QueryMapRequest {
    /// Position in the map frame, m.
    pub point: Point,
}

/// Response of [`QueryMap`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct QueryMapResponse {
    /// True if the query was answered; otherwise `message` has the reason.
    pub success: bool,
    /// Explanation of the result.
    pub message: String,
    /// True if the cell of the point is occupied.
    pub occupied: bool,
    /// Number of points in this cell; 0 if the map does not count them (`payload: occupancy`).
    pub points: u32,
    /// True unless the map is empty.
    pub has_nearest: bool,
    /// Distance from the point to the nearest occupied cell, m; 0 inside it.
    pub clearance_m: f64,
    /// Nearest centre of an occupied cell in the map frame, m.
    pub nearest: Point,
    /// Distance from the point to this centre, m.
    pub nearest_distance_m: f64,
}

/// Query of the shortest path of a ball that touches no occupied cell of the map.
#[derive(Clone, Copy, Debug)]
pub struct PlanPath;

/// Request of [`PlanPath`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PlanPathRequest {
    /// Start in the map frame, m.
    pub start: Point,
    /// Goal in the map frame, m.
    pub goal: Point,
    /// Radius of the ball, m.
    pub radius_m: f64,
    /// Distance by which start and goal may be moved to a position where the ball fits, m.
    pub tolerance_m: f64,
}

/// Response of [`PlanPath`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PlanPathResponse {
    /// True if a path was found; otherwise `message` has the reason.
    pub success: bool,
    /// Explanation of the result.
    pub message: String,
    /// Length of the path, m.
    pub length_m: f64,
    /// Centres of the cells of the path, from start to goal, in the map frame, m.
    pub path: Vec<Point>,
}
