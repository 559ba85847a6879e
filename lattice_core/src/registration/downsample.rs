//! Voxel downsampling: the mean of each cubic cell.

use nalgebra::{Point3, Vector3};

use super::{LabelDistribution, SemanticCloud, UNLABELED};

/// Largest absolute cell index along each axis.
const MAX_INDEX: f64 = (1 << 20) as f64;
/// Distance of the median of a cloud from the origin from which indices start at the median, in cells.
const FAR: f64 = MAX_INDEX / 2.0;

/// Mean point and mean label distribution of each cubic cell, in the order of the cells.
///
/// Cells have a corner at the origin, as in small_gicp's `voxelgrid_sampling`. Indices start at the median of the
/// cloud if it is far from the origin. Points that are not finite or beyond 2^20 cells are dropped. The cloud is
/// returned unchanged if `cell_side_m` is not positive.
pub fn voxel_downsample(cloud: &SemanticCloud, cell_side_m: f64) -> SemanticCloud {
    if cell_side_m.is_nan() || cell_side_m <= 0.0 {
        return cloud.clone();
    }
    let first = first_cell(cloud, cell_side_m);
    let cell = |(index, p): (usize, &Point3<f64>)| {
        let w = p.coords.map(|c| (c / cell_side_m).floor()) - first;
        let near = w.iter().all(|w| w.abs() < MAX_INDEX);
        let [x, y, z] = [w.x, w.y, w.z].map(|w| (w + MAX_INDEX) as u64);
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

/// Origin of the cell indices: zero, or the cell of the median along axes on which it is far.
fn first_cell(cloud: &SemanticCloud, cell_side_m: f64) -> Vector3<f64> {
    Vector3::from_fn(|axis, _| {
        let coordinate = |p: &Point3<f64>| p.coords.get(axis).copied();
        let finite = cloud.points_m.iter().filter_map(coordinate);
        let mut values: Vec<f64> = finite.filter(|c| c.is_finite()).collect();
        let middle = values.len() / 2;
        if middle >= values.len() {
            return 0.0;
        }
        let (_, median, _) = values.select_nth_unstable_by(middle, f64::total_cmp);
        let cell = (*median / cell_side_m).floor();
        // Beyond 2^53 cells, adjacent cells are not distinguished.
        let is_far = cell.abs() >= FAR && cell.abs() < 9e15;
        if is_far { cell } else { 0.0 }
    })
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

    #[test]
    fn cells_far_from_the_origin_are_those_about_it() {
        // Inverse of the plastic number: no point lies on a side of a cell.
        const A: f64 = 0.819_172_513_396_164_5;
        let place = |i: u32, by: f64| 50.0 * (f64::from(i + 1) * by).fract();
        let near: Vec<Point3<f64>> = (0..2000)
            .map(|i| Point3::new(place(i, A), place(i, A * A), place(i, A * A * A)))
            .collect();
        let thin = |points_m: Vec<Point3<f64>>| {
            voxel_downsample(&SemanticCloud::unlabelled(points_m), 0.5)
        };
        let expected = thin(near.clone());
        // Whole cells away: some, as UTM, and 10,000 km.
        for far_m in [[2e5, -1e3, 0.0], [448e3, 5_411e3, 300.0], [1e7, -1e7, 0.5]] {
            let far_m = Vector3::from(far_m);
            let thinned = thin(near.iter().map(|p| p + far_m).collect());
            assert_eq!(thinned.len(), expected.len(), "{far_m:?}");
            for (point, expected) in thinned.points_m.iter().zip(&expected.points_m) {
                assert!((point - far_m - expected).norm() < 1e-7, "{far_m:?}");
            }
        }
    }
}
