//! Folder of tables: complete parts, each named by the digest of its source.

use std::collections::BTreeMap;
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use lattice_core::voxels::file::{MapColumns, MapContents, max_voxels_of};

use crate::files::{at, digest_of, write_manifest};
use crate::part::{MapInfo, PartInfo, Source, VERSION};
use crate::rows::{self, MapOfTiles};
use crate::stop::Scratch;
use crate::tile_files::{TileInfo, write_tile};
use crate::{Result, files};

/// Name of the manifest of a part; it is written last.
pub const PART_FILE: &str = "part.json";

/// A folder of tables.
#[derive(Clone, Debug)]
pub struct Tables {
    folder: PathBuf,
}

/// A complete part.
#[derive(Clone, Debug)]
pub struct Part {
    /// Name: the digest of its source.
    pub name: String,
    /// Folder.
    pub folder: PathBuf,
    /// Contents and source.
    pub info: PartInfo,
}

/// Result of adding a part.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Added {
    /// Name of the part.
    pub name: String,
    /// False if the folder had it already.
    pub new: bool,
}

impl Source {
    /// Name of the part with this source: a digest in 32 hexadecimal digits.
    pub fn part_name(&self) -> String {
        let slice = format!(
            "{:?} {:?}",
            self.slice_s.0.to_bits(),
            self.slice_s.1.map(f64::to_bits)
        );
        let version = VERSION.to_string();
        let fixed = [&version, &self.kind, &self.sha256, &slice, &self.program];
        let texts = fixed.into_iter().chain(&self.settings).map(String::as_str);
        let mut name = digest_of(texts);
        name.truncate(32);
        name
    }
}

impl Tables {
    /// The tables in a folder, which is created if needed.
    pub fn open_or_create(folder: &Path) -> Result<Tables> {
        let tables = Tables {
            folder: folder.to_owned(),
        };
        for folder in [tables.parts_folder(), tables.scratch_folder()] {
            fs::create_dir_all(&folder).map_err(|error| at(&folder, error))?;
        }
        Ok(tables)
    }

    /// The tables in a folder.
    pub fn open(folder: &Path) -> Result<Tables> {
        let tables = Tables {
            folder: folder.to_owned(),
        };
        if !tables.parts_folder().is_dir() {
            return Err(at(
                folder,
                "no folder of tables: it has no folder \"parts\"",
            ));
        }
        Ok(tables)
    }

    /// The folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    fn parts_folder(&self) -> PathBuf {
        self.folder.join("parts")
    }

    /// Folder of files being written.
    pub fn scratch_folder(&self) -> PathBuf {
        self.folder.join("tmp")
    }

    /// True if a part is complete.
    pub fn has(&self, name: &str) -> bool {
        self.parts_folder().join(name).join(PART_FILE).is_file()
    }

    /// Adds a map as a part, which is written in a temporary folder and renamed. An existing part stays.
    pub fn add(&self, map: &MapColumns, source: Source, origin: Option<[f64; 3]>) -> Result<Added> {
        let name = source.part_name();
        let added = |new| Added {
            name: name.clone(),
            new,
        };
        if self.has(&name) {
            return Ok(added(false));
        }
        check_sums(map)?;
        let scratch = self.scratch_folder();
        let folder = Scratch::create(&scratch, &format!("{name}-"));
        let folder = folder.map_err(|error| at(&scratch, error))?;
        let tiles = rows::of_map(map)?;
        let write =
            |(tile, rows): &(_, _)| write_tile(folder.path(), *tile, rows, map.labels.is_some());
        let info = PartInfo {
            version: VERSION,
            digest: String::new(),
            source,
            map: MapInfo::of(map, origin),
            tiles: tiles.iter().map(write).collect::<Result<_>>()?,
        };
        write_manifest(&folder.path().join(PART_FILE), &info)?;
        open_to_all(folder.path())?;
        let place = self.parts_folder().join(&name);
        match folder.persist(&place) {
            Ok(()) => {
                // Not every file system can sync a folder.
                let _ = fs::File::open(self.parts_folder()).and_then(|folder| folder.sync_all());
                Ok(added(true))
            }
            Err(error) => {
                let there = [ErrorKind::DirectoryNotEmpty, ErrorKind::AlreadyExists];
                match there.contains(&error.kind()) && self.has(&name) {
                    // Another task has added the same part.
                    true => Ok(added(false)),
                    false => Err(at(&place, error)),
                }
            }
        }
    }

    /// The complete parts by name. Other folders, and parts of another version, are errors.
    pub fn parts(&self) -> Result<Vec<Part>> {
        let folder = self.parts_folder();
        let mut parts = Vec::new();
        for entry in fs::read_dir(&folder).map_err(|error| at(&folder, error))? {
            let path = entry.map_err(|error| at(&folder, error))?.path();
            let name = path
                .file_name()
                .unwrap_or_default()
                .to_string_lossy()
                .into_owned();
            let info = PartInfo::read(&path.join(PART_FILE))?;
            let expected = info.source.part_name();
            if expected != name {
                return Err(at(&path, format!("its source names it {expected}")));
            }
            parts.push(Part {
                name,
                folder: path,
                info,
            });
        }
        parts.sort_by(|a, b| a.name.cmp(&b.name));
        Ok(parts)
    }
}

/// Refuses sums that the points of the cell cannot reach, so that no engine can wrap around.
fn check_sums(map: &MapColumns) -> Result {
    let reach = u128::from(MapColumns::offset_reach(&map.lattice));
    for (key, voxel) in map.keys.iter().zip(map.voxels.iter().flatten()) {
        let bound = u128::from(voxel.count) * reach;
        if voxel
            .sum
            .iter()
            .any(|sum| u128::from(sum.unsigned_abs()) > bound)
        {
            return Err(format!(
                "cell {:?}: offset sums {:?} of {} points exceed the bound of {bound} units",
                key.unpack(),
                voxel.sum,
                voxel.count
            )
            .into());
        }
    }
    Ok(())
}

/// Sets the permissions of a new folder, which differ from those of a temporary one.
fn open_to_all(folder: &Path) -> Result {
    use std::os::unix::fs::PermissionsExt;
    fs::set_permissions(folder, fs::Permissions::from_mode(0o755))
        .map_err(|error| at(folder, error))
}

/// The map of some tiles, each verified.
pub fn read_map(folder: &Path, map: &MapInfo, tiles: &[TileInfo]) -> Result<MapContents> {
    let columns = map.columns().map_err(|error| at(folder, error))?;
    let mut rows = MapOfTiles::new(columns);
    for tile in tiles {
        rows.add(&tile.read(folder, map)?)
            .map_err(|error| at(folder, error))?;
    }
    let columns = rows.finish().map_err(|error| at(folder, error))?;
    MapContents::try_from(columns).map_err(|error| at(folder, error))
}

/// Digest of the files of a log: their names, sizes and bytes.
pub fn digest_of_log(bag: &Path) -> Result<String> {
    let mut found = BTreeMap::new();
    if bag.is_dir() {
        for entry in fs::read_dir(bag).map_err(|error| at(bag, error))? {
            let path = entry.map_err(|error| at(bag, error))?.path();
            let name = path
                .file_name()
                .unwrap_or_default()
                .to_string_lossy()
                .into_owned();
            if path.is_file() {
                found.insert(name, path);
            }
        }
    } else {
        found.insert(String::new(), bag.to_owned());
    }
    let mut texts = Vec::new();
    for (name, path) in found {
        let id = files::FileId::of(&path).map_err(|error| at(&path, error))?;
        texts.extend([name, id.sha256]);
    }
    Ok(digest_of(texts.iter().map(String::as_str)))
}

/// Reads a map file, whose size bounds the number of voxels.
pub fn read_map_file(path: &Path) -> Result<MapContents> {
    let file = fs::File::open(path).map_err(|error| at(path, error))?;
    let bytes = file.metadata().map_err(|error| at(path, error))?.len();
    let reader = std::io::BufReader::new(file);
    MapContents::read(reader, max_voxels_of(bytes)).map_err(|error| at(path, error))
}
