//! Regions that a segmenter sees as one: pieces of furniture, and patches of walls, floors and ceilings.

use crate::AnyError;
use crate::mesh::LabelledMesh;
use std::collections::BTreeMap;

/// Region of a point of which nothing is known.
pub const NO_REGION: u16 = u16::MAX;

/// Most regions of a house.
const MAX_REGIONS: usize = 65_000;
/// Side of a patch, metres.
const PATCH_M: f64 = 2.0;
/// Most patches along a side.
const MAX_PATCHES: f64 = 48.0;

/// A region that a segmenter gets wrong as a whole: one thing, or a patch of a structural one.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Region {
    pub label: u16,
    pub instance: u16,
}

/// All triangles with one instance and class.
#[derive(Clone, Debug)]
pub(super) struct Thing {
    pub(super) label: u16,
    pub(super) instance: u16,
    pub(super) low_m: [f64; 3],
    pub(super) high_m: [f64; 3],
    first_region: usize,
    grid: Option<Grid>,
}

impl Thing {
    /// True of walls, floors and ceilings.
    pub(super) fn is_structural(&self) -> bool {
        self.grid.is_some()
    }
}

/// Patches of a structural thing, seen from above.
#[derive(Clone, Copy, Debug)]
struct Grid {
    side_m: f64,
    columns: usize,
    rows: usize,
}

#[derive(Clone, Debug)]
pub(super) struct Regions {
    pub(super) list: Vec<Region>,
    pub(super) things: Vec<Thing>,
    /// Thing of each triangle.
    pub(super) thing_of: Vec<u32>,
}

impl Regions {
    /// Gathers triangles into things; `structural` says which classes are cut into patches.
    pub(super) fn new(
        mesh: &LabelledMesh,
        structural: impl Fn(u16) -> bool,
    ) -> Result<Regions, AnyError> {
        let mut numbers: BTreeMap<(u16, u16), usize> = BTreeMap::new();
        let keys = || {
            mesh.instances()
                .iter()
                .copied()
                .zip(mesh.labels().iter().copied())
        };
        for key in keys() {
            numbers.entry(key).or_default();
        }
        let mut things = Vec::with_capacity(numbers.len());
        for (number, ((instance, label), slot)) in numbers.iter_mut().enumerate() {
            *slot = number;
            things.push(Thing {
                label: *label,
                instance: *instance,
                low_m: [f64::INFINITY; 3],
                high_m: [f64::NEG_INFINITY; 3],
                first_region: 0,
                grid: None,
            });
        }
        let mut thing_of = Vec::with_capacity(mesh.len());
        for (key, corners) in keys().zip(mesh.corners_m()) {
            let number = numbers.get(&key).copied().unwrap_or_default();
            thing_of.push(number as u32);
            if let Some(thing) = things.get_mut(number) {
                for corner in corners {
                    let bounds = thing.low_m.iter_mut().zip(&mut thing.high_m);
                    for ((low, high), c) in bounds.zip(corner) {
                        *low = low.min(c.into());
                        *high = high.max(c.into());
                    }
                }
            }
        }
        let mut list = Vec::new();
        for thing in &mut things {
            thing.first_region = list.len();
            let mut regions = 1;
            if structural(thing.label) {
                let size_m = [0, 1].map(|axis| thing.high_m[axis] - thing.low_m[axis]);
                let side_m = PATCH_M.max(size_m[0].max(size_m[1]) / MAX_PATCHES);
                let [columns, rows] = size_m.map(|size_m| (size_m / side_m) as usize + 1);
                thing.grid = Some(Grid {
                    side_m,
                    columns,
                    rows,
                });
                regions = columns * rows;
            }
            let region = Region {
                label: thing.label,
                instance: thing.instance,
            };
            list.extend(std::iter::repeat_n(region, regions));
            if list.len() > MAX_REGIONS {
                let regions = list.len();
                return Err(format!(
                    "the mesh has {regions} instances and patches of walls, at most {MAX_REGIONS} are taken"
                )
                .into());
            }
        }
        Ok(Regions {
            list,
            things,
            thing_of,
        })
    }

    /// The region of a point on a triangle, house frame, metres.
    pub(super) fn at(&self, triangle: usize, point_m: &[f64; 3]) -> u16 {
        let thing = self.thing_of.get(triangle);
        let Some(thing) = thing.and_then(|&thing| self.things.get(thing as usize)) else {
            return NO_REGION;
        };
        let patch = thing.grid.map_or(0, |grid| {
            let cell = |axis: usize, cells: usize| {
                let along = (point_m[axis] - thing.low_m[axis]) / grid.side_m;
                (along.max(0.0) as usize).min(cells - 1)
            };
            cell(1, grid.rows) * grid.columns + cell(0, grid.columns)
        });
        (thing.first_region + patch) as u16
    }
}
