//! Real data beside the checkout; not part of the repository.

use std::io::{Write, stderr};
use std::path::PathBuf;

/// `../shared/data/NAME` beside the repository, or `None` with a printed line when it is absent.
pub fn shared(name: &str) -> Option<PathBuf> {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR"));
    let path = root.parent()?.parent()?.join("shared/data").join(name);
    if path.exists() {
        return Some(path);
    }
    // Past the harness, which hides the output of passing tests.
    let _ = writeln!(
        stderr(),
        "SKIPPED: no {} beside the repository",
        path.display()
    );
    None
}
