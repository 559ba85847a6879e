//! Location of a bag in the file system.

use std::fs;
use std::path::{Path, PathBuf};

use crate::BagError;
use crate::metadata::Metadata;
use crate::split_list::{is_storage, list};

/// Removes a bag at `path` if `overwrite` is set; anything else there is kept, with an error.
pub(super) fn make_way(path: &Path, overwrite: bool) -> Result<(), BagError> {
    let mut files = replaceable(path, overwrite, &[])?.into_iter();
    files.try_for_each(|file| fs::remove_file(&file).map_err(BagError::io(&file, "remove")))
}

/// Files of a bag at `path` that a new bag replaces: those named in its metadata, or numbered like ours if it has
/// none. An error if replacing is not allowed, or if anything else is there except
/// the names `beside`.
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
            return refuse(format!(" and is not recognised as a bag ({error})"), "");
        }
    };
    let folder = path.file_name().unwrap_or_default().to_string_lossy();
    let is_ours = |name: &str| {
        let endings = ["-wal", "-shm", "-journal"];
        let of_file = endings.iter().find_map(|ending| name.strip_suffix(ending));
        let file = of_file.unwrap_or(name);
        // A killed writer leaves no metadata.
        let is_unlisted = || named.is_empty() && is_numbered(file, &folder);
        name == "metadata.yaml" || named.iter().any(|n| n == file) || is_unlisted()
    };
    let mut files = Vec::new();
    for entry in list(path)? {
        let (file, name) = entry?;
        if beside.contains(&&*name) {
            continue;
        }
        if !is_ours(&name) || file.is_dir() {
            let why = format!(" and contains {name:?}, which is not part of the bag");
            return refuse(why, "");
        }
        files.push(file);
    }
    if !files.is_empty() && !overwrite {
        return refuse(String::new(), " or allow to overwrite");
    }
    Ok(files)
}

/// True for the name of a storage file that a writer creates in a folder of this name.
fn is_numbered(file: &str, folder: &str) -> bool {
    let number = file
        .strip_prefix(folder)
        .and_then(|rest| rest.strip_prefix('_'))
        .and_then(|rest| rest.split_once('.'));
    let digits = |number: &str| number.bytes().all(|byte| byte.is_ascii_digit());
    is_storage(file) && number.is_some_and(|(number, _)| !number.is_empty() && digits(number))
}
