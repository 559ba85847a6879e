//! Ray casting on a mesh.

use super::{LabelledMesh, MeshError};
use nalgebra::{Point3, Vector3};
use obvhs::BvhBuildParams;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::bvh2_to_cwbvh::bvh2_to_cwbvh;
use obvhs::ploc::PlocBuilder;
use obvhs::ray::{Ray, RayHit};
use obvhs::triangle::Triangle;
use rustc_hash::FxHashSet;

/// Depth limit of the traversal stack.
const MAX_DEPTH: u32 = 31;

/// First triangle hit by a ray.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct MeshHit {
    /// Distance from the ray origin, m.
    pub distance_m: f64,
    /// Index in the mesh.
    pub triangle: usize,
}

/// Mesh with a bounding volume hierarchy of eight children per node (Ylitie, Karras &
/// Laine 2017, by the crate `obvhs`). Both sides of a triangle are hit.
pub struct MeshScene {
    bvh: CwBvh,
    /// Triangles in leaf order.
    triangles: Vec<Triangle>,
    /// Indices of the triangles in the mesh.
    numbers: Vec<u32>,
}

impl MeshScene {
    /// Builds the hierarchy; 145 000 triangles take some 0.2 s.
    ///
    /// Fails if the hierarchy exceeds the depth limit.
    pub fn new(mesh: &LabelledMesh) -> Result<MeshScene, MeshError> {
        MeshScene::build(mesh, &BvhBuildParams::medium_build())
    }

    /// Builds the hierarchy for few rays: faster to build, slower to cast.
    pub fn new_fast(mesh: &LabelledMesh) -> Result<MeshScene, MeshError> {
        MeshScene::build(mesh, &BvhBuildParams::very_fast_build())
    }

    fn build(mesh: &LabelledMesh, params: &BvhBuildParams) -> Result<MeshScene, MeshError> {
        let (mut triangles, mut numbers) = (Vec::new(), Vec::new());
        // Equal triangles would make the tree deep, and flat ones are never hit.
        let mut seen = FxHashSet::default();
        for (number, corners) in (0..).zip(mesh.corners_m()) {
            let [v0, v1, v2] = corners.map(Into::into);
            let triangle = Triangle { v0, v1, v2 };
            let normal = (v1 - v0).cross(v2 - v0);
            if normal.length_squared() > 0.0 && seen.insert(corners.map(|p| p.map(f32::to_bits))) {
                triangles.push(triangle);
                numbers.push(number);
            }
        }
        let mut bvh = PlocBuilder::with_capacity(triangles.len()).build(
            params.ploc_search_distance,
            &triangles,
            (0..triangles.len() as u32).collect(),
            params.sort_precision,
            params.search_depth_threshold,
        );
        ReinsertionOptimizer::default().run(&mut bvh, params.reinsertion_batch_ratio, None);
        let bvh = bvh2_to_cwbvh(&bvh, params.max_prims_per_leaf.clamp(1, 3), true, false);
        let depth = depth(&bvh);
        if depth > MAX_DEPTH {
            return Err(MeshError::Nested { depth });
        }
        let sorted = bvh.primitive_indices.iter().map(|&i| i as usize);
        Ok(MeshScene {
            triangles: sorted.clone().map(|i| triangles[i]).collect(),
            numbers: sorted.map(|i| numbers[i]).collect(),
            bvh,
        })
    }

    /// Nearest triangle hit by a ray within `max_m` of its origin, in the frame of the mesh.
    ///
    /// Computed in f32, with an error of some 1e-5 m in a house. `None` also for a ray that is not finite or
    /// has no direction.
    pub fn cast(
        &self,
        origin_m: &Point3<f64>,
        direction: &Vector3<f64>,
        max_m: f64,
    ) -> Option<MeshHit> {
        // The traversal treats negative zero inconsistently.
        let direction = direction.try_normalize(1e-12)?;
        let direction = direction.map(|c| c as f32 + 0.0);
        let origin = origin_m.coords.cast::<f32>();
        let finite = (direction.iter().chain(origin.iter())).all(|c| c.is_finite());
        if self.triangles.is_empty() || !finite || max_m.is_nan() || max_m <= 0.0 {
            return None;
        }
        let [origin, direction]: [[f32; 3]; 2] = [origin.into(), direction.into()];
        let ray = Ray::new(origin.into(), direction.into(), 0.0, max_m as f32);
        let mut hit = RayHit::none();
        let found = self.bvh.ray_traverse(ray, &mut hit, |ray, i| {
            let triangle = self.triangles.get(i);
            triangle.map_or(f32::INFINITY, |triangle| triangle.intersect(ray))
        });
        let triangle = self.numbers.get(hit.primitive_id as usize);
        Some(MeshHit {
            distance_m: f64::from(hit.t),
            triangle: *triangle.filter(|_| found)? as usize,
        })
    }
}

/// Depth of a tree.
fn depth(bvh: &CwBvh) -> u32 {
    let mut deepest = 0;
    let mut open = vec![(0, 1)];
    while let Some((number, depth)) = open.pop() {
        let Some(node) = bvh.nodes.get(number) else {
            continue;
        };
        deepest = deepest.max(depth);
        let inner = (0..8).filter(|&child| !node.is_child_empty(child) && !node.is_leaf(child));
        open.extend(inner.map(|child| (node.child_node_index(child) as usize, depth + 1)));
    }
    deepest
}

impl std::fmt::Debug for MeshScene {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "MeshScene({} triangles)", self.triangles.len())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Distance at which a ray hits a triangle: the plane in f64, then the sides.
    fn oracle_m(
        [a, b, c]: [[f32; 3]; 3],
        origin: &Point3<f64>,
        direction: &Vector3<f64>,
    ) -> Option<f64> {
        let [a, b, c] = [a, b, c].map(|p| Point3::from(p.map(f64::from)));
        let normal = (b - a).cross(&(c - a));
        let distance_m = normal.dot(&(a - origin)) / normal.dot(direction);
        let at = origin + direction * distance_m;
        let within = |(from, to): (Point3<f64>, Point3<f64>)| {
            (to - from).cross(&(at - from)).dot(&normal) >= 0.0
        };
        let inside = [(a, b), (b, c), (c, a)].into_iter().all(within);
        (inside && distance_m >= 0.0).then_some(distance_m)
    }

    fn mesh(triangles: &[[[f32; 3]; 3]]) -> LabelledMesh {
        let n = triangles.len() as u32;
        let numbers = (0..n).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let labels = vec![0; triangles.len()];
        LabelledMesh::new(triangles.concat(), numbers, labels.clone(), labels).unwrap()
    }

    proptest! {
        #[test]
        fn rays_hit_what_trying_all_triangles_finds(
            corners in prop::collection::vec(prop::array::uniform3(prop::array::uniform3(-5.0_f32..5.0)), 1..150),
            rays in prop::collection::vec((prop::array::uniform3(-6.0..6.0), prop::array::uniform3(-1.0..1.0)), 40),
            max_m in 1.0..20.0,
        ) {
            let mesh = mesh(&corners);
            for scene in [MeshScene::new(&mesh).unwrap(), MeshScene::new_fast(&mesh).unwrap()] {
                for (origin, direction) in &rays {
                    let (origin, direction) = (Point3::from(*origin), Vector3::from(*direction));
                    prop_assume!(direction.norm() > 0.1);
                    let direction = direction.normalize();
                    let hits = corners.iter().map(|t| oracle_m(*t, &origin, &direction));
                    let hits: Vec<f64> = hits.map(|h| h.unwrap_or(f64::INFINITY)).collect();
                    let nearest = hits.iter().copied().fold(f64::INFINITY, f64::min);
                    match scene.cast(&origin, &direction, max_m) {
                        Some(hit) => {
                            prop_assert!((hit.distance_m - nearest).abs() < 1e-3, "{hit:?} {nearest}");
                            prop_assert!((hits[hit.triangle] - nearest).abs() < 2e-3);
                        }
                        None => prop_assert!(nearest > max_m - 1e-3, "{nearest}"),
                    }
                }
            }
        }
    }

    #[test]
    fn both_sides_are_seen_and_nothing_beyond_the_end() {
        let triangle = [[0.0, -1.0, -1.0], [0.0, 1.0, -1.0], [0.0, 0.0, 1.0]];
        let scene = MeshScene::new(&mesh(&[triangle])).unwrap();
        for (x, step) in [(-2.0, 3.0), (2.0, -0.1)] {
            let (origin, direction) = (Point3::new(x, 0.0, 0.0), Vector3::x() * step);
            let hit = scene.cast(&origin, &direction, 5.0).unwrap();
            assert!((hit.distance_m - 2.0).abs() < 1e-6);
            assert_eq!(hit.triangle, 0);
            assert_eq!(scene.cast(&origin, &direction, 1.9), None);
        }
    }

    #[test]
    fn rays_along_the_axes_hit() {
        let wall = |axis: usize, far: f32| {
            let mut corners = [[0.0; 3]; 3];
            for (i, corner) in corners.iter_mut().enumerate() {
                corner[axis] = far;
                corner[(axis + 1) % 3] = [-9.0, 9.0, 0.0][i];
                corner[(axis + 2) % 3] = [-9.0, -9.0, 9.0][i];
            }
            corners
        };
        let walls = (0..3).flat_map(|axis| [wall(axis, -2.0), wall(axis, 3.0)]);
        let scene = MeshScene::new(&mesh(&walls.collect::<Vec<_>>())).unwrap();
        let origin = Point3::new(0.1, -0.2, 0.3);
        for axis in 0..3 {
            for (far, sign) in [(-2.0, -1.0), (3.0, 1.0)] {
                let direction = Vector3::from_fn(|i, _| if i == axis { 1.0 } else { 0.0 }) * sign;
                let hit = scene.cast(&origin, &direction, 9.0).unwrap();
                let expected = (far - origin[axis]) * sign;
                assert!((hit.distance_m - expected).abs() < 1e-5, "{hit:?}");
            }
        }
    }

    #[test]
    fn there_is_no_ray_that_panics() {
        let flat = [[1.0, 2.0, 3.0]; 3];
        for mesh in [mesh(&[]), mesh(&[flat; 100])] {
            let scene = MeshScene::new(&mesh).unwrap();
            for origin in [0.0, f64::NAN, 1e300] {
                for direction in [0.0, 1.0, f64::NAN, f64::INFINITY, 1e-300] {
                    for max_m in [0.0, -1.0, f64::NAN, f64::INFINITY] {
                        let origin = Point3::new(origin, 0.0, 0.0);
                        let direction = Vector3::new(direction, direction, 0.0);
                        assert_eq!(scene.cast(&origin, &direction, max_m), None);
                    }
                }
            }
        }
    }
    #[test]
    fn equal_triangles_are_one_and_nested_ones_are_refused_or_hit() {
        let triangle = [[0.0, -1.0, -1.0], [0.0, 1.0, -1.0], [0.0, 0.0, 1.0]];
        let scene = MeshScene::new(&mesh(&[triangle; 5000])).unwrap();
        assert_eq!(scene.triangles.len(), 1);
        let nested = |i: i32| triangle.map(|p| p.map(|c| c * 0.98_f32.powi(i)));
        let nested: Vec<_> = (0..2000).map(nested).collect();
        match MeshScene::new(&mesh(&nested)) {
            Ok(scene) => {
                let hit = scene.cast(&Point3::new(-1.0, 0.0, 0.9), &Vector3::x(), 5.0);
                assert!((hit.unwrap().distance_m - 1.0).abs() < 1e-6);
            }
            Err(error) => assert!(error.to_string().contains("levels deep")),
        }
    }
}
