//! Slips of the paper as tables.

use crate::report::{Cell, Table};

/// Printed, what is wrong with it, what we take.
pub(super) type Slip = [&'static str; 4];

pub(super) fn slips(name: &str, slips: &[Slip]) -> Table {
    Table::new(
        name,
        "What is printed, and what we take",
        "where|printed|what is wrong|what we take",
        slips.iter().map(|slip| slip.map(Cell::from).into()),
    )
}
