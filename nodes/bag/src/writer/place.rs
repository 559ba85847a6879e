//! The place of a bag in the file system.

use std::fs;
use std::path::{Path, PathBuf};

use crate::BagError;
use crate::metadata::Metadata;
use crate::split_list::list;

/// Removes a bag at `path` if that is wanted; anything else there is kept and refused.
pub(super) fn make_way(path: &Path, overwrite: bool) -> Result<(), BagError> {
    let mut files = replaceable(path, overwrite, &[])?.into_iter();
    files.try_for_each(|file| fs::remove_file(&file).map_err(BagError::io(&file, "remove")))
}

/// Files of a bag at `path` that its metadata name, which one that is written there replaces. Refused where
/// that is not wanted, or where something else is there but for the names `beside`.
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
    let listed = path.join("metadata.yaml");
    let named = match listed.exists().then(|| Metadata::read(&listed)) {
        None => Vec::new(),
        Some(Ok(metadata)) => metadata.relative_file_paths,
        Some(Err(error)) => {
            return refuse(format!(" and no bag can be made out there ({error})"), "");
        }
    };
    let is_ours = |name: &str| {
        let endings = ["-wal", "-shm", "-journal"];
        let of_file = endings.iter().find_map(|ending| name.strip_suffix(ending));
        name == "metadata.yaml" || named.iter().any(|n| n == name || Some(&**n) == of_file)
    };
    let mut files = Vec::new();
    for entry in list(path)? {
        let (file, name) = entry?;
        if beside.contains(&&*name) {
            continue;
        }
        if !is_ours(&name) || file.is_dir() {
            let why = format!(" and holds {name:?}, which no metadata.yaml there names");
            return refuse(why, "");
        }
        files.push(file);
    }
    if !files.is_empty() && !overwrite {
        return refuse(String::new(), " or allow to overwrite");
    }
    Ok(files)
}
