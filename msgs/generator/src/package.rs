//! Definitions of a ROS package, read from its folder.

use std::ffi::OsStr;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use crate::GenerateError;
use crate::definition::{Definition, is_identifier, parse};

/// Largest definition, bytes; the longest of ROS have some 20 kB.
const LARGEST: u64 = 1 << 20;

/// A package: its name, and its definitions in the order of their names.
#[derive(Debug)]
pub struct Package {
    pub name: String,
    pub files: Vec<File>,
}

/// A definition with the name of its message, service or action.
#[derive(Debug)]
pub struct File {
    pub path: PathBuf,
    pub name: String,
    pub definition: Definition,
}

impl Package {
    pub fn read(name: &str, folder: &Path) -> Result<Self, GenerateError> {
        let mut paths = definitions_in(folder)?;
        for kind in ["msg", "srv", "action"] {
            let folder = folder.join(kind);
            if folder.is_dir() {
                paths.extend(definitions_in(&folder)?);
            }
        }
        if paths.is_empty() {
            return Err(GenerateError::NoDefinitions(folder.to_owned()));
        }
        paths.sort();
        let files = paths.into_iter().map(File::read);
        Ok(Self {
            name: name.to_owned(),
            files: files.collect::<Result<_, _>>()?,
        })
    }
}

/// Files of a folder that end in `.msg`, `.srv` or `.action`.
fn definitions_in(folder: &Path) -> Result<Vec<PathBuf>, GenerateError> {
    let failed = |source| GenerateError::File {
        path: folder.to_owned(),
        source,
    };
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        if matches!(ending(&path), "msg" | "srv" | "action") && path.is_file() {
            found.push(path);
        }
    }
    Ok(found)
}

fn ending(path: &Path) -> &str {
    path.extension().and_then(OsStr::to_str).unwrap_or_default()
}

impl File {
    /// Error at a line of the file.
    pub fn fault(&self, line: usize, reason: String) -> GenerateError {
        GenerateError::Definition {
            file: self.path.clone(),
            line,
            reason,
        }
    }

    fn read(path: PathBuf) -> Result<Self, GenerateError> {
        let name = path.file_stem().and_then(OsStr::to_str).unwrap_or_default();
        let name = name.to_owned();
        let fault = |line, reason| GenerateError::Definition {
            file: path.clone(),
            line,
            reason,
        };
        if !is_identifier(&name) || !name.starts_with(|c: char| c.is_ascii_uppercase()) {
            return Err(fault(1, format!("`{name}` is no name of a message")));
        }
        let failed = |source| GenerateError::File {
            path: path.clone(),
            source,
        };
        if fs::metadata(&path).map_err(failed)?.len() > LARGEST {
            let reason = format!("above {LARGEST} bytes");
            return Err(failed(io::Error::other(reason)));
        }
        let text = fs::read_to_string(&path).map_err(failed)?;
        let definition = parse(&text, ending(&path)).map_err(|(line, text)| fault(line, text))?;
        Ok(Self {
            path,
            name,
            definition,
        })
    }
}
