//! Block of the last point.

/// Block of the last lookup.
#[derive(Clone, Copy)]
pub(super) struct Last {
    pub(super) block: u64,
    pub(super) number: u32,
}

impl Default for Last {
    fn default() -> Last {
        Last {
            block: u64::MAX,
            number: 0,
        }
    }
}
