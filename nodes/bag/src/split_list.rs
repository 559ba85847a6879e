//! Storage files of a bag: those listed in `metadata.yaml`, or those in the folder.

use std::{
    fs,
    path::{Path, PathBuf},
};

use super::{BagError, metadata::Metadata, sniff::is_ros1, split::Split};

/// Limit of storage files per bag.
const MAX_FILES: usize = 100_000;

/// Storage files in the order of the metadata; those in the folder if none of the listed ones exists.
///
/// Compressed files except the first stay closed while the counts of the metadata are consistent.
pub(crate) fn listed_splits(
    folder: &Path,
    metadata: &Metadata,
    metadata_path: &Path,
) -> Result<Vec<Split>, BagError> {
    too_many(folder, metadata.relative_file_paths.len())?;
    let mut files = metadata.storage_paths(folder, metadata_path)?;
    for (_, file) in &mut files {
        // Some versions of rosbag2 list compressed files by their uncompressed names.
        let packed = file.with_added_extension("zstd");
        if !file.exists() && packed.exists() {
            *file = packed;
        }
    }
    let is_there = files.iter().any(|(_, file)| file.exists());
    if !is_there && list(folder)?.any(|entry| entry.is_ok_and(|(_, name)| is_storage(&name))) {
        let (path, count) = (metadata_path.display(), files.len());
        log::warn!(
            "{path}: none of the {count} listed files exists; the files in the folder are read"
        );
        return splits_in(folder);
    }
    let mut credible = metadata.has_consistent_counts();
    let mut splits = Vec::new();
    for (entry, file) in files {
        inside(folder, &file)?;
        let listed = metadata.files.iter().find(|file| file.path == entry);
        // The first one is opened at once for the message definitions.
        let mut split = Split::new(file, credible && !splits.is_empty())?;
        match (&split.open, listed) {
            (Some(_), Some(listed)) => {
                credible &= split.message_count == Some(listed.message_count);
            }
            (None, Some(listed)) => {
                split.range_ns = listed.range_ns();
                split.message_count = Some(listed.message_count);
            }
            _ => {}
        }
        splits.push(split);
    }
    Ok(splits)
}

/// Storage files of a bag without `metadata.yaml`, in the order of their numbers.
pub(crate) fn splits_in(folder: &Path) -> Result<Vec<Split>, BagError> {
    let (mut files, mut ros1_files) = (Vec::new(), Vec::new());
    for entry in list(folder)? {
        let (file, name) = entry?;
        let files = match is_ros1(&name) {
            true => &mut ros1_files,
            false => &mut files,
        };
        if is_storage(&name) {
            inside(folder, &file)?;
            files.push(file);
        }
        too_many(folder, files.len())?;
    }
    if files.is_empty() {
        files = ros1_files;
    }
    if files.is_empty() {
        return Err(BagError::Foreign {
            path: folder.to_path_buf(),
            found: "a folder without metadata.yaml, .mcap, .db3 or .bag files".into(),
            remedy: "give the folder that `ros2 bag record` made, or a .bag file of ROS 1",
        });
    }
    files.sort_by_key(|path| (path.as_os_str().len(), path.clone()));
    // If both forms exist, compression had finished: the compressed one is complete.
    let packed = |path: &PathBuf| files.contains(&path.with_added_extension("zstd"));
    let twice: Vec<PathBuf> = files.iter().filter(|path| packed(path)).cloned().collect();
    files.retain(|path| !twice.contains(path));
    files
        .into_iter()
        .map(|file| Split::new(file, false))
        .collect()
}

/// Rejects a link to a file outside the bag.
fn inside(folder: &Path, file: &Path) -> Result<(), BagError> {
    let real = |path: &Path| fs::canonicalize(path).map_err(BagError::io(path, "locate"));
    if real(file)?.starts_with(real(folder)?) {
        return Ok(());
    }
    Err(BagError::PathTraversal {
        path: folder.to_path_buf(),
        entry: file
            .file_name()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned(),
    })
}

fn too_many(folder: &Path, files: usize) -> Result<(), BagError> {
    if files <= MAX_FILES {
        return Ok(());
    }
    let what = format!("a bag of more than {MAX_FILES} files");
    let remedy = "open the files one by one";
    Err(BagError::unsupported(folder, what, remedy))
}

/// True for the name of a storage file, compressed or not.
pub(crate) fn is_storage(name: &str) -> bool {
    let bare = name.strip_suffix(".zstd").unwrap_or(name);
    bare.ends_with(".mcap") || bare.ends_with(".db3") || is_ros1(bare)
}

/// Paths and names of the entries of a folder.
pub(crate) fn list(
    folder: &Path,
) -> Result<impl Iterator<Item = Result<(PathBuf, String), BagError>>, BagError> {
    let entries = fs::read_dir(folder).map_err(BagError::io(folder, "list"))?;
    Ok(entries.map(move |entry| {
        let entry = entry.map_err(BagError::io(folder, "list"))?;
        let name = entry.file_name().to_string_lossy().into_owned();
        Ok((entry.path(), name))
    }))
}

/// Sorts by start time; files of unknown time stay behind their predecessors.
pub(crate) fn in_order_of_time(splits: Vec<Split>) -> Vec<Split> {
    let mut place_ns = i64::MIN;
    let mut keyed: Vec<(i64, Split)> = Vec::with_capacity(splits.len());
    for split in splits {
        place_ns = split.range_ns.map_or(place_ns, |(start_ns, _)| start_ns);
        keyed.push((place_ns, split));
    }
    keyed.sort_by_key(|(place_ns, _)| *place_ns);
    keyed.into_iter().map(|(_, split)| split).collect()
}
