//! Classes of a house, by number.

use std::collections::BTreeMap;

/// The classes, by number.
const CLASSES: &str = "wall floor ceiling tv cabinet desk table chair sofa bookshelf counter fridge \
                       bed door window curtain picture other";

pub(super) const WALL: u16 = 0;
pub(super) const FLOOR: u16 = 1;
pub(super) const CEILING: u16 = 2;
pub(super) const TV: u16 = 3;
pub(super) const CABINET: u16 = 4;
pub(super) const DESK: u16 = 5;
pub(super) const TABLE: u16 = 6;
pub(super) const CHAIR: u16 = 7;
pub(super) const SOFA: u16 = 8;
pub(super) const BOOKSHELF: u16 = 9;
pub(super) const COUNTER: u16 = 10;
pub(super) const FRIDGE: u16 = 11;
pub(super) const BED: u16 = 12;
pub(super) const DOOR: u16 = 13;
pub(super) const WINDOW: u16 = 14;
pub(super) const CURTAIN: u16 = 15;
pub(super) const PICTURE: u16 = 16;
pub(super) const OTHER: u16 = 17;

/// Names of the classes.
pub(super) fn names() -> BTreeMap<u16, String> {
    let names = CLASSES.split_whitespace().map(str::to_owned);
    (0..).zip(names).collect()
}
