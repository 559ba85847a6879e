//! Compatibility of parts: one lattice, one map frame, and no point twice.

use std::collections::BTreeMap;

use crate::Result;
use crate::files::at;
use crate::part::{MapInfo, Statistics};
use crate::tables::Part;

/// Setting of a part whose map frame begins at a place of its own.
pub const OWN_FRAME: &str = "--own-frame";

/// The merged map besides its rows. Its datum is the least one, whatever the order of the parts.
///
/// Fails for parts that cannot be merged; `same_frame` admits logs without an origin.
pub fn map_of(parts: &[Part], same_frame: bool) -> Result<MapInfo> {
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
            return Err(format!("{a} and {b} cannot be merged: {reason}").into());
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
    check_copies(parts)?;
    if !same_frame {
        check_frames(parts)?;
    }
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

/// Refuses parts of two recordings of one drive, such as an MCAP and an SQLite log: a tile of both has the same bytes,
/// hence the same cells, sums and stamps.
fn check_copies(parts: &[Part]) -> Result {
    let mut tiles = BTreeMap::<(i64, &str), &Part>::new();
    for part in parts {
        for tile in &part.info.tiles {
            let key = (tile.tile, tile.voxels.sha256.as_str());
            let other = *tiles.entry(key).or_insert(part);
            let (ours, theirs) = (&part.info.source, &other.info.source);
            let is_log = ours.kind == "log" || theirs.kind == "log";
            if other.name == part.name || ours.sha256 == theirs.sha256 || !is_log {
                continue;
            }
            // Without stamps one tile is no evidence; all of them are.
            if part.info.map.stamps || part.info.tiles == other.info.tiles {
                return Err(format!(
                    "{} ({}) and {} ({}) have the same cells, sums and stamps in tile {}: they are one drive, whose \
                     points would count twice; remove one",
                    other.folder.display(),
                    theirs.path,
                    part.folder.display(),
                    ours.path,
                    tile.tile
                )
                .into());
            }
        }
    }
    Ok(())
}

/// Refuses logs without an origin that nothing places in the map frame of the others.
fn check_frames(parts: &[Part]) -> Result {
    let is_own = |part: &&Part| {
        let source = &part.info.source;
        let own = source.kind == "log" || source.settings.iter().any(|text| text == OWN_FRAME);
        own && part.info.map.origin.is_none() && !source.placed
    };
    let own: BTreeMap<_, _> = parts
        .iter()
        .filter(is_own)
        .map(|part| (part.info.source.sha256.as_str(), part))
        .collect();
    let common = parts.iter().find(|part| {
        let is_anchor = part.info.map.origin.is_some() || !part.info.source.placed;
        !is_own(part) && is_anchor
    });
    // One log without an origin may be the map frame in which others were placed.
    let mut frames = own.into_values().chain(common);
    let (Some(part), Some(other)) = (frames.next(), frames.next()) else {
        return Ok(());
    };
    Err(format!(
        "{} ({}) has no geodetic origin, so its map begins where the log begins, and {} ({}) has another map frame: place \
         the log by `lattice fleet align` and `lattice fleet map --corrections`, or give --same-frame if the poses of all \
         logs are in one map frame",
        part.folder.display(),
        part.info.source.path,
        other.folder.display(),
        other.info.source.path
    )
    .into())
}
