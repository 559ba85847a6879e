//! A labelled flat as a robot and a headset send it.

use lattice_core::registration::SemanticCloud;
pub use lattice_lab::simulate::rooms::Flat;
use lattice_msgs::sensor_msgs::PointCloud2;
use nalgebra::Vector3;

use crate::clouds::labelled_cloud;

/// Points every 3 cm on all surfaces, in `map`, as a robot sends them to the mapper.
pub fn map_cloud(flat: &Flat, stamp_ns: i64) -> PointCloud2 {
    let points = flat.points(0.03).into_iter();
    let points: Vec<_> = points.map(|(p, label)| (p.cast().into(), label)).collect();
    labelled_cloud("map", stamp_ns, &points)
}

/// A scan as the headset sends it, after `axes` has been applied to each point.
pub fn headset_cloud(
    look: &SemanticCloud,
    stamp_ns: i64,
    axes: impl Fn(Vector3<f64>) -> Vector3<f64>,
) -> PointCloud2 {
    let point = |i: usize| {
        let p = axes(look.points_m[i].coords);
        let label = look.label(i).top().unwrap_or(u16::MAX);
        ([p.x as f32, p.y as f32, p.z as f32], label)
    };
    let points: Vec<_> = (0..look.len()).map(point).collect();
    labelled_cloud("headset_origin", stamp_ns, &points)
}
