//! Surroundings of a headset as it sends them; `msg/HeadsetMesh.msg` says how surfaces are sent in chunks.

use serde::{Deserialize, Serialize};

use crate::geometry_msgs::Pose;
use crate::interface::messages;
use crate::std_msgs::Header;

messages! {
    "lattice_msgs" in "../msg/";
    HeadsetMesh [Header, Pose];
}

/// Surface of a headset's mesh, a chunk of one, or its removal.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct HeadsetMesh {
    /// Time of this state of the surface, and frame: the origin of the headset.
    pub header: Header,
    /// Session of the headset: another session means another origin, and removes all surfaces; may be empty.
    pub session: String,
    /// Name of the surface.
    pub surface: String,
    /// True if the surface is removed; the fields below are then empty.
    pub removed: bool,
    /// Number of the chunk, from 0.
    pub chunk: u32,
    /// Number of chunks of this state of the surface.
    pub chunks: u32,
    /// `frame_from_surface`, the same in all chunks.
    pub pose: Pose,
    /// Coordinates x, y, z of each vertex in the axes of the surface, m.
    pub vertices: Vec<f32>,
    /// Three vertex indices per triangle.
    pub triangles: Vec<u32>,
    /// Class of each triangle, 65535 without a class; empty in all chunks if unknown.
    pub classes: Vec<u16>,
}
