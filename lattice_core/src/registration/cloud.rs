//! Points with labels.

use nalgebra::Point3;

use super::LabelDistribution;
use crate::voxels::VoxelList;

/// Points with what is known of their classes, in a frame that the holder names.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct SemanticCloud {
    /// Points, metres.
    pub points_m: Vec<Point3<f64>>,
    /// Label distributions, one for each point, or none at all if nothing is known of any.
    pub labels: Vec<LabelDistribution>,
}

impl SemanticCloud {
    /// Points without labels.
    pub fn unlabelled(points_m: Vec<Point3<f64>>) -> SemanticCloud {
        SemanticCloud {
            points_m,
            labels: Vec::new(),
        }
    }

    /// The centroid of each voxel of a map with the shares of its labels, in the map frame, in the
    /// order of the keys.
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

    /// Keeps the points of which something holds, with their labels.
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

    /// True if there is no point.
    pub fn is_empty(&self) -> bool {
        self.points_m.is_empty()
    }

    /// Label distribution of point `i`.
    pub fn label(&self, i: usize) -> LabelDistribution {
        let label = self.labels.get(i).copied();
        label.unwrap_or(LabelDistribution::UNKNOWN)
    }
}
