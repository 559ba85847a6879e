//! Clouds from ray casting against the headset's mesh.

use lattice_core::pose::Axes;
use nalgebra::{Isometry3, Matrix3, Point3, Vector3};

use super::counts::ViewCounts;
use crate::camera::{Classes, LabelledPoints, Pixel, PixelReader, PointLayout};
use crate::mesh::{LabelledMesh, MeshError, MeshScene};

/// Fewest hits for the winding check.
const MIN_HITS: u64 = 20;

/// Selection of the pixels that become points.
#[derive(Clone, Debug, PartialEq)]
pub struct ViewOptions {
    /// Step between columns and between rows.
    pub stride: usize,
    /// Nearer hits are ignored, m.
    pub min_range_m: f64,
    /// Farther hits are ignored, m.
    pub max_range_m: f64,
    /// True to reject images that see most of the mesh from behind.
    pub check_winding: bool,
}

/// Mesh in headset_origin, indexed for ray casting.
pub(super) struct RaycastMesh {
    mesh: LabelledMesh,
    scene: MeshScene,
}

/// Label image with the rays of its pixels.
pub(super) struct LabelledView<'a> {
    /// Labels and companion images, sampled at the pixels of the camera.
    pub pixels: PixelReader<'a>,
    /// x / z and y / z of each camera pixel; NaN: no ray.
    pub rays: &'a [[f32; 2]],
    /// Camera columns.
    pub width: usize,
    /// Camera position and rotation from optical axes, in headset_origin and the axes of ROS.
    pub camera: (Point3<f64>, Matrix3<f64>),
}

/// `ros_from_optical` of a camera, from its pose in the axes of the headset and its own axes.
pub(super) fn placed(
    origin_from_camera: &Isometry3<f64>,
    headset: Axes,
    camera: Axes,
) -> (Point3<f64>, Matrix3<f64>) {
    let place = headset.to_ros(origin_from_camera.translation.vector);
    let turn = origin_from_camera.rotation.to_rotation_matrix();
    // Each of these matrices is orthonormal: its transpose is its inverse.
    let camera_from_optical = camera.matrix().transpose() * Axes::Optical.matrix();
    let ros_from_optical = headset.matrix() * turn.matrix() * camera_from_optical;
    (place.into(), ros_from_optical)
}

impl RaycastMesh {
    /// Indexes a mesh.
    pub fn new(mesh: LabelledMesh) -> Result<Self, MeshError> {
        let scene = MeshScene::new_fast(&mesh)?;
        Ok(Self { mesh, scene })
    }

    /// Points seen by the pixels, or the numbers of hits from behind and of all hits.
    pub fn see(
        &self,
        view: &mut LabelledView,
        options: &ViewOptions,
        classes: &Classes,
        counts: &mut ViewCounts,
    ) -> Result<LabelledPoints, [u64; 2]> {
        let width = view.width.max(1);
        let height = view.rays.len() / width;
        let stride = options.stride.max(1);
        let (origin_m, ros_from_optical) = &view.camera;
        let most = width.div_ceil(stride) * height.div_ceil(stride);
        let layout = PointLayout {
            viewpoint_m: Some(origin_m.coords.map(|c| c as f32).into()),
            ..view.pixels.layout(classes)
        };
        let layout = layout.bounded(most);
        let (mut points, mut new) = (LabelledPoints::new(layout, 0), ViewCounts::default());
        let (mut hits, mut behind) = (0, 0);
        for row in (0..height).step_by(stride) {
            view.pixels.seek(row, height);
            for column in (0..width).step_by(stride) {
                let Some(&[x, y]) = view.rays.get(row * width + column) else {
                    continue;
                };
                new.pixels += 1;
                if x.is_nan() {
                    new.pixels_no_ray += 1;
                    continue;
                }
                let ray = Vector3::new(f64::from(x), f64::from(y), 1.0);
                let direction = (ros_from_optical * ray).normalize();
                let hit = self.scene.cast(origin_m, &direction, options.max_range_m);
                let near = |distance_m: f64| distance_m < options.min_range_m;
                let Some(hit) = hit.filter(|hit| !near(hit.distance_m)) else {
                    new.pixels_no_mesh += 1;
                    continue;
                };
                hits += 1;
                behind += u64::from(self.is_behind(hit.triangle, &direction));
                let point_m = (origin_m + direction * hit.distance_m).coords;
                let place: [f32; 3] = point_m.map(|c| c as f32).into();
                points.push(place, &view.pixels.at(column), classes);
            }
        }
        if options.check_winding && hits >= MIN_HITS && 2 * behind > hits {
            return Err([behind, hits]);
        }
        new.points = points.len() as u64;
        new.points_unlabelled = points.unlabelled();
        counts.add(&new);
        Ok(points)
    }

    /// Points sampled uniformly over the mesh, labelled by its triangles.
    pub fn sampled(
        &self,
        spacing_m: f64,
        max_points: usize,
        classes: &Classes,
        counts: &mut ViewCounts,
    ) -> LabelledPoints {
        let triangles = || self.mesh.corners_m().zip(self.mesh.labels());
        let area_m2 = |corners: [[f32; 3]; 3]| {
            let [a, b, c] = corners.map(|p| Vector3::from(p.map(f64::from)));
            0.5 * (b - a).cross(&(c - a)).norm()
        };
        let all_m2: f64 = triangles().map(|(corners, _)| area_m2(corners)).sum();
        let each_m2 = (spacing_m * spacing_m).max(all_m2 / max_points.max(1) as f64);
        let (mut points, mut saved_m2, mut number) =
            (LabelledPoints::new(PointLayout::default(), 0), 0.0, 0_u32);
        for (corners, label) in triangles() {
            let [a, b, c] = corners.map(|p| Vector3::from(p.map(f64::from)));
            saved_m2 += area_m2(corners);
            while saved_m2 >= each_m2 && points.len() < max_points {
                saved_m2 -= each_m2;
                number = number.wrapping_add(1);
                // Two irrational steps fill a square uniformly; one half is folded onto the other.
                let step = |part: f64| (f64::from(number) * part).fract();
                let (mut u, mut v) = (step(0.754_877_666_246_693), step(0.569_840_290_998_053));
                if u + v > 1.0 {
                    (u, v) = (1.0 - u, 1.0 - v);
                }
                let point_m = a + (b - a) * u + (c - a) * v;
                let place: [f32; 3] = point_m.map(|c| c as f32).into();
                points.push(place, &Pixel::certain(*label), classes);
            }
        }
        counts.points += points.len() as u64;
        counts.points_unlabelled += points.unlabelled();
        points
    }

    /// True if a ray hits the clockwise side of a triangle.
    fn is_behind(&self, triangle: usize, direction: &Vector3<f64>) -> bool {
        let corners = self.mesh.triangles().get(triangle);
        let vertex = |v: u32| self.mesh.vertices_m().get(v as usize).copied();
        let corners = corners.map(|corners| corners.map(|v| vertex(v).unwrap_or_default()));
        let [a, b, c] = corners
            .unwrap_or_default()
            .map(|p| Vector3::from(p.map(f64::from)));
        (b - a).cross(&(c - a)).dot(direction) > 0.0
    }
}

impl ViewCounts {
    fn add(&mut self, other: &Self) {
        self.pixels += other.pixels;
        self.pixels_no_ray += other.pixels_no_ray;
        self.pixels_no_mesh += other.pixels_no_mesh;
        self.points += other.points;
        self.points_unlabelled += other.points_unlabelled;
    }
}
