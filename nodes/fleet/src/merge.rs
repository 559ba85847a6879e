//! The merge stage: one map of all parts, tile by tile; tiles whose parts are as before are kept.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use serde::Serialize;

use crate::Result;
use crate::engine::{Engine, Inputs, Limits, merge as merge_rows};
use crate::files::{at, digest_of, write_manifest};
use crate::merged::{MERGED_FILE, Merged, MergedTile};
use crate::part::{MapInfo, Statistics, TileInfo, VERSION, tile_folder, write_tile};
use crate::rows::TileRows;
use crate::tables::{Part, Tables};
use crate::tile::Tile;

/// Options of the merge stage.
#[derive(Clone, Debug)]
pub struct MergeOptions {
    /// Folder of the merged map.
    pub out: PathBuf,
    /// Engine.
    pub engine: Engine,
    /// Limits of the engine in this process.
    pub limits: Limits,
    /// Most input rows of a query; a tile with more has a query for itself.
    pub rows_at_once: u64,
}

/// Figures of a merge.
#[derive(Clone, Default, PartialEq, Debug, Serialize)]
pub struct MergeReport {
    /// Parts.
    pub parts: usize,
    /// Tiles of the merged map.
    pub tiles: usize,
    /// Tiles whose parts were as before.
    pub tiles_kept: usize,
    /// Rows of the parts in the tiles that were made.
    pub rows_in: u64,
    /// Voxels of the merged map.
    pub voxels: u64,
    /// Points of the merged map.
    pub points: u64,
    /// Bytes of the merged tables.
    pub bytes: u64,
}

/// A tile to be made: its parts with their files of it.
pub type Job<'a> = Vec<(&'a Part, &'a TileInfo)>;

/// Makes the merged map of the tables as it should be now; `progress` gets the share that is done.
pub async fn merge(
    tables: &Tables,
    options: &MergeOptions,
    progress: &mut dyn FnMut(f64),
) -> Result<MergeReport> {
    let parts = tables.parts()?;
    let map = map_of(&parts)?;
    let jobs = jobs_of(&parts);
    check_bounds(&map, &jobs)?;
    fs::create_dir_all(&options.out).map_err(|error| at(&options.out, error))?;
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
    let rows_of = |job: &Job| {
        job.iter()
            .map(|(_, tile)| tile.rows + tile.label_rows)
            .sum::<u64>()
    };
    let all: u64 = todo.iter().map(|(_, job)| rows_of(job)).sum();
    let state = |made: &BTreeMap<Tile, MergedTile>| Merged {
        version: VERSION,
        digest: String::new(),
        map: map.clone(),
        parts: parts.iter().map(|part| part.name.clone()).collect(),
        tiles: made.values().cloned().collect(),
    };
    // Whoever stops this from here on leaves a list of tiles that are whole.
    write_manifest(&place, &state(&made))?;
    let session = options.engine.session(&options.limits).await?;
    let mut rest = &todo[..];
    while !rest.is_empty() {
        let mut rows = 0;
        let fits = rest.iter().take_while(|(_, job)| {
            rows += rows_of(job);
            rows <= options.rows_at_once
        });
        let (batch, later) = rest.split_at(fits.count().clamp(1, rest.len()));
        rest = later;
        let inputs = inputs_of(batch)?;
        let mut tiles = merge_rows(&session, &inputs).await?;
        let work: Vec<_> = batch
            .iter()
            .map(|(tile, job)| (**tile, digest(job), tiles.remove(tile).unwrap_or_default()))
            .collect();
        for tile in write_tiles(&options.out, work, map.labels, options.limits.threads)? {
            made.insert(tile.files.tile, tile);
        }
        report.rows_in += batch.iter().map(|(_, job)| rows_of(job)).sum::<u64>();
        if let Some(tile) = tiles.keys().next() {
            return Err(
                format!("the engine gave rows of tile {tile}, which was not asked for").into(),
            );
        }
        progress(report.rows_in as f64 / all.max(1) as f64);
    }
    write_manifest(&place, &state(&made))?;
    remove_others(&options.out, &made)?;
    report.tiles = made.len();
    report.points = map.statistics.points;
    for tile in made.values() {
        report.voxels += tile.files.rows;
        let labels = tile.files.labels.as_ref().map_or(0, |id| id.bytes);
        let bytes = tile.files.voxels.bytes.saturating_add(labels);
        report.bytes = report.bytes.saturating_add(bytes);
    }
    Ok(report)
}

/// Sorts and writes tiles on several threads; each comes with the digest of what it was made from.
fn write_tiles(
    folder: &Path,
    work: Vec<(Tile, String, TileRows)>,
    labels: bool,
    threads: usize,
) -> Result<Vec<MergedTile>> {
    let (work, done) = (Mutex::new(work), Mutex::new(Vec::new()));
    let held = |list: PoisonError<_>| list.into_inner();
    let write = || {
        loop {
            let next = work.lock().unwrap_or_else(held).pop();
            let Some((tile, made_from, mut rows)) = next else {
                break;
            };
            rows.sort();
            let files = write_tile(folder, tile, &rows, labels);
            let written = files.map(|files| MergedTile { made_from, files });
            done.lock()
                .unwrap_or_else(|list| list.into_inner())
                .push(written);
        }
    };
    std::thread::scope(|scope| {
        for _ in 0..threads.max(1) {
            scope.spawn(write);
        }
    });
    let done = done.into_inner().unwrap_or_else(|list| list.into_inner());
    done.into_iter().collect()
}

/// The map of all parts besides its rows; the least datum counts, so that no order does.
pub fn map_of(parts: &[Part]) -> Result<MapInfo> {
    let [first, rest @ ..] = parts else {
        return Err("there are no parts to merge".into());
    };
    let mut map = first.info.map.clone();
    let mut sums = map
        .columns()
        .map_err(|error| at(&first.folder, error))?
        .statistics;
    for part in rest {
        let other = &part.info.map;
        if let Some(reason) = map.contradiction(other) {
            let (a, b) = (first.folder.display(), part.folder.display());
            return Err(format!("{a} and {b} do not go together: {reason}").into());
        }
        map.origin = map.origin.or(other.origin);
        map.datum_index = map.datum_index.min(other.datum_index);
        sums.add(
            &other
                .columns()
                .map_err(|error| at(&part.folder, error))?
                .statistics,
        );
    }
    check_slices(parts)?;
    map.statistics = Statistics {
        points: sums.points,
        squares: sums.squares.to_string(),
        distances: sums.distances.to_string(),
        largest_square: sums.largest_square,
    };
    Ok(map)
}

/// Refuses parts of one log whose slices share time or whose settings differ: points would count twice.
fn check_slices(parts: &[Part]) -> Result {
    let mut logs = BTreeMap::<&str, Vec<&Part>>::new();
    for part in parts.iter().filter(|part| part.info.source.kind == "log") {
        logs.entry(&part.info.source.sha256).or_default().push(part);
    }
    for slices in logs.values_mut() {
        slices.sort_by(|a, b| a.info.source.slice_s.0.total_cmp(&b.info.source.slice_s.0));
        for pair in slices.windows(2) {
            let [a, b] = pair else { continue };
            let (first, second) = (&a.info.source, &b.info.source);
            let apart = first.slice_s.1.is_some_and(|end| end <= second.slice_s.0);
            if apart && (&first.settings, &first.program) == (&second.settings, &second.program) {
                continue;
            }
            return Err(format!(
                "{} and {} are both of log {}, slices {:?} and {:?} s, options {:?} and {:?}: \
                 the same points would count twice; remove one",
                a.folder.display(),
                b.folder.display(),
                first.path,
                first.slice_s,
                second.slice_s,
                first.settings,
                second.settings
            )
            .into());
        }
    }
    Ok(())
}

/// Refuses what could reach beyond 64 bits, where most engines wrap around without a word.
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

/// Digest of what a tile is made from.
pub fn digest(job: &Job) -> String {
    let texts = job.iter().flat_map(|(part, tile)| {
        let labels = tile.labels.as_ref().map_or("", |id| id.sha256.as_str());
        [part.name.as_str(), tile.voxels.sha256.as_str(), labels]
    });
    digest_of(texts)
}

/// Verified files of some tiles.
fn inputs_of(jobs: &[(&Tile, &Job)]) -> Result<Inputs> {
    let mut inputs = Inputs::default();
    for (part, tile) in jobs.iter().flat_map(|(_, job)| job.iter()) {
        let folder = part
            .folder
            .canonicalize()
            .map_err(|error| at(&part.folder, error))?;
        tile.verify(&folder)?;
        tile.check_footers(&folder)?;
        for (number, (path, _)) in tile.files(&folder).into_iter().enumerate() {
            let path = path.into_os_string().into_string();
            let path = path.map_err(|path| format!("{path:?} is no UTF-8"))?;
            if number == 0 {
                &mut inputs.voxels
            } else {
                &mut inputs.labels
            }
            .push(path);
        }
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
        };
        let tile = TileInfo {
            tile: 7,
            rows: 1,
            label_rows: 0,
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
            check_bounds(&map_of(&parts).unwrap(), &jobs_of(&parts))
        };
        assert!(bound(&[1 << 40, 1 << 40]).is_ok());
        let error = bound(&[1 << 43, 1 << 43]).unwrap_err().to_string();
        assert!(
            error.contains("tile 7") && error.contains("more than 64 bits hold"),
            "{error}"
        );
    }
}
