//! Error in the values of a column.

use crate::voxels::codec::{CodecError, Varints};

/// Error in the values of a column, at the byte after it.
pub(super) struct ColumnError {
    pub(super) offset: usize,
    pub(super) reason: String,
}

impl From<CodecError> for ColumnError {
    fn from(error: CodecError) -> ColumnError {
        // The CRC matches, so the error was written.
        let (offset, reason) = match error {
            CodecError::Truncated { position } => {
                (position, "the values end within a number".to_owned())
            }
            CodecError::Varint { position } => (
                position,
                "a number is not a shortest 64-bit varint".to_owned(),
            ),
            CodecError::Key { index, position } => (
                position,
                format!("key {index} does not ascend or is not below 2^63"),
            ),
            CodecError::Count { value, position } => {
                (position, format!("count {value} does not fit 32 bits"))
            }
            CodecError::TooMany { .. } => (0, "there are too many values".to_owned()),
        };
        ColumnError { offset, reason }
    }
}

impl Varints<'_> {
    /// Error at the position of the next value.
    pub(super) fn error(&self, reason: String) -> ColumnError {
        ColumnError {
            offset: self.position(),
            reason,
        }
    }
}
