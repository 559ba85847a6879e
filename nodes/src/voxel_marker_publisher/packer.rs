//! Markers in arrays of bounded size.

use lattice_msgs::geometry_msgs::Pose;
use lattice_msgs::std_msgs::Header;
use lattice_msgs::visualization_msgs::{Marker, MarkerArray};

/// Namespace of all markers.
pub(super) const NAMESPACE: &str = "voxels";
/// Serialized bytes of a marker besides points and colours, and of an array besides its markers.
pub(super) const OVERHEAD_BYTES: usize = 256;

/// Delete marker without points.
pub(super) fn bare(header: &Header, id: i32, action: i32) -> Marker {
    let mut pose = Pose::default();
    pose.orientation.w = 1.0;
    Marker {
        header: header.clone(),
        ns: NAMESPACE.to_owned(),
        id,
        action,
        pose,
        ..Marker::default()
    }
}

/// Serialized bytes of a marker, rounded up.
pub(super) fn marker_bytes(marker: &Marker) -> usize {
    OVERHEAD_BYTES
        + marker.header.frame_id.len()
        + marker.points.len() * 24
        + marker.colors.len() * 16
}

/// Packs markers into arrays of bounded size.
pub(super) struct Packer {
    chunk_bytes: usize,
    open: MarkerArray,
    open_bytes: usize,
    /// Bytes of all markers so far.
    pub total_bytes: usize,
}

impl Packer {
    pub(super) fn new(chunk_bytes: usize) -> Self {
        Self {
            chunk_bytes,
            open: MarkerArray::default(),
            open_bytes: 0,
            total_bytes: 0,
        }
    }

    pub(super) fn push(&mut self, marker: Marker, arrays: &mut Vec<MarkerArray>) {
        let bytes = marker_bytes(&marker);
        if self.open_bytes + bytes > self.chunk_bytes {
            self.finish(arrays);
        }
        self.open_bytes += bytes;
        self.total_bytes += bytes;
        self.open.markers.push(marker);
    }

    pub(super) fn finish(&mut self, arrays: &mut Vec<MarkerArray>) {
        if !self.open.markers.is_empty() {
            arrays.push(std::mem::take(&mut self.open));
        }
        self.open_bytes = 0;
    }
}
