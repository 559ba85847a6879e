//! Points with normals and a k-d tree: a whole cloud, or one class of it.

use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

use super::plane;
use crate::kd_tree::{Item, Neighbors, Tree};

/// Points per parallel task.
const CHUNK: usize = 512;
/// Factor above the rounding error of a sum of distances.
const SLACK: f64 = 1.0 + 1e-12;

/// Points in the order of their tree, with the normals of their neighbourhoods.
pub(crate) struct Surface {
    pub points_m: Vec<Point3<f64>>,
    pub normals: Vec<Vector3<f64>>,
    /// Index of each point in the input.
    pub order: Vec<u32>,
    pub tree: Tree,
}

impl Surface {
    /// Builds the tree and the normals from the `neighbors` nearest points of each finite point.
    pub fn new(points_m: &[Point3<f64>], neighbors: usize) -> Surface {
        let item = |(index, p): (u32, &Point3<f64>)| Item {
            coords_m: [p.x, p.y, p.z],
            index,
        };
        let mut items: Vec<Item> = (0..).zip(points_m).map(item).collect();
        let tree = Tree::build(&mut items);
        let points_m: Vec<Point3<f64>> = items.iter().map(|i| i.coords_m.into()).collect();
        Surface {
            normals: normals(&tree, &points_m, neighbors),
            order: items.iter().map(|i| i.index).collect(),
            points_m,
            tree,
        }
    }
}

/// Computes the normals.
///
/// Consecutive points are close, so the neighbours of the last point bound the search radius of the next one.
fn normals(tree: &Tree, points_m: &[Point3<f64>], neighbors: usize) -> Vec<Vector3<f64>> {
    let mut normals = vec![Vector3::zeros(); points_m.len()];
    let chunks = normals
        .par_chunks_mut(CHUNK)
        .zip(points_m.par_chunks(CHUNK));
    chunks.for_each(|(normals, points)| {
        let mut found = Neighbors::default();
        let mut last: Option<(&Point3<f64>, f64)> = None;
        for (normal, point) in normals.iter_mut().zip(points) {
            let reach_m = last.map_or(f64::INFINITY, |(last, farthest)| {
                (farthest.sqrt() + nalgebra::distance(last, point)) * SLACK
            });
            found.start(neighbors, reach_m * reach_m);
            tree.search(point, &mut found);
            last = found.farthest_of(neighbors).map(|squared| (point, squared));
            let around = found.indices().iter().map(|&i| points_m[i as usize]);
            *normal = plane::normal(&plane::scatter(around));
        }
    });
    normals
}
