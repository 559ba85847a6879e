//! Headset scans of an evaluation as files, for other programs.

use super::Scenario;
use super::settings::Cell;
use crate::labelled_ply::write_cloud;
use crate::{AnyError, at};
use lattice_nodes::files::atomic_write::write_text;
use std::fs;
use std::path::Path;

/// Writes a headset scan to a folder: `SCENE_SEED_map.ply` and `SCENE_SEED_cloud.ply`, as the map and the headset have them, and
/// `SCENE_SEED.json` with the true `map_from_headset`, row by row.
pub(super) fn write_look(folder: &Path, cell: &Cell, scenario: &Scenario) -> Result<(), AnyError> {
    fs::create_dir_all(folder).map_err(at(folder))?;
    let name = format!("{}_{}", cell.scene, cell.seed);
    let (map, cloud) = (scenario.map.cloud(), &scenario.full);
    let path = |kind: &str| folder.join(format!("{name}_{kind}.ply"));
    write_cloud(
        &path("map"),
        map.points_m(),
        |i| map.label(i),
        "voxels of the map, metres",
    )?;
    write_cloud(
        &path("cloud"),
        cloud.points_m(),
        |i| cloud.label(i),
        "points of the headset, metres",
    )?;
    let truth = scenario.truth.to_homogeneous();
    let rows: Vec<Vec<f64>> = (truth.row_iter())
        .map(|row| row.iter().copied().collect())
        .collect();
    let json = serde_json::json!({ "map_from_headset": rows });
    write_text(&folder.join(format!("{name}.json")), &json.to_string())
}
