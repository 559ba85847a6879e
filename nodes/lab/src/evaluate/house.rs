//! The house that is measured in.

use std::path::Path;

use crate::simulate::house::House;

use super::EvaluateError;
use crate::mesh::read_mesh;
use lattice_nodes::files::classes::read_classes;

/// The house of a PLY mesh and a YAML file with the names of its classes, or one of our own making by the
/// seed; with the checksum of the mesh.
pub fn read_house(
    mesh: Option<(&Path, &Path)>,
    seed: u64,
) -> Result<(House, Option<u32>), EvaluateError> {
    let Some((mesh, classes)) = mesh else {
        return Ok((House::own(seed)?, None));
    };
    let here = |path: &Path, e: &dyn std::fmt::Display| EvaluateError::Mesh {
        path: path.to_owned(),
        reason: e.to_string(),
    };
    let names = read_classes(classes).map_err(|e| here(classes, &e))?;
    let crc32 = crc32fast::hash(&std::fs::read(mesh).map_err(|e| here(mesh, &e))?);
    let surfaces = read_mesh(mesh, usize::MAX).map_err(|e| here(mesh, &e))?;
    let house = House::from_mesh(surfaces, names).map_err(|e| here(mesh, &e))?;
    Ok((house, Some(crc32)))
}
