//! Meshes received as markers.

use lattice_msgs::lattice::HeadsetMesh;
use lattice_msgs::visualization_msgs::Marker;

/// Prefix of the names of marker surfaces.
pub(super) const MARKERS: &str = "marker:";

/// Interpretation of a marker.
pub(super) enum FromMarker {
    /// A new or removed surface.
    Surface(HeadsetMesh),
    /// Surfaces with this prefix are removed.
    RemoveAll(String),
    /// Not a mesh.
    Refused(&'static str, &'static str),
}

/// Interprets a marker; type TRIANGLE_LIST is a surface.
pub(super) fn from_marker(marker: &Marker) -> FromMarker {
    let surface = format!("{MARKERS}{}/{}", marker.ns, marker.id);
    if marker.action == Marker::DELETEALL {
        return FromMarker::RemoveAll(match marker.ns.is_empty() {
            true => MARKERS.to_owned(),
            false => format!("{MARKERS}{}/", marker.ns),
        });
    }
    let removed = marker.action == Marker::DELETE;
    let scale = [marker.scale.x, marker.scale.y, marker.scale.z];
    if !removed && marker.type_ != Marker::TRIANGLE_LIST {
        return FromMarker::Refused("type", "the marker type is not TRIANGLE_LIST");
    }
    if !removed && !scale.iter().all(|v| *v > 0.0 && v.is_finite()) {
        return FromMarker::Refused("malformed", "the scale of a marker is not above 0");
    }
    let [x, y, z] = scale;
    let points = marker.points.iter();
    let vertices = points.flat_map(|p| [(p.x * x) as f32, (p.y * y) as f32, (p.z * z) as f32]);
    FromMarker::Surface(HeadsetMesh {
        header: marker.header.clone(),
        surface,
        removed,
        chunks: 1,
        pose: marker.pose,
        vertices: vertices.collect(),
        triangles: (0..).take(marker.points.len()).collect(),
        ..HeadsetMesh::default()
    })
}
