//! Markers of one block: Voronoi cells, cubes or points.

use lattice_msgs::geometry_msgs::{Point, Vector3 as ScaleVector};
use lattice_msgs::std_msgs::ColorRGBA;
use lattice_msgs::visualization_msgs::Marker;
use nalgebra::{Isometry3, UnitQuaternion, Vector3};

use super::blocks::{BlockId, Blocks, offset};
use super::color;
use super::options::{ColorBy, MarkerOptions, MarkerStyle};
use super::packer::OVERHEAD_BYTES;
use crate::convert::geometry;
use crate::map_follower::FollowedMap;

/// Markers of a block, without header and ids; empty if no face is exposed.
pub fn of_block(
    map: &FollowedMap,
    blocks: &Blocks,
    block: BlockId,
    style: MarkerStyle,
    options: &MarkerOptions,
) -> Vec<Marker> {
    let Some(first) = blocks.keys(block).next() else {
        return Vec::new();
    };
    let mut builder = Builder::new(style, options, map.lattice.cell_volume_m3().cbrt());
    builder.origin_m = map.center_m(first);
    if style == MarkerStyle::Cubes {
        builder.rotation = map.lattice.orientation();
    }
    let cell = map.lattice.cell();
    let own_color = options.color_by == ColorBy::Color;
    let mut corners = Vec::new();
    for key in blocks.keys(block) {
        let center_m = map.center_m(key);
        let mut exposed = (cell.faces.iter())
            .filter(|face| {
                offset(key, &face.neighbor).is_none_or(|neighbor| !blocks.contains(neighbor))
            })
            .peekable();
        if exposed.peek().is_none() {
            continue;
        }
        if own_color {
            builder.color = color::of_voxel(map.color(key), options.alpha);
        }
        if style != MarkerStyle::Cells {
            builder.point(&center_m);
            continue;
        }
        // Faces share their corners.
        corners.clear();
        corners.extend(
            cell.vertices
                .iter()
                .map(|v| builder.corner(&(center_m + v))),
        );
        for face in exposed {
            builder.polygon((face.vertices.iter()).filter_map(|i| corners.get(usize::from(*i))));
        }
    }
    builder.finish()
}

/// Point of a marker.
struct Corner {
    point: Point,
    /// None for markers of one colour.
    color: Option<ColorRGBA>,
}

/// Collects points into markers of bounded size.
struct Builder<'a> {
    style: MarkerStyle,
    options: &'a MarkerOptions,
    side_m: f64,
    origin_m: Vector3<f64>,
    /// Marker orientation: viewers draw the cubes of a list along its axes.
    rotation: UnitQuaternion<f64>,
    max_points: usize,
    /// Colour of the voxel that is being added, with [`ColorBy::Color`].
    color: ColorRGBA,
    points: Vec<Point>,
    colors: Vec<ColorRGBA>,
    markers: Vec<Marker>,
}

impl<'a> Builder<'a> {
    fn new(style: MarkerStyle, options: &'a MarkerOptions, side_m: f64) -> Self {
        let point_bytes = match options.color_by {
            ColorBy::Height | ColorBy::Color => 24 + 16,
            ColorBy::Flat => 24,
        };
        let room = options.chunk_bytes.saturating_sub(2 * OVERHEAD_BYTES);
        Self {
            style,
            options,
            side_m,
            origin_m: Vector3::zeros(),
            rotation: UnitQuaternion::identity(),
            // A polygon is not split: one with six corners has four triangles.
            max_points: (room / point_bytes).max(12),
            color: color::of_voxel(None, options.alpha),
            points: Vec::new(),
            colors: Vec::new(),
            markers: Vec::new(),
        }
    }

    /// Adds a convex polygon as a triangle fan.
    fn polygon<'c>(&mut self, mut corners: impl Iterator<Item = &'c Corner> + Clone) {
        self.make_room(3 * corners.clone().count().saturating_sub(2));
        let (Some(apex), Some(mut before)) = (corners.next(), corners.next()) else {
            return;
        };
        for corner in corners {
            for corner in [apex, before, corner] {
                self.push(corner);
            }
            before = corner;
        }
    }

    fn point(&mut self, at_m: &Vector3<f64>) {
        self.make_room(1);
        self.push(&self.corner(at_m));
    }

    fn make_room(&mut self, points: usize) {
        if self.points.len() + points > self.max_points {
            self.close();
        }
    }

    fn corner(&self, at_m: &Vector3<f64>) -> Corner {
        let p = self.rotation.inverse() * (at_m - self.origin_m);
        Corner {
            point: Point {
                x: p.x,
                y: p.y,
                z: p.z,
            },
            color: match self.options.color_by {
                ColorBy::Height => Some(self.color_at(at_m.z)),
                ColorBy::Color => Some(self.color),
                ColorBy::Flat => None,
            },
        }
    }

    fn push(&mut self, corner: &Corner) {
        self.points.push(corner.point);
        self.colors.extend(corner.color);
    }

    fn color_at(&self, z_m: f64) -> ColorRGBA {
        color::of_height(z_m, self.options.height_period_m, self.options.alpha)
    }

    fn close(&mut self) {
        if self.points.is_empty() {
            return;
        }
        let (type_, scale) = match self.style {
            MarkerStyle::Cells => (Marker::TRIANGLE_LIST, 1.0),
            MarkerStyle::Cubes => (Marker::CUBE_LIST, self.side_m),
            MarkerStyle::Points => (Marker::POINTS, 0.5 * self.side_m),
        };
        let place = Isometry3::from_parts(self.origin_m.into(), self.rotation);
        self.markers.push(Marker {
            type_,
            action: Marker::ADD,
            pose: geometry::pose_from(&place),
            scale: ScaleVector {
                x: scale,
                y: scale,
                z: scale,
            },
            color: self.color_at(self.origin_m.z),
            points: std::mem::take(&mut self.points),
            colors: std::mem::take(&mut self.colors),
            ..Marker::default()
        });
    }

    fn finish(mut self) -> Vec<Marker> {
        self.close();
        self.markers
    }
}
