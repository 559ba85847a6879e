//! Helpers of the tests.

pub mod clouds;
pub mod data;
pub mod domain;
pub mod flat;
pub mod maps;
pub mod peer;
pub mod python;
pub mod random;
pub mod static_layer;
