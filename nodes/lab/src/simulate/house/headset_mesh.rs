//! The mesh that a headset makes of its surroundings: a truncated signed distance (Curless & Levoy
//! 1996) of depth views on coarse voxels, and the surface in it.

use super::camera::Image;
use super::warp::Warp;
use crate::AnyError;
use crate::mesh::LabelledMesh;
use crate::options::within;
use fast_surface_nets::ndshape::{RuntimeShape, Shape};
use fast_surface_nets::{SurfaceNetsBuffer, surface_nets};
use nalgebra::{Isometry3, Point3, Vector3};

/// Truncation of the distance in voxels.
const TRUNCATION_VOXELS: f64 = 2.5;
/// Most voxels along a side, and of all.
const MAX_SIDE: f64 = 400.0;
const MAX_VOXELS: f64 = 1.2e7;

/// A depth view from a pose.
pub(super) struct DepthView {
    pub(super) house_from_camera: Isometry3<f64>,
    pub(super) image: Image,
}

/// A box of voxels, house frame.
pub(super) struct Volume {
    low_m: Point3<f64>,
    voxel_m: f64,
    sides: [u32; 3],
}

impl Volume {
    /// The box from one corner to another, metres.
    pub(super) fn new(
        low_m: Point3<f64>,
        high_m: Point3<f64>,
        voxel_m: f64,
    ) -> Result<Volume, AnyError> {
        let sides = (high_m - low_m).map(|size_m| (size_m / voxel_m).ceil().max(0.0) + 3.0);
        within("voxels along a side", sides.max(), 1.0, MAX_SIDE)?;
        within("voxels", sides.product(), 1.0, MAX_VOXELS)?;
        Ok(Volume {
            low_m,
            voxel_m,
            sides: [sides.x as u32, sides.y as u32, sides.z as u32],
        })
    }

    fn point_m(&self, [x, y, z]: [f64; 3]) -> Point3<f64> {
        self.low_m + Vector3::new(x, y, z) * self.voxel_m
    }

    /// Fuses views to a mesh, warped. Voxels for which `wanted` is false are left unseen, and so is
    /// what no view looks at: there the mesh has holes.
    pub(super) fn fuse(
        &self,
        views: &[DepthView],
        wanted: impl Fn(&Point3<f64>) -> bool,
        warp: &Warp,
    ) -> Result<LabelledMesh, AnyError> {
        let shape = RuntimeShape::<u32, 3>::new(self.sides);
        let truncation_m = TRUNCATION_VOXELS * self.voxel_m;
        let cameras: Vec<_> = views
            .iter()
            .map(|view| (view.house_from_camera.inverse(), &view.image))
            .collect();
        // Positive is free; what is not seen has no weight.
        let mut distances = vec![1.0_f32; shape.usize()];
        let mut seen = vec![false; shape.usize()];
        let mut at = 0;
        for z in 0..self.sides[2] {
            for y in 0..self.sides[1] {
                for x in 0..self.sides[0] {
                    let point_m = self.point_m([x, y, z].map(f64::from));
                    if wanted(&point_m)
                        && let Some(mean_m) = mean_distance_m(&cameras, &point_m, truncation_m)
                    {
                        distances[at] = mean_m as f32;
                        seen[at] = true;
                    }
                    at += 1;
                }
            }
        }
        let mut surface = SurfaceNetsBuffer::default();
        let most = self.sides.map(|side| side - 1);
        surface_nets(&distances, &shape, [0; 3], most, &mut surface);
        self.seen_part(&surface, &shape, &seen, warp)
    }

    /// The triangles all of whose voxels were seen.
    fn seen_part(
        &self,
        surface: &SurfaceNetsBuffer,
        shape: &RuntimeShape<u32, 3>,
        seen: &[bool],
        warp: &Warp,
    ) -> Result<LabelledMesh, AnyError> {
        let corner_seen =
            |corner: [u32; 3]| seen.get(shape.linearize(corner) as usize) == Some(&true);
        let whole = |[x, y, z]: &[u32; 3]| {
            (0..8).all(|c| corner_seen([x + (c & 1), y + (c >> 1 & 1), z + (c >> 2)]))
        };
        let whole: Vec<bool> = surface.surface_points.iter().map(whole).collect();
        let vertices_m = surface.positions.iter().map(|position| {
            let point_m = warp.apply(self.point_m(position.map(f64::from)));
            point_m.coords.cast::<f32>().into()
        });
        let triangles = surface.indices.chunks_exact(3).filter_map(|t| {
            let triangle = [t[0], t[1], t[2]];
            let all = triangle
                .iter()
                .all(|&v| whole.get(v as usize) == Some(&true));
            all.then_some(triangle)
        });
        let triangles: Vec<[u32; 3]> = triangles.collect();
        let none = vec![0; triangles.len()];
        let mesh = LabelledMesh::new(vertices_m.collect(), triangles, none.clone(), none)?;
        Ok(mesh)
    }
}

/// Mean of the signed distances along the views that see a point, cut off; none if no view sees it.
fn mean_distance_m(
    cameras: &[(Isometry3<f64>, &Image)],
    point_m: &Point3<f64>,
    truncation_m: f64,
) -> Option<f64> {
    let (mut sum_m, mut count) = (0.0, 0);
    for (camera_from_house, image) in cameras {
        let in_camera = camera_from_house * point_m;
        let pixel = image.camera.pixel(&in_camera.coords);
        let Some(depth_m) = pixel.and_then(|pixel| image.depths_m.get(pixel)) else {
            continue;
        };
        let distance_m = depth_m - in_camera.x;
        if depth_m.is_finite() && distance_m > -truncation_m {
            sum_m += distance_m.min(truncation_m);
            count += 1;
        }
    }
    (count > 0).then(|| sum_m / f64::from(count))
}
