//! Errors of bags, each with file, position, reason and remedy.

use std::{io, path::Path, path::PathBuf, sync::Arc};

use thiserror::Error;

/// Error of reading, writing or playing a bag.
#[derive(Clone, Debug, Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
#[non_exhaustive]
pub enum BagError {
    /// Error of the operating system.
    #[error("{}: cannot {doing}: {source}; check that the path exists, its permissions and the free space", path.display())]
    Io {
        path: PathBuf,
        doing: &'static str,
        #[source]
        source: Arc<io::Error>,
    },
    /// Not a storage file of rosbag2.
    #[error("{}: not a ROS 2 bag file: it is {found}; {remedy}", path.display())]
    Foreign {
        path: PathBuf,
        found: String,
        remedy: &'static str,
    },
    /// Truncated file, as after a crash of the recorder.
    #[error(
        "{}: truncated: the file ends at byte {size_bytes} inside {inside}; \
         {readable_messages} messages before it can be read; \
         rewrite it with `lattice bag recover`",
        path.display()
    )]
    Truncated {
        path: PathBuf,
        size_bytes: u64,
        /// The truncated part, with its own offset.
        inside: String,
        readable_messages: u64,
    },
    /// Data that contradict the format.
    #[error("{}: damaged at {position}: {reason}; {remedy}", path.display())]
    Corrupt {
        path: PathBuf,
        position: String,
        /// The contradiction, with values.
        reason: String,
        remedy: &'static str,
    },
    /// Invalid `metadata.yaml`.
    #[error("{}: {reason}; move the file away to have it rebuilt from the storage files", path.display())]
    Metadata {
        path: PathBuf,
        /// The reason, with line and column if known.
        reason: String,
    },
    /// `metadata.yaml` or a link refers to a path outside the bag.
    #[error("{}: {entry:?} is outside the bag folder: correct the entry, or replace the link by the file", path.display())]
    PathTraversal { path: PathBuf, entry: String },
    /// Size above a limit.
    #[error("{}: {what} at {position} takes {size_bytes} bytes, more than the limit of {limit_bytes}; {remedy}", path.display())]
    TooLarge {
        path: PathBuf,
        what: &'static str,
        position: String,
        size_bytes: u64,
        limit_bytes: u64,
        remedy: &'static str,
    },
    /// Unsupported feature.
    #[error("{}: {what} is not supported; {remedy}", path.display())]
    Unsupported {
        path: PathBuf,
        what: String,
        remedy: &'static str,
    },
    /// The target of a writer exists.
    #[error("{}: exists already{why}; choose another path{or_overwrite}", path.display())]
    Exists {
        path: PathBuf,
        /// Reason for keeping it, after a separator, or empty.
        why: String,
        /// Second remedy, or empty.
        or_overwrite: &'static str,
    },
    /// Argument out of range.
    #[error("{name}: {reason}")]
    Invalid {
        name: &'static str,
        /// Value and accepted range.
        reason: String,
    },
}

impl BagError {
    /// The same error for `file`: errors in a decompressed copy are reported for the compressed file.
    pub(crate) fn in_file(mut self, file: &Path) -> BagError {
        if let BagError::Io { path, .. }
        | BagError::Foreign { path, .. }
        | BagError::Truncated { path, .. }
        | BagError::Corrupt { path, .. }
        | BagError::TooLarge { path, .. }
        | BagError::Unsupported { path, .. } = &mut self
        {
            *path = file.to_path_buf();
        }
        self
    }

    /// The damage without its remedy.
    pub(crate) fn cause(&self) -> String {
        match self {
            BagError::Truncated {
                path,
                size_bytes,
                inside,
                readable_messages,
            } => {
                let path = path.display();
                format!(
                    "{path}: truncated: the file ends at byte {size_bytes} inside {inside}; \
                     {readable_messages} messages precede it"
                )
            }
            BagError::Corrupt {
                path,
                position,
                reason,
                ..
            } => format!("{}: damaged at {position}: {reason}", path.display()),
            other => other.to_string(),
        }
    }

    pub(crate) fn io(path: &Path, doing: &'static str) -> impl FnOnce(io::Error) -> BagError {
        move |source| BagError::Io {
            path: path.to_path_buf(),
            doing,
            source: Arc::new(source),
        }
    }

    pub(crate) fn corrupt(
        path: &Path,
        position: impl ToString,
        reason: impl ToString,
        remedy: &'static str,
    ) -> BagError {
        BagError::Corrupt {
            path: path.to_path_buf(),
            position: position.to_string(),
            reason: reason.to_string(),
            remedy,
        }
    }

    pub(crate) fn invalid(name: &'static str, reason: impl ToString) -> BagError {
        let reason = reason.to_string();
        BagError::Invalid { name, reason }
    }

    pub(crate) fn unsupported(path: &Path, what: String, remedy: &'static str) -> BagError {
        let path = path.to_path_buf();
        BagError::Unsupported { path, what, remedy }
    }

    pub(crate) fn sqlite(
        path: &Path,
        position: impl ToString,
        source: rusqlite::Error,
    ) -> BagError {
        Self::corrupt(
            path,
            position,
            source,
            "take another copy, or rescue the rest with `lattice bag recover`",
        )
    }
}
