//! State of a folder of tables.

use std::fs;
use std::path::Path;

use serde::Serialize;

use crate::Result;
use crate::files::at;
use crate::merge::jobs_of;
use crate::merged::{MERGED_FILE, Merged};
use crate::tables::Tables;

/// State of a folder of tables.
#[derive(Clone, Default, PartialEq, Eq, Debug, Serialize)]
pub struct Status {
    /// Parts that are complete.
    pub parts: usize,
    /// Rows of `voxels` in all parts.
    pub rows: u64,
    /// Bytes of their Parquet files.
    pub bytes: u64,
    /// Tiles with rows.
    pub tiles: usize,
    /// Tiles of the merged map that were made from the parts of now.
    pub tiles_merged: usize,
    /// Folders of parts that were begun and not finished.
    pub unfinished: usize,
    /// Files that are not as they were written.
    pub damaged: Vec<String>,
}

/// The state of now; with `verify` every file is read.
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
            for (path, id) in tile.files(&part.folder) {
                let sound = match verify {
                    true => id.verify(&path),
                    false => match fs::metadata(&path) {
                        Ok(found) if found.len() == id.bytes => Ok(()),
                        Ok(found) => {
                            let (is, was) = (found.len(), id.bytes);
                            Err(at(&path, format!("damaged: {is} bytes instead of {was}")))
                        }
                        Err(error) => Err(at(&path, error)),
                    },
                };
                status
                    .damaged
                    .extend(sound.err().map(|error| error.to_string()));
            }
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
