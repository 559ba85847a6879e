//! The place of a bag in the file system.

use std::fs;
use std::path::{Path, PathBuf};

use crate::BagError;
use crate::split_list::{is_storage, list};

/// Removes a bag at `path` if that is wanted; anything else there is kept and refused.
pub(super) fn make_way(path: &Path, overwrite: bool) -> Result<(), BagError> {
    let mut files = replaceable(path, overwrite, &[])?.into_iter();
    files.try_for_each(|file| fs::remove_file(&file).map_err(BagError::io(&file, "remove")))
}

/// Files of a bag at `path`, which one that is written there replaces. Refused where that is not wanted, or
/// where something else is there but for the names `beside`.
pub fn replaceable(
    path: &Path,
    overwrite: bool,
    beside: &[&str],
) -> Result<Vec<PathBuf>, BagError> {
    let refuse = |why: String, or_overwrite| {
        Err(BagError::Exists {
            path: path.to_path_buf(),
            why,
            or_overwrite,
        })
    };
    if !path.exists() {
        return Ok(Vec::new());
    }
    if !path.is_dir() {
        return refuse(" and is not a folder".into(), "");
    }
    let endings = [".db3-wal", ".db3-shm", ".db3-journal"];
    let is_ours = |name: &str| {
        name == "metadata.yaml"
            || is_storage(name)
            || endings.iter().any(|ending| name.ends_with(ending))
    };
    let mut files = Vec::new();
    for entry in list(path)? {
        let (file, name) = entry?;
        if beside.contains(&&*name) {
            continue;
        }
        if !is_ours(&name) || file.is_dir() {
            let why = format!(" and holds {name:?}, which is no part of a bag");
            return refuse(why, "");
        }
        files.push(file);
    }
    if !files.is_empty() && !overwrite {
        return refuse(String::new(), " or allow to overwrite");
    }
    Ok(files)
}
