//! The house of an evaluation or a data set.

use crate::mesh::read_mesh;
use crate::simulate::house::House;
use crate::{AnyError, at};
use lattice_nodes::files::classes::read_classes;
use std::path::PathBuf;

/// Most triangles of a mesh that is read.
const MAX_TRIANGLES: usize = 5_000_000;

/// The house of a PLY mesh and a YAML file with the names of its classes, or else the generated one of a
/// seed; with the checksum of the mesh.
pub fn read_house(
    mesh: Option<&(PathBuf, PathBuf)>,
    seed: u64,
) -> Result<(House, Option<u32>), AnyError> {
    let Some((mesh, classes)) = mesh else {
        return Ok((House::generated(seed)?, None));
    };
    let names = read_classes(classes).map_err(at(classes))?;
    let crc32 = crc32fast::hash(&std::fs::read(mesh).map_err(at(mesh))?);
    let surfaces = read_mesh(mesh, MAX_TRIANGLES).map_err(at(mesh))?;
    let house = House::from_mesh(surfaces, names).map_err(at(mesh))?;
    Ok((house, Some(crc32)))
}
