//! Rasterisation: the face that is seen at each sample of the screen.

use super::picture_options::LabelColors;
use super::view::View;
use lattice_core::lattice::{Lattice, MortonKey};
use lattice_core::voxels::VoxelList;
use lattice_nodes::files::export::HeightRange;
use lattice_nodes::files::export::palette::{linear, linear_at};
use nalgebra::Vector3;

/// Depth where there is nothing.
pub(super) const NOTHING: f32 = f32::NEG_INFINITY;
/// Cells smaller than this on the screen, samples, are drawn larger so that none is lost.
const SMALL: f64 = 2.0;
/// sRGB of cells without a label.
const NO_LABEL: u8 = 150;

/// Meaning of the colours of cells.
pub(super) enum Paint<'a> {
    Height,
    Label(&'a LabelColors),
}

/// A map as it is drawn.
pub(super) struct Scene {
    lattice: Lattice,
    exposed: Vec<Exposed>,
    /// Linear colour of each tone.
    pub(super) palette: Vec<[f64; 3]>,
    /// Largest extent of a cell from its centre, metres.
    pub(super) radius_m: f64,
}

/// A face that can be seen.
struct Exposed {
    key: MortonKey,
    face: u8,
    tone: u8,
}

impl Scene {
    pub(super) fn new(list: &VoxelList, paint: &Paint) -> Scene {
        let lattice = list.lattice().clone();
        let faces = list.exposed_faces();
        let height = |key: MortonKey| lattice.center(key.unpack()).z;
        let exposed = |tone: &dyn Fn(MortonKey) -> u8| {
            let exposed = |&(key, face): &(MortonKey, usize)| Exposed {
                key,
                face: face as u8,
                tone: tone(key),
            };
            faces.iter().map(exposed).collect()
        };
        let (palette, exposed) = match paint {
            Paint::Height => {
                let heights = HeightRange::of(faces.iter().map(|&(key, _)| height(key)));
                let palette = (0..=255).map(|tone| linear_at(f64::from(tone) / 255.0));
                let tone = |key| (heights.fraction(height(key)) * 255.0).round() as u8;
                (palette.collect(), exposed(&tone))
            }
            Paint::Label(colors) => {
                // The first tone is of cells without a label.
                let palette = [&[NO_LABEL; 3]].into_iter().chain(colors.values());
                let tone = |key| {
                    let label = list.label(key).map(|counted| counted.label);
                    let place = colors.keys().position(|of| Some(*of) == label);
                    place.map_or(0, |at| u8::try_from(at + 1).unwrap_or(0))
                };
                (palette.map(|c| c.map(linear)).collect(), exposed(&tone))
            }
        };
        Scene {
            radius_m: lattice.covering_radius_m(),
            lattice,
            exposed,
            palette,
        }
    }

    /// Centres of the cells that can be seen, relative to the datum, metres.
    pub(super) fn centers(&self) -> impl Iterator<Item = Vector3<f64>> + '_ {
        let mut last = None;
        let keys = self.exposed.iter().map(|exposed| exposed.key);
        let new = keys.filter(move |&key| last.replace(key) != Some(key));
        new.map(|key| self.lattice.center(key.unpack()))
    }

    pub(super) fn normals(&self) -> Vec<Vector3<f64>> {
        let neighbors = self.lattice.face_neighbors().iter();
        neighbors
            .map(|&w| self.lattice.center(w).normalize())
            .collect()
    }

    /// Draws all faces that turn towards the viewer.
    pub(super) fn draw(&self, view: &View) -> Screen {
        let [width, height] = view.size;
        let mut screen = Screen {
            width,
            depth_m: vec![NOTHING; width * height],
            surface: vec![Surface::default(); width * height],
        };
        let cell = self.lattice.cell();
        let stamps: Vec<Option<Stamp>> = cell
            .faces
            .iter()
            .zip(self.normals())
            .map(|(face, normal)| Stamp::new(view, &normal, cell.polygon(face), self.radius_m))
            .collect();
        for &Exposed { key, face, tone } in &self.exposed {
            if let Some(Some(stamp)) = stamps.get(usize::from(face)) {
                let center = self.lattice.center(key.unpack());
                stamp.draw(view.project(&center), [tone, face], &mut screen);
            }
        }
        screen
    }
}

/// Surface that is seen at a sample.
#[derive(Clone, Copy, Default, Debug)]
pub(super) struct Surface {
    /// Place of the cell's colour in the palette.
    pub(super) tone: u8,
    pub(super) face: u8,
    /// Distance from the nearest edge of the face, in sixteenths of a sample.
    pub(super) inset: u8,
}

/// The samples, row by row from the top.
pub(super) struct Screen {
    pub(super) width: usize,
    /// Towards the viewer, `NOTHING` where no face is.
    pub(super) depth_m: Vec<f32>,
    pub(super) surface: Vec<Surface>,
}

impl Screen {
    /// Depth at screen coordinates, `NOTHING` beyond the border.
    pub(super) fn depth_at(&self, x: f64, y: f64) -> f32 {
        let inside = x >= 0.0 && y >= 0.0 && x < self.width as f64;
        let index = (y as usize)
            .saturating_mul(self.width)
            .saturating_add(x as usize);
        let depth = self.depth_m.get(index).filter(|_| inside);
        depth.copied().unwrap_or(NOTHING)
    }
}

/// All faces of one direction on the screen, relative to the centre of the cell.
struct Stamp {
    /// Bounds: left, top, right, bottom.
    bounds: [f64; 4],
    /// Inside of all: `nx x + ny y + c >= 0`, with unit normals.
    edges: Vec<[f64; 3]>,
    /// Depth is `dx x + dy y + c`.
    plane: [f64; 3],
    /// Margin outside of an edge within which a sample may lie, samples.
    slack: f64,
}

impl Stamp {
    /// `None` if the face turns away or stands on edge.
    fn new(
        view: &View,
        normal: &Vector3<f64>,
        polygon: impl Iterator<Item = Vector3<f64>>,
        radius_m: f64,
    ) -> Option<Stamp> {
        let facing = normal.dot(&view.toward);
        let [x0, y0, z0] = view.project(&Vector3::zeros());
        let corners: Vec<[f64; 3]> = polygon
            .map(|p| view.project(&p))
            .map(|[x, y, z]| [x - x0, y - y0, z - z0])
            .collect();
        let &[x, y, z] = corners.first()?;
        if facing < 1e-6 {
            return None;
        }
        // Moving in the plane: n . (right, up, toward) (dx, -dy, dz) = 0, metres a sample.
        let slope = -1.0 / (facing * view.scale);
        let (dx, dy) = (
            normal.dot(&view.right) * slope,
            -normal.dot(&view.up) * slope,
        );
        let mut stamp = Stamp {
            bounds: [x, y, x, y],
            edges: Vec::with_capacity(corners.len()),
            plane: [dx, dy, z - dx * x - dy * y],
            slack: if radius_m * view.scale < SMALL {
                0.5
            } else {
                1e-6
            },
        };
        let next = corners.iter().cycle().skip(1);
        for (&[x, y, _], &[to_x, to_y, _]) in corners.iter().zip(next) {
            let [left, top, right, bottom] = stamp.bounds;
            stamp.bounds = [left.min(x), top.min(y), right.max(x), bottom.max(y)];
            let length = (to_x - x).hypot(to_y - y);
            if length > 1e-9 {
                // Counter-clockwise seen from outside is clockwise with y down: inside is right.
                let (nx, ny) = ((to_y - y) / length, (x - to_x) / length);
                stamp.edges.push([nx, ny, -(nx * x + ny * y)]);
            }
        }
        Some(stamp)
    }

    fn draw(&self, [x0, y0, z0]: [f64; 3], [tone, face]: [u8; 2], screen: &mut Screen) {
        let [left, top, right, bottom] = self.bounds;
        let width = screen.width;
        let height = screen.depth_m.len() / width.max(1);
        let span = |low: f64, high: f64, side: usize| {
            // Casts saturate, so that what is off the screen gives an empty range.
            let first = (low - self.slack - 0.5).ceil().max(0.0) as usize;
            first..((high + self.slack - 0.5).floor() + 1.0).clamp(0.0, side as f64) as usize
        };
        let columns = span(x0 + left, x0 + right, width);
        for row in span(y0 + top, y0 + bottom, height) {
            let y = row as f64 + 0.5 - y0;
            for column in columns.clone() {
                let x = column as f64 + 0.5 - x0;
                let inset = |&[nx, ny, c]: &[f64; 3]| nx * x + ny * y + c;
                let inset = self.edges.iter().map(inset).fold(f64::MAX, f64::min);
                if inset < -self.slack {
                    continue;
                }
                let [dx, dy, c] = self.plane;
                let depth_m = (z0 + dx * x + dy * y + c) as f32;
                let index = row * width + column;
                if let (Some(seen), Some(surface)) =
                    (screen.depth_m.get_mut(index), screen.surface.get_mut(index))
                    && depth_m > *seen
                {
                    *seen = depth_m;
                    let inset = (inset * 16.0).clamp(0.0, 255.0) as u8;
                    *surface = Surface { tone, face, inset };
                }
            }
        }
    }
}
