//! Names of frames.

use super::TfInsertError;

const MAX_NAME_BYTES: usize = 256;
/// Maximum length of a name repeated in an error.
const SHOWN_CHARS: usize = 64;

/// Removes leading slashes, which tf1 wrote.
pub(super) fn bare(name: &str) -> &str {
    name.trim_start_matches('/')
}

/// Name from outside, truncated for a log.
pub(super) fn shown(name: &str) -> String {
    bare(name).chars().take(SHOWN_CHARS).collect()
}

/// Rejects names that are empty or too long.
pub(super) fn check_names(parent: &str, child: &str) -> Result<(), TfInsertError> {
    for name in [parent, child] {
        if name.len() > MAX_NAME_BYTES {
            return Err(TfInsertError::LongName {
                bytes: name.len(),
                max_bytes: MAX_NAME_BYTES,
            });
        }
    }
    if parent.is_empty() || child.is_empty() {
        return Err(TfInsertError::NoName {
            parent: parent.to_owned(),
            child: child.to_owned(),
        });
    }
    Ok(())
}
