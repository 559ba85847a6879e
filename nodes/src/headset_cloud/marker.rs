//! Meshes that come as markers.

use lattice_msgs::headset::HeadsetMesh;
use lattice_msgs::visualization_msgs::Marker;

/// Beginning of the names of surfaces that are markers.
pub(super) const MARKERS: &str = "marker:";

/// Meaning of a marker.
pub(super) enum FromMarker {
    /// A surface, or word that it is gone.
    Surface(HeadsetMesh),
    /// The surfaces with such names are gone.
    RemoveAll(String),
    /// Nothing that is a mesh.
    Refused(&'static str, &'static str),
}

/// A marker of type TRIANGLE_LIST as a surface.
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
        return FromMarker::Refused("type", "a marker that is no TRIANGLE_LIST");
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
