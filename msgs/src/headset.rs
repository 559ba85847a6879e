//! Surroundings of a headset as it sends them; `msg/HeadsetMesh.msg` says how surfaces are sent in chunks.

use serde::{Deserialize, Serialize};

use crate::geometry_msgs::Pose;
use crate::interface::messages;
use crate::std_msgs::Header;

messages! {
    "lattice_msgs" in "../msg/";
    HeadsetMesh [Header, Pose];
}

/// One surface of a headset's mesh, or one chunk of it, or word that it is gone.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct HeadsetMesh {
    /// Time of this state of the surface, and frame: the origin of the headset.
    pub header: Header,
    /// Of the headset: another one means another origin, and all surfaces are gone; may be empty.
    pub session: String,
    /// Name of the surface.
    pub surface: String,
    /// True: the surface is gone, and what follows is left out.
    pub removed: bool,
    /// Number of this chunk, from 0.
    pub chunk: u32,
    /// Chunks of this state of the surface.
    pub chunks: u32,
    /// `frame_from_surface`, the same in all chunks.
    pub pose: Pose,
    /// X, y, z of each vertex in the axes of the surface, m.
    pub vertices: Vec<f32>,
    /// Three vertices of each triangle.
    pub triangles: Vec<u32>,
    /// Class of each triangle, 65535 if none; empty in all chunks: not known.
    pub classes: Vec<u16>,
}
