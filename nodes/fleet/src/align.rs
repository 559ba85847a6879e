//! Alignment of logs with a merged map: a proposed correction of each log's poses, with a verdict.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;

use lattice_core::lattice::MortonKey;
use lattice_core::voxels::file::{MapContents, WriteOptions};
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use serde::Deserialize;

use crate::Result;
use crate::corrections::{Action, Correction, Corrections, Found, VERSION};
use crate::files::{at, write_whole};
use crate::merged::Merged;
use crate::stop::{self, Scratch};
use crate::tables::{Part, Tables, read_map};
use crate::tile::{TILE_LOG2, Tile};
use crate::tile_files::TileInfo;

/// Options of an alignment.
#[derive(Clone, Debug)]
pub struct AlignOptions {
    /// The program `lattice`.
    pub program: PathBuf,
    /// Profile of `lattice calibrate`.
    pub profile: String,
    /// Largest move of a corner of the log's box, m.
    pub max_move_m: f64,
    /// Largest rotation, degrees.
    pub max_turn_deg: f64,
    /// Smallest move, m; none: a quarter of the cell size.
    pub min_move_m: Option<f64>,
}

/// Proposes a correction for each log that has parts in `tables`. The reference is a folder with a merged map that holds
/// none of these parts.
///
/// `progress` gets the number of logs that are done.
pub fn align(
    tables: &Tables,
    reference: &Path,
    options: &AlignOptions,
    progress: &mut dyn FnMut(usize),
) -> Result<Corrections> {
    let merged = Merged::read(reference)?;
    let logs = logs_of(tables, &merged)?;
    let mut corrections = Corrections {
        version: VERSION,
        logs: Vec::new(),
    };
    for (sha256, parts) in logs {
        let mut entry = correction(tables, reference, &merged, &parts, options)?;
        entry.sha256 = sha256;
        corrections.logs.push(entry);
        progress(corrections.logs.len());
    }
    corrections.logs.sort_by(|a, b| a.log.cmp(&b.log));
    Ok(corrections)
}

/// Number of logs of which there are parts.
pub fn count_logs(tables: &Tables) -> Result<usize> {
    let parts = tables.parts()?;
    let digests: BTreeSet<_> = parts.iter().map(|part| &part.info.source.sha256).collect();
    Ok(digests.len())
}

/// The parts by log. Fails for parts in the reference and for corrected ones.
fn logs_of(tables: &Tables, merged: &Merged) -> Result<BTreeMap<String, Vec<Part>>> {
    let mut logs: BTreeMap<String, Vec<Part>> = BTreeMap::new();
    for part in tables.parts()? {
        let source = &part.info.source;
        let refuse = |reason: &str| Err(at(&part.folder, format!("{}: {reason}", source.path)));
        if source.kind != "log" {
            return refuse("a map file has no poses to correct; align logs");
        }
        let mut settings = source.settings.iter();
        if settings.any(|text| text.contains("correction.")) {
            return refuse(
                "it is corrected already; align the log as it was mapped without corrections",
            );
        }
        if merged.parts.contains(&part.name) {
            return refuse(
                "it is in the map that it would be aligned with, so it would fit; map new logs to a folder of \
                 their own and align that",
            );
        }
        if let Some(reason) = merged.map.contradiction(&part.info.map) {
            return refuse(&reason);
        }
        logs.entry(source.sha256.clone()).or_default().push(part);
    }
    match logs.is_empty() {
        true => Err(at(tables.folder(), "no part is of a log")),
        false => Ok(logs),
    }
}

/// Members of the report of `lattice calibrate --json`.
#[derive(Deserialize)]
struct Answer {
    verdict: String,
    reason: String,
    map_from_cloud: Option<Pose>,
    #[serde(default)]
    sigma_m: Option<[f64; 3]>,
    #[serde(default)]
    sigma_deg: Option<[f64; 3]>,
    #[serde(default)]
    p_wrong: Option<f64>,
    #[serde(default)]
    inlier_fraction: Option<f64>,
}

#[derive(Deserialize)]
struct Pose {
    translation_m: [f64; 3],
    rotation_xyzw: [f64; 4],
}

impl Pose {
    fn isometry(&self) -> Isometry3<f64> {
        let [x, y, z, w] = self.rotation_xyzw;
        Isometry3::from_parts(
            Translation3::from(Vector3::from(self.translation_m)),
            UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z)),
        )
    }
}

fn correction(
    tables: &Tables,
    reference: &Path,
    merged: &Merged,
    parts: &[Part],
    options: &AlignOptions,
) -> Result<Correction> {
    let log = parts.first().map(|part| part.info.source.path.clone());
    let mut entry = Correction {
        log: log.unwrap_or_default(),
        ..Correction::default()
    };
    let parent = tables.scratch_folder();
    let scratch = Scratch::create(&parent, ".align-").map_err(|error| at(&parent, error))?;
    let map = scratch.path().join("reference.lat");
    let mut corners = Corners::default();
    let mut command = Command::new(&options.program);
    command.arg("calibrate").arg("--map").arg(&map);
    for part in parts {
        let contents = read_map(&part.folder, &part.info.map, &part.info.tiles)?;
        contents
            .keys()
            .iter()
            .for_each(|key| corners.add(contents.center_m(*key)));
        let file = scratch.path().join(format!("{}.lat", part.name));
        write(&contents, &file)?;
        command.arg("--cloud").arg(&file);
    }
    let turn_rad = options.max_turn_deg.to_radians();
    // The rotation is about the origin of the map, from which the log may be far away.
    let radius_m = options.max_move_m + turn_rad * corners.farthest_m();
    let near = near(merged, parts, radius_m);
    if near.is_empty() {
        entry.reason = format!("no tile of the reference is within {radius_m:.1} m");
        return Ok(entry);
    }
    write(&read_map(reference, &merged.map, &near)?, &map)?;
    command.args([
        "--json",
        "--profile",
        &options.profile,
        "--guess",
        "0 0 0 0",
    ]);
    command.args(["--guess-radius", &radius_m.to_string()]);
    command.args(["--guess-yaw", &turn_rad.to_string()]);
    decide(&mut entry, &answer_of(command)?, &corners, merged, options);
    Ok(entry)
}

/// Sets the action, and the correction if there is one.
fn decide(
    entry: &mut Correction,
    answer: &Answer,
    corners: &Corners,
    merged: &Merged,
    options: &AlignOptions,
) {
    let pose = answer.map_from_cloud.as_ref().map(Pose::isometry);
    let pose = pose.filter(|pose| {
        pose.to_homogeneous()
            .iter()
            .all(|number| number.is_finite())
    });
    let largest_move_m = pose.map_or(f64::INFINITY, |pose| corners.largest_move_m(&pose));
    let turn_deg = pose.map_or(0.0, |pose| pose.rotation.angle().to_degrees());
    let min_move_m = options
        .min_move_m
        .unwrap_or_else(|| merged.map.cell_volume_m3.cbrt() / 4.0);
    entry.reason.clone_from(&answer.reason);
    let Some(pose) = pose else {
        return;
    };
    entry.found = Some(Found {
        verdict: answer.verdict.clone(),
        largest_move_m,
        turn_deg,
        inlier_fraction: answer.inlier_fraction.unwrap_or(0.0),
        p_wrong: answer.p_wrong.unwrap_or(1.0),
        sigma_m: answer.sigma_m.unwrap_or_default(),
        sigma_deg: answer.sigma_deg.unwrap_or_default(),
    });
    entry.action = if answer.verdict != "OK" {
        Action::LeaveOut
    } else if largest_move_m > options.max_move_m || turn_deg > options.max_turn_deg {
        let (max_m, max_deg) = (options.max_move_m, options.max_turn_deg);
        entry.reason = format!(
            "it would move by {largest_move_m:.2} m and turn by {turn_deg:.2} degrees, above the limits of {max_m} m \
             (`--max-move`) and {max_deg} degrees (`--max-turn`)"
        );
        Action::LeaveOut
    } else if largest_move_m < min_move_m {
        Action::Keep
    } else {
        Action::Move
    };
    if entry.action != Action::Keep {
        let rounded = |value: f64| (value * 1e9).round() / 1e9;
        let (roll, pitch, yaw) = pose.rotation.euler_angles();
        entry.translation_m = pose.translation.vector.map(rounded).into();
        entry.rpy_rad = [roll, pitch, yaw].map(rounded);
    }
}

/// The tiles of the merged map within some distance of the cells of the parts.
fn near(merged: &Merged, parts: &[Part], radius_m: f64) -> Vec<TileInfo> {
    let place = |tile: Tile| Some(MortonKey::from_raw(u64::try_from(tile).ok()?)?.unpack());
    let tiles = parts.iter().flat_map(|part| &part.info.tiles);
    let places: BTreeSet<_> = tiles.filter_map(|tile| place(tile.tile)).collect();
    let side_m = merged.map.shortest_step_m() * f64::from(1 << TILE_LOG2);
    let reach = (radius_m / side_m).ceil().max(1.0);
    let is_near = |[x, y, z]: [i32; 3]| {
        let distance = |a: i32, b: i32| (f64::from(a) - f64::from(b)).abs();
        let mut distances = places.iter().map(|place| {
            distance(x, place[0])
                .max(distance(y, place[1]))
                .max(distance(z, place[2]))
        });
        distances.any(|tiles| tiles <= reach)
    };
    let tiles = merged.tiles.iter().map(|tile| &tile.files);
    tiles
        .filter(|tile| place(tile.tile).is_some_and(is_near))
        .cloned()
        .collect()
}

fn write(map: &MapContents, path: &Path) -> Result {
    let options = WriteOptions {
        zstd_level: None,
        occupancy_only: false,
    };
    write_whole(path, |file| {
        Ok(map.write(std::io::BufWriter::new(file), &options)?)
    })
}

/// The report of `lattice calibrate`, which fails for other verdicts than OK.
fn answer_of(command: Command) -> Result<Answer> {
    let program = PathBuf::from(command.get_program());
    let output = stop::output_of(command).map_err(|error| at(&program, error))?;
    serde_json::from_slice(&output.stdout).map_err(|error| {
        let said = String::from_utf8_lossy(&output.stderr);
        let said = said.trim().lines().last().unwrap_or_default();
        format!("lattice calibrate: {said} ({error}, {})", output.status).into()
    })
}

/// Box around the cells of a log.
struct Corners {
    least_m: Vector3<f64>,
    greatest_m: Vector3<f64>,
}

impl Default for Corners {
    fn default() -> Corners {
        Corners {
            least_m: Vector3::repeat(f64::INFINITY),
            greatest_m: Vector3::repeat(f64::NEG_INFINITY),
        }
    }
}

impl Corners {
    fn add(&mut self, point_m: Vector3<f64>) {
        self.least_m = self.least_m.inf(&point_m);
        self.greatest_m = self.greatest_m.sup(&point_m);
    }

    fn all_m(&self) -> impl Iterator<Item = Vector3<f64>> {
        (0..8).map(|corner| {
            let side = |axis: usize| match corner >> axis & 1 {
                0 => self.least_m[axis],
                _ => self.greatest_m[axis],
            };
            Vector3::new(side(0), side(1), side(2))
        })
    }

    fn farthest_m(&self) -> f64 {
        self.all_m().map(|corner| corner.norm()).fold(0.0, f64::max)
    }

    fn largest_move_m(&self, pose: &Isometry3<f64>) -> f64 {
        let moves = self.all_m().map(|corner| {
            (pose * nalgebra::Point3::from(corner) - corner)
                .coords
                .norm()
        });
        moves.fold(0.0, f64::max)
    }
}
