//! Map files of a replay.

use std::path::{Path, PathBuf};

use lattice_core::lattice::LatticeKind;

/// Map file of a lattice; with several its name precedes the extension.
pub fn map_file(path: &Path, kind: LatticeKind, several: bool) -> PathBuf {
    let mut path = path.to_owned();
    if several {
        let ending = path.extension().unwrap_or_default().to_owned();
        path.set_extension(kind.name());
        path.as_mut_os_string().push(".");
        path.as_mut_os_string().push(ending);
    }
    path
}
