//! The `lattice` command as a user runs it.
#![allow(clippy::unwrap_used)]

mod browser;
mod calibrate;
mod evaluate;
mod map;
mod nodes;
mod paper;
