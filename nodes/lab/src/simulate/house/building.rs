//! The house: a labelled mesh at a pose in the map.

use super::free_space::FreeSpace;
use super::regions::{Region, Regions};
use crate::AnyError;
use crate::mesh::{LabelledMesh, MeshScene};
use nalgebra::{Isometry3, Point3, Vector3};
use std::collections::BTreeMap;

/// Longest house, metres.
const MAX_SIZE_M: f64 = 200.0;
/// Classes that segmenters get wrong in parts.
const STRUCTURAL: [&str; 3] = ["wall", "floor", "ceiling"];

/// The first surface that a ray hits.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct SurfaceHit {
    pub distance_m: f64,
    pub triangle: usize,
    pub region: u16,
}

/// A furnished house with the class of everything in it, at a pose in the map.
#[derive(Debug)]
pub struct House {
    mesh: LabelledMesh,
    pub(super) scene: MeshScene,
    pub(super) class_names: BTreeMap<u16, String>,
    pub(super) regions: Regions,
    pub(super) free: FreeSpace,
    map_from_house: Isometry3<f64>,
}

impl House {
    /// A house of a mesh (metres, z up) and the names of its classes.
    ///
    /// Scenes are found by the classes `tv`, `desk`, `bookshelf`, `table` and `chair`; `wall`, `floor`
    /// and `ceiling` are seen in patches.
    pub fn from_mesh(
        mesh: LabelledMesh,
        class_names: BTreeMap<u16, String>,
    ) -> Result<House, AnyError> {
        let structural = |label| {
            let name = class_names.get(&label);
            name.is_some_and(|name| STRUCTURAL.contains(&name.as_str()))
        };
        let regions = Regions::new(&mesh, structural)?;
        for axis in 0..3 {
            let low_m = regions.things.iter().map(|thing| thing.low_m[axis]);
            let high_m = regions.things.iter().map(|thing| thing.high_m[axis]);
            let size_m = high_m.fold(0.0, f64::max) - low_m.fold(0.0, f64::min);
            if size_m > MAX_SIZE_M {
                return Err(format!(
                    "the mesh is {size_m} m long, but at most {MAX_SIZE_M} m are taken; check the unit"
                )
                .into());
            }
        }
        let scene = MeshScene::new(&mesh)?;
        let free = FreeSpace::new(&mesh, &scene)?;
        Ok(House {
            mesh,
            scene,
            class_names,
            regions,
            free,
            map_from_house: Isometry3::identity(),
        })
    }

    /// The same house elsewhere in the map.
    pub fn placed(self, map_from_house: Isometry3<f64>) -> House {
        House {
            map_from_house,
            ..self
        }
    }

    /// Pose of the house; the identity unless [`House::placed`].
    pub fn map_from_house(&self) -> Isometry3<f64> {
        self.map_from_house
    }

    /// Surfaces of the house, house frame, metres.
    pub fn mesh(&self) -> &LabelledMesh {
        &self.mesh
    }

    /// Names of the classes.
    pub fn class_names(&self) -> &BTreeMap<u16, String> {
        &self.class_names
    }

    /// The class with a name.
    pub fn class(&self, name: &str) -> Option<u16> {
        let mut classes = self.class_names.iter();
        classes.find(|(_, n)| *n == name).map(|(class, _)| *class)
    }

    /// All regions; points name them by number.
    pub fn regions(&self) -> &[Region] {
        &self.regions.list
    }

    /// The first surface that a ray hits within `max_m`, house frame.
    pub fn cast(
        &self,
        origin_m: &Point3<f64>,
        direction: &Vector3<f64>,
        max_m: f64,
    ) -> Option<SurfaceHit> {
        let hit = self.scene.cast(origin_m, direction, max_m)?;
        let point_m = origin_m + direction.try_normalize(0.0)? * hit.distance_m;
        Some(SurfaceHit {
            distance_m: hit.distance_m,
            triangle: hit.triangle,
            region: self.regions.at(hit.triangle, &point_m.into()),
        })
    }

    /// Distance to the first surface alone, metres.
    pub(super) fn depth_m(
        &self,
        origin_m: &Point3<f64>,
        direction: &Vector3<f64>,
        max_m: f64,
    ) -> Option<f64> {
        let hit = self.scene.cast(origin_m, direction, max_m);
        hit.map(|hit| hit.distance_m)
    }
}
