//! The map that the robot would make if it knew all classes, and how far another is like it.

use lattice_core::voxels::VoxelList;
use nalgebra::{Isometry3, Point3, Vector3};
use serde::Serialize;

use crate::simulate::house::RoomCamera;

/// Inserts a view with its true labels.
pub(super) fn insert(
    truth: &mut VoxelList,
    camera: &RoomCamera,
    map_from_camera: &Isometry3<f64>,
    depth_m: &[f32],
    labels: &[u16],
) {
    let mut offsets_m = Vec::new();
    let mut kept = Vec::new();
    for (pixel, (depth_m, label)) in depth_m.iter().zip(labels).enumerate() {
        if *depth_m <= 0.0 {
            continue;
        }
        let ray = camera.ray(pixel % camera.width, pixel / camera.width);
        let point_m = map_from_camera * Point3::from(ray * f64::from(*depth_m));
        offsets_m.push(point_m.coords.cast::<f32>().into());
        kept.push(*label);
    }
    truth.insert_offsets(0, Vector3::zeros(), &offsets_m, &kept);
}

/// Voxels of a map by whether their most frequent class is the true one.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize)]
pub struct LabelAccuracy {
    /// Voxels of both maps that have a class in both.
    pub compared: usize,
    /// Those of the true class.
    pub right: usize,
}

impl LabelAccuracy {
    /// Share of the true class, 0 to 1; NaN where nothing was compared.
    pub fn share(&self) -> f64 {
        self.right as f64 / self.compared as f64
    }
}

/// Compares the classes of a map with the true ones, of the same lattice.
pub fn label_accuracy(map: &VoxelList, truth: &VoxelList) -> LabelAccuracy {
    let mut accuracy = LabelAccuracy::default();
    for (key, _) in map.sorted() {
        let [found, true_class] = [map, truth].map(|list| list.label(key).map(|l| l.label));
        if let (Some(found), Some(true_class)) = (found, true_class) {
            accuracy.compared += 1;
            accuracy.right += usize::from(found == true_class);
        }
    }
    accuracy
}
