//! Point cloud with label distributions.

use nalgebra::Point3;

use super::LabelDistribution;
use crate::voxels::VoxelList;

/// Point cloud with label distributions, in a frame defined by its owner.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct SemanticCloud {
    /// Points, metres.
    pub points_m: Vec<Point3<f64>>,
    /// Label distributions: one per point, or none if the cloud is unlabelled.
    pub labels: Vec<LabelDistribution>,
}

impl SemanticCloud {
    /// Creates an unlabelled cloud.
    pub fn unlabelled(points_m: Vec<Point3<f64>>) -> SemanticCloud {
        SemanticCloud {
            points_m,
            labels: Vec::new(),
        }
    }

    /// Creates a cloud of the voxel centroids of a map with the fractions of their labels, in key order.
    pub fn from_voxels(list: &VoxelList) -> SemanticCloud {
        let labelled = list.payload().labels;
        let mut cloud = SemanticCloud::default();
        for (key, voxel) in list.sorted() {
            let centroid = list.center_m(key) + nalgebra::Vector3::from(voxel.mean_offset_m());
            cloud.points_m.push(centroid.into());
            if labelled {
                let counts = list.labels(key);
                let weights = counts.iter().map(|l| (l.label, l.count as f32));
                cloud.labels.push(LabelDistribution::from_weights(weights));
            }
        }
        cloud
    }

    /// Keeps the points for which `is_kept` is true, with their labels.
    pub fn retain(&mut self, is_kept: impl Fn(&Point3<f64>) -> bool) {
        let kept: Vec<bool> = self.points_m.iter().map(is_kept).collect();
        let mut of_point = kept.iter().copied();
        let mut of_label = kept.iter().copied();
        self.points_m
            .retain(|_| of_point.next().unwrap_or_default());
        self.labels.retain(|_| of_label.next().unwrap_or_default());
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.points_m.len()
    }

    /// Tests whether there are no points.
    pub fn is_empty(&self) -> bool {
        self.points_m.is_empty()
    }

    /// Label distribution of point `i`.
    pub fn label(&self, i: usize) -> LabelDistribution {
        let label = self.labels.get(i).copied();
        label.unwrap_or(LabelDistribution::UNKNOWN)
    }
}
