//! Voxel downsampling: the mean of each cubic cell.

use nalgebra::{Point3, Vector3};

use super::{LabelDistribution, SemanticCloud, UNLABELED};

/// Cells are numbered from minus to plus this along each axis.
const MOST: f64 = (1 << 20) as f64;

/// The mean point and the mean label distribution of each cubic cell, in the order of the cells.
///
/// Cells have a corner at the origin, as those of small_gicp's `voxelgrid_sampling`. Points that are not
/// finite or over a million cells away are left out; a side that is not over 0 leaves all as it is.
pub fn voxel_downsample(cloud: &SemanticCloud, cell_side_m: f64) -> SemanticCloud {
    if cell_side_m.is_nan() || cell_side_m <= 0.0 {
        return cloud.clone();
    }
    let cell = |(index, p): (usize, &Point3<f64>)| {
        let w = p.coords.map(|c| (c / cell_side_m).floor());
        let near = w.iter().all(|w| w.abs() < MOST);
        let [x, y, z] = [w.x, w.y, w.z].map(|w| (w + MOST) as u64);
        near.then_some((z << 42 | y << 21 | x, index))
    };
    let points = cloud.points_m.iter().enumerate();
    let mut cells: Vec<(u64, usize)> = points.filter_map(cell).collect();
    cells.sort_unstable();
    let mut thinned = SemanticCloud::default();
    for of_cell in cells.chunk_by(|a, b| a.0 == b.0) {
        let members = of_cell.iter().map(|(_, index)| *index);
        thinned.points_m.push(mean_point(cloud, members.clone()));
        if !cloud.labels.is_empty() {
            thinned.labels.push(mean_label(cloud, members));
        }
    }
    thinned
}

fn mean_point(cloud: &SemanticCloud, members: impl ExactSizeIterator<Item = usize>) -> Point3<f64> {
    let count = members.len() as f64;
    let points = members.filter_map(|i| cloud.points_m.get(i));
    let sum: Vector3<f64> = points.map(|p| p.coords).sum();
    (sum / count).into()
}

fn mean_label(
    cloud: &SemanticCloud,
    members: impl ExactSizeIterator<Item = usize>,
) -> LabelDistribution {
    let share = 1.0 / members.len() as f32;
    let mut sums: Vec<(u16, f32)> = Vec::new();
    for i in members {
        let label = cloud.label(i);
        let classes = label.iter().chain([(UNLABELED, label.unknown())]);
        for (class, weight) in classes {
            match sums.iter_mut().find(|(c, _)| *c == class) {
                Some((_, sum)) => *sum += share * weight,
                None => sums.push((class, share * weight)),
            }
        }
    }
    LabelDistribution::from_weights(sums)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cell_keeps_the_mean_point_and_the_mean_label() {
        let cloud = SemanticCloud {
            points_m: vec![
                Point3::new(0.9, 0.1, 0.1),
                Point3::new(-0.1, 0.0, 0.0),
                Point3::new(0.1, 0.3, 0.5),
                Point3::new(f64::NAN, 0.0, 0.0),
                Point3::new(1e9, 0.0, 0.0),
            ],
            labels: vec![
                LabelDistribution::hard(3),
                LabelDistribution::hard(5),
                LabelDistribution::from_weights([(3, 0.25), (4, 0.25)]),
                LabelDistribution::UNKNOWN,
                LabelDistribution::UNKNOWN,
            ],
        };
        let thinned = voxel_downsample(&cloud, 1.0);
        let expected = [Point3::new(-0.1, 0.0, 0.0), Point3::new(0.5, 0.2, 0.3)];
        assert_eq!(thinned.len(), 2);
        for (point, expected) in thinned.points_m.iter().zip(expected) {
            assert!(nalgebra::distance(point, &expected) < 1e-15);
        }
        let label: Vec<_> = thinned.label(1).iter().collect();
        assert_eq!(label, [(3, 0.625), (4, 0.125)]);
        assert_eq!(thinned.label(1).unknown(), 0.25);
        assert_eq!(voxel_downsample(&cloud, 0.0).len(), 5);
        assert!(voxel_downsample(&SemanticCloud::default(), 1.0).is_empty());
    }
}
