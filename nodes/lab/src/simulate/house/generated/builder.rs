//! Boxes and drums that become a labelled mesh.

use crate::AnyError;
use crate::mesh::LabelledMesh;
use std::f32::consts::TAU;

/// Sides of a drum.
const SIDES: u32 = 14;

/// Place of a piece of furniture: its back against a wall, its front along y turned by `yaw`.
#[derive(Clone, Copy, Default, Debug)]
pub(super) struct Spot {
    pub(super) x: f32,
    pub(super) y: f32,
    pub(super) yaw_deg: f32,
}

/// A mesh as it grows; metres.
#[derive(Default)]
pub struct Builder {
    vertices_m: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
    labels: Vec<u16>,
    instances: Vec<u16>,
    label: u16,
    instance: u16,
    spot: Spot,
}

impl Builder {
    /// Starts a thing of a class at a place; its parts are given in its own axes.
    pub(super) fn thing(&mut self, label: u16, spot: Spot) -> &mut Builder {
        self.instance += 1;
        self.label = label;
        self.spot = spot;
        self
    }

    /// Starts a thing whose parts are given in the axes of the house.
    pub(super) fn fixed(&mut self, label: u16) -> &mut Builder {
        self.thing(label, Spot::default())
    }

    /// Adds a box from its lowest to its highest corner.
    pub fn block(&mut self, low: [f32; 3], high: [f32; 3]) -> &mut Builder {
        let first = self.vertices_m.len() as u32;
        for corner in 0..8 {
            let of = |axis: usize| [low, high][corner >> axis & 1][axis];
            self.vertex([0, 1, 2].map(of));
        }
        for [a, b, c, d] in [
            [0, 2, 3, 1],
            [4, 5, 7, 6],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 4, 6, 2],
            [1, 3, 7, 5],
        ] {
            self.triangle([first + a, first + b, first + c]);
            self.triangle([first + a, first + c, first + d]);
        }
        self
    }

    /// An upright drum with one radius at the bottom and one at the top.
    pub(super) fn drum(&mut self, [x, y]: [f32; 2], z: [f32; 2], radius: [f32; 2]) -> &mut Builder {
        let first = self.vertices_m.len() as u32;
        for side in 0..SIDES {
            let (sin, cos) = (side as f32 * TAU / SIDES as f32).sin_cos();
            for end in 0..2 {
                self.vertex([x + radius[end] * cos, y + radius[end] * sin, z[end]]);
            }
        }
        z.into_iter().for_each(|z| self.vertex([x, y, z]));
        let middle = first + 2 * SIDES;
        for side in 0..SIDES {
            let (a, b) = (first + 2 * side, first + 2 * ((side + 1) % SIDES));
            self.triangle([a, b, b + 1]);
            self.triangle([a, b + 1, a + 1]);
            self.triangle([middle, b, a]);
            self.triangle([middle + 1, a + 1, b + 1]);
        }
        self
    }

    fn vertex(&mut self, [x, y, z]: [f32; 3]) {
        let spot = self.spot;
        let (sin, cos) = spot.yaw_deg.to_radians().sin_cos();
        let turned = [spot.x + cos * x - sin * y, spot.y + sin * x + cos * y, z];
        self.vertices_m.push(turned);
    }

    fn triangle(&mut self, corners: [u32; 3]) {
        self.triangles.push(corners);
        self.labels.push(self.label);
        self.instances.push(self.instance);
    }

    /// Finishes the mesh.
    pub fn build(self) -> Result<LabelledMesh, AnyError> {
        let mesh = LabelledMesh::new(self.vertices_m, self.triangles, self.labels, self.instances)?;
        Ok(mesh)
    }
}
