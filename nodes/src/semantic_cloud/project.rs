//! Projection of depth and labels to points.

use super::counts::PointCounts;
use crate::camera::{Classes, ImageView, LabelledPoints, PixelReader};

/// Selection of the pixels that become points.
#[derive(Clone, Debug, PartialEq)]
pub struct PointOptions {
    /// Step between columns and between rows.
    pub stride: usize,
    /// Nearer points are rejected, m.
    pub min_range_m: f64,
    /// Farther points are rejected, m.
    pub max_range_m: f64,
    /// Largest relative depth difference to the eight adjacent pixels, as a fraction of the smaller depth; infinite: any.
    pub edge_jump: f32,
}

/// Images of one stamp with the rays of the depth image.
pub struct Views<'a> {
    /// Depth.
    pub depth: ImageView<'a>,
    /// Labels and companion images, sampled at the pixels of the depth image.
    pub pixels: PixelReader<'a>,
    /// x / z and y / z of each pixel of the depth image; NaN: no ray.
    pub rays: &'a [[f32; 2]],
}

impl Views<'_> {
    /// Points, row by row.
    pub fn points(
        &mut self,
        options: &PointOptions,
        classes: &Classes,
        counts: &mut PointCounts,
    ) -> LabelledPoints {
        let (width, height) = (self.depth.width, self.depth.height);
        let mut depths_m = Vec::with_capacity(width * height);
        (0..height).for_each(|row| self.depth.depths_m(row, &mut depths_m));
        let edges = Edges::new(&depths_m, width, options.edge_jump);
        let stride = options.stride.max(1);
        let most = width.div_ceil(stride) * height.div_ceil(stride);
        let layout = self.pixels.layout(classes).bounded(most);
        let mut points = LabelledPoints::new(layout, most);
        let square = |range_m: f64| range_m * range_m;
        let range_m2 = square(options.min_range_m)..=square(options.max_range_m);
        for row in (0..height).step_by(stride) {
            self.pixels.seek(row, height);
            for column in (0..width).step_by(stride) {
                let i = row * width + column;
                let (Some(&z_m), Some(&[x, y])) = (depths_m.get(i), self.rays.get(i)) else {
                    continue;
                };
                counts.pixels += 1;
                if z_m.is_nan() {
                    counts.pixels_no_depth += 1;
                    continue;
                }
                if x.is_nan() {
                    counts.pixels_no_ray += 1;
                    continue;
                }
                if edges.has(row, column) {
                    counts.pixels_at_edges += 1;
                    continue;
                }
                let point_m = [x * z_m, y * z_m, z_m];
                let [x_m, y_m, z_m] = point_m.map(f64::from);
                if !range_m2.contains(&(x_m * x_m + y_m * y_m + z_m * z_m)) {
                    counts.pixels_out_of_range += 1;
                    continue;
                }
                points.push(point_m, &self.pixels.at(column), classes);
            }
        }
        counts.points += points.len() as u64;
        counts.points_unlabelled += points.unlabelled();
        points
    }
}

/// Depth edges: pixels that differ from one of the eight adjacent ones; missing depths are ignored.
struct Edges {
    width: usize,
    is_edge: Vec<bool>,
}

impl Edges {
    fn new(depths_m: &[f32], width: usize, jump: f32) -> Self {
        if jump == f32::INFINITY {
            return Self {
                width,
                is_edge: Vec::new(),
            };
        }
        // Nearest and farthest in a row and then of three rows; min and max ignore NaN.
        let near = around(depths_m, width, f32::min);
        let far = around(depths_m, width, f32::max);
        let bounds = depths_m.iter().zip(near.iter().zip(&far));
        let is_edge = bounds.map(|(&z_m, (&near_m, &far_m))| {
            far_m - z_m > jump * z_m || z_m - near_m > jump * near_m
        });
        Self {
            width,
            is_edge: is_edge.collect(),
        }
    }

    fn has(&self, row: usize, column: usize) -> bool {
        let place = row * self.width + column;
        self.is_edge.get(place).copied().unwrap_or(false)
    }
}

/// Best value of each pixel and its eight adjacent ones.
fn around(values: &[f32], width: usize, best: impl Fn(f32, f32) -> f32 + Copy) -> Vec<f32> {
    let mut in_rows = values.to_vec();
    for (row, out) in values.chunks(width).zip(in_rows.chunks_mut(width)) {
        fold_neighbours(row, out, 1, best);
    }
    let mut out = in_rows.clone();
    fold_neighbours(&in_rows, &mut out, width, best);
    out
}

/// Folds into each value those at `distance` before and after it.
fn fold_neighbours(
    values: &[f32],
    out: &mut [f32],
    distance: usize,
    best: impl Fn(f32, f32) -> f32 + Copy,
) {
    // Slices with one common length vectorise.
    for (out, before) in out
        .get_mut(distance..)
        .unwrap_or_default()
        .iter_mut()
        .zip(values)
    {
        *out = best(*out, *before);
    }
    let behind = values.get(distance..).unwrap_or_default();
    for (out, behind) in out.iter_mut().zip(behind) {
        *out = best(*out, *behind);
    }
}
