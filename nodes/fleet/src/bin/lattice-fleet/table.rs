//! `lattice map to-table` and `from-table`.

use std::path::{Path, PathBuf};

use clap::Args;
use lattice_core::voxels::file::{MapContents, WriteOptions};
use lattice_fleet::Result;
use lattice_fleet::compatibility::OWN_FRAME;
use lattice_fleet::files::{FileId, at, write_whole};
use lattice_fleet::merged::{MERGED_FILE, read_merged};
use lattice_fleet::part::{PartInfo, Source};
use lattice_fleet::tables::{PART_FILE, Tables, read_map, read_map_file};

/// Options of `lattice map to-table`.
#[derive(Args)]
pub struct ToTable {
    /// Map files
    #[arg(required = true)]
    maps: Vec<PathBuf>,
    /// Folder of tables, created if needed; a map that it has already counts once
    #[arg(long, short, value_name = "DIR")]
    out: PathBuf,
    /// Origin of the maps: latitude and longitude in degrees, height above the ellipsoid in m
    #[arg(long, num_args = 3, value_names = ["LAT", "LON", "HEIGHT"], allow_negative_numbers = true)]
    origin: Option<Vec<f64>>,
    /// The map frame of each map begins where its log begins, as without a geodetic origin; `lattice replay` says so
    #[arg(long, conflicts_with = "origin")]
    own_frame: bool,
    /// Print the names of the parts as JSON
    #[arg(long)]
    json: bool,
}

/// Options of `lattice map from-table`.
#[derive(Args)]
pub struct FromTable {
    /// Folder of tables with one part, a part of it, or a merged map
    folder: PathBuf,
    /// Map file to write
    #[arg(long, short)]
    out: PathBuf,
    /// Compress by zstd, at a level of 1..=19 (--zstd=LEVEL)
    #[arg(
        long, value_name = "LEVEL", num_args = 0..=1, require_equals = true,
        default_missing_value = "3", value_parser = clap::value_parser!(i32).range(1..=19),
    )]
    zstd: Option<i32>,
}

impl ToTable {
    /// Runs the command.
    pub fn run(self) -> Result {
        let tables = Tables::open_or_create(&self.out)?;
        let origin: Option<[f64; 3]> = match self.origin {
            Some(given) => Some(
                given
                    .try_into()
                    .map_err(|_| "--origin needs three numbers")?,
            ),
            None => None,
        };
        let mut settings: Vec<_> = origin.iter().map(|at| format!("--origin {at:?}")).collect();
        settings.extend(self.own_frame.then(|| OWN_FRAME.to_owned()));
        let mut names = Vec::new();
        for path in &self.maps {
            let map = read_map_file(path)?;
            let source = Source {
                kind: "map".to_owned(),
                path: path.display().to_string(),
                sha256: FileId::of(path).map_err(|error| at(path, error))?.sha256,
                slice_s: (0.0, None),
                settings: settings.clone(),
                program: String::new(),
                placed: false,
            };
            let voxels = map.keys().len();
            let added = tables
                .add(&map.into(), source, origin)
                .map_err(|error| at(path, error))?;
            if !self.json {
                let there = if added.new {
                    ""
                } else {
                    ", which exists already"
                };
                println!(
                    "{}: {voxels} voxels, part {}{there}",
                    path.display(),
                    added.name
                );
            }
            names.push(added.name);
        }
        if self.json {
            println!("{}", serde_json::to_string(&names)?);
        }
        Ok(())
    }
}

impl FromTable {
    /// Runs the command.
    pub fn run(self) -> Result {
        let map = read(&self.folder)?;
        write_map(&map, &self.out, self.zstd)?;
        println!("{}: {} voxels", self.out.display(), map.keys().len());
        Ok(())
    }
}

fn read(folder: &Path) -> Result<MapContents> {
    if folder.join(MERGED_FILE).is_file() {
        return read_merged(folder);
    }
    let part = folder.join(PART_FILE);
    if part.is_file() {
        let info = PartInfo::read(&part)?;
        return read_map(folder, &info.map, &info.tiles);
    }
    let parts = Tables::open(folder)?.parts()?;
    match &parts[..] {
        [part] => read_map(&part.folder, &part.info.map, &part.info.tiles),
        parts => {
            let count = parts.len();
            let reason = format!("{count} parts, not one: merge them by `lattice fleet merge`");
            Err(at(folder, reason))
        }
    }
}

/// Writes a map file.
pub fn write_map(map: &MapContents, out: &Path, zstd_level: Option<i32>) -> Result {
    let options = WriteOptions {
        zstd_level,
        occupancy_only: false,
    };
    write_whole(out, |file| {
        let writer = std::io::BufWriter::new(file);
        Ok(map.write(writer, &options)?)
    })
}
