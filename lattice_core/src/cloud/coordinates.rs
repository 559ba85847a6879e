//! Places of the coordinates in a record.

/// Offsets of the coordinates in a point, and their type.
#[derive(Clone, Copy, Debug)]
pub(super) struct Coordinates {
    pub offsets: [usize; 3],
    pub wide: bool,
}
