//! Merge stage: one map of all parts, tile by tile. Tiles whose parts are unchanged are kept.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use serde::Serialize;

use crate::Result;
use crate::compatibility::map_of;
use crate::engine::{Engine, Inputs, Limits, MergedRows, merge as merge_rows};
use crate::files::{at, digest_of, write_manifest};
use crate::merged::{MERGED_FILE, Merged, MergedTile};
use crate::part::{MapInfo, VERSION};
use crate::rows::{TileRows, Totals};
use crate::stop::Scratch;
use crate::tables::{Part, Tables};
use crate::tile::Tile;
use crate::tile_files::{TileInfo, tile_folder, write_tile};

/// Options of the merge stage.
#[derive(Clone, Debug)]
pub struct MergeOptions {
    /// Folder of the merged map.
    pub out: PathBuf,
    /// Engine.
    pub engine: Engine,
    /// Limits of the engine in this process.
    pub limits: Limits,
    /// Largest number of input rows of a query; a tile with more has a query of its own.
    pub rows_at_once: u64,
    /// True if logs without an origin are known to have one map frame.
    pub same_frame: bool,
}

/// Counts of a merge.
#[derive(Clone, Default, PartialEq, Debug, Serialize)]
pub struct MergeReport {
    /// Parts.
    pub parts: usize,
    /// Tiles of the merged map.
    pub tiles: usize,
    /// Tiles whose parts were unchanged.
    pub tiles_kept: usize,
    /// Input rows of the tiles that were made.
    pub rows_in: u64,
    /// Voxels of the merged map.
    pub voxels: u64,
    /// Points of the merged map.
    pub points: u64,
    /// Bytes of the merged tables.
    pub bytes: u64,
}

/// Sources of a tile: its parts, each with its files of the tile.
pub type Job<'a> = Vec<(&'a Part, &'a TileInfo)>;

/// Updates the merged map of the tables; `progress` gets the fraction that is done.
///
/// New tiles take their place when all rows have come and agree with the manifests; until then the merged map stays as
/// it was.
pub async fn merge(
    tables: &Tables,
    options: &MergeOptions,
    progress: &mut dyn FnMut(f64),
) -> Result<MergeReport> {
    let parts = tables.parts()?;
    let map = map_of(&parts, options.same_frame)?;
    let jobs = jobs_of(&parts);
    check_bounds(&map, &jobs)?;
    let place = options.out.join(MERGED_FILE);
    let before: Option<Merged> = match place.exists() {
        true => Some(Merged::read(&options.out)?),
        false => None,
    };
    let mut made: BTreeMap<Tile, MergedTile> = BTreeMap::new();
    for tile in before.iter().flat_map(|before| &before.tiles) {
        let job = jobs.get(&tile.files.tile);
        let as_before = job.is_some_and(|job| digest(job) == tile.made_from);
        if as_before && tile.files.verify(&options.out).is_ok() {
            made.insert(tile.files.tile, tile.clone());
        }
    }
    let mut report = MergeReport {
        parts: parts.len(),
        tiles_kept: made.len(),
        ..MergeReport::default()
    };
    let todo: Vec<_> = jobs
        .iter()
        .filter(|(tile, _)| !made.contains_key(tile))
        .collect();
    let all: u64 = todo.iter().map(|(_, job)| rows_of(job)).sum();
    let threads = options.limits.threads;
    let created = !options.out.exists();
    fs::create_dir_all(&options.out).map_err(|error| at(&options.out, error))?;
    let staging = Scratch::create(&options.out, ".new-");
    let staging = staging.map_err(|error| at(&options.out, error))?;
    let spill = Scratch::create(&std::env::temp_dir(), "lattice-fleet-")?;
    let session = options
        .engine
        .session(&options.limits, spill.path())
        .await?;
    let mut new: BTreeMap<Tile, MergedTile> = BTreeMap::new();
    let mut make = async || -> Result {
        let mut rest = &todo[..];
        while !rest.is_empty() {
            let mut rows = 0;
            let fits = rest.iter().take_while(|(_, job)| {
                rows += rows_of(job);
                rows <= options.rows_at_once
            });
            let (batch, later) = rest.split_at(fits.count().clamp(1, rest.len()));
            rest = later;
            let inputs = inputs_of(batch, threads)?;
            let mut tiles = merge_rows(&session, &inputs).await?;
            let mut work = Vec::new();
            for (tile, job) in batch {
                let merged = tiles.remove(tile).unwrap_or_default();
                check_read(**tile, job, &merged)?;
                work.push((**tile, digest(job), merged.rows));
            }
            if let Some(tile) = tiles.keys().next() {
                let reason =
                    format!("the engine returned rows of tile {tile}, which was not queried");
                return Err(reason.into());
            }
            for tile in write_tiles(staging.path(), work, map.labels, threads)? {
                new.insert(tile.files.tile, tile);
            }
            report.rows_in += batch.iter().map(|(_, job)| rows_of(job)).sum::<u64>();
            progress(report.rows_in as f64 / all.max(1) as f64);
        }
        Ok(())
    };
    if let Err(error) = make().await {
        drop(staging);
        if created {
            // Fails for a folder with files, which stays.
            let _ = fs::remove_dir(&options.out);
        }
        return Err(error);
    }
    for tile in new.values() {
        take_place(staging.path(), &options.out, &tile.files)?;
    }
    made.extend(new);
    let merged = Merged {
        version: VERSION,
        digest: String::new(),
        map,
        parts: parts.iter().map(|part| part.name.clone()).collect(),
        tiles: made.values().cloned().collect(),
    };
    write_manifest(&place, &merged)?;
    remove_others(&options.out, &made)?;
    report.tiles = made.len();
    report.points = merged.map.statistics.points;
    for tile in made.values() {
        report.voxels += tile.files.rows;
        let labels = tile.files.labels.as_ref().map_or(0, |id| id.bytes);
        let bytes = tile.files.voxels.bytes.saturating_add(labels);
        report.bytes = report.bytes.saturating_add(bytes);
    }
    Ok(report)
}

/// Input rows of a tile.
fn rows_of(job: &Job) -> u64 {
    let rows = job.iter().map(|(_, tile)| tile.rows + tile.label_rows);
    rows.sum()
}

/// Refuses the rows of a tile unless the engine has read all rows and points of its parts.
fn check_read(tile: Tile, job: &Job, merged: &MergedRows) -> Result {
    let mut promised = Totals::default();
    for (_, files) in job {
        promised.add(&files.totals());
    }
    let read = merged.read;
    if read == promised {
        return Ok(());
    }
    let parts = job
        .iter()
        .map(|(part, _)| part.folder.display().to_string());
    let parts = parts.collect::<Vec<_>>().join(", ");
    Err(format!(
        "tile {tile}: the engine has read {read}, the manifests promise {promised}: {parts}; did the files change \
         meanwhile?"
    )
    .into())
}

/// Moves the files of a new tile to their place.
fn take_place(staging: &Path, out: &Path, tile: &TileInfo) -> Result {
    let folder = tile_folder(out, tile.tile);
    fs::create_dir_all(&folder).map_err(|error| at(&folder, error))?;
    let (from, to) = (tile.files(staging), tile.files(out));
    for ((from, _), (to, _)) in from.iter().zip(&to) {
        fs::rename(from, to).map_err(|error| at(to, error))?;
    }
    Ok(())
}

/// Sorts and writes tiles on several threads, each with the digest of its sources.
fn write_tiles(
    folder: &Path,
    work: Vec<(Tile, String, TileRows)>,
    labels: bool,
    threads: usize,
) -> Result<Vec<MergedTile>> {
    let (work, done) = (Mutex::new(work), Mutex::new(Vec::new()));
    let write = || {
        loop {
            let next = work.lock().unwrap_or_else(PoisonError::into_inner).pop();
            let Some((tile, made_from, mut rows)) = next else {
                break;
            };
            rows.sort();
            let files = write_tile(folder, tile, &rows, labels);
            let written = files.map(|files| MergedTile { made_from, files });
            done.lock()
                .unwrap_or_else(PoisonError::into_inner)
                .push(written);
        }
    };
    std::thread::scope(|scope| {
        for _ in 0..threads.max(1) {
            scope.spawn(write);
        }
    });
    let done = done.into_inner().unwrap_or_else(PoisonError::into_inner);
    done.into_iter().collect()
}

/// Refuses sums that could exceed 64 bits, where most engines wrap around silently.
fn check_bounds(map: &MapInfo, jobs: &BTreeMap<Tile, Job>) -> Result {
    let reach = lattice_core::voxels::file::MapColumns::offset_reach(&map.columns()?.lattice);
    for (tile, job) in jobs {
        let counts = job.iter().map(|(_, tile)| tile.max_count.max(0) as u128);
        let bound = counts.sum::<u128>() * u128::from(reach);
        if bound > i64::MAX as u128 {
            return Err(format!(
                "tile {tile}: offset sums of a cell may reach {bound} units, more than 64 bits hold: \
                 merge fewer parts"
            )
            .into());
        }
    }
    Ok(())
}

/// The parts of each tile.
pub fn jobs_of(parts: &[Part]) -> BTreeMap<Tile, Job<'_>> {
    let mut jobs = BTreeMap::<Tile, Job>::new();
    for part in parts {
        for tile in &part.info.tiles {
            jobs.entry(tile.tile).or_default().push((part, tile));
        }
    }
    jobs
}

/// Digest of the sources of a tile.
pub fn digest(job: &Job) -> String {
    let texts = job.iter().flat_map(|(part, tile)| {
        let labels = tile.labels.as_ref().map_or("", |id| id.sha256.as_str());
        [part.name.as_str(), tile.voxels.sha256.as_str(), labels]
    });
    digest_of(texts)
}

/// Files of some tiles, each read through on several threads and held against its manifest.
fn inputs_of(jobs: &[(&Tile, &Job)], threads: usize) -> Result<Inputs> {
    let files: Vec<_> = jobs.iter().flat_map(|(_, job)| job.iter()).collect();
    let (next, wrong) = (AtomicUsize::new(0), Mutex::new(BTreeMap::new()));
    let check = || {
        loop {
            let number = next.fetch_add(1, Ordering::Relaxed);
            let Some((part, tile)) = files.get(number) else {
                break;
            };
            if let Err(error) = tile.check(&part.folder, &part.info.map) {
                next.fetch_max(files.len(), Ordering::Relaxed);
                let mut wrong = wrong.lock().unwrap_or_else(PoisonError::into_inner);
                wrong.insert(number, error);
            }
        }
    };
    std::thread::scope(|scope| {
        for _ in 0..threads.clamp(1, files.len().max(1)) {
            scope.spawn(check);
        }
    });
    let wrong = wrong.into_inner().unwrap_or_else(PoisonError::into_inner);
    if let Some((_, error)) = wrong.into_iter().next() {
        return Err(error);
    }
    let mut inputs = Inputs::default();
    for (part, tile) in files {
        let folder = part.folder.canonicalize();
        let folder = folder.map_err(|error| at(&part.folder, error))?;
        let mut files = tile.files(&folder).into_iter().map(|(path, _)| path);
        inputs.voxels.extend(files.next());
        inputs.labels.extend(files);
    }
    Ok(inputs)
}

/// Removes tiles that the merged map no longer has.
fn remove_others(folder: &Path, made: &BTreeMap<Tile, MergedTile>) -> Result {
    let wanted: BTreeSet<PathBuf> = made.keys().map(|tile| tile_folder(folder, *tile)).collect();
    for entry in fs::read_dir(folder).map_err(|error| at(folder, error))? {
        let path = entry.map_err(|error| at(folder, error))?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if name.starts_with("tile=") && !wanted.contains(&path) {
            fs::remove_dir_all(&path).map_err(|error| at(&path, error))?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use lattice_core::lattice::{Lattice, LatticeKind};
    use lattice_core::voxels::VoxelList;
    use lattice_core::voxels::file::MapContents;

    use super::*;
    use crate::part::{PartInfo, Source};

    fn part(max_count: i64) -> Part {
        let lattice = Lattice::new(LatticeKind::Fcc, 1.0).unwrap();
        let list = VoxelList::new(lattice, nalgebra::Vector3::zeros(), 1).unwrap();
        let source = Source {
            kind: "map".to_owned(),
            path: String::new(),
            sha256: String::new(),
            slice_s: (0.0, None),
            settings: Vec::new(),
            program: String::new(),
            placed: false,
        };
        let tile = TileInfo {
            tile: 7,
            rows: 1,
            points: max_count as u64,
            label_rows: 0,
            labelled_points: 0,
            max_count,
            voxels: Default::default(),
            labels: None,
        };
        Part {
            name: String::new(),
            folder: PathBuf::new(),
            info: PartInfo {
                version: VERSION,
                digest: String::new(),
                source,
                map: MapInfo::of(&MapContents::from_list(&list).into(), None),
                tiles: vec![tile],
            },
        }
    }

    #[test]
    fn sums_that_could_wrap_around_are_refused_with_the_numbers() {
        let bound = |counts: &[i64]| {
            let parts: Vec<_> = counts.iter().map(|count| part(*count)).collect();
            check_bounds(&map_of(&parts, false).unwrap(), &jobs_of(&parts))
        };
        assert!(bound(&[1 << 40, 1 << 40]).is_ok());
        let error = bound(&[1 << 43, 1 << 43]).unwrap_err().to_string();
        assert!(
            error.contains("tile 7") && error.contains("more than 64 bits hold"),
            "{error}"
        );
    }
}
