//! Names of semantic classes.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

use serde::Deserialize;
use thiserror::Error;

/// Longest file, bytes.
const MAX_BYTES: u64 = 1 << 20;

/// Reason for rejecting a file of class names.
#[derive(Debug, Error)]
pub enum ClassesError {
    /// The system could not read the file.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// Not a list of classes.
    #[error("not YAML of the form \"classes: {{0: wall, 1: floor}}\": {0}")]
    Yaml(#[from] serde_yaml::Error),
    /// Above the size limit.
    #[error("longer than {MAX_BYTES} bytes")]
    TooLong,
}

#[derive(Deserialize)]
struct Classes {
    classes: BTreeMap<u16, String>,
}

/// Reads `classes:` with a name for each class number from a YAML file.
pub fn read_classes(path: &Path) -> Result<BTreeMap<u16, String>, ClassesError> {
    let mut text = String::new();
    let read = File::open(path)?
        .take(MAX_BYTES + 1)
        .read_to_string(&mut text)?;
    if read as u64 > MAX_BYTES {
        return Err(ClassesError::TooLong);
    }
    Ok(serde_yaml::from_str::<Classes>(&text)?.classes)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<BTreeMap<u16, String>, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("classes.yaml");
        std::fs::write(&path, text).unwrap();
        read_classes(&path).map_err(|error| error.to_string())
    }

    #[test]
    fn names_are_read_and_anything_else_is_refused() {
        let names = read("classes:\n  0: wall\n  17: other\n").unwrap();
        assert_eq!(
            names.into_iter().collect::<Vec<_>>(),
            [(0, "wall".into()), (17, "other".into())]
        );
        for (text, message) in [
            ("wall", "not YAML of the form"),
            ("classes: {70000: x}", "not YAML of the form"),
            (&"#".repeat(1 << 21), "longer than 1048576 bytes"),
        ] {
            let fault = read(text).unwrap_err();
            assert!(fault.contains(message), "{fault}");
        }
    }
}
