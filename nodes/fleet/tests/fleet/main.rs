//! The program `lattice-fleet` as its users call it.
//!
//! Tests of logs need the program `lattice` in LATTICE_PROGRAM, those beside foreign engines a Python with
//! DuckDB, Polars and pyarrow in LATTICE_PYTHON; they say so and skip where there is none.
#![allow(clippy::unwrap_used)]

mod aligning;
mod bounds;
#[cfg(feature = "ballista")]
mod cluster;
mod damage;
mod engines;
mod fixture;
mod forged;
mod frames;
mod logs;
mod merging;
mod paths;
mod refusals;
mod signals;
