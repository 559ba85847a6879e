//! State of a folder of tables.

use std::fs;
use std::path::Path;

use serde::Serialize;

use crate::files::{FileId, at};
use crate::merge::jobs_of;
use crate::merged::{MERGED_FILE, Merged};
use crate::tables::Tables;
use crate::{AnyError, Result};

/// State of a folder of tables.
#[derive(Clone, Default, PartialEq, Eq, Debug, Serialize)]
pub struct Status {
    /// Complete parts.
    pub parts: usize,
    /// Rows of `voxels` in all parts.
    pub rows: u64,
    /// Bytes of their Parquet files.
    pub bytes: u64,
    /// Tiles with rows.
    pub tiles: usize,
    /// Tiles of the merged map that are up to date.
    pub tiles_merged: usize,
    /// Unfinished parts: entries of the temporary folder.
    pub unfinished: usize,
    /// Errors of damaged files.
    pub damaged: Vec<String>,
}

/// Determines the state; `verify` reads every file.
pub fn status(tables: &Tables, merged: &Path, verify: bool) -> Result<Status> {
    let parts = tables.parts()?;
    let jobs = jobs_of(&parts);
    let mut status = Status {
        parts: parts.len(),
        tiles: jobs.len(),
        ..Status::default()
    };
    for part in &parts {
        for tile in &part.info.tiles {
            status.rows += tile.rows;
            let labels = tile.labels.as_ref().map_or(0, |id| id.bytes);
            let bytes = tile.voxels.bytes.saturating_add(labels);
            status.bytes = status.bytes.saturating_add(bytes);
            let wrong = if verify {
                tile.check(&part.folder, &part.info.map).err()
            } else {
                let files = tile.files(&part.folder);
                files.iter().find_map(|(path, id)| size_error(path, id))
            };
            status.damaged.extend(wrong.map(|error| error.to_string()));
        }
    }
    let place = merged.join(MERGED_FILE);
    if place.is_file() {
        let merged = Merged::read(merged)?;
        let as_now = merged.tiles.iter().filter(|tile| {
            let job = jobs.get(&tile.files.tile);
            job.is_some_and(|job| crate::merge::digest(job) == tile.made_from)
        });
        status.tiles_merged = as_now.count();
    }
    let scratch = tables.scratch_folder();
    if scratch.is_dir() {
        status.unfinished = fs::read_dir(&scratch)
            .map_err(|error| at(&scratch, error))?
            .count();
    }
    Ok(status)
}

/// The error of a file whose size differs from its manifest.
fn size_error(path: &Path, id: &FileId) -> Option<AnyError> {
    match fs::metadata(path) {
        Ok(found) if found.len() == id.bytes => None,
        Ok(found) => {
            let (is, was) = (found.len(), id.bytes);
            Some(at(
                path,
                format!("damaged: {is} bytes, its manifest has {was}"),
            ))
        }
        Err(error) => Some(at(path, error)),
    }
}
